//! What is drawn, whatever draws it: the HTML report and the figures share these descriptions, so they share one look.

use crate::envelope::outline;
use crate::examine::{Analysis, MOST_SERIES};
use crate::inputs::{Even, Window, finite, stretches};
use crate::line::whole;
use crate::peaks::SpectrumSummary;
use crate::phase;
use crate::spectrum::{Mode, Options, spectrogram};
use crate::spline::derivatives;
use crate::summary::{moves, rounding};
use recording::{text::counted, topics};
use std::collections::BTreeMap;
use std::ops::Range;

/// Okabe and Ito's colours, distinct to every kind of colour vision (jfly, 2008); black comes last: it vanishes on dark paper.
pub const COLOURS: [&str; 7] = [
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F",
];

const _: () = assert!(MOST_SERIES == COLOURS.len());

/// A line or a cloud of points.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Abscissae.
    pub x: Vec<f64>,
    /// Ordinates, as many; NaN where a curve is interrupted.
    pub y: Vec<f64>,
    /// Index into [`COLOURS`].
    pub colour: usize,
    /// Spread below and above the line, where it is a mean; empty otherwise.
    pub spread: Vec<(f64, f64)>,
}

/// One pair of axes with what is on them.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Name of its file and anchor.
    pub id: &'static str,
    /// Title.
    pub title: String,
    /// What it shows, in a sentence.
    pub note: String,
    /// Horizontal axis with its unit.
    pub x_label: String,
    /// Vertical axis with its unit.
    pub y_label: String,
    /// Lines.
    pub series: Vec<Series>,
    /// Horizontal lines and their names.
    pub levels: Vec<(f64, String)>,
    /// Vertical lines and their names.
    pub marks: Vec<(f64, String)>,
    /// A horizontal band and its name.
    pub band: Option<(f64, f64, String)>,
    /// The stretch of the abscissa that is analysed.
    pub window: Option<(f64, f64)>,
    /// Logarithmic ordinate.
    pub log_y: bool,
    /// Range of the abscissa, where not that of the data.
    pub x_range: Option<(f64, f64)>,
    /// Points instead of lines.
    pub points: bool,
    /// The abscissa is the recording's time: such panels are zoomed together.
    pub time: bool,
    /// Where nobody can zoom, only so many seconds are drawn, of the middle of the window: all of them would be one patch of colour.
    pub shown_s: Option<f64>,
}

impl Panel {
    pub(super) fn new(id: &'static str, title: &str, x_label: &str, y_label: &str) -> Self {
        Panel {
            id,
            title: title.into(),
            note: String::new(),
            x_label: x_label.into(),
            y_label: y_label.into(),
            series: Vec::new(),
            levels: Vec::new(),
            marks: Vec::new(),
            band: None,
            window: None,
            log_y: false,
            x_range: None,
            points: false,
            time: false,
            shown_s: None,
        }
    }

    fn over_time(id: &'static str, title: &str, y_label: &str, a: &Analysis) -> Self {
        let window = Some((a.window.start_s, a.window.end_s));
        Panel {
            time: true,
            window,
            ..Panel::new(id, title, "time, s", y_label)
        }
    }

    /// A curve of what is finite, with a NaN in each of its holes: nothing is drawn through them.
    fn line(&mut self, name: impl Into<String>, t_s: &[f64], x: &[f64]) {
        let (t_s, values) = finite(t_s, x);
        let mut parts = stretches(&t_s, 0.0);
        if parts.len() > MOST_PARTS {
            parts = vec![Range {
                start: 0,
                end: t_s.len(),
            }];
        }
        let (mut x, mut y) = (Vec::new(), Vec::new());
        for part in parts {
            if let Some(end_s) = x.last() {
                x.push(0.5 * (end_s + t_s[part.start]));
                y.push(f64::NAN);
            }
            let (mut times, mut points) = outline(&t_s[part.clone()], &values[part]);
            x.append(&mut times);
            y.append(&mut points);
        }
        if !x.is_empty() {
            self.series.push(Series {
                name: name.into(),
                x,
                y,
                colour: self.series.len() % COLOURS.len(),
                ..Series::default()
            });
        }
    }
}

/// A curve in more parts than this is something else than a signal with holes.
const MOST_PARTS: usize = 50;

/// A surface over time and frequency.
#[derive(Clone, Debug)]
pub struct Image {
    /// Name of its file and anchor.
    pub id: &'static str,
    /// Title.
    pub title: String,
    /// What it shows, in a sentence.
    pub note: String,
    /// Vertical axis with its unit.
    pub y_label: String,
    /// What the colour means, with its unit.
    pub value_label: String,
    /// First and last time (s).
    pub x_range: (f64, f64),
    /// Lowest and highest frequency (Hz).
    pub y_range: (f64, f64),
    /// `values[time][frequency]`; NaN where nothing was measured.
    pub values: Vec<Vec<f64>>,
}

/// Anything that can be drawn.
#[derive(Clone, Debug)]
pub enum Plot {
    /// Axes with lines.
    Panel(Panel),
    /// A spectrogram.
    Image(Image),
}

/// Seconds of quick curves in a picture that nobody can zoom.
const SHOWN_S: f64 = 10.0;
/// Events marked in plots over time: kinds of which there are at most this many.
const MOST_MARKS: usize = 12;
/// Highest frequency shown in spectra, as a multiple of f.
const SPECTRUM_REACH: f64 = 4.0;

/// Every plot that a recording has the columns for, in the order in which they are shown.
pub fn plots(a: &Analysis) -> Vec<Plot> {
    let i = &a.inputs;
    let mut out = Vec::new();
    let mut panel = |p: Panel| {
        if p.series.iter().any(|s| !s.x.is_empty()) {
            out.push(Plot::Panel(p));
        }
    };
    let degrees = |x: &[f64]| x.iter().map(|x| x.to_degrees()).collect::<Vec<_>>();

    let imu = |source: &str| {
        if source == "imu" {
            ", estimated from the IMU"
        } else {
            ""
        }
    };
    let about = if i.sources.levelled {
        " about their means"
    } else {
        ""
    };
    let title = format!("Roll and tilt{about}{}", imu(&i.sources.attitude));
    let mut roll = Panel::over_time("roll", &title, "angle, deg", a);
    roll.note = "Roll turns about the pole; tilt, where it is positive, lowers its front (REP-103). The shaded stretch is the analysis window.".into();
    roll.line("roll", &i.t_s, &degrees(&i.roll_rad));
    roll.line("tilt", &i.t_s, &degrees(&i.pitch_rad));
    roll.marks = marks(a);
    panel(roll);

    let title = match imu(&i.sources.height) {
        "" => "Height of the centre of mass".to_owned(),
        from => format!("Height about its mean{from}"),
    };
    let mut height = Panel::over_time("height", &title, "height, m", a);
    let (t_s, height_m) = i.height();
    height.line("height", t_s, height_m);
    height.marks = marks(a);
    panel(height);

    let mut forces = Panel::over_time("forces", "Normal forces of the handles", "force, N", a);
    forces.shown_s = Some(SHOWN_S);
    if i.normal_n.len() <= COLOURS.len() {
        for (k, n) in i.normal_n.iter().enumerate() {
            forces.line(format!("handle {}", k + 1), i.force_times(), n);
        }
    } else {
        forces.note = format!(
            "Of {} handles at each moment: the table of signals has each of them.",
            i.normal_n.len()
        );
        for (name, x) in bundled(&i.normal_n) {
            forces.line(name, i.force_times(), &x);
        }
    }
    panel(forces);

    let title = format!("Support over weight{}", imu(&i.sources.forces));
    let mut support = Panel::over_time("support", &title, "N_tot / (M g)", a);
    support.note = "Below the dashed line at 0.05 nobody holds it: that is T_float.".into();
    match i.mass_kg {
        Some(mass_kg) if !i.normal_n.is_empty() => {
            let weight_n = mass_kg * i.gravity_m_per_s2;
            let ratio: Vec<f64> = i.total_force_n().iter().map(|n| n / weight_n).collect();
            support.line("all handles", i.force_times(), &ratio);
        }
        _ => support.line("specific force", &i.t_s, &i.support_ratio),
    }
    support.shown_s = Some(SHOWN_S);
    support.levels = vec![
        (crate::metrics::FLOAT_SHARE, "0.05".into()),
        (1.0, "at rest".into()),
    ];
    panel(support);

    if i.phase_rad.len() > 1 {
        let phases: Vec<&[f64]> = i.phase_rad.iter().map(|p| &p[..]).collect();
        let mut sync = Panel::over_time(
            "synchrony",
            "Synchrony of the carriers",
            "order parameter r",
            a,
        );
        sync.line("r", i.phase_times(), &phase::order_parameter(&phases));
        if i.phases_are_measured {
            // Steps of the same people are not independent at a moment; what chance gives is the metric's, from surrogates.
            sync.note = "Dashed: the mean r of the same steps shifted against one another in time, which is chance for measured phases.".into();
            let chance = a.metrics.number("synchrony_chance");
            sync.levels = chance
                .map(|r| (r, "chance, mean".into()))
                .into_iter()
                .collect();
        } else {
            let chance = phase::chance_level(phases.len());
            sync.note = format!(
                "The band holds 95 % of what {} independent carriers show at a moment; their mean is {:.3}.",
                phases.len(),
                chance.mean
            );
            sync.band = Some((chance.band[0], chance.band[1], "chance, 95 %".into()));
            sync.levels = vec![(chance.mean, "chance, mean".into())];
        }
        sync.marks = marks(a);
        panel(sync);
    }

    ENERGIES
        .iter()
        .filter_map(|energy| energies(a, energy))
        .for_each(&mut panel);

    for (id, title, name) in [
        ("psd_roll", "Spectrum of the roll", "roll"),
        ("psd_height", "Spectrum of the height", "height"),
    ] {
        if let Some((_, s)) = role_spectrum(a, name) {
            panel(psd(id, title, name, s));
        }
    }

    portrait(a)
        .into_iter()
        .chain(force_plane(a))
        .for_each(&mut panel);
    // The account has panels of its own; what each effect did is a sum since the start, which the table of signals tells.
    let traces = (a.traces.iter()).filter(|t| !t.topic.starts_with(topics::ENERGY));
    let last = traces.clone().count().saturating_sub(1);
    for (k, trace) in traces.enumerate() {
        // One signal alone says what it is.
        let (title, label) = match &trace.series[..] {
            [(name, ..)] => (format!("{}.{name}", trace.topic), name.as_str()),
            _ => (trace.topic.clone(), "value"),
        };
        let label = match trace.unit.as_str() {
            "" => label.to_owned(),
            known => unit(known),
        };
        let mut p = Panel::over_time("signals", &title, &label, a);
        // That beats are counted is no curve.
        let counts = |name: &str| trace.topic == topics::BEAT && name == "number";
        for (name, t_s, x) in trace.series.iter().filter(|(name, ..)| !counts(name)) {
            p.line(name.clone(), t_s, x);
        }
        if k == last && a.undrawn > 0 {
            p.note = format!(
                "{} not drawn: --signal and --topic choose which are.",
                counted(a.undrawn, "more signal is", "more signals are")
            );
        }
        panel(p);
    }
    if let Some(image) = roll_spectrogram(a) {
        // After the spectra, before the planes.
        let place = out.iter().position(|p| matches!(p, Plot::Panel(p) if matches!(p.id, "portrait" | "force_plane" | "signals"))).unwrap_or(out.len());
        out.insert(place, Plot::Image(image));
    }
    out
}

/// Mean, largest and smallest of some columns at each sample, of what is finite there; NaN where nothing is.
fn bundled(columns: &[Vec<f64>]) -> [(&'static str, Vec<f64>); 3] {
    let samples = columns.first().map_or(0, Vec::len);
    let each = |f: fn(&[f64]) -> f64| -> Vec<f64> {
        let at = |k: usize| {
            let known = columns.iter().map(|c| c[k]).filter(|x| x.is_finite());
            f(&known.collect::<Vec<_>>())
        };
        (0..samples).map(at).collect()
    };
    [
        ("mean", each(|x| x.iter().sum::<f64>() / x.len() as f64)),
        (
            "largest",
            each(|x| x.iter().copied().fold(f64::NAN, f64::max)),
        ),
        (
            "smallest",
            each(|x| x.iter().copied().fold(f64::NAN, f64::min)),
        ),
    ]
}

/// Onset, beat and locking always; other kinds while they are few.
fn marks(a: &Analysis) -> Vec<(f64, String)> {
    let mut count: BTreeMap<&str, usize> = BTreeMap::new();
    for e in &a.events {
        *count.entry(e.kind).or_default() += 1;
    }
    a.events
        .iter()
        .filter(|e| count[e.kind] <= MOST_MARKS && e.kind != "jump")
        .map(|e| (e.t_s, e.kind.replace('_', " ")))
        .collect()
}

/// A plot of energies: id, title, note, the fields of the ledger with their names, and what [`Panel::shown_s`] says.
type Energies = (
    &'static str,
    &'static str,
    &'static str,
    [(&'static str, &'static str); 3],
    Option<f64>,
);

/// What is stored and what went in and out are of different size: a plot each.
const ENERGIES: [Energies; 2] = [
    (
        "energy",
        "Stored energy",
        "The potential's zero is arbitrary: it is drawn about its mean.",
        [
            ("kinetic_j", "kinetic"),
            ("potential_j", "potential"),
            ("elastic_j", "elastic"),
        ],
        Some(SHOWN_S),
    ),
    (
        "ledger",
        "Energy ledger",
        "Since the start. What is stored and dissipated came from work; the solver's error is what stays unexplained.",
        [
            ("work_in_j", "work in"),
            ("dissipated_j", "dissipated"),
            ("unexplained_j", "unexplained"),
        ],
        None,
    ),
];

fn energies(a: &Analysis, &(id, title, note, fields, shown_s): &Energies) -> Option<Panel> {
    let trace = a.traces.iter().find(|t| t.topic == topics::ENERGY)?;
    let mut p = Panel::over_time(id, title, "energy, J", a);
    p.note = note.into();
    p.shown_s = shown_s;
    let rounded_j = (trace.series.iter().map(|(.., j)| rounding(j))).fold(0.0, f64::max);
    let mut some = false;
    for (field, name) in fields {
        let Some((_, t_s, j)) = trace.series.iter().find(|(known, ..)| *known == field) else {
            continue;
        };
        let mean_j = match field {
            "potential_j" => j.iter().sum::<f64>() / j.len().max(1) as f64,
            _ => 0.0,
        };
        let about: Vec<f64> = j.iter().map(|j| j - mean_j).collect();
        some |= about.iter().any(|j| j.abs() > rounded_j);
        p.line(name, t_s, &about);
    }
    some.then_some(p)
}

/// The spectrum of the signal that plays a role.
pub(super) fn role_spectrum<'a>(
    a: &'a Analysis,
    role: &str,
) -> Option<&'a (String, SpectrumSummary)> {
    let path = a
        .roles
        .iter()
        .find(|(r, _)| *r == role)
        .and_then(|(_, p)| p.first())
        .map_or(role, |p| p.as_str());
    a.spectra.iter().find(|(p, _)| p == path || p == role)
}

/// A density's label, and what it is multiplied by to be drawn: angles are drawn in degrees.
pub(super) fn density(s: &SpectrumSummary) -> (String, f64) {
    let (drawn, scale) = match s.unit.as_str() {
        "(rad)^2/Hz" => ("(deg)^2/Hz", 1f64.to_degrees().powi(2)),
        other => (other, 1.0),
    };
    (format!("density, {}", unit(drawn)), scale)
}

fn psd(id: &'static str, title: &str, name: &str, s: &SpectrumSummary) -> Panel {
    let nyquist = s.spectrum.hz.last().copied().unwrap_or(1.0);
    let reach = s
        .f_hz
        .map_or(nyquist, |f| (SPECTRUM_REACH * f).min(nyquist));
    let (label, scale) = density(s);
    let mut p = Panel::new(id, title, "frequency, Hz", &label);
    let plural = if s.segments == 1 { "" } else { "s" };
    p.note = format!(
        "Welch, {} segment{plural} of {:.1} s, bins {:.3} Hz apart, 95 % of the noise within ×{:.2} … ×{:.2}.",
        s.segments, s.segment_s, s.resolution_hz, s.confidence_95[0], s.confidence_95[1]
    );
    let shown = s
        .spectrum
        .hz
        .iter()
        .zip(&s.spectrum.power)
        .filter(|(f, p)| **f > 0.0 && **f <= reach && **p > 0.0);
    let (x, y) = shown.map(|(f, p)| (*f, scale * *p)).unzip();
    p.series.push(Series {
        name: name.into(),
        x,
        y,
        ..Series::default()
    });
    p.log_y = true;
    p.x_range = Some((0.0, reach));
    if let Some(f) = s.f_hz {
        let lines = [(0.5, "f/2"), (1.0, "f"), (2.0, "2f"), (3.0, "3f")];
        p.marks = lines
            .iter()
            .filter(|(m, _)| m * f <= reach)
            .map(|(m, name)| (m * f, (*name).to_owned()))
            .collect();
    }
    p
}

/// A unit as people write it: `m/s²` for `m/s^2`, `rad²/Hz` for `(rad)^2/Hz`.
fn unit(text: &str) -> String {
    let mut out = text.replace("^2", "²");
    if let (Some(open), Some(close)) = (out.find('('), out.find(")²")) {
        // Brackets around one word say nothing.
        if open < close && out[open + 1..close].chars().all(char::is_alphabetic) {
            out.remove(close);
            out.remove(open);
        }
    }
    out
}

fn inside(t_s: &[f64], window: Window) -> Range<usize> {
    window.range(t_s)
}

/// Roll against its rate in the window.
fn portrait(a: &Analysis) -> Option<Panel> {
    let i = &a.inputs;
    if i.roll_rad.len() != i.t_s.len() {
        return None;
    }
    let range = inside(&i.t_s, a.window);
    let (t_s, roll_rad) = finite(&i.t_s[range.clone()], &i.roll_rad[range]);
    // A rath that does not roll has no portrait.
    if !moves(&roll_rad) {
        return None;
    }
    let mut p = Panel::new(
        "portrait",
        "Phase portrait of the roll",
        "roll, deg",
        "roll rate, deg/s",
    );
    p.note = "A closed loop is a steady swing; a spiral grows or dies.".into();
    let degrees = |x: &f64| x.to_degrees();
    let step = thinned(roll_rad.len());
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for part in stretches(&t_s, 0.0) {
        let roll_rad = &roll_rad[part.clone()];
        let Some((rate, _)) = derivatives(&t_s[part], roll_rad) else {
            continue;
        };
        // Nobody knows the way through a hole.
        if let Some(last) = x.last() {
            x.push(*last);
            y.push(f64::NAN);
        }
        x.extend(roll_rad.iter().step_by(step).map(degrees));
        y.extend(rate.iter().step_by(step).map(degrees));
    }
    p.series.push(Series {
        name: "roll".into(),
        x,
        y,
        ..Series::default()
    });
    Some(p)
}

/// The first two handles' forces against each other in the window.
fn force_plane(a: &Analysis) -> Option<Panel> {
    let i = &a.inputs;
    let [first, second, ..] = &i.normal_n[..] else {
        return None;
    };
    let range = inside(i.force_times(), a.window);
    if !moves(&first[range.clone()]) && !moves(&second[range.clone()]) {
        return None;
    }
    let mut p = Panel::new(
        "force_plane",
        "One handle against the other",
        "force of handle 1, N",
        "force of handle 2, N",
    );
    p.note = "On the diagonal the handles carry alike; on an axis one of them is slack.".into();
    let step = thinned(range.len());
    let both = first[range.clone()]
        .iter()
        .zip(&second[range])
        .filter(|(a, b)| a.is_finite() && b.is_finite())
        .step_by(step);
    let (x, y) = both.unzip();
    p.series.push(Series {
        name: "samples".into(),
        x,
        y,
        ..Series::default()
    });
    p.points = true;
    Some(p)
}

/// Of so many points of a curve in a plane one in so many is drawn: at most 4000.
fn thinned(points: usize) -> usize {
    points.div_ceil(4000).max(1)
}

/// Length of a spectrogram's segment (s).
const SPECTROGRAM_SEGMENT_S: f64 = 8.0;

/// Density of the roll over time, in decibels, over the whole recording.
fn roll_spectrogram(a: &Analysis) -> Option<Image> {
    let i = &a.inputs;
    if i.roll_rad.len() != i.t_s.len() || !moves(&i.roll_rad) {
        return None;
    }
    let (t_s, known_rad) = finite(&i.t_s, &i.roll_rad);
    // Not at all where most of it was not measured.
    let Even {
        x: roll,
        step_s,
        holes,
    } = whole(&t_s, &known_rad)?;
    let fs_hz = 1.0 / step_s;
    let nperseg = (SPECTROGRAM_SEGMENT_S * fs_hz).round() as usize;
    if roll.len() < known_rad.len() || roll.len() < 2 * nperseg {
        return None;
    }
    // About 240 columns, whatever the length.
    let step = ((roll.len() - nperseg) / 240).max(1).min(nperseg / 2);
    let options = Options {
        noverlap: Some(nperseg - step),
        ..Options {
            nperseg,
            ..Options::default()
        }
    };
    let degrees: Vec<f64> = roll.iter().map(|x| x.to_degrees()).collect();
    let s = spectrogram(&degrees, fs_hz, &options, Mode::Psd).ok()?;
    let f_hz = a
        .metrics
        .number("beat_hz")
        .or_else(|| a.metrics.number("peak_hz"));
    let reach = f_hz.map_or(fs_hz / 2.0, |f| (2.5 * f).min(fs_hz / 2.0));
    let bins = s.hz.iter().take_while(|f| **f <= reach).count();
    if bins < 3 {
        return None;
    }
    let every = s.power.len().div_ceil(300).max(1);
    // Whether nothing was measured in most of a segment.
    let unknown = |k: usize| {
        let (from, to) = (k * step, k * step + nperseg);
        let lost = |hole: &Range<usize>| hole.end.min(to).saturating_sub(hole.start.max(from));
        2 * holes.iter().map(lost).sum::<usize>() > nperseg
    };
    let values: Vec<Vec<f64>> = (s.power.iter().enumerate())
        .step_by(every)
        // Each segment is counted from its own mean: what is left at 0 Hz is none of the roll's.
        .map(|(k, p)| match unknown(k) {
            true => vec![f64::NAN; bins - 1],
            false => (p[1..bins].iter())
                .map(|p| 10.0 * p.max(1e-12).log10())
                .collect(),
        })
        .collect();
    // A cell reaches half a step to either side of its middle.
    let (half_s, half_hz) = (0.5 * (every * step) as f64 / fs_hz, 0.5 * s.hz[1]);
    let last_s = s.t_s[(values.len() - 1) * every];
    Some(Image {
        id: "spectrogram",
        title: "Spectrogram of the roll".into(),
        note: format!(
            "Segments of {SPECTROGRAM_SEGMENT_S:.0} s, {:.3} Hz apart{}.",
            s.hz[1],
            match holes.is_empty() {
                true => "",
                false => "; blank where most of one was not measured",
            }
        ),
        y_label: "frequency, Hz".into(),
        value_label: "dB re 1 deg²/Hz".into(),
        x_range: (t_s[0] + s.t_s[0] - half_s, t_s[0] + last_s + half_s),
        y_range: (s.hz[1] - half_hz, s.hz[bins - 1] + half_hz),
        values,
    })
}

#[cfg(test)]
mod tests {
    use super::{SpectrumSummary, Window};

    #[test]
    fn many_columns_are_drawn_as_three() {
        let columns = [
            vec![1.0, f64::NAN, f64::NAN],
            vec![2.0, 5.0, f64::NAN],
            vec![6.0, -1.0, f64::NAN],
        ];
        for (name, expected) in [
            ("mean", [3.0, 2.0]),
            ("largest", [6.0, 5.0]),
            ("smallest", [1.0, -1.0]),
        ] {
            let all = super::bundled(&columns);
            let (_, found) = all.iter().find(|(n, _)| *n == name).unwrap();
            assert!(
                found[..2] == expected && found[2].is_nan(),
                "{name}: {found:?}"
            );
        }
    }

    /// A swing of 10° holds 50 deg², all of it in its line.
    #[test]
    fn the_density_of_an_angle_is_in_degrees() {
        let t_s: Vec<f64> = (0..1800).map(|k| f64::from(k) / 30.0).collect();
        let swing = |t: &f64| 10f64.to_radians() * (std::f64::consts::TAU * t).sin();
        let roll: Vec<f64> = t_s.iter().map(swing).collect();
        let spectrum = SpectrumSummary::of(&t_s, &roll, Window::ALL, None, "rad").unwrap();
        let drawn = super::psd("roll", "", "", &spectrum);
        assert_eq!(drawn.y_label, "density, deg²/Hz");
        let held: f64 = drawn.series[0].y.iter().sum::<f64>() * spectrum.spectrum.hz[1];
        assert!((held - 50.0).abs() < 1e-3, "{held}");
    }

    #[test]
    fn units_are_written_as_people_do() {
        for (text, shown) in [
            ("(rad)^2/Hz", "rad²/Hz"),
            ("(m/s^2)^2/Hz", "(m/s²)²/Hz"),
            ("m/s^2", "m/s²"),
            ("rad/s", "rad/s"),
            ("", ""),
        ] {
            assert_eq!(super::unit(text), shown);
        }
    }
}

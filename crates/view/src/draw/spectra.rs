//! Power spectra as drawings with axes: frequency linear, power in dB below the peak, lines at f/2, f and 2f.
//!
//! Curves of one unit share a reference, the highest of their peaks; curves of different units have each its own.
//!
//! Rerun plots over timelines only, and its bar charts have no logarithm; hence lines in a plane with ticks of their own.

use analyze::peaks::SpectrumSummary;
use analyze::spectrum::Spectrum;
use re_sdk_types::archetypes::{LineStrips2D, Points2D};
use re_sdk_types::components::Radius;

use crate::blueprint::View;
use crate::palette;
use crate::store::Store;
use crate::take::Take;

/// Size of the drawn frame, in units of the drawing.
const WIDTH: f64 = 1.5;
/// Its height.
const HEIGHT: f64 = 1.0;
/// The lowest power that is drawn, dB below the peak.
const FLOOR_DB: f64 = -60.0;
/// The axis reaches at least so far, Hz: a slow line is seen as slow.
const LEAST_TOP_HZ: f64 = 4.0;
/// Fewer bins make no spectrum for the eye.
const FEWEST_BINS: usize = 12;
/// What moves by no more, m or rad, is at rest: its spectrum is of rounding.
const NOTHING: f64 = 1e-9;

/// One curve.
pub struct Curve<'a> {
    /// Its name in the entity tree.
    pub entity: &'a str,
    /// The spectrum.
    pub spectrum: &'a Spectrum,
    /// Its colour.
    pub color: u32,
}

/// The drive's frequency f, Hz, as in every table: the beat where one is known, else the strongest line of the height.
pub fn drive_hz(take: &Take) -> Option<f64> {
    let number = |name: &str| take.metrics.number(name);
    number("beat_hz").or_else(|| number("peak_hz"))
}

/// Draws the spectra of height and roll where there are both or one of them.
pub fn draw(store: &mut Store<'_>, take: &Take) -> anyhow::Result<Option<View>> {
    let (inputs, f_hz) = (&take.inputs, drive_hz(take));
    let top_hz = f_hz.map_or(6.0, |f| (2.6 * f).max(LEAST_TOP_HZ));
    let of = |t_s: &[f64], x: &[f64]| -> Option<Spectrum> {
        let finite = || x.iter().copied().filter(|x| x.is_finite());
        let range = finite().fold(f64::MIN, f64::max) - finite().fold(f64::MAX, f64::min);
        let found = SpectrumSummary::of(t_s, x, take.window, f_hz, "")?.spectrum;
        let told = bins(&found, top_hz).count() >= FEWEST_BINS && peak(&found, top_hz) > 0.0;
        (told && range > NOTHING).then_some(found)
    };
    let (t_s, height_m) = inputs.height();
    let (height, roll) = (of(t_s, height_m), of(&inputs.t_s, &inputs.roll_rad));
    let title = match (&height, &roll) {
        (Some(_), Some(_)) => "Spectra of height (blue), roll (vermilion)",
        (Some(_), None) => "Spectrum of the height",
        (None, Some(_)) => "Spectrum of the roll",
        (None, None) => return Ok(None),
    };
    let found = [
        ("height", &height, palette::BLUE),
        ("roll", &roll, palette::VERMILION),
    ];
    let curves: Vec<Curve<'_>> = found
        .into_iter()
        .filter_map(|(entity, spectrum, color)| {
            Some(Curve {
                entity,
                spectrum: spectrum.as_ref()?,
                color,
            })
        })
        .collect();
    // Metres and radians have no common decibel.
    let own = curves
        .iter()
        .map(|c| peak(c.spectrum, top_hz))
        .collect::<Vec<f64>>();
    drawing(store, "/spectra/rath", title, &curves, &own, f_hz, top_hz)
}

/// The highest power up to `top_hz`, without 0 Hz.
pub fn peak(spectrum: &Spectrum, top_hz: f64) -> f64 {
    bins(spectrum, top_hz).map(|(_, p)| p).fold(0.0, f64::max)
}

/// Frequencies and powers that are drawn.
fn bins(spectrum: &Spectrum, top_hz: f64) -> impl Iterator<Item = (f64, f64)> {
    let all = spectrum
        .hz
        .iter()
        .copied()
        .zip(spectrum.power.iter().copied());
    all.skip(1).take_while(move |(hz, _)| *hz <= top_hz)
}

/// Sends a drawing of `curves` from 0 to `top_hz`, each in dB below its `reference`, and gives its view; `None` where no curve has
/// power.
pub fn drawing(
    store: &mut Store<'_>,
    origin: &str,
    title: &str,
    curves: &[Curve<'_>],
    reference: &[f64],
    f_hz: Option<f64>,
    top_hz: f64,
) -> anyhow::Result<Option<View>> {
    let nyquist = curves
        .iter()
        .filter_map(|c| c.spectrum.hz.last())
        .copied()
        .fold(0.0, f64::max);
    let top_hz = top_hz.min(nyquist);
    let mut any = false;
    for (curve, reference) in curves.iter().zip(reference) {
        let Some(points) = polyline(curve.spectrum, *reference, top_hz) else {
            continue;
        };
        any = true;
        let line = LineStrips2D::new([points])
            .with_radii([Radius::new_ui_points(1.0)])
            .with_colors([curve.color])
            .with_draw_order(20.0);
        store.fixed(&format!("{origin}/{}", curve.entity), &line)?;
    }
    if !any {
        return Ok(None);
    }
    axes(store, origin, top_hz)?;
    // In the first bins lies what is left of drifts, no line.
    let resolved = |f_hz: &f64| {
        let mut all = curves.iter();
        all.any(|c| c.spectrum.hz.get(3).is_some_and(|hz| f_hz >= hz))
    };
    if let Some(f_hz) = f_hz.filter(resolved) {
        marks(store, origin, f_hz, top_hz)?;
    }
    Ok(Some(View::plane(
        title,
        origin,
        [-0.16, WIDTH + 0.08],
        [-HEIGHT - 0.28, 0.17],
    )))
}

/// Where a frequency and a power are drawn.
fn place(hz: f64, db: f64, top_hz: f64) -> [f32; 2] {
    let db = db.clamp(FLOOR_DB, 0.0);
    [
        (WIDTH * hz / top_hz) as f32,
        (-HEIGHT * (1.0 - db / FLOOR_DB)) as f32,
    ]
}

/// The curve, without 0 Hz, in dB below `reference`; `None` where there is no power.
fn polyline(spectrum: &Spectrum, reference: f64, top_hz: f64) -> Option<Vec<[f32; 2]>> {
    if !(peak(spectrum, top_hz) > 0.0 && reference > 0.0 && top_hz > 0.0) {
        return None;
    }
    let points = bins(spectrum, top_hz);
    Some(
        points
            .map(|(hz, p)| place(hz, 10.0 * (p / reference).log10(), top_hz))
            .collect(),
    )
}

fn axes(store: &mut Store<'_>, origin: &str, top_hz: f64) -> anyhow::Result<()> {
    // Steps of 1, 2 or 5 that give four to eight ticks.
    let step = [
        0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0,
    ]
    .into_iter()
    .find(|step| top_hz / step <= 8.0)
    .unwrap_or(1000.0);
    let ticks: Vec<f64> = (0..=(top_hz / step + 1e-9) as usize)
        .map(|k| k as f64 * step)
        .collect();
    let levels = [0.0, -20.0, -40.0, -60.0];
    let mut strips = vec![vec![
        place(0.0, 0.0, top_hz),
        place(0.0, FLOOR_DB, top_hz),
        place(top_hz, FLOOR_DB, top_hz),
    ]];
    let mut colors = vec![palette::AXIS];
    for hz in &ticks[1..] {
        strips.push(vec![place(*hz, FLOOR_DB, top_hz), place(*hz, 0.0, top_hz)]);
        colors.push(palette::GROUND);
    }
    for db in &levels[..3] {
        strips.push(vec![place(0.0, *db, top_hz), place(top_hz, *db, top_hz)]);
        colors.push(palette::GROUND);
    }
    let lines = LineStrips2D::new(strips)
        .with_radii([Radius::new_ui_points(0.5)])
        .with_colors(colors)
        .with_draw_order(1.0);
    store.fixed(&format!("{origin}/axes"), &lines)?;
    let below = |hz: f64| {
        let [x, y] = place(hz, FLOOR_DB, top_hz);
        [x, y + 0.02]
    };
    let number = |x: f64| {
        if step < 1.0 {
            format!("{x:.1}")
        } else {
            format!("{x:.0}")
        }
    };
    let last = ticks.len() - 1;
    let mut labels: Vec<String> = ticks.iter().map(|hz| number(*hz)).collect();
    labels[last] += " Hz";
    let mut places: Vec<[f32; 2]> = ticks.iter().map(|hz| below(*hz)).collect();
    for db in levels {
        let [x, y] = place(0.0, db, top_hz);
        places.push([x - 0.09, y - 0.045]);
        labels.push(if db == 0.0 {
            "0 dB".into()
        } else {
            format!("{db:.0}")
        });
    }
    text(
        store,
        &format!("{origin}/ticks"),
        places,
        labels,
        palette::AXIS,
    )
}

/// Lines at f/2, f and 2f, named above the frame.
fn marks(store: &mut Store<'_>, origin: &str, f_hz: f64, top_hz: f64) -> anyhow::Result<()> {
    let marks: Vec<(f64, String)> = [(0.5, "f/2"), (1.0, "f"), (2.0, "2f")]
        .into_iter()
        .map(|(times, name)| (times * f_hz, format!("{name} {:.2}", times * f_hz)))
        .filter(|(hz, _)| *hz <= top_hz)
        .collect();
    if marks.is_empty() {
        return Ok(());
    }
    // Dashes: a whole line would hide the curve's peak.
    let dashes = marks.iter().flat_map(|(hz, _)| {
        let x = (WIDTH * hz / top_hz) as f32;
        let y = |k: f32| -(HEIGHT as f32) * k / 20.0;
        (0..20u8).map(move |k| vec![[x, y(f32::from(k))], [x, y(f32::from(k) + 0.5)]])
    });
    let lines = LineStrips2D::new(dashes)
        .with_radii([Radius::new_ui_points(0.6)])
        .with_colors([palette::WHITE])
        .with_draw_order(10.0);
    store.fixed(&format!("{origin}/lines"), &lines)?;
    let places = marks
        .iter()
        // Neighbours at different heights: their names are wider than what lies between them.
        .zip([0.13f32, 0.25, 0.13])
        .map(|((hz, _), up)| [(WIDTH * hz / top_hz) as f32, -HEIGHT as f32 - up])
        .collect();
    let labels = marks.into_iter().map(|(_, label)| label).collect();
    text(
        store,
        &format!("{origin}/names"),
        places,
        labels,
        palette::WHITE,
    )
}

/// Words at places, as labels of points without size.
fn text(
    store: &mut Store<'_>,
    path: &str,
    places: Vec<[f32; 2]>,
    labels: Vec<String>,
    color: u32,
) -> anyhow::Result<()> {
    let points = Points2D::new(places)
        .with_radii([Radius::new_ui_points(0.0)])
        .with_labels(labels)
        .with_show_labels(true)
        .with_colors([color])
        .with_draw_order(30.0);
    store.fixed(path, &points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use analyze::spectrum::{Options, welch};

    #[test]
    fn a_line_is_drawn_at_its_frequency_and_at_the_top() {
        let fs = 30.0;
        let x: Vec<f64> = (0..1800)
            .map(|k| (std::f64::consts::TAU * 2.0 * f64::from(k) / fs).sin())
            .collect();
        let spectrum = welch(&x, fs, &Options::seconds(20.0, fs)).unwrap();
        let points = polyline(&spectrum, peak(&spectrum, 5.0), 5.0).unwrap();
        let top = points.iter().min_by(|a, b| a[1].total_cmp(&b[1])).unwrap();
        assert!(
            (f64::from(top[0]) / WIDTH * 5.0 - 2.0).abs() < 1e-6,
            "{top:?}"
        );
        assert_eq!(top[1], -HEIGHT as f32);
        assert!(
            points
                .iter()
                .all(|p| p[1] <= 0.0 && p[1] >= -HEIGHT as f32 && p[0] <= WIDTH as f32)
        );
    }

    #[test]
    fn nothing_comes_of_no_power() {
        let spectrum = welch(&[1.0; 100], 10.0, &Options::seconds(5.0, 10.0)).unwrap();
        assert!(polyline(&spectrum, 1.0, 5.0).is_none());
    }
}

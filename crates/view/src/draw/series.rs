//! Curves over time: height, roll and tilt, forces, order parameter, energy. One function for each plot, all in [`MOTION`] and [`ENERGIES`].

use analyze::phase;
use re_sdk_types::archetypes::{Scalars, SeriesLines};

use crate::blueprint::View;
use crate::palette;
use crate::store::Store;
use crate::take::Take;

/// A curve and how it is drawn.
pub struct Line<'a> {
    /// Its place below the plot's origin.
    pub entity: String,
    /// What the viewer calls it.
    pub name: String,
    /// Colour.
    pub color: u32,
    /// Width in points of the screen.
    pub width: f32,
    /// Log times, ns.
    pub times_ns: std::borrow::Cow<'a, [i64]>,
    /// Values.
    pub values: std::borrow::Cow<'a, [f64]>,
    /// Whether it is a level that others are compared with.
    is_level: bool,
}

impl<'a> Line<'a> {
    /// A curve of usual width; `None` without values.
    pub fn new(
        entity: impl Into<String>,
        name: impl Into<String>,
        color: u32,
        times_ns: &'a [i64],
        values: impl Into<std::borrow::Cow<'a, [f64]>>,
    ) -> Option<Self> {
        let values = values.into();
        let any = values.iter().any(|x| x.is_finite());
        (times_ns.len() == values.len() && any).then(|| Line {
            entity: entity.into(),
            name: name.into(),
            color,
            width: 1.5,
            times_ns: times_ns.into(),
            values,
            is_level: false,
        })
    }

    /// Wide enough to be seen below so many equal curves.
    fn wider(mut self, above: usize) -> Self {
        self.width *= 1.0 + above as f32;
        self
    }

    /// Nothing is drawn through a hole in the times: a value that is none breaks the curve in each.
    fn parted(mut self) -> Self {
        let Some(first_ns) = self.times_ns.first().copied() else {
            return self;
        };
        let t_s = recording::signal::seconds_since(&self.times_ns, first_ns);
        let parts = analyze::inputs::stretches(&t_s, 0.0);
        if parts.len() < 2 {
            return self;
        }
        let (mut times_ns, mut values) = (Vec::new(), Vec::new());
        for part in parts {
            if part.start > 0 {
                times_ns.push(self.times_ns[part.start].saturating_sub(1));
                values.push(f64::NAN);
            }
            times_ns.extend_from_slice(&self.times_ns[part.clone()]);
            values.extend_from_slice(&self.values[part]);
        }
        (self.times_ns, self.values) = (times_ns.into(), values.into());
        self
    }

    /// A level from the first to the last of `times_ns`.
    pub fn level(
        entity: impl Into<String>,
        name: impl Into<String>,
        color: u32,
        times_ns: &[i64],
        value: f64,
    ) -> Option<Self> {
        let (first, last) = (*times_ns.first()?, *times_ns.last()?);
        Some(Line {
            entity: entity.into(),
            name: name.into(),
            color,
            width: 1.0,
            times_ns: vec![first, last].into(),
            values: vec![value; 2].into(),
            is_level: true,
        })
    }
}

/// Sends the curves of a plot.
pub fn lines(store: &mut Store<'_>, origin: &str, lines: Vec<Line<'_>>) -> anyhow::Result<()> {
    for line in lines {
        let path = format!("{origin}/{}", line.entity);
        let style = SeriesLines::new()
            .with_names([line.name])
            .with_colors([line.color])
            .with_widths([line.width]);
        store.fixed(&path, &style)?;
        let values = line.values.iter().copied();
        let columns = Scalars::new(values).columns_of_unit_batches()?;
        store.rows(&path, &line.times_ns, columns)?;
    }
    Ok(())
}

/// Sends the curves of a plot and gives its view. `range` is that of the values to begin with, where the viewer shall not choose; the
/// title says what lies beyond it.
pub fn plot(
    store: &mut Store<'_>,
    title: String,
    origin: &str,
    curves: Vec<Line<'_>>,
    range: Option<(f64, f64)>,
) -> anyhow::Result<View> {
    let ends = ends(&curves);
    lines(store, origin, curves)?;
    let Some((low, high)) = range else {
        return Ok(View::plot(title, origin));
    };
    let off = ends.map_or(String::new(), |(least, greatest)| {
        let mut off = String::new();
        if least < low {
            off += &format!("; down to {}", short(least));
        }
        if greatest > high {
            off += &format!("; up to {}", short(greatest));
        }
        off
    });
    Ok(View::plot(title + &off, origin).range(low, high))
}

/// A number in three digits.
fn short(x: f64) -> String {
    let digits = (2.0 - x.abs().log10().floor()).clamp(0.0, 6.0);
    format!("{x:.*}", digits as usize)
}

/// The least and the greatest value.
fn ends(curves: &[Line<'_>]) -> Option<(f64, f64)> {
    let values = curves.iter().flat_map(|line| line.values.iter());
    let (low, high) = values
        .filter(|x| x.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(*x), h.max(*x))
        });
    (low <= high).then_some((low, high))
}

/// So many of the values at either end, as a share, may be off the axis.
const FEW: f64 = 0.005;
/// That they are only where they would stretch the axis so many times.
const STRETCHED: f64 = 2.0;
/// Fewer values have no few.
const MANY: usize = 400;

/// The ends of the values without the few that would leave the others a sliver of the axis; half as much room again is left about these. Levels
/// to compare with are never few.
fn bulk(curves: &[Line<'_>], (low, high): (f64, f64)) -> (f64, f64) {
    let (levels, measured): (Vec<&Line<'_>>, Vec<_>) = curves.iter().partition(|l| l.is_level);
    let values = measured.iter().flat_map(|line| line.values.iter().copied());
    let mut values: Vec<f64> = values.filter(|x| x.is_finite()).collect();
    if values.len() < MANY {
        return (low, high);
    }
    let few = (FEW * values.len() as f64) as usize;
    let last = values.len() - 1 - few;
    let from = *values.select_nth_unstable_by(few, f64::total_cmp).1;
    let to = *values.select_nth_unstable_by(last, f64::total_cmp).1;
    let room = 0.25 * (to - from);
    let kept = (low.max(from - room), high.min(to + room));
    let kept = (levels.iter().flat_map(|line| line.values.iter()))
        .fold(kept, |(from, to), x| (from.min(*x), to.max(*x)));
    // What is level but for a few pulses is about these.
    let level = to - from <= 1e-6 * from.abs().max(to.abs());
    if level || high - low < STRETCHED * (kept.1 - kept.0) {
        return (low, high);
    }
    kept
}

/// Room above and below the values, as a share of their range; less where numbers need it.
const ROOM: [f64; 2] = [0.06, 0.02];
/// The viewer writes numbers at multiples of a power of ten, where no more than so many fit into the axis of a plot among others.
const MOST_NUMBERS: f64 = 7.5;
/// A number that is written whole stands so far from the end of the axis, as a share of it.
const WHOLE: f64 = 0.045;

/// All values but a few far ones, with a little room, and two numbers on the axis. `None` where there is nothing to choose, or where more values may come.
pub fn spread(curves: &[Line<'_>], growing: bool) -> Option<(f64, f64)> {
    spread_over(curves, growing, 0.0)
}

/// The same over no less than `least`: what differs by less is level.
fn spread_over(curves: &[Line<'_>], growing: bool, least: f64) -> Option<(f64, f64)> {
    let all = ends(curves).filter(|(low, high)| !growing && low < high)?;
    let (low, high) = bulk(curves, all);
    // The viewer's numbers have few digits: less than a millionth of the value would be none of them.
    let least = least.max(1e-6 * low.abs().max(high.abs()));
    let more = 0.5 * (least - (high - low)).max(0.0);
    let (low, high) = (low - more, high + more);
    let widened = |share: f64| (low - share * (high - low), high + share * (high - low));
    let has_two = |&(low, high): &(f64, f64)| whole_numbers(low, high) >= 2.0;
    if let Some(range) = ROOM.into_iter().map(widened).find(has_two) {
        return Some(range);
    }
    let (low, high) = widened(ROOM[1]);
    let (step, mut first, mut last) = numbers(low, high);
    if first > last {
        // None: those on both sides.
        (first, last) = (last, first);
    } else if first == last {
        // One: the next on the nearer side as well.
        if low - (first - step) < last + step - high {
            first -= step;
        } else {
            last += step;
        }
    }
    let margin = WHOLE * (high.max(last) - low.min(first));
    Some((low.min(first - margin), high.max(last + margin)))
}

/// How many numbers an axis has that are written whole.
fn whole_numbers(low: f64, high: f64) -> f64 {
    let (step, edge) = (numbers(low, high).0, WHOLE * (high - low));
    ((high - edge) / step).floor() - ((low + edge) / step).ceil() + 1.0
}

/// Distance of the numbers on an axis, the first and the last of them; the first after the last where there are none.
fn numbers(low: f64, high: f64) -> (f64, f64, f64) {
    let step = 10f64.powf(((high - low) / MOST_NUMBERS).log10().ceil());
    (
        step,
        (low / step).ceil() * step,
        (high / step).floor() * step,
    )
}

/// A plot: where its curves are, and what makes them and the title.
pub struct Plot {
    origin: &'static str,
    make: for<'a> fn(&'a Take) -> Option<(String, Vec<Line<'a>>)>,
    range: Option<(f64, f64)>,
    /// Least range of values.
    least: f64,
    /// Beyond these there are none: a range ends there.
    ends: (f64, f64),
    /// Seconds before and after the cursor that are shown, where all would be too many cycles to tell apart.
    near_s: Option<f64>,
}

/// Seconds before and after the cursor in the plot of forces: some ten strides.
const NEAR_S: f64 = 5.0;

/// Values of any size.
const EVERYWHERE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

/// Plots of the motion, from top to bottom.
pub const MOTION: &[Plot] = &[
    Plot {
        origin: "/plots/height",
        make: height,
        range: None,
        least: 1e-3,
        ends: EVERYWHERE,
        near_s: None,
    },
    Plot {
        origin: "/plots/angles",
        make: angles,
        range: None,
        least: 0.01,
        ends: (-190.0, 190.0),
        near_s: None,
    },
    Plot {
        origin: "/plots/forces",
        make: forces,
        range: None,
        least: 0.0,
        ends: EVERYWHERE,
        near_s: Some(NEAR_S),
    },
    Plot {
        origin: "/plots/synchrony",
        make: synchrony,
        range: Some((-0.05, 1.06)),
        least: 0.0,
        ends: EVERYWHERE,
        near_s: None,
    },
];

/// Plots of the energies, from top to bottom.
pub const ENERGIES: &[Plot] = &[
    Plot {
        origin: "/plots/energy",
        make: stored,
        range: None,
        least: 0.0,
        ends: EVERYWHERE,
        near_s: None,
    },
    Plot {
        origin: "/plots/ledger",
        make: ledger,
        range: None,
        least: 0.0,
        ends: EVERYWHERE,
        near_s: None,
    },
];

/// Draws every one of `plots` that has a curve.
pub fn draw(store: &mut Store<'_>, take: &Take, plots: &[Plot]) -> anyhow::Result<Vec<View>> {
    let mut views = Vec::new();
    for plot in plots {
        let Some((title, curves)) = (plot.make)(take) else {
            continue;
        };
        let chosen = || spread_over(&curves, take.growing, plot.least);
        let (lowest, highest) = plot.ends;
        let range = plot
            .range
            .or_else(chosen)
            .map(|(low, high)| (low.max(lowest), high.min(highest)));
        let view = self::plot(store, title, plot.origin, curves, range)?;
        views.push(match plot.near_s {
            Some(seconds) => view.near(seconds),
            None => view,
        });
    }
    Ok(views)
}

/// What is said of columns that sensors gave.
fn estimated(source: &str) -> &'static str {
    if source == "imu" {
        ", estimated from the IMU"
    } else {
        ""
    }
}

fn height(take: &Take) -> Option<(String, Vec<Line<'_>>)> {
    let (_, height_m) = take.inputs.height();
    let line = Line::new("z", "height", palette::BLUE, &take.height_ns, height_m)?.parted();
    let title = match estimated(&take.inputs.sources.height) {
        "" => "Height of the centre of mass [m]".to_owned(),
        from => format!("Height about its mean [m]{from}"),
    };
    Some((title, vec![line]))
}

fn angles(take: &Take) -> Option<(String, Vec<Line<'_>>)> {
    let deg = |x: &[f64]| x.iter().map(|x| x.to_degrees()).collect::<Vec<f64>>();
    let (roll, tilt) = (&take.inputs.roll_rad, &take.inputs.pitch_rad);
    let roll = Line::new(
        "roll",
        "roll",
        palette::VERMILION,
        &take.state_ns,
        deg(roll),
    )
    .map(|line| broken(line).parted());
    let tilt = Line::new(
        "tilt",
        "tilt of the pole",
        palette::BLUE,
        &take.state_ns,
        deg(tilt),
    )
    .map(Line::parted);
    let (title, mean) = match (&roll, &tilt) {
        (Some(_), Some(_)) => ("Roll (vermilion) and tilt (blue)", "their means"),
        (Some(_), None) => ("Roll", "its mean"),
        (None, Some(_)) => ("Tilt of the pole", "its mean"),
        (None, None) => return None,
    };
    let about = match take.inputs.sources.levelled {
        true => format!(" about {mean}"),
        false => String::new(),
    };
    let from = estimated(&take.inputs.sources.attitude);
    Some((
        format!("{title}{about} [deg]{from}"),
        roll.into_iter().chain(tilt).collect(),
    ))
}

/// An angle that changes by more from one sample to the next, deg, has wrapped: nothing that is carried turns so fast.
const WRAPPED_DEG: f64 = 150.0;

/// The curve of an angle in degrees without strokes across the plot where it wraps.
fn broken(line: Line<'_>) -> Line<'_> {
    let wraps = |k: usize| k > 0 && (line.values[k] - line.values[k - 1]).abs() > WRAPPED_DEG;
    if !(0..line.values.len()).any(wraps) {
        return line;
    }
    let (mut times_ns, mut values) = (Vec::new(), Vec::new());
    for (k, (t, x)) in line.times_ns.iter().zip(line.values.iter()).enumerate() {
        if wraps(k) {
            times_ns.push(i64::midpoint(line.times_ns[k - 1], *t));
            values.push(f64::NAN);
        }
        times_ns.push(*t);
        values.push(*x);
    }
    Line {
        times_ns: times_ns.into(),
        values: values.into(),
        ..line
    }
}

/// So many handles' colours are named in the title.
const FEW_HANDLES: usize = 3;

fn forces(take: &Take) -> Option<(String, Vec<Line<'_>>)> {
    if take.inputs.normal_n.is_empty() {
        return support(take);
    }
    let (scale_n, unit) = take.force_scale()?;
    let share = |x: &[f64]| x.iter().map(|n| n / scale_n).collect::<Vec<f64>>();
    let times = &take.force_ns;
    // The viewer draws in the order of the names: the handles lie above the sum.
    let total = take.inputs.total_force_n();
    let mut lines = Vec::new();
    lines.extend(
        Line::new(
            "all",
            format!("N_tot/{unit}"),
            palette::WHITE,
            times,
            share(&total),
        )
        .map(Line::parted),
    );
    let handles = take.inputs.normal_n.len();
    if handles > palette::CARRIERS {
        return Some(crowd(take, scale_n, unit, lines));
    }
    for (i, normal_n) in take.inputs.normal_n.iter().enumerate() {
        let (color, _) = palette::carrier(i);
        let entity = format!("handle_{}", i + 1);
        let name = format!("N_{}/{unit}", i + 1);
        let line = Line::new(entity, name, color, times, share(normal_n));
        // Of few, those that lie below are wider: equal forces would hide each other.
        let above = if handles <= FEW_HANDLES {
            handles - 1 - i
        } else {
            0
        };
        lines.extend(line.map(|line| line.wider(above).parted()));
    }
    let floating = analyze::metrics::FLOAT_SHARE;
    let limit = Line::level(
        "unloaded",
        format!("{floating}"),
        palette::VERMILION,
        times,
        floating,
    );
    lines.extend(limit);
    let colours = match handles {
        1 => palette::carrier(0).1.to_owned(),
        2..=FEW_HANDLES => (0..handles)
            .map(|i| palette::carrier(i).1)
            .collect::<Vec<_>>()
            .join(", "),
        _ => "carriers' colours".to_owned(),
    };
    let title = format!(
        "Support/{unit}, now ± {NEAR_S} s: N_tot (white), N_i ({colours}), {floating} (vermilion)"
    );
    Some((title, lines))
}

/// More handles than there are colours: the least, the median and the greatest force at every moment, as multiples of a fair share.
fn crowd<'a>(
    take: &'a Take,
    scale_n: f64,
    unit: &str,
    mut lines: Vec<Line<'a>>,
) -> (String, Vec<Line<'a>>) {
    let handles = take.inputs.normal_n.len();
    let fair_n = scale_n / handles as f64;
    let rows = take.force_ns.len();
    let mut found = [(); 3].map(|()| Vec::with_capacity(rows));
    let mut shares: Vec<f64> = Vec::with_capacity(handles);
    for k in 0..rows {
        shares.clear();
        let now = take.inputs.normal_n.iter().filter_map(|n| n.get(k));
        shares.extend(now.filter(|n| n.is_finite()).map(|n| n / fair_n));
        shares.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| {
            let last = shares.len().checked_sub(1)?;
            shares.get((share * last as f64).round() as usize).copied()
        };
        for (values, share) in found.iter_mut().zip([0.0, 0.5, 1.0]) {
            values.push(at(share).unwrap_or(f64::NAN));
        }
    }
    let kinds = [
        ("least", palette::ORANGE),
        ("median", palette::BLUE),
        ("greatest", palette::ORANGE),
    ];
    for ((entity, color), values) in kinds.into_iter().zip(found) {
        let name = format!("{entity} N_i·{handles}/{unit}");
        let line = Line::new(entity, name, color, &take.force_ns, values);
        lines.extend(line.map(Line::parted));
    }
    let title = format!(
        "N_tot/{unit} (white), now ± {NEAR_S} s; N_i·{handles}/{unit}: median (blue), least and greatest (orange)"
    );
    (title, lines)
}

/// The support where it is measured as such.
fn support(take: &Take) -> Option<(String, Vec<Line<'_>>)> {
    let (ratio, floating) = (&take.inputs.support_ratio, analyze::metrics::FLOAT_SHARE);
    let line = Line::new(
        "all",
        "N_tot/Mg",
        palette::WHITE,
        &take.state_ns,
        &ratio[..],
    )?
    .parted();
    let limit = Line::level(
        "unloaded",
        format!("{floating}"),
        palette::VERMILION,
        &take.state_ns,
        floating,
    );
    let from = estimated(&take.inputs.sources.forces);
    Some((
        format!("N_tot/Mg (white), {floating} (vermilion), now ± {NEAR_S} s{from}"),
        std::iter::once(line).chain(limit).collect(),
    ))
}

fn synchrony(take: &Take) -> Option<(String, Vec<Line<'_>>)> {
    let phases: Vec<&[f64]> = take.inputs.phase_rad.iter().map(|p| &p[..]).collect();
    // One carrier is in step with nobody.
    if phases.len() < 2 {
        return None;
    }
    let r = phase::order_parameter(&phases);
    let times = &take.phase_ns;
    let mut title = "Order parameter r (green)".to_owned();
    let mut lines = Vec::new();
    // Measured phases have a chance level of their own, by surrogates: the metric knows.
    if let Some(chance) = take.metrics.get("synchrony_chance")
        && let Some(mean) = chance.as_f64()
    {
        // For two the band is nearly everything.
        let band = if phases.len() > 2 {
            &chance.per[..]
        } else {
            &[]
        };
        // Of r at a moment for phases of a model, of the mean of r for phases that steps tell.
        let what = match take.inputs.phases_are_measured {
            true => "95 % of the mean by chance",
            false => "95 % of chance",
        };
        for (entity, value) in ["band_low", "band_high"].into_iter().zip(band) {
            lines.extend(Line::level(entity, what, palette::ORANGE, times, *value));
        }
        lines.extend(Line::level(
            "chance",
            "mean by chance",
            palette::LIMIT,
            times,
            mean,
        ));
        title += &format!("; by chance {mean:.3} (grey)");
        if let [low, high] = band {
            title += &format!(", 95 % {low:.3} … {high:.3} (orange)");
        }
    }
    lines.push(Line::new("r", "r", palette::GREEN, times, r)?.parted());
    title += estimated(&take.inputs.sources.phases);
    Some((title, lines))
}

fn stored(take: &Take) -> Option<(String, Vec<Line<'_>>)> {
    energies(
        take,
        "Stored energy [J]",
        &[
            ("kinetic", palette::BLUE, "blue"),
            ("potential since the beginning", palette::YELLOW, "yellow"),
            ("elastic", palette::ORANGE, "orange"),
        ],
    )
}

fn ledger(take: &Take) -> Option<(String, Vec<Line<'_>>)> {
    energies(
        take,
        "Energy ledger [J]",
        &[
            ("work in", palette::GREEN, "green"),
            ("dissipated", palette::VERMILION, "vermilion"),
            ("unexplained", palette::WHITE, "white"),
        ],
    )
}

fn energies<'a>(
    take: &'a Take,
    title: &str,
    wanted: &[(&str, u32, &str)],
) -> Option<(String, Vec<Line<'a>>)> {
    let ledger = take.energy.as_ref()?;
    let mut lines = Vec::new();
    let mut names = Vec::new();
    for (name, color, word) in wanted {
        let Some((_, values)) = ledger.columns.iter().find(|(known, _)| known == name) else {
            continue;
        };
        if let Some(line) = Line::new(
            name.split(" since")
                .next()
                .unwrap_or(name)
                .replace(' ', "_"),
            *name,
            *color,
            &ledger.times_ns,
            &values[..],
        ) {
            names.push(format!("{name} ({word})"));
            lines.push(line.parted());
        }
    }
    (!lines.is_empty()).then(|| (format!("{title}: {}", names.join(", ")), lines))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The range chosen for a curve between two values, and how many numbers the viewer writes whole on it.
    fn chosen(low: f64, high: f64, least: f64) -> ((f64, f64), usize) {
        let line = Line::new("x", "x", 0, &[0, 1], vec![low, high]).unwrap();
        let (from, to) = spread_over(&[line], false, least).unwrap();
        let (edge, step) = (0.04 * (to - from), numbers(from, to).0);
        let (first, last) = (((from + edge) / step).ceil(), ((to - edge) / step).floor());
        ((from, to), (last - first + 1.0).max(0.0) as usize)
    }

    #[test]
    fn a_range_has_two_numbers_on_its_axis() {
        for (low, high) in [
            (0.81, 0.89),
            (-29.3, 29.4),
            (0.0, 2.4),
            (1.01, 1.02),
            (-0.001, 250.0),
            (0.96, 1.04),
            (0.72, 0.88),
            (-6.6, 2.2),
            (-52.0, 46.0),
            (1.2, 8.8),
            (-3.6, 3.6),
            (-3.9, 3.9),
            // Whole numbers at both ends of these would be more than fit.
            (-6.33, 56.32),
            (13.65, 76.33),
        ] {
            let ((from, to), numbers) = chosen(low, high, 0.0);
            assert!(from < low && to > high, "{low} {high}: {from} {to}");
            assert!(to - from < 1.9 * (high - low), "{low} {high}: {from} {to}");
            assert!(numbers >= 2, "{low} {high}: {from} {to}");
        }
        let flat = Line::new("x", "x", 0, &[0, 1], vec![1.0, 1.0]).unwrap();
        assert_eq!(spread(&[flat], false), None);
    }

    #[test]
    fn a_few_far_values_do_not_stretch_an_axis_and_are_named() {
        let times: Vec<i64> = (0..2000).collect();
        let wave = |k: i64| (0.3 * k as f64).sin();
        let drawn = |far: &dyn Fn(i64) -> Option<f64>| {
            let values: Vec<f64> = (times.iter())
                .map(|k| far(*k).unwrap_or_else(|| wave(*k)))
                .collect();
            let line = Line::new("x", "x", 0, &times, values).unwrap();
            let range = spread(std::slice::from_ref(&line), false).unwrap();
            let mut title = String::new();
            crate::draw::sent::by(|store| {
                let view = plot(store, "x".into(), "/x", vec![line], Some(range)).unwrap();
                title = view.title().to_owned();
            });
            (range, title)
        };
        let ((low, high), title) = drawn(&|k| (k < 5).then_some(40.0));
        assert!(low < -1.0 && high > 1.0 && high - low < 4.0, "{low} {high}");
        assert_eq!(title, "x; up to 40.0");
        // A twentieth of all is not few, and twice as far is not far.
        for far in [
            &(|k: i64| (k < 100).then_some(40.0)) as &dyn Fn(i64) -> Option<f64>,
            &|k| (k < 5).then_some(3.0),
        ] {
            let ((_, high), title) = drawn(far);
            assert!(high > 3.0, "{high}");
            assert_eq!(title, "x");
        }
    }

    /// It was taken for two far values, and the title told of data down to it.
    #[test]
    fn a_level_far_from_all_values_stays_in_the_picture() {
        let times: Vec<i64> = (0..2000).collect();
        let values: Vec<f64> = (times.iter())
            .map(|k| 1.0 + 0.05 * (0.3 * *k as f64).sin())
            .collect();
        let curve = Line::new("x", "x", 0, &times, values).unwrap();
        let curves = [curve, Line::level("y", "y", 0, &times, 0.05).unwrap()];
        let (low, high) = spread(&curves, false).unwrap();
        assert!(low < 0.05 && high > 1.05 && high < 1.3, "{low} {high}");
    }

    #[test]
    fn of_a_crowd_the_least_the_median_and_the_greatest_are_drawn() {
        let mut take = Take {
            force_ns: vec![0, 1],
            ..Take::default()
        };
        take.inputs.mass_kg = Some(9.0);
        take.inputs.gravity_m_per_s2 = 1.0;
        take.inputs.normal_n = (0..9).map(|i| vec![f64::from(i); 2]).collect();
        let (title, lines) = forces(&take).unwrap();
        assert!(title.contains("N_i·9/Mg"), "{title}");
        let value = |entity: &str| lines.iter().find(|l| l.entity == entity).unwrap().values[0];
        assert_eq!(["least", "median", "greatest"].map(value), [0.0, 4.0, 8.0]);
        take.inputs.normal_n.pop();
        let width = |take: &Take, entity: &str| {
            let (_, lines) = forces(take).unwrap();
            lines.iter().find(|l| l.entity == entity).unwrap().width
        };
        assert_eq!(width(&take, "handle_1"), width(&take, "handle_8"));
        // Equal forces of two: the one below shows on both sides.
        take.inputs.normal_n.truncate(2);
        assert!(width(&take, "handle_1") > width(&take, "handle_2"));
    }

    #[test]
    fn what_is_level_but_for_rounding_is_drawn_level() {
        let (low, high) = (0.775, 0.775 + 3e-16);
        let ((from, to), numbers) = chosen(low, high, 1e-3);
        assert!(to - from > 1e-3 && numbers >= 2, "{from} {to}");
        let ((from, to), numbers) = chosen(low, high, 0.0);
        assert!(to - from > 7e-7 && numbers >= 2, "{from} {to}");
    }

    #[test]
    fn the_band_of_chance_is_named() {
        let mut take = Take {
            phase_ns: vec![0, 1],
            ..Take::default()
        };
        take.inputs.phase_rad = vec![vec![0.0, 0.1]; 8];
        let value = analyze::metrics::Value {
            per: vec![0.057, 0.679],
            ..analyze::metrics::Value::number(0.316)
        };
        take.metrics.0.push(("synchrony_chance", value));
        let (title, lines) = synchrony(&take).unwrap();
        assert!(title.ends_with(", 95 % 0.057 … 0.679 (orange)"), "{title}");
        let band = lines.iter().filter(|line| line.color == palette::ORANGE);
        assert_eq!(band.count(), 2);
    }

    #[test]
    fn nothing_is_drawn_through_a_hole() {
        let times: Vec<i64> = (0..100).chain(600..700).map(|k| k * 10_000_000).collect();
        let values = vec![1.0; 200];
        let line = Line::new("z", "z", 0, &times, values).unwrap().parted();
        assert_eq!(line.values.iter().filter(|x| x.is_nan()).count(), 1);
        assert!(line.values[100].is_nan() && line.times_ns.is_sorted());
        let whole = Line::new("z", "z", 0, &times[..100], vec![1.0; 100]).unwrap();
        assert_eq!(whole.parted().values.len(), 100);
    }

    #[test]
    fn a_height_with_a_clock_of_its_own_is_drawn_at_its_times() {
        let take = Take {
            state_ns: vec![0, 10],
            height_ns: vec![0, 5, 10],
            inputs: analyze::Inputs {
                t_s: vec![0.0, 1e-8],
                height_m: vec![0.8, 0.8],
                height_alone: Some((vec![0.0, 5e-9, 1e-8], vec![0.8, 0.9, 0.8])),
                ..analyze::Inputs::default()
            },
            ..Take::default()
        };
        let (_, lines) = height(&take).unwrap();
        assert_eq!(lines[0].times_ns[..], [0, 5, 10]);
        assert_eq!(lines[0].values[..], [0.8, 0.9, 0.8]);
    }

    #[test]
    fn an_angle_that_wraps_breaks_off() {
        let deg = vec![170.0, 178.0, -174.0, -166.0];
        let line = Line::new("roll", "roll", 0, &[0, 10, 20, 30], deg).unwrap();
        let line = broken(line);
        assert_eq!(line.times_ns[..], [0, 10, 15, 20, 30]);
        assert!(line.values[2].is_nan() && line.values[3] == -174.0);
        let tilt = Line::new("tilt", "tilt", 0, &[0, 10], vec![-60.0, 70.0]).unwrap();
        assert_eq!(broken(tilt).values.len(), 2);
    }
}

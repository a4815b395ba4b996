//! The paper's metrics of a [`Motion`], each number with its 95 % interval.
//!
//! The estimated columns are varied within the [`Budget`] of what the sensor and the method leave uncertain, and sampled
//! at the paper's 30 Hz with a random phase; the metric's spread over the draws is its standard error, 1.96 of which are given. Where short holes were
//! drawn through, what as many holes again would change counts as one more.

mod angle;
mod beyond;
mod draws;
mod lost;
#[cfg(test)]
mod tests;

use super::budget::Budget;
use super::floating::{Floating, floating};
use super::rath::Motion;
use super::track::period_s;
use crate::inputs::{Inputs, Window};
use crate::mechanism::Verdict;
use crate::metrics::{Datum, Metrics, Need, Value, find, metrics_of};
use angle::{
    MEAN_SQUARES, constant_tilt_rad, mixed, mounting_error_rad, tilted, uncalibrated, without_noise,
};
use beyond::{Beyond, spread_of_parts};
use draws::varied;
use lost::without_an_interval;
pub use lost::{Lost, without, without_those};
use std::ops::Range;

/// Number of draws behind an interval.
const DRAWS: usize = 40;
/// How long what wanders stays alike, s.
const WANDER_S: f64 = 3.0;
/// Metrics that an inertial sensor cannot give, and why.
const BEYOND: &[(&str, &str)] = &[
    (
        "z_mean_m",
        "an inertial sensor does not see the mean height",
    ),
    ("rms_yaw_deg", "heading without a magnetometer drifts"),
];
/// Whether a metric rests on the motion columns alone, so that [`metrics`] gives it.
pub fn gives(name: &str) -> bool {
    let others = [
        Need::Forces,
        Need::Phases,
        Need::Beat,
        Need::PhasesInBeat,
        Need::Steps,
    ];
    find(name).is_some_and(|metric| !metric.needs.iter().any(|need| others.contains(need)))
}

/// Whether a metric rests on the height, whose slow course an inertial sensor loses.
pub fn is_of_height(name: &str) -> bool {
    OF_COURSE.contains(&name) || OF_HEAVE.contains(&name)
}

/// Every metric that rests on the motion alone, over `window`, each number with its 95 % interval.
pub fn metrics(motion: &Motion, window: Window) -> Metrics {
    let mut out = metrics_of(&motion.inputs, window, gives);
    let estimate = Estimate::of(motion, window);
    for (name, value) in &mut out.0 {
        estimate.complete(name, value);
    }
    if estimate.unseen > MOST_UNSEEN {
        let why = format!(
            "without an interval: {:.1} of {:.1} s are not known, and nothing tells how the load moved then",
            estimate.left_out_s, estimate.sampled_s
        );
        without_an_interval(&mut out, &why, |_| true);
    }
    if let Some(why) = estimate.too_little_height(window) {
        without_an_interval(&mut out, &why, |name| {
            OF_COURSE.contains(&name) || name == "h2_ratio"
        });
    }
    withhold_what_is_too_small(&mut out, &motion.settings.budget);
    out
}

/// Where more than this of a window is left out, its metrics have no interval: what a rath did meanwhile is as much a part of them.
const MOST_UNSEEN: f64 = 0.1;

/// Nor those of the height where more than this of it is not known: the parts of that length by which it is told what the missing may be are too few.
const MOST_HEIGHT_UNKNOWN: f64 = 1.0 / 3.0;

/// Takes what rests on so small a motion that the sensor's own wandering is as large.
fn withhold_what_is_too_small(metrics: &mut Metrics, budget: &Budget) {
    let below = |name: &str, least: f64| metrics.number(name).is_some_and(|x| x < least);
    let least_deg = SEEN * budget.tilt_offset_rad.to_degrees();
    let too_small = [
        (below("rms_roll_deg", least_deg), "roll", OF_ROLL),
        (below("rms_z_m", budget.height_wander_m), "heave", OF_HEAVE),
    ];
    for (_, what, names) in too_small.into_iter().filter(|(small, ..)| *small) {
        for (_, value) in metrics
            .0
            .iter_mut()
            .filter(|(name, _)| names.contains(name))
        {
            value.withhold(format!(
                "so small a {what} has no line that the sensor could tell from its own wandering"
            ));
            value.source = "imu".into();
        }
    }
}

/// A motion within a window, and what its metrics' intervals rest on.
struct Estimate<'a> {
    motion: &'a Motion,
    range: Range<usize>,
    /// How far the sensor may tilt up for good, rad (one standard deviation).
    tilt_rad: f64,
    /// Metrics of equally good sensors, with such a tilt and, of [`MEAN_SQUARES`] alone, without.
    draws: Vec<Metrics>,
    untilted: Option<Vec<Metrics>>,
    /// With as many holes again.
    again: Option<(&'a Inputs, Metrics)>,
    beyond: Option<Beyond<'a>>,
    /// What is left out of the window, and what it has samples for, s; the one over the other.
    left_out_s: f64,
    sampled_s: f64,
    unseen: f64,
    rate_hz: f64,
}

impl<'a> Estimate<'a> {
    fn of(motion: &'a Motion, window: Window) -> Self {
        let drawn = |tilt_rad: f64, wanted: fn(&str) -> bool| -> Vec<Metrics> {
            let varied = (0..DRAWS).map(|k| varied(motion, window, k as u64, tilt_rad));
            varied
                .map(|inputs| metrics_of(&inputs, Window::ALL, wanted))
                .collect()
        };
        let tilt_rad = constant_tilt_rad(motion);
        let [left_out_s, sampled_s] = motion.left_out_s(window);
        Estimate {
            motion,
            range: window.range(&motion.inputs.t_s),
            tilt_rad,
            draws: drawn(tilt_rad, |name| gives(name) && name != "mechanism"),
            untilted: (tilt_rad > 0.0).then(|| drawn(0.0, |name| MEAN_SQUARES.contains(&name))),
            again: motion
                .again
                .as_deref()
                .map(|again| (again, metrics_of(again, window, gives))),
            beyond: Beyond::of(motion, window),
            left_out_s,
            sampled_s,
            unseen: left_out_s / sampled_s.max(f64::MIN_POSITIVE),
            rate_hz: rate_hz(&motion.inputs),
        }
    }

    /// Gives a value its interval and the remarks that it needs, or takes what an inertial sensor cannot tell.
    fn complete(&self, name: &str, value: &mut Value) {
        if let Some((_, why)) = BEYOND.iter().find(|(n, _)| *n == name) {
            value.withhold(*why);
            value.source = "imu".into();
            return;
        }
        match value.datum {
            Datum::Bool(found) if name == "unstable" => {
                value.reason = self.doubt(found);
            }
            Datum::Word(word) if !self.placed(name) && word != Verdict::Quiet.word() => {
                if let Some(reason) = &mut value.reason {
                    *reason += &format!("; the fit is {UNPLACED}, for {PLACE_IT}");
                }
            }
            Datum::Number(x) if name == "onset_time_s" => self.onset(x, value),
            Datum::Number(x) => {
                let drawn = self.drawn(name);
                if drawn.len() < DRAWS / 2 {
                    return;
                }
                match name {
                    _ if MEAN_SQUARES.contains(&name) => self.mean_square(name, x, &drawn, value),
                    "roll_excess_s" => {
                        // Swings that keep step with the samples are all counted in one way or all in the other: no standard deviation tells of that.
                        let [low, high] = apart(extremes(x, &drawn), x, self.off(name, x));
                        value.ci95 = Some([low, high + self.left_out_s]);
                    }
                    _ => self.number(name, x, &drawn, value),
                }
            }
            _ => {}
        }
    }

    /// That too little of the height is known.
    fn too_little_height(&self, window: Window) -> Option<String> {
        let height_m = &self.motion.inputs.height_m[window.range(&self.motion.inputs.t_s)];
        let unknown = height_m.iter().filter(|m| m.is_nan()).count();
        let share = unknown as f64 / height_m.len().max(1) as f64;
        (share > MOST_HEIGHT_UNKNOWN).then(|| {
            format!(
                "without an interval: of {:.0} % of the window there is no height",
                100.0 * share
            )
        })
    }

    /// What equally good sensors give.
    fn drawn(&self, name: &str) -> Vec<f64> {
        let draws = match MEAN_SQUARES.contains(&name) {
            true => self.untilted.as_ref().unwrap_or(&self.draws),
            false => &self.draws,
        };
        draws.iter().filter_map(|d| d.number(name)).collect()
    }

    /// What as many holes again change.
    fn off(&self, name: &str, x: f64) -> f64 {
        let found = self.again.as_ref().and_then(|(_, m)| m.number(name));
        found.map_or(0.0, |again| again - x)
    }

    /// Whether it is known where the sensor sits, or does not count.
    fn placed(&self, name: &str) -> bool {
        self.motion.settings.lever_is_known || !OF_PLACE.contains(&name)
    }

    /// That other sensors, or more holes, would decide otherwise on whether there is an onset.
    fn doubt(&self, found: bool) -> Option<String> {
        let onsets = self.drawn("onset_time_s").len();
        let (others, other) = match found {
            true => (DRAWS - onsets, "none"),
            false => (onsets, "one"),
        };
        let by_holes = || {
            let again = self.again.as_ref()?.1.number("onset_time_s").is_some();
            (again != found).then(|| format!("with as many holes again {other} would be found"))
        };
        // More than one in forty.
        (others > 1)
            .then(|| format!("of {DRAWS} sensors as good as this one {others} would find {other}"))
            .or_else(by_holes)
    }

    fn onset(&self, x: f64, value: &mut Value) {
        let end_s = self.motion.inputs.t_s[self.range.clone()].last().copied();
        let ends = onset_between(x, &self.drawn("onset_time_s"), end_s.unwrap_or(x));
        value.ci95 = Some(apart(ends, x, self.off("onset_time_s", x)));
        value.reason = value.reason.take().or_else(|| self.doubt(true));
    }

    fn mean_square(&self, name: &str, x: f64, drawn: &[f64], value: &mut Value) {
        let inputs = &self.motion.inputs;
        let (root, ci95) = without_noise(x, drawn);
        let [angle, other] = match name {
            "rms_roll_deg" => [&inputs.roll_rad, &inputs.pitch_rad],
            _ => [&inputs.pitch_rad, &inputs.roll_rad],
        }
        .map(|x| &x[self.range.clone()]);
        let mean_deg = angle.iter().sum::<f64>().to_degrees() / angle.len() as f64;
        value.datum = Datum::Number(root);
        let ends = tilted(root, ci95, mean_deg, 1.96 * self.tilt_rad.to_degrees());
        let most = 1.96 * mounting_error_rad(&self.motion.settings.budget);
        let ends = mixed(root, ends, angle, other, most);
        // Of what is left out nothing is known but how the rest varies.
        let square = root.to_radians().powi(2);
        let lost = (self.left_out_s * self.rate_hz) as usize;
        let rest = (square + self.unseen * spread_of_parts(angle, lost)).sqrt() - square.sqrt();
        let off = self.off(name, x).hypot(rest.to_degrees());
        value.ci95 = Some(apart(ends, root, off));
        value.reason = uncalibrated(self.motion);
    }

    /// About the estimate, not about the draws' mean: what the draws add on average is theirs.
    fn number(&self, name: &str, x: f64, drawn: &[f64], value: &mut Value) {
        let floats = (name == "t_float").then(|| self.floating(&self.motion.inputs));
        let x = floats.map_or(x, |found| found.share);
        let off = match (&self.again, name) {
            (Some((again, _)), "dz_pp_m") => {
                let heights =
                    [&self.motion.inputs, *again].map(|i| &i.height_m[self.range.clone()]);
                farthest_apart(heights) / 1.96
            }
            (Some((again, _)), "t_float") => self.floating(again).share - x,
            _ => self.off(name, x),
        };
        let beyond = self.beyond.as_ref().map_or(0.0, |beyond| beyond.sd(name));
        let beyond = floats.map_or(beyond, |found| found.edges_sd.max(beyond));
        let half = 1.96 * (variance(drawn) + beyond.powi(2) + off.powi(2)).sqrt();
        value.datum = Datum::Number(x);
        // None of them is below nothing, and a share is one at most.
        let most = if floats.is_some() { 1.0 } else { f64::INFINITY };
        // Noise adds to a largest minus a smallest, the more the longer it is looked for, and never takes from it.
        let added = match name {
            "dz_pp_m" => (drawn.iter().sum::<f64>() / drawn.len() as f64 - x).max(0.0),
            _ => 0.0,
        };
        // What is so much smaller than the line at f/2 is the sensor's noise as much as the load's motion.
        let drowned = name == "subharmonic_ratio" && x > BEYOND_SENSORS;
        value.ci95 = (!drowned).then(|| [(x - half.hypot(added)).max(0.0), (x + half).min(most)]);
        let reasons: Vec<String> = value
            .reason
            .take()
            .into_iter()
            .chain(self.remarks(name, drowned))
            .collect();
        value.reason = (!reasons.is_empty()).then(|| reasons.join("; "));
    }

    /// What is to be said of a number.
    fn remarks(&self, name: &str, drowned: bool) -> impl Iterator<Item = String> {
        let of_height = OF_COURSE.contains(&name).then(|| {
            let corner_hz = self.motion.settings.height_corner_hz;
            format!("of what heaves faster than {corner_hz} Hz: an inertial sensor loses a slower course of the height")
        });
        let of_noise = drowned.then(|| {
            "without an interval: so little roll at f is the sensor's noise as much as the load's motion, and the ratio this much or more".to_owned()
        });
        let of_place = (!self.placed(name))
            .then(|| format!("{UNPLACED}, and the interval knows no better, for {PLACE_IT}"));
        let of_rate = (OF_EDGES.contains(&name) && self.rate_hz < ENOUGH_HZ).then(|| {
            format!("at {:.0} Hz touch-downs fall between samples, and their overtones onto slower lines; 100 Hz or more are wanted", self.rate_hz)
        });
        [of_height, of_noise, of_place, of_rate]
            .into_iter()
            .flatten()
    }

    /// How long the load floats, of each of its stretches within the window.
    fn floating(&self, inputs: &Inputs) -> Floating {
        let within = |r: &Range<usize>| {
            let (from, to) = (r.start.max(self.range.start), r.end.min(self.range.end));
            (from < to).then(|| &inputs.support_ratio[from..to])
        };
        let parts: Vec<&[f64]> = self.motion.stretches.iter().filter_map(within).collect();
        floating(&parts)
    }
}

/// What a sensor off the centre of mass feels otherwise, by its lever.
const OF_PLACE: &[&str] = &[
    "dz_pp_m",
    "rms_z_m",
    "t_float",
    "growth_ratio",
    "h2_ratio",
    "mechanism",
];
const UNPLACED: &str = "as if the sensor sat at the centre of mass";
const PLACE_IT: &str = "nobody says where it sits; give imu_place_m in a roles file";

/// What the moments of touch-down decide, and the rate from which samples tell them.
const OF_EDGES: &[&str] = &["dz_pp_m", "t_float"];
const ENOUGH_HZ: f64 = 90.0;

/// The definitions count samples so far apart, s: what is counted hangs on where the samples fall, the more so the closer a period of the motion comes
/// to a whole number of them. Draws are sampled so, or as slowly as the sensor.
const COUNTED_S: f64 = 1.0 / 30.0;

/// Of the samples, Hz; infinite where nothing tells.
fn rate_hz(inputs: &Inputs) -> f64 {
    period_s(&inputs.t_s).map_or(f64::INFINITY, |s| 1.0 / s)
}

/// What a slow course of the height is part of.
const OF_COURSE: &[&str] = &["dz_pp_m", "rms_z_m", "growth_ratio"];

/// From the earliest to the latest onset that equally good sensors find, of which one in forty may find none. The roll's mean square climbs by stairs, two
/// to each of its periods: where the threshold lies near a landing, onsets fall on both sides of it, and no standard deviation tells of that.
fn onset_between(found_s: f64, drawn_s: &[f64], end_s: f64) -> [f64; 2] {
    let [earliest_s, latest_s] = extremes(found_s, drawn_s);
    let latest_s = match drawn_s.len() + 1 < DRAWS {
        true => end_s,
        false => latest_s + COUNTED_S,
    };
    [earliest_s - COUNTED_S, latest_s]
}

/// The least and the most of an estimate and what is drawn about it: of 40 draws, what holds 95 of a hundred.
fn extremes(found: f64, drawn: &[f64]) -> [f64; 2] {
    let all = || drawn.iter().copied().chain([found]);
    [
        all().fold(f64::MAX, f64::min),
        all().fold(f64::MIN, f64::max),
    ]
}

/// The largest difference of two columns: what holes add to one swing, if it is the largest, they add to the swing from lowest to highest.
fn farthest_apart([a, b]: [&[f64]; 2]) -> f64 {
    let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    apart.fold(0.0, f64::max)
}

/// An interval of `x` that holes make wider: as many again change it by `off`, one standard deviation.
fn apart([low, high]: [f64; 2], x: f64, off: f64) -> [f64; 2] {
    let wider = |half: f64| half.hypot(1.96 * off);
    match off == 0.0 {
        true => [low, high],
        false => [(x - wider(x - low)).max(0.0), x + wider(high - x)],
    }
}

/// Of a sample about its mean.
fn variance(x: &[f64]) -> f64 {
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (x.len() as f64 - 1.0).max(1.0)
}

/// Metrics of the roll's lines.
const OF_ROLL: &[&str] = &["roll_peak_hz", "subharmonic_ratio"];
/// Ratio of the roll's power at f/2 to that at f beyond which no gyroscope tells the latter: 10° to 0.01°.
const BEYOND_SENSORS: f64 = 1e6;
/// Metrics of the heave's lines and growth: none where its RMS is below the budget's wandering.
const OF_HEAVE: &[&str] = &[
    "peak_hz",
    "h2_ratio",
    "subharmonic_ratio",
    "growth_ratio",
    "mechanism",
];
/// RMS roll from which its lines are looked for, in standard deviations of the tilt's constant error.
const SEEN: f64 = 5.0;

//! The paper's metrics of a [`Motion`], each number with its 95 % interval.
//!
//! The estimated columns are varied within the [`Budget`] of what the sensor and the method leave uncertain, and sampled
//! at the paper's 30 Hz with a random phase; the metric's spread over the draws is its standard error, 1.96 of which are given. Where short holes were
//! drawn through, what as many holes again would change counts as one more.

use super::budget::{BY_EYE_RAD, Budget, UNCALIBRATED_GYRO_SCALE, UNCALIBRATED_M_PER_S2};
use super::floating::floating;
use super::rath::{Motion, Mounting};
use super::track::Instrument;
use super::unloading::unloadings;
use crate::inputs::{Inputs, Window, between, finite};
use crate::line::{Shares, rival_hz};
use crate::mechanism::Verdict;
use crate::metrics::{Datum, Metrics, metrics_of};
use crate::random::Random;
use std::ops::Range;

/// Number of draws behind an interval.
const DRAWS: usize = 40;
/// Seed of the draws: the same recording gives the same interval.
const SEED: u64 = 0x7261_7468;
/// How long what wanders stays alike, s.
const WANDER_S: f64 = 3.0;
/// What a bias walks in so long is in the budget's constant tilt, s.
const FIRST_S: f64 = 60.0;
/// Metrics that an inertial sensor cannot give, and why.
const BEYOND: &[(&str, &str)] = &[
    (
        "z_mean_m",
        "an inertial sensor does not see the mean height",
    ),
    ("rms_yaw_deg", "heading without a magnetometer drifts"),
];
/// Metrics that rest on the motion columns: those that get an interval.
const FROM_MOTION: &[&str] = &[
    "rms_roll_deg",
    "rms_pitch_deg",
    "onset_time_s",
    "unstable",
    "roll_excess_s",
    "dz_pp_m",
    "rms_z_m",
    "z_mean_m",
    "rms_yaw_deg",
    "t_float",
    "peak_hz",
    "h2_ratio",
    "roll_peak_hz",
    "subharmonic_ratio",
    "growth_ratio",
    "mechanism",
];

/// Whether a metric is one of those that [`metrics`] gives.
pub fn gives(name: &str) -> bool {
    FROM_MOTION.contains(&name)
}

/// Whether a metric rests on the height, whose slow course an inertial sensor loses.
pub fn is_of_height(name: &str) -> bool {
    OF_COURSE.contains(&name) || OF_HEAVE.contains(&name)
}

/// Every metric that rests on the motion alone, over `window`, each number with its 95 % interval.
pub fn metrics(motion: &Motion, window: Window) -> Metrics {
    let mut out = metrics_of(&motion.inputs, window, gives);
    let drawn = |tilt_rad: f64, wanted: fn(&str) -> bool| -> Vec<Metrics> {
        let varied = (0..DRAWS).map(|k| varied(motion, window, k as u64, tilt_rad));
        varied
            .map(|inputs| metrics_of(&inputs, Window::ALL, wanted))
            .collect()
    };
    let tilt_rad = constant_tilt_rad(motion);
    let draws = drawn(tilt_rad, |name| gives(name) && name != "mechanism");
    let untilted = (tilt_rad > 0.0).then(|| drawn(0.0, |name| MEAN_SQUARES.contains(&name)));
    let untilted = untilted.as_ref().unwrap_or(&draws);
    let again = motion
        .again
        .as_deref()
        .map(|again| (again, metrics_of(again, window, gives)));
    // What as many holes again change.
    let off = |name: &str, x: f64| {
        let found = again.as_ref().and_then(|(_, m)| m.number(name));
        found.map_or(0.0, |again| again - x)
    };
    let onsets: Vec<f64> = draws
        .iter()
        .filter_map(|d| d.number("onset_time_s"))
        .collect();
    let by_holes = |found: bool| {
        let again = again.as_ref()?.1.number("onset_time_s").is_some();
        let what = if found { "none" } else { "one" };
        (again != found).then(|| format!("with as many holes again {what} would be found"))
    };
    let range = window.range(&motion.inputs.t_s);
    let t_float = |inputs: &Inputs| {
        let within = |r: &Range<usize>| {
            let (from, to) = (r.start.max(range.start), r.end.min(range.end));
            (from < to).then(|| &inputs.support_ratio[from..to])
        };
        let parts: Vec<&[f64]> = motion.stretches.iter().filter_map(within).collect();
        floating(&parts)
    };
    let rate_hz = rate_hz(&motion.inputs);
    let [left_out_s, sampled_s] = motion.left_out_s(window);
    let unseen = left_out_s / sampled_s.max(f64::MIN_POSITIVE);
    let lost = (left_out_s * rate_hz) as usize;
    for (name, value) in &mut out.0 {
        if let Some((_, why)) = BEYOND.iter().find(|(n, _)| n == name) {
            value.withhold(*why);
            value.source = "imu".into();
            continue;
        }
        if *name == "unstable"
            && let Datum::Bool(found) = value.datum
        {
            let others = if found {
                DRAWS - onsets.len()
            } else {
                onsets.len()
            };
            let other = if found { "none" } else { "one" };
            value.reason = doubtful(others, other).or_else(|| by_holes(found));
            continue;
        }
        let placed = motion.settings.lever_is_known || !OF_PLACE.contains(name);
        if let (Datum::Word(word), Some(reason)) = (&value.datum, &mut value.reason)
            && !placed
            && *word != Verdict::Quiet.word()
        {
            *reason += &format!("; the fit is {UNPLACED}, for {PLACE_IT}");
        }
        let Datum::Number(x) = value.datum else {
            continue;
        };
        if *name == "onset_time_s" {
            let end_s = motion.inputs.t_s[range.clone()].last().copied();
            let ends = onset_between(x, &onsets, end_s.unwrap_or(x));
            value.ci95 = Some(apart(ends, x, off(name, x)));
            let reason = || doubtful(DRAWS - onsets.len(), "none").or_else(|| by_holes(true));
            value.reason = value.reason.take().or_else(reason);
            continue;
        }
        let draws = if MEAN_SQUARES.contains(name) {
            untilted
        } else {
            &draws
        };
        let drawn: Vec<f64> = draws.iter().filter_map(|d| d.number(name)).collect();
        if drawn.len() < DRAWS / 2 {
            continue;
        }
        // About the estimate, not about the draws' mean: what the draws add on average is theirs.
        if MEAN_SQUARES.contains(name) {
            let (root, ci95) = without_noise(x, &drawn);
            let (roll, pitch) = (&motion.inputs.roll_rad, &motion.inputs.pitch_rad);
            let [angle, other] = match *name {
                "rms_roll_deg" => [roll, pitch],
                _ => [pitch, roll],
            }
            .map(|x| &x[range.clone()]);
            let mean_deg = angle.iter().sum::<f64>().to_degrees() / angle.len() as f64;
            value.datum = Datum::Number(root);
            let ends = tilted(root, ci95, mean_deg, 1.96 * tilt_rad.to_degrees());
            let most = 1.96 * mounting_error_rad(&motion.settings.budget);
            let ends = mixed(root, ends, angle, other, most);
            // Of what is left out nothing is known but how the rest varies.
            let square = root.to_radians().powi(2);
            let rest = (square + unseen * spread_of_parts(angle, lost)).sqrt() - square.sqrt();
            let off = off(name, x).hypot(rest.to_degrees());
            value.ci95 = Some(apart(ends, root, off));
            value.reason = uncalibrated(motion);
            continue;
        }
        if *name == "roll_excess_s" {
            // Swings that keep step with the samples are all counted in one way or all in the other: no standard deviation tells of that.
            let [low, high] = apart(extremes(x, &drawn), x, off(name, x));
            value.ci95 = Some([low, high + left_out_s]);
            continue;
        }
        let floats = (*name == "t_float").then(|| t_float(&motion.inputs));
        let x = floats.map_or(x, |found| found.share);
        let off = match (&again, *name) {
            (Some((again, _)), "dz_pp_m") => {
                let heights = [&motion.inputs, *again].map(|i| &i.height_m[range.clone()]);
                farthest_apart(heights) / 1.96
            }
            (Some((again, _)), "t_float") => t_float(again).share - x,
            _ => off(name, x),
        };
        let beyond = beyond_the_budget(name, motion, window);
        let beyond = floats.map_or(beyond, |found| found.edges_sd.max(beyond));
        let half = 1.96 * (variance(&drawn) + beyond.powi(2) + off.powi(2)).sqrt();
        value.datum = Datum::Number(x);
        // None of them is below nothing, and a share is one at most.
        let most = if floats.is_some() { 1.0 } else { f64::INFINITY };
        // Noise adds to a largest minus a smallest, the more the longer it is looked for, and never takes from it.
        let added = match *name {
            "dz_pp_m" => (drawn.iter().sum::<f64>() / drawn.len() as f64 - x).max(0.0),
            _ => 0.0,
        };
        value.ci95 = Some([(x - half.hypot(added)).max(0.0), (x + half).min(most)]);
        let of_height = OF_COURSE.contains(name).then(|| {
            let corner_hz = motion.settings.height_corner_hz;
            format!("of what heaves faster than {corner_hz} Hz: an inertial sensor loses a slower course of the height")
        });
        // What is so much smaller than the line at f/2 is the sensor's noise as much as the load's motion.
        let drowned = *name == "subharmonic_ratio" && x > BEYOND_SENSORS;
        value.ci95 = value.ci95.filter(|_| !drowned);
        let of_noise = drowned.then(|| {
            "without an interval: so little roll at f is the sensor's noise as much as the load's motion, and the ratio this much or more".to_owned()
        });
        let of_place = (!placed)
            .then(|| format!("{UNPLACED}, and the interval knows no better, for {PLACE_IT}"));
        let of_rate = (OF_EDGES.contains(name) && rate_hz < ENOUGH_HZ).then(|| {
            format!("at {rate_hz:.0} Hz touch-downs fall between samples, and their overtones onto slower lines; 100 Hz or more are wanted")
        });
        let reasons: Vec<String> = value
            .reason
            .take()
            .into_iter()
            .chain(of_height)
            .chain(of_noise)
            .chain(of_place)
            .chain(of_rate)
            .collect();
        value.reason = (!reasons.is_empty()).then(|| reasons.join("; "));
    }
    if unseen > MOST_UNSEEN {
        let why = format!(
            "without an interval: {left_out_s:.1} of {sampled_s:.1} s are not known, and nothing tells how the load moved then"
        );
        without_an_interval(&mut out, &why, |_| true);
    }
    let budget = &motion.settings.budget;
    let below = |name: &str, least: f64| out.number(name).is_some_and(|x| x < least);
    let unseen = [
        (
            below("rms_roll_deg", SEEN * budget.tilt_offset_rad.to_degrees()),
            "roll",
            OF_ROLL,
        ),
        (below("rms_z_m", budget.height_wander_m), "heave", OF_HEAVE),
    ];
    for (_, what, names) in unseen.into_iter().filter(|(small, ..)| *small) {
        for (_, value) in out.0.iter_mut().filter(|(name, _)| names.contains(name)) {
            value.withhold(format!(
                "so small a {what} has no line that the sensor could tell from its own wandering"
            ));
            value.source = "imu".into();
        }
    }
    out
}

/// Where more than this of a window is left out, its metrics have no interval: what a rath did meanwhile is as much a part of them.
const MOST_UNSEEN: f64 = 0.1;

/// What a sensor did not tell of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lost {
    /// What went beyond its range.
    Peaks(Instrument),
    /// All, while it stood still.
    All(Instrument),
    /// About which axes it turned.
    Axes,
    /// In which unit it turned.
    Unit,
    /// How it sits on the body.
    Mounting,
    /// That it sits there as it did before.
    Turned,
}

/// Takes the intervals from numbers that rest on what was lost, which is in no budget. An accelerometer's missing peaks hardly turn the attitude.
pub fn without(metrics: &mut Metrics, lost: Lost) {
    let attitude = lost != Lost::Peaks(Instrument::Accelerometer);
    without_those(metrics, lost, |name| {
        attitude || is_of_height(name) || name == "t_float"
    });
}

/// The same of those that `rests_on` names.
pub fn without_those(metrics: &mut Metrics, lost: Lost, rests_on: impl Fn(&str) -> bool) {
    let (instrument, why) = match lost {
        Lost::Peaks(of) => (of, "came to the end of its range"),
        Lost::All(of) => (of, "gave one reading while the device moved"),
        Lost::Axes => (
            Instrument::Gyroscope,
            "does not stand on the accelerometer's axes",
        ),
        Lost::Unit => (Instrument::Gyroscope, "reads no rad/s"),
        Lost::Mounting => (
            Instrument::Accelerometer,
            "shows gravity elsewhere than below the load as the sensor is said to be mounted",
        ),
        Lost::Turned => (
            Instrument::Accelerometer,
            "shows gravity elsewhere in the sensor's axes from a moment of the window on",
        ),
    };
    let why = format!("without an interval: the {} {why}", instrument.name());
    without_an_interval(metrics, &why, rests_on);
}

fn without_an_interval(metrics: &mut Metrics, why: &str, rests_on: impl Fn(&str) -> bool) {
    for (name, value) in &mut metrics.0 {
        if rests_on(name) && value.ci95.take().is_some() {
            value.reason = Some(match value.reason.take() {
                Some(reason) => format!("{why}; {reason}"),
                None => why.to_owned(),
            });
        }
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
    super::track::period_s(&inputs.t_s).map_or(f64::INFINITY, |s| 1.0 / s)
}

/// What a slow course of the height is part of.
const OF_COURSE: &[&str] = &["dz_pp_m", "rms_z_m", "growth_ratio"];

/// Roots of mean squares, to which noise adds and from which it never takes.
const MEAN_SQUARES: &[&str] = &["rms_roll_deg", "rms_pitch_deg"];

/// A root mean square without what noise added to it, and its 95 % interval: the same noise, `drawn`, adds as much once more.
///
/// ```text
/// s = 2 x² − ⟨d²⟩,    x' = √s,    √(s ± 1.96 SD(d²)),    none below 0
/// ```
/// x as estimated, d as drawn about it. Source: Cook & Stefanski, "Simulation-extrapolation estimation", J. Am. Stat. Assoc. 89 (1994), to first
/// order in the noise's power.
fn without_noise(x: f64, drawn: &[f64]) -> (f64, [f64; 2]) {
    let squares: Vec<f64> = drawn.iter().map(|d| d * d).collect();
    let noisier = squares.iter().sum::<f64>() / squares.len() as f64;
    let square = 2.0 * x * x - noisier;
    let half = 1.96 * variance(&squares).sqrt();
    let root = |square: f64| square.max(0.0).sqrt();
    (root(square), [root(square - half), root(square + half)])
}

/// Standard deviation of the accelerometer's bias, m/s²: as said, or of one that nobody calibrated, on the evidence of the axis that gravity shows.
fn accel_bias_m_per_s2(motion: &Motion) -> f64 {
    let seen = motion.gravity_off_m_per_s2.abs();
    let said = motion.settings.budget.accel_bias_m_per_s2;
    said.unwrap_or(UNCALIBRATED_M_PER_S2.max(seen))
}

/// Relative standard deviation of angles: of the gyroscope's scale, as said or of one that nobody calibrated, and of the method.
fn angle_scale(budget: &Budget) -> f64 {
    let said = budget.gyro_scale_error;
    budget
        .angle_scale
        .hypot(said.unwrap_or(UNCALIBRATED_GYRO_SCALE))
}

/// What nobody said of the sensor, and what was taken for it.
fn uncalibrated(motion: &Motion) -> Option<String> {
    let budget = &motion.settings.budget;
    let mounting = match motion.settings.mounting {
        Mounting::Levelled => Some("about its mean over the window: how the sensor sits cannot be told from how the load leans; give imu_mounting_roll_pitch_yaw_deg in a roles file".into()),
        Mounting::Known(_) => budget.accel_bias_m_per_s2.is_none().then(|| format!(
            "as if nobody had calibrated the accelerometer (a bias of {:.2} m/s², SD); accel_bias_m_per_s2 in a roles file says otherwise",
            accel_bias_m_per_s2(motion)
        )),
    };
    let scale = budget.gyro_scale_error.is_none().then(|| format!(
        "as if nobody had calibrated the gyroscope (a scale off by {} %, SD); gyro_scale_error in a roles file says otherwise",
        100.0 * UNCALIBRATED_GYRO_SCALE
    ));
    let placed = budget.mounting_error_rad.is_none().then(|| format!(
        "as if it was mounted by eye ({:.0}° off about each axis, SD); imu_mounting_error_deg in a roles file says otherwise",
        BY_EYE_RAD.to_degrees()
    ));
    let all: Vec<String> = mounting.into_iter().chain(scale).chain(placed).collect();
    (!all.is_empty()).then(|| all.join("; "))
}

/// How far the sensor may stand otherwise on the load, rad (one standard deviation): as said, or by eye.
fn mounting_error_rad(budget: &Budget) -> f64 {
    budget.mounting_error_rad.unwrap_or(BY_EYE_RAD)
}

/// By how much such a bias, and such a mounting, tilts up for good, rad (one standard deviation).
fn constant_tilt_rad(motion: &Motion) -> f64 {
    match motion.settings.mounting {
        Mounting::Known(_) => (accel_bias_m_per_s2(motion) / motion.settings.gravity_m_per_s2)
            .hypot(mounting_error_rad(&motion.settings.budget)),
        // What is up is found with the same bias.
        Mounting::Levelled => 0.0,
    }
}

/// The interval of a root mean square that may lean by up to `most` more or less than seen, all the time:
///
/// ```text
/// x² = v + m²,    v + (|m| − c)² … v + (|m| + c)²
/// ```
/// m the mean, v the variance about it, which such a lean leaves alone, c what it may be; none below v. Errors add by squares.
fn tilted(root: f64, [low, high]: [f64; 2], mean: f64, most: f64) -> [f64; 2] {
    let mean = mean.abs();
    let square = root * root;
    let down = mean * mean - (mean - most).max(0.0).powi(2);
    let up = (mean + most).powi(2) - mean * mean;
    let low = square - (square - low * low).hypot(down);
    let high = square + (high * high - square).hypot(up);
    [low.max(0.0).sqrt(), high.sqrt()]
}

/// The interval of the root mean square of an angle x whose sensor may be turned about the vertical by up to `most` (rad) each way, so that a part of the
/// other angle y is taken for it:
///
/// ```text
/// x' = x − ε y,    ⟨x'²⟩ − ⟨x²⟩ = ε² ⟨y²⟩ − 2 ε ⟨x y⟩        |ε| ≤ most
/// ```
/// Small angles; of ε the least and the most count. What may be y's is a known part of the square, and so is a lean ([`tilted`]): both may
/// have to go, so that downwards they add up; upwards errors add by squares.
fn mixed(root: f64, [low, high]: [f64; 2], x: &[f64], y: &[f64], most: f64) -> [f64; 2] {
    let count = x.len() as f64;
    let of_y = y.iter().map(|y| y * y).sum::<f64>() / count;
    let of_both = x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>() / count;
    let change = |e: f64| (e * e * of_y - 2.0 * e * of_both) * 1f64.to_degrees().powi(2);
    let least = (of_both / of_y.max(f64::MIN_POSITIVE)).clamp(-most, most);
    let (down, up) = (-change(least), change(most).max(change(-most)));
    let square = root * root;
    let low = low * low - down;
    let high = square + (high * high - square).hypot(up);
    [low.max(0.0).sqrt(), high.sqrt()]
}

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

/// Said where more than one in forty equally good sensors would find an onset, or none, against the one that did not.
fn doubtful(others: usize, what: &str) -> Option<String> {
    (others > 1)
        .then(|| format!("of {DRAWS} sensors as good as this one {others} would find {what}"))
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

/// How far an edge of the support is moved by what smooths it, samples: 0.14 on twelve twins at 100 Hz, 0.28 in the worked example of
/// docs/field.md; below [`ENOUGH_HZ`] 0.2 to 0.65 on twenty at 50 Hz, to 0.78 on seventy at 25 to 40 Hz, and 0.7 in an hour of means over 20 ms.
const EDGE_SAMPLES: [f64; 2] = [0.3, 0.4];

/// So much of its SD has a wandering of [`WANDER_S`] between 0.2 and 0.4 Hz, as [`slow_course_m`] sees it: ∫ of its spectrum times the difference
/// of the two gains 1/(1 + (f₀/f)⁴), squared.
const ABOVE_CORNER: f64 = 0.185;
/// Largest minus smallest of a course of SD 1 that is alike for [`WANDER_S`], in a minute: of 20 to 25 normal numbers (Tippett, Biometrika 17 (1925)).
const RANGE_OF_WANDER: f64 = 3.8;

/// Standard error of a metric that no draw shows, in its own unit: what the window holds and the estimate does not.
fn beyond_the_budget(name: &str, motion: &Motion, window: Window) -> f64 {
    let inputs = &motion.inputs;
    let range = window.range(&inputs.t_s);
    let of = |x: &[f64]| finite(&inputs.t_s[range.clone()], &x[range.clone()]);
    let (seen_s, seen) = of(&inputs.height_m);
    let lost = range.len() - seen.len();
    let Some(period_s) = super::track::period_s(&inputs.t_s) else {
        return 0.0;
    };
    match name {
        // Lines sit on bins of 1/T, and the estimate's T is shorter than the window's: up to half a bin each, evenly spread.
        "peak_hz" | "roll_peak_hz" if !seen.is_empty() => {
            let bin = 0.5 / (seen.len() as f64 * period_s) / 3f64.sqrt() * 2f64.sqrt();
            let (t_s, x) = match name {
                "peak_hz" => (seen_s, seen),
                _ => of(&inputs.roll_rad),
            };
            bin.hypot(rival_hz(&t_s, &x) / 1.96)
        }
        // So may the line be by which the roll's shares are told, a bin in all, or its rival: it counts where power lies at a band's edge.
        "subharmonic_ratio" => {
            let bin_hz = 1.0 / (seen.len() as f64 * period_s);
            let off_hz = [bin_hz, bin_hz.hypot(rival_hz(&seen_s, &seen))];
            let (t_s, roll) = of(&inputs.roll_rad);
            let ratio = |hz: f64| {
                let shares = Shares::of(&t_s, &roll, hz)?;
                Some(shares.at_half / shares.at_f).filter(|x| x.is_finite())
            };
            let off = |hz: f64| {
                let whole = ratio(hz)?;
                let others = off_hz.into_iter().flat_map(|off| [hz - off, hz + off]);
                let others = others.filter_map(ratio);
                Some(others.map(|x| (x - whole).abs()).fold(0.0, f64::max))
            };
            heave_hz(inputs, window).and_then(off).unwrap_or(0.0) / 1.96
        }
        // What is slower than the corner is missing or too much.
        "dz_pp_m" => lost_course_m(motion, range),
        // The weights 1, 2, 1 move a touch-down by a part of a sample, all of them to the same side (docs/field.md: twins at 100 and 200 Hz).
        "t_float" if motion.settings.lever_m != [0.0; 3] => {
            let (t_s, ratio) = (&inputs.t_s[range.clone()], &inputs.support_ratio[range]);
            let length_s = t_s.len().max(1) as f64 * period_s;
            let edges = 2 * unloadings(t_s, ratio).len();
            let samples = EDGE_SAMPLES[usize::from(1.0 / period_s < ENOUGH_HZ)];
            samples * edges as f64 * period_s / length_s
        }
        // The transform has no taper: each line is as high as it falls on a bin of 1/T, and the estimate's T is not the window's. While an end
        // moves through a period, both fall everywhere. And of what is missing lines may be higher or lower.
        "h2_ratio" => {
            let bins = |hz: f64| (1..=8).map(move |k| [0.0, f64::from(k) / (8.0 * hz)]);
            let ends = without_ends(lost as f64 * period_s);
            heave_hz(inputs, window).map_or(0.0, |hz| {
                farthest(name, inputs, window, bins(hz).chain(ends)) / 1.96
            })
        }
        // Thirds of a window without its ends are other thirds: as far off as if as much were missing once, twice, thrice more, or as what is
        // missing swings more or less than the rest. And thirds are whole samples. The course that is missing may be all in one of them.
        "growth_ratio" => {
            let cuts = without_ends((lost as f64 * period_s).max(COUNTED_S));
            let ends = farthest(name, inputs, window, cuts) / 1.96;
            let about = centred(&seen);
            let third = seen.len() / 3;
            let [first, last] = [&about[..third], &about[about.len() - third..]].map(power);
            let least = first.min(last);
            if least <= 0.0 {
                return 0.0;
            }
            let missing =
                lost as f64 / third as f64 * spread_of_parts(&about, lost) / (2.0 * least);
            let course = lost_course_m(motion, range) / least.sqrt();
            let growth = (last / first).sqrt();
            ends.hypot(growth * missing)
                .hypot(growth * (1f64.hypot(course) - 1.0))
        }
        // The ends have no height. Stretches of their length swing so much more or less than the whole. And a slow course is missing from it.
        "rms_z_m" => {
            let course_m = lost_course_m(motion, range.clone());
            let about = centred(&seen);
            let whole = power(&about);
            if whole <= 0.0 {
                return 0.0;
            }
            let spread = spread_of_parts(&about, lost);
            let ends = lost as f64 / range.len() as f64 * spread / (2.0 * whole.sqrt());
            ends.hypot((whole + course_m.powi(2)).sqrt() - whole.sqrt())
        }
        _ => 0.0,
    }
}

/// Largest minus smallest of a course below the corner f₀ that is as large as what is found between it and 2f₀ beyond the budget's own wandering, m.
///
/// Samples too slow for touch-downs fold a gait's overtones: n f comes out at |n f − f_s|, and weighs in a height as 1/f² does. So all that is
/// slower than a quarter of a step counts then.
fn lost_course_m(motion: &Motion, range: Range<usize>) -> f64 {
    let corner_hz = motion.settings.height_corner_hz;
    let of_budget = ABOVE_CORNER * motion.settings.budget.height_wander_m;
    let step_hz = || heave_hz(&motion.inputs, Window::ALL);
    let quarter_hz = (rate_hz(&motion.inputs) < ENOUGH_HZ)
        .then(step_hz)
        .flatten()
        .map_or(0.0, |hz| 0.25 * hz);
    let course_m = slow_course_m(motion, range, quarter_hz.max(2.0 * corner_hz));
    let excess = course_m.powi(2) - of_budget.powi(2);
    RANGE_OF_WANDER * excess.max(0.0).sqrt()
}

/// A sample less its mean.
fn centred(x: &[f64]) -> Vec<f64> {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    x.iter().map(|x| x - mean).collect()
}

/// Of the height's strongest line, Hz.
fn heave_hz(inputs: &Inputs, window: Window) -> Option<f64> {
    metrics_of(inputs, window, |n| n == "peak_hz").number("peak_hz")
}

/// Mean square.
fn power(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>() / x.len().max(1) as f64
}

/// By how much the mean square of parts of so many samples differs from that of the whole, RMS; none lost differs by nothing.
fn spread_of_parts(x: &[f64], lost: usize) -> f64 {
    if lost == 0 || x.len() < 2 {
        return 0.0;
    }
    let whole = power(x);
    let parts = x.chunks_exact(lost.clamp(2, x.len()));
    let count = parts.len().max(1) as f64;
    let squares: f64 = parts.map(|part| (power(part) - whole).powi(2)).sum();
    (squares / count).sqrt()
}

/// SD of the height between its corner and `to_hz`, m: of what the window knows of it.
fn slow_course_m(motion: &Motion, range: Range<usize>, to_hz: f64) -> f64 {
    let faster = motion.height_m(to_hz);
    let both = motion.inputs.height_m[range.clone()]
        .iter()
        .zip(&faster[range]);
    let course: Vec<f64> = both
        .filter(|(z, _)| z.is_finite())
        .map(|(z, faster)| z - faster)
        .collect();
    if course.len() < 2 {
        return 0.0;
    }
    variance(&course).sqrt()
}

/// What is cut off at the ends where so much is missing: as much again, twice and thrice, at either.
fn without_ends(lost_s: f64) -> impl Iterator<Item = [f64; 2]> {
    let cuts = [1.0, 2.0, 3.0].map(|k| k * lost_s);
    cuts.into_iter()
        .flat_map(|cut_s| [[cut_s, 0.0], [0.0, cut_s]])
}

/// How far a metric of the height goes when so much (s) is cut off the beginning and the end of what is known of it.
fn farthest(
    name: &str,
    inputs: &Inputs,
    window: Window,
    cuts_s: impl Iterator<Item = [f64; 2]>,
) -> f64 {
    let range = window.range(&inputs.t_s);
    let known = |k: &usize| inputs.height_m[*k].is_finite();
    let (first, last) = (range.clone().find(known), range.rev().find(known));
    let (Some(first), Some(last)) = (first, last) else {
        return 0.0;
    };
    let of = |[head_s, tail_s]: [f64; 2]| {
        let window = Window {
            start_s: inputs.t_s[first] + head_s,
            end_s: inputs.t_s[last] - tail_s,
        };
        metrics_of(inputs, window, |n| n == name).number(name)
    };
    let Some(whole) = of([0.0; 2]) else {
        return 0.0;
    };
    cuts_s
        .filter_map(of)
        .map(|x| (x - whole).abs())
        .fold(0.0, f64::max)
}

/// The window's columns as they might have come out of an equally good sensor, at 30 Hz or its own rate.
fn varied(motion: &Motion, window: Window, draw: u64, tilt_rad: f64) -> Inputs {
    let budget = &motion.settings.budget;
    let seed = SEED ^ (draw.wrapping_add(1)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let [mut random, mut tilt, mut walk] = [seed, !seed, seed.rotate_left(32)].map(Random);
    let inputs = &motion.inputs;
    let range = window.range(&inputs.t_s);
    let Some(first) = inputs.t_s[range.clone()].first() else {
        return Inputs {
            gravity_m_per_s2: inputs.gravity_m_per_s2,
            ..Inputs::default()
        };
    };
    let step_s = super::track::period_s(&inputs.t_s).map_or(COUNTED_S, |s| s.max(COUNTED_S));
    let begin = first + random.uniform() * step_s;
    let at = |k: usize| (inputs.t_s[k] - begin) / step_s;
    // Every stretch to its end, and none of what lies between them.
    let within = |r: &Range<usize>| {
        let (from, to) = (r.start.max(range.start), r.end.min(range.end));
        let some = (from < to).then(|| (at(from).ceil() as i64)..=(at(to - 1).floor() as i64));
        some.into_iter().flatten()
    };
    let steps = motion.stretches.iter().flat_map(within);
    let t_s: Vec<f64> = steps.map(|k| begin + k as f64 * step_s).collect();
    let pick = |x: &[f64]| between(&inputs.t_s[range.clone()], &x[range.clone()], &t_s);
    let mut angle = |x: &[f64], random: &mut Random| -> Vec<f64> {
        let (offset, scale) = (
            budget.tilt_offset_rad * random.normal() + tilt_rad * tilt.normal(),
            1.0 + angle_scale(budget) * random.normal(),
        );
        let wander = random.wander(t_s.len(), step_s, budget.tilt_wander_rad, WANDER_S);
        let walk_rad = budget.tilt_walk_rad_per_sqrt_s;
        let walk = walked(&mut walk, t_s.len(), step_s, walk_rad);
        let errors = wander.iter().zip(walk).map(|(a, b)| offset + a + b);
        let x = pick(x).into_iter().zip(errors);
        x.map(|(x, error)| scale * x + error).collect()
    };
    let roll_rad = angle(&inputs.roll_rad, &mut random);
    let pitch_rad = angle(&inputs.pitch_rad, &mut random);
    let scale = 1.0 + budget.height_scale * random.normal();
    let wander = random.wander(t_s.len(), step_s, budget.height_wander_m, WANDER_S);
    let height_m = pick(&inputs.height_m)
        .iter()
        .zip(wander)
        .map(|(z, w)| scale * z + w)
        .collect();
    // A bias upwards is seen, but not whether it is one or a wrong scale.
    let off = motion.gravity_off_m_per_s2 / motion.settings.gravity_m_per_s2;
    let (offset, scale) = (
        budget.support_offset.hypot(off) * random.normal(),
        1.0 + budget.support_scale * random.normal(),
    );
    let support_ratio = pick(&inputs.support_ratio)
        .iter()
        .map(|s| scale * s + offset + budget.support_noise * random.normal())
        .collect();
    Inputs {
        t_s,
        height_m,
        roll_rad,
        pitch_rad,
        support_ratio,
        gravity_m_per_s2: inputs.gravity_m_per_s2,
        ..Inputs::default()
    }
}

/// What a bias that walks by so much in √s adds to an angle beyond the first minute, about its mean: the variance of T − 60 s, spread over T.
fn walked(random: &mut Random, n: usize, step_s: f64, walk_per_sqrt_s: f64) -> Vec<f64> {
    let span_s = n as f64 * step_s;
    let beyond = 1.0 - FIRST_S / span_s;
    if !(beyond > 0.0) {
        return vec![0.0; n];
    }
    let kick = walk_per_sqrt_s * (beyond * step_s).sqrt();
    let mut x = 0.0;
    let mut out: Vec<f64> = (0..n)
        .map(|_| {
            x += kick * random.normal();
            x
        })
        .collect();
    let mean = out.iter().sum::<f64>() / n as f64;
    out.iter_mut().for_each(|x| *x -= mean);
    out
}

#[cfg(test)]
mod tests;

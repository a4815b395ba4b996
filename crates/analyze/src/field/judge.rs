//! Errors of estimates where the recording holds the truth (`--truth`).

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use nalgebra::{UnitQuaternion, Vector3};
use recording::read::Recording;
use recording::signal::Signal;

use super::carriers::{self, Carriers};
use super::columns::{ACCEL, Columns};
use crate::beat::adler::turns::Turns;
use crate::clock::{Clock, from_signals};
use crate::filter::{Band, butter, sosfiltfilt};
use crate::imu::orientation::causal;
use crate::imu::rath::Motion;
use crate::imu::track::period_s;
use crate::imu::truth::{Truth, inclination_error_deg, relative_error};
use crate::imu::unloading::unloadings;
use crate::imu::{Track, interval, vertical};
use crate::inputs::{Inputs, Window, finite, interpolate};
use crate::metrics::{Datum, Metrics, Value, metrics_of};
use crate::roles::{Role, Roles};
use crate::steps::agreement;

/// Where a recording holds the moments of true steps.
pub const STEP_TOPIC: &str = "/truth/step";

/// Metrics that can be judged, and the names of their errors.
const ERRORS: &[(&str, &str)] = &[
    ("rms_roll_deg", "rms_roll_deg_error"),
    ("rms_pitch_deg", "rms_pitch_deg_error"),
    ("synchrony", "synchrony_error"),
    ("plv", "plv_error"),
    ("beat_synchrony", "beat_synchrony_error"),
    ("beat_hz", "beat_hz_error"),
    ("beat_lead_deg", "beat_lead_deg_error"),
    ("detuning_rad_per_s", "detuning_rad_per_s_error"),
    ("pull_rad_per_s", "pull_rad_per_s_error"),
    ("coupling_rad_per_s", "coupling_rad_per_s_error"),
    ("captured", "captured_error"),
    ("roll_lock", "roll_lock_error"),
    ("onset_time_s", "onset_time_s_error"),
    ("unstable", "unstable_error"),
    ("roll_excess_s", "roll_excess_s_error"),
    ("dz_pp_m", "dz_pp_m_error"),
    ("rms_z_m", "rms_z_m_error"),
    ("t_float", "t_float_error"),
    ("peak_hz", "peak_hz_error"),
    ("h2_ratio", "h2_ratio_error"),
    ("roll_peak_hz", "roll_peak_hz_error"),
    ("subharmonic_ratio", "subharmonic_ratio_error"),
    ("growth_ratio", "growth_ratio_error"),
    ("mechanism", "mechanism_error"),
];

/// Fields of a truth's topic: orientation and height, in the message types that hold them.
const ORIENTATION: &[[&str; 4]] = &[
    [
        "pose.orientation.x",
        "pose.orientation.y",
        "pose.orientation.z",
        "pose.orientation.w",
    ],
    [
        "pose.pose.orientation.x",
        "pose.pose.orientation.y",
        "pose.pose.orientation.z",
        "pose.pose.orientation.w",
    ],
    [
        "transform.rotation.x",
        "transform.rotation.y",
        "transform.rotation.z",
        "transform.rotation.w",
    ],
    [
        "orientation.x",
        "orientation.y",
        "orientation.z",
        "orientation.w",
    ],
];
const HEIGHT: &[&str] = &[
    "pose.position.z",
    "pose.pose.position.z",
    "transform.translation.z",
    "position_m.z",
];

/// Whether a field may be part of a truth.
pub fn wants(field: &str) -> bool {
    HEIGHT.contains(&field) || ORIENTATION.iter().any(|o| o.contains(&field))
}

/// Corner below which the second derivative of an optical height is more than its noise, Hz.
const SUPPORT_HZ: f64 = 10.0;

/// Errors that compare both at one moment, whatever their clocks.
const OF_A_MOMENT: &[&str] = &[
    "inclination_error_deg",
    "inclination_error_batch_deg",
    "onset_time_s_error",
];
/// Clocks further apart are worth a word, s: more than how old samples usually are at their stamps.
const APART_S: f64 = 0.01;

/// A recorded truth and the raw sensor beside it.
pub struct Judge {
    truth: Truth,
    height: Option<(Vec<f64>, Vec<f64>)>,
    sensor: Option<Track>,
    /// The truth is the body's pose, not the sensor's.
    of_body: bool,
    spans_s: Vec<(f64, f64)>,
    step_s: Vec<f64>,
}

impl Judge {
    /// The truth of a recording; `None` where it has none. `stamped` are the topics whose stamps are of one clock, where their spans overlap.
    pub fn read(
        columns: &Columns,
        roles: &Roles,
        recording: &Recording,
        stamped: &[&str],
    ) -> Option<Self> {
        let step_s = columns.times(STEP_TOPIC);
        let topic = roles.topic(Role::Truth);
        let track = |topic: &str| {
            let dates = columns.dates(topic, ACCEL[0], stamped)?;
            Some(columns.sensor(topic, dates)?.track)
        };
        let sensor = roles.topic(Role::Imu).and_then(track);
        let mut judge = Self {
            truth: Truth::default(),
            height: None,
            sensor,
            of_body: false,
            spans_s: Vec::new(),
            step_s,
        };
        if let Some(topic) = topic {
            // By the log, unless it tells no times.
            let times_s = |signal: &Signal, field: &str| {
                let own = columns.dates(topic, field, stamped);
                let own = own.filter(|dated| dated.own_pace);
                own.map_or_else(|| signal.times_s(columns.start_ns), |dated| dated.t_s)
            };
            for fields in ORIENTATION {
                if let (Some(q), Some(signal)) = (
                    columns.values(topic, *fields),
                    columns.get(topic, fields[0]),
                ) {
                    judge.truth = Truth::from_columns(&times_s(signal, fields[0]), q);
                }
            }
            let height = HEIGHT
                .iter()
                .find_map(|f| Some((columns.get(topic, f)?, f)));
            judge.height = height.map(|(s, field)| finite(&times_s(s, field), &s.values));
            judge.of_body = recording
                .info()
                .channels
                .iter()
                .any(|c| c.topic == topic && c.schema == "rath.State");
        }
        judge.spans_s = movement(&recording.info().metadata, recording.info().start_ns);
        (!judge.truth.t_s.is_empty() || !judge.step_s.is_empty()).then_some(judge)
    }

    /// Adds errors to the metrics.
    ///
    /// `NAME_error` is estimate minus truth; of words and yes-or-no, 0 for the same and 1 for different. Its interval is the
    /// estimate's, moved along: it covers 0 when the estimate's covers the truth. The true phases, if any, are those of `inputs`.
    pub fn errors(
        &self,
        motion: Option<&Motion>,
        carriers: &Carriers,
        estimated: &Metrics,
        metrics: &mut Metrics,
        inputs: &Inputs,
        window: Window,
    ) {
        let recorded = inputs.phase_rad.len();
        let mut out: Vec<(&'static str, Value)> = Vec::new();
        let mut of_pose = Metrics::default();
        let (mut slow_m, mut apart) = (None, None);
        if let (Some(motion), Some(sensor)) = (motion, &self.sensor)
            && !self.truth.t_s.is_empty()
        {
            let heave = self.heave(motion);
            apart = heave.as_ref().and_then(Heave::apart);
            self.orientation(motion, sensor, window, &mut out);
            if let Some(heave) = &heave {
                self.height_errors(motion, heave, window, &mut out);
            }
            slow_m = heave.as_ref().and_then(|h| h.slow_m(motion, window));
            of_pose = self.metrics(motion, heave, window);
        }
        let walking = carriers.step_s().len();
        let of_all = |error: &mut Value| {
            if walking != recorded {
                error.withhold(format!(
                    "{walking} of {recorded} carriers walk with a sensor; the truth is that of all"
                ));
            }
        };
        for (name, error) in ERRORS {
            // A metric that came from the sensors itself has no truth beside it, but in the true pose.
            let beside = metrics
                .get(name)
                .filter(|v| v.source != "imu" && !v.source.is_empty());
            let truth = beside.or_else(|| of_pose.get(name));
            let (Some(truth), Some(estimate)) = (truth, estimated.get(name)) else {
                continue;
            };
            let mut error_of = difference(estimate, truth);
            if carriers::of_all(name) {
                of_all(&mut error_of);
            }
            if let (Some(sd_m), None, true) = (slow_m, beside, interval::is_of_height(name)) {
                let said = error_of.reason.take().map(|r| format!("{r}; "));
                error_of.reason = Some(format!(
                    "{}the true height has a course of SD {sd_m:.3} m slower than {} Hz, which the sensor does not see",
                    said.unwrap_or_default(),
                    motion.map_or(0.0, |m| m.settings.height_corner_hz)
                ));
            }
            out.push((*error, error_of));
        }
        if !self.step_s.is_empty()
            && let Some(found) = carriers.first_steps()
        {
            let span = (
                self.step_s[0] - 0.3,
                self.step_s[self.step_s.len() - 1] + 0.3,
            );
            // Steps before the first and after the last true one were not judged by anybody.
            let inside: Vec<f64> = found
                .iter()
                .copied()
                .filter(|t| (span.0..=span.1).contains(t))
                .collect();
            let a = agreement(&inside, &self.step_s, 0.25);
            let f1 = Value::number(a.f1).source("imu");
            let text = format!(
                "{} of {} true and {} found steps within 0.25 s; found {:+.0} ms of the true ones (median)",
                a.matched,
                self.step_s.len(),
                inside.len(),
                1e3 * a.offset_s
            );
            out.push((
                "step_f1",
                Value {
                    unit: "1",
                    reason: Some(text),
                    ..f1
                },
            ));
            if let (Some(true_hz), Some(found_hz)) = (rate(&self.step_s), rate(&inside)) {
                out.push((
                    "step_rate_hz_error",
                    Value {
                        unit: "Hz",
                        ..Value::number(found_hz - true_hz).source("imu")
                    },
                ));
            }
        }
        let walked = metrics.get("step_rate_hz").filter(|v| v.source == "imu");
        if self.step_s.is_empty()
            && let (Some(true_hz), Some(found)) = (cycles_hz(inputs, window), walked)
        {
            let truth = Value {
                unit: "Hz",
                ..Value::number(true_hz)
            };
            let mut error = difference(found, &truth);
            of_all(&mut error);
            out.push(("step_rate_hz_error", error));
        }
        if let Some(apart) = apart {
            for (_, error) in out
                .iter_mut()
                .filter(|(name, _)| OF_A_MOMENT.contains(name))
            {
                let said = error.reason.take().map(|r| format!("; {r}"));
                error.reason = Some(format!("{apart}{}", said.unwrap_or_default()));
            }
        }
        metrics.0.extend(out);
    }

    /// Body from sensor where the truth is the sensor's pose.
    fn body_from_true(&self, motion: &Motion) -> UnitQuaternion<f64> {
        match self.of_body {
            true => UnitQuaternion::identity(),
            false => motion.body_from_sensor,
        }
    }

    /// The true height of the point whose height the sensor gives, and how its clock lies to the sensor's; `None` without a true height.
    fn heave(&self, motion: &Motion) -> Option<Heave> {
        let (t_s, z_m) = self.height.clone()?;
        let mut heave = Heave {
            t_s,
            z_m,
            sensor_m: motion.height_m(vertical::CORNER_HZ),
            clock: None,
        };
        if !self.of_body {
            // From the sensor to the centre of mass.
            let true_from_body = self.body_from_true(motion).inverse();
            let lever = Vector3::from(motion.settings.lever_m);
            let above = self.truth.world_from_body.iter();
            let above: Vec<f64> = above.map(|q| (q * true_from_body * lever).z).collect();
            let above = interpolate(&self.truth.t_s, &above, &heave.t_s);
            heave.z_m.iter_mut().zip(above).for_each(|(z, a)| *z -= a);
        }
        // How old the accelerometer's stamps are beside the truth's (the gyroscope's may be older): both heaved alike.
        let own = (&motion.inputs.t_s[..], &heave.sensor_m[..]);
        heave.clock = from_signals(own, (&heave.t_s, &heave.z_m), 0.1).ok();
        Some(heave)
    }

    /// The motion's metrics of the true pose, for a body on which the sensor sits as `motion` takes it to.
    fn metrics(&self, motion: &Motion, heave: Option<Heave>, window: Window) -> Metrics {
        let true_from_body = self.body_from_true(motion).inverse();
        let poses = self.truth.world_from_body.iter();
        // R = Rz(yaw) Ry(pitch) Rx(roll), REP-103.
        let angles = poses.map(|q| (q * true_from_body).euler_angles());
        let (roll_rad, pitch_rad) = angles.map(|(roll, pitch, _)| (roll, pitch)).unzip();
        let t_s = self.truth.t_s.clone();
        let support = heave.as_ref().and_then(|h| h.support_ratio(motion));
        let support_ratio = support.map_or_else(Vec::new, |ratio| {
            interpolate(&motion.inputs.t_s, &ratio, &t_s)
        });
        let inputs = Inputs {
            height_alone: heave.map(|h| (h.t_s, h.z_m)),
            t_s,
            roll_rad,
            pitch_rad,
            support_ratio,
            gravity_m_per_s2: motion.settings.gravity_m_per_s2,
            ..Inputs::default()
        };
        metrics_of(&inputs, window, interval::gives)
    }

    /// The stretches of time that count (s).
    fn spans_s(&self, window: Window) -> Vec<(f64, f64)> {
        match self.spans_s.is_empty() {
            true => vec![(window.start_s, window.end_s)],
            false => self.spans_s.clone(),
        }
    }

    fn orientation(
        &self,
        motion: &Motion,
        sensor: &Track,
        window: Window,
        out: &mut Vec<(&'static str, Value)>,
    ) {
        let spans = self.spans_s(window);
        let options = motion.settings.orientation;
        let body_from_true = self.body_from_true(motion);
        let true_from_sensor = body_from_true.inverse() * motion.body_from_sensor;
        let live: Vec<_> = causal(sensor, options)
            .earth_from_sensor
            .into_iter()
            .map(|q| q * true_from_sensor.inverse())
            .collect();
        let whole = motion.orientation.earth_from_sensor.iter();
        let whole: Vec<_> = whole.map(|q| q * body_from_true).collect();
        let mut push = |name, error: Option<f64>| {
            let value = match error {
                Some(e) => Value::number(e),
                None => Value::missing("the truth holds no orientation while the sensor moves"),
            };
            let text = format!(
                "samples taken to be {:.1} ms old at their stamps",
                1e3 * options.latency_s
            );
            let reason = value.reason.clone().or(Some(text));
            out.push((
                name,
                Value {
                    unit: "deg",
                    reason,
                    ..value.source("imu")
                },
            ));
        };
        push(
            "inclination_error_deg",
            inclination_error_deg(&sensor.t_s, &live, &self.truth, &spans),
        );
        push(
            "inclination_error_batch_deg",
            inclination_error_deg(&motion.inputs.t_s, &whole, &self.truth, &spans),
        );
    }

    fn height_errors(
        &self,
        motion: &Motion,
        heave: &Heave,
        window: Window,
        out: &mut Vec<(&'static str, Value)>,
    ) {
        let inner = self
            .spans_s(window)
            .iter()
            .fold((f64::MAX, f64::MIN), |(a, b), s| (a.min(s.0), b.max(s.1)));
        let error = relative_error(
            (&motion.inputs.t_s, &heave.sensor_m),
            (&heave.t_s, &heave.z_m),
            vertical::VALID_BAND_HZ,
            heave.offset_s(),
            inner,
        );
        if let Some(value) = unloading_agreement(motion, heave, inner) {
            out.push(("unloading_f1", value));
        }
        if let Some(e) = error {
            let text = match heave.clock {
                Some(c) => format!(
                    "RMS of the difference over RMS of the truth, both 0.3 to 10 Hz, after {:+.2} ± {:.2} ms between the two clocks",
                    1e3 * c.offset_s,
                    1.96e3 * c.offset_sd_s
                ),
                None => "RMS of the difference over RMS of the truth, both 0.3 to 10 Hz; the clocks could not be compared".into(),
            };
            out.push((
                "height_relative_error",
                Value {
                    unit: "1",
                    reason: Some(text),
                    ..Value::number(e).source("imu")
                },
            ));
        }
    }
}

/// Moments at which the support falls through 0.05 of the weight, from the sensor and from the second derivative of a true height, both
/// below 10 Hz: the share that agrees to 10 ms (F1). `None` where the truth is slower than 100 Hz or nothing is unloaded.
fn unloading_agreement(
    motion: &Motion,
    heave: &Heave,
    (from_s, to_s): (f64, f64),
) -> Option<Value> {
    const WITHIN_S: f64 = 0.01;
    let t_s = &motion.inputs.t_s;
    let g = motion.settings.gravity_m_per_s2;
    let measured: Vec<f64> = motion
        .accel_up_m_per_s2
        .iter()
        .map(|a| 1.0 + a / g)
        .collect();
    let support = [
        slower(t_s, &measured, SUPPORT_HZ)?,
        heave.support_ratio(motion)?,
    ];
    let [found, truth] = support.map(|ratio| {
        let mut found = unloadings(t_s, &ratio);
        found.retain(|t| (from_s..=to_s).contains(t));
        found
    });
    if truth.is_empty() {
        return None;
    }
    let a = agreement(&found, &truth, WITHIN_S);
    let text = format!(
        "{} of {} true and {} found unloadings within {:.0} ms, median {:+.1} ms, after {:+.2} ms between the two clocks",
        a.matched,
        truth.len(),
        found.len(),
        1e3 * WITHIN_S,
        1e3 * a.offset_s,
        1e3 * heave.offset_s()
    );
    Some(Value {
        unit: "1",
        reason: Some(text),
        ..Value::number(a.f1).source("imu")
    })
}

/// A true height over time, and what the sensor makes of it.
struct Heave {
    t_s: Vec<f64>,
    z_m: Vec<f64>,
    /// At the sensor's times.
    sensor_m: Vec<f64>,
    /// From the sensor's clock to this one; `None` where they could not be compared.
    clock: Option<Clock>,
}

impl Heave {
    fn offset_s(&self) -> f64 {
        self.clock.map_or(0.0, |c| c.offset_s)
    }

    /// Said where the two clocks are apart, or where nothing tells.
    fn apart(&self) -> Option<String> {
        let Some(clock) = self.clock else {
            return Some("nothing tells whether the two clocks agree".to_owned());
        };
        let unsure_s = 1.96 * clock.offset_sd_s;
        (clock.offset_s.abs() > APART_S.max(unsure_s)).then(|| {
            format!(
                "by the height the two clocks are {:+.1} ± {:.1} ms apart, and what moved meanwhile is in this error",
                1e3 * clock.offset_s,
                1e3 * unsure_s
            )
        })
    }

    /// SD of what of it is slower than the sensor's corner, m; `None` where that is below a tenth of the whole.
    fn slow_m(&self, motion: &Motion, window: Window) -> Option<f64> {
        let t_s = &motion.inputs.t_s;
        let z_m = interpolate(&self.t_s, &self.z_m, t_s);
        let slow = slower(t_s, &z_m, motion.settings.height_corner_hz)?;
        let sd = |x: &[f64]| {
            let mean = x.iter().sum::<f64>() / x.len() as f64;
            (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / x.len() as f64).sqrt()
        };
        let within = window.range(t_s);
        let (slow, all) = (sd(&slow[within.clone()]), sd(&z_m[within]));
        (slow > 0.1 * all).then_some(slow)
    }

    /// The support ratio 1 + z̈ / g below [`SUPPORT_HZ`] at the sensor's times. `None` where the height is slower than 100 Hz.
    fn support_ratio(&self, motion: &Motion) -> Option<Vec<f64>> {
        let t_s = &motion.inputs.t_s;
        let step_s = period_s(t_s)?;
        if period_s(&self.t_s)? > 0.01 || t_s.len() < 3 {
            return None;
        }
        let g = motion.settings.gravity_m_per_s2;
        let shifted: Vec<f64> = t_s.iter().map(|t| t + self.offset_s()).collect();
        let z_m = interpolate(&self.t_s, &self.z_m, &shifted);
        let ratio = |w: &[f64]| 1.0 + (w[0] - 2.0 * w[1] + w[2]) / (step_s * step_s * g);
        let mut all: Vec<f64> = z_m.windows(3).map(ratio).collect();
        all.insert(0, all[0]);
        all.push(all[all.len() - 1]);
        slower(t_s, &all, SUPPORT_HZ)
    }
}

/// What of `x` is slower than a corner.
fn slower(t_s: &[f64], x: &[f64], corner_hz: f64) -> Option<Vec<f64>> {
    let sections = butter(2, Band::Low(corner_hz), 1.0 / period_s(t_s)?).ok()?;
    sosfiltfilt(&sections, x).ok()
}

/// How often the recorded phases go round in the window, the mean of all carriers, Hz: a step each time. What sensors made of phases is
/// no truth.
fn cycles_hz(inputs: &Inputs, window: Window) -> Option<f64> {
    if inputs.phases_are_measured {
        return None;
    }
    let seen = window.range(&inputs.phase_t_s);
    let (first, last) = (
        seen.start,
        seen.end.checked_sub(1).filter(|l| *l > seen.start)?,
    );
    let went_s = inputs.phase_t_s[last] - inputs.phase_t_s[first];
    let went = |phase: &Vec<f64>| {
        let (t_s, phase) = (
            inputs.phase_t_s.get(first..=last)?,
            phase.get(first..=last)?,
        );
        let phase = Turns::of(t_s, phase).straightened(t_s, phase);
        Some((phase.last()? - phase.first()?) / TAU / went_s)
    };
    let all: Vec<f64> = inputs.phase_rad.iter().map(went).collect::<Option<_>>()?;
    (!all.is_empty() && went_s > 0.0).then(|| all.iter().sum::<f64>() / all.len() as f64)
}

/// Estimate minus truth.
fn difference(estimate: &Value, truth: &Value) -> Value {
    let same = |a: bool| Value::number(if a { 0.0 } else { 1.0 });
    let mut value = match (&estimate.datum, &truth.datum) {
        (Datum::Number(e), Datum::Number(t)) => {
            // Angles by the shorter way.
            let off = match truth.unit {
                "deg" => (e - t + 180.0).rem_euclid(360.0) - 180.0,
                _ => e - t,
            };
            let mut v = Value::number(off);
            v.ci95 = estimate.ci95.map(|ci95| ci95.map(|x| off + (x - e)));
            Value {
                unit: truth.unit,
                ..v
            }
        }
        (Datum::Word(e), Datum::Word(t)) => Value {
            unit: "1",
            reason: Some(format!("found {e}, true {t}")),
            ..same(e == t)
        },
        (Datum::Bool(e), Datum::Bool(t)) => Value {
            unit: "1",
            ..same(e == t)
        },
        (Datum::Missing, Datum::Missing) => Value {
            unit: truth.unit,
            reason: Some("neither has a value".into()),
            ..Value::number(0.0)
        },
        (Datum::Missing, _) => Value {
            unit: truth.unit,
            ..Value::missing("the sensors give no value")
        },
        _ => Value {
            unit: truth.unit,
            ..Value::missing("the truth has no value")
        },
    };
    value.source = estimate.source.clone();
    value
}

/// Events per second from the first to the last.
fn rate(t_s: &[f64]) -> Option<f64> {
    let span_s = t_s.last()? - t_s.first()?;
    (span_s > 0.0).then(|| (t_s.len() - 1) as f64 / span_s)
}

/// Metadata records by name, as a reader gives them.
type Records = BTreeMap<String, BTreeMap<String, String>>;

/// The spans that count, s since `start_ns`: metadata record `broad`, key `movement`, a list of [from, to] in nanoseconds.
fn movement(records: &Records, start_ns: i64) -> Vec<(f64, f64)> {
    let text = records.get("broad").and_then(|m| m.get("movement"));
    let spans: Vec<[i64; 2]> = text
        .and_then(|t| serde_json::from_str(t).ok())
        .unwrap_or_default();
    let s = |t: i64| (i128::from(t) - i128::from(start_ns)) as f64 / 1e9;
    spans.iter().map(|[a, b]| (s(*a), s(*b))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imu::orientation::Options;
    use crate::imu::rath::{Mounting, Settings, motion};
    use std::collections::BTreeMap;
    use std::f64::consts::{PI, SQRT_2, TAU};

    #[test]
    fn movement_spans_count_from_the_first_message() {
        let record = BTreeMap::from([(
            "movement".to_owned(),
            "[[2000000000, 3500000000]]".to_owned(),
        )]);
        let records = BTreeMap::from([("broad".to_owned(), record)]);
        assert_eq!(movement(&records, 1_000_000_000), [(1.0, 2.5)]);
        assert!(movement(&Records::new(), 0).is_empty());
    }

    #[test]
    fn an_error_carries_the_interval_along() {
        let e = difference(&Value::number(2.5).ci95(2.0, 3.0), &Value::number(2.2));
        assert!((e.as_f64().unwrap() - 0.3).abs() < 1e-12);
        assert!((e.ci95.unwrap()[0] + 0.2).abs() < 1e-12);
        let word = difference(
            &Value::word("quiet", String::new()),
            &Value::word("mixed", String::new()),
        );
        assert_eq!(word.as_f64(), Some(1.0));
    }

    #[test]
    fn a_difference_of_angles_is_the_shorter_way_and_of_words_yes_or_no() {
        let deg = |x: f64| Value {
            unit: "deg",
            ..Value::number(x)
        };
        for (estimate, truth, known) in [
            (179.0, -178.0, -3.0),
            (-175.0, 175.0, 10.0),
            (30.0, 10.0, 20.0),
        ] {
            let found = difference(
                &deg(estimate).ci95(estimate - 1.0, estimate + 2.0),
                &deg(truth),
            );
            assert!((found.as_f64().unwrap() - known).abs() < 1e-9, "{found:?}");
            let [low, high] = found.ci95.unwrap();
            assert!((low - known + 1.0).abs() < 1e-9 && (high - known - 2.0).abs() < 1e-9);
        }
        let word = |w| Value::word(w, String::new());
        let same = difference(&word("quiet"), &word("quiet"));
        assert_eq!(same.as_f64(), Some(0.0));
        let yes = |a, b| difference(&Value::bool(a), &Value::bool(b)).as_f64();
        assert_eq!((yes(true, true), yes(true, false)), (Some(0.0), Some(1.0)));
        let none = || Value::missing("no");
        assert_eq!(difference(&none(), &none()).as_f64(), Some(0.0));
        for (a, b) in [(none(), deg(1.0)), (deg(1.0), none())] {
            assert_eq!(difference(&a, &b).as_f64(), None);
        }
    }

    /// A height of SD 35 mm about 1.3 m with a course of 14 mm at 0.05 Hz, which a corner of 0.2 Hz leaves to 0.4 %; one of 2 mm is not worth a word.
    #[test]
    fn a_course_that_a_sensor_does_not_see_is_told() {
        let mut track = Track::default();
        for t in (0..6000).map(|k| 0.01 * f64::from(k)) {
            track.t_s.push(t);
            track.gyro_rad_per_s.push([0.0; 3]);
            track.accel_m_per_s2.push([0.0, 0.0, 9.80665]);
        }
        let still = motion(&track, &Settings::default()).unwrap();
        let slow_m = |amplitude_m: f64| {
            let line = |a: f64, hz: f64, t: f64| a * (TAU * hz * t).sin();
            let z = |t: &f64| 1.3 + line(0.05, 2.0, *t) + line(amplitude_m, 0.05, *t);
            let heave = Heave {
                z_m: track.t_s.iter().map(z).collect(),
                t_s: track.t_s.clone(),
                sensor_m: Vec::new(),
                clock: None,
            };
            let window = Window {
                start_s: 10.0,
                end_s: 49.99,
            };
            heave.slow_m(&still, window)
        };
        let found = slow_m(0.02).unwrap();
        assert!((found - 0.02 / SQRT_2).abs() < 2e-4, "{found}");
        assert_eq!(slow_m(0.003), None);
    }

    /// Steps at 2 Hz that somebody counted from 10 s to 30 s, and missed one of: what is found before and behind is nobody's fault.
    #[test]
    fn steps_are_judged_while_somebody_counted() {
        let t_s: Vec<f64> = (0..4000).map(|k| 0.01 * f64::from(k)).collect();
        let up = |t: &f64| 9.81 + 2.0 * (TAU * 2.0 * t).cos();
        let track = Track {
            accel_m_per_s2: t_s.iter().map(|t| [0.0, 0.0, up(t)]).collect(),
            gyro_rad_per_s: vec![[0.0; 3]; t_s.len()],
            t_s,
            dropped: 0,
        };
        let mut carriers = Carriers::default();
        carriers.add("/imu/1", &track, Options::default(), 9.81, 0.0);
        let judge = Judge {
            truth: Truth::default(),
            height: None,
            sensor: None,
            of_body: false,
            spans_s: Vec::new(),
            step_s: (20..=60)
                .filter(|k| *k != 31)
                .map(|k| 0.5 * f64::from(k) - 0.02)
                .collect(),
        };
        let mut metrics = Metrics::default();
        judge.errors(
            None,
            &carriers,
            &Metrics::default(),
            &mut metrics,
            &Inputs::default(),
            Window::ALL,
        );
        let f1 = metrics.get("step_f1").unwrap();
        // 40 of 40 true and 41 found.
        assert!((f1.as_f64().unwrap() - 80.0 / 81.0).abs() < 1e-12, "{f1:?}");
        let said = f1.reason.as_deref().unwrap();
        assert!(
            said.starts_with("40 of 40 true and 41 found") && said.contains("found +20 ms"),
            "{said}"
        );
        let rate = metrics.number("step_rate_hz_error").unwrap();
        assert!((rate - (40.0 - 39.0) / 20.0).abs() < 0.002, "{rate}");
        // Of two carriers with phases one has a sensor.
        let rate = Value {
            unit: "Hz",
            ..Value::number(2.0).source("imu")
        };
        let mut metrics = Metrics(vec![("step_rate_hz", rate)]);
        let phase_t_s: Vec<f64> = (0..900).map(|k| f64::from(k) / 30.0).collect();
        let inputs = Inputs {
            phase_rad: vec![phase_t_s.iter().map(|t| TAU * 2.1 * t).collect(); 2],
            phase_t_s,
            ..Inputs::default()
        };
        let judge = Judge {
            step_s: Vec::new(),
            ..judge
        };
        let none = Metrics::default();
        judge.errors(None, &carriers, &none, &mut metrics, &inputs, Window::ALL);
        let error = metrics.get("step_rate_hz_error").unwrap();
        let why = error.reason.as_deref().unwrap();
        assert!(
            error.as_f64().is_none() && why.starts_with("1 of 2 carriers"),
            "{error:?}"
        );
    }

    /// Two carriers whose phases are known, and no true steps.
    #[test]
    fn recorded_phases_say_how_often_people_step() {
        let t_s: Vec<f64> = (0..=900).map(|i| f64::from(i) / 30.0).collect();
        let walk = |hz: f64| t_s.iter().map(|t| TAU * hz * t + 0.4).collect();
        let inputs = Inputs {
            phase_rad: vec![walk(2.0), walk(2.2)],
            phase_t_s: t_s.clone(),
            ..Inputs::default()
        };
        let window = Window {
            start_s: 10.0,
            end_s: 20.0,
        };
        let hz = cycles_hz(&inputs, window).unwrap();
        assert!((hz - 2.1).abs() < 1e-12, "{hz}");
        let mut wrapped = inputs.clone();
        let phases = wrapped.phase_rad.iter_mut().flatten();
        phases.for_each(|x| *x = crate::phase::wrap(*x));
        let hz = cycles_hz(&wrapped, window).unwrap();
        assert!((hz - 2.1).abs() < 1e-9, "{hz}");
        let outside = Window {
            start_s: 40.0,
            end_s: 50.0,
        };
        assert_eq!(cycles_hz(&inputs, outside), None);
        assert_eq!(cycles_hz(&Inputs::default(), Window::ALL), None);
        let from_sensors = Inputs {
            phases_are_measured: true,
            ..inputs
        };
        assert_eq!(cycles_hz(&from_sensors, window), None);
    }

    /// A load that heaves until it is unloaded and rolls, its sensor 0.36 m off the centre of mass, and the pose of that sensor: what the errors
    /// are taken against is in closed form.
    #[test]
    fn a_true_pose_of_the_sensor_judges_the_motion_of_the_centre_of_mass() {
        judged(UnitQuaternion::identity(), 0.0);
        judged(UnitQuaternion::from_euler_angles(0.3, -0.2, 0.9), 0.0);
    }

    /// A truth whose clock is 60 ms off: 0.3 rad at 0.9 Hz turn by 2 · 0.3 sin(ω 30 ms) meanwhile, 4.1° (RMS).
    #[test]
    fn a_truth_of_another_clock_says_so() {
        judged(UnitQuaternion::identity(), 0.06);
    }

    /// `mount`: body from sensor; `late_s`: of the truth.
    fn judged(mount: UnitQuaternion<f64>, late_s: f64) {
        const G: f64 = 9.81;
        let lever_m = [0.0, 0.2, 0.3];
        let (roll, heave) = (0.3, 1.4 * G / (TAU * 1.8).powi(2));
        let (mut track, mut truth) = (Track::default(), Truth::default());
        let mut height = (Vec::new(), Vec::new());
        for k in 0..8000 {
            let t = 0.005 * f64::from(k);
            let (s, c) = (TAU * 0.9 * t).sin_cos();
            let (angle, rate, turn) = (
                roll * s,
                roll * TAU * 0.9 * c,
                -roll * (TAU * 0.9).powi(2) * s,
            );
            let (z, lift) = (
                heave * (TAU * 1.8 * t).sin(),
                -1.4 * G * (TAU * 1.8 * t).sin(),
            );
            let world_from_body = UnitQuaternion::from_euler_angles(angle, 0.0, 0.0);
            let r = world_from_body * Vector3::from(lever_m);
            let about = Vector3::x();
            let pull = about.cross(&r) * turn + about.cross(&about.cross(&r)) * (rate * rate);
            let force = world_from_body.inverse() * (pull + Vector3::z() * (lift + G));
            track.t_s.push(t);
            let turning = mount.inverse() * Vector3::new(rate, 0.0, 0.0);
            track.gyro_rad_per_s.push(turning.into());
            track.accel_m_per_s2.push((mount.inverse() * force).into());
            truth.t_s.push(t + late_s);
            truth.world_from_body.push(world_from_body * mount);
            height.0.push(t + late_s);
            height.1.push(z + r.z);
        }
        let settings = Settings {
            orientation: Options {
                latency_s: 0.0,
                accel_latency_s: 0.0,
                ..Options::default()
            },
            mounting: Mounting::Known(mount),
            lever_m,
            lever_is_known: true,
            gravity_m_per_s2: G,
            ..Settings::default()
        };
        let motion = motion(&track, &settings).unwrap();
        let judge = Judge {
            truth,
            height: Some(height),
            sensor: Some(track),
            of_body: false,
            spans_s: Vec::new(),
            step_s: Vec::new(),
        };
        let window = Window {
            start_s: 5.0,
            // Whole periods.
            end_s: 34.9975,
        };
        let estimated = interval::metrics(&motion, window);
        // As in a field log: what the recording has comes from the sensor.
        let mut metrics = estimated.clone();
        let carriers = Carriers::default();
        judge.errors(
            Some(&motion),
            &carriers,
            &estimated,
            &mut metrics,
            &Inputs::default(),
            window,
        );
        let inclination = metrics.get("inclination_error_batch_deg").unwrap();
        let said = inclination.reason.as_deref().unwrap_or_default();
        if late_s > 0.0 {
            let turned_deg = (SQRT_2 * roll * (TAU * 0.9 * 0.5 * late_s).sin()).to_degrees();
            let found = inclination.as_f64().unwrap();
            assert!((found - turned_deg).abs() < 0.1, "{found} {turned_deg}");
            assert!(
                said.starts_with("by the height the two clocks are +60.0 ± "),
                "{said}"
            );
            return;
        }
        assert!(!said.contains("clocks"), "{said}");
        let floating = (PI - 2.0 * (0.95f64 / 1.4).asin()) / TAU;
        for (name, error, truth, within) in [
            (
                "rms_roll_deg",
                "rms_roll_deg_error",
                (roll / SQRT_2).to_degrees(),
                1e-6,
            ),
            ("rms_z_m", "rms_z_m_error", heave / SQRT_2, 1e-5),
            ("dz_pp_m", "dz_pp_m_error", 2.0 * heave, 1e-3 * heave),
            ("t_float", "t_float_error", floating, 2e-3),
            ("peak_hz", "peak_hz_error", 1.8, 1e-3),
            ("growth_ratio", "growth_ratio_error", 1.0, 1e-3),
        ] {
            let (estimate, error) = (metrics.number(name).unwrap(), metrics.get(error).unwrap());
            let found = estimate - error.as_f64().unwrap();
            assert!(
                (found - truth).abs() < within,
                "{name}: {found} for {truth}"
            );
            let [low, high] = error.ci95.unwrap();
            assert!((low..=high).contains(&0.0), "{name}: {error:?}");
        }
        assert!(metrics.number("inclination_error_batch_deg").unwrap() < 0.05);
        assert!(metrics.number("inclination_error_deg").unwrap() < 1.0);
        // What is unloaded falls below a twentieth 54 times in 30 s, by the sensor as by the height.
        let unloaded = metrics.get("unloading_f1").unwrap();
        let said = unloaded.reason.as_deref().unwrap();
        assert!(
            unloaded.as_f64() == Some(1.0) && said.contains("54 of 54 true and 54 found"),
            "{said}"
        );
        assert!(metrics.number("height_relative_error").unwrap() < 0.01);
    }
}

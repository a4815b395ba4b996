//! Errors of estimates where the recording holds the truth (`--truth`).

use recording::read::Recording;

use super::{Columns, Records};
use crate::clock::from_signals;
use crate::filter::{Band, butter, sosfiltfilt};
use crate::imu::orientation::causal;
use crate::imu::rath::Motion;
use crate::imu::track::period_s;
use crate::imu::truth::{Truth, inclination_error_deg, relative_error};
use crate::imu::unloading::unloadings;
use crate::imu::{Track, vertical};
use crate::metrics::{Datum, Metrics, Value};
use crate::roles::{Role, Roles};
use crate::steps::agreement;

use super::carriers::Carriers;
use crate::inputs::{Window, interpolate};

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
    ("captured", "captured_error"),
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
        "orientation.x",
        "orientation.y",
        "orientation.z",
        "orientation.w",
    ],
];
const HEIGHT: &[&str] = &["pose.position.z", "pose.pose.position.z", "position_m.z"];

/// Whether a field may be part of a truth.
pub fn wants(field: &str) -> bool {
    HEIGHT.contains(&field) || ORIENTATION.iter().any(|o| o.contains(&field))
}

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
    /// The truth of a recording; `None` where it has none.
    pub fn read(columns: &Columns, roles: &Roles, recording: &Recording) -> Option<Self> {
        let step_s = columns.times(STEP_TOPIC);
        let topic = roles.topic(Role::Truth);
        let sensor = roles
            .topic(Role::Imu)
            .and_then(|t| Some(columns.sensor(t)?.track));
        let mut judge = Self {
            truth: Truth::default(),
            height: None,
            sensor,
            of_body: false,
            spans_s: Vec::new(),
            step_s,
        };
        if let Some(topic) = topic {
            for fields in ORIENTATION {
                if let (Some(q), Some(signal)) = (
                    columns.values(topic, *fields),
                    columns.get(topic, fields[0]),
                ) {
                    judge.truth = Truth::from_columns(&signal.times_s(columns.start_ns), q);
                }
            }
            let height = HEIGHT.iter().find_map(|f| columns.get(topic, f));
            judge.height = height.map(|s| (s.times_s(columns.start_ns), s.values.clone()));
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
    /// estimate's, moved along: it covers 0 when the estimate's covers the truth.
    pub fn errors(
        &self,
        motion: Option<&Motion>,
        carriers: &Carriers,
        estimated: &Metrics,
        metrics: &mut Metrics,
        window: Window,
    ) {
        let mut out: Vec<(&'static str, Value)> = Vec::new();
        if let (Some(motion), Some(sensor)) = (motion, &self.sensor) {
            self.orientation(motion, sensor, window, &mut out);
        }
        for (name, error) in ERRORS {
            let (Some(truth), Some(estimate)) = (metrics.get(name), estimated.get(name)) else {
                continue;
            };
            // A metric that came from the sensors itself has no truth beside it.
            if truth.source == "imu" || truth.source.is_empty() {
                continue;
            }
            out.push((*error, difference(estimate, truth)));
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
        metrics.0.extend(out);
    }

    fn orientation(
        &self,
        motion: &Motion,
        sensor: &Track,
        window: Window,
        out: &mut Vec<(&'static str, Value)>,
    ) {
        if self.truth.t_s.is_empty() {
            return;
        }
        let spans = if self.spans_s.is_empty() {
            vec![(window.start_s, window.end_s)]
        } else {
            self.spans_s.clone()
        };
        let options = motion.settings.orientation;
        let sensor_from_body = motion.body_from_sensor.inverse();
        let live: Vec<_> = causal(sensor, options)
            .earth_from_sensor
            .into_iter()
            .map(|q| {
                if self.of_body {
                    q * sensor_from_body
                } else {
                    q
                }
            })
            .collect();
        let whole: Vec<_> = motion
            .orientation
            .earth_from_sensor
            .iter()
            .map(|q| {
                if self.of_body {
                    *q
                } else {
                    q * motion.body_from_sensor
                }
            })
            .collect();
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
        let Some((t_s, z)) = &self.height else { return };
        let height_m = motion.height_m(vertical::CORNER_HZ);
        let inner = spans
            .iter()
            .fold((f64::MAX, f64::MIN), |(a, b), s| (a.min(s.0), b.max(s.1)));
        let clean: (Vec<f64>, Vec<f64>) = t_s.iter().zip(z).filter(|(_, z)| z.is_finite()).unzip();
        // How old the accelerometer's stamps are beside the truth's (the gyroscope's may be older): both heaved alike.
        let own = (&motion.inputs.t_s[..], &height_m[..]);
        let clock = from_signals(own, (&clean.0, &clean.1), 0.1).ok();
        let offset_s = clock.map_or(0.0, |c| c.offset_s);
        let error = relative_error(
            (&motion.inputs.t_s, &height_m),
            (&clean.0, &clean.1),
            vertical::VALID_BAND_HZ,
            offset_s,
            inner,
        );
        if let Some(value) = unloading_agreement(motion, &clean, offset_s, inner) {
            out.push(("unloading_f1", value));
        }
        if let Some(e) = error {
            let text = match clock {
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
    (u_s, z): &(Vec<f64>, Vec<f64>),
    clock_s: f64,
    (from_s, to_s): (f64, f64),
) -> Option<Value> {
    const WITHIN_S: f64 = 0.01;
    let t_s = &motion.inputs.t_s;
    let step_s = period_s(t_s)?;
    if period_s(u_s)? > 0.01 || t_s.len() < 3 {
        return None;
    }
    let g = motion.settings.gravity_m_per_s2;
    let shifted: Vec<f64> = t_s.iter().map(|t| t + clock_s).collect();
    let z = interpolate(u_s, z, &shifted);
    let mut lifted: Vec<f64> = z
        .windows(3)
        .map(|w| (w[0] - 2.0 * w[1] + w[2]) / (step_s * step_s))
        .collect();
    lifted.insert(0, lifted[0]);
    lifted.push(lifted[lifted.len() - 1]);
    let sections = butter(2, Band::Low(10.0), 1.0 / step_s).ok()?;
    let moments = |up: &[f64]| -> Option<Vec<f64>> {
        let ratio: Vec<f64> = sosfiltfilt(&sections, up)
            .ok()?
            .iter()
            .map(|a| 1.0 + a / g)
            .collect();
        let mut found = unloadings(t_s, &ratio);
        found.retain(|t| (from_s..=to_s).contains(t));
        Some(found)
    };
    let (found, truth) = (moments(&motion.accel_up_m_per_s2)?, moments(&lifted)?);
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
        1e3 * clock_s
    );
    Some(Value {
        unit: "1",
        reason: Some(text),
        ..Value::number(a.f1).source("imu")
    })
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
    use std::collections::BTreeMap;

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
}

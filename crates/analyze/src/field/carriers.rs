//! The carriers' own sensors: steps, gait phases on one clock, how sure they are.

use crate::clock::{Clock, from_signals};
use crate::events::Event;
use crate::examine::Quality;
use crate::filter::{Band, butter, sosfiltfilt};
use crate::imu::Track;
use crate::imu::orientation::{Options, batch};
use crate::imu::rath::Motion;
use crate::imu::track::period_s;
use crate::inputs::interpolate;
use crate::metrics::{Datum, Metrics, Value};
use crate::steps::{StepError, Steps, steps_in};
use nalgebra::{UnitQuaternion, Vector3};

use super::remark;

/// Clocks of two carriers that part by more than this are put right, s; less cannot be told from a true lag between their steps.
const CLOCK_S: f64 = 0.06;

/// One worn sensor.
struct Worn {
    topic: String,
    t_s: Vec<f64>,
    /// Vertical acceleration, or the norm of the specific force where no gyroscope tells what is vertical, m/s².
    heave: Vec<f64>,
    steps: Result<Steps, StepError>,
    /// To add to its times, once found.
    clock: Option<Clock>,
}

/// All worn sensors.
#[derive(Default)]
pub struct Carriers(Vec<Worn>);

/// Whether a metric rests on the carriers' phases.
pub fn gives(name: &str) -> bool {
    [
        "synchrony",
        "synchrony_chance",
        "plv",
        "beat_synchrony",
        "beat_hz",
    ]
    .contains(&name)
}

impl Carriers {
    /// Takes one sensor.
    pub fn add(&mut self, topic: &str, track: &Track, options: Options) {
        let turns = track.gyro_rad_per_s.iter().any(|w| *w != [0.0; 3]);
        let heave: Vec<f64> = if turns {
            let up = |(q, a): (&UnitQuaternion<f64>, &[f64; 3])| (q * Vector3::from(*a)).z;
            batch(track, options)
                .earth_from_sensor
                .iter()
                .zip(&track.accel_m_per_s2)
                .map(up)
                .collect()
        } else {
            track
                .accel_m_per_s2
                .iter()
                .map(|a| Vector3::from(*a).norm())
                .collect()
        };
        let steps = steps_in(&track.t_s, &heave);
        self.0.push(Worn {
            topic: topic.to_owned(),
            heave,
            steps,
            t_s: track.t_s.clone(),
            clock: None,
        });
    }

    /// Compares every carrier's clock with the rath's, by the heave that the carriers give it, and puts right what differs *between*
    /// carriers. What all have in common cannot be told from the lag of the load behind the shoulders: it stays.
    pub fn align(&mut self, motion: &Motion) -> Vec<Quality> {
        let seen = &motion.inputs;
        let Some(rate_hz) = period_s(&seen.t_s).map(|p| 1.0 / p) else {
            return Vec::new();
        };
        let Some(heave) = gait_band(&seen.support_ratio, rate_hz) else {
            return Vec::new();
        };
        let clocks: Vec<Option<Clock>> = self
            .0
            .iter()
            .map(|worn| {
                let own = gait_band(&worn.heave, 1.0 / period_s(&worn.t_s)?)?;
                from_signals((&worn.t_s, &own), (&seen.t_s, &heave), 0.6).ok()
            })
            .collect();
        let known: Vec<Clock> = clocks.iter().copied().flatten().collect();
        if known.len() < 2 || known.len() < self.0.len() {
            return Vec::new();
        }
        let middle = known.iter().map(|c| c.at_s).sum::<f64>() / known.len() as f64;
        let lag = |c: &Clock| c.reference_s(middle) - middle;
        let (low, high) = known
            .iter()
            .map(lag)
            .fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
        if high - low < CLOCK_S {
            return Vec::new();
        }
        let common = known.iter().map(lag).sum::<f64>() / known.len() as f64;
        let mut out = Vec::new();
        for (worn, clock) in self.0.iter_mut().zip(known) {
            let own = Clock {
                offset_s: clock.offset_s - common,
                ..clock
            };
            out.push(remark(
                &worn.topic,
                "clock_offset",
                format!(
                    "runs {:+.0} ± {:.0} ms and {:+.0} ppm off the carriers' common clock; put right before comparing phases",
                    -1e3 * (own.reference_s(middle) - middle),
                    1.96e3 * own.offset_sd_s,
                    -own.drift_ppm,
                ),
            ));
            worn.clock = Some(own);
        }
        out
    }

    /// Phases on one time axis, rad, for those who walk; `None` for fewer than two.
    pub fn phases(&self) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
        let walking: Vec<(&Worn, &Steps)> = self
            .0
            .iter()
            .filter_map(|w| Some((w, w.steps.as_ref().ok()?)))
            .collect();
        if walking.len() < 2 {
            return None;
        }
        let times: Vec<Vec<f64>> = walking
            .iter()
            .map(|(worn, s)| {
                s.t_s
                    .iter()
                    .map(|t| worn.clock.map_or(*t, |c| c.reference_s(*t)))
                    .collect()
            })
            .collect();
        let start = times.iter().map(|t| t[0]).fold(f64::MIN, f64::max);
        let end = times
            .iter()
            .map(|t| t[t.len() - 1])
            .fold(f64::MAX, f64::min);
        let step = period_s(&walking[0].1.t_s)?;
        if end - start < 1.0 {
            return None;
        }
        let axis: Vec<f64> = (0..=((end - start) / step) as usize)
            .map(|k| start + k as f64 * step)
            .collect();
        let phases = walking
            .iter()
            .zip(&times)
            .map(|((_, s), t)| interpolate(t, &s.phase_rad, &axis))
            .collect();
        Some((axis, phases))
    }

    /// 95 % interval of the synchrony: the phases' own error, as twins show it.
    pub fn interval(metrics: &mut Metrics) {
        for (name, value) in &mut metrics.0 {
            if let ("synchrony", Datum::Number(x)) = (*name, &value.datum) {
                value.ci95 = Some([(x - PHASE_ERROR).max(0.0), (x + PHASE_ERROR).min(1.0)]);
            }
        }
    }

    /// Steps per second: mean over carriers, `per` carrier.
    pub fn step_rate(&self) -> Option<Value> {
        let walking: Vec<&Steps> = self
            .0
            .iter()
            .filter_map(|w| w.steps.as_ref().ok())
            .collect();
        if walking.is_empty() {
            return None;
        }
        let n = walking.len() as f64;
        let mean = walking.iter().map(|s| s.cadence_hz).sum::<f64>() / n;
        let half = walking
            .iter()
            .map(|s| s.cadence_ci95_hz.powi(2))
            .sum::<f64>()
            .sqrt()
            / n;
        let value = Value::number(mean)
            .per(walking.iter().map(|s| s.cadence_hz).collect())
            .source("imu")
            .ci95(mean - half, mean + half);
        Some(Value {
            unit: "Hz",
            ..value
        })
    }

    /// Steps of the first who walks, s.
    pub fn first_steps(&self) -> Option<&[f64]> {
        self.0
            .iter()
            .find_map(|w| w.steps.as_ref().ok())
            .map(|s| &s.step_s[..])
    }

    /// Every step.
    pub fn events(&self) -> Vec<Event> {
        let of = |worn: &Worn| -> Vec<Event> {
            let Ok(found) = &worn.steps else {
                return Vec::new();
            };
            found
                .step_s
                .iter()
                .map(|t| Event {
                    t_s: *t,
                    kind: "step",
                    what: worn.topic.clone(),
                })
                .collect()
        };
        self.0.iter().flat_map(of).collect()
    }

    /// Who does not walk, and why.
    pub fn quality(&self) -> Vec<Quality> {
        let silent = |w: &Worn| {
            Some(remark(
                &w.topic,
                "no_steps",
                w.steps.as_ref().err()?.to_string(),
            ))
        };
        self.0.iter().filter_map(silent).collect()
    }
}

/// Half the 95 % interval of a synchrony from gait phases, 1: by simulated twins (docs/field.md).
const PHASE_ERROR: f64 = 0.012;

/// 1 to 5 Hz, zero phase; `None` where the sensor is too slow or the record too short.
fn gait_band(x: &[f64], rate_hz: f64) -> Option<Vec<f64>> {
    let sections = butter(2, Band::Pass(1.0, 5.0), rate_hz).ok()?;
    sosfiltfilt(&sections, x).ok()
}

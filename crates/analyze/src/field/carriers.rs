//! The carriers' own sensors: steps, gait phases on one clock, how sure they are.

use crate::events::Event;
use crate::filter::{Band, butter, sosfiltfilt};
use crate::imu::Track;
use crate::imu::orientation::{Options, batch};
use crate::imu::rath::{ENDS, Motion};
use crate::imu::track::{BRIDGED_S, period_s};
use crate::imu::vertical::height;
use crate::inputs::{Window, interpolate, mean_step_s, stretches};
use crate::metrics::{Datum, Metrics};
use crate::phase::hilbert;
use crate::quality::Quality;
use crate::spectrum::Complex64;
use crate::steps::{StepError, Steps, steps_in};
use nalgebra::{UnitQuaternion, Vector3};

/// How far clocks have to part to be put right, and half the 95 % interval of what is found (s), by twins: with the tilt of a pole that two
/// carry, and with the heave alone. Less cannot be told from a true lag between steps.
const TWO_S: (f64, f64) = (0.03, 0.02);
const MANY_S: (f64, f64) = (0.04, 0.03);
/// J below which the heaves are not taken for the rath's: on twins it is 0.98 and more.
const MATCH: f64 = 0.8;
/// Clocks are moved where that leaves at most this share of what is unexplained with the clocks as they are: of many carriers one tells little.
const BETTER: f64 = 0.5;
/// Rate at which heaves are compared, Hz.
const ALIGN_HZ: f64 = 100.0;
/// Each carrier's offset is looked for at most so often; two carriers need one round.
const ROUNDS: usize = 6;

/// One worn sensor.
struct Worn {
    topic: String,
    t_s: Vec<f64>,
    /// Vertical acceleration, or the norm of the specific force where no gyroscope tells what is vertical, m/s².
    heave: Vec<f64>,
    /// Whether it is the former.
    upright: bool,
    steps: Result<Steps, StepError>,
    /// What its clock is ahead of the carriers' common clock, once found, s.
    ahead_s: f64,
}

/// One who walks, as the clocks are compared.
struct Rider {
    number: usize,
    z: Vec<Complex64>,
    /// Half a step, samples.
    reach: i64,
}

impl Rider {
    /// z(t + o) at sample `i` for o of `shift` samples.
    fn at(&self, i: usize, shift: i64) -> Complex64 {
        self.z[(i as i64 + shift) as usize]
    }
}

/// J: how much of `x` is one complex number times the shifted, signed sum of the riders; at most a hair below 1.
fn alike(
    x: &[Complex64],
    riders: &[Rider],
    signs: &[f64],
    shift: &[i64],
    inner: &std::ops::Range<usize>,
) -> f64 {
    let (mut xs, mut ss, mut xx) = (Complex64::default(), 0.0, 0.0);
    for i in inner.clone() {
        let sum: Complex64 = riders
            .iter()
            .zip(signs)
            .zip(shift)
            .map(|((r, sign), s)| r.at(i, *s) * *sign)
            .sum();
        xs += x[i].conj() * sum;
        ss += sum.norm_sqr();
        xx += x[i].norm_sqr();
    }
    (xs.norm_sqr() / (ss * xx).max(f64::MIN_POSITIVE)).min(1.0 - 1e-12)
}

/// All worn sensors.
#[derive(Default)]
pub struct Carriers {
    worn: Vec<Worn>,
    /// Whether their clocks could not be held against each other.
    apart: bool,
}

/// Whether a metric rests on the carriers' phases.
pub fn gives(name: &str) -> bool {
    [
        "synchrony",
        "synchrony_chance",
        "plv",
        "beat_synchrony",
        "beat_hz",
        "beat_lead_deg",
        "detuning_rad_per_s",
        "pull_rad_per_s",
        "captured",
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
        self.worn.push(Worn {
            topic: topic.to_owned(),
            heave,
            upright: turns,
            steps,
            t_s: track.t_s.clone(),
            ahead_s: 0.0,
        });
    }

    /// Puts the carriers on one clock: the offsets under which their heaves, added up, are the rath's heave, and, where two carry a pole, their
    /// difference its tilt.
    ///
    /// ```text
    /// H(t) ≈ γ Σ_j z_j(t + o_j),    P(t) ≈ κ (z_1(t + o_1) − z_2(t + o_2))
    /// J_X = |⟨X, S⟩|² / (⟨X, X⟩⟨S, S⟩),    o = argmax Σ_X −ln(1 − J_X)
    /// ```
    /// H, P, z_j analytic signals of the rath's heave and tilt and of carrier j's heave, 1 to 5 Hz; S the sum or difference on the right; γ, κ one
    /// complex number each: gain and lag of the load behind the shoulders, the same for all; o_j what carrier j's clock is ahead (s). It shows
    /// where carriers fall in and out of step: the heave grows and fades, the tilt fades and grows. What all clocks have in common goes
    /// into γ and κ and stays; so does a whole number of steps, which changes no phase: each o_j lies within half a step.
    pub fn align(&mut self, motion: &Motion) -> Vec<Quality> {
        let Some((told, offsets_s, least_s, error_s)) = self.offsets(motion) else {
            return Vec::new();
        };
        if told < -(1.0 - MATCH).ln() {
            self.apart = true;
            let topics: Vec<&str> = self.worn.iter().map(|w| &w.topic[..]).collect();
            return vec![Quality::remark(
                "",
                "clocks_apart",
                format!(
                    "the clocks of {} could not be held against each other: their heaves, put together within half a step, are not the load's; a synchrony of theirs has no interval, tap the sensors together or say --one-clock",
                    topics.join(", ")
                ),
            )];
        }
        let (low, high) = offsets_s
            .iter()
            .flatten()
            .fold((f64::MAX, f64::MIN), |(a, b), o| (a.min(*o), b.max(*o)));
        if high - low < least_s {
            return Vec::new();
        }
        let mut out = Vec::new();
        for (worn, offset_s) in self.worn.iter_mut().zip(offsets_s) {
            let Some(offset_s) = offset_s else { continue };
            worn.ahead_s = offset_s;
            out.push(Quality::remark(
                &worn.topic,
                "clock_offset",
                format!(
                    "runs {:+.0} ± {:.0} ms off the carriers' common clock, or whole steps more; put right before comparing phases",
                    1e3 * offset_s,
                    1e3 * error_s
                ),
            ));
        }
        out
    }

    /// o_j of everyone who walks, with mean zero; how far they have to part to be believed; half their 95 % interval (s). `None` for fewer
    /// than two, or where the clocks do as they are. First how well the load moves as the carriers do, −ln(1 − J).
    fn offsets(&self, motion: &Motion) -> Option<(f64, Vec<Option<f64>>, f64, f64)> {
        let seen = &motion.inputs;
        let walks = |w: &&Worn| w.steps.is_ok();
        let ends = |t: &[f64]| Some((*t.first()?, *t.last()?));
        let (mut start, mut end) = ends(&seen.t_s)?;
        for worn in self.worn.iter().filter(walks) {
            let (a, b) = ends(&worn.t_s)?;
            (start, end) = (start.max(a), end.min(b));
        }
        if self.worn.iter().filter(walks).count() < 2 || end - start < 10.0 {
            return None;
        }
        let n = ((end - start) * ALIGN_HZ) as usize;
        let grid: Vec<f64> = (0..n).map(|k| start + k as f64 / ALIGN_HZ).collect();
        let analytic = |t_s: &[f64], x: &[f64]| -> Option<Vec<Complex64>> {
            let band = gait_band(x, 1.0 / period_s(t_s)?)?;
            Some(hilbert(&interpolate(t_s, &band, &grid)))
        };
        let mut riders = Vec::new();
        for (k, worn) in self.worn.iter().enumerate() {
            if let Ok(steps) = &worn.steps {
                riders.push(Rider {
                    number: k,
                    z: analytic(&worn.t_s, &worn.heave)?,
                    reach: (0.5 * ALIGN_HZ / steps.cadence_hz) as i64,
                });
            }
        }
        let mut felt = vec![(
            analytic(&seen.t_s, &seen.support_ratio)?,
            vec![1.0; riders.len()],
        )];
        let two = riders.len() == 2;
        if two {
            felt.push((analytic(&seen.t_s, &seen.pitch_rad)?, vec![1.0, -1.0]));
        }
        let most = riders.iter().map(|r| r.reach).max()?;
        // Shifted by up to half a step either way nothing may leave the record.
        let margin = most as usize + 2;
        let inner = margin..n.checked_sub(margin)?;
        let mut shift = vec![0i64; riders.len()];
        let mut found = vec![0.0; riders.len()];
        let told = |shift: &[i64]| -> f64 {
            felt.iter()
                .map(|(x, signs)| -(1.0 - alike(x, &riders, signs, shift, &inner)).ln())
                .sum()
        };
        let as_they_are = told(&shift);
        let mut best = 0.0;
        for _ in 0..ROUNDS {
            let before = shift.clone();
            // The first stays: what all have in common cannot be told.
            for j in 1..riders.len() {
                let score = |s: i64| {
                    let mut shift = shift.clone();
                    shift[j] = s;
                    told(&shift)
                };
                let reach = riders[j].reach;
                let (s, top) = (-reach..=reach)
                    .map(|s| (s, score(s)))
                    .max_by(|a, b| a.1.total_cmp(&b.1))?;
                let (l, r) = (score(s - 1), score(s + 1));
                let bend = l - 2.0 * top + r;
                let between = if bend < 0.0 {
                    0.5 * (l - r) / bend
                } else {
                    0.0
                };
                (shift[j], best) = (s, top);
                found[j] = (s as f64 + between.clamp(-0.5, 0.5)) / ALIGN_HZ;
            }
            if two || shift == before {
                break;
            }
        }
        if best >= -(1.0 - MATCH).ln() && best - as_they_are < -BETTER.ln() {
            return None;
        }
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        let mut out = vec![None; self.worn.len()];
        for (rider, o) in riders.iter().zip(found) {
            out[rider.number] = Some(o - mean);
        }
        let (least_s, error_s) = if two { TWO_S } else { MANY_S };
        Some((best, out, least_s, error_s))
    }

    /// Phases on one time axis, rad, for those who walk; `None` for fewer than two.
    pub fn phases(&self) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
        let walking: Vec<(&Worn, &Steps)> = self
            .worn
            .iter()
            .filter_map(|w| Some((w, w.steps.as_ref().ok()?)))
            .collect();
        if walking.len() < 2 {
            return None;
        }
        let times: Vec<Vec<f64>> = walking
            .iter()
            .map(|(worn, s)| s.t_s.iter().map(|t| t - worn.ahead_s).collect())
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

    /// Vertical motion of each sensor about its slow course at the times `at_s`, m, NaN where it is not known; nothing at all where one of
    /// them cannot tell what is vertical, or does not walk.
    pub fn heave_m(&self, at_s: &[f64], corner_hz: f64) -> Vec<Vec<f64>> {
        let of = |worn: &Worn| {
            (worn.upright && worn.steps.is_ok()).then_some(())?;
            let period_s = mean_step_s(&worn.t_s)?;
            let mut out = vec![f64::NAN; at_s.len()];
            for stretch in stretches(&worn.t_s, BRIDGED_S) {
                let (t_s, heave) = (&worn.t_s[stretch.clone()], &worn.heave[stretch]);
                let first = t_s[0];
                let n = ((t_s[t_s.len() - 1] - first) / period_s).round() as usize + 1;
                let grid: Vec<f64> = (0..n).map(|k| first + k as f64 * period_s).collect();
                let mut accel = interpolate(t_s, heave, &grid);
                let mean = accel.iter().sum::<f64>() / n as f64;
                accel.iter_mut().for_each(|a| *a -= mean);
                let heave = height(&accel, period_s, corner_hz);
                let common = |t: f64| t - worn.ahead_s;
                let grid: Vec<f64> = grid.into_iter().map(common).collect();
                let ends = ENDS / corner_hz;
                let known = Window {
                    start_s: grid[0] + ends,
                    end_s: grid[n - 1] - ends,
                };
                let here = known.range(at_s);
                let seen = interpolate(&grid, &heave, &at_s[here.clone()]);
                out[here].copy_from_slice(&seen);
            }
            Some(out)
        };
        self.worn
            .iter()
            .map(of)
            .collect::<Option<_>>()
            .unwrap_or_default()
    }

    /// 95 % interval of the synchrony: the phases' own error, and that of clocks that were put on each other by motion, as twins show them.
    pub fn interval(&self, metrics: &mut Metrics) {
        let moved = self.worn.iter().any(|worn| worn.ahead_s != 0.0);
        let half = if moved {
            PHASE_ERROR.hypot(MOVED_ERROR)
        } else {
            PHASE_ERROR
        };
        for (name, value) in &mut metrics.0 {
            if let ("synchrony", Datum::Number(x)) = (*name, &value.datum) {
                if self.apart {
                    value.reason =
                        Some("if the carriers' clocks agree, which nothing tells".into());
                    continue;
                }
                value.ci95 = Some([(x - half).max(0.0), (x + half).min(1.0)]);
            }
        }
    }

    /// Steps of each who walks, on the carriers' common clock, s.
    pub fn step_s(&self) -> Vec<Vec<f64>> {
        let walking = self
            .worn
            .iter()
            .filter_map(|w| Some((w, w.steps.as_ref().ok()?)));
        walking
            .map(|(worn, found)| found.step_s.iter().map(|t| t - worn.ahead_s).collect())
            .collect()
    }

    /// Steps of the first who walks, s.
    pub fn first_steps(&self) -> Option<&[f64]> {
        self.worn
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
                    t_s: *t - worn.ahead_s,
                    kind: "step",
                    what: worn.topic.clone(),
                })
                .collect()
        };
        self.worn.iter().flat_map(of).collect()
    }

    /// Who does not walk, and why.
    pub fn quality(&self) -> Vec<Quality> {
        let silent = |w: &Worn| {
            Some(Quality::remark(
                &w.topic,
                "no_steps",
                w.steps.as_ref().err()?.to_string(),
            ))
        };
        self.worn.iter().filter_map(silent).collect()
    }
}

/// Half the 95 % interval of a synchrony from gait phases, 1: by simulated twins (docs/field.md).
const PHASE_ERROR: f64 = 0.0020;
/// What is added to it where clocks were put right by motion: 20 ms of a clock are 0.13 of half a relative phase at 2 Hz, and cos 0.13 = 0.99; twins
/// show a third more.
const MOVED_ERROR: f64 = 0.013;

/// 1 to 5 Hz, zero phase; `None` where the sensor is too slow or the record too short.
fn gait_band(x: &[f64], rate_hz: f64) -> Option<Vec<f64>> {
    let sections = butter(2, Band::Pass(1.0, 5.0), rate_hz).ok()?;
    sosfiltfilt(&sections, x).ok()
}

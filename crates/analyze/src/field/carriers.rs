//! The carriers' own sensors: steps, gait phases on one clock, how sure they are.

use crate::events::Event;
use crate::filter::{Band, butter, sosfiltfilt};
use crate::imu::Track;
use crate::imu::orientation::{Options, batch};
use crate::imu::rath::{ENDS, Motion};
use crate::imu::track::{BRIDGED_S, period_s};
use crate::imu::vertical::height;
use crate::inputs::{Window, interpolate, mean_step_s, stretches};
use crate::metrics::{Datum, Metrics, Value};
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
/// How far the clocks of two are looked for either way, s, or so much of what they share.
const REACH_S: (f64, f64) = (5.0, 1.0 / 6.0);
/// Samples of a first look, and how far its maxima are looked about, both in samples of the grid.
const COARSE: usize = 5;
const ABOUT: i64 = 6;
/// Offsets under which Σ −ln(1 − J) falls short of its maximum by no more than this are as good; at most so many are looked at.
const AS_GOOD: (f64, usize) = (1.0, 12);
/// A synchrony that such offsets change by more than this is not known.
const VAGUE: f64 = 0.1;

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
    /// What else it may be ahead, as far as the motion tells, s; of all sensors the same number.
    or_ahead_s: Vec<f64>,
}

/// What is known of the clocks.
struct Found {
    /// Whether the load moves as the carriers do.
    matches: bool,
    /// o_j of everyone who walks, s.
    offsets_s: Vec<Option<f64>>,
    /// Others that are as good, s.
    or_s: Vec<Vec<Option<f64>>>,
    /// How far they have to part to be believed, s.
    least_s: f64,
    /// Half their 95 % interval, s.
    error_s: f64,
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

/// Σ_X −ln(1 − J_X) of two riders for all shifts on a coarse grid: maxima, best first, and the best with both shifted alike by a lag.
struct Look {
    maxima: Vec<(f64, [i64; 2])>,
    alike: f64,
}

impl Look {
    /// `felt`: what is felt and the sign of the second rider; shifts of up to `reach` samples, inside of which nothing leaves the record;
    /// a lag of the load is at most `lag` samples.
    fn new(felt: &[(Vec<Complex64>, f64)], z: [&[Complex64]; 2], reach: usize, lag: usize) -> Self {
        let n = z[0].len();
        let inner = reach..n - reach;
        let count = 2 * reach + 1;
        let dot = |x: &[Complex64], z: &[Complex64], s: usize| -> Complex64 {
            let pairs = x[inner.clone()].iter().zip(&z[s..]);
            pairs.map(|(x, z)| x.conj() * z).sum()
        };
        let power = |z: &[Complex64], s: usize| -> f64 {
            z[s..s + inner.len()].iter().map(Complex64::norm_sqr).sum()
        };
        let powers = z.map(|z| (0..count).map(|s| power(z, s)).collect::<Vec<f64>>());
        // Σ z₁(t + a) z₂*(t + b) depends on b − a but for its ends: running sums for each difference.
        let mut cross = vec![0.0; count * count];
        let mut sums = vec![0.0; n + 1];
        for apart in -(2 * reach as i64)..=2 * reach as i64 {
            for u in 0..n {
                let other = z[1].get((u as i64 + apart) as usize);
                sums[u + 1] = sums[u] + other.map_or(0.0, |other| (z[0][u] * other.conj()).re);
            }
            for a in 0..count {
                let b = a as i64 + apart;
                if (0..count as i64).contains(&b) {
                    cross[a * count + b as usize] = sums[a + inner.len()] - sums[a];
                }
            }
        }
        let mut told = vec![0.0; count * count];
        for (x, sign) in felt {
            let with = z.map(|z| (0..count).map(|s| dot(x, z, s)).collect::<Vec<_>>());
            let all: f64 = x[inner.clone()].iter().map(Complex64::norm_sqr).sum();
            for (k, told) in told.iter_mut().enumerate() {
                let (a, b) = (k / count, k % count);
                let sum = powers[0][a] + powers[1][b] + 2.0 * sign * cross[k];
                let same = (with[0][a] + with[1][b] * *sign).norm_sqr();
                let share = same / (sum * all).max(f64::MIN_POSITIVE);
                *told -= (1.0 - share.min(1.0 - 1e-12)).ln();
            }
        }
        let top = |a: usize, b: usize| {
            let about = (a - 1..=a + 1).flat_map(|i| (b - 1..=b + 1).map(move |j| (i, j)));
            about.fold(f64::MIN, |most, (i, j)| most.max(told[i * count + j]))
        };
        let mut maxima = Vec::new();
        for a in 1..count - 1 {
            for b in 1..count - 1 {
                let here = told[a * count + b];
                if here >= top(a, b) {
                    maxima.push((here, [a, b].map(|s| s as i64 - reach as i64)));
                }
            }
        }
        maxima.sort_by(|a, b| b.0.total_cmp(&a.0));
        let lags = reach.saturating_sub(lag)..=(reach + lag).min(count - 1);
        let alike = lags.map(|a| told[a * count + a]);
        Self {
            alike: alike.fold(f64::MIN, f64::max),
            maxima,
        }
    }
}

/// Times (s) and the phases there (rad), one column for each who walks.
pub type Phases = (Vec<f64>, Vec<Vec<f64>>);

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
            or_ahead_s: Vec::new(),
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
    /// into γ and κ and stays. Two are looked for within [`REACH_S`] of the rath's clock, more within half a step of each other: a whole number of
    /// steps changes the phases of those whose pace does. Offsets of two that are as good are kept for the interval of the synchrony.
    pub fn align(&mut self, motion: &Motion) -> Vec<Quality> {
        let Some(Found {
            matches,
            offsets_s,
            or_s,
            least_s,
            error_s,
        }) = self.offsets(motion)
        else {
            return Vec::new();
        };
        if !matches {
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
        for (k, (worn, offset_s)) in self.worn.iter_mut().zip(offsets_s).enumerate() {
            let Some(offset_s) = offset_s else { continue };
            worn.ahead_s = offset_s;
            worn.or_ahead_s = or_s.iter().filter_map(|or| or[k]).collect();
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

    /// `None` for fewer than two, or where the clocks do as they are.
    fn offsets(&self, motion: &Motion) -> Option<Found> {
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
        let reach = match two {
            true => (REACH_S.0.min(REACH_S.1 * (end - start)) * ALIGN_HZ) as i64,
            false => riders.iter().map(|r| r.reach).max()?,
        };
        // Shifted either way nothing may leave the record.
        let margin = (reach + ABOUT) as usize + 2;
        let inner = margin..n.checked_sub(margin)?;
        let told = |shift: &[i64]| -> f64 {
            felt.iter()
                .map(|(x, signs)| -(1.0 - alike(x, &riders, signs, shift, &inner)).ln())
                .sum()
        };
        // The best shift of rider j within a range, between samples too (s), and what it tells.
        let along = |shift: &mut [i64], j: usize, range: std::ops::RangeInclusive<i64>| {
            let mut score = |s: i64| {
                shift[j] = s;
                told(shift)
            };
            let (s, top) = range
                .map(|s| (s, score(s)))
                .max_by(|a, b| a.1.total_cmp(&b.1))?;
            let (l, r) = (score(s - 1), score(s + 1));
            shift[j] = s;
            let bend = l - 2.0 * top + r;
            let between = if bend < 0.0 {
                (0.5 * (l - r) / bend).clamp(-0.5, 0.5)
            } else {
                0.0
            };
            Some(((s as f64 + between) / ALIGN_HZ, top))
        };
        let mut all: Vec<(f64, Vec<f64>)> = Vec::new();
        let as_they_are;
        if two {
            let coarse = |x: &[Complex64]| x.iter().step_by(COARSE).copied().collect::<Vec<_>>();
            let [a, b] = [0, 1].map(|j| coarse(&riders[j].z));
            let felt: Vec<_> = felt.iter().map(|(x, s)| (coarse(x), s[1])).collect();
            let look = Look::new(
                &felt,
                [&a, &b],
                reach as usize / COARSE,
                riders[0].reach as usize / COARSE,
            );
            let best = look.maxima.first()?.0;
            for (_, at) in look
                .maxima
                .iter()
                .take_while(|(told, _)| best - told < AS_GOOD.0)
                .take(AS_GOOD.1)
            {
                let mut shift = at.map(|s| s * COARSE as i64);
                let (mut found, mut top) = (vec![0.0; 2], 0.0);
                for _ in 0..2 {
                    for j in 0..2 {
                        let about = (shift[j] - ABOUT).max(-reach)..=(shift[j] + ABOUT).min(reach);
                        (found[j], top) = along(&mut shift, j, about)?;
                    }
                }
                all.push((top, found));
            }
            all.sort_by(|a, b| b.0.total_cmp(&a.0));
            // On the same grid as the best of it.
            as_they_are = all[0].0 - (best - look.alike);
        } else {
            let mut shift = vec![0i64; riders.len()];
            let mut found = vec![0.0; riders.len()];
            as_they_are = told(&shift);
            let mut best = 0.0;
            for _ in 0..ROUNDS {
                let before = shift.clone();
                // The first stays: what all have in common cannot be told.
                for j in 1..riders.len() {
                    let reach = riders[j].reach;
                    (found[j], best) = along(&mut shift, j, -reach..=reach)?;
                }
                if shift == before {
                    break;
                }
            }
            all.push((best, found));
        }
        let best = all[0].0;
        let matches = best >= felt.len() as f64 * -(1.0 - MATCH).ln();
        if matches && best - as_they_are < -BETTER.ln() {
            return None;
        }
        let step_s = 2.0 * riders[0].reach as f64 / ALIGN_HZ;
        let placed = |found: Vec<f64>| {
            // The load's lag is less than half a step and no clock's.
            let mean = found.iter().sum::<f64>() / found.len() as f64;
            let lag = mean - (mean / step_s).round() * step_s;
            let mut out = vec![None; self.worn.len()];
            for (rider, o) in riders.iter().zip(found) {
                out[rider.number] = Some(o - lag);
            }
            out
        };
        let (least_s, error_s) = if two { TWO_S } else { MANY_S };
        let mut all = all.into_iter().map(|(_, found)| placed(found));
        Some(Found {
            matches,
            offsets_s: all.next()?,
            or_s: all.collect(),
            least_s,
            error_s,
        })
    }

    /// Phases on one time axis, rad, for those who walk; `None` for fewer than two.
    pub fn phases(&self) -> Option<Phases> {
        self.phases_as(|steps| steps.phase_rad.clone(), |worn| worn.ahead_s)
    }

    /// As the detector's band lets them through, with nothing put back.
    pub fn detected(&self) -> Option<Phases> {
        let detected = |steps: &Steps| {
            let parts = steps.phase_rad.iter().zip(&steps.restored_rad);
            parts.map(|(p, put_back)| p - put_back).collect()
        };
        self.phases_as(detected, |worn| worn.ahead_s)
    }

    /// With each of the other offsets of the clocks that go with the motion.
    pub fn phases_else(&self) -> impl Iterator<Item = Phases> + '_ {
        let count = self.worn.iter().map(|w| w.or_ahead_s.len()).max();
        (0..count.unwrap_or(0)).filter_map(|k| {
            let ahead = |worn: &Worn| worn.or_ahead_s.get(k).copied().unwrap_or(worn.ahead_s);
            self.phases_as(|steps| steps.phase_rad.clone(), ahead)
        })
    }

    fn phases_as(
        &self,
        phase: impl Fn(&Steps) -> Vec<f64>,
        ahead_s: impl Fn(&Worn) -> f64,
    ) -> Option<Phases> {
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
            .map(|(worn, s)| s.t_s.iter().map(|t| t - ahead_s(worn)).collect())
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
            .map(|((_, s), t)| interpolate(t, &phase(s), &axis))
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

    /// 95 % intervals of the synchrony and the pull: the phases' own error, what had to be put back into them (`detected`: the same metrics
    /// without), and, of the synchrony, the clocks that were put on each other by motion, as twins show them, or otherwise (`synchrony_else`).
    pub fn interval(&self, metrics: &mut Metrics, detected: &Metrics, synchrony_else: &[f64]) {
        let moved = self.worn.iter().any(|worn| worn.ahead_s != 0.0);
        let clocks = if moved { MOVED_ERROR } else { 0.0 };
        let put_back = |name: &str, x: f64| x - detected.number(name).unwrap_or(x);
        let ends = metrics.number("synchrony").map(|x| {
            let all = synchrony_else.iter().copied().filter(|x| x.is_finite());
            let (low, high) = all.fold((x, x), |(a, b), x| (a.min(x), b.max(x)));
            let half = PHASE_ERROR.hypot(clocks).hypot(put_back("synchrony", x));
            [(low - half).max(0.0), (high + half).min(1.0), high - low]
        });
        for (name, value) in &mut metrics.0 {
            let Datum::Number(x) = value.datum else {
                continue;
            };
            match (*name, ends) {
                ("synchrony", _) if self.apart => {
                    value.reason =
                        Some("if the carriers' clocks agree, which nothing tells".into());
                }
                ("synchrony" | "plv", Some([low, high, apart])) if apart > VAGUE => {
                    *value = Value {
                        unit: value.unit,
                        ..Value::missing(format!(
                            "several offsets of the carriers' clocks go with the load's motion, and with them a synchrony from {low:.2} to {high:.2}: tap the sensors together"
                        ))
                        .source(value.source.clone())
                    };
                }
                ("beat_lead_deg", _) if moved => {
                    *value = Value {
                        unit: value.unit,
                        ..Value::missing(
                            "the carriers' clocks were put on each other by motion, which does not tell their own lag from the load's: tap the sensors together",
                        )
                        .source(value.source.clone())
                    };
                }
                ("synchrony", Some([low, high, _])) => value.ci95 = Some([low, high]),
                ("pull_rad_per_s", _) => {
                    if let Some([low, high]) = &mut value.ci95 {
                        let lost = put_back(name, x).hypot(PULL_ERROR * x);
                        *low = (x - (x - *low).hypot(lost)).max(0.0);
                        *high = x + (*high - x).hypot(lost);
                    }
                }
                _ => {}
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
/// What a detector leaves in a pull of carriers who slip past the beat, half the 95 % interval, of the pull: by twins.
const PULL_ERROR: f64 = 0.0075;
/// What is added to the synchrony's where clocks were put right by motion: 20 ms of a clock are 0.13 of half a relative phase at 2 Hz, and cos 0.13 = 0.99; twins
/// show a third more.
const MOVED_ERROR: f64 = 0.013;

/// 1 to 5 Hz, zero phase; `None` where the sensor is too slow or the record too short.
fn gait_band(x: &[f64], rate_hz: f64) -> Option<Vec<f64>> {
    let sections = butter(2, Band::Pass(1.0, 5.0), rate_hz).ok()?;
    sosfiltfilt(&sections, x).ok()
}

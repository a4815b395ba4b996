//! The carriers' own sensors: steps, gait phases on one clock, how sure they are.

use super::align::{ALIGN_HZ, Match, Matches};
use crate::events::Event;
use crate::filter::{Band, butter, sosfiltfilt};
use crate::imu::Track;
use crate::imu::orientation::{Options, batch};
use crate::imu::rath::{ENDS, Motion};
use crate::imu::track::{BRIDGED_S, period_s};
use crate::imu::vertical::height;
use crate::inputs::{Clocks, Window, interpolate, mean_step_s, stretches};
use crate::median::median;
use crate::metrics::{Datum, Metrics, Need, Value, find};
use crate::phase::{hilbert, order_parameter};
use crate::quality::Quality;
use crate::spectrum::Complex64;
use crate::steps::{self, StepError, Steps, steps_in, walked_s};
use nalgebra::{UnitQuaternion, Vector3};

/// How far clocks have to part to be put right, s: less cannot be told from a true lag between steps.
const LEAST_OFFSET_S: f64 = 0.03;
/// Half the 95 % interval of what is found, s, by twins.
const OFFSET_ERROR_S: f64 = 0.02;
/// J below which the heaves are not taken for the rath's: on twins it is 0.96 and more, and mostly 0.85 to 0.94 where clocks part by more than is looked for.
const MATCH: f64 = 0.95;
/// Clocks are moved where that leaves at most this share of what is unexplained with the clocks as they are.
const BETTER: f64 = 0.5;
/// How far the clocks of two are looked for either way, s, or so much of what they share.
const REACH_S: (f64, f64) = (5.0, 1.0 / 6.0);
/// Over so long nobody who walks gains or loses much speed, s, and of gravity at least this share is felt.
const FELT_OVER_S: f64 = 2.0;
const LEAST_GRAVITY: f64 = 0.5;
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
    /// Standard error of its clock, where taps have set it, s.
    clock_sd_s: f64,
    /// Whether it tells too little of the window to be one of those who are compared.
    left_out: bool,
}

/// Times (s) and the phases there (rad), one column for each who walks.
pub type Phases = (Vec<f64>, Vec<Vec<f64>>);

/// All worn sensors.
#[derive(Default)]
pub struct Carriers {
    worn: Vec<Worn>,
    /// Whether their clocks could not be held against each other.
    apart: bool,
    /// How their clocks stand to each other, where that is known.
    pub clocks: Clocks,
}

/// Whether a metric rests on the carriers' phases or the beat, and on nothing of the load.
pub fn gives(name: &str) -> bool {
    let of = |need: &Need| matches!(need, Need::Phases | Need::Beat);
    find(name).is_some_and(|m| m.needs.iter().any(of) && !m.needs.contains(&Need::Roll))
}

/// Whether a metric is one of all carriers together: some of them do not tell it.
pub fn of_all(name: &str) -> bool {
    gives(name) && name != "beat_hz" && name != "pull_rad_per_s"
}

impl Carriers {
    /// Takes one sensor, and the standard error of its clock where taps have set that (s). Where gravity was taken out of its accelerations there are no
    /// steps.
    pub fn add(
        &mut self,
        topic: &str,
        track: &Track,
        options: Options,
        gravity_m_per_s2: f64,
        clock_sd_s: f64,
    ) {
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
        let found_m_per_s2 = mean_force(track);
        let steps = match found_m_per_s2 < LEAST_GRAVITY * gravity_m_per_s2 {
            true => Err(StepError::NoGravity { found_m_per_s2 }),
            false => steps_in(&track.t_s, &heave),
        };
        self.worn.push(Worn {
            topic: topic.to_owned(),
            heave,
            upright: turns,
            steps,
            t_s: track.t_s.clone(),
            ahead_s: 0.0,
            or_ahead_s: Vec::new(),
            clock_sd_s,
            left_out: false,
        });
    }

    /// Leaves those out of the phases whose sensors are on for less than half of `window` where others are on for more: their absence would leave little of
    /// it that all are known in.
    pub fn leave_out(&mut self, window: Window) -> Vec<Quality> {
        let share = |worn: &Worn| {
            let phases = worn.steps.as_ref().ok()?;
            let (first_s, last_s) = (phases.t_s.first()?, phases.t_s.last()?);
            let on_s = last_s.min(window.end_s) - first_s.max(window.start_s);
            Some(on_s.max(0.0))
        };
        let longest_s = self.worn.iter().filter_map(share).fold(0.0, f64::max);
        let mut out = Vec::new();
        for worn in &mut self.worn {
            let Some(on_s) = share(worn).filter(|on_s| 2.0 * on_s < longest_s) else {
                continue;
            };
            worn.left_out = true;
            out.push(Quality::remark(
                &worn.topic,
                "left_out",
                format!("tells steps in {on_s:.1} s of the window, another sensor in {longest_s:.1} s: synchrony and all that compares carriers are without it"),
            ));
        }
        out
    }

    /// Those whose phases are compared.
    fn compared(&self) -> impl Iterator<Item = (&Worn, &Steps)> {
        let each = self.worn.iter().filter(|worn| !worn.left_out);
        each.filter_map(|worn| Some((worn, worn.steps.as_ref().ok()?)))
    }

    /// Puts two carriers on one clock: the offsets under which their heaves, added up, are the rath's heave, and their difference its tilt.
    ///
    /// ```text
    /// H(t) ≈ γ (z_1(t + o_1) + z_2(t + o_2)),    P(t) ≈ κ (z_1(t + o_1) − z_2(t + o_2))
    /// J_X = |⟨X, S⟩|² / (⟨X, X⟩⟨S, S⟩),    o = argmax Σ_X −ln(1 − J_X)
    /// ```
    /// H, P, z_j analytic signals of the rath's heave and tilt and of carrier j's heave, 1 to 5 Hz; S the sum or difference on the right; γ, κ one
    /// complex number each: gain and lag of the load behind the shoulders, the same for both; o_j what carrier j's clock is ahead (s). It shows
    /// where carriers fall in and out of step: the heave grows and fades, the tilt fades and grows. What both clocks have in common goes
    /// into γ and κ and stays. They are looked for within [`REACH_S`] of the rath's clock: a whole number of steps changes the phases of those whose
    /// pace does. Offsets that are as good are kept for the interval of the synchrony. Of more than two each is too small a part of what moves
    /// the load: their clocks are left alone, and the synchrony is without an interval.
    ///
    /// With `leave` it is only said how they differ. Clocks that taps have set, those of `set` (topics), stay as they are; where only some are, nothing tells how the
    /// others go beside them.
    pub fn align(&mut self, motion: Option<&Motion>, set: &[String], leave: bool) -> Vec<Quality> {
        let walking: Vec<&Worn> = self.compared().map(|(worn, _)| worn).collect();
        let found = match (&walking[..], motion) {
            ([] | [_], _) => return Vec::new(),
            (all, _) if all.iter().all(|worn| set.contains(&worn.topic)) => return Vec::new(),
            (all, _) if all.iter().any(|worn| set.contains(&worn.topic)) => {
                Err("taps tell how some of them go, and not the others")
            }
            ([one, other], Some(motion)) => offsets([one, other], motion),
            ([_, _], None) => Err("no sensor tells how the load moves"),
            _ => Err("of more than two each is too small a part of what moves the load"),
        };
        let (offsets_s, or_s) = match found {
            Ok(Some(found)) => found,
            Ok(None) => return Vec::new(),
            Err(why) => {
                let topics: Vec<&str> = walking.iter().map(|w| &w.topic[..]).collect();
                let text = format!(
                    "the clocks of {} could not be held against each other: {why}; a synchrony of theirs has no interval, tap the sensors together or say --one-clock",
                    topics.join(", ")
                );
                self.apart = true;
                return vec![Quality::remark("", "clocks_apart", text)];
            }
        };
        let done;
        (self.clocks, done) = match leave {
            true => (Clocks::LeftApart, "left as it is"),
            false => (Clocks::SetByMotion, "put right before comparing phases"),
        };
        let mut out = Vec::new();
        let compared = |w: &&mut Worn| w.steps.is_ok() && !w.left_out;
        let walking = self.worn.iter_mut().filter(compared);
        for (k, (worn, offset_s)) in walking.zip(offsets_s).enumerate() {
            if !leave {
                worn.ahead_s = offset_s;
                worn.or_ahead_s = or_s.iter().map(|or| or[k]).collect();
            }
            out.push(Quality::remark(
                &worn.topic,
                "clock_offset",
                format!(
                    "runs {:+.0} ± {:.0} ms off the carriers' common clock, or whole steps more; {done}",
                    1e3 * offset_s,
                    1e3 * OFFSET_ERROR_S
                ),
            ));
        }
        out
    }

    /// Phases on one time axis, rad, for those who walk; `None` where nobody does.
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

    /// For each clock that taps or motion have set: with it as far behind as its 95 % interval goes, and as far ahead.
    pub fn phases_by_clocks(&self) -> impl Iterator<Item = [Option<Phases>; 2]> + '_ {
        let error_s = |worn: &Worn| match worn.ahead_s == 0.0 {
            true => 1.96 * worn.clock_sd_s,
            false => OFFSET_ERROR_S,
        };
        let set = (0..self.worn.len()).map(move |k| (k, error_s(&self.worn[k])));
        set.filter(|(_, error_s)| *error_s > 0.0)
            .map(|(k, error_s)| {
                [-error_s, error_s].map(|by_s| {
                    let moved = |worn: &Worn| match std::ptr::eq(worn, &self.worn[k]) {
                        true => worn.ahead_s + by_s,
                        false => worn.ahead_s,
                    };
                    self.phases_as(|steps| steps.phase_rad.clone(), moved)
                })
            })
    }

    fn phases_as(
        &self,
        phase: impl Fn(&Steps) -> Vec<f64>,
        ahead_s: impl Fn(&Worn) -> f64,
    ) -> Option<Phases> {
        let walking: Vec<(&Worn, &Steps)> = self.compared().collect();
        let first = walking.first()?;
        let times: Vec<Vec<f64>> = walking
            .iter()
            .map(|(worn, s)| s.t_s.iter().map(|t| t - ahead_s(worn)).collect())
            .collect();
        let start = times.iter().map(|t| t[0]).fold(f64::MAX, f64::min);
        let end = times
            .iter()
            .map(|t| t[t.len() - 1])
            .fold(f64::MIN, f64::max);
        let step = period_s(&first.1.t_s)?;
        // Who were never on together are not compared.
        let longest_s: f64 = times.iter().map(|t| t[t.len() - 1] - t[0]).sum();
        if !(1.0..=longest_s).contains(&(end - start)) {
            return None;
        }
        let axis: Vec<f64> = (0..=((end - start) / step) as usize)
            .map(|k| start + k as f64 * step)
            .collect();
        let phases = walking
            .iter()
            .zip(&times)
            .map(|((_, s), t)| {
                let on = Window {
                    start_s: t[0],
                    end_s: t[t.len() - 1],
                };
                let mut out = vec![f64::NAN; axis.len()];
                let here = on.range(&axis);
                let seen = interpolate(t, &phase(s), &axis[here.clone()]);
                out[here].copy_from_slice(&seen);
                out
            })
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
    /// without), and, of the synchrony, the clocks: those that were put on each other by motion, as twins show them, or otherwise (`synchrony_else`), and what
    /// the errors of those that were set and holes make of it (`by_others`): the more, the further apart the steps are.
    pub fn interval(
        &self,
        metrics: &mut Metrics,
        detected: &Metrics,
        synchrony_else: &[f64],
        by_others: Result<f64, String>,
    ) {
        let moved = self.worn.iter().any(|worn| worn.ahead_s != 0.0);
        let (by_others, unknown) = match by_others {
            Ok(half) => (half, None),
            Err(why) => (0.0, Some(why)),
        };
        let clocks = if moved {
            MOVED_ERROR.hypot(by_others)
        } else {
            by_others
        };
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
                ("synchrony" | "plv" | "beat_lead_deg" | "coupling_rad_per_s", _) if self.apart => {
                    value.reason =
                        Some("if the carriers' clocks agree, which nothing tells".into());
                }
                ("synchrony" | "plv", Some([low, high, apart])) if apart > VAGUE => {
                    value.withhold(format!(
                        "several offsets of the carriers' clocks go with the load's motion, and with them a synchrony from {low:.2} to {high:.2}: tap the sensors together"
                    ));
                }
                ("beat_lead_deg", _) if moved => {
                    value.withhold("the carriers' clocks were put on each other by motion, which does not tell their own lag from the load's: tap the sensors together");
                }
                ("synchrony" | "plv", _) if unknown.is_some() => value.reason.clone_from(&unknown),
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

    /// Gives the interval of the step rate what its carriers' sensors do not tell of the window: their rates then are to the others as those of parts so long are to
    /// each other.
    ///
    /// ```text
    /// δ = 1.96/N Σ s_j σ_j
    /// ```
    /// s_j the share of the window that sensor j does not tell, σ_j the RMS of what the rates of parts of that length, a fifth of the window at most, differ by from
    /// their walker's mean (Hz), N the carriers who count. Added up, for a tempo that changes does so for all. Where they lack more than a fifth of all that N
    /// would tell there is none: see [`by_holes`].
    pub fn rate_by_holes(&self, value: &mut Value, window: Window) {
        let Some([low, high]) = value.ci95 else {
            return;
        };
        let on = |worn: &Worn, steps: &Steps| {
            let common = |t: &f64| t - worn.ahead_s;
            Some([
                steps.t_s.first().map(common)?,
                steps.t_s.last().map(common)?,
            ])
        };
        let walking = || {
            self.worn
                .iter()
                .filter_map(|w| Some((w, w.steps.as_ref().ok()?)))
        };
        let ends: Vec<[f64; 2]> = walking().filter_map(|(w, s)| on(w, s)).collect();
        let first_s = ends.iter().map(|on| on[0]).fold(f64::MAX, f64::min);
        let last_s = ends.iter().map(|on| on[1]).fold(f64::MIN, f64::max);
        let window = Window {
            start_s: window.start_s.max(first_s),
            end_s: window.end_s.min(last_s),
        };
        let whole_s = window.end_s - window.start_s;
        // What one took between steps, and what one's sensor does not tell, s.
        let told = |((worn, found), step_s): ((&Worn, &Steps), Vec<f64>)| {
            let inside = &step_s[window.range(&step_s)];
            let [on_s, off_s] = on(worn, found)?;
            let parts = stretches(&worn.t_s, steps::BRIDGED_S).into_iter();
            let seen_s = parts.map(|part| {
                let [a, b] = [part.start, part.end - 1].map(|k| worn.t_s[k] - worn.ahead_s);
                let seen = Window {
                    start_s: a.max(on_s),
                    end_s: b.min(off_s),
                };
                seen.overlap_s(window)
            });
            let lost_s = (whole_s - seen_s.sum::<f64>()).max(0.0);
            (inside.len() >= 3).then(|| (walked_s(inside), lost_s))
        };
        let told: Vec<(Vec<f64>, f64)> = walking().zip(self.step_s()).filter_map(told).collect();
        let share = told.iter().map(|(_, lost_s)| lost_s).sum::<f64>()
            / (whole_s * told.len().max(1) as f64);
        if !(share > 0.0) {
            return;
        }
        if share > MOST_UNKNOWN {
            value.ci95 = None;
            value.reason = Some(format!(
                "without an interval: {:.0} % of what the carriers' sensors would tell of the window is not recorded",
                100.0 * share
            ));
            return;
        }
        let mean = |gaps: &[f64]| gaps.iter().sum::<f64>() / gaps.len() as f64;
        let spread = |long_s: f64| {
            let each = told.iter().flat_map(|(gaps, _)| {
                let usual = mean(gaps);
                let count = ((long_s / usual).round() as usize).max(1);
                gaps.chunks(count)
                    .map(move |part| 1.0 / mean(part) - 1.0 / usual)
            });
            let off: Vec<f64> = each.collect();
            (off.iter().map(|d| d * d).sum::<f64>() / off.len() as f64).sqrt()
        };
        let longest_s = MOST_UNKNOWN * whole_s;
        let each = told.iter().filter(|(_, lost_s)| *lost_s > 0.0);
        let each = each.map(|(_, lost_s)| lost_s / whole_s * spread(lost_s.min(longest_s)));
        let by_holes = 1.96 * each.sum::<f64>() / told.len() as f64;
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let half = half.hypot(by_holes);
        value.ci95 = Some([middle - half, middle + half]);
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

/// Norm of the mean specific force over [`FELT_OVER_S`], as a rule, m/s²: of gravity, however the sensor is turned from time to time.
fn mean_force(track: &Track) -> f64 {
    let part = |t: f64| (t / FELT_OVER_S).floor();
    let (mut rest, mut norms) = (&track.accel_m_per_s2[..], Vec::new());
    for times in track.t_s.chunk_by(|a, b| part(*a) == part(*b)) {
        let (here, behind) = rest.split_at(times.len());
        let sum: Vector3<f64> = here.iter().map(|a| Vector3::from(*a)).sum();
        norms.push((sum / times.len() as f64).norm());
        rest = behind;
    }
    median(&mut norms).unwrap_or_default()
}

/// Offsets of two clocks, and others that go with the load's motion as well (s).
type Offsets = ([f64; 2], Vec<[f64; 2]>);

/// o_j of two who walk; `None` where the clocks do as they are.
///
/// # Errors
/// Why that cannot be told.
fn offsets(worn: [&Worn; 2], motion: &Motion) -> Result<Option<Offsets>, &'static str> {
    let short = "they share less than 10 s with the load's motion";
    let seen = &motion.inputs;
    let ends = |t: &[f64]| Some((*t.first()?, *t.last()?));
    let (mut start, mut end) = ends(&seen.t_s).ok_or(short)?;
    for worn in worn {
        let (a, b) = ends(&worn.t_s).ok_or(short)?;
        (start, end) = (start.max(a), end.min(b));
    }
    if !(end - start >= 10.0) {
        return Err(short);
    }
    let n = ((end - start) * ALIGN_HZ) as usize;
    let grid: Vec<f64> = (0..n).map(|k| start + k as f64 / ALIGN_HZ).collect();
    let analytic = |t_s: &[f64], x: &[f64]| -> Result<Vec<Complex64>, &'static str> {
        let band = period_s(t_s).and_then(|step_s| gait_band(x, 1.0 / step_s));
        let band = band.ok_or("they are sampled too slowly")?;
        Ok(hilbert(&interpolate(t_s, &band, &grid)))
    };
    let [one, other] = worn.map(|worn| analytic(&worn.t_s, &worn.heave));
    let compared = Match {
        felt: [
            (analytic(&seen.t_s, &seen.support_ratio)?, 1.0),
            (analytic(&seen.t_s, &seen.pitch_rad)?, -1.0),
        ],
        riders: [one?, other?],
    };
    let cadence_hz = worn[0].steps.as_ref().map_or(1.0, |s| s.cadence_hz);
    let half_step = (0.5 * ALIGN_HZ / cadence_hz) as i64;
    let reach = (REACH_S.0.min(REACH_S.1 * (end - start)) * ALIGN_HZ) as i64;
    let found = compared.best(reach, half_step).ok_or(short)?;
    judged(found, 2.0 * half_step as f64 / ALIGN_HZ)
}

/// What matches of two clocks say of them, where a step takes so long (s): [`offsets`].
fn judged((all, as_they_are): Matches, step_s: f64) -> Result<Option<Offsets>, &'static str> {
    let enough = 2.0 * -(1.0 - MATCH).ln();
    let not_the_loads = "their heaves, put together, are not the load's";
    let best = all.first().map_or(0.0, |(told, _)| *told);
    let mut all = all.into_iter().map(|(_, found)| {
        // The load's lag is less than half a step and no clock's.
        let mean = 0.5 * (found[0] + found[1]);
        let lag = mean - (mean / step_s).round() * step_s;
        found.map(|o| o - lag)
    });
    let first = all.next().filter(|_| best >= enough).ok_or(not_the_loads)?;
    let little = (first[0] - first[1]).abs() < LEAST_OFFSET_S;
    if best - as_they_are < -BETTER.ln() || little {
        // Where nothing within reach is right, nothing is much better either.
        return (as_they_are >= enough).then_some(None).ok_or(not_the_loads);
    }
    Ok(Some((first, all.collect())))
}

/// Half of what the moments of a window at which not everybody's phase is known may make of the synchrony, 95 %: they are to the others as parts of their
/// length are to each other.
///
/// # Errors
/// Where they are more than a fifth of the window: fewer than four such parts tell little of each other.
pub fn by_holes(t_s: &[f64], phases: &[Vec<f64>], window: Window) -> Result<f64, String> {
    let range = window.range(t_s);
    let known = |k: &usize| phases.iter().all(|p| p[*k].is_finite());
    let whole = range.len();
    let seen: Vec<usize> = range.filter(known).collect();
    let lost = whole - seen.len();
    if lost == 0 || seen.is_empty() || phases.len() < 2 {
        return Ok(0.0);
    }
    let share = lost as f64 / whole as f64;
    if share > MOST_UNKNOWN {
        return Err(format!(
            "without an interval: in {:.0} % of the window somebody's phase is not known, who stands still or is not recorded",
            100.0 * share
        ));
    }
    let of: Vec<Vec<f64>> = phases
        .iter()
        .map(|p| seen.iter().map(|k| p[*k]).collect())
        .collect();
    let of: Vec<&[f64]> = of.iter().map(|p| &p[..]).collect();
    let together = order_parameter(&of);
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let all = mean(&together);
    let parts: Vec<f64> = together.chunks(lost).map(|part| mean(part) - all).collect();
    let spread = (parts.iter().map(|d| d * d).sum::<f64>() / parts.len() as f64).sqrt();
    Ok(1.96 * share * spread)
}

/// Of a window so much may lack somebody's phase.
const MOST_UNKNOWN: f64 = 0.2;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::metrics_of;
    use std::f64::consts::TAU;

    /// Nothing tells whether the clocks of three agree, nor those of two without a load: then the synchrony has no interval, and that is said.
    #[test]
    fn a_synchrony_whose_clocks_nothing_tells_has_no_interval() {
        for (count, why) in [(2, "no sensor tells"), (3, "of more than two")] {
            let mut carriers = Carriers::default();
            for k in 0..count {
                let t_s: Vec<f64> = (0..4000).map(|k| 0.01 * f64::from(k)).collect();
                let up = |t: &f64| 9.81 + 2.0 * (TAU * 2.0 * t + 0.2 * f64::from(k)).cos();
                let accel = t_s.iter().map(|t| [0.0, 0.0, up(t)]);
                let track = Track {
                    accel_m_per_s2: accel.collect(),
                    gyro_rad_per_s: vec![[0.0; 3]; t_s.len()],
                    t_s,
                    dropped: 0,
                };
                carriers.add(&format!("/imu/{k}"), &track, Options::default(), 9.81, 0.0);
            }
            let said = carriers.align(None, &[], false);
            assert!(
                said.len() == 1 && said[0].kind == "clocks_apart" && said[0].text.contains(why),
                "{said:?}"
            );
            let (phase_t_s, phase_rad) = carriers.phases().unwrap();
            let inputs = crate::inputs::Inputs {
                phase_t_s,
                phase_rad,
                ..Default::default()
            };
            let mut metrics = metrics_of(&inputs, Window::ALL, |name| name == "synchrony");
            carriers.interval(&mut metrics, &Metrics::default(), &[], Ok(0.0));
            let synchrony = metrics.get("synchrony").unwrap();
            assert!(synchrony.as_f64().unwrap() > 0.9 && synchrony.ci95.is_none());
            assert!(
                synchrony
                    .reason
                    .as_deref()
                    .unwrap()
                    .contains("clocks agree")
            );
        }
    }

    /// Two who part by a turn in 7 s, unseen for 2 s in every 11: what is left has another synchrony than the whole, within what is said.
    #[test]
    fn what_holes_hide_of_the_synchrony_is_said() {
        let t_s: Vec<f64> = (0..6000).map(|k| 0.01 * f64::from(k)).collect();
        let phases = |apart_hz: f64, hidden: bool| -> Vec<Vec<f64>> {
            let of = |hz: f64| {
                let at = |t: &f64| match hidden && t % 11.0 > 9.0 {
                    true => f64::NAN,
                    false => TAU * hz * t,
                };
                t_s.iter().map(at).collect()
            };
            vec![of(2.0), of(2.0 + apart_hz)]
        };
        let synchrony = |phases: Vec<Vec<f64>>| {
            let inputs = crate::inputs::Inputs {
                phase_t_s: t_s.clone(),
                phase_rad: phases,
                ..Default::default()
            };
            metrics_of(&inputs, Window::ALL, |name| name == "synchrony").number("synchrony")
        };
        let half =
            |apart_hz, hidden| by_holes(&t_s, &phases(apart_hz, hidden), Window::ALL).unwrap();
        assert_eq!(half(1.0 / 7.0, false), 0.0);
        assert!(half(0.0, true) < 1e-9);
        let [whole, left] =
            [false, true].map(|hidden| synchrony(phases(1.0 / 7.0, hidden)).unwrap());
        let half = half(1.0 / 7.0, true);
        assert!(
            (whole - left).abs() < half && half < 0.12,
            "{whole} {left} ± {half}"
        );
        // One who is not seen for a third of the time may have done anything.
        let mut late = phases(1.0 / 7.0, false);
        late[1][..2000].fill(f64::NAN);
        let why = by_holes(&t_s, &late, Window::ALL).unwrap_err();
        assert!(why.starts_with("without an interval: in 33 %"), "{why}");
    }

    /// Two whose tempo rises in music, one unseen for half a minute before it: the rate of what is left is too high, within what is said. One who is unseen for half of the
    /// time may have done anything.
    #[test]
    fn a_hole_in_one_carrier_widens_the_step_rates_interval() {
        let rate = |hole: Option<(f64, f64)>| {
            let mut carriers = Carriers::default();
            for k in 0..2 {
                let lost = |t: f64| k == 1 && hole.is_some_and(|(a, b)| t > a && t < b);
                let t_s = (0..6000).map(|k| 0.02 * f64::from(k)).filter(|t| !lost(*t));
                let t_s: Vec<f64> = t_s.collect();
                let turned = |t: f64| 2.0 * t + 0.15 * (t - 60.0).max(0.0);
                let up = |t: &f64| 9.81 + 2.0 * (TAU * turned(*t)).cos();
                let track = Track {
                    accel_m_per_s2: t_s.iter().map(|t| [0.0, 0.0, up(t)]).collect(),
                    gyro_rad_per_s: vec![[0.0; 3]; t_s.len()],
                    t_s,
                    dropped: 0,
                };
                carriers.add(&format!("/imu/{k}"), &track, Options::default(), 9.81, 0.0);
            }
            let inputs = crate::inputs::Inputs {
                step_s: carriers.step_s(),
                ..Default::default()
            };
            let metrics = metrics_of(&inputs, Window::ALL, |name| name == "step_rate_hz");
            let told = metrics.get("step_rate_hz").unwrap().clone();
            let mut value = told.clone();
            carriers.rate_by_holes(&mut value, Window::ALL);
            (told, value)
        };
        let holds = |value: &Value, x: f64| value.ci95.is_some_and(|[a, b]| (a..=b).contains(&x));
        let (told, whole) = rate(None);
        assert_eq!(told.ci95, whole.ci95);
        let whole = whole.as_f64().unwrap();
        let (told, value) = rate(Some((20.0, 56.0)));
        assert!(
            !holds(&told, whole) && holds(&value, whole),
            "{told:?} {value:?} {whole}"
        );
        let [low, high] = value.ci95.unwrap();
        assert!(high - low < 0.06, "{low} {high}");
        let (_, value) = rate(Some((10.0, 70.0)));
        assert!(value.ci95.is_none() && value.reason.unwrap().contains("25 %"));
    }

    /// What matches tell of clocks that are right, 0.2 s off, and further off than is looked for (music, one clock 8.3, 6.2 and 13.1 s off).
    #[test]
    fn clocks_are_right_only_where_the_load_moves_so() {
        let of = |told: f64, found: [f64; 2], as_they_are| {
            judged((vec![(told, found)], as_they_are), 0.46)
        };
        assert_eq!(of(7.66, [-0.103, -0.097], 7.66), Ok(None));
        let (offsets, others) = of(7.67, [0.097, -0.097], 1.11).unwrap().unwrap();
        assert!((offsets[0] - offsets[1] - 0.194).abs() < 1e-12 && others.is_empty());
        for (told, found, as_they_are) in [
            (3.91, [-2.068, -0.452], 3.41),
            (5.43, [4.604, -4.954], 3.51),
            (7.12, [4.965, 4.955], 5.81),
        ] {
            assert!(
                of(told, found, as_they_are).is_err(),
                "{told} {as_they_are}"
            );
        }
        assert!(judged((Vec::new(), 9.0), 0.46).is_err());
    }

    const WALK_HZ: f64 = 2.0;

    /// A minute of somebody who heaves by 2 m/s² with every step; the gyroscope only feels that there is one.
    fn walker(late_s: f64) -> Track {
        let t_s: Vec<f64> = (0..6000).map(|k| 0.01 * f64::from(k)).collect();
        let up = |t: &f64| 9.81 + 2.0 * (TAU * WALK_HZ * (t - late_s)).cos();
        Track {
            accel_m_per_s2: t_s.iter().map(|t| [0.0, 0.0, up(t)]).collect(),
            gyro_rad_per_s: vec![[0.0, 0.0, 1e-6]; t_s.len()],
            t_s,
            dropped: 0,
        }
    }

    /// Two who walk in step, the second with a clock 0.1 s ahead.
    fn pair(clock_sd_s: f64) -> Carriers {
        let mut carriers = Carriers::default();
        for (k, late_s) in [0.0, 0.1].into_iter().enumerate() {
            let options = Options::without_latency();
            let sd_s = if k == 1 { clock_sd_s } else { 0.0 };
            carriers.add(&format!("/imu/{k}"), &walker(late_s), options, 9.81, sd_s);
        }
        carriers
    }

    /// A third whose phone goes flat after 20 s does not take the others' minute; one that lasts for 40 is compared as long as it lasts.
    #[test]
    fn who_is_on_for_less_than_half_is_left_out() {
        for (on_s, left_out) in [(20.0, true), (40.0, false)] {
            let mut carriers = pair(0.0);
            let mut short = walker(0.0);
            let n = short.t_s.partition_point(|t| *t < on_s);
            short.t_s.truncate(n);
            short.accel_m_per_s2.truncate(n);
            short.gyro_rad_per_s.truncate(n);
            carriers.add("/imu/2", &short, Options::without_latency(), 9.81, 0.0);
            let window = Window {
                start_s: 5.0,
                end_s: 60.0,
            };
            let said = carriers.leave_out(window);
            assert_eq!(said.len(), usize::from(left_out));
            let (t_s, phases) = carriers.phases().unwrap();
            assert!(t_s[t_s.len() - 1] > 59.9);
            assert_eq!(phases.len(), if left_out { 2 } else { 3 });
            let late = t_s.partition_point(|t| *t < on_s + 1.0);
            assert!(phases[1][late].is_finite());
            assert!(phases.get(2).is_none_or(|p| p[late].is_nan()));
        }
    }

    /// Taps that set the clock of one say nothing of the other's.
    #[test]
    fn clocks_of_which_some_are_set_are_apart() {
        let names = ["/imu/0".to_owned(), "/imu/1".to_owned()];
        for set in 0..=2 {
            let mut carriers = pair(0.001);
            let said = carriers.align(None, &names[..set], false);
            assert_eq!(carriers.apart, set < 2);
            assert_eq!(said.len(), usize::from(set < 2));
        }
    }

    /// Of two columns by how much the second is behind, rad.
    fn behind((t_s, phases): &Phases) -> f64 {
        let [a, b] = &phases[..] else {
            panic!("{} columns", phases.len())
        };
        let middle = t_s.len() / 2;
        a[middle] - b[middle]
    }

    #[test]
    fn clocks_move_steps_phases_and_heaves_alike() {
        let mut carriers = pair(0.0);
        let turn = TAU * WALK_HZ;
        assert!((behind(&carriers.phases().unwrap()) - turn * 0.1).abs() < 0.02);
        carriers.worn[1].ahead_s = 0.1;
        let phases = carriers.phases().unwrap();
        assert!(behind(&phases).abs() < 0.02, "{}", behind(&phases));
        // From the earlier beginning to the later end, each known but for half a second at its own ends.
        let (t_s, columns) = &phases;
        assert!((t_s[0] + 0.1).abs() < 0.011 && (t_s[t_s.len() - 1] - 59.99).abs() < 0.011);
        for (column, ahead_s) in columns.iter().zip([0.0, 0.1]) {
            for (t, phase) in t_s.iter().zip(column) {
                let from_end_s = (t + ahead_s).min(59.99 - ahead_s - t);
                assert!(phase.is_finite() || from_end_s < 0.52, "{t}");
                assert!(phase.is_nan() || from_end_s > 0.48, "{t}");
            }
        }
        for steps in carriers.step_s() {
            for step in steps.iter().filter(|t| (5.0..55.0).contains(*t)) {
                let off = step * WALK_HZ - (step * WALK_HZ).round();
                assert!(off.abs() < 0.005, "{step}");
            }
        }
        let moments: Vec<f64> = carriers.events().iter().map(|e| e.t_s).collect();
        assert_eq!(moments, carriers.step_s().concat());
        // z = −(2/ω²) cos ωt where it is known: 2.5 s from either end of what each clock knows, at a corner of 0.2 Hz.
        let at_s: Vec<f64> = (0..600).map(|k| 0.1 * f64::from(k) + 0.03).collect();
        let heaves = carriers.heave_m(&at_s, 0.2);
        for (heave, ahead_s) in heaves.iter().zip([0.0, 0.1]) {
            for (t, z) in at_s.iter().zip(heave) {
                let inside = 2.5 - ahead_s < *t && *t < 57.49 - ahead_s;
                assert_eq!(z.is_finite(), inside, "{t}");
                let known = -2.0 / (turn * turn) * (turn * t).cos();
                if (10.0..50.0).contains(t) {
                    assert!(
                        (z - known).abs() < 0.01 * 2.0 / (turn * turn),
                        "{t}: {z} {known}"
                    );
                }
            }
        }
        // Who does not tell what is up tells no heave, nor does anybody then.
        let mut without = walker(0.0);
        without.gyro_rad_per_s.fill([0.0; 3]);
        carriers.add("/imu/2", &without, Options::without_latency(), 9.81, 0.0);
        assert!(carriers.heave_m(&at_s, 0.2).is_empty() && carriers.step_s().len() == 3);
    }

    #[test]
    fn a_clock_that_taps_have_set_may_err_either_way() {
        let turn = TAU * WALK_HZ;
        assert_eq!(pair(0.0).phases_by_clocks().count(), 0);
        let ends: Vec<_> = pair(0.01).phases_by_clocks().collect();
        let [ends] = &ends[..] else {
            panic!("{} clocks", ends.len())
        };
        for (end, sds) in ends.iter().zip([-1.96, 1.96]) {
            let found = behind(end.as_ref().unwrap());
            let known = turn * (0.1 - sds * 0.01);
            assert!((found - known).abs() < 0.02, "{sds}: {found} {known}");
        }
    }

    /// Errors by different causes add by squares; other offsets of the clocks that go with the motion stretch what is there.
    #[test]
    fn an_interval_holds_all_that_may_err() {
        let value = |x: f64| Value::number(x);
        let of = |synchrony: f64| {
            Metrics(vec![
                ("synchrony", value(synchrony)),
                ("plv", value(0.9)),
                ("beat_lead_deg", value(12.0)),
                ("pull_rad_per_s", value(2.0).ci95(1.0, 4.0)),
            ])
        };
        let detected = Metrics(vec![
            ("synchrony", value(0.88)),
            ("pull_rad_per_s", value(1.9)),
        ]);
        let mut carriers = pair(0.0);
        let with = |carriers: &Carriers, synchrony, others: &[f64], by_clocks| {
            let mut metrics = of(synchrony);
            carriers.interval(&mut metrics, &detected, others, Ok(by_clocks));
            metrics
        };
        let near = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-12;
        let ci95 = |m: &Metrics, name| m.get(name).unwrap().ci95.unwrap();
        let found = with(&carriers, 0.9, &[], 0.015);
        let half = (0.002f64.powi(2) + 0.015f64.powi(2) + 0.02f64.powi(2)).sqrt();
        assert!(near(ci95(&found, "synchrony"), [0.9 - half, 0.9 + half]));
        assert_eq!(found.number("beat_lead_deg"), Some(12.0));
        let lost = 0.1f64.hypot(0.015);
        let pull = [2.0 - 1f64.hypot(lost), 2.0 + 2f64.hypot(lost)];
        assert!(near(ci95(&found, "pull_rad_per_s"), pull));
        // A synchrony is between none and all of it.
        let most = with(&carriers, 0.999, &[], 0.0);
        assert_eq!(ci95(&most, "synchrony")[1], 1.0);
        assert_eq!(ci95(&with(&carriers, 0.01, &[], 0.0), "synchrony")[0], 0.0);
        // Put on each other by motion: 0.013 beside what the clocks leave, and no lag to the beat.
        carriers.worn[1].ahead_s = 0.1;
        let found = with(&carriers, 0.9, &[0.86, f64::NAN, 0.92], 0.03);
        let half = 0.002f64.hypot(0.013).hypot(0.02).hypot(0.03);
        assert!(near(ci95(&found, "synchrony"), [0.86 - half, 0.92 + half]));
        assert_eq!(found.number("beat_lead_deg"), None);
        // Offsets that leave it anywhere within more than a tenth tell none.
        let vague = with(&carriers, 0.9, &[0.7], 0.0);
        assert_eq!(vague.number("synchrony"), None);
        let why = vague.get("plv").unwrap().reason.clone().unwrap();
        assert!(why.contains("from 0.68 to 0.92"), "{why}");
        assert!(
            of_all("synchrony")
                && !of_all("beat_hz")
                && !of_all("pull_rad_per_s")
                && !of_all("t_float")
        );
    }

    /// Steps of a walker whose sensor turns every way count; with gravity taken out, as phones do, there are none, and that is said.
    #[test]
    fn without_gravity_there_are_no_steps() {
        for (gravity, turns) in [(9.81, true), (9.81, false), (0.0, true), (0.0, false)] {
            let t_s: Vec<f64> = (0..4000).map(|k| 0.01 * f64::from(k)).collect();
            let up = |t: &f64| gravity + 6.0 * (TAU * 2.0 * t).cos();
            // Worn upright, put away upside down.
            let accel = t_s
                .iter()
                .map(|t| [0.0, 0.0, if *t < 20.0 { up(t) } else { -up(t) }]);
            let rate = |t: &f64| match (turns, (19.9..20.1).contains(t)) {
                (true, true) => 5.0 * std::f64::consts::PI,
                _ => 0.0,
            };
            let track = Track {
                accel_m_per_s2: accel.collect(),
                gyro_rad_per_s: t_s.iter().map(|t| [rate(t), 0.0, 0.0]).collect(),
                t_s,
                dropped: 0,
            };
            let mut carriers = Carriers::default();
            carriers.add("/imu/carrier_1", &track, Options::default(), 9.81, 0.0);
            let steps = carriers.step_s();
            let said = carriers.quality();
            if gravity > 0.0 {
                assert!(steps[0].len() > 70 && said.is_empty(), "{said:?}");
            } else {
                assert!(steps.is_empty() && carriers.phases().is_none());
                let said = &said[0];
                assert!(
                    said.kind == "no_steps" && said.text.contains("not gravity"),
                    "{said:?}"
                );
            }
        }
    }
}

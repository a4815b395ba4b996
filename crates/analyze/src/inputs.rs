//! What the metrics are computed from: plain columns, from a recording or from a run in memory.

use crate::spline::resampled;
use std::borrow::Cow;
use std::ops::Range;

/// A stretch of time (s), both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// First moment.
    pub start_s: f64,
    /// Last moment.
    pub end_s: f64,
}

impl Window {
    /// All of time.
    pub const ALL: Window = Window {
        start_s: f64::NEG_INFINITY,
        end_s: f64::INFINITY,
    };

    /// From `start_s` on.
    pub fn from(start_s: f64) -> Self {
        Window {
            start_s,
            ..Window::ALL
        }
    }

    /// Whether a moment lies in it.
    pub fn contains(&self, t_s: f64) -> bool {
        (self.start_s..=self.end_s).contains(&t_s)
    }

    /// How long it is, s.
    pub fn length_s(&self) -> f64 {
        self.end_s - self.start_s
    }

    /// How much of another lies in it, s.
    pub fn overlap_s(&self, other: Window) -> f64 {
        let both = Window {
            start_s: self.start_s.max(other.start_s),
            end_s: self.end_s.min(other.end_s),
        };
        both.length_s().max(0.0)
    }

    /// The indices of an ascending time axis that lie in the window.
    pub fn range(&self, t_s: &[f64]) -> Range<usize> {
        let start = t_s.partition_point(|t| *t < self.start_s);
        let end = t_s.partition_point(|t| *t <= self.end_s);
        start..end.max(start)
    }
}

/// Where each group of columns comes from; the word that stands as `source` beside every metric.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sources {
    /// Roll, pitch and yaw.
    pub attitude: Cow<'static, str>,
    /// Roll and pitch are about their means: how the sensor that they come from sits is not known.
    pub levelled: bool,
    /// Height.
    pub height: Cow<'static, str>,
    /// Normal forces or the support ratio.
    pub forces: Cow<'static, str>,
    /// Carriers' phases.
    pub phases: Cow<'static, str>,
    /// The beat.
    pub beat: Cow<'static, str>,
}

impl Default for Sources {
    fn default() -> Self {
        Sources {
            attitude: "state".into(),
            levelled: false,
            height: "state".into(),
            forces: "forces".into(),
            phases: "phases".into(),
            beat: "phases".into(),
        }
    }
}

/// What a run gives. Every column may be empty, which means "not known"; columns of one time axis are equally long.
#[derive(Clone, Debug, PartialEq)]
pub struct Inputs {
    /// Time of the height and the angles, ascending (s).
    pub t_s: Vec<f64>,
    /// Height of the centre of mass (m).
    pub height_m: Vec<f64>,
    /// Times (s) and heights (m) where the height comes on a clock of its own: what is told of it alone is told of these.
    pub height_alone: Option<(Vec<f64>, Vec<f64>)>,
    /// Rotation about the pole (rad).
    pub roll_rad: Vec<f64>,
    /// Tilt of the pole (rad).
    pub pitch_rad: Vec<f64>,
    /// Heading (rad).
    pub yaw_rad: Vec<f64>,
    /// Time of the forces (s); empty means `t_s`.
    pub force_t_s: Vec<f64>,
    /// Normal force of each handle (N).
    pub normal_n: Vec<Vec<f64>>,
    /// N_tot / (M g) where it is measured as such (the vertical specific force of the centre of mass over g), on `t_s`.
    /// Used where `normal_n` is empty.
    pub support_ratio: Vec<f64>,
    /// How old `support_ratio` is at `t_s` (s): angles are put where the stamps are, what an accelerometer felt is left where it came.
    pub support_age_s: f64,
    /// Vertical motion of each carrier's shoulder about its slow course (m), on `t_s`; NaN where it is not known.
    pub heave_m: Vec<Vec<f64>>,
    /// Time of the phases (s); empty means `t_s`.
    pub phase_t_s: Vec<f64>,
    /// Gait phase of each carrier (rad), wrapped or not.
    pub phase_rad: Vec<Vec<f64>>,
    /// Phase of the beat on the phases' time (rad); NaN where no beat sounds.
    pub beat_phase_rad: Vec<f64>,
    /// Times of the steps of each carrier who wears a sensor and walks (s).
    pub step_s: Vec<Vec<f64>>,
    /// Mass of what is carried (kg).
    pub mass_kg: Option<f64>,
    /// Gravity [m/s²].
    pub gravity_m_per_s2: f64,
    /// The phases are estimates from measurements, with their own chance level: it is found by surrogates.
    pub phases_are_measured: bool,
    /// How the clocks of the sensors stand to each other.
    pub clocks: Clocks,
    /// Where the columns come from.
    pub sources: Sources,
}

/// How the clocks stand to each other, where several sensors have their own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Clocks {
    /// They are one, or taps have set them, or nothing tells that they differ.
    #[default]
    Agree,
    /// They differ and were left as they are.
    LeftApart,
    /// Motion alone has set the carriers', to some 20 ms.
    SetByMotion,
}

impl Default for Inputs {
    /// Nothing known; standard gravity.
    fn default() -> Self {
        Inputs {
            t_s: Vec::new(),
            height_m: Vec::new(),
            height_alone: None,
            roll_rad: Vec::new(),
            pitch_rad: Vec::new(),
            yaw_rad: Vec::new(),
            force_t_s: Vec::new(),
            normal_n: Vec::new(),
            support_ratio: Vec::new(),
            support_age_s: 0.0,
            heave_m: Vec::new(),
            phase_t_s: Vec::new(),
            phase_rad: Vec::new(),
            beat_phase_rad: Vec::new(),
            step_s: Vec::new(),
            mass_kg: None,
            gravity_m_per_s2: 9.80665,
            phases_are_measured: false,
            clocks: Clocks::Agree,
            sources: Sources::default(),
        }
    }
}

/// A force sensor's zero is right to so much of its mean reading.
const ZERO_SHARE: f64 = 0.2;

/// The strongest pull on a handle, N, below zero, where one is pulled beyond what a force sensor's zero may be off: handles are tied then.
pub fn pulled_n<N: AsRef<[f64]>>(normal_n: &[N]) -> Option<f64> {
    let each = || normal_n.iter().flat_map(|n| n.as_ref());
    let finite = || each().filter(|n| n.is_finite());
    let mean = finite().sum::<f64>() / finite().count().max(1) as f64;
    let least = finite().copied().fold(f64::INFINITY, f64::min);
    (least < -ZERO_SHARE * mean.abs()).then_some(least)
}

impl Inputs {
    /// [`pulled_n`] of all forces.
    pub fn pulled_n(&self) -> Option<f64> {
        pulled_n(&self.normal_n)
    }

    /// The height on its own clock: times (s) and heights (m).
    pub fn height(&self) -> (&[f64], &[f64]) {
        match &self.height_alone {
            Some((t_s, x)) => (t_s, x),
            None => (&self.t_s, &self.height_m),
        }
    }

    /// The time axis of the forces.
    pub fn force_times(&self) -> &[f64] {
        if self.force_t_s.is_empty() {
            &self.t_s
        } else {
            &self.force_t_s
        }
    }

    /// The time axis of the phases.
    pub fn phase_times(&self) -> &[f64] {
        if self.phase_t_s.is_empty() {
            &self.t_s
        } else {
            &self.phase_t_s
        }
    }

    /// Sum of the handles' normal forces at each force sample (N); empty without forces.
    pub fn total_force_n(&self) -> Vec<f64> {
        let Some(first) = self.normal_n.first() else {
            return Vec::new();
        };
        let mut total = first.clone();
        for handle in &self.normal_n[1..] {
            total.iter_mut().zip(handle).for_each(|(t, n)| *t += n);
        }
        total
    }
}

/// A step so many times one that 95 % of them do not exceed is a hole: single samples may be missing, or late, without one.
pub(crate) const HOLE: f64 = 2.5;

/// The longest step of an ascending time axis that is no hole (s); infinite below two samples.
pub fn longest_step_s(t_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = t_s.windows(2).map(|w| w[1] - w[0]).collect();
    if steps.is_empty() {
        return f64::INFINITY;
    }
    let k = usual(steps.len() - 1);
    HOLE * *steps.select_nth_unstable_by(k, f64::total_cmp).1
}

/// Rank of the step that 95 % do not exceed, of ranks up to `last`.
fn usual(last: usize) -> usize {
    last * 19 / 20
}

/// Whether an axis has no hole, told without sorting its steps.
fn whole(t_s: &[f64]) -> bool {
    let steps = || t_s.windows(2).map(|w| w[1] - w[0]);
    let Some(last) = t_s.len().checked_sub(2) else {
        return false;
    };
    let longest = steps().fold(0.0, f64::max);
    steps().filter(|step| HOLE * step >= longest).count() > last - usual(last)
}

/// The parts of an ascending time axis between its holes, as ranges of samples; steps up to `least_s` are never one.
pub fn stretches(t_s: &[f64], least_s: f64) -> Vec<Range<usize>> {
    let longest_s = match whole(t_s) {
        true => f64::INFINITY,
        false => longest_step_s(t_s).max(least_s),
    };
    let mut out = Vec::new();
    let mut start = 0;
    for end in 1..=t_s.len() {
        if end == t_s.len() || t_s[end] - t_s[end - 1] > longest_s {
            out.push(start..end);
            start = end;
        }
    }
    out
}

/// Mean step of an ascending time axis, holes left out (s); `None` below two samples or for a step that is not positive.
pub fn mean_step_s(t_s: &[f64]) -> Option<f64> {
    mean_step_in(t_s, &stretches(t_s, 0.0))
}

/// Mean step within parts of an ascending time axis (s); `None` as [`mean_step_s`].
pub fn mean_step_in(t_s: &[f64], parts: &[Range<usize>]) -> Option<f64> {
    let (mut span_s, mut steps) = (0.0, 0);
    for part in parts {
        span_s += t_s[part.end - 1] - t_s[part.start];
        steps += part.len() - 1;
    }
    let step = span_s / steps as f64;
    (step > 0.0 && step.is_finite()).then_some(step)
}

/// `x` on an even axis of `step_s` that begins with `t_s`, each sample at the nearest place; `elsewhere` where there is none.
pub fn placed(t_s: &[f64], x: &[f64], step_s: f64, elsewhere: f64) -> Vec<f64> {
    let place = |t: f64| ((t - t_s[0]) / step_s).round() as usize;
    let mut out = vec![elsewhere; place(t_s[t_s.len() - 1]) + 1];
    t_s.iter().zip(x).for_each(|(t, x)| out[place(*t)] = *x);
    out
}

/// Steps that differ from their mean by more than this part of it are not even.
const UNEVEN: f64 = 0.1;
/// Samples closer than this part of a step hold no more than one of them.
const CLOSE: f64 = 0.2;

/// Whether all steps are nearly `step_s`.
fn even(t_s: &[f64], step_s: f64) -> bool {
    t_s.windows(2)
        .all(|t| ((t[1] - t[0]) / step_s - 1.0).abs() <= UNEVEN)
}

/// Times and values of what is finite.
pub fn finite(t_s: &[f64], x: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let known = t_s.iter().zip(x);
    known
        .filter(|(t, x)| t.is_finite() && x.is_finite())
        .unzip()
}

/// A signal about its mean on an even axis, 0 in its holes.
pub struct Even {
    /// Its samples.
    pub x: Vec<f64>,
    /// The step (s).
    pub step_s: f64,
    /// Where nothing was measured.
    pub holes: Vec<Range<usize>>,
}

/// `x` about its mean on an even axis: a transform of it has its lines where they are, though samples are missing. Where more is missing than is there, of
/// the longest part without a hole. `None` as [`mean_step_s`].
pub fn about_mean(t_s: &[f64], x: &[f64]) -> Option<Even> {
    let parts = stretches(t_s, 0.0);
    let step_s = mean_step_in(t_s, &parts)?;
    if (t_s[t_s.len() - 1] - t_s[0]) / step_s + 1.0 > 2.0 * x.len() as f64 {
        let longest = parts.into_iter().max_by_key(ExactSizeIterator::len)?;
        return about_mean(&t_s[longest.clone()], &x[longest]);
    }
    let mut even: Vec<f64> = Vec::new();
    let mut holes = Vec::new();
    for part in &parts {
        let (first, part) = on_axis(&t_s[part.clone()], &x[part.clone()], t_s[0], step_s);
        // A part of a sample or two may lie between two places, or on the last of the part before.
        let twice = even.len().saturating_sub(first).min(part.len());
        if first > even.len() {
            holes.push(even.len()..first);
            even.resize(first, f64::NAN);
        }
        even.extend_from_slice(&part[twice..]);
    }
    let there = even.iter().filter(|x| !x.is_nan());
    let mean = there.clone().sum::<f64>() / there.count() as f64;
    even.iter_mut().for_each(|x| *x -= mean);
    holes.iter().for_each(|hole| even[hole.clone()].fill(0.0));
    Some(Even {
        x: even,
        step_s,
        holes,
    })
}

/// A part without a hole on the even axis of `step_s` from `start_s`, and its first place there: as it is where each sample lies on a place; else, where
/// samples are lost or were taken unevenly, by a cubic spline, or by straight lines where samples lie so close together that a spline would follow their noise.
pub fn on_axis<'a>(
    t_s: &[f64],
    x: &'a [f64],
    start_s: f64,
    step_s: f64,
) -> (usize, Cow<'a, [f64]>) {
    let place = |t: f64| (t - start_s) / step_s;
    let [first, last] = [t_s[0], t_s[t_s.len() - 1]].map(place);
    let (begin, end) = (first.round(), last.round());
    let off = (first - begin).abs().max((last - end).abs());
    let alone = t_s.len() == 1;
    let whole = end - begin == (t_s.len() - 1) as f64;
    if alone || whole && off <= UNEVEN && even(t_s, step_s) {
        return (begin as usize, x.into());
    }
    let places = (first - 1e-6).ceil() as usize..=(last + 1e-6).floor() as usize;
    let at_s: Vec<f64> = places
        .clone()
        .map(|k| start_s + k as f64 * step_s)
        .collect();
    (*places.start(), drawn(t_s, x, &at_s, step_s).into())
}

/// `x(t)` at ascending times by a cubic spline, or by straight lines where samples of this mean step lie so close together that a spline would follow their noise.
pub fn drawn(t_s: &[f64], x: &[f64], at_s: &[f64], step_s: f64) -> Vec<f64> {
    let close = t_s.windows(2).any(|t| t[1] - t[0] < CLOSE * step_s);
    let smooth = (!close).then(|| resampled(t_s, x, at_s)).flatten();
    smooth.unwrap_or_else(|| interpolate(t_s, x, at_s))
}

/// As [`drawn`], but NaN before the first sample, behind the last, and in holes. Both time axes ascend.
pub fn drawn_within(t_s: &[f64], x: &[f64], at_s: &[f64]) -> Vec<f64> {
    let mut out = vec![f64::NAN; at_s.len()];
    let parts = stretches(t_s, 0.0);
    let step_s = mean_step_in(t_s, &parts).unwrap_or(0.0);
    for part in parts {
        let (t_s, x) = (&t_s[part.clone()], &x[part]);
        let ends = Window {
            start_s: t_s[0],
            end_s: t_s[t_s.len() - 1],
        };
        let within = ends.range(at_s);
        let there = drawn(t_s, x, &at_s[within.clone()], step_s);
        out[within].copy_from_slice(&there);
    }
    out
}

/// `x(t)` at the times `at_s` by straight lines between samples; held beyond the ends. Both time axes ascend.
pub fn interpolate(t_s: &[f64], x: &[f64], at_s: &[f64]) -> Vec<f64> {
    let last = t_s.len().min(x.len());
    if last == 0 {
        return Vec::new();
    }
    let mut k = 0;
    at_s.iter()
        .map(|&at| {
            while k + 1 < last && t_s[k + 1] <= at {
                k += 1;
            }
            if at <= t_s[k] || k + 1 == last {
                return x[k];
            }
            let share = (at - t_s[k]) / (t_s[k + 1] - t_s[k]);
            x[k] + share * (x[k + 1] - x[k])
        })
        .collect()
}

/// As [`interpolate`], but NaN before the first sample, behind the last, and in holes.
pub fn between(t_s: &[f64], x: &[f64], at_s: &[f64]) -> Vec<f64> {
    if t_s.is_empty() {
        return vec![f64::NAN; at_s.len()];
    }
    let mut out = interpolate(t_s, x, at_s);
    let longest_s = longest_step_s(t_s);
    for (y, at) in out.iter_mut().zip(at_s) {
        let k = t_s.partition_point(|t| t < at);
        let there = match (k.checked_sub(1), t_s.get(k)) {
            (_, Some(t)) if t == at => true,
            (Some(before), Some(t)) => t - t_s[before] <= longest_s,
            _ => false,
        };
        if !there {
            *y = f64::NAN;
        }
    }
    out
}

/// As [`between`], but the nearest sample, of two the earlier: what stays at 0 for a while, as the force at a slack handle, stays there for as long.
pub fn nearest(t_s: &[f64], x: &[f64], at_s: &[f64]) -> Vec<f64> {
    let mut out = between(t_s, x, at_s);
    for (y, at) in out.iter_mut().zip(at_s).filter(|(y, _)| !y.is_nan()) {
        let k = t_s.partition_point(|t| t < at);
        let later = k == 0 || t_s.get(k).is_some_and(|t| t - at < at - t_s[k - 1]);
        *y = if later { x[k] } else { x[k - 1] };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_put_on_an_even_axis() {
        let swing = |t: &f64| (3.0 * t).sin();
        let even: Vec<f64> = (0..300).map(|k| f64::from(k) / 30.0).collect();
        let mut t_s = even.clone();
        // One comes with the next, one is lost.
        t_s[100] = t_s[101] - 1e-9;
        t_s.remove(200);
        let mut x: Vec<f64> = t_s.iter().map(swing).collect();
        x[100] += 1e-3;
        // A straight line over h misses a bend b by bh²/8, here 9 (1/15)²/8.
        for (lost, off) in [(false, 5.1e-3), (true, 1e-4)] {
            if lost {
                // Without what lies too close a spline goes through the rest.
                t_s.remove(100);
                x.remove(100);
            }
            let (0, found) = on_axis(&t_s, &x, 0.0, 1.0 / 30.0) else {
                panic!("it begins with the axis");
            };
            assert_eq!(found.len(), 300);
            for (t, x) in even.iter().zip(found.iter()) {
                assert!((x - swing(t)).abs() < off, "{t}: {x}");
            }
        }
        assert!(matches!(
            on_axis(&even, &even, 0.0, 1.0 / 30.0),
            (0, Cow::Borrowed(_))
        ));
    }

    #[test]
    fn a_window_holds_its_ends() {
        let t = [0.0, 0.5, 1.0, 1.5];
        assert_eq!(
            Window {
                start_s: 0.5,
                end_s: 1.0
            }
            .range(&t),
            1..3
        );
        assert_eq!(Window::ALL.range(&t), 0..4);
        assert_eq!(
            Window {
                start_s: 9.0,
                end_s: 1.0
            }
            .range(&t),
            4..4
        );
        assert_eq!(Window::from(0.6).range(&[]), 0..0);
    }

    #[test]
    fn interpolation_is_linear_and_held() {
        let y = interpolate(
            &[0.0, 1.0, 3.0],
            &[0.0, 2.0, 0.0],
            &[-1.0, 0.5, 1.0, 2.0, 3.0, 9.0],
        );
        assert_eq!(y, [0.0, 1.0, 2.0, 1.0, 0.0, 0.0]);
    }

    #[test]
    fn the_archive_s_step_is_exact() {
        let t: Vec<f64> = (455..1819).map(|i| f64::from(33 * i) / 1e3).collect();
        assert!((mean_step_s(&t).unwrap() / 0.033 - 1.0).abs() < 1e-15);
        assert_eq!(mean_step_s(&[1.0]), None);
    }

    /// A sine of 1 Hz at 20 Hz for 30 s, but for 10 … 13 s.
    fn holed() -> (Vec<f64>, Vec<f64>) {
        let t: Vec<f64> = (0..600).map(|k| f64::from(k) / 20.0).collect();
        let t: Vec<f64> = t
            .into_iter()
            .filter(|t| !(10.0..13.0).contains(t))
            .collect();
        let x = t
            .iter()
            .map(|t| (std::f64::consts::TAU * t).sin())
            .collect();
        (t, x)
    }

    #[test]
    fn holes_part_an_axis_and_single_missing_samples_do_not() {
        let (t, x) = holed();
        assert_eq!(stretches(&t, 0.0), [0..200, 200..540]);
        assert_eq!(stretches(&t, 5.0).len(), 1);
        assert!((mean_step_s(&t).unwrap() - 0.05).abs() < 1e-12);
        assert_eq!(stretches(&[0.0, 1.0, 2.0, 4.0, 5.0], 0.0).len(), 1);
        assert!(stretches(&[], 0.0).is_empty());
        assert_eq!(stretches(&[3.0], 0.0).len(), 1);
        let Even {
            x: even,
            step_s,
            holes,
        } = about_mean(&t, &x).unwrap();
        assert_eq!((even.len(), holes.len(), &holes[0]), (600, 1, &(200..260)));
        assert!(even[200..260].iter().all(|x| *x == 0.0) && (step_s - 0.05).abs() < 1e-12);
        assert!((even[265] - 1.0).abs() < 0.05);
        // Samples that go on beside the places of those before the hole are drawn to them.
        let shifted: Vec<f64> = t.iter().map(|t| t + 0.02 * f64::from(*t > 11.0)).collect();
        let moved: Vec<f64> = shifted
            .iter()
            .map(|t| (std::f64::consts::TAU * t).sin())
            .collect();
        let other = about_mean(&shifted, &moved).unwrap();
        assert_eq!(other.holes[0], 200..261);
        let after = other.x[262..599].iter().zip(&even[262..599]);
        assert!(after.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-3);
        // A sample years later asks for no memory.
        let late: Vec<f64> = t.iter().copied().chain([1e9]).collect();
        let x: Vec<f64> = x.iter().copied().chain([0.0]).collect();
        assert_eq!(about_mean(&late, &x).unwrap().x.len(), 340);
    }

    /// A force is 0 for as much of another clock's samples as of its own.
    #[test]
    fn the_nearest_sample_keeps_what_is_clipped() {
        let force = |t: &f64| (100.0 * (0.9 + (7.3 * t).sin())).max(0.0);
        let t_s: Vec<f64> = (0..3000).map(|k| f64::from(k) / 30.0).collect();
        let x: Vec<f64> = t_s.iter().map(force).collect();
        let at_s: Vec<f64> = t_s.iter().map(|t| t + 0.5 / 30.0).collect();
        let slack = |x: &[f64]| x.iter().filter(|x| **x <= 0.0).count();
        let (own, other) = (slack(&x), slack(&nearest(&t_s, &x, &at_s)));
        assert!(own.abs_diff(other) <= 1, "{own} {other}");
        assert!(slack(&between(&t_s, &x, &at_s)) < own * 9 / 10);
        // Its own times, ties, before the first and behind the last.
        let found = nearest(
            &[0.0, 1.0, 2.0],
            &[5.0, 6.0, 7.0],
            &[-0.1, 0.0, 0.4, 0.5, 1.6, 2.0, 2.1],
        );
        assert!(found[0].is_nan() && found[6].is_nan());
        assert_eq!(found[1..6], [5.0, 5.0, 5.0, 7.0, 7.0]);
    }

    #[test]
    fn nothing_is_drawn_through_holes() {
        let (t, x) = holed();
        let y = between(
            &t,
            &x,
            &[-1.0, 0.0, 9.95, 9.975, 11.0, 12.99, 13.0, 29.95, 30.0],
        );
        let known: Vec<bool> = y.iter().map(|y| y.is_finite()).collect();
        assert_eq!(
            known,
            [false, true, true, false, false, false, true, true, false]
        );
        assert!(between(&[], &[], &[1.0])[0].is_nan());
    }
}

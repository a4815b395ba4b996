//! How two rhythms keep step: the beat's phase, and the ratios that are looked at.

use super::smooth::smooth;
use crate::inputs::Window;
use crate::median::median;
use std::f64::consts::TAU;
use std::ops::Range;

/// Ratios looked at, p of the first to q of the second.
pub const RATIOS: [(u32, u32); 5] = [(1, 1), (1, 2), (2, 1), (2, 3), (3, 2)];

/// A gap between beats so many beats longer than those it holds is a pause.
const PAUSE: f64 = 1.5;
/// Through a gap that is shorter than this a beat goes on where it comes back in time, s.
const COUNTED_S: f64 = 5.0;
/// It does so near a whole number of beats, where the tempos on both sides do not part by more than this over the gap, beats.
const IN_TIME: (f64, f64) = (0.15, 0.25);
/// The usual gap is the median of so many before and after one: tempo changes.
const NEIGHBOURS: usize = 4;

/// How many beats each gap between beats holds, one where none is missing in it; `None` for a pause, in which nobody knows. Their numbers tell,
/// where these go up; else, as where nobody numbered them or a drum was started anew, the nearest whole number.
pub fn beats_between(beat_s: &[f64], number: Option<&[f64]>) -> Vec<Option<u32>> {
    let number = number.filter(|n| n.len() == beat_s.len());
    let told = |k: usize| {
        let held = number.map(|n| n[k + 1] - n[k]);
        held.filter(|held| *held >= 1.0)
    };
    let gaps: Vec<f64> = beat_s.windows(2).map(|b| b[1] - b[0]).collect();
    let each: Vec<f64> = (0..gaps.len())
        .map(|k| gaps[k] / told(k).unwrap_or(1.0))
        .collect();
    let of = |k: usize| {
        let from = k.saturating_sub(NEIGHBOURS);
        let to = (k + NEIGHBOURS + 1).min(gaps.len());
        let (before, behind) = (&each[from..k], &each[k + 1..to]);
        let usual_s = median(&mut [before, behind].concat()).unwrap_or(each[k]);
        let beats = gaps[k] / usual_s;
        if let Some(held) = told(k) {
            return (beats < held + PAUSE).then_some(held as u32);
        }
        let held = beats.round().max(1.0);
        let tempos = median(&mut before.to_vec()).zip(median(&mut behind.to_vec()));
        let in_time = || {
            let (near, apart) = IN_TIME;
            let parted = tempos.is_some_and(|(a, b)| held * (a - b).abs() < apart * usual_s);
            gaps[k] < COUNTED_S && parted && (beats - held).abs() < near
        };
        (beats < 1.0 + PAUSE || in_time()).then_some(held as u32)
    };
    (0..gaps.len()).map(of).collect()
}

/// The course of beats: each beat errs by itself and carriers do not follow that; between beats it is straight, and in pauses there is none.
pub struct Course {
    /// When each beat is due, s.
    due_s: Vec<f64>,
    /// Its number; across a pause it goes on by one.
    number: Vec<f64>,
    /// The beats between pauses.
    runs: Vec<Range<usize>>,
    /// SD of the beats about it, s.
    error_s: f64,
}

impl Course {
    /// Of beats at ascending times (s), which may be numbered.
    pub fn of(beat_s: &[f64], number: Option<&[f64]>) -> Self {
        let held = beats_between(beat_s, number);
        let mut number = vec![0.0];
        for beats in &held {
            number.push(number[number.len() - 1] + f64::from(beats.unwrap_or(1)));
        }
        let (mut due_s, mut runs, mut squares) = (Vec::with_capacity(beat_s.len()), vec![], 0.0);
        for end in (1..=beat_s.len()).filter(|k| held.get(k - 1).is_none_or(Option::is_none)) {
            let run = due_s.len()..end;
            let (course, sd) = smooth(&number[run.clone()], &beat_s[run.clone()]);
            squares += sd * sd * run.len() as f64;
            due_s.extend(course);
            runs.push(run);
        }
        if !due_s.windows(2).all(|b| b[0] < b[1]) {
            due_s = beat_s.to_vec();
        }
        Course {
            error_s: (squares / beat_s.len().max(1) as f64).sqrt(),
            due_s,
            number,
            runs,
        }
    }

    /// The beat's phase at `t_s`, 2π per beat, 0 on a beat; NaN before the first, after the last, and in pauses. A beat that is missing among
    /// others is counted.
    pub fn phase(&self, t_s: &[f64]) -> Vec<f64> {
        let of = |t: &f64| {
            let ended = |run: &Range<usize>| self.due_s[run.end - 1] < *t;
            let run = self.runs.get(self.runs.partition_point(ended));
            run.and_then(|run| self.turns(run, *t))
                .map_or(f64::NAN, |turns| TAU * turns)
        };
        t_s.iter().map(of).collect()
    }

    /// Beats since the first at `t_s`, within a run.
    fn turns(&self, run: &Range<usize>, t_s: f64) -> Option<f64> {
        let due_s = &self.due_s[run.clone()];
        let k = due_s.partition_point(|b| *b <= t_s).checked_sub(1)?;
        let number = &self.number[run.clone()];
        match due_s.get(k + 1) {
            Some(next) => {
                let share = (t_s - due_s[k]) / (next - due_s[k]);
                Some(number[k] + share * (number[k + 1] - number[k]))
            }
            None => (due_s[k] == t_s).then_some(number[k]),
        }
    }

    /// Beats per second over the part of a window in which they sound, and half its 95 % interval: advance over time. `None` below three beats.
    pub fn tempo(&self, window: Window) -> Option<(f64, f64)> {
        let (mut beats, mut sounds_s, mut parts) = (0.0, 0.0, 0.0);
        // Tempo at each end of a run where what sounds beyond it, up to a beat, is not seen.
        let mut ends_hz = Vec::new();
        for run in &self.runs {
            let from = window.start_s.max(self.due_s[run.start]);
            let to = window.end_s.min(self.due_s[run.end - 1]);
            if let (true, Some(a), Some(b)) =
                (from < to, self.turns(run, from), self.turns(run, to))
            {
                beats += b - a;
                sounds_s += to - from;
                parts += 1.0;
                let tempo_hz = |k: usize| {
                    (self.number[k + 1] - self.number[k]) / (self.due_s[k + 1] - self.due_s[k])
                };
                if window.start_s < from {
                    ends_hz.push(tempo_hz(run.start));
                }
                if to < window.end_s {
                    ends_hz.push(tempo_hz(run.end - 2));
                }
            }
        }
        let tempo_hz = beats / sounds_s;
        // Both ends of each part err by no more than a beat does.
        let half = 1.96 * tempo_hz * self.error_s * f64::sqrt(2.0 * parts) / sounds_s;
        let unseen: f64 = ends_hz.iter().map(|hz| (hz / tempo_hz - 1.0).abs()).sum();
        let half = half + unseen / sounds_s;
        let enough = window.range(&self.due_s).len() >= 3 && tempo_hz.is_finite();
        enough.then_some((tempo_hz, half))
    }
}

/// The phase of [`Course`] without numbers.
pub fn beat_phase(beat_s: &[f64], t_s: &[f64]) -> Vec<f64> {
    Course::of(beat_s, None).phase(t_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn beat_phase_counts_beats() {
        let beats = [1.0, 2.0, 3.0, 5.0, 6.0];
        let phase = beat_phase(&beats, &[0.5, 1.0, 1.5, 4.5, 6.0, 7.0]);
        assert!(phase[0].is_nan() && phase[5].is_nan());
        assert_eq!(phase[1..5], [0.0, 0.5 * TAU, 3.5 * TAU, 5.0 * TAU]);
        // Half as fast from 5 s on: nothing is missing there.
        let slower: Vec<f64> = (0..5).chain((7..17).step_by(2)).map(f64::from).collect();
        let held = beats_between(&slower, None);
        assert!(held[..4].iter().chain(&held[5..]).all(|b| *b == Some(1)));
        let paused = beat_phase(&[1.0, 2.0, 3.0, 4.0, 9.0, 10.0], &[4.0, 6.0, 9.0]);
        assert!(paused[0] == 3.0 * TAU && paused[1].is_nan() && paused[2] == 4.0 * TAU);
    }

    #[test]
    fn lost_beats_are_counted_and_loose_ones_straightened() {
        let all: Vec<f64> = (0..120).map(|k| 3.0 + f64::from(k) / 2.15).collect();
        let lost = |k: &usize| !(40..48).contains(k) && k % 9 != 4;
        let left: Vec<usize> = (0..120).filter(lost).collect();
        let beat_s: Vec<f64> = left.iter().map(|k| all[*k]).collect();
        let held = |of: &[Option<u32>]| of.iter().flatten().map(|n| *n as usize).sum::<usize>();
        assert_eq!(held(&beats_between(&beat_s, None)), 119);
        // A pause that is long, or ends off the beat; numbers know better.
        let late: Vec<f64> = beat_s
            .iter()
            .map(|t| t + if *t > 22.0 { 0.2 } else { 0.0 })
            .collect();
        let long: Vec<f64> = (0..120)
            .filter(|k| !(40..60).contains(k))
            .map(|k| all[k])
            .collect();
        for beat_s in [&late, &long] {
            let pauses = beats_between(beat_s, None)
                .into_iter()
                .filter(Option::is_none);
            assert_eq!(pauses.count(), 1);
        }
        let number: Vec<f64> = (0..120)
            .filter(|k| !(40..60).contains(k))
            .map(f64::from)
            .collect();
        assert_eq!(held(&beats_between(&long, Some(&number))), 119);
        // Nobody numbered them, or the drum was started anew on the way.
        for number in [
            vec![0.0; beat_s.len()],
            (0..beat_s.len()).map(|k| (k % 50) as f64).collect(),
        ] {
            let even: Vec<f64> = all[..beat_s.len()].to_vec();
            assert_eq!(held(&beats_between(&even, Some(&number))), even.len() - 1);
        }
        // A count that goes on through a pause as if none were.
        let on: Vec<f64> = (0..100).map(f64::from).collect();
        assert!(beats_between(&long, Some(&on)).contains(&None));
        let mut random = Random(3);
        let loose: Vec<f64> = beat_s.iter().map(|t| t + 0.005 * random.normal()).collect();
        let at: Vec<f64> = (0..500).map(|k| 4.0 + 0.1 * f64::from(k)).collect();
        let off = |(psi, t): (&f64, &f64)| (psi - TAU * 2.15 * (t - 3.0)).powi(2);
        let squares: f64 = beat_phase(&loose, &at).iter().zip(&at).map(off).sum();
        assert!(
            (squares / 500.0).sqrt() < 0.02,
            "{}",
            (squares / 500.0).sqrt()
        );
    }

    #[test]
    fn a_tempo_that_grows_is_its_mean_over_the_window() {
        // ν = 2 + t/60 Hz: the mean over 10 … 40 s is that at 25 s.
        let mut random = Random(8);
        let when = |n: f64| 60.0 * ((4.0 + n / 30.0).sqrt() - 2.0);
        let beat_s: Vec<f64> = (0..140)
            .map(|n| when(f64::from(n)) + 0.003 * random.normal())
            .collect();
        let (hz, half) = Course::of(&beat_s, None)
            .tempo(Window {
                start_s: 10.0,
                end_s: 40.0,
            })
            .unwrap();
        assert!(
            (hz - (2.0 + 25.0 / 60.0)).abs() < half && half < 0.001,
            "{hz} ± {half}"
        );
        // 1 Hz up to 20 s, 2 Hz after it and up to 40.4 s: 60.8 beats in 40.4 s, the last of them heard at 40 s.
        let beat_s: Vec<f64> = (0..20)
            .map(f64::from)
            .chain((0..=40).map(|k| 20.0 + 0.5 * f64::from(k)))
            .collect();
        let (hz, half) = Course::of(&beat_s, None).tempo(Window::ALL).unwrap();
        assert!(
            (hz - 60.8 / 40.4).abs() < half && half < 0.03,
            "{hz} ± {half}"
        );
    }
}

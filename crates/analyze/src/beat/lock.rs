//! How two rhythms keep step: the beat's phase, and the ratios that are looked at.

use crate::median::median;
use std::f64::consts::TAU;

/// Ratios looked at, p of the first to q of the second.
pub const RATIOS: [(u32, u32); 5] = [(1, 1), (1, 2), (2, 1), (2, 3), (3, 2)];

/// A gap between beats so many times the usual one is a pause.
const PAUSE: f64 = 2.5;
/// The usual gap is the median of so many before and after one: tempo changes.
const NEIGHBOURS: usize = 4;

/// How many beats each gap between beats holds, one where none is missing in it; `None` for a pause, in which nobody knows.
pub fn beats_between(beat_s: &[f64]) -> Vec<Option<u32>> {
    let gaps: Vec<f64> = beat_s.windows(2).map(|b| b[1] - b[0]).collect();
    let of = |k: usize| {
        let from = k.saturating_sub(NEIGHBOURS);
        let to = (k + NEIGHBOURS + 1).min(gaps.len());
        let mut near: Vec<f64> = [&gaps[from..k], &gaps[k + 1..to]].concat();
        let beats = gaps[k] / median(&mut near).unwrap_or(gaps[k]);
        // OK because it is between 1 and 2 then.
        (beats < PAUSE).then(|| beats.round().max(1.0) as u32)
    };
    (0..gaps.len()).map(of).collect()
}

/// The beat's phase at `t_s`, 2π per beat, 0 on a beat, straight between beats; NaN before the first, after the last, and in pauses. A beat that is
/// missing among others is counted.
pub fn beat_phase(beat_s: &[f64], t_s: &[f64]) -> Vec<f64> {
    let held = beats_between(beat_s);
    let mut number = vec![0.0];
    for beats in &held {
        number.push(number[number.len() - 1] + f64::from(beats.unwrap_or(1)));
    }
    t_s.iter()
        .map(|t| {
            let k = beat_s.partition_point(|b| b <= t);
            if k == 0 || k == beat_s.len() {
                // The last beat itself still belongs.
                return match beat_s.last() {
                    Some(last) if last == t => TAU * number[beat_s.len() - 1],
                    _ => f64::NAN,
                };
            }
            let gap_s = beat_s[k] - beat_s[k - 1];
            let share = (t - beat_s[k - 1]) / gap_s;
            match held[k - 1] {
                None if share > 0.0 => f64::NAN,
                beats => TAU * (number[k - 1] + share * f64::from(beats.unwrap_or(1))),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beat_phase_counts_beats() {
        let beats = [1.0, 2.0, 3.0, 5.0, 6.0];
        let phase = beat_phase(&beats, &[0.5, 1.0, 1.5, 4.5, 6.0, 7.0]);
        assert!(phase[0].is_nan() && phase[5].is_nan());
        assert_eq!(phase[1..5], [0.0, 0.5 * TAU, 3.5 * TAU, 5.0 * TAU]);
        // Half as fast from 5 s on: nothing is missing there.
        let slower: Vec<f64> = (0..5).chain((7..17).step_by(2)).map(f64::from).collect();
        let held = beats_between(&slower);
        assert!(held[..4].iter().chain(&held[5..]).all(|b| *b == Some(1)));
        let paused = beat_phase(&[1.0, 2.0, 3.0, 4.0, 9.0, 10.0], &[4.0, 6.0, 9.0]);
        assert!(paused[0] == 3.0 * TAU && paused[1].is_nan() && paused[2] == 4.0 * TAU);
    }
}

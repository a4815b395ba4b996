//! How two rhythms keep step: the beat's phase, and the ratios that are looked at.

use crate::median::median;
use std::f64::consts::TAU;

/// Ratios looked at, p of the first to q of the second.
pub const RATIOS: [(u32, u32); 5] = [(1, 1), (1, 2), (2, 1), (2, 3), (3, 2)];

/// A gap between beats so many times the usual one is a pause.
const PAUSE: f64 = 2.5;

/// The beat's phase at `t_s`, 2π per beat, 0 on a beat, straight between beats; NaN before the first, after the last, and in pauses.
pub fn beat_phase(beat_s: &[f64], t_s: &[f64]) -> Vec<f64> {
    let mut gaps: Vec<f64> = beat_s.windows(2).map(|b| b[1] - b[0]).collect();
    let longest_s = median(&mut gaps).map_or(f64::INFINITY, |usual| PAUSE * usual);
    t_s.iter()
        .map(|t| {
            let k = beat_s.partition_point(|b| b <= t);
            if k == 0 || k == beat_s.len() {
                // The last beat itself still belongs.
                return match beat_s.last() {
                    Some(last) if last == t => TAU * (beat_s.len() - 1) as f64,
                    _ => f64::NAN,
                };
            }
            let gap_s = beat_s[k] - beat_s[k - 1];
            let share = (t - beat_s[k - 1]) / gap_s;
            if gap_s > longest_s && share > 0.0 {
                return f64::NAN;
            }
            TAU * ((k - 1) as f64 + share)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beat_phase_counts_beats() {
        let phase = beat_phase(&[1.0, 2.0, 4.0], &[0.5, 1.0, 1.5, 3.0, 4.0, 5.0]);
        assert!(phase[0].is_nan() && phase[5].is_nan());
        assert_eq!(phase[1..5], [0.0, 0.5 * TAU, 1.5 * TAU, 2.0 * TAU]);
        let paused = beat_phase(&[1.0, 2.0, 3.0, 4.0, 9.0, 10.0], &[4.0, 6.0, 9.0]);
        assert!(paused[0] == 3.0 * TAU && paused[1].is_nan() && paused[2] == 4.0 * TAU);
    }
}

//! How two rhythms keep step: the beat's phase, and p:q locking.

use crate::median::median;
use crate::phase::relative_phase;
use std::f64::consts::TAU;

/// Ratios looked at, p of the first to q of the second.
pub const RATIOS: [(u32, u32); 5] = [(1, 1), (1, 2), (2, 1), (2, 3), (3, 2)];

/// How firmly one ratio of phases holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lock {
    /// Cycles of the second per q … of the first per p: p φ = q ψ + constant.
    pub p: u32,
    /// See `p`.
    pub q: u32,
    /// |⟨exp i(pφ − qψ)⟩|, 0 … 1.
    pub resultant: f64,
    /// Share of surrogates that hold at least as firmly: the false-alarm rate of calling this a lock.
    pub p_value: f64,
}

/// Every ratio of [`RATIOS`] for two unwrapped phases on one even time axis, rad.
///
/// Surrogates keep each phase's increments but shuffle the first's in segments of `segment` samples: the same tempo and
/// wobble, no bond. p-values are (1 + number at least as firm) / (1 + draws). Empty for fewer than four segments.
pub fn locks(
    phi_rad: &[f64],
    psi_rad: &[f64],
    segment: usize,
    draws: usize,
    seed: u64,
) -> Vec<Lock> {
    let n = phi_rad.len().min(psi_rad.len());
    let segments = n.saturating_sub(1) / segment.max(1);
    if segments < 4 {
        return Vec::new();
    }
    let n = segments * segment + 1;
    let (phi, psi) = (&phi_rad[..n], &psi_rad[..n]);
    let firm = |phi: &[f64], (p, q): (u32, u32)| {
        relative_phase(phi, psi, p.into(), q.into()).map_or(0.0, |c| c.resultant)
    };
    let observed: Vec<f64> = RATIOS.iter().map(|r| firm(phi, *r)).collect();
    let mut above = [0usize; RATIOS.len()];
    let mut state = seed;
    let mut order: Vec<usize> = (0..segments).collect();
    for _ in 0..draws {
        for i in (1..segments).rev() {
            order.swap(i, (next(&mut state) % (i as u64 + 1)) as usize);
        }
        let mut shuffled = vec![0.0; n];
        for (place, &from) in order.iter().enumerate() {
            for k in 0..segment {
                let increment = phi[from * segment + k + 1] - phi[from * segment + k];
                shuffled[place * segment + k + 1] = shuffled[place * segment + k] + increment;
            }
        }
        for ((ratio, seen), count) in RATIOS.iter().zip(&observed).zip(&mut above) {
            if firm(&shuffled, *ratio) >= *seen {
                *count += 1;
            }
        }
    }
    RATIOS
        .iter()
        .zip(observed)
        .zip(above)
        .map(|((&(p, q), resultant), above)| Lock {
            p,
            q,
            resultant,
            p_value: (1 + above) as f64 / (1 + draws) as f64,
        })
        .collect()
}

/// SplitMix64.
fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

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
    fn a_half_tempo_walker_is_locked_one_to_two() {
        let mut state = 3;
        let mut wobble = 0.0;
        let (mut phi, mut psi, mut free) = (vec![], vec![], vec![]);
        for k in 0..6000 {
            let t = f64::from(k) * 0.01;
            wobble += 0.02 * ((next(&mut state) >> 11) as f64 / (1u64 << 53) as f64 - 0.5);
            psi.push(TAU * 2.15 * t + wobble);
            phi.push(0.5 * psi[psi.len() - 1] + 0.3);
            free.push(TAU * 1.7 * t);
        }
        let found = locks(&phi, &psi, 100, 199, 1);
        let half = found.iter().find(|l| (l.p, l.q) == (2, 1)).unwrap();
        assert!(half.resultant > 0.999 && half.p_value <= 0.005, "{half:?}");
        let loose = locks(&free, &psi, 100, 199, 1);
        assert!(loose.iter().all(|l| l.resultant < 0.2), "{loose:?}");
    }

    #[test]
    fn beat_phase_counts_beats() {
        let phase = beat_phase(&[1.0, 2.0, 4.0], &[0.5, 1.0, 1.5, 3.0, 4.0, 5.0]);
        assert!(phase[0].is_nan() && phase[5].is_nan());
        assert_eq!(phase[1..5], [0.0, 0.5 * TAU, 1.5 * TAU, 2.0 * TAU]);
        let paused = beat_phase(&[1.0, 2.0, 3.0, 4.0, 9.0, 10.0], &[4.0, 6.0, 9.0]);
        assert!(paused[0] == 3.0 * TAU && paused[1].is_nan() && paused[2] == 4.0 * TAU);
    }
}

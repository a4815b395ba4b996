//! How carriers stand to the beat: Adler's test, and p:q locking.
//!
//! ```text
//! Δ = φ − ψ,     dΔ/dt = Δω − K sin(Δ − Δ₀)
//! ```
//! φ the carrier's phase, ψ the beat's (rad), Δω what the carrier would do alone minus the beat [rad/s], K the pull of the
//! music [rad/s], Δ₀ where a carrier without detuning would settle (the detector's constant offset is in it). For |Δω| ≤ K
//! the carrier is captured; outside it slips. Δω, K and Δ₀ are found by least squares from increments of Δ, so only a
//! transient or slips show K: a carrier that has long settled says only that |Δω| ≤ K.
//! Source: R. Adler, "A study of locking phenomena in oscillators", Proc. IRE 34 (1946); Pikovsky, Rosenblum, Kurths,
//! Synchronization (2001), ch. 7.

use crate::phase::relative_phase;
use std::f64::consts::TAU;

/// What a relative phase says about capture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adler {
    /// Δω, rad/s.
    pub detuning_rad_per_s: f64,
    /// Its standard error, rad/s.
    pub detuning_sd_rad_per_s: f64,
    /// K ≥ 0, rad/s.
    pub coupling_rad_per_s: f64,
    /// Its standard error, rad/s.
    pub coupling_sd_rad_per_s: f64,
    /// Δ₀, rad.
    pub offset_rad: f64,
    /// |Δω| ≤ K.
    pub captured: bool,
}

/// Step over which increments of Δ are taken, s: long against noise, short against 1/K.
const INCREMENT_S: f64 = 0.2;

/// Adler's test on a relative phase Δ (unwrapped, rad) at even times (s); samples that are not finite are passed over.
///
/// `None` below 20 increments, or when Δ stays within a third of a radian all the time: K and Δω cannot be told apart then.
pub fn adler(t_s: &[f64], delta_rad: &[f64]) -> Option<Adler> {
    let step = crate::imu::track::period_s(t_s)?;
    let hop = (INCREMENT_S / step).round().max(1.0) as usize;
    let n = t_s.len().min(delta_rad.len());
    let (mut rows, mut low, mut high) = (Vec::new(), f64::MAX, f64::MIN);
    for i in (0..n.saturating_sub(hop)).step_by(hop) {
        let (a, b) = (delta_rad[i], delta_rad[i + hop]);
        let dt_s = t_s[i + hop] - t_s[i];
        if a.is_finite() && b.is_finite() && dt_s < 2.0 * INCREMENT_S.max(step) {
            let middle = 0.5 * (a + b);
            rows.push(([1.0, middle.sin(), middle.cos()], (b - a) / dt_s));
            (low, high) = (low.min(middle), high.max(middle));
        }
    }
    if rows.len() < 20 || high - low < 1.0 / 3.0 {
        return None;
    }
    let mut normal = nalgebra::Matrix3::zeros();
    let mut right = nalgebra::Vector3::zeros();
    for (x, y) in &rows {
        let x = nalgebra::Vector3::from(*x);
        normal += x * x.transpose();
        right += x * *y;
    }
    let inverse = normal.try_inverse()?;
    let w = inverse * right;
    let squares: f64 = rows
        .iter()
        .map(|(x, y)| (y - w.dot(&nalgebra::Vector3::from(*x))).powi(2))
        .sum();
    let variance = squares / (rows.len() - 3) as f64;
    let coupling = w[1].hypot(w[2]);
    // −K sin(Δ−Δ₀) = −K cosΔ₀ sinΔ + K sinΔ₀ cosΔ
    let along = [w[1] / coupling.max(1e-300), w[2] / coupling.max(1e-300)];
    let coupling_variance = variance
        * (along[0] * along[0] * inverse[(1, 1)]
            + 2.0 * along[0] * along[1] * inverse[(1, 2)]
            + along[1] * along[1] * inverse[(2, 2)]);
    Some(Adler {
        detuning_rad_per_s: w[0],
        detuning_sd_rad_per_s: (variance * inverse[(0, 0)]).max(0.0).sqrt(),
        coupling_rad_per_s: coupling,
        coupling_sd_rad_per_s: coupling_variance.max(0.0).sqrt(),
        offset_rad: w[2].atan2(-w[1]),
        captured: w[0].abs() <= coupling,
    })
}

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

/// The beat's phase at `t_s`, 2π per beat, 0 on a beat, straight between beats; NaN before the first and after the last.
pub fn beat_phase(beat_s: &[f64], t_s: &[f64]) -> Vec<f64> {
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
            let share = (t - beat_s[k - 1]) / (beat_s[k] - beat_s[k - 1]);
            TAU * ((k - 1) as f64 + share)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Adler's equation by small steps.
    fn path(detuning: f64, coupling: f64, offset: f64, start: f64) -> (Vec<f64>, Vec<f64>) {
        let (mut delta, dt) = (start, 1e-3);
        let (mut t_s, mut out) = (Vec::new(), Vec::new());
        for k in 0..40_000 {
            if k % 20 == 0 {
                t_s.push(f64::from(k) * dt);
                out.push(delta);
            }
            delta += dt * (detuning - coupling * (delta - offset).sin());
        }
        (t_s, out)
    }

    #[test]
    fn adlers_equation_gives_back_its_parameters() {
        for (detuning, coupling, captured) in
            [(0.3, 1.0, true), (0.9, 0.5, false), (-0.6, 0.61, true)]
        {
            let (t, delta) = path(detuning, coupling, 0.4, 2.8);
            let a = adler(&t, &delta).unwrap();
            assert!((a.detuning_rad_per_s - detuning).abs() < 0.01, "{a:?}");
            assert!((a.coupling_rad_per_s - coupling).abs() < 0.01, "{a:?}");
            assert!((a.offset_rad - 0.4).abs() < 0.02, "{a:?}");
            assert_eq!(a.captured, captured);
        }
    }

    #[test]
    fn a_settled_carrier_cannot_tell_its_coupling() {
        let (t, delta) = path(0.3, 1.0, 0.0, 0.3047);
        assert_eq!(adler(&t, &delta), None);
    }

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
    }
}

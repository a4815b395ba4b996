//! Height from vertical acceleration, without drift.
//!
//! ```text
//! z = argmin Σ ( (z_{i−1} − 2 z_i + z_{i+1})/Δt² − (a_{i−1} + 10 a_i + a_{i+1})/12 )² + ω₀⁴ Σ z_i²
//! |Z/A| = (1/ω²) · 1 / (1 + (f₀/f)⁴)
//! ```
//! a vertical acceleration [m/s²], z height about its slow course (m), Δt step (s), ω₀ = 2πf₀. Integrating twice lets the
//! smallest bias grow with t²; the second term holds what is slower than f₀ at zero. It is the zero-phase second-order
//! Butterworth high-pass, but its ends are free: nothing is reflected or padded there, and no transient rings.
//!
//! Valid band: 0.3 Hz (1.2 % low with f₀ = 0.1 Hz) to a tenth of the sampling rate and 10 Hz at most (Numerov's weights: error (ωΔt)⁴/240).
//! The height's mean and its slow changes are not in it. Source: Numerov (1924) for the weights; Whittaker (1923) for
//! smoothing by least squares.

use crate::median::median;
use std::f64::consts::TAU;

/// Corner below which height is held at zero, Hz.
pub const CORNER_HZ: f64 = 0.1;

/// Frequencies at which the height is meant to be used, Hz.
pub const VALID_BAND_HZ: [f64; 2] = [0.3, 10.0];

/// Height about its slow course, m, from evenly spaced vertical accelerations (gravity removed), m/s².
///
/// Fewer than three samples give zeros. A constant acceleration (a bias) gives nearly nothing away from the ends.
pub fn height(accel_up_m_per_s2: &[f64], period_s: f64, corner_hz: f64) -> Vec<f64> {
    let trust = vec![1.0; accel_up_m_per_s2.len()];
    weighted(accel_up_m_per_s2, &trust, period_s, corner_hz)
}

/// The same where some accelerations are known to `unsure_m_per_s2` (standard deviation of each) only, others (0) as well as usual.
///
/// ```text
/// Σ w_i ( … )² + ω₀⁴ Σ z_i²,    w = 1/(1 + (u/(ω₀² s))²),    s² = σ²/(2 f₀ Δt)
/// ```
/// The second term holds z as heights of deviation s would be held, each for itself, against accelerations as sure as ω₀² s; and s is what has as much
/// between f₀ and 2f₀ as z has there, σ. What is unsure then follows from what the height did before and after: where little of it is slow, a slow course that
/// begins in a hole is none.
pub fn height_where_sure(
    accel_up_m_per_s2: &[f64],
    unsure_m_per_s2: &[f64],
    period_s: f64,
    corner_hz: f64,
) -> Vec<f64> {
    if unsure_m_per_s2.iter().all(|u| *u == 0.0) {
        return height(accel_up_m_per_s2, period_s, corner_hz);
    }
    let mut trust = vec![1.0; accel_up_m_per_s2.len()];
    for _ in 0..ROUNDS {
        let [all, faster] = [corner_hz, 2.0 * corner_hz]
            .map(|hz| weighted(accel_up_m_per_s2, &trust, period_s, hz));
        let slow = all.iter().zip(&faster).map(|(a, b)| (a - b).abs());
        let amounts = all.iter().map(|z| z.abs());
        // The free ends swing, and behind a hole may.
        let [slow, most] = [slow.collect(), amounts.collect()]
            .map(|mut x: Vec<f64>| median(&mut x).unwrap_or(0.0) / NORMAL);
        let square = slow.max(LEAST_SLOW * most).powi(2);
        let usual = (TAU * corner_hz).powi(4) * square / (2.0 * corner_hz * period_s);
        if usual > 0.0 {
            let each = trust.iter_mut().zip(unsure_m_per_s2);
            each.for_each(|(w, u)| *w = usual / (usual + u * u));
        }
    }
    weighted(accel_up_m_per_s2, &trust, period_s, corner_hz)
}

/// The median of a normal number's amount.
const NORMAL: f64 = 0.6745;
/// A slow course that holes made goes into what is taken for slow at first.
const ROUNDS: usize = 3;
/// So much of a motion is taken for slow at least: with less a hole would be bent until it took from the motion itself.
const LEAST_SLOW: f64 = 0.05;

fn weighted(a: &[f64], trust: &[f64], period_s: f64, corner_hz: f64) -> Vec<f64> {
    let n = a.len();
    if n < 3 {
        return vec![0.0; n];
    }
    let dt2 = period_s * period_s;
    let hold = (TAU * corner_hz * period_s).powi(4);
    // Each difference is as sure as the least sure of its three samples.
    let trust: Vec<f64> = trust.windows(3).map(|w| w[0].min(w[1]).min(w[2])).collect();
    let bend: Vec<f64> = a
        .windows(3)
        .zip(&trust)
        .map(|(w, trust)| (w[0] + 10.0 * w[1] + w[2]) / 12.0 * dt2 * trust)
        .collect();
    let rhs = second_difference_transposed(&bend, n);
    let solver = Pentadiagonal::new(&trust, hold);
    let mut z = solver.solve(rhs.clone());
    // The matrix is badly conditioned (ω₀Δt to the fourth); two refinements bring back the digits.
    for _ in 0..2 {
        let curve: Vec<f64> = z
            .windows(3)
            .zip(&trust)
            .map(|(w, trust)| (w[0] - 2.0 * w[1] + w[2]) * trust)
            .collect();
        let mut residual = second_difference_transposed(&curve, n);
        for ((r, b), z) in residual.iter_mut().zip(&rhs).zip(&z) {
            *r = b - *r - hold * z;
        }
        for (z, correction) in z.iter_mut().zip(solver.solve(residual)) {
            *z += correction;
        }
    }
    z
}

/// Dᵀ v with D the (n−2)×n matrix of second differences.
fn second_difference_transposed(v: &[f64], n: usize) -> Vec<f64> {
    let mut out = vec![0.0; n];
    for (i, x) in v.iter().enumerate() {
        out[i] += x;
        out[i + 1] -= 2.0 * x;
        out[i + 2] += x;
    }
    out
}

/// L D Lᵀ of DᵀWD + hold·I, W the trust in each difference, a symmetric matrix with two diagonals on either side.
struct Pentadiagonal {
    d: Vec<f64>,
    l1: Vec<f64>,
    l2: Vec<f64>,
}

impl Pentadiagonal {
    fn new(trust: &[f64], hold: f64) -> Self {
        let n = trust.len() + 2;
        let (mut main, mut first, mut second) = (vec![hold; n], vec![0.0; n], vec![0.0; n]);
        for (i, w) in trust.iter().enumerate() {
            main[i] += w;
            main[i + 1] += 4.0 * w;
            main[i + 2] += w;
            first[i] -= 2.0 * w;
            first[i + 1] -= 2.0 * w;
            second[i] += w;
        }
        let (mut d, mut l1, mut l2) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        for i in 0..n {
            let mut pivot = main[i];
            let mut next = first[i];
            if i >= 1 {
                pivot -= l1[i - 1] * l1[i - 1] * d[i - 1];
                next -= l2[i - 1] * l1[i - 1] * d[i - 1];
            }
            if i >= 2 {
                pivot -= l2[i - 2] * l2[i - 2] * d[i - 2];
            }
            // Positive definite by hold; rounding may not take that away.
            d[i] = pivot.max(hold * 1e-3).max(f64::MIN_POSITIVE);
            l1[i] = next / d[i];
            l2[i] = second[i] / d[i];
        }
        Self { d, l1, l2 }
    }

    fn solve(&self, mut x: Vec<f64>) -> Vec<f64> {
        let n = x.len();
        for i in 0..n {
            if i >= 1 {
                x[i] -= self.l1[i - 1] * x[i - 1];
            }
            if i >= 2 {
                x[i] -= self.l2[i - 2] * x[i - 2];
            }
        }
        for i in 0..n {
            x[i] /= self.d[i];
        }
        for i in (0..n).rev() {
            if i + 1 < n {
                x[i] -= self.l1[i] * x[i + 1];
            }
            if i + 2 < n {
                x[i] -= self.l2[i] * x[i + 2];
            }
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_comes_back_with_the_stated_gain() {
        let dt = 0.005;
        for hz in [0.3, 1.0, 2.15, 10.0] {
            let w = TAU * hz;
            let n = (60.0 / dt) as usize;
            let a: Vec<f64> = (0..n).map(|i| -w * w * (w * i as f64 * dt).sin()).collect();
            let z = height(&a, dt, CORNER_HZ);
            let gain = 1.0 / (1.0 + (CORNER_HZ / hz).powi(4));
            let worst = (n / 3..2 * n / 3)
                .map(|i| (z[i] - gain * (w * i as f64 * dt).sin()).abs())
                .fold(0.0, f64::max);
            assert!(worst < 1.5e-3, "{hz} Hz: {worst}");
        }
    }

    #[test]
    fn a_bias_does_not_grow() {
        let z = height(&[0.05; 12_000], 0.005, CORNER_HZ);
        // Held: a/ω₀⁴ times nothing in the middle; the free ends see a/ω₀² at most.
        let corner = TAU * CORNER_HZ;
        assert!(z[3000..9000].iter().all(|z| z.abs() < 1e-3));
        assert!(z.iter().all(|z| z.abs() < 1.5 * 0.05 / (corner * corner)));
    }

    /// An impulse that nothing felt, where accelerations are unsure, does not move the height; where they are sure it does.
    #[test]
    fn what_is_unsure_follows_from_its_neighbours() {
        let (dt, w) = (0.005, TAU * 2.0);
        let n = 8000;
        let truth: Vec<f64> = (0..n).map(|i| 0.05 * (w * i as f64 * dt).sin()).collect();
        let mut a: Vec<f64> = truth.iter().map(|z| -w * w * z).collect();
        let hole = 4000..4010;
        a[hole.clone()].iter_mut().for_each(|a| *a += 2.0);
        let mut unsure = vec![0.0; n];
        let worst = |unsure: &[f64]| {
            let z = height_where_sure(&a, unsure, dt, 0.2);
            let off = (1000..7000).map(|i| (z[i] - truth[i]).abs());
            off.fold(0.0, f64::max)
        };
        let moved = worst(&unsure);
        unsure[hole].fill(2.0 * 10f64.sqrt());
        let held = worst(&unsure);
        // 0.1 m/s for about 1/ω₀.
        assert!((0.02..0.08).contains(&moved), "{moved}");
        assert!(held < 0.1 * moved, "{held} {moved}");
    }

    /// What a jolt in a hole moves the height by falls with how unsure it is; where nothing is known, it moves nothing.
    #[test]
    fn the_less_sure_the_less_it_moves() {
        let (dt, w) = (0.005, TAU * 2.0);
        let n = 8000;
        let truth: Vec<f64> = (0..n).map(|i| 0.05 * (w * i as f64 * dt).sin()).collect();
        let hole = 4000..4010;
        let off = |jolt: f64, unsure_m_per_s2: f64| {
            let mut a: Vec<f64> = truth.iter().map(|z| -w * w * z).collect();
            a[hole.clone()].iter_mut().for_each(|a| *a += jolt);
            let mut unsure = vec![0.0; n];
            unsure[hole.clone()].fill(unsure_m_per_s2);
            let z = height_where_sure(&a, &unsure, dt, 0.2);
            let off = (1000..7000).map(|i| (z[i] - truth[i]).abs());
            off.fold(0.0, f64::max)
        };
        let moved = [0.0, 0.03, 0.1, 0.3, 1.0, 10.0].map(|unsure| off(2.0, unsure));
        assert!(moved.windows(2).all(|m| m[1] < m[0]), "{moved:?}");
        // What is left is the bend that nobody knows.
        let [some, much] = [0.0, 100.0].map(|jolt| off(jolt, 1e6));
        assert!((much - some).abs() < 1e-6, "{some} {much}");
    }

    /// The same as from the normal equations as they stand, dense.
    #[test]
    fn bands_are_the_normal_equations() {
        use crate::random::Random;
        use nalgebra::{DMatrix, DVector};
        let (n, dt, corner_hz) = (40, 0.01, 0.5);
        let mut random = Random(4);
        let a: Vec<f64> = (0..n).map(|_| random.normal()).collect();
        let trust: Vec<f64> = (0..n).map(|i| [1.0, 0.3, 1e-3][i * i % 7 % 3]).collect();
        let d = DMatrix::from_fn(n - 2, n, |r, c| match c.checked_sub(r) {
            Some(0 | 2) => 1.0,
            Some(1) => -2.0,
            _ => 0.0,
        });
        let least = |r: usize| trust[r..r + 3].iter().copied().fold(1.0, f64::min);
        let w = DMatrix::from_diagonal(&DVector::from_fn(n - 2, |r, _| least(r)));
        let felt = DVector::from_fn(n - 2, |r, _| {
            (a[r] + 10.0 * a[r + 1] + a[r + 2]) / 12.0 * dt * dt
        });
        let hold = DMatrix::identity(n, n) * (TAU * corner_hz * dt).powi(4);
        let normal = d.transpose() * &w * &d + hold;
        let dense = normal.lu().solve(&(d.transpose() * w * felt)).unwrap();
        let found = weighted(&a, &trust, dt, corner_hz);
        let size = dense.amax();
        for (a, b) in found.iter().zip(dense.iter()) {
            assert!((a - b).abs() < 1e-8 * size, "{a} {b}");
        }
    }

    /// At 1 kHz the condition is 10¹⁴: what one solution leaves of the digits the refinements bring back.
    #[test]
    fn fast_samples_keep_their_digits() {
        let (dt, w) = (0.001, TAU * 2.0);
        let n = 60_000;
        let a: Vec<f64> = (0..n).map(|i| -w * w * (w * i as f64 * dt).sin()).collect();
        let z = height(&a, dt, 0.1);
        let gain = 1.0 / (1.0 + (0.1f64 / 2.0).powi(4));
        let off = (n / 3..2 * n / 3).map(|i| (z[i] - gain * (w * i as f64 * dt).sin()).abs());
        let worst = off.fold(0.0, f64::max);
        assert!(worst < 1e-5, "{worst}");
    }

    #[test]
    fn very_short_input_is_not_an_error() {
        assert_eq!(height(&[1.0, 2.0], 0.01, 0.1), [0.0, 0.0]);
        assert!(
            height(&[1.0, 2.0, 3.0], 0.01, 0.1)
                .iter()
                .all(|z| z.is_finite())
        );
    }
}

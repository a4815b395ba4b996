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
//! Valid band: 0.3 Hz (1.2 % low with f₀ = 0.1 Hz) to a tenth of the sampling rate (Numerov's weights: error (ωΔt)⁴/240).
//! The height's mean and its slow changes are not in it. Source: Numerov (1924) for the weights; Whittaker (1923) for
//! smoothing by least squares.

/// Corner below which height is held at zero, Hz.
pub const CORNER_HZ: f64 = 0.1;

/// Frequencies at which the height is meant to be used, Hz.
pub const VALID_BAND_HZ: [f64; 2] = [0.3, 10.0];

/// Height about its slow course, m, from evenly spaced vertical accelerations (gravity removed), m/s².
///
/// Fewer than three samples give zeros. A constant acceleration (a bias) gives nearly nothing away from the ends.
pub fn height(accel_up_m_per_s2: &[f64], period_s: f64, corner_hz: f64) -> Vec<f64> {
    let a = accel_up_m_per_s2;
    let n = a.len();
    if n < 3 {
        return vec![0.0; n];
    }
    let dt2 = period_s * period_s;
    let hold = (std::f64::consts::TAU * corner_hz * period_s).powi(4);
    let bend: Vec<f64> = a
        .windows(3)
        .map(|w| (w[0] + 10.0 * w[1] + w[2]) / 12.0 * dt2)
        .collect();
    let rhs = second_difference_transposed(&bend, n);
    let solver = Pentadiagonal::new(n, hold);
    let mut z = solver.solve(rhs.clone());
    // The matrix is badly conditioned (ω₀Δt to the fourth); two refinements bring back the digits.
    for _ in 0..2 {
        let curve: Vec<f64> = z.windows(3).map(|w| w[0] - 2.0 * w[1] + w[2]).collect();
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

/// L D Lᵀ of DᵀD + hold·I, a symmetric matrix with two diagonals on either side.
struct Pentadiagonal {
    d: Vec<f64>,
    l1: Vec<f64>,
    l2: Vec<f64>,
}

impl Pentadiagonal {
    fn new(n: usize, hold: f64) -> Self {
        let (mut main, mut first, mut second) = (vec![hold; n], vec![0.0; n], vec![0.0; n]);
        for i in 0..n - 2 {
            main[i] += 1.0;
            main[i + 1] += 4.0;
            main[i + 2] += 1.0;
            first[i] -= 2.0;
            first[i + 1] -= 2.0;
            second[i] += 1.0;
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
    use std::f64::consts::TAU;

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

//! Cubic splines through samples, and which times they were taken at.

use crate::median::median;

/// First and second derivatives of what was sampled at `t_s`, without a hole, at the samples; `None` below four.
///
/// Times are often written more coarsely than samples were taken (to the millisecond, or when they arrived), or samples fell where they are said to be and
/// some are lost. The motion tells which: of the times as written and the same on an even axis the ones that make it smoother, Σ (ΔM)²/Δt of
/// [`spline_derivatives`], are right.
pub fn derivatives(t_s: &[f64], x: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
    let even = on_even_axis(t_s)?;
    let found = spline_derivatives(&even, x)?;
    let step_s = even[even.len() - 1] / (even.len() - 1) as f64;
    let off_s = t_s.iter().zip(&even).map(|(t, e)| (t - t_s[0] - e).abs());
    if off_s.fold(0.0, f64::max) < 1e-6 * step_s {
        return Some(found);
    }
    let rough = |t_s: &[f64], m: &[f64]| -> f64 {
        let bend = m.windows(2).zip(t_s.windows(2));
        bend.map(|(m, t)| (m[1] - m[0]).powi(2) / (t[1] - t[0]))
            .sum()
    };
    let other = spline_derivatives(t_s, x)?;
    // Two samples at one time leave no number.
    Some(match rough(t_s, &other.1) < rough(&even, &found.1) {
        true => other,
        false => found,
    })
}

/// Times from the first on an even axis, each step the nearest whole number of usual ones; where two fall on one place, by their count. `None` below two.
fn on_even_axis(t_s: &[f64]) -> Option<Vec<f64>> {
    let mut steps: Vec<f64> = t_s.windows(2).map(|w| w[1] - w[0]).collect();
    let usual_s = median(&mut steps)?;
    let places = t_s.windows(2).map(|w| ((w[1] - w[0]) / usual_s).round());
    let apart = places.clone().all(|step| step >= 1.0);
    let mut place = 0.0;
    let mut out = vec![0.0];
    for step in places {
        place += if apart { step } else { 1.0 };
        out.push(place);
    }
    let step_s = (t_s[t_s.len() - 1] - t_s[0]) / place;
    out.iter_mut().for_each(|t| *t *= step_s);
    Some(out)
}

/// First and second derivatives at the knots of the cubic spline through values at ascending times, with not-a-knot ends
/// (`scipy.interpolate.CubicSpline`). `None` below four values.
///
/// ```text
/// h_{k−1} M_{k−1} + 2 (h_{k−1} + h_k) M_k + h_k M_{k+1} = 6 (d_k − d_{k−1}),   h_k = t_{k+1} − t_k,   d_k = (y_{k+1} − y_k)/h_k
/// M₀ = M₁ − (M₂ − M₁) h₀/h₁, likewise at the end;   y'_k = d_k − h_k (2M_k + M_{k+1}) / 6
/// ```
/// t (s), y [unit], M the second derivatives [unit/s²]. Source: de Boor, A Practical Guide to Splines (1978), ch. IV.
pub fn spline_derivatives(t_s: &[f64], y: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
    let n = y.len();
    if n < 4 || t_s.len() != n {
        return None;
    }
    let h: Vec<f64> = t_s.windows(2).map(|t| t[1] - t[0]).collect();
    let slope = |k: usize| (y[k + 1] - y[k]) / h[k];
    // What not-a-knot adds to the outermost equations, of the end's own step and the next.
    let own = |end: f64, next: f64| end + end * end / next;
    let (mut diagonal, mut m) = (vec![0.0; n], vec![0.0; n]);
    let mut upper = vec![0.0; n];
    // Thomas' algorithm on 1 … n − 2.
    for k in 1..n - 1 {
        diagonal[k] = 2.0 * (h[k - 1] + h[k]);
        m[k] = 6.0 * (slope(k) - slope(k - 1));
        upper[k] = h[k];
        let mut lower = h[k - 1];
        if k == 1 {
            diagonal[k] += own(h[0], h[1]);
            upper[k] -= h[0] * h[0] / h[1];
        }
        if k == n - 2 {
            diagonal[k] += own(h[k], h[k - 1]);
            lower -= h[k] * h[k] / h[k - 1];
        }
        if k > 1 {
            let part = lower / diagonal[k - 1];
            diagonal[k] -= part * upper[k - 1];
            m[k] -= part * m[k - 1];
        }
    }
    m[n - 2] /= diagonal[n - 2];
    for k in (1..n - 2).rev() {
        m[k] = (m[k] - upper[k] * m[k + 1]) / diagonal[k];
    }
    m[0] = m[1] - (m[2] - m[1]) * h[0] / h[1];
    m[n - 1] = m[n - 2] + (m[n - 2] - m[n - 3]) * h[n - 2] / h[n - 3];
    let mut rate: Vec<f64> = (0..n - 1)
        .map(|k| slope(k) - h[k] * (2.0 * m[k] + m[k + 1]) / 6.0)
        .collect();
    rate.push(slope(n - 2) + h[n - 2] * (m[n - 2] + 2.0 * m[n - 1]) / 6.0);
    Some((rate, m))
}

/// The cubic spline through `y` at `t_s` at ascending times within them; `None` as [`spline_derivatives`].
pub fn resampled(t_s: &[f64], y: &[f64], at_s: &[f64]) -> Option<Vec<f64>> {
    let (_, m) = spline_derivatives(t_s, y)?;
    let mut k = 0;
    let value = |&at: &f64| {
        while k + 2 < t_s.len() && t_s[k + 1] <= at {
            k += 1;
        }
        let h = t_s[k + 1] - t_s[k];
        let (a, b) = ((t_s[k + 1] - at) / h, (at - t_s[k]) / h);
        let bend = (a * a * a - a) * m[k] + (b * b * b - b) * m[k + 1];
        a * y[k] + b * y[k + 1] + bend * h * h / 6.0
    };
    Some(at_s.iter().map(value).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn cubic(t: f64) -> f64 {
        t.powi(3) - 2.0 * t
    }

    #[test]
    fn a_cubic_is_its_own_spline() {
        // Steps of any length.
        let t_s: Vec<f64> = (0..30)
            .map(|k| 0.1 * f64::from(k) + 0.04 * f64::from(k * k % 7 % 3))
            .collect();
        let y: Vec<f64> = t_s.iter().copied().map(cubic).collect();
        let (d1, d2) = spline_derivatives(&t_s, &y).unwrap();
        for (k, t) in t_s.iter().enumerate() {
            assert!(
                (d1[k] - (3.0 * t * t - 2.0)).abs() < 1e-10 && (d2[k] - 6.0 * t).abs() < 1e-9,
                "{k}"
            );
        }
        let between: Vec<f64> = (0..291).map(|k| 0.01 * f64::from(k)).collect();
        for (at, y) in between.iter().zip(resampled(&t_s, &y, &between).unwrap()) {
            assert!((y - cubic(*at)).abs() < 1e-12, "{at}");
        }
        for n in 4..8 {
            let (d1, _) = spline_derivatives(&t_s[..n], &y[..n]).unwrap();
            assert!((d1[0] + 2.0).abs() < 1e-10 && d1.len() == n);
        }
        assert_eq!(spline_derivatives(&t_s[..3], &y[..3]), None);
    }

    /// Second derivatives of a swing at 1 Hz, of which a third is lost, sampled unevenly, or dated to the millisecond: a few parts in a thousand off.
    #[test]
    fn the_motion_tells_when_it_was_sampled() {
        let mut random = crate::random::Random(5);
        let taken: Vec<f64> = (0..1500)
            .filter(|_| random.uniform() < 0.97)
            .map(|k| f64::from(k) / 100.0)
            .collect();
        let uneven: Vec<f64> = taken
            .iter()
            .map(|t| t + 0.004 * (random.uniform() - 0.5))
            .collect();
        let dated: Vec<f64> = taken
            .iter()
            .map(|t| (t + 0.0008 * random.uniform()) * 1.00003)
            .collect();
        let even: Vec<f64> = (0..1500).map(|k| f64::from(k) / 100.0).collect();
        let mut packed = even.clone();
        for k in (10..1490).step_by(30) {
            // Two came at once, some even by the same tick.
            packed[k] = packed[k + 1] - f64::from(k as u8 % 2) * 1e-6;
        }
        for (taken, written, what) in [
            (&even, &packed, "packed"),
            (&taken, &taken, "lost"),
            (&uneven, &uneven, "uneven"),
            (&taken, &dated, "dated"),
        ] {
            let x: Vec<f64> = taken.iter().map(|t| (TAU * t).sin()).collect();
            let (_, second) = derivatives(written, &x).unwrap();
            let miss = taken.iter().zip(&second).zip(&x).skip(4).take(x.len() - 8);
            let worst = miss
                .map(|((_, found), x)| (found + TAU * TAU * x).abs())
                .fold(0.0, f64::max);
            assert!(worst < 0.006 * TAU * TAU, "{what}: {worst}");
        }
    }
}

//! How far estimates are from a recorded truth.

use crate::inputs::interpolate;
use nalgebra::{Quaternion, UnitQuaternion};

/// A true orientation over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    /// Times, s, ascending.
    pub t_s: Vec<f64>,
    /// World from sensor (or body), z up.
    pub world_from_body: Vec<UnitQuaternion<f64>>,
}

impl Truth {
    /// From columns x, y, z, w; samples that are no unit quaternion (norm² outside 0.5 … 2, or not finite) are left out.
    pub fn from_columns(t_s: &[f64], [x, y, z, w]: [&[f64]; 4]) -> Self {
        let mut out = Self::default();
        for i in 0..t_s
            .len()
            .min(x.len())
            .min(y.len())
            .min(z.len())
            .min(w.len())
        {
            let q = Quaternion::new(w[i], x[i], y[i], z[i]);
            let later = out.t_s.last().is_none_or(|&last| t_s[i] > last);
            if later && t_s[i].is_finite() && (0.5..=2.0).contains(&q.norm_squared()) {
                out.t_s.push(t_s[i]);
                out.world_from_body.push(UnitQuaternion::new_normalize(q));
            }
        }
        out
    }

    /// Norm of the angular velocity between neighbours, rad/s, at the middles of their times.
    pub fn rate_norm(&self) -> (Vec<f64>, Vec<f64>) {
        self.t_s
            .windows(2)
            .zip(self.world_from_body.windows(2))
            .map(|(t, q)| {
                (
                    0.5 * (t[0] + t[1]),
                    (q[0].inverse() * q[1]).angle() / (t[1] - t[0]),
                )
            })
            .unzip()
    }
}

/// Root mean square of the inclination error, deg: the angle by which the two disagree on where up is.
///
/// ```text
/// ε = 2 arccos √(d_w² + d_z²),   d = q_estimate ⊗ q_truth⁻¹
/// ```
/// q earth → … body → earth quaternions; a constant turn between the two earths about the vertical does not matter. Only moments inside
/// `spans` (s, both ends included; empty: all) at which the truth has a sample within a period count. `None` when none does.
/// Source: the error measure of BROAD, Laidig et al., Data 6 (2021) 72.
pub fn inclination_error_deg(
    t_s: &[f64],
    earth_from_body: &[UnitQuaternion<f64>],
    truth: &Truth,
    spans_s: &[(f64, f64)],
) -> Option<f64> {
    let step = super::track::period_s(t_s)?;
    let (mut sum, mut count) = (0.0, 0usize);
    for (t, q) in t_s.iter().zip(earth_from_body) {
        // Half a nanosecond per second of rounding must not push a sample out of its span.
        if !spans_s.is_empty()
            && !spans_s
                .iter()
                .any(|(a, b)| (a - 1e-6..=b + 1e-6).contains(t))
        {
            continue;
        }
        let Some(p) = at(truth, *t, step) else {
            continue;
        };
        let d = q * p.inverse();
        let e = 2.0 * (d.w * d.w + d.k * d.k).sqrt().min(1.0).acos();
        sum += e * e;
        count += 1;
    }
    (count > 0).then(|| (sum / count as f64).sqrt().to_degrees())
}

/// The truth at a moment: between its neighbours when they are close enough, else `None`.
fn at(truth: &Truth, t_s: f64, step_s: f64) -> Option<UnitQuaternion<f64>> {
    let k = truth.t_s.partition_point(|t| *t < t_s);
    let (near, other) = match (k.checked_sub(1), truth.t_s.get(k)) {
        (Some(before), Some(_)) => (before, k),
        (Some(before), None) => (before, before),
        (None, Some(_)) => (k, k),
        (None, None) => return None,
    };
    let (a, b) = (truth.t_s[near], truth.t_s[other]);
    let reach = (2.0 * step_s).max(0.05);
    if near == other || b - a > reach {
        let (i, gap) = if (t_s - a).abs() <= (b - t_s).abs() {
            (near, (t_s - a).abs())
        } else {
            (other, (b - t_s).abs())
        };
        return (gap <= 0.5 * step_s).then(|| truth.world_from_body[i]);
    }
    let share = (t_s - a) / (b - a);
    let (p, q) = (truth.world_from_body[near], truth.world_from_body[other]);
    Some(p.try_slerp(&q, share, 1e-9).unwrap_or(p))
}

/// What is left between an estimated and a true course after the band-pass `band` has been over both: root mean square of the
/// difference over that of the truth, over the estimate's times inside `inner_s`.
///
/// `clock_s` is added to the estimate's times first. `None` where the truth does not move or the band cannot be made.
pub fn relative_error(
    (t_s, x): (&[f64], &[f64]),
    (u_s, y): (&[f64], &[f64]),
    band_hz: [f64; 2],
    clock_s: f64,
    inner_s: (f64, f64),
) -> Option<f64> {
    use crate::filter::{Band, butter, sosfiltfilt};
    let step_s = super::track::period_s(t_s)?;
    let shifted: Vec<f64> = t_s.iter().map(|t| t + clock_s).collect();
    let truth = interpolate(u_s, y, &shifted);
    let sections = butter(4, Band::Pass(band_hz[0], band_hz[1]), 1.0 / step_s).ok()?;
    let (x, y) = (
        sosfiltfilt(&sections, x).ok()?,
        sosfiltfilt(&sections, &truth).ok()?,
    );
    let (mut error, mut power) = (0.0, 0.0);
    for i in (0..x.len()).filter(|i| t_s[*i] >= inner_s.0 && t_s[*i] <= inner_s.1) {
        error += (x[i] - y[i]).powi(2);
        power += y[i] * y[i];
    }
    (power > 0.0).then(|| (error / power).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn heading_is_free_and_tilt_is_not() {
        let t: Vec<f64> = (0..100).map(|k| f64::from(k) * 0.01).collect();
        let truth: Vec<UnitQuaternion<f64>> = t
            .iter()
            .map(|t| UnitQuaternion::from_euler_angles(*t, 0.3 * t, 2.0 * t))
            .collect();
        let turned: Vec<_> = truth
            .iter()
            .map(|q| {
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 1.0)
                    * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.01)
                    * q
            })
            .collect();
        let truth = Truth {
            t_s: t.clone(),
            world_from_body: truth,
        };
        let e = inclination_error_deg(&t, &turned, &truth, &[]).unwrap();
        assert!((e - 0.01f64.to_degrees()).abs() < 1e-9, "{e}");
        assert_eq!(
            inclination_error_deg(&t, &turned, &truth, &[(5.0, 6.0)]),
            None
        );
    }

    #[test]
    fn missing_truth_does_not_count() {
        let nan = f64::NAN;
        let truth = Truth::from_columns(
            &[0.0, 1.0, 2.0],
            [&[0.0, nan, 0.0], &[0.0; 3], &[0.0; 3], &[1.0; 3]],
        );
        assert_eq!(truth.t_s, [0.0, 2.0]);
        let q = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.02);
        let e = inclination_error_deg(&[0.0, 1.0, 2.0], &[q; 3], &truth, &[]).unwrap();
        assert!((e.to_radians() - 0.02).abs() < 1e-9);
    }
}

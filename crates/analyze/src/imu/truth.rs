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

    /// A roll that grows evenly: between samples of the truth the straight turn is exact, across a hole of it only what lies beside a sample counts,
    /// and only in the spans asked for, their ends included.
    #[test]
    fn a_truth_is_drawn_between_samples_and_not_across_holes() {
        let roll = |t: f64| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.5 * t);
        let at = |t_s: &[f64]| t_s.iter().map(|t| roll(*t)).collect::<Vec<_>>();
        let grid = |hz: f64, keep: &dyn Fn(f64) -> bool| -> Vec<f64> {
            let all = (0..(4.0 * hz) as u32).map(|k| f64::from(k) / hz);
            all.filter(|t| keep(*t)).collect()
        };
        // A hole from 1 to 2 s; the sensor is off by as many mrad as there are seconds.
        let u_s = grid(50.0, &|t| !(1.0 < t && t < 2.0));
        let truth = Truth {
            world_from_body: at(&u_s),
            t_s: u_s,
        };
        let t_s: Vec<f64> = grid(100.0, &|_| true).iter().map(|t| t + 0.003).collect();
        let off = |t: &f64| UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 1e-3 * t);
        let seen: Vec<_> = t_s.iter().map(|t| off(t) * roll(*t)).collect();
        let error = |spans: &[(f64, f64)]| {
            inclination_error_deg(&t_s, &seen, &truth, spans).map(|e| 1e3 * e.to_radians())
        };
        let rms = |inside: &dyn Fn(f64) -> bool| {
            let all: Vec<f64> = t_s.iter().copied().filter(|t| inside(*t)).collect();
            (all.iter().map(|t| t * t).sum::<f64>() / all.len() as f64).sqrt()
        };
        for (span, inside) in [((0.103, 0.503), (0.1, 0.51)), ((2.5, 3.5), (2.5, 3.5))] {
            let known = rms(&|t| (inside.0..inside.1).contains(&t));
            let found = error(&[span]).unwrap();
            assert!((found - known).abs() < 1e-6, "{span:?}: {found} {known}");
        }
        // In the hole only 1.003 s counts, 3 ms behind the last sample, against which it has turned by 1.5 mrad more.
        let beside = error(&[(1.001, 1.9)]).unwrap();
        assert!((beside - 1.003f64.hypot(1.5)).abs() < 1e-3, "{beside}");
        assert_eq!(error(&[(1.01, 1.999)]), None);
    }

    /// x = 1.1 y and a clock that is 0.1 s off: a tenth is left where that is known; of what is late by δ, 2 sin(ωδ/2).
    #[test]
    fn what_is_left_between_two_courses_is_known_by_hand() {
        let w = std::f64::consts::TAU * 1.5;
        let t_s: Vec<f64> = (0..6000).map(|k| f64::from(k) / 100.0).collect();
        let course = |late_s: f64, gain: f64| -> Vec<f64> {
            t_s.iter()
                .map(|t| gain * (w * (t - late_s)).sin())
                .collect()
        };
        // What is not looked at is wrong altogether.
        let mut seen = course(-0.1, 1.1);
        seen[..500].fill(9.0);
        let inner = (15.0, 45.0);
        let band = [0.3, 10.0];
        let left = |x: &[f64], clock_s| {
            relative_error((&t_s, x), (&t_s, &course(0.0, 1.0)), band, clock_s, inner).unwrap()
        };
        let known = left(&seen, 0.1);
        assert!((known - 0.1).abs() < 1e-3, "{known}");
        let late = left(&course(0.02, 1.0), 0.0);
        assert!((late - 2.0 * (w * 0.01).sin()).abs() < 1e-3, "{late}");
        let still = vec![1.0; t_s.len()];
        let none = relative_error((&t_s, &seen), (&t_s, &still), band, 0.0, inner);
        assert!(none.is_none_or(|e| e > 1e6), "{none:?}");
    }

    #[test]
    fn missing_truth_does_not_count() {
        let nan = f64::NAN;
        let truth = Truth::from_columns(
            &[0.0, 1.0, 2.0],
            [&[0.0, nan, 0.0], &[0.0; 3], &[0.0; 3], &[1.0; 3]],
        );
        assert_eq!(truth.t_s, [0.0, 2.0]);
        // Only as much as the shortest column holds.
        let column = |n: usize, x: f64| vec![x; n];
        for short in 0..5 {
            let n = |k: usize| if k == short { 2 } else { 3 };
            let t_s = &[0.0, 1.0, 2.0][..n(0)];
            let [x, y, z, w] = [
                column(n(1), 0.0),
                column(n(2), 0.0),
                column(n(3), 0.0),
                column(n(4), 1.0),
            ];
            let found = Truth::from_columns(t_s, [&x, &y, &z, &w]);
            assert_eq!(found.t_s, [0.0, 1.0], "{short}");
        }
        let q = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.02);
        let e = inclination_error_deg(&[0.0, 1.0, 2.0], &[q; 3], &truth, &[]).unwrap();
        assert!((e.to_radians() - 0.02).abs() < 1e-9);
    }
}

//! Whether a gyroscope's rates are in another unit than they are said to be: degrees per second read as radians, or the reverse.
//!
//! Of the factors 1, π/180 and 180/π the one is looked for that [`super::gravity`] fits best. Holds where the larger of the two motions rolls by 16° (RMS) or
//! more: a swing of θ to and fro, read by wrong rates, makes gravity shorter by g ⟨θ²⟩/2, and less than that an accelerometer's scale can be off. What swings
//! as a free pendulum about its pivot feels no sideways force, so that rates read too small fit it as well.

use super::Track;
use super::gravity::{FEWEST, Fit, Known, WANDERS_M_PER_S2, WINDOW_S, windows};
use nalgebra::Matrix3;

/// A unit that does not fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OtherUnit {
    /// What the rates would have to be multiplied by.
    pub factor: f64,
    /// By how much gravity wanders as they were read, m/s² RMS.
    pub wanders_m_per_s2: f64,
    /// And as they would fit, m/s² RMS.
    pub fits_m_per_s2: f64,
}

impl OtherUnit {
    /// One line for people.
    pub fn told(&self) -> String {
        let (times, is) = match self.factor < 1.0 {
            true => ("a 57th", "deg/s that pass for rad/s"),
            false => ("57 times", "rad/s that were taken for deg/s"),
        };
        format!(
            "turned by the gyroscope, gravity wanders by {:.2} m/s² within seconds, but by {:.2} with {times} its rates: they look like {is}. No interval knows of it: mend the unit",
            self.wanders_m_per_s2, self.fits_m_per_s2
        )
    }
}

/// Whether another unit fits a track much better than its own.
pub fn other_unit(track: &Track, gravity_m_per_s2: f64) -> Option<OtherUnit> {
    let windows = windows(track, WINDOW_S);
    if windows.len() < FEWEST {
        return None;
    }
    let fit = |factor: f64| {
        let axes = Matrix3::from_diagonal_element(factor);
        Fit::best(&windows, &axes, Known::ANY, gravity_m_per_s2)
    };
    let as_read = fit(1.0);
    if as_read.rms() < WANDERS_M_PER_S2 {
        return None;
    }
    let factors = [1f64.to_radians(), 1f64.to_degrees()];
    let fits = factors.map(|factor| (factor, fit(factor)));
    let (factor, fit) = (fits.iter()).min_by(|(_, a), (_, b)| a.rms().total_cmp(&b.rms()))?;
    fit.refutes(&as_read).then(|| OtherUnit {
        factor: *factor,
        wanders_m_per_s2: as_read.rms(),
        fits_m_per_s2: fit.rms(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use nalgebra::{UnitQuaternion, Vector3};
    use std::f64::consts::{SQRT_2, TAU};

    const G: f64 = 9.80665;

    /// A roll of so many degrees RMS at 1.07 Hz, with a heave at twice that; the rates times a factor.
    fn rolling(rms_deg: f64, times: f64) -> Track {
        let mut random = Random(3);
        let amplitude = SQRT_2 * rms_deg.to_radians();
        let mut track = Track::default();
        for k in 0..6000 {
            let t = 0.01 * f64::from(k);
            let roll = amplitude * (TAU * 1.07 * t).sin();
            let rate = amplitude * TAU * 1.07 * (TAU * 1.07 * t).cos();
            let mut noise = |sd: f64| Vector3::from_fn(|_, _| sd * random.normal());
            let turning = Vector3::new(rate, 0.0, 0.0) + Vector3::repeat(0.004) + noise(0.001);
            let felt = Vector3::new(0.0, 0.0, G + 3.0 * (TAU * 2.14 * t).sin());
            let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), roll);
            track.t_s.push(t);
            track.gyro_rad_per_s.push((times * turning).into());
            let felt = upright.inverse() * felt + noise(0.02);
            track.accel_m_per_s2.push(felt.into());
        }
        track
    }

    /// From which roll on is what the head of the file says.
    #[test]
    fn another_unit_is_found_where_it_makes_a_large_roll_or_hides_one() {
        let (small, large) = (1f64.to_radians(), 1f64.to_degrees());
        for (rms_deg, times, found) in [
            (0.2, large, None),
            (0.4, large, Some(small)),
            (1.0, large, Some(small)),
            (18.0, large, Some(small)),
            (10.0, small, None),
            (18.0, small, Some(large)),
            (30.0, small, Some(large)),
            (0.0, 1.0, None),
            (18.0, 1.0, None),
            (40.0, 1.0, None),
        ] {
            let other = other_unit(&rolling(rms_deg, times), G);
            let factor = other.map(|o| o.factor);
            assert_eq!(factor, found, "{rms_deg}° times {times}: {other:?}");
        }
        let said = other_unit(&rolling(18.0, large), G).unwrap().told();
        assert!(said.contains("deg/s that pass for rad/s"), "{said}");
    }
}

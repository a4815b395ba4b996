//! A gyroscope that is far off: the constant part of its bias, from gravity that stays where it is.
//!
//! [`super::gravity`]'s b, in windows of 4 s, in which a bias of 40°/s is still found, and from there in windows of 16 s, which see
//! a small one four times as well. Its part along gravity shows only where the load tilts; there it is held around the mean rate as surely as the load turns about
//! the vertical by no more than a turn on the whole. The orientation filter follows what is left, but for itself it believes no more than 2°/s.

use super::Track;
use super::gravity::{FEWEST, Fit, Known, WINDOW_S, mean_rate, windows};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::TAU;

/// Windows, s, one round of fits after the other.
const WINDOWS_S: [f64; 2] = [WINDOW_S, 16.0];
/// Less than this across gravity the filter finds by itself, rad/s; and it has to be so many standard deviations.
const LEAST_RAD_PER_S: f64 = 0.5 * TAU / 360.0;
const SURE: f64 = 5.0;
/// What biases are, one standard deviation, rad/s: data sheets allow ±20°/s at most.
const USUAL_RAD_PER_S: f64 = 0.2;
/// Few gyroscopes are off by so much, and none by that, rad/s.
const RARE_RAD_PER_S: f64 = 0.17;
const ABSURD_RAD_PER_S: f64 = 0.5;
/// How much a load turns about the vertical on the whole, one standard deviation, rad.
const TURNS_RAD: f64 = TAU;

/// A bias to be taken off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FarOff {
    /// The bias, sensor axes, rad/s.
    pub bias_rad_per_s: Vector3<f64>,
}

impl FarOff {
    /// Whether it looks as if the rates were no rad/s at all.
    pub fn is_absurd(&self) -> bool {
        self.bias_rad_per_s.norm() > ABSURD_RAD_PER_S
    }

    /// One line for people.
    pub fn told(&self) -> String {
        let off = self.bias_rad_per_s.norm();
        let known = match off {
            _ if self.is_absurd() => {
                "; none is off by so much: are its rates in deg/s? What rests on it has no interval"
            }
            off if off > RARE_RAD_PER_S => "; few are off by so much: are its rates in rad/s?",
            _ => "",
        };
        let off_deg = off.to_degrees();
        format!("the gyroscope is off by {off_deg:.1}°/s, which is taken off{known}")
    }
}

/// The bias of a gyroscope that is farther off than the orientation filter finds by itself.
pub fn far_off(track: &Track, gravity_m_per_s2: f64) -> Option<FarOff> {
    let lasts_s = track.t_s.last()? - track.t_s.first()?;
    let mut found: Option<Fit> = None;
    for length_s in WINDOWS_S {
        let windows = windows(track, length_s);
        if windows.len() < FEWEST {
            break;
        }
        let mean = mean_rate(&windows);
        // Two things that are known, as one: biases are about nothing, and so is what it turns on the whole.
        let (w, w_mean) = (USUAL_RAD_PER_S.powi(-2), (TURNS_RAD / lasts_s).powi(-2));
        let known = Known {
            around: mean * w_mean / (w + w_mean),
            sd: (w + w_mean).powf(-0.5),
        };
        let (axes, g) = (Matrix3::identity(), gravity_m_per_s2);
        found = Some(match &found {
            Some(fit) => Fit::of(&windows, &axes, fit.bias, known, g),
            None => Fit::best(&windows, &axes, known, g),
        });
    }
    let Fit { bias, sure, .. } = found?;
    let felt: Vector3<f64> = (track.accel_m_per_s2.iter())
        .map(|a| Vector3::from(*a))
        .sum();
    let up = felt.try_normalize(0.0)?;
    let across = bias - up * up.dot(&bias);
    let deviations = (across.transpose() * sure * across)[0].sqrt();
    (across.norm() > LEAST_RAD_PER_S && deviations > SURE).then_some(FarOff {
        bias_rad_per_s: bias,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use nalgebra::UnitQuaternion;

    const G: f64 = 9.80665;

    /// A load that rolls, pitches, sways and turns about the vertical, its sensor lying askew in it.
    fn carried(lasts_s: f64, roll_deg: f64, turns_rad: f64, bias: Vector3<f64>) -> Track {
        let mut random = Random(11);
        let askew = UnitQuaternion::from_euler_angles(0.3, -0.8, 0.5);
        let attitude = |t: f64| {
            let roll = roll_deg.to_radians() * (TAU * 1.07 * t).sin();
            let pitch = 0.03 * (TAU * 2.14 * t).sin();
            UnitQuaternion::from_euler_angles(roll, pitch, turns_rad * t / lasts_s) * askew
        };
        let mut track = Track::default();
        for k in 0..(100.0 * lasts_s) as u32 {
            let (t, e) = (0.01 * f64::from(k), 1e-4);
            let rate = (attitude(t - e).inverse() * attitude(t + e)).scaled_axis() / (2.0 * e);
            let felt = Vector3::new(
                1.5 * (TAU * 1.07 * t).sin(),
                2.0 * (TAU * 1.07 * t).cos(),
                G + 4.0 * (TAU * 2.14 * t).sin(),
            );
            let mut noise = |sd: f64| Vector3::from_fn(|_, _| sd * random.normal());
            track.t_s.push(t);
            track
                .gyro_rad_per_s
                .push((rate + bias + noise(0.002)).into());
            let felt = attitude(t).inverse() * felt + noise(0.02);
            track.accel_m_per_s2.push(felt.into());
        }
        track
    }

    #[test]
    fn a_large_bias_is_found_and_a_small_one_left_alone() {
        for roll_deg in [0.0, 5.0, 25.0] {
            for direction in [
                Vector3::new(1.0, 0.0, 0.0),
                Vector3::new(-0.5, 0.7, 0.4),
                Vector3::new(0.3, 0.4, -0.9),
            ] {
                for deg_per_s in [0.1, 3.0, 12.0, 24.0, 40.0] {
                    let bias = direction.normalize() * f64::to_radians(deg_per_s);
                    let track = carried(120.0, roll_deg, 0.0, bias);
                    let found = far_off(&track, G);
                    if deg_per_s < 0.5 {
                        assert_eq!(found, None, "{roll_deg} {bias}");
                        continue;
                    }
                    let found = found.unwrap().bias_rad_per_s;
                    let up =
                        UnitQuaternion::from_euler_angles(0.3, -0.8, 0.5).inverse() * Vector3::z();
                    let off = found - bias;
                    // Along gravity it is known as well as that the load does not turn: as a part of the bias, 120 s tell nine tenths.
                    let along = off.dot(&up);
                    let across = (off - up * along).norm();
                    let said = format!("{roll_deg} {deg_per_s} {bias}: {across} {along}");
                    assert!(across < 0.003, "{said}");
                    assert!(along.abs() < 0.003 + 0.1 * bias.dot(&up).abs(), "{said}");
                    assert_eq!(deg_per_s > 30.0, far_off(&track, G).unwrap().is_absurd());
                }
            }
        }
    }

    /// A good gyroscope is not taken for a bad one because the load goes round.
    #[test]
    fn who_turns_about_the_vertical_is_not_off() {
        for turns_rad in [3.0, 15.0, -40.0] {
            let track = carried(60.0, 15.0, turns_rad, Vector3::zeros());
            assert_eq!(far_off(&track, G), None, "{turns_rad}");
        }
    }

    #[test]
    fn nothing_comes_of_nothing() {
        assert_eq!(far_off(&Track::default(), G), None);
        let short = carried(5.0, 10.0, 0.0, Vector3::new(0.1, 0.1, 0.0));
        assert_eq!(far_off(&short, G), None);
    }
}

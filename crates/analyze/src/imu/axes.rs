//! Whether a gyroscope and the accelerometer of the same device stand on the same axes: a table's layout may have exchanged or turned them.
//!
//! Of P, the 48 signed permutations, the one is looked for that [`super::gravity`] fits best, each with a bias of its own.
//!
//! Holds for a device that tilts. With the axes of roll and pitch exchanged it takes a roll of 8° each way within seconds (0.25 Hz), of 20° at 1 Hz: what
//! swings to and fro faster comes back to where it was by wrong rates too, and what is left looks like sway. Both sensors turned alike cannot be told, nor an accelerometer that reads −f. Turning about
//! one axis alone leaves several P alike: then the one nearest to the axes as read is named.

use super::Track;
use super::gravity::{Block, FEWEST, Fit, Known, WANDERS_M_PER_S2, WINDOW_S, windows};
use nalgebra::{Matrix3, Vector3};

/// Only windows in which it turns faster than this count, rad/s RMS.
const TURNS_RAD_PER_S: f64 = 0.1;
/// Within this factor two ways fit alike.
const ALIKE: f64 = 1.3;
/// Axes that do not agree.
#[derive(Clone, Debug, PartialEq)]
pub struct Misfit {
    /// P that fits: rows x, y, z of the gyroscope as they would, of those read.
    pub axes: Matrix3<f64>,
    /// How many other ways fit as well.
    pub others: usize,
    /// By how much gravity wanders as it was read, m/s² RMS.
    pub wanders_m_per_s2: f64,
    /// And as it would fit, m/s² RMS.
    pub fits_m_per_s2: f64,
}

impl Misfit {
    /// One line for people.
    pub fn told(&self) -> String {
        let axis = |row: usize| {
            let row = self.axes.row(row).transpose();
            let sign = if row.sum() < 0.0 { "−" } else { "" };
            format!("{sign}{}", ["x", "y", "z"][row.iamax()])
        };
        let others = match self.others {
            0 => String::new(),
            n => format!(", and as well in {n} other ways"),
        };
        format!(
            "gyroscope and accelerometer do not stand on the same axes: turned by the gyroscope, gravity wanders by {:.2} m/s² within seconds, but by {:.2} with its x, y, z read as {}{others}; or it is the accelerometer's that are exchanged. No interval knows of it: mend the layout",
            self.wanders_m_per_s2,
            self.fits_m_per_s2,
            [0, 1, 2].map(axis).join(", ")
        )
    }
}

/// Whether other axes fit a track much better than its own; `None` where they do not, or it hardly turns.
pub fn misfit(track: &Track, gravity_m_per_s2: f64) -> Option<Misfit> {
    let mut windows = windows(track, WINDOW_S);
    windows.retain(|w| turns(w));
    if windows.len() < FEWEST {
        return None;
    }
    let g = gravity_m_per_s2;
    let (as_read, still) = (Matrix3::identity(), Vector3::zeros());
    if Fit::of(&windows, &as_read, still, Known::ANY, g).rms() < WANDERS_M_PER_S2 {
        return None;
    }
    let fit = |axes: &Matrix3<f64>| Fit::best(&windows, axes, Known::ANY, g);
    let fits: Vec<(Matrix3<f64>, Fit)> = signed_permutations()
        .map(|axes| (axes, fit(&axes)))
        .collect();
    let (_, as_read) = fits.first()?;
    let least = fits.iter().map(|(_, f)| f.rms()).fold(f64::MAX, f64::min);
    let alike = || (fits.iter()).filter(|(_, fit)| fit.rms() <= ALIKE * least);
    // Axes that stay come first, then signs.
    let kept = |axes: &Matrix3<f64>| 8.0 * axes.trace() + axes.sum();
    let (axes, fit) = alike().max_by(|a, b| kept(&a.0).total_cmp(&kept(&b.0)))?;
    if !fit.refutes(as_read) {
        return None;
    }
    Some(Misfit {
        axes: *axes,
        others: alike().count() - 1,
        wanders_m_per_s2: as_read.rms(),
        fits_m_per_s2: fit.rms(),
    })
}

/// Whether it turns in a window.
fn turns(window: &[Block]) -> bool {
    let square = |b: &Block| b.rate.norm_squared() * b.step_s;
    let length_s: f64 = window.iter().map(|b| b.step_s).sum();
    window.iter().map(square).sum::<f64>() > TURNS_RAD_PER_S.powi(2) * length_s
}

/// The 48 ways to read three axes, those with a mirror among them; first as they are.
pub fn signed_permutations() -> impl Iterator<Item = Matrix3<f64>> {
    let orders = [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ];
    orders.into_iter().flat_map(|order| {
        (0..8u8).map(move |signs| {
            let mut axes = Matrix3::zeros();
            for (row, of) in order.into_iter().enumerate() {
                axes[(row, of)] = if signs >> row & 1 == 0 { 1.0 } else { -1.0 };
            }
            axes
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use nalgebra::UnitQuaternion;
    use std::f64::consts::TAU;

    const G: f64 = 9.80665;

    /// A minute of a device that tilts by some degrees to all sides, shaken meanwhile, its gyroscope with a bias.
    fn tilting(amplitude_rad: f64, shaken_m_per_s2: f64, bias: [f64; 3]) -> Track {
        let mut random = Random(5);
        let attitude = |t: f64| {
            let tilt = |hz: f64, phase: f64| amplitude_rad * (TAU * hz * t + phase).sin();
            let heading = 1.5 * (TAU * 0.07 * t).sin();
            UnitQuaternion::from_euler_angles(tilt(0.23, 0.0), tilt(0.31, 1.0), heading)
        };
        let mut track = Track::default();
        for k in 0..6000 {
            let (t, e) = (0.01 * f64::from(k), 1e-4);
            let turn = attitude(t - e).inverse() * attitude(t + e);
            let rate = turn.scaled_axis() / (2.0 * e) + Vector3::from(bias);
            let shake = |axis: f64| shaken_m_per_s2 * (TAU * 2.0 * t + axis).sin();
            let felt = Vector3::new(shake(0.0), shake(1.0), G + shake(2.0));
            let noise = Vector3::from_fn(|_, _| 0.02 * random.normal());
            track.t_s.push(t);
            track.gyro_rad_per_s.push((rate + 0.1 * noise).into());
            track
                .accel_m_per_s2
                .push((attitude(t).inverse() * felt + noise).into());
        }
        track
    }

    fn exchanged(track: &Track, axes: &Matrix3<f64>) -> Track {
        let mut out = track.clone();
        for rate in &mut out.gyro_rad_per_s {
            *rate = (axes * Vector3::from(*rate)).into();
        }
        out
    }

    #[test]
    fn any_exchange_of_axes_is_found_and_named() {
        for (degrees, bias) in [(6.0, 0.0), (25.0, 0.1)] {
            let track = tilting(f64::to_radians(degrees), 2.0, [bias, -bias, bias]);
            assert_eq!(misfit(&track, G), None, "{degrees}");
            for axes in signed_permutations().filter(|a| *a != Matrix3::identity()) {
                let found = misfit(&exchanged(&track, &axes), G);
                let found = found.unwrap_or_else(|| panic!("{degrees}°: {axes} is not found"));
                // What was done is undone by its inverse.
                assert_eq!((found.axes * axes, found.others), (Matrix3::identity(), 0));
            }
        }
    }

    #[test]
    fn turning_about_one_axis_tells_of_that_axis() {
        let mut track = tilting(0.0, 1.0, [0.0; 3]);
        for (k, t) in track.t_s.iter().enumerate() {
            let roll = 0.4 * (TAU * 1.07 * t).sin();
            let rate = 0.4 * TAU * 1.07 * (TAU * 1.07 * t).cos();
            let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), roll);
            track.gyro_rad_per_s[k] = [rate, 0.0, 0.0];
            track.accel_m_per_s2[k] = (upright.inverse() * Vector3::new(0.0, 0.0, G)).into();
        }
        assert_eq!(misfit(&track, G), None);
        let mirror = Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, 1.0));
        let found = misfit(&exchanged(&track, &mirror), G).unwrap();
        assert_eq!(found.axes, mirror);
        assert!(found.others > 0 && found.told().contains("−x, y, z"));
    }

    /// How far it has to roll is what the head of the file says.
    #[test]
    fn a_small_swing_to_and_fro_hides_what_a_slow_tip_shows() {
        let swap = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        for (hz, degrees, is_found) in [
            (0.25, 5.0, false),
            (0.25, 8.0, true),
            (1.07, 15.0, false),
            (1.07, 20.0, true),
        ] {
            let mut track = tilting(0.0, 0.0, [0.0; 3]);
            for (k, t) in track.t_s.iter().enumerate() {
                let amplitude = f64::to_radians(degrees);
                let roll = amplitude * (TAU * hz * t).sin();
                let rate = amplitude * TAU * hz * (TAU * hz * t).cos();
                let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), roll);
                track.gyro_rad_per_s[k] = [rate, 0.01, 0.02];
                track.accel_m_per_s2[k] = (upright.inverse() * Vector3::new(0.0, 0.0, G)).into();
            }
            let found = misfit(&exchanged(&track, &swap), G).is_some();
            assert_eq!(found, is_found, "{degrees}° at {hz} Hz");
        }
    }

    #[test]
    fn what_does_not_tilt_says_nothing() {
        let mut still = tilting(0.0, 3.0, [0.0; 3]);
        let mut random = Random(7);
        for rate in still.gyro_rad_per_s.iter_mut() {
            *rate = [0.15, -0.35, -0.05].map(|bias| bias + 0.01 * random.normal());
        }
        for axes in signed_permutations() {
            assert_eq!(misfit(&exchanged(&still, &axes), G), None, "{axes}");
        }
    }
}

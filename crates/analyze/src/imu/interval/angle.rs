//! Intervals of an angle's root mean square: what noise adds to it, how the load may have leant all the time, how the sensor may sit.

use super::variance;
use crate::imu::budget::{BY_EYE_RAD, Budget, UNCALIBRATED_GYRO_SCALE, UNCALIBRATED_M_PER_S2};
use crate::imu::rath::{Motion, Mounting};

/// Roots of mean squares, to which noise adds and from which it never takes.
pub const MEAN_SQUARES: &[&str] = &["rms_roll_deg", "rms_pitch_deg"];

/// A root mean square without what noise added to it, and its 95 % interval: the same noise, `drawn`, adds as much once more.
///
/// ```text
/// s = 2 x² − ⟨d²⟩,    x' = √s,    √(s ± 1.96 SD(d²)),    none below 0
/// ```
/// x as estimated, d as drawn about it. Source: Cook & Stefanski, "Simulation-extrapolation estimation", J. Am. Stat. Assoc. 89 (1994), to first
/// order in the noise's power.
pub fn without_noise(x: f64, drawn: &[f64]) -> (f64, [f64; 2]) {
    let squares: Vec<f64> = drawn.iter().map(|d| d * d).collect();
    let noisier = squares.iter().sum::<f64>() / squares.len() as f64;
    let square = 2.0 * x * x - noisier;
    let half = 1.96 * variance(&squares).sqrt();
    let root = |square: f64| square.max(0.0).sqrt();
    (root(square), [root(square - half), root(square + half)])
}

/// Standard deviation of the accelerometer's bias, m/s²: as said, or of one that nobody calibrated, on the evidence of the axis that gravity shows.
fn accel_bias_m_per_s2(motion: &Motion) -> f64 {
    let seen = motion.gravity_off_m_per_s2.abs();
    let said = motion.settings.budget.accel_bias_m_per_s2;
    said.unwrap_or(UNCALIBRATED_M_PER_S2.max(seen))
}

/// Relative standard deviation of angles: of the gyroscope's scale, as said or of one that nobody calibrated, and of the method.
pub fn angle_scale(budget: &Budget) -> f64 {
    let said = budget.gyro_scale_error;
    budget
        .angle_scale
        .hypot(said.unwrap_or(UNCALIBRATED_GYRO_SCALE))
}

/// What nobody said of the sensor, and what was taken for it.
pub fn uncalibrated(motion: &Motion) -> Option<String> {
    let budget = &motion.settings.budget;
    let mounting = match motion.settings.mounting {
        Mounting::Levelled => Some("about its mean over the window: how the sensor sits cannot be told from how the load leans; give imu_mounting_roll_pitch_yaw_deg in a roles file".into()),
        Mounting::Known(_) => budget.accel_bias_m_per_s2.is_none().then(|| format!(
            "as if nobody had calibrated the accelerometer (a bias of {:.2} m/s², SD); accel_bias_m_per_s2 in a roles file says otherwise",
            accel_bias_m_per_s2(motion)
        )),
    };
    let scale = budget.gyro_scale_error.is_none().then(|| format!(
        "as if nobody had calibrated the gyroscope (a scale off by {} %, SD); gyro_scale_error in a roles file says otherwise",
        100.0 * UNCALIBRATED_GYRO_SCALE
    ));
    let placed = budget.mounting_error_rad.is_none().then(|| format!(
        "as if it was mounted by eye ({:.0}° off about each axis, SD); imu_mounting_error_deg in a roles file says otherwise",
        BY_EYE_RAD.to_degrees()
    ));
    let all: Vec<String> = mounting.into_iter().chain(scale).chain(placed).collect();
    (!all.is_empty()).then(|| all.join("; "))
}

/// How far the sensor may stand otherwise on the load, rad (one standard deviation): as said, or by eye.
pub fn mounting_error_rad(budget: &Budget) -> f64 {
    budget.mounting_error_rad.unwrap_or(BY_EYE_RAD)
}

/// By how much such a bias, and such a mounting, tilts up for good, rad (one standard deviation).
pub fn constant_tilt_rad(motion: &Motion) -> f64 {
    match motion.settings.mounting {
        Mounting::Known(_) => (accel_bias_m_per_s2(motion) / motion.settings.gravity_m_per_s2)
            .hypot(mounting_error_rad(&motion.settings.budget)),
        // What is up is found with the same bias.
        Mounting::Levelled => 0.0,
    }
}

/// The interval of a root mean square that may lean by up to `most` more or less than seen, all the time:
///
/// ```text
/// x² = v + m²,    v + (|m| − c)² … v + (|m| + c)²
/// ```
/// m the mean, v the variance about it, which such a lean leaves alone, c what it may be; none below v. Errors add by squares.
pub fn tilted(root: f64, [low, high]: [f64; 2], mean: f64, most: f64) -> [f64; 2] {
    let mean = mean.abs();
    let square = root * root;
    let down = mean * mean - (mean - most).max(0.0).powi(2);
    let up = (mean + most).powi(2) - mean * mean;
    let low = square - (square - low * low).hypot(down);
    let high = square + (high * high - square).hypot(up);
    [low.max(0.0).sqrt(), high.sqrt()]
}

/// The interval of the root mean square of an angle x whose sensor may be turned about the vertical by up to `most` (rad) each way, so that a part of the
/// other angle y is taken for it:
///
/// ```text
/// x' = x − ε y,    ⟨x'²⟩ − ⟨x²⟩ = ε² ⟨y²⟩ − 2 ε ⟨x y⟩        |ε| ≤ most
/// ```
/// Small angles; of ε the least and the most count. What may be y's is a known part of the square, and so is a lean ([`tilted`]): both may
/// have to go, so that downwards they add up; upwards errors add by squares.
pub fn mixed(root: f64, [low, high]: [f64; 2], x: &[f64], y: &[f64], most: f64) -> [f64; 2] {
    let count = x.len() as f64;
    let of_y = y.iter().map(|y| y * y).sum::<f64>() / count;
    let of_both = x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>() / count;
    let change = |e: f64| (e * e * of_y - 2.0 * e * of_both) * 1f64.to_degrees().powi(2);
    let least = (of_both / of_y.max(f64::MIN_POSITIVE)).clamp(-most, most);
    let (down, up) = (-change(least), change(most).max(change(-most)));
    let square = root * root;
    let low = low * low - down;
    let high = square + (high * high - square).hypot(up);
    [low.max(0.0).sqrt(), high.sqrt()]
}

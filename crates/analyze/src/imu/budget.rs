//! How sure an inertial sensor on what is carried can be.

/// Bias of an accelerometer's axis that nobody has measured, m/s² (one standard deviation). Data sheets of those in phones and wearables give ±20 mg as
/// soldered (LSM6DSO, BMI270, ICM-42688-P: "zero-g level offset"), read as two of them; older ones ±50 mg (MPU-6050).
pub const UNCALIBRATED_M_PER_S2: f64 = 0.1;

/// Scale error of a gyroscope's axis that nobody has measured, relative (one standard deviation). Data sheets give ±1 % as soldered (LSM6DSO:
/// "sensitivity tolerance"; ±0.4 to ±0.5 % of the BMI270 and ICM-42688-P), read as two of them; older ones ±3 % (MPU-6050, MPU-9250).
pub const UNCALIBRATED_GYRO_SCALE: f64 = 0.005;

/// How far a sensor's axes may stand otherwise on the load than they are taken to, rad (one standard deviation), where nobody measured it: 1°, a case that
/// was laid along a pole by eye, with its edges as they are.
pub const BY_EYE_RAD: f64 = std::f64::consts::PI / 180.0;

/// What the sensor and the method leave uncertain, one standard deviation each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    /// Constant bias of each axis of the accelerometer, m/s², where that is known; else [`UNCALIBRATED_M_PER_S2`], or what gravity is off by, if that
    /// is more. It tilts what stands on a known mounting, and is levelled out of what does not.
    pub accel_bias_m_per_s2: Option<f64>,
    /// Scale error of each axis of the gyroscope, relative, where that is known; else [`UNCALIBRATED_GYRO_SCALE`].
    pub gyro_scale_error: Option<f64>,
    /// About each axis, by how much the sensor stands otherwise on the load, rad, where that is known; else [`BY_EYE_RAD`]. Turned about the vertical it takes
    /// a part of the roll for pitch and the reverse; about the others it tilts what stands on a known mounting.
    pub mounting_error_rad: Option<f64>,
    /// Roll and pitch: what a bias walks besides, and the method, rad.
    pub tilt_offset_rad: f64,
    /// Roll and pitch: part that wanders over seconds, rad.
    pub tilt_wander_rad: f64,
    /// Roll and pitch: how a bias walks on beyond the first minute, which `tilt_offset_rad` holds, rad/√s.
    pub tilt_walk_rad_per_sqrt_s: f64,
    /// Angles: relative, beside the gyroscope's scale.
    pub angle_scale: f64,
    /// Height: relative (accelerometer's scale, band).
    pub height_scale: f64,
    /// Height: wandering over seconds, m.
    pub height_wander_m: f64,
    /// Support ratio: constant part, beside what gravity is off by.
    pub support_offset: f64,
    /// Support ratio: relative.
    pub support_scale: f64,
    /// Support ratio: from sample to sample.
    pub support_noise: f64,
}

impl Default for Budget {
    /// A calibrated MEMS sensor; checked against simulated twins (docs/field.md).
    fn default() -> Self {
        Self {
            accel_bias_m_per_s2: None,
            gyro_scale_error: None,
            mounting_error_rad: None,
            tilt_offset_rad: 0.11f64.to_radians(),
            tilt_wander_rad: 0.05f64.to_radians(),
            // 0.003 m/s³/√Hz (ADIS16448, as Burri et al. 2016 give it for the EuRoC recordings) over g.
            tilt_walk_rad_per_sqrt_s: 3e-4,
            angle_scale: 0.003,
            height_scale: 0.01,
            height_wander_m: 0.002,
            support_offset: 0.004,
            support_scale: 0.002,
            support_noise: 0.016,
        }
    }
}

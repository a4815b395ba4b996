//! How sure an inertial sensor on what is carried can be.

/// What the sensor and the method leave uncertain, one standard deviation each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    /// Roll and pitch: constant part, rad.
    pub tilt_offset_rad: f64,
    /// Roll and pitch: part that wanders over seconds, rad.
    pub tilt_wander_rad: f64,
    /// Angles: relative (gyroscope's scale).
    pub angle_scale: f64,
    /// Height: relative (accelerometer's scale, band).
    pub height_scale: f64,
    /// Height: wandering over seconds, m.
    pub height_wander_m: f64,
    /// Support ratio: constant part (accelerometer's bias over g).
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
            tilt_offset_rad: 0.11f64.to_radians(),
            tilt_wander_rad: 0.05f64.to_radians(),
            angle_scale: 0.003,
            height_scale: 0.01,
            height_wander_m: 0.002,
            support_offset: 0.004,
            support_scale: 0.002,
            support_noise: 0.016,
        }
    }
}

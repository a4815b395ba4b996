//! A clean series of inertial samples.

use crate::median::median;
use nalgebra::Vector3;

/// Beyond these a sample is an error of the file, not a motion [rad/s, m/s²].
const GYRO_LIMIT_RAD_PER_S: f64 = 1e3;
const ACCEL_LIMIT_M_PER_S2: f64 = 1e5;

/// What a straight line may bridge, s: of 10 m/s² at 4 Hz it misses a velocity of 10 mm/s.
pub(crate) const BRIDGED_S: f64 = 0.025;

/// What an inertial sensor reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instrument {
    /// Angular velocity, rad/s.
    Gyroscope,
    /// Specific force, m/s².
    Accelerometer,
}

impl Instrument {
    /// Both.
    pub const BOTH: [Self; 2] = [Self::Gyroscope, Self::Accelerometer];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gyroscope => "gyroscope",
            Self::Accelerometer => "accelerometer",
        }
    }

    /// Its unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Gyroscope => "rad/s",
            Self::Accelerometer => "m/s²",
        }
    }

    /// The other one of the same device.
    pub fn other(self) -> Self {
        match self {
            Self::Gyroscope => Self::Accelerometer,
            Self::Accelerometer => Self::Gyroscope,
        }
    }
}

/// Samples of one inertial sensor in ascending time; every number finite.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track {
    /// Time of each sample, s, strictly ascending.
    pub t_s: Vec<f64>,
    /// Angular velocity in the sensor's frame, rad/s.
    pub gyro_rad_per_s: Vec<[f64; 3]>,
    /// Specific force in the sensor's frame, m/s².
    pub accel_m_per_s2: Vec<[f64; 3]>,
    /// How many samples were left out: not finite, out of any sensor's range, or not later than the one before.
    pub dropped: usize,
}

impl Track {
    /// Takes columns as a reader gives them (three of the gyroscope, three of the accelerometer).
    ///
    /// Only as many samples as the shortest column has are read. Samples that are not finite, beyond any sensor's range
    /// or not later than the last good one are counted in [`Track::dropped`] and left out.
    pub fn from_columns(t_s: &[f64], gyro: [&[f64]; 3], accel: [&[f64]; 3]) -> Self {
        let n = gyro
            .iter()
            .chain(&accel)
            .map(|c| c.len())
            .fold(t_s.len(), usize::min);
        let mut track = Self::default();
        for i in 0..n {
            let g = gyro.map(|c| c[i]);
            let a = accel.map(|c| c[i]);
            let later = track.t_s.last().is_none_or(|&last| t_s[i] > last);
            let sound = t_s[i].is_finite()
                && g.iter().all(|x| x.abs() <= GYRO_LIMIT_RAD_PER_S)
                && a.iter().all(|x| x.abs() <= ACCEL_LIMIT_M_PER_S2);
            if later && sound {
                track.t_s.push(t_s[i]);
                track.gyro_rad_per_s.push(g);
                track.accel_m_per_s2.push(a);
            } else {
                track.dropped += 1;
            }
        }
        track
    }

    /// What one of its instruments read.
    pub fn readings(&self, instrument: Instrument) -> &[[f64; 3]] {
        match instrument {
            Instrument::Gyroscope => &self.gyro_rad_per_s,
            Instrument::Accelerometer => &self.accel_m_per_s2,
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }

    /// The usual time from one sample to the next: the median, s. `None` below two samples.
    pub fn period_s(&self) -> Option<f64> {
        period_s(&self.t_s)
    }

    /// The parts without a hole, as ranges of samples.
    pub fn stretches(&self) -> Vec<std::ops::Range<usize>> {
        crate::inputs::stretches(&self.t_s, BRIDGED_S)
    }

    /// All samples but these, which ascend.
    pub fn without(&self, left_out: &[usize]) -> Self {
        let kept = (0..self.len()).filter(|k| left_out.binary_search(k).is_err());
        self.only(&kept.collect::<Vec<_>>())
    }

    /// Only these samples, which ascend.
    pub fn only(&self, kept: &[usize]) -> Self {
        Self {
            t_s: kept.iter().map(|k| self.t_s[*k]).collect(),
            gyro_rad_per_s: kept.iter().map(|k| self.gyro_rad_per_s[*k]).collect(),
            accel_m_per_s2: kept.iter().map(|k| self.accel_m_per_s2[*k]).collect(),
            dropped: self.dropped,
        }
    }

    /// Some of the samples.
    pub fn part(&self, range: std::ops::Range<usize>) -> Self {
        Self {
            t_s: self.t_s[range.clone()].to_vec(),
            gyro_rad_per_s: self.gyro_rad_per_s[range.clone()].to_vec(),
            accel_m_per_s2: self.accel_m_per_s2[range].to_vec(),
            dropped: self.dropped,
        }
    }

    /// These samples and, behind them, later ones.
    pub fn append(&mut self, mut later: Track) {
        self.t_s.append(&mut later.t_s);
        self.gyro_rad_per_s.append(&mut later.gyro_rad_per_s);
        self.accel_m_per_s2.append(&mut later.accel_m_per_s2);
    }

    /// Takes a constant bias from the gyroscope.
    pub fn take_off_bias(&mut self, bias_rad_per_s: Vector3<f64>) {
        for rate in &mut self.gyro_rad_per_s {
            *rate = (Vector3::from(*rate) - bias_rad_per_s).into();
        }
    }

    /// The same samples seen in another frame: each vector is turned by `rotation`.
    pub fn rotated(&self, rotation: &nalgebra::UnitQuaternion<f64>) -> Self {
        let turn = |v: &[f64; 3]| (rotation * Vector3::from(*v)).into();
        Self {
            t_s: self.t_s.clone(),
            gyro_rad_per_s: self.gyro_rad_per_s.iter().map(turn).collect(),
            accel_m_per_s2: self.accel_m_per_s2.iter().map(turn).collect(),
            dropped: self.dropped,
        }
    }
}

/// The median step of ascending times, s. `None` below two samples.
pub fn period_s(t_s: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = t_s.windows(2).map(|w| w[1] - w[0]).collect();
    median(&mut steps).filter(|dt| *dt > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_samples_are_left_out_and_counted() {
        let t = [0.0, 0.01, 0.01, 0.02, f64::NAN, 0.03, 0.04];
        let ok = [0.0; 7];
        let z = [9.8, 9.8, 9.8, f64::INFINITY, 9.8, 1e9, 9.8];
        let track = Track::from_columns(&t, [&ok, &ok, &ok], [&ok, &ok, &z]);
        assert_eq!(track.t_s, [0.0, 0.01, 0.04]);
        assert_eq!(track.dropped, 4);
    }

    #[test]
    fn the_period_is_the_median_step() {
        assert_eq!(period_s(&[0.0, 1.0, 2.0, 10.0]), Some(1.0));
        assert_eq!(period_s(&[1.0]), None);
    }
}

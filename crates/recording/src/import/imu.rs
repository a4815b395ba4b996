//! Inertial logs on their way to `sensor_msgs/msg/Imu` in the convention of REP-145: specific force in m/s² (+g on the axis that
//! points up at rest), angular velocity in rad/s, covariance −1 for what is not given.

use crate::cdr::{self, Quaternion};

/// Standard gravity, m/s² (3rd General Conference on Weights and Measures, 1901).
pub(super) const STANDARD_GRAVITY: f64 = 9.80665;

/// One sample of a device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sample {
    pub t_ns: i64,
    pub force: Option<[f64; 3]>,
    pub rate: Option<[f64; 3]>,
    /// x, y, z, w; sensor in the world.
    pub orientation: Option<[f64; 4]>,
}

/// What one device logged.
#[derive(Clone, Debug, Default)]
pub(super) struct Log {
    /// Name of the device: topic `/imu/NAME`, frame `NAME`.
    pub name: String,
    pub samples: Vec<Sample>,
    /// What was decided on the way, for people and for the metadata.
    pub notes: Vec<String>,
}

/// A triple of numbers over time.
pub(super) type Track = Vec<(i64, [f64; 3])>;

impl Log {
    pub fn topic(&self) -> String {
        format!("/imu/{}", self.name)
    }

    /// Puts a force and a rate track together. Where their times differ, the rate is interpolated linearly at the force's times; where
    /// it has a hole of more than three usual intervals, or none on one side, it is not given.
    pub fn join(name: String, force: Track, rate: Track, mut notes: Vec<String>) -> Self {
        let sample = |t_ns, force, rate| Sample {
            t_ns,
            force,
            rate,
            orientation: None,
        };
        let samples = if force.is_empty() {
            rate.iter()
                .map(|&(t_ns, rate)| sample(t_ns, None, Some(rate)))
                .collect()
        } else if rate.is_empty() {
            force
                .iter()
                .map(|&(t_ns, force)| sample(t_ns, Some(force), None))
                .collect()
        } else if force
            .iter()
            .map(|row| row.0)
            .eq(rate.iter().map(|row| row.0))
        {
            force
                .iter()
                .zip(&rate)
                .map(|(&(t_ns, force), &(_, rate))| sample(t_ns, Some(force), Some(rate)))
                .collect()
        } else {
            notes.push(
                "the angular velocity was interpolated linearly at the times of the acceleration"
                    .to_owned(),
            );
            let hole = usual_interval(&rate).saturating_mul(3);
            force
                .iter()
                .map(|&(t_ns, force)| sample(t_ns, Some(force), interpolate(&rate, t_ns, hole)))
                .collect()
        };
        Log {
            name,
            samples,
            notes,
        }
    }
}

/// A track without the rows in which a logger only repeated it: one that writes several sensors into one table holds each one's last value
/// between its samples. `None` where it does not.
///
/// Held is what repeats the row before to the last digit in at least a quarter of the rows, about as often each time: of a sensor with few digits
/// that hardly moves, values last now short, now long.
pub(super) fn without_repeats(track: &Track) -> Option<Track> {
    let bits = |row: &(i64, [f64; 3])| row.1.map(f64::to_bits);
    let held: Vec<_> = track.chunk_by(|a, b| bits(a) == bits(b)).collect();
    let mut lasts: Vec<usize> = held.iter().map(|same| same.len()).collect();
    lasts.sort_unstable();
    let new = held.len();
    let evenly = *lasts.get(new * 19 / 20)? <= lasts[new / 2] * 3 / 2 + 1;
    let is_held = new >= 8 && new * 4 <= track.len() * 3 && evenly;
    is_held.then(|| held.iter().map(|same| same[0]).collect())
}

/// The median interval of a track, ns.
fn usual_interval(track: &Track) -> i64 {
    let mut intervals: Vec<i64> = track.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    intervals.sort_unstable();
    intervals.get(intervals.len() / 2).copied().unwrap_or(0)
}

/// The track's value at a time: exact on a sample, linear between two that are no more than `hole` apart.
pub(super) fn interpolate(track: &Track, t_ns: i64, hole: i64) -> Option<[f64; 3]> {
    let after = track.partition_point(|row| row.0 < t_ns);
    let (t1, v1) = *track.get(after)?;
    if t1 == t_ns {
        return Some(v1);
    }
    let (t0, v0) = *track.get(after.checked_sub(1)?)?;
    if t1 - t0 > hole {
        return None;
    }
    let share = (t_ns - t0) as f64 / (t1 - t0) as f64;
    Some(std::array::from_fn(|axis| {
        v0[axis] + share * (v1[axis] - v0[axis])
    }))
}

/// The interpolation's hole for a track: three usual intervals.
pub(super) fn hole(track: &Track) -> i64 {
    usual_interval(track).saturating_mul(3)
}

/// The median length of a track's vectors.
pub(super) fn usual_length(track: &Track) -> Option<f64> {
    let mut lengths: Vec<f64> = track
        .iter()
        .map(|(_, [x, y, z])| (x * x + y * y + z * z).sqrt())
        .filter(|length| length.is_finite())
        .collect();
    lengths.sort_by(f64::total_cmp);
    lengths.get(lengths.len() / 2).copied()
}

/// Seconds as nanoseconds, rounded; `None` for what does not fit.
pub(super) fn nanoseconds(t_s: f64) -> Option<i64> {
    let t_ns = (t_s * 1e9).round();
    // OK because the range was checked.
    (0.0..9.2e18).contains(&t_ns).then_some(t_ns as i64)
}

impl Sample {
    /// As a message of the device `frame`.
    pub fn message(&self, frame: &str) -> cdr::Imu {
        let mut message = cdr::Imu::raw(
            self.t_ns,
            frame,
            self.rate.unwrap_or_default(),
            self.force.unwrap_or_default(),
        );
        if self.rate.is_none() {
            message = message.without_angular_velocity();
        }
        if self.force.is_none() {
            message = message.without_linear_acceleration();
        }
        match self.orientation {
            Some(orientation) => message.with_orientation(Quaternion::from(orientation)),
            None => message,
        }
    }
}

/// A device's name out of a file's: letters, digits, `_` and `-`.
pub(super) fn device_name(file: &str) -> String {
    let stem = std::path::Path::new(file)
        .file_stem()
        .and_then(|stem| stem.to_str())
        .unwrap_or("device");
    let name: String = stem
        .chars()
        .map(|c| {
            if c.is_ascii_alphanumeric() || c == '-' {
                c
            } else {
                '_'
            }
        })
        .collect();
    let name = name.trim_matches('_');
    if name.is_empty() {
        "device".to_owned()
    } else {
        name.to_owned()
    }
}

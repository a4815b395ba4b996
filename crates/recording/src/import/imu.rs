//! Inertial logs on their way to `sensor_msgs/msg/Imu` in the convention of REP-145: specific force in m/s² (+g on the axis that
//! points up at rest), angular velocity in rad/s, covariance −1 for what is not given.

use std::{ffi::OsStr, path::Path};

use crate::cdr::{self, Quaternion};
use crate::held::new_readings;

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
    /// it has a [hole](Between), or none on one side, it is not given.
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
            let [of_force, of_rate] = [&force, &rate].map(Between::of);
            let without = unpaired(&of_force, &of_rate);
            let what = "of the acceleration's samples have no angular velocity: that has holes there, or began later or ended earlier";
            notes.extend(told(without, force.len(), what));
            let without = unpaired(&of_rate, &of_force);
            let what =
                "of the angular velocity's samples are where no acceleration is, and are left out";
            notes.extend(told(without, rate.len(), what));
            let times = force.iter().zip(&of_force.t_ns);
            times
                .map(|(&(t_ns, force), at_ns)| sample(t_ns, Some(force), of_rate.at(*at_ns)))
                .collect()
        };
        Log {
            name,
            samples,
            notes,
        }
    }
}

/// A track without the rows in which a logger only repeated it ([`new_readings`]). `None` where it does not.
pub(super) fn without_repeats(track: &Track) -> Option<Track> {
    let readings: Vec<[f64; 3]> = track.iter().map(|row| row.1).collect();
    let new = new_readings(&readings)?;
    Some(new.into_iter().map(|k| track[k]).collect())
}

/// So many samples on either side of an interval tell what is usual there.
const AROUND: usize = 5;
/// More than this share of samples without a partner is worth a word: a few at the ends are no loss.
const MANY: f64 = 0.01;

/// A track to look between whose samples.
///
/// Samples of one time came in a packet: they are evenly spread over the interval before it, or a usual one where that is shorter. A hole is
/// more than three times as long as intervals usually are, of the track and nearby: sensors change their rate.
pub(super) struct Between<'a> {
    track: &'a Track,
    /// Where packets are spread, ns.
    t_ns: Vec<i64>,
    usual_ns: i64,
}

impl<'a> Between<'a> {
    pub fn of(track: &'a Track) -> Self {
        let intervals = track.windows(2).map(|pair| pair[1].0 - pair[0].0);
        let usual_ns = usual(intervals.filter(|ns| *ns > 0).collect());
        let mut t_ns = Vec::with_capacity(track.len());
        let mut last_ns = None;
        for packet in track.chunk_by(|a, b| a.0 == b.0) {
            let (at_ns, count) = (packet[0].0, packet.len() as i64);
            let before_ns = last_ns.map_or(usual_ns, |last| usual_ns.min(at_ns - last));
            t_ns.extend((1..=count).map(|k| at_ns - before_ns / count * (count - k)));
            last_ns = Some(at_ns);
        }
        Between {
            track,
            t_ns,
            usual_ns,
        }
    }

    /// The value at a time: exact on a sample, linear between two without a hole.
    pub fn at(&self, t_ns: i64) -> Option<[f64; 3]> {
        let (before, after, share) = self.place(t_ns)?;
        let [(_, v0), (_, v1)] = [before, after].map(|row| self.track[row]);
        Some(std::array::from_fn(|axis| {
            v0[axis] + share * (v1[axis] - v0[axis])
        }))
    }

    /// Between which two samples a time lies, which may be one, and where.
    fn place(&self, t_ns: i64) -> Option<(usize, usize, f64)> {
        let after = self.t_ns.partition_point(|t| *t < t_ns);
        let t1 = *self.t_ns.get(after)?;
        if t1 == t_ns {
            return Some((after, after, 0.0));
        }
        let before = after.checked_sub(1)?;
        let interval_ns = t1 - self.t_ns[before];
        let is_long = |usual_ns: i64| interval_ns > usual_ns.saturating_mul(3);
        if is_long(self.usual_ns) && is_long(self.usual_near(after)) {
            return None;
        }
        let share = (t_ns - self.t_ns[before]) as f64 / interval_ns as f64;
        Some((before, after, share))
    }

    /// The median of the intervals before and behind the one that ends with a sample, ns.
    fn usual_near(&self, end: usize) -> i64 {
        let from = end.saturating_sub(AROUND + 1);
        let to = (end + AROUND + 1).min(self.t_ns.len());
        let intervals = (from + 1..to).filter(|k| *k != end);
        usual(intervals.map(|k| self.t_ns[k] - self.t_ns[k - 1]).collect())
    }
}

/// The median; 0 of none.
fn usual(mut intervals_ns: Vec<i64>) -> i64 {
    intervals_ns.sort_unstable();
    intervals_ns
        .get(intervals_ns.len() / 2)
        .copied()
        .unwrap_or(0)
}

/// How many samples of one track lie where the other has none.
pub(super) fn unpaired(of: &Between<'_>, other: &Between<'_>) -> usize {
    of.t_ns
        .iter()
        .filter(|t| other.place(**t).is_none())
        .count()
}

/// The note that some of all samples lack something, where these are more than a few.
pub(super) fn told(some: usize, all: usize, what: &str) -> Option<String> {
    (some as f64 > MANY * all as f64).then(|| format!("{some} of {all} {what}"))
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

/// A device's name out of that of a file, whose ending does not count, or of a folder, in which a dot ends nothing.
pub(super) fn device_name(path: &str) -> String {
    let path = Path::new(path);
    let name = match path.is_dir() {
        true => path.file_name(),
        false => path.file_stem(),
    };
    spelled(name.and_then(OsStr::to_str).unwrap_or_default())
}

/// A device's name as topics take it: letters, digits, `_` and `-`.
pub(super) fn spelled(name: &str) -> String {
    let name: String = name
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

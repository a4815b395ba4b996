//! Long logs of fast sensors, thinned while they are read: the mean of so many samples stands for them, so that memory stays bounded.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use recording::Signal;
use recording::read::{Batch, Column, ReadError, Recording};
use recording::signal::field_of;

use super::columns::{ACCEL, GYRO, GYRO_MARK, STAMPS};
use crate::inputs::Window;
use crate::roles::{Role, Roles};
use crate::summary::seconds;

/// Bytes that the estimates hold per sample of the rath's sensor, and of a carrier's (measured on 300,000 and 600,000; they hold many columns at once).
const RATH_BYTES: u64 = 850;
const CARRIER_BYTES: u64 = 550;
/// What the estimates may hold (bytes) before sensors are thinned; and where they are thinned to the least rate, before there are none: two hours of a
/// rath and four carriers.
const MOST_BYTES: u64 = 360_000_000;
const LAST_BYTES: u64 = 1_400_000_000;
/// Sensors are thinned to the first of these rates (Hz), or to the next where that is not enough: what moves on shoulders lies below a tenth of either.
const LEAST_HZ: [f64; 2] = [100.0, 50.0];
/// No device samples faster (Hz): such a log was written at once, and the stamps tell the rate.
const MOST_HZ: f64 = 2e4;

/// How many samples of each topic become one; 1 where all are kept, of what lies within `part`. `Ok(Err)` gives the number of samples that are too
/// many all the same.
///
/// # Errors
/// Where the file cannot be read.
pub fn factors(
    recording: &Recording,
    roles: &Roles,
    part: Window,
) -> Result<Result<BTreeMap<String, usize>, u64>, ReadError> {
    let info = recording.info();
    let span_s = (info.end_ns.saturating_sub(info.start_ns)) as f64 / 1e9;
    let rath = roles.topic(Role::Imu);
    let part_s = part.end_s.min(span_s) - part.start_s.max(0.0);
    let share = match part == Window::ALL {
        true => 1.0,
        false => (part_s / span_s.max(1e-9)).clamp(0.0, 1.0),
    };
    let span_s = share * span_s;
    let messages = |topic: &str| -> u64 {
        let of_topic = info.channels.iter().filter(|c| c.topic == topic);
        let all: u64 = of_topic.map(|c| c.messages).sum();
        (share * all as f64).round() as u64
    };
    let weight = |topic: &str| match rath == Some(topic) {
        true => RATH_BYTES,
        false => CARRIER_BYTES,
    };
    let topics: BTreeSet<&str> = roles.inertial().into_iter().collect();
    let all = |factors: Vec<usize>| -> BTreeMap<String, usize> {
        let names = topics.iter().map(|topic| (*topic).to_owned());
        names.zip(factors).collect()
    };
    let whole: u64 = topics.iter().map(|t| messages(t) * weight(t)).sum();
    if whole <= MOST_BYTES {
        return Ok(Ok(all(vec![1; topics.len()])));
    }
    let by_log = |topic: &str| messages(topic) as f64 / span_s.max(1e-9);
    let stamped_s = match topics.iter().any(|topic| by_log(topic) > MOST_HZ) {
        true => stamped_s(recording)?,
        false => BTreeMap::new(),
    };
    let hz = |topic: &str| match stamped_s.get(topic) {
        Some(span_s) if by_log(topic) > MOST_HZ => messages(topic) as f64 / span_s,
        _ => by_log(topic),
    };
    let each = topics.iter().map(|t| (messages(t), weight(t), hz(t)));
    let fits = fitting(&each.collect::<Vec<_>>()).map(all);
    Ok(fits.ok_or_else(|| topics.iter().map(|topic| messages(topic)).sum()))
}

/// How many samples become one, of sensors with so many samples of so many bytes at such a rate (Hz); `None` where the least rate is too much.
fn fitting(sensors: &[(u64, u64, f64)]) -> Option<Vec<usize>> {
    let at = |least_hz: &f64| -> Vec<usize> {
        let each = sensors.iter();
        // A rate that falls short of a multiple by what a clock errs, or by a lost sample, is that multiple.
        each.map(|(.., hz)| ((1.01 * hz / least_hz) as usize).max(1))
            .collect()
    };
    let fits = |(factors, most_bytes): &(Vec<usize>, u64)| {
        let each = sensors.iter().zip(factors);
        let bytes: u64 = each.map(|((n, bytes, _), f)| n / *f as u64 * bytes).sum();
        bytes <= *most_bytes
    };
    let tried = LEAST_HZ.iter().map(at).zip([MOST_BYTES, LAST_BYTES]);
    Some(tried.into_iter().find(fits)?.0)
}

/// From the first to the last stamp of each topic that has stamps, s.
fn stamped_s(recording: &Recording) -> Result<BTreeMap<String, f64>, ReadError> {
    let mut ends: BTreeMap<String, (i64, i64)> = BTreeMap::new();
    recording.stream(&|_| false, &mut |batch| {
        for &stamp in batch.stamps_ns.unwrap_or_default() {
            let topic = ends.entry(batch.topic.to_owned());
            let ends = topic.or_insert((stamp, stamp));
            *ends = (ends.0.min(stamp), ends.1.max(stamp));
        }
    })?;
    let span_s = |(first, last): (i64, i64)| (i128::from(last) - i128::from(first)) as f64 / 1e9;
    let each = ends.into_iter().map(|(topic, ends)| (topic, span_s(ends)));
    Ok(each.filter(|(_, span_s)| *span_s > 0.0).collect())
}

/// The inertial columns and stamps of the topics whose factor is above 1, of all where only a part is read: means over so many samples in the order of
/// the file, at log times.
/// Samples that are not finite are left out, and of a sensor that gives angular velocities those without one.
pub fn read(
    recording: &Recording,
    factors: &BTreeMap<String, usize>,
    part: Window,
) -> Result<Vec<Signal>, ReadError> {
    let topics: Vec<&str> = factors
        .iter()
        .filter(|(_, factor)| **factor > 1 || part != Window::ALL)
        .map(|(topic, _)| topic.as_str())
        .collect();
    if topics.is_empty() {
        return Ok(Vec::new());
    }
    let wanted = |path: &str| {
        topics
            .iter()
            .find_map(|topic| field_of(path, topic))
            .is_some_and(|f| COLUMNS.contains(&f) || f == GYRO_MARK)
    };
    let mut sensors: BTreeMap<&str, Sensor> = topics
        .iter()
        .map(|topic| (*topic, Sensor::new(factors[*topic])))
        .collect();
    let start_ns = recording.info().start_ns;
    let within = |t_ns: i64| part.contains(seconds(start_ns, t_ns));
    recording.stream(&wanted, &mut |batch| {
        if let Some(sensor) = sensors.get_mut(batch.topic) {
            sensor.take(batch, &within);
        }
    })?;
    Ok(sensors
        .into_iter()
        .flat_map(|(topic, sensor)| sensor.signals(topic))
        .collect())
}

/// What is averaged. A mean of whole seconds near 2·10⁹ is good to 10⁻⁷ s.
const COLUMNS: [&str; 9] = [
    GYRO[0],
    GYRO[1],
    GYRO[2],
    ACCEL[0],
    ACCEL[1],
    ACCEL[2],
    STAMPS[0][0],
    STAMPS[0][1],
    STAMPS[1][1],
];

/// One sensor on the way.
struct Sensor {
    factor: usize,
    /// Samples in the sums, their first time (ns), the sum of the times since then (ns), the sums of the columns.
    count: usize,
    first_ns: i64,
    since_ns: i64,
    sums: [f64; COLUMNS.len()],
    times_ns: Vec<i64>,
    columns: [Vec<f64>; COLUMNS.len()],
    /// The columns that the sensor has.
    has: [bool; COLUMNS.len()],
    /// Samples that say they have no angular velocity, and whether there are others.
    marked: usize,
    turns: bool,
}

impl Sensor {
    fn new(factor: usize) -> Self {
        Sensor {
            factor,
            count: 0,
            first_ns: 0,
            since_ns: 0,
            sums: [0.0; COLUMNS.len()],
            times_ns: Vec::new(),
            columns: Default::default(),
            has: [false; COLUMNS.len()],
            marked: 0,
            turns: false,
        }
    }

    fn take(&mut self, batch: &Batch<'_>, within: &impl Fn(i64) -> bool) {
        let mut parts: [Option<Cow<'_, [f64]>>; COLUMNS.len()] = Default::default();
        let mut mark = None;
        for column in batch.columns {
            let field = column.path.get(batch.topic.len() + 1..).unwrap_or_default();
            if let Some(k) = COLUMNS.iter().position(|c| *c == field) {
                parts[k] = Some(by_row(column, batch.times_ns.len()));
                // Samples until now lacked it.
                if !std::mem::replace(&mut self.has[k], true) {
                    self.columns[k].fill(f64::NAN);
                    self.sums[k] = if self.count > 0 { f64::NAN } else { 0.0 };
                }
            } else if field == GYRO_MARK {
                mark = Some(by_row(column, batch.times_ns.len()));
            }
        }
        for (row, &t_ns) in batch.times_ns.iter().enumerate() {
            let sample: [f64; COLUMNS.len()] = std::array::from_fn(|k| match &parts[k] {
                Some(values) => values[row],
                None if self.has[k] => f64::NAN,
                None => 0.0,
            });
            if !sample.iter().all(|x| x.is_finite()) || !within(t_ns) {
                continue;
            }
            match mark.as_ref().is_some_and(|mark| mark[row] == -1.0) {
                true => {
                    self.marked += 1;
                    if self.turns {
                        continue;
                    }
                }
                // The first with a rate: those before it are without.
                false if !self.turns && self.marked > 0 => {
                    (self.turns, self.count) = (true, 0);
                    self.times_ns.clear();
                    self.columns.iter_mut().for_each(Vec::clear);
                }
                false => self.turns = true,
            }
            if self.count == 0 {
                (self.first_ns, self.since_ns, self.sums) = (t_ns, 0, [0.0; COLUMNS.len()]);
            }
            self.count += 1;
            self.since_ns = self.since_ns.wrapping_add(t_ns.wrapping_sub(self.first_ns));
            for (sum, x) in self.sums.iter_mut().zip(sample) {
                *sum += x;
            }
            if self.count == self.factor {
                // OK because a factor is far below 2⁶³.
                self.times_ns.push(
                    self.first_ns
                        .wrapping_add(self.since_ns / self.factor as i64),
                );
                for (column, sum) in self.columns.iter_mut().zip(self.sums) {
                    column.push(sum / self.factor as f64);
                }
                self.count = 0;
            }
        }
    }

    fn signals(self, topic: &str) -> Vec<Signal> {
        let signal = |field: &str, times_ns: &[i64], values: Vec<f64>| Signal {
            topic: topic.to_owned(),
            path: format!("{topic}.{field}"),
            unit: String::new(),
            times_ns: times_ns.into(),
            values,
        };
        let mut signals: Vec<Signal> = Vec::new();
        if !self.turns {
            let marks = vec![-1.0; self.times_ns.len()];
            signals.push(signal(GYRO_MARK, &self.times_ns, marks));
        }
        for ((field, values), has) in COLUMNS.iter().zip(self.columns).zip(self.has) {
            if has {
                signals.push(signal(field, &self.times_ns, values));
            }
        }
        signals
    }
}

/// A column's value in each message of a batch of so many, NaN where it has none.
fn by_row<'a>(column: &Column<'a>, messages: usize) -> Cow<'a, [f64]> {
    let Some(rows) = column.rows else {
        return column.values.into();
    };
    let mut out = vec![f64::NAN; messages];
    for (row, x) in rows.iter().zip(column.values) {
        out[*row as usize] = *x;
    }
    out.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column<'a>(path: &'a str, values: &'a [f64]) -> Column<'a> {
        Column {
            id: 0,
            path,
            rows: None,
            values,
            finite: false,
        }
    }

    fn batch<'a>(times_ns: &'a [i64], columns: &'a [Column<'a>]) -> Batch<'a> {
        Batch {
            channel: 0,
            topic: "/a",
            schema: "",
            times_ns,
            stamps_ns: None,
            columns,
        }
    }

    #[test]
    fn no_more_is_thinned_than_has_to_be() {
        let hours = |hours: f64, hz: f64, bytes: u64| ((3600.0 * hours * hz) as u64, bytes, hz);
        let of_three = |h: f64, hz: f64| {
            let carrier = hours(h, hz, CARRIER_BYTES);
            fitting(&[hours(h, hz, RATH_BYTES), carrier, carrier])
        };
        assert_eq!(of_three(0.4, 199.9), Some(vec![2; 3]));
        assert_eq!(of_three(1.0, 199.9), Some(vec![4; 3]));
        assert_eq!(of_three(1.0, 99.99), Some(vec![2; 3]));
        assert_eq!(of_three(1.0, 50.0), Some(vec![1; 3]));
        assert_eq!(of_three(3.9, 99.99), Some(vec![2; 3]));
        assert_eq!(of_three(4.2, 99.99), None);
        let carrier = hours(1.0, 100.0, CARRIER_BYTES);
        let of_nine = [vec![hours(1.0, 200.0, RATH_BYTES)], vec![carrier; 8]].concat();
        assert_eq!(fitting(&of_nine), Some([vec![4], vec![2; 8]].concat()));
    }

    #[test]
    fn means_stand_for_samples_across_batches() {
        let mut sensor = Sensor::new(4);
        let mut x = Vec::new();
        for length in [3usize, 5, 1, 8] {
            let from = x.len();
            let values: Vec<f64> = (from..from + length)
                .map(|k| if k == 6 { f64::NAN } else { k as f64 })
                .collect();
            let times_ns: Vec<i64> = (from..from + length).map(|k| 1_000 * k as i64).collect();
            let columns = [column("/a.linear_acceleration.x", &values)];
            sensor.take(&batch(&times_ns, &columns), &|_| true);
            x.extend(values);
        }
        let signals = sensor.signals("/a");
        assert_eq!(signals.len(), 1, "{signals:?}");
        // 0 1 2 3, 4 5 7 8, 9 10 11 12, 13 14 15 16.
        assert_eq!(signals[0].values, [1.5, 6.0, 10.5, 14.5]);
        assert_eq!(*signals[0].times_ns, [1_500, 6_000, 10_500, 14_500]);
    }

    /// A sensor that has a value in some messages of a batch, in none of another, and of another field only from some batch on.
    #[test]
    fn a_message_without_a_value_is_no_sample() {
        let values: Vec<f64> = (0..12).map(f64::from).collect();
        let times_ns: Vec<i64> = (0..12).collect();
        let mut sensor = Sensor::new(2);
        let x = column("/a.linear_acceleration.x", &values[..6]);
        sensor.take(&batch(&times_ns[..6], &[x]), &|_| true);
        let rows = [0, 2, 3];
        let x = Column {
            rows: Some(&rows),
            ..column("/a.linear_acceleration.x", &[6.0, 8.0, 9.0])
        };
        let y = column("/a.linear_acceleration.y", &values[6..]);
        sensor.take(&batch(&times_ns[6..], &[x, y]), &|_| true);
        sensor.take(&batch(&times_ns[6..], &[y]), &|_| true);
        // Beyond the part that is read.
        sensor.take(&batch(&times_ns[6..], &[x, y]), &|_| false);
        let signals = sensor.signals("/a");
        let [x, y] = &signals[..] else {
            panic!("{signals:?}")
        };
        assert_eq!(x.values, [0.5, 2.5, 4.5, 7.0]);
        assert!(y.values[..3].iter().all(|y| y.is_nan()), "{y:?}");
        assert_eq!(y.values[3], 7.0);
        assert_eq!(*y.times_ns, [0, 2, 4, 7]);
    }

    #[test]
    fn stamps_are_thinned_with_their_samples() {
        let stamps_ns: Vec<i64> = (0..12)
            .map(|k| 1_764_000_000_900_000_000 + 10_000_000 * k)
            .collect();
        let times_ns: Vec<i64> = stamps_ns.iter().map(|s| s + 7).collect();
        let of =
            |f: fn(&i64) -> i64| -> Vec<f64> { stamps_ns.iter().map(|s| f(s) as f64).collect() };
        let (x, sec) = (vec![0.0; 12], of(|s| s / 1_000_000_000));
        let nanosec = of(|s| s % 1_000_000_000);
        let mut sensor = Sensor::new(3);
        let columns = [
            column("/a.linear_acceleration.x", &x),
            column("/a.header.stamp.sec", &sec),
            column("/a.header.stamp.nanosec", &nanosec),
        ];
        sensor.take(&batch(&times_ns, &columns), &|_| true);
        let signals = sensor.signals("/a");
        let of = |field: &str| {
            &signals
                .iter()
                .find(|s| s.path.ends_with(field))
                .unwrap()
                .values
        };
        for (k, (sec, nanosec)) in of("stamp.sec").iter().zip(of("nanosec")).enumerate() {
            let since = (sec - 1_764_000_000.0) + nanosec / 1e9;
            assert!((since - (0.91 + 0.03 * k as f64)).abs() < 1e-6, "{since}");
        }
    }

    #[test]
    fn of_a_sensor_that_turns_only_samples_with_a_rate_count() {
        let times_ns: Vec<i64> = (0..8).collect();
        let values: Vec<f64> = (0..8).map(f64::from).collect();
        for (mark, left) in [
            ([-1.0, -1.0, 0.0, 0.0, -1.0, 0.0, 0.0, -1.0], vec![2.5, 5.5]),
            ([-1.0; 8], vec![0.5, 2.5, 4.5, 6.5]),
        ] {
            let mut sensor = Sensor::new(2);
            let columns = [
                column("/a.linear_acceleration.x", &values),
                column("/a.angular_velocity_covariance[0]", &mark),
            ];
            sensor.take(&batch(&times_ns, &columns), &|_| true);
            let signals = sensor.signals("/a");
            let x = signals.iter().find(|s| s.path.ends_with(".x")).unwrap();
            assert_eq!(x.values, left);
            assert_eq!(signals.len(), 1 + usize::from(mark == [-1.0; 8]));
        }
    }
}

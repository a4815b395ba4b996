//! What is read of sensors and beats: their columns by topic, and when each value was taken.

use std::collections::BTreeMap;
use std::sync::Arc;

use recording::read::{ReadError, Recording};
use recording::signal::{Signal, field_of, seconds_since};

use super::dates::{Dated, are_two, dated, delay_s, ends_s, mixed};
use crate::imu::Track;
use crate::imu::held::without_held;
use crate::imu::stray::strays;
use crate::imu::track::period_s;

/// The six columns of an inertial message.
pub(crate) const GYRO: [&str; 3] = [
    "angular_velocity.x",
    "angular_velocity.y",
    "angular_velocity.z",
];
pub(crate) const ACCEL: [&str; 3] = [
    "linear_acceleration.x",
    "linear_acceleration.y",
    "linear_acceleration.z",
];
/// ROS's mark of a field that the sensor does not have.
pub(super) const GYRO_MARK: &str = "angular_velocity_covariance[0]";
pub(super) const ACCEL_MARK: &str = "linear_acceleration_covariance[0]";

/// Seconds and nanoseconds of a header's stamp, as ROS 2 and as ROS 1 name them.
pub(super) const STAMPS: [[&str; 2]; 2] = [
    ["header.stamp.sec", "header.stamp.nanosec"],
    ["header.stamp.sec", "header.stamp.nsec"],
];
/// Fields of a beat: its number and its own time.
pub(super) const BEAT: [&str; 2] = ["number", "time_s"];
/// Two sensors' accelerations differ by more than this, m/s², RMS. At longer steps, s, the overtones of a gait go back and forth from sample to sample too.
const TWO_M_PER_S2: f64 = 1.0;
const LONGEST_STEP_OF_TWO_S: f64 = 0.05;
/// More samples than this share left out are worth a word.
const MANY: f64 = 0.01;

/// What is read of an inertial sensor.
pub(super) struct Sensor {
    pub track: Track,
    /// When samples that count as lost were taken, though they are there (s).
    pub strays_s: Vec<f64>,
    /// Whether it has a gyroscope, and an accelerometer.
    pub turns: bool,
    pub feels: bool,
    /// Whether it is two, whose samples come by turns.
    pub two: bool,
    pub remarks: Vec<(&'static str, String)>,
}

/// Signals by topic.
pub(super) struct Columns {
    pub signals: Vec<Signal>,
    pub start_ns: i64,
}

impl Columns {
    /// The signals of a topic are put on one axis, that of all its messages: a message that lacks a field is NaN in it, so that what stands side by
    /// side was measured together.
    pub(super) fn new(mut signals: Vec<Signal>, start_ns: i64) -> Self {
        let mut topics: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for (k, signal) in signals.iter().enumerate() {
            topics.entry(&signal.topic).or_default().push(k);
        }
        let topics: Vec<Vec<usize>> = topics.into_values().collect();
        for of_topic in topics {
            let mut axis = signals[of_topic[0]].times_ns.clone();
            for k in &of_topic[1..] {
                let own = &signals[*k].times_ns;
                if !Arc::ptr_eq(&axis, own) && axis != *own {
                    axis = union(&axis, own).into();
                }
            }
            for k in of_topic {
                let signal = &mut signals[k];
                if signal.times_ns != axis {
                    signal.values = placed(signal, &axis);
                }
                signal.times_ns = axis.clone();
            }
        }
        Columns { signals, start_ns }
    }

    pub(super) fn get(&self, topic: &str, field: &str) -> Option<&Signal> {
        self.signals
            .iter()
            .find(|s| field_of(&s.path, topic) == Some(field))
    }

    pub(super) fn values<const N: usize>(
        &self,
        topic: &str,
        fields: [&str; N],
    ) -> Option<[&[f64]; N]> {
        let found: Vec<&[f64]> = fields
            .iter()
            .filter_map(|f| Some(&self.get(topic, f)?.values[..]))
            .collect();
        found.try_into().ok()
    }

    /// A sensor's header stamps, seconds and nanoseconds.
    fn stamps(&self, topic: &str) -> Option<[&[f64]; 2]> {
        STAMPS.iter().find_map(|names| self.values(topic, *names))
    }

    /// A topic's stamps (s), on one clock with those of the others that were stamped in the same span of time.
    fn stamp_s(&self, topic: &str, stamped: &[&str]) -> Option<Vec<f64>> {
        let ends = |topic: &str| {
            let [sec, nanosec] = self.stamps(topic)?;
            // A clock that is not set yet says 0.
            let set = sec.iter().zip(nanosec).map(|(s, ns)| s + ns / 1e9);
            ends_s(set.filter(|s| *s != 0.0))
        };
        let own = ends(topic)?;
        let meanwhile = |t: &&&str| ends(t).is_some_and(|(a, b)| a <= own.1 && own.0 <= b);
        let beside: Vec<&str> = stamped.iter().filter(meanwhile).copied().collect();
        let firsts = beside.iter().filter_map(|t| Some(ends(t)?.0));
        let first_s = firsts.fold(own.0, f64::min);
        let since = |topic: &str| {
            let [sec, nanosec] = self.stamps(topic)?;
            // Whole seconds first: a date has no digits left for nanoseconds.
            let (whole_s, part_s) = (first_s.floor(), first_s.fract());
            let since = move |(s, ns): (&f64, &f64)| (s - whole_s) + (ns / 1e9 - part_s);
            Some(sec.iter().zip(nanosec).map(since))
        };
        let moved_s = delay_s(beside.iter().flat_map(|t| {
            let log_s = self.get(t, STAMPS[0][0]).map(|s| s.times_s(self.start_ns));
            let each = log_s
                .into_iter()
                .flatten()
                .zip(since(t).into_iter().flatten());
            each.map(|(l, s)| l - s)
        }));
        Some(since(topic)?.map(|s| s + moved_s).collect())
    }

    /// When the values of a topic's field were taken.
    pub(super) fn dates(&self, topic: &str, field: &str, stamped: &[&str]) -> Option<Dated> {
        let signal = self.get(topic, field)?;
        let stamp_s = self.stamp_s(topic, stamped);
        Some(dated(signal.times_s(self.start_ns), stamp_s))
    }

    pub(super) fn sensor(&self, topic: &str, dated: Dated) -> Option<Sensor> {
        let accel = self.values(topic, ACCEL)?;
        let n = accel[0].len();
        let Dated {
            mut t_s,
            overtaken,
            remark,
            ..
        } = dated;
        let mut remarks: Vec<_> = remark.into_iter().collect();
        let gyro = self.values(topic, GYRO);
        // Samples without a rate among others that have one are holes; a sensor that never gives one still tells steps.
        let mark = self.get(topic, GYRO_MARK).map(|s| &s.values[..]);
        let mark = mark.filter(|mark| mark.len() == n);
        let marked = |k: usize| mark.is_some_and(|mark| mark[k] == -1.0);
        let without = (0..n).filter(|k| marked(*k)).count();
        let turns = gyro.is_some() && without < n;
        let feels = self.get(topic, ACCEL_MARK);
        let feels = feels.is_none_or(|mark| mark.values.iter().any(|m| !m.is_nan() && *m != -1.0));
        if turns && without > 0 {
            for (k, t) in t_s.iter_mut().enumerate() {
                if marked(k) {
                    *t = f64::NAN;
                }
            }
            remarks.push((
                "no_rate",
                format!("{without} of {n} samples have no angular velocity and are left out"),
            ));
        }
        let still = vec![0.0; n];
        let gyro = gyro.filter(|_| turns).unwrap_or([&still, &still, &still]);
        let [x, y, z] = gyro;
        let mut columns = [&t_s, x, y, z, accel[0], accel[1], accel[2]];
        let sorted;
        if overtaken {
            let mut order: Vec<usize> = (0..n).collect();
            // What has no time comes last and is left out.
            order.sort_by(|a, b| t_s[*a].total_cmp(&t_s[*b]));
            sorted = columns.map(|x| order.iter().map(|k| x[*k]).collect::<Vec<f64>>());
            columns = sorted.each_ref().map(|x| &x[..]);
        }
        let mixed = mixed(columns[0], &columns[1..]);
        let mut once;
        if let Some(first) = mixed.first() {
            let many: usize = mixed.iter().map(|mixed| mixed.len()).sum();
            remarks.push((
                "mixed",
                format!(
                    "{many} samples come twice as often as the others, first from {:.3} to {:.3} s: a clock was set back, and they are left out; what follows stands that much too early",
                    columns[0][first.start],
                    columns[0][first.end - 1]
                ),
            ));
            once = columns[0].to_vec();
            for k in mixed.into_iter().flatten() {
                once[k] = f64::NAN;
            }
            columns[0] = &once;
        }
        let often = period_s(columns[0]).is_some_and(|s| s <= LONGEST_STEP_OF_TWO_S);
        let two = often && are_two(&columns[4..], TWO_M_PER_S2);
        let [t_s, x, y, z, accel @ ..] = columns;
        let mut track = Track::from_columns(t_s, [x, y, z], accel);
        let dropped = track.dropped - if turns { without } else { 0 };
        if dropped as f64 > MANY * n as f64 {
            remarks.push((
                "left_out",
                format!("{dropped} of {n} samples are left out: not finite, beyond any sensor's range, or no later than the one before"),
            ));
        }
        if let Some((new, told)) = without_held(&track) {
            remarks.push(("held", told));
            track = new;
        }
        let strays = strays(&track);
        Some(Sensor {
            strays_s: strays.iter().map(|k| track.t_s[*k]).collect(),
            track: track.without(&strays),
            turns,
            feels,
            two,
            remarks,
        })
    }

    fn any(&self, topic: &str) -> Option<&Signal> {
        let mut all = self.signals.iter();
        all.find(|s| field_of(&s.path, topic).is_some())
    }

    /// Times of a topic's messages, s.
    pub(super) fn times(&self, topic: &str) -> Vec<f64> {
        let of = |s: &Signal| seconds_since(&s.times_ns, self.start_ns);
        let mut t_s = self.any(topic).map(of).unwrap_or_default();
        t_s.dedup();
        t_s
    }

    /// When a topic's beats are (s), their numbers where each has one, and what there is to say. Messages may come late, in packets, or not at all:
    /// a beat's own time and number know better.
    pub(super) fn beats(
        &self,
        topic: &str,
    ) -> (Vec<f64>, Option<Vec<f64>>, Option<(&'static str, String)>) {
        let Some(any) = self.any(topic) else {
            return Default::default();
        };
        let [number, own_s] = BEAT.map(|field| {
            let values = self.get(topic, field).map(|s| &s.values[..]);
            values.filter(|v| v.len() == any.values.len() && v.iter().all(|v| v.is_finite()))
        });
        let log_s = seconds_since(&any.times_ns, self.start_ns);
        let (t_s, remark) = match own_s {
            Some(own_s) => never_early(own_s, &log_s),
            None => {
                let Dated { t_s, remark, .. } = dated(log_s, None);
                (t_s, remark)
            }
        };
        let mut beats: Vec<(f64, usize)> = t_s.into_iter().zip(0..).collect();
        beats.sort_by(|a, b| a.0.total_cmp(&b.0));
        beats.dedup_by(|b, a| b.0 <= a.0);
        let number = number.map(|number| beats.iter().map(|(_, k)| number[*k]).collect());
        (beats.into_iter().map(|b| b.0).collect(), number, remark)
    }
}

/// Ascending times of both, each as often as in that which has it more often.
fn union(a: &[i64], b: &[i64]) -> Vec<i64> {
    let mut out = Vec::with_capacity(a.len().max(b.len()));
    let (mut i, mut j) = (0, 0);
    while let Some(next) = a.get(i).into_iter().chain(b.get(j)).min() {
        i += usize::from(a.get(i) == Some(next));
        j += usize::from(b.get(j) == Some(next));
        out.push(*next);
    }
    out
}

/// The signal's values on an axis that holds its times; NaN where it has none, and at times that several messages share unless all have one:
/// nobody knows then whose is missing.
fn placed(signal: &Signal, axis: &[i64]) -> Vec<f64> {
    let mut out = Vec::with_capacity(axis.len());
    let mut next = 0;
    for messages in axis.chunk_by(|a, b| a == b) {
        let own = signal.times_ns[next..].iter();
        let count = own.take_while(|t| **t == messages[0]).count();
        match count == messages.len() {
            true => out.extend_from_slice(&signal.values[next..next + count]),
            false => out.resize(out.len() + messages.len(), f64::NAN),
        }
        next += count;
    }
    out
}

/// When the messages of a topic were stamped, or else that they came, whatever is in them: of beats, each is one.
///
/// # Errors
/// Where the file cannot be read.
pub(super) fn came(recording: &Recording, topic: &str) -> Result<Signal, ReadError> {
    let start_ns = recording.info().start_ns;
    let (mut times_ns, mut own_s, mut stamped) = (Vec::new(), Vec::new(), true);
    recording.stream(&|_| false, &mut |batch| {
        if batch.topic == topic {
            times_ns.extend_from_slice(batch.times_ns);
            stamped &= batch.stamps_ns.is_some();
            own_s.extend(seconds_since(
                batch.stamps_ns.unwrap_or(batch.times_ns),
                start_ns,
            ));
        }
    })?;
    // Whoever fills no stamps in leaves them at one time.
    let differ = own_s.windows(2).any(|w| w[0] != w[1]);
    let field = if stamped && differ { BEAT[1] } else { "log" };
    Ok(Signal {
        topic: topic.to_owned(),
        path: format!("{topic}.{field}"),
        unit: "s".into(),
        times_ns: times_ns.into(),
        values: own_s,
    })
}

/// No two clocks of quartz part faster, ppm: delays that grow faster are a queue's, or of a clock that was set.
const MOST_PPM: f64 = 200.0;

/// Beats' own times on the log's clock: moved so that none lies behind its log time, and stretched where the delays surely grow or fall as clocks part. Beats
/// are few: the clocks' drift from the earliest of them alone would bend how carriers come to the beat.
fn never_early(own_s: &[f64], log_s: &[f64]) -> (Vec<f64>, Option<(&'static str, String)>) {
    let n = own_s.len() as f64;
    let delay_s: Vec<f64> = log_s.iter().zip(own_s).map(|(l, s)| l - s).collect();
    let mean = |x: &[f64]| x.iter().sum::<f64>() / n;
    let (middle_s, usual_s) = (mean(own_s), mean(&delay_s));
    let (mut tt, mut td, mut dd) = (0.0, 0.0, 0.0);
    for (s, d) in own_s.iter().zip(&delay_s) {
        let (t, d) = (s - middle_s, d - usual_s);
        (tt, td, dd) = (tt + t * t, td + t * d, dd + d * d);
    }
    // Squares of the slope and of three of its standard errors.
    let sure = td * td * (n - 2.0) > 9.0 * (dd * tt - td * td);
    let found = if sure { td / tt } else { 0.0 };
    let of_clocks = (1e6 * found).abs() <= MOST_PPM;
    let slope = if of_clocks { found } else { 0.0 };
    let remark = (!of_clocks).then(|| {
        let text = format!(
            "what beats come late by changes by {:+.0} ppm: no two clocks part like that, so messages queued up or a clock was set, and the least late tell when all were",
            1e6 * found
        );
        ("late_beats", text)
    });
    let late = |(d, s): (&f64, &f64)| d - slope * (s - middle_s);
    let least_s = delay_s.iter().zip(own_s).map(late).fold(f64::MAX, f64::min);
    let moved = |s: &f64| s + least_s + slope * (s - middle_s);
    (own_s.iter().map(moved).collect(), remark)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beat::lock::Course;
    use crate::inputs::Window;

    /// Of 100 samples every 10 ms those that have a rate.
    fn read(has_rate: impl Fn(usize) -> bool) -> Sensor {
        let times_ns: Arc<[i64]> = (0..100).map(|k| k * 10_000_000).collect();
        let column = |field: &str, values: Vec<f64>| Signal {
            topic: "/imu/rath".into(),
            path: format!("/imu/rath.{field}"),
            unit: String::new(),
            times_ns: times_ns.clone(),
            values,
        };
        let mark = |k| if has_rate(k) { 0.0 } else { -1.0 };
        let mut signals = vec![column(GYRO_MARK, (0..100).map(mark).collect())];
        for field in GYRO.iter().chain(&ACCEL) {
            signals.push(column(field, vec![1.0; 100]));
        }
        let start_ns = 0;
        let columns = Columns::new(signals, start_ns);
        let dates = columns
            .dates("/imu/rath", ACCEL[0], &["/imu/rath"])
            .unwrap();
        columns.sensor("/imu/rath", dates).unwrap()
    }

    #[test]
    fn samples_without_a_rate_are_left_out_where_others_have_one() {
        let late = read(|k| (3..50).contains(&k) || k > 60);
        assert!(late.turns && late.track.len() == 86);
        assert_eq!((late.track.t_s[0], late.track.t_s[47]), (0.03, 0.61));
        assert!(late.track.gyro_rad_per_s.iter().all(|w| *w == [1.0; 3]));
        let [(kind, text)] = &late.remarks[..] else {
            panic!("{:?}", late.remarks)
        };
        assert!(
            *kind == "no_rate" && text.starts_with("14 of 100"),
            "{text}"
        );
        // A pedometer has none at all, and its steps still count.
        let never = read(|_| false);
        assert!(!never.turns && never.track.len() == 100);
    }

    /// Fields that some messages lack; three messages share a time, and one of them lacks a field.
    #[test]
    fn a_message_that_lacks_a_field_is_a_hole_in_it() {
        let nan = f64::NAN;
        let signal = |field: &str, times_ns: &[i64], values: &[f64]| Signal {
            topic: "/t".into(),
            path: format!("/t.{field}"),
            unit: String::new(),
            times_ns: times_ns.into(),
            values: values.to_vec(),
        };
        let signals = vec![
            signal(
                "a",
                &[1, 3, 4, 4, 4, 5],
                &[10.0, 30.0, 40.0, 41.0, 42.0, 50.0],
            ),
            signal("b", &[1, 2, 4, 4, 6], &[11.0, 21.0, 43.0, 44.0, 61.0]),
        ];
        let columns = Columns::new(signals, 0);
        let [a, b] = columns.values("/t", ["a", "b"]).unwrap();
        let same = |x: &[f64], y: &[f64]| {
            let bits = |x: &[f64]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(x), bits(y), "{x:?}");
        };
        same(a, &[10.0, nan, 30.0, 40.0, 41.0, 42.0, 50.0, nan]);
        same(b, &[11.0, 21.0, nan, nan, nan, nan, nan, 61.0]);
        assert_eq!(*columns.signals[0].times_ns, [1, 2, 3, 4, 4, 4, 5, 6]);
    }

    #[test]
    fn sensors_of_a_log_that_was_written_at_once_keep_their_clock() {
        // One began 2 s after the other; ROS 1 and ROS 2 name their stamps differently.
        let since_s = [
            ("/imu/rath", "nanosec", 0.0),
            ("/imu/carrier_1", "nsec", 2.0),
        ];
        let mut signals = Vec::new();
        for (topic, nanosec, begins_s) in since_s {
            let mut column = |field: &str, value: &dyn Fn(i64) -> f64| {
                signals.push(Signal {
                    topic: topic.into(),
                    path: format!("{topic}.{field}"),
                    unit: String::new(),
                    times_ns: vec![9; 600].into(),
                    values: (0..600).map(value).collect(),
                });
            };
            let ns = |k: i64| 1_764_000_000_900_000_000 + (begins_s * 1e9) as i64 + 10_000_000 * k;
            column(ACCEL[0], &|_| 9.8);
            column("header.stamp.sec", &|k| (ns(k) / 1_000_000_000) as f64);
            let rest = |k| (ns(k) % 1_000_000_000) as f64;
            column(&format!("header.stamp.{nanosec}"), &rest);
        }
        let start_ns = 9;
        let columns = Columns::new(signals, start_ns);
        let topics = since_s.map(|s| s.0);
        for (topic, _, begins_s) in since_s {
            let dates = columns.dates(topic, ACCEL[0], &topics).unwrap();
            let off = |(k, t): (usize, &f64)| (t - begins_s - 0.01 * k as f64).abs();
            let worst = dates.t_s.iter().enumerate().map(off).fold(0.0, f64::max);
            assert!(worst < 1e-6, "{topic}: {worst}");
        }
    }

    /// Beats on a clock of their own, as they came: none is moved behind its log time, the least late lie on it, and only a drift that shows is one.
    #[test]
    fn beats_are_moved_to_the_logs_clock_by_what_surely_shows() {
        let mut random = crate::random::Random(11);
        let own_s: Vec<f64> = (0..200).map(|k| 100.0 + 0.5 * f64::from(k)).collect();
        let late_s: Vec<f64> = (0..200).map(|_| -0.004 * random.uniform().ln()).collect();
        // 0.15 ms fast in a second is seen by 100 s, whose delays scatter by 4 ms; 1 µs is not, and 3 ms is of no clock.
        for (drift, delays, seen) in [
            (0.0, 1.0, 0.0),
            (1.5e-4, 0.0, 1.5e-4),
            (1.5e-4, 1.0, 1.5e-4),
            (3e-3, 1.0, 0.0),
            (1e-6, 1.0, 0.0),
        ] {
            let there = |t: f64| 7.0 + t + drift * (t - 100.0);
            let log_s: Vec<f64> = own_s
                .iter()
                .zip(&late_s)
                .map(|(t, l)| there(*t) + delays * l)
                .collect();
            let (found, remark) = never_early(&own_s, &log_s);
            assert_eq!(remark.is_some(), drift == 3e-3);
            let least = found
                .iter()
                .zip(&log_s)
                .map(|(f, l)| l - f)
                .fold(f64::MAX, f64::min);
            assert!(least.abs() < 1e-9, "{drift}: {least}");
            let pace = (found[199] - found[0]) / (own_s[199] - own_s[0]) - 1.0;
            // Three standard errors of a slope through 200 delays of SD 4 ms over 100 s: 3 · 4 ms √12 / (√200 · 100 s).
            let within = if seen > 0.0 {
                3e-5 * delays + 1e-9
            } else {
                1e-12
            };
            assert!((pace - seen).abs() < within, "{drift}: {pace}");
        }
    }

    #[test]
    fn beats_that_come_late_or_together_keep_their_own_times_and_numbers() {
        let mut random = crate::random::Random(3);
        let mut loose = || 2e7 - 3e6 * random.normal();
        let late_ns: Vec<f64> = (0..120).map(|_| loose()).collect();
        let together = |k: usize| f64::from(u8::try_from(4 - k % 5).unwrap()) * 4.65e8;
        for packets in [false, true] {
            let kept = |k: &usize| k % 11 != 3 && !(50..70).contains(k);
            let number: Vec<usize> = (0..120).filter(kept).collect();
            let came = |k: &usize| {
                let late_ns = if packets { together(*k) } else { late_ns[*k] };
                (*k as f64 * 4.65e8 + late_ns) as i64
            };
            let times_ns: Arc<[i64]> = number.iter().map(came).collect();
            let column = |field: &str, scale: f64| Signal {
                topic: "/beat".into(),
                path: format!("/beat.{field}"),
                unit: String::new(),
                times_ns: times_ns.clone(),
                values: number.iter().map(|k| scale * *k as f64).collect(),
            };
            let signals = vec![column("number", 1.0), column("time_s", 0.465)];
            let start_ns = 0;
            let (t_s, numbers, _) = Columns::new(signals, start_ns).beats("/beat");
            let course = Course::of(&t_s, numbers.as_deref());
            let (hz, _) = course.tempo(Window::ALL).unwrap();
            assert!((hz * 0.465 - 1.0).abs() < 1e-9, "{hz}");
            assert!(course.phase(&[30.0])[0].is_finite());
        }
    }
}

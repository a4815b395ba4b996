//! A field recording: inertial sensors, beats and truth of a recording, put through the numeric core.
//!
//! [`Field::read`] takes what plays the roles `imu`, `carriers`, `beats` and `truth`; [`Field::fill`] gives the metrics' columns that
//! nothing else gave; [`Field::finish`] adds intervals, step rates, clocks and, where asked, errors against the truth.

mod align;
mod carriers;
mod clocks;
pub(crate) mod dates;
mod judge;
mod place;
mod sound;
mod thin;

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

use recording::read::{ReadError, Recording};
use recording::signal::{Signal, field_of, seconds_since};
use recording::text::counted;

use crate::beat::lock::Course;
use crate::events::Event;
use crate::imu::Track;
use crate::imu::interval;
use crate::imu::orientation::Options;
use crate::imu::rath::{self, Motion, Settings};
use crate::imu::unloading::unloadings;
use crate::inputs::{Inputs, Window};
use crate::metrics::{Metrics, Value, metrics_of};
use crate::quality::Quality;
use crate::roles::{Role, Roles, Sensors, about_the_load};
use carriers::Carriers;
use clocks::Clocks;
use dates::{Dated, dated, delay_s, ends_s};
use judge::Judge;
use sound::Heard;

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
const GYRO_MARK: &str = "angular_velocity_covariance[0]";
const ACCEL_MARK: &str = "linear_acceleration_covariance[0]";

/// Seconds and nanoseconds of a header's stamp, as ROS 2 and as ROS 1 name them.
const STAMPS: [[&str; 2]; 2] = [
    ["header.stamp.sec", "header.stamp.nanosec"],
    ["header.stamp.sec", "header.stamp.nsec"],
];
/// Fields of a beat: its number and its own time.
const BEAT: [&str; 2] = ["number", "time_s"];
/// More samples than this share left out are worth a word.
const MANY: f64 = 0.01;

/// What is done about the clocks of sensors that differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DeviceClocks {
    /// They are put right, and it is said how.
    #[default]
    PutRight,
    /// They are left as they are, and it is said how they differ.
    Told,
    /// Nothing: all sensors were stamped by one clock, and what looks like an offset between carriers is theirs.
    One,
}

/// What a recording's sensors say.
#[derive(Default)]
pub struct Field {
    topic: Option<String>,
    motion: Option<Motion>,
    no_motion: Option<String>,
    carriers: Carriers,
    beat_s: Vec<f64>,
    /// Their numbers, where they have some.
    beat_number: Option<Vec<f64>>,
    beat_source: &'static str,
    judge: Option<Judge>,
    filled: Filled,
    quality: Vec<Quality>,
    /// By topic, when a sensor's first and last samples were taken (s), where the log does not tell.
    pub own_s: BTreeMap<String, (f64, f64)>,
}

/// Which groups of columns came from here.
#[derive(Default)]
struct Filled {
    motion: bool,
    phases: bool,
    beat: bool,
}

impl Field {
    /// Reads the sensors' topics; nothing when the recording has none. Clocks are put on the rath's by taps, or the carriers' on each other by
    /// their motion, as `devices` says. `window` is asked with the time of the sensors' last sample (s).
    ///
    /// # Errors
    /// Where the file cannot be read.
    pub fn read(
        recording: &Recording,
        roles: &Roles,
        gravity_m_per_s2: f64,
        truth: bool,
        devices: DeviceClocks,
        window: impl FnOnce(f64) -> Window,
    ) -> Result<Self, ReadError> {
        let topics: Vec<&str> = [Role::Imu, Role::Carriers, Role::Beats, Role::Truth]
            .iter()
            .flat_map(|r| roles.patterns(*r))
            .map(String::as_str)
            .filter(|t| recording.info().channels.iter().any(|c| c.topic == *t))
            .collect();
        let imus = roles
            .patterns(Role::Imu)
            .iter()
            .chain(roles.patterns(Role::Carriers));
        let mut field = Self::default();
        let sound = field.listen(recording)?;
        let senses = imus.clone().next().is_some() || roles.topic(Role::Beats).is_some();
        if topics.is_empty() || !(senses || truth) {
            return Ok(field);
        }
        let factors = match thin::factors(recording, roles)? {
            Ok(factors) => factors,
            Err(samples) => {
                field.quality.push(Quality::remark(
                    "",
                    "too_long",
                    format!("motion is not estimated from {samples} inertial samples, which would take too much memory: name fewer sensors in a roles file, or give a part of the recording"),
                ));
                return Ok(field);
            }
        };
        let thinned = |topic: &str| factors.get(topic).is_some_and(|factor| *factor > 1);
        let wanted = |path: &str| {
            let mut whole = topics.iter().filter(|t| !thinned(t));
            let field = whole.find_map(|topic| field_of(path, topic));
            field.is_some_and(|field| {
                GYRO.contains(&field)
                    || ACCEL.contains(&field)
                    || field == GYRO_MARK
                    || field == ACCEL_MARK
                    || STAMPS.as_flattened().contains(&field)
                    || judge::wants(field)
                    || BEAT.contains(&field)
            }) || (truth && path.starts_with(judge::STEP_TOPIC))
        };
        let (mut signals, _) = recording.signals(&wanted)?;
        signals.extend(thin::read(recording, &factors)?);
        for (topic, factor) in factors.iter().filter(|(_, factor)| **factor > 1) {
            field.quality.push(Quality::remark(
                topic,
                "thinned",
                format!("motion is estimated from means over {factor} samples each, so that memory stays small"),
            ));
        }
        let start_ns = recording.info().start_ns;
        let columns = Columns { signals, start_ns };
        let sensors: Vec<&str> = imus.clone().map(String::as_str).collect();
        let stamped = [&sensors, roles.topic(Role::Truth).as_slice()].concat();
        let dates = |topic: &&str| columns.dates(topic, ACCEL[0], &stamped);
        let dates: Vec<Option<Dated>> = sensors.iter().map(dates).collect();
        for (topic, dated) in sensors.iter().zip(&dates) {
            let own_s = dated.as_ref().and_then(Dated::own_s);
            field
                .own_s
                .extend(own_s.map(|ends| ((*topic).to_owned(), ends)));
        }
        let window = window(field.last_s());
        let places = place::places(recording);
        let options = options(place::is_simulated(recording), &roles.sensors);
        let one_clock = devices == DeviceClocks::One;
        let leave = devices == DeviceClocks::Told;
        let mut clocks = Clocks::default();
        for (topic, dated) in imus.zip(dates) {
            let Some(Sensor {
                mut track,
                turns,
                feels,
                remarks,
            }) = dated.and_then(|dated| columns.sensor(topic, dated))
            else {
                continue;
            };
            let said = remarks.into_iter();
            let said = said.map(|(kind, text)| Quality::remark(topic, kind, text));
            field.quality.extend(said);
            let is_rath = roles.topic(Role::Imu) == Some(topic.as_str());
            if !is_rath && roles.patterns(Role::Imu).contains(topic) {
                if !one_clock {
                    clocks.hold_against(topic, &track);
                }
                continue;
            }
            if !one_clock {
                if is_rath {
                    clocks = Clocks::of_rath(topic, &track, leave);
                } else {
                    clocks.put_right(topic, &mut track);
                }
            }
            if is_rath {
                let here = places.get(topic).copied().unwrap_or_default();
                let settings = Settings {
                    orientation: options,
                    gravity_m_per_s2,
                    level_over: window,
                    ..here.or_as_said(&roles.sensors)
                };
                field.topic = Some(topic.clone());
                let lacking = |what, mark| Some(format!("no {what} ({mark} is -1)"));
                match (turns, feels) {
                    (true, true) => field.motion(topic, &track, settings),
                    (false, _) => field.no_motion = lacking("gyroscope", GYRO_MARK),
                    (_, false) => field.no_motion = lacking("accelerometer", ACCEL_MARK),
                }
            }
            if !feels {
                continue;
            }
            // The one sensor of a walker's phone plays the rath's role for want of another: steps tell.
            if !is_rath || (roles.patterns(Role::Carriers).is_empty() && !about_the_load(topic)) {
                field.carriers.add(topic, &track, options);
            }
        }
        if let Some(topic) = roles.topic(Role::Beats) {
            let (told, number, remark) = columns.beats(topic);
            if told.len() >= 3 {
                (field.beat_s, field.beat_source) = (told, "beat");
                field.beat_number = number;
                let said = remark.map(|(kind, text)| Quality::remark(topic, kind, text));
                field.quality.extend(said);
            }
        }
        if let Some((topic, onset_s)) = sound
            && field.beat_source == "sound"
        {
            clocks.put_sound_right(&topic, &onset_s, &mut field.beat_s);
        }
        if !one_clock && !clocks.any_set {
            field.align(roles, leave);
        }
        field.quality.append(&mut clocks.remarks);
        if truth {
            field.judge = Judge::read(&columns, roles, recording, &stamped);
        }
        Ok(field)
    }

    /// Beats from sound, where the recording has sound; its topic and all that begins in it (s).
    fn listen(&mut self, recording: &Recording) -> Result<Option<(String, Vec<f64>)>, ReadError> {
        let Some(heard) = sound::listen(recording)? else {
            return Ok(None);
        };
        let Heard {
            topic,
            onset_s,
            beats,
            remarks,
        } = heard;
        let said = remarks.into_iter();
        self.quality
            .extend(said.map(|text| Quality::remark(&topic, "sound", text)));
        match beats {
            Ok(found) => {
                self.beat_s = found.beat_s;
                self.beat_source = "sound";
            }
            Err(error) => self
                .quality
                .push(Quality::remark(&topic, "no_beat", error.to_string())),
        }
        Ok(Some((topic, onset_s)))
    }

    fn motion(&mut self, topic: &str, track: &Track, settings: Settings) {
        match rath::motion(track, &settings) {
            Ok(motion) => {
                if motion.left_out_s > 0.0 {
                    self.quality.push(Quality::remark(
                        topic,
                        "holes",
                        format!(
                            "motion is estimated in {} without a hole, {:.2} s are left out; within {:.1} s of a hole there is no height",
                            counted(motion.stretches.len() as u64, "stretch", "stretches"),
                            motion.left_out_s,
                            rath::BESIDE_HOLES / settings.height_corner_hz
                        ),
                    ));
                }
                self.motion = Some(motion);
            }
            Err(error) => self.no_motion = Some(error.to_string()),
        }
    }

    /// Puts the carriers' clocks on each other, by the motion of the rath that they all drive, or says how with `leave`.
    fn align(&mut self, roles: &Roles, leave: bool) {
        if roles.patterns(Role::Carriers).len() >= 2 {
            self.quality
                .extend(self.carriers.align(self.motion.as_ref(), leave));
        }
    }

    /// Gives `inputs` the columns that it lacks.
    pub fn fill(&mut self, inputs: &mut Inputs) {
        if let Some(motion) = &self.motion
            && inputs.t_s.is_empty()
        {
            let seen = &motion.inputs;
            inputs.t_s.clone_from(&seen.t_s);
            inputs.height_m.clone_from(&seen.height_m);
            inputs.roll_rad.clone_from(&seen.roll_rad);
            inputs.pitch_rad.clone_from(&seen.pitch_rad);
            if inputs.normal_n.is_empty() {
                inputs.support_ratio.clone_from(&seen.support_ratio);
                inputs.sources.forces = "imu".into();
            }
            inputs.sources.attitude = "imu".into();
            inputs.sources.height = "imu".into();
            // With the same corner as the body's height, so that their difference is a compression.
            let corner_hz = motion.settings.height_corner_hz;
            inputs.heave_m = self.carriers.heave_m(&inputs.t_s, corner_hz);
            self.filled.motion = true;
        }
        inputs.step_s = self.carriers.step_s();
        if inputs.phase_rad.is_empty()
            && let Some((t_s, phases)) = self.carriers.phases()
        {
            self.filled.phases = true;
            self.fill_phases(inputs, t_s, phases);
        }
        // Without anybody's phases it still beats.
        if inputs.phase_rad.is_empty() && inputs.beat_phase_rad.is_empty() && self.beat_s.len() >= 3
        {
            self.filled.beat = true;
            inputs.beat_phase_rad = self.course().phase(&inputs.t_s);
            inputs.sources.beat = self.beat_source.into();
        }
    }

    fn course(&self) -> Course {
        Course::of(&self.beat_s, self.beat_number.as_deref())
    }

    fn fill_phases(&self, inputs: &mut Inputs, t_s: Vec<f64>, phases: Vec<Vec<f64>>) {
        // As the project's own recordings count phases: 0 is on the way up, and a step, where the walker pushes hardest, at −π/2.
        let counted = |phase: Vec<f64>| phase.into_iter().map(|p| p - FRAC_PI_2).collect();
        inputs.phase_rad = phases.into_iter().map(counted).collect();
        inputs.phases_are_measured = true;
        inputs.sources.phases = "imu".into();
        if self.beat_s.len() >= 3 {
            inputs.beat_phase_rad = self.course().phase(&t_s);
            inputs.sources.beat = self.beat_source.into();
        }
        inputs.phase_t_s = t_s;
    }

    /// Adds to the metrics of `inputs` what only the sensors know: intervals, reasons, and errors against the truth.
    pub fn finish(&self, inputs: &Inputs, metrics: &mut Metrics, window: Window) {
        let asked = self.filled.motion
            || self.filled.phases
            || self.judge.is_some()
            || !self.beat_s.is_empty();
        let estimated = if asked {
            self.estimated(window)
        } else {
            Metrics::default()
        };
        for (name, value) in &mut metrics.0 {
            let ours = if interval::gives(name) {
                self.filled.motion
            } else {
                self.filled.phases && carriers::gives(name)
            };
            if ours && let Some(v) = estimated.get(name) {
                *value = v.clone();
            }
            if let (Some(topic), Some(why)) = (&self.topic, &self.no_motion)
                && interval::gives(name)
                && value.reason.is_some()
                && value.as_f64().is_none()
                && value.as_word().is_none()
            {
                value.reason = Some(format!("{topic}: {why}"));
            }
        }
        if let Some(v) = estimated.get("beat_hz")
            && let Some((_, value)) = metrics.0.iter_mut().find(|(name, value)| {
                *name == "beat_hz" && (self.filled.beat || value.as_f64().is_none())
            })
        {
            *value = v.clone();
        }
        if let Some(judge) = &self.judge {
            judge.errors(
                self.motion.as_ref(),
                &self.carriers,
                &estimated,
                metrics,
                inputs.phase_rad.len(),
                window,
            );
        }
    }

    /// Every metric as the sensors alone give it.
    fn estimated(&self, window: Window) -> Metrics {
        let mut out = Metrics::default();
        if let Some(motion) = &self.motion {
            out = interval::metrics(motion, window);
        }
        if (self.filled.phases || self.judge.is_some())
            && let Some(phases) = self.carriers.phases()
        {
            let as_of = |(t_s, phases), wanted: fn(&str) -> bool| {
                let mut inputs = Inputs::default();
                self.fill_phases(&mut inputs, t_s, phases);
                metrics_of(&inputs, window, wanted)
            };
            let mut together = as_of(phases, carriers::gives);
            let detected = self.carriers.detected();
            let detected =
                detected.map(|p| as_of(p, |n| n == "synchrony" || n == "pull_rad_per_s"));
            let others: Vec<f64> = self
                .carriers
                .phases_else()
                .filter_map(|p| as_of(p, |n| n == "synchrony").number("synchrony"))
                .collect();
            self.carriers
                .interval(&mut together, &detected.unwrap_or_default(), &others);
            out.0.extend(together.0);
        }
        // Taps and talk before and behind the music are heard too.
        if let Some((hz, half)) = self.course().tempo(window) {
            out.0.retain(|(name, _)| *name != "beat_hz");
            out.0.push((
                "beat_hz",
                Value {
                    unit: "Hz",
                    ..Value::number(hz)
                        .source(self.beat_source)
                        .ci95(hz - half, hz + half)
                },
            ));
        }
        out
    }

    /// When the last sample was taken of the sensors of which the log does not tell (s); 0 where it tells of all.
    pub fn last_s(&self) -> f64 {
        self.own_s.values().map(|e| e.1).fold(0.0, f64::max)
    }

    /// Whether there is a truth to judge by.
    pub fn has_truth(&self) -> bool {
        self.judge.is_some()
    }

    /// Steps, beats heard and unloading, as events.
    pub fn events(&self) -> Vec<Event> {
        let mut out = self.carriers.events();
        if self.beat_source == "sound" {
            out.extend(self.beat_s.iter().map(|t| Event {
                t_s: *t,
                kind: "beat",
                what: "heard".into(),
            }));
        }
        if let (Some(motion), true) = (&self.motion, self.filled.motion) {
            let s = &motion.inputs;
            out.extend(
                unloadings(&s.t_s, &s.support_ratio)
                    .into_iter()
                    .map(|t_s| Event {
                        t_s,
                        kind: "unloaded",
                        what: "support falls below 0.05 of the weight".into(),
                    }),
            );
        }
        out
    }

    /// What is odd about the sensors.
    pub fn quality(&mut self) -> Vec<Quality> {
        let mut out = std::mem::take(&mut self.quality);
        if let (Some(topic), Some(why)) = (&self.topic, &self.no_motion) {
            out.push(Quality::remark(topic, "absent_field", why.clone()));
        }
        out.extend(self.carriers.quality());
        out
    }
}

/// What the user says of the samples' age; else those of a simulated sensor are true at their stamps, and others as old as usual.
fn options(simulated: bool, said: &Sensors) -> Options {
    let usual = if simulated {
        Options::without_latency()
    } else {
        Options::default()
    };
    Options {
        latency_s: said.gyro_age_s.unwrap_or(usual.latency_s),
        accel_latency_s: said.accel_age_s.unwrap_or(usual.accel_latency_s),
        ..usual
    }
}

/// What is read of an inertial sensor.
struct Sensor {
    track: Track,
    /// Whether it has a gyroscope, and an accelerometer.
    turns: bool,
    feels: bool,
    remarks: Vec<(&'static str, String)>,
}

/// Signals by topic.
struct Columns {
    signals: Vec<Signal>,
    start_ns: i64,
}

impl Columns {
    fn get(&self, topic: &str, field: &str) -> Option<&Signal> {
        self.signals
            .iter()
            .find(|s| field_of(&s.path, topic) == Some(field))
    }

    fn values<const N: usize>(&self, topic: &str, fields: [&str; N]) -> Option<[&[f64]; N]> {
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
    fn dates(&self, topic: &str, field: &str, stamped: &[&str]) -> Option<Dated> {
        let signal = self.get(topic, field)?;
        let stamp_s = self.stamp_s(topic, stamped);
        Some(dated(signal.times_s(self.start_ns), stamp_s))
    }

    fn sensor(&self, topic: &str, dated: Dated) -> Option<Sensor> {
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
        let feels = feels.is_none_or(|mark| mark.values.iter().any(|m| *m != -1.0));
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
        let [t_s, x, y, z, accel @ ..] = columns;
        let track = Track::from_columns(t_s, [x, y, z], accel);
        let dropped = track.dropped - if turns { without } else { 0 };
        if dropped as f64 > MANY * n as f64 {
            remarks.push((
                "left_out",
                format!("{dropped} of {n} samples are left out: not finite, beyond any sensor's range, or no later than the one before"),
            ));
        }
        Some(Sensor {
            track,
            turns,
            feels,
            remarks,
        })
    }

    fn any(&self, topic: &str) -> Option<&Signal> {
        let mut all = self.signals.iter();
        all.find(|s| field_of(&s.path, topic).is_some())
    }

    /// Times of a topic's messages, s.
    fn times(&self, topic: &str) -> Vec<f64> {
        let of = |s: &Signal| seconds_since(&s.times_ns, self.start_ns);
        let mut t_s = self.any(topic).map(of).unwrap_or_default();
        t_s.dedup();
        t_s
    }

    /// When a topic's beats are (s), their numbers where each has one, and what there is to say. Messages may come late, in packets, or not at all:
    /// a beat's own time and number know better.
    fn beats(&self, topic: &str) -> (Vec<f64>, Option<Vec<f64>>, Option<(&'static str, String)>) {
        let Some(any) = self.any(topic) else {
            return Default::default();
        };
        let [number, own_s] = BEAT.map(|field| {
            let values = self.get(topic, field).map(|s| &s.values[..]);
            values.filter(|v| v.len() == any.values.len() && v.iter().all(|v| v.is_finite()))
        });
        let log_s = seconds_since(&any.times_ns, self.start_ns);
        let (t_s, remark) = match own_s {
            Some(own_s) => (never_early(own_s, &log_s), None),
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

/// Beats' own times on the log's clock: moved so that none lies behind its log time, and stretched where the delays surely grow or fall. Beats are
/// few: the clocks' drift from the earliest of them alone would bend how carriers come to the beat.
fn never_early(own_s: &[f64], log_s: &[f64]) -> Vec<f64> {
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
    let slope = if sure { td / tt } else { 0.0 };
    let late = |(d, s): (&f64, &f64)| d - slope * (s - middle_s);
    let least_s = delay_s.iter().zip(own_s).map(late).fold(f64::MAX, f64::min);
    let moved = |s: &f64| s + least_s + slope * (s - middle_s);
    own_s.iter().map(moved).collect()
}

/// Metadata records by name, as a reader gives them.
type Records = BTreeMap<String, BTreeMap<String, String>>;

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 100 samples every 10 ms those that have a rate.
    fn read(has_rate: impl Fn(usize) -> bool) -> Sensor {
        let times_ns: std::sync::Arc<[i64]> = (0..100).map(|k| k * 10_000_000).collect();
        let column = |field: &str, values: Vec<f64>| Signal {
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
        let columns = Columns { signals, start_ns };
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
        let columns = Columns { signals, start_ns };
        let topics = since_s.map(|s| s.0);
        for (topic, _, begins_s) in since_s {
            let dates = columns.dates(topic, ACCEL[0], &topics).unwrap();
            let off = |(k, t): (usize, &f64)| (t - begins_s - 0.01 * k as f64).abs();
            let worst = dates.t_s.iter().enumerate().map(off).fold(0.0, f64::max);
            assert!(worst < 1e-6, "{topic}: {worst}");
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
            let times_ns: std::sync::Arc<[i64]> = number.iter().map(came).collect();
            let column = |field: &str, scale: f64| Signal {
                path: format!("/beat.{field}"),
                unit: String::new(),
                times_ns: times_ns.clone(),
                values: number.iter().map(|k| scale * *k as f64).collect(),
            };
            let signals = vec![column("number", 1.0), column("time_s", 0.465)];
            let start_ns = 0;
            let (t_s, numbers, _) = Columns { signals, start_ns }.beats("/beat");
            let course = Course::of(&t_s, numbers.as_deref());
            let (hz, _) = course.tempo(Window::ALL).unwrap();
            assert!((hz * 0.465 - 1.0).abs() < 1e-9, "{hz}");
            assert!(course.phase(&[30.0])[0].is_finite());
        }
    }
}

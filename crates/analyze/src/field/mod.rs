//! A field recording: inertial sensors, beats and truth of a recording, put through the numeric core.
//!
//! [`Field::read`] takes what plays the roles `imu`, `carriers`, `beats` and `truth`; [`Field::fill`] gives the metrics' columns that
//! nothing else gave; [`Field::finish`] adds intervals, step rates, clocks and, where asked, errors against the truth.

mod align;
mod carriers;
mod clocks;
mod columns;
pub(crate) mod dates;
mod halves;
mod judge;
mod place;
mod sound;
mod thin;

#[cfg(test)]
pub(crate) use judge::wants as is_of_truth;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::FRAC_PI_2;

use recording::read::{ReadError, Recording};
use recording::signal::field_of;
use recording::text::counted;

use crate::beat::lock::Course;
use crate::events::Event;
use crate::imu::Track;
use crate::imu::axes::misfit;
use crate::imu::bias::far_off;
use crate::imu::bridge;
use crate::imu::frozen::frozen;
use crate::imu::interval::{self, Lost};
use crate::imu::orientation::Options;
use crate::imu::rath::{self, Motion, Settings};
use crate::imu::saturation::saturated;
use crate::imu::stray;
use crate::imu::track::Instrument;
use crate::imu::unit::other_unit;
use crate::imu::unloading::unloadings;
use crate::inputs::{self, Inputs, Window};
use crate::metrics::{Metrics, Value, metrics_of};
use crate::quality::Quality;
use crate::request::{DeviceClocks, Request};
use crate::roles::{Role, Roles, Sensors, about_the_load, stands_beside};
use carriers::Carriers;
use clocks::Clocks;
pub(crate) use columns::{ACCEL, GYRO};
use columns::{ACCEL_MARK, BEAT, Columns, GYRO_MARK, STAMPS, Sensor};
use dates::Dated;
use judge::Judge;
use sound::Heard;

/// What a recording's sensors say.
#[derive(Default)]
pub struct Field {
    topic: Option<String>,
    motion: Option<Motion>,
    no_motion: Option<String>,
    /// What the sensor of the motion did not tell within the window.
    lost: Vec<Lost>,
    /// What those of the carriers did not.
    carriers_lost: Vec<Lost>,
    /// The sensors that these are, and the kinds of the remarks that say why.
    doubts: BTreeSet<(String, &'static str)>,
    carriers: Carriers,
    beat_s: Vec<f64>,
    /// Their numbers, where they have some.
    beat_number: Option<Vec<f64>>,
    beat_source: &'static str,
    /// Whether nothing tells how the clock of the sound that they were heard in stands to the others.
    sound_is_adrift: bool,
    judge: Option<Judge>,
    filled: Filled,
    quality: Vec<Quality>,
    /// By topic, when a sensor's first and last samples were taken (s), where the log does not tell.
    pub own_s: BTreeMap<String, (f64, f64)>,
}

/// Of a log that is too long for memory so much is read before and behind the window, s.
const ABOUT_S: f64 = 60.0;

/// A pose and a sensor that lean by so different an amount are not on one body: by this factor and as many degrees more.
const OTHER_BODY: f64 = 1.5;
const OTHER_BODY_DEG: f64 = 1.0;

/// What hangs on when a beat is heard beside a step, or on when the beat began.
const BY_SOUNDS_CLOCK: [&str; 5] = [
    "beat_lead_deg",
    "detuning_rad_per_s",
    "pull_rad_per_s",
    "coupling_rad_per_s",
    "captured",
];

/// Which groups of columns came from here.
#[derive(Default)]
struct Filled {
    motion: bool,
    phases: bool,
    beat: bool,
}

impl Field {
    /// Reads the sensors' topics; nothing when the recording has none. Clocks are put on the rath's by taps, or the carriers' on each other by
    /// their motion, as the request says. Beats are read beside sensors, and where the beat is not known. `window` is asked with the time of the
    /// sensors' last sample (s); of a log that is too long, what lies about the window of the request is read.
    ///
    /// # Errors
    /// Where the file cannot be read.
    pub fn read(
        recording: &Recording,
        roles: &Roles,
        gravity_m_per_s2: f64,
        request: &Request,
        beat_is_known: bool,
        window: impl FnOnce(f64) -> Window,
    ) -> Result<Self, ReadError> {
        let (truth, devices, asked) = (request.truth, request.clocks, request.asked());
        let others = [Role::Beats, Role::Truth];
        let others = others.iter().flat_map(|r| roles.patterns(*r));
        let topics: Vec<&str> = (roles.inertial().into_iter())
            .chain(others.map(String::as_str))
            .filter(|t| recording.info().channels.iter().any(|c| c.topic == *t))
            .collect();
        let imus = roles
            .patterns(Role::Imu)
            .iter()
            .chain(roles.patterns(Role::Carriers));
        let mut field = Self::default();
        let sound = field.listen(recording)?;
        let senses = imus.clone().next().is_some();
        let beats = roles.topic(Role::Beats).is_some() && !beat_is_known;
        if topics.is_empty() || !(senses || beats || truth) {
            return Ok(field);
        }
        let mut part = Window::ALL;
        let mut factors = thin::factors(recording, roles, part)?;
        if factors.is_err() && asked != Window::ALL {
            part = Window {
                start_s: asked.start_s - ABOUT_S,
                end_s: asked.end_s + ABOUT_S,
            };
            factors = thin::factors(recording, roles, part)?;
            if factors.is_ok() {
                let text = format!(
                    "motion is estimated from what lies within {ABOUT_S} s of the window alone: the whole would take too much memory, and taps elsewhere are not looked for"
                );
                field.quality.push(Quality::remark("", "part", text));
            }
        }
        let factors = match factors {
            Ok(factors) => factors,
            Err(samples) => {
                let why = format!(
                    "motion is not estimated from {samples} inertial samples, which would take too much memory: give a --window of an hour or two, or name fewer sensors in a roles file"
                );
                field
                    .quality
                    .push(Quality::remark("", "too_long", why.clone()));
                field.topic = roles.topic(Role::Imu).map(str::to_owned);
                field.no_motion = Some(why);
                return Ok(field);
            }
        };
        let thinned = |topic: &str| {
            let factor = factors.get(topic);
            factor.is_some_and(|factor| *factor > 1 || part != Window::ALL)
        };
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
        signals.extend(thin::read(recording, &factors, part)?);
        if let Some(topic) = roles.topic(Role::Beats)
            && !signals
                .iter()
                .any(|s| field_of(&s.path, topic) == Some(BEAT[1]))
        {
            signals.push(columns::came(recording, topic)?);
        }
        let start_ns = recording.info().start_ns;
        // What is dated long before all others belongs to no time of the recording.
        for s in signals.iter_mut().filter(|_| recording.info().early > 0) {
            let known = s.times_ns.iter().zip(&s.values);
            let known = known.filter(|(t, _)| **t >= start_ns);
            let (times_ns, values): (Vec<i64>, Vec<f64>) = known.unzip();
            (s.times_ns, s.values) = (times_ns.into(), values);
        }
        for (topic, factor) in factors.iter().filter(|(_, factor)| **factor > 1) {
            field.quality.push(Quality::remark(
                topic,
                "thinned",
                format!("motion is estimated from means over {factor} samples each, so that memory stays small"),
            ));
        }
        let mut columns = Columns::new(signals, start_ns);
        let sensors: Vec<&str> = imus.clone().map(String::as_str).collect();
        let stamped = [&roles.inertial(), roles.topic(Role::Truth).as_slice()].concat();
        for topic in &sensors {
            let told = (roles.other_half(topic))
                .and_then(|other| halves::join(&mut columns, topic, other, &stamped));
            let told = told.map(|text| Quality::remark(topic, "halves", text));
            field.quality.extend(told);
        }
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
                strays_s,
                turns,
                feels,
                two,
                remarks,
            }) = dated.and_then(|dated| columns.sensor(topic, dated))
            else {
                continue;
            };
            let said = remarks.into_iter();
            let said = said.map(|(kind, text)| Quality::remark(topic, kind, text));
            field.quality.extend(said);
            if let Some(first_s) = strays_s.first() {
                let (count, all) = (strays_s.len(), track.len() + strays_s.len());
                field.quality.push(Quality {
                    count: count as u64,
                    t_s: Some(*first_s),
                    ..Quality::remark(topic, "stray", stray::told(count, all))
                });
            }
            let is_rath = roles.topic(Role::Imu) == Some(topic.as_str());
            let carries = roles.patterns(Role::Carriers).contains(topic);
            if two {
                let why = "its samples tell of two sensors by turns, which publish under one name: give each a topic of its own";
                field
                    .quality
                    .push(Quality::remark(topic, "two_sensors", why.to_owned()));
                if is_rath {
                    field.topic = Some(topic.clone());
                    field.no_motion = Some(why.to_owned());
                }
                continue;
            }
            let within = window.range(&track.t_s);
            let mut lost = |kind, told: String, samples: &[usize], what: Option<Lost>| {
                field.quality.push(Quality {
                    count: samples.len() as u64,
                    t_s: Some(track.t_s[samples[0]]),
                    ..Quality::remark(topic, kind, told)
                });
                if samples.iter().any(|k| within.contains(k)) {
                    if let Some(what) = what.filter(|_| is_rath || carries) {
                        field.lose(topic, kind, what, is_rath);
                    }
                }
            };
            for end in saturated(&track) {
                let what = Some(Lost::Peaks(end.instrument));
                lost("saturated", end.told(track.len()), &end.samples, what);
            }
            // What a device says it does not have stands still too.
            let has = |instrument| match instrument {
                Instrument::Gyroscope => turns,
                Instrument::Accelerometer => feels,
            };
            for still in frozen(&track).into_iter().filter(|s| has(s.instrument)) {
                let all = still.axis.is_none().then_some(Lost::All(still.instrument));
                lost("frozen", still.told(track.len()), &still.samples, all);
            }
            if turns && feels {
                let said = if let Some(found) = other_unit(&track, gravity_m_per_s2) {
                    Some(("unit", found.told(), Some(Lost::Unit)))
                } else if let Some(found) = misfit(&track, gravity_m_per_s2) {
                    Some(("axes", found.told(), Some(Lost::Axes)))
                } else if let Some(found) = far_off(&track, gravity_m_per_s2) {
                    track.take_off_bias(found.bias_rad_per_s);
                    let lost = found.is_absurd().then_some(Lost::Unit);
                    Some(("bias", found.told(), lost))
                } else {
                    None
                };
                if let Some((kind, told, lost)) = said {
                    field.quality.push(Quality::remark(topic, kind, told));
                    if let Some(lost) = lost.filter(|_| is_rath) {
                        field.lose(topic, kind, lost, true);
                    } else if lost.is_some() && carries {
                        // Whatever it reads, the accelerometer alone tells steps.
                        track.gyro_rad_per_s.fill([0.0; 3]);
                    }
                }
            }
            if !is_rath && roles.patterns(Role::Imu).contains(topic) {
                if !one_clock {
                    clocks.hold_against(topic, &track);
                }
                continue;
            }
            let mut clock_sd_s = 0.0;
            if !one_clock {
                if is_rath {
                    clocks = Clocks::of_rath(topic, &track, leave);
                } else {
                    clock_sd_s = clocks.put_right(topic, &mut track, window);
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
            // The one sensor of a walker's phone plays the rath's role for want of another: steps tell. Who names it, or says where it sits on the load,
            // says what it is.
            let said = roles.is_said(Role::Imu)
                || roles.sensors.place_m.is_some()
                || roles.sensors.mounting_roll_pitch_yaw_deg.is_some();
            let alone = roles.patterns(Role::Carriers).is_empty();
            if !is_rath || (alone && !said && !about_the_load(topic)) {
                field
                    .carriers
                    .add(topic, &track, options, gravity_m_per_s2, clock_sd_s);
            }
        }
        field.quality.extend(without_a_role(recording, roles));
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
            let set = clocks.put_sound_right(&topic, &onset_s, &mut field.beat_s);
            // Messages that were logged beside the sensors' came when the log says.
            field.sound_is_adrift = !set && !one_clock && place::is_put_together(recording);
            if field.sound_is_adrift {
                let why = format!(
                    "nothing tells when this sound began beside the steps: {} have no value; tap the sensors near the microphone or say --one-clock",
                    BY_SOUNDS_CLOCK.join(", ")
                );
                field
                    .quality
                    .push(Quality::remark(&topic, "clocks_apart", why));
            }
        }
        if clocks.any_apart {
            field.carriers.clocks = inputs::Clocks::LeftApart;
        }
        field.quality.extend(field.carriers.leave_out(window));
        if !one_clock {
            field.align(roles, &clocks.set, leave);
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
                let drawn_s = motion.drawn_s();
                if drawn_s > 0.0 {
                    self.quality.push(Quality::remark(
                        topic,
                        "drawn_through",
                        format!(
                            "{drawn_s:.2} s in holes of up to {:.1} s are drawn through by what the samples beside them let expect; intervals hold what as many holes again change",
                            bridge::LONGEST_S
                        ),
                    ));
                }
                let [left_out_s, _] = motion.left_out_s(Window::ALL);
                if left_out_s > 0.0 {
                    self.quality.push(Quality::remark(
                        topic,
                        "holes",
                        format!(
                            "motion is estimated in {} without a hole, {:.2} s are left out; within {:.1} s of a hole there is no height",
                            counted(motion.stretches.len() as u64, "stretch", "stretches"),
                            left_out_s,
                            rath::BESIDE_HOLES / settings.height_corner_hz
                        ),
                    ));
                }
                if let Some(lean_deg) = motion.misdeclared_deg() {
                    self.quality.push(Quality::remark(
                        topic,
                        "mounting",
                        format!("as it is declared to be mounted, the load leans by {lean_deg:.0}° on average: it lies on its side or its back, or the sensor sits otherwise; what rests on its motion has no interval"),
                    ));
                    self.lose(topic, "mounting", Lost::Mounting, true);
                }
                if motion.forward_is_unknown() {
                    let text = "its x stands upright, and which way of it is forward nothing tells: roll and pitch may be each other, or mixed; give imu_mounting_roll_pitch_yaw_deg in a roles file";
                    self.quality
                        .push(Quality::remark(topic, "forward", text.to_owned()));
                    self.lose(topic, "forward", Lost::Forward, true);
                }
                if let Some(turned) = motion.turned() {
                    self.quality.push(Quality {
                        t_s: Some(turned.t_s),
                        ..Quality::remark(topic, "turned", turned.told())
                    });
                    self.lose(topic, "turned", Lost::Turned, true);
                }
                self.motion = Some(motion);
            }
            Err(error) => self.no_motion = Some(error.to_string()),
        }
    }

    /// Takes note of what a sensor, the rath's or a carrier's, did not tell, as a remark of this kind says.
    fn lose(&mut self, topic: &str, kind: &'static str, what: Lost, is_rath: bool) {
        self.doubts.insert((topic.to_owned(), kind));
        match is_rath {
            true => self.lost.push(what),
            false => self.carriers_lost.push(what),
        }
    }

    /// Which sensors are in doubt, one sentence each: for whoever looks at the numbers and not at the remarks.
    pub fn warnings(&self) -> impl Iterator<Item = String> {
        // Where there is no motion, it is said why.
        let silent = self.topic.as_ref().filter(|_| self.motion.is_none());
        let speaking = self
            .doubts
            .iter()
            .filter(move |(topic, _)| Some(topic) != silent);
        speaking.map(|(topic, kind)| {
            format!("{topic} is in doubt ({kind}, see the quality of the data): numbers that hang on that may be far off and have no interval")
        })
    }

    /// Puts the carriers' clocks on each other, by the motion of the rath that they all drive, or says how with `leave`.
    fn align(&mut self, roles: &Roles, set: &[String], leave: bool) {
        if roles.patterns(Role::Carriers).len() >= 2 {
            let motion = self.motion.as_ref();
            self.quality.extend(self.carriers.align(motion, set, leave));
        }
    }

    /// Gives `inputs` the columns that it lacks.
    pub fn fill(&mut self, inputs: &mut Inputs) {
        inputs.clocks = self.carriers.clocks;
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
            inputs.sources.levelled = seen.sources.levelled;
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
        // Without anybody's phases it still beats, and beside phases that somebody else told.
        if inputs.beat_phase_rad.is_empty() && self.beat_s.len() >= 3 {
            self.filled.beat = true;
            let t_s = match inputs.phase_rad.is_empty() {
                true => &inputs.t_s,
                false => inputs.phase_times(),
            };
            inputs.beat_phase_rad = self.course().phase(t_s);
            inputs.sources.beat = self.beat_source.into();
        }
    }

    /// Holds the pose that the motion is taken from against the load's sensor, and tells where they cannot be of one body.
    pub fn hold_against_pose(&mut self, inputs: &Inputs, roles: &Roles, window: Window) {
        let (Some(motion), Some(topic)) = (&self.motion, &self.topic) else {
            return;
        };
        if self.filled.motion {
            return;
        }
        // Together roll and pitch lean alike however the sensor is turned about the vertical.
        let lean_deg = |i: &Inputs| -> Option<f64> {
            let range = window.range(&i.t_s);
            let variance = |x: &[f64]| -> Option<f64> {
                let x = x.get(range.clone())?;
                let seen: Vec<f64> = x.iter().copied().filter(|x| x.is_finite()).collect();
                let mean = seen.iter().sum::<f64>() / seen.len() as f64;
                let squares = seen.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
                (seen.len() > 1).then(|| squares / seen.len() as f64)
            };
            let both = variance(&i.roll_rad)? + variance(&i.pitch_rad)?;
            Some(both.sqrt().to_degrees())
        };
        let (Some(pose_deg), Some(sensor_deg)) = (lean_deg(inputs), lean_deg(&motion.inputs))
        else {
            return;
        };
        let [less, more] = [pose_deg.min(sensor_deg), pose_deg.max(sensor_deg)];
        if more > OTHER_BODY * less + OTHER_BODY_DEG {
            let pose = roles.topic(Role::Roll).unwrap_or("the pose");
            let text = format!(
                "roll and pitch together vary by {sensor_deg:.1} deg (RMS) here, by {pose_deg:.1} deg in {pose}, from where the motion is taken: they are not of one body; imu = \"{topic}\" in a file for --roles takes it from here"
            );
            let remark = Quality::remark(topic, "two_bodies", text);
            self.quality.push(remark);
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
            if *name == "step_rate_hz" {
                self.carriers.rate_by_holes(value, window);
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
                inputs,
                window,
            );
        }
    }

    /// Every metric as the sensors alone give it.
    fn estimated(&self, window: Window) -> Metrics {
        let mut out = Metrics::default();
        if let Some(motion) = &self.motion {
            out = interval::metrics(motion, window);
            for lost in &self.lost {
                interval::without(&mut out, *lost);
            }
        }
        if (self.filled.phases || self.judge.is_some())
            && let Some(phases) = self.carriers.phases()
        {
            let as_of = |(t_s, phases), wanted: fn(&str) -> bool| {
                let mut inputs = Inputs::default();
                self.fill_phases(&mut inputs, t_s, phases);
                metrics_of(&inputs, window, wanted)
            };
            let by_holes = carriers::by_holes(&phases.0, &phases.1, window);
            let mut together = as_of(phases, carriers::gives);
            let detected = self.carriers.detected();
            let detected =
                detected.map(|p| as_of(p, |n| n == "synchrony" || n == "pull_rad_per_s"));
            let synchrony = |phases| as_of(phases, |n| n == "synchrony").number("synchrony");
            let others: Vec<f64> = self.carriers.phases_else().filter_map(synchrony).collect();
            let here = together.number("synchrony");
            let by_clocks = here.map_or(0.0, |x| {
                let each = self.carriers.phases_by_clocks();
                let farthest = each.map(|ends| {
                    let ends = ends.into_iter().flatten().filter_map(synchrony);
                    ends.map(|end| (end - x).abs()).fold(0.0, f64::max)
                });
                farthest.fold(0.0, f64::hypot)
            });
            self.carriers.interval(
                &mut together,
                &detected.unwrap_or_default(),
                &others,
                by_holes.map(|by_holes| by_clocks.hypot(by_holes)),
            );
            for lost in &self.carriers_lost {
                interval::without_those(&mut together, *lost, carriers::gives);
            }
            let adrift = |name: &&str| self.sound_is_adrift && BY_SOUNDS_CLOCK.contains(name);
            for (_, value) in together.0.iter_mut().filter(|(name, _)| adrift(name)) {
                value.withhold("nothing tells when the sound began beside the steps: tap the sensors near the microphone or say --one-clock");
            }
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
        if let (Some(topic), Some(why)) = (&self.topic, &self.no_motion)
            && out.iter().all(|q| q.kind != "too_long")
        {
            out.push(Quality::remark(topic, "absent_field", why.clone()));
        }
        out.extend(self.carriers.quality());
        out
    }
}

/// Names the inertial sensors that play no role where nobody is known to carry: their names do not say so.
fn without_a_role(recording: &Recording, roles: &Roles) -> Option<Quality> {
    let played = roles.patterns(Role::Imu);
    let told = |topic: &String| roles.chosen.iter().any(|(chosen, _)| chosen == topic);
    if !roles.patterns(Role::Carriers).is_empty() || played.iter().any(told) {
        return None;
    }
    let channels = recording.info().channels.iter();
    let mut left: Vec<&str> = channels
        .filter(|c| c.schema.replacen("/msg/", "/", 1) == "sensor_msgs/Imu")
        .map(|c| c.topic.as_str())
        .filter(|topic| {
            let plays = |topic: &str| played.iter().any(|p| p == topic);
            !roles.device(topic).any(plays) && !stands_beside(topic)
        })
        .collect();
    left.sort_unstable();
    left.dedup();
    (!left.is_empty()).then(|| {
        let text = format!(
            "{} {} left aside: no name says who carries; name them in a file for --roles, as `carriers` if they do",
            left.join(", "),
            if left.len() == 1 { "is" } else { "are" }
        );
        Quality::remark("", "no_role", text)
    })
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

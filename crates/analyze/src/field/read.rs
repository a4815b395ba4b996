//! From a recording to a [`Field`]: what is read of it, what each sensor's samples are worth, and whose clock they are put on.

use std::collections::{BTreeMap, HashMap};

use recording::read::{ReadError, Recording};
use recording::signal::{Signal, field_of};
use recording::text::counted;

use super::clocks::Clocks;
use super::columns::{ACCEL, ACCEL_MARK, BEAT, Columns, GYRO, GYRO_MARK, STAMPS, Sensor, came};
use super::dates::Dated;
use super::judge::{self, Judge};
use super::place::{self, Place};
use super::sound::{self, Heard};
use super::{BY_SOUNDS_CLOCK, Field, halves, thin};
use crate::imu::Track;
use crate::imu::axes::misfit;
use crate::imu::bias::far_off;
use crate::imu::bridge;
use crate::imu::frozen::frozen;
use crate::imu::interval::Lost;
use crate::imu::orientation::Options;
use crate::imu::rath::{self, Motion, Settings};
use crate::imu::saturation::saturated;
use crate::imu::stray;
use crate::imu::track::Instrument;
use crate::imu::unit::other_unit;
use crate::inputs::{self, Window};
use crate::quality::Quality;
use crate::request::{DeviceClocks, Request};
use crate::roles::{Role, Roles, Sensors, about_the_load, stands_beside};

/// Of a log that is too long for memory so much is read before and behind the window, s.
const ABOUT_S: f64 = 60.0;

/// How much of a recording is read: the part, and of how many samples means are taken, by topic.
struct Share {
    part: Window,
    factors: BTreeMap<String, usize>,
}

/// By what every sensor is read.
struct Reading<'a> {
    roles: &'a Roles,
    gravity_m_per_s2: f64,
    window: Window,
    options: Options,
    places: HashMap<String, Place>,
    devices: DeviceClocks,
}

/// A sensor, and whom it tells of.
struct Told<'a> {
    topic: &'a str,
    is_rath: bool,
    carries: bool,
    /// What of its two instruments it has.
    turns: bool,
    feels: bool,
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
        let mut field = Self::default();
        let sound = field.listen(recording)?;
        let sensors: Vec<&str> = [Role::Imu, Role::Carriers]
            .into_iter()
            .flat_map(|role| roles.patterns(role))
            .map(String::as_str)
            .collect();
        let beats = roles.topic(Role::Beats).is_some() && !beat_is_known;
        let topics = topics(recording, roles);
        if topics.is_empty() || sensors.is_empty() && !beats && !request.truth {
            return Ok(field);
        }
        let Some(share) = field.share(recording, roles, request.asked())? else {
            return Ok(field);
        };
        let signals = signals(recording, roles, &topics, &share, request.truth)?;
        let mut columns = Columns::new(signals, recording.info().start_ns);
        let stamped = [&roles.inertial(), roles.topic(Role::Truth).as_slice()].concat();
        let dates = field.dates(&mut columns, roles, &sensors, &stamped);
        let reading = Reading {
            roles,
            gravity_m_per_s2,
            window: window(field.last_s()),
            options: options(place::is_simulated(recording), &roles.sensors),
            places: place::places(recording),
            devices: request.clocks,
        };
        let mut clocks = Clocks::default();
        for (topic, dated) in sensors.into_iter().zip(dates) {
            if let Some(sensor) = dated.and_then(|dated| columns.sensor(topic, dated)) {
                field.take(topic, sensor, &reading, &mut clocks);
            }
        }
        field.quality.extend(without_a_role(recording, roles));
        if let Some(topic) = roles.topic(Role::Beats) {
            field.take_beats(topic, &columns);
        }
        if let Some((topic, onset_s)) = sound
            && field.beat_source == "sound"
        {
            let set = clocks.put_sound_right(&topic, &onset_s, &mut field.beat_s);
            // Messages that were logged beside the sensors' came when the log says.
            let apart = request.clocks != DeviceClocks::One && place::is_put_together(recording);
            field.sound_is_adrift = apart && !set;
            if field.sound_is_adrift {
                let why = format!(
                    "nothing tells when this sound began beside the steps: {} have no value; tap the sensors near the microphone or say --one-clock",
                    BY_SOUNDS_CLOCK.join(", ")
                );
                field.remark(&topic, "clocks_apart", why);
            }
        }
        if clocks.any_apart {
            field.carriers.clocks = inputs::Clocks::LeftApart;
        }
        field
            .quality
            .extend(field.carriers.leave_out(reading.window));
        if request.clocks != DeviceClocks::One && roles.patterns(Role::Carriers).len() >= 2 {
            // By the motion of the rath that they all drive.
            let leave = request.clocks == DeviceClocks::Told;
            let motion = field.motion.as_ref();
            let said = field.carriers.align(motion, &clocks.set, leave);
            field.quality.extend(said);
        }
        field.quality.append(&mut clocks.remarks);
        if request.truth {
            field.judge = Judge::read(&columns, roles, recording, &stamped);
        }
        Ok(field)
    }

    fn remark(&mut self, topic: &str, kind: &'static str, text: String) {
        self.quality.push(Quality::remark(topic, kind, text));
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
        for text in remarks {
            self.remark(&topic, "sound", text);
        }
        match beats {
            Ok(found) => {
                self.beat_s = found.beat_s;
                self.beat_source = "sound";
            }
            Err(error) => self.remark(&topic, "no_beat", error.to_string()),
        }
        Ok(Some((topic, onset_s)))
    }

    /// All of the recording where memory holds it, else what lies about `asked`; nothing, and a remark, where even that is too much.
    fn share(
        &mut self,
        recording: &Recording,
        roles: &Roles,
        asked: Window,
    ) -> Result<Option<Share>, ReadError> {
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
                self.remark("", "part", text);
            }
        }
        let factors = match factors {
            Ok(factors) => factors,
            Err(samples) => {
                let why = format!(
                    "motion is not estimated from {samples} inertial samples, which would take too much memory: give a --window of an hour or two, or name fewer sensors in a roles file"
                );
                self.remark("", "too_long", why.clone());
                self.topic = roles.topic(Role::Imu).map(str::to_owned);
                self.no_motion = Some(why);
                return Ok(None);
            }
        };
        for (topic, factor) in factors.iter().filter(|(_, factor)| **factor > 1) {
            let text = format!(
                "motion is estimated from means over {factor} samples each, so that memory stays small"
            );
            self.remark(topic, "thinned", text);
        }
        Ok(Some(Share { part, factors }))
    }

    /// When each sensor's samples were taken; one that publishes its two instruments apart is put together.
    fn dates(
        &mut self,
        columns: &mut Columns,
        roles: &Roles,
        sensors: &[&str],
        stamped: &[&str],
    ) -> Vec<Option<Dated>> {
        for topic in sensors {
            let told = (roles.other_half(topic))
                .and_then(|other| halves::join(columns, topic, other, stamped));
            if let Some(text) = told {
                self.remark(topic, "halves", text);
            }
        }
        let dates = sensors.iter().map(|topic| {
            let dated = columns.dates(topic, ACCEL[0], stamped);
            let own_s = dated.as_ref().and_then(Dated::own_s);
            (self.own_s).extend(own_s.map(|ends| ((*topic).to_owned(), ends)));
            dated
        });
        dates.collect()
    }

    /// Looks through one sensor's samples, puts them on the rath's clock, and takes the motion of the rath or the steps of a carrier from them.
    fn take(&mut self, topic: &str, sensor: Sensor, reading: &Reading, clocks: &mut Clocks) {
        let (roles, window) = (reading.roles, reading.window);
        let mut track = sensor.track;
        for (kind, text) in sensor.remarks {
            self.remark(topic, kind, text);
        }
        if let Some(first_s) = sensor.strays_s.first() {
            let (count, all) = (sensor.strays_s.len(), track.len() + sensor.strays_s.len());
            self.quality.push(Quality {
                count: count as u64,
                t_s: Some(*first_s),
                ..Quality::remark(topic, "stray", stray::told(count, all))
            });
        }
        let told = Told {
            topic,
            is_rath: roles.topic(Role::Imu) == Some(topic),
            carries: roles.patterns(Role::Carriers).iter().any(|t| t == topic),
            turns: sensor.turns,
            feels: sensor.feels,
        };
        if sensor.two {
            let why = "its samples tell of two sensors by turns, which publish under one name: give each a topic of its own";
            self.remark(topic, "two_sensors", why.to_owned());
            if told.is_rath {
                self.topic = Some(topic.to_owned());
                self.no_motion = Some(why.to_owned());
            }
            return;
        }
        self.see_losses(&told, &track, window);
        if told.turns && told.feels {
            self.see_scales(&told, &mut track, reading.gravity_m_per_s2);
        }
        let one_clock = reading.devices == DeviceClocks::One;
        if !told.is_rath && roles.patterns(Role::Imu).iter().any(|t| t == topic) {
            if !one_clock {
                clocks.hold_against(topic, &track);
            }
            return;
        }
        let mut clock_sd_s = 0.0;
        if !one_clock {
            if told.is_rath {
                *clocks = Clocks::of_rath(topic, &track, reading.devices == DeviceClocks::Told);
            } else {
                clock_sd_s = clocks.put_right(topic, &mut track, window);
            }
        }
        if told.is_rath {
            self.take_motion(&told, &track, reading);
        }
        // The one sensor of a walker's phone plays the rath's role for want of another: steps tell. Who names it, or says where it sits on the load,
        // says what it is.
        let said = roles.is_said(Role::Imu)
            || roles.sensors.place_m.is_some()
            || roles.sensors.mounting_roll_pitch_yaw_deg.is_some();
        let alone = roles.patterns(Role::Carriers).is_empty();
        if told.feels && (!told.is_rath || (alone && !said && !about_the_load(topic))) {
            let (options, gravity) = (reading.options, reading.gravity_m_per_s2);
            (self.carriers).add(topic, &track, options, gravity, clock_sd_s);
        }
    }

    /// Samples at the end of a range, and readings that stand still.
    fn see_losses(&mut self, told: &Told, track: &Track, window: Window) {
        let within = window.range(&track.t_s);
        let mut lost = |kind, text: String, samples: &[usize], what: Option<Lost>| {
            self.quality.push(Quality {
                count: samples.len() as u64,
                t_s: Some(track.t_s[samples[0]]),
                ..Quality::remark(told.topic, kind, text)
            });
            if samples.iter().any(|k| within.contains(k))
                && let Some(what) = what.filter(|_| told.is_rath || told.carries)
            {
                self.lose(told.topic, kind, what, told.is_rath);
            }
        };
        for end in saturated(track) {
            let what = Some(Lost::Peaks(end.instrument));
            lost("saturated", end.told(track.len()), &end.samples, what);
        }
        // What a device says it does not have stands still too.
        let has = |instrument| match instrument {
            Instrument::Gyroscope => told.turns,
            Instrument::Accelerometer => told.feels,
        };
        for still in frozen(track).into_iter().filter(|s| has(s.instrument)) {
            let all = still.axis.is_none().then_some(Lost::All(still.instrument));
            lost("frozen", still.told(track.len()), &still.samples, all);
        }
    }

    /// Other units, axes that do not belong together, and a gyroscope far off, which is put right.
    fn see_scales(&mut self, told: &Told, track: &mut Track, gravity_m_per_s2: f64) {
        let (kind, text, lost) = if let Some(found) = other_unit(track, gravity_m_per_s2) {
            ("unit", found.told(), Some(Lost::Unit))
        } else if let Some(found) = misfit(track, gravity_m_per_s2) {
            ("axes", found.told(), Some(Lost::Axes))
        } else if let Some(found) = far_off(track, gravity_m_per_s2) {
            track.take_off_bias(found.bias_rad_per_s);
            let lost = found.is_absurd().then_some(Lost::Unit);
            ("bias", found.told(), lost)
        } else {
            return;
        };
        self.remark(told.topic, kind, text);
        if let Some(lost) = lost.filter(|_| told.is_rath) {
            self.lose(told.topic, kind, lost, true);
        } else if lost.is_some() && told.carries {
            // Whatever it reads, the accelerometer alone tells steps.
            track.gyro_rad_per_s.fill([0.0; 3]);
        }
    }

    /// The motion of the load from its sensor, or why there is none.
    fn take_motion(&mut self, told: &Told, track: &Track, reading: &Reading) {
        self.topic = Some(told.topic.to_owned());
        let lacking = |what, mark| Some(format!("no {what} ({mark} is -1)"));
        if !told.turns {
            self.no_motion = lacking("gyroscope", GYRO_MARK);
            return;
        }
        if !told.feels {
            self.no_motion = lacking("accelerometer", ACCEL_MARK);
            return;
        }
        let here = (reading.places.get(told.topic).copied()).unwrap_or_default();
        let settings = Settings {
            orientation: reading.options,
            gravity_m_per_s2: reading.gravity_m_per_s2,
            level_over: reading.window,
            ..here.or_as_said(&reading.roles.sensors)
        };
        match rath::motion(track, &settings) {
            Ok(motion) => {
                self.see_motion(told.topic, &motion, settings.height_corner_hz);
                self.motion = Some(motion);
            }
            Err(error) => self.no_motion = Some(error.to_string()),
        }
    }

    /// What there is to say of an estimated motion, and what does not hold for it.
    fn see_motion(&mut self, topic: &str, motion: &Motion, height_corner_hz: f64) {
        let drawn_s = motion.drawn_s();
        if drawn_s > 0.0 {
            let text = format!(
                "{drawn_s:.2} s in holes of up to {:.1} s are drawn through by what the samples beside them let expect; intervals hold what as many holes again change",
                bridge::LONGEST_S
            );
            self.remark(topic, "drawn_through", text);
        }
        let [left_out_s, _] = motion.left_out_s(Window::ALL);
        if left_out_s > 0.0 {
            let text = format!(
                "motion is estimated in {} without a hole, {left_out_s:.2} s are left out; within {:.1} s of a hole there is no height",
                counted(motion.stretches.len() as u64, "stretch", "stretches"),
                rath::BESIDE_HOLES / height_corner_hz
            );
            self.remark(topic, "holes", text);
        }
        if let Some(lean_deg) = motion.misdeclared_deg() {
            let text = format!(
                "as it is declared to be mounted, the load leans by {lean_deg:.0}° on average: it lies on its side or its back, or the sensor sits otherwise; what rests on its motion has no interval"
            );
            self.remark(topic, "mounting", text);
            self.lose(topic, "mounting", Lost::Mounting, true);
        }
        if motion.forward_is_unknown() {
            let text = "its x stands upright, and which way of it is forward nothing tells: roll and pitch may be each other, or mixed; give imu_mounting_roll_pitch_yaw_deg in a roles file";
            self.remark(topic, "forward", text.to_owned());
            self.lose(topic, "forward", Lost::Forward, true);
        }
        if let Some(turned) = motion.turned() {
            self.quality.push(Quality {
                t_s: Some(turned.t_s),
                ..Quality::remark(topic, "turned", turned.told())
            });
            self.lose(topic, "turned", Lost::Turned, true);
        }
    }

    /// Beats that somebody logged.
    fn take_beats(&mut self, topic: &str, columns: &Columns) {
        let (beat_s, number, remark) = columns.beats(topic);
        if beat_s.len() >= 3 {
            (self.beat_s, self.beat_source) = (beat_s, "beat");
            self.beat_number = number;
            if let Some((kind, text)) = remark {
                self.remark(topic, kind, text);
            }
        }
    }
}

/// The topics of a recording that sensors, beats and truth are read from.
fn topics<'a>(recording: &Recording, roles: &'a Roles) -> Vec<&'a str> {
    let others = [Role::Beats, Role::Truth];
    let others = others.iter().flat_map(|r| roles.patterns(*r));
    (roles.inertial().into_iter())
        .chain(others.map(String::as_str))
        .filter(|t| recording.info().channels.iter().any(|c| c.topic == *t))
        .collect()
}

/// What is read of these topics, as the recording dates it.
fn signals(
    recording: &Recording,
    roles: &Roles,
    topics: &[&str],
    Share { part, factors }: &Share,
    truth: bool,
) -> Result<Vec<Signal>, ReadError> {
    let thinned = |topic: &str| {
        let factor = factors.get(topic);
        factor.is_some_and(|factor| *factor > 1 || *part != Window::ALL)
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
    signals.extend(thin::read(recording, factors, *part)?);
    if let Some(topic) = roles.topic(Role::Beats)
        && !signals
            .iter()
            .any(|s| field_of(&s.path, topic) == Some(BEAT[1]))
    {
        signals.push(came(recording, topic)?);
    }
    let start_ns = recording.info().start_ns;
    // What is dated long before all others belongs to no time of the recording.
    for s in signals.iter_mut().filter(|_| recording.info().early > 0) {
        let known = s.times_ns.iter().zip(&s.values);
        let known = known.filter(|(t, _)| **t >= start_ns);
        let (times_ns, values): (Vec<i64>, Vec<f64>) = known.unzip();
        (s.times_ns, s.values) = (times_ns.into(), values);
    }
    Ok(signals)
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

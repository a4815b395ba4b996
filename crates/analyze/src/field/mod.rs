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
mod read;
mod sound;
mod thin;

#[cfg(test)]
pub(crate) use judge::wants as is_of_truth;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::FRAC_PI_2;

use crate::beat::lock::Course;
use crate::events::Event;
use crate::imu::interval::{self, Lost};
use crate::imu::rath::Motion;
use crate::imu::unloading::unloadings;
use crate::inputs::{Inputs, Window};
use crate::metrics::{Metrics, Value, metrics_of};
use crate::quality::Quality;
use crate::roles::{Role, Roles};
use carriers::Carriers;
pub(crate) use columns::{ACCEL, GYRO};
use judge::Judge;

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
                inputs.support_age_s = motion.settings.orientation.accel_latency_s;
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

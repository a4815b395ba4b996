//! What a recording says about carriers, beat and body, and the scene that is driven by it.

use super::beat::follow;
use super::misfit::{Course, unwrapped};
use crate::effects::measured::Measured;
use crate::model::Model;
use crate::scene::{Scene, check};
use crate::spline::Spline;
use recording::Signal;
use recording::read::{ReadError, Recording};
use recording::signal::field_of;
use recording::topics::{BEAT, FORCES, PHASES, STATE, TF};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// What `analyze --annotate` adds where only sensors saw it.
const FOUND_STATE: &str = "/findings/state";
const FOUND_PHASES: &str = "/findings/phases";
/// A pause between two samples longer than this, and than three usual ones, is a gap, s: half a step.
const GAP_S: f64 = 0.25;
/// A replay from here on, s of the recorded scene's time, begins where that did: stamps are whole nanoseconds.
const AT_ONCE_S: f64 = 1e-9;
/// Less is no replay, s.
const SHORTEST_S: f64 = 1.0;

/// What takes the oscillators' place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drive {
    /// The carriers' phases, through the scene's gait.
    Phases,
    /// The carriers' shoulders themselves.
    Shoulders,
    /// The beat alone: the scene's oscillators follow it as its `effects.music` says.
    Beat,
}

/// Which part of a recording is replayed, and how.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// What drives.
    pub drive: Drive,
    /// The scene that made the recording, where that is known: its party walks where the recorded one did.
    pub made_by: Option<&'a Scene>,
    /// From, s after the recording's start; the first moment at which all that drives is known where absent.
    pub from_s: Option<f64>,
    /// To, s after the recording's start; the last such moment where absent.
    pub to_s: Option<f64>,
}

/// Numbers over one time axis.
#[derive(Clone, Debug, Default)]
struct Columns {
    topic: String,
    t_s: Vec<f64>,
    x: Vec<Vec<f64>>,
}

/// What was measured; times in s after the recording's first message.
#[derive(Debug, Default)]
pub struct Take {
    start_ns: i64,
    /// When the time of the scene that was recorded is 0: a sensor whose clock is behind may have the first message.
    zero_s: f64,
    phases: Option<Columns>,
    shoulders: Option<Columns>,
    beats_s: Vec<f64>,
    heard_s: Option<f64>,
    state_topic: Option<&'static str>,
    /// Fields of the state by name, and the handles' summed force.
    motion: BTreeMap<&'static str, Course>,
    duration_s: f64,
    /// What of the file could not be used.
    pub losses: Vec<String>,
}

/// A scene that is driven by a recording.
#[derive(Debug)]
pub struct Replay {
    /// The scene; its t = 0 is the replay's start.
    pub scene: Scene,
    /// Stamp of t = 0.
    pub epoch_ns: i64,
    /// The stretch of the recording, s after its start.
    pub stretch_s: [f64; 2],
    /// The topic that drives.
    pub topic: String,
    /// Samples of it.
    pub samples: usize,
    /// Whether the body starts as it was measured, and what no recording holds as it was then.
    pub starts_as_measured: bool,
}

const STATE_FIELDS: [&str; 12] = [
    "roll_rad",
    "pitch_rad",
    "yaw_rad",
    "position_m.x",
    "position_m.y",
    "position_m.z",
    "velocity_m_per_s.x",
    "velocity_m_per_s.y",
    "velocity_m_per_s.z",
    "angular_velocity_rad_per_s.x",
    "angular_velocity_rad_per_s.y",
    "angular_velocity_rad_per_s.z",
];

const ANGLES: [&str; 3] = ["roll_rad", "pitch_rad", "yaw_rad"];

impl Take {
    /// Finds phases, shoulders, beats and the body's motion; what is not there stays empty.
    ///
    /// # Errors
    /// Where the file cannot be read at all.
    pub fn read(recording: &Recording) -> Result<Self, ReadError> {
        let info = recording.info();
        let has = |topic: &str| info.channels.iter().any(|c| c.topic == topic);
        let state_topic = [STATE, FOUND_STATE].into_iter().find(|t| has(t));
        let phase_topic = [PHASES, FOUND_PHASES].into_iter().find(|t| has(t));
        let topics: Vec<&str> = [state_topic, phase_topic, Some(BEAT), Some(FORCES), Some(TF)]
            .into_iter()
            .flatten()
            .collect();
        let of_one = |path: &str| topics.iter().any(|topic| field_of(path, topic).is_some());
        let (signals, findings) = recording.signals(&of_one)?;
        let get = |topic: &str, field: &str| {
            signals
                .iter()
                .find(|s| field_of(&s.path, topic) == Some(field))
        };
        let course = |s: &Signal| {
            let (t_s, x) = s
                .times_s(info.start_ns)
                .into_iter()
                .zip(s.values.iter().copied())
                .filter(|(_, x)| x.is_finite())
                .unzip();
            Course { t_s, x }
        };
        let list = |topic: &str, field: &dyn Fn(usize) -> String, from: usize| {
            let found: Vec<&Signal> = (from..).map_while(|i| get(topic, &field(i))).collect();
            together(topic, &found, info.start_ns)
        };
        let mut motion = BTreeMap::new();
        if let Some(topic) = state_topic {
            for field in STATE_FIELDS {
                if let Some(s) = get(topic, field) {
                    let mut c = course(s);
                    if ANGLES.contains(&field) {
                        c.x = unwrapped(&c.x, TAU);
                    }
                    motion.insert(field, c);
                }
            }
        }
        if let Some(forces) = list(FORCES, &|i| format!("normal_n[{i}]"), 0) {
            let total = (0..forces.t_s.len()).map(|k| forces.x.iter().map(|n| n[k]).sum());
            motion.insert(
                "force_n",
                Course {
                    x: total.collect(),
                    t_s: forces.t_s,
                },
            );
        }
        let phases = phase_topic.and_then(|t| list(t, &|i| format!("phase_rad[{i}]"), 0));
        // Three columns each; `transforms[0]` is the body.
        let axis = |i: usize| {
            format!(
                "transforms[{}].transform.translation.{}",
                1 + i / 3,
                ["x", "y", "z"][i % 3]
            )
        };
        let shoulders = list(TF, &axis, 0).filter(|c| c.x.len().is_multiple_of(3));
        let first_of = |s: &Signal| s.times_s(info.start_ns).first().copied();
        let zero_of = |s: &Signal| Some(first_of(s)? - s.values.first()?);
        let zero_s = state_topic
            .and_then(|t| get(t, "time_s"))
            .and_then(zero_of)
            .or_else(|| shoulders.as_ref()?.t_s.first().copied());
        Ok(Self {
            start_ns: info.start_ns,
            zero_s: zero_s.filter(|t| t.is_finite()).unwrap_or(0.0),
            phases,
            shoulders,
            beats_s: get(BEAT, "number")
                .map(|s| s.times_s(info.start_ns))
                .unwrap_or_default(),
            heard_s: phase_topic
                .and_then(|t| get(t, "beat_phase_rad"))
                .and_then(first_of),
            state_topic,
            motion,
            duration_s: (i128::from(info.end_ns) - i128::from(info.start_ns)) as f64 / 1e9,
            losses: findings
                .iter()
                .filter(|f| f.kind.is_loss())
                .map(ToString::to_string)
                .collect(),
        })
    }

    /// The topic of the body's measured motion.
    pub fn state_topic(&self) -> Option<&'static str> {
        self.state_topic
    }

    /// Whether the measured height has a mean: that from an inertial sensor has none.
    pub fn height_has_mean(&self) -> bool {
        self.state_topic == Some(STATE)
    }

    /// A measured column of the body, with time counted from `from_s`: a field of `rath.State`, angles without jumps of a turn, or `force_n`.
    pub fn course(&self, field: &str, from_s: f64) -> Option<Course> {
        let c = self.motion.get(field)?;
        Some(Course {
            t_s: c.t_s.iter().map(|t| t - from_s).collect(),
            x: c.x.clone(),
        })
    }

    /// The scene with the recording in the place of its oscillators.
    ///
    /// # Errors
    /// One sentence: what is missing or does not fit, and what to do.
    pub fn scene(&self, given: &Scene, options: &Options) -> Result<Replay, String> {
        let mut scene = given.clone();
        let n = scene.carriers.count();
        let e = &mut scene.effects;
        let driven = match options.drive {
            Drive::Phases => Some(self.phases.as_ref().ok_or(format!(
                "there are no phases in it, neither on {PHASES} nor on {FOUND_PHASES}; where carriers wore inertial sensors, \
                 `analyze FILE --annotate OUT.mcap` finds them and OUT.mcap can be replayed"
            ))?),
            Drive::Shoulders => Some(self.shoulders.as_ref().ok_or(format!(
                "there are no shoulders in it: expected the body and then one frame for each carrier on {TF}, as `sim record` writes them; \
                 replay its phases (`--drive phases`)"
            ))?),
            Drive::Beat => None,
        };
        if options.drive == Drive::Phases && e.gait.is_none() {
            return Err(format!(
                "the scene `{}` has no effects.gait, so no phase can move its shoulders; replay those (`--drive shoulders`), or add that table",
                scene.name
            ));
        }
        // The body that is compared has its own carriers, whatever drives.
        if let Some(c) = driven.or(self.phases.as_ref()) {
            let per_carrier = match options.drive {
                Drive::Shoulders => 3,
                Drive::Phases | Drive::Beat => 1,
            };
            let found = c.x.len() / per_carrier;
            if found != n {
                return Err(format!(
                    "{} holds {found} carriers, but the scene `{}` has {n}; give a scene with {found} handles",
                    c.topic, scene.name
                ));
            }
        }
        let (first, last) = match driven {
            Some(c) => {
                if c.t_s.len() < Spline::LEAST {
                    return Err(format!(
                        "{} holds {} usable samples, expected {} or more",
                        c.topic,
                        c.t_s.len(),
                        Spline::LEAST
                    ));
                }
                (c.t_s[0], c.t_s[c.t_s.len() - 1])
            }
            // Before the scene began there was no body.
            None => (self.zero_s.max(0.0), self.duration_s),
        };
        let from_s = options.from_s.unwrap_or(first);
        let to_s = options.to_s.unwrap_or(last);
        // So that NaN is refused too.
        let fits = from_s >= first - 1e-9 && to_s <= last + 1e-9 && to_s - from_s >= SHORTEST_S;
        if !fits {
            return Err(format!(
                "the replay would run from {from_s} to {to_s} s after the recording's start, but what drives it is known from {first:.3} to \
                 {last:.3} s, and {SHORTEST_S} s of it are the least; change --from or --to"
            ));
        }
        scene.duration_s = to_s - from_s;
        if let Some(c) = driven {
            let c = c.part(from_s, to_s);
            if let Some([a, b]) = c.gap() {
                return Err(format!(
                    "{} has a gap from {:.3} to {:.3} s after the recording's start; replay a stretch without one with --from and --to",
                    c.topic,
                    a + from_s,
                    b + from_s
                ));
            }
            (e.frequency_spread, e.coupling, e.noise, e.feedback) = (None, None, None, None);
            let mut measured = Measured {
                t_s: c.t_s,
                ..Measured::default()
            };
            if options.drive == Drive::Phases {
                measured.phase_rad = c.x.iter().map(|x| counted(x)).collect();
            } else {
                (e.gait, e.lift) = (None, None);
                if let Some(path) = &mut e.path {
                    path.turn_deg = 0.0;
                }
                let walk = scene.carriers.walk_m_per_s;
                let place = |x: &[Vec<f64>], k: usize| {
                    // What the walk will add again, counted as the recording did.
                    let t_s = from_s - self.zero_s + measured.t_s[k];
                    [0, 1, 2].map(|a| x[a][k] - walk[a] * t_s)
                };
                measured.shoulder_m =
                    c.x.chunks_exact(3)
                        .map(|x| (0..measured.t_s.len()).map(|k| place(x, k)).collect())
                        .collect();
            }
            e.measured = Some(measured);
        }
        let beats: Vec<f64> = self.beats_s.iter().map(|t| t - from_s).collect();
        let heard = beats
            .first()
            .copied()
            .into_iter()
            .chain(self.heard_s.map(|t| t - from_s))
            .fold(f64::INFINITY, f64::min);
        let music = e
            .music
            .clone()
            .or_else(|| driven.is_some().then(Default::default));
        let followed = music.and_then(|m| follow(&m, &beats, heard, scene.duration_s));
        match (&driven, &e.music, followed) {
            (None, ..) if e.measured.is_some() => {
                return Err(format!(
                    "in the scene `{}` effects.measured moves the carriers, so no beat can drive them; give another scene, or replay the phases",
                    scene.name
                ));
            }
            (None, None, _) => {
                return Err(format!(
                    "the scene `{}` has no effects.music, so no beat can drive it; replay the phases, or add that table",
                    scene.name
                ));
            }
            (None, _, None) => {
                return Err(format!(
                    "{BEAT} holds {} beats, expected 3 or more",
                    beats.len()
                ));
            }
            (None, _, found) => e.music = found,
            // Phases that were measured have heard the beat already: it is written beside them and pulls nobody.
            (Some(_), _, found) => {
                e.music = found.map(|m| crate::effects::music::Music {
                    strength_rad_per_s: 0.0.into(),
                    ..m
                });
                if e.music.is_none() {
                    e.drum = None;
                }
            }
        }
        let body_as_measured = self.start(&mut scene, given, from_s, options);
        if let Some(hz) = self.rate_hz() {
            scene.log_rate_hz = hz;
        }
        let epoch_ns = self.start_ns.saturating_add((from_s * 1e9).round() as i64);
        scene.epoch_s = epoch_ns.max(0) as f64 / 1e9;
        scene.keep_to_freedoms();
        if scene.analysis_start_s >= scene.duration_s {
            scene.analysis_start_s = 0.0;
        }
        check(&scene).map_err(|p| format!("{}: {}", p.key, p.message))?;
        // What poles, bristles and nerves were doing is in no recording; the scene that made it began it as it begins now.
        let all_known = match options.made_by {
            Some(made) if (from_s - self.zero_s).abs() <= AT_ONCE_S => {
                scene.effects.flexure.is_none() || rest_alike(made, given)
            }
            _ => options.drive != Drive::Beat && Model::new(&scene).layout().extra == 0,
        };
        Ok(Replay {
            epoch_ns,
            stretch_s: [from_s, to_s],
            topic: driven.map_or(BEAT, |c| &c.topic).to_owned(),
            samples: scene
                .effects
                .measured
                .as_ref()
                .map_or(beats.len(), |m| m.t_s.len()),
            starts_as_measured: body_as_measured && all_known,
            scene,
        })
    }

    /// Starts the body as it was measured at `from_s`; whether all of it was. Its place over the ground stays the scene's, under which the
    /// carriers stand, unless their shoulders were measured in the same frame, or walk and have not turned where those of the recording did.
    fn start(&self, scene: &mut Scene, given: &Scene, from_s: f64, options: &Options) -> bool {
        let at = |field: &str| {
            let c = self.motion.get(field)?;
            let spline = Spline::new(&c.t_s, &c.x)?;
            let [first, last] = spline.span_s();
            (from_s >= first - GAP_S && from_s <= last).then(|| spline.at(from_s.max(first)))
        };
        let three = |fields: [&str; 3]| Some(fields.map(|f| at(f).map(|[x, _]| x))).and_then(all);
        let walk = scene.carriers.walk_m_per_s;
        let walked_s = from_s - self.zero_s;
        let turned = (scene.effects.path.as_ref())
            .is_some_and(|p| p.turn_deg != 0.0 && walked_s > p.turn_start_s);
        let one_frame = options.drive == Drive::Shoulders
            || !turned
                && self.state_topic == Some(STATE)
                && (options.made_by).is_some_and(|made| made.carriers.walk_m_per_s == walk);
        // Bent poles are so only where the body is left at rest.
        let rests = scene.effects.flexure.is_some()
            && walked_s.abs() <= AT_ONCE_S
            && (options.made_by).is_some_and(|made| rest_alike(made, given));
        let start = &mut scene.start;
        let mut is_placed = false;
        if let (true, Some([x, _]), Some([y, _])) =
            (one_frame, at("position_m.x"), at("position_m.y"))
        {
            start.position_m = [x - walk[0] * walked_s, y - walk[1] * walked_s];
            is_placed = true;
        }
        let angles = ANGLES.map(at);
        if angles[0].is_none() && angles[1].is_none() {
            return false;
        }
        let angles = angles.map(|a| a.unwrap_or([0.0; 2]));
        start.roll_pitch_yaw_deg = angles.map(|[x, _]| x.to_degrees());
        let spin = three([
            "angular_velocity_rad_per_s.x",
            "angular_velocity_rad_per_s.y",
            "angular_velocity_rad_per_s.z",
        ]);
        start.angular_velocity_rad_per_s = spin.unwrap_or_else(|| spin_of(angles));
        let velocity = three([
            "velocity_m_per_s.x",
            "velocity_m_per_s.y",
            "velocity_m_per_s.z",
        ]);
        let height = at("position_m.z").filter(|_| self.height_has_mean());
        match (velocity, height) {
            (Some(v), Some([z, _])) => {
                if !rests {
                    start.height_m = Some(z - walk[2] * walked_s);
                }
                start.velocity_m_per_s = [0, 1, 2].map(|a| v[a] - walk[a]);
                is_placed && spin.is_some()
            }
            // An inertial sensor knows no height: the body starts where it rests.
            _ => {
                (start.height_m, start.velocity_m_per_s) = (None, [0.0; 3]);
                false
            }
        }
    }

    /// Mean rate of the measured motion, Hz, within what is worth logging.
    fn rate_hz(&self) -> Option<f64> {
        let t = &self.motion.get("roll_rad")?.t_s;
        let span = t.last()? - t.first()?;
        (span > 0.0).then(|| ((t.len() - 1) as f64 / span).clamp(10.0, 200.0))
    }
}

impl Columns {
    /// What lies from `from_s` to `to_s`, and one sample on either side, with time counted from `from_s`.
    fn part(&self, from_s: f64, to_s: f64) -> Self {
        let first = self.t_s.partition_point(|t| *t <= from_s).saturating_sub(1);
        let last = self
            .t_s
            .partition_point(|t| *t < to_s)
            .min(self.t_s.len() - 1);
        Self {
            topic: self.topic.clone(),
            t_s: self.t_s[first..=last].iter().map(|t| t - from_s).collect(),
            x: self.x.iter().map(|x| x[first..=last].to_vec()).collect(),
        }
    }

    /// The first gap.
    fn gap(&self) -> Option<[f64; 2]> {
        let mut steps: Vec<f64> = self.t_s.windows(2).map(|w| w[1] - w[0]).collect();
        steps.sort_by(f64::total_cmp);
        let most = GAP_S.max(3.0 * steps.get(steps.len() / 2)?);
        self.t_s
            .windows(2)
            .find(|w| w[1] - w[0] > most)
            .map(|w| [w[0], w[1]])
    }
}

/// Signals of one topic on their common times, where all of them are numbers.
fn together(topic: &str, signals: &[&Signal], start_ns: i64) -> Option<Columns> {
    if signals.is_empty() {
        return None;
    }
    let mut rows: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
    for (k, s) in signals.iter().enumerate() {
        for (t, x) in s.times_ns.iter().zip(&s.values) {
            // Of several messages with one stamp the first counts.
            let row = rows.entry(*t).or_default();
            if row.len() == k && x.is_finite() {
                row.push(*x);
            }
        }
    }
    rows.retain(|_, row| row.len() == signals.len());
    let times: Vec<i64> = rows.keys().copied().collect();
    Some(Columns {
        topic: topic.to_owned(),
        t_s: recording::signal::seconds_since(&times, start_ns),
        x: (0..signals.len())
            .map(|k| rows.values().map(|row| row[k]).collect())
            .collect(),
    })
}

/// Whether two scenes start alike where they start at rest.
fn rest_alike(a: &Scene, b: &Scene) -> bool {
    (&a.body, &a.carriers, &a.start, &a.effects) == (&b.body, &b.carriers, &b.start, &b.effects)
}

fn all([a, b, c]: [Option<f64>; 3]) -> Option<[f64; 3]> {
    Some([a?, b?, c?])
}

/// ω of a body whose roll, pitch and yaw (rad) have these values and rates.
fn spin_of([[roll, p], [pitch, q], [_, r]]: [[f64; 2]; 3]) -> [f64; 3] {
    let ((sr, cr), (sp, cp)) = (roll.sin_cos(), pitch.sin_cos());
    [p - r * sp, q * cr + r * sr * cp, -q * sr + r * cr * cp]
}

/// Phases without the jumps of 2π of those that stay within a turn; others count their turns already, and may go more than half of one from sample
/// to sample.
fn counted(x: &[f64]) -> Vec<f64> {
    let least = x.iter().copied().fold(f64::INFINITY, f64::min);
    let most = x.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most - least > TAU * (1.0 + 1e-6) {
        return x.to_vec();
    }
    unwrapped(x, TAU)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_that_count_their_turns_are_left_alone() {
        // 2.15 Hz seen twice a second: more than a turn a sample.
        let many: Vec<f64> = (0..20).map(|k| TAU * 1.075 * f64::from(k)).collect();
        assert_eq!(counted(&many), many);
        let fine: Vec<f64> = (0..200).map(|k| 0.45 * f64::from(k) - 1.0).collect();
        let within: Vec<f64> = fine.iter().map(|x| x.sin().atan2(x.cos())).collect();
        for (a, b) in counted(&within).iter().zip(&fine) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
    }
}

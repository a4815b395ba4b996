//! The scene that is driven by a recording.

use super::beat::follow;
use super::misfit::unwrapped;
use super::take::{ANGLES, Columns, FOUND_PHASES, GAP_S, Take};
use crate::effects::measured::Measured;
use crate::effects::music::Music;
use crate::model::Model;
use crate::scene::{Scene, check};
use crate::spline::Spline;
use recording::topics::{BEAT, PHASES, STATE, TF};
use std::f64::consts::TAU;

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

impl Take {
    /// The scene with the recording in the place of its oscillators.
    ///
    /// # Errors
    /// One sentence: what is missing or does not fit, and what to do.
    pub fn scene(&self, given: &Scene, options: &Options) -> Result<Replay, String> {
        let mut scene = given.clone();
        let driver = self.driver(given, options.drive)?;
        let [from_s, to_s] = self.stretch_s(driver, options)?;
        scene.duration_s = to_s - from_s;
        if let Some(columns) = driver {
            self.drive(&mut scene, columns.part(from_s, to_s), from_s, options)?;
        }
        self.beat(&mut scene, driver.is_some(), from_s)?;
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
        let measured = scene.effects.measured.as_ref();
        Ok(Replay {
            epoch_ns,
            stretch_s: [from_s, to_s],
            topic: driver.map_or(BEAT, |c| &c.topic).to_owned(),
            samples: measured.map_or(self.beats_s.len(), |m| m.t_s.len()),
            starts_as_measured: body_as_measured && all_known,
            scene,
        })
    }

    /// What drives in the oscillators' place, nothing where that is the beat; it has to fit the carriers of `given`.
    fn driver(&self, given: &Scene, drive: Drive) -> Result<Option<&Columns>, String> {
        let driver = match drive {
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
        if drive == Drive::Phases && given.effects.gait.is_none() {
            return Err(format!(
                "the scene `{}` has no effects.gait, so no phase can move its shoulders; replay those (`--drive shoulders`), or add that table",
                given.name
            ));
        }
        // The body that is compared has its own carriers, whatever drives.
        if let Some(columns) = driver.or(self.phases.as_ref()) {
            let per_carrier = match drive {
                Drive::Shoulders => 3,
                Drive::Phases | Drive::Beat => 1,
            };
            let found = columns.x.len() / per_carrier;
            let n = given.carriers.count();
            if found != n {
                return Err(format!(
                    "{} holds {found} carriers, but the scene `{}` has {n}; give a scene with {found} handles",
                    columns.topic, given.name
                ));
            }
        }
        Ok(driver)
    }

    /// The stretch that is replayed, s after the recording's start.
    fn stretch_s(&self, driver: Option<&Columns>, options: &Options) -> Result<[f64; 2], String> {
        let [first, last] = match driver {
            Some(c) if c.t_s.len() < Spline::LEAST => {
                return Err(format!(
                    "{} holds {} usable samples, expected {} or more",
                    c.topic,
                    c.t_s.len(),
                    Spline::LEAST
                ));
            }
            Some(c) => [c.t_s[0], c.t_s[c.t_s.len() - 1]],
            // Before the scene began there was no body.
            None => [self.zero_s.max(0.0), self.duration_s],
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
        Ok([from_s, to_s])
    }

    /// Puts what was measured in the place of the oscillators and of all that moves them.
    fn drive(
        &self,
        scene: &mut Scene,
        columns: Columns,
        from_s: f64,
        options: &Options,
    ) -> Result<(), String> {
        if let Some([a, b]) = columns.gap() {
            return Err(format!(
                "{} has a gap from {:.3} to {:.3} s after the recording's start; replay a stretch without one with --from and --to",
                columns.topic,
                a + from_s,
                b + from_s
            ));
        }
        let e = &mut scene.effects;
        (e.frequency_spread, e.coupling, e.noise, e.feedback) = (None, None, None, None);
        let Columns { t_s, x, .. } = columns;
        e.measured = Some(if options.drive == Drive::Phases {
            Measured {
                t_s,
                phase_rad: x.iter().map(|x| counted(x)).collect(),
                ..Measured::default()
            }
        } else {
            (e.gait, e.lift) = (None, None);
            if let Some(path) = &mut e.path {
                path.turn_deg = 0.0;
            }
            let walk = scene.carriers.walk_m_per_s;
            let place = |x: &[Vec<f64>], k: usize| {
                // What the walk will add again, counted as the recording did.
                let walked_s = from_s - self.zero_s + t_s[k];
                [0, 1, 2].map(|a| x[a][k] - walk[a] * walked_s)
            };
            let one = |x| (0..t_s.len()).map(|k| place(x, k)).collect();
            let shoulder_m = x.chunks_exact(3).map(one).collect();
            Measured {
                t_s,
                shoulder_m,
                ..Measured::default()
            }
        });
        Ok(())
    }

    /// Lets the drum strike when it was heard; it pulls the oscillators only where nothing has taken their place.
    fn beat(&self, scene: &mut Scene, driven: bool, from_s: f64) -> Result<(), String> {
        let Scene {
            name,
            effects: e,
            duration_s,
            ..
        } = scene;
        if !driven && e.measured.is_some() {
            return Err(format!(
                "in the scene `{name}` effects.measured moves the carriers, so no beat can drive them; give another scene, or replay the phases"
            ));
        }
        let music = match (&e.music, driven) {
            (Some(music), _) => music.clone(),
            (None, true) => Music::default(),
            (None, false) => {
                return Err(format!(
                    "the scene `{name}` has no effects.music, so no beat can drive it; replay the phases, or add that table"
                ));
            }
        };
        let beats: Vec<f64> = self.beats_s.iter().map(|t| t - from_s).collect();
        let heard = (beats.first().copied().into_iter())
            .chain(self.heard_s.map(|t| t - from_s))
            .fold(f64::INFINITY, f64::min);
        let followed = follow(&music, &beats, heard, *duration_s);
        if driven {
            // Phases that were measured have heard the beat already: it is written beside them and pulls nobody.
            e.music = followed.map(|m| Music {
                strength_rad_per_s: 0.0.into(),
                ..m
            });
            if e.music.is_none() {
                e.drum = None;
            }
        } else if followed.is_some() {
            e.music = followed;
        } else {
            return Err(format!(
                "{BEAT} holds {} beats, expected 3 or more",
                beats.len()
            ));
        }
        Ok(())
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

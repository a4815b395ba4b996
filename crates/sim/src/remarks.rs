//! What a motion did that nobody carries so: not wrong, but more often a unit that slipped than a wish.

use crate::run::Sample;
use crate::scene::Scene;

/// Beside a shoulder by more than a shoulder's breadth nobody carries, m: the law of contact asks for height alone.
const BREADTH_M: f64 = 0.5;
/// A shoulder that gives way by more than this is none, m.
const GIVES_M: f64 = 0.3;
/// A load so far above or below its shoulders is not carried, m.
const AWAY_M: f64 = 3.0;
/// Nobody bears so many times the weight of the whole load.
const WEIGHTS: f64 = 30.0;

/// The greatest of something, where and when.
#[derive(Clone, Copy)]
struct Most {
    /// Of the handle or shoulder, counted from 1.
    number: usize,
    value: f64,
    t_s: f64,
}

impl Most {
    /// Nothing is told of that stays below `least`.
    fn above(least: f64) -> Self {
        Self {
            number: 0,
            value: least,
            t_s: 0.0,
        }
    }

    fn look(&mut self, number: usize, value: f64, t_s: f64) {
        if value > self.value {
            *self = Self { number, value, t_s };
        }
    }

    fn told(self) -> Option<Self> {
        (self.number > 0).then_some(self)
    }
}

/// Watches samples for what is said after a run.
pub struct Remarks {
    weight_n: f64,
    beside_m: Most,
    given_m: Most,
    above_m: Most,
    below_m: Most,
    force_n: Most,
    /// Whether there are handles, and none ever met its shoulder.
    untouched: bool,
}

impl Remarks {
    /// For a run of `scene`.
    pub fn of(scene: &Scene) -> Self {
        let gravity = scene.body.gravity_m_per_s2.iter().map(|g| g * g);
        let weight_n = scene.body.mass_kg * gravity.sum::<f64>().sqrt();
        Self {
            weight_n,
            beside_m: Most::above(BREADTH_M),
            given_m: Most::above(GIVES_M),
            above_m: Most::above(AWAY_M),
            below_m: Most::above(AWAY_M),
            // Without gravity nothing is so many weights.
            force_n: Most::above(match weight_n > 0.0 {
                true => WEIGHTS * weight_n,
                false => f64::INFINITY,
            }),
            untouched: scene.effects.contact.is_some() && !scene.carriers.handles_m.is_empty(),
        }
    }

    /// Takes the next sample.
    pub fn look(&mut self, sample: &Sample) {
        let t_s = sample.t_s;
        let mut up_m = 0.0;
        for (i, (handle, shoulder)) in sample.handle_m.iter().zip(&sample.shoulder_m).enumerate() {
            up_m += (handle[2] - shoulder[2]) / sample.shoulder_m.len() as f64;
            let normal_n = sample.normal_n[i];
            if normal_n > 0.0 {
                self.untouched = false;
                let beside_m = (handle[0] - shoulder[0]).hypot(handle[1] - shoulder[1]);
                self.beside_m.look(i + 1, beside_m, t_s);
                self.given_m.look(i + 1, sample.compression_m[i], t_s);
            }
            self.force_n.look(i + 1, normal_n, t_s);
        }
        if !sample.shoulder_m.is_empty() {
            self.above_m.look(1, up_m, t_s);
            self.below_m.look(1, -up_m, t_s);
        }
    }

    /// A sentence for each thing that was seen.
    pub fn said(&self, scene: &Scene) -> Vec<String> {
        let mut said = Vec::new();
        if self.untouched {
            said.push(
                "no handle ever met its shoulder: start.height_m, body.gravity_m_per_s2 and carriers.shoulder_height_m say where the load begins and whether it comes down"
                    .to_owned(),
            );
        }
        let (away_m, where_to) = match self.above_m.value > self.below_m.value {
            true => (self.above_m, "above"),
            false => (self.below_m, "below"),
        };
        // A scene without contact and gait is thrown, not carried.
        let carried = scene.effects.contact.is_some() || scene.effects.gait.is_some();
        if let Some(Most { value, t_s, .. }) = away_m.told().filter(|_| carried) {
            let why = match scene.effects.contact {
                Some(_) => "nobody carried it then",
                None => "without effects.contact nobody carries it",
            };
            said.push(format!(
                "the load's handles were {} m {where_to} their shoulders at {t_s:.1} s: {why}",
                short(value)
            ));
        }
        if let Some(Most { number, value, t_s }) = self.given_m.told() {
            said.push(format!(
                "shoulder {number} gave way by {} m at {t_s:.1} s: effects.contact.stiffness_n_per_m is in N/m, body.mass_kg in kg, effects.gait.amplitude_m in m",
                short(value)
            ));
        }
        if let Some(Most { number, value, t_s }) = self.force_n.told() {
            said.push(format!(
                "handle {number} bore {} times the weight of the load at {t_s:.1} s, which no shoulder bears",
                short(value / self.weight_n)
            ));
        }
        if let Some(Most { number, value, t_s }) = self.beside_m.told() {
            let advice = match &scene.effects.sling {
                Some(sling) if value > sling.length_m => {
                    "farther than its strap is long; `effects.sling` holds for small swings: give it more damping_s, or the contact more damping"
                }
                Some(_) => "the straps of `effects.sling` let it",
                None if scene.effects.hold.is_some() || scene.effects.friction.is_some() => {
                    "what keeps it there (`effects.hold`, `friction`) lets it go so far"
                }
                None => {
                    "contact asks for height alone; `effects.hold`, `friction` or `sling` keep a load with its carriers"
                }
            };
            said.push(format!(
                "handle {number} was carried from {value:.1} m beside its shoulder at {t_s:.1} s: {advice}"
            ));
        }
        said
    }
}

/// Two digits where there is a point, all of a whole number, powers of ten beyond a million.
fn short(x: f64) -> String {
    match x {
        x if x < 10.0 => format!("{x:.2}"),
        x if x < 100.0 => format!("{x:.1}"),
        x if x < 1e6 => format!("{x:.0}"),
        x => format!("{x:.1e}"),
    }
}

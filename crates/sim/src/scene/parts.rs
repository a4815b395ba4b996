//! The parts of a scene that are no effect: the body, the people under it, where all begins, and how it is integrated.

use super::per_carrier::PerCarrier;
use super::problem::{Checker, Problem, problem};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A coordinate of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Freedom {
    /// Along the walk.
    X,
    /// To the left.
    Y,
    /// Up.
    Height,
    /// About the pole.
    Roll,
    /// Of the pole, about the sideways axis.
    Tilt,
    /// About the vertical.
    Yaw,
}

impl Freedom {
    /// All six, in the order of the state.
    pub const ALL: [Self; 6] = [
        Self::X,
        Self::Y,
        Self::Height,
        Self::Roll,
        Self::Tilt,
        Self::Yaw,
    ];
}

/// The rigid body: a rath with its pole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BodySpec {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Inertia about the centre of mass in body axes, kg·m².
    pub inertia_kg_m2: Inertia,
    /// Gravity in the world frame, m/s². A slope is a gravity that leans: z stays the normal of the ground.
    pub gravity_m_per_s2: [f64; 3],
}

impl BodySpec {
    /// The unit of an energy of the ledger in an error norm, J: the body at 1.4 m/s, and lifted by 1 m.
    pub(crate) fn ledger_unit_j(&self) -> f64 {
        let gravity = self.gravity_m_per_s2.iter().map(|g| g * g);
        self.mass_kg * (1.0 + gravity.sum::<f64>().sqrt())
    }
}

impl Default for BodySpec {
    /// The paper's rath as its logs reveal it: 60 kg, I_xx from a = h/(I_xx + M h²) = 0.04795, h = 0.1 m.
    fn default() -> Self {
        Self {
            mass_kg: 60.0,
            inertia_kg_m2: Inertia::default(),
            gravity_m_per_s2: [0.0, 0.0, -9.81],
        }
    }
}

/// Symmetric inertia tensor. The products are the tensor's own off-diagonal elements: I_xy = −∫ x y dm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Inertia {
    pub xx: f64,
    pub yy: f64,
    pub zz: f64,
    #[serde(default)]
    pub xy: f64,
    #[serde(default)]
    pub xz: f64,
    #[serde(default)]
    pub yz: f64,
}

impl Default for Inertia {
    fn default() -> Self {
        Self {
            xx: 1.4855,
            yy: 11.0,
            zz: 11.0,
            xy: 0.0,
            xz: 0.0,
            yz: 0.0,
        }
    }
}

/// The carriers: where they hold the body, and how they walk.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Carriers {
    /// Places many carriers along straight poles, and replaces `handles_m`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub along_poles: Option<AlongPoles>,
    /// Handles p_i in body coordinates, m. One carrier stands under each, at the same x and y.
    pub handles_m: Vec<[f64; 3]>,
    /// Height of the resting shoulders above the ground, m.
    pub shoulder_height_m: PerCarrier,
    /// Natural gait frequency, Hz.
    pub frequency_hz: PerCarrier,
    /// Gait phase at t = 0, rad.
    pub initial_phase_rad: PerCarrier,
    /// Standard deviation of the phases at t = 0, rad, drawn from the seed.
    pub initial_phase_sd_rad: f64,
    /// Walk of the whole party over the ground, m/s. A Galilean shift: it costs nothing and moves nothing else.
    pub walk_m_per_s: [f64; 3],
}

impl Default for Carriers {
    /// The paper's pair: 4.9 m of pole, handles 0.1 m above the centre of mass.
    fn default() -> Self {
        Self {
            along_poles: None,
            handles_m: vec![[2.45, 0.0, 0.1], [-2.45, 0.0, 0.1]],
            shoulder_height_m: 1.0.into(),
            frequency_hz: 2.0.into(),
            initial_phase_rad: 0.0.into(),
            initial_phase_sd_rad: 0.0,
            walk_m_per_s: [0.0; 3],
        }
    }
}

/// Carriers at equal distances along equal, parallel poles, numbered pole by pole from right to left, front first.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AlongPoles {
    /// How many carriers there are on all poles together.
    pub count: usize,
    /// How many poles.
    pub poles: usize,
    /// From the first handle of a pole to the last, m.
    pub length_m: f64,
    /// From pole to pole, m.
    pub spacing_m: f64,
    /// Handles above the centre of mass, m.
    pub height_m: f64,
}

impl Default for AlongPoles {
    fn default() -> Self {
        Self {
            count: 8,
            poles: 2,
            length_m: 4.9,
            spacing_m: 0.7,
            height_m: 0.1,
        }
    }
}

impl AlongPoles {
    /// The handles; the first poles take one more where the carriers cannot be shared out evenly.
    pub fn handles_m(&self) -> Vec<[f64; 3]> {
        let mut handles = Vec::with_capacity(self.count);
        for pole in 0..self.poles {
            let here = self.count / self.poles + usize::from(pole < self.count % self.poles);
            let y = (pole as f64 - (self.poles - 1) as f64 / 2.0) * self.spacing_m;
            for i in 0..here {
                let from_front = if here > 1 {
                    i as f64 / (here - 1) as f64
                } else {
                    0.5
                };
                handles.push([self.length_m * (0.5 - from_front), y, self.height_m]);
            }
        }
        handles
    }

    pub(super) fn check(&self) -> Result<(), Problem> {
        let key = |name: &str| format!("carriers.along_poles.{name}");
        if !(1..=MOST_CARRIERS).contains(&self.count) {
            return Err(problem(
                &key("count"),
                format!(
                    "found {}, expected 1 to {MOST_CARRIERS} carriers",
                    self.count
                ),
            ));
        }
        if !(1..=self.count).contains(&self.poles) {
            return Err(problem(
                &key("poles"),
                format!(
                    "found {}, expected 1 to {}, one carrier each",
                    self.poles, self.count
                ),
            ));
        }
        Checker::not_negative(&key("length_m"), self.length_m)?;
        Checker::not_negative(&key("spacing_m"), self.spacing_m)?;
        Checker::finite(&key("height_m"), self.height_m)
    }
}

/// More people than this no pole can take.
pub(crate) const MOST_CARRIERS: usize = 1_000_000;

impl Carriers {
    /// How many there are.
    pub fn count(&self) -> usize {
        self.handles_m.len()
    }

    /// The handles of each pole, counted from 0, from its −x to its +x end: those of one y, give or take a micrometre; poles from right to left.
    pub fn poles(&self) -> Vec<Vec<usize>> {
        let [x, y] = [0, 1].map(|axis| move |i: &usize| self.handles_m[*i][axis]);
        let mut all: Vec<usize> = (0..self.count()).collect();
        all.sort_by(|a, b| y(a).total_cmp(&y(b)));
        let mut poles: Vec<Vec<usize>> = Vec::new();
        for i in all {
            match poles.last_mut() {
                Some(pole) if y(&i) - y(&pole[0]) < 1e-6 => pole.push(i),
                _ => poles.push(vec![i]),
            }
        }
        for pole in &mut poles {
            pole.sort_by(|a, b| x(a).total_cmp(&x(b)));
        }
        poles
    }
}

/// The state at t = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Start {
    /// Height of the centre of mass, m. Without it the body starts where its weight rests on the springs.
    pub height_m: Option<f64>,
    /// Position of the centre of mass over the ground, x and y, m.
    pub position_m: [f64; 2],
    /// Roll, pitch and yaw (REP-103: R = R_z R_y R_x), degrees.
    pub roll_pitch_yaw_deg: [f64; 3],
    /// Velocity in the world, m/s, beside the walk.
    pub velocity_m_per_s: [f64; 3],
    /// Angular velocity in the body, rad/s.
    pub angular_velocity_rad_per_s: [f64; 3],
}

impl Default for Start {
    fn default() -> Self {
        Self {
            height_m: None,
            position_m: [0.0; 2],
            roll_pitch_yaw_deg: [0.0; 3],
            velocity_m_per_s: [0.0; 3],
            angular_velocity_rad_per_s: [0.0; 3],
        }
    }
}

/// How the scene is integrated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Solver {
    /// Name in the table of methods ([`crate::solve::METHODS`]).
    pub method: String,
    /// Relative tolerance of an adaptive method.
    pub tolerance: f64,
    /// Step of a fixed-step method, s.
    pub step_s: f64,
    /// Whether an energy account is kept beside the motion (two more states for each effect that does work).
    pub energy: bool,
}

impl Default for Solver {
    fn default() -> Self {
        Self {
            method: "auto".into(),
            tolerance: 1e-8,
            step_s: 1e-3,
            energy: true,
        }
    }
}

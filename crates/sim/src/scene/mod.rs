//! What the user wrote: a body, the people under it, and the effects that are on.
//!
//! A scene is TOML. What it leaves out has the default given with each field; an effect that it does not name does
//! not exist in the model. Frames are REP-103 (x forward along the pole, y left, z up, the normal of the ground).

mod builtin;
mod check;
mod parse;

pub use builtin::{BUILTIN, builtin};
pub use check::{Problem, check};
pub(crate) use check::{Checker, problem};
pub use parse::{SceneError, load, nearest, parse, to_toml};

use crate::effects::Effects;
use serde::{Deserialize, Serialize};

/// A scene, complete and checked when it comes from [`load`] or [`parse`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Name, as written into recordings.
    pub name: String,
    /// One sentence for people.
    #[serde(default)]
    pub about: String,
    /// How long to simulate, s.
    #[serde(default = "default::duration_s")]
    pub duration_s: f64,
    /// Rate of the logged samples, Hz; the first is at t = 0.
    #[serde(default = "default::log_rate_hz")]
    pub log_rate_hz: f64,
    /// Where `analyze` begins its window, s.
    #[serde(default)]
    pub analysis_start_s: f64,
    /// Seed of everything random; `--seed` replaces it.
    #[serde(default = "default::seed")]
    pub seed: u64,
    /// Time stamp of t = 0, s since 1970; only stamps see it.
    #[serde(default)]
    pub epoch_s: f64,
    /// The carried body.
    #[serde(default)]
    pub body: BodySpec,
    /// The people and where they hold it.
    #[serde(default)]
    pub carriers: Carriers,
    /// Where everything is at t = 0.
    #[serde(default)]
    pub start: Start,
    /// How it is integrated; `--method` and `--tolerance` replace it.
    #[serde(default)]
    pub solver: Solver,
    /// The effects that are on.
    #[serde(default)]
    pub effects: Effects,
}

/// The rigid body: a rath with its pole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BodySpec {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Inertia about the centre of mass in body axes, kg·m².
    pub inertia_kg_m2: Inertia,
    /// Gravity in the world frame, m/s². A slope is a gravity that leans: z stays the normal of the ground.
    pub gravity_m_per_s2: [f64; 3],
}

impl Default for BodySpec {
    /// The paper's rath as its logs reveal it: 60 kg, I_xx from a = h/(I_xx + M h²) = 0.04795, h = 0.1 m.
    fn default() -> Self {
        Self { mass_kg: 60.0, inertia_kg_m2: Inertia::default(), gravity_m_per_s2: [0.0, 0.0, -9.81] }
    }
}

/// Symmetric inertia tensor. The products are the tensor's own off-diagonal elements: I_xy = −∫ x y dm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
        Self { xx: 1.4855, yy: 11.0, zz: 11.0, xy: 0.0, xz: 0.0, yz: 0.0 }
    }
}

/// One number for all carriers, or one for each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum PerCarrier {
    /// The same for all.
    Same(f64),
    /// One for each, in the order of the handles.
    Each(Vec<f64>),
}

impl PerCarrier {
    /// The number of carrier `i`.
    pub fn get(&self, i: usize) -> f64 {
        match self {
            Self::Same(x) => *x,
            Self::Each(list) => list[i],
        }
    }

    /// Every number given.
    pub fn values(&self) -> &[f64] {
        match self {
            Self::Same(x) => std::slice::from_ref(x),
            Self::Each(list) => list,
        }
    }
}

impl From<f64> for PerCarrier {
    fn from(x: f64) -> Self {
        Self::Same(x)
    }
}

/// The carriers: where they hold the body, and how they walk.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Carriers {
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
            handles_m: vec![[2.45, 0.0, 0.1], [-2.45, 0.0, 0.1]],
            shoulder_height_m: 1.0.into(),
            frequency_hz: 2.0.into(),
            initial_phase_rad: 0.0.into(),
            initial_phase_sd_rad: 0.0,
            walk_m_per_s: [0.0; 3],
        }
    }
}

impl Carriers {
    /// How many there are.
    pub fn count(&self) -> usize {
        self.handles_m.len()
    }
}

/// The state at t = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
        Self { method: "auto".into(), tolerance: 1e-8, step_s: 1e-3, energy: true }
    }
}

mod default {
    pub fn duration_s() -> f64 {
        60.0
    }
    pub fn log_rate_hz() -> f64 {
        30.0
    }
    pub fn seed() -> u64 {
        1001
    }
}

//! What the user wrote: a body, the people under it, and the effects that are on.
//!
//! A scene is TOML. What it leaves out has the default given with each field; an effect that it does not name does
//! not exist in the model. Frames are REP-103 (x forward along the pole, y left, z up, the normal of the ground).

mod builtin;
mod check;
mod parse;
pub(crate) mod parts;
pub(crate) mod per_carrier;
pub(crate) mod problem;

pub use builtin::{BUILTIN, builtin};
pub use check::check;
pub use parse::{
    SceneError, Template, from_toml, json_schema, load, parse, setting_value, to_toml,
};
pub use parts::{AlongPoles, BodySpec, Carriers, Freedom, Inertia, Solver, Start};
pub use per_carrier::PerCarrier;
pub use problem::Problem;

use crate::effects::Effects;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A scene, complete and checked when it comes from [`load`] or [`parse`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    /// Which coordinates of the body may move; the others are held, and cost nothing.
    #[serde(default = "default::freedom")]
    pub freedom: Vec<Freedom>,
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

impl Scene {
    /// Works out what a scene says in short: the handles along poles.
    pub(crate) fn expand(&mut self) -> Result<(), Problem> {
        if let Some(poles) = &self.carriers.along_poles {
            poles.check()?;
            self.carriers.handles_m = poles.handles_m();
        }
        Ok(())
    }

    /// Takes from the velocities at the start what the held coordinates do not let be.
    pub fn keep_to_freedoms(&mut self) {
        if let Some([velocity, spin]) = crate::freedoms::start_velocities(self) {
            self.start.velocity_m_per_s = velocity;
            self.start.angular_velocity_rad_per_s = spin;
        }
    }
}

pub(crate) mod default {
    pub fn duration_s() -> f64 {
        60.0
    }
    pub fn log_rate_hz() -> f64 {
        30.0
    }
    pub fn freedom() -> Vec<super::Freedom> {
        super::Freedom::ALL.to_vec()
    }
    pub fn seed() -> u64 {
        1001
    }
}

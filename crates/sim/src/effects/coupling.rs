//! Kuramoto coupling: carriers adjust to each other.
//!
//! ```text
//! φ̇_i += (K_c/N) Σ_j sin(φ_j − φ_i) = K_c (S cos φ_i − C sin φ_i),   S = (1/N) Σ sin φ_j,  C = (1/N) Σ cos φ_j
//! ```
//! K_c strength [rad/s]; φ phases [rad]. The mean-field form is the same sum in O(N). For N = 2, δ = φ₂ − φ₁ locks where
//! |Δω| < K_c, at sin δ* = Δω/K_c. Source: paper, eq. (kuramoto); Kuramoto (1975), Strogatz (2000).

use crate::lanes::{f64x2, sum};
use crate::model::{Model, Stage, Term, Workspace};
use crate::scene::{Checker, Problem, Scene};
use serde::{Deserialize, Serialize};

/// `[effects.coupling]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Coupling {
    /// K_c, rad/s. Measured in the paper's baseline logs: 0.001 ± 0.003, that is none.
    pub strength_rad_per_s: f64,
}

impl Default for Coupling {
    fn default() -> Self {
        Self { strength_rad_per_s: 0.5 }
    }
}

impl Coupling {
    pub(super) fn check(&self, _scene: &Scene) -> Result<(), Problem> {
        Checker::finite("effects.coupling.strength_rad_per_s", self.strength_rad_per_s)
    }

    pub(super) fn build(&self, scene: &Scene, model: &mut Model) {
        model.need_phases();
        model.add(Stage::Phases, MeanField { gain: self.strength_rad_per_s / scene.carriers.count() as f64 });
    }
}

#[derive(Debug)]
struct MeanField {
    gain: f64,
}

impl Term for MeanField {
    fn apply(&self, _t_s: f64, w: &mut Workspace) {
        let (mut s, mut c) = (f64x2::ZERO, f64x2::ZERO);
        for p in &w.pair {
            s += p.sin;
            c += p.cos * p.present;
        }
        let (s, c) = (sum(s) * self.gain, sum(c) * self.gain);
        for p in &mut w.pair {
            p.rate += p.cos * s - p.sin * c;
        }
    }
}

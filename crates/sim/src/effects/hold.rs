//! Sideways hold: hands keep the handle over the shoulder, as a spring and damper in the plane of the ground.
//!
//! ```text
//! T* = k_t d + c_t ḋ        [N], in x and y
//! ```
//! d shoulder minus handle in the plane normal to z [m]; k_t stiffness [N/m]; c_t damping [N·s/m]. Alone it is never
//! capped and acts on a slack handle too (a grip); with the effect `friction` it cannot exceed μN.
//! Source: paper, section 3.3 ("tangential forces can be added"); palanquin-bench, law of T.

use crate::lanes::{f64x2, pack};
use crate::model::{Account, Model, Power, Stage, Term, Workspace};
use crate::scene::{Checker, PerCarrier, Problem, Scene};
use serde::{Deserialize, Serialize};

/// `[effects.hold]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Hold {
    /// k_t, N/m.
    pub stiffness_n_per_m: PerCarrier,
    /// c_t, N·s/m.
    pub damping_n_s_per_m: PerCarrier,
}

impl Default for Hold {
    fn default() -> Self {
        Self { stiffness_n_per_m: 3000.0.into(), damping_n_s_per_m: 150.0.into() }
    }
}

impl Hold {
    pub(super) fn check(&self, scene: &Scene) -> Result<(), Problem> {
        for (key, x) in [
            ("effects.hold.stiffness_n_per_m", &self.stiffness_n_per_m),
            ("effects.hold.damping_n_s_per_m", &self.damping_n_s_per_m),
        ] {
            Checker::per_carrier(key, x, scene.carriers.count())?;
            x.values().iter().try_for_each(|&v| Checker::not_negative(key, v))?;
        }
        Ok(())
    }

    pub(super) fn build(&self, scene: &Scene, model: &mut Model) {
        let n = scene.carriers.count();
        let law = SpringDamper {
            stiffness: pack((0..n).map(|i| self.stiffness_n_per_m.get(i))),
            damping: pack((0..n).map(|i| self.damping_n_s_per_m.get(i))),
        };
        model.add(Stage::Handles, law.clone());
        model.add_account("hold", law);
    }
}

#[derive(Clone, Debug)]
struct SpringDamper {
    stiffness: Vec<f64x2>,
    damping: Vec<f64x2>,
}

impl Term for SpringDamper {
    #[inline]
    fn apply(&self, _t_s: f64, w: &mut Workspace) {
        for p in 0..w.pairs() {
            let (k, c) = (self.stiffness[p], self.damping[p]);
            w.tangential[0][p] = k * w.gap[0][p] + c * w.gap_rate[0][p];
            w.tangential[1][p] = k * w.gap[1][p] + c * w.gap_rate[1][p];
        }
    }
}

impl Account for SpringDamper {
    /// Books the whole tangential force, a friction limit on it included: what the cap takes counts as dissipated.
    fn power(&self, w: &Workspace) -> Power {
        let (mut work, mut absorbed) = (f64x2::ZERO, f64x2::ZERO);
        for axis in 0..2 {
            for p in 0..w.pairs() {
                let spring = self.stiffness[p] * w.gap[axis][p];
                work += w.tangential[axis][p] * w.base_rate[axis][p];
                absorbed += (w.tangential[axis][p] - spring) * w.gap_rate[axis][p];
            }
        }
        Power { work_w: crate::lanes::sum(work), dissipated_w: crate::lanes::sum(absorbed) }
    }

    fn stored_j(&self, w: &Workspace) -> f64 {
        let mut stored = f64x2::ZERO;
        for axis in 0..2 {
            for p in 0..w.pairs() {
                stored += self.stiffness[p] * w.gap[axis][p] * w.gap[axis][p] * 0.5;
            }
        }
        crate::lanes::sum(stored)
    }
}

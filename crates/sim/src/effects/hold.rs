//! Sideways hold: hands keep the handle over the shoulder, as a spring and damper in the plane of the ground.
//!
//! ```text
//! T* = k_t d + c_t ḋ        [N], in x and y
//! ```
//! d shoulder minus handle in the plane normal to z (m); k_t stiffness [N/m]; c_t damping [N·s/m]. Alone it is never
//! capped and acts on a slack handle too (a grip). With the effect `friction` it cannot exceed μN, but its anchor does not slip: what has slid
//! farther than μN/k_t is drawn back with all of μN, as by hands that keep pulling. For what slips and stays: `friction` alone, or its bristles.
//! Source: paper, section 3.3 ("tangential forces can be added"); palanquin-bench, law of T.

use crate::lanes::{Moments, Number, f64x2, pack};
use crate::model::{Book, Local, Model, Pair, Part, Power, Sideways, Stage, Workspace};
use crate::scene::Scene;
use crate::scene::per_carrier::PerCarrier;
use crate::scene::problem::{Checker, Problem};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[effects.hold]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Hold {
    /// k_t, N/m.
    pub stiffness_n_per_m: PerCarrier,
    /// c_t, N·s/m.
    pub damping_n_s_per_m: PerCarrier,
}

impl Default for Hold {
    fn default() -> Self {
        Self {
            stiffness_n_per_m: 3000.0.into(),
            damping_n_s_per_m: 150.0.into(),
        }
    }
}

impl Hold {
    pub(super) fn check(&self, scene: &Scene) -> Result<(), Problem> {
        for (key, x) in [
            ("effects.hold.stiffness_n_per_m", &self.stiffness_n_per_m),
            ("effects.hold.damping_n_s_per_m", &self.damping_n_s_per_m),
        ] {
            Checker::per_carrier(key, x, scene.carriers.count())?;
            x.values()
                .iter()
                .try_for_each(|&v| Checker::not_negative(key, v))?;
        }
        Ok(())
    }

    pub(super) fn build(&self, scene: &Scene, model: &mut Model) {
        let n = scene.carriers.count();
        let stiffness = pack((0..n).map(|i| self.stiffness_n_per_m.get(i)));
        let damping = pack((0..n).map(|i| self.damping_n_s_per_m.get(i)));
        model.set_sideways_springs(damping.clone(), stiffness.clone());
        let law = SpringDampers(stiffness.into_iter().zip(damping).collect());
        model.add(Stage::Handles, law.clone());
        if scene.effects.friction.is_some() {
            // A spring that may slip holds less than its stretch says.
            model.add_account("hold", Sideways);
        } else {
            model.add_account("hold", law);
        }
    }
}

#[derive(Clone, Debug)]
struct SpringDampers(Vec<(f64x2, f64x2)>);

impl Local for SpringDampers {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>, part: impl Part) {
        for (p, &(k, c)) in part.of_mut(&mut w.pair).iter_mut().zip(part.of(&self.0)) {
            let (k, c) = (N::always(k), N::always(c));
            for axis in 0..2 {
                p.tangential[axis] = c.madd(p.gap_rate[axis], k * p.gap[axis]);
            }
        }
    }
}

impl Book for SpringDampers {
    /// The whole sideways force, a sling's included, but for what the springs store.
    #[inline(always)]
    fn power<N: Moments>(
        &self,
        _w: &Workspace<N>,
        pairs: &[Pair<N>],
        first: usize,
    ) -> Power<N::Each> {
        let (mut work, mut absorbed) = (N::Pair::splat(0.0), N::Pair::splat(0.0));
        for (p, &(stiffness, _)) in pairs.iter().zip(&self.0[first..]) {
            for axis in 0..2 {
                let spring = N::always(stiffness) * p.gap[axis];
                work = p.tangential[axis].madd(p.base_rate[axis], work);
                absorbed = (p.tangential[axis] - spring).madd(p.gap_rate[axis], absorbed);
            }
        }
        Power {
            work_w: N::sum(work),
            dissipated_w: N::sum(absorbed),
        }
    }

    fn stored_j(&self, w: &Workspace) -> f64 {
        let mut stored = f64x2::ZERO;
        for (p, &(stiffness, _)) in w.pair.iter().zip(&self.0) {
            for axis in 0..2 {
                stored += stiffness * p.gap[axis] * p.gap[axis] * 0.5;
            }
        }
        crate::lanes::sum(stored)
    }
}

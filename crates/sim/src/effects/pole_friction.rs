//! Friction torque about the pole: the pole turns on the shoulders and rubs, up to a limit.
//!
//! ```text
//! τ_x = −ρ Σ N_i · ω_x/√(ω_x² + ω_s²)        [N·m], about the body's x axis, the pole
//! ```
//! ρ friction arm: coefficient times radius of the pole (m); N_i normal forces (N); ω_x roll rate in the body [rad/s];
//! ω_s regularising rate [rad/s]. Small turns meet a viscous torque ρ N ω_x/ω_s, large ones a constant ρN: so small
//! swings die fast and large ones live. A slack handle does not rub; a bilateral one rubs with |N|.
//! Source: the archive's logs (damping 1.0 … 1.2 1/s for small swings, 0.39 1/s for large ones); the law is the
//! regularised Coulomb law of [`super::friction`], about an axis.

use crate::lanes::{Moments, Number};
use crate::model::{AsWhole, Book, Model, Pair, Power, Stage, Whole, Workspace};
use crate::scene::Scene;
use crate::scene::problem::{Checker, Problem};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[effects.pole_friction]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PoleFriction {
    /// ρ, m.
    pub arm_m: f64,
    /// ω_s, rad/s. Measured in the paper's logs: about 0.6.
    pub regularising_rate_rad_per_s: f64,
}

impl Default for PoleFriction {
    fn default() -> Self {
        Self {
            arm_m: 0.0021,
            regularising_rate_rad_per_s: 0.6,
        }
    }
}

impl PoleFriction {
    pub(super) fn check(&self, _scene: &Scene) -> Result<(), Problem> {
        Checker::not_negative("effects.pole_friction.arm_m", self.arm_m)?;
        Checker::positive(
            "effects.pole_friction.regularising_rate_rad_per_s",
            self.regularising_rate_rad_per_s,
        )
    }

    pub(super) fn build(&self, _scene: &Scene, model: &mut Model) {
        let bilateral = model.contact_pulls();
        let law = Rub {
            arm_m: self.arm_m,
            bilateral,
            rate2: self.regularising_rate_rad_per_s.powi(2),
        };
        model.expect_friction();
        model.turn_softly(self.regularising_rate_rad_per_s);
        model.add(Stage::Body, AsWhole(law.clone()));
        model.add_account("pole_friction", law);
    }
}

#[derive(Clone, Debug)]
struct Rub {
    arm_m: f64,
    bilateral: bool,
    rate2: f64,
}

impl Rub {
    #[inline(always)]
    fn torque_n_m<N: Moments>(&self, w: &Workspace<N>, pairs: &[Pair<N>]) -> N::Each {
        let (mut load, least) = (N::Pair::splat(0.0), N::Pair::splat(w.least_load_n));
        for p in pairs {
            load += if self.bilateral {
                p.normal.abs()
            } else {
                p.normal.larger(least)
            };
        }
        let rate = w.spin[0];
        N::sum(load) * -self.arm_m * rate / rate.madd(rate, N::Each::splat(self.rate2)).sqrt()
    }
}

impl Whole for Rub {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>) {
        w.body_torque[0] += self.torque_n_m(w, &w.pair);
    }
}

impl Book for Rub {
    #[inline(always)]
    fn power<N: Moments>(
        &self,
        w: &Workspace<N>,
        pairs: &[Pair<N>],
        _first: usize,
    ) -> Power<N::Each> {
        Power {
            work_w: N::Each::splat(0.0),
            dissipated_w: -self.torque_n_m(w, pairs) * w.spin[0],
        }
    }
}

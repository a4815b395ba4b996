//! Coulomb friction at the shoulders, regularised: it limits the hold, or acts alone where there is none.
//!
//! ```text
//! e = T*/(μN) + ḋ/v_s        T = μN · e/√(1 + |e|²)        |T| < μN        [N]
//! ```
//! T* the force of hold and sling (zero without them) (N); μ coefficient (1); N normal force (N), ≥ 0; ḋ sliding velocity,
//! shoulder minus handle, in the plane [m/s]; v_s regularising velocity [m/s]. As v_s → 0 with no hold it is Coulomb's
//! law; |T*| ≪ μN and v_s → ∞ leave the hold as it is. With N → 0 the force vanishes like μN. Smooth everywhere, so
//! sticking and sliding are no events; it creeps at |T|/(μN)·v_s where true dry friction would stick.
//!
//! Alternative law, `bristle`: the cloth bends before it slips. Its own state z, two for each carrier, instead of `hold`:
//!
//! ```text
//! ż = ḋ − (σ₀/μ) |ḋ| z        T = N (σ₀ z + σ₁ ż)
//! ```
//! z bristle deflection (m); σ₀ stiffness per load [1/m]; σ₁ damping per load [s/m]. In steady sliding T = μN along ḋ; under
//! μN it sticks: a spring of N σ₀ with no creep. |z| ≤ μ/σ₀ for ever if it is so once. On a slack handle T = 0, and the bristles straighten:
//! ż = −z/τ, τ = max(σ₁/σ₀, 10 ms), as σ₀ z + σ₁ ż = 0 asks of what has no mass. |ḋ| has a kink at ḋ = 0, which costs the solver a few short steps. What the bristles hold counts as dissipated
//! until they give it back. Source: Dahl (1968); load-scaled LuGre: Canudas de Wit & Tsiotras, CDC 1999, without its Stribeck curve.
//!
//! Source: paper, section 3.3 ("regularized friction"); Stewart & Trinkle (1996) for what is regularised.

use crate::lanes::{LANES, Moments, Number};
use crate::model::{Local, Model, Part, Sideways, Stage, Workspace};
use crate::scene::Scene;
use crate::scene::problem::{Checker, Problem, problem};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// `[effects.friction]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Friction {
    /// μ, 1. Wood on cloth: 0.3 to 0.6.
    pub coefficient: f64,
    /// v_s, m/s.
    pub regularising_velocity_m_per_s: f64,
    /// Which law.
    pub law: Law,
    /// σ₀ of `bristle`, 1/m.
    pub bristle_stiffness_per_m: f64,
    /// σ₁ of `bristle`, s/m.
    pub bristle_damping_s_per_m: f64,
}

/// How sticking is told from sliding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Law {
    /// Smooth in the sliding velocity: it creeps where dry friction sticks.
    #[default]
    Regularised,
    /// Bristles with states of their own: it sticks.
    Bristle,
}

impl Default for Friction {
    fn default() -> Self {
        Self {
            coefficient: 0.5,
            regularising_velocity_m_per_s: 0.1,
            law: Law::Regularised,
            bristle_stiffness_per_m: 10.0,
            bristle_damping_s_per_m: 0.5,
        }
    }
}

/// Bristles without damping straighten in no time; so fast is fast enough, s.
const STRAIGHTENING_S: f64 = 0.01;
/// Least v_s, m/s: beyond what any motion can tell from dry friction.
const SLOWEST_M_PER_S: f64 = 1e-9;

impl Friction {
    pub(super) fn check(&self, scene: &Scene) -> Result<(), Problem> {
        Checker::positive(
            "effects.friction.bristle_stiffness_per_m",
            self.bristle_stiffness_per_m,
        )?;
        Checker::not_negative(
            "effects.friction.bristle_damping_s_per_m",
            self.bristle_damping_s_per_m,
        )?;
        if self.law == Law::Bristle {
            if scene.effects.hold.is_some() || scene.effects.sling.is_some() {
                return Err(problem(
                    "effects.friction.law",
                    "bristles are an elastic hold already; leave `effects.hold` and `effects.sling` out",
                ));
            }
            Checker::positive("effects.friction.coefficient", self.coefficient)?;
        }
        Checker::not_negative("effects.friction.coefficient", self.coefficient)?;
        Checker::within(
            "effects.friction.regularising_velocity_m_per_s",
            self.regularising_velocity_m_per_s,
            SLOWEST_M_PER_S..=Checker::MOST,
        )
    }

    pub(super) fn build(&self, scene: &Scene, model: &mut Model) {
        model.expect_friction();
        if self.law == Law::Bristle {
            let n = scene.carriers.count();
            let names =
                (1..=n).flat_map(|i| ["x", "y"].map(|axis| (format!("bristle_{i}_{axis}_m"), 0.0)));
            let first = model.add_states(names);
            let law = Bristles {
                first,
                carriers: n,
                stiffness: self.bristle_stiffness_per_m,
                damping: self.bristle_damping_s_per_m,
                per_length: self.bristle_stiffness_per_m / self.coefficient,
                straightening_per_s: 1.0
                    / (self.bristle_damping_s_per_m / self.bristle_stiffness_per_m)
                        .max(STRAIGHTENING_S),
            };
            model.jump_at_contact();
            model.set_friction_damping(self.bristle_damping_s_per_m);
            model.add(Stage::Handles, law);
            model.add_account("friction", Sideways);
            return;
        }
        model.set_friction_damping(self.coefficient / self.regularising_velocity_m_per_s);
        let law = Coulomb {
            mu: self.coefficient,
            per_velocity: 1.0 / self.regularising_velocity_m_per_s,
        };
        if scene.effects.hold.is_some() || scene.effects.sling.is_some() {
            // The hold's or the sling's account books the limited force.
            model.add(Stage::Handles, Limit(law));
        } else {
            model.add(Stage::Handles, Alone(law));
            model.add_account("friction", Sideways);
        }
    }
}

#[derive(Debug)]
struct Coulomb {
    mu: f64,
    per_velocity: f64,
}

impl Coulomb {
    /// μN·e/√(1 + |e|²), written so that μN = 0 needs no case of its own.
    #[inline(always)]
    fn limited<T: Number>(&self, normal: T, hold: [T; 2], rate: [T; 2]) -> [T; 2] {
        let most = (normal * self.mu).larger(T::splat(0.0));
        let wanted = [
            most.madd(rate[0] * self.per_velocity, hold[0]),
            most.madd(rate[1] * self.per_velocity, hold[1]),
        ];
        let tiny = T::splat(f64::MIN_POSITIVE);
        let length = wanted[0]
            .madd(wanted[0], wanted[1].madd(wanted[1], most * most))
            .larger(tiny)
            .sqrt();
        let kept = most / length;
        [wanted[0] * kept, wanted[1] * kept]
    }
}

#[derive(Debug)]
struct Bristles {
    first: usize,
    carriers: usize,
    stiffness: f64,
    damping: f64,
    /// σ₀/μ, 1/m
    per_length: f64,
    /// 1/τ, 1/s
    straightening_per_s: f64,
}

impl Local for Bristles {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>, part: impl Part) {
        let Range { start, end } = part.range(w.pair.len());
        for i in LANES * start..self.carriers.min(LANES * end) {
            let slide = [0, 1].map(|a| w.of(i, |p| p.gap_rate[a]));
            let speed = (slide[0] * slide[0] + slide[1] * slide[1]).sqrt();
            let load = w.of(i, |p| p.normal).larger(N::Each::splat(0.0));
            let acts = w.of(i, |p| p.acts());
            for axis in 0..2 {
                let at = self.first + 2 * i + axis;
                let bent = w.extra[at];
                let sliding = slide[axis] - speed * self.per_length * bent;
                let rate = acts.if_positive(sliding, bent * -self.straightening_per_s);
                w.extra_rate[at] = rate;
                let force = load * (bent * self.stiffness + rate * self.damping);
                w.set(i, |p| &mut p.tangential[axis], force);
            }
        }
    }
}

#[derive(Debug)]
struct Limit(Coulomb);

impl Local for Limit {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>, part: impl Part) {
        for p in part.of_mut(&mut w.pair) {
            p.tangential = self
                .0
                .limited(p.normal, p.tangential, [p.gap_rate[0], p.gap_rate[1]]);
        }
    }
}

#[derive(Debug)]
struct Alone(Coulomb);

impl Local for Alone {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>, part: impl Part) {
        for p in part.of_mut(&mut w.pair) {
            p.tangential = self.0.limited(
                p.normal,
                [N::Pair::splat(0.0); 2],
                [p.gap_rate[0], p.gap_rate[1]],
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::f64x2;

    #[test]
    fn the_limits_are_coulomb_and_the_hold() {
        let at = |mu: f64, vs: f64, n: f64, hold: f64, v: f64| {
            let law = Coulomb {
                mu,
                per_velocity: 1.0 / vs,
            };
            let zero = f64x2::ZERO;
            law.limited(
                f64x2::splat(n),
                [f64x2::splat(hold), zero],
                [f64x2::splat(v), zero],
            )[0]
            .to_array()[0]
        };
        // Sliding fast: μN along the sliding. Against it: the same, other sign.
        assert!((at(0.5, 1e-6, 100.0, 0.0, 1.0) - 50.0).abs() < 1e-9);
        assert!((at(0.5, 1e-6, 100.0, 0.0, -1.0) + 50.0).abs() < 1e-9);
        // A weak hold passes unchanged: relative loss ½(T*/μN)².
        assert!((at(0.5, 1e9, 1000.0, 1.0, 0.0) - 1.0).abs() < 3e-6);
        // Never beyond μN, nothing on a slack handle, nothing without friction.
        assert!(at(0.5, 0.1, 100.0, 1e9, 1e3) <= 50.0);
        assert_eq!(at(0.5, 0.1, 0.0, 10.0, 1.0), 0.0);
        assert_eq!(at(0.0, 0.1, 100.0, 10.0, 1.0), 0.0);
    }
}

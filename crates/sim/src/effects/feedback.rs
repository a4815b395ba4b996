//! Contact → phase feedback: the load that a carrier feels speeds the gait up or slows it down.
//!
//! ```text
//! φ̇_i += κ (ℓ_i − 1) sin(α − φ_i)        ℓ̇_i = (N_i/N₀ − ℓ_i)/τ        N₀ = −M g_z/N
//! ```
//! κ strength [rad/s]; α phase at which the load leaves the gait alone, and towards which an excess of it pulls (rad);
//! ℓ_i felt load, in fair shares (1); τ latency of the nerves (s); N_i normal force (N); N₀ fair share of what presses on the ground (N). A
//! first-harmonic phase response (type 1). The latency is a state of its own, one for each carrier: without it the force would
//! need the phase rate that it sets. A slack handle is felt as ℓ → 0, which pushes the phase away from α. ℓ starts at 1.
//! Under a steady load ℓ it is Adler's equation with a beat at rest: φ drifts at √(ω² − κ²(ℓ−1)²).
//! Source: Nessler et al. (2016), phase resetting in gait; Kuramoto, *Chemical Oscillations* (1984), ch. 3, for the form.
//! The paper's scenes have none: there the phases never feel the load.

use crate::lanes::Moments;
use crate::model::{AsWhole, Model, Stage, Whole, Workspace};
use crate::scene::Scene;
use crate::scene::problem::{Checker, Problem};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[effects.feedback]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Feedback {
    /// κ, rad/s.
    pub strength_rad_per_s: f64,
    /// α, rad.
    pub phase_rad: f64,
    /// τ, s.
    pub latency_s: f64,
}

impl Default for Feedback {
    fn default() -> Self {
        Self {
            strength_rad_per_s: 0.3,
            phase_rad: 0.0,
            latency_s: 0.1,
        }
    }
}

impl Feedback {
    pub(super) fn check(&self, _scene: &Scene) -> Result<(), Problem> {
        Checker::finite(
            "effects.feedback.strength_rad_per_s",
            self.strength_rad_per_s,
        )?;
        Checker::angle_rad("effects.feedback.phase_rad", self.phase_rad)?;
        Checker::positive("effects.feedback.latency_s", self.latency_s)
    }

    pub(super) fn build(&self, scene: &Scene, model: &mut Model) {
        let n = scene.carriers.count();
        let share_n = -model.body.mass_kg * model.body.gravity_m_per_s2.z / n as f64;
        model.need_phases();
        let first = model.add_states((1..=n).map(|i| (format!("felt_load_{i}"), 1.0)));
        let law = Law {
            first,
            carriers: n,
            strength: self.strength_rad_per_s,
            phase: self.phase_rad.sin_cos(),
            per_s: 1.0 / self.latency_s,
            // Without weight there is no fair share: nothing is felt.
            per_n: if share_n > 0.0 { 1.0 / share_n } else { 0.0 },
        };
        model.add(Stage::Phases, AsWhole(Respond(law.clone())));
        model.add(Stage::Body, AsWhole(Feel(law)));
    }
}

#[derive(Clone, Debug)]
struct Law {
    first: usize,
    carriers: usize,
    strength: f64,
    /// sin α, cos α
    phase: (f64, f64),
    per_s: f64,
    per_n: f64,
}

#[derive(Debug)]
struct Respond(Law);

impl Whole for Respond {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>) {
        let law = &self.0;
        for i in 0..law.carriers {
            let toward = w.of(i, |p| p.cos) * law.phase.0 - w.of(i, |p| p.sin) * law.phase.1;
            let excess = w.extra[law.first + i] + -1.0;
            let rate = w.of(i, |p| p.rate) + excess * toward * law.strength;
            w.set(i, |p| &mut p.rate, rate);
        }
    }
}

#[derive(Debug)]
struct Feel(Law);

impl Whole for Feel {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>) {
        let law = &self.0;
        for i in 0..law.carriers {
            let felt = w.extra[law.first + i];
            w.extra_rate[law.first + i] = (w.of(i, |p| p.normal) * law.per_n - felt) * law.per_s;
        }
    }
}

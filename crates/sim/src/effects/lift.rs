//! Lift gain: under music people lift harder than their gait alone would.
//!
//! ```text
//! z_i = z_i0 + G(t) (z_i,gait − z_i0)        G(t) = 1 + (g − 1)(1 − e^{−(t − t₀)/τ})  for t ≥ t₀,  1 before
//! ```
//! g gain (1); t₀ onset (s); τ build-up (s), where 0 means g from t₀ on (then the shoulders jump at t₀ > 0, so a build-up
//! is asked for there). At t₀ their velocity jumps by (g − 1)(z_i,gait − z_i0)/τ. Source: the archive's music logs, whose summed force is large before the phases lock.

use crate::lanes::{Moments, Number};
use crate::model::{Local, Model, Pair, Part, Stage, Switch, Workspace};
use crate::scene::Scene;
use crate::scene::problem::{Checker, Problem, problem};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[effects.lift]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Lift {
    /// g, 1. Inferred from the paper's music logs: 1.1 to 1.25.
    pub gain: f64,
    /// t₀, s.
    pub onset_s: f64,
    /// τ, s.
    pub build_up_s: f64,
}

impl Default for Lift {
    fn default() -> Self {
        Self {
            gain: 1.2,
            onset_s: 0.0,
            build_up_s: 0.0,
        }
    }
}

impl Lift {
    pub(super) fn check(&self, scene: &Scene) -> Result<(), Problem> {
        Checker::not_negative("effects.lift.gain", self.gain)?;
        Checker::not_negative("effects.lift.onset_s", self.onset_s)?;
        Checker::not_negative("effects.lift.build_up_s", self.build_up_s)?;
        if scene.effects.gait.is_none() {
            return Err(problem(
                "effects.lift",
                "there is no `effects.gait` whose motion it could amplify",
            ));
        }
        if self.onset_s > 0.0 && self.build_up_s == 0.0 {
            return Err(problem(
                "effects.lift.build_up_s",
                "found 0 with an onset after the start: the shoulders would jump",
            ));
        }
        Ok(())
    }

    pub(super) fn build(&self, _scene: &Scene, model: &mut Model) {
        let (excess, onset_s) = (self.gain - 1.0, self.onset_s);
        if self.build_up_s == 0.0 {
            model.add(Stage::Shoulders, Constant(self.gain));
        } else {
            model.add(
                Stage::Shoulders,
                Growing {
                    excess,
                    onset_s,
                    per_s: 1.0 / self.build_up_s,
                },
            );
            if onset_s > 0.0 {
                model.add_switch(Onset(onset_s));
            }
        }
    }
}

#[inline(always)]
fn amplify<N: Moments>(pairs: &mut [Pair<N>], gain: N::Each, gain_rate: N::Each) {
    let (gain, gain_rate) = (N::both(gain), N::both(gain_rate));
    for p in pairs {
        let lifted = p.base[2] - p.rest[2];
        p.base[2] = lifted.madd(gain, p.rest[2]);
        p.base_rate[2] = lifted.madd(gain_rate, p.base_rate[2] * gain);
    }
}

#[derive(Debug)]
struct Constant(f64);

impl Local for Constant {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>, part: impl Part) {
        let number = N::Each::splat;
        amplify(part.of_mut(&mut w.pair), number(self.0), number(0.0));
    }
}

#[derive(Debug)]
struct Growing {
    excess: f64,
    onset_s: f64,
    per_s: f64,
}

impl Local for Growing {
    #[inline(always)]
    fn act<N: Moments>(&self, t_s: N::Each, w: &mut Workspace<N>, part: impl Part) {
        // `segment_s` decides, not t: the last stage of the step that ends at the onset still grows nothing, and what looks a little back
        // from the onset sees no kink.
        let zero = N::Each::splat(0.0);
        let before = -w.segment_s + self.onset_s;
        let heard_s = before.if_positive(zero, t_s + -self.onset_s);
        let decay = (heard_s * -self.per_s).exp();
        let growing = before.if_positive(zero, decay * (self.excess * self.per_s));
        let gain = decay * -self.excess + (1.0 + self.excess);
        amplify(part.of_mut(&mut w.pair), gain, growing);
    }
}

/// The gain's slope jumps at its onset.
#[derive(Debug)]
struct Onset(f64);

impl Switch for Onset {
    fn next_s(&self, after_s: f64) -> f64 {
        if after_s < self.0 {
            self.0
        } else {
            f64::INFINITY
        }
    }
}

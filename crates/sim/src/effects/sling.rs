//! Sling: a sideways restoring force that grows with the load, as of a handle that hangs in straps.
//!
//! ```text
//! T = (N/L) (d + τ ḋ)        [N], in x and y
//! ```
//! N normal force (N), taken as 0 where it would pull; d shoulder minus handle in the plane normal to z (m); L length of
//! the strap (m): the force keeps pointing along a strap of that length, small angles; τ damping time (s). A slack handle is
//! free sideways. The force is conservative at constant N only: where N changes with d held, the load does the work, so
//! the account books no stored energy and everything absorbed as dissipated (it may be given back). Valid for |d| well below L: a load that
//! bounces at twice its swing is fed by this, and with τ = 0, or contacts that hardly damp, swings beyond any strap; `sim record` says so.
//!
//! Source: the paper's logs. In its music runs the centre of mass swings sideways as −(0.0995 m) sin(roll) with y to the
//! left, the same ratio at every amplitude, and is free in flight: a force in proportion to the load does that (with
//! h = 0.1 m, M = 60 kg and a = 0.04795 it asks for L = 0.70 m and I_xx = 2.68 kg·m²), a spring of its own does not.

use crate::lanes::{Moments, Number};
use crate::model::{Local, Model, Pair, Part, Sideways, Stage, Workspace};
use crate::scene::Scene;
use crate::scene::problem::{Checker, Problem};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[effects.sling]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Sling {
    /// L, m.
    pub length_m: f64,
    /// τ, s.
    pub damping_s: f64,
}

impl Default for Sling {
    fn default() -> Self {
        Self {
            length_m: 0.7,
            damping_s: 0.06,
        }
    }
}

impl Sling {
    pub(super) fn check(&self, _scene: &Scene) -> Result<(), Problem> {
        Checker::positive("effects.sling.length_m", self.length_m)?;
        Checker::not_negative("effects.sling.damping_s", self.damping_s)
    }

    pub(super) fn build(&self, scene: &Scene, model: &mut Model) {
        let law = Strap {
            per_length: 1.0 / self.length_m,
            damping_s: self.damping_s,
            // A contact that cannot pull has no least load of its own: there the workspace alone decides.
            least_n: if model.contact_pulls() {
                0.0
            } else {
                f64::NEG_INFINITY
            },
        };
        model.set_straps(self.damping_s / self.length_m, 1.0 / self.length_m);
        if scene.effects.hold.is_some() {
            // The hold has set its force already, and its account books all that there is sideways.
            model.add(Stage::Handles, Beside(law));
        } else {
            model.add(Stage::Handles, law);
            model.add_account("sling", Sideways);
        }
    }
}

#[derive(Debug)]
struct Strap {
    per_length: f64,
    damping_s: f64,
    least_n: f64,
}

impl Strap {
    #[inline(always)]
    fn force<N: Moments>(&self, p: &Pair<N>, least_n: f64) -> [N::Pair; 2] {
        let least = N::Pair::splat(self.least_n.max(least_n));
        let load = p.normal.larger(least) * self.per_length;
        let damping_s = N::Pair::splat(self.damping_s);
        [
            load * p.gap_rate[0].madd(damping_s, p.gap[0]),
            load * p.gap_rate[1].madd(damping_s, p.gap[1]),
        ]
    }
}

impl Local for Strap {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>, part: impl Part) {
        let least_n = w.least_load_n;
        for p in part.of_mut(&mut w.pair) {
            p.tangential = self.force(p, least_n);
        }
    }
}

/// The same, added to the force of a hold.
#[derive(Debug)]
struct Beside(Strap);

impl Local for Beside {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>, part: impl Part) {
        let least_n = w.least_load_n;
        for p in part.of_mut(&mut w.pair) {
            let [x, y] = self.0.force(p, least_n);
            p.tangential[0] += x;
            p.tangential[1] += y;
        }
    }
}

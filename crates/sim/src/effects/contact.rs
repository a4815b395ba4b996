//! Handle contact: a spring and damper that push and, unless bilateral, never pull.
//!
//! ```text
//! N* = k δ + c δ̇        N = max(0, N*)  (unilateral)        N = N*  (bilateral)        [N]
//! ```
//! δ compression along the normal z, shoulder minus handle (m); k stiffness [N/m]; c damping [N·s/m].
//! Holds for a massless shoulder. The unilateral force is continuous and kinks where N* = 0: that zero is the event,
//! both ways. With c > 0 it opens before δ = 0, and a fast approach pushes before the surfaces meet: the law's known
//! price. Energy: the spring stores ½kδ² while it is pressed, δ > 0, whether or not N acts: what it gives while the handle is slack
//! goes into the damper, as does what a fast approach gives before the surfaces meet. So nothing is dissipated that comes back.
//!
//! Alternative law, `hunt-crossley`: N* = k δ^p (1 + d δ̇), d = c/k, p exponent (1); k then in N/m^p, c in N·s/m^(p+1). Its damping vanishes with δ, so
//! the force starts from zero at touch-down and never jumps; it is unilateral. For δ < 0 N* = −k|δ|^p max(1 + d δ̇, 0.01) only marks
//! the sign. With p = 1 it is smooth through the zero. Source: Hunt & Crossley, J. Appl. Mech. 42 (1975), 440–445.
//! Source: paper, eq. (unilateral); Brogliato, Nonsmooth Mechanics (1999), ch. 2.

use crate::lanes::{Moments, Now, Number, f64x2, pack};
use crate::model::{Book, Local, Model, Pair, Part, Power, Stage, Workspace};
use crate::scene::Scene;
use crate::scene::per_carrier::PerCarrier;
use crate::scene::problem::{Checker, Problem, problem, shown};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[effects.contact]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Contact {
    /// k, N/m. Measured in the paper's logs: about 3000.
    pub stiffness_n_per_m: PerCarrier,
    /// c, N·s/m. Measured: 400 to 500.
    pub damping_n_s_per_m: PerCarrier,
    /// Whether handles are tied to the shoulders: the force may pull.
    pub bilateral: bool,
    /// Which law.
    pub law: Law,
    /// p of `hunt-crossley`, 1.
    pub exponent: f64,
}

/// How the force depends on compression.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Law {
    /// N* = k δ + c δ̇
    #[default]
    SpringDamper,
    /// N* = k δ^p (1 + (c/k) δ̇)
    HuntCrossley,
}

impl Default for Contact {
    fn default() -> Self {
        Self {
            stiffness_n_per_m: 3000.0.into(),
            damping_n_s_per_m: 450.0.into(),
            bilateral: false,
            law: Law::SpringDamper,
            exponent: 1.0,
        }
    }
}

impl Contact {
    pub(super) fn check(&self, scene: &Scene) -> Result<(), Problem> {
        let n = scene.carriers.count();
        let (k, c) = (
            "effects.contact.stiffness_n_per_m",
            "effects.contact.damping_n_s_per_m",
        );
        Checker::per_carrier(k, &self.stiffness_n_per_m, n)?;
        Checker::per_carrier(c, &self.damping_n_s_per_m, n)?;
        self.stiffness_n_per_m
            .values()
            .iter()
            .try_for_each(|&x| Checker::not_negative(k, x))?;
        self.damping_n_s_per_m
            .values()
            .iter()
            .try_for_each(|&x| Checker::not_negative(c, x))?;
        Checker::positive("effects.contact.exponent", self.exponent)?;
        if self.law == Law::HuntCrossley {
            if self.bilateral {
                return Err(problem(
                    "effects.contact.law",
                    "hunt-crossley cannot pull; leave `bilateral` out",
                ));
            }
            if !(1.0..=3.0).contains(&self.exponent) {
                return Err(problem(
                    "effects.contact.exponent",
                    format!("found {}, expected 1 to 3", shown(self.exponent)),
                ));
            }
            return self
                .stiffness_n_per_m
                .values()
                .iter()
                .try_for_each(|&x| Checker::positive(k, x));
        }
        if self.exponent != 1.0 {
            return Err(problem(
                "effects.contact.exponent",
                format!(
                    "found {}, but spring and damper are linear; take law = \"hunt-crossley\", or leave it out",
                    shown(self.exponent)
                ),
            ));
        }
        let pushes = (0..n)
            .all(|i| self.stiffness_n_per_m.get(i) > 0.0 || self.damping_n_s_per_m.get(i) > 0.0);
        if pushes {
            Ok(())
        } else {
            Err(problem(
                k,
                "stiffness and damping are both zero; leave the effect out instead",
            ))
        }
    }

    pub(super) fn build(&self, scene: &Scene, model: &mut Model) {
        let n = scene.carriers.count();
        let stiffness = pack((0..n).map(|i| self.stiffness_n_per_m.get(i)));
        let exponent = match self.law {
            Law::SpringDamper => {
                let damping = pack((0..n).map(|i| self.damping_n_s_per_m.get(i)));
                model.set_contact_damping(damping.clone());
                let law = SpringDampers {
                    springs: stiffness.into_iter().zip(damping).collect(),
                    bilateral: self.bilateral,
                };
                model.add(Stage::Handles, law.clone());
                model.add_account("contact", law);
                1.0
            }
            Law::HuntCrossley => {
                let per_rate =
                    (0..n).map(|i| self.damping_n_s_per_m.get(i) / self.stiffness_n_per_m.get(i));
                let law = HuntCrossley {
                    stiffness,
                    per_rate: pack(per_rate),
                    exponent: self.exponent,
                };
                model.add(Stage::Handles, law.clone());
                model.add_account("contact", law);
                self.exponent
            }
        };
        model.set_contact_springs(
            self.bilateral,
            (0..n).map(|i| self.stiffness_n_per_m.get(i)),
            exponent,
        );
    }
}

#[derive(Clone, Debug)]
struct HuntCrossley {
    stiffness: Vec<f64x2>,
    /// d = c/k, s/m
    per_rate: Vec<f64x2>,
    exponent: f64,
}

impl HuntCrossley {
    /// k |δ|^p with the sign of δ.
    #[inline(always)]
    fn spring<N: Moments>(&self, p: usize, gap: N::Pair) -> N::Pair {
        let bent = if self.exponent == 1.0 {
            gap
        } else {
            gap.signed_power(self.exponent)
        };
        N::always(self.stiffness[p]) * bent
    }

    /// ∫ k |δ|^p dδ, J.
    fn bent_j(&self, p: usize, w: &Workspace) -> f64x2 {
        let gap = w.pair[p].gap[2];
        self.spring::<Now>(p, gap) * gap * (1.0 / (self.exponent + 1.0))
    }
}

impl Local for HuntCrossley {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>, part: impl Part) {
        for p in part.range(w.pair.len()) {
            let spring = self.spring::<N>(p, w.pair[p].gap[2]);
            let factor = N::always(self.per_rate[p]) * w.pair[p].gap_rate[2] + 1.0;
            let free = spring * (-spring).if_positive(factor.larger(N::Pair::splat(0.01)), factor);
            w.pair[p].unclamped = free;
            w.pair[p].normal = (free * w.pair[p].contact_gain).larger(w.pair[p].contact_floor);
        }
    }
}

impl Book for HuntCrossley {
    #[inline(always)]
    fn power<N: Moments>(
        &self,
        _w: &Workspace<N>,
        pairs: &[Pair<N>],
        first: usize,
    ) -> Power<N::Each> {
        let (mut work, mut absorbed) = (N::Pair::splat(0.0), N::Pair::splat(0.0));
        for (k, p) in pairs.iter().enumerate() {
            let spring = in_contact(p, self.spring::<N>(first + k, p.gap[2]));
            work = p.normal.madd(p.base_rate[2], work);
            absorbed = (p.normal - spring).madd(p.gap_rate[2], absorbed);
        }
        Power {
            work_w: N::sum(work),
            dissipated_w: N::sum(absorbed),
        }
    }

    fn stored_j(&self, w: &Workspace) -> f64 {
        let mut stored = f64x2::ZERO;
        for p in 0..w.pair.len() {
            stored += in_contact(&w.pair[p], self.bent_j(p, w));
        }
        crate::lanes::sum(stored)
    }

    fn lent_j(&self, w: &Workspace) -> f64 {
        let mut lent = f64x2::ZERO;
        for p in 0..w.pair.len() {
            lent += lent_by(&w.pair[p], self.bent_j(p, w));
        }
        crate::lanes::sum(lent)
    }
}

/// The law for all handles. `gain` and `floor` of the workspace select the branch: see [`Workspace`].
#[derive(Clone, Debug)]
struct SpringDampers {
    springs: Vec<(f64x2, f64x2)>,
    bilateral: bool,
}

impl Local for SpringDampers {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>, part: impl Part) {
        for (p, &(stiffness, damping)) in part
            .of_mut(&mut w.pair)
            .iter_mut()
            .zip(part.of(&self.springs))
        {
            let spring = N::always(stiffness) * p.gap[2];
            let free = N::always(damping).madd(p.gap_rate[2], spring);
            p.unclamped = free;
            p.normal = (free * p.contact_gain).larger(p.contact_floor);
        }
    }
}

/// Of `bent_j`, the energy of a spring bent by δ, what the books hold and the spring does not, J. They hold it where N acts, whatever the
/// sign of δ, so that nothing kinks within a step; the spring holds it while it is pressed.
fn lent_by(p: &Pair, bent_j: f64x2) -> f64x2 {
    in_contact::<Now>(p, bent_j) - p.gap[2].if_positive(bent_j, f64x2::ZERO)
}

/// `x` where N acts, 0 elsewhere.
#[inline(always)]
fn in_contact<N: Moments>(p: &Pair<N>, x: N::Pair) -> N::Pair {
    p.acts().if_positive(x, N::Pair::splat(0.0))
}

impl Book for SpringDampers {
    #[inline(always)]
    fn power<N: Moments>(
        &self,
        _w: &Workspace<N>,
        pairs: &[Pair<N>],
        first: usize,
    ) -> Power<N::Each> {
        let (mut work, mut absorbed) = (N::Pair::splat(0.0), N::Pair::splat(0.0));
        for (p, &(stiffness, _)) in pairs.iter().zip(&self.springs[first..]) {
            // N δ̇ goes into the spring and the damper; the spring's part returns through `stored_j`.
            let spring = in_contact(p, N::always(stiffness) * p.gap[2]);
            work = p.normal.madd(p.base_rate[2], work);
            absorbed = (p.normal - spring).madd(p.gap_rate[2], absorbed);
        }
        Power {
            work_w: N::sum(work),
            dissipated_w: N::sum(absorbed),
        }
    }

    fn stored_j(&self, w: &Workspace) -> f64 {
        let mut stored = f64x2::ZERO;
        for (p, &(stiffness, _)) in w.pair.iter().zip(&self.springs) {
            stored += in_contact(p, stiffness * p.gap[2] * p.gap[2] * 0.5);
        }
        crate::lanes::sum(stored)
    }

    fn lent_j(&self, w: &Workspace) -> f64 {
        if self.bilateral {
            return 0.0;
        }
        let mut lent = f64x2::ZERO;
        for (p, &(stiffness, _)) in w.pair.iter().zip(&self.springs) {
            lent += lent_by(p, stiffness * p.gap[2] * p.gap[2] * 0.5);
        }
        crate::lanes::sum(lent)
    }
}

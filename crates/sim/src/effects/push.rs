//! Pushes: somebody beside the party pushes or pulls the load, once or several times.
//!
//! ```text
//! F(t) = F₀ sin²(πu),   u = (t − t₀)/T on 0 … 1,   F = 0 before and behind            M v̇ += F            τ += p × RᵀF
//! ```
//! F₀ the most of the force, along the axes in which positions are given (N); t₀ beginning, T how long (s); p where it takes hold, from the
//! centre of mass in the body's axes (m): it stays at that point of the body, and the force keeps its direction. Impulse F₀T/2. Force and its rate
//! are continuous; t₀ and t₀ + T are moments the solver meets. The work F·(v + R(ω × p)) stands in the ledger. Inertial sensors feel the push, handles
//! only what it makes of the motion. Source: the haversine pulse of shock testing (Harris' Shock and Vibration Handbook, ch. on
//! transient response; half-sine squared, its spectrum without the half-sine's lobes).

use crate::lanes::{Moments, Number};
use crate::model::{AsWhole, Book, Model, Pair, Power, Stage, Switch, Whole, Workspace};
use crate::scene::Scene;
use crate::scene::problem::{Checker, Problem, problem};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// `[effects.push]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Push {
    /// `[[effects.push.pushes]]`, each by itself; they may overlap.
    pub pushes: Vec<One>,
}

/// `[[effects.push.pushes]]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct One {
    /// t₀, s.
    pub start_s: f64,
    /// T, s.
    pub time_s: f64,
    /// F₀, N.
    pub force_n: [f64; 3],
    /// p, m.
    pub place_m: [f64; 3],
}

impl Default for One {
    fn default() -> Self {
        Self {
            start_s: 20.0,
            time_s: 0.5,
            force_n: [0.0, 200.0, 0.0],
            place_m: [0.0; 3],
        }
    }
}

impl Default for Push {
    fn default() -> Self {
        Self {
            pushes: vec![One::default()],
        }
    }
}

/// More pushes than this are taken for a mistake: each is gone through in every evaluation.
const MOST: usize = 1000;

impl Push {
    pub(super) fn check(&self, _scene: &Scene) -> Result<(), Problem> {
        if self.pushes.len() > MOST {
            return Err(problem(
                "effects.push.pushes",
                format!(
                    "found {} of them, {MOST} at most are expected",
                    self.pushes.len()
                ),
            ));
        }
        for (k, push) in self.pushes.iter().enumerate() {
            let key = |name: &str| format!("effects.push.pushes[{k}].{name}");
            Checker::not_negative(&key("start_s"), push.start_s)?;
            Checker::positive(&key("time_s"), push.time_s)?;
            for (name, vector) in [("force_n", push.force_n), ("place_m", push.place_m)] {
                for x in vector {
                    Checker::finite(&key(name), x)?;
                }
            }
        }
        Ok(())
    }

    pub(super) fn build(&self, _scene: &Scene, model: &mut Model) {
        if self.pushes.is_empty() {
            return;
        }
        let law = Law {
            pushes: self.pushes.clone(),
            per_kg: 1.0 / model.body.mass_kg,
        };
        model.look_at_body();
        model.add(Stage::Body, AsWhole(law.clone()));
        model.add_switch(law.clone());
        model.add_account("push", law);
    }
}

#[derive(Clone, Debug)]
struct Law {
    pushes: Vec<One>,
    per_kg: f64,
}

impl One {
    /// sin²(πu)
    #[inline(always)]
    fn share<T: Number>(&self, t_s: T) -> T {
        let (zero, one) = (T::splat(0.0), T::splat(1.0));
        let u = ((t_s + -self.start_s) * (1.0 / self.time_s)).larger(zero);
        let left = (one - u).larger(zero);
        // Not π itself, whose sine is not 0.
        let sin = (u + -0.5).if_positive(left, u);
        let sin = (sin * PI).sin_cos().0;
        sin * sin
    }

    /// Force in the world (N) and its torque in the body (N·m).
    #[inline(always)]
    fn act<N: Moments>(&self, t_s: N::Each, w: &Workspace<N>) -> [[N::Each; 3]; 2] {
        let share = self.share(t_s);
        let [x, y, z] = self.force_n;
        let force = [share * x, share * y, share * z];
        let r = &w.rotation;
        let along = |a: usize| r[0][a] * force[0] + r[1][a] * force[1] + r[2][a] * force[2];
        let (p, f) = (self.place_m, [along(0), along(1), along(2)]);
        let torque = [
            f[2] * p[1] - f[1] * p[2],
            f[0] * p[2] - f[2] * p[0],
            f[1] * p[0] - f[0] * p[1],
        ];
        [force, torque]
    }
}

impl Whole for Law {
    #[inline(always)]
    fn act<N: Moments>(&self, t_s: N::Each, w: &mut Workspace<N>) {
        for push in &self.pushes {
            let [force, torque] = push.act(t_s, w);
            for a in 0..3 {
                w.free_fall[a] += force[a] * self.per_kg;
                w.body_torque[a] += torque[a];
            }
        }
    }
}

impl Switch for Law {
    fn next_s(&self, after_s: f64) -> f64 {
        let ends = self
            .pushes
            .iter()
            .flat_map(|p| [p.start_s, p.start_s + p.time_s]);
        ends.filter(|t| *t > after_s).fold(f64::INFINITY, f64::min)
    }
}

impl Book for Law {
    #[inline(always)]
    fn power<N: Moments>(
        &self,
        w: &Workspace<N>,
        _pairs: &[Pair<N>],
        first: usize,
    ) -> Power<N::Each> {
        let mut work = N::Each::splat(0.0);
        if first == 0 {
            for push in &self.pushes {
                let [force, torque] = push.act(w.t_s, w);
                for a in 0..3 {
                    work += force[a] * w.velocity[a] + torque[a] * w.spin[a];
                }
            }
        }
        Power {
            work_w: work,
            dissipated_w: N::Each::splat(0.0),
        }
    }
}

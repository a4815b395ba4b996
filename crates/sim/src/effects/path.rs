//! The way the party takes: a slope of the ground, and a turn.
//!
//! ```text
//! g = |g| (−sin s, −sin b cos s, −cos b cos s)                                            (slope)
//! χ(t) = Δχ S((t − t₀)/T),  S(u) = u³(10 − 15u + 6u²) on 0 … 1        ċ = (R_z(χ) − 1) v               (turn)
//! b_i ← c + R_z(χ) b_i        ḃ_i ← ċ + R_z(χ) ḃ_i + χ̇ ẑ × R_z(χ) b_i
//! ```
//! s slope, positive uphill along the walk (rad); b bank, positive where the left side is the higher one (rad); z stays the normal
//! of the ground. χ heading (rad), Δχ turn (left is positive), t₀ beginning, T time it takes (s); v walking velocity,
//! `carriers.walk_m_per_s` [m/s]; c where the party's centre is, against the straight walk (m): two states. Heading, its
//! rate and its curvature are continuous, so nothing jerks; t₀ and t₀ + T are moments the solver meets. Shoulders keep their
//! places in the party, which turns as a whole: the outer carriers walk faster. Frames are not turned: everything
//! stays in axes at rest, and centrifugal forces come out by themselves.
//! A turn takes the load along only through forces sideways: x, y and yaw have to be free, and a hold, friction or a sling there.
//! The slope replaces the direction of `body.gravity_m_per_s2`, not its size. Source: rigid kinematics; S is the quintic of
//! least jerk (Flash & Hogan 1985).

use crate::lanes::Moments;
use crate::model::{AsWhole, Heading, Model, Stage, Switch, Whole, Workspace};
use crate::scene::Scene;
use crate::scene::parts::Freedom;
use crate::scene::problem::{Checker, Problem, problem, shown};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[effects.path]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Path {
    /// s, degrees; positive uphill.
    pub slope_deg: f64,
    /// b, degrees; positive where the left is higher.
    pub bank_deg: f64,
    /// Δχ, degrees; positive to the left.
    pub turn_deg: f64,
    /// t₀, s.
    pub turn_start_s: f64,
    /// T, s.
    pub turn_time_s: f64,
}

impl Default for Path {
    fn default() -> Self {
        Self {
            slope_deg: 0.0,
            bank_deg: 0.0,
            turn_deg: 0.0,
            turn_start_s: 10.0,
            turn_time_s: 10.0,
        }
    }
}

impl Path {
    pub(super) fn check(&self, scene: &Scene) -> Result<(), Problem> {
        for (key, x) in [
            ("effects.path.slope_deg", self.slope_deg),
            ("effects.path.bank_deg", self.bank_deg),
        ] {
            if x.is_nan() || x.abs() >= 60.0 {
                return Err(problem(
                    key,
                    format!(
                        "found {}, expected above -60 and below 60: nobody walks there",
                        shown(x)
                    ),
                ));
            }
        }
        let key = "effects.path.turn_deg";
        Checker::angle_rad(key, self.turn_deg.to_radians())?;
        Checker::not_negative("effects.path.turn_start_s", self.turn_start_s)?;
        Checker::positive("effects.path.turn_time_s", self.turn_time_s)?;
        if self.turn_deg == 0.0 {
            return Ok(());
        }
        let free = [Freedom::X, Freedom::Y, Freedom::Yaw];
        if !free.iter().all(|f| scene.freedom.contains(f)) {
            return Err(problem(
                key,
                "the party would turn away from its load; free x, y and yaw",
            ));
        }
        let held = [
            scene.effects.hold.is_some(),
            scene.effects.friction.is_some(),
            scene.effects.sling.is_some(),
        ];
        if !held.contains(&true) {
            return Err(problem(
                key,
                "the party would turn away from its load, which nothing holds sideways; add `effects.hold`, `friction` or `sling`",
            ));
        }
        Ok(())
    }

    /// Gravity as the sloping ground sees it.
    fn lean(&self, gravity: [f64; 3]) -> [f64; 3] {
        let size = gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
        let (s, b) = (self.slope_deg.to_radians(), self.bank_deg.to_radians());
        [
            -size * s.sin(),
            -size * b.sin() * s.cos(),
            -size * b.cos() * s.cos(),
        ]
    }

    fn heading(&self) -> Heading {
        Heading {
            turn_rad: self.turn_deg.to_radians(),
            start_s: self.turn_start_s,
            time_s: self.turn_time_s,
        }
    }

    pub(super) fn build(&self, scene: &Scene, model: &mut Model) {
        if self.slope_deg != 0.0 || self.bank_deg != 0.0 {
            model.lean(self.lean(scene.body.gravity_m_per_s2));
        }
        if self.turn_deg == 0.0 {
            return;
        }
        let first = model.add_states(["path_x_m", "path_y_m"].map(|name| (name.to_owned(), 0.0)));
        model.add(
            Stage::Party,
            AsWhole(Turn {
                first,
                walk: scene.carriers.walk_m_per_s,
                heading: self.heading(),
            }),
        );
        model.set_heading(self.heading());
        model.add_switch(Ends([
            self.turn_start_s,
            self.turn_start_s + self.turn_time_s,
        ]));
    }
}

#[derive(Debug)]
struct Turn {
    first: usize,
    walk: [f64; 3],
    heading: Heading,
}

impl Whole for Turn {
    #[inline(always)]
    fn act<N: Moments>(&self, t_s: N::Each, w: &mut Workspace<N>) {
        let [x, y, _] = self.walk;
        let [sin, cos, rate, along_x, along_y] = N::look_up([t_s], |[t_s]| {
            let [heading, rate] = self.heading.at(t_s);
            let (sin, cos) = heading.sin_cos();
            let along = [x * (cos - 1.0) - y * sin, x * sin + y * (cos - 1.0)];
            [sin, cos, rate, along[0], along[1]]
        });
        let centre = [w.extra[self.first], w.extra[self.first + 1]].map(N::both);
        let velocity = [along_x, along_y].map(N::both);
        let (sin, cos, rate) = (N::both(sin), N::both(cos), N::both(rate));
        for p in &mut w.pair {
            let ([x, y, _], [vx, vy, _]) = (p.base, p.base_rate);
            let (turned_x, turned_y) = (x * cos - y * sin, x * sin + y * cos);
            p.base[0] = turned_x + centre[0];
            p.base[1] = turned_y + centre[1];
            p.base_rate[0] = vx * cos - vy * sin - turned_y * rate + velocity[0];
            p.base_rate[1] = vx * sin + vy * cos + turned_x * rate + velocity[1];
        }
        w.extra_rate[self.first] = along_x;
        w.extra_rate[self.first + 1] = along_y;
    }
}

/// Where the turn begins and ends.
#[derive(Debug)]
struct Ends([f64; 2]);

impl Switch for Ends {
    fn next_s(&self, after_s: f64) -> f64 {
        self.0
            .into_iter()
            .find(|t| *t > after_s)
            .unwrap_or(f64::INFINITY)
    }
}

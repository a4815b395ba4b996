//! Poles bend: the first bending mode of each pole, driven by the handle forces.
//!
//! ```text
//! s_i = R (p_i + s(x_i) q ẑ)        m q̈ = Σ_i s(x_i) F_i · R ẑ − m ω² q − 2 ζ m ω q̇        s(x) = (3u² − u³)/2,  u = |x|/x_max
//! ```
//! q deflection of the pole's ends against the body's z axis (m): one mode, two states (q, q̇) for each pole; m modal mass (kg);
//! ω = 2πf natural frequency [rad/s]; ζ damping ratio (1); s(x) mode shape, 1 at the farthest handle x_max of the pole and
//! 0 at its middle, where the body is lashed on (1); F_i handle force (N). Handles with the same y belong to one pole.
//! Holds for small q: the mode's own weight and its inertial pull on the body are left out. The pull would raise the frequency at which
//! a free body rings on its pole by 1/√(1 − Γ²/(mM)), Γ = ∫ s dm = 1.59·m for a uniform pole, M the body's mass (kg): 21 % with the defaults
//! under 60 kg. A body that starts at rest starts on bent poles. What is kept comes from the
//! virtual work of the handle forces, so energy balances exactly. q > 0 where the ends are pressed up. A pole whose handles are
//! all at x = 0 does not bend. Source: cantilever deflection under an end load, Timoshenko, *Strength of
//! Materials* I, §39; modal reduction: Meirovitch, *Fundamentals of Vibrations* (2001), ch. 8.

use crate::lanes::{Moments, Number, f64x2, pack};
use crate::model::{AsWhole, Bend, Book, Model, Pair, Power, Stage, Whole, Workspace};
use crate::scene::Scene;
use crate::scene::problem::{Checker, Problem, problem, shown};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[effects.flexure]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Flexure {
    /// f, Hz.
    pub frequency_hz: f64,
    /// ζ, 1.
    pub damping_ratio: f64,
    /// m, kg.
    pub modal_mass_kg: f64,
}

impl Default for Flexure {
    /// A 5 m pole of deodar (9.3 GPa, 560 kg/m³), 12 cm thick: 32 kg of wood, of which 33/140 moves with its ends.
    /// f = 3.516/(2π) √(EI/(μ L⁴)), L half the pole.
    fn default() -> Self {
        Self {
            frequency_hz: 10.9,
            damping_ratio: 0.02,
            modal_mass_kg: 7.5,
        }
    }
}

/// Bent so far, m, heights of 16 digits no longer tell how far a spring is pressed.
const DEEPEST_M: f64 = 1e12;

impl Flexure {
    pub(super) fn check(&self, scene: &Scene) -> Result<(), Problem> {
        Checker::positive("effects.flexure.frequency_hz", self.frequency_hz)?;
        Checker::not_negative("effects.flexure.damping_ratio", self.damping_ratio)?;
        Checker::positive("effects.flexure.modal_mass_kg", self.modal_mass_kg)?;
        // Only a body that begins at rest is hung on its poles first.
        if scene.start.height_m.is_some() || scene.effects.contact.is_none() {
            return Ok(());
        }
        let weight_n = -scene.body.mass_kg * scene.body.gravity_m_per_s2[2];
        let stiffness = scene.carriers.poles().len() as f64 * self.stiffness_n_per_m();
        let bent_m = weight_n / stiffness;
        if bent_m <= DEEPEST_M {
            return Ok(());
        }
        let key = "effects.flexure.frequency_hz";
        Err(problem(
            key,
            format!(
                "poles of {} kg at {} Hz are too soft to rest on: the load would bend them by {bent_m:.0e} m; take stiffer ones, or give start.height_m",
                shown(self.modal_mass_kg),
                shown(self.frequency_hz)
            ),
        ))
    }

    /// m ω², N/m.
    fn stiffness_n_per_m(&self) -> f64 {
        self.modal_mass_kg * (std::f64::consts::TAU * self.frequency_hz).powi(2)
    }

    pub(super) fn build(&self, scene: &Scene, model: &mut Model) {
        let handles = &scene.carriers.handles_m;
        let w = std::f64::consts::TAU * self.frequency_hz;
        let stiffness = self.stiffness_n_per_m();
        let (mut poles, mut bends) = (Vec::new(), Vec::new());
        for (k, pole) in scene.carriers.poles().into_iter().enumerate() {
            let end = pole
                .iter()
                .map(|i| handles[*i][0].abs())
                .fold(0.0, f64::max);
            if end == 0.0 {
                continue;
            }
            let names = [
                format!("pole_{}_m", k + 1),
                format!("pole_{}_m_per_s", k + 1),
            ];
            let first = model.add_states(names.map(|name| (name, 0.0)));
            let mut shape = vec![0.0; handles.len()];
            for i in pole {
                let u = handles[i][0].abs() / end;
                shape[i] = 0.5 * u * u * (3.0 - u);
            }
            poles.push(Pole {
                first,
                shape: pack(shape.iter().copied()),
            });
            bends.push(Bend {
                state: first,
                stiffness_n_per_m: stiffness,
                shape,
            });
        }
        model.set_bends(bends);
        model.look_at_body();
        let law = Bending {
            poles,
            mass: self.modal_mass_kg,
            stiffness,
            damping: 2.0 * self.damping_ratio * self.modal_mass_kg * w,
        };
        model.add(Stage::Bends, AsWhole(Bent(law.clone())));
        model.add(Stage::Body, AsWhole(law.clone()));
        model.add_account("flexure", law);
    }
}

#[derive(Clone, Debug)]
struct Pole {
    /// Its q in the extra states; q̇ follows.
    first: usize,
    shape: Vec<f64x2>,
}

/// Every pole of a scene.
#[derive(Clone, Debug)]
struct Bending {
    poles: Vec<Pole>,
    mass: f64,
    stiffness: f64,
    damping: f64,
}

/// What the deflection does to the handles.
#[derive(Debug)]
struct Bent(Bending);

impl Whole for Bent {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>) {
        let up = w.rotation.map(|row| row[2]);
        let [ux, uy, uz] = up;
        let [wx, wy, wz] = w
            .rotation
            .map(|row| row[0] * w.spin[0] + row[1] * w.spin[1] + row[2] * w.spin[2]);
        // The deflection turns with the body: its rate is q̇ u + q ω × u.
        let swept = [wy * uz - wz * uy, wz * ux - wx * uz, wx * uy - wy * ux];
        for pole in &self.0.poles {
            let (q, rate) = (w.extra[pole.first], w.extra[pole.first + 1]);
            let moved = up.map(|up| N::both(q * up));
            let moving = [0, 1, 2].map(|a| N::both(rate * up[a] + q * swept[a]));
            for (p, shape) in w.pair.iter_mut().zip(&pole.shape) {
                let shape = N::always(*shape);
                for axis in 0..3 {
                    p.arm[axis] += shape * moved[axis];
                    p.gap[axis] -= shape * moved[axis];
                    p.gap_rate[axis] -= shape * moving[axis];
                }
            }
        }
    }
}

/// What the forces do to the deflection.
impl Whole for Bending {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>) {
        let up = w.rotation.map(|row| N::both(row[2]));
        for pole in &self.poles {
            let mut load = N::Pair::splat(0.0);
            for (p, shape) in w.pair.iter().zip(&pole.shape) {
                load += N::always(*shape)
                    * (p.tangential[0] * up[0] + p.tangential[1] * up[1] + p.normal * up[2]);
            }
            let (q, rate) = (w.extra[pole.first], w.extra[pole.first + 1]);
            let left = N::sum(load) - q * self.stiffness - rate * self.damping;
            w.extra_rate[pole.first] = rate;
            w.extra_rate[pole.first + 1] = left / N::Each::splat(self.mass);
        }
    }
}

impl Book for Bending {
    #[inline(always)]
    fn power<N: Moments>(
        &self,
        w: &Workspace<N>,
        _pairs: &[Pair<N>],
        _first: usize,
    ) -> Power<N::Each> {
        let mut rate2 = N::Each::splat(0.0);
        for pole in &self.poles {
            let rate = w.extra[pole.first + 1];
            rate2 += rate * rate;
        }
        Power {
            work_w: N::Each::splat(0.0),
            dissipated_w: rate2 * self.damping,
        }
    }

    fn stored_j(&self, w: &Workspace) -> f64 {
        let of = |p: &Pole| {
            self.stiffness * w.extra[p.first].powi(2) + self.mass * w.extra[p.first + 1].powi(2)
        };
        0.5 * self.poles.iter().map(of).sum::<f64>()
    }
}

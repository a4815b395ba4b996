//! Gait: the shoulders move with the carriers' phases; ritual shake is a harmonic like any other.
//!
//! ```text
//! b_i = b_i0 + Σ_k A_k sin(k φ_i + α_k)        ḃ_i = Σ_k k φ̇_i A_k cos(k φ_i + α_k)
//! ```
//! b_i0 resting shoulder (m); A_k vector amplitude (m) and α_k phase per axis (rad) of harmonic k = 1 … K; φ_i gait
//! phase (rad). Prescribed motion: the load does not push the shoulder back, whatever the force.
//! Source: paper, eq. (base).

use crate::lanes::{Moments, Number, f64x2, pack};
use crate::model::{Local, Model, Pair, Part, Stage, Workspace};
use crate::scene::Scene;
use crate::scene::per_carrier::PerCarrier;
use crate::scene::problem::{Checker, Problem, problem};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[effects.gait]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Gait {
    /// Vertical amplitude of the first harmonic, m.
    pub amplitude_m: PerCarrier,
    /// Sideways (y) amplitude of the first harmonic, m.
    pub sway_m: PerCarrier,
    /// Phase of the sway against the lift, rad.
    pub sway_phase_rad: f64,
    /// Further harmonics and shakes, added to the first.
    pub harmonics: Vec<Harmonic>,
}

/// One more Fourier component of the shoulders' motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Harmonic {
    /// k, a whole number from 1.
    pub order: u32,
    /// A_k: x, y, z, m.
    pub amplitude_m: [f64; 3],
    /// α_k: x, y, z, rad.
    #[serde(default)]
    pub phase_rad: [f64; 3],
    /// Which carriers make it (numbers from 0); all where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub carriers: Option<Vec<usize>>,
}

/// Beyond this order a shoulder would move at hundreds of hertz.
const HIGHEST_ORDER: u32 = 64;

impl Default for Gait {
    fn default() -> Self {
        Self {
            amplitude_m: 0.06.into(),
            sway_m: 0.0.into(),
            sway_phase_rad: 0.0,
            harmonics: Vec::new(),
        }
    }
}

impl Gait {
    pub(super) fn check(&self, scene: &Scene) -> Result<(), Problem> {
        let n = scene.carriers.count();
        Checker::per_carrier("effects.gait.amplitude_m", &self.amplitude_m, n)?;
        Checker::per_carrier("effects.gait.sway_m", &self.sway_m, n)?;
        Checker::finite("effects.gait.sway_phase_rad", self.sway_phase_rad)?;
        for (k, h) in self.harmonics.iter().enumerate() {
            let key = |name: &str| format!("effects.gait.harmonics.{k}.{name}");
            Checker::all_finite(&key("amplitude_m"), &h.amplitude_m)?;
            Checker::all_finite(&key("phase_rad"), &h.phase_rad)?;
            if !(1..=HIGHEST_ORDER).contains(&h.order) {
                return Err(problem(
                    &key("order"),
                    format!("found {}, expected 1 to {HIGHEST_ORDER}", h.order),
                ));
            }
            if let Some(i) = h.carriers.iter().flatten().find(|&&i| i >= n) {
                return Err(problem(
                    &key("carriers"),
                    format!("found carrier {i}, but there are {n}, numbered from 0"),
                ));
            }
        }
        Ok(())
    }

    pub(super) fn build(&self, scene: &Scene, model: &mut Model) {
        let n = scene.carriers.count();
        model.need_phases();
        let mut waves = Vec::new();
        let mut add = |axis: usize, order: u32, amplitude: Vec<f64>, phase: f64| {
            if amplitude.iter().any(|a| *a != 0.0) {
                let part = |f: f64| pack(amplitude.iter().map(|a| a * f));
                waves.push(Wave {
                    axis,
                    order,
                    parts: part(phase.cos())
                        .into_iter()
                        .zip(part(phase.sin()))
                        .collect(),
                });
            }
        };
        let each = |x: &PerCarrier| (0..n).map(|i| x.get(i)).collect::<Vec<f64>>();
        add(2, 1, each(&self.amplitude_m), 0.0);
        add(1, 1, each(&self.sway_m), self.sway_phase_rad);
        for h in &self.harmonics {
            let who = |i: usize| h.carriers.as_ref().is_none_or(|list| list.contains(&i));
            for axis in 0..3 {
                let amplitude = (0..n)
                    .map(|i| if who(i) { h.amplitude_m[axis] } else { 0.0 })
                    .collect();
                add(axis, h.order, amplitude, h.phase_rad[axis]);
            }
        }
        let (first, higher): (Vec<Wave>, Vec<Wave>) = waves.into_iter().partition(|w| w.order == 1);
        model.add(Stage::Shoulders, First(first));
        if !higher.is_empty() {
            model.add(Stage::Shoulders, Higher(higher));
        }
    }
}

/// A sin(kφ + α) = `parts.0` sin kφ + `parts.1` cos kφ, for all carriers, along one axis.
#[derive(Debug)]
struct Wave {
    axis: usize,
    order: u32,
    parts: Vec<(f64x2, f64x2)>,
}

impl Wave {
    /// `turn` gives sin kφ, cos kφ and kφ̇.
    #[inline(always)]
    fn add<N: Moments>(
        &self,
        w: &mut Workspace<N>,
        part: &impl Part,
        turn: impl Fn(&Pair<N>) -> [N::Pair; 3],
    ) {
        // Never more than 2: so the compiler knows, too.
        let axis = self.axis.min(2);
        for (p, &(sine, cosine)) in part
            .of_mut(&mut w.pair)
            .iter_mut()
            .zip(part.of(&self.parts))
        {
            let [sin, cos, rate] = turn(p);
            let (sine, cosine) = (N::always(sine), N::always(cosine));
            p.base[axis] = sine.madd(sin, cosine.madd(cos, p.base[axis]));
            let slope = cosine.nmadd(sin, sine * cos);
            p.base_rate[axis] = rate.madd(slope, p.base_rate[axis]);
        }
    }
}

#[derive(Debug)]
struct First(Vec<Wave>);

impl Local for First {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>, part: impl Part) {
        for wave in &self.0 {
            wave.add(w, &part, |p| [p.sin, p.cos, p.rate]);
        }
    }
}

#[derive(Debug)]
struct Higher(Vec<Wave>);

impl Local for Higher {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>, part: impl Part) {
        for wave in &self.0 {
            // sin and cos of kφ by repeated addition of φ: k − 1 complex products, error of the order of kε.
            wave.add(w, &part, |p| {
                let (mut s, mut c) = (p.sin, p.cos);
                for _ in 1..wave.order {
                    (s, c) = (s.madd(p.cos, c * p.sin), s.nmadd(p.sin, c * p.cos));
                }
                [s, c, p.rate * f64::from(wave.order)]
            });
        }
    }
}

//! Kuramoto coupling: carriers adjust to each other.
//!
//! ```text
//! φ̇_i += (K_c/N) Σ_j sin(φ_j − φ_i) = K_c (S cos φ_i − C sin φ_i),   S = (1/N) Σ sin φ_j,  C = (1/N) Σ cos φ_j
//! ```
//! On a graph: φ̇_i += K_c/(d_i + 1) Σ_{j next to i} sin(φ_j − φ_i), d_i the number of neighbours (1); where everybody is next to
//! everybody that is the sum above. `chain` joins neighbours along each pole (handles with the same y, in the order of x).
//!
//! K_c strength [rad/s]; φ phases (rad). The mean-field form is the same sum in O(N); a graph costs O(edges). For N = 2, δ = φ₂ − φ₁ locks where
//! |Δω| < K_c, at sin δ* = Δω/K_c. Source: paper, eq. (kuramoto); Kuramoto (1975), Strogatz (2000).

use crate::lanes::{LANES, Moments, Number};
use crate::model::{AsWhole, Model, Stage, Whole, Workspace};
use crate::scene::Scene;
use crate::scene::parts::Carriers;
use crate::scene::problem::{Checker, Problem, problem};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;

/// `[effects.coupling]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Coupling {
    /// K_c, rad/s. Measured in the paper's baseline logs: 0.001 ± 0.003, that is none.
    pub strength_rad_per_s: f64,
    /// Who minds whom.
    pub graph: Graph,
}

/// Who minds whom.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Graph {
    /// Everybody minds everybody: the mean field.
    #[default]
    All,
    /// Neighbours along each pole mind each other.
    Chain,
    /// Pairs of carriers (numbers from 0) that mind each other.
    Edges(Vec<[usize; 2]>),
}

impl Graph {
    /// The pairs, each once; `None` for all-to-all.
    pub fn pairs(&self, carriers: &Carriers) -> Option<Vec<[usize; 2]>> {
        match self {
            Self::All => None,
            Self::Edges(list) => Some(list.clone()),
            Self::Chain => {
                let poles = carriers.poles();
                let along = |pole: &Vec<usize>| -> Vec<[usize; 2]> {
                    pole.windows(2).map(|w| [w[0], w[1]]).collect()
                };
                Some(poles.iter().flat_map(along).collect())
            }
        }
    }
}

impl Default for Coupling {
    fn default() -> Self {
        Self {
            strength_rad_per_s: 0.5,
            graph: Graph::All,
        }
    }
}

impl Coupling {
    pub(super) fn check(&self, scene: &Scene) -> Result<(), Problem> {
        Checker::finite(
            "effects.coupling.strength_rad_per_s",
            self.strength_rad_per_s,
        )?;
        let (key, n) = ("effects.coupling.graph", scene.carriers.count());
        if let Graph::Edges(list) = &self.graph {
            let mut seen = HashSet::new();
            for [a, b] in list {
                if a == b {
                    return Err(problem(
                        key,
                        format!("found the pair [{a}, {b}], expected two different carriers"),
                    ));
                }
                if let Some(i) = [a, b].into_iter().find(|&&i| i >= n) {
                    return Err(problem(
                        key,
                        format!("found carrier {i}, but there are {n}, numbered from 0"),
                    ));
                }
                if !seen.insert([a.min(b), a.max(b)]) {
                    return Err(problem(
                        key,
                        format!("the pair [{a}, {b}] stands there twice"),
                    ));
                }
            }
        }
        Ok(())
    }

    pub(super) fn build(&self, scene: &Scene, model: &mut Model) {
        model.need_phases();
        let n = scene.carriers.count();
        match self.graph.pairs(&scene.carriers) {
            None => model.add(
                Stage::Phases,
                AsWhole(MeanField {
                    gain: self.strength_rad_per_s / n as f64,
                    padding: (n % LANES) as f64,
                }),
            ),
            Some(edges) => {
                let mut gain = vec![1.0; n];
                edges.iter().flatten().for_each(|&i| gain[i] += 1.0);
                gain.iter_mut()
                    .for_each(|g| *g = self.strength_rad_per_s / *g);
                model.add(Stage::Phases, AsWhole(Network { edges, gain }));
            }
        }
    }
}

#[derive(Debug)]
struct Network {
    edges: Vec<[usize; 2]>,
    /// K_c/(d_i + 1)
    gain: Vec<f64>,
}

impl Whole for Network {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>) {
        for &[a, b] in &self.edges {
            // sin(φ_b − φ_a) from the sines and cosines that are there already.
            let pull =
                w.of(b, |p| p.sin) * w.of(a, |p| p.cos) - w.of(b, |p| p.cos) * w.of(a, |p| p.sin);
            let (to_a, to_b) = (
                w.of(a, |p| p.rate) + pull * self.gain[a],
                w.of(b, |p| p.rate) - pull * self.gain[b],
            );
            w.set(a, |p| &mut p.rate, to_a);
            w.set(b, |p| &mut p.rate, to_b);
        }
    }
}

#[derive(Debug)]
struct MeanField {
    gain: f64,
    /// Carriers that only fill the last pair; their phase is 0, their cosine 1.
    padding: f64,
}

impl Whole for MeanField {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>) {
        let (mut s, mut c) = (N::Pair::splat(0.0), N::Pair::splat(0.0));
        for p in &w.pair {
            s += p.sin;
            c += p.cos;
        }
        let s = N::both(N::sum(s) * self.gain);
        let c = N::both((N::sum(c) + -self.padding) * self.gain);
        for p in &mut w.pair {
            p.rate = p.sin.nmadd(c, p.cos.madd(s, p.rate));
        }
    }
}

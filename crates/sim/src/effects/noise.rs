//! Phase noise: gait phases wander like Brownian paths.
//!
//! ```text
//! dφ_i = … + σ dW_i,   W_i(t) piecewise linear on the grid t_j = j·h, with independent increments √h z_ij,  z standard normal
//! ```
//! σ strength [rad/√s]; h = 1/grid_hz (s). On multiples of h the path is an exact Brownian path; between them it is straight, so
//! the phases have a constant extra rate σ z_ij/√h and the equations stay smooth: every grid point is an event that the
//! solver meets exactly. The path is a function of (seed, carrier, time): a smaller step converges to the same motion.
//! Source: the archive's logs (white, 0.0100 rad/√s at every lag from 0.033 s to 10 s).

use crate::model::{Model, Switch, Workspace};
use crate::random::{Stream, normal_pair};
use crate::scene::Scene;
use crate::scene::problem::{Checker, MOST_SAMPLES, Problem, larger, problem, shown};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[effects.noise]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Noise {
    /// σ, rad/√s. Measured in the paper's logs: 0.0100.
    pub phase_rad_per_sqrt_s: f64,
    /// 1/h, Hz. A grid that the log times share costs least.
    pub grid_hz: f64,
}

impl Default for Noise {
    fn default() -> Self {
        Self {
            phase_rad_per_sqrt_s: 0.01,
            grid_hz: 30.0,
        }
    }
}

impl Noise {
    pub(super) fn check(&self, scene: &Scene) -> Result<(), Problem> {
        Checker::not_negative(
            "effects.noise.phase_rad_per_sqrt_s",
            self.phase_rad_per_sqrt_s,
        )?;
        let key = "effects.noise.grid_hz";
        Checker::positive(key, self.grid_hz)?;
        if self.grid_hz * scene.duration_s > MOST_SAMPLES {
            let times = self.grid_hz / Self::default().grid_hz;
            return Err(problem(
                larger(scene.duration_s, key, times),
                format!(
                    "{} Hz for {} s are more than {MOST_SAMPLES:e} cells of noise; a gait cannot tell a grid of some hundred hertz from a finer one",
                    shown(self.grid_hz),
                    shown(scene.duration_s)
                ),
            ));
        }
        Ok(())
    }

    pub(super) fn build(&self, scene: &Scene, model: &mut Model) {
        model.need_phases();
        model.add_switch(Grid {
            seed: scene.seed,
            carriers: scene.carriers.count(),
            grid_hz: self.grid_hz,
            rate: self.phase_rad_per_sqrt_s * self.grid_hz.sqrt(),
        });
    }
}

#[derive(Debug)]
struct Grid {
    seed: u64,
    carriers: usize,
    grid_hz: f64,
    rate: f64,
}

impl Grid {
    /// The cell that begins at or before `t_s`; a time that is a grid point but for rounding belongs to the cell it begins.
    fn cell(&self, t_s: f64) -> u64 {
        // As `round` for what is not negative, without a call; signed, for which the processor has an instruction.
        let nearest = (t_s * self.grid_hz + 0.5) as i64 as f64;
        let cell = if nearest / self.grid_hz <= t_s {
            nearest
        } else {
            nearest - 1.0
        };
        // OK because times are never negative and the number of cells is far below 2^53.
        cell.max(0.0) as i64 as u64
    }
}

impl Switch for Grid {
    fn next_s(&self, after_s: f64) -> f64 {
        (self.cell(after_s) as i64 + 1) as f64 / self.grid_hz
    }

    fn begin(&self, t_s: f64, w: &mut Workspace) {
        let cell = self.cell(t_s);
        for first in (0..self.carriers).step_by(2) {
            let draws = normal_pair(self.seed, Stream::PhaseNoise, (first / 2) as u32, cell);
            for (i, z) in (first..self.carriers.min(first + 2)).zip(draws) {
                *w.of_mut(i, |p| &mut p.constant_rate) += z * self.rate;
            }
        }
    }
}

//! Musical entrainment: every carrier is pulled towards the beat.
//!
//! ```text
//! φ̇_i += K_m(t) sin(ψ − φ_i)        ψ = ψ₀ + 2π f_m t        K_m(t) = K (1 − e^{−(t − t₀)/τ})  for t ≥ t₀,  0 before
//! ```
//! K strength [rad/s]; f_m beat [Hz]; ψ₀ beat phase at t = 0 [rad]; t₀ onset [s]; τ build-up [s], where 0 means K from t₀
//! on. One carrier locks where |2πf_m − ω| < K, at sin(ψ − φ) = (2πf_m − ω)/K; outside it drifts at √(Δω² − K²).
//! At t₀ with τ = 0 the phase rates jump: an event. Source: paper, eqs. (music), (adler); Adler (1946).

use crate::lanes::{f64x2, sin_cos};
use crate::model::{Beat, Model, Stage, Switch, Term, Workspace};
use crate::scene::{Checker, Problem, Scene};
use serde::{Deserialize, Serialize};

/// `[effects.music]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Music {
    /// f_m, Hz. Measured in the paper's logs: 2.1507.
    pub beat_hz: f64,
    /// K, rad/s. Measured: 2.7.
    pub strength_rad_per_s: f64,
    /// t₀, s. Measured: 5.
    pub onset_s: f64,
    /// τ, s. Measured: 11.
    pub build_up_s: f64,
    /// ψ₀, rad.
    pub beat_phase_rad: f64,
}

impl Default for Music {
    fn default() -> Self {
        Self { beat_hz: 2.1507, strength_rad_per_s: 2.7, onset_s: 5.0, build_up_s: 11.0, beat_phase_rad: 0.0 }
    }
}

impl Music {
    pub(super) fn check(&self, _scene: &Scene) -> Result<(), Problem> {
        Checker::not_negative("effects.music.beat_hz", self.beat_hz)?;
        Checker::finite("effects.music.strength_rad_per_s", self.strength_rad_per_s)?;
        Checker::not_negative("effects.music.onset_s", self.onset_s)?;
        Checker::not_negative("effects.music.build_up_s", self.build_up_s)?;
        Checker::finite("effects.music.beat_phase_rad", self.beat_phase_rad)
    }

    pub(super) fn build(&self, _scene: &Scene, model: &mut Model) {
        model.need_phases();
        let beat = Beat {
            onset_s: self.onset_s,
            rate_rad_per_s: std::f64::consts::TAU * self.beat_hz,
            phase_rad: self.beat_phase_rad,
        };
        let strength = self.strength_rad_per_s;
        model.set_beat(beat);
        if self.build_up_s == 0.0 {
            model.add(Stage::Phases, Constant { beat, strength });
        } else {
            model.add(Stage::Phases, Growing { beat, strength, per_s: 1.0 / self.build_up_s });
        }
        if self.onset_s > 0.0 {
            model.add_switch(Onset(self.onset_s));
        }
    }
}

#[inline(always)]
fn pull(w: &mut Workspace, beat: &Beat, t_s: f64, strength: f64) {
    // sin(ψ − φ) from the sines and cosines that are there already.
    let (sin, cos) = sin_cos(f64x2::splat(beat.phase_at(t_s)));
    let (sin, cos) = (sin * strength, cos * strength);
    for p in &mut w.pair {
        p.rate += p.cos * sin - p.sin * cos;
    }
}

#[derive(Debug)]
struct Constant {
    beat: Beat,
    strength: f64,
}

impl Term for Constant {
    fn apply(&self, t_s: f64, w: &mut Workspace) {
        // `segment_s` decides, not t: the last stage of the step that ends at the onset still hears nothing.
        if w.segment_s >= self.beat.onset_s {
            pull(w, &self.beat, t_s, self.strength);
        }
    }
}

#[derive(Debug)]
struct Growing {
    beat: Beat,
    strength: f64,
    per_s: f64,
}

impl Term for Growing {
    fn apply(&self, t_s: f64, w: &mut Workspace) {
        if w.segment_s >= self.beat.onset_s {
            let strength = self.strength * -(-(t_s - self.beat.onset_s) * self.per_s).exp_m1();
            pull(w, &self.beat, t_s, strength);
        }
    }
}

#[derive(Debug)]
struct Onset(f64);

impl Switch for Onset {
    fn next_s(&self, after_s: f64) -> f64 {
        if after_s < self.0 { self.0 } else { f64::INFINITY }
    }
}

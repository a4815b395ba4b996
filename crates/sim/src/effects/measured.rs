//! Carriers who move as somebody measured: phases, or the shoulders themselves, instead of what the other effects would give.
//!
//! ```text
//! φ_i(0) = s_i(0),  φ̇_i = ṡ_i(t)            phases: replaces natural frequencies, coupling, music, noise and feedback
//! b_i = s_i(t),     ḃ_i = ṡ_i(t)            shoulders: replaces gait and lift too
//! ```
//! s_i cubic spline through the measured samples of carrier i (rad, or m in the party's frame: what `carriers.walk_m_per_s` adds is
//! taken out). Samples are moments that the solver meets, so that each of its steps lies within one cubic. The scene may not run
//! past the samples. `sim replay` writes this table from a recording. Source: the spline's own, `spline.rs`.

use crate::lanes::Moments;
use crate::model::{AsWhole, Model, Stage, Switch, Whole, Workspace};
use crate::scene::Scene;
use crate::scene::problem::{Checker, Problem, problem};
use crate::spline::Spline;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[effects.measured]`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Measured {
    /// When it was measured, s.
    pub t_s: Vec<f64>,
    /// Phase of each carrier at those times, rad, unwrapped.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub phase_rad: Vec<Vec<f64>>,
    /// Shoulder of each carrier at those times, x, y, z, m.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub shoulder_m: Vec<Vec<[f64; 3]>>,
}

impl Measured {
    pub(super) fn check(&self, scene: &Scene) -> Result<(), Problem> {
        let n = scene.carriers.count();
        let (key, t) = ("effects.measured.t_s", &self.t_s);
        Checker::all_finite(key, t)?;
        if t.len() < Spline::LEAST || t.windows(2).any(|w| w[1] <= w[0]) {
            return Err(problem(
                key,
                format!(
                    "found {} times, expected {} or more that ascend",
                    t.len(),
                    Spline::LEAST
                ),
            ));
        }
        let (first, last) = (t[0], t[t.len() - 1]);
        // A hair of rounding is no gap.
        if first > 1e-9 || last < scene.duration_s - 1e-9 {
            return Err(problem(
                key,
                format!(
                    "found {first} to {last} s, but the scene runs from 0 to {} s",
                    scene.duration_s
                ),
            ));
        }
        let counts = |key: &str, lengths: Vec<usize>| {
            if lengths.is_empty() || (lengths.len() == n && lengths.iter().all(|l| *l == t.len())) {
                return Ok(());
            }
            Err(problem(
                key,
                format!(
                    "found {} carriers with {lengths:?} samples, expected {n} with {} each",
                    lengths.len(),
                    t.len()
                ),
            ))
        };
        let (phases, shoulders) = ("effects.measured.phase_rad", "effects.measured.shoulder_m");
        counts(phases, self.phase_rad.iter().map(Vec::len).collect())?;
        counts(shoulders, self.shoulder_m.iter().map(Vec::len).collect())?;
        for list in &self.phase_rad {
            Checker::all_finite(phases, list)?;
        }
        for place in self.shoulder_m.iter().flatten() {
            Checker::all_finite(shoulders, place)?;
        }
        match (self.phase_rad.is_empty(), self.shoulder_m.is_empty()) {
            (true, true) => Err(problem(
                "effects.measured",
                "there is neither phase_rad nor shoulder_m",
            )),
            (_, false)
                if scene
                    .effects
                    .path
                    .as_ref()
                    .is_some_and(|p| p.turn_deg != 0.0) =>
            {
                Err(problem(
                    shoulders,
                    "measured shoulders turn by themselves: take `effects.path.turn_deg` away",
                ))
            }
            _ => Ok(()),
        }
    }

    pub(super) fn build(&self, _scene: &Scene, model: &mut Model) {
        let spline = |x: &[f64]| Spline::new(&self.t_s, x).expect("a checked measurement");
        if !self.phase_rad.is_empty() {
            model.need_phases();
            let phases: Vec<Spline> = self.phase_rad.iter().map(|x| spline(x)).collect();
            model.set_phases_at_start(phases.iter().map(|s| s.at(0.0)[0]).collect());
            model.add(Stage::Phases, AsWhole(Phases(phases)));
        }
        if !self.shoulder_m.is_empty() {
            let axes = |places: &Vec<[f64; 3]>| {
                [0, 1, 2].map(|a| spline(&places.iter().map(|p| p[a]).collect::<Vec<_>>()))
            };
            model.add(
                Stage::Party,
                AsWhole(Shoulders(self.shoulder_m.iter().map(axes).collect())),
            );
        }
        model.add_switch(Samples(self.t_s.clone()));
    }
}

/// The last word on the phases' rates.
#[derive(Debug)]
struct Phases(Vec<Spline>);

impl Whole for Phases {
    #[inline(always)]
    fn act<N: Moments>(&self, t_s: N::Each, w: &mut Workspace<N>) {
        let piece = piece(&self.0[0], w);
        for (i, spline) in self.0.iter().enumerate() {
            let [_, rate] = at::<N>(spline, piece, t_s);
            w.set(i, |p| &mut p.rate, rate);
        }
    }
}

#[derive(Debug)]
struct Shoulders(Vec<[Spline; 3]>);

impl Whole for Shoulders {
    #[inline(always)]
    fn act<N: Moments>(&self, t_s: N::Each, w: &mut Workspace<N>) {
        let piece = piece(&self.0[0][0], w);
        for (i, axes) in self.0.iter().enumerate() {
            for (a, spline) in axes.iter().enumerate() {
                let [place, rate] = at::<N>(spline, piece, t_s);
                w.set(i, |p| &mut p.base[a], place);
                w.set(i, |p| &mut p.base_rate[a], rate);
            }
        }
    }
}

/// The number of the cubic: the segment decides, as a step's last stage lies on the seam.
#[inline(always)]
fn piece<N: Moments>(spline: &Spline, w: &Workspace<N>) -> N::Each {
    let [piece] = N::look_up(
        [w.segment_s],
        |[segment_s]| [spline.piece(segment_s) as f64],
    );
    piece
}

/// Value and slope of a piece.
#[inline(always)]
fn at<N: Moments>(spline: &Spline, piece: N::Each, t_s: N::Each) -> [N::Each; 2] {
    N::look_up([piece, t_s], |[piece, t_s]| {
        spline.of_piece(piece as usize, t_s)
    })
}

/// A cubic ends at each sample.
#[derive(Debug)]
struct Samples(Vec<f64>);

impl Switch for Samples {
    fn next_s(&self, after_s: f64) -> f64 {
        self.0
            .get(self.0.partition_point(|t| *t <= after_s))
            .copied()
            .unwrap_or(f64::INFINITY)
    }
}

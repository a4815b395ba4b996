//! The stages of one step, all eight side by side.

use super::modes::{Mode, WATCHED};
use super::tableau::{C, TABLEAU, with_start};
use crate::freedoms::turn;
use crate::lanes::{Eight, MOMENTS, Moments, Number, Two, f64x2};
use crate::model::{Model, Registers, Workspace};
use nalgebra::Complex;
use std::ops::Range;

/// After so many sweeps an iteration that has not ended will not.
const MOST_SWEEPS: u32 = 16;
/// From this sweep on the stages are near enough to see that a step is far too long.
const TELLING: u32 = 3;
/// An error estimate so many times the tolerance will not fall below it by further sweeps.
const HOPELESS: f64 = 20.0;
/// A mode that a step hardly moves is left to the sweeps.
const SLIGHT: f64 = 0.08;

/// A matrix by columns.
type Columns<E> = [E; MOMENTS];

/// Where the iteration begins.
pub enum Guess<'a> {
    /// The slope at the start, and how fast it changes.
    Slope(&'a [f64], &'a [f64]),
    /// This part of the step solved last, which began at the same state.
    Part(f64),
}

/// What is known of a step that was solved.
#[derive(Clone, Copy, Debug)]
pub struct Solved {
    /// How often the right-hand side was evaluated at all stages.
    pub sweeps: u32,
    /// The error at its end, in units of the tolerance.
    pub error: f64,
    /// The error between the stages, in the same units.
    pub between: f64,
    /// Whether the iteration converged; where not, the step is too long.
    pub converged: bool,
}

/// How exactly a step is solved.
#[derive(Clone, Copy, Debug)]
pub struct Demand {
    /// What the step may err, in units of the states.
    pub tolerance: f64,
    /// What the iteration may leave.
    pub iteration: f64,
}

/// Stages of a step and what they are computed with.
pub struct Stages<E: Registers> {
    pub w: Workspace<Eight<E>>,
    /// States at the nodes.
    pub y: Vec<E>,
    /// Slopes at the nodes.
    pub f: Vec<E>,
    /// What half a unit and more of each state counts: 1/unit.
    pub scale: Vec<f64>,
    /// Where the body's velocities are; its positions come before them.
    velocities: Range<usize>,
    /// Whether the attitude is a quaternion, in which case the body has all thirteen states.
    quaternion: bool,
    a: Columns<E>,
    legendre: Columns<E>,
    nodes: E,
    solvers: Vec<(Mode, Columns<E>)>,
    watch: Vec<(Two<E>, Two<E>)>,
    margin: E,
}

#[inline(always)]
fn columns<E: Registers>(m: &[[f64; MOMENTS]; MOMENTS]) -> Columns<E> {
    std::array::from_fn(|j| E::load(&m[j]))
}

/// Σ_j column_j x_j, in two chains.
#[inline(always)]
fn product<E: Registers>(m: &Columns<E>, x: &E) -> E {
    let x = x.as_array();
    let mut even = m[0] * E::splat(x[0]);
    let mut odd = m[1] * E::splat(x[1]);
    for j in (2..MOMENTS).step_by(2) {
        even = m[j].madd(E::splat(x[j]), even);
        odd = m[j + 1].madd(E::splat(x[j + 1]), odd);
    }
    even + odd
}

impl<E: Registers> Stages<E> {
    /// For a model's states.
    #[inline(always)]
    pub fn new(model: &Model) -> Self {
        let size = model.layout().size();
        let zero = E::splat(0.0);
        Self {
            w: Workspace {
                segment_s: 0.0,
                pair: Vec::new(),
                rotation: [[zero; 3]; 3],
                spin: [zero; 3],
                least_load_n: 0.0,
                body_torque: [zero; 3],
                extra: Vec::new(),
                extra_rate: Vec::new(),
            },
            y: vec![zero; size],
            f: vec![zero; size],
            scale: vec![0.0; size],
            velocities: model.freedoms().positions()..model.layout().body,
            quaternion: model.freedoms().rotation().is_some(),
            a: columns(&TABLEAU.a),
            legendre: columns(&TABLEAU.legendre),
            nodes: E::load(&C),
            solvers: Vec::new(),
            watch: Vec::new(),
            margin: zero,
        }
    }

    /// What undoes h d A + h² κ A² of a mode: (1 + h d A + h² κ A²)⁻¹ − 1, from the eigenvalues of A.
    #[inline(always)]
    fn prepare(&mut self, modes: &[Mode], h: f64) {
        self.solvers.clear();
        for mode in modes {
            let (d, k) = (h * mode.damping_per_s, h * h * mode.stiffness_per_s2);
            if d + k < SLIGHT {
                continue;
            }
            let mut matrix = [E::splat(0.0); MOMENTS];
            for (value, parts) in &TABLEAU.parts {
                let factor = (value * d + value * value * k + 1.0).inv() - Complex::new(1.0, 0.0);
                let (re, im) = (E::splat(factor.re), E::splat(-factor.im));
                for (j, out) in matrix.iter_mut().enumerate() {
                    *out = re.madd(E::load(&parts[0][j]), *out);
                    *out = im.madd(E::load(&parts[1][j]), *out);
                }
            }
            self.solvers.push((*mode, matrix));
        }
    }

    /// Puts the stages where the iteration begins.
    #[inline(always)]
    fn guess(&mut self, y0: &[f64], h: f64, guess: &Guess<'_>) {
        match guess {
            Guess::Slope(slope, bend) => {
                let t = self.nodes * h;
                let half = t * t * 0.5;
                for (d, y) in self.y.iter_mut().enumerate() {
                    let straight = t.madd(E::splat(slope[d]), E::splat(y0[d]));
                    *y = half.madd(E::splat(bend[d]), straight);
                }
            }
            &Guess::Part(part) => {
                let weights: [[f64; MOMENTS + 1]; MOMENTS] = C.map(|c| weights(c * part));
                let start = E::load(&weights.map(|w| w[0]));
                let rest: Columns<E> = std::array::from_fn(|j| E::load(&weights.map(|w| w[j + 1])));
                for (y, y0) in self.y.iter_mut().zip(y0) {
                    *y = start.madd(E::splat(*y0), product(&rest, y));
                }
            }
        }
    }

    /// Solves a step of size h from y0 at t0.
    #[inline(always)]
    pub fn solve_here(
        &mut self,
        model: &Model,
        (t0, y0): (f64, &[f64]),
        h: f64,
        guess: &Guess<'_>,
        modes: &[Mode],
        demand: Demand,
    ) -> Solved {
        let ledger = model.layout().ledger_range();
        let watched = ledger.start;
        self.prepare(modes, h);
        self.guess(y0, h, guess);
        let t = self.nodes.madd(E::splat(h), E::splat(t0));
        let (mut sweeps, mut last) = (0, f64::INFINITY);
        // Squares, of sums over all states.
        let enough = demand.iteration * demand.iteration * watched as f64;
        let mut converged = false;
        loop {
            // The only call: at two places it is not inlined, nor are the registers' operations then.
            model.motion_at_eight(t, &self.y, &mut self.f, &mut self.w);
            sweeps += 1;
            // Nothing feeds the ledger's errors back to the motion, so no sweep takes them away: it is booked at the stages as they are.
            if converged {
                break;
            }
            let change = self.sweep(y0, h, watched);
            // What a first sweep leaves is not known before the second.
            let rate = if last.is_finite() {
                (change / last).min(0.8)
            } else {
                0.8
            };
            converged = change * rate <= enough;
            let telling =
                sweeps == TELLING && self.errors(watched, h, demand.tolerance).0 > HOPELESS;
            if telling || !change.is_finite() || sweeps >= MOST_SWEEPS {
                converged |= telling;
                break;
            }
            if converged && ledger.is_empty() {
                break;
            }
            last = change;
        }
        let mut nearest = E::splat(f64::NEG_INFINITY);
        for (p, (factor, summand)) in self.w.pair.iter().zip(&self.watch) {
            let passed = p.unclamped.madd(*factor, *summand);
            nearest = nearest.larger(passed.0[0].larger(passed.0[1]));
        }
        self.margin = -nearest;
        model.powers_at_eight(&mut self.f, &self.w);
        for d in ledger {
            self.y[d] = product(&self.a, &self.f[d]).madd(E::splat(h), E::splat(y0[d]));
        }
        let (error, between) = self.errors(self.y.len(), h, demand.tolerance);
        Solved {
            sweeps,
            error,
            between,
            converged,
        }
    }

    /// New stages from the slopes at the old ones. The largest sum of squares, over the states, of what they moved by, in units.
    #[inline(always)]
    fn sweep(&mut self, y0: &[f64], h: f64, watched: usize) -> f64 {
        let step = E::splat(h);
        let (y, f) = (&mut self.y[..watched], &mut self.f[..watched]);
        let (y0, scale) = (&y0[..watched], &self.scale[..watched]);
        let mut moved = E::splat(0.0);
        let (from, body) = (self.velocities.start, self.velocities.end);
        let mut by = [E::splat(0.0); WATCHED];
        for (d, by) in (from..body).zip(&mut by) {
            *by = product(&self.a, &f[d]).madd(step, E::splat(y0[d])) - y[d];
        }
        let residual = by;
        for (mode, matrix) in &self.solvers {
            let mut along = residual[0] * mode.from[0];
            for a in 1..WATCHED {
                along = residual[a].madd(E::splat(mode.from[a]), along);
            }
            let further = product(matrix, &along);
            for (by, &to) in by.iter_mut().zip(&mode.to) {
                *by = further.madd(E::splat(to), *by);
            }
        }
        for (d, by) in (from..body).zip(by) {
            y[d] += by;
            let part = by * scale[d];
            moved = part.madd(part, moved);
        }
        for d in body..watched {
            let by = product(&self.a, &f[d]).madd(step, E::splat(y0[d])) - y[d];
            y[d] += by;
            let part = by * scale[d];
            moved = part.madd(part, moved);
        }
        // Positions follow from the new velocities.
        if self.quaternion {
            f[..3].copy_from_slice(&y[7..10]);
            let turned = turn([y[3], y[4], y[5], y[6]], [y[10], y[11], y[12]]);
            f[3..7].copy_from_slice(&turned);
        } else {
            f[..from].copy_from_slice(&y[from..body]);
        }
        for d in 0..from {
            let new = product(&self.a, &f[d]).madd(step, E::splat(y0[d]));
            let part = (new - y[d]) * scale[d];
            y[d] = new;
            moved = part.madd(part, moved);
        }
        let m = moved.as_array();
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        // A comparison loses what is not a number, a sum does not.
        let total: f64 = m.iter().sum();
        if total.is_finite() {
            larger(
                larger(larger(m[0], m[1]), larger(m[2], m[3])),
                larger(larger(m[4], m[5]), larger(m[6], m[7])),
            )
        } else {
            f64::NAN
        }
    }

    /// Errors at the end of the step and between the stages, in units of the tolerance, from the last Legendre coefficients of the slopes.
    ///
    /// The coefficients of a smooth slope fall like ρ^-k: e₅ and e₇ are those of degrees 4, 5 and 6, 7, times h. The polynomial of the stages
    /// leaves out the next, e₇ (e₇/e₅), whose integrals are less than 1/17 of them. At the end of the step Radau's nodes integrate to
    /// degree 14, as far beyond again; half of that is claimed: e₇ (e₇/e₅)², of order 12.
    #[inline(always)]
    fn errors(&self, states: usize, h: f64, tolerance: f64) -> (f64, f64) {
        let mut squares = E::splat(0.0);
        for (f, scale) in self.f[..states].iter().zip(&self.scale) {
            let part = product(&self.legendre, f) * *scale;
            squares = part.madd(part, squares);
        }
        let s = squares.as_array();
        let size = |k: usize| ((s[k] + s[k + 1]) / states as f64).sqrt() * h;
        let (before, last) = (size(MOMENTS - 4), size(MOMENTS - 2));
        let ratio = (last / before.max(f64::MIN_POSITIVE)).min(1.0);
        let of = |part: f64| last * part / tolerance;
        (of(ratio.powi(2)), of(ratio / 17.0))
    }

    /// How far the contacts are from an event at each node, N.
    pub fn margins(&self) -> &[f64; MOMENTS] {
        self.margin.as_array()
    }

    /// Looks at the contacts that `watch`, as in [`super::super::course::Course::watch`], tells of.
    pub fn look_at(&mut self, watch: &[(f64x2, f64x2)]) {
        self.watch.clear();
        let spread = |&(factor, summand): &(f64x2, f64x2)| {
            // The least is the largest of the opposite.
            (Eight::<E>::always(-factor), Eight::<E>::always(-summand))
        };
        self.watch.extend(watch.iter().map(spread));
    }

    /// The state at `theta` of the step solved last.
    pub fn between(&self, y0: &[f64], theta: f64, out: &mut [f64]) {
        if theta == 1.0 {
            for (out, y) in out.iter_mut().zip(&self.y) {
                *out = y.as_array()[MOMENTS - 1];
            }
            return;
        }
        let weights = weights(theta);
        for ((out, y), y0) in out.iter_mut().zip(&self.y).zip(y0) {
            // Differences, so that next to the start nothing is lost.
            let parts = y.as_array().iter().zip(&weights[1..]);
            *out = y0 + parts.map(|(y, w)| (y - y0) * w).sum::<f64>();
        }
    }
}

/// What the state at the start and the stages weigh in that at `theta`: Berrut & Trefethen, SIAM Review 46 (2004), 501.
fn weights(theta: f64) -> [f64; MOMENTS + 1] {
    let nodes = with_start();
    if let Some(at) = nodes.iter().position(|c| *c == theta) {
        return std::array::from_fn(|k| f64::from(u8::from(k == at)));
    }
    let raw: [f64; MOMENTS + 1] =
        std::array::from_fn(|k| TABLEAU.barycentric[k] / (theta - nodes[k]));
    let total: f64 = raw.iter().sum();
    raw.map(|w| w / total)
}

//! The stages of one step, all eight side by side.

use super::modes::{Mode, WATCHED};
use super::tableau::{C, HALF, TABLEAU, with_start};
use crate::freedoms::{by_columns, by_rows, turn};
use crate::lanes::{Eight, MOMENTS, Moments, Number, Two, f64x2};
use crate::model::{Model, Octet, Registers, SideBySide, Workspace};
use std::ops::Range;

/// After so many sweeps an iteration that has not ended will not.
const MOST_SWEEPS: u32 = 16;
/// So many times what the next coefficient would be, the slopes' polynomial may miss the slope at the start by.
const EXPECTED: f64 = 10.0;
/// A mode that a step hardly moves is left to the sweeps.
const SLIGHT: f64 = 0.08;
/// No sweep is believed to gain more than a factor of thirty: what falls faster at first leaves what falls more slowly. Squared.
const BEST: f64 = 1e-3;

/// So many Legendre coefficients of the slopes of a step say how the next begins.
const REACH: usize = 6;

/// P_k(2x − 1) and their integrals from 0 to x.
#[inline(always)]
fn integrals<T: Number>(x: T) -> [(T, T); REACH] {
    let z = x * 2.0 + -1.0;
    let mut p = [T::splat(1.0); REACH + 1];
    p[1] = z;
    for k in 1..REACH {
        let n = k as f64;
        p[k + 1] = (p[k] * z * (2.0 * n + 1.0) - p[k - 1] * n) * (1.0 / (n + 1.0));
    }
    std::array::from_fn(|k| {
        if k == 0 {
            (p[0], x)
        } else {
            (p[k], (p[k + 1] - p[k - 1]) * (0.5 / (2.0 * k as f64 + 1.0)))
        }
    })
}

/// By eights.
#[inline(always)]
fn tiles<T>(of: &[T]) -> &[[T; MOMENTS]] {
    of.as_chunks().0
}

/// A matrix by columns.
type Columns<E> = [E; MOMENTS];

/// Where the iteration begins.
pub enum Guess {
    /// On from the step accepted last: its size, and the part of it that it ended at. Its slopes, bent so that they begin with that of the
    /// step.
    Onward { before_s: f64, ended: f64 },
    /// This part of the step solved last, which began at the same state.
    Part(f64),
}

/// A step to be solved.
pub struct Step<'a> {
    pub side: &'a SideBySide<'a>,
    /// Where it begins.
    pub t_s: f64,
    pub y: &'a [f64],
    pub slope: &'a [f64],
    pub h_s: f64,
    pub guess: Guess,
    pub modes: &'a [Mode],
    /// Rows of the rotation of the body where the modes were found, if its attitude is a quaternion.
    pub found_at: [[f64; 3]; 3],
    pub demand: Demand,
}

/// What is known of a step that was solved.
#[derive(Clone, Copy, Debug)]
pub struct Solved {
    /// How often the right-hand side was evaluated at all stages; where the phases alone were, it does not count.
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

/// (a_ij) seen from its eigenvectors, four real parts and four imaginary parts side by side.
struct Eigen<E> {
    to: Columns<E>,
    from: Columns<E>,
    values: E,
    squares: E,
    /// 1 for real parts, 0 for imaginary parts; and the other way round.
    real: E,
    imaginary: E,
}

/// Multiplies by (1 + h d A + h² κ A²)⁻¹ − 1 of a mode, as a complex number for each eigenvalue of A.
struct Solver<E> {
    mode: Mode,
    /// Its real parts, twice; and its imaginary parts, those that meet imaginary parts with the other sign.
    straight: E,
    across: E,
}

/// Stages of a step and what they are computed with.
pub struct Stages<E: Registers> {
    pub w: Workspace<Eight<E>>,
    /// States at the nodes.
    pub y: Vec<E>,
    /// Slopes at the nodes.
    pub f: Vec<E>,
    /// Legendre coefficients of the slopes, from the state `first` on: of the step solved last, and of the one accepted last; with room for
    /// whole [`tiles`].
    parts: Vec<E>,
    smooth: Vec<E>,
    /// States before this one are integrals of velocities: guessed and judged with them.
    first: usize,
    /// Takes an error of a state to units: 1/(unit + |y|); nothing beyond the states.
    pub scale: Vec<f64>,
    /// How far the states at each node are from those at the start, eight states side by side; whether they are those of the step
    /// solved last.
    across: Vec<[E; MOMENTS]>,
    laid: bool,
    /// Where the body's velocities are; its positions come before them.
    velocities: Range<usize>,
    /// Whether the attitude is a quaternion, in which case the body has all thirteen states.
    quaternion: bool,
    a: Columns<E>,
    /// h a_ij of the step that is solved.
    step: Columns<E>,
    legendre: Columns<E>,
    nodes: E,
    /// Barycentric weights of the start and the nodes.
    start: f64,
    barycentric: E,
    /// Legendre polynomials at the start of a step: ±1.
    at_start: E,
    eigen: Eigen<E>,
    solvers: Vec<Solver<E>>,
    /// Rows of the rotation that takes an angular velocity in the body at each stage to the body as it stood where the modes were found.
    turned: [[E; 3]; 3],
    /// Whether the phases, where there are any, are solved before the rest.
    carriers_lead: bool,
    watch: Vec<(Two<E>, Two<E>)>,
    margin: E,
}

/// A solved step, while another is looked at: stages, slopes, their coefficients and the margins.
pub struct Kept<E> {
    all: [Vec<E>; 3],
    margin: E,
}

impl<E: Registers> Kept<E> {
    /// Room for nothing yet.
    pub fn new() -> Self {
        Self {
            all: [Vec::new(), Vec::new(), Vec::new()],
            margin: E::splat(0.0),
        }
    }
}

#[inline(always)]
fn columns<E: Registers>(m: &[[f64; MOMENTS]; MOMENTS]) -> Columns<E> {
    std::array::from_fn(|j| E::load(&m[j]))
}

/// Σ_j column_j x_j and what it is added to, in four chains that do not wait for each other.
#[inline(always)]
fn product<E: Registers>(m: &Columns<E>, x: &E, onto: E) -> E {
    let x = x.as_array();
    let first = m[0].madd(E::splat(x[0]), onto);
    let second = m[1] * E::splat(x[1]);
    let third = m[2] * E::splat(x[2]);
    let fourth = m[3] * E::splat(x[3]);
    let first = m[4].madd(E::splat(x[4]), first);
    let second = m[5].madd(E::splat(x[5]), second);
    let third = m[6].madd(E::splat(x[6]), third);
    let fourth = m[7].madd(E::splat(x[7]), fourth);
    (first + second) + (third + fourth)
}

/// The sum of eight.
#[inline(always)]
fn total<E: Registers>(of: &E) -> f64 {
    let x = of.as_array();
    ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]))
}

/// The largest of eight; not a number where one of them is not.
#[inline(always)]
fn largest<E: Registers>(of: &E) -> f64 {
    let m = of.as_array();
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

/// What a sweep leaves of what it changed, as far as the last two tell; what a first one leaves is not known before the second.
#[inline(always)]
fn rate(change: f64, last: f64) -> f64 {
    const FIRST: f64 = 0.8;
    let gained = change / last;
    if !last.is_finite() {
        FIRST
    } else if gained > BEST {
        gained.min(FIRST)
    } else {
        BEST
    }
}

/// How the carriers' phases are solved.
#[derive(Clone, Copy, PartialEq)]
enum Carriers {
    /// Before the load, which they do not feel.
    Lead,
    /// They are: only what follows from them is still to be known.
    Settle,
    /// They are, and so is what follows from them.
    Solved,
    /// With the load.
    Feel,
}

impl<E: Registers> Stages<E> {
    /// For a model's states.
    #[inline(always)]
    pub fn new(model: &Model) -> Self {
        let size = model.layout().size();
        let tiled = size.next_multiple_of(MOMENTS);
        let zero = E::splat(0.0);
        let positions = model.freedoms().positions();
        let quaternion = model.freedoms().rotation().is_some();
        let first = if quaternion { 3 } else { positions };
        let rest = (size - first).next_multiple_of(MOMENTS);
        Self {
            w: Workspace::blank(),
            y: vec![zero; size],
            f: vec![zero; size],
            parts: vec![zero; rest],
            smooth: vec![zero; rest],
            first,
            scale: vec![0.0; first + rest],
            across: vec![[zero; MOMENTS]; tiled / MOMENTS],
            laid: false,
            velocities: positions..model.layout().body,
            quaternion,
            a: columns(&TABLEAU.a),
            step: [zero; MOMENTS],
            legendre: columns(&TABLEAU.legendre),
            nodes: E::load(&C),
            at_start: E::load(&std::array::from_fn(|k| [1.0, -1.0][k % 2])),
            start: TABLEAU.barycentric[0],
            barycentric: E::load(&std::array::from_fn(|k| TABLEAU.barycentric[k + 1])),
            eigen: Eigen {
                to: columns(&TABLEAU.to_eigen),
                from: columns(&TABLEAU.from_eigen),
                values: E::load(&TABLEAU.values),
                squares: E::load(&TABLEAU.squares),
                real: E::load(&std::array::from_fn(|m| f64::from(u8::from(m < HALF)))),
                imaginary: E::load(&std::array::from_fn(|m| f64::from(u8::from(m >= HALF)))),
            },
            solvers: Vec::new(),
            turned: [[zero; 3]; 3],
            carriers_lead: model.carriers_lead(),
            watch: Vec::new(),
            margin: zero,
        }
    }

    #[inline(always)]
    fn octet(&mut self, t_s: E) -> Octet<'_, E> {
        Octet {
            t_s,
            y: &self.y,
            dy: &mut self.f,
            w: &mut self.w,
        }
    }

    /// What undoes h d A + h² κ A² of each mode, and how the body has turned since they were found.
    #[inline(always)]
    fn prepare(&mut self, modes: &[Mode], found_at: &[[f64; 3]; 3], h: f64) {
        self.solvers.clear();
        if self.quaternion && !modes.is_empty() {
            for (c, row) in self.turned.iter_mut().enumerate() {
                for (b, to) in row.iter_mut().enumerate() {
                    *to = E::splat(0.0);
                    for (then, now) in found_at.iter().zip(&self.w.rotation) {
                        *to = now[b].madd(E::splat(then[c]), *to);
                    }
                }
            }
        }
        let eigen = &self.eigen;
        let mut load = E::splat(0.0);
        for p in &self.w.pair {
            load += Eight::sum(p.normal);
        }
        let load_n = (load.as_array().iter().sum::<f64>() / MOMENTS as f64).max(0.0);
        for mode in modes {
            let [d, k] = mode.at(load_n);
            let (d, k) = (h * d, h * h * k);
            if d + k < SLIGHT {
                continue;
            }
            // −x/(1 + x), x = λ h d + λ² h² κ
            let x = eigen.squares.madd(E::splat(k), eigen.values * d);
            let all = x + eigen.real;
            let squares = all * all;
            let over = E::splat(-1.0) / (squares + squares.swapped());
            let (re, im) = (all * eigen.real, all * eigen.imaginary);
            let (re, im) = (re + re.swapped(), im + im.swapped());
            let turned = x.swapped() * im * (eigen.real - eigen.imaginary);
            let factor = x.madd(re, turned) * over;
            let (re, im) = (factor * eigen.real, factor * eigen.imaginary);
            self.solvers.push(Solver {
                mode: *mode,
                straight: re + re.swapped(),
                across: im - im.swapped(),
            });
        }
    }

    /// Puts the stages where the iteration begins.
    #[inline(always)]
    fn guess(&mut self, y0: &[f64], h: f64, slope: &[f64], guess: &Guess) {
        match *guess {
            Guess::Onward { before_s, ended } => {
                let t = self.nodes * h;
                let onward = t.madd(E::splat(1.0 / before_s), E::splat(ended));
                let (there, here) = (integrals(onward), integrals(ended));
                let columns: [E; REACH] =
                    std::array::from_fn(|k| (there[k].1 - E::splat(here[k].1)) * before_s);
                // The farther, the less of it holds.
                let reach = match h / before_s {
                    ..=2.0 => REACH,
                    ..=5.0 => 3,
                    _ => 1,
                };
                let here = here.map(|x| x.0);
                let here: [f64; MOMENTS] =
                    std::array::from_fn(|k| if k < reach { here[k] } else { 0.0 });
                let here = E::load(&here);
                let (y0, slope) = (&y0[self.first..], &slope[self.first..]);
                let starts = y0.chunks(MOMENTS).zip(slope.chunks(MOMENTS));
                let states = self.y[self.first..].chunks_mut(MOMENTS);
                let tiles = states.zip(tiles(&self.smooth));
                for ((y, smooth), (y0, slope)) in tiles.zip(starts) {
                    let before = E::sums(smooth.map(|part| part * here));
                    let each = y.iter_mut().zip(smooth).zip(y0.iter().zip(slope));
                    for (((y, part), (y0, slope)), before) in each.zip(before.as_array()) {
                        let part = part.as_array();
                        let mut guess = t.madd(E::splat(slope - before), E::splat(*y0));
                        for k in 0..reach {
                            guess = columns[k].madd(E::splat(part[k]), guess);
                        }
                        *y = guess;
                    }
                }
            }
            Guess::Part(part) => {
                let weights: [[f64; MOMENTS + 1]; MOMENTS] = C.map(|c| weights(c * part));
                let start = E::load(&weights.map(|w| w[0]));
                let rest: Columns<E> = std::array::from_fn(|j| E::load(&weights.map(|w| w[j + 1])));
                let states = self.y[self.first..].iter_mut();
                for (y, y0) in states.zip(&y0[self.first..]) {
                    *y = product(&rest, y, start * E::splat(*y0));
                }
            }
        }
    }

    /// Solves a step.
    #[inline(always)]
    pub fn solve_here(&mut self, step: &Step<'_>) -> Solved {
        let &Step {
            side,
            t_s: t0,
            y: y0,
            slope,
            h_s: h,
            ref guess,
            modes,
            ref found_at,
            demand,
        } = step;
        let ledger = side.layout.ledger_range();
        let watched = ledger.start;
        let phases = side.layout.phase_range();
        self.laid = false;
        self.step = self.a;
        self.step.iter_mut().for_each(|a| *a = *a * h);
        self.guess(y0, h, slope, guess);
        // What a sweep knows of springs asks that positions belong to the velocities.
        self.rise(y0);
        let t = self.nodes.madd(E::splat(h), E::splat(t0));
        side.clock(t, &mut self.w);
        let mut carriers = if !self.carriers_lead {
            Carriers::Feel
        } else if phases.is_empty() {
            Carriers::Solved
        } else {
            Carriers::Lead
        };
        let (mut sweeps, mut rounds, mut last) = (0, 0, f64::INFINITY);
        // Squares, of sums over states.
        let enough = demand.iteration * demand.iteration;
        let mut converged = false;
        // Each function is called at one place: at two it is not inlined, nor are the registers' operations then.
        loop {
            if carriers != Carriers::Solved {
                side.phases(&mut [self.octet(t)]);
            }
            if carriers == Carriers::Lead {
                let change = largest(&self.follow(y0, phases.clone()));
                rounds += 1;
                if change * rate(change, last) <= enough * phases.len() as f64 {
                    carriers = Carriers::Settle;
                } else if !change.is_finite() || rounds >= MOST_SWEEPS {
                    break;
                }
                last = change;
                continue;
            }
            if carriers != Carriers::Solved {
                side.shoulders(&mut [self.octet(t)]);
            }
            if carriers == Carriers::Settle {
                (carriers, last) = (Carriers::Solved, f64::INFINITY);
            }
            side.load(&mut [self.octet(t)]);
            sweeps += 1;
            if sweeps == 1 {
                self.prepare(modes, found_at, h);
            }
            // Nothing feeds the ledger's errors back to the motion, so no sweep takes them away: it is booked at the stages as they are.
            if converged {
                break;
            }
            let mut change = self.sweep(y0);
            if carriers == Carriers::Feel {
                change += largest(&self.follow(y0, self.velocities.end..watched));
            }
            converged = change * rate(change, last) <= enough * watched as f64;
            let given_up = !change.is_finite() || sweeps >= MOST_SWEEPS;
            if given_up || converged && ledger.is_empty() {
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
        side.powers(&mut self.f, &self.w);
        for d in ledger {
            self.y[d] = product(&self.step, &self.f[d], E::splat(y0[d]));
        }
        let all = self.y.len();
        let motion = self.expand(self.first..watched, E::splat(0.0));
        let squares = self.expand(watched..all, motion);
        let (error, between) = Self::errors(&squares, all - self.first, h, demand.tolerance);
        let missed = self.missed(&motion, slope, watched, h) / demand.tolerance;
        Solved {
            sweeps,
            // An error that is not a number stays one.
            error: if missed > error { missed } else { error },
            between,
            converged,
        }
    }

    /// New stages of some states that nothing makes stiff, from the slopes at the old ones. The sum of squares, over the states, of what they
    /// moved by, in units.
    #[inline(always)]
    fn follow(&mut self, y0: &[f64], states: Range<usize>) -> E {
        let mut moved = E::splat(0.0);
        for d in states {
            let new = product(&self.step, &self.f[d], E::splat(y0[d]));
            let part = (new - self.y[d]) * self.scale[d];
            self.y[d] = new;
            moved = part.madd(part, moved);
        }
        moved
    }

    /// New stages of the body from the slopes at the old ones. The largest sum of squares, over the states, of what they moved by, in units.
    #[inline(always)]
    fn sweep(&mut self, y0: &[f64]) -> f64 {
        let (from, body) = (self.velocities.start, self.velocities.end);
        let (y, f) = (&mut self.y[..body], &mut self.f[..body]);
        let (y0, scale) = (&y0[..body], &self.scale[..body]);
        let mut moved = E::splat(0.0);
        let mut by = [E::splat(0.0); WATCHED];
        for (d, by) in (from..body).zip(&mut by) {
            *by = product(&self.step, &f[d], E::splat(y0[d]) - y[d]);
        }
        // A mode is fixed in the world more than in the body, which may turn within a step.
        let turns = self.quaternion && !self.solvers.is_empty();
        if turns {
            [by[3], by[4], by[5]] = by_rows(self.turned, [by[3], by[4], by[5]]);
        }
        let (residual, zero) = (by, E::splat(0.0));
        for solver in &self.solvers {
            let from = solver.mode.from;
            let (mut first, mut second) = (residual[0] * from[0], residual[3] * from[3]);
            for a in 1..WATCHED / 2 {
                first = residual[a].madd(E::splat(from[a]), first);
                second = residual[a + 3].madd(E::splat(from[a + 3]), second);
            }
            let along = first + second;
            let along = product(&self.eigen.to, &along, zero);
            let turned = along.swapped() * solver.across;
            let further = product(&self.eigen.from, &solver.straight.madd(along, turned), zero);
            for (by, &to) in by.iter_mut().zip(&solver.mode.to) {
                *by = further.madd(E::splat(to), *by);
            }
        }
        if turns {
            [by[3], by[4], by[5]] = by_columns(self.turned, [by[3], by[4], by[5]]);
        }
        for (d, by) in (from..body).zip(by) {
            y[d] += by;
            let part = by * scale[d];
            moved = part.madd(part, moved);
        }
        moved += self.rise(y0);
        largest(&moved)
    }

    /// New positions from the velocities, as new as these are; returns as [`Self::follow`].
    #[inline(always)]
    fn rise(&mut self, y0: &[f64]) -> E {
        let (from, y) = (self.velocities.start, &self.y);
        if self.quaternion {
            self.f[..3].copy_from_slice(&y[7..10]);
            let turned = turn([y[3], y[4], y[5], y[6]], [y[10], y[11], y[12]]);
            self.f[3..7].copy_from_slice(&turned);
        } else {
            self.f[..from].copy_from_slice(&y[from..self.velocities.end]);
        }
        self.follow(y0, 0..from)
    }

    /// Legendre coefficients of the slopes of some states, and the sums of their squares, in units, over the states, on top of `others`.
    #[inline(always)]
    fn expand(&mut self, states: Range<usize>, others: E) -> E {
        let mut squares = others;
        for d in states {
            let part = product(&self.legendre, &self.f[d], E::splat(0.0));
            self.parts[d - self.first] = part;
            let part = part * self.scale[d];
            squares = part.madd(part, squares);
        }
        squares
    }

    /// Errors at the end of the step and between the stages, in units of the tolerance, from the last Legendre coefficients of the slopes;
    /// those of what is only an integral of others are smaller. `squares`: sums over so many states.
    ///
    /// The coefficients of a smooth slope fall like ρ^-k: e₅ and e₇ are those of degrees 4, 5 and 6, 7, times h. The polynomial of the stages
    /// leaves out the next, e₇ (e₇/e₅), whose integrals are less than 1/17 of them. At the end of the step Radau's nodes integrate to
    /// degree 14, as far beyond again; half of that is claimed: e₇ (e₇/e₅)², of order 12.
    #[inline(always)]
    fn errors(squares: &E, states: usize, h: f64, tolerance: f64) -> (f64, f64) {
        let s = squares.as_array();
        let size = |k: usize| ((s[k] + s[k + 1]) / states as f64).sqrt() * h;
        let (before, last) = (size(MOMENTS - 4), size(MOMENTS - 2));
        let ratio = (last / before.max(f64::MIN_POSITIVE)).min(1.0);
        let of = |part: f64| last * part / tolerance;
        (of(ratio.powi(2)), of(ratio / 17.0))
    }

    /// What lies before the first node and no stage has seen, from the slope at the start, which is none: where it is farther from the
    /// polynomial of the slopes than their coefficients let expect, by what the part of the step before the first node makes of that.
    /// `squares`: sums over the states up to `end`.
    #[inline(always)]
    fn missed(&self, squares: &E, slope: &[f64], end: usize, h: f64) -> f64 {
        let mut apart = E::splat(0.0);
        let (scale, slope) = (&self.scale[self.first..], &slope[self.first..end]);
        let tiles = tiles(&self.parts).iter().zip(tiles(scale));
        for ((parts, scale), slopes) in tiles.zip(slope.chunks(MOMENTS)) {
            let starts = E::sums(parts.map(|part| part * self.at_start));
            let mut slope = starts;
            slope.as_mut_array()[..slopes.len()].copy_from_slice(slopes);
            let off = (slope - starts) * E::load(scale);
            apart = off.madd(off, apart);
        }
        let s = squares.as_array();
        let [before, last] = [s[4] + s[5], s[6] + s[7]].map(f64::sqrt);
        let apart = total(&apart).sqrt();
        let next = last * (last / before.max(f64::MIN_POSITIVE)).min(1.0).sqrt();
        (apart - EXPECTED * next).max(0.0) * h * C[0] / (slope.len() as f64).sqrt()
    }

    /// The step solved last is accepted.
    pub fn keep(&mut self) {
        std::mem::swap(&mut self.parts, &mut self.smooth);
    }

    /// Legendre coefficients of the slopes of the step accepted last.
    pub fn kept(&self) -> &[E] {
        &self.smooth
    }

    /// Takes these for the step accepted last.
    pub fn recall(&mut self, smooth: &[E]) {
        self.smooth.copy_from_slice(smooth);
    }

    /// Puts what is known of the step solved last into `kept`.
    pub fn save(&self, kept: &mut Kept<E>) {
        let from = [&self.y, &self.f, &self.parts];
        for (to, from) in kept.all.iter_mut().zip(from) {
            to.clone_from(from);
        }
        kept.margin = self.margin;
    }

    /// And back.
    pub fn restore(&mut self, kept: &Kept<E>) {
        let to = [&mut self.y, &mut self.f, &mut self.parts];
        for (to, from) in to.into_iter().zip(&kept.all) {
            to.copy_from_slice(from);
        }
        self.laid = false;
        self.margin = kept.margin;
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

    /// Makes the step solved last, which began at `y0`, ready for [`Self::between`].
    #[inline(always)]
    pub fn lay(&mut self, y0: &[f64]) {
        if std::mem::replace(&mut self.laid, true) {
            return;
        }
        let tiles = self.y.chunks(MOMENTS).zip(y0.chunks(MOMENTS));
        for (across, (y, y0)) in self.across.iter_mut().zip(tiles) {
            let mut rises = [E::splat(0.0); MOMENTS];
            for (rise, (y, y0)) in rises.iter_mut().zip(y.iter().zip(y0)) {
                // Differences, so that next to the start nothing is lost.
                *rise = *y - E::splat(*y0);
            }
            *across = E::transposed(rises);
        }
    }

    /// The state at `theta` of the step solved last, which began at `y0`.
    #[inline(always)]
    pub fn between(&self, y0: &[f64], theta: f64, out: &mut [f64]) {
        if theta == 1.0 {
            for (out, y) in out.iter_mut().zip(&self.y) {
                *out = y.as_array()[MOMENTS - 1];
            }
            return;
        }
        let (_, weights) = self.weights(theta);
        let tiles = y0.chunks(MOMENTS).zip(out.chunks_mut(MOMENTS));
        for (across, (y0, out)) in self.across.iter().zip(tiles) {
            let rise = product(across, &weights, E::splat(0.0));
            match (y0.try_into(), out.try_into()) {
                (Ok(y0), Ok(out)) => {
                    let out: &mut [f64; MOMENTS] = out;
                    *out = *(E::load(y0) + rise).as_array();
                }
                _ => {
                    for ((out, y0), rise) in out.iter_mut().zip(y0).zip(rise.as_array()) {
                        *out = y0 + rise;
                    }
                }
            }
        }
    }

    /// The margin at `theta` by the polynomial through those at the stages and the one at the start.
    #[inline(always)]
    pub fn margin_between(&self, start_n: f64, theta: f64) -> f64 {
        let (start, rest) = self.weights(theta);
        start_n * start + total(&(self.margin * rest))
    }

    /// [`weights`], side by side, with one division.
    #[inline(always)]
    fn weights(&self, theta: f64) -> (f64, E) {
        let apart = E::splat(theta) - self.nodes;
        let x = apart.as_array();
        let all = ((x[0] * x[4]) * (x[2] * x[6])) * ((x[1] * x[5]) * (x[3] * x[7]));
        if all == 0.0 {
            let [start, rest @ ..] = weights(theta);
            return (start, E::load(&rest));
        }
        (self.start * all, self.barycentric * (theta * all) / apart)
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

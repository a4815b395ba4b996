//! Adaptive embedded Runge–Kutta pairs with dense output and located contact events.
//!
//! A step is taken with every contact frozen as it was at its start, so the method sees a smooth right-hand side. Each
//! stage gives the contacts' margins for nothing; when they say that one has passed zero, or may have between two stages,
//! [`super::events`] looks for the first zero, the step is cut there, and the contact changes. The step size follows a
//! PI controller: Hairer, Nørsett, Wanner, Solving ODEs I (1993), II.4 and IV.2.
//!
//! Dense output is of lower order than the step. Where the last term of its polynomial is not small against the tolerance,
//! the state between steps is not read off the polynomial but stepped to, so a sample is as good as a step.
//!
//! States are held in tiles of [`TILE`] numbers, and the sums over stages are unrolled for each row of the tableau: no
//! allocation, no index check and no loop over coefficients is left inside a step.
#![allow(clippy::int_plus_one)] // an unrolled stage may read `7 >= n + 1`

#[cfg(test)]
mod order_conditions;

use super::course::{Course, same_moment_s, smallest_step_s};
use super::events::{self, Looks};
use super::first_steps::FirstSteps;
use super::{Observer, SLOWEST_PER_S, Settings, Stats, Stopped};
use crate::model::Model;

/// Coefficients `(stage, a)` of one stage, zeros left out.
pub type Row = &'static [(usize, f64)];

/// Numbers that are treated together.
pub const TILE: usize = 8;
type Tile = [f64; TILE];

/// Most stages that a method may have, those for dense output and the slope at the end included.
const MOST_STAGES: usize = 16;
/// The stages of one tile.
pub type Slopes = [Tile; MOST_STAGES];

/// Most coefficients of a dense polynomial per state.
const MOST_ROWS: usize = 7;
/// The dense polynomial of one tile.
pub type Polynomial = [Tile; MOST_ROWS];

/// a·b + c, fused or not.
pub trait Arithmetic {
    /// a·b + c
    fn madd(a: f64, b: f64, c: f64) -> f64;
    /// a·x + y of a tile.
    #[inline(always)]
    fn axpy(a: f64, x: &Tile, y: &Tile) -> Tile {
        std::array::from_fn(|l| Self::madd(a, x[l], y[l]))
    }
}

/// Two roundings; what every processor does fast.
pub struct Plain;
impl Arithmetic for Plain {
    #[inline(always)]
    fn madd(a: f64, b: f64, c: f64) -> f64 {
        a * b + c
    }
}

/// One rounding; for [`integrate_fused`] alone, which knows that the processor has the instruction.
#[cfg(target_arch = "x86_64")]
struct Fused;
#[cfg(target_arch = "x86_64")]
impl Arithmetic for Fused {
    #[inline(always)]
    fn madd(a: f64, b: f64, c: f64) -> f64 {
        a.mul_add(b, c)
    }
    /// Four at a time, said by name: left to itself the compiler takes the numbers of a long sum one by one.
    #[inline(always)]
    fn axpy(a: f64, x: &Tile, y: &Tile) -> Tile {
        use std::arch::x86_64::{
            _mm256_fmadd_pd, _mm256_loadu_pd, _mm256_set1_pd, _mm256_storeu_pd,
        };
        let mut out = [0.0; TILE];
        let tiles = x.as_chunks::<4>().0.iter().zip(y.as_chunks::<4>().0);
        for ((x, y), out) in tiles.zip(out.as_chunks_mut::<4>().0) {
            // SAFETY: the processor has both features (see above); each pointer is to four numbers.
            #[allow(unsafe_code)]
            unsafe {
                let (x, y) = (_mm256_loadu_pd(x.as_ptr()), _mm256_loadu_pd(y.as_ptr()));
                _mm256_storeu_pd(out.as_mut_ptr(), _mm256_fmadd_pd(_mm256_set1_pd(a), x, y));
            }
        }
        out
    }
}

/// A pair, as data.
pub trait Pair {
    /// Name for messages.
    const NAME: &'static str;
    /// Stages of the step itself; the derivative at its end is stored behind them.
    const STAGES: usize;
    /// Further stages that dense output needs, behind the derivative at the end.
    const DENSE_STAGES: usize;
    /// a_ij from the second stage on.
    const A: &'static [Row];
    /// c_i of every stage.
    const C: &'static [f64];
    /// b_i.
    const B: Row;
    /// Rows and times of the dense stages.
    const A_DENSE: &'static [Row];
    /// c_i of the dense stages.
    const C_DENSE: &'static [f64];
    /// Stages up to this one have no part in the step's end, its error or its dense polynomial: only later stages read their slopes.
    const PASSING: usize;
    /// The exponent of the step-size law: one over the order of the error estimate.
    const EXPONENT: f64;
    /// Coefficients of the dense polynomial needed per state.
    const DENSE_ROWS: usize;
    /// What a step may err, in units of the tolerance asked for: so much less that the error of a whole run stays within ten times
    /// what was asked, also where a scene adds up the errors of hundreds of steps and then grows them (held for `auto` by tests/tolerance.rs, for
    /// each by the hard cases).
    const SHARE: f64;
    /// h |λ| from which on the last two stages say that stability limits the step.
    const STABLE: f64;
    /// The size at `theta` of the polynomial's last term, whose coefficient is the last row.
    fn last_term(theta: f64) -> f64;

    /// Two error estimates of a tile, per unit of h.
    fn errors<F: Arithmetic>(k: &Slopes) -> [Tile; 2];
    /// The error of a step of size h from the sums of squares of both estimates over `count` states, in units of the tolerance;
    /// `friction`: whether a force may turn within the step. Their root mean
    /// square, if the method knows no better.
    #[inline(always)]
    fn error(h: f64, squares: [f64; 2], count: f64, _friction: bool) -> f64 {
        h * ((squares[0] + squares[1]) / count).sqrt()
    }
    /// Prepares the dense polynomial of a tile.
    fn dense<F: Arithmetic>(h: f64, y0: &Tile, y1: &Tile, k: &Slopes, out: &mut Polynomial);
    /// Evaluates it at `theta` in 0…1.
    fn interpolate<F: Arithmetic>(theta: f64, y0: &Tile, rows: &Polynomial) -> Tile;
}

/// Σ a_j k_j over a row that is known when the program is compiled.
#[inline(always)]
pub fn sum<F: Arithmetic>(row: Row, k: &Slopes) -> Tile {
    let mut out = [0.0; TILE];
    for &(j, a) in row {
        out = F::axpy(a, &k[j], &out);
    }
    out
}

/// The first rows of a dense polynomial: the cubic with the values and slopes of both ends of a step.
#[inline(always)]
pub fn cubic(h: f64, y0: &Tile, y1: &Tile, f0: &Tile, f1: &Tile, out: &mut Polynomial) {
    for l in 0..TILE {
        let dy = y1[l] - y0[l];
        let bump = h * f0[l] - dy;
        out[0][l] = dy;
        out[1][l] = bump;
        out[2][l] = dy - h * f1[l] - bump;
    }
}

/// So many steps in a row without a stop, each limited by stability, cost more than the one implicit step that could replace them:
/// its Jacobian takes about two evaluations per state, its iteration some more.
const MANY: u32 = 100;
const SAFETY: f64 = 0.9;
const SHRINK: f64 = 0.2;
/// An error below this says no more of the next step than this one.
const LEAST_ERROR: f64 = 1e-4;
const GROW: f64 = 6.0;
/// Below this a step's error estimate is rounding.
const FINEST: f64 = 3e-15;
/// Where a step may end at an event: the last term of the dense polynomial may be so many times what a step may err; its error is well
/// below its last term.
const TRUST: f64 = 10.0;

/// How an explicit run ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// At its end.
    Finished,
    /// Stability rather than accuracy has limited the steps, at this price.
    Stiff { evaluations_per_s: f64 },
}

/// Integrates a model with pair `P`; with `EVENTS` contacts are frozen within a step and their changes located.
pub fn run<P: Pair, const EVENTS: bool>(
    model: &Model,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> (Stats, Result<(), Stopped>) {
    let mut course = Course::new(model, P::NAME, settings, EVENTS);
    if let Err(stopped) = course.begin_log(observer) {
        return (course.stats, Err(stopped));
    }
    let (course, outcome) = go::<P, EVENTS>(course, settings, false, observer);
    (course.stats, outcome.map(|_| ()))
}

/// Goes on from where a course stands; with `watch` only until it turns out to be stiff.
pub fn go<'m, P: Pair, const EVENTS: bool>(
    course: Course<'m>,
    settings: &Settings,
    watch: bool,
    observer: &mut dyn Observer,
) -> (Course<'m>, Result<End, Stopped>) {
    let mut run = Run::<P, EVENTS>::new(course, settings, watch);
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        // SAFETY: the processor has just been asked for both features, all that the callee requires.
        #[allow(unsafe_code)]
        let outcome = unsafe { integrate_fused(&mut run, observer) };
        return (run.course, outcome);
    }
    let outcome = run.integrate::<Plain>(observer);
    (run.course, outcome)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn integrate_fused<P: Pair, const EVENTS: bool>(
    run: &mut Run<'_, P, EVENTS>,
    observer: &mut dyn Observer,
) -> Result<End, Stopped> {
    run.integrate::<Fused>(observer)
}

/// A run and its buffers, all of whole tiles.
struct Run<'m, P, const EVENTS: bool> {
    course: Course<'m>,
    tolerance: f64,
    /// As [`TRUST`], for samples: errors of what is only looked at do not add up, so the last term may be the tolerance asked for.
    trust: f64,
    /// Stages by tile.
    k: Vec<Slopes>,
    dense: Vec<Polynomial>,
    /// The state at which a stage is evaluated, and its slope.
    trial: Vec<f64>,
    slope: Vec<f64>,
    y1: Vec<f64>,
    /// A state between steps.
    at: Vec<f64>,
    /// 1/unit of each state that the error norm watches, 0 for padding.
    weight: Vec<Tile>,
    /// How far the unit grows with the state: 1 or 0.
    relative: Vec<Tile>,
    /// How many states come before the ledger.
    watched: usize,
    /// Units of the body's states.
    units: Vec<f64>,
    /// How many tiles hold the states that feed something back; what lies beyond is ledger alone.
    moving: usize,
    looks: Looks,
    /// The margin at the start of the step.
    margin_n: f64,
    /// Whether somebody asks if the steps are limited by stability; how many were, one after the other; since when.
    watch: bool,
    stiff_in_row: u32,
    row_began: (f64, u64),
    method: std::marker::PhantomData<P>,
}

fn tiles(y: &[f64]) -> &[Tile] {
    y.as_chunks().0
}

fn tiles_mut(y: &mut [f64]) -> &mut [Tile] {
    y.as_chunks_mut().0
}

/// A row, empty for a stage that the method does not have.
pub const fn row<P: Pair>(stage: usize) -> Row {
    if stage == P::STAGES {
        P::B
    } else if stage > 0 && stage < P::STAGES {
        P::A[stage - 1]
    } else if stage > P::STAGES && stage <= P::STAGES + P::DENSE_STAGES {
        P::A_DENSE[stage - P::STAGES - 1]
    } else {
        &[]
    }
}

/// c of a stage; that of the slope at the end is 1.
const fn time<P: Pair>(stage: usize) -> f64 {
    if stage < P::STAGES {
        P::C[stage]
    } else if stage > P::STAGES && stage <= P::STAGES + P::DENSE_STAGES {
        P::C_DENSE[stage - P::STAGES - 1]
    } else {
        1.0
    }
}

macro_rules! stages {
    ($run:ident, $h:ident, $from:expr, $to:expr, [$($i:literal)*]) => {
        $(if $i >= $from && $i < $to {
            $run.stage::<F, $i>($h);
        })*
    };
}

/// So much of its unit an energy of the ledger counts in the error.
const LEDGER: f64 = 0.1;

impl<'m, P: Pair, const EVENTS: bool> Run<'m, P, EVENTS> {
    fn new(course: Course<'m>, settings: &Settings, watch: bool) -> Self {
        let model = course.model;
        let size = course.y.len().next_multiple_of(TILE);
        let count = size / TILE;
        let (mut weight, mut relative) = (vec![[0.0; TILE]; count], vec![[0.0; TILE]; count]);
        let (body, watched) = (model.layout().body, model.layout().ledger_range().start);
        // Phases grow without bound and mean nothing modulo a turn: they are held absolutely, the body (see `weigh`) relatively too.
        weight.as_flattened_mut()[body..watched].fill(1.0);
        // The ledger feeds nothing back, yet a rest that is quadrature's own would accuse the motion.
        let unit_j = model.scene.body.ledger_unit_j();
        for d in watched..course.y.len() {
            weight.as_flattened_mut()[d] = LEDGER / unit_j;
            relative.as_flattened_mut()[d] = LEDGER / unit_j;
        }
        let tolerance = (settings.tolerance * P::SHARE).max(FINEST);
        let mut run = Self {
            course,
            tolerance,
            trust: TRUST.max(settings.tolerance / tolerance),
            k: vec![[[0.0; TILE]; MOST_STAGES]; count],
            dense: vec![[[0.0; TILE]; MOST_ROWS]; count],
            trial: vec![0.0; size],
            slope: vec![0.0; size],
            y1: vec![0.0; size],
            at: vec![0.0; size],
            weight,
            relative,
            watched,
            units: vec![0.0; body],
            moving: watched.div_ceil(TILE),
            looks: Looks::new(),
            margin_n: 0.0,
            watch,
            stiff_in_row: 0,
            row_began: (0.0, 0),
            method: std::marker::PhantomData,
        };
        run.course.y.resize(size, 0.0);
        run.course.w.least_load_n = if EVENTS { f64::NEG_INFINITY } else { 0.0 };
        run
    }

    #[inline(always)]
    fn integrate<F: Arithmetic>(&mut self, observer: &mut dyn Observer) -> Result<End, Stopped> {
        self.begin();
        let mut h_next = self.first_step();
        let mut first = FirstSteps::new();
        let mut ln_error_before = LEAST_ERROR.ln();
        let mut rejected_before = false;
        while !self.course.finished() {
            let t0 = self.course.t_s;
            let left = self.course.stop_s() - t0;
            // A remainder of a whole step or little more is taken in one; one of up to two steps in two equal halves.
            let mut h = if left <= h_next * 1.01 {
                left
            } else if left < 2.0 * h_next {
                0.5 * left
            } else {
                h_next
            };
            let error = loop {
                if h < smallest_step_s(t0) && h < left {
                    let (t_s, step_s) = (t0, h);
                    return Err(Stopped::StepTooSmall {
                        method: P::NAME,
                        t_s,
                        step_s,
                        tolerance: self.tolerance / P::SHARE,
                    });
                }
                let error = self.step::<F>(h);
                if error <= 1.0 {
                    break error;
                }
                self.course.stats.rejected += 1;
                rejected_before = true;
                h *= if error.is_finite() {
                    (SAFETY * error.powf(-P::EXPONENT)).clamp(SHRINK, 1.0)
                } else {
                    SHRINK
                };
                h_next = h;
            };
            if self.watch {
                self.note_stiffness(h);
            }
            // A step that was cut to meet a moment says nothing against a longer one.
            let cut = h < h_next;
            let mut t1 = if h == left {
                self.course.stop_s()
            } else {
                t0 + h
            };
            let moved = loop {
                match self.close::<F>(h, t1, observer)? {
                    // The polynomial is too rough to hold an event there: step to just beyond it, where it is exact.
                    Moved::Nowhere(theta) => {
                        h *= (1.001 * theta).min(0.9);
                        t1 = t0 + h;
                        self.step::<F>(h);
                    }
                    moved => break moved,
                }
            };
            let e = error.max(1e-10);
            first.held(|| {
                let could = (SAFETY * e.powf(-P::EXPONENT)).clamp(SHRINK, GROW);
                (!cut).then_some(h * could)
            });
            let ln_error = e.ln();
            let factor = SAFETY * (P::EXPONENT * (0.2 * ln_error_before - 0.8 * ln_error)).exp();
            let factor = factor.clamp(
                SHRINK,
                if rejected_before || moved == Moved::Event {
                    1.0
                } else {
                    GROW
                },
            );
            h_next = if h < h_next {
                h_next.max(h * factor)
            } else {
                h * factor
            };
            ln_error_before = ln_error.max(LEAST_ERROR.ln());
            rejected_before = false;
            if moved != Moved::On && !self.course.finished() {
                self.begin();
                self.stiff_in_row = 0;
                let resting = self.course.resting_handles();
                h_next = first.after(moved == Moved::Event, resting, h_next);
            }
            if self.stiff_in_row > MANY {
                let (t_s, evaluations) = self.row_began;
                let spent = (self.course.stats.evaluations - evaluations) as f64;
                let evaluations_per_s = spent / (self.course.t_s - t_s);
                return Ok(End::Stiff { evaluations_per_s });
            }
        }
        Ok(End::Finished)
    }

    /// Counts accepted steps at the edge of stability: h |λ| from the last two stages, both at the end of the step. Source:
    /// Hairer & Wanner, Solving Ordinary Differential Equations II (1996), IV.2.
    fn note_stiffness(&mut self, h: f64) {
        let (mut rates, mut states) = (0.0, 0.0);
        let ends = tiles(&self.y1).iter().zip(tiles(&self.trial));
        let moving = self.k[..self.moving].iter().zip(ends).zip(&self.weight);
        for (tile, ((k, (y1, trial)), weight)) in moving.enumerate() {
            // The ledger, which may share the last of these tiles, is not in `trial`.
            for l in 0..TILE.min(self.watched - tile * TILE) {
                let w = weight[l];
                rates += ((k[P::STAGES][l] - k[P::STAGES - 1][l]) * w).powi(2);
                states += ((y1[l] - trial[l]) * w).powi(2);
            }
        }
        if self.stiff_in_row == 0 {
            self.row_began = (self.course.t_s, self.course.stats.evaluations);
        }
        if h * h * rates > P::STABLE * P::STABLE * states {
            self.stiff_in_row += 1;
        } else {
            self.stiff_in_row = self.stiff_in_row.saturating_sub(3);
        }
    }

    /// Gives each of the body's states the unit that it has at the present state.
    #[inline(always)]
    fn weigh(&mut self) {
        let course = &self.course;
        let model = course.model;
        model.units(&course.y, &course.w, SLOWEST_PER_S, &mut self.units);
        for (d, unit) in self.units.iter().enumerate() {
            self.weight.as_flattened_mut()[d] = 1.0 / unit;
            self.relative.as_flattened_mut()[d] = 1.0 / unit;
        }
    }

    /// The first slope after a switch or an event.
    fn begin(&mut self) {
        self.weigh();
        self.course.slope(&mut self.slope);
        self.margin_n = self.course.margin_n();
        for (k, slope) in self.k.iter_mut().zip(tiles(&self.slope)) {
            k[0] = *slope;
        }
    }

    /// A first step: a tenth of the time in which the state would change by one unit, at tolerance 1; the error refines it.
    fn first_step(&self) -> f64 {
        let speed = self.norm(|tile, l| self.k[tile][0][l], 1.0);
        let h = 0.1 * self.tolerance.powf(0.125) / speed.max(1e-3);
        h.clamp(1e-9, (self.course.stop_s() - self.course.t_s).max(1e-9))
    }

    /// Root mean square in units of `tolerance` over the watched states.
    #[inline(always)]
    fn norm(&self, of: impl Fn(usize, usize) -> f64, tolerance: f64) -> f64 {
        let mut total = 0.0;
        for (tile, y) in tiles(&self.course.y).iter().enumerate() {
            for l in 0..TILE {
                let x = of(tile, l) * self.weight[tile][l]
                    / (1.0 + self.relative[tile][l] * y[l].abs());
                total += x * x;
            }
        }
        (total / self.watched as f64).sqrt() / tolerance
    }

    /// Stage `I` of a step of size h: its state from the earlier stages, its slope from the model.
    #[inline(always)]
    fn stage<F: Arithmetic, const I: usize>(&mut self, h: f64) {
        // The ledger feeds nothing back: its state is not asked for before the step's end.
        let (into, tiled) = if I == P::STAGES {
            (&mut self.y1, self.k.len())
        } else {
            (&mut self.trial, self.moving)
        };
        for ((k, y), out) in self.k[..tiled]
            .iter()
            .zip(tiles(&self.course.y))
            .zip(tiles_mut(into))
        {
            *out = F::axpy(h, &sum::<F>(const { row::<P>(I) }, k), y);
        }
        let t = self.course.t_s + const { time::<P>(I) } * h;
        let kept = if I <= P::PASSING {
            self.course.rhs_of_motion(t, into, &mut self.slope);
            self.moving
        } else {
            self.course.rhs(t, into, &mut self.slope);
            self.k.len()
        };
        for (k, slope) in self.k[..kept].iter_mut().zip(tiles(&self.slope)) {
            k[I] = *slope;
        }
        // What is there at the start is known, and better than from a stage that comes back to it.
        if EVENTS && I <= P::STAGES && const { time::<P>(I) > 0.0 } {
            self.looks
                .note(const { time::<P>(I) }, self.course.margin_n());
        }
    }

    /// A step of size h from the present state into `y1`; its error in units of the tolerance.
    #[inline(always)]
    fn step<F: Arithmetic>(&mut self, h: f64) -> f64 {
        if EVENTS {
            self.looks.clear();
            self.looks.note_start(self.margin_n);
        }
        stages!(self, h, 1, P::STAGES + 1, [1 2 3 4 5 6 7 8 9 10 11 12 13 14 15]);
        let mut squares = [0.0; 2];
        let states = tiles(&self.course.y).iter().zip(tiles(&self.y1));
        for ((k, (y0, y1)), (weight, relative)) in self
            .k
            .iter()
            .zip(states)
            .zip(self.weight.iter().zip(&self.relative))
        {
            let [a, b] = P::errors::<F>(k);
            let mut tile = [[0.0; TILE]; 2];
            for l in 0..TILE {
                let w = weight[l] / F::madd(relative[l], y0[l].abs().max(y1[l].abs()), 1.0);
                tile[0][l] = (a[l] * w) * (a[l] * w);
                tile[1][l] = (b[l] * w) * (b[l] * w);
            }
            for (square, tile) in squares.iter_mut().zip(tile) {
                *square += tile.into_iter().sum::<f64>();
            }
        }
        let friction = self.course.model.has_friction();
        P::error(h, squares, self.watched as f64, friction) / self.tolerance
    }

    /// Hands over what lies within an accepted step and moves to its end, or to the first event.
    #[inline(always)]
    fn close<F: Arithmetic>(
        &mut self,
        h: f64,
        t1: f64,
        observer: &mut dyn Observer,
    ) -> Result<Moved, Stopped> {
        let inner = t1 - 2.0 * same_moment_s(t1);
        let suspicious = EVENTS && self.looks.suspicious();
        if suspicious || self.course.sample_due(inner).is_some() {
            return self.close_with_care::<F>(h, t1, suspicious, observer);
        }
        // The last stage was at the end.
        self.arrive_at_y1(t1, true, observer)
    }

    #[inline(always)]
    fn arrive_at_y1(
        &mut self,
        t1: f64,
        mut evaluated: bool,
        observer: &mut dyn Observer,
    ) -> Result<Moved, Stopped> {
        std::mem::swap(&mut self.course.y, &mut self.y1);
        let switched = t1 >= self.course.stop_s();
        while self.course.sample_due(t1).is_some() {
            self.at.copy_from_slice(&self.course.y);
            evaluated = self.course.sample(&self.at, evaluated, observer)?;
        }
        self.course.arrive(t1, evaluated, observer)?;
        if switched {
            return Ok(Moved::Switched);
        }
        self.weigh();
        for k in &mut self.k {
            k[0] = k[P::STAGES];
        }
        if EVENTS {
            self.margin_n = self.looks.latest();
        }
        Ok(Moved::On)
    }

    #[inline(always)]
    fn close_with_care<F: Arithmetic>(
        &mut self,
        h: f64,
        t1: f64,
        suspicious: bool,
        observer: &mut dyn Observer,
    ) -> Result<Moved, Stopped> {
        let t0 = self.course.t_s;
        const {
            let (from, to) = (P::STAGES + 1, P::STAGES + 1 + P::DENSE_STAGES);
            assert!(from == to || from >= 7 && to <= 16, "list the stages here");
        }
        stages!(self, h, P::STAGES + 1, P::STAGES + 1 + P::DENSE_STAGES, [7 8 9 10 11 12 13 14 15]);
        for ((out, k), (y0, y1)) in self
            .dense
            .iter_mut()
            .zip(&self.k)
            .zip(tiles(&self.course.y).iter().zip(tiles(&self.y1)))
        {
            P::dense::<F>(h, y0, y1, k, out);
        }
        let last = self.norm(
            |tile, l| self.dense[tile][P::DENSE_ROWS - 1][l],
            self.tolerance,
        );
        let mut event = None;
        if suspicious {
            let (course, dense, at) = (&mut self.course, &self.dense, &mut self.at);
            let resolution = (0.25 * same_moment_s(t0) / h).max(2.0 * f64::EPSILON);
            event = events::first(&self.looks, resolution, |theta| {
                // Plain: a closure does not inherit the processor features of its caller.
                interpolate::<P, Plain>(theta, &course.y, dense, at);
                course.margin_at_n(t0 + theta * h, at)
            });
        }
        // Of the shortest step the last term is rounding, whatever it says.
        let rough = |&theta: &f64| last * P::last_term(theta) > TRUST && h > smallest_step_s(t0);
        if let Some(theta) = event.filter(rough) {
            return Ok(Moved::Nowhere(theta));
        }
        let end = event.map_or(t1 - 2.0 * same_moment_s(t1), |theta| t0 + theta * h);
        while let Some(t) = self.course.sample_due(end) {
            self.between::<F>(((t - t0) / h).clamp(0.0, 1.0), h, last);
            self.course.model.freedoms().project(&mut self.at);
            self.course.sample(&self.at, false, observer)?;
        }
        let Some(theta) = event else {
            // Stepping to a sample leaves another end behind.
            if self.looks.spoilt() {
                self.step::<F>(h);
            }
            return self.arrive_at_y1(t1, false, observer);
        };
        interpolate::<P, F>(theta, &self.course.y, &self.dense, &mut self.at);
        std::mem::swap(&mut self.course.y, &mut self.at);
        self.course.arrive(t0 + theta * h, false, observer)?;
        self.course.fire(observer);
        Ok(Moved::Event)
    }

    /// Puts the state at `theta` of the step into `at`: off the polynomial where that is good enough, else by a step.
    #[inline(always)]
    fn between<F: Arithmetic>(&mut self, theta: f64, h: f64, last: f64) {
        if last * P::last_term(theta) <= self.trust {
            interpolate::<P, F>(theta, &self.course.y, &self.dense, &mut self.at);
        } else {
            // The polynomial is spoilt by this, but whoever does not trust it at one place does not read it at another.
            self.step::<F>(theta * h);
            self.at.copy_from_slice(&self.y1);
            self.looks.spoil();
        }
    }
}

/// The dense state of all tiles.
#[inline(always)]
fn interpolate<P: Pair, F: Arithmetic>(
    theta: f64,
    y0: &[f64],
    dense: &[Polynomial],
    out: &mut [f64],
) {
    for ((o, y), rows) in tiles_mut(out).iter_mut().zip(tiles(y0)).zip(dense) {
        *o = P::interpolate::<F>(theta, y, rows);
    }
}

/// How a step ended.
#[derive(Clone, Copy, PartialEq)]
enum Moved {
    /// At its end.
    On,
    /// At its end, where the right-hand side jumps.
    Switched,
    /// At an event.
    Event,
    /// Not yet: there is an event at this part of the step, but the polynomial does not hold it.
    Nowhere(f64),
}

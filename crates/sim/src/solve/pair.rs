//! Adaptive embedded Runge–Kutta pairs with dense output and located contact events.
//!
//! A step is taken with every contact frozen as it was at its start, so the method sees a smooth right-hand side. Each
//! stage gives the contacts' margins for nothing; when one is negative anywhere in an accepted step, dense output is
//! searched for the first zero, the step is cut there, and the contact changes. An event fires on (t₀, t₁]; the state at
//! the event has a margin that is zero or past it, so the next step does not find the same zero again. The step size is
//! controlled by a PI controller: Hairer, Nørsett, Wanner, Solving ODEs I (1993), II.4 and IV.2.

use super::course::{Course, SAME_MOMENT_S};
use super::{Observer, Settings, Stats, Stopped};
use crate::model::Model;

/// Coefficients `(stage, a)` of one stage, zeros left out.
pub type Row = &'static [(usize, f64)];

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
    /// The exponent of the step-size law: one over the order of the error estimate.
    const EXPONENT: f64;
    /// Coefficients of the dense polynomial needed per state.
    const DENSE_ROWS: usize;

    /// Error of the step in units of the tolerance (root mean square over `scale.len()` states), given the stages.
    fn error(h: f64, k: &Stages, scale: &[f64]) -> f64;
    /// Prepares the dense polynomial.
    fn dense(h: f64, y0: &[f64], y1: &[f64], k: &Stages, out: &mut [Vec<f64>]);
    /// Evaluates it at `theta` in 0…1.
    fn interpolate(theta: f64, y0: &[f64], rows: &[Vec<f64>], out: &mut [f64]);
}

/// Stage derivatives k_i.
pub struct Stages {
    k: Vec<Vec<f64>>,
}

impl Stages {
    fn new(stages: usize, size: usize) -> Self {
        Self { k: vec![vec![0.0; size]; stages] }
    }

    /// k_i
    #[inline(always)]
    pub fn get(&self, i: usize) -> &[f64] {
        &self.k[i]
    }

    /// Σ a_j k_j of state `d`.
    #[inline(always)]
    pub fn sum(&self, row: Row, d: usize) -> f64 {
        row.iter().map(|&(j, a)| a * self.k[j][d]).sum()
    }

    /// out = y + h Σ a_j k_j
    #[inline(always)]
    fn advance(&self, y: &[f64], h: f64, row: Row, out: &mut [f64]) {
        let n = out.len();
        let y = &y[..n];
        out.copy_from_slice(y);
        // Row by row over contiguous states: each pass is a vector multiply-add.
        for &(j, a) in row {
            let ha = h * a;
            for (o, k) in out.iter_mut().zip(&self.k[j][..n]) {
                *o += ha * k;
            }
        }
    }
}

/// Root mean square of `e_d / scale_d`.
#[inline(always)]
pub fn rms(scale: &[f64], e: impl Fn(usize) -> f64) -> f64 {
    let mut sum = 0.0;
    for (d, s) in scale.iter().enumerate() {
        let x = e(d) / s;
        sum += x * x;
    }
    (sum / scale.len() as f64).sqrt()
}

const SAFETY: f64 = 0.9;
const SHRINK: f64 = 0.2;
const GROW: f64 = 6.0;
const SMALLEST_STEP_S: f64 = 1e-13;
/// Most points at which a suspicious step is looked at before its dense output is believed to have no event.
const LOOKS: usize = 8;

/// Integrates a model with pair `P`; with `EVENTS` contacts are frozen within a step and their changes located.
pub fn run<P: Pair, const EVENTS: bool>(
    model: &Model,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> (Stats, Result<(), Stopped>) {
    let mut course = Course::new(model, P::NAME, settings, EVENTS);
    let outcome = integrate::<P, EVENTS>(&mut course, settings, observer);
    (course.stats, outcome)
}

fn integrate<P: Pair, const EVENTS: bool>(
    course: &mut Course,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> Result<(), Stopped> {
    let size = course.y.len();
    let watched = course.model.layout().ledger_range().start;
    let units: Vec<f64> = {
        let mut units = course.model.freedoms().scales().to_vec();
        units.resize(watched, 1.0);
        units
    };
    let mut k = Stages::new(P::STAGES + 1 + P::DENSE_STAGES, size);
    let mut trial = vec![0.0; size];
    let mut y1 = vec![0.0; size];
    let mut at = vec![0.0; size];
    let mut dense = vec![vec![0.0; size]; P::DENSE_ROWS];
    let mut scale = vec![0.0; watched];
    let last = P::STAGES;

    let y0 = course.y.clone();
    while course.sample_due(course.t_s).is_some() {
        course.sample(&y0, observer)?;
    }
    let (t, y) = (course.t_s, course.y.clone());
    course.rhs(t, &y, &mut k.k[0]);
    let mut h_next = first_step(&y, k.get(0), &units, settings.tolerance, course.stop_s());
    let mut error_before: f64 = 1e-4;
    let mut rejected_before = false;

    while !course.finished() {
        let t0 = course.t_s;
        let left = course.stop_s() - t0;
        // A remainder of a whole step or little more is taken in one; one of up to two steps in two equal halves.
        let mut h = if left <= h_next * 1.01 {
            left
        } else if left < 2.0 * h_next {
            0.5 * left
        } else {
            h_next
        };
        let error = loop {
            if h < SMALLEST_STEP_S && h < left {
                return Err(Stopped::StepTooSmall { method: P::NAME, t_s: t0, step_s: h, tolerance: settings.tolerance });
            }
            let mut margin = f64::INFINITY;
            for i in 1..P::STAGES {
                k.advance(&course.y, h, P::A[i - 1], &mut trial);
                course.rhs(t0 + P::C[i] * h, &trial, &mut k.k[i]);
                if EVENTS {
                    margin = margin.min(course.margin_n());
                }
            }
            k.advance(&course.y, h, P::B, &mut y1);
            let t1 = if h == left { course.stop_s() } else { t0 + h };
            course.rhs(t1, &y1, &mut k.k[last]);
            if EVENTS {
                margin = margin.min(course.margin_n());
            }
            for d in 0..watched {
                scale[d] = settings.tolerance * (units[d] + relative_part(course, d, course.y[d].abs().max(y1[d].abs())));
            }
            let error = P::error(h, &k, &scale);
            if error <= 1.0 {
                if EVENTS && margin < 0.0 {
                    prepare::<P>(course, t0, h, &mut k, &y1, &mut trial, &mut dense);
                    if let Some(theta) = first_event::<P>(course, t0, h, &dense, &mut at) {
                        let t_event = t0 + theta * h;
                        emit::<P>(course, t0, h, t_event, &dense, &mut at, observer)?;
                        P::interpolate(theta, &course.y, &dense, &mut at);
                        course.y.copy_from_slice(&at);
                        course.arrive(t_event, observer)?;
                        course.fire(observer);
                        break None;
                    }
                    emit::<P>(course, t0, h, t1 - 2.0 * SAME_MOMENT_S, &dense, &mut at, observer)?;
                } else if course.sample_due(t1 - 2.0 * SAME_MOMENT_S).is_some() {
                    prepare::<P>(course, t0, h, &mut k, &y1, &mut trial, &mut dense);
                    emit::<P>(course, t0, h, t1 - 2.0 * SAME_MOMENT_S, &dense, &mut at, observer)?;
                }
                course.y.copy_from_slice(&y1);
                let switch = t1 >= course.stop_s();
                while course.sample_due(t1).is_some() {
                    course.sample(&y1, observer)?;
                }
                course.arrive(t1, observer)?;
                if !switch {
                    k.k.swap(0, last);
                }
                break Some((error, switch));
            }
            course.stats.rejected += 1;
            rejected_before = true;
            h *= if error.is_finite() { (SAFETY * error.powf(-P::EXPONENT)).clamp(SHRINK, 1.0) } else { SHRINK };
            h_next = h;
        };
        match error {
            Some((error, switch)) => {
                let e = error.max(1e-10);
                let factor = SAFETY * e.powf(-P::EXPONENT * 0.8) * error_before.powf(P::EXPONENT * 0.2);
                let factor = factor.clamp(SHRINK, if rejected_before { 1.0 } else { GROW });
                // A step that was cut to meet a moment says nothing against a longer one.
                h_next = if h < h_next { h_next.max(h * factor) } else { h * factor };
                error_before = e.max(1e-4);
                rejected_before = false;
                if switch && !course.finished() {
                    let (t, y) = (course.t_s, std::mem::take(&mut course.y));
                    course.rhs(t, &y, &mut k.k[0]);
                    course.y = y;
                }
            }
            None => {
                let (t, y) = (course.t_s, std::mem::take(&mut course.y));
                course.rhs(t, &y, &mut k.k[0]);
                course.y = y;
                rejected_before = false;
            }
        }
        h = h_next;
        h_next = h;
    }
    Ok(())
}

/// Phases grow without bound and mean nothing modulo a turn: they are held absolutely, the body relatively too.
#[inline(always)]
fn relative_part(course: &Course, d: usize, size: f64) -> f64 {
    if d < course.model.layout().body { size } else { 0.0 }
}

/// A first step: a hundredth of the time in which the state would change by one unit, refined by the error at once.
fn first_step(y: &[f64], f: &[f64], units: &[f64], tolerance: f64, most_s: f64) -> f64 {
    let speed = rms(units, |d| f[d] / (1.0 + y[d].abs()));
    let h = 0.1 * tolerance.powf(0.125) / speed.max(1e-3);
    h.clamp(1e-9, most_s.max(1e-9))
}

fn prepare<P: Pair>(
    course: &mut Course,
    t0: f64,
    h: f64,
    k: &mut Stages,
    y1: &[f64],
    trial: &mut [f64],
    dense: &mut [Vec<f64>],
) {
    for i in 0..P::DENSE_STAGES {
        k.advance(&course.y, h, P::A_DENSE[i], trial);
        course.rhs(t0 + P::C_DENSE[i] * h, trial, &mut k.k[P::STAGES + 1 + i]);
    }
    P::dense(h, &course.y, y1, k, dense);
}

/// Hands over every sample in (t₀, until].
fn emit<P: Pair>(
    course: &mut Course,
    t0: f64,
    h: f64,
    until_s: f64,
    dense: &[Vec<f64>],
    at: &mut [f64],
    observer: &mut dyn Observer,
) -> Result<(), Stopped> {
    while let Some(t) = course.sample_due(until_s) {
        P::interpolate(((t - t0) / h).clamp(0.0, 1.0), &course.y, dense, at);
        course.model.freedoms().project(at);
        course.sample(at, observer)?;
    }
    Ok(())
}

/// The first place in (0, 1] where the margin has become negative, to within [`SAME_MOMENT_S`] of its zero.
fn first_event<P: Pair>(course: &mut Course, t0: f64, h: f64, dense: &[Vec<f64>], at: &mut [f64]) -> Option<f64> {
    let mut margin = |theta: f64, course: &mut Course| {
        P::interpolate(theta, &course.y, dense, at);
        course.margin_at_n(t0 + theta * h, at)
    };
    let (mut a, mut fa) = (0.0, margin(0.0, course).max(0.0));
    let (mut b, mut fb) = (0.0, fa);
    for look in 1..=LOOKS {
        (b, fb) = (look as f64 / LOOKS as f64, 0.0);
        fb += margin(b, course);
        if fb < 0.0 {
            break;
        }
        (a, fa) = (b, fb);
    }
    if fb >= 0.0 {
        return None;
    }
    // ITP (Oliveira & Takahashi 2020): no slower than bisection, as fast as the secant method on a smooth margin.
    let resolution = (0.5 * SAME_MOMENT_S / h).max(4.0 * f64::EPSILON);
    let (kappa, slack) = (0.2 / (b - a), 1.0);
    let halvings = ((b - a) / (2.0 * resolution)).log2().ceil().max(0.0) + slack;
    let mut j = 0.0;
    while b - a > 2.0 * resolution {
        let middle = 0.5 * (a + b);
        let secant = (fb * a - fa * b) / (fb - fa);
        let sign = (middle - secant).signum();
        let push = kappa * (b - a) * (b - a);
        let truncated = if push <= (middle - secant).abs() { secant + sign * push } else { middle };
        let radius = resolution * (halvings - j).exp2() - 0.5 * (b - a);
        let theta = if (truncated - middle).abs() <= radius { truncated } else { middle - sign * radius };
        let f = margin(theta, course);
        if f > 0.0 {
            (a, fa) = (theta, f);
        } else {
            (b, fb) = (theta, f);
            if f == 0.0 {
                break;
            }
        }
        j += 1.0;
    }
    Some(b)
}

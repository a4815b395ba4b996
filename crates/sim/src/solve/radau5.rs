//! Radau IIA of order 5: implicit, stiffly accurate, L-stable; for contacts so stiff that explicit steps would be limited by
//! stability instead of accuracy.
//!
//! ```text
//! Z_i = h Σ_j a_ij f(t₀ + c_j h, y₀ + Z_j),  i, j = 1…3        y₁ = y₀ + Z₃
//! ```
//! The three stages are solved together by a simplified Newton iteration, transformed to one real and one complex system of the size
//! of the state; the Jacobian is exact, by automatic differentiation of the model ([`Differentiator`]). Dense output is the collocation polynomial (order 3): where its last term is not small against the tolerance, the step is
//! taken anew to the moment that is asked for. Within a step contacts are frozen, as in [`super::pair`].
//!
//! Source: Hairer & Wanner, Solving Ordinary Differential Equations II, 2nd ed. (1996), IV.8; constants and step-size control as in
//! `scipy.integrate.Radau` (BSD-3-Clause).

use super::course::{Course, just_before_s, same_moment_s, smallest_step_s};
use super::events::{self, Looks};
use super::{Observer, Settings, Stats, Stopped};
use crate::model::{Differentiator, Model};
use nalgebra::{Complex, DMatrix, DVector, Dyn, LU};

const NAME: &str = "radau5";
const SQRT_6: f64 = 2.449489742783178;
const C: [f64; 3] = [(4.0 - SQRT_6) / 10.0, (4.0 + SQRT_6) / 10.0, 1.0];
const E: [f64; 3] = [
    (-13.0 - 7.0 * SQRT_6) / 3.0,
    (-13.0 + 7.0 * SQRT_6) / 3.0,
    -1.0 / 3.0,
];
/// (a_ij)
const A: [[f64; 3]; 3] = [
    [
        (88.0 - 7.0 * SQRT_6) / 360.0,
        (296.0 - 169.0 * SQRT_6) / 1800.0,
        (-2.0 + 3.0 * SQRT_6) / 225.0,
    ],
    [
        (296.0 + 169.0 * SQRT_6) / 1800.0,
        (88.0 + 7.0 * SQRT_6) / 360.0,
        (-2.0 - 3.0 * SQRT_6) / 225.0,
    ],
    [(16.0 - SQRT_6) / 36.0, (16.0 + SQRT_6) / 36.0, 1.0 / 9.0],
];
/// Eigenvalues of the inverse of (a_ij): 3 + 3^⅔ − 3^⅓, and its complex pair.
const MU_REAL: f64 = 3.637834252744496;
const MU_COMPLEX: Complex<f64> = Complex::new(2.681082873627752, -3.0504301992474105);
/// (a_ij) = T Λ T⁻¹
const T: [[f64; 3]; 3] = [
    [
        0.09443876248897524,
        -0.14125529502095421,
        0.03002919410514742,
    ],
    [
        0.25021312296533332,
        0.20412935229379994,
        -0.38294211275726192,
    ],
    [1.0, 1.0, 0.0],
];
const T_INVERSE: [[f64; 3]; 3] = [
    [
        4.17871859155190428,
        0.32768282076106237,
        0.52337644549944951,
    ],
    [
        -4.17871859155190428,
        -0.32768282076106237,
        0.47662355450055044,
    ],
    [
        0.50287263494578682,
        -2.57192694985560522,
        0.59603920482822492,
    ],
];
/// The collocation polynomial: y(θ) = y₀ + Σ_k θ^(k+1) Σ_i P_ik Z_i.
const P: [[f64; 3]; 3] = [
    [
        13.0 / 3.0 + 7.0 * SQRT_6 / 3.0,
        -23.0 / 3.0 - 22.0 * SQRT_6 / 3.0,
        10.0 / 3.0 + 5.0 * SQRT_6,
    ],
    [
        13.0 / 3.0 - 7.0 * SQRT_6 / 3.0,
        -23.0 / 3.0 + 22.0 * SQRT_6 / 3.0,
        10.0 / 3.0 - 5.0 * SQRT_6,
    ],
    [1.0 / 3.0, -8.0 / 3.0, 10.0 / 3.0],
];

/// Evaluations that take about as long as the derivatives in eight directions (measured: 13 to 21).
const EVALUATIONS_IN_A_SWEEP: u64 = 16;
const MOST_ITERATIONS: u32 = 6;
const SHRINK: f64 = 0.2;
const GROW: f64 = 8.0;
/// A step that could grow by less keeps its size, and with it the factors of its matrices.
const KEEP: f64 = 1.2;
/// What a step may err, in units of the tolerance asked for; as [`super::pair::Pair::SHARE`].
const SHARE: f64 = 3e-2;
/// Below this a step's error estimate is rounding.
const FINEST: f64 = 1e-14;
/// The last term of the dense polynomial may be so many times the tolerance where a sample is read off it, for its error is well below its last term; and
/// where the course goes on from it, behind an event. With 10 there too, `music` (seed 7) erred by 98 tolerances at 1e-8 for 1.4, `baseline` by 19 for 1.2, for one
/// evaluation in a hundred less.
const TRUST: f64 = 10.0;
const TRUST_ON: f64 = 1e-3;
/// Where the polynomial does not hold an event, the step is taken anew to just behind it: by this share of itself, and a hundredth of that the next time.
const BEHIND: f64 = 1e-3;
/// An event in this last part of a step is at its end.
const AT_END: f64 = 1e-9;
/// Where within a step the contacts' margins are looked at.
const LOOKS: [f64; 8] = [0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0];
/// More states than this make the dense matrices a burden that no stiffness is worth.
const MOST_STATES: usize = 2000;

/// Integrates a model; with `EVENTS` contacts are frozen within a step and their changes located.
pub fn run<const EVENTS: bool>(
    model: &Model,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> (Stats, Result<(), Stopped>) {
    let mut course = Course::new(model, NAME, settings, EVENTS);
    let outcome = course
        .begin_log(observer)
        .and_then(|()| integrate::<EVENTS>(&mut course, settings, None, observer))
        .map(|_| ());
    (course.stats, outcome)
}

/// Goes on from where a course stands, to its end (`true`), or until more evaluations per second have been spent than `rival_per_s`,
/// the price of the method it was called in for (`false`).
pub fn integrate<const EVENTS: bool>(
    course: &mut Course<'_>,
    settings: &Settings,
    rival_per_s: Option<f64>,
    observer: &mut dyn Observer,
) -> Result<bool, Stopped> {
    let size = course.model.layout().size();
    if size > MOST_STATES {
        return Err(Stopped::TooManyStates {
            method: NAME,
            states: size,
            most: MOST_STATES,
        });
    }
    // Frozen behind a lift-off, a stiff contact pulls with many times the weight: what goes with the load must not follow it there.
    course.w.least_load_n = 0.0;
    let mut radau = Radau::new(course, settings);
    let (began_s, began) = (course.t_s, course.stats);
    while !course.finished() {
        radau.advance::<EVENTS>(course, observer)?;
        if let Some(rival) = rival_per_s {
            let spent = (course.stats.evaluations - began.evaluations) as f64;
            if course.stats.steps - began.steps > 40 && spent > rival * (course.t_s - began_s) {
                return Ok(false);
            }
        }
    }
    Ok(true)
}

type Factors<N> = LU<N, Dyn, Dyn>;

#[derive(Clone)]
struct Radau<'m> {
    tolerance: f64,
    asked: f64,
    newton: f64,
    /// States whose error counts and that are solved for; the ledger behind them follows from their rates.
    watched: usize,
    /// What is absolute and what is relative in the unit of each state: unit + factor |y|.
    unit: Vec<f64>,
    factor: Vec<f64>,
    differentiator: Differentiator<'m>,
    jacobian: DMatrix<f64>,
    /// Whether it belongs to the present state.
    fresh: bool,
    factors: Option<(f64, Factors<f64>, Factors<Complex<f64>>)>,
    slope: Vec<f64>,
    at: Vec<f64>,
    stages: [Vec<f64>; 3],
    rates: [Vec<f64>; 3],
    weights: [Vec<f64>; 3],
    /// Coefficients of the dense polynomial, and the step it is of; none after an event or a switch.
    dense: [Vec<f64>; 3],
    dense_step_s: Option<f64>,
    h_s: f64,
    before: Option<(f64, f64)>,
    looks: Looks,
    /// The margin at the start of the step.
    margin_n: f64,
}

impl<'m> Radau<'m> {
    fn new(course: &mut Course<'m>, settings: &Settings) -> Self {
        let layout = course.model.layout();
        let (size, watched) = (layout.size(), layout.ledger_range().start);
        let (body, scales) = (layout.body, course.model.freedoms().scales());
        let tolerance = (settings.tolerance * SHARE).max(FINEST);
        let blank = || std::array::from_fn(|_| vec![0.0; size]);
        course.y.truncate(size);
        let mut radau = Self {
            tolerance,
            asked: settings.tolerance,
            newton: (10.0 * f64::EPSILON / tolerance).max(tolerance.sqrt().min(0.03)),
            watched,
            unit: (0..size)
                .map(|d| if d < body { scales[d] } else { 1.0 })
                .collect(),
            factor: (0..size)
                .map(|d| if d < body { 1.0 } else { 0.0 })
                .collect(),
            differentiator: Differentiator::new(course.model, &course.w),
            jacobian: DMatrix::zeros(watched, watched),
            fresh: false,
            factors: None,
            slope: vec![0.0; size],
            at: vec![0.0; size],
            stages: blank(),
            rates: blank(),
            weights: blank(),
            dense: blank(),
            dense_step_s: None,
            h_s: 0.0,
            before: None,
            looks: Looks::new(),
            margin_n: 0.0,
        };
        radau.begin(course);
        let speed = radau.norm(&radau.slope, &course.y) * tolerance;
        radau.h_s = (0.1 * tolerance.powf(0.25) / speed.max(1e-3)).clamp(1e-9, 1.0);
        radau
    }

    /// Slope and Jacobian anew: the state or its law has changed at once.
    fn begin(&mut self, course: &mut Course<'_>) {
        course.slope(&mut self.slope);
        self.margin_n = course.margin_n();
        self.differentiate(course);
        (self.dense_step_s, self.before) = (None, None);
    }

    /// ∂f/∂y of the watched states. Nothing depends on the ledger.
    fn differentiate(&mut self, course: &mut Course<'_>) {
        let (t, w) = (course.t_s, &course.w);
        self.differentiator
            .jacobian(t, &course.y, w, &mut self.jacobian);
        course.stats.evaluations += self.differentiator.sweeps() as u64 * EVALUATIONS_IN_A_SWEEP;
        (self.fresh, self.factors) = (true, None);
    }

    /// Root mean square of the watched states in units of the tolerance.
    fn norm(&self, x: &[f64], y: &[f64]) -> f64 {
        let of = |d: usize| x[d] / (self.unit[d] + self.factor[d] * y[d].abs());
        let total: f64 = (0..self.watched).map(|d| of(d).powi(2)).sum();
        (total / self.watched as f64).sqrt() / self.tolerance
    }

    fn factorise(&mut self, h: f64) {
        if self.factors.as_ref().is_some_and(|(of, ..)| *of == h) {
            return;
        }
        let n = self.jacobian.nrows();
        let real = DMatrix::from_diagonal_element(n, n, MU_REAL / h) - &self.jacobian;
        let complex = DMatrix::from_fn(n, n, |i, j| {
            let own = if i == j {
                MU_COMPLEX / h
            } else {
                Complex::ZERO
            };
            own - self.jacobian[(i, j)]
        });
        self.factors = Some((h, real.lu(), complex.lu()));
    }

    /// Solves the stages of a step; `None` where the iteration does not converge, else how many rounds it took.
    fn stages(&mut self, course: &mut Course<'_>, h: f64) -> Option<u32> {
        self.factorise(h);
        let (size, watched) = (self.slope.len(), self.watched);
        for i in 0..3 {
            // The last polynomial, prolonged.
            let theta = self.dense_step_s.map(|old| 1.0 + C[i] * h / old);
            for d in 0..watched {
                let [a, b, c] = [0, 1, 2].map(|k| self.dense[k][d]);
                self.stages[i][d] = theta.map_or(0.0, |theta| {
                    theta * (a + theta * (b + theta * c)) - (a + b + c)
                });
            }
        }
        for d in 0..watched {
            for i in 0..3 {
                self.weights[i][d] = (0..3).map(|j| T_INVERSE[i][j] * self.stages[j][d]).sum();
            }
        }
        let mut before: Option<f64> = None;
        for round in 1..=MOST_ITERATIONS {
            for i in 0..3 {
                for d in 0..watched {
                    self.at[d] = course.y[d] + self.stages[i][d];
                }
                course.rhs(course.t_s + C[i] * h, &self.at, &mut self.rates[i]);
                if !self.rates[i].iter().all(|f| f.is_finite()) {
                    return None;
                }
            }
            let (_, real, complex) = self.factors.as_ref()?;
            let of = |row: usize, d: usize| -> f64 {
                (0..3).map(|j| T_INVERSE[row][j] * self.rates[j][d]).sum()
            };
            let mut first =
                DVector::from_fn(watched, |d, _| of(0, d) - MU_REAL / h * self.weights[0][d]);
            let mut pair = DVector::from_fn(watched, |d, _| {
                Complex::new(of(1, d), of(2, d))
                    - MU_COMPLEX / h * Complex::new(self.weights[1][d], self.weights[2][d])
            });
            if !real.solve_mut(&mut first) || !complex.solve_mut(&mut pair) {
                return None;
            }
            let mut change = 0.0;
            for d in 0..watched {
                let moves = [first[d], pair[d].re, pair[d].im];
                for (weight, by) in self.weights.iter_mut().zip(moves) {
                    weight[d] += by;
                }
                let unit = self.unit[d] + self.factor[d] * course.y[d].abs();
                change += moves.iter().map(|x| (x / unit).powi(2)).sum::<f64>();
            }
            let change = (change / (3 * self.watched) as f64).sqrt() / self.tolerance;
            let rate = before.map(|before| change / before);
            let hopeless = |rate: f64| {
                let left = MOST_ITERATIONS - round;
                rate >= 1.0 || rate.powi(left as i32) / (1.0 - rate) * change > self.newton
            };
            if !change.is_finite() || rate.is_some_and(hopeless) {
                return None;
            }
            for d in 0..watched {
                for i in 0..3 {
                    self.stages[i][d] = (0..3).map(|j| T[i][j] * self.weights[j][d]).sum();
                }
            }
            for d in watched..size {
                for i in 0..3 {
                    self.stages[i][d] = h * (0..3).map(|j| A[i][j] * self.rates[j][d]).sum::<f64>();
                }
            }
            if change == 0.0 || rate.is_some_and(|r| r / (1.0 - r) * change < self.newton) {
                return Some(round);
            }
            before = Some(change);
        }
        None
    }

    /// The error of the step in units of the tolerance.
    fn error(&mut self, course: &mut Course<'_>, h: f64, again: bool) -> f64 {
        let watched = self.watched;
        let defect = |d: usize| (0..3).map(|i| E[i] * self.stages[i][d]).sum::<f64>() / h;
        let larger: Vec<f64> = (0..watched)
            .map(|d| {
                course.y[d]
                    .abs()
                    .max((course.y[d] + self.stages[2][d]).abs())
            })
            .collect();
        let Some((_, real, _)) = self.factors.as_ref() else {
            return f64::INFINITY;
        };
        let mut error = DVector::from_fn(watched, |d, _| self.slope[d] + defect(d));
        real.solve_mut(&mut error);
        let norm = self.norm(error.as_slice(), &larger);
        if !again || norm <= 1.0 {
            return norm;
        }
        // After a rejection the estimate is filtered once more, which takes out what is only stiff.
        for d in 0..watched {
            self.at[d] = course.y[d] + error[d];
        }
        course.rhs(course.t_s, &self.at, &mut self.rates[0]);
        let mut error = DVector::from_fn(watched, |d, _| self.rates[0][d] + defect(d));
        real.solve_mut(&mut error);
        self.norm(error.as_slice(), &larger)
    }

    /// Solves one step of at most `h`: the step that was accepted, its error, its rounds.
    fn solve(&mut self, course: &mut Course<'_>, mut h: f64) -> Result<(f64, f64, u32), Stopped> {
        let mut rejected = false;
        // What is left before the next moment may be as short as it likes.
        let wanted = h;
        loop {
            if h < smallest_step_s(course.t_s) && h < wanted {
                return Err(Stopped::StepTooSmall {
                    method: NAME,
                    t_s: course.t_s,
                    step_s: h,
                    tolerance: self.asked,
                });
            }
            course.check_work()?;
            let Some(rounds) = self.stages(course, h) else {
                course.stats.rejected += 1;
                if self.fresh {
                    h *= 0.5;
                } else {
                    self.differentiate(course);
                }
                self.dense_step_s = None;
                continue;
            };
            let error = self.error(course, h, rejected);
            if error <= 1.0 {
                return Ok((h, error, rounds));
            }
            course.stats.rejected += 1;
            rejected = true;
            h *= if error.is_finite() {
                (safety(rounds) * self.predicted(h, error)).clamp(SHRINK, 0.9)
            } else {
                SHRINK
            };
        }
    }

    /// Puts the state at `h` after the start of the step into `at`, by a step that ends there and of which nothing else is kept; `false` where
    /// that errs too much, though the longer one did not.
    fn aside(&mut self, course: &mut Course<'_>, h: f64) -> Result<bool, Stopped> {
        let mut aside = self.clone();
        let (reached, ..) = aside.solve(course, h)?;
        aside.polynomial(reached);
        aside.between(course, 1.0);
        self.at.copy_from_slice(&aside.at);
        Ok(reached == h)
    }

    /// Gustafsson's predictive control: the factor from this step and the one before.
    fn predicted(&self, h: f64, error: f64) -> f64 {
        let trend = self.before.map_or(1.0, |(step, before)| {
            h / step * (before / error.max(1e-10)).powf(0.25)
        });
        trend.min(1.0) * error.max(1e-10).powf(-0.25)
    }

    /// One step, cut short where somebody wants to see a state that the polynomial does not hold.
    fn advance<const EVENTS: bool>(
        &mut self,
        course: &mut Course<'_>,
        observer: &mut dyn Observer,
    ) -> Result<(), Stopped> {
        let t0 = course.t_s;
        let left = course.stop_s() - t0;
        let wanted = if left <= self.h_s * 1.01 {
            left
        } else if left < 2.0 * self.h_s {
            0.5 * left
        } else {
            self.h_s
        };
        let (tried, error, rounds) = self.solve(course, wanted)?;
        let mut h = tried;
        let proposal = tried * (safety(rounds) * self.predicted(tried, error)).clamp(SHRINK, GROW);
        let before_s = just_before_s(t0);
        let mut behind = BEHIND;
        let event = loop {
            self.polynomial(h);
            let event = if EVENTS {
                self.event(course, t0, h)
            } else {
                None
            };
            let until = event.map_or(h, |theta| theta * h);
            let due = course.log_due(t0 + until - before_s);
            // What is wanted first and not held by the polynomial is where the step has to end, or just before.
            let cut = match (due, event) {
                (Some(t), _) if !self.holds(course, (t - t0) / h, TRUST) => t - t0,
                (_, Some(theta))
                    if theta < 1.0 - AT_END && !self.holds(course, theta, TRUST_ON) =>
                {
                    let cut = theta + (behind * theta).min(0.5 * (1.0 - theta));
                    behind *= 1e-2;
                    cut * h
                }
                _ => break event,
            };
            (h, ..) = self.solve(course, cut)?;
        };
        let end_s = event.map_or(h, |theta| theta * h);
        while let Some(t) = course.sample_due(t0 + end_s - before_s) {
            let theta = (t - t0) / h;
            if self.holds(course, theta, TRUST) || !self.aside(course, theta * h)? {
                self.between(course, theta);
            }
            course.model.freedoms().project(&mut self.at);
            course.sample(&self.at, false, observer)?;
        }
        self.between(course, end_s / h);
        course.y.copy_from_slice(&self.at);
        let t1 = if h == left && event.is_none() {
            course.stop_s()
        } else {
            t0 + end_s
        };
        let switched = t1 >= course.stop_s();
        if event.is_none() {
            while course.sample_due(t1).is_some() {
                course.sample(&self.at, false, observer)?;
            }
        }
        course.arrive(t1, false, observer)?;
        course.stats.implicit += 1;
        self.before = Some((tried, error.max(1e-2)));
        self.dense_step_s = Some(h);
        // A step that was cut to meet a moment says nothing against a longer one.
        let cut = tried == wanted && wanted < self.h_s;
        self.h_s = if cut {
            proposal.max(self.h_s)
        } else if tried <= proposal && proposal < KEEP * tried {
            tried
        } else {
            proposal
        };
        if event.is_some() {
            course.fire(observer);
        }
        if (event.is_some() || switched) && !course.finished() {
            self.begin(course);
        } else {
            course.slope(&mut self.slope);
            self.margin_n = course.margin_n();
            self.fresh = false;
            // Slow convergence means that the Jacobian has aged.
            if rounds > 3 {
                self.differentiate(course);
            }
        }
        Ok(())
    }

    fn polynomial(&mut self, h: f64) {
        for d in 0..self.slope.len() {
            for k in 0..3 {
                self.dense[k][d] = (0..3).map(|i| P[i][k] * self.stages[i][d]).sum();
            }
        }
        self.dense_step_s = Some(h);
    }

    /// Puts the state at `theta` of the step into `at`.
    fn between(&mut self, course: &Course<'_>, theta: f64) {
        for d in 0..self.slope.len() {
            let [a, b, c] = [0, 1, 2].map(|k| self.dense[k][d]);
            self.at[d] = if theta == 1.0 {
                course.y[d] + self.stages[2][d]
            } else {
                course.y[d] + theta * (a + theta * (b + theta * c))
            };
        }
    }

    /// Whether the polynomial is as good as a step at `theta`: it is exact at both ends and at the stages between them.
    fn holds(&self, course: &Course<'_>, theta: f64, trust: f64) -> bool {
        let gap = theta * (theta - C[0]) * (theta - C[1]) * (theta - 1.0);
        self.norm(&self.dense[2], &course.y) * gap.abs() <= trust
    }

    /// The first zero of the margins within the step.
    fn event(&mut self, course: &mut Course<'_>, t0: f64, h: f64) -> Option<f64> {
        self.looks.clear();
        self.looks.note_start(self.margin_n);
        for theta in LOOKS {
            self.between(course, theta);
            let margin = course.margin_at_n(t0 + theta * h, &self.at);
            self.looks.note(theta, margin);
        }
        if !self.looks.suspicious() {
            return None;
        }
        let resolution = (0.25 * same_moment_s(t0) / h).max(2.0 * f64::EPSILON);
        let looks = std::mem::replace(&mut self.looks, Looks::new());
        events::first(&looks, resolution, |theta| {
            self.between(course, theta);
            course.margin_at_n(t0 + theta * h, &self.at)
        })
    }
}

fn safety(rounds: u32) -> f64 {
    let most = f64::from(2 * MOST_ITERATIONS);
    0.9 * (most + 1.0) / (most + f64::from(rounds))
}

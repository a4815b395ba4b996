//! Three-step Adams–Bashforth: one evaluation a step.
//!
//! ```text
//! y₁ = y₀ + h/12 (23 f₀ − 16 f₋₁ + 5 f₋₂)        and for a velocity that dampers take away at λ > 0.45/h        v₁ = v₀ + h/2 (3 a₀ − a₋₁)
//! ```
//! Third order where nothing is damped fast, second elsewhere: the formula of order 3 is stable up to hλ = 6/11, that of order 2 up to hλ = 1, and a
//! velocity that is forgotten so soon adds up no errors. λ is what contacts, holds and straps make ([`Model::damping_per_s`](crate::model::Model::damping_per_s)),
//! asked at the start of a segment and every 64 steps. A segment begins with a step of the midpoint rule. For scenes where a percent is
//! enough and few moments interrupt: one evaluation a step is the least there can be. Source: Hairer, Nørsett, Wanner, Solving ODEs I (1993), III.1 and III.3.

use super::course::Course;
use super::fixed::Step;

/// hλ beyond which the formula of order 3 is left; it is stable up to 6/11.
const FAST: f64 = 0.45;
/// Steps between two looks at λ.
const LOOK: u32 = 64;

pub struct Adams3 {
    /// f₋₁ and f₋₂.
    before: [Vec<f64>; 2],
    /// How many steps of this segment are behind.
    steps: u32,
    /// When the segment began, s.
    segment_s: f64,
    /// λ of each of the body's velocities, 1/s, behind zeros for its positions.
    damping_per_s: Vec<f64>,
    /// What f₀, f₋₁ and f₋₂ count for each state, in steps.
    weights: [Vec<f64>; 3],
}

impl Adams3 {
    fn weigh(&mut self, course: &Course, h: f64) {
        let of_order_2 = [1.5, -0.5, 0.0];
        let of_order_3 = [23.0 / 12.0, -16.0 / 12.0, 5.0 / 12.0];
        course
            .model
            .damping_per_s(&course.y, &course.w, &mut self.damping_per_s);
        for d in 0..self.weights[0].len() {
            let fast = self
                .damping_per_s
                .get(d)
                .is_some_and(|rate| h * rate > FAST);
            let weights = if self.steps > 1 && !fast {
                of_order_3
            } else {
                of_order_2
            };
            for (all, weight) in self.weights.iter_mut().zip(weights) {
                all[d] = weight;
            }
        }
    }
}

impl Step for Adams3 {
    const NAME: &'static str = "adams3";

    fn new(size: usize) -> Self {
        let zeros = || vec![0.0; size];
        Self {
            before: [zeros(), zeros()],
            steps: 0,
            segment_s: f64::NAN,
            damping_per_s: Vec::new(),
            weights: [zeros(), zeros(), zeros()],
        }
    }

    fn step(&mut self, course: &mut Course, h: f64, f0: &[f64], out: &mut [f64]) {
        if self.segment_s != course.w.segment_s {
            self.segment_s = course.w.segment_s;
            self.steps = 0;
            self.damping_per_s.resize(course.model.layout().body, 0.0);
        }
        if self.steps == 0 {
            let at = &mut self.before[1];
            for ((at, y), f) in at.iter_mut().zip(&course.y).zip(f0) {
                *at = y + 0.5 * h * f;
            }
            course.rhs(course.t_s + 0.5 * h, at, out);
            for (out, y) in out.iter_mut().zip(&course.y) {
                *out = y + h * *out;
            }
        } else {
            if self.steps <= 2 || self.steps.is_multiple_of(LOOK) {
                self.weigh(course, h);
            }
            let [now, last, first] = &self.weights;
            let [f1, f2] = &self.before;
            let slopes = f0.iter().zip(f1).zip(f2);
            let weights = now.iter().zip(last).zip(first);
            let states = out.iter_mut().zip(&course.y);
            for ((out, y), (((f0, f1), f2), ((now, last), first))) in
                states.zip(slopes.zip(weights))
            {
                *out = y + h * (now * f0 + (last * f1 + first * f2));
            }
        }
        self.before.swap(0, 1);
        self.before[0].copy_from_slice(f0);
        self.steps += 1;
    }
}

//! Four-step Adams–Bashforth with exact damping: one evaluation a step.
//!
//! ```text
//! v̇ = −λ v + N        v₁ = e^{−hλ} v₀ + ∫₀ʰ e^{−λ(h−s)} P(s) ds        P: the cubic through N₀ … N₋₃, N = f + λ v
//!                        = e^{−hλ} v₀ + h Σ γ_k ∇ᵏN₀,  k = 0…3        γ_k = ∫₀¹ e^{−hλ(1−s)} s(s+1)…(s+k−1)/k! ds
//! ```
//! λ ≥ 0 is what contacts, holds and straps damp each velocity by ([`Model::damping_per_s`](crate::model::Model::damping_per_s)), and friction at the
//! shoulders where nothing slides; 0 for all other states, where this is Adams–Bashforth. Any λ gives fourth order; the right one takes a damper's limit off the step, which for
//! Adams–Bashforth would be hλ < 0.3. It is looked at every 64 steps, and held as long as it is nearly right. A segment begins with two
//! steps of a Runge–Kutta method of order 3, damping exact as well (ETDRK3), and one of three N. For scenes where a percent is enough and
//! few moments interrupt: one evaluation a step is the least there can be.
//!
//! Friction damps by μN/v_s, or Nσ₁ of bristles, at most: less where a handle slides or bears less. A motion v̇ = −μ v, μ ≤ λ, stays bounded with four
//! N as long as hλ ≤ 2, with two, of second order, whatever hλ; with μ beyond λ by more than a seventh it does not (the roots of its recurrence). So
//! with friction λ is that of [`MARGIN`] times the load, and looked at as soon as a handle bears more; beyond hλ = 2 two N count.
//! Source: Nørsett, Lecture Notes in Mathematics 109 (1969), 214; Cox & Matthews, J. Comput. Phys. 176 (2002), 430.

use super::course::Course;
use super::fixed::Step;
use crate::lanes::{LANES, f64x2, pairs};
use crate::model::Pair;

/// Order, and how many N count.
const ORDER: usize = 4;
/// Steps between two looks at λ.
const LOOK: u32 = 64;
/// λ is nearly right as long as it is off by no more than this over h: two thirds of what Adams–Bashforth can damp.
const OFF: f64 = 0.2;
/// Friction is taken for that of so many times the load of a handle.
const MARGIN: f64 = 1.5;
/// Beyond this hλ, with friction, but [`FEW`] N count.
const STABLE: f64 = 2.0;
const FEW: usize = 2;
/// Segments are as long as each other but for the rounding of the clock, in parts of a step.
const ROUNDING: f64 = 1e-10;

/// What makes a step of a state: e^{−hλ}, λ (1/s), and what N₀ … N₋₃ count, in steps. Two states side by side.
type Weights = [f64x2; 2 + ORDER];

/// Steps that a segment begins with before three N are known.
const FIRST: u32 = 2;

/// What makes such a step of a state: e^{−hλ/2} and ½ φ₁(hλ/2) for its middle; e^{−hλ} and what the three N count, in steps; λ, 1/s.
#[derive(Clone, Copy, Default)]
struct First {
    middle: [f64; 2],
    decay: f64,
    weights: [f64; 3],
    rate_per_s: f64,
}

impl First {
    /// Cox & Matthews 2002, (23) to (25).
    fn new(h: f64, rate_per_s: f64) -> Self {
        let half = phi(0.5 * h * rate_per_s);
        let [decay, one, two, three, _] = phi(h * rate_per_s);
        Self {
            middle: [half[0], 0.5 * half[1]],
            decay,
            weights: [
                one - 3.0 * two + 4.0 * three,
                4.0 * two - 8.0 * three,
                4.0 * three - two,
            ],
            rate_per_s,
        }
    }

    /// φ₁ of a whole step: all weights together.
    fn whole(&self) -> f64 {
        self.weights.iter().sum()
    }
}

pub struct Adams4 {
    /// N₋₁ … N₋₃.
    before: Vec<[f64x2; ORDER - 1]>,
    first: Vec<First>,
    /// Where three N are known, and where four are.
    weights: [Vec<Weights>; 2],
    /// Of which step size, none at first, and which λ: of the body's velocities, 1/s, behind zeros for its positions.
    step_s: f64,
    damping_per_s: Vec<f64>,
    /// λ as it stood at the last look, and how many steps ago that was.
    now_per_s: Vec<f64>,
    looked: u32,
    /// What friction is taken to bear, N, by pairs of handles; empty without friction.
    loads_n: Vec<f64x2>,
    /// Dampers sideways and vertical with that of friction, by pairs of handles, N·s/m.
    dampers: [Vec<f64x2>; 2],
    /// How many steps of this segment are behind.
    steps: u32,
    /// When the segment began, s.
    segment_s: f64,
    /// Stages of a segment's first steps: N at the start and in the middle, and a state.
    stages: [Vec<f64>; 3],
}

impl Adams4 {
    /// Looks at λ; whether it had to be changed.
    #[cold]
    fn look(&mut self, course: &Course, h: f64) -> bool {
        self.looked = 0;
        let same = self.same(h);
        let (model, now) = (course.model, &mut self.now_per_s);
        now.resize(model.layout().body, 0.0);
        let rubs = model.friction_damping_s_per_m() > 0.0;
        if rubs {
            self.loads_n.clear();
            let load = |p: &Pair| (p.normal * MARGIN).fast_max(f64x2::ZERO);
            self.loads_n.extend(course.w.pair.iter().map(load));
            let (loads_n, dampers) = (&self.loads_n, &mut self.dampers);
            model.damping_with_friction_per_s(&course.y, &course.w, loads_n, dampers, now);
        } else {
            model.damping_per_s(&course.y, &course.w, now);
        }
        let near = |(a, b): (&f64, &f64)| h * (a - b).abs() <= OFF;
        if same && now.iter().zip(&self.damping_per_s).all(near) {
            return false;
        }
        self.step_s = h;
        self.damping_per_s.clone_from(now);
        let of = |rate_per_s: f64| {
            let most = if rubs && h * rate_per_s > STABLE {
                FEW
            } else {
                ORDER
            };
            let known = [ORDER - 1, ORDER].map(|known| weights(h, rate_per_s, known.min(most)));
            (First::new(h, rate_per_s), known)
        };
        // Most states are not damped, and weigh alike.
        let undamped = of(0.0);
        for (d, first) in self.first.iter_mut().enumerate() {
            let rate_per_s = now.get(d).copied().unwrap_or(0.0);
            let damped = (rate_per_s > 0.0).then(|| of(rate_per_s));
            let weights;
            (*first, weights) = damped.unwrap_or(undamped);
            for (all, weights) in self.weights.iter_mut().zip(weights) {
                for (to, weight) in all[d / LANES].iter_mut().zip(weights) {
                    to.as_mut_array()[d % LANES] = weight;
                }
            }
        }
        true
    }

    /// Whether a handle bears more than friction is taken to.
    fn bears_more(&self, course: &Course) -> bool {
        let mut loads = course.w.pair.iter().zip(&self.loads_n);
        loads.any(|(p, load)| !p.normal.simd_le(*load).all())
    }

    fn same(&self, h: f64) -> bool {
        (h - self.step_s).abs() <= ROUNDING * h
    }

    /// One of the first steps of a segment.
    #[cold]
    fn begin(&mut self, course: &mut Course, h: f64, f0: &[f64], out: &mut [f64]) {
        let [n0, middle, at] = &mut self.stages;
        for (d, first) in self.first.iter().enumerate() {
            let [decay, weight] = first.middle;
            n0[d] = f0[d] + first.rate_per_s * course.y[d];
            at[d] = decay * course.y[d] + h * weight * n0[d];
        }
        course.rhs(course.t_s + 0.5 * h, at, middle);
        for (d, first) in self.first.iter().enumerate() {
            middle[d] += first.rate_per_s * at[d];
            at[d] = first.decay * course.y[d] + h * first.whole() * (2.0 * middle[d] - n0[d]);
        }
        course.rhs(course.t_s + h, at, out);
        for (d, first) in self.first.iter().enumerate() {
            let n = [n0[d], middle[d], out[d] + first.rate_per_s * at[d]];
            let sum: f64 = first.weights.iter().zip(n).map(|(w, n)| w * n).sum();
            out[d] = first.decay * course.y[d] + h * sum;
        }
    }
}

impl Step for Adams4 {
    const NAME: &'static str = "adams4";

    fn new(size: usize) -> Self {
        let zeros = || vec![[f64x2::ZERO; 2 + ORDER]; pairs(size)];
        Self {
            before: vec![[f64x2::ZERO; ORDER - 1]; pairs(size)],
            first: vec![First::default(); size],
            weights: std::array::from_fn(|_| zeros()),
            step_s: f64::INFINITY,
            damping_per_s: Vec::new(),
            now_per_s: Vec::new(),
            looked: 0,
            loads_n: Vec::new(),
            dampers: Default::default(),
            steps: 0,
            segment_s: f64::NAN,
            stages: std::array::from_fn(|_| vec![0.0; size]),
        }
    }

    fn step(&mut self, course: &mut Course, h: f64, f0: &[f64], out: &mut [f64]) {
        if self.segment_s != course.w.segment_s {
            (self.segment_s, self.steps) = (course.w.segment_s, 0);
        }
        // N of another λ count no longer.
        let due = self.looked >= LOOK || !self.same(h) || self.bears_more(course);
        if due && self.look(course, h) {
            self.steps = 0;
        }
        let weights = &self.weights[usize::from(self.steps > FIRST)];
        let ((ys, y_odd), (fs, f_odd)) = (course.y.as_chunks(), f0.as_chunks());
        let (outs, out_odd) = out.as_chunks_mut();
        let past = self.before.iter_mut().zip(weights);
        for ((y, f), (out, (before, weights))) in ys.iter().zip(fs).zip(outs.iter_mut().zip(past)) {
            *out = on(h, f64x2::new(*y), f64x2::new(*f), before, weights).to_array();
        }
        let past = (self.before.last_mut(), weights.last());
        if let ([y], [f], [out], (Some(before), Some(weights))) = (y_odd, f_odd, out_odd, past) {
            let (y, f) = (f64x2::splat(*y), f64x2::splat(*f));
            *out = on(h, y, f, before, weights).as_array()[0];
        }
        if self.steps < FIRST {
            self.begin(course, h, f0, out);
        }
        // A segment may have more steps than can be counted; only its first ones have to be.
        self.steps = self.steps.saturating_add(1);
        self.looked += 1;
    }
}

/// Two states a step on.
#[inline(always)]
fn on(h: f64, y: f64x2, f: f64x2, before: &mut [f64x2; ORDER - 1], weights: &Weights) -> f64x2 {
    let ([n1, n2, n3], [decay, rate, w0, w1, w2, w3]) = (*before, *weights);
    let n0 = f + rate * y;
    *before = [n0, n1, n2];
    decay * y + ((w0 * n0 + w1 * n1) + (w2 * n2 + w3 * n3)) * f64x2::splat(h)
}

/// What makes a step of size h of a state that is damped by λ, where the first `known` N are.
fn weights(h: f64, rate_per_s: f64, known: usize) -> [f64; 2 + ORDER] {
    let phi = phi(h * rate_per_s);
    // ∫ e^{−z(1−s)} sᵏ ds = k! φ_{k+1}
    let power = [phi[1], phi[2], 2.0 * phi[3], 6.0 * phi[4]];
    let gamma = [
        power[0],
        power[1],
        (power[1] + power[2]) / 2.0,
        (2.0 * power[1] + 3.0 * power[2] + power[3]) / 6.0,
    ];
    /// ∇ᵏ
    const DIFFERENCES: [[f64; ORDER]; ORDER] = [
        [1.0, 0.0, 0.0, 0.0],
        [1.0, -1.0, 0.0, 0.0],
        [1.0, -2.0, 1.0, 0.0],
        [1.0, -3.0, 3.0, -1.0],
    ];
    let mut weights = [phi[0], rate_per_s, 0.0, 0.0, 0.0, 0.0];
    for (gamma, differences) in gamma.iter().zip(&DIFFERENCES[..known]) {
        for (weight, difference) in weights[2..].iter_mut().zip(differences) {
            *weight += gamma * difference;
        }
    }
    weights
}

/// φ₀ … φ₄ of −z, z ≥ 0: φ₀ = e^{−z}, φ_k = ∫₀¹ e^{−z(1−s)} s^{k−1}/(k−1)! ds = Σ (−z)ʲ/(j+k)!, j ≥ 0, to 1e-14 of themselves.
fn phi(z: f64) -> [f64; ORDER + 1] {
    let mut phi = [(-z).exp(); ORDER + 1];
    let mut one_over_factorial = 1.0;
    for k in 1..=ORDER {
        phi[k] = if z > 1.0 {
            (one_over_factorial - phi[k - 1]) / z
        } else {
            let (mut sum, mut term) = (0.0, one_over_factorial / k as f64);
            for j in k + 1..k + 20 {
                sum += term;
                term *= -z / j as f64;
            }
            sum
        };
        one_over_factorial /= k as f64;
    }
    phi
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_damping_it_is_adams_bashforth() {
        let expected = [55.0, -59.0, 37.0, -9.0].map(|x| x / 24.0);
        let [decay, rate, rest @ ..] = weights(1.0, 0.0, ORDER);
        assert_eq!([decay, rate], [1.0, 0.0]);
        for (weight, expected) in rest.iter().zip(expected) {
            assert!((weight - expected).abs() < 1e-15, "{weight} {expected}");
        }
        let of_order_3 = weights(1.0, 0.0, 3);
        assert!((of_order_3[3] + 4.0 / 3.0).abs() < 1e-15 && of_order_3[5] == 0.0);
        // Kutta's method of order 3.
        let weights = First::new(1.0, 0.0).weights.map(|w| 6.0 * w);
        for (weight, expected) in weights.iter().zip([1.0, 4.0, 1.0]) {
            assert!((weight - expected).abs() < 1e-14, "{weight} {expected}");
        }
    }

    /// v̇ = −λ v + t³, whose solution is e^{−λt} and a cubic: a step is exact, whatever λ.
    #[test]
    fn a_damped_velocity_under_a_cubic_force_is_exact() {
        for rate in [0.0f64, 1e-3, 0.3, 0.99, 1.01, 7.0, 200.0, 1e6] {
            let cubic = |t: f64| {
                let k = rate;
                if k == 0.0 {
                    t.powi(4) / 4.0
                } else if k < 0.1 {
                    // Its terms cancel there: the series of ∫ e^{−λ(t−s)} s³ ds.
                    let terms = (0..12).scan(t.powi(4) / 4.0, |term, j| {
                        let now = *term;
                        *term *= -k * t / (5.0 + f64::from(j));
                        Some(now)
                    });
                    terms.sum()
                } else {
                    ((t / k - 3.0 / k / k) * t + 6.0 / k.powi(3)) * t - 6.0 / k.powi(4)
                }
            };
            let (h, t0, v0) = (1.0, 4.0, 3.0);
            let weights = weights(h, rate, ORDER);
            let n = |j: usize| (t0 - h * j as f64).powi(3);
            let mut v1 = weights[0] * v0;
            for j in 0..ORDER {
                v1 += h * weights[2 + j] * n(j);
            }
            let exact = (-rate * h).exp() * (v0 - cubic(t0)) + cubic(t0 + h);
            assert!(
                (v1 - exact).abs() < 1e-11 * exact.abs(),
                "{rate}: {v1} {exact}"
            );
        }
    }
}

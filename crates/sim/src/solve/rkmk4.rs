//! RKMK4: a Runge–Kutta–Munthe-Kaas method of order 4 that never leaves the rotation group.
//!
//! The orientation within a step is q = q₀ ∘ exp(θ); the classical fourth-order method integrates θ, and everything that is not a
//! rotation as usual:
//!
//! ```text
//! θ̇ = ω + ½ θ × ω + ¹⁄₁₂ θ × (θ × ω) + O(θ⁴)        θ(t₀) = 0,  ω in body axes
//! ```
//! With θ = O(h) the terms left out are O(h⁴) in the rate and O(h⁵) in a step. Where the freedoms hold no quaternion it is RK4.
//! Source: Munthe-Kaas, BIT 38 (1998), 92–111; Hairer, Lubich, Wanner, Geometric Numerical Integration (2006), IV.8.

use super::course::Course;
use super::fixed::Step;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

pub struct Rkmk4 {
    k: [Vec<f64>; 3],
    at: Vec<f64>,
}

/// θ̇ at θ.
fn rate(turn: Vector3<f64>, spin: Vector3<f64>) -> Vector3<f64> {
    let cross = turn.cross(&spin);
    spin + 0.5 * cross + turn.cross(&cross) / 12.0
}

/// Writes q₀ ∘ exp(θ) into `out`.
fn compose(q: &[f64], turn: Vector3<f64>, out: &mut [f64]) {
    let q = Quaternion::new(q[3], q[0], q[1], q[2]);
    let q = q * UnitQuaternion::from_scaled_axis(turn).into_inner();
    out.copy_from_slice(&[q.i, q.j, q.k, q.w]);
}

impl Step for Rkmk4 {
    const NAME: &'static str = "rkmk4";

    fn new(size: usize) -> Self {
        Self {
            k: std::array::from_fn(|_| vec![0.0; size]),
            at: vec![0.0; size],
        }
    }

    fn step(&mut self, course: &mut Course, h: f64, f0: &[f64], out: &mut [f64]) {
        let t = course.t_s;
        let places = course.model.freedoms().rotation();
        let spin = |y: &[f64], at: usize| Vector3::new(y[at], y[at + 1], y[at + 2]);
        // θ̇ of the four stages.
        let mut turning = [Vector3::zeros(); 4];
        if let Some([_, s]) = places {
            turning[0] = spin(&course.y, s);
        }
        for (i, part) in [0.5, 0.5, 1.0].into_iter().enumerate() {
            let previous = if i == 0 { f0 } else { &self.k[i - 1] };
            for ((a, y), f) in self.at.iter_mut().zip(&course.y).zip(previous) {
                *a = y + part * h * f;
            }
            if let Some([q, s]) = places {
                let turn = part * h * turning[i];
                compose(&course.y[q..q + 4], turn, &mut self.at[q..q + 4]);
                turning[i + 1] = rate(turn, spin(&self.at, s));
            }
            course.rhs(t + part * h, &self.at, &mut self.k[i]);
        }
        for (d, o) in out.iter_mut().enumerate() {
            *o = course.y[d]
                + h / 6.0 * (f0[d] + 2.0 * (self.k[0][d] + self.k[1][d]) + self.k[2][d]);
        }
        if let Some([q, _]) = places {
            let turn = h / 6.0 * (turning[0] + 2.0 * (turning[1] + turning[2]) + turning[3]);
            compose(&course.y[q..q + 4], turn, &mut out[q..q + 4]);
        }
    }
}

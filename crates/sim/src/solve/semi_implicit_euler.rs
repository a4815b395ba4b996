//! Semi-implicit (symplectic) Euler: velocities first, then positions with the new velocities. First order.
//!
//! ```text
//! v₁ = v₀ + h a(t₀, x₀, v₀)        x₁ = x₀ + h v₁        q₁ = q₀ ∘ exp(h ω₁)
//! ```
//! So do deflections of poles, with their new rates; phases, other states and the ledger advance by plain Euler. Source: Hairer, Lubich, Wanner, Geometric Numerical Integration (2006),
//! I.1; it is the method of the paper's archive, at 1 ms.

use super::course::Course;
use super::fixed::Step;

pub struct SemiImplicitEuler;

impl Step for SemiImplicitEuler {
    const NAME: &'static str = "semi-implicit-euler";

    fn new(_size: usize) -> Self {
        Self
    }

    fn step(&mut self, course: &mut Course, h: f64, f0: &[f64], out: &mut [f64]) {
        let freedoms = course.model.freedoms();
        let positions = freedoms.positions();
        out.copy_from_slice(&course.y);
        for d in positions..out.len() {
            out[d] += h * f0[d];
        }
        freedoms.drift(h, &mut out[..freedoms.size()]);
        let extra = course.model.layout().extra_range().start;
        for bend in course.model.bends() {
            let q = extra + bend.state;
            out[q] = course.y[q] + h * out[q + 1];
        }
    }
}

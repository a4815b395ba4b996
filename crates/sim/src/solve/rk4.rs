//! RK4: the classical Runge–Kutta method. Source: Kutta, Z. Math. Phys. 46 (1901), 435–453.

use super::course::Course;
use super::fixed::Step;

pub struct Rk4 {
    k: [Vec<f64>; 3],
    at: Vec<f64>,
}

impl Step for Rk4 {
    const NAME: &'static str = "rk4";

    fn new(size: usize) -> Self {
        Self {
            k: std::array::from_fn(|_| vec![0.0; size]),
            at: vec![0.0; size],
        }
    }

    fn step(&mut self, course: &mut Course, h: f64, f0: &[f64], out: &mut [f64]) {
        let t = course.t_s;
        for (i, part) in [0.5, 0.5, 1.0].into_iter().enumerate() {
            let previous = if i == 0 { f0 } else { &self.k[i - 1] };
            for ((a, y), f) in self.at.iter_mut().zip(&course.y).zip(previous) {
                *a = y + part * h * f;
            }
            course.rhs(t + part * h, &self.at, &mut self.k[i]);
        }
        for (d, o) in out.iter_mut().enumerate() {
            *o = course.y[d]
                + h / 6.0 * (f0[d] + 2.0 * (self.k[0][d] + self.k[1][d]) + self.k[2][d]);
        }
    }
}

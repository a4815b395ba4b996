//! Real Fourier transforms with their plans kept per thread: a study makes thousands of equally long ones.

use std::cell::RefCell;
use std::sync::Arc;

use realfft::num_complex::Complex64;
use realfft::{RealFftPlanner, RealToComplex};

thread_local! {
    static PLANNER: RefCell<RealFftPlanner<f64>> = RefCell::new(RealFftPlanner::new());
    static WORK: RefCell<Work> = RefCell::default();
}

/// Memory of transforms. It fits any plan and any number of users that take turns.
#[derive(Default)]
pub(crate) struct Work {
    input: Vec<f64>,
    output: Vec<Complex64>,
    scratch: Vec<Complex64>,
}

impl Work {
    /// The transform of what `fill` puts into the input.
    pub fn transform(
        &mut self,
        plan: &dyn RealToComplex<f64>,
        fill: impl FnOnce(&mut [f64]),
    ) -> &[Complex64] {
        let none = Complex64::default();
        self.input.resize(plan.len(), 0.0);
        self.output.resize(plan.len() / 2 + 1, none);
        self.scratch.resize(plan.get_scratch_len(), none);
        fill(&mut self.input);
        // OK because the buffers have the plan's lengths, the only way in which it can fail.
        plan.process_with_scratch(&mut self.input, &mut self.output, &mut self.scratch)
            .expect("buffers of the plan's own length");
        &self.output
    }
}

/// Lends this thread's memory for transforms.
pub(crate) fn with_work<T>(run: impl FnOnce(&mut Work) -> T) -> T {
    WORK.with(|work| run(&mut work.borrow_mut()))
}

/// The plan for `n` real samples.
pub(crate) fn plan(n: usize) -> Arc<dyn RealToComplex<f64>> {
    PLANNER.with(|p| p.borrow_mut().plan_fft_forward(n))
}

/// `numpy.fft.rfft`: X\[k\] = Σ x\[n\] e^{−2πikn/N}, k = 0 … N/2. Empty for an empty signal.
pub fn rfft(x: &[f64]) -> Vec<Complex64> {
    if x.is_empty() {
        return Vec::new();
    }
    let plan = plan(x.len());
    with_work(|work| {
        work.transform(plan.as_ref(), |input| input.copy_from_slice(x))
            .to_vec()
    })
}

/// |rfft(x)|.
pub fn rfft_magnitude(x: &[f64]) -> Vec<f64> {
    rfft(x).iter().map(|z| z.norm()).collect()
}

/// `numpy.fft.rfftfreq`: the frequencies of [`rfft`]'s bins for `n` samples at the step `dt_s` (Hz).
pub fn rfft_hz(n: usize, dt_s: f64) -> Vec<f64> {
    let width_hz = 1.0 / (n as f64 * dt_s);
    (0..n / 2 + 1).map(|k| k as f64 * width_hz).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// The definition itself, O(n²): it judges the fast one.
    pub fn naive_dft(x: &[f64]) -> Vec<Complex64> {
        let n = x.len();
        let term = |k: usize, j: usize| {
            Complex64::from_polar(x[j], -2.0 * PI * ((k * j) % n) as f64 / n as f64)
        };
        (0..n / 2 + 1)
            .map(|k| (0..n).map(|j| term(k, j)).sum())
            .collect()
    }

    fn noise(n: usize) -> Vec<f64> {
        let mut state = 1u64;
        let mut next = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        (0..n).map(|_| next()).collect()
    }

    #[test]
    fn the_judge_keeps_parseval_and_a_lone_sine() {
        let x = noise(101);
        let z = naive_dft(&x);
        // Odd length: every bin but 0 stands for two.
        let energy: f64 = z[0].norm_sqr() + 2.0 * z[1..].iter().map(|z| z.norm_sqr()).sum::<f64>();
        let expected = 101.0 * x.iter().map(|x| x * x).sum::<f64>();
        assert!((energy / expected - 1.0).abs() < 1e-13);
        let sine: Vec<f64> = (0..64)
            .map(|n| (2.0 * PI * 5.0 * n as f64 / 64.0).sin())
            .collect();
        for (k, z) in naive_dft(&sine).iter().enumerate() {
            let expected = if k == 5 { 32.0 } else { 0.0 };
            assert!((z.norm() - expected).abs() < 1e-12, "bin {k}: {}", z.norm());
        }
    }

    #[test]
    fn rfft_agrees_with_the_naive_dft_at_every_kind_of_length() {
        for n in [1, 2, 3, 4, 5, 16, 30, 101, 128, 210, 341, 682] {
            let x = noise(n);
            let scale = x.iter().map(|x| x.abs()).sum::<f64>();
            for (fast, slow) in rfft(&x).iter().zip(naive_dft(&x)) {
                // measured 2e-16
                assert!((fast - slow).norm() < 1e-14 * scale, "n = {n}");
            }
        }
    }
}

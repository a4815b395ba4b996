//! Linear least squares over blocks, and what redrawing the blocks says of its parameters.

use super::DRAWS;
use nalgebra::{SMatrix, SVector};
use sim::random::{Stream, uniform_pair};

/// Sums over a block of rows of a linear problem y = Σ x_j p_j.
#[derive(Clone)]
pub(super) struct Block<const N: usize> {
    gram: SMatrix<f64, N, N>,
    right: SVector<f64, N>,
    square: f64,
}

impl<const N: usize> Block<N> {
    pub(super) fn empty() -> Self {
        Self {
            gram: SMatrix::zeros(),
            right: SVector::zeros(),
            square: 0.0,
        }
    }

    pub(super) fn add(&mut self, x: [f64; N], y: f64) {
        let x = SVector::from(x);
        self.gram += x * x.transpose();
        self.right += x * y;
        self.square += y * y;
    }
}

/// The parameters that fit the picked blocks best; `None` where they cannot be told apart.
pub(super) fn solve<const N: usize>(
    blocks: &[Block<N>],
    pick: impl Fn(usize) -> usize,
) -> Option<SVector<f64, N>> {
    let mut sum = Block::<N>::empty();
    for k in 0..blocks.len() {
        let block = &blocks[pick(k)];
        sum.gram += block.gram;
        sum.right += block.right;
    }
    // Scaled to a unit diagonal, so that what is small is so by itself and not by its unit.
    let scale = sum.gram.diagonal().map(|d| 1.0 / d.sqrt());
    let scaled = sum.gram.component_mul(&(scale * scale.transpose()));
    let factor = scaled.cholesky()?;
    let least = factor.l_dirty().diagonal().min();
    (least > 1e-6).then(|| {
        factor
            .solve(&sum.right.component_mul(&scale))
            .component_mul(&scale)
    })
}

/// Share of Σ y² that the parameters leave unexplained.
pub(super) fn unexplained<const N: usize>(blocks: &[Block<N>]) -> Option<f64> {
    let p = solve(blocks, |k| k)?;
    let right: SVector<f64, N> = blocks.iter().map(|b| b.right).sum();
    let square: f64 = blocks.iter().map(|b| b.square).sum();
    Some(1.0 - p.dot(&right) / square)
}

/// What `of` makes of the parameters, with intervals by the bootstrap.
pub(super) fn bootstrapped<const N: usize, const M: usize>(
    blocks: &[Block<N>],
    of: impl Fn(SVector<f64, N>) -> [f64; M],
) -> Option<([f64; M], [[f64; 2]; M])> {
    let value = of(solve(blocks, |k| k)?);
    let mut draws = [const { Vec::new() }; M];
    for draw in 0..DRAWS {
        let pick = |k: usize| {
            let [u, _] = uniform_pair(draw, Stream::Design, u32::MAX - 1, k as u64);
            ((1.0 - u) * blocks.len() as f64) as usize
        };
        if let Some(found) = solve(blocks, pick) {
            draws
                .iter_mut()
                .zip(of(found))
                .for_each(|(d, x): (&mut Vec<f64>, f64)| d.push(x));
        }
    }
    let interval = draws.map(|mut d| {
        d.sort_by(f64::total_cmp);
        [0.025, 0.975].map(|q| crate::sweep::summary::quantile(&d, q))
    });
    Some((value, interval))
}

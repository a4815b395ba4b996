//! Linear least squares over blocks, and what redrawing the blocks says of its parameters.

use super::DRAWS;
use crate::statistics::student_975;
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

    /// The parameters that fit best; `None` where they cannot be told apart.
    fn solved(&self) -> Option<SVector<f64, N>> {
        // Scaled to a unit diagonal, so that what is small is so by itself and not by its unit.
        let scale = self.gram.diagonal().map(|d| 1.0 / d.sqrt());
        let scaled = self.gram.component_mul(&(scale * scale.transpose()));
        let factor = scaled.cholesky()?;
        let least = factor.l_dirty().diagonal().min();
        (least > 1e-6).then(|| {
            factor
                .solve(&self.right.component_mul(&scale))
                .component_mul(&scale)
        })
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
    sum.solved()
}

/// Share of Σ y² that the parameters leave unexplained.
pub(super) fn unexplained<const N: usize>(blocks: &[Block<N>]) -> Option<f64> {
    let p = solve(blocks, |k| k)?;
    let right: SVector<f64, N> = blocks.iter().map(|b| b.right).sum();
    let square: f64 = blocks.iter().map(|b| b.square).sum();
    Some(1.0 - p.dot(&right) / square)
}

/// The parameters if all that is missed were an error of y, and if it were one of x_j, for every j. The truth lies among them where all may
/// err and the parameters have their signs in all of them. With x_j erring, p + G⁻¹e_j r/p_j, r the sum of squares that is missed: the regression
/// of x_j on y and the other x. Source: Frisch, Statistical Confluence Analysis (1934); Klepper & Leamer, Econometrica 52 (1984) 163.
pub(super) fn whoever_errs<const N: usize>(blocks: &[Block<N>]) -> Option<Vec<SVector<f64, N>>> {
    let p = solve(blocks, |k| k)?;
    let gram: SMatrix<f64, N, N> = blocks.iter().map(|b| b.gram).sum();
    let right: SVector<f64, N> = blocks.iter().map(|b| b.right).sum();
    let square: f64 = blocks.iter().map(|b| b.square).sum();
    let missed = (square - p.dot(&right)).max(0.0);
    let inverse = gram.try_inverse()?;
    let erring = (0..N).map(|j| p + inverse.column(j) * (missed / p[j]));
    Some([p].into_iter().chain(erring).collect())
}

/// Half of the parameters' 95 % intervals, from what they are without each block, by Student's t. A redrawing of a few blocks is too sure. `None` where a
/// block holds a parameter alone. The degrees of freedom are Satterthwaite's for that sum of squares Σs_b², were all rows equally noisy: (tr M)²/tr M² of
/// its covariance M. With the share g_b that block b has in a parameter's information s_b = d_b (p − p_b), d_b = g_b/(1 − g_b), which makes M_bb = d_b and
/// M_bc = −d_b d_c: n − 1 for n equal blocks, and never less than one. Source: Efron & Stein, Ann. Stat. 9 (1981) 586; Bell & McCaffrey, Surv.
/// Methodol. 28 (2002) 169.
pub(super) fn jackknifed<const N: usize>(blocks: &[Block<N>]) -> Option<[f64; N]> {
    let count = blocks.len() as f64;
    let p = solve(blocks, |k| k)?;
    let gram: SMatrix<f64, N, N> = blocks.iter().map(|b| b.gram).sum();
    let right: SVector<f64, N> = blocks.iter().map(|b| b.right).sum();
    let inverse = gram.try_inverse()?;
    let mut squares = SVector::<f64, N>::zeros();
    // Sums of d, d² and d⁴.
    let mut sums = [squares; 3];
    for block in blocks {
        let mut rest = Block::<N>::empty();
        rest.gram = gram - block.gram;
        rest.right = right - block.right;
        let off = rest.solved()? - p;
        squares += off.component_mul(&off);
        let share = (inverse * block.gram * inverse)
            .diagonal()
            .component_div(&inverse.diagonal());
        let d = share.map(|g| g / (1.0 - g));
        for (sum, power) in sums.iter_mut().zip([1, 2, 4]) {
            *sum += d.map(|d| d.powi(power));
        }
    }
    let [d, d2, d4] = sums;
    Some(std::array::from_fn(|j| {
        let freedoms = d[j] * d[j] / (d2[j] + d2[j] * d2[j] - d4[j]);
        // OK because it is between 1 and the number of blocks, but for rounding.
        student_975((freedoms + 1e-9) as usize) * (squares[j] * (count - 1.0) / count).sqrt()
    }))
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A mean of four numbers, each a block: its jackknife is the textbook's standard error, SD/√n, of which t(0.975, 3) = 3.1824.
    #[test]
    fn a_mean_has_students_interval() {
        let of = |y: f64| {
            let mut block = Block::<1>::empty();
            block.add([1.0], y);
            block
        };
        let [half] = jackknifed(&[1.0, 2.0, 4.0, 9.0].map(of)).unwrap();
        let sd = (38.0_f64 / 3.0).sqrt();
        assert!((half - 3.182_446_305 * sd / 2.0).abs() < 1e-12, "{half}");
        assert!(jackknifed(&[of(1.0)]).is_none());
    }

    /// Two blocks have one degree of freedom, however unlike they are: 0 once and 4 three times, whose mean is 3, 4 without the one and 0 without the other.
    #[test]
    fn a_block_that_tells_nearly_all_leaves_one_degree_of_freedom() {
        let mut blocks = [Block::<1>::empty(), Block::empty()];
        blocks[0].add([1.0], 0.0);
        (0..3).for_each(|_| blocks[1].add([1.0], 4.0));
        let [half] = jackknifed(&blocks).unwrap();
        assert!(
            (half - 12.706_204_736 * 5.0_f64.sqrt()).abs() < 1e-12,
            "{half}"
        );
    }

    /// scipy.stats.bootstrap((v,), numpy.mean, method="percentile", n_resamples=200000, rng=1).confidence_interval of SciPy 1.17.1, within what 500 draws
    /// leave uncertain of a quantile, three times √(pq/n)/f = 0.12 standard errors of 0.465.
    #[test]
    fn val_scipy_bootstrap() {
        let of = |k: u32| {
            let mut block = Block::<1>::empty();
            block.add([1.0], f64::from(k * 37 % 101) / 10.0);
            block
        };
        let blocks: Vec<Block<1>> = (0..40).map(of).collect();
        let ([mean], [[low, high]]) = bootstrapped(&blocks, |p| [p[0]]).unwrap();
        assert!((mean - 4.985).abs() < 1e-12, "{mean}");
        for (end, known) in [(low, 4.0725), (high, 5.895)] {
            assert!((end - known).abs() < 0.17, "{end}, SciPy {known}");
        }
    }

    /// Points (x, y) whose regressions are known by hand: of y on x 15/14, of x on y 15/17, so that y/x is 17/15.
    #[test]
    fn the_other_regression_is_found() {
        let mut block = Block::<1>::empty();
        for (x, y) in [(1.0, 2.0), (2.0, 2.0), (3.0, 3.0)] {
            block.add([x], y);
        }
        let found = whoever_errs(&[block]).unwrap();
        for (p, known) in found.iter().zip([15.0 / 14.0, 17.0 / 15.0]) {
            assert!((p[0] - known).abs() < 1e-14, "{found:?}");
        }
    }
}

//! Fisher's information of unknowns that all carriers share and of such as each has for itself.
//!
//! ```text
//!     ⎛ A   B₁ᵀ  B₂ᵀ … ⎞                               S = A − Σ B_cᵀ D_c⁻¹ B_c
//! F = ⎜ B₁  D₁   0   … ⎟        F x = g:               S a = g_a − Σ B_cᵀ D_c⁻¹ g_c        x_c = D_c⁻¹ (g_c − B_c a)
//!     ⎝ B₂  0    D₂  … ⎠        variances (of F⁻¹):    S⁻¹ and D_c⁻¹ + D_c⁻¹ B_c S⁻¹ B_cᵀ D_c⁻¹
//! ```
//! No observation is of two carriers, so the work grows with their number and not with its cube. Source: Golub & Van Loan, Matrix
//! Computations (2013), §3.2.11.

use super::unknowns::{OWN, SHARED, place};
use nalgebra::{DVector, Matrix2, SMatrix, SVector, Vector2};

type Of = SMatrix<f64, SHARED, SHARED>;
type With = SMatrix<f64, 2, SHARED>;

/// F: A, and (B_c, D_c) of each carrier.
#[derive(Clone)]
pub struct Information {
    shared: Of,
    carriers: Vec<(With, Matrix2<f64>)>,
}

impl Information {
    /// Of so many carriers of whom nothing is known.
    pub fn zero(carriers: usize) -> Self {
        Self {
            shared: Of::zeros(),
            carriers: vec![Default::default(); carriers],
        }
    }

    /// Adds `row(j)`, j ≤ `i`, to the row of carrier `c`'s unknown `i`, and to its column.
    #[inline(always)]
    pub fn add(&mut self, c: usize, i: usize, row: impl Fn(usize) -> f64) {
        let (with, own) = &mut self.carriers[c];
        for j in 0..=i {
            let x = row(j);
            match (i < OWN, j < OWN) {
                (true, _) => {
                    self.shared[(i, j)] += x;
                    if j < i {
                        self.shared[(j, i)] += x;
                    }
                }
                (false, true) => with[(i - OWN, j)] += x,
                (false, false) => {
                    own[(i - OWN, j - OWN)] += x;
                    if j < i {
                        own[(j - OWN, i - OWN)] += x;
                    }
                }
            }
        }
    }

    /// What stands on the diagonal at `k`, of all unknowns.
    pub fn diagonal(&mut self, k: usize) -> &mut f64 {
        match k.checked_sub(SHARED) {
            None => &mut self.shared[(k, k)],
            Some(k) => &mut self.carriers[k / 2].1[(k % 2, k % 2)],
        }
    }

    /// x of F x = `g`; `None` unless F is positive definite.
    pub fn solve(&self, g: &DVector<f64>) -> Option<DVector<f64>> {
        let mut rest = self.shared;
        let mut right: SVector<f64, SHARED> = g.fixed_rows::<SHARED>(0).into();
        let mut each = Vec::with_capacity(self.carriers.len());
        for (c, (with, own)) in self.carriers.iter().enumerate() {
            let own = own.cholesky()?;
            let alone: Vector2<f64> = own.solve(&g.fixed_rows::<2>(place(OWN, c)).into_owned());
            let with_it = own.solve(with);
            rest -= with.tr_mul(&with_it);
            right -= with.tr_mul(&alone);
            each.push((alone, with_it));
        }
        let shared = rest.cholesky()?.solve(&right);
        let mut x = DVector::zeros(g.len());
        x.fixed_rows_mut::<SHARED>(0).copy_from(&shared);
        for (c, (alone, with_it)) in each.into_iter().enumerate() {
            let own = alone - with_it * shared;
            x.fixed_rows_mut::<2>(place(OWN, c)).copy_from(&own);
        }
        Some(x)
    }

    /// The diagonal of F⁻¹; `None` where there is no inverse, or not in finite numbers.
    pub fn variances(&self) -> Option<DVector<f64>> {
        let mut rest = self.shared;
        let mut each = Vec::with_capacity(self.carriers.len());
        for (with, own) in &self.carriers {
            let own = own.try_inverse()?;
            let with_it = own * with;
            rest -= with.tr_mul(&with_it);
            each.push((own, with_it));
        }
        let rest = rest.try_inverse()?;
        let own = each.iter().flat_map(|(own, with_it)| {
            let sum = own + with_it * rest * with_it.transpose();
            [sum[(0, 0)], sum[(1, 1)]]
        });
        let all: Vec<f64> = (0..SHARED).map(|k| rest[(k, k)]).chain(own).collect();
        let finite = all.iter().all(|x| x.is_finite());
        finite.then(|| DVector::from_vec(all))
    }
}

#[cfg(test)]
mod tests {
    use super::super::unknowns::N;
    use super::*;
    use crate::random::Random;
    use nalgebra::DMatrix;

    /// Three carriers' information from random rows, in blocks and as one matrix.
    fn both() -> (Information, DMatrix<f64>) {
        let mut random = Random(7);
        let mut blocks = Information::zero(3);
        let mut whole = DMatrix::zeros(12, 12);
        for c in (0..3).flat_map(|c| [c; 40]) {
            let row: Vec<f64> = (0..N).map(|_| random.uniform() - 0.5).collect();
            for i in 0..N {
                blocks.add(c, i, |j| row[i] * row[j]);
                for j in 0..N {
                    whole[(place(i, c), place(j, c))] += row[i] * row[j];
                }
            }
        }
        (blocks, whole)
    }

    #[test]
    fn blocks_give_what_the_whole_matrix_gives() {
        let (mut blocks, mut whole) = both();
        for k in 0..12 {
            *blocks.diagonal(k) *= 1.0 + k as f64;
            whole[(k, k)] *= 1.0 + k as f64;
        }
        let g = DVector::from_fn(12, |k, _| 1.0 / (1.0 + k as f64));
        let x = whole.clone().cholesky().unwrap().solve(&g);
        let off = (blocks.solve(&g).unwrap() - &x).amax();
        assert!(off < 1e-13 * x.amax(), "{off:e}");
        let inverse = whole.try_inverse().unwrap();
        let off = (blocks.variances().unwrap() - inverse.diagonal()).amax();
        assert!(off < 1e-13 * inverse.amax(), "{off:e}");
    }

    #[test]
    fn what_is_not_positive_has_no_step() {
        for k in [0, 5, 6, 11] {
            let (mut blocks, _) = both();
            *blocks.diagonal(k) = -1.0;
            assert!(blocks.solve(&DVector::zeros(12)).is_none(), "{k}");
        }
        assert!(Information::zero(2).variances().is_none());
    }
}

//! Every pair of columns.

use nalgebra::DMatrix;

/// Columns at a time: what is between is never larger than so many by all.
const BLOCK: usize = 64;

/// Σ x_j y_k over the rows, of every pair of columns j < k: (0, 1), (0, 2), …
pub fn products(x: &DMatrix<f64>, y: &DMatrix<f64>) -> Vec<f64> {
    let n = x.ncols();
    let mut out = Vec::with_capacity(n * n.saturating_sub(1) / 2);
    for first in (0..n).step_by(BLOCK) {
        let wide = BLOCK.min(n - first);
        let block = x.columns(first, wide).transpose() * y.columns(first, n - first);
        for j in 0..wide {
            out.extend(block.row(j).iter().skip(j + 1));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_come_in_order_within_blocks_and_across() {
        let of = |seed: f64| DMatrix::from_fn(3, 131, |i, j| (seed + (i * 131 + j) as f64).sin());
        let (x, y) = (of(0.0), of(0.5));
        let mut found = products(&x, &y).into_iter();
        for j in 0..131 {
            for k in j + 1..131 {
                let off = found.next().unwrap() - x.column(j).dot(&y.column(k));
                assert!(off.abs() < 1e-14);
            }
        }
        assert!(found.next().is_none());
    }
}

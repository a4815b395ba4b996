//! Coefficients of Radau IIA with eight stages, and what follows from them.
//!
//! The nodes are the zeros of P₈(2c − 1) − P₇(2c − 1), Legendre polynomials; a_ij integrates the j-th Lagrange polynomial of the nodes from 0
//! to c_i. Computed with 60 digits (mpmath 1.3) and rounded; the tests hold them to the order conditions. Source: Hairer & Wanner, Solving
//! Ordinary Differential Equations II, 2nd ed. (1996), IV.5.

use crate::lanes::MOMENTS;
use nalgebra::{Complex, SMatrix};
use std::sync::LazyLock;

type Square<T> = [[T; MOMENTS]; MOMENTS];

/// Eigenvalues come in pairs.
pub const HALF: usize = MOMENTS / 2;

/// c_i
pub const C: [f64; MOMENTS] = [
    0.022479386438712498109,
    0.11467905316090423191,
    0.26578982278458946848,
    0.452846373669444617,
    0.64737528288683036263,
    0.81975930826310763501,
    0.94373743946307785353,
    1.0,
];
/// a_ij
pub const A: Square<f64> = [
    [
        0.028802823892616741227,
        -0.01082169805201563681,
        0.0080690102038513812974,
        -0.0064930735965357412555,
        0.0053000410172951216633,
        -0.0042233096500098417507,
        0.0030694133491409289297,
        -0.0012238207256304551919,
    ],
    [
        0.061680826212949944669,
        0.063307905435285805126,
        -0.016766167621301961904,
        0.011276575963180063695,
        -0.0085754008480832753537,
        0.0066070568984230025476,
        -0.0047238173739918932742,
        0.0018720744944425464042,
    ],
    [
        0.055285563267234655183,
        0.13457201985444415562,
        0.08883018189912992528,
        -0.020322485837009038535,
        0.012631022220423706839,
        -0.0089700257540425781096,
        0.0061809009170075418312,
        -0.0024173537825988996342,
    ],
    [
        0.058300686057539361005,
        0.12047766147733864465,
        0.18641428431849139153,
        0.10143090415741593434,
        -0.021196196398555058755,
        0.012247274295397012648,
        -0.0077986377779008088553,
        0.0029703975397181404301,
    ],
    [
        0.056682008984800836868,
        0.12704316148341017294,
        0.1680883704193657351,
        0.20920224876383809734,
        0.099187005744833001351,
        -0.019275308810543568779,
        0.0100696465051650388,
        -0.0036218502040389509927,
    ],
    [
        0.057543032017243113193,
        0.12374099223938747147,
        0.17595155228374013928,
        0.19081981374722284715,
        0.19945688894319688049,
        0.082437024757501810642,
        -0.014724795758020657185,
        0.0045348000328360299727,
    ],
    [
        0.057146971559234027473,
        0.12522069473806975363,
        0.17264331318806793813,
        0.19741443613973729531,
        0.18521078469685743704,
        0.15862128747389664069,
        0.053712487446550115366,
        -0.0062325357793353541137,
    ],
    [
        0.057254407372128599671,
        0.12482395066493248163,
        0.17350739781725064011,
        0.19578608372624679654,
        0.18825877269455927829,
        0.15206531032339256449,
        0.09267907740148963927,
        0.015625,
    ],
];

/// What follows from the coefficients. Matrices by columns, so that a product with a column is a sum of columns.
pub struct Tableau {
    /// (a_ij)
    pub a: Square<f64>,
    /// From values at the nodes to Legendre coefficients.
    pub legendre: Square<f64>,
    /// Weights of barycentric interpolation at 0 and the nodes.
    pub barycentric: [f64; MOMENTS + 1],
    /// Eigenvalues of (a_ij) with positive imaginary part: four real parts, four imaginary parts.
    pub values: [f64; MOMENTS],
    /// Their squares.
    pub squares: [f64; MOMENTS],
    /// From values at the nodes to what they have of the eigenvectors, real parts and imaginary parts.
    pub to_eigen: Square<f64>,
    /// And back.
    pub from_eigen: Square<f64>,
}

/// Computed when it is first asked for.
pub static TABLEAU: LazyLock<Tableau> = LazyLock::new(Tableau::new);

impl Tableau {
    fn new() -> Self {
        let a = SMatrix::<f64, MOMENTS, MOMENTS>::from_fn(|i, j| A[i][j]);
        let at_nodes = SMatrix::<f64, MOMENTS, MOMENTS>::from_fn(|i, k| legendre(k, C[i]));
        let to_legendre = at_nodes.try_inverse().expect("the nodes differ");
        let columns = |m: &SMatrix<f64, MOMENTS, MOMENTS>| -> Square<f64> {
            std::array::from_fn(|j| std::array::from_fn(|i| m[(i, j)]))
        };
        let mut all: [Complex<f64>; MOMENTS] = a.complex_eigenvalues().into();
        all.sort_by(|a, b| b.im.total_cmp(&a.im));
        let wide = a.map(|x| Complex::new(x, 0.0));
        let one = SMatrix::<Complex<f64>, MOMENTS, MOMENTS>::identity();
        let values = &all[..HALF];
        let (mut to, mut from) = ([[0.0; MOMENTS]; MOMENTS], [[0.0; MOMENTS]; MOMENTS]);
        for m in 0..HALF {
            // Π (A − λ_j)/(λ_m − λ_j) over the other eigenvalues is v wᵀ: a right and a left eigenvector.
            let others = all.iter().filter(|&&other| other != values[m]);
            let projector = others.fold(one, |product, &other| {
                product * (wide - one * other) / (values[m] - other)
            });
            let size = |k: &usize| projector.column(*k).norm();
            let column = (0..MOMENTS)
                .max_by(|a, b| size(a).total_cmp(&size(b)))
                .unwrap_or(0);
            let right = projector.column(column).normalize();
            let left = right.adjoint() * projector;
            for i in 0..MOMENTS {
                (to[i][m], to[i][HALF + m]) = (left[i].re, left[i].im);
                // With its conjugate a pair counts twice its real part.
                (from[m][i], from[HALF + m][i]) = (2.0 * right[i].re, -2.0 * right[i].im);
            }
        }
        let side_by_side = |each: fn(Complex<f64>) -> Complex<f64>| {
            let parts: [Complex<f64>; MOMENTS] = std::array::from_fn(|m| each(values[m % HALF]));
            std::array::from_fn(|m| if m < HALF { parts[m].re } else { parts[m].im })
        };
        let nodes = with_start();
        Self {
            a: columns(&a),
            legendre: columns(&to_legendre),
            barycentric: std::array::from_fn(|i| {
                let others = (0..=MOMENTS).filter(|&j| j != i);
                others.map(|j| 1.0 / (nodes[i] - nodes[j])).product()
            }),
            values: side_by_side(|x| x),
            squares: side_by_side(|x| x * x),
            to_eigen: to,
            from_eigen: from,
        }
    }
}

/// 0 and the nodes.
pub fn with_start() -> [f64; MOMENTS + 1] {
    let mut nodes = [0.0; MOMENTS + 1];
    nodes[1..].copy_from_slice(&C);
    nodes
}

/// P_k(2c − 1)
fn legendre(k: usize, c: f64) -> f64 {
    let x = 2.0 * c - 1.0;
    let (mut before, mut value) = (0.0, 1.0);
    for n in 0..k {
        let n = n as f64;
        (before, value) = (
            value,
            ((2.0 * n + 1.0) * x * value - n * before) / (n + 1.0),
        );
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_conditions_hold() {
        let power = |x: f64, k: usize| x.powi(k as i32);
        // Quadrature to degree 14; every stage to degree 7; and the condition on rows that makes the order 15.
        for k in 1..=15 {
            let b: f64 = (0..MOMENTS).map(|j| A[7][j] * power(C[j], k - 1)).sum();
            assert!((b - 1.0 / k as f64).abs() < 1e-15, "B({k})");
        }
        for k in 1..=8 {
            for (row, c) in A.iter().zip(C) {
                let a: f64 = (0..MOMENTS).map(|j| row[j] * power(C[j], k - 1)).sum();
                assert!((a - power(c, k) / k as f64).abs() < 1e-15, "C({k})");
            }
        }
        for k in 1..=7 {
            for j in 0..MOMENTS {
                let d: f64 = (0..MOMENTS)
                    .map(|i| A[7][i] * power(C[i], k - 1) * A[i][j])
                    .sum();
                let right = A[7][j] / k as f64 * (1.0 - power(C[j], k));
                assert!((d - right).abs() < 1e-15, "D({k})");
            }
        }
    }

    #[test]
    fn eigenvectors_resolve_the_matrix() {
        // from·to = 1 and from·λ·to = A, where λ turns the parts of an eigenvector into each other.
        for j in 0..MOMENTS {
            let to = TABLEAU.to_eigen[j];
            let times = |m: usize| {
                let (re, im) = (TABLEAU.values[m % HALF], TABLEAU.values[m % HALF + HALF]);
                if m < HALF {
                    re * to[m] - im * to[m + HALF]
                } else {
                    re * to[m] + im * to[m - HALF]
                }
            };
            for i in 0..MOMENTS {
                let sum = |part: &dyn Fn(usize) -> f64| -> f64 {
                    (0..MOMENTS)
                        .map(|m| TABLEAU.from_eigen[m][i] * part(m))
                        .sum()
                };
                let one = sum(&|m| to[m]);
                // The eigenvectors are far from a right angle to each other.
                assert!((one - f64::from(u8::from(i == j))).abs() < 1e-10, "{one}");
                assert!((sum(&times) - A[i][j]).abs() < 1e-10, "{i} {j}");
            }
        }
        let re = |m: usize| Complex::new(TABLEAU.values[m], TABLEAU.values[m + HALF]);
        for m in 0..HALF {
            let square = Complex::new(TABLEAU.squares[m], TABLEAU.squares[m + HALF]);
            assert!((re(m) * re(m) - square).norm() < 1e-16);
        }
    }
}

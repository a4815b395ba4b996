//! RKF8: Fehlberg's method of order 8 with error estimates of order 5, and a cubic between the ends of a step.
//!
//! The cubic is too rough for most of what is read off a step, so samples are stepped to and steps end just beyond events: dear, but
//! nothing is shared with the methods that people use. `sim accuracy` judges those by this one.
//! Source: Fehlberg, NASA TR R-287 (1968), Table X; Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I (1993), II.5.

use super::pair::{Arithmetic, Pair, Polynomial, Row, Slopes, TILE, cubic, sum};

pub struct Fehlberg8;

/// Fehlberg's own estimate, 41/840 (k₀ + k₁₀ − k₁₁ − k₁₂), is blind to a force that turns within the step, as friction does: all of it
/// stands at the step's ends. These two are what is left of order 5 between stages over all of the step, and do not vanish together.
const E: [Row; 2] = [
    &[
        (0, 0.1),
        (5, -1.0),
        (6, -0.1),
        (7, -0.5),
        (8, 0.5),
        (9, 1.0),
    ],
    &[
        (0, -0.1),
        (5, -1.0),
        (6, -0.9),
        (7, 0.3),
        (8, 1.5),
        (10, 0.2),
    ],
];

impl Pair for Fehlberg8 {
    const NAME: &'static str = "fehlberg8";
    const STAGES: usize = 13;
    const DENSE_STAGES: usize = 0;
    const PASSING: usize = 4;
    const EXPONENT: f64 = 1.0 / 6.0;
    const DENSE_ROWS: usize = 3;
    const SHARE: f64 = 2e-3;
    const STABLE: f64 = 5.0;
    const A: &'static [Row] = &[
        &[(0, 2.0 / 27.0)],
        &[(0, 1.0 / 36.0), (1, 1.0 / 12.0)],
        &[(0, 1.0 / 24.0), (2, 1.0 / 8.0)],
        &[(0, 5.0 / 12.0), (2, -25.0 / 16.0), (3, 25.0 / 16.0)],
        &[(0, 1.0 / 20.0), (3, 1.0 / 4.0), (4, 1.0 / 5.0)],
        &[
            (0, -25.0 / 108.0),
            (3, 125.0 / 108.0),
            (4, -65.0 / 27.0),
            (5, 125.0 / 54.0),
        ],
        &[
            (0, 31.0 / 300.0),
            (4, 61.0 / 225.0),
            (5, -2.0 / 9.0),
            (6, 13.0 / 900.0),
        ],
        &[
            (0, 2.0),
            (3, -53.0 / 6.0),
            (4, 704.0 / 45.0),
            (5, -107.0 / 9.0),
            (6, 67.0 / 90.0),
            (7, 3.0),
        ],
        &[
            (0, -91.0 / 108.0),
            (3, 23.0 / 108.0),
            (4, -976.0 / 135.0),
            (5, 311.0 / 54.0),
            (6, -19.0 / 60.0),
            (7, 17.0 / 6.0),
            (8, -1.0 / 12.0),
        ],
        &[
            (0, 2383.0 / 4100.0),
            (3, -341.0 / 164.0),
            (4, 4496.0 / 1025.0),
            (5, -301.0 / 82.0),
            (6, 2133.0 / 4100.0),
            (7, 45.0 / 82.0),
            (8, 45.0 / 164.0),
            (9, 18.0 / 41.0),
        ],
        &[
            (0, 3.0 / 205.0),
            (5, -6.0 / 41.0),
            (6, -3.0 / 205.0),
            (7, -3.0 / 41.0),
            (8, 3.0 / 41.0),
            (9, 6.0 / 41.0),
        ],
        &[
            (0, -1777.0 / 4100.0),
            (3, -341.0 / 164.0),
            (4, 4496.0 / 1025.0),
            (5, -289.0 / 82.0),
            (6, 2193.0 / 4100.0),
            (7, 51.0 / 82.0),
            (8, 33.0 / 164.0),
            (9, 12.0 / 41.0),
            (11, 1.0),
        ],
    ];
    const C: &'static [f64] = &[
        0.0,
        2.0 / 27.0,
        1.0 / 9.0,
        1.0 / 6.0,
        5.0 / 12.0,
        1.0 / 2.0,
        5.0 / 6.0,
        1.0 / 6.0,
        2.0 / 3.0,
        1.0 / 3.0,
        1.0,
        0.0,
        1.0,
    ];
    const B: Row = &[
        (5, 34.0 / 105.0),
        (6, 9.0 / 35.0),
        (7, 9.0 / 35.0),
        (8, 9.0 / 280.0),
        (9, 9.0 / 280.0),
        (11, 41.0 / 840.0),
        (12, 41.0 / 840.0),
    ];
    const A_DENSE: &'static [Row] = &[];
    const C_DENSE: &'static [f64] = &[];

    #[inline(always)]
    fn last_term(theta: f64) -> f64 {
        // A cubic errs by hardly less than its last term where that is large: it is believed where the term is a hundred times smaller.
        100.0 * theta * theta * (1.0 - theta)
    }

    #[inline(always)]
    fn errors<F: Arithmetic>(k: &Slopes) -> [[f64; TILE]; 2] {
        E.map(|row| sum::<F>(row, k))
    }

    #[inline(always)]
    fn dense<F: Arithmetic>(
        h: f64,
        y0: &[f64; TILE],
        y1: &[f64; TILE],
        k: &Slopes,
        out: &mut Polynomial,
    ) {
        cubic(h, y0, y1, &k[0], &k[13], out);
    }

    #[inline(always)]
    fn interpolate<F: Arithmetic>(theta: f64, y0: &[f64; TILE], r: &Polynomial) -> [f64; TILE] {
        let rest = 1.0 - theta;
        std::array::from_fn(|l| {
            let inner = F::madd(theta, r[2][l], r[1][l]);
            F::madd(theta, F::madd(rest, inner, r[0][l]), y0[l])
        })
    }
}

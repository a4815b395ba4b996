//! DOPRI5: the Dormand–Prince method of order 5 with an error estimate of order 4 and dense output of order 4.
//!
//! Source: Dormand & Prince, J. Comput. Appl. Math. 6 (1980), 19–26; dense output: Hairer, Nørsett, Wanner (1993), II.6.

use super::pair::{Arithmetic, Pair, Polynomial, Row, Slopes, TILE, cubic, sum};

pub struct Dopri5;

const E: Row = &[
    (0, 71.0 / 57600.0),
    (2, -71.0 / 16695.0),
    (3, 71.0 / 1920.0),
    (4, -17253.0 / 339200.0),
    (5, 22.0 / 525.0),
    (6, -1.0 / 40.0),
];
const D: Row = &[
    (0, -12715105075.0 / 11282082432.0),
    (2, 87487479700.0 / 32700410799.0),
    (3, -10690763975.0 / 1880347072.0),
    (4, 701980252875.0 / 199316789632.0),
    (5, -1453857185.0 / 822651844.0),
    (6, 69997945.0 / 29380423.0),
];

impl Pair for Dopri5 {
    const NAME: &'static str = "dopri5";
    const STAGES: usize = 6;
    const DENSE_STAGES: usize = 0;
    const PASSING: usize = 1;
    const EXPONENT: f64 = 1.0 / 5.0;
    const DENSE_ROWS: usize = 4;
    const SHARE: f64 = 1.5e-3;
    const STABLE: f64 = 3.25;
    const A: &'static [Row] = &[
        &[(0, 1.0 / 5.0)],
        &[(0, 3.0 / 40.0), (1, 9.0 / 40.0)],
        &[(0, 44.0 / 45.0), (1, -56.0 / 15.0), (2, 32.0 / 9.0)],
        &[
            (0, 19372.0 / 6561.0),
            (1, -25360.0 / 2187.0),
            (2, 64448.0 / 6561.0),
            (3, -212.0 / 729.0),
        ],
        &[
            (0, 9017.0 / 3168.0),
            (1, -355.0 / 33.0),
            (2, 46732.0 / 5247.0),
            (3, 49.0 / 176.0),
            (4, -5103.0 / 18656.0),
        ],
    ];
    const C: &'static [f64] = &[0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0];
    const B: Row = &[
        (0, 35.0 / 384.0),
        (2, 500.0 / 1113.0),
        (3, 125.0 / 192.0),
        (4, -2187.0 / 6784.0),
        (5, 11.0 / 84.0),
    ];
    const A_DENSE: &'static [Row] = &[];
    const C_DENSE: &'static [f64] = &[];

    #[inline(always)]
    fn last_term(theta: f64) -> f64 {
        // The cubic Hermite part is of order 3, the last row lifts it to 4.
        (theta * (1.0 - theta)).powi(2)
    }

    #[inline(always)]
    fn errors<F: Arithmetic>(k: &Slopes) -> [[f64; TILE]; 2] {
        [sum::<F>(E, k), [0.0; TILE]]
    }

    #[inline(always)]
    fn dense<F: Arithmetic>(
        h: f64,
        y0: &[f64; TILE],
        y1: &[f64; TILE],
        k: &Slopes,
        out: &mut Polynomial,
    ) {
        cubic(h, y0, y1, &k[0], &k[6], out);
        out[3] = sum::<F>(D, k).map(|last| h * last);
    }

    #[inline(always)]
    fn interpolate<F: Arithmetic>(theta: f64, y0: &[f64; TILE], r: &Polynomial) -> [f64; TILE] {
        let rest = 1.0 - theta;
        let mut out = [0.0; TILE];
        for l in 0..TILE {
            let inner = F::madd(rest, r[3][l], r[2][l]);
            let inner = F::madd(theta, inner, r[1][l]);
            out[l] = F::madd(theta, F::madd(rest, inner, r[0][l]), y0[l]);
        }
        out
    }
}

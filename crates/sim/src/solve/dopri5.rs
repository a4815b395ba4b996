//! DOPRI5: the Dormand–Prince method of order 5 with an error estimate of order 4 and dense output of order 4.
//!
//! Source: Dormand & Prince, J. Comput. Appl. Math. 6 (1980), 19–26; dense output: Hairer, Nørsett, Wanner (1993), II.6.

use super::pair::{Pair, Row, Stages, rms};

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
    const EXPONENT: f64 = 1.0 / 5.0;
    const DENSE_ROWS: usize = 4;
    const A: &'static [Row] = &[
        &[(0, 1.0 / 5.0)],
        &[(0, 3.0 / 40.0), (1, 9.0 / 40.0)],
        &[(0, 44.0 / 45.0), (1, -56.0 / 15.0), (2, 32.0 / 9.0)],
        &[(0, 19372.0 / 6561.0), (1, -25360.0 / 2187.0), (2, 64448.0 / 6561.0), (3, -212.0 / 729.0)],
        &[(0, 9017.0 / 3168.0), (1, -355.0 / 33.0), (2, 46732.0 / 5247.0), (3, 49.0 / 176.0), (4, -5103.0 / 18656.0)],
    ];
    const C: &'static [f64] = &[0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0];
    const B: Row =
        &[(0, 35.0 / 384.0), (2, 500.0 / 1113.0), (3, 125.0 / 192.0), (4, -2187.0 / 6784.0), (5, 11.0 / 84.0)];
    const A_DENSE: &'static [Row] = &[];
    const C_DENSE: &'static [f64] = &[];

    #[inline(always)]
    fn error(h: f64, k: &Stages, scale: &[f64]) -> f64 {
        rms(scale, |d| h * k.sum(E, d))
    }

    fn dense(h: f64, y0: &[f64], y1: &[f64], k: &Stages, out: &mut [Vec<f64>]) {
        let (f0, f1) = (k.get(0), k.get(6));
        for d in 0..y0.len() {
            let dy = y1[d] - y0[d];
            let bump = h * f0[d] - dy;
            out[0][d] = dy;
            out[1][d] = bump;
            out[2][d] = dy - h * f1[d] - bump;
            out[3][d] = h * k.sum(D, d);
        }
    }

    fn interpolate(theta: f64, y0: &[f64], rows: &[Vec<f64>], out: &mut [f64]) {
        let rest = 1.0 - theta;
        for (d, o) in out.iter_mut().enumerate() {
            let r = |i: usize| rows[i][d];
            *o = y0[d] + theta * (r(0) + rest * (r(1) + theta * (r(2) + rest * r(3))));
        }
    }
}

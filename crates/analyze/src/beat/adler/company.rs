//! What carriers see of each other: the mean field of everybody else, along the way.

use super::walk::{Field, Walk};
use std::f64::consts::PI;

/// The field that each carrier is in, step by step; empty where there is only one.
pub fn company(walk: &Walk) -> Vec<Vec<Field>> {
    let n = walk.phase.len();
    if n < 2 {
        return Vec::new();
    }
    let steps = walk.t_s.len() - 1;
    // Phases turn evenly enough that halfway between two is their mean.
    let courses: Vec<Vec<f64>> = walk.phase.iter().map(|p| course(walk, p)).collect();
    let pointer = |c: usize, k: usize| -> Field {
        let [a, b] = [courses[c][k], courses[c][k + 1]];
        [a, 0.5 * (a + b), b].map(|phi| match phi.is_finite() {
            true => [phi.cos(), phi.sin()],
            false => [0.0; 2],
        })
    };
    let combine = |a: Field, b: Field, sign: f64| -> Field {
        std::array::from_fn(|m| std::array::from_fn(|x| a[m][x] + sign * b[m][x]))
    };
    let all: Vec<Field> = (0..steps)
        .map(|k| (0..n).fold(Field::default(), |sum, c| combine(sum, pointer(c, k), 1.0)))
        .collect();
    let others = |c: usize| -> Vec<Field> {
        let of = |k: usize| combine(all[k], pointer(c, k), -1.0);
        let shared = |field: Field| field.map(|z| z.map(|x| x / n as f64));
        (0..steps).map(|k| shared(of(k))).collect()
    };
    (0..n).map(others).collect()
}

/// A carrier's phase at each moment of the grid, straight between what was observed; NaN outside, and through more than half a turn off the
/// usual rate, where it may have slipped a turn unseen.
fn course(walk: &Walk, phase: &[f64]) -> Vec<f64> {
    let behind_s = walk.behind_s();
    let seen: Vec<(f64, f64)> = (walk.t_s.iter().zip(phase))
        .filter(|(_, y)| y.is_finite())
        .map(|(t, y)| (t - behind_s, *y))
        .collect();
    let mut out = vec![f64::NAN; walk.t_s.len()];
    let mut k = 0;
    for ends in seen.windows(2) {
        let [(from_s, from), (to_s, to)] = [ends[0], ends[1]];
        let slope = (to - from) / (to_s - from_s);
        let usual = ((slope - walk.omega_rad_per_s) * (to_s - from_s)).abs() < PI;
        while k < out.len() && walk.t_s[k] <= to_s {
            if usual && walk.t_s[k] >= from_s {
                out[k] = from + (walk.t_s[k] - from_s) * slope;
            }
            k += 1;
        }
    }
    out
}

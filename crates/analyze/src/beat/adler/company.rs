//! What carriers see of each other: the mean field of everybody else, along the way.

use super::walk::{Field, Walk};
use std::f64::consts::PI;

/// The field that each carrier is in, step by step; empty where there is only one.
pub fn company(walk: &Walk) -> Vec<Vec<Field>> {
    let n = walk.phase.len();
    if n < 2 {
        return Vec::new();
    }
    let pointer = |phi: f64| match phi.is_finite() {
        true => [phi.cos(), phi.sin()],
        false => [0.0; 2],
    };
    // Phases turn evenly enough that halfway between two is their mean.
    let mut fields: Vec<Vec<Field>> = (walk.phase.iter())
        .map(|phase| course(walk, phase))
        .map(|phi| {
            let step = |phi: &[f64]| [phi[0], 0.5 * (phi[0] + phi[1]), phi[1]].map(pointer);
            phi.windows(2).map(step).collect()
        })
        .collect();
    let combine = |a: &Field, b: &Field, sign: f64| -> Field {
        std::array::from_fn(|m| std::array::from_fn(|x| a[m][x] + sign * b[m][x]))
    };
    for k in 0..walk.t_s.len() - 1 {
        let all = (fields.iter()).fold(Field::default(), |sum, own| combine(&sum, &own[k], 1.0));
        for own in &mut fields {
            own[k] = combine(&all, &own[k], -1.0).map(|z| z.map(|x| x / n as f64));
        }
    }
    fields
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

//! How high it is thrown.

use super::contact::{deviation, mean};
use super::{Context, Value};
use crate::summary::{ends, rounding};
use std::f64::consts::PI;

pub fn dz_pp_m(c: &Context) -> Value {
    let z = &c.height().x;
    let [low, high] = ends(z);
    let span = high - low;
    Value::number(if span > rounding(&[low, high]) {
        span
    } else {
        0.0
    })
}

pub fn rms_z_m(c: &Context) -> Value {
    Value::number(deviation(&c.height().x))
}

pub fn z_mean_m(c: &Context) -> Value {
    Value::number(mean(&c.height().x))
}

pub fn growth_ratio(c: &Context) -> Value {
    let z = &c.height().x;
    let third = z.len() / 3;
    if third == 0 {
        return Value::missing("fewer than three samples in the window");
    }
    let middle = mean(z);
    let rms = |z: &[f64]| {
        (z.iter().map(|z| (z - middle) * (z - middle)).sum::<f64>() / third as f64).sqrt()
    };
    let (first, last) = (rms(&z[..third]), rms(&z[z.len() - third..]));
    if first <= rounding(z) {
        return Value::missing("the height does not move in the first third of the window");
    }
    let third_s = c.height().step_s().unwrap_or(0.0) * third as f64;
    let swings = c.height_line().map(|line| line.hz * third_s);
    let cut = swings.filter(|n| by_cut(*n) > COARSE).map(|n| {
        let most = 100.0 * by_cut(n);
        format!("a third of the window holds {n:.1} swings: where they are cut alone changes it by up to {most:.0} %")
    });
    Value::number(last / first).remark(cut)
}

/// Share of a growth from which it is worth a word that it hangs on where swings are cut.
const COARSE: f64 = 0.05;

/// How far the ratio of a sine's RMS in the last third to that in the first goes from 1, at most, where each holds n swings:
///
/// ```text
/// ⟨x²⟩ = a²/2 (1 − sin 2πn cos(2πn + 2φ) / 2πn),    φ' = φ + 4πn,    |x'/x − 1| ≤ |sin 2πn sin 4πn| / 2πn ≤ 2 / (3√3 π n)
/// ```
/// First order in 1/n, the mean over all three left out: of 1.3 swings it is 0.09, and 0.08 is reached.
fn by_cut(swings: f64) -> f64 {
    2.0 / (27f64.sqrt() * PI * swings)
}

#[cfg(test)]
mod tests {
    use super::by_cut;
    use crate::inputs::{Inputs, Window};
    use crate::metrics::metrics;
    use std::f64::consts::TAU;

    /// Steady swings, n to a third, cut anywhere: what is found of their growth is within the bound, and comes near it.
    #[test]
    fn a_growth_of_few_swings_says_how_much_of_it_is_how_they_are_cut() {
        let found = |swings: f64, phase: f64| {
            let t_s: Vec<f64> = (0..3000).map(|k| f64::from(k) / 1000.0).collect();
            let inputs = Inputs {
                height_m: t_s
                    .iter()
                    .map(|t| (TAU * swings * t + phase).sin())
                    .collect(),
                t_s,
                ..Inputs::default()
            };
            let found = metrics(&inputs, Window::ALL);
            let growth = found.get("growth_ratio").unwrap();
            (found.number("growth_ratio").unwrap(), growth.reason.clone())
        };
        for swings in [1.3, 2.65, 3.15, 4.65, 8.15] {
            let phases = (0..32).map(|k| TAU * f64::from(k) / 32.0);
            let most = phases.map(|phase| (found(swings, phase).0 - 1.0).abs());
            let share = most.fold(0.0, f64::max) / by_cut(swings);
            assert!((0.8..1.05).contains(&share), "{swings}: {share}");
        }
        let said = found(1.3, 0.0).1.unwrap();
        assert!(
            said.contains("holds 1.3 swings") && said.contains("up to 9 %"),
            "{said}"
        );
        assert_eq!(found(3.0, 0.0).1, None);
    }
}

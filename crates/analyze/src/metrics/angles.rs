//! How far it leans: root mean squares of the angles, and the time spent far over.

use super::{Context, Value};
use crate::phase::continuous;
use crate::summary::ends;

/// |roll| beyond which a sample counts as excess (deg).
const EXCESS_DEG: f64 = 15.0;

/// Root mean square about zero, √(Σx²/n), in degrees.
fn rms_deg(x: &[f64]) -> Value {
    Value::number(
        (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64)
            .sqrt()
            .to_degrees(),
    )
}

pub fn rms_roll_deg(c: &Context) -> Value {
    rms_deg(&c.roll().x)
}

pub fn rms_pitch_deg(c: &Context) -> Value {
    rms_deg(&c.pitch().x)
}

/// A heading that goes through more than this is a way that was walked and no swaying (deg).
const TURNS_DEG: f64 = 90.0;

pub fn rms_yaw_deg(c: &Context) -> Value {
    let yaw = c.yaw();
    let [low, high] = ends(&continuous(&yaw.x));
    let turned_deg = (high - low).to_degrees();
    Value {
        reason: (turned_deg > TURNS_DEG).then(|| {
            format!("the heading goes through {turned_deg:.0}°: about zero that says nothing of how it sways")
        }),
        ..rms_deg(&yaw.x)
    }
}

pub fn roll_excess_s(c: &Context) -> Value {
    let roll = c.roll();
    let Some(step_s) = roll.step_s() else {
        return Value::missing("fewer than two samples in the window: no sampling step");
    };
    let limit = EXCESS_DEG.to_radians();
    let count = roll.x.iter().filter(|x| x.abs() > limit).count();
    Value::number(count as f64 * step_s)
}

#[cfg(test)]
mod tests {
    use crate::inputs::{Inputs, Window};
    use crate::metrics::metrics;

    #[test]
    fn a_heading_that_turns_is_no_sway() {
        let said = |turn_rad: f64| {
            let t_s: Vec<f64> = (0..1800).map(|k| f64::from(k) / 30.0).collect();
            let inputs = Inputs {
                yaw_rad: t_s
                    .iter()
                    .map(|t| crate::phase::wrap(turn_rad * t / 60.0))
                    .collect(),
                t_s,
                ..Inputs::default()
            };
            let found = metrics(&inputs, Window::ALL)
                .get("rms_yaw_deg")
                .unwrap()
                .clone();
            assert!(found.as_f64().is_some());
            found.reason
        };
        assert_eq!(said(0.5), None);
        assert!(said(4.7).unwrap().contains("goes through 269°"));
    }
}

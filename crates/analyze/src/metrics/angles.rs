//! How far it leans: root mean squares of the angles, and the time spent far over.

use super::{Context, Value};
use crate::phase::{continuous, wrap};
use crate::summary::ends;
use std::f64::consts::FRAC_PI_2;

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

/// That of an angle that is wrapped, with a word where it goes through more than `most_deg`, as `what` does.
///
/// Only where the samples show which way it goes: seldom ones do not, nor do those near ±90° of pitch, where roll and heading leap by half a turn.
fn rms_of_sway(x: &[f64], what: &str, most_deg: f64) -> Value {
    let [low, high] = ends(&continuous(x));
    let turned_deg = (high - low).to_degrees();
    let is_seen = x.windows(2).all(|w| wrap(w[1] - w[0]).abs() < FRAC_PI_2);
    let turns = is_seen && turned_deg > most_deg;
    rms_deg(x).remark(turns.then(|| {
        format!(
            "{what} goes through {turned_deg:.0}°: about zero that says nothing of how it sways"
        )
    }))
}

/// A roll that goes through more than a turn rolls over (deg).
const ROLLS_OVER_DEG: f64 = 360.0;

pub fn rms_roll_deg(c: &Context) -> Value {
    rms_of_sway(&c.roll().x, "the roll", ROLLS_OVER_DEG)
}

pub fn rms_pitch_deg(c: &Context) -> Value {
    rms_deg(&c.pitch().x)
}

/// A heading that goes through more than this is a way that was walked and no swaying (deg).
const TURNS_DEG: f64 = 90.0;

pub fn rms_yaw_deg(c: &Context) -> Value {
    rms_of_sway(&c.yaw().x, "the heading", TURNS_DEG)
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
    fn a_heading_that_turns_and_a_roll_that_rolls_over_are_no_sway() {
        let said = |name: &str, turn_rad: f64| {
            let t_s: Vec<f64> = (0..1800).map(|k| f64::from(k) / 30.0).collect();
            let angle = t_s.iter().map(|t| turn_rad * t / 60.0);
            let angle: Vec<f64> = angle.map(crate::phase::wrap).collect();
            let inputs = Inputs {
                yaw_rad: angle.clone(),
                roll_rad: angle,
                t_s,
                ..Inputs::default()
            };
            let found = metrics(&inputs, Window::ALL).get(name).unwrap().clone();
            assert!(found.as_f64().is_some());
            found.reason
        };
        assert_eq!(said("rms_yaw_deg", 0.5), None);
        let yaw = said("rms_yaw_deg", 4.7).unwrap();
        assert!(yaw.contains("the heading goes through 269°"), "{yaw}");
        assert_eq!(said("rms_roll_deg", 6.2), None);
        let roll = said("rms_roll_deg", 12.6).unwrap();
        assert!(roll.contains("the roll goes through 722°"), "{roll}");
        // Half a turn and more to a sample: nobody knows which way.
        assert_eq!(said("rms_roll_deg", 60.0 * 30.0 * 3.5), None);
    }
}

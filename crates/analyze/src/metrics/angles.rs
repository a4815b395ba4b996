//! How far it leans: root mean squares of the angles, and the time spent far over.

use super::{Context, Value};

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

pub fn rms_yaw_deg(c: &Context) -> Value {
    rms_deg(&c.yaw().x)
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

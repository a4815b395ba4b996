//! How high it is thrown.

use super::contact::{deviation, mean};
use super::{Context, Value};
use crate::summary::{ends, rounding};

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
    if let Some(why) = c.aliased() {
        return Value::missing(why);
    }
    if first <= rounding(z) {
        return Value::missing("the height does not move in the first third of the window");
    }
    Value::number(last / first)
}

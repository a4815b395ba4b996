//! Lines: the strongest frequency of the height and of the roll, the second harmonic, the half-frequency line.

use super::{Context, Value};
use crate::line::{FEWEST_PERIODS, Line, Shares};

/// How far from twice the peak the second harmonic is looked for (Hz).
const H2_HALF_WIDTH_HZ: f64 = 0.45;

const NO_LINE: &str = "the signal does not move in the window, or has fewer than four samples";

pub fn peak_hz(c: &Context) -> Value {
    if let Some(why) = c.aliased() {
        return Value::missing(why);
    }
    c.height_line()
        .map_or_else(|| Value::missing(NO_LINE), |line| Value::number(line.hz))
}

pub fn h2_ratio(c: &Context) -> Value {
    if let Some(why) = c.aliased() {
        return Value::missing(why);
    }
    let Some(line) = c.height_line() else {
        return Value::missing(NO_LINE);
    };
    if line.hz <= H2_HALF_WIDTH_HZ {
        return Value::missing(format!(
            "the strongest line, {:.2} Hz, lies itself within {H2_HALF_WIDTH_HZ} Hz of twice its frequency",
            line.hz
        ));
    }
    match line.ratio_near(2.0 * line.hz, H2_HALF_WIDTH_HZ) {
        Some(ratio) => Value::number(ratio),
        None => Value::missing(format!(
            "twice the strongest line, {:.2} Hz, lies beyond half the sampling rate",
            2.0 * line.hz
        )),
    }
}

pub fn roll_peak_hz(c: &Context) -> Value {
    let roll = c.roll();
    Line::strongest(&roll.t_s, &roll.x)
        .map_or_else(|| Value::missing(NO_LINE), |line| Value::number(line.hz))
}

pub fn subharmonic_ratio(c: &Context) -> Value {
    let Some(line) = c.height_line() else {
        return Value::missing("the height has no line to compare with");
    };
    if let Some(why) = c.aliased().or_else(|| c.too_slow()) {
        return Value::missing(why);
    }
    let Some(shares) = Shares::of(&c.roll().t_s, &c.roll().x, line.hz) else {
        return Value::missing(format!(
            "the roll does not move, or the window is shorter than {FEWEST_PERIODS:.0} periods of {:.2} Hz",
            line.hz
        ));
    };
    // A share of a transform's rounding is none.
    if shares.at_f <= 1e-24 {
        return Value::missing("no roll power near the strongest line of the height");
    }
    Value::number(shares.at_half / shares.at_f)
}

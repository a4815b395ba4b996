//! Lines: the strongest frequency of the height and of the roll, the second harmonic, the half-frequency line.

use super::context::Series;
use super::{Context, Value};
use crate::line::{FEWEST_PERIODS, Line, Shares};

/// How far from twice the peak the second harmonic is looked for (Hz).
const H2_HALF_WIDTH_HZ: f64 = 0.45;

const NO_LINE: &str = "the signal does not move in the window, or has fewer than four samples";

pub fn peak_hz(c: &Context) -> Value {
    told(c.height_line(), c.height())
}

/// A window tells a frequency to half a bin, 1/2T: worth a word where that is more than this share of it.
const COARSE: f64 = 0.05;

/// A line's frequency.
fn told(line: Option<&Line>, of: &Series<'_>) -> Value {
    let Some(line) = line else {
        return Value::missing(NO_LINE);
    };
    let length_s = of.step_s().map_or(0.0, |step_s| step_s * of.x.len() as f64);
    let half_hz = 0.5 / length_s;
    Value {
        reason: (half_hz > COARSE * line.hz).then(|| {
            format!("a window of {length_s:.2} s tells a frequency to ± {half_hz:.2} Hz, and lines as near to each other as {:.2} Hz not apart", 2.0 * half_hz)
        }),
        ..Value::number(line.hz)
    }
}

pub fn h2_ratio(c: &Context) -> Value {
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
    told(Line::strongest(&roll.t_s, &roll.x).as_ref(), roll)
}

pub fn subharmonic_ratio(c: &Context) -> Value {
    let Some(line) = c.height_line() else {
        return Value::missing("the height has no line to compare with");
    };
    if let Some(why) = c.too_slow() {
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

#[cfg(test)]
mod tests {
    use crate::inputs::{Inputs, Window};
    use crate::metrics::metrics;

    #[test]
    fn a_short_window_says_how_well_it_tells_a_frequency() {
        let t_s: Vec<f64> = (0..600).map(|k| f64::from(k) / 30.0).collect();
        let inputs = Inputs {
            height_m: t_s.iter().map(|t| (12.566 * t).sin()).collect(),
            t_s,
            ..Inputs::default()
        };
        let said = |end_s: f64| {
            let window = Window {
                start_s: 0.0,
                end_s,
            };
            let found = metrics(&inputs, window);
            found.get("peak_hz").unwrap().reason.clone()
        };
        assert_eq!(said(10.0), None);
        assert!(
            said(1.3)
                .unwrap()
                .contains("of 1.33 s tells a frequency to ± 0.38 Hz")
        );
    }
}

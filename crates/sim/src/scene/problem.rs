//! What can be wrong with a scene: how it is found and said.

use super::Scene;
use super::per_carrier::PerCarrier;
use std::ops::RangeInclusive;

/// What is wrong with a scene, and at which key.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// Dotted key, `body.mass_kg`.
    pub key: String,
    /// What was found and what was expected.
    pub message: String,
}

/// Collects nothing: stops at the first problem, which is what a reader wants to hear about.
pub(crate) struct Checker;

impl Checker {
    /// Greatest number that any unit of the tables asks for, and then some; products of two of them are still numbers.
    pub const MOST: f64 = 1e18;
    /// Greatest angle, rad: a number of that size still knows small turns.
    const MOST_RAD: f64 = 1e6;

    pub fn within(key: &str, x: f64, range: RangeInclusive<f64>) -> Result<(), Problem> {
        if range.contains(&x) {
            return Ok(());
        }
        let (least, most) = (shown(*range.start()), shown(*range.end()));
        let expected = if x < *range.start() {
            format!("at least {least}")
        } else if x > *range.end() {
            format!("at most {most}")
        } else {
            "a number".into()
        };
        Err(problem(
            key,
            format!("found {}, expected {expected}", shown(x)),
        ))
    }

    pub fn finite(key: &str, x: f64) -> Result<(), Problem> {
        Self::within(key, x, -Self::MOST..=Self::MOST)
    }

    pub fn angle_rad(key: &str, x: f64) -> Result<(), Problem> {
        Self::within(key, x, -Self::MOST_RAD..=Self::MOST_RAD)
    }

    pub fn positive(key: &str, x: f64) -> Result<(), Problem> {
        if x > 0.0 {
            Self::within(key, x, 1.0 / Self::MOST..=Self::MOST)
        } else {
            Err(problem(
                key,
                format!("found {}, expected a number above zero", shown(x)),
            ))
        }
    }

    pub fn not_negative(key: &str, x: f64) -> Result<(), Problem> {
        if x >= 0.0 {
            Self::within(key, x, 0.0..=Self::MOST)
        } else {
            Err(problem(
                key,
                format!("found {}, expected zero or more", shown(x)),
            ))
        }
    }

    pub fn all_finite(key: &str, xs: &[f64]) -> Result<(), Problem> {
        xs.iter().try_for_each(|&x| Self::finite(key, x))
    }

    pub fn per_carrier(key: &str, x: &PerCarrier, n: usize) -> Result<(), Problem> {
        Self::all_finite(key, x.values())?;
        match x {
            PerCarrier::Each(list) if list.len() != n => Err(problem(
                key,
                format!(
                    "found {} values for {n} carriers; give one number, or one for each",
                    list.len()
                ),
            )),
            _ => Ok(()),
        }
    }
}

/// A number as a sentence wants it: not with hundreds of digits.
pub(crate) fn shown(x: f64) -> String {
    if x == 0.0 || (1e-4..1e9).contains(&x.abs()) {
        format!("{x}")
    } else {
        format!("{x:e}")
    }
}

pub(crate) fn problem(key: &str, message: impl Into<String>) -> Problem {
    Problem {
        key: key.into(),
        message: message.into(),
    }
}

/// The key to blame where a duration times something, or over something, is too much: the one that is farther from its default, which is 1 in `times`.
pub(crate) fn larger(duration_s: f64, key: &str, times: f64) -> &str {
    match duration_s / super::default::duration_s() > times {
        true => "duration_s",
        false => key,
    }
}

/// Most samples that a run may log, and cells that its noise may have; beyond it a slip of the keyboard is likelier than a wish.
pub(crate) const MOST_SAMPLES: f64 = 1e9;

/// Stamps count seconds since 1970 in 32 bits with a sign.
pub(crate) const LAST_STAMP_S: f64 = 2_147_483_647.0;
pub(crate) const PAST_LAST_STAMP: &str =
    "the stamps would pass the 19th of January 2038, the last day that seconds in 32 bits can name";

/// Checks an instrument's own clock; `key` names its parameters.
pub(crate) fn check_clock(
    scene: &Scene,
    key: &impl Fn(&str) -> String,
    offset_s: f64,
    drift_ppm: f64,
) -> Result<(), Problem> {
    let (offset, drift) = (key("clock_offset_s"), key("clock_drift_ppm"));
    Checker::within(&offset, offset_s, -1e9..=1e9)?;
    Checker::within(&drift, drift_ppm, -1e5..=1e5)?;
    let first_s = scene.epoch_s + offset_s;
    if first_s < 0.0 {
        return Err(problem(
            &offset,
            format!(
                "found {offset_s}: its stamps would lie before 1970; give the scene an epoch_s"
            ),
        ));
    }
    if first_s + scene.duration_s * (1.0 + drift_ppm * 1e-6) > LAST_STAMP_S {
        let (key, found) = match first_s + scene.duration_s > LAST_STAMP_S {
            true => (&offset, offset_s),
            false => (&drift, drift_ppm),
        };
        return Err(problem(key, format!("found {found}: {PAST_LAST_STAMP}")));
    }
    Ok(())
}

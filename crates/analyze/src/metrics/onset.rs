//! When it starts to roll.

use super::contact::{deviation, mean};
use super::{Context, Value};
use crate::inputs::{mean_step_s, stretches};

/// Length of the stretch whose RMS roll is judged (s).
pub const ONSET_STRETCH_S: f64 = 2.0;
/// RMS roll above which a stretch counts as unstable (deg).
pub const ONSET_ROLL_DEG: f64 = 10.0;

/// The end of the first stretch of 2 s whose RMS roll exceeds 10° (s); `None` if there is none.
///
/// ```text
/// t[k] of the smallest k ≥ m − 1 with Σ_{j=k−m+1}^{k} θ[j]² > m·(10°)²,   m = ⌊2 s / Δt⌋
/// ```
/// θ roll (rad), Δt the mean step (s); m = 60 both at 30 Hz and at the archive's 30.303 Hz. Stretches lie wholly inside
/// the given samples and span no hole of them, so the answer is never below t\[m − 1\]. Source: archive, stats.json (`uncontrolled_onset_time`).
pub fn onset_s(t_s: &[f64], roll_rad: &[f64]) -> Option<f64> {
    let m = stretch_samples(t_s)?;
    let limit = m as f64 * ONSET_ROLL_DEG.to_radians().powi(2);
    stretches(t_s, 0.0).into_iter().find_map(|stretch| {
        let (mut sum, first) = (0.0, stretch.start);
        stretch.into_iter().find_map(|k| {
            sum += roll_rad[k] * roll_rad[k];
            if k >= first + m {
                sum -= roll_rad[k - m] * roll_rad[k - m];
            }
            (k + 1 >= first + m && sum > limit).then_some(t_s[k])
        })
    })
}

/// Samples of such a stretch; `None` where no step is known, or one is longer than the stretch.
pub fn stretch_samples(t_s: &[f64]) -> Option<usize> {
    // A thousandth of a sample of slack: times are rounded to nanoseconds.
    let m = (ONSET_STRETCH_S / mean_step_s(t_s)? + 1e-3).floor() as usize;
    (m > 0).then_some(m)
}

pub fn onset_time_s(c: &Context) -> Value {
    let Some(onset_s) = c.onset() else {
        return Value::missing(if holds_one(c) { "no onset" } else { TOO_SHORT });
    };
    let t_s = &c.roll().t_s;
    let earliest = stretch_samples(t_s).and_then(|m| t_s.get(m - 1));
    let reason = (earliest == Some(&onset_s)).then(|| {
        "it rolls so from the window's beginning on, and may have begun before".to_owned()
    });
    Value {
        reason: leans(c).or(reason),
        ..Value::number(onset_s)
    }
}

/// Said where the roll's mean alone takes it so far, and it hardly moves.
fn leans(c: &Context) -> Option<String> {
    let roll = &c.roll().x;
    let [mean_deg, swing_deg] = [mean(roll), deviation(roll)].map(f64::to_degrees);
    (swing_deg < MOVES_DEG && mean_deg.abs() > ONSET_ROLL_DEG - MOVES_DEG).then(|| format!(
        "it leans by {mean_deg:.1}° and moves about that by {swing_deg:.1}° (SD): nothing begins to swing"
    ))
}

pub fn unstable(c: &Context) -> Value {
    if c.onset().is_some() {
        return Value {
            reason: leans(c),
            ..Value::bool(true)
        };
    }
    match holds_one(c) {
        true => Value::bool(false),
        false => Value::missing(TOO_SHORT),
    }
}

/// A roll that moves by less (SD) does not swing, deg.
const MOVES_DEG: f64 = 2.0;

const TOO_SHORT: &str = "the window holds no 2 s of roll without a hole";

/// Whether there is a stretch to judge.
fn holds_one(c: &Context) -> bool {
    let t_s = &c.roll().t_s;
    let holds = |m| stretches(t_s, 0.0).iter().any(|stretch| stretch.len() >= m);
    stretch_samples(t_s).is_some_and(holds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn onset_is_the_end_of_the_first_full_stretch() {
        let t: Vec<f64> = (455..1819).map(|i| f64::from(33 * i) / 1e3).collect();
        let roll = vec![11f64.to_radians(); t.len()];
        // The archive's smallest possible value.
        assert_eq!(onset_s(&t, &roll), Some(16.962));
        assert_eq!(onset_s(&t, &vec![0.1; t.len()]), None);
        let late: Vec<f64> = t
            .iter()
            .map(|t| if *t > 30.0 { 0.5 } else { 0.0 })
            .collect();
        // 0.5² m' > 60 (10°)² needs m' = 8 samples.
        let first = t.iter().position(|t| *t > 30.0).unwrap();
        assert_eq!(onset_s(&t, &late), Some(t[first + 7]));
    }

    #[test]
    fn a_load_that_leans_is_not_said_to_begin_to_swing() {
        use crate::inputs::{Inputs, Window};
        let said = |swing: f64, name: &str| {
            let t_s: Vec<f64> = (0..1800).map(|k| f64::from(k) / 30.0).collect();
            let roll = t_s.iter().map(|t| 0.29 + swing * (7.0 * t).sin());
            let inputs = Inputs {
                roll_rad: roll.collect(),
                t_s,
                ..Inputs::default()
            };
            let found = crate::metrics::metrics(&inputs, Window::ALL);
            found.get(name).unwrap().reason.clone().unwrap_or_default()
        };
        for name in ["unstable", "onset_time_s"] {
            assert!(said(0.01, name).contains("it leans by 16.6° and moves about that by 0.4°"));
            assert!(!said(0.3, name).contains("leans"));
        }
    }

    #[test]
    fn two_seconds_are_sixty_samples_at_thirty_hertz() {
        // Times as a recording rounds them: to nanoseconds.
        let t: Vec<f64> = (0..1801i64)
            .map(|k| (k * 1_000_000_000 / 30) as f64 / 1e9)
            .collect();
        assert_eq!(onset_s(&t, &vec![1.0; t.len()]), Some(t[59]));
        let t: Vec<f64> = (0..1801).map(|k| k as f64 / 100.0).collect();
        assert_eq!(onset_s(&t, &vec![1.0; t.len()]), Some(1.99));
        // Less than one sample in two seconds tells of no stretch.
        let t: Vec<f64> = (0..30).map(|k| f64::from(k) * 2.5).collect();
        assert_eq!(onset_s(&t, &vec![1.0; t.len()]), None);
    }
}

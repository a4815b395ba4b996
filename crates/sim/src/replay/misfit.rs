//! How far a modelled course lies from a measured one.
//!
//! ```text
//! e(t_k) = x_model(t_k) − x_measured(t_k)        rms = √⟨e²⟩,  offset = ⟨e⟩,  share = SD(e)/SD(x_measured),  ρ correlation
//! ```
//! The modelled course is read between its samples by a cubic spline, at the measured one's times. Share is 0 for the same motion, 1 for a
//! model that does not move, √2 for one as large that has nothing to do with it. Where a sensor cannot give the mean (the height from an
//! inertial sensor) both means are taken out first. Angles go on through half a turn, and what whole turns are between the courses is taken out.

use crate::spline::Spline;
use serde::Serialize;

/// A column over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Course {
    /// Ascending, s.
    pub t_s: Vec<f64>,
    /// One for each time.
    pub x: Vec<f64>,
}

/// The two courses compared; in their unit, shares and correlation in 1.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Misfit {
    /// What is compared, with its unit.
    pub signal: &'static str,
    /// Measured samples within the window.
    pub samples: usize,
    /// SD of the measured course.
    pub measured_sd: f64,
    /// SD of the modelled course.
    pub modelled_sd: f64,
    /// Root mean square of the difference.
    pub rms: f64,
    /// Mean of the difference; `None` where the measured mean means nothing.
    pub offset: Option<f64>,
    /// SD of the difference over that of the measured course; `None` where the latter does not move.
    pub share: Option<f64>,
    /// Correlation; `None` where one does not move.
    pub correlation: Option<f64>,
}

fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

fn sd(x: &[f64]) -> f64 {
    let m = mean(x);
    (x.iter().map(|v| (v - m) * (v - m)).sum::<f64>() / x.len() as f64).sqrt()
}

/// Values that are known but for whole turns, each within half a turn of the one before.
pub(super) fn unwrapped(x: &[f64], turn: f64) -> Vec<f64> {
    let mut turns = 0.0;
    let mut last = x.first().copied().unwrap_or(0.0);
    x.iter()
        .map(|&x| {
            turns -= ((x - last) / turn).round();
            last = x;
            x + turn * turns
        })
        .collect()
}

/// Compares within `window_s`; `None` where fewer than two samples of both lie there. `turn` is that of an angle, in its unit.
pub fn misfit(
    signal: &'static str,
    measured: &Course,
    modelled: &Course,
    window_s: [f64; 2],
    has_mean: bool,
    turn: Option<f64>,
) -> Option<Misfit> {
    let through = |x: Vec<f64>| match turn {
        Some(turn) => unwrapped(&x, turn),
        None => x,
    };
    let spline = Spline::new(&modelled.t_s, &through(modelled.x.clone()))?;
    let [first, last] = spline.span_s();
    let (from, to) = (window_s[0].max(first), window_s[1].min(last));
    // Stamps are whole nanoseconds: a sample at the very end is meant to be in.
    let inside = |t: f64| t >= from - 1e-9 && t <= to + 1e-9;
    let (seen, made): (Vec<f64>, Vec<f64>) = measured
        .t_s
        .iter()
        .zip(&measured.x)
        .filter(|(t, x)| inside(**t) && x.is_finite())
        .map(|(t, x)| (*x, spline.at(*t)[0]))
        .unzip();
    if seen.len() < 2 {
        return None;
    }
    let seen = through(seen);
    let mut apart: Vec<f64> = made.iter().zip(&seen).map(|(a, b)| a - b).collect();
    if let Some(turn) = turn {
        let whole = turn * (mean(&apart) / turn).round();
        apart.iter_mut().for_each(|e| *e -= whole);
    }
    let offset = mean(&apart);
    if !has_mean {
        apart.iter_mut().for_each(|e| *e -= offset);
    }
    let (sd_seen, sd_made) = (sd(&seen), sd(&made));
    let (m_seen, m_made) = (mean(&seen), mean(&made));
    let together = seen
        .iter()
        .zip(&made)
        .map(|(a, b)| (a - m_seen) * (b - m_made))
        .sum::<f64>()
        / seen.len() as f64;
    // What rounding leaves of a constant is no motion.
    let moves = |sd: f64, m: f64| sd > 1e-12 * (1.0 + m.abs());
    let (seen_moves, made_moves) = (moves(sd_seen, m_seen), moves(sd_made, m_made));
    Some(Misfit {
        signal,
        samples: seen.len(),
        measured_sd: sd_seen,
        modelled_sd: sd_made,
        rms: (apart.iter().map(|e| e * e).sum::<f64>() / apart.len() as f64).sqrt(),
        offset: has_mean.then_some(offset),
        share: seen_moves.then(|| sd(&apart) / sd_seen),
        correlation: (seen_moves && made_moves).then(|| together / (sd_seen * sd_made)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn course(f: impl Fn(f64) -> f64) -> Course {
        let t_s: Vec<f64> = (0..1000).map(|k| f64::from(k) * 0.02).collect();
        Course {
            x: t_s.iter().map(|t| f(*t)).collect(),
            t_s,
        }
    }

    #[test]
    fn shares_are_as_said() {
        let wave = |t: f64| (6.0 * t).sin();
        let whole = [0.0, 100.0];
        let compare = |a: &Course, b: &Course| misfit("x", a, b, whole, true, None).unwrap();
        let same = compare(&course(wave), &course(wave));
        assert!(same.rms < 1e-12 && same.share.unwrap() < 1e-12);
        assert!((same.correlation.unwrap() - 1.0).abs() < 1e-12);
        let still = compare(&course(wave), &course(|_| 0.5));
        assert!((still.share.unwrap() - 1.0).abs() < 1e-9 && still.correlation.is_none());
        assert!((still.offset.unwrap() - 0.5).abs() < 0.01);
        let other = compare(&course(wave), &course(|t| (6.0 * t).cos()));
        assert!((other.share.unwrap() - std::f64::consts::SQRT_2).abs() < 0.02);
        let raised = course(|t| 3.0 + wave(t));
        let raised = misfit("x", &course(wave), &raised, whole, false, None).unwrap();
        assert!(raised.rms < 1e-9 && raised.offset.is_none());
        let late = [50.0, 60.0];
        assert!(misfit("x", &course(wave), &course(wave), late, true, None).is_none());
    }

    #[test]
    fn an_angle_goes_on_through_half_a_turn() {
        let (slow, fast) = (|t: f64| 30.0 * t, |t: f64| 31.0 * t);
        let wrapped = |f: fn(f64) -> f64| course(|t| (f(t) + 180.0).rem_euclid(360.0) - 180.0);
        let compare = |a: &Course, b: &Course, turn: Option<f64>| {
            misfit("x", a, b, [0.0, 100.0], true, turn).unwrap()
        };
        let plain = compare(&course(slow), &course(fast), None);
        let angles = compare(&wrapped(slow), &wrapped(fast), Some(360.0));
        assert!((angles.rms - plain.rms).abs() < 1e-9, "{angles:?}");
        assert!((angles.correlation.unwrap() - 1.0).abs() < 1e-9);
        // Whole turns more are the same angle.
        let more = course(|t| 30.0 * t - 720.0);
        let same = compare(&course(slow), &more, Some(360.0));
        assert!(same.rms < 1e-9, "{same:?}");
    }
}

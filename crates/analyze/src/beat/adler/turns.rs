//! How far a phase turns between its samples.

use crate::beat::tempo::PERIOD_S;
use crate::inputs::stretches;
use crate::median::median;
use crate::phase::{comes_unwrapped, wrap};
use std::f64::consts::TAU;

/// Over lost messages so long a steady beat's turns are still known, s.
pub const COUNTED_S: f64 = 5.0;

/// Why a phase that comes wrapped tells no rate.
pub const FOLDED: &str =
    "the phase comes wrapped, with too few samples a second to tell how often it turns between two";

/// Turns of a phase (rad) at ascending times (s).
pub struct Turns {
    /// Whether it [comes unwrapped](comes_unwrapped).
    pub unwrapped: bool,
    /// Its usual rate, rad/s; NaN where no two samples follow on each other.
    pub usual_rad_per_s: f64,
    usual_step_s: f64,
}

impl Turns {
    /// Of `phase_rad`, wrapped or not; NaN where there is none.
    pub fn of(t_s: &[f64], phase_rad: &[f64]) -> Self {
        let steps = || {
            let each = t_s.windows(2).zip(phase_rad.windows(2));
            let each = each.map(|(t, x)| (t[1] - t[0], x[1] - x[0]));
            each.filter(|(_, turned)| turned.is_finite())
        };
        // One that begins again behind a pause did not fall.
        let parts = stretches(t_s, 0.0);
        let apart = parts.into_iter().flat_map(|part| {
            let known = phase_rad[part].iter().copied();
            known.chain([f64::NAN])
        });
        let unwrapped = comes_unwrapped(&Vec::from_iter(apart));
        let turned = |by: f64| if unwrapped { by } else { wrap(by) };
        let mut rates: Vec<f64> = steps().map(|(dt, by)| turned(by) / dt).collect();
        let mut steps_s: Vec<f64> = steps().map(|(dt, _)| dt).collect();
        Turns {
            unwrapped,
            usual_rad_per_s: median(&mut rates).unwrap_or(f64::NAN),
            usual_step_s: median(&mut steps_s).unwrap_or(f64::NAN),
        }
    }

    /// By how much it turned within `dt_s` when its samples differ by `by_rad`, rad: as they say, or to the nearest turn at its usual rate.
    pub fn over(&self, dt_s: f64, by_rad: f64) -> f64 {
        let expected = self.usual_rad_per_s * dt_s;
        match self.unwrapped {
            true => by_rad,
            false => expected + wrap(by_rad - expected),
        }
    }

    /// The phase without jumps of whole turns, rad: each sample where the usual rate takes the last one to, to the nearest turn; but as it is where it
    /// comes unwrapped and none is missing.
    pub fn straightened(&self, t_s: &[f64], phase_rad: &[f64]) -> Vec<f64> {
        let rate = Some(self.usual_rad_per_s).filter(|rate| rate.is_finite());
        let rate = rate.unwrap_or(0.0);
        let mut turns = 0.0;
        let mut last: Option<(usize, f64)> = None;
        let mut out = phase_rad.to_vec();
        for (k, x) in out.iter_mut().enumerate().filter(|(_, x)| x.is_finite()) {
            if let Some((before, y)) = last
                && !(self.unwrapped && before + 1 == k)
            {
                let expected = rate * (t_s[k] - t_s[before]);
                turns -= ((*x - y - expected) / TAU).round();
            }
            last = Some((k, *x));
            *x += turns * TAU;
        }
        out
    }

    /// Whether a rate at or beyond half the sample rate would show the same: it seems to turn back, or a turn more to each sample is no faster
    /// than beats are.
    pub fn folded(&self) -> bool {
        let one_more = self.usual_rad_per_s + TAU / self.usual_step_s;
        !self.unwrapped && (self.usual_rad_per_s < 0.0 || one_more < TAU / PERIOD_S[0])
    }
}

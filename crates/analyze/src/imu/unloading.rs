//! When the load comes off the shoulders, from the vertical specific force alone.

use crate::inputs::longest_step_s;
use crate::metrics::FLOAT_SHARE;

/// Moments at which the support ratio falls through 0.05, between samples, s; each after the load was back above 0.15. What falls
/// in a hole has no moment.
pub fn unloadings(t_s: &[f64], support_ratio: &[f64]) -> Vec<f64> {
    let (mut loaded, mut out) = (false, Vec::new());
    let longest_s = longest_step_s(t_s);
    for (t, s) in t_s.windows(2).zip(support_ratio.windows(2)) {
        loaded |= s[0] > 0.15;
        if t[1] - t[0] > longest_s {
            loaded = false;
        } else if loaded && s[0] > FLOAT_SHARE && s[1] <= FLOAT_SHARE {
            out.push(t[0] + (t[1] - t[0]) * (s[0] - FLOAT_SHARE) / (s[0] - s[1]));
            loaded = false;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unloading_is_timed_between_samples() {
        let t = [0.0, 0.1, 0.2, 0.3, 0.4];
        let found = unloadings(&t, &[1.0, 0.15, -0.05, 0.06, 0.0]);
        // 0.15 → −0.05 passes 0.05 half way; the second dip came without a landing.
        assert_eq!(found.len(), 1);
        assert!((found[0] - 0.15).abs() < 1e-12);
    }
}

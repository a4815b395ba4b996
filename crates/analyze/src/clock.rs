//! Two clocks: how far one is off the other, and how fast they part.
//!
//! ```text
//! t_reference = t_device + o + d · (t_device − t₀)
//! ```
//! o offset at t₀ (s), d drift [1; 1e-6 is 1 ppm], t₀ the middle of what they share (s). Two ways to find them:
//! [`from_signals`] when both felt the same motion (the norm of the angular velocity on one rigid body does not depend on how
//! a device is mounted), and [`from_events`] when both noticed the same taps, claps or beats.
//!
//! Source: gyro-norm alignment as in Faizullin et al., "Twist-n-Sync", Sensors 21 (2021) 68.

use crate::inputs::interpolate;
use crate::spectrum::{Complex64, rfft};
use realfft::RealFftPlanner;

/// What is known about a device's clock against the reference's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// To add to the device's time at `at_s`, s.
    pub offset_s: f64,
    /// Standard error of the offset, s.
    pub offset_sd_s: f64,
    /// How fast the offset grows, parts per million.
    pub drift_ppm: f64,
    /// Standard error of the drift, ppm; `None` when two points do not leave anything to judge it by.
    pub drift_sd_ppm: Option<f64>,
    /// Time at which the offset holds, on the device's clock, s.
    pub at_s: f64,
    /// Windows or events it rests on.
    pub points: usize,
}

impl Clock {
    /// The reference's time of a moment on the device's clock, s.
    pub fn reference_s(&self, device_s: f64) -> f64 {
        device_s + self.offset_s + 1e-6 * self.drift_ppm * (device_s - self.at_s)
    }

    /// Whether the offset or the drift differ from zero by more than two standard errors and more than a millisecond over
    /// the recording of `length_s`.
    pub fn is_off(&self, length_s: f64) -> bool {
        let drifted_s = 1e-6 * self.drift_ppm.abs() * length_s;
        let sure = self
            .drift_sd_ppm
            .is_none_or(|sd| self.drift_ppm.abs() > 2.0 * sd);
        (self.offset_s.abs() > 1e-3 && self.offset_s.abs() > 2.0 * self.offset_sd_s)
            || (drifted_s > 1e-3 && sure)
    }
}

/// Why two clocks could not be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ClockError {
    /// Not enough in common.
    #[error("the two devices share {found_s:.1} s; comparing clocks needs at least 5 s")]
    TooShort {
        /// Overlap, s.
        found_s: f64,
    },
    /// They did not feel the same.
    #[error(
        "the two signals do not match at any offset (correlation {best:.2}; at least 0.5 is needed)"
    )]
    NoMatch {
        /// Best correlation.
        best: f64,
    },
    /// Events that cannot be paired.
    #[error(
        "of {device} and {reference} events only {paired} can be paired; at least 2 are needed"
    )]
    TooFewEvents {
        /// Events on the device.
        device: usize,
        /// Events on the reference.
        reference: usize,
        /// Pairs.
        paired: usize,
    },
}

/// Rate at which signals are compared, Hz; the maximum of the correlation is refined between samples.
const RATE_HZ: f64 = 200.0;
/// Window in which the offset is taken as constant, s.
const WINDOW_S: f64 = 10.0;

/// Offset and drift from one motion felt by both: `x` against time on the device, `y` on the reference.
///
/// The offset is looked for within ± `search_s`. Signals are compared after resampling to 200 Hz, so both should be sampled at
/// some 25 Hz or more and hold motion throughout, not only at one end.
///
/// # Errors
/// When the two overlap by less than 5 s or do not match.
pub fn from_signals(
    (t_s, x): (&[f64], &[f64]),
    (u_s, y): (&[f64], &[f64]),
    search_s: f64,
) -> Result<Clock, ClockError> {
    let ends = |t: &[f64]| Some((*t.first()?, *t.last()?));
    let (Some(a), Some(b)) = (ends(t_s), ends(u_s)) else {
        return Err(ClockError::TooShort { found_s: 0.0 });
    };
    let (start, end) = (a.0.min(b.0), a.1.max(b.1));
    let found_s = a.1.min(b.1) - a.0.max(b.0) + search_s;
    if found_s < 5.0 || a.1 - a.0 < 5.0 || b.1 - b.0 < 5.0 {
        return Err(ClockError::TooShort {
            found_s: found_s.max(0.0),
        });
    }
    let n = ((end - start) * RATE_HZ).min(3e7) as usize + 1;
    let grid: Vec<f64> = (0..n).map(|k| start + k as f64 / RATE_HZ).collect();
    let x = inside(&grid, t_s, x);
    let y = inside(&grid, u_s, y);
    let (lag, best) = best_lag(&x, &y, (search_s * RATE_HZ) as usize);
    if best < 0.5 {
        return Err(ClockError::NoMatch { best });
    }
    // Window by window, near the lag of the whole.
    let width = (WINDOW_S * RATE_HZ) as usize;
    let coarse = lag.round() as i64;
    let reach = (0.3 * RATE_HZ) as usize;
    let mut points: Vec<(f64, f64)> = Vec::new();
    let mut first = 0;
    while first + width <= n {
        let from = first as i64 + coarse - reach as i64;
        if from >= 0 && from as usize + width + 2 * reach <= n {
            let q = &y[from as usize..from as usize + width + 2 * reach];
            // A window without motion, or one where only one device was on, has no say.
            if let Some((shift, match_)) = window_lag(&x[first..first + width], q)
                && match_ > 0.8
            {
                let at = grid[first] + 0.5 * WINDOW_S;
                let rest = shift - reach as f64;
                points.push((at, (coarse as f64 + rest) / RATE_HZ));
            }
        }
        first += width / 2;
    }
    if points.is_empty() {
        points.push((0.5 * (a.0 + a.1), lag / RATE_HZ));
    }
    // Windows overlap by half: two of them count as one and a half measurements at best.
    Ok(line(&points, 1.5))
}

/// Resampled about its mean; zero where the device was not on.
fn inside(grid: &[f64], t_s: &[f64], x: &[f64]) -> Vec<f64> {
    let (first, last) = (t_s[0], t_s[t_s.len() - 1]);
    let mut out = interpolate(t_s, x, grid);
    let on = |t: f64| (first..=last).contains(&t);
    let count = grid.iter().filter(|t| on(**t)).count().max(1);
    let mean = grid
        .iter()
        .zip(&out)
        .filter(|(t, _)| on(**t))
        .map(|(_, v)| v)
        .sum::<f64>()
        / count as f64;
    for (t, v) in grid.iter().zip(&mut out) {
        *v = if on(*t) && v.is_finite() {
            *v - mean
        } else {
            0.0
        };
    }
    out
}

/// The lag (in samples, refined) by which y is later than x, |lag| ≤ `reach`, and the correlation there.
fn best_lag(x: &[f64], y: &[f64], reach: usize) -> (f64, f64) {
    let n = (x.len() + y.len()).next_power_of_two();
    let pad = |v: &[f64]| {
        let mean = v.iter().sum::<f64>() / v.len().max(1) as f64;
        let mut p: Vec<f64> = v.iter().map(|a| a - mean).collect();
        p.resize(n, 0.0);
        p
    };
    let (px, py) = (pad(x), pad(y));
    let power = |v: &[f64]| v.iter().map(|a| a * a).sum::<f64>();
    let scale = (power(&px) * power(&py)).sqrt();
    if !(scale > 0.0) {
        return (0.0, 0.0);
    }
    let mut cross: Vec<Complex64> = rfft(&px)
        .iter()
        .zip(rfft(&py))
        .map(|(a, b)| a.conj() * b)
        .collect();
    let last = cross.len() - 1;
    (cross[0].im, cross[last].im) = (0.0, 0.0);
    let plan = RealFftPlanner::<f64>::new().plan_fft_inverse(n);
    let mut correlation = plan.make_output_vec();
    // OK because the lengths are the plan's own and the bins that have to be real are.
    plan.process(&mut cross, &mut correlation)
        .expect("buffers of the plan's own length");
    let at = |lag: i64| correlation[lag.rem_euclid(n as i64) as usize] / n as f64 / scale;
    let reach = (reach as i64).min(n as i64 / 2 - 2);
    let best = (-reach..=reach)
        .max_by(|a, b| at(*a).total_cmp(&at(*b)))
        .unwrap_or(0);
    let (l, c, r) = (at(best - 1), at(best), at(best + 1));
    let bend = l - 2.0 * c + r;
    let shift = if bend < 0.0 {
        0.5 * (l - r) / bend
    } else {
        0.0
    };
    (best as f64 + shift.clamp(-0.5, 0.5), c)
}

/// Where in the longer `y` the shorter `x` fits best (samples, refined), and Pearson's correlation there. `None` at the ends of the
/// search or without motion.
fn window_lag(x: &[f64], y: &[f64]) -> Option<(f64, f64)> {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    let x: Vec<f64> = x.iter().map(|v| v - mean).collect();
    let xx: f64 = x.iter().map(|v| v * v).sum();
    let pearson: Vec<f64> = y
        .windows(x.len())
        .map(|w| {
            let mean = w.iter().sum::<f64>() / n;
            let (mut xy, mut yy) = (0.0, 0.0);
            for (a, b) in x.iter().zip(w) {
                xy += a * b;
                yy += (b - mean) * (b - mean);
            }
            if xx * yy > 0.0 {
                xy / (xx * yy).sqrt()
            } else {
                0.0
            }
        })
        .collect();
    let best = (0..pearson.len()).max_by(|a, b| pearson[*a].total_cmp(&pearson[*b]))?;
    let [l, c, r] = *pearson.get(best.checked_sub(1)?..best + 2)? else {
        return None;
    };
    let bend = l - 2.0 * c + r;
    let shift = if bend < 0.0 {
        0.5 * (l - r) / bend
    } else {
        0.0
    };
    Some((best as f64 + shift.clamp(-0.5, 0.5), c))
}

/// Offset and drift from events both noticed (taps, claps, steps on a plate, beats), ascending times, s.
///
/// The offset is looked for within ± `search_s`: the one that pairs most events to within `tolerance_s`. A perfectly regular
/// series fits at every multiple of its period: keep `search_s` below half of it, or tap irregularly. Drift is
/// assumed below 200 ppm.
///
/// # Errors
/// When fewer than two events can be paired.
pub fn from_events(
    device_s: &[f64],
    reference_s: &[f64],
    search_s: f64,
    tolerance_s: f64,
) -> Result<Clock, ClockError> {
    let pairs_at = |offset: f64, drift: f64, tolerance: f64| -> Vec<(f64, f64)> {
        let middle = 0.5 * (device_s.first().unwrap_or(&0.0) + device_s.last().unwrap_or(&0.0));
        device_s
            .iter()
            .filter_map(|&d| {
                let there = d + offset + drift * (d - middle);
                let k = reference_s.partition_point(|r| *r < there);
                let near = [k.checked_sub(1), Some(k)]
                    .into_iter()
                    .flatten()
                    .filter_map(|k| reference_s.get(k))
                    .min_by(|a, b| (*a - there).abs().total_cmp(&(*b - there).abs()))?;
                ((near - there).abs() <= tolerance).then_some((d, near - d))
            })
            .collect()
    };
    // Candidates: every difference between an early event of one and any of the other.
    let mut best: (usize, f64, f64) = (0, f64::MAX, 0.0);
    for d in device_s
        .iter()
        .take(20)
        .chain(device_s.iter().rev().take(20))
    {
        for r in reference_s {
            let offset = r - d;
            if offset.abs() <= search_s {
                let pairs = pairs_at(offset, 0.0, tolerance_s.max(0.02));
                let spread =
                    pairs.iter().map(|p| (p.1 - offset).abs()).sum::<f64>() / pairs.len() as f64;
                if pairs.len() > best.0 || (pairs.len() == best.0 && spread < best.1) {
                    best = (pairs.len(), spread, offset);
                }
            }
        }
    }
    let mut pairs = pairs_at(best.2, 0.0, tolerance_s.max(0.02));
    for _ in 0..3 {
        if pairs.len() < 2 {
            break;
        }
        let clock = line(&pairs, 1.0);
        let middle = 0.5 * (device_s[0] + device_s[device_s.len() - 1]);
        let offset = clock.reference_s(middle) - middle;
        let drift = (1e-6 * clock.drift_ppm).clamp(-2e-4, 2e-4);
        let next = pairs_at(offset, drift, tolerance_s);
        if next.len() < pairs.len().min(2) {
            break;
        }
        pairs = next;
    }
    if best.0 < 2 || pairs.len() < 2 {
        return Err(ClockError::TooFewEvents {
            device: device_s.len(),
            reference: reference_s.len(),
            paired: pairs.len(),
        });
    }
    Ok(line(&pairs, 1.0))
}

/// Least squares through (time, offset); `shared` independent measurements count once.
fn line(points: &[(f64, f64)], shared: f64) -> Clock {
    let n = points.len() as f64;
    let at_s = points.iter().map(|p| p.0).sum::<f64>() / n;
    let offset_s = points.iter().map(|p| p.1).sum::<f64>() / n;
    let (mut to, mut tt) = (0.0, 0.0);
    for (t, o) in points {
        to += (t - at_s) * (o - offset_s);
        tt += (t - at_s).powi(2);
    }
    let drift = if tt > 0.0 { to / tt } else { 0.0 };
    let squares: f64 = points
        .iter()
        .map(|(t, o)| (o - offset_s - drift * (t - at_s)).powi(2))
        .sum();
    let free = (n / shared - 2.0).max(1.0);
    let variance = squares / n * (n / shared) / free;
    Clock {
        offset_s,
        offset_sd_s: (variance / (n / shared)).sqrt(),
        drift_ppm: 1e6 * drift,
        drift_sd_ppm: (points.len() > 2).then(|| 1e6 * (variance * shared / tt.max(1e-12)).sqrt()),
        at_s,
        points: points.len(),
    }
}

/// Taps: moments at which the norm of the specific force jumps far beyond what surrounds it, s.
///
/// A tap is a maximum above `threshold_m_per_s2` over the running median norm, at least 0.15 s from a stronger one.
pub fn taps(t_s: &[f64], accel_norm_m_per_s2: &[f64], threshold_m_per_s2: f64) -> Vec<f64> {
    let n = t_s.len().min(accel_norm_m_per_s2.len());
    let mut sorted: Vec<f64> = accel_norm_m_per_s2[..n]
        .iter()
        .copied()
        .filter(|a| a.is_finite())
        .collect();
    if sorted.is_empty() {
        return Vec::new();
    }
    let middle = sorted.len() / 2;
    let usual = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
    let mut out: Vec<(f64, f64)> = Vec::new();
    for (&t, &a) in t_s[..n].iter().zip(accel_norm_m_per_s2) {
        if !(a > usual + threshold_m_per_s2) {
            continue;
        }
        match out.last_mut() {
            Some(last) if t - last.0 < 0.15 => {
                if a > last.1 {
                    *last = (t, a);
                }
            }
            _ => out.push((t, a)),
        }
    }
    out.into_iter().map(|p| p.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(t: f64) -> f64 {
        // Never repeats within minutes.
        (2.0 * t).sin()
            + 0.7 * (3.3 * t + (0.21 * t).sin() * 2.0).sin()
            + 0.5 * (0.37 * t * t.sqrt()).cos()
    }

    #[test]
    fn a_shared_motion_tells_offset_and_drift() {
        for (offset, drift_ppm) in [(0.2, 50.0), (-1.3, -80.0), (0.0, 0.0)] {
            let reference: Vec<f64> = (0..12_000).map(|k| k as f64 * 0.01).collect();
            // What the device's clock shows when the reference shows t.
            let device: Vec<f64> = (0..23_000)
                .map(|k| k as f64 * 0.005 + 1.0)
                .map(|t| t - offset - 1e-6 * drift_ppm * (t - 60.0))
                .collect();
            let x: Vec<f64> = (0..23_000)
                .map(|k| motion(k as f64 * 0.005 + 1.0))
                .collect();
            let y: Vec<f64> = reference.iter().map(|t| motion(*t)).collect();
            let clock = from_signals((&device, &x), (&reference, &y), 3.0).unwrap();
            assert!((clock.drift_ppm - drift_ppm).abs() < 8.0, "{clock:?}");
            let t = 30.0 - offset - 1e-6 * drift_ppm * (30.0 - 60.0);
            assert!((clock.reference_s(t) - 30.0).abs() < 1e-3, "{clock:?}");
        }
    }

    #[test]
    fn different_motions_do_not_match() {
        let t: Vec<f64> = (0..6000).map(|k| f64::from(k) * 0.01).collect();
        let x: Vec<f64> = t.iter().map(|t| (7.0 * t + t * t * 0.2).sin()).collect();
        let y: Vec<f64> = t.iter().map(|t| (1.0 * t * t.sqrt()).cos()).collect();
        assert!(matches!(
            from_signals((&t, &x), (&t, &y), 1.0),
            Err(ClockError::NoMatch { .. })
        ));
        assert!(matches!(
            from_signals((&[], &[]), (&t, &y), 1.0),
            Err(ClockError::TooShort { .. })
        ));
    }

    #[test]
    fn taps_at_both_ends_tell_offset_and_drift() {
        let reference = [1.0, 1.7, 2.1, 3.4, 301.0, 301.9, 302.3, 303.0];
        let device: Vec<f64> = reference
            .iter()
            .map(|t| t - 0.2 - 50e-6 * (t - 150.0))
            .collect();
        let clock = from_events(&device, &reference, 2.0, 0.02).unwrap();
        assert!((clock.drift_ppm - 50.0).abs() < 0.1, "{clock:?}");
        assert!((clock.reference_s(device[3]) - 3.4).abs() < 1e-6);
        assert_eq!(clock.points, 8);
        assert!(from_events(&[1.0], &[1.0], 1.0, 0.01).is_err());
        assert!(from_events(&[], &[], 1.0, 0.01).is_err());
    }

    #[test]
    fn taps_are_the_jumps() {
        let t: Vec<f64> = (0..1000).map(|k| f64::from(k) * 0.01).collect();
        let mut a = vec![9.8; 1000];
        (a[100], a[102], a[500]) = (40.0, 50.0, 45.0);
        assert_eq!(taps(&t, &a, 20.0), [t[102], t[500]]);
    }
}

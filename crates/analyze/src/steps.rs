//! Steps and gait phase from one worn accelerometer: lower back, pocket or hand, whichever way round.
//!
//! The norm of the specific force does not depend on how the device hangs. It is resampled, the cadence is found from
//! its autocorrelation, the norm is band-passed around the cadence, and each maximum that stands out of the local swing
//! is a step.
//!
//! ```text
//! ρ(τ)  = Σ m(t) m(t+τ) / Σ m(t)²          m: norm about its mean, 0.7 – 6 Hz
//! f     = k/τ*, k = 1 … 8                   τ* the highest maximum of ρ up to 2.8 s (a step, a stride, several),
//!                                           k the harmonic that swings most
//! φ(t)  = arg( x + i H{x} )                 x: m within 0.6 f … 1.5 f, H the Hilbert transform
//! ```
//! m [m/s²], τ (s), f steps per second (Hz), φ gait phase, 2π per step, 0 at a step (rad).
//!
//! Holds for walking and running at 0.8 – 3.3 steps/s, at least [`SHORTEST_S`] of it, sampled at 15 Hz or faster. Every
//! place of wear sees a step early or late by a constant (−48 … +89 ms on the lower back, by detector): phases between
//! carriers that wear the same thing alike are free of it, phases to the beat are not.
//! Source: band-pass and peaks as in the step detectors compared by Bonci et al., Front. Bioeng. Biotechnol. 10 (2022);
//! analytic phase: Lamb & Stöckl, Clin. Biomech. 29 (2014).

use crate::filter::{Band, butter, sosfiltfilt};
use crate::imu::track::period_s;
use crate::inputs::stretches;
use crate::phase::{hilbert, unwrap, wrap};
use crate::spectrum::{rfft, rfft_magnitude};

/// Rate at which everything here is computed, Hz.
const RATE_HZ: f64 = 100.0;
/// Cadence is looked for between these step times, s.
const STEP_S: [f64; 2] = [0.3, 1.4];
/// Most steps in a repetition: a fast walker takes more than six in the longest.
const MOST_HARMONICS: u32 = 8;
/// Cadence preferred where harmonics compete, Hz, and its spread, octaves.
const USUAL_HZ: f64 = 1.8;
const USUAL_OCTAVES: f64 = 0.7;
/// Band about the cadence, as multiples of it.
const BAND: [f64; 2] = [0.6, 1.5];
/// Less is not analysed, s.
pub const SHORTEST_S: f64 = 5.0;
/// Where less than this share of the time was recorded, only the longest stretch without a gap of so many seconds is analysed: a wrong time
/// stamp must not ask for all memory.
const LEAST_SHARE: f64 = 0.05;
const GAP_S: f64 = 10.0;
/// What straight lines may bridge of a swing that lasts a third of a second and more, s.
pub(crate) const BRIDGED_S: f64 = 0.2;
/// A swing is the RMS over so long, s. Within half of that of where it falls silent the band rings on.
const SWING_OVER_S: f64 = 2.0;
/// So near the ends of a record an analytic signal errs, s.
const ENDS_S: f64 = 0.5;
/// Steps swing at least this much (RMS), m/s²: a device on a table does not walk.
const LEAST_SWING_M_PER_S2: f64 = 0.2;

/// Why no steps were looked for.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StepError {
    /// Too short.
    #[error("{found_s:.1} s of acceleration; steps need at least {SHORTEST_S} s")]
    TooShort {
        /// Length found, s.
        found_s: f64,
    },
    /// Too slowly sampled.
    #[error("the accelerometer was sampled at {found_hz:.1} Hz; steps need at least 15 Hz")]
    TooSlow {
        /// Rate found, Hz.
        found_hz: f64,
    },
    /// Without gravity nothing tells what is vertical, and the norm folds.
    #[error(
        "the mean specific force is {found_m_per_s2:.2} m/s², not gravity: steps need accelerations with gravity, in m/s² (an app's \"linear acceleration\" has lost it)"
    )]
    NoGravity {
        /// Norm of the mean over two seconds, as a rule, m/s².
        found_m_per_s2: f64,
    },
    /// Nothing periodic.
    #[error("no walking: {reason}")]
    NoWalking {
        /// What was missing.
        reason: &'static str,
    },
}

/// Steps found, and the gait's phase.
#[derive(Clone, Debug, PartialEq)]
pub struct Steps {
    /// Time of each step, s.
    pub step_s: Vec<f64>,
    /// Steps per second while walking: one over the mean interval, pauses left out, Hz.
    pub cadence_hz: f64,
    /// Times of the phase, evenly spaced, s.
    pub t_s: Vec<f64>,
    /// Gait phase, unwrapped, 2π per step, rad; NaN where nobody walks, and in and beside holes.
    pub phase_rad: Vec<f64>,
    /// What of it was put back because the band takes it away, rad: a pace that changes fast is wider than the band.
    pub restored_rad: Vec<f64>,
}

/// Steps from times (ascending, s) and the three axes of an accelerometer (m/s²).
///
/// # Errors
/// When the recording is too short, too slowly sampled, or holds no walking.
pub fn steps(t_s: &[f64], accel_m_per_s2: [&[f64]; 3]) -> Result<Steps, StepError> {
    let (times, norm) = norm(t_s, accel_m_per_s2);
    steps_in(&times, &norm)
}

/// Steps from one signal that swings once per step: the norm, or better the vertical acceleration where a gyroscope tells
/// what is vertical (the norm folds where the acceleration exceeds g downwards). Times ascend strictly and all is finite.
///
/// # Errors
/// As [`steps`].
pub fn steps_in(times: &[f64], norm: &[f64]) -> Result<Steps, StepError> {
    let found_s = times.last().unwrap_or(&0.0) - times.first().unwrap_or(&0.0);
    if found_s < SHORTEST_S {
        return Err(StepError::TooShort { found_s });
    }
    let found_hz = period_s(times).map_or(0.0, |p| 1.0 / p);
    // A clock errs, and stamps are rounded.
    if found_hz < 15.0 / 1.01 {
        return Err(StepError::TooSlow { found_hz });
    }
    let mean_hz = times.len() as f64 / found_s;
    if mean_hz < LEAST_SHARE * found_hz {
        let longest = longest_stretch(times);
        if longest.len() == times.len() {
            return Err(StepError::TooSlow { found_hz: mean_hz });
        }
        return steps_in(&times[longest.clone()], &norm[longest]);
    }
    // Stay clear of the sensor's own half rate.
    let (grid, m) = even(times, norm, RATE_HZ);
    let top_hz = 6.0f64.min(0.4 * found_hz);
    let wide = band(&m, 0.7, top_hz);
    let walking = where_it_swings(&wide);
    let cadence_hz = cadence(&wide, &walking)?;
    // Once around the first guess, once around what that gave: a guess at the edge of the band still ends in its middle.
    let mut found = peaks(&m, cadence_hz);
    let mut middle_hz = cadence_hz;
    if let Some(f) = median_rate(&found.0) {
        (found, middle_hz) = (peaks(&m, f), f);
    }
    let (at, narrow) = found;
    let start = grid[0];
    let mut step_s: Vec<f64> = at.iter().map(|k| start + k / RATE_HZ).collect();
    // Nobody felt the steps in a hole, nor what the band draws beside it for half a step.
    let holes: Vec<(f64, f64)> = stretches(times, BRIDGED_S)
        .windows(2)
        .map(|parts| (times[parts[0].end - 1], times[parts[1].start]))
        .collect();
    step_s.retain(|t| !holes.iter().any(|(a, b)| (*a..=*b).contains(t)));
    if step_s.len() < 3 {
        return Err(StepError::NoWalking {
            reason: "fewer than three steps stand out",
        });
    }
    let (cadence_hz, _) = rate_of(&step_s);
    let analytic = hilbert(&narrow);
    let wrapped: Vec<f64> = analytic.iter().map(|z| z.arg()).collect();
    let (mut phase_rad, restored_rad) = restored(unwrap(&wrapped), middle_hz);
    let swing = local_rms(&narrow, (SWING_OVER_S * RATE_HZ) as usize);
    let quiet = (0.3 * quantile(&swing, 0.5)).max(0.5 * LEAST_SWING_M_PER_S2);
    let places: Vec<usize> = (0..grid.len()).collect();
    let halts = places
        .chunk_by(|a, b| (swing[*a] < quiet) == (swing[*b] < quiet))
        .filter(|halt| swing[halt[0]] < quiet)
        .map(|halt| (grid[halt[0]], grid[halt[halt.len() - 1]]))
        .filter(|(from, to)| !holes.iter().any(|(a, b)| a < to && b > from))
        .map(|(from, to)| (from - 0.5 * SWING_OVER_S, to + 0.5 * SWING_OVER_S));
    let ends = [start, grid[grid.len() - 1]].map(|end| (end - ENDS_S, end + ENDS_S));
    let beside_s = 0.5 / cadence_hz;
    let beside = |(from, to): (f64, f64)| (from - beside_s, to + beside_s);
    let unknown: Vec<(f64, f64)> = holes.iter().copied().chain(halts).map(beside).collect();
    for (from, to) in unknown.into_iter().chain(ends) {
        let inside = |t: &f64| *t > from && *t < to;
        let phases = grid.iter().zip(&mut phase_rad);
        phases
            .filter(|(t, _)| inside(t))
            .for_each(|(_, phase)| *phase = f64::NAN);
    }
    Ok(Steps {
        step_s,
        cadence_hz,
        t_s: grid,
        phase_rad,
        restored_rad,
    })
}

/// A phase (rad) with what the band about `middle_hz` took from it, and that part alone.
///
/// ```text
/// φ = 2 φ₁ − D(φ₁)        D(φ) = arg of the analytic signal of the band-passed d²(−cos φ)/dt²
/// ```
/// φ₁ as detected, D what the detector makes of a walker with that phase: what it takes from φ₁ it took from φ before. Source: the first step of
/// van Cittert's deconvolution (Physik. Z. 69 (1931) 298).
fn restored(detected_rad: Vec<f64>, middle_hz: f64) -> (Vec<f64>, Vec<f64>) {
    let rise: Vec<f64> = detected_rad.iter().map(|p| -p.cos()).collect();
    let mut heave = vec![0.0; rise.len()];
    for (a, z) in heave.iter_mut().skip(1).zip(rise.windows(3)) {
        *a = z[0] - 2.0 * z[1] + z[2];
    }
    let again = hilbert(&band(&heave, BAND[0] * middle_hz, BAND[1] * middle_hz));
    let taken = detected_rad
        .iter()
        .zip(&again)
        .map(|(p, z)| wrap(p - z.arg()))
        .collect::<Vec<f64>>();
    let phase_rad = detected_rad
        .iter()
        .zip(&taken)
        .map(|(p, d)| p + d)
        .collect();
    (phase_rad, taken)
}

/// Times and norms of the samples that are finite and later than the one before.
fn norm(t_s: &[f64], accel: [&[f64]; 3]) -> (Vec<f64>, Vec<f64>) {
    let n = accel.iter().map(|a| a.len()).fold(t_s.len(), usize::min);
    let (mut times, mut out) = (Vec::with_capacity(n), Vec::with_capacity(n));
    for i in 0..n {
        let m = accel.iter().map(|a| a[i] * a[i]).sum::<f64>().sqrt();
        if t_s[i].is_finite() && m < 1e5 && times.last().is_none_or(|&last| t_s[i] > last) {
            times.push(t_s[i]);
            out.push(m);
        }
    }
    (times, out)
}

/// The longest stretch without a gap.
fn longest_stretch(t_s: &[f64]) -> std::ops::Range<usize> {
    let (mut longest, mut start) = (0..0, 0);
    for end in 1..=t_s.len() {
        if end == t_s.len() || t_s[end] - t_s[end - 1] > GAP_S {
            if end - start > longest.len() {
                longest = start..end;
            }
            start = end;
        }
    }
    longest
}

/// Onto an even grid: means over one step of the grid of what straight lines between samples draw, so that no sample pulls to its side.
fn even(t_s: &[f64], x: &[f64], rate_hz: f64) -> (Vec<f64>, Vec<f64>) {
    let (start, end) = (t_s[0], t_s[t_s.len() - 1]);
    let n = ((end - start) * rate_hz) as usize + 1;
    let grid: Vec<f64> = (0..n).map(|k| start + k as f64 / rate_hz).collect();
    let mut areas = vec![0.0];
    for (t, x) in t_s.windows(2).zip(x.windows(2)) {
        areas.push(areas[areas.len() - 1] + 0.5 * (x[0] + x[1]) * (t[1] - t[0]));
    }
    let mut k = 0;
    // Edges ascend, and two cells share one.
    let mut area = |t: f64| {
        while k + 2 < t_s.len() && t_s[k + 1] <= t {
            k += 1;
        }
        let (into, width) = (t - t_s[k], t_s[k + 1] - t_s[k]);
        areas[k] + into * (x[k] + 0.5 * (x[k + 1] - x[k]) * into / width)
    };
    let half = 0.5 / rate_hz;
    let mut before = (start, 0.0);
    let out = grid
        .iter()
        .map(|g| {
            let edge = (g + half).min(end);
            let here = (edge, area(edge));
            let mean = match here.0 - before.0 {
                width if width > 1e-9 => (here.1 - before.1) / width,
                _ => x[x.len() - 1],
            };
            before = here;
            mean
        })
        .collect();
    (grid, out)
}

/// Zero-phase band-pass of second order at [`RATE_HZ`]; the signal about its mean where it is too short to filter.
fn band(x: &[f64], low_hz: f64, high_hz: f64) -> Vec<f64> {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    let about: Vec<f64> = x.iter().map(|v| v - mean).collect();
    butter(2, Band::Pass(low_hz, high_hz), RATE_HZ)
        .and_then(|sections| sosfiltfilt(&sections, &about))
        .unwrap_or(about)
}

/// Which samples belong to motion worth calling walking.
fn where_it_swings(wide: &[f64]) -> Vec<bool> {
    let swing = local_rms(wide, (4.0 * RATE_HZ) as usize);
    let typical = quantile(&swing, 0.75);
    swing
        .iter()
        .map(|s| *s > (0.3 * typical).max(LEAST_SWING_M_PER_S2))
        .collect()
}

/// Root mean square over a window of `width` samples about each sample.
fn local_rms(x: &[f64], width: usize) -> Vec<f64> {
    let mut sums = Vec::with_capacity(x.len() + 1);
    sums.push(0.0);
    for v in x {
        sums.push(sums[sums.len() - 1] + v * v);
    }
    (0..x.len())
        .map(|i| {
            let (a, b) = (
                i.saturating_sub(width / 2),
                (i + width / 2 + 1).min(x.len()),
            );
            ((sums[b] - sums[a]).max(0.0) / (b - a) as f64).sqrt()
        })
        .collect()
}

fn quantile(x: &[f64], share: f64) -> f64 {
    if x.is_empty() {
        return 0.0;
    }
    let mut sorted = x.to_vec();
    let k = ((sorted.len() - 1) as f64 * share) as usize;
    *sorted.select_nth_unstable_by(k, f64::total_cmp).1
}

/// Steps per second from the autocorrelation of the walking parts.
fn cadence(wide: &[f64], walking: &[bool]) -> Result<f64, StepError> {
    let x: Vec<f64> = wide
        .iter()
        .zip(walking)
        .map(|(x, w)| if *w { *x } else { 0.0 })
        .collect();
    let power: f64 = x.iter().map(|v| v * v).sum();
    if power == 0.0 {
        return Err(StepError::NoWalking {
            reason: "the acceleration hardly swings",
        });
    }
    let (first, last) = (
        (STEP_S[0] * RATE_HZ) as usize,
        (2.0 * STEP_S[1] * RATE_HZ) as usize,
    );
    let (rho, spectrum) = autocorrelation(&x, last + 2);
    // The strongest repetition: the step or, in a pocket, the stride.
    let strongest = (first.max(1)..=last.min(rho.len().saturating_sub(2)))
        .filter(|&k| rho[k] >= rho[k - 1] && rho[k] > rho[k + 1])
        .max_by(|&a, &b| rho[a].total_cmp(&rho[b]));
    let Some(period) = strongest.filter(|&k| rho[k] > 0.15) else {
        return Err(StepError::NoWalking {
            reason: "the acceleration swings, but not periodically",
        });
    };
    // Which harmonic of it is the step: the one that swings most, at a cadence people use.
    let bin_hz = RATE_HZ / (2 * (spectrum.len() - 1)) as f64;
    let weight = |hz: f64| {
        let (a, b) = (
            (0.92 * hz / bin_hz) as usize,
            (1.08 * hz / bin_hz) as usize + 1,
        );
        let swing = spectrum[a.min(b)..b.min(spectrum.len())]
            .iter()
            .sum::<f64>()
            .sqrt();
        let octaves = (hz / USUAL_HZ).log2() / USUAL_OCTAVES;
        swing * (-0.5 * octaves * octaves).exp()
    };
    (1..=MOST_HARMONICS)
        .map(|k| f64::from(k) * RATE_HZ / period as f64)
        .filter(|hz| (1.0 / STEP_S[1]..1.0 / STEP_S[0]).contains(hz))
        .max_by(|a, b| weight(*a).total_cmp(&weight(*b)))
        .ok_or(StepError::NoWalking {
            reason: "the acceleration repeats more slowly than anyone steps",
        })
}

/// ρ at lags 0 … `lags` samples, by the FFT, and the power spectrum it comes from.
fn autocorrelation(x: &[f64], lags: usize) -> (Vec<f64>, Vec<f64>) {
    let mut padded = x.to_vec();
    padded.resize((x.len() + lags + 1).next_power_of_two(), 0.0);
    let power: Vec<f64> = rfft_magnitude(&padded).iter().map(|m| m * m).collect();
    // The power spectrum is real and even: its inverse transform is its forward transform, up to a factor.
    let mut full = power.clone();
    full.extend(power[1..power.len() - 1].iter().rev());
    let rho = rfft(&full);
    let zero = rho[0].re;
    (
        rho.iter().take(lags + 1).map(|z| z.re / zero).collect(),
        power,
    )
}

/// Maxima of the norm about the cadence that stand out of the local swing (in samples, refined), and that signal.
fn peaks(m: &[f64], cadence_hz: f64) -> (Vec<f64>, Vec<f64>) {
    let x = band(m, BAND[0] * cadence_hz, BAND[1] * cadence_hz);
    let swing = local_rms(&x, (4.0 * RATE_HZ) as usize);
    let typical = quantile(&swing, 0.5);
    let apart = 0.5 * RATE_HZ / cadence_hz;
    let mut out: Vec<f64> = Vec::new();
    let mut height: Vec<f64> = Vec::new();
    for i in 1..x.len().saturating_sub(1) {
        let top = x[i] >= x[i - 1] && x[i] > x[i + 1];
        let stands = x[i] > 0.35 * swing[i]
            && swing[i] > 0.3 * typical
            && swing[i] > 0.5 * LEAST_SWING_M_PER_S2;
        if !(top && stands) {
            continue;
        }
        let bend = x[i - 1] - 2.0 * x[i] + x[i + 1];
        let at = i as f64 + 0.5 * (x[i - 1] - x[i + 1]) / bend;
        match out.last_mut() {
            // Two maxima within half a step are one step: the higher.
            Some(last) if at - *last < apart => {
                let k = height.len() - 1;
                if x[i] > height[k] {
                    (*last, height[k]) = (at, x[i]);
                }
            }
            _ => {
                out.push(at);
                height.push(x[i]);
            }
        }
    }
    (out, x)
}

/// One over the median interval of peaks (in samples), Hz.
fn median_rate(at: &[f64]) -> Option<f64> {
    let gaps: Vec<f64> = at.windows(2).map(|w| w[1] - w[0]).collect();
    (gaps.len() >= 2).then(|| RATE_HZ / quantile(&gaps, 0.5))
}

/// Intervals between ascending steps, pauses left out, s.
pub fn walked_s(step_s: &[f64]) -> Vec<f64> {
    let mut gaps: Vec<f64> = step_s.windows(2).map(|w| w[1] - w[0]).collect();
    let usual = quantile(&gaps, 0.5);
    gaps.retain(|g| *g < 1.7 * usual);
    gaps
}

/// Steps per second: one over the mean interval, pauses left out; and 1.96 standard errors of it, Hz. Of at least three steps, ascending, s.
pub fn rate_of(step_s: &[f64]) -> (f64, f64) {
    let walked = walked_s(step_s);
    let n = walked.len().max(1) as f64;
    let mean = walked.iter().sum::<f64>() / n;
    let variance = walked.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let rate = 1.0 / mean;
    (rate, 1.96 * rate * rate * (variance / n).sqrt())
}

/// Agreement of found events with true ones: each true event takes at most one found event within `tolerance_s`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Harmonic mean of precision and recall; 0 when nothing matches.
    pub f1: f64,
    /// Median of found minus true over the matches, s; 0 without matches.
    pub offset_s: f64,
    /// Matches.
    pub matched: usize,
}

/// F1 of two ascending series of event times, matched in order.
pub fn agreement(found_s: &[f64], true_s: &[f64], tolerance_s: f64) -> Agreement {
    let (mut i, mut j) = (0, 0);
    let mut offsets = Vec::new();
    while i < found_s.len() && j < true_s.len() {
        let d = found_s[i] - true_s[j];
        if d.abs() <= tolerance_s {
            offsets.push(d);
            i += 1;
            j += 1;
        } else if d < 0.0 {
            i += 1;
        } else {
            j += 1;
        }
    }
    let total = found_s.len() + true_s.len();
    Agreement {
        f1: if total == 0 {
            0.0
        } else {
            2.0 * offsets.len() as f64 / total as f64
        },
        offset_s: quantile(&offsets, 0.5),
        matched: offsets.len(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Steps at `hz`, alternating strong and weak (a pocket), some harmonics, gravity along a tilted axis.
    fn walk(hz: f64, rate_hz: f64, length_s: f64, asymmetry: f64) -> (Vec<f64>, [Vec<f64>; 3]) {
        let n = (length_s * rate_hz) as usize;
        let t: Vec<f64> = (0..n).map(|k| k as f64 / rate_hz).collect();
        let up: Vec<f64> = t
            .iter()
            .map(|t| {
                let p = TAU * hz * t;
                9.81 + 2.0 * p.cos()
                    + 0.8 * (2.0 * p + 0.3).cos()
                    + asymmetry * (0.5 * p + 1.0).cos()
            })
            .collect();
        let x = up.iter().map(|u| 0.6 * u).collect();
        let y = up.iter().map(|u| 0.8 * u).collect();
        (t, [x, y, vec![0.0; n]])
    }

    #[test]
    fn a_pace_that_swings_fast_is_seen_as_it_is() {
        // z = −0.02 cos φ, φ = 4πt + 0.5 sin Ωt, by hand z̈ = 0.02 (φ̇² cos φ + φ̈ sin φ); the band alone misses φ by 0.062 rad (the same in SciPy).
        let omega = TAU * 0.7;
        let t: Vec<f64> = (0..6000).map(|k| f64::from(k) / 100.0).collect();
        let phi = |t: &f64| 2.0 * TAU * t + 0.5 * (omega * t).sin();
        let heave = |t: &f64| {
            let rate = 2.0 * TAU + 0.5 * omega * (omega * t).cos();
            let bend = -0.5 * omega * omega * (omega * t).sin();
            0.02 * (rate * rate * phi(t).cos() + bend * phi(t).sin())
        };
        let found = steps_in(&t, &t.iter().map(heave).collect::<Vec<f64>>()).unwrap();
        let off = |k: usize| wrap(found.phase_rad[k] - phi(&t[k]));
        let rms = ((1000..5000).map(|k| off(k).powi(2)).sum::<f64>() / 4000.0).sqrt();
        assert!(rms < 0.03, "{rms}");
    }

    fn check(hz: f64, rate_hz: f64, asymmetry: f64) {
        let (t, [x, y, z]) = walk(hz, rate_hz, 60.0, asymmetry);
        let found = steps(&t, [&x, &y, &z]).unwrap();
        let truth: Vec<f64> = (0..)
            .map(|k| k as f64 / hz)
            .take_while(|t| *t < 60.0)
            .collect();
        let a = agreement(&found.step_s, &truth, 0.25);
        assert!(a.f1 > 0.97, "{hz} Hz at {rate_hz} Hz, {asymmetry}: {a:?}");
        assert!((found.cadence_hz - hz).abs() < 0.01, "{}", found.cadence_hz);
        // 2π per step.
        let (a, b) = (1000, 5000);
        let turns = (found.phase_rad[b] - found.phase_rad[a]) / TAU;
        let expected = (found.t_s[b] - found.t_s[a]) * hz;
        assert!((turns - expected).abs() < 0.1, "{turns} {expected}");
    }

    /// To the last bit, also where there is no phase.
    fn same(a: &Steps, b: &Steps) -> bool {
        let bits = |x: &[f64]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let all = |s: &Steps| [&s.step_s, &s.t_s, &s.phase_rad, &s.restored_rad].map(|x| bits(x));
        all(a) == all(b) && a.cadence_hz == b.cadence_hz
    }

    /// Somebody stands still from 30 to 38 s: the band rings on for a second, the phase does not.
    #[test]
    fn who_stands_still_has_no_phase() {
        let (t, [x, y, z]) = walk(2.0, 100.0, 60.0, 0.0);
        let halts = |x: Vec<f64>, share: f64| -> Vec<f64> {
            let part = |(t, x): (&f64, f64)| match (30.0..38.0).contains(t) {
                true => share * 9.81,
                false => x,
            };
            t.iter().zip(x).map(part).collect()
        };
        let (x, y) = (halts(x, 0.6), halts(y, 0.8));
        let found = steps(&t, [&x, &y, &z]).unwrap();
        for (t, phase) in found.t_s.iter().zip(&found.phase_rad) {
            let walks = (1.0..28.5).contains(t) || (39.5..59.0).contains(t);
            let stands = (30.0..38.0).contains(t) || *t < 0.4 || *t > 59.6;
            assert!(phase.is_finite() || !walks, "{t}");
            assert!(phase.is_nan() || !stands, "{t}");
        }
    }

    #[test]
    fn in_a_hole_there_are_no_steps_and_no_phase() {
        let t: Vec<f64> = (0..6000).map(|k| f64::from(k) * 0.01).collect();
        let t: Vec<f64> = t
            .into_iter()
            .filter(|t| !(20.0..23.0).contains(t))
            .collect();
        let x: Vec<f64> = t
            .iter()
            .map(|t| 9.8 + 2.0 * (TAU * 2.0 * t).cos())
            .collect();
        let found = steps_in(&t, &x).unwrap();
        assert!(!found.step_s.iter().any(|t| (20.0..23.0).contains(t)));
        for (t, phase) in found.t_s.iter().zip(&found.phase_rad) {
            let off = (phase - TAU * 2.0 * t).rem_euclid(TAU);
            if *t > 19.8 && *t < 23.2 {
                assert!(phase.is_nan(), "{t}");
            } else if (2.0..58.0).contains(t) && !(19.7..23.3).contains(t) {
                assert!(off.min(TAU - off) < 0.35, "{t} {off}");
            }
        }
    }

    #[test]
    fn a_grid_falls_between_samples_or_on_them_alike() {
        // 200 Hz on 100 Hz: a tenth of a microsecond must not decide on which side of a cell a sample counts.
        let mean_of = |late_s: f64| {
            let t: Vec<f64> = (0..400)
                .map(|k| f64::from(k) * 0.005 + late_s * f64::from((k + 1) % 2))
                .collect();
            even(&t, &t, 100.0).1[100]
        };
        assert!((mean_of(1e-7) - mean_of(-1e-7)).abs() < 1e-6);
        assert!((mean_of(0.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn steps_of_a_known_walk() {
        for hz in [1.0, 1.5, 2.0, 2.6] {
            for rate_hz in [31.0, 50.0, 100.0, 400.0] {
                check(hz, rate_hz, 0.0);
                check(hz, rate_hz, 0.8);
            }
        }
    }

    /// Whose acceleration is a cosine steps where that is largest, between samples and whatever their rate: measured to 0.3 ms.
    #[test]
    fn a_step_is_timed_between_samples() {
        for rate_hz in [37.0, 100.0, 333.0] {
            for (hz, phase) in [(1.31, 0.4), (1.83, 1.9), (2.47, 4.0)] {
                let t: Vec<f64> = (0..(40.0 * rate_hz) as u32)
                    .map(|k| 5.0 + f64::from(k) / rate_hz)
                    .collect();
                let up = |t: &f64| 9.81 + 2.0 * (TAU * hz * t - phase).cos();
                let found = steps_in(&t, &t.iter().map(up).collect::<Vec<_>>()).unwrap();
                let inside = |t: &&f64| (15.0..35.0).contains(*t);
                let steps: Vec<f64> = found.step_s.iter().filter(inside).copied().collect();
                assert!(
                    (steps.len() as f64 - 20.0 * hz).abs() < 1.0,
                    "{}",
                    steps.len()
                );
                for step in steps {
                    let turns = hz * step - phase / TAU;
                    let off_s = (turns - turns.round()) / hz;
                    assert!(off_s.abs() < 1e-3, "{rate_hz} {hz}: {off_s}");
                }
                for (t, found) in found.t_s.iter().zip(&found.phase_rad).skip(1000).take(2000) {
                    let off = wrap(found - (TAU * hz * t - phase));
                    assert!(off.abs() < 0.01, "{rate_hz} {hz}: {off}");
                }
            }
        }
    }

    /// Six steps that are not alike repeat in the longest time that is looked at; two and three of them are a slow walk.
    #[test]
    fn many_fast_steps_in_a_repetition_are_not_few() {
        let hard = [1.6, 0.5, 1.2, 0.7, 1.5, 0.4];
        let t: Vec<f64> = (0..30_000).map(|k| f64::from(k) * 0.01).collect();
        for hz in [2.2, 2.42, 2.8] {
            let pulse = |t: &f64| {
                let near = (t * hz).round() as i64;
                let each = (near - 2..=near + 2).map(|k| {
                    let off_s = t - k as f64 / hz;
                    4.0 * hard[k.rem_euclid(6) as usize] * (-(off_s / 0.06).powi(2)).exp()
                });
                9.8 + each.sum::<f64>()
            };
            let found = steps_in(&t, &t.iter().map(pulse).collect::<Vec<_>>()).unwrap();
            let off_hz = found.cadence_hz - hz;
            assert!(off_hz.abs() < 0.02, "{hz}: {}", found.cadence_hz);
        }
    }

    #[test]
    fn samples_that_are_none_are_passed_over() {
        let (t, axes) = walk(1.8, 100.0, 30.0, 0.3);
        let clean = steps(&t, [&axes[0], &axes[1], &axes[2]]).unwrap();
        let (mut bad_t, mut bad) = (t.clone(), axes.clone());
        for (k, time, x) in [
            (700, f64::NAN, 9.0),
            (900, t[900] - 1e-3, f64::NAN),
            (1200, t[1200] - 1e-3, 2e5),
            (1500, t[1400], 9.0),
        ] {
            bad_t.insert(k, time);
            for (axis, values) in bad.iter_mut().enumerate() {
                values.insert(k, if axis == 0 { x } else { 0.0 });
            }
        }
        let found = steps(&bad_t, [&bad[0], &bad[1], &bad[2]]).unwrap();
        assert!(same(&found, &clean));
    }

    #[test]
    fn fifteen_samples_a_second_are_enough() {
        for (rate_hz, enough) in [(15.0, true), (14.9993, true), (14.5, false)] {
            let (t, [x, y, z]) = walk(1.5, rate_hz, 60.0, 0.0);
            let found = steps(&t, [&x, &y, &z]);
            assert_eq!(found.is_ok(), enough, "{rate_hz} Hz: {found:?}");
        }
    }

    #[test]
    fn a_wrong_stamp_costs_nothing_but_itself() {
        let (mut t, [x, y, z]) = walk(1.8, 100.0, 60.0, 0.3);
        let found = steps(&t[..5000], [&x[..5000], &y[..5000], &z[..5000]]).unwrap();
        t[5000..].iter_mut().for_each(|t| *t += 7e9);
        t[5999] += 1e12;
        assert!(same(&steps(&t, [&x, &y, &z]).unwrap(), &found));
        // Pairs of samples a long way apart, but no gap.
        let pairs: Vec<f64> = (0..6000)
            .map(|k| f64::from(9 * (k / 2)) + 0.01 * f64::from(k % 2))
            .collect();
        assert!(matches!(
            steps(&pairs, [&x, &y, &z]),
            Err(StepError::TooSlow { .. })
        ));
    }

    #[test]
    fn a_device_on_a_table_does_not_walk() {
        let t: Vec<f64> = (0..3000).map(|k| k as f64 / 100.0).collect();
        let z: Vec<f64> = (0..3000)
            .map(|k| 9.81 + 0.01 * ((k * 37 % 101) as f64 / 50.0 - 1.0))
            .collect();
        let o = vec![0.0; 3000];
        assert!(matches!(
            steps(&t, [&o, &o, &z]),
            Err(StepError::NoWalking { .. })
        ));
        assert!(matches!(
            steps(&t[..100], [&o, &o, &z]),
            Err(StepError::TooShort { .. })
        ));
        assert!(matches!(
            steps(&[], [&o, &o, &z]),
            Err(StepError::TooShort { .. })
        ));
    }

    #[test]
    fn agreement_counts_each_event_once() {
        let a = agreement(&[0.0, 0.1, 2.0], &[0.05, 1.0, 2.1], 0.2);
        assert_eq!(a.matched, 2);
        assert!((a.f1 - 2.0 / 3.0).abs() < 1e-12);
    }
}

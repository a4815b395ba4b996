//! Welch spectra of what matters, with their lines found and named after the drive's frequency f.

use serde::Serialize;

use crate::inputs::{Window, finite, mean_step_s, on_axis, stretches};
use crate::median::median;
use crate::spectrum::{DEFAULT_SEGMENT_S, Options, Spectrum, welch};
use crate::summary::{ends, moves, squares};

/// A line of a spectrum.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Peak {
    /// Frequency, refined between bins (Hz).
    pub hz: f64,
    /// Power spectral density at its bin [unit²/Hz].
    pub power: f64,
    /// `f`, `f/2`, `3f/2`, `2f`, `5f/2`, `3f`, or `other`.
    pub kind: &'static str,
}

/// What is told of a spectrum.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpectrumSummary {
    /// `welch`.
    pub method: &'static str,
    /// Taper.
    pub window: &'static str,
    /// The strongest line (Hz).
    pub peak_hz: Option<f64>,
    /// The lines, strongest first.
    pub peaks: Vec<Peak>,
    /// f, after which the lines are named: the beat, else the height's strongest line (Hz).
    pub f_hz: Option<f64>,
    /// Length of a segment (s).
    pub segment_s: f64,
    /// 1 / segment length (Hz).
    pub resolution_hz: f64,
    /// Equivalent noise bandwidth (Hz).
    pub enbw_hz: f64,
    /// Segments averaged.
    pub segments: usize,
    /// Factors from a bin to the ends of its 95 % confidence interval.
    pub confidence_95: [f64; 2],
    /// Unit of the densities.
    pub unit: String,
    /// The spectrum itself, for figures; not written out.
    #[serde(skip)]
    pub spectrum: Spectrum,
}

/// At most this many lines are told.
const MOST: usize = 8;
/// A line stands this far above the spectrum's median ...
const ABOVE_MEDIAN: f64 = 10.0;
/// ... and this far below its strongest line at most.
const BELOW_PEAK: f64 = 1e-4;
/// Names of the multiples of f/2.
const NAMES: [&str; 6] = ["f/2", "f", "3f/2", "2f", "5f/2", "3f"];

impl SpectrumSummary {
    /// Finds and names the lines of a spectrum of a signal in `unit`.
    pub fn new(spectrum: Spectrum, f_hz: Option<f64>, unit: &str) -> Self {
        let (low, high) = spectrum.confidence(0.95);
        let unit = if unit.is_empty() {
            "1/Hz".to_owned()
        } else {
            format!("({unit})^2/Hz")
        };
        SpectrumSummary {
            method: "welch",
            window: "hann",
            peak_hz: spectrum.peak_hz(),
            peaks: peaks(&spectrum, f_hz),
            f_hz,
            segment_s: spectrum.segment_s,
            resolution_hz: spectrum.resolution_hz,
            enbw_hz: spectrum.enbw_hz,
            segments: spectrum.segments,
            confidence_95: [low, high],
            unit,
            spectrum,
        }
    }

    /// Of an evenly sampled column in a window, in segments of [`DEFAULT_SEGMENT_S`]: of the longest part without a hole. `None` below 16
    /// finite samples of it, and where their squares are beyond what a float holds.
    pub fn of(
        t_s: &[f64],
        x: &[f64],
        window: Window,
        f_hz: Option<f64>,
        unit: &str,
    ) -> Option<Self> {
        if x.len() != t_s.len() {
            return None;
        }
        let range = window.range(t_s);
        // An estimated column has no values at its ends.
        let (t_s, x) = finite(&t_s[range.clone()], &x[range]);
        let parts = stretches(&t_s, 0.0).into_iter();
        let longest = parts.max_by_key(ExactSizeIterator::len)?;
        let (t_s, x) = (&t_s[longest.clone()], &x[longest]);
        let [low, high] = ends(x);
        if x.len() < 16 || !squares(low, high) {
            return None;
        }
        let step_s = mean_step_s(t_s)?;
        let fs_hz = 1.0 / step_s;
        let still = vec![0.0; x.len()];
        let (_, x) = on_axis(t_s, if moves(x) { x } else { &still }, t_s[0], step_s);
        let spectrum = welch(&x, fs_hz, &Options::seconds(DEFAULT_SEGMENT_S, fs_hz)).ok()?;
        Some(SpectrumSummary::new(spectrum, f_hz, unit))
    }
}

/// Local maxima that stand out, strongest first.
fn peaks(s: &Spectrum, f_hz: Option<f64>) -> Vec<Peak> {
    let p = &s.power;
    if p.len() < 5 {
        return Vec::new();
    }
    let Some(median) = median(&mut p[1..].to_vec()) else {
        return Vec::new();
    };
    let largest = p[1..].iter().copied().fold(median, f64::max);
    let floor = (ABOVE_MEDIAN * median).max(BELOW_PEAK * largest);
    // Maxima of five bins: the taper's main lobe is four wide.
    let is_top = |k: &usize| {
        (k.saturating_sub(2).max(1)..(k + 3).min(p.len())).all(|j| j == *k || p[j] < p[*k])
    };
    // The first bins hold what is left of drifts, not lines.
    let mut tops: Vec<usize> = (3..p.len())
        .filter(|k| p[*k] > floor)
        .filter(is_top)
        .collect();
    tops.sort_by(|a, b| p[*b].total_cmp(&p[*a]));
    let mut kept: Vec<usize> = Vec::new();
    for k in tops {
        // What the stronger lines leak here through the taper's side lobes, twice over.
        let leaked: f64 = kept
            .iter()
            .map(|j| p[*j] * side_lobe(k.abs_diff(*j) as f64))
            .sum();
        if p[k] > 2.0 * leaked && kept.len() < MOST {
            kept.push(k);
        }
    }
    kept.into_iter()
        .map(|k| {
            let hz = s.refine(k);
            Peak {
                hz,
                power: p[k],
                kind: f_hz.map_or("other", |f| name(hz, f, s.resolution_hz)),
            }
        })
        .collect()
}

/// The envelope of the Hann taper's side lobes in power, `d` bins from a line: 1 / (π d (d² − 1))²; 1 inside the main lobe (Harris 1978).
fn side_lobe(d: f64) -> f64 {
    if d < 2.0 {
        1.0
    } else {
        (std::f64::consts::PI * d * (d * d - 1.0)).powi(-2)
    }
}

/// The multiple of f/2 that lies within one resolution of `hz` (and within an eighth of f).
fn name(hz: f64, f_hz: f64, resolution_hz: f64) -> &'static str {
    let near = resolution_hz.min(f_hz / 8.0);
    let multiple = (hz / (f_hz / 2.0)).round();
    let fits = (hz - multiple * f_hz / 2.0).abs() <= near && (1.0..=6.0).contains(&multiple);
    if fits {
        NAMES[multiple as usize - 1]
    } else {
        "other"
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn lines_are_found_refined_and_named() {
        let t: Vec<f64> = (0..1364).map(|k| k as f64 * 0.033).collect();
        let mut state = 1u64;
        let x: Vec<f64> = t
            .iter()
            .map(|t| {
                state = state
                    .wrapping_mul(6364136223846793005)
                    .wrapping_add(1442695040888963407);
                let noise = (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
                (TAU * 1.075 * t).sin()
                    + 0.1 * (TAU * 2.15 * t).sin()
                    + 0.05 * (TAU * 5.5 * t).sin()
                    + 0.01 * noise
            })
            .collect();
        let s = SpectrumSummary::of(&t, &x, Window::ALL, Some(2.15), "rad").unwrap();
        let told: Vec<&str> = s.peaks.iter().map(|p| p.kind).collect();
        assert_eq!(told, ["f/2", "f", "other"]);
        for (peak, hz) in s.peaks.iter().zip([1.075, 2.15, 5.5]) {
            assert!((peak.hz - hz).abs() < 0.1 * s.resolution_hz, "{peak:?}");
        }
        assert_eq!(s.unit, "(rad)^2/Hz");
    }
}

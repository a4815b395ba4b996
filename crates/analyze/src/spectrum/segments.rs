//! Cutting a signal into tapered, detrended, transformed segments: what every spectrum here is made of.

use std::iter::StepBy;
use std::ops::Range;
use std::sync::Arc;

use realfft::RealToComplex;
use realfft::num_complex::Complex64;

use super::fft::Work;
use super::taper::Weights;
use super::{Detrend, Options, Scaling, Spectrum, SpectrumError, fft};

/// The plan of a segmentation; its clones share what is large.
#[derive(Clone)]
pub(crate) struct Segments {
    pub nperseg: usize,
    pub step: usize,
    nfft: usize,
    fs_hz: f64,
    pub detrend: Detrend,
    scaling: Scaling,
    taper: Arc<Weights>,
    plan: Arc<dyn RealToComplex<f64>>,
}

impl Segments {
    /// For a signal of `len` samples (`usize::MAX` where that is not known yet).
    pub fn new(len: usize, fs_hz: f64, options: &Options) -> Result<Self, SpectrumError> {
        if !(fs_hz.is_finite() && fs_hz > 0.0) {
            return Err(SpectrumError::Rate(fs_hz));
        }
        if len == 0 || options.nperseg == 0 {
            return Err(SpectrumError::TooShort {
                found: len.min(options.nperseg),
                needed: 1,
            });
        }
        let nperseg = options.nperseg.min(len);
        let noverlap = options.noverlap.unwrap_or(nperseg / 2);
        if noverlap >= nperseg {
            return Err(SpectrumError::Overlap { noverlap, nperseg });
        }
        let nfft = options.nfft.unwrap_or(nperseg);
        if nfft < nperseg {
            return Err(SpectrumError::Nfft { nfft, nperseg });
        }
        Ok(Segments {
            nperseg,
            step: nperseg - noverlap,
            nfft,
            fs_hz,
            detrend: options.detrend,
            scaling: options.scaling,
            taper: Weights::of(options.window, nperseg),
            plan: fft::plan(nfft),
        })
    }

    /// The same segmentation at another rate.
    pub fn at_rate(&self, fs_hz: f64) -> Result<Self, SpectrumError> {
        if !(fs_hz.is_finite() && fs_hz > 0.0) {
            return Err(SpectrumError::Rate(fs_hz));
        }
        Ok(Segments {
            fs_hz,
            ..self.clone()
        })
    }

    /// First samples of the whole segments in a signal of `len` samples.
    pub fn starts(&self, len: usize) -> StepBy<Range<usize>> {
        (0..len - self.nperseg + 1).step_by(self.step)
    }

    /// The transform of one segment, detrended and tapered, unscaled.
    pub fn transform<'a>(&self, x: &[f64], work: &'a mut Work) -> &'a [Complex64] {
        let x = &x[..self.nperseg];
        let (offset, slope) = trend(x, self.detrend);
        let weights = &self.taper.values;
        work.transform(self.plan.as_ref(), |input| {
            let (input, padding) = input.split_at_mut(x.len());
            if slope == 0.0 {
                for ((i, x), w) in input.iter_mut().zip(x).zip(weights) {
                    *i = (x - offset) * w;
                }
            } else {
                for (k, ((i, x), w)) in input.iter_mut().zip(x).zip(weights).enumerate() {
                    *i = (x - offset - slope * k as f64) * w;
                }
            }
            padding.fill(0.0);
        })
    }

    pub fn bins(&self) -> usize {
        self.nfft / 2 + 1
    }

    /// What |X|² is multiplied by.
    pub fn scale(&self) -> f64 {
        let Weights { sum, squares, .. } = *self.taper;
        match self.scaling {
            Scaling::Density => 1.0 / (self.fs_hz * squares),
            Scaling::Spectrum => 1.0 / (sum * sum),
        }
    }

    /// 2 for a bin that stands for its mirror image too, else 1.
    pub fn sides(&self, k: usize) -> f64 {
        let alone = k == 0 || (self.nfft.is_multiple_of(2) && k == self.nfft / 2);
        if alone { 1.0 } else { 2.0 }
    }

    pub fn hz(&self) -> Vec<f64> {
        fft::rfft_hz(self.nfft, 1.0 / self.fs_hz)
    }

    /// The finished spectrum from the sums of |X|² over `count` segments.
    pub fn spectrum(&self, sums: Vec<f64>, count: usize) -> Spectrum {
        let scale = self.scale() / count as f64;
        let power = sums
            .iter()
            .enumerate()
            .map(|(k, s)| s * scale * self.sides(k))
            .collect();
        let Weights { sum, squares, .. } = *self.taper;
        let segment_s = self.nperseg as f64 / self.fs_hz;
        Spectrum {
            hz: self.hz(),
            power,
            segments: count,
            segment_s,
            resolution_hz: 1.0 / segment_s,
            enbw_hz: self.fs_hz * squares / (sum * sum),
            degrees_of_freedom: self.degrees_of_freedom(count),
        }
    }

    /// ν = 2K / (1 + 2 Σ_j (1 − j/K) ρ_j), ρ_j = (Σ w\[n\] w\[n + jS\] / Σ w²)²; S the step, K the count of segments.
    fn degrees_of_freedom(&self, count: usize) -> f64 {
        let Weights {
            values: w, squares, ..
        } = self.taper.as_ref();
        let mut sum = 0.0;
        for j in 1..count {
            let lag = j * self.step;
            if lag >= w.len() {
                break;
            }
            let shared: f64 = w[lag..].iter().zip(w).map(|(a, b)| a * b).sum();
            sum += (1.0 - j as f64 / count as f64) * (shared / squares).powi(2);
        }
        2.0 * count as f64 / (1.0 + 2.0 * sum)
    }
}

/// Σ x, in lanes: independent additions, which are quick and round less than one after the other.
fn sum(x: &[f64]) -> f64 {
    let (whole, rest) = x.as_chunks::<16>();
    let mut lanes = [0.0; 16];
    for chunk in whole {
        lanes.iter_mut().zip(chunk).for_each(|(lane, x)| *lane += x);
    }
    lanes.iter().sum::<f64>() + rest.iter().sum::<f64>()
}

/// Offset and slope per sample of what `detrend` takes off.
fn trend(x: &[f64], detrend: Detrend) -> (f64, f64) {
    let n = x.len() as f64;
    match detrend {
        Detrend::None => (0.0, 0.0),
        Detrend::Constant => (sum(x) / n, 0.0),
        Detrend::Linear => {
            let mean = sum(x) / n;
            let middle = (n - 1.0) / 2.0;
            let (mut up, mut down) = (0.0, 0.0);
            for (k, x) in x.iter().enumerate() {
                let k = k as f64 - middle;
                up += k * (x - mean);
                down += k * k;
            }
            let slope = if down > 0.0 { up / down } else { 0.0 };
            (mean - slope * middle, slope)
        }
    }
}

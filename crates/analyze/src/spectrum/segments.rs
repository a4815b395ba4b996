//! Cutting a signal into tapered, detrended, transformed segments: what every spectrum here is made of.

use std::iter::StepBy;
use std::ops::Range;
use std::sync::Arc;

use realfft::RealToComplex;
use realfft::num_complex::Complex64;

use super::{Detrend, Options, Scaling, Spectrum, SpectrumError, fft};

/// The plan of a segmentation, with its buffers.
pub(crate) struct Segments {
    pub nperseg: usize,
    pub step: usize,
    nfft: usize,
    fs_hz: f64,
    detrend: Detrend,
    scaling: Scaling,
    taper: Vec<f64>,
    plan: Arc<dyn RealToComplex<f64>>,
    input: Vec<f64>,
    output: Vec<Complex64>,
    scratch: Vec<Complex64>,
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
        let plan = fft::plan(nfft);
        Ok(Segments {
            nperseg,
            step: nperseg - noverlap,
            nfft,
            fs_hz,
            detrend: options.detrend,
            scaling: options.scaling,
            taper: options.window.values(nperseg),
            input: plan.make_input_vec(),
            output: plan.make_output_vec(),
            scratch: plan.make_scratch_vec(),
            plan,
        })
    }

    /// The same segmentation at another rate.
    pub fn at_rate(&self, fs_hz: f64) -> Result<Self, SpectrumError> {
        if !(fs_hz.is_finite() && fs_hz > 0.0) {
            return Err(SpectrumError::Rate(fs_hz));
        }
        Ok(Segments {
            fs_hz,
            taper: self.taper.clone(),
            plan: self.plan.clone(),
            input: Vec::new(),
            output: Vec::new(),
            scratch: Vec::new(),
            ..*self
        })
    }

    /// First samples of the whole segments in a signal of `len` samples.
    pub fn starts(&self, len: usize) -> StepBy<Range<usize>> {
        (0..len - self.nperseg + 1).step_by(self.step)
    }

    /// The transform of one segment, detrended and tapered, unscaled.
    pub fn transform(&mut self, x: &[f64]) -> &[Complex64] {
        let n = self.nperseg;
        let (offset, slope) = trend(&x[..n], self.detrend);
        if slope == 0.0 {
            for ((i, x), w) in self.input.iter_mut().zip(x).zip(&self.taper) {
                *i = (x - offset) * w;
            }
        } else {
            for (k, ((i, x), w)) in self.input.iter_mut().zip(x).zip(&self.taper).enumerate() {
                *i = (x - offset - slope * k as f64) * w;
            }
        }
        self.input[n..].fill(0.0);
        // OK because the buffers were made to the plan's lengths, the only way in which it can fail.
        self.plan
            .process_with_scratch(&mut self.input, &mut self.output, &mut self.scratch)
            .expect("buffers of the plan's own length");
        &self.output
    }

    pub fn bins(&self) -> usize {
        self.nfft / 2 + 1
    }

    /// What |X|² is multiplied by.
    pub fn scale(&self) -> f64 {
        let sum: f64 = self.taper.iter().sum();
        let squares: f64 = self.taper.iter().map(|w| w * w).sum();
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
        let sum: f64 = self.taper.iter().sum();
        let squares: f64 = self.taper.iter().map(|w| w * w).sum();
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
        let w = &self.taper;
        let squares: f64 = w.iter().map(|w| w * w).sum();
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

/// Offset and slope per sample of what `detrend` takes off.
fn trend(x: &[f64], detrend: Detrend) -> (f64, f64) {
    let n = x.len() as f64;
    match detrend {
        Detrend::None => (0.0, 0.0),
        Detrend::Constant => (x.iter().sum::<f64>() / n, 0.0),
        Detrend::Linear => {
            let mean = x.iter().sum::<f64>() / n;
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

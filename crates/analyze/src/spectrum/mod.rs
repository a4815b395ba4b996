//! Spectra with SciPy's argument names and SciPy's numbers (to 1e-10; `tests/scipy.rs` holds the vectors).
//!
//! [`welch`], [`csd`], [`coherence`] and [`spectrogram`] take slices and a rate, never a file. [`Options::seconds`]
//! chooses the segment in seconds, long enough to separate a line at half the step frequency from its neighbours:
//! SciPy's own default of 256 samples is 0.39 Hz wide at 100 Hz, which cannot. [`stream::WelchStream`] gives the same numbers
//! from batches, in memory that does not grow.

mod confidence;
mod fft;
mod segments;
pub mod stream;
mod taper;

pub use confidence::{chi_square_cdf, chi_square_quantile};
pub use fft::{rfft, rfft_hz, rfft_magnitude};
pub use taper::Taper;

use fft::Work;
pub use realfft::num_complex::Complex64;
use segments::Segments;

/// The segment length that [`Options::seconds`] is called with when nobody says otherwise.
///
/// A Hann segment of 20 s is 0.075 Hz wide (its equivalent noise bandwidth), a tenth of the half-frequency line of the slowest walk.
pub const DEFAULT_SEGMENT_S: f64 = 20.0;

/// What is taken off each segment before it is tapered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detrend {
    /// Nothing.
    None,
    /// The mean.
    Constant,
    /// The least-squares line.
    Linear,
}

/// What the values of a spectrum mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scaling {
    /// Power spectral density [unit²/Hz].
    Density,
    /// Power of a line (unit²): a sine of amplitude A between no bins shows A²/2.
    Spectrum,
}

/// How the segments' periodograms become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Average {
    /// Their mean.
    Mean,
    /// Their median, corrected for its bias: one wild segment does not matter.
    Median,
}

/// The arguments of `scipy.signal.welch` and its family, under SciPy's names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// The taper.
    pub window: Taper,
    /// Samples in a segment; a longer one than the signal is cut to the signal, as SciPy does.
    pub nperseg: usize,
    /// Samples that neighbours share; `None` is `nperseg / 2` (for a spectrogram `nperseg / 8`).
    pub noverlap: Option<usize>,
    /// Length of the transform; `None` is `nperseg`, more pads with zeros.
    pub nfft: Option<usize>,
    /// What is taken off each segment.
    pub detrend: Detrend,
    /// Density or power.
    pub scaling: Scaling,
    /// Mean or median of the segments.
    pub average: Average,
}

impl Default for Options {
    /// SciPy's defaults for `welch`.
    fn default() -> Self {
        Options {
            window: Taper::Hann,
            nperseg: 256,
            noverlap: None,
            nfft: None,
            detrend: Detrend::Constant,
            scaling: Scaling::Density,
            average: Average::Mean,
        }
    }
}

impl Options {
    /// SciPy's defaults but for the segment, which is `segment_s` long at the rate `fs_hz` (at least 2 samples).
    pub fn seconds(segment_s: f64, fs_hz: f64) -> Self {
        Options {
            nperseg: ((segment_s * fs_hz).round() as usize).max(2),
            ..Options::default()
        }
    }

    /// SciPy's defaults for `spectrogram`: a Tukey window (0.25) that shares an eighth with its neighbour.
    pub fn spectrogram(nperseg: usize) -> Self {
        Options {
            window: Taper::Tukey(0.25),
            nperseg,
            noverlap: Some(nperseg / 8),
            ..Options::default()
        }
    }
}

/// Why a spectrum could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SpectrumError {
    /// The signal has no samples.
    #[error("the signal has {found} samples; a spectrum needs at least {needed}")]
    TooShort {
        /// Samples there.
        found: usize,
        /// Samples needed.
        needed: usize,
    },
    /// `noverlap ≥ nperseg`.
    #[error(
        "noverlap is {noverlap} but nperseg is {nperseg}: the overlap has to be shorter than the segment"
    )]
    Overlap {
        /// The overlap asked for.
        noverlap: usize,
        /// The segment asked for.
        nperseg: usize,
    },
    /// `nfft < nperseg`.
    #[error(
        "nfft is {nfft} but nperseg is {nperseg}: the transform has to be at least as long as the segment"
    )]
    Nfft {
        /// The transform length asked for.
        nfft: usize,
        /// The segment asked for.
        nperseg: usize,
    },
    /// The rate is not a positive number.
    #[error("the sampling rate is {0} Hz; it has to be a positive number")]
    Rate(f64),
    /// Two signals that have to be equally long are not.
    #[error("the two signals have {0} and {1} samples; they have to be equally long")]
    Lengths(usize, usize),
    /// A sample is NaN or infinite.
    #[error("sample {0} is not a finite number; leave such samples out or fill them first")]
    NotFinite(usize),
}

/// A one-sided power spectrum and what is needed to judge it.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// Frequencies of the bins (Hz).
    pub hz: Vec<f64>,
    /// Values [unit²/Hz or unit²].
    pub power: Vec<f64>,
    /// How many segments were averaged.
    pub segments: usize,
    /// Length of a segment (s).
    pub segment_s: f64,
    /// Distance between bins that carry information of their own: 1 / `segment_s` (Hz).
    pub resolution_hz: f64,
    /// Equivalent noise bandwidth of the taper, f_s Σw² / (Σw)² (Hz).
    pub enbw_hz: f64,
    /// Equivalent degrees of freedom of each bin's χ² distribution, with the overlap's correlation counted.
    pub degrees_of_freedom: f64,
}

impl Spectrum {
    /// Factors that turn a bin into the ends of its confidence interval at `level` (0.95): `power·low … power·high`.
    ///
    /// ```text
    /// ν P̂ / P ~ χ²_ν   ⇒   P ∈ [ν / χ²_ν(1−α/2), ν / χ²_ν(α/2)] · P̂,   α = 1 − level
    /// ```
    /// Holds for Gaussian noise away from 0 Hz and the Nyquist frequency. Source: Welch, IEEE Trans. Audio 15 (1967) 70;
    /// ν with overlap after Percival & Walden, Spectral Analysis (1993), eq. 292b.
    pub fn confidence(&self, level: f64) -> (f64, f64) {
        let tail = (1.0 - level) / 2.0;
        let nu = self.degrees_of_freedom;
        (
            nu / chi_square_quantile(1.0 - tail, nu),
            nu / chi_square_quantile(tail, nu),
        )
    }

    /// The strongest bin above 0 Hz, refined by a parabola through the logarithms of its neighbours (Hz). `None` when all is zero.
    pub fn peak_hz(&self) -> Option<f64> {
        let (k, p) = self
            .power
            .iter()
            .enumerate()
            .skip(1)
            .max_by(|a, b| a.1.total_cmp(b.1))?;
        if *p <= 0.0 {
            return None;
        }
        Some(self.refine(k))
    }

    /// Frequency of the line whose highest bin is `k`, from a parabola through log power (Hz).
    pub fn refine(&self, k: usize) -> f64 {
        if k == 0 || k + 1 >= self.power.len() {
            return self.hz[k];
        }
        let [a, b, c] = [self.power[k - 1], self.power[k], self.power[k + 1]];
        if !(a > 0.0 && b >= a && c > 0.0 && b >= c) {
            return self.hz[k];
        }
        let (a, b, c) = (a.ln(), b.ln(), c.ln());
        let bend = a - 2.0 * b + c;
        let shift = if bend < 0.0 {
            0.5 * (a - c) / bend
        } else {
            0.0
        };
        self.hz[k] + shift.clamp(-0.5, 0.5) * (self.hz[1] - self.hz[0])
    }
}

/// A complex one-sided cross spectrum.
#[derive(Clone, Debug, PartialEq)]
pub struct CrossSpectrum {
    /// Frequencies of the bins (Hz).
    pub hz: Vec<f64>,
    /// Mean of conj(X)·Y, scaled as [`Scaling`] says.
    pub power: Vec<Complex64>,
}

/// A spectrum for every moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrogram {
    /// Frequencies (Hz).
    pub hz: Vec<f64>,
    /// Middles of the segments (s) after the first sample.
    pub t_s: Vec<f64>,
    /// `power[segment][bin]`.
    pub power: Vec<Vec<f64>>,
}

/// What a [`spectrogram`] shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Power, scaled as [`Scaling`] says.
    Psd,
    /// Magnitude of the transform, scaled by the root of the power's scale, not doubled for the missing half.
    Magnitude,
}

/// Welch's averaged periodogram: `scipy.signal.welch(x, fs, ...)`, one-sided.
///
/// ```text
/// P[k] = mean_s |Σ_n w[n] (x_s[n] − trend) e^{−2πikn/nfft}|² · 2 / (f_s Σ w²)      (density; no 2 at 0 and f_s/2)
/// ```
/// x [unit], `fs_hz` (Hz), P [unit²/Hz]. A segment longer than the signal is cut to it. Source: Welch (1967); SciPy 1.17.
///
/// # Errors
/// [`SpectrumError`] for an empty signal, non-finite samples, a rate that is no rate, or lengths that do not fit.
pub fn welch(x: &[f64], fs_hz: f64, options: &Options) -> Result<Spectrum, SpectrumError> {
    let segments = Segments::new(x.len(), fs_hz, options)?;
    check_finite(x)?;
    let mut work = Work::default();
    let mut bins = vec![0.0; segments.bins()];
    let mut all = Vec::new();
    let starts = segments.starts(x.len());
    for start in starts.clone() {
        let transform = segments.transform(&x[start..start + segments.nperseg], &mut work);
        match options.average {
            Average::Mean => bins
                .iter_mut()
                .zip(transform)
                .for_each(|(b, z)| *b += z.norm_sqr()),
            Average::Median => {
                all.push(transform.iter().map(|z| z.norm_sqr()).collect::<Vec<f64>>())
            }
        }
    }
    let count = starts.len();
    if options.average == Average::Median {
        bins = medians(&all);
        bins.iter_mut().for_each(|b| *b *= count as f64);
    }
    Ok(segments.spectrum(bins, count))
}

/// Cross spectral density: `scipy.signal.csd(x, y, fs, ...)`, the mean of conj(X)·Y, one-sided.
///
/// # Errors
/// As [`welch`], and for signals of different length.
pub fn csd(
    x: &[f64],
    y: &[f64],
    fs_hz: f64,
    options: &Options,
) -> Result<CrossSpectrum, SpectrumError> {
    if x.len() != y.len() {
        return Err(SpectrumError::Lengths(x.len(), y.len()));
    }
    check_finite(x)?;
    check_finite(y)?;
    let segments = Segments::new(x.len(), fs_hz, options)?;
    let (mut work_x, mut work_y) = (Work::default(), Work::default());
    let mut sums = vec![Complex64::default(); segments.bins()];
    let mut all = Vec::new();
    let starts = segments.starts(x.len());
    for start in starts.clone() {
        let range = start..start + segments.nperseg;
        let products = segments
            .transform(&x[range.clone()], &mut work_x)
            .iter()
            .zip(segments.transform(&y[range], &mut work_y))
            .map(|(x, y)| x.conj() * y);
        match options.average {
            Average::Mean => sums.iter_mut().zip(products).for_each(|(s, p)| *s += p),
            Average::Median => all.push(products.collect::<Vec<_>>()),
        }
    }
    let count = starts.len() as f64;
    if options.average == Average::Median {
        // SciPy takes the medians of the real and the imaginary parts.
        let part = |f: fn(&Complex64) -> f64| {
            medians(
                &all.iter()
                    .map(|s| s.iter().map(f).collect())
                    .collect::<Vec<_>>(),
            )
        };
        let (re, im) = (part(|z| z.re), part(|z| z.im));
        sums = re
            .into_iter()
            .zip(im)
            .map(|(re, im)| Complex64::new(re, im) * count)
            .collect();
    }
    let scale = segments.scale();
    let power = sums
        .iter()
        .enumerate()
        .map(|(k, s)| s * (scale * segments.sides(k) / count))
        .collect();
    Ok(CrossSpectrum {
        hz: segments.hz(),
        power,
    })
}

/// Magnitude-squared coherence: `scipy.signal.coherence`, |P_xy|² / (P_xx P_yy), 0 … 1.
///
/// With one segment it is 1 everywhere and says nothing: use at least 8. Bins where a signal has no power are 0.
///
/// # Errors
/// As [`csd`].
pub fn coherence(
    x: &[f64],
    y: &[f64],
    fs_hz: f64,
    options: &Options,
) -> Result<(Vec<f64>, Vec<f64>), SpectrumError> {
    let xx = welch(x, fs_hz, options)?;
    let yy = welch(y, fs_hz, options)?;
    let xy = csd(x, y, fs_hz, options)?;
    let ratio = |(k, z): (usize, &Complex64)| {
        let power = xx.power[k] * yy.power[k];
        if power > 0.0 {
            z.norm_sqr() / power
        } else {
            0.0
        }
    };
    let values = xy.power.iter().enumerate().map(ratio).collect();
    Ok((xy.hz, values))
}

/// `scipy.signal.spectrogram(x, fs, ...)` with mode `psd` or `magnitude`; take the options from [`Options::spectrogram`] for SciPy's defaults.
///
/// # Errors
/// As [`welch`].
pub fn spectrogram(
    x: &[f64],
    fs_hz: f64,
    options: &Options,
    mode: Mode,
) -> Result<Spectrogram, SpectrumError> {
    check_finite(x)?;
    let noverlap = options.noverlap.unwrap_or(options.nperseg.min(x.len()) / 8);
    let mut work = Work::default();
    let segments = Segments::new(
        x.len(),
        fs_hz,
        &Options {
            noverlap: Some(noverlap),
            ..*options
        },
    )?;
    let scale = segments.scale();
    let starts = segments.starts(x.len());
    let middle = segments.nperseg as f64 / 2.0;
    let t_s = starts
        .clone()
        .map(|s| (s as f64 + middle) / fs_hz)
        .collect();
    let mut power = Vec::with_capacity(starts.len());
    for start in starts {
        let sides: Vec<f64> = (0..segments.bins()).map(|k| segments.sides(k)).collect();
        let transform = segments.transform(&x[start..start + segments.nperseg], &mut work);
        let value = |(z, sides): (&Complex64, &f64)| match mode {
            Mode::Psd => z.norm_sqr() * scale * sides,
            Mode::Magnitude => z.norm() * scale.sqrt(),
        };
        power.push(transform.iter().zip(&sides).map(value).collect());
    }
    Ok(Spectrogram {
        hz: segments.hz(),
        t_s,
        power,
    })
}

fn check_finite(x: &[f64]) -> Result<(), SpectrumError> {
    match x.iter().position(|x| !x.is_finite()) {
        Some(k) => Err(SpectrumError::NotFinite(k)),
        None => Ok(()),
    }
}

/// Bin by bin the median over segments, over the median's bias for a χ²₂ variable (Allen et al., Phys. Rev. D 85 (2012) 122006, appendix B).
fn medians(all: &[Vec<f64>]) -> Vec<f64> {
    let n = all.len();
    let bias = 1.0
        + (1..=(n - 1) / 2)
            .map(|i| 1.0 / (2 * i + 1) as f64 - 1.0 / (2 * i) as f64)
            .sum::<f64>();
    let mut column = vec![0.0; n];
    (0..all[0].len())
        .map(|k| {
            column.iter_mut().zip(all).for_each(|(c, s)| *c = s[k]);
            column.sort_by(f64::total_cmp);
            (column[(n - 1) / 2] + column[n / 2]) / 2.0 / bias
        })
        .collect()
}

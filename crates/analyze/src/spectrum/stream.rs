//! Welch's method on a signal that arrives in batches, in memory that does not grow with it.

use super::segments::Segments;
use super::{Options, Spectrum, SpectrumError};

/// Collects samples and transforms each segment as soon as it is whole. Gives exactly what [`super::welch`] gives on
/// the joined signal (mean average; if the signal ends before the first segment is full, that signal's own spectrum).
pub struct WelchStream {
    segments: Segments,
    fs_hz: f64,
    options: Options,
    buffer: Vec<f64>,
    sums: Vec<f64>,
    count: usize,
}

impl WelchStream {
    /// An empty stream at the rate `fs_hz`.
    ///
    /// # Errors
    /// As [`super::welch`], for the options alone.
    pub fn new(fs_hz: f64, options: &Options) -> Result<Self, SpectrumError> {
        let segments = Segments::new(usize::MAX, fs_hz, options)?;
        let sums = vec![0.0; segments.bins()];
        Ok(WelchStream {
            segments,
            fs_hz,
            options: *options,
            buffer: Vec::new(),
            sums,
            count: 0,
        })
    }

    /// The next samples. They have to be finite: leave others out before.
    pub fn push(&mut self, mut x: &[f64]) {
        let nperseg = self.segments.nperseg;
        while !x.is_empty() {
            // Straight from the caller's slice where a whole segment lies in it.
            if self.buffer.is_empty() && x.len() >= nperseg {
                self.add(&x[..nperseg]);
                x = &x[self.segments.step..];
                continue;
            }
            let missing = nperseg - self.buffer.len();
            let take = missing.min(x.len());
            self.buffer.extend_from_slice(&x[..take]);
            x = &x[take..];
            if self.buffer.len() == nperseg {
                let mut buffer = std::mem::take(&mut self.buffer);
                self.add(&buffer);
                buffer.drain(..self.segments.step);
                self.buffer = buffer;
            }
        }
    }

    fn add(&mut self, segment: &[f64]) {
        for (sum, z) in self.sums.iter_mut().zip(self.segments.transform(segment)) {
            *sum += z.norm_sqr();
        }
        self.count += 1;
    }

    /// The spectrum of what came so far.
    ///
    /// # Errors
    /// [`SpectrumError::TooShort`] if nothing came.
    pub fn finish(&self) -> Result<Spectrum, SpectrumError> {
        self.finish_at(self.fs_hz)
    }

    /// The same at the rate `fs_hz`, where that became known only at the end; the segments keep their number of samples.
    ///
    /// # Errors
    /// As [`WelchStream::finish`], and for a rate that is no rate.
    pub fn finish_at(&self, fs_hz: f64) -> Result<Spectrum, SpectrumError> {
        if self.count == 0 {
            return super::welch(&self.buffer, fs_hz, &self.options);
        }
        Ok(self
            .segments
            .at_rate(fs_hz)?
            .spectrum(self.sums.clone(), self.count))
    }
}

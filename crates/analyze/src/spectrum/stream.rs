//! Welch's method on a signal that arrives in batches, in memory that does not grow with it.

use super::fft::with_work;
use super::segments::Segments;
use super::{Detrend, Options, Spectrum, SpectrumError};

/// Collects samples and transforms each segment as soon as it is whole. Gives exactly what [`super::welch`] gives on
/// the joined signal (mean average; if the signal ends before the first segment is full, that signal's own spectrum).
#[derive(Clone)]
pub struct WelchStream {
    segments: Segments,
    fs_hz: f64,
    options: Options,
    buffer: Vec<f64>,
    sums: Vec<f64>,
    count: usize,
    /// The longest part that came before a restart and made no segment.
    aside: Vec<f64>,
    samples: u64,
    bridged: u64,
    /// How many samples came while all were the same, and which: they are not held and not transformed, since nothing is left of them
    /// without their mean. `None` once one was different.
    still: Option<(usize, f64)>,
}

impl WelchStream {
    /// An empty stream at the rate `fs_hz`.
    ///
    /// # Errors
    /// As [`super::welch`], for the options alone.
    pub fn new(fs_hz: f64, options: &Options) -> Result<Self, SpectrumError> {
        let segments = Segments::new(usize::MAX, fs_hz, options)?;
        Ok(WelchStream {
            still: (options.detrend != Detrend::None).then_some((0, 0.0)),
            segments,
            fs_hz,
            options: *options,
            buffer: Vec::new(),
            aside: Vec::new(),
            samples: 0,
            bridged: 0,
            sums: Vec::new(),
            count: 0,
        })
    }

    /// The next samples. They have to be finite: leave others out before.
    pub fn push(&mut self, x: &[f64]) {
        self.samples += x.len() as u64;
        self.feed(x);
    }

    /// Goes on after `missing` samples that were lost between `last` and `next`: along the straight line between these, so that lines keep their
    /// phase, or, where they would be more than a quarter of a segment or all of them together more than what came, with a new segment.
    pub fn bridge(&mut self, missing: u64, last: f64, next: f64) {
        self.bridged = self.bridged.saturating_add(missing);
        if missing > self.segments.nperseg as u64 / 4 || self.bridged > self.samples {
            let part = std::mem::take(&mut self.buffer);
            if part.len() > self.aside.len() {
                self.aside = part;
            }
            return;
        }
        let share = 1.0 / (missing + 1) as f64;
        let line: Vec<f64> = (1..=missing)
            .map(|k| k as f64 * share)
            .map(|u| last * (1.0 - u) + next * u)
            .collect();
        self.feed(&line);
    }

    fn feed(&mut self, mut x: &[f64]) {
        if let Some((count, value)) = &mut self.still {
            if let (0, Some(first)) = (*count, x.first()) {
                *value = *first;
            }
            let same = x.iter().take_while(|x| *x == value).count();
            *count += same;
            if same == x.len() {
                return;
            }
            x = &x[same..];
            self.move_on();
        }
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

    /// Counts the segments of equal samples and holds what is left of them.
    fn move_on(&mut self) {
        if let Some((count, value)) = self.still.take() {
            let Segments { nperseg, step, .. } = self.segments;
            self.count = (count + step).saturating_sub(nperseg) / step;
            self.buffer = vec![value; count - self.count * step];
        }
    }

    fn add(&mut self, segment: &[f64]) {
        self.sums.resize(self.segments.bins(), 0.0);
        with_work(|work| {
            let transform = self.segments.transform(segment, work);
            for (sum, z) in self.sums.iter_mut().zip(transform) {
                *sum += z.norm_sqr();
            }
        });
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
        if self.still.is_some() {
            let mut moved = self.clone();
            moved.move_on();
            return moved.finish_at(fs_hz);
        }
        if self.count == 0 {
            let longest = [&self.buffer, &self.aside]
                .into_iter()
                .max_by_key(|part| part.len());
            return super::welch(longest.map_or(&[], |part| part), fs_hz, &self.options);
        }
        let mut sums = self.sums.clone();
        sums.resize(self.segments.bins(), 0.0);
        Ok(self.segments.at_rate(fs_hz)?.spectrum(sums, self.count))
    }
}

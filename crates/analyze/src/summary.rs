//! One line per signal of any recording: count, rate, jitter, range, mean, spread and strongest line, from batches as they
//! come, in memory that does not grow with the file.

use crate::spectrum::stream::WelchStream;
use crate::spectrum::{DEFAULT_SEGMENT_S, Options, Spectrum};
use std::collections::BTreeMap;

/// What a signal came to.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Summary {
    /// Finite values.
    pub count: u64,
    /// Mean rate: (messages − 1) / (last − first log time) (Hz); `None` below two.
    pub hz: Option<f64>,
    /// Population standard deviation of the steps between log times (s).
    pub jitter_s: Option<f64>,
    /// Smallest value.
    pub min: Option<f64>,
    /// Largest value.
    pub max: Option<f64>,
    /// Mean.
    pub mean: Option<f64>,
    /// Population standard deviation.
    pub sd: Option<f64>,
    /// Strongest line of Welch's spectrum at the rate between gaps, constant part taken off (Hz).
    pub peak_hz: Option<f64>,
    /// Unit, where known.
    pub unit: String,
}

/// Moments of a stream, merged batch by batch.
///
/// ```text
/// mean ← mean + δ·n_b/n,   M₂ ← M₂ + M₂_b + δ²·n_a·n_b/n,   δ = mean_b − mean_a
/// ```
/// Source: Chan, Golub & LeVeque, Am. Stat. 37 (1983) 242. Non-finite values are left out.
#[derive(Clone, Debug, Default)]
pub struct Moments {
    count: u64,
    mean: f64,
    m2: f64,
    min: f64,
    max: f64,
}

/// Lanes of the inner sums: as many independent additions as the registers hold.
const LANES: usize = 8;

impl Moments {
    /// The next values, all finite.
    pub fn push_finite(&mut self, x: &[f64]) {
        let Some(&shift) = x.first() else { return };
        let (mut sum, mut squares) = ([0.0f64; LANES], [0.0f64; LANES]);
        let (mut low, mut high) = ([shift; LANES], [shift; LANES]);
        let (chunks, rest) = x.as_chunks::<LANES>();
        for chunk in chunks {
            let d = chunk.map(|x| x - shift);
            for l in 0..LANES {
                sum[l] += d[l];
            }
            for l in 0..LANES {
                squares[l] += d[l] * d[l];
            }
            // Not `min`, which minds NaN: these become one instruction for several lanes.
            for l in 0..LANES {
                low[l] = if chunk[l] < low[l] { chunk[l] } else { low[l] };
            }
            for l in 0..LANES {
                high[l] = if chunk[l] > high[l] {
                    chunk[l]
                } else {
                    high[l]
                };
            }
        }
        for (l, x) in rest.iter().enumerate() {
            let d = x - shift;
            sum[l] += d;
            squares[l] += d * d;
            low[l] = low[l].min(*x);
            high[l] = high[l].max(*x);
        }
        let n = x.len() as f64;
        let (sum, squares): (f64, f64) = (sum.iter().sum(), squares.iter().sum());
        self.merge(&Moments {
            count: x.len() as u64,
            mean: shift + sum / n,
            m2: (squares - sum * sum / n).max(0.0),
            min: low.iter().copied().fold(shift, f64::min),
            max: high.iter().copied().fold(shift, f64::max),
        });
    }

    /// Joins the moments of other values to these.
    pub fn merge(&mut self, other: &Moments) {
        if other.count == 0 {
            return;
        }
        if self.count == 0 {
            *self = other.clone();
            return;
        }
        let (a, b) = (self.count as f64, other.count as f64);
        let delta = other.mean - self.mean;
        self.count += other.count;
        self.mean += delta * b / (a + b);
        self.m2 += other.m2 + delta * delta * a * b / (a + b);
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
    }

    /// How many values.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Mean of the values; `None` for none, or where it is beyond what a float can hold.
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0 && self.mean.is_finite()).then_some(self.mean)
    }

    /// Population standard deviation.
    pub fn sd(&self) -> Option<f64> {
        let sd = (self.m2 / self.count as f64).sqrt();
        (self.count > 0 && sd.is_finite()).then_some(sd)
    }

    /// Smallest and largest value.
    pub fn range(&self) -> Option<(f64, f64)> {
        (self.count > 0).then_some((self.min, self.max))
    }
}

/// The times of a topic's messages: rate and jitter.
#[derive(Clone, Debug, Default)]
pub struct Times {
    count: u64,
    /// What is dated before (ns) tells neither rate nor order: it belongs to no time of the recording.
    from_ns: Option<i64>,
    early: u64,
    first_ns: i64,
    last_ns: i64,
    earliest_ns: i64,
    latest_ns: i64,
    steps: Moments,
    buffer: Vec<f64>,
    /// Of the steps forward in a batch: the message that they lead to, how many messages share them, and their length (s).
    came: Vec<(usize, u64, f64)>,
    /// Steps by their length, four to an octave: how many messages came with them, and their sum (s).
    lengths: BTreeMap<u16, (u64, f64)>,
    /// Messages that share the time of the last.
    shared: u64,
    /// Sum of the steps back (s).
    back_s: f64,
    gaps: Vec<Gap>,
}

/// Messages that were lost before one of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// Its place in the batch.
    pub before: usize,
    /// How many, as far as the rate tells.
    pub missing: u64,
}

/// A step so many times the mean of those that are none is a gap, once so many messages have come with steps.
const GAP: f64 = 10.0;
const FIRST: u64 = 16;
/// Steps back that together are a larger share of the span than this put a signal out of order.
const MUCH_BACK: f64 = 0.01;

impl Times {
    /// Of a recording that begins then: what is dated before is counted only.
    pub fn since(start_ns: i64) -> Self {
        Times {
            from_ns: Some(start_ns),
            ..Times::default()
        }
    }

    /// The next log times.
    pub fn push(&mut self, times_ns: &[i64]) {
        let early = |t: &i64| self.from_ns.is_some_and(|from_ns| *t < from_ns);
        if !times_ns.iter().any(early) {
            return self.push_known(times_ns);
        }
        let known = times_ns.iter().enumerate().filter(|(_, t)| !early(t));
        let (places, known): (Vec<usize>, Vec<i64>) = known.map(|(k, t)| (k, *t)).unzip();
        self.push_known(&known);
        for gap in &mut self.gaps {
            gap.before = places[gap.before];
        }
        self.early += (times_ns.len() - known.len()) as u64;
    }

    fn push_known(&mut self, times_ns: &[i64]) {
        self.gaps.clear();
        let (Some(&first), Some(&last)) = (times_ns.first(), times_ns.last()) else {
            return;
        };
        self.buffer.clear();
        let place = usize::from(self.count == 0);
        if self.count == 0 {
            (self.first_ns, self.earliest_ns, self.latest_ns) = (first, first, first);
        } else {
            self.buffer.push(seconds(self.last_ns, first));
        }
        self.buffer
            .extend(times_ns.windows(2).map(|w| seconds(w[0], w[1])));
        for t in times_ns {
            self.earliest_ns = self.earliest_ns.min(*t);
            self.latest_ns = self.latest_ns.max(*t);
        }
        self.came.clear();
        // What is counted of the length at hand: steps of a clock are mostly of one.
        let (mut length, mut held) = (None, (0, 0.0));
        for (k, step) in self.buffer.iter().enumerate() {
            // Messages that came together share the step to them; a clock that steps back tells no rate.
            if *step <= 0.0 {
                self.back_s -= *step;
                self.shared = if *step < 0.0 { 0 } else { self.shared + 1 };
                continue;
            }
            let messages = std::mem::take(&mut self.shared) + 1;
            let each = ((step / messages as f64).to_bits() >> 50) as u16;
            if length != Some(each) {
                length.map(|length| self.lengths.insert(length, held));
                held = self.lengths.get(&each).copied().unwrap_or_default();
                length = Some(each);
            }
            held.0 += messages;
            held.1 += step;
            self.came.push((k + place, messages, *step));
        }
        length.map(|length| self.lengths.insert(length, held));
        let (n, sum_s) = self.ordinary();
        if n >= FIRST {
            let per_s = n as f64 / sum_s;
            let gaps = self.came.iter().filter_map(|&(before, messages, step)| {
                let periods = step * per_s;
                (periods > GAP * messages as f64).then(|| Gap {
                    before,
                    missing: (periods.round() as u64).saturating_sub(messages),
                })
            });
            self.gaps.extend(gaps);
        }
        self.count += times_ns.len() as u64;
        self.last_ns = last;
        self.steps.push_finite(&self.buffer);
    }

    /// Steps that are no gaps: how many messages came with them, and their sum (s). From all steps on, the longest are left out for as long as they are
    /// gaps beside the mean of the rest: that a queue was emptied at once does not make ordinary steps gaps.
    fn ordinary(&self) -> (u64, f64) {
        let mut most_s = f64::INFINITY;
        let mut found = (0, 0.0);
        loop {
            let kept = self
                .lengths
                .values()
                .filter(|(n, s)| s / *n as f64 <= most_s);
            let (n, sum_s) = kept.fold((0, 0.0), |(n, sum), s| (n + s.0, sum + s.1));
            if n == found.0 {
                return found;
            }
            found = (n, sum_s);
            most_s = GAP * sum_s / n as f64;
        }
    }

    /// Where messages were lost in the batch that was pushed last; known once the first steps have shown the rate.
    pub fn gaps(&self) -> &[Gap] {
        &self.gaps
    }

    /// Messages so far.
    pub fn count(&self) -> u64 {
        self.count + self.early
    }

    /// Whether messages come so far from the order of their times that steps and spectra tell nothing, until they are put in order: a few that
    /// are overtaken by the next do no harm.
    pub fn backward(&self) -> bool {
        self.back_s > MUCH_BACK * seconds(self.earliest_ns, self.latest_ns)
    }

    /// The earliest and the latest (ns); `None` without messages.
    pub fn ends_ns(&self) -> Option<(i64, i64)> {
        (self.count > 0).then_some((self.earliest_ns, self.latest_ns))
    }

    /// Mean rate (Hz).
    pub fn hz(&self) -> Option<f64> {
        let span_s = seconds(self.earliest_ns, self.latest_ns);
        (self.count > 1 && span_s > 0.0).then(|| (self.count - 1) as f64 / span_s)
    }

    /// Rate between gaps (Hz): that of the samples, which lost ones do not slow down.
    pub fn hz_between_gaps(&self) -> Option<f64> {
        let (count, sum_s) = self.ordinary();
        (count > 0 && sum_s > 0.0)
            .then(|| count as f64 / sum_s)
            .or(self.hz())
    }

    /// Population standard deviation of the steps (s).
    pub fn jitter_s(&self) -> Option<f64> {
        self.steps.sd().filter(|_| !self.backward())
    }
}

/// `to − from` in seconds, without overflow.
pub(crate) fn seconds(from_ns: i64, to_ns: i64) -> f64 {
    let ns = match to_ns.checked_sub(from_ns) {
        Some(ns) => ns as f64,
        None => (i128::from(to_ns) - i128::from(from_ns)) as f64,
    };
    ns / 1e9
}

/// Whether sums of squares of values between these, about their mean, are numbers with all their digits.
pub(crate) fn squares(low: f64, high: f64) -> bool {
    const LARGE: f64 = 1e140;
    let spread = high - low;
    low.abs().max(high.abs()) < LARGE && (spread == 0.0 || spread > 1.0 / LARGE)
}

/// A motion up to this is what is left of sums and differences of numbers as large as these: none.
pub(crate) fn rounding(x: &[f64]) -> f64 {
    1e-12 * x.iter().fold(0.0f64, |most, x| most.max(x.abs()))
}

/// Whether finite values differ by more than [`rounding`].
pub(crate) fn moves(x: &[f64]) -> bool {
    let [low, high] = ends(x);
    high - low > rounding(&[low, high])
}

/// The least and the most of the finite values.
pub(crate) fn ends(x: &[f64]) -> [f64; 2] {
    let known = x.iter().copied().filter(|x| x.is_finite());
    known.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
        [low.min(x), high.max(x)]
    })
}

/// One signal's moments and spectrum while the recording streams by.
pub struct Stream {
    moments: Moments,
    welch: Option<WelchStream>,
    /// The last finite value, once there is one.
    held: Option<f64>,
    filled: Vec<f64>,
}

/// The segment for a signal of about `hz` and `messages` values: a power of two near [`DEFAULT_SEGMENT_S`], never longer than the signal.
pub fn segment(hz: f64, messages: u64) -> usize {
    let wanted = (hz * DEFAULT_SEGMENT_S).clamp(16.0, 1e6) as usize;
    let longest = (messages.max(2) as usize).min(1 << 20);
    // The power of two below: 10 to 20 s.
    let power = if wanted.is_power_of_two() {
        wanted
    } else {
        wanted.next_power_of_two() / 2
    };
    power.min(longest)
}

impl Stream {
    /// For a signal of about `hz`; `nperseg` 0 leaves the spectrum out.
    pub fn new(hz: f64, nperseg: usize) -> Self {
        let options = Options {
            nperseg,
            ..Options::default()
        };
        let welch = (nperseg > 1 && hz > 0.0)
            .then(|| WelchStream::new(hz, &options).ok())
            .flatten();
        Stream {
            moments: Moments::default(),
            welch,
            held: None,
            filled: Vec::new(),
        }
    }

    /// The next values, whether all are known to be finite, and where between them others were lost ([`Times::gaps`]).
    ///
    /// What is not finite does not count; in the spectrum the last finite value stands for it, and what comes before the first is left out. Lost
    /// values are bridged there ([`WelchStream::bridge`]).
    pub fn push(&mut self, x: &[f64], finite: bool, gaps: &[Gap]) {
        let mut from = 0;
        for gap in gaps {
            self.push_on(&x[from..gap.before], finite);
            let next = Some(x[gap.before]).filter(|x| x.is_finite()).or(self.held);
            if let (Some(welch), Some(last), Some(next)) = (&mut self.welch, self.held, next) {
                welch.bridge(gap.missing, last, next);
            }
            from = gap.before;
        }
        self.push_on(&x[from..], finite);
    }

    fn push_on(&mut self, x: &[f64], finite: bool) {
        if finite || x.iter().all(|x| x.is_finite()) {
            self.moments.push_finite(x);
            if let Some(last) = x.last() {
                self.held = Some(*last);
            }
            if let Some(welch) = &mut self.welch {
                welch.push(x);
            }
            return;
        }
        self.filled.clear();
        self.filled
            .extend(x.iter().copied().filter(|x| x.is_finite()));
        self.moments.push_finite(&self.filled);
        self.filled.clear();
        for x in x {
            if x.is_finite() {
                self.held = Some(*x);
            }
            self.filled.extend(self.held);
        }
        if let Some(welch) = &mut self.welch {
            welch.push(&self.filled);
        }
    }

    /// Finite values so far.
    pub fn count(&self) -> u64 {
        self.moments.count()
    }

    /// The smallest and the largest value, where their squares are beyond what a float holds: spread and spectrum are not told then.
    pub fn beyond_squares(&self) -> Option<(f64, f64)> {
        self.moments
            .range()
            .filter(|(low, high)| !squares(*low, *high))
    }

    /// The line of the table; with `told` the spectrum, at the rate that was found in the end. Neither is told of values that do not come in the
    /// order of their times, or whose squares are beyond what a float holds.
    pub fn finish(&self, times: &Times, unit: &str, told: bool) -> (Summary, Option<Spectrum>) {
        let hz = times.hz();
        let range = self.moments.range();
        let moves = range.is_some_and(|(low, high)| high > low);
        let sizes = self.beyond_squares().is_none();
        let spectrum = times
            .hz_between_gaps()
            .filter(|_| (moves || told) && sizes && !times.backward())
            .and_then(|hz| self.welch.as_ref()?.finish_at(hz).ok());
        let summary = Summary {
            count: self.moments.count(),
            hz,
            jitter_s: times.jitter_s(),
            min: range.map(|r| r.0),
            max: range.map(|r| r.1),
            mean: self.moments.mean(),
            sd: self.moments.sd().filter(|_| sizes),
            peak_hz: spectrum
                .as_ref()
                .filter(|_| moves)
                .and_then(Spectrum::peak_hz),
            unit: unit.to_owned(),
        };
        (summary, spectrum.filter(|_| told))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_do_not_depend_on_the_batches() {
        let x: Vec<f64> = (0..1000).map(|k| 1e6 + (k as f64 * 0.37).sin()).collect();
        let mean = x.iter().sum::<f64>() / 1000.0;
        let sd = (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 1000.0).sqrt();
        for batch in [1, 3, 8, 100, 1000] {
            let mut m = Moments::default();
            x.chunks(batch).for_each(|c| m.push_finite(c));
            assert!(
                (m.mean().unwrap() - mean).abs() < 1e-9
                    && (m.sd().unwrap() / sd - 1.0).abs() < 1e-9,
                "{batch}"
            );
            let range = m.range().unwrap();
            assert_eq!(range.0, x.iter().copied().fold(f64::INFINITY, f64::min));
            assert_eq!(range.1, x.iter().copied().fold(f64::NEG_INFINITY, f64::max));
        }
        assert_eq!(Moments::default().mean(), None);
    }

    #[test]
    fn rate_and_jitter_come_from_the_times() {
        let mut times = Times::default();
        times.push(&[0, 10_000_000]);
        times.push(&[20_000_000, 31_000_000, 40_000_000]);
        assert_eq!(times.hz(), Some(100.0));
        // Steps 10, 10, 11, 9 ms.
        assert!((times.jitter_s().unwrap() - (0.5f64).sqrt() * 1e-3).abs() < 1e-12);
        // Lost messages do not slow the samples down.
        let mut gap = Times::default();
        let steps = (0..400).map(|k| k * 10_000_000 + if k < 200 { 0 } else { 2_000_000_000 });
        gap.push(&steps.collect::<Vec<_>>());
        assert!((gap.hz_between_gaps().unwrap() - 100.0).abs() < 1e-9);
        assert!(gap.hz().unwrap() < 70.0);
        // Nor does a clock that steps back, a first time that is none, or packets of ten that come in one message's time.
        let late = (0..4000).chain(4500..6000).chain(4000..4500);
        let stray = std::iter::once(-100_000).chain(0..300);
        let packets = (0..3000).map(|k| k / 10 * 10);
        for (what, steps) in [
            ("late", late.collect::<Vec<i64>>()),
            ("stray", stray.collect()),
            ("packets", packets.collect()),
        ] {
            for batch in [1, 7, 10_000] {
                let mut times = Times::default();
                let ns: Vec<i64> = steps.iter().map(|k| k * 10_000_000).collect();
                ns.chunks(batch).for_each(|c| times.push(c));
                let hz = times.hz_between_gaps().unwrap();
                assert!((hz - 100.0).abs() < 0.5, "{what} {batch}: {hz}");
            }
        }
        let mut odd = Times::default();
        odd.push(&[i64::MIN, i64::MAX, 5]);
        assert!(odd.hz().unwrap() > 0.0);
    }

    /// What is dated before the recording's start leaves the rest as it is, wherever it comes; gaps keep their places in the batch.
    #[test]
    fn early_messages_tell_no_rate() {
        for batch in [1, 7, 10_000] {
            let (mut times, mut places) = (Times::since(1_000_000_000), Vec::new());
            let at = |k: i64| match k {
                0 | 300 | 301 => k,
                _ => 1_000_000_000 + k * 10_000_000 + if k < 600 { 0 } else { 5_000_000_000 },
            };
            let ns: Vec<i64> = (0..1001).map(at).collect();
            for (b, ns) in ns.chunks(batch).enumerate() {
                times.push(ns);
                places.extend(times.gaps().iter().map(|gap| b * batch + gap.before));
            }
            assert_eq!(times.count(), 1001, "{batch}");
            assert_eq!(places, [600], "{batch}");
            let hz = times.hz_between_gaps().unwrap();
            assert!((hz - 100.0).abs() < 0.5, "{batch}: {hz}");
            assert!((times.hz().unwrap() - 997.0 / 14.99).abs() < 1e-9);
            assert!(times.jitter_s().unwrap() < 0.2 && !times.backward());
            // Where nothing came, nothing was lost.
            times.push(&[]);
            assert_eq!(times.gaps(), []);
        }
    }

    /// A queue that is emptied at once, at the beginning or all the time, changes no rate, and hides no gap.
    #[test]
    fn bursts_do_not_change_the_rate() {
        let flushed = |n: i64| move |k: i64| (k - n).max(0) * 10_000_000 + k.min(n) * 100_000;
        let pairs = |k: i64| k / 2 * 20_000_000 + k % 2 * 50_000;
        let twins = |k: i64| k / 2 * 20_000_000 + k % 2 * 3;
        let cases: [(&str, Box<dyn Fn(i64) -> i64>); 5] = [
            ("12 flushed", Box::new(flushed(12))),
            ("50 flushed", Box::new(flushed(50))),
            ("200 flushed", Box::new(flushed(200))),
            ("pairs", Box::new(pairs)),
            ("twins", Box::new(twins)),
        ];
        for (what, at) in cases {
            for batch in [1, 64, 60_000] {
                let ns: Vec<i64> = (0..60_000)
                    .map(|k| at(k) + if k < 30_000 { 0 } else { 5_000_000_000 })
                    .collect();
                let (mut times, mut gaps) = (Times::default(), 0);
                for (b, ns) in ns.chunks(batch).enumerate() {
                    times.push(ns);
                    let late = |gap: &&Gap| b * batch + gap.before > 300;
                    gaps += times.gaps().iter().filter(late).count();
                }
                let hz = times.hz_between_gaps().unwrap();
                assert!((hz - 100.0).abs() < 0.5, "{what} {batch}: {hz}");
                assert_eq!(gaps, 1, "{what} {batch}");
            }
        }
    }

    #[test]
    fn nan_is_left_out_of_the_moments_and_held_in_the_spectrum() {
        let mut s = Stream::new(100.0, 128);
        let mut times = Times::default();
        let x: Vec<f64> = (0..1000)
            .map(|k| {
                if k < 50 || k % 100 == 7 {
                    f64::NAN
                } else {
                    80.0 + (std::f64::consts::TAU * 5.0 * k as f64 / 100.0).sin()
                }
            })
            .collect();
        s.push(&x, false, &[]);
        times.push(&(0..1000).map(|k| k * 10_000_000).collect::<Vec<_>>());
        let (summary, _) = s.finish(&times, "m", false);
        assert_eq!(summary.count, 941);
        assert!((summary.peak_hz.unwrap() - 5.0).abs() < 0.1);
    }

    /// A tone keeps its frequency whatever is lost of it: many short parts, a long one, all but short ones.
    #[test]
    fn lost_messages_do_not_move_a_line() {
        let keep: [(&str, fn(f64) -> bool); 5] = [
            ("all", |_| true),
            ("many", |t| t % 5.0 < 4.6),
            ("long", |t| !(30.0..35.2).contains(&t)),
            ("most", |t| !(9.0..51.3).contains(&t)),
            ("islands", |t| t % 12.0 < 8.0),
        ];
        for (what, keep) in keep {
            for batch in [1, 64, 10_000] {
                let t: Vec<f64> = (0..6000).map(|k| f64::from(k) / 100.0).collect();
                let t: Vec<f64> = t.into_iter().filter(|t| keep(*t)).collect();
                let x: Vec<f64> = t
                    .iter()
                    .map(|t| 3.0 + (std::f64::consts::TAU * 1.3 * t).sin())
                    .collect();
                let (mut stream, mut times) = (Stream::new(100.0, 1024), Times::default());
                for (t, x) in t.chunks(batch).zip(x.chunks(batch)) {
                    let ns: Vec<i64> = t.iter().map(|t| (t * 1e9).round() as i64).collect();
                    times.push(&ns);
                    stream.push(x, true, times.gaps());
                }
                let peak_hz = stream.finish(&times, "", false).0.peak_hz.unwrap();
                assert!((peak_hz - 1.3).abs() < 0.01, "{what} {batch}: {peak_hz}");
            }
        }
    }

    /// Gaps that would be filled with more than came are not.
    #[test]
    fn absurd_gaps_cost_nothing() {
        let (mut stream, mut times) = (Stream::new(1e6, 1 << 20), Times::default());
        let mut ns = 0;
        for k in 0..100_000 {
            ns += if k < 100 || k % 2 == 0 {
                1_000
            } else {
                200_000_000
            };
            times.push(&[ns]);
            stream.push(&[f64::from(k % 7)], true, times.gaps());
        }
        assert!(stream.finish(&times, "", true).1.is_some());
    }

    #[test]
    fn what_cannot_be_squared_has_neither_spread_nor_line() {
        let of = |size: f64| {
            let (mut stream, mut times) = (Stream::new(100.0, 1024), Times::default());
            let x = |k: i64| size * (std::f64::consts::TAU * 0.01 * k as f64).sin();
            times.push(&(0..6000).map(|k| k * 10_000_000).collect::<Vec<_>>());
            stream.push(&(0..6000).map(x).collect::<Vec<_>>(), true, times.gaps());
            stream.finish(&times, "", false).0
        };
        for size in [1e160, 1e-170] {
            let found = of(size);
            assert_eq!((found.sd, found.peak_hz), (None, None), "{size:e}");
            assert_eq!(found.count, 6000);
        }
        for size in [1e100, 1.0, 1e-100] {
            let found = of(size);
            assert!((found.peak_hz.unwrap() - 1.0).abs() < 0.01, "{size:e}");
            assert!((found.sd.unwrap() / size - 0.5f64.sqrt()).abs() < 1e-3);
        }
    }

    #[test]
    fn a_constant_has_no_peak() {
        let mut s = Stream::new(100.0, 128);
        let mut times = Times::default();
        s.push(&[9.81; 500], true, &[]);
        times.push(&(0..500).map(|k| k * 10_000_000).collect::<Vec<_>>());
        assert_eq!(s.finish(&times, "", false).0.peak_hz, None);
    }
}

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

use crate::inputs::{Window, interpolate};
use crate::median::median;
use crate::spectrum::{Complex64, rfft};
use realfft::RealFftPlanner;
use std::ops::Range;

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

    /// Standard error of [`Clock::reference_s`], s.
    pub fn reference_sd_s(&self, device_s: f64) -> f64 {
        let drift_sd_ppm = self.drift_sd_ppm.unwrap_or(PRIOR_PPM);
        self.offset_sd_s
            .hypot(1e-6 * drift_sd_ppm * (device_s - self.at_s))
    }

    /// How far the device is ahead of the reference at `at_s`, s, and by how much it runs fast, ppm.
    pub fn ahead(&self) -> [f64; 2] {
        [self.at_s - self.reference_s(self.at_s), -self.drift_ppm]
    }

    /// The device's time of a moment on the reference's clock, s.
    pub fn device_s(&self, reference_s: f64) -> f64 {
        let d = 1e-6 * self.drift_ppm;
        (reference_s - self.offset_s + d * self.at_s) / (1.0 + d)
    }

    /// The drift as one believes it who knows what quartz does: the mean of what was found and of none, each by its certainty.
    ///
    /// ```text
    /// d' = d σ_p² / (σ_p² + σ_d²),    1/σ'² = 1/σ_p² + 1/σ_d²
    /// ```
    /// σ_p = 30 ppm, the tolerance of the crystals in phones and sensors at room temperature; σ_d the standard error of what was found.
    /// Taps at one end leave the drift at none, taps at both ends minutes apart set it. Source: normal prior, normal likelihood.
    pub fn believed(&self) -> Self {
        let found = self.drift_sd_ppm.unwrap_or(f64::INFINITY);
        let share = PRIOR_PPM.powi(2) / (PRIOR_PPM.powi(2) + found.powi(2));
        Self {
            drift_ppm: share * self.drift_ppm,
            drift_sd_ppm: Some(PRIOR_PPM * (1.0 - share).sqrt()),
            ..*self
        }
    }
}

/// How far quartz clocks usually part, ppm.
const PRIOR_PPM: f64 = 30.0;

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
    /// A motion that fits in two ways.
    #[error(
        "what both felt repeats itself, and fits at {first_s:+.3} s and at {second_s:+.3} s alike"
    )]
    Repeats {
        /// One offset, s.
        first_s: f64,
        /// Another, s.
        second_s: f64,
    },
    /// Events that fit in two ways.
    #[error(
        "{paired} events fit at {first_s:+.3} s and at {second_s:+.3} s alike; events at uneven intervals are needed"
    )]
    Ambiguous {
        /// Pairs.
        paired: usize,
        /// One offset, s.
        first_s: f64,
        /// Another, s.
        second_s: f64,
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
/// A parabola finds the top of a correlation to a twentieth of its step, alike in every window, s.
const TOP_SD_S: f64 = 0.05 / RATE_HZ;
/// Window in which the offset is taken as constant, s.
const WINDOW_S: f64 = 10.0;

/// Offset and drift from one motion felt by both: `x` against time on the device, `y` on the reference.
///
/// The offset is looked for within ± `search_s`. Signals are compared after resampling to 200 Hz, so both should be sampled at
/// some 25 Hz or more and hold motion throughout, not only at one end.
///
/// # Errors
/// When the two overlap by less than 5 s, do not match, or match at several offsets.
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
    let found_s = a.1.min(b.1) - a.0.max(b.0);
    let short = |s: f64| s < LEAST_SHARED_S;
    if short(found_s + search_s) || short(a.1 - a.0) || short(b.1 - b.0) {
        return Err(ClockError::TooShort {
            found_s: found_s.max(0.0),
        });
    }
    let n = ((end - start) * RATE_HZ).min(3e7) as usize + 1;
    let grid: Vec<f64> = (0..n).map(|k| start + k as f64 / RATE_HZ).collect();
    let x = inside(&grid, t_s, x);
    let y = inside(&grid, u_s, y);
    let tops = best_lags(&x, &y, (search_s * RATE_HZ) as usize);
    let best = tops.first().map_or(0.0, |top| top.correlation);
    let Some(top) = tops.first().filter(|_| best >= 0.5) else {
        return Err(ClockError::NoMatch { best });
    };
    let as_well = |other: &&Top| top.unexplained() > BETTER * other.unexplained();
    if let Some(other) = tops[1..].iter().find(as_well) {
        return Err(ClockError::Repeats {
            first_s: top.lag / RATE_HZ,
            second_s: other.lag / RATE_HZ,
        });
    }
    let lag = top.lag;
    // Window by window, near the lag of the whole.
    let width = (WINDOW_S * RATE_HZ) as usize;
    let coarse = lag.round() as i64;
    let reach = (0.3 * RATE_HZ) as usize;
    let mut points: Vec<(f64, f64)> = Vec::new();
    let mut first = 0;
    while first + width <= n {
        let from = first as i64 + coarse - reach as i64;
        if from >= 0 && from as usize + width + 2 * reach <= n {
            let q = &y.values[from as usize..from as usize + width + 2 * reach];
            // A window without motion, or one where only one device was on, has no say.
            if let Some((shift, match_)) = window_lag(&x.values[first..first + width], q)
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
        // Two clocks may part by this much from one end of what they share to the other, unseen.
        let unseen_s = 1e-6 * PRIOR_PPM * 0.5 * found_s.max(0.0);
        return Ok(Clock {
            offset_s: lag / RATE_HZ,
            offset_sd_s: TOP_SD_S.hypot(unseen_s),
            drift_ppm: 0.0,
            drift_sd_ppm: None,
            at_s: 0.5 * (a.0 + a.1),
            points: 1,
        });
    }
    // Windows overlap by half: two of them count as one and a half measurements at best.
    let clock = line(&points, 1.5, 0.0);
    Ok(Clock {
        offset_sd_s: clock.offset_sd_s.hypot(TOP_SD_S),
        ..clock
    })
}

/// Resampled about its mean; zero where the device was not on.
fn inside(grid: &[f64], t_s: &[f64], x: &[f64]) -> Felt {
    let mut values = interpolate(t_s, x, grid);
    let on = Window {
        start_s: t_s[0],
        end_s: t_s[t_s.len() - 1],
    }
    .range(grid);
    let mean = values[on.clone()].iter().sum::<f64>() / on.len().max(1) as f64;
    for (k, v) in values.iter_mut().enumerate() {
        let there = on.contains(&k) && v.is_finite();
        *v = if there { *v - mean } else { 0.0 };
    }
    Felt { on, values }
}

/// A signal about its mean, and the samples where its device was on.
struct Felt {
    on: Range<usize>,
    values: Vec<f64>,
}

impl Felt {
    /// Sums of the values and of their squares before each sample.
    fn sums(&self) -> Vec<[f64; 2]> {
        let mut sum = [0.0; 2];
        let each = self.values.iter().map(|v| {
            sum = [sum[0] + v, sum[1] + v * v];
            sum
        });
        [[0.0; 2]].into_iter().chain(each).collect()
    }
}

/// Clocks are compared over no less than this, s, nor over a smaller share of the time that the device was on which was on for less.
const LEAST_SHARED_S: f64 = 5.0;
const LEAST_SHARED: f64 = 0.5;

/// The lags by which y may be later than x, |lag| ≤ `reach`: where the correlation is at a maximum, refined, the likeliest first.
///
/// ```text
/// l = argmax −n ln(1 − r²)
/// ```
/// r Pearson's correlation of the n samples that both felt at that lag, r > 0, at the top of a parabola: the likelihood of a normal pair against that of two strangers. A device that was
/// on for a part only is compared over that part, and of a motion that nearly repeats the lag counts that most of it goes with. Source: the
/// likelihood ratio of a correlation; sums over what is shared as in Padfield, IEEE Trans. Image Process. 21 (2012) 2706.
fn best_lags(x: &Felt, y: &Felt, reach: usize) -> Vec<Top> {
    let n = (x.values.len() + y.values.len()).next_power_of_two();
    let pad = |v: &[f64]| {
        let mut p = v.to_vec();
        p.resize(n, 0.0);
        p
    };
    let mut cross: Vec<Complex64> = rfft(&pad(&x.values))
        .iter()
        .zip(rfft(&pad(&y.values)))
        .map(|(a, b)| a.conj() * b)
        .collect();
    let last = cross.len() - 1;
    (cross[0].im, cross[last].im) = (0.0, 0.0);
    let plan = RealFftPlanner::<f64>::new().plan_fft_inverse(n);
    let mut products = plan.make_output_vec();
    // OK because the lengths are the plan's own and the bins that have to be real are.
    plan.process(&mut cross, &mut products)
        .expect("buffers of the plan's own length");
    let (of_x, of_y) = (x.sums(), y.sums());
    let shared = |lag: i64| {
        let from = (x.on.start as i64).max(y.on.start as i64 - lag);
        let to = (x.on.end as i64).min(y.on.end as i64 - lag);
        (from, to, to - from)
    };
    let least = (LEAST_SHARED * x.on.len().min(y.on.len()) as f64).max(LEAST_SHARED_S * RATE_HZ);
    let whole = of_x[x.on.end][1] * of_y[y.on.end][1];
    let at = |lag: i64| {
        let (from, to, count) = shared(lag);
        if (count as f64) < least {
            return 0.0;
        }
        let count = count as f64;
        let over = |sums: &[[f64; 2]], from: i64, to: i64| {
            let [a, b] = [from, to].map(|k| sums[k as usize]);
            let sum = b[0] - a[0];
            [sum, b[1] - a[1] - sum * sum / count]
        };
        let [sx, xx] = over(&of_x, from, to);
        let [sy, yy] = over(&of_y, from + lag, to + lag);
        let product = products[lag.rem_euclid(n as i64) as usize] / n as f64;
        // So little is what rounding leaves.
        match xx * yy > 1e-12 * whole {
            true => (product - sx * sy / count) / (xx * yy).sqrt(),
            false => 0.0,
        }
    };
    let reach = (reach as i64).min(n as i64 / 2 - 2);
    let mut tops = Vec::new();
    let [mut l, mut c] = [-reach - 1, -reach].map(at);
    for lag in -reach..=reach {
        let r = at(lag + 1);
        if c > 0.0 && c >= l && c > r {
            let bend = l - 2.0 * c + r;
            let shift = (0.5 * (l - r) / bend).clamp(-0.5, 0.5);
            let correlation = (c - 0.25 * (l - r) * shift).min(1.0);
            tops.push(Top {
                lag: lag as f64 + shift,
                correlation,
                shared: shared(lag).2 as f64,
            });
        }
        (l, c) = (c, r);
    }
    tops.sort_by(|a, b| b.tells().total_cmp(&a.tells()));
    tops
}

/// A maximum of a correlation over the lag.
struct Top {
    /// In samples.
    lag: f64,
    correlation: f64,
    /// Samples that both felt.
    shared: f64,
}

impl Top {
    fn unexplained(&self) -> f64 {
        (1.0 - self.correlation.powi(2)).max(LEAST_UNEXPLAINED)
    }

    fn tells(&self) -> f64 {
        -self.shared * self.unexplained().ln()
    }
}

/// What signals of one motion leave unexplained of each other, at best, 1: half a sample of [`RATE_HZ`] between straight lines, at 5 Hz.
const LEAST_UNEXPLAINED: f64 = 1e-4;
/// Another lag goes as well as the best where that leaves more than this share of what the other leaves unexplained.
const BETTER: f64 = 0.5;

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

/// As far as quartz clocks ever part.
pub const MOST_DRIFT: f64 = 2e-4;
/// Events at either end of the device's list from which a search begins: all but one of them may be the device's own.
const ENDS: usize = 12;
/// Nobody times an event better than this, s: half a sample of two sensors at 200 Hz.
const EVENT_SD_S: f64 = 0.001;

/// Offset and drift from events both noticed (taps, claps, steps on a plate, beats), ascending times, s.
///
/// The offset is looked for within ± `search_s`, the drift within ± 200 ppm: those that pair most events to within `tolerance_s`. Each may have
/// noticed things that the other did not. A perfectly regular series fits at every multiple of its period, so tap unevenly.
///
/// # Errors
/// When fewer than two events can be paired, or as many at another offset.
pub fn from_events(
    device_s: &[f64],
    reference_s: &[f64],
    search_s: f64,
    tolerance_s: f64,
) -> Result<Clock, ClockError> {
    let middle = 0.5 * (device_s.first().unwrap_or(&0.0) + device_s.last().unwrap_or(&0.0));
    // (device, what to add) of every event that has one of the reference within the tolerance; the offset holds in the middle.
    let pairs_at = |offset: f64, drift: f64| {
        device_s.iter().filter_map(move |&d| {
            let there = d + offset + drift * (d - middle);
            let k = reference_s.partition_point(|r| *r < there);
            let near = [k.checked_sub(1), Some(k)]
                .into_iter()
                .flatten()
                .filter_map(|k| reference_s.get(k))
                .min_by(|a, b| (*a - there).abs().total_cmp(&(*b - there).abs()))?;
            ((near - there).abs() <= tolerance_s).then_some((d, near - d))
        })
    };
    let mut best: (usize, f64, f64, f64) = (0, f64::MAX, 0.0, 0.0);
    let mut alike: Vec<f64> = Vec::new();
    let late = &device_s[device_s.len().saturating_sub(ENDS)..];
    // Two pairs, one from each end of the device's list, fix an offset and a drift.
    let fits = device_s.iter().take(ENDS).flat_map(|&d| {
        within(reference_s, d, search_s).iter().flat_map(move |&r| {
            late.iter().filter(move |l| **l > d).flat_map(move |&l| {
                let there = l + r - d;
                let reach = MOST_DRIFT * (l - d) + tolerance_s;
                within(reference_s, there, reach).iter().map(move |r2| {
                    let drift = ((r2 - there) / (l - d)).clamp(-MOST_DRIFT, MOST_DRIFT);
                    (r - d + drift * (middle - d), drift)
                })
            })
        })
    });
    for (offset, drift) in fits {
        let (mut count, mut spread) = (0, 0.0);
        for (at, found) in pairs_at(offset, drift) {
            count += 1;
            spread += (found - offset - drift * (at - middle)).abs();
        }
        if count > best.0 || (count == best.0 && spread < best.1) {
            if count > best.0 {
                alike.clear();
            }
            best = (count, spread, offset, drift);
        }
        if count == best.0 && alike.last() != Some(&offset) {
            alike.push(offset);
        }
    }
    if best.0 < 2 {
        return Err(ClockError::TooFewEvents {
            device: device_s.len(),
            reference: reference_s.len(),
            paired: best.0,
        });
    }
    let other = alike
        .iter()
        .find(|o| (*o - best.2).abs() > 4.0 * tolerance_s);
    if let Some(other) = other {
        return Err(ClockError::Ambiguous {
            paired: best.0,
            first_s: best.2,
            second_s: *other,
        });
    }
    let mut clock = line(
        &pairs_at(best.2, best.3).collect::<Vec<_>>(),
        1.0,
        EVENT_SD_S,
    );
    for _ in 0..3 {
        let drift = (1e-6 * clock.drift_ppm).clamp(-MOST_DRIFT, MOST_DRIFT);
        let offset = clock.offset_s + drift * (middle - clock.at_s);
        let pairs: Vec<(f64, f64)> = pairs_at(offset, drift).collect();
        if pairs.len() < best.0 {
            break;
        }
        clock = line(&pairs, 1.0, EVENT_SD_S);
    }
    Ok(clock)
}

/// Those of ascending `times` that are at most `reach` from `t`.
fn within(times: &[f64], t: f64, reach: f64) -> &[f64] {
    let first = times.partition_point(|x| *x < t - reach);
    let count = times[first..].partition_point(|x| *x <= t + reach);
    &times[first..first + count]
}

/// Least squares through (time, offset); `shared` points are one independent measurement, which errs by `least_sd_s` or more (s).
fn line(points: &[(f64, f64)], shared: f64, least_sd_s: f64) -> Clock {
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
    let variance = (squares / n * (n / shared) / free).max(least_sd_s.powi(2));
    Clock {
        offset_s,
        offset_sd_s: (variance / (n / shared)).sqrt(),
        drift_ppm: 1e6 * drift,
        drift_sd_ppm: (points.len() > 2).then(|| 1e6 * (variance * shared / tt.max(1e-12)).sqrt()),
        at_s,
        points: points.len(),
    }
}

/// Length of a stretch that is judged as a whole, s.
const STRETCH_S: f64 = 0.5;
/// Median deviation of the specific force from its median in a stretch at rest, at most, m/s²: a hand that holds still stays below, a step does
/// not.
const REST_M_PER_S2: f64 = 0.3;
/// What a tap stands out by, m/s², and in median deviations.
const TAP_M_PER_S2: f64 = 1.5;
const TAP_DEVIATIONS: f64 = 12.0;
/// Within this time after a tap begins it still rings, s.
const RING_S: f64 = 0.15;

/// Half a second of specific force.
struct Stretch {
    number: u64,
    /// Median of each axis, m/s².
    usual: [f64; 3],
    /// Median distance from it, m/s².
    deviation: f64,
    /// Median deviation of the norm, m/s², which a turning hand leaves alone.
    of_norm: f64,
}

/// Taps at rest: moments at which the specific force jumps out of stillness, s.
///
/// Only where the half second of a sample and both its neighbours are at rest: while somebody walks, a tap cannot be told from a step. Each tap
/// is timed by the largest distance of the vector from its median, so to about half a sample, however the sensor lies: the norm would show
/// another half-swing of the ringing wherever gravity adds to it. Samples that are not finite are passed over; times ascend.
pub fn taps(t_s: &[f64], accel_m_per_s2: &[[f64; 3]]) -> Vec<f64> {
    let samples: Vec<(f64, [f64; 3])> = t_s
        .iter()
        .zip(accel_m_per_s2)
        .filter(|(t, a)| t.is_finite() && a.iter().all(|a| a.is_finite()))
        .map(|(t, a)| (*t, *a))
        .collect();
    let norm = |a: [f64; 3]| a.iter().map(|x| x * x).sum::<f64>().sqrt();
    let apart = |a: [f64; 3], b: [f64; 3]| norm(std::array::from_fn(|k| a[k] - b[k]));
    let number = |t: f64| ((t - samples[0].0) / STRETCH_S) as u64;
    let stretches: Vec<Stretch> = samples
        .chunk_by(|a, b| number(a.0) == number(b.0))
        .filter_map(|stretch| {
            let middle = |of: &dyn Fn([f64; 3]) -> f64| {
                median(&mut stretch.iter().map(|s| of(s.1)).collect::<Vec<_>>())
            };
            let usual = [middle(&|a| a[0])?, middle(&|a| a[1])?, middle(&|a| a[2])?];
            let level = middle(&norm)?;
            Some(Stretch {
                number: number(stretch[0].0),
                usual,
                deviation: middle(&|a| apart(a, usual))?,
                of_norm: middle(&|a| (norm(a) - level).abs())?,
            })
        })
        .collect();
    let at_rest = |number: u64| {
        stretches
            .binary_search_by_key(&number, |s| s.number)
            .is_ok_and(|k| stretches[k].of_norm < REST_M_PER_S2)
    };
    let mut out: Vec<(f64, f64, f64)> = Vec::new();
    for &(t, a) in &samples {
        let n = number(t);
        let Ok(k) = stretches.binary_search_by_key(&n, |s| s.number) else {
            continue;
        };
        let Stretch {
            usual, deviation, ..
        } = stretches[k];
        let height = apart(a, usual);
        let still = n > 0 && at_rest(n - 1) && at_rest(n) && at_rest(n + 1);
        if !still || !(height > TAP_M_PER_S2.max(TAP_DEVIATIONS * deviation)) {
            continue;
        }
        match out.last_mut() {
            Some((began, at, most)) if t - *began < RING_S => {
                if height > *most {
                    (*at, *most) = (t, height);
                }
            }
            _ => out.push((t, t, height)),
        }
    }
    out.into_iter().map(|tap| tap.1).collect()
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
            let there = offset + 1e-6 * drift_ppm * (clock.reference_s(clock.at_s) - 60.0);
            let error = clock.offset_s - there;
            assert!(error.abs() < 1.96 * clock.offset_sd_s, "{error} {clock:?}");
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
        // Ten minutes apart, with events of their own, and one missed.
        let (mut device, mut reference) = (vec![0.1, 0.33, 310.0], vec![0.9, 4.4, 150.0]);
        for (k, t) in [10.0, 10.7, 11.1, 12.4, 610.0, 610.9, 611.3, 612.0]
            .into_iter()
            .enumerate()
        {
            reference.push(t);
            if k != 2 {
                device.push(t + 1.3 + 80e-6 * (t - 300.0));
            }
        }
        device.sort_by(f64::total_cmp);
        reference.sort_by(f64::total_cmp);
        let clock = from_events(&device, &reference, 20.0, 0.02).unwrap();
        assert_eq!(clock.points, 7);
        assert!((clock.reference_s(1.3 + 610.9 + 80e-6 * 310.9) - 610.9).abs() < 1e-5);
        // Even taps, the first of which one of them missed.
        let even = [1.0, 2.0, 3.0, 4.0];
        assert!(matches!(
            from_events(&even[1..], &even, 5.0, 0.02),
            Err(ClockError::Ambiguous { paired: 3, .. })
        ));
        assert!(from_events(&[1.0], &[1.0], 1.0, 0.01).is_err());
        assert!(from_events(&[], &[], 1.0, 0.01).is_err());
    }

    #[test]
    fn taps_are_the_jumps_out_of_stillness() {
        let t: Vec<f64> = (0..4000).map(|k| f64::from(k) * 0.01).collect();
        // Ten seconds of rest in a hand that shakes a little, steps, rest again; a tap in each, and one that rings.
        let mut a: Vec<f64> = t
            .iter()
            .map(|t| {
                let steps = if (10.0..30.0).contains(t) { 3.0 } else { 0.05 };
                9.8 + steps * (12.6 * t).sin()
            })
            .collect();
        for (k, height) in [
            (300, 8.0),
            (302, 12.0),
            (450, -6.0),
            (2000, 40.0),
            (3500, 9.0),
        ] {
            a[k] += height;
        }
        a[100] = f64::NAN;
        let upright: Vec<[f64; 3]> = a.iter().map(|a| [0.0, 0.0, *a]).collect();
        assert_eq!(taps(&t, &upright), [t[302], t[450], t[3500]]);
        assert!(taps(&[], &[]).is_empty());
    }

    #[test]
    fn a_tap_that_rings_begins_when_it_begins_however_the_sensor_lies() {
        // A knock of 14 m/s² that rings at 22 Hz and dies in 20 ms, at moments between the samples; gravity along and against it, across, askew.
        let began = [2.003, 3.1, 4.456, 5.2];
        let t: Vec<f64> = (0..1600).map(|k| f64::from(k) * 0.005).collect();
        let ring = |t: f64| -> f64 {
            let since = began.iter().map(|b| t - b).filter(|s| *s >= 0.0);
            since
                .map(|s| 14.0 * (-s / 0.02).exp() * (140.0 * s).cos())
                .sum()
        };
        for knock in [
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
            [1.0, 0.0, 0.0],
            [0.6, 0.0, -0.8],
        ] {
            let a: Vec<[f64; 3]> = t
                .iter()
                .map(|t| std::array::from_fn(|k| [0.0, 0.0, 9.81][k] + ring(*t) * knock[k]))
                .collect();
            let found = taps(&t, &a);
            assert_eq!(found.len(), 4, "{knock:?}: {found:?}");
            for (f, b) in found.iter().zip(began) {
                assert!((f - b).abs() <= 0.005, "{knock:?}: {f} for {b}");
            }
        }
    }

    /// Residuals of 1, −2, 0, 2, −1 ms, at right angles to a constant and to a slope: s² = 10/3 ms², standard errors s/√5 and s/√10. Measured twice
    /// alike, and so counted, it is no surer.
    #[test]
    fn a_line_has_the_standard_errors_of_least_squares() {
        let of = |k: u32| {
            let rest = [1.0, -2.0, 0.0, 2.0, -1.0][k as usize];
            (f64::from(k), 0.1 + 0.01 * f64::from(k) + 1e-3 * rest)
        };
        let once: Vec<(f64, f64)> = (0..5).map(of).collect();
        let twice = [&once[..], &once].concat();
        for clock in [line(&once, 1.0, 0.0), line(&twice, 2.0, 0.0)] {
            assert!((clock.at_s - 2.0).abs() < 1e-12 && (clock.offset_s - 0.12).abs() < 1e-12);
            assert!((clock.drift_ppm - 1e4).abs() < 1e-6, "{clock:?}");
            assert!((clock.offset_sd_s - 1e-3 * (2.0f64 / 3.0).sqrt()).abs() < 1e-12);
            assert!((clock.drift_sd_ppm.unwrap() - 1e3 / 3f64.sqrt()).abs() < 1e-6);
            // 3 ms, and 4 ms of the drift.
            let sure = Clock {
                offset_sd_s: 0.003,
                drift_sd_ppm: Some(40.0),
                ..clock
            };
            assert!((sure.reference_sd_s(sure.at_s + 100.0) - 0.005).abs() < 1e-12);
        }
    }

    /// Eight seconds show an offset between samples, and no drift: it is as unsure as quartz.
    #[test]
    fn a_short_motion_tells_the_offset_alone() {
        for (late_s, other_ends_s) in [(0.1234, 8.0), (-0.0377, 8.0), (0.0561, 9.0)] {
            let at = |n: f64| (0..(n * 200.0) as u32).map(|k| f64::from(k) / 200.0);
            let t_s: Vec<f64> = at(8.0).collect();
            let u_s: Vec<f64> = at(other_ends_s).collect();
            let felt = |t: f64| motion(t + 1.0);
            let x: Vec<f64> = t_s.iter().map(|t| felt(*t)).collect();
            let y: Vec<f64> = u_s.iter().map(|t| felt(t - late_s)).collect();
            let clock = from_signals((&t_s, &x), (&u_s, &y), 1.0).unwrap();
            assert!(
                (clock.offset_s - late_s).abs() < TOP_SD_S,
                "{late_s}: {clock:?}"
            );
            let shared_s = t_s[t_s.len() - 1];
            let unseen_s = 30e-6 * 0.5 * shared_s;
            assert!((clock.offset_sd_s - TOP_SD_S.hypot(unseen_s)).abs() < 1e-9);
            assert_eq!((clock.drift_sd_ppm, clock.points), (None, 1));
            assert!((clock.at_s - 0.5 * shared_s).abs() < 1e-9);
        }
    }

    /// One that was on for a third of a walk whose swing grows and nearly repeats, from its middle on; and the other way round.
    #[test]
    fn a_device_that_was_on_for_a_part_is_compared_over_that_part() {
        let swing = |t: f64| (0.5 + t / 60.0) * (6.8 * t + 0.3 * (0.4 * t).sin()).sin().abs();
        let t_s: Vec<f64> = (0..12_000).map(|k| f64::from(k) / 200.0).collect();
        let x: Vec<f64> = t_s.iter().map(|t| swing(*t)).collect();
        let u_s: Vec<f64> = (0..2000).map(|k| 15.0 + f64::from(k) / 100.0).collect();
        let y: Vec<f64> = u_s.iter().map(|t| swing(t - 0.15)).collect();
        for (device, reference, late_s) in [
            ((&t_s[..], &x[..]), (&u_s[..], &y[..]), 0.15),
            ((&u_s, &y), (&t_s, &x), -0.15),
        ] {
            let clock = from_signals(device, reference, 300.0).unwrap();
            assert!((clock.offset_s - late_s).abs() < 2e-3, "{clock:?}");
        }
        // What repeats itself from turn to turn tells no offset.
        let x: Vec<f64> = t_s.iter().map(|t| (6.8 * t).sin().abs()).collect();
        let y: Vec<f64> = u_s.iter().map(|t| (6.8 * t + 1.0).sin().abs()).collect();
        assert!(matches!(
            from_signals((&u_s, &y), (&t_s, &x), 300.0),
            Err(ClockError::Repeats { .. })
        ));
    }

    /// One began when the other had ended, by its own clock.
    #[test]
    fn clocks_further_apart_than_their_logs_are_long_are_compared() {
        let t_s: Vec<f64> = (0..1200).map(|k| f64::from(k) / 200.0).collect();
        let u_s: Vec<f64> = t_s.iter().map(|t| t + 7.0031).collect();
        let x: Vec<f64> = t_s.iter().map(|t| motion(t + 1.0)).collect();
        let clock = from_signals((&t_s, &x), (&u_s, &x), 10.0).unwrap();
        assert!((clock.offset_s - 7.0031).abs() < TOP_SD_S, "{clock:?}");
    }

    #[test]
    fn how_little_two_devices_share_is_said() {
        let on = |from_s: f64, to_s: f64| -> Vec<f64> {
            let n = ((to_s - from_s) * 50.0) as u32;
            (0..=n).map(|k| from_s + f64::from(k) / 50.0).collect()
        };
        for (a, b, search_s, known) in [
            ((0.0, 20.0), (18.0, 40.0), 1.0, Some("share 2.0 s")),
            ((18.0, 40.0), (0.0, 20.0), 1.0, Some("share 2.0 s")),
            ((0.0, 20.0), (30.0, 60.0), 1.0, Some("share 0.0 s")),
            ((0.0, 4.0), (0.0, 60.0), 10.0, Some("share 4.0 s")),
            ((0.0, 60.0), (3.0, 7.0), 10.0, Some("share 4.0 s")),
            ((0.0, 20.0), (15.0, 40.0), 0.0, None),
        ] {
            let (t_s, u_s) = (on(a.0, a.1), on(b.0, b.1));
            let [x, y] = [&t_s, &u_s].map(|t| t.iter().map(|t| motion(*t)).collect::<Vec<_>>());
            let found = from_signals((&t_s, &x), (&u_s, &y), search_s);
            let said = found.err().map(|e| e.to_string()).unwrap_or_default();
            let short = said.contains("needs at least 5 s");
            assert_eq!(short, known.is_some(), "{a:?} {b:?}: {said}");
            assert!(said.contains(known.unwrap_or_default()), "{said}");
        }
    }

    /// A tap counts where the half seconds before, about and after it are at rest, whenever the log began.
    #[test]
    fn a_tap_beside_a_step_is_none() {
        for begins_s in [0.0, 777.3] {
            let t: Vec<f64> = (0..4000).map(|k| begins_s + f64::from(k) * 0.01).collect();
            let walks = |k: usize| (1000..3000).contains(&k);
            let mut a: Vec<[f64; 3]> = (0..4000)
                .map(|k| {
                    let step = if walks(k) { 3.0 } else { 0.05 };
                    [0.0, 0.0, 9.8 + step * (0.126 * k as f64).sin()]
                })
                .collect();
            // In the first half second, at rest, right before and behind the walk, and two half seconds from it.
            for k in [20, 400, 930, 975, 3025, 3080] {
                a[k][1] += 9.0;
            }
            let found = taps(&t, &a);
            assert_eq!(found, [t[400], t[930], t[3080]]);
        }
    }

    #[test]
    fn a_drift_is_believed_as_far_as_the_taps_reach() {
        let tapped = |t: &[f64], noise_s: f64| {
            let device: Vec<f64> = t
                .iter()
                .enumerate()
                .map(|(k, t)| t - 0.2 - 40e-6 * t + noise_s * (k as f64 * 2.4).sin())
                .collect();
            from_events(&device, t, 5.0, 0.02).unwrap().believed()
        };
        // At one end three milliseconds of scatter are no drift; at both ends, five minutes apart, forty ppm show.
        let one = tapped(&[1.0, 1.7, 2.1, 3.4], 0.003);
        assert!(one.drift_ppm.abs() < 1.0, "{one:?}");
        assert!((one.drift_sd_ppm.unwrap() - PRIOR_PPM).abs() < 1.0);
        let both = tapped(&[1.0, 1.7, 2.1, 3.4, 301.0, 301.9, 302.3, 303.0], 0.003);
        let sd = both.drift_sd_ppm.unwrap();
        assert!(
            (both.drift_ppm - 40.0).abs() < 3.0 * sd && sd < 12.0,
            "{both:?}"
        );
        let back = both.device_s(both.reference_s(200.0));
        assert!((back - 200.0).abs() < 1e-9);
    }
}

//! Tempogram, and the beat's period over time.
//!
//! ```text
//! R(t, τ) = Σ_s w(s−t) O(s) O(s+τ)            local autocorrelation of the onset strength about its mean, w = 1/(number of its terms) within 8 s, else 0
//! ```
//! A path of periods is drawn through R by dynamic programming: it follows the ridge and may bend, not jump.
//! Source: P. Grosche, M. Müller, "Extracting predominant local pulse information", IEEE TASLP 19 (2011).

use super::onset::FRAME_HZ;

/// Periods considered, s: 50 to 200 per minute.
pub const PERIOD_S: [f64; 2] = [0.3, 1.2];
/// Steps of the period's grid per factor of e.
const STEPS_PER_E: f64 = 80.0;
/// Window and hop of the tempogram, s.
const WINDOW_S: f64 = 8.0;
const HOP_S: f64 = 0.5;

/// Local autocorrelation over a grid of periods.
pub struct Tempogram {
    /// Periods, in frames, geometrically spaced.
    pub period_frames: Vec<f64>,
    /// Centre of each column, in frames.
    pub centre_frames: Vec<f64>,
    /// A column per centre, a value per period; 1 is perfect repetition.
    pub columns: Vec<Vec<f64>>,
}

/// The tempogram of an onset strength.
pub fn tempogram(strength: &[f64]) -> Tempogram {
    let steps = ((PERIOD_S[1] / PERIOD_S[0]).ln() * STEPS_PER_E) as usize;
    let period_frames: Vec<f64> = (0..=steps)
        .map(|k| PERIOD_S[0] * FRAME_HZ * (k as f64 / STEPS_PER_E).exp())
        .collect();
    let lags = (4.0 * PERIOD_S[1] * FRAME_HZ) as usize + 2;
    let half = (0.5 * WINDOW_S * FRAME_HZ) as usize;
    let hop = (HOP_S * FRAME_HZ) as usize;
    let n = strength.len();
    let centres: Vec<usize> = (0..n.max(1)).step_by(hop).collect();
    let columns = centres
        .iter()
        .map(|&centre| {
            let (a, b) = (centre.saturating_sub(half), (centre + half).min(n));
            let rho = correlation(&strength[a..b], lags);
            period_frames.iter().map(|p| comb(&rho, *p)).collect()
        })
        .collect();
    Tempogram {
        period_frames,
        centre_frames: centres.iter().map(|c| *c as f64).collect(),
        columns,
    }
}

/// Autocorrelation about the mean, unbiased, ρ(0) = 1, at lags 0 … `lags`.
fn correlation(x: &[f64], lags: usize) -> Vec<f64> {
    let n = x.len();
    let mean = x.iter().sum::<f64>() / n.max(1) as f64;
    let y: Vec<f64> = x.iter().map(|v| v - mean).collect();
    let zero = y.iter().map(|v| v * v).sum::<f64>() / n.max(1) as f64;
    (0..=lags)
        .map(|lag| {
            if zero <= 0.0 || lag + 50 >= n {
                return 0.0;
            }
            let sum: f64 = y.iter().zip(&y[lag..]).map(|(a, b)| a * b).sum();
            sum / (n - lag) as f64 / zero
        })
        .collect()
}

/// How well the onsets repeat after one, two, three and four periods.
fn comb(rho: &[f64], period: f64) -> f64 {
    let at = |lag: f64| {
        let k = lag as usize;
        match rho.get(k..k + 2) {
            Some(r) => r[0] + (lag - k as f64) * (r[1] - r[0]),
            None => 0.0,
        }
    };
    [1.0, 2.0, 3.0, 4.0]
        .iter()
        .map(|m| {
            // A maximum within ±2 % (at least a frame): onsets are narrow and play is loose.
            let slack = (0.02 * period * m).max(1.0);
            let best = [-1.0, -0.5, 0.0, 0.5, 1.0]
                .iter()
                .map(|d| at(period * m + d * slack))
                .fold(f64::MIN, f64::max);
            best / 4.0
        })
        .sum()
}

impl Tempogram {
    /// Mean over time, one value per period.
    pub fn mean(&self) -> Vec<f64> {
        let mut sum = vec![0.0; self.period_frames.len()];
        for column in &self.columns {
            for (s, c) in sum.iter_mut().zip(column) {
                *s += c / self.columns.len() as f64;
            }
        }
        sum
    }

    /// The period over time that starts from about `period` frames, may vary within a factor of 1.25 of it, and bends no
    /// faster than some percent per second; one value per column.
    pub fn path(&self, period: f64) -> Vec<f64> {
        let n = self.period_frames.len();
        let allowed: Vec<usize> = (0..n)
            .filter(|&k| (self.period_frames[k] / period).ln().abs() < 1.25f64.ln())
            .collect();
        if allowed.is_empty() {
            return vec![period; self.columns.len()];
        }
        let mut score: Vec<f64> = vec![0.0; allowed.len()];
        let mut back: Vec<Vec<usize>> = Vec::with_capacity(self.columns.len());
        for column in &self.columns {
            let mut next = vec![f64::MIN; allowed.len()];
            let mut from = vec![0; allowed.len()];
            for (j, &k) in allowed.iter().enumerate() {
                // Up to 4 grid steps (5 %) per column of half a second, each at a price.
                for i in j.saturating_sub(4)..(j + 5).min(allowed.len()) {
                    let step = i.abs_diff(j) as f64;
                    let s = score[i] - 0.02 * step * step;
                    if s > next[j] {
                        (next[j], from[j]) = (s, i);
                    }
                }
                let away = (self.period_frames[k] / period).ln();
                next[j] += column[k] - 0.5 * away * away;
            }
            score = next;
            back.push(from);
        }
        let mut at = (0..allowed.len())
            .max_by(|a, b| score[*a].total_cmp(&score[*b]))
            .unwrap_or(0);
        let mut path = Vec::with_capacity(back.len());
        for from in back.iter().rev() {
            path.push(self.period_frames[allowed[at]]);
            at = from[at];
        }
        path.reverse();
        path
    }
}

//! The beats, by dynamic programming.
//!
//! ```text
//! C(t) = O(t) + max_τ ( C(t−τ) − λ ln²(τ/T(t)) ),     T/2 ≤ τ ≤ 2T
//! ```
//! O onset strength, T(t) the period there, λ how strictly it is kept. The best chain is read backwards.
//! Source: D. Ellis, "Beat tracking by dynamic programming", J. New Music Res. 36 (2007).
//!
//! Which metrical level is the beat: chains are drawn at several multiples of the strongest period, and the level is taken
//! whose beats carry strokes (precision: few beats without one) and leave few strokes out (recall).

use super::onset::{FRAME_HZ, Onsets};
use super::tempo::{PERIOD_S, tempogram};
use std::ops::Range;

/// λ: a period 10 % off costs 0.9 standard deviations of onset strength.
const TIGHTNESS: f64 = 100.0;
/// Tempo preferred between equals, s, and how much: standard deviation in octaves.
const USUAL_PERIOD_S: f64 = 60.0 / 110.0;
const PREFERENCE_OCTAVES: f64 = 1.5;
/// Below this much repetition nothing is called a beat.
const LEAST_REPETITION: f64 = 0.08;

/// Beat times, s, ascending. `None` when nothing repeats.
pub fn beats(onsets: &Onsets) -> Option<Vec<f64>> {
    let grams = tempogram(&onsets.strength);
    let mean = grams.mean();
    let usual = |period: f64| {
        let octaves = (period / FRAME_HZ / USUAL_PERIOD_S).log2() / PREFERENCE_OCTAVES;
        (-0.5 * octaves * octaves).exp()
    };
    // Peaks of the mean tempogram, and their simple multiples.
    let top = mean.iter().copied().fold(f64::MIN, f64::max);
    if !(top > LEAST_REPETITION) {
        return None;
    }
    let mut candidates: Vec<f64> = Vec::new();
    for k in 0..mean.len() {
        let left = k == 0 || mean[k] >= mean[k - 1];
        let right = k + 1 == mean.len() || mean[k] > mean[k + 1];
        if left && right && mean[k] > 0.3 * top {
            for m in [1.0, 0.5, 2.0] {
                candidates.push(grams.period_frames[k] * m);
            }
        }
    }
    let range = [PERIOD_S[0] * FRAME_HZ * 0.98, PERIOD_S[1] * FRAME_HZ * 1.02];
    candidates.retain(|p| (range[0]..=range[1]).contains(p));
    candidates.sort_by(f64::total_cmp);
    candidates.dedup_by(|a, b| (*a / *b).ln().abs() < 0.04);
    let strokes = strokes(&onsets.accent);
    let best = candidates
        .iter()
        .map(|&period| {
            let chain = chain(onsets, &grams.path(period), &grams.centre_frames);
            let played = median_step(&chain).unwrap_or(period);
            let score = fit(&strokes, &chain) * usual(played).sqrt();
            (score, chain)
        })
        .max_by(|a, b| a.0.total_cmp(&b.0))?;
    let heard = |f: &&usize| onsets.known[near(onsets, **f)].iter().all(|k| *k);
    let beats = best.1.iter().filter(heard);
    let beats: Vec<f64> = beats.map(|&f| refined(onsets, f)).collect();
    (beats.len() >= 3).then_some(beats)
}

/// The best chain of frames through the onset strength.
fn chain(onsets: &Onsets, path: &[f64], centres: &[f64]) -> Vec<usize> {
    let o = smeared(&onsets.strength);
    let n = o.len();
    let mut score = vec![0.0; n];
    let mut from = vec![usize::MAX; n];
    let mut column = 0;
    for t in 0..n {
        while column + 1 < centres.len()
            && (centres[column + 1] - t as f64).abs() <= (centres[column] - t as f64).abs()
        {
            column += 1;
        }
        let period = path[column];
        let (a, b) = ((0.5 * period) as usize, (2.0 * period).ceil() as usize);
        let mut best = 0.0;
        for tau in a.max(1)..=b.min(t) {
            let away = (tau as f64 / period).ln();
            let s = score[t - tau] - TIGHTNESS * away * away;
            if s > best {
                best = s;
                from[t] = t - tau;
            }
        }
        score[t] = o[t] + best;
    }
    // The chain ends on the best frame of the last period.
    let tail = path.last().map_or(n, |p| (*p).ceil() as usize).min(n);
    let Some(mut t) = (n - tail..n).max_by(|a, b| score[*a].total_cmp(&score[*b])) else {
        return Vec::new();
    };
    let mut out = vec![t];
    while from[t] != usize::MAX {
        t = from[t];
        out.push(t);
    }
    out.reverse();
    // Before the music begins and after it ends there is nothing to beat.
    let loud = 0.3 * out.iter().map(|&t| o[t]).sum::<f64>() / out.len() as f64;
    let first = out.iter().position(|&t| o[t] > loud).unwrap_or(0);
    let last = out.iter().rposition(|&t| o[t] > loud).unwrap_or(0);
    out[first..=last].to_vec()
}

/// Smoothed over ±30 ms, so that a chain may pass a little beside an onset.
fn smeared(x: &[f64]) -> Vec<f64> {
    const WEIGHTS: [f64; 7] = [0.1, 0.4, 0.8, 1.0, 0.8, 0.4, 0.1];
    (0..x.len())
        .map(|i| {
            (0..7)
                .filter_map(|k| x.get((i + k).checked_sub(3)?).map(|v| v * WEIGHTS[k]))
                .sum()
        })
        .collect()
}

/// How well a chain and the strokes agree: harmonic mean of (a) the share of beats that carry a stroke and (b) the share of
/// all strokes that lies within 50 ms of a beat.
fn fit(strokes: &[(usize, f64)], chain: &[usize]) -> f64 {
    let reach = (0.05 * FRAME_HZ) as usize;
    let (Some(&first), Some(&last)) = (chain.first(), chain.last()) else {
        return 0.0;
    };
    let inside = |t: usize| (first.saturating_sub(reach)..=last + reach).contains(&t);
    let all: f64 = strokes.iter().filter(|s| inside(s.0)).map(|s| s.1).sum();
    let (mut near, mut carried) = (0.0, 0.0);
    for &t in chain {
        let from = strokes.partition_point(|s| s.0 + reach < t);
        let at = strokes[from..].iter().take_while(|s| s.0 <= t + reach);
        let (sum, most) = at.fold((0.0, 0.0f64), |(sum, most), s| (sum + s.1, most.max(s.1)));
        near += sum;
        carried += most;
    }
    if all <= 0.0 || carried <= 0.0 {
        return 0.0;
    }
    let (recall, precision) = (near / all, carried / chain.len() as f64);
    2.0 * recall * precision / (recall + precision)
}

fn median_step(chain: &[usize]) -> Option<f64> {
    let mut steps: Vec<usize> = chain.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_unstable();
    steps.get(steps.len() / 2).map(|s| *s as f64)
}

/// Strokes: local maxima of the accent, by frame, weighing 1 when at least 0.3 times as hard as the hard ones, 0 below a tenth
/// (hi-hats, the floor of a noisy room).
fn strokes(accent: &[f64]) -> Vec<(usize, f64)> {
    let tops: Vec<(usize, f64)> = (3..accent.len().saturating_sub(3))
        .filter(|&t| {
            (t - 3..t).all(|s| accent[s] < accent[t])
                && (t + 1..t + 4).all(|s| accent[s] <= accent[t])
        })
        .map(|t| (t, accent[t]))
        .collect();
    // Hard: there are two in five seconds at any tempo considered, were it only every second beat.
    let mut sorted: Vec<f64> = tops.iter().map(|t| t.1).collect();
    sorted.sort_by(|a, b| b.total_cmp(a));
    let rank = (0.4 * accent.len() as f64 / FRAME_HZ) as usize;
    let Some(hard) = sorted
        .get(rank.min(sorted.len().saturating_sub(1)))
        .copied()
    else {
        return Vec::new();
    };
    tops.into_iter()
        .map(|(t, a)| (t, ((a / hard - 0.1) / 0.2).clamp(0.0, 1.0)))
        .filter(|s| s.1 > 0.0)
        .collect()
}

/// The frames within 40 ms of one.
fn near(onsets: &Onsets, frame: usize) -> Range<usize> {
    frame.saturating_sub(4)..(frame + 5).min(onsets.strength.len())
}

/// The beat's time: the centre of the onset strength within 40 ms of the frame.
fn refined(onsets: &Onsets, frame: usize) -> f64 {
    let (mut weight, mut moment) = (1e-3, 1e-3 * frame as f64);
    for f in near(onsets, frame) {
        weight += onsets.strength[f];
        moment += onsets.strength[f] * f as f64;
    }
    onsets.time_s(moment / weight)
}

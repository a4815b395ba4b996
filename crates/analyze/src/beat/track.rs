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
//!
//! A chain goes on where nothing is struck, and through anything. So it is cut where several beats in a row carry no stroke, and each
//! part has to score above what the same strokes reach at random times, on a stricter chain:
//! ```text
//! C > A m + B s,     m, s mean and SD of C over surrogates: the strokes of the part, each as strong, at times drawn evenly
//! ```
//! A > 1 because the path of periods was drawn through the strokes themselves.

use super::onset::{FRAME_HZ, Onsets};
use super::tempo::{PERIOD_S, tempogram};
use crate::median::median;
use crate::random::Random;
use std::ops::Range;

/// λ: a period 10 % off costs 0.9 standard deviations of onset strength.
const TIGHTNESS: f64 = 100.0;
/// Tempo preferred between equals, s, and how much: standard deviation in octaves.
const USUAL_PERIOD_S: f64 = 60.0 / 110.0;
const PREFERENCE_OCTAVES: f64 = 1.5;
/// A beat carries a stroke where the onset strength is this share of what it usually is on a beat.
const STROKE: f64 = 0.3;
/// So many beats without a stroke in a row are a pause; fewer are weak, or missed.
const PAUSE: usize = 3;
/// A beat that is further from where its neighbours put it than so many times the usual, and than this share of a beat, is uneven.
const UNEVEN: f64 = 4.0;
const LEAST_UNEVEN: f64 = 0.02;
/// An uneven beat outweighs so many even ones, and so many more of the one kind are the least that makes a stretch, or ends it.
const MISFIT: f64 = 2.0;
const EVEN_BEATS: f64 = 5.0;
/// Chance: λ of its chains, and how far above the mean of so many surrogates a beat scores at least: A, and B standard deviations. Bursts at
/// random and made-up talk stay below 1.7 m, drums whose strokes scatter by 3 ms to 8 % of a period, with two in five missing or as many echoes, reach 1.9 to 3.1 m.
const CHANCE_TIGHTNESS: f64 = 400.0;
const SURROGATES: usize = 24;
const ABOVE_CHANCE: (f64, f64) = (1.25, 5.0);
/// Strokes are so many frames apart at least, and what is weaker than this share of a usual one is none.
const APART: usize = 4;
const LEAST_STROKE: f64 = 0.1;

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
    if !(top > 0.0) {
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
    let strength = smeared(&onsets.strength);
    let best = candidates
        .iter()
        .map(|&period| {
            let periods = along(&grams.path(period), &grams.centre_frames, strength.len());
            let chain = chain(&strength, &periods);
            let played = median_step(&chain).unwrap_or(period);
            let score = fit(&strokes, &chain) * usual(played).sqrt();
            (score, chain, periods)
        })
        .max_by(|a, b| a.0.total_cmp(&b.0))?;
    let (_, chain, periods) = best;
    // Of a stroke at an end of the sound a part is not heard, and its centre lies elsewhere.
    let known = |f: usize| {
        let near = near(onsets, f);
        near.len() == 2 * NEAR + 1 && onsets.known[near].iter().all(|k| *k)
    };
    let at_s: Vec<f64> = chain.iter().map(|&f| refined(onsets, f)).collect();
    let parts = played(&chain, &strength).into_iter();
    let beats: Vec<f64> = parts
        .flat_map(|part| in_time(&at_s, part))
        .filter(|part| !by_chance(&chain[part.clone()], &strength, &periods))
        .flatten()
        .filter(|k| known(chain[*k]))
        .map(|k| at_s[k])
        .collect();
    (beats.len() >= 3).then_some(beats)
}

/// The period at each of `n` frames: that of the nearest column.
fn along(path: &[f64], centres: &[f64], n: usize) -> Vec<f64> {
    let mut column = 0;
    let of = |t: usize| {
        while column + 1 < centres.len()
            && (centres[column + 1] - t as f64).abs() <= (centres[column] - t as f64).abs()
        {
            column += 1;
        }
        path[column]
    };
    (0..n).map(of).collect()
}

/// C at every frame, and the frame before it in the best chain that ends there; `usize::MAX` where that begins.
fn scores(strength: &[f64], periods: &[f64], tightness: f64) -> (Vec<f64>, Vec<usize>) {
    let n = strength.len();
    let (mut score, mut from) = (vec![0.0; n], vec![usize::MAX; n]);
    let (mut last, mut least, mut costs) = (f64::NAN, 1, Vec::new());
    for t in 0..n {
        let period = periods[t];
        if period != last {
            let (a, b) = ((0.5 * period) as usize, (2.0 * period).ceil() as usize);
            (last, least) = (period, a.max(1));
            let cost = |tau: usize| {
                let away = (tau as f64 / period).ln();
                tightness * away * away
            };
            costs = (least..=b).map(cost).collect();
        }
        let mut best = 0.0;
        for (tau, cost) in (least..=t).zip(&costs) {
            let s = score[t - tau] - cost;
            if s > best {
                best = s;
                from[t] = t - tau;
            }
        }
        score[t] = strength[t] + best;
    }
    (score, from)
}

/// The best chain of frames through the onset strength.
fn chain(strength: &[f64], periods: &[f64]) -> Vec<usize> {
    let (score, from) = scores(strength, periods, TIGHTNESS);
    let n = strength.len();
    // The chain ends on the best frame of the last period.
    let tail = periods.last().map_or(n, |p| (*p).ceil() as usize).min(n);
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
    match &played(&out, strength)[..] {
        [] => Vec::new(),
        [first, .., last] => out[first.start..last.end].to_vec(),
        [all] => out[all.clone()].to_vec(),
    }
}

/// What is usual on a beat that carries a stroke: the mean, each weighing what it is, so that silent beats do not count.
fn usual_stroke(chain: &[usize], strength: &[f64]) -> f64 {
    let each = chain.iter().map(|&t| strength[t]);
    each.clone().map(|o| o * o).sum::<f64>() / each.sum::<f64>().max(f64::MIN_POSITIVE)
}

/// The parts of a chain between pauses, from a stroke to a stroke.
fn played(chain: &[usize], strength: &[f64]) -> Vec<Range<usize>> {
    let loud = STROKE * usual_stroke(chain, strength);
    let carry: Vec<usize> = (0..chain.len())
        .filter(|&k| strength[chain[k]] > loud)
        .collect();
    carry
        .chunk_by(|a, b| b - a <= PAUSE)
        .map(|part| part[0]..part[part.len() - 1] + 1)
        .collect()
}

/// The stretches of a part in which beats come as evenly as they usually do in it: who talks while the drum is silent is followed too, unevenly.
fn in_time(at_s: &[f64], part: Range<usize>) -> Vec<Range<usize>> {
    let at_s = &at_s[..part.end];
    // How far a beat is from where two others, so many beats before or behind it, put it; in beats.
    let off = |k: usize, a: isize, b: isize| {
        let other = |by: isize| {
            let k = k.checked_add_signed(by).filter(|k| part.contains(k))?;
            Some((by as f64, at_s[k]))
        };
        let ((a, at_a), (b, at_b)) = (other(a)?, other(b)?);
        let step = (at_b - at_a) / (b - a);
        Some((at_s[k] - at_a + a * step).abs() / step)
    };
    let between: Vec<f64> = part.clone().filter_map(|k| off(k, -1, 1)).collect();
    let usual = median(&mut between.clone()).unwrap_or_default();
    let bound = LEAST_UNEVEN.max(UNEVEN * usual);
    let even = |k: usize, a: isize, b: isize| off(k, a, b).is_some_and(|off| off < bound);
    let fits = |k: usize| even(k, -1, 1) || even(k, -2, -1) || even(k, 1, 2);
    let (mut out, mut next) = (Vec::new(), part.start);
    while next < part.end {
        let (mut from, mut to, mut sum, mut most) = (next, next, 0.0, 0.0);
        for k in next..part.end {
            sum += if fits(k) { 1.0 } else { -MISFIT };
            if sum > most {
                (most, to) = (sum, k + 1);
            } else if most == 0.0 {
                (sum, from, to) = (0.0, k + 1, k + 1);
            } else if most - sum > EVEN_BEATS {
                break;
            }
        }
        next = to.max(next + 1);
        if most >= EVEN_BEATS {
            while to - from > 2 && !even(to - 1, -2, -1) {
                to -= 1;
            }
            while to - from > 2 && !even(from, 1, 2) {
                from += 1;
            }
            out.push(from..to);
        }
    }
    out
}

/// Whether strokes at random times would do as well as those about a part of a chain.
fn by_chance(part: &[usize], strength: &[f64], periods: &[f64]) -> bool {
    let (Some(&first), Some(&last)) = (part.first(), part.last()) else {
        return true;
    };
    // Half a beat at either end belongs to it.
    let beside = |t: usize| (0.5 * periods[t]) as usize;
    let from = first.saturating_sub(beside(first));
    let to = (last + beside(last)).min(strength.len());
    let (here, periods) = (&strength[from..to], &periods[from..to]);
    let least = LEAST_STROKE * usual_stroke(part, strength);
    let strokes: Vec<(usize, f64)> = here
        .windows(3)
        .enumerate()
        .filter(|(_, w)| w[1] >= w[0] && w[1] > w[2] && w[1] > least)
        .map(|(k, w)| (k + 1, w[1]))
        .collect();
    let score = |at: &mut dyn Iterator<Item = usize>| {
        let mut struck = vec![0.0; here.len()];
        for (t, (_, how_hard)) in at.zip(&strokes) {
            struck[t] += how_hard;
        }
        let (score, _) = scores(&smeared(&struck), periods, CHANCE_TIGHTNESS);
        score.into_iter().fold(0.0, f64::max)
    };
    let found = score(&mut strokes.iter().map(|s| s.0));
    let mut random = Random(1);
    let free = here.len().saturating_sub(APART * strokes.len()) as f64;
    let mut surrogate = || {
        let mut at: Vec<usize> = strokes
            .iter()
            .map(|_| (free * random.uniform()) as usize)
            .collect();
        at.sort_unstable();
        let apart = at.iter().enumerate().map(|(k, t)| t + APART * k);
        score(&mut apart.map(|t| t.min(here.len() - 1)))
    };
    let chance: Vec<f64> = (0..SURROGATES).map(|_| surrogate()).collect();
    let mean = chance.iter().sum::<f64>() / SURROGATES as f64;
    let squares: f64 = chance.iter().map(|c| (c - mean).powi(2)).sum();
    let sd = (squares / (SURROGATES - 1) as f64).sqrt();
    let (share, sds) = ABOVE_CHANCE;
    !(found > share * mean + sds * sd)
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

/// 40 ms, in frames.
const NEAR: usize = 4;

/// The frames within [`NEAR`] of one.
fn near(onsets: &Onsets, frame: usize) -> Range<usize> {
    frame.saturating_sub(NEAR)..(frame + NEAR + 1).min(onsets.strength.len())
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

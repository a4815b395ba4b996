//! For what part of the time the support is a twentieth of the weight or less, from samples of the support ratio.

use crate::median::median;
use crate::metrics::FLOAT_SHARE;

/// A share of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Floating {
    /// The share.
    pub share: f64,
    /// Its standard error by where between samples the threshold is passed.
    pub edges_sd: f64,
}

/// Share of time with a support of a twentieth of the weight or less, in stretches of even samples of one rate; without what noise makes of it: where the
/// support stays a little below that for long and passes above it fast, noise takes more out than it brings in. The same noise takes out as much once more.
///
/// ```text
/// T + T(0) − T(σ'),    T(σ') = ⟨ (G(u₁) − G(u₀)) / (u₁ − u₀) ⟩,    u = (c − s)/σ',    G(u) = u Φ(u) + φ(u)
/// σ' = √(2/3) σ,    σ = median |s₋₁ − 2 s₀ + s₊₁| / (0.6745 √6)
/// ```
/// T counts time up to the edges, T(σ') is the mean of Φ along the straight line from each sample to the next, T(0) the part of it below c; c = 0.05. The median is of
/// samples up to 2c, where little else bends; σ takes the noise for white, of which a line between two samples has √(2/3) on average. Source: as
/// [`super::interval`]'s roots of mean squares.
pub fn floating(stretches: &[&[f64]]) -> Floating {
    let lines = || stretches.iter().flat_map(|s| s.windows(2));
    let n = lines().count() as f64;
    if n == 0.0 {
        // Single samples tell of no time between them.
        let all: Vec<f64> = stretches.concat();
        let below = all.iter().filter(|s| **s <= FLOAT_SHARE).count();
        return Floating {
            share: below as f64 / all.len().max(1) as f64,
            edges_sd: 0.0,
        };
    }
    let (mut moved, mut unsure) = (0.0, 0.0);
    for edge in stretches.iter().flat_map(|s| edges(s)) {
        moved += edge.moved;
        unsure += edge.unsure;
    }
    let along = |sigma: f64| lines().map(|l| below(l[0], l[1], sigma)).sum::<f64>() / n;
    let bends = stretches.iter().flat_map(|s| s.windows(3));
    let bends = bends.filter(|w| w.iter().all(|s| s.abs() <= 2.0 * FLOAT_SHARE));
    let mut bends: Vec<f64> = bends.map(|w| (w[0] - 2.0 * w[1] + w[2]).abs()).collect();
    let sigma = median(&mut bends).unwrap_or(0.0) / (0.6745 * 6f64.sqrt());
    let straight = along(0.0);
    let of_noise = match sigma > 0.0 {
        true => straight - along((2f64 / 3.0).sqrt() * sigma),
        false => 0.0,
    };
    Floating {
        share: (straight + moved / n + of_noise).clamp(0.0, 1.0),
        // Evenly spread, and all to the same side where steps and samples keep time.
        edges_sd: unsure / n / 12f64.sqrt(),
    }
}

/// Mean of Φ((c − s)/σ) along a straight line between two samples; without σ, the part of it up to c.
fn below(from: f64, to: f64, sigma: f64) -> f64 {
    let [a, b] = [FLOAT_SHARE - from, FLOAT_SHARE - to];
    if sigma == 0.0 {
        return match a == b {
            true => f64::from(u8::from(a >= 0.0)),
            false => (a.max(0.0) - b.max(0.0)) / (a - b),
        };
    }
    let [a, b] = [a / sigma, b / sigma];
    let normal = |u: f64| 0.5 * libm::erfc(-u * std::f64::consts::FRAC_1_SQRT_2);
    let integral =
        |u: f64| u * normal(u) + (-0.5 * u * u).exp() / (2.0 * std::f64::consts::PI).sqrt();
    match (a - b).abs() < 1e-6 {
        true => normal(a),
        false => (integral(a) - integral(b)) / (a - b),
    }
}

/// Where a support passes c between two samples: a straight line between them says when, and so does what went before, drawn on, and what comes behind, drawn
/// back. In a smooth course all three are the same. At a blow, which is faster than the samples, they are as far apart as these, and the moment is in the middle as
/// likely as anywhere.
struct Edge {
    /// By how much time below c the middle of the three is more than the straight line, samples.
    moved: f64,
    /// How far apart they are, samples.
    unsure: f64,
}

fn edges(s: &[f64]) -> impl Iterator<Item = Edge> + '_ {
    let c = FLOAT_SHARE;
    s.windows(2).enumerate().filter_map(move |(k, w)| {
        let falls = w[1] <= c;
        // Steps as small as that are noise more often than blows, and their lines hardly bend.
        if (w[0] <= c) == falls || (w[0] - w[1]).abs() <= 2.0 * c {
            return None;
        }
        let within = |at: f64, else_at: f64| match (0.0..=1.0).contains(&at) {
            true => at,
            false => else_at,
        };
        let line = (w[0] - c) / (w[0] - w[1]);
        let before = k.checked_sub(1).map(|b| (c - w[0]) / (w[0] - s[b]));
        let behind = s.get(k + 2).map(|b| 1.0 + (c - w[1]) / (b - w[1]));
        let [before, behind] = [
            before.map_or(line, |at| within(at, 1.0)),
            behind.map_or(line, |at| within(at, 0.0)),
        ];
        let (first, last) = (line.min(before).min(behind), line.max(before).max(behind));
        let later = 0.5 * (first + last) - line;
        Some(Edge {
            moved: if falls { -later } else { later },
            unsure: last - first,
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use std::f64::consts::{PI, TAU};

    fn share(support_ratio: &[f64]) -> f64 {
        floating(&[support_ratio]).share
    }

    /// A support of 0.03 most of the time, through noise of 0.016: what noise takes is taken back to first order.
    #[test]
    fn noise_takes_nothing_from_what_floats_to_first_order() {
        let mut random = Random(3);
        let support = |k: usize| match k % 20 {
            k @ 0..8 => 0.4 + 0.9 * (PI * (k as f64 + 0.5) / 8.0).sin(),
            _ => 0.03,
        };
        let clean: Vec<f64> = (0..200_000).map(support).collect();
        // Blows to and fro, each half a sample from its neighbours.
        assert!((share(&clean) - 0.6).abs() < 1e-4, "{}", share(&clean));
        let noisy: Vec<f64> = clean.iter().map(|s| s + 0.016 * random.normal()).collect();
        // On the lines between samples it takes 7 % of the time, at edges 0.1 of a sample.
        assert!((share(&noisy) - 0.6).abs() < 0.006, "{}", share(&noisy));
        let below: Vec<f64> = noisy.windows(2).map(|w| below(w[0], w[1], 0.0)).collect();
        let straight = below.iter().sum::<f64>() / below.len() as f64;
        let lines = 11.0 / 20.0;
        assert!(
            (0.05..0.09).contains(&(1.0 - straight / lines)),
            "{straight}"
        );
    }

    /// Forty and twenty samples to a step, and a rate that goes with no step: by counting they are up to 0.019 and 0.024 off, all steps alike.
    #[test]
    fn samples_that_keep_time_with_the_steps_tell_the_same() {
        let truth = (PI - 2.0 * (0.95f64 / 1.9).asin()) / TAU;
        for (rate_hz, step_hz) in [(100.0, 2.5), (50.0, 2.5), (43.0, 2.15), (25.0, 2.0)] {
            for phase in (0..10).map(|k| 0.1 * f64::from(k)) {
                let at = |k: u32| (f64::from(k) + phase) * step_hz / rate_hz;
                let samples = (0..(40.0 * rate_hz) as u32).map(at);
                let ratio: Vec<f64> = samples.map(|at| 1.0 + 1.9 * (TAU * at).sin()).collect();
                let found = floating(&[&ratio]);
                let within = 1.96 * found.edges_sd + 5e-4;
                let off = found.share - truth;
                assert!(
                    off.abs() < within && within < 0.03,
                    "{rate_hz} {step_hz} {phase}: {off} within {within}"
                );
            }
        }
    }

    /// A blow is as likely in the first half of a step between samples as in the second.
    #[test]
    fn a_blow_between_samples_is_in_the_middle_and_unsure() {
        for (ratio, known) in [
            ([1.0, 1.0, 0.0, 0.0], 0.5),
            ([0.0, 0.0, 2.0, 2.0], 0.5),
            // A twentieth of the weight floats.
            ([0.05; 4], 1.0),
        ] {
            let found = floating(&[&ratio]);
            assert!((found.share - known).abs() < 1e-12, "{found:?}");
            let unsure = if known == 0.5 {
                1.0 / 3.0 / 12f64.sqrt()
            } else {
                0.0
            };
            assert!((found.edges_sd - unsure).abs() < 1e-12, "{found:?}");
        }
        // Nothing is drawn across what lies between stretches; single samples are counted.
        assert_eq!(floating(&[&[0.0, 0.0], &[1.0, 1.0]]).share, 0.5);
        assert_eq!(floating(&[&[0.0], &[1.0]]).share, 0.5);
        assert_eq!(floating(&[]).share, 0.0);
    }
}

//! How well the load moves as its carriers do, by how their clocks are shifted: [`Carriers::align`](super::carriers::Carriers::align).

use std::ops::{Range, RangeInclusive};

use crate::spectrum::Complex64;

/// Rate at which motions are compared, Hz.
pub const ALIGN_HZ: f64 = 100.0;
/// A first look takes one sample in so many.
const COARSE: usize = 5;
/// How far its maxima are looked about, samples.
const ABOUT: i64 = 6;
/// Offsets under which Σ −ln(1 − J) falls short of its maximum by no more than this are as good; at most so many are looked at.
const AS_GOOD: (f64, usize) = (1.0, 12);

/// z(t + o) at sample `i` for o of `shift` samples.
fn at(z: &[Complex64], i: usize, shift: i64) -> Complex64 {
    z[(i as i64 + shift) as usize]
}

/// −ln(1 − J) for J = |⟨X, S⟩|² / (⟨X, X⟩⟨S, S⟩), at most a hair below 1.
fn told_by(xs: Complex64, xx: f64, ss: f64) -> f64 {
    let share = xs.norm_sqr() / (ss * xx).max(f64::MIN_POSITIVE);
    -(1.0 - share.min(1.0 - 1e-12)).ln()
}

/// Σ_X −ln(1 − J_X) of two riders for all shifts on a coarse grid: maxima, best first, and the best with both shifted alike by a lag.
struct Look {
    maxima: Vec<(f64, [i64; 2])>,
    alike: f64,
}

impl Look {
    /// `felt`: what is felt and the sign of the second rider; shifts of up to `reach` samples, inside of which nothing leaves the record;
    /// a lag of the load is at most `lag` samples.
    fn new(felt: &[(Vec<Complex64>, f64)], z: [&[Complex64]; 2], reach: usize, lag: usize) -> Self {
        let n = z[0].len();
        let inner = reach..n - reach;
        let count = 2 * reach + 1;
        let dot = |x: &[Complex64], z: &[Complex64], s: usize| -> Complex64 {
            let pairs = x[inner.clone()].iter().zip(&z[s..]);
            pairs.map(|(x, z)| x.conj() * z).sum()
        };
        let power = |z: &[Complex64], s: usize| -> f64 {
            z[s..s + inner.len()].iter().map(Complex64::norm_sqr).sum()
        };
        let powers = z.map(|z| (0..count).map(|s| power(z, s)).collect::<Vec<f64>>());
        // Σ z₁(t + a) z₂*(t + b) depends on b − a but for its ends: running sums for each difference.
        let mut cross = vec![0.0; count * count];
        let mut sums = vec![0.0; n + 1];
        for apart in -(2 * reach as i64)..=2 * reach as i64 {
            for u in 0..n {
                let other = z[1].get((u as i64 + apart) as usize);
                sums[u + 1] = sums[u] + other.map_or(0.0, |other| (z[0][u] * other.conj()).re);
            }
            for a in 0..count {
                let b = a as i64 + apart;
                if (0..count as i64).contains(&b) {
                    cross[a * count + b as usize] = sums[a + inner.len()] - sums[a];
                }
            }
        }
        let mut told = vec![0.0; count * count];
        for (x, sign) in felt {
            let with = z.map(|z| (0..count).map(|s| dot(x, z, s)).collect::<Vec<_>>());
            let all: f64 = x[inner.clone()].iter().map(Complex64::norm_sqr).sum();
            for (k, told) in told.iter_mut().enumerate() {
                let (a, b) = (k / count, k % count);
                let sum = powers[0][a] + powers[1][b] + 2.0 * sign * cross[k];
                *told += told_by(with[0][a] + with[1][b] * *sign, all, sum);
            }
        }
        let top = |a: usize, b: usize| {
            let about = (a - 1..=a + 1).flat_map(|i| (b - 1..=b + 1).map(move |j| (i, j)));
            about.fold(f64::MIN, |most, (i, j)| most.max(told[i * count + j]))
        };
        let mut maxima = Vec::new();
        for a in 1..count - 1 {
            for b in 1..count - 1 {
                let here = told[a * count + b];
                if here >= top(a, b) {
                    maxima.push((here, [a, b].map(|s| s as i64 - reach as i64)));
                }
            }
        }
        maxima.sort_by(|a, b| b.0.total_cmp(&a.0));
        let lags = reach.saturating_sub(lag)..=(reach + lag).min(count - 1);
        let alike = lags.map(|a| told[a * count + a]);
        Self {
            alike: alike.fold(f64::MIN, f64::max),
            maxima,
        }
    }
}

/// How well the load moves as two carriers do: Σ_X −ln(1 − J_X), by shifts in samples of [`ALIGN_HZ`].
pub struct Match {
    /// Analytic signals of what is felt, and the sign with which the second rider is in it.
    pub felt: [(Vec<Complex64>, f64); 2],
    /// Analytic signals of the riders' heaves.
    pub riders: [Vec<Complex64>; 2],
}

/// What shifts (s) tell, best first; and what the clocks tell as they are.
pub type Matches = (Vec<(f64, [f64; 2])>, f64);

impl Match {
    /// All shifts that are as good as the best, up to `reach` samples either way; a lag of the load is at most `lag`. `None` where too little is
    /// left to compare, or nothing stands out.
    pub fn best(&self, reach: i64, lag: i64) -> Option<Matches> {
        // Shifted either way nothing may leave the record.
        let margin = (reach + ABOUT) as usize + 2;
        let inner = margin..self.riders[0].len().checked_sub(margin)?;
        let coarse = |x: &[Complex64]| x.iter().step_by(COARSE).copied().collect::<Vec<_>>();
        let [a, b] = self.riders.each_ref().map(|z| coarse(z));
        let felt = self.felt.each_ref().map(|(x, sign)| (coarse(x), *sign));
        let look = Look::new(
            &felt,
            [&a, &b],
            reach as usize / COARSE,
            lag as usize / COARSE,
        );
        let best = look.maxima.first()?.0;
        let as_good = |(told, _): &&(f64, [i64; 2])| best - told < AS_GOOD.0;
        let mut all = Vec::new();
        for (_, at) in look.maxima.iter().take_while(as_good).take(AS_GOOD.1) {
            let mut shift = at.map(|s| s * COARSE as i64);
            let (mut found, mut top) = ([0.0; 2], 0.0);
            for _ in 0..2 {
                for j in 0..2 {
                    let about = (shift[j] - ABOUT).max(-reach)..=(shift[j] + ABOUT).min(reach);
                    (found[j], top) = self.along(&mut shift, j, about, &inner)?;
                }
            }
            all.push((top, found));
        }
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        // On the same grid as the best of it.
        let as_they_are = all.first()?.0 - (best - look.alike);
        Some((all, as_they_are))
    }

    fn told(&self, shift: [i64; 2], inner: &Range<usize>) -> f64 {
        let each = self.felt.iter();
        each.map(|(x, sign)| self.alike(x, *sign, shift, inner))
            .sum()
    }

    /// How much of `x` is one complex number times the shifted sum or difference of the riders.
    fn alike(&self, x: &[Complex64], sign: f64, shift: [i64; 2], inner: &Range<usize>) -> f64 {
        let (mut xs, mut ss, mut xx) = (Complex64::default(), 0.0, 0.0);
        for i in inner.clone() {
            let sum = at(&self.riders[0], i, shift[0]) + at(&self.riders[1], i, shift[1]) * sign;
            xs += x[i].conj() * sum;
            ss += sum.norm_sqr();
            xx += x[i].norm_sqr();
        }
        told_by(xs, xx, ss)
    }

    /// The best shift of rider `j` within a range, between samples too (s), and what it tells; `shift` is left there.
    fn along(
        &self,
        shift: &mut [i64; 2],
        j: usize,
        range: RangeInclusive<i64>,
        inner: &Range<usize>,
    ) -> Option<(f64, f64)> {
        let mut score = |s: i64| {
            shift[j] = s;
            self.told(*shift, inner)
        };
        let (s, top) = range
            .map(|s| (s, score(s)))
            .max_by(|a, b| a.1.total_cmp(&b.1))?;
        let (l, r) = (score(s - 1), score(s + 1));
        shift[j] = s;
        let bend = l - 2.0 * top + r;
        let between = if bend < 0.0 {
            (0.5 * (l - r) / bend).clamp(-0.5, 0.5)
        } else {
            0.0
        };
        Some(((s as f64 + between) / ALIGN_HZ, top))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use std::f64::consts::TAU;

    /// Lines of a walker who varies its pace, as an analytic signal that is known at any time.
    fn walker(random: &mut Random) -> impl Fn(f64) -> Complex64 + use<> {
        let lines: Vec<[f64; 3]> = (0..12)
            .map(|k| {
                let hz = 1.75 + 0.05 * f64::from(k) + 0.02 * random.uniform();
                [hz, 0.5 + random.uniform(), TAU * random.uniform()]
            })
            .collect();
        move |t| {
            let each = lines.iter();
            each.map(|[hz, amplitude, phase]| {
                Complex64::from_polar(*amplitude, TAU * hz * t + phase)
            })
            .sum()
        }
    }

    /// The load heaves as the sum of both and tilts as their difference, each with a gain of its own.
    #[test]
    fn shifts_that_are_there_are_found_between_samples() {
        let mut random = Random(21);
        let (one, other) = (walker(&mut random), walker(&mut random));
        for ahead_s in [[0.37, -0.52], [-1.03, 0.244], [0.0, 0.0], [0.0063, -0.4037]] {
            let t_s = || (0..4000).map(|k| f64::from(k) / ALIGN_HZ);
            let felt = |sign: f64, gain: Complex64| -> (Vec<Complex64>, f64) {
                let at = |t| gain * (one(t + ahead_s[0]) + other(t + ahead_s[1]) * sign);
                (t_s().map(at).collect(), sign)
            };
            let compared = Match {
                felt: [
                    felt(1.0, Complex64::from(0.4)),
                    felt(-1.0, Complex64::from(-0.02)),
                ],
                riders: [t_s().map(&one).collect(), t_s().map(&other).collect()],
            };
            let (all, as_they_are) = compared.best(150, 25).unwrap();
            let (told, found_s) = all[0];
            // What both have in common is nearly what a gain does.
            let apart = |o: [f64; 2]| o[0] - o[1];
            assert!(
                (apart(found_s) - apart(ahead_s)).abs() < 0.002,
                "{ahead_s:?}: {found_s:?}"
            );
            assert!(
                (found_s[0] - ahead_s[0]).abs() < 0.03,
                "{ahead_s:?}: {found_s:?}"
            );
            // Explained to all but a few parts in ten thousand each; by clocks as they are, nothing much.
            assert!(told > 2.0 * -(3e-3f64).ln(), "{told}");
            match ahead_s == [0.0, 0.0] {
                true => assert!((told - as_they_are).abs() < 1e-6, "{told} {as_they_are}"),
                false => assert!(told - as_they_are > 3.0, "{told} {as_they_are}"),
            }
            // Nothing is looked for outside the reach.
            if ahead_s[0].abs() > 1.0 {
                let near = compared.best(50, 25);
                assert!(near.is_none_or(|(all, _)| all[0].0 < 0.5 * told));
            }
        }
        assert!(told_by(Complex64::new(3.0, 4.0), 50.0, 1.0) - 2f64.ln() < 1e-12);
    }
}

//! The strongest line of a signal, and what of its power lies near one.

use crate::holes::{fill, memory};
use crate::inputs::{Even, about_mean};
use crate::spectrum::{Taper, rfft, rfft_hz, rfft_magnitude};
use crate::summary::rounding;

/// Half-width of "near a line", as a share of f.
pub const NEAR: f64 = 0.1;

/// Bins that stand on the edge of a band are in it, whichever way their frequencies are rounded.
const ROUNDING: f64 = 1e-9;

/// So many periods of f tell a line at f/2 from one at f: a Hann taper's line reaches 2/T to either side, the band [`NEAR`] · f.
pub const FEWEST_PERIODS: f64 = 2.0 / NEAR;

/// The strongest line of a signal and the transform it was found in.
pub struct Line {
    /// Its frequency, on the grid of the transform (Hz).
    pub hz: f64,
    bin: usize,
    hz_grid: Vec<f64>,
    magnitude: Vec<f64>,
}

impl Line {
    /// argmax of |rfft(x − mean)|; `None` below four samples or for a constant.
    pub fn strongest(t_s: &[f64], x: &[f64]) -> Option<Self> {
        if x.len() < 4 {
            return None;
        }
        let Even {
            x: about, step_s, ..
        } = whole(t_s, x)?;
        let magnitude = rfft_magnitude(&about);
        let hz_grid = rfft_hz(about.len(), step_s);
        // Ties go to the lowest frequency, as NumPy's argmax does.
        let bin = (0..magnitude.len()).reduce(|best, k| {
            if magnitude[k] > magnitude[best] {
                k
            } else {
                best
            }
        })?;
        let rounding = rounding(x) * x.len() as f64;
        (bin > 0 && magnitude[bin] > rounding).then(|| Line {
            hz: hz_grid[bin],
            bin,
            hz_grid,
            magnitude,
        })
    }

    /// The largest magnitude within `half_width_hz` of `hz`, over the magnitude of the line itself.
    pub fn ratio_near(&self, hz: f64, half_width_hz: f64) -> Option<f64> {
        let near = self
            .hz_grid
            .iter()
            .zip(&self.magnitude)
            .filter(|(f, _)| (*f - hz).abs() <= half_width_hz);
        near.map(|(_, m)| m / self.magnitude[self.bin])
            .reduce(f64::max)
    }
}

/// What goes on through a hole is told by so much beside it (s): about two steps of a carrier.
const MEMORY_S: f64 = 1.0;
/// By no more samples.
const MEMORY: usize = 256;

/// A signal about its mean on an even axis, drawn through its holes.
pub(crate) fn whole(t_s: &[f64], x: &[f64]) -> Option<Even> {
    let mut even = about_mean(t_s, x)?;
    if !even.holes.is_empty() {
        fill(
            &mut even.x,
            &even.holes,
            memory(MEMORY_S, even.step_s, MEMORY),
        );
        let mean = even.x.iter().sum::<f64>() / even.x.len() as f64;
        even.x.iter_mut().for_each(|x| *x -= mean);
    }
    Some(even)
}

/// How far the strongest line of `x`, evenly spaced at `t_s`, is from the farthest one of at least half its power (Hz).
///
/// A line that phase noise has torn into several is where the strongest of them happens to be; in a window cut a little otherwise it is another.
/// 0 without a line.
pub fn rival_hz(t_s: &[f64], x: &[f64]) -> f64 {
    let Some(line) = Line::strongest(t_s, x) else {
        return 0.0;
    };
    let half_power = std::f64::consts::FRAC_1_SQRT_2 * line.magnitude[line.bin];
    let all = line.hz_grid.iter().zip(&line.magnitude);
    all.filter(|(_, m)| **m >= half_power)
        .map(|(f, _)| (f - line.hz).abs())
        .fold(0.0, f64::max)
}

/// What shares of a signal's power lie near f/2 and near f.
///
/// ```text
/// share(f₀) = Σ_{|f_k − f₀| ≤ 0.1 f} |X_k|² / Σ_{k ≥ 1} |X_k|²,   X = rfft(hann · (x − mean))
/// ```
/// The taper keeps a strong line from leaking into the other's band, where that is wider than the taper's own line, 2/T to either side: the window
/// has to hold T ≥ 20/f. Dimensionless, 0 … 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shares {
    /// Near f/2.
    pub at_half: f64,
    /// Near f.
    pub at_f: f64,
}

impl Shares {
    /// For a signal on an even time axis; `None` where it does not move, or for less than [`FEWEST_PERIODS`].
    pub fn of(t_s: &[f64], x: &[f64], f_hz: f64) -> Option<Self> {
        let Even { x, step_s, .. } = whole(t_s, x)?;
        if (x.len() as f64 + 0.5) * step_s * f_hz < FEWEST_PERIODS {
            return None;
        }
        let taper = Taper::Hann.values(x.len());
        let tapered: Vec<f64> = x.iter().zip(&taper).map(|(x, w)| x * w).collect();
        let power: Vec<f64> = rfft(&tapered).iter().map(|z| z.norm_sqr()).collect();
        let hz = rfft_hz(x.len(), step_s);
        let total: f64 = power[1..].iter().sum();
        let near = |f0: f64| {
            hz.iter()
                .zip(&power)
                .skip(1)
                .filter(|(f, _)| (*f - f0).abs() <= (1.0 + ROUNDING) * NEAR * f_hz)
                .map(|(_, p)| p)
                .sum::<f64>()
        };
        (total > 0.0).then(|| Shares {
            at_half: near(f_hz / 2.0) / total,
            at_f: near(f_hz) / total,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn series(f: impl Fn(f64) -> f64) -> [Vec<f64>; 2] {
        let t: Vec<f64> = (0..1350).map(|k| k as f64 / 30.0).collect();
        let x = t.iter().map(|t| f(*t)).collect();
        [t, x]
    }

    /// Of 90 periods in the window the bands' edges are bins 36, 54, 81 and 99: all four count.
    #[test]
    fn bins_on_the_edge_of_a_band_are_in_it() {
        let bin = |k: f64, t: f64| (TAU * k * t / 45.0).cos();
        let [t, x] = series(|t| bin(35.0, t) + bin(100.0, t));
        let outside = Shares::of(&t, &x, 2.0).unwrap();
        // The taper puts a quarter of a line's amplitude into each bin beside it: one of six parts of its power.
        for share in [outside.at_half, outside.at_f] {
            assert!((share - 1.0 / 12.0).abs() < 1e-6, "{outside:?}");
        }
        let [t, x] = series(|t| bin(54.0, t) + bin(81.0, t));
        let edges = Shares::of(&t, &x, 2.0).unwrap();
        for share in [edges.at_half, edges.at_f] {
            assert!((share - 5.0 / 12.0).abs() < 1e-6, "{edges:?}");
        }
    }

    #[test]
    fn two_sines_show_their_places_and_shares() {
        let [t, x] = series(|t| (TAU * 1.0 * t).sin() + 0.5 * (TAU * 2.0 * t).cos() + 7.0);
        let line = Line::strongest(&t, &x).unwrap();
        assert_eq!(line.hz, 1.0);
        assert!((line.ratio_near(2.0, 0.45).unwrap() - 0.5).abs() < 1e-12);
        let shares = Shares::of(&t, &x, 2.0).unwrap();
        assert!(
            (shares.at_half - 0.8).abs() < 1e-6 && (shares.at_f - 0.2).abs() < 1e-6,
            "{shares:?}"
        );
    }

    /// A step and its half, both of a slowly wandering phase, with few of their samples lost in rows. Zeros in holes of two make the ratio of the lines 57 %
    /// larger and that of the shares 75 % smaller.
    #[test]
    fn holes_leave_lines_as_they_are() {
        let wander = |t: f64| 0.6 * (0.37 * t).sin() + 0.4 * (0.23 * t + 1.0).cos();
        let [t, height] = series(|t| {
            let step = TAU * 2.15 * t + wander(t);
            step.sin() + 0.04 * (2.0 * step + 1.0).sin()
        });
        let [_, roll] =
            series(|t| (0.5 * (TAU * 2.15 * t + wander(t))).sin() + 0.02 * (TAU * 2.15 * t).sin());
        let read = |t: &[f64], height: &[f64], roll: &[f64]| {
            let line = Line::strongest(t, height).unwrap();
            let shares = Shares::of(t, roll, line.hz).unwrap();
            [
                line.hz,
                line.ratio_near(2.0 * line.hz, 0.45).unwrap(),
                shares.at_half / shares.at_f,
            ]
        };
        let truth = read(&t, &height, &roll);
        for row in [2, 5, 15] {
            let there = |k: &usize| (k + 37) % (30 * row) >= row;
            let pick =
                |x: &[f64]| -> Vec<f64> { (0..x.len()).filter(there).map(|k| x[k]).collect() };
            let found = read(&pick(&t), &pick(&height), &pick(&roll));
            for (a, b) in found.into_iter().zip(truth) {
                assert!((a / b - 1.0).abs() < 0.01, "{row}: {found:?} {truth:?}");
            }
        }
    }

    #[test]
    fn a_constant_has_no_line() {
        let [t, x] = series(|_| 0.807);
        assert!(Line::strongest(&t, &x).is_none());
    }
}

//! What drives the roll: the support that modulates the pendulum's gravity, or a force at the roll's own frequency.

use crate::line::FEWEST_PERIODS;
use crate::spline::derivatives;
use std::fmt;
use std::ops::Range;

/// RMS roll about its mean below which there is nothing to explain (deg).
pub const QUIET_DEG: f64 = 1.0;
/// The share of roll power that a line has to hold to be called the roll's line.
pub const LINE_SHARE: f64 = 0.5;
/// The R² from which a fit is called an explanation.
pub const EXPLAINS: f64 = 0.8;

/// A verdict on a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// RMS roll about its mean below 1°.
    Quiet,
    /// Roll at f/2, as a pendulum whose gravity the summed support modulates.
    Parametric,
    /// Roll at f: driven at its own frequency.
    Direct,
    /// Neither alone.
    Mixed,
}

impl Verdict {
    /// The word in every output.
    pub fn word(self) -> &'static str {
        match self {
            Verdict::Quiet => "quiet",
            Verdict::Parametric => "parametric",
            Verdict::Direct => "direct",
            Verdict::Mixed => "mixed",
        }
    }
}

/// The roll as a damped pendulum under the summed support, fitted by least squares.
///
/// ```text
/// θ̈ = −a·N_tot·sin θ − b·θ̇  (+ Σ c_i (N_i − N̄))
/// ```
/// θ roll (rad), N_tot summed normal force (N), or that on one kilogram of the load [m/s²], a [1/(kg·m)], or [1/m], b [1/s], N̄ the handles' mean force, c_i [1/(kg·m²)·m]. R² is that of the
/// part without brackets; `delta_n_gain` is by how much the bracket raises it: the strength of a drive by force differences (ΔN).
/// θ̇ and θ̈ are those of the cubic interpolant with not-a-knot ends, four samples left out at each end: on the
/// archive's music logs that gives a = 0.0479, b = 0.391, R² = 0.992. A line at ω is seen too large by (ωΔt)²/12 in θ̈ (0.4 % there).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RollFit {
    /// a [1/(kg·m)], or [1/m] where the support was given for one kilogram.
    pub a: f64,
    /// b [1/s].
    pub b_per_s: f64,
    /// R² of the pendulum alone.
    pub r2: f64,
    /// −a⟨(N_tot − N̄) sin θ·θ̇⟩/⟨θ̇²⟩, N̄ the mean [1/s]: what the support's modulation gives, as damping takes b. A roll that it keeps up has b, one that
    /// grows more; of one that dies away, or that something else keeps up, it is less.
    pub fed_per_s: f64,
    /// R² gained by the force differences; `None` with one handle.
    pub delta_n_gain: Option<f64>,
}

/// The evidence behind a verdict.
#[derive(Clone, Debug, PartialEq)]
pub struct Evidence {
    /// RMS roll about zero (rad).
    pub rms_roll_rad: f64,
    /// RMS roll about its mean (rad): a load that only leans has nothing that drives it.
    pub swing_rad: f64,
    /// The height's strongest line f (Hz).
    pub f_hz: Option<f64>,
    /// Share of roll power near f/2.
    pub share_at_half: Option<f64>,
    /// Share of roll power near f.
    pub share_at_f: Option<f64>,
    /// The fit, where there are forces.
    pub fit: Option<RollFit>,
    /// The forces are those on one kilogram of the load: the fit's a is in 1/m.
    pub per_mass: bool,
}

impl Evidence {
    /// The word for the evidence.
    ///
    /// ```text
    /// quiet        RMS roll about its mean < 1°
    /// parametric   share near f/2 ≥ 0.5, and, where there are forces, a > 0, R² ≥ 0.8 and fed ≥ b/2
    /// direct       share near f ≥ 0.5
    /// mixed        everything else
    /// ```
    /// Shoulders that sway at f/2, as the stride of people in step does, drive a roll that looks the same: roll and summed support of one line cannot tell
    /// a force from a modulation. A roll that grew from nothing can ([`crate::metrics()`], `growth_ratio`, `onset_time_s`).
    ///
    /// # Errors
    /// Without a line in the height there is no f to compare with: the reason is returned.
    pub fn verdict(&self) -> Result<Verdict, String> {
        if self.swing_rad.to_degrees() < QUIET_DEG {
            return Ok(Verdict::Quiet);
        }
        let (Some(half), Some(at_f)) = (self.share_at_half, self.share_at_f) else {
            return Err(match self.f_hz {
                None => "the height has no line in the window, so there is no drive frequency to compare the roll with".into(),
                Some(hz) => format!("the window is shorter than {FEWEST_PERIODS:.0} periods of {hz:.2} Hz, too short to tell a line at half of it from one at it"),
            });
        };
        let pendulum =
            (self.fit).is_none_or(|fit| fit.a > 0.0 && fit.r2 >= EXPLAINS && !fit.starves());
        Ok(match () {
            () if half >= LINE_SHARE && pendulum => Verdict::Parametric,
            () if at_f >= LINE_SHARE => Verdict::Direct,
            () => Verdict::Mixed,
        })
    }
}

impl fmt::Display for Evidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // No more digits than hold where noise is in it, which the metric of that name leaves out.
        write!(f, "RMS roll {:.1}°", self.rms_roll_rad.to_degrees())?;
        if self.verdict() == Ok(Verdict::Quiet) {
            let leans = self.rms_roll_rad.to_degrees() >= QUIET_DEG;
            let about = match leans {
                true => format!(", {:.1}° about its mean", self.swing_rad.to_degrees()),
                false => String::new(),
            };
            return write!(f, "{about}, below {QUIET_DEG}°: nothing to explain");
        }
        if let (Some(hz), Some(half), Some(at_f)) = (self.f_hz, self.share_at_half, self.share_at_f)
        {
            let percent = |x: f64| 100.0 * x;
            write!(
                f,
                "; {:.1} % of roll power at f/2 = {:.3} Hz, {:.1} % at f = {hz:.3} Hz",
                percent(half),
                hz / 2.0,
                percent(at_f)
            )?;
        }
        if let Some(fit) = &self.fit {
            let (support, unit) = match self.per_mass {
                true => ("N_tot/M", "1/m"),
                false => ("N_tot", "1/(kg·m)"),
            };
            write!(
                f,
                "; θ̈ = −a·{support}·sin θ − b·θ̇ with a = {:.5} {unit}, b = {:.3} 1/s, R² = {:.3}",
                fit.a, fit.b_per_s, fit.r2
            )?;
            if let Some(gain) = fit.delta_n_gain {
                write!(f, "; force differences (ΔN) add {gain:.4} to R²")?;
            }
            if fit.starves() {
                let fed = fit.fed_per_s;
                write!(
                    f,
                    "; the support's modulation gives it {fed:.3} 1/s, too little to keep it up"
                )?;
            }
        }
        if self.verdict() == Ok(Verdict::Parametric) {
            write!(
                f,
                "; shoulders that sway at f/2 would drive a roll that looks the same"
            )?;
        }
        Ok(())
    }
}

/// Less than this of what damping takes does not keep a roll up.
const KEEPS_UP: f64 = 0.5;

impl RollFit {
    /// Whether the support's modulation gives the roll too little to keep it up: it dies away, or something else does.
    pub fn starves(&self) -> bool {
        self.fed_per_s <= KEEPS_UP * self.b_per_s.max(0.0)
    }
}

/// Samples left out of the fit at each end, where the interpolant's derivatives are poor.
const EDGE: usize = 4;

/// Fits [`RollFit`] to roll and handle forces at `t_s`, without a hole in each of the `stretches`; where a force is not finite the sample is left
/// out. `None` without forces, below 20 samples, or where the roll does not move.
pub fn fit_roll(
    t_s: &[f64],
    roll_rad: &[f64],
    normal_n: &[Vec<f64>],
    stretches: &[Range<usize>],
) -> Option<RollFit> {
    let n = roll_rad.len();
    if n < 20 || normal_n.is_empty() || normal_n.iter().any(|h| h.len() != n) {
        return None;
    }
    let (mut rate, mut acceleration) = (vec![0.0; n], vec![0.0; n]);
    let mut rows: Vec<usize> = Vec::with_capacity(n);
    for stretch in stretches.iter().filter(|s| s.len() > 2 * EDGE) {
        let (first, second) = derivatives(&t_s[stretch.clone()], &roll_rad[stretch.clone()])?;
        rate[stretch.clone()].copy_from_slice(&first);
        acceleration[stretch.clone()].copy_from_slice(&second);
        let inner = stretch.start + EDGE..stretch.end - EDGE;
        rows.extend(inner.filter(|k| normal_n.iter().all(|h| h[*k].is_finite())));
    }
    if rows.len() + 2 * EDGE < 20 {
        return None;
    }
    let handles = normal_n.len();
    let total = |k: usize| normal_n.iter().map(|h| h[k]).sum::<f64>();
    // Columns: −N_tot sin θ, −θ̇, then N_i − N̄ for all handles but the last (they sum to zero).
    let row = |k: usize, out: &mut [f64]| {
        let total = total(k);
        out[0] = -total * roll_rad[k].sin();
        out[1] = -rate[k];
        for (o, h) in out[2..].iter_mut().zip(normal_n) {
            *o = h[k] - total / handles as f64;
        }
    };
    let plain = least_squares(&rows, 2, &acceleration, |k, out| row(k, out))?;
    // The mean support is a spring, which gives back what it takes.
    let usual = rows.iter().map(|k| total(*k)).sum::<f64>() / rows.len() as f64;
    let a = plain.x[0];
    let given = |k: &usize| -a * (total(*k) - usual) * roll_rad[*k].sin() * rate[*k];
    let squares: f64 = rows.iter().map(|k| rate[*k] * rate[*k]).sum();
    let fed_per_s = rows.iter().map(given).sum::<f64>() / squares;
    let delta_n_gain = (handles > 1)
        .then(|| least_squares(&rows, handles + 1, &acceleration, |k, out| row(k, out)))
        .flatten()
        .map(|full| (full.r2 - plain.r2).max(0.0));
    Some(RollFit {
        a,
        b_per_s: plain.x[1],
        r2: plain.r2,
        fed_per_s,
        delta_n_gain,
    })
}

struct Solution {
    x: Vec<f64>,
    r2: f64,
}

/// Least squares by the normal equations of scaled columns; `None` where they are singular or nothing is to be explained.
fn least_squares(
    rows: &[usize],
    columns: usize,
    y: &[f64],
    row: impl Fn(usize, &mut [f64]),
) -> Option<Solution> {
    let mut gram = vec![vec![0.0; columns + 1]; columns];
    let mut values = vec![0.0; columns];
    let (mut sum, mut squares) = (0.0, 0.0);
    for &k in rows {
        row(k, &mut values[..]);
        for i in 0..columns {
            for j in i..columns {
                gram[i][j] += values[i] * values[j];
            }
            gram[i][columns] += values[i] * y[k];
        }
        sum += y[k];
        squares += y[k] * y[k];
    }
    let scale: Vec<f64> = (0..columns).map(|i| gram[i][i].sqrt()).collect();
    if scale.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
        return None;
    }
    for i in 0..columns {
        for j in i..columns {
            gram[i][j] /= scale[i] * scale[j];
            gram[j][i] = gram[i][j];
        }
        gram[i][columns] /= scale[i];
    }
    let mut x = eliminate(gram)?;
    x.iter_mut().zip(&scale).for_each(|(x, s)| *x /= s);
    let mut residual = 0.0;
    for &k in rows {
        row(k, &mut values[..]);
        let fitted: f64 = values.iter().zip(&x).map(|(v, x)| v * x).sum();
        residual += (y[k] - fitted).powi(2);
    }
    let total = squares - sum * sum / rows.len() as f64;
    (total > 0.0).then(|| Solution {
        x,
        r2: 1.0 - residual / total,
    })
}

/// Gaussian elimination with partial pivoting of an augmented matrix; `None` where it is singular.
fn eliminate(mut m: Vec<Vec<f64>>) -> Option<Vec<f64>> {
    let n = m.len();
    for i in 0..n {
        let pivot = (i..n).max_by(|a, b| m[*a][i].abs().total_cmp(&m[*b][i].abs()))?;
        if m[pivot][i].abs() < 1e-12 {
            return None;
        }
        m.swap(i, pivot);
        for r in 0..n {
            if r != i {
                let factor = m[r][i] / m[i][i];
                let source = m[i].clone();
                m[r][i..]
                    .iter_mut()
                    .zip(&source[i..])
                    .for_each(|(a, b)| *a -= factor * b);
            }
        }
    }
    Some((0..n).map(|i| m[i][n] / m[i][i]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pendulum under a modulated support, integrated finely: the fit has to find its two constants.
    #[test]
    fn the_fit_finds_the_pendulum_it_was_given() {
        let (a, b, dt, fine) = (0.048, 0.4, 1.0 / 30.0, 200);
        let support = |t: f64| 590.0 * (1.0 + 0.4 * (std::f64::consts::TAU * 2.15 * t).sin());
        let (mut theta, mut omega, mut t) = (0.3, 0.0, 0.0);
        let (mut roll, mut force) = (Vec::new(), Vec::new());
        for _ in 0..1350 {
            roll.push(theta);
            force.push(support(t) / 2.0);
            for _ in 0..fine {
                let h = dt / fine as f64;
                // Midpoint rule: error of 1e-7 here.
                let rate = |t: f64, th: f64, om: f64| -a * support(t) * th.sin() - b * om;
                let (mt, mo) = (
                    theta + 0.5 * h * omega,
                    omega + 0.5 * h * rate(t, theta, omega),
                );
                theta += h * mo;
                omega += h * rate(t + 0.5 * h, mt, mo);
                t += h;
            }
        }
        // The same support on one kilogram of 60: a in 1/m is as many times larger. A hole is left out, and whatever stands in it.
        let per_mass: Vec<f64> = force.iter().map(|n| 2.0 * n / 60.0).collect();
        let parts = [0..600, 700..1350];
        let mut spliced = roll.clone();
        spliced[600..700].fill(0.0);
        let t_s: Vec<f64> = (0..roll.len()).map(|k| k as f64 * dt).collect();
        let split = fit_roll(&t_s, &spliced, &[per_mass], &parts).unwrap();
        let whole = [Range {
            start: 0,
            end: roll.len(),
        }];
        let fit = fit_roll(&t_s, &roll, &[force.clone(), force], &whole).unwrap();
        assert!(
            (split.a / (60.0 * fit.a) - 1.0).abs() < 1e-4 && split.r2 > 0.9999,
            "{split:?}"
        );
        // The interpolant's bias at the roll's own frequency, known in advance: + (ωΔt)²/12.
        let bias = (std::f64::consts::PI * 2.15 * dt).powi(2) / 12.0;
        assert!((fit.a / a - 1.0 - bias).abs() < 1e-3, "{fit:?}");
        assert!(
            (fit.b_per_s / b - 1.0).abs() < 0.01 && fit.r2 > 0.9999,
            "{fit:?}"
        );
    }

    /// A support that swings by `depth` at twice the pendulum's own pace, or a little beside it, feeds the roll; one that is steady does not.
    #[test]
    fn a_swing_that_dies_away_is_not_fed() {
        let [a, b, dt, weight] = [0.03, 0.06, 1e-3, 588.0];
        let own = (a * weight * 0.99_f64).sqrt();
        let run = |depth: f64| {
            let support = |t: f64| weight * (1.0 + depth * (2.0 * own * t).sin());
            let rate = |t: f64, [x, v]: [f64; 2]| [v, -a * support(t) * x.sin() - b * v];
            let (mut y, mut out) = ([0.14, 0.0], (Vec::new(), Vec::new(), Vec::new()));
            for k in 0..40_000 {
                let t = dt * f64::from(k);
                if k % 33 == 0 {
                    out.0.push(t);
                    out.1.push(y[0]);
                    out.2.push(support(t));
                }
                // Midpoint.
                let first = rate(t, y);
                let half = [0, 1].map(|i| y[i] + 0.5 * dt * first[i]);
                let middle = rate(t + 0.5 * dt, half);
                y = [0, 1].map(|i| y[i] + dt * middle[i]);
            }
            let all = 0..out.0.len();
            fit_roll(&out.0, &out.1, &[out.2], std::slice::from_ref(&all)).unwrap()
        };
        let dies = run(0.0);
        assert!(dies.starves() && dies.fed_per_s.abs() < 1e-9, "{dies:?}");
        assert!((dies.b_per_s / b - 1.0).abs() < 0.01 && dies.r2 > 0.999);
        // Its rate of growth, a N depth/(4 ω) − b/2, is a third of b/2 above and half of it below zero.
        let even = 2.0 * b * own / (a * weight);
        assert!(!run(4.0 / 3.0 * even).starves());
        let half = run(0.5 * even);
        let fed = half.fed_per_s / half.b_per_s;
        assert!((0.3..0.6).contains(&fed), "{fed}");
    }

    #[test]
    fn words_follow_the_evidence() {
        let fit = RollFit {
            a: 0.05,
            b_per_s: 0.4,
            r2: 0.99,
            fed_per_s: 0.4,
            delta_n_gain: Some(0.0),
        };
        let e = Evidence {
            rms_roll_rad: 0.3,
            swing_rad: 0.3,
            f_hz: Some(2.0),
            share_at_half: Some(0.9),
            share_at_f: Some(0.01),
            fit: Some(fit),
            per_mass: false,
        };
        assert_eq!(e.verdict(), Ok(Verdict::Parametric));
        // A load that leans by 17° and does not swing.
        let leans = Evidence {
            swing_rad: 0.01,
            ..e.clone()
        };
        assert_eq!(leans.verdict(), Ok(Verdict::Quiet));
        assert!(
            leans
                .to_string()
                .contains("RMS roll 17.2°, 0.6° about its mean, below 1°")
        );
        assert_eq!(
            Evidence {
                fit: Some(RollFit { r2: 0.3, ..fit }),
                ..e.clone()
            }
            .verdict(),
            Ok(Verdict::Mixed)
        );
        assert_eq!(
            Evidence {
                fit: Some(RollFit {
                    fed_per_s: 0.1,
                    ..fit
                }),
                ..e.clone()
            }
            .verdict(),
            Ok(Verdict::Mixed)
        );
        assert_eq!(
            Evidence {
                share_at_half: Some(0.1),
                share_at_f: Some(0.8),
                ..e.clone()
            }
            .verdict(),
            Ok(Verdict::Direct)
        );
        assert!(
            Evidence {
                f_hz: None,
                share_at_half: None,
                share_at_f: None,
                ..e
            }
            .verdict()
            .is_err()
        );
    }
}

//! What the body feels: stiffness and damping at the handles, and the pendulum of its roll.

use super::squares::{Block, bootstrapped, jackknifed, solve, unexplained, whoever_errs};
use super::{BLOCK_S, CARRIES, EDGE, Field, Outcome, budgeted, even, pair};
use analyze::imu::budget::Budget;
use analyze::inputs::{Inputs, Window, about_mean, between, drawn, mean_step_in, mean_step_s};
use analyze::mechanism::fit_roll;
use analyze::spectrum::{Options, welch};
use analyze::spline::spline_derivatives;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

/// Samples before and after one that a rule for its rate takes.
const REACH: usize = 2;
/// Compression that changes by less is none, m.
const STILL_M: f64 = 1e-6;
/// Share of the squared forces that a spring and a damper may leave: to noise of a tenth, and where another law would explain most of it.
const NOISE: f64 = 0.01;
const RIGHT: f64 = 1e-4;
/// Share of the roll's acceleration that may have another cause than a pendulum's.
const OTHER: f64 = 0.5;
/// A roll at whose line the load has this share of its own strongest line, in power, may be pushed by it. Ten thousandths and less where a load
/// makes a pendulum swing at half its frequency, one where it pushes.
const PUSHED: f64 = 0.05;
/// Share that counts of what leaving out every other sample changes, under a rule of the sixth order: three times the error, were there no other.
/// In quadrature beside chance it holds the level, whatever the error b: within √(1.96² + 9b²) of the truth are 95 % and more of what lies about it by b
/// with an SD of one. Source: Roache, J. Fluids Eng. 116 (1994) 405.
const SAMPLED: f64 = 3.0 / 63.0;
/// Periods of the roll in a window of the pendulum's fit, and windows that begin within the length of one.
const PERIODS: f64 = 4.0;
const SHIFTS: usize = 8;
/// By how much a and b scatter from run to run of `music` (SD, as a part of themselves) beside what one run shows: the carriers' own frequencies, and what a
/// pendulum with one damping leaves out, come back with every turn. Thirty seeds scatter by 3.0e-5 and 0.0021, and one shows 1.9e-5 and, at 100 Hz and more,
/// where sampling adds nothing, 0.0006: √(0.0019² − 0.0006²) is a hundredth of b.
const OF_ITSELF: [f64; 2] = [5e-4, 1e-2];
/// Length of a segment in which lines are looked for, s.
const LINE_S: f64 = 10.0;

/// Stiffness and damping where handles are in contact.
///
/// Where a handle opens or closes its force is continuous and has a kink. The load's acceleration has it too, the compression of all handles in the third
/// derivative, and there Lele's rules miss by h² where they miss by h⁶ elsewhere. A step of 2 Hz meets samples of 30 Hz at the same place for as long as it
/// lasts: what they miss is then the same through a run and other in the next, and no redrawing of one run's blocks shows it. So no rule may
/// span such an instant, whoever's it is. Handles are ends of one body, and a pole that is easy to pitch answers a jolt at one end at the other within a
/// sample (with mass m and inertia I by m_eff/c, 1/m_eff = 1/m + y²/I: 8 ms). What they miss at one time goes together, and a block holds all of them over
/// the same time: blocks have to be independent of each other, rows within one need not be. Source: Liang & Zeger, Biometrika 73 (1986) 13.
pub(super) fn contact(field: &Field) -> Result<Vec<Outcome>, String> {
    let i = &field.inputs;
    if field.compression_m.is_empty() || i.normal_n.len() != field.compression_m.len() {
        return Err("the compression of the handles is not recorded".into());
    }
    let parts = even(i.force_times());
    // Of the samples that follow each other: a lost one makes no step of theirs longer.
    let step_s = mean_step_in(i.force_times(), &parts).ok_or("no forces")?;
    // Of every `skip`-th sample: sums over blocks, all handles together.
    let sums = |skip: usize| {
        let step_s = step_s * skip as f64;
        let per_block = (BLOCK_S / step_s).round().max(1.0) as usize;
        let mut blocks: Vec<Block<2>> = Vec::new();
        // The same with a damper that grows with the compression.
        let mut bent: Vec<Block<3>> = Vec::new();
        for part in &parts {
            let thin = |x: &Vec<f64>| -> Vec<f64> {
                x[part.clone()].iter().step_by(skip).copied().collect()
            };
            let normal: Vec<Vec<f64>> = i.normal_n.iter().map(thin).collect();
            let gap: Vec<Vec<f64>> = field.compression_m.iter().map(thin).collect();
            // δδ̇ is the rate of δ²/2.
            let half_square =
                |d: &Vec<f64>| -> Vec<f64> { d.iter().map(|x| 0.5 * x * x).collect() };
            let half_squares: Vec<Vec<f64>> = gap.iter().map(half_square).collect();
            let mut begun = None;
            for k in REACH..part.len().div_ceil(skip).saturating_sub(REACH) {
                let stays = |n: &Vec<f64>| {
                    let mut rule = n[k - REACH..=k + REACH].iter();
                    rule.all(|x| (*x > 0.0) == (n[k] > 0.0))
                };
                if !normal.iter().all(stays) {
                    continue;
                }
                let handles = normal.iter().zip(&gap).zip(&half_squares);
                for ((n, d), squares) in handles.filter(|h| h.0.0[k] > 0.0) {
                    if begun.replace(k / per_block) != Some(k / per_block) {
                        blocks.push(Block::empty());
                        bent.push(Block::empty());
                    }
                    let (x, v) = (lele_mean(d, k), lele_slope(d, k, step_s));
                    let force = lele_mean(n, k);
                    if let (Some(block), Some(other)) = (blocks.last_mut(), bent.last_mut()) {
                        block.add([x, v], force);
                        other.add([x, v, lele_slope(squares, k, step_s)], force);
                    }
                }
            }
        }
        (blocks, bent)
    };
    let moved = field.compression_m.iter().flatten();
    let (least, most) = moved.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
        (a.min(*x), b.max(*x))
    });
    if !(most - least > STILL_M) {
        return Err("the load stands still".into());
    }
    let (blocks, bent) = sums(1);
    let value = solve(&blocks, |k| k)
        .ok_or("no contact is kept for five samples without one that opens or closes")?;
    let left = unexplained(&blocks).unwrap_or(1.0);
    let is_bent = unexplained(&bent).is_some_and(|l| l < 0.25 * left);
    if left > NOISE || (left > RIGHT && is_bent) {
        return Err(format!(
            "the handles do not push as one spring with one damper: {:.2} % of their force has another law",
            100.0 * left
        ));
    }
    let half = jackknifed(&blocks)
        .ok_or("contact is kept for too short a time to tell how sure they would be")?;
    let coarse = solve(&sums(2).0, |k| k).unwrap_or(value);
    let erring = whoever_errs(&blocks);
    let interval = std::array::from_fn(|p| {
        let half = half[p].hypot(SAMPLED * (coarse[p] - value[p]));
        let by_chance = [value[p] - half, value[p] + half];
        among(value[p], by_chance, erring.iter().flatten().map(|e| e[p]))
    });
    let value = [value[0], value[1]];
    Ok(spring_and_damper(value, interval))
}

/// A mean over three samples of what `lele_slope` is the rate of.
fn lele_mean(x: &[f64], k: usize) -> f64 {
    (x[k - 1] + 3.0 * x[k] + x[k + 1]) / 5.0
}

/// The mean of three rates, (ẋ_{k−1} + 3 ẋ_k + ẋ_{k+1})/5, to an error of (ωh)⁶/2100. Nothing is differentiated at a sample, where a gait that jitters has
/// one rate before and another after. Source: Lele, J. Comput. Phys. 103 (1992) 16, eq. 2.1.7.
fn lele_slope(x: &[f64], k: usize, step_s: f64) -> f64 {
    let (near, far) = (x[k + 1] - x[k - 1], x[k + 2] - x[k - 2]);
    (28.0 * near + far) / (60.0 * step_s)
}

/// Both, where the interval is not wider than the value.
fn spring_and_damper(value: [f64; 2], interval: [[f64; 2]; 2]) -> Vec<Outcome> {
    let names = [("stiffness", "N/m"), ("damping", "N·s/m")];
    let told = |found: Outcome| {
        let e = found?;
        let [low, high] = e.interval;
        match high - low < e.value.abs() {
            true => Ok(e),
            false => Err((
                e.name,
                format!(
                    "handles and shoulders hardly move apart: it may be anything from {low:.0} to {high:.0} {}",
                    e.unit
                ),
            )),
        }
    };
    pair(names, value, interval).into_iter().map(told).collect()
}

/// An interval about a value, stretched by how far other values lie beyond that one.
fn among(value: f64, [low, high]: [f64; 2], others: impl Iterator<Item = f64>) -> [f64; 2] {
    others.fold([low, high], |[a, b], x| {
        [a.min(low - (value - x)), b.max(high + (x - value))]
    })
}

/// Stiffness and damping from the body's specific force and everybody's heave, while all handles carry.
pub(super) fn contact_from_sensors(field: &Field, window: Window) -> Result<Vec<Outcome>, String> {
    let i = &field.inputs;
    let (n, mass_kg) = (
        i.heave_m.len(),
        i.mass_kg.ok_or("nobody says what the body weighs")?,
    );
    if field.handles_m.len() != n {
        return Err(format!(
            "{n} carriers wore a sensor, but the scene has {} handles",
            field.handles_m.len()
        ));
    }
    let weight_n = mass_kg * i.gravity_m_per_s2;
    // The middle, where everything is known; sensors have no holes after their clocks' grid.
    let known = |k: usize| {
        let at = |x: &[f64]| x.get(k).is_some_and(|x| x.is_finite());
        [&i.height_m, &i.roll_rad, &i.pitch_rad, &i.support_ratio]
            .iter()
            .all(|x| at(x))
            && i.heave_m.iter().all(|x| at(x))
    };
    let range = window.range(&i.t_s);
    let from = range
        .clone()
        .find(|k| known(*k))
        .ok_or("no samples in the window")?;
    let to = (from..range.end).find(|k| !known(*k)).unwrap_or(range.end);
    let step_s = mean_step_s(&i.t_s[from..to]).ok_or("no samples in the window")?;
    let found = |skip: usize| {
        let at: Vec<usize> = (from..to).step_by(skip).collect();
        let step_s = step_s * skip as f64;
        let axis: Vec<f64> = (0..at.len()).map(|k| k as f64 * step_s).collect();
        let mut gaps = Vec::new();
        for (heave, [x, y, z]) in i.heave_m.iter().zip(&field.handles_m) {
            let gap: Vec<f64> = at
                .iter()
                .map(|&k| {
                    let ((sr, cr), (sp, cp)) = (i.roll_rad[k].sin_cos(), i.pitch_rad[k].sin_cos());
                    heave[k] - i.height_m[k] - (cp * sr * y + cp * cr * z - sp * x)
                })
                .collect();
            let (rate, _) = spline_derivatives(&axis, &gap)?;
            gaps.push((gap, rate));
        }
        let total: Vec<f64> = at.iter().map(|&k| i.support_ratio[k] * weight_n).collect();
        let sum = |k: usize| -> [f64; 2] {
            let (gap, rate) = gaps
                .iter()
                .map(|(g, r)| (g[k], r[k]))
                .unzip::<_, _, Vec<f64>, Vec<f64>>();
            [gap.iter().sum(), rate.iter().sum()]
        };
        let per_block = (BLOCK_S / step_s).round().max(1.0) as usize;
        let stretches: Vec<Range<usize>> = (EDGE..at.len().saturating_sub(EDGE))
            .step_by(per_block)
            .map(|first| first..(first + per_block).min(at.len() - EDGE))
            .collect();
        // Each stretch about its own means: what drifts, and where the slow course of the heights is, drops out.
        let blocks = |carries: &dyn Fn(usize, usize) -> bool| {
            let of = |(b, stretch): (usize, &Range<usize>)| {
                let rows: Vec<usize> = stretch.clone().filter(|k| carries(b, *k)).collect();
                let count = rows.len().max(1) as f64;
                let mean =
                    |x: &dyn Fn(usize) -> f64| rows.iter().map(|k| x(*k)).sum::<f64>() / count;
                let means = [
                    mean(&|k| sum(k)[0]),
                    mean(&|k| sum(k)[1]),
                    mean(&|k| total[k]),
                ];
                let mut block = Block::<2>::empty();
                for k in rows {
                    let [gap, rate] = sum(k);
                    block.add([gap - means[0], rate - means[1]], total[k] - means[2]);
                }
                (block, means)
            };
            stretches
                .iter()
                .enumerate()
                .map(of)
                .unzip::<_, _, Vec<_>, Vec<_>>()
        };
        // First where the whole load is near the weight; then where every handle's share, as the fit sees it, is well above nothing.
        let (mut rows, mut means) = blocks(&|_, k| total[k] > 0.7 * weight_n);
        for _ in 0..12 {
            let p = solve(&rows, |k| k)?;
            let least = CARRIES * weight_n / n as f64;
            let offset: Vec<f64> = means
                .iter()
                .map(|[gap, rate, load]| (load - p[0] * gap - p[1] * rate) / n as f64)
                .collect();
            (rows, means) = blocks(&|b, k| {
                let share = |(gap, rate): &(Vec<f64>, Vec<f64>)| p[0] * gap[k] + p[1] * rate[k];
                means[b][2] > 0.0 && gaps.iter().all(|g| share(g) + offset[b] > least)
            });
        }
        let (value, interval) = bootstrapped(&rows, |p| [p[0], p[1]])?;
        Some((value, interval, whoever_errs(&rows)?))
    };
    let why = || "all handles never carry long enough".to_owned();
    let (value, interval, erring) = found(1).ok_or_else(why)?;
    let coarse = found(2).map_or(value, |(coarse, ..)| coarse);
    let budget = Budget::default();
    let scale = budget.height_scale.hypot(budget.support_scale);
    let interval = std::array::from_fn(|p| {
        let sampling = (coarse[p] - value[p]).abs();
        let [low, high] = among(value[p], interval[p], erring.iter().map(|e| e[p]));
        budgeted(value[p], [low - sampling, high + sampling], scale)
    });
    Ok(spring_and_damper(value, interval))
}

/// a and b of the roll's pendulum, as the roll's own line tells them.
///
/// The equation is projected onto swings of the line's frequency under a window of [`PERIODS`] of them, which vanishes at its ends with its derivatives, so
/// that both derivatives of the roll are taken of the window instead:
///
/// ```text
/// ∫ θ q̈ dt = −a ∫ N sin θ q dt + b ∫ θ q̇ dt,    q = (u (1 − u))⁴ cos(ωt + φ),  u from 0 to 1 through a window,  φ = 0 and π/2
/// ```
/// What the pendulum leaves out (friction, straps) makes harmonics, whose acceleration is large: by all lines alike a is 1.1 % lower in the archive's logs,
/// where the line alone leaves 0.02 % of its squares unexplained and all lines 0.4 %. Range: a part without a hole as long as a window. Source: Shinbrot, Trans. ASME 79
/// (1957) 547; Messenger & Bortz, Multiscale Model. Simul. 19 (2021) 1474.
pub(super) fn pendulum(field: &Field, window: Window) -> Result<Vec<Outcome>, String> {
    let (t_s, roll, total) = roll_and_load(&field.inputs)?;
    let range = window.range(&t_s);
    let t_s = &t_s[range.clone()];
    let parts = even(t_s);
    let step_s = mean_step_in(t_s, &parts).ok_or("no samples in the window")?;
    let (roll, total) = (&roll[range.clone()], &total[range]);
    if roll.iter().chain(total).any(|x| !x.is_finite()) {
        return Err("roll or forces have gaps".into());
    }
    let spectrum = |x: &[f64]| {
        let about = about_mean(t_s, x)?;
        let rate_hz = 1.0 / about.step_s;
        welch(&about.x, rate_hz, &Options::seconds(LINE_S, rate_hz)).ok()
    };
    let roll_hz = spectrum(roll).and_then(|roll| roll.peak_hz());
    let roll_hz = roll_hz
        .filter(|hz| *hz > 0.0)
        .ok_or("the roll does not move")?;
    // Of every `skip`-th sample of each part.
    let blocks = |skip: usize| {
        let step_s = step_s * skip as f64;
        let long = (PERIODS / roll_hz / step_s).ceil() as usize;
        let shift = long.div_ceil(SHIFTS);
        let swings = [0.0, FRAC_PI_2].map(|phase| -> Vec<[f64; 3]> {
            let at = |n| swing(n, long, step_s, TAU * roll_hz, phase);
            (0..=long).map(at).collect()
        });
        let mut blocks: Vec<Block<2>> = Vec::new();
        for part in &parts {
            let at: Vec<usize> = part.clone().step_by(skip).collect();
            for begin in (0..at.len().saturating_sub(long)).step_by(shift) {
                if begin % long < shift {
                    blocks.push(Block::empty());
                }
                let Some(block) = blocks.last_mut() else {
                    continue;
                };
                for swing in &swings {
                    let (mut x, mut y) = ([0.0; 2], 0.0);
                    for (&k, [q, rate, bend]) in at[begin..=begin + long].iter().zip(swing) {
                        x[0] -= total[k] * roll[k].sin() * q;
                        x[1] += roll[k] * rate;
                        y += roll[k] * bend;
                    }
                    block.add(x, y);
                }
            }
        }
        blocks
    };
    let fine = blocks(1);
    if fine.is_empty() {
        return Err("too few samples in the window".into());
    }
    let value = solve(&fine, |k| k).ok_or("the roll does not move")?;
    let half = jackknifed(&fine)
        .ok_or("the roll is recorded for too short a time to tell how sure they would be")?;
    let all_lines = fit_roll(t_s, roll, &[total.to_vec()], &parts);
    let other = 1.0 - all_lines.map_or(0.0, |fit| fit.r2);
    if other > OTHER {
        return Err(format!(
            "the roll does not swing as a pendulum: {:.0} % of its acceleration has another cause",
            100.0 * other
        ));
    }
    // Any roll that is pushed at one frequency is θ̈ ∝ −θ, and would pass for a pendulum of that frequency.
    if let Some(load) = spectrum(total) {
        let near = |hz: f64| (hz - roll_hz).abs() < 2.5 / LINE_S;
        let strongest = |near: &dyn Fn(f64) -> bool| {
            let lines = load.hz.iter().zip(&load.power);
            let lines = lines.filter(|(hz, _)| **hz > 0.5 / LINE_S && near(**hz));
            lines.map(|(_, power)| *power).fold(0.0, f64::max)
        };
        if strongest(&near) > PUSHED * strongest(&|_| true) {
            return Err(format!(
                "the roll swings with the load ({roll_hz:.2} Hz), and what is pushed at one frequency does not tell its own"
            ));
        }
    }
    if value[1] + half[1] < 0.0 {
        return Err(format!(
            "the roll does not swing as a pendulum: it gains energy from another cause (damping {:.2} 1/s)",
            value[1]
        ));
    }
    let coarse = solve(&blocks(2), |k| k).unwrap_or(value);
    // A support that a sensor felt has the sensor's scale, and a is per newton.
    let of_load = match field.inputs.total_force_n().is_empty() {
        true => Budget::default().support_scale,
        false => 0.0,
    };
    let of_itself = [OF_ITSELF[0].hypot(of_load), OF_ITSELF[1]];
    let interval = std::array::from_fn(|p| {
        let half = half[p] + SAMPLED * (coarse[p] - value[p]).abs();
        budgeted(value[p], [value[p] - half, value[p] + half], of_itself[p])
    });
    let names = [("pendulum", "1/(kg·m)"), ("roll damping", "1/s")];
    Ok(pair(names, [value[0], value[1]], interval))
}

/// Times (s), roll (rad) and the whole force (N) at them. Forces on a clock of their own keep it, for they have kinks; the roll, which has none, is drawn
/// between its samples by a cubic spline. So has a support that is older than the roll: 5 ms beside it made b of `field-imu` 0.35 and not 0.18. Where
/// the roll begins late, ends early or has holes it is NaN within, and left out at the ends.
fn roll_and_load(i: &Inputs) -> Result<(Vec<f64>, Vec<f64>, Vec<f64>), String> {
    let mut total = i.total_force_n();
    let mut at_s = i.force_times().to_vec();
    if let (true, Some(mass_kg)) = (total.is_empty(), i.mass_kg) {
        let weight_n = mass_kg * i.gravity_m_per_s2;
        total = i.support_ratio.iter().map(|s| s * weight_n).collect();
        at_s = i.t_s.iter().map(|t| t - i.support_age_s).collect();
    }
    if total.is_empty() || i.roll_rad.len() != i.t_s.len() || i.roll_rad.is_empty() {
        return Err("it takes the roll, and the forces or the support".into());
    }
    if at_s == i.t_s {
        return Ok((at_s, i.roll_rad.clone(), total));
    }
    let step_s = mean_step_s(&i.t_s).ok_or("the roll has too few samples")?;
    let mut roll = between(&i.t_s, &i.roll_rad, &at_s);
    let smooth = drawn(&i.t_s, &i.roll_rad, &at_s, step_s);
    for (x, smooth) in roll.iter_mut().zip(smooth).filter(|(x, _)| !x.is_nan()) {
        *x = smooth;
    }
    let known = |x: &f64| !x.is_nan();
    if i.normal_n.is_empty() {
        // The first sample behind a hole was felt within it.
        let known = |x: &[f64]| -> Vec<f64> {
            let pairs = x.iter().zip(&roll).filter(|(_, r)| !r.is_nan());
            pairs.map(|(x, _)| *x).collect()
        };
        return Ok((known(&at_s), known(&roll), known(&total)));
    }
    let begin = roll.iter().position(known).unwrap_or(0);
    let end = roll.iter().rposition(known).map_or(begin, |last| last + 1);
    let part = |x: &[f64]| x[begin..end].to_vec();
    Ok((part(&at_s), part(&roll), part(&total)))
}

/// A swing of ω [rad/s] at sample `n` of a window of `long` steps that takes it in and out, and its derivatives.
fn swing(n: usize, long: usize, step_s: f64, omega: f64, phase: f64) -> [f64; 3] {
    let length_s = long as f64 * step_s;
    let u = n as f64 / long as f64;
    // p = v⁴ with v = u − u², v' = 1 − 2u, v'' = −2, by the window's length.
    let (v, v1) = (u - u * u, (1.0 - 2.0 * u) / length_s);
    let (p, p1) = (v.powi(4), 4.0 * v.powi(3) * v1);
    let p2 = 12.0 * v * v * v1 * v1 - 8.0 * v.powi(3) / (length_s * length_s);
    let (sin, cos) = (omega * n as f64 * step_s + phase).sin_cos();
    [
        p * cos,
        p1 * cos - omega * p * sin,
        (p2 - omega * omega * p) * cos - 2.0 * omega * p1 * sin,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use analyze::Inputs;
    use nalgebra::{UnitQuaternion, Vector3};
    use std::f64::consts::TAU;

    /// What a rule of the sixth order has to be: exact for every power below the seventh, between any samples.
    #[test]
    fn leles_rule_is_exact_for_powers_below_the_seventh() {
        let step_s = 0.5;
        for power in 0..7 {
            let at = |k: usize| 0.3 + step_s * k as f64;
            let n = f64::from(power);
            let x: Vec<f64> = (0..5).map(|k| at(k).powi(power)).collect();
            let slope: Vec<f64> = (0..5).map(|k| n * at(k).powi(power - 1)).collect();
            let off = lele_slope(&x, 2, step_s) - lele_mean(&slope, 2);
            assert!(off.abs() < 1e-9, "{power}: slope off by {off}");
        }
        // A mean is of what it is a mean of.
        assert!((lele_mean(&[2.0; 5], 2) - 2.0).abs() < 1e-12);
    }

    /// Two who carry a body that heaves, rolls and pitches: what its handles do is turned by a rotation, what they push is k δ + c δ̇ of both, in closed
    /// form. Half of the time nothing is known, as of sensors with holes.
    #[test]
    fn sensors_that_do_not_err_give_the_springs_that_are_there() {
        let (k, c, mass_kg, g) = (3000.0, 400.0, 60.0, 9.81);
        let handles_m = vec![[1.2, 0.15, -0.25], [-1.1, -0.2, -0.3]];
        let wave = |a: f64, hz: f64, phase: f64| move |t: f64| a * (TAU * hz * t + phase).sin();
        let (height, roll, pitch) = (
            wave(0.02, 2.1, 0.3),
            wave(0.3, 1.05, 0.0),
            wave(0.04, 2.1, 1.0),
        );
        let heave = [wave(0.025, 2.1, 1.2), wave(0.02, 2.0, 2.9)];
        let lift = |t: f64, handle: &[f64; 3]| {
            let turned = UnitQuaternion::from_euler_angles(roll(t), pitch(t), 0.7);
            height(t) + (turned * Vector3::from(*handle)).z
        };
        let rate = |f: &dyn Fn(f64) -> f64, t: f64| (f(t + 1e-5) - f(t - 1e-5)) / 2e-5;
        let t_s: Vec<f64> = (0..2000).map(|k| 0.01 * f64::from(k)).collect();
        let support = |t: &f64| {
            let each = handles_m.iter().zip(&heave).map(|(handle, heave)| {
                let gap = |t: f64| heave(t) - lift(t, handle);
                k * gap(*t) + c * rate(&gap, *t)
            });
            1.0 + (each.sum::<f64>() - 2.0 * k * 0.275) / (mass_kg * g)
        };
        let of = |f: &dyn Fn(f64) -> f64| t_s.iter().map(|t| f(*t)).collect::<Vec<f64>>();
        let mut height_m = of(&height);
        height_m[..100].fill(f64::NAN);
        height_m[1900..].fill(f64::NAN);
        let field = Field {
            inputs: Inputs {
                height_m,
                roll_rad: of(&roll),
                pitch_rad: of(&pitch),
                support_ratio: t_s.iter().map(support).collect(),
                heave_m: heave.iter().map(|h| of(h)).collect(),
                mass_kg: Some(mass_kg),
                gravity_m_per_s2: g,
                t_s,
                ..Inputs::default()
            },
            handles_m,
            ..Field::default()
        };
        let found = contact_from_sensors(&field, Window::ALL).unwrap();
        for (e, truth) in found.iter().zip([k, c]) {
            let e = e.as_ref().unwrap();
            println!("{e:?}");
            assert!((e.value / truth - 1.0).abs() < 2e-3, "{e:?}");
            // What the sensors' scales leave, by which it may be off all the same: 1 % and 0.2 %.
            let half = 1.96 * 0.01f64.hypot(0.002) * truth;
            let [low, high] = e.interval;
            assert!((0.5 * (high - low) / half - 1.0).abs() < 0.05, "{e:?}");
        }
        let alone = Field {
            handles_m: vec![[0.0; 3]],
            ..field
        };
        let why = contact_from_sensors(&alone, Window::ALL).unwrap_err();
        assert!(
            why.contains("2 carriers wore a sensor") && why.contains("1 handles"),
            "{why}"
        );
    }
}

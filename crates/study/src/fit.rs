//! Parameters of the model from a recording, with intervals.
//!
//! ```text
//! beat, pull     φ̇_i = ω_i + K m(t) sin(Ωt + ψ₀ − φ_i) + noise,   m(t) = 1 − e^{−(t − t₀)/τ} from t₀ on
//! contact        N_i = k δ_i + c δ̇_i                               while contact is kept
//! pendulum       θ̈ = −a N_tot sin θ − b θ̇                          a = h/(I_xx + M h²) where the handles are held
//! ```
//! φ_i gait phases (rad), Ω = 2π·beat, ω_i own frequencies [rad/s], K pull of the music [rad/s]; t₀, τ its onset and build-up (s),
//! taken from a scene. Increments of φ carry white noise, so least squares (Gauss and Newton) gives the interval of Ω, K, ω_i
//! by itself; sines are the mean of both ends of an increment, an error of (1/12)(ω_i − Ω)²Δt² of K (10⁻⁴ at 30 Hz).
//! k, c, a, b: linear least squares on derivatives of the not-a-knot spline, their intervals from a moving-block bootstrap (500
//! draws, blocks of two roll periods), because neighbours are alike. Contact adds what k and c change by when every other
//! sample is left out: a bound, 15 times over, of what the sampling does. Source: Seber & Wild, Nonlinear Regression (1989);
//! Künsch, Ann. Stat. 17 (1989); docs/reproduction.md.

use analyze::inputs::{Inputs, Window, mean_step_s};
use analyze::mechanism::spline_derivatives;
use analyze::phase::unwrap;
use nalgebra::{DMatrix, DVector};
use sim::random::{Stream, uniform_pair};
use std::f64::consts::TAU;

/// What a fit is made from.
#[derive(Clone, Debug, Default)]
pub struct Field {
    /// Columns of the recording.
    pub inputs: Inputs,
    /// Compression of each handle's spring (m), on the forces' time; empty where nobody measured it.
    pub compression_m: Vec<Vec<f64>>,
    /// When the music begins, s.
    pub onset_s: f64,
    /// How long it builds up, s.
    pub build_up_s: f64,
}

/// A parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
    /// The estimate.
    pub value: f64,
    /// Ends of its 95 % interval.
    pub interval: [f64; 2],
}

/// A parameter, or what it is called and why there is none.
pub type Outcome = Result<Estimate, (String, String)>;

/// Bootstrap samples behind an interval.
const DRAWS: u64 = 500;
/// Length of a block of the bootstrap, s: two periods of the roll.
const BLOCK_S: f64 = 2.0;
/// Contact has to be kept at least so long, s.
const KEPT_S: f64 = 1.0;
/// Samples left out at each end of a stretch, where the spline's derivative is poor.
const EDGE: usize = 4;

/// Everything that the recording can tell. Pendulum over `window`, the rest over all of it.
pub fn fit(field: &Field, window: Window) -> Vec<Outcome> {
    let missing = |names: &[&str], why: String| -> Vec<Outcome> {
        names
            .iter()
            .map(|n| Err(((*n).to_owned(), why.clone())))
            .collect()
    };
    let mut out = gait(field).unwrap_or_else(|why| missing(&["beat", "pull"], why));
    out.extend(contact(field).unwrap_or_else(|why| missing(&["stiffness", "damping"], why)));
    out.extend(
        pendulum(field, window).unwrap_or_else(|why| missing(&["pendulum", "roll damping"], why)),
    );
    out
}

fn estimate(name: impl Into<String>, unit: &'static str, value: f64, half: f64) -> Outcome {
    Ok(Estimate {
        name: name.into(),
        unit,
        value,
        interval: [value - half, value + half],
    })
}

/// Beat, pull and the carriers' own frequencies.
fn gait(field: &Field) -> Result<Vec<Outcome>, String> {
    let i = &field.inputs;
    let t_s = i.phase_times();
    if i.phase_rad.is_empty() {
        return Err("no gait phases".into());
    }
    let from = t_s.partition_point(|t| *t < field.onset_s);
    if t_s.len() < from + 100 {
        return Err("too few phases after the onset of the music".into());
    }
    let t_s = &t_s[from..];
    let phases: Vec<Vec<f64>> = i.phase_rad.iter().map(|p| unwrap(&p[from..])).collect();
    if phases.iter().flatten().any(|p| !p.is_finite()) {
        return Err("phases have gaps".into());
    }
    let (n, carriers) = (t_s.len(), phases.len());
    let middle = 0.5 * (t_s[0] + t_s[n - 1]);
    let grown = |t: f64| match field.build_up_s {
        0.0 => 1.0,
        tau => 1.0 - (-(t - field.onset_s) / tau).exp(),
    };
    // In the last third the carriers follow the beat if they ever do: where the search begins.
    let third = 2 * n / 3;
    let span = t_s[n - 1] - t_s[third];
    let start = phases
        .iter()
        .map(|p| (p[n - 1] - p[third]) / span)
        .sum::<f64>()
        / carriers as f64;
    // Unknowns: A = K cos ψ, B = K sin ψ (ψ at the middle), Ω, ω_1 …
    let size = 3 + carriers;
    let normal = |omega: f64, a: f64, b: f64, own: &[f64]| {
        let mut gram = DMatrix::<f64>::zeros(size, size);
        let mut right = DVector::<f64>::zeros(size);
        let mut squares = 0.0;
        let mut row = DVector::<f64>::zeros(size);
        for (c, phase) in phases.iter().enumerate() {
            for k in 1..n {
                let dt = t_s[k] - t_s[k - 1];
                let (mut s, mut co, mut turn) = (0.0, 0.0, 0.0);
                for j in [k - 1, k] {
                    let x = omega * (t_s[j] - middle) - phase[j];
                    let (sin, cos) = x.sin_cos();
                    let m = 0.5 * grown(t_s[j]);
                    s += m * sin;
                    co += m * cos;
                    turn += m * (a * cos - b * sin) * (t_s[j] - middle);
                }
                row.fill(0.0);
                (row[0], row[1], row[2], row[3 + c]) = (s, co, turn, 1.0);
                let miss = (phase[k] - phase[k - 1]) / dt - own[c] - a * s - b * co;
                // Increments over dt have variance σ²/dt: weight dt, the same for an even clock.
                gram.ger(dt, &row, &row, 1.0);
                right.axpy(dt * miss, &row, 1.0);
                squares += dt * miss * miss;
            }
        }
        (gram, right, squares)
    };
    // Where in its turn the beat is, and how strong: a coarse look before the descent.
    let own0 = vec![start; carriers];
    let mut best = (f64::INFINITY, start, 0.0, 0.0, own0.clone());
    for step in -20..=20 {
        let omega = start + f64::from(step) * 0.25 / span;
        let (gram, right, _) = normal(omega, 0.0, 0.0, &own0);
        // Without Ω the problem is linear.
        let keep: Vec<usize> = (0..size).filter(|k| *k != 2).collect();
        let small = gram.select_rows(&keep).select_columns(&keep);
        let Some(x) = small.lu().solve(&right.select_rows(&keep)) else {
            continue;
        };
        let own: Vec<f64> = (0..carriers).map(|c| start + x[2 + c]).collect();
        let (_, _, squares) = normal(omega, x[0], x[1], &own);
        if squares < best.0 {
            best = (squares, omega, x[0], x[1], own);
        }
    }
    let (mut squares, mut omega, mut a, mut b, mut own) = best;
    for _ in 0..50 {
        let (gram, right, _) = normal(omega, a, b, &own);
        let step = gram
            .lu()
            .solve(&right)
            .ok_or("beat and gait cannot be told apart")?;
        // Half steps until it is better: far from the answer the beat's frequency overshoots.
        let mut part = 1.0;
        loop {
            let new_own: Vec<f64> = own
                .iter()
                .enumerate()
                .map(|(c, w)| w + part * step[3 + c])
                .collect();
            let new = (
                omega + part * step[2],
                a + part * step[0],
                b + part * step[1],
            );
            let found = normal(new.0, new.1, new.2, &new_own).2;
            if found <= squares || part < 1e-3 {
                (omega, a, b, own, squares) = (new.0, new.1, new.2, new_own, found);
                break;
            }
            part *= 0.5;
        }
        if step.norm() < 1e-10 {
            break;
        }
    }
    let (gram, _, squares) = normal(omega, a, b, &own);
    let variance = squares / ((n - 1) * carriers - size) as f64;
    let cover = gram
        .try_inverse()
        .ok_or("beat and gait cannot be told apart")?
        * variance;
    let half = |v: f64| 1.96 * v.max(0.0).sqrt();
    let pull = a.hypot(b);
    let (ca, cb) = (a / pull, b / pull);
    let pull_variance =
        ca * ca * cover[(0, 0)] + 2.0 * ca * cb * cover[(0, 1)] + cb * cb * cover[(1, 1)];
    let mut out = vec![
        estimate("beat", "Hz", omega / TAU, half(cover[(2, 2)]) / TAU),
        estimate("pull", "rad/s", pull, half(pull_variance)),
    ];
    for (c, w) in own.iter().enumerate() {
        let k = 3 + c;
        out.push(estimate(
            format!("gait {}", c + 1),
            "Hz",
            w / TAU,
            half(cover[(k, k)]) / TAU,
        ));
    }
    // The noise: its variance has itself a known spread.
    let sigma = variance.sqrt();
    let count = ((n - 1) * carriers - size) as f64;
    out.push(estimate(
        "phase noise",
        "rad/√s",
        sigma,
        1.96 * sigma / (2.0 * count).sqrt(),
    ));
    Ok(out)
}

/// Rows of a linear problem, y = x₀ p + x₁ q, block by block: sums of x₀², x₀x₁, x₁², x₀y, x₁y.
fn two(blocks: &[[f64; 5]], pick: impl Fn(usize) -> usize) -> Option<[f64; 2]> {
    let mut s = [0.0; 5];
    for k in 0..blocks.len() {
        let block = &blocks[pick(k)];
        s.iter_mut().zip(block).for_each(|(a, b)| *a += b);
    }
    let determinant = s[0] * s[2] - s[1] * s[1];
    (determinant > 1e-12 * s[0] * s[2]).then(|| {
        [
            (s[3] * s[2] - s[4] * s[1]) / determinant,
            (s[4] * s[0] - s[3] * s[1]) / determinant,
        ]
    })
}

fn add(block: &mut [f64; 5], x0: f64, x1: f64, y: f64) {
    let new = [x0 * x0, x0 * x1, x1 * x1, x0 * y, x1 * y];
    block.iter_mut().zip(new).for_each(|(a, b)| *a += b);
}

/// The two parameters with their intervals by the bootstrap.
fn bootstrapped(blocks: &[[f64; 5]]) -> Option<([f64; 2], [[f64; 2]; 2])> {
    let value = two(blocks, |k| k)?;
    let mut draws: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
    for draw in 0..DRAWS {
        let pick = |k: usize| {
            let [u, _] = uniform_pair(draw, Stream::Design, u32::MAX - 1, k as u64);
            ((1.0 - u) * blocks.len() as f64) as usize
        };
        if let Some(found) = two(blocks, pick) {
            draws.iter_mut().zip(found).for_each(|(d, x)| d.push(x));
        }
    }
    let interval = draws.map(|mut d| {
        d.sort_by(f64::total_cmp);
        [0.025, 0.975].map(|q| crate::sweep::summary::quantile(&d, q))
    });
    Some((value, interval))
}

/// Stiffness and damping where contact is kept for a second and longer.
fn contact(field: &Field) -> Result<Vec<Outcome>, String> {
    let i = &field.inputs;
    if field.compression_m.is_empty() || i.normal_n.len() != field.compression_m.len() {
        return Err("the compression of the handles is not recorded".into());
    }
    let step_s = mean_step_s(i.force_times()).ok_or("no forces")?;
    // Of every `skip`-th sample: sums over blocks, all handles together.
    let sums = |skip: usize| {
        let step_s = step_s * skip as f64;
        let least = (KEPT_S / step_s).ceil() as usize;
        let mut blocks: Vec<[f64; 5]> = Vec::new();
        for (normal, gap) in i.normal_n.iter().zip(&field.compression_m) {
            let n: Vec<f64> = normal.iter().step_by(skip).copied().collect();
            let d: Vec<f64> = gap.iter().step_by(skip).copied().collect();
            let mut from = 0;
            while from < n.len() {
                let length = n[from..].iter().take_while(|x| **x > 0.0).count();
                if length >= least.max(2 * EDGE + 2) {
                    if let Some((rate, _)) = spline_derivatives(&d[from..from + length], step_s) {
                        let mut block = [0.0; 5];
                        for k in EDGE..length - EDGE {
                            add(&mut block, d[from + k], rate[k], n[from + k]);
                        }
                        blocks.push(block);
                    }
                }
                from += length.max(1);
            }
        }
        blocks
    };
    let blocks = sums(1);
    let why = || "contact is never kept for a second".to_owned();
    let (value, interval) = bootstrapped(&blocks).ok_or_else(why)?;
    let coarse = two(&sums(2), |k| k).unwrap_or(value);
    let names = [("stiffness", "N/m"), ("damping", "N·s/m")];
    Ok((0..2)
        .map(|p| {
            let sampling = (coarse[p] - value[p]).abs();
            Ok(Estimate {
                name: names[p].0.into(),
                unit: names[p].1,
                value: value[p],
                interval: [interval[p][0] - sampling, interval[p][1] + sampling],
            })
        })
        .collect())
}

/// a and b of the roll's pendulum.
fn pendulum(field: &Field, window: Window) -> Result<Vec<Outcome>, String> {
    let i = &field.inputs;
    let range = window.range(&i.t_s);
    let total = i.total_force_n();
    if total.len() != i.t_s.len() || i.roll_rad.len() != i.t_s.len() {
        return Err("roll and forces are not recorded together".into());
    }
    let step_s = mean_step_s(&i.t_s[range.clone()]).ok_or("no samples in the window")?;
    let (roll, total) = (&i.roll_rad[range.clone()], &total[range]);
    if roll.iter().chain(total).any(|x| !x.is_finite()) {
        return Err("roll or forces have gaps".into());
    }
    let (rate, bend) = spline_derivatives(roll, step_s).ok_or("too few samples in the window")?;
    let per_block = (BLOCK_S / step_s).round().max(1.0) as usize;
    let mut blocks: Vec<[f64; 5]> = Vec::new();
    for k in EDGE..roll.len().saturating_sub(EDGE) {
        if (k - EDGE).is_multiple_of(per_block) {
            blocks.push([0.0; 5]);
        }
        if let Some(block) = blocks.last_mut() {
            add(block, -total[k] * roll[k].sin(), -rate[k], bend[k]);
        }
    }
    let (value, interval) = bootstrapped(&blocks).ok_or("the roll does not move")?;
    let names = [("pendulum", "1/(kg·m)"), ("roll damping", "1/s")];
    Ok((0..2)
        .map(|p| {
            Ok(Estimate {
                name: names[p].0.into(),
                unit: names[p].1,
                value: value[p],
                interval: interval[p],
            })
        })
        .collect())
}

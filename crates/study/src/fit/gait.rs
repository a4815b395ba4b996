//! What the carriers do: beat, pull, frequencies, amplitudes.

use super::squares::{Block, bootstrapped};
use super::{BLOCK_S, Estimate, Field, Outcome, budgeted, estimate};
use analyze::beat::adler::Adler;
use analyze::imu::interval::Budget;
use analyze::inputs::{Inputs, Window, interpolate, mean_step_s};
use analyze::phase::unwrap;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Beat, pull and the carriers' own frequencies.
pub(super) fn gait(field: &Field) -> Result<Vec<Outcome>, String> {
    let i = &field.inputs;
    let t_s = i.phase_times();
    if i.phase_rad.is_empty() {
        return Err("no gait phases".into());
    }
    let from = t_s.partition_point(|t| *t < field.onset_s);
    if t_s.len() < from + 100 {
        return Err("too few phases after the onset of the music".into());
    }
    if i.phases_are_measured {
        return gait_from_steps(i, from);
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
    let mean = phases
        .iter()
        .map(|p| (p[n - 1] - p[third]) / span)
        .sum::<f64>()
        / carriers as f64;
    // Unknowns: A = K cos ψ, B = K sin ψ (ψ at the middle), Ω, ω_1 …
    let size = 3 + carriers;
    let normal = |omega: f64, a: f64, b: f64, own: &[f64]| {
        let mut gram = DMatrix::<f64>::zeros(size, size);
        let mut right = DVector::<f64>::zeros(size);
        let (mut squares, mut kept) = (0.0, 0.0);
        let mut row = DVector::<f64>::zeros(size);
        for (c, phase) in phases.iter().enumerate() {
            for k in 1..n {
                let dt = t_s[k] - t_s[k - 1];
                let rate = (phase[k] - phase[k - 1]) / dt;
                let (mut s, mut co, mut turn, mut back) = (0.0, 0.0, 0.0, 0.0);
                // At the end of the increment the phase that is to be expected from its beginning. The one that was observed holds the
                // increment's own noise, which on both sides took half of a pull of 2.7 rad/s away at 0.3 rad/√s.
                let mut off = 0.0;
                for j in [k - 1, k] {
                    let x = omega * (t_s[j] - middle) - phase[j] + off;
                    let (sin, cos) = x.sin_cos();
                    let m = grown(t_s[j]);
                    s += 0.5 * m * sin;
                    co += 0.5 * m * cos;
                    let held = 0.5 * m * (a * cos - b * sin);
                    turn += held * (t_s[j] - middle);
                    back += held;
                    off = (rate - own[c] - m * (a * sin + b * cos)) * dt;
                }
                row.fill(0.0);
                (row[0], row[1], row[2], row[3 + c]) = (s, co, turn, 1.0);
                let miss = rate - own[c] - a * s - b * co;
                // Increments over dt have variance σ²/dt: weight dt, the same for an even clock.
                gram.ger(dt, &row, &row, 1.0);
                right.axpy(dt * miss, &row, 1.0);
                squares += dt * miss * miss;
                // Less what the pull takes back of the noise within dt.
                kept += (1.0 - back * dt).max(0.1);
            }
        }
        (gram, right, squares, kept)
    };
    // Where in its turn the beat is, and how strong: a coarse look before the descent.
    let own0 = vec![mean; carriers];
    let mut best = (f64::INFINITY, mean, 0.0, 0.0, own0.clone());
    for step in -20..=20 {
        let omega: f64 = mean + f64::from(step) * 0.25 / span;
        let (gram, right, ..) = normal(omega, 0.0, 0.0, &own0);
        // Without Ω the problem is linear.
        let keep: Vec<usize> = (0..size).filter(|k| *k != 2).collect();
        let small = gram.select_rows(&keep).select_columns(&keep);
        let Some(x) = small.lu().solve(&right.select_rows(&keep)) else {
            continue;
        };
        let own: Vec<f64> = (0..carriers).map(|c| mean + x[2 + c]).collect();
        let (_, _, squares, _) = normal(omega, x[0], x[1], &own);
        if squares < best.0 {
            best = (squares, omega, x[0], x[1], own);
        }
    }
    let (mut squares, mut omega, mut a, mut b, mut own) = best;
    for _ in 0..50 {
        let (gram, right, ..) = normal(omega, a, b, &own);
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
    let (gram, _, squares, kept) = normal(omega, a, b, &own);
    let variance = squares / ((n - 1) * carriers - size) as f64;
    let inverse = gram
        .try_inverse()
        .ok_or("beat and gait cannot be told apart")?;
    let cover = inverse * variance;
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
    let all = ((n - 1) * carriers) as f64;
    let sigma = (variance * all / kept).sqrt();
    let count = all - size as f64;
    out.push(estimate(
        "phase noise",
        "rad/√s",
        sigma,
        1.96 * sigma / (2.0 * count).sqrt(),
    ));
    Ok(out)
}

/// The same where steps tell the phases and a recorder or a topic the beats: Adler's test, which knows what a step detector does. What is walked
/// before the music is in it.
fn gait_from_steps(i: &Inputs, from: usize) -> Result<Vec<Outcome>, String> {
    // Before the first beat that was heard, in pauses and after the last, nobody knows its phase, nor how many beats a pause holds: the tempo is
    // that of the longest stretch without one.
    let times = i.phase_times().iter().skip(from).copied();
    let beats: Vec<(f64, f64)> = times
        .zip(i.beat_phase_rad.iter().skip(from).copied())
        .collect();
    let heard = beats
        .chunk_by(|a, b| a.1.is_finite() == b.1.is_finite())
        .filter(|stretch| stretch[0].1.is_finite())
        .max_by_key(|stretch| stretch.len())
        .filter(|stretch| stretch.len() >= 100)
        .ok_or("too few beats after the onset of the music")?;
    let (t_s, psi): (Vec<f64>, Vec<f64>) = heard.iter().copied().unzip();
    let (omega, half) = tempo(&t_s, &unwrap(&psi));
    let mut out = vec![estimate("beat", "Hz", omega / TAU, half / TAU)];
    match Adler::of(i) {
        Ok(found) => {
            let interval = found.pull_ci95_rad_per_s;
            out.push(match interval[1].is_finite() {
                true => Ok(Estimate {
                    name: "pull".into(),
                    unit: "rad/s",
                    value: found.pull_rad_per_s,
                    interval,
                }),
                false => Err((
                    "pull".into(),
                    format!(
                        "at least {:.2} rad/s: a stronger one would show the same steps",
                        interval[0]
                    ),
                )),
            });
            let halves = found.detuning_half_rad_per_s.iter();
            for (c, (off, half)) in found.detuning_rad_per_s.iter().zip(halves).enumerate() {
                let name = format!("gait {}", c + 1);
                out.push(match half.is_finite() {
                    true => estimate(name, "Hz", (found.beat_rad_per_s + off) / TAU, half / TAU),
                    false => Err((
                        name,
                        "who is with the beat all the time does not show it".into(),
                    )),
                });
            }
        }
        Err(why) => out.extend(["pull", "gait"].map(|name| Err((name.into(), why.into())))),
    }
    let why = "steps err by as much as carriers wander";
    out.push(Err(("phase noise".into(), why.into())));
    Ok(out)
}

/// Frequency of a beat that was heard, rad/s, and half of its 95 % interval: a straight line through its phase, every beat one
/// observation, and never surer than a clock's ppm.
fn tempo(t_s: &[f64], psi: &[f64]) -> (f64, f64) {
    let n = t_s.len() as f64;
    let (mt, mp) = (t_s.iter().sum::<f64>() / n, psi.iter().sum::<f64>() / n);
    let (mut tt, mut tp) = (0.0, 0.0);
    for (t, p) in t_s.iter().zip(psi) {
        tt += (t - mt) * (t - mt);
        tp += (t - mt) * (p - mp);
    }
    let omega = tp / tt;
    let miss = |(t, p): (&f64, &f64)| (p - mp - omega * (t - mt)).powi(2);
    let variance = t_s.iter().zip(psi).map(miss).sum::<f64>() / n;
    let beats = ((psi[psi.len() - 1] - psi[0]).abs() / TAU).max(1.0);
    let half = 1.96 * (variance / (tt / n) / beats).sqrt();
    (omega, half.max(1e-6 * omega.abs()))
}

/// How far the shoulders go up and down in step with the phases.
pub(super) fn amplitudes(field: &Field, window: Window) -> Result<Vec<Outcome>, String> {
    let i = &field.inputs;
    if i.heave_m.is_empty() || i.heave_m.len() != i.phase_rad.len() {
        return Err("the shoulders' heave is not recorded".into());
    }
    let range = window.range(&i.t_s);
    let t_s = &i.t_s[range.clone()];
    let step_s = mean_step_s(t_s).ok_or("no samples in the window")?;
    let per_block = (BLOCK_S / step_s).round().max(1.0) as usize;
    let phase_t = i.phase_times();
    let known = match (phase_t.first(), phase_t.last()) {
        (Some(a), Some(b)) => *a..=*b,
        _ => return Err("no gait phases".into()),
    };
    let each = i.heave_m.iter().zip(&i.phase_rad).enumerate();
    each.map(|(c, (heave, phase))| {
        let phase = interpolate(phase_t, &unwrap(phase), t_s);
        let mut blocks: Vec<Block<3>> = Vec::new();
        for (k, (z, phi)) in heave[range.clone()].iter().zip(&phase).enumerate() {
            if k.is_multiple_of(per_block) {
                blocks.push(Block::empty());
            }
            let told = z.is_finite() && phi.is_finite() && known.contains(&t_s[k]);
            if let (true, Some(block)) = (told, blocks.last_mut()) {
                block.add([phi.sin(), phi.cos(), 1.0], *z);
            }
        }
        let name = format!("amplitude {}", c + 1);
        let found = bootstrapped(&blocks, |p| [p[0].hypot(p[1])]);
        Ok(match found {
            Some(([value], [interval])) => Ok(Estimate {
                name,
                unit: "m",
                value,
                interval: budgeted(value, interval, Budget::default().height_scale),
            }),
            None => Err((name, "the shoulder does not move with the phase".to_owned())),
        })
    })
    .collect()
}

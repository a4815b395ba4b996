//! A motion as it might have come out of equally good sensors.

use super::angle::angle_scale;
use super::{COUNTED_S, WANDER_S};
use crate::imu::rath::Motion;
use crate::imu::track::period_s;
use crate::inputs::{Inputs, Window, between};
use crate::random::Random;
use std::ops::Range;

/// Seed of the draws: the same recording gives the same interval.
const SEED: u64 = 0x7261_7468;
/// What a bias walks in so long is in the budget's constant tilt, s.
const FIRST_S: f64 = 60.0;

/// The window's columns as they might have come out of an equally good sensor, at 30 Hz or its own rate.
pub fn varied(motion: &Motion, window: Window, draw: u64, tilt_rad: f64) -> Inputs {
    let budget = &motion.settings.budget;
    let seed = SEED ^ (draw.wrapping_add(1)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let [mut random, mut tilt, mut walk] = [seed, !seed, seed.rotate_left(32)].map(Random);
    let inputs = &motion.inputs;
    let range = window.range(&inputs.t_s);
    let Some(first) = inputs.t_s[range.clone()].first() else {
        return Inputs {
            gravity_m_per_s2: inputs.gravity_m_per_s2,
            ..Inputs::default()
        };
    };
    let step_s = period_s(&inputs.t_s).map_or(COUNTED_S, |s| s.max(COUNTED_S));
    let begin = first + random.uniform() * step_s;
    let at = |k: usize| (inputs.t_s[k] - begin) / step_s;
    // Every stretch to its end, and none of what lies between them.
    let within = |r: &Range<usize>| {
        let (from, to) = (r.start.max(range.start), r.end.min(range.end));
        let some = (from < to).then(|| (at(from).ceil() as i64)..=(at(to - 1).floor() as i64));
        some.into_iter().flatten()
    };
    let steps = motion.stretches.iter().flat_map(within);
    let t_s: Vec<f64> = steps.map(|k| begin + k as f64 * step_s).collect();
    let pick = |x: &[f64]| between(&inputs.t_s[range.clone()], &x[range.clone()], &t_s);
    let mut angle = |x: &[f64], random: &mut Random| -> Vec<f64> {
        let (offset, scale) = (
            budget.tilt_offset_rad * random.normal() + tilt_rad * tilt.normal(),
            1.0 + angle_scale(budget) * random.normal(),
        );
        let wander = random.wander(t_s.len(), step_s, budget.tilt_wander_rad, WANDER_S);
        let walk_rad = budget.tilt_walk_rad_per_sqrt_s;
        let walk = walked(&mut walk, t_s.len(), step_s, walk_rad);
        let errors = wander.iter().zip(walk).map(|(a, b)| offset + a + b);
        let x = pick(x).into_iter().zip(errors);
        x.map(|(x, error)| scale * x + error).collect()
    };
    let roll_rad = angle(&inputs.roll_rad, &mut random);
    let pitch_rad = angle(&inputs.pitch_rad, &mut random);
    let scale = 1.0 + budget.height_scale * random.normal();
    let wander = random.wander(t_s.len(), step_s, budget.height_wander_m, WANDER_S);
    let height_m = pick(&inputs.height_m)
        .iter()
        .zip(wander)
        .map(|(z, w)| scale * z + w)
        .collect();
    // A bias upwards is seen, but not whether it is one or a wrong scale.
    let off = motion.gravity_off_m_per_s2 / motion.settings.gravity_m_per_s2;
    let (offset, scale) = (
        budget.support_offset.hypot(off) * random.normal(),
        1.0 + budget.support_scale * random.normal(),
    );
    let support_ratio = pick(&inputs.support_ratio)
        .iter()
        .map(|s| scale * s + offset + budget.support_noise * random.normal())
        .collect();
    Inputs {
        t_s,
        height_m,
        roll_rad,
        pitch_rad,
        support_ratio,
        gravity_m_per_s2: inputs.gravity_m_per_s2,
        ..Inputs::default()
    }
}

/// What a bias that walks by so much in √s adds to an angle beyond the first minute, about its mean: the variance of T − 60 s, spread over T.
pub(super) fn walked(random: &mut Random, n: usize, step_s: f64, walk_per_sqrt_s: f64) -> Vec<f64> {
    let span_s = n as f64 * step_s;
    let beyond = 1.0 - FIRST_S / span_s;
    if !(beyond > 0.0) {
        return vec![0.0; n];
    }
    let kick = walk_per_sqrt_s * (beyond * step_s).sqrt();
    let mut x = 0.0;
    let mut out: Vec<f64> = (0..n)
        .map(|_| {
            x += kick * random.normal();
            x
        })
        .collect();
    let mean = out.iter().sum::<f64>() / n as f64;
    out.iter_mut().for_each(|x| *x -= mean);
    out
}

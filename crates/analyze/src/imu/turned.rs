//! Whether a sensor lies otherwise in its mounting from some moment on: gravity lies elsewhere in its own axes then, for good.

use super::track::period_s;
use nalgebra::{UnitQuaternion, Vector3};
use std::ops::Range;

/// Where up is averaged, s: for the moment of the change, for whether it is steady before and behind it, and at least on each side.
const BLOCK_S: f64 = 0.25;
const RUN_S: f64 = 5.0;
const SIDE_S: f64 = 10.0;
/// It turns within twice this, s.
const TURNING_S: f64 = 2.0;
/// A load is not carried as much otherwise from one step to the next.
const LEAST_DEG: f64 = 10.0;
/// Each run lies so near to its side's mean, at most, and as a part of the change: a sway of 25° each way at 1 Hz leaves 1° of mean in a run. What sways slowly, climbs
/// and comes back, or tumbles, is not steady, and nothing is said of it.
const STEADY_DEG: f64 = 3.0;
const STEADY: f64 = 1.0 / 3.0;
/// The mean upward direction of a side is at least so long, 1.
const ONE_WAY: f64 = 0.5;

/// A sensor that turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turned {
    /// When, s.
    pub t_s: f64,
    /// By how much gravity lies elsewhere, deg.
    pub deg: f64,
}

impl Turned {
    /// One line for people.
    pub fn told(&self) -> String {
        format!(
            "from {:.0} s on gravity lies {:.0}° elsewhere in the sensor than before: it slipped or was turned in its mounting, or the load has leaned so much otherwise since; what rests on its motion has no interval",
            self.t_s, self.deg
        )
    }
}

/// The one lasting change of where up is, if there is one, from the orientation of the sensor or of what is taken to be fixed to it.
pub fn turned(t_s: &[f64], earth_from: &[UnitQuaternion<f64>]) -> Option<Turned> {
    let block = ((BLOCK_S / period_s(t_s)?).round() as usize).max(1);
    let [run, side, turning] = [RUN_S, SIDE_S, TURNING_S].map(|s| (s / BLOCK_S) as usize);
    // Sums from the beginning, so that any mean is one difference.
    let mut sums = vec![Vector3::zeros()];
    for some in earth_from.chunks_exact(block) {
        let up = some.iter().map(|q| q.inverse() * Vector3::z());
        sums.push(sums[sums.len() - 1] + up.sum::<Vector3<f64>>() / block as f64);
    }
    let n = sums.len() - 1;
    let mean = |r: &Range<usize>| (sums[r.end] - sums[r.start]) / r.len() as f64;
    // Where the means before and behind part most, by their number: the likeliest moment of a step in noise.
    let parts = |b: &usize| {
        let apart = mean(&(0..*b)) - mean(&(*b..n));
        apart.norm_squared() * (b * (n - b)) as f64
    };
    let all = side..(n + 1).saturating_sub(side);
    let at = all.max_by(|a, b| parts(a).total_cmp(&parts(b)))?;
    let sides = [0..at - turning, at + turning..n];
    let [before, behind] = sides.each_ref().map(mean);
    let deg = before.angle(&behind).to_degrees();
    let within_deg = STEADY_DEG.max(STEADY * deg);
    let steady = |side: &Range<usize>| {
        let whole = mean(side);
        let begins = (side.start..side.end - run)
            .step_by(run)
            .chain([side.end - run]);
        let mut runs = begins.map(|k| mean(&(k..k + run)));
        whole.norm() > ONE_WAY && runs.all(|up| up.angle(&whole).to_degrees() < within_deg)
    };
    (deg > LEAST_DEG && sides.iter().all(steady)).then(|| Turned {
        t_s: t_s[at * block],
        deg,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// A minute at 100 Hz of a roll and a pitch, deg.
    fn found(roll: impl Fn(f64) -> f64, pitch: impl Fn(f64) -> f64) -> Option<Turned> {
        let t_s: Vec<f64> = (0..6000).map(|k| 0.01 * f64::from(k)).collect();
        let at = |t: &f64| {
            let [roll, pitch] = [roll(*t), pitch(*t)].map(f64::to_radians);
            UnitQuaternion::from_euler_angles(roll, pitch, 0.3 * t)
        };
        let earth_from: Vec<_> = t_s.iter().map(at).collect();
        turned(&t_s, &earth_from)
    }

    #[test]
    fn a_sensor_that_slips_is_found_with_its_moment_and_angle() {
        let sway = |t: f64| 24.0 * (TAU * 1.07 * t).sin();
        for (by_deg, within_s) in [(12.0, 0.5), (25.0, 0.5), (90.0, 3.0), (180.0, 1.0)] {
            for at_s in [15.0, 37.0, 48.0] {
                let slip = |t: f64| by_deg * ((t - at_s) / within_s).clamp(0.0, 1.0);
                let seen = found(|t| sway(t) + slip(t), |_| 0.0).unwrap();
                let middle_s = at_s + 0.5 * within_s;
                assert!(
                    (seen.t_s - middle_s).abs() < 1.0,
                    "{by_deg} {at_s}: {seen:?}"
                );
                assert!((seen.deg - by_deg).abs() < 1.5, "{by_deg} {at_s}: {seen:?}");
                assert!(found(sway, slip).is_some(), "{by_deg}");
            }
        }
    }

    /// A strong sway, one that begins, one that is slow, a slope that comes to an end, a lean of 8°, and a slip with no time left to see it.
    #[test]
    fn a_load_that_sways_or_climbs_has_not_slipped() {
        let sway = |t: f64| 24.0 * (TAU * 1.07 * t).sin();
        let on = |from: f64, to: f64| move |t: f64| f64::from(u8::from((from..to).contains(&t)));
        let still = |_: f64| 0.0;
        assert_eq!(found(sway, still), None);
        assert_eq!(found(|t| sway(t) * on(30.0, 99.0)(t), still), None);
        for hz in [0.02, 0.05, 0.1, 0.2] {
            assert_eq!(found(|t| 24.0 * (TAU * hz * t).sin(), still), None, "{hz}");
        }
        assert_eq!(found(sway, |t| 20.0 * on(20.0, 40.0)(t)), None);
        assert_eq!(found(sway, |t| 8.0 * on(30.0, 99.0)(t)), None);
        assert_eq!(found(sway, |t| 25.0 * on(56.0, 99.0)(t)), None);
        let short: Vec<f64> = (0..1500).map(|k| 0.01 * f64::from(k)).collect();
        assert_eq!(
            turned(&short, &vec![UnitQuaternion::identity(); 1500]),
            None
        );
        assert_eq!(turned(&[], &[]), None);
    }
}

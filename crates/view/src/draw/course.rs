//! Which way the party walks and at what height, without the sway of each step: figures and camera go by it.

use crate::take::Pose;

/// Half the time that a heading is averaged over, s: several steps.
const HEADING_S: f64 = 1.0;
/// Half the time that a level is averaged over, s: a step takes about all of it, what falls freely leaves it by a tenth of a metre.
const LEVEL_S: f64 = 0.25;
/// Heights that differ by no more than this share one level, m.
const LEVEL_M: f64 = 2.0;
/// Who is slower stands, m/s.
const WALKS_M_PER_S: f64 = 0.2;
/// Below this share of its length the averaged axis of the body points nowhere.
const SURE: f64 = 0.3;

/// Direction of the body's x axis over the ground at every moment, rad; the last one known while the body does not stand upright.
pub fn headings(pose: &Pose) -> Vec<f64> {
    let (x, y): (Vec<f64>, Vec<f64>) = (0..pose.orientation.len())
        .map(|k| {
            let upright = pose.in_world(k, &[0.0, 0.0, 1.0])[2].max(0.0);
            let ahead = pose.in_world(k, &[1.0, 0.0, 0.0]);
            (upright * ahead[0], upright * ahead[1])
        })
        .unzip();
    let mean = |x: &[f64]| mean_around(&pose.times_ns, x, HEADING_S);
    let mut heading_rad = 0.0;
    mean(&x)
        .into_iter()
        .zip(mean(&y))
        .map(|(x, y)| {
            if x.hypot(y) > SURE {
                heading_rad = y.atan2(x);
            }
            heading_rad
        })
        .collect()
}

/// Direction in which the party walks over the ground at every moment, rad; where it stands, that of the body.
pub fn ways(pose: &Pose, headings: &[f64]) -> Vec<f64> {
    let n = pose.position_m.len().min(pose.times_ns.len());
    let smooth = |axis: usize| {
        let x: Vec<f64> = pose.position_m.iter().map(|p| p[axis]).collect();
        mean_around(&pose.times_ns, &x, HEADING_S)
    };
    let (x, y) = (smooth(0), smooth(1));
    let reach = reach(&pose.times_ns, HEADING_S);
    let way = |(k, heading): (usize, &f64)| {
        let (from, to) = (k.saturating_sub(reach), k.saturating_add(reach).min(n - 1));
        let span_s = pose.times_ns[to].saturating_sub(pose.times_ns[from]) as f64 / 1e9;
        let (dx, dy) = (x[to] - x[from], y[to] - y[from]);
        if dx.hypot(dy) > WALKS_M_PER_S * span_s {
            dy.atan2(dx)
        } else {
            *heading
        }
    };
    headings[..n].iter().enumerate().map(way).collect()
}

/// The one height of a body that stays about it; `None` where it climbs or falls.
pub fn level_m(pose: &Pose) -> Option<f64> {
    let heights = || {
        pose.position_m
            .iter()
            .map(|p| p[2])
            .filter(|z| z.is_finite())
    };
    let low = heights().fold(f64::INFINITY, f64::min);
    let high = heights().fold(f64::NEG_INFINITY, f64::max);
    let mean = heights().sum::<f64>() / heights().count().max(1) as f64;
    (high - low <= LEVEL_M).then_some(mean)
}

/// The height at every moment without that of each step, m.
pub fn levels_m(pose: &Pose) -> Vec<f64> {
    if let Some(level_m) = level_m(pose) {
        return vec![level_m; pose.times_ns.len()];
    }
    let heights: Vec<f64> = pose.position_m.iter().map(|p| p[2]).collect();
    mean_around(&pose.times_ns, &heights, LEVEL_S)
}

/// How many samples `half_s` is, at the mean rate.
fn reach(times_ns: &[i64], half_s: f64) -> usize {
    let (Some(first), Some(last)) = (times_ns.first(), times_ns.last()) else {
        return 0;
    };
    let steps = times_ns.len().saturating_sub(1).max(1);
    let step_s = last.saturating_sub(*first) as f64 / 1e9 / steps as f64;
    (half_s / step_s) as usize
}

/// Mean of as many values before as after each, within `half_s`, so that what grows evenly stays as it is up to both ends.
fn mean_around(times_ns: &[i64], x: &[f64], half_s: f64) -> Vec<f64> {
    let n = times_ns.len().min(x.len());
    let most = reach(times_ns, half_s);
    let mut sums = vec![(0.0, 0usize)];
    for x in &x[..n] {
        let (sum, count) = sums[sums.len() - 1];
        sums.push(if x.is_finite() {
            (sum + x, count + 1)
        } else {
            (sum, count)
        });
    }
    (0..n)
        .map(|k| {
            let reach = most.min(k).min(n - 1 - k);
            let (from, to) = (sums[k - reach], sums[k + reach + 1]);
            (to.0 - from.0) / (to.1 - from.1) as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One minute at 30 Hz: yaw and height are functions of time.
    fn pose(yaw_rad: impl Fn(f64) -> f64, height_m: impl Fn(f64) -> f64) -> Pose {
        let mut pose = Pose::default();
        for k in 0..1800 {
            let t_s = f64::from(k) / 30.0;
            let (sin, cos) = (0.5 * yaw_rad(t_s)).sin_cos();
            pose.times_ns.push((t_s * 1e9).round() as i64);
            pose.position_m.push([t_s, 0.0, height_m(t_s)]);
            pose.orientation.push([0.0, 0.0, sin, cos]);
        }
        pose
    }

    #[test]
    fn a_heading_turns_with_the_path_and_not_with_the_steps() {
        let turn = |t_s: f64| (0.1 * (t_s - 10.0)).clamp(0.0, 4.0);
        let sway = |t_s: f64| 0.015 * (std::f64::consts::TAU * 1.8 * t_s).sin();
        let pose = pose(|t_s| turn(t_s) + sway(t_s), |_| 0.8);
        let headings = headings(&pose);
        for (k, heading) in headings.iter().enumerate().take(1770).skip(30) {
            let off = analyze::phase::wrap(heading - turn(k as f64 / 30.0));
            // A corner of the path is rounded by less than two degrees.
            assert!(off.abs() < 0.03, "{k}: {off}");
        }
        assert!(headings[30..240].iter().all(|h| h.abs() < 0.002));
    }

    #[test]
    fn a_body_upside_down_has_no_heading() {
        let mut pose = pose(|_| 0.5, |_| 0.8);
        // Half a turn about its own y axis.
        for q in &mut pose.orientation[900..] {
            *q = [-q[2], q[3], 0.0, 0.0];
        }
        assert!(headings(&pose).iter().all(|h| (h - 0.5).abs() < 1e-9));
    }

    #[test]
    fn a_level_stays_until_the_body_leaves_it() {
        let steps = |t_s: f64| 0.8 + 0.08 * (std::f64::consts::TAU * 1.8 * t_s).sin();
        let walking = levels_m(&pose(|_| 0.0, steps));
        assert!(walking.iter().all(|z| (z - 0.8).abs() < 1e-3));
        let falling = pose(|_| 0.0, |t_s| 2e4 - 4.9 * t_s * t_s);
        for (level, p) in levels_m(&falling).iter().zip(&falling.position_m) {
            assert!((level - p[2]).abs() < 0.15, "{level} {}", p[2]);
        }
    }

    #[test]
    fn who_walks_sideways_faces_where_he_goes_and_who_stands_faces_ahead() {
        // Along y for half a minute, to and fro across it with every step; then it stands, the pole along x all the while.
        let mut pose = pose(|_| 0.0, |_| 0.8);
        for (p, t_ns) in pose.position_m.iter_mut().zip(&pose.times_ns) {
            let t_s = *t_ns as f64 / 1e9;
            let sway_m = 0.03 * (std::f64::consts::TAU * t_s).sin();
            *p = [sway_m, 0.8 * t_s.min(30.0), 0.8];
        }
        let ways = ways(&pose, &headings(&pose));
        for (k, way) in ways.iter().enumerate() {
            let expected = match k {
                0..850 => std::f64::consts::FRAC_PI_2,
                950.. => 0.0,
                _ => continue,
            };
            assert!((way - expected).abs() < 0.08, "{k}: {way}");
        }
    }
}

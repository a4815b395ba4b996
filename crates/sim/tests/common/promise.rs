//! What a tolerance promises: over a whole run, roll and height err by at most ten of it, relative to the motion's own size.

use sim::run::Sample;

/// Below this a motion is rest, and errors are absolute: the units of `Freedoms::scales`, m and rad.
const REST: f64 = 0.1;

/// Roll, rad, and height, m.
pub fn look(sample: &Sample) -> [f64; 2] {
    let roll_rad = sample.pose.roll_pitch_yaw_rad()[0];
    [roll_rad, sample.pose.position_m[2]]
}

/// Largest difference of roll and of height at any sample, in parts of half the truth's range. A motion that is hardly one is held absolutely.
pub fn errors(seen: &[[f64; 2]], truth: &[[f64; 2]]) -> [f64; 2] {
    assert_eq!(seen.len(), truth.len());
    [0, 1].map(|a| {
        let values = truth.iter().map(|x| x[a]);
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
        let size = if high - low < 1e-3 {
            REST
        } else {
            0.5 * (high - low)
        };
        let differences = seen.iter().zip(truth).map(|(x, y)| (x[a] - y[a]).abs());
        differences.fold(0.0, f64::max) / size
    })
}

//! Time per sample of the two estimates of orientation, on ten minutes of a rath that rocks.
//!
//! ```text
//! cargo bench -p analyze --bench orientation
//! ```
//! The median of nine runs, and the error of inclination against the motion that the samples were made from.

use std::f64::consts::TAU;
use std::time::Instant;

use analyze::imu::Track;
use analyze::imu::orientation::{Causal, Options, batch};
use nalgebra::{UnitQuaternion, Vector3};

const RATE_HZ: f64 = 200.0;
const SAMPLES: usize = 120_000;

/// Roll at half the beat, pitch at the beat: the attitude at a moment.
fn attitude(t_s: f64) -> UnitQuaternion<f64> {
    let roll = 0.3 * (TAU * 1.075 * t_s).sin();
    let pitch = 0.05 * (TAU * 2.15 * t_s).sin();
    UnitQuaternion::from_euler_angles(roll, pitch, 0.0)
}

/// What a sensor without noise or delay feels, with a walk's heave.
fn track() -> Track {
    let step_s = 1e-4;
    let t_s: Vec<f64> = (0..SAMPLES).map(|k| k as f64 / RATE_HZ).collect();
    let turn = |t: &f64| {
        let (before, after) = (attitude(t - step_s), attitude(t + step_s));
        ((before.inverse() * after).scaled_axis() / (2.0 * step_s)).into()
    };
    let force = |t: &f64| {
        let up = Vector3::z() * (9.81 + 3.0 * (TAU * 2.15 * t).sin());
        (attitude(*t).inverse() * up).into()
    };
    Track {
        gyro_rad_per_s: t_s.iter().map(turn).collect(),
        accel_m_per_s2: t_s.iter().map(force).collect(),
        t_s,
        dropped: 0,
    }
}

/// Root mean square of the angle between both verticals behind the first ten seconds, degrees.
fn error_deg(track: &Track, seen: &[UnitQuaternion<f64>]) -> f64 {
    let from = (10.0 * RATE_HZ) as usize;
    let up = |q: &UnitQuaternion<f64>| q.inverse() * Vector3::z();
    let squares: f64 = (from..SAMPLES)
        .map(|k| up(&seen[k]).angle(&up(&attitude(track.t_s[k]))).powi(2))
        .sum();
    (squares / (SAMPLES - from) as f64).sqrt().to_degrees()
}

/// Prints the time and holds the answer against the truth.
fn report(name: &str, track: &Track, run: impl Fn() -> Vec<UnitQuaternion<f64>>) {
    let mut took_ns: Vec<f64> = Vec::new();
    let mut seen = Vec::new();
    for _ in 0..9 {
        let start = Instant::now();
        seen = run();
        took_ns.push(start.elapsed().as_secs_f64() * 1e9 / SAMPLES as f64);
    }
    took_ns.sort_by(f64::total_cmp);
    let error = error_deg(track, &seen);
    assert!(error < 0.2, "{name} is {error} degrees off");
    println!(
        "{name:<7} {:5.0} ns per sample ({:.0} to {:.0}), inclination {error:.3} degrees off",
        took_ns[4], took_ns[0], took_ns[8]
    );
}

fn main() {
    let track = track();
    let options = Options::without_latency();
    report("causal", &track, || {
        let mut filter = Causal::new(1.0 / RATE_HZ, options);
        let samples = track.gyro_rad_per_s.iter().zip(&track.accel_m_per_s2);
        samples
            .map(|(gyro, accel)| filter.update(1.0 / RATE_HZ, *gyro, *accel))
            .collect()
    });
    report("batch", &track, || batch(&track, options).earth_from_sensor);
}

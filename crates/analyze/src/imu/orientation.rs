//! Orientation of a sensor from its gyroscope and accelerometer alone (6D: no magnetometer, heading is free).
//!
//! Two estimates: [`causal`] uses the past only (the filter VQF), [`batch`] the whole recording.
//!
//! ```text
//! q(t)  = q_acc(t) ⊗ q_gyr(t)                sensor → earth, z up
//! q_gyr = Π exp(½ (ω − b) Δt)                strap-down integration into an almost inertial frame
//! q_acc : takes LP{ q_gyr a q_gyr* } to the vertical, by the shortest turn
//! ```
//! ω gyroscope [rad/s], b its bias [rad/s], a specific force [m/s²], LP a second-order low-pass with time constant τ (s). In the
//! inertial frame gravity stands still while motion averages out, so τ of some seconds keeps both sides honest.
//!
//! Batch: the bias is smoothed over time (a filter forward, one backward over the reversed samples with −ω, joined by
//! their covariances) and LP runs forward and backward, so it has no lag.
//!
//! Holds while the mean acceleration over some τ is small against g. Source: D. Laidig, T. Seel, "VQF: Highly accurate
//! IMU orientation estimation with bias estimation and magnetic disturbance rejection", Information Fusion 91 (2023).

use super::Track;
use crate::filter::{Band, butter, sosfilt, sosfilt_zi};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use std::f64::consts::{PI, SQRT_2};

/// Delay of a MEMS sensor whose own low-pass has its corner near 90 Hz, the usual setting in wearables, s.
///
/// MPU-6500 and MPU-9250 register maps, gyroscope bandwidth 92 Hz: delay 3.9 ms.
pub const MEMS_LATENCY_S: f64 = 0.0039;

/// The same of its accelerometer, s: MPU-6500 and MPU-9250, bandwidth 99 Hz: delay 2.88 ms.
pub const MEMS_ACCEL_LATENCY_S: f64 = 0.00288;

/// Accelerometer samples are averaged, in the inertial frame, down to about this rate before they correct the tilt, Hz.
/// The correction works on seconds; doing it 50 times a second costs a fraction and changes nothing.
const CORRECTION_HZ: f64 = 50.0;

/// A hole longer than this ends one filter run and begins the next, s: no gyroscope tells what happened inside.
const LONGEST_HOLE_S: f64 = 1.0;

/// Settings of both estimators.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Time constant τ of the accelerometer's low-pass, s.
    pub tau_s: f64,
    /// How old a sample is at its time stamp (the sensor's own low-pass, its queue), s. The estimate is carried forward by it.
    /// 0: the stamp is the instant at which the value was true, as in a simulated sensor.
    pub latency_s: f64,
    /// The same of the accelerometer, s. A force is turned to earth by the orientation of its own instant; what τ averages does not need it.
    pub accel_latency_s: f64,
}

impl Default for Options {
    /// τ = 3 s, the published setting; [`MEMS_LATENCY_S`] and [`MEMS_ACCEL_LATENCY_S`].
    fn default() -> Self {
        Self {
            tau_s: 3.0,
            latency_s: MEMS_LATENCY_S,
            accel_latency_s: MEMS_ACCEL_LATENCY_S,
        }
    }
}

impl Options {
    /// For samples that are true at their time stamps.
    pub fn without_latency() -> Self {
        Self {
            latency_s: 0.0,
            accel_latency_s: 0.0,
            ..Self::default()
        }
    }
}

/// An orientation for every sample, and what was learnt about the gyroscope.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Sensor → earth, z up; the heading is arbitrary and drifts slowly.
    pub earth_from_sensor: Vec<UnitQuaternion<f64>>,
    /// Gyroscope bias, rad/s.
    pub bias_rad_per_s: Vec<[f64; 3]>,
    /// One standard deviation of the bias, rad/s.
    pub bias_sigma_rad_per_s: Vec<f64>,
}

/// The causal estimator, one sample at a time.
///
/// ```no_run
/// use analyze::imu::orientation::{Causal, Options};
/// let mut filter = Causal::new(0.01, Options::without_latency());
/// let mut q = nalgebra::UnitQuaternion::identity();
/// for _ in 0..100 {
///     q = filter.update(0.01, [0.0; 3], [0.0, 9.81, 0.0]); // y points up
/// }
/// let up = q * nalgebra::Vector3::y(); // points along the earth's z
/// ```
pub struct Causal {
    filter: vqf_rs::VQF,
    period_s: f64,
    block: u32,
    sum: [f64; 3],
    summed: u32,
    started: bool,
    options: Options,
}

impl Causal {
    /// A filter for samples that come every `period_s` (> 0).
    pub fn new(period_s: f64, options: Options) -> Self {
        let block = (1.0 / (CORRECTION_HZ * period_s)).floor().clamp(1.0, 1e6);
        let params = vqf_rs::Params {
            tau_acc: options.tau_s,
            ..Default::default()
        };
        Self {
            filter: vqf_rs::VQF::new(period_s, Some(period_s * block), None, Some(params)),
            period_s,
            block: block as u32,
            sum: [0.0; 3],
            summed: 0,
            started: false,
            options,
        }
    }

    /// Takes one sample, `dt_s` after the last one, and returns sensor → earth at its time stamp.
    pub fn update(&mut self, dt_s: f64, gyro: [f64; 3], accel: [f64; 3]) -> UnitQuaternion<f64> {
        self.filter.update_gyr_with_ts(gyro, dt_s);
        let inertial = self.filter.quat_3d();
        for (sum, a) in self.sum.iter_mut().zip(inertial.rotate(accel)) {
            *sum += a;
        }
        self.summed += 1;
        // The first sample sets the tilt at once; after it a full block speaks.
        if self.summed == self.block || !self.started {
            let mean = self.sum.map(|s| s / f64::from(self.summed));
            let sensor = vqf_rs::Quaternion(inertial.0, -inertial.1, -inertial.2, -inertial.3);
            self.filter.update_acc(sensor.rotate(mean));
            self.sum = [0.0; 3];
            self.summed = 0;
            self.started = true;
        }
        let vqf_rs::Quaternion(w, x, y, z) = self.filter.quat_6d();
        let q = Quaternion::new(w, x, y, z);
        // The filter lets a sample stand for the step that ends at it: on average half a step ahead of the sample.
        let ahead_s = self.options.latency_s - 0.5 * self.period_s;
        let bias = self.filter.state().bias;
        let turn = Vector3::from(gyro) - Vector3::from(bias);
        let half = turn * (0.5 * ahead_s);
        // Second order in a turn of about a degree: the error stays below 1e-6 rad.
        let step = Quaternion::from_parts(1.0 - 0.5 * half.norm_squared(), half);
        UnitQuaternion::new_unchecked((q * step) * renormalise(q, step))
    }

    /// Gyroscope bias, rad/s, and its standard deviation.
    pub fn bias(&self) -> ([f64; 3], f64) {
        self.filter.bias_estimate()
    }
}

/// 1/|q s| to first order around one: both are units up to rounding and the step's third order.
fn renormalise(q: Quaternion<f64>, s: Quaternion<f64>) -> f64 {
    1.0 / (q.norm_squared() * s.norm_squared()).sqrt()
}

/// Orientation from the past alone: what a display beside the load could show while they walk.
///
/// An empty track gives an empty estimate. After a hole of more than a second the filter starts anew, keeping the bias.
pub fn causal(track: &Track, options: Options) -> Estimate {
    run(track, options, false).0
}

/// One pass of the filter, forward or backward; also the bias covariance's inverse per sample, s²/rad².
fn run(track: &Track, options: Options, backward: bool) -> (Estimate, Vec<Matrix3<f64>>) {
    let n = track.len();
    let period_s = track.period_s().unwrap_or(0.01);
    let mut out = Estimate {
        earth_from_sensor: Vec::with_capacity(n),
        bias_rad_per_s: Vec::with_capacity(n),
        bias_sigma_rad_per_s: Vec::with_capacity(n),
    };
    let mut information = Vec::with_capacity(n);
    let mut filter = Causal::new(period_s, options);
    for k in 0..n {
        let i = if backward { n - 1 - k } else { k };
        let dt_s = if k == 0 {
            period_s
        } else if backward {
            track.t_s[i + 1] - track.t_s[i]
        } else {
            track.t_s[i] - track.t_s[i - 1]
        };
        if dt_s > LONGEST_HOLE_S {
            let (bias, sigma) = filter.bias();
            filter = Causal::new(period_s, options);
            filter.filter.set_bias_estimate(bias, Some(sigma));
        }
        let g = track.gyro_rad_per_s[i];
        let g = if backward { g.map(|x| -x) } else { g };
        let dt_s = dt_s.min(LONGEST_HOLE_S);
        let q = filter.update(dt_s, g, track.accel_m_per_s2[i]);
        let (bias, sigma) = filter.bias();
        out.earth_from_sensor.push(q);
        out.bias_rad_per_s.push(bias);
        out.bias_sigma_rad_per_s.push(sigma);
        // The filter's covariance is in (0.01 °/s)².
        let p = filter.filter.state().bias_p.0;
        let unit = (PI / 180.0 / 100.0).powi(2);
        let p = Matrix3::from_fn(|r, c| p[r][c]) * unit;
        information.push(p.try_inverse().unwrap_or_else(Matrix3::zeros));
    }
    (out, information)
}

/// Orientation from the whole recording.
///
/// An empty track gives an empty estimate. Nothing is carried over a hole but what was learnt of the bias: each stretch between holes has a
/// tilt and a heading of its own.
pub fn batch(track: &Track, options: Options) -> Estimate {
    let n = track.len();
    let Some(period_s) = track.period_s() else {
        return causal(track, options);
    };
    let (mut out, forward) = run(track, options, false);
    let (mut back, mut backward) = run(track, options, true);
    back.bias_rad_per_s.reverse();
    backward.reverse();
    for i in 0..n {
        // Joined by information; the backward pass saw −ω, so its bias has the other sign.
        let joined = forward[i] + backward[i];
        let b = forward[i] * Vector3::from(out.bias_rad_per_s[i])
            - backward[i] * Vector3::from(back.bias_rad_per_s[i]);
        if let Some(p) = joined.try_inverse() {
            out.bias_rad_per_s[i] = (p * b).into();
            out.bias_sigma_rad_per_s[i] = p
                .diagonal()
                .max()
                .max(0.0)
                .sqrt()
                .min(out.bias_sigma_rad_per_s[i]);
        }
    }

    for stretch in track.stretches() {
        let part = track.part(stretch.clone());
        let bias = &out.bias_rad_per_s[stretch.clone()];
        let tilted = tilted(&part, bias, period_s, options);
        out.earth_from_sensor[stretch].copy_from_slice(&tilted);
    }
    out
}

/// Orientation over one stretch, by its own gravity.
fn tilted(
    track: &Track,
    bias: &[[f64; 3]],
    period_s: f64,
    options: Options,
) -> Vec<UnitQuaternion<f64>> {
    let n = track.len();
    let inertial = integrate(track, bias);
    let mut gravity: [Vec<f64>; 3] = std::array::from_fn(|_| Vec::with_capacity(n));
    for (q, a) in inertial.iter().zip(&track.accel_m_per_s2) {
        let g = q * Vector3::from(*a);
        for (axis, value) in gravity.iter_mut().zip(g.iter()) {
            axis.push(*value);
        }
    }
    for axis in &mut gravity {
        smooth(axis, period_s, options.tau_s);
    }

    let mut tilt = UnitQuaternion::identity();
    let oriented = |i: usize| {
        let g = tilt * Vector3::new(gravity[0][i], gravity[1][i], gravity[2][i]);
        // No direction, no correction: a free fall as long as τ.
        if let Some(turn) = UnitQuaternion::rotation_between(&g, &Vector3::z()) {
            tilt = turn * tilt;
            tilt.renormalize_fast();
        }
        // Integrated by the trapezium, so the stamp is the sample's own instant; the latency remains.
        let rate = Vector3::from(track.gyro_rad_per_s[i]) - Vector3::from(bias[i]);
        let ahead = UnitQuaternion::from_scaled_axis(rate * options.latency_s);
        tilt * inertial[i] * ahead
    };
    (0..n).map(oriented).collect()
}

/// Strap-down integration from identity, with the mean of two neighbouring rates over each step.
fn integrate(track: &Track, bias: &[[f64; 3]]) -> Vec<UnitQuaternion<f64>> {
    let rate = |i: usize| Vector3::from(track.gyro_rad_per_s[i]) - Vector3::from(bias[i]);
    let mut q = UnitQuaternion::identity();
    let mut out = Vec::with_capacity(track.len());
    for i in 0..track.len() {
        if i > 0 {
            let dt_s = track.t_s[i] - track.t_s[i - 1];
            let (a, b) = (rate(i - 1), rate(i));
            // Trapezium, and the turn of the axis inside the step (coning, second order).
            let turn = (a + b) * (0.5 * dt_s) + a.cross(&b) * (dt_s * dt_s / 12.0);
            q *= UnitQuaternion::from_scaled_axis(turn);
            q.renormalize_fast();
        }
        out.push(q);
    }
    out
}

/// Second-order Butterworth low-pass with time constant `tau_s`, forward and backward, in place.
///
/// Corner √2/(2πτ) (Hz), the damped part of the step response then decays with τ. The first pass begins as if
/// the mean of the first τ seconds had always been there, the second as if its first value had.
fn smooth(x: &mut [f64], period_s: f64, tau_s: f64) {
    let rate_hz = 1.0 / period_s;
    let corner_hz = SQRT_2 / (2.0 * PI * tau_s);
    let Ok(sections) = butter(2, Band::Low(corner_hz), rate_hz) else {
        return; // τ shorter than two samples: nothing to smooth.
    };
    let zi = sosfilt_zi(&sections);
    let head = ((tau_s * rate_hz) as usize).clamp(1, x.len());
    let mut before = x[..head].iter().sum::<f64>() / head as f64;
    for _ in 0..2 {
        let mut state: Vec<[f64; 2]> = zi.iter().map(|z| z.map(|v| v * before)).collect();
        sosfilt(&sections, x, &mut state);
        x.reverse();
        before = x[0];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imu::truth::{Truth, inclination_error_deg};
    use std::f64::consts::TAU;

    const RATE_HZ: f64 = 200.0;

    fn attitude(t: f64) -> UnitQuaternion<f64> {
        let swing = |amplitude: f64, hz: f64, phase: f64| amplitude * (TAU * hz * t + phase).sin();
        UnitQuaternion::from_euler_angles(
            swing(0.4, 1.1, 0.0),
            swing(0.3, 0.7, 1.0),
            swing(1.5, 0.11, 2.0),
        )
    }

    /// A minute of a sensor that turns about its own place, `[gyroscope, accelerometer]` so old at their stamps (s), the gyroscope biased.
    fn turning(age_s: [f64; 2], bias: [f64; 3]) -> (Track, Truth) {
        let (mut track, mut truth) = (Track::default(), Truth::default());
        let h = 1e-4;
        for t in (0..(60.0 * RATE_HZ) as u32).map(|k| f64::from(k) / RATE_HZ) {
            let then = t - age_s[0];
            let turn = attitude(then - h).inverse() * attitude(then + h);
            let rate = turn.scaled_axis() / (2.0 * h) + Vector3::from(bias);
            let felt = attitude(t - age_s[1]).inverse() * Vector3::new(0.0, 0.0, 9.81);
            track.t_s.push(t);
            track.gyro_rad_per_s.push(rate.into());
            track.accel_m_per_s2.push(felt.into());
            truth.t_s.push(t);
            truth.world_from_body.push(attitude(t));
        }
        (track, truth)
    }

    /// What moves by 23° at 1.1 Hz is 0.7° off where 6 ms are left out.
    #[test]
    fn samples_that_are_old_at_their_stamps_are_carried_forward() {
        for age_s in [[0.0, 0.0], [0.006, 0.006], [0.006, 0.001]] {
            let (track, truth) = turning(age_s, [0.0; 3]);
            let options = Options {
                latency_s: age_s[0],
                accel_latency_s: age_s[1],
                ..Options::default()
            };
            for (of, within_deg) in [
                (batch as fn(&Track, Options) -> Estimate, 0.05),
                (causal, 0.1),
            ] {
                let found = of(&track, options).earth_from_sensor;
                let off = inclination_error_deg(&track.t_s, &found, &truth, &[(20.0, 50.0)]);
                assert!(off.unwrap() < within_deg, "{age_s:?}: {off:?}");
            }
        }
    }

    /// A bias is found as well as is said, and in hindsight more surely than at the time. What is left of it tilts the estimate by half a degree, all of it
    /// by more than one.
    #[test]
    fn a_bias_is_within_what_is_said_of_it() {
        let bias = Vector3::new(0.01, -0.02, 0.005);
        let (track, truth) = turning([0.0; 2], bias.into());
        let [whole, live] = [batch, causal].map(|of| of(&track, Options::without_latency()));
        for of in [&whole, &live] {
            let found = &of.earth_from_sensor;
            let off = inclination_error_deg(&track.t_s, found, &truth, &[(30.0, 50.0)]);
            assert!(off.unwrap() < 0.95, "{off:?}");
        }
        let found = &whole.earth_from_sensor;
        let off = inclination_error_deg(&track.t_s, found, &truth, &[(20.0, 50.0)]).unwrap();
        assert!(off < 0.5, "{off}");
        for k in [3000, 6000, 9000] {
            let sigma = [&whole, &live].map(|e| e.bias_sigma_rad_per_s[k]);
            assert!(0.0 < sigma[0] && sigma[0] < sigma[1], "{sigma:?}");
            for (of, sigma) in [&whole, &live].into_iter().zip(sigma) {
                let off = Vector3::from(of.bias_rad_per_s[k]) - bias;
                assert!(off.amax() < 3.0 * sigma, "{off} {sigma}");
            }
        }
    }

    /// A sensor turned in its case shows the same body.
    #[test]
    fn how_a_sensor_sits_does_not_matter() {
        let (track, _) = turning([0.0, 0.0], [0.01, -0.02, 0.005]);
        let case = UnitQuaternion::from_euler_angles(2.1, -0.7, 0.4);
        let options = Options::without_latency();
        let turned = track.rotated(&case);
        for (of, within) in [
            (batch as fn(&Track, Options) -> Estimate, 1e-3),
            (causal, 1e-3),
        ] {
            let (here, there) = (of(&track, options), of(&turned, options));
            for k in (2000..12_000).step_by(100) {
                let up = here.earth_from_sensor[k].inverse() * Vector3::z();
                let up_there = there.earth_from_sensor[k].inverse() * Vector3::z();
                let off = (case * up).angle(&up_there);
                assert!(off < within, "{k}: {off}");
            }
        }
    }

    /// Rates that change evenly from x to y: in one step of 0.4 s as in four thousand. Without the turn of the axis within the step it is 13 mrad off.
    #[test]
    fn an_axis_that_turns_within_a_step_turns_the_body_with_it() {
        let rate = |t: f64| Vector3::new(1.0 - t / 0.4, t / 0.4, 0.0);
        let mut track = Track::default();
        for t in [0.0, 0.4] {
            track.t_s.push(t);
            track.gyro_rad_per_s.push(rate(t).into());
            track.accel_m_per_s2.push([0.0; 3]);
        }
        let found = integrate(&track, &[[0.0; 3]; 2]);
        let small = (0..4000)
            .map(|k| UnitQuaternion::from_scaled_axis(rate(1e-4 * (f64::from(k) + 0.5)) * 1e-4));
        let known = small.fold(UnitQuaternion::identity(), |q, turn| q * turn);
        let off = found[1].angle_to(&known);
        assert!(off < 1e-3, "{off}");
    }
}

//! A virtual inertial measurement unit: what a gyroscope and an accelerometer at a place would show.
//!
//! ```text
//! f = Cᵀ [ Rᵀ(a − g) + α × p + ω × (ω × p) ]        ω_s = Cᵀ ω                         (truth)
//! m_k = clip( Q( (1 + S + X) u_k + b_k + n_k ) )     n_k ~ N(0, D² r),   b_{k+1} = b_k + N(0, W²/r)
//! ```
//! f specific force in the sensor's axes [m/s²] (+g on the axis that points up at rest, REP-145); a acceleration of the
//! centre of mass in the world, g gravity [m/s²]; R body → world, C sensor → body; ω, α angular velocity and acceleration
//! in the body [rad/s, rad/s²]; p place of the sensor from the centre of mass, body axes (m). u the truth (f or ω_s),
//! S diagonal scale errors (1), X misalignment (small angles between the axes) (rad), b bias, n white noise of density D
//! [unit/√Hz] at sample rate r (Hz), W bias walk [unit/s/√Hz], Q rounding to the resolution.
//! On a carrier the sensor rides on the shoulder, which turns with the party's path alone: f = R_z(χ)ᵀ(b̈ − g), ω = χ̇ ẑ, χ the heading.
//!
//! Holds for a sensor rigid on its body whose own bandwidth is above r/2: each sample is the instantaneous value, so
//! motion above r/2 folds back as it does in a chip without a filter. Source of the noise model: Woodman, *An
//! introduction to inertial navigation*, UCAM-CL-TR-696 (2007), sec. 3–5; IEEE Std 952; of the rigid-body terms: Murray, Li, Sastry
//! (1994), ch. 2. Discretisation: Crassidis, AIAA 2005-6052, eq. (9).

use crate::freedoms::Pose;
use crate::model::{Model, Workspace};
use crate::random::{Stream, normal_pair, uniform_pair};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Where a sensor sits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Seat {
    /// On the carried body, at a place from the centre of mass, m.
    Body([f64; 3]),
    /// On the shoulder of a carrier, counted from 0.
    Carrier(usize),
}

/// Errors of one triad, gyroscope or accelerometer; unit is rad/s or m/s².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Triad {
    /// White noise, unit/√Hz.
    pub noise_density: f64,
    /// Bias walk, unit/s/√Hz.
    pub bias_walk: f64,
    /// Standard deviation of the bias at t = 0, unit.
    pub bias_sd: f64,
    /// Standard deviation of each axis' scale error, 1.
    pub scale_sd: f64,
    /// Standard deviation of each angle between axes, rad.
    pub misalignment_sd: f64,
    /// Greatest value it can show, unit; infinite for none.
    pub range: f64,
    /// Step of its digits, unit; 0 for none.
    pub resolution: f64,
}

impl Triad {
    /// Shows everything as it is.
    pub const IDEAL: Self = Self {
        noise_density: 0.0,
        bias_walk: 0.0,
        bias_sd: 0.0,
        scale_sd: 0.0,
        misalignment_sd: 0.0,
        range: f64::INFINITY,
        resolution: 0.0,
    };
}

/// One instrument.
#[derive(Clone, Debug, PartialEq)]
pub struct Imu {
    /// Its topic, `/imu/rath`.
    pub topic: String,
    /// Its frame, `imu_rath`.
    pub frame: String,
    /// Where it sits.
    pub seat: Seat,
    /// Turns sensor axes into those of its seat.
    pub mounting: UnitQuaternion<f64>,
    /// Nominal sample rate by its own clock, Hz.
    pub rate_hz: f64,
    /// What its clock shows at t = 0, s.
    pub clock_offset_s: f64,
    /// Which of [`Model::sensor_clocks`] it samples on.
    pub clock: usize,
    /// Probability that a sample is lost.
    pub dropout: f64,
    /// How many are lost at a time.
    pub dropout_row: u32,
    /// Gyroscope, rad/s.
    pub gyroscope: Triad,
    /// Accelerometer, m/s².
    pub accelerometer: Triad,
    /// Seed and number for the random draws.
    pub draws: Draws,
}

/// Which random numbers are an instrument's own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draws {
    /// The scene's seed.
    pub seed: u64,
    /// The instrument's number.
    pub instrument: u32,
}

/// Uses of an instrument's numbers; each has counters of its own.
#[derive(Clone, Copy)]
#[repr(u32)]
enum Use {
    Noise = 0,
    Walk = 3,
    Dropout = 6,
    FirstBias = 7,
    Gains = 10,
}

const USES: u32 = 32;

impl Draws {
    /// Six independent standard normal numbers.
    fn six(self, what: Use, index: u64) -> [f64; 6] {
        let mut out = [0.0; 6];
        for pair in 0..3 {
            let item = self.instrument * USES + what as u32 + pair;
            let [a, b] = normal_pair(self.seed, Stream::Sensor, item, index);
            (out[2 * pair as usize], out[2 * pair as usize + 1]) = (a, b);
        }
        out
    }

    fn uniform(self, what: Use, index: u64) -> f64 {
        uniform_pair(
            self.seed,
            Stream::Sensor,
            self.instrument * USES + what as u32,
            index,
        )[0]
    }
}

/// What an instrument remembers: its biases, and its fixed gain errors.
#[derive(Clone, Debug)]
pub struct Memory {
    /// Gyroscope x, y, z, accelerometer x, y, z.
    bias: [f64; 6],
    gain: [Matrix3<f64>; 2],
}

/// Motion of the body at a moment.
#[derive(Clone, Copy, Debug)]
pub struct BodyMotion {
    /// Where it is, and how fast.
    pub pose: Pose,
    /// Acceleration of the centre of mass in the world, m/s².
    pub linear_m_per_s2: [f64; 3],
    /// Angular acceleration in the body, rad/s².
    pub angular_rad_per_s2: [f64; 3],
}

/// Motion of the carriers at a moment.
#[derive(Clone, Copy, Debug)]
pub struct PartyMotion<'a> {
    /// b̈ of every shoulder in the world, m/s².
    pub shoulders_m_per_s2: &'a [[f64; 3]],
    /// Where the party faces, rad, and its rate, rad/s.
    pub heading: [f64; 2],
}

/// What a faultless instrument would show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// rad/s
    pub angular_velocity: Vector3<f64>,
    /// m/s²
    pub specific_force: Vector3<f64>,
}

/// One sample as the instrument gives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading<'a> {
    /// `/imu/rath`
    pub topic: &'a str,
    /// `imu_rath`
    pub frame: &'a str,
    /// True time of the sample, s since the start.
    pub t_s: f64,
    /// Time by the instrument's own clock, s since the start; what stamps the message.
    pub stamp_s: f64,
    /// Angular velocity in sensor axes, rad/s.
    pub angular_velocity_rad_per_s: [f64; 3],
    /// Specific force in sensor axes, m/s².
    pub specific_force_m_per_s2: [f64; 3],
    /// White-noise variance of each angular velocity, rad²/s².
    pub angular_velocity_variance: f64,
    /// White-noise variance of each specific force, m²/s⁴.
    pub specific_force_variance: f64,
}

impl Imu {
    /// Whether it rides on a carrier.
    pub fn is_on_a_carrier(&self) -> bool {
        matches!(self.seat, Seat::Carrier(_))
    }

    /// Biases and gain errors as drawn from the seed.
    pub fn switch_on(&self) -> Memory {
        let first = self.draws.six(Use::FirstBias, 0);
        let triads = [&self.gyroscope, &self.accelerometer];
        let bias = std::array::from_fn(|i| first[i] * triads[i / 3].bias_sd);
        let gain = std::array::from_fn(|which| {
            let triad = triads[which];
            let scale = self.draws.six(Use::Gains, which as u64);
            let cross = self.draws.six(Use::Gains, 2 + which as u64);
            let mut m =
                Matrix3::from_diagonal(&Vector3::from_fn(|i, _| 1.0 + triad.scale_sd * scale[i]));
            let places = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)];
            for (place, z) in places.into_iter().zip(cross) {
                m[place] = triad.misalignment_sd * z;
            }
            m
        });
        Memory { bias, gain }
    }

    /// Specific force and angular velocity at its seat; the party's motion is asked for where that is a carrier.
    pub fn truth(
        &self,
        body: &BodyMotion,
        party: Option<PartyMotion<'_>>,
        gravity: [f64; 3],
    ) -> Truth {
        let gravity = Vector3::from(gravity);
        let (angular_velocity, specific_force) = match self.seat {
            Seat::Body(place) => {
                let [x, y, z, w] = body.pose.orientation;
                let to_world = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(w, x, y, z));
                let (spin, p) = (
                    Vector3::from(body.pose.spin_rad_per_s),
                    Vector3::from(place),
                );
                let felt = to_world.inverse() * (Vector3::from(body.linear_m_per_s2) - gravity);
                let euler = Vector3::from(body.angular_rad_per_s2).cross(&p);
                (spin, felt + euler + spin.cross(&spin.cross(&p)))
            }
            Seat::Carrier(i) => {
                let moved = party.map_or([0.0; 3], |p| p.shoulders_m_per_s2[i]);
                let [heading, rate] = party.map_or([0.0; 2], |p| p.heading);
                let to_world = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading);
                let felt = to_world.inverse() * (Vector3::from(moved) - gravity);
                (Vector3::new(0.0, 0.0, rate), felt)
            }
        };
        let back = self.mounting.inverse();
        Truth {
            angular_velocity: back * angular_velocity,
            specific_force: back * specific_force,
        }
    }

    /// Whether one of the rows that reach a tick begins: with probability p a tick is lost if each begins one of n with 1 − (1 − p)^(1/n).
    fn is_lost(&self, tick: u64) -> bool {
        let begins = match self.dropout_row {
            1 => self.dropout,
            n => 1.0 - (1.0 - self.dropout).powf(1.0 / f64::from(n)),
        };
        let first = tick.saturating_sub(u64::from(self.dropout_row) - 1);
        (first..=tick).any(|k| self.draws.uniform(Use::Dropout, k) <= begins)
    }

    /// The sample of tick `tick`, or nothing when it is lost. To be called for every tick in order: biases walk on.
    pub fn measure(
        &self,
        tick: u64,
        t_s: f64,
        truth: Truth,
        memory: &mut Memory,
    ) -> Option<Reading<'_>> {
        let triads = [&self.gyroscope, &self.accelerometer];
        let root_rate = self.rate_hz.sqrt();
        if tick > 0 && triads.iter().any(|t| t.bias_walk > 0.0) {
            for (i, z) in self.draws.six(Use::Walk, tick).into_iter().enumerate() {
                memory.bias[i] += triads[i / 3].bias_walk / root_rate * z;
            }
        }
        if self.dropout > 0.0 && self.is_lost(tick) {
            return None;
        }
        let noise = if triads.iter().any(|t| t.noise_density > 0.0) {
            self.draws.six(Use::Noise, tick)
        } else {
            [0.0; 6]
        };
        let shown = |which: usize, u: Vector3<f64>| -> [f64; 3] {
            let (triad, felt) = (triads[which], memory.gain[which] * u);
            std::array::from_fn(|axis| {
                let i = 3 * which + axis;
                let x = felt[axis] + memory.bias[i] + triad.noise_density * root_rate * noise[i];
                if triad.resolution > 0.0 {
                    // The last digit that lies within the range ends it; 9.6/0.4 is 24, though its quotient is rounded below.
                    let most = (triad.range / triad.resolution * (1.0 + 1e-12)).floor();
                    (x / triad.resolution).round().clamp(-most, most) * triad.resolution
                } else {
                    x.clamp(-triad.range, triad.range)
                }
            })
        };
        let variance = |triad: &Triad| triad.noise_density * triad.noise_density * self.rate_hz;
        Some(Reading {
            topic: &self.topic,
            frame: &self.frame,
            t_s,
            stamp_s: self.clock_offset_s + tick as f64 / self.rate_hz,
            angular_velocity_rad_per_s: shown(0, truth.angular_velocity),
            specific_force_m_per_s2: shown(1, truth.specific_force),
            angular_velocity_variance: variance(&self.gyroscope),
            specific_force_variance: variance(&self.accelerometer),
        })
    }
}

/// Step of the difference below, s: its truncation (h⁴/30 · d⁵ḃ/dt⁵) is 8e-13 m/s² for 64 mm at 2 Hz, its rounding, of a phase of 100 rad, 1e-10.
const DIFFERENCE_S: f64 = 1e-4;

/// b̈ of every shoulder at (t, y), m/s²: the derivative of ḃ along the flow, by a five-point difference.
///
/// ḃ is a function of time and state, so b̈ = d/ds ḃ(t + s, y + s ẏ) at s = 0, whatever moves the shoulders. The noise
/// cell and the contacts stay those of the segment, where ḃ is smooth. `near` is scratch of the size of the state; the accelerations
/// go into `sums`, one for each carrier.
pub fn shoulder_accelerations(
    model: &Model,
    t_s: f64,
    y: &[f64],
    dy: &[f64],
    w: &mut Workspace,
    near: &mut [f64],
    sums: &mut [[f64; 3]],
) {
    sums.fill([0.0; 3]);
    for (steps, weight) in [(-2.0, 1.0), (-1.0, -8.0), (1.0, 8.0), (2.0, -1.0)] {
        let s = steps * DIFFERENCE_S;
        for ((n, y), d) in near.iter_mut().zip(y).zip(dy) {
            *n = y + s * d;
        }
        model.forces(t_s + s, near, w);
        for (i, sum) in sums.iter_mut().enumerate() {
            for (axis, a) in sum.iter_mut().enumerate() {
                *a += weight / (12.0 * DIFFERENCE_S) * w.of(i, |p| p.base_rate[axis]);
            }
        }
    }
}

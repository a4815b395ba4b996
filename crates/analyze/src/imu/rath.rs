//! The motion of what is carried, from one inertial sensor on it.
//!
//! ```text
//! f_com = f − ( α × r + ω × (ω × r) )        specific force at the centre of mass
//! s     = (R f_com)_z / g = N_tot / (M g)     the support ratio: T_float is the time with s ≤ 0.05
//! a_up  = (R f_com)_z − g                     its double integral is the height
//! ```
//! f specific force at the sensor [m/s²], r from the centre of mass to the sensor in the body's axes (m), ω angular velocity [rad/s], α its
//! derivative [rad/s²], R body → earth, g gravity [m/s²]. Only contact lifts the body, so its specific force *is* the support force over its
//! mass: no force sensor is needed for T_float. With r unknown (0) the term in brackets stays in, up to r·ω² and r·α.
//!
//! What an inertial sensor cannot give: mean height, heading, forces of single handles. Those stay missing, with the reason. The numbers
//! made of the motion, and how sure they are: [`super::interval`].

use super::bridge::{self, Drawn, bridge};
use super::budget::Budget;
use super::orientation::{self, Estimate, Options};
use super::track::Track;
use super::turned::{Turned, turned};
use super::vertical;
use crate::filter::{Band, butter, sosfiltfilt};
use crate::inputs::{HOLE, Inputs, Window, interpolate, mean_step_in, stretches};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use std::ops::{Add, Mul, Range};

/// How the sensor's axes lie on the body (x forward along the pole, y left, z up).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Mounting {
    /// The sensor's x points forward along the pole, as well as tape allows; up is the mean of gravity over [`Settings::level_over`]. How the
    /// sensor sits and how the load leans on average cannot be told apart then: roll and pitch are about their means.
    #[default]
    Levelled,
    /// Body from sensor, known; taken as it is.
    Known(UnitQuaternion<f64>),
}

/// How a recording is to be read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Orientation.
    pub orientation: Options,
    /// Mounting.
    pub mounting: Mounting,
    /// Where gravity is averaged to find what is up on the sensor; all of the recording where nothing lies in it.
    pub level_over: Window,
    /// From the centre of mass to the sensor, in the body's axes, m.
    pub lever_m: [f64; 3],
    /// Whether anybody said so.
    pub lever_is_known: bool,
    /// Gravity, m/s².
    pub gravity_m_per_s2: f64,
    /// Corner f₀ of the height, Hz: what is slower is held at zero ([`vertical`]). Twice the corner that suits 0.3 Hz, because a rath swings
    /// at 1 Hz and above and a lower corner lets the accelerometer's bias into Δz.
    pub height_corner_hz: f64,
    /// Error budget behind the intervals.
    pub budget: Budget,
}

impl Default for Settings {
    /// Levelled, at the centre of mass, standard gravity.
    fn default() -> Self {
        Self {
            orientation: Options::default(),
            mounting: Mounting::default(),
            level_over: Window::ALL,
            lever_m: [0.0; 3],
            lever_is_known: false,
            gravity_m_per_s2: 9.80665,
            height_corner_hz: 2.0 * vertical::CORNER_HZ,
            budget: Budget::default(),
        }
    }
}

/// Why there is no motion.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// Too short.
    #[error(
        "{found_s:.1} s of inertial data without a hole; orientation and height need at least 5 s"
    )]
    TooShort {
        /// Longest stretch found, s.
        found_s: f64,
    },
    /// Too slowly sampled.
    #[error("the sensor was sampled at {found_hz:.1} Hz; the rath's motion needs at least 25 Hz")]
    TooSlow {
        /// Rate found, Hz.
        found_hz: f64,
    },
    /// Gravity is there, but does not keep its direction.
    #[error(
        "the accelerometer shows gravity ({norm_m_per_s2:.2} m/s² on average), but turned by the gyroscope it has a mean of {found_m_per_s2:.2} m/s² only: give angular velocities in rad/s, on the axes of the accelerometer"
    )]
    Turning {
        /// Norm of the mean over the recording, turned to earth, m/s².
        found_m_per_s2: f64,
        /// Mean norm as measured, m/s².
        norm_m_per_s2: f64,
    },
    /// Gravity is not there.
    #[error(
        "the mean specific force is {found_m_per_s2:.2} m/s², not gravity: give accelerations with gravity, in m/s² (an app's \"linear acceleration\" has lost it)"
    )]
    NoGravity {
        /// Norm of the mean over the recording, turned to earth, m/s².
        found_m_per_s2: f64,
    },
}

/// The body's motion, as far as an inertial sensor sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Columns for [`crate::metrics()`], all from the sensor: roll, pitch, support ratio, height about its slow course (NaN at the ends).
    pub inputs: Inputs,
    /// Vertical acceleration of the centre of mass about its mean, gravity removed, m/s²; evenly spaced but for the holes.
    pub accel_up_m_per_s2: Vec<f64>,
    /// That mean, m/s²: what the accelerometer's scale and its bias upwards make of gravity.
    pub gravity_off_m_per_s2: f64,
    /// The parts between holes, as ranges of samples.
    pub stretches: Vec<Range<usize>>,
    /// From when to when each of them was measured.
    pub seen: Vec<Window>,
    /// From the first sample to the last.
    pub sampled: Window,
    /// How far each acceleration may be off, m/s²: 0 but where a short hole was drawn through.
    pub unsure_m_per_s2: Vec<f64>,
    /// Where one was, the columns once more, with as many holes again.
    pub again: Option<Box<Inputs>>,
    /// Orientation of the body, and what was learnt of the gyroscope; one per time of `inputs.t_s`.
    pub orientation: Estimate,
    /// Body from sensor, as used.
    pub body_from_sensor: UnitQuaternion<f64>,
    /// The settings used.
    pub settings: Settings,
}

impl Motion {
    /// Height about its slow course, stretch by stretch, m, with the corner f₀ as in [`vertical`].
    pub fn height_m(&self, corner_hz: f64) -> Vec<f64> {
        stretchwise_height(
            &self.accel_up_m_per_s2,
            &self.unsure_m_per_s2,
            &self.stretches,
            mean_step_in(&self.inputs.t_s, &self.stretches).unwrap_or_default(),
            corner_hz,
        )
    }
}

impl Motion {
    /// Whether nothing tells which way is forward: the sensor's x stands upright, and nobody says how it sits.
    pub fn forward_is_unknown(&self) -> bool {
        let x = self.body_from_sensor * Vector3::x();
        self.settings.mounting == Mounting::Levelled && x.xy().norm() < LEVEL
    }

    /// What of a window was sampled and is in no stretch, and how much was sampled, s.
    pub fn left_out_s(&self, window: Window) -> [f64; 2] {
        let within = |w: &Window| window.overlap_s(*w);
        let sampled_s = within(&self.sampled);
        let seen_s: f64 = self.seen.iter().map(within).sum();
        [(sampled_s - seen_s).max(0.0), sampled_s]
    }

    /// How much was drawn through in short holes, s.
    pub fn drawn_s(&self) -> f64 {
        let drawn = self.unsure_m_per_s2.iter().filter(|u| **u > 0.0).count();
        let step_s = mean_step_in(&self.inputs.t_s, &self.stretches);
        drawn as f64 * step_s.unwrap_or_default()
    }
}

/// A load that is carried leans by less than this on average, rad.
const CARRIED_RAD: f64 = std::f64::consts::FRAC_PI_4;
/// Its mean upward direction is at least so long, 1: what tumbles has none.
const ONE_WAY: f64 = 0.5;

impl Motion {
    /// How far the load leans on average, degrees, where a declared mounting makes it lean as nobody carries it.
    pub fn misdeclared_deg(&self) -> Option<f64> {
        let known = matches!(self.settings.mounting, Mounting::Known(_));
        let within = self.settings.level_over.range(&self.inputs.t_s);
        let up = mean_up(&self.orientation.earth_from_sensor, within);
        let lean = up.angle(&Vector3::z());
        (known && up.norm() > ONE_WAY && lean > CARRIED_RAD).then(|| lean.to_degrees())
    }
}

impl Motion {
    /// Whether the sensor lies otherwise on the load from some moment of [`Settings::level_over`] on.
    pub fn turned(&self) -> Option<Turned> {
        let within = self.settings.level_over.range(&self.inputs.t_s);
        let earth_from = &self.orientation.earth_from_sensor;
        turned(&self.inputs.t_s[within.clone()], &earth_from[within])
    }
}

/// Shorter stretches tell neither orientation nor height, s.
const SHORTEST_S: f64 = 5.0;

/// The body's motion from its sensor. Short holes are drawn through ([`super::bridge`]); nothing is carried over others: the columns have no samples there,
/// and no height near them.
///
/// # Errors
/// When the recording is too short, too slowly sampled, or gravity has been removed from it.
pub fn motion(track: &Track, settings: &Settings) -> Result<Motion, MotionError> {
    let span_s = |r: &Range<usize>| track.t_s[r.end - 1] - track.t_s[r.start];
    let too_short = || {
        let found = track.stretches();
        let found_s = found.iter().map(span_s).fold(0.0, f64::max);
        MotionError::TooShort { found_s }
    };
    let mut whole = stretches(&track.t_s, bridge::LONGEST_S);
    whole.retain(|r| span_s(r) >= SHORTEST_S);
    if whole.is_empty() {
        return Err(too_short());
    }
    let usual_s = track.period_s().unwrap_or(1.0);
    let mean_s = mean_step_in(&track.t_s, &whole).unwrap_or(1.0);
    // Samples in packets are as dense as their mean step, not as the usual one.
    let period_s = if mean_s > 1.5 * usual_s {
        mean_s
    } else {
        usual_s
    };
    // A clock errs, and stamps are rounded.
    if period_s > 1.01 / 25.0 {
        return Err(MotionError::TooSlow {
            found_hz: 1.0 / period_s,
        });
    }
    let even = even(track, &whole, period_s);
    if even.stretches.is_empty() {
        return Err(too_short());
    }
    let seen = even.seen;
    let again = even
        .again
        .and_then(|drawn| of_even(drawn, even.stretches.clone(), period_s, settings).ok());
    let mut found = of_even(even.drawn, even.stretches, period_s, settings)?;
    found.seen = seen;
    found.sampled = span(&track.t_s);
    found.again = again.map(|again| Box::new(again.inputs));
    Ok(found)
}

/// The motion from even samples in stretches.
fn of_even(
    drawn: Drawn,
    stretches: Vec<Range<usize>>,
    period_s: f64,
    settings: &Settings,
) -> Result<Motion, MotionError> {
    let Drawn {
        track,
        unsure_m_per_s2,
    } = drawn;
    let mut estimate = orientation::batch(&track, settings.orientation);
    let found = mean_specific_force(&track, &estimate);
    let g = settings.gravity_m_per_s2;
    let is_gravity = |f: f64| (0.8 * g..=1.2 * g).contains(&f);
    if !is_gravity(found) {
        let norms = track
            .accel_m_per_s2
            .iter()
            .map(|a| Vector3::from(*a).norm());
        let norm = norms.sum::<f64>() / track.len() as f64;
        // What jumps feels more than gravity on average, and off the centre what pulls outwards, but the sensor keeps its attitude on average: what has
        // lost gravity has a mean near 0.
        let felt = track.accel_m_per_s2.iter();
        let felt: Vector3<f64> = felt.map(|a| Vector3::from(*a)).sum();
        let mean = felt.norm() / track.len() as f64;
        if is_gravity(norm) || (0.5 * g..=1.2 * g).contains(&mean) {
            return Err(MotionError::Turning {
                found_m_per_s2: found,
                norm_m_per_s2: norm,
            });
        }
        return Err(MotionError::NoGravity {
            found_m_per_s2: found,
        });
    }
    let body_from_sensor = match settings.mounting {
        Mounting::Known(rotation) => rotation,
        Mounting::Levelled => level(&estimate, settings.level_over.range(&track.t_s)),
    };
    let sensor_from_body = body_from_sensor.inverse();
    for q in &mut estimate.earth_from_sensor {
        *q *= sensor_from_body;
    }
    let body = track.rotated(&body_from_sensor);
    let turning = body.gyro_rad_per_s.iter().zip(&estimate.bias_rad_per_s);
    let rates: Vec<Vector3<f64>> = turning
        .map(|(w, b)| Vector3::from(*w) - body_from_sensor * Vector3::from(*b))
        .collect();
    let felt: Vec<Vector3<f64>> = body.accel_m_per_s2.iter().map(|a| (*a).into()).collect();
    let central = |r: &Range<usize>| {
        let (felt, rates) = (&felt[r.clone()], &rates[r.clone()]);
        at_centre_of_mass(felt, rates, settings.lever_m, period_s)
    };
    let force: Vec<Vector3<f64>> = stretches.iter().flat_map(central).collect();
    let n = body.len();
    let (mut roll_rad, mut pitch_rad) = (Vec::with_capacity(n), Vec::with_capacity(n));
    let (mut support_ratio, mut accel_up) = (Vec::with_capacity(n), Vec::with_capacity(n));
    for (i, (q, f)) in estimate.earth_from_sensor.iter().zip(&force).enumerate() {
        // R = Rz(yaw) Ry(pitch) Rx(roll), REP-103.
        let (roll, pitch, _) = q.euler_angles();
        roll_rad.push(roll);
        pitch_rad.push(pitch);
        let since = rates[i] * -settings.orientation.accel_latency_s;
        let up = (q * UnitQuaternion::from_scaled_axis(since) * f).z;
        support_ratio.push(up / g);
        accel_up.push(up - g);
    }
    let mean = accel_up.iter().sum::<f64>() / n as f64;
    accel_up.iter_mut().for_each(|a| *a -= mean);
    if settings.lever_m != [0.0; 3] {
        accel_up = stretches
            .iter()
            .flat_map(|r| sharpened(&accel_up[r.clone()]))
            .collect();
    }
    let corner_hz = settings.height_corner_hz;
    let mut height_m =
        stretchwise_height(&accel_up, &unsure_m_per_s2, &stretches, period_s, corner_hz);
    // At its free ends the height shows the accelerometer's bias; that fades by e every 1/(√2 π f₀).
    for stretch in &stretches {
        // A short recording keeps most of its height; beside a hole there is time enough to do without.
        let fade = |hole: bool| match hole {
            true => (BESIDE_HOLES / corner_hz / period_s) as usize,
            false => ((ENDS / corner_hz / period_s) as usize).min(n / 10),
        };
        let half = stretch.len() / 2;
        let (head, tail) = (fade(stretch.start > 0), fade(stretch.end < n));
        let (head, tail) = (head.min(half), tail.min(half));
        height_m[stretch.start..stretch.start + head].fill(f64::NAN);
        height_m[stretch.end - tail..stretch.end].fill(f64::NAN);
    }
    let mut inputs = Inputs {
        t_s: body.t_s.clone(),
        height_m,
        roll_rad,
        pitch_rad,
        support_ratio,
        gravity_m_per_s2: g,
        ..Inputs::default()
    };
    inputs.sources.attitude = "imu".into();
    inputs.sources.levelled = settings.mounting == Mounting::Levelled;
    inputs.sources.height = "imu".into();
    inputs.sources.forces = "imu".into();
    Ok(Motion {
        inputs,
        accel_up_m_per_s2: accel_up,
        gravity_off_m_per_s2: mean,
        stretches,
        seen: Vec::new(),
        sampled: Window::ALL,
        unsure_m_per_s2,
        again: None,
        orientation: estimate,
        body_from_sensor,
        settings: *settings,
    })
}

/// The samples of the stretches on an even grid each, of the same period.
struct Evened {
    /// Without short holes.
    drawn: Drawn,
    /// The same with as many holes again, where there are any.
    again: Option<Drawn>,
    /// Where the stretches are now.
    stretches: Vec<Range<usize>>,
    /// From when to when they were measured.
    seen: Vec<Window>,
}

/// From the first of some moments, of which there is one at least, to the last.
fn span(t_s: &[f64]) -> Window {
    Window {
        start_s: t_s[0],
        end_s: t_s[t_s.len() - 1],
    }
}

fn even(track: &Track, whole: &[Range<usize>], period_s: f64) -> Evened {
    let dropped = Track {
        dropped: track.dropped,
        ..Track::default()
    };
    let mut out = Evened {
        drawn: Drawn::measured(dropped),
        again: None,
        stretches: Vec::with_capacity(whole.len()),
        seen: Vec::with_capacity(whole.len()),
    };
    let mut add = |drawn: Drawn, again: Option<Drawn>, seen: Window| {
        if again.is_some() && out.again.is_none() {
            out.again = Some(out.drawn.clone());
        }
        if let Some(all) = &mut out.again {
            all.append(again.unwrap_or_else(|| drawn.clone()));
        }
        let first = out.drawn.track.len();
        out.drawn.append(drawn);
        out.stretches.push(first..out.drawn.track.len());
        out.seen.push(seen);
    };
    for range in whole {
        let part = track.part(range.clone());
        let even = evened(&part, period_s);
        let holes = holes(&part.t_s, &even.t_s, period_s);
        if holes.is_empty() {
            add(Drawn::measured(even), None, span(&part.t_s));
        } else if let Some([drawn, again]) = bridge(&even, &holes, period_s) {
            add(drawn, Some(again), span(&part.t_s));
        } else {
            for r in part.stretches() {
                let seen = span(&part.t_s[r.clone()]);
                if seen.length_s() >= SHORTEST_S {
                    add(Drawn::measured(evened(&part.part(r), period_s)), None, seen);
                }
            }
        }
    }
    out
}

/// Where several samples in a row are missing, as ranges of an even axis of `period_s` over the same time.
fn holes(t_s: &[f64], even_s: &[f64], period_s: f64) -> Vec<Range<usize>> {
    let inside = |w: &[f64]| {
        let within = Window {
            start_s: w[0] + 0.5 * period_s,
            end_s: w[1] - 0.5 * period_s,
        };
        within.range(even_s)
    };
    let gaps = t_s.windows(2).filter(|w| w[1] - w[0] > HOLE * period_s);
    gaps.map(inside).filter(|r| !r.is_empty()).collect()
}

fn evened(track: &Track, period_s: f64) -> Track {
    let (start, end) = (track.t_s[0], track.t_s[track.len() - 1]);
    let jitter = track
        .t_s
        .iter()
        .enumerate()
        .map(|(k, t)| (t - start - k as f64 * period_s).abs())
        .fold(0.0, f64::max);
    if jitter < 0.02 * period_s {
        return track.clone();
    }
    // Bounded by the samples: within a stretch no step is longer than some usual ones.
    let n = ((end - start) / period_s) as usize + 1;
    let grid: Vec<f64> = (0..n).map(|k| start + k as f64 * period_s).collect();
    let resample = |v: &[[f64; 3]]| -> Vec<[f64; 3]> {
        let axes: [Vec<f64>; 3] = std::array::from_fn(|a| {
            let x: Vec<f64> = v.iter().map(|s| s[a]).collect();
            drawn(&track.t_s, &x, &grid, period_s)
        });
        (0..n)
            .map(|k| [axes[0][k], axes[1][k], axes[2][k]])
            .collect()
    };
    Track {
        gyro_rad_per_s: resample(&track.gyro_rad_per_s),
        accel_m_per_s2: resample(&track.accel_m_per_s2),
        dropped: track.dropped,
        t_s: grid,
    }
}

/// `x(t)` at the times `at_s` by straight lines between samples, and where one between them was lost, by the cubic through four. Not where their times
/// scatter: of two that came together the cubic makes a slope that nothing had.
fn drawn(t_s: &[f64], x: &[f64], at_s: &[f64], period_s: f64) -> Vec<f64> {
    let mut out = interpolate(t_s, x, at_s);
    let even = |k: usize| {
        let steps = (t_s[k + 1] - t_s[k]) / period_s;
        (steps - steps.round()).abs() < 0.25 && steps > 0.5
    };
    for k in 1..t_s.len().saturating_sub(2) {
        if t_s[k + 1] - t_s[k] <= 1.5 * period_s || !(k - 1..=k + 1).all(even) {
            continue;
        }
        let (t, x) = (&t_s[k - 1..k + 3], &x[k - 1..k + 3]);
        // Lagrange's polynomial.
        let cubic = |at: f64| -> f64 {
            let share = |i: usize| {
                let others = (0..4).filter(|j| *j != i);
                others.map(|j| (at - t[j]) / (t[i] - t[j])).product::<f64>()
            };
            (0..4).map(|i| x[i] * share(i)).sum()
        };
        let inside = Window {
            start_s: t[1],
            end_s: t[2],
        };
        for i in inside.range(at_s) {
            out[i] = cubic(at_s[i]);
        }
    }
    out
}

/// [`vertical::height_where_sure`] of each stretch by itself, m.
fn stretchwise_height(
    accel_up_m_per_s2: &[f64],
    unsure_m_per_s2: &[f64],
    stretches: &[Range<usize>],
    period_s: f64,
    corner_hz: f64,
) -> Vec<f64> {
    let of = |r: &Range<usize>| {
        let (accel, unsure) = (&accel_up_m_per_s2[r.clone()], &unsure_m_per_s2[r.clone()]);
        vertical::height_where_sure(accel, unsure, period_s, corner_hz)
    };
    stretches.iter().flat_map(of).collect()
}

/// Norm of the mean specific force in the earth's frame: g, whatever the motion, when gravity is in it.
fn mean_specific_force(track: &Track, estimate: &Estimate) -> f64 {
    let mut sum = Vector3::zeros();
    for (q, a) in estimate.earth_from_sensor.iter().zip(&track.accel_m_per_s2) {
        sum += q * Vector3::from(*a);
    }
    sum.norm() / track.len() as f64
}

/// Mean of what is up over some of the orientations, or all where that is none, in the turned axes.
fn mean_up(earth_from: &[UnitQuaternion<f64>], over: Range<usize>) -> Vector3<f64> {
    let some = match over.is_empty() {
        true => earth_from,
        false => &earth_from[over],
    };
    let up = some.iter().map(|q| q.inverse() * Vector3::z());
    up.sum::<Vector3<f64>>() / some.len().max(1) as f64
}

/// Least level part of the sensor's x that tells which way is forward, 1: about 17° from upright.
const LEVEL: f64 = 0.3;

/// Body from sensor: z is the mean upward direction as the sensor sees it over some samples (all where these are none), x what is level of the
/// sensor's own x. The shortest turn where that x stands nearly upright: it says little of forward then.
fn level(estimate: &Estimate, over: Range<usize>) -> UnitQuaternion<f64> {
    let up = mean_up(&estimate.earth_from_sensor, over);
    let Some(up) = up.try_normalize(0.0) else {
        return UnitQuaternion::identity();
    };
    let x = Vector3::x() - up * up.x;
    if x.norm() < LEVEL {
        // OK because up is far from -z there.
        return UnitQuaternion::rotation_between(&up, &Vector3::z()).unwrap_or_default();
    }
    let x = x.normalize();
    let axes = [x, up.cross(&x), up].map(|axis| axis.transpose());
    let rows = Rotation3::from_matrix_unchecked(Matrix3::from_rows(&axes));
    UnitQuaternion::from_rotation_matrix(&rows)
}

/// Specific force at the centre of mass, in the body's axes, from that at the sensor and the angular velocity over one stretch.
fn at_centre_of_mass(
    force: &[Vector3<f64>],
    rates: &[Vector3<f64>],
    lever_m: [f64; 3],
    period_s: f64,
) -> Vec<Vector3<f64>> {
    if lever_m == [0.0; 3] {
        return force.to_vec();
    }
    let r = Vector3::from(lever_m);
    let rates = below(rates, period_s);
    let force = below(force, period_s);
    let n = rates.len();
    // α over two steps is the mean of two differences, so its edges are those of a sum weighted 1, 2, 1. Whatever else is in the equation
    // is weighted alike: where a pole touches down, α × r cancels what the sensor felt only if both begin at once.
    (0..n)
        .map(|i| {
            let (a, b) = (i.saturating_sub(1), (i + 1).min(n - 1));
            let alpha = (rates[b] - rates[a]) / ((b - a) as f64 * period_s);
            let w = weighted(&rates, i);
            weighted(&force, i) - alpha.cross(&r) - w.cross(&w.cross(&r))
        })
        .collect()
}

/// What [`at_centre_of_mass`] weighted 1, 2, 1, with what that took from slow swings: a part (ω h)²/4 at the step h, 2 % of a heave at 2.15 Hz
/// sampled at 50 Hz; what is left of it is (ω h)⁴/16. Not for the support ratio, whose edges it would overshoot.
/// Source: twicing, Tukey, Exploratory Data Analysis (1977), ch. 16.
fn sharpened(x: &[f64]) -> Vec<f64> {
    (0..x.len()).map(|i| 2.0 * x[i] - weighted(x, i)).collect()
}

/// A value and its neighbours, weighted 1, 2, 1; beyond the ends stands the last.
fn weighted<T: Copy + Add<Output = T> + Mul<f64, Output = T>>(v: &[T], i: usize) -> T {
    (v[i.saturating_sub(1)] + v[i] * 2.0 + v[(i + 1).min(v.len() - 1)]) * 0.25
}

/// Fast sensors: without what lies above [`ACCELERATION_HZ`], where a derivative is noise only. Others as they are: the weights see to it.
fn below(v: &[Vector3<f64>], period_s: f64) -> Vec<Vector3<f64>> {
    if 1.0 / period_s < 5.0 * ACCELERATION_HZ {
        return v.to_vec();
    }
    let smooth: [Vec<f64>; 3] = std::array::from_fn(|axis| {
        let x: Vec<f64> = v.iter().map(|w| w[axis]).collect();
        butter(2, Band::Low(ACCELERATION_HZ), 1.0 / period_s)
            .and_then(|sections| sosfiltfilt(&sections, &x))
            .unwrap_or(x)
    });
    (0..v.len())
        .map(|i| Vector3::from_fn(|axis, _| smooth[axis][i]))
        .collect()
}

/// Up to here angular acceleration is taken from the gyroscope, Hz: re-contact jerks the body faster than a person moves.
const ACCELERATION_HZ: f64 = 60.0;

/// Seconds at both ends of the recording without height, times the corner.
pub(crate) const ENDS: f64 = 0.5;
/// The same beside a hole, where the window has no say in what is looked at.
pub(crate) const BESIDE_HOLES: f64 = 0.8;

#[cfg(test)]
mod tests;

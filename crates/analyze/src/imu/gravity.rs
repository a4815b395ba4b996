//! Whether gravity stays where it is, and as long as it is, turned by what a gyroscope reads.
//!
//! ```text
//! ω = P ω_read − b        m = ∫ w R f dt        r = m_B − m_A        ℓ = ½|m_A + m_B|
//! ```
//! P a way to read the axes; b a bias [rad/s]; R the turn since a window's beginning, integrated from ω; f specific force [m/s²], w Hann's weight of the
//! window's first (A) or second half (B). Turned by the right rates, gravity stays (r = 0) and is as long as it is (ℓ = g), and whatever else is felt has a mean
//! of nothing, wherever the sensor sits; by wrong rates it wanders or shrinks. A bias turns it too far by ∫ R b dt, so that ∂r/∂b is known and least squares
//! find b, but for its part along gravity, which turns nothing that is felt.

use super::Track;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Samples are averaged over this, s.
const BLOCK_S: f64 = 0.04;
/// Standard deviation of a window's residual, m/s².
const RESIDUAL_M_PER_S2: f64 = 0.2;
const ROUNDS: usize = 3;
/// How long windows are that tell whether rates are right, s, and how many of them it takes.
pub(super) const WINDOW_S: f64 = 4.0;
pub(super) const FEWEST: usize = 3;
/// Gravity that wanders by less than this is as it should be, m/s² RMS: 2°, more than an uncalibrated sensor and a first step make.
pub(super) const WANDERS_M_PER_S2: f64 = 0.4;
/// So many times better have other rates to fit, on the whole, and better at all in this share of the windows.
const TIMES: f64 = 3.0;
const MOSTLY: f64 = 0.75;

/// Mean of some samples.
pub(super) struct Block {
    /// Till the next one, s.
    pub step_s: f64,
    pub rate: Vector3<f64>,
    pub force: Vector3<f64>,
}

/// A track without its holes, in windows of `length_s`, as blocks.
pub(super) fn windows(track: &Track, length_s: f64) -> Vec<Vec<Block>> {
    let Some(period_s) = track.period_s() else {
        return Vec::new();
    };
    let samples = ((BLOCK_S / period_s).round() as usize).max(1);
    let mut out = Vec::new();
    for stretch in track.stretches() {
        let mut window: Vec<Block> = Vec::new();
        let mut so_far_s = 0.0;
        for start in stretch.clone().step_by(samples) {
            let end = start + samples;
            if end >= stretch.end {
                break;
            }
            let mean = |v: &[[f64; 3]]| {
                v[start..end]
                    .iter()
                    .map(|v| Vector3::from(*v))
                    .sum::<Vector3<f64>>()
                    / samples as f64
            };
            let step_s = track.t_s[end] - track.t_s[start];
            window.push(Block {
                step_s,
                rate: mean(&track.gyro_rad_per_s),
                force: mean(&track.accel_m_per_s2),
            });
            so_far_s += step_s;
            if so_far_s >= length_s {
                out.push(std::mem::take(&mut window));
                so_far_s = 0.0;
            }
        }
    }
    out
}

/// The mean rate in some windows, of which there is one at least, rad/s.
pub(super) fn mean_rate(windows: &[Vec<Block>]) -> Vector3<f64> {
    let blocks = || windows.iter().flatten();
    blocks().map(|b| b.rate).sum::<Vector3<f64>>() / blocks().count() as f64
}

/// What is known of a bias beforehand: around what it lies, and its standard deviation, rad/s.
#[derive(Clone, Copy)]
pub(super) struct Known {
    pub around: Vector3<f64>,
    pub sd: f64,
}

impl Known {
    /// No bias is known.
    pub const ANY: Self = Self {
        around: Vector3::new(0.0, 0.0, 0.0),
        sd: 0.1,
    };
}

/// How well a way to read the axes fits, with the bias that fits best.
pub(super) struct Fit {
    /// b, rad/s.
    pub bias: Vector3<f64>,
    /// How sure the windows alone are of it: the inverse of its covariance, s²/rad².
    pub sure: Matrix3<f64>,
    /// |r|² + (ℓ − g)² of each window, m²/s⁴.
    pub squares: Vec<f64>,
}

impl Fit {
    /// Of `windows`, of which there is one at least, from a first guess of the bias on.
    pub fn of(
        windows: &[Vec<Block>],
        axes: &Matrix3<f64>,
        mut bias: Vector3<f64>,
        known: Known,
        gravity_m_per_s2: f64,
    ) -> Self {
        // Least squares of r over what is left of the bias, a few times: large ones turn it far.
        let held = (RESIDUAL_M_PER_S2 / known.sd).powi(2);
        let (mut squares, mut sure) = (Vec::new(), Matrix3::zeros());
        for _ in 0..ROUNDS {
            let seen: Vec<Seen> = (windows.iter())
                .map(|window| Seen::of(window, axes, bias))
                .collect();
            let mut normal = Matrix3::zeros();
            let mut right = held * (known.around - bias);
            for s in &seen {
                normal += s.by_bias.transpose() * s.by_bias;
                right -= s.by_bias.transpose() * s.moved;
            }
            let Some(cholesky) = (normal + Matrix3::identity() * held).cholesky() else {
                break;
            };
            let more = cholesky.solve(&right);
            bias += more;
            let moved = |s: &Seen| (s.moved + s.by_bias * more).norm_squared();
            let variance = seen.iter().map(moved).sum::<f64>() / (3 * seen.len()) as f64;
            sure = normal / variance.max(f64::MIN_POSITIVE);
            let square = |s: &Seen| moved(s) + (s.length - gravity_m_per_s2).powi(2);
            squares = seen.iter().map(square).collect();
        }
        Self {
            bias,
            sure,
            squares,
        }
    }

    /// The better of two: from no bias on, and from the mean rate as one. A large bias is not found from none: what hardly turns shows it as its mean.
    pub fn best(
        windows: &[Vec<Block>],
        axes: &Matrix3<f64>,
        known: Known,
        gravity_m_per_s2: f64,
    ) -> Self {
        let from = |bias| Self::of(windows, axes, bias, known, gravity_m_per_s2);
        let [none, mean] = [Vector3::zeros(), axes * mean_rate(windows)].map(from);
        if none.rms() < mean.rms() { none } else { mean }
    }

    /// Whether it fits the same windows so much better than `other` that this one is wrong.
    pub fn refutes(&self, other: &Self) -> bool {
        let each = self.squares.iter().zip(&other.squares);
        let better = each.filter(|(own, other)| own < other).count();
        other.rms() >= TIMES * self.rms() && better as f64 >= MOSTLY * self.squares.len() as f64
    }

    /// Root of the mean of the squares, m/s².
    pub fn rms(&self) -> f64 {
        (self.squares.iter().sum::<f64>() / self.squares.len() as f64).sqrt()
    }
}

/// What a window shows of gravity.
struct Seen {
    /// r [m/s²].
    moved: Vector3<f64>,
    /// What a bias adds to it [m/s² per rad/s].
    by_bias: Matrix3<f64>,
    /// ℓ [m/s²].
    length: f64,
}

impl Seen {
    fn of(window: &[Block], axes: &Matrix3<f64>, bias: Vector3<f64>) -> Self {
        let whole_s: f64 = window.iter().map(|b| b.step_s).sum();
        let mut turn = UnitQuaternion::identity();
        let (mut means, mut weights) = ([Vector3::zeros(); 2], [0.0; 2]);
        let (mut turned, mut by_bias) = (Matrix3::zeros(), [Matrix3::zeros(); 2]);
        let mut t_s = 0.0;
        for block in window {
            let half =
                UnitQuaternion::from_scaled_axis((axes * block.rate - bias) * (0.5 * block.step_s));
            turn *= half;
            let felt = turn * block.force;
            let turning = turn.to_rotation_matrix().matrix() * block.step_s;
            t_s += 0.5 * block.step_s;
            let phase = 2.0 * t_s / whole_s;
            let part = usize::from(phase >= 1.0);
            let w = (std::f64::consts::PI * phase).sin().powi(2) * block.step_s;
            weights[part] += w;
            means[part] += felt * w;
            // A bias turns it too far by ∫ R b dt.
            by_bias[part] += felt.cross_matrix() * (turned + 0.5 * turning) * w;
            turned += turning;
            turn *= half;
            turn.renormalize_fast();
            t_s += 0.5 * block.step_s;
        }
        let [a, b] = [0, 1].map(|part| means[part] / weights[part]);
        Self {
            moved: b - a,
            by_bias: by_bias[1] / weights[1] - by_bias[0] / weights[0],
            length: 0.5 * (a + b).norm(),
        }
    }
}

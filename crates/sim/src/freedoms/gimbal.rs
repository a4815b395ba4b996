//! Two free angles.
//!
//! ```text
//! ω = (φ̇ − ψ̇ sin θ, θ̇ cos φ + ψ̇ cos θ sin φ, −θ̇ sin φ + ψ̇ cos θ cos φ)        (JᵀIJ) θ̈ = Jᵀ (τ − ω × Iω − I J̇ θ̇)
//! ```
//! φ roll, θ tilt, ψ yaw, the held one with its value and no rate (rad); ω in the body (rad/s). JᵀIJ is singular only where roll and yaw are
//! the same turn (θ = ±90°), which a scene with these two free may not hold. Source: see [`super::reduced`].

use super::reduced::{Rails, Turning, cross, dot, sin_cos};
use super::{place_handles, times, turning};
use crate::lanes::Now;
use crate::lanes::f64x2;
use crate::model::{Part, Workspace};

pub(super) struct Gimbal {
    handles: Vec<[f64x2; 3]>,
    /// Sine and cosine of the angles at t = 0, which the held one keeps.
    held: [(f64, f64); 3],
}

/// The attitude at a state: what gaps and accelerations both need.
struct Attitude {
    /// Sine and cosine of roll, tilt, yaw.
    roll: (f64, f64),
    tilt: (f64, f64),
    yaw: (f64, f64),
    /// Rates of roll, tilt, yaw; zero for the held one.
    rates: [f64; 3],
}

impl Attitude {
    #[inline(always)]
    fn rows(&self) -> [[f64; 3]; 3] {
        let ((sr, cr), (st, ct), (sy, cy)) = (self.roll, self.tilt, self.yaw);
        [
            [cy * ct, cy * st * sr - sy * cr, cy * st * cr + sy * sr],
            [sy * ct, sy * st * sr + cy * cr, sy * st * cr - cy * sr],
            [-st, ct * sr, ct * cr],
        ]
    }

    #[inline(always)]
    fn columns(&self) -> [[f64; 3]; 3] {
        let ((sr, cr), (st, ct)) = (self.roll, self.tilt);
        [[1.0, 0.0, 0.0], [0.0, cr, -sr], [-st, ct * sr, ct * cr]]
    }

    #[inline(always)]
    fn spin(&self) -> [f64; 3] {
        let j = self.columns();
        [0, 1, 2]
            .map(|a| j[0][a] * self.rates[0] + j[1][a] * self.rates[1] + j[2][a] * self.rates[2])
    }

    #[inline(always)]
    fn drag(&self) -> [f64; 3] {
        let ((sr, cr), (st, ct), [roll, tilt, yaw]) = (self.roll, self.tilt, self.rates);
        [
            -yaw * ct * tilt,
            -tilt * sr * roll + yaw * (ct * cr * roll - st * sr * tilt),
            -tilt * cr * roll - yaw * (st * cr * tilt + ct * sr * roll),
        ]
    }
}

impl Gimbal {
    #[inline(always)]
    fn attitude(&self, rails: &Rails, y: &[f64]) -> Attitude {
        let angle = |a: usize| rails.place[3 + a].map_or(self.held[a], |p| sin_cos(y[p]));
        Attitude {
            roll: angle(0),
            tilt: angle(1),
            yaw: angle(2),
            rates: [3, 4, 5].map(|c| rails.rate(c, y)),
        }
    }
}

impl Turning for Gimbal {
    fn new(rails: &Rails, handles: Vec<[f64x2; 3]>) -> Self {
        Self {
            handles,
            held: [3, 4, 5].map(|c| rails.held[c].sin_cos()),
        }
    }

    #[inline(always)]
    fn gaps(
        &self,
        rails: &Rails,
        y: &[f64],
        motion: [[f64; 3]; 2],
        w: &mut Workspace,
        part: impl Part,
    ) {
        let at = self.attitude(rails, y);
        w.spin = at.spin();
        w.rotation = at.rows();
        place_handles(
            &mut w.pair,
            &self.handles,
            part,
            motion,
            turning::<Now>(w.rotation, w.spin),
        );
    }

    #[inline(always)]
    fn accelerate(
        &self,
        rails: &Rails,
        torque: [f64; 3],
        y: &[f64],
        w: &Workspace,
        dy: &mut [f64],
    ) {
        let at = self.attitude(rails, y);
        let (j, spin, r) = (at.columns(), w.spin, &w.rotation);
        let gyro = cross(spin, times(&rails.inertia, spin));
        let drag = times(&rails.inertia, at.drag());
        let left = [0, 1, 2].map(|a| {
            let in_body = r[0][a] * torque[0] + r[1][a] * torque[1] + r[2][a] * torque[2];
            in_body + w.body_torque[a] - gyro[a] - drag[a]
        });
        let mut free = (0..3).filter_map(|a| rails.place[3 + a].map(|p| (j[a], rails.free + p)));
        if let (Some((a, pa)), Some((b, pb))) = (free.next(), free.next()) {
            let (ia, ib) = (times(&rails.inertia, a), times(&rails.inertia, b));
            let (aa, ab, bb) = (dot(a, ia), dot(a, ib), dot(b, ib));
            let (la, lb) = (dot(a, left), dot(b, left));
            let scale = 1.0 / (aa * bb - ab * ab);
            dy[pa] = (bb * la - ab * lb) * scale;
            dy[pb] = (aa * lb - ab * la) * scale;
        }
    }

    fn columns(&self, rails: &Rails, y: &[f64]) -> [[f64; 3]; 3] {
        self.attitude(rails, y).columns()
    }

    fn drag(&self, rails: &Rails, y: &[f64]) -> [f64; 3] {
        self.attitude(rails, y).drag()
    }
}

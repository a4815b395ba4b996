//! Two free angles.
//!
//! ```text
//! ω = (φ̇ − ψ̇ sin θ, θ̇ cos φ + ψ̇ cos θ sin φ, −θ̇ sin φ + ψ̇ cos θ cos φ)        (JᵀIJ) θ̈ = Jᵀ (τ − ω × Iω − I J̇ θ̇)
//! ```
//! φ roll, θ tilt, ψ yaw, the held one with its value and no rate (rad); ω in the body (rad/s). JᵀIJ is singular only where roll and yaw are
//! the same turn (θ = ±90°), which a scene with these two free may not hold. Source: see [`super::reduced`].

use super::reduced::{Rails, Turning};
use super::{Turned, by_columns, cross, dot, place_handles, times};
use crate::lanes::{Moments, Number, f64x2};
use crate::model::{Part, Workspace};

pub(super) struct Gimbal {
    handles: Vec<[f64x2; 3]>,
    /// Sine and cosine of the angles at t = 0, which the held one keeps.
    held: [(f64, f64); 3],
}

/// The attitude at a state: what gaps and accelerations both need.
struct Attitude<T> {
    /// Sine and cosine of roll, tilt, yaw.
    roll: (T, T),
    tilt: (T, T),
    yaw: (T, T),
    /// Rates of roll, tilt, yaw; zero for the held one.
    rates: [T; 3],
}

impl<T: Number> Attitude<T> {
    #[inline(always)]
    fn rows(&self) -> [[T; 3]; 3] {
        let ((sr, cr), (st, ct), (sy, cy)) = (self.roll, self.tilt, self.yaw);
        [
            [cy * ct, cy * st * sr - sy * cr, cy * st * cr + sy * sr],
            [sy * ct, sy * st * sr + cy * cr, sy * st * cr - cy * sr],
            [-st, ct * sr, ct * cr],
        ]
    }

    #[inline(always)]
    fn columns(&self) -> [[T; 3]; 3] {
        let ((sr, cr), (st, ct)) = (self.roll, self.tilt);
        let (zero, one) = (T::splat(0.0), T::splat(1.0));
        [[one, zero, zero], [zero, cr, -sr], [-st, ct * sr, ct * cr]]
    }

    #[inline(always)]
    fn spin(&self) -> [T; 3] {
        by_columns(self.columns(), self.rates)
    }

    #[inline(always)]
    fn drag(&self) -> [T; 3] {
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
    fn angle<T: Number>(&self, a: usize, rails: &Rails, y: &[T]) -> (T, T) {
        match rails.place[3 + a] {
            Some(p) => Number::sin_cos(y[p]),
            None => (T::splat(self.held[a].0), T::splat(self.held[a].1)),
        }
    }

    #[inline(always)]
    fn attitude<T: Number>(&self, rails: &Rails, y: &[T]) -> Attitude<T> {
        Attitude {
            roll: self.angle(0, rails, y),
            tilt: self.angle(1, rails, y),
            yaw: self.angle(2, rails, y),
            rates: [rails.rate(3, y), rails.rate(4, y), rails.rate(5, y)],
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
    fn gaps<N: Moments>(
        &self,
        rails: &Rails,
        y: &[N::Each],
        motion: [[N::Each; 3]; 2],
        w: &mut Workspace<N>,
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
            &Turned::new(w.rotation, w.spin),
        );
    }

    #[inline(always)]
    fn accelerate<N: Moments>(
        &self,
        rails: &Rails,
        torque: [N::Each; 3],
        y: &[N::Each],
        w: &Workspace<N>,
        dy: &mut [N::Each],
    ) {
        let at = self.attitude(rails, y);
        let (j, spin) = (at.columns(), w.spin);
        let gyro = cross(spin, times(&rails.inertia, spin));
        let drag = times(&rails.inertia, at.drag());
        let mut left = by_columns(w.rotation, torque);
        for a in 0..3 {
            left[a] = left[a] + w.body_torque[a] - gyro[a] - drag[a];
        }
        let mut free = (0..3).filter_map(|a| rails.place[3 + a].map(|p| (j[a], rails.free + p)));
        if let (Some((a, pa)), Some((b, pb))) = (free.next(), free.next()) {
            let (ia, ib) = (times(&rails.inertia, a), times(&rails.inertia, b));
            let (aa, ab, bb) = (dot(a, ia), dot(a, ib), dot(b, ib));
            let (la, lb) = (dot(a, left), dot(b, left));
            let scale = N::Each::splat(1.0) / (aa * bb - ab * ab);
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

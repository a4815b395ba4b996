//! Two free angles.
//!
//! ```text
//! ω = q̇_a J_a + q̇_b J_b        J̇q̇ = q̇_a q̇_b J_b × J_a        (JᵀIJ) q̈ = Jᵀ (τ − ω × Iω − I J̇q̇)
//! J_φ = e_x        J_θ = Rᵀ (−sin ψ, cos ψ, 0) = (0, cos φ, −sin φ)        J_ψ = Rᵀ e_z
//! ```
//! φ roll, θ tilt, ψ yaw (rad); a and b the free ones of them, in this order, the third held; J_k the axis about which angle k turns and ω the
//! angular velocity, both in the body. A later axis is carried along by no earlier angle, so in the body it turns with −q̇_a J_a. JᵀIJ is singular only
//! where roll and yaw are the same turn (θ = ±90°), which a scene with these two free may not hold. Source: see [`super::reduced`].

use super::reduced::{Rails, Turning};
use super::{Turned, by_columns, cross, dot, place_handles, times};
use crate::lanes::{Moments, Number, f64x2};
use crate::model::workspace::{Part, Workspace};

pub(super) struct Gimbal {
    handles: Vec<[f64x2; 3]>,
    /// Sine and cosine of the angles at t = 0, which the held one keeps.
    held: [(f64, f64); 3],
    /// The free angles: 0, 1, 2 for roll, tilt, yaw.
    free: [usize; 2],
}

impl Gimbal {
    #[inline(always)]
    fn angle<T: Number>(&self, a: usize, rails: &Rails, y: &[T]) -> (T, T) {
        match rails.place[3 + a] {
            Some(p) => Number::sin_cos(y[p]),
            None => (T::splat(self.held[a].0), T::splat(self.held[a].1)),
        }
    }

    /// Rows of the rotation.
    #[inline(always)]
    fn rows<T: Number>(&self, rails: &Rails, y: &[T]) -> [[T; 3]; 3] {
        let (sr, cr) = self.angle(0, rails, y);
        let (st, ct) = self.angle(1, rails, y);
        let (sy, cy) = self.angle(2, rails, y);
        [
            [cy * ct, cy * st * sr - sy * cr, cy * st * cr + sy * sr],
            [sy * ct, sy * st * sr + cy * cr, sy * st * cr - cy * sr],
            [-st, ct * sr, ct * cr],
        ]
    }

    /// J_a and J_b, by the rows of the rotation: no sine is taken twice.
    #[inline(always)]
    fn axes<T: Number>(&self, rows: &[[T; 3]; 3]) -> [[T; 3]; 2] {
        let (zero, one) = (T::splat(0.0), T::splat(1.0));
        let (roll, yaw) = ([one, zero, zero], rows[2]);
        match self.free {
            [0, 1] => {
                let (sin, cos) = self.held[2];
                let tilt = [
                    zero,
                    rows[1][1] * cos - rows[0][1] * sin,
                    rows[1][2] * cos - rows[0][2] * sin,
                ];
                [roll, tilt]
            }
            [0, _] => [roll, yaw],
            _ => {
                let (sin, cos) = self.held[0];
                [[zero, T::splat(cos), T::splat(-sin)], yaw]
            }
        }
    }

    /// Rates of the free angles.
    #[inline(always)]
    fn rates<T: Number>(&self, rails: &Rails, y: &[T]) -> [T; 2] {
        let [a, b] = self.free;
        [rails.rate(3 + a, y), rails.rate(3 + b, y)]
    }
}

/// q̇_a J_a + q̇_b J_b
#[inline(always)]
fn spin<T: Number>([a, b]: [[T; 3]; 2], [rate_a, rate_b]: [T; 2]) -> [T; 3] {
    [
        a[0] * rate_a + b[0] * rate_b,
        a[1] * rate_a + b[1] * rate_b,
        a[2] * rate_a + b[2] * rate_b,
    ]
}

/// J̇q̇
#[inline(always)]
fn drag<T: Number>([a, b]: [[T; 3]; 2], [rate_a, rate_b]: [T; 2]) -> [T; 3] {
    let (both, [x, y, z]) = (rate_a * rate_b, cross(b, a));
    [x * both, y * both, z * both]
}

impl Turning for Gimbal {
    fn new(rails: &Rails, handles: Vec<[f64x2; 3]>) -> Self {
        let is_free = [0, 1, 2].map(|a| rails.place[3 + a].is_some());
        Self {
            handles,
            held: [3, 4, 5].map(|c| rails.held[c].sin_cos()),
            free: match is_free {
                [true, true, _] => [0, 1],
                [true, ..] => [0, 2],
                _ => [1, 2],
            },
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
        w.rotation = self.rows(rails, y);
        w.spin = spin(self.axes(&w.rotation), self.rates(rails, y));
        let turned = Turned::new(w.rotation, w.spin);
        place_handles(&mut w.pair, &self.handles, part, motion, &turned);
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
        let (axes, spin) = (self.axes(&w.rotation), w.spin);
        let gyro = cross(spin, times(&rails.inertia, spin));
        let drag = times(&rails.inertia, drag(axes, self.rates(rails, y)));
        let mut left = by_columns(w.rotation, torque);
        for k in 0..3 {
            left[k] = left[k] + w.body_torque[k] - gyro[k] - drag[k];
        }
        let places = (rails.place[3 + self.free[0]], rails.place[3 + self.free[1]]);
        if let (Some(place_a), Some(place_b)) = places {
            let [a, b] = axes;
            let (ia, ib) = (times(&rails.inertia, a), times(&rails.inertia, b));
            let (aa, ab, bb) = (dot(a, ia), dot(a, ib), dot(b, ib));
            let (la, lb) = (dot(a, left), dot(b, left));
            let scale = N::Each::splat(1.0) / (aa * bb - ab * ab);
            dy[rails.free + place_a] = (bb * la - ab * lb) * scale;
            dy[rails.free + place_b] = (aa * lb - ab * la) * scale;
        }
    }

    fn columns_and_drag(&self, rails: &Rails, y: &[f64]) -> ([[f64; 3]; 3], [f64; 3]) {
        let axes = self.axes(&self.rows(rails, y));
        let mut columns = [[0.0; 3]; 3];
        for (a, axis) in self.free.into_iter().zip(axes) {
            columns[a] = axis;
        }
        (columns, drag(axes, self.rates(rails, y)))
    }
}

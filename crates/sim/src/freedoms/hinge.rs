//! One free angle, or none: the body turns about an axis that stands still, in the body and in the world.
//!
//! ```text
//! ω = θ̇ j        R p = a + b cos θ + c sin θ,   a = n (n·P),  b = P − a,  c = n × P,  P = R₀ p        (jᵀIj) θ̈ = n · Σ_i (R p_i) × F_i + j · τ
//! ```
//! θ the free angle (rad), R₀ the rotation with θ = 0 and the other two held; j its axis in the body, n = R₀ j in the world, both of unit length and
//! constant; τ torque beside that of the handle forces (N·m, body). ω × Iω has no part along j and J̇ = 0, so neither appears. Without a free angle
//! j = 0 and R p = P. Source: rotation about an axis, Rodrigues; equation: see [`super::reduced`].

use super::reduced::{Rails, Turning};
use super::{Arms, cross, dot, place_handles, times};
use crate::lanes::{Moments, Number, f64x2};
use crate::model::workspace::{Part, Workspace};
use nalgebra::{Rotation3, Vector3};

/// With n along the world's axis `AXIS` (0, 1, 2); any other number: anywhere.
pub(super) struct Hinge<const AXIS: usize> {
    /// Place of θ in the state.
    place: Option<usize>,
    /// j
    in_body: [f64; 3],
    /// n
    in_world: [f64; 3],
    /// 1/(jᵀIj)
    inverse_moment: f64,
    /// a, b and c of each pair of handles.
    handles: Vec<[[f64x2; 3]; 3]>,
    /// a, b and c of the body's axes: rows of the rotation.
    rotation: [[[f64; 3]; 3]; 3],
}

/// [`Hinge`] for an axis that lies askew.
pub(super) const ASKEW: usize = 3;

impl<const AXIS: usize> Turning for Hinge<AXIS> {
    fn new(rails: &Rails, handles: Vec<[f64x2; 3]>) -> Self {
        let free = (0..3).find(|a| rails.place[3 + a].is_some());
        let mut angles = [rails.held[3], rails.held[4], rails.held[5]];
        if let Some(a) = free {
            angles[a] = 0.0;
        }
        let ([roll, tilt, yaw], (st, ct)) = (angles, angles[1].sin_cos());
        let (sr, cr) = roll.sin_cos();
        let columns = [[1.0, 0.0, 0.0], [0.0, cr, -sr], [-st, ct * sr, ct * cr]];
        let in_body = free.map_or([0.0; 3], |a| columns[a]);
        let start = Rotation3::from_euler_angles(roll, tilt, yaw);
        let in_world: [f64; 3] = (start * Vector3::from(in_body)).into();
        let parts = |p: [f64; 3]| {
            let p: [f64; 3] = (start * Vector3::from(p)).into();
            let along = in_world.map(|n| n * dot(in_world, p));
            [
                along,
                [0, 1, 2].map(|a| p[a] - along[a]),
                cross(in_world, p),
            ]
        };
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(parts);
        let handles = handles.into_iter().map(|h| {
            let lane = |l: usize| parts(h.map(|x| x.as_array()[l]));
            let (first, second) = (lane(0), lane(1));
            [0, 1, 2].map(|k| [0, 1, 2].map(|a| f64x2::new([first[k][a], second[k][a]])))
        });
        Self {
            place: free.and_then(|a| rails.place[3 + a]),
            in_body,
            in_world,
            inverse_moment: free
                .map_or(0.0, |_| 1.0 / dot(in_body, times(&rails.inertia, in_body))),
            handles: handles.collect(),
            rotation: [0, 1, 2].map(|k| [0, 1, 2].map(|row| axes.map(|axis| axis[k][row]))),
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
        let number = N::Each::splat;
        let ((sin, cos), rate) = match self.place {
            Some(p) => (Number::sin_cos(y[p]), y[rails.free + p]),
            None => ((number(0.0), number(1.0)), number(0.0)),
        };
        let [jx, jy, jz] = self.in_body;
        w.spin = [rate * jx, rate * jy, rate * jz];
        let (sin, cos, rate) = (N::both(sin), N::both(cos), N::both(rate));
        let swung = Swung::<N, AXIS> { sin, cos, rate };
        place_handles(&mut w.pair, &self.handles, part, motion, &swung);
    }

    #[inline(always)]
    fn orient<N: Moments>(&self, y: &[N::Each], w: &mut Workspace<N>) {
        let number = N::Each::splat;
        let upright = (number(0.0), number(1.0));
        let (sin, cos) = self.place.map_or(upright, |p| Number::sin_cos(y[p]));
        let [a, b, c] = &self.rotation;
        for row in 0..3 {
            for column in 0..3 {
                w.rotation[row][column] =
                    cos * b[row][column] + a[row][column] + sin * c[row][column];
            }
        }
    }

    #[inline(always)]
    fn accelerate<N: Moments>(
        &self,
        rails: &Rails,
        torque: [N::Each; 3],
        _y: &[N::Each],
        w: &Workspace<N>,
        dy: &mut [N::Each],
    ) {
        if let Some(p) = self.place {
            let along = match AXIS {
                ASKEW.. => part_along(torque, self.in_world),
                axis => torque[axis],
            };
            let turned = along + part_along(w.body_torque, self.in_body);
            dy[rails.free + p] = turned * self.inverse_moment;
        }
    }

    fn columns_and_drag(&self, _rails: &Rails, _y: &[f64]) -> ([[f64; 3]; 3], [f64; 3]) {
        ([self.in_body; 3], [0.0; 3])
    }
}

/// v · n
#[inline(always)]
fn part_along<T: Number>(v: [T; 3], n: [f64; 3]) -> T {
    v[0] * n[0] + v[1] * n[1] + v[2] * n[2]
}

/// A body at an angle of a hinge.
struct Swung<N: Moments, const AXIS: usize> {
    sin: N::Pair,
    cos: N::Pair,
    /// rad/s
    rate: N::Pair,
}

impl<N: Moments, const AXIS: usize> Arms<N> for Swung<N, AXIS> {
    type Handle = [[f64x2; 3]; 3];
    #[inline(always)]
    fn of(&self, [a, b, c]: &[[f64x2; 3]; 3]) -> [[N::Pair; 3]; 2] {
        let still = N::Pair::splat(0.0);
        let (mut arm, mut arm_rate) = ([still; 3], [still; 3]);
        for k in 0..3 {
            let along = N::always(a[k]);
            if k == AXIS {
                arm[k] = along;
            } else {
                let (b, c) = (N::always(b[k]), N::always(c[k]));
                arm[k] = c.madd(self.sin, b.madd(self.cos, along));
                arm_rate[k] = b.nmadd(self.sin, c * self.cos) * self.rate;
            }
        }
        [arm, arm_rate]
    }
}

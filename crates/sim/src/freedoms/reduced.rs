//! Fewer than six freedoms: the equations of the same body with the other coordinates held.
//!
//! ```text
//! q = (x, y, z, φ roll, θ tilt, ψ yaw) without the held ones        R = R_z(ψ) R_y(θ) R_x(φ)        ω = J(φ, θ) (φ̇, θ̇, ψ̇)ᵀ
//! M r̈_a = F_a + M g_a        (JᵀIJ) θ̈ = Jᵀ (τ − ω × Iω − I J̇ θ̇)
//! ```
//! J holds the columns of the free angles; τ torque on the body in its axes (N·m). These are Lagrange's equations of the body with ideal
//! (workless) constraints, in Kane's form: the held coordinates cost nothing, neither states nor equations. A held coordinate keeps its
//! value at t = 0; a scene whose `start` moves along it is refused. With all three angles free the attitude stays a quaternion (`pinned.rs`), with
//! two it is a gimbal (`gimbal.rs`), with one or none a hinge (`hinge.rs`), so no choice of freedoms has a singular
//! attitude that motion can reach; roll and yaw alone need the held tilt away from ±90°, which the scene's check asks for.
//! Source: Landau & Lifshitz, *Mechanics*, §35 (Euler angles); Kane & Levinson, *Dynamics* (1985), ch. 6.

use super::{Coordinates, Freedoms, Pose, cross, dot, pull, times};
use crate::body::Body;
use crate::lanes::{Moments, Number, f64x2, pack, sum};
use crate::model::workspace::{All, Block, Pair, Part, Workspace};
use crate::scene::parts::Start;
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, UnitQuaternion, Vector3};
use std::ops::Range;

/// Which coordinates are free and where the others are held, and the body that they place.
pub(super) struct Rails {
    mass: f64,
    inverse_mass: f64,
    pub gravity: [f64; 3],
    pub inertia: Matrix3<f64>,
    /// Where the held coordinates are: x, y, z, roll, tilt, yaw.
    pub held: [f64; 6],
    /// Place among the positions of the state of each coordinate, or none.
    pub place: [Option<usize>; 6],
    /// How many are free.
    pub free: usize,
    /// The free ones of x, y, z, each with its place.
    translations: Vec<(usize, usize)>,
    names: Vec<&'static str>,
    scales: Vec<f64>,
}

const NAMES: [[&str; 2]; 6] = [
    ["x_m", "vx_m_per_s"],
    ["y_m", "vy_m_per_s"],
    ["z_m", "vz_m_per_s"],
    ["roll_rad", "roll_rate_rad_per_s"],
    ["tilt_rad", "tilt_rate_rad_per_s"],
    ["yaw_rad", "yaw_rate_rad_per_s"],
];

impl Rails {
    pub(super) fn new(body: &Body, free: [bool; 6], start: &Start, height_m: f64) -> Self {
        let mut place = [None; 6];
        let mut count = 0;
        for (p, is_free) in place.iter_mut().zip(free) {
            if is_free {
                *p = Some(count);
                count += 1;
            }
        }
        let listed = |which: usize| (0..6).filter(|&c| free[c]).map(move |c| NAMES[c][which]);
        let [roll, tilt, yaw] = start.roll_pitch_yaw_deg.map(f64::to_radians);
        let [x, y] = start.position_m;
        Self {
            mass: body.mass_kg,
            inverse_mass: 1.0 / body.mass_kg,
            translations: (0..3).filter_map(|c| place[c].map(|p| (c, p))).collect(),
            gravity: body.gravity_m_per_s2.into(),
            inertia: body.inertia_kg_m2,
            held: [x, y, height_m, roll, tilt, yaw],
            place,
            free: count,
            names: listed(0).chain(listed(1)).collect(),
            scales: std::iter::repeat_n(0.1, count)
                .chain(std::iter::repeat_n(1.0, count))
                .collect(),
        }
    }

    /// Coordinate c of x, y, z, roll, tilt, yaw.
    #[inline(always)]
    fn coordinate<T: Number>(&self, c: usize, y: &[T]) -> T {
        match self.place[c] {
            Some(p) => y[p],
            None => T::splat(self.held[c]),
        }
    }

    /// Its rate, from the state; its second derivative, from the state's rates.
    #[inline(always)]
    pub fn rate<T: Number>(&self, c: usize, y: &[T]) -> T {
        match self.place[c] {
            Some(p) => y[self.free + p],
            None => T::splat(0.0),
        }
    }
}

/// How up to two free angles turn the body.
pub(super) trait Turning: Send + Sync {
    /// For handles in body coordinates, packed two by two (m).
    fn new(rails: &Rails, handles: Vec<[f64x2; 3]>) -> Self;
    /// Fills `spin` of the workspace and places the handles; `motion` of the centre of mass as in [`super::place_handles`].
    fn gaps<N: Moments>(
        &self,
        rails: &Rails,
        y: &[N::Each],
        motion: [[N::Each; 3]; 2],
        w: &mut Workspace<N>,
        part: impl Part,
    );
    /// Fills `rotation` of the workspace, if `gaps` did not.
    fn orient<N: Moments>(&self, _y: &[N::Each], _w: &mut Workspace<N>) {}
    /// Writes the second derivatives of the free angles; `torque` of the handle forces in the world (N·m).
    fn accelerate<N: Moments>(
        &self,
        rails: &Rails,
        torque: [N::Each; 3],
        y: &[N::Each],
        w: &Workspace<N>,
        dy: &mut [N::Each],
    );
    /// Columns of J: what one rad/s of roll, of tilt, of yaw adds to ω; those of held angles are not read.
    /// And J̇ (φ̇, θ̇, ψ̇).
    fn columns_and_drag(&self, rails: &Rails, y: &[f64]) -> ([[f64; 3]; 3], [f64; 3]);
    /// The columns alone.
    fn columns(&self, rails: &Rails, y: &[f64]) -> [[f64; 3]; 3] {
        self.columns_and_drag(rails, y).0
    }
}

/// Up to two free angles and any translations: one state for each free coordinate, and one for its rate.
pub(super) struct Reduced<T> {
    rails: Rails,
    turning: T,
    /// In body coordinates, packed two by two, m.
    handles: Vec<[f64x2; 3]>,
}

impl<T: Turning> Reduced<T> {
    pub(super) fn new(rails: Rails, handles_m: &[[f64; 3]]) -> Self {
        let [x, y, z] = [0, 1, 2].map(|a| pack(handles_m.iter().map(|h| h[a])));
        let handles: Vec<_> = (0..x.len()).map(|p| [x[p], y[p], z[p]]).collect();
        Self {
            turning: T::new(&rails, handles.clone()),
            rails,
            handles,
        }
    }

    /// Rows of the rotation.
    fn rows(&self, y: &[f64]) -> [[f64; 3]; 3] {
        let [roll, tilt, yaw] = [3, 4, 5].map(|c| self.rails.coordinate(c, y));
        let turned = Rotation3::from_euler_angles(roll, tilt, yaw);
        [0, 1, 2].map(|row| [0, 1, 2].map(|column| turned[(row, column)]))
    }

    /// J (φ̇, θ̇, ψ̇), or with the rates of a state J (φ̈, θ̈, ψ̈).
    fn through(&self, j: [[f64; 3]; 3], rates_from: &[f64]) -> [f64; 3] {
        let rates = [3, 4, 5].map(|c| self.rails.rate(c, rates_from));
        [0, 1, 2].map(|a| (0..3).map(|k| j[k][a] * rates[k]).sum())
    }
}

impl<T: Turning> Coordinates for Reduced<T> {
    #[inline(always)]
    fn gaps_at<N: Moments>(&self, y: &[N::Each], w: &mut Workspace<N>, part: impl Part) {
        let rails = &self.rails;
        // One by one: a loop keeps them in memory.
        let position = [
            rails.coordinate(0, y),
            rails.coordinate(1, y),
            rails.coordinate(2, y),
        ];
        let velocity = [rails.rate(0, y), rails.rate(1, y), rails.rate(2, y)];
        let motion = [position, velocity];
        self.turning.gaps(rails, y, motion, w, part);
    }

    #[inline(always)]
    fn orient_at<N: Moments>(&self, y: &[N::Each], w: &mut Workspace<N>) {
        w.velocity = [0, 1, 2].map(|c| self.rails.rate(c, y));
        self.turning.orient(y, w);
    }

    #[inline(always)]
    fn rates_at<N: Moments>(&self, y: &[N::Each], w: &Workspace<N>, dy: &mut [N::Each]) {
        let (rails, n) = (&self.rails, self.rails.free);
        let [force, torque] = pull(&w.pair);
        // Three translations and two angles at most. Even a copy of one number would be a call.
        for k in 0..5 {
            if k < n {
                dy[k] = y[n + k];
            }
        }
        for c in 0..3 {
            if let Some(p) = rails.place[c] {
                dy[n + p] = force[c] * rails.inverse_mass + w.free_fall[c];
            }
        }
        self.turning.accelerate(rails, torque, y, w, dy);
    }
}

impl<T: Turning> Freedoms for Reduced<T> {
    fn size(&self) -> usize {
        2 * self.rails.free
    }

    fn names(&self) -> &[&'static str] {
        &self.rails.names
    }

    fn positions(&self) -> usize {
        self.rails.free
    }

    fn scales(&self) -> &[f64] {
        &self.rails.scales
    }

    fn damping_per_s(
        &self,
        y: &[f64],
        pairs: &[Pair],
        [sideways, vertical]: [&[f64x2]; 2],
        rates: &mut [f64],
    ) {
        let rails = &self.rails;
        let (rows, columns) = (self.rows(y), self.turning.columns(rails, y));
        let mut taken = [f64x2::ZERO; 6];
        let dampers = sideways.iter().zip(vertical);
        for ((p, handle), (sideways, vertical)) in pairs.iter().zip(&self.handles).zip(dampers) {
            for (axis, damping) in [sideways, sideways, vertical].into_iter().enumerate() {
                let acting = *damping * p.contact_gain;
                if let Some(v) = rails.place[axis] {
                    taken[v] += acting;
                }
                let arm = cross(*handle, rows[axis].map(f64x2::splat));
                for (column, place) in columns.iter().zip(&rails.place[3..]) {
                    if let Some(v) = *place {
                        let lever = dot(column.map(f64x2::splat), arm);
                        taken[v] += acting * lever * lever;
                    }
                }
            }
        }
        let inverse = self.inverse_masses(y);
        for (v, rate) in rates[rails.free..].iter_mut().enumerate() {
            *rate = sum(taken[v]) * inverse[v];
        }
    }

    fn place(&self, start: &Start, _height_m: f64, y: &mut [f64]) {
        let rails = &self.rails;
        for c in 0..6 {
            if let Some(p) = rails.place[c] {
                y[p] = rails.held[c];
                if c < 3 {
                    y[rails.free + p] = start.velocity_m_per_s[c];
                }
            }
        }
        // Angle rates that come nearest to the angular velocity asked for: exact where the free angles can have it.
        let angles: Vec<usize> = (0..3).filter(|&a| rails.place[3 + a].is_some()).collect();
        if !angles.is_empty() {
            let j = self.turning.columns(rails, y);
            let columns = DMatrix::from_fn(3, angles.len(), |row, k| j[angles[k]][row]);
            let wanted = DVector::from_row_slice(&start.angular_velocity_rad_per_s);
            let normal = columns.transpose() * &columns;
            if let Some(rates) = normal.lu().solve(&(columns.transpose() * wanted)) {
                for (k, &a) in angles.iter().enumerate() {
                    // OK because only angles with a place are listed.
                    y[rails.free + rails.place[3 + a].unwrap_or(0)] = rates[k];
                }
            }
        }
    }

    fn gaps(&self, y: &[f64], w: &mut Workspace) {
        self.gaps_at(y, w, All);
    }

    fn gaps_of(&self, y: &[f64], w: &mut Workspace, block: Block) {
        self.gaps_at(y, w, block);
    }

    fn orient(&self, y: &[f64], w: &mut Workspace) {
        self.orient_at(y, w);
    }

    fn accelerate(&self, y: &[f64], w: &mut Workspace, dy: &mut [f64]) {
        self.rates_at(y, w, dy);
    }

    fn attitude(&self) -> Range<usize> {
        self.rails.translations.len()..self.rails.free
    }

    fn levers(&self, y: &[f64], handle_m: [f64; 3], axis: usize) -> [f64; 6] {
        let rails = &self.rails;
        let mut levers = [0.0; 6];
        if let Some(p) = rails.place[axis] {
            levers[p] = 1.0;
        }
        let arm = cross(handle_m, self.rows(y)[axis]);
        let j = self.turning.columns(rails, y);
        for (column, place) in j.into_iter().zip(&rails.place[3..]) {
            if let Some(p) = *place {
                levers[p] = dot(column, arm);
            }
        }
        levers
    }

    fn inverse_masses(&self, y: &[f64]) -> [f64; 6] {
        let rails = &self.rails;
        let mut inverse = [0.0; 6];
        for &(_, p) in &rails.translations {
            inverse[p] = rails.inverse_mass;
        }
        let j = self.turning.columns(rails, y);
        for (column, place) in j.into_iter().zip(&rails.place[3..]) {
            if let Some(p) = *place {
                inverse[p] = 1.0 / dot(column, times(&rails.inertia, column));
            }
        }
        inverse
    }

    fn acceleration(&self, y: &[f64], dy: &[f64]) -> [[f64; 3]; 2] {
        let (j, drag) = self.turning.columns_and_drag(&self.rails, y);
        let along = self.through(j, dy);
        [
            [0, 1, 2].map(|c| self.rails.rate(c, dy)),
            [0, 1, 2].map(|a| along[a] + drag[a]),
        ]
    }

    fn spin_rad_per_s(&self, y: &[f64]) -> [f64; 3] {
        self.through(self.turning.columns(&self.rails, y), y)
    }

    fn pose(&self, y: &[f64]) -> Pose {
        let rails = &self.rails;
        let [roll, tilt, yaw] = [3, 4, 5].map(|c| rails.coordinate(c, y));
        let q = UnitQuaternion::from_euler_angles(roll, tilt, yaw);
        Pose {
            position_m: [0, 1, 2].map(|c| rails.coordinate(c, y)),
            orientation: [q.i, q.j, q.k, q.w],
            velocity_m_per_s: [0, 1, 2].map(|c| rails.rate(c, y)),
            spin_rad_per_s: self.spin_rad_per_s(y),
        }
    }

    fn project(&self, _y: &mut [f64]) {}

    fn drift(&self, h_s: f64, y: &mut [f64]) {
        for p in 0..self.rails.free {
            y[p] += h_s * y[self.rails.free + p];
        }
    }

    fn energy_j(&self, y: &[f64]) -> [f64; 2] {
        let rails = &self.rails;
        let v = Vector3::from([0, 1, 2].map(|c| rails.rate(c, y)));
        let spin = Vector3::from(self.spin_rad_per_s(y));
        let kinetic = 0.5 * (rails.mass * v.norm_squared() + spin.dot(&(rails.inertia * spin)));
        let place_m = [0, 1, 2].map(|c| rails.coordinate(c, y));
        [kinetic, -rails.mass * dot(rails.gravity, place_m)]
    }
}

//! Fewer than six freedoms: the equations of the same body with the other coordinates held.
//!
//! ```text
//! q = (x, y, z, φ roll, θ tilt, ψ yaw) without the held ones        R = R_z(ψ) R_y(θ) R_x(φ)        ω = J(φ, θ) (φ̇, θ̇, ψ̇)ᵀ
//! M r̈_a = F_a + M g_a        (JᵀIJ) θ̈ = Jᵀ (τ − ω × Iω − I J̇ θ̇)
//! ```
//! J holds the columns of the free angles: ω = (φ̇ − ψ̇ sin θ, θ̇ cos φ + ψ̇ cos θ sin φ, −θ̇ sin φ + ψ̇ cos θ cos φ) in the body [rad/s]; τ
//! torque on the body in its axes [N·m]. These are Lagrange's equations of the body with ideal (workless) constraints, in Kane's form: the held
//! coordinates cost nothing, neither states nor equations. A held coordinate keeps its value at t = 0; `start` velocities along it are
//! dropped. With all three angles free the attitude stays a quaternion ([`Pinned`]), so no choice of freedoms has a singular
//! attitude that motion can reach; roll and yaw alone need the held tilt away from ±90°, which the scene's check asks for.
//! Source: Landau & Lifshitz, *Mechanics*, §35 (Euler angles); Kane & Levinson, *Dynamics* (1985), ch. 6.

use super::{Freedoms, Pose, Six, times};
use crate::body::Body;
use crate::lanes::{f64x2, pack, sum};
use crate::model::Workspace;
use crate::scene::{Freedom, Start};
use nalgebra::{DMatrix, DVector, Matrix3, UnitQuaternion, Vector3};

/// The coordinates for a choice of freedoms.
pub fn choose(
    body: &Body,
    handles_m: &[[f64; 3]],
    free: &[Freedom],
    start: &Start,
    height_m: f64,
) -> Box<dyn Freedoms> {
    let is_free = Freedom::ALL.map(|f| free.contains(&f));
    let six = || Six::new(body, handles_m);
    match is_free {
        [true, true, true, true, true, true] => Box::new(six()),
        [x, y, z, true, true, true] => Box::new(Pinned {
            six: six(),
            free: [x, y, z],
        }),
        _ => Box::new(Reduced::new(body, handles_m, is_free, start, height_m)),
    }
}

/// Three free angles, some of the translations held: the attitude of [`Six`] with a centre of mass on rails.
pub struct Pinned {
    six: Six,
    free: [bool; 3],
}

impl Pinned {
    fn hold(&self, v: &mut [f64]) {
        for (v, free) in v.iter_mut().zip(self.free) {
            if !free {
                *v = 0.0;
            }
        }
    }
}

impl Freedoms for Pinned {
    fn size(&self) -> usize {
        self.six.size()
    }
    fn names(&self) -> &[&'static str] {
        self.six.names()
    }
    fn positions(&self) -> usize {
        self.six.positions()
    }
    fn place(&self, start: &Start, height_m: f64, y: &mut [f64]) {
        self.six.place(start, height_m, y);
        self.hold(&mut y[7..10]);
    }
    fn gaps(&self, y: &[f64], w: &mut Workspace) {
        self.six.gaps(y, w);
    }
    fn accelerate(&self, y: &[f64], w: &mut Workspace, dy: &mut [f64]) {
        self.six.accelerate(y, w, dy);
        self.hold(&mut dy[7..10]);
    }
    fn pose(&self, y: &[f64]) -> Pose {
        self.six.pose(y)
    }
    fn acceleration(&self, y: &[f64], dy: &[f64]) -> [[f64; 3]; 2] {
        self.six.acceleration(y, dy)
    }
    fn project(&self, y: &mut [f64]) {
        self.six.project(y);
    }
    fn drift(&self, h_s: f64, y: &mut [f64]) {
        self.six.drift(h_s, y);
    }
    fn energy_j(&self, y: &[f64]) -> [f64; 2] {
        self.six.energy_j(y)
    }
    fn scales(&self) -> &[f64] {
        self.six.scales()
    }
}

/// Up to two free angles and any translations: one state for each free coordinate, and one for its rate.
pub struct Reduced {
    handle: Vec<[f64x2; 3]>,
    mass: f64,
    gravity: [f64; 3],
    inertia: Matrix3<f64>,
    /// Where the held coordinates are: x, y, z, roll, tilt, yaw.
    held: [f64; 6],
    /// Sine and cosine of the held angles.
    turned: [(f64, f64); 3],
    /// Place among the positions of the state of each coordinate, or none.
    place: [Option<usize>; 6],
    free: usize,
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

/// The attitude at a state: what gaps and accelerations both need.
struct Attitude {
    /// Sine and cosine of roll, tilt, yaw.
    roll: (f64, f64),
    tilt: (f64, f64),
    /// Rates of roll, tilt, yaw; zero for held ones.
    rates: [f64; 3],
    yaw: (f64, f64),
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

    /// Columns of J: what one rad/s of roll, of tilt, of yaw adds to ω.
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

    /// J̇ (φ̇, θ̇, ψ̇)
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

impl Reduced {
    fn new(
        body: &Body,
        handles_m: &[[f64; 3]],
        free: [bool; 6],
        start: &Start,
        height_m: f64,
    ) -> Self {
        let [x, y, z] = [0, 1, 2].map(|a| pack(handles_m.iter().map(|h| h[a])));
        let [roll, tilt, yaw] = start.roll_pitch_yaw_deg.map(f64::to_radians);
        let mut place = [None; 6];
        let mut count = 0;
        for (p, is_free) in place.iter_mut().zip(free) {
            if is_free {
                *p = Some(count);
                count += 1;
            }
        }
        let listed = |which: usize| (0..6).filter(|&c| free[c]).map(move |c| NAMES[c][which]);
        Self {
            handle: (0..x.len()).map(|p| [x[p], y[p], z[p]]).collect(),
            mass: body.mass_kg,
            gravity: body.gravity_m_per_s2.into(),
            inertia: body.inertia_kg_m2,
            held: [
                start.position_m[0],
                start.position_m[1],
                height_m,
                roll,
                tilt,
                yaw,
            ],
            turned: [roll, tilt, yaw].map(f64::sin_cos),
            place,
            free: count,
            names: listed(0).chain(listed(1)).collect(),
            scales: std::iter::repeat_n(0.1, count)
                .chain(std::iter::repeat_n(1.0, count))
                .collect(),
        }
    }

    #[inline(always)]
    fn coordinate(&self, c: usize, y: &[f64]) -> f64 {
        self.place[c].map_or(self.held[c], |p| y[p])
    }

    #[inline(always)]
    fn rate(&self, c: usize, y: &[f64]) -> f64 {
        self.place[c].map_or(0.0, |p| y[self.free + p])
    }

    #[inline(always)]
    fn attitude(&self, y: &[f64]) -> Attitude {
        let angle = |a: usize| self.place[3 + a].map_or(self.turned[a], |p| sin_cos(y[p]));
        Attitude {
            roll: angle(0),
            tilt: angle(1),
            yaw: angle(2),
            rates: [3, 4, 5].map(|c| self.rate(c, y)),
        }
    }
}

/// Of one angle, in one lane: half the instructions of libm's.
#[inline(always)]
fn sin_cos(x: f64) -> (f64, f64) {
    let (s, c) = crate::lanes::sin_cos(f64x2::splat(x));
    (s.to_array()[0], c.to_array()[0])
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

impl Freedoms for Reduced {
    fn size(&self) -> usize {
        2 * self.free
    }

    fn names(&self) -> &[&'static str] {
        &self.names
    }

    fn positions(&self) -> usize {
        self.free
    }

    fn scales(&self) -> &[f64] {
        &self.scales
    }

    fn place(&self, start: &Start, _height_m: f64, y: &mut [f64]) {
        for c in 0..6 {
            if let Some(p) = self.place[c] {
                y[p] = self.held[c];
                if c < 3 {
                    y[self.free + p] = start.velocity_m_per_s[c];
                }
            }
        }
        // Angle rates that come nearest to the angular velocity asked for: exact where the free angles can have it.
        let angles: Vec<usize> = (0..3).filter(|&a| self.place[3 + a].is_some()).collect();
        if !angles.is_empty() {
            let j = self.attitude(&y[..2 * self.free]).columns();
            let columns = DMatrix::from_fn(3, angles.len(), |row, k| j[angles[k]][row]);
            let wanted = DVector::from_row_slice(&start.angular_velocity_rad_per_s);
            let normal = columns.transpose() * &columns;
            if let Some(rates) = normal.lu().solve(&(columns.transpose() * wanted)) {
                for (k, &a) in angles.iter().enumerate() {
                    // OK because only angles with a place are listed.
                    y[self.free + self.place[3 + a].unwrap_or(0)] = rates[k];
                }
            }
        }
    }

    fn gaps(&self, y: &[f64], w: &mut Workspace) {
        let at = self.attitude(y);
        let r = at.rows();
        let spin = at.spin();
        w.spin = spin;
        w.rotation = r;
        let world = r.map(|row| f64x2::splat(dot(row, spin)));
        let rows = r.map(|row| row.map(f64x2::splat));
        let position = [0, 1, 2].map(|c| f64x2::splat(self.coordinate(c, y)));
        let velocity = [0, 1, 2].map(|c| f64x2::splat(self.rate(c, y)));
        for (p, h) in w.pair.iter_mut().zip(&self.handle) {
            let arm = rows.map(|row| row[0] * h[0] + row[1] * h[1] + row[2] * h[2]);
            let arm_rate = [
                world[1] * arm[2] - world[2] * arm[1],
                world[2] * arm[0] - world[0] * arm[2],
                world[0] * arm[1] - world[1] * arm[0],
            ];
            for a in 0..3 {
                p.arm[a] = arm[a];
                p.gap[a] = p.base[a] - position[a] - arm[a];
                p.gap_rate[a] = p.base_rate[a] - velocity[a] - arm_rate[a];
            }
        }
    }

    fn accelerate(&self, y: &[f64], w: &mut Workspace, dy: &mut [f64]) {
        let zero = f64x2::ZERO;
        let (mut force, mut torque) = ([zero; 3], [zero; 3]);
        for p in &w.pair {
            let ([fx, fy], fz, [ax, ay, az]) = (p.tangential, p.normal, p.arm);
            force[0] += fx;
            force[1] += fy;
            force[2] += fz;
            torque[0] += ay * fz - az * fy;
            torque[1] += az * fx - ax * fz;
            torque[2] += ax * fy - ay * fx;
        }
        let n = self.free;
        dy[..n].copy_from_slice(&y[n..2 * n]);
        for c in 0..3 {
            if let Some(p) = self.place[c] {
                dy[n + p] = sum(force[c]) / self.mass + self.gravity[c];
            }
        }
        let angles = [3, 4, 5].map(|c| self.place[c]);
        if angles == [None; 3] {
            return;
        }
        let (t, r) = (torque.map(sum), &w.rotation);
        let at = self.attitude(y);
        let (j, spin) = (at.columns(), w.spin);
        let gyro = cross(spin, times(&self.inertia, spin));
        let drag = times(&self.inertia, at.drag());
        let left = [0, 1, 2].map(|a| {
            let in_body = r[0][a] * t[0] + r[1][a] * t[1] + r[2][a] * t[2] + w.body_torque[a];
            in_body - gyro[a] - drag[a]
        });
        let mut free = (0..3).filter_map(|a| angles[a].map(|p| (j[a], p)));
        // One or two free angles: three are `Pinned` or `Six`.
        match (free.next(), free.next()) {
            (Some((a, p)), None) => dy[n + p] = dot(a, left) / dot(a, times(&self.inertia, a)),
            (Some((a, pa)), Some((b, pb))) => {
                let (ia, ib) = (times(&self.inertia, a), times(&self.inertia, b));
                let (aa, ab, bb) = (dot(a, ia), dot(a, ib), dot(b, ib));
                let (la, lb) = (dot(a, left), dot(b, left));
                let scale = 1.0 / (aa * bb - ab * ab);
                dy[n + pa] = (bb * la - ab * lb) * scale;
                dy[n + pb] = (aa * lb - ab * la) * scale;
            }
            _ => {}
        }
    }

    fn acceleration(&self, y: &[f64], dy: &[f64]) -> [[f64; 3]; 2] {
        let at = self.attitude(y);
        let (j, drag) = (at.columns(), at.drag());
        let second = |c: usize| self.place[c].map_or(0.0, |p| dy[self.free + p]);
        let angular = [0, 1, 2]
            .map(|a| j[0][a] * second(3) + j[1][a] * second(4) + j[2][a] * second(5) + drag[a]);
        [[0, 1, 2].map(second), angular]
    }

    fn pose(&self, y: &[f64]) -> Pose {
        let [roll, tilt, yaw] = [3, 4, 5].map(|c| self.coordinate(c, y));
        let q = UnitQuaternion::from_euler_angles(roll, tilt, yaw);
        Pose {
            position_m: [0, 1, 2].map(|c| self.coordinate(c, y)),
            orientation: [q.i, q.j, q.k, q.w],
            velocity_m_per_s: [0, 1, 2].map(|c| self.rate(c, y)),
            spin_rad_per_s: self.attitude(y).spin(),
        }
    }

    fn project(&self, _y: &mut [f64]) {}

    fn drift(&self, h_s: f64, y: &mut [f64]) {
        for p in 0..self.free {
            y[p] += h_s * y[self.free + p];
        }
    }

    fn energy_j(&self, y: &[f64]) -> [f64; 2] {
        let pose = self.pose(y);
        let (v, spin) = (
            Vector3::from(pose.velocity_m_per_s),
            Vector3::from(pose.spin_rad_per_s),
        );
        let kinetic = 0.5 * (self.mass * v.norm_squared() + spin.dot(&(self.inertia * spin)));
        [kinetic, -self.mass * dot(self.gravity, pose.position_m)]
    }
}

//! The body's coordinates: how a state places the handles, and what forces do to it.

mod choose;
mod gimbal;
mod hinge;
mod pinned;
mod reduced;

pub use choose::choose;

use crate::body::Body;
#[cfg(target_arch = "x86_64")]
use crate::lanes::{Avx2, Avx512, FusedEach};
use crate::lanes::{Eight, Moments, Number, Plain8, Slope, Slopes, f64x2, pack, sum};
use crate::model::workspace::{All, Block, Pair, Part, Workspace};
use crate::scene::Scene;
use crate::scene::parts::{Freedom, Start};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use std::ops::Range;

/// Where the body is and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Centre of mass in the world, m.
    pub position_m: [f64; 3],
    /// Body → world, (x, y, z, w), unit.
    pub orientation: [f64; 4],
    /// Velocity in the world, m/s.
    pub velocity_m_per_s: [f64; 3],
    /// Angular velocity in the body, rad/s.
    pub spin_rad_per_s: [f64; 3],
}

/// The angle `x`, by whole turns as near as can be to `near`, rad: half a turn away at most.
pub fn nearest_turn(x: f64, near: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    x - turn * ((x - near) / turn).round()
}

impl Pose {
    /// Roll, pitch, yaw of R = R_z(yaw) R_y(pitch) R_x(roll), rad (REP-103). At pitch = ±90° roll and yaw are not unique:
    /// yaw is then 0 and roll takes the whole turn.
    pub fn roll_pitch_yaw_rad(&self) -> [f64; 3] {
        let [x, y, z, w] = self.orientation;
        let sin_pitch = 2.0 * (w * y - x * z);
        let level = 1.0 - 2.0 * (y * y + z * z);
        let across = 2.0 * (x * y + w * z);
        let cos_pitch = (level * level + across * across).sqrt();
        let pitch = sin_pitch.atan2(cos_pitch);
        if cos_pitch < 1e-9 {
            // ±90°: q = R_z(yaw) R_y(±90°) R_x(roll) depends on roll ∓ yaw only.
            let turn = 2.0 * x.atan2(w);
            return [nearest_turn(turn, 0.0), pitch, 0.0];
        }
        [self.level_roll_rad(), pitch, across.atan2(level)]
    }

    /// The first of [`Self::roll_pitch_yaw_rad`] alone, rad.
    pub fn roll_rad(&self) -> f64 {
        let [x, y, z, w] = self.orientation;
        // Near ±90° of pitch roll takes yaw's turn too.
        if (w * y - x * z).abs() > 0.499 {
            return self.roll_pitch_yaw_rad()[0];
        }
        self.level_roll_rad()
    }

    fn level_roll_rad(&self) -> f64 {
        let [x, y, z, w] = self.orientation;
        (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y))
    }
}

/// The velocities with which a scene starts, m/s (world) and rad/s (body), as its freedoms take them; `None` where they take all.
pub(crate) fn start_velocities(scene: &Scene) -> Option<[[f64; 3]; 2]> {
    let body = Body::new(&scene.body).ok()?;
    if Freedom::ALL.iter().all(|f| scene.freedom.contains(f)) {
        return None;
    }
    let freedoms = choose(&body, &[], &scene.freedom, &scene.start, 0.0);
    let mut y = vec![0.0; freedoms.size()];
    freedoms.place(&scene.start, 0.0, &mut y);
    let pose = freedoms.pose(&y);
    Some([pose.velocity_m_per_s, pose.spin_rad_per_s])
}

/// A choice of coordinates for the body.
pub trait Freedoms: FreedomsOnEight + Send + Sync {
    /// How many states it needs.
    fn size(&self) -> usize;
    /// Their names, with units.
    fn names(&self) -> &[&'static str];
    /// How many of them, from the front, are positions rather than velocities.
    fn positions(&self) -> usize;
    /// Puts the body where a scene starts.
    fn place(&self, start: &Start, height_m: f64, y: &mut [f64]);
    /// Fills `arm`, `gap`, `gap_rate` and `spin` of the workspace, and `rotation` where that is on the way.
    fn gaps(&self, y: &[f64], w: &mut Workspace);
    /// The same for the handles of a block alone.
    fn gaps_of(&self, y: &[f64], w: &mut Workspace, block: Block);
    /// Fills `velocity` of the workspace, and `rotation` where [`Self::gaps`] did not.
    fn orient(&self, y: &[f64], w: &mut Workspace);
    /// Writes the derivatives of the body's states from the forces in the workspace.
    fn accelerate(&self, y: &[f64], w: &mut Workspace, dy: &mut [f64]);
    /// Which of the positions are angles or a quaternion.
    fn attitude(&self) -> Range<usize>;
    /// How fast each velocity, of which there are six at most, moves a handle (body coordinates, m) along one of the world's axes.
    fn levers(&self, y: &[f64], handle_m: [f64; 3], axis: usize) -> [f64; 6];
    /// The inverse mass or moment that belongs to each velocity, 1/kg or 1/(kg·m²); products are left out.
    fn inverse_masses(&self, y: &[f64]) -> [f64; 6];
    /// Angular velocity in the body at a state, rad/s.
    fn spin_rad_per_s(&self, y: &[f64]) -> [f64; 3];
    /// The pose at a state.
    fn pose(&self, y: &[f64]) -> Pose;
    /// From a state and its rates: acceleration of the centre of mass in the world [m/s²], angular acceleration in the body [rad/s²].
    fn acceleration(&self, y: &[f64], dy: &[f64]) -> [[f64; 3]; 2];
    /// Puts a state back on its manifold after a step.
    fn project(&self, y: &mut [f64]);
    /// Moves the positions by `h_s` with the velocities in `y` held (the drift of a splitting method).
    fn drift(&self, h_s: f64, y: &mut [f64]);
    /// Kinetic energy and potential energy in the field of gravity, J.
    fn energy_j(&self, y: &[f64]) -> [f64; 2];
    /// Where in the state a unit quaternion (x, y, z, w) and its angular velocity in the body begin, if there is one.
    fn rotation(&self) -> Option<[usize; 2]> {
        None
    }
    /// What counts as one unit of each state in an error norm.
    fn scales(&self) -> &[f64];
    /// −∂v̇/∂v of each velocity, 1/s, that dampers at the handles (N·s/m, sideways and vertical) make where `contact_gain` lets them act.
    fn damping_per_s(&self, y: &[f64], pairs: &[Pair], damping: [&[f64x2]; 2], rates: &mut [f64]);
}

/// Coordinates written for any number of moments.
pub(crate) trait Coordinates: Send + Sync {
    /// As [`Freedoms::gaps`], of some of the handles.
    fn gaps_at<N: Moments>(&self, y: &[N::Each], w: &mut Workspace<N>, part: impl Part);
    /// As [`Freedoms::orient`].
    fn orient_at<N: Moments>(&self, y: &[N::Each], w: &mut Workspace<N>);
    /// As [`Freedoms::accelerate`].
    fn rates_at<N: Moments>(&self, y: &[N::Each], w: &Workspace<N>, dy: &mut [N::Each]);
}

/// [`Freedoms::gaps`] and [`Freedoms::accelerate`] by fused arithmetic ([`crate::lanes`]), at eight moments for each kind of registers, and with
/// derivatives: see [`crate::model::OnEight`].
#[allow(missing_docs)]
pub trait FreedomsOnEight {
    /// # Safety
    /// The processor has AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    unsafe fn gaps_fused(&self, y: &[f64], w: &mut Workspace);
    /// # Safety
    /// The processor has AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    unsafe fn gaps_of_fused(&self, y: &[f64], w: &mut Workspace, block: Block);
    /// # Safety
    /// The processor has AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    unsafe fn accelerate_fused(&self, y: &[f64], w: &Workspace, dy: &mut [f64]);
    fn gaps_slopes(&self, y: &[Slope], w: &mut Workspace<Slopes>);
    fn orient_slopes(&self, y: &[Slope], w: &mut Workspace<Slopes>);
    fn rates_slopes(&self, y: &[Slope], w: &Workspace<Slopes>, dy: &mut [Slope]);
    fn gaps_plain(&self, y: &[Plain8], w: &mut Workspace<Eight<Plain8>>);
    fn orient_plain(&self, y: &[Plain8], w: &mut Workspace<Eight<Plain8>>);
    fn rates_plain(&self, y: &[Plain8], w: &Workspace<Eight<Plain8>>, dy: &mut [Plain8]);
    /// # Safety
    /// The processor has AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    unsafe fn gaps_avx2(&self, y: &[Avx2], w: &mut Workspace<Eight<Avx2>>);
    /// # Safety
    /// The processor has AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    unsafe fn orient_avx2(&self, y: &[Avx2], w: &mut Workspace<Eight<Avx2>>);
    /// # Safety
    /// The processor has AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    unsafe fn rates_avx2(&self, y: &[Avx2], w: &Workspace<Eight<Avx2>>, dy: &mut [Avx2]);
    /// # Safety
    /// The processor has AVX-512 F and DQ.
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    unsafe fn gaps_avx512(&self, y: &[Avx512], w: &mut Workspace<Eight<Avx512>>);
    /// # Safety
    /// The processor has AVX-512 F and DQ.
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    unsafe fn orient_avx512(&self, y: &[Avx512], w: &mut Workspace<Eight<Avx512>>);
    /// # Safety
    /// The processor has AVX-512 F and DQ.
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    unsafe fn rates_avx512(&self, y: &[Avx512], w: &Workspace<Eight<Avx512>>, dy: &mut [Avx512]);
}

impl<T: Coordinates> FreedomsOnEight for T {
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    #[allow(unsafe_code)]
    unsafe fn gaps_fused(&self, y: &[f64], w: &mut Workspace) {
        self.gaps_at(FusedEach::all(y), w.fused(), All);
    }
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    #[allow(unsafe_code)]
    unsafe fn gaps_of_fused(&self, y: &[f64], w: &mut Workspace, block: Block) {
        self.gaps_at(FusedEach::all(y), w.fused(), block);
    }
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    #[allow(unsafe_code)]
    unsafe fn accelerate_fused(&self, y: &[f64], w: &Workspace, dy: &mut [f64]) {
        self.rates_at(FusedEach::all(y), w.as_fused(), FusedEach::all_mut(dy));
    }
    fn gaps_slopes(&self, y: &[Slope], w: &mut Workspace<Slopes>) {
        self.gaps_at(y, w, All);
    }
    fn orient_slopes(&self, y: &[Slope], w: &mut Workspace<Slopes>) {
        self.orient_at(y, w);
    }
    fn rates_slopes(&self, y: &[Slope], w: &Workspace<Slopes>, dy: &mut [Slope]) {
        self.rates_at(y, w, dy);
    }
    fn gaps_plain(&self, y: &[Plain8], w: &mut Workspace<Eight<Plain8>>) {
        self.gaps_at(y, w, All);
    }
    fn orient_plain(&self, y: &[Plain8], w: &mut Workspace<Eight<Plain8>>) {
        self.orient_at(y, w);
    }
    fn rates_plain(&self, y: &[Plain8], w: &Workspace<Eight<Plain8>>, dy: &mut [Plain8]) {
        self.rates_at(y, w, dy);
    }
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    #[allow(unsafe_code)]
    unsafe fn gaps_avx2(&self, y: &[Avx2], w: &mut Workspace<Eight<Avx2>>) {
        self.gaps_at(y, w, All);
    }
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    #[allow(unsafe_code)]
    unsafe fn orient_avx2(&self, y: &[Avx2], w: &mut Workspace<Eight<Avx2>>) {
        self.orient_at(y, w);
    }
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    #[allow(unsafe_code)]
    unsafe fn rates_avx2(&self, y: &[Avx2], w: &Workspace<Eight<Avx2>>, dy: &mut [Avx2]) {
        self.rates_at(y, w, dy);
    }
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512dq")]
    #[allow(unsafe_code)]
    unsafe fn gaps_avx512(&self, y: &[Avx512], w: &mut Workspace<Eight<Avx512>>) {
        self.gaps_at(y, w, All);
    }
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512dq")]
    #[allow(unsafe_code)]
    unsafe fn orient_avx512(&self, y: &[Avx512], w: &mut Workspace<Eight<Avx512>>) {
        self.orient_at(y, w);
    }
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512dq")]
    #[allow(unsafe_code)]
    unsafe fn rates_avx512(&self, y: &[Avx512], w: &Workspace<Eight<Avx512>>, dy: &mut [Avx512]) {
        self.rates_at(y, w, dy);
    }
}

/// All six freedoms: r (world), q = (x, y, z, w) body → world, v (world), ω (body); 13 states.
///
/// ```text
/// ṙ = v      q̇ = ½ q ∘ (ω, 0)      M v̇ = Σ F_i + M g      I ω̇ = Σ p_i × RᵀF_i + τ − ω × I ω
/// ```
/// Source: paper, section 3.4; Murray, Li, Sastry (1994), ch. 4. A quaternion off the unit sphere (within a step) is read
/// as the rotation of q/|q|, which leaves the order of every Runge–Kutta method untouched.
pub struct Six {
    handle: Vec<[f64x2; 3]>,
    mass: f64,
    inverse_mass: f64,
    gravity: [f64; 3],
    inertia: Tensor,
    inverse_inertia: Tensor,
}

/// A symmetric tensor; without products it costs a third.
#[derive(Clone, Copy, Debug)]
struct Tensor {
    /// xx, yy, zz
    moments: [f64; 3],
    /// yz, xz, xy
    products: [f64; 3],
    diagonal: bool,
}

impl Tensor {
    fn new(m: &Matrix3<f64>) -> Self {
        let products = [m[(1, 2)], m[(0, 2)], m[(0, 1)]];
        Self {
            moments: [m[(0, 0)], m[(1, 1)], m[(2, 2)]],
            products,
            diagonal: products == [0.0; 3],
        }
    }

    #[inline(always)]
    fn times<T: Number>(&self, v: [T; 3]) -> [T; 3] {
        let [x, y, z] = self.moments;
        let own = [v[0] * x, v[1] * y, v[2] * z];
        if self.diagonal {
            return own;
        }
        let [yz, xz, xy] = self.products;
        [
            own[0] + v[1] * xy + v[2] * xz,
            own[1] + v[0] * xy + v[2] * yz,
            own[2] + v[0] * xz + v[1] * yz,
        ]
    }
}

impl Six {
    /// For a body held at `handles_m` (body coordinates).
    pub fn new(body: &Body, handles_m: &[[f64; 3]]) -> Self {
        let [x, y, z] = [0, 1, 2].map(|a| pack(handles_m.iter().map(|h| h[a])));
        Self {
            handle: (0..x.len()).map(|p| [x[p], y[p], z[p]]).collect(),
            mass: body.mass_kg,
            inverse_mass: 1.0 / body.mass_kg,
            gravity: body.gravity_m_per_s2.into(),
            inertia: Tensor::new(&body.inertia_kg_m2),
            inverse_inertia: Tensor::new(&body.inverse_inertia),
        }
    }
}

impl Coordinates for Six {
    #[inline(always)]
    fn gaps_at<N: Moments>(&self, y: &[N::Each], w: &mut Workspace<N>, part: impl Part) {
        let y: &[N::Each; 13] = y.first_chunk().expect("thirteen states");
        let r = rotation(&y[3..7]);
        let spin = [y[10], y[11], y[12]];
        w.spin = spin;
        w.rotation = r;
        let (position, velocity) = ([y[0], y[1], y[2]], [y[7], y[8], y[9]]);
        place_handles(
            &mut w.pair,
            &self.handle,
            part,
            [position, velocity],
            &Turned::new(r, spin),
        );
    }

    #[inline(always)]
    fn orient_at<N: Moments>(&self, y: &[N::Each], w: &mut Workspace<N>) {
        w.velocity = [y[7], y[8], y[9]];
    }

    #[inline(always)]
    fn rates_at<N: Moments>(&self, y: &[N::Each], w: &Workspace<N>, dy: &mut [N::Each]) {
        let y: &[N::Each; 13] = y.first_chunk().expect("thirteen states");
        let dy: &mut [N::Each; 13] = dy.first_chunk_mut().expect("thirteen states");
        // What is known before the forces are comes first: τ − ω × Iω, to which their torques are added.
        let ([wx, wy, wz], further) = (w.spin, w.body_torque);
        let [lx, ly, lz] = self.inertia.times(w.spin);
        let mut torque = [
            wz.madd(ly, wy.nmadd(lz, further[0])),
            wx.madd(lz, wz.nmadd(lx, further[1])),
            wy.madd(lx, wx.nmadd(ly, further[2])),
        ];
        let ([force, t], r) = (pull(&w.pair), &w.rotation);
        for a in 0..3 {
            torque[a] = r[0][a].madd(t[0], r[1][a].madd(t[1], r[2][a].madd(t[2], torque[a])));
        }
        let angular = self.inverse_inertia.times(torque);
        let [qx, qy, qz, qw] = turn([y[3], y[4], y[5], y[6]], w.spin);
        dy[..7].copy_from_slice(&[y[7], y[8], y[9], qx, qy, qz, qw]);
        for a in 0..3 {
            dy[7 + a] = force[a].madd(N::Each::splat(self.inverse_mass), w.free_fall[a]);
            dy[10 + a] = angular[a];
        }
    }
}

/// q̇ = ½ q ∘ (ω, 0)
#[inline(always)]
pub(crate) fn turn<T: Number>(q: [T; 4], [wx, wy, wz]: [T; 3]) -> [T; 4] {
    let [qx, qy, qz, qw] = [q[0] * 0.5, q[1] * 0.5, q[2] * 0.5, q[3] * 0.5];
    [
        qz.nmadd(wy, qy.madd(wz, qw * wx)),
        qx.nmadd(wz, qz.madd(wx, qw * wy)),
        qy.nmadd(wx, qx.madd(wy, qw * wz)),
        -dot([qx, qy, qz], [wx, wy, wz]),
    ]
}

/// Places the handles, two by two: arm and its rate from `arm_of`, gap and its rate against a centre of mass at
/// `motion` = position (m) and velocity (m/s).
#[inline(always)]
fn place_handles<N: Moments, A: Arms<N>>(
    pairs: &mut [Pair<N>],
    handles: &[A::Handle],
    part: impl Part,
    motion: [[N::Each; 3]; 2],
    arms: &A,
) {
    let [position, velocity] = [both::<N>(motion[0]), both::<N>(motion[1])];
    for (p, h) in part.of_mut(pairs).iter_mut().zip(part.of(handles)) {
        let [arm, arm_rate] = arms.of(h);
        for a in 0..3 {
            p.arm[a] = arm[a];
            p.gap[a] = p.base[a] - (position[a] + arm[a]);
            p.gap_rate[a] = p.base_rate[a] - (velocity[a] + arm_rate[a]);
        }
    }
}

/// Where the body holds its handles.
trait Arms<N: Moments> {
    /// What is known of two handles beforehand.
    type Handle;
    /// Arms in the world, m, and their rates, m/s.
    fn of(&self, handle: &Self::Handle) -> [[N::Pair; 3]; 2];
}

/// A body of some rotation that turns: the rates of its arms are ω × arm.
struct Turned<N: Moments> {
    rows: [[N::Pair; 3]; 3],
    /// ω in the world, rad/s.
    spin: [N::Pair; 3],
}

impl<N: Moments> Turned<N> {
    /// With rows of the rotation and the spin in the body, rad/s.
    #[inline(always)]
    fn new(r: [[N::Each; 3]; 3], spin: [N::Each; 3]) -> Self {
        Self {
            rows: [both::<N>(r[0]), both::<N>(r[1]), both::<N>(r[2])],
            spin: both::<N>(by_rows(r, spin)),
        }
    }
}

impl<N: Moments> Arms<N> for Turned<N> {
    type Handle = [f64x2; 3];
    #[inline(always)]
    fn of(&self, h: &[f64x2; 3]) -> [[N::Pair; 3]; 2] {
        let w = &self.spin;
        let arm = by_rows(
            self.rows,
            [N::always(h[0]), N::always(h[1]), N::always(h[2])],
        );
        [arm, cross(*w, arm)]
    }
}

// Functions rather than closures, which would not be inlined into code compiled for wide registers.

/// What both carriers of a pair share.
#[inline(always)]
fn both<N: Moments>(v: [N::Each; 3]) -> [N::Pair; 3] {
    [N::both(v[0]), N::both(v[1]), N::both(v[2])]
}

/// Over the carriers of a pair.
#[inline(always)]
fn sums<N: Moments>(v: [N::Pair; 3]) -> [N::Each; 3] {
    [N::sum(v[0]), N::sum(v[1]), N::sum(v[2])]
}

/// A matrix, by its rows, times a vector.
#[inline(always)]
pub(crate) fn by_rows<T: Number>(rows: [[T; 3]; 3], v: [T; 3]) -> [T; 3] {
    [dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)]
}

/// A matrix, by its columns, times a vector.
#[inline(always)]
pub(crate) fn by_columns<T: Number>(m: [[T; 3]; 3], v: [T; 3]) -> [T; 3] {
    let [a, b, c] = m;
    by_rows(
        [[a[0], b[0], c[0]], [a[1], b[1], c[1]], [a[2], b[2], c[2]]],
        v,
    )
}

/// a · b
#[inline(always)]
fn dot<T: Number>(a: [T; 3], b: [T; 3]) -> T {
    a[2].madd(b[2], a[1].madd(b[1], a[0] * b[0]))
}

#[inline(always)]
fn cross<T: Number>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [
        b[1].nmadd(a[2], a[1] * b[2]),
        b[2].nmadd(a[0], a[2] * b[0]),
        b[0].nmadd(a[1], a[0] * b[1]),
    ]
}

/// Sums of the handle forces (N) and of their torques about the centre of mass (N·m), in the world.
#[inline(always)]
fn pull<N: Moments>(pairs: &[Pair<N>]) -> [[N::Each; 3]; 2] {
    let zero = N::Pair::splat(0.0);
    let (mut force, mut torque) = ([zero; 3], [zero; 3]);
    for p in pairs {
        let ([fx, fy], fz, [ax, ay, az]) = (p.tangential, p.normal, p.arm);
        force[0] += fx;
        force[1] += fy;
        force[2] += fz;
        torque[0] = ay.madd(fz, az.nmadd(fy, torque[0]));
        torque[1] = ax.nmadd(fz, az.madd(fx, torque[1]));
        torque[2] = ay.nmadd(fx, ax.madd(fy, torque[2]));
    }
    [sums::<N>(force), sums::<N>(torque)]
}

/// M v
#[inline(always)]
fn times<T: Number>(m: &Matrix3<f64>, v: [T; 3]) -> [T; 3] {
    [
        v[0] * m[(0, 0)] + v[1] * m[(0, 1)] + v[2] * m[(0, 2)],
        v[0] * m[(1, 0)] + v[1] * m[(1, 1)] + v[2] * m[(1, 2)],
        v[0] * m[(2, 0)] + v[1] * m[(2, 1)] + v[2] * m[(2, 2)],
    ]
}

/// Rows of the rotation matrix of q/|q|.
#[inline(always)]
pub(crate) fn rotation<T: Number>(q: &[T]) -> [[T; 3]; 3] {
    let (x, y, z, w) = (q[0], q[1], q[2], q[3]);
    let one = T::splat(1.0);
    // All that does not wait for the division is done beside it.
    let (xx, zz) = (x * x, z * z);
    let (yz, zx, xy) = (y.madd(y, zz), x.madd(x, zz), y.madd(y, xx));
    let s = T::splat(2.0) / (yz + w.madd(w, xx));
    let (wx, wy, wz) = (w * x, w * y, w * z);
    [
        [yz.nmadd(s, one), x.madd(y, -wz) * s, x.madd(z, wy) * s],
        [x.madd(y, wz) * s, zx.nmadd(s, one), y.madd(z, -wx) * s],
        [x.madd(z, -wy) * s, y.madd(z, wx) * s, xy.nmadd(s, one)],
    ]
}

impl Freedoms for Six {
    fn size(&self) -> usize {
        13
    }

    fn names(&self) -> &[&'static str] {
        &[
            "x_m",
            "y_m",
            "z_m",
            "qx",
            "qy",
            "qz",
            "qw",
            "vx_m_per_s",
            "vy_m_per_s",
            "vz_m_per_s",
            "wx_rad_per_s",
            "wy_rad_per_s",
            "wz_rad_per_s",
        ]
    }

    fn rotation(&self) -> Option<[usize; 2]> {
        Some([3, 10])
    }

    fn positions(&self) -> usize {
        7
    }

    fn scales(&self) -> &[f64] {
        &[
            0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0,
        ]
    }

    fn damping_per_s(
        &self,
        y: &[f64],
        pairs: &[Pair],
        [sideways, vertical]: [&[f64x2]; 2],
        rates: &mut [f64],
    ) {
        let up = rotation(&y[3..7])[2].map(f64x2::splat);
        let (mut across, mut along) = (f64x2::ZERO, f64x2::ZERO);
        let mut turning = [f64x2::ZERO; 3];
        let handles = pairs.iter().zip(&self.handle);
        for (((p, h), sideways), vertical) in handles.zip(sideways).zip(vertical) {
            let (sideways, vertical) = (*sideways * p.contact_gain, *vertical * p.contact_gain);
            across += sideways;
            along += vertical;
            for a in 0..3 {
                let (b, c) = ((a + 1) % 3, (a + 2) % 3);
                let lever = h[b] * up[c] - h[c] * up[b];
                let (whole, upright) = (h[b] * h[b] + h[c] * h[c], lever * lever);
                turning[a] += vertical * upright + sideways * (whole - upright);
            }
        }
        rates[7..9].fill(sum(across) * self.inverse_mass);
        rates[9] = sum(along) * self.inverse_mass;
        for a in 0..3 {
            rates[10 + a] = sum(turning[a]) * self.inverse_inertia.moments[a];
        }
    }

    fn place(&self, start: &Start, height_m: f64, y: &mut [f64]) {
        y[..3].copy_from_slice(&[start.position_m[0], start.position_m[1], height_m]);
        let [roll, pitch, yaw] = start.roll_pitch_yaw_deg.map(f64::to_radians);
        let q = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        y[3..7].copy_from_slice(&[q.i, q.j, q.k, q.w]);
        y[7..10].copy_from_slice(&start.velocity_m_per_s);
        y[10..13].copy_from_slice(&start.angular_velocity_rad_per_s);
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
        3..7
    }

    fn levers(&self, y: &[f64], handle_m: [f64; 3], axis: usize) -> [f64; 6] {
        let [a, b, c] = cross(handle_m, rotation(&y[3..7])[axis]);
        let mut levers = [0.0, 0.0, 0.0, a, b, c];
        levers[axis] = 1.0;
        levers
    }

    fn inverse_masses(&self, _y: &[f64]) -> [f64; 6] {
        let (m, [a, b, c]) = (self.inverse_mass, self.inverse_inertia.moments);
        [m, m, m, a, b, c]
    }

    fn spin_rad_per_s(&self, y: &[f64]) -> [f64; 3] {
        [y[10], y[11], y[12]]
    }

    fn pose(&self, y: &[f64]) -> Pose {
        let mut q = [y[3], y[4], y[5], y[6]];
        normalise(&mut q);
        Pose {
            position_m: [y[0], y[1], y[2]],
            orientation: q,
            velocity_m_per_s: [y[7], y[8], y[9]],
            spin_rad_per_s: self.spin_rad_per_s(y),
        }
    }

    fn acceleration(&self, _y: &[f64], dy: &[f64]) -> [[f64; 3]; 2] {
        [[dy[7], dy[8], dy[9]], [dy[10], dy[11], dy[12]]]
    }

    #[inline]
    fn project(&self, y: &mut [f64]) {
        normalise(&mut y[3..7]);
    }

    fn drift(&self, h_s: f64, y: &mut [f64]) {
        for a in 0..3 {
            y[a] += h_s * y[7 + a];
        }
        let q = UnitQuaternion::new_normalize(Quaternion::new(y[6], y[3], y[4], y[5]));
        let q = q * UnitQuaternion::from_scaled_axis(Vector3::new(y[10], y[11], y[12]) * h_s);
        y[3..7].copy_from_slice(&[q.i, q.j, q.k, q.w]);
        normalise(&mut y[3..7]);
    }

    fn energy_j(&self, y: &[f64]) -> [f64; 2] {
        let v = Vector3::new(y[7], y[8], y[9]);
        let kinetic = 0.5
            * (self.mass * v.norm_squared()
                + (0..3)
                    .map(|a| y[10 + a] * self.inertia.times([y[10], y[11], y[12]])[a])
                    .sum::<f64>());
        [
            kinetic,
            -self.mass * (0..3).map(|a| self.gravity[a] * y[a]).sum::<f64>(),
        ]
    }
}

/// Scales a quaternion to unit length; |q| is within rounding of 1 afterwards, and one that is so already stays what it is.
#[inline(always)]
fn normalise(q: &mut [f64]) {
    const ROUNDING: f64 = 16.0 * f64::EPSILON;
    /// Within this of 1 three terms of the series of 1/√x are enough: the next is 5/16 of its cube, 4e-17.
    const NEAR: f64 = 5e-6;
    let square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    let off = square - 1.0;
    if off.abs() <= ROUNDING {
        return;
    }
    let s = if off.abs() <= NEAR {
        1.0 - off * (0.5 - 0.375 * off)
    } else {
        1.0 / square.sqrt()
    };
    for x in q {
        *x *= s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(orientation: [f64; 4]) -> Pose {
        Pose {
            position_m: [0.0; 3],
            orientation,
            velocity_m_per_s: [0.0; 3],
            spin_rad_per_s: [0.0; 3],
        }
    }

    #[test]
    fn angles_turn_back_into_the_same_rotation() {
        for (roll, pitch, yaw) in [(0.3, -0.2, 1.0), (3.0, 1.5, -3.0), (-1.0, -1.57, 2.0)] {
            let q = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            let pose = pose([q.i, q.j, q.k, q.w]);
            let angles = pose.roll_pitch_yaw_rad();
            assert_eq!(pose.roll_rad(), angles[0]);
            for (a, b) in angles.into_iter().zip([roll, pitch, yaw]) {
                assert!((a - b).abs() < 1e-9, "{angles:?}");
            }
        }
    }

    /// Also where roll and yaw are hardly told apart, and where the pole is not quite vertical.
    #[test]
    fn the_roll_alone_is_that_of_all_three_and_within_half_a_turn() {
        for k in 0..4000_u32 {
            let [a, b, c] = [1.1, 2.3, 3.7].map(|f| (f * f64::from(k)).sin());
            let upright = std::f64::consts::FRAC_PI_2 * b.signum();
            let pitch = match k % 4 {
                0 => upright * b.abs(),
                n => upright * (1.0 - 10f64.powi(-5 * n as i32 + 3) * b.abs()),
            };
            let q = UnitQuaternion::from_euler_angles(3.1 * a, pitch, 3.1 * c);
            let pose = pose([q.i, q.j, q.k, q.w]);
            let angles = pose.roll_pitch_yaw_rad();
            assert_eq!(pose.roll_rad(), angles[0], "{pitch}");
            for angle in angles {
                assert!(angle.abs() <= std::f64::consts::PI + 1e-15, "{angles:?}");
            }
            let back = UnitQuaternion::from_euler_angles(angles[0], angles[1], angles[2]);
            // Angles are those of numbers as small as the cosine of the pitch, each with the rounding of one.
            let rounding = 1e-15 / angles[1].cos().max(1e-9);
            assert!(q.angle_to(&back) < 3e-8 + rounding, "{angles:?}");
        }
    }

    #[test]
    fn a_vertical_pole_still_has_angles_of_the_same_rotation() {
        for pitch in [std::f64::consts::FRAC_PI_2, -std::f64::consts::FRAC_PI_2] {
            for (roll, yaw) in [(0.4, 0.0), (0.4, 1.1), (-2.0, 0.7)] {
                let q = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
                let pose = pose([q.i, q.j, q.k, q.w]);
                let [r, p, y] = pose.roll_pitch_yaw_rad();
                assert_eq!(pose.roll_rad(), r);
                let back = UnitQuaternion::from_euler_angles(r, p, y);
                assert!(
                    q.angle_to(&back) < 1e-8,
                    "{roll} {pitch} {yaw} -> {r} {p} {y}"
                );
            }
        }
    }
}

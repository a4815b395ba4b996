//! The right-hand side against the equations of docs/model.md, written out plainly: positions and laws of force alone, one carrier after
//! the other. Rates of shoulders, handles and rotations are differences of their positions along the flow.

mod common;

use common::scene;
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use sim::effects::contact::Law;
use sim::effects::coupling::Graph;
use sim::effects::friction;
use sim::model::Model;
use sim::random::{Stream, normal};
use sim::scene::{Freedom, Scene};
use std::f64::consts::TAU;
use std::ops::{Add, Mul, Sub};

/// A state, by the names of its numbers.
#[derive(Clone)]
struct State<'a> {
    scene: &'a Scene,
    names: &'a [String],
    t_s: f64,
    y: Vec<f64>,
}

/// Coordinates and their rates.
const MOVES: [[&str; 2]; 6] = [
    ["x_m", "vx_m_per_s"],
    ["y_m", "vy_m_per_s"],
    ["z_m", "vz_m_per_s"],
    ["roll_rad", "roll_rate_rad_per_s"],
    ["tilt_rad", "tilt_rate_rad_per_s"],
    ["yaw_rad", "yaw_rate_rad_per_s"],
];

/// Forces at one handle, and what moves there.
struct Handle {
    gap: Vector3<f64>,
    gap_rate: Vector3<f64>,
    base_rate: Vector3<f64>,
    arm: Vector3<f64>,
    normal_n: f64,
    /// What the contact's spring holds of it, N.
    spring_n: f64,
    side_n: [f64; 2],
    acts: bool,
    /// Of bristles, m/s.
    bristle_rate: [f64; 2],
}

/// df/ds at s = 0: its error is h⁴/30 of the fifth derivative, here some 1e-11.
fn slope<T>(f: impl Fn(f64) -> T) -> T
where
    T: Sub<Output = T> + Add<Output = T> + Mul<f64, Output = T>,
{
    let h = 3e-4;
    ((f(h) - f(-h)) * 8.0 - (f(2.0 * h) - f(-2.0 * h))) * (1.0 / (12.0 * h))
}

/// The vector of a skew matrix.
fn axial(m: Matrix3<f64>) -> Vector3<f64> {
    0.5 * Vector3::new(
        m[(2, 1)] - m[(1, 2)],
        m[(0, 2)] - m[(2, 0)],
        m[(1, 0)] - m[(0, 1)],
    )
}

fn about_z(v: Vector3<f64>, angle: f64) -> Vector3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), angle) * v
}

impl State<'_> {
    fn get(&self, name: &str) -> Option<f64> {
        let at = self.names.iter().position(|n| n == name)?;
        Some(self.y[at])
    }

    fn of(&self, name: &str) -> f64 {
        self.get(name).unwrap_or(0.0)
    }

    fn phase(&self, i: usize) -> f64 {
        self.of(&format!("phase_{}_rad", i + 1))
    }

    fn handle_m(&self, i: usize) -> Vector3<f64> {
        Vector3::from(self.scene.carriers.handles_m[i])
    }

    fn carriers(&self) -> usize {
        self.scene.carriers.count()
    }

    fn centre(&self) -> Vector3<f64> {
        let start = &self.scene.start;
        let [x, y] = start.position_m;
        let held = [x, y, start.height_m.expect("a height")];
        Vector3::from_fn(|a, _| self.get(MOVES[a][0]).unwrap_or(held[a]))
    }

    fn rotation(&self) -> Matrix3<f64> {
        if let Some(w) = self.get("qw") {
            let [x, y, z] = ["qx", "qy", "qz"].map(|n| self.of(n));
            let q = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
            return q.to_rotation_matrix().into_inner();
        }
        let held = self.scene.start.roll_pitch_yaw_deg.map(f64::to_radians);
        let [roll, tilt, yaw] = [0, 1, 2].map(|k| self.get(MOVES[3 + k][0]).unwrap_or(held[k]));
        Rotation3::from_euler_angles(roll, tilt, yaw).into_inner()
    }

    /// The same a little later on the flow, from the first derivatives alone.
    fn after(&self, s: f64) -> Self {
        let mut next = self.clone();
        next.t_s += s;
        let spin = ["wx_rad_per_s", "wy_rad_per_s", "wz_rad_per_s"].map(|n| self.of(n));
        let turned =
            self.rotation() * Rotation3::from_scaled_axis(Vector3::from(spin) * s).into_inner();
        let q = UnitQuaternion::from_matrix(&turned);
        for (name, y) in self.names.iter().zip(&mut next.y) {
            *y = match name.as_str() {
                "qx" => q.i,
                "qy" => q.j,
                "qz" => q.k,
                "qw" => q.w,
                _ => *y + s * self.first_rate(name).unwrap_or(0.0),
            };
        }
        next
    }

    /// Rate of a state that follows from the state without forces.
    fn first_rate(&self, name: &str) -> Option<f64> {
        if let Some([_, rate]) = MOVES.iter().find(|m| m[0] == name) {
            return Some(self.of(rate));
        }
        if let Some(i) = (0..self.carriers()).find(|i| name == format!("phase_{}_rad", i + 1)) {
            return Some(self.phase_rate(i));
        }
        let walk = Vector3::from(self.scene.carriers.walk_m_per_s);
        let strays = about_z(walk, self.heading()) - walk;
        match name {
            "path_x_m" => Some(strays.x),
            "path_y_m" => Some(strays.y),
            _ if name.starts_with("pole_") && name.ends_with("_m") => {
                Some(self.of(&format!("{name}_per_s")))
            }
            _ => None,
        }
    }

    fn heading(&self) -> f64 {
        let Some(path) = &self.scene.effects.path else {
            return 0.0;
        };
        let u = ((self.t_s - path.turn_start_s) / path.turn_time_s).clamp(0.0, 1.0);
        path.turn_deg.to_radians() * (10.0 * u.powi(3) - 15.0 * u.powi(4) + 6.0 * u.powi(5))
    }

    fn gravity(&self) -> Vector3<f64> {
        let g = Vector3::from(self.scene.body.gravity_m_per_s2);
        let Some(path) = &self.scene.effects.path else {
            return g;
        };
        let (s, b) = (path.slope_deg.to_radians(), path.bank_deg.to_radians());
        -g.norm() * Vector3::new(s.sin(), b.sin() * s.cos(), b.cos() * s.cos())
    }

    /// ψ: the tempo, straight between its changes, integrated by the trapezoids that are exact for it.
    fn beat(&self) -> f64 {
        let music = self.scene.effects.music.as_ref().expect("music");
        let mut corners = vec![(0.0, music.beat_hz)];
        for c in &music.tempo_changes {
            let before = corners[corners.len() - 1].1;
            corners.extend([(c.at_s, before), (c.at_s + c.over_s, c.beat_hz)]);
        }
        corners.push((f64::INFINITY, corners[corners.len() - 1].1));
        let mut turns = 0.0;
        for w in corners.windows(2) {
            let ((t, f), (next_s, next_hz)) = (w[0], w[1]);
            let end_s = next_s.min(self.t_s);
            if end_s > t {
                let part = if next_s.is_finite() {
                    (end_s - t) / (next_s - t)
                } else {
                    0.0
                };
                turns += (end_s - t) * (f + 0.5 * part * (next_hz - f));
            }
        }
        music.beat_phase_rad + TAU * turns
    }

    fn phase_rate(&self, i: usize) -> f64 {
        let (e, n) = (&self.scene.effects, self.carriers());
        if let Some(m) = e.measured.as_ref().filter(|m| !m.phase_rad.is_empty()) {
            return slope(|s| cubic(&m.t_s, &m.phase_rad[i], self.t_s + s));
        }
        let phi = self.phase(i);
        let mut rate = TAU * self.scene.carriers.frequency_hz.get(i);
        if let Some(spread) = &e.frequency_spread {
            rate += TAU * spread.sd_hz * normal(self.scene.seed, Stream::Frequency, i, 0);
        }
        if let Some(noise) = &e.noise {
            let cell = (self.t_s * noise.grid_hz) as u64;
            let draw = normal(self.scene.seed, Stream::PhaseNoise, i, cell);
            rate += noise.phase_rad_per_sqrt_s * draw * noise.grid_hz.sqrt();
        }
        if let Some(coupling) = &e.coupling {
            let minds: Vec<usize> = match &coupling.graph {
                Graph::All => (0..n).filter(|j| *j != i).collect(),
                graph => {
                    let pairs = graph.pairs(&self.scene.carriers).expect("a graph");
                    let other = pairs.iter().filter(|p| p.contains(&i));
                    other.map(|p| p[0] + p[1] - i).collect()
                }
            };
            let pull: f64 = minds.iter().map(|&j| (self.phase(j) - phi).sin()).sum();
            rate += coupling.strength_rad_per_s / (minds.len() + 1) as f64 * pull;
        }
        if let Some(music) = &e.music {
            let silent = music
                .pauses
                .iter()
                .any(|p| p.from_s <= self.t_s && self.t_s < p.to_s);
            if self.t_s >= music.onset_s && !silent {
                let grown = match music.build_up_s {
                    0.0 => 1.0,
                    tau => 1.0 - ((music.onset_s - self.t_s) / tau).exp(),
                };
                rate += music.strength_rad_per_s.get(i) * grown * (self.beat() - phi).sin();
            }
        }
        if let Some(f) = &e.feedback {
            let felt = self.of(&format!("felt_load_{}", i + 1));
            rate += f.strength_rad_per_s * (felt - 1.0) * (f.phase_rad - phi).sin();
        }
        rate
    }

    fn shoulder(&self, i: usize) -> Vector3<f64> {
        let e = &self.scene.effects;
        if let Some(m) = e.measured.as_ref().filter(|m| !m.shoulder_m.is_empty()) {
            let axis = |a: usize| m.shoulder_m[i].iter().map(|p| p[a]).collect::<Vec<f64>>();
            return Vector3::from_fn(|a, _| cubic(&m.t_s, &axis(a), self.t_s));
        }
        let rest_m = self.scene.carriers.shoulder_height_m.get(i);
        let mut b = Vector3::new(self.handle_m(i).x, self.handle_m(i).y, rest_m);
        if let Some(gait) = &e.gait {
            let phi = self.phase(i);
            b.z += gait.amplitude_m.get(i) * phi.sin();
            b.y += gait.sway_m.get(i) * (phi + gait.sway_phase_rad).sin();
            for h in &gait.harmonics {
                if h.carriers.as_ref().is_none_or(|who| who.contains(&i)) {
                    for a in 0..3 {
                        let angle = f64::from(h.order) * phi + h.phase_rad[a];
                        b[a] += h.amplitude_m[a] * angle.sin();
                    }
                }
            }
        }
        if let Some(lift) = &e.lift {
            let gain = match (self.t_s - lift.onset_s, lift.build_up_s) {
                (since, _) if since < 0.0 => 1.0,
                (_, 0.0) => lift.gain,
                (since, tau) => 1.0 + (lift.gain - 1.0) * (1.0 - (-since / tau).exp()),
            };
            b.z = rest_m + gain * (b.z - rest_m);
        }
        let centre = Vector3::new(self.of("path_x_m"), self.of("path_y_m"), 0.0);
        centre + about_z(b, self.heading())
    }

    /// Poles that can bend, by number, with the share of the deflection at each handle.
    fn poles(&self) -> Vec<(usize, Vec<f64>)> {
        if self.scene.effects.flexure.is_none() {
            return Vec::new();
        }
        let share = |pole: &[usize]| {
            let x = |i: usize| self.handle_m(i).x.abs();
            let end = pole.iter().map(|&i| x(i)).fold(0.0, f64::max);
            let at = |i: usize| {
                let u = x(i) / end;
                if pole.contains(&i) {
                    (3.0 * u * u - u.powi(3)) / 2.0
                } else {
                    0.0
                }
            };
            (end > 0.0).then(|| (0..self.carriers()).map(at).collect::<Vec<f64>>())
        };
        let poles = self.scene.carriers.poles();
        let numbered = poles.iter().enumerate();
        numbered
            .filter_map(|(k, pole)| Some((k + 1, share(pole)?)))
            .collect()
    }

    fn handle(&self, i: usize) -> Vector3<f64> {
        let mut place = self.handle_m(i);
        for (k, share) in self.poles() {
            place.z += share[i] * self.of(&format!("pole_{k}_m"));
        }
        self.centre() + self.rotation() * place
    }

    fn at_handle(&self, i: usize) -> Handle {
        let e = &self.scene.effects;
        let gap = |s: &State| s.shoulder(i) - s.handle(i);
        let mut h = Handle {
            gap: gap(self),
            gap_rate: slope(|s| gap(&self.after(s))),
            base_rate: slope(|s| self.after(s).shoulder(i)),
            arm: self.handle(i) - self.centre(),
            normal_n: 0.0,
            spring_n: 0.0,
            side_n: [0.0; 2],
            acts: false,
            bristle_rate: [0.0; 2],
        };
        if let Some(contact) = &e.contact {
            let (k, c) = (
                contact.stiffness_n_per_m.get(i),
                contact.damping_n_s_per_m.get(i),
            );
            let (d, rate) = (h.gap.z, h.gap_rate.z);
            let (spring_n, free_n) = match contact.law {
                Law::SpringDamper => (k * d, k * d + c * rate),
                Law::HuntCrossley if d < 0.0 => (0.0, 0.0),
                Law::HuntCrossley => {
                    let spring_n = k * d.powf(contact.exponent);
                    (spring_n, spring_n * (1.0 + c / k * rate))
                }
            };
            h.acts = contact.bilateral || free_n > 0.0;
            if h.acts {
                (h.normal_n, h.spring_n) = (free_n, spring_n);
            }
        }
        let load_n = h.normal_n.max(0.0);
        for a in 0..2 {
            let (d, rate) = (h.gap[a], h.gap_rate[a]);
            if let Some(hold) = &e.hold {
                h.side_n[a] +=
                    hold.stiffness_n_per_m.get(i) * d + hold.damping_n_s_per_m.get(i) * rate;
            }
            if let Some(sling) = &e.sling {
                h.side_n[a] += load_n / sling.length_m * (d + sling.damping_s * rate);
            }
        }
        let Some(f) = &e.friction else {
            return h;
        };
        let most_n = f.coefficient * load_n;
        if f.law == friction::Law::Regularised {
            let wish = [0, 1]
                .map(|a| h.side_n[a] / most_n + h.gap_rate[a] / f.regularising_velocity_m_per_s);
            let short = most_n / (1.0 + wish[0].powi(2) + wish[1].powi(2)).sqrt();
            h.side_n = wish.map(|e| if load_n > 0.0 { short * e } else { 0.0 });
            return h;
        }
        let speed = h.gap_rate.xy().norm();
        for a in 0..2 {
            let bent = self.of(&format!("bristle_{}_{}_m", i + 1, ["x", "y"][a]));
            let (s0, s1) = (f.bristle_stiffness_per_m, f.bristle_damping_s_per_m);
            h.bristle_rate[a] = if h.acts {
                h.gap_rate[a] - s0 / f.coefficient * speed * bent
            } else {
                -bent / (s1 / s0).max(0.01)
            };
            h.side_n[a] = load_n * (s0 * bent + s1 * h.bristle_rate[a]);
        }
        h
    }
}

/// The cubic through four samples, by Lagrange's formula.
fn cubic(t: &[f64], x: &[f64], at: f64) -> f64 {
    let others = |k: usize| (0..4).filter(move |&j| j != k);
    let weight = |k: usize| {
        others(k)
            .map(|j| (at - t[j]) / (t[k] - t[j]))
            .product::<f64>()
    };
    (0..4).map(|k| weight(k) * x[k]).sum()
}

/// Holds every number of the right-hand side against the equations, and what is told of motion and energy: at `t_s`, in a state in which
/// nothing is at rest and some handles are slack.
#[track_caller]
fn check(text: &str, t_s: f64) {
    let mut scene = scene(text);
    scene.start.velocity_m_per_s = [0.1, -0.2, 0.1];
    scene.start.angular_velocity_rad_per_s = [0.5, 0.1, -0.3];
    scene.keep_to_freedoms();
    let model = Model::new(&scene);
    let (names, mut w) = (model.state_names(), model.workspace());
    let mut y = model.initial_state();
    let measured = scene.effects.measured.as_ref();
    for i in 0..scene.carriers.count() {
        let begins = match measured.filter(|m| !m.phase_rad.is_empty()) {
            Some(m) => m.phase_rad[i][0],
            None => {
                let draw = normal(scene.seed, Stream::InitialPhase, i, 0);
                let carriers = &scene.carriers;
                carriers.initial_phase_rad.get(i) + carriers.initial_phase_sd_rad * draw
            }
        };
        if model.layout().phases > 0 {
            assert!((y[model.layout().phase_range()][i] - begins).abs() < 1e-14);
        }
    }
    for (k, (y, name)) in y.iter_mut().zip(&names).enumerate() {
        let size = match name.as_str() {
            _ if name.ends_with("_j") => 1.0,
            _ if name.starts_with("pole_") && name.ends_with("_m") => 0.01,
            _ if name.starts_with("bristle_") || name == "z_m" => 0.03,
            _ => 0.2,
        };
        *y += size * (1.7 * k as f64 + 0.4).sin();
    }
    model.freedoms().project(&mut y);
    model.begin_segment(t_s, &mut w);
    let mut dy = vec![f64::NAN; y.len()];
    model.rhs(t_s, &y, &mut dy, &mut w);

    let state = State {
        scene: &scene,
        names: &names,
        t_s,
        y,
    };
    let close = |name: &str, found: f64, expected: f64, size: f64| {
        assert!(
            (found - expected).abs() <= 1e-8 * (size + expected.abs()),
            "{name}: {found} found, {expected} expected\n{text}"
        );
    };
    let near = |name: &str, found: f64, expected: f64| close(name, found, expected, 10.0);
    let handles: Vec<Handle> = (0..state.carriers()).map(|i| state.at_handle(i)).collect();
    let (e, body) = (&scene.effects, &scene.body);
    let force = |h: &Handle| Vector3::new(h.side_n[0], h.side_n[1], h.normal_n);
    for (i, h) in handles.iter().enumerate() {
        near("normal", w.of(i, |p| p.normal), h.normal_n);
        for a in 0..2 {
            near("tangential", w.of(i, |p| p.tangential[a]), h.side_n[a]);
        }
    }

    // The body: M a = ΣF + M g, I α + ω × I ω = Rᵀ Σ arm × F + τ, along every freedom.
    let i = body.inertia_kg_m2;
    let inertia = Matrix3::new(i.xx, i.xy, i.xz, i.xy, i.yy, i.yz, i.xz, i.yz, i.zz);
    let rate_of = |name: &str| names.iter().position(|n| n == name).map(|k| dy[k]);
    let turn = state.rotation();
    let spin = axial(turn.transpose() * slope(|s| state.after(s).rotation()));
    let push: Vector3<f64> = handles.iter().map(force).sum();
    let mut torque: Vector3<f64> = handles.iter().map(|h| h.arm.cross(&force(h))).sum();
    // Who pushes takes hold at a point of the body: half of one minus a cosine.
    let mut pushed = [Vector3::zeros(); 2];
    for p in e.push.iter().flat_map(|e| &e.pushes) {
        let u = (t_s - p.start_s) / p.time_s;
        if (0.0..1.0).contains(&u) {
            let pulse = Vector3::from(p.force_n) * (0.5 - 0.5 * (TAU * u).cos());
            let arm = turn * Vector3::from(p.place_m);
            pushed = [pushed[0] + pulse, pushed[1] + arm.cross(&pulse)];
        }
    }
    torque = turn.transpose() * (torque + pushed[1]);
    let mut rubbed_w = 0.0;
    if let Some(f) = &e.pole_friction {
        let load_n: f64 = handles.iter().map(|h| h.normal_n.abs()).sum();
        let rubs = f.arm_m * load_n * spin.x / spin.x.hypot(f.regularising_rate_rad_per_s);
        torque.x -= rubs;
        rubbed_w = rubs * spin.x;
    }
    let left = |acceleration: Vector3<f64>| {
        inertia * acceleration + spin.cross(&(inertia * spin)) - torque
    };
    for a in 0..3 {
        if let Some(found) = rate_of(MOVES[a][1]) {
            let free = scene.freedom.contains(&Freedom::ALL[a]);
            let expected = (push[a] + pushed[0][a]) / body.mass_kg + state.gravity()[a];
            near(MOVES[a][1], found, if free { expected } else { 0.0 });
        }
    }
    let turning = if let Some(wx) = rate_of("wx_rad_per_s") {
        let [wy, wz] = ["wy_rad_per_s", "wz_rad_per_s"].map(|n| rate_of(n).unwrap_or(f64::NAN));
        let found = Vector3::new(wx, wy, wz);
        let expected = found - inertia.try_inverse().expect("a body") * left(found);
        for a in 0..3 {
            near(["wx", "wy", "wz"][a], found[a], expected[a]);
        }
        found
    } else {
        // Angles that go on as they do turn the body unevenly; what they gain in speed adds to that.
        let moved = |angles: &[(usize, f64)]| {
            let mut next = state.clone();
            angles.iter().for_each(|&(k, by)| next.y[k] += by);
            next.rotation()
        };
        let free = MOVES[3..].iter().filter_map(|[angle, rate]| {
            let k = names.iter().position(|n| n == angle)?;
            Some((k, state.of(rate), rate_of(rate)?))
        });
        let free: Vec<(usize, f64, f64)> = free.collect();
        let later = |s: f64| moved(&free.iter().map(|f| (f.0, s * f.1)).collect::<Vec<_>>());
        let h = 2e-3;
        let second =
            (16.0 * (later(h) + later(-h)) - later(2.0 * h) - later(-2.0 * h) - 30.0 * turn)
                / (12.0 * h * h);
        let axis = |k: usize| axial(turn.transpose() * slope(|s| moved(&[(k, s)])));
        let gained: Vector3<f64> = free.iter().map(|f| axis(f.0) * f.2).sum();
        let found = axial(turn.transpose() * second) + gained;
        for &(k, ..) in &free {
            let expected = torque.dot(&axis(k));
            near(&names[k], left(found).dot(&axis(k)) + expected, expected);
        }
        found
    };
    // What others are told of the motion.
    let [linear, angular] = model.freedoms().acceleration(&state.y, &dy);
    let pose = model.freedoms().pose(&state.y);
    for a in 0..3 {
        near(
            "acceleration",
            linear[a],
            rate_of(MOVES[a][1]).unwrap_or(0.0),
        );
        near("angular acceleration", angular[a], turning[a]);
        near("spin", pose.spin_rad_per_s[a], spin[a]);
        near("position", pose.position_m[a], state.centre()[a]);
        near("velocity", pose.velocity_m_per_s[a], state.of(MOVES[a][1]));
    }
    let velocity = Vector3::from_fn(|a, _| state.of(MOVES[a][1]));
    let pushed_w = pushed[0].dot(&velocity) + pushed[1].dot(&(turn * spin));
    let kinetic_j = 0.5 * (body.mass_kg * velocity.norm_squared() + spin.dot(&(inertia * spin)));
    let fall_j = -body.mass_kg * state.gravity().dot(&state.centre());
    for (found, expected) in model
        .freedoms()
        .energy_j(&state.y)
        .into_iter()
        .zip([kinetic_j, fall_j])
    {
        near("energy", found, expected);
    }

    // Everything else has a rate by its name.
    let share_n = -body.mass_kg * state.gravity().z / state.carriers() as f64;
    for (k, name) in names.iter().enumerate() {
        if let Some(expected) = state.first_rate(name) {
            near(name, dy[k], expected);
        }
        for (i, h) in handles.iter().enumerate() {
            if *name == format!("felt_load_{}", i + 1) {
                let latency_s = e.feedback.as_ref().map_or(f64::NAN, |f| f.latency_s);
                near(
                    name,
                    dy[k],
                    (h.normal_n / share_n - state.of(name)) / latency_s,
                );
            }
            for a in 0..2 {
                if *name == format!("bristle_{}_{}_m", i + 1, ["x", "y"][a]) {
                    near(name, dy[k], h.bristle_rate[a]);
                }
            }
        }
    }
    if rate_of("qw").is_some() {
        let quaternion = |s: f64| UnitQuaternion::from_matrix(&state.after(s).rotation());
        let rate = slope(|s| *quaternion(s).quaternion());
        // q and −q are one rotation.
        let sign = (quaternion(0.0).w * state.of("qw")).signum();
        for (name, expected) in [
            ("qx", rate.i),
            ("qy", rate.j),
            ("qz", rate.k),
            ("qw", rate.w),
        ] {
            near(name, rate_of(name).unwrap_or(f64::NAN), sign * expected);
        }
    }
    let mut bent_w = 0.0;
    if let Some(f) = &e.flexure {
        let (m, omega) = (f.modal_mass_kg, TAU * f.frequency_hz);
        for (k, share) in state.poles() {
            let [q, rate] = ["m", "m_per_s"].map(|unit| state.of(&format!("pole_{k}_{unit}")));
            let up = turn * Vector3::z();
            let pressed: f64 = handles
                .iter()
                .zip(&share)
                .map(|(h, s)| s * force(h).dot(&up))
                .sum();
            let damped = 2.0 * f.damping_ratio * omega * rate;
            let name = format!("pole_{k}_m_per_s");
            let found = rate_of(&name).expect("a pole that bends");
            near(&name, found, pressed / m - omega * omega * q - damped);
            bent_w += m * damped * rate;
        }
    }

    // Springs store ½kd², k δ^(p + 1)/(p + 1); friction and straps nothing.
    let mut stored_j = 0.0;
    for (i, h) in handles.iter().enumerate() {
        if let Some(contact) = e.contact.as_ref().filter(|_| h.acts) {
            stored_j += h.spring_n * h.gap.z / (contact.exponent + 1.0);
        }
        if let Some(hold) = e.hold.as_ref().filter(|_| e.friction.is_none()) {
            stored_j += 0.5 * hold.stiffness_n_per_m.get(i) * h.gap.xy().norm_squared();
        }
    }
    if let Some(f) = &e.flexure {
        for (k, _) in state.poles() {
            let [q, rate] = ["m", "m_per_s"].map(|unit| state.of(&format!("pole_{k}_{unit}")));
            let swing = TAU * f.frequency_hz * q;
            stored_j += 0.5 * f.modal_mass_kg * (swing * swing + rate * rate);
        }
    }
    near("stored", model.stored_j(&w), stored_j);

    // The ledger: shoulders work F·ḃ; of F·ḋ what no spring keeps is lost.
    let sum = |of: &dyn Fn(&Handle) -> f64| handles.iter().map(of).sum::<f64>();
    let sides = |of: &dyn Fn(&Handle, usize) -> f64| sum(&|h| of(h, 0) + of(h, 1));
    let side_work_w = sides(&|h, a| h.side_n[a] * h.base_rate[a]);
    let side_lost_w = sides(&|h, a| h.side_n[a] * h.gap_rate[a]);
    for account in model.accounts() {
        let [work_w, lost_w] = match account {
            "contact" => [
                sum(&|h| h.normal_n * h.base_rate.z),
                sum(&|h| (h.normal_n - h.spring_n) * h.gap_rate.z),
            ],
            "hold" if e.friction.is_none() => {
                let stiffness = &e.hold.as_ref().expect("a hold").stiffness_n_per_m;
                let kept = |i: usize| {
                    let h = &handles[i];
                    let side = h.gap[0] * h.gap_rate[0] + h.gap[1] * h.gap_rate[1];
                    stiffness.get(i) * side
                };
                let kept_w: f64 = (0..handles.len()).map(kept).sum();
                [side_work_w, side_lost_w - kept_w]
            }
            "hold" | "sling" | "friction" => [side_work_w, side_lost_w],
            "pole_friction" => [0.0, rubbed_w],
            "flexure" => [0.0, bent_w],
            "push" => [pushed_w, 0.0],
            other => panic!("nothing is known of {other}"),
        };
        for (what, expected) in [("work_j", work_w), ("dissipated_j", lost_w)] {
            let name = format!("{account}_{what}");
            // Sums of watts of both signs.
            let found = rate_of(&name).expect("a page");
            close(&name, found, expected, 1e3);
        }
    }
}

/// Five on two poles and one beside them, no two alike, none where the other's numbers are.
const FIVE: &str = r#"
name = "five"
[body]
mass_kg = 71.0
inertia_kg_m2 = { xx = 3.0, yy = 11.0, zz = 12.0, xy = 0.4, xz = -0.3, yz = 0.2 }
[carriers]
handles_m = [[2.4, 0.3, 0.1], [1.1, 0.3, 0.12], [-2.4, 0.3, 0.1], [2.2, -0.3, 0.1], [0.3, -0.5, 0.2]]
shoulder_height_m = [1.0, 1.02, 0.99, 1.01, 1.03]
frequency_hz = [2.0, 1.9, 2.1, 2.05, 1.95]
initial_phase_rad = [0.3, 1.1, 2.0, 4.0, 5.5]
initial_phase_sd_rad = 0.2
walk_m_per_s = [0.9, 0.2, 0.0]
[start]
height_m = 0.84
position_m = [0.02, -0.03]
roll_pitch_yaw_deg = [8.0, 3.0, -5.0]
"#;
const CONTACT: &str = "[effects.contact]\nstiffness_n_per_m = [3000.0, 2500.0, 3300.0, 2800.0, 3100.0]\ndamping_n_s_per_m = [450.0, 300.0, 410.0, 350.0, 390.0]\n";
const HOLD: &str = "[effects.hold]\nstiffness_n_per_m = [900.0, 800.0, 700.0, 650.0, 750.0]\ndamping_n_s_per_m = [90.0, 120.0, 80.0, 70.0, 60.0]\n";
const GAIT: &str = "[effects.gait]\namplitude_m = [0.06, 0.05, 0.07, 0.04, 0.055]\nsway_m = [0.01, 0.02, 0.03, 0.015, 0.025]\nsway_phase_rad = 0.7\n\
    harmonics = [{ order = 2, amplitude_m = [0.001, 0.002, 0.003], phase_rad = [0.1, 0.5, 1.3] }, { order = 5, amplitude_m = [0.001, 0.0, 0.002], carriers = [1, 4] }]\n";
const TURN: &str = "[effects.path]\nslope_deg = 7.0\nbank_deg = -4.0\nturn_deg = 90.0\nturn_start_s = 0.5\nturn_time_s = 3.0\n";
const BENDS: &str =
    "[effects.flexure]\nfrequency_hz = 6.0\ndamping_ratio = 0.05\nmodal_mass_kg = 7.0\n";

/// Two at once, one that is over and one that is still to come.
const PUSH: &str = "[[effects.push.pushes]]\nstart_s = 0.6\ntime_s = 1.5\nforce_n = [30.0, 120.0, -50.0]\nplace_m = [0.5, 0.1, 0.4]\n\
    [[effects.push.pushes]]\nstart_s = 0.5\ntime_s = 3.0\nforce_n = [-10.0, 20.0, 90.0]\nplace_m = [-1.0, 0.2, 0.0]\n\
    [[effects.push.pushes]]\nstart_s = 0.1\ntime_s = 0.2\n[[effects.push.pushes]]\nstart_s = 5.0\ntime_s = 0.2\n";

#[test]
fn every_rate_is_that_of_the_equations() {
    let rubs = "[effects.pole_friction]\narm_m = 0.004\nregularising_rate_rad_per_s = 0.5\n";
    let sling = "[effects.sling]\nlength_m = 0.6\ndamping_s = 0.08\n";
    let feels = "[effects.feedback]\nstrength_rad_per_s = 0.8\nphase_rad = 0.6\nlatency_s = 0.15\n";
    let bilateral = CONTACT.replace("contact]", "contact]\nbilateral = true");
    let friction = "[effects.friction]\ncoefficient = 0.4\nregularising_velocity_m_per_s = 0.2\n";
    let side = [
        HOLD.to_owned(),
        sling.to_owned(),
        friction.to_owned(),
        format!("{HOLD}{sling}"),
        format!("{HOLD}{friction}"),
        format!("{HOLD}{sling}{friction}"),
        format!(
            "{friction}law = \"bristle\"\nbristle_stiffness_per_m = 12.0\nbristle_damping_s_per_m = 0.6\n"
        ),
    ];
    for side in &side {
        for law in [CONTACT, &bilateral] {
            check(
                &format!("{FIVE}{law}{side}{GAIT}{rubs}{TURN}{BENDS}{feels}"),
                1.7,
            );
            check(&format!("{FIVE}{law}{side}{GAIT}{rubs}{PUSH}"), 1.7);
        }
    }
    for exponent in ["1.0", "1.5"] {
        let law = format!("law = \"hunt-crossley\"\nexponent = {exponent}\n");
        check(
            &format!("{FIVE}{CONTACT}{law}{HOLD}{GAIT}{rubs}{BENDS}"),
            1.7,
        );
    }
    // So much damping that handles which part fast are let go while they are still pressed.
    let fast = CONTACT.replace("[450.0, 300.0, 410.0, 350.0, 390.0]", "9000.0");
    check(
        &format!("{FIVE}{fast}law = \"hunt-crossley\"\n{HOLD}{GAIT}"),
        1.7,
    );
    let draws = "[effects.frequency_spread]\nsd_hz = 0.2\n[effects.noise]\nphase_rad_per_sqrt_s = 0.3\ngrid_hz = 7.0\n";
    for graph in [
        "\"all\"",
        "\"chain\"",
        "{ edges = [[0, 1], [0, 4], [2, 4]] }",
    ] {
        let minds = format!("[effects.coupling]\nstrength_rad_per_s = 0.9\ngraph = {graph}\n");
        check(&format!("{FIVE}{GAIT}{draws}{minds}"), 1.7);
    }
    let grows = "[effects.lift]\ngain = 1.4\nonset_s = 0.8\nbuild_up_s = 2.0\n";
    let music = "[effects.music]\nbeat_hz = 2.3\nstrength_rad_per_s = [2.0, 1.5, 2.5, 1.0, 3.0]\nonset_s = 0.4\nbeat_phase_rad = 0.9\n";
    for more in [
        "build_up_s = 0.0\n",
        "build_up_s = 4.0\n",
        "build_up_s = 4.0\ntempo_changes = [{ at_s = 0.7, over_s = 0.8, beat_hz = 2.9 }, { at_s = 2.0, beat_hz = 1.7 }]\npauses = [{ from_s = 0.9, to_s = 1.1 }]\n",
    ] {
        // Before the onset, in the ramp, in the pause, behind it, behind the jump.
        for t_s in [0.2, 0.75, 1.0, 1.3, 1.9, 2.5] {
            check(&format!("{FIVE}{CONTACT}{GAIT}{grows}{music}{more}"), t_s);
        }
    }
    check(
        &format!("{FIVE}{CONTACT}{GAIT}[effects.lift]\ngain = 0.7\n"),
        0.3,
    );
    let phases = "[[0.1, 1.5, 4.0, 5.0], [0.2, 1.9, 4.1, 6.0], [0.3, 2.0, 3.0, 5.5], [1.0, 2.0, 4.0, 7.0], [0.0, 1.0, 1.5, 3.0]]";
    let measured =
        format!("[effects.measured]\nt_s = [0.0, 20.0, 45.0, 60.0]\nphase_rad = {phases}\n");
    check(&format!("{FIVE}{CONTACT}{GAIT}{music}{measured}"), 1.7);
    let places = |i: usize| {
        let at = |k: usize| {
            let wave = |a: usize| (1.3 * (i + 5 * k + 20 * a) as f64).sin();
            format!("[{:?}, {:?}, {:?}]", wave(0), wave(1), 1.0 + 0.05 * wave(2))
        };
        format!("[{}]", [0, 1, 2, 3].map(at).join(", "))
    };
    let shoulders = [0, 1, 2, 3, 4].map(places).join(", ");
    let measured =
        format!("[effects.measured]\nt_s = [0.0, 20.0, 45.0, 60.0]\nshoulder_m = [{shoulders}]\n");
    check(&format!("{FIVE}{CONTACT}{HOLD}{measured}"), 1.7);
}

/// With every choice of freedoms: what is left of the body's equations does no work along a free one.
#[test]
fn every_choice_of_freedoms_obeys_the_same_equations() {
    for mask in 1..64_u32 {
        let free: Vec<String> = (Freedom::ALL.iter().enumerate())
            .filter(|(i, _)| mask >> i & 1 == 1)
            .map(|(_, f)| format!("\"{}\"", format!("{f:?}").to_lowercase()))
            .collect();
        let rubs = "[effects.pole_friction]\narm_m = 0.02\n";
        let free = format!("freedom = [{}]\n", free.join(", "));
        for bends in ["", BENDS, PUSH] {
            check(
                &format!("{free}{FIVE}{CONTACT}{HOLD}{GAIT}{rubs}{bends}"),
                0.7,
            );
        }
    }
}

//! What a recording says of motions and forces that physics knows without a computer: frames, signs, units and stamps of every topic.

mod common;

use common::scene;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use recording::Signal;
use recording::read::{ReadOptions, Recording};
use recording::write::{RecordingWriter, WriterOptions};
use sim::model::Model;
use sim::record::Recorder;
use sim::run::{method_of, run_model, settings};
use std::f64::consts::TAU;

/// A recording and its signals.
struct Made {
    recording: Recording,
    signals: Vec<Signal>,
}

impl Made {
    fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("made.mcap");
        let scene = scene(&format!("name = \"made\"\n{text}"));
        let model = Model::new(&scene);
        let writer = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
        let mut recorder = Recorder::new(&model, writer).unwrap();
        let (_, outcome) = run_model(&model, method_of(&scene), &settings(&scene), &mut recorder);
        outcome.unwrap();
        recorder.finish().unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let recording = Recording::from_bytes(bytes, &ReadOptions::default()).unwrap();
        let (signals, findings) = recording.signals(&|_: &str| true).unwrap();
        assert!(findings.iter().all(|f| !f.kind.is_loss()), "{findings:?}");
        Self { recording, signals }
    }

    fn signal(&self, path: &str) -> &Signal {
        let found = self.signals.iter().find(|s| s.path == path);
        found.unwrap_or_else(|| panic!("{path} is not there"))
    }

    fn has(&self, path: &str) -> bool {
        self.signals.iter().any(|s| s.path == path)
    }

    fn at(&self, path: &str, k: usize) -> f64 {
        self.signal(path).values[k]
    }

    fn vector(&self, path: &str, k: usize) -> Vector3<f64> {
        let part = |axis: &str| self.at(&format!("{path}.{axis}"), k);
        Vector3::new(part("x"), part("y"), part("z"))
    }

    fn turn(&self, path: &str, k: usize) -> UnitQuaternion<f64> {
        let [x, y, z, w] = ["x", "y", "z", "w"].map(|axis| self.at(&format!("{path}.{axis}"), k));
        let q = Quaternion::new(w, x, y, z);
        assert!((q.norm() - 1.0).abs() < 1e-12, "{path}: {q}");
        UnitQuaternion::new_unchecked(q)
    }

    /// A handle's force on the body in the world, N.
    fn force(&self, handle: usize, k: usize) -> Vector3<f64> {
        let along = self.vector(&format!("/handles/forces.tangential_n[{handle}]"), k);
        let normal = self.at(&format!("/handles/forces.normal_n[{handle}]"), k);
        along + Vector3::z() * normal
    }

    /// Bytes of the first message of a topic.
    fn bytes(&self, topic: &str) -> Vec<u8> {
        let mut first = None;
        let mut keep = |m: &recording::read::RawMessage<'_>| {
            first.get_or_insert_with(|| m.data.to_vec());
        };
        self.recording
            .messages(&|name: &str| name == topic, &mut keep)
            .unwrap();
        first.unwrap_or_else(|| panic!("{topic} is empty"))
    }
}

#[track_caller]
fn near(what: &str, found: f64, expected: f64, within: f64) {
    let off = (found - expected).abs();
    assert!(off <= within, "{what}: found {found}, expected {expected}");
}

#[track_caller]
fn same(what: &str, found: Vector3<f64>, expected: Vector3<f64>, within: f64) {
    let off = (found - expected).norm();
    assert!(off <= within, "{what}: found {found}, expected {expected}");
}

const HANDLES: [[f64; 3]; 4] = [
    [1.0, 0.3, 0.1],
    [1.0, -0.3, 0.1],
    [-0.8, 0.3, 0.1],
    [-0.8, -0.3, 0.1],
];

fn place(k: usize) -> Vector3<f64> {
    Vector3::from(HANDLES[k])
}

fn carriers() -> String {
    format!("[carriers]\nhandles_m = {HANDLES:?}\nfrequency_hz = [2.0, 2.1, 1.9, 2.05]\n")
}

/// A ball that is thrown and spins: a parabola and a steady turn, in every topic that tells of the body.
#[test]
fn a_thrown_ball_is_where_it_must_be() {
    let made = Made::new(&format!(
        "duration_s = 2.0\nlog_rate_hz = 25.0\nepoch_s = 1000.25\n\
         [body]\nmass_kg = 10.0\ninertia_kg_m2 = {{ xx = 2.0, yy = 2.0, zz = 2.0 }}\n\
         [start]\nheight_m = 50.0\nposition_m = [1.0, -2.0]\nroll_pitch_yaw_deg = [20.0, -35.0, 70.0]\n\
         velocity_m_per_s = [3.0, -4.0, 5.0]\nangular_velocity_rad_per_s = [0.5, -1.0, 1.5]\n{}\
         [effects.contact]\n[effects.imu]\nideal = true\nrate_hz = 50.0\n\
         sensors = [{{ on = \"rath\", clock_offset_s = 3.0, clock_drift_ppm = 100.0 }}]\n",
        carriers()
    ));
    let [roll, pitch, yaw] = [20.0f64, -35.0, 70.0].map(f64::to_radians);
    let start = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    let spin = Vector3::new(0.5, -1.0, 1.5);
    let times_ns = &made.signal("/rath/state.time_s").times_ns;
    assert_eq!(times_ns.len(), 51);
    for k in 0..51 {
        let t_s = 0.04 * k as f64;
        let stamp_ns = 1_000_250_000_000 + 40_000_000 * k as i64;
        assert_eq!(times_ns[k], stamp_ns);
        near("time", made.at("/rath/state.time_s", k), t_s, 1e-12);
        for stamp in [
            "/tf.transforms[0].header",
            "/tf.transforms[4].header",
            "/rath/motion.header",
        ] {
            let part = |name: &str| made.at(&format!("{stamp}.stamp.{name}"), k) as i64;
            assert_eq!(
                part("sec") * 1_000_000_000 + part("nanosec"),
                stamp_ns,
                "{stamp}"
            );
        }
        let entity = "/scene.entities[0]";
        let part = |name: &str| made.at(&format!("{entity}.timestamp.{name}"), k) as i64;
        assert_eq!(part("seconds") * 1_000_000_000 + part("nanos"), stamp_ns);

        let velocity = Vector3::new(3.0, -4.0, 5.0 - 9.81 * t_s);
        let position = Vector3::new(1.0, -2.0, 50.0)
            + Vector3::new(3.0, -4.0, 5.0) * t_s
            + Vector3::z() * (-0.5 * 9.81 * t_s * t_s);
        let attitude = start * UnitQuaternion::from_scaled_axis(spin * t_s);
        for (path, expected) in [
            ("/rath/state.position_m", position),
            ("/rath/state.velocity_m_per_s", velocity),
            ("/rath/state.angular_velocity_rad_per_s", spin),
            ("/tf.transforms[0].transform.translation", position),
        ] {
            same(path, made.vector(path, k), expected, 1e-7);
        }
        for turn in [
            "/rath/state.orientation",
            "/tf.transforms[0].transform.rotation",
        ] {
            near(turn, made.turn(turn, k).angle_to(&attitude), 0.0, 1e-6);
        }
        let [roll, pitch, yaw] =
            ["roll", "pitch", "yaw"].map(|angle| made.at(&format!("/rath/state.{angle}_rad"), k));
        let angles = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        near("roll, pitch, yaw", angles.angle_to(&attitude), 0.0, 1e-6);
        let joint = |what: &str, i: usize| made.at(&format!("/rath/motion.{what}[{i}]"), k);
        for (i, expected) in [position.z, roll, pitch].into_iter().enumerate() {
            near("joint", joint("position", i), expected, 1e-7);
            near(
                "its rate",
                joint("velocity", i),
                [velocity.z, 0.5, -1.0][i],
                1e-7,
            );
            near("its effort", joint("effort", i), 0.0, 0.0);
        }
        let kinetic_j = 5.0 * velocity.norm_squared() + spin.norm_squared();
        near(
            "kinetic energy",
            made.at("/energy.kinetic_j", k),
            kinetic_j,
            1e-4,
        );
        let risen_j = made.at("/energy.potential_j", k) - made.at("/energy.potential_j", 0);
        near(
            "potential energy",
            risen_j,
            98.1 * (position.z - 50.0),
            1e-4,
        );
        for handle in 0..4 {
            near("force", made.force(handle, k).norm(), 0.0, 0.0);
            near(
                "contact",
                made.at(&format!("/handles/forces.in_contact[{handle}]"), k),
                0.0,
                0.0,
            );
            let mark = format!("{entity}.spheres[{handle}]");
            let expected = position + attitude * place(handle);
            same(
                "mark",
                made.vector(&format!("{mark}.pose.position"), k),
                expected,
                1e-6,
            );
            near(
                "size of a mark that is slack",
                made.at(&format!("{mark}.size.x"), k),
                0.16,
                1e-12,
            );
        }
    }
    assert!(!made.has("/scene.entities[0].arrows[0].shaft_length"));
    // A body in flight feels nothing but its turning; its sensor's clock is its own.
    let ticks = &made.signal("/imu/rath.angular_velocity.x").times_ns;
    assert!(ticks.len() > 95, "{}", ticks.len());
    for k in 0..ticks.len() {
        same(
            "gyroscope",
            made.vector("/imu/rath.angular_velocity", k),
            spin,
            1e-6,
        );
        same(
            "accelerometer",
            made.vector("/imu/rath.linear_acceleration", k),
            Vector3::zeros(),
            1e-5,
        );
        // Fifty a second, by a clock that shows 3 s at 0.
        let stamp_ns = ticks[k] - 1_003_250_000_000;
        let off_ns = (stamp_ns as f64 / 20e6).round() * 20e6 - stamp_ns as f64;
        near("stamp", off_ns, 0.0, 1.0);
    }
    let frames = made.bytes("/tf");
    let mut from = 0;
    for name in ["world", "rath", "world", "carrier_1", "world", "carrier_2"] {
        let rest = &frames[from..];
        let found = rest.windows(name.len()).position(|w| w == name.as_bytes());
        from += found.unwrap_or_else(|| panic!("{name} is missing or out of order"));
    }
    let urdf = made.bytes("/robot_description");
    let urdf = String::from_utf8_lossy(&urdf);
    // Poles through the handles, 0.2 m beyond them; carriers that reach from the ground to their shoulders.
    for shape in [
        "xyz=\"0.1 0.3 0.1\" rpy=\"0 1.5707963267948966 0\"/><geometry><cylinder radius=\"0.04\" length=\"2.2\"",
        "xyz=\"0.1 -0.3 0.1\"",
        "<link name=\"carrier_4\"><visual><origin xyz=\"0 0 -0.5\"/><geometry><cylinder radius=\"0.15\" length=\"1\"",
    ] {
        assert!(urdf.contains(shape), "{shape}: {urdf}");
    }
}

/// At rest the handles' forces add up to the weight and their arrows to half a metre for each, whichever way it pulls; arrows begin at the handles.
#[test]
fn arrows_add_up_to_the_weight() {
    let gravity = Vector3::new(1.0, -2.0, -9.0);
    let made = Made::new(&format!(
        "duration_s = 120.0\nlog_rate_hz = 1.0\nanalysis_start_s = 7.0\n[body]\ngravity_m_per_s2 = [1.0, -2.0, -9.0]\n{}\
         [effects.contact]\n[effects.hold]\n[effects.imu]\nrate_hz = 100.0\n\
         gyro_noise_rad_per_s_per_sqrt_hz = 1e-3\naccel_noise_m_per_s2_per_sqrt_hz = 2e-2\n\
         sensors = [{{ on = \"rath\" }}]\n",
        carriers()
    ));
    let (k, weight_n) = (120, 60.0 * gravity.norm());
    let position = made.vector("/tf.transforms[0].transform.translation", k);
    let attitude = made.turn("/tf.transforms[0].transform.rotation", k);
    let (mut force, mut arrows) = (Vector3::zeros(), Vector3::zeros());
    for handle in 0..4 {
        let on_handle = made.force(handle, k);
        let arrow = format!("/scene.entities[0].arrows[{handle}]");
        let length = made.at(&format!("{arrow}.shaft_length"), k)
            + made.at(&format!("{arrow}.head_length"), k);
        let along = made.turn(&format!("{arrow}.pose.orientation"), k) * Vector3::x() * length;
        // Half a metre for a quarter of the weight.
        same("arrow", along, on_handle * (2.0 / weight_n), 1e-9);
        let expected = position + attitude * place(handle);
        same(
            "where it begins",
            made.vector(&format!("{arrow}.pose.position"), k),
            expected,
            1e-9,
        );
        let pressed_m = made.at(&format!("/handles/forces.compression_m[{handle}]"), k);
        near("compression", pressed_m, on_handle.z / 3000.0, 1e-9);
        let shoulder = made.vector(
            &format!("/tf.transforms[{}].transform.translation", handle + 1),
            k,
        );
        near(
            "shoulder over handle",
            shoulder.z - expected.z,
            pressed_m,
            1e-9,
        );
        near(
            "contact",
            made.at(&format!("/handles/forces.in_contact[{handle}]"), k),
            1.0,
            0.0,
        );
        let mark = format!("/scene.entities[0].spheres[{handle}]");
        near(
            "size of a mark that carries",
            made.at(&format!("{mark}.size.x"), k),
            0.1,
            1e-12,
        );
        force += on_handle;
        arrows += along;
    }
    same("forces", force, gravity * -60.0, 1e-6);
    same("arrows, m", arrows, -2.0 * gravity.normalize(), 1e-8);
    let effort = |i: usize| made.at(&format!("/rath/motion.effort[{i}]"), k);
    near("lift", effort(0), 540.0, 1e-6);
    near("moment about x", effort(1), 0.0, 1e-6);
    near("moment about y", effort(2), 0.0, 1e-6);
    let said = &made.recording.info().metadata["rath"];
    let number = |key: &str| said[key].parse::<f64>().unwrap();
    near("mass", number("mass_kg"), 60.0, 0.0);
    near("gravity", number("gravity_m_per_s2"), gravity.norm(), 1e-12);
    near(
        "start of the analysis",
        number("analysis_start_s"),
        7.0,
        0.0,
    );
    // White noise of density σ at a rate: σ²·rate.
    for axis in [0, 4, 8] {
        near(
            "gyroscope's variance",
            made.at(&format!("/imu/rath.angular_velocity_covariance[{axis}]"), 0),
            1e-4,
            1e-12,
        );
        near(
            "accelerometer's",
            made.at(
                &format!("/imu/rath.linear_acceleration_covariance[{axis}]"),
                0,
            ),
            0.04,
            1e-9,
        );
    }
}

/// What the log calls forces and moments is what moves the body: Newton and Euler from the log's own velocities.
#[test]
fn logged_forces_and_moments_move_the_body() {
    let made = Made::new(&format!(
        "duration_s = 1.0\nlog_rate_hz = 1000.0\n\
         [body]\nmass_kg = 50.0\ninertia_kg_m2 = {{ xx = 8.0, yy = 15.0, zz = 12.0, xy = 1.0 }}\n\
         [start]\nroll_pitch_yaw_deg = [10.0, 5.0, 40.0]\nangular_velocity_rad_per_s = [0.5, 1.0, -0.7]\n{}\
         [effects.contact]\nbilateral = true\n[effects.hold]\n[effects.gait]\n",
        carriers()
    ));
    let inertia = Matrix3::new(8.0, 1.0, 0.0, 1.0, 15.0, 0.0, 0.0, 0.0, 12.0);
    let slope =
        |path: &str, k: usize| (made.vector(path, k + 1) - made.vector(path, k - 1)) / 0.002;
    // What is tied pulls too, and is in contact.
    let (mut pulls, mut loose) = (0, 0);
    for handle in 0..4 {
        let of = |what: &str| {
            &made
                .signal(&format!("/handles/forces.{what}[{handle}]"))
                .values
        };
        pulls += of("normal_n").iter().filter(|n| **n < 0.0).count();
        loose += of("in_contact").iter().filter(|c| **c != 1.0).count();
    }
    assert!(pulls > 10 && loose == 0, "{pulls} {loose}");
    let (mut worst, mut largest) = ([0.0f64; 3], [0.0f64; 3]);
    for k in 1..1000 {
        let force: Vector3<f64> = (0..4).map(|handle| made.force(handle, k)).sum();
        let moved = (slope("/rath/state.velocity_m_per_s", k) + Vector3::z() * 9.81) * 50.0;
        let path = "/rath/state.angular_velocity_rad_per_s";
        let spin = made.vector(path, k);
        let turned = inertia * slope(path, k) + spin.cross(&(inertia * spin));
        let effort = |i: usize| made.at(&format!("/rath/motion.effort[{i}]"), k);
        near("lift", effort(0), force.z, 1e-9);
        for (i, [found, expected]) in [
            [(moved - force).norm(), force.norm()],
            [effort(1) - turned.x, effort(1)],
            [effort(2) - turned.y, effort(2)],
        ]
        .into_iter()
        .enumerate()
        {
            worst[i] = worst[i].max(found.abs());
            largest[i] = largest[i].max(expected.abs());
        }
    }
    // A difference over 2 ms of what swings with some 50 rad/s.
    for i in 0..3 {
        assert!(
            worst[i] < 2e-3 * largest[i],
            "{i}: {worst:?} of {largest:?}"
        );
    }
}

/// Beats are written until the run ends, however long ago the last sample was.
#[test]
fn every_beat_is_written() {
    let numbers = |log_rate_hz: f64| {
        let made = Made::new(&format!(
            "duration_s = 9.9\nlog_rate_hz = {log_rate_hz}\n{}[effects.contact]\n[effects.gait]\n\
             [effects.music]\nbeat_hz = 2.0\nonset_s = 0.0\n",
            carriers()
        ));
        made.signal("/beat.number").values.clone()
    };
    let all = numbers(30.0);
    assert!(all.len() >= 19, "{all:?}");
    assert_eq!(numbers(0.07), all);
}

/// Carriers go up and down with their phases, face where the party goes, and keep their places in it.
#[test]
fn carriers_face_and_step_as_they_must() {
    let made = Made::new(&format!(
        "duration_s = 6.0\nlog_rate_hz = 20.0\n{}walk_m_per_s = [1.0, 0.0, 0.0]\n\
         [effects.contact]\n[effects.hold]\n[effects.gait]\namplitude_m = 0.05\n\
         [effects.path]\nturn_deg = 90.0\nturn_start_s = 1.0\nturn_time_s = 4.0\n\
         [effects.music]\nbeat_hz = 2.5\nonset_s = 1.2\nbuild_up_s = 0.0\n\
         [effects.drum]\nclock_offset_s = 2.0\n",
        carriers()
    ));
    let carrier = |i: usize, k: usize| {
        made.vector(
            &format!("/tf.transforms[{}].transform.translation", i + 1),
            k,
        )
    };
    for k in 0..=120 {
        let t_s = 0.05 * k as f64;
        let u = ((t_s - 1.0) / 4.0f64).clamp(0.0, 1.0);
        let heading = 0.25 * TAU * u.powi(3) * (10.0 - 15.0 * u + 6.0 * u * u);
        let facing = UnitQuaternion::from_scaled_axis(Vector3::z() * heading);
        let mut sum = [0.0; 2];
        for i in 0..4 {
            let turn = made.turn(&format!("/tf.transforms[{}].transform.rotation", i + 1), k);
            near("heading", turn.angle_to(&facing), 0.0, 1e-9);
            let phase = made.at(&format!("/carriers/phases.phase_rad[{i}]"), k);
            near(
                "shoulder, m",
                carrier(i, k).z,
                1.0 + 0.05 * phase.sin(),
                1e-9,
            );
            let natural = made.at(
                &format!("/carriers/phases.natural_frequency_rad_per_s[{i}]"),
                k,
            );
            near(
                "natural frequency",
                natural,
                TAU * [2.0, 2.1, 1.9, 2.05][i],
                1e-9,
            );
            let apart = carrier(i, k) - carrier(0, k);
            let expected = facing * (place(i) - place(0));
            same(
                "place in the party",
                Vector3::new(apart.x, apart.y, 0.0),
                expected,
                1e-6,
            );
            sum = [sum[0] + phase.sin(), sum[1] + phase.cos()];
        }
        near(
            "order",
            made.at("/carriers/phases.order_parameter", k),
            sum[0].hypot(sum[1]) / 4.0,
            1e-9,
        );
        near(
            "a beat sounds",
            made.at("/carriers/phases.beat_present", k),
            f64::from(k >= 24),
            0.0,
        );
        for what in ["work", "dissipated"] {
            let shares = (0..).map(|i| format!("/energy.shares[{i}].{what}_j"));
            let sum: f64 = shares
                .take_while(|path| made.has(path))
                .map(|path| made.at(&path, k))
                .sum();
            let whole = if what == "work" {
                "work_in_j"
            } else {
                "dissipated_j"
            };
            near(whole, sum, made.at(&format!("/energy.{whole}"), k), 1e-6);
        }
    }
    let [before, last] = [100, 120].map(|k| carrier(0, k));
    near("walks along y at last, m/s", last.y - before.y, 1.0, 1e-6);
    near("and not along x, m/s", last.x - before.x, 0.0, 1e-6);
    // A block of sound is stamped where it begins, by a clock that shows 2 s at 0.
    assert_eq!(
        made.signal("/audio/drum.sample_rate").times_ns[0],
        2_000_000_000
    );
    // Beats are the whole turns of the beat's phase, which the log tells of from the first beat on.
    let (beats, psi) = (
        made.signal("/beat.time_s"),
        made.signal("/carriers/phases.beat_phase_rad"),
    );
    assert_eq!(psi.values.len(), 97);
    // On the first sample that hears them and on the last one too.
    let [first, last] = [psi.values[0] / TAU - 1e-9, psi.values[96] / TAU + 1e-9];
    assert_eq!(beats.values.len() as f64, last.floor() - first.ceil() + 1.0);
    for (k, t_s) in beats.values.iter().enumerate() {
        near("number", made.at("/beat.number", k), k as f64, 0.0);
        near("tempo", made.at("/beat.tempo_hz", k), 2.5, 1e-12);
        near("stamp, ns", beats.times_ns[k] as f64, t_s * 1e9, 1.0);
        // The log's own phase, from the sample before.
        let i = psi.times_ns.partition_point(|t| *t <= beats.times_ns[k]) - 1;
        let since_s = (beats.times_ns[k] - psi.times_ns[i]) as f64 * 1e-9;
        let turns = psi.values[i] / TAU + 2.5 * since_s;
        near("turns", turns, turns.round(), 1e-7);
    }
}

/// Each of a dozen carries its share, which is less than a tenth of the weight: their arrows are blue.
#[test]
fn a_fair_share_is_no_light_load() {
    let handles: Vec<[f64; 3]> = (0..12)
        .map(|i| [0.2 * f64::from(i) - 1.1, 0.0, 0.1])
        .collect();
    let made = Made::new(&format!(
        "duration_s = 1.0\n[carriers]\nhandles_m = {handles:?}\n[effects.contact]\n"
    ));
    for i in 0..12 {
        near(
            "blue",
            made.at(&format!("/scene.entities[0].arrows[{i}].color.b"), 30),
            0.70,
            1e-12,
        );
    }
}

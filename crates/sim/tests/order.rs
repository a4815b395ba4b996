//! The observed order of every method in the table: error against step.
//!
//! Adaptive methods are held to equal steps by a grid of phase noise of strength zero: a step may not cross a grid point, and the
//! tolerance is so loose that nothing else shortens it. An implicit method iterates only as far as its tolerance asks: it chooses its
//! steps by two tolerances, and the error is held against the mean step. `radau15` is held to equal steps by a test of its own, beside it.

use sim::effects::noise::Noise;
use sim::model::Model;
use sim::run::{Sample, run_model};
use sim::scene::{Scene, parse};
use sim::solve::{METHODS, Method, Settings, method};

/// A body that tumbles freely: smooth, and far from the separatrix.
const TUMBLE: &str = r#"
name = "tumble"
duration_s = 10.0
log_rate_hz = 1.0
[body]
gravity_m_per_s2 = [0.0, 0.0, 0.0]
inertia_kg_m2 = { xx = 1.0, yy = 2.0, zz = 2.5 }
[start]
height_m = 0.0
angular_velocity_rad_per_s = [1.0, 0.7, 2.0]
[solver]
energy = false
"#;

/// Two tied handles on a walking pair that a drum pulls: every term is smooth.
const TIED: &str = r#"
name = "tied"
duration_s = 10.0
log_rate_hz = 1.0
[body]
mass_kg = 60.0
[carriers]
frequency_hz = [1.9, 2.05]
initial_phase_rad = [0.3, 1.2]
[start]
roll_pitch_yaw_deg = [5.0, 0.0, 0.0]
[effects.contact]
bilateral = true
damping_n_s_per_m = 40.0
[effects.hold]
[effects.gait]
amplitude_m = 0.05
[effects.music]
beat_hz = 2.1
strength_rad_per_s = 2.0
[solver]
energy = false
"#;

/// The scene, and settings of a run in steps of `step_s`, or at a tolerance that makes an implicit method take steps of that order.
fn held(scene: &Scene, method: &Method, step_s: f64) -> (Scene, Settings) {
    let mut scene = scene.clone();
    let implicit = method.name.starts_with("radau");
    if implicit {
        // Its samples come from a polynomial of lower order: only the end shows the method's.
        scene.log_rate_hz = 0.1;
    } else if method.adaptive {
        scene.effects.noise = Some(Noise {
            phase_rad_per_sqrt_s: 0.0,
            grid_hz: 1.0 / step_s,
        });
    }
    let settings = Settings {
        tolerance: if implicit {
            4096.0 * step_s.powi(4)
        } else {
            1e9
        },
        step_s,
        most_evaluations: 1 << 40,
    };
    (scene, settings)
}

/// All states that are logged, and the mean step.
fn course(scene: &Scene, method: &Method, settings: &Settings) -> (Vec<f64>, f64) {
    let model = Model::new(scene);
    let mut all = Vec::new();
    let (stats, outcome) = run_model(&model, method, settings, &mut |s: &Sample| {
        let pose = s.pose;
        for of in [pose.position_m, pose.velocity_m_per_s, pose.spin_rad_per_s] {
            all.extend_from_slice(&of);
        }
        all.extend_from_slice(&pose.orientation);
        all.extend_from_slice(&s.phase_rad);
        true
    });
    outcome.unwrap();
    (all, scene.duration_s / stats.steps as f64)
}

/// The power of the step with which the error falls between two steps: that of ten moments together, for at a single one the first
/// term of the error may happen to vanish.
fn observed(scene: &Scene, of: &Method, step_s: f64) -> f64 {
    let at = |step_s: f64| {
        let (scene, settings) = held(scene, of, step_s);
        let fine = Settings {
            tolerance: 1e-12,
            ..settings.clone()
        };
        let (truth, _) = course(&scene, method("dop853").unwrap(), &fine);
        let (states, mean_s) = course(&scene, of, &settings);
        let square = |(a, b): (&f64, &f64)| (a - b) * (a - b);
        let error = states.iter().zip(&truth).map(square).sum::<f64>().sqrt();
        (error, mean_s)
    };
    let ((e1, h1), (e2, h2)) = (at(step_s), at(0.5 * step_s));
    (e1 / e2).ln() / (h1 / h2).ln()
}

#[test]
fn every_method_shows_its_order() {
    // And the steps at which orders 8 and 5 show: large enough for errors far above rounding, small enough to be stable.
    let scenes = [
        ("tumble", TUMBLE, [1.0 / 4.0, 1.0 / 32.0]),
        ("tied", TIED, [1.0 / 64.0, 1.0 / 128.0]),
    ];
    for (name, text, [eight_s, five_s]) in scenes {
        let scene = parse(name, text, &[]).unwrap_or_else(|e| panic!("{e}"));
        for method in METHODS
            .iter()
            .filter(|m| !["auto", "radau15"].contains(&m.name))
        {
            // The other orders have room.
            let step_s = match method.order {
                1 => 1.0 / 2000.0,
                // Adams' region of stability is a tenth of RK4's.
                _ if method.name.starts_with("adams") => 1.0 / 500.0,
                2..=4 => 1.0 / 100.0,
                5 => five_s,
                _ => eight_s,
            };
            let order = observed(&scene, method, step_s);
            let claimed = f64::from(method.order);
            assert!(
                (order - claimed).abs() < 0.1 * claimed,
                "{name}: {} claims order {claimed} and shows {order:.2}",
                method.name
            );
        }
    }
}

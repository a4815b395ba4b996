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
log_rate_hz = 0.1
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
log_rate_hz = 0.1
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

/// The state at the end of a run in steps of `step_s`, or at a tolerance that makes an implicit method take steps of that order; and
/// the mean step.
fn end(scene: &Scene, method: &Method, step_s: f64) -> (Vec<f64>, f64) {
    let scene = scene.clone();
    if method.name.starts_with("radau") {
        let settings = Settings {
            tolerance: 4096.0 * step_s.powi(4),
            step_s: f64::NAN,
            most_evaluations: 1 << 40,
        };
        return last(&Model::new(&scene), method, &settings);
    }
    let mut scene = scene;
    if method.adaptive {
        scene.effects.noise = Some(Noise {
            phase_rad_per_sqrt_s: 0.0,
            grid_hz: 1.0 / step_s,
        });
    }
    let settings = Settings {
        tolerance: 1e9,
        step_s,
        most_evaluations: 1 << 40,
    };
    last(&Model::new(&scene), method, &settings)
}

fn last(model: &Model, method: &Method, settings: &Settings) -> (Vec<f64>, f64) {
    let mut last = Vec::new();
    let (stats, outcome) = run_model(model, method, settings, &mut |s: &Sample| {
        let pose = s.pose;
        last = [pose.position_m, pose.velocity_m_per_s, pose.spin_rad_per_s].concat();
        last.extend_from_slice(&pose.orientation);
        last.extend_from_slice(&s.phase_rad);
        true
    });
    outcome.unwrap();
    (last, model.scene.duration_s / stats.steps as f64)
}

/// The power of the step with which the error falls between two steps.
fn observed(scene: &Scene, truth: &[f64], of: &Method, step_s: f64) -> f64 {
    let at = |step_s: f64| {
        let square = |(a, b): (&f64, &f64)| (a - b) * (a - b);
        let (state, mean_s) = end(scene, of, step_s);
        let error = state.iter().zip(truth).map(square).sum::<f64>().sqrt();
        (error, mean_s)
    };
    let ((e1, h1), (e2, h2)) = (at(step_s), at(0.5 * step_s));
    (e1 / e2).ln() / (h1 / h2).ln()
}

#[test]
fn every_method_shows_its_order() {
    // The steps at which order 8 shows: large enough for errors far above rounding, small enough to be stable.
    for (name, text, long_s) in [("tumble", TUMBLE, 0.25), ("tied", TIED, 0.03125)] {
        let scene = parse(name, text, &[]).unwrap_or_else(|e| panic!("{e}"));
        let settings = Settings {
            tolerance: 1e-12,
            step_s: f64::NAN,
            most_evaluations: 1 << 40,
        };
        let (truth, _) = last(&Model::new(&scene), method("dop853").unwrap(), &settings);
        for method in METHODS
            .iter()
            .filter(|m| !["auto", "radau15"].contains(&m.name))
        {
            // Small enough for the first term of the error to rule, large enough for errors far above rounding.
            let step_s = match method.order {
                1 => 1.0 / 2000.0,
                // Adams' region of stability is a tenth of RK4's.
                _ if method.name.starts_with("adams") => 1.0 / 500.0,
                2..=5 => 1.0 / 100.0,
                _ => long_s,
            };
            let order = observed(&scene, &truth, method, step_s);
            let claimed = f64::from(method.order);
            assert!(
                (order - claimed).abs() < 0.1 * claimed,
                "{name}: {} claims order {claimed} and shows {order:.2}",
                method.name
            );
        }
    }
}

//! `auto` goes over to the implicit method where the contact is stiff, stays explicit where it is not, and agrees with both.

use sim::model::Model;
use sim::run::{Sample, run_model};
use sim::scene::{Scene, builtin, parse};
use sim::solve::{Settings, Stats, method};

fn course(scene: &Scene, name: &str, tolerance: f64) -> (Vec<f64>, Stats) {
    let settings = Settings {
        tolerance,
        step_s: f64::NAN,
        most_evaluations: 1 << 40,
    };
    let mut heights = Vec::new();
    let (stats, outcome) = run_model(
        &Model::new(scene),
        method(name).unwrap(),
        &settings,
        &mut |s: &Sample| {
            heights.push(s.pose.position_m[2]);
            true
        },
    );
    outcome.unwrap();
    (heights, stats)
}

fn worst(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let apart = a.iter().zip(b).map(|(x, y)| (x - y).abs());
    apart.fold(0.0, f64::max)
}

/// `music` with contacts that damp in microseconds.
fn stiff(freedom: &str) -> Scene {
    let settings = [
        "duration_s=10",
        freedom,
        "effects.contact.stiffness_n_per_m=3e6",
        "effects.contact.damping_n_s_per_m=4e5",
    ]
    .map(str::to_owned);
    parse("music", builtin("music").unwrap(), &settings).unwrap()
}

#[test]
fn stiff_contacts_are_solved_implicitly_and_right() {
    // A way that turns is not evaluated side by side.
    let scene = stiff("effects.path.turn_deg=1.0");
    let (auto, stats) = course(&scene, "auto", 1e-5);
    assert!(
        stats.implicit > 100 && stats.implicit > stats.steps * 9 / 10,
        "{stats:?}"
    );
    let (explicit, explicit_stats) = course(&scene, "dop853", 1e-7);
    assert_eq!(stats.events, explicit_stats.events);
    let apart = worst(&auto, &explicit);
    assert!(apart < 1e-5, "{apart:e}");
    assert!(stats.evaluations * 3 < explicit_stats.evaluations);
}

#[test]
fn sweeps_solve_stiff_contacts_as_they_are() {
    let scene = stiff(r#"freedom=["x","y","height","roll","tilt","yaw"]"#);
    let (auto, stats) = course(&scene, "auto", 1e-5);
    let (explicit, explicit_stats) = course(&scene, "dop853", 1e-7);
    assert_eq!(stats.events, explicit_stats.events);
    assert!(stats.steps * 10 < explicit_stats.steps, "{stats:?}");
    let apart = worst(&auto, &explicit);
    assert!(apart < 1e-5, "{apart:e}");
}

#[test]
fn what_is_not_stiff_stays_explicit() {
    // Scenes in which nobody stands still: at rest every contact is stiff, since nothing but stability limits a step.
    for name in ["music", "baseline", "strict-contact", "eight-carriers"] {
        let mut scene = parse(name, builtin(name).unwrap(), &[]).unwrap();
        scene.duration_s = 20.0;
        for tolerance in [1e-3, 1e-8] {
            let (_, stats) = course(&scene, "auto", tolerance);
            assert_eq!(stats.implicit, 0, "{name} at {tolerance:e}");
        }
    }
}

/// Friction at the shoulders damps a yaw at 1,600 per second and more where nothing slides, up to five times what Adams–Bashforth can at 1 ms: it is taken exactly,
/// as the other dampers are.
#[test]
fn friction_does_not_limit_steps_with_exact_damping() {
    let soft = "effects.friction={regularising_velocity_m_per_s=0.1}";
    let hard = "effects.friction={regularising_velocity_m_per_s=0.01}";
    let bristles = "effects.friction={law=\"bristle\",bristle_damping_s_per_m=5.0}";
    for (friction, step_s) in [
        (soft, 1e-3),
        (soft, 3e-3),
        (hard, 1e-3),
        (bristles, 1e-3),
        (bristles, 3e-3),
    ] {
        let effects = [friction, "effects.hold=false", "effects.sling=false"];
        let mut scene = parse(
            "baseline",
            builtin("baseline").unwrap(),
            &effects.map(String::from),
        )
        .unwrap();
        scene.duration_s = 2.0;
        let model = Model::new(&scene);
        let squares = |name: &str| {
            let settings = Settings {
                tolerance: 1e-8,
                step_s,
                most_evaluations: 1 << 40,
            };
            let mut sum = 0.0;
            let (_, outcome) = run_model(
                &model,
                method(name).unwrap(),
                &settings,
                &mut |s: &Sample| {
                    let forces = s.tangential_n.iter().flatten();
                    sum += forces.map(|t| t * t).sum::<f64>();
                    true
                },
            );
            outcome.unwrap();
            sum
        };
        let ratio = squares("adams4") / squares("dop853");
        assert!(
            (ratio - 1.0).abs() < 0.01,
            "{friction} at {step_s}: {ratio}"
        );
    }
}

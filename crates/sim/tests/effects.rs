//! Every effect against a closed form or a conservation law of its own (phases, contact, gait, hold and pole friction: `theory_*`).

mod common;

use common::{rates_at_start, samples, scene};
use sim::model::Model;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Carriers that all mind each other on a graph are the mean field; a chain of three has the links it should have.
#[test]
fn a_complete_graph_is_the_mean_field() {
    let with = |graph: &str| {
        let (names, rates) = rates_at_start(&scene(&format!(
            r#"
            name = "net"
            [carriers]
            handles_m = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [-2.0, 0.0, 0.0], [1.0, 1.0, 0.0]]
            initial_phase_rad = [0.3, 1.4, 2.2, 4.0]
            [effects.coupling]
            strength_rad_per_s = 0.7
            graph = {graph}
            "#
        )));
        let first = names.iter().position(|n| n == "phase_1_rad").unwrap();
        rates[first..first + 4]
            .iter()
            .map(|r| r - TAU * 2.0)
            .collect::<Vec<f64>>()
    };
    let all = with("\"all\"");
    let complete = with("{ edges = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]] }");
    for (a, b) in all.iter().zip(&complete) {
        assert!((a - b).abs() < 1e-14, "{all:?} {complete:?}");
    }
    // Along the pole y = 0 the order is 2, 0, 1; the carrier of the other pole stands alone.
    let chain = with("\"chain\"");
    let pull = |a: f64, b: f64| (b - a).sin();
    let expected = [
        0.7 / 3.0 * (pull(0.3, 2.2) + pull(0.3, 1.4)),
        0.35 * pull(1.4, 0.3),
        0.35 * pull(2.2, 0.3),
        0.0,
    ];
    for (a, b) in chain.iter().zip(expected) {
        assert!((a - b).abs() < 1e-14, "{chain:?} {expected:?}");
    }
}

/// Two in a chain lock at sin δ = Δω/K_c like two in the mean field: d_i + 1 = N = 2.
#[test]
fn a_chain_of_two_locks_like_the_mean_field() {
    let lag = |graph: &str| {
        let all = samples(&scene(&format!(
            "name = \"two\"\n[carriers]\nfrequency_hz = [2.0, 2.05]\n[effects.coupling]\nstrength_rad_per_s = 0.9\ngraph = \"{graph}\""
        )));
        let last = all.last().unwrap();
        last.phase_rad[1] - last.phase_rad[0]
    };
    let expected = (TAU * 0.05 / 0.9).asin();
    assert!((lag("chain") - expected).abs() < 1e-7 && (lag("all") - expected).abs() < 1e-7);
}

/// Under a steady load ℓ the gait is Adler's with a beat at rest: one turn takes 2π/√(ω² − κ²(ℓ − 1)²).
///
/// Two carriers under an immovable body that weighs what both springs push together: the lower shoulder feels 0.5, the upper 1.5.
#[test]
fn val_feedback_under_a_steady_load() {
    let omega = TAU * 0.5;
    let kappa = 4.0_f64;
    let rate = (omega * omega - (kappa * 0.5).powi(2)).sqrt();
    let scene = scene(&format!(
        r#"
        name = "felt"
        freedom = ["x"]
        duration_s = {:?}
        log_rate_hz = {:?}
        [body]
        mass_kg = 60.0
        gravity_m_per_s2 = [0.0, 0.0, -10.0]
        [carriers]
        frequency_hz = 0.5
        shoulder_height_m = [1.05, 0.95]
        [start]
        height_m = 0.8
        [solver]
        tolerance = 1e-10
        [effects.contact]
        damping_n_s_per_m = 0.0
        [effects.feedback]
        strength_rad_per_s = {kappa:?}
        latency_s = 0.01
        "#,
        13.0 * TAU / rate,
        rate / TAU
    ));
    // δ = 0.15 and 0.05 m at 3000 N/m: 450 and 150 N against a fair share of 300 N.
    let all = samples(&scene);
    for i in 0..2 {
        assert!((all[0].normal_n[i] - [450.0, 150.0][i]).abs() < 1e-9);
        for turn in all[3..].windows(2) {
            let turned = turn[1].phase_rad[i] - turn[0].phase_rad[i];
            assert!(
                (turned - TAU).abs() < 1e-7,
                "carrier {i}: {:.1e}",
                turned - TAU
            );
        }
    }
}

/// Steady sliding under bristles is Coulomb's μN; a light push is held by a spring of N σ₀ without creep.
#[test]
fn val_bristles_stick_and_slide() {
    let slide = |speed: f64, mu: f64| {
        let all = samples(&scene(&format!(
            r#"
            name = "bristle"
            freedom = ["x"]
            duration_s = 5.0
            [start]
            height_m = 0.8
            velocity_m_per_s = [{speed:?}, 0.0, 0.0]
            [body]
            mass_kg = 1e9
            [effects.contact]
            [effects.friction]
            law = "bristle"
            coefficient = {mu:?}
            "#
        )));
        let last = all.last().unwrap();
        (last.tangential_n[0][0], last.normal_n[0])
    };
    let (force, normal) = slide(1.0, 0.4);
    assert!(
        (force / (-0.4 * normal) - 1.0).abs() < 1e-6,
        "{force} {normal}"
    );
    // Let go on a gentle slope below the angle of friction it comes to rest; the force holds the weight's share.
    let all = samples(&scene(
        r#"
        name = "slope"
        duration_s = 60.0
        freedom = ["x"]
        [start]
        height_m = 0.8
        [effects.path]
        slope_deg = 5.0
        [effects.contact]
        stiffness_n_per_m = 3000.0
        [effects.friction]
        law = "bristle"
        coefficient = 0.5
        "#,
    ));
    let late = &all[all.len() - 30..];
    for s in late {
        let held: f64 = s.tangential_n.iter().map(|t| t[0]).sum();
        assert!(
            (held - 60.0 * 9.81 * 5.0_f64.to_radians().sin()).abs() < 0.05,
            "{held}"
        );
        assert!(
            (s.pose.position_m[0] - late[0].pose.position_m[0]).abs() < 1e-6,
            "it creeps"
        );
    }
}

/// Hunt–Crossley without damping is a conservative bounce; at rest k δ^p carries the weight.
#[test]
fn val_hunt_crossley() {
    let all = samples(&scene(
        r#"
        name = "hertz"
        duration_s = 3.0
        log_rate_hz = 200.0
        [solver]
        tolerance = 1e-10
        [start]
        height_m = 1.0
        [effects.contact]
        law = "hunt-crossley"
        exponent = 1.5
        stiffness_n_per_m = 20000.0
        damping_n_s_per_m = 0.0
        "#,
    ));
    let total = |s: &sim::run::Sample| {
        let e = s.energy.unwrap();
        e.kinetic_j + e.potential_j + e.elastic_j
    };
    assert!(all.iter().any(|s| s.normal_n[0] == 0.0) && all.iter().any(|s| s.normal_n[0] > 0.0));
    for s in &all {
        assert!(
            (total(s) - total(&all[0])).abs() < 1e-5,
            "t = {}: {:.1e} J",
            s.t_s,
            total(s) - total(&all[0])
        );
    }
    let resting = samples(&scene(
        "name = \"rest\"\nduration_s = 1.0\n[effects.contact]\nlaw = \"hunt-crossley\"\nexponent = 1.5\nstiffness_n_per_m = 20000.0",
    ));
    let delta = (60.0 * 9.81 / 2.0 / 20000.0_f64).powf(1.0 / 1.5);
    assert!((resting[0].compression_m[0] - delta).abs() < 1e-12);
    let last = resting.last().unwrap();
    assert!((last.compression_m[0] - delta).abs() < 1e-9);
}

/// A free pole rings at its frequency and loses e^{−2ζω t} of its energy; a loaded one bends by load over stiffness.
#[test]
fn val_flexure_at_rest_carries_the_load() {
    let all = samples(&scene(
        r#"
        name = "bow"
        duration_s = 30.0
        [effects.contact]
        [effects.hold]
        [effects.flexure]
        frequency_hz = 5.0
        modal_mass_kg = 6.0
        damping_ratio = 0.1
        "#,
    ));
    let last = all.last().unwrap();
    // Both ends: N₁ + N₂ = Mg = m ω² q, so the body sinks by q besides the shoulders' give.
    let q = 60.0 * 9.81 / (6.0 * (TAU * 5.0).powi(2));
    let sunk = all[0].pose.position_m[2] - last.pose.position_m[2];
    assert!((sunk - q).abs() < 1e-7, "{sunk} {q}");
    for s in &all {
        assert!(
            s.energy.unwrap().unexplained_j.abs() < 1e-5,
            "{:.1e}",
            s.energy.unwrap().unexplained_j
        );
    }
}

/// A party that turns on level ground leads the body round: it ends up turned by Δχ, and on the arc it feels v²/r.
#[test]
fn val_a_turn_takes_the_body_round() {
    let (speed, turn, time) = (0.8, FRAC_PI_2, 20.0);
    let s = scene(&format!(
        r#"
        name = "turn"
        duration_s = 45.0
        [carriers]
        walk_m_per_s = [{speed:?}, 0.0, 0.0]
        [effects.contact]
        [effects.hold]
        [effects.pole_friction]
        [effects.path]
        turn_deg = 90.0
        turn_start_s = 5.0
        turn_time_s = {time:?}
        "#
    ));
    let all = samples(&s);
    let last = all.last().unwrap();
    assert!(
        (last.pose.roll_pitch_yaw_rad()[2] - turn).abs() < 1e-4,
        "{:?}",
        last.pose.roll_pitch_yaw_rad()
    );
    assert!(
        last.pose.velocity_m_per_s[0].abs() < 1e-3
            && (last.pose.velocity_m_per_s[1] - speed).abs() < 1e-3
    );
    // In the middle of the turn χ̇ = 15/8 Δχ/T: the hold pulls inwards with M v χ̇, across the heading.
    let middle = all
        .iter()
        .min_by(|a, b| (a.t_s - 15.0).abs().total_cmp(&(b.t_s - 15.0).abs()))
        .unwrap();
    let inward: f64 = middle
        .tangential_n
        .iter()
        .map(|t| (-t[0] + t[1]) / 2.0_f64.sqrt())
        .sum();
    let expected = 60.0 * speed * 1.875 * turn / time;
    assert!(
        (inward / expected - 1.0).abs() < 0.02,
        "{inward} {expected}"
    );
}

/// On a slope the hold carries M g sin s and the shoulders M g cos s.
#[test]
fn val_a_slope_divides_the_weight() {
    let all = samples(&scene(
        r#"
        name = "slope"
        duration_s = 60.0
        [effects.contact]
        [effects.hold]
        [effects.pole_friction]
        [effects.path]
        slope_deg = 10.0
        bank_deg = -4.0
        "#,
    ));
    let last = all.last().unwrap();
    let (s, b) = (10.0_f64.to_radians(), (-4.0_f64).to_radians());
    let weight = 60.0 * 9.81;
    let sum = |f: &dyn Fn(usize) -> f64| (0..2).map(f).sum::<f64>();
    for (found, expected) in [
        (sum(&|i| last.normal_n[i]), weight * b.cos() * s.cos()),
        (sum(&|i| last.tangential_n[i][0]), weight * s.sin()),
        (
            sum(&|i| last.tangential_n[i][1]),
            weight * b.sin() * s.cos(),
        ),
    ] {
        assert!((found - expected).abs() < 1e-4, "{found} {expected}");
    }
}

/// Lift multiplies the vertical gait and nothing else; a spread of frequencies has its mean and deviation.
#[test]
fn lift_and_spread_do_what_they_say() {
    let base = "name = \"a\"\n[effects.gait]\namplitude_m = 0.05\nsway_m = 0.01\n";
    let plain = samples(&scene(base));
    let lifted = samples(&scene(&format!("{base}[effects.lift]\ngain = 1.5")));
    for (a, b) in plain.iter().zip(&lifted) {
        assert!((b.shoulder_m[0][2] - 1.0 - 1.5 * (a.shoulder_m[0][2] - 1.0)).abs() < 1e-12);
        assert_eq!(a.shoulder_m[0][1], b.shoulder_m[0][1]);
    }
    let mut many = scene("name = \"b\"\n[effects.frequency_spread]\nsd_hz = 0.05");
    many.carriers.handles_m = vec![[0.0; 3]; 4000];
    let w: Vec<f64> = Model::new(&many)
        .natural_rad_per_s()
        .iter()
        .map(|w| w / TAU)
        .collect();
    let mean = w.iter().sum::<f64>() / 4000.0;
    let sd = (w.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 4000.0).sqrt();
    // Four standard errors.
    assert!(
        (mean - 2.0).abs() < 4.0 * 0.05 / 63.2 && (sd / 0.05 - 1.0).abs() < 4.0 / 89.0,
        "{mean} {sd}"
    );
}

/// A pause lets the phases go: without a drum they run at their own frequency, and the beat counts on.
#[test]
fn music_pauses_and_changes_tempo() {
    let all = samples(&scene(
        r#"
        name = "pause"
        duration_s = 40.0
        [effects.music]
        beat_hz = 2.1
        onset_s = 0.0
        build_up_s = 0.0
        strength_rad_per_s = [2.0, 0.0]
        tempo_changes = [{ at_s = 30.0, beat_hz = 1.9 }]
        pauses = [{ from_s = 10.0, to_s = 20.0 }]
        "#,
    ));
    let at = |t: f64| all.iter().find(|s| (s.t_s - t).abs() < 1e-9).unwrap();
    let rate = |i: usize, a: f64, b: f64| (at(b).phase_rad[i] - at(a).phase_rad[i]) / (b - a) / TAU;
    assert!(
        (rate(0, 8.0, 9.0) - 2.1).abs() < 1e-6,
        "{}",
        rate(0, 8.0, 9.0)
    );
    assert!((rate(0, 11.0, 19.0) - 2.0).abs() < 1e-9 && at(15.0).beat_phase_rad.is_none());
    assert!((rate(0, 28.0, 29.0) - 2.1).abs() < 1e-6 && (rate(0, 38.0, 39.0) - 1.9).abs() < 1e-6);
    // The carrier with strength zero never hears it.
    assert!((rate(1, 0.0, 40.0) - 2.0).abs() < 1e-9);
    let locked = at(29.0).beat_phase_rad.unwrap() - at(29.0).phase_rad[0];
    assert!((locked.sin() - TAU * 0.1 / 2.0).abs() < 1e-6);
}

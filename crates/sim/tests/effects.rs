//! Every effect against a closed form or a conservation law of its own (phases, contact, gait, hold and pole friction: `theory_*`).

mod common;

use common::{rates_at_start, readings, samples, scene};
use sim::model::Model;
use sim::solve::METHODS;
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

/// A body set down on straight poles sinks by load over stiffness; one that starts at rest stays there.
#[test]
fn val_flexure_at_rest_carries_the_load() {
    let with = |start: &str| {
        samples(&scene(&format!(
            r#"
            name = "bow"
            duration_s = 30.0
            {start}
            [effects.contact]
            [effects.hold]
            [effects.flexure]
            frequency_hz = 5.0
            modal_mass_kg = 6.0
            damping_ratio = 0.1
            "#
        )))
    };
    // Both ends: N₁ + N₂ = Mg = m ω² q, so the body sinks by q besides the shoulders' give.
    let q = 60.0 * 9.81 / (6.0 * (TAU * 5.0).powi(2));
    let straight = 0.9 - 60.0 * 9.81 / 6000.0;
    let all = with(&format!("[start]\nheight_m = {straight:?}"));
    let sunk = straight - all.last().unwrap().pose.position_m[2];
    assert!((sunk - q).abs() < 1e-7, "{sunk} {q}");
    for s in &all {
        assert!(
            s.energy.unwrap().unexplained_j.abs() < 1e-5,
            "{:.1e}",
            s.energy.unwrap().unexplained_j
        );
    }
    for s in with("") {
        let z = s.pose.position_m[2];
        assert!((z - (straight - q)).abs() < 1e-9, "{z}");
        let miss_n = s.normal_n[0] - 60.0 * 9.81 / 2.0;
        assert!(miss_n.abs() < 1e-6, "{miss_n:e}");
    }
}

/// Poles that hardly damp ring as they should by the archive's method too, whose positions follow their new velocities.
#[test]
fn poles_ring_alike_by_semi_implicit_euler() {
    let deviation_n = |method: &str| {
        let all = samples(&scene(&format!(
            r#"
            name = "ring"
            duration_s = 1.0
            log_rate_hz = 200.0
            freedom = ["height"]
            [start]
            height_m = 0.75
            [solver]
            method = "{method}"
            [effects.contact]
            damping_n_s_per_m = 20.0
            bilateral = true
            [effects.flexure]
            "#
        )));
        let n: Vec<f64> = all.iter().map(|s| s.normal_n[0]).collect();
        let mean = n.iter().sum::<f64>() / n.len() as f64;
        (n.iter().map(|n| (n - mean).powi(2)).sum::<f64>() / n.len() as f64).sqrt()
    };
    // Deflections drifting with their old rates would gain 9 %.
    let ratio = deviation_n("semi-implicit-euler") / deviation_n("auto");
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
}

/// A push at the centre of mass gives the impulse F₀T/2 and, by its end, the way F₀T²/(4M); two that overlap add up.
#[test]
fn val_a_push_gives_its_impulse() {
    let [mass, force, time] = [50.0, 120.0, 0.7];
    let s = scene(&format!(
        r#"
        name = "pushed"
        duration_s = 4.0
        log_rate_hz = 10.0
        [body]
        mass_kg = {mass:?}
        [start]
        height_m = 100.0
        [effects.push]
        pushes = [
            {{ start_s = 1.0, time_s = {time:?}, force_n = [0.0, {force:?}, 0.0] }},
            {{ start_s = 1.2, time_s = 0.2, force_n = [{force:?}, 0.0, 0.0] }},
        ]
        "#
    ));
    let all = samples(&s);
    let at = |t: f64| &all[(10.0 * t).round() as usize];
    assert_eq!(at(1.0).pose.position_m[..2], [0.0; 2]);
    let near = |found: f64, expected: f64| {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    };
    near(
        at(1.7).pose.position_m[1],
        force * time * time / (4.0 * mass),
    );
    for t in [1.7, 4.0] {
        near(at(t).pose.velocity_m_per_s[1], force * time / (2.0 * mass));
        near(at(t).pose.velocity_m_per_s[0], force * 0.2 / (2.0 * mass));
    }
    // It fell as ever.
    near(at(4.0).pose.position_m[2], 100.0 - 0.5 * 9.81 * 16.0);
}

/// Off the centre it turns the body too: what it worked is in the motion, of a free body and of one that is carried.
#[test]
fn val_the_work_of_a_push_is_in_the_motion() {
    let push = "[effects.push]\npushes = [{ start_s = 1.0, time_s = 0.5, force_n = [40.0, 300.0, -60.0], place_m = [1.2, 0.1, 0.4] }]";
    for (more, carried) in [
        ("[start]\nheight_m = 100.0\n", false),
        ("[effects.contact]\n[effects.sling]\n", true),
    ] {
        let text = format!("name = \"pushed\"\nduration_s = 5.0\n{more}{push}");
        let all = samples(&scene(&text));
        let last = all.last().unwrap();
        let turned = last.pose.spin_rad_per_s;
        assert!(
            carried || turned.iter().all(|w| w.abs() > 0.01),
            "{turned:?}"
        );
        let swing = all
            .iter()
            .map(|s| s.pose.roll_rad().abs())
            .fold(0.0, f64::max);
        assert!(swing > 0.01, "{swing}");
        // Eight moments at once and one after the other.
        let by_another = samples(&scene(&format!(
            "{text}\n[solver]\nmethod = \"dop853\"\ntolerance = 1e-9"
        )));
        let other = by_another.last().unwrap().pose.orientation;
        for (a, b) in last.pose.orientation.into_iter().zip(other) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
        for s in &all {
            let energy = s.energy.unwrap();
            assert!(
                energy.unexplained_j.abs() < 1e-6,
                "{:e}",
                energy.unexplained_j
            );
            assert!(
                s.t_s < 1.5 || energy.work_in_j > 1.0,
                "{:e}",
                energy.work_in_j
            );
        }
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

/// Straps alone are a pendulum of their length; friction caps them, and a hold beside them.
#[test]
fn val_straps_swing_and_slip() {
    let swing = |more: &str| {
        samples(&scene(&format!(
            "name = \"swing\"\nduration_s = 10.0\nfreedom = [\"y\"]\n[start]\nposition_m = [0.0, 0.3]\n[effects.contact]\n[effects.sling]\ndamping_s = 0.0\n{more}"
        )))
    };
    let w = (9.81_f64 / 0.7).sqrt();
    for s in &swing("") {
        let y = 0.3 * (w * s.t_s).cos();
        assert!((s.pose.position_m[1] - y).abs() < 1e-9, "{} s", s.t_s);
    }
    // T/N would be 0.3/0.7 at the start.
    for more in ["", "[effects.hold]\n"] {
        for mu in [0.0, 0.05, 0.4] {
            let all = swing(&format!("{more}[effects.friction]\ncoefficient = {mu:?}\n"));
            for s in &all {
                for (t, n) in s.tangential_n.iter().zip(&s.normal_n) {
                    assert!(t[0].hypot(t[1]) <= mu * n, "{more}{mu}: {t:?} {n}");
                }
            }
            assert_eq!(all[30].pose.position_m[1] == 0.3, mu == 0.0, "{more}{mu}");
        }
    }
}

/// Handles that hang from ties, not on straps, feel no straps: the load goes straight on, by any method.
#[test]
fn straps_of_a_load_that_pulls_are_slack() {
    for method in METHODS {
        let mut s = scene(
            "name = \"hung\"\nduration_s = 3.0\nfreedom = [\"y\"]\n[start]\nheight_m = 1.0\nposition_m = [0.0, 0.3]\nvelocity_m_per_s = [0.0, 0.1, 0.0]\n\
             [effects.contact]\nbilateral = true\n[effects.sling]",
        );
        s.solver.method = method.name.into();
        for s in samples(&s) {
            assert!(s.normal_n[0] < 0.0 && s.tangential_n[0] == [0.0; 2]);
            let off = s.pose.position_m[1] - (0.3 + 0.1 * s.t_s);
            assert!(off.abs() < 1e-12, "{}: {off:e} m", method.name);
        }
    }
}

/// Who walks sees the same motion as who stands, and carries it along.
#[test]
fn a_walk_is_a_galilean_shift() {
    let with = |walk: &str| {
        samples(&scene(&format!(
            "name = \"walk\"\nduration_s = 5.0\n[carriers]\n{walk}initial_phase_rad = [0.0, 1.0]\n[effects.contact]\n[effects.hold]\n[effects.gait]\nsway_m = 0.02"
        )))
    };
    let walk = [0.8, -0.3, 0.1];
    let shifted = |a: f64, b: f64, by: f64| (b - a - by).abs() < 1e-14 * (1.0 + b.abs());
    for (a, b) in with("")
        .iter()
        .zip(&with(&format!("walk_m_per_s = {walk:?}\n")))
    {
        assert_eq!(
            (&a.normal_n, &a.tangential_n),
            (&b.normal_n, &b.tangential_n)
        );
        assert_eq!(
            (a.energy, a.pose.orientation),
            (b.energy, b.pose.orientation)
        );
        for (k, v) in walk.into_iter().enumerate() {
            let (p, q) = (a.pose, b.pose);
            assert!(shifted(p.position_m[k], q.position_m[k], v * a.t_s));
            assert!(shifted(p.velocity_m_per_s[k], q.velocity_m_per_s[k], v));
            for i in 0..2 {
                assert!(shifted(a.shoulder_m[i][k], b.shoulder_m[i][k], v * a.t_s));
                assert!(shifted(a.handle_m[i][k], b.handle_m[i][k], v * a.t_s));
            }
        }
    }
}

/// What slides down a slope under a limited hold turns M g sin s · x − K into heat, and stores nothing that its spring could not hold.
#[test]
fn val_a_hold_that_slips_dissipates() {
    let all = samples(&scene(
        "name = \"slip\"\nfreedom = [\"x\"]\n[effects.contact]\n[effects.hold]\n[effects.friction]\ncoefficient = 0.1\n[effects.path]\nslope_deg = 20.0",
    ));
    let held_j = all[0].energy.unwrap().elastic_j;
    for s in &all {
        let e = s.energy.unwrap();
        let fell_j = -60.0 * 9.81 * 20.0_f64.to_radians().sin() * s.pose.position_m[0];
        assert!(
            (e.dissipated_j - (fell_j - e.kinetic_j)).abs() < 1e-6 * (1.0 + fell_j),
            "{e:?}"
        );
        assert_eq!(e.elastic_j, held_j);
    }
    assert!(all.last().unwrap().pose.position_m[0] < -10.0);
}

/// A cloth that sways in the air is straight when the handle comes down on it.
#[test]
fn bristles_straighten_in_the_air() {
    let all = samples(&scene(
        "name = \"drop\"\nduration_s = 1.5\nlog_rate_hz = 10000.0\nfreedom = [\"height\"]\n[carriers]\nhandles_m = [[0.0, 0.0, 0.0]]\n[start]\nheight_m = 5.9\n\
         [effects.contact]\n[effects.gait]\namplitude_m = 0.0\nsway_m = 0.1\n[effects.friction]\nlaw = \"bristle\"",
    ));
    let first = all.iter().find(|s| s.normal_n[0] > 0.0).unwrap();
    let share = first.tangential_n[0][1].abs() / first.normal_n[0];
    // σ₁ ḋ with the sway's 2π·2 Hz·0.1 m is what fresh bristles take at most.
    assert!(share <= 0.5 * TAU * 2.0 * 0.1, "{share}");
    let z = |s: &sim::run::Sample| first.t_s > 0.9 && s.t_s < first.t_s;
    assert!(
        all.iter()
            .filter(|s| z(s))
            .all(|s| s.tangential_n[0] == [0.0; 2])
    );
}

/// What looks a little back from the onset of a lift sees no kink, and fixed steps keep their order across it.
#[test]
fn a_lift_begins_smoothly_for_who_looks_on() {
    let text = "name = \"onset\"\nduration_s = 2.0\nfreedom = [\"height\"]\n[effects.contact]\nbilateral = true\n[effects.gait]\n\
                [effects.lift]\ngain = 1.5\nonset_s = 0.5\nbuild_up_s = 0.2\n";
    let end = |step: &str| {
        let mut s = scene(text);
        if !step.is_empty() {
            (s.solver.method, s.solver.step_s) = ("rk4".into(), step.parse().unwrap());
        }
        samples(&s).last().unwrap().pose.position_m[2]
    };
    let truth = end("");
    let errors = ["0.01", "0.005", "0.0025"].map(|step| (end(step) - truth).abs());
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!(order > 3.5, "order {order}: {errors:?}");
    }
    for onset in [0.0, 1.0] {
        let s = scene(&format!(
            "name = \"look\"\nduration_s = 1.5\n[effects.contact]\n[effects.gait]\n[effects.lift]\nonset_s = {onset:?}\nbuild_up_s = 1.0\n[effects.imu]\nrate_hz = 200.0\n\
             gyro_noise_rad_per_s_per_sqrt_hz = 0.0\naccel_noise_m_per_s2_per_sqrt_hz = 0.0\naccel_bias_sd_m_per_s2 = 0.0\naccel_bias_walk_m_per_s3_per_sqrt_hz = 0.0\nsensors = [{{ on = \"carrier_1\" }}]"
        ));
        let (shown, _) = readings(&s);
        let f: Vec<f64> = shown.iter().map(|r| r.force[2]).collect();
        let jump = f
            .windows(2)
            .map(|w| (w[1] - w[0]).abs())
            .fold(0.0, f64::max);
        assert!(jump < 1.0, "{jump}");
    }
}

/// A party that turns about has its carriers' sensors turn, and walks back, sideways too.
#[test]
fn who_walks_a_turn_turns() {
    let s = scene(
        "name = \"about\"\nduration_s = 40.0\n[carriers]\nwalk_m_per_s = [0.8, 0.3, 0.0]\n[effects.contact]\n[effects.hold]\n[effects.pole_friction]\n\
         [effects.path]\nturn_deg = 180.0\nturn_start_s = 5.0\nturn_time_s = 10.0\n[effects.imu]\nrate_hz = 100.0\n\
         gyro_noise_rad_per_s_per_sqrt_hz = 0.0\ngyro_bias_sd_rad_per_s = 0.0\ngyro_bias_walk_rad_per_s2_per_sqrt_hz = 0.0\ngyro_resolution_rad_per_s = 0.0\nscale_error_sd = 0.0\nmisalignment_sd_deg = 0.0\n\
         accel_noise_m_per_s2_per_sqrt_hz = 0.0\naccel_bias_sd_m_per_s2 = 0.0\naccel_bias_walk_m_per_s3_per_sqrt_hz = 0.0\naccel_resolution_m_per_s2 = 0.0\nsensors = [{ on = \"carrier_1\" }]",
    );
    let (shown, all) = readings(&s);
    let last = all.last().unwrap();
    let [vx, vy, _] = last.pose.velocity_m_per_s;
    assert!(
        (vx + 0.8).abs() < 1e-3 && (vy + 0.3).abs() < 1e-3,
        "{vx} {vy}"
    );
    let turned: f64 = shown.iter().map(|r| r.spin[2] * 0.01).sum();
    assert!((turned - std::f64::consts::PI).abs() < 1e-6, "{turned}");
    // In mid-turn, at 1 m/s for one who walks at the centre: across the way v χ̇, and inwards besides for the place on the pole.
    let middle = shown
        .iter()
        .min_by(|a, b| (a.t_s - 10.0).abs().total_cmp(&(b.t_s - 10.0).abs()))
        .unwrap();
    let rate = 1.875 * std::f64::consts::PI / 10.0;
    // Axes of the party: x along the pole, on which carrier 1 is 2.45 m ahead; v = (0.8, 0.3).
    let expected = [-0.3 * rate - 2.45 * rate * rate, 0.8 * rate];
    for (axis, expected) in expected.iter().enumerate() {
        let f = middle.force[axis];
        assert!((f - expected).abs() < 1e-6, "{axis}: {f} {expected}");
    }
}

/// Handles on one line but for rounding are on one pole.
#[test]
fn a_hair_beside_the_pole_is_on_the_pole() {
    let with = |y: f64| {
        let s = scene(&format!(
            "name = \"hair\"\nduration_s = 2.0\n[carriers]\nhandles_m = [[2.45, 0.0, 0.1], [-2.45, {y:?}, 0.1]]\nfrequency_hz = [2.0, 2.1]\n\
             [effects.coupling]\nstrength_rad_per_s = 50.0\ngraph = \"chain\"\n[effects.contact]\n[effects.flexure]"
        ));
        let last = samples(&s).pop().unwrap();
        (
            last.phase_rad[1] - last.phase_rad[0],
            last.pose.position_m[2],
        )
    };
    let ((a, z), (b, y)) = (with(0.0), with(1e-12));
    assert!(
        (a - b).abs() < 1e-9 && (z - y).abs() < 1e-9,
        "{a} {b} {z} {y}"
    );
}

/// On a slope a fair share is a share of what presses on the ground.
#[test]
fn on_a_slope_nobody_feels_too_little() {
    let all = samples(&scene(
        "name = \"share\"\nduration_s = 20.0\n[carriers]\nhandles_m = [[2.45, 0.0, 0.0], [-2.45, 0.0, 0.0]]\n[effects.contact]\n[effects.hold]\n[effects.pole_friction]\n[effects.feedback]\n[effects.path]\nslope_deg = 30.0",
    ));
    for turn in all[all.len() - 100..].windows(2) {
        let rate = (turn[1].phase_rad[0] - turn[0].phase_rad[0]) / (turn[1].t_s - turn[0].t_s);
        assert!((rate / TAU - 2.0).abs() < 1e-3, "{rate}");
    }
}

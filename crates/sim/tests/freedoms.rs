//! Fewer freedoms: the same motion where the held coordinates stay at rest, the same equations where they are held.

mod common;

use common::{samples, scene};
use sim::model::Model;
use sim::run::{Sample, run};
use sim::scene::{Freedom, Scene, check, parse};

/// A rath of the paper's kind in which both carriers step together: only height, roll and the sideways sway move.
fn in_step(freedom: &str) -> Scene {
    scene(&format!(
        r#"
        name = "in step"
        duration_s = 20.0
        freedom = {freedom}
        [start]
        height_m = 0.85
        roll_pitch_yaw_deg = [4.0, 0.0, 0.0]
        [solver]
        tolerance = 1e-11
        [effects.contact]
        [effects.hold]
        [effects.pole_friction]
        [effects.gait]
        amplitude_m = 0.06
        sway_m = 0.004
        "#
    ))
}

#[test]
fn held_coordinates_that_would_stay_at_rest_change_nothing() {
    let full = samples(&in_step(r#"["x", "y", "height", "roll", "tilt", "yaw"]"#));
    let plane = samples(&in_step(r#"["y", "height", "roll"]"#));
    assert_eq!(full.len(), plane.len());
    let mut worst: f64 = 0.0;
    for (a, b) in full.iter().zip(&plane) {
        assert!(
            a.pose.roll_pitch_yaw_rad()[1].abs() < 1e-12
                && a.pose.roll_pitch_yaw_rad()[2].abs() < 1e-12
        );
        worst = worst.max((a.pose.roll_pitch_yaw_rad()[0] - b.pose.roll_pitch_yaw_rad()[0]).abs());
        worst = worst.max((a.pose.position_m[2] - b.pose.position_m[2]).abs());
        worst = worst.max((a.pose.position_m[1] - b.pose.position_m[1]).abs());
    }
    assert!(worst < 1e-8, "{worst:.1e}");
}

/// Where a coordinate is held that would have moved, the difference is that coordinate's doing, and small here: the sway.
#[test]
fn height_and_roll_alone_come_near_the_full_motion_with_a_stiff_hold() {
    let stiff = |freedom: &str| {
        let mut scene = in_step(freedom);
        scene.effects.gait.as_mut().unwrap().sway_m = 0.0.into();
        scene.effects.hold = None;
        scene
    };
    // Without a hold nothing pushes sideways: roll and height are all there is.
    let full = samples(&stiff(r#"["x", "y", "height", "roll", "tilt", "yaw"]"#));
    let two = samples(&stiff(r#"["height", "roll"]"#));
    for (a, b) in full.iter().zip(&two) {
        assert!((a.pose.roll_pitch_yaw_rad()[0] - b.pose.roll_pitch_yaw_rad()[0]).abs() < 1e-8);
        assert!((a.pose.position_m[2] - b.pose.position_m[2]).abs() < 1e-8);
    }
}

/// Every choice of freedoms keeps its own energy balance, and its rates are those of the full equations under the constraint.
#[test]
fn every_subset_balances_its_energy() {
    for mask in 1..63_u32 {
        let names: Vec<String> = Freedom::ALL
            .iter()
            .enumerate()
            .filter(|(i, _)| mask >> i & 1 == 1)
            .map(|(_, f)| format!("\"{}\"", format!("{f:?}").to_lowercase()))
            .collect();
        let mut scene = scene(&format!(
            r#"
            name = "subset"
            duration_s = 3.0
            freedom = [{}]
            [body]
            inertia_kg_m2 = {{ xx = 2.0, yy = 11.0, zz = 12.0, xy = 0.4, xz = -0.3, yz = 0.2 }}
            [carriers]
            initial_phase_rad = [0.4, 2.0]
            [start]
            height_m = 0.85
            roll_pitch_yaw_deg = [8.0, 3.0, -5.0]
            [solver]
            tolerance = 1e-10
            [effects.contact]
            [effects.hold]
            [effects.pole_friction]
            [effects.gait]
            sway_m = 0.01
            "#,
            names.join(", ")
        ));
        scene.start.velocity_m_per_s = [0.1, -0.2, 0.1];
        scene.start.angular_velocity_rad_per_s = [0.5, 0.1, -0.3];
        assert!(check(&scene).is_err(), "{names:?}");
        scene.keep_to_freedoms();
        assert_eq!(check(&scene), Ok(()), "{names:?}");
        let model = Model::new(&scene);
        let attitude_is_a_quaternion = names
            .iter()
            .filter(|n| ["\"roll\"", "\"tilt\"", "\"yaw\""].contains(&n.as_str()))
            .count()
            == 3;
        let expected = if attitude_is_a_quaternion {
            13
        } else {
            2 * names.len()
        };
        assert_eq!(model.layout().body, expected, "{names:?}");
        for s in samples(&scene) {
            let e = s.energy.unwrap();
            // The ledger is a quadrature beside the motion and steers no step: it is held to a part of what went through it.
            let through = 1.0 + e.work_in_j.abs() + e.dissipated_j.abs();
            let off = e.unexplained_j.abs() / through;
            assert!(
                off < 1e-6,
                "{names:?} at {} s: {:.1e} J, {off:.1e} of {through} J",
                s.t_s,
                e.unexplained_j
            );
            assert!(
                s.pose
                    .position_m
                    .iter()
                    .chain(&s.pose.roll_pitch_yaw_rad())
                    .all(|x| x.is_finite())
            );
        }
    }
}

/// Two angles that are free take the angular velocity asked for, and a step of the semi-implicit method moves every coordinate by its own rate.
#[test]
fn free_angles_begin_as_asked_and_move_each_by_its_own_rate() {
    let text = r#"
        name = "thrown"
        duration_s = 0.5
        freedom = ["y", "roll", "yaw"]
        [body]
        gravity_m_per_s2 = [0.0, 0.0, 0.0]
        inertia_kg_m2 = { xx = 2.0, yy = 2.0, zz = 2.0 }
        [start]
        height_m = 1.0
        velocity_m_per_s = [0.0, 0.4, 0.0]
        angular_velocity_rad_per_s = [0.3, 0.0, 0.2]
        [solver]
        method = "semi-implicit-euler"
        step_s = 1e-4
    "#;
    let mut last = None;
    run(&parse("thrown", text, &[]).unwrap(), &mut |s: &Sample| {
        last = Some((s.t_s, s.pose));
        true
    })
    .unwrap();
    let (t_s, pose) = last.unwrap();
    // A ball whose pole is held level: it rolls about an axis that yaws, square to that of the yaw, and keeps both rates.
    let [roll, _, yaw] = pose.roll_pitch_yaw_rad();
    assert!((pose.position_m[1] - 0.4 * t_s).abs() < 1e-9, "{pose:?}");
    assert!(
        (roll - 0.3 * t_s).abs() < 1e-4 && (yaw - 0.2 * t_s).abs() < 1e-4,
        "{roll} {yaw}"
    );
}

/// A held body is a pendulum with one angle: about its pole, θ̈ = −(torque of gravity is none at the centre of mass) = 0.
#[test]
fn one_free_angle_spins_on() {
    let s = scene(
        r#"
        name = "spit"
        duration_s = 5.0
        freedom = ["roll"]
        [body]
        inertia_kg_m2 = { xx = 2.0, yy = 11.0, zz = 12.0, xz = 0.5 }
        [start]
        height_m = 3.0
        angular_velocity_rad_per_s = [1.5, 0.0, 0.0]
        "#,
    );
    for s in samples(&s) {
        let turned = 1.5 * s.t_s;
        assert!(
            (turned - s.pose.roll_pitch_yaw_rad()[0]).sin().abs() < 1e-7
                && s.pose.position_m[2] == 3.0
        );
    }
}

/// What dampers are said to take from each velocity is what the equations show: −∂v̇/∂v, by differences. Units of velocities, and with them the
/// steps that a tolerance asks for, follow from it.
#[test]
fn dampers_take_from_every_velocity_what_is_said() {
    for mask in 1..64_u32 {
        let free: Vec<Freedom> = (Freedom::ALL.into_iter().enumerate())
            .filter_map(|(i, f)| (mask >> i & 1 == 1).then_some(f))
            .collect();
        // Axes that are not at right angles in the inertia have products, which are left out: roll and yaw meet at no tilt.
        let oblique = free.contains(&Freedom::Roll) && free.contains(&Freedom::Yaw);
        let tilt_deg = if oblique { 0.0 } else { 9.0 };
        let mut scene = scene(&format!(
            r#"
            name = "damped"
            duration_s = 1.0
            [body]
            inertia_kg_m2 = {{ xx = 3.0, yy = 14.0, zz = 14.0 }}
            [carriers]
            handles_m = [[2.4, 0.3, 0.1], [-2.4, 0.3, 0.1], [0.2, -0.9, 0.2]]
            [start]
            height_m = 0.85
            roll_pitch_yaw_deg = [12.0, {tilt_deg:?}, 30.0]
            [effects.contact]
            bilateral = true
            damping_n_s_per_m = 250.0
            [effects.hold]
            damping_n_s_per_m = 90.0
            "#
        ));
        scene.freedom = free.clone();
        let model = Model::new(&scene);
        let (start, mut w) = (model.initial_state(), model.workspace());
        model.begin_segment(0.0, &mut w);
        let mut rates = |y: &[f64]| {
            let mut dy = vec![0.0; y.len()];
            model.rhs(0.0, y, &mut dy, &mut w);
            dy
        };
        let body = model.layout().body;
        let measured = (model.freedoms().positions()..body).map(|v| {
            let (mut more, mut less) = (start.clone(), start.clone());
            (more[v], less[v]) = (more[v] + 0.01, less[v] - 0.01);
            (rates(&less)[v] - rates(&more)[v]) / 0.02
        });
        let measured: Vec<f64> = measured.collect();
        let mut said = vec![0.0; body];
        model.damping_per_s(&start, &w, &mut said);
        let mut sum = 0.0;
        for (k, (measured, said)) in measured
            .iter()
            .zip(&said[model.freedoms().positions()..])
            .enumerate()
        {
            // One that a constraint holds has no rate, whatever the dampers would do.
            let held = *measured == 0.0;
            assert!(
                held || (measured - said).abs() < 1e-9 * (1.0 + said),
                "{free:?}, velocity {k}: {measured} 1/s, said {said}"
            );
            sum += measured;
        }
        assert!(sum > 0.5, "{free:?}");
    }
}

//! Effects are independent: what one adds is the same to the last bit whether another is there or not.

mod common;

use common::{samples, scene};
use sim::effects::{Entry, TABLE, idle};
use sim::model::{Model, Workspace};
use sim::scene::Scene;

/// A scene with every effect.
fn everything() -> Scene {
    let all = scene(
        &(include_str!("everything.toml").to_owned()
            + r#"
        [effects.measured]
        t_s = [0.0, 20.0, 40.0, 60.0]
        phase_rad = [[0.3, 251.0, 502.0, 753.0], [1.1, 250.0, 503.0, 754.0], [2.0, 252.0, 500.0, 750.0]]
        [effects.imu]
        [effects.drum]
        "#),
    );
    for effect in TABLE {
        let on = (effect.is_on)(&all.effects);
        assert!(on, "{} is missing in everything.toml", effect.name);
    }
    all
}

/// The scene without an effect, and without what cannot be without it.
fn without(scene: &Scene, effect: &Entry) -> Scene {
    let mut fewer = scene.clone();
    (effect.switch_off)(&mut fewer.effects);
    match effect.name {
        "gait" => fewer.effects.lift = None,
        "music" => fewer.effects.drum = None,
        _ => {}
    }
    fewer
}

/// Every number that a term can write.
fn written(model: &Model, w: &Workspace) -> Vec<(String, u64)> {
    let mut out: Vec<(String, u64)> = Vec::new();
    for i in 0..model.carriers() {
        let mut put = |name: &str, x: f64| out.push((format!("{name} {i}"), x.to_bits()));
        put("rate", w.of(i, |p| p.rate));
        put("normal", w.of(i, |p| p.normal));
        put("unclamped", w.of(i, |p| p.unclamped));
        for a in 0..3 {
            put(&format!("base {a}"), w.of(i, |p| p.base[a]));
            put(&format!("base rate {a}"), w.of(i, |p| p.base_rate[a]));
        }
        for a in 0..2 {
            put(&format!("tangential {a}"), w.of(i, |p| p.tangential[a]));
        }
    }
    for a in 0..3 {
        out.push((format!("torque {a}"), w.body_torque[a].to_bits()));
    }
    out
}

#[test]
fn switching_one_effect_off_leaves_the_others_as_they_are() {
    let full = everything();
    let t_s = 0.7;
    for kept in TABLE {
        for other in TABLE.iter().filter(|o| o.name != kept.name) {
            // Effects that are about another by their definition: lift amplifies the gait, friction limits hold and sling, a sling adds to a
            // hold, a fair share of the load is smaller on a slope.
            let by_definition = [
                ("lift", "gait"),
                ("friction", "hold"),
                ("friction", "sling"),
                ("sling", "hold"),
                ("feedback", "path"),
            ];
            if by_definition.contains(&(kept.name, other.name)) {
                continue;
            }
            let without = without(&full, other);
            let (a, b) = (Model::new(&full), Model::new(&without));
            let evaluated = |m: &Model| {
                let (y, mut w) = (m.initial_state(), m.workspace());
                m.begin_segment(0.0, &mut w);
                m.forces(t_s, &y, &mut w);
                w
            };
            // The same workspace for both, but for the states that only one of them has: each reads its own by name.
            let mut wa = evaluated(&a);
            let mut wb = evaluated(&b);
            let (extra, rates) = (wb.extra.clone(), wb.extra_rate.clone());
            wb = Workspace {
                extra,
                extra_rate: rates,
                ..wa.clone()
            };
            let states = |m: &Model| m.state_names()[m.layout().extra_range()].to_vec();
            let (names_a, names_b) = (states(&a), states(&b));
            for (name, x) in names_a.iter().zip(&mut wa.extra) {
                *x = 0.01 * name.len() as f64;
            }
            for (name, x) in names_b.iter().zip(&mut wb.extra) {
                *x = 0.01 * name.len() as f64;
            }
            a.apply_only(kept.name, t_s, &mut wa);
            b.apply_only(kept.name, t_s, &mut wb);
            assert_eq!(
                written(&a, &wa),
                written(&b, &wb),
                "`{}` with and without `{}`",
                kept.name,
                other.name
            );
            for (name, rate) in names_b.iter().zip(&wb.extra_rate) {
                let i = names_a.iter().position(|n| n == name).unwrap();
                // Rates that belong to neither keep what the evaluation left there.
                if b.state_names().contains(name) && wa.extra_rate[i].to_bits() != rate.to_bits() {
                    let own = |m: &Model| {
                        let mut w = evaluated(m);
                        w.extra_rate.fill(f64::NAN);
                        m.apply_only(kept.name, t_s, &mut w);
                        let at = states(m).iter().position(|n| n == name).unwrap();
                        w.extra_rate[at].is_nan()
                    };
                    assert!(
                        own(&a) && own(&b),
                        "rate of {name}: `{}` with and without `{}`",
                        kept.name,
                        other.name
                    );
                }
            }
        }
    }
}

/// What is fixed for a segment, natural frequency and noise, is the business of those two effects alone.
#[test]
fn what_a_segment_fixes_depends_on_no_other_effect() {
    let full = everything();
    let fixed = |scene: &Scene, t_s: f64| -> [f64; 3] {
        let model = Model::new(scene);
        let mut w = model.workspace();
        model.begin_segment(t_s, &mut w);
        [0, 1, 2].map(|i| w.of(i, |p| p.constant_rate))
    };
    let entry = |name: &str| TABLE.iter().find(|e| e.name == name).unwrap();
    let (spread, noise) = (entry("frequency_spread"), entry("noise"));
    for t_s in [0.0, 0.7, 12.3] {
        for other in TABLE
            .iter()
            .filter(|o| ![spread.name, noise.name].contains(&o.name))
        {
            assert_eq!(
                fixed(&full, t_s).map(f64::to_bits),
                fixed(&without(&full, other), t_s).map(f64::to_bits),
                "with and without `{}`",
                other.name
            );
        }
        // Those two are a sum, so what one adds is the same to rounding.
        let steady = without(&full, noise);
        let (even, bare) = (without(&full, spread), without(&steady, spread));
        let [all, steady, even, bare] = [&full, &steady, &even, &bare].map(|s| fixed(s, t_s));
        for i in 0..3 {
            let apart = (all[i] - steady[i]) - (even[i] - bare[i]);
            assert!(apart.abs() < 1e-13, "{apart:e}");
            assert!(all[i] != steady[i] && all[i] != even[i]);
        }
    }
}

/// How long the runs are that find out what is idle, s.
const LASTS_S: f64 = 1.5;

/// What is said to do nothing does nothing, and nothing else is.
#[test]
fn an_idle_effect_changes_no_motion() {
    let full = everything();
    let entry = |name: &str| TABLE.iter().find(|e| e.name == name).unwrap();
    let driven = full.effects.measured.clone().unwrap();
    let shoulders = sim::effects::measured::Measured {
        phase_rad: Vec::new(),
        shoulder_m: (0..3)
            .map(|i| {
                (0..4)
                    .map(|k| [0.1 * f64::from(i), 0.0, 1.0 + 0.01 * f64::from(k)])
                    .collect()
            })
            .collect(),
        ..driven
    };
    let mut cases = vec![full.clone(); 6];
    (entry("measured").switch_off)(&mut cases[0].effects);
    (entry("measured").switch_off)(&mut cases[1].effects);
    (entry("contact").switch_off)(&mut cases[1].effects);
    cases[3].effects.measured = Some(shoulders);
    if let Some(path) = &mut cases[3].effects.path {
        path.turn_deg = 0.0;
    }
    // A grip alone: it bends poles, too.
    for name in ["measured", "contact", "friction"] {
        (entry(name).switch_off)(&mut cases[4].effects);
    }
    // Everything that begins does so when the run ends.
    (entry("measured").switch_off)(&mut cases[5].effects);
    let late = &mut cases[5].effects;
    late.music.as_mut().unwrap().onset_s = LASTS_S;
    let lift = late.lift.as_mut().unwrap();
    (lift.onset_s, lift.build_up_s) = (9.0, 1.0);
    for push in &mut late.push.as_mut().unwrap().pushes {
        push.start_s = LASTS_S;
    }
    let mut seen = std::collections::BTreeSet::new();
    for case in &mut cases {
        (entry("imu").switch_off)(&mut case.effects);
        case.duration_s = LASTS_S;
        let names: Vec<&str> = idle(case).map(|(name, _)| name).collect();
        seen.extend(names.iter().copied());
        let with = samples(case);
        for effect in TABLE
            .iter()
            .filter(|e| (e.is_on)(&case.effects) && e.name != "measured")
        {
            let other = samples(&without(case, effect));
            let apart = with.iter().zip(&other).fold(0.0_f64, |most, (a, b)| {
                let body = (0..3).map(|i| (a.pose.position_m[i] - b.pose.position_m[i]).abs());
                let turned = (0..4).map(|i| (a.pose.orientation[i] - b.pose.orientation[i]).abs());
                let phases = a
                    .phase_rad
                    .iter()
                    .zip(&b.phase_rad)
                    .map(|(a, b)| (a - b).abs());
                let shoulders = a.shoulder_m.iter().zip(&b.shoulder_m);
                let moved = shoulders.flat_map(|(a, b)| (0..3).map(|i| (a[i] - b[i]).abs()));
                body.chain(turned)
                    .chain(phases)
                    .chain(moved)
                    .fold(most, f64::max)
            });
            let watches = ["drum", "music"].contains(&effect.name);
            let expected = names.contains(&effect.name) || (watches && apart < 1e-6);
            assert_eq!(
                apart < 1e-6,
                expected,
                "{} moves by {apart:e}; idle: {names:?}",
                effect.name
            );
        }
    }
    let all = [
        "coupling",
        "feedback",
        "flexure",
        "frequency_spread",
        "gait",
        "hold",
        "lift",
        "music",
        "noise",
        "pole_friction",
        "push",
        "sling",
    ];
    assert_eq!(seen.into_iter().collect::<Vec<_>>(), all);
}

/// An effect that is off adds no state, no account and no sensor.
#[test]
fn an_absent_effect_leaves_nothing_behind() {
    let full = everything();
    let mut bare = full.clone();
    for effect in TABLE {
        (effect.switch_off)(&mut bare.effects);
    }
    let model = Model::new(&bare);
    assert_eq!(model.layout().size(), 13);
    assert_eq!(model.accounts().count(), 0);
    assert!(model.imus().is_empty() && model.sensor_clocks().is_empty() && model.beat().is_none());
    assert_eq!(model.next_switch_s(0.0), f64::INFINITY);
}

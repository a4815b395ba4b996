//! Three hundred random scenes that are right, and three hundred that are wrong. Seeds are the numbers of the scenes.

#[path = "common/dice.rs"]
mod dice;

use dice::Dice;
use sim::model::Model;
use sim::run::{Sample, run_model, settings};
use sim::scene::{load, parse, to_toml};
use sim::solve::method;
use std::panic::catch_unwind;

impl Dice {
    fn pick<'a>(&mut self, list: &[&'a str]) -> &'a str {
        list[self.below(list.len() as u64) as usize]
    }
}

/// A scene that a person could have meant.
fn valid(seed: u64) -> String {
    let mut d = Dice(seed);
    let n = if d.chance(0.5) {
        1 + d.below(8)
    } else {
        1 + d.below(64)
    };
    let poles = 1 + d.below(n.min(4));
    let mut t = format!(
        "name = \"random {seed}\"\nduration_s = {:?}\nlog_rate_hz = {:?}\nseed = {seed}\n",
        d.from(0.2, 3.0),
        d.from(1.0, 120.0)
    );
    let mut may = [true; 5];
    if d.chance(0.4) {
        let mut free: Vec<&str> = ["x", "y", "height", "roll", "tilt", "yaw"]
            .into_iter()
            .filter(|_| d.chance(0.5))
            .collect();
        if free.is_empty() {
            free.push("height");
        }
        // What is held may not start with a velocity.
        may = [
            &["x", "y", "yaw"][..],
            &["x"],
            &["height"],
            &["roll"],
            &["roll", "tilt", "yaw"],
        ]
        .map(|all: &[&str]| all.iter().all(|f| free.contains(f)));
        t += &format!("freedom = {free:?}\n");
    }
    let [turns, moves @ ..] = may;
    // Moments of a box: they always belong to a body.
    let (m, a, b, c) = (
        d.from(1.0, 300.0),
        d.from(0.1, 3.0),
        d.from(0.1, 3.0),
        d.from(0.1, 3.0),
    );
    let moment = |p: f64, q: f64| m * (p * p + q * q) / 12.0;
    t += &format!(
        "[body]\nmass_kg = {m:?}\ninertia_kg_m2 = {{ xx = {:?}, yy = {:?}, zz = {:?} }}\n",
        moment(b, c),
        moment(a, c),
        moment(a, b)
    );
    if d.chance(0.1) {
        t += "gravity_m_per_s2 = [0.0, 0.0, 0.0]\n";
    }
    t += &format!(
        "[carriers]\ninitial_phase_sd_rad = {:?}\nfrequency_hz = {:?}\nwalk_m_per_s = [{:?}, 0.0, 0.0]\n[carriers.along_poles]\ncount = {n}\npoles = {poles}\nlength_m = {:?}\nspacing_m = {:?}\nheight_m = {:?}\n",
        d.from(0.0, 3.0),
        d.from(0.5, 3.0),
        d.from(-1.5, 1.5),
        d.from(0.0, 8.0),
        d.from(0.0, 2.0),
        d.from(-0.3, 0.5)
    );
    // Where all handles are metres from their shoulders, straps have no bounded motion: they are for the others.
    let yaw_deg = d.from(-180.0, 180.0);
    t += "[start]\n";
    if d.chance(0.5) {
        t += &format!("height_m = {:?}\n", d.from(0.5, 1.6));
    }
    let [x, height, roll, all_turns] = moves.map(|moves| if moves { 1.0 } else { 0.0 });
    t += &format!(
        "roll_pitch_yaw_deg = [{:?}, {:?}, {:?}]\nvelocity_m_per_s = [{:?}, 0.0, {:?}]\nangular_velocity_rad_per_s = [{:?}, {:?}, {:?}]\n",
        d.from(-30.0, 30.0),
        d.from(-20.0, 20.0),
        yaw_deg,
        x * d.from(-1.0, 1.0),
        height * d.from(-1.0, 1.0),
        roll * d.from(-2.0, 2.0),
        all_turns * d.from(-2.0, 2.0),
        all_turns * d.from(-2.0, 2.0)
    );
    t += &format!(
        "[solver]\ntolerance = {:?}\nenergy = {}\n",
        10f64.powf(d.from(-9.0, -3.0)),
        d.chance(0.5)
    );
    if d.chance(0.8) {
        t += &format!(
            "[effects.contact]\nstiffness_n_per_m = {:?}\ndamping_n_s_per_m = {:?}\n",
            d.from(200.0, 2e4),
            d.from(0.0, 800.0)
        );
        match d.below(4) {
            0 => t += "bilateral = true\n",
            1 => {
                t += &format!(
                    "law = \"hunt-crossley\"\nexponent = {:?}\n",
                    d.from(1.0, 2.0)
                )
            }
            _ => {}
        }
    }
    let hold = d.chance(0.6);
    if hold {
        t += &format!(
            "[effects.hold]\nstiffness_n_per_m = {:?}\n",
            d.from(0.0, 6000.0)
        );
    }
    let sling = yaw_deg.abs() < 20.0 && d.chance(0.9);
    if sling {
        t += &format!("[effects.sling]\nlength_m = {:?}\n", d.from(0.3, 2.0));
    }
    if d.chance(0.4) {
        let law = if hold || sling {
            "regularised"
        } else {
            d.pick(&["regularised", "bristle"])
        };
        t += &format!(
            "[effects.friction]\nlaw = \"{law}\"\ncoefficient = {:?}\n",
            d.from(0.05, 1.0)
        );
    }
    if d.chance(0.5) {
        t += &format!("[effects.pole_friction]\narm_m = {:?}\n", d.from(0.0, 0.01));
    }
    if d.chance(0.8) {
        t += &format!(
            "[effects.gait]\namplitude_m = {:?}\nsway_m = {:?}\n",
            d.from(0.0, 0.1),
            d.from(0.0, 0.02)
        );
        if d.chance(0.3) {
            t += "harmonics = [{ order = 2, amplitude_m = [0.001, 0.0, 0.004] }]\n";
        }
        if d.chance(0.4) {
            t += &format!(
                "[effects.lift]\ngain = {:?}\nonset_s = 0.5\nbuild_up_s = 0.7\n",
                d.from(0.5, 1.5)
            );
        }
    }
    for (name, p) in [("frequency_spread", 0.5), ("noise", 0.5), ("feedback", 0.3)] {
        if d.chance(p) {
            t += &format!("[effects.{name}]\n");
        }
    }
    if d.chance(0.4) {
        t += &format!(
            "[effects.coupling]\nstrength_rad_per_s = {:?}\ngraph = \"{}\"\n",
            d.from(0.0, 3.0),
            d.pick(&["all", "chain"])
        );
    }
    if d.chance(0.5) {
        t += &format!(
            "[effects.music]\nbeat_hz = {:?}\nonset_s = {:?}\nbuild_up_s = {:?}\n",
            d.from(1.0, 3.0),
            d.from(0.0, 2.0),
            d.from(0.0, 2.0)
        );
        if d.chance(0.3) {
            t += "tempo_changes = [{ at_s = 1.0, over_s = 0.5, beat_hz = 2.2 }]\npauses = [{ from_s = 0.3, to_s = 0.6 }]\n";
        }
        if d.chance(0.3) {
            t += "[effects.drum]\nsample_rate_hz = 8000\n";
        }
    }
    if d.chance(0.3) {
        t += &format!(
            "[effects.path]\nturn_deg = {:?}\nturn_start_s = 0.3\nslope_deg = {:?}\n",
            // What nothing takes along does not turn.
            if turns && (hold || sling || t.contains("[effects.friction]")) {
                d.from(-90.0, 90.0)
            } else {
                0.0
            },
            d.from(-15.0, 15.0)
        );
    }
    if d.chance(0.3) {
        t += &format!(
            "[effects.flexure]\nfrequency_hz = {:?}\n",
            d.from(2.0, 10.0)
        );
    }
    if d.chance(0.3) {
        t += "[effects.imu]\nsensors = [{ on = \"rath\", place_m = [0.3, 0.1, 0.2] }, { on = \"carrier_1\", clock_drift_ppm = 30.0 }]\n";
    }
    if d.chance(0.3) {
        t += &format!(
            "[effects.push]\npushes = [{{ start_s = {:?}, time_s = {:?}, force_n = [{:?}, {:?}, {:?}], place_m = [0.3, 0.1, 0.2] }}]\n",
            d.from(0.0, 2.0),
            d.from(0.01, 2.0),
            d.from(-300.0, 300.0),
            d.from(-300.0, 300.0),
            d.from(-300.0, 300.0)
        );
    }
    t
}

#[test]
fn three_hundred_random_scenes_run() {
    for seed in 0..300 {
        let text = valid(seed);
        let scene =
            parse("random", &text, &[]).unwrap_or_else(|e| panic!("scene {seed}: {e}\n{text}"));
        assert_eq!(
            parse("again", &to_toml(&scene), &[]).unwrap(),
            scene,
            "scene {seed}"
        );
        let mut settings = settings(&scene);
        // Far more than any of them needs: a run that reaches it hangs.
        settings.most_evaluations = 3_000_000;
        let model = Model::new(&scene);
        let mut samples = 0;
        let mut all_finite = true;
        let (_, outcome) = run_model(
            &model,
            method("auto").unwrap(),
            &settings,
            &mut |s: &Sample| {
                samples += 1;
                let angles = s.pose.roll_pitch_yaw_rad();
                let numbers = s
                    .pose
                    .position_m
                    .iter()
                    .chain(&angles)
                    .chain(&s.normal_n)
                    .chain(&s.phase_rad);
                all_finite &= numbers
                    .chain(s.tangential_n.iter().flatten())
                    .all(|x| x.is_finite());
                true
            },
        );
        if let Err(why) = outcome {
            panic!("scene {seed}: {why}\n{text}");
        }
        assert!(
            all_finite,
            "scene {seed} gave a number that is none\n{text}"
        );
        assert_eq!(
            samples,
            (scene.duration_s * scene.log_rate_hz).floor() as usize + 1,
            "scene {seed}"
        );
    }
}

/// One thing wrong, of many kinds.
fn spoilt(seed: u64) -> String {
    let mut d = Dice(seed ^ 0xBAD);
    let text = valid(seed);
    let number = d.pick(&[
        "-1.0",
        "nan",
        "inf",
        "-inf",
        "1e400",
        "\"heavy\"",
        "[]",
        "true",
        "0.0",
    ]);
    match d.below(8) {
        0 => text.replacen("mass_kg = ", &format!("mass_kg = {number} # "), 1),
        1 => text.replacen("duration_s = ", &format!("duration_s = {number} # "), 1),
        2 => text.replacen(
            "length_m = ",
            &format!(
                "length_m = {} # ",
                d.pick(&["-1.0", "nan", "inf", "\"x\"", "[]"])
            ),
            1,
        ),
        3 => text.replacen("tolerance = ", &format!("tolerance = {number} # "), 1),
        4 => text.replacen(
            "count = ",
            &format!(
                "count = {} # ",
                d.pick(&["-3", "0", "2.5", "\"two\"", "99999999999"])
            ),
            1,
        ),
        5 => {
            text + d.pick(&[
                "[effects.musik]\n",
                "[effect.gait]\n",
                "[body]\nmass = 3\n",
                "[",
                "x = = 3\n",
                "\"\n",
                "[effects.lift]\ngain = -3.0\n",
            ])
        }
        6 => {
            // Cut off in the middle of a key or of a value.
            let at = text.find("[solver]").unwrap_or(text.len());
            format!("{}\n[solver]\ntoleran", &text[..at])
        }
        _ => text.replacen(
            "inertia_kg_m2 = ",
            "inertia_kg_m2 = { xx = 1.0, yy = 1.0, zz = 9.0 } # ",
            1,
        ),
    }
}

#[test]
fn three_hundred_spoilt_scenes_are_each_refused_in_one_sentence() {
    for seed in 0..300 {
        let text = spoilt(seed);
        let outcome = catch_unwind(|| parse("spoilt.toml", &text, &[]))
            .unwrap_or_else(|_| panic!("scene {seed} panics\n{text}"));
        let said = match outcome {
            Ok(_) => panic!("scene {seed} passes\n{text}"),
            Err(e) => e.to_string(),
        };
        assert!(
            said.starts_with("spoilt.toml")
                && !said.contains('\n')
                && (20..500).contains(&said.len()),
            "scene {seed}: {said}"
        );
    }
}

/// Hostile file names and bytes end in a sentence as well.
#[test]
fn files_that_are_no_scenes_are_refused() {
    for name in ["", " ", "/", "..", "no/such.toml", "\u{0}", "music.toml"] {
        let said = load(name, &[]).unwrap_err().to_string();
        assert!(!said.is_empty() && !said.contains('\n'), "{name:?}: {said}");
    }
}

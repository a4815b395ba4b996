//! Scenes: what is wrong with one is said in one sentence, with its place; what comes with the program is right.

use sim::model::Model;
use sim::run::{Sample, run};
use sim::scene::{BUILTIN, SceneError, Template, load, parse, setting_value, to_toml};

/// The message about a scene that must not pass.
fn message(text: &str) -> String {
    let error = parse("scene.toml", text, &[]).expect_err(text);
    let said = error.to_string();
    assert!(
        !said.contains('\n') && !said.contains("Err(") && said.len() < 600,
        "{said}"
    );
    said
}

/// Asks that the message begins with line and column and mentions every word.
fn expect(text: &str, place: &str, words: &[&str]) {
    let said = message(text);
    assert!(said.starts_with(&format!("scene.toml:{place}: ")), "{said}");
    for word in words {
        assert!(said.contains(word), "`{word}` is not in: {said}");
    }
}

/// A body that begins at rest is hung on its poles, however soft; beyond what heights can tell the poles are refused, and the key is named.
#[test]
fn poles_too_soft_to_rest_on_are_refused() {
    let with = |frequency_hz: f64, start: &str| {
        format!(
            "name = \"soft\"\nduration_s = 0.001\n{start}[effects.contact]\n[effects.flexure]\nfrequency_hz = {frequency_hz:e}\n"
        )
    };
    for frequency_hz in [1e-6, 1e-8, 1e-18] {
        let said = message(&with(frequency_hz, ""));
        assert!(
            said.contains("effects.flexure.frequency_hz") && said.contains("too soft"),
            "{said}"
        );
        assert!(parse("t", &with(frequency_hz, "start.height_m = 0.9\n"), &[]).is_ok());
    }
    for frequency_hz in [1e-4, 1e-1] {
        let scene = parse("t", &with(frequency_hz, ""), &[]).unwrap();
        let state = Model::new(&scene).initial_state();
        assert!(state.iter().all(|x| x.is_finite()));
    }
}

#[test]
fn a_list_is_no_table() {
    expect(
        "name = \"a\"\nbody = [70]",
        "2:8",
        &["body", "found a list, expected a table"],
    );
    let harmonics = "name = \"a\"\n[effects.gait]\nharmonics = [[2, [0.0, 0.0, 0.1]]]";
    expect(
        harmonics,
        "3:14",
        &["effects.gait.harmonics.0", "expected a table"],
    );
    for setting in [
        "effects.contact=[]",
        "start=[2.0]",
        "body.inertia_kg_m2=[1,2,3]",
    ] {
        let said = load("music", &[setting.to_owned()])
            .unwrap_err()
            .to_string();
        let key = setting.split('=').next().unwrap();
        assert_eq!(
            said,
            format!("--set: {key}: found a list, expected a table")
        );
    }
}

/// A scene that is right without the settings is wrong by them, though the key that is complained about is another.
#[test]
fn settings_are_blamed_for_what_they_make_wrong() {
    for setting in [
        "duration_s=1e9",
        "effects.lift.onset_s=5",
        "body.inertia_kg_m2.xx=100",
    ] {
        let said = load("music", &[setting.to_owned()])
            .unwrap_err()
            .to_string();
        assert!(said.starts_with("--set: "), "{said}");
    }
    let text = "name = \"a\"\nduration_s = -1.0";
    let said = parse("scene.toml", text, &["seed=7".into()])
        .unwrap_err()
        .to_string();
    assert!(said.starts_with("scene.toml:2:"), "{said}");
}

#[test]
fn unknown_keys_are_answered_with_the_nearest() {
    expect(
        "name = \"a\"\ndurration_s = 3",
        "2:1",
        &["durration_s", "Did you mean `duration_s`?"],
    );
    expect(
        "name = \"a\"\n[effects.musik]",
        "2:10",
        &["musik", "Did you mean `music`?"],
    );
    expect(
        "name = \"a\"\n[effects.gait]\namplitud_m = 0.1",
        "3:1",
        &["Did you mean `amplitude_m`?"],
    );
    expect(
        "name = \"a\"\nfreedom = [\"height\", \"rol\"]",
        "2:22",
        &["Did you mean `roll`?"],
    );
    let said = load("basline", &[]).unwrap_err().to_string();
    assert!(
        said.contains("Did you mean `baseline`?") && said.contains("stand-still"),
        "{said}"
    );
    let said = load("missing/scene.toml", &[]).unwrap_err().to_string();
    assert!(
        said.starts_with("cannot read the scene missing/scene.toml"),
        "{said}"
    );
}

#[test]
fn wrong_types_and_signs_are_pointed_at() {
    expect("name = 3", "1:8", &["string"]);
    expect(
        "name = \"a\"\nduration_s = \"long\"",
        "2:14",
        &["found string", "expected a number"],
    );
    expect(
        "name = \"a\"\nduration_s = 0",
        "2:14",
        &["duration_s", "above zero"],
    );
    expect(
        "name = \"a\"\nduration_s = -1.0",
        "2:14",
        &["found -1", "above zero"],
    );
    expect("name = \"a\"\nduration_s = nan", "2:14", &["NaN"]);
    expect("name = \"a\"\nlog_rate_hz = 0.0", "2:15", &["above zero"]);
    expect("name = \"a\"\nlog_rate_hz = 1e9", "2:15", &["samples"]);
    // Of two that are too much together, the one that is farther from its default is pointed at.
    for (text, place) in [
        ("duration_s = 1e12\nlog_rate_hz = 1.0", "2:14"),
        ("log_rate_hz = 60.0\nduration_s = 2e7", "3:14"),
        (
            "duration_s = 2e7\nlog_rate_hz = 1.0\n[solver]\nmethod = \"rk4\"",
            "2:14",
        ),
        (
            "duration_s = 70.0\n[solver]\nmethod = \"rk4\"\nstep_s = 1e-12",
            "5:10",
        ),
        (
            "duration_s = 1e8\nlog_rate_hz = 1.0\n[effects.noise]",
            "2:14",
        ),
        ("duration_s = 70.0\n[effects.noise]\ngrid_hz = 1e9", "4:11"),
        ("duration_s = 1e8\nlog_rate_hz = 1.0\n[effects.imu]", "2:14"),
        ("duration_s = 70.0\n[effects.imu]\nrate_hz = 1e9", "4:11"),
    ] {
        expect(&format!("name = \"a\"\n{text}"), place, &[" s "]);
    }
    expect("name = \"a\"\nseed = -4", "2:8", &["-4", "2^56 - 1"]);
    expect(
        "name = \"a\"\nduration_s = 0.1\nlog_rate_hz = 1.1e9",
        "3:15",
        &["at most 1e9"],
    );
    expect("name = \"a\"\nepoch_s = 2147483600.0", "2:11", &["2038"]);
    let late = "name = \"a\"\nepoch_s = 1.7e9\n";
    for (instrument, place) in [
        (
            "[effects.imu]\nsensors = [{ clock_offset_s = 1e9 }]",
            "4:31",
        ),
        (
            "[effects.music]\n[effects.drum]\nclock_offset_s = 1e9",
            "5:18",
        ),
    ] {
        expect(&format!("{late}{instrument}"), place, &["2038"]);
    }
    let drifts = "name = \"a\"\nepoch_s = 2147483600.0\nduration_s = 46.0\n[effects.music]\n[effects.drum]\nclock_drift_ppm = 1e5";
    expect(drifts, "6:19", &["clock_drift_ppm", "2038"]);
    expect(
        "name = \"a\"\n[carriers]\nhandles_m = [[1.0, 2.0, 3.0]]\n[carriers.along_poles]\ncount = 2",
        "3:13",
        &["along_poles"],
    );
    // A held coordinate does not move; turning about the pole is roll's.
    let held =
        |start: &str| format!("name = \"a\"\nfreedom = [\"height\", \"roll\"]\n[start]\n{start}");
    expect(
        &held("velocity_m_per_s = [0.5, 0.0, 1.0]"),
        "4:20",
        &["[0.5, 0.0, 1.0]", "[0.0, 0.0, 1.0]"],
    );
    expect(
        &held("angular_velocity_rad_per_s = [1.0, 2.0, 0.0]"),
        "4:30",
        &["[1.0, 0.0, 0.0]"],
    );
    let moves = "velocity_m_per_s = [0.0, 0.0, 1.0]\nangular_velocity_rad_per_s = [1.0, 0.0, 0.0]";
    assert!(parse("scene.toml", &held(moves), &[]).is_ok());
    expect(
        "name = \"a\"\n[body]\nmass_kg = 0.0",
        "3:11",
        &["body.mass_kg", "found 0", "above zero"],
    );
    expect(
        "name = \"a\"\n[body]\nmass_kg = -60.0",
        "3:11",
        &["found -60"],
    );
    expect("name = \"a\"\n[body]\nmass_kg = inf", "3:11", &["inf"]);
    expect(
        "name = \"a\"\n[body]\ninertia_kg_m2 = { xx = 1.0, yy = 1.0, zz = 3.0 }",
        "3:17",
        &["triangle inequality"],
    );
    expect(
        "name = \"a\"\n[body]\ninertia_kg_m2 = { xx = 1.0, yy = 1.0 }",
        "3:17",
        &["zz"],
    );
    expect(
        "name = \"a\"\n[carriers]\nhandles_m = []",
        "3:13",
        &["at least one handle"],
    );
    expect(
        "name = \"a\"\n[carriers]\nhandles_m = [[1.0, 2.0]]",
        "3:14",
        &["3"],
    );
    expect(
        "name = \"a\"\n[carriers]\nfrequency_hz = [2.0, 2.0, 2.0]",
        "3:16",
        &["3 values for 2 carriers"],
    );
    expect(
        "name = \"a\"\n[carriers.along_poles]\ncount = 0",
        "3:9",
        &["found 0"],
    );
    expect(
        "name = \"a\"\n[carriers.along_poles]\ncount = 2\npoles = 3",
        "4:9",
        &["poles"],
    );
    expect(
        "name = \"a\"\n[solver]\nmethod = \"rk5\"",
        "3:10",
        &["Did you mean `rk4`?"],
    );
    expect(
        "name = \"a\"\n[solver]\ntolerance = 1e-20",
        "3:13",
        &["1e-13"],
    );
    expect("name = \"a\"\nfreedom = []", "2:11", &["empty"]);
    expect(
        "name = \"a\"\nfreedom = [\"roll\", \"roll\"]",
        "2:11",
        &["twice"],
    );
    expect(
        "name = \"a\"\n[effects.contact]\nstiffness_n_per_m = -3.0",
        "3:21",
        &["zero or more"],
    );
    expect("name = \"a\"\n[effects.lift]", "2:1", &["effects.gait"]);
    expect(
        "name = \"a\"\n[effects.imu]\nsensors = []",
        "3:11",
        &["empty"],
    );
    expect(
        "name = \"a\"\n[effects.imu]\nsensors = [{ on = \"carrier_3\" }]",
        "3:19",
        &["carrier_2"],
    );
    expect(
        "name = \"a\"\n[effects.imu]\nsensors = [{ on = \"carrier_+1\" }]",
        "3:19",
        &["carrier_+1"],
    );
    expect(
        "name = \"a\"\n[effects.imu]\naccel_resolution_m_per_s2 = 1e9",
        "3:29",
        &["1e9", "accel_range_m_per_s2"],
    );
    expect(
        "name = \"a\"\n[[effects.gait.harmonics]]\norder = 2\namplitude_m = [0.0, 0.0, 0.1]\n\
         [[effects.gait.harmonics]]\norder = 99\namplitude_m = [0.0, 0.0, 0.1]",
        "6:9",
        &["harmonics.1.order", "found 99"],
    );
    expect(
        "name = \"a\"\n[effects.music]\npauses = [{ from_s = 3.0, to_s = 2.0 }]",
        "3:34",
        &["from_s"],
    );
    expect(
        "name = \"a\"\n[effects.coupling]\ngraph = { edges = [[0, 2]] }",
        "3:9",
        &["carrier 2"],
    );
    expect(
        "name = \"a\"\n[effects.coupling]\ngraph = { edges = [[0, 1], [1, 0]] }",
        "3:9",
        &["[1, 0] stands there twice"],
    );
    expect(
        "name = \"a\"\n[effects.hold]\n[effects.friction]\nlaw = \"bristle\"",
        "4:7",
        &["hold"],
    );
    expect(
        "name = \"a\"\n[effects.path]\nturn_deg = 9.0",
        "3:12",
        &["effects.hold"],
    );
    expect(
        "name = \"a\"\nfreedom = [\"x\", \"height\"]\n[effects.hold]\n[effects.path]\nturn_deg = 9.0",
        "5:12",
        &["yaw"],
    );
    expect(
        "name = \"a\"\n[effects.contact]\nexponent = 2.0",
        "3:12",
        &["hunt-crossley"],
    );
    expect(
        "name = \"a\"\n[effects.noise]\ngrid_hz = 1e300",
        "3:11",
        &["1e300", "at most 1e18"],
    );
    expect(
        "name = \"a\"\n[effects.noise]\ngrid_hz = 1e9",
        "3:11",
        &["1e9 Hz", "cells"],
    );
    expect(
        "name = \"a\"\n[effects.music]\nbeat_phase_rad = 1e17",
        "3:18",
        &["at most 1000000"],
    );
    expect(
        "name = \"a\"\n[effects.music]\n[effects.drum]\npitch_hz = 2e4",
        "4:12",
        &["8000"],
    );
    expect("name = \"a\"\n\n[body\nmass_kg = 3", "3:6", &[]);
    expect("", "1:1", &["name"]);
}

#[test]
fn settings_are_checked_like_the_scene() {
    let with = |setting: &str| parse("s", "name = \"a\"\n[effects.music]", &[setting.into()]);
    assert_eq!(
        with("effects.music.beat_hz=2.5")
            .unwrap()
            .effects
            .music
            .unwrap()
            .beat_hz,
        2.5
    );
    assert_eq!(
        with("effects.music.beat_hz=2")
            .unwrap()
            .effects
            .music
            .unwrap()
            .beat_hz,
        2.0
    );
    assert!(with("effects.music=false").unwrap().effects.music.is_none());
    // What is not there can be taken away too, but not what cannot be.
    assert!(with("effects.hold=false").unwrap().effects.hold.is_none());
    // What was taken away is not brought back by a part of it, but it can be given anew.
    let set = |settings: &[&str]| {
        let settings: Vec<String> = settings.iter().map(|&s| s.to_owned()).collect();
        load("music", &settings)
    };
    let back = set(&["effects.music=false", "effects.music.beat_hz=2"]).unwrap_err();
    assert!(
        back.to_string()
            .contains("effects.music=false took it away"),
        "{back}"
    );
    let anew = [
        "effects.music=false",
        "effects.music={beat_hz=3}",
        "effects.music.beat_hz=2",
    ];
    assert_eq!(set(&anew).unwrap().effects.music.unwrap().beat_hz, 2.0);
    assert!(
        with("effects.gait.amplitude_m=0.07")
            .unwrap()
            .effects
            .gait
            .is_some()
    );
    for (setting, words) in [
        ("effects.music.beat_hs=2", "Did you mean `beat_hz`?"),
        ("effects.musik=false", "Did you mean `music`?"),
        (
            "effects.music.strength=2",
            "Did you mean `strength_rad_per_s`?",
        ),
        (
            "effects.imu.sensors.0.on=\"rath\"",
            "there is no list `sensors` yet",
        ),
        ("effects.music.beat_hz=fast", "expected a number"),
        ("effects.music.beat_hz=-2", "at least 0"),
        ("duration_s", "KEY=VALUE"),
        ("duration_s=0", "above zero"),
        ("=3", "empty name"),
        ("duration_s=false", "expected a number"),
        ("solver=false", "expected a table"),
        ("effects.music.beat_hz=false", "expected a number"),
        ("effects.gait.amplitude_m=false", "expected a number"),
        ("seed=3\nduration_s=0.1", "expected a whole number"),
        ("name.x=3", "single value"),
    ] {
        let said = with(setting).unwrap_err();
        assert!(matches!(said, SceneError::Value { .. }), "{said:?}");
        assert!(
            said.to_string().starts_with("--set") && said.to_string().contains(words),
            "{said}"
        );
    }
}

/// What has no default but to be absent can be taken away; places of carriers are given once.
#[test]
fn carriers_stand_along_poles_or_by_hand() {
    let with = |settings: &[&str]| {
        let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
        load("eight-carriers", &settings)
    };
    let (by_hand, no_poles) = (
        "carriers.handles_m=[[1.0, 0.0, 0.1], [-1.0, 0.0, 0.1]]",
        "carriers.along_poles=false",
    );
    for set in [by_hand, "carriers.handles_m.0.0=2.0"] {
        let said = with(&[set]).unwrap_err().to_string();
        assert!(said.contains(no_poles), "{said}");
    }
    assert_eq!(with(&[no_poles, by_hand]).unwrap().carriers.count(), 2);
    assert_eq!(
        with(&["start.height_m=2.0", "start.height_m=false"])
            .unwrap()
            .start
            .height_m,
        None
    );
    // A printed scene has both alike, and a sweep counts along the poles.
    let template = Template::of(&with(&[]).unwrap());
    let count = |key, value: toml::Value| template.with([(key, value)]).map(|s| s.carriers.count());
    assert_eq!(count("carriers.along_poles.count", 6.into()).unwrap(), 6);
    let said = count("carriers.handles_m.0.0", 2.0.into())
        .unwrap_err()
        .to_string();
    assert!(said.contains(no_poles), "{said}");
}

/// A template takes what a setting takes, and refuses what a setting is refused.
#[test]
fn a_template_is_changed_as_by_settings() {
    let template = Template::load("baseline", &[]).unwrap();
    for setting in [
        "effects.flexure={frequency_hz=5.0}",
        "effects.flexure=false",
        "effects.contact=false",
        "start.height_m=false",
        "body.inertia_kg_m2=[1.0, 2.0, 2.5]",
        "effects.flexure=[5.0, 0.1, 3.0]",
        "effects.flexur=false",
        "solver=false",
    ] {
        let (key, value) = setting.split_once('=').unwrap();
        let swept = template.with([(key, setting_value(value))]);
        match load("baseline", &[setting.to_owned()]) {
            Ok(scene) => assert_eq!(swept, Ok(scene), "{setting}"),
            Err(why) => {
                let (why, said) = (why.to_string(), swept.unwrap_err().to_string());
                let why = why.rsplit_once(": ").unwrap().1;
                assert!(said.ends_with(why), "{setting}: {said}, not {why}");
            }
        }
    }
}

/// Every built-in scene is complete, comes back from its own TOML, and runs its first seconds with nothing unexplained.
#[test]
fn built_in_scenes_are_complete_and_run() {
    let names: Vec<&str> = BUILTIN.iter().map(|(n, _)| *n).collect();
    for name in [
        "baseline",
        "music",
        "strict-contact",
        "one-handle-drop",
        "eight-carriers",
        "long-pole",
        "detuned-beat",
        "tempo-change",
        "tumble",
        "stand-still",
        "field-imu",
    ] {
        assert!(names.contains(&name), "{name}");
    }
    for name in names {
        let mut scene = load(name, &[]).unwrap();
        assert_eq!(scene.name, name);
        assert!(!scene.about.is_empty());
        assert_eq!(
            parse(name, &to_toml(&scene), &[]).unwrap(),
            scene,
            "{name} does not survive its own TOML"
        );
        scene.duration_s = scene.duration_s.min(8.0);
        let mut worst: f64 = 0.0;
        let mut moved: f64 = 1.0;
        run(&scene, &mut |s: &Sample| {
            let e = s.energy.expect("every sample has a ledger");
            worst = worst.max(e.unexplained_j.abs());
            moved = moved.max(e.work_in_j.abs() + e.kinetic_j.abs() + e.potential_j.abs());
            true
        })
        .unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(
            worst < 1e-8 * moved,
            "{name}: {worst:.1e} J of {moved:.1e} J unexplained"
        );
    }
}

#[test]
fn states_have_names_of_their_own() {
    for (name, _) in BUILTIN {
        let model = Model::new(&load(name, &[]).unwrap());
        let names = model.state_names();
        assert_eq!(names.len(), model.layout().size(), "{name}");
        let mut once = names.clone();
        once.sort();
        once.dedup();
        assert_eq!(once.len(), names.len(), "{name}: {names:?}");
    }
}

/// The schema names every effect and carries the descriptions; docs/model.md names every parameter of every effect.
#[test]
fn the_schema_and_the_page_know_every_parameter() {
    let schema = sim::scene::json_schema();
    let effects = &schema["$defs"]["Effects"]["properties"];
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/model.md"))
        .unwrap();
    let mut parameters = 0;
    for effect in sim::effects::TABLE {
        assert!(
            effects.get(effect.name).is_some(),
            "the schema lacks {}",
            effect.name
        );
        assert!(
            page.contains(&format!("### `{}`", effect.name)),
            "docs/model.md lacks {}",
            effect.name
        );
        let of = effects[effect.name].to_string();
        let definition = of
            .split("#/$defs/")
            .nth(1)
            .and_then(|s| s.split('"').next())
            .unwrap();
        for (name, what) in schema["$defs"][definition]["properties"]
            .as_object()
            .unwrap()
        {
            assert!(
                page.contains(&format!("`{name}`")),
                "docs/model.md lacks {}.{name}",
                effect.name
            );
            assert!(
                what["description"].is_string(),
                "{}.{name} has no description",
                effect.name
            );
            parameters += 1;
        }
    }
    assert!(parameters > 60, "{parameters}");
}

/// field-imu is music with instruments, and stays so.
#[test]
fn the_field_scene_is_the_music_scene_with_instruments() {
    let mut field = load("field-imu", &[]).unwrap();
    let music = load("music", &[]).unwrap();
    (field.effects.imu, field.effects.drum) = (None, None);
    (field.name, field.about) = (music.name.clone(), music.about.clone());
    assert_eq!(field, music);
}

/// What lies on the edge of a range, or beyond it in one of several ways, is refused under its key; what lies just inside is not.
#[test]
fn edges_of_ranges_are_where_they_are_said_to_be() {
    let base = "name = \"a\"\nduration_s = 10.0\n[effects.hold]\n";
    let music = |more: &str| format!("[effects.gait]\n[effects.music]\n{more}");
    let changes = |list: &str| music(&format!("tempo_changes = [{list}]\n"));
    let pauses = |list: &str| music(&format!("pauses = [{list}]\n"));
    let measured = |times: &str, phases: &str| {
        format!("[effects.gait]\n[effects.measured]\nt_s = {times}\nphase_rad = {phases}\n")
    };
    let (two, times) = (
        "[[0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 2.0, 3.0]]",
        "[0.0, 3.0, 6.0, 10.0]",
    );
    let sensor = |more: &str| format!("[[effects.imu.sensors]]\n{more}\n");
    let drum = |more: &str| music(&format!("[effects.drum]\n{more}\n"));
    let body = |zz: &str| format!("[body]\ninertia_kg_m2 = {{ xx = 1.0, yy = 1.0, zz = {zz} }}\n");
    for (text, key) in [
        (
            changes("{ at_s = 0.0, beat_hz = 2.0 }"),
            "tempo_changes.0.at_s",
        ),
        (
            changes("{ at_s = nan, beat_hz = 2.0 }"),
            "tempo_changes.0.at_s",
        ),
        (
            changes("{ at_s = 1.0, over_s = 3.0, beat_hz = 2.0 }, { at_s = 3.9, beat_hz = 2.0 }"),
            "tempo_changes.1.at_s",
        ),
        (pauses("{ from_s = nan, to_s = 2.0 }"), "pauses.0.from_s"),
        (pauses("{ from_s = 2.0, to_s = 2.0 }"), "pauses.0.to_s"),
        (
            pauses("{ from_s = 1.0, to_s = 2.0 }, { from_s = 1.9, to_s = 3.0 }"),
            "pauses.1.from_s",
        ),
        (
            "[effects.path]\nslope_deg = 60.0\n".into(),
            "path.slope_deg",
        ),
        ("[effects.path]\nbank_deg = -60.0\n".into(), "path.bank_deg"),
        ("[effects.path]\nbank_deg = nan\n".into(), "path.bank_deg"),
        (
            measured("[0.0, 5.0, 10.0]", "[[0.0, 1.0, 2.0], [0.0, 1.0, 2.0]]"),
            "measured.t_s",
        ),
        (measured("[0.0, 3.0, 3.0, 10.0]", two), "measured.t_s"),
        (measured("[0.0, 3.0, 6.0, 9.9]", two), "measured.t_s"),
        (measured("[0.1, 3.0, 6.0, 10.0]", two), "measured.t_s"),
        (
            measured(times, "[[0.0, 1.0, 2.0, 3.0]]"),
            "measured.phase_rad",
        ),
        (
            measured(times, "[[0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 2.0]]"),
            "measured.phase_rad",
        ),
        (sensor("clock_offset_s = -2e9"), "sensors.0.clock_offset_s"),
        (sensor("name = \"\""), "sensors.0.name"),
        (sensor("name = \"left/hand\""), "sensors.0.name"),
        (
            drum("sample_rate_hz = 8000\npitch_hz = 4000.0"),
            "drum.pitch_hz",
        ),
        (body("0.0"), "inertia_kg_m2"),
        (body("-0.1"), "inertia_kg_m2"),
        (body("1e-15"), "inertia_kg_m2"),
    ] {
        let said = message(&format!("{base}{text}"));
        assert!(said.contains(key), "`{key}` is not in: {said}");
    }
    for text in [
        changes("{ at_s = 1.0, over_s = 3.0, beat_hz = 2.0 }, { at_s = 4.0, beat_hz = 2.0 }"),
        pauses("{ from_s = 0.0, to_s = 2.0 }, { from_s = 2.0, to_s = 3.0 }"),
        "[effects.path]\nslope_deg = 59.9\nbank_deg = -59.9\n".into(),
        measured(times, two),
        sensor("name = \"left_hand2\""),
        drum("sample_rate_hz = 8000\npitch_hz = 3999.0"),
        body("1e-6"),
    ] {
        let scene = parse("scene.toml", &format!("{base}{text}"), &[]);
        assert!(scene.is_ok(), "{text}: {:?}", scene.err());
    }
}

//! `sim scenes`, `sim explain` and `sim drum` from an empty folder.

use tests::{files, good, json, run_in};

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn a_changed_scene_is_a_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let change = "effects.music.beat_hz=2.3";
    let printed = good(run_in(folder, "sim", &["scenes", "music", "--set", change]));
    std::fs::write(folder.join("faster.toml"), &printed.stdout).expect("written");
    let from_file = [
        "record",
        "faster.toml",
        "--duration",
        "2",
        "--out",
        "a.mcap",
    ];
    let from_flag = [
        "record",
        "music",
        "--duration",
        "2",
        "--set",
        change,
        "--out",
        "b.mcap",
    ];
    good(run_in(folder, "sim", &from_file));
    good(run_in(folder, "sim", &from_flag));
    let bytes = |name: &str| std::fs::read(folder.join(name)).expect("a recording");
    assert!(
        bytes("a.mcap") == bytes("b.mcap"),
        "two ways to the same scene"
    );

    let schema = json(&good(run_in(folder, "sim", &["scenes", "--schema"])));
    assert!(schema["$defs"]["Music"]["properties"]["beat_hz"]["description"].is_string());
}

#[test]
fn explain_keeps_its_contract() {
    let folder = tempfile::tempdir().expect("a folder");
    for scene in ["music", "field-imu", "eight-carriers", "tumble"] {
        let short = "duration_s=1.0";
        let args = ["explain", scene, "--set", short, "--format", "json"];
        let found = json(&good(run_in(folder.path(), "sim", &args)));
        assert_eq!(found["scene"], scene);
        let names = found["state"]["names"].as_array().expect("names");
        assert_eq!(found["state"]["size"], names.len());
        assert!(found["rhs_ns"].as_f64().is_some_and(|ns| ns > 0.0));
        assert!(
            found["ms_per_simulated_s"]
                .as_f64()
                .is_some_and(|ms| ms > 0.0)
        );
        let effects = found["effects"].as_array().expect("effects");
        assert!(effects.len() >= 16);
        for effect in effects {
            let on = effect["on"].as_bool().expect("on or off");
            // Every effect can be priced: one that another needs is priced without that other.
            assert_eq!(effect["cost_ns"].is_number(), on, "{scene}: {effect}");
            assert!(effect["adds_state"].is_u64() && effect["name"].is_string());
        }
        let frozen = found["freedoms"].as_array().expect("freedoms");
        assert_eq!(frozen.len(), 6);
    }
}

#[test]
fn explain_gives_up_a_motion_that_costs_too_much_and_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let explain = |scene: &str, set: &str, format: &str| {
        let args = ["explain", scene, "--set", set, "--format", format];
        good(run_in(folder.path(), "sim", &args))
    };
    // Poles of a hundred kilometres: after half a tenth of a second every simulated second takes minutes.
    let (scene, long) = ("eight-carriers", "carriers.along_poles.length_m=1e5");
    let found = json(&explain(scene, long, "json"));
    assert!(found["ms_per_simulated_s"].is_number());
    assert!(found["trial_s"].as_f64().is_some_and(|s| s < 1.0));
    let why = found["reason"].as_str().expect("why no longer trial");
    assert!(why.contains("evaluations were not enough"), "{why}");
    // Paces that change by 10¹⁰ rad/s every hundredth of a second.
    let (scene, loud) = ("baseline", "effects.noise.phase_rad_per_sqrt_s=1e9");
    let found = json(&explain(scene, loud, "json"));
    assert!(found["ms_per_simulated_s"].is_null() && found["rhs_ns"].is_number());
    assert!(found["reason"].is_string() && found["freedoms"] == serde_json::json!([]));
    let said = text(&explain(scene, loud, "table").stdout);
    assert!(said.contains("no motion was tried"), "{said}");
    assert!(
        !said.contains("NaN") && !said.contains("freedom "),
        "{said}"
    );
}

#[test]
fn a_scene_without_music_has_no_drum() {
    let folder = tempfile::tempdir().expect("a folder");
    let refused = run_in(folder.path(), "sim", &["drum", "baseline"]);
    assert_eq!(refused.status.code(), Some(1));
    assert_eq!(
        text(&refused.stderr).trim_end(),
        "sim: the scene `baseline` has no effects.music, so there is no drum to hear"
    );
    assert!(files(folder.path()).is_empty());
}

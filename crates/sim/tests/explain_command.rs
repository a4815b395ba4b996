//! `sim explain` judges no motion that it has not seen.

use std::process::Command;

fn explain(args: &[&str]) -> String {
    let out = Command::new(env!("CARGO_BIN_EXE_sim"))
        .arg("explain")
        .args(args)
        .output()
        .unwrap();
    assert!(out.status.success(), "{out:?}");
    String::from_utf8(out.stdout).unwrap()
}

/// Ten thousand carriers under springs that a chain of neighbours drives: milliseconds of it take a tenth of a second.
#[test]
fn what_is_too_dear_to_try_is_not_judged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("chain.toml");
    let scene = "name = \"chain\"\n[body]\nmass_kg = 600.0\ninertia_kg_m2 = { xx = 50.0, yy = 300.0, zz = 310.0 }\n\
        [carriers.along_poles]\ncount = 10000\nlength_m = 50.0\n[effects.contact]\nstiffness_n_per_m = 30.0\ndamping_n_s_per_m = 3.0\n\
        [effects.gait]\namplitude_m = 0.001\n[effects.coupling]\ngraph = \"chain\"\n[effects.noise]\n";
    std::fs::write(&path, scene).unwrap();
    let said = explain(&[path.to_str().unwrap()]);
    assert!(said.contains("too dear to try"), "{said}");
    assert!(!said.contains("could be held"), "{said}");
}

/// Who can move in one way only is not asked what happens without it.
#[test]
fn the_only_freedom_is_not_held() {
    let said = explain(&["music", "--set", "freedom=[\"height\"]"]);
    assert!(
        !said.contains("list is empty") && !said.contains("could be held"),
        "{said}"
    );
    let said = explain(&["music", "--set", "freedom=[\"height\", \"roll\"]"]);
    assert!(said.contains("held instead"), "{said}");
}

/// Who turns by three quarters goes on turning behind half a turn: 270 deg in 1 s, then 1 s there, deviate by more than half a turn would let them.
#[test]
fn a_turn_beyond_half_a_turn_is_one() {
    let turn = "effects.path={turn_deg=270.0,turn_start_s=0.0,turn_time_s=1.0}";
    let said = explain(&[
        "music",
        "--set",
        "duration_s=2.0",
        "--set",
        "effects.hold={stiffness_n_per_m=3000.0,damping_n_s_per_m=300.0}",
        "--set",
        turn,
        "--format",
        "json",
    ]);
    let said: serde_json::Value = serde_json::from_str(&said).unwrap();
    let freedoms = said["freedoms"].as_array().unwrap();
    let yaw = freedoms.iter().find(|f| f["name"] == "yaw").unwrap();
    let deviation = yaw["standard_deviation"].as_f64().unwrap();
    // At most half of 270 deg; a smooth turn and as long a rest make some 100. Folded at half a turn they would make 78.
    assert!((1.6..2.36).contains(&deviation), "{deviation}");
}

/// However seldom a scene is logged, its motion is seen.
#[test]
fn a_motion_between_the_samples_of_the_log_is_seen() {
    let seldom = ["--set", "duration_s=2.0", "--set", "log_rate_hz=0.01"];
    let said = explain(&[&["music"], &seldom[..]].concat());
    assert!(said.contains("held instead"), "{said}");
    let held = said.lines().last().unwrap();
    assert!(!held.contains("height"), "{said}");
}

/// A start that moves along what a trial holds is held with it.
#[test]
fn a_start_that_moves_can_be_held() {
    let said = explain(&["tumble", "--set", "duration_s=2.0"]);
    assert!(
        said.contains("held instead") && !said.contains("free the others"),
        "{said}"
    );
}

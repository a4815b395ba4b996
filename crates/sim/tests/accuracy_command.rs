//! `sim accuracy` as a person runs it.

use serde_json::Value;
use sim::solve::{METHODS, Stopped};
use std::process::{Command, Output};

fn sim(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sim"))
        .arg("accuracy")
        .args(args)
        .output()
        .unwrap()
}

#[test]
fn a_study_of_a_second_says_what_the_contract_promises() {
    let folder = std::env::temp_dir().join(format!("sim-accuracy-{}", std::process::id()));
    let out = sim(&[
        "music",
        "--set",
        "duration_s=2.0",
        "--set",
        "analysis_start_s=0.0",
        "--format",
        "json",
        "--repeats",
        "1",
        "--out",
        folder.to_str().unwrap(),
    ]);
    assert!(
        out.status.success(),
        "{}",
        String::from_utf8_lossy(&out.stderr)
    );
    let said: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(said["scene"], "music");
    let known = said["reference"]["estimated_error"].as_f64().unwrap();
    assert!(known < 1e-9, "{known:e}");
    let runs = said["runs"].as_array().unwrap();
    for method in METHODS {
        let of: Vec<&Value> = runs.iter().filter(|r| r["method"] == method.name).collect();
        // What judges is not judged.
        if said["reference"]["method"] == method.name {
            assert!(of.is_empty());
            continue;
        }
        assert!(of.len() >= 5, "{} is missing", method.name);
        // The last rung is the finest: it is right to what its order promises.
        let error = of.last().unwrap()["error_roll_rad"].as_f64().unwrap();
        let most = if method.order == 1 { 1e-2 } else { 1e-6 };
        assert!(error < most, "{}: {error:e}", method.name);
        for key in [
            "wall_s",
            "evaluations",
            "steps",
            "events",
            "error_z_m",
            "failed",
        ] {
            assert!(of[0].get(key).is_some(), "{key}");
        }
    }
    let front = said["front"].as_array().unwrap();
    let times: Vec<f64> = front.iter().map(|r| r["cpu_s"].as_f64().unwrap()).collect();
    assert!(times.is_sorted() && !times.is_empty());
    let error = said["recommend"]["1e-3"]["error_roll_rad"]
        .as_f64()
        .unwrap();
    assert!(error <= 1e-3);
    let csv = std::fs::read_to_string(folder.join("runs.csv")).unwrap();
    assert_eq!(csv.lines().count(), runs.len() + 1);
    let svg = std::fs::read_to_string(folder.join("work-precision.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.contains("semi-implicit-euler") && !svg.contains("NaN"));
    assert!(
        svg.contains(
            "><title>music, duration_s=2.0, analysis_start_s=0.0: what accuracy costs</title>"
        ),
        "{svg:.200}"
    );
    assert!(folder.join("table.txt").exists() && folder.join("accuracy.json").exists());
    std::fs::remove_dir_all(folder).unwrap();
}

/// Method and tolerance of a reference are not for who runs the study to choose.
#[test]
fn a_missing_reference_is_no_reason_to_loosen_what_cannot_be_set() {
    let why = Stopped::StepTooSmall {
        method: "dop853",
        t_s: 1.5,
        step_s: 1e-15,
        tolerance: 1e-12,
    };
    assert!(why.to_string().contains("solver.tolerance"));
    assert_eq!(
        why.what(),
        "dop853 gave up at t = 1.5 s: the step fell to 1.0e-15 s without reaching the tolerance 1e-12"
    );
}

#[test]
fn a_scene_that_is_none_ends_in_one_sentence() {
    let out = sim(&["musik"]);
    assert_eq!(out.status.code(), Some(1));
    let said = String::from_utf8(out.stderr).unwrap();
    assert!(
        said.lines().count() == 1 && said.contains("music"),
        "{said}"
    );
}

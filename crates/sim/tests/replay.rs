//! A recording drives a scene: twins come back as they were, a wrong model does not, and what cannot be replayed ends in one sentence.

use recording::read::{ReadOptions, Recording};
use recording::schema::rath;
use recording::topics::{MessageKind, PHASES};
use recording::write::{RecordingWriter, WriterOptions};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn sim(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sim"))
        .args(args)
        .output()
        .unwrap()
}

fn record(folder: &Path, name: &str, more: &[&str]) -> PathBuf {
    let out = folder.join(format!("{name}.mcap"));
    let mut args = vec!["record", name, "--out", out.to_str().unwrap()];
    args.extend(more);
    let done = sim(&args);
    assert!(done.status.success(), "{done:?}");
    out
}

/// The misfit of a replay, and its recording.
fn replay(file: &Path, more: &[&str]) -> (Value, PathBuf) {
    let out = file.with_extension("replay.mcap");
    let mut args = vec!["replay", file.to_str().unwrap(), "--format", "json"];
    args.extend(["--out", out.to_str().unwrap()]);
    args.extend(more);
    let done = sim(&args);
    assert!(done.status.success(), "{done:?}");
    (serde_json::from_slice(&done.stdout).unwrap(), out)
}

fn share(found: &Value, signal: &str) -> f64 {
    found["misfit"][signal]["share"].as_f64().unwrap()
}

const SIGNALS: [&str; 5] = ["height_m", "roll_deg", "pitch_deg", "yaw_deg", "force_n"];

/// Phases, shoulders and beat of the music scene bring its motion back, contact lost and regained and all; with another stiffness they
/// do not. What is left is the noise's path between its 30 Hz samples.
#[test]
fn a_twin_comes_back_and_a_wrong_stiffness_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let file = record(folder.path(), "music", &["--duration", "30"]);
    for drive in ["phases", "shoulders", "beat"] {
        let (found, out) = replay(&file, &["--drive", drive]);
        assert_eq!(found["starts_as_measured"], true);
        for signal in SIGNALS {
            // The roll grows by itself from next to nothing, and what it grows from is the noise's path too.
            let most = if signal == "roll_deg" { 0.05 } else { 0.01 };
            assert!(share(&found, signal) < most, "{drive} {signal}: {found}");
        }
        // Both motions, on the same stamps.
        let recording = Recording::open(&out, &ReadOptions::default()).unwrap();
        let count = |topic: &str| {
            let all = &recording.info().channels;
            all.iter().find(|c| c.topic == topic).unwrap().messages
        };
        assert_eq!(count("/rath/state"), 901);
        assert_eq!(count("/measured/rath/state"), 901);
        assert_eq!(count("/measured/carriers/phases"), 901);
        assert_eq!(count("/measured/beat"), count("/beat"));
        assert!(recording.info().metadata["replay"].contains_key("misfit.roll_deg"));
        // The attached scene is complete: it makes the same motion again.
        let scene = folder.path().join("again.toml");
        std::fs::write(&scene, recording.attachment("scene.toml").unwrap()).unwrap();
        let again = folder.path().join("again.mcap");
        let (scene, again) = (scene.to_str().unwrap(), again.to_str().unwrap());
        assert!(sim(&["record", scene, "--out", again]).status.success());
        let states = |path: &Path| {
            let recording = Recording::open(path, &ReadOptions::default()).unwrap();
            let wanted = |p: &str| p == "/rath/state.roll_rad";
            recording.signals(&wanted).unwrap().0.remove(0).values
        };
        assert_eq!(states(&out), states(Path::new(again)));
    }
    let (wrong, _) = replay(&file, &["--set", "effects.contact.stiffness_n_per_m=4000"]);
    assert!(share(&wrong, "height_m") > 0.05, "{wrong}");
    assert!(share(&wrong, "force_n") > 0.05, "{wrong}");
    assert!(wrong["misfit"]["height_m"]["offset"].as_f64().unwrap() > 0.02);
}

/// A stretch from the middle, with the body as it was there.
#[test]
fn a_stretch_begins_as_it_was_measured() {
    let folder = tempfile::tempdir().unwrap();
    let file = record(folder.path(), "baseline", &["--duration", "30"]);
    let stretch = ["--from", "10", "--to", "20"];
    let (found, _) = replay(&file, &stretch);
    // It is its own scene that is driven.
    assert_eq!(found["scene"], "baseline");
    assert_eq!(found["misfit"]["height_m"]["samples"], 301);
    assert_eq!(found["starts_as_measured"], true);
    for signal in SIGNALS {
        assert!(share(&found, signal) < 0.01, "{signal}: {found}");
    }
    // In another scene nothing tells phases where the body is sideways; shoulders do.
    let (other, _) = replay(&file, &[&stretch[..], &["--scene", "baseline"]].concat());
    assert_eq!(other["starts_as_measured"], false);
    assert_eq!(other["window_s"], serde_json::json!([3.0, 10.0]));
    let (found, _) = replay(&file, &[&stretch[..], &["--drive", "shoulders"]].concat());
    for signal in SIGNALS {
        assert!(share(&found, signal) < 0.01, "{signal}: {found}");
    }
}

/// A sensor whose clock is behind has the first message; the party walks from the scene's start on all the same.
#[test]
fn a_clock_that_is_behind_moves_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let sets = [
        "epoch_s=1000",
        "carriers.walk_m_per_s=[1.2, 0.1, 0.05]",
        "effects.imu={ideal=true, rate_hz=50, sensors=[{on=\"rath\", clock_offset_s=-2.0}]}",
    ];
    let mut more = vec!["--duration", "8"];
    sets.iter().for_each(|set| more.extend(["--set", set]));
    let file = record(folder.path(), "music", &more);
    for drive in [
        &["--drive", "phases"][..],
        &["--drive", "shoulders"],
        &["--drive", "beat"],
        &["--drive", "shoulders", "--from", "6"],
    ] {
        let (found, _) = replay(&file, drive);
        assert_eq!(found["starts_as_measured"], true, "{drive:?}");
        for signal in SIGNALS {
            assert!(share(&found, signal) < 0.02, "{drive:?} {signal}: {found}");
        }
    }
}

/// A party that turns by more than half a turn: the yaw goes on where its numbers jump.
#[test]
fn a_yaw_goes_on_through_half_a_turn() {
    let folder = tempfile::tempdir().unwrap();
    let turn = [
        "--duration",
        "25",
        "--set",
        "effects.path={turn_deg=270.0, turn_start_s=5.0, turn_time_s=12.0}",
    ];
    let file = record(folder.path(), "music", &turn);
    let recording = Recording::open(&file, &ReadOptions::default()).unwrap();
    let wanted = |p: &str| p == "/rath/state.yaw_rad";
    let yaw = recording.signals(&wanted).unwrap().0.remove(0).values;
    let jump = yaw.windows(2).position(|w| w[1] < w[0] - 3.0).unwrap();
    // A party that turns within 11 s is ahead by 270° (s(t/11) − s(t/12)) at most, s the path's smooth step.
    let (other, _) = replay(&file, &["--set", "effects.path.turn_time_s=11"]);
    let misfit = &other["misfit"]["yaw_deg"];
    let rms = misfit["rms"].as_f64().unwrap();
    assert!((2.0..20.0).contains(&rms), "{misfit}");
    assert!(misfit["correlation"].as_f64().unwrap() > 0.98, "{misfit}");
    // Between the two samples that jump.
    let from = ((jump as f64 + 0.5) / 30.0).to_string();
    let (found, _) = replay(&file, &["--drive", "shoulders", "--from", &from]);
    assert_eq!(found["starts_as_measured"], true);
    assert!(share(&found, "yaw_deg") < 0.01, "{found}");
}

/// Poles are bent at rest where the recording began; how they were bent later is in no recording.
#[test]
fn bent_poles_start_as_they_were_or_settle() {
    let folder = tempfile::tempdir().unwrap();
    let file = record(folder.path(), "long-pole", &["--duration", "10"]);
    let (found, _) = replay(&file, &[]);
    assert_eq!(found["starts_as_measured"], true);
    for signal in ["height_m", "pitch_deg", "force_n"] {
        assert!(share(&found, signal) < 0.01, "{signal}: {found}");
    }
    let softer = "effects.contact.stiffness_n_per_m=4000";
    for more in [&["--from", "5"][..], &["--set", softer]] {
        let (found, _) = replay(&file, more);
        assert_eq!(found["starts_as_measured"], false, "{more:?}");
    }
}

/// A recording of phases alone.
fn phases(path: &Path, carriers: usize, phase: impl Fn(usize, f64) -> Option<f64>) {
    let mut writer = RecordingWriter::create(path, &WriterOptions::default()).unwrap();
    let channel = writer.channel(PHASES, MessageKind::Phases).unwrap();
    for k in 0..600 {
        let t = f64::from(k) / 30.0;
        let phase_rad: Vec<f64> = (0..carriers).filter_map(|i| phase(i, t)).collect();
        if phase_rad.is_empty() {
            continue;
        }
        let message = rath::Phases {
            time_s: t,
            phase_rad,
            ..rath::Phases::default()
        };
        writer.message(channel, (t * 1e9) as i64, &message).unwrap();
    }
    writer.finish().unwrap();
}

/// A setting that the recording overrules is named; one that does something is not.
#[test]
fn a_setting_without_consequence_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = record(folder.path(), "music", &["--duration", "3"]);
    let sets = [
        "duration_s=20",
        "start.height_m=3",
        "effects.noise.grid_hz=10",
        "body.mass_kg=61",
        "effects.gait.sway_m=0.028",
    ];
    let out = file.with_extension("replay.mcap");
    let mut args = vec![
        "replay",
        file.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ];
    sets.iter().for_each(|set| args.extend(["--set", set]));
    let done = sim(&args);
    let text = String::from_utf8(done.stderr).unwrap();
    assert!(done.status.success(), "{text}");
    let named: Vec<&str> = sets
        .into_iter()
        .filter(|set| text.contains(&format!("--set {set} changes nothing")))
        .collect();
    assert_eq!(named, &sets[..3], "{text}");
}

#[test]
fn what_cannot_be_replayed_ends_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let still = record(folder.path(), "stand-still", &["--duration", "3"]);
    let eight = record(folder.path(), "eight-carriers", &["--duration", "3"]);
    let beatless = record(folder.path(), "baseline", &["--duration", "3"]);
    let driven = record(folder.path(), "music", &["--duration", "3"]);
    let (_, driven) = replay(&driven, &[]);
    phases(&at("gap.mcap"), 2, |_, t| {
        (!(7.0..9.0).contains(&t)).then_some(12.0 * t)
    });
    phases(&at("nan.mcap"), 2, |i, t| {
        Some(if i == 1 { f64::NAN } else { t })
    });
    phases(&at("one.mcap"), 1, |_, t| Some(12.0 * t));
    phases(&at("short.mcap"), 2, |_, t| (t < 0.05).then_some(t));
    std::fs::write(at("empty.mcap"), b"").unwrap();
    std::fs::write(at("text.mcap"), b"not a recording at all").unwrap();
    let out = at("out.mcap");
    let (gap, eight, beatless) = (at("gap.mcap"), eight.as_path(), beatless.as_path());
    for (file, more, says) in [
        (still.as_path(), &[][..], "there are no phases in it"),
        (
            eight,
            &["--scene", "music"],
            "holds 8 carriers, but the scene `music` has 2",
        ),
        (
            eight,
            &["--scene", "music", "--drive", "beat"],
            "holds 8 carriers, but the scene `music` has 2",
        ),
        (
            &driven,
            &["--drive", "beat"],
            "effects.measured moves the carriers",
        ),
        (&at("one.mcap"), &[], "holds 1 carriers"),
        (&gap, &[], "has a gap from 6.9"),
        (&gap, &["--to", "30"], "change --from or --to"),
        (&gap, &["--from", "3", "--to", "2"], "change --from or --to"),
        (
            &gap,
            &["--from", "1", "--to", "3", "--settle", "2"],
            "--settle leaves 2 s out",
        ),
        (
            &gap,
            &["--drive", "shoulders"],
            "there are no shoulders in it",
        ),
        (&gap, &["--drive", "beat"], "holds 0 beats"),
        (beatless, &["--drive", "beat"], "has no effects.music"),
        (
            beatless,
            &["--scene", "stand-still"],
            "`stand-still` has no effects.gait, so no phase can move its shoulders; replay those (`--drive shoulders`)",
        ),
        (&at("nan.mcap"), &[], "0 usable samples"),
        (&at("short.mcap"), &[], "usable samples"),
        (&at("empty.mcap"), &[], "is empty"),
        (&at("text.mcap"), &[], "is not an MCAP"),
        (&at("none.mcap"), &[], "cannot be read"),
        (&gap, &["--scene", "musik"], "Did you mean `music`"),
    ] {
        let mut args = vec!["replay", file.to_str().unwrap()];
        args.extend(["--out", out.to_str().unwrap()]);
        args.extend(more);
        let done = sim(&args);
        let text = String::from_utf8(done.stderr).unwrap();
        assert_eq!(done.status.code(), Some(1), "{file:?} {more:?}: {text}");
        assert!(
            text.contains(says) && text.lines().count() == 1,
            "{says}: {text}"
        );
        assert!(!out.exists() && done.stdout.is_empty());
    }
    let gap_path = gap.to_str().unwrap();
    for more in [
        ["--from", "nan"],
        ["--out", "-"],
        ["--out", "x.toml"],
        ["--out", gap_path],
    ] {
        let done = sim(&[&["replay", gap_path, "--to", "5"], &more[..]].concat());
        assert_eq!(done.status.code(), Some(2), "{more:?}: {done:?}");
    }
    // What is beside the gap is good, wrapped phases are phases, and without the body's motion there is nothing to compare.
    phases(&at("wrapped.mcap"), 2, |_, t| {
        (!(7.0..9.0).contains(&t)).then_some((12.0 * t).rem_euclid(std::f64::consts::TAU))
    });
    let turns = |file: &Path| {
        let (found, out) = replay(file, &["--from", "9.5"]);
        assert_eq!(found["misfit"], serde_json::json!({}));
        let recording = Recording::open(&out, &ReadOptions::default()).unwrap();
        let wanted = |p: &str| p == "/carriers/phases.phase_rad[1]";
        let phase = recording.signals(&wanted).unwrap().0.remove(0).values;
        (phase[phase.len() - 1] - phase[0]) / 12.0
    };
    for file in [gap, at("wrapped.mcap")] {
        let span = turns(&file);
        assert!((span - 599.0 / 30.0 + 9.5).abs() < 0.034, "{span}");
    }
}

/// What was begun goes when the user interrupts.
#[cfg(unix)]
#[test]
fn an_interrupted_replay_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = record(folder.path(), "baseline", &["--duration", "3"]);
    let files = || std::fs::read_dir(folder.path()).unwrap().count();
    let before = files();
    // Far more steps than anybody waits for.
    let mut child = Command::new(env!("CARGO_BIN_EXE_sim"))
        .args(["replay", file.to_str().unwrap(), "--out", "out.mcap"])
        .args(["--set", "solver.method=rk4", "--set", "solver.step_s=1e-9"])
        .current_dir(folder.path())
        .spawn()
        .unwrap();
    while files() == before {
        assert_eq!(child.try_wait().unwrap(), None);
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let mut interrupt = Command::new("kill");
    interrupt.args(["-INT", &child.id().to_string()]);
    assert!(interrupt.status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(files(), before);
}

//! What others read: the decoders that the formats' makers publish open every topic of every built-in scene, and find the numbers
//! that `analyze` finds with a reader of its own.

use serde_json::Value;
use std::path::Path;
use std::process::Command;
use tests::{good, json, python_with, run_in};

/// Seconds of each scene: the drum of the paper's begins at 5.
const DURATION_S: &str = "6";

fn decoded(python: &Path, folder: &Path, file: &str) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/decode.py");
    let mut command = Command::new(python);
    let output = command.arg(script).arg(file).current_dir(folder).output();
    json(&good(output.expect("Python starts")))
}

/// Names of the built-in scenes, as `sim scenes` lists them.
fn built_in(folder: &Path) -> Vec<String> {
    let listed = good(run_in(folder, "sim", &["scenes"])).stdout;
    String::from_utf8(listed)
        .expect("text")
        .lines()
        .filter_map(|l| l.split_whitespace().next().map(str::to_owned))
        .collect()
}

/// Angles that `analyze` makes of quaternions are no fields of a message.
fn is_made(path: &str) -> bool {
    ["orientation", "rotation"].iter().any(|q| {
        ["roll", "pitch", "yaw"]
            .iter()
            .any(|angle| path.ends_with(&format!("{q}.{angle}")))
    })
}

fn same_numbers(scene: &str, theirs: &Value, ours: &Value) {
    let signals = ours["signals"].as_object().expect("signals");
    let fields = theirs["fields"].as_object().expect("fields");
    for path in signals.keys().filter(|p| !is_made(p)) {
        assert!(fields.contains_key(path), "{scene}: only we see {path}");
    }
    for (path, theirs) in fields {
        let ours = signals
            .get(path)
            .unwrap_or_else(|| panic!("{scene}: only they see {path}"));
        let number = |of: &Value, name: &str| of[name].as_f64().expect("a number");
        for name in ["count", "min", "max"] {
            assert_eq!(
                number(theirs, name),
                number(ours, name),
                "{scene}: {name} of {path}"
            );
        }
        // Two ways to sum: a few roundings of the largest term.
        let largest = number(theirs, "min").abs().max(number(theirs, "max").abs());
        let apart = (number(theirs, "mean") - number(ours, "mean")).abs();
        assert!(
            apart <= 1e-13 * largest,
            "{scene}: mean of {path}: {apart:e}"
        );
    }
}

#[test]
fn official_decoders_read_every_topic_of_every_built_in_scene() {
    let Some(python) = python_with(&["mcap", "mcap_ros2", "mcap_protobuf"]) else {
        eprintln!("skipped: no Python with mcap, mcap-ros2-support and mcap-protobuf-support");
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let scenes = built_in(folder);
    assert!(scenes.len() >= 11, "{scenes:?}");
    for scene in &scenes {
        let file = format!("{scene}.mcap");
        let record = ["record", scene, "--duration", DURATION_S, "--out", &file];
        good(run_in(folder, "sim", &record));
        let theirs = decoded(&python, folder, &file);
        let analyze = [&file, "--format", "json", "--signal", "*"];
        let ours = json(&good(run_in(folder, "analyze", &analyze)));

        let topics = ours["recording"]["topics"].as_array().expect("topics");
        assert_eq!(
            topics.len(),
            theirs["topics"].as_object().map_or(0, |t| t.len())
        );
        for topic in topics {
            let name = topic["name"].as_str().expect("a name");
            assert_eq!(theirs["topics"][name], topic["messages"], "{scene}: {name}");
        }
        same_numbers(scene, &theirs, &ours);

        let description = theirs["texts"][0].as_str().expect("a URDF");
        assert!(description.contains("<robot") && description.contains("carrier_1"));
        assert_eq!(theirs["metadata"]["rath"]["scene"], **scene);
        assert!(
            theirs["attachments"]["scene.toml"]
                .as_str()
                .is_some_and(|toml| toml.contains(scene.as_str()))
        );
        if scene == "field-imu" {
            sensors_are_there(&theirs);
            sound_is_the_wav(folder, &theirs);
        }
    }
}

/// Acceleration without an orientation: covariance[0] = −1; a rath that is carried weighs on its sensor with g on the average.
fn sensors_are_there(theirs: &Value) {
    for sensor in ["rath", "carrier_1", "carrier_2"] {
        let field = |name: &str, what: &str| {
            theirs["fields"][format!("/imu/{sensor}.{name}")][what]
                .as_f64()
                .expect("a number")
        };
        assert_eq!(field("orientation_covariance[0]", "max"), -1.0);
        assert!(field("linear_acceleration_covariance[4]", "min") > 0.0);
        let up = field("linear_acceleration.z", "mean");
        assert!((up / 9.81 - 1.0).abs() < 0.1, "{sensor}: {up}");
    }
}

/// `/audio/drum` is the file that `sim drum` writes, sample by sample.
fn sound_is_the_wav(folder: &Path, theirs: &Value) {
    let duration = format!("duration_s={DURATION_S}.0");
    let drum = ["drum", "field-imu", "--set", &duration, "--out", "drum.wav"];
    good(run_in(folder, "sim", &drum));
    let wav = std::fs::read(folder.join("drum.wav")).expect("a WAV file");
    let sound: String = wav[44..].iter().map(|b| format!("{b:02x}")).collect();
    assert_eq!(wav.len(), 44 + 2 * (6 * 16_000 + 1));
    assert!(theirs["sound"] == sound, "/audio/drum is not drum.wav");
}

//! The command as a person types it: output, exit codes, files.

mod archive_names;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use recording::cdr::Float64;
use recording::read::{RawAttachment, RawMessage, ReadOptions, Recording};
use recording::schema::rath;
use recording::topics::{self, MessageKind};
use recording::write::{RecordingWriter, WriterOptions};
use serde_json::Value;

fn analyze(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_analyze"))
        .args(args)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[track_caller]
fn json(args: &[&str]) -> Value {
    let out = analyze(args);
    assert!(out.status.success(), "{args:?}: {}", text(&out.stderr));
    serde_json::from_slice(&out.stdout).unwrap()
}

/// A minute of a rath that swings at half its drive's frequency: what the phases, forces and angles do is known.
fn recording(folder: &Path) -> PathBuf {
    carried_by(2, folder)
}

fn carried_by(carriers: usize, folder: &Path) -> PathBuf {
    let path = folder.join("swing.mcap");
    let mut w = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
    let metadata = [
        ("source", "test"),
        ("mass_kg", "60"),
        ("gravity_m_per_s2", "9.81"),
        ("analysis_start_s", "15"),
        ("scene", "swing"),
    ];
    w.metadata(
        "rath",
        &metadata.map(|(k, v)| (k.to_owned(), v.to_owned())).into(),
    )
    .unwrap();
    w.attachment("scene.toml", "application/toml", b"# a scene")
        .unwrap();
    let state = w.channel(topics::STATE, MessageKind::RathState).unwrap();
    let forces = w
        .channel(topics::FORCES, MessageKind::HandleForces)
        .unwrap();
    let phases = w.channel(topics::PHASES, MessageKind::Phases).unwrap();
    let extra = w.channel("/battery", MessageKind::Float64).unwrap();
    for k in 0..1801i64 {
        let t_ns = k * 1_000_000_000 / 30;
        let t = t_ns as f64 / 1e9;
        let beat = std::f64::consts::TAU * 2.0 * t;
        let roll_rad = 0.3 * (beat / 2.0).sin();
        let message = rath::State {
            time_s: t,
            position_m: Some(rath::Vector3 {
                x: 0.8 * t,
                y: 0.0,
                z: 0.8 + 0.05 * beat.sin(),
            }),
            orientation: Some(rath::Quaternion {
                x: (roll_rad / 2.0).sin(),
                y: 0.0,
                z: 0.0,
                w: (roll_rad / 2.0).cos(),
            }),
            roll_rad,
            ..Default::default()
        };
        w.message(state, t_ns, &message).unwrap();
        let n = (294.3 * (1.0 + 1.5 * beat.cos())).max(0.0);
        w.message(
            forces,
            t_ns,
            &rath::HandleForces {
                time_s: t,
                normal_n: vec![n; carriers],
                ..Default::default()
            },
        )
        .unwrap();
        let message = rath::Phases {
            time_s: t,
            phase_rad: (0..carriers).map(|c| beat + 0.2 * c as f64).collect(),
            beat_phase_rad: (t >= 5.0).then_some(beat),
            ..Default::default()
        };
        w.message(phases, t_ns, &message).unwrap();
        if k % 30 == 0 {
            w.message(
                extra,
                t_ns,
                &Float64 {
                    data: 12.6 - t / 100.0,
                },
            )
            .unwrap();
        }
    }
    w.finish().unwrap();
    path
}

#[test]
fn json_is_the_contracts() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(folder.path());
    let v = json(&[file.to_str().unwrap(), "--format", "json"]);
    assert_eq!(v["samples"], 1801);
    assert_eq!(v["window_s"], serde_json::json!([15.0, 60.0]));
    assert_eq!(v["duration_s"], 60.0);
    for key in [
        "profile",
        "library",
        "messages",
        "topics",
        "salvaged",
        "skipped_messages",
        "warnings",
    ] {
        assert!(!v["recording"][key].is_null(), "{key}");
    }
    let m = &v["metrics"];
    let near = |name: &str, expected: f64, bound: f64| {
        let x = m[name]["value"]
            .as_f64()
            .unwrap_or_else(|| panic!("{name}: {}", m[name]));
        assert!(
            (x - expected).abs() < bound,
            "{name}: {x}, expected {expected}"
        );
    };
    // 45 whole periods, 1350 samples, and one more at the zero that closes them.
    near(
        "rms_roll_deg",
        (0.3 / 2f64.sqrt() * (1350.0f64 / 1351.0).sqrt()).to_degrees(),
        1e-6,
    );
    near("dz_pp_m", 0.1, 1e-3);
    near("synchrony", 0.1f64.cos(), 1e-12);
    near("synchrony_chance", 2.0 / std::f64::consts::PI, 1e-12);
    near("plv", 1.0, 1e-12);
    near("beat_hz", 2.0, 1e-9);
    // 1 + 1.5 cos < 0 where cos < −2/3.
    near(
        "contact_loss",
        (2.0f64 / 3.0).acos() / std::f64::consts::PI,
        0.04,
    );
    near("peak_hz", 2.0, 0.03);
    near("roll_peak_hz", 1.0, 0.03);
    near("force_correlation", 1.0, 1e-12);
    assert_eq!(m["unstable"]["value"], true);
    // The first full stretch inside the window.
    near("onset_time_s", 15.0 + 59.0 / 30.0, 1e-6);
    for (name, value) in m.as_object().unwrap() {
        assert!(
            value.get("value").is_some()
                && value["unit"].is_string()
                && value["source"].is_string(),
            "{name}"
        );
        assert!(
            !value["value"].is_null() || value["reason"].is_string(),
            "{name}"
        );
    }
    let signal = &v["signals"]["/battery.data"];
    assert_eq!(signal["count"], 61);
    assert!(
        (signal["hz"].as_f64().unwrap() - 1.0).abs() < 1e-9
            && signal["min"] == 12.0
            && signal["max"] == 12.6
    );
    assert!(
        v["signals"]["/rath/state.orientation.roll"]["max"]
            .as_f64()
            .unwrap()
            > 0.29
    );
    let peaks = &v["spectra"]["/rath/state.roll_rad"]["peaks"];
    assert_eq!(peaks[0]["kind"], "f/2", "{peaks}");
    let kinds: Vec<&str> = v["events"]
        .as_array()
        .unwrap()
        .iter()
        .map(|e| e["kind"].as_str().unwrap())
        .collect();
    for kind in [
        "beat_start",
        "onset",
        "contact_lost",
        "contact_regained",
        "jump",
    ] {
        assert!(kinds.contains(&kind), "{kind}");
    }
    // Several files: an array.
    let two = json(&[
        file.to_str().unwrap(),
        file.to_str().unwrap(),
        "--format",
        "json",
    ]);
    assert_eq!(two.as_array().unwrap().len(), 2);
}

#[test]
fn window_signal_and_topic_narrow_what_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(folder.path());
    let file = file.to_str().unwrap();
    let v = json(&[
        file,
        "--format",
        "json",
        "--window",
        "..30",
        "--signal",
        "*.roll_rad",
        "--signal",
        "*.orientation.yaw",
    ]);
    assert_eq!(v["window_s"], serde_json::json!([15.0, 30.0]));
    // The window is the signals' too: 30 s at 30 Hz, both ends.
    let roll = &v["signals"]["/rath/state.roll_rad"];
    assert_eq!(roll["count"], 901);
    assert!(
        (roll["peak_hz"].as_f64().unwrap() - 1.0).abs() < 0.05,
        "{roll}"
    );
    let names: Vec<&String> = v["signals"].as_object().unwrap().keys().collect();
    assert_eq!(
        names,
        ["/rath/state.orientation.yaw", "/rath/state.roll_rad"]
    );
    let v = json(&[file, "--format", "json", "--topic", "/battery"]);
    assert_eq!(v["signals"].as_object().unwrap().len(), 1);
    // Of several names, that which fits nothing is said.
    let args = ["--topic", "/battery", "--topic", "/rath/stat"];
    let said = text(&analyze(&[&[file], &args[..]].concat()).stderr);
    assert!(
        said.ends_with("no topic fits /rath/stat; did you mean /rath/state?\n")
            && said.lines().count() == 1,
        "{said}"
    );
    let out = analyze(&[file, "--signal", "/nothing*"]);
    assert_eq!(out.status.code(), Some(1));
    assert!(
        text(&out.stderr).contains("no numeric signal fits /nothing*; its topics are "),
        "{}",
        text(&out.stderr)
    );
}

#[test]
fn tables_for_people_fit_a_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(folder.path());
    let out = analyze(&[file.to_str().unwrap()]);
    assert!(
        out.status.success() && out.stderr.is_empty(),
        "{}",
        text(&out.stderr)
    );
    let table = text(&out.stdout);
    for word in [
        "RMS roll",
        "mechanism",
        "Topics",
        "rath.State, protobuf",
        "Spectra",
        "Events",
        "Signals",
        "f/2",
    ] {
        assert!(table.contains(word), "{word} is missing in\n{table}");
    }
    let widest = table
        .lines()
        .skip(1)
        .map(|l| l.chars().count())
        .max()
        .unwrap();
    assert!(widest <= 110, "{widest}\n{table}");
    let csv = text(&analyze(&[file.to_str().unwrap(), "--format", "csv"]).stdout);
    assert_eq!(csv.lines().count(), 1 + analyze::metrics::METRICS.len());
    assert!(csv.starts_with("file,metric,value,unit,source,per,ci95,reason\n"));
}

/// Signals of two rates: each spectrum stands under its own resolution, each line has its count and jitter.
#[test]
fn spectra_are_told_with_their_own_resolution() {
    let folder = tempfile::tempdir().unwrap();
    let at = |hz: f64, n: u32| {
        let each = (0..n).map(|k| f64::from(k) / hz);
        each.map(|t| (t, format!("{{\"x\":{}}}", tone(1.0, t))))
            .collect()
    };
    let file = told(
        folder.path(),
        &[("/a", at(10.0, 600)), ("/b", at(50.0, 1500))],
    );
    let out = analyze(&[&file, "--signal", "*.x"]);
    let table = text(&out.stdout);
    let heads: Vec<&str> = table
        .lines()
        .filter(|l| l.starts_with("Spectra ("))
        .collect();
    assert!(heads.len() == 2 && heads[0] != heads[1], "{table}");
    let cells = |start: &str| -> Vec<String> {
        let line = table.lines().rfind(|l| l.trim_start().starts_with(start));
        line.unwrap()
            .split_whitespace()
            .map(str::to_owned)
            .collect()
    };
    let names = [
        "Signals", "count", "Hz", "jitter", "s", "min", "mean", "max", "SD", "peak", "Hz",
    ];
    assert_eq!(cells("Signals"), names);
    assert_eq!(cells("/b.x")[1..3], ["1,500", "50"]);
}

/// Leads of 170° and −170° are 20° apart.
#[test]
fn leads_are_averaged_around_the_circle() {
    let folder = tempfile::tempdir().unwrap();
    let roles = folder.path().join("roles.toml");
    std::fs::write(&roles, "phases = \"/p.phi[*]\"\nbeat_phase = \"/p.psi\"\n").unwrap();
    let led = |name: &str, lead_deg: f64| {
        let folder = folder.path().join(name);
        std::fs::create_dir(&folder).unwrap();
        let message = |k: u32| {
            let t = f64::from(k) / 30.0;
            let psi = std::f64::consts::TAU * 2.0 * t;
            let phi = psi + lead_deg.to_radians();
            (t, format!("{{\"phi\":[{phi},{phi}],\"psi\":{psi}}}"))
        };
        told(&folder, &[("/p", (0..900).map(message).collect())])
    };
    let files = [led("a", 170.0), led("b", -170.0)];
    let out = analyze(&[&files[0], &files[1], "--roles", roles.to_str().unwrap()]);
    let table = text(&out.stdout);
    let line = table
        .lines()
        .find(|l| l.ends_with("beat_lead_deg"))
        .unwrap();
    let cells: Vec<f64> = line
        .split_whitespace()
        .filter_map(|x| x.parse().ok())
        .collect();
    let [mean, sd, min, max, 2.0] = cells[..] else {
        panic!("{line}")
    };
    assert_eq!((mean.abs(), max - min), (180.0, 20.0), "{line}");
    // 10° each way: √(2 · 10²).
    assert!((sd - 14.142).abs() < 1e-9, "{line}");
}

#[test]
fn roles_name_what_is_what() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(folder.path());
    let roles = folder.path().join("roles.toml");
    std::fs::write(&roles, "height = \"/battery.data\"\nmass_kg = 30.0\n").unwrap();
    let v = json(&[
        file.to_str().unwrap(),
        "--format",
        "json",
        "--roles",
        roles.to_str().unwrap(),
        "--window",
        "0..",
    ]);
    assert_eq!(v["roles"]["height"], serde_json::json!(["/battery.data"]));
    assert!((v["metrics"]["dz_pp_m"]["value"].as_f64().unwrap() - 0.6).abs() < 1e-9);
    std::fs::write(&roles, "hight = \"/battery.data\"\n").unwrap();
    let out = analyze(&[file.to_str().unwrap(), "--roles", roles.to_str().unwrap()]);
    assert_eq!(out.status.code(), Some(1));
    assert!(text(&out.stderr).contains("hight"), "{}", text(&out.stderr));
}

#[test]
fn csv_and_parquet_hold_the_signals() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(folder.path());
    let csv = folder.path().join("x.csv");
    let out = analyze(&[
        file.to_str().unwrap(),
        "--signal",
        "*.orientation.roll",
        "--signal",
        "/battery*",
        "--out",
        csv.to_str().unwrap(),
    ]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let table = std::fs::read_to_string(&csv).unwrap();
    let mut lines = table.lines();
    assert_eq!(
        lines.next(),
        Some("time_ns,t_s,/battery.data,/rath/state.orientation.roll [rad]")
    );
    assert_eq!(lines.next(), Some("0,0,12.6,0"));
    // The battery speaks once a second.
    assert!(
        lines
            .next()
            .unwrap()
            .starts_with("33333333,0.033333333,,0.")
    );
    assert_eq!(table.lines().count(), 1802);
    let other = folder.path().join("x.txt");
    let out = analyze(&[file.to_str().unwrap(), "--out", other.to_str().unwrap()]);
    assert_eq!(out.status.code(), Some(2));
    assert!(!other.exists());
    let twice = file.to_str().unwrap();
    let out = analyze(&[twice, twice, "--out", csv.to_str().unwrap()]);
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("takes one recording"));
    #[cfg(feature = "tables")]
    {
        let parquet = folder.path().join("x.parquet");
        let out = analyze(&[
            file.to_str().unwrap(),
            "--downsample",
            "10",
            "--out",
            parquet.to_str().unwrap(),
        ]);
        assert!(out.status.success(), "{}", text(&out.stderr));
        use parquet::file::reader::{FileReader, SerializedFileReader};
        let reader = SerializedFileReader::new(std::fs::File::open(&parquet).unwrap()).unwrap();
        let meta = reader.metadata().file_metadata();
        assert_eq!(meta.num_rows(), 181);
        let names: Vec<String> = meta
            .schema_descr()
            .columns()
            .iter()
            .map(|c| c.name().to_owned())
            .collect();
        assert!(
            names.contains(&"/rath/state.orientation.roll".to_owned()),
            "{names:?}"
        );
    }
}

#[test]
fn annotate_keeps_every_message_and_adds_findings() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(folder.path());
    let seen = folder.path().join("seen.mcap");
    let out = analyze(&[file.to_str().unwrap(), "--annotate", seen.to_str().unwrap()]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let before = json(&[file.to_str().unwrap(), "--format", "json"]);
    let after = json(&[seen.to_str().unwrap(), "--format", "json"]);
    assert_eq!(before["metrics"], after["metrics"]);
    let messages = |v: &Value, topic: &str| {
        let topics = v["recording"]["topics"].as_array().unwrap().clone();
        topics
            .iter()
            .find(|t| t["name"] == topic)
            .map(|t| t["messages"].as_u64().unwrap())
    };
    assert_eq!(messages(&after, "/rath/state"), Some(1801));
    assert_eq!(messages(&after, "/findings/order_parameter"), Some(1801));
    assert_eq!(
        messages(&after, "/findings/events"),
        Some(before["events"].as_array().unwrap().len() as u64)
    );
}

/// Times, numbers, attachments and metadata records of a recording, each as it is.
fn as_it_is(path: &Path, mut keep: impl FnMut(&RawMessage<'_>)) -> (String, Vec<String>) {
    let recording = Recording::open(path, &ReadOptions::default()).unwrap();
    let beside = |topic: &str| !topic.starts_with("/findings/");
    recording.messages(&beside, &mut |raw| keep(raw)).unwrap();
    let attached = recording.attachments().map(|a| format!("{a:?}"));
    let records = recording.metadata_records().iter();
    let noted = records.filter(|(name, _)| name != "findings");
    let kept = attached.chain(noted.map(|record| format!("{record:?}")));
    (recording.info().profile.clone(), kept.collect())
}

#[test]
fn annotate_copies_times_numbers_and_what_shares_a_name() {
    let folder = tempfile::tempdir().unwrap();
    let [from, to] = ["from.mcap", "to.mcap"].map(|name| folder.path().join(name));
    for profile in ["x-own", "ros1"] {
        let options = WriterOptions {
            profile: profile.into(),
            ..WriterOptions::default()
        };
        let mut w = RecordingWriter::create(&from, &options).unwrap();
        for (name, key, value) in [("b", "k", "1"), ("a", "k", "2"), ("b", "k", "3")] {
            let values = [(key.to_owned(), value.to_owned())].into();
            w.metadata(name, &values).unwrap();
        }
        for (log_time_ns, data) in [(5, &b"first"[..]), (7, b"second")] {
            w.copy_attachment(&RawAttachment {
                name: "calibration",
                media_type: "text/plain",
                log_time_ns,
                create_time_ns: 3,
                data,
            })
            .unwrap();
        }
        let number = w.channel("/x", MessageKind::Float64).unwrap();
        for k in 0..100i64 {
            let raw = RawMessage {
                channel: 0,
                topic: "/x",
                sequence: 7 * k as u32,
                log_time_ns: k * 10_000_000,
                publish_time_ns: u64::MAX - k as u64,
                data: &[0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, k as u8],
            };
            w.copy(number, &raw).unwrap();
        }
        w.finish().unwrap();
        let out = analyze(&[from.to_str().unwrap(), "--annotate", to.to_str().unwrap()]);
        assert!(out.status.success(), "{}", text(&out.stderr));
        let told = |raw: &RawMessage<'_>| {
            let times = (raw.log_time_ns, raw.publish_time_ns);
            (times, raw.sequence, raw.data.to_vec())
        };
        let (mut before, mut after) = (Vec::new(), Vec::new());
        let (_, beside) = as_it_is(&from, |raw| before.push(told(raw)));
        let found = as_it_is(&to, |raw| after.push(told(raw)));
        assert_eq!(before.len(), 100);
        assert_eq!(before, after);
        assert_eq!(beside.len(), 5);
        assert_eq!(found, (profile.to_owned(), beside));
    }
}

/// A file that was cut before its first message has no topic to name: what is wrong with it is said.
#[test]
fn no_signal_fits_where_all_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(folder.path());
    let bytes = std::fs::read(&file).unwrap();
    std::fs::write(&file, &bytes[..40]).unwrap();
    let out = analyze(&[file.to_str().unwrap(), "--signal", "/battery.data"]);
    let said = text(&out.stderr);
    let expected =
        "no numeric signal fits /battery.data; it has no topics that can be read; the file ends ";
    assert!(said.contains(expected), "{said}");
}

/// What holds no numbers has topics all the same.
#[test]
fn topics_without_numbers_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bytes.mcap");
    let file = path.to_str().unwrap();
    for encoding in ["cbor", "json"] {
        let mut w = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
        let channel = recording::write::RawChannel {
            topic: "/a",
            message_encoding: encoding,
            schema_name: "",
            schema_encoding: "",
            schema_data: &[],
            metadata: &Default::default(),
        };
        let channel = w.raw_channel(&channel).unwrap();
        for k in 0..101 {
            w.message(channel, k * 10_000_000, &b"{\"a\":\"text\"}"[..])
                .unwrap();
        }
        w.finish().unwrap();
        let v = json(&[file, "--format", "json"]);
        let topic = &v["recording"]["topics"][0];
        assert_eq!(topic["messages"], 101);
        assert_eq!(topic["hz"], 100.0);
        assert_eq!(v["signals"], serde_json::json!({}));
        let table = analyze(&[file]);
        assert!(table.status.success() && text(&table.stdout).contains("/a"));
        let out = analyze(&[file, "--signal", "*"]);
        assert_eq!(out.status.code(), Some(1));
    }
}

#[test]
fn who_walks_alone_gets_no_order_parameter() {
    let folder = tempfile::tempdir().unwrap();
    let file = carried_by(1, folder.path());
    let seen = folder.path().join("seen.mcap");
    let out = analyze(&[file.to_str().unwrap(), "--annotate", seen.to_str().unwrap()]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let after = json(&[seen.to_str().unwrap(), "--format", "json"]);
    let names: Vec<&str> = after["recording"]["topics"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|t| t["name"].as_str())
        .collect();
    assert!(
        names.contains(&"/findings/events") && names.contains(&"/carriers/phases"),
        "{names:?}"
    );
    assert!(!names.contains(&"/findings/order_parameter"), "{names:?}");
}

#[test]
fn findings_of_an_earlier_round_make_room() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(folder.path());
    let [once, twice] = ["once.mcap", "twice.mcap"].map(|name| folder.path().join(name));
    for (from, to) in [(&file, &once), (&once, &twice)] {
        let out = analyze(&[from.to_str().unwrap(), "--annotate", to.to_str().unwrap()]);
        assert!(out.status.success(), "{}", text(&out.stderr));
    }
    let of = |path: &Path| json(&[path.to_str().unwrap(), "--format", "json"])["recording"].clone();
    assert_eq!(of(&once)["topics"], of(&twice)["topics"]);
}

#[test]
fn no_input_is_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(folder.path());
    let name = file.to_str().unwrap();
    let before = std::fs::read(&file).unwrap();
    let [both, roles] = ["both", "roles.toml"].map(|name| folder.path().join(name));
    std::fs::write(&roles, "mass_kg = 60.0\n").unwrap();
    let [both, roles] = [&both, &roles].map(|path| path.to_str().unwrap());
    for args in [
        &[name, "--report", name][..],
        &[name, "--roles", roles, "--report", roles],
        &[name, "--annotate", name],
        &[name, "--out", name],
        &[name, "--out", both, "--report", both],
    ] {
        let out = analyze(args);
        assert_eq!(out.status.code(), Some(2), "{args:?}");
        assert!(text(&out.stderr).contains("named twice"), "{args:?}");
    }
    // A pattern that fits two recordings names an output and an input.
    let other = folder.path().join("other.mcap");
    std::fs::copy(&file, &other).unwrap();
    for option in ["--report", "--out"] {
        let out = analyze(&[option, name, other.to_str().unwrap()]);
        assert_eq!(out.status.code(), Some(2), "{option}");
        let said = text(&out.stderr);
        assert!(said.contains("expected a name that ends in"), "{said}");
    }
    assert!(std::fs::read(&file).unwrap() == before);
}

#[test]
fn a_role_that_nothing_or_too_much_plays_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(folder.path());
    let roles = folder.path().join("roles.toml");
    for (said, words) in [
        (
            "roll = \"/rath/state.rol_rad\"",
            "did you mean /rath/state.roll_rad?",
        ),
        ("roll = \"/rath/state.*\"", "signals, where one is expected"),
        (
            "imu = \"/imu/rath\"",
            "imu, /imu/rath, is not in the recording",
        ),
    ] {
        std::fs::write(&roles, said).unwrap();
        let found = json(&[
            file.to_str().unwrap(),
            "--roles",
            roles.to_str().unwrap(),
            "--format",
            "json",
        ]);
        let warnings = found["recording"]["warnings"].to_string();
        assert!(warnings.contains(words), "{said}: {warnings}");
        let known = said.starts_with("imu");
        assert_eq!(found["metrics"]["rms_roll_deg"]["value"].is_number(), known);
    }
    for said in ["mass_kg = -60.0", "mass_kg = nan", "gravity_m_per_s2 = 0.0"] {
        std::fs::write(&roles, said).unwrap();
        let out = analyze(&[file.to_str().unwrap(), "--roles", roles.to_str().unwrap()]);
        assert_eq!(out.status.code(), Some(1), "{said}");
        assert!(text(&out.stderr).contains("expected a number above zero"));
    }
}

#[test]
fn several_that_were_asked_for_are_an_array() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(folder.path());
    let out = analyze(&[file.to_str().unwrap(), "/no/such.mcap", "--format", "json"]);
    assert_eq!(out.status.code(), Some(1));
    let found: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(found.as_array().unwrap().len(), 1);
}

/// Where nothing can be said, what was done still counts.
#[cfg(target_os = "linux")]
#[test]
fn nobody_has_to_listen() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(folder.path());
    let whole = std::fs::read(&file).unwrap();
    let cut = folder.path().join("cut.mcap");
    std::fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    let full = || {
        std::fs::OpenOptions::new()
            .write(true)
            .open("/dev/full")
            .unwrap()
    };
    for (file, code) in [(&file, 0), (&cut, 3), (&folder.path().join("none"), 1)] {
        let status = Command::new(env!("CARGO_BIN_EXE_analyze"))
            .arg(file)
            .stderr(full())
            .stdout(std::process::Stdio::null())
            .status()
            .unwrap();
        assert_eq!(status.code(), Some(code), "{}", file.display());
    }
}

/// A topic on two channels, whose messages are bare numbers, two of them at each time.
#[test]
fn a_topic_is_told_of_as_a_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bare.mcap");
    let mut w = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
    let mut channel = |sequence: &str| {
        w.raw_channel(&recording::write::RawChannel {
            topic: "/n",
            message_encoding: "json",
            schema_name: "",
            schema_encoding: "",
            schema_data: &[],
            metadata: &[("part".to_owned(), sequence.to_owned())].into(),
        })
        .unwrap()
    };
    let channels = ["a", "b"].map(&mut channel);
    for k in 0..1000i64 {
        for channel in channels {
            w.message(channel, k * 10_000_000, k.to_string().as_bytes())
                .unwrap();
        }
    }
    w.finish().unwrap();
    let file = path.to_str().unwrap();
    let found = json(&[file, "--format", "json", "--topic", "/n"]);
    let n = &found["signals"]["/n"];
    assert_eq!(n["count"], 2000);
    assert!((n["hz"].as_f64().unwrap() - 200.0).abs() < 0.2, "{n}");
    // A table has a row for each message of a time; a pattern that nothing fits is said beside one that fits.
    let table = folder.path().join("n.csv");
    let out = analyze(&[
        file,
        "--signal",
        "/n",
        "--signal",
        "/m",
        "--out",
        table.to_str().unwrap(),
    ]);
    let said = text(&out.stderr);
    assert!(out.status.success(), "{said}");
    assert!(said.contains("fits /m"), "{said}");
    let rows = std::fs::read_to_string(&table).unwrap().lines().count();
    assert_eq!(rows, 2001);
}

/// Messages of one channel: topic, and log time (s) and JSON text of each.
type Told<'a> = (&'a str, Vec<(f64, String)>);

/// A recording of JSON messages without schemas, in the order in which they are given; small chunks, so that order counts.
fn told(folder: &Path, channels: &[Told]) -> String {
    let path = folder.join("told.mcap");
    let options = WriterOptions {
        chunk_bytes: 4096,
        ..WriterOptions::default()
    };
    let mut w = RecordingWriter::create(&path, &options).unwrap();
    for (k, (topic, messages)) in channels.iter().enumerate() {
        let channel = recording::write::RawChannel {
            topic,
            message_encoding: "json",
            schema_name: "",
            schema_encoding: "",
            schema_data: &[],
            metadata: &[("part".to_owned(), k.to_string())].into(),
        };
        let channel = w.raw_channel(&channel).unwrap();
        for (t, text) in messages {
            let t_ns = 1_700_000_000_000_000_000 + (t * 1e9).round() as i64;
            w.message(channel, t_ns, text.as_bytes()).unwrap();
        }
    }
    w.finish().unwrap();
    path.to_str().unwrap().to_owned()
}

/// What is found with a roles file.
fn with_roles(folder: &Path, file: &str, roles: &str) -> Value {
    let path = folder.join("roles.toml");
    std::fs::write(&path, roles).unwrap();
    json(&[file, "--format", "json", "--roles", path.to_str().unwrap()])
}

fn tone(hz: f64, t: f64) -> f64 {
    (std::f64::consts::TAU * hz * t).sin()
}

fn metric(found: &Value, name: &str) -> f64 {
    found["metrics"][name]["value"].as_f64().unwrap_or(f64::NAN)
}

fn kinds(found: &Value) -> Vec<String> {
    let all = found["quality"].as_array().unwrap().iter();
    all.map(|q| q["kind"].as_str().unwrap().to_owned())
        .collect()
}

/// Messages that come by tens are told apart by their stamps.
#[test]
fn bursts_are_dated_by_their_stamps() {
    let folder = tempfile::tempdir().unwrap();
    let message = |k: u32| {
        let t = f64::from(k) / 30.0;
        let stamp_ns = (t * 1e9) as u64;
        let (sec, nanosec) = (stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000);
        let (roll, z) = (0.35 * tone(1.0, t), 1.0 + 0.05 * tone(2.0, t));
        let text = format!(
            "{{\"header\":{{\"stamp\":{{\"sec\":{sec},\"nanosec\":{nanosec}}}}},\"roll\":{roll},\"z\":{z}}}"
        );
        (f64::from(k / 10 + 1) / 3.0, text)
    };
    let file = told(folder.path(), &[("/s", (0..1800).map(message).collect())]);
    let found = with_roles(
        folder.path(),
        &file,
        "roll = \"/s.roll\"\nheight = \"/s.z\"\n",
    );
    assert!(
        (metric(&found, "peak_hz") - 2.0).abs() < 0.02,
        "{}",
        found["metrics"]["peak_hz"]
    );
    assert!((metric(&found, "roll_peak_hz") - 1.0).abs() < 0.02);
    assert_eq!(found["metrics"]["mechanism"]["value"], "parametric");
    assert!(kinds(&found).contains(&"by_stamps".to_owned()));
}

/// What an inertial sensor tells of a roll by 20° at 1 Hz and a heave by 3 cm at 2 Hz, as a JSON message without a schema.
fn swung(t: f64) -> String {
    let stamp_ns = 1_600_000_000_000_000_000 + (t * 1e9).round() as u64;
    let (sec, nanosec) = (stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000);
    let w = std::f64::consts::TAU;
    let roll = 20f64.to_radians() * (w * t).sin();
    let rate = 20f64.to_radians() * w * (w * t).cos();
    let force = 9.80665 - 0.03 * (2.0 * w).powi(2) * (2.0 * w * t).sin();
    let (y, z) = (force * roll.sin(), force * roll.cos());
    format!(
        "{{\"header\":{{\"stamp\":{{\"sec\":{sec},\"nanosec\":{nanosec}}}}},\
         \"angular_velocity\":{{\"x\":{rate},\"y\":0.0,\"z\":0.0}},\
         \"linear_acceleration\":{{\"x\":0.0,\"y\":{y},\"z\":{z}}}}}"
    )
}

/// A layout that exchanges two of a gyroscope's columns is found out, and believed no interval.
#[test]
fn axes_that_a_layout_exchanged_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let mut table = "t,ax,ay,az,gx,gy,gz\n".to_owned();
    for k in 0..4000 {
        let t = f64::from(k) * 0.01;
        let w = std::f64::consts::TAU;
        let (roll, turned) = (0.35 * (w * t).sin(), 0.35 * w * (w * t).cos());
        let (y, z) = (9.81 * roll.sin(), 9.81 * roll.cos());
        table += &format!("{t:.2},0.01,{y:.4},{z:.4},{turned:.5},0.001,0.002\n");
    }
    let log = folder.path().join("rath.csv");
    std::fs::write(&log, table).unwrap();
    for (gyro, told) in [
        (["gx", "gy", "gz"], None),
        (["gy", "gx", "gz"], Some("y, x, z")),
    ] {
        let layout = folder.path().join("layout.toml");
        let text = format!(
            "[time]\ncolumn = \"t\"\nunit = \"s\"\n[acceleration]\ncolumns = [\"ax\", \"ay\", \"az\"]\nunit = \"m/s^2\"\n[angular_velocity]\ncolumns = {gyro:?}\nunit = \"rad/s\"\n"
        );
        std::fs::write(&layout, text).unwrap();
        let file = folder.path().join("walk.mcap");
        let [log, layout, file] = [&log, &layout, &file].map(|p| p.to_str().unwrap());
        analyze(&["ingest", log, "--layout", layout, "--out", file]);
        let found = json(&[file, "--format", "json"]);
        let quality = found["quality"].as_array().unwrap();
        let axes = quality.iter().find(|q| q["kind"] == "axes");
        let text = axes.map(|q| q["text"].as_str().unwrap());
        assert_eq!(text.is_some(), told.is_some(), "{text:?}");
        assert!(
            text.is_none_or(|text| text.contains(told.unwrap())),
            "{text:?}"
        );
        let roll = &found["metrics"]["rms_roll_deg"];
        assert_eq!(roll["ci95"].is_null(), told.is_some(), "{roll}");
    }
}

/// A log that was written at once, within a quarter of a second, or beside a simulation that ran at a third of the wall's clock.
#[test]
fn stamps_tell_the_times_where_the_log_keeps_another_pace() {
    let folder = tempfile::tempdir().unwrap();
    let paces: [fn(f64) -> f64; 3] = [|_| 0.0, |t| t / 240.0, |t| 3.0 * t];
    for pace in paces {
        let taken = (0..6000).map(|k| f64::from(k) * 0.01);
        let messages = taken.map(|t| (pace(t), swung(t))).collect();
        let file = told(folder.path(), &[("/s", messages)]);
        let found = with_roles(folder.path(), &file, "imu = \"/s\"\n");
        let near = |name: &str, value: f64, bound: f64| {
            let got = metric(&found, name);
            assert!((got - value).abs() < bound, "{name}: {got}");
        };
        // 20°/√2, to the interval that is stated.
        near("rms_roll_deg", 14.142, 0.09);
        near("peak_hz", 2.0, 0.02);
        near("roll_peak_hz", 1.0, 0.02);
        assert!(kinds(&found).contains(&"by_stamps".to_owned()));
        assert!(found["window_s"][1].as_f64().unwrap() >= 59.99);
    }
}

/// A sensor whose type nobody knows is told of with the line that names it.
#[test]
fn what_may_move_the_load_is_told_with_its_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let taken = (0..2000).map(|k| f64::from(k) * 0.01);
    let file = told(
        folder.path(),
        &[("/s", taken.map(|t| (t, swung(t))).collect())],
    );
    let found = json(&[&file, "--format", "json"]);
    let quality = found["quality"].as_array().unwrap();
    let hint = quality.iter().find(|q| q["kind"] == "unknown_type");
    let hint = hint.unwrap()["text"].as_str().unwrap();
    let line = "imu = \"/s\"";
    assert!(hint.contains(line), "{hint}");
    let found = with_roles(folder.path(), &file, line);
    assert!((metric(&found, "roll_peak_hz") - 1.0).abs() < 0.05);
    assert!(!kinds(&found).contains(&"unknown_type".to_owned()));
}

/// Phases that another program told, of walkers who follow the beats of a topic beside them.
#[test]
fn beats_stand_beside_phases_that_others_told() {
    let folder = tempfile::tempdir().unwrap();
    let turn = std::f64::consts::TAU;
    let phases = (0..1800).map(|k| {
        let t = f64::from(k) / 30.0;
        let (a, b) = (turn * 1.9 * t - 0.3, turn * 1.9 * t - 0.5);
        (t, format!("{{\"a\":{a},\"b\":{b}}}"))
    });
    let beats = (1..114).map(|k| (f64::from(k) / 1.9, "{}".to_owned()));
    let file = told(
        folder.path(),
        &[("/p", phases.collect()), ("/beat", beats.collect())],
    );
    let found = with_roles(folder.path(), &file, "phases = [\"/p.a\", \"/p.b\"]\n");
    assert!((metric(&found, "beat_hz") - 1.9).abs() < 1e-3);
    assert!((metric(&found, "beat_synchrony") - 1.0).abs() < 1e-3);
    let lead = metric(&found, "beat_lead_deg");
    assert!((lead + 0.4f64.to_degrees()).abs() < 0.5, "{lead}");
}

/// The transform of a frame that rolls by `roll_deg` and stands `z` high.
fn frame(name: &str, roll_deg: f64, z: f64) -> String {
    let (sin, cos) = (roll_deg.to_radians() / 2.0).sin_cos();
    format!(
        "{{\"transforms\":[{{\"child_frame_id\":\"{name}\",\"transform\":{{\
         \"translation\":{{\"x\":0.0,\"y\":0.0,\"z\":{z}}},\
         \"rotation\":{{\"x\":{sin},\"y\":0.0,\"z\":0.0,\"w\":{cos}}}}}}}]}}"
    )
}

/// A robot and its load publish one topic in turn: their places mix both, their names do not.
#[test]
fn frames_on_one_topic_are_told_apart_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let messages = (0..6000).map(|k| {
        let t = f64::from(k) * 0.01;
        let text = match k % 2 {
            0 => frame("load", 8.0 * tone(1.1, t), 1.0 + 0.03 * tone(2.2, t)),
            _ => frame("base", 0.5 * tone(0.7, t), 0.4),
        };
        (t, text)
    });
    let file = told(folder.path(), &[("/tf", messages.collect())]);
    let found = json(&[&file, "--format", "json"]);
    let quality = found["quality"].as_array().unwrap();
    let told = |kind: &str| {
        let remark = quality.iter().find(|q| q["kind"] == kind);
        remark.unwrap()["text"].as_str().unwrap().to_owned()
    };
    let mixed = told("mixed_items");
    assert!(
        mixed.contains("transforms[0] is in turn base, load"),
        "{mixed}"
    );
    assert!(mixed.contains("--by-name"), "{mixed}");
    let hint = told("unknown_type");
    let line = "roll = \"/tf.transforms[NAME].transform.rotation.roll\"";
    assert!(hint.contains(line), "{hint}");

    let path = |name: &str, last: &str| format!("/tf.transforms[{name}].transform.{last}");
    let listed = json(&[&file, "--format", "json", "--by-name"]);
    let signals = listed["signals"].as_object().unwrap();
    for (name, sd_m) in [("load", 0.03 / 2f64.sqrt()), ("base", 0.0)] {
        let signal = &signals[&path(name, "translation.z")];
        assert_eq!(signal["count"], 3000);
        assert!((signal["sd"].as_f64().unwrap() - sd_m).abs() < 1e-5);
    }
    assert!(!signals.contains_key(&path("0", "translation.z")));
    assert!(!kinds(&listed).contains(&"mixed_items".to_owned()));

    // A roles file that writes the name is enough.
    let roles = format!(
        "height = \"{}\"\nroll = \"{}\"\n",
        path("load", "translation.z"),
        path("load", "rotation.roll")
    );
    let found = with_roles(folder.path(), &file, &roles);
    assert!((metric(&found, "rms_roll_deg") - 8.0 / 2f64.sqrt()).abs() < 1e-3);
    assert!((metric(&found, "dz_pp_m") - 0.06).abs() < 1e-4);
    assert!((metric(&found, "roll_peak_hz") - 1.1).abs() < 0.01);
}

/// A topic where a signal is wanted, and the reverse.
#[test]
fn a_role_of_the_wrong_kind_is_told_what_is_meant() {
    let folder = tempfile::tempdir().unwrap();
    let messages = (0..600).map(|k| {
        let t = f64::from(k) * 0.1;
        (t, frame("load", 8.0 * tone(1.1, t), 1.0))
    });
    let file = told(folder.path(), &[("/tf", messages.collect())]);
    for (roles, said) in [
        (
            "roll = \"/tf\"",
            "the roles file's roll, /tf, is not in the recording as a signal: it is a topic, and one of its fields is wanted, such as /tf.transforms[0].transform.rotation.roll",
        ),
        (
            "truth = \"/tf.transforms[0].transform.rotation\"",
            "the roles file's truth, /tf.transforms[0].transform.rotation, is not in the recording as a topic: is /tf meant?",
        ),
    ] {
        let found = with_roles(folder.path(), &file, roles);
        let warnings = found["recording"]["warnings"].as_array().unwrap();
        assert!(warnings.iter().any(|w| w == said), "{warnings:?}");
    }
}

/// `-` is standard output where a recording is all that is written, and refused where the result stands there.
#[test]
fn a_recording_may_go_to_standard_output() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("belt.csv");
    std::fs::write(
        &log,
        "Time (s),Acceleration x (m/s^2),Acceleration y (m/s^2),Acceleration z (m/s^2)\n0,0,0,9.8\n0.01,0,0,9.8\n",
    )
    .unwrap();
    let run = |args: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_analyze"))
            .args(args)
            .current_dir(folder.path())
            .output()
            .unwrap()
    };
    let piped = run(&["ingest", "belt.csv", "--out", "-"]);
    assert!(piped.status.success(), "{}", text(&piped.stderr));
    run(&["ingest", "belt.csv", "--out", "belt.mcap"]);
    assert_eq!(
        piped.stdout,
        std::fs::read(folder.path().join("belt.mcap")).unwrap()
    );
    for option in ["--out", "--annotate", "--report"] {
        let refused = run(&["belt.mcap", option, "-"]);
        assert_eq!(refused.status.code(), Some(2));
        let said = text(&refused.stderr);
        assert!(said.contains("standard output"), "{said}");
    }
    assert!(!folder.path().join("-").exists());
}

/// A roll in degrees is one where its name or the user says so, and is suspected where it goes beyond half a turn.
#[test]
fn degrees_are_taken_as_such() {
    let folder = tempfile::tempdir().unwrap();
    let message = |k: u32| {
        let t = f64::from(k) / 30.0;
        let roll_deg = 20.0 * tone(1.0, t);
        (
            t,
            format!("{{\"roll\":{roll_deg},\"roll_deg\":{roll_deg}}}"),
        )
    };
    let file = told(folder.path(), &[("/s", (0..900).map(message).collect())]);
    for (roles, rms_deg, suspected) in [
        ("roll = \"/s.roll_deg\"\n", 20.0 / 2f64.sqrt(), false),
        (
            "roll = \"/s.roll\"\nangle_unit = \"deg\"\n",
            20.0 / 2f64.sqrt(),
            false,
        ),
        (
            "roll = \"/s.roll\"\n",
            (20.0 / 2f64.sqrt()).to_degrees(),
            true,
        ),
        (
            "roll = \"/s.roll_deg\"\nangle_unit = \"rad\"\n",
            20.0 / 2f64.sqrt(),
            false,
        ),
    ] {
        let found = with_roles(folder.path(), &file, roles);
        let rms = metric(&found, "rms_roll_deg");
        assert!((rms / rms_deg - 1.0).abs() < 1e-6, "{roles}: {rms}");
        assert_eq!(
            kinds(&found).contains(&"large_angle".to_owned()),
            suspected,
            "{roles}"
        );
    }
}

#[test]
fn heights_tell_their_unit() {
    let folder = tempfile::tempdir().unwrap();
    let message = |k: u32| {
        let t = f64::from(k) / 30.0;
        let x = 0.1 * tone(1.0, t);
        let text = format!(
            "{{\"z\":{x},\"z_m\":{x},\"z_cm\":{},\"z_mm\":{}}}",
            1e2 * x,
            1e3 * x
        );
        (t, text)
    };
    let file = told(folder.path(), &[("/s", (0..900).map(message).collect())]);
    for field in ["z", "z_m", "z_cm", "z_mm"] {
        let roles = format!("height = \"/s.{field}\"\n");
        let rms_m = metric(&with_roles(folder.path(), &file, &roles), "rms_z_m");
        assert!(
            (rms_m / 0.05 / 2f64.sqrt() - 1.0).abs() < 1e-6,
            "{field}: {rms_m}"
        );
    }
    // A place in centimetres is none.
    let roles = folder.path().join("roles.toml");
    std::fs::write(&roles, "imu_place_m = [50.0, 0.0, 30.0]\n").unwrap();
    let out = analyze(&[&file, "--roles", roles.to_str().unwrap()]);
    let said = text(&out.stderr);
    assert!(
        said.contains("expected three numbers in metres, up to 10"),
        "{said}"
    );
}

/// A height that is sampled faster than the roll keeps its line, and a slower one its size.
#[test]
fn height_is_judged_on_its_own_clock() {
    let folder = tempfile::tempdir().unwrap();
    let of = |roll: (u32, f64), height: (u32, f64)| {
        let course = |(hz, f): (u32, f64), offset: f64| {
            let times = (0..60 * hz).map(|k| f64::from(k) / f64::from(hz) + offset);
            times
                .map(|t| (t, format!("{{\"x\":{}}}", 0.3 * tone(f, t))))
                .collect()
        };
        let channels = [("/s", course(roll, 0.0)), ("/z", course(height, 0.003))];
        let file = told(folder.path(), &channels);
        with_roles(folder.path(), &file, "roll = \"/s.x\"\nheight = \"/z.x\"\n")
    };
    let slow_roll = of((5, 0.4), (100, 4.2));
    assert!((metric(&slow_roll, "peak_hz") - 4.2).abs() < 0.01);
    assert!((slow_roll["spectra"]["/z.x"]["peak_hz"].as_f64().unwrap() - 4.2).abs() < 0.01);
    let mechanism = &slow_roll["metrics"]["mechanism"];
    assert!(mechanism["value"].is_null(), "{mechanism}");
    assert!(
        mechanism["reason"]
            .as_str()
            .unwrap()
            .contains("cannot be seen in the roll")
    );
    assert!(slow_roll["metrics"]["subharmonic_ratio"]["value"].is_null());
    let slow_height = of((100, 1.0), (10, 2.0));
    let rms_m = metric(&slow_height, "rms_z_m");
    assert!(
        (rms_m / (0.3 * 0.5f64.sqrt()) - 1.0).abs() < 1e-3,
        "{rms_m}"
    );
    assert_eq!(slow_height["metrics"]["mechanism"]["value"], "parametric");
}

/// The pose of a robot that hardly rolls was taken for the motion of the load that it carries, and a pose with z down for a load on its back.
#[test]
fn a_pose_that_is_not_the_loads_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let roll = |t: f64| 0.14 * tone(1.1, t);
    let times = || (0..4000).map(|k| f64::from(k) / 100.0);
    let of = |share: f64, offset: f64| {
        let pose = |t: f64| {
            let (sin, cos) = (0.5 * (share * roll(t) + offset)).sin_cos();
            let orientation = format!("{{\"x\":{sin},\"y\":0.0,\"z\":0.0,\"w\":{cos}}}");
            (t, format!("{{\"orientation\":{orientation}}}"))
        };
        let sensor = |t: f64| {
            let (turns, (sin, cos)) = ((roll(t + 1e-4) - roll(t - 1e-4)) / 2e-4, roll(t).sin_cos());
            let gyro = format!("{{\"x\":{turns},\"y\":0.0,\"z\":0.0}}");
            let felt = [9.81 * sin, 9.81 * cos];
            let felt = format!("{{\"x\":0.0,\"y\":{},\"z\":{}}}", felt[0], felt[1]);
            let text = format!("{{\"angular_velocity\":{gyro},\"linear_acceleration\":{felt}}}");
            (t, text)
        };
        let channels = [
            ("/robot", times().map(pose).collect()),
            ("/load/imu", times().map(sensor).collect()),
        ];
        let file = told(folder.path(), &channels);
        let roles = "imu = \"/load/imu\"\nroll = \"/robot.orientation.roll\"\npitch = \"/robot.orientation.pitch\"\n";
        with_roles(folder.path(), &file, roles)
    };
    for (share, offset, kind) in [
        (1.0, 0.0, None),
        (0.1, 0.0, Some("two_bodies")),
        (1.0, std::f64::consts::PI, Some("upside_down")),
    ] {
        let kinds = kinds(&of(share, offset));
        for said in ["two_bodies", "upside_down"] {
            if kind.is_none_or(|kind| kind == said) {
                assert_eq!(kinds.iter().any(|k| k == said), kind.is_some(), "{kinds:?}");
            }
        }
    }
}

/// Forces as they act on the sensor, or along another axis, gave an unloaded time and jumps of what stood on its feet; those that are there twice
/// weighed twice the load.
#[test]
fn forces_that_weigh_nothing_tell_no_jump() {
    let folder = tempfile::tempdir().unwrap();
    let of = |sign: f64, mean_n: f64, mass: &str| {
        let force = |t: f64| {
            (
                t,
                format!("{{\"z\":{}}}", sign * (mean_n + 100.0 * tone(2.2, t))),
            )
        };
        let messages: Vec<(f64, String)> = (0..4000).map(|k| force(f64::from(k) / 100.0)).collect();
        let file = told(folder.path(), &[("/a", messages.clone()), ("/b", messages)]);
        let roles = format!("forces = [\"/a.z\", \"/b.z\"]\n{mass}");
        let found = with_roles(folder.path(), &file, &roles);
        let jumps = found["events"].as_array().unwrap().iter();
        let jumps = jumps.filter(|e| e["kind"] == "jump").count();
        (found["metrics"]["t_float"].clone(), jumps)
    };
    let (right, jumps) = of(1.0, 80.0, "");
    assert!(
        right["value"].as_f64().unwrap() > 0.1 && jumps > 80,
        "{right}"
    );
    for (sign, mean_n, mass, why) in [
        (-1.0, 80.0, "", "-160 N"),
        (-1.0, 80.0, "mass_kg = 16.3", "-160 N"),
        (1.0, 0.5, "", "no load's weight"),
    ] {
        let (none, jumps) = of(sign, mean_n, mass);
        assert!(none["value"].is_null() && jumps == 0, "{none}");
        assert!(none["reason"].as_str().unwrap().contains(why), "{none}");
    }
    let (twice, _) = of(1.0, 80.0, "mass_kg = 8.15");
    assert!(twice["value"].is_number());
    assert!(
        twice["reason"].as_str().unwrap().contains("M·g is 80 N"),
        "{twice}"
    );
}

/// Channels of one topic that differ in length, that alternate, and messages that are shuffled: one line, no jitter.
#[test]
fn a_signal_is_the_same_in_whatever_order_it_comes() {
    let folder = tempfile::tempdir().unwrap();
    let message = |k: u32| {
        let t = f64::from(k) / 100.0;
        (t, format!("{{\"v\":{}}}", 5.0 + 3.0 * tone(1.2345, t)))
    };
    let all = || (0..6000).map(message);
    let shuffled = (0..6000).map(|k| message(k * 617 % 6000)).collect();
    let few = vec![
        ("/a", all().take(20).collect()),
        ("/a", all().skip(20).collect()),
    ];
    let alternating = [0, 1].map(|j| ("/a", all().skip(j).step_by(2).collect()));
    for channels in [few, alternating.into(), vec![("/a", shuffled)]] {
        let found = json(&[&told(folder.path(), &channels), "--format", "json"]);
        let v = &found["signals"]["/a.v"];
        let number = |name: &str| v[name].as_f64().unwrap();
        assert_eq!(number("count"), 6000.0);
        assert!((number("peak_hz") - 1.2345).abs() < 0.005, "{v}");
        assert!(number("jitter_s") < 1e-6, "{v}");
    }
}

/// Two messages of the clock's zero among those of a minute, in its midst and at its beginning, change neither rate, jitter nor what is drawn.
#[test]
fn early_messages_leave_the_rest_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("a.html");
    for window in [&[][..], &["--window", "..50"]] {
        let message = |k: u32| {
            let t = f64::from(k) / 100.0;
            let dated = if k.is_multiple_of(3000) { t - 1.7e9 } else { t };
            (dated, format!("{{\"v\":{}}}", 5.0 + tone(1.2345, t)))
        };
        let file = told(folder.path(), &[("/a", (0..6000).map(message).collect())]);
        let asked = [
            &file,
            "--format",
            "json",
            "--report",
            page.to_str().unwrap(),
        ];
        let found = json(&[&asked, window].concat());
        assert_eq!(kinds(&found), ["early"], "{found}");
        let v = &found["signals"]["/a.v"];
        assert!((v["hz"].as_f64().unwrap() - 100.0).abs() < 0.1, "{v}");
        assert!(v["jitter_s"].as_f64().unwrap() < 1e-3, "{v}");
        assert!((v["peak_hz"].as_f64().unwrap() - 1.2345).abs() < 0.01);
        let drawn = std::fs::read_to_string(&page).unwrap();
        assert!(!drawn.contains("-1700000000"));
    }
}

/// A field that some messages lack, from somewhere on or in between, has the rate and the jitter of the messages that have it.
#[test]
fn a_field_has_the_times_of_its_messages() {
    let folder = tempfile::tempdir().unwrap();
    let has = |k: usize, name: &str| match name {
        "all" => true,
        "thinned" => k < 5000 || k.is_multiple_of(5),
        "held" => !(2000..4000).contains(&k),
        _ => k >= 1000,
    };
    let names = ["all", "thinned", "held", "late"];
    let message = |k: usize| {
        let there = names.iter().filter(|name| has(k, name));
        let fields: Vec<String> = there.map(|name| format!("\"{name}\":{k}")).collect();
        (k as f64 / 100.0, format!("{{{}}}", fields.join(",")))
    };
    let file = told(folder.path(), &[("/a", (0..6000).map(message).collect())]);
    let found = json(&[&file, "--format", "json"]);
    for name in names {
        let t: Vec<f64> = (0..6000)
            .filter(|k| has(*k, name))
            .map(|k| k as f64 / 100.0)
            .collect();
        let steps = (t.len() - 1) as f64;
        let mean_s = (t[t.len() - 1] - t[0]) / steps;
        let squares = t.windows(2).map(|w| (w[1] - w[0] - mean_s).powi(2));
        let jitter_s = (squares.sum::<f64>() / steps).sqrt();
        let signal = &found["signals"][format!("/a.{name}")];
        let number = |key: &str| signal[key].as_f64().unwrap();
        assert_eq!(number("count"), t.len() as f64, "{name}");
        assert!(
            (number("hz") * mean_s - 1.0).abs() < 1e-9,
            "{name}: {signal}"
        );
        assert!(
            (number("jitter_s") - jitter_s).abs() < 1e-9,
            "{name}: {signal}"
        );
    }
}

/// A topic that runs for a small part of the recording, one message to a chunk, has segments as long as any other.
#[test]
fn a_short_topic_of_a_long_recording_has_a_spectrum() {
    let folder = tempfile::tempdir().unwrap();
    let padding = "x".repeat(4200);
    let swing = |k: u32| {
        let t = f64::from(k) / 100.0;
        let text = format!("{{\"v\":{},\"image\":\"{padding}\"}}", tone(1.8, t));
        (1000.0 + t, text)
    };
    let ends = vec![(0.0, "1".to_owned()), (3600.0, "2".to_owned())];
    let channels = [("/ends", ends), ("/a", (0..2500).map(swing).collect())];
    let found = json(&[
        &told(folder.path(), &channels),
        "--format",
        "json",
        "--signal",
        "/a.v",
    ]);
    let lines = &found["spectra"]["/a.v"];
    assert!(lines["segment_s"].as_f64().unwrap() > 10.0, "{lines}");
    assert!(
        (lines["peak_hz"].as_f64().unwrap() - 1.8).abs() < 0.02,
        "{lines}"
    );
}

/// A topic that covers a part of the window, and quaternions that are none.
#[test]
fn what_metrics_lack_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let turned = |k: u32| {
        let t = f64::from(k) / 30.0;
        let half = 0.1 * tone(1.0, t);
        let length = if k % 100 == 5 { 0.0 } else { 1.0 };
        let (x, w) = (length * half.sin(), length * half.cos());
        (
            t,
            format!("{{\"q\":{{\"x\":{x},\"y\":0,\"z\":0,\"w\":{w}}}}}"),
        )
    };
    let level = (0..1800).map(|k| (f64::from(k) / 30.0, "1.0".to_owned()));
    let channels = [
        ("/s", (0..900).map(turned).collect()),
        ("/n", level.collect()),
    ];
    let file = told(folder.path(), &channels);
    let found = with_roles(folder.path(), &file, "roll = \"/s.q.roll\"\n");
    let all = found["quality"].as_array().unwrap();
    let of = |kind: &str| all.iter().find(|q| q["kind"] == kind).unwrap().clone();
    assert_eq!(kinds(&found), ["no_rotation", "ends_early"]);
    assert_eq!(of("no_rotation")["count"], 9);
    assert!(
        of("no_rotation")["text"]
            .as_str()
            .unwrap()
            .starts_with("9 quaternions of q far")
    );
    let early = of("ends_early");
    assert_eq!(early["topic"], "/s");
    assert!((early["t_s"].as_f64().unwrap() - 29.967).abs() < 1e-3);
    let args = [&file, "--format", "json", "--window", "5..29"];
    let inside = json(&args.map(|a: &str| a));
    assert!(!kinds(&inside).contains(&"ends_early".to_owned()));
}

/// Where there are only lists that are too long, and messages with too many keys, the limit is named.
#[test]
fn limits_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let list = format!("{{\"a\":{:?}}}", [1.5; 100]);
    let file = told(
        folder.path(),
        &[("/big", vec![(0.0, list.clone()), (1.0, list)])],
    );
    let done = analyze(&[&file]);
    assert!(done.status.success(), "{}", text(&done.stderr));
    let said = text(&done.stdout);
    assert!(said.contains("a has more than 64 items"), "{said}");
    let said = text(&analyze(&[&file, "--signal", "*"]).stderr);
    assert!(
        said.contains("a has more than 64 items (the limit --max-items)"),
        "{said}"
    );
    // A table that lacks columns for it says so too.
    let list = format!("{{\"a\":{:?},\"b\":1}}", [1.5; 100]);
    let file = told(
        folder.path(),
        &[("/big", vec![(0.0, list.clone()), (1.0, list)])],
    );
    let table = folder.path().join("x.csv");
    let said = text(&analyze(&[&file, "--out", table.to_str().unwrap()]).stderr);
    assert!(
        said.contains("x.csv: /big: a has more than 64 items (the limit --max-items)"),
        "{said}"
    );
    let keys: Vec<String> = (0..5000).map(|k| format!("\"k{k}\":{k}")).collect();
    let keys = format!("{{{}}}", keys.join(","));
    let file = told(
        folder.path(),
        &[("/keys", vec![(0.0, keys.clone()), (1.0, keys)])],
    );
    let found = json(&[&file, "--format", "json"]);
    let said = &found["quality"][0]["text"];
    assert_eq!(found["quality"][0]["count"], 2);
    assert!(
        said.as_str()
            .unwrap()
            .starts_with("the message itself has more keys than the 4096"),
        "{said}"
    );
}

/// A quaternion that a topic's first messages lack.
#[test]
fn an_orientation_that_comes_late_is_turned_into_angles() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("late.mcap");
    let mut w = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
    let channel = w
        .raw_channel(&recording::write::RawChannel {
            topic: "/pose",
            message_encoding: "json",
            schema_name: "",
            schema_encoding: "",
            schema_data: &[],
            metadata: &Default::default(),
        })
        .unwrap();
    for k in 0..1000i64 {
        let roll = 0.3 * (0.1 * k as f64).sin();
        let (x, w_) = (roll / 2.0).sin_cos();
        let message = match k % 2 == 1 && k > 5 {
            true => format!("{{\"q\":{{\"x\":{x},\"y\":0,\"z\":0,\"w\":{w_}}},\"n\":1}}"),
            false => "{\"n\":1}".to_owned(),
        };
        w.message(channel, k * 10_000_000, message.as_bytes())
            .unwrap();
    }
    w.finish().unwrap();
    let found = json(&[path.to_str().unwrap(), "--format", "json"]);
    let roll = &found["signals"]["/pose.q.roll"];
    assert_eq!(roll["count"], 497, "{roll}");
    assert!((roll["max"].as_f64().unwrap() - 0.3).abs() < 1e-3);
}

/// A table's column by the path of its signal: the value of each row.
#[track_caller]
fn column(table: &Path, path: &str) -> Vec<Option<f64>> {
    let table = std::fs::read_to_string(table).unwrap();
    let mut lines = table
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let names = lines.next().unwrap();
    let is = |name: &&str| name.split(" [").next() == Some(path);
    let mut found = (0..names.len()).filter(|k| is(&names[*k]));
    let k = found
        .next()
        .unwrap_or_else(|| panic!("no {path} in {names:?}"));
    assert_eq!(found.next(), None, "{path} twice");
    lines.map(|line| line[k].parse().ok()).collect()
}

/// Yaw in messages each of which may lack a part of the quaternion.
#[test]
fn angles_are_in_the_messages_that_hold_all_of_a_quaternion() {
    let folder = tempfile::tempdir().unwrap();
    let yaw = |k: u32| 0.01 * f64::from(k);
    let lacks = |k: u32| ["x", "y", "z", "w"][k as usize / 50];
    let message = |k: u32| {
        let (z, w) = (yaw(k) / 2.0).sin_cos();
        let text = format!("{{\"q\":{{\"x\":0.0,\"y\":0.0,\"z\":{z},\"w\":{w}}}}}");
        let text = match k % 50 {
            25 => text.replace(lacks(k), "other"),
            _ => text,
        };
        (yaw(k), text)
    };
    let file = told(folder.path(), &[("/t", (0..200).map(message).collect())]);
    let table = folder.path().join("x.csv");
    let args = [&*file, "--format", "json", "--out", table.to_str().unwrap()];
    assert_eq!(json(&args)["signals"]["/t.q.yaw"]["count"], 196);
    let found = column(&table, "/t.q.yaw");
    assert_eq!(found.len(), 200);
    for (k, found) in (0..).zip(found) {
        assert_eq!(found.is_none(), k % 50 == 25, "{k}");
        assert!(
            found.is_none_or(|found| (found - yaw(k)).abs() < 1e-9),
            "{k}"
        );
    }
}

/// A rath that rolls by 15° at 1 Hz, and an accelerometer that now and then says nothing: what it missed is a hole, not a shift.
#[test]
fn a_sample_that_lacks_a_value_is_a_hole() {
    let folder = tempfile::tempdir().unwrap();
    let message = |k: u32| {
        let t = 0.01 * f64::from(k);
        let turn = std::f64::consts::TAU;
        let (roll, rate) = (
            15f64.to_radians() * tone(1.0, t),
            15f64.to_radians() * turn * (turn * t).cos(),
        );
        let felt = match k % 30 {
            7 => "null,\"y\":null,\"z\":null".to_owned(),
            _ => format!(
                "0,\"y\":{},\"z\":{}",
                9.80665 * roll.sin(),
                9.80665 * roll.cos()
            ),
        };
        let text = format!(
            "{{\"angular_velocity\":{{\"x\":{rate},\"y\":0,\"z\":0}},\"linear_acceleration\":{{\"x\":{felt}}}}}"
        );
        (t, text)
    };
    let file = told(
        folder.path(),
        &[("/imu/rath", (0..6000).map(message).collect())],
    );
    let found = with_roles(folder.path(), &file, "imu = \"/imu/rath\"");
    let roll = metric(&found, "rms_roll_deg");
    // 15°/√2.
    assert!((roll - 10.607).abs() < 0.01, "{roll}");
    assert!(
        kinds(&found).contains(&"left_out".to_owned()),
        "{:?}",
        found["quality"]
    );
    assert!(found["quality"].to_string().contains("200 of 6000 samples"));
}

/// Fields that some messages lack do not make more rows of a thinned topic, nor uneven ones.
#[test]
fn a_topic_is_thinned_by_its_messages() {
    let folder = tempfile::tempdir().unwrap();
    let message = |k: u32| {
        let text = match (k % 3, k % 5) {
            (0, _) => format!("{{\"a\":{k}}}"),
            (_, 0) => format!("{{\"a\":{k},\"b\":1}}"),
            _ => format!("{{\"a\":{k},\"b\":1,\"c\":2}}"),
        };
        (0.01 * f64::from(k), text)
    };
    let slow = |k: u32| (0.002 + 0.1 * f64::from(k), "{\"s\":1}".to_owned());
    let topics = [
        ("/t", (0..600).map(message).collect()),
        ("/s", (0..50).map(slow).collect()),
    ];
    let file = told(folder.path(), &topics);
    let table = folder.path().join("x.csv");
    let out = table.to_str().unwrap();
    assert!(
        analyze(&[&file, "--downsample", "10", "--out", out])
            .status
            .success()
    );
    let found: Vec<f64> = column(&table, "/t.a").into_iter().flatten().collect();
    let expected: Vec<f64> = (0..60).map(|k| f64::from(10 * k)).collect();
    assert_eq!(found, expected);
    assert_eq!(column(&table, "/t.a").len(), 65);
    // A row that another topic keeps at one of its times is none of its own.
    let beside = |k: u32| (0.05 + 0.1 * f64::from(k), "{\"s\":1}".to_owned());
    let topics = [
        ("/t", (0..600).map(message).collect()),
        ("/s", (0..50).map(beside).collect()),
    ];
    let file = told(folder.path(), &topics);
    let done = analyze(&[&file, "--downsample", "10", "--out", out]);
    assert!(done.status.success(), "{}", text(&done.stderr));
    let found: Vec<f64> = column(&table, "/t.a").into_iter().flatten().collect();
    assert_eq!(found, expected);
    assert_eq!(column(&table, "/s.s").into_iter().flatten().count(), 5);
    // Without a table nothing is thinned.
    let alone = analyze(&[&file, "--downsample", "10"]);
    assert_eq!(alone.status.code(), Some(2));
}

/// `/a` with a field `b.x`, and `/a.b` with a field `x`: what the listing lists is what the table holds, by topic and by the name that tells them apart.
#[test]
fn a_table_holds_the_topics_that_were_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let topic =
        |message: fn(u32) -> String| (0..100).map(|k| (0.1 * f64::from(k), message(k))).collect();
    let topics = [
        ("/a", topic(|k| format!("{{\"b\":{{\"x\":{k}}}}}"))),
        (
            "/a.b",
            topic(|k| format!("{{\"x\":{},\"y\":{k}}}", 1000 + k)),
        ),
        ("/forces", topic(|k| format!("{{\"n\":{k}}}"))),
        ("/left", topic(|k| format!("{{\"force\":{{\"z\":{k}}}}}"))),
    ];
    let file = told(folder.path(), &topics);
    let table = folder.path().join("x.csv");
    for (asked, held) in [
        (["--topic", "/a"], &["/a.b.x"][..]),
        (["--topic", "/a.b"], &["/a.b.y", "/a.b:x"]),
        (["--topic", "*force*"], &["/forces.n"]),
        (["--signal", "/a.b:x"], &["/a.b:x"]),
    ] {
        let out = ["--format", "json", "--out", table.to_str().unwrap()];
        let found = json(&[&[&*file], &asked[..], &out].concat());
        let listed: Vec<&String> = found["signals"].as_object().unwrap().keys().collect();
        assert_eq!(listed, held, "{asked:?}");
        let written = std::fs::read_to_string(&table).unwrap();
        let names = written.lines().next().unwrap().split(',').skip(2);
        assert_eq!(names.collect::<Vec<_>>(), held, "{asked:?}");
    }
    let x = column(&table, "/a.b:x");
    assert_eq!((x[0], x[99]), (Some(1000.0), Some(1099.0)));
}

/// Messages of one time have a row each, whatever their fields are, and from whichever channel of the topic they come; other topics stand in the first. What is
/// not finite is written as that, and is not what is not there.
#[test]
fn messages_of_one_time_have_a_row_each() {
    let folder = tempfile::tempdir().unwrap();
    let at = |t: f64, texts: &[&str]| -> Vec<(f64, String)> {
        texts.iter().map(|x| (t, (*x).to_owned())).collect()
    };
    let one = [
        at(0.0, &[r#"{"a":1,"b":10}"#, r#"{"a":2}"#]),
        at(
            0.1,
            &[r#"{"a":3}"#, r#"{"b":31}"#, r#"{"a":NaN,"b":-Infinity}"#],
        ),
    ];
    let topics = [
        ("/t", one.concat()),
        ("/t", at(0.1, &[r#"{"a":4}"#])),
        (
            "/s",
            [at(0.0, &[r#"{"s":5}"#]), at(0.1, &[r#"{"s":6}"#])].concat(),
        ),
    ];
    let file = told(folder.path(), &topics);
    let table = folder.path().join("x.csv");
    let done = analyze(&[&file, "--out", table.to_str().unwrap()]);
    assert!(done.status.success(), "{}", text(&done.stderr));
    let written = std::fs::read_to_string(&table).unwrap();
    let rows: Vec<&str> = (written.lines().skip(1))
        .map(|line| line.splitn(3, ',').last().unwrap())
        .collect();
    assert_eq!(rows, ["5,1,10", ",2,", "6,3,", ",,31", ",NaN,-inf", ",4,"]);
}

/// Messages that tell the angles of their quaternion themselves, in degrees; the first ones do not.
#[test]
fn fields_go_before_angles_of_their_name() {
    let folder = tempfile::tempdir().unwrap();
    let message = |k: u32| {
        let (z, w) = (0.005 * f64::from(k)).sin_cos();
        let own = format!(",\"yaw\":{}", 1000 + k);
        let own = if k < 300 { "" } else { &own };
        let text = format!("{{\"q\":{{\"x\":0.0,\"y\":0.0,\"z\":{z},\"w\":{w}{own}}}}}");
        (0.01 * f64::from(k), text)
    };
    let file = told(folder.path(), &[("/t", (0..600).map(message).collect())]);
    let table = folder.path().join("x.csv");
    let out = analyze(&[&file, "--format", "json", "--out", table.to_str().unwrap()]);
    let said = text(&out.stdout);
    assert_eq!(said.matches("\"/t.q.yaw\"").count(), 1, "{said}");
    let found: Value = serde_json::from_str(&said).unwrap();
    let found = &found["signals"];
    assert_eq!(found["/t.q.roll"]["count"], 600);
    let yaw = &found["/t.q.yaw"];
    assert_eq!((&yaw["count"], &yaw["min"]), (&300.into(), &1300.0.into()));
    let found = column(&table, "/t.q.yaw");
    assert_eq!((found[299], found[300]), (None, Some(1300.0)));
}

#[test]
fn a_finding_says_where_and_when_once() {
    let folder = tempfile::tempdir().unwrap();
    let message = |k: u32| {
        let x = if (300..340).contains(&k) {
            "NaN"
        } else {
            "1.5"
        };
        (f64::from(k) / 100.0, format!("{{\"x\":{x}}}"))
    };
    let file = told(folder.path(), &[("/arm", (0..1000).map(message).collect())]);
    let out = analyze(&[&file]);
    let said = text(&out.stdout);
    let line = said.lines().find(|l| l.contains("NaN")).unwrap();
    assert_eq!(
        line,
        "  – /arm: 40 values of x are NaN or infinite, first at 3.000 s"
    );
}

/// What has no unit shares a scale with what is alike large only, and no panel uses a colour twice.
/// A swing of two minutes with a hole of twelve seconds and one value that is none: the spectrogram is blank where most of a segment of eight seconds was not
/// measured and has the line's strength elsewhere, the portrait is broken in the hole.
#[test]
fn what_was_not_measured_is_not_drawn() {
    use analyze::report::plots::{Plot, plots};
    let folder = tempfile::tempdir().unwrap();
    let message = |k: u32| {
        let t = f64::from(k) / 50.0;
        let roll = match k {
            900 => "NaN".to_owned(),
            _ => (0.2 * tone(1.0, t)).to_string(),
        };
        (t, format!("{{\"roll\":{roll}}}"))
    };
    let there = |k: &u32| !(2500..3100).contains(k);
    let messages = (0..6000).filter(there).map(message).collect();
    let file = told(folder.path(), &[("/m", messages)]);
    let roles = folder.path().join("roles.toml");
    std::fs::write(&roles, "roll = \"/m.roll\"\n").unwrap();
    let opened = Recording::open(Path::new(&file), &Default::default()).unwrap();
    let request = analyze::request::Request {
        roles: Some(analyze::roles::RolesFile::read(&roles).unwrap()),
        ..Default::default()
    };
    let found = analyze::examine::examine("told", &opened, &request).unwrap();
    let (mut images, mut portraits) = (0, 0);
    for plot in plots(&found) {
        match plot {
            Plot::Image(i) => {
                images += 1;
                let step_s = (i.x_range.1 - i.x_range.0) / i.values.len() as f64;
                for (k, column) in i.values.iter().enumerate() {
                    let middle_s = i.x_range.0 + (k as f64 + 0.5) * step_s;
                    let most = column.iter().copied().fold(f64::NAN, f64::max);
                    if (middle_s - 56.0).abs() < 5.5 {
                        assert!(most.is_nan(), "{middle_s}: {most}");
                    } else if (middle_s - 56.0).abs() > 6.5 {
                        // 11.5° at 1 Hz, in a line of 0.19 Hz.
                        assert!((most - 25.5).abs() < 3.0, "{middle_s}: {most}");
                    }
                }
            }
            Plot::Panel(p) if p.id == "portrait" => {
                portraits += 1;
                let y = &p.series[0].y;
                assert_eq!(y.iter().filter(|y| y.is_nan()).count(), 1);
                assert_eq!(p.series[0].x.len(), y.len());
            }
            Plot::Panel(_) => {}
        }
    }
    assert_eq!((images, portraits), (1, 1));
}

#[test]
fn signals_share_a_panel_where_one_scale_shows_them() {
    let folder = tempfile::tempdir().unwrap();
    let message = |k: u32| {
        let t = f64::from(k) / 50.0;
        let small = (0..9).map(|i| format!("\"v{i}\":{}", 1.0 + 0.1 * tone(f64::from(i + 1), t)));
        let rest = format!(
            "\"rpm\":{},\"torque\":{}",
            3000.0 + t,
            500.0 + 30.0 * tone(2.0, t)
        );
        let fields: Vec<String> = small.chain([rest]).collect();
        (t, format!("{{{}}}", fields.join(",")))
    };
    let file = told(folder.path(), &[("/m", (0..500).map(message).collect())]);
    let opened = Recording::open(Path::new(&file), &Default::default()).unwrap();
    let request = analyze::request::Request {
        traces: true,
        ..Default::default()
    };
    let found = analyze::examine::examine("told", &opened, &request).unwrap();
    let panels: Vec<Vec<&str>> = found
        .traces
        .iter()
        .map(|t| t.series.iter().map(|(name, ..)| &name[..]).collect())
        .collect();
    assert_eq!(
        panels,
        [
            vec!["rpm", "torque"],
            vec!["v0", "v1", "v2", "v3", "v4", "v5", "v6"],
            vec!["v7", "v8"]
        ]
    );
    assert_eq!(found.undrawn, 0);
}

#[test]
fn a_report_is_one_page_that_loads_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(folder.path());
    let page = folder.path().join("x.html");
    let out = analyze(&[file.to_str().unwrap(), "--report", page.to_str().unwrap()]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.len() < 3_000_000, "{}", html.len());
    for outside in ["src=\"http", "href=\"http", "@import", "url(http"] {
        assert!(!html.contains(outside), "{outside}");
    }
    for metric in analyze::metrics::METRICS {
        assert!(html.contains(metric.name), "{}", metric.name);
    }
    assert!(html.contains("--report") && html.contains("Spectrogram"));
}

#[test]
fn bad_input_gets_one_clear_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let no_mcap = folder.path().join("text.mcap");
    std::fs::write(&no_mcap, "hello, I am text").unwrap();
    let empty = folder.path().join("empty.mcap");
    std::fs::write(&empty, "").unwrap();
    let bare = folder.path().join("bare.mcap");
    RecordingWriter::create(&bare, &WriterOptions::default())
        .unwrap()
        .finish()
        .unwrap();
    // Every chunk is hit.
    let spoilt = folder.path().join("spoilt.mcap");
    let mut bytes = std::fs::read(recording(folder.path())).unwrap();
    for at in (1000..bytes.len()).step_by(5000) {
        bytes[at] ^= 4;
    }
    std::fs::write(&spoilt, bytes).unwrap();
    for (file, said) in [
        (folder.path().join("nowhere.mcap"), "cannot be read"),
        (no_mcap, "not an MCAP"),
        (empty, "is empty"),
        (folder.path().to_owned(), "folder"),
        (bare, "holds no messages"),
        (spoilt, "none of its messages can be read; the chunk"),
    ] {
        let out = analyze(&[file.to_str().unwrap()]);
        assert_eq!(out.status.code(), Some(1), "{}", file.display());
        let error = text(&out.stderr);
        assert!(
            error.starts_with("analyze: ") && error.contains(said) && out.stdout.is_empty(),
            "{error}"
        );
    }
    assert_eq!(analyze(&[]).status.code(), Some(2));
    for wrong in ["nan", "-inf", "2e6", "soon"] {
        let args = ["ingest", "x.wav", "--out", "x.mcap", "--sound-start", wrong];
        assert_eq!(analyze(&args).status.code(), Some(2), "{wrong}");
    }
    assert_eq!(
        analyze(&["x.mcap", "--window", "60..15"]).status.code(),
        Some(2)
    );
    let typo = analyze(&["x.mcap", "--repot", "x.html"]);
    assert!(
        typo.status.code() == Some(2) && text(&typo.stderr).contains("--report"),
        "{}",
        text(&typo.stderr)
    );
}

#[test]
fn damage_is_said_and_survived() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(folder.path());
    let bytes = std::fs::read(&file).unwrap();
    let cut = folder.path().join("cut.mcap");
    std::fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).unwrap();
    let out = analyze(&[cut.to_str().unwrap(), "--format", "json"]);
    assert_eq!(out.status.code(), Some(3), "{}", text(&out.stderr));
    let v: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(v["recording"]["salvaged"], true);
    assert!(
        text(&out.stderr).contains("damaged"),
        "{}",
        text(&out.stderr)
    );
}

/// The paper's runs through files: ingested, analysed, and every statistic found again.
#[test]
#[ignore = "needs the paper's archive, which is not shipped: see the head of archive.rs"]
fn archive_logs_survive_being_ingested() {
    let archive = archive_names::folder();
    let folder = tempfile::tempdir().unwrap();
    let mcap = folder.path().join("run.mcap");
    let mcap = mcap.to_str().unwrap();
    let mut runs = 0;
    for condition in ["baseline", "music"] {
        for run in std::fs::read_dir(archive.join(condition)).unwrap() {
            let run = run.unwrap().path();
            let log = run.join("logs.npz");
            let out = analyze(&["ingest", log.to_str().unwrap(), "--out", mcap]);
            assert!(out.status.success(), "{}", text(&out.stderr));
            let v = json(&[mcap, "--format", "json"]);
            let stats: Value =
                serde_json::from_str(&std::fs::read_to_string(run.join("stats.json")).unwrap())
                    .unwrap();
            let m = &v["metrics"];
            for (ours, theirs) in archive_names::NUMBERS {
                let (a, b) = (
                    m[ours]["value"].as_f64().unwrap(),
                    stats[theirs].as_f64().unwrap(),
                );
                assert!(
                    (a - b).abs() <= 1e-9 * b.abs(),
                    "{} {ours}: {a} {b}",
                    run.display()
                );
            }
            for (ours, theirs) in archive_names::PER_HANDLE {
                for (a, b) in m[ours]["per"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .zip(stats[theirs].as_array().unwrap())
                {
                    let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
                    assert!(
                        (a - b).abs() <= 1e-9 * b.abs(),
                        "{} {ours}: {a} {b}",
                        run.display()
                    );
                }
            }
            let onset = stats["uncontrolled_onset_time"].as_f64().unwrap();
            match m["onset_time_s"]["value"].as_f64() {
                Some(t) => assert!((t - onset).abs() <= 1e-9 * onset, "{}", run.display()),
                None => assert_eq!(onset, -1.0, "{}", run.display()),
            }
            assert_eq!(
                m["mechanism"]["value"],
                if condition == "music" {
                    "parametric"
                } else {
                    "quiet"
                },
                "{}",
                run.display()
            );
            runs += 1;
        }
    }
    println!("{runs} runs");
}

/// docs/metrics.md says of every metric what the program says.
#[test]
fn the_documentation_names_every_metric() {
    let docs = std::fs::read_to_string(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/metrics.md"),
    )
    .unwrap();
    for metric in analyze::metrics::METRICS {
        assert!(
            docs.contains(&format!("`{}`", metric.name)),
            "{} is missing",
            metric.name
        );
        let definition = metric.definition.replace('|', "\\|");
        assert!(
            docs.contains(&definition),
            "{}: docs/metrics.md does not say: {definition}",
            metric.name
        );
    }
}

/// A lean to the left by 15° is one of 345°.
#[test]
fn angles_may_be_told_from_nought_to_a_turn() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("turn.mcap");
    let mut w = RecordingWriter::create(&file, &WriterOptions::default()).unwrap();
    let names = ["/roll", "/pitch"];
    let channels = names.map(|name| w.channel(name, MessageKind::Float64).unwrap());
    for k in 0..1800i64 {
        // The pitch comes between two of the roll.
        for (j, channel) in channels.iter().enumerate() {
            let t_ns = k * 1_000_000_000 / 30 + 15_000_000 * j as i64;
            let sway = 15.0 * (std::f64::consts::TAU * 0.5 * t_ns as f64 / 1e9).sin();
            let data = sway.rem_euclid(360.0);
            w.message(*channel, t_ns, &Float64 { data }).unwrap();
        }
    }
    w.finish().unwrap();
    let roles = folder.path().join("roles.toml");
    let said = "roll = \"/roll.data\"\npitch = \"/pitch.data\"\nangle_unit = \"deg\"\n";
    std::fs::write(&roles, said).unwrap();
    let args = [file.to_str().unwrap(), "--roles", roles.to_str().unwrap()];
    let found = json(&[&args[..], &["--format", "json"]].concat());
    for name in ["rms_roll_deg", "rms_pitch_deg"] {
        let rms = found["metrics"][name]["value"].as_f64().unwrap();
        assert!((rms - 15.0 / 2f64.sqrt()).abs() < 0.03, "{name}: {rms}");
    }
}

/// Unwrapped, three samples a second tell of two turns; and lost messages of a beat on a topic of its own are no pause.
#[test]
fn a_beat_on_a_topic_of_its_own_is_as_good_as_beside_the_phases() {
    let folder = tempfile::tempdir().unwrap();
    let tau = std::f64::consts::TAU;
    let roles = folder.path().join("roles.toml");
    std::fs::write(
        &roles,
        "phases = [\"/a.data\", \"/b.data\"]\nbeat_phase = \"/beat.data\"\n",
    )
    .unwrap();
    // The fuller of the phases gives the times, whichever is named first.
    for (rate_hz, fuller_hz) in [(3, 3), (30, 30), (30, 50)] {
        let file = folder.path().join("own.mcap");
        let mut w = RecordingWriter::create(&file, &WriterOptions::default()).unwrap();
        let names = ["/a", "/b", "/beat"];
        let channels = names.map(|name| w.channel(name, MessageKind::Float64).unwrap());
        let mut all = Vec::new();
        for (j, hz) in [rate_hz, fuller_hz, rate_hz].into_iter().enumerate() {
            let times = (0..60 * hz).map(|k| k * 1_000_000_000 / hz + 5_000_000 * j as i64);
            all.extend(times.map(|t_ns| (t_ns, j)));
        }
        all.sort_unstable();
        for (t_ns, j) in all {
            let t = t_ns as f64 / 1e9;
            if names[j] == "/beat" && (20.0..23.0).contains(&t) {
                continue;
            }
            let data = tau * 2.03 * t + 0.1 * j as f64;
            w.message(channels[j], t_ns, &Float64 { data }).unwrap();
        }
        w.finish().unwrap();
        let args = [file.to_str().unwrap(), "--roles", roles.to_str().unwrap()];
        let found = json(&[&args[..], &["--format", "json"]].concat());
        for (name, truth) in [
            ("beat_synchrony", 1.0),
            ("beat_hz", 2.03),
            ("synchrony", 0.05f64.cos()),
        ] {
            let value = found["metrics"][name]["value"].as_f64().unwrap();
            assert!((value - truth).abs() < 1e-6, "{rate_hz} {name}: {value}");
        }
        let events = found["events"].as_array().unwrap();
        let ends = events.iter().filter(|e| e["kind"] == "beat_end").count();
        assert_eq!(ends, 0, "{events:?}");
    }
}

#[test]
fn topics_of_other_times_meet_where_both_have_samples() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("apart.mcap");
    let mut w = RecordingWriter::create(&file, &WriterOptions::default()).unwrap();
    let names = ["/a", "/b", "/beat", "/left", "/right"];
    let channels = names.map(|name| w.channel(name, MessageKind::Float64).unwrap());
    let tau = std::f64::consts::TAU;
    let wrapped = |x: f64| (x + tau / 2.0).rem_euclid(tau) - tau / 2.0;
    for k in 0..1801i64 {
        for (j, channel) in channels.iter().enumerate() {
            // Each topic a few milliseconds behind the one before; the right handle falls silent half way.
            let t_ns = k * 1_000_000_000 / 30 + 5_000_000 * j as i64;
            let t = t_ns as f64 / 1e9;
            if names[j] == "/right" && t > 30.0 {
                continue;
            }
            let data = match names[j] {
                "/left" | "/right" => (300.0 + 350.0 * (tau * 2.0 * t).sin()).max(0.0),
                _ => wrapped(tau * 2.03 * t),
            };
            w.message(*channel, t_ns, &Float64 { data }).unwrap();
        }
    }
    w.finish().unwrap();
    let roles = folder.path().join("roles.toml");
    std::fs::write(
        &roles,
        "phases = [\"/a.data\", \"/b.data\"]\nbeat_phase = \"/beat.data\"\nforces = [\"/left.data\", \"/right.data\"]\n",
    )
    .unwrap();
    let args = [file.to_str().unwrap(), "--roles", roles.to_str().unwrap()];
    let all = json(&[&args[..], &["--format", "json"]].concat());
    let number = |v: &Value, name: &str| v["metrics"][name]["value"].as_f64();
    for (name, truth) in [
        ("synchrony", 1.0),
        ("plv", 1.0),
        ("beat_synchrony", 1.0),
        ("beat_hz", 2.03),
    ] {
        let found = number(&all, name).unwrap();
        assert!((found - truth).abs() < 1e-6, "{name}: {found}");
    }
    // Over the half in which both press, 1 and not what a held force makes of it.
    assert!(number(&all, "force_correlation").unwrap() > 0.99);
    let late = json(&[&args[..], &["--format", "json", "--window", "35..60"]].concat());
    assert_eq!(number(&late, "contact_loss_mean"), None);
    assert!(late["metrics"]["contact_loss_mean"]["reason"].is_string());
    // Thinned, every topic keeps rows.
    let table = folder.path().join("thin.csv");
    let out = analyze(&[
        args[0],
        "--downsample",
        "2",
        "--out",
        table.to_str().unwrap(),
    ]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let table = std::fs::read_to_string(&table).unwrap();
    for column in 2..7 {
        let filled = |line: &&str| !line.split(',').nth(column).unwrap().is_empty();
        let rows = table.lines().skip(1).filter(filled).count();
        assert!((450..=901).contains(&rows), "{column}: {rows}");
    }
}

/// A gyroscope of ±125 °/s on what turns by 145 °/s: the roll is too small, and no interval may say otherwise.
#[test]
fn a_sensor_that_came_to_its_end_gives_no_interval() {
    let folder = tempfile::tempdir().unwrap();
    let message = |k: u32| {
        let t = 0.01 * f64::from(k);
        let (w, g) = (std::f64::consts::TAU, 9.80665);
        let turn = f64::from(if k < 2500 { 10 } else { 23 }).to_radians();
        let roll = turn * (w * t).sin();
        let rate = (turn * w * (w * t).cos()).clamp(-2.18, 2.18);
        let text = format!(
            "{{\"angular_velocity\":{{\"x\":{rate},\"y\":0.0,\"z\":0.0}},\
             \"linear_acceleration\":{{\"x\":0.0,\"y\":{},\"z\":{}}}}}",
            g * roll.sin(),
            g * roll.cos()
        );
        (t, text)
    };
    let file = told(folder.path(), &[("/s", (0..6000).map(message).collect())]);
    let found = with_roles(folder.path(), &file, "imu = \"/s\"\n");
    let remark = found["quality"]
        .as_array()
        .unwrap()
        .iter()
        .find(|q| q["kind"] == "saturated");
    let text = remark.expect("saturated")["text"].as_str().unwrap();
    assert!(
        text.starts_with("the gyroscope came to its end at 2.180 rad/s in "),
        "{text}"
    );
    let roll = &found["metrics"]["rms_roll_deg"];
    assert!(roll["ci95"].is_null(), "{roll}");
    assert!(
        roll["reason"]
            .as_str()
            .unwrap()
            .contains("the gyroscope came to the end of its range"),
        "{roll}"
    );
    let doubt = "/s is in doubt (saturated, see the quality of the data): numbers that hang on that may be far off and have no interval";
    assert_eq!(found["recording"]["warnings"], serde_json::json!([doubt]));
    let roles = folder.path().join("roles.toml").display().to_string();
    // Before it came there, nothing is missing.
    let calm = json(&[
        &file, "--format", "json", "--window", "0..20", "--roles", &roles,
    ]);
    assert!(calm["metrics"]["rms_roll_deg"]["ci95"].is_array());
}

/// Messages of a load that sways by 17° (RMS) and heaves, its sensor turned over its x by so much at a time.
fn swaying(turned_rad: impl Fn(f64) -> f64) -> Vec<(f64, String)> {
    let (w, g) = (std::f64::consts::TAU, 9.80665);
    let roll = |t: f64| 0.42 * (1.07 * w * t).sin() + turned_rad(t);
    let message = |k: u32| {
        let t = 0.01 * f64::from(k);
        let rate = (roll(t + 1e-4) - roll(t - 1e-4)) / 2e-4;
        let up = g + 9.0 * (2.14 * w * t).sin();
        (t, inertial(rate, [up * roll(t).sin(), up * roll(t).cos()]))
    };
    (0..6000).map(message).collect()
}

fn inertial(rate: f64, [y, z]: [f64; 2]) -> String {
    format!(
        "{{\"angular_velocity\":{{\"x\":{rate},\"y\":0.001,\"z\":0.0}},\
         \"linear_acceleration\":{{\"x\":0.0,\"y\":{y},\"z\":{z}}}}}"
    )
}

/// One message of zeros, one of a bit that fell over, one of a gyroscope at its end: what they say is not taken for motion.
#[test]
fn samples_that_nothing_carried_could_feel_count_as_lost() {
    let folder = tempfile::tempdir().unwrap();
    let sound = swaying(|_| 0.0);
    let mut bad = sound.clone();
    bad[2015].1 = inertial(0.0, [0.0, 0.0]);
    bad[3000].1 = inertial(0.1, [-1500.0, 700.0]);
    bad[4000].1 = inertial(34.9, [0.0, 9.8]);
    let roles = "imu = \"/s\"\n";
    let [sound, bad] = [sound, bad].map(|messages| {
        let file = told(folder.path(), &[("/s", messages)]);
        with_roles(folder.path(), &file, roles)
    });
    assert!(!kinds(&sound).contains(&"stray".to_owned()), "{sound}");
    let all = bad["quality"].as_array().unwrap();
    let stray: Vec<&Value> = all.iter().filter(|q| q["kind"] == "stray").collect();
    assert_eq!(stray.len(), 1, "{all:?}");
    assert!(
        stray[0]["count"] == 3 && stray[0]["t_s"] == 20.15,
        "{stray:?}"
    );
    for (name, within) in [("rms_roll_deg", 1e-3), ("dz_pp_m", 1e-3), ("t_float", 1e-3)] {
        let (x, y) = (metric(&sound, name), metric(&bad, name));
        assert!((x - y).abs() < within, "{name}: {x} {y}");
    }
}

/// A sensor that slips by 25° is told with its moment, and what rests on it has no interval; one that stays is not.
#[test]
fn a_sensor_that_slips_in_its_mounting_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let slip = |t: f64| 25f64.to_radians() * ((t - 37.0) / 0.5).clamp(0.0, 1.0);
    for (messages, slips) in [(swaying(|_| 0.0), false), (swaying(slip), true)] {
        let file = told(folder.path(), &[("/s", messages)]);
        let found = with_roles(
            folder.path(),
            &file,
            "imu = \"/s\"\nanalysis_start_s = 10.0\n",
        );
        let roll = &found["metrics"]["rms_roll_deg"];
        let all = found["quality"].as_array().unwrap();
        let said: Vec<&Value> = all.iter().filter(|q| q["kind"] == "turned").collect();
        assert_eq!(
            (said.len(), roll["ci95"].is_null()),
            (usize::from(slips), slips),
            "{all:?}"
        );
        if slips {
            let text = said[0]["text"].as_str().unwrap();
            assert!(
                text.starts_with("from 37 s on gravity lies 25° elsewhere"),
                "{text}"
            );
            let why = roll["reason"].as_str().unwrap();
            assert!(
                why.starts_with("without an interval: the accelerometer shows gravity elsewhere"),
                "{why}"
            );
        }
    }
}

/// An accelerometer that stops at 30 s, a gyroscope whose y has died: both are told, and the first leaves no interval.
#[test]
fn a_sensor_that_stands_still_in_motion_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let stopped = |k: u32| {
        let (w, g) = (std::f64::consts::TAU, 9.80665);
        let at = |k: u32| 0.01 * f64::from(k);
        let roll = |t: f64| 0.2 * (w * t).sin();
        let t = at(k);
        let felt = at(k.min(3000));
        let rate = 0.2 * w * (w * t).cos();
        let text = format!(
            "{{\"angular_velocity\":{{\"x\":{rate},\"y\":0.0,\"z\":{}}},\
             \"linear_acceleration\":{{\"x\":0.0,\"y\":{},\"z\":{}}}}}",
            0.3 * (0.7 * w * t).sin(),
            g * roll(felt).sin(),
            g * roll(felt).cos()
        );
        (t, text)
    };
    let file = told(folder.path(), &[("/s", (0..6000).map(stopped).collect())]);
    let found = with_roles(folder.path(), &file, "imu = \"/s\"\n");
    let quality = found["quality"].as_array().unwrap();
    let frozen: Vec<(&str, u64)> = quality
        .iter()
        .filter(|q| q["kind"] == "frozen")
        .map(|q| (q["text"].as_str().unwrap(), q["count"].as_u64().unwrap()))
        .collect();
    assert_eq!(frozen.len(), 2, "{frozen:?}");
    assert!(
        frozen[0].0.starts_with("the gyroscope's y never changes"),
        "{frozen:?}"
    );
    assert!(
        frozen[1]
            .0
            .starts_with("the accelerometer gives one reading")
            && frozen[1].1 == 3000,
        "{frozen:?}"
    );
    let roll = &found["metrics"]["rms_roll_deg"];
    assert!(roll["ci95"].is_null(), "{roll}");
    let roles = folder.path().join("roles.toml").display().to_string();
    let before = json(&[
        &file, "--format", "json", "--window", "0..29", "--roles", &roles,
    ]);
    assert!(before["metrics"]["rms_roll_deg"]["ci95"].is_array());
}

/// A message on `/beat` is a beat, whatever it holds: nothing, or a stamp that knows better than the log when it was.
#[test]
fn every_message_on_beat_is_one() {
    let folder = tempfile::tempdir().unwrap();
    let swings = || {
        (0..6000)
            .map(|k| f64::from(k) * 0.01)
            .map(|t| (t, swung(t)))
    };
    let bare = |k: u32| (0.5 * f64::from(k), "{\"by\":\"drum\"}".to_owned());
    let late = |k: u32| {
        let t = 0.5 * f64::from(k);
        let (sec, nanosec) = (t.floor(), 1e9 * t.fract());
        let text = format!("{{\"header\":{{\"stamp\":{{\"sec\":{sec},\"nanosec\":{nanosec}}}}}}}");
        (t + 0.05 + 0.04 * tone(0.31, t), text)
    };
    for beats in [
        (8..100).map(bare).collect::<Vec<_>>(),
        (8..100).map(late).collect(),
    ] {
        let file = told(
            folder.path(),
            &[("/s", swings().collect()), ("/beat", beats)],
        );
        let found = with_roles(folder.path(), &file, "imu = \"/s\"\n");
        assert!(
            (metric(&found, "beat_hz") - 2.0).abs() < 1e-4,
            "{}",
            found["metrics"]["beat_hz"]
        );
        let ci95 = &found["metrics"]["beat_hz"]["ci95"];
        let half = 0.5 * (ci95[1].as_f64().unwrap() - ci95[0].as_f64().unwrap());
        assert!(half < 1e-4, "{ci95}");
    }
}

/// Who looks in too late is told so.
#[test]
fn an_onset_before_the_window_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let swings = (0..6000).map(|k| f64::from(k) * 0.01);
    let file = told(
        folder.path(),
        &[("/s", swings.map(|t| (t, swung(t))).collect())],
    );
    let found = with_roles(
        folder.path(),
        &file,
        "imu = \"/s\"\nanalysis_start_s = 20.0\n",
    );
    let onset = &found["metrics"]["onset_time_s"];
    assert!(
        (onset["value"].as_f64().unwrap() - 22.0).abs() < 0.05,
        "{onset}"
    );
    assert!(
        onset["reason"]
            .as_str()
            .unwrap()
            .contains("may have begun before"),
        "{onset}"
    );
    // People are told what scripts are; what is said of several numbers, once.
    let roles = folder.path().join("roles.toml");
    let out = analyze(&[&file, "--roles", roles.to_str().unwrap()]);
    let table = text(&out.stdout);
    let words: Vec<&str> = table.split_whitespace().collect();
    let table = words.join(" ");
    for said in [
        "may have begun before",
        "dz_pp_m, rms_z_m, growth_ratio: of what heaves faster than",
        "t_float, h2_ratio: as if the sensor sat at the centre of mass",
    ] {
        assert_eq!(table.matches(said).count(), 1, "{said}: {table}");
    }
    assert_eq!(table.matches("of what heaves faster").count(), 1, "{table}");
}

/// A recording is not written under the name of a table.
#[test]
fn a_recording_is_not_named_a_table() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(folder.path());
    let name = file.to_str().unwrap();
    let log = folder.path().join("belt.csv");
    std::fs::write(&log, "time,gFx,gFy,gFz\n0,0,0,1\n0.01,0,0,1\n").unwrap();
    let (log, table) = (log.to_str().unwrap(), folder.path().join("x.CSV"));
    let table = table.to_str().unwrap();
    for args in [
        &["ingest", log, "--out", table][..],
        &[name, "--annotate", table],
    ] {
        let out = analyze(args);
        let said = text(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{said}");
        assert!(
            said.lines().count() == 1 && said.contains("ends in .mcap"),
            "{said}"
        );
        assert!(!Path::new(table).exists());
    }
    let plain = folder.path().join("walk.2026-11-27");
    assert!(
        analyze(&["ingest", log, "--out", plain.to_str().unwrap()])
            .status
            .success()
    );
}

/// Sensors of a type that nobody knows, by their names on those who carry, are told of with the line that names them all.
#[test]
fn carriers_of_an_unknown_type_are_told_with_their_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let swings = || {
        (0..2000)
            .map(|k| f64::from(k) * 0.01)
            .map(|t| (t, swung(t)))
            .collect()
    };
    let channels = ["/imu/carrier_1", "/imu/carrier_2", "/imu/rath"].map(|t| (t, swings()));
    let file = told(folder.path(), &channels);
    let found = json(&[&file, "--format", "json"]);
    let line = "carriers = [\"/imu/carrier_1\", \"/imu/carrier_2\"]";
    let said = |topic: &str| {
        let quality = found["quality"].as_array().unwrap();
        let of = |q: &&Value| q["kind"] == "unknown_type" && q["topic"] == topic;
        quality.iter().find(of).unwrap()["text"]
            .as_str()
            .unwrap()
            .to_owned()
    };
    for topic in ["/imu/carrier_1", "/imu/carrier_2"] {
        assert!(said(topic).contains(line), "{}", said(topic));
    }
    assert!(said("/imu/rath").contains("imu = \"/imu/rath\""));
    let roles = format!("imu = \"/imu/rath\"\n{line}\n");
    let named = with_roles(folder.path(), &file, &roles);
    assert!(!kinds(&named).contains(&"unknown_type".to_owned()));
}

#[test]
fn the_parts_of_a_bag_are_merged() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("bag")).unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    for part in 0..3 {
        let file = path(&format!("bag/bag_{part}.mcap"));
        let mut w = RecordingWriter::create(Path::new(&file), &WriterOptions::default()).unwrap();
        let x = w.channel("/x", MessageKind::Float64).unwrap();
        for k in 0..1000 {
            let tick = 1000 * part + k;
            let data = (0.02 * tick as f64).sin();
            w.message(x, tick * 10_000_000, &Float64 { data }).unwrap();
        }
        w.finish().unwrap();
    }
    let bag = path("bag");
    let told = analyze(&[&bag]);
    assert_eq!(told.status.code(), Some(1));
    let advice =
        format!("`analyze merge {bag} --out FILE.mcap` makes one recording of the 3 in it");
    assert!(
        text(&told.stderr).contains(&advice),
        "{}",
        text(&told.stderr)
    );

    let whole = path("whole.mcap");
    let refused = analyze(&["merge", &bag, "--out", &path("bag/bag_0.mcap")]);
    assert_eq!(refused.status.code(), Some(2), "it lies in the folder");
    let merged = analyze(&["merge", &bag, "--out", &whole]);
    let said = text(&merged.stderr);
    assert_eq!(
        said,
        format!("analyze: {whole} written: 3000 messages of 3 recordings\n")
    );
    assert!(merged.status.success());
    let found = json(&[&whole, "--signal", "/x.data", "--format", "json"]);
    assert_eq!(found["recording"]["messages"], 3000);
    assert!(
        found["quality"].as_array().unwrap().is_empty(),
        "no hole, nothing late"
    );
    let piped = analyze(&["merge", &bag, "--out", "-"]);
    assert!(piped.stdout == std::fs::read(&whole).unwrap());

    let last = path("bag/bag_2.mcap");
    let bytes = std::fs::read(&last).unwrap();
    std::fs::write(&last, &bytes[..bytes.len() / 2]).unwrap();
    let merged = analyze(&["merge", &bag, "--out", &whole]);
    assert_eq!(merged.status.code(), Some(3));
    assert!(
        text(&merged.stderr).contains("bag_2.mcap: "),
        "{}",
        text(&merged.stderr)
    );
}

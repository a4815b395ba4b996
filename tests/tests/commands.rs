//! The commands as a person would run them: in an empty folder, on real files.

use serde_json::Value;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tests::{bin, files, good, json, run_in};

#[test]
fn a_scene_becomes_a_recording_and_the_recording_findings() {
    let folder = tempfile::tempdir().expect("a folder");
    good(run_in(folder.path(), "sim", &["record"]));
    assert_eq!(files(folder.path()), ["music-1001.mcap"]);
    let found = json(&good(run_in(
        folder.path(),
        "analyze",
        &["music-1001.mcap", "--format", "json"],
    )));
    assert_eq!(found["window_s"], serde_json::json!([15.0, 60.0]));
    assert_eq!(found["samples"], 1801);
    let metric = |name: &str| {
        found["metrics"][name]["value"]
            .as_f64()
            .unwrap_or_else(|| panic!("{name} is missing"))
    };
    assert!(metric("synchrony") > 0.95);
    assert!((metric("synchrony_chance") - 2.0 / std::f64::consts::PI).abs() < 1e-12);
    assert!((metric("peak_hz") - 2.1507).abs() < 0.03);
    assert_eq!(found["metrics"]["mechanism"]["value"], "parametric");
    assert_eq!(found["metrics"]["unstable"]["value"], true);
    assert!(!found.to_string().contains("NaN"));
    let outside = ["music-1001.mcap", "--window", "100..200"];
    let out = run_in(folder.path(), "analyze", &outside);
    assert_eq!(out.status.code(), Some(1));
    assert!(out.stdout.is_empty());
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    let sentence = "analyze: music-1001.mcap: the window from 100 to 200 s is outside the recording, which lasts 60.000 s: nothing of it can be analysed";
    assert_eq!(said.lines().next(), Some(sentence), "{said}");
    // The report may go into the folder that is made for the figures.
    let page = "shown/report.html";
    let shown = ["music-1001.mcap", "--figures", "shown", "--report", page];
    good(run_in(folder.path(), "analyze", &shown));
    let shown = files(&folder.path().join("shown"));
    assert!(shown.iter().any(|name| name == "report.html") && shown.len() > 5);
}

#[test]
fn same_scene_seed_and_version_give_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let record = |seed: &str, out: &str| {
        good(run_in(
            folder.path(),
            "sim",
            &[
                "record",
                "baseline",
                "--seed",
                seed,
                "--duration",
                "10",
                "--out",
                out,
            ],
        ))
    };
    record("7", "a.mcap");
    record("7", "b.mcap");
    let read = |name: &str| std::fs::read(folder.path().join(name)).expect("written");
    assert!(read("a.mcap") == read("b.mcap"));
    assert!(
        record("7", "-").stdout == read("a.mcap"),
        "standard output gets the same recording"
    );
    record("8", "c.mcap");
    assert!(
        read("a.mcap") != read("c.mcap"),
        "another seed is another run"
    );
}

#[test]
fn bad_input_gets_one_sentence_and_leaves_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let cases: &[(&[&str], Option<&str>, &str)] = &[
        (&["record", "musik"], None, "Did you mean `music`"),
        (&["record", "--method", "dopri"], None, "dopri5"),
        (
            &["record", "--set", "effects.musik.beat_hz=2"],
            None,
            "Did you mean `music`",
        ),
        (&["record", "--duration", "0"], None, "above zero"),
        (&["record", "--set", "body.mass_kg=-1"], None, "above zero"),
        (
            &["record", "mine.toml"],
            Some("name = \"x\"\n[body]\nmass_kg = 0.0\n"),
            "mine.toml:3:11",
        ),
        (
            &["record", "mine.toml"],
            Some("name = \"x\"\n[body]\nmas_kg = 1.0\n"),
            "mine.toml:3:1",
        ),
        (
            &["record", "mine.toml"],
            Some("name = \"x\"\n[body]\nmass_kg = \"heavy\"\n"),
            "mine.toml:3:11",
        ),
        (
            &["record", "mine.toml"],
            Some("name = \"x\"\n[carriers]\nhandles_m = []\n"),
            "at least one handle",
        ),
        (
            &["record", "mine.toml"],
            Some("name = \"x\"\n[body]\ninertia_kg_m2 = { xx = 1.0, yy = 1.0, zz = 3.0 }\n"),
            "triangle inequality",
        ),
        (
            &["record", "--duration", "-5"],
            None,
            "--duration: found -5, expected a number above zero",
        ),
        (
            &["record", "--duration", "1e12"],
            None,
            "--duration: 1e12 s at 30 Hz are 3.0e13 samples, expected at most 1e9",
        ),
        (
            &["record", "--set", "log_rate_hz=1e9"],
            None,
            "--set: log_rate_hz: 60 s at 1e9 Hz are 6.0e10 samples",
        ),
        (
            &["record", "--duration", "1e11", "--set", "log_rate_hz=1e-3"],
            None,
            "--duration: the stamps would pass the 19th of January 2038",
        ),
        (
            &["record", "--tolerance", "1e-20"],
            None,
            "--tolerance: found 1e-20",
        ),
        (
            &["record", "--method", "rk4", "--tolerance", "1e-3"],
            None,
            "--tolerance: rk4 takes steps of one length",
        ),
        (
            &[
                "record",
                "--method",
                "auto",
                "--set",
                "solver.method=\"rk4\"",
            ],
            None,
            "--method and --set solver.method say the same",
        ),
        (
            &["record", "mine.toml", "--out", "mine.toml"],
            Some("name = \"x\"\n"),
            "mine.toml: is named twice",
        ),
        (
            &["record", "music", "--out", "mine.toml"],
            Some("name = \"x\"\n"),
            "mine.toml: expected a name that ends in .mcap",
        ),
        (
            &["record", "--out", "no/such/folder/x.mcap"],
            None,
            "no/such/folder/x.mcap",
        ),
        (
            &["drum", "mine.toml", "--out", "mine.toml"],
            Some("name = \"x\"\n[effects.music]\n"),
            "mine.toml: is named twice",
        ),
        (
            &["replay", "-"],
            None,
            "-: a replay does not read standard input",
        ),
        (
            &["accuracy", "mine.toml", "--out", "mine.toml"],
            Some("name = \"x\"\n[effects.music]\n"),
            "cannot make the folder mine.toml",
        ),
    ];
    for (args, text, expected) in cases {
        if let Some(text) = text {
            std::fs::write(folder.path().join("mine.toml"), text).expect("written");
        }
        let out = run_in(folder.path(), "sim", args);
        let said = String::from_utf8_lossy(&out.stderr);
        // What a flag says is usage; what a file says, or that there is none, is not.
        let usage = ["named twice", "a name that ends", "standard input"];
        let flags = ["--method", "--set", "--duration", "--tolerance"];
        let usage = usage.iter().any(|words| expected.contains(words))
            || args.iter().any(|arg| flags.contains(arg));
        let code = if usage { 2 } else { 1 };
        assert_eq!(out.status.code(), Some(code), "{args:?}: {said}");
        assert!(said.contains(expected), "{args:?} says: {said}");
        assert!(out.stdout.is_empty());
    }
    assert_eq!(files(folder.path()), ["mine.toml"], "nothing half-written");
    for (flag, wrong, expected) in [
        ("--set", "foo", "expected KEY=VALUE"),
        ("--set", "=3", "expected KEY=VALUE"),
        ("--seed", "-1", "expected a whole number, 0 or more"),
        ("--seed", "1.5", "expected a whole number, 0 or more"),
        ("--duration", "1m", "expected a number"),
        ("--tolerance", "fine", "expected a number"),
    ] {
        let out = run_in(folder.path(), "sim", &["record", flag, wrong]);
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{flag} {wrong}");
        assert!(said.contains(expected), "{flag} {wrong} says: {said}");
    }
    for (name, flag, wrong, expected) in [
        ("study", "--shard", "-1/3", "expected K/N"),
        (
            "study",
            "--shards",
            "-3",
            "expected a whole number, 1 or more",
        ),
        (
            "analyze",
            "--max-items",
            "-1",
            "expected a whole number, 0 or more",
        ),
        (
            "analyze",
            "--max-chunk-bytes",
            "-1",
            "expected a whole number, 0 or more",
        ),
        (
            "analyze",
            "--max-message-bytes",
            "1k",
            "expected a whole number, 0 or more",
        ),
    ] {
        let out = run_in(folder.path(), name, &["mine.toml", flag, wrong]);
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{flag} {wrong}");
        assert!(said.contains(expected), "{flag} {wrong} says: {said}");
    }
    let help = good(run_in(folder.path(), "sim", &["--help"])).stdout;
    let help = String::from_utf8_lossy(&help);
    for code in ["0 done;", "1 it", "2 wrong usage;", "3 done, but"] {
        assert!(help.contains(code), "{help}");
    }
    assert_eq!(
        run_in(folder.path(), "sim", &["record", "--nonsense"])
            .status
            .code(),
        Some(2),
        "wrong usage"
    );
}

#[test]
fn a_file_that_is_not_there_is_said_once() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, args) in [
        ("sim", &["replay", "none.mcap"][..]),
        ("analyze", &["none.mcap"]),
        ("study", &["fit", "none.mcap"]),
    ] {
        let out = run_in(folder.path(), name, args);
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(1), "{name}: {said}");
        assert!(said.contains("none.mcap: cannot be read"), "{said}");
        assert_eq!(said.matches("os error").count(), 1, "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
    }
}

/// What the physics was not asked to do is said: nobody carries a load from metres away.
#[test]
fn a_load_that_is_left_behind_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = "name = \"left\"\nduration_s = 5.0\n[start]\nvelocity_m_per_s = [0.5, 0.0, 0.0]\n[effects.contact]\n";
    for (more, told) in [("", true), ("[effects.hold]\n", false)] {
        std::fs::write(folder.path().join("left.toml"), format!("{scene}{more}")).expect("written");
        let out = good(run_in(folder.path(), "sim", &["record", "left.toml"]));
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(said.contains("beside its shoulder"), told, "{said}");
    }
}

/// A unit that slipped runs well, and carries nothing.
#[test]
fn a_motion_that_nobody_carries_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let said = |scene: &str, set: &str| {
        let args = [
            "record",
            scene,
            "--out",
            "x.mcap",
            "--set",
            set,
            "--duration",
            "20",
        ];
        let out = good(run_in(folder.path(), "sim", &args));
        String::from_utf8_lossy(&out.stderr).into_owned()
    };
    for (set, remark) in [
        (
            "effects.gait.amplitude_m=64",
            "times the weight of the load",
        ),
        (
            "effects.contact.stiffness_n_per_m=3",
            "shoulder 2 gave way by ",
        ),
        (
            "body.gravity_m_per_s2=[0,0,9.81]",
            "no handle ever met its shoulder",
        ),
        ("body.mass_kg=60000", "m below their shoulders"),
        (
            "effects.contact=false",
            "without effects.contact nobody carries it",
        ),
    ] {
        let said = said("music", set);
        assert!(said.contains(remark), "{set}: {said}");
    }
    let listed = good(run_in(folder.path(), "sim", &["scenes"])).stdout;
    let listed = String::from_utf8(listed).expect("text");
    let names: Vec<&str> = (listed.lines())
        .filter_map(|l| l.split_whitespace().next())
        .collect();
    assert!(names.contains(&"tumble"));
    for name in names {
        let said = said(name, "seed=2");
        assert_eq!(said.lines().count(), 1, "{name}: {said}");
    }
}

#[test]
fn what_is_no_recording_is_refused_in_one_sentence() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("empty.mcap"), b"").expect("written");
    std::fs::write(
        folder.path().join("text.mcap"),
        b"this is no recording, whatever its name says",
    )
    .expect("written");
    for name in ["empty.mcap", "text.mcap", "absent.mcap"] {
        let out = run_in(folder.path(), "analyze", &[name]);
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(1), "{name}: {said}");
        assert!(said.contains(name), "{said}");
    }
}

#[test]
fn a_cut_off_recording_is_salvaged_and_said() {
    let folder = tempfile::tempdir().expect("a folder");
    good(run_in(
        folder.path(),
        "sim",
        &["record", "--out", "whole.mcap"],
    ));
    let whole = std::fs::read(folder.path().join("whole.mcap")).expect("written");
    std::fs::write(
        folder.path().join("cut.mcap"),
        &whole[..whole.len() * 2 / 3],
    )
    .expect("written");
    let out = run_in(folder.path(), "analyze", &["cut.mcap", "--format", "json"]);
    assert_eq!(
        out.status.code(),
        Some(3),
        "{}",
        String::from_utf8_lossy(&out.stderr)
    );
    let found = json(&out);
    assert_eq!(found["recording"]["salvaged"], true);
    assert!(found["metrics"]["rms_roll_deg"]["value"].is_number());
}

#[test]
fn the_study_is_the_same_for_any_number_of_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    for jobs in ["1", "2"] {
        good(run_in(
            folder.path(),
            "study",
            &["paper", "--seeds", "3", "--jobs", jobs, "--out", jobs],
        ));
    }
    for name in ["paper.txt", "paper.json", "runs.csv"] {
        let read =
            |jobs: &str| std::fs::read(folder.path().join(jobs).join(name)).expect("written");
        assert!(read("1") == read("2"), "{name} depends on --jobs");
    }
}

#[test]
fn what_the_twins_print_is_what_they_write() {
    let folder = tempfile::tempdir().expect("a folder");
    for (format, name) in [("table", "twin.txt"), ("json", "twin.json")] {
        let said = good(run_in(
            folder.path(),
            "study",
            &["twin", "--seeds", "1", "--out", "twins", "--format", format],
        ));
        let written = std::fs::read(folder.path().join("twins").join(name)).expect("written");
        assert!(said.stdout == written, "{name}");
    }
}

/// Every mean within the paper's ± of the paper's mean, and some that the paper does not print.
#[test]
fn table_1_is_reproduced() {
    let folder = tempfile::tempdir().expect("a folder");
    let found = json(&good(run_in(
        folder.path(),
        "study",
        &["paper", "--format", "json"],
    )));
    let mean = |condition: &str, metric: &str| {
        let value = &found["conditions"][condition]["metrics"][metric]["mean"];
        value
            .as_f64()
            .unwrap_or_else(|| panic!("{condition} {metric} is missing"))
    };
    for (condition, metric, theirs, spread) in [
        ("baseline", "rms_roll_deg", 0.148, 0.019),
        ("baseline", "contact_loss_mean", 0.040, 0.005),
        ("baseline", "synchrony", 0.629, 0.032),
        ("baseline", "dz_pp_m", 0.133, 0.017),
        ("baseline", "t_float", 0.089, 0.035),
        ("music", "rms_roll_deg", 18.387, 0.814),
        ("music", "contact_loss_mean", 0.317, 0.013),
        ("music", "synchrony", 0.990, 0.004),
        ("music", "onset_time_s", 20.5, 4.0),
        ("music", "dz_pp_m", 0.155, 0.020),
    ] {
        let here = mean(condition, metric);
        assert!(
            (here - theirs).abs() <= spread,
            "{condition} {metric}: {here}, expected {theirs} ± {spread}"
        );
    }
    for (condition, unstable) in [("baseline", 0), ("music", 30)] {
        assert_eq!(found["conditions"][condition]["unstable"], unstable);
        assert_eq!(found["conditions"][condition]["runs"], 30);
        assert!(mean(condition, "force_correlation") > 0.95);
    }
}

/// The paper's 'V5' nuance: with strict contact, music raises synchrony and does not raise roll.
#[test]
fn strict_contact_synchronises_without_rocking() {
    let folder = tempfile::tempdir().expect("a folder");
    let metrics = |name: &str, extra: &[&str]| {
        let args = [&["record", "strict-contact", "--out", name], extra].concat();
        good(run_in(folder.path(), "sim", &args));
        json(&good(run_in(
            folder.path(),
            "analyze",
            &[name, "--format", "json"],
        )))["metrics"]
            .clone()
    };
    let with = metrics("with.mcap", &[]);
    let without = metrics("without.mcap", &["--set", "effects.music=false"]);
    let number = |found: &Value, name: &str| {
        found[name]["value"]
            .as_f64()
            .unwrap_or_else(|| panic!("{name}"))
    };
    assert!(number(&with, "synchrony") > 0.95 && number(&without, "synchrony") < 0.8);
    assert!(number(&with, "contact_loss_mean") <= 0.003);
    assert!(number(&with, "rms_roll_deg") <= number(&without, "rms_roll_deg"));
}

/// The recordings that the project ships, against statistics that NumPy computed from them (data-samples/expected.py).
#[test]
fn val_numpy_statistics_of_the_samples() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../data-samples"));
    let text =
        std::fs::read_to_string(folder.join("expected.json")).expect("expected.json is shipped");
    let expected: Value = serde_json::from_str(&text).expect("JSON");
    for (name, numbers) in expected.as_object().expect("an object") {
        let found = json(&good(run_in(
            folder,
            "analyze",
            &[name, "--format", "json"],
        )));
        for (metric, theirs) in numbers.as_object().expect("an object") {
            let theirs = theirs.as_f64().expect("a number");
            let here = found["metrics"][metric]["value"]
                .as_f64()
                .unwrap_or_else(|| panic!("{name}: {metric} is missing"));
            assert!(
                (here - theirs).abs() <= 1e-9 * theirs.abs(),
                "{name} {metric}: {here}, NumPy says {theirs}"
            );
        }
    }
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_nothing_and_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let args = ["record", "--duration", "1e5", "--out", "long.mcap"];
    let mut child = Command::new(bin("sim"))
        .args(args)
        .current_dir(folder.path())
        .stderr(Stdio::piped())
        .spawn()
        .expect("starts");
    // It has begun once its unfinished file is there.
    let patience = Instant::now() + Duration::from_secs(60);
    while files(folder.path()).is_empty() {
        assert!(Instant::now() < patience, "nothing is written");
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(100));
    let mut interrupt = Command::new("kill");
    interrupt.args(["-INT", &child.id().to_string()]);
    assert!(interrupt.status().expect("kill runs").success());
    let said = {
        let mut said = String::new();
        let stderr = child.stderr.as_mut().expect("a pipe");
        Read::read_to_string(stderr, &mut said).expect("text");
        said
    };
    assert_eq!(child.wait().expect("ends").code(), Some(1), "{said}");
    assert!(
        said.contains("interrupted at") && said.contains("no file was made"),
        "{said}"
    );
    assert_eq!(files(folder.path()), [""; 0]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_said_in_one_sentence() {
    let folder = tempfile::tempdir().expect("a folder");
    let full = std::fs::File::options().write(true).open("/dev/full");
    let output = Command::new(bin("sim"))
        .args(["record", "--duration", "5", "--out", "-"])
        .current_dir(folder.path())
        .stdout(full.expect("opens"))
        .output()
        .expect("starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("No space left on device"), "{said}");
    assert!(!said.contains("file"), "there was none: {said}");
    assert_eq!(said.trim().lines().count(), 1, "{said}");
}

/// A file that may not grow beyond 100 KiB stands for a disk that fills up in the middle: the first cause is told, not what it leads to.
#[cfg(target_os = "linux")]
#[test]
fn a_disk_that_fills_up_in_the_middle_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let recorded = Command::new(bin("sim"))
        .args(["record", "music", "--out", "m.mcap"])
        .current_dir(folder.path())
        .output()
        .expect("starts");
    assert!(recorded.status.success());
    for command in ["record music", "replay m.mcap"] {
        let limited = format!(
            "trap '' XFSZ; ulimit -f 200; exec {} {command} --out r.mcap",
            bin("sim").display()
        );
        let output = Command::new("sh")
            .args(["-c", &limited])
            .current_dir(folder.path())
            .output()
            .expect("starts");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{command}: {said}");
        assert!(said.contains("File too large"), "{command}: {said}");
        assert_eq!(said.trim().lines().count(), 1, "{command}: {said}");
        assert_eq!(files(folder.path()), ["m.mcap"], "{command}");
    }
}

/// `sim record --out - | head -c 10`, of a run that is longer than any pipe; `analyze ingest` alike.
#[test]
fn a_reader_that_leaves_is_no_error() {
    leaves("sim", &["record", "--duration", "600"]);
    let sample = |name: &str| {
        format!(
            "{}/../data-samples/phones/{name}",
            env!("CARGO_MANIFEST_DIR")
        )
    };
    leaves(
        "analyze",
        &["ingest", &sample("rath.zip"), &sample("drum.wav")],
    );
}

fn leaves(program: &str, args: &[&str]) {
    let folder = tempfile::tempdir().expect("a folder");
    let mut child = Command::new(bin(program))
        .args(args)
        .args(["--out", "-"])
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("starts");
    let mut begin = [0; 10];
    let mut pipe = child.stdout.take().expect("piped");
    pipe.read_exact(&mut begin).expect("it begins");
    drop(pipe);
    assert_eq!(begin[1..5], *b"MCAP");
    let output = child.wait_with_output().expect("ends");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!((output.status.code(), &*said), (Some(0), ""));
}

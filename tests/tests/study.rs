//! Sweeps as a person would run them: whole, in shards, interrupted, resumed.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tests::{bin, files, good, json, run_in};

/// Short runs, one axis of each kind, one point that no scene may be at.
const SMALL: &str = r#"
scene = "music"
seeds = 3
metrics = ["rms_roll_deg", "dz_pp_m", "synchrony", "unstable", "mechanism"]
[set]
duration_s = 3.0
analysis_start_s = 1.0
solver.tolerance = 1e-4
[[axes]]
key = "body.mass_kg"
name = "mass"
from = -1
to = 60
count = 3
[[axes]]
key = "effects.contact.bilateral"
values = [false, true]
[[axes]]
key = "effects.gait.amplitude_m"
from = 0.01
to = 0.08
[design]
kind = "latin-hypercube"
points = 8
"#;

/// Long enough to be interrupted: seconds of work, of which a twentieth is waited for.
const LONG: &str = r#"
scene = "music"
seeds = 4000
metrics = ["rms_roll_deg"]
set.duration_s = 10.0
set.analysis_start_s = 0.0
"#;

fn folder_with(name: &str, text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join(name), text).expect("written");
    folder
}

fn study(folder: &Path, args: &[&str]) -> std::process::Output {
    good(run_in(folder, "study", args))
}

fn read(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

#[test]
fn any_jobs_and_any_shards_give_the_same_bytes() {
    let folder = folder_with("small.toml", SMALL);
    let at = folder.path();
    let found = json(&study(
        at,
        &["small.toml", "--jobs", "1", "--format", "json"],
    ));
    assert_eq!(found["runs"], 144);
    assert_eq!(found["points"], 48);
    study(at, &["small.toml", "--jobs", "3", "--out", "b"]);
    // In any order, and one of them twice.
    for k in ["3/4", "1/4", "4/4", "3/4", "2/4"] {
        study(at, &["small.toml", "--shard", k, "--out", "c"]);
    }
    let status = json(&study(at, &["status", "c", "--format", "json"]));
    assert_eq!(
        (&status["done"], &status["merged"]),
        (&144.into(), &false.into())
    );
    study(at, &["merge", "c"]);
    // The study's own copy of itself repeats it.
    study(at, &["c/study.toml", "--out", "d"]);
    for other in ["b", "c", "d"] {
        for name in ["runs.parquet", "summary.csv", "study.toml", "scene.toml"] {
            let (a, b) = (read(&at.join("small"), name), read(&at.join(other), name));
            assert!(a == b, "{other}/{name} differs");
        }
    }
    // A scheduler's variables do what --shard does.
    let task = Command::new(bin("study"))
        .args(["small.toml", "--out", "e"])
        .current_dir(at)
        .env("SLURM_ARRAY_TASK_ID", "7")
        .env("SLURM_ARRAY_TASK_MIN", "5")
        .env("SLURM_ARRAY_TASK_COUNT", "3")
        .output()
        .expect("it starts");
    assert!(String::from_utf8_lossy(&good(task).stderr).contains("shard 3/3"));
    let first = files(&at.join("e/parts")).remove(0);
    assert!(read(&at.join("e/parts"), &first) == read(&at.join("small/parts"), &first));
}

#[test]
fn a_run_that_fails_is_a_row_with_its_reason() {
    let folder = folder_with("small.toml", SMALL);
    let found = json(&study(folder.path(), &["small.toml", "--format", "json"]));
    assert_eq!(found["failed"], 48);
    let reason = found["reasons"][0][0].as_str().expect("a reason");
    assert!(
        reason.contains("body.mass_kg") && reason.contains("above zero"),
        "{reason}"
    );
    let csv = String::from_utf8(read(&folder.path().join("small"), "summary.csv")).expect("text");
    let rows: Vec<&str> = csv.lines().skip(1).collect();
    assert_eq!(rows.len(), 48);
    for row in rows {
        let cells: Vec<&str> = row.split(',').collect();
        let bad = cells[1] == "-1";
        assert_eq!(cells[5], if bad { "3" } else { "0" }, "failures in {row}");
        assert_eq!(cells[6], "0", "remarks in {row}");
        assert_eq!(cells[7].is_empty(), bad, "mean roll in {row}");
    }
}

/// A script that goes on with the table of a study where nothing ran must hear of it; the table says why.
#[test]
fn a_study_without_any_result_is_no_success() {
    // The scene's window of analysis begins later.
    let text = "scene = \"music\"\nset.duration_s = 1.0\nseeds = 2\n";
    let folder = folder_with("none.toml", text);
    let out = run_in(folder.path(), "study", &["none.toml"]);
    let said = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(1), "{said}");
    assert!(said.contains("none of the 2 runs has a result"), "{said}");
    let printed = String::from_utf8_lossy(&out.stdout);
    assert!(printed.contains("failed 2 times"), "{printed}");
    assert!(folder.path().join("none/runs.parquet").is_file());
}

#[test]
fn what_a_kill_leaves_is_gone_on_with() {
    let folder = folder_with("long.toml", LONG);
    let at = folder.path();
    // Killed the hard way, then interrupted the polite way, then let finish.
    for (signal, code) in [("KILL", None), ("INT", Some(1))] {
        let mut child = Command::new(bin("study"))
            .args(["long.toml", "--resume", "--jobs", "1"])
            .current_dir(at)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("it starts");
        let parts = || std::fs::read_dir(at.join("long/parts")).map_or(0, Iterator::count);
        let (before, began) = (parts(), Instant::now());
        while parts() < before + 3 && began.elapsed() < Duration::from_secs(60) {
            std::thread::sleep(Duration::from_millis(5));
        }
        let sent = Command::new("kill")
            .args([&format!("-{signal}"), &child.id().to_string()])
            .status();
        assert!(sent.expect("kill runs").success());
        assert_eq!(child.wait().expect("it ends").code(), code, "{signal}");
    }
    let status = json(&study(at, &["status", "long", "--format", "json"]));
    let done = status["done"].as_u64().expect("a number");
    assert!((96..4000).contains(&done), "{done} runs were kept");
    let again = run_in(at, "study", &["long.toml"]);
    assert_eq!(again.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&again.stderr).contains("--resume"));
    let resumed = study(at, &["long.toml", "--resume"]);
    let said = String::from_utf8_lossy(&resumed.stderr).into_owned();
    assert!(
        said.contains(&format!("{done} were there already")),
        "{said}"
    );
    study(at, &["long.toml", "--out", "whole"]);
    assert!(read(&at.join("long"), "runs.parquet") == read(&at.join("whole"), "runs.parquet"));
}

#[test]
fn slips_get_one_sentence() {
    let folder = tempfile::tempdir().expect("a folder");
    let base = "scene = \"music\"\nset.duration_s = 1.0\n";
    for (text, expected) in [
        ("scene = \"musik\"\n".to_owned(), "Did you mean `music`"),
        (format!("{base}sceds = 3\n"), "Did you mean `seeds`"),
        (
            format!("{base}metrics = [\"rms_rol_deg\"]\n"),
            "Did you mean `rms_roll_deg`",
        ),
        (format!("{base}seeds = 0\n"), "at least one run"),
        (
            format!("{base}[[axes]]\nkey = \"body.mas_kg\"\nvalues = [1.0]\n"),
            "Did you mean `mass_kg`",
        ),
        (
            format!("{base}[[axes]]\nkey = \"body.mass_kg\"\nvalues = [\"heavy\"]\n"),
            "body.mass_kg",
        ),
        (
            format!("{base}[[axes]]\nkey = \"body.mass_kg\"\nfrom = 1.0\n"),
            "`from` and `to`",
        ),
        (
            format!("{base}[[axes]]\nkey = \"body.mass_kg\"\nfrom = 1.0\nto = 2.0\n"),
            "[design]",
        ),
        (
            format!(
                "{base}[[axes]]\nkey = \"body.mass_kg\"\nfrom = 0.0\nto = 2.0\ncount = 3\nspacing = \"log\"\n"
            ),
            "above zero",
        ),
        (
            format!("{base}[[axes]]\nkey = \"seed\"\nvalues = [1, 2]\n"),
            "`seeds`",
        ),
        (
            format!("{base}[[axes]]\nkey = \"body.mass_kg\"\nname = \"run\"\nvalues = [1, 2]\n"),
            "another `name`",
        ),
        (
            format!("{base}[design]\nkind = \"sobol\"\npoints = 4\n"),
            "nothing to sample",
        ),
        (
            format!("{base}[design]\nkind = \"sobbol\"\npoints = 4\n"),
            "Did you mean `sobol`",
        ),
        (format!("{base}seeds = 4000000000\n"), "more than"),
        (format!("{base}set.seed = 7\n"), "lines of their own"),
        (
            format!(
                "{base}[[axes]]\nkey = \"body.mass_kg\"\nvalues = [50.0]\nwith = {{\"effects.contact.stiffness_n_per_m\" = 50.0}}\n\
                 [[axes]]\nkey = \"effects.contact\"\nname = \"c\"\nvalues = [true]\n"
            ),
            "would not count",
        ),
        (
            format!(
                "{base}[[axes]]\nkey = \"body.mass_kg\"\nvalues = [50.0]\nwith = {{\"effects.contact.stifness_n_per_m\" = 50.0}}\n"
            ),
            "stiffness_n_per_m",
        ),
        (
            format!("{base}[[axes]]\nkey = \"carriers.along_poles.count\"\nvalues = [2.4, 4]\n")
                .replace("\"music\"", "\"eight-carriers\""),
            "whole numbers",
        ),
    ] {
        std::fs::write(folder.path().join("mine.toml"), &text).expect("written");
        let out = run_in(folder.path(), "study", &["mine.toml"]);
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(1), "{text}: {said}");
        assert!(
            said.contains(expected) && said.contains("mine.toml"),
            "{text} says: {said}"
        );
    }
    assert_eq!(files(folder.path()), ["mine.toml"], "nothing half-made");
    std::fs::write(folder.path().join("mine.toml"), base).expect("written");
    for (args, code, expected) in [
        (&["papr"][..], 2, "Did you mean `paper`"),
        (&["absent.toml"], 1, "absent.toml"),
        (&["mine.toml", "--shard", "9/8"], 2, "K/N"),
        (&["status", "nowhere"], 1, "nowhere"),
        (&["mine.toml", "--nonsense"], 2, "--nonsense"),
        (
            &["submit", "mine.toml", "--tasks", "9", "--dry-run"],
            1,
            "parts to share out",
        ),
    ] {
        let out = run_in(folder.path(), "study", args);
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(code), "{args:?}: {said}");
        assert!(said.contains(expected), "{args:?} says: {said}");
    }
}

#[test]
fn parts_of_another_study_are_not_mixed_in() {
    let folder = folder_with(
        "a.toml",
        "scene = \"music\"\nset.duration_s = 1.0\nset.analysis_start_s = 0.0\nseeds = 2\n",
    );
    let at = folder.path();
    study(at, &["a.toml", "--out", "x"]);
    let table = std::fs::read(at.join("x/runs.parquet")).expect("a table");
    // With other runs its parts have other names, but the folder is still the first one's.
    for other in [
        "scene = \"music\"\nset.duration_s = 2.0\nset.analysis_start_s = 0.0\nseeds = 2\n",
        "scene = \"music\"\nset.duration_s = 1.0\nset.analysis_start_s = 0.0\nseeds = 3\n",
    ] {
        std::fs::write(at.join("b.toml"), other).expect("written");
        for resume in [None, Some("--resume")] {
            let args: Vec<&str> = ["b.toml", "--out", "x"].into_iter().chain(resume).collect();
            let out = run_in(at, "study", &args);
            let said = String::from_utf8_lossy(&out.stderr);
            assert!(
                out.status.code() == Some(1) && said.contains("another"),
                "{said}"
            );
            let seeds = said.contains("`seeds = 2`") && said.contains("`seeds = 3`");
            assert_eq!(seeds, other.contains("seeds = 3"), "{said}");
        }
    }
    let kept = std::fs::read(at.join("x/runs.parquet")).expect("a table");
    assert!(kept == table);
    study(at, &["a.toml", "--out", "x", "--resume"]);
    // A part that is damaged inside is named.
    let part = at.join("x/parts/000000000-000000002.parquet");
    let mut bytes = std::fs::read(&part).expect("a part");
    bytes[60..120].fill(0xff);
    std::fs::write(&part, bytes).expect("written");
    let out = run_in(at, "study", &["merge", "x"]);
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(
        out.status.code() == Some(1)
            && said.contains("000000002.parquet: is damaged")
            && said.contains("--resume")
            && !said.contains("summary"),
        "{said}"
    );
    // It is made again.
    let out = run_in(at, "study", &["a.toml", "--out", "x", "--resume"]);
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(
        out.status.success() && said.contains("000000002.parquet: is damaged"),
        "{said}"
    );
    let again = std::fs::read(at.join("x/runs.parquet")).expect("a table");
    assert!(again == table);
    // What is somebody's own stays.
    std::fs::write(at.join("scene.toml"), "# hours of work\n").expect("written");
    let out = run_in(at, "study", &["a.toml", "--out", "."]);
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(
        out.status.code() == Some(1) && said.contains("is there already"),
        "{said}"
    );
    assert_eq!(read(at, "scene.toml"), b"# hours of work\n");
}

/// A part of other runs under its name, and any bit that is another: it is told, and made again.
#[test]
fn a_part_that_is_not_what_was_written_is_made_again() {
    let folder = folder_with(
        "a.toml",
        "scene = \"stand-still\"\nset.duration_s = 1.0\nset.analysis_start_s = 0.0\nseeds = 40\nmetrics = [\"z_mean_m\"]\n",
    );
    let at = folder.path();
    study(at, &["a.toml", "--out", "x"]);
    let table = read(&at.join("x"), "runs.parquet");
    let [first, second] = ["000000000-000000016", "000000016-000000032"]
        .map(|name| at.join(format!("x/parts/{name}.parquet")));
    let part = std::fs::read(&second).expect("a part");
    std::fs::copy(&first, &second).expect("copied");
    let status = json(&study(at, &["status", "x", "--format", "json"]));
    assert_eq!(status["done"], 24);
    let damaged = status["damaged"][0].as_str().expect("a sentence");
    assert!(damaged.contains("its runs are others"), "{damaged}");
    let out = run_in(at, "study", &["merge", "x"]);
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(
        out.status.code() == Some(1) && said.contains("--resume"),
        "{said}"
    );
    study(at, &["a.toml", "--out", "x", "--resume"]);
    assert!(std::fs::read(&second).expect("a part") == part);
    assert!(read(&at.join("x"), "runs.parquet") == table);
    for at_byte in (0..part.len()).step_by(23) {
        let mut flipped = part.clone();
        flipped[at_byte] ^= 1 << (at_byte % 8);
        std::fs::write(&second, &flipped).expect("written");
        let out = run_in(at, "study", &["merge", "x"]);
        assert!(
            out.status.code() == Some(1) || read(&at.join("x"), "runs.parquet") == table,
            "byte {at_byte}"
        );
    }
}

/// Two studies begun in one folder at one moment: one of them has it, the other is told so.
#[test]
fn a_folder_is_of_one_study_at_a_time() {
    let text = |mass: f64| {
        format!(
            "scene = \"music\"\nset.duration_s = 3.0\nset.analysis_start_s = 0.0\nset.body.mass_kg = {mass:?}\nseeds = 400\n"
        )
    };
    let folder = folder_with("a.toml", &text(60.0));
    let at = folder.path();
    std::fs::write(at.join("b.toml"), text(61.0)).expect("written");
    for round in 0..3 {
        let out = format!("x{round}");
        let ended = std::thread::scope(|scope| {
            let run = |file: &'static str| {
                let out = &out;
                scope.spawn(move || run_in(at, "study", &[file, "--out", out, "--jobs", "1"]))
            };
            let both = [run("a.toml"), run("b.toml")];
            both.map(|one| one.join().expect("ends"))
        });
        let well = ended.iter().filter(|out| out.status.success()).count();
        let said = ended.map(|out| String::from_utf8_lossy(&out.stderr).into_owned());
        assert!(well == 1, "{said:?}");
        assert!(
            said.iter().any(|said| said.contains("another study")),
            "{said:?}"
        );
    }
}

/// What `sim record` says of a motion that nobody carries stands in the table, too.
#[test]
fn what_nobody_carries_is_remarked_on() {
    let folder = folder_with(
        "soft.toml",
        "scene = \"music\"\nset.duration_s = 3.0\nset.analysis_start_s = 0.0\nseeds = 8\naxes = [{ key = \"effects.contact.stiffness_n_per_m\", values = [3000, 300] }]\n",
    );
    let out = study(folder.path(), &["soft.toml", "--format", "json"]);
    let found = json(&out);
    assert_eq!(found["remarked"], 8, "{found}");
    let remarks = found["remarks"].to_string();
    assert!(remarks.contains("gave way by"), "{remarks}");
    let csv = String::from_utf8(read(&folder.path().join("soft"), "summary.csv")).expect("text");
    let remarked = csv
        .lines()
        .skip(1)
        .map(|row| row.split(',').nth(4).expect("a cell"));
    assert_eq!(remarked.collect::<Vec<_>>(), ["0", "8"]);
}

#[test]
fn a_sensitivity_study_ranks_what_matters_and_recordings_are_kept() {
    let folder = folder_with(
        "which.toml",
        r#"
scene = "stand-still"
metrics = ["dz_pp_m", "z_mean_m"]
[set]
duration_s = 2.0
effects.gait.amplitude_m = 0.01
[[axes]]
key = "effects.gait.amplitude_m"
name = "amplitude"
from = 0.005
to = 0.02
[[axes]]
key = "effects.hold.stiffness_n_per_m"
name = "hold"
from = 1000.0
to = 2000.0
[design]
kind = "sensitivity"
points = 16
"#,
    );
    let found = json(&study(folder.path(), &["which.toml", "--format", "json"]));
    let index = |metric: &str, axis: &str| {
        found["sensitivity"]
            .as_array()
            .expect("a list")
            .iter()
            .find(|i| i["metric"] == metric && i["axis"] == axis)
            .and_then(|i| i["total"]["value"].as_f64())
            .expect("an index")
    };
    assert!(index("dz_pp_m", "amplitude") > 0.9 && index("dz_pp_m", "hold") < 1e-3);

    std::fs::write(
        folder.path().join("kept.toml"),
        "scene = \"music\"\nset.duration_s = 1.0\nset.analysis_start_s = 0.0\nseeds = 2\nrecordings = true\n",
    )
    .expect("written");
    study(folder.path(), &["kept.toml"]);
    let kept = folder.path().join("kept/recordings");
    assert_eq!(files(&kept), ["run-000000000.mcap", "run-000000001.mcap"]);
    good(run_in(
        folder.path(),
        "sim",
        &[
            "record",
            "--duration",
            "1",
            "--set",
            "analysis_start_s=0",
            "--seed",
            "1002",
            "--out",
            "alone.mcap",
        ],
    ));
    assert!(
        read(&kept, "run-000000001.mcap") == read(folder.path(), "alone.mcap"),
        "a kept recording is the one that `sim record` writes"
    );
}

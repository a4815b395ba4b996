//! `kill -9` in the middle of a recording: nothing under the final name, or all of it; what is left beside it can be read.
#![cfg(unix)]

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use recording::Kind;
use recording::read::{ReadOptions, Recording};
use tests::{bin, files};

/// Topic, log time and content of the messages, and what the reader remarks.
type Content = (Vec<(String, i64, Vec<u8>)>, Vec<Kind>);

fn content(path: &Path) -> Content {
    let recording = Recording::open(path, &ReadOptions::default()).expect("opens");
    let mut messages = Vec::new();
    recording
        .messages(&|_| true, &mut |m| {
            messages.push((m.topic.to_owned(), m.log_time_ns, m.data.to_vec()))
        })
        .expect("reads");
    let findings = recording.stream(&|_| true, &mut |_| {}).expect("reads");
    let losses = findings.iter().map(|f| f.kind).filter(|k| k.is_loss());
    (messages, losses.collect())
}

fn record(folder: &Path) -> Command {
    let mut sim = Command::new(bin("sim"));
    sim.args(["record", "baseline", "--duration", "600"])
        .args(["--out", "run.mcap"])
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    sim
}

#[test]
fn killed_at_a_hundred_moments() {
    let whole = tempfile::tempdir().expect("a folder");
    let mut sim = record(whole.path());
    let started = Instant::now();
    assert!(sim.status().expect("starts").success());
    let taken = started.elapsed();
    let (messages, losses) = content(&whole.path().join("run.mcap"));
    assert_eq!(losses, []);

    // A 64-bit congruence (Knuth's MMIX): moments from the start to a little beyond the end.
    let mut state = 6u64;
    let (mut salvaged, mut finished) = (0, 0);
    for _ in 0..100 {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        let share = (state >> 11) as f64 / (1u64 << 53) as f64;
        let folder = tempfile::tempdir().expect("a folder");
        let mut child = record(folder.path()).spawn().expect("starts");
        std::thread::sleep(Duration::from_secs_f64(1.1 * share * taken.as_secs_f64()));
        // SIGKILL; a program that has ended already is no matter.
        child.kill().expect("a child of ours");
        child.wait().expect("ends");
        let names = files(folder.path());
        assert!(names.len() <= 1, "{names:?}");
        let Some(name) = names.first() else { continue };
        let path = folder.path().join(name);
        if name == "run.mcap" {
            assert!(content(&path) == (messages.clone(), vec![]));
            finished += 1;
            continue;
        }
        assert!(
            name.starts_with(".run.mcap.") && name.ends_with(".part"),
            "{name}"
        );
        if path.metadata().expect("its length").len() < 8 {
            // Not even the format's magic bytes.
            continue;
        }
        let (left, losses) = content(&path);
        assert!(left.len() <= messages.len() && left == messages[..left.len()]);
        assert!(losses.iter().all(|k| *k == Kind::Truncated), "{losses:?}");
        assert!(losses.len() == 1 || left.len() == messages.len());
        salvaged += usize::from(!left.is_empty());
    }
    assert!(
        salvaged >= 10,
        "only {salvaged} of 100 left messages, {finished} ended before"
    );
}

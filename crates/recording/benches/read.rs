//! Reading the yardstick (see `examples/yardstick.rs`) beside its floor, zstd alone, and beside the mcap crate's walk.
//!
//! ```text
//! cargo bench -p recording --bench read [-- YARDSTICK.mcap]
//! ```
//! CPU time of the process (user and system, from `/proc/self/stat`, 10 ms ticks) and wall time; the best of five. Every run's
//! result is checked: number of messages and sum of a column. Without a file a small yardstick is made beside the build.

use std::{fs, path::PathBuf, process::Command, time::Instant};

use recording::read::{ReadOptions, Recording};

/// CPU seconds of this process, with its ended threads.
fn cpu_s() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // Fields 14 and 15 count from the name in parentheses, which is field 2.
    let fields: Vec<&str> = stat
        .rsplit(')')
        .next()
        .unwrap_or_default()
        .split_whitespace()
        .collect();
    let ticks = |index: usize| {
        fields
            .get(index)
            .and_then(|ticks| ticks.parse::<f64>().ok())
            .unwrap_or(f64::NAN)
    };
    (ticks(11) + ticks(12)) / 100.0
}

/// Anonymous memory at its highest, MB.
fn peak_anonymous_mb() -> f64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let kb = |name: &str| {
        status.lines().find_map(|line| {
            line.strip_prefix(name)?
                .split_whitespace()
                .next()?
                .parse::<f64>()
                .ok()
        })
    };
    kb("RssAnon:").unwrap_or(f64::NAN) / 1e3
}

struct Timing {
    cpu_s: f64,
    wall_s: f64,
}

fn best(mut run: impl FnMut()) -> Timing {
    let mut best = Timing {
        cpu_s: f64::INFINITY,
        wall_s: f64::INFINITY,
    };
    for _ in 0..5 {
        let (cpu, wall) = (cpu_s(), Instant::now());
        run();
        best.cpu_s = best.cpu_s.min(cpu_s() - cpu);
        best.wall_s = best.wall_s.min(wall.elapsed().as_secs_f64());
    }
    best
}

/// The floor: every chunk unpacked, nothing looked at.
fn floor(bytes: &[u8]) -> u64 {
    let mut zstd = zstd::bulk::Decompressor::new().expect("zstd");
    let mut buffer = vec![0; 4 << 20];
    let (mut at, mut total) = (8, 0);
    while at + 9 < bytes.len() - 8 {
        let length =
            u64::from_le_bytes(bytes[at + 1..at + 9].try_into().expect("eight bytes")) as usize;
        if bytes[at] == 6 {
            // Two times, two sizes, the word `zstd`, the length: 44 bytes.
            total += zstd
                .decompress_to_buffer(&bytes[at + 9 + 44..at + 9 + length], &mut buffer)
                .expect("unpacks") as u64;
        }
        at += 9 + length;
    }
    total
}

fn imu_field(path: &str) -> bool {
    path.contains(".angular_velocity.") || path.contains(".linear_acceleration.")
}

fn main() {
    let path = match std::env::args()
        .skip(1)
        .find(|argument| !argument.starts_with("--"))
    {
        Some(path) => PathBuf::from(path),
        None => {
            let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("yardstick.mcap");
            let example = [
                "run",
                "--release",
                "-q",
                "-p",
                "recording",
                "--example",
                "yardstick",
                "--",
            ];
            let status = Command::new(env!("CARGO"))
                .args(example)
                .arg(&path)
                .arg("200000")
                .status();
            assert!(
                status.is_ok_and(|status| status.success()),
                "the yardstick could not be made"
            );
            path
        }
    };
    let bytes = fs::read(&path).expect("reads");
    let mut unpacked = 0;
    let floor = best(|| unpacked = floor(&bytes));
    println!(
        "{}: {:.1} MB, {:.1} MB unpacked",
        path.display(),
        bytes.len() as f64 / 1e6,
        unpacked as f64 / 1e6
    );
    let report = |name: &str, timing: Timing| {
        println!(
            "{name:<44} {:6.3} s CPU {:5.2} x floor   {:6.3} s wall {:5.2} x",
            timing.cpu_s,
            timing.cpu_s / floor.cpu_s,
            timing.wall_s,
            timing.wall_s / floor.wall_s
        );
    };
    println!(
        "{:<44} {:6.3} s CPU              {:6.3} s wall",
        "zstd alone, one thread (the floor)", floor.cpu_s, floor.wall_s
    );

    let mut messages = 0;
    report(
        "mcap crate: MessageStream, not decoded",
        best(|| {
            messages = mcap::MessageStream::new(&bytes)
                .expect("opens")
                .filter(Result::is_ok)
                .count();
        }),
    );
    drop(bytes);

    let mut sum = f64::NAN;
    for (name, threads, wanted) in [
        ("stream: checked, times only, 1 thread", 1, false),
        ("stream: checked, 60 columns, 1 thread", 1, true),
        ("stream: checked, 60 columns, 2 threads", 2, true),
    ] {
        let options = ReadOptions {
            threads,
            ..ReadOptions::default()
        };
        report(
            name,
            best(|| {
                let recording = Recording::open(&path, &options).expect("opens");
                let (mut seen, mut total) = (0, 0.0);
                let findings = recording
                    .stream(&|path| wanted && imu_field(path), &mut |batch| {
                        seen += batch.times_ns.len();
                        for column in batch.columns {
                            total += column.values[0];
                        }
                    })
                    .expect("reads");
                assert!(
                    findings.iter().all(|finding| !finding.kind.is_loss()),
                    "{findings:?}"
                );
                assert_eq!(seen, messages);
                if wanted {
                    assert!(
                        sum.is_nan() || sum == total,
                        "the same numbers in the same order for any number of threads"
                    );
                    sum = total;
                }
            }),
        );
    }
    println!("anonymous memory after all: {:.0} MB", peak_anonymous_mb());
}

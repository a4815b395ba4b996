//! What the benches share: CPU time, wall time, memory, and the floor of all reading.

use std::{fs, path::PathBuf, process::Command, time::Instant};

use rustix::time::{ClockId, clock_gettime};

/// CPU time and wall time (s).
#[derive(Clone, Copy)]
pub struct Timing {
    pub cpu_s: f64,
    pub wall_s: f64,
}

/// CPU seconds of this process, with its ended threads.
fn cpu_s() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 / 1e9
}

/// The best of five runs of each: they take turns, so that a busy machine is busy for all.
pub fn best<const N: usize>(mut runs: [&mut dyn FnMut(); N]) -> [Timing; N] {
    let none = Timing {
        cpu_s: f64::INFINITY,
        wall_s: f64::INFINITY,
    };
    let mut best = [none; N];
    for _ in 0..5 {
        for (run, best) in runs.iter_mut().zip(&mut best) {
            let (cpu, wall) = (cpu_s(), Instant::now());
            run();
            best.cpu_s = best.cpu_s.min(cpu_s() - cpu);
            best.wall_s = best.wall_s.min(wall.elapsed().as_secs_f64());
        }
    }
    best
}

/// The line of a table: what it was, how long it took, and how that stands to the floor.
pub fn report(name: &str, timing: Timing, floor: Timing) {
    println!(
        "{name:<44} {:6.3} s CPU {:5.2} x floor   {:6.3} s wall {:5.2} x",
        timing.cpu_s,
        timing.cpu_s / floor.cpu_s,
        timing.wall_s,
        timing.wall_s / floor.wall_s
    );
}

/// Anonymous memory of a process now (MB); `None` where there is no such process, or no `/proc`.
pub fn anonymous_mb(process: &str) -> Option<f64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("RssAnon:"))?;
    let kb: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kb / 1e3)
}

/// The floor: every chunk unpacked by zstd alone, nothing looked at. Returns the unpacked bytes.
pub fn floor(bytes: &[u8]) -> u64 {
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

/// The yardstick that the command line names; without one a small yardstick is made beside the build.
pub fn yardstick() -> PathBuf {
    let named = std::env::args().skip(1).find(|a| !a.starts_with("--"));
    if let Some(path) = named {
        return PathBuf::from(path);
    }
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("yardstick.mcap");
    let status = Command::new(env!("CARGO"))
        .args(["run", "--release", "-q", "-p", "recording"])
        .args(["--example", "yardstick", "--"])
        .arg(&path)
        .arg("200000")
        .status();
    assert!(
        status.is_ok_and(|status| status.success()),
        "the yardstick could not be made"
    );
    path
}

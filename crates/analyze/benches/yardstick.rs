//! Statistics and Welch spectra of all sixty inertial signals of the yardstick, beside the floor, zstd alone.
//!
//! ```text
//! cargo run --release -p recording --example yardstick -- yardstick.mcap [MESSAGES]
//! cargo bench -p analyze --bench yardstick [-- yardstick.mcap]
//! ```
//! CPU and wall time, the best of five, taken in turns; then the highest anonymous memory of the command itself. The answers are checked:
//! every sample counted, every spectrum that of the whole column, its strongest line where the yardstick has it.

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
    time::Duration,
};

use analyze::examine::{Analysis, examine};
use analyze::request::Request;
use analyze::spectrum::{Options, welch};
use recording::read::{ReadOptions, Recording};

#[path = "../../recording/benches/measure/mod.rs"]
mod measure;

const SIGNALS: [&str; 2] = ["*.angular_velocity.*", "*.linear_acceleration.*"];

fn run(path: &Path, threads: usize) -> Analysis {
    let options = ReadOptions {
        threads,
        ..ReadOptions::default()
    };
    let recording = Recording::open(path, &options).expect("opens");
    let request = Request {
        signals: SIGNALS.map(str::to_owned).to_vec(),
        ..Request::default()
    };
    examine("yardstick", &recording, &request).expect("reads")
}

/// What the streamed answer has to be: that of columns held in memory.
fn check(path: &Path, analysis: &Analysis) {
    assert_eq!(analysis.signals.len(), 60);
    assert_eq!(analysis.spectra.len(), 60);
    let recording = Recording::open(path, &ReadOptions::default()).expect("opens");
    let (columns, _) = recording
        .signals(&|path| path.starts_with("/imu/device_3.linear_acceleration."))
        .expect("reads");
    for column in columns.iter().filter(|c| !c.path.contains("covariance")) {
        let (_, summary) = (analysis.signals.iter().find(|s| s.0 == column.path)).expect("a line");
        let (_, told) = (analysis.spectra.iter().find(|s| s.0 == column.path)).expect("a spectrum");
        let n = column.values.len() as f64;
        let mean = column.values.iter().sum::<f64>() / n;
        let square = |x: &f64| (x - mean).powi(2);
        let sd = (column.values.iter().map(square).sum::<f64>() / n).sqrt();
        assert_eq!(summary.count, column.values.len() as u64);
        assert!((summary.mean.expect("a mean") - mean).abs() < 1e-10);
        assert!((summary.sd.expect("an SD") / sd - 1.0).abs() < 1e-10);
        let hz = summary.hz.expect("a rate");
        let options = Options {
            nperseg: (told.segment_s * hz).round() as usize,
            ..Options::default()
        };
        let whole = welch(&column.values, hz, &options).expect("a spectrum");
        let largest = whole.power.iter().copied().fold(0.0, f64::max);
        for (streamed, held) in told.spectrum.power.iter().zip(&whole.power) {
            assert!((streamed - held).abs() < 1e-10 * held + 1e-20 * largest);
        }
        // The axes move at two, four and six hertz.
        let axis = column.path.bytes().last().expect("a letter") - b'x';
        let line_hz = 2.0 * f64::from(axis + 1);
        let peak_hz = summary.peak_hz.expect("a line");
        assert!(
            (peak_hz - line_hz).abs() < 0.01,
            "{}: {peak_hz}",
            column.path
        );
    }
}

/// The highest anonymous memory of the command (MB), looked at every millisecond.
fn memory_mb(path: &Path, signals: &[&str]) -> Option<f64> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_analyze"));
    command.arg(path).stdout(Stdio::null());
    for signal in signals {
        command.args(["--signal", signal]);
    }
    let mut child = command.spawn().expect("starts");
    let mut highest = None;
    while child.try_wait().expect("waits").is_none() {
        if let Some(mb) = measure::anonymous_mb(&child.id().to_string()) {
            highest = Some(mb.max(highest.unwrap_or(0.0)));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    highest
}

fn main() {
    let path = measure::yardstick();
    let bytes = fs::read(&path).expect("reads");
    let (mut one, mut two) = (None, None);
    let [floor, one_thread, two_threads] = measure::best([
        &mut || assert!(measure::floor(&bytes) > 0),
        &mut || one = Some(run(&path, 1)),
        &mut || two = Some(run(&path, 2)),
    ]);
    let (one, two) = (one.expect("ran"), two.expect("ran"));
    assert_eq!(one.signals, two.signals, "any number of threads");
    println!(
        "{}: {:.1} MB, {} messages",
        path.display(),
        bytes.len() as f64 / 1e6,
        one.messages
    );
    drop(bytes);
    check(&path, &one);
    for (name, timing) in [
        ("zstd alone, one thread (the floor)", floor),
        ("statistics and Welch of 60, 1 thread", one_thread),
        ("statistics and Welch of 60, 2 threads", two_threads),
    ] {
        measure::report(name, timing, floor);
    }
    for (name, signals) in [
        ("of the sixty signals", &SIGNALS[..]),
        ("of everything", &[]),
    ] {
        if let Some(mb) = memory_mb(&path, signals) {
            println!("anonymous memory of `analyze`, {name}: {mb:.0} MB");
        }
    }
}

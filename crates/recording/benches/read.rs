//! Reading the yardstick (see `examples/yardstick.rs`) beside its floor, zstd alone, and beside the mcap crate's walk.
//!
//! ```text
//! cargo bench -p recording --bench read [-- YARDSTICK.mcap]
//! ```
//! CPU time of the process and wall time; the best of five, taken in turns. Every run's result is checked: number of messages and
//! sum of a column. Statistics and spectra of the same file are measured by the bench of `analyze`.

use std::fs;

use recording::read::{ReadOptions, Recording};

mod measure;

fn imu_field(path: &str) -> bool {
    path.contains(".angular_velocity.") || path.contains(".linear_acceleration.")
}

fn main() {
    let path = measure::yardstick();
    let bytes = fs::read(&path).expect("reads");
    let stream = |threads: usize, wanted: bool| {
        let options = ReadOptions {
            threads,
            ..ReadOptions::default()
        };
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
        (seen, total)
    };
    let (mut unpacked, mut walked) = (0, 0);
    let (mut times, mut one, mut two) = ((0, 0.0), (0, 0.0), (0, 0.0));
    let [floor, walk, checked, one_thread, two_threads] = measure::best([
        &mut || unpacked = measure::floor(&bytes),
        &mut || {
            let messages = mcap::MessageStream::new(&bytes).expect("opens");
            walked = messages.filter(Result::is_ok).count();
        },
        &mut || times = stream(1, false),
        &mut || one = stream(1, true),
        &mut || two = stream(2, true),
    ]);
    assert_eq!(times.0, walked);
    assert_eq!(one.0, walked);
    assert_eq!(one, two, "the same numbers for any number of threads");
    println!(
        "{}: {:.1} MB, {:.1} MB unpacked",
        path.display(),
        bytes.len() as f64 / 1e6,
        unpacked as f64 / 1e6
    );
    for (name, timing) in [
        ("zstd alone, one thread (the floor)", floor),
        ("mcap crate: MessageStream, not decoded", walk),
        ("stream: checked, times only, 1 thread", checked),
        ("stream: checked, 60 columns, 1 thread", one_thread),
        ("stream: checked, 60 columns, 2 threads", two_threads),
    ] {
        measure::report(name, timing, floor);
    }
    drop(bytes);
    if let Some(mb) = measure::anonymous_mb("self") {
        println!("anonymous memory after all: {mb:.0} MB");
    }
}

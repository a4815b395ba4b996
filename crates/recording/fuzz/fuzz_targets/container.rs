//! Any bytes as a file. Seeds: the recordings under `tests/data`.
//!
//! `cargo +nightly fuzz run container fuzz/corpus/container tests/data -- -max_total_time=600 -rss_limit_mb=512`

#![no_main]

use libfuzzer_sys::fuzz_target;
use recording::read::{ReadOptions, Recording};

fuzz_target!(|bytes: &[u8]| {
    let options = ReadOptions { threads: 1, max_chunk_bytes: 64 << 20, ..ReadOptions::default() };
    if let Ok(recording) = Recording::from_bytes(bytes.to_vec(), &options) {
        let _ = recording.signals(&|_| true);
        let _ = recording.messages(&|_| true, &mut |_| {});
    }
});

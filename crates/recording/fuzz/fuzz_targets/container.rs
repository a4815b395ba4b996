//! Any bytes as a file.

#![no_main]

use libfuzzer_sys::fuzz_target;
use recording::read::Recording;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(recording) = Recording::from_bytes(bytes.to_vec(), &recording_fuzz::options()) {
        let _ = recording.signals(&|_| true);
        let _ = recording.messages(&|_| true, &mut |_| {});
    }
});

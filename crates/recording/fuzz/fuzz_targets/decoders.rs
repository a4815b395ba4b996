//! Any schema and any message under every decoder: the first byte chooses the encodings, the second the length of the schema.
//!
//! `cargo +nightly fuzz run decoders -- -max_total_time=600 -rss_limit_mb=512`

#![no_main]

use std::collections::BTreeMap;

use libfuzzer_sys::fuzz_target;
use recording::{
    read::{ReadOptions, Recording, supported},
    write::{RawChannel, RecordingWriter, WriterOptions},
};

#[derive(Clone, Default)]
struct Shared(std::sync::Arc<std::sync::Mutex<Vec<u8>>>);

impl std::io::Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().expect("unpoisoned").extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fuzz_target!(|bytes: &[u8]| {
    let [choice, length, rest @ ..] = bytes else { return };
    let encodings: Vec<_> = supported().collect();
    let (message_encoding, schema_encoding) = encodings[usize::from(*choice) % encodings.len()];
    let (schema, message) = rest.split_at((usize::from(*length) * 4).min(rest.len()));
    let shared = Shared::default();
    let mut writer = RecordingWriter::to_stream(shared.clone(), &WriterOptions::default()).expect("begins");
    let metadata = BTreeMap::new();
    let channel = RawChannel {
        topic: "/a",
        message_encoding,
        schema_name: "test_msgs/msg/Small",
        schema_encoding: if schema_encoding == "*" { "jsonschema" } else { schema_encoding },
        schema_data: schema,
        metadata: &metadata,
    };
    let Ok(channel) = writer.raw_channel(&channel) else { return };
    for (i, part) in message.chunks(64).enumerate() {
        writer.message(channel, i as i64, part).expect("writes");
    }
    writer.finish().expect("finishes");
    let bytes = shared.0.lock().expect("unpoisoned").clone();
    let options = ReadOptions { threads: 1, ..ReadOptions::default() };
    let recording = Recording::from_bytes(bytes, &options).expect("opens");
    let _ = recording.signals(&|_| true);
});

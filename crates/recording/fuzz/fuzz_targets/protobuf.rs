//! Protobuf messages and descriptor sets.

#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| recording_fuzz::decode("protobuf", "protobuf", input));

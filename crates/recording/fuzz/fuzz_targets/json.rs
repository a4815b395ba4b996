//! JSON messages and JSON Schemas.

#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| recording_fuzz::decode("json", "jsonschema", input));

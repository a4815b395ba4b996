//! ROS 1 messages and their definitions.

#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| recording_fuzz::decode("ros1", "ros1msg", input));

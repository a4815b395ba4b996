//! ROS 2 messages and IDL.

#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| recording_fuzz::decode("cdr", "ros2idl", input));

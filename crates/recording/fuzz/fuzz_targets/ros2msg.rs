//! ROS 2 messages and `ros2msg` definitions.

#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| recording_fuzz::decode("cdr", "ros2msg", input));

//! Files and messages changed at random: nothing panics, hangs or fills the memory. The quick, stable cousin of `fuzz/`.
//!
//! `RATH_HOSTILE_ROUNDS=100000 cargo test --release -p recording --test hostile` goes on for longer.

mod common;

use std::{
    collections::BTreeMap,
    io::{self, Read},
    path::PathBuf,
    time::Instant,
};

use common::Shared;
use recording::{
    Kind,
    read::{ChannelInfo, ReadOptions, Recording},
    write::{RawChannel, RecordingWriter, WriterOptions},
};

fn rounds() -> usize {
    let usual = if cfg!(debug_assertions) { 300 } else { 3000 };
    std::env::var("RATH_HOSTILE_ROUNDS")
        .ok()
        .and_then(|rounds| rounds.parse().ok())
        .unwrap_or(usual)
}

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(name)
}

fn data(name: &str) -> Vec<u8> {
    std::fs::read(path(name)).expect("test data")
}

/// A 64-bit congruence (Knuth's MMIX).
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 33) as usize % bound.max(1)
    }

    /// Flips, overwrites, cuts, repeats: one to eight of them.
    fn change(&mut self, bytes: &mut Vec<u8>) {
        const ODD: &[u8] = &[0x00, 0x01, 0x7f, 0x80, 0xfe, 0xff, 0x05, 0x06];
        for _ in 0..=self.below(8) {
            if bytes.is_empty() {
                return;
            }
            let at = self.below(bytes.len());
            match self.below(6) {
                0 => bytes[at] ^= 1 << self.below(8),
                1 => bytes[at] = ODD[self.below(ODD.len())],
                2 => {
                    let end = (at + 1 + self.below(8)).min(bytes.len());
                    bytes[at..end].fill(ODD[self.below(ODD.len())]);
                }
                3 => bytes.truncate(at),
                4 => {
                    let end = (at + self.below(64)).min(bytes.len());
                    let piece = bytes[at..end].to_vec();
                    let to = self.below(bytes.len());
                    bytes.splice(to..to, piece);
                }
                _ => {
                    let end = (at + self.below(64)).min(bytes.len());
                    bytes.drain(at..end);
                }
            }
        }
    }
}

fn read(bytes: Vec<u8>) {
    let options = ReadOptions {
        threads: 1,
        max_chunk_bytes: 64 << 20,
        ..ReadOptions::default()
    };
    let Ok(recording) = Recording::from_bytes(bytes, &options) else {
        return;
    };
    recording.signals(&|_| true).expect("reads");
    recording.messages(&|_| true, &mut |_| {}).expect("reads");
}

#[test]
fn files_changed_at_random() {
    let mut random = Random(11);
    for name in [
        "zstd.mcap",
        "lz4.mcap",
        "none.mcap",
        "no_crc.mcap",
        "tiny_chunks.mcap",
        "unchunked.mcap",
    ] {
        let good = data(name);
        let mut slowest = (0.0, 0);
        for round in 0..rounds() / 6 {
            let mut bytes = good.clone();
            random.change(&mut bytes);
            let started = Instant::now();
            read(bytes);
            let taken_s = started.elapsed().as_secs_f64();
            if taken_s > slowest.0 {
                slowest = (taken_s, round);
            }
        }
        assert!(
            slowest.0 < 10.0,
            "{name}: round {} took {:.1} s",
            slowest.1,
            slowest.0
        );
    }
}

/// Schemas and messages changed at random, in a container that is sound: what every decoder is up against.
#[test]
fn schemas_and_messages_changed_at_random() {
    let recording =
        Recording::from_bytes(data("zstd.mcap"), &ReadOptions::default()).expect("opens");
    let mut messages: Vec<Vec<Vec<u8>>> = vec![Vec::new(); recording.info().channels.len()];
    recording
        .messages(&|_| true, &mut |message| {
            messages[message.channel].push(message.data.to_vec())
        })
        .expect("reads");
    let mut random = Random(12);
    let metadata = BTreeMap::new();
    for _ in 0..rounds() / 3 {
        let shared = Shared::default();
        let mut writer =
            RecordingWriter::to_stream(shared.clone(), &WriterOptions::default()).expect("begins");
        for (info, messages) in recording.info().channels.iter().zip(&messages) {
            let mut schema_data = info.schema_data.to_vec();
            if random.below(2) == 0 {
                random.change(&mut schema_data);
            }
            let channel = RawChannel {
                topic: &info.topic,
                message_encoding: &info.encoding,
                schema_name: &info.schema,
                schema_encoding: &info.schema_encoding,
                schema_data: &schema_data,
                metadata: &metadata,
            };
            let channel = writer.raw_channel(&channel).expect("opens");
            for message in messages.iter().take(4) {
                let mut message = message.clone();
                random.change(&mut message);
                writer
                    .message(channel, 5, message.as_slice())
                    .expect("writes");
            }
        }
        writer.finish().expect("finishes");
        let bytes = shared.take();
        read(bytes);
    }
}

/// Every number that messages of a channel give, with its path and log time, and how many messages cannot be decoded.
fn numbers(info: &ChannelInfo, messages: &[Vec<u8>], first: i64) -> (Vec<(String, i64, u64)>, u64) {
    let shared = Shared::default();
    let mut writer =
        RecordingWriter::to_stream(shared.clone(), &WriterOptions::default()).expect("begins");
    let channel = RawChannel {
        topic: &info.topic,
        message_encoding: &info.encoding,
        schema_name: &info.schema,
        schema_encoding: &info.schema_encoding,
        schema_data: &info.schema_data,
        metadata: &BTreeMap::new(),
    };
    let channel = writer.raw_channel(&channel).expect("opens");
    for (t_ns, message) in (first..).zip(messages) {
        let message = message.as_slice();
        writer.message(channel, t_ns, message).expect("writes");
    }
    writer.finish().expect("finishes");
    let bytes = shared.take();
    let recording = Recording::from_bytes(bytes, &ReadOptions::default()).expect("opens");
    let (signals, findings) = recording.signals(&|_| true).expect("reads");
    let mut numbers = Vec::new();
    for signal in signals {
        for (t_ns, value) in signal.times_ns.iter().zip(&signal.values) {
            numbers.push((signal.path.clone(), *t_ns, value.to_bits()));
        }
    }
    numbers.sort();
    let broken = findings.iter().filter(|f| f.kind == Kind::Undecodable);
    (numbers, broken.map(|f| f.count).sum())
}

/// Messages that lie like the one before are decoded together, several times quicker: they must not mean anything else than alone.
#[test]
fn messages_mean_the_same_among_others() {
    let recording = Recording::open(&path("zstd.mcap"), &ReadOptions::default()).expect("opens");
    let mut messages: Vec<Vec<Vec<u8>>> = vec![Vec::new(); recording.info().channels.len()];
    recording
        .messages(&|_| true, &mut |message| {
            messages[message.channel].push(message.data.to_vec())
        })
        .expect("reads");
    let mut random = Random(13);
    for round in 0..rounds() / 30 {
        for (info, messages) in recording.info().channels.iter().zip(&messages) {
            let mut chosen = Vec::new();
            for _ in 0..6 {
                let mut message = messages[random.below(4)].clone();
                if random.below(3) == 0 {
                    // How CDR is represented is learned from the messages before: the header stays.
                    let header = message[..4.min(message.len())].to_vec();
                    random.change(&mut message);
                    if info.encoding == "cdr" {
                        let length = message.len().min(4);
                        message[..length].copy_from_slice(&header[..length]);
                    }
                }
                chosen.push(message);
            }
            let together = numbers(info, &chosen, 0);
            let mut alone = (Vec::new(), 0);
            for (t_ns, message) in (0..).zip(chosen.chunks(1)) {
                let one = numbers(info, message, t_ns);
                alone.0.extend(one.0);
                alone.1 += one.1;
            }
            alone.0.sort();
            assert!(together == alone, "{} in round {round}", info.topic);
        }
    }
}

/// Definitions that would multiply without end.
#[test]
fn a_stream_without_end_that_is_no_recording_is_refused() {
    for byte in [0, 1, b'x', 0x89] {
        let mut endless = io::repeat(byte).take(1 << 40);
        let refused = Recording::from_stream(&mut endless, "pipe", &ReadOptions::default());
        let error = refused.expect_err("no recording").to_string();
        assert!(error.contains("pipe: is not an MCAP"), "{error}");
        assert!(endless.limit() > (1 << 40) - 100);
    }
}

#[test]
fn schemas_that_explode_are_refused() {
    let nest = |depth: usize, brackets: &str| {
        let mut text = format!("p/T1{brackets} a\n");
        for level in 1..depth {
            text += &format!("===\nMSG: p/T{level}\np/T{}{brackets} a\n", level + 1);
        }
        text + &format!("===\nMSG: p/T{depth}\nfloat64 x\n")
    };
    for (schema, data, wanted) in [
        (
            nest(6, "[60]"),
            vec![0u8; 64],
            "has more than 100000 fields",
        ),
        (nest(70, ""), vec![0u8; 64], "nested more than 64 deep"),
    ] {
        let shared = Shared::default();
        let mut writer =
            RecordingWriter::to_stream(shared.clone(), &WriterOptions::default()).expect("begins");
        let channel = RawChannel {
            topic: "/a",
            message_encoding: "cdr",
            schema_name: "p/msg/Top",
            schema_encoding: "ros2msg",
            schema_data: schema.as_bytes(),
            metadata: &BTreeMap::new(),
        };
        let channel = writer.raw_channel(&channel).expect("opens");
        let message = [&[0, 1, 0, 0], data.as_slice()].concat();
        writer
            .message(channel, 0, message.as_slice())
            .expect("writes");
        writer.finish().expect("finishes");
        let bytes = shared.take();
        let recording = Recording::from_bytes(bytes, &ReadOptions::default()).expect("opens");
        let (signals, findings) = recording.signals(&|_| true).expect("reads");
        assert!(signals.is_empty());
        assert!(findings[0].text.contains(wanted), "{findings:?}");
    }
}

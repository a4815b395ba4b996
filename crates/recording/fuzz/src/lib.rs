//! What the fuzz targets share: any schema and any messages in a container that is sound.
//!
//! ```text
//! cargo +nightly fuzz run TARGET corpus/TARGET -- -max_total_time=600 -rss_limit_mb=512 -timeout=10
//! ```
//! with a decoder as the target, `ros2msg`, `ros2idl`, `ros1`, `protobuf` or `json`, or with `container`. The seeds in `corpus` are made by
//! `cargo run --bin seeds`; `tar -xf found.tar.zst -C corpus` adds what earlier runs found, `cargo +nightly fuzz cmin` thins it.

use recording::read::{ReadOptions, Recording};

/// Limits that keep a run quick; what they limit is tested elsewhere.
pub fn options() -> ReadOptions {
    ReadOptions {
        threads: 1,
        max_chunk_bytes: 64 << 20,
        ..ReadOptions::default()
    }
}

/// Puts the first bytes and the rest apart, where the first one or two say how many they are.
fn part<const N: usize>(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<N>()?;
    let mut wide = [0; 8];
    wide[..N].copy_from_slice(length);
    Some(rest.split_at((u64::from_le_bytes(wide) as usize).min(rest.len())))
}

/// Decodes an input: the schema's name (its length in one byte before it), the schema (two), messages (two each).
///
/// Items are called by their place, then by their names. Messages of ROS 1 are decoded after others and on their own; both have to give the same numbers.
pub fn decode(message_encoding: &str, schema_encoding: &str, input: &[u8]) {
    let Some((name, rest)) = part::<1>(input) else {
        return;
    };
    let Some((schema, mut rest)) = part::<2>(rest) else {
        return;
    };
    let (Ok(name), mut messages) = (str::from_utf8(name), Vec::new()) else {
        return;
    };
    while let Some((message, others)) = part::<2>(rest) {
        messages.push(message);
        rest = others;
        if messages.len() == 64 {
            break;
        }
    }
    let read = |messages: &[&[u8]], first: u64, by_name: bool| {
        let bytes = file(
            message_encoding,
            schema_encoding,
            name,
            schema,
            messages,
            first,
        );
        let options = ReadOptions {
            by_name,
            ..options()
        };
        let recording = Recording::from_bytes(bytes, &options).expect("opens");
        let (signals, _) = recording.signals(&|_| true).expect("reads");
        let mut values = Vec::new();
        for signal in signals {
            for (t_ns, value) in signal.times_ns.iter().zip(&signal.values) {
                values.push((signal.path.clone(), *t_ns, value.to_bits()));
            }
        }
        values
    };
    for by_name in [false, true] {
        let mut together = read(&messages, 0, by_name);
        // The other encodings learn from the messages before: readings of CDR, keys of maps.
        if message_encoding == "ros1" && messages.len() <= 4 && together.len() < 4096 {
            let mut alone: Vec<_> = (0..)
                .zip(messages.chunks(1))
                .flat_map(|(k, message)| read(message, k, by_name))
                .collect();
            together.sort();
            alone.sort();
            assert_eq!(together, alone);
        }
    }
}

/// An unchunked file with one channel, log times counted from `first`.
pub fn file(
    message_encoding: &str,
    schema_encoding: &str,
    name: &str,
    schema: &[u8],
    messages: &[&[u8]],
    first: u64,
) -> Vec<u8> {
    const MAGIC: &[u8] = b"\x89MCAP0\r\n";
    let text = |bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes(), bytes].concat();
    let mut bytes = MAGIC.to_vec();
    let mut record = |opcode: u8, parts: &[&[u8]]| {
        let body = parts.concat();
        bytes.push(opcode);
        bytes.extend_from_slice(&(body.len() as u64).to_le_bytes());
        bytes.extend_from_slice(&body);
    };
    record(1, &[&text(b""), &text(b"fuzz")]);
    record(
        3,
        &[
            &[1, 0],
            &text(name.as_bytes()),
            &text(schema_encoding.as_bytes()),
            &text(schema),
        ],
    );
    record(
        4,
        &[
            &[1, 0, 1, 0],
            &text(b"/a"),
            &text(message_encoding.as_bytes()),
            &[0; 4],
        ],
    );
    for (time, message) in (first..).zip(messages) {
        let time = time.to_le_bytes();
        record(5, &[&[1, 0, 0, 0, 0, 0], &time, &time, message]);
    }
    record(15, &[&[0; 4]]);
    record(2, &[&[0; 20]]);
    bytes.extend_from_slice(MAGIC);
    bytes
}

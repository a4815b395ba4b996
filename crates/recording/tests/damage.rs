//! Damaged files: cut anywhere, with flipped bits, with lies in them. Nothing panics or hangs, whole chunks are used, losses are said.

use std::{
    collections::HashMap,
    hash::{DefaultHasher, Hash, Hasher},
    path::PathBuf,
};

use recording::{
    Finding, Kind,
    read::{ReadError, ReadOptions, Recording},
};

fn data(name: &str) -> Vec<u8> {
    std::fs::read(
        PathBuf::from(env!("CARGO_MANIFEST_DIR"))
            .join("tests/data")
            .join(name),
    )
    .expect("test data")
}

fn options() -> ReadOptions {
    ReadOptions {
        threads: 1,
        ..ReadOptions::default()
    }
}

/// Every message that a file gives: hash of the topic and log time to a digest of its numbers, each with its path.
type Content = HashMap<(u64, i64), u64>;

fn hash(text: &str) -> u64 {
    let mut hasher = DefaultHasher::new();
    text.hash(&mut hasher);
    hasher.finish()
}

/// Bits that depend on all bits (the end of Steele's SplitMix64).
fn mix(mut bits: u64) -> u64 {
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

struct Read {
    content: Content,
    findings: Vec<Finding>,
    skipped: u64,
}

fn read(bytes: Vec<u8>) -> Result<Read, ReadError> {
    read_some(bytes, &|_| true)
}

/// So many shares of the columns are looked at in turn where files are damaged in thousands of places.
const SHARES: usize = 8;

/// All messages with every eighth column, told by the hash of its path.
fn read_share(bytes: Vec<u8>, share: usize) -> Result<Read, ReadError> {
    read_some(bytes, &|path| {
        hash(path) as usize % SHARES == share % SHARES
    })
}

/// What a sound file gives, by share.
fn shares(bytes: &[u8]) -> Vec<Content> {
    (0..SHARES)
        .map(|share| read_share(bytes.to_vec(), share).expect("reads").content)
        .collect()
}

fn read_some(bytes: Vec<u8>, select: &(dyn Fn(&str) -> bool + Sync)) -> Result<Read, ReadError> {
    let recording = Recording::from_bytes(bytes, &options())?;
    let mut content = Content::new();
    let findings = recording.stream(select, &mut |batch| {
        // A sum does not depend on the order of the columns.
        let mut digests = vec![0u64; batch.times_ns.len()];
        for column in batch.columns {
            let path = hash(column.path);
            for (position, value) in column.values.iter().enumerate() {
                let row = column.rows.map_or(position, |rows| rows[position] as usize);
                digests[row] = digests[row].wrapping_add(mix(path ^ mix(value.to_bits())));
            }
        }
        let topic = hash(batch.topic);
        for (t_ns, digest) in batch.times_ns.iter().zip(digests) {
            let message = content.entry((topic, *t_ns)).or_default();
            *message = message.wrapping_add(digest);
        }
    })?;
    Ok(Read {
        content,
        findings,
        skipped: recording.skipped_messages(),
    })
}

/// Where the chunks are.
fn chunks(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    let mut chunks = Vec::new();
    let mut at = 8;
    while at + 9 < bytes.len() - 8 {
        let length =
            u64::from_le_bytes(bytes[at + 1..at + 9].try_into().expect("eight bytes")) as usize;
        if bytes[at] == 0x06 {
            chunks.push(at..at + 9 + length);
        }
        at += 9 + length;
    }
    chunks
}

/// What a damaged file gives must be among what the whole one gives, number by number; if less, that must be said.
fn part_of(whole: &Content, damaged: &Read, what: &str) {
    for (key, message) in &damaged.content {
        assert_eq!(
            whole.get(key),
            Some(message),
            "{what}: {key:?} is not what was written"
        );
    }
    if damaged.content.len() < whole.len() {
        assert!(
            damaged
                .findings
                .iter()
                .any(|finding| finding.kind.is_loss()),
            "{what}: a loss is not said: {:?}",
            damaged.findings
        );
    }
}

/// The same numbers on every machine: a 64-bit linear congruence (Knuth's MMIX).
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 33) as usize % bound
    }
}

/// How many messages a file gives that is cut to each of these lengths.
fn messages_left(name: &str, bytes: &[u8], whole: &[Content], lengths: &[usize]) -> Vec<usize> {
    let left = |&length: &usize| {
        let what = format!("{name} cut to {length} bytes");
        let damaged = match read_share(bytes[..length].to_vec(), length) {
            Ok(damaged) => damaged,
            Err(ReadError::Empty { .. } | ReadError::NotMcap { .. }) if length < 40 => return 0,
            Err(error) => panic!("{what}: {error}"),
        };
        part_of(&whole[length % SHARES], &damaged, &what);
        assert!(
            damaged
                .findings
                .iter()
                .any(|finding| finding.kind.is_loss()),
            "{what}: the cut is not said"
        );
        damaged.content.len()
    };
    lengths.iter().map(left).collect()
}

#[test]
fn cut_at_every_byte() {
    for name in ["zstd.mcap", "none.mcap", "unchunked.mcap"] {
        let bytes = data(name);
        let whole = shares(&bytes);
        // Optimised builds try every byte of the last 64 KB, others some.
        let step = if cfg!(debug_assertions) { 101 } else { 1 };
        let first = bytes.len().saturating_sub(64 << 10);
        let lengths: Vec<usize> = (first..bytes.len()).step_by(step).collect();
        // Two threads, since this is the longest test of the crate.
        let (front, back) = lengths.split_at(lengths.len() / 2);
        let left = std::thread::scope(|scope| {
            let other = scope.spawn(|| messages_left(name, &bytes, &whole, front));
            let back = messages_left(name, &bytes, &whole, back);
            let mut left = other.join().expect("the first half holds");
            left.extend(back);
            left
        });
        for (pair, length) in left.windows(2).zip(&lengths[1..]) {
            assert!(
                pair[1] >= pair[0],
                "{name} cut to {length} bytes: fewer messages than with fewer bytes"
            );
        }
        assert_eq!(
            left.last(),
            Some(&whole[0].len()),
            "{name}: with only the tail missing all messages are there"
        );
    }
}

#[test]
fn cut_at_random_places() {
    let bytes = data("tiny_chunks.mcap");
    let whole = shares(&bytes);
    let mut random = Random(1);
    for _ in 0..1000 / if cfg!(debug_assertions) { 10 } else { 1 } {
        let length = 40 + random.below(bytes.len() - 40);
        let damaged = read_share(bytes[..length].to_vec(), length).expect("opens");
        let whole = &whole[length % SHARES];
        part_of(whole, &damaged, &format!("cut to {length} bytes"));
    }
}

#[test]
fn single_flipped_bits() {
    let mut random = Random(2);
    for name in [
        "zstd.mcap",
        "lz4.mcap",
        "none.mcap",
        "tiny_chunks.mcap",
        "unchunked.mcap",
        "no_index.mcap",
    ] {
        let bytes = data(name);
        let whole = shares(&bytes);
        for _ in 0..1000 / if cfg!(debug_assertions) { 10 } else { 1 } {
            let (at, bit) = (random.below(bytes.len()), random.below(8));
            let mut flipped = bytes.clone();
            flipped[at] ^= 1 << bit;
            let what = format!("{name} with bit {bit} of byte {at} flipped");
            let damaged = match read_share(flipped, at) {
                Ok(damaged) => damaged,
                Err(error) => panic!("{what}: {error}"),
            };
            // Outside chunks only the checksum over all data protects numbers: they may be wrong, but not in silence.
            let warned = damaged.findings.iter().any(|finding| {
                (finding.kind == Kind::BadCrc && finding.text.contains("may be wrong"))
                    || finding.kind.is_loss()
                    || finding.kind == Kind::BadSchema
            });
            let unprotected = name == "unchunked.mcap";
            if !(unprotected && warned) {
                part_of(&whole[at % SHARES], &damaged, &what);
            }
        }
    }
}

/// Message indexes say nothing that chunks do not: whatever bit of one's head is flipped, opcode, length, channel or inner length, every message is read.
#[test]
fn a_bad_message_index_costs_nothing() {
    let options = mcap::WriteOptions::new()
        .compression(None)
        .chunk_size(Some(2000));
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = options.create(&mut bytes).expect("begins");
    let channels = ["/a", "/b"].map(|topic| {
        let channel = writer.add_channel(0, topic, "json", &Default::default());
        channel.expect("a channel")
    });
    for k in 0..600u64 {
        let header = mcap::records::MessageHeader {
            channel_id: channels[k as usize % 2],
            sequence: k as u32,
            log_time: 1_700_000_000_000_000_000 + k * 10_000_000,
            publish_time: 0,
        };
        let data = format!("[{},{k}]", mix(k) >> 20);
        let written = writer.write_to_known_channel(&header, data.as_bytes());
        written.expect("writes");
    }
    writer.finish().expect("ends");
    drop(writer);
    let bytes = bytes.into_inner();
    let whole = read(bytes.clone()).expect("reads").content;
    let (mut at, mut indexes) = (8, Vec::new());
    while at + 9 < bytes.len() {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().expect("eight bytes"));
        if bytes[at] == 0x07 {
            indexes.push(at);
        }
        at += 9 + length as usize;
    }
    assert!(indexes.len() > 5, "{}", indexes.len());
    for at in indexes {
        for bit in 0..15 * 8 {
            let mut bad = bytes.clone();
            bad[at + bit / 8] ^= 1 << (bit % 8);
            let found = read(bad).expect("reads").content;
            let lost = whole.keys().filter(|key| !found.contains_key(key)).count();
            assert_eq!(lost, 0, "bit {bit} of the index at {at}");
        }
    }
}

#[test]
fn one_bad_chunk_costs_one_chunk() {
    let bytes = data("zstd.mcap");
    let whole = read(bytes.clone()).expect("reads").content;
    let mut broken = bytes.clone();
    // The second chunk, in its middle.
    let chunks = chunks(&bytes);
    let at = chunks[1].start + chunks[1].len() / 2;
    broken[at] ^= 0x55;
    let damaged = read(broken).expect("reads");
    part_of(&whole, &damaged, "a broken chunk");
    let losses: Vec<&Finding> = damaged
        .findings
        .iter()
        .filter(|finding| finding.kind.is_loss())
        .collect();
    assert_eq!(losses.len(), 1, "{losses:?}");
    assert!(
        matches!(losses[0].kind, Kind::BadCrc | Kind::BadChunk),
        "{losses:?}"
    );
    assert_eq!(
        damaged.skipped as usize,
        whole.len() - damaged.content.len()
    );
    assert!(damaged.skipped > 0 && damaged.content.len() > whole.len() / 2);
}

/// A file of noise, which packs badly, that is not finished: one chunk, and what is left of it is what has been written so far.
fn unfinished(compression: Option<mcap::Compression>, messages: u64) -> Vec<u8> {
    let options = mcap::WriteOptions::new()
        .compression(compression)
        // Several would keep it to themselves for longer.
        .compression_threads(0)
        .chunk_size(None);
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = options.create(&mut bytes).expect("begins");
    let channel = writer
        .add_channel(0, "/noise", "json", &Default::default())
        .expect("a channel");
    let mut random = Random(3);
    for k in 0..messages {
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: k,
            publish_time: k,
        };
        let noise: Vec<String> = (0..64).map(|_| random.below(1 << 30).to_string()).collect();
        let data = format!("[{}]", noise.join(","));
        writer
            .write_to_known_channel(&header, data.as_bytes())
            .expect("writes");
    }
    // A killed program closes nothing.
    std::mem::forget(writer);
    bytes.into_inner()
}

#[test]
fn what_is_left_of_a_cut_chunk_is_read() {
    const MESSAGES: u64 = 2000;
    for compression in [None, Some(mcap::Compression::Zstd)] {
        let bytes = unfinished(compression, MESSAGES);
        let mut before = 0;
        for eighths in [4, 5, 6, 7, 8] {
            let damaged = read(bytes[..bytes.len() * eighths / 8].to_vec()).expect("reads");
            let messages = damaged.content.len();
            let share = messages as f64 / MESSAGES as f64;
            let part = eighths as f64 / 8.0;
            // Packed data come in blocks of 128 KiB, of some 1.2 MB in all.
            assert!(
                (part - 0.25..=part).contains(&share) && messages > before,
                "{compression:?}, {eighths}/8: {messages} messages"
            );
            before = messages;
            // Its first messages, without a gap.
            let times: std::collections::HashSet<i64> =
                damaged.content.keys().map(|(_, t)| *t).collect();
            assert!((0..messages as i64).all(|t| times.contains(&t)));
            let losses: Vec<&Finding> = damaged
                .findings
                .iter()
                .filter(|finding| finding.kind.is_loss())
                .collect();
            assert_eq!(losses.len(), 1, "{losses:?}");
            assert_eq!(losses[0].kind, Kind::Truncated);
            assert!(losses[0].text.contains("no checksum"), "{losses:?}");
        }
    }
}

#[test]
fn a_cut_chunk_of_many_pieces_is_read_once() {
    // Longer than a piece in which chunks are unpacked.
    let bytes = unfinished(None, 8000);
    assert!(bytes.len() > 5 << 20);
    let damaged = read(bytes).expect("reads");
    assert_eq!(damaged.content.len(), 8000);
}

/// Puts a record together.
fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    let mut record = vec![opcode];
    record.extend_from_slice(&(body.len() as u64).to_le_bytes());
    record.extend_from_slice(body);
    record
}

fn text(value: &str) -> Vec<u8> {
    let mut bytes = (value.len() as u32).to_le_bytes().to_vec();
    bytes.extend_from_slice(value.as_bytes());
    bytes
}

const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// A file with one JSON channel and the records given, without a summary.
fn file(records: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend(record(1, &[text(""), text("test")].concat()));
    for record in records {
        bytes.extend(record);
    }
    bytes.extend(record(15, &[0; 4]));
    bytes.extend(record(2, &[0; 20]));
    bytes.extend_from_slice(MAGIC);
    bytes
}

fn channel(id: u16, encoding: &str) -> Vec<u8> {
    record(
        4,
        &[
            &id.to_le_bytes()[..],
            &[0, 0],
            &text("/a"),
            &text(encoding),
            &[0; 4],
        ]
        .concat(),
    )
}

fn message(id: u16, time: u64, data: &[u8]) -> Vec<u8> {
    record(
        5,
        &[
            &id.to_le_bytes()[..],
            &[0; 4],
            &time.to_le_bytes(),
            &time.to_le_bytes(),
            data,
        ]
        .concat(),
    )
}

fn chunk(compression: &str, uncompressed: u64, crc: u32, records: &[u8]) -> Vec<u8> {
    let length = (records.len() as u64).to_le_bytes();
    record(
        6,
        &[
            &[0; 16][..],
            &uncompressed.to_le_bytes(),
            &crc.to_le_bytes(),
            &text(compression),
            &length,
            records,
        ]
        .concat(),
    )
}

fn lines(bytes: Vec<u8>) -> (usize, Vec<String>) {
    let read = read(bytes).expect("opens");
    (
        read.content.len(),
        read.findings
            .iter()
            .map(|finding| format!("{} {finding}", finding.kind))
            .collect(),
    )
}

#[test]
fn a_chunk_that_claims_a_terabyte_is_refused() {
    let records = zstd::bulk::compress(&vec![0; 1 << 20], 1).expect("compresses");
    let (messages, lines) = lines(file(&[
        channel(1, "json"),
        chunk("zstd", 1 << 40, 0, &records),
        message(1, 7, b"1"),
    ]));
    assert_eq!(messages, 1);
    assert_eq!(
        lines,
        [
            "too_large the chunk at byte 60 claims 1099511627776 bytes unpacked; the limit is 4294967296; it was left out"
        ]
    );
}

#[test]
fn what_is_wrong_is_named() {
    let inner = message(1, 5, b"{\"x\": 1}");
    let good = chunk("", inner.len() as u64, crc32fast::hash(&inner), &inner);
    for (records, messages, expected) in [
        (
            vec![
                channel(1, "json"),
                chunk("zsdt", 10, 0, b"abc"),
                good.clone(),
            ],
            1,
            vec![
                "bad_chunk the chunk at byte 60 is compressed with \"zsdt\"; zstd, lz4 and none can be read; it was left out",
            ],
        ),
        (
            vec![
                channel(1, "json"),
                chunk("", inner.len() as u64, 1, &inner),
                good.clone(),
            ],
            1,
            vec![
                "bad_crc the chunk at byte 60 does not match its checksum (00000001 expected, CRC found); it was left out",
            ],
        ),
        (
            vec![
                channel(1, "h264"),
                message(1, 5, b"abc"),
                message(1, 6, b"abc"),
            ],
            // Without values, but with their times.
            2,
            vec![
                "no_decoder /a: skipped 2 messages: encoding \"h264\" with schema encoding \"\" has no decoder; there are cdr/ros2msg, cdr/ros2idl, cdr/omgidl, ros1/ros1msg, protobuf/protobuf, json",
            ],
        ),
        (
            vec![channel(1, "json"), message(2, 5, b"1"), message(1, 6, b"1")],
            1,
            vec!["unknown_channel skipped 1 message: messages of channel 2, which nothing defines"],
        ),
        (
            vec![
                channel(1, "json"),
                message(1, 5, b"{\"x\": "),
                message(1, 6, b"1"),
                message(1, 7, b"nan"),
            ],
            1,
            vec![
                "undecodable /a: 2 messages could not be decoded; the first, at 0.000 s: JSON message of 6 bytes: EOF while parsing a value at line 1 column 6",
            ],
        ),
        (
            vec![
                channel(1, "json"),
                record(0x33, b"abc"),
                message(1, 6, b"1"),
                record(0x91, b"private"),
            ],
            1,
            vec!["bad_record 1 records of the unknown kind 0x33 were stepped over"],
        ),
        (
            vec![
                channel(1, "json"),
                message(1, u64::MAX, b"1"),
                message(1, 6, b"1"),
            ],
            1,
            vec![
                "time_out_of_range /a: log times beyond the year 2262 cannot be held in nanoseconds",
            ],
        ),
    ] {
        let crc = format!("{:08x}", crc32fast::hash(&inner));
        let expected: Vec<String> = expected
            .iter()
            .map(|line| line.replace("CRC", &crc))
            .collect();
        assert_eq!(lines(file(&records)), (messages, expected));
    }
}

#[test]
fn several_frames_and_spare_bytes() {
    let first = message(1, 5, b"{\"x\": 1}");
    let second = message(1, 6, b"{\"x\": 2}");
    let all = [first.clone(), second.clone()].concat();
    let zstd = [
        zstd::bulk::compress(&first, 3),
        zstd::bulk::compress(&second, 3),
    ]
    .map(|frame| frame.expect("compresses"))
    .concat();
    let lz4 = [&first, &second]
        .map(|bytes| {
            let mut frame = lz4_flex::frame::FrameEncoder::new(Vec::new());
            std::io::Write::write_all(&mut frame, bytes).expect("compresses");
            frame.finish().expect("compresses")
        })
        .concat();
    let crc = crc32fast::hash(&all);
    let mut long = chunk("", all.len() as u64, crc, &all);
    // Bytes after the last field of a record are allowed.
    long.extend_from_slice(b"spare");
    let length = (long.len() - 9) as u64;
    long[1..9].copy_from_slice(&length.to_le_bytes());
    for chunk in [
        chunk("zstd", all.len() as u64, crc, &zstd),
        chunk("lz4", all.len() as u64, crc, &lz4),
        long,
    ] {
        assert_eq!(lines(file(&[channel(1, "json"), chunk])), (2, vec![]));
    }
}

#[test]
fn a_large_chunk_is_read_in_pieces() {
    // 40 MB of messages in one chunk: more than is unpacked in one go.
    let mut records = Vec::new();
    for i in 0..1_000_000u64 {
        records.extend(message(1, i, b"{\"x\": 1}"));
    }
    let long = [b"\"".as_slice(), &vec![b'x'; 5 << 20], b"\""].concat();
    records.extend(message(1, 1_000_000, &long));
    records.extend(message(1, 1_000_001, b"{\"x\": 3}"));
    let packed = zstd::bulk::compress(&records, 1).expect("compresses");
    let crc = crc32fast::hash(&records);
    let bytes = file(&[
        channel(1, "json"),
        chunk("zstd", records.len() as u64, crc, &packed),
    ]);
    let recording = Recording::from_bytes(bytes.clone(), &options()).expect("opens");
    let (signals, findings) = recording.signals(&|_| true).expect("reads");
    assert_eq!(findings, []);
    assert_eq!(recording.info().messages, 1_000_002);
    assert_eq!(
        (signals[0].values.len(), signals[0].values.last()),
        (1_000_001, Some(&3.0))
    );

    let options = ReadOptions {
        max_message_bytes: 4 << 20,
        ..options()
    };
    let recording = Recording::from_bytes(bytes, &options).expect("opens");
    let (signals, findings) = recording.signals(&|_| true).expect("reads");
    assert_eq!(signals[0].values.len(), 1_000_001);
    assert_eq!(
        findings[0].text,
        "1 message is longer than the limit of 4194304"
    );

    let wrong = file(&[
        channel(1, "json"),
        chunk("zstd", records.len() as u64, crc ^ 1, &packed),
    ]);
    let recording = Recording::from_bytes(wrong, &self::options()).expect("opens");
    let (signals, findings) = recording.signals(&|_| true).expect("reads");
    assert!(
        signals.is_empty() && findings[0].kind == Kind::BadCrc,
        "{findings:?}"
    );
}

#[test]
fn what_is_no_recording_is_refused_in_a_sentence() {
    let error = |bytes: &[u8]| {
        Recording::from_bytes(bytes.to_vec(), &options())
            .expect_err("refused")
            .to_string()
    };
    assert_eq!(
        error(b""),
        "standard input: is empty; expected an MCAP recording"
    );
    assert_eq!(
        error(b"t,x,y\n1,2,3\n"),
        "standard input: is not an MCAP recording (it begins with \"t,x,y\\n1,\"); `analyze ingest` turns logs of other formats into one"
    );
    for (begin, what) in [
        (
            &b"#ROSBAG V2.0\n"[..],
            "but a ROS 1 bag; `mcap convert` makes",
        ),
        (b"SQLite format 3\0", "but a ROS 2 bag in SQLite"),
        (
            b"\x1f\x8b\x08\0\0\0\0\0\0",
            "but packed with gzip; unpack it first",
        ),
    ] {
        let said = error(begin);
        assert!(
            said.contains(&format!("is not an MCAP recording {what}")),
            "{said}"
        );
    }
    let error = Recording::open(std::path::Path::new("no/such.mcap"), &options())
        .expect_err("refused")
        .to_string();
    assert!(
        error.starts_with("no/such.mcap: cannot be read: No such file"),
        "{error}"
    );
    let error = Recording::open(std::path::Path::new("."), &options())
        .expect_err("refused")
        .to_string();
    assert_eq!(error, ".: cannot be read: it is a folder");
    // As ROS 2 leaves a bag, cut or not.
    let bag = tempfile::tempdir().expect("a folder");
    let told = |name: &str| {
        std::fs::write(bag.path().join(name), "").expect("writes");
        let error = Recording::open(bag.path(), &options()).expect_err("refused");
        error.to_string()
    };
    let (bare, one, two) = (
        told("metadata.yaml"),
        told("bag_0.mcap"),
        told("bag_1.mcap"),
    );
    assert!(bare.ends_with("it is a folder"), "{bare}");
    let inside = bag.path().join("bag_0.mcap").display().to_string();
    assert!(
        one.ends_with(&format!("give what is in it: {inside}")),
        "{one}"
    );
    let merge = format!(
        "`analyze merge {} --out FILE.mcap` makes one recording of the 2 in it",
        bag.path().display()
    );
    assert!(two.ends_with(&merge), "{two}");
}

/// A sound file but for its summary, which holds the records given.
fn summarised(data: &[Vec<u8>], summary: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = b"\x89MCAP0\r\n".to_vec();
    bytes.extend(data.concat());
    bytes.extend(record(0x0f, &[0; 4]));
    let start = bytes.len() as u64;
    let mut closing = summary.concat();
    closing.extend([0x02, 20, 0, 0, 0, 0, 0, 0, 0]);
    closing.extend(start.to_le_bytes());
    closing.extend([0; 8]);
    let crc = crc32fast::hash(&closing);
    bytes.extend(closing);
    bytes.extend(crc.to_le_bytes());
    bytes.extend(b"\x89MCAP0\r\n");
    bytes
}

fn statistics(chunks: u32, times: [u64; 2], per_channel: &[(u16, u64)]) -> Vec<u8> {
    let messages: u64 = per_channel.iter().map(|(_, count)| count).sum();
    let mut body = messages.to_le_bytes().to_vec();
    body.extend([0, 0]);
    body.extend((per_channel.len() as u32).to_le_bytes());
    body.extend([0; 8]);
    body.extend(chunks.to_le_bytes());
    body.extend(times.iter().flat_map(|time| time.to_le_bytes()));
    body.extend((10 * per_channel.len() as u32).to_le_bytes());
    for (id, count) in per_channel {
        body.extend(id.to_le_bytes());
        body.extend(count.to_le_bytes());
    }
    record(0x0b, &body)
}

/// A JSON channel of a topic of its own.
fn topic(id: u16, name: &str) -> Vec<u8> {
    let mut body = id.to_le_bytes().to_vec();
    body.extend([0, 0]);
    body.extend(text(name));
    body.extend(text("json"));
    body.extend([0; 4]);
    record(0x04, &body)
}

/// What the summary says is believed only as long as the data do not contradict it.
#[test]
fn a_summary_that_lies_is_found_out() {
    let inner = [
        topic(1, "/a"),
        topic(2, "/b"),
        message(1, 5, b"1"),
        message(2, 6, b"2"),
        message(1, 9, b"3"),
    ]
    .concat();
    let data = [chunk(
        "",
        inner.len() as u64,
        crc32fast::hash(&inner),
        &inner,
    )];
    let honest = [topic(1, "/a"), topic(2, "/b")].concat();
    for (summary, said) in [
        (
            vec![honest.clone(), statistics(1, [5, 9], &[(1, 2), (2, 1)])],
            vec![],
        ),
        (
            vec![
                honest.clone(),
                statistics(1, [0, 1 << 40], &[(1, 2), (2, 1)]),
            ],
            vec![
                "summary_times the summary says that log times go from -0.000 s to 1099.512 s after the first, they go from 0 s to 0.000 s",
            ],
        ),
        (
            vec![honest.clone(), statistics(1, [5, 9], &[(1, 1), (2, 2)])],
            vec![
                "bad_summary /a: the summary counts 1 messages of channel 1, 2 were found",
                "bad_summary /b: the summary counts 2 messages of channel 2, 1 were found",
            ],
        ),
        (
            vec![topic(1, "/a"), statistics(1, [5, 9], &[(1, 3)])],
            vec![
                "bad_summary the summary has other schemas or channels than the data, in 1 places",
            ],
        ),
        (
            vec![
                topic(1, "/b"),
                topic(2, "/a"),
                statistics(1, [5, 9], &[(1, 2), (2, 1)]),
            ],
            vec![
                "bad_summary the summary has other schemas or channels than the data, in 2 places",
                "redefined /a: its channel 1 of schema 0 is defined again and differently, as /b of schema 0: the first definition counts, and messages after the second may be wrong",
                "redefined /b: its channel 2 of schema 0 is defined again and differently, as /a of schema 0: the first definition counts, and messages after the second may be wrong",
            ],
        ),
    ] {
        let bytes = summarised(&data, &summary);
        let recording = Recording::from_bytes(bytes, &options()).expect("opens");
        recording.signals(&|_| true).expect("reads");
        assert_eq!(recording.contradicts_its_summary(), !said.is_empty());
        let recording = recording.searched();
        let (signals, findings) = recording.signals(&|_| true).expect("reads");
        let found: Vec<_> = signals
            .iter()
            .map(|signal| (signal.path.as_str(), signal.values.as_slice()))
            .collect();
        assert_eq!(found, [("/a", &[1.0, 3.0][..]), ("/b", &[2.0][..])]);
        let info = recording.info();
        assert_eq!((info.start_ns, info.end_ns, info.messages), (5, 9, 3));
        assert!(!recording.contradicts_its_summary());
        let lines: Vec<String> = findings
            .iter()
            .filter(|finding| summary.len() > 2 || finding.kind != Kind::Redefined)
            .map(|finding| format!("{} {finding}", finding.kind))
            .collect();
        assert_eq!(lines, said);
    }
}

/// Beside messages that cannot be used, a recording lasts as long as the others do, whatever its summary says.
#[test]
fn bad_messages_and_chunks_leave_the_bounds_alone() {
    let whole = |inner: &[u8], times: [u64; 2]| {
        let header = times.map(u64::to_le_bytes).concat();
        let mut chunk = chunk("", inner.len() as u64, crc32fast::hash(inner), inner);
        chunk[9..25].copy_from_slice(&header);
        chunk
    };
    let sound = [topic(1, "/a"), message(1, 5, b"1"), message(1, 9, b"2")].concat();
    let sound = whole(&sound, [5, 9]);
    let beyond = whole(&message(1, 1 << 63, b"3"), [1 << 63; 2]);
    let undecodable = whole(&message(1, 7, b"?"), [7; 2]);
    let mut broken = whole(&message(1, 12, b"3"), [12; 2]);
    *broken.last_mut().expect("has bytes") ^= 1;
    let lies = "summary_times";
    for (bad, times, end_ns, said) in [
        (&beyond, [5, 1 << 63], 9, vec!["time_out_of_range"]),
        (&beyond, [0, 0], 9, vec![lies, "time_out_of_range"]),
        (&undecodable, [5, 9], 9, vec!["undecodable"]),
        (&undecodable, [0, 0], 9, vec![lies, "undecodable"]),
        (&undecodable, [5, 1 << 63], 9, vec![lies, "undecodable"]),
        // What a lost chunk's header says is all that is known of its times.
        (&broken, [5, 12], 12, vec!["bad_crc", "bad_summary"]),
        (&broken, [0, 0], 9, vec![lies, "bad_crc"]),
    ] {
        let summary = [topic(1, "/a"), statistics(2, times, &[(1, 3)])];
        let bytes = summarised(&[sound.clone(), bad.clone()], &summary);
        let mut recording = Recording::from_bytes(bytes, &options()).expect("opens");
        recording.stream(&|_| true, &mut |_| ()).expect("reads");
        if recording.contradicts_its_summary() {
            recording = recording.searched();
        }
        let findings = recording.stream(&|_| true, &mut |_| ()).expect("reads");
        let mut kinds: Vec<String> = findings.iter().map(|f| f.kind.to_string()).collect();
        kinds.sort_unstable_by_key(|kind| kind != lies);
        let info = recording.info();
        assert_eq!((info.start_ns, info.end_ns), (5, end_ns), "{times:?}");
        assert_eq!(kinds, said, "{times:?}");
    }
}

/// Files put one behind the other are no recording of both: what the first ends before is lost.
#[test]
fn recordings_behind_the_end_are_lost() {
    let one = summarised(
        &[topic(1, "/a"), message(1, 5, b"1"), message(1, 9, b"2")],
        &[topic(1, "/a"), statistics(0, [5, 9], &[(1, 2)])],
    );
    let bytes = [&one[..], &one, &one].concat();
    let read = read(bytes).expect("opens");
    assert_eq!((read.content.len(), read.skipped), (2, 4));
    let found: Vec<String> = read.findings.iter().map(ToString::to_string).collect();
    let said = format!(
        "another recording follows the end of this one, of 4 messages and {} bytes from byte {} on, and was left out: make it a file of its own",
        2 * one.len(),
        one.len()
    );
    assert_eq!(found, [said]);
}

#[test]
fn a_second_definition_is_named_with_its_topic() {
    let (_, lines) = lines(file(&[
        topic(1, "/a"),
        message(1, 5, b"1"),
        topic(1, "/b"),
        message(1, 6, b"2"),
    ]));
    assert_eq!(
        lines,
        [
            "redefined /a: its channel 1 of schema 0 is defined again and differently, as /b of schema 0: the first definition counts, and messages after the second may be wrong"
        ]
    );
}

#[test]
fn what_no_chunk_should_hold_is_said() {
    let inner = [
        record(0x33, b"?"),
        message(1, 5, b"1"),
        vec![0; 1000],
        record(0x06, &[7; 50]),
        record(0x90, b"private"),
        message(1, 6, b"2"),
    ]
    .concat();
    let chunk = chunk("", inner.len() as u64, crc32fast::hash(&inner), &inner);
    assert_eq!(
        lines(file(&[channel(1, "json"), chunk])),
        (
            2,
            vec![
                "bad_record records of the kind 0x06, which no chunk should hold, were stepped over".to_owned(),
                "bad_record records of the kind 0x33, which no chunk should hold, were stepped over".to_owned(),
                "bad_record zero bytes in a chunk, where a record should begin, were stepped over".to_owned(),
            ]
        )
    );
}

/// The mcap crate (0.26) and Foxglove's SDK leave what chunks without a checksum hold out of the data's checksum too.
#[test]
fn a_checksum_over_all_but_the_chunks_is_taken() {
    let inner = message(1, 5, b"1");
    for (skipped, expected) in [
        (inner.len(), vec![]),
        (
            inner.len() - 1,
            vec!["bad_crc the data do not match their checksum: numbers in messages outside chunks may be wrong".to_owned()],
        ),
    ] {
        let chunk = chunk("", inner.len() as u64, 0, &inner);
        let mut bytes = [
            b"\x89MCAP0\r\n".to_vec(),
            record(1, &[0; 8]),
            channel(1, "json"),
            chunk,
        ]
        .concat();
        let crc = crc32fast::hash(&bytes[..bytes.len() - skipped]);
        bytes.extend(record(0x0f, &crc.to_le_bytes()));
        bytes.extend(record(0x02, &[0; 20]));
        bytes.extend(b"\x89MCAP0\r\n");
        assert_eq!(lines(bytes), (1, expected));
    }
}

#[test]
fn docs_list_the_encodings_that_are_read() {
    let docs = include_str!("../../../docs/recording.md");
    for (message, schema) in recording::read::supported() {
        let named = |line: &&str| {
            line.starts_with(&format!("| `{message}` |"))
                && (schema == "*" || line.contains(&format!("`{schema}`")))
        };
        assert!(docs.lines().any(|line| named(&line)), "{message} {schema}");
    }
}

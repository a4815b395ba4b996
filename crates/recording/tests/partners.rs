//! Files made by other people's writers, every encoding in every container, are read with every value equal.
//!
//! `data/make.py` made them and says how.

use std::{collections::BTreeMap, path::PathBuf};

use recording::{
    Kind,
    read::{ReadOptions, Recording},
};

const COUNT: usize = 24;

const CONTAINERS: &[&str] = &[
    "zstd",
    "lz4",
    "none",
    "one_chunk",
    "tiny_chunks",
    "no_crc",
    "no_index",
    "no_statistics",
    "unchunked",
    "unchunked_bare",
];

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(name)
}

type Expected = BTreeMap<String, Vec<(usize, Option<f64>)>>;

fn expected(name: &str) -> Expected {
    let text = std::fs::read(data(name)).expect("numbers");
    serde_json::from_slice(&text).expect("numbers by path")
}

fn time_ns(message: usize) -> i64 {
    1_700_000_000_000_000_000 + message as i64 * 100_000_000
}

fn compare(name: &str, recording: &Recording, expected: &Expected) {
    let (signals, findings) = recording.signals(&|_| true).expect("reads");
    for finding in &findings {
        assert!(
            matches!(
                finding.kind,
                Kind::Nan | Kind::AbsentField | Kind::MixedItems
            ),
            "{name}: {finding}"
        );
    }
    let paths: Vec<&String> = expected.keys().collect();
    let mut found: Vec<&String> = signals.iter().map(|signal| &signal.path).collect();
    found.sort();
    assert_eq!(found, paths, "{name}");
    for signal in &signals {
        let wanted = &expected[&signal.path];
        assert_eq!(signal.values.len(), wanted.len(), "{name}: {}", signal.path);
        for ((value, t_ns), (message, wanted)) in
            signal.values.iter().zip(signal.times_ns.iter()).zip(wanted)
        {
            assert_eq!(*t_ns, time_ns(*message), "{name}: {}", signal.path);
            let same = wanted.map_or(value.is_nan(), |wanted| wanted.to_bits() == value.to_bits());
            assert!(
                same,
                "{name}: {} in message {message}: {value}, expected {wanted:?}",
                signal.path
            );
        }
    }
}

#[test]
fn every_encoding_in_every_container() {
    let expected = expected("expected.json");
    for name in CONTAINERS {
        let path = data(&format!("{name}.mcap"));
        for threads in [1, 3] {
            let options = ReadOptions {
                threads,
                ..ReadOptions::default()
            };
            let recording = Recording::open(&path, &options).expect("opens");
            let info = recording.info();
            assert_eq!(info.channels.len(), 10, "{name}");
            assert_eq!(info.messages, 10 * COUNT as u64, "{name}");
            assert_eq!(info.warnings, Vec::<String>::new(), "{name}");
            assert!(!info.salvaged, "{name}");
            assert_eq!(
                (info.start_ns, info.end_ns),
                (time_ns(0), time_ns(COUNT - 1)),
                "{name}"
            );
            assert_eq!(info.metadata["about"]["key"], "value", "{name}");
            assert_eq!(
                recording.attachment("notes.txt").as_deref(),
                Some(b"hello".as_slice()),
                "{name}"
            );
            assert!(
                info.channels
                    .iter()
                    .all(|channel| channel.messages == COUNT as u64),
                "{name}"
            );
            compare(name, &recording, &expected);
        }
    }
}

/// `data/partners.py` made these.
#[test]
fn further_partners() {
    for (name, numbers, messages) in [
        ("foxglove_zstd", "foxglove", 4 * COUNT),
        ("foxglove_lz4", "foxglove", 4 * COUNT),
        ("foxglove_none", "foxglove", 4 * COUNT),
        ("ros1_writer", "ros1_writer", 2 * COUNT),
    ] {
        let path = data(&format!("{name}.mcap"));
        let recording = Recording::open(&path, &ReadOptions::default()).expect("opens");
        let info = recording.info();
        assert_eq!(info.warnings, Vec::<String>::new(), "{name}");
        assert_eq!(info.messages, messages as u64, "{name}");
        compare(name, &recording, &expected(&format!("{numbers}.json")));
    }
}

#[test]
fn from_memory_as_from_a_file() {
    let bytes = std::fs::read(data("zstd.mcap")).expect("reads");
    compare(
        "memory",
        &Recording::from_bytes(bytes, &ReadOptions::default()).expect("opens"),
        &expected("expected.json"),
    );
}

#[test]
fn what_is_odd_is_said() {
    let recording = Recording::open(&data("zstd.mcap"), &ReadOptions::default()).expect("opens");
    let (_, findings) = recording.signals(&|_| true).expect("reads");
    let lines: Vec<String> = findings.iter().map(ToString::to_string).collect();
    assert_eq!(
        lines,
        [
            "/cdr/le: 1 value of f64 is NaN or infinite, first at 0.700 s",
            "/cdr/le: more_parts[0] is in turn p, pp, ppp, pppp, and 1 further place of lists likewise: signals of such a place mix what belongs to several; they can be read by name",
            "/cdr/be: 1 value of f64 is NaN or infinite, first at 0.700 s",
            "/cdr/be: more_parts[0] is in turn p, pp, ppp, pppp, and 1 further place of lists likewise: signals of such a place mix what belongs to several; they can be read by name",
            "/imu: orientation is declared as not given (covariance -1)",
            "/ros1: 1 value of f64 is NaN or infinite, first at 0.700 s",
            "/ros1: more_parts[0] is in turn p, pp, ppp, pppp, and 1 further place of lists likewise: signals of such a place mix what belongs to several; they can be read by name",
        ]
    );
}

#[test]
fn only_what_is_selected_is_decoded() {
    let recording = Recording::open(&data("zstd.mcap"), &ReadOptions::default()).expect("opens");
    let (signals, _) = recording
        .signals(&|path| path.starts_with("/imu.linear"))
        .expect("reads");
    let paths: Vec<&str> = signals.iter().map(|signal| signal.path.as_str()).collect();
    assert_eq!(
        paths[..3],
        [
            "/imu.linear_acceleration.x",
            "/imu.linear_acceleration.y",
            "/imu.linear_acceleration.z"
        ]
    );
    assert_eq!(signals[0].unit, "m/s^2");
    // The nine covariances begin with the same word.
    assert_eq!(signals.len(), 12);
}

#[test]
fn stamps_come_with_the_batches() {
    let recording = Recording::open(&data("zstd.mcap"), &ReadOptions::default()).expect("opens");
    let mut stamped = BTreeMap::new();
    recording
        .stream(&|_| false, &mut |batch| {
            if batch.stamps_ns == Some(batch.times_ns) {
                *stamped.entry(batch.topic.to_owned()).or_insert(0) += batch.times_ns.len();
            }
        })
        .expect("reads");
    let topics: Vec<&str> = stamped.keys().map(String::as_str).collect();
    assert_eq!(
        topics,
        [
            "/cdr/be",
            "/cdr/le",
            "/imu",
            "/json",
            "/json/schemaless",
            "/protobuf",
            "/ros1"
        ]
    );
    assert!(stamped.values().all(|count| *count == COUNT));
}

#[test]
fn a_small_limit_on_items_is_said() {
    let options = ReadOptions {
        max_items: 2,
        ..ReadOptions::default()
    };
    let recording = Recording::open(&data("zstd.mcap"), &options).expect("opens");
    let (signals, findings) = recording
        .signals(&|path| path.starts_with("/cdr/le.loose"))
        .expect("reads");
    assert!(signals.iter().all(|signal| signal.values.len() < COUNT));
    let long: Vec<&str> = findings
        .iter()
        .filter(|f| f.kind == Kind::LongSequence && f.topic == "/cdr/le")
        .map(|f| f.text.as_str())
        .collect();
    assert!(
        long.iter()
            .any(|text| text.starts_with("loose has more than 2 items (the limit) in")),
        "{long:?}"
    );
}

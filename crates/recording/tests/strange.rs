//! Sound files with strange content: each oddity is said once, with topic, count and time; and files at the edges of the format.

mod common;

use std::collections::BTreeMap;

use common::Shared;
use prost::Message as _;
use prost_types::{
    DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet, MessageOptions,
    field_descriptor_proto::{Label, Type},
};
use recording::{
    cdr::{Header, Imu, PoseStamped, Time},
    read::{ReadOptions, Recording},
    topics::MessageKind,
    write::{RawChannel, RecordingWriter, WriterOptions},
};

fn recording(options: &WriterOptions, fill: impl FnOnce(&mut RecordingWriter)) -> Recording {
    let shared = Shared::default();
    let mut writer = RecordingWriter::to_stream(shared.clone(), options).expect("begins");
    fill(&mut writer);
    writer.finish().expect("finishes");
    let bytes = shared.take();
    Recording::from_bytes(bytes, &ReadOptions::default()).expect("opens")
}

fn lines(recording: &Recording) -> Vec<String> {
    let (_, findings) = recording.signals(&|_| true).expect("reads");
    findings
        .iter()
        .map(|finding| format!("{} {finding}", finding.kind))
        .collect()
}

const START_NS: i64 = 1_700_000_000_000_000_000;

#[test]
fn oddities_are_said() {
    let found = recording(&WriterOptions::default(), |writer| {
        let imu = writer.channel("/imu", MessageKind::Imu).expect("opens");
        let pose = writer
            .channel("/pose", MessageKind::PoseStamped)
            .expect("opens");
        for i in 0..2000i64 {
            // A quarter of a second is missing from message 1000 on.
            let t_ns = START_NS + i * 10_000_000 + if i >= 1000 { 250_000_000 } else { 0 };
            let mut message = Imu::raw(t_ns, "imu", [0.0; 3], [0.0, 0.0, 9.81]);
            if i == 500 || i == 501 {
                message.angular_velocity.y = f64::INFINITY;
            }
            // The log's clock is 0.5 s late and runs 200 ppm fast, but for the missing quarter.
            let log_ns = t_ns + 500_000_000 + i * 2_000;
            writer.message(imu, log_ns, &message).expect("writes");
            let pose_ns = match i {
                7 => log_ns - 20_000_000,
                9 => log_ns - 10_000_000 - 2_000,
                _ => log_ns,
            };
            let stamp = if i == 3 {
                Time::default()
            } else {
                Time::from_ns(pose_ns)
            };
            let message = PoseStamped {
                header: Header {
                    stamp,
                    frame_id: "map".to_owned(),
                },
                ..PoseStamped::default()
            };
            writer.message(pose, pose_ns, &message).expect("writes");
        }
    });
    assert_eq!(
        lines(&found),
        [
            "gap /imu: 1 gap in the log times (usual interval 0.010002 s), the longest 0.260 s at 9.992 s",
            "clock_offset /imu: log time lies 0.502 s after the header stamp on average",
            "clock_drift /imu: log time runs 196 ppm faster than the header stamp (3.9 ms over 20.1 s)",
            "nan /imu: 2 values of angular_velocity.y are NaN or infinite, first at 5.001 s",
            "absent_field /imu: orientation is declared as not given (covariance -1)",
            "duplicate /pose: 1 log time repeats the one before, first at 0.080 s",
            "backward /pose: 1 log time lies before the one before, first at 0.050 s",
            "gap /pose: 1 gap in the log times (usual interval 0.010002 s), the longest 0.260 s at 9.992 s",
            "zero_stamp /pose: 1 header stamp is zero, first at 0.030 s",
        ]
    );
}

/// Latched messages stamped with nothing do not make half a century of a minute, in one chunk or many, and are neither steps back nor gaps; what is more than
/// an exception, or not far enough off, does.
#[test]
fn a_few_early_messages_begin_no_recording() {
    let begun = |chunk_bytes: u64, early: i64, before_ns: i64| {
        let options = WriterOptions {
            chunk_bytes,
            ..WriterOptions::default()
        };
        let found = recording(&options, |writer| {
            let value = writer.channel("/a", MessageKind::Float64).expect("opens");
            for i in 0..1000i64 {
                // Anywhere in the file.
                let t_ns = match i % 300 {
                    7 if i / 300 < early => START_NS - before_ns + i,
                    _ => START_NS + i * 10_000_000,
                };
                let message = recording::cdr::Float64 { data: i as f64 };
                writer.message(value, t_ns, &message).expect("writes");
            }
        });
        let (said, info) = (lines(&found), found.info());
        assert_eq!(info.messages, 1000);
        ((info.start_ns - START_NS) as f64 / 1e9, info.early, said)
    };
    const HOUR_NS: i64 = 3_600_000_000_000;
    for chunk_bytes in [400, 10_000, 1 << 20] {
        assert_eq!(
            begun(chunk_bytes, 3, HOUR_NS),
            (
                0.0,
                3,
                vec!["early 3 messages are dated up to 3600.000 s before all others: seconds are counted from the first of the others".into()]
            ),
            "{chunk_bytes}"
        );
        let (start_s, early, said) = begun(chunk_bytes, 1, START_NS);
        assert_eq!((start_s, early), (0.0, 1));
        assert_eq!(
            said,
            [
                "early 1 message is dated 1700000000.000 s before all others: seconds are counted from the first of the others"
            ]
        );
        // Half of what the rest lasts.
        assert_eq!(begun(chunk_bytes, 1, 5_000_000_000).1, 0);
    }
    // Two of a hundred are a part of the recording.
    let found = recording(&WriterOptions::default(), |writer| {
        let value = writer.channel("/a", MessageKind::Float64).expect("opens");
        for i in 0..100i64 {
            let t_ns = START_NS + i * 10_000_000 + if i < 2 { 0 } else { HOUR_NS };
            writer
                .message(value, t_ns, &recording::cdr::Float64 { data: 0.0 })
                .expect("writes");
        }
    });
    assert_eq!((found.info().start_ns, found.info().early), (START_NS, 0));
}

#[test]
fn signals_come_sorted_from_chunks_that_are_not() {
    let options = WriterOptions {
        chunk_bytes: 400,
        ..WriterOptions::default()
    };
    let found = recording(&options, |writer| {
        let value = writer.channel("/a", MessageKind::Float64).expect("opens");
        for i in 0..1000i64 {
            let scattered = (i * 617) % 1000;
            writer
                .message(
                    value,
                    scattered,
                    &recording::cdr::Float64 {
                        data: scattered as f64,
                    },
                )
                .expect("writes");
        }
    });
    let (signals, _) = found.signals(&|_| true).expect("reads");
    assert_eq!(signals.len(), 1);
    assert!(
        (0..1000).all(|i| signals[0].times_ns[i] == i as i64 && signals[0].values[i] == i as f64)
    );
}

#[test]
fn two_thousand_channels_and_two_of_one_topic() {
    let found = recording(&WriterOptions::default(), |writer| {
        let channels: Vec<_> = (0..2000)
            .map(|i| {
                writer
                    .channel(&format!("/topic_{i}"), MessageKind::Float64)
                    .expect("opens")
            })
            .collect();
        for (i, channel) in channels.iter().enumerate() {
            writer
                .message(
                    *channel,
                    i as i64,
                    &recording::cdr::Float64 { data: i as f64 },
                )
                .expect("writes");
        }
        let metadata = BTreeMap::from([("publisher".to_owned(), "second".to_owned())]);
        let again = RawChannel {
            topic: "/topic_7",
            message_encoding: "json",
            schema_name: "",
            schema_encoding: "",
            schema_data: b"",
            metadata: &metadata,
        };
        let again = writer.raw_channel(&again).expect("opens");
        writer
            .message(again, 3, b"{\"data\": 0.5}".as_slice())
            .expect("writes");
    });
    assert_eq!(found.info().channels.len(), 2001);
    let (signals, findings) = found.signals(&|_| true).expect("reads");
    assert_eq!(findings, []);
    assert_eq!(signals.len(), 2000);
    let seven = signals
        .iter()
        .find(|signal| signal.path == "/topic_7.data")
        .expect("a signal");
    assert_eq!(
        (seven.times_ns.as_ref(), seven.values.as_slice()),
        ([3, 7].as_slice(), [0.5, 7.0].as_slice())
    );
}

/// Wide text in the two widths that implementations use, told apart by the message being used up.
#[test]
fn wide_text_of_either_width() {
    for width in [2usize, 4] {
        let found = recording(&WriterOptions::default(), |writer| {
            let channel = RawChannel {
                topic: "/w",
                message_encoding: "cdr",
                schema_name: "p/msg/W",
                schema_encoding: "ros2msg",
                schema_data: b"wstring text\nfloat64 x\nuint32[8] tail\n",
                metadata: &BTreeMap::new(),
            };
            let channel = writer.raw_channel(&channel).expect("opens");
            for i in 0..20u32 {
                let mut body = i.to_le_bytes().to_vec();
                body.resize(4 + i as usize * width, b'w');
                body.resize(body.len().next_multiple_of(8), 0);
                body.extend_from_slice(&f64::from(i).to_le_bytes());
                body.extend((0..8).flat_map(|k| (k * i).to_le_bytes()));
                let message = [[0, 1, 0, 0].as_slice(), &body].concat();
                writer
                    .message(channel, i64::from(i), message.as_slice())
                    .expect("writes");
            }
        });
        let (signals, findings) = found.signals(&|_| true).expect("reads");
        assert_eq!(findings, [], "{width}");
        let x = signals
            .iter()
            .find(|signal| signal.path == "/w.x")
            .expect("a signal");
        assert!(
            x.values.iter().enumerate().all(|(i, x)| *x == i as f64),
            "{width}: {:?}",
            x.values
        );
    }
}

/// A reading that leaves what could be padding does not win over one that uses the message up.
#[test]
fn wide_text_before_few_bytes() {
    // Width, characters of each message, bytes that the body is padded to.
    let texts: [(usize, &[usize], usize); 4] = [
        (4, &[1, 1, 1, 1], 1),
        // Text of no characters says nothing of the width, and the first reading is taken.
        (4, &[0, 0, 1, 1, 0, 1], 1),
        (2, &[1, 1, 2, 0, 1], 1),
        (2, &[2, 2, 2, 2], 4),
    ];
    for (width, texts, padding) in texts {
        let found = recording(&WriterOptions::default(), |writer| {
            let channel = RawChannel {
                topic: "/w",
                message_encoding: "cdr",
                schema_name: "p/msg/W",
                schema_encoding: "ros2msg",
                schema_data: b"wstring w\nuint16 x\n",
                metadata: &BTreeMap::new(),
            };
            let channel = writer.raw_channel(&channel).expect("opens");
            for (i, &text) in texts.iter().enumerate() {
                let mut body = (text as u32).to_le_bytes().to_vec();
                for _ in 0..text {
                    body.extend_from_slice(&(0x77u32.to_le_bytes())[..width]);
                }
                body.extend_from_slice(&(1000 + i as u16).to_le_bytes());
                body.resize(body.len().next_multiple_of(padding), 0);
                let message = [[0, 1, 0, 0].as_slice(), &body].concat();
                writer
                    .message(channel, i as i64, message.as_slice())
                    .expect("writes");
            }
        });
        let (signals, findings) = found.signals(&|_| true).expect("reads");
        assert_eq!(findings, [], "{width} {texts:?}");
        let expected: Vec<f64> = (0..texts.len()).map(|i| 1000.0 + i as f64).collect();
        assert_eq!(signals[0].values, expected, "{width} {texts:?}");
    }
}

/// What a reading noted that was then given up is not counted.
#[test]
fn readings_that_are_given_up_leave_no_counts() {
    let found = recording(&WriterOptions::default(), |writer| {
        let channel = RawChannel {
            topic: "/w",
            message_encoding: "cdr",
            schema_name: "p/msg/W",
            schema_encoding: "ros2msg",
            schema_data: b"float64[9] a_covariance\nwstring w\nuint8[] long\nuint16 x\n",
            metadata: &BTreeMap::new(),
        };
        let channel = writer.raw_channel(&channel).expect("opens");
        for i in 0..6u16 {
            let mut body = (-1f64).to_le_bytes().to_vec();
            body.resize(72, 0);
            body.extend_from_slice(&1u32.to_le_bytes());
            body.extend_from_slice(&0x77u32.to_le_bytes());
            body.extend_from_slice(&100u32.to_le_bytes());
            body.resize(body.len() + 100, 0);
            body.extend_from_slice(&i.to_le_bytes());
            body.resize(body.len() + 2, 0);
            let message = [[0, 1, 0, 0].as_slice(), &body].concat();
            writer
                .message(channel, i64::from(i), message.as_slice())
                .expect("writes");
        }
    });
    assert_eq!(
        lines(&found),
        [
            "absent_field /w: a is declared as not given (covariance -1)",
            "long_sequence /w: long has more than 64 items (the limit) in 6 messages; it is not among the signals there",
        ]
    );
}

/// Both ways to number the representations of XCDR2: what is plain is read, what is not is named.
#[test]
fn second_representations_have_two_numbers_each() {
    let of = |representation: u8, big_endian: bool| {
        let found = recording(&WriterOptions::default(), |writer| {
            let channel = RawChannel {
                topic: "/x",
                message_encoding: "cdr",
                schema_name: "p/msg/X",
                schema_encoding: "ros2msg",
                schema_data: b"uint32 a\nfloat64 b\n",
                metadata: &BTreeMap::new(),
            };
            let channel = writer.raw_channel(&channel).expect("opens");
            // Eight bytes stand at a multiple of four.
            let (a, b) = match big_endian {
                true => (9u32.to_be_bytes(), 2.5f64.to_be_bytes()),
                false => (9u32.to_le_bytes(), 2.5f64.to_le_bytes()),
            };
            let message = [&[0, representation, 0, 0], &a[..], &b].concat();
            (writer.message(channel, 0, message.as_slice())).expect("writes");
        });
        let (signals, _) = found.signals(&|_| true).expect("reads");
        let mut values: Vec<f64> = signals.iter().map(|s| s.values[0]).collect();
        values.sort_by(f64::total_cmp);
        (values, lines(&found).concat())
    };
    for (representation, big_endian) in [(0x06, true), (0x07, false), (0x10, true), (0x11, false)] {
        let found = of(representation, big_endian);
        assert_eq!(found, (vec![2.5, 9.0], String::new()), "{representation}");
    }
    for (representation, name) in [
        (0x12, "list"),
        (0x13, "list"),
        (0x14, "delim"),
        (0x15, "delim"),
    ] {
        let (values, said) = of(representation, false);
        assert!(values.is_empty() && said.contains(name), "{said}");
    }
}

/// One CDR message of an IDL type, on `/e`.
fn of_idl(name: &str, text: &str, message: &[u8]) -> Recording {
    recording(&WriterOptions::default(), |writer| {
        let channel = RawChannel {
            topic: "/e",
            message_encoding: "cdr",
            schema_name: name,
            schema_encoding: "ros2idl",
            schema_data: text.as_bytes(),
            metadata: &BTreeMap::new(),
        };
        let channel = writer.raw_channel(&channel).expect("opens");
        writer.message(channel, 0, message).expect("writes");
    })
}

/// What a message of such words, in XCDR2 or XCDR1, becomes, and what is said.
fn of_words(representation: u8, schema: &str, words: &[u32]) -> (String, String) {
    let body: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let message = [&[0, representation, 0, 0], &body[..]].concat();
    let found = of_idl("p/M", &format!("module p {{ {schema} }};"), &message);
    let (signals, _) = found.signals(&|_| true).expect("reads");
    let mut values: Vec<(String, f64)> = (signals.iter())
        .map(|signal| (signal.path[3..].to_owned(), signal.values[0]))
        .collect();
    values.sort_by(|a, b| a.0.cmp(&b.0));
    let values = values.iter().map(|(path, value)| format!("{path} {value}"));
    (
        values.collect::<Vec<_>>().join(", "),
        lines(&found).concat(),
    )
}

/// The same with these fields, in XCDR2.
fn of_second(fields: &str, words: &[u32]) -> (String, String) {
    let schema = format!(
        "enum Color {{ RED, GREEN, BLUE }}; struct In {{ long i; }}; struct M {{ {fields} }};"
    );
    of_words(7, &schema, words)
}

/// XCDR2 puts a size before structs that may get further fields, as those may that nothing is said of. The first message is Cyclone's.
#[test]
fn structs_within_others_have_a_size_before_them_or_none() {
    let (low, high) = (0, 1.5f64.to_bits().wrapping_shr(32) as u32);
    let sized = [4, 100, low, high];
    let [unsaid, fixed, appendable] = ["", "@final", "@appendable"].map(|annotation| {
        format!("{annotation} struct In {{ long v; }}; @final struct M {{ In a; double x; }};")
    });
    let expected = ("a.v 100, x 1.5".to_owned(), String::new());
    for (schema, words) in [
        (&unsaid, &sized[..]),
        (&unsaid, &sized[1..]),
        (&appendable, &sized),
        (&fixed, &sized[1..]),
    ] {
        assert_eq!(of_words(7, schema, words), expected, "{schema} {words:?}");
    }
    // No size in XCDR1, where a double lies at a multiple of eight.
    assert_eq!(of_words(1, &appendable, &[100, 0, low, high]), expected);
    for (schema, words, problem) in [
        (
            &appendable,
            &sized[1..],
            "message stopped at byte 8 in \"a\": its size in bytes is another",
        ),
        (
            &unsaid,
            &[5, 100, low, high],
            "20 bytes holds 4 after its last field",
        ),
    ] {
        let (values, said) = of_words(7, schema, words);
        assert_eq!(values, "");
        assert!(
            said.starts_with("undecodable") && said.ends_with(problem),
            "{said}"
        );
    }
    // Items have sizes of their own, and what is in them too: 2 items, of 16 bytes and of 20.
    let nested = "struct Deep { long d; }; struct In { string name; Deep deep; sequence<long> l; };
        @final struct M { sequence<In> s; Deep e[2]; long z; };";
    let words = [
        &[56, 2][..],
        &[20, 2, u32::from(b'a'), 4, 7, 0],
        &[24, 2, u32::from(b'b'), 4, 8, 1, 5],
        &[16, 4, 1, 4, 2, 9],
    ];
    let expected = "e[0].d 1, e[1].d 2, s[0].deep.d 7, s[1].deep.d 8, s[1].l[0] 5, z 9";
    assert_eq!(
        of_words(7, nested, &words.concat()),
        (expected.to_owned(), String::new())
    );
    // Where both readings use it up, the schema says which is meant.
    let either = "struct In { long v; }; struct M { In a; sequence<long> s; };";
    for (schema, expected) in [
        (either.to_owned(), "a.v 4, s[0] 0"),
        (either.replace("struct M", "@final struct M"), "a.v 1"),
    ] {
        assert_eq!(of_words(7, &schema, &[4, 1, 0]).0, expected);
    }
}

/// Collections of enums in XCDR2, and how writers differ in what stands before them. The first message is that of pycdr2 1.0.0
/// (`serialize(use_version_2=True)`), Cyclone's, which keeps to the standard; Fast CDR puts a size before structs alone, and others before nothing.
#[test]
fn enums_of_second_representations() {
    let array = "unsigned long a; Color c[3]; sequence<Color> s; double d;";
    let (low, high) = (0, 1.5f64.to_bits().wrapping_shr(32) as u32);
    let expected = "a 7, c[0] 0, c[1] 1, c[2] 2, d 1.5, s[0] 2, s[1] 0";
    for words in [
        &[7, 12, 0, 1, 2, 12, 2, 2, 0, low, high][..],
        &[7, 0, 1, 2, 2, 2, 0, low, high],
    ] {
        assert_eq!(
            of_second(array, words),
            (expected.to_owned(), String::new())
        );
    }
    let both = "sequence<In> x; sequence<Color> s;";
    for words in [
        &[8, 1, 5, 16, 3, 2, 1, 0][..],
        &[8, 1, 5, 3, 2, 1, 0],
        // Three items of which the first is one less than there are look like a size, two, and two items.
        &[1, 5, 3, 2, 1, 0],
    ] {
        let expected = "s[0] 2, s[1] 1, s[2] 0, x[0].i 5";
        assert_eq!(of_second(both, words), (expected.to_owned(), String::new()));
    }
    let expected = "s[0] 2, s[1] 1, s[2] 0".to_owned();
    assert_eq!(
        of_second("sequence<Color> s;", &[3, 2, 1, 0]),
        (expected, String::new())
    );
    // An array of several dimensions is of what its innermost one is of (Fast CDR's `is_multi_array_primitive`).
    let rows = "long m[2][3]; sequence<In> s;";
    let expected =
        "m[0][0] 1, m[0][1] 2, m[0][2] 3, m[1][0] 4, m[1][1] 5, m[1][2] 6, s[0].i 7, s[1].i 8";
    for words in [
        &[1, 2, 3, 4, 5, 6, 12, 2, 7, 8][..],
        &[1, 2, 3, 4, 5, 6, 2, 7, 8],
    ] {
        assert_eq!(of_second(rows, words), (expected.to_owned(), String::new()));
    }
}

/// An array of several dimensions of structs, text or enums has one size before it, or each row has one too.
#[test]
fn sizes_stand_before_arrays_or_before_their_rows_too() {
    // Texts of "a": length 2 and two bytes; what pads the last is not of its array.
    let text = [2, u32::from(b'a')];
    let texts = text.repeat(2);
    let (twice, row) = (texts.repeat(2), [vec![14], texts.clone()].concat());
    for (fields, one, nested, expected) in [
        (
            "In p[2][2]; long z;",
            vec![16, 1, 2, 3, 4, 9],
            vec![24, 8, 1, 2, 8, 3, 4, 9],
            "p[0][0].i 1, p[0][1].i 2, p[1][0].i 3, p[1][1].i 4, z 9",
        ),
        (
            "Color e[2][2]; long z;",
            vec![16, 1, 2, 1, 0, 9],
            vec![24, 8, 1, 2, 8, 1, 0, 9],
            "e[0][0] 1, e[0][1] 2, e[1][0] 1, e[1][1] 0, z 9",
        ),
        (
            "string s[2][2]; long z;",
            [vec![30], twice, vec![9]].concat(),
            [vec![38], row.clone(), row, vec![9]].concat(),
            "z 9",
        ),
        (
            "In p[1][2][1]; long z;",
            vec![8, 1, 2, 9],
            vec![20, 16, 4, 1, 4, 2, 9],
            "p[0][0][0].i 1, p[0][1][0].i 2, z 9",
        ),
    ] {
        for words in [one, nested] {
            let found = of_second(fields, &words);
            assert_eq!(found, (expected.to_owned(), String::new()), "{words:?}");
        }
    }
}

/// Structs that inherit from one another multiply their fields.
#[test]
fn what_is_inherited_is_bounded() {
    let chain = |structs: usize| {
        let one = |k: usize| format!("struct T{k} : T{} {{ long f{k}; }};\n", k - 1);
        let others: String = (1..structs).map(one).collect();
        let fields: String = (0..structs).map(|k| format!("T{k} t{k}; ")).collect();
        let text = format!("struct M {{ {fields}}};\nstruct T0 {{ long f0; }};\n{others}");
        let message = [vec![0, 1, 0, 0], vec![0; 2 * structs * (structs + 1)]].concat();
        let found = of_idl("M", &text, &message);
        let signals = found.signals(&|_| true).expect("reads").0.len();
        (signals, lines(&found).concat())
    };
    assert_eq!(chain(30), (465, String::new()));
    let (signals, said) = chain(500);
    assert_eq!(signals, 0);
    assert!(
        said.contains("its structs inherit more than 100000 fields together"),
        "{said}"
    );
}

/// Which of two readings an ambiguous message is given does not depend on the chunks that a thread had before: alone it is read by the first
/// that fits, with two bytes a character.
#[test]
fn readings_do_not_depend_on_threads() {
    let channel = RawChannel {
        topic: "/w",
        message_encoding: "cdr",
        schema_name: "p/msg/W",
        schema_encoding: "ros2msg",
        schema_data: b"wstring s\nuint8[] d\n",
        metadata: &BTreeMap::new(),
    };
    let message = |words: &[u32], bytes: &[u8]| {
        let words = words.iter().flat_map(|word| word.to_le_bytes());
        [&[0, 1, 0, 0], &words.collect::<Vec<_>>()[..], bytes].concat()
    };
    let wide = message(&[3, 97, 98, 99, 5], &[1, 2, 3, 4, 5]);
    let either = message(&[2, 97, 10, 6], &[9, 8, 7, 6, 5, 4]);
    let messages: Vec<_> = (0..600)
        .map(|m| if m / 60 % 2 == 0 { &wide } else { &either }.clone())
        .collect();
    same_for_all_threads(&channel, &messages);
}

/// Names fill the memory as well as places do; and a name is a name, whatever it looks like.
#[test]
fn long_names_take_places_and_odd_ones_are_told_as_they_are() {
    let grid = format!(
        "[{}]",
        vec![format!("[{}]", ["1"; 64].join(",")); 64].join(",")
    );
    for (length, signals) in [(100, 4096), (100_000, 163)] {
        let message = format!("{{\"{}\":{grid}}}", "k".repeat(length));
        let (found, told) = same_for_all_threads(&JSON, &[message.into_bytes()]);
        assert_eq!(found, signals);
        assert_eq!(told.is_empty(), signals == 4096, "{told:?}");
    }
    let long = vec!["1"; 70].join(",");
    let message = format!("{{\"[*]\":[{long}],\"a\":{{\"*\":[{long}]}},\"x\":1}}");
    let (found, told) = same_for_all_threads(&JSON, &[message.into_bytes()]);
    let said = |field: &str| {
        format!(
            "long_sequence /j: {field} has more than 64 items (the limit) in 1 message; it is not among the signals there"
        )
    };
    assert_eq!((found, told), (1, vec![said("[*]"), said("a.*")]));
}

/// Words that Python and others write though JSON does not have them are numbers that are not finite; in texts they are text.
#[test]
fn json_with_bare_words() {
    let found = recording(&WriterOptions::default(), |writer| {
        let channel = RawChannel {
            topic: "/j",
            message_encoding: "json",
            schema_name: "",
            schema_encoding: "",
            schema_data: b"",
            metadata: &BTreeMap::new(),
        };
        let channel = writer.raw_channel(&channel).expect("opens");
        for (t_ns, text) in [
            r#"{"x": 1, "y": [1, 2]}"#,
            r#"{"x": NaN, "y": [Infinity, -Infinity], "s": "a \"NaN\" \\"}"#,
            r#"{"x": 3, "y": [5, 6], "s": "NaN"}"#,
        ]
        .iter()
        .enumerate()
        {
            let message = text.as_bytes();
            writer
                .message(channel, t_ns as i64, message)
                .expect("writes");
        }
    });
    let (signals, _) = found.signals(&|_| true).expect("reads");
    let paths: Vec<&str> = signals.iter().map(|signal| signal.path.as_str()).collect();
    assert_eq!(paths, ["/j.x", "/j.y[0]", "/j.y[1]"]);
    assert!(signals[0].values[1].is_nan());
    assert_eq!(signals[0].values[2], 3.0);
    assert_eq!(signals[1].values, [1.0, f64::INFINITY, 5.0]);
    assert_eq!(signals[2].values, [2.0, f64::NEG_INFINITY, 6.0]);
    assert_eq!(
        lines(&found),
        [
            "nan /j: 1 value of x is NaN or infinite, first at 0.000 s",
            "nan /j: 2 values of y[] (2 items) are NaN or infinite, first at 0.000 s",
        ]
    );
}

/// A message with such words is read again, and counted once.
#[test]
fn json_with_bare_words_is_counted_once() {
    let found = recording(&WriterOptions::default(), |writer| {
        let channel = writer.raw_channel(&JSON).expect("opens");
        let long = vec!["1"; 65].join(",");
        for t_ns in 0..10 {
            let word = if t_ns % 2 == 0 { "NaN" } else { "1" };
            let text = format!("{{\"y\":[{long}],\"x\":{word}}}");
            let message = text.as_bytes();
            writer.message(channel, t_ns, message).expect("writes");
        }
    });
    assert_eq!(
        lines(&found)[1],
        "long_sequence /j: y has more than 64 items (the limit) in 10 messages; it is not among the signals there"
    );
}

/// Keys may spell what others lead to: in a message that has both, one number hides the other, which is said once for a topic.
#[test]
fn json_keys_that_spell_the_paths_of_others() {
    let found = |texts: &[&str]| {
        let found = recording(&WriterOptions::default(), |writer| {
            let channel = writer.raw_channel(&JSON).expect("opens");
            for (t_ns, text) in texts.iter().enumerate() {
                let message = text.as_bytes();
                (writer.message(channel, t_ns as i64, message)).expect("writes");
            }
        });
        let (signals, _) = found.signals(&|_| true).expect("reads");
        let signals = signals.iter().map(|s| (s.path.clone(), s.values.to_vec()));
        (signals.collect::<Vec<_>>(), lines(&found))
    };
    let said = |field: &str| {
        vec![format!(
            "odd_schema /j: two of its fields are called {field}; where a message has both, the last one counts"
        )]
    };
    let dotted = r#"{"a.b":1,"a":{"b":2}}"#;
    let indexed = r#"{"a[0]":1,"a":[2]}"#;
    assert_eq!(
        found(&[dotted, indexed, dotted]),
        (
            vec![
                ("/j.a.b".to_owned(), vec![2.0, 2.0]),
                ("/j.a[0]".to_owned(), vec![2.0])
            ],
            said("a.b")
        )
    );
    assert_eq!(found(&[indexed]).1, said("a[0]"));
    // Nothing is lost where a message has but one of them.
    let (signals, said) = found(&[r#"{"a.b":1}"#, r#"{"a":{"b":2}}"#]);
    assert_eq!(signals, [("/j.a.b".to_owned(), vec![1.0, 2.0])]);
    assert!(said.is_empty(), "{said:?}");
    let messages = (0..600).map(|m| [dotted, indexed, "{}"][m / 7 % 3].into());
    same_for_all_threads(&JSON, &messages.collect::<Vec<_>>());
}

/// A byte order mark before the document, and halves of surrogate pairs as Python writes those of file names that are not UTF-8, cost no number.
#[test]
fn json_with_a_byte_order_mark_and_half_characters() {
    let texts = [
        "\u{feff}{\"x\":0}",
        r#"{"s":"\\ud800","x":1}"#,
        r#"{"s":"\ud800","x":2}"#,
        r#"{"s":"\udcff\\","name":"\uDBFF\ud83d\ude00","x":3}"#,
        r#"{"s":"\ud800\u0041\ud8","x":4}"#,
        r#"{"\ud800":1,"\ud83d\ude00":2}"#,
    ];
    let found = recording(&WriterOptions::default(), |writer| {
        let channel = writer.raw_channel(&JSON).expect("opens");
        for (t_ns, text) in texts.iter().enumerate() {
            let message = text.as_bytes();
            (writer.message(channel, t_ns as i64, message)).expect("writes");
        }
    });
    let (signals, findings) = found.signals(&|_| true).expect("reads");
    let told: Vec<_> = (signals.iter())
        .map(|signal| (signal.path.as_str(), signal.values.as_slice()))
        .collect();
    assert_eq!(
        told,
        [
            ("/j.x", &[0.0, 1.0, 2.0, 3.0][..]),
            ("/j.\u{fffd}", &[1.0]),
            ("/j.\u{1f600}", &[2.0]),
        ]
    );
    // The fifth ends an escape too soon.
    assert_eq!(findings.len(), 1, "{findings:?}");
    assert_eq!(findings[0].count, 1);
}

/// Topic and field together may spell what those of another topic do: they are two signals, and that is said.
#[test]
fn fields_of_two_topics_with_one_name_are_kept_apart() {
    let found = recording(&WriterOptions::default(), |writer| {
        let topics = ["robot", "robot.arm", "robot"];
        let messages = [
            r#"{"arm":{"x":1}}"#,
            r#"{"x":100,"y":7}"#,
            r#"{"arm":{"x":2}}"#,
        ];
        for (t_ns, (topic, text)) in topics.iter().zip(messages).enumerate() {
            let parts = RawChannel { topic, ..JSON };
            let channel = writer.raw_channel(&parts).expect("opens");
            let message = text.as_bytes();
            writer
                .message(channel, t_ns as i64, message)
                .expect("writes");
        }
    });
    let (signals, _) = found.signals(&|_| true).expect("reads");
    let told: Vec<_> = (signals.iter())
        .map(|signal| (signal.path.as_str(), signal.values.as_slice()))
        .collect();
    assert_eq!(
        told,
        [
            ("robot.arm.x", &[1.0, 2.0][..]),
            ("robot.arm:x", &[100.0]),
            ("robot.arm.y", &[7.0]),
        ]
    );
    assert_eq!(
        lines(&found),
        [
            "odd_schema robot.arm: robot.arm.x is a field of another topic before, so that this topic's is called robot.arm:x"
        ]
    );
}

/// Everything that a recording gives, in the order in which it does.
fn everything(bytes: &[u8], threads: usize) -> (Vec<String>, Vec<String>) {
    let options = ReadOptions {
        threads,
        ..ReadOptions::default()
    };
    let recording = Recording::from_bytes(bytes.to_vec(), &options).expect("opens");
    let mut batches = Vec::new();
    let findings = recording.stream(&|_| true, &mut |batch| {
        for c in batch.columns {
            let rows = c.rows.map_or(c.values.len(), <[u32]>::len);
            let values: f64 = c.values.iter().sum();
            batches.push(format!("{} {} {rows} {values}", c.id, c.path));
        }
    });
    let told = findings.expect("reads").into_iter();
    (batches, told.map(|f| format!("{} {f}", f.kind)).collect())
}

/// A recording of one channel in many chunks; whatever the number of threads, it gives the same: so many columns, and what is said.
fn same_for_all_threads(channel: &RawChannel<'_>, messages: &[Vec<u8>]) -> (usize, Vec<String>) {
    let shared = Shared::default();
    let options = WriterOptions {
        chunk_bytes: 400,
        ..WriterOptions::default()
    };
    let mut writer = RecordingWriter::to_stream(shared.clone(), &options).expect("begins");
    let id = writer.raw_channel(channel).expect("opens");
    for (t_ns, message) in messages.iter().enumerate() {
        let message = message.as_slice();
        writer.message(id, t_ns as i64, message).expect("writes");
    }
    writer.finish().expect("finishes");
    let bytes = shared.take();
    let (batches, told) = everything(&bytes, 1);
    for threads in [2, 5] {
        let again = everything(&bytes, threads);
        assert!(again.0 == batches, "{}: {threads} threads", channel.topic);
        assert_eq!(again.1, told, "{}: {threads} threads", channel.topic);
    }
    let id = |line: &String| line.split(' ').next().map(str::to_owned);
    let ids: std::collections::BTreeSet<_> = batches.iter().filter_map(id).collect();
    (ids.len(), told)
}

const JSON: RawChannel<'static> = RawChannel {
    topic: "/j",
    message_encoding: "json",
    schema_name: "",
    schema_encoding: "",
    schema_data: b"",
    metadata: &BTreeMap::new(),
};

/// A few bytes of a packed file can ask for millions of signals: topics together have no more than are worth reading.
#[test]
fn topics_together_have_so_many_signals() {
    let rule = "================================================================================";
    let schema = format!("A[64] a\n{rule}\nMSG: p/A\nB[16] b\n{rule}\nMSG: p/B\nuint8[64] c\n");
    let message = [&[0, 1, 0, 0][..], &[1; 1 << 16]].concat();
    let found = recording(&WriterOptions::default(), |writer| {
        for topic in 0..5 {
            let channel = RawChannel {
                topic: &format!("/{topic}"),
                message_encoding: "cdr",
                schema_name: "p/msg/Grid",
                schema_encoding: "ros2msg",
                schema_data: schema.as_bytes(),
                ..JSON
            };
            let channel = writer.raw_channel(&channel).expect("opens");
            (writer.message(channel, topic, message.as_slice())).expect("writes");
        }
    });
    let (signals, findings) = found.signals(&|_| true).expect("reads");
    assert_eq!(signals.len(), 1 << 18);
    let said: Vec<String> = findings.iter().map(ToString::to_string).collect();
    assert_eq!(
        said,
        [
            "/4: the recording has more than 262144 numeric fields in all; the others of this topic are left out"
        ]
    );
    // Of what is asked for, that is.
    let (signals, findings) = found
        .signals(&|path| path.starts_with("/4."))
        .expect("reads");
    assert_eq!((signals.len(), findings.len()), (1 << 16, 0));
}

/// Limits hold for a message, or for the recording in its order, never for what a thread happened to see.
#[test]
fn limits_do_not_depend_on_threads() {
    let object = |keys: std::ops::Range<usize>| {
        let keys: Vec<String> = keys.map(|k| format!("\"k{k}\":1")).collect();
        format!("{{{}}}", keys.join(",")).into_bytes()
    };
    // Few keys at a time, many over time, in changing order.
    let few = |m: usize| 3 * (7 * m % 1667)..3 * (7 * m % 1667) + 3;
    let mut messages: Vec<_> = (0..1667).map(|m| object(few(m))).collect();
    assert_eq!(same_for_all_threads(&JSON, &messages), (5001, vec![]));
    messages.push(object(0..5000));
    let said = "long_sequence /j: the message itself has more keys than the 4096 that become signals, in 1 message; what has further ones is left out";
    assert_eq!(
        same_for_all_threads(&JSON, &messages),
        (5001, vec![said.into()])
    );
    let grid = |key: usize| {
        let line = format!("[{}]", vec!["1"; 64].join(","));
        format!("{{\"k{key}\":[{}]}}", vec![line; 64].join(",")).into_bytes()
    };
    let messages: Vec<_> = (0..24).map(|m| grid(m * 7 % 20)).collect();
    let said = "odd_schema /j: it has more than 65536 numeric fields; the others are left out";
    assert_eq!(
        same_for_all_threads(&JSON, &messages),
        (65536, vec![said.into()])
    );

    let mut map = field("m", 1, Type::Message, Some(".a.P.MEntry"));
    map.label = Some(Label::Repeated as i32);
    let entry = DescriptorProto {
        name: Some("MEntry".into()),
        field: vec![
            field("key", 1, Type::Uint32, None),
            field("value", 2, Type::Uint32, None),
        ],
        options: Some(MessageOptions {
            map_entry: Some(true),
            ..MessageOptions::default()
        }),
        ..DescriptorProto::default()
    };
    let (name, set) = set_of(
        "proto3",
        DescriptorProto {
            name: Some("P".into()),
            field: vec![map],
            nested_type: vec![entry],
            ..DescriptorProto::default()
        },
    );
    let protobuf = RawChannel {
        topic: "/p",
        message_encoding: "protobuf",
        schema_name: &name,
        schema_encoding: "protobuf",
        schema_data: &set,
        metadata: &BTreeMap::new(),
    };
    let entries = |keys: std::ops::Range<u8>| -> Vec<u8> {
        keys.flat_map(|key| [10, 4, 8, key, 16, 1]).collect()
    };
    let mut messages: Vec<_> = (0..900)
        .map(|m| entries(m as u8 % 100..m as u8 % 100 + 2))
        .collect();
    assert_eq!(same_for_all_threads(&protobuf, &messages).0, 101);
    messages.push(entries(0..65));
    let said = "long_sequence /p: m has more than 64 items (the limit) in 1 message; it is not among the signals there";
    assert_eq!(
        same_for_all_threads(&protobuf, &messages),
        (101, vec![said.into()])
    );

    let array = RawChannel {
        topic: "/a",
        message_encoding: "cdr",
        schema_name: "a/msg/A",
        schema_encoding: "ros2msg",
        schema_data: b"uint8 x\nuint8[65] y",
        metadata: &BTreeMap::new(),
    };
    let message = [&[0, 1, 0, 0][..], &[1; 66]].concat();
    let said = "long_sequence /a: y has more than 64 items (the limit) in 30 messages; it is not among the signals there";
    assert_eq!(
        same_for_all_threads(&array, &vec![message; 30]),
        (1, vec![said.into()])
    );
}

/// 17 items in each of 64 in each of 64: more places than a decoder may remember come out of a few bytes, packed. The first of them are read.
#[test]
fn sequences_of_sequences_are_bounded() {
    let said = |messages: usize| {
        format!(
            "sequences, maps and objects have more than 65536 fields together, or names that take as much room, in {messages} messages; what has further ones is left out"
        )
    };
    let check = |channel: &RawChannel<'_>, one: Vec<u8>, many: Vec<u8>, columns: usize| {
        let messages = [one, many.clone(), many];
        let told = vec![format!("long_sequence {}: {}", channel.topic, said(2))];
        assert_eq!(same_for_all_threads(channel, &messages), (columns, told));
    };

    // The message, 64 and 64 · 64 arrays take places, too: 56 · (1 + 64 + 64 · 17) + (1 + 53 · (1 + 17) + 1 + 11) of 65535.
    let grid = |a: usize, b: usize, c: usize| {
        let line = |of: String, count| format!("[{}]", vec![of; count].join(","));
        line(line(line("1".into(), c), b), a).into_bytes()
    };
    let numbers = 56 * 64 * 17 + 53 * 17;
    check(&JSON, grid(1, 1, 1), grid(64, 64, 17), numbers + 11);

    // As many, but for the message.
    fn items(counts: &[u32], align: usize, body: &mut Vec<u8>) {
        let Some((count, rest)) = counts.split_first() else {
            return body.push(1);
        };
        body.resize(body.len().next_multiple_of(align), 0);
        body.extend(count.to_le_bytes());
        (0..*count).for_each(|_| items(rest, align, body));
    }
    for (encoding, separator, header, align) in
        [("cdr", "msg/", &[0, 1, 0, 0][..], 4), ("ros1", "", &[], 1)]
    {
        let bar = "=".repeat(80);
        let schema = format!(
            "B[] b\n{bar}\nMSG: a/B\nC[] c\n{bar}\nMSG: a/C\nD[] d\n{bar}\nMSG: a/D\nuint8 x\n"
        );
        let channel = RawChannel {
            topic: "/m",
            message_encoding: encoding,
            schema_name: &format!("a/{separator}A"),
            schema_encoding: if encoding == "cdr" {
                "ros2msg"
            } else {
                "ros1msg"
            },
            schema_data: schema.as_bytes(),
            metadata: &BTreeMap::new(),
        };
        let message = |counts: &[u32]| {
            let mut body = Vec::new();
            items(counts, align, &mut body);
            [header, &body].concat()
        };
        let many = message(&[64, 64, 17]);
        check(&channel, message(&[1, 1, 1]), many, numbers + 12);
    }

    // Of a message that may contain itself, each takes two places, and the outermost none.
    let (name, set) = set_of(
        "proto3",
        DescriptorProto {
            name: Some("T".into()),
            field: vec![
                field("t", 1, Type::Message, Some(".a.T")),
                field("v", 2, Type::Double, None),
            ],
            ..DescriptorProto::default()
        },
    );
    let protobuf = RawChannel {
        topic: "/t",
        message_encoding: "protobuf",
        schema_name: &name,
        schema_encoding: "protobuf",
        schema_data: &set,
        metadata: &BTreeMap::new(),
    };
    fn nested(counts: &[usize]) -> Vec<u8> {
        let Some((count, rest)) = counts.split_first() else {
            return Vec::new();
        };
        let mut item = vec![10];
        prost::encode_length_delimiter(nested(rest).len(), &mut item).expect("has room");
        item.extend(nested(rest));
        item.repeat(*count)
    }
    let many = nested(&[64, 64, 17]);
    check(&protobuf, nested(&[1, 1, 1]), many, 1 + 65536 / 2);
}

/// What stands in an item of a sequence that is left out is left out with it, and named with it where it is broken.
#[test]
fn nothing_is_taken_of_items_that_are_left_out() {
    let found = recording(&WriterOptions::default(), |writer| {
        let schema = format!(
            "A[] a\nuint8 x\n{0}\nMSG: p/A\nB b\n{0}\nMSG: p/B\nuint8[] c\nuint8[] d\n",
            "=".repeat(80)
        );
        let channel = RawChannel {
            topic: "/a",
            message_encoding: "ros1",
            schema_name: "p/M",
            schema_encoding: "ros1msg",
            schema_data: schema.as_bytes(),
            metadata: &BTreeMap::new(),
        };
        let channel = writer.raw_channel(&channel).expect("opens");
        let item = [[1, 0, 0, 0, 7].as_slice(), &[70, 0, 0, 0], &[7; 70]].concat();
        let message = [&[65, 0, 0, 0][..], &item.repeat(65), &[9]].concat();
        for (t_ns, length) in [(0, message.len()), (1, message.len() - 2)] {
            writer
                .message(channel, t_ns, &message[..length])
                .expect("writes");
        }
    });
    let (signals, _) = found.signals(&|_| true).expect("reads");
    let told: Vec<_> = signals.iter().map(|s| (&*s.path, &*s.values)).collect();
    assert_eq!(told, [("/a.x", &[9.0][..])]);
    assert_eq!(
        lines(&found),
        [
            "undecodable /a: 1 message could not be decoded; the first, at 0.000 s: ROS 1 message of 5138 bytes ends while reading \"a.b.d\"",
            "long_sequence /a: a has more than 64 items (the limit) in 1 message; it is not among the signals there",
        ]
    );
}

/// The name of a message and a set of one file that defines it.
fn set_of(syntax: &str, message: DescriptorProto) -> (String, Vec<u8>) {
    let name = format!("a.{}", message.name());
    let set = FileDescriptorSet {
        file: vec![FileDescriptorProto {
            name: Some("a.proto".into()),
            package: Some("a".into()),
            syntax: Some(syntax.into()),
            message_type: vec![message],
            ..FileDescriptorProto::default()
        }],
    };
    (name, set.encode_to_vec())
}

/// A recording of one message of that type.
fn one_message(syntax: &str, message: DescriptorProto, bytes: &[u8]) -> Recording {
    let (name, set) = set_of(syntax, message);
    recording(&WriterOptions::default(), |writer| {
        let channel = writer
            .raw_channel(&RawChannel {
                topic: "/p",
                message_encoding: "protobuf",
                schema_name: &name,
                schema_encoding: "protobuf",
                schema_data: &set,
                metadata: &BTreeMap::new(),
            })
            .expect("opens");
        writer.message(channel, START_NS, bytes).expect("writes");
    })
}

fn field(name: &str, number: i32, kind: Type, of: Option<&str>) -> FieldDescriptorProto {
    let label = if of.is_some() {
        Label::Repeated
    } else {
        Label::Optional
    };
    FieldDescriptorProto {
        name: Some(name.into()),
        number: Some(number),
        label: Some(label as i32),
        r#type: Some(kind as i32),
        type_name: of.map(Into::into),
        ..FieldDescriptorProto::default()
    }
}

/// The last member of a oneof counts, whatever came before in the message, and none of the message before.
#[test]
fn of_a_oneof_the_last_counts() {
    let member = |name: &str, number: i32| FieldDescriptorProto {
        oneof_index: Some(0),
        ..field(name, number, Type::Uint32, None)
    };
    let message = DescriptorProto {
        name: Some("P".into()),
        field: vec![
            field("v", 1, Type::Uint32, None),
            member("a", 2),
            member("b", 3),
        ],
        oneof_decl: vec![prost_types::OneofDescriptorProto {
            name: Some("o".into()),
            ..Default::default()
        }],
        ..DescriptorProto::default()
    };
    for (bytes, expected) in [
        (&[8, 1, 16, 2, 24, 3][..], &["/p.b 3", "/p.v 1"][..]),
        (&[24, 3, 16, 2, 8, 1], &["/p.a 2", "/p.v 1"]),
        (&[16, 2, 24, 3, 16, 4], &["/p.a 4", "/p.v 0"]),
    ] {
        let found = one_message("proto3", message.clone(), bytes);
        let (signals, _) = found.signals(&|_| true).expect("reads");
        let mut told: Vec<String> = (signals.iter())
            .map(|s| format!("{} {}", s.path, s.values[0]))
            .collect();
        told.sort();
        assert_eq!(told, expected, "{bytes:?}");
    }
}

/// Of a map's entries with one key the last counts, whole, and a value that is missing is an empty one, as Google's parser has it.
#[test]
fn of_entries_with_one_key_the_last_counts() {
    let mut map = field("m", 1, Type::Message, Some(".a.M.MEntry"));
    map.label = Some(Label::Repeated as i32);
    let single = |name: &str, number: i32, of: &str| FieldDescriptorProto {
        label: Some(Label::Optional as i32),
        ..field(name, number, Type::Message, Some(of))
    };
    let message = DescriptorProto {
        name: Some("M".into()),
        field: vec![map],
        nested_type: vec![
            DescriptorProto {
                name: Some("MEntry".into()),
                field: vec![
                    field("key", 1, Type::Uint32, None),
                    single("value", 2, ".a.M.Sub"),
                ],
                options: Some(MessageOptions {
                    map_entry: Some(true),
                    ..MessageOptions::default()
                }),
                ..DescriptorProto::default()
            },
            DescriptorProto {
                name: Some("Sub".into()),
                field: vec![
                    field("a", 1, Type::Sint32, None),
                    field("b", 2, Type::Uint32, None),
                ],
                ..DescriptorProto::default()
            },
        ],
        ..DescriptorProto::default()
    };
    let (three, nine) = ([10, 6, 8, 5, 18, 2, 8, 6], [10, 6, 8, 5, 18, 2, 16, 9]);
    let none = [10, 2, 8, 5];
    for (syntax, entries, expected) in [
        ("proto2", [&three[..], &nine].concat(), &["/p.m[5].b 9"][..]),
        (
            "proto3",
            [&three[..], &nine].concat(),
            &["/p.m[5].a 0", "/p.m[5].b 9"],
        ),
        (
            "proto3",
            [&nine[..], &three].concat(),
            &["/p.m[5].a 3", "/p.m[5].b 0"],
        ),
        ("proto3", none.to_vec(), &["/p.m[5].a 0", "/p.m[5].b 0"]),
        (
            "proto3",
            [&nine[..], &none].concat(),
            &["/p.m[5].a 0", "/p.m[5].b 0"],
        ),
        ("proto2", [&nine[..], &none].concat(), &[]),
    ] {
        let found = one_message(syntax, message.clone(), &entries);
        let (signals, _) = found.signals(&|_| true).expect("reads");
        let mut told: Vec<String> = (signals.iter())
            .map(|s| format!("{} {}", s.path, s.values[0]))
            .collect();
        told.sort();
        assert_eq!(told, expected, "{syntax} {entries:?}");
    }
}

/// Keys that differ by less than a float tells are different keys.
#[test]
fn keys_of_64_bits_are_exact() {
    let keys = [1i64 << 60, (1 << 60) + 1, -(1 << 60) - 1];
    for kind in [
        Type::Fixed64,
        Type::Sfixed64,
        Type::Sint64,
        Type::Int64,
        Type::Uint64,
    ] {
        let mut map = field("m", 1, Type::Message, Some(".a.M.MEntry"));
        map.label = Some(Label::Repeated as i32);
        let entry = DescriptorProto {
            name: Some("MEntry".into()),
            field: vec![
                field("key", 1, kind, None),
                field("value", 2, Type::Uint32, None),
            ],
            options: Some(MessageOptions {
                map_entry: Some(true),
                ..MessageOptions::default()
            }),
            ..DescriptorProto::default()
        };
        let message = DescriptorProto {
            name: Some("M".into()),
            field: vec![map],
            nested_type: vec![entry],
            ..DescriptorProto::default()
        };
        let varint = |mut bits: u64| {
            let mut out = vec![8];
            while bits > 127 {
                out.push(bits as u8 | 128);
                bits >>= 7;
            }
            [out, vec![bits as u8]].concat()
        };
        let written = |key: i64| match kind {
            Type::Fixed64 | Type::Sfixed64 => [vec![9], key.to_le_bytes().to_vec()].concat(),
            Type::Sint64 => varint(((key << 1) ^ (key >> 63)).cast_unsigned()),
            _ => varint(key.cast_unsigned()),
        };
        let entries = keys.iter().zip(5..).flat_map(|(key, value)| {
            let entry = [written(*key), vec![16, value]].concat();
            [vec![10, entry.len() as u8], entry].concat()
        });
        let found = one_message("proto3", message, &entries.collect::<Vec<u8>>());
        let (signals, _) = found.signals(&|_| true).expect("reads");
        let mut told: Vec<String> = (signals.iter())
            .map(|s| format!("{} {}", s.path, s.values[0]))
            .collect();
        told.sort();
        let expected = keys.iter().zip(5..).map(|(key, value)| match kind {
            Type::Fixed64 | Type::Uint64 => format!("/p.m[{}] {value}", key.cast_unsigned()),
            _ => format!("/p.m[{key}] {value}"),
        });
        let mut expected: Vec<String> = expected.collect();
        expected.sort();
        assert_eq!(told, expected, "{kind:?}");
    }
}

/// Stamps that were not set yet leave no gap between those that were.
#[test]
fn unset_stamps_are_no_gap() {
    let found = recording(&WriterOptions::default(), |writer| {
        let imu = writer.channel("/imu", MessageKind::Imu).expect("opens");
        for i in 0..1000i64 {
            let t_ns = START_NS + i * 10_000_000;
            let mut message = Imu::raw(t_ns, "imu", [0.0; 3], [0.0, 0.0, 9.81]);
            if (300..500).contains(&i) || i % 97 == 0 {
                message.header.stamp = Time::default();
            }
            writer.message(imu, t_ns, &message).expect("writes");
        }
    });
    let told = lines(&found);
    assert_eq!(
        told[0],
        "zero_stamp /imu: 209 header stamps are zero, first at 0.000 s"
    );
    // And that there is no orientation.
    assert_eq!(told.len(), 2, "{told:?}");
}

/// When messages came is known of those that nobody can decode, too.
#[test]
fn messages_without_a_decoder_tell_their_times() {
    let found = recording(&WriterOptions::default(), |writer| {
        let channel = RawChannel {
            topic: "/c",
            message_encoding: "h264",
            schema_name: "",
            schema_encoding: "",
            schema_data: b"",
            metadata: &BTreeMap::new(),
        };
        let channel = writer.raw_channel(&channel).expect("opens");
        for i in (0..40).chain(60..80) {
            (writer.message(channel, START_NS + i * 10_000_000, &[1][..])).expect("writes");
        }
    });
    let mut times = Vec::new();
    let findings = found.stream(&|_| true, &mut |batch| {
        assert_eq!(batch.columns.len(), 0);
        times.extend_from_slice(batch.times_ns);
    });
    findings.expect("reads");
    assert_eq!((times.len(), times[59] - times[0]), (60, 790_000_000));
    assert_eq!(
        lines(&found),
        [
            "no_decoder /c: skipped 60 messages: encoding \"h264\" with schema encoding \"\" has no decoder; there are cdr/ros2msg, cdr/ros2idl, cdr/omgidl, ros1/ros1msg, protobuf/protobuf, json",
            "gap /c: 1 gap in the log times (usual interval 0.010000 s), the longest 0.210 s at 0.390 s"
        ]
    );
}

/// Found by fuzzing: the library panics over the first while it words its error, and over the second when asked for the value.
#[test]
fn protobuf_schemas_of_no_known_kind() {
    let plain = DescriptorProto {
        name: Some("M".into()),
        field: vec![field("x", 1, Type::Double, None)],
        nested_type: vec![DescriptorProto {
            name: Some("N".into()),
            ..DescriptorProto::default()
        }],
        ..DescriptorProto::default()
    };
    for (syntax, said) in [
        // A language of its own, no damage.
        (
            "editions",
            "no_decoder /p: skipped 1 message: the schema \"a.M\" is not read",
        ),
        (
            "proto9",
            "bad_schema /p: skipped 1 message: the schema \"a.M\" cannot be used",
        ),
    ] {
        assert_eq!(
            lines(&one_message(syntax, plain.clone(), &[])),
            [format!(
                "{said}: the FileDescriptorSet's file \"a.proto\" is written in \"{syntax}\"; expected proto2 or proto3"
            )]
        );
    }
    let keyless = DescriptorProto {
        name: Some("M".into()),
        field: vec![
            field("x", 1, Type::Double, None),
            field("m", 2, Type::Message, Some(".a.M.MEntry")),
        ],
        nested_type: vec![DescriptorProto {
            name: Some("MEntry".into()),
            field: vec![field("key", 1, Type::String, None)],
            options: Some(MessageOptions {
                map_entry: Some(true),
                ..MessageOptions::default()
            }),
            ..DescriptorProto::default()
        }],
        ..DescriptorProto::default()
    };
    // x = 1 and an entry of three bytes.
    let bytes = [&[9][..], &1f64.to_le_bytes(), &[18, 3, 10, 1, b'k']].concat();
    let found = one_message("proto3", keyless, &bytes);
    let (signals, _) = found.signals(&|_| true).expect("reads");
    assert_eq!(signals[0].path, "/p.x");
    assert_eq!(signals[0].values, [1.0]);
}

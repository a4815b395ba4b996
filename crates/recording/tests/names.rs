//! Lists whose places hold now this, now that: it is said, and items can be called by the names they carry, in every encoding.

mod common;

use std::collections::BTreeMap;

use common::Shared;
use prost::Message as _;
use prost_types::{
    DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet,
    field_descriptor_proto::{Label, Type},
};
use recording::{
    Kind,
    read::{ReadOptions, Recording},
    write::{RawChannel, RecordingWriter, WriterOptions},
};

/// A name and a value.
type Item = (&'static str, f64);

/// A way to write lists of these.
struct Encoding {
    message: &'static str,
    schema: &'static str,
    name: &'static str,
    definition: Vec<u8>,
    write: fn(&[Item]) -> Vec<u8>,
}

/// Fills up to what a number of this size is aligned to, where any is.
fn pad(body: &mut Vec<u8>, size: usize, align: usize) {
    body.resize(body.len().next_multiple_of(size.min(align)), 0);
}

/// A text as CDR and ROS 1 write it, with what stands behind it.
fn put_text(body: &mut Vec<u8>, text: &str, zero: &[u8], align: usize) {
    pad(body, 4, align);
    body.extend(((text.len() + zero.len()) as u32).to_le_bytes());
    body.extend([text.as_bytes(), zero].concat());
}

/// Frames as CDR and ROS 1 write them.
fn named(items: &[Item], zero: &[u8], align: usize) -> Vec<u8> {
    let mut body = (items.len() as u32).to_le_bytes().to_vec();
    for (name, x) in items {
        for text in ["n", name] {
            put_text(&mut body, text, zero, align);
        }
        pad(&mut body, 8, align);
        body.extend(x.to_le_bytes());
    }
    [&body[..], &[9]].concat()
}

/// Frames, each with its own name.
fn frames() -> Vec<Encoding> {
    let bar = "=".repeat(80);
    let text = |separator: &str| {
        format!(
            "F[] f\nuint8 end\n{bar}\nMSG: p{separator}/F\nstring name\nstring child_frame_id\nfloat64 x\n"
        )
        .into_bytes()
    };
    let field =
        |name: &str, number, label, kind: Type, type_name: Option<&str>| FieldDescriptorProto {
            name: Some(name.into()),
            number: Some(number),
            label: Some(Label::into(label)),
            r#type: Some(kind.into()),
            type_name: type_name.map(Into::into),
            ..FieldDescriptorProto::default()
        };
    let message = |name: &str, field| DescriptorProto {
        name: Some(name.into()),
        field,
        ..DescriptorProto::default()
    };
    let set = FileDescriptorSet {
        file: vec![FileDescriptorProto {
            name: Some("p.proto".into()),
            package: Some("p".into()),
            syntax: Some("proto3".into()),
            message_type: vec![
                message(
                    "M",
                    vec![
                        field("f", 1, Label::Repeated, Type::Message, Some(".p.F")),
                        field("end", 2, Label::Optional, Type::Uint32, None),
                    ],
                ),
                message(
                    "F",
                    vec![
                        field("name", 3, Label::Optional, Type::String, None),
                        field("child_frame_id", 2, Label::Optional, Type::String, None),
                        field("x", 1, Label::Optional, Type::Double, None),
                    ],
                ),
            ],
            ..FileDescriptorProto::default()
        }],
    };
    vec![
        Encoding {
            message: "cdr",
            schema: "ros2msg",
            name: "p/msg/M",
            definition: text("/msg"),
            write: |items| [&[0, 1, 0, 0][..], &named(items, &[0], 8)].concat(),
        },
        Encoding {
            message: "ros1",
            schema: "ros1msg",
            name: "p/M",
            definition: text(""),
            write: |items| named(items, &[], 1),
        },
        Encoding {
            message: "json",
            schema: "",
            name: "",
            definition: Vec::new(),
            write: |items| {
                let items = items.iter().map(|(name, x)| {
                    format!(r#"{{"x": {x}, "child_frame_id": "{name}", "name": "n"}}"#)
                });
                let items: Vec<String> = items.collect();
                format!(r#"{{"f": [{}], "end": 9}}"#, items.join(", ")).into_bytes()
            },
        },
        Encoding {
            message: "protobuf",
            schema: "protobuf",
            name: "p.M",
            definition: set.encode_to_vec(),
            write: |items| {
                let mut body = Vec::new();
                for (name, x) in items {
                    let item = [
                        &[1 << 3 | 1][..],
                        &x.to_le_bytes(),
                        &[2 << 3 | 2, name.len() as u8],
                        name.as_bytes(),
                        &[3 << 3 | 2, 1, b'n'],
                    ]
                    .concat();
                    body.extend([1 << 3 | 2, item.len() as u8]);
                    body.extend(item);
                }
                [&body[..], &[2 << 3, 9]].concat()
            },
        },
    ]
}

/// Joints, with their names in a list before.
fn joints() -> Vec<Encoding> {
    fn texts(items: &[Item], zero: &[u8], align: usize) -> Vec<u8> {
        let mut body = (items.len() as u32).to_le_bytes().to_vec();
        for (name, _) in items {
            put_text(&mut body, name, zero, align);
        }
        pad(&mut body, 4, align);
        body.extend((items.len() as u32).to_le_bytes());
        pad(&mut body, 8, align);
        body.extend(items.iter().flat_map(|(_, x)| x.to_le_bytes()));
        [&body[..], &[9]].concat()
    }
    let definition = b"string[] name\nfloat64[] f\nuint8 end\n".to_vec();
    vec![
        Encoding {
            message: "cdr",
            schema: "ros2msg",
            name: "p/msg/J",
            definition: definition.clone(),
            write: |items| [&[0, 1, 0, 0][..], &texts(items, &[0], 8)].concat(),
        },
        Encoding {
            message: "ros1",
            schema: "ros1msg",
            name: "p/J",
            definition,
            write: |items| texts(items, &[], 1),
        },
        Encoding {
            message: "json",
            schema: "",
            name: "",
            definition: Vec::new(),
            write: |items| {
                let names: Vec<_> = items.iter().map(|(name, _)| format!("{name:?}")).collect();
                let values: Vec<_> = items.iter().map(|(_, x)| x.to_string()).collect();
                format!(
                    r#"{{"name": [{}], "f": [{}], "end": 9}}"#,
                    names.join(", "),
                    values.join(", ")
                )
                .into_bytes()
            },
        },
    ]
}

fn write(encoding: &Encoding, messages: &[Vec<Item>]) -> Vec<u8> {
    let shared = Shared::default();
    let options = WriterOptions {
        chunk_bytes: 500,
        ..WriterOptions::default()
    };
    let mut writer = RecordingWriter::to_stream(shared.clone(), &options).expect("begins");
    let channel = writer
        .raw_channel(&RawChannel {
            topic: "/t",
            message_encoding: encoding.message,
            schema_name: encoding.name,
            schema_encoding: encoding.schema,
            schema_data: &encoding.definition,
            metadata: &BTreeMap::new(),
        })
        .expect("opens");
    for (k, items) in messages.iter().enumerate() {
        let bytes = (encoding.write)(items);
        writer
            .message(channel, k as i64, &bytes[..])
            .expect("writes");
    }
    writer.finish().expect("finishes");
    shared.take()
}

/// The signals of a file, each as messages and values, and what is said of mixed places; all of it, the order of signals too, whatever the number of threads.
fn read(bytes: &[u8], by_name: bool) -> (BTreeMap<String, Vec<(i64, f64)>>, Vec<String>) {
    let of = |threads| -> (Vec<_>, Vec<String>) {
        let options = ReadOptions {
            by_name,
            threads,
            ..ReadOptions::default()
        };
        let recording = Recording::from_bytes(bytes.to_vec(), &options).expect("opens");
        let start_ns = recording.info().start_ns;
        let (signals, findings) = recording.signals(&|_| true).expect("reads");
        let told = findings.iter().map(|finding| {
            assert_eq!(finding.kind, Kind::MixedItems, "{finding}");
            finding.text.clone()
        });
        let signals = signals.into_iter().map(|signal| {
            let times = signal.times_ns.iter().map(|t| t - start_ns);
            let values: Vec<(i64, f64)> = times.zip(signal.values.iter().copied()).collect();
            (signal.path.clone(), values)
        });
        (signals.collect(), told.collect())
    };
    let one = of(1);
    for threads in [2, 3, 3, 3] {
        assert_eq!(of(threads), one, "{threads} threads");
    }
    (one.0.into_iter().collect(), one.1)
}

/// Three publishers in turn: two whose messages are equally long, so that nothing but the names tells them apart, and one of two items. Now and then
/// somebody has no name, alone or behind one who has.
fn messages() -> Vec<Vec<Item>> {
    let each = |k: usize| {
        let x = k as f64;
        match k % 5 {
            0 | 1 => vec![("left", x)],
            2 => vec![("rear", x + 0.5)],
            3 => vec![("base", -x), ("left", x + 0.25)],
            _ if k % 25 == 14 => vec![("base", x + 0.75), ("", x)],
            _ if k % 25 == 24 => vec![("", x)],
            _ => vec![("base", -x), ("left", x + 0.25)],
        }
    };
    (0..200).map(each).collect()
}

fn expected(label: impl Fn(usize, &str) -> String) -> BTreeMap<String, Vec<(i64, f64)>> {
    let mut signals: BTreeMap<String, Vec<(i64, f64)>> = BTreeMap::new();
    for (k, items) in messages().iter().enumerate() {
        for (place, (name, x)) in items.iter().enumerate() {
            let signal = signals.entry(label(place, name)).or_default();
            signal.push((k as i64, *x));
        }
        let end = signals.entry("/t.end".into()).or_default();
        end.push((k as i64, 9.0));
    }
    signals
}

#[test]
fn items_are_called_by_their_names_where_that_is_asked_for() {
    for (kind, encodings) in [(".x", frames()), ("", joints())] {
        for encoding in encodings {
            let bytes = write(&encoding, &messages());
            let (signals, told) = read(&bytes, true);
            let label = |place: usize, name: &str| match name {
                "" => format!("/t.f[{place}]{kind}"),
                name => format!("/t.f[{name}]{kind}"),
            };
            assert_eq!(signals, expected(label), "{} {kind}", encoding.message);
            assert_eq!(told, [""; 0], "{}", encoding.message);
        }
    }
}

#[test]
fn places_that_hold_several_in_turn_are_said() {
    for (list, kind, encodings) in [("f", ".x", frames()), ("name", "", joints())] {
        for encoding in encodings {
            let bytes = write(&encoding, &messages());
            let (signals, told) = read(&bytes, false);
            let label = |place: usize, _: &str| format!("/t.f[{place}]{kind}");
            assert_eq!(signals, expected(label), "{} {kind}", encoding.message);
            let said = format!(
                "{list}[0] is in turn base, left, rear: signals of such a place mix what belongs to several; they can be read by name"
            );
            assert_eq!(told, [said], "{}", encoding.message);
        }
    }
}

/// Lists that are what they are, and single ones, are not remarked on.
#[test]
fn lists_in_one_order_are_not_remarked_on() {
    let messages: Vec<Vec<Item>> = (0..200)
        .map(|k| {
            let mut items = vec![("base", k as f64), ("left", 1.0), ("right", 2.0)];
            items.truncate(1 + k % 3);
            items
        })
        .collect();
    for encoding in frames().into_iter().chain(joints()) {
        let (_, told) = read(&write(&encoding, &messages), false);
        assert_eq!(told, [""; 0], "{}", encoding.message);
    }
}

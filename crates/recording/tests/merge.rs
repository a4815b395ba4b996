//! Recordings put together: everything is there, once, in order; what could not be told apart afterwards is refused.

use std::{
    fs,
    path::{Path, PathBuf},
};

use recording::{
    cdr::Float64,
    merge::{MergeError, Parts, Shared, files},
    read::{RawAttachment, ReadOptions, Recording},
    topics::MessageKind,
    write::{RawChannel, RecordingWriter, WriterOptions},
};
use tempfile::TempDir;

const SECOND_NS: i64 = 1_000_000_000;

/// A recording with one message every 10 ms on each topic, in an encoding that nothing here decodes; a chunk holds a few.
fn record(path: &Path, topics: &[&str], from_s: f64, to_s: f64) {
    let options = WriterOptions {
        profile: "x-test".into(),
        chunk_bytes: 256,
        ..WriterOptions::default()
    };
    let mut writer = RecordingWriter::create(path, &options).expect("begins");
    let name = path
        .file_name()
        .and_then(|name| name.to_str())
        .expect("a name");
    for (record, value) in [("walk", "Kullu"), ("part", name)] {
        let values = [("is".to_owned(), value.to_owned())].into();
        writer.metadata(record, &values).expect("takes it");
    }
    for (name, data) in [("map.txt", "everywhere the same"), ("note.txt", name)] {
        let attachment = RawAttachment {
            name,
            media_type: "text/plain",
            log_time_ns: 3,
            create_time_ns: 4,
            data: data.as_bytes(),
        };
        writer.copy_attachment(&attachment).expect("takes it");
    }
    let channels: Vec<_> = (topics.iter())
        .map(|topic| {
            let channel = RawChannel {
                topic,
                message_encoding: "x-own",
                schema_name: "own",
                schema_encoding: "x-own",
                schema_data: b"text",
                metadata: &[("of".to_owned(), (*topic).to_owned())].into(),
            };
            writer.raw_channel(&channel).expect("takes it")
        })
        .collect();
    let ticks = |t_s: f64| (100.0 * t_s).round() as i64;
    for tick in ticks(from_s)..ticks(to_s) {
        for (channel, topic) in channels.iter().zip(topics) {
            let data = format!("{topic} {tick}");
            let t_ns = tick * SECOND_NS / 100;
            writer
                .message(*channel, t_ns, data.as_bytes())
                .expect("takes it");
        }
    }
    writer.finish().expect("ends");
}

fn open(paths: &[PathBuf]) -> Result<Parts, MergeError> {
    Parts::open(&files(paths)?, Shared::Refused, &ReadOptions::default())
}

fn merge(parts: &Parts, out: &Path) -> Recording {
    let options = WriterOptions {
        profile: parts.profile().into(),
        ..WriterOptions::default()
    };
    let mut writer = RecordingWriter::create(out, &options).expect("begins");
    let mut bytes = 0;
    let count = parts
        .write(&mut writer, |more| bytes += more)
        .expect("writes");
    assert_eq!(bytes, parts.bytes());
    writer.finish().expect("ends");
    let recording = Recording::open(out, &ReadOptions::default()).expect("opens");
    assert_eq!(recording.info().messages, count);
    recording
}

/// Time, sequence number and text of every message, in the order of the file.
fn messages(recording: &Recording) -> Vec<(i64, u32, String)> {
    let mut all = Vec::new();
    let keep = |text: &[u8]| String::from_utf8(text.to_vec()).expect("text");
    recording
        .messages(&|_| true, &mut |m| {
            assert_eq!(m.publish_time_ns, m.log_time_ns.cast_unsigned());
            all.push((m.log_time_ns, m.sequence, keep(m.data)));
        })
        .expect("reads");
    all
}

fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

#[test]
fn the_parts_of_a_bag_are_one_recording_whatever_their_order() {
    let folder = folder();
    let bag = folder.path().join("bag");
    fs::create_dir(&bag).expect("a folder");
    let names = ["bag_10.mcap", "bag_8.mcap", "bag_9.mcap"].map(|name| bag.join(name));
    // The recorder begins a part half a second before it ends the last one.
    record(&names[1], &["/a", "/b"], 1000.0, 1003.5);
    record(&names[2], &["/a", "/b"], 1003.0, 1006.0);
    record(&names[0], &["/a", "/b", "/c"], 1006.0, 1009.0);
    fs::write(bag.join("metadata.yaml"), "of ROS 2").expect("writes");
    let out = |name: &str| folder.path().join(name);
    let parts = open(&[bag]).expect("fits");
    assert_eq!(parts.to_string(), "3 recordings");
    assert_eq!((parts.notes(), parts.losses()), (Vec::new(), Vec::new()));
    let whole = merge(&parts, &out("whole.mcap"));
    merge(&open(&names).expect("fits"), &out("again.mcap"));
    let bytes = |name| fs::read(out(name)).expect("reads");
    assert!(bytes("whole.mcap") == bytes("again.mcap"));

    let info = whole.info();
    assert_eq!((&info.profile[..], info.channels.len()), ("x-test", 3));
    let c = &info.channels[2];
    assert_eq!(
        (&c.topic[..], &c.schema[..], &*c.schema_data),
        ("/c", "own", &b"text"[..])
    );
    assert_eq!(c.metadata["of"], "/c");
    let mut expected = Vec::new();
    for name in [&names[1], &names[2], &names[0]] {
        let part = Recording::open(name, &ReadOptions::default()).expect("opens");
        expected.extend(messages(&part));
    }
    let mut found = messages(&whole);
    assert_eq!(found.len(), 2 * 950 + 300);
    // A chunk holds less than a tenth of a second.
    let latest = |upto: &[(i64, u32, String)]| upto.iter().map(|m| m.0).max();
    for (k, (t_ns, ..)) in found.iter().enumerate() {
        assert!(latest(&found[..k]).is_none_or(|last| *t_ns > last - SECOND_NS / 10));
    }
    found.sort();
    expected.sort();
    assert_eq!(found, expected);

    let attached: Vec<_> = whole
        .attachments()
        .map(|a| (a.name, a.data, a.create_time_ns))
        .collect();
    let note = |name: &'static str| ("note.txt", name.as_bytes(), 4);
    assert_eq!(
        attached,
        [
            ("map.txt", &b"everywhere the same"[..], 4),
            note("bag_8.mcap"),
            note("bag_9.mcap"),
            note("bag_10.mcap")
        ]
    );
    let records = whole.metadata_records().iter();
    let records: Vec<_> = records
        .map(|(name, values)| (&name[..], &values["is"][..]))
        .collect();
    assert_eq!(
        records,
        [
            ("walk", "Kullu"),
            ("part", "bag_8.mcap"),
            ("part", "bag_9.mcap"),
            ("part", "bag_10.mcap")
        ]
    );
}

#[test]
fn recorders_of_one_time_are_woven_together() {
    let folder = folder();
    let [robot, phones, empty, out] = ["robot.mcap", "phones.mcap", "empty.mcap", "both.mcap"]
        .map(|name| folder.path().join(name));
    record(&robot, &["/odom"], 10.0, 20.0);
    record(&phones, &["/imu"], 12.0, 40.0);
    // It names a topic of the others and has no message of it.
    record(&empty, &["/imu"], 15.0, 15.0);
    let parts = open(&[phones, robot, empty.clone()]).expect("fits");
    assert_eq!(
        parts.notes(),
        [format!("{}: holds no messages", empty.display())]
    );
    let found = messages(&merge(&parts, &out));
    assert_eq!(found.len(), 1000 + 2800);
    let swaps = found
        .windows(2)
        .filter(|pair| pair[0].2[..4] != pair[1].2[..4]);
    assert!(swaps.count() > 100, "they are not one behind the other");
    let back_ns = found.windows(2).map(|pair| pair[0].0 - pair[1].0).max();
    assert!(
        back_ns.is_some_and(|back_ns| back_ns < SECOND_NS / 10),
        "{back_ns:?}"
    );
}

#[test]
fn what_could_not_be_told_apart_is_refused() {
    let folder = folder();
    let [a, b, later, none] =
        ["a.mcap", "b.mcap", "later.mcap", "none"].map(|name| folder.path().join(name));
    record(&a, &["/x", "/imu"], 0.0, 10.0);
    record(&b, &["/imu"], 5.0, 15.0);
    record(&later, &["/imu"], 40.0, 41.0);
    fs::create_dir(&none).expect("a folder");
    let error = |paths: &[&PathBuf]| {
        let paths: Vec<PathBuf> = paths.iter().map(|path| (*path).clone()).collect();
        open(&paths).err().expect("refused").to_string()
    };
    let (a_name, b_name) = (a.display(), b.display());
    assert_eq!(
        error(&[&b, &a]),
        format!(
            "{b_name}: holds /imu at a time when {a_name} does, too (for 5.0 s); expected parts of one recording one after the other, or \
             recordings of different topics (`--keep-first` takes what two hold from the one given first; `analyze {a_name} {b_name}` compares them)"
        )
    );
    assert_eq!(
        error(&[&a, &a]),
        format!("{a_name}: is given twice; expected each recording once")
    );
    assert!(
        error(&[&none]).ends_with("none: has no recording in it; expected files that end in .mcap")
    );
    assert!(error(&[&a, &folder.path().join("no.mcap")]).contains("no.mcap: cannot be read"));
    let apart = open(&[later.clone(), a.clone()]).expect("fits");
    let pause = format!("{}: begins 30.0 s after {a_name} ends", later.display());
    assert_eq!(apart.notes(), [pause]);
}

/// Of three that hold one topic, the second gives way to the first; then the third, which meets only the second, keeps its own.
#[test]
fn what_two_hold_at_one_time_is_taken_from_the_one_given_first() {
    let folder = folder();
    let [first, second, third, out] =
        ["1.mcap", "2.mcap", "3.mcap", "out.mcap"].map(|name| folder.path().join(name));
    record(&first, &["/tf", "/odom"], 10.0, 20.0);
    record(&second, &["/imu", "/tf"], 5.0, 30.0);
    record(&third, &["/tf"], 25.0, 35.0);
    let paths = [first.clone(), second.clone(), third];
    let parts = Parts::open(&paths, Shared::OfFirst, &ReadOptions::default()).expect("fits");
    let (of, out_of) = (first.display(), second.display());
    assert_eq!(
        parts.notes(),
        [format!(
            "{out_of}: /tf is left out (2500 messages), it is taken from {of}"
        )]
    );
    let whole = merge(&parts, &out);
    let of_topic = |topic: &str| {
        let all = messages(&whole).into_iter();
        let ticks = all.filter(|(_, _, text)| text.starts_with(&format!("{topic} ")));
        let mut ticks: Vec<i64> = ticks.map(|(t_ns, ..)| t_ns * 100 / SECOND_NS).collect();
        ticks.sort_unstable();
        ticks
    };
    assert!(
        of_topic("/tf")
            .into_iter()
            .eq((1000..2000).chain(2500..3500))
    );
    assert!(of_topic("/imu").into_iter().eq(500..3000));
    assert!(of_topic("/odom").into_iter().eq(1000..2000));
}

/// It is topics that must not be held twice at one time, not files that must not overlap.
#[test]
fn topics_that_are_held_one_after_the_other_fit_though_the_files_overlap() {
    let folder = folder();
    let [robot, phones, out] =
        ["robot.mcap", "phones.mcap", "both.mcap"].map(|name| folder.path().join(name));
    // A map, once at the beginning of either; and what is told by the one first, then by the other.
    for (path, own, (from_s, to_s)) in [
        (&robot, "/odom", (0.0, 20.0)),
        (&phones, "/imu", (20.5, 60.0)),
    ] {
        let mut writer = RecordingWriter::create(path, &WriterOptions::default()).expect("begins");
        let [map, event, own] = ["/map", "/event", own].map(|topic| {
            writer
                .channel(topic, MessageKind::Float64)
                .expect("takes it")
        });
        let mut tell = |channel, from_s: f64, to_s: f64| {
            for tick in (100.0 * from_s) as i64..(100.0 * to_s) as i64 {
                writer
                    .message(channel, tick * SECOND_NS / 100, &Float64 { data: 1.0 })
                    .expect("takes it");
            }
        };
        tell(map, 0.0, 0.01);
        tell(own, 0.0, 60.0);
        tell(event, from_s, to_s);
        writer.finish().expect("ends");
    }
    let paths = [phones, robot];
    let parts = open(&paths).expect("fits");
    assert!(parts.notes().is_empty(), "{:?}", parts.notes());
    let whole = merge(&parts, &out);
    assert_eq!(whole.info().messages, 2 * 6001 + 2000 + 3950);
    // Two seconds of one time are too much, and what the error says.
    let error = {
        record(&paths[0], &["/event"], 18.0, 60.0);
        open(&paths).err().expect("refused").to_string()
    };
    assert!(
        error.contains("holds /event") && error.contains("(for 2.0 s)"),
        "{error}"
    );
}

/// What comes once in a while is held from its first message to its last: its own intervals say what a pause is.
#[test]
fn a_slow_topic_that_two_hold_is_refused() {
    let folder = folder();
    let slow = |name: &str, times_s: &[i64]| {
        let path = folder.path().join(name);
        let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).expect("begins");
        let battery = (writer.channel("/battery", MessageKind::Float64)).expect("takes it");
        for t_s in times_s {
            writer
                .message(battery, t_s * SECOND_NS, &Float64 { data: 1.0 })
                .expect("takes it");
        }
        writer.finish().expect("ends");
        path
    };
    let every_30: Vec<i64> = (0..11).map(|k| 30 * k).collect();
    let late = [&[600], &every_30[..]].concat();
    let whole = slow("whole.mcap", &every_30);
    for copy in [slow("copy.mcap", &every_30), slow("late.mcap", &late)] {
        let error = open(&[whole.clone(), copy]).err().expect("refused");
        let said = error.to_string();
        assert!(
            said.contains("/battery") && said.contains("(for 300.0 s)"),
            "{said}"
        );
    }
    // Parts of a bag; one that fills a pause of another.
    let paused = slow("paused.mcap", &[0, 30, 60, 90, 300, 330, 360]);
    let filling = slow("filling.mcap", &[120, 150, 180, 210]);
    let next = slow("next.mcap", &[390, 420]);
    open(&[paused, filling, next]).expect("fits");
}

#[test]
fn what_is_left_of_a_damaged_part_is_taken_and_what_is_lost_is_said() {
    let folder = folder();
    let [whole, cut, out] =
        ["whole.mcap", "cut.mcap", "out.mcap"].map(|name| folder.path().join(name));
    record(&whole, &["/imu"], 0.0, 5.0);
    record(&cut, &["/imu"], 5.0, 10.0);
    let bytes = fs::read(&cut).expect("reads");
    fs::write(&cut, &bytes[..bytes.len() / 3]).expect("writes");
    let parts = open(&[cut.clone(), whole]).expect("fits");
    let losses = parts.losses();
    assert!(
        !losses.is_empty()
            && losses
                .iter()
                .all(|loss| loss.starts_with(&cut.display().to_string())),
        "{losses:?}"
    );
    let found = messages(&merge(&parts, &out));
    assert!((501..1000).contains(&found.len()), "{}", found.len());
    let ticks = found.iter().map(|(t_ns, ..)| *t_ns * 100 / SECOND_NS);
    assert!(
        ticks.eq(0..found.len() as i64),
        "from the beginning to where the cut is"
    );
}

#[test]
fn messages_whose_times_cannot_be_held_are_counted() {
    let folder = folder();
    let [late, out] = ["late.mcap", "out.mcap"].map(|name| folder.path().join(name));
    let mut writer = mcap::Writer::new(fs::File::create(&late).expect("begins")).expect("begins");
    let channel = (writer.add_channel(0, "/a", "json", &[].into())).expect("takes it");
    for (sequence, log_time) in [5, u64::MAX, 6, 1 << 63, 7].into_iter().enumerate() {
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: sequence as u32,
            log_time,
            publish_time: log_time,
        };
        writer
            .write_to_known_channel(&header, b"1")
            .expect("takes it");
    }
    writer.finish().expect("ends");
    let parts = open(&[late]).expect("fits");
    let losses = parts.losses();
    let said =
        "/a: log times beyond the year 2262 cannot be held in nanoseconds (2 messages left out)";
    assert!(losses.len() == 1 && losses[0].ends_with(said), "{losses:?}");
    let mut writer = RecordingWriter::create(&out, &WriterOptions::default()).expect("begins");
    assert_eq!(parts.write(&mut writer, |_| {}).expect("writes"), 3);
}

/// Parts that begin with what was kept from before the clock was set lie one after the other all the same.
#[test]
fn a_message_dated_long_before_all_others_makes_no_overlap() {
    let folder = folder();
    let write = |name: &str, from_s: i64| {
        let path = folder.path().join(name);
        let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).expect("begins");
        let x = writer
            .channel("/x", MessageKind::Float64)
            .expect("takes it");
        let ticks = (0..1000).map(|k| from_s * SECOND_NS + k * SECOND_NS / 100);
        for t_ns in [0].into_iter().chain(ticks) {
            writer
                .message(x, t_ns, &Float64 { data: 1.0 })
                .expect("takes it");
        }
        writer.finish().expect("ends");
        path
    };
    let parts = open(&[write("a.mcap", 1000), write("b.mcap", 1010)]).expect("fits");
    assert!(parts.notes().is_empty(), "{:?}", parts.notes());
    let whole = merge(&parts, &folder.path().join("whole.mcap"));
    assert_eq!(whole.info().messages, 2002);
}

/// What of `rath` two recordings say differently counts as the later one says it, and that is told.
#[test]
fn what_recordings_say_differently_is_told() {
    let folder = folder();
    let write = |name: &str, t_ns: i64, mass_kg: &str| {
        let path = folder.path().join(name);
        let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).expect("begins");
        let values =
            [("mass_kg", mass_kg), ("source", "field")].map(|(k, v)| (k.to_owned(), v.to_owned()));
        writer.metadata("rath", &values.into()).expect("takes it");
        let x = writer
            .channel("/x", MessageKind::Float64)
            .expect("takes it");
        writer
            .message(x, t_ns, &Float64 { data: 1.0 })
            .expect("takes it");
        writer.finish().expect("ends");
        path
    };
    let paths = [
        write("late.mcap", 9 * SECOND_NS, "70"),
        write("early.mcap", SECOND_NS, "60"),
    ];
    let parts = open(&paths).expect("fits");
    assert_eq!(
        parts.notes(),
        [format!(
            "the recordings say different things of mass_kg; what {}, which begins last, says will count",
            paths[0].display()
        )]
    );
    let whole = merge(&parts, &folder.path().join("whole.mcap"));
    assert_eq!(whole.info().metadata["rath"]["mass_kg"], "70");
    let alike = [write("late.mcap", 9 * SECOND_NS, "60"), paths[1].clone()];
    assert!(open(&alike).expect("fits").notes().is_empty());
}

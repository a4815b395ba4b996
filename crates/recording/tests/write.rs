//! What the writer promises: the same bytes for the same content, the whole file or none, a killed program's chunks readable.

mod common;

use std::{
    collections::BTreeMap,
    fs, io,
    path::Path,
    process::{Command, Stdio},
    time::Duration,
};

use common::Shared;
use recording::{
    cdr,
    read::{ReadOptions, Recording},
    schema::rath,
    topics::{self, MessageKind},
    write::{ChannelId, RawChannel, RecordingWriter, WriteError, WriterOptions},
};

fn fill(writer: &mut RecordingWriter, messages: i64) -> Result<(), WriteError> {
    writer.metadata(
        "rath",
        &BTreeMap::from([("scene".to_owned(), "test".to_owned())]),
    )?;
    writer.attachment("scene.toml", "application/toml", b"x = 1")?;
    let state = writer.channel(topics::STATE, MessageKind::RathState)?;
    let imu = writer.channel(topics::IMU_RATH, MessageKind::Imu)?;
    for i in 0..messages {
        let t_ns = i * 33_000_000;
        let x = i as f64;
        let message = rath::State {
            time_s: x,
            position_m: Some(rath::Vector3 { x, y: -x, z: 0.0 }),
            ..rath::State::default()
        };
        writer.message(state, t_ns, &message)?;
        writer.message(
            imu,
            t_ns,
            &cdr::Imu::raw(t_ns, "rath", [x, 0.0, 0.0], [0.0, 0.0, 9.81]),
        )?;
    }
    Ok(())
}

/// By the caller's thread, and by one of its own.
fn both_ways() -> [WriterOptions; 2] {
    [WriterOptions::default(), WriterOptions::beside()]
}

#[test]
fn a_thread_of_its_own_writes_the_same_bytes() {
    let [here, beside] = both_ways().map(|options| {
        let shared = Shared::default();
        let mut writer = RecordingWriter::to_stream(shared.clone(), &options).expect("begins");
        // What is no message comes between messages and stays there; some are larger than what waits together.
        for part in 0..3 {
            fill(&mut writer, 3000).expect("writes");
            let name = format!("part {part}");
            writer.metadata(&name, &BTreeMap::new()).expect("writes");
            let raw = RawChannel {
                topic: &name,
                message_encoding: "",
                schema_name: "",
                schema_encoding: "",
                schema_data: &[],
                metadata: &BTreeMap::new(),
            };
            let raw = writer.raw_channel(&raw).expect("opens");
            for size in [0, 1, 1 << 20] {
                let message = vec![7_u8; size];
                writer.message(raw, 1, &message[..]).expect("writes");
            }
        }
        writer.finish().expect("finishes");
        shared.take()
    });
    assert!(here == beside);
    let messages = mcap::MessageStream::new(&beside).expect("opens");
    assert_eq!(messages.filter(Result::is_ok).count(), 3 * (6000 + 3));
}

#[test]
fn the_same_content_gives_the_same_bytes_to_a_file_and_to_a_stream() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mcap");
    let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).expect("begins");
    fill(&mut writer, 5000).expect("writes");
    assert!(!path.exists(), "the name appears only at the end");
    writer.finish().expect("finishes");
    let shared = Shared::default();
    let mut writer =
        RecordingWriter::to_stream(shared.clone(), &WriterOptions::default()).expect("begins");
    fill(&mut writer, 5000).expect("writes");
    writer.finish().expect("finishes");
    let bytes = fs::read(&path).expect("reads");
    assert!(bytes == shared.take());
    assert_eq!(fs::read_dir(folder.path()).expect("lists").count(), 1);

    let recording = Recording::open(&path, &ReadOptions::default()).expect("opens");
    let (signals, findings) = recording.signals(&|_| true).expect("reads");
    assert_eq!(
        findings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        ["/imu/rath: orientation is declared as not given (covariance -1)"]
    );
    let info = recording.info();
    assert_eq!(
        (
            info.profile.as_str(),
            info.library.starts_with("rath "),
            info.messages
        ),
        ("", true, 10_000)
    );
    assert_eq!(
        recording.attachment("scene.toml").as_deref(),
        Some(b"x = 1".as_slice())
    );
    let y = signals
        .iter()
        .find(|signal| signal.path == "/rath/state.position_m.y")
        .expect("a signal");
    assert!(y.values.iter().enumerate().all(|(i, y)| *y == -(i as f64)));
    assert_eq!(y.unit, "m");
    // The official library reads it too: one time for both, numbers that count from 0.
    let mut read = 0;
    for message in mcap::MessageStream::new(&bytes).expect("opens") {
        let message = message.expect("whole");
        let of_channel = read / 2;
        assert_eq!(message.sequence, of_channel);
        assert_eq!(message.log_time, u64::from(of_channel) * 33_000_000);
        assert_eq!(message.publish_time, message.log_time);
        read += 1;
    }
    assert_eq!(read, 10_000);
    // Chunks are compressed and small, and a killed program loses ten seconds of log time at most.
    let summary = mcap::Summary::read(&bytes).expect("reads").expect("there");
    assert!(summary.chunk_indexes.len() >= 16, "165 s");
    for chunk in &summary.chunk_indexes {
        assert_eq!(chunk.compression, "zstd");
        assert!(chunk.uncompressed_size < 520 << 10, "{chunk:?}");
        let spans_ns = chunk.message_end_time - chunk.message_start_time;
        assert!(spans_ns <= 10_033_000_000, "{chunk:?}");
    }
}

/// A channel of bare bytes.
fn bytes_channel(writer: &mut RecordingWriter) -> ChannelId {
    let raw = RawChannel {
        topic: "/bytes",
        message_encoding: "",
        schema_name: "",
        schema_encoding: "",
        schema_data: &[],
        metadata: &BTreeMap::new(),
    };
    writer.raw_channel(&raw).expect("opens")
}

/// Unpacked bytes, first and last log time of every chunk that a recording has.
fn chunks(
    options: &WriterOptions,
    fill: impl FnOnce(&mut RecordingWriter, ChannelId),
) -> Vec<(u64, [u64; 2])> {
    let shared = Shared::default();
    let mut writer = RecordingWriter::to_stream(shared.clone(), options).expect("begins");
    let channel = bytes_channel(&mut writer);
    fill(&mut writer, channel);
    writer.finish().expect("finishes");
    let summary = mcap::Summary::read(&shared.take()).expect("reads");
    let of = |c: &mcap::records::ChunkIndex| {
        let span_ns = [c.message_start_time, c.message_end_time];
        (c.uncompressed_size, span_ns)
    };
    summary
        .expect("there")
        .chunk_indexes
        .iter()
        .map(of)
        .collect()
}

#[test]
fn a_chunk_closes_when_it_holds_so_many_bytes() {
    for options in both_ways() {
        let chunks = chunks(&options, |writer, channel| {
            for _ in 0..3000 {
                let message = [7_u8; 1000];
                writer.message(channel, 1, &message[..]).expect("writes");
            }
        });
        let (last, whole) = chunks.split_last().expect("some");
        // 31 bytes of each record come on top.
        let most = (512 << 10) + 1031 + 100;
        let fits = |bytes: u64| (512 << 10..most).contains(&bytes);
        assert!(
            whole.len() == 5 && whole.iter().all(|c| fits(c.0)),
            "{chunks:?}"
        );
        assert!(last.0 < most, "{chunks:?}");
    }
}

#[test]
fn a_chunk_spans_so_much_log_time_from_its_own_first_message() {
    const S: u64 = 1_000_000_000;
    type Beside = fn(&mut RecordingWriter);
    let attached: Beside = |w| w.attachment("a", "text/plain", b"a").expect("writes");
    let noted: Beside = |w| w.metadata("a", &BTreeMap::new()).expect("writes");
    for options in both_ways() {
        for (beside, expected) in [
            (None, vec![[0, 10 * S], [11 * S, 21 * S], [22 * S, 24 * S]]),
            // Either closes the chunk, and the next one's time runs from its own beginning.
            (
                Some(attached),
                vec![[0, 6 * S], [7 * S, 17 * S], [18 * S, 24 * S]],
            ),
            (
                Some(noted),
                vec![[0, 6 * S], [7 * S, 17 * S], [18 * S, 24 * S]],
            ),
        ] {
            let chunks = chunks(&options, |writer, channel| {
                for second in 0..25_i64 {
                    if let (7, Some(beside)) = (second, beside) {
                        beside(writer);
                    }
                    let t_ns = second * S.cast_signed();
                    writer.message(channel, t_ns, &[7_u8][..]).expect("writes");
                }
            });
            let spans: Vec<[u64; 2]> = chunks.iter().map(|c| c.1).collect();
            assert_eq!(spans, expected);
        }
    }
}

/// How many whole chunks the beginning of a recording holds.
fn whole_chunks(beginning: &[u8]) -> usize {
    let mut chunks = 0;
    let mut rest = beginning.get(8..).unwrap_or_default();
    while let Some((head, body)) = rest.split_first_chunk::<9>() {
        let length = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
        let Some(after) = body.get(length as usize..) else {
            break;
        };
        chunks += usize::from(head[0] == 6);
        rest = after;
    }
    chunks
}

/// What waits for the thread is little, and not for long: what a batch holds back is not in the file that a killed program leaves.
#[test]
fn what_waits_for_the_thread_goes_on_its_way() {
    for (messages, bytes, step_ns) in [(1, 32 << 10, 0), (1024, 0, 0), (2, 0, 1_000_000_000)] {
        // Each message closes its chunk, and a closed chunk is flushed.
        let options = WriterOptions {
            chunk_ns: 0,
            ..WriterOptions::beside()
        };
        let shared = Shared::default();
        let mut writer = RecordingWriter::to_stream(shared.clone(), &options).expect("begins");
        let channel = bytes_channel(&mut writer);
        for i in 0..messages {
            let message = vec![7_u8; bytes];
            writer
                .message(channel, i * step_ns, &message[..])
                .expect("writes");
        }
        let (mut arrived, mut there) = (Vec::new(), 0);
        for _ in 0..1000 {
            arrived.extend(shared.take());
            there = whole_chunks(&arrived);
            if there == messages as usize {
                break;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        assert_eq!(there, messages as usize, "{bytes} bytes, {step_ns} ns");
        drop(writer);
    }
}

#[test]
fn nothing_is_left_when_it_fails_or_is_given_up() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mcap");
    fs::write(&path, "old").expect("writes");
    for options in both_ways() {
        let mut writer = RecordingWriter::create(&path, &options).expect("begins");
        fill(&mut writer, 5000).expect("writes");
        assert_eq!(fs::read_dir(folder.path()).expect("lists").count(), 2);
        drop(writer);
        assert_eq!(fs::read_dir(folder.path()).expect("lists").count(), 1);
        assert_eq!(
            fs::read(&path).expect("reads"),
            b"old",
            "what was there stays"
        );
    }

    let error = RecordingWriter::create(
        Path::new("no/such/folder/a.mcap"),
        &WriterOptions::default(),
    )
    .err()
    .expect("refused");
    let text = error.to_string();
    assert!(
        text.starts_with("no/such/folder/a.mcap: cannot be written: there is no such folder"),
        "{text}"
    );
    let error = RecordingWriter::create(folder.path(), &WriterOptions::default())
        .err()
        .expect("refused")
        .to_string();
    assert!(error.contains("it is a folder"), "{error}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_said() {
    for options in both_ways() {
        // At the end, and at a message long before it.
        for messages in [10, 100_000_000] {
            let result =
                RecordingWriter::create(Path::new("/dev/full"), &options).and_then(|mut writer| {
                    fill(&mut writer, messages)?;
                    writer.finish()
                });
            let error = result.expect_err("there is no room").to_string();
            assert!(
                error.starts_with("/dev/full: cannot be written: No space left on device"),
                "{error}"
            );
        }
    }
}

#[test]
fn a_time_before_zero_is_refused() {
    let mut writer =
        RecordingWriter::to_stream(io::sink(), &WriterOptions::default()).expect("begins");
    let beat = writer
        .channel(topics::BEAT, MessageKind::Beat)
        .expect("opens");
    let error = writer
        .message(beat, -1, &rath::Beat::default())
        .expect_err("refused")
        .to_string();
    assert_eq!(
        error,
        "standard output: a message on /beat has the time -1 ns; times must not be negative"
    );
}

/// The child of the next test: writes without end.
#[test]
fn child_that_is_killed() {
    let Ok(path) = std::env::var("RATH_TEST_KILLED") else {
        return;
    };
    let [here, beside] = both_ways();
    let options = if std::env::var_os("RATH_TEST_BESIDE").is_some() {
        beside
    } else {
        here
    };
    let mut writer = RecordingWriter::create(Path::new(&path), &options).expect("begins");
    fill(&mut writer, i64::from(u32::MAX)).expect("writes");
}

#[test]
fn a_killed_writer_leaves_whole_messages_under_another_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let rounds = if cfg!(debug_assertions) { 10 } else { 100 };
    let mut salvaged = [0; 2];
    for round in 0..rounds {
        let path = folder.path().join("a.mcap");
        let way = round as usize % 2;
        let mut command = Command::new(std::env::current_exe().expect("this test"));
        if way == 1 {
            command.env("RATH_TEST_BESIDE", "");
        }
        let mut child = command
            .args(["child_that_is_killed", "--exact"])
            .env("RATH_TEST_KILLED", &path)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("starts");
        std::thread::sleep(Duration::from_millis(3 + 7 * round % 97));
        child.kill().expect("kills");
        child.wait().expect("ends");
        assert!(!path.exists(), "nothing under the final name");
        for entry in fs::read_dir(folder.path()).expect("lists") {
            let part = entry.expect("an entry").path();
            let length = fs::metadata(&part).expect("is there").len();
            if length > 0 {
                let recording = Recording::open(&part, &ReadOptions::default()).expect("opens");
                let (signals, _) = recording
                    .signals(&|path| path.ends_with("position_m.y"))
                    .expect("reads");
                for signal in &signals {
                    assert!(
                        signal
                            .values
                            .iter()
                            .enumerate()
                            .all(|(i, y)| *y == -(i as f64))
                    );
                    salvaged[way] += signal.values.len();
                }
            }
            fs::remove_file(part).expect("removes");
        }
    }
    assert!(
        salvaged.iter().all(|some| *some > 0),
        "some message was salvaged either way in {rounds} rounds: {salvaged:?}"
    );
}

//! Makes the seeds in `corpus`, those of the decoders from the recordings under `../tests/data`: run it in this folder.

use std::{borrow::Cow, fs, io::Cursor, path::Path, sync::Arc};

use mcap::{Channel, Compression, Message, Schema, WriteOptions};
use recording::read::{ReadOptions, Recording};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let data = Path::new("../tests/data");
    let recording = Recording::open(&data.join("none.mcap"), &ReadOptions::default())?;
    let channels = &recording.info().channels;
    let mut seeds: Vec<Vec<u8>> = channels
        .iter()
        .map(|channel| {
            let mut seed = vec![u8::try_from(channel.schema.len()).unwrap_or(255)];
            seed.extend(channel.schema.bytes().take(255));
            seed.extend((channel.schema_data.len() as u16).to_le_bytes());
            seed.extend(&channel.schema_data[..]);
            seed
        })
        .collect();
    let mut taken = vec![0; channels.len()];
    recording.messages(&|_| true, &mut |message| {
        taken[message.channel] += 1;
        if taken[message.channel] <= 4 {
            let seed = &mut seeds[message.channel];
            seed.extend((message.data.len() as u16).to_le_bytes());
            seed.extend(message.data);
        }
    })?;
    for (channel, seed) in channels.iter().zip(seeds) {
        let target = match (channel.encoding.as_str(), channel.schema_encoding.as_str()) {
            ("cdr", "ros2msg") => "ros2msg",
            ("cdr", _) => "ros2idl",
            (encoding, _) => encoding,
        };
        let folder = Path::new("corpus").join(target);
        fs::create_dir_all(&folder)?;
        fs::write(
            folder.join(channel.topic.trim_start_matches('/').replace('/', "_")),
            seed,
        )?;
    }
    containers()
}

/// One small file of each make: large ones take a fuzzer too long.
fn containers() -> Result<(), Box<dyn std::error::Error>> {
    let folder = Path::new("corpus/container");
    fs::create_dir_all(folder)?;
    let bare = || WriteOptions::new().compression(None).library("");
    let makes = [
        ("zstd", bare().compression(Some(Compression::Zstd))),
        ("none", bare()),
        ("tiny_chunks", bare().chunk_size(Some(64))),
        ("unchunked", bare().use_chunks(false)),
        (
            "no_summary",
            bare()
                .emit_summary_records(false)
                .emit_summary_offsets(false),
        ),
    ];
    let schema = Arc::new(Schema {
        id: 1,
        name: "n".into(),
        encoding: "jsonschema".into(),
        data: Cow::Borrowed(b"{}"),
    });
    for (name, options) in makes {
        let mut file = Cursor::new(Vec::new());
        let mut writer = options.create(&mut file)?;
        for (k, topic) in (0u32..8).zip(["/a", "/b"].into_iter().cycle()) {
            writer.write(&Message {
                channel: Arc::new(Channel {
                    id: 1 + (k % 2) as u16,
                    topic: topic.to_owned(),
                    schema: (topic == "/a").then(|| schema.clone()),
                    message_encoding: "json".into(),
                    metadata: Default::default(),
                }),
                sequence: k,
                log_time: u64::from(k) * 1_000_000_000,
                publish_time: u64::from(k) * 1_000_000_000,
                data: format!("{{\"x\":{k}}}").into_bytes().into(),
            })?;
        }
        writer.finish()?;
        drop(writer);
        fs::write(folder.join(name), file.into_inner())?;
    }
    Ok(())
}

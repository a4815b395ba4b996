//! Makes the seeds in `corpus` from the recordings under `../tests/data`: run it in this folder.

use std::{fs, path::Path};

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
            seed.extend(&channel.schema_data);
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
    Ok(())
}

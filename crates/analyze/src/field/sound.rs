//! Sound in a recording: `foxglove.RawAudio` messages, 16-bit PCM, joined to one channel.

use prost::Message;
use recording::read::{ReadError, Recording};

use crate::beat::{BeatError, Beats, beats};

/// The message, as far as it is needed (Foxglove's schema `RawAudio`).
#[derive(Clone, PartialEq, Message)]
struct RawAudio {
    #[prost(bytes = "vec", tag = "2")]
    data: Vec<u8>,
    #[prost(string, tag = "3")]
    format: String,
    #[prost(fixed32, tag = "4")]
    sample_rate: u32,
    #[prost(fixed32, tag = "5")]
    number_of_channels: u32,
}

/// Longest sound that is analysed, samples: an hour at 48 kHz.
const MOST_SAMPLES: usize = 3600 * 48_000;

/// The first topic with sound, and its beats on the recording's clock (s since its first message).
///
/// `None` where there is no sound. Channels are averaged. Messages are taken to follow each other without holes, beginning at the log time of
/// the first; those that are not `pcm-s16` or cannot be decoded are passed over.
///
/// # Errors
/// Where the file cannot be read.
pub fn sound_beats(
    recording: &Recording,
) -> Result<Option<(String, Result<Beats, BeatError>)>, ReadError> {
    let info = recording.info();
    let Some(channel) = info
        .channels
        .iter()
        .find(|c| c.schema == "foxglove.RawAudio" && c.encoding == "protobuf")
    else {
        return Ok(None);
    };
    let (mut sound, mut rate, mut first_ns) = (Vec::new(), 0u32, None);
    recording.messages(&|topic| topic == channel.topic, &mut |message| {
        let Ok(audio) = RawAudio::decode(message.data) else {
            return;
        };
        let channels = audio.number_of_channels.max(1) as usize;
        if audio.format != "pcm-s16"
            || sound.len() > MOST_SAMPLES
            || (rate != 0 && rate != audio.sample_rate)
        {
            return;
        }
        rate = audio.sample_rate;
        first_ns.get_or_insert(message.log_time_ns);
        sound.extend(audio.data.chunks_exact(2 * channels).map(|frame| {
            let sum: f64 = frame
                .chunks_exact(2)
                .map(|b| f64::from(i16::from_le_bytes([b[0], b[1]])))
                .sum();
            sum / channels as f64
        }));
    })?;
    let Some(first_ns) = first_ns else {
        return Ok(None);
    };
    let start_s = (i128::from(first_ns) - i128::from(info.start_ns)) as f64 / 1e9;
    let found = beats(&sound, f64::from(rate)).map(|mut b| {
        b.beat_s.iter_mut().for_each(|t| *t += start_s);
        b
    });
    Ok(Some((channel.topic.clone(), found)))
}

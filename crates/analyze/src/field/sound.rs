//! Sound in a recording: `foxglove.RawAudio` messages, 16-bit PCM, joined to one channel.

use prost::Message;
use recording::read::{ReadError, Recording};
use recording::schema::foxglove::RawAudio;
use recording::text::counted;

use crate::beat::{BeatError, Beats, beats_among, onsets};

/// Sound is thinned to no less than this, Hz: enough for what a drum begins.
const RATE_HZ: u32 = 16_000;
/// Longest sound that is listened to, s.
const LONGEST_S: f64 = 3600.0;
/// A message that comes so much later than the sound before it ends stands behind a hole, s.
const HOLE_S: f64 = 0.1;

/// What is heard in a recording; times on the sound's own clock, s since the recording's first message.
pub struct Heard {
    /// Topic of the sound.
    pub topic: String,
    /// Everything that begins.
    pub onset_s: Vec<f64>,
    /// The beats among it.
    pub beats: Result<Beats, BeatError>,
    /// What is odd about it, a sentence each.
    pub remarks: Vec<String>,
}

/// One channel of sound, thinned.
#[derive(Default)]
struct Joined {
    first_ns: Option<i64>,
    /// Sampling rate as recorded, Hz, and how many samples make one here.
    rate: u32,
    factor: usize,
    sound: Vec<f32>,
    /// Samples that wait for the rest of their group: their sum and number.
    waiting: (f32, usize),
    holes_s: f64,
    refused: usize,
    cut: bool,
}

impl Joined {
    fn take(&mut self, t_ns: i64, audio: &RawAudio) {
        let channels = audio.number_of_channels.max(1) as usize;
        let other = self.rate != 0 && self.rate != audio.sample_rate;
        if audio.format != "pcm-s16" || audio.sample_rate == 0 || other {
            self.refused += 1;
            return;
        }
        self.rate = audio.sample_rate;
        self.factor = (audio.sample_rate / RATE_HZ).max(1) as usize;
        let first_ns = *self.first_ns.get_or_insert(t_ns);
        let late_s = (t_ns.saturating_sub(first_ns)) as f64 / 1e9 - self.length_s();
        if late_s > HOLE_S {
            self.holes_s += late_s;
            let silence = (late_s.min(LONGEST_S) * self.rate_hz()) as usize;
            self.sound.resize(self.sound.len() + silence, 0.0);
        }
        if self.length_s() >= LONGEST_S {
            self.cut = true;
            return;
        }
        for frame in audio.data.chunks_exact(2 * channels) {
            let sum: i32 = frame
                .chunks_exact(2)
                .map(|b| i32::from(i16::from_le_bytes([b[0], b[1]])))
                .sum();
            self.waiting.0 += sum as f32 / channels as f32;
            self.waiting.1 += 1;
            if self.waiting.1 == self.factor {
                self.sound.push(self.waiting.0 / self.factor as f32);
                self.waiting = (0.0, 0);
            }
        }
    }

    fn rate_hz(&self) -> f64 {
        f64::from(self.rate) / self.factor as f64
    }

    fn length_s(&self) -> f64 {
        self.sound.len() as f64 / self.rate_hz()
    }
}

/// Listens to the first topic with sound. `None` where there is no sound.
///
/// Channels are averaged, sound of more than 32 kHz is thinned, holes between messages are silence. Messages that are not `pcm-s16` of one rate or
/// cannot be decoded are counted and passed over.
///
/// # Errors
/// Where the file cannot be read.
pub fn listen(recording: &Recording) -> Result<Option<Heard>, ReadError> {
    let info = recording.info();
    let Some(channel) = info
        .channels
        .iter()
        .find(|c| c.schema == "foxglove.RawAudio" && c.encoding == "protobuf")
    else {
        return Ok(None);
    };
    let mut joined = Joined::default();
    recording.messages(
        &|topic| topic == channel.topic,
        &mut |message| match RawAudio::decode(message.data) {
            Ok(audio) => joined.take(message.log_time_ns, &audio),
            Err(_) => joined.refused += 1,
        },
    )?;
    let mut remarks = Vec::new();
    if joined.refused > 0 {
        remarks.push(format!(
            "{} no 16-bit PCM of one rate and passed over",
            counted(joined.refused as u64, "message is", "messages are")
        ));
    }
    if joined.holes_s > 0.0 {
        remarks.push(format!(
            "{:.1} s of sound are missing between messages and are taken for silence",
            joined.holes_s
        ));
    }
    if joined.cut {
        remarks.push(format!("only the first {LONGEST_S} s are listened to"));
    }
    let (mut onset_s, mut beats) = (Vec::new(), Err(BeatError::TooShort { found_s: 0.0 }));
    if let Some(first_ns) = joined.first_ns {
        let start_s = (i128::from(first_ns) - i128::from(info.start_ns)) as f64 / 1e9;
        let begins = onsets(&joined.sound, joined.rate_hz());
        if let Ok(begins) = &begins {
            onset_s = begins.times_s();
            onset_s.iter_mut().for_each(|t| *t += start_s);
        }
        beats = begins.and_then(|begins| beats_among(&begins)).map(|mut b| {
            b.beat_s.iter_mut().for_each(|t| *t += start_s);
            b
        });
    }
    Ok(Some(Heard {
        topic: channel.topic.clone(),
        onset_s,
        beats,
        remarks,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heard(rate: u32, channels: u32, samples: &[i16]) -> RawAudio {
        RawAudio {
            data: samples.iter().flat_map(|s| s.to_le_bytes()).collect(),
            format: "pcm-s16".into(),
            sample_rate: rate,
            number_of_channels: channels,
            ..RawAudio::default()
        }
    }

    #[test]
    fn channels_are_averaged_and_fast_sound_is_thinned_across_messages() {
        let mut stereo = Joined::default();
        stereo.take(0, &heard(16_000, 2, &[100, 300, -50, 50]));
        assert_eq!(stereo.sound, [200.0, 0.0]);
        let mut fast = Joined::default();
        fast.take(0, &heard(48_000, 1, &[1, 2, 3, 10]));
        fast.take(83_333, &heard(48_000, 1, &[20, 30, 7]));
        assert_eq!(fast.sound, [2.0, 20.0]);
        assert!((fast.length_s() - 2.0 / 16_000.0).abs() < 1e-12);
        // Less than twice the least rate is kept as it is; no channel said is one.
        let mut slow = Joined::default();
        slow.take(0, &heard(31_000, 0, &[5, 6]));
        assert_eq!((slow.sound.len(), slow.rate_hz()), (2, 31_000.0));
    }

    #[test]
    fn what_is_missing_is_silence_and_what_is_no_sound_is_counted() {
        let second = vec![1000; 8000];
        let mut joined = Joined::default();
        // The second message comes 90 ms late, which is no hole, the third behind half a second of nothing.
        for t_s in [3.0, 4.09, 5.5] {
            joined.take((t_s * 1e9) as i64, &heard(8000, 1, &second));
        }
        assert!((joined.holes_s - 0.5).abs() < 1e-9, "{}", joined.holes_s);
        assert!((joined.length_s() - 3.5).abs() < 1e-9);
        assert!(joined.sound[16_000..20_000].iter().all(|s| *s == 0.0));
        assert!(joined.sound[20_000..].iter().all(|s| *s == 1000.0));
        let mut other = heard(8000, 1, &second);
        other.format = "opus".into();
        joined.take(7_000_000_000, &other);
        joined.take(7_000_000_000, &heard(0, 1, &second));
        joined.take(7_000_000_000, &heard(44_100, 1, &second));
        assert_eq!((joined.refused, joined.sound.len()), (3, 28_000));
        // A wrong stamp asks for an hour at most, and behind that nobody listens.
        let mut joined = Joined::default();
        joined.take(0, &heard(20, 1, &[1; 20]));
        assert!(!joined.cut);
        joined.take(i64::MAX, &heard(20, 1, &[1; 20]));
        assert!(joined.cut && joined.sound.len() == 20 + 3600 * 20);
    }
}

//! Sound from WAV files, as any recorder writes them: PCM of 8 to 32 bits or 32-bit float, any rate, any number of channels.
//!
//! Sound becomes `foxglove.RawAudio` (16-bit PCM) in blocks of a tenth of a second. A WAV file does not know when it began.

use std::{
    fs::File,
    io::{BufReader, Read as _},
    path::Path,
};

use hound::{SampleFormat, WavIntoSamples, WavReader, WavSpec};

use super::{ImportError, imu::device_name};
use crate::schema::foxglove::RawAudio;

/// Blocks in a second of sound.
const BLOCKS_PER_S: u32 = 10;
/// Sounds that are no WAV, by the ends of their names: converted, they can be read.
const OTHER_SOUNDS: [&str; 10] = [
    "m4a", "mp4", "aac", "mp3", "ogg", "opus", "flac", "caf", "amr", "3gp",
];

/// A sound on its way into a recording.
pub(super) struct Sound {
    /// Name of the recorder: topic `/audio/NAME`.
    pub name: String,
    /// When it begins, ns since 1970.
    pub start_ns: i64,
    /// What was decided on the way.
    pub notes: Vec<String>,
    spec: WavSpec,
    /// Frames that the head promises, and as many of them as the file can hold.
    promised: u32,
    frames: u32,
    /// Frames asked for and frames found so far.
    asked: u32,
    found: u32,
    samples: Samples,
}

enum Samples {
    Whole(WavIntoSamples<BufReader<File>, i32>),
    Float(WavIntoSamples<BufReader<File>, f32>),
}

/// Whether a file begins as WAV files do, or is named like one.
pub(super) fn is_wav(path: &Path) -> Result<bool, ImportError> {
    if path.is_dir() {
        return Ok(false);
    }
    if path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("wav"))
    {
        return Ok(true);
    }
    let mut head = Vec::new();
    File::open(path)
        .and_then(|file| file.take(4).read_to_end(&mut head))
        .map_err(|cause| ImportError::Io {
            name: path.display().to_string(),
            cause,
        })?;
    Ok(head == b"RIFF")
}

/// Says how to make a WAV of a sound that is none.
pub(super) fn refuse(path: &Path) -> Result<(), ImportError> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    if !OTHER_SOUNDS
        .iter()
        .any(|other| extension.eq_ignore_ascii_case(other))
    {
        return Ok(());
    }
    Err(ImportError::Content {
        name: path.display().to_string(),
        problem: format!(
            "is {extension}; sound is read from WAV: make one with `ffmpeg -i {} -ac 1 {}`",
            path.display(),
            path.with_extension("wav").display()
        ),
    })
}

impl Sound {
    /// Opens a WAV file; nothing but its head is read.
    pub fn open(path: &Path) -> Result<Self, ImportError> {
        let name = path.display().to_string();
        let content = |problem: String| ImportError::Content {
            name: name.clone(),
            problem,
        };
        let file = File::open(path).map_err(|cause| ImportError::Io {
            name: name.clone(),
            cause,
        })?;
        let reader = WavReader::new(BufReader::new(file))
            .map_err(|error| content(format!("is no WAV file: {error}")))?;
        let (spec, promised) = (reader.spec(), reader.duration());
        if spec.channels == 0 || spec.sample_rate == 0 {
            return Err(content(format!(
                "has {} channels at {} Hz; expected one or more at 4000 Hz or more",
                spec.channels, spec.sample_rate
            )));
        }
        // A recorder that lost its power leaves any number for the length.
        let frame_bytes = u64::from(spec.channels) * u64::from(spec.bits_per_sample.div_ceil(8));
        let bytes = path.metadata().map_or(0, |file| file.len());
        let frames = promised.min(u32::try_from(bytes / frame_bytes.max(1)).unwrap_or(u32::MAX));
        let mut notes = Vec::new();
        let samples = match spec.sample_format {
            SampleFormat::Int => {
                if spec.bits_per_sample != 16 {
                    notes.push(format!("{}-bit sound became 16-bit", spec.bits_per_sample));
                }
                Samples::Whole(reader.into_samples())
            }
            SampleFormat::Float => {
                notes.push("sound in floating point became 16-bit, full scale at ±1".to_owned());
                Samples::Float(reader.into_samples())
            }
        };
        Ok(Self {
            name: device_name(&name),
            start_ns: 0,
            notes,
            spec,
            promised,
            frames,
            asked: 0,
            found: 0,
            samples,
        })
    }

    /// When each block begins, ns since 1970.
    pub fn block_times(&self) -> impl Iterator<Item = i64> + use<> {
        let (start_ns, rate) = (self.start_ns, u64::from(self.spec.sample_rate));
        let at = move |frame: u32| {
            start_ns.saturating_add((u64::from(frame) * 1_000_000_000 / rate) as i64)
        };
        (0..self.frames).step_by(self.length() as usize).map(at)
    }

    /// Frames in a block.
    fn length(&self) -> u32 {
        (self.spec.sample_rate / BLOCKS_PER_S).max(1)
    }

    /// What the file lacks, once every block was asked for.
    pub fn loss(&self) -> Option<String> {
        let seconds = |frames: u32| f64::from(frames) / f64::from(self.spec.sample_rate);
        (self.found < self.promised).then(|| {
            format!(
                "its head promises {:.1} s of sound, {:.1} s are there",
                seconds(self.promised),
                seconds(self.found)
            )
        })
    }

    /// The next block, stamped `t_ns`; none behind the last frame that the file really has.
    pub fn block(&mut self, t_ns: i64) -> Option<RawAudio> {
        let frames = self.length().min(self.frames - self.asked);
        self.asked += frames;
        let mut data = Vec::with_capacity(2 * frames as usize * usize::from(self.spec.channels));
        let shift = i32::from(self.spec.bits_per_sample) - 16;
        for _ in 0..frames * u32::from(self.spec.channels) {
            let sample = match &mut self.samples {
                Samples::Whole(samples) => match samples.next() {
                    Some(Ok(x)) if shift >= 0 => (x >> shift) as i16,
                    // OK because fewer than 16 bits shifted up are 16.
                    Some(Ok(x)) => (x << -shift) as i16,
                    _ => break,
                },
                Samples::Float(samples) => match samples.next() {
                    Some(Ok(x)) if x.is_finite() => {
                        (x * 32767.0).round().clamp(-32768.0, 32767.0) as i16
                    }
                    Some(Ok(_)) => 0,
                    _ => break,
                },
            };
            data.extend(sample.to_le_bytes());
        }
        // A frame that lacks a channel is none.
        let frame_bytes = 2 * usize::from(self.spec.channels);
        data.truncate(data.len() - data.len() % frame_bytes);
        // OK because a block is a tenth of a second.
        self.found += (data.len() / frame_bytes) as u32;
        (!data.is_empty()).then(|| {
            RawAudio::pcm_s16(t_ns, data, self.spec.sample_rate, self.spec.channels.into())
        })
    }
}

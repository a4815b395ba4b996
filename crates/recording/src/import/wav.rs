//! Sound from WAV files, as any recorder writes them: PCM of 8 to 32 bits or 32-bit float, any rate, any number of channels.
//!
//! Sound becomes `foxglove.RawAudio` (16-bit PCM) in blocks of a tenth of a second. A WAV file does not know when it began.
//!
//! A recorder writes how long the sound is when it ends. One that is stopped before, or that writes into a pipe, leaves 0 or the largest number
//! there: then the sound is all that follows.

use std::{
    fs::File,
    io::{self, BufReader, Chain, Cursor, Read as _, Seek as _, SeekFrom},
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

/// Lengths from here on stand for one that is not known, where the file has not as much: writers into pipes take 0x7ffff000, 0xffffffff and numbers between.
const UNKNOWN_LENGTH: u32 = 0x7fff_f000;

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
    /// Bytes behind the sound that belong to no chunk.
    behind: u64,
    samples: Samples,
}

/// A head that tells the length that was found, and the sound behind it.
type Source = Chain<Cursor<Vec<u8>>, BufReader<File>>;

enum Samples {
    Whole(WavIntoSamples<Source, i32>),
    Float(WavIntoSamples<Source, f32>),
}

/// The name and length of the chunk that begins at a place; `None` where none does.
fn chunk_at(file: &mut BufReader<File>, at: u64) -> io::Result<Option<([u8; 4], u32)>> {
    let mut head = Vec::new();
    file.seek(SeekFrom::Start(at))?;
    file.by_ref().take(8).read_to_end(&mut head)?;
    let [a, b, c, d, length @ ..] = &head[..] else {
        return Ok(None);
    };
    let name = [*a, *b, *c, *d];
    let named = name.iter().all(|c| c.is_ascii_alphanumeric() || *c == b' ');
    let length = length.try_into().ok().filter(|_| named);
    Ok(length.map(|length| (name, u32::from_le_bytes(length))))
}

/// Where the next chunk begins: one of an odd length is padded, but not by every writer.
fn next_chunk(file: &mut BufReader<File>, at: u64, length: u32) -> io::Result<u64> {
    let end = at + 8 + u64::from(length);
    let padded = length % 2 == 1 && chunk_at(file, end)?.is_none();
    Ok(end + u64::from(padded))
}

/// Where chunks that follow each other from a place come to their end.
fn end_of_chunks(file: &mut BufReader<File>, mut at: u64, file_bytes: u64) -> io::Result<u64> {
    while let Some((_, length)) = chunk_at(file, at)? {
        if at + 8 + u64::from(length) > file_bytes {
            break;
        }
        at = next_chunk(file, at, length)?;
    }
    Ok(at.min(file_bytes))
}

/// Finds the chunks `fmt ` and `data`: what the first holds, where the second begins and its length.
fn chunks(file: &mut BufReader<File>) -> io::Result<Result<(Vec<u8>, u64, u32), String>> {
    let mut riff = Vec::new();
    file.by_ref().take(12).read_to_end(&mut riff)?;
    if !(riff.starts_with(b"RIFF") && riff.ends_with(b"WAVE")) {
        let found = String::from_utf8_lossy(&riff);
        return Ok(Err(format!(
            "is no WAV file: it begins with {found:?}, expected RIFF, a length and WAVE"
        )));
    }
    let (mut at, mut fmt) = (12, Vec::new());
    while let Some((name, length)) = chunk_at(file, at)? {
        match &name {
            // What is behind 40 bytes says no more of the format.
            b"fmt " => {
                let most = length.min(40).into();
                fmt.clear();
                file.by_ref().take(most).read_to_end(&mut fmt)?;
            }
            b"data" => return Ok(Ok((fmt, at, length))),
            _ => {}
        }
        at = next_chunk(file, at, length)?;
    }
    Ok(Err("is no WAV file: it has no chunk `data`".to_owned()))
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

/// Whether a file is named as sound is.
pub(super) fn is_named(name: &str) -> bool {
    let Some((_, end)) = name.rsplit_once('.') else {
        return false;
    };
    OTHER_SOUNDS
        .iter()
        .chain(&["wav"])
        .any(|sound| end.eq_ignore_ascii_case(sound))
}

/// Says how to make a WAV of a sound that is none.
pub(super) fn refuse(path: &Path) -> Result<(), ImportError> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    if !OTHER_SOUNDS
        .iter()
        .any(|o| extension.eq_ignore_ascii_case(o))
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
    /// Opens a WAV file; the sound is not read yet.
    pub fn open(path: &Path) -> Result<Self, ImportError> {
        let name = path.display().to_string();
        let io = |cause| ImportError::Io {
            name: name.clone(),
            cause,
        };
        let content = |problem: String| ImportError::Content {
            name: name.clone(),
            problem,
        };
        let mut file = BufReader::new(File::open(path).map_err(io)?);
        let (fmt, at, told) = chunks(&mut file).map_err(io)?.map_err(content)?;
        let Some([low, high, _, _]) = fmt.get(12..16) else {
            return Err(content(format!(
                "is no WAV file: its chunk `fmt ` has {} bytes; expected 16 or more",
                fmt.len()
            )));
        };
        // Bytes of a frame, a sample of each channel.
        let frame_bytes = u64::from(u16::from_le_bytes([*low, *high])).max(1);
        let begin = at + 8;
        let file_bytes = file.seek(SeekFrom::End(0)).map_err(io)?;
        let there = file_bytes.saturating_sub(begin);
        let is_unknown = match told {
            // Chunks behind say that it is really empty.
            0 => end_of_chunks(&mut file, begin, file_bytes).map_err(io)? == begin,
            _ => told >= UNKNOWN_LENGTH && u64::from(told) > there,
        };
        let promised = if is_unknown { there } else { told.into() };
        let frames = |bytes: u64| u32::try_from(bytes / frame_bytes).unwrap_or(u32::MAX);
        let held = frames(promised.min(there));
        if held == 0 {
            return Err(content(
                "has a head but no sound; expected at least one sample".to_owned(),
            ));
        }
        let behind = match promised < there {
            true => bytes_behind(&mut file, at, told, file_bytes).map_err(io)?,
            false => 0,
        };
        file.seek(SeekFrom::Start(begin)).map_err(io)?;
        // OK because what is longer than 4 GB is read as far as a head can say.
        let length = (u64::from(held) * frame_bytes)
            .min(u64::from(u32::MAX) / frame_bytes * frame_bytes) as u32;
        let reader = WavReader::new(Cursor::new(head(&fmt, length)).chain(file)).map_err(|error| {
            let number = |at: usize| u16::from_le_bytes([fmt[at], fmt[at + 1]]);
            let wide = |at: usize| u32::from(number(at + 2)) << 16 | u32::from(number(at));
            let (format, bits) = (number(0), number(14));
            let is_read = matches!((format, bits), (1 | 0xfffe, 8 | 16 | 24 | 32) | (3, 32));
            let why = match error {
                hound::Error::FormatError(_) if is_read => format!(
                    "found {} channels, frames of {} bytes, {} Hz, {} bytes a second, which do not agree",
                    number(2),
                    number(12),
                    wide(4),
                    wide(8)
                ),
                _ => "expected PCM (0x0001) of 8 to 32 bits or floating point (0x0003) of 32"
                    .to_owned(),
            };
            content(format!(
                "holds {bits}-bit sound of format {format:#06x}: {error}; {why}"
            ))
        })?;
        let spec = reader.spec();
        if spec.channels == 0 || spec.sample_rate == 0 {
            return Err(content(format!(
                "has {} channels at {} Hz; expected one or more at 4000 Hz or more",
                spec.channels, spec.sample_rate
            )));
        }
        let mut notes = Vec::new();
        if is_unknown {
            notes.push(format!(
                "its head does not tell how long the sound is: the {:.1} s behind it are taken",
                f64::from(held) / f64::from(spec.sample_rate)
            ));
        }
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
            promised: frames(promised),
            frames: held,
            asked: 0,
            found: 0,
            behind,
            samples,
        })
    }

    pub fn topic(&self) -> String {
        format!("/audio/{}", self.name)
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

    /// What the file lacks, or has and does not account for, once every block was asked for.
    pub fn loss(&self) -> Option<String> {
        let seconds = |frames: u32| f64::from(frames) / f64::from(self.spec.sample_rate);
        if self.found < self.promised {
            return Some(format!(
                "its head promises {:.1} s of sound, {:.1} s are there",
                seconds(self.promised),
                seconds(self.found)
            ));
        }
        (self.behind > 0).then(|| {
            format!(
                "its head promises {:.1} s of sound; {} bytes behind it belong to no chunk and are left out",
                seconds(self.promised),
                self.behind
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

/// A head for `length` bytes of sound as `fmt` says it is written. What extends the first 16 bytes by less than an extensible format says nothing more;
/// and of an extensible one it says how many of a sample's bits are meant, which are its highest (Microsoft, WAVEFORMATEXTENSIBLE): as a whole it is
/// the same sound.
fn head(fmt: &[u8], length: u32) -> Vec<u8> {
    let mut fmt = fmt.to_vec();
    if fmt.len() < 40 {
        fmt.truncate(16);
    } else {
        fmt.copy_within(14..16, 18);
    }
    // No reader looks at the first size.
    let sizes = [0, fmt.len() as u32, length].map(u32::to_le_bytes);
    let [riff, of_fmt, of_data] = &sizes;
    [
        b"RIFF",
        &riff[..],
        b"WAVE",
        b"fmt ",
        of_fmt,
        &fmt,
        b"data",
        of_data,
    ]
    .concat()
}

/// Bytes behind the sound and its chunks that are neither a chunk nor padding.
fn bytes_behind(
    file: &mut BufReader<File>,
    at: u64,
    length: u32,
    file_bytes: u64,
) -> io::Result<u64> {
    let next = next_chunk(file, at, length)?.min(file_bytes);
    let end = end_of_chunks(file, next, file_bytes)?;
    file.seek(SeekFrom::Start(end))?;
    for byte in file.bytes() {
        if byte? != 0 {
            return Ok(file_bytes - end);
        }
    }
    Ok(0)
}

//! Sound from WAV files, as any recorder writes them: PCM of 8 to 32 bits or floating point of 32 or 64, any rate, any number of channels.
//!
//! Sound becomes `foxglove.RawAudio` (16-bit PCM) in blocks of a tenth of a second. A WAV file does not know when it began.
//!
//! A recorder writes how long the sound is when it ends. One that is stopped before, or that writes into a pipe, leaves 0 or the largest number
//! there: then the sound is all that follows.

use std::{
    fs::File,
    io::{self, BufReader, Read as _, Seek as _, SeekFrom},
    path::Path,
};

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
    spec: Spec,
    /// Frames that the head promises, and as many of them as the file can hold.
    promised: u32,
    frames: u32,
    /// Frames asked for and frames found so far.
    asked: u32,
    found: u32,
    /// Bytes behind the sound that belong to no chunk.
    behind: u64,
    /// Stands at the next block.
    file: BufReader<File>,
}

/// How sound is written down.
#[derive(Clone, Copy, Debug)]
struct Spec {
    float: bool,
    channels: u16,
    rate: u32,
    bits: u16,
    /// Bytes of a sample: more than its bits need where it is padded.
    bytes: u16,
}

impl Spec {
    /// Reads the chunk `fmt `; says what is wrong with it.
    fn read(chunk: &[u8]) -> Result<Self, String> {
        let field = |at: usize| Some(u16::from_le_bytes(*chunk.get(at..)?.first_chunk()?));
        let (Some(mut format), Some(channels), Some(align), Some(bits)) =
            (field(0), field(2), field(12), field(14))
        else {
            return Err(format!(
                "is no WAV file: its chunk `fmt ` has {} bytes; expected 16 or more",
                chunk.len()
            ));
        };
        // WAVE_FORMAT_EXTENSIBLE tells the format later, in the first bytes of a GUID.
        if let (0xfffe, Some(told)) = (format, field(24)) {
            format = told;
        }
        let rate = u32::from_le_bytes([chunk[4], chunk[5], chunk[6], chunk[7]]);
        if channels == 0 || rate == 0 {
            return Err(format!(
                "has {channels} channels at {rate} Hz; expected one or more at 4000 Hz or more"
            ));
        }
        let bytes = (align / channels).max(bits.div_ceil(8));
        let float = match (format, bytes) {
            (1, 1..=4) => false,
            (3, 4 | 8) => true,
            _ => {
                return Err(format!(
                    "holds {bits}-bit sound of format {format:#06x}; expected PCM (0x0001) of 8 to 32 bits or floating point (0x0003) of 32 or 64"
                ));
            }
        };
        Ok(Spec {
            float,
            channels,
            rate,
            bits,
            bytes,
        })
    }

    /// Bytes of a frame, a sample of each channel.
    fn frame_bytes(self) -> u64 {
        u64::from(self.channels) * u64::from(self.bytes)
    }

    /// A sample in 16 bits.
    fn sample(self, bytes: &[u8]) -> i16 {
        let scaled = |x: f64| match x.is_finite() {
            true => (x * 32767.0).round().clamp(-32768.0, 32767.0) as i16,
            false => 0,
        };
        match *bytes {
            [a, b, c, d] if self.float => scaled(f32::from_le_bytes([a, b, c, d]).into()),
            [a, b, c, d, e, f, g, h] => scaled(f64::from_le_bytes([a, b, c, d, e, f, g, h])),
            // Eight bits have no sign: silence is 128.
            [x] => (i16::from(x) - 128) << 8,
            // What is padded is padded below.
            [.., low, high] => i16::from_le_bytes([low, high]),
            [] => 0,
        }
    }
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
        let spec = Spec::read(&fmt).map_err(content)?;
        let begin = at + 8;
        let file_bytes = file.seek(SeekFrom::End(0)).map_err(io)?;
        let there = file_bytes.saturating_sub(begin);
        let is_unknown = match told {
            // Chunks behind say that it is really empty.
            0 => end_of_chunks(&mut file, begin, file_bytes).map_err(io)? == begin,
            _ => told >= UNKNOWN_LENGTH && u64::from(told) > there,
        };
        let promised = if is_unknown { there } else { told.into() };
        let frames = |bytes: u64| u32::try_from(bytes / spec.frame_bytes()).unwrap_or(u32::MAX);
        let held = frames(promised.min(there));
        if held == 0 {
            return Err(content(
                "has a head but no sound; expected at least one sample".to_owned(),
            ));
        }
        let mut notes = Vec::new();
        if is_unknown {
            notes.push(format!(
                "its head does not tell how long the sound is: the {:.1} s behind it are taken",
                f64::from(held) / f64::from(spec.rate)
            ));
        }
        if spec.float {
            notes.push("sound in floating point became 16-bit, full scale at ±1".to_owned());
        } else if spec.bits != 16 {
            notes.push(format!("{}-bit sound became 16-bit", spec.bits));
        }
        let behind = match promised < there {
            true => bytes_behind(&mut file, at, told, file_bytes).map_err(io)?,
            false => 0,
        };
        file.seek(SeekFrom::Start(begin)).map_err(io)?;
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
            file,
        })
    }

    /// When each block begins, ns since 1970.
    pub fn block_times(&self) -> impl Iterator<Item = i64> + use<> {
        let (start_ns, rate) = (self.start_ns, u64::from(self.spec.rate));
        let at = move |frame: u32| {
            start_ns.saturating_add((u64::from(frame) * 1_000_000_000 / rate) as i64)
        };
        (0..self.frames).step_by(self.length() as usize).map(at)
    }

    /// Frames in a block.
    fn length(&self) -> u32 {
        (self.spec.rate / BLOCKS_PER_S).max(1)
    }

    /// What the file lacks, or has and does not account for, once every block was asked for.
    pub fn loss(&self) -> Option<String> {
        let seconds = |frames: u32| f64::from(frames) / f64::from(self.spec.rate);
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
        let frame_bytes = self.spec.frame_bytes();
        let mut bytes = Vec::new();
        // What cannot be read is missing, and told as that.
        let wanted = u64::from(frames) * frame_bytes;
        let _ = self.file.by_ref().take(wanted).read_to_end(&mut bytes);
        // A frame that lacks a channel is none.
        bytes.truncate(bytes.len() - bytes.len() % frame_bytes as usize);
        // OK because a block is a tenth of a second.
        self.found += (bytes.len() as u64 / frame_bytes) as u32;
        let samples = bytes.chunks_exact(self.spec.bytes.into());
        let data: Vec<u8> = samples
            .flat_map(|sample| self.spec.sample(sample).to_le_bytes())
            .collect();
        (!data.is_empty())
            .then(|| RawAudio::pcm_s16(t_ns, data, self.spec.rate, self.spec.channels.into()))
    }
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

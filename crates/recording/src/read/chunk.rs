//! Chunks: unpacked, checked, and only then read. Large chunks are unpacked twice, in small pieces: once for the checksum, once for
//! their messages, so that no chunk needs more memory than a piece.

use std::io::{self, Read};

use super::{
    ReadOptions,
    container::{Block, ChunkHeader, Fields, begun_chunk_header, chunk_header},
};
use crate::finding::Kind;

/// Chunks up to this size are unpacked in one go.
pub(super) const WHOLE_BYTES: u64 = 16 << 20;

/// Pieces in which larger chunks are read.
const PIECE_BYTES: usize = 2 << 20;

/// Why a chunk was left out.
pub(super) type Loss = (Kind, String);

/// Unpacks chunks; its memory is used again and again.
pub(super) struct Unpacker {
    zstd: Option<zstd::bulk::Decompressor<'static>>,
    buffer: Vec<u8>,
}

impl Unpacker {
    pub fn new() -> Self {
        Unpacker {
            zstd: None,
            buffer: Vec::new(),
        }
    }

    /// The records of a chunk of at most [`WHOLE_BYTES`], checked.
    pub fn whole<'a>(&'a mut self, header: &ChunkHeader<'a>) -> Result<&'a [u8], Loss> {
        // OK because the caller only passes chunks up to WHOLE_BYTES.
        let expected = header.uncompressed as usize;
        let records: &[u8] = match header.compression {
            b"" => header.records,
            b"zstd" => {
                let zstd = match &mut self.zstd {
                    Some(zstd) => zstd,
                    none => none.insert(
                        zstd::bulk::Decompressor::new().map_err(|error| bad("zstd", &error))?,
                    ),
                };
                self.buffer.resize(expected, 0);
                let length = zstd
                    .decompress_to_buffer(header.records, self.buffer.as_mut_slice())
                    .map_err(|error| bad("zstd", &error))?;
                &self.buffer[..length]
            }
            other => {
                self.buffer.clear();
                let mut stream = stream(other, header.records)?;
                // One byte more than promised shows a chunk that holds too much.
                stream
                    .by_ref()
                    .take(header.uncompressed + 1)
                    .read_to_end(&mut self.buffer)
                    .map_err(|error| bad(&String::from_utf8_lossy(other), &error))?;
                &self.buffer
            }
        };
        check(header, records.len() as u64, || crc32fast::hash(records))?;
        Ok(records)
    }
}

fn bad(compression: &str, error: &io::Error) -> Loss {
    (
        Kind::BadChunk,
        format!("cannot be unpacked ({compression}: {error})"),
    )
}

fn misfit() -> Loss {
    (Kind::BadChunk, "has a header that does not fit".to_owned())
}

fn check(header: &ChunkHeader<'_>, length: u64, crc: impl FnOnce() -> u32) -> Result<(), Loss> {
    if header.crc != 0 {
        let found = crc();
        if found != header.crc {
            return Err((
                Kind::BadCrc,
                format!(
                    "does not match its checksum ({:08x} expected, {found:08x} found)",
                    header.crc
                ),
            ));
        }
    }
    if length != header.uncompressed {
        return Err((
            Kind::BadChunk,
            format!(
                "holds {length} bytes where its header says {}",
                header.uncompressed
            ),
        ));
    }
    Ok(())
}

/// The content of a chunk as a stream.
fn stream<'a>(compression: &[u8], records: &'a [u8]) -> Result<Box<dyn Read + 'a>, Loss> {
    Ok(match compression {
        b"" => Box::new(records),
        b"zstd" => Box::new(
            zstd::stream::read::Decoder::with_buffer(records)
                .map_err(|error| bad("zstd", &error))?,
        ),
        b"lz4" => Box::new(Lz4 {
            decoder: lz4_flex::frame::FrameDecoder::new(records),
        }),
        other => {
            let name: String = String::from_utf8_lossy(other).chars().take(32).collect();
            return Err((
                Kind::BadChunk,
                format!("is compressed with {name:?}; zstd, lz4 and none can be read"),
            ));
        }
    })
}

/// LZ4 frames one after the other.
struct Lz4<'a> {
    decoder: lz4_flex::frame::FrameDecoder<&'a [u8]>,
}

impl Read for Lz4<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let count = self.decoder.read(buffer)?;
            if count > 0 || buffer.is_empty() || self.decoder.get_ref().is_empty() {
                return Ok(count);
            }
            // A frame has ended and another one follows.
            let rest: &[u8] = self.decoder.get_ref();
            self.decoder = lz4_flex::frame::FrameDecoder::new(rest);
        }
    }
}

/// Reads a chunk's header and holds it against the limits.
pub(super) fn open<'a>(body: &'a [u8], options: &ReadOptions) -> Result<ChunkHeader<'a>, Loss> {
    let header = chunk_header(body).ok_or_else(misfit)?;
    if header.uncompressed > options.max_chunk_bytes {
        return Err((
            Kind::TooLarge,
            format!(
                "claims {} bytes unpacked; {} is {}",
                header.uncompressed,
                options.limit("--max-chunk-bytes"),
                options.max_chunk_bytes
            ),
        ));
    }
    if header.compression.is_empty() && header.uncompressed != header.records.len() as u64 {
        return Err((
            Kind::BadChunk,
            format!(
                "holds {} bytes where its header says {}",
                header.records.len(),
                header.uncompressed
            ),
        ));
    }
    Ok(header)
}

/// Gives the records of a block that are sound; what is lost is said by who reads it for its messages.
pub(super) fn records(
    data: &[u8],
    block: &Block,
    options: &ReadOptions,
    unpacker: &mut Unpacker,
    each: &mut dyn FnMut(&[u8]),
) {
    match block {
        Block::Loose(range) => each(&data[range.clone()]),
        Block::Chunk { body, .. } => match open(&data[body.clone()], options) {
            Ok(header) if header.uncompressed <= WHOLE_BYTES => {
                if let Ok(records) = unpacker.whole(&header) {
                    each(records);
                }
            }
            Ok(header) => {
                let _ = pieces(&header, options, each);
            }
            Err(_) => {}
        },
        Block::CutChunk(body) => {
            let _ = beginning(&data[body.clone()], options, each);
        }
    }
}

/// Gives the records of a chunk in pieces that hold whole records; a record longer than `max_message_bytes` is stepped over.
///
/// Returns how many records were too long.
pub(super) fn pieces(
    header: &ChunkHeader<'_>,
    options: &ReadOptions,
    each: &mut dyn FnMut(&[u8]),
) -> Result<u64, Loss> {
    verify(header)?;
    let packed = stream(header.compression, header.records)?;
    let (unpacked, end) = unpack(packed, options, each);
    end.map_err(|error| bad(&String::from_utf8_lossy(header.compression), &error))?;
    if !unpacked.rest.is_empty() {
        // The caller's walk says what is wrong with the rest.
        each(&unpacked.rest);
    }
    Ok(unpacked.too_long)
}

/// As [`pieces`], of a chunk that the end of the file cuts off: as far as it can be unpacked, which no checksum vouches for.
pub(super) fn beginning(
    body: &[u8],
    options: &ReadOptions,
    each: &mut dyn FnMut(&[u8]),
) -> Result<u64, Loss> {
    let (header, _) = begun_chunk_header(body).ok_or_else(misfit)?;
    let packed = stream(header.compression, header.records)?;
    // It ends where it can be unpacked no further.
    let (unpacked, _) = unpack(packed.take(options.max_chunk_bytes), options, each);
    Ok(unpacked.too_long)
}

/// Unpacks a chunk for nothing but its checksum, so that no number of a damaged one gets out.
fn verify(header: &ChunkHeader<'_>) -> Result<(), Loss> {
    let name = String::from_utf8_lossy(header.compression);
    let mut packed = stream(header.compression, header.records)?;
    let mut crc = crc32fast::Hasher::new();
    let mut buffer = vec![0; PIECE_BYTES];
    let mut length = 0u64;
    loop {
        let count = packed
            .read(&mut buffer)
            .map_err(|error| bad(&name, &error))?;
        if count == 0 {
            break;
        }
        length += count as u64;
        if length > header.uncompressed {
            return Err((
                Kind::BadChunk,
                format!(
                    "holds more than the {} bytes that its header says",
                    header.uncompressed
                ),
            ));
        }
        if header.crc != 0 {
            crc.update(&buffer[..count]);
        }
    }
    check(header, length, || crc.finalize())
}

/// What is to be said of a chunk that has been unpacked.
struct Unpacked {
    /// Records that were too long.
    too_long: u64,
    /// What is left behind the last whole record.
    rest: Vec<u8>,
}

/// Gives what a stream holds in pieces of whole records, up to its end or to where it fails.
fn unpack(
    mut packed: impl Read,
    options: &ReadOptions,
    each: &mut dyn FnMut(&[u8]),
) -> (Unpacked, io::Result<()>) {
    let mut end = Ok(());
    let mut buffer = vec![0; PIECE_BYTES];
    let (mut filled, mut skip, mut too_long) = (0usize, 0u64, 0u64);
    loop {
        let count = packed.read(&mut buffer[filled..]).unwrap_or_else(|error| {
            end = Err(error);
            0
        });
        filled += count;
        if skip > 0 {
            // Inside a record that is stepped over.
            let drop = skip.min(filled as u64) as usize;
            buffer.copy_within(drop..filled, 0);
            filled -= drop;
            skip -= drop as u64;
        }
        let whole = whole_records(&buffer[..filled]);
        if whole > 0 && (filled == buffer.len() || count == 0) {
            each(&buffer[..whole]);
            buffer.copy_within(whole..filled, 0);
            filled -= whole;
        }
        if count == 0 && filled < buffer.len() {
            break;
        }
        if let Some(length) = Fields::new(buffer[..filled].get(1..).unwrap_or_default()).u64() {
            let needed = length.saturating_add(9);
            if needed > options.max_message_bytes && needed > filled as u64 && skip == 0 {
                too_long += 1;
                skip = needed - filled as u64;
                filled = 0;
            } else if needed > buffer.len() as u64 && needed <= options.max_message_bytes {
                // OK because it is below the limit on messages.
                buffer.resize(needed as usize, 0);
            }
        }
    }
    buffer.truncate(filled);
    let rest = buffer;
    (Unpacked { too_long, rest }, end)
}

/// How many bytes at the beginning are zero.
pub(super) fn leading_zeros(bytes: &[u8]) -> usize {
    let (words, _) = bytes.as_chunks::<16>();
    let whole = 16 * words.iter().take_while(|word| **word == [0; 16]).count();
    let rest = bytes[whole..].iter().take_while(|byte| **byte == 0);
    whole + rest.count()
}

/// How many of the bytes are whole records.
fn whole_records(bytes: &[u8]) -> usize {
    let mut at = leading_zeros(bytes);
    while let Some(length) = bytes.get(at + 1..).and_then(|rest| Fields::new(rest).u64()) {
        match usize::try_from(length)
            .ok()
            .and_then(|length| length.checked_add(at + 9))
        {
            Some(end) if end <= bytes.len() => at = end + leading_zeros(&bytes[end..]),
            _ => break,
        }
    }
    at
}

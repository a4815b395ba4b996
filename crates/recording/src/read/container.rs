//! The container: a walk over the top-level records of an MCAP, which needs no index and survives lengths that lie.
//!
//! The walk touches a few bytes per record and leaves chunks packed. Where a record is not possible, it looks for the next
//! place from which records follow each other, and says how many bytes it left out.

use std::{
    borrow::Cow,
    collections::{BTreeMap, BTreeSet},
    fs::File,
    io::{Read, Seek, SeekFrom},
    ops::Range,
    path::Path,
    sync::Arc,
};

use crate::{finding::Kind, text::counted};

pub(super) const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";

/// Opcodes of records.
pub(super) mod op {
    pub const HEADER: u8 = 0x01;
    pub const FOOTER: u8 = 0x02;
    pub const SCHEMA: u8 = 0x03;
    pub const CHANNEL: u8 = 0x04;
    pub const MESSAGE: u8 = 0x05;
    pub const CHUNK: u8 = 0x06;
    pub const MESSAGE_INDEX: u8 = 0x07;
    pub const CHUNK_INDEX: u8 = 0x08;
    pub const ATTACHMENT: u8 = 0x09;
    pub const ATTACHMENT_INDEX: u8 = 0x0a;
    pub const STATISTICS: u8 = 0x0b;
    pub const METADATA: u8 = 0x0c;
    pub const METADATA_INDEX: u8 = 0x0d;
    pub const SUMMARY_OFFSET: u8 = 0x0e;
    pub const DATA_END: u8 = 0x0f;
}

/// Reads little-endian fields off the front of a record; every read is checked.
#[derive(Clone, Copy)]
pub(super) struct Fields<'a> {
    pub rest: &'a [u8],
}

impl<'a> Fields<'a> {
    pub fn new(rest: &'a [u8]) -> Self {
        Fields { rest }
    }

    pub fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.rest.split_first_chunk::<N>()?;
        self.rest = rest;
        Some(*taken)
    }

    pub fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    pub fn take(&mut self, length: u64) -> Option<&'a [u8]> {
        let length = usize::try_from(length).ok()?;
        let (taken, rest) = self.rest.split_at_checked(length)?;
        self.rest = rest;
        Some(taken)
    }

    /// A text with a 32-bit length; bytes that are not UTF-8 are replaced.
    pub fn text(&mut self) -> Option<Cow<'a, str>> {
        let length = self.u32()?;
        self.take(u64::from(length)).map(String::from_utf8_lossy)
    }

    /// Steps over a text.
    pub fn skip_text(&mut self) -> Option<()> {
        let length = self.u32()?;
        self.take(u64::from(length)).map(drop)
    }

    pub fn map(&mut self) -> Option<BTreeMap<String, String>> {
        let length = self.u32()?;
        let mut inner = Fields::new(self.take(u64::from(length))?);
        let mut map = BTreeMap::new();
        while !inner.rest.is_empty() {
            let key = inner.text()?.into_owned();
            map.insert(key, inner.text()?.into_owned());
        }
        Some(map)
    }
}

/// A schema, wherever in the file it stands.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Schema {
    pub name: String,
    pub encoding: String,
    pub data: Arc<[u8]>,
}

/// A channel, wherever in the file it stands.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Channel {
    pub schema: u16,
    pub topic: String,
    pub encoding: String,
    pub metadata: BTreeMap<String, String>,
}

/// All schemas and channels by id; the first definition of an id counts, another one that differs is a conflict.
#[derive(Clone, Debug, Default)]
pub(super) struct Definitions {
    pub schemas: BTreeMap<u16, Schema>,
    pub channels: BTreeMap<u16, Channel>,
    /// Topic, or nothing for a schema, and what the second definition says.
    pub conflicts: BTreeSet<(String, String)>,
    pub broken: u64,
}

/// A schema record as it stands in the file.
struct SchemaRecord<'a> {
    id: u16,
    name: Cow<'a, str>,
    encoding: Cow<'a, str>,
    data: &'a [u8],
}

impl<'a> SchemaRecord<'a> {
    fn read(body: &'a [u8]) -> Option<Self> {
        let mut fields = Fields::new(body);
        let id = fields.u16()?;
        let (name, encoding) = (fields.text()?, fields.text()?);
        let length = fields.u32()?;
        Some(SchemaRecord {
            id,
            name,
            encoding,
            data: fields.take(u64::from(length))?,
        })
    }

    fn is(&self, known: &Schema) -> bool {
        known.name == self.name && known.encoding == self.encoding && *known.data == *self.data
    }
}

/// A channel record as it stands in the file; its metadata follow.
struct ChannelRecord<'a> {
    id: u16,
    schema: u16,
    topic: Cow<'a, str>,
    encoding: Cow<'a, str>,
    rest: Fields<'a>,
}

impl<'a> ChannelRecord<'a> {
    fn read(body: &'a [u8]) -> Option<Self> {
        let mut fields = Fields::new(body);
        let (id, schema) = (fields.u16()?, fields.u16()?);
        Some(ChannelRecord {
            id,
            schema,
            topic: fields.text()?,
            encoding: fields.text()?,
            rest: fields,
        })
    }

    fn is(&self, known: &Channel) -> bool {
        known.schema == self.schema && known.topic == self.topic && known.encoding == self.encoding
    }
}

/// Conflicts are listed up to this many.
const MAX_CONFLICTS: usize = 100;

impl Definitions {
    /// Takes in a schema or channel record.
    pub fn define(&mut self, opcode: u8, body: &[u8]) {
        let known = match opcode {
            op::SCHEMA => self.schema(body),
            op::CHANNEL => self.channel(body),
            _ => Some(()),
        };
        if known.is_none() {
            self.broken += 1;
        }
    }

    /// Whether a schema or channel record says what is known already.
    pub fn knows(&self, opcode: u8, body: &[u8]) -> bool {
        match opcode {
            op::SCHEMA => SchemaRecord::read(body).is_none_or(|found| {
                let known = self.schemas.get(&found.id);
                known.is_some_and(|known| found.is(known))
            }),
            op::CHANNEL => ChannelRecord::read(body).is_none_or(|found| {
                let known = self.channels.get(&found.id);
                known.is_some_and(|known| found.is(known))
            }),
            _ => true,
        }
    }

    fn schema(&mut self, body: &[u8]) -> Option<()> {
        let found = SchemaRecord::read(body)?;
        let conflict = self.schemas.get(&found.id).map(|known| !found.is(known));
        match conflict {
            Some(true) => self.schema_conflict(found.id, &found.name),
            Some(false) => {}
            None => {
                let schema = Schema {
                    name: found.name.into_owned(),
                    encoding: found.encoding.into_owned(),
                    data: found.data.into(),
                };
                self.schemas.insert(found.id, schema);
            }
        }
        Some(())
    }

    fn channel(&mut self, body: &[u8]) -> Option<()> {
        let mut found = ChannelRecord::read(body)?;
        let metadata = found.rest.map()?;
        let conflict = self.channels.get(&found.id).map(|known| !found.is(known));
        match conflict {
            Some(true) => self.channel_conflict(found.id, &found.topic, found.schema),
            Some(false) => {}
            None => {
                let channel = Channel {
                    schema: found.schema,
                    topic: found.topic.into_owned(),
                    encoding: found.encoding.into_owned(),
                    metadata,
                };
                self.channels.insert(found.id, channel);
            }
        }
        Some(())
    }

    fn conflict(&mut self, topic: String, text: String) {
        if self.conflicts.len() < MAX_CONFLICTS {
            self.conflicts.insert((topic, text));
        }
    }

    fn schema_conflict(&mut self, id: u16, again: &str) {
        let known = &self.schemas[&id].name;
        let text = format!(
            "schema {id}, {known}, is defined again and differently, as {again}: the first definition counts, and messages after the second may be wrong"
        );
        self.conflict(String::new(), text);
    }

    fn channel_conflict(&mut self, id: u16, again: &str, schema: u16) {
        let known = &self.channels[&id];
        let topic = known.topic.clone();
        let text = format!(
            "its channel {id} of schema {} is defined again and differently, as {again} of schema {schema}: the first definition counts, and messages after the second may be wrong",
            known.schema
        );
        self.conflict(topic, text);
    }

    /// Adds what another set defines and this one does not.
    pub fn merge(&mut self, other: Definitions) {
        for (id, schema) in other.schemas {
            match self.schemas.get(&id) {
                Some(known) if *known != schema => self.schema_conflict(id, &schema.name),
                Some(_) => {}
                None => drop(self.schemas.insert(id, schema)),
            }
        }
        for (id, channel) in other.channels {
            match self.channels.get(&id) {
                Some(known)
                    if (known.schema, &known.topic, &known.encoding)
                        != (channel.schema, &channel.topic, &channel.encoding) =>
                {
                    self.channel_conflict(id, &channel.topic, channel.schema);
                }
                Some(_) => {}
                None => drop(self.channels.insert(id, channel)),
            }
        }
        for (topic, text) in other.conflicts {
            self.conflict(topic, text);
        }
        self.broken += other.broken;
    }
}

/// A stretch of the file that holds messages.
#[derive(Clone, Debug)]
pub(super) enum Block {
    /// A chunk: its body, and how many messages its index names (`None` without one).
    Chunk {
        body: Range<usize>,
        indexed: Option<u64>,
    },
    /// What is left of the body of a chunk that the end of the file cuts off.
    CutChunk(Range<usize>),
    /// Records outside chunks.
    Loose(Range<usize>),
}

impl Block {
    /// Where it lies in the file.
    pub fn range(&self) -> &Range<usize> {
        match self {
            Block::Chunk { body, .. } | Block::CutChunk(body) | Block::Loose(body) => body,
        }
    }
}

/// What a chunk's header says.
pub(super) struct ChunkHeader<'a> {
    pub start_time: u64,
    pub end_time: u64,
    pub uncompressed: u64,
    pub crc: u32,
    pub compression: &'a [u8],
    pub records: &'a [u8],
    /// Bytes after the records, which the format allows.
    pub spare: usize,
}

/// Reads a chunk's header; `None` where it does not fit into its record.
pub(super) fn chunk_header(body: &[u8]) -> Option<ChunkHeader<'_>> {
    let (header, length) = begun_chunk_header(body)?;
    let mut fields = Fields::new(header.records);
    let records = fields.take(length)?;
    Some(ChunkHeader {
        records,
        spare: fields.rest.len(),
        ..header
    })
}

/// Reads the header of a chunk whose records may be cut off, with the length that they should have: all that follows is theirs.
pub(super) fn begun_chunk_header(body: &[u8]) -> Option<(ChunkHeader<'_>, u64)> {
    let mut fields = Fields::new(body);
    let (start_time, end_time) = (fields.u64()?, fields.u64()?);
    let (uncompressed, crc) = (fields.u64()?, fields.u32()?);
    let length = fields.u32()?;
    let compression = fields.take(u64::from(length))?;
    let length = fields.u64()?;
    let header = ChunkHeader {
        start_time,
        end_time,
        uncompressed,
        crc,
        compression,
        records: fields.rest,
        spare: 0,
    };
    Some((header, length))
}

/// An attachment's place in the file.
#[derive(Clone, Debug)]
pub(super) struct Attachment {
    pub name: String,
    pub media_type: String,
    pub log_time: u64,
    pub create_time: u64,
    pub data: Range<usize>,
    pub crc_ok: bool,
}

/// The summary's count of messages.
#[derive(Clone, Debug, Default)]
pub(super) struct Statistics {
    pub messages: u64,
    pub channels: u64,
    pub chunks: u64,
    pub start: u64,
    pub end: u64,
    pub per_channel: BTreeMap<u16, u64>,
}

/// What is wrong with the container: kind, count, text.
pub(super) type Damage = (Kind, u64, String);

/// The result of the walk.
#[derive(Default)]
pub(super) struct Container {
    pub profile: String,
    pub library: String,
    pub blocks: Vec<Block>,
    pub attachments: Vec<Attachment>,
    /// In the order of the file; several may have one name.
    pub metadata: Vec<(String, BTreeMap<String, String>)>,
    /// What the summary defines and counts, if there is a summary whose checksum holds.
    pub summary: Option<(Definitions, Option<Statistics>)>,
    pub damage: Vec<Damage>,
    /// The file's end was reached in good order.
    pub complete: bool,
    /// Messages of further recordings behind the end, as their summaries count them.
    pub behind: u64,
}

/// Loose records are cut into stretches of this size, so that they can be read like chunks.
const LOOSE_BYTES: usize = 1 << 20;

/// A look at one record brings its neighbourhood into memory: every so many bytes, what lies behind is given back.
const FORGET_BYTES: usize = 64 << 20;

struct Walk<'a> {
    bytes: &'a [u8],
    forget: &'a dyn Fn(&Range<usize>),
    /// Up to where that was done.
    forgotten: usize,
    found: Container,
    summary: Definitions,
    statistics: Option<Statistics>,
    data_end: Option<usize>,
    data_crc: u32,
    unchecked: bool,
    footer: Option<(usize, u64, u32)>,
    /// Where what follows the footer begins.
    end: Option<usize>,
    unknown: BTreeMap<u8, u64>,
}

/// By so many bytes an MCAP is known.
pub(super) const HEAD_BYTES: usize = MAGIC.len() + 9;

/// Whether these can be the first bytes of an MCAP: its magic, or, since a damaged first byte should not cost the file, the beginning of a
/// header behind it, of less than four gigabytes.
pub(super) fn begins(bytes: &[u8]) -> bool {
    let header = bytes.get(MAGIC.len()..HEAD_BYTES);
    bytes.starts_with(MAGIC)
        || header.is_some_and(|record| record[0] == op::HEADER && record[5..] == [0; 4])
}

/// Whether a file ends as an MCAP that was finished does: with its magic. Nothing else of it is read.
///
/// # Errors
/// Where it cannot be opened or is too short to hold the magic.
pub fn ends_whole(path: &Path) -> std::io::Result<bool> {
    let mut file = File::open(path)?;
    let mut last = [0; MAGIC.len()];
    file.seek(SeekFrom::End(-(MAGIC.len() as i64)))?;
    file.read_exact(&mut last)?;
    Ok(last == *MAGIC)
}

/// Walks over a whole file, which must not be empty; `None` if nothing in it looks like an MCAP. `forget` hears of stretches that
/// are not needed for now.
pub(super) fn walk(bytes: &[u8], forget: &dyn Fn(&Range<usize>)) -> Option<Container> {
    let magic = bytes.starts_with(MAGIC);
    let mut walk = Walk::new(bytes, forget);
    if !magic {
        // The header record must be sound then.
        if !begins(bytes) || walk.possible(MAGIC.len()).is_none() {
            return None;
        }
        walk.damage(
            Kind::BadRecord,
            1,
            "the first eight bytes are damaged".to_owned(),
        );
    }
    walk.records();
    if let Some(end) = walk.end {
        walk.closing(end);
    }
    walk.close();
    Some(walk.found)
}

/// How many messages recordings that stand one after the other count in their summaries.
fn messages_behind(mut bytes: &[u8]) -> u64 {
    let mut messages = 0u64;
    while bytes.starts_with(MAGIC) {
        let mut walk = Walk::new(bytes, &|_| ());
        walk.records();
        walk.close();
        let statistics = walk.found.summary.and_then(|(_, statistics)| statistics);
        messages = messages.saturating_add(statistics.map_or(0, |counted| counted.messages));
        let rest = walk.end.and_then(|end| bytes[end..].strip_prefix(MAGIC));
        bytes = rest.unwrap_or_default();
    }
    messages
}

impl<'a> Walk<'a> {
    fn new(bytes: &'a [u8], forget: &'a dyn Fn(&Range<usize>)) -> Self {
        Walk {
            bytes,
            forget,
            forgotten: 0,
            found: Container::default(),
            summary: Definitions::default(),
            statistics: None,
            data_end: None,
            data_crc: 0,
            unchecked: false,
            footer: None,
            end: None,
            unknown: BTreeMap::new(),
        }
    }

    fn damage(&mut self, kind: Kind, count: u64, text: String) {
        self.found.damage.push((kind, count, text));
    }

    /// The end of the record at `at`, if there can be one.
    fn possible(&self, at: usize) -> Option<usize> {
        let opcode = *self.bytes.get(at)?;
        let mut fields = Fields::new(self.bytes.get(at + 1..)?);
        let length = fields.u64()?;
        let body = fields.take(length)?;
        let end = at + 9 + body.len();
        let mut fields = Fields::new(body);
        let fits = match opcode {
            op::HEADER => fields
                .skip_text()
                .and_then(|_| fields.skip_text())
                .is_some(),
            op::FOOTER => body.len() >= 20,
            op::SCHEMA => fields
                .u16()
                .and_then(|_| fields.skip_text())
                .and_then(|_| fields.skip_text())
                .is_some(),
            op::CHANNEL => fields
                .u32()
                .and_then(|_| fields.skip_text())
                .and_then(|_| fields.skip_text())
                .is_some(),
            op::MESSAGE => body.len() >= 22,
            op::CHUNK => chunk_header(body).is_some(),
            op::MESSAGE_INDEX => fields
                .u16()
                .and_then(|_| fields.u32())
                .and_then(|length| fields.take(u64::from(length)))
                .is_some(),
            op::ATTACHMENT => body.len() >= 8 + 8 + 4 + 4 + 8 + 4,
            op::METADATA => fields.skip_text().and_then(|_| fields.u32()).is_some(),
            op::STATISTICS => body.len() >= 42,
            op::DATA_END => body.len() >= 4,
            op::CHUNK_INDEX => fields
                .take(8 * 4)
                .and_then(|_| fields.u32())
                .and_then(|length| fields.take(u64::from(length)))
                .and_then(|_| fields.u64())
                .and_then(|_| fields.skip_text())
                .and_then(|_| fields.take(8 + 8))
                .is_some(),
            op::ATTACHMENT_INDEX => fields
                .take(8 * 5)
                .and_then(|_| fields.skip_text())
                .and_then(|_| fields.skip_text())
                .is_some(),
            op::METADATA_INDEX => fields
                .take(8 + 8)
                .and_then(|_| fields.skip_text())
                .is_some(),
            op::SUMMARY_OFFSET => body.len() >= 1 + 8 + 8,
            // Opcodes from 0x80 on are private; those between are unknown, and readers must step over them.
            _ => opcode != 0,
        };
        fits.then_some(end)
    }

    /// Whether records follow each other from `at`: three possible ones of known kinds, or fewer up to the end of the file.
    fn plausible(&self, mut at: usize) -> bool {
        for _ in 0..3 {
            if self.bytes.len() - at == MAGIC.len() && self.bytes.ends_with(MAGIC) {
                return true;
            }
            if !(1..=0x0f).contains(&self.bytes[at]) {
                return false;
            }
            match self.possible(at) {
                Some(end) if end < self.bytes.len() => at = end,
                Some(_) => return true,
                None => return false,
            }
        }
        true
    }

    /// The next place after `from` where records follow each other.
    fn resync(&self, from: usize) -> Option<usize> {
        (from..self.bytes.len().saturating_sub(9)).find(|&at| {
            // Lengths of more than four gigabytes are not believed here; the test also makes the search quick.
            (1..=0x0f).contains(&self.bytes[at])
                && self.bytes[at + 5..at + 9] == [0; 4]
                && self.plausible(at)
        })
    }

    /// Whether the record at `at`, which ends at `end`, is followed by another, whole or cut. Where its inner lengths could vouch for its own and do not,
    /// one that only may be a record is not enough: in the midst of a chunk there are many. No record begins inside an index.
    fn followed(&self, at: usize, end: usize) -> bool {
        match self.bytes[at] {
            op::MESSAGE_INDEX => false,
            op::CHUNK => self.plausible(end) || self.cut_record(end),
            _ => self.possible(end).is_some() || self.cut_record(end),
        }
    }

    /// Whether the record at `at` vouches for its own length: its inner lengths use it up.
    fn tight(&self, at: usize, end: usize) -> bool {
        let body = &self.bytes[at + 9..end];
        match self.bytes[at] {
            op::CHUNK => chunk_header(body).is_some_and(|header| header.spare == 0),
            op::MESSAGE_INDEX => {
                body.get(2..6)
                    .and_then(|length| length.try_into().ok())
                    .map(u32::from_le_bytes)
                    == u32::try_from(body.len() - 6).ok()
            }
            _ => false,
        }
    }

    fn records(&mut self) {
        let end_of_file = self.bytes.len();
        let mut at = MAGIC.len();
        while at < end_of_file {
            if at - self.forgotten > FORGET_BYTES {
                (self.forget)(&(self.forgotten..at));
                self.forgotten = at;
            }
            if self.footer.is_some() {
                self.end = Some(at);
                return;
            }
            let next = match self.possible(at) {
                Some(end) => {
                    let believed = end == end_of_file
                        || self.bytes[at] == op::FOOTER
                        || self.tight(at, end)
                        || self.followed(at, end);
                    // A record that leads nowhere is sound where nothing better begins inside it.
                    match if believed { None } else { self.resync(at + 9) } {
                        Some(next) if next < end => Some(next),
                        _ => {
                            self.record(at, end);
                            at = end;
                            continue;
                        }
                    }
                }
                None if self.cut_chunk(at) => {
                    let rest = Block::CutChunk(at + 9..end_of_file);
                    self.found.blocks.push(rest);
                    None
                }
                None => self.resync(at + 1),
            };
            let Some(next) = next else {
                self.cut(at);
                return;
            };
            let kind = if self.data_end.is_some() {
                Kind::BadSummary
            } else {
                Kind::BadRecord
            };
            self.damage(
                kind,
                1,
                format!(
                    "{} bytes at byte {at} are no record and were left out",
                    next - at
                ),
            );
            at = next;
        }
        if self.footer.is_none() {
            self.cut(at);
        } else {
            self.end = Some(at);
        }
    }

    /// Whether what is left from `at` on reads as the beginning of a record that the end of the file cuts off.
    fn cut_record(&self, at: usize) -> bool {
        let rest = &self.bytes[at..];
        let known = rest.first().is_some_and(|op| (1..=0x0f).contains(op));
        let length = rest.get(1..9).and_then(|length| length.try_into().ok());
        let beyond = |length| {
            // As in `resync`, more than four gigabytes are not believed.
            let length = u64::from_le_bytes(length);
            length >> 32 == 0 && length > rest.len() as u64 - 9
        };
        known && length.is_none_or(beyond)
    }

    /// Whether a chunk begins at `at` that goes on beyond the end of the file: both its lengths say so, or neither is known yet, which a
    /// writer that packs while it writes (mcap for Rust) says by all bits until the chunk is closed.
    fn cut_chunk(&self, at: usize) -> bool {
        let lengths = || {
            let mut fields = Fields::new(&self.bytes[at..]);
            let (opcode, outer) = (fields.array::<1>()?, fields.u64()?);
            let (header, inner) = begun_chunk_header(fields.rest)?;
            let whole = (40 + header.compression.len() as u64).checked_add(inner);
            let open = (outer, inner) == (u64::MAX, u64::MAX);
            Some(opcode == [op::CHUNK] && (whole == Some(outer) || open))
        };
        lengths() == Some(true)
    }

    /// The file stops at `at`, before its closing records.
    fn cut(&mut self, at: usize) {
        let left = self.bytes.len() - at;
        let what = match self.bytes.get(at) {
            Some(&op::CHUNK) => "a chunk",
            Some(&op::MESSAGE) => "a message",
            Some(&op::ATTACHMENT) => "an attachment",
            _ => "a record",
        };
        let (kind, text) = match (self.data_end, left) {
            (Some(_), _) => (
                Kind::BadSummary,
                "the file ends inside its summary; its messages are all there".to_owned(),
            ),
            (None, 0) => (
                Kind::Truncated,
                "the file ends without its closing records; what came after is lost".to_owned(),
            ),
            (None, _) if matches!(self.found.blocks.last(), Some(Block::CutChunk(_))) => (
                Kind::Truncated,
                format!(
                    "the file ends inside a chunk: its last {left} bytes, from byte {at} on, were read as far as they unpack, and no checksum vouches for them"
                ),
            ),
            (None, _) => (
                Kind::Truncated,
                format!(
                    "the file ends inside {what}: its last {left} bytes, from byte {at} on, were left out"
                ),
            ),
        };
        self.damage(kind, 1, text);
    }

    /// What stands after the footer.
    fn closing(&mut self, at: usize) {
        let rest = &self.bytes[at..];
        self.found.complete = rest == MAGIC;
        if !self.found.complete {
            let text = match rest.strip_prefix(MAGIC) {
                Some(more) if more.starts_with(MAGIC) => {
                    self.found.behind = messages_behind(more);
                    format!(
                        "another recording follows the end of this one, of {} and {} bytes from byte {} on, and was left out: make it a file of its own",
                        counted(self.found.behind, "message", "messages"),
                        more.len(),
                        at + MAGIC.len()
                    )
                }
                Some(more) => format!(
                    "{} bytes follow the end of the recording and were left out",
                    more.len()
                ),
                None => {
                    "the closing eight bytes are damaged or missing; the messages are all there"
                        .to_owned()
                }
            };
            self.damage(Kind::BadSummary, 1, text);
        }
    }

    fn record(&mut self, at: usize, end: usize) {
        let opcode = self.bytes[at];
        let body = at + 9..end;
        let bytes = self.bytes;
        let mut fields = Fields::new(&bytes[body.clone()]);
        match opcode {
            op::HEADER => {
                let (profile, library) = (fields.text(), fields.text());
                self.found.profile = profile.unwrap_or_default().into_owned();
                self.found.library = library.unwrap_or_default().into_owned();
            }
            op::SCHEMA | op::CHANNEL if self.data_end.is_some() => {
                self.summary.define(opcode, &bytes[body])
            }
            op::SCHEMA | op::CHANNEL | op::MESSAGE => {
                self.unchecked |= opcode == op::MESSAGE;
                match self.found.blocks.last_mut() {
                    Some(Block::Loose(range)) if range.end == at && range.len() < LOOSE_BYTES => {
                        range.end = end
                    }
                    _ => self.found.blocks.push(Block::Loose(at..end)),
                }
            }
            op::CHUNK => {
                self.unchecked |=
                    chunk_header(&bytes[body.clone()]).is_some_and(|header| header.crc == 0);
                self.found.blocks.push(Block::Chunk {
                    body,
                    indexed: None,
                });
            }
            op::MESSAGE_INDEX => {
                if let (Some(Block::Chunk { indexed, .. }), Some(_), Some(length)) =
                    (self.found.blocks.last_mut(), fields.u16(), fields.u32())
                {
                    *indexed.get_or_insert(0) += u64::from(length / 16);
                }
            }
            op::ATTACHMENT => self.attachment(body),
            op::METADATA => {
                if let (Some(name), Some(map)) = (fields.text(), fields.map()) {
                    self.found.metadata.push((name.into_owned(), map));
                } else {
                    self.damage(
                        Kind::BadRecord,
                        1,
                        format!("the metadata record at byte {at} cannot be read"),
                    );
                }
            }
            op::STATISTICS => self.statistics = statistics(fields),
            op::DATA_END => {
                self.data_end = Some(at);
                self.data_crc = fields.u32().unwrap_or(0);
            }
            op::FOOTER => {
                if let (Some(start), Some(_), Some(crc)) =
                    (fields.u64(), fields.u64(), fields.u32())
                {
                    self.footer = Some((at, start, crc));
                }
            }
            0x10..=0x7f => *self.unknown.entry(opcode).or_default() += 1,
            _ => {}
        }
    }

    fn attachment(&mut self, body: Range<usize>) {
        let bytes = &self.bytes[body.clone()];
        let mut fields = Fields::new(bytes);
        let parsed = (|| {
            let (log_time, create_time) = (fields.u64()?, fields.u64()?);
            let (name, media_type) = (fields.text()?.into_owned(), fields.text()?.into_owned());
            let length = fields.u64()?;
            let start = body.start + (bytes.len() - fields.rest.len());
            let data = fields.take(length)?;
            let checked = bytes.len() - fields.rest.len();
            let crc = fields.u32()?;
            let crc_ok = crc == 0 || crc32fast::hash(&bytes[..checked]) == crc;
            Some(Attachment {
                name,
                media_type,
                log_time,
                create_time,
                data: start..start + data.len(),
                crc_ok,
            })
        })();
        match parsed {
            Some(attachment) => {
                if !attachment.crc_ok {
                    self.damage(
                        Kind::BadCrc,
                        1,
                        format!(
                            "the attachment {:?} does not match its checksum",
                            attachment.name
                        ),
                    );
                }
                self.found.attachments.push(attachment);
            }
            None => self.damage(
                Kind::BadRecord,
                1,
                format!("the attachment at byte {} cannot be read", body.start - 9),
            ),
        }
    }

    /// The checksum of the data up to `end` as the mcap crate 0.26 makes it where it gives chunks none: without what is packed in them.
    fn crc_without_chunks(&self, end: usize) -> Option<u32> {
        let mut crc = crc32fast::Hasher::new();
        let mut from = 0;
        for block in &self.found.blocks {
            if let Block::Chunk { body, .. } = block {
                let header = chunk_header(&self.bytes[body.clone()])?;
                if header.crc != 0 {
                    return None;
                }
                let packed = body.end - header.spare - header.records.len();
                crc.update(self.bytes.get(from..packed)?);
                from = body.end - header.spare;
            }
        }
        crc.update(self.bytes.get(from..end)?);
        Some(crc.finalize())
    }

    /// What can be said only at the end: unknown records, checksums, the summary.
    fn close(&mut self) {
        for (opcode, count) in std::mem::take(&mut self.unknown) {
            self.damage(
                Kind::BadRecord,
                count,
                format!("{count} records of the unknown kind 0x{opcode:02x} were stepped over"),
            );
        }
        // Chunks carry their own checksum; the one over all data matters where something stands outside them.
        if let Some(end) = self.data_end
            && self.data_crc != 0
            && self.unchecked
            && crc32fast::hash(&self.bytes[..end]) != self.data_crc
            && self.crc_without_chunks(end) != Some(self.data_crc)
        {
            self.damage(Kind::BadCrc, 1, "the data do not match their checksum: numbers in messages outside chunks may be wrong".to_owned());
        }
        let Some((footer, start, crc)) = self.footer else {
            return;
        };
        let start = usize::try_from(start).unwrap_or(usize::MAX);
        if start == 0 {
            return; // The file was written without a summary.
        }
        // The checksum covers the summary and the footer up to itself.
        let covered = self.bytes.get(start..footer + 9 + 16);
        if crc != 0 && covered.is_none_or(|covered| crc32fast::hash(covered) != crc) {
            self.damage(
                Kind::BadSummary,
                1,
                "the summary does not match its checksum and was not used".to_owned(),
            );
            return;
        }
        self.found.summary = Some((std::mem::take(&mut self.summary), self.statistics.take()));
    }
}

fn statistics(mut fields: Fields<'_>) -> Option<Statistics> {
    let messages = fields.u64()?;
    fields.u16()?;
    let channels = u64::from(fields.u32()?);
    fields.u32()?;
    fields.u32()?;
    let chunks = u64::from(fields.u32()?);
    let (start, end) = (fields.u64()?, fields.u64()?);
    let length = fields.u32()?;
    let mut counts = Fields::new(fields.take(u64::from(length))?);
    let mut per_channel = BTreeMap::new();
    while !counts.rest.is_empty() {
        let id = counts.u16()?;
        per_channel.insert(id, counts.u64()?);
    }
    Some(Statistics {
        messages,
        channels,
        chunks,
        start,
        end,
        per_channel,
    })
}

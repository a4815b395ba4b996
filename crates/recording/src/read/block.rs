//! One block of a recording, a chunk or a stretch of loose records, turned into rows of numbers; the work of one thread.

use std::{collections::BTreeMap, ops::Range, sync::Arc};

use super::{
    ReadOptions, Recording, Tally,
    chunk::{self, Loss, Unpacker, WHOLE_BYTES},
    container::{Block, Definitions, Fields, chunk_header, op},
    decode::{Decoder, Place, SchemaRef},
    decoders::{self, NoDecoder},
    names::Sight,
    rows::{Long, MAX_PLACES, Rows, Selection},
};
use crate::finding::Kind;
use crate::text::counted;

/// Decoded numbers of one channel in one block.
#[derive(Default)]
pub(super) struct ChannelBatch {
    /// Index into the recording's channels.
    pub channel: usize,
    pub times: Vec<i64>,
    /// Header stamps, one per row, or none at all.
    pub stamps: Vec<i64>,
    pub columns: Vec<BatchColumn>,
    pub absent: Vec<(String, u64)>,
    pub long: Vec<(Long, u64)>,
    pub names: Vec<Sight>,
    pub trailing: u64,
    pub remark: Option<String>,
    /// A field that has two places in one message.
    pub twice: Option<String>,
}

/// One column of a batch.
pub(super) struct BatchColumn {
    pub path: Arc<str>,
    pub values: Vec<f64>,
    /// The rows that have a value; empty if all do.
    pub rows: Vec<u32>,
    /// Values that are not finite, and the row of the first.
    pub odd: Option<(u64, u32)>,
}

/// Something that could not be used.
pub(super) struct Trouble {
    /// Index of the channel, or `None` for the file.
    pub channel: Option<usize>,
    pub kind: Kind,
    pub count: u64,
    pub time: Option<i64>,
    pub text: String,
    /// Messages that it cost, where that is known.
    pub lost: u64,
}

/// What a block gave.
#[derive(Default)]
pub(super) struct BlockResult {
    pub batches: Vec<ChannelBatch>,
    pub troubles: Vec<Trouble>,
    /// Messages seen, usable or not.
    pub messages: u64,
    /// The same by index of the channel, where it is known.
    pub per_channel: Vec<(usize, u64)>,
    /// The earliest and the latest log time, of a lost chunk as its header says, ns.
    pub times: Option<(u64, u64)>,
    /// Schemas and channels that are defined here otherwise than they are used.
    pub contradictions: u64,
    /// The block is too large to be decoded in one go, or cut off: the caller reads it in pieces.
    pub large: bool,
}

impl BlockResult {
    /// What its numbers take in memory.
    pub fn bytes(&self) -> usize {
        let column = |c: &BatchColumn| size_of_val(&c.values[..]) + size_of_val(&c.rows[..]);
        let batch = |b: &ChannelBatch| {
            size_of_val(&b.times[..])
                + size_of_val(&b.stamps[..])
                + b.columns.iter().map(column).sum::<usize>()
        };
        self.batches.iter().map(batch).sum()
    }

    /// Takes in that a chunk was left out, and why.
    fn lose(
        &mut self,
        recording: &Recording,
        body: &Range<usize>,
        indexed: Option<u64>,
        (kind, what): Loss,
    ) {
        let messages = match indexed {
            Some(1) => "its only message was".to_owned(),
            Some(count) => format!("its {count} messages were"),
            None => "it was".to_owned(),
        };
        self.times = chunk_times(&recording.data[body.clone()]);
        self.troubles.push(Trouble {
            channel: None,
            kind,
            count: 1,
            time: self.times.and_then(|(start, _)| i64::try_from(start).ok()),
            text: format!(
                "the chunk at byte {} {what}; {messages} left out",
                body.start.saturating_sub(9)
            ),
            lost: indexed.unwrap_or(0),
        });
    }

    #[inline]
    fn see(&mut self, time: u64) {
        let (first, last) = self.times.get_or_insert((time, time));
        *first = time.min(*first);
        *last = time.max(*last);
    }
}

/// Memory of a result that has been used, for one to come: asking the system for it again and again would take a twentieth of the time.
#[derive(Default)]
struct Spare {
    values: Vec<Vec<f64>>,
    times: Vec<Vec<i64>>,
}

/// A vector for about `length` numbers out of the spare ones. One that is far too long is given back: small columns would end up with the
/// memory of the largest.
fn empty<T>(spare: &mut Vec<Vec<T>>, length: usize) -> Vec<T> {
    let fits = |v: &Vec<T>| v.capacity() >= length && v.capacity() <= 4 * length + 64;
    match spare.pop().filter(fits) {
        Some(mut v) => {
            v.clear();
            v
        }
        None => Vec::with_capacity(length + length / 8),
    }
}

enum State {
    /// Its schema has not been read: that makes columns, which nobody should have for all channels at once.
    New,
    Ready(Box<dyn Decoder>),
    /// Nothing can decode the channel; why, and how that is called.
    Closed(Kind, String),
}

impl State {
    fn open(recording: &Recording, index: usize, rows: &mut Rows) -> Self {
        let info = &recording.info.channels[index];
        let schema = SchemaRef {
            name: &info.schema,
            encoding: &info.schema_encoding,
            data: &info.schema_data,
            pools: &recording.pools,
        };
        let opened = decoders::open(&info.encoding, &schema, rows);
        // Those of the schema are not of messages.
        rows.places = 0;
        match opened {
            Ok(decoder) => State::Ready(decoder),
            Err(NoDecoder::Unknown) => State::Closed(
                Kind::NoDecoder,
                format!(
                    "encoding {:?} with schema encoding {:?} has no decoder; there are {}",
                    info.encoding,
                    info.schema_encoding,
                    decoders::listed()
                ),
            ),
            Err(NoDecoder::Unread(problem)) => State::Closed(
                Kind::NoDecoder,
                format!("the schema {:?} is not read: {problem}", info.schema),
            ),
            Err(NoDecoder::BadSchema(problem)) => State::Closed(
                Kind::BadSchema,
                format!("the schema {:?} cannot be used: {problem}", info.schema),
            ),
        }
    }
}

struct ChannelState<'a> {
    index: usize,
    rows: Rows<'a>,
    state: State,
    /// Nothing has been decoded yet.
    fresh: bool,
    /// Messages of the block that wait to be decoded together.
    waiting: Vec<Place>,
    times: Vec<i64>,
    /// Messages that could not be decoded: count, time and text of the first.
    failed: Option<(u64, i64, String)>,
    closed: u64,
    out_of_range: u64,
    /// Messages of the block.
    seen: u64,
}

/// The memory of one thread.
pub(super) struct Worker<'a> {
    recording: &'a Recording,
    select: Selection<'a>,
    unpacker: Unpacker,
    /// By channel index.
    channels: Vec<Option<Box<ChannelState<'a>>>>,
    touched: Vec<usize>,
    /// Messages of channels that nothing defines: how many, and the first one's log time.
    unknown: BTreeMap<u16, (u64, u64)>,
    /// Message records too short for their header.
    short: u64,
    /// Places that the decoders of all channels remember, and their columns and fields of types.
    places: usize,
    columns: usize,
    spare: Spare,
}

/// What a block gives is held up to so many numbers; twice as many as the largest chunk that is unpacked in one go can hold as doubles. Only messages that
/// leave out what they mean, as protobuf's do, give many more than they have bytes.
const MOST_VALUES: usize = 1 << 22;

/// No thread remembers more columns and fields of types: those of a channel that it has not decoded lately are found again.
const MOST_COLUMNS: usize = 1 << 20;

impl<'a> Worker<'a> {
    pub fn new(recording: &'a Recording, select: Selection<'a>) -> Self {
        let mut channels = Vec::new();
        channels.resize_with(recording.info.channels.len(), || None);
        Worker {
            recording,
            select,
            unpacker: Unpacker::new(),
            channels,
            touched: Vec::new(),
            unknown: BTreeMap::new(),
            short: 0,
            places: 0,
            columns: 0,
            spare: Spare::default(),
        }
    }

    /// Takes the memory of a result that nobody needs any more, in place of what is left of the last one: a thread that is handed large results
    /// and decodes small blocks must not pile them up.
    pub fn reuse(&mut self, result: BlockResult) {
        self.spare = Spare::default();
        for batch in result.batches {
            self.spare.times.extend([batch.times, batch.stamps]);
            let values = batch.columns.into_iter().map(|column| column.values);
            self.spare.values.extend(values);
        }
    }

    /// Decodes a block.
    pub fn block(&mut self, block: &Block) -> BlockResult {
        let mut result = BlockResult::default();
        match block {
            Block::Loose(range) => {
                self.records(&self.recording.data[range.clone()], &mut result, None);
            }
            Block::CutChunk(_) => {
                result.large = true;
                return result;
            }
            Block::Chunk { body, indexed } => {
                let header = match chunk::open(
                    &self.recording.data[body.clone()],
                    &self.recording.options,
                ) {
                    Ok(header) if header.uncompressed > WHOLE_BYTES => {
                        result.large = true;
                        return result;
                    }
                    Ok(header) => header,
                    Err(loss) => {
                        result.lose(self.recording, body, *indexed, loss);
                        return result;
                    }
                };
                // The unpacker's memory is borrowed while records are read from it.
                let mut unpacker = std::mem::replace(&mut self.unpacker, Unpacker::new());
                match unpacker.whole(&header) {
                    Ok(records) => self.records(records, &mut result, None),
                    Err(loss) => result.lose(self.recording, body, *indexed, loss),
                }
                self.unpacker = unpacker;
            }
        }
        if result.large {
            // What was decoded of it stands in the way of what the caller reads next.
            *self = Worker::new(self.recording, self.select);
            return BlockResult {
                large: true,
                ..BlockResult::default()
            };
        }
        result
    }

    /// Decodes a block in pieces and gives each piece's result away at once.
    pub fn large(&mut self, block: &Block, give: &mut dyn FnMut(BlockResult)) {
        let recording = self.recording;
        let (options, packed) = (&recording.options, &recording.data[block.range().clone()]);
        let mut read = |records: &[u8]| {
            let mut result = BlockResult::default();
            self.records(records, &mut result, Some(give));
            give(result);
        };
        let (too_long, indexed) = match block {
            Block::Loose(range) => return read(&recording.data[range.clone()]),
            Block::Chunk { indexed, .. } => {
                let header = chunk::open(packed, options);
                let pieces = header.and_then(|header| chunk::pieces(&header, options, &mut read));
                (pieces, *indexed)
            }
            Block::CutChunk(_) => (chunk::beginning(packed, options, &mut read), None),
        };
        let mut result = BlockResult::default();
        match too_long {
            Ok(0) => return,
            Ok(count) => {
                let text = format!(
                    "{} longer than {} of {}",
                    counted(count, "message is", "messages are"),
                    options.limit("--max-message-bytes"),
                    options.max_message_bytes
                );
                result.messages = count;
                result.times = chunk_times(packed);
                result.troubles.push(Trouble {
                    channel: None,
                    kind: Kind::TooLarge,
                    count,
                    time: None,
                    text,
                    lost: count,
                });
            }
            Err(loss) => result.lose(recording, block.range(), indexed, loss),
        }
        give(result);
    }

    /// Reads records that stand one after the other. Where they give more numbers than may be held, these are given away in between, or it ends there
    /// with a result that says so.
    fn records(
        &mut self,
        block: &[u8],
        result: &mut BlockResult,
        mut give: Option<&mut dyn FnMut(BlockResult)>,
    ) {
        let mut records = Records::new(block);
        let mut misplaced: BTreeMap<u8, u64> = BTreeMap::new();
        while let Some((opcode, body)) = records.next() {
            match opcode {
                op::MESSAGE => {
                    result.messages += 1;
                    self.message(body, block.len() - records.rest.len(), result);
                }
                op::SCHEMA | op::CHANNEL => {
                    let known = self.recording.definitions.knows(opcode, body);
                    result.contradictions += u64::from(!known);
                }
                // Private to whoever wrote them.
                0x80.. => {}
                _ => *misplaced.entry(opcode).or_default() += 1,
            }
        }
        // In the order of the channels, so that it does not depend on which came first.
        self.touched.sort_unstable();
        let mut held = 0;
        for index in std::mem::take(&mut self.touched) {
            let Some(channel) = &mut self.channels[index] else {
                continue;
            };
            self.places -= channel.rows.places;
            self.columns -= channel.remembers();
            loop {
                let room = MOST_VALUES.saturating_sub(held);
                channel.decode(block, self.recording, self.select, room);
                held += channel.rows.held;
                let whole = channel.waiting.is_empty();
                if !whole && give.is_none() {
                    result.large = true;
                    return;
                }
                channel.harvest(result, &mut self.spare);
                if whole {
                    break;
                }
                if let Some(give) = &mut give {
                    give(std::mem::take(result));
                    held = 0;
                }
            }
            let places = self.places + channel.rows.places;
            let columns = self.columns + channel.remembers();
            // Many channels may not remember together what each of them may.
            if places > MAX_PLACES || columns > MOST_COLUMNS {
                self.channels[index] = None;
            } else {
                (self.places, self.columns) = (places, columns);
            }
        }
        let mut bad = |count, text, lost| {
            result.troubles.push(Trouble {
                channel: None,
                kind: Kind::BadRecord,
                count,
                time: None,
                text,
                lost,
            })
        };
        for (opcode, count) in misplaced {
            let text = format!(
                "records of the kind 0x{opcode:02x}, which no chunk should hold, were stepped over"
            );
            bad(count, text, 0);
        }
        if records.zeros {
            let text = "zero bytes in a chunk, where a record should begin, were stepped over";
            bad(1, text.to_owned(), 0);
        }
        if !records.rest.is_empty() {
            let text = format!(
                "{} bytes at the end of a chunk are no record and were left out",
                records.rest.len()
            );
            bad(1, text, 0);
        }
        let short = std::mem::take(&mut self.short);
        if short > 0 {
            let text = "message records are too short for their header".to_owned();
            bad(short, text, short);
        }
        for (id, (count, time)) in std::mem::take(&mut self.unknown) {
            result.troubles.push(Trouble {
                channel: None,
                kind: Kind::UnknownChannel,
                count,
                time: i64::try_from(time).ok(),
                text: format!("messages of channel {id}, which nothing defines"),
                lost: count,
            });
        }
    }

    /// Notes where a message lies; its record ends at byte `end` of the block.
    #[inline]
    fn message(&mut self, body: &[u8], end: usize, result: &mut BlockResult) {
        let Some((header, data)) = body.split_first_chunk::<22>() else {
            self.short += 1;
            return;
        };
        let id = u16::from_le_bytes([header[0], header[1]]);
        let time = u64::from_le_bytes(std::array::from_fn(|i| header[6 + i]));
        result.see(time);
        let Some(index) = self.recording.by_id[usize::from(id)] else {
            self.unknown.entry(id).or_insert((0, time)).0 += 1;
            return;
        };
        let (recording, select) = (self.recording, self.select);
        let channel = self.channels[index]
            .get_or_insert_with(|| Box::new(ChannelState::new(recording, index, select)));
        if !channel.begun() {
            self.touched.push(index);
        }
        channel.seen += 1;
        let Ok(time) = i64::try_from(time) else {
            channel.out_of_range += 1;
            return;
        };
        let bytes = end - data.len()..end;
        channel.waiting.push(Place { bytes, time });
    }
}

impl<'a> ChannelState<'a> {
    fn new(recording: &Recording, index: usize, select: Selection<'a>) -> Self {
        let info = &recording.info.channels[index];
        ChannelState {
            index,
            rows: Rows::new(
                &info.topic,
                select,
                recording.most_items(&info.schema),
                recording.options.by_name,
            ),
            state: State::New,
            fresh: true,
            waiting: Vec::new(),
            times: Vec::new(),
            failed: None,
            closed: 0,
            out_of_range: 0,
            seen: 0,
        }
    }

    /// Whether the current block has given this channel anything yet.
    fn begun(&self) -> bool {
        self.seen > 0
    }

    /// Its columns, and the fields of its type.
    fn remembers(&self) -> usize {
        self.rows.columns.len() + self.rows.fields
    }

    /// Decodes messages that wait, which lie in `block`, until they give so many numbers. What comes of them depends on the block alone: where columns
    /// were left out because others were known from blocks before, it is decoded with none known.
    fn decode(&mut self, block: &[u8], recording: &Recording, select: Selection<'a>, room: usize) {
        if self.rows.full {
            self.begin_anew(recording, select);
        }
        let fresh = std::mem::replace(&mut self.fresh, false);
        let mut done = self.read(block, recording, room);
        if self.rows.full && !fresh {
            self.begin_anew(recording, select);
            done = self.read(block, recording, room);
        }
        self.waiting.drain(..done);
    }

    fn begin_anew(&mut self, recording: &Recording, select: Selection<'a>) {
        let new = ChannelState::new(recording, self.index, select);
        (self.rows, self.state) = (new.rows, new.state);
        self.times.clear();
        self.failed = None;
    }

    /// Decodes messages until they give so many numbers, and says how many it took.
    fn read(&mut self, block: &[u8], recording: &Recording, room: usize) -> usize {
        if let State::New = self.state {
            self.state = State::open(recording, self.index, &mut self.rows);
        }
        let State::Ready(decoder) = &mut self.state else {
            // Messages without a decoder are counted, and tell their times.
            self.closed += self.waiting.len() as u64;
            self.times
                .extend(self.waiting.iter().map(|place| place.time));
            // OK because rows are counted in u32 and a block is far from having as many messages.
            self.rows
                .keep_alike(self.waiting.len() as u32, std::iter::empty());
            return self.waiting.len();
        };
        decoder.begin_block();
        let rows = &mut self.rows;
        self.times.reserve(self.waiting.len());
        let mut places = self.waiting.as_slice();
        while let Some(place) = places.first()
            && rows.held <= room
        {
            let alike = decoder.decode_alike(block, places, rows);
            if alike > 0 {
                let (done, rest) = places.split_at(alike);
                self.times.extend(done.iter().map(|place| place.time));
                places = rest;
                continue;
            }
            rows.begin();
            match decoder.decode(&block[place.bytes.clone()], rows) {
                Ok(()) => {
                    rows.keep();
                    self.times.push(place.time);
                }
                Err(text) => {
                    rows.abort();
                    match &mut self.failed {
                        Some((count, _, _)) => *count += 1,
                        none => *none = Some((1, place.time, text)),
                    }
                }
            }
            places = &places[1..];
        }
        self.waiting.len() - places.len()
    }

    fn harvest(&mut self, result: &mut BlockResult, spare: &mut Spare) {
        let troubles = &mut result.troubles;
        let mut trouble = |kind, count, time, text, lost| {
            troubles.push(Trouble {
                channel: Some(self.index),
                kind,
                count,
                time,
                text,
                lost,
            });
        };
        result
            .per_channel
            .push((self.index, std::mem::take(&mut self.seen)));
        if let Some((count, time, text)) = self.failed.take() {
            trouble(Kind::Undecodable, count, Some(time), text, count);
        }
        let closed = std::mem::take(&mut self.closed);
        if let (State::Closed(kind, text), 1..) = (&self.state, closed) {
            // A channel of a kind that is not read is left out, not lost.
            let lost = if kind.is_loss() { closed } else { 0 };
            trouble(*kind, closed, None, text.clone(), lost);
        }
        let out = std::mem::take(&mut self.out_of_range);
        if out > 0 {
            let text = "log times beyond the year 2262 cannot be held in nanoseconds".to_owned();
            trouble(Kind::TimeOutOfRange, out, None, text, out);
        }
        let rows = self.rows.finish();
        if rows > 0 {
            let order = std::mem::take(&mut self.rows.order);
            let columns = (order.into_iter())
                .map(|column| {
                    let column = &mut self.rows.columns[column as usize];
                    let next = empty(&mut spare.values, column.values.len());
                    let values = std::mem::replace(&mut column.values, next);
                    let rows = std::mem::take(&mut column.rows);
                    let odd = not_finite(&values, &rows);
                    BatchColumn {
                        path: column.path.clone(),
                        values,
                        rows,
                        odd,
                    }
                })
                .collect();
            result.batches.push(ChannelBatch {
                channel: self.index,
                times: std::mem::replace(&mut self.times, empty(&mut spare.times, rows)),
                stamps: self
                    .rows
                    .take_stamps(|length| empty(&mut spare.times, length)),
                columns,
                absent: self.rows.absent.some().collect(),
                long: (self.rows.long.some())
                    .chain(self.rows.long_types.some())
                    .collect(),
                names: self.rows.names.take_new(),
                trailing: self.rows.trailing,
                remark: self.rows.remark.take(),
                twice: self.rows.twice.take(),
            });
        }
        self.rows.clear();
    }
}

/// Counts values that are not finite.
fn not_finite(values: &[f64], rows: &[u32]) -> Option<(u64, u32)> {
    // v · 0 is zero for what is finite and NaN for the rest: sums in lanes, which the compiler makes quick.
    let mut lanes = [0.0f64; 8];
    let (whole, rest) = values.as_chunks::<8>();
    for chunk in whole {
        for (lane, value) in lanes.iter_mut().zip(chunk) {
            *lane += value * 0.0;
        }
    }
    let sum: f64 = lanes.iter().sum::<f64>() + rest.iter().map(|value| value * 0.0).sum::<f64>();
    if sum == 0.0 {
        return None;
    }
    let first = values.iter().position(|value| !value.is_finite())?;
    let count = values.iter().filter(|value| !value.is_finite()).count() as u64;
    // OK because rows are counted in u32.
    Some((count, rows.get(first).copied().unwrap_or(first as u32)))
}

/// Records one after the other, as opcode and body, up to where none fits. No record begins with a zero: such bytes are stepped over.
pub(super) struct Records<'a> {
    /// What is left.
    pub rest: &'a [u8],
    /// There were zeros where a record should begin.
    pub zeros: bool,
}

impl<'a> Records<'a> {
    pub fn new(rest: &'a [u8]) -> Self {
        Records { rest, zeros: false }
    }
}

impl<'a> Iterator for Records<'a> {
    type Item = (u8, &'a [u8]);

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        if self.rest.first() == Some(&0) {
            self.zeros = true;
            self.rest = &self.rest[chunk::leading_zeros(self.rest)..];
        }
        let (header, rest) = self.rest.split_first_chunk::<9>()?;
        let length = u64::from_le_bytes(std::array::from_fn(|i| header[1 + i]));
        let (body, rest) = rest.split_at_checked(usize::try_from(length).ok()?)?;
        self.rest = rest;
        Some((header[0], body))
    }
}

/// The log times of a chunk as its header says them.
fn chunk_times(body: &[u8]) -> Option<(u64, u64)> {
    chunk_header(body).map(|header| (header.start_time, header.end_time))
}

/// Looks through all blocks for definitions, counts and times, where there is no summary to say so.
pub(super) fn scan(data: &[u8], blocks: &[Block], options: &ReadOptions) -> (Definitions, Tally) {
    let (mut definitions, mut tally) = (Definitions::default(), Tally::default());
    let mut look = |bytes: &[u8]| {
        for (opcode, body) in Records::new(bytes) {
            if opcode != op::MESSAGE {
                definitions.define(opcode, body);
                continue;
            }
            let mut fields = Fields::new(body);
            let (Some(id), Some(_), Some(time)) = (fields.u16(), fields.u32(), fields.u64()) else {
                continue;
            };
            *tally.per_channel.entry(id).or_default() += 1;
            if i64::try_from(time).is_ok() {
                tally.start = Some(tally.start.map_or(time, |start| start.min(time)));
                tally.end = Some(tally.end.map_or(time, |end| end.max(time)));
                tally.early.see(time);
            }
        }
    };
    let mut unpacker = Unpacker::new();
    for block in blocks {
        chunk::records(data, block, options, &mut unpacker, &mut look);
    }
    (definitions, tally)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::write::{RawChannel, RecordingWriter, WriterOptions};

    /// So many channels of one kind, each with so many messages.
    fn alike<'m>(
        topics: usize,
        kind: &RawChannel<'_>,
        message: impl Fn(i64) -> &'m [u8],
        times: i64,
    ) -> Recording {
        let path = tempfile::NamedTempFile::new().expect("makes a file");
        let options = WriterOptions::default();
        let mut writer = RecordingWriter::create(path.path(), &options).expect("begins");
        for topic in 0..topics {
            let topic = &format!("/{topic}");
            let id = writer.raw_channel(&RawChannel { topic, ..*kind });
            let id = id.expect("opens");
            for t_ns in 0..times {
                writer.message(id, t_ns, message(t_ns)).expect("writes");
            }
        }
        writer.finish().expect("finishes");
        Recording::open(path.path(), &ReadOptions::default()).expect("opens")
    }

    const JSON: RawChannel<'static> = RawChannel {
        topic: "",
        message_encoding: "json",
        schema_name: "",
        schema_encoding: "",
        schema_data: b"",
        metadata: &BTreeMap::new(),
    };

    /// Each of the channels remembers less than is allowed, all of them together would not; what they give is whole.
    #[test]
    fn channels_together_remember_no_more_than_one_may() {
        let line = format!("[{}]", vec!["1"; 64].join(","));
        let message = format!("[{}]", vec![line; 64].join(","));
        let recording = alike(20, &JSON, |_| message.as_bytes(), 2);
        let mut worker = Worker::new(&recording, &|_| true);
        let mut values = 0;
        for block in &recording.container.blocks {
            let result = worker.block(block);
            let columns = result.batches.iter().flat_map(|batch| &batch.columns);
            values += columns.map(|column| column.values.len()).sum::<usize>();
            let places = worker.channels.iter().flatten().map(|c| c.rows.places);
            let places: usize = places.sum();
            assert!(places <= MAX_PLACES && places == worker.places, "{places}");
            let columns = worker.channels.iter().flatten();
            let columns: usize = columns.map(|c| c.remembers()).sum();
            assert_eq!(columns, worker.columns);
        }
        assert_eq!(values, 20 * 2 * 64 * 64);
    }

    /// Messages without a byte stand for a number in each of their fields: they are given out before they fill the memory.
    #[test]
    fn what_is_left_out_of_messages_does_not_fill_the_memory() {
        use prost::Message as _;
        use prost_types::field_descriptor_proto::{Label, Type};
        use prost_types::{
            DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet,
        };
        const FIELDS: usize = 4000;
        let field = |number: i32| FieldDescriptorProto {
            name: Some(format!("f{number}")),
            number: Some(number),
            label: Some(Label::Optional.into()),
            r#type: Some(Type::Double.into()),
            ..FieldDescriptorProto::default()
        };
        let message = DescriptorProto {
            name: Some("M".to_owned()),
            field: (1..=FIELDS as i32).map(field).collect(),
            ..DescriptorProto::default()
        };
        let file = FileDescriptorProto {
            name: Some("m.proto".to_owned()),
            package: Some("p".to_owned()),
            message_type: vec![message],
            syntax: Some("proto3".to_owned()),
            ..FileDescriptorProto::default()
        };
        let set = FileDescriptorSet { file: vec![file] }.encode_to_vec();
        let kind = RawChannel {
            message_encoding: "protobuf",
            schema_name: "p.M",
            schema_encoding: "protobuf",
            schema_data: &set,
            ..JSON
        };
        // The last field as 1.5; every third one is cut off.
        let given = [&[0x81, 0xfa, 0x01][..], &1.5f64.to_le_bytes()].concat();
        let kinds = [&given[..], &[], &given[..5]];
        let recording = alike(2, &kind, |k| kinds[k as usize % 3], 2250);
        let [block] = &recording.container.blocks[..] else {
            panic!("one chunk holds all");
        };
        let mut worker = Worker::new(&recording, &|_| true);
        assert!(worker.block(block).large);
        let (mut parts, mut failed, mut times, mut sum) = (0, 0, [const { Vec::new() }; 2], 0.0);
        worker.large(block, &mut |result| {
            assert!(result.bytes() <= 8 * (MOST_VALUES + FIELDS) + 8 * 2250);
            parts += 1;
            failed += result.troubles.iter().map(|t| t.count).sum::<u64>();
            for batch in &result.batches {
                times[batch.channel].extend_from_slice(&batch.times);
                assert_eq!(batch.columns.len(), FIELDS);
                for column in &batch.columns {
                    assert_eq!(
                        (column.values.len(), column.rows.len()),
                        (batch.times.len(), 0)
                    );
                    sum += column.values.iter().sum::<f64>();
                }
            }
        });
        let kept: Vec<i64> = (0..2250).filter(|k| k % 3 < 2).collect();
        assert!(times == [kept.clone(), kept]);
        assert_eq!((parts, failed, sum), (3, 1500, 2.0 * 750.0 * 1.5));
    }

    /// Text gives no columns, yet what is known of its fields takes memory too.
    #[test]
    fn fields_that_give_no_columns_count() {
        let schema: String = (0..30_000).map(|k| format!("string s{k}\n")).collect();
        let kind = RawChannel {
            message_encoding: "cdr",
            schema_name: "p/msg/Text",
            schema_encoding: "ros2msg",
            schema_data: schema.as_bytes(),
            ..JSON
        };
        let recording = alike(60, &kind, |_| &[0, 1, 0, 0], 1);
        let mut worker = Worker::new(&recording, &|_| true);
        for block in &recording.container.blocks {
            worker.block(block);
        }
        let kept = worker.channels.iter().flatten();
        let remembered: usize = kept.clone().map(|c| c.remembers()).sum();
        assert!(remembered <= MOST_COLUMNS && remembered == worker.columns);
        assert!((5..30).contains(&kept.count()), "{remembered}");
    }
}

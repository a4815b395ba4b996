//! Messages as they are in the file, undecoded.

use super::{
    Recording,
    block::Records,
    chunk::{self, Unpacker},
    container::{Block, begun_chunk_header, op},
};

/// A message as it is in the file.
#[derive(Clone, Copy, Debug)]
pub struct RawMessage<'a> {
    /// Index into [`Info::channels`](super::Info::channels).
    pub channel: usize,
    /// Topic.
    pub topic: &'a str,
    /// Sequence number.
    pub sequence: u32,
    /// Log time, ns.
    pub log_time_ns: i64,
    /// Publish time as it stands there, ns.
    pub publish_time_ns: u64,
    /// The encoded message.
    pub data: &'a [u8],
}

impl<'a> RawMessage<'a> {
    /// Out of a record's body; `None` where it does not fit, its channel is unknown or its time cannot be held.
    fn read(recording: &'a Recording, body: &'a [u8]) -> Option<Self> {
        let (header, data) = body.split_first_chunk::<22>()?;
        let channel = recording.by_id[usize::from(u16::from_le_bytes([header[0], header[1]]))]?;
        let time = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| header[at + i]));
        Some(RawMessage {
            channel,
            topic: &recording.info.channels[channel].topic,
            sequence: u32::from_le_bytes(std::array::from_fn(|i| header[2 + i])),
            log_time_ns: i64::try_from(time(6)).ok()?,
            publish_time_ns: time(14),
            data,
        })
    }
}

/// The messages of a recording, stretch after stretch of the file.
pub(crate) struct RawMessages<'a> {
    recording: &'a Recording,
    /// What is left.
    blocks: &'a [Block],
    unpacker: Unpacker,
}

impl<'a> RawMessages<'a> {
    /// All of them.
    pub fn of(recording: &'a Recording) -> Self {
        RawMessages {
            recording,
            blocks: &recording.container.blocks,
            unpacker: Unpacker::new(),
        }
    }

    /// When the next stretch begins by what the file says there, ns; `None` behind the last one.
    pub fn next_ns(&self) -> Option<u64> {
        let block = self.blocks.first()?;
        let bytes = &self.recording.data[block.range().clone()];
        Some(match block {
            Block::Chunk { .. } | Block::CutChunk(_) => {
                begun_chunk_header(bytes).map_or(0, |(header, _)| header.start_time)
            }
            Block::Loose(_) => Records::new(bytes)
                .filter(|(opcode, _)| *opcode == op::MESSAGE)
                .find_map(|(_, body)| RawMessage::read(self.recording, body))
                .map_or(0, |message| message.log_time_ns.cast_unsigned()),
        })
    }

    /// Bytes of file that are left.
    pub fn bytes_left(&self) -> u64 {
        self.blocks
            .iter()
            .map(|block| block.range().len() as u64)
            .sum()
    }

    /// Gives the messages of the next stretch, and how many bytes of file it takes; `None` behind the last one. A damaged chunk is left
    /// out, as `stream` says it is.
    pub fn give(&mut self, sink: &mut dyn FnMut(&RawMessage<'_>)) -> Option<u64> {
        let (block, rest) = self.blocks.split_first()?;
        self.blocks = rest;
        let recording = self.recording;
        let mut each = |bytes: &[u8]| {
            Records::new(bytes)
                .filter(|(opcode, _)| *opcode == op::MESSAGE)
                .filter_map(|(_, body)| RawMessage::read(recording, body))
                .for_each(|message| sink(&message));
        };
        let (data, options) = (&recording.data, &recording.options);
        chunk::records(data, block, options, &mut self.unpacker, &mut each);
        data.forget(block.range());
        Some(block.range().len() as u64)
    }
}

//! Writing a recording: chunked, compressed, checked, whole or not at all.
//!
//! To a file, the bytes go to a temporary file beside it, which [`RecordingWriter::finish`] renames; until then the final name does
//! not exist. A program that is killed leaves at most the temporary file, whose closed chunks can be read. To a stream, nothing
//! is ever sought.
//!
//! The bytes depend on what is written alone: chunks close by size and by the recording's own clock, not by the wall's, and whether a thread
//! of its own compresses them changes nothing.

mod beside;
mod container;
mod options;

use std::{
    collections::BTreeMap,
    io::{self, BufWriter, Write},
    path::Path,
};

use mcap::records::MessageHeader;

use crate::whole::Sink;
use crate::{
    cdr,
    read::{ChannelInfo, RawAttachment, RawMessage},
    topics::MessageKind,
};
use beside::{Batch, Beside};
use container::Container;
pub use options::WriterOptions;

/// A message larger than this is refused.
const MAX_MESSAGE_BYTES: usize = 256 << 20;

/// What a stream is called.
const STDOUT: &str = "standard output";

/// Why a recording could not be written. Nothing is left under the final name.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The file or stream took no more bytes, or could not be made.
    #[error("{target}: cannot be written: {cause}{}", if target == STDOUT { "" } else { "; no file of that name was made or changed" })]
    Io {
        /// The path, or `standard output`.
        target: String,
        /// What the system said.
        cause: io::Error,
    },
    /// The container format cannot hold what was asked for.
    #[error("{target}: cannot be written: {cause}")]
    Format {
        /// The path, or `standard output`.
        target: String,
        /// What the format's library said.
        cause: mcap::McapError,
    },
    /// A message's time cannot be stored.
    #[error("{target}: a message on {topic} has the time {t_ns} ns; times must not be negative")]
    NegativeTime {
        /// The path, or `standard output`.
        target: String,
        /// The message's topic.
        topic: String,
        /// The time.
        t_ns: i64,
    },
    /// A message is too large.
    #[error(
        "{target}: a message on {topic} has {bytes} bytes; at most {MAX_MESSAGE_BYTES} can be written"
    )]
    TooLarge {
        /// The path, or `standard output`.
        target: String,
        /// The message's topic.
        topic: String,
        /// Its size.
        bytes: usize,
    },
}

impl WriteError {
    /// Whether a reader went away early, as in `… | head -c 10`: whoever wrote need not complain.
    pub fn reader_left(&self) -> bool {
        matches!(self, WriteError::Io { cause, .. } if cause.kind() == io::ErrorKind::BrokenPipe)
    }
}

/// Anything that can be the content of a message.
pub trait Encode {
    /// Appends the message's bytes.
    fn encode_into(&self, out: &mut Vec<u8>);
}

impl<M: prost::Message> Encode for M {
    fn encode_into(&self, out: &mut Vec<u8>) {
        out.reserve(self.encoded_len());
        self.encode_raw(out);
    }
}

macro_rules! encode_cdr {
    ($($name:ident),*) => {$(
        impl Encode for cdr::$name {
            fn encode_into(&self, out: &mut Vec<u8>) {
                cdr::Cdr::cdr(self, &mut cdr::Encoder::new(out));
            }
        }
    )*};
}
encode_cdr!(
    Imu,
    JointState,
    MagneticField,
    TfMessage,
    StringMessage,
    PoseStamped,
    Header,
    Float64,
    Log
);

/// Bytes that are a message already.
impl Encode for [u8] {
    fn encode_into(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(self);
    }
}

/// A channel of a recording that is being written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelId(usize);

/// A channel that is defined by its parts: for copying recordings and for encodings of others.
#[derive(Clone, Copy, Debug)]
pub struct RawChannel<'a> {
    /// Name of the topic.
    pub topic: &'a str,
    /// Encoding of the messages.
    pub message_encoding: &'a str,
    /// Name of the schema; without name, `schema_encoding` and data the channel has no schema.
    pub schema_name: &'a str,
    /// Encoding of the schema.
    pub schema_encoding: &'a str,
    /// The schema.
    pub schema_data: &'a [u8],
    /// Further properties.
    pub metadata: &'a BTreeMap<String, String>,
}

impl<'a> From<&'a ChannelInfo> for RawChannel<'a> {
    /// The same channel again.
    fn from(c: &'a ChannelInfo) -> Self {
        Self {
            topic: &c.topic,
            message_encoding: &c.encoding,
            schema_name: &c.schema,
            schema_encoding: &c.schema_encoding,
            schema_data: &c.schema_data,
            metadata: &c.metadata,
        }
    }
}

struct Channel {
    id: u16,
    topic: String,
    sequence: u32,
}

/// A recording that is being written.
pub struct RecordingWriter {
    /// `None` while a thread has it.
    container: Option<Box<Container>>,
    beside: Option<Beside>,
    own_thread: bool,
    /// What has not been handed over yet.
    batch: Batch,
    target: String,
    channels: Vec<Channel>,
}

impl RecordingWriter {
    /// Begins a recording that will be `path` once [`finish`](Self::finish) is called, and not before.
    ///
    /// Something at `path` that is no regular file (a pipe, a device) is written to directly.
    pub fn create(path: &Path, options: &WriterOptions) -> Result<Self, WriteError> {
        let target = path.display().to_string();
        match Sink::beside(path) {
            Ok(sink) => Self::begin(sink, target, options),
            Err(cause) => Err(WriteError::Io { target, cause }),
        }
    }

    /// Begins a recording where a user asked for it: `-` is standard output, anything else a path for [`create`](Self::create).
    pub fn to(out: &Path, options: &WriterOptions) -> Result<Self, WriteError> {
        match out.as_os_str() == "-" {
            true => Self::to_stream(io::stdout(), options),
            false => Self::create(out, options),
        }
    }

    /// Begins a recording on a stream such as standard output; nothing is sought.
    pub fn to_stream(
        stream: impl Write + Send + 'static,
        options: &WriterOptions,
    ) -> Result<Self, WriteError> {
        Self::begin(
            Sink::Stream(BufWriter::with_capacity(1 << 16, Box::new(stream))),
            STDOUT.to_owned(),
            options,
        )
    }

    fn begin(sink: Sink, target: String, options: &WriterOptions) -> Result<Self, WriteError> {
        let container = Container::begin(sink, options).map_err(|error| failed(&target, error))?;
        Ok(RecordingWriter {
            container: Some(Box::new(container)),
            beside: None,
            own_thread: options.own_thread,
            batch: Batch::default(),
            target,
            channels: Vec::new(),
        })
    }

    /// Sends what is waiting on its way.
    fn hand_over(&mut self) -> Result<(), WriteError> {
        if self.own_thread && self.beside.is_none() {
            let container = self.container.take().expect("no thread has it");
            match Beside::start(container) {
                Ok(beside) => self.beside = Some(beside),
                Err(container) => self.container = Some(container),
            }
        }
        match &self.beside {
            Some(beside) if beside.take(&mut self.batch) => Ok(()),
            _ => self.at_hand().map(drop),
        }
    }

    /// The container, with everything in it that has been said so far.
    fn at_hand(&mut self) -> Result<&mut Container, WriteError> {
        let mut outcome = Ok(());
        if let Some(beside) = self.beside.take() {
            let (container, ended) = beside.end();
            self.container = Some(container);
            outcome = ended;
        }
        let container = self.container.as_mut().expect("no thread has it");
        match outcome.and_then(|()| self.batch.write(container)) {
            Ok(()) => Ok(container),
            Err(error) => Err(failed(&self.target, error)),
        }
    }

    /// Adds a metadata record.
    pub fn metadata(
        &mut self,
        name: &str,
        values: &BTreeMap<String, String>,
    ) -> Result<(), WriteError> {
        let record = mcap::records::Metadata {
            name: name.to_owned(),
            metadata: values.clone(),
        };
        let container = self.at_hand()?;
        container.chunk_start_ns = None;
        let result = container.writer.write_metadata(&record);
        result.map_err(|error| failed(&self.target, error))
    }

    /// Attaches a file, without times.
    pub fn attachment(
        &mut self,
        name: &str,
        media_type: &str,
        bytes: &[u8],
    ) -> Result<(), WriteError> {
        self.copy_attachment(&RawAttachment {
            name,
            media_type,
            log_time_ns: 0,
            create_time_ns: 0,
            data: bytes,
        })
    }

    /// Attaches a file with the times that it has.
    pub fn copy_attachment(&mut self, attachment: &RawAttachment<'_>) -> Result<(), WriteError> {
        let record = mcap::Attachment {
            log_time: attachment.log_time_ns,
            create_time: attachment.create_time_ns,
            name: attachment.name.to_owned(),
            media_type: attachment.media_type.to_owned(),
            data: attachment.data.into(),
        };
        let container = self.at_hand()?;
        container.chunk_start_ns = None;
        // The library wants the chunk closed before an attachment.
        let flushed = container.writer.flush();
        let result = flushed.and_then(|()| container.writer.attach(&record));
        result.map_err(|error| failed(&self.target, error))
    }

    /// Opens a channel for messages of a known kind.
    pub fn channel(&mut self, topic: &str, kind: MessageKind) -> Result<ChannelId, WriteError> {
        self.raw_channel(&RawChannel {
            topic,
            message_encoding: kind.encoding(),
            schema_name: kind.schema(),
            schema_encoding: kind.schema_encoding(),
            schema_data: &kind.schema_data(),
            metadata: &BTreeMap::new(),
        })
    }

    /// Opens a channel that is given by its parts.
    pub fn raw_channel(&mut self, channel: &RawChannel<'_>) -> Result<ChannelId, WriteError> {
        let writer = &mut self.at_hand()?.writer;
        let parts = [channel.schema_name, channel.schema_encoding];
        let schema = if parts == ["", ""] && channel.schema_data.is_empty() {
            Ok(0)
        } else {
            writer.add_schema(
                channel.schema_name,
                channel.schema_encoding,
                channel.schema_data,
            )
        };
        let id = schema
            .and_then(|schema| {
                writer.add_channel(
                    schema,
                    channel.topic,
                    channel.message_encoding,
                    channel.metadata,
                )
            })
            .map_err(|error| failed(&self.target, error))?;
        self.channels.push(Channel {
            id,
            topic: channel.topic.to_owned(),
            sequence: 0,
        });
        Ok(ChannelId(self.channels.len() - 1))
    }

    /// Writes a message: log time and publish time are `t_ns`, the sequence number counts per channel from 0.
    pub fn message<M: Encode + ?Sized>(
        &mut self,
        channel: ChannelId,
        t_ns: i64,
        message: &M,
    ) -> Result<(), WriteError> {
        let sequence = self.channels[channel.0].sequence;
        self.put(channel, t_ns, t_ns.cast_unsigned(), sequence, message)?;
        self.channels[channel.0].sequence = sequence.wrapping_add(1);
        Ok(())
    }

    /// Writes a message of another recording as it is there.
    pub fn copy(&mut self, channel: ChannelId, raw: &RawMessage<'_>) -> Result<(), WriteError> {
        let (t_ns, publish_ns) = (raw.log_time_ns, raw.publish_time_ns);
        self.put(channel, t_ns, publish_ns, raw.sequence, raw.data)
    }

    fn put<M: Encode + ?Sized>(
        &mut self,
        channel: ChannelId,
        t_ns: i64,
        publish_time: u64,
        sequence: u32,
        message: &M,
    ) -> Result<(), WriteError> {
        let channel = &self.channels[channel.0];
        let begin = self.batch.end();
        self.batch.bytes.truncate(begin);
        message.encode_into(&mut self.batch.bytes);
        let Ok(log_time) = u64::try_from(t_ns) else {
            return Err(WriteError::NegativeTime {
                target: self.target.clone(),
                topic: channel.topic.clone(),
                t_ns,
            });
        };
        let bytes = self.batch.bytes.len() - begin;
        if bytes > MAX_MESSAGE_BYTES {
            let (target, topic) = (self.target.clone(), channel.topic.clone());
            return Err(WriteError::TooLarge {
                target,
                topic,
                bytes,
            });
        }
        self.batch.close(MessageHeader {
            channel_id: channel.id,
            sequence,
            log_time,
            publish_time,
        });
        if !self.own_thread || self.batch.is_full() {
            self.hand_over()?;
        }
        Ok(())
    }

    /// Writes indexes and summary and gives the file its name.
    pub fn finish(mut self) -> Result<(), WriteError> {
        let result = self.at_hand()?.writer.finish();
        let (target, container) = (self.target, self.container);
        result.map_err(|error| failed(&target, error))?;
        let container = container.expect("no thread has it");
        let sink = container.writer.into_inner().into_inner();
        sink.commit()
            .map_err(|cause| WriteError::Io { target, cause })
    }
}

fn failed(target: &str, error: mcap::McapError) -> WriteError {
    let target = target.to_owned();
    match error {
        mcap::McapError::Io(cause) => WriteError::Io { target, cause },
        cause => WriteError::Format { target, cause },
    }
}

//! Reading any MCAP: what is in it, its numbers, and every oddity.
//!
//! [`Recording::open`] walks over the file; [`Recording::stream`] decodes it chunk by chunk in bounded memory, in the order of the
//! file whatever the number of threads; [`Recording::signals`] collects what is wanted. Damage costs the chunk or message that it
//! hits and is said in a [`Finding`]; what is whole is used.

mod block;
mod cdr;
mod chunk;
mod clock;
mod collect;
mod container;
mod decode;
mod decoders;
mod descriptors;
mod early;
mod idl;
mod json;
mod layout;
mod names;
mod protobuf;
mod raw;
mod ros1;
mod ros2msg;
mod rows;
mod stream;
mod taker;
mod types;
mod watch;

use std::{
    collections::BTreeMap,
    fs::File,
    io::Read,
    ops::Range,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
};

use crate::foreign;
use crate::text::word;
use container::{Container, Damage, Definitions, Statistics};
use descriptors::Pools;
use early::Early;

pub use container::ends_whole;
pub use decoders::supported;
pub use raw::RawMessage;
pub(crate) use raw::RawMessages;
pub use taker::{Batch, Column};

use crate::{Finding, Kind, Signal};

/// Limits and habits of the reader.
#[derive(Clone, Debug)]
pub struct ReadOptions {
    /// A chunk that claims more bytes than this, unpacked, is left out. Chunks are read in pieces, so this bounds time, not memory.
    pub max_chunk_bytes: u64,
    /// A message longer than this in a large chunk is left out.
    pub max_message_bytes: u64,
    /// A sequence becomes signals only where it has at most so many items; in the project's own messages, whose lists are people, up to 4096.
    pub max_items: usize,
    /// Items of lists that carry a name, as the frames of `/tf` and the joints of `/joint_states` do, are called by it and not by their place:
    /// `transforms[base_link]`.
    pub by_name: bool,
    /// Threads that unpack and decode, the caller's included; 0 asks the machine.
    pub threads: usize,
    /// Whether these limits are options of the program, `--max-items` and so on: then what is said of one names it.
    pub limits_are_options: bool,
}

impl ReadOptions {
    /// A limit, as a sentence has it.
    pub(crate) fn limit(&self, option: &str) -> String {
        match self.limits_are_options {
            true => format!("the limit {option}"),
            false => "the limit".into(),
        }
    }
}

/// Lists in the project's own messages hold a value for each carrier.
const OWN_ITEMS: usize = 4096;

impl Default for ReadOptions {
    fn default() -> Self {
        ReadOptions {
            max_chunk_bytes: 4 << 30,
            max_message_bytes: 256 << 20,
            max_items: 64,
            by_name: false,
            threads: 0,
            limits_are_options: false,
        }
    }
}

/// What standard input is called.
pub const STDIN: &str = "standard input";

/// Why a file could not be read at all. Damage inside an MCAP is no such reason.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The system does not let us.
    #[error("{name}: cannot be read: {cause}")]
    Io {
        /// The file.
        name: String,
        /// What the system said.
        cause: std::io::Error,
    },
    /// There is nothing in it.
    #[error("{name}: is empty; expected an MCAP recording")]
    Empty {
        /// The file.
        name: String,
    },
    /// It is something else.
    #[error("{name}: is not an MCAP recording {found}")]
    NotMcap {
        /// The file.
        name: String,
        /// What it is instead, as far as that can be told, and what to do.
        found: String,
    },
}

/// A message may have been taken so long before the first one was logged; what is dated further before [`Info::start_ns`] belongs to no time of the recording.
pub const TAKEN_BEFORE_NS: i64 = 60_000_000_000;

/// What is in a recording.
#[derive(Clone, Debug, Default)]
pub struct Info {
    /// The profile that the header names.
    pub profile: String,
    /// The software that wrote it.
    pub library: String,
    /// The channels, by id.
    pub channels: Vec<ChannelInfo>,
    /// Metadata by name: of several records of one name all keys, with their last values.
    pub metadata: BTreeMap<String, BTreeMap<String, String>>,
    /// Names and media types of the attachments, with their sizes in bytes.
    pub attachments: Vec<AttachmentInfo>,
    /// Log time from which seconds are counted, ns: that of the earliest message, but for a few that are dated long before all others.
    pub start_ns: i64,
    /// Log time of the earliest message, ns.
    pub earliest_ns: i64,
    /// How many messages lie before `start_ns`.
    pub early: u64,
    /// Log time of the latest message, ns.
    pub end_ns: i64,
    /// How many messages there are.
    pub messages: u64,
    /// Whether the summary was missing or could not be used, so that the whole file was looked through.
    pub salvaged: bool,
    /// Messages that are known to be lost; [`Recording::skipped_messages`] knows more after reading.
    pub skipped_messages: u64,
    /// Damage of the container, one line each.
    pub warnings: Vec<String>,
}

/// One channel.
#[derive(Clone, Debug, Default)]
pub struct ChannelInfo {
    /// Its id in the file.
    pub id: u16,
    /// Topic.
    pub topic: String,
    /// Name of the schema, empty without one.
    pub schema: String,
    /// Encoding of the messages.
    pub encoding: String,
    /// Encoding of the schema, empty without one.
    pub schema_encoding: String,
    /// The schema itself, which channels share.
    pub schema_data: Arc<[u8]>,
    /// Further properties.
    pub metadata: BTreeMap<String, String>,
    /// How many messages it has.
    pub messages: u64,
}

/// One attachment.
#[derive(Clone, Debug, Default)]
pub struct AttachmentInfo {
    /// Name.
    pub name: String,
    /// Media type.
    pub media_type: String,
    /// Size in bytes.
    pub bytes: u64,
}

/// An attachment as it is in the file.
#[derive(Clone, Copy, Debug)]
pub struct RawAttachment<'a> {
    /// Name.
    pub name: &'a str,
    /// Media type.
    pub media_type: &'a str,
    /// When it was attached, ns.
    pub log_time_ns: u64,
    /// When it was made, ns; 0 where that is not known.
    pub create_time_ns: u64,
    /// The content.
    pub data: &'a [u8],
}

/// The file's bytes.
enum Data {
    Mapped(memmap2::Mmap),
    Held(Vec<u8>),
}

impl Data {
    /// Gives back the memory that a stretch of the file took when it was read; it is read from the file again when needed. Without
    /// this, a file larger than the memory that a program may have would count as memory of this program.
    fn forget(&self, stretch: &Range<usize>) {
        #[cfg(unix)]
        if let Data::Mapped(map) = self {
            // SAFETY: nothing ever writes to the map, so that its pages and those of the file are the same bytes.
            #[allow(unsafe_code)]
            let advised = unsafe {
                map.unchecked_advise_range(
                    memmap2::UncheckedAdvice::DontNeed,
                    stretch.start,
                    stretch.len(),
                )
            };
            // A system that does not take the advice keeps the pages: nothing is wrong then.
            let _ = advised;
        }
    }
}

impl std::ops::Deref for Data {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Data::Mapped(map) => map,
            Data::Held(bytes) => bytes,
        }
    }
}

/// An open recording.
pub struct Recording {
    data: Data,
    options: ReadOptions,
    container: Container,
    info: Info,
    /// Index into the channels of [`Info`] by channel id.
    by_id: Vec<Option<usize>>,
    /// Schemas and channels as they are used.
    definitions: Definitions,
    /// They come from a look through all blocks, not from the summary.
    searched: bool,
    /// What the summary counts.
    promised: Option<Statistics>,
    skipped: AtomicU64,
    pools: Pools,
    /// How the last reading contradicted the summary.
    contradictions: Mutex<Vec<Finding>>,
    /// How the summary was contradicted that is no longer trusted.
    distrusted: Vec<Finding>,
}

impl std::fmt::Debug for Recording {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recording")
            .field("info", &self.info)
            .finish_non_exhaustive()
    }
}

impl Recording {
    /// Opens a file. It is mapped, not read, so it may be larger than the memory.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        let name = path.display().to_string();
        let io = |cause| ReadError::Io {
            name: name.clone(),
            cause,
        };
        let mut file = File::open(path).map_err(io)?;
        let kind = file.metadata().map_err(io)?;
        if kind.is_dir() {
            return Err(io(std::io::Error::new(
                std::io::ErrorKind::IsADirectory,
                folder(path),
            )));
        }
        let data = if kind.is_file() && kind.len() > 0 {
            // SAFETY: the map is only read. Another program that shortens the file meanwhile would end this one by a signal, one
            // that writes into it could change bytes under us; both are checked values to this crate, never lengths to trust.
            #[allow(unsafe_code)]
            let map = unsafe { memmap2::Mmap::map(&file) }.map_err(io)?;
            Data::Mapped(map)
        } else {
            return Self::from_stream(&mut file, &name, options);
        };
        Self::begin(data, &name, options)
    }

    /// Reads a stream, such as standard input, to its end; `name` is what errors call it. One that does not begin as a recording does is not
    /// read any further: it may have no end.
    pub fn from_stream(
        stream: &mut dyn Read,
        name: &str,
        options: &ReadOptions,
    ) -> Result<Self, ReadError> {
        let io = |cause| ReadError::Io {
            name: name.to_owned(),
            cause,
        };
        let mut bytes = Vec::new();
        let head = container::HEAD_BYTES as u64;
        stream.take(head).read_to_end(&mut bytes).map_err(io)?;
        if !bytes.is_empty() && !container::begins(&bytes) {
            return Err(not_mcap(name, &bytes));
        }
        stream.read_to_end(&mut bytes).map_err(io)?;
        Self::begin(Data::Held(bytes), name, options)
    }

    /// Opens bytes in memory, such as what came through standard input.
    pub fn from_bytes(bytes: Vec<u8>, options: &ReadOptions) -> Result<Self, ReadError> {
        Self::begin(Data::Held(bytes), STDIN, options)
    }

    fn begin(data: Data, name: &str, options: &ReadOptions) -> Result<Self, ReadError> {
        if data.is_empty() {
            return Err(ReadError::Empty {
                name: name.to_owned(),
            });
        }
        let Some(container) = container::walk(&data, &|stretch| data.forget(stretch)) else {
            return Err(not_mcap(name, &data));
        };
        let trusted = trusted(&container);
        Ok(Self::known(data, container, trusted, options))
    }

    /// What the walk found, with the summary's counts where they are `trusted`, or else after a look through all blocks.
    fn known(
        data: Data,
        mut container: Container,
        trusted: Option<Tally>,
        options: &ReadOptions,
    ) -> Self {
        let summary = container.summary.take();
        let promised = (summary.as_ref()).and_then(|(_, statistics)| statistics.clone());
        let searched = trusted.is_none();
        let (definitions, tally) = match (trusted, summary) {
            (Some(mut tally), Some((definitions, _))) => {
                if early::may_be(&data, &container.blocks, tally.start, tally.end) {
                    tally.early = block::scan(&data, &container.blocks, options).1.early;
                }
                (definitions, tally)
            }
            (_, summary) => {
                let (mut definitions, tally) = block::scan(&data, &container.blocks, options);
                if let Some((others, _)) = summary {
                    definitions.merge(others);
                }
                (definitions, tally)
            }
        };
        if definitions.broken > 0 {
            let text = format!(
                "{} schema or channel records cannot be read",
                definitions.broken
            );
            container
                .damage
                .push((Kind::BadRecord, definitions.broken, text));
        }
        let info = info(&container, &definitions, &tally, !searched);
        let mut by_id = vec![None; 1 << 16];
        for (index, channel) in info.channels.iter().enumerate() {
            by_id[usize::from(channel.id)] = Some(index);
        }
        Recording {
            data,
            options: options.clone(),
            container,
            definitions,
            searched,
            info,
            by_id,
            promised,
            skipped: AtomicU64::new(0),
            pools: Pools::default(),
            contradictions: Mutex::default(),
            distrusted: Vec::new(),
        }
    }

    /// Whether the last [`stream`](Self::stream) or [`signals`](Self::signals) found other definitions, counts or times than the
    /// summary gives: then numbers may have come under wrong names, or not at all, and [`searched`](Self::searched) has to be read.
    pub fn contradicts_its_summary(&self) -> bool {
        !self.lock_contradictions().is_empty()
    }

    fn lock_contradictions(&self) -> MutexGuard<'_, Vec<Finding>> {
        self.contradictions
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// The same recording, looked through from end to end instead of trusting its summary.
    pub fn searched(self) -> Self {
        if self.searched {
            return self;
        }
        let distrusted = std::mem::take(&mut *self.lock_contradictions());
        let Recording {
            data,
            options,
            mut container,
            definitions,
            ..
        } = self;
        container.summary = Some((definitions, None));
        let mut recording = Self::known(data, container, None, &options);
        recording.distrusted = distrusted;
        recording
    }

    /// What is in the recording.
    pub fn info(&self) -> &Info {
        &self.info
    }

    /// All metadata records, in the order of the file.
    pub fn metadata_records(&self) -> &[(String, BTreeMap<String, String>)] {
        &self.container.metadata
    }

    /// All attachments, in the order of the file.
    pub fn attachments(&self) -> impl Iterator<Item = RawAttachment<'_>> {
        (self.container.attachments.iter()).filter_map(|attachment| {
            Some(RawAttachment {
                name: &attachment.name,
                media_type: &attachment.media_type,
                log_time_ns: attachment.log_time,
                create_time_ns: attachment.create_time,
                data: self.data.get(attachment.data.clone())?,
            })
        })
    }

    /// The content of the first attachment of a name.
    pub fn attachment(&self, name: &str) -> Option<Vec<u8>> {
        let found = self.attachments().find(|found| found.name == name)?;
        Some(found.data.to_vec())
    }

    /// Messages that could not be used, as far as the last [`stream`](Self::stream) or [`signals`](Self::signals) found out.
    pub fn skipped_messages(&self) -> u64 {
        self.skipped.load(Ordering::Relaxed)
    }

    /// Decodes the whole recording: gives one [`Batch`] per channel and chunk, in the order of the file, and returns what was odd.
    ///
    /// `select` says by path (`TOPIC.field.path`) which fields become columns; the others cost next to nothing. The memory
    /// in use does not grow with the file.
    pub fn stream(
        &self,
        select: &(dyn Fn(&str) -> bool + Sync),
        sink: &mut dyn FnMut(&Batch<'_>),
    ) -> Result<Vec<Finding>, ReadError> {
        stream::run(self, select, sink)
    }

    /// Collects signals, each sorted by time, and what was odd.
    pub fn signals(
        &self,
        select: &(dyn Fn(&str) -> bool + Sync),
    ) -> Result<(Vec<Signal>, Vec<Finding>), ReadError> {
        collect::signals(self, select)
    }

    /// Items that a sequence in messages of a type may have to become signals.
    fn most_items(&self, schema: &str) -> usize {
        let own = schema.starts_with("rath.");
        self.options.max_items.max(if own { OWN_ITEMS } else { 0 })
    }

    /// Gives the messages of the topics that `select` wants as they are, in the order of the file; messages of damaged chunks are
    /// left out.
    pub fn messages(
        &self,
        select: &dyn Fn(&str) -> bool,
        sink: &mut dyn FnMut(&RawMessage<'_>),
    ) -> Result<(), ReadError> {
        let channels = &self.info.channels;
        let wanted: Vec<bool> = channels.iter().map(|c| select(&c.topic)).collect();
        let mut each = |message: &RawMessage<'_>| {
            if wanted[message.channel] {
                sink(message);
            }
        };
        let mut messages = RawMessages::of(self);
        while messages.give(&mut each).is_some() {}
        Ok(())
    }

    fn damage(&self) -> &[Damage] {
        &self.container.damage
    }
}

/// The recordings in a folder, not deeper, by name: a bag of ROS 2 is a folder of them.
pub(crate) fn recordings_in(folder: &Path) -> Vec<PathBuf> {
    let entries = folder.read_dir().into_iter().flatten().flatten();
    let mut inside: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|end| end == "mcap"))
        .collect();
    inside.sort();
    inside
}

/// That a folder is one, and what to do with the recordings in it.
fn folder(path: &Path) -> String {
    match &recordings_in(path)[..] {
        [] => "it is a folder".to_owned(),
        [one] => format!("it is a folder; give what is in it: {}", one.display()),
        several => format!(
            "it is a folder; `analyze merge {} --out FILE.mcap` makes one recording of the {} in it",
            word(path),
            several.len()
        ),
    }
}

fn not_mcap(name: &str, data: &[u8]) -> ReadError {
    let found = match foreign::kind(data) {
        Some(kind) => format!("but {kind}"),
        None => {
            let begin = data[..data.len().min(container::MAGIC.len())].escape_ascii();
            format!(
                "(it begins with \"{begin}\"); `analyze ingest` turns logs of other formats into one"
            )
        }
    };
    ReadError::NotMcap {
        name: name.to_owned(),
        found,
    }
}

/// What a look through the file, or its summary, counts.
#[derive(Clone, Default)]
struct Tally {
    per_channel: BTreeMap<u16, u64>,
    start: Option<u64>,
    end: Option<u64>,
    early: Early,
}

/// The summary's counts, if they and its definitions fit what the walk saw.
fn trusted(container: &Container) -> Option<Tally> {
    let sound = container.complete && container.damage.is_empty();
    let (definitions, statistics) = container.summary.as_ref()?;
    let statistics = statistics.as_ref()?;
    let chunks = container
        .blocks
        .iter()
        .filter(|block| matches!(block, container::Block::Chunk { .. }))
        .count() as u64;
    let counted: u64 = statistics
        .per_channel
        .values()
        .fold(0, |sum, &count| sum.saturating_add(count));
    let fits = sound
        && statistics.chunks == chunks
        && statistics.channels == definitions.channels.len() as u64
        && counted == statistics.messages
        && statistics
            .per_channel
            .keys()
            .all(|id| definitions.channels.contains_key(id))
        && definitions.channels.values().all(|channel| {
            channel.schema == 0 || definitions.schemas.contains_key(&channel.schema)
        });
    let any = statistics.messages > 0;
    // Times that cannot be held do not bound those of messages that are read.
    let fits = fits && (!any || i64::try_from(statistics.start.max(statistics.end)).is_ok());
    fits.then(|| Tally {
        per_channel: statistics.per_channel.clone(),
        start: any.then_some(statistics.start),
        end: any.then_some(statistics.end),
        early: Early::default(),
    })
}

fn info(container: &Container, definitions: &Definitions, tally: &Tally, trusted: bool) -> Info {
    let channels = definitions
        .channels
        .iter()
        .map(|(&id, channel)| {
            let schema = definitions.schemas.get(&channel.schema);
            ChannelInfo {
                id,
                topic: channel.topic.clone(),
                schema: schema.map(|schema| schema.name.clone()).unwrap_or_default(),
                encoding: channel.encoding.clone(),
                schema_encoding: schema
                    .map(|schema| schema.encoding.clone())
                    .unwrap_or_default(),
                schema_data: schema.map(|schema| schema.data.clone()).unwrap_or_default(),
                metadata: channel.metadata.clone(),
                messages: tally.per_channel.get(&id).copied().unwrap_or(0),
            }
        })
        .collect();
    let time = |time: Option<u64>| time.and_then(|time| i64::try_from(time).ok()).unwrap_or(0);
    let messages = tally.per_channel.values().sum();
    let early = tally.early.before(messages, tally.end);
    let mut metadata: BTreeMap<String, BTreeMap<String, String>> = BTreeMap::new();
    for (name, values) in &container.metadata {
        let known = metadata.entry(name.clone()).or_default();
        known.extend(values.clone());
    }
    Info {
        profile: container.profile.clone(),
        library: container.library.clone(),
        channels,
        metadata,
        attachments: container
            .attachments
            .iter()
            .map(|attachment| AttachmentInfo {
                name: attachment.name.clone(),
                media_type: attachment.media_type.clone(),
                bytes: attachment.data.len() as u64,
            })
            .collect(),
        start_ns: time(early.map(|(_, start)| start).or(tally.start)),
        earliest_ns: time(tally.start),
        early: early.map_or(0, |(count, _)| count),
        end_ns: time(tally.end),
        messages,
        salvaged: !(trusted || container.complete && container.damage.is_empty()),
        skipped_messages: 0,
        warnings: {
            let damage = container.damage.iter().map(|(_, _, text)| text.clone());
            let conflicts = definitions.conflicts.iter();
            damage
                .chain(conflicts.map(|(topic, text)| match topic.as_str() {
                    "" => text.clone(),
                    topic => format!("{topic}: {text}"),
                }))
                .collect()
        },
    }
}

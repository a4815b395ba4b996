//! Several recordings put together into one: the parts that a recorder cut a bag into, or what several recorders took down of one walk.
//!
//! Everything is taken over as it is. Stretches of the files (chunks) come in the order of the times that they begin at, so that no more than
//! one of each file is unpacked at a time.

use std::{
    cell::OnceCell,
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use crate::{
    Finding, Kind,
    read::{RawMessage, RawMessages, ReadError, ReadOptions, Recording, recordings_in},
    text::{counted, word},
    write::{RawChannel, RecordingWriter, WriteError},
};

/// A recorder may begin a part before the last one ends, by no more than this, ns.
const MOST_OVERLAP_NS: i64 = 1_000_000_000;

/// A longer pause between parts is remarked on, and between messages parts the time in which a topic is held, unless its messages are usually
/// that far apart, ns.
const PAUSE_NS: i64 = 10_000_000_000;

/// A topic's messages are usually no more than so many of its median intervals apart.
const USUAL: i64 = 3;

/// The metadata record that readers go by: of several all keys, with their last values.
const OWN_RECORD: &str = "rath";

/// Why recordings could not be put together. No file is made or changed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MergeError {
    /// One of them cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A folder holds no recording.
    #[error("{folder}: has no recording in it; expected files that end in .mcap")]
    NoneInside {
        /// The folder.
        folder: String,
    },
    /// One of them is given twice.
    #[error("{name}: is given twice; expected each recording once")]
    Twice {
        /// The file.
        name: String,
    },
    /// Two have messages on one topic at one time, which could not be told apart afterwards.
    #[error(
        "{name}: holds {topic} at a time when {other} does, too (for {overlap_s:.1} s); expected parts of one recording one after the other, or \
         recordings of different topics (`--keep-first` takes what two hold from the one given first; `analyze {} {}` compares them)",
        word(.other),
        word(.name)
    )]
    Overlap {
        /// The later one.
        name: String,
        /// The other one.
        other: String,
        /// The topic.
        topic: String,
        /// For how long, s.
        overlap_s: f64,
    },
    /// The recording cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// What becomes of a topic that two hold at one time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shared {
    /// It is an error.
    Refused,
    /// It is taken from the recording given first, and left out of the other as a whole.
    OfFirst,
}

/// One of the recordings.
struct Part {
    name: String,
    recording: Recording,
    losses: Vec<Finding>,
    /// When messages came, by topic, ns: from the first to the last of each stretch without a pause, in order. Found where it is asked for.
    held: OnceCell<BTreeMap<String, Vec<(i64, i64)>>>,
    /// Topics that are left out, and of which recording they are taken.
    left_out: BTreeMap<String, String>,
}

impl Part {
    fn open(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        let mut recording = Recording::open(path, options)?;
        let nothing = |_: &str| false;
        let mut findings = recording.stream(&nothing, &mut |_| {})?;
        if recording.contradicts_its_summary() {
            recording = recording.searched();
            findings = recording.stream(&nothing, &mut |_| {})?;
        }
        // Messages that nobody here can decode are taken over all the same.
        let is_lost =
            |kind: Kind| kind.is_loss() && !matches!(kind, Kind::Undecodable | Kind::BadSchema);
        findings.retain(|finding| is_lost(finding.kind));
        Ok(Part {
            name: path.display().to_string(),
            recording,
            losses: findings,
            held: OnceCell::new(),
            left_out: BTreeMap::new(),
        })
    }

    /// Log times of the first and the last message, ns, but for a few that are dated long before all others; `None` without any.
    fn span_ns(&self) -> Option<(i64, i64)> {
        let info = self.recording.info();
        (info.messages > 0).then_some((info.start_ns, info.end_ns))
    }

    /// Topics with messages that are taken.
    fn topics(&self) -> impl Iterator<Item = &str> {
        let channels = self.recording.info().channels.iter();
        let used = channels.filter(|channel| channel.messages > 0);
        let topics = used.map(|channel| channel.topic.as_str());
        topics.filter(|topic| !self.left_out.contains_key(*topic))
    }

    /// Sees that what this one holds can be told from what one given before it does.
    fn fit(&mut self, before: &Part, shared: Shared) -> Result<(), MergeError> {
        let held: BTreeSet<&str> = before.topics().collect();
        let both = self.topics().filter(|topic| held.contains(topic));
        let both: Vec<String> = both.map(str::to_owned).collect();
        for topic in both {
            let overlap_ns = together_ns(&self.held()[&topic], &before.held()[&topic]);
            if overlap_ns <= MOST_OVERLAP_NS {
                continue;
            }
            if shared == Shared::OfFirst {
                self.left_out.insert(topic, before.name.clone());
                continue;
            }
            let (later, other) = match self.span_ns() < before.span_ns() {
                true => (before, &*self),
                false => (&*self, before),
            };
            return Err(MergeError::Overlap {
                name: later.name.clone(),
                other: other.name.clone(),
                topic,
                overlap_s: overlap_ns as f64 * 1e-9,
            });
        }
        Ok(())
    }

    /// See [`Part::held`].
    fn held(&self) -> &BTreeMap<String, Vec<(i64, i64)>> {
        self.held.get_or_init(|| {
            let mut held = BTreeMap::new();
            // None of their messages may have come.
            for topic in self.topics() {
                held.insert(topic.to_owned(), (0, Vec::new()));
            }
            let mut source = RawMessages::of(&self.recording);
            let mut note = |message: &RawMessage<'_>| {
                if let Some((messages, stretches)) = held.get_mut(message.topic) {
                    *messages += 1;
                    lengthen(stretches, message.log_time_ns);
                }
            };
            while source.give(&mut note).is_some() {}
            let joined = held.into_iter().map(|(topic, (messages, mut stretches))| {
                stretches.sort_unstable();
                join(&mut stretches, PAUSE_NS);
                let long_ns = usual_pause_ns(&stretches, messages).unwrap_or(0);
                join(&mut stretches, long_ns.saturating_mul(USUAL));
                (topic, stretches)
            });
            joined.collect()
        })
    }
}

/// The last stretch, or a new one, for a message at a time.
fn lengthen(stretches: &mut Vec<(i64, i64)>, t_ns: i64) {
    match stretches.last_mut() {
        Some((from, to))
            if t_ns >= from.saturating_sub(PAUSE_NS) && t_ns <= to.saturating_add(PAUSE_NS) =>
        {
            (*from, *to) = (t_ns.min(*from), t_ns.max(*to));
        }
        _ => stretches.push((t_ns, t_ns)),
    }
}

/// Makes one of stretches in order with no longer pause than this between them.
fn join(stretches: &mut Vec<(i64, i64)>, pause_ns: i64) {
    stretches.dedup_by(|next, last| {
        let goes_on = next.0.saturating_sub(last.1) <= pause_ns;
        last.1 = if goes_on { last.1.max(next.1) } else { last.1 };
        goes_on
    });
}

/// The median of the intervals of so many messages, ns, where that is one of the pauses between stretches: all others are shorter.
fn usual_pause_ns(stretches: &[(i64, i64)], messages: usize) -> Option<i64> {
    let pauses = stretches.windows(2);
    let mut pauses: Vec<i64> = pauses
        .map(|pair| pair[1].0.saturating_sub(pair[0].1))
        .collect();
    pauses.sort_unstable();
    let shorter = messages.saturating_sub(stretches.len());
    let middle = messages.saturating_sub(1) / 2;
    pauses.get(middle.checked_sub(shorter)?).copied()
}

/// For how long stretches in order are together, ns.
fn together_ns(a: &[(i64, i64)], b: &[(i64, i64)]) -> i64 {
    let (mut a, mut b) = (a.iter().peekable(), b.iter().peekable());
    let mut sum_ns = 0;
    while let (Some(one), Some(other)) = (a.peek(), b.peek()) {
        sum_ns += (one.1.min(other.1) - one.0.max(other.0)).max(0);
        if one.1 < other.1 {
            a.next()
        } else {
            b.next()
        };
    }
    sum_ns
}

/// The files that are meant: of a folder, the recordings in it.
pub fn files(paths: &[PathBuf]) -> Result<Vec<PathBuf>, MergeError> {
    let mut files = Vec::new();
    for path in paths {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let inside = recordings_in(path);
        if inside.is_empty() {
            let folder = path.display().to_string();
            return Err(MergeError::NoneInside { folder });
        }
        files.extend(inside);
    }
    Ok(files)
}

/// Recordings to be put together, in the order of time.
pub struct Parts(Vec<Part>);

impl Parts {
    /// Opens recordings, reads each once for its damage, and sees that they fit together.
    pub fn open(
        files: &[PathBuf],
        shared: Shared,
        options: &ReadOptions,
    ) -> Result<Self, MergeError> {
        let mut seen = Vec::new();
        let mut parts = Vec::new();
        for file in files {
            let mut part = Part::open(file, options)?;
            let place = file.canonicalize().unwrap_or_else(|_| file.clone());
            if seen.contains(&place) {
                return Err(MergeError::Twice { name: part.name });
            }
            seen.push(place);
            for before in &parts {
                part.fit(before, shared)?;
            }
            parts.push(part);
        }
        // Those without a message come first, and say nothing about time.
        parts.sort_by_key(Part::span_ns);
        Ok(Parts(parts))
    }

    /// The profile that all have; empty where they differ.
    pub fn profile(&self) -> &str {
        let mut profiles = self.0.iter().map(|p| p.recording.info().profile.as_str());
        let first = profiles.next().unwrap_or_default();
        match profiles.all(|profile| profile == first) {
            true => first,
            false => "",
        }
    }

    /// What is lost in them, one line each.
    pub fn losses(&self) -> Vec<String> {
        let mut losses = Vec::new();
        for part in &self.0 {
            let told = part.losses.iter().map(|loss| {
                // Their sentences are the same for one as for all.
                let uncounted = matches!(loss.kind, Kind::TimeOutOfRange | Kind::UnknownChannel);
                let count = counted(loss.count, "message", "messages");
                let count = uncounted.then(|| format!(" ({count} left out)"));
                format!("{}: {loss}{}", part.name, count.unwrap_or_default())
            });
            losses.extend(told);
        }
        losses
    }

    /// What is left out of them, which are empty, where time passes between them that none recorded, and in which of the record `rath`'s keys they differ, one line each.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let records = self.0.iter().flat_map(|part| {
            let all = part.recording.metadata_records().iter();
            let own = all.filter(|(name, _)| name == OWN_RECORD);
            let each = own.flat_map(|record| &record.1);
            each.map(|entry| (part.name.as_str(), entry))
        });
        let mut own: BTreeMap<&str, &str> = BTreeMap::new();
        let mut differ = BTreeSet::new();
        let mut says_last = "";
        for (part, (key, value)) in records {
            says_last = part;
            if own.insert(key, value).is_some_and(|before| before != value) {
                differ.insert(key.as_str());
            }
        }
        if !differ.is_empty() {
            let keys = Vec::from_iter(differ).join(", ");
            notes.push(format!(
                "the recordings say different things of {keys}; what {says_last}, which begins last, says will count"
            ));
        }
        let mut last: Option<(i64, &Part)> = None;
        for part in &self.0 {
            for (topic, of) in &part.left_out {
                let name = &part.name;
                let channels = part.recording.info().channels.iter();
                let of_topic = channels.filter(|channel| channel.topic == *topic);
                let messages: u64 = of_topic.map(|channel| channel.messages).sum();
                let messages = counted(messages, "message", "messages");
                notes.push(format!(
                    "{name}: {topic} is left out ({messages}), it is taken from {of}"
                ));
            }
            let Some((start_ns, end_ns)) = part.span_ns() else {
                notes.push(format!("{}: holds no messages", part.name));
                continue;
            };
            if let Some((before_ns, before)) = last
                && start_ns - before_ns > PAUSE_NS
            {
                let pause_s = (start_ns - before_ns) as f64 * 1e-9;
                let (name, before) = (&part.name, &before.name);
                notes.push(format!("{name}: begins {pause_s:.1} s after {before} ends"));
            }
            if last.is_none_or(|(before_ns, _)| end_ns > before_ns) {
                last = Some((end_ns, part));
            }
        }
        notes
    }

    /// Bytes of the files that hold messages.
    pub fn bytes(&self) -> u64 {
        let sources = self.0.iter().map(|part| RawMessages::of(&part.recording));
        sources.map(|source| source.bytes_left()).sum()
    }

    /// Writes everything that they hold: metadata and attachments that several have alike once, messages in the order of time but within a stretch of
    /// a file, where they come as they are there. Returns how many messages there are; `each` hears of bytes of the files as they are done.
    pub fn write(
        &self,
        writer: &mut RecordingWriter,
        mut each: impl FnMut(u64),
    ) -> Result<u64, MergeError> {
        let mut records = Vec::new();
        let mut attached = Vec::new();
        for part in &self.0 {
            for record in part.recording.metadata_records() {
                if !records.contains(&record) {
                    records.push(record);
                    writer.metadata(&record.0, &record.1)?;
                }
            }
            for attachment in part.recording.attachments() {
                let same = (attachment.name, attachment.media_type, attachment.data);
                if !attached.contains(&same) {
                    attached.push(same);
                    writer.copy_attachment(&attachment)?;
                }
            }
        }
        let mut sources = Vec::new();
        for part in &self.0 {
            let channels = part.recording.info().channels.iter();
            let channels: Vec<_> = channels
                .map(|channel| {
                    let taken = !part.left_out.contains_key(&channel.topic);
                    let channel = RawChannel::from(channel);
                    taken.then(|| writer.raw_channel(&channel)).transpose()
                })
                .collect::<Result<_, _>>()?;
            sources.push((RawMessages::of(&part.recording), channels));
        }
        let mut count = 0;
        loop {
            // Of several that begin together, the first in order.
            let left = sources
                .iter_mut()
                .filter_map(|(source, channels)| Some((source.next_ns()?, source, channels)));
            let Some((_, source, channels)) = left.min_by_key(|(begins_ns, ..)| *begins_ns) else {
                break;
            };
            let mut outcome = Ok(());
            let bytes = source.give(&mut |message| {
                if let (Some(channel), Ok(())) = (channels[message.channel], &outcome) {
                    count += 1;
                    outcome = writer.copy(channel, message);
                }
            });
            outcome?;
            each(bytes.unwrap_or(0));
        }
        Ok(count)
    }
}

/// "3 recordings".
impl std::fmt::Display for Parts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&counted(self.0.len() as u64, "recording", "recordings"))
    }
}

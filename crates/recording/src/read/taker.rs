//! The taking end of the stream: numbers the columns, feeds the sink, keeps the findings.

use std::{
    collections::{HashMap, hash_map::Entry},
    sync::{Arc, atomic::Ordering},
};

use super::{
    Recording,
    block::{BatchColumn, BlockResult, ChannelBatch, Trouble},
    clock::seconds,
    rows::{MAX_COLUMNS, MAX_SIGNALS, too_many_columns, too_many_signals},
    watch::{MAX_TROUBLES, Watch, Words},
};
use crate::{Finding, Kind, text::counted};

/// Decoded numbers of one channel out of one chunk; of messages that nothing decodes, when they came.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// Index into [`Info::channels`](super::Info::channels).
    pub channel: usize,
    /// Topic.
    pub topic: &'a str,
    /// Name of the schema.
    pub schema: &'a str,
    /// Log time of each message, ns, in the order of the file.
    pub times_ns: &'a [i64],
    /// Header stamp of each message, ns, where all have one.
    pub stamps_ns: Option<&'a [i64]>,
    /// The columns that were selected and have values here.
    pub columns: &'a [Column<'a>],
}

/// One numeric field in a [`Batch`].
#[derive(Clone, Copy, Debug)]
pub struct Column<'a> {
    /// A number that stands for the path throughout the stream, counted from 0 in the order of first sight.
    pub id: usize,
    /// `TOPIC.field.path`; `TOPIC:field.path` where a field of a topic before is called so.
    pub path: &'a str,
    /// The messages that have a value, as indices into `times_ns`; `None` where all do.
    pub rows: Option<&'a [u32]>,
    /// The values.
    pub values: &'a [f64],
    /// Whether none of them is NaN or infinite.
    pub finite: bool,
}

/// Takes the blocks in the order of the file.
pub(super) struct Taker<'a> {
    recording: &'a Recording,
    watches: Vec<Watch>,
    columns: Vec<Columns>,
    ids: Ids,
    /// The first channel of each channel's topic.
    topics: Vec<usize>,
    findings: Vec<Finding>,
    /// Position in `findings` of troubles that repeat.
    known: HashMap<(Option<usize>, Kind, String), usize>,
    messages: u64,
    lost: u64,
    /// Some were not counted by channel, as in a lost chunk.
    unread: bool,
    start_ns: i64,
    /// Messages by index of the channel.
    per_channel: Vec<u64>,
    /// The first and the last log time, of lost chunks as their headers say, ns.
    times: Option<(u64, u64)>,
    contradictions: u64,
}

/// By name: the number of a column, and the first channel of its topic.
type Ids = HashMap<Arc<str>, (usize, usize)>;

/// The columns of one channel.
#[derive(Default)]
struct Columns {
    /// Path, name and number in the order of the last batch, which mostly is that of the next; no number where there are too many.
    last: Vec<(Arc<str>, Arc<str>, Option<usize>)>,
    /// How many were numbered.
    numbered: usize,
    /// That two places of one message are called the same was said.
    twice: bool,
}

impl Columns {
    /// Numbers the columns of a batch of the topic whose first channel is `first`; says, and how often, where one is called as another topic's.
    fn number(
        &mut self,
        columns: &[BatchColumn],
        topic: &str,
        first: usize,
        ids: &mut Ids,
    ) -> Option<(String, u64)> {
        let mut shared: Option<(String, u64)> = None;
        for (position, column) in columns.iter().enumerate() {
            if matches!(self.last.get(position), Some((path, ..)) if *path == column.path) {
                continue;
            }
            let (mut name, mut mark) = (column.path.clone(), ":".to_owned());
            let id = loop {
                let next = ids.len();
                match ids.entry(name.clone()) {
                    Entry::Occupied(known) if known.get().1 == first => break Some(known.get().0),
                    Entry::Occupied(_) => {
                        // Another topic begins as this one does, and goes on in its fields as this one in its name.
                        let field = column.path.get(topic.len() + 1..).unwrap_or_default();
                        name = format!("{topic}{mark}{field}").into();
                        mark.push(':');
                    }
                    // Each block by itself has no more, all of them together may.
                    Entry::Vacant(_) if self.numbered >= MAX_COLUMNS || next >= MAX_SIGNALS => {
                        break None;
                    }
                    Entry::Vacant(new) => {
                        self.numbered += 1;
                        new.insert((next, first));
                        if name != column.path {
                            let text = format!(
                                "{} is a field of another topic before, so that this topic's is called {name}",
                                column.path
                            );
                            shared.get_or_insert((text, 0)).1 += 1;
                        }
                        break Some(next);
                    }
                }
            };
            self.last.truncate(position);
            self.last.push((column.path.clone(), name, id));
        }
        shared
    }
}

impl<'a> Taker<'a> {
    pub fn new(recording: &'a Recording) -> Self {
        let info = &recording.info;
        let mut watches = Vec::new();
        watches.resize_with(info.channels.len(), Watch::default);
        let mut columns = Vec::new();
        columns.resize_with(info.channels.len(), Columns::default);
        let mut first = HashMap::new();
        let channels = info.channels.iter().enumerate();
        let topics = channels
            .map(|(index, channel)| *first.entry(&channel.topic).or_insert(index))
            .collect();
        Taker {
            recording,
            topics,
            per_channel: vec![0; watches.len()],
            times: None,
            contradictions: 0,
            watches,
            columns,
            ids: HashMap::new(),
            findings: known_before(recording),
            known: HashMap::new(),
            messages: 0,
            lost: recording.container.behind,
            unread: false,
            start_ns: info.start_ns,
        }
    }

    pub fn take(&mut self, result: &mut BlockResult, sink: &mut dyn FnMut(&Batch<'_>)) {
        self.messages += result.messages;
        self.contradictions += result.contradictions;
        for (channel, count) in result.per_channel.drain(..) {
            self.per_channel[channel] += count;
        }
        if let Some((first, last)) = result.times {
            let (start, end) = self.times.get_or_insert((first, last));
            *start = first.min(*start);
            *end = last.max(*end);
        }
        for trouble in result.troubles.drain(..) {
            self.trouble(trouble);
        }
        for batch in &mut result.batches {
            self.batch(batch, sink);
        }
    }

    fn trouble(&mut self, trouble: Trouble) {
        // Messages are named by their first; chunks each by their own place.
        let key = match trouble.kind {
            Kind::Undecodable => (trouble.channel, trouble.kind, String::new()),
            kind => (trouble.channel, kind, trouble.text.clone()),
        };
        self.lost += trouble.lost;
        self.unread |=
            trouble.channel.is_none() && (trouble.lost > 0 || trouble.kind != Kind::BadRecord);
        if self.known.len() >= MAX_TROUBLES && !self.known.contains_key(&key) {
            let text = format!(
                "further {} trouble of this kind, not listed one by one",
                trouble.kind
            );
            let key = (None, trouble.kind, "further".to_owned());
            self.count(key, Finding::new("", trouble.kind, trouble.count, text));
            return;
        }
        let topic = trouble
            .channel
            .map(|index| &self.recording.info.channels[index].topic);
        let topic = topic.map_or("", String::as_str);
        let finding = Finding {
            t_s: trouble.time.map(|time| seconds(time, self.start_ns)),
            ..Finding::new(topic, trouble.kind, trouble.count, trouble.text)
        };
        self.count(key, finding);
    }

    /// Adds to what is known by this key, or makes it known.
    fn count(&mut self, key: (Option<usize>, Kind, String), finding: Finding) {
        match self.known.entry(key) {
            Entry::Occupied(known) => self.findings[*known.get()].count += finding.count,
            Entry::Vacant(new) => {
                new.insert(self.findings.len());
                self.findings.push(finding);
            }
        }
    }

    fn batch(&mut self, batch: &mut ChannelBatch, sink: &mut dyn FnMut(&Batch<'_>)) {
        let info = &self.recording.info.channels[batch.channel];
        let watch = &mut self.watches[batch.channel];
        // What is dated long before all others tells neither order nor drift.
        let from_ns = match self.recording.info.early {
            0 => i64::MIN,
            _ => self.start_ns,
        };
        watch.observe(batch, from_ns);
        let mut remark = batch.remark.take();
        let known = &mut self.columns[batch.channel];
        let twice = (batch.twice.take())
            .filter(|_| !std::mem::replace(&mut known.twice, true))
            .map(|field| format!("two of its fields are called {field}; where a message has both, the last one counts"));
        let first = self.topics[batch.channel];
        let shared = known.number(&batch.columns, &info.topic, first, &mut self.ids);
        let mut columns = Vec::with_capacity(batch.columns.len());
        for (column, (_, name, id)) in batch.columns.iter().zip(&known.last) {
            let Some(id) = *id else {
                remark.get_or_insert_with(match known.numbered {
                    MAX_COLUMNS.. => too_many_columns,
                    _ => too_many_signals,
                });
                continue;
            };
            if let Some((count, row)) = column.odd {
                watch.observe_odd(name, count, batch.times[row as usize]);
            }
            let rows = (column.values.len() != batch.times.len()).then_some(column.rows.as_slice());
            columns.push(Column {
                id,
                path: name,
                rows,
                values: &column.values,
                finite: column.odd.is_none(),
            });
        }
        let remarks = remark.into_iter().chain(twice).map(|text| (text, 1));
        for (text, count) in remarks.chain(shared) {
            let key = (Some(batch.channel), Kind::OddSchema, text.clone());
            // Said once.
            if let Entry::Vacant(new) = self.known.entry(key) {
                new.insert(self.findings.len());
                (self.findings).push(Finding::new(&info.topic, Kind::OddSchema, count, text));
            }
        }
        sink(&Batch {
            channel: batch.channel,
            topic: &info.topic,
            schema: &info.schema,
            times_ns: &batch.times,
            stamps_ns: (!batch.stamps.is_empty()).then_some(&batch.stamps),
            columns: &columns,
        });
    }

    /// Everything that there is to remark, once all blocks were taken.
    pub fn findings(mut self) -> Vec<Finding> {
        self.judge_summary();
        let recording = self.recording;
        for (watch, info) in self.watches.iter_mut().zip(&recording.info.channels) {
            let words = Words {
                topic: &info.topic,
                start_ns: self.start_ns,
                by_name: match recording.options.limits_are_options {
                    true => "--by-name calls items by their names",
                    false => "they can be read by name",
                },
                most_items: format!(
                    "{} items ({})",
                    recording.most_items(&info.schema),
                    recording.options.limit("--max-items")
                ),
            };
            watch.report(&words, &mut self.findings);
        }
        for finding in &mut self.findings {
            with_count(finding);
        }
        recording.skipped.store(self.lost, Ordering::Relaxed);
        self.findings
    }

    /// Holds the summary against what was found.
    fn judge_summary(&mut self) {
        let recording = self.recording;
        let mut contradictions = Vec::new();
        let mut say = |topic: &str, kind, count, text| {
            contradictions.push(Finding::new(topic, kind, count, text));
        };
        if self.contradictions > 0 && !recording.searched {
            let text = format!(
                "the summary has other schemas or channels than the data, in {} places",
                self.contradictions
            );
            say("", Kind::BadSummary, self.contradictions, text);
        }
        // Of which channels a damaged chunk held how many, nobody knows.
        if !self.unread && recording.damage().is_empty() && !recording.searched {
            for (channel, &found) in recording.info.channels.iter().zip(&self.per_channel) {
                if channel.messages != found {
                    let text = format!(
                        "the summary counts {} messages of channel {}, {found} were found",
                        channel.messages, channel.id
                    );
                    say(&channel.topic, Kind::BadSummary, 1, text);
                }
            }
        }
        let told = recording.promised.as_ref().map(|s| (s.start, s.end));
        if let (Some(told), Some(found)) = (told, self.times)
            && told != found
            && recording.damage().is_empty()
        {
            let after = |time: u64| (i128::from(time) - i128::from(found.0)) as f64 / 1e9;
            let text = format!(
                "the summary says that log times go from {:.3} s to {:.3} s after the first, they go from 0 s to {:.3} s",
                after(told.0),
                after(told.1),
                after(found.1),
            );
            say("", Kind::SummaryTimes, 1, text);
        }
        self.findings.extend(contradictions.iter().cloned());
        if !recording.searched {
            *recording.lock_contradictions() = contradictions;
        }
        if let Some(promised) = recording.promised.as_ref().map(|s| s.messages)
            && promised != self.messages
            && (recording.searched || self.unread)
        {
            let lost = promised.saturating_sub(self.messages);
            // Chunks that were left out explain as many as their indexes name.
            if lost > self.lost || promised < self.messages {
                let text = format!(
                    "the summary counts {promised} messages, {} were found",
                    self.messages
                );
                self.findings
                    .push(Finding::new("", Kind::BadSummary, 1, text));
            }
            self.lost = self.lost.max(lost);
        }
    }
}

/// What was remarked before any message was read.
fn known_before(recording: &Recording) -> Vec<Finding> {
    let info = &recording.info;
    let mut findings = recording.distrusted.clone();
    let damage = recording.damage().iter();
    findings
        .extend(damage.map(|(kind, count, text)| Finding::new("", *kind, *count, text.clone())));
    if info.early > 0 {
        let text = format!(
            "{} {:.3} s before all others: seconds are counted from the first of the others",
            counted(info.early, "message is dated", "messages are dated up to"),
            seconds(info.start_ns, info.earliest_ns)
        );
        findings.push(Finding::new("", Kind::Early, info.early, text));
    }
    let conflicts = recording.definitions.conflicts.iter();
    findings.extend(
        conflicts.map(|(topic, text)| Finding::new(topic, Kind::Redefined, 1, text.clone())),
    );
    findings
}

/// Sentences that began with the first of several get the count.
fn with_count(finding: &mut Finding) {
    match finding.kind {
        Kind::Undecodable => {
            let count = counted(finding.count, "message", "messages");
            let at = match finding.t_s {
                Some(t_s) => format!(", at {t_s:.3} s"),
                None => String::new(),
            };
            finding.text = format!(
                "{count} could not be decoded; the first{at}: {}",
                finding.text
            );
        }
        Kind::NoDecoder | Kind::UnknownChannel | Kind::BadSchema => {
            let skipped = counted(finding.count, "message", "messages");
            finding.text = format!("skipped {skipped}: {}", finding.text);
        }
        _ => {}
    }
}

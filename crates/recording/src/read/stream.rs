//! The stream of batches: threads unpack and decode blocks, the caller's thread takes them in the order of the file.

use std::{
    collections::{BTreeMap, HashMap, hash_map::Entry},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, atomic::Ordering},
};

use super::{
    ReadError, Recording,
    block::{BlockResult, ChannelBatch, Worker},
    clock::{Clocks, Order, seconds, unset},
    container::Block,
    json::MAX_KEYS,
    names::Called,
    rows::{
        Counts, Long, MAX_COLUMNS, MAX_PLACES, MAX_SIGNALS, Selection, too_many_columns,
        too_many_signals,
    },
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

/// How far blocks may be ahead of the one that is taken: the bound on memory.
#[derive(Clone, Copy)]
struct Window {
    threads: usize,
}

/// While what is ready holds no more than this, further blocks are begun, so that threads seldom have to wait for each other (bytes).
const READY_BYTES: usize = 16 << 20;

impl Window {
    /// Whether a block may be begun.
    fn is_open(self, progress: &Progress, blocks: usize) -> bool {
        let ahead = progress.next - progress.taken;
        let most = match progress.ready_bytes {
            0..READY_BYTES => 8 * self.threads + 1,
            _ => 2 * self.threads + 1,
        };
        progress.next < blocks && ahead < most
    }
}

/// The blocks in work: who has taken which, and what is ready.
struct Progress {
    next: usize,
    taken: usize,
    ready: BTreeMap<usize, BlockResult>,
    ready_bytes: usize,
    /// Results whose memory can be used again.
    spent: Vec<BlockResult>,
    stop: bool,
}

impl Progress {
    fn put(&mut self, position: usize, result: BlockResult) {
        self.ready_bytes += result.bytes();
        self.ready.insert(position, result);
    }
}

struct Shared {
    progress: Mutex<Progress>,
    changed: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Progress> {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Stops the helpers when the caller's thread leaves, in whatever way.
struct StopOnDrop<'a>(&'a Shared);

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        self.0.lock().stop = true;
        self.0.changed.notify_all();
    }
}

pub(super) fn run(
    recording: &Recording,
    select: Selection<'_>,
    sink: &mut dyn FnMut(&Batch<'_>),
) -> Result<Vec<Finding>, ReadError> {
    let blocks = &recording.container.blocks;
    let threads = match recording.options.threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        threads => threads,
    }
    .min(blocks.len().max(1));
    let window = Window { threads };
    let shared = Shared {
        progress: Mutex::new(Progress {
            next: 0,
            taken: 0,
            ready: BTreeMap::new(),
            ready_bytes: 0,
            spent: Vec::new(),
            stop: false,
        }),
        changed: Condvar::new(),
    };
    let mut taker = Taker::new(recording);
    std::thread::scope(|scope| {
        let _stop = StopOnDrop(&shared);
        for _ in 1..threads {
            scope.spawn(|| help(&shared, Worker::new(recording, select), blocks, window));
        }
        let mut worker = Worker::new(recording, select);
        for (position, block) in blocks.iter().enumerate() {
            let mut result = wait_for(position, &shared, &mut worker, blocks, window);
            if result.large {
                worker.large(block, &mut |mut result| taker.take(&mut result, sink));
            } else {
                taker.take(&mut result, sink);
            }
            recording.data.forget(block.range());
            let mut progress = shared.lock();
            progress.taken = position + 1;
            progress.spent.push(result);
            drop(progress);
            shared.changed.notify_all();
        }
    });
    Ok(taker.findings())
}

/// A helper's life: take the next block, decode it, put it down.
fn help(shared: &Shared, mut worker: Worker<'_>, blocks: &[Block], window: Window) {
    loop {
        let (position, spent) = {
            let mut progress = shared.lock();
            loop {
                if progress.stop || progress.next >= blocks.len() {
                    return;
                }
                if window.is_open(&progress, blocks.len()) {
                    break;
                }
                progress = shared
                    .changed
                    .wait(progress)
                    .unwrap_or_else(PoisonError::into_inner);
            }
            progress.next += 1;
            (progress.next - 1, progress.spent.pop())
        };
        spent.into_iter().for_each(|spent| worker.reuse(spent));
        let result = worker.block(&blocks[position]);
        shared.lock().put(position, result);
        shared.changed.notify_all();
    }
}

/// The caller's thread needs block `position`; while another thread works on it, this one helps with those that follow.
fn wait_for(
    position: usize,
    shared: &Shared,
    worker: &mut Worker<'_>,
    blocks: &[Block],
    window: Window,
) -> BlockResult {
    let mut progress = shared.lock();
    loop {
        if let Some(result) = progress.ready.remove(&position) {
            progress.ready_bytes -= result.bytes();
            return result;
        }
        if window.is_open(&progress, blocks.len()) {
            let mine = progress.next;
            progress.next += 1;
            let spent = progress.spent.pop();
            drop(progress);
            spent.into_iter().for_each(|spent| worker.reuse(spent));
            let result = worker.block(&blocks[mine]);
            if mine == position {
                return result;
            }
            progress = shared.lock();
            progress.put(mine, result);
        } else {
            progress = shared
                .changed
                .wait(progress)
                .unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// Runs of messages whose log times are `kept`, with their stamps, where there are some.
fn known<'a>(
    times: &'a [i64],
    stamps: &'a [i64],
    kept: impl Fn(i64) -> bool + 'a,
) -> impl Iterator<Item = (&'a [i64], &'a [i64])> {
    let mut from = 0;
    std::iter::from_fn(move || {
        from += times[from..].iter().take_while(|t| !kept(**t)).count();
        let run = times[from..].iter().take_while(|t| kept(**t)).count();
        let to = from + run;
        let found = (&times[from..to], stamps.get(from..to).unwrap_or_default());
        from = to;
        (run > 0).then_some(found)
    })
}

/// What is known about a channel while its batches come in.
#[derive(Default)]
struct Watch {
    log: Order,
    stamps: Order,
    clocks: Clocks,
    absent: Counts<String>,
    long: Counts<Long>,
    /// What the places of its lists were called.
    names: BTreeMap<(String, usize), Called>,
    trailing: u64,
    /// That two places of one message are called the same was said.
    twice: bool,
    odd: Vec<(Arc<str>, u64, i64)>,
    /// Path, name and number of the columns in the order of the last batch, which mostly is that of the next; no number where there are too many.
    columns: Vec<(Arc<str>, Arc<str>, Option<usize>)>,
    /// How many columns were numbered for it.
    numbered: usize,
    messages: u64,
}

/// The taking end: numbers the columns, feeds the sink, keeps the findings.
struct Taker<'a> {
    recording: &'a Recording,
    watches: Vec<Watch>,
    /// By name: the number of a column, and the first channel of its topic.
    ids: HashMap<Arc<str>, (usize, usize)>,
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

impl<'a> Taker<'a> {
    fn new(recording: &'a Recording) -> Self {
        let mut watches = Vec::new();
        watches.resize_with(recording.info.channels.len(), Watch::default);
        let mut findings = recording.distrusted.clone();
        for (kind, count, text) in recording.damage() {
            findings.push(Finding {
                topic: String::new(),
                kind: *kind,
                count: *count,
                t_s: None,
                text: text.clone(),
            });
        }
        let info = &recording.info;
        if info.early > 0 {
            findings.push(Finding {
                topic: String::new(),
                kind: Kind::Early,
                count: info.early,
                t_s: None,
                text: format!(
                    "{} {:.3} s before all others: seconds are counted from the first of the others",
                    counted(info.early, "message is dated", "messages are dated up to"),
                    seconds(info.start_ns, info.earliest_ns)
                ),
            });
        }
        for (topic, text) in &recording.definitions.conflicts {
            findings.push(Finding {
                topic: topic.clone(),
                kind: Kind::Redefined,
                count: 1,
                t_s: None,
                text: text.clone(),
            });
        }
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
            ids: HashMap::new(),
            findings,
            known: HashMap::new(),
            messages: 0,
            lost: recording.container.behind,
            unread: false,
            start_ns: recording.info.start_ns,
        }
    }

    fn take(&mut self, result: &mut BlockResult, sink: &mut dyn FnMut(&Batch<'_>)) {
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
            // Messages are named by their first; chunks each by their own place.
            let key = match trouble.kind {
                Kind::Undecodable => (trouble.channel, trouble.kind, String::new()),
                kind => (trouble.channel, kind, trouble.text.clone()),
            };
            self.lost += trouble.lost;
            self.unread |=
                trouble.channel.is_none() && (trouble.lost > 0 || trouble.kind != Kind::BadRecord);
            if let Some(&position) = self.known.get(&key) {
                self.findings[position].count += trouble.count;
                continue;
            }
            if self.known.len() >= MAX_TROUBLES {
                let key = (None, trouble.kind, "further".to_owned());
                match self.known.get(&key) {
                    Some(&position) => self.findings[position].count += trouble.count,
                    None => {
                        self.known.insert(key, self.findings.len());
                        let text = format!(
                            "further {} trouble of this kind, not listed one by one",
                            trouble.kind
                        );
                        self.findings.push(Finding {
                            topic: String::new(),
                            kind: trouble.kind,
                            count: trouble.count,
                            t_s: None,
                            text,
                        });
                    }
                }
                continue;
            }
            self.known.insert(key, self.findings.len());
            let topic = trouble
                .channel
                .map(|index| self.recording.info.channels[index].topic.clone());
            self.findings.push(Finding {
                topic: topic.unwrap_or_default(),
                kind: trouble.kind,
                count: trouble.count,
                t_s: trouble.time.map(|time| seconds(time, self.start_ns)),
                text: trouble.text,
            });
        }
        for batch in &mut result.batches {
            self.batch(batch, sink);
        }
    }

    fn batch(&mut self, batch: &mut ChannelBatch, sink: &mut dyn FnMut(&Batch<'_>)) {
        let watch = &mut self.watches[batch.channel];
        watch.messages += batch.times.len() as u64;
        // What is dated long before all others tells neither order nor drift.
        let from_ns = match self.recording.info.early {
            0 => i64::MIN,
            _ => self.start_ns,
        };
        for (times, stamps) in known(&batch.times, &batch.stamps, |t| t >= from_ns) {
            watch.log.observe(times);
            if !stamps.is_empty() {
                watch.clocks.observe(times, stamps);
                // One that was never set is told as such: it is no leap of half a century, and nothing is missing there.
                let mut from = 0;
                if stamps.contains(&0) {
                    for (k, (t, s)) in times.iter().zip(stamps).enumerate() {
                        if unset(*t, *s) {
                            watch.stamps.observe(&stamps[from..k]);
                            watch.stamps.pause();
                            from = k + 1;
                        }
                    }
                }
                watch.stamps.observe(&stamps[from..]);
            }
        }
        for (field, count) in std::mem::take(&mut batch.absent) {
            watch.absent.add(field, count);
        }
        for (what, count) in std::mem::take(&mut batch.long) {
            watch.long.add(what, count);
        }
        for (list, place, name) in std::mem::take(&mut batch.names) {
            watch.names.entry((list, place)).or_default().add(&name);
        }
        watch.trailing += batch.trailing;
        let mut remark = batch.remark.take();
        let twice = (batch.twice.take())
            .filter(|_| !std::mem::replace(&mut watch.twice, true))
            .map(|field| format!("two of its fields are called {field}; where a message has both, the last one counts"));
        let (info, topic) = (
            &self.recording.info.channels[batch.channel],
            self.topics[batch.channel],
        );
        let mut shared: Option<(String, u64)> = None;
        for (position, column) in batch.columns.iter().enumerate() {
            if matches!(watch.columns.get(position), Some((path, ..)) if *path == column.path) {
                continue;
            }
            let (mut name, mut mark) = (column.path.clone(), ":".to_owned());
            let id = loop {
                let next = self.ids.len();
                match self.ids.entry(name.clone()) {
                    Entry::Occupied(known) if known.get().1 == topic => break Some(known.get().0),
                    Entry::Occupied(_) => {
                        // Another topic begins as this one does, and goes on in its fields as this one in its name.
                        let field = column.path.get(info.topic.len() + 1..).unwrap_or_default();
                        name = format!("{}{mark}{field}", info.topic).into();
                        mark.push(':');
                    }
                    // Each block by itself has no more, all of them together may.
                    Entry::Vacant(_) if watch.numbered >= MAX_COLUMNS || next >= MAX_SIGNALS => {
                        break None;
                    }
                    Entry::Vacant(new) => {
                        watch.numbered += 1;
                        new.insert((next, topic));
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
            watch.columns.truncate(position);
            watch.columns.push((column.path.clone(), name, id));
        }
        let mut columns = Vec::with_capacity(batch.columns.len());
        for (column, (_, name, id)) in batch.columns.iter().zip(&watch.columns) {
            let id = *id;
            let Some(id) = id else {
                remark.get_or_insert_with(match watch.numbered {
                    MAX_COLUMNS.. => too_many_columns,
                    _ => too_many_signals,
                });
                continue;
            };
            if let Some((count, row)) = column.odd {
                match watch.odd.iter_mut().find(|(path, _, _)| path == name) {
                    Some((_, known, _)) => *known += count,
                    None => watch
                        .odd
                        .push((name.clone(), count, batch.times[row as usize])),
                }
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
            if !self.known.contains_key(&key) {
                self.known.insert(key, self.findings.len());
                self.findings.push(Finding {
                    topic: info.topic.clone(),
                    kind: Kind::OddSchema,
                    count,
                    t_s: None,
                    text,
                });
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

    /// Holds the summary against what was found.
    fn judge_summary(&mut self) {
        let recording = self.recording;
        let mut contradictions = Vec::new();
        let mut say = |topic: &str, kind, count, text| {
            contradictions.push(Finding {
                topic: topic.to_owned(),
                kind,
                count,
                t_s: None,
                text,
            })
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
    }

    fn findings(mut self) -> Vec<Finding> {
        let start_ns = self.start_ns;
        self.judge_summary();
        if let Some(promised) = self.recording.promised.as_ref().map(|s| s.messages)
            && promised != self.messages
            && (self.recording.searched || self.unread)
        {
            let lost = promised.saturating_sub(self.messages);
            // Chunks that were left out explain as many as their indexes name.
            if lost > self.lost || promised < self.messages {
                let text = format!(
                    "the summary counts {promised} messages, {} were found",
                    self.messages
                );
                self.findings.push(Finding {
                    topic: String::new(),
                    kind: Kind::BadSummary,
                    count: 1,
                    t_s: None,
                    text,
                });
            }
            self.lost = self.lost.max(lost);
        }
        for (watch, info) in self.watches.iter_mut().zip(&self.recording.info.channels) {
            let topic = &info.topic;
            watch
                .log
                .report(topic, "log times", start_ns, &mut self.findings);
            watch.clocks.report(topic, start_ns, &mut self.findings);
            if !watch.clocks.same() {
                if watch.log.has_gaps() {
                    watch.stamps.forget_gaps();
                }
                watch
                    .stamps
                    .report(topic, "header stamps", start_ns, &mut self.findings);
            }
            let mut say = |kind, count, t_s, text| {
                self.findings.push(Finding {
                    topic: topic.clone(),
                    kind,
                    count,
                    t_s,
                    text,
                })
            };
            let mut odd: BTreeMap<String, Odd> = BTreeMap::new();
            for (path, count, time) in &watch.odd {
                let field = path
                    .strip_prefix(topic.as_str())
                    .unwrap_or(path)
                    .trim_start_matches(['.', ':']);
                let items = odd.entry(list_of(field)).or_insert_with(|| Odd {
                    field: field.to_owned(),
                    items: 0,
                    count: 0,
                    first: *time,
                });
                items.items += 1;
                items.count += count;
                items.first = items.first.min(*time);
            }
            for (list, odd) in &odd {
                let t_s = seconds(odd.first, start_ns);
                let of = match odd.items {
                    1 => odd.field.clone(),
                    n => format!("{list} ({n} items)"),
                };
                say(
                    Kind::Nan,
                    odd.count,
                    Some(t_s),
                    format!(
                        "{} of {of} {} NaN or infinite, first at {t_s:.3} s",
                        counted(odd.count, "value", "values"),
                        if odd.count == 1 { "is" } else { "are" }
                    ),
                );
            }
            for (field, count) in &watch.absent.list {
                let text = if *count == watch.messages {
                    format!("{field} is declared as not given (covariance -1)")
                } else {
                    format!(
                        "{field} is declared as not given (covariance -1) in {count} of {} messages",
                        watch.messages
                    )
                };
                say(Kind::AbsentField, *count, None, text);
            }
            let mut mixed = (watch.names.iter())
                .filter_map(|((list, place), called)| Some((list, place, called.several()?)));
            if let Some((list, place, called)) = mixed.next() {
                let further = match mixed.count() {
                    0 => String::new(),
                    n => {
                        let places = counted(n as u64, "further place", "further places");
                        format!(", and {places} of lists likewise")
                    }
                };
                let remedy = match self.recording.options.limits_are_options {
                    true => "--by-name calls items by their names",
                    false => "they can be read by name",
                };
                let text = format!(
                    "{list}[{place}] is in turn {called}{further}: signals of such a place mix what belongs to several; {remedy}"
                );
                say(Kind::MixedItems, 1, None, text);
            }
            for (what, count) in watch.long.list.iter().take(MAX_TROUBLES) {
                let messages = counted(*count, "message", "messages");
                let whole = |field: &str| match field {
                    "" => "the message itself".to_owned(),
                    field => field.to_owned(),
                };
                let text = match what {
                    Long::Places => format!(
                        "sequences, maps and objects have more than {MAX_PLACES} fields together, or names that take as much room, in {messages}; what has further ones is left out"
                    ),
                    Long::Keys(field) => format!(
                        "{} has more keys than the {MAX_KEYS} that become signals, in {messages}; what has further ones is left out",
                        whole(field)
                    ),
                    Long::Items(field) => format!(
                        "{} has more than {} items ({}) in {messages}; it is not among the signals there",
                        whole(field),
                        self.recording.most_items(&info.schema),
                        self.recording.options.limit("--max-items")
                    ),
                };
                say(Kind::LongSequence, *count, None, text);
            }
            if watch.long.list.len() > MAX_TROUBLES {
                let further = (watch.long.list.len() - MAX_TROUBLES) as u64;
                let text = format!("{further} further fields are too long in some messages");
                say(Kind::LongSequence, further, None, text);
            }
            if watch.trailing > 0 {
                let text = format!(
                    "{} than their schema says",
                    counted(watch.trailing, "message is longer", "messages are longer")
                );
                say(Kind::TrailingBytes, watch.trailing, None, text);
            }
        }
        for finding in &mut self.findings {
            // Sentences that began with the first of several get the count.
            if finding.kind == Kind::Undecodable {
                let more = if finding.count == 1 {
                    "1 message"
                } else {
                    "messages"
                };
                let count = if finding.count == 1 {
                    String::new()
                } else {
                    format!("{} ", finding.count)
                };
                let at = match finding.t_s {
                    Some(t_s) => format!(", at {t_s:.3} s"),
                    None => String::new(),
                };
                finding.text = format!(
                    "{count}{more} could not be decoded; the first{at}: {}",
                    finding.text
                );
            } else if matches!(
                finding.kind,
                Kind::NoDecoder | Kind::UnknownChannel | Kind::BadSchema
            ) {
                let skipped = counted(finding.count, "message", "messages");
                finding.text = format!("skipped {skipped}: {}", finding.text);
            }
        }
        self.recording.skipped.store(self.lost, Ordering::Relaxed);
        self.findings
    }
}

/// More troubles than this are counted, not listed.
const MAX_TROUBLES: usize = 1000;

/// Items of one list, or one field, with values that are no numbers.
struct Odd {
    field: String,
    items: usize,
    count: u64,
    first: i64,
}

/// A field's name with its items' numbers left out: a covariance of 36 is told of once.
fn list_of(field: &str) -> String {
    let parts = field.split('[').enumerate();
    let kept = parts.map(|(k, part)| match (k, part.split_once(']')) {
        (1.., Some((number, rest))) if number.bytes().all(|b| b.is_ascii_digit()) => {
            format!("[]{rest}")
        }
        (0, _) => part.to_owned(),
        _ => format!("[{part}"),
    });
    kept.collect()
}

#[test]
fn items_of_a_list_are_one() {
    for (field, list) in [
        ("pose.covariance[35]", "pose.covariance[]"),
        ("effort[3]", "effort[]"),
        ("a[0].b[12].c", "a[].b[].c"),
        ("keyed[left].x", "keyed[left].x"),
        ("plain.x", "plain.x"),
    ] {
        assert_eq!(list_of(field), list);
    }
}

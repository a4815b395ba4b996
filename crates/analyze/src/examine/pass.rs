//! What is gathered of every signal while the recording streams by.

use std::collections::{BTreeSet, HashMap};

use recording::read::{Batch, ReadError, Recording};
use recording::signal::unit_of;

use super::analysis::Topic;
use crate::arrivals::{Arrivals, Axis};
use crate::envelope::Envelope;
use crate::quality::Quality;
use crate::quaternion::Quaternions;
use crate::request::Request;
use crate::roles::{Role, Roles};
use crate::summary::{Stream, Times, seconds, segment};

/// So many times tell a rate.
const FEW: u64 = 17;
/// So many values at most are put in the order of their times.
const MOST_SORTED: u64 = 1 << 24;

/// One signal on the way.
pub(super) struct Entry {
    pub path: String,
    pub unit: &'static str,
    pub channel: usize,
    pub listed: bool,
    /// Whether a spectrum is made of it.
    pub lines: bool,
    pub role: Option<Role>,
    pub stream: Stream,
    /// Values that came before times told a rate, which the length of the segments follows; `None` since then.
    waiting: Option<Vec<f64>>,
    /// How many values there may be.
    most: u64,
    /// How many came.
    came: u64,
    /// Times of its own where not every message has it.
    pub times: Option<Times>,
    /// Kept values, where it plays a role, and of which messages of the topic they are.
    pub kept: Vec<(usize, f64)>,
    /// Its outline, where it is to be drawn.
    pub outline: Option<Envelope>,
}

impl Entry {
    /// The next values; `shared` are the channel's times up to them, which count where it has none of its own.
    fn take(&mut self, x: &[f64], finite: bool, shared: &Times, window_s: f64) {
        let times = self.times.as_ref().unwrap_or(shared);
        if let Some(waiting) = &mut self.waiting
            && times.count() < FEW
        {
            waiting.extend_from_slice(x);
            return;
        }
        self.begin(shared, window_s);
        let times = self.times.as_ref().unwrap_or(shared);
        self.stream.push(x, finite, times.gaps());
    }

    /// Takes what waited, at the rate that the times tell.
    fn begin(&mut self, shared: &Times, window_s: f64) {
        let Some(waiting) = self.waiting.take() else {
            return;
        };
        let times = self.times.as_ref().unwrap_or(shared);
        let hz = times.hz_between_gaps().unwrap_or(0.0);
        let most = self.most.min((window_s * hz).ceil() as u64);
        let nperseg = if self.lines { segment(hz, most) } else { 0 };
        self.stream = Stream::new(hz, nperseg);
        self.stream.push(&waiting, false, &[]);
    }

    /// Takes all values anew, in the order of their times.
    fn take_sorted(&mut self, mut times: Times, (times_ns, x): (Vec<i64>, Vec<f64>)) {
        times.push(&times_ns);
        (self.waiting, self.most) = (Some(Vec::new()), x.len() as u64);
        self.times = None;
        self.begin(&times, f64::INFINITY);
        self.stream.push(&x, false, times.gaps());
        self.times = Some(times);
    }
}

/// What is gathered while batches stream by.
pub(super) struct Pass<'a> {
    pub recording: &'a Recording,
    pub request: &'a Request,
    pub roles: &'a Roles,
    pub times: Vec<Times>,
    /// The first channel of each channel's topic.
    pub first: Vec<usize>,
    /// By first channel of a topic: how many messages all its channels have.
    pub messages: Vec<u64>,
    /// By first channel of a topic: its messages, where it may feed metrics.
    pub arrivals: Vec<Arrivals>,
    /// Where the messages of the batch begin in `arrivals`.
    pub row: usize,
    /// By first channel of a topic: when its messages were taken, where it feeds metrics.
    pub axes: HashMap<usize, Axis>,
    pub entries: Vec<Entry>,
    /// By channel: entries that every message so far has had, whose times are the channel's.
    whole: Vec<Vec<usize>>,
    /// Times of the batch's channel before the batch.
    before: Times,
    /// Entry of a column of the stream.
    pub by_column: Vec<Option<usize>>,
    /// Entries of the angles of a quaternion, by the path of the quaternion.
    pub quaternions: Quaternions,
    pub by_path: HashMap<String, usize>,
    pub scratch: Vec<i64>,
}

impl<'a> Pass<'a> {
    pub(super) fn new(recording: &'a Recording, request: &'a Request, roles: &'a Roles) -> Self {
        let info = recording.info();
        let mut known = HashMap::new();
        let mut messages = vec![0; info.channels.len()];
        let mut first = Vec::with_capacity(info.channels.len());
        for (k, channel) in info.channels.iter().enumerate() {
            let topic = *known.entry(&channel.topic).or_insert(k);
            messages[topic] += channel.messages;
            first.push(topic);
        }
        Pass {
            first,
            messages,
            arrivals: vec![Arrivals::default(); info.channels.len()],
            row: 0,
            axes: HashMap::new(),
            recording,
            request,
            roles,
            times: vec![Times::since(info.start_ns); info.channels.len()],
            entries: Vec::new(),
            whole: vec![Vec::new(); info.channels.len()],
            before: Times::default(),
            by_column: Vec::new(),
            quaternions: Quaternions::default(),
            by_path: HashMap::new(),
            scratch: Vec::new(),
        }
    }

    pub(super) fn take(&mut self, batch: &Batch<'_>) {
        self.before.clone_from(&self.times[batch.channel]);
        self.times[batch.channel].push(batch.times_ns);
        if self.roles.feeds(batch.topic) {
            let arrivals = &mut self.arrivals[self.first[batch.channel]];
            self.row = arrivals.len();
            arrivals.take(batch);
        }
        for column in batch.columns {
            if self.by_column.len() <= column.id {
                self.by_column.resize(column.id + 1, None);
            }
            let entry = match self.by_column[column.id] {
                Some(entry) => entry,
                None => {
                    let unit = unit_of(batch.schema, field(batch.topic, column.path));
                    let entry = self.entry(batch, column.path, unit);
                    self.by_column[column.id] = Some(entry);
                    entry
                }
            };
            self.push(entry, batch, column.rows, column.values, column.finite);
        }
        let mut quaternions = std::mem::take(&mut self.quaternions);
        quaternions.each(batch, |path, rows, values| {
            if wanted(path, self.request, self.roles) {
                let entry = match self.by_path.get(path) {
                    Some(entry) => *entry,
                    None => {
                        let entry = self.entry(batch, path, "rad");
                        self.by_path.insert(path.to_owned(), entry);
                        entry
                    }
                };
                self.push(entry, batch, rows, values, false);
            }
        });
        self.quaternions = quaternions;
        // What this batch has nothing of goes on with times of its own.
        let so_far = self.times[batch.channel].count();
        self.whole[batch.channel].retain(|k| {
            let entry = &mut self.entries[*k];
            if entry.times.is_none() && entry.came < so_far {
                entry.times = Some(self.before.clone());
            }
            entry.times.is_none()
        });
    }

    fn entry(&mut self, batch: &Batch<'_>, path: &str, unit: &'static str) -> usize {
        let field = field(batch.topic, path);
        let listed = self.request.lists(batch.topic, path);
        // A stamp's seconds and nanoseconds are a clock, not a signal with lines.
        let clock = field.contains("stamp.") || field == "time_s";
        let lines = listed && !clock;
        // Earlier messages had nothing of it.
        let late = listed && self.before.count() > 0;
        if listed && !late {
            self.whole[batch.channel].push(self.entries.len());
        }
        self.entries.push(Entry {
            path: path.to_owned(),
            unit,
            channel: batch.channel,
            listed,
            lines,
            role: self.roles.of_signal(path),
            stream: Stream::new(0.0, 0),
            waiting: Some(Vec::new()),
            most: self.messages[self.first[batch.channel]],
            came: 0,
            times: late.then(|| Times::since(self.recording.info().start_ns)),
            kept: Vec::new(),
            outline: (self.request.traces && listed && !clock && !field.contains("covariance"))
                .then(Envelope::default),
        });
        self.entries.len() - 1
    }

    fn push(
        &mut self,
        entry: usize,
        batch: &Batch<'_>,
        rows: Option<&[u32]>,
        values: &[f64],
        finite: bool,
    ) {
        let entry = &mut self.entries[entry];
        let times = match rows {
            None => batch.times_ns,
            Some(rows) => {
                self.scratch.clear();
                self.scratch
                    .extend(rows.iter().map(|r| batch.times_ns[*r as usize]));
                &self.scratch
            }
        };
        entry.came += values.len() as u64;
        let from_ns = self.recording.info().start_ns;
        if entry.listed {
            let start_ns = i128::from(from_ns);
            match self.request.window {
                (None, None) => {
                    // A topic may come on several channels.
                    if entry.times.is_none() && batch.channel != entry.channel {
                        entry.times = Some(self.times[entry.channel].clone());
                    } else if entry.times.is_none() && rows.is_some() {
                        entry.times = Some(self.before.clone());
                    }
                    if let Some(own) = &mut entry.times {
                        own.push(times);
                    }
                    let shared = &self.times[batch.channel];
                    entry.take(values, finite, shared, f64::INFINITY);
                }
                _ => {
                    let inside =
                        |t: i64| (self.request).holds((i128::from(t) - start_ns) as f64 / 1e9);
                    let (kept, x): (Vec<i64>, Vec<f64>) = (times.iter().zip(values))
                        .filter(|(t, _)| inside(**t))
                        .map(|(t, x)| (*t, *x))
                        .unzip();
                    let own = entry.times.get_or_insert_with(|| Times::since(from_ns));
                    own.push(&kept);
                    let shared = &self.times[batch.channel];
                    entry.take(&x, finite, shared, self.request.longest_s());
                }
            }
        }
        if let Some(outline) = &mut entry.outline {
            let known = times.iter().zip(values).filter(|(t, _)| **t >= from_ns);
            known.for_each(|(t, x)| outline.push(seconds(from_ns, *t), *x));
        }
        if entry.role.is_some() {
            let row = |k: usize| self.row + rows.map_or(k, |rows| rows[k] as usize);
            entry
                .kept
                .extend(values.iter().enumerate().map(|(k, x)| (row(k), *x)));
        }
    }

    pub(super) fn topics(&self) -> Vec<Topic> {
        let mut topics: Vec<Topic> = (self.recording.info().channels.iter().zip(&self.times))
            .map(|(c, times)| Topic {
                name: c.topic.clone(),
                schema: c.schema.clone(),
                encoding: c.encoding.clone(),
                messages: c.messages.max(times.count()),
                hz: times.hz(),
            })
            .collect();
        topics.sort_by(|a, b| a.name.cmp(&b.name));
        topics
    }

    /// The times of a signal's values.
    pub(super) fn times_of<'b>(&'b self, entry: &'b Entry) -> &'b Times {
        entry.times.as_ref().unwrap_or(&self.times[entry.channel])
    }

    /// Takes what still waits, and reads listed signals again whose values do not come in the order of their times, to take them in that order. Where
    /// these are more than memory should hold, a remark says that they have neither jitter nor spectrum.
    pub(super) fn put_in_order(&mut self) -> Result<Vec<Quality>, ReadError> {
        for entry in &mut self.entries {
            let shared = &self.times[entry.channel];
            entry.begin(shared, self.request.longest_s());
        }
        let entries = self.entries.iter().enumerate();
        let tangled: HashMap<String, usize> = entries
            .filter(|(_, e)| e.listed && self.times_of(e).backward())
            .map(|(k, e)| (e.path.clone(), k))
            .collect();
        let values = |k: &usize| self.times_of(&self.entries[*k]).count();
        let all: u64 = tangled.values().map(values).sum();
        if all > MOST_SORTED {
            let topics: BTreeSet<usize> = (tangled.values())
                .map(|k| self.first[self.entries[*k].channel])
                .collect();
            let told = |k: &usize| {
                let text = format!(
                    "messages do not come in the order of their times, and {all} values are more than are sorted ({MOST_SORTED}): their signals have neither jitter nor spectrum; --topic or --signal asks for fewer"
                );
                Quality::remark(&self.recording.info().channels[*k].topic, "unsorted", text)
            };
            return Ok(topics.iter().map(told).collect());
        }
        if tangled.is_empty() {
            return Ok(Vec::new());
        }
        let mut found: Vec<Vec<(i64, f64)>> = vec![Vec::new(); self.entries.len()];
        let mut quaternions = Quaternions::default();
        // What is called otherwise, because another topic has a field of its name, is asked for by that.
        let named = |k: &usize| {
            let (topic, field) = self.names(&self.entries[*k]);
            format!("{topic}.{field}")
        };
        let names: BTreeSet<String> = tangled.values().map(named).collect();
        let asked = |path: &str| tangled.contains_key(path) || names.contains(path);
        let select = |path: &str| with_angles(path, asked);
        self.recording.stream(&select, &mut |batch| {
            let mut keep = |path: &str, rows: Option<&[u32]>, values: &[f64]| {
                if let Some(entry) = tangled.get(path) {
                    let time = |k: usize| batch.times_ns[rows.map_or(k, |rows| rows[k] as usize)];
                    found[*entry].extend(values.iter().enumerate().map(|(k, x)| (time(k), *x)));
                }
            };
            for column in batch.columns {
                keep(column.path, column.rows, column.values);
            }
            quaternions.each(batch, keep);
        })?;
        let start_ns = self.recording.info().start_ns;
        for (entry, mut values) in self.entries.iter_mut().zip(found) {
            values.retain(|(t, _)| self.request.holds(seconds(start_ns, *t)));
            values.sort_by_key(|(t, _)| *t);
            if !values.is_empty() {
                entry.take_sorted(Times::since(start_ns), values.into_iter().unzip());
            }
        }
        Ok(Vec::new())
    }

    /// The topic of a signal, and its path in the message.
    pub(super) fn names<'s>(&'s self, entry: &'s Entry) -> (&'s str, &'s str) {
        let topic = self.recording.info().channels[entry.channel].topic.as_str();
        (topic, field(topic, &entry.path))
    }
}

/// Whether a field has to be decoded: it is listed, plays a role, or is part of a quaternion whose angles are or do.
pub(super) fn wanted(path: &str, request: &Request, roles: &Roles) -> bool {
    let wants = |path: &str| request.may_list(path) || roles.of_signal(path).is_some();
    let times = |topic: &str| roles.feeds(topic);
    path.strip_suffix(".time_s").is_some_and(times) || with_angles(path, wants)
}

/// Whether a field is wanted, or an angle of the quaternion that it is part of.
pub(crate) fn with_angles(path: &str, wants: impl Fn(&str) -> bool) -> bool {
    if wants(path) {
        return true;
    }
    let part = path
        .rsplit_once('.')
        .filter(|(_, last)| matches!(*last, "x" | "y" | "z" | "w"));
    part.is_some_and(|(prefix, _)| {
        crate::quaternion::ANGLES
            .iter()
            .any(|angle| wants(&format!("{prefix}.{angle}")))
    })
}

/// The path of a signal in its message.
pub(super) fn field<'a>(topic: &str, path: &'a str) -> &'a str {
    path.strip_prefix(topic)
        .unwrap_or(path)
        .trim_start_matches(['.', ':'])
}

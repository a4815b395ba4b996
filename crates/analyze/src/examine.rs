//! A recording in one pass: a line per signal, the roles' columns, what is odd; then metrics, spectra and events.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use rayon::prelude::*;
use recording::read::{Batch, ReadError, Recording};
use recording::signal::unit_of;
use recording::text::counted;

use crate::arrivals::{Arrivals, Axis};
use crate::envelope::Envelope;
use crate::events::{Event, events};
use crate::field::{ACCEL, DeviceClocks, Field, GYRO};
use crate::inputs::{Inputs, Window, between};
use crate::metrics::{self, Metrics};
use crate::peaks::SpectrumSummary;
use crate::phase::{unwrap, wrap};
use crate::quality::Quality;
use crate::quaternion::Quaternions;
use crate::roles::{AngleUnit, Role, Roles, RolesFile, matches, of_topic, stands_beside};
use crate::summary::{Stream, Summary, Times, segment};

/// What is asked of a recording.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// First and last moment of the window (s); what is `None` is decided by the recording.
    pub window: (Option<f64>, Option<f64>),
    /// Signals to list, with wildcards; empty means all.
    pub signals: Vec<String>,
    /// Topics to list, with wildcards; empty means all.
    pub topics: Vec<String>,
    /// Who plays which role, where the user says so.
    pub roles: Option<RolesFile>,
    /// Judge estimates by the recorded truth.
    pub truth: bool,
    /// What is done about the clocks of sensors.
    pub clocks: DeviceClocks,
    /// Keep the outlines of signals for drawing.
    pub traces: bool,
}

impl Request {
    /// Whether a signal of a topic is to be listed.
    pub fn lists(&self, topic: &str, path: &str) -> bool {
        (self.topics.is_empty() || self.topics.iter().any(|p| matches(p, topic)))
            && (self.signals.is_empty() || self.signals.iter().any(|p| matches(p, path)))
    }

    /// The same where the topic is not known apart from the path.
    pub(crate) fn lists_path(&self, path: &str) -> bool {
        (self.topics.is_empty() || self.topics.iter().any(|t| of_topic(t, path)))
            && (self.signals.is_empty() || self.signals.iter().any(|p| matches(p, path)))
    }

    /// Whether a moment is in the window that was asked for, s.
    pub(crate) fn holds(&self, t_s: f64) -> bool {
        self.window.0.is_none_or(|a| t_s >= a) && self.window.1.is_none_or(|b| t_s <= b)
    }
}

/// What a topic holds.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Topic {
    /// Name.
    pub name: String,
    /// Schema.
    pub schema: String,
    /// Encoding.
    pub encoding: String,
    /// Messages.
    pub messages: u64,
    /// Mean rate (Hz).
    pub hz: Option<f64>,
}

/// What is found in a recording.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// Name of the file.
    pub file: String,
    /// Last minus first log time (s).
    pub duration_s: f64,
    /// Samples of the motion, or messages of the busiest topic where there is none.
    pub samples: u64,
    /// The window (s).
    pub window: Window,
    /// Profile of the file.
    pub profile: String,
    /// Software that wrote it.
    pub library: String,
    /// Messages in all.
    pub messages: u64,
    /// Its topics, by name.
    pub topics: Vec<Topic>,
    /// The summary was missing or wrong.
    pub salvaged: bool,
    /// Messages lost.
    pub skipped_messages: u64,
    /// What the user should know of file and analysis.
    pub warnings: Vec<String>,
    /// Metadata record `rath`.
    pub metadata: Vec<(String, String)>,
    /// Role and the signals or topics that play it.
    pub roles: Vec<(&'static str, Vec<String>)>,
    /// Signals by path.
    pub signals: Vec<(String, Summary)>,
    /// Remarks.
    pub quality: Vec<Quality>,
    /// Metrics.
    pub metrics: Metrics,
    /// Spectra by signal.
    pub spectra: Vec<(String, SpectrumSummary)>,
    /// Events by time.
    pub events: Vec<Event>,
    /// The columns behind metrics, spectra and events, for figures.
    pub inputs: Inputs,
    /// Outlines of signals that play no role, where they were asked for.
    pub traces: Vec<Trace>,
    /// How many signals have no place in `traces`.
    pub undrawn: u64,
}

/// Signals of one topic and unit, or without one and alike large, drawn together, no more than there are colours: name, times (s) and values of each.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// Topic and the part of the path that the signals share.
    pub topic: String,
    /// What the ordinate shows, with its unit.
    pub label: String,
    /// Name, times and values.
    pub series: Vec<(String, Vec<f64>, Vec<f64>)>,
}

/// Whether one scale shows both: the larger's greatest size is at most ten times the smaller's.
fn are_alike_large(x: &[f64], y: &[f64]) -> bool {
    let [x, y] = [x, y].map(|v| v.iter().fold(0.0, |most: f64, v| most.max(v.abs())));
    x.max(y) <= 10.0 * x.min(y)
}

/// So many times tell a rate.
const FEW: u64 = 17;
/// So many values at most are put in the order of their times.
const MOST_SORTED: u64 = 1 << 24;
/// A topic that begins so late or ends so early is worth a word: this share of the window, and this long (s).
const LEAST_ABSENT: f64 = 0.02;
const LEAST_ABSENT_S: f64 = 1.0;
/// No attitude that is wrapped goes beyond half a turn (rad); a little more for what rounds.
const LARGEST_ANGLE_RAD: f64 = 3.15;
/// Where transforms of ROS and of Foxglove hold a place and an orientation.
const TRANSFORMS: [(&str, &str); 3] = [
    (
        "transforms[0].transform.translation",
        "transforms[0].transform.rotation",
    ),
    ("transforms[0].translation", "transforms[0].rotation"),
    ("translation", "rotation"),
];
/// At most so many panels of traces are kept.
const MOST_TRACES: usize = 24;
/// At most so many signals are drawn in one panel: as there are colours.
pub(crate) const MOST_SERIES: usize = 7;

impl Analysis {
    /// What is lost, where something is: one sentence; the exit code is 3 then.
    pub fn damage(&self) -> Option<String> {
        let losses = self.quality.iter().filter(|q| q.loss);
        let told: Vec<String> = losses.map(Quality::told).collect();
        (self.skipped_messages > 0 || !told.is_empty()).then(|| {
            let lost = match self.skipped_messages {
                0 if self.quality.iter().any(|q| q.kind == "truncated") => {
                    "its end is missing".to_owned()
                }
                0 => "no whole message is known to be lost".to_owned(),
                1 => "1 message is lost".to_owned(),
                n => format!("{n} messages are lost"),
            };
            format!(
                "{}: the file is damaged; {lost}, the rest was used: {}",
                self.file,
                told.join("; ")
            )
        })
    }

    /// Whether there is a signal that could be used.
    pub fn is_empty(&self) -> bool {
        self.signals.is_empty()
    }
}

/// Reads `recording` once and finds everything.
///
/// # Errors
/// Where the file cannot be read at all; damage inside it is part of the answer.
pub fn examine(
    file: &str,
    recording: &Recording,
    request: &Request,
) -> Result<Analysis, ReadError> {
    let info = recording.info();
    let channels = info
        .channels
        .iter()
        .map(|c| (c.topic.as_str(), c.schema.as_str()));
    let roles = Roles::infer(channels, request.roles.as_ref());
    let mut pass = Pass::new(recording, request, &roles);
    let select = |path: &str| wanted(path, request, &roles);
    let findings = recording.stream(&select, &mut |batch| pass.take(batch))?;
    let skipped_messages = recording.skipped_messages().max(info.skipped_messages);
    let mut quality: Vec<Quality> = findings.into_iter().map(Quality::from).collect();
    quality.sort_by(|a, b| (&a.topic, a.kind).cmp(&(&b.topic, b.kind)));

    let mut warnings = info.warnings.clone();
    let metadata: Vec<(String, String)> = info
        .metadata
        .get("rath")
        .map(|m| m.iter().map(|(k, v)| (k.clone(), v.clone())).collect())
        .unwrap_or_default();
    let duration_s = ((i128::from(info.end_ns) - i128::from(info.start_ns)) as f64 / 1e9).max(0.0);
    let said = request.roles.as_ref();
    warnings.extend(said.iter().flat_map(|said| pass.misnamed(said)));
    let mut remarks = pass.put_in_order()?;
    remarks.extend(pass.odd_values());
    remarks.extend(pass.date());
    let chosen = roles.chosen.iter();
    remarks
        .extend(chosen.map(|(topic, text)| Quality::remark(topic, "one_of_several", text.clone())));
    let mut inputs = pass.inputs(&metadata, said);
    // What was written at once lasts longer than its log.
    let own = pass.axes.values().filter_map(|axis| axis.own_s);
    let lasts_s = own.map(|e| e.1).fold(duration_s, f64::max);
    let until = |last_s: f64, warnings: &mut Vec<String>| {
        window(request, &metadata, said, lasts_s.max(last_s), warnings)
    };
    let mut field = match estimates(recording, &roles, request) {
        Ok(()) => Field::read(
            recording,
            &roles,
            inputs.gravity_m_per_s2,
            request.truth,
            request.clocks,
            |last_s| until(last_s, &mut Vec::new()),
        )?,
        Err(why) => {
            warnings.extend(why);
            Field::default()
        }
    };
    if request.truth && !field.has_truth() {
        warnings.push("no truth is known in the recording: estimates are judged by the pose of a topic whose name holds \"truth\", or of truth = \"TOPIC\" in a file for --roles".into());
    }
    let window = until(field.last_s(), &mut warnings);
    field.fill(&mut inputs);
    quality.extend(remarks);
    quality.extend(pass.coverage(window, &field.own_s));
    quality.extend(pass.unknown_movers());
    quality.extend(field.quality());
    let mut metrics = metrics::metrics(&inputs, window);
    field.finish(&inputs, &mut metrics, window);
    let f_hz = metrics
        .number("beat_hz")
        .or_else(|| metrics.number("peak_hz"));
    let mut spectra = spectra(&pass, &inputs, window, f_hz);
    let signals = pass.signals(f_hz, &mut spectra);
    let mut events = events(&inputs, window);
    events.extend(quality.iter().filter(|q| q.kind == "gap").filter_map(|q| {
        Some(Event {
            t_s: q.t_s?,
            kind: "gap",
            what: format!("{}: {}", q.topic, q.text),
        })
    }));
    events.extend(field.events());
    events.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
    let (traces, undrawn) = pass.traces();
    let topics = pass.topics();
    let samples = match inputs.t_s.len() {
        0 => topics.iter().map(|t| t.messages).max().unwrap_or(0),
        n => n as u64,
    };
    Ok(Analysis {
        file: file.to_owned(),
        duration_s,
        samples,
        window,
        profile: info.profile.clone(),
        library: info.library.clone(),
        messages: info.messages,
        topics,
        salvaged: info.salvaged,
        skipped_messages,
        warnings,
        metadata,
        roles: pass.roles_played(),
        signals,
        quality,
        metrics,
        spectra,
        events,
        inputs,
        traces,
        undrawn,
    })
}

/// Whether motion is estimated from inertial sensors; where there are some and it is not, the reason.
fn estimates(
    recording: &Recording,
    roles: &Roles,
    request: &Request,
) -> Result<(), Option<String>> {
    let mut sensors = roles
        .patterns(Role::Imu)
        .iter()
        .chain(roles.patterns(Role::Carriers));
    let channels = &recording.info().channels;
    let any = sensors.any(|t| channels.iter().any(|c| c.topic == *t && c.messages > 0));
    if any && !request.truth && !request.signals.is_empty() {
        return Err(Some(
            "motion is not estimated from the inertial sensors where --signal narrows what is read"
                .into(),
        ));
    }
    Ok(())
}

/// Whether a field has to be decoded: it is listed, plays a role, or is part of a quaternion whose angles are or do.
fn wanted(path: &str, request: &Request, roles: &Roles) -> bool {
    let wants = |path: &str| request.lists_path(path) || roles.of_signal(path).is_some();
    let times = |topic: &str| roles.feeds(topic);
    path.strip_suffix(".time_s").is_some_and(times) || with_angles(path, wants)
}

/// Whether a field is wanted, or an angle of the quaternion that it is part of.
fn with_angles(path: &str, wants: impl Fn(&str) -> bool) -> bool {
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

/// The window: what the user says, else from the recording's own start of analysis to its end.
fn window(
    request: &Request,
    metadata: &[(String, String)],
    said: Option<&RolesFile>,
    duration_s: f64,
    warnings: &mut Vec<String>,
) -> Window {
    let end_s = request.window.1.unwrap_or(duration_s);
    let own = said
        .and_then(|s| s.analysis_start_s)
        .or_else(|| number(metadata, "analysis_start_s"))
        .unwrap_or(0.0);
    let start_s = match request.window.0 {
        Some(start_s) => start_s,
        None if own < end_s || own == 0.0 => own,
        None => {
            let what = match request.window.1 {
                Some(_) => "window",
                None => "recording",
            };
            warnings.push(format!("the {what} ends at {end_s:.3} s, before the recording's own analysis would start at {own} s: all of it from 0 s on is analysed"));
            0.0
        }
    };
    if start_s > duration_s || end_s < 0.0 {
        warnings.push(format!("the window from {start_s} to {end_s} s is outside the recording, which lasts {duration_s:.3} s: nothing is analysed"));
    }
    Window { start_s, end_s }
}

/// A finite number out of a metadata record.
fn number(metadata: &[(String, String)], key: &str) -> Option<f64> {
    let (_, value) = metadata.iter().find(|(k, _)| k == key)?;
    value.trim().parse().ok().filter(|x: &f64| x.is_finite())
}

/// One signal on the way.
struct Entry {
    path: String,
    unit: &'static str,
    channel: usize,
    listed: bool,
    /// Whether a spectrum is made of it.
    lines: bool,
    role: Option<Role>,
    stream: Stream,
    /// Times of its own where not every message has it.
    times: Option<Times>,
    /// Kept values, where it plays a role, and of which messages of the topic they are.
    kept: Vec<(usize, f64)>,
    /// Its outline, where it is to be drawn.
    outline: Option<Envelope>,
}

impl Entry {
    /// Takes all values anew, in the order of their times.
    fn take_sorted(&mut self, (times_ns, x): (Vec<i64>, Vec<f64>)) {
        let mut times = Times::default();
        times.push(&times_ns);
        let hz = times.hz_between_gaps().unwrap_or(0.0);
        let nperseg = match self.lines {
            true => segment(hz, x.len() as u64),
            false => 0,
        };
        self.stream = Stream::new(hz, nperseg);
        self.stream.push(&x, false, times.gaps());
        self.times = Some(times);
    }
}

/// What is gathered while batches stream by.
struct Pass<'a> {
    recording: &'a Recording,
    request: &'a Request,
    roles: &'a Roles,
    times: Vec<Times>,
    /// The first channel of each channel's topic.
    first: Vec<usize>,
    /// By first channel of a topic: how many messages all its channels have.
    messages: Vec<u64>,
    /// By first channel of a topic: its messages, where it may feed metrics.
    arrivals: Vec<Arrivals>,
    /// Where the messages of the batch begin in `arrivals`.
    row: usize,
    /// By first channel of a topic: when its messages were taken, where it feeds metrics.
    axes: HashMap<usize, Axis>,
    /// Rough rate of each channel, for the length of the segments (Hz).
    rough_hz: Vec<f64>,
    entries: Vec<Entry>,
    /// Entry of a column of the stream.
    by_column: Vec<Option<usize>>,
    /// Entries of the angles of a quaternion, by the path of the quaternion.
    quaternions: Quaternions,
    by_path: HashMap<String, usize>,
    scratch: Vec<i64>,
}

impl<'a> Pass<'a> {
    fn new(recording: &'a Recording, request: &'a Request, roles: &'a Roles) -> Self {
        let info = recording.info();
        let span_s = (info.end_ns.saturating_sub(info.start_ns)) as f64 / 1e9;
        let rough = |messages: u64| {
            if span_s > 0.0 {
                messages.saturating_sub(1) as f64 / span_s
            } else {
                0.0
            }
        };
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
            times: vec![Times::default(); info.channels.len()],
            rough_hz: info.channels.iter().map(|c| rough(c.messages)).collect(),
            entries: Vec::new(),
            by_column: Vec::new(),
            quaternions: Quaternions::default(),
            by_path: HashMap::new(),
            scratch: Vec::new(),
        }
    }

    fn take(&mut self, batch: &Batch<'_>) {
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
    }

    fn entry(&mut self, batch: &Batch<'_>, path: &str, unit: &'static str) -> usize {
        let field = field(batch.topic, path);
        // The batch's own rate, where it shows one: a topic need not last as long as the file.
        let times = &self.times[batch.channel];
        let hz = match times.count() >= FEW {
            true => times.hz_between_gaps(),
            false => None,
        }
        .unwrap_or(self.rough_hz[batch.channel]);
        let mut messages = self.messages[self.first[batch.channel]];
        if let (from, Some(to)) = self.request.window {
            let window = ((to - from.unwrap_or(0.0)).max(0.0) * hz).ceil();
            messages = messages.min(window as u64);
        }
        let listed = self.request.lists(batch.topic, path);
        // A stamp's seconds and nanoseconds are a clock, not a signal with lines.
        let clock = field.contains("stamp.") || field == "time_s";
        let lines = listed && !clock;
        let nperseg = if lines { segment(hz, messages) } else { 0 };
        self.entries.push(Entry {
            path: path.to_owned(),
            unit,
            channel: batch.channel,
            listed,
            lines,
            role: self.roles.of_signal(path),
            stream: Stream::new(hz, nperseg),
            times: None,
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
        if entry.listed {
            let start_ns = i128::from(self.recording.info().start_ns);
            match self.request.window {
                (None, None) => {
                    if rows.is_some() && entry.times.is_none() {
                        entry.times = Some(Times::default());
                    }
                    // A topic may come on several channels.
                    if batch.channel != entry.channel && entry.times.is_none() {
                        entry.times = Some(self.times[entry.channel].clone());
                    }
                    let gaps = match &mut entry.times {
                        Some(own) => {
                            own.push(times);
                            own.gaps()
                        }
                        None => self.times[batch.channel].gaps(),
                    };
                    entry.stream.push(values, finite, gaps);
                }
                _ => {
                    let inside =
                        |t: i64| (self.request).holds((i128::from(t) - start_ns) as f64 / 1e9);
                    let (kept, x): (Vec<i64>, Vec<f64>) = (times.iter().zip(values))
                        .filter(|(t, _)| inside(**t))
                        .map(|(t, x)| (*t, *x))
                        .unzip();
                    let own = entry.times.get_or_insert_default();
                    own.push(&kept);
                    entry.stream.push(&x, finite, own.gaps());
                }
            }
        }
        if let Some(outline) = &mut entry.outline {
            let start_ns = i128::from(self.recording.info().start_ns);
            times
                .iter()
                .zip(values)
                .for_each(|(t, x)| outline.push((i128::from(*t) - start_ns) as f64 / 1e9, *x));
        }
        if entry.role.is_some() {
            let row = |k: usize| self.row + rows.map_or(k, |rows| rows[k] as usize);
            entry
                .kept
                .extend(values.iter().enumerate().map(|(k, x)| (row(k), *x)));
        }
    }

    fn topics(&self) -> Vec<Topic> {
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
    fn times_of<'b>(&'b self, entry: &'b Entry) -> &'b Times {
        entry.times.as_ref().unwrap_or(&self.times[entry.channel])
    }

    /// Reads listed signals again whose values do not come in the order of their times, and takes them in that order. Where these are more than
    /// memory should hold, a remark says that they have neither jitter nor spectrum.
    fn put_in_order(&mut self) -> Result<Vec<Quality>, ReadError> {
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
        let select = |path: &str| with_angles(path, |path| tangled.contains_key(path));
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
        let start_ns = i128::from(self.recording.info().start_ns);
        for (entry, mut values) in self.entries.iter_mut().zip(found) {
            values.retain(|(t, _)| self.request.holds((i128::from(*t) - start_ns) as f64 / 1e9));
            values.sort_by_key(|(t, _)| *t);
            if !values.is_empty() {
                entry.take_sorted(values.into_iter().unzip());
            }
        }
        Ok(Vec::new())
    }

    /// The topic of a signal, and its path in the message.
    fn names<'s>(&'s self, entry: &'s Entry) -> (&'s str, &'s str) {
        let topic = self.recording.info().channels[entry.channel].topic.as_str();
        (topic, field(topic, &entry.path))
    }

    /// Remarks on single values: what is no rotation, and what is too large or too small to be squared.
    fn odd_values(&self) -> Vec<Quality> {
        let info = self.recording.info();
        let start_ns = i128::from(info.start_ns);
        let mut out = Vec::new();
        for (path, (channel, count, first_ns)) in &self.quaternions.odd {
            let topic = &info.channels[*channel].topic;
            let Some(roll) = self.by_path.get(&format!("{path}.roll")) else {
                continue;
            };
            let roll = &self.entries[*roll];
            // One that never is a rotation and plays no role is not meant to be one.
            let plays = |e: &Entry| e.role.is_some() && e.path.starts_with(&format!("{path}."));
            if roll.stream.count() == 0 && !self.entries.iter().any(plays) {
                continue;
            }
            let t_s = (i128::from(*first_ns) - start_ns) as f64 / 1e9;
            let field = field(topic, path);
            out.push(Quality {
                count: *count,
                t_s: Some(t_s),
                ..Quality::remark(topic, "no_rotation", format!(
                    "{} of {field} far from unit length, first at {t_s:.3} s: no rotation, so left without angles",
                    counted(*count, "quaternion", "quaternions")
                ))
            });
        }
        let attitude = [Role::Roll, Role::Pitch, Role::Yaw].into_iter();
        for entry in attitude.flat_map(|role| self.players(role)) {
            let most = (entry.kept.iter().map(|(_, x)| x.abs())).fold(0.0, f64::max);
            let told = !entry.unit.is_empty() || self.in_degrees(entry);
            if most > LARGEST_ANGLE_RAD && !told {
                let (topic, field) = self.names(entry);
                out.push(Quality::remark(topic, "large_angle", format!(
                    "{field} reaches {most:.1}, taken as radians: where these are degrees, write angle_unit = \"deg\" in a roles file"
                )));
            }
        }
        for entry in self.entries.iter().filter(|e| e.listed) {
            if let Some((low, high)) = entry.stream.beyond_squares() {
                let (topic, field) = self.names(entry);
                out.push(Quality::remark(topic, "out_of_range", format!(
                    "values of {field} from {low:e} to {high:e} cannot be squared with the digits of a float: no spread and no spectrum is told of them"
                )));
            }
        }
        out
    }

    /// Where nothing tells how anybody moves, remarks on topics that might, though their type does not say so, with what to write.
    fn unknown_movers(&self) -> Vec<Quality> {
        let movers = [Role::Height, Role::Roll, Role::Imu, Role::Carriers];
        if movers.iter().any(|r| !self.roles.patterns(*r).is_empty()) {
            return Vec::new();
        }
        let paths: HashSet<&str> = self.entries.iter().map(|e| &*e.path).collect();
        let topics = self.recording.info().channels.iter();
        let topics: BTreeSet<&str> = topics.map(|c| c.topic.as_str()).collect();
        let mut out = Vec::new();
        for topic in topics.into_iter().filter(|t| !stands_beside(t)) {
            let has = |field: String| paths.contains(&*format!("{topic}.{field}"));
            let transforms = TRANSFORMS
                .iter()
                .find(|(place, turn)| has(format!("{place}.z")) && has(format!("{turn}.roll")));
            let (what, lines) = if GYRO.iter().chain(&ACCEL).all(|f| has((*f).to_owned())) {
                (
                    "holds what an inertial sensor tells",
                    format!("imu = \"{topic}\""),
                )
            } else if let Some((place, turn)) = transforms {
                (
                    "holds transforms",
                    format!("height = \"{topic}.{place}.z\" and roll = \"{topic}.{turn}.roll\""),
                )
            } else {
                continue;
            };
            let text = format!(
                "{what}, but its type does not say whose: if it is the load's, write {lines} into a file for --roles"
            );
            out.push(Quality::remark(topic, "unknown_type", text));
        }
        out
    }

    /// Remarks on topics that metrics rest on and that cover clearly less of the window than there is of the recording.
    fn coverage(&self, window: Window, own_s: &BTreeMap<String, (f64, f64)>) -> Vec<Quality> {
        let info = self.recording.info();
        let start_ns = i128::from(info.start_ns);
        let since = |t: i64| (i128::from(t) - start_ns) as f64 / 1e9;
        let axes = self.axes.values().filter_map(|axis| axis.own_s);
        let lasts_s = own_s.values().copied().chain(axes).map(|e| e.1);
        let lasts_s = lasts_s.fold(since(info.end_ns), f64::max);
        let from_s = window.start_s.max(0.0);
        let to_s = window.end_s.min(lasts_s);
        let sensors = [Role::Imu, Role::Carriers].map(|role| self.roles.patterns(role));
        let players = self.entries.iter().filter(|e| !e.kept.is_empty());
        let fed: HashSet<usize> = players.map(|e| self.first[e.channel]).collect();
        let sensor = |topic: &String| sensors.iter().any(|topics| topics.contains(topic));
        let feeds = |k: usize| fed.contains(&k) || sensor(&info.channels[k].topic);
        let mut out = Vec::new();
        for k in (0..info.channels.len()).filter(|k| self.first[*k] == *k && feeds(*k)) {
            let of_topic = || (0..info.channels.len()).filter(|j| self.first[*j] == k);
            let ends = of_topic().filter_map(|j| self.times[j].ends_ns());
            let ends = ends.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
            let told = ends.map(|(a, b)| (since(a), since(b)));
            let of_sensor = own_s.get(&info.channels[k].topic).copied();
            let own_s = of_sensor.or_else(|| self.axes.get(&k)?.own_s);
            let Some((first_s, last_s)) = own_s.or(told) else {
                continue;
            };
            let messages: u64 = of_topic().map(|j| self.times[j].count()).sum();
            let step_s = (last_s - first_s) / messages.max(2) as f64;
            let much_s = LEAST_ABSENT_S
                .max(LEAST_ABSENT * (to_s - from_s))
                .max(5.0 * step_s);
            let mut say = |kind, t_s: f64, text: String| {
                let remark = Quality::remark(&info.channels[k].topic, kind, text);
                out.push(Quality {
                    t_s: Some(t_s),
                    ..remark
                });
            };
            if first_s - from_s > much_s {
                let late_s = first_s - from_s;
                say(
                    "begins_late",
                    first_s,
                    format!(
                        "the first message is of {first_s:.3} s, {late_s:.3} s after the window begins: what rests on it does not speak of the time before"
                    ),
                );
            }
            if to_s - last_s > much_s {
                let early_s = to_s - last_s;
                say(
                    "ends_early",
                    last_s,
                    format!(
                        "the last message is of {last_s:.3} s, {early_s:.3} s before the window ends: what rests on it does not speak of the time after"
                    ),
                );
            }
        }
        out
    }

    /// A line for every listed signal. Spectra of those that were asked for by name are added to `spectra`, which are named after f.
    fn signals(
        &self,
        f_hz: Option<f64>,
        spectra: &mut Vec<(String, SpectrumSummary)>,
    ) -> Vec<(String, Summary)> {
        let known: HashSet<&str> = spectra.iter().map(|(path, _)| path.as_str()).collect();
        let told = |e: &Entry| !self.request.signals.is_empty() && !known.contains(&*e.path);
        // Each signal by itself, so on all processors.
        let found: Vec<(Summary, Option<SpectrumSummary>)> = self
            .entries
            .par_iter()
            .filter(|e| e.listed)
            .map(|e| {
                let times = self.times_of(e);
                let (summary, spectrum) = e.stream.finish(times, e.unit, told(e));
                let spectrum = spectrum.map(|s| SpectrumSummary::new(s, f_hz, e.unit));
                (summary, spectrum)
            })
            .collect();
        let mut signals = Vec::with_capacity(found.len());
        let paths = self.entries.iter().filter(|e| e.listed).map(|e| &e.path);
        for (path, (summary, told)) in paths.zip(found) {
            spectra.extend(told.map(|told| (path.clone(), told)));
            // Angles of a quaternion that never held a rotation say nothing.
            if summary.count > 0 || !self.by_path.contains_key(path) {
                signals.push((path.clone(), summary));
            }
        }
        signals.sort_by(|a, b| natural(&a.0, &b.0));
        signals
    }

    /// Outlines of moving signals without a role, those of one vector together, and how many find no place.
    fn traces(&self) -> (Vec<Trace>, u64) {
        // Topics that play a role are drawn as that; transforms, scenes and joints repeat them, where there are some.
        let none = self.entries.iter().all(|e| e.role.is_none())
            && (self.roles.topic(Role::Imu).is_none()
                && self.roles.topic(Role::Carriers).is_none());
        let known = |channel: usize| {
            let info = &self.recording.info().channels[channel];
            let repeats = [
                "TFMessage",
                "SceneUpdate",
                "FrameTransform",
                "FrameTransforms",
            ]
            .iter()
            .any(|s| info.schema.ends_with(s));
            (repeats && !none)
                || info.topic == recording::topics::MOTION
                || self
                    .entries
                    .iter()
                    .any(|e| e.channel == channel && e.role.is_some())
        };
        let mut drawn: Vec<&Entry> = self
            .entries
            .iter()
            .filter(|e| e.outline.is_some() && !known(e.channel))
            .collect();
        drawn.sort_by(|a, b| natural(&a.path, &b.path));
        let mut traces: Vec<Trace> = Vec::new();
        let mut undrawn = 0;
        for entry in drawn {
            let Some(outline) = &entry.outline else {
                continue;
            };
            let (t_s, x) = outline.points();
            let moves = x.iter().any(|v| *v != x[0]);
            if !moves {
                continue;
            }
            let (shared, last) = entry.path.rsplit_once('.').unwrap_or(("", &entry.path));
            let label = if entry.unit.is_empty() {
                "value".to_owned()
            } else {
                entry.unit.to_owned()
            };
            let fits = |t: &Trace| {
                let seen = &t.series[0].2;
                let alike = !entry.unit.is_empty() || are_alike_large(seen, &x);
                t.topic == shared && t.label == label && alike && t.series.len() < MOST_SERIES
            };
            match traces.iter().position(fits) {
                Some(k) => traces[k].series.push((last.to_owned(), t_s, x)),
                None if traces.len() < MOST_TRACES => {
                    traces.push(Trace {
                        topic: shared.to_owned(),
                        label,
                        series: vec![(last.to_owned(), t_s, x)],
                    });
                }
                None => undrawn += 1,
            }
        }
        (traces, undrawn)
    }

    fn roles_played(&self) -> Vec<(&'static str, Vec<String>)> {
        let topics: Vec<&str> = self
            .recording
            .info()
            .channels
            .iter()
            .map(|c| c.topic.as_str())
            .collect();
        let mut out = Vec::new();
        for (role, patterns) in self.roles.iter() {
            let mut players: Vec<String> = match role.is_topic() {
                true => patterns
                    .iter()
                    .filter(|p| topics.contains(&p.as_str()))
                    .cloned()
                    .collect(),
                false => self.players(role).map(|e| e.path.clone()).collect(),
            };
            if !role.is_topic() {
                players.sort_by(|a, b| natural(a, b));
            }
            if !players.is_empty() {
                out.push((role.name(), players));
            }
        }
        out
    }

    fn players(&self, role: Role) -> impl Iterator<Item = &Entry> {
        self.entries
            .iter()
            .filter(move |e| e.role == Some(role) && !e.kept.is_empty())
    }

    /// Whether two signals are of one topic.
    fn together(&self, a: &Entry, b: &Entry) -> bool {
        self.first[a.channel] == self.first[b.channel]
    }

    /// Finds when the messages that feed metrics were taken; remarks on topics where that is not what the log says.
    fn date(&mut self) -> Vec<Quality> {
        let mut by_topic: BTreeMap<usize, Vec<&Entry>> = BTreeMap::new();
        for entry in self.entries.iter().filter(|e| !e.kept.is_empty()) {
            let topic = self.first[entry.channel];
            by_topic.entry(topic).or_default().push(entry);
        }
        let info = self.recording.info();
        let mut remarks = Vec::new();
        for (topic, entries) in by_topic {
            let arrivals = &self.arrivals[topic];
            let columns: Vec<_> =
                (entries.iter().map(|e| by_row(&e.kept, arrivals.len()))).collect();
            let bits = |x: Option<f64>| x.map(f64::to_bits);
            let axis = arrivals.dated(info.start_ns, |a, b| {
                columns.iter().all(|x| bits(x[a]) == bits(x[b]))
            });
            let name = &info.channels[topic].topic;
            let told =
                |(kind, text): &(&'static str, String)| Quality::remark(name, kind, text.clone());
            remarks.extend(axis.remarks.iter().map(told));
            self.axes.insert(topic, axis);
        }
        remarks
    }

    /// Whether an angle that plays a role is in degrees: by its field's name, else by the roles file.
    fn in_degrees(&self, entry: &Entry) -> bool {
        let said = self.request.roles.as_ref().and_then(|r| r.angle_unit);
        let told = !entry.unit.is_empty();
        let degrees = if told {
            entry.unit == "deg"
        } else {
            said == Some(AngleUnit::Deg)
        };
        degrees && entry.role.is_some_and(Role::is_angle)
    }

    /// A role's column, ascending in time, at most one value per time; angles in radians.
    fn column(&self, entry: &Entry) -> (Vec<f64>, Vec<f64>) {
        let topic = self.first[entry.channel];
        let Some(axis) = self.axes.get(&topic) else {
            return Default::default();
        };
        let mut x = by_row(&entry.kept, self.arrivals[topic].len());
        if self.in_degrees(entry) {
            x.iter_mut().flatten().for_each(|a| *a = a.to_radians());
        }
        let each = axis.t_s.iter().zip(&axis.rows);
        each.filter_map(|(t, row)| Some((*t, x[*row]?))).unzip()
    }

    /// What a roles file names and the recording does not have, or has too much of.
    fn misnamed(&self, said: &RolesFile) -> Vec<String> {
        let mut out = Vec::new();
        let channels = &self.recording.info().channels;
        for role in Role::ALL {
            let (patterns, word) = (said.patterns(role), role.name());
            let names: Vec<&str> = match role.is_topic() {
                true => channels.iter().map(|c| c.topic.as_str()).collect(),
                false => self.entries.iter().map(|e| e.path.as_str()).collect(),
            };
            for pattern in &patterns {
                if names.iter().any(|name| matches(pattern, name)) {
                    continue;
                }
                let far = |name| (strsim::damerau_levenshtein(name, pattern), name);
                let nearest = names.iter().copied().map(far).min_by_key(|(far, _)| *far);
                let near = nearest.filter(|(far, _)| 3 * far <= pattern.len());
                let hint =
                    near.map_or(String::new(), |(_, name)| format!("; did you mean {name}?"));
                out.push(format!(
                    "the roles file's {word}, {pattern}, is not in the recording{hint}"
                ));
            }
            let found = self.players(role).count();
            if role.is_single() && !patterns.is_empty() && found > 0 && self.player(role).is_none()
            {
                out.push(format!(
                    "the roles file's {word} fits {found} signals, where one is expected: none is taken"
                ));
            }
        }
        out
    }

    /// The one that plays a role; where several would, none does.
    fn player(&self, role: Role) -> Option<&Entry> {
        let mut players = self.players(role);
        let first = players.next()?;
        players.all(|p| p.path == first.path).then_some(first)
    }

    fn inputs(&self, metadata: &[(String, String)], said: Option<&RolesFile>) -> Inputs {
        let mut inputs = Inputs {
            mass_kg: said
                .and_then(|s| s.mass_kg)
                .or_else(|| number(metadata, "mass_kg"))
                .filter(|m| *m > 0.0),
            ..Inputs::default()
        };
        if let Some(g) = said
            .and_then(|s| s.gravity_m_per_s2)
            .or_else(|| number(metadata, "gravity_m_per_s2"))
            .filter(|g| *g > 0.0)
        {
            inputs.gravity_m_per_s2 = g;
        }
        // Motion: the time axis of the roll, else of whatever is there.
        for role in [Role::Roll, Role::Height, Role::Pitch, Role::Yaw] {
            let Some(entry) = self.player(role) else {
                continue;
            };
            let (t_s, x) = self.column(entry);
            if inputs.t_s.is_empty() {
                inputs.t_s.clone_from(&t_s);
            }
            let (x, own) = match (t_s == inputs.t_s, role) {
                (true, _) => (x, None),
                (false, Role::Yaw) => (wrapped(&t_s, &x, &inputs.t_s), None),
                (false, _) => (between(&t_s, &x, &inputs.t_s), Some((t_s, x))),
            };
            match role {
                Role::Roll => inputs.roll_rad = x,
                Role::Height => {
                    inputs.height_alone = own;
                    inputs.height_m = x;
                }
                Role::Pitch => inputs.pitch_rad = x,
                _ => inputs.yaw_rad = x,
            }
        }
        (inputs.force_t_s, inputs.normal_n) = self.columns(Role::Forces);
        (inputs.phase_t_s, inputs.phase_rad) = self.columns(Role::Phases);
        if let Some(entry) = self.player(Role::BeatPhase) {
            let (t_s, psi) = self.column(entry);
            if inputs.phase_t_s.is_empty() {
                inputs.phase_t_s.clone_from(&t_s);
            }
            let beside = self.players(Role::Phases).next();
            inputs.beat_phase_rad = match beside.is_none_or(|p| self.together(p, entry)) {
                true => at_times(&t_s, &psi, &inputs.phase_t_s),
                false => wrapped(&t_s, &psi, &inputs.phase_t_s),
            };
        }
        let ours = self
            .players(Role::Roll)
            .chain(self.players(Role::Height))
            .next();
        if let Some(entry) = ours {
            let schema = &self.recording.info().channels[entry.channel].schema;
            if schema != "rath.State" {
                inputs.sources.attitude = "pose".into();
                inputs.sources.height = "pose".into();
            }
        }
        inputs
    }

    /// All columns of a role on the time axis of the one that has most samples; NaN where a column has no value at a time.
    fn columns(&self, role: Role) -> (Vec<f64>, Vec<Vec<f64>>) {
        let mut players: Vec<&Entry> = self.players(role).collect();
        players.sort_by(|a, b| natural(&a.path, &b.path));
        let found: Vec<_> = players.iter().map(|entry| self.column(entry)).collect();
        let lengths = found.iter().map(|(t_s, _)| t_s.len());
        let Some((first, _)) = lengths.enumerate().rev().max_by_key(|(_, n)| *n) else {
            return Default::default();
        };
        let axis = found[first].0.clone();
        let on_axis = |(entry, (t_s, x)): (&&Entry, (Vec<f64>, Vec<f64>))| match (
            t_s == axis,
            self.together(entry, players[first]),
        ) {
            (true, _) => x,
            (false, true) => at_times(&t_s, &x, &axis),
            (false, false) if role == Role::Phases => wrapped(&t_s, &x, &axis),
            (false, false) => between(&t_s, &x, &axis),
        };
        let columns = players.iter().zip(found).map(on_axis).collect();
        (axis, columns)
    }
}

/// The path of a signal in its message.
fn field<'a>(topic: &str, path: &'a str) -> &'a str {
    path.strip_prefix(topic)
        .unwrap_or(path)
        .trim_start_matches('.')
}

/// Values by message; `None` where a message has none.
fn by_row(kept: &[(usize, f64)], messages: usize) -> Vec<Option<f64>> {
    let mut x = vec![None; messages];
    kept.iter().for_each(|(row, value)| x[*row] = Some(*value));
    x
}

/// An angle (rad), wrapped or not, at other times, by the shorter way between samples; −π … π, NaN beyond the ends and in holes.
fn wrapped(t_s: &[f64], x: &[f64], axis: &[f64]) -> Vec<f64> {
    let known = t_s.iter().zip(x).filter(|(_, x)| x.is_finite());
    let (t_s, x): (Vec<f64>, Vec<f64>) = known.unzip();
    let straight = between(&t_s, &unwrap(&x), axis);
    straight.into_iter().map(wrap).collect()
}

/// The values at exactly the times of `axis`; NaN where there is none.
fn at_times(t_s: &[f64], x: &[f64], axis: &[f64]) -> Vec<f64> {
    let mut k = 0;
    axis.iter()
        .map(|at| {
            while k < t_s.len() && t_s[k] < *at {
                k += 1;
            }
            if k < t_s.len() && t_s[k] == *at {
                x[k]
            } else {
                f64::NAN
            }
        })
        .collect()
}

/// Spectra of the roles' columns.
fn spectra(
    pass: &Pass,
    inputs: &Inputs,
    window: Window,
    f_hz: Option<f64>,
) -> Vec<(String, SpectrumSummary)> {
    let name = |role: Role, k: usize| {
        let mut paths: Vec<&str> = pass.players(role).map(|e| e.path.as_str()).collect();
        paths.sort_by(|a, b| natural(a, b));
        paths
            .get(k)
            .map_or_else(|| role.name().to_owned(), |p| (*p).to_owned())
    };
    let mut out = Vec::new();
    let (height_t_s, height_m) = inputs.height();
    for (role, t_s, x, unit) in [
        (Role::Height, height_t_s, height_m, "m"),
        (Role::Roll, &inputs.t_s, &inputs.roll_rad, "rad"),
        (Role::Pitch, &inputs.t_s, &inputs.pitch_rad, "rad"),
    ] {
        let found = SpectrumSummary::of(t_s, x, window, f_hz, unit);
        out.extend(found.map(|s| (name(role, 0), s)));
    }
    for (k, force) in inputs.normal_n.iter().enumerate() {
        out.extend(
            SpectrumSummary::of(inputs.force_times(), force, window, f_hz, "N")
                .map(|s| (name(Role::Forces, k), s)),
        );
    }
    out
}

/// Order of names in which numbers count as numbers: `[2]` before `[10]`.
fn natural(a: &str, b: &str) -> std::cmp::Ordering {
    let (mut a, mut b) = (a.as_bytes(), b.as_bytes());
    loop {
        let digits = |s: &[u8]| s.iter().take_while(|c| c.is_ascii_digit()).count();
        let (m, n) = (digits(a), digits(b));
        if m > 0 && n > 0 {
            let value = |s: &[u8]| {
                s.iter().fold(0u128, |v, c| {
                    v.saturating_mul(10).saturating_add(u128::from(c - b'0'))
                })
            };
            let order = value(&a[..m]).cmp(&value(&b[..n])).then(m.cmp(&n));
            if order.is_ne() {
                return order;
            }
            (a, b) = (&a[m..], &b[n..]);
        } else {
            match (a.first(), b.first()) {
                (Some(x), Some(y)) if x == y => (a, b) = (&a[1..], &b[1..]),
                (x, y) => return x.cmp(&y),
            }
        }
    }
}

//! When messages were taken: as `analyze` dates them, where the log only knows when they came.

use std::collections::BTreeMap;

use analyze::arrivals::{Arrivals, is_time};
use analyze::summary::Times;
use recording::Finding;
use recording::read::{Batch, ReadError, Recording};
use recording::signal::{Signal, field_of, unit_of};

use super::{Plan, at_ns, remark};

/// Times of the messages of those topics whose log times are not when they were taken.
#[derive(Debug, Default)]
pub struct Dates {
    topics: BTreeMap<String, Dated>,
    /// Rates of the inertial sensors between gaps, Hz: of all their messages, however a reading cuts them into batches. One whose messages are of
    /// one moment has none.
    pub rates_hz: BTreeMap<String, f64>,
    /// What was done to which topic, in sentences.
    pub notes: Vec<String>,
}

#[derive(Debug)]
struct Dated {
    /// Of every message in the order of the file, ns; not ascending where messages overtake each other.
    times_ns: Vec<i64>,
    /// Those asked for so far.
    asked: usize,
}

impl Dates {
    /// Times of the next `count` messages of a topic, ns; `None` where the log's are good.
    pub fn next(&mut self, topic: &str, count: usize) -> Option<&[i64]> {
        let dated = self.topics.get_mut(topic)?;
        let from = dated.asked;
        dated.asked += count;
        dated.times_ns.get(from..dated.asked)
    }
}

/// A topic while its batches come in.
#[derive(Default)]
struct Gathered {
    arrivals: Arrivals,
    /// The times of the log.
    times: Times,
    /// What tells the content of a message from that of others.
    marks: Vec<u64>,
    /// Columns that are collected: their unit, then message and value.
    columns: BTreeMap<String, (&'static str, Vec<(usize, f64)>)>,
}

impl Gathered {
    fn take(&mut self, batch: &Batch<'_>, plan: &Plan<'_>) {
        let first = self.marks.len();
        self.arrivals.take(batch);
        if plan.is_sensor(batch.topic) {
            self.times.push(batch.times_ns);
        }
        self.marks.resize(self.arrivals.len(), 0);
        for column in batch.columns {
            let row = |k: usize| first + column.rows.map_or(k, |rows| rows[k] as usize);
            for (k, x) in column.values.iter().enumerate() {
                let mark = &mut self.marks[row(k)];
                *mark = (mark.rotate_left(5) ^ column.id as u64 ^ x.to_bits())
                    .wrapping_mul(0x9e37_79b9_7f4a_7c15);
            }
            if plan.is_whole(column.path) {
                let kept = match self.columns.get_mut(column.path) {
                    Some(kept) => kept,
                    None => {
                        let field = plan.field(column.path);
                        let new = (unit_of(batch.schema, field), Vec::new());
                        self.columns.entry(column.path.to_owned()).or_insert(new)
                    }
                };
                kept.1
                    .extend(column.values.iter().enumerate().map(|(k, x)| (row(k), *x)));
            }
        }
    }
}

/// Collects what is drawn of our own topics, and the times of all that are drawn.
pub fn collect(
    recording: &Recording,
    plan: &Plan<'_>,
) -> Result<(Vec<Signal>, Dates, Vec<Finding>), ReadError> {
    let start_ns = recording.info().start_ns;
    let mut topics: BTreeMap<String, Gathered> = BTreeMap::new();
    let wanted = |path: &str| {
        let own = |topic: &&str| field_of(path, topic).is_some_and(is_time);
        plan.is_whole(path) || plan.is_streamed(path) || plan.ours.iter().any(own)
    };
    let findings = recording.stream(&wanted, &mut |batch| {
        let topic = match topics.get_mut(batch.topic) {
            Some(topic) => topic,
            None => topics.entry(batch.topic.to_owned()).or_default(),
        };
        topic.take(batch, plan);
    })?;
    let mut signals = Vec::new();
    let mut dates = Dates::default();
    for (name, topic) in topics {
        let marks = &topic.marks;
        let axis = topic.arrivals.dated(start_ns, |a, b| marks[a] == marks[b]);
        let times_ns = at_ns(start_ns, &axis.t_s);
        for (path, (unit, kept)) in topic.columns {
            let mut values = vec![None; marks.len()];
            kept.into_iter().for_each(|(row, x)| values[row] = Some(x));
            let each = times_ns.iter().zip(&axis.rows);
            let (times_ns, values): (Vec<i64>, Vec<f64>) = each
                .filter_map(|(t, row)| Some((*t, values[*row]?)))
                .unzip();
            signals.push(Signal {
                topic: name.clone(),
                path,
                unit: unit.to_owned(),
                times_ns: times_ns.into(),
                values,
            });
        }
        let mut times = topic.times;
        if let Some((_, text)) = (axis.remarks.iter()).find(|(kind, _)| is_redated(kind)) {
            dates.notes.push(remark(&name, text));
            let times_ns = by_message(marks.len(), &axis.rows, &times_ns);
            if plan.is_sensor(&name) {
                times = Times::default();
                times.push(&times_ns);
            }
            let dated = Dated { times_ns, asked: 0 };
            dates.topics.insert(name.clone(), dated);
        }
        let rate_hz = times.hz_between_gaps();
        dates.rates_hz.extend(rate_hz.map(|hz| (name, hz)));
    }
    Ok((signals, dates, findings))
}

/// The rates alone, by the log, of a recording that is too long for more.
pub fn rates(recording: &Recording, plan: &Plan<'_>) -> Result<Dates, ReadError> {
    let mut topics: BTreeMap<String, Times> = BTreeMap::new();
    let wanted = |path: &str| {
        let field = |topic: &&str| field_of(path, topic);
        let field = plan.imus.iter().find_map(field);
        ["angular_velocity.x", "linear_acceleration.x"]
            .map(Some)
            .contains(&field)
    };
    // What is odd is said by the reading that draws.
    recording.stream(&wanted, &mut |batch| {
        if plan.is_sensor(batch.topic) {
            let times = topics.entry(batch.topic.to_owned()).or_default();
            times.push(batch.times_ns);
        }
    })?;
    let rates = topics.into_iter();
    Ok(Dates {
        rates_hz: rates
            .filter_map(|(topic, times)| Some((topic, times.hz_between_gaps()?)))
            .collect(),
        ..Dates::default()
    })
}

/// Whether a remark says that the times are not those of the log.
fn is_redated(kind: &str) -> bool {
    ["by_stamps", "packets"].contains(&kind)
}

/// Times by message; one without is where the one before it is, or at the first.
fn by_message(count: usize, rows: &[usize], times_ns: &[i64]) -> Vec<i64> {
    let mut known = vec![None; count];
    for (row, t) in rows.iter().zip(times_ns) {
        known[*row] = Some(*t);
    }
    let mut last = times_ns.first().copied().unwrap_or(0);
    let each = known.into_iter().map(|t| {
        last = t.unwrap_or(last);
        last
    });
    each.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::cdr::Imu;
    use recording::read::ReadOptions;
    use recording::topics::MessageKind;
    use recording::write::{RecordingWriter, WriterOptions};

    #[test]
    fn a_rate_is_that_of_all_messages() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("imu.mcap");
        let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
        let channel = writer.channel("/imu/s0", MessageKind::Imu).unwrap();
        // 100 Hz, but for the first three.
        for k in 0..3000 {
            let t_ns = 10_000_000 * (10 * k.min(2) + (k - 2).max(0));
            let imu = Imu::raw(t_ns, "imu", [0.01 * k as f64; 3], [0.0, 0.0, 9.81]);
            writer.message(channel, t_ns, &imu).unwrap();
        }
        writer.finish().unwrap();
        let recording = Recording::open(&path, &ReadOptions::default()).unwrap();
        for whole in [true, false] {
            let plan = Plan::new(recording.info(), whole);
            let dates = match whole {
                true => collect(&recording, &plan).unwrap().1,
                false => rates(&recording, &plan).unwrap(),
            };
            let hz = dates.rates_hz["/imu/s0"];
            assert!((hz - 100.0).abs() < 1.0, "{whole}: {hz}");
        }
    }
}

//! Everything that is drawn as curves of its own, sensors and topics that are not ours: read once and thinned on the way.

use std::collections::{BTreeMap, BTreeSet};

use analyze::summary::Times;
use recording::Finding;
use recording::read::{Batch, ReadError, Recording};
use recording::signal::unit_of;

use super::dates::Dates;
use super::{Detail, Plan, sensor};
use crate::take::{Curve, Sensor, Take, Topic};
use crate::thin::Thin;

/// Points that all thinned curves together may have: what a viewer draws with ease.
const POINTS: u64 = 1_200_000;
/// Points that a curve has at least, however many there are.
const MIN_POINTS: u64 = 4_000;
/// Curves of one topic that are drawn; more would be no picture.
const MAX_CURVES: usize = 24;
/// Topics that are neither ours nor sensors and get a view of their own.
const MAX_TOPICS: usize = 12;
/// Topics among which these are chosen.
const MAX_READ: usize = 48;

/// Sensors and all topics that are not ours, in one pass.
pub fn others(
    take: &mut Take,
    recording: &Recording,
    plan: &Plan<'_>,
    detail: Detail,
    dates: &mut Dates,
    findings: &mut Vec<Finding>,
) -> Result<(), ReadError> {
    let channels = recording.info().channels.iter();
    let plain = channels.filter(|c| !plan.is_ours(&c.topic) && !plan.imus.contains(&&*c.topic));
    let curves = 8 * plan.imus.len() as u64 + 6 * plain.count() as u64;
    if curves == 0 {
        return Ok(());
    }
    let points = match detail {
        Detail::Thinned => (POINTS / curves).max(MIN_POINTS),
        Detail::Whole => u64::MAX,
    };
    let mut pass = Pass::new(recording, plan, points);
    // The second pass looks at other fields of the same file: what is odd about it was said in the first.
    let more = recording.stream(&|path| plan.is_streamed(path), &mut |batch| {
        pass.push(batch, dates);
    })?;
    for finding in more {
        if !findings.contains(&finding) {
            findings.push(finding);
        }
    }
    pass.finish(take, detail);
    Ok(())
}

/// Begins curves that are thinned alike.
struct Thinner<'a> {
    recording: &'a Recording,
    /// Points of each.
    points: u64,
    /// Of the coarsest, ns.
    coarsest_ns: i64,
}

impl Thinner<'_> {
    /// A curve of this name, of a topic with so many messages.
    fn curve(&mut self, name: &str, messages: u64) -> Thin {
        let info = self.recording.info();
        let thin = Thin::new(name, info.start_ns, info.end_ns, messages, self.points);
        self.coarsest_ns = self.coarsest_ns.max(thin.interval_ns());
        thin
    }
}

/// What comes together while the recording streams by.
struct Pass<'a> {
    plan: &'a Plan<'a>,
    thinner: Thinner<'a>,
    /// How many each topic has.
    messages: BTreeMap<&'a str, u64>,
    times: BTreeMap<String, Times>,
    sensors: BTreeMap<&'a str, sensor::Stream>,
    /// Field, unit and curve, by topic.
    plain: BTreeMap<String, Vec<(String, String, Thin)>>,
    left_out: BTreeSet<String>,
    fields_left_out: BTreeMap<String, BTreeSet<String>>,
}

impl<'a> Pass<'a> {
    fn new(recording: &'a Recording, plan: &'a Plan<'a>, points: u64) -> Self {
        let mut messages: BTreeMap<&str, u64> = BTreeMap::new();
        for channel in &recording.info().channels {
            *messages.entry(&channel.topic).or_default() += channel.messages;
        }
        Self {
            plan,
            thinner: Thinner {
                recording,
                points,
                coarsest_ns: 0,
            },
            messages,
            times: BTreeMap::new(),
            sensors: BTreeMap::new(),
            plain: BTreeMap::new(),
            left_out: BTreeSet::new(),
            fields_left_out: BTreeMap::new(),
        }
    }

    fn push(&mut self, batch: &Batch<'_>, dates: &mut Dates) {
        if !self.times.contains_key(batch.topic) {
            self.times.insert(batch.topic.to_owned(), Times::default());
        }
        let Some(times) = self.times.get_mut(batch.topic) else {
            return;
        };
        let rate_hz = dates.rates_hz.get(batch.topic).copied();
        let batch = &match dates.next(batch.topic, batch.times_ns.len()) {
            Some(times_ns) => Batch { times_ns, ..*batch },
            None => *batch,
        };
        times.push(batch.times_ns);
        let count = self.messages.get(batch.topic).copied().unwrap_or(0);
        // One without a rate is no sensor, but may have curves.
        if let Some(topic) = self.plan.imus.iter().find(|topic| **topic == batch.topic)
            && let Some(rate_hz) = rate_hz
        {
            let thinner = &mut self.thinner;
            let new = || sensor::Stream::new(rate_hz, count, |name| thinner.curve(name, count));
            let sensor = self.sensors.entry(topic).or_insert_with(new);
            sensor.push(batch, times);
            return;
        }
        let known = self.plain.len();
        let Some(topic) = (match self.plain.contains_key(batch.topic) {
            true => self.plain.get_mut(batch.topic),
            false if known < MAX_READ => {
                Some(self.plain.entry(batch.topic.to_owned()).or_default())
            }
            false => None,
        }) else {
            self.left_out.insert(batch.topic.to_owned());
            return;
        };
        for column in batch.columns {
            let field = column
                .path
                .strip_prefix(batch.topic)
                .unwrap_or(column.path)
                .trim_start_matches('.');
            let at = match topic.iter().position(|(name, ..)| name == field) {
                Some(at) => at,
                None if topic.len() < MAX_CURVES => {
                    let unit = unit_of(batch.schema, field).to_owned();
                    topic.push((field.to_owned(), unit, self.thinner.curve(field, count)));
                    topic.len() - 1
                }
                None => {
                    let fields = self.fields_left_out.entry(batch.topic.to_owned());
                    fields.or_default().insert(field.to_owned());
                    continue;
                }
            };
            let (.., thin) = &mut topic[at];
            thin.push_between_gaps(batch.times_ns, column.rows, column.values, times);
        }
    }

    /// Gives the curves, and says what was left out of them.
    fn finish(mut self, take: &mut Take, detail: Detail) {
        let start_ns = self.thinner.recording.info().start_ns;
        for (topic, times) in &self.times {
            if let Some((first_ns, last_ns)) = times.ends_ns()
                && first_ns == last_ns
                && times.count() > 1
            {
                take.notes.push(format!(
                    "{topic}: all {} messages are of one moment, {:.3} s: no curve can be drawn.",
                    times.count(),
                    recording::signal::seconds_since(&[first_ns], start_ns)[0]
                ));
            }
        }
        take.imus = (self.sensors.into_iter())
            .map(|(topic, sensor)| sensor.finish(topic, &self.times[topic]))
            .filter(Sensor::has_any)
            .collect();
        // The load's own sensor comes first.
        take.imus
            .sort_by_key(|sensor| Some(&sensor.topic) != take.main_imu.as_ref());
        take.topics = (self.plain.into_iter())
            .map(|(name, curves)| topic(name, curves, detail))
            .filter(|t| !t.plots.is_empty())
            .collect();
        self.left_out.extend(kept_out(&mut take.topics));
        if !self.left_out.is_empty() {
            let names: Vec<&str> = self.left_out.iter().map(String::as_str).collect();
            take.notes.push(format!(
                "{MAX_TOPICS} topics beside the sensors are drawn; not these: {}.",
                names.join(", ")
            ));
        }
        for (topic, fields) in self.fields_left_out {
            take.notes.push(format!(
                "{topic}: {MAX_CURVES} of {} fields are drawn.",
                MAX_CURVES + fields.len()
            ));
        }
        if self.thinner.coarsest_ns > 0 {
            take.notes.push(format!(
                "Curves with many samples show the smallest and the largest value of every {:.3} s at their own times.",
                self.thinner.coarsest_ns as f64 / 1e9
            ));
        }
    }
}

/// Plots of one topic without a unit; more could not be read.
const MAX_PLOTS: usize = 4;

/// Leaves [`MAX_TOPICS`], those before others in which anything changes; gives the names of the rest.
fn kept_out(topics: &mut Vec<Topic>) -> Vec<String> {
    if topics.len() > MAX_TOPICS {
        let changes = |t: &Topic| t.plots.iter().flat_map(|(_, c)| c).any(Curve::changes);
        topics.sort_by_key(|t| !changes(t));
        let rest = topics.split_off(MAX_TOPICS);
        topics.sort_by(|a, b| a.name.cmp(&b.name));
        return rest.into_iter().map(|t| t.name).collect();
    }
    Vec::new()
}

/// A plain topic: curves of one unit share a plot; of those without one, those that are alike large. While more may come nobody knows how
/// large they are.
fn topic(name: String, curves: Vec<(String, String, Thin)>, detail: Detail) -> Topic {
    let mut plots: Vec<(String, Vec<Curve>)> = Vec::new();
    for (_, unit, thin) in curves {
        let curve = thin.finish();
        if !curve.has_two() {
            continue;
        }
        let any = !unit.is_empty() || detail == Detail::Whole;
        let fits = |curves: &[Curve]| any || curves.iter().all(|c| are_alike_large(c, &curve));
        let without = plots.iter().filter(|(u, _)| *u == unit).count();
        let same = plots.iter_mut().filter(|(u, _)| *u == unit);
        let mut same: Vec<&mut Vec<Curve>> = same.map(|(_, curves)| curves).collect();
        let place = same.iter().position(|curves| fits(curves));
        match place.or((without == MAX_PLOTS).then_some(MAX_PLOTS - 1)) {
            Some(k) => same[k].push(curve),
            None => plots.push((unit, vec![curve])),
        }
    }
    Topic { name, plots }
}

/// Whether one axis shows both: the larger's greatest size is at most ten times the smaller's, or one is nothing but zeros.
fn are_alike_large(a: &Curve, b: &Curve) -> bool {
    let [a, b] = [a, b].map(|curve| {
        let finite = curve.values.iter().filter(|x| x.is_finite());
        finite.fold(0.0, |most: f64, x| most.max(x.abs()))
    });
    a.min(b) == 0.0 || a.max(b) <= 10.0 * a.min(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Constants took the places of what moves, and so did topics without a plot.
    #[test]
    fn what_moves_is_drawn_before_what_does_not() {
        let of = |k: usize| {
            let mut thin = Thin::new("x", 0, 1, 2, 10);
            thin.push(&[0, 1], &[0.0, f64::from(u8::from(k >= 3))]);
            let curves = vec![("x".to_owned(), String::new(), thin)];
            topic(format!("/{k:02}"), curves, Detail::Thinned)
        };
        let mut topics: Vec<Topic> = (0..14).map(of).collect();
        assert_eq!(kept_out(&mut topics), ["/01", "/02"]);
        let names: Vec<&str> = topics.iter().map(|t| t.name.as_str()).collect();
        assert!(names.is_sorted() && names.len() == MAX_TOPICS && names[1] == "/03");
    }

    #[test]
    fn curves_without_a_unit_share_a_plot_where_they_are_alike_large() {
        let curves = |unit: &str| {
            let of = |(name, size): (&str, f64)| {
                let mut thin = Thin::new(name, 0, 1, 2, 10);
                thin.push(&[0, 1], &[0.0, size]);
                (name.to_owned(), unit.to_owned(), thin)
            };
            let sizes = [("o", 0.0), ("a", 3.0), ("b", 600.0), ("c", -4.0)];
            sizes.into_iter().map(of).collect::<Vec<_>>()
        };
        let drawn = |unit, detail| {
            let plots = topic("/t".into(), curves(unit), detail).plots;
            let names = |curves: &Vec<Curve>| curves.iter().map(|c| c.name.as_str()).collect();
            plots.iter().map(|(_, c)| names(c)).collect::<Vec<String>>()
        };
        assert_eq!(drawn("", Detail::Thinned), ["oac", "b"]);
        assert_eq!(drawn("", Detail::Whole), ["oabc"]);
        assert_eq!(drawn("m", Detail::Thinned), ["oabc"]);
    }
}

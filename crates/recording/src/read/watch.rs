//! What one channel's batches add up to, and what is remarked on it at the end.

use std::{collections::BTreeMap, sync::Arc};

use super::{
    block::ChannelBatch,
    clock::{Clocks, Order, seconds, unset},
    json::MAX_KEYS,
    names::Called,
    rows::{Counts, Long, MAX_PLACES},
};
use crate::{Finding, Kind, text::counted};

/// More troubles than this are counted, not listed.
pub(super) const MAX_TROUBLES: usize = 1000;

/// What is known about a channel while its batches come in.
#[derive(Default)]
pub(super) struct Watch {
    log: Order,
    stamps: Order,
    clocks: Clocks,
    absent: Counts<String>,
    long: Counts<Long>,
    /// What the places of its lists were called.
    names: BTreeMap<(String, usize), Called>,
    trailing: u64,
    odd: Vec<(Arc<str>, u64, i64)>,
    messages: u64,
}

/// By what a channel's remarks are worded.
pub(super) struct Words<'a> {
    pub topic: &'a str,
    /// Log time that seconds are counted from, ns.
    pub start_ns: i64,
    /// What names items, where their places mix several.
    pub by_name: &'a str,
    /// The most items of a sequence, and where that is said.
    pub most_items: String,
}

impl Watch {
    /// Adds a batch; what is dated before `from_ns` tells neither order nor drift.
    pub fn observe(&mut self, batch: &mut ChannelBatch, from_ns: i64) {
        self.messages += batch.times.len() as u64;
        for (times, stamps) in known(&batch.times, &batch.stamps, |t| t >= from_ns) {
            self.log.observe(times);
            if !stamps.is_empty() {
                self.clocks.observe(times, stamps);
                // One that was never set is told as such: it is no leap of half a century, and nothing is missing there.
                let mut from = 0;
                if stamps.contains(&0) {
                    for (k, (t, s)) in times.iter().zip(stamps).enumerate() {
                        if unset(*t, *s) {
                            self.stamps.observe(&stamps[from..k]);
                            self.stamps.pause();
                            from = k + 1;
                        }
                    }
                }
                self.stamps.observe(&stamps[from..]);
            }
        }
        for (field, count) in std::mem::take(&mut batch.absent) {
            self.absent.add(field, count);
        }
        for (what, count) in std::mem::take(&mut batch.long) {
            self.long.add(what, count);
        }
        for (list, place, name) in std::mem::take(&mut batch.names) {
            self.names.entry((list, place)).or_default().add(&name);
        }
        self.trailing += batch.trailing;
    }

    /// Adds values of a column that are no numbers, the first of them at `time_ns`.
    pub fn observe_odd(&mut self, name: &Arc<str>, count: u64, time_ns: i64) {
        match self.odd.iter_mut().find(|(path, _, _)| path == name) {
            Some((_, known, _)) => *known += count,
            None => self.odd.push((name.clone(), count, time_ns)),
        }
    }

    /// Remarks on what was seen.
    pub fn report(&mut self, words: &Words<'_>, findings: &mut Vec<Finding>) {
        let Words {
            topic, start_ns, ..
        } = *words;
        self.log.report(topic, "log times", start_ns, findings);
        self.clocks.report(topic, start_ns, findings);
        if !self.clocks.same() {
            if self.log.has_gaps() {
                self.stamps.forget_gaps();
            }
            self.stamps
                .report(topic, "header stamps", start_ns, findings);
        }
        self.report_odd(words, findings);
        for (field, count) in &self.absent.list {
            let mut text = format!("{field} is declared as not given (covariance -1)");
            if *count != self.messages {
                text += &format!(" in {count} of {} messages", self.messages);
            }
            findings.push(Finding::new(topic, Kind::AbsentField, *count, text));
        }
        self.report_names(words, findings);
        self.report_long(words, findings);
        if self.trailing > 0 {
            let text = format!(
                "{} than their schema says",
                counted(self.trailing, "message is longer", "messages are longer")
            );
            findings.push(Finding::new(
                topic,
                Kind::TrailingBytes,
                self.trailing,
                text,
            ));
        }
    }

    fn report_odd(&self, words: &Words<'_>, findings: &mut Vec<Finding>) {
        let mut lists: BTreeMap<String, Odd> = BTreeMap::new();
        for (path, count, time) in &self.odd {
            let field = path
                .strip_prefix(words.topic)
                .unwrap_or(path)
                .trim_start_matches(['.', ':']);
            let items = lists.entry(list_of(field)).or_insert_with(|| Odd {
                field: field.to_owned(),
                items: 0,
                count: 0,
                first: *time,
            });
            items.items += 1;
            items.count += count;
            items.first = items.first.min(*time);
        }
        for (list, odd) in lists {
            let t_s = seconds(odd.first, words.start_ns);
            let of = match odd.items {
                1 => odd.field,
                n => format!("{list} ({n} items)"),
            };
            let text = format!(
                "{} of {of} {} NaN or infinite, first at {t_s:.3} s",
                counted(odd.count, "value", "values"),
                if odd.count == 1 { "is" } else { "are" }
            );
            findings.push(Finding {
                t_s: Some(t_s),
                ..Finding::new(words.topic, Kind::Nan, odd.count, text)
            });
        }
    }

    fn report_names(&self, words: &Words<'_>, findings: &mut Vec<Finding>) {
        let mut mixed = (self.names.iter())
            .filter_map(|((list, place), called)| Some((list, place, called.several()?)));
        let Some((list, place, called)) = mixed.next() else {
            return;
        };
        let further = match mixed.count() {
            0 => String::new(),
            n => {
                let places = counted(n as u64, "further place", "further places");
                format!(", and {places} of lists likewise")
            }
        };
        let text = format!(
            "{list}[{place}] is in turn {called}{further}: signals of such a place mix what belongs to several; {}",
            words.by_name
        );
        findings.push(Finding::new(words.topic, Kind::MixedItems, 1, text));
    }

    fn report_long(&self, words: &Words<'_>, findings: &mut Vec<Finding>) {
        let list = &self.long.list;
        for (what, count) in list.iter().take(MAX_TROUBLES) {
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
                    "{} has more than {} in {messages}; it is not among the signals there",
                    whole(field),
                    words.most_items
                ),
            };
            findings.push(Finding::new(words.topic, Kind::LongSequence, *count, text));
        }
        if list.len() > MAX_TROUBLES {
            let further = (list.len() - MAX_TROUBLES) as u64;
            let text = format!("{further} further fields are too long in some messages");
            findings.push(Finding::new(words.topic, Kind::LongSequence, further, text));
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

//! Signals out of a stream: columns put together and sorted by time.

use std::{collections::HashMap, sync::Arc};

use super::{ReadError, Recording, rows::Selection};
use crate::{Finding, Signal, signal::unit_of};

/// A signal while its batches come in.
struct Part {
    channel: usize,
    path: String,
    unit: &'static str,
    values: Vec<f64>,
    /// Its own times, once some message of its channel had no value.
    times: Option<Vec<i64>>,
}

pub(super) fn signals(
    recording: &Recording,
    select: Selection<'_>,
) -> Result<(Vec<Signal>, Vec<Finding>), ReadError> {
    let mut parts: Vec<Part> = Vec::new();
    let mut index: HashMap<(usize, usize), usize> = HashMap::new();
    let mut times: Vec<Vec<i64>> = vec![Vec::new(); recording.info().channels.len()];
    let findings = recording.stream(select, &mut |batch| {
        let before = times[batch.channel].len();
        for column in batch.columns {
            let position = *index.entry((batch.channel, column.id)).or_insert_with(|| {
                let field = column.path.get(batch.topic.len() + 1..).unwrap_or_default();
                parts.push(Part {
                    channel: batch.channel,
                    path: column.path.to_owned(),
                    unit: unit_of(batch.schema, field),
                    values: Vec::new(),
                    times: None,
                });
                parts.len() - 1
            });
            let part = &mut parts[position];
            if part.times.is_none() && (column.rows.is_some() || part.values.len() != before) {
                // Until now every message had a value, up to some point.
                part.times = Some(times[batch.channel][..part.values.len()].to_vec());
            }
            if let Some(own) = &mut part.times {
                match column.rows {
                    Some(rows) => own.extend(rows.iter().map(|&row| batch.times_ns[row as usize])),
                    None => own.extend_from_slice(batch.times_ns),
                }
            }
            part.values.extend_from_slice(column.values);
        }
        times[batch.channel].extend_from_slice(batch.times_ns);
    })?;

    // Times of a channel are sorted once and shared.
    let shared: Vec<Sorted> = times.into_iter().map(sorted).collect();
    let mut signals: Vec<Signal> = Vec::with_capacity(parts.len());
    let mut by_path: HashMap<String, usize> = HashMap::new();
    for mut part in parts {
        let complete = part.values.len() == shared[part.channel].0.len();
        let (times_ns, order) = match part.times.take() {
            Some(own) => {
                let (times, order) = sorted(own);
                (times, order)
            }
            // A field that vanished for good after some message.
            None if !complete => continue_short(&shared[part.channel], part.values.len()),
            None => (
                shared[part.channel].0.clone(),
                shared[part.channel].1.clone(),
            ),
        };
        let values = match order {
            Some(order) => order
                .iter()
                .map(|&position| part.values[position])
                .collect(),
            None => part.values,
        };
        let signal = Signal {
            topic: recording.info().channels[part.channel].topic.clone(),
            path: part.path,
            unit: part.unit.to_owned(),
            times_ns,
            values,
        };
        match by_path.get(&signal.path) {
            // Several channels of one topic are one signal.
            Some(&known) => merge(&mut signals[known], signal),
            None => {
                by_path.insert(signal.path.clone(), signals.len());
                signals.push(signal);
            }
        }
    }
    Ok((signals, findings))
}

/// Times in order, and where each stood before if they were not.
type Sorted = (Arc<[i64]>, Option<Vec<usize>>);

/// The times in order, and the permutation where they were not.
fn sorted(times: Vec<i64>) -> Sorted {
    if times.is_sorted() {
        return (times.into(), None);
    }
    let mut order: Vec<usize> = (0..times.len()).collect();
    order.sort_by_key(|&position| times[position]);
    (
        order.iter().map(|&position| times[position]).collect(),
        Some(order),
    )
}

/// Times of the first `length` messages of a channel, in order.
fn continue_short((times, order): &Sorted, length: usize) -> Sorted {
    match order {
        None => (times[..length].into(), None),
        Some(order) => {
            let kept: Vec<(usize, i64)> = order
                .iter()
                .copied()
                .zip(times.iter().copied())
                .filter(|(position, _)| *position < length)
                .collect();
            (
                kept.iter().map(|(_, time)| *time).collect(),
                Some(kept.iter().map(|(position, _)| *position).collect()),
            )
        }
    }
}

fn merge(into: &mut Signal, from: Signal) {
    let times: Vec<i64> = into
        .times_ns
        .iter()
        .chain(from.times_ns.iter())
        .copied()
        .collect();
    into.values.extend_from_slice(&from.values);
    let (times, order) = sorted(times);
    into.times_ns = times;
    if let Some(order) = order {
        into.values = order
            .iter()
            .map(|&position| into.values[position])
            .collect();
    }
}

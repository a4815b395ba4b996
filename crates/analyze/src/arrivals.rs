//! When the messages of a topic that feeds metrics were taken: by the log, by their own stamps, or evenly where they came in packets.

use recording::read::{Batch, TAKEN_BEFORE_NS};
use recording::signal::field_of;

use crate::field::dates::{Dated, dated, delay_s};
use crate::inputs::{mean_step_in, stretches};
use crate::summary::seconds;

/// Log times and stamps of a topic's messages, in the order in which they came.
#[derive(Clone, Debug, Default)]
pub struct Arrivals {
    log_ns: Vec<i64>,
    /// As long as `log_ns` where every message has one.
    stamp_ns: Vec<i64>,
}

/// Messages in the order of their times, those that repeat another left out.
#[derive(Clone, Debug, Default)]
pub struct Axis {
    /// Times, ascending (s).
    pub t_s: Vec<f64>,
    /// The message at each time, counted as they came.
    pub rows: Vec<usize>,
    /// First and last time (s) where these are the messages' own and the log tells nothing of them.
    pub own_s: Option<(f64, f64)>,
    /// Kinds and texts of remarks.
    pub remarks: Vec<(&'static str, String)>,
}

/// Steps that scatter by more than this share of their mean are uneven.
const UNEVEN: f64 = 0.25;
/// More often than so no recorder takes down the messages of a topic.
const MOST_COPIES: usize = 10;
/// More than this share of messages that no time can be told of is worth a word.
const MANY: f64 = 0.01;

impl Arrivals {
    /// The next messages: log times and, where all have one, stamps (ns).
    pub fn push(&mut self, log_ns: &[i64], stamp_ns: Option<&[i64]>) {
        self.log_ns.extend(log_ns);
        self.stamp_ns.extend(stamp_ns.unwrap_or_default());
    }

    /// The messages of a batch, with their header stamps or what else says when they were taken, where that is among its columns: our own
    /// messages' `time_s`, the first transform's stamp.
    pub fn take(&mut self, batch: &Batch<'_>) {
        let own = own_ns(batch);
        self.push(batch.times_ns, batch.stamps_ns.or(own.as_deref()));
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.log_ns.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.log_ns.is_empty()
    }

    /// Dates them, seconds since `start_ns`. Of those with one stamp the first counts; without useful stamps, of those with one log time whose
    /// content is the `same`.
    pub fn dated(&self, start_ns: i64, same: impl Fn(usize, usize) -> bool) -> Axis {
        let once = self.once(&same);
        let by_stamps = once.clone().and_then(|rows| self.by_stamps(start_ns, rows));
        by_stamps.unwrap_or_else(|| {
            let rows = once.unwrap_or_else(|| (0..self.len()).collect());
            self.by_log(start_ns, rows, &same)
        })
    }

    /// The messages in the order of their stamps, each once, where stamps tell them apart: a recorder may take one down twice, the second time later.
    /// Stamps that many messages of other content share are those of packets, and of those that hardly change nothing can be told.
    fn once(&self, same: impl Fn(usize, usize) -> bool) -> Option<Vec<usize>> {
        if self.stamp_ns.len() != self.len() {
            return None;
        }
        let stamp_ns = &self.stamp_ns;
        let mut rows: Vec<usize> = (0..self.len()).collect();
        rows.sort_by_key(|r| stamp_ns[*r]);
        rows.dedup_by(|b, a| stamp_ns[*a] == stamp_ns[*b] && same(*a, *b));
        let steps = rows.windows(2);
        let shared = steps.filter(|w| stamp_ns[w[0]] == stamp_ns[w[1]]).count();
        let few = rows.len() * MOST_COPIES < self.len();
        (!few && shared as f64 <= MANY * rows.len() as f64).then_some(rows)
    }

    /// By the stamps, where these are the better times.
    fn by_stamps(&self, start_ns: i64, mut rows: Vec<usize>) -> Option<Axis> {
        let stamp_ns = &self.stamp_ns;
        rows.dedup_by_key(|r| stamp_ns[*r]);
        // A clock that is not set yet says 0.
        let first_ns = rows.iter().map(|r| stamp_ns[*r]).find(|ns| *ns != 0)?;
        let log_s = self.log_s(&rows, start_ns);
        let mut stamps: Vec<f64> = rows
            .iter()
            .map(|r| seconds(first_ns, stamp_ns[*r]))
            .collect();
        let moved_s = delay_s(log_s.iter().zip(&stamps).map(|(l, s)| l - s));
        stamps.iter_mut().for_each(|s| *s += moved_s);
        let dated = dated(log_s, Some(stamps));
        let own_s = dated.own_s();
        let Dated { t_s, remark, .. } = dated;
        let known = t_s.into_iter().zip(rows).filter(|(t, _)| t.is_finite());
        let (t_s, rows) = known.unzip();
        let axis = |remark| Axis {
            own_s,
            ..Axis::new(t_s, rows, vec![remark])
        };
        remark.filter(|(kind, _)| *kind == "by_stamps").map(axis)
    }

    /// By the log times; packets are spread.
    fn by_log(
        &self,
        start_ns: i64,
        mut rows: Vec<usize>,
        same: impl Fn(usize, usize) -> bool,
    ) -> Axis {
        rows.sort_by_key(|r| (self.log_ns[*r], *r));
        rows.dedup_by(|b, a| self.log_ns[*a] == self.log_ns[*b] && same(*a, *b));
        let Dated { t_s, remark, .. } = dated(self.log_s(&rows, start_ns), None);
        let mut dates: Vec<(f64, usize)> = t_s.into_iter().zip(rows).collect();
        let all = dates.len();
        dates.dedup_by(|b, a| b.0 <= a.0);
        let undated = all - dates.len();
        let mut remarks: Vec<_> = remark.into_iter().collect();
        if undated as f64 > MANY * all as f64 {
            remarks.push(("left_out", format!("{undated} of {all} messages have the log time of another and no useful stamp of their own: they are left out of the metrics")));
        }
        let (t_s, rows) = dates.into_iter().unzip();
        Axis::new(t_s, rows, remarks)
    }

    fn log_s(&self, rows: &[usize], start_ns: i64) -> Vec<f64> {
        let log = rows.iter().map(|r| seconds(start_ns, self.log_ns[*r]));
        log.collect()
    }
}

impl Axis {
    fn new(
        mut t_s: Vec<f64>,
        mut rows: Vec<usize>,
        mut remarks: Vec<(&'static str, String)>,
    ) -> Self {
        let early = t_s.partition_point(|t| *t < -(TAKEN_BEFORE_NS as f64) / 1e9);
        t_s.drain(..early);
        rows.drain(..early);
        remarks.extend(uneven(&t_s));
        Axis {
            t_s,
            rows,
            own_s: None,
            remarks,
        }
    }
}

/// Where our own messages say when they were taken, s.
const TIME: &str = "time_s";
/// Where transforms do, s and ns.
const STAMP: [&str; 2] = [
    "transforms[0].header.stamp.sec",
    "transforms[0].header.stamp.nanosec",
];

/// Whether [`Arrivals::take`] looks for this field of a topic's messages.
pub fn is_time(field: &str) -> bool {
    field == TIME || STAMP.contains(&field)
}

/// When messages without a header say they were taken (ns), where all of the batch do.
fn own_ns(batch: &Batch<'_>) -> Option<Vec<i64>> {
    let column = |field: &str| {
        let mut columns = batch.columns.iter();
        let found = columns.find(|c| field_of(c.path, batch.topic) == Some(field))?;
        (found.rows.is_none() && found.finite).then_some(found.values)
    };
    if batch.schema.starts_with("rath.") {
        let time_s = column(TIME)?;
        return Some(time_s.iter().map(|t| (t * 1e9).round() as i64).collect());
    }
    let (sec, nanosec) = (column(STAMP[0])?, column(STAMP[1])?);
    let ns = |(s, ns): (&f64, &f64)| {
        (*s as i64)
            .saturating_mul(1_000_000_000)
            .saturating_add(*ns as i64)
    };
    Some(sec.iter().zip(nanosec).map(ns).collect())
}

/// A remark where steps between holes are far from even.
fn uneven(t_s: &[f64]) -> Option<(&'static str, String)> {
    let parts = stretches(t_s, 0.0);
    let mean_s = mean_step_in(t_s, &parts)?;
    let steps = || {
        let within = parts.iter().map(|part| &t_s[part.clone()]);
        within.flat_map(|t| t.windows(2).map(|w| w[1] - w[0]))
    };
    let squares: f64 = steps().map(|s| (s - mean_s).powi(2)).sum();
    let scatter_s = (squares / steps().count() as f64).sqrt();
    (scatter_s > UNEVEN * mean_s).then(|| {
        let (mean_ms, scatter_ms) = (1e3 * mean_s, 1e3 * scatter_s);
        ("jitter", format!("samples come unevenly: steps of {mean_ms:.2} ms on average scatter by {scatter_ms:.2} ms (SD), but are taken as even: frequencies are off by up to a few per cent"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HZ: f64 = 30.0;

    fn taken_ns(k: i64) -> i64 {
        (1e9 * k as f64 / HZ).round() as i64
    }

    /// 900 messages that come by nines, and what is found of them.
    fn bursts(stamp: Option<fn(i64) -> i64>) -> Axis {
        bursts_of(9, stamp)
    }

    fn bursts_of(many: i64, stamp: Option<fn(i64) -> i64>) -> Axis {
        let mut arrivals = Arrivals::default();
        for k in 0..900 {
            let stamp = stamp.map(|s| [s(k)]);
            arrivals.push(
                &[taken_ns(k / many * many + many)],
                stamp.as_ref().map(|s| &s[..]),
            );
        }
        arrivals.dated(0, |_, _| false)
    }

    fn farthest_step_s(axis: &Axis) -> f64 {
        let steps = axis.t_s.windows(2).map(|w| (w[1] - w[0] - 1.0 / HZ).abs());
        steps.fold(0.0, f64::max)
    }

    #[test]
    fn messages_of_one_log_time_are_told_apart_by_their_stamps() {
        let axis = bursts(Some(|k| 1_700_000_000_000_000_000 + taken_ns(k)));
        assert_eq!(axis.t_s.len(), 900);
        assert!(farthest_step_s(&axis) < 1e-6);
        assert_eq!(axis.remarks[0].0, "by_stamps");
    }

    #[test]
    fn messages_that_overtake_each_other_are_dated_by_their_stamps() {
        let mut random = crate::random::Random(7);
        let late = (0..900).map(|k| {
            (
                taken_ns(k) + (-5e7 * (1.0 - random.uniform()).ln()) as i64,
                k,
            )
        });
        let mut late: Vec<(i64, i64)> = late.collect();
        late.sort();
        let mut arrivals = Arrivals::default();
        let each = late.iter();
        each.for_each(|(log, k)| arrivals.push(&[*log], Some(&[taken_ns(*k)])));
        let axis = arrivals.dated(0, |_, _| false);
        assert!(axis.t_s.len() == 900 && farthest_step_s(&axis) < 1e-4);
        assert!(axis.rows.iter().zip(0..).all(|(row, k)| late[*row].1 == k));
    }

    #[test]
    fn packets_without_stamps_are_spread() {
        // Stamps that are all zero are none, and those of the packets tell no more than the log.
        let zero: fn(i64) -> i64 = |_| 0;
        let shared: fn(i64) -> i64 = |k| taken_ns(k / 9 * 9);
        for (many, stamp) in [(9, None), (30, None), (9, Some(zero)), (9, Some(shared))] {
            let axis = bursts_of(many, stamp);
            assert_eq!(axis.t_s.len(), 900);
            assert!(farthest_step_s(&axis) < 1e-4);
            assert_eq!(axis.remarks[0].0, "packets");
        }
    }

    #[test]
    fn what_is_dated_long_before_the_recording_is_left_out() {
        let mut arrivals = Arrivals::default();
        arrivals.push(&[-3_600_000_000_000], None);
        (0..300).for_each(|k| arrivals.push(&[taken_ns(k)], None));
        let axis = arrivals.dated(0, |_, _| false);
        assert_eq!((axis.t_s.len(), axis.rows[0]), (300, 1));
        assert!(axis.remarks.is_empty(), "{:?}", axis.remarks);
    }

    #[test]
    fn only_what_repeats_is_left_out() {
        let mut arrivals = Arrivals::default();
        for k in (0..200).flat_map(|k| [k, k]) {
            arrivals.push(&[taken_ns(k)], None);
        }
        let axis = arrivals.dated(0, |a, b| a / 2 == b / 2);
        assert_eq!(axis.rows, (0..400).step_by(2).collect::<Vec<_>>());
        assert!(axis.remarks.is_empty(), "{:?}", axis.remarks);
        // One in ten comes once more, 3 ms later, with its own stamp; or every one.
        for every in [10, 1] {
            let mut arrivals = Arrivals::default();
            let mut taken = Vec::new();
            for k in 0..900 {
                for late in 0..if k % every == 0 { 2 } else { 1 } {
                    arrivals.push(&[taken_ns(k) + late * 3_000_000], Some(&[taken_ns(k)]));
                    taken.push(k);
                }
            }
            let axis = arrivals.dated(0, |a, b| taken[a] == taken[b]);
            assert_eq!(axis.t_s.len(), 900, "{every}");
            assert!(axis.remarks.is_empty(), "{:?}", axis.remarks);
            assert!(axis.rows.iter().zip(0..).all(|(row, k)| taken[*row] == k));
        }
        // At rest under stamps that are all zero nothing repeats.
        let mut arrivals = Arrivals::default();
        (0..900).for_each(|k| arrivals.push(&[taken_ns(k)], Some(&[0])));
        assert_eq!(arrivals.dated(0, |_, _| true).t_s.len(), 900);
        // Packets of thirty, too few to tell their rate.
        let mut arrivals = Arrivals::default();
        (0..90).for_each(|k| arrivals.push(&[taken_ns(k / 30 * 30)], None));
        let axis = arrivals.dated(0, |_, _| false);
        assert_eq!(axis.remarks[0].0, "left_out", "{:?}", axis.remarks);
    }

    #[test]
    fn uneven_steps_are_told() {
        let mut random = crate::random::Random(5);
        let (mut even, mut wild, mut t) = (Arrivals::default(), Arrivals::default(), 0.0);
        for k in 0..900 {
            t -= (1.0 - random.uniform()).ln() / HZ;
            wild.push(&[(1e9 * t) as i64], None);
            even.push(&[taken_ns(k) + (1e6 * random.uniform()) as i64], None);
        }
        let kinds = |a: &Arrivals| -> Vec<&str> {
            let remarks = a.dated(0, |_, _| false).remarks;
            remarks.iter().map(|r| r.0).collect()
        };
        assert_eq!(kinds(&wild), ["jitter"]);
        assert!(kinds(&even).is_empty());
    }
}

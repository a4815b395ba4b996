//! What the times of a channel tell: gaps, duplicates, steps back, and how log time and header stamps run against each other.

use crate::finding::{Finding, Kind};
use crate::text::counted;
use std::{cmp::Ordering, collections::BTreeMap};

/// So many intervals are looked at together to learn what is usual, and no more than so many are kept.
const SAMPLE: usize = 256;
/// Fewer intervals than this say nothing about regularity.
const ENOUGH: usize = 16;
/// An interval longer than so many usual ones is a gap.
const GAP: i64 = 3;
/// So many gaps, the latest, may still be filled by messages that come late.
const OPEN: usize = 1 << 14;
/// A constant difference between the clocks below this is what networks and drivers do, s.
const OFFSET_S: f64 = 0.1;
/// Drift below this is what quartz does, parts per million.
const DRIFT_PPM: f64 = 20.0;
/// Means of 64 messages scatter by less about a drift, s.
const SCATTER_S: f64 = 5e-3;
/// A line through one step changes by up to six times what it leaves.
const LINE: f64 = 8.0;

/// Times of one kind (log times or stamps) in the order of the file.
#[derive(Debug, Default)]
pub(super) struct Order {
    last: Option<i64>,
    begun: bool,
    /// The earliest and the latest so far.
    earliest: i64,
    latest: i64,
    duplicates: Count,
    backward: Count,
    /// Stretches without messages, from where to where: gaps, and all to learn from while it is not known what is usual.
    open: BTreeMap<i64, i64>,
    usual: Option<i64>,
    /// Gaps that nothing fills any more.
    gaps: Count,
    longest: (i64, i64),
}

#[derive(Clone, Copy, Debug, Default)]
struct Count {
    count: u64,
    first: i64,
}

impl Count {
    fn add(&mut self, at: i64) {
        if self.count == 0 {
            self.first = at;
        }
        self.count += 1;
    }
}

impl Order {
    /// Takes in the next times.
    pub fn observe(&mut self, times: &[i64]) {
        let Some((&first, rest)) = times.split_first() else {
            return;
        };
        match self.last {
            Some(last) => self.interval(last, first),
            None if self.begun => {
                self.earliest = self.earliest.min(first);
                self.latest = self.latest.max(first);
            }
            None => (self.earliest, self.latest, self.begun) = (first, first, true),
        }
        self.last = times.last().copied();
        let in_order = first >= self.latest;
        // Mostly nothing is odd: the extremes of the intervals say so without a look at each.
        let mut shortest = i64::MAX;
        let mut longest = i64::MIN;
        let mut previous = first;
        for &time in rest {
            let interval = time.wrapping_sub(previous);
            shortest = shortest.min(interval);
            longest = longest.max(interval);
            previous = time;
        }
        let quiet = in_order
            && shortest > 0
            && self
                .usual
                .is_some_and(|usual| longest <= usual.saturating_mul(GAP));
        if quiet {
            self.latest = previous;
            return;
        }
        for pair in times.windows(2) {
            self.interval(pair[0], pair[1]);
        }
    }

    /// What comes next does not follow what came last: nothing is told of the time between them.
    pub fn pause(&mut self) {
        self.last = None;
    }

    fn interval(&mut self, from: i64, to: i64) {
        match to.cmp(&from) {
            Ordering::Equal => self.duplicates.add(to),
            Ordering::Less => self.backward.add(to),
            Ordering::Greater => {}
        }
        if to > self.latest {
            let from = std::mem::replace(&mut self.latest, to);
            self.stretch(from, to);
        } else if to < self.earliest {
            let end = std::mem::replace(&mut self.earliest, to);
            self.stretch(to, end);
        } else if let Some((&from, &end)) = self.open.range(..to).next_back()
            && to < end
        {
            // It comes late: two stretches are left of the one that it lies in.
            self.open.remove(&from);
            self.stretch(from, to);
            self.stretch(to, end);
        }
    }

    /// Keeps a stretch without messages that is a gap, or may be one.
    fn stretch(&mut self, from: i64, to: i64) {
        let Some(usual) = self.usual else {
            self.open.insert(from, to);
            if self.open.len() >= SAMPLE {
                self.learn();
            }
            return;
        };
        if is_gap(from, to, usual) {
            self.open.insert(from, to);
            if self.open.len() > OPEN {
                self.close();
            }
        }
    }

    /// Counts the earliest of the open gaps.
    fn close(&mut self) {
        if let Some((from, to)) = self.open.pop_first() {
            self.gaps.add(from);
            let interval = to.saturating_sub(from);
            if interval > self.longest.0 {
                self.longest = (interval, from);
            }
        }
    }

    /// Decides what interval is usual, if any: the median, where nine of ten intervals are below twice that. Else, as where a queue is emptied when the
    /// recording begins, the next ones tell.
    fn learn(&mut self) {
        let mut sample = std::mem::take(&mut self.open);
        if sample.len() < ENOUGH {
            return;
        }
        let mut sorted: Vec<i64> = (sample.iter())
            .map(|(from, to)| to.saturating_sub(*from))
            .collect();
        sorted.sort_unstable();
        let usual = sorted[sorted.len() / 2];
        if sorted[sorted.len() * 9 / 10] < usual.saturating_mul(2) {
            self.usual = Some(usual);
            sample.retain(|from, to| is_gap(*from, *to, usual));
            self.open = sample;
        }
    }

    /// Whether there are gaps, now that all times have come.
    pub fn has_gaps(&mut self) -> bool {
        if self.usual.is_none() {
            self.learn();
        }
        while !self.open.is_empty() {
            self.close();
        }
        self.gaps.count > 0
    }

    /// Forgets the gaps, where another clock has told of them.
    pub fn forget_gaps(&mut self) {
        self.has_gaps();
        self.gaps = Count::default();
    }

    /// Says what was odd. `what` names the times ("log times", "header stamps").
    pub fn report(&mut self, topic: &str, what: &str, start_ns: i64, findings: &mut Vec<Finding>) {
        self.has_gaps();
        let mut say = |kind, count: Count, text| {
            if count.count > 0 {
                let t_s = Some(seconds(count.first, start_ns));
                findings.push(Finding {
                    t_s,
                    ..Finding::new(topic, kind, count.count, text)
                });
            }
        };
        let at = |count: Count| seconds(count.first, start_ns);
        let many = |count: Count, does: &str, do_: &str| {
            let one = what.trim_end_matches('s');
            counted(
                count.count,
                &format!("{one} {does}"),
                &format!("{what} {do_}"),
            )
        };
        say(
            Kind::Duplicate,
            self.duplicates,
            format!(
                "{} the one before, first at {:.3} s",
                many(self.duplicates, "repeats", "repeat"),
                at(self.duplicates)
            ),
        );
        say(
            Kind::Backward,
            self.backward,
            format!(
                "{} before the one before, first at {:.3} s",
                many(self.backward, "lies", "lie"),
                at(self.backward)
            ),
        );
        let usual_s = self.usual.unwrap_or(0) as f64 / 1e9;
        say(
            Kind::Gap,
            self.gaps,
            format!(
                "{} in the {what} (usual interval {usual_s:.6} s), the longest {:.3} s at {:.3} s",
                counted(self.gaps.count, "gap", "gaps"),
                self.longest.0 as f64 / 1e9,
                seconds(self.longest.1, start_ns)
            ),
        );
    }
}

/// Whether a header stamp was never set.
pub(super) fn unset(time: i64, stamp: i64) -> bool {
    stamp == 0 && time != 0
}

fn is_gap(from: i64, to: i64, usual: i64) -> bool {
    to.saturating_sub(from) > usual.saturating_mul(GAP)
}

/// Log time against header stamp: offset = log time − stamp, and its trend.
#[derive(Debug, Default)]
pub(super) struct Clocks {
    /// First log time with a stamp, and its offset: the origin of the sums, so that they keep their digits.
    origin: Option<(i64, i128)>,
    weight: f64,
    t: f64,
    d: f64,
    tt: f64,
    td: f64,
    dd: f64,
    span_s: f64,
    zero: Count,
    differ: bool,
}

impl Clocks {
    /// Takes in times and stamps, row by row.
    pub fn observe(&mut self, times: &[i64], stamps: &[i64]) {
        // Means of short stretches carry offset and trend as well as every message would.
        for (times, stamps) in times.chunks(64).zip(stamps.chunks(64)) {
            // Sums of dates in nanoseconds need more than 64 bits.
            let (mut count, mut t_sum, mut s_sum, mut differ) = (0i64, 0i128, 0i128, 0i64);
            let mut first = None;
            for (&time, &stamp) in times.iter().zip(stamps) {
                if unset(time, stamp) {
                    self.zero.add(time);
                    continue;
                }
                if count == 0 {
                    first = Some((time, i128::from(time) - i128::from(stamp)));
                }
                differ |= time ^ stamp;
                count += 1;
                t_sum += i128::from(time);
                s_sum += i128::from(stamp);
            }
            self.differ |= differ != 0;
            let Some(first) = first else {
                continue; // All stamps are zero.
            };
            let (t_origin, d_origin) = *self.origin.get_or_insert(first);
            let n = count as f64;
            let t = (t_sum - i128::from(count) * i128::from(t_origin)) as f64 / 1e9 / n;
            let d = (t_sum - s_sum - i128::from(count) * d_origin) as f64 / 1e9 / n;
            self.weight += n;
            self.t += n * t;
            self.d += n * d;
            self.tt += n * t * t;
            self.td += n * t * d;
            self.dd += n * d * d;
            self.span_s = self.span_s.max(t);
        }
    }

    /// Whether log times and stamps are simply the same.
    pub fn same(&self) -> bool {
        !self.differ
    }

    /// Says how the clocks stand to each other where that is odd.
    pub fn report(&self, topic: &str, start_ns: i64, findings: &mut Vec<Finding>) {
        let mut say = |kind, count, t_s, text| {
            findings.push(Finding {
                t_s,
                ..Finding::new(topic, kind, count, text)
            })
        };
        if self.zero.count > 0 {
            let t_s = seconds(self.zero.first, start_ns);
            say(
                Kind::ZeroStamp,
                self.zero.count,
                Some(t_s),
                format!(
                    "{} zero, first at {t_s:.3} s",
                    counted(self.zero.count, "header stamp is", "header stamps are")
                ),
            );
        }
        let (Some((_, d_origin)), true) = (self.origin, self.weight > 0.0 && self.differ) else {
            return;
        };
        let (t, d) = (self.t / self.weight, self.d / self.weight);
        let offset_s = d_origin as f64 / 1e9 + d;
        if offset_s.abs() > OFFSET_S {
            let word = if offset_s > 0.0 { "after" } else { "before" };
            say(
                Kind::ClockOffset,
                1,
                None,
                format!(
                    "log time lies {:.3} s {word} the header stamp on average",
                    offset_s.abs()
                ),
            );
        }
        let (var_t, cov, var_d) = (
            self.tt / self.weight - t * t,
            self.td / self.weight - t * d,
            self.dd / self.weight - d * d,
        );
        if var_t <= 0.0 || self.span_s < 5.0 {
            return;
        }
        let slope = cov / var_t;
        let residual = (var_d - slope * cov).max(0.0).sqrt();
        // A trend counts where it stands out of the scatter about it, over the whole recording.
        let change_s = slope * self.span_s;
        if (slope * 1e6).abs() > DRIFT_PPM
            && change_s.abs() > 3.0 * residual
            && change_s.abs() > 1e-3
        {
            let text = if residual > SCATTER_S && change_s.abs() < LINE * residual {
                "log time and header stamp part, but not evenly: was a clock set anew?".to_owned()
            } else {
                format!(
                    "log time runs {:.0} ppm {} than the header stamp ({:.1} ms over {:.1} s)",
                    (slope * 1e6).abs(),
                    if slope > 0.0 { "faster" } else { "slower" },
                    change_s * 1e3,
                    self.span_s
                )
            };
            say(Kind::ClockDrift, 1, None, text);
        }
    }
}

/// Seconds since the start.
pub(super) fn seconds(t_ns: i64, start_ns: i64) -> f64 {
    (i128::from(t_ns) - i128::from(start_ns)) as f64 / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(order: &mut Order) -> Vec<(Kind, u64, Option<f64>)> {
        let mut findings = Vec::new();
        order.report("/t", "log times", 0, &mut findings);
        findings
            .iter()
            .map(|finding| (finding.kind, finding.count, finding.t_s))
            .collect()
    }

    #[test]
    fn gaps_duplicates_and_steps_back_are_counted_across_batches() {
        let mut times: Vec<i64> = (0..1000).map(|i| i * 1_000_000).collect();
        times[500] = times[499];
        for time in &mut times[800..] {
            *time += 50_000_000;
        }
        times[900] = times[10];
        for batch in [1, 7, 64, 1000] {
            let mut order = Order::default();
            for part in times.chunks(batch) {
                order.observe(part);
            }
            // The leap of almost a second that follows the step back at 900 leaves nothing out.
            assert_eq!(
                words(&mut order),
                [
                    (Kind::Duplicate, 1, Some(0.499)),
                    (Kind::Backward, 1, Some(0.01)),
                    (Kind::Gap, 1, Some(0.799))
                ],
                "batches of {batch}"
            );
        }
    }

    #[test]
    fn an_irregular_topic_has_no_gaps() {
        let mut order = Order::default();
        order.observe(
            &(0..100i64)
                .map(|i| i * i * i * 1_000_000)
                .collect::<Vec<_>>(),
        );
        assert_eq!(words(&mut order), []);
    }

    /// What was queued when the recording began comes at once, and does not hide a hole later.
    #[test]
    fn a_queue_that_is_emptied_hides_no_gap() {
        for queued in [12, 50, 200] {
            let at = |k: i64| {
                let hole = if k < 1000 { 0 } else { 5_000_000_000 };
                (k - queued).max(0) * 10_000_000 + k.min(queued) * 50_000 + hole
            };
            let mut order = Order::default();
            order.observe(&(0..3000).map(at).collect::<Vec<_>>());
            let found = words(&mut order);
            assert!(
                found.contains(&(Kind::Gap, 1, Some(at(999) as f64 / 1e9))),
                "{queued}: {found:?}"
            );
        }
    }

    /// Blocks of messages in any order tell what the same messages tell in theirs: nothing, or where one of the blocks is missing.
    #[test]
    fn what_comes_late_fills_its_gap() {
        let at = |k: i64| k * 10_000_000;
        let orders = [
            [0, 1, 3, 2, 5, 4, 8, 9, 7, 6, 11, 10],
            [11, 10, 8, 9, 0, 1, 3, 2, 7, 6, 5, 4],
        ];
        for (block, blocks) in [7, 40, 300]
            .into_iter()
            .flat_map(|b| orders.map(|o| (b, o)))
        {
            for lost in [None, Some(5)] {
                let mut order = Order::default();
                for b in blocks.into_iter().filter(|b| Some(*b) != lost) {
                    let times: Vec<i64> = (b * block..(b + 1) * block).map(at).collect();
                    order.observe(&times);
                }
                let gaps: Vec<_> = words(&mut order)
                    .into_iter()
                    .filter(|(kind, ..)| *kind == Kind::Gap)
                    .collect();
                let expected = lost.map(|b| (Kind::Gap, 1, Some(at(b * block - 1) as f64 / 1e9)));
                assert_eq!(
                    gaps,
                    Vec::from_iter(expected),
                    "blocks of {block}, {blocks:?} without {lost:?}"
                );
            }
        }
    }

    #[test]
    fn drift_and_offset_come_out_as_put_in() {
        let stamps: Vec<i64> = (0..60_000)
            .map(|i| 1_700_000_000_000_000_000 + i * 1_000_000)
            .collect();
        let times: Vec<i64> = stamps
            .iter()
            .enumerate()
            .map(|(i, s)| s + 2_000_000_000 + i as i64 * 100)
            .collect();
        let mut clocks = Clocks::default();
        for (times, stamps) in times.chunks(300).zip(stamps.chunks(300)) {
            clocks.observe(times, stamps);
        }
        let mut findings = Vec::new();
        clocks.report("/t", times[0], &mut findings);
        let texts: Vec<&str> = findings
            .iter()
            .map(|finding| finding.text.as_str())
            .collect();
        assert_eq!(
            texts,
            [
                "log time lies 2.003 s after the header stamp on average",
                "log time runs 100 ppm faster than the header stamp (6.0 ms over 60.0 s)"
            ]
        );
    }

    #[test]
    fn stamps_that_are_zero_or_far_off_leave_the_offset_right() {
        let times: Vec<i64> = (0..1000)
            .map(|i| 1_700_000_000_000_000_000 + i * 1_000_000)
            .collect();
        let report = |late_ns: i64, odd: &[(usize, i64)]| {
            let mut stamps: Vec<i64> = times.iter().map(|time| time - late_ns).collect();
            for &(row, stamp) in odd {
                stamps[row] = stamp;
            }
            let mut clocks = Clocks::default();
            clocks.observe(&times, &stamps);
            let mut findings = Vec::new();
            clocks.report("/t", times[0], &mut findings);
            let texts = findings.into_iter().map(|finding| finding.text);
            texts.collect::<Vec<_>>()
        };
        assert_eq!(
            report(1_000_000, &[(0, 0)]),
            ["1 header stamp is zero, first at 0.000 s"]
        );
        assert_eq!(
            report(201_000_000, &[(0, 0)])[1],
            "log time lies 0.201 s after the header stamp on average"
        );
        // Wherever the one stands that is off by 1e9 s, the mean is off by a thousandth of that.
        for row in [0, 500] {
            assert_eq!(
                report(0, &[(row, times[row] - 1_000_000_000_000_000_000)]),
                ["log time lies 1000000.000 s after the header stamp on average"]
            );
        }
    }
}

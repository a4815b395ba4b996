//! When a sensor's samples were taken, where the log only knows when they came.
//!
//! ```text
//! t = s + min(l − s)        in the first and the last third of the recording; between and beyond them along a straight line
//! ```
//! s header stamp, l log time (s). What was never late lies on the lower edge of l − s: the two clocks' offset and drift, and the least delay. The
//! log's clock stays everybody's; its scatter does not get into the motion, whose height is two integrals of it. Where that edge leaps, one of the clocks
//! was set anew, which is put right before: no straight line goes through a leap.
//! Source: the lower-envelope estimate of one-way delays, Moon, Skelly & Towsley, INFOCOM 1999.

use crate::imu::track::period_s;
use crate::inputs::{mean_step_in, stretches};
use crate::median::median;
use recording::text::counted;
use std::fmt::{self, Display, Formatter};
use std::ops::Range;

/// Stamps are believed where their steps scatter by less than this share of the log times' own scatter.
const MORE_EVEN: f64 = 0.8;
/// Scatter of log times that nobody minds, s: what is driven by a crystal and logged at once.
const EVEN_S: f64 = 2e-5;
/// Samples whose usual step is below this share of their mean step came in packets.
const PACKETS: f64 = 0.6;
/// Packets of so many samples on average leave hardly more than one step in twenty; of 20, fewer, which then look like holes. So many of them tell
/// their rate.
const LONG_PACKET: usize = 19;
const FEWEST_PACKETS: usize = 4;
/// Stamps whose span is not the log's within this share run at another pace, or tell no times.
const SAME_SPAN: f64 = 0.1;
/// Stamps that run slower than the log by more than this are in another unit, or nobody filled them in. Those that run faster by more count messages,
/// unless the log's mean step is shorter than any device's (s).
const FARTHEST_PACE: f64 = 20.0;
const AT_ONCE_S: f64 = 1e-3;
/// A clock is set anew once or twice; what goes back more often are messages that overtake each other.
const SET_ANEW: usize = 3;
/// Parts of a log whose least delays are compared; of so few samples each they tell nothing.
const PARTS: usize = 16;
const FEWEST_IN_PART: usize = 8;
/// Samples that are looked at together for their density; such that come in less than this share of the usual time are dense.
const AT_ONCE: usize = 20;
const DENSE: f64 = 0.75;
/// Neighbours are so much further apart (mean square) than every other sample where two courses come by turns; noise alone makes it 1, a smooth course 1/4.
const BY_TURNS: f64 = 2.0;
/// Less (s) is what comes late.
const LEAST_TWICE_S: f64 = 0.3;
/// Least delays that leap by more than this (s), and by so many times what they usually change by, are those of a clock that was set anew.
const LEAP_S: f64 = 0.02;
const LEAP: f64 = 10.0;

/// More stamps astray than this share are no exceptions: none is believed then.
const EXCEPTIONS: f64 = 0.01;
/// Kind of the remark that stamps tell the times.
const BY_STAMPS: &str = "by_stamps";

/// Times of the samples, s, ascending or not, NaN where nothing tells them; and what was done, where that is worth a word.
pub struct Dated {
    /// When.
    pub t_s: Vec<f64>,
    /// Whether the samples have overtaken each other and belong in the order of these times.
    pub overtaken: bool,
    /// Whether the log tells nothing of these times, not even how long it lasted.
    pub own_pace: bool,
    /// Kind and text of a remark.
    pub remark: Option<(&'static str, String)>,
}

impl Dated {
    /// First and last time (s), where the log tells nothing of them.
    pub fn own_s(&self) -> Option<(f64, f64)> {
        ends_s(self.t_s.iter().copied().filter(|_| self.own_pace))
    }
}

/// The earliest and the latest of times in any order, s.
pub fn ends_s(t_s: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    t_s.map(|t| (t, t))
        .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}

/// From log times (s since the recording begins) and, where every sample has one, header stamps (s, moved by [`delay_s`]), in the order of the log. Samples
/// whose stamps are [`astray`] have no time where stamps tell it.
pub fn dated(log_s: Vec<f64>, stamp_s: Option<Vec<f64>>) -> Dated {
    let stamp_s = stamp_s.filter(|s| s.len() == log_s.len());
    let strays = stamp_s
        .as_ref()
        .map_or_else(Vec::new, |s| astray(&log_s, s));
    if strays.is_empty() {
        return dated_by_all(log_s, stamp_s);
    }
    let others = |x: &[f64]| {
        let others = (0..x.len()).filter(|k| strays.binary_search(k).is_err());
        others.map(|k| x[k]).collect::<Vec<f64>>()
    };
    let found = dated_by_all(others(&log_s), stamp_s.as_deref().map(others));
    if found.remark.as_ref().is_none_or(|said| said.0 != BY_STAMPS) {
        return dated_by_all(log_s, None);
    }
    let mut known = found.t_s.iter().copied();
    let t_s = (0..log_s.len()).map(|k| match strays.binary_search(&k) {
        Ok(_) => f64::NAN,
        Err(_) => known.next().unwrap_or(f64::NAN),
    });
    Dated {
        t_s: t_s.collect(),
        remark: found.remark.map(|(kind, text)| {
            let count = counted(strays.len() as u64, "stamp lies", "stamps lie");
            (
                kind,
                format!("{text}; {count} alone and far off: what was stamped so is left out"),
            )
        }),
        ..found
    }
}

/// Stamps that leap from those before and behind them by more than a tenth of the log, and back, ascending: nobody filled them in. A clock that is set anew does
/// not go back at the next sample, and no message is that late.
fn astray(log_s: &[f64], stamp_s: &[f64]) -> Vec<usize> {
    let step_s = |a: usize, b: usize| stamp_s[b] - stamp_s[a];
    let n = stamp_s.len();
    let mut steps: Vec<f64> = (1..n).map(|k| step_s(k - 1, k)).collect();
    let by_stamps_s = median(&mut steps).unwrap_or(0.0).abs() * n as f64;
    let far_s = SAME_SPAN * span_s(log_s).max(by_stamps_s);
    let alone = |k: &usize| {
        let before = k.checked_sub(1).map(|b| step_s(b, *k));
        let behind = (k + 1 < n).then(|| step_s(k + 1, *k));
        let [a, b] = [before.or(behind), behind.or(before)].map(Option::unwrap_or_default);
        a.abs().min(b.abs()) > far_s && a * b > 0.0
    };
    let mut found: Vec<usize> = (0..n).filter(alone).collect();
    if found.len() as f64 > EXCEPTIONS * n as f64 {
        found.clear();
    }
    found
}

fn dated_by_all(log_s: Vec<f64>, stamp_s: Option<Vec<f64>>) -> Dated {
    let of_log = scatter_s(&log_s);
    if let Some(mut stamp_s) =
        stamp_s.filter(|s| s.len() == log_s.len() && s.iter().all(|s| s.is_finite()))
    {
        let mut log_s = log_s.clone();
        let set = put_right(&mut log_s, &mut stamp_s);
        let back = steps_back(&stamp_s);
        let overtaken = back > SET_ANEW;
        let mut ordered = stamp_s.clone();
        if overtaken {
            ordered.sort_by(f64::total_cmp);
        }
        let of_stamps = scatter_s(&ordered);
        let spans = [&stamp_s, &log_s].map(|t| span_s(t));
        let same_span = (spans[0] - spans[1]).abs() <= SAME_SPAN * spans[1];
        if !same_span && 4 * back < stamp_s.len() && has_own_pace(&ordered, spans[1]) {
            return Dated {
                t_s: stamp_s,
                overtaken,
                own_pace: true,
                remark: Some((
                    BY_STAMPS,
                    format!(
                        "samples are dated by their header stamps, which span {:.3} s, the log times {:.3} s (written at once, or beside a simulation or a replay?); rates and lines of single signals are by the log",
                        spans[0], spans[1]
                    ),
                )),
            };
        }
        let more_even = of_log > EVEN_S && of_stamps < MORE_EVEN * of_log;
        if same_span && (more_even || set.iter().any(|set| set.of_log)) {
            return Dated {
                t_s: on_the_logs_clock(&log_s, &stamp_s),
                overtaken,
                own_pace: false,
                remark: Some((
                    BY_STAMPS,
                    format!(
                        "samples are dated by their header stamps, whose steps scatter by {:.2} ms, those of the log times by {:.2} ms{}",
                        1e3 * of_stamps,
                        1e3 * of_log,
                        set.iter().map(Set::to_string).collect::<String>()
                    ),
                )),
            };
        }
    }
    match unpacked(&log_s) {
        Some((t_s, usual, mean)) => Dated {
            t_s,
            overtaken: false,
            own_pace: false,
            remark: Some((
                "packets",
                format!(
                    "samples came in packets ({:.2} ms from one to the next as a rule, {:.2} ms on average) without useful times of their own; they are taken as evenly spaced",
                    1e3 * usual,
                    1e3 * mean
                ),
            )),
        },
        None => Dated {
            t_s: log_s,
            overtaken: false,
            own_pace: false,
            remark: None,
        },
    }
}

/// Where samples in the order of their times come twice as often as they do before, and tell of two courses by turns: a clock was set back there. A queue that
/// is emptied comes as often, but nothing comes before it; a sensor that doubles its rate tells of one course.
pub fn mixed(t_s: &[f64], x: &[&[f64]]) -> Vec<Range<usize>> {
    let mut found = twice(t_s);
    found.retain(|within| x.iter().any(|x| goes_back_and_forth(&x[within.clone()])));
    found
}

/// Whether samples in the order of their times tell of two courses by turns all the time: two sensors publish under one name. What goes back and forth by less
/// than `least` (RMS) may be one that trembles at half its rate.
pub fn are_two(x: &[&[f64]], least: f64) -> bool {
    x.iter()
        .any(|x| mean_square(x, 1) > least * least && goes_back_and_forth(x))
}

fn goes_back_and_forth(x: &[f64]) -> bool {
    mean_square(x, 1) > BY_TURNS * mean_square(x, 2)
}

/// Of the differences of what stands so far apart, about.
fn mean_square(x: &[f64], by: usize) -> f64 {
    let apart = x.windows(by + 1).map(|w| (w[by] - w[0]).powi(2));
    let sum: f64 = apart.filter(|a| a.is_finite()).sum();
    sum / x.len().max(1) as f64
}

fn twice(t_s: &[f64]) -> Vec<Range<usize>> {
    let Some(usual_s) = period_s(t_s) else {
        return Vec::new();
    };
    let dense = |k: usize| t_s[k + AT_ONCE] - t_s[k] < DENSE * AT_ONCE as f64 * usual_s;
    let mut found = Vec::new();
    let mut k = 0;
    while k + AT_ONCE < t_s.len() {
        if !dense(k) {
            k += 1;
            continue;
        }
        let first = k;
        while k + AT_ONCE < t_s.len() && dense(k) {
            k += 1;
        }
        // The last that is dense ends where its samples do; on either side the first few are still single.
        let within = first + AT_ONCE / 4..k + AT_ONCE * 3 / 4;
        let (from_s, to_s) = (t_s[within.start], t_s[within.end.min(t_s.len() - 1)]);
        let lasts_s = to_s - from_s;
        let before = t_s.partition_point(|t| *t < from_s - lasts_s);
        let (single, double) = (within.start - before, within.len());
        let alone = lasts_s / usual_s;
        let like = |count: usize, times: f64| (count as f64 / (times * alone) - 1.0).abs() < 0.25;
        if lasts_s >= LEAST_TWICE_S && like(single, 1.0) && like(double, 2.0) {
            found.push(within.start..within.end.min(t_s.len()));
        }
    }
    found
}

/// What stamps (s since the first of them) are moved by, so that none lies behind its log time, nor before the recording begins.
pub fn delay_s(late: impl Iterator<Item = f64>) -> f64 {
    late.fold(f64::MAX, f64::min).max(0.0)
}

/// That a clock was set while it ran.
struct Set {
    of_log: bool,
    at_s: f64,
    by_s: f64,
}

impl Display for Set {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Set { of_log, at_s, by_s } = *self;
        let whose = if of_log { "the log's" } else { "the stamps'" };
        write!(
            f,
            "; {whose} clock was set by {by_s:+.3} s at {at_s:.1} s, which is put right"
        )
    }
}

/// Takes out the leaps of a clock that was set anew: of the stamps', behind it; of the log's, in the shorter part, for the others' times are on the
/// clock of the longer one.
fn put_right(log_s: &mut [f64], stamp_s: &mut [f64]) -> Vec<Set> {
    let n = log_s.len();
    if n < PARTS * FEWEST_IN_PART {
        return Vec::new();
    }
    let mut order: Vec<usize> = (0..n).collect();
    // Where the log was set back its samples come mixed; where the stamps were, they do in the order of the stamps.
    if steps_back(stamp_s) > SET_ANEW {
        order.sort_by(|a, b| stamp_s[*a].total_cmp(&stamp_s[*b]));
    }
    let late: Vec<f64> = order.iter().map(|k| log_s[*k] - stamp_s[*k]).collect();
    let part = |p: usize| p * n / PARTS..(p + 1) * n / PARTS;
    let least = |within: Range<usize>| late[within].iter().copied().fold(f64::MAX, f64::min);
    let changes: Vec<f64> = (1..PARTS)
        .map(|p| least(part(p)) - least(part(p - 1)))
        .collect();
    let drift = median(&mut changes.clone()).unwrap_or(0.0);
    let apart = changes.iter().map(|change| (change - drift).abs());
    let usual = median(&mut apart.clone().collect::<Vec<_>>()).unwrap_or(0.0);
    let leaps = |(_, apart): &(usize, f64)| *apart > LEAP_S.max(LEAP * usual);
    let leaps: Vec<usize> = apart.enumerate().filter(leaps).map(|(p, _)| p).collect();
    if leaps.len() > SET_ANEW {
        return Vec::new();
    }
    let step_of = |t_s: &[f64], k: usize| t_s[order[k]] - t_s[order[k - 1]];
    let usual_step = |t_s: &[f64]| {
        let mut steps: Vec<f64> = (1..n).map(|k| step_of(t_s, k)).collect();
        median(&mut steps).unwrap_or(0.0)
    };
    let usual_steps = [usual_step(log_s), usual_step(stamp_s)];
    let mut sets = Vec::new();
    for p in leaps {
        let leap_s = changes[p] - drift;
        let (from, to) = (part(p).start.max(1), part(p + 1).end);
        // What comes late lies above the edge, on whichever side.
        let middle_s = least(part(p)) + 0.5 * leap_s;
        let below = |k: &usize| late[*k] < middle_s;
        let first = match leap_s > 0.0 {
            true => (from..to).rfind(below).map(|last| last + 1),
            false => (from..to).find(below),
        };
        let Some(first) = first.filter(|k| *k < n) else {
            continue;
        };
        // A part that holds a little of both tells too little of it.
        let each = n / PARTS;
        let behind = least(first..(first + each).min(n));
        let leap_s = behind - least(first.saturating_sub(each)..first) - drift;
        let odd = |t_s: &[f64], usual: f64| (step_of(t_s, first) - usual).abs();
        let of_log = odd(log_s, usual_steps[0]) > odd(stamp_s, usual_steps[1]);
        let at_s = log_s[order[first]];
        let (before, behind) = order.split_at(first);
        match of_log {
            false => behind.iter().for_each(|k| stamp_s[*k] += leap_s),
            true if before.len() < behind.len() => {
                before.iter().for_each(|k| log_s[*k] += leap_s);
            }
            true => behind.iter().for_each(|k| log_s[*k] -= leap_s),
        }
        sets.push(Set {
            of_log,
            at_s,
            by_s: if of_log { leap_s } else { -leap_s },
        });
    }
    sets
}

/// How often times go back.
fn steps_back(t_s: &[f64]) -> usize {
    t_s.windows(2).filter(|w| w[1] < w[0]).count()
}

/// From the earliest to the latest, s.
fn span_s(t_s: &[f64]) -> f64 {
    ends_s(t_s.iter().copied()).map_or(0.0, |(first, last)| last - first)
}

/// Whether ascending stamps are times of a clock that runs at another pace than the log, which spans `log_s`. One that was only set anew goes on at
/// the log's pace.
fn has_own_pace(stamp_s: &[f64], log_s: f64) -> bool {
    let mut steps: Vec<f64> = stamp_s.windows(2).map(|w| w[1] - w[0]).collect();
    let mean_s = log_s / steps.len() as f64;
    median(&mut steps).is_some_and(|usual_s| {
        let possible = match mean_s < AT_ONCE_S {
            true => f64::INFINITY,
            false => FARTHEST_PACE * mean_s,
        };
        usual_s > 0.0
            && (usual_s - mean_s).abs() > SAME_SPAN * mean_s
            && (mean_s / FARTHEST_PACE..=possible).contains(&usual_s)
    })
}

/// Mean absolute difference of steps from the usual one, s.
fn scatter_s(t_s: &[f64]) -> f64 {
    let steps: Vec<f64> = t_s.windows(2).map(|w| w[1] - w[0]).collect();
    let usual = median(&mut steps.clone()).unwrap_or(0.0);
    steps.iter().map(|s| (s - usual).abs()).sum::<f64>() / steps.len().max(1) as f64
}

/// The lower edge of what comes late: a straight line through the least of two parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Where the first is, and by how much it is late, s.
    pub at_s: f64,
    pub late_s: f64,
    /// By how much more the other is, s, and per second.
    pub grows_s: f64,
    pub slope: f64,
}

impl Edge {
    /// Of times and latenesses, s; `None` where a part is empty.
    pub fn of(parts: [impl Iterator<Item = (f64, f64)>; 2]) -> Option<Self> {
        let [a, b] = parts.map(|part| part.min_by(|a, b| a.1.total_cmp(&b.1)));
        let (a, b) = (a?, b?);
        let grows_s = b.1 - a.1;
        let slope = if b.0 > a.0 {
            grows_s / (b.0 - a.0)
        } else {
            0.0
        };
        Some(Edge {
            at_s: a.0,
            late_s: a.1,
            grows_s,
            slope,
        })
    }

    /// A time moved by it, s.
    pub fn moved(&self, s: f64) -> f64 {
        s + self.late_s + self.slope * (s - self.at_s)
    }
}

/// Stamps moved and stretched so that none lies behind its log time, and two lie on it.
fn on_the_logs_clock(log_s: &[f64], stamp_s: &[f64]) -> Vec<f64> {
    let late = |range: Range<usize>| range.map(|k| (stamp_s[k], log_s[k] - stamp_s[k]));
    let (n, third) = (log_s.len(), log_s.len() / 3);
    match Edge::of([late(0..third), late(n - third..n)]) {
        Some(edge) => stamp_s.iter().map(|s| edge.moved(*s)).collect(),
        None => log_s.to_vec(),
    }
}

/// Even times for samples that came in packets, stretch by stretch the least-squares line of time over number; with their usual and mean step.
///
/// Of P packets alike with one time each, that line of n samples is too flat, by (1 − 1/P²)/(1 − 1/n²): the variance of stairs over that of a ramp.
fn unpacked(log_s: &[f64]) -> Option<(Vec<f64>, f64, f64)> {
    let usual = median(&mut log_s.windows(2).map(|w| w[1] - w[0]).collect::<Vec<_>>())?;
    // Holes only make the mean over all of it longer.
    if !(usual < PACKETS * mean_s(log_s)?) {
        return None;
    }
    let packets = packets(log_s)?;
    let (parts, filled_s) = match long(log_s, &packets) {
        Some((parts, filled_s)) => (parts, Some(filled_s)),
        None => (stretches(log_s, 0.0), None),
    };
    let mean = filled_s.or_else(|| mean_step_in(log_s, &parts))?;
    if !(usual < PACKETS * mean) || is_of_losses(log_s, usual, &packets) {
        return None;
    }
    let inverse_square = |n: usize| (n as f64).powi(-2);
    let mut t_s = Vec::with_capacity(log_s.len());
    for part in parts {
        let x = &log_s[part.clone()];
        let middle = 0.5 * (x.len() as f64 - 1.0);
        let centre = x.iter().sum::<f64>() / x.len() as f64;
        let (mut kt, mut kk) = (0.0, 0.0);
        for (k, t) in x.iter().enumerate() {
            kt += (k as f64 - middle) * (t - centre);
            kk += (k as f64 - middle).powi(2);
        }
        let count = packets.partition_point(|p| p.start < part.end)
            - packets.partition_point(|p| p.start < part.start);
        let step = match count {
            0 | 1 => filled_s.unwrap_or(0.0),
            _ => kt / kk * (1.0 - inverse_square(x.len())) / (1.0 - inverse_square(count)),
        };
        t_s.extend((0..x.len()).map(|k| centre + step * (k as f64 - middle)));
    }
    Some((t_s, usual, mean))
}

/// A step so near to a whole number of usual ones is of samples lost between; and so many of all are where the log's times are right.
const WHOLE: f64 = 0.15;
const RIGHT: f64 = 0.9;

/// Whether samples only look like packets because many are lost: each comes by itself, a whole number of usual steps after the one before.
fn is_of_losses(log_s: &[f64], usual_s: f64, packets: &[Range<usize>]) -> bool {
    let steps = log_s.windows(2).map(|w| (w[1] - w[0]) / usual_s);
    let whole = steps.filter(|steps| (steps - steps.round()).abs() < WHOLE && *steps > 0.5);
    2 * packets.len() > log_s.len() && whole.count() as f64 > RIGHT * (log_s.len() - 1) as f64
}

/// Mean step, holes and all.
fn mean_s(log_s: &[f64]) -> Option<f64> {
    let span_s = log_s.last()? - log_s.first()?;
    Some(span_s / (log_s.len() as f64 - 1.0))
}

/// Samples that follow each other much faster than the mean, as ranges.
fn packets(log_s: &[f64]) -> Option<Vec<Range<usize>>> {
    let within_s = 0.1 * mean_s(log_s)?;
    let ends = (1..log_s.len()).filter(|k| log_s[*k] - log_s[k - 1] > within_s);
    let mut start = 0;
    let each = ends.chain([log_s.len()]);
    Some(
        each.map(|end| std::mem::replace(&mut start, end)..end)
            .collect(),
    )
}

/// Where packets are so long that the pauses between them look like holes: the parts between true holes, and the usual step within (s). A packet
/// fills the time since the one before; a hole is half as long again as that.
fn long(log_s: &[f64], packets: &[Range<usize>]) -> Option<(Vec<Range<usize>>, f64)> {
    if packets.len() < FEWEST_PACKETS || log_s.len() < LONG_PACKET * packets.len() {
        return None;
    }
    let fills = |w: &[Range<usize>]| (log_s[w[1].start] - log_s[w[0].start]) / w[1].len() as f64;
    let usual_s = median(&mut packets.windows(2).map(fills).collect::<Vec<_>>())?;
    let mut parts = Vec::new();
    let mut start = 0;
    for w in packets.windows(2).filter(|w| fills(w) > 1.5 * usual_s) {
        parts.push(start..w[1].start);
        start = w[1].start;
    }
    parts.push(start..log_s.len());
    Some((parts, usual_s))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn worst(a: &[f64], b: impl Iterator<Item = f64>) -> f64 {
        a.iter()
            .zip(b)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max)
    }

    /// One that hangs upright and one that lies, by turns; and one sensor alone, smooth or noisy.
    #[test]
    fn two_sensors_under_one_name_are_found() {
        let mut random = Random(3);
        let sway = |k: usize| (0.07 * k as f64).sin();
        let one: Vec<f64> = (0..1000).map(|k| 9.8 + sway(k)).collect();
        let noisy: Vec<f64> = one.iter().map(|x| x + 3.0 * random.normal()).collect();
        let both: Vec<f64> = (0..1000)
            .map(|k| if k % 2 == 0 { 9.8 } else { 0.0 } + sway(k))
            .collect();
        assert!(are_two(&[&one, &both], 1.0));
        assert!(!are_two(&[&one, &noisy], 1.0) && !are_two(&[&both], 10.0));
        assert!(!are_two(&[&[]], 1.0) && !are_two(&[], 1.0));
    }

    #[test]
    fn late_samples_are_dated_by_their_stamps_on_the_logs_clock() {
        // A device whose clock runs 80 ppm fast and began long ago; messages come 2 ms late and more.
        let mut random = Random(3);
        let taken: Vec<f64> = (0..6000).map(|k| f64::from(k) * 0.01).collect();
        let stamps: Vec<f64> = taken.iter().map(|t| (1.0 + 8e-5) * t).collect();
        let late = |t: &f64| t + 0.002 - 0.003 * (1.0 - random.uniform()).ln();
        let log: Vec<f64> = taken.iter().map(late).collect();
        let found = dated(log.clone(), Some(stamps.clone()));
        assert_eq!(found.remark.unwrap().0, "by_stamps");
        let off = worst(&found.t_s, taken.iter().map(|t| t + 0.002));
        assert!(off < 5e-5, "{off}");
        // What is as even as its stamps is left alone.
        assert_eq!(dated(taken.clone(), Some(stamps)).t_s, taken);
        assert!(dated(log.clone(), None).remark.is_none());
        // Stamps that nobody filled in, or in another unit.
        for stamps in [vec![0.0; 6000], taken.iter().map(|t| 1e-3 * t).collect()] {
            assert_eq!(dated(log.clone(), Some(stamps)).t_s, log);
        }
    }

    /// Late samples of which one in two thousand has a stamp that nobody filled in, or one from elsewhere, first and last among them: these alone have no time.
    #[test]
    fn a_stamp_astray_costs_its_own_sample() {
        let mut random = Random(3);
        let taken: Vec<f64> = (0..6000).map(|k| 0.01 * f64::from(k)).collect();
        let late = |t: &f64| t + 0.002 - 0.003 * (1.0 - random.uniform()).ln();
        let late: Vec<f64> = taken.iter().map(late).collect();
        for at in [vec![0], vec![3000], vec![1500, 4000, 5999]] {
            for astray_s in [-1.7e9, 40.0, 9e9] {
                let mut stamps = taken.clone();
                at.iter().for_each(|k| stamps[*k] += astray_s);
                let found = dated(late.clone(), Some(stamps));
                let (kind, said) = found.remark.expect("a remark");
                assert!(
                    kind == "by_stamps" && said.contains("alone and far off"),
                    "{said}"
                );
                let lost: Vec<usize> = (0..6000).filter(|k| found.t_s[*k].is_nan()).collect();
                assert_eq!(lost, at);
                let known = found.t_s.iter().zip(&taken).filter(|(t, _)| t.is_finite());
                let off = known
                    .map(|(t, k)| (t - k - 0.002).abs())
                    .fold(0.0, f64::max);
                assert!(off < 5e-5, "{off}");
            }
        }
        // Where the log's times do, none is lost.
        let mut stamps = taken.clone();
        stamps[3000] = -1.7e9;
        assert_eq!(dated(taken.clone(), Some(stamps)).t_s, taken);
    }

    #[test]
    fn a_clock_that_is_set_on_the_way_stretches_nothing() {
        let mut random = Random(7);
        let taken: Vec<f64> = (0..7000).map(|k| f64::from(k) * 0.01).collect();
        let mut delay = || 0.003 - 0.002 * (1.0 - random.uniform()).ln();
        let delay: Vec<f64> = taken.iter().map(|_| delay()).collect();
        for leap_s in [0.05, 0.4, 3.0, -0.05, -0.8, -3.0] {
            for at_s in [9.0, 35.0, 61.0] {
                let set = |t: &f64| t + if *t > at_s { leap_s } else { 0.0 };
                let late = |t: Vec<f64>| t.iter().zip(&delay).map(|(t, d)| t + d).collect();
                // The log's clock: times are those of the longer part. A recording comes in the order of its log times.
                let log: Vec<f64> = late(taken.iter().map(set).collect());
                let mut both: Vec<(f64, f64)> = log.into_iter().zip(taken.clone()).collect();
                both.sort_by(|a, b| a.0.total_cmp(&b.0));
                let (log, stamps): (Vec<f64>, Vec<f64>) = both.into_iter().unzip();
                let moved_s = if at_s < 30.0 { leap_s } else { 0.0 } + 0.003;
                let found = dated(log, Some(stamps.clone()));
                let off = worst(&found.t_s, stamps.iter().map(|t| t + moved_s));
                let said = found.remark.expect("a remark").1;
                assert!(off < 1e-4, "{leap_s} {at_s}: {off}, {said}");
                assert!(said.contains("the log's clock was set by "), "{said}");
                // The stamps'.
                let stamps = taken.iter().map(set).collect();
                let found = dated(late(taken.clone()), Some(stamps));
                let off = worst(&found.t_s, taken.iter().map(|t| t + 0.003));
                let said = found.remark.expect("a remark").1;
                assert!(off < 1e-3, "{leap_s} {at_s}: {off}, {said}");
                assert!(said.contains("the stamps' clock was set by "), "{said}");
            }
        }
    }

    #[test]
    fn what_lies_mixed_where_a_clock_was_set_back_is_found() {
        for (back_s, jitter_s) in [(0.504, 0.0), (2.004, 1e-3), (15.304, 1e-3)] {
            let mut random = Random(11);
            let at = |t: f64| if t > 35.0 { t - back_s } else { t };
            let mut t_s: Vec<f64> = (0..7000)
                .map(|k| at(f64::from(k) * 0.01) + jitter_s * random.uniform())
                .collect();
            assert!(twice(&t_s[..3400]).is_empty());
            t_s.sort_by(f64::total_cmp);
            let [found] = &twice(&t_s)[..] else {
                panic!("{back_s}: {:?}", twice(&t_s));
            };
            let (from_s, to_s) = (t_s[found.start], t_s[found.end - 1]);
            let off_s = (from_s - (35.0 - back_s)).abs().max((to_s - 35.0).abs());
            assert!(off_s < 0.06, "{back_s}: {from_s} {to_s}");
        }
        // A queue that is emptied after a second.
        let queue = |k: i32| f64::from(k) * 0.01;
        let queue: Vec<f64> = (0..7000)
            .map(|k| match k {
                3000..3100 => 31.0 + 0.002 * f64::from(k - 3000),
                _ => queue(k),
            })
            .collect();
        assert!(twice(&queue).is_empty());
    }

    /// A minute at 50 Hz, of which 15 s come twice as often: of two moments, or of one sensor that is faster there.
    #[test]
    fn a_sensor_that_doubles_its_rate_is_not_mixed() {
        let seen = |t: f64| (13.0 * t).sin() + 0.1 * (70.0 * t).cos();
        let times = |later_s: f64| {
            let single = (0..3000).map(|k| 0.02 * f64::from(k));
            let more = (1500..2250).map(|k| 0.02 * f64::from(k) + 0.01);
            let mut both: Vec<(f64, f64)> = single
                .map(|t| (t, seen(t)))
                .chain(more.map(|t| (t, seen(t + later_s))))
                .collect();
            both.sort_by(|a, b| a.0.total_cmp(&b.0));
            both.into_iter().unzip::<f64, f64, Vec<_>, Vec<_>>()
        };
        let (t_s, x) = times(0.0);
        assert_eq!(twice(&t_s).len(), 1);
        assert!(mixed(&t_s, &[&x]).is_empty());
        let (t_s, x) = times(20.45);
        let still = vec![0.0; x.len()];
        assert_eq!(mixed(&t_s, &[&still, &x]), twice(&t_s));
        assert!(mixed(&t_s, &[&still]).is_empty());
    }

    #[test]
    fn a_log_that_keeps_another_pace_tells_no_times() {
        let taken: Vec<f64> = (0..6000).map(|k| f64::from(k) * 0.01).collect();
        let at = |f: fn(f64) -> f64| -> Vec<f64> { taken.iter().map(|t| f(*t)).collect() };
        // Written at once, within half a second, at the end of a recording that others fill; beside a simulation, slow and fast.
        for (log, begins_s) in [
            (at(|_| 0.0), 0.0),
            (at(|_| 70.0), 70.0 - 59.99),
            (at(|t| 8e-3 * t), 0.0),
            (at(|t| 3.0 * t), 0.0),
            (at(|t| 4.0 + 0.5 * t), 0.0),
        ] {
            let moved_s = delay_s(log.iter().zip(&taken).map(|(l, s)| l - s));
            let stamps = taken.iter().map(|t| t + moved_s).collect();
            let found = dated(log, Some(stamps));
            assert!(found.own_pace && found.remark.unwrap().0 == "by_stamps");
            let off = worst(&found.t_s, taken.iter().map(|t| t + begins_s));
            assert!(off < 1e-9, "{off}");
        }
        // Stamps that were set anew on the way, that count messages, or that are whatever was in memory, leave the log as it is.
        let mut random = Random(9);
        for stamps in [
            at(|t| if t < 20.0 { t } else { t + 3600.0 }),
            at(|t| 100.0 * t),
            taken.iter().map(|_| 1e5 * random.uniform()).collect(),
        ] {
            assert_eq!(dated(taken.clone(), Some(stamps)).t_s, taken);
        }
    }

    #[test]
    fn messages_that_overtake_each_other_are_dated_by_their_stamps() {
        let mut random = Random(5);
        let taken: Vec<f64> = (0..6000).map(|k| f64::from(k) * 0.005).collect();
        let mut both: Vec<(f64, f64)> = taken
            .iter()
            .map(|t| (t - 0.005 * (1.0 - random.uniform()).ln(), *t))
            .collect();
        both.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (log, stamps): (Vec<f64>, Vec<f64>) = both.into_iter().unzip();
        let found = dated(log.clone(), Some(stamps.clone()));
        assert!(found.overtaken && found.remark.unwrap().0 == "by_stamps");
        let off = worst(&found.t_s, stamps.iter().copied());
        assert!(off < 5e-5, "{off}");
        // A clock that is set back half a second is another matter: nothing is to be shuffled.
        let set_back = |k: usize, t: f64| if k < 3000 { t } else { t - 0.5 };
        let stamps = taken.iter().enumerate().map(|(k, t)| set_back(k, *t));
        assert!(!dated(log, Some(stamps.collect())).overtaken);
    }

    #[test]
    fn packets_are_spread_and_holes_kept() {
        let taken = |k: i32| f64::from(k) * 0.005 + if k < 4000 { 0.0 } else { 2.0 };
        for inside_s in [0.0, 2e-4] {
            let log: Vec<f64> = (0..12_000)
                .map(|k| taken(k / 4 * 4) + f64::from(k % 4) * inside_s)
                .collect();
            let found = dated(log, None);
            assert_eq!(found.remark.unwrap().0, "packets");
            // Late or early alike, by up to a packet.
            let late = found.t_s[0] - taken(0);
            let off = worst(&found.t_s, (0..12_000).map(|k| taken(k) + late));
            assert!(late.abs() < 0.02 && off < 1e-4, "{late} {off}");
        }
    }

    /// Half of the samples are lost, and each of the others has its time.
    #[test]
    fn many_lost_samples_are_no_packets() {
        let mut random = Random(5);
        for share in [0.42, 0.55] {
            let all = (0..3000).map(|k| f64::from(k) / 30.0);
            let log: Vec<f64> = all.filter(|_| random.uniform() > share).collect();
            let found = dated(log.clone(), None);
            assert_eq!(worst(&found.t_s, log.into_iter()), 0.0, "{share}");
        }
    }

    /// Whether one step in twenty is a little more or less than that must not matter.
    #[test]
    fn packets_of_twenty_are_spread_wherever_the_first_begins() {
        for (each, skipped) in (15..25).flat_map(|each| [0, 7, 12].map(|skipped| (each, skipped))) {
            let kept = skipped..12_000;
            let log = kept.clone().map(|k| f64::from(k / each * each) * 0.005);
            let found = dated(log.collect(), None);
            assert_eq!(
                found.remark.map(|r| r.0),
                Some("packets"),
                "{each} {skipped}"
            );
            let late = found.t_s[6000] - f64::from(6000 + skipped) * 0.005;
            let off = worst(&found.t_s, kept.map(|k| f64::from(k) * 0.005 + late));
            // Half a packet.
            assert!(off < 0.0025 * f64::from(each), "{each} {skipped}: {off}");
        }
    }

    #[test]
    fn packets_of_a_second_are_spread_and_lost_ones_kept() {
        // 100 samples each, with the time of the last; the 20th and the 40th to 42nd never came.
        let lost = |packet: i32| packet == 20 || (40..43).contains(&packet);
        let kept = (0..6000).filter(|k| !lost(k / 100));
        let taken: Vec<f64> = kept.clone().map(|k| f64::from(k) * 0.01).collect();
        let log = kept.map(|k| f64::from(k / 100 * 100 + 99) * 0.01);
        let found = dated(log.collect(), None);
        assert_eq!(found.remark.unwrap().0, "packets");
        // Late alike, by half a packet.
        let off = worst(&found.t_s, taken.iter().map(|t| t + 0.495));
        assert!(off < 1e-9, "{off}");
    }
}

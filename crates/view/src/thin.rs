//! Making a curve coarser without losing its extremes: the smallest and the largest value of every interval, at their own times.

use analyze::summary::Times;

use crate::take::Curve;

/// Thins a curve that arrives in pieces, in memory that does not grow with it.
///
/// Time is cut into equal intervals. Of each, the first smallest and the first largest value are kept, in order of time, so that
/// the envelope of what is drawn is that of the data. A value that is not finite breaks the line: one per interval is kept.
pub struct Thin {
    start_ns: i64,
    interval_ns: i64,
    interval: i64,
    low: (i64, f64),
    high: (i64, f64),
    gap_ns: Option<i64>,
    out: Curve,
}

impl Thin {
    /// For at most `points` finite points between `start_ns` and `end_ns`; an interval of 0 keeps everything.
    pub fn new(name: &str, start_ns: i64, end_ns: i64, samples: u64, points: u64) -> Self {
        // The last moment belongs to it.
        let span_ns = end_ns.saturating_sub(start_ns).saturating_add(1).max(1);
        // Two points come of each interval.
        let intervals = i64::try_from((points / 2).max(1)).unwrap_or(i64::MAX);
        let interval_ns = if samples <= points {
            0
        } else {
            // Rounded up: one interval more than these would be two points too many.
            span_ns / intervals + i64::from(span_ns % intervals > 0)
        };
        Thin {
            start_ns,
            interval_ns,
            interval: i64::MIN,
            low: (0, f64::INFINITY),
            high: (0, f64::NEG_INFINITY),
            gap_ns: None,
            out: Curve {
                name: name.to_owned(),
                ..Curve::default()
            },
        }
    }

    /// Length of an interval, ns; 0 where everything is kept.
    pub fn interval_ns(&self) -> i64 {
        self.interval_ns
    }

    /// The next values.
    pub fn push(&mut self, times_ns: &[i64], values: &[f64]) {
        if self.interval_ns == 0 {
            self.out.times_ns.extend_from_slice(times_ns);
            self.out.values.extend_from_slice(values);
            return;
        }
        for (&t, &x) in times_ns.iter().zip(values) {
            let interval = t.saturating_sub(self.start_ns).div_euclid(self.interval_ns);
            if interval != self.interval {
                self.flush();
                self.interval = interval;
            }
            if !x.is_finite() {
                self.gap_ns.get_or_insert(t);
                continue;
            }
            if x < self.low.1 {
                self.low = (t, x);
            }
            if x > self.high.1 {
                self.high = (t, x);
            }
        }
    }

    /// The next values of a column; `rows` are their places among the times, where not every message has one. Nothing is drawn through where
    /// messages were lost ([`Times::gaps`]).
    pub fn push_between_gaps(
        &mut self,
        times_ns: &[i64],
        rows: Option<&[u32]>,
        values: &[f64],
        times: &Times,
    ) {
        let own: Vec<i64>;
        let times_ns = match rows {
            None => times_ns,
            Some(rows) => {
                own = rows.iter().map(|row| times_ns[*row as usize]).collect();
                &own
            }
        };
        let mut from = 0;
        for gap in times.gaps() {
            let before = rows.map_or(gap.before, |rows| {
                rows.partition_point(|row| (*row as usize) < gap.before)
            });
            let Some(next_ns) = times_ns.get(before) else {
                break;
            };
            self.push(&times_ns[from..before], &values[from..before]);
            self.push(&[next_ns.saturating_sub(1)], &[f64::NAN]);
            from = before;
        }
        self.push(&times_ns[from..], &values[from..]);
    }

    fn flush(&mut self) {
        let mut kept: Vec<(i64, f64)> = Vec::with_capacity(3);
        if self.low.1.is_finite() {
            kept.push(self.low);
            if self.high.0 != self.low.0 {
                kept.push(self.high);
            }
        }
        if let Some(t) = self.gap_ns.take() {
            kept.push((t, f64::NAN));
        }
        kept.sort_by_key(|(t, _)| *t);
        for (t, x) in kept {
            self.out.times_ns.push(t);
            self.out.values.push(x);
        }
        self.low = (0, f64::INFINITY);
        self.high = (0, f64::NEG_INFINITY);
    }

    /// What was kept, in order of time: messages may overtake each other.
    pub fn finish(mut self) -> Curve {
        self.flush();
        let mut out = self.out;
        if !out.times_ns.is_sorted() {
            let mut points: Vec<(i64, f64)> = out.times_ns.into_iter().zip(out.values).collect();
            points.sort_by_key(|(t, _)| *t);
            (out.times_ns, out.values) = points.into_iter().unzip();
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn thinned(values: &[f64], points: u64, piece: usize) -> Curve {
        let times: Vec<i64> = (0..values.len() as i64).map(|k| k * 1000).collect();
        let end = times[times.len() - 1] + 1;
        let mut thin = Thin::new("x", 0, end, values.len() as u64, points);
        for (t, x) in times.chunks(piece).zip(values.chunks(piece)) {
            thin.push(t, x);
        }
        thin.finish()
    }

    #[test]
    fn few_samples_are_all_kept() {
        let values: Vec<f64> = (0..100).map(f64::from).collect();
        let curve = thinned(&values, 100, 7);
        assert_eq!(curve.values, values);
        assert_eq!(curve.times_ns[99], 99_000);
    }

    #[test]
    fn every_extreme_survives_at_its_own_time() {
        // A slow wave with one spike of one sample.
        let mut values: Vec<f64> = (0..100_000).map(|k| (k as f64 * 1e-3).sin()).collect();
        values[54_321] = 9.0;
        values[54_400] = -7.0;
        let curve = thinned(&values, 1000, 333);
        assert!(curve.values.len() <= 1000, "{}", curve.values.len());
        let spike = curve.values.iter().position(|x| *x == 9.0).unwrap();
        assert_eq!(curve.times_ns[spike], 54_321_000);
        assert!(curve.values.contains(&-7.0));
        assert!(curve.times_ns.is_sorted());
        // Interval by interval, the envelope is that of the data.
        for k in 0..500usize {
            let data = &values[k * 200..(k + 1) * 200];
            let inside = |t: &i64| (*t / 1000) as usize / 200 == k;
            let kept: Vec<f64> = curve
                .times_ns
                .iter()
                .zip(&curve.values)
                .filter(|(t, _)| inside(t))
                .map(|(_, x)| *x)
                .collect();
            let fold = |x: &[f64], f: fn(f64, f64) -> f64| x.iter().copied().reduce(f);
            assert_eq!(fold(&kept, f64::min), fold(data, f64::min), "interval {k}");
            assert_eq!(fold(&kept, f64::max), fold(data, f64::max), "interval {k}");
        }
    }

    #[test]
    fn pieces_make_no_difference() {
        let values: Vec<f64> = (0..10_000).map(|k| ((k * 7919) % 1013) as f64).collect();
        let whole = thinned(&values, 100, 10_000);
        for piece in [1, 13, 999] {
            assert_eq!(thinned(&values, 100, piece).values, whole.values);
        }
    }

    #[test]
    fn points_are_in_order_of_time_whatever_the_order_of_messages() {
        let mut thin = Thin::new("x", 0, 100, 5, 10);
        thin.push(&[0, 20, 10], &[0.0, 2.0, 1.0]);
        thin.push(&[40, 30], &[4.0, 3.0]);
        let curve = thin.finish();
        assert_eq!(curve.times_ns, [0, 10, 20, 30, 40]);
        assert_eq!(curve.values, [0.0, 1.0, 2.0, 3.0, 4.0]);
    }

    #[test]
    fn a_gap_stays_a_gap() {
        let mut values = vec![1.0; 1000];
        values[500] = f64::NAN;
        let curve = thinned(&values, 20, 64);
        assert_eq!(curve.values.iter().filter(|x| x.is_nan()).count(), 1);
        let all_nan = thinned(&vec![f64::NAN; 1000], 20, 64);
        assert!(all_nan.values.iter().all(|x| x.is_nan()) && all_nan.values.len() == 10);
    }

    #[test]
    fn a_hole_breaks_a_curve_that_not_every_message_has_too() {
        let times_ns: Vec<i64> = (0..100).chain(200..300).map(|k| k * 10_000_000).collect();
        let rows: Vec<u32> = (0..100).map(|k| 2 * k).collect();
        let mut times = Times::default();
        times.push(&times_ns);
        let mut thin = Thin::new("x", 0, 3_000_000_000, 0, 1);
        thin.push_between_gaps(&times_ns, Some(&rows), &[1.0; 100], &times);
        let curve = thin.finish();
        assert_eq!(curve.values.len(), 101);
        assert!(curve.values[50].is_nan() && curve.times_ns.is_sorted());
    }
}

//! Sobol's indices: which axis a metric's variance comes from.
//!
//! ```text
//! S_i = ⟨f_B (f_AB_i − f_A)⟩ / V          alone            (Saltelli et al. 2010, table 2 (b))
//! T_i = ⟨(f_A − f_AB_i)²⟩ / (2 V)          with all others  (Jansen 1999)
//! ```
//! f the metric's mean over the seeds of a point; A and B two halves of Sobol's points, AB_i is A with axis i of B; V the variance
//! over A and B together, ⟨⟩ the mean over base points. f is taken about its mean, which does not change S_i and
//! steadies its estimate (of angles about their circular mean). S_i ≤ T_i but for chance; T_i − S_i is what the axis does only together with others. A base point of which
//! any run has no such metric is left out. Intervals: 95 %, from 500 bootstrap samples of the base points.

use super::Plan;
use super::summary::{Found, quantile};
use crate::statistics::about_their_mean;
use analyze::metrics::turn_of;
use serde_json::{Value, json};
use sim::random::{Stream, uniform_pair};

/// An index with its interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The index.
    pub value: f64,
    /// Ends of its 95 % interval.
    pub interval: [f64; 2],
}

/// What one axis does to one metric.
#[derive(Clone, Debug, PartialEq)]
pub struct Index {
    /// Name of the metric.
    pub metric: String,
    /// Name of the axis.
    pub axis: String,
    /// S_i.
    pub first: Estimate,
    /// T_i.
    pub total: Estimate,
    /// Base points that all have the metric.
    pub points: usize,
}

/// Bootstrap samples behind an interval.
const DRAWS: u64 = 500;

/// The indices of every metric over every axis; `None` where the study is none of sensitivity.
pub fn indices(plan: &Plan, found: &Found) -> Option<Vec<Index>> {
    if !plan.is_sensitivity() {
        return None;
    }
    let axes = plan.spec.axes.len();
    let mut out = Vec::new();
    for (k, metric) in found.metrics.iter().enumerate() {
        let mut rows: Vec<Vec<f64>> = found
            .means
            .chunks(axes + 2)
            .filter_map(|rows| rows.iter().map(|means| means[k]).collect())
            .collect();
        if let Some(turn) = turn_of(metric) {
            let (_, about) = about_their_mean(&rows.concat(), turn);
            rows = about.chunks(axes + 2).map(<[f64]>::to_vec).collect();
        }
        for (axis, of) in plan.spec.axes.iter().enumerate() {
            if let Some((first, total)) = estimate(&rows, axis) {
                out.push(Index {
                    metric: metric.clone(),
                    axis: of.name.clone(),
                    first,
                    total,
                    points: rows.len(),
                });
            }
        }
    }
    Some(out)
}

/// S and T of axis `axis` from rows f_A, f_AB_1 …, f_B; `None` below two rows or without variance.
pub fn estimate(rows: &[Vec<f64>], axis: usize) -> Option<(Estimate, Estimate)> {
    let n = rows.len();
    if n < 2 {
        return None;
    }
    let of = |pick: &dyn Fn(usize) -> usize| -> Option<(f64, f64)> {
        let last = rows[0].len() - 1;
        let (mut sum, mut squares) = (0.0, 0.0);
        for k in 0..n {
            let row = &rows[pick(k)];
            sum += row[0] + row[last];
        }
        let mean = sum / (2 * n) as f64;
        let (mut first, mut total) = (0.0, 0.0);
        for k in 0..n {
            let row = &rows[pick(k)];
            let (a, b, ab) = (row[0] - mean, row[last] - mean, row[axis + 1] - mean);
            squares += a * a + b * b;
            first += b * (ab - a);
            total += (a - ab) * (a - ab);
        }
        let variance = squares / (2 * n) as f64;
        let rounding = 1e-24 * mean * mean;
        (variance > rounding).then(|| {
            (
                first / n as f64 / variance,
                total / (2 * n) as f64 / variance,
            )
        })
    };
    let (first, total) = of(&|k| k)?;
    let (mut firsts, mut totals) = (Vec::new(), Vec::new());
    for draw in 0..DRAWS {
        let pick = |k: usize| {
            let [u, _] = uniform_pair(draw, Stream::Design, u32::MAX, k as u64);
            ((1.0 - u) * n as f64) as usize
        };
        if let Some((s, t)) = of(&pick) {
            firsts.push(s);
            totals.push(t);
        }
    }
    let [first, total] = [(first, firsts), (total, totals)].map(|(value, mut draws)| {
        draws.sort_by(f64::total_cmp);
        Estimate {
            value,
            interval: [0.025, 0.975].map(|q| quantile(&draws, q)),
        }
    });
    Some((first, total))
}

/// For people.
pub fn table(indices: &[Index]) -> String {
    if indices.is_empty() {
        return "\nno sensitivity: fewer than two base points with a result, or metrics that never change\n".into();
    }
    let mut out = format!(
        "\n{:<20}{:<40}{:>24}{:>24}{:>8}\n",
        "sensitivity of", "to", "alone (95 %)", "with others (95 %)", "points"
    );
    let cell = |e: &Estimate| {
        let [low, high] = e.interval;
        format!("{:.2} ({low:.2} … {high:.2})", e.value)
    };
    for i in indices {
        let (first, total) = (cell(&i.first), cell(&i.total));
        out += &format!(
            "{:<20}{:<40}{first:>24}{total:>24}{:>8}\n",
            i.metric, i.axis, i.points
        );
    }
    out
}

/// For programs.
pub fn to_json(indices: &[Index]) -> Value {
    let estimate = |e: &Estimate| json!({"value": e.value, "ci95": e.interval});
    indices
        .iter()
        .map(|i| {
            json!({
                "metric": i.metric, "axis": i.axis, "first": estimate(&i.first),
                "total": estimate(&i.total), "points": i.points,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::sobol::Sobol;
    use super::*;
    use std::f64::consts::PI;

    /// Ishigami's function, whose indices are known: S = 0.3139, 0.4424, 0; T = 0.5576, 0.4424, 0.2437 (Saltelli et al. 2008, p. 196).
    #[test]
    fn val_ishigami() {
        let sobol = Sobol::new(6);
        let f = |x: [f64; 3]| {
            let [x, y, z] = x.map(|u| PI * (2.0 * u - 1.0));
            x.sin() + 7.0 * y.sin().powi(2) + 0.1 * z.powi(4) * x.sin()
        };
        let rows: Vec<Vec<f64>> = (4096..8192)
            .map(|n| {
                let at = |from_b: &dyn Fn(usize) -> bool| {
                    f([0, 1, 2].map(|d| sobol.at(n, if from_b(d) { d + 3 } else { d })))
                };
                let mut row = vec![at(&|_| false)];
                row.extend((0..3).map(|i| at(&|d| d == i)));
                row.push(at(&|_| true));
                row
            })
            .collect();
        let known = [(0.3139, 0.5576), (0.4424, 0.4424), (0.0, 0.2437)];
        for (axis, (first, total)) in known.into_iter().enumerate() {
            let (s, t) = estimate(&rows, axis).unwrap();
            assert!(
                (s.value - first).abs() < 0.01,
                "S{axis}: {s:?}, known {first}"
            );
            assert!(
                (t.value - total).abs() < 0.01,
                "T{axis}: {t:?}, known {total}"
            );
            assert!(s.interval[0] < first && first < s.interval[1], "{s:?}");
        }
        assert_eq!(estimate(&vec![vec![1.0; 5]; 10], 0), None);
    }
}

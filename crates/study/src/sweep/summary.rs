//! What a table of runs says, point by point and altogether, in one pass over its rows.

use super::Plan;
use super::table::{Cell, Kind};
use std::fmt::Write;

/// Mean, spread and quantiles of one metric over some runs that have it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// How many runs have it.
    pub runs: usize,
    /// Arithmetic mean.
    pub mean: f64,
    /// Sample standard deviation; 0 for one run.
    pub sd: f64,
    /// Quantiles 5 %, 50 % and 95 %, straight between order statistics (NumPy's default).
    pub quantiles: [f64; 3],
}

impl Spread {
    /// Of finite values, in any order; `None` without any.
    pub fn of(values: &[f64]) -> Option<Self> {
        let s = crate::statistics::summarise(values.iter().copied())?;
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        Some(Self {
            runs: s.runs,
            mean: s.mean,
            sd: s.sd,
            quantiles: [0.05, 0.5, 0.95].map(|q| quantile(&sorted, q)),
        })
    }
}

/// Quantile `q` of sorted values.
pub fn quantile(sorted: &[f64], q: f64) -> f64 {
    let place = q * (sorted.len() - 1) as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (place - place.floor()) * (sorted[above] - sorted[below])
}

/// One point of the design.
#[derive(Clone, Debug)]
pub struct Point {
    /// The axes' values.
    pub axes: Vec<Cell>,
    /// Runs without a result.
    pub failed: u64,
    /// One for each metric that is a number or a yes or no.
    pub metrics: Vec<Option<Spread>>,
}

/// The summary of a study.
pub struct Summary {
    axes: Vec<String>,
    /// Names of the metrics that can be summarised.
    pub metrics: Vec<String>,
    places: Vec<usize>,
    seeds: u64,
    values: Vec<Vec<f64>>,
    rows: u64,
    failed: u64,
    /// Every point, in order.
    pub points: Vec<Point>,
    /// Rows so far.
    pub runs: u64,
    /// Of these, without a result.
    pub failures: u64,
    /// Reasons and how often each was given.
    pub reasons: Vec<(String, u64)>,
}

impl Summary {
    /// Of no rows yet.
    pub fn new(plan: &Plan) -> Self {
        let axes = plan.spec.axes.len();
        let first = 3 + axes;
        let places: Vec<usize> = (first..first + plan.spec.metrics.len())
            .filter(|k| matches!(plan.columns()[*k].kind, Kind::Real | Kind::Truth))
            .collect();
        Self {
            axes: plan.spec.axes.iter().map(|a| a.name.clone()).collect(),
            metrics: places
                .iter()
                .map(|k| plan.columns()[*k].name.clone())
                .collect(),
            values: vec![Vec::new(); places.len()],
            places,
            seeds: plan.spec.seeds,
            rows: 0,
            failed: 0,
            points: Vec::new(),
            runs: 0,
            failures: 0,
            reasons: Vec::new(),
        }
    }

    /// Takes the next row.
    pub fn row(&mut self, row: &[Cell]) {
        self.runs += 1;
        self.rows += 1;
        if let Cell::Text(reason) = &row[row.len() - 2] {
            self.failures += 1;
            self.failed += 1;
            match self.reasons.iter().position(|(r, _)| r == reason) {
                Some(k) => self.reasons[k].1 += 1,
                // Enough to see what is wrong; a reason that names a time differs in every run.
                None if self.reasons.len() < 20 => self.reasons.push((reason.clone(), 1)),
                None => {}
            }
        }
        for (values, place) in self.values.iter_mut().zip(&self.places) {
            values.extend(row[*place].number());
        }
        if self.rows == self.seeds {
            self.points.push(Point {
                axes: row[2..2 + self.axes.len()].to_vec(),
                failed: self.failed,
                metrics: self.values.iter().map(|v| Spread::of(v)).collect(),
            });
            self.values.iter_mut().for_each(Vec::clear);
            (self.rows, self.failed) = (0, 0);
        }
    }

    /// A row per point: its axes, runs, failures, then mean, SD, quantiles 5, 50 and 95 % and number of every metric.
    pub fn csv(&self) -> String {
        let mut out = String::from("point");
        for axis in &self.axes {
            out += &format!(",{}", quoted(axis));
        }
        out += ",runs,failed";
        for name in &self.metrics {
            for part in ["mean", "sd", "q05", "q50", "q95", "n"] {
                out += &format!(",{name}_{part}");
            }
        }
        out.push('\n');
        for (k, point) in self.points.iter().enumerate() {
            let _ = write!(out, "{k}");
            for cell in &point.axes {
                let text = match cell {
                    Cell::Empty => String::new(),
                    Cell::Real(x) => x.to_string(),
                    Cell::Whole(x) => x.to_string(),
                    Cell::Truth(x) => x.to_string(),
                    Cell::Text(x) => quoted(x),
                };
                let _ = write!(out, ",{text}");
            }
            let _ = write!(out, ",{},{}", self.seeds, point.failed);
            for metric in &point.metrics {
                let _ = match metric {
                    Some(s) => {
                        let [low, middle, high] = s.quantiles;
                        write!(out, ",{},{},{low},{middle},{high},{}", s.mean, s.sd, s.runs)
                    }
                    None => write!(out, ",,,,,,0"),
                };
            }
            out.push('\n');
        }
        out
    }

    /// For people: over all points, what each metric's mean at a point ranges over, and where it is lowest and highest.
    pub fn table(&self) -> String {
        let mut out = format!(
            "{} points, {} runs, {} without a result\n",
            self.points.len(),
            self.runs,
            self.failures
        );
        let _ = writeln!(
            out,
            "\n{:<20}{:>11}{:>11}{:>11}{:>11}  lowest at, highest at",
            "mean at a point", "lowest", "median", "highest", "SD (median)"
        );
        for (k, name) in self.metrics.iter().enumerate() {
            let mut found: Vec<(f64, f64, usize)> = self
                .points
                .iter()
                .enumerate()
                .filter_map(|(p, point)| point.metrics[k].map(|s| (s.mean, s.sd, p)))
                .collect();
            if found.is_empty() {
                let _ = writeln!(out, "{name:<20}{:>11}", "–");
                continue;
            }
            found.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut spreads: Vec<f64> = found.iter().map(|f| f.1).collect();
            spreads.sort_by(f64::total_cmp);
            let (low, high) = (found[0], found[found.len() - 1]);
            let means: Vec<f64> = found.iter().map(|f| f.0).collect();
            let _ = write!(
                out,
                "{name:<20}{:>11}{:>11}{:>11}{:>11}",
                short(low.0),
                short(quantile(&means, 0.5)),
                short(high.0),
                short(quantile(&spreads, 0.5))
            );
            let _ = match high.0 > low.0 {
                true => writeln!(out, "  {}, {}", self.place(low.2), self.place(high.2)),
                false => writeln!(out),
            };
        }
        for (reason, count) in &self.reasons {
            let _ = writeln!(out, "failed {count} times: {reason}");
        }
        out
    }

    fn place(&self, point: usize) -> String {
        let cells: Vec<String> = self.points[point]
            .axes
            .iter()
            .map(|c| match c {
                Cell::Text(x) => x.clone(),
                other => other.number().map_or("–".into(), short),
            })
            .collect();
        format!("({})", cells.join(", "))
    }
}

/// Four significant digits.
fn short(x: f64) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let digits = 3 - x.abs().log10().floor() as i32;
    match digits {
        -3..=7 => format!("{x:.*}", digits.max(0) as usize),
        _ => format!("{x:.3e}"),
    }
}

fn quoted(text: &str) -> String {
    match text.contains([',', '"', '\n']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_numpys() {
        // numpy.quantile([1, 2, 4, 8, 16], [0.05, 0.5, 0.95]) = [1.2, 4.0, 14.4]
        let s = Spread::of(&[8.0, 1.0, 16.0, 2.0, 4.0]).unwrap();
        for (found, expected) in s.quantiles.iter().zip([1.2, 4.0, 14.4]) {
            assert!((found - expected).abs() < 1e-14);
        }
        assert_eq!(Spread::of(&[]), None);
        assert_eq!(Spread::of(&[3.0]).unwrap().quantiles, [3.0; 3]);
        assert_eq!(short(0.000123456), "0.0001235");
        assert_eq!(short(-12.3456), "-12.35");
        assert_eq!(short(1e-12), "1.000e-12");
    }
}

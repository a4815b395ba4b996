//! What a table of runs says, point by point and altogether, in one pass over its rows.

use super::Plan;
use super::table::{Cell, Kind};
use crate::statistics::{about_their_mean, nearest, summarise};
use analyze::metrics::turn_of;
use std::io::Write;

/// Mean, spread and quantiles of one metric over some runs that have it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// How many runs have it.
    pub runs: usize,
    /// Arithmetic mean; of angles, their circular mean.
    pub mean: f64,
    /// Sample standard deviation; `None` for one run.
    pub sd: Option<f64>,
    /// Half the 95 % interval of the mean by Student's t; `None` for one run.
    pub ci95: Option<f64>,
    /// Quantiles 5 %, 50 % and 95 %, straight between order statistics (NumPy's default).
    pub quantiles: [f64; 3],
}

impl Spread {
    /// Of finite values, in any order; `None` without any.
    pub fn of(values: &[f64]) -> Option<Self> {
        let s = summarise(values.iter().copied())?;
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        Some(Self {
            runs: s.runs,
            mean: s.mean,
            sd: s.sd,
            ci95: s.ci95,
            quantiles: [0.05, 0.5, 0.95].map(|q| quantile(&sorted, q)),
        })
    }

    /// The same of values that are the same after a `turn`, where one is given: all about their circular mean, and that within half a turn of 0.
    pub fn of_turning(values: &[f64], turn: Option<f64>) -> Option<Self> {
        let Some(turn) = turn else {
            return Self::of(values);
        };
        let (mean, about) = about_their_mean(values, turn);
        let found = Self {
            mean,
            ..Self::of(&about)?
        };
        Some(found.near(0.0, turn))
    }

    /// The same, some turns on, so that the mean is the nearest to `to`.
    pub fn near(self, to: f64, turn: f64) -> Self {
        let mean = nearest(self.mean, to, turn);
        let on = mean - self.mean;
        Self {
            mean,
            quantiles: self.quantiles.map(|q| q + on),
            ..self
        }
    }

    /// Whether at least half of `runs` have it: the mean of fewer is that of a choice.
    pub fn counts(&self, runs: u64) -> bool {
        2 * self.runs as u64 >= runs
    }
}

/// Quantile `q` of sorted values.
pub fn quantile(sorted: &[f64], q: f64) -> f64 {
    let place = q * (sorted.len() - 1) as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (place - place.floor()) * (sorted[above] - sorted[below])
}

/// What the means of one metric range over, at the points where at least half of the runs have it.
#[derive(Clone, Debug, Default)]
pub struct Range {
    /// Runs that have it, at any point.
    pub runs: u64,
    /// The points that count.
    pub points: u64,
    sum: f64,
    /// Lowest mean and the values of the axes there.
    pub lowest: Option<(f64, Vec<Cell>)>,
    /// Highest mean and the values of the axes there.
    pub highest: Option<(f64, Vec<Cell>)>,
}

impl Range {
    fn take(&mut self, spread: &Spread, seeds: u64, turn: Option<f64>, axes: &[Cell]) {
        self.runs += spread.runs as u64;
        if !spread.counts(seeds) {
            return;
        }
        // Angles on the side of those before them.
        let mean = match (turn, self.points) {
            (Some(turn), 1..) => nearest(spread.mean, self.sum / self.points as f64, turn),
            _ => spread.mean,
        };
        self.points += 1;
        self.sum += mean;
        if self.lowest.as_ref().is_none_or(|(low, _)| mean < *low) {
            self.lowest = Some((mean, axes.to_vec()));
        }
        if self.highest.as_ref().is_none_or(|(high, _)| mean > *high) {
            self.highest = Some((mean, axes.to_vec()));
        }
    }
}

/// What stands in the table of points of each metric, behind its name and a dot, which no name of a metric has.
const PARTS: [&str; 7] = ["mean", "sd", "ci95", "q05", "q50", "q95", "n"];
/// What is counted of the runs of each point.
const COUNTS: [&str; 3] = ["runs", "failed", "remarked"];

/// Whether the table of points has a column of that name, whatever the axes are.
pub(super) fn has_column(name: &str, metrics: &[String]) -> bool {
    let of_metric = |(metric, part): (&str, &str)| {
        PARTS.contains(&part) && metrics.iter().any(|known| known == metric)
    };
    COUNTS.contains(&name) || name.rsplit_once('.').is_some_and(of_metric)
}

/// The summary of a study. Only the rows of one point are held at a time; a study of sensitivity keeps the means.
pub struct Summary<W: Write> {
    csv: W,
    axes: usize,
    places: Vec<usize>,
    turns: Vec<Option<f64>>,
    seeds: u64,
    values: Vec<Vec<f64>>,
    rows: u64,
    failed: u64,
    remarked: u64,
    keeps_means: bool,
    found: Found,
}

/// What a summary came to.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// Names of the metrics that can be summarised.
    pub metrics: Vec<String>,
    /// One for each of them.
    pub ranges: Vec<Range>,
    /// Means of every point whose runs all have the metric, for a study of sensitivity.
    pub means: Vec<Vec<Option<f64>>>,
    /// Points.
    pub points: u64,
    /// Runs.
    pub runs: u64,
    /// Of these, without a result.
    pub failures: u64,
    /// Reasons and how often each was given, of the first that differ by more than their numbers.
    pub reasons: Vec<(String, u64)>,
    /// Runs with a result that did what nobody carries so.
    pub remarked: u64,
    /// What they did, in the same way.
    pub remarks: Vec<(String, u64)>,
}

/// Counts a sentence with those that differ from it in numbers alone, as times and values do. Enough are kept to see what is wrong.
fn count(of: &mut Vec<(String, u64)>, text: &str) {
    let words = |text: &str| -> String { text.chars().filter(|c| !c.is_ascii_digit()).collect() };
    match of.iter().position(|(known, _)| words(known) == words(text)) {
        Some(k) => of[k].1 += 1,
        None if of.len() < 20 => of.push((text.to_owned(), 1)),
        None => {}
    }
}

impl<W: Write> Summary<W> {
    /// Of no rows yet. Into `csv` goes a row per point: its axes, runs, failures, runs with remarks, then mean, SD, half the 95 % interval of
    /// the mean, quantiles 5, 50 and 95 % and number of every metric.
    ///
    /// # Errors
    /// What the system says.
    pub fn new(plan: &Plan, mut csv: W) -> std::io::Result<Self> {
        let axes = plan.spec.axes.len();
        let first = 3 + axes;
        let places: Vec<usize> = (first..first + plan.spec.metrics.len())
            .filter(|k| matches!(plan.columns()[*k].kind, Kind::Real | Kind::Truth))
            .collect();
        let metrics: Vec<String> = places
            .iter()
            .map(|k| plan.columns()[*k].name.clone())
            .collect();
        write!(csv, "point")?;
        for axis in &plan.spec.axes {
            write!(csv, ",{}", quoted(&axis.name))?;
        }
        write!(csv, ",{}", COUNTS.join(","))?;
        for name in &metrics {
            for part in PARTS {
                write!(csv, ",{name}.{part}")?;
            }
        }
        writeln!(csv)?;
        Ok(Self {
            csv,
            axes,
            values: vec![Vec::new(); places.len()],
            turns: metrics.iter().map(|name| turn_of(name)).collect(),
            places,
            seeds: plan.spec.seeds,
            rows: 0,
            failed: 0,
            remarked: 0,
            keeps_means: plan.is_sensitivity(),
            found: Found {
                ranges: vec![Range::default(); metrics.len()],
                metrics,
                ..Found::default()
            },
        })
    }

    /// Takes the next row.
    ///
    /// # Errors
    /// What the system says.
    pub fn row(&mut self, row: &[Cell]) -> std::io::Result<()> {
        self.rows += 1;
        let found = &mut self.found;
        found.runs += 1;
        if let Cell::Text(reason) = &row[row.len() - 2] {
            found.failures += 1;
            self.failed += 1;
            count(&mut found.reasons, reason);
        } else if let Cell::Text(remarks) = &row[row.len() - 3] {
            found.remarked += 1;
            self.remarked += 1;
            remarks
                .split(super::BETWEEN_REMARKS)
                .for_each(|one| count(&mut found.remarks, one));
        }
        for (values, place) in self.values.iter_mut().zip(&self.places) {
            values.extend(row[*place].number());
        }
        if self.rows == self.seeds {
            self.point(&row[2..2 + self.axes])?;
        }
        Ok(())
    }

    fn point(&mut self, axes: &[Cell]) -> std::io::Result<()> {
        let out = &mut self.csv;
        write!(out, "{}", self.found.points)?;
        for cell in axes {
            match cell {
                Cell::Empty => write!(out, ",")?,
                Cell::Real(x) => write!(out, ",{x}")?,
                Cell::Whole(x) => write!(out, ",{x}")?,
                Cell::Truth(x) => write!(out, ",{x}")?,
                Cell::Text(x) => write!(out, ",{}", quoted(x))?,
            }
        }
        write!(out, ",{},{},{}", self.seeds, self.failed, self.remarked)?;
        let mut means = Vec::new();
        let ranges = self.found.ranges.iter_mut().zip(&self.turns);
        for (values, (range, turn)) in self.values.iter_mut().zip(ranges) {
            let spread = Spread::of_turning(values, *turn);
            match &spread {
                Some(s) => {
                    let [low, middle, high] = s.quantiles;
                    let [sd, ci95] =
                        [s.sd, s.ci95].map(|x| x.map_or_else(String::new, |x| x.to_string()));
                    write!(
                        out,
                        ",{},{sd},{ci95},{low},{middle},{high},{}",
                        s.mean, s.runs
                    )?;
                    range.take(s, self.seeds, *turn, axes);
                }
                None => write!(out, ",,,,,,,0")?,
            }
            if self.keeps_means {
                // A mean over some of a point's runs is another quantity than one over all.
                let all = spread.filter(|s| s.runs as u64 == self.seeds);
                means.push(all.map(|s| s.mean));
            }
            values.clear();
        }
        writeln!(out)?;
        if self.keeps_means {
            self.found.means.push(means);
        }
        self.found.points += 1;
        (self.rows, self.failed, self.remarked) = (0, 0, 0);
        Ok(())
    }

    /// What all rows came to.
    ///
    /// # Errors
    /// What the system says.
    pub fn finish(mut self) -> std::io::Result<Found> {
        self.csv.flush()?;
        Ok(self.found)
    }
}

impl Found {
    /// Failed runs whose reason is none of [`Self::reasons`].
    pub fn other_reasons(&self) -> u64 {
        self.failures - self.reasons.iter().map(|(_, n)| n).sum::<u64>()
    }

    /// For people: over all points, what each metric's mean at a point ranges over, and where it is lowest and highest.
    pub fn table(&self) -> String {
        let mut out = format!(
            "{} points, {} runs, {} without a result\n\n{:<20}{:>11}{:>11}{:>11}  lowest at, highest at\n",
            self.points, self.runs, self.failures, "mean at a point", "lowest", "mean", "highest"
        );
        for (name, range) in self.metrics.iter().zip(&self.ranges) {
            // Who has it is said where not everybody does.
            let had = match range.runs {
                n if n == self.runs => String::new(),
                n => format!("  in {n} of {} runs", self.runs),
            };
            let (Some(low), Some(high)) = (&range.lowest, &range.highest) else {
                let few = if range.runs > 0 {
                    ", at no point in half of them"
                } else {
                    ""
                };
                out += &format!("{name:<20}{:>11}{had}{few}\n", "–");
                continue;
            };
            out += &format!(
                "{name:<20}{:>11}{:>11}{:>11}",
                short(low.0),
                short(range.sum / range.points as f64),
                short(high.0)
            );
            if high.0 > low.0 && !low.1.is_empty() {
                out += &format!("  {}, {}", place(&low.1), place(&high.1));
            }
            out += &had;
            out.push('\n');
        }
        for (reason, count) in &self.reasons {
            let times = recording::text::counted(*count, "time", "times");
            out += &format!("failed {times}: {reason}\n");
        }
        let others = self.other_reasons();
        if others > 0 {
            let times = recording::text::counted(others, "time", "times");
            out += &format!("failed {times} for other reasons: `failed` in the table of runs\n");
        }
        for (remark, count) in &self.remarks {
            let runs = recording::text::counted(*count, "run", "runs");
            out += &format!(
                "nobody carries so, in {runs} (`remarks` in the table of runs): {remark}\n"
            );
        }
        out
    }
}

fn place(axes: &[Cell]) -> String {
    let cells: Vec<String> = axes
        .iter()
        .map(|c| match c {
            Cell::Text(x) => x.clone(),
            Cell::Truth(x) => x.to_string(),
            other => other.number().map_or("–".into(), short),
        })
        .collect();
    format!("({})", cells.join(", "))
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
        // Angles beside the seam: scipy.stats.circmean([178, -179, -178], 180, -180) = -179.66653; of [0, 10, 170]: 19.151928
        let turning = Spread::of_turning(&[178.0, -179.0, -178.0], Some(360.0)).unwrap();
        assert!(
            (turning.mean + 179.66653499840578).abs() < 1e-9,
            "{turning:?}"
        );
        let wide = Spread::of_turning(&[0.0, 10.0, 170.0], Some(360.0)).unwrap();
        assert!((wide.mean - 19.151927888120827).abs() < 1e-9, "{wide:?}");
        assert!((turning.sd.unwrap() - 2.081_665_999).abs() < 1e-6);
        assert_eq!(turning.quantiles[1], -179.0);
        assert_eq!(Spread::of(&[]), None);
        assert_eq!(Spread::of(&[3.0]).unwrap().quantiles, [3.0; 3]);
        assert_eq!(short(0.000123456), "0.0001235");
        assert_eq!(short(-12.3456), "-12.35");
        assert_eq!(short(1e-12), "1.000e-12");
    }

    /// Means of 3, 1 and 2 at three points, at a fourth too few runs have it.
    #[test]
    fn a_range_is_told_with_the_places_of_its_ends() {
        let mut found = Found {
            metrics: vec!["a".into(), "turning".into(), "few".into()],
            ranges: vec![Range::default(); 3],
            points: 4,
            runs: 16,
            failures: 3,
            reasons: vec![("too steep".into(), 1)],
            ..Found::default()
        };
        let place = |x: f64| {
            [
                Cell::Real(x),
                Cell::Text("bristle".into()),
                Cell::Truth(x < 15.0),
            ]
        };
        let spread = |values: &[f64], turn| Spread::of_turning(values, turn).unwrap();
        for (at, values) in [
            (10.0, &[2.0, 3.0, 4.0][..]),
            (20.0, &[1.0, 1.0]),
            (30.0, &[2.0, 2.0, 2.0, 2.0]),
            (40.0, &[99.0]),
        ] {
            found.ranges[0].take(&spread(values, None), 4, None, &place(at));
        }
        for (at, x) in [(10.0, 170.0), (20.0, -176.0), (30.0, 174.0)] {
            let turn = Some(360.0);
            found.ranges[1].take(&spread(&[x; 4], turn), 4, turn, &place(at));
        }
        found.ranges[2].take(&spread(&[1.0], None), 4, None, &place(10.0));
        let text = found.table();
        let cells = |name: &str| -> Vec<&str> {
            let line = text.lines().find(|l| l.starts_with(name)).unwrap();
            line.split_whitespace().collect()
        };
        assert!(
            text.starts_with("4 points, 16 runs, 3 without a result"),
            "{text}"
        );
        let ends =
            "1.000 2.000 3.000 (20.00, bristle, false), (10.00, bristle, true) in 10 of 16 runs";
        assert_eq!(cells("a ")[1..].join(" "), ends);
        // −176° is 184°.
        let ends =
            "170.0 176.0 184.0 (10.00, bristle, true), (20.00, bristle, false) in 12 of 16 runs";
        assert_eq!(cells("turning")[1..].join(" "), ends);
        assert_eq!(
            cells("few")[1..].join(" "),
            "– in 1 of 16 runs, at no point in half of them"
        );
        let reasons = "failed 1 time: too steep\nfailed 2 times for other reasons: `failed` in the table of runs\n";
        assert!(text.ends_with(reasons), "{text}");
        let near = spread(&[-3.0, -2.0, -1.0], None).near(359.0, 360.0);
        assert_eq!((near.mean, near.quantiles[1]), (358.0, 358.0));
    }
}

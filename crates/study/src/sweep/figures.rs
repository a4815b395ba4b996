//! Figures of a sweep: bands over one axis, maps over two, distributions over any.

use super::Plan;
use super::parts::Store;
use super::spec::{Spacing, number};
use super::summary::Spread;
use super::table::{Cell, Kind, Reader};
use crate::draw::{Figure, Layer};
use crate::statistics::{about_their_mean, nearest};
use analyze::metrics::turn_of;
use std::path::Path;

/// What is drawn of a metric.
enum Kinds {
    /// Mean and the band of 90 % over one axis of numbers.
    Band,
    /// Mean over two evenly spaced axes.
    Map,
    /// Share of runs up to each value.
    Distribution,
}

/// Draws every metric of a merged study into `folder`, as METRIC.png; gives how many.
///
/// # Errors
/// What the system or a library says.
pub fn draw(plan: &Plan, store: &Store, folder: &Path) -> Result<usize, String> {
    let io = |e: std::io::Error| format!("{}: cannot be made: {e}", folder.display());
    std::fs::create_dir_all(folder).map_err(io)?;
    let axes = &plan.spec.axes;
    let kind = match &axes[..] {
        [x] if !x.is_sampled() && x.len() > 1 && number(&x.value(0)).is_some() => Kinds::Band,
        [x, y]
            if [x, y]
                .iter()
                .all(|a| a.count.is_some_and(|n| n > 1) && a.spacing == Spacing::Linear) =>
        {
            Kinds::Map
        }
        _ => Kinds::Distribution,
    };
    let table = store.table();
    let say = |e: parquet::errors::ParquetError| format!("{}: {e}", table.display());
    let reader = Reader::open(&table).map_err(say)?;
    let first = 3 + axes.len();
    let mut drawn = 0;
    for (k, name) in plan.spec.metrics.iter().enumerate() {
        let place = first + k;
        if !matches!(reader.columns[place].kind, Kind::Real | Kind::Truth) {
            continue;
        }
        // One metric at a time: values of every run, by point.
        let mut points: Vec<(Vec<Cell>, Vec<f64>)> = Vec::new();
        let mut runs = 0;
        for group in 0..reader.groups() {
            for row in reader.group(group).map_err(say)? {
                if runs % plan.spec.seeds == 0 {
                    points.push((row[2..2 + axes.len()].to_vec(), Vec::new()));
                }
                runs += 1;
                if let Some((_, values)) = points.last_mut() {
                    values.extend(row[place].number());
                }
            }
        }
        let unit = match reader.columns[place].unit.as_str() {
            "" | "1" => String::new(),
            unit => format!(", {unit}"),
        };
        let label = format!("{name}{unit}");
        let turn = turn_of(name);
        let figure = match kind {
            Kinds::Band => band(plan, &label, &points, turn),
            Kinds::Map => map(plan, &label, &points, turn),
            Kinds::Distribution => {
                let all = points.iter().flat_map(|(_, v)| v.iter().copied()).collect();
                distribution(&label, all, runs, turn)
            }
        };
        if let Some(figure) = figure {
            figure.write(folder, name)?;
            drawn += 1;
        }
    }
    Ok(drawn)
}

/// What a figure leaves out, behind its title.
const HALF: &str = "; where at least half of the runs have it";

/// What the runs of a point say together, where at least half of them have the metric.
fn counted(plan: &Plan, values: &[f64], turn: Option<f64>) -> Option<Spread> {
    Spread::of_turning(values, turn).filter(|s| s.counts(plan.spec.seeds))
}

fn band(
    plan: &Plan,
    label: &str,
    points: &[(Vec<Cell>, Vec<f64>)],
    turn: Option<f64>,
) -> Option<Figure> {
    let axis = &plan.spec.axes[0];
    let mut found: Vec<(f64, Spread)> = points
        .iter()
        .filter_map(|(axes, values)| Some((axes[0].number()?, counted(plan, values, turn)?)))
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let Some(turn) = turn {
        for k in 1..found.len() {
            found[k].1 = found[k].1.near(found[k - 1].1.mean, turn);
        }
    }
    let left_out = if found.len() < points.len() { HALF } else { "" };
    (found.len() > 1).then(|| Figure {
        title: format!("{label}{left_out}"),
        x_label: axis.name.clone(),
        x_log: axis.spacing == Spacing::Log,
        y_label: label.into(),
        layers: vec![
            Layer::Band {
                points: found
                    .iter()
                    .map(|(x, s)| (*x, s.quantiles[0], s.quantiles[2]))
                    .collect(),
                colour: 0,
            },
            Layer::line("mean", found.iter().map(|(x, s)| (*x, s.mean)).collect(), 0),
            Layer::dashed(
                "median",
                found.iter().map(|(x, s)| (*x, s.quantiles[1])).collect(),
                1,
            ),
        ],
        ..Figure::default()
    })
}

fn map(
    plan: &Plan,
    label: &str,
    points: &[(Vec<Cell>, Vec<f64>)],
    turn: Option<f64>,
) -> Option<Figure> {
    let [y, x] = &plan.spec.axes[..] else {
        return None;
    };
    let mut means: Vec<f64> = points
        .iter()
        .map(|(_, values)| counted(plan, values, turn).map_or(f64::NAN, |s| s.mean))
        .collect();
    let first = means.iter().copied().find(|m| m.is_finite());
    if let (Some(turn), Some(first)) = (turn, first) {
        means.iter_mut().for_each(|m| *m = nearest(*m, first, turn));
    }
    let left_out = if means.iter().any(|m| m.is_nan()) {
        HALF
    } else {
        ""
    };
    if means.iter().all(|m| m.is_nan()) {
        return None;
    }
    // Cells lie about their points: half a step beyond the ends.
    let ends = |axis: &super::spec::Axis| {
        let (a, b) = (axis.at(0.0), axis.at(1.0));
        let half = 0.5 * (b - a) / (axis.len() - 1) as f64;
        (f64::min(a - half, b + half), f64::max(a - half, b + half))
    };
    let falls = |axis: &super::spec::Axis| axis.at(1.0) < axis.at(0.0);
    let mut values: Vec<Vec<f64>> = means
        .chunks(x.len() as usize)
        .map(<[f64]>::to_vec)
        .collect();
    if falls(y) {
        values.reverse();
    }
    if falls(x) {
        values.iter_mut().for_each(|row| row.reverse());
    }
    Some(Figure {
        title: format!("{label}{left_out}"),
        x_label: x.name.clone(),
        y_label: y.name.clone(),
        layers: vec![Layer::Map {
            label: label.into(),
            values,
            x: ends(x),
            y: ends(y),
        }],
        x_range: Some(ends(x)),
        y_range: Some(ends(y)),
        ..Figure::default()
    })
}

/// Share of all `runs` up to each value: it ends below one where some have none.
fn distribution(label: &str, mut values: Vec<f64>, runs: u64, turn: Option<f64>) -> Option<Figure> {
    if let Some(turn) = turn {
        values = about_their_mean(&values, turn);
    }
    values.sort_by(f64::total_cmp);
    let n = values.len();
    // A thousand steps are as many as a picture can show.
    let thin = n.div_ceil(1000).max(1);
    let share = |k: usize| k as f64 / runs as f64;
    let steps = (0..n).filter(|k| k.is_multiple_of(thin) || k + 1 == n);
    let points: Vec<(f64, f64)> = steps
        .flat_map(|k| [(values[k], share(k)), (values[k], share(k + 1))])
        .collect();
    (n > 1 && values[n - 1] > values[0]).then(|| Figure {
        title: match n as u64 {
            n if n == runs => format!("Distribution: {label}"),
            n => format!("Distribution: {label}; {n} of {runs} runs have it"),
        },
        x_label: label.into(),
        y_label: "share of all runs up to the value".into(),
        layers: vec![Layer::line("", points, 0)],
        y_range: Some((0.0, 1.02)),
        ..Figure::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three of four runs have it. The share jumps at each value and does not climb to it: between 2 and 4 it is one half.
    #[test]
    fn a_distribution_is_a_stair() {
        let figure = distribution("x", vec![4.0, 1.0, 2.0], 4, None).unwrap();
        let Layer::Line { points, .. } = &figure.layers[0] else {
            panic!("{figure:?}");
        };
        let stair = [
            (1.0, 0.0),
            (1.0, 0.25),
            (2.0, 0.25),
            (2.0, 0.5),
            (4.0, 0.5),
            (4.0, 0.75),
        ];
        assert_eq!(points[..], stair);
        // Many values are thinned, but not the last, at which all have it.
        let figure = distribution("x", (0..1502).map(f64::from).collect(), 1502, None).unwrap();
        let Layer::Line { points, .. } = &figure.layers[0] else {
            panic!("{figure:?}");
        };
        assert_eq!(points.last(), Some(&(1501.0, 1.0)));
    }
}

//! Figures of a sweep: bands over one axis, maps over two, distributions over any.

use super::Plan;
use super::parts::Store;
use super::spec::{Axis, Spacing, number};
use super::summary::Spread;
use super::table::{Cell, Kind, Reader};
use crate::draw::{Figure, Layer};
use crate::statistics::{about_their_mean, nearest};
use analyze::metrics::{find, turn_of, with_unit};
use std::path::Path;

/// What is drawn of a metric.
enum Kinds {
    /// Mean and the band of 90 % over one axis of numbers.
    Band,
    /// Mean over two axes of numbers.
    Map,
    /// Share of runs up to each value.
    Distribution,
}

fn kind_of(axes: &[Axis]) -> Kinds {
    let is_of_numbers = |a: &&Axis| {
        let numbers = a.values.iter().all(|v| number(v).is_some());
        !a.is_sampled() && a.len() > 1 && numbers
    };
    match axes.iter().filter(is_of_numbers).count() {
        1 if axes.len() == 1 => Kinds::Band,
        2 if axes.len() == 2 => Kinds::Map,
        _ => Kinds::Distribution,
    }
}

/// Draws every metric of a merged study into `folder`, as METRIC.png; gives how many.
///
/// # Errors
/// What the system or a library says.
pub fn draw(plan: &Plan, store: &Store, folder: &Path) -> Result<usize, String> {
    let io = |e: std::io::Error| format!("{}: cannot be made: {e}", folder.display());
    std::fs::create_dir_all(folder).map_err(io)?;
    let axes = &plan.spec.axes;
    let kind = kind_of(axes);
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
        let label = label(name, &reader.columns[place].unit);
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

/// A metric as people call it, with its unit.
fn label(name: &str, unit: &str) -> String {
    with_unit(find(name).map_or(name, |m| m.label), unit)
}

/// The name of an axis, with the unit of its key.
fn axis_label(plan: &Plan, axis: usize) -> String {
    with_unit(&plan.spec.axes[axis].name, &plan.columns()[2 + axis].unit)
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
        title: format!("{label}: mean, median and the band of 90 % of the runs{left_out}"),
        x_label: axis_label(plan, 0),
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
    let (of_x, columns) = cells(x);
    let (of_y, rows) = cells(y);
    let count = x.len() as usize;
    let row = |r: &usize| of_x.iter().map(|c| means[r * count + c]).collect();
    let ends = |edges: &[f64]| Some((edges[0], edges[edges.len() - 1]));
    Some(Figure {
        title: format!("{label}{left_out}"),
        x_label: axis_label(plan, 1),
        y_label: axis_label(plan, 0),
        x_range: ends(&columns),
        y_range: ends(&rows),
        x_log: x.spacing == Spacing::Log,
        y_log: y.spacing == Spacing::Log,
        layers: vec![Layer::Map {
            label: label.into(),
            values: of_y.iter().map(row).collect(),
            x: columns,
            y: rows,
        }],
    })
}

/// Which of an axis' values each cell is of, from the lowest up, and the cells' edges: half-way between neighbours, and as far beyond the ends, but not below
/// nought where all values lie above it.
fn cells(axis: &Axis) -> (Vec<usize>, Vec<f64>) {
    let apart = |x: f64| match axis.spacing {
        Spacing::Linear => x,
        Spacing::Log => x.ln(),
    };
    let value = |k: u64| apart(number(&axis.value(k)).unwrap_or(f64::NAN));
    let mut at: Vec<(f64, usize)> = (0..axis.len()).map(value).zip(0..).collect();
    at.sort_by(|a, b| a.0.total_cmp(&b.0));
    let between = |w: &[(f64, usize)]| 0.5 * (w[0].0 + w[1].0);
    let inner: Vec<f64> = at.windows(2).map(between).collect();
    let mut first = 2.0 * at[0].0 - inner[0];
    if axis.spacing == Spacing::Linear && at[0].0 > 0.0 {
        first = first.max(0.0);
    }
    let last = 2.0 * at[at.len() - 1].0 - inner[inner.len() - 1];
    let edges = [first].into_iter().chain(inner).chain([last]);
    let edges = edges.map(|x| match axis.spacing {
        Spacing::Linear => x,
        Spacing::Log => x.exp(),
    });
    (at.iter().map(|a| a.1).collect(), edges.collect())
}

/// Share of all `runs` up to each value: it ends below one where some have none.
fn distribution(label: &str, mut values: Vec<f64>, runs: u64, turn: Option<f64>) -> Option<Figure> {
    if let Some(turn) = turn {
        (_, values) = about_their_mean(&values, turn);
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

    fn axes(text: &str) -> Vec<Axis> {
        let text = format!("scene = \"music\"\naxes = [{text}]");
        super::super::spec::parse("test", &text).unwrap().axes
    }

    #[test]
    fn figures_call_metrics_as_people_do() {
        assert_eq!(label("rms_roll_deg", "deg"), "RMS roll, deg");
        assert_eq!(label("h2_ratio", "1"), "height, second harmonic");
        assert_eq!(label("a truth", "N"), "a truth, N");
    }

    #[test]
    fn two_axes_of_numbers_are_a_map() {
        let mass = "{ key = \"body.mass_kg\", values = [40, 80.0, 50] }";
        let beat = "{ key = \"effects.music.beat_hz\", from = 1.0, to = 4.0, count = 3, spacing = \"log\" }";
        let words = "{ key = \"effects.friction.law\", values = [\"regularised\", \"bristle\"] }";
        let one = "{ key = \"effects.music.beat_hz\", values = [2.0] }";
        let kind = |text: &[&str]| match kind_of(&axes(&text.join(", "))) {
            Kinds::Band => "band",
            Kinds::Map => "map",
            Kinds::Distribution => "distribution",
        };
        assert_eq!(kind(&[mass]), "band");
        assert_eq!(kind(&[mass, beat]), "map");
        assert_eq!(kind(&[beat, mass]), "map");
        assert_eq!(kind(&[mass, words]), "distribution");
        assert_eq!(kind(&[one, mass]), "distribution");
        assert_eq!(kind(&[words]), "distribution");

        // Values are put in order, cells lie about them, and equal factors stay equal.
        let found = axes(&[mass, beat].join(", "));
        assert_eq!(
            cells(&found[0]),
            (vec![0, 2, 1], vec![35.0, 45.0, 65.0, 95.0])
        );
        let far = axes("{ key = \"body.mass_kg\", values = [50, 450] }");
        assert_eq!(cells(&far[0]).1, [0.0, 250.0, 650.0]);
        let (order, edges) = cells(&found[1]);
        assert_eq!(order, [0, 1, 2]);
        for (edge, power) in edges.iter().zip([-0.5, 0.5, 1.5, 2.5]) {
            assert!(
                (edge / 2.0_f64.powf(power) - 1.0).abs() < 1e-14,
                "{edges:?}"
            );
        }
    }

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

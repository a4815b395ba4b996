//! The paper's ensemble: both conditions, thirty seeds each, beside the paper's table and the archive's logs.

use crate::draw::{Figure, Layer};
use crate::ensemble::Run;
use crate::statistics::{Summary, summarise};
use serde_json::{Value, json};

/// First seed of the paper's ensemble.
pub const FIRST_SEED: u64 = 1001;
/// Runs of each condition.
pub const RUNS: u64 = 30;

/// The two conditions, by the names of their scenes.
pub const CONDITIONS: [&str; 2] = ["baseline", "music"];

/// A number with its spread, as somebody printed or measured it.
#[derive(Clone, Copy, Debug)]
pub struct Known {
    /// Mean.
    pub mean: f64,
    /// What stands behind ±.
    pub spread: f64,
}

/// A row of the table.
pub struct Row {
    /// Metric name, or `force_correlation`.
    pub name: &'static str,
    /// For people.
    pub label: &'static str,
    /// Digits after the point.
    pub digits: usize,
    /// What the paper's Table 1 prints for baseline and music.
    pub paper: [Option<Known>; 2],
    /// What the 30 + 30 logs of the paper's archive give (mean ± sample SD), recomputed.
    pub archive: [Option<Known>; 2],
}

const fn known(mean: f64, spread: f64) -> Option<Known> {
    Some(Known { mean, spread })
}

/// Every row that is compared. Sources: paper, Table 1; the archive's logs, t ≥ 15 s.
pub const ROWS: &[Row] = &[
    Row {
        name: "rms_roll_deg",
        label: "RMS roll, deg",
        digits: 3,
        paper: [known(0.148, 0.019), known(18.387, 0.814)],
        archive: [known(0.148, 0.0195), known(18.39, 0.81)],
    },
    Row {
        name: "contact_loss_mean",
        label: "contact loss, mean over handles",
        digits: 3,
        paper: [known(0.040, 0.005), known(0.317, 0.013)],
        archive: [known(0.039, 0.013), known(0.317, 0.007)],
    },
    Row {
        name: "contact_loss",
        label: "contact loss, any handle",
        digits: 3,
        paper: [None, None],
        archive: [known(0.078, 0.027), known(0.434, 0.007)],
    },
    Row {
        name: "synchrony",
        label: "synchrony",
        digits: 3,
        paper: [known(0.629, 0.032), known(0.990, 0.004)],
        archive: [known(0.633, 0.106), known(0.990, 0.012)],
    },
    Row {
        name: "onset_time_s",
        label: "onset, s",
        digits: 1,
        paper: [None, None],
        archive: [None, known(20.5, 4.0)],
    },
    Row {
        name: "dz_pp_m",
        label: "peak-to-peak height, m",
        digits: 3,
        paper: [None, None],
        archive: [known(0.133, 0.017), known(0.155, 0.014)],
    },
    Row {
        name: "t_float",
        label: "T_float (eps 0.05)",
        digits: 3,
        paper: [None, None],
        archive: [known(0.089, 0.028), known(0.230, 0.007)],
    },
    Row {
        name: "rms_pitch_deg",
        label: "RMS tilt of the pole, deg",
        digits: 2,
        paper: [None, None],
        archive: [known(1.18, 0.0), known(2.09, 0.0)],
    },
    Row {
        name: "rms_yaw_deg",
        label: "RMS yaw, deg",
        digits: 2,
        paper: [None, None],
        archive: [None, None],
    },
    Row {
        name: "force_sd_n",
        label: "handle force SD, N",
        digits: 0,
        paper: [None, None],
        archive: [known(171.0, 0.0), known(277.0, 0.0)],
    },
    Row {
        name: "force_correlation",
        label: "correlation of the handle forces",
        digits: 3,
        paper: [None, None],
        archive: [known(0.996, 0.0), known(0.977, 0.0)],
    },
];

/// How many runs of each condition the paper and the archive call unstable.
pub const UNSTABLE: [u64; 2] = [0, 30];

/// A condition's ensemble.
pub struct Condition {
    /// Scene name.
    pub name: &'static str,
    /// Its runs in the order of the seeds.
    pub runs: Vec<Run>,
}

impl Condition {
    /// Summary of a row over the runs that have it.
    pub fn summary(&self, row: &str) -> Option<Summary> {
        let of = |run: &Run| {
            if row == "force_correlation" {
                run.force_correlation
            } else {
                run.get(row)
            }
        };
        summarise(self.runs.iter().filter_map(of))
    }

    /// How many runs have an onset.
    pub fn unstable(&self) -> usize {
        self.runs
            .iter()
            .filter(|r| r.get("unstable") == Some(1.0))
            .count()
    }
}

/// The table for people.
pub fn table(conditions: &[Condition]) -> String {
    let mut out = String::new();
    for (c, condition) in conditions.iter().enumerate() {
        out += &format!(
            "{} ({} runs, seeds {}..{})\n",
            condition.name,
            condition.runs.len(),
            condition.runs.first().map_or(0, |r| r.seed),
            condition.runs.last().map_or(0, |r| r.seed)
        );
        out += &format!(
            "  {:<33}{:>18}{:>18}{:>8}{:>18}{:>8}\n",
            "", "here, mean ± SD", "paper, ±", "diff", "archive, ± SD", "diff"
        );
        for row in ROWS {
            let d = row.digits;
            let here = condition.summary(row.name);
            let print = |mean: f64, spread: f64| match spread {
                0.0 => format!("{mean:.d$}"),
                s => format!("{mean:.d$} ± {s:.d$}"),
            };
            let known = |k: Option<Known>| k.map_or("–".into(), |k| print(k.mean, k.spread));
            let diff = |k: Option<Known>| match (here, k) {
                (Some(h), Some(k)) if k.spread > 0.0 => {
                    format!("{:+.1}", (h.mean - k.mean) / k.spread)
                }
                _ => String::new(),
            };
            let line = format!(
                "  {:<33}{:>18}{:>18}{:>8}{:>18}{:>8}",
                row.label,
                here.map_or("–".into(), |s| match s.sd {
                    None => format!("{:.d$} ± –", s.mean),
                    Some(sd) => format!("{:.d$} ± {sd:.d$}", s.mean),
                }),
                known(row.paper[c]),
                diff(row.paper[c]),
                known(row.archive[c]),
                diff(row.archive[c])
            );
            out += line.trim_end();
            out.push('\n');
        }
        let unstable = format!("{}/{}", condition.unstable(), condition.runs.len());
        let theirs = format!("{}/{RUNS}", UNSTABLE[c]);
        out += &format!(
            "  {:<33}{unstable:>18}{theirs:>18}{:>8}{theirs:>18}\n\n",
            "unstable", ""
        );
    }
    out += "diff: (here − theirs) in units of their ±. Window: t ≥ 15 s. Definitions: docs/metrics.md.\n";
    out
}

/// The table as pictures, by their names: every run, and the paper's mean and ± of each condition as a cross.
pub fn figures(conditions: &[Condition]) -> Vec<(&'static str, Figure)> {
    let roll = &ROWS[0];
    let pictures = [("table1-contact", &ROWS[1]), ("table1-synchrony", &ROWS[3])];
    pictures
        .map(|(stem, across)| (stem, figure(conditions, across, roll)))
        .into()
}

fn figure(conditions: &[Condition], across: &Row, up: &Row) -> Figure {
    let mut layers = Vec::new();
    for (c, condition) in conditions.iter().enumerate() {
        let of = |run: &Run| Some((run.get(across.name)?, run.get(up.name)?));
        let points = condition.runs.iter().filter_map(of).collect();
        layers.push(Layer::points(condition.name, points, c));
        if let (Some(x), Some(y)) = (across.paper[c], up.paper[c]) {
            let name = if c == 0 { "paper" } else { "" };
            let bar =
                |dx: f64, dy: f64| vec![(x.mean - dx, y.mean - dy), (x.mean + dx, y.mean + dy)];
            layers.push(Layer::line(name, bar(x.spread, 0.0), 6));
            layers.push(Layer::line("", bar(0.0, y.spread), 6));
        }
    }
    Figure {
        title: "Table 1 of the paper: every run, and the paper's mean ± spread".into(),
        x_label: across.label.into(),
        y_label: up.label.into(),
        layers,
        ..Figure::default()
    }
}

/// The result as JSON. `wall_s` is the only number in it that differs from run to run.
pub fn to_json(conditions: &[Condition], wall_s: f64) -> Value {
    let mut by_name = serde_json::Map::new();
    for condition in conditions {
        let metrics: serde_json::Map<String, Value> = ROWS
            .iter()
            .map(|row| {
                let of = match condition.summary(row.name) {
                    Some(s) => json!({"mean": s.mean, "sd": s.sd, "ci95": s.ci95, "runs": s.runs}),
                    // An onset that no run has is there, and null.
                    None => json!({"mean": null, "sd": null, "ci95": null, "runs": 0}),
                };
                (row.name.to_owned(), of)
            })
            .collect();
        by_name.insert(
            condition.name.into(),
            json!({"runs": condition.runs.len(), "metrics": metrics, "unstable": condition.unstable()}),
        );
    }
    let printed = |which: fn(&Row) -> [Option<Known>; 2]| {
        let mut conditions = serde_json::Map::new();
        for (c, name) in CONDITIONS.iter().enumerate() {
            let mut rows: serde_json::Map<String, Value> = ROWS
                .iter()
                .filter_map(|row| {
                    which(row)[c].map(|k| {
                        (
                            row.name.to_owned(),
                            json!({"mean": k.mean, "spread": k.spread}),
                        )
                    })
                })
                .collect();
            rows.insert("unstable".into(), json!(UNSTABLE[c]));
            conditions.insert((*name).into(), rows.into());
        }
        Value::from(conditions)
    };
    json!({
        "conditions": by_name,
        "paper": printed(|r| r.paper),
        "archive": printed(|r| r.archive),
        "wall_s": wall_s,
    })
}

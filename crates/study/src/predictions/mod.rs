//! The paper's five predictions as experiments, and the map of stability behind them.

pub mod coherence;
pub mod floquet;
pub mod harmonics;
pub mod lever;
pub mod locking;
pub mod onsets;
pub mod stability;

use crate::draw::Figure;
use crate::ensemble::observe;
use crate::pool::in_order;
use analyze::inputs::Inputs;
use serde_json::{Value, json};
use sim::run::{Listener, Sample};
use sim::scene::{Scene, Template};
use std::fmt::Write;
use std::sync::atomic::{AtomicBool, Ordering};

/// What the data say to a prediction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// They agree.
    Supported,
    /// They agree under a condition that the prediction does not name.
    Depends,
    /// They do not agree.
    NotSupported,
}

impl Verdict {
    /// For people and programs.
    pub fn word(self) -> &'static str {
        match self {
            Self::Supported => "supported",
            Self::Depends => "depends",
            Self::NotSupported => "not supported",
        }
    }
}

/// A number behind a verdict.
#[derive(Clone, Debug)]
pub struct Number {
    /// For programs.
    pub name: &'static str,
    /// For people.
    pub label: String,
    /// The number.
    pub value: f64,
    /// Its unit, empty where it has none.
    pub unit: &'static str,
    /// Digits after the point.
    pub digits: usize,
}

/// A figure with its file's name and what it shows.
pub type Picture = (&'static str, String, Figure);

/// What an experiment found.
#[derive(Clone, Debug)]
pub struct Finding {
    /// Title.
    pub title: &'static str,
    /// What the paper says.
    pub claim: &'static str,
    /// What was done.
    pub experiment: String,
    /// What came of it; `None` where nobody predicted anything.
    pub verdict: Option<Verdict>,
    /// Why, and under which condition.
    pub because: String,
    /// The numbers behind it.
    pub numbers: Vec<Number>,
    /// The pictures.
    pub pictures: Vec<Picture>,
}

impl Finding {
    /// A number by name.
    pub fn number(&self, name: &str) -> Option<f64> {
        self.numbers
            .iter()
            .find(|n| n.name == name)
            .map(|n| n.value)
    }
}

/// An experiment of the table.
pub struct Experiment {
    /// Name for the command line and in files.
    pub name: &'static str,
    /// Does it.
    pub run: fn(&Lab) -> Result<Finding, String>,
}

/// Every experiment, in the paper's order.
pub const EXPERIMENTS: &[Experiment] = &[
    Experiment {
        name: "locking",
        run: locking::run,
    },
    Experiment {
        name: "coherence",
        run: coherence::run,
    },
    Experiment {
        name: "lever",
        run: lever::run,
    },
    Experiment {
        name: "harmonics",
        run: harmonics::run,
    },
    Experiment {
        name: "onsets",
        run: onsets::run,
    },
    Experiment {
        name: "stability",
        run: stability::run,
    },
];

/// Where experiments are done: threads, seeds, and who watches.
pub struct Lab<'a> {
    /// Threads; 0 is one per core. No result depends on it.
    pub jobs: usize,
    /// Seeds of an ensemble where nothing else is said.
    pub seeds: u64,
    /// Set to stop.
    pub stop: &'a AtomicBool,
    /// Called after every piece of work.
    pub done: &'a dyn Fn(),
}

#[cfg(test)]
impl Lab<'static> {
    /// Of so many seeds, that nobody stops and that tells nobody.
    fn quiet(seeds: u64) -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Lab {
            jobs: 0,
            seeds,
            stop: &NEVER,
            done: &|| {},
        }
    }
}

impl Lab<'_> {
    /// `work` on every item, results in their order.
    ///
    /// # Errors
    /// The first that `work` gave, or that it was interrupted.
    pub fn map<I: Sync, T: Send>(
        &self,
        items: &[I],
        work: impl Fn(&I) -> Result<T, String> + Sync,
    ) -> Result<Vec<T>, String> {
        let mut out = Vec::with_capacity(items.len());
        in_order(
            items.len() as u64,
            self.jobs,
            self.stop,
            |k| work(&items[k as usize]),
            |_, result| {
                out.push(result?);
                (self.done)();
                Ok::<(), String>(())
            },
        )?;
        match self.stop.load(Ordering::Relaxed) {
            true => Err("interrupted; nothing was written".into()),
            false => Ok(out),
        }
    }

    /// Every value with every seed from 1001 on: values slow, seeds fast.
    pub fn with_seeds<V: Clone>(&self, values: &[V]) -> Vec<(V, u64)> {
        let seeds = crate::paper::FIRST_SEED..crate::paper::FIRST_SEED + self.seeds;
        values
            .iter()
            .flat_map(|v| seeds.clone().map(move |s| (v.clone(), s)))
            .collect()
    }
}

/// A template of a built-in scene for ensembles: tolerance 1e-6, no energy account, and what `settings` change.
fn template(scene: &str, settings: &[&str]) -> Result<Template, String> {
    let usual = ["solver.tolerance=1e-6", "solver.energy=false"];
    let all: Vec<String> = usual.iter().chain(settings).map(|s| (*s).into()).collect();
    Template::load(scene, &all).map_err(|e| e.to_string())
}

/// The template's scene with numbers at some keys.
fn scene(template: &Template, values: &[(&str, f64)], seed: u64) -> Result<Scene, String> {
    let values = values.iter().map(|(key, x)| (*key, (*x).into()));
    let mut scene = template.with(values).map_err(|e| e.to_string())?;
    scene.seed = seed;
    Ok(scene)
}

/// A run's columns; `also` sees every sample too.
fn columns(scene: &Scene, also: &mut dyn Listener) -> Result<Inputs, String> {
    let (columns, _, outcome) = observe(scene, None, also);
    outcome
        .map(|()| columns.inputs)
        .map_err(|e| format!("{} seed {}: {e}", scene.name, scene.seed))
}

/// Some metrics of a run over the scene's window, a yes as 1; NaN where there is none.
fn measure<const N: usize>(scene: &Scene, names: [&str; N]) -> Result<[f64; N], String> {
    let inputs = columns(scene, &mut |_: &Sample| true)?;
    let window = analyze::Window::from(scene.analysis_start_s);
    let found = analyze::metrics_of(&inputs, window, |n| names.contains(&n));
    Ok(names.map(|name| {
        let value = found.get(name);
        value
            .and_then(|v| v.as_f64().or_else(|| v.as_bool().map(f64::from)))
            .unwrap_or(f64::NAN)
    }))
}

/// Arithmetic mean of the finite ones; NaN without any.
fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, n) = values
        .into_iter()
        .filter(|x| x.is_finite())
        .fold((0.0, 0.0), |(s, n), x| (s + x, n + 1.0));
    sum / n
}

/// Spearman's rank correlation; ties share their mean rank. NaN where one of the two does not vary.
fn spearman(x: &[f64], y: &[f64]) -> f64 {
    let ranks = |x: &[f64]| -> Vec<f64> {
        x.iter()
            .map(|a| {
                let below = x.iter().filter(|b| *b < a).count();
                let same = x.iter().filter(|b| *b == a).count();
                below as f64 + 0.5 * (same as f64 - 1.0)
            })
            .collect()
    };
    crate::statistics::correlation(&ranks(x), &ranks(y)).unwrap_or(f64::NAN)
}

/// Slope and its standard error of the straight line through points (least squares).
fn slope(points: &[(f64, f64)]) -> (f64, f64) {
    let n = points.len() as f64;
    let (mx, my) = (
        mean(points.iter().map(|p| p.0)),
        mean(points.iter().map(|p| p.1)),
    );
    let xx: f64 = points.iter().map(|p| (p.0 - mx).powi(2)).sum();
    let slope = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>() / xx;
    let rest: f64 = points
        .iter()
        .map(|p| (p.1 - my - slope * (p.0 - mx)).powi(2))
        .sum();
    (slope, (rest / (n - 2.0) / xx).sqrt())
}

/// Values from `from` to `to`, both included.
fn row(from: f64, to: f64, count: usize) -> Vec<f64> {
    (0..count)
        .map(|k| from + (to - from) * k as f64 / (count - 1) as f64)
        .collect()
}

fn number(
    name: &'static str,
    label: impl Into<String>,
    value: f64,
    unit: &'static str,
    digits: usize,
) -> Number {
    Number {
        name,
        label: label.into(),
        value,
        unit,
        digits,
    }
}

/// Text for a cell of a table of Markdown.
fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}

/// Seeds of every ensemble where nobody says how many.
pub const SEEDS: u64 = 12;

/// The findings as a page of Markdown, be they all or some, of a command that wrote it to `folder`; pictures are looked for in `pictures` beside it.
pub fn page(findings: &[(&str, Finding)], folder: &str, pictures: &str, seeds: u64) -> String {
    let mut words = String::new();
    if findings.len() < EXPERIMENTS.len() {
        words.extend(findings.iter().map(|(name, _)| format!(" {name}")));
    }
    if seeds != SEEDS {
        let _ = write!(words, " --seeds {seeds}");
    }
    let mut out = format!(
        "# The paper's predictions, tried\n\n    $ cargo run --release -p study -- predictions{words} --out {folder}\n\n\
         wrote this page and its pictures, with {seeds} seeds for an ensemble where nothing else is said. What the scenes are: docs/reproduction.md; what the\n\
         metrics are: docs/metrics.md. Everything said here is said of this model, not of any procession.\n\n\
         | prediction | verdict | condition |\n|---|---|---|\n"
    );
    for (_, f) in findings {
        if let Some(verdict) = f.verdict {
            let _ = writeln!(
                out,
                "| {} | **{}** | {} |",
                f.title,
                verdict.word(),
                cell(&f.because)
            );
        }
    }
    for (name, f) in findings {
        let _ = write!(out, "\n## {}\n\n", f.title);
        if !f.claim.is_empty() {
            let _ = write!(out, "> {}\n\n", f.claim);
        }
        let _ = write!(out, "{}\n\n", f.experiment);
        for (stem, caption, _) in &f.pictures {
            let _ = write!(out, "![{caption}]({pictures}/{stem}.png)\n\n{caption}\n\n");
        }
        out += "| number | value |\n|---|---|\n";
        for n in &f.numbers {
            let value = match n.value.is_finite() {
                true => format!("{:.*} {}", n.digits, n.value, n.unit),
                false => "–".into(),
            };
            let _ = writeln!(out, "| {} | {} |", cell(&n.label), value.trim_end());
        }
        match f.verdict {
            Some(v) => {
                let _ = writeln!(out, "\nVerdict: **{}**. {}", v.word(), f.because);
            }
            None => {
                let _ = writeln!(out, "\n{}", f.because);
            }
        }
        let _ = writeln!(
            out,
            "\n    $ cargo run --release -p study -- predictions {name}"
        );
    }
    out
}

/// The findings for programs.
pub fn to_json(findings: &[(&str, Finding)]) -> Value {
    let one = |f: &Finding| {
        let numbers: serde_json::Map<String, Value> = f
            .numbers
            .iter()
            .map(|n| {
                let value = n.value.is_finite().then_some(n.value);
                (
                    n.name.to_owned(),
                    json!({"value": value, "unit": n.unit, "label": n.label}),
                )
            })
            .collect();
        json!({
            "title": f.title, "claim": f.claim, "verdict": f.verdict.map(Verdict::word),
            "because": f.because, "numbers": numbers,
        })
    };
    findings
        .iter()
        .map(|(name, f)| ((*name).to_owned(), one(f)))
        .collect::<serde_json::Map<_, _>>()
        .into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_and_slopes() {
        assert!((spearman(&[1.0, 2.0, 3.0, 10.0], &[1.0, 4.0, 9.0, 1e6]) - 1.0).abs() < 1e-15);
        // scipy.stats.spearmanr([1, 2, 2, 3], [4, 1, 3, 2]).statistic = -0.632455532033676
        assert!(
            (spearman(&[1.0, 2.0, 2.0, 3.0], &[4.0, 1.0, 3.0, 2.0]) + 0.632_455_532_033_676).abs()
                < 1e-12
        );
        let (b, e) = slope(&[(0.0, 1.0), (1.0, 3.0), (2.0, 5.0)]);
        assert!((b - 2.0).abs() < 1e-15 && e < 1e-12);
        // scipy.stats.linregress([1, 2, 4, 7, 8], [2, 1, 5, 6, 11]): slope, stderr
        let (b, e) = slope(&[(1.0, 2.0), (2.0, 1.0), (4.0, 5.0), (7.0, 6.0), (8.0, 11.0)]);
        assert!((b - 1.182_795_698_924_731).abs() < 1e-14, "{b}");
        assert!((e - 0.298_697_729_749_111_2).abs() < 1e-14, "{e}");
        assert_eq!(row(1.0, 2.0, 3), [1.0, 1.5, 2.0]);
        assert_eq!(mean([1.0, f64::NAN, 4.0]), 2.5);
        let lab = Lab::quiet(2);
        let pairs = [("a", 1001), ("a", 1002), ("b", 1001), ("b", 1002)];
        assert_eq!(lab.with_seeds(&["a", "b"]), pairs);
    }
}

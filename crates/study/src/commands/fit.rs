//! `study fit FILE...`: parameters of the model from recordings.

use super::{Format, print};
use analyze::Window;
use analyze::examine::{Request, examine};
use anyhow::{Context, Result, anyhow};
use recording::import::ingest;
use recording::read::{ReadOptions, Recording};
use recording::write::{RecordingWriter, WriterOptions};
use serde_json::json;
use std::path::{Path, PathBuf};
use study::fit::{Estimate, Field, Outcome, fit};
use study::statistics::summarise;

/// Arguments of `study fit`.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Recordings (.mcap), or logs of the paper's archive (.npz).
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// The scene that says when the music begins and how it builds up.
    #[arg(long, value_name = "SCENE", default_value = "music")]
    scene: String,
    /// What to print.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
}

const EXAMPLES: &str = "Examples:
  study fit music-1001.mcap
  study fit archive/music/seed_*/logs.npz
  study fit field.mcap --scene rath.toml --format json";

/// Fits every file, and says what they have in common.
pub fn run(args: &Args) -> Result<()> {
    let scene = sim::scene::load(&args.scene, &[])?;
    let (onset_s, build_up_s) = scene
        .effects
        .music
        .map_or((0.0, 0.0), |m| (m.onset_s, m.build_up_s));
    let mut all: Vec<(String, Vec<Outcome>)> = Vec::new();
    for file in &args.files {
        let name = file.display().to_string();
        let (mut field, window) = read(file)?;
        (field.onset_s, field.build_up_s) = (onset_s, build_up_s);
        all.push((name, fit(&field, window)));
    }
    let together = common(&all);
    match args.format {
        Format::Json => {
            let one = |outcome: &Outcome| match outcome {
                Ok(e) => (
                    e.name.clone(),
                    json!({"value": e.value, "ci95": e.interval, "unit": e.unit}),
                ),
                Err((name, why)) => (name.clone(), json!({"value": null, "reason": why})),
            };
            let files: Vec<_> = all
                .iter()
                .map(|(name, found)| {
                    let parameters: serde_json::Map<_, _> = found.iter().map(one).collect();
                    json!({"file": name, "parameters": parameters})
                })
                .collect();
            let mean: serde_json::Map<_, _> = together
                .iter()
                .map(|(e, n)| {
                    (
                        e.name.clone(),
                        json!({"value": e.value, "ci95": e.interval, "unit": e.unit, "files": n}),
                    )
                })
                .collect();
            print(&format!("{:#}\n", json!({"files": files, "mean": mean})))
        }
        Format::Table => {
            let mut text = String::new();
            for (name, found) in &all {
                text += &format!("{name}\n");
                for outcome in found {
                    text += &match outcome {
                        Ok(e) => line(e, ""),
                        Err((name, why)) => format!("  {name:<14}{:>12}  {why}\n", "–"),
                    };
                }
            }
            if all.len() > 1 {
                text += &format!("mean of {} files\n", all.len());
                for (e, n) in &together {
                    text += &line(e, &format!("  ({n} files)"));
                }
            }
            print(&text)
        }
    }
}

fn line(e: &Estimate, after: &str) -> String {
    let [low, high] = e.interval;
    format!(
        "  {:<14}{:>12.5}  ({low:.5} … {high:.5}) {}{after}\n",
        e.name, e.value, e.unit
    )
}

/// Means over the files, with the 95 % interval of the mean from their spread.
fn common(all: &[(String, Vec<Outcome>)]) -> Vec<(Estimate, usize)> {
    let mut names: Vec<(&str, &'static str)> = Vec::new();
    for e in all.iter().flat_map(|(_, found)| found.iter().flatten()) {
        if !names.iter().any(|(n, _)| *n == e.name) {
            names.push((&e.name, e.unit));
        }
    }
    names
        .into_iter()
        .filter_map(|(name, unit)| {
            let of = all.iter().flat_map(|(_, found)| found.iter().flatten());
            let s = summarise(of.filter(|e| e.name == name).map(|e| e.value))?;
            let estimate = Estimate {
                name: name.into(),
                unit,
                value: s.mean,
                interval: [s.mean - s.ci95, s.mean + s.ci95],
            };
            Some((estimate, s.runs))
        })
        .collect()
}

/// The columns of a recording, and its window of analysis.
fn read(file: &Path) -> Result<(Field, Window)> {
    let name = file.display().to_string();
    let log = file
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("npz"));
    let recording = if log {
        // The archive's logs become recordings first, as everybody's do.
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("log.mcap");
        let mut writer = RecordingWriter::create(&path, &WriterOptions::default())?;
        ingest(&[file.to_owned()], None, &mut writer)
            .with_context(|| format!("cannot read {name}"))?;
        writer.finish()?;
        Recording::from_bytes(std::fs::read(&path)?, &ReadOptions::default())?
    } else {
        Recording::open(file, &ReadOptions::default())
            .with_context(|| format!("cannot read {name}"))?
    };
    let analysis = examine(&name, &recording, &Request::default())?;
    let (mut signals, _) =
        recording.signals(&|path| path.starts_with("/handles/forces.compression_m"))?;
    signals.sort_by(|a, b| a.path.cmp(&b.path));
    let forces = analysis.inputs.force_times().len();
    let compression_m: Vec<Vec<f64>> = signals
        .into_iter()
        .map(|s| s.values)
        .filter(|v| v.len() == forces)
        .collect();
    if analysis.inputs.t_s.is_empty() {
        return Err(anyhow!(
            "{name}: nothing in it moves: no state and no inertial sensor was found"
        ));
    }
    let field = Field {
        inputs: analysis.inputs,
        compression_m,
        ..Field::default()
    };
    Ok((field, analysis.window))
}

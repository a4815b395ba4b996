//! `study fit FILE...`: parameters of the model from recordings.

use super::{Format, Input, print};
use analyze::roles::RolesFile;
use anyhow::{Result, bail};
use serde_json::json;
use sim::scene::load;
use std::path::PathBuf;
use study::fit::{Estimate, Field, Outcome, fit, holes};
use study::statistics::summarise;

/// Arguments of `study fit`.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Recordings (.mcap), or logs of the paper's archive (.npz).
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// The scene that says when the music begins, how it builds up, and, for a recording of sensors alone, where the handles are and
    /// what the body weighs. Default: the scene attached to the recording; without one `music`, and no weight.
    #[arg(long, value_name = "SCENE")]
    scene: Option<String>,
    /// TOML that says which signal plays which role, and what the sensors do not say of themselves, as for `analyze`
    #[arg(long, value_name = "FILE")]
    roles: Option<PathBuf>,
    /// Put the carriers' clocks on the rath's first, by taps or else by their heave. The heave takes away some of the lag by which a pull is
    /// seen, and leaves clocks 20 ms off: a millisecond moves the stiffness by some 70 N/m, so that and damping are then not told.
    #[arg(long)]
    put_clocks_right: bool,
    /// What to print.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
}

const EXAMPLES: &str = "Examples:
  study fit music-1001.mcap
  study fit archive/music/seed_*/logs.npz
  study fit field.mcap --scene rath.toml --format json

A field recording (inertial sensors on the rath and on every carrier, stamped by one clock) gives the beat, amplitudes and, where all \
handles carry for long enough, stiffness and damping; where clocks differ and taps have not set them, these have a reason instead; it may have come through `analyze FILE --annotate OUT.mcap` or not.";

/// Fits every file, and says what they have in common.
pub fn run(args: &Args) -> Result<Input> {
    let given = match &args.scene {
        Some(scene) => Some(load(scene, &[])?),
        None => None,
    };
    let usual = load("music", &[])?;
    let roles = match &args.roles {
        Some(path) => Some(RolesFile::read(path).map_err(anyhow::Error::msg)?),
        None => None,
    };
    let mut input = Input::Whole;
    let mut all: Vec<(String, Vec<Outcome>)> = Vec::new();
    let mut said: Vec<Vec<String>> = Vec::new();
    for file in &args.files {
        let name = file.display().to_string();
        let (mut field, told) = Field::read(file, roles.as_ref(), args.put_clocks_right)?;
        let known = match (&given, &told.scene) {
            (Some(scene), _) | (None, Some(Ok(scene))) => Some(scene),
            (None, None) => None,
            // The usual scene in its place would begin its music at another time.
            (None, Some(Err(why))) => bail!(
                "{name}: the scene attached to it cannot be read: {why}; give it with --scene"
            ),
        };
        let scene = known.unwrap_or(&usual);
        (field.onset_s, field.build_up_s) = match &scene.effects.music {
            Some(music) => (music.onset_s + told.zero_s, music.build_up_s),
            None => (0.0, 0.0),
        };
        let coupling = scene.effects.coupling.as_ref();
        field.pairs = coupling.and_then(|c| c.graph.pairs(&scene.carriers));
        field.handles_m.clone_from(&scene.carriers.handles_m);
        if known.is_some() {
            field.inputs.mass_kg.get_or_insert(scene.body.mass_kg);
        }
        let remarks = [told.clocks_apart, holes(&field)].concat();
        for remark in &remarks {
            recording::note!("study: {name}: {remark}");
        }
        if let Some(damage) = told.damage {
            recording::note!("study: {damage}");
            input = Input::Damaged;
        }
        all.push((name, fit(&field, told.window)));
        said.push(remarks);
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
                .zip(&said)
                .map(|((name, found), remarks)| {
                    let parameters: serde_json::Map<_, _> = found.iter().map(one).collect();
                    json!({"file": name, "parameters": parameters, "remarks": remarks})
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
            print(&format!("{:#}\n", json!({"files": files, "mean": mean})))?;
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
            if all.len() > 1 && !together.is_empty() {
                text += &format!("mean of {} files\n", all.len());
                for (e, n) in &together {
                    let files = recording::text::counted(*n as u64, "file", "files");
                    text += &line(e, &format!("  ({files})"));
                }
            }
            print(&text)?;
        }
    }
    Ok(input)
}

fn line(e: &Estimate, after: &str) -> String {
    let [low, high] = e.interval;
    format!(
        "  {:<14}{:>12.5}  ({low:.5} … {high:.5}) {}{after}\n",
        e.name, e.value, e.unit
    )
}

/// Means over the files, with the 95 % interval of the mean by Student's t from their spread, or that which the files' own intervals leave, if that is wider:
/// files that one clock kept the beat of agree by more than they know. Only of what at least half of the files tell: fewer are a choice.
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
            let of = || {
                let all = all.iter().flat_map(|(_, found)| found.iter().flatten());
                all.filter(|e| e.name == name)
            };
            let s = summarise(of().map(|e| e.value)).filter(|s| 2 * s.runs >= all.len())?;
            if s.runs == 1 {
                return Some((of().next()?.clone(), 1));
            }
            let own = of().map(|e| (0.5 * (e.interval[1] - e.interval[0])).powi(2));
            let own = own.sum::<f64>().sqrt() / s.runs as f64;
            let half = s.ci95?.max(own);
            let estimate = Estimate {
                name: name.into(),
                unit,
                value: s.mean,
                interval: [s.mean - half, s.mean + half],
            };
            Some((estimate, s.runs))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_agree_are_no_surer_than_they_say() {
        let file = |value: f64| {
            let estimate = Estimate {
                name: "beat".into(),
                unit: "Hz",
                value,
                interval: [value - 0.3, value + 0.3],
            };
            ("file".to_owned(), vec![Ok(estimate)])
        };
        let half = |all: &[(String, Vec<Outcome>)]| {
            let (mean, files) = &common(all)[0];
            assert_eq!(*files, all.len());
            0.5 * (mean.interval[1] - mean.interval[0])
        };
        // 0.3/√n, and where they differ by more Student's t: 12.7062 of SD/√2, which is a half of their distance.
        assert!((half(&[2.0, 2.0, 2.0, 2.0].map(file)) - 0.15).abs() < 1e-12);
        assert!((half(&[2.0, 3.0].map(file)) - 12.706_204_736 * 0.5).abs() < 1e-9);
        // One of two tells it, one of three.
        let none = || ("none".to_owned(), Vec::new());
        assert_eq!(common(&[file(2.0), none()]).len(), 1);
        assert!(common(&[file(2.0), none(), none()]).is_empty());
    }
}

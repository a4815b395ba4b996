//! `study paper`: Table 1.

use super::{Format, count, jobs, make_folder, print, write_whole};
use anyhow::{Result, bail};
use sim::scene::{Scene, load};
use std::path::PathBuf;
use std::time::Instant;
use study::ensemble::{KEPT, Run, run_all};
use study::paper::{CONDITIONS, Condition, FIRST_SEED, RUNS, figures, table, to_json};

/// Arguments of `study paper`.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Seeds per condition, from 1001 on.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = count(1..=100_000))]
    seeds: Option<u64>,
    /// Threads; 0 is one per core. The result does not depend on it.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = jobs, allow_negative_numbers = true)]
    jobs: usize,
    /// A folder for the result's files (paper.json, paper.txt, runs.csv, pictures).
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// What to print.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
}

const EXAMPLES: &str = "Examples:
  study paper                       Table 1 of the paper, beside the paper's own
  study paper --format json --jobs 1
  study paper --seeds 5 --out results";

/// Runs both conditions and prints them beside the paper's table.
pub fn run(args: &Args) -> Result<()> {
    let began = Instant::now();
    let seeds = args.seeds.unwrap_or(RUNS);
    let mut scenes: Vec<Scene> = Vec::new();
    for name in CONDITIONS {
        for seed in FIRST_SEED..FIRST_SEED + seeds {
            // Nobody reads an energy account here; without it the motion is the same and costs less.
            scenes.push(load(
                name,
                &[format!("seed={seed}"), "solver.energy=false".into()],
            )?);
        }
    }
    if let Some(folder) = &args.out {
        make_folder(folder)?;
    }
    let stop = super::watch_interrupts("interrupted; nothing was written")?;
    let bar = super::progress(scenes.len() as u64)?;
    let results = run_all(&scenes, args.jobs, stop, || bar.inc(1));
    bar.finish_and_clear();
    if results.len() < scenes.len() {
        bail!(
            "interrupted after {} of {} runs; nothing was written",
            results.len(),
            scenes.len()
        );
    }

    let mut runs = Vec::with_capacity(results.len());
    for (scene, result) in scenes.iter().zip(results) {
        match result {
            Ok(run) => runs.push(run),
            Err(error) => bail!("{} seed {}: {error}", scene.name, scene.seed),
        }
    }
    let mut rest = runs.into_iter();
    let conditions: Vec<Condition> = CONDITIONS
        .iter()
        .map(|name| Condition {
            name,
            runs: rest.by_ref().take(seeds as usize).collect(),
        })
        .collect();

    let text = table(&conditions);
    if let Some(folder) = &args.out {
        // Files hold results alone, so the same study gives the same bytes: the time it took is not among them.
        let mut json = to_json(&conditions, 0.0);
        json.as_object_mut().map(|o| o.remove("wall_s"));
        write_whole(&folder.join("paper.txt"), text.as_bytes())?;
        write_whole(&folder.join("paper.json"), format!("{json:#}\n").as_bytes())?;
        write_whole(&folder.join("runs.csv"), csv(&conditions).as_bytes())?;
        for (stem, figure) in figures(&conditions) {
            figure.write(folder, stem).map_err(anyhow::Error::msg)?;
        }
    }
    let wall_s = began.elapsed().as_secs_f64();
    let result = match args.format {
        Format::Table => text,
        Format::Json => format!("{:#}\n", to_json(&conditions, wall_s)),
    };
    recording::note!(
        "{} runs in {wall_s:.2} s",
        conditions.iter().map(|c| c.runs.len()).sum::<usize>()
    );
    print(&result)
}

/// One line per run.
fn csv(conditions: &[Condition]) -> String {
    let mut out = format!(
        "condition,seed,{},force_correlation,steps,evaluations,events\n",
        KEPT.join(",")
    );
    let cell = |x: Option<f64>| x.map(|v| v.to_string()).unwrap_or_default();
    for condition in conditions {
        for Run {
            seed,
            metrics,
            force_correlation,
            stats,
        } in &condition.runs
        {
            let numbers: Vec<String> = metrics.iter().copied().map(cell).collect();
            out += &format!(
                "{},{seed},{},{},{},{},{}\n",
                condition.name,
                numbers.join(","),
                cell(*force_correlation),
                stats.steps,
                stats.evaluations,
                stats.events
            );
        }
    }
    out
}

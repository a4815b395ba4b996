//! `study paper`: Table 1.

use super::{Args, Format};
use anyhow::{Context, Result, bail};
use indicatif::{ProgressBar, ProgressStyle};
use sim::scene::{Scene, load};
use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use study::ensemble::{KEPT, Run, run_all};
use study::paper::{CONDITIONS, Condition, FIRST_SEED, RUNS, table, to_json};

/// Runs both conditions and prints them beside the paper's table.
pub fn run(args: &Args) -> Result<()> {
    let began = Instant::now();
    let seeds = args.seeds.unwrap_or(RUNS);
    if seeds == 0 {
        bail!("--seeds is 0; at least one run is needed");
    }
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
    static INTERRUPTED: AtomicBool = AtomicBool::new(false);
    ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Relaxed))
        .context("ctrl-C cannot be watched")?;

    let bar = ProgressBar::new(scenes.len() as u64);
    bar.set_style(ProgressStyle::with_template(
        "{wide_bar} {pos}/{len} runs, {eta} left",
    )?);
    let results = run_all(&scenes, args.jobs, || {
        bar.inc(1);
        !INTERRUPTED.load(Ordering::Relaxed)
    })?;
    bar.finish_and_clear();

    let mut runs = Vec::with_capacity(results.len());
    for (scene, result) in scenes.iter().zip(results) {
        match result {
            Some(Ok(run)) => runs.push(run),
            Some(Err(error)) => bail!("{} seed {}: {error}", scene.name, scene.seed),
            None => bail!(
                "interrupted after {} of {} runs; nothing was written",
                runs.len(),
                scenes.len()
            ),
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
        std::fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot be made", folder.display()))?;
        // Files hold results alone, so the same study gives the same bytes: the time it took is not among them.
        let mut json = to_json(&conditions, 0.0);
        json.as_object_mut().map(|o| o.remove("wall_s"));
        write_whole(&folder.join("paper.txt"), text.as_bytes())?;
        write_whole(&folder.join("paper.json"), format!("{json:#}\n").as_bytes())?;
        write_whole(&folder.join("runs.csv"), csv(&conditions).as_bytes())?;
    }
    let wall_s = began.elapsed().as_secs_f64();
    let result = match args.format {
        Format::Table => text,
        Format::Json => format!("{:#}\n", to_json(&conditions, wall_s)),
    };
    eprintln!(
        "{} runs in {wall_s:.2} s",
        conditions.iter().map(|c| c.runs.len()).sum::<usize>()
    );
    match std::io::stdout().lock().write_all(result.as_bytes()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(e.into()),
        _ => Ok(()),
    }
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

/// Writes a file whole or not at all.
fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let part = path.with_extension("part");
    std::fs::write(&part, bytes)
        .and_then(|()| std::fs::rename(&part, path))
        .inspect_err(|_| drop(std::fs::remove_file(&part)))
        .with_context(|| format!("{}: cannot be written", path.display()))
}

//! `study FILE.toml`: a sweep, or a shard of one.

use super::{Format, count, jobs, print, progress, watch_interrupts};
use anyhow::{Result, anyhow, bail};
use recording::text::word;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use study::sweep::Plan;
use study::sweep::known::Known;
use study::sweep::parts::Store;
use study::sweep::shard::Shard;
use study::sweep::summary::Found;

/// Arguments of `study FILE.toml`.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The study file (docs/studies.md).
    file: PathBuf,
    /// Runs of every point, instead of the file's own `seeds`.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = count(1..=u64::MAX))]
    seeds: Option<u64>,
    /// Threads; 0 is one per core. The result does not depend on it.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = jobs, allow_negative_numbers = true)]
    jobs: usize,
    /// The study's folder. Default: the file's name without `.toml`, here.
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Compute only part K of N, and leave what is there already; `merge` puts all parts together.
    /// Slurm and AWS Batch say K and N by themselves, Kubernetes says K. On PBS submit tasks 1 to N and give "$PBS_ARRAY_INDEX/N".
    #[arg(long, value_name = "K/N", value_parser = Shard::parse, allow_hyphen_values = true)]
    shard: Option<Shard>,
    /// N of `--shard`, where the scheduler says only K.
    #[arg(long, value_name = "N", conflicts_with = "shard", value_parser = count(1..=u64::MAX), allow_negative_numbers = true)]
    shards: Option<u64>,
    /// Go on where an earlier run of the same study stopped.
    #[arg(long)]
    resume: bool,
    /// Take over the runs that another study has computed, from its folder: same scene, same seed, same row. So a study gets more seeds, points
    /// or axes and computes only what is new.
    #[arg(long, value_name = "DIR")]
    reuse: Option<PathBuf>,
    /// Draw every metric into figures/ of the study's folder: over one axis, over two, or its distribution.
    #[arg(long)]
    figures: bool,
    /// What to print.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
}

const EXAMPLES: &str = "Examples:
  study tongue.toml
  study tongue.toml --jobs 1 --out results
  study tongue.toml --resume
  study tongue.toml --seeds 100 --out hundred --reuse tongue
  study tongue.toml --shard 3/8 --out /shared/tongue";

/// The folder of a study where none is named.
pub fn folder(file: &Path, out: Option<&PathBuf>) -> PathBuf {
    out.cloned().unwrap_or_else(|| {
        let stem = PathBuf::from(file.file_stem().unwrap_or_default());
        // A study that stands in its own folder goes on there.
        match file.parent() {
            Some(parent) if stem.as_os_str() == "study" && parent.join("parts").is_dir() => {
                match parent.as_os_str().is_empty() {
                    true => ".".into(),
                    false => parent.into(),
                }
            }
            _ => stem,
        }
    })
}

/// Reads a plan; its errors are sentences already.
pub fn plan(file: &Path) -> Result<Plan> {
    Plan::load(file).map_err(anyhow::Error::msg)
}

/// Computes what is missing, and merges when all is there.
pub fn run(args: &Args) -> Result<()> {
    let out = folder(&args.file, args.out.as_ref());
    // The study's own copy knows of `--seeds`.
    let shard = args
        .shard
        .map_or_else(String::new, |s| format!(" --shard {s}"));
    let reuse = args
        .reuse
        .as_ref()
        .map_or_else(String::new, |dir| format!(" --reuse {}", word(dir)));
    let goes_on = format!(
        "`study {} --resume --out {}{shard}{reuse}` goes on",
        word(out.join("study.toml")),
        word(&out)
    );
    let stop = watch_interrupts(format!(
        "interrupted: parts that are whole are kept in {}; {goes_on}",
        out.display()
    ))?;
    let mut plan = plan(&args.file)?;
    if let Some(seeds) = args.seeds {
        plan = plan.with_seeds(seeds).map_err(anyhow::Error::msg)?;
    }
    let sentence = |e: String| anyhow!(e);
    let known = args.reuse.as_ref().map(|dir| Known::load(dir, &plan));
    let known = known.transpose().map_err(sentence)?;
    let store = Store::new(&plan, &out);

    let told = Shard::of_environment(args.shards, |name| std::env::var(name).ok());
    let shard = match &args.shard {
        Some(shard) => Some(*shard),
        None => told.map_err(sentence)?.map(|(shard, name)| {
            recording::note!("shard {shard}, as {name} says");
            shard
        }),
    };
    let mine = shard.unwrap_or(Shard::WHOLE);
    let there = store.progress(mine).map_err(sentence)?;
    if (there.runs > 0 || !there.damaged.is_empty()) && shard.is_none() && !args.resume {
        bail!(
            "{} holds {} of the {} runs of this study; --resume goes on, --out DIR begins elsewhere",
            out.display(),
            there.runs,
            plan.runs()
        );
    }
    let _claim = store.create().map_err(sentence)?;
    let lost = known.as_ref().map(|known| &known.progress.damaged);
    for damaged in there
        .damaged
        .iter()
        .chain(lost.into_iter().flatten())
        .take(20)
    {
        recording::note!("{damaged}: its runs are computed again");
    }

    let began = Instant::now();
    let size = |blocks: &[u64]| -> u64 {
        blocks
            .iter()
            .map(|b| plan.block(*b))
            .map(|r| r.end - r.start)
            .sum()
    };
    let left = size(&there.missing);
    let bar = progress(left)?;
    let (mut finished, mut said) = (0u64, Instant::now());
    let run = |runs| match &known {
        Some(known) => known.complete(&plan, runs, |runs| store.run(runs)),
        None => store.run(runs),
    };
    let written = store
        .fill(&there.missing, args.jobs, stop, run, || {
            bar.inc(1);
            finished += 1;
            // Where there is no terminal, a log gets a line a minute.
            if bar.is_hidden() && said.elapsed() > Duration::from_secs(60) {
                said = Instant::now();
                let rate = finished as f64 / began.elapsed().as_secs_f64();
                recording::note!(
                    "{finished} of {left} runs, {rate:.1}/s, {:.0} s left",
                    (left - finished) as f64 / rate
                );
            }
        })
        .map_err(sentence)?;
    bar.finish_and_clear();
    if stop.load(Ordering::Relaxed) && written.runs < left {
        let (kept, all) = (there.runs + written.runs, there.runs + left);
        match kept {
            0 => bail!("interrupted: none of {all} runs was finished and kept; {goes_on}"),
            _ => bail!(
                "interrupted: {kept} of {all} runs are kept in {}; {goes_on}",
                out.display()
            ),
        }
    }
    let wall_s = began.elapsed().as_secs_f64();
    recording::note!(
        "{} runs in {wall_s:.2} s ({:.1}/s), {} without a result{}{}",
        written.runs,
        written.runs as f64 / wall_s.max(1e-9),
        written.failed,
        match there.runs {
            0 => String::new(),
            n => format!("; {n} were there already"),
        },
        known
            .as_ref()
            .map_or_else(String::new, |known| known.says(written.runs))
    );
    if shard.is_some() {
        recording::note!(
            "`study merge {}` puts the parts together when all are there",
            word(&out)
        );
        return Ok(());
    }
    report(&plan, &store, &out, args.figures, args.format)
}

/// Merges, draws and prints.
pub fn report(plan: &Plan, store: &Store, out: &Path, figures: bool, format: Format) -> Result<()> {
    let summary = store.merge().map_err(anyhow::Error::msg)?;
    if figures {
        let folder = out.join("figures");
        let drawn =
            study::sweep::figures::draw(plan, store, &folder).map_err(anyhow::Error::msg)?;
        let figures = recording::text::counted(drawn as u64, "figure", "figures");
        recording::note!("{}: {figures}", folder.display());
    }
    let table = store.table();
    recording::note!(
        "{}: {} rows; summary.csv beside it",
        table.display(),
        summary.runs
    );
    let indices = study::sweep::sensitivity::indices(plan, &summary);
    print(&match format {
        Format::Table => {
            let mut text = summary.table();
            if let Some(indices) = &indices {
                text += &study::sweep::sensitivity::table(indices);
            }
            text
        }
        Format::Json => format!("{:#}\n", json(plan, &summary, &table, indices.as_ref())),
    })?;
    // Tables of nothing are no success to a script.
    if summary.runs > 0 && summary.failures == summary.runs {
        bail!("none of the {} runs has a result", summary.runs);
    }
    Ok(())
}

fn json(
    plan: &Plan,
    summary: &Found,
    table: &Path,
    indices: Option<&Vec<study::sweep::sensitivity::Index>>,
) -> serde_json::Value {
    let metrics: serde_json::Map<String, serde_json::Value> = summary
        .metrics
        .iter()
        .zip(&summary.ranges)
        .map(|(name, range)| {
            let of = |end: &Option<(f64, _)>| end.as_ref().map(|(x, _)| *x);
            let entry = json!({
                "lowest": of(&range.lowest), "highest": of(&range.highest), "points": range.points, "runs": range.runs,
            });
            (name.clone(), entry)
        })
        .collect();
    json!({
        "study": plan.spec.name,
        "table": table.display().to_string(),
        "points": plan.points(),
        "runs": summary.runs,
        "failed": summary.failures,
        "reasons": summary.reasons,
        "other_reasons": summary.other_reasons(),
        "remarked": summary.remarked,
        "remarks": summary.remarks,
        "metrics": metrics,
        "sensitivity": indices.map(|all| study::sweep::sensitivity::to_json(all)),
    })
}

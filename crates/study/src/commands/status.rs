//! `study status DIR`: how far a study is.

use super::{Format, print, sweep};
use anyhow::{Result, anyhow};
use recording::text::word;
use serde_json::json;
use std::path::PathBuf;
use study::sweep::parts::Store;
use study::sweep::shard::Shard;

/// Arguments of `study status`.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  study status tongue\n  study status tongue --format json")]
pub struct Args {
    /// The study's folder.
    folder: PathBuf,
    /// What to print.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
}

/// Counts the parts.
pub fn run(args: &Args) -> Result<()> {
    let plan = sweep::plan(&args.folder.join("study.toml"))?;
    let store = Store::new(&plan, &args.folder);
    let found = store.progress(Shard::WHOLE).map_err(|e| anyhow!(e))?;
    let parts = plan.blocks() - found.missing.len() as u64;
    let merged = store.is_merged();
    // Neighbouring blocks that are missing, as stretches of runs.
    let mut gaps: Vec<(u64, u64)> = Vec::new();
    for block in &found.missing {
        let runs = plan.block(*block);
        match gaps.last_mut() {
            Some((_, end)) if *end == runs.start => *end = runs.end,
            _ => gaps.push((runs.start, runs.end)),
        }
    }
    print(&match args.format {
        Format::Json => format!(
            "{:#}\n",
            json!({
                "study": plan.spec.name, "runs": plan.runs(), "done": found.runs, "failed": found.failed,
                "parts": parts, "of_parts": plan.blocks(), "missing_runs": gaps, "damaged": found.damaged, "merged": merged,
            })
        ),
        Format::Table => {
            let mut text = format!(
                "{}: {} of {} runs ({:.1} %) in {parts} of {} parts, {} without a result\n",
                plan.spec.name,
                found.runs,
                plan.runs(),
                100.0 * found.runs as f64 / plan.runs() as f64,
                plan.blocks(),
                found.failed
            );
            for (from, to) in gaps.iter().take(10) {
                text += &format!("  missing: runs {from} to {}\n", to - 1);
            }
            if gaps.len() > 10 {
                text += &format!("  and {} more stretches\n", gaps.len() - 10);
            }
            for damaged in found.damaged.iter().take(20) {
                text += &format!("  {damaged}; --resume computes it again\n");
            }
            if gaps.is_empty() && !merged {
                text += &format!(
                    "  complete; `study merge {}` makes the table\n",
                    word(&args.folder)
                );
            } else if merged {
                text += &format!("  merged: {}\n", store.table().display());
            }
            if !merged && store.table().exists() {
                text += &format!(
                    "  {}: is not the table of this study; `study merge` replaces it\n",
                    store.table().display()
                );
            }
            text
        }
    })
}

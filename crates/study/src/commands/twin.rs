//! `study twin`: how far the paper's metrics can be had from sensors alone.

use super::{Format, count, jobs, make_folder, print, progress, watch_interrupts, write_whole};
use anyhow::Result;
use std::path::PathBuf;
use std::time::Instant;
use study::twin::{FIRST_SEED, table, to_json, twins};

/// Arguments of `study twin`.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Seeds of each condition.
    #[arg(long, value_name = "N", default_value_t = 20, allow_negative_numbers = true, value_parser = count(1..=10_000))]
    seeds: u64,
    /// The first of them.
    #[arg(long, value_name = "SEED", default_value_t = FIRST_SEED, allow_negative_numbers = true, value_parser = count(0..=1 << 53))]
    first_seed: u64,
    /// Threads; 0 is one per core. The result does not depend on it.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = jobs, allow_negative_numbers = true)]
    jobs: usize,
    /// A folder for the result's files (twin.txt, twin.json).
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// What to print.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
}

const EXAMPLES: &str = "Examples:
  study twin                        music and baseline, clocks right and off: docs/field.md
  study twin --seeds 3
  study twin --first-seed 2001      others than those by which the intervals were set
  study twin --out results          twin.txt and twin.json
  study twin --format json > twins.json";

/// Simulates the twins and prints how far their sensors are off.
pub fn run(args: &Args) -> Result<()> {
    let began = Instant::now();
    if let Some(folder) = &args.out {
        make_folder(folder)?;
    }
    let stop = watch_interrupts("interrupted; nothing was written")?;
    let bar = progress(args.seeds * study::twin::CONDITIONS.len() as u64)?;
    let found = twins(args.first_seed, args.seeds, args.jobs, stop, || bar.inc(1))
        .map_err(anyhow::Error::msg)?;
    bar.finish_and_clear();
    recording::note!(
        "{} twins in {:.1} s",
        found.iter().map(|f| f.twins.len()).sum::<usize>(),
        began.elapsed().as_secs_f64()
    );
    let text = table(&found);
    let json = format!("{:#}\n", to_json(&found));
    if let Some(folder) = &args.out {
        write_whole(&folder.join("twin.txt"), text.as_bytes())?;
        write_whole(&folder.join("twin.json"), json.as_bytes())?;
    }
    print(match args.format {
        Format::Table => &text,
        Format::Json => &json,
    })
}

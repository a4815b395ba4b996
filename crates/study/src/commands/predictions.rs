//! `study predictions`: what the paper predicts, tried.

use super::{Format, count, jobs, make_folder, print, watch_interrupts, write_whole};
use anyhow::Result;
use clap::builder::PossibleValuesParser;
use indicatif::{ProgressBar, ProgressStyle};
use recording::text::word;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use study::predictions::{EXPERIMENTS, Finding, Lab, SEEDS, page, to_json};

/// Arguments of `study predictions`.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Only these experiments.
    #[arg(value_parser = PossibleValuesParser::new(EXPERIMENTS.iter().map(|e| e.name)))]
    names: Vec<String>,
    /// Seeds of an ensemble, from 1001 on; onsets take four times as many, each cell of the map of locking two.
    #[arg(long, value_name = "N", default_value_t = SEEDS, allow_negative_numbers = true, value_parser = count(2..=100_000))]
    seeds: u64,
    /// Threads; 0 is one per core. The result does not depend on it.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = jobs, allow_negative_numbers = true)]
    jobs: usize,
    /// A folder for predictions.md, predictions.json and the pictures (predictions/*.png), of the experiments that were run; what is there
    /// of others is replaced.
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// What to print.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
}

const EXAMPLES: &str = "Examples:
  study predictions                        all of them
  study predictions locking stability --out results
  study predictions --seeds 5 --format json";

/// Runs the experiments, writes what they found and prints it.
pub fn run(args: &Args) -> Result<()> {
    if let Some(folder) = &args.out {
        make_folder(&folder.join("predictions"))?;
    }
    let findings = find(args)?;
    let json = format!("{:#}\n", to_json(&findings));
    if let Some(folder) = &args.out {
        write(&findings, &json, folder, args.seeds)?;
    }
    print(&match args.format {
        Format::Json => json,
        Format::Table => table(&findings),
    })
}

/// What the experiments that were asked for find, in the paper's order.
fn find(args: &Args) -> Result<Vec<(&'static str, Finding)>> {
    let stop = watch_interrupts("interrupted; nothing was written")?;
    let began = Instant::now();
    let asked = |name: &str| args.names.is_empty() || args.names.iter().any(|n| n == name);
    let mut findings = Vec::new();
    for e in EXPERIMENTS.iter().filter(|e| asked(e.name)) {
        let bar = ProgressBar::new_spinner();
        bar.set_style(ProgressStyle::with_template(
            "{msg}: {pos} pieces of work, {elapsed}",
        )?);
        bar.set_message(e.name);
        bar.enable_steady_tick(Duration::from_secs(1));
        let lab = Lab {
            jobs: args.jobs,
            seeds: args.seeds,
            stop,
            done: &|| bar.inc(1),
        };
        let finding = (e.run)(&lab).map_err(|why| anyhow::anyhow!("{}: {why}", e.name))?;
        bar.finish_and_clear();
        recording::note!(
            "{}: {} ({} pieces of work, {:.0} s so far)",
            e.name,
            finding.verdict.map_or("done", |v| v.word()),
            bar.position(),
            began.elapsed().as_secs_f64()
        );
        findings.push((e.name, finding));
    }
    Ok(findings)
}

/// Page, numbers and pictures: all of the same experiments, be they all or some.
fn write(findings: &[(&str, Finding)], json: &str, folder: &Path, seeds: u64) -> Result<()> {
    let pictures = folder.join("predictions");
    for (stem, _, figure) in findings.iter().flat_map(|(_, f)| &f.pictures) {
        figure.write(&pictures, stem).map_err(anyhow::Error::msg)?;
    }
    let text = page(findings, &word(folder), "predictions", seeds);
    write_whole(&folder.join("predictions.md"), text.as_bytes())?;
    write_whole(&folder.join("predictions.json"), json.as_bytes())
}

/// The findings for people.
fn table(findings: &[(&str, Finding)]) -> String {
    let mut text = String::new();
    for (_, f) in findings {
        text += &format!("{}: {}\n", f.title, f.verdict.map_or("", |v| v.word()));
        for n in &f.numbers {
            text += &format!("  {:<72}{:>10.*} {}\n", n.label, n.digits, n.value, n.unit);
        }
        text += &format!("  {}\n\n", f.because);
    }
    text
}

//! What `study` can do.

mod paper;

use clap::Parser;
use std::path::PathBuf;
use std::process::ExitCode;

/// Runs many scenes and puts them into one table.
#[derive(Parser)]
#[command(name = "study", version, after_help = EXAMPLES)]
pub struct Args {
    /// The study: `paper`.
    name: String,
    /// Seeds per condition, from 1001 on.
    #[arg(long, value_name = "N")]
    seeds: Option<u64>,
    /// Threads; 0 is one per core. The result does not depend on it.
    #[arg(long, value_name = "N", default_value_t = 0)]
    jobs: usize,
    /// A folder for the result's files (paper.json, paper.txt, runs.csv).
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// What to print.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
}

/// What stdout gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// For people.
    Table,
    /// For programs.
    Json,
}

const EXAMPLES: &str = "Examples:
  study paper                       Table 1 of the paper, beside the paper's own
  study paper --format json --jobs 1
  study paper --seeds 5 --out results";

/// Runs the command.
pub fn run() -> ExitCode {
    let args = Args::parse();
    let outcome = match args.name.as_str() {
        "paper" => paper::run(&args),
        other => {
            let hint = sim::scene::nearest(other, ["paper"].into_iter())
                .map(|n| format!(" Did you mean `{n}`?"));
            Err(anyhow::anyhow!(
                "there is no study `{other}`.{} There is: paper",
                hint.unwrap_or_default()
            ))
        }
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("study: {error:#}");
            ExitCode::from(1)
        }
    }
}

//! What `study` can do: one file per subcommand.

mod fit;
mod merge;
mod paper;
mod predictions;
mod status;
mod submit;
mod sweep;
mod twin;

use anyhow::{Context, Result};
use clap::{CommandFactory, Parser, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use std::ffi::OsString;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Runs many scenes and puts them into one table.
#[derive(Parser)]
#[command(name = "study", version, after_help = EXAMPLES)]
struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Table 1 of the paper: both conditions, thirty seeds each.
    Paper(paper::Args),
    /// The paper's predictions, tried: statistics, figures, verdicts.
    Predictions(predictions::Args),
    /// Twins of field recordings: what sensors alone say, beside the truth.
    Twin(twin::Args),
    /// Run a study file: `study FILE.toml` is short for it.
    Run(sweep::Args),
    /// Estimate the model's parameters from recordings, with intervals.
    Fit(fit::Args),
    /// Say how far a study is.
    Status(status::Args),
    /// Put the parts of a study together.
    Merge(merge::Args),
    /// Hand a study to a scheduler.
    Submit(submit::Args),
}

const EXAMPLES: &str = "Examples:
  study paper                              Table 1 of the paper, beside the paper's own
  study predictions                        what the paper predicts, tried
  study twin                               field recordings without force sensors: how far off
  study tongue.toml                        a sweep of your own: results in the folder `tongue`
  study tongue.toml --resume               go on where it stopped
  study tongue.toml --shard 3/8            the third eighth of it, on any machine
  study status tongue
  study merge tongue                       all parts into tongue/runs.parquet
  study submit tongue.toml --tasks 8       the same on Slurm
  study fit music-1001.mcap                beat, pull, contact and roll, with intervals
docs/studies.md says what a study file may hold.

Exit codes: 0 done; 1 it could not; 2 wrong usage; 3 done, but an input was damaged.";

/// Takes a whole number of a range.
fn count(
    range: std::ops::RangeInclusive<u64>,
) -> impl Fn(&str) -> Result<u64, String> + Clone + Send + Sync + 'static {
    move |text| {
        let given = text.parse().ok().filter(|n| range.contains(n));
        given.ok_or_else(|| match (*range.start(), *range.end()) {
            (least, u64::MAX) => format!("expected a whole number, {least} or more"),
            (least, most) => format!("expected a whole number from {least} to {most}"),
        })
    }
}

/// More threads than any machine has cores.
const MOST_JOBS: usize = 100_000;

/// Takes a number of threads.
fn jobs(text: &str) -> Result<usize, String> {
    let given = text.parse().ok().filter(|jobs| *jobs <= MOST_JOBS);
    given.ok_or_else(|| format!("expected a whole number, 0 for one per core, up to {MOST_JOBS}"))
}

/// What stdout gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// For people.
    Table,
    /// For programs.
    Json,
}

/// What was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// As it was written.
    Whole,
    /// With losses; the rest was used.
    Damaged,
}

/// Runs the command; errors go to stderr, one sentence first, then the causes.
pub fn run() -> ExitCode {
    let mut words: Vec<OsString> = std::env::args_os().collect();
    if let Some(first) = words.get(1).map(|w| w.to_string_lossy().into_owned()) {
        if is_file(&first) {
            words.insert(1, "run".into());
        } else if let Some(message) = unknown(&first) {
            recording::note!("study: {message}");
            return ExitCode::from(2);
        }
    }
    let whole = |()| Input::Whole;
    let outcome = match Args::parse_from(words).command {
        Command::Paper(args) => paper::run(&args).map(whole),
        Command::Predictions(args) => predictions::run(&args).map(whole),
        Command::Twin(args) => twin::run(&args).map(whole),
        Command::Run(args) => sweep::run(&args).map(whole),
        Command::Fit(args) => fit::run(&args),
        Command::Status(args) => status::run(&args).map(whole),
        Command::Merge(args) => merge::run(&args).map(whole),
        Command::Submit(args) => submit::run(&args).map(whole),
    };
    match outcome {
        Ok(Input::Whole) => ExitCode::SUCCESS,
        Ok(Input::Damaged) => ExitCode::from(3),
        Err(error) => {
            recording::note!("study: {error:#}");
            ExitCode::from(1)
        }
    }
}

/// Whether a first word is meant as a study file.
fn is_file(word: &str) -> bool {
    let path = Path::new(word);
    !word.starts_with('-')
        && (path.extension().is_some()
            || word.contains(std::path::MAIN_SEPARATOR)
            || path.is_file())
}

/// What to say to a first word that is neither a file nor a command.
fn unknown(word: &str) -> Option<String> {
    let command = Args::command();
    let names = || command.get_subcommands().map(clap::Command::get_name);
    if word.starts_with('-') || word == "help" || names().any(|n| n == word) {
        return None;
    }
    let hint = recording::text::meant::did_you_mean(word, names());
    Some(format!(
        "there is no study `{word}`.{hint} There are: {}; or give the path of a .toml file",
        names().collect::<Vec<_>>().join(", ")
    ))
}

/// A flag that ctrl-C sets; a second ctrl-C says `at_once` and ends the program.
fn watch_interrupts(at_once: impl Into<String>) -> Result<&'static AtomicBool> {
    static INTERRUPTED: AtomicBool = AtomicBool::new(false);
    let at_once = at_once.into();
    ctrlc::set_handler(move || {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            recording::note!("study: {at_once}");
            std::process::exit(1);
        }
        recording::note!(
            "study: stops when the runs under way have ended; ctrl-C again stops at once"
        );
    })
    .context("ctrl-C cannot be watched")?;
    Ok(&INTERRUPTED)
}

/// A bar on a terminal, nothing elsewhere.
fn progress(runs: u64) -> Result<ProgressBar> {
    let bar = ProgressBar::new(runs);
    bar.set_style(ProgressStyle::with_template(
        "{wide_bar} {pos}/{len} runs, {per_sec}, {eta} left",
    )?);
    // The first run may take long.
    bar.enable_steady_tick(Duration::from_secs(1));
    Ok(bar)
}

fn print(text: &str) -> Result<()> {
    Ok(recording::text::print(text)?)
}

fn make_folder(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))
}

/// Writes a file whole or not at all.
fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    study::sweep::parts::write_whole(path, |file| Ok(file.write_all(bytes)?))
        .map_err(anyhow::Error::msg)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_experiment_that_there_is_not_is_wrong_usage() {
        let parsed = |name: &str| Args::try_parse_from(["study", "predictions", name]);
        let said = parsed("lokking").err().unwrap();
        assert_eq!(said.exit_code(), 2);
        assert!(
            said.to_string().contains("similar value exists: 'locking'"),
            "{said}"
        );
        assert!(parsed("locking").is_ok());
    }

    #[test]
    fn seeds_that_cannot_be_counted_up_to_are_refused() {
        let parsed = |flag: &str, n: &str| Args::try_parse_from(["study", "paper", flag, n]);
        for absurd in ["0", "-1", "nan", "1000000000000", "18446744073709551615"] {
            let said = parsed("--seeds", absurd).err().unwrap().to_string();
            let expected = "expected a whole number from 1 to 100000";
            assert!(said.contains(expected), "{absurd}: {said}");
        }
        assert!(parsed("--seeds", "100").is_ok() && parsed("--jobs", "0").is_ok());
        let said = parsed("--jobs", "-1").err().unwrap().to_string();
        assert!(said.contains("expected a whole number, 0 for"), "{said}");
        // Study files are run as many times as is asked.
        let said = Args::try_parse_from(["study", "run", "x.toml", "--seeds", "0"]);
        let said = said.err().unwrap().to_string();
        assert!(
            said.contains("expected a whole number, 1 or more"),
            "{said}"
        );
    }
}

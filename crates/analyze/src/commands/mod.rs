//! The command line: what it takes, and where each part of it goes.

mod analyze;
mod annotate;
mod ingest;
mod merge;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};
use recording::read::ReadOptions;
use recording::text::plain;
use recording::whole::Usage;

const EXAMPLES: &str = "\
Examples:
  analyze music.mcap                              metrics, spectra, events and quality, as a table
  analyze music.mcap --format json                the same for programs
  analyze runs/*.mcap --format csv                one line per file and metric
  analyze bag.mcap --signal '/imu/*' --window 10..70
  analyze bag.mcap --signal '*.angular_velocity.*' --out gyro.csv
  analyze bag.mcap --roles roles.toml             say which signal is roll, height, a force
  analyze run.mcap --report run.html              plots and numbers as one page, for any browser
  analyze run.mcap --figures pictures             the same plots as SVG and PNG
  analyze run.mcap --annotate seen.mcap           the recording with what was found, for any viewer
  analyze ingest logs.npz --out run.mcap          a log of another format becomes a recording
  analyze merge bag/ --out whole.mcap             the parts of a split bag become one recording
  sim record --out - | analyze -                  from standard input

Exit codes: 0 done; 1 it could not; 2 wrong usage; 3 done, but the input was damaged.";

/// What a recording says about how a carried thing moves: metrics, spectra, events, and what is wrong with the data.
#[derive(Parser)]
#[command(name = "analyze", version, after_help = EXAMPLES, args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    args: AnalyzeArgs,
}

#[derive(Subcommand)]
enum Command {
    /// Turn logs of other formats into one recording
    Ingest(ingest::IngestArgs),
    /// Put the parts of a recording together, or recordings of one time
    Merge(merge::MergeArgs),
}

/// How the result is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For people
    Table,
    /// For programs: one object, or an array for several files
    Json,
    /// One line per file and metric
    Csv,
}

#[derive(Args)]
struct AnalyzeArgs {
    /// Recordings (MCAP of any kind); `-` is standard input
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// How to print the result
    #[arg(long, value_enum, default_value = "table")]
    format: Format,
    /// Analyse from A to B, seconds after the first message: 15..60, 15.. or ..60
    #[arg(long, value_name = "A..B", value_parser = ::analyze::window::parse, allow_hyphen_values = true)]
    window: Option<(Option<f64>, Option<f64>)>,
    /// A TOML file that says which signal plays which role
    #[arg(long, value_name = "FILE.toml")]
    roles: Option<PathBuf>,
    /// List these signals, * for anything: '/imu/rath.angular_velocity.x', '*.roll'
    #[arg(long, value_name = "PATH")]
    signal: Vec<String>,
    /// List the signals of these topics only, * for anything
    #[arg(long, value_name = "TOPIC")]
    topic: Vec<String>,
    /// Write the signals to a table; columns are named by their paths (in CSV with their units)
    #[arg(long, short, value_name = "FILE.parquet|.csv")]
    out: Option<PathBuf>,
    /// Write one row of each topic in so many, for --out
    #[arg(long, value_name = "N", default_value_t = 1, requires = "out", value_parser = clap::value_parser!(u64).range(1..))]
    downsample: u64,
    /// Write the recording again with what was found beside it
    #[arg(long, value_name = "FILE.mcap")]
    annotate: Option<PathBuf>,
    /// Write a report: one HTML page with plots, definitions and facts that needs nothing else
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Draw every plot into this folder, as SVG and PNG
    #[cfg(feature = "figures")]
    #[arg(long, value_name = "DIR")]
    figures: Option<PathBuf>,
    /// Judge estimates by the truth that the recording holds
    #[arg(long)]
    truth: bool,
    /// All sensors were stamped by one clock: leave the clocks of carriers and sound as they are
    #[arg(long)]
    one_clock: bool,
    /// Call items of lists by the names they carry, as frames and joints do, and not by their place
    #[arg(long)]
    by_name: bool,
    #[command(flatten)]
    limits: Limits,
}

/// What the reader takes; what is beyond is left out and said.
#[derive(Args)]
#[command(next_help_heading = "Limits of the reader")]
struct Limits {
    /// Leave out chunks that claim more bytes than this, unpacked
    #[arg(long, value_name = "BYTES", default_value_t = ReadOptions::default().max_chunk_bytes, value_parser = limit::<u64>, allow_negative_numbers = true)]
    max_chunk_bytes: u64,
    /// Leave out longer messages in large chunks
    #[arg(long, value_name = "BYTES", default_value_t = ReadOptions::default().max_message_bytes, value_parser = limit::<u64>, allow_negative_numbers = true)]
    max_message_bytes: u64,
    /// List the items of a sequence that has at most so many
    #[arg(long, value_name = "N", default_value_t = ReadOptions::default().max_items, value_parser = limit::<usize>, allow_negative_numbers = true)]
    max_items: usize,
}

/// Takes a limit.
fn limit<N: std::str::FromStr>(text: &str) -> Result<N, String> {
    let given = text.parse();
    given.map_err(|_| "expected a whole number, 0 or more".into())
}

impl AnalyzeArgs {
    /// Whether something is drawn.
    fn draws(&self) -> bool {
        #[cfg(feature = "figures")]
        if self.figures.is_some() {
            return true;
        }
        self.report.is_some()
    }
}

/// How a command ended, when it did.
enum Done {
    /// All well.
    Well,
    /// Done with what was left of a damaged input.
    WithLoss,
    /// Some of the files could not be used; the messages are out.
    Partly,
}

/// Says what a new recording holds, after what there is to say of where it comes from.
fn written(out: &Path, what: &str, notes: &[String], losses: &[String]) -> Done {
    for note in notes.iter().chain(losses) {
        recording::note!("analyze: {note}");
    }
    let out = match out.as_os_str() == "-" {
        true => "standard output".into(),
        false => out.to_string_lossy(),
    };
    recording::note!("analyze: {out} written: {what}");
    match losses.is_empty() {
        true => Done::Well,
        false => Done::WithLoss,
    }
}

/// Parses the command line and runs the command; the exit code is the contract's.
pub fn run() -> ExitCode {
    // Nothing half-written stays behind when the user interrupts.
    let _ = ctrlc::set_handler(|| {
        recording::whole::remove_unfinished_files();
        std::process::exit(130);
    });
    let cli = Cli::parse();
    let result = match &cli.command {
        Some(Command::Ingest(args)) => ingest::run(args),
        Some(Command::Merge(args)) => merge::run(args),
        None => analyze::run(&cli.args),
    };
    match result {
        Ok(Done::Well) => ExitCode::SUCCESS,
        Ok(Done::WithLoss) => ExitCode::from(3),
        Ok(Done::Partly) => ExitCode::FAILURE,
        Err(error) => {
            complain(&error);
            match error.is::<Usage>() {
                true => ExitCode::from(2),
                false => ExitCode::FAILURE,
            }
        }
    }
}

/// One sentence first, then the causes.
fn complain(error: &anyhow::Error) {
    let mut err = std::io::stderr().lock();
    let first = error.to_string();
    let _ = writeln!(err, "analyze: {}", plain(&first));
    let mut said = first;
    for cause in error.chain().skip(1) {
        let cause = cause.to_string();
        // Libraries often put the cause into their own sentence already.
        if !said.contains(&cause) {
            let _ = writeln!(err, "  because: {}", plain(&cause));
        }
        said = cause;
    }
}

fn print(text: &str) -> anyhow::Result<()> {
    Ok(recording::text::print(text)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_sound() {
        Cli::command().debug_assert();
        assert!(Cli::try_parse_from(["analyze"]).is_err());
        assert!(Cli::try_parse_from(["analyze", "a.mcap", "b.mcap", "--window", "15..60"]).is_ok());
        assert!(Cli::try_parse_from(["analyze", "ingest", "logs.npz", "--out", "x.mcap"]).is_ok());
        let error = Cli::try_parse_from(["analyze", "a.mcap", "--windw", "15..60"])
            .err()
            .unwrap()
            .to_string();
        assert!(error.contains("--window"), "{error}");
    }
}

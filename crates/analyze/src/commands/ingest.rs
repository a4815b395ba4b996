//! `analyze ingest FILE... --out FILE.mcap`

use std::path::PathBuf;

use anyhow::bail;
use clap::Args;
use recording::import;
use recording::write::{RecordingWriter, WriterOptions};

use super::Done;

const EXAMPLES: &str = "\
Examples:
  analyze ingest logs.npz --out run.mcap                     a log of the paper's archive
  analyze ingest phone.zip --out walk.mcap                   phyphox or Sensor Logger
  analyze ingest rath.zip left.csv right.csv --out walk.mcap several devices, one recording
  analyze ingest sensor.csv --layout columns.toml --out walk.mcap";

#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct IngestArgs {
    /// Logs: .npz of the archive; .zip, .csv or folders of phone apps and inertial sensors
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The recording to write
    #[arg(long, value_name = "FILE.mcap")]
    out: PathBuf,
    /// How the columns are laid out, where the files do not tell: a built-in name or a TOML file
    #[arg(long, value_name = "NAME|FILE.toml")]
    layout: Option<String>,
}

pub(super) fn run(args: &IngestArgs) -> anyhow::Result<Done> {
    if args.files.contains(&args.out) {
        bail!(
            "{}: is read and cannot be written at the same time",
            args.out.display()
        );
    }
    let mut writer = RecordingWriter::create(&args.out, &WriterOptions::default())?;
    let done = import::ingest(&args.files, args.layout.as_deref(), &mut writer)?;
    writer.finish()?;
    for note in &done.notes {
        eprintln!("analyze: {note}");
    }
    let topics: Vec<String> = done
        .topics
        .iter()
        .map(|(topic, messages)| format!("{topic} ({messages})"))
        .collect();
    eprintln!(
        "analyze: {} written: {}",
        args.out.display(),
        topics.join(", ")
    );
    Ok(Done::Well)
}

//! `analyze ingest FILE... --out FILE.mcap`

use std::path::{Path, PathBuf};

use clap::Args;
use recording::import::{self, ImportError};
use recording::whole::{Output, may_write};
use recording::write::{RecordingWriter, WriterOptions};

use super::{Done, written};

const EXAMPLES: &str = "\
Examples:
  analyze ingest logs.npz --out run.mcap                     a log of the paper's archive
  analyze ingest phone.zip --out walk.mcap                   phyphox or Sensor Logger
  analyze ingest belt.csv --out walk.mcap                    another app or sensor
  analyze ingest rath.zip carrier_1.csv carrier_2.csv --out walk.mcap  several devices, one recording
  analyze ingest rath.zip carrier_1.zip carrier_2.zip drum.wav --out walk.mcap  with sound
  analyze ingest sensor.csv --layout columns.toml --out walk.mcap
  analyze ingest phone.zip --out - | analyze -               nothing is kept

A file's name says whose device it was: carrier, bearer, walker or person in it is somebody who carries. A roles file says otherwise.";

#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct IngestArgs {
    /// Logs: .npz of the archive; .zip, .csv or folders of phone apps and inertial sensors (phyphox, Sensor Logger, SensorLog, Physics
    /// Toolbox, AndroSensor; Movella DOT, Xsens, Shimmer, MetaBase, x-io, Axivity); .wav of a sound recorder
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The recording to write; `-` is standard output
    #[arg(short, long, value_name = "FILE.mcap")]
    out: PathBuf,
    /// How the columns are laid out, where the files do not tell: a TOML file, or a built-in name (docs/recording.md has both)
    #[arg(long, value_name = "NAME|FILE.toml")]
    layout: Option<String>,
    /// When the sound begins after the first inertial sample; taps that both noticed put it right later
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 0.0,
        value_parser = sound_start,
        allow_hyphen_values = true
    )]
    sound_start: f64,
}

/// Takes when the sound begins.
fn sound_start(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.abs() <= 1e6 => Ok(x),
        _ => Err("expected seconds up to 1000000".into()),
    }
}

pub(super) fn run(args: &IngestArgs) -> anyhow::Result<Done> {
    match ingest(args) {
        Err(error) if matches!(error.downcast_ref(), Some(ImportError::Write(e)) if e.reader_left()) => {
            Ok(Done::Well)
        }
        outcome => outcome,
    }
}

fn ingest(args: &IngestArgs) -> anyhow::Result<Done> {
    let output = Output {
        option: "--out",
        path: &args.out,
        endings: &["mcap"],
    };
    let layout = args.layout.iter().map(Path::new);
    let inputs = args.files.iter().map(AsRef::as_ref).chain(layout);
    may_write(&[output], inputs)?;
    let options = import::ImportOptions {
        layout: args.layout.as_deref(),
        sound_start_s: args.sound_start,
    };
    let mut writer = RecordingWriter::to(&args.out, &WriterOptions::default())?;
    let done = import::ingest(&args.files, &options, &mut writer)?;
    writer.finish().map_err(ImportError::Write)?;
    let topics: Vec<String> = done
        .topics
        .iter()
        .map(|(topic, messages)| format!("{topic} ({messages})"))
        .collect();
    Ok(written(
        &args.out,
        &topics.join(", "),
        &done.notes,
        &done.losses,
    ))
}

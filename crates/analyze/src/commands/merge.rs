//! `analyze merge FILE... --out FILE.mcap`

use std::path::PathBuf;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use recording::merge::{MergeError, Parts, Shared, files};
use recording::read::ReadOptions;
use recording::text::counted;
use recording::whole::{Output, may_write};
use recording::write::{RecordingWriter, WriterOptions};

use super::{Done, written};

const EXAMPLES: &str = "\
Examples:
  analyze merge bag_0.mcap bag_1.mcap --out whole.mcap   the parts that a recorder cut a bag into
  analyze merge bag/ --out whole.mcap                    those in a folder, as ROS 2 leaves them
  analyze merge robot.mcap phones.mcap --out both.mcap   two recorders at one time, by one clock
  analyze merge robot.mcap phones.mcap --keep-first --out both.mcap   where both hold /tf, the robot's
  analyze merge bag/ --out - | analyze -                 nothing is kept

Messages, metadata and attachments are taken over as they are, times too. Recordings that hold one topic at one time are refused, as afterwards nothing could tell their messages apart, or with --keep-first taken from the one given first.";

#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct MergeArgs {
    /// Recordings (MCAP), or folders of them, in any order
    #[arg(required = true, value_name = "FILE|FOLDER")]
    files: Vec<PathBuf>,
    /// Takes a topic that two hold at one time from the one given first, and leaves it out of the other
    #[arg(long)]
    keep_first: bool,
    /// The recording to write; `-` is standard output
    #[arg(short, long, value_name = "FILE.mcap")]
    out: PathBuf,
}

pub(super) fn run(args: &MergeArgs) -> anyhow::Result<Done> {
    match merge(args) {
        Err(error) if matches!(error.downcast_ref(), Some(MergeError::Write(e)) if e.reader_left()) => {
            Ok(Done::Well)
        }
        outcome => outcome,
    }
}

fn merge(args: &MergeArgs) -> anyhow::Result<Done> {
    let output = Output {
        option: "--out",
        path: &args.out,
        endings: &["mcap"],
    };
    let files = files(&args.files)?;
    may_write(&[output], files.iter().map(AsRef::as_ref))?;
    let shared = match args.keep_first {
        true => Shared::OfFirst,
        false => Shared::Refused,
    };
    let parts = Parts::open(&files, shared, &ReadOptions::default())?;
    let options = WriterOptions {
        profile: parts.profile().to_owned(),
        ..WriterOptions::beside()
    };
    let mut writer = RecordingWriter::to(&args.out, &options).map_err(MergeError::Write)?;
    // On a terminal only.
    let bar = ProgressBar::new(parts.bytes());
    bar.set_style(ProgressStyle::with_template(
        "{wide_bar} {bytes}/{total_bytes}, {eta} left",
    )?);
    let messages = parts.write(&mut writer, |bytes| bar.inc(bytes))?;
    writer.finish().map_err(MergeError::Write)?;
    bar.finish_and_clear();
    let messages = counted(messages, "message", "messages");
    let what = format!("{messages} of {parts}");
    Ok(written(&args.out, &what, &parts.notes(), &parts.losses()))
}

//! `analyze ingest FILE... --out FILE.mcap`

use std::path::PathBuf;

use clap::Args;

use super::Done;

#[derive(Args)]
pub(super) struct IngestArgs {
    /// Logs: .npz, .csv, .zip
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The recording to write
    #[arg(long, value_name = "FILE.mcap")]
    out: PathBuf,
}

pub(super) fn run(args: &IngestArgs) -> anyhow::Result<Done> {
    let [file] = &args.files[..] else { anyhow::bail!("one archive log makes one recording, but {} were given", args.files.len()) };
    let mut writer = recording::write::RecordingWriter::create(&args.out, &recording::write::WriterOptions::default())?;
    let messages = recording::import::npz::ingest(file, &mut writer)?;
    writer.finish()?;
    eprintln!("analyze: {messages} messages written to {}", args.out.display());
    Ok(Done::Well)
}

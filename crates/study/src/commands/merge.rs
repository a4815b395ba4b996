//! `study merge DIR`: all parts into one table.

use super::{Format, sweep};
use anyhow::Result;
use std::path::PathBuf;
use study::sweep::parts::Store;

/// Arguments of `study merge`.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  study merge tongue\n  study merge tongue --format json")]
pub struct Args {
    /// The study's folder.
    folder: PathBuf,
    /// Draw every metric into figures/ of the study's folder.
    #[arg(long)]
    figures: bool,
    /// What to print.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
}

/// Merges the parts.
pub fn run(args: &Args) -> Result<()> {
    let plan = sweep::plan(&args.folder.join("study.toml"))?;
    let store = Store::new(&plan, &args.folder);
    sweep::report(&plan, &store, &args.folder, args.figures, args.format)
}

//! `sim scenes`: what comes with the program.

use anyhow::{Result, anyhow};
use sim::scene::{BUILTIN, SceneError, builtin, json_schema, load, parse};
use std::io::Write;

/// Arguments of `sim scenes`.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  sim scenes\n  sim scenes music\n  sim scenes music > mine.toml && sim record mine.toml"
)]
pub struct Args {
    /// Print this scene as TOML.
    name: Option<String>,
    /// Print the JSON Schema of scenes, for editors that check TOML.
    #[arg(long, conflicts_with = "name")]
    schema: bool,
}

/// Prints the list, or one scene.
pub fn run(args: &Args) -> Result<()> {
    let mut text = String::new();
    match &args.name {
        Some(name) => match builtin(name) {
            Some(toml) => text += toml,
            // `load` knows how to say that there is no such scene, and which is near.
            None => match load(name, &[]) {
                Err(error @ SceneError::NotFound(_)) => return Err(error.into()),
                _ => {
                    return Err(anyhow!(
                        "`{name}` is a file, not a built-in scene; it prints as it is"
                    ));
                }
            },
        },
        None if args.schema => text = format!("{:#}\n", json_schema()),
        None => {
            let width = BUILTIN
                .iter()
                .map(|(name, _)| name.len())
                .max()
                .unwrap_or(0);
            for (name, toml) in BUILTIN {
                let scene = parse(name, toml, &[])?;
                text += &format!("{name:width$}  {}\n", scene.about);
            }
        }
    }
    // A closed pipe (`sim scenes | head -1`) is no error of ours.
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(e.into()),
        _ => Ok(()),
    }
}

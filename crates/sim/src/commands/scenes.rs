//! `sim scenes`: what comes with the program.

use super::setting;
use anyhow::{Result, anyhow};
use sim::scene::{BUILTIN, SceneError, builtin, json_schema, load, parse, to_toml};

/// Arguments of `sim scenes`.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim scenes
  sim scenes music
  sim scenes music > mine.toml && sim record mine.toml
  sim scenes music --set effects.music.beat_hz=2.3 > faster.toml
  sim scenes --schema > scene.schema.json")]
pub struct Args {
    /// Print this scene as TOML.
    name: Option<String>,
    /// Change a value of the scene, which is then printed with every default; may be repeated.
    #[arg(long, value_name = "KEY=VALUE", value_parser = setting, requires = "name")]
    set: Vec<String>,
    /// Print the JSON Schema of scenes, for editors that check TOML.
    #[arg(long, conflicts_with = "name")]
    schema: bool,
}

/// Prints the list, or one scene.
pub fn run(args: &Args) -> Result<()> {
    let mut text = String::new();
    match &args.name {
        Some(name) if !args.set.is_empty() => text += &to_toml(&load(name, &args.set)?),
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
    super::print(&text)
}

//! The command `sim`.

mod commands;

use clap::Parser;
use std::process::ExitCode;

/// Simulates things that people carry together, and records what happens.
#[derive(Parser)]
#[command(name = "sim", version, arg_required_else_help = true, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: commands::Command,
}

const EXAMPLES: &str = "Examples:
  sim record                              the paper's `music` condition, to music-1001.mcap
  sim record baseline --seed 7 --out b.mcap
  sim record music --set effects.music.beat_hz=2.3 --set effects.hold=false
  sim record --out - | view -             watch a run while it is computed
  sim accuracy music                      what accuracy costs: every method against a reference
  sim replay music-1001.mcap              a recording's carriers drive a scene; how far the motions part
  sim scenes                              the scenes that come with the program
  sim scenes music > mine.toml            a scene to change

Exit codes: 0 done; 1 it could not; 2 wrong usage; 3 done, but the recording to replay was damaged.";

fn main() -> ExitCode {
    commands::run(Cli::parse().command)
}

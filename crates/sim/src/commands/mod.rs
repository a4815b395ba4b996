//! One file per subcommand.

mod accuracy;
mod drum;
mod explain;
mod record;
mod replay;
mod scenes;

use clap::{Subcommand, ValueEnum};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use recording::whole::{Output, Usage};
use serde_json::{Value, json};
use sim::scene::{Scene, SceneError, load};
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

/// What `sim` can do.
#[derive(Subcommand)]
pub enum Command {
    /// Run a scene and write the recording (MCAP).
    Record(record::Args),
    /// Let a recording's carriers and beat drive a scene, and compare the body's motion with the measured one.
    Replay(replay::Args),
    /// Write the drum of a scene as a WAV file; where it has no `effects.drum`, the usual drum sounds.
    Drum(drum::Args),
    /// Say what a scene turns on, what state that needs, and what it costs.
    Explain(explain::Args),
    /// Compare every method's error and time on a scene, or run the hard cases.
    Accuracy(accuracy::Args),
    /// List the built-in scenes, or print one as TOML.
    Scenes(scenes::Args),
}

/// How a command prints its result.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Format {
    Table,
    Json,
}

/// The scene that a command is about.
#[derive(clap::Args)]
struct Asked {
    /// A built-in scene (see `sim scenes`) or the path of a TOML file.
    #[arg(default_value = "music")]
    scene: String,
    #[command(flatten)]
    changes: Changes,
}

impl Asked {
    fn load(&self) -> Result<Scene, SceneError> {
        load(&self.scene, &self.changes.set)
    }
}

/// What is changed in a scene.
#[derive(clap::Args)]
struct Changes {
    /// Change a value of the scene; `effects.NAME=false` takes an effect away, `=true` puts it there with its defaults. May be repeated.
    #[arg(long, value_name = "KEY=VALUE", value_parser = setting)]
    set: Vec<String>,
}

/// A bar that a terminal shows from the second second on, however slowly the work goes on.
fn patient_bar(total: u64, template: &str) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden());
    let style = ProgressStyle::with_template(template);
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    let later = bar.downgrade();
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_secs(1));
        if let Some(bar) = later.upgrade().filter(|bar| !bar.is_finished()) {
            bar.set_draw_target(ProgressDrawTarget::stderr());
            bar.enable_steady_tick(Duration::from_millis(250));
        }
    });
    bar
}

/// Takes a `--set`.
fn setting(text: &str) -> Result<String, String> {
    match text.split_once('=') {
        Some((key, _)) if !key.trim().is_empty() => Ok(text.to_owned()),
        _ => Err("expected KEY=VALUE".into()),
    }
}

/// Takes a number; which ones make sense, the scene's check says.
fn real(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|x| x.is_finite());
    number.ok_or_else(|| "expected a number".into())
}

/// Takes a time within a recording.
fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.abs() <= 1e10 => Ok(x),
        _ => Err("expected a number of seconds, up to 1e10".into()),
    }
}

/// Refuses `-`, which only `sim record` takes for standard output.
fn is_file(out: &Path) -> Result<(), Usage> {
    match out.as_os_str() == "-" {
        true => Err(Usage(
            "--out -: this is written to a file; give it a name".into(),
        )),
        false => Ok(()),
    }
}

/// That `--out` may be written: it is none of the inputs, nor named as something else.
fn may_write(out: &Path, ending: &str, inputs: &[&Path]) -> Result<(), Usage> {
    let output = Output {
        option: "--out",
        path: out,
        endings: &[ending],
    };
    recording::whole::may_write(&[output], inputs.iter().copied())
}

/// Runs a command; errors go to stderr, one sentence first, then the causes.
pub fn run(command: Command) -> ExitCode {
    // Nothing half-written stays behind when the user interrupts; `record` says how far it came, too.
    if !matches!(command, Command::Record(_)) {
        let _ = ctrlc::set_handler(|| {
            recording::whole::remove_unfinished_files();
            std::process::exit(130);
        });
    }
    let outcome = match command {
        Command::Record(args) => record::run(&args),
        Command::Replay(args) => match replay::run(&args) {
            Ok(replay::Input::Damaged) => return ExitCode::from(3),
            other => other.map(|_| ()),
        },
        Command::Drum(args) => drum::run(&args),
        Command::Explain(args) => explain::run(&args),
        Command::Accuracy(args) => accuracy::run(&args),
        Command::Scenes(args) => scenes::run(&args),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            recording::note!("sim: {error:#}");
            // What a flag or a `--set` says is usage; what a file says is not.
            let of_flag = matches!(error.downcast_ref(), Some(SceneError::Value { origin, .. }) if origin.starts_with("--"));
            match of_flag || error.is::<Usage>() {
                true => ExitCode::from(2),
                false => ExitCode::FAILURE,
            }
        }
    }
}

fn print(text: &str) -> anyhow::Result<()> {
    Ok(recording::text::print(text)?)
}

/// A number as JSON has it: null where it is none.
fn number(x: f64) -> Value {
    if x.is_finite() { json!(x) } else { Value::Null }
}

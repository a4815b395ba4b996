//! `sim record`: a scene becomes a recording.

use super::{Asked, patient_bar, real};
use anyhow::{Context, Result, anyhow};
use indicatif::ProgressBar;
use recording::whole::{Usage, remove_unfinished_files};
use recording::write::{RecordingWriter, WriteError, WriterOptions};
use sim::model::Model;
use sim::record::Recorder;
use sim::remarks::Remarks;
use sim::run::{Listener, Sample, method_name, method_of, run_model, settings};
use sim::scene::{SceneError, load};
use sim::sensors::Reading;
use sim::solve::Stopped;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Arguments of `sim record`.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    asked: Asked,
    /// Seed of everything random.
    #[arg(long, value_name = "N", value_parser = seed, allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Where to write; `-` is standard output. Default: SCENE-SEED.mcap here.
    #[arg(long, short, value_name = "FILE.mcap")]
    out: Option<PathBuf>,
    /// Simulated time, s.
    #[arg(long, value_name = "S", value_parser = real, allow_negative_numbers = true)]
    duration: Option<f64>,
    /// Integration method.
    #[arg(long)]
    method: Option<String>,
    /// Tolerance of an adaptive method.
    #[arg(long, value_name = "X", value_parser = real, allow_negative_numbers = true)]
    tolerance: Option<f64>,
}

/// Takes a `--seed`.
fn seed(text: &str) -> Result<u64, String> {
    let seed = text.parse::<u64>().ok().filter(|seed| seed >> 56 == 0);
    seed.ok_or_else(|| "expected a whole number, 0 or more, below 2^56".into())
}

const EXAMPLES: &str = "Examples:
  sim record
  sim record baseline --seed 1002 --out b.mcap
  sim record music --duration 120 --set effects.music.strength_rad_per_s=1.5
  sim record music --method semi-implicit-euler --set solver.step_s=0.001
  sim record --out - | view -";

/// Simulates and records.
pub fn run(args: &Args) -> Result<()> {
    match record(args) {
        Err(error)
            if error
                .downcast_ref::<WriteError>()
                .is_some_and(WriteError::reader_left) =>
        {
            Ok(())
        }
        outcome => outcome,
    }
}

fn record(args: &Args) -> Result<()> {
    let mut settings_given = args.asked.changes.set.clone();
    // The flags are settings like any other, so that they are checked and reported alike.
    let flags = [
        ("--seed", "seed", args.seed.map(|seed| seed.to_string())),
        (
            "--duration",
            "duration_s",
            args.duration.map(|s| format!("{s:?}")),
        ),
        (
            "--method",
            "solver.method",
            args.method.as_ref().map(|m| format!("{m:?}")),
        ),
        (
            "--tolerance",
            "solver.tolerance",
            args.tolerance.map(|x| format!("{x:?}")),
        ),
    ];
    for (flag, key, value) in &flags {
        let Some(value) = value else { continue };
        if args
            .asked
            .changes
            .set
            .iter()
            .any(|s| s.split('=').next().is_some_and(|k| k.trim() == *key))
        {
            let said = format!("{flag} and --set {key} say the same; leave one out");
            return Err(Usage(said).into());
        }
        settings_given.push(format!("{key}={value}"));
    }
    let scene = load(&args.asked.scene, &settings_given).map_err(|error| match error {
        SceneError::Value { origin, message } if origin == "--set" => {
            let given = flags.iter().filter(|(.., value)| value.is_some());
            // Who gave the flag need not know the key that it stands for.
            let mut of_flag = given.filter_map(|(flag, key, _)| {
                let message = message.strip_prefix(key)?.strip_prefix(": ")?;
                Some(((*flag).to_owned(), message.to_owned()))
            });
            let (origin, message) = of_flag.next().unwrap_or((origin, message));
            SceneError::Value { origin, message }
        }
        other => other,
    })?;
    if args.tolerance.is_some() && !method_of(&scene).adaptive {
        let said = format!(
            "--tolerance: {} takes steps of one length, which --set solver.step_s sets",
            scene.solver.method
        );
        return Err(Usage(said).into());
    }

    let interrupted = catch_interrupts()?;
    let to_stdout = args.out.as_deref() == Some(Path::new("-"));
    let path = args
        .out
        .clone()
        .unwrap_or_else(|| file_of(&scene.name, scene.seed));
    super::may_write(&path, "mcap", &[Path::new(&args.asked.scene)])?;
    let options = WriterOptions::beside();
    let writer = RecordingWriter::to(&path, &options)?;

    let began = Instant::now();
    let model = Model::new(&scene);
    let recorder = Recorder::new(&model, writer)?;
    let mut watch = Watch {
        recorder,
        interrupted,
        progress: patient_bar(
            (scene.duration_s * 1e3) as u64,
            "{wide_bar} {percent}% of the scene, {eta} left",
        ),
        samples: 0,
        remarks: Remarks::of(&scene),
    };
    let (stats, outcome) = run_model(&model, method_of(&scene), &settings(&scene), &mut watch);
    watch.progress.finish_and_clear();
    let nothing_left = if to_stdout {
        "the stream ends there"
    } else {
        "no file was made"
    };
    match outcome {
        Ok(()) => watch.recorder.finish()?,
        Err(Stopped::ByObserver { t_s }) if watch.interrupted.load(Ordering::Relaxed) => {
            remove_unfinished_files();
            return Err(anyhow!(
                "interrupted at {t_s:.3} s of {} s; {nothing_left}",
                scene.duration_s
            ));
        }
        // The writer stopped it: `finish` says why.
        Err(Stopped::ByObserver { .. }) => watch.recorder.finish()?,
        Err(error) => {
            return Err(error).with_context(|| {
                format!(
                    "scene `{}` did not run to its end; {nothing_left}",
                    scene.name
                )
            });
        }
    }
    let what = if to_stdout {
        "standard output".to_owned()
    } else {
        path.display().to_string()
    };
    let implicit = match stats.implicit {
        0 => String::new(),
        some if some == stats.steps => " (implicit)".to_owned(),
        some => format!(" ({some} of them implicit, where the contact is stiff)"),
    };
    recording::note!(
        "{what}: {} seed {}, {} s at {} Hz ({} samples); {} in {:.3} s: {} steps{implicit}, {} contact events",
        scene.name,
        scene.seed,
        scene.duration_s,
        scene.log_rate_hz,
        watch.samples,
        method_name(&scene),
        began.elapsed().as_secs_f64(),
        stats.steps,
        stats.events
    );
    for (name, why) in sim::effects::idle(&scene) {
        recording::note!("effects.{name} does nothing: {why}");
    }
    for remark in watch.remarks.said(&scene) {
        recording::note!("{remark}");
    }
    Ok(())
}

/// The file that a scene is recorded to, in this folder whatever it is called.
fn file_of(name: &str, seed: u64) -> PathBuf {
    let plain = |c: char| c.is_alphanumeric() || "-_. ".contains(c);
    let name: String = name
        .chars()
        .map(|c| if plain(c) { c } else { '_' })
        .collect();
    let name = name.trim_start_matches(['.', ' ', '-']);
    let name = if name.is_empty() { "scene" } else { name };
    PathBuf::from(format!("{name}-{seed}.mcap"))
}

/// A flag that ctrl-C sets. The run notices it at its next sample; a second ctrl-C ends the program at once.
fn catch_interrupts() -> Result<&'static AtomicBool> {
    static INTERRUPTED: AtomicBool = AtomicBool::new(false);
    ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            remove_unfinished_files();
            std::process::exit(1);
        }
    })
    .context("ctrl-C cannot be watched")?;
    Ok(&INTERRUPTED)
}

struct Watch<'m> {
    recorder: Recorder<'m>,
    interrupted: &'static AtomicBool,
    progress: ProgressBar,
    samples: u64,
    remarks: Remarks,
}

impl Listener for Watch<'_> {
    fn reading(&mut self, reading: &Reading<'_>) {
        self.recorder.reading(reading);
    }

    fn sample(&mut self, sample: &Sample) -> bool {
        self.samples += 1;
        self.remarks.look(sample);
        self.progress.set_position((sample.t_s * 1e3) as u64);
        !self.interrupted.load(Ordering::Relaxed) && self.recorder.sample(sample)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_is_what_a_scene_takes() {
        let most = (1u64 << 56) - 1;
        assert_eq!(seed(&most.to_string()), Ok(most));
        for text in ["72057594037927936", "99999999999999999999", "-1", "1.5"] {
            assert!(seed(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_name_does_not_lead_out_of_the_folder() {
        for (name, file) in [
            ("music", "music-1.mcap"),
            ("../../x", "_.._x-1.mcap"),
            ("/etc/x", "_etc_x-1.mcap"),
            ("", "scene-1.mcap"),
            ("-", "scene-1.mcap"),
            ("Śrī rath 2", "Śrī rath 2-1.mcap"),
        ] {
            assert_eq!(file_of(name, 1), PathBuf::from(file));
        }
    }
}

//! `study submit FILE.toml`: a job for a scheduler, written and, where the scheduler is here, handed over.

use super::{count, print, sweep, write_whole};
use anyhow::{Context, Result, bail};
use recording::text::word;
use std::path::{Path, PathBuf};
use std::process::Command;
use study::sweep::known::Known;
use study::sweep::parts::Store;

/// Arguments of `study submit`.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The study file.
    file: PathBuf,
    /// The scheduler.
    #[arg(long, value_enum, default_value_t = Engine::Slurm)]
    engine: Engine,
    /// Tasks of the array. Few and long: each starts once and works through its share. Default: 8, or as many as the study has parts.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = count(1..=100_000))]
    tasks: Option<u64>,
    /// Cores, and so threads, of each task.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = count(1..=1024))]
    cpus: u64,
    /// The study's folder, on a disk that all nodes share. Default: as for `study FILE.toml`.
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Take over the runs that another study has computed, as `study FILE.toml --reuse DIR` does.
    #[arg(long, value_name = "DIR")]
    reuse: Option<PathBuf>,
    /// Write the job and do not submit it.
    #[arg(long)]
    dry_run: bool,
    /// More options for sbatch, after `--`: `-- --partition=long --time=10:00:00`.
    #[arg(last = true)]
    options: Vec<String>,
}

/// Tasks where nobody says how many.
const USUAL_TASKS: u64 = 8;

/// The schedulers there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Engine {
    /// An array job.
    Slurm,
}

const EXAMPLES: &str = "Examples:
  study submit tongue.toml --tasks 8
  study submit tongue.toml --tasks 64 --cpus 4 --out /shared/tongue -- --partition=long
  study submit tongue.toml --dry-run       only writes tongue/job.sh

Then `study status tongue`, and `study merge tongue` when all is there. A task that a node takes down with it is \
requeued by Slurm and leaves what it finds done.";

/// Writes the job, and submits it where `sbatch` is.
pub fn run(args: &Args) -> Result<()> {
    let plan = sweep::plan(&args.file)?;
    let out = sweep::folder(&args.file, args.out.as_ref());
    let tasks = args.tasks.unwrap_or(USUAL_TASKS.min(plan.blocks()));
    if tasks > plan.blocks() {
        bail!(
            "--tasks is {}, but this study of {} runs has only {} parts to share out",
            tasks,
            plan.runs(),
            plan.blocks()
        );
    }
    Store::new(&plan, &out)
        .create()
        .map_err(anyhow::Error::msg)?;
    let out = std::path::absolute(&out)?;
    let reuse = match &args.reuse {
        Some(folder) => {
            Known::load(folder, &plan).map_err(anyhow::Error::msg)?;
            format!(" --reuse {}", word(std::path::absolute(folder)?))
        }
        None => String::new(),
    };
    let study = std::env::current_exe().context("this program's own path is not known")?;
    let job = out.join("job.sh");
    let name: String = plan
        .spec
        .name
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '-' })
        .collect();
    // The study's own copy of itself: what is run is what was submitted, whatever becomes of the file. Each task is told of how many it is, so that
    // those that are missing can be submitted again (`sbatch --array=3,5 job.sh`).
    let script = format!(
        "#!/bin/sh\n\
         #SBATCH --job-name=study-{name}\n\
         #SBATCH --array=1-{}\n\
         #SBATCH --cpus-per-task={}\n\
         #SBATCH --requeue\n\
         #SBATCH --open-mode=append\n\
         #SBATCH --output={}\n\
         exec {} run {} --shard \"$SLURM_ARRAY_TASK_ID/{}\" --out {} --jobs \"${{SLURM_CPUS_PER_TASK:-{}}}\"{reuse}\n",
        tasks,
        args.cpus,
        directive(&out.join("task-%a.log"))?,
        word(&study),
        word(out.join("study.toml")),
        tasks,
        word(&out),
        args.cpus
    );
    write_whole(&job, script.as_bytes())?;
    let mut command = Command::new("sbatch");
    command.arg("--parsable").args(&args.options).arg(&job);
    if args.dry_run {
        recording::note!("{} is written; nothing was submitted", job.display());
        let options = args.options.iter().map(word);
        let line: Vec<String> = options.chain([word(&job)]).collect();
        return print(&format!("sbatch {}\n", line.join(" ")));
    }
    match command.output() {
        Ok(done) if done.status.success() => {
            let id = String::from_utf8_lossy(&done.stdout);
            recording::note!(
                "{} runs in {} tasks submitted; `study status {}` says how far they are, `study merge {}` puts them together",
                plan.runs(),
                tasks,
                word(&out),
                word(&out)
            );
            print(&format!("{}\n", id.trim()))
        }
        Ok(done) => bail!(
            "sbatch refused {}: {}",
            job.display(),
            String::from_utf8_lossy(&done.stderr).trim()
        ),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => bail!(
            "there is no `sbatch` here, so {} was written but not submitted; submit it where Slurm is",
            job.display()
        ),
        Err(e) => Err(e).context("sbatch cannot be run"),
    }
}

/// A path in an `#SBATCH` line, which knows double quotes only.
fn directive(path: &Path) -> Result<String> {
    let text = path.display().to_string();
    if text.contains(['"', '\\', '\n']) {
        bail!("{text}: Slurm cannot write its logs into a folder of such a name");
    }
    // A single % begins one of Slurm's patterns.
    Ok(format!("\"{}\"", text.replace('%', "%%")))
}

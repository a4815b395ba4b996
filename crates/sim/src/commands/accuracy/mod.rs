//! `sim accuracy`: error against time for every method, and the hard cases.

mod figure;
mod hard;

use super::{Asked, Format, number, patient_bar, print};
use anyhow::{Context, Result, anyhow};
use recording::whole::write_whole;
use serde_json::{Value, json};
use sim::accuracy::{Judge, Quoted, REFERENCE, Rung, SECOND, Study, study};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;

/// Arguments of `sim accuracy`.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    asked: Asked,
    /// Table for people, or JSON.
    #[arg(long, default_value = "table")]
    format: Format,
    /// Also write table.txt, accuracy.json, runs.csv and work-precision.svg into this folder.
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Timed runs of each setting; the median counts.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..))]
    repeats: u16,
    /// Run the hard cases instead, each by every method that claims it.
    #[arg(long, conflicts_with_all = ["scene", "set", "out", "repeats"])]
    hard: bool,
}

const EXAMPLES: &str = "Examples:
  sim accuracy
  sim accuracy baseline --out accuracy/
  sim accuracy music --set effects.contact.stiffness_n_per_m=3e6
  sim accuracy mine.toml --format json
  sim accuracy --hard";

/// Runs the study and prints it.
pub fn run(args: &Args) -> Result<()> {
    if args.hard {
        return hard::run(args.format == Format::Json);
    }
    let scene = args.asked.load()?;
    // A folder that cannot be is said before minutes are spent.
    if let Some(folder) = &args.out {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    }
    let bar = patient_bar(0, PROGRESS);
    let study = study(&scene, args.repeats.into(), |done, total, what| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
        bar.set_message(what.to_owned());
    });
    bar.finish_and_clear();
    let study = study.map_err(|cause| anyhow!(cause))?;
    let (table, json) = (
        table(&study),
        serde_json::to_string_pretty(&to_json(&study))? + "\n",
    );
    if let Some(folder) = &args.out {
        for (name, text) in [
            ("table.txt", &table),
            ("accuracy.json", &json),
            ("runs.csv", &csv(&study)),
            (
                "work-precision.svg",
                &figure::draw(&study, &args.asked.changes.set),
            ),
        ] {
            let path = folder.join(name);
            write_whole(&path, |file| file.write_all(text.as_bytes()))
                .with_context(|| format!("cannot write {}", path.display()))?;
        }
    }
    let text = if args.format == Format::Json {
        &json
    } else {
        &table
    };
    print(text)
}

/// What a bar says of the work.
const PROGRESS: &str = "{wide_bar} {pos} of {len}, now {msg}";

/// A column of the table: its head, its width, and what it says of a rung.
type Column = (&'static str, usize, fn(&Study, &Rung) -> String);

const COLUMNS: &[Column] = &[
    ("cpu ms", 9, |_, r| format!("{:.3}", r.cpu_s * 1e3)),
    ("wall ms", 9, |_, r| format!("{:.3}", r.wall_s * 1e3)),
    ("evaluations", 12, |_, r| r.stats.evaluations.to_string()),
    ("steps", 9, |_, r| r.stats.steps.to_string()),
    ("rejected", 9, |_, r| r.stats.rejected.to_string()),
    ("events", 7, |_, r| r.stats.events.to_string()),
    ("roll rad", 9, |_, r| small(r.error_roll_rad)),
    ("height m", 9, |_, r| small(r.error_z_m)),
    ("N_i N", 9, |_, r| small(r.error_normal_n)),
    ("others", 9, |_, r| small(r.error_other)),
    ("RMS roll", 9, |s, r| {
        let truth = s.quoted.rms_roll_rad;
        if truth == 0.0 {
            return "-".into();
        }
        small((r.quoted.rms_roll_rad - truth).abs() / truth)
    }),
    ("loss", 9, |s, r| {
        small((r.quoted.contact_loss - s.quoted.contact_loss).abs())
    }),
    ("onset s", 9, |s, r| {
        match (r.quoted.onset_s, s.quoted.onset_s) {
            (Some(a), Some(b)) => small((a - b).abs()),
            (None, None) => "-".into(),
            (Some(_), None) => "false".into(),
            (None, Some(_)) => "missed".into(),
        }
    }),
    ("T_float", 9, |s, r| {
        small((r.quoted.t_float - s.quoted.t_float).abs())
    }),
    ("energy", 9, |_, r| r.unexplained.map_or("-".into(), small)),
];

fn small(x: f64) -> String {
    if x == 0.0 {
        "0".into()
    } else {
        format!("{x:.1e}")
    }
}

fn table(study: &Study) -> String {
    let q = &study.quoted;
    let onset = q.onset_s.map_or("none".into(), |t| format!("{t:.2} s"));
    let mut out = format!(
        "{}, {} s\nreferences: {} at {:e} and {} at {:e}; {}\nthe reference quotes RMS roll {:.4}°, contact loss {:.4}, onset {onset}, T_float {:.4}\n\n",
        study.scene,
        study.duration_s,
        REFERENCE.0,
        REFERENCE.1,
        SECOND.0,
        SECOND.1,
        study.agreement(),
        q.rms_roll_rad.to_degrees(),
        q.contact_loss,
        q.t_float
    );
    let _ = write!(out, "  {:<20} {:<15}", "method", "setting");
    for (head, width, _) in COLUMNS {
        let _ = write!(out, " {head:>width$}");
    }
    out.push('\n');
    for (i, r) in study.runs.iter().enumerate() {
        let front = if study.front.contains(&i) { '*' } else { ' ' };
        let _ = write!(out, "{front} {:<20} {:<15}", r.method, r.setting_text());
        if let Some(cause) = &r.failed {
            let _ = writeln!(out, " failed: {cause}");
            continue;
        }
        for (_, width, of) in COLUMNS {
            let _ = write!(out, " {:>width$}", of(study, r));
        }
        out.push('\n');
    }
    let (what, unit) = study.judge.name();
    let _ = writeln!(
        out,
        "\n* no other setting is both faster and closer in {what} ({unit}).\n\
         cpu, wall: medians of warm runs, on the processor and by the wall; the first ranks. roll, height, N_i, others (x, y in m, pitch, yaw in rad): largest\n\
         error of any sample. RMS roll: relative error; loss, onset, T_float: difference; both over the analysis window (docs/metrics.md). energy: unexplained over throughput.\n\n{}.\n{}.",
        capital(&study.sentence()),
        capital(&study.archive_sentence())
    );
    out
}

fn capital(sentence: &str) -> String {
    let mut letters = sentence.chars();
    let first = letters.next().map(|c| c.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}

fn quoted(q: &Quoted) -> Value {
    json!({
        "rms_roll_deg": q.rms_roll_rad.to_degrees(), "contact_loss_mean": q.contact_loss,
        "onset_time_s": q.onset_s, "t_float": q.t_float,
    })
}

fn rung(r: &Rung) -> Value {
    json!({
        "method": r.method, "setting": r.setting, "adaptive": r.adaptive, "wall_s": r.wall_s, "cpu_s": r.cpu_s,
        "evaluations": r.stats.evaluations, "steps": r.stats.steps, "rejected": r.stats.rejected, "events": r.stats.events,
        "error_roll_rad": number(r.error_roll_rad), "error_z_m": number(r.error_z_m), "error_normal_n": number(r.error_normal_n),
        "error_other": number(r.error_other),
        "quoted": quoted(&r.quoted), "energy_unexplained": r.unexplained.map(number), "failed": r.failed,
    })
}

/// The wishes that `recommend` answers, rad or m, of what is ranked by and of x, y, pitch and yaw.
const WISHES: [(&str, f64); 3] = [("1e-3", 1e-3), ("1e-6", 1e-6), ("1e-9", 1e-9)];

fn to_json(study: &Study) -> Value {
    let recommend: serde_json::Map<String, Value> = WISHES
        .iter()
        .map(|(name, error)| {
            (
                (*name).into(),
                study.cheapest(*error).map_or(Value::Null, rung),
            )
        })
        .collect();
    json!({
        "scene": study.scene,
        "duration_s": study.duration_s,
        "judged_s": study.judged_s,
        "reference": {
            "method": REFERENCE.0, "tolerance": REFERENCE.1,
            "second": {"method": SECOND.0, "tolerance": SECOND.1},
            "estimated_error": study.estimated_error_rad, "estimated_error_z_m": study.estimated_error_m,
            "estimated_error_other": study.estimated_error_other,
            "quoted": quoted(&study.quoted),
        },
        "ranked_by": match study.judge { Judge::Roll => "error_roll_rad", Judge::Height => "error_z_m", Judge::Other => "error_other", Judge::Nothing => "nothing" },
        "runs": study.runs.iter().map(rung).collect::<Vec<_>>(),
        "front": study.front.iter().map(|&i| rung(&study.runs[i])).collect::<Vec<_>>(),
        "recommend": recommend,
        "cost_of_a_digit": study.cost_of_a_digit(),
        "finding": study.sentence(),
        "archive": study.archive_sentence(),
    })
}

fn csv(study: &Study) -> String {
    let mut out = String::from(
        "method,setting,wall_s,cpu_s,evaluations,steps,rejected,events,error_roll_rad,error_z_m,error_normal_n,error_other,rms_roll_deg,contact_loss_mean,onset_time_s,t_float,energy_unexplained,failed\n",
    );
    let or_empty = |x: Option<f64>| {
        x.filter(|x| x.is_finite())
            .map_or(String::new(), |x| format!("{x:e}"))
    };
    for r in &study.runs {
        let cells = [
            r.method.to_owned(),
            format!("{:e}", r.setting),
            format!("{:e}", r.wall_s),
            format!("{:e}", r.cpu_s),
            r.stats.evaluations.to_string(),
            r.stats.steps.to_string(),
            r.stats.rejected.to_string(),
            r.stats.events.to_string(),
            or_empty(Some(r.error_roll_rad)),
            or_empty(Some(r.error_z_m)),
            or_empty(Some(r.error_normal_n)),
            or_empty(Some(r.error_other)),
            or_empty(Some(r.quoted.rms_roll_rad.to_degrees())),
            or_empty(Some(r.quoted.contact_loss)),
            or_empty(r.quoted.onset_s),
            or_empty(Some(r.quoted.t_float)),
            or_empty(r.unexplained),
            r.failed.as_ref().map_or(String::new(), |why| {
                format!("\"{}\"", why.replace('"', "\"\""))
            }),
        ];
        let _ = writeln!(out, "{}", cells.join(","));
    }
    out
}

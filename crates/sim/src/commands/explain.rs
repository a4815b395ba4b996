//! `sim explain`: what a scene turns on, what state that needs, and what it costs.

use anyhow::Result;
use clap::ValueEnum;
use serde_json::{Value, json};
use sim::effects::TABLE;
use sim::model::Model;
use sim::run::Sample;
use sim::scene::{Freedom, Scene, load};
use std::io::Write;
use std::time::Instant;

/// Arguments of `sim explain`.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A built-in scene or the path of a TOML file.
    #[arg(default_value = "music")]
    scene: String,
    /// Change a value of the scene; may be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Table for people, or JSON.
    #[arg(long, default_value = "table")]
    format: Format,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Format {
    Table,
    Json,
}

const EXAMPLES: &str = "Examples:
  sim explain
  sim explain eight-carriers --format json
  sim explain music --set 'freedom=[\"height\", \"roll\"]'";

/// Longest stretch that the trials of `freedoms` simulate, s.
const TRIAL_S: f64 = 20.0;

struct Effect {
    name: &'static str,
    about: &'static str,
    on: bool,
    adds_state: usize,
    cost_ns: Option<f64>,
}

struct Trial {
    name: String,
    /// RMS about the mean: m or rad.
    excursion: f64,
    /// Worst differences in roll and height when it is held, or why there are none.
    held: Result<(f64, f64), String>,
}

/// Explains a scene.
pub fn run(args: &Args) -> Result<()> {
    let scene = load(&args.scene, &args.set)?;
    let model = Model::new(&scene);
    let rhs_ns = cost_ns(&model);
    let effects: Vec<Effect> = TABLE
        .iter()
        .map(|e| {
            let on = (e.is_on)(&scene.effects);
            let (mut adds_state, mut cost) = (0, None);
            if on {
                let mut without = scene.clone();
                (e.switch_off)(&mut without.effects);
                // An effect that another one needs cannot be taken out alone.
                if sim::scene::check(&without).is_ok() {
                    let smaller = Model::new(&without);
                    adds_state = model
                        .layout()
                        .size()
                        .saturating_sub(smaller.layout().size());
                    cost = Some(rhs_ns - cost_ns(&smaller));
                }
            }
            Effect {
                name: e.name,
                about: e.about,
                on,
                adds_state,
                cost_ns: cost,
            }
        })
        .collect();
    let (trials, ms_per_s) = try_freedoms(&scene);
    let mut out = std::io::stdout().lock();
    match args.format {
        Format::Json => {
            serde_json::to_writer_pretty(
                &mut out,
                &as_json(&scene, &model, &effects, &trials, rhs_ns, ms_per_s),
            )?;
            writeln!(out)?;
        }
        Format::Table => print(
            &mut out, &scene, &model, &effects, &trials, rhs_ns, ms_per_s,
        )?,
    }
    Ok(())
}

/// Cost of one right-hand side at the scene's start, ns: the least of several means, which noise can only raise.
fn cost_ns(model: &Model) -> f64 {
    let (y, mut w) = (model.initial_state(), model.workspace());
    model.begin_segment(0.0, &mut w);
    let mut dy = vec![0.0; y.len()];
    let calls = (400_000 / (y.len() + 20)).clamp(10, 5000);
    (0..15)
        .map(|_| {
            let began = Instant::now();
            for _ in 0..calls {
                model.rhs(std::hint::black_box(0.0), &y, &mut dy, &mut w);
                std::hint::black_box(&dy);
            }
            began.elapsed().as_secs_f64() * 1e9 / calls as f64
        })
        .fold(f64::INFINITY, f64::min)
}

/// Roll and height of every sample, and the six coordinates.
fn motion(scene: &Scene) -> Result<Vec<[f64; 6]>, String> {
    let mut all = Vec::new();
    sim::run::run(scene, &mut |s: &Sample| {
        let ([x, y, z], [roll, tilt, yaw]) = (s.pose.position_m, s.roll_pitch_yaw_rad);
        all.push([
            x - scene.carriers.walk_m_per_s[0] * s.t_s,
            y - scene.carriers.walk_m_per_s[1] * s.t_s,
            z,
            roll,
            tilt,
            yaw,
        ]);
        true
    })
    .map_err(|e| e.to_string())?;
    Ok(all)
}

/// Runs the scene as it is, then with each freedom held; also the cost of a simulated second, ms.
fn try_freedoms(scene: &Scene) -> (Vec<Trial>, f64) {
    let mut scene = scene.clone();
    scene.duration_s = scene.duration_s.min(TRIAL_S);
    scene.effects.imu = None;
    let began = Instant::now();
    let Ok(full) = motion(&scene) else {
        return (Vec::new(), f64::NAN);
    };
    let ms_per_s = began.elapsed().as_secs_f64() * 1e3 / scene.duration_s;
    let trials = Freedom::ALL
        .iter()
        .enumerate()
        .filter(|(_, f)| scene.freedom.contains(f))
        .map(|(i, f)| {
            let mean = full.iter().map(|s| s[i]).sum::<f64>() / full.len() as f64;
            let excursion = (full.iter().map(|s| (s[i] - mean).powi(2)).sum::<f64>()
                / full.len() as f64)
                .sqrt();
            let mut fewer = scene.clone();
            fewer.freedom.retain(|g| g != f);
            let held = sim::scene::check(&fewer)
                .map_err(|p| p.message)
                .and_then(|()| motion(&fewer))
                .map(|held| {
                    let worst = |c: usize| {
                        full.iter()
                            .zip(&held)
                            .map(|(a, b)| (a[c] - b[c]).abs())
                            .fold(0.0, f64::max)
                    };
                    (worst(3), worst(2))
                });
            Trial {
                name: format!("{f:?}").to_lowercase(),
                excursion,
                held,
            }
        });
    (trials.collect(), ms_per_s)
}

fn number(x: f64) -> Value {
    if x.is_finite() { json!(x) } else { Value::Null }
}

fn as_json(
    scene: &Scene,
    model: &Model,
    effects: &[Effect],
    trials: &[Trial],
    rhs_ns: f64,
    ms_per_s: f64,
) -> Value {
    json!({
        "scene": scene.name,
        "state": { "size": model.layout().size(), "names": model.state_names() },
        "effects": effects.iter().map(|e| json!({
            "name": e.name,
            "on": e.on,
            "adds_state": e.adds_state,
            "cost_ns": e.cost_ns.map_or(Value::Null, number),
        })).collect::<Vec<_>>(),
        "rhs_ns": number(rhs_ns),
        "ms_per_simulated_s": number(ms_per_s),
        "freedoms": trials.iter().map(|t| json!({
            "name": t.name,
            "rms": number(t.excursion),
            "held_error_roll_rad": t.held.as_ref().map_or(Value::Null, |h| number(h.0)),
            "held_error_z_m": t.held.as_ref().map_or(Value::Null, |h| number(h.1)),
            "reason": t.held.as_ref().err(),
        })).collect::<Vec<_>>(),
    })
}

fn print(
    out: &mut impl Write,
    scene: &Scene,
    model: &Model,
    effects: &[Effect],
    trials: &[Trial],
    rhs_ns: f64,
    ms_per_s: f64,
) -> std::io::Result<()> {
    writeln!(out, "{}: {}", scene.name, scene.about)?;
    writeln!(
        out,
        "\n{:<18} {:<4} {:>6} {:>9}  what it is",
        "effect", "", "states", "cost, ns"
    )?;
    for e in effects {
        let cost = e.cost_ns.map_or(String::new(), |c| format!("{c:.0}"));
        let states = if e.on {
            e.adds_state.to_string()
        } else {
            String::new()
        };
        writeln!(
            out,
            "{:<18} {:<4} {states:>6} {cost:>9}  {}",
            e.name,
            if e.on { "on" } else { "-" },
            e.about
        )?;
    }
    writeln!(
        out,
        "\none right-hand side: {rhs_ns:.0} ns; a simulated second: {ms_per_s:.3} ms (one core)"
    )?;
    let names = model.state_names();
    writeln!(out, "state, {}: {}", names.len(), shortened(&names))?;
    writeln!(
        out,
        "\n{:<8} {:>12}  held instead: worst error within {:.0} s",
        "freedom",
        "RMS",
        scene.duration_s.min(TRIAL_S)
    )?;
    for (i, t) in trials.iter().enumerate() {
        let linear = ["x", "y", "height"].contains(&t.name.as_str());
        let excursion = if linear {
            format!("{:.4} m", t.excursion)
        } else {
            format!("{:.3} deg", t.excursion.to_degrees())
        };
        let held = match &t.held {
            Ok((roll, z)) => format!("roll {:.3} deg, height {:.5} m", roll.to_degrees(), z),
            Err(reason) => reason.clone(),
        };
        writeln!(out, "{:<8} {excursion:>12}  {held}", trials[i].name)?;
    }
    Ok(())
}

fn shortened(names: &[String]) -> String {
    const MOST: usize = 40;
    if names.len() <= MOST {
        return names.join(", ");
    }
    format!(
        "{}, ... {} more",
        names[..MOST].join(", "),
        names.len() - MOST
    )
}

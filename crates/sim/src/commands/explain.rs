//! `sim explain`: what a scene turns on, what state that needs, and what it costs.

use super::{Asked, Format, number};
use anyhow::Result;
use serde_json::{Value, json};
use sim::effects::{Entry, TABLE};
use sim::freedoms::nearest_turn;
use sim::model::Model;
use sim::run::{Listener, Sample, method_of, run_model, settings};
use sim::scene::{Freedom, Scene};
use sim::solve::Settings;
use std::borrow::Cow;
use std::fmt::Write;
use std::time::Instant;

/// Arguments of `sim explain`.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    asked: Asked,
    /// Table for people, or JSON.
    #[arg(long, default_value = "table")]
    format: Format,
}

const EXAMPLES: &str = "Examples:
  sim explain
  sim explain eight-carriers --format json
  sim explain music --set 'freedom=[\"height\", \"roll\"]'";

/// Longest stretch that a trial simulates, s, how long one should take at most, and after how long it is given up, s.
const TRIAL_S: f64 = 20.0;
const TRIAL_WALL_S: f64 = 1.0;
const GIVEN_UP_S: f64 = 2.0;
/// A shorter trial says nothing of the motion, s.
const TELLING_S: f64 = 1.0;
/// A freedom whose absence changes less than this is named as one that could be held: rad and m.
const LITTLE: (f64, f64) = (0.017_453, 0.005);
/// Motions are compared at least so often, Hz, however seldom the scene is logged.
const LOOKED_AT_HZ: f64 = 30.0;

struct Effect {
    name: &'static str,
    about: &'static str,
    on: bool,
    idle: Option<Cow<'static, str>>,
    adds_state: usize,
    cost_ns: Option<f64>,
    /// Cost of a simulated second of the scene without it, ms; `None` where the trial failed.
    without_ms: Option<f64>,
}

/// What the trials of one scene found.
struct Findings {
    scene: Scene,
    model: Model,
    effects: Vec<Effect>,
    freedoms: Vec<Trial>,
    rhs_ns: f64,
    /// Cost of a simulated second, or why even the shortest trial failed.
    ms_per_s: Result<f64, String>,
    trial_s: f64,
    /// Why no longer stretch was tried, where one failed or would have taken too long.
    failed: Option<String>,
}

struct Trial {
    name: String,
    /// Standard deviation, m or rad, whole turns counted.
    deviation: f64,
    /// Worst differences in roll and height when it is held, or why there are none.
    held: Result<(f64, f64), String>,
}

/// Explains a scene.
pub fn run(args: &Args) -> Result<()> {
    let found = explore(args.asked.load()?);
    super::print(&match args.format {
        Format::Json => format!("{:#}\n", as_json(&found)),
        Format::Table => as_table(&found),
    })
}

fn explore(scene: Scene) -> Findings {
    let model = Model::new(&scene);
    let [rhs_ns] = cost_ns([&model]);
    let most = (GIVEN_UP_S * 1e9 / rhs_ns) as u64;
    // A short beginning, and ever longer ones, tell how long a trial may be.
    let most_s = scene.duration_s.min(TRIAL_S);
    let mut trial = scene.clone();
    trial.duration_s = most_s.min(1e-3);
    let [mut ms] = ms_per_s([&trial], most);
    let mut failed = None;
    while let Ok(found) = ms {
        let wall_s = found / 1e3 * trial.duration_s;
        if wall_s >= 0.1 * TRIAL_WALL_S || trial.duration_s >= most_s {
            break;
        }
        let mut longer = trial.clone();
        longer.duration_s = most_s.min(4.0 * trial.duration_s);
        match ms_per_s([&longer], most) {
            [Ok(found)] => (trial, ms) = (longer, Ok(found)),
            // Up to here it went well.
            [Err(why)] => {
                failed = Some(why);
                break;
            }
        }
    }
    let tells = trial.duration_s >= TELLING_S.min(scene.duration_s);
    if let (Ok(ms), false, None) = (&ms, tells, &failed) {
        failed = Some(format!(
            "{} s of the motion took {:.1} s already, more was too dear to try",
            (trial.duration_s * 1e3).round() / 1e3,
            ms / 1e3 * trial.duration_s
        ));
    }
    let effects = TABLE
        .iter()
        .map(|e| {
            let mut effect = Effect {
                name: e.name,
                about: e.about,
                on: (e.is_on)(&scene.effects),
                idle: (e.idle)(&scene),
                adds_state: 0,
                cost_ns: None,
                without_ms: None,
            };
            if let Some((with, without)) = pair_about(e, &trial).filter(|_| effect.on) {
                let (a, b) = (Model::new(&with), Model::new(&without));
                effect.adds_state = a.layout().size() - b.layout().size();
                let [a, b] = cost_ns([&a, &b]);
                effect.cost_ns = Some(a - b);
                // In proportion, where the scene with it alone is not the whole.
                if let Ok(ms) = &ms
                    && let [Ok(with_ms), Ok(without_ms)] = ms_per_s([&with, &without], most)
                {
                    effect.without_ms = Some(ms * without_ms / with_ms);
                }
            }
            effect
        })
        .collect();
    Findings {
        rhs_ns,
        freedoms: match ms {
            Ok(_) if tells => try_freedoms(&trial, most),
            _ => Vec::new(),
        },
        trial_s: trial.duration_s,
        failed,
        ms_per_s: ms,
        effects,
        model,
        scene,
    }
}

/// The scene with and without an effect; where another effect needs it, both without that other.
fn pair_about(effect: &Entry, scene: &Scene) -> Option<(Scene, Scene)> {
    let without = |scene: &Scene, e: &Entry| {
        let mut fewer = scene.clone();
        (e.switch_off)(&mut fewer.effects);
        fewer
    };
    let legal = |scene: &Scene| sim::scene::check(scene).is_ok();
    std::iter::once(scene.clone())
        .chain(TABLE.iter().map(|other| without(scene, other)))
        .map(|with| {
            let fewer = without(&with, effect);
            (with, fewer)
        })
        .find(|(with, fewer)| legal(with) && legal(fewer))
}

/// Cost of one right-hand side of each model, ns, in the middle of its scene, by turns: the least of several means, which noise can only raise.
fn cost_ns<const N: usize>(models: [&Model; N]) -> [f64; N] {
    let mut least = [f64::INFINITY; N];
    let mut runs = models.map(|model| {
        let t_s = 0.5 * model.scene.duration_s;
        let (y, mut w) = (model.initial_state(), model.workspace());
        model.begin_segment(t_s, &mut w);
        let dy = vec![0.0; y.len()];
        (model, t_s, y, dy, w)
    });
    for _ in 0..25 {
        for ((model, t_s, y, dy, w), least) in runs.iter_mut().zip(&mut least) {
            let calls = (400_000 / (y.len() + 20)).clamp(10, 3000);
            let began = Instant::now();
            for _ in 0..calls {
                model.rhs(std::hint::black_box(*t_s), y, dy, w);
                std::hint::black_box(&dy);
            }
            *least = least.min(began.elapsed().as_secs_f64() * 1e9 / calls as f64);
        }
    }
    least
}

/// Runs a scene for so many evaluations at most.
fn attempt(scene: &Scene, most: u64, listener: &mut dyn Listener) -> Result<(), String> {
    let settings = Settings {
        most_evaluations: most,
        ..settings(scene)
    };
    let (_, outcome) = run_model(&Model::new(scene), method_of(scene), &settings, listener);
    outcome.map_err(|e| e.to_string())
}

/// Cost of a simulated second of each scene with its instruments, ms, by turns: the best of two runs or more; or why one fails.
fn ms_per_s<const N: usize>(scenes: [&Scene; N], most: u64) -> [Result<f64, String>; N] {
    let began = Instant::now();
    let mut least = [const { Ok(f64::INFINITY) }; N];
    for round in 0..10 {
        for (scene, least) in scenes.iter().zip(&mut least) {
            let Ok(so_far) = *least else { continue };
            let began = Instant::now();
            *least = attempt(scene, most, &mut |_: &Sample| true)
                .map(|()| so_far.min(began.elapsed().as_secs_f64() * 1e3 / scene.duration_s));
        }
        if round > 0 && began.elapsed().as_secs_f64() > 0.1 {
            break;
        }
    }
    least
}

/// The six coordinates in every sample; roll and yaw go on beyond half a turn.
fn motion(scene: &Scene, most: u64) -> Result<Vec<[f64; 6]>, String> {
    let mut all: Vec<[f64; 6]> = Vec::new();
    attempt(scene, most, &mut |s: &Sample| {
        let ([x, y, z], [mut roll, tilt, mut yaw]) =
            (s.pose.position_m, s.pose.roll_pitch_yaw_rad());
        if let Some(last) = all.last() {
            (roll, yaw) = (nearest_turn(roll, last[3]), nearest_turn(yaw, last[5]));
        }
        all.push([
            x - scene.carriers.walk_m_per_s[0] * s.t_s,
            y - scene.carriers.walk_m_per_s[1] * s.t_s,
            z,
            roll,
            tilt,
            yaw,
        ]);
        true
    })?;
    Ok(all)
}

/// Runs the scene as it is, then with each freedom held.
fn try_freedoms(scene: &Scene, most: u64) -> Vec<Trial> {
    let mut scene = scene.clone();
    // Instruments watch a motion and change none.
    for effect in TABLE.iter().filter(|e| ["imu", "drum"].contains(&e.name)) {
        (effect.switch_off)(&mut scene.effects);
    }
    scene.log_rate_hz = scene.log_rate_hz.max(LOOKED_AT_HZ);
    let Ok(full) = motion(&scene, most) else {
        return Vec::new();
    };
    Freedom::ALL
        .iter()
        .enumerate()
        // With the only one held nothing would move.
        .filter(|(_, f)| scene.freedom.contains(f) && scene.freedom.len() > 1)
        .map(|(i, f)| {
            let count = full.len() as f64;
            let mean = full.iter().map(|s| s[i]).sum::<f64>() / count;
            let square = full.iter().map(|s| (s[i] - mean).powi(2)).sum::<f64>();
            let mut fewer = scene.clone();
            fewer.freedom.retain(|g| g != f);
            fewer.keep_to_freedoms();
            let held = sim::scene::check(&fewer)
                .map_err(|p| p.message)
                .and_then(|()| motion(&fewer, most))
                .map(|held| {
                    let worst = |apart: &dyn Fn(&[f64; 6], &[f64; 6]) -> f64| {
                        full.iter()
                            .zip(&held)
                            .map(|(a, b)| apart(a, b).abs())
                            .fold(0.0, f64::max)
                    };
                    // Angles a turn apart are the same.
                    let roll = |a: &[f64; 6], b: &[f64; 6]| nearest_turn(a[3] - b[3], 0.0);
                    (worst(&roll), worst(&|a, b| a[2] - b[2]))
                });
            Trial {
                name: format!("{f:?}").to_lowercase(),
                deviation: (square / count).sqrt(),
                held,
            }
        })
        .collect()
}

fn as_json(found: &Findings) -> Value {
    json!({
        "scene": found.scene.name,
        "state": { "size": found.model.layout().size(), "names": found.model.state_names() },
        "effects": found.effects.iter().map(|e| json!({
            "name": e.name,
            "on": e.on,
            "idle": e.idle,
            "adds_state": e.adds_state,
            "cost_ns": e.cost_ns.map_or(Value::Null, number),
            "share": e.cost_ns.map_or(Value::Null, |c| number(c / found.rhs_ns)),
            "without_ms_per_simulated_s": e.without_ms.map_or(Value::Null, number),
        })).collect::<Vec<_>>(),
        "rhs_ns": number(found.rhs_ns),
        "ms_per_simulated_s": found.ms_per_s.as_ref().map_or(Value::Null, |ms| number(*ms)),
        "reason": found.ms_per_s.as_ref().err().or(found.failed.as_ref()),
        "trial_s": number(found.trial_s),
        "freedoms": found.freedoms.iter().map(|t| json!({
            "name": t.name,
            "standard_deviation": number(t.deviation),
            "held_error_roll_rad": t.held.as_ref().map_or(Value::Null, |h| number(h.0)),
            "held_error_z_m": t.held.as_ref().map_or(Value::Null, |h| number(h.1)),
            "reason": t.held.as_ref().err(),
        })).collect::<Vec<_>>(),
    })
}

fn as_table(found: &Findings) -> String {
    let mut out = format!("{}: {}\n\n", found.scene.name, found.scene.about);
    // Writing to a string cannot fail.
    let _ = write_effects(&mut out, found).and_then(|()| write_freedoms(&mut out, found));
    out
}

fn write_effects(out: &mut String, found: &Findings) -> std::fmt::Result {
    writeln!(
        out,
        "{:<17} {:<3} {:>6} {:>8} {:>6} {:>11}  what it is",
        "effect", "", "states", "cost, ns", "share", "without, ms"
    )?;
    for e in found.effects.iter().filter(|e| e.on) {
        // What costs nothing can be measured as a little less than nothing.
        let cost = e
            .cost_ns
            .map_or(String::new(), |c| format!("{:.0}", c.max(0.0)));
        let share = e.cost_ns.map_or(String::new(), |c| {
            format!("{:.0} %", 100.0 * c.max(0.0) / found.rhs_ns)
        });
        let without = e.without_ms.map_or(String::new(), |ms| format!("{ms:.3}"));
        writeln!(
            out,
            "{:<17} on  {:>6} {cost:>8} {share:>6} {without:>11}  {}{}",
            e.name,
            e.adds_state,
            e.about,
            e.idle
                .as_ref()
                .map_or(String::new(), |why| format!("; does nothing here: {why}"))
        )?;
    }
    for e in found.effects.iter().filter(|e| !e.on) {
        writeln!(out, "{:<17} -   {:36}{}", e.name, "", e.about)?;
    }
    write!(
        out,
        "\ncost: one right-hand side takes {:.0} ns, so much of it is the effect's; ",
        found.rhs_ns
    )?;
    match &found.ms_per_s {
        Ok(ms) => writeln!(
            out,
            "a simulated second takes {ms:.3} ms on one core,\n\
             'without' what it takes without the effect (the motion is another then)"
        )?,
        Err(why) => writeln!(
            out,
            "no motion was tried, for even its beginning fails:\n{why}"
        )?,
    }
    if found.scene.effects.drum.is_some() {
        writeln!(
            out,
            "the sound of the drum is made when a recording is written, beside the run: it is in none of these times"
        )?;
    }
    let (names, layout) = (found.model.state_names(), found.model.layout());
    writeln!(
        out,
        "state, {}, of which {} are the body's and {} phases, which effects share: {}",
        names.len(),
        layout.body,
        layout.phases,
        shortened(&names)
    )
}

fn write_freedoms(out: &mut String, found: &Findings) -> std::fmt::Result {
    if found.freedoms.is_empty() {
        return match (&found.ms_per_s, &found.failed) {
            (Ok(_), Some(why)) => writeln!(out, "\nno freedom was held in a trial: {why}"),
            _ => Ok(()),
        };
    }
    writeln!(
        out,
        "\n{:<8} {:>12}  held instead: worst error within {} s",
        "freedom",
        "std dev",
        (found.trial_s * 1e3).round() / 1e3
    )?;
    for t in &found.freedoms {
        let linear = ["x", "y", "height"].contains(&t.name.as_str());
        let deviation = if linear {
            format!("{:.4} m", t.deviation)
        } else {
            format!("{:.3} deg", t.deviation.to_degrees())
        };
        let held = match &t.held {
            Ok((roll, z)) => format!("roll {:.3} deg, height {:.5} m", roll.to_degrees(), z),
            Err(reason) => reason.clone(),
        };
        writeln!(out, "{:<8} {deviation:>12}  {held}", t.name)?;
    }
    let idle: Vec<&str> = found
        .freedoms
        .iter()
        .filter(|t| matches!(t.held, Ok((roll, z)) if roll < LITTLE.0 && z < LITTLE.1))
        .map(|t| t.name.as_str())
        .collect();
    if idle.is_empty() {
        return writeln!(
            out,
            "none could be held with less than 1 deg and 5 mm of error"
        );
    }
    writeln!(
        out,
        "each could be held alone with less than 1 deg and 5 mm of error: {}",
        idle.join(", ")
    )
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

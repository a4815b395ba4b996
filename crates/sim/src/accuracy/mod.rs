//! What accuracy costs: every method over a ladder of steps or tolerances, against a reference.
//!
//! The reference is [`REFERENCE`], a method that is in no ladder; one of other coefficients and other steps, [`SECOND`], must agree with it,
//! and their largest difference is the estimated error: nothing finer can be judged. At 1e-11 what is left between them is rounding, grown
//! by the scene (1e-14 rad on `strict-contact`, 3e-12 rad on `music`, 8e-10 rad on `tumble`). Where a scene is chaotic they part company:
//! errors are then judged up to the moment where they differ by [`AGREE`], and the study says so.
//!
//! Errors are the largest over all samples judged; what people quote ([`Quoted`]) is compared over the whole analysis window.

mod clock;
mod course;
mod findings;

pub use course::Quoted;

use crate::model::Model;
use crate::run::{Sample, run_model};
use crate::scene::Scene;
use crate::solve::{METHODS, Method, Settings, Stats, Stopped, method};
use clock::{Clock, Time};
use course::Course;

/// Method and tolerance of the reference.
pub const REFERENCE: (&str, f64) = ("fehlberg8", 1e-11);
/// Of the second reference.
pub const SECOND: (&str, f64) = ("dop853", 1e-11);
/// Tolerances of adaptive methods.
pub const TOLERANCES: &[f64] = &[1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9];
/// Steps of fixed-step methods, s. The archive's is 1e-3.
pub const STEPS_S: &[f64] = &[1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5];
/// The method and step, s, of the paper's archive.
pub const ARCHIVE: (&str, f64) = ("semi-implicit-euler", 1e-3);
/// References that differ by more than this, rad and m, no longer describe the same motion.
pub const AGREE: f64 = 1e-6;
/// A rung may take so many times the evaluations of the costlier reference, or [`ALWAYS_ALLOWED`].
const HOPELESS: u64 = 10;
const ALWAYS_ALLOWED: u64 = 20_000_000;
/// And so long, s.
const PATIENCE_S: f64 = 60.0;
/// Repetitions of a rung end when they have taken so long together, s.
const ENOUGH_S: f64 = 2.0;

/// One rung of a ladder.
#[derive(Clone, Debug)]
pub struct Rung {
    /// Method name.
    pub method: &'static str,
    /// Tolerance, or step in s.
    pub setting: f64,
    /// Whether the setting is a tolerance.
    pub adaptive: bool,
    /// Median time of a run, s; of the run that failed where it failed.
    pub wall_s: f64,
    /// Median time that the processor spent on it, s: what the wall shows on a machine that does nothing else. Settings are ranked
    /// by it.
    pub cpu_s: f64,
    /// Work done.
    pub stats: Stats,
    /// Largest difference of roll from the reference, rad; infinite where it failed.
    pub error_roll_rad: f64,
    /// Of the height, m.
    pub error_z_m: f64,
    /// Of any N_i, N.
    pub error_normal_n: f64,
    /// Of x, y (m), pitch and yaw (rad), the last two about the body's axes.
    pub error_other: f64,
    /// The largest of these four in parts of how far each goes, 1.
    pub other_part: f64,
    /// What people would quote.
    pub quoted: Quoted,
    /// Largest unexplained energy over the throughput, 1; `None` where nothing moves energy.
    pub unexplained: Option<f64>,
    /// Why it stopped early.
    pub failed: Option<String>,
}

/// What a study judges its rungs by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judge {
    /// The roll, rad.
    Roll,
    /// The height, m, where nothing rolls.
    Height,
    /// x, y, pitch and yaw, m and rad, where nothing heaves either.
    Other,
    /// Nothing moves.
    Nothing,
}

impl Judge {
    /// Name and unit for people.
    pub fn name(self) -> (&'static str, &'static str) {
        match self {
            Self::Roll => ("roll", "rad"),
            Self::Height => ("height", "m"),
            Self::Other => ("x, y, pitch and yaw", "m or rad"),
            Self::Nothing => ("nothing", "m"),
        }
    }
}

/// The study of one scene.
#[derive(Clone, Debug)]
pub struct Study {
    /// Scene name.
    pub scene: String,
    /// Largest difference in roll between the two references up to [`Self::judged_s`], rad.
    pub estimated_error_rad: f64,
    /// In height, m.
    pub estimated_error_m: f64,
    /// In x, y (m), pitch and yaw (rad).
    pub estimated_error_other: f64,
    /// Whether x, y, pitch or yaw move.
    pub others_move: bool,
    /// How long the run is, s.
    pub duration_s: f64,
    /// Up to when the references agree to [`AGREE`], and errors are judged, s.
    pub judged_s: f64,
    /// Whether they part before the last sample.
    pub parted: bool,
    /// What errors are ranked by.
    pub judge: Judge,
    /// What the reference says about the scene.
    pub quoted: Quoted,
    /// Every rung.
    pub runs: Vec<Rung>,
    /// Indices of the rungs that no other beats in both time and error, cheapest first.
    pub front: Vec<usize>,
}

/// One run: its course, work, time, and why it stopped early.
fn solve(
    model: &Model,
    method: &Method,
    setting: f64,
    most_evaluations: u64,
) -> (Course, Stats, Time, Option<String>) {
    let settings = Settings {
        tolerance: setting,
        step_s: setting,
        most_evaluations,
    };
    let mut course = Course::default();
    let clock = Clock::start();
    let (stats, outcome) = run_model(model, method, &settings, &mut |s: &Sample| {
        course.push(s);
        clock.cpu_s() < PATIENCE_S
    });
    let failed = match outcome {
        Ok(()) => None,
        Err(Stopped::ByObserver { t_s }) => Some(format!(
            "{} was given up at t = {t_s:.3} s: it had computed for {PATIENCE_S} s",
            method.name
        )),
        Err(why) => Some(why.what()),
    };
    (course, stats, clock.read(), failed)
}

/// Runs every method over its ladder, each rung `repeats` times after one that warms up. `progress` hears how many runs are
/// done, of how many, and what comes next.
///
/// # Errors
/// When a reference stops early: a sentence with its cause.
pub fn study(
    scene: &Scene,
    repeats: usize,
    mut progress: impl FnMut(usize, usize, &str),
) -> Result<Study, String> {
    let model = Model::new(scene);
    let ladder: Vec<(&Method, f64)> = METHODS
        .iter()
        .filter(|m| m.name != REFERENCE.0)
        .flat_map(|m| {
            let rungs = if m.adaptive { TOLERANCES } else { STEPS_S };
            rungs.iter().map(move |&setting| (m, setting))
        })
        .collect();
    let total = ladder.len() + 2;
    let mut reference = |done: usize, (name, tolerance): (&str, f64)| {
        progress(done, total, &format!("reference: {name} at {tolerance:e}"));
        let (course, stats, _, failed) = solve(&model, method(name)?, tolerance, u64::MAX);
        match failed {
            None => Ok((course, stats.evaluations)),
            Some(cause) => Err(format!("no reference for scene `{}`: {cause}", scene.name)),
        }
    };
    let (best, cost) = reference(0, REFERENCE)?;
    let (second, second_cost) = reference(1, SECOND)?;
    let most_evaluations = (HOPELESS * cost.max(second_cost)).max(ALWAYS_ALLOWED);

    let until = best.agrees_with(&second, AGREE);
    let agreement = best.errors(&second, until);
    let excursions = best.excursions(scene.carriers.walk_m_per_s);
    let others_move = course::part_of(excursions, excursions) > 0.0;
    let judge = match () {
        () if best.rolls() => Judge::Roll,
        () if best.heaves() => Judge::Height,
        () if others_move => Judge::Other,
        () => Judge::Nothing,
    };
    let mut runs = Vec::new();
    for (done, (method, setting)) in ladder.into_iter().enumerate() {
        progress(done + 2, total, &format!("{} at {setting:e}", method.name));
        runs.push(rung(
            &model,
            method,
            setting,
            most_evaluations,
            repeats,
            &best,
            until,
        ));
    }
    let mut study = Study {
        scene: scene.name.clone(),
        estimated_error_rad: agreement.roll_rad,
        estimated_error_m: agreement.height_m,
        estimated_error_other: agreement.other(),
        others_move,
        duration_s: scene.duration_s,
        judged_s: best.time(until),
        parted: until < best.samples(),
        judge,
        quoted: best.quoted(scene),
        runs,
        front: Vec::new(),
    };
    study.front = study.pareto();
    Ok(study)
}

fn rung(
    model: &Model,
    method: &'static Method,
    setting: f64,
    most_evaluations: u64,
    repeats: usize,
    best: &Course,
    until: usize,
) -> Rung {
    let (course, stats, first, failed) = solve(model, method, setting, most_evaluations);
    // A long run needs no warming up, and a failure no median.
    let mut times = Vec::new();
    if first.cpu_s > 0.5 * ENOUGH_S || failed.is_some() {
        times.push(first);
    } else {
        while times.len() < repeats && times.iter().map(|t: &Time| t.cpu_s).sum::<f64>() < ENOUGH_S
        {
            times.push(solve(model, method, setting, most_evaluations).2);
        }
    }
    let time = clock::median(&times);
    let errors = match failed {
        None => best.errors(&course, until),
        Some(_) => course::Errors::UNKNOWN,
    };
    let excursions = best.excursions(model.scene.carriers.walk_m_per_s);
    Rung {
        method: method.name,
        setting,
        adaptive: method.adaptive,
        wall_s: time.wall_s,
        cpu_s: time.cpu_s,
        stats,
        error_roll_rad: errors.roll_rad,
        error_z_m: errors.height_m,
        error_normal_n: errors.normal_n,
        error_other: errors.other(),
        other_part: course::part_of(errors.others, excursions),
        quoted: course.quoted(&model.scene),
        unexplained: course.unexplained(),
        failed,
    }
}

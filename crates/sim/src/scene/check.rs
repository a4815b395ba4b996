//! What a scene must satisfy beyond its types.

use super::Freedom::{Roll, Tilt, Yaw};
use super::Scene;
use super::problem::{
    Checker, LAST_STAMP_S, MOST_SAMPLES, PAST_LAST_STAMP, Problem, larger, problem, shown,
};
use crate::body::Body;

/// Most steps that a run of fixed steps may take: an hour or so of computing.
const MOST_STEPS: f64 = 1e10;
/// A velocity that is given to three digits fits the freedoms if it differs by no more than this part.
const ROUNDED: f64 = 1e-3;

/// Checks everything that the types do not.
///
/// # Errors
/// The first [`Problem`] found.
pub fn check(scene: &Scene) -> Result<(), Problem> {
    run(scene)?;
    freedom(scene)?;
    body(scene)?;
    carriers(scene)?;
    start(scene)?;
    solver(scene)?;
    crate::effects::check(scene)
}

/// How long it runs, what it logs, and by which clock.
fn run(scene: &Scene) -> Result<(), Problem> {
    Checker::positive("duration_s", scene.duration_s)?;
    Checker::positive("log_rate_hz", scene.log_rate_hz)?;
    if scene.log_rate_hz > 1e9 {
        return Err(problem(
            "log_rate_hz",
            format!(
                "found {}, expected at most 1e9: stamps are whole nanoseconds",
                shown(scene.log_rate_hz)
            ),
        ));
    }
    let samples = scene.duration_s * scene.log_rate_hz;
    if samples > MOST_SAMPLES {
        let times = scene.log_rate_hz / super::default::log_rate_hz();
        let key = larger(scene.duration_s, "log_rate_hz", times);
        return Err(problem(
            key,
            format!(
                "{} s at {} Hz are {samples:.1e} samples, expected at most {MOST_SAMPLES:e}; simulate less, or log less often",
                shown(scene.duration_s),
                shown(scene.log_rate_hz)
            ),
        ));
    }
    Checker::not_negative("analysis_start_s", scene.analysis_start_s)?;
    Checker::not_negative("epoch_s", scene.epoch_s)?;
    if scene.epoch_s + scene.duration_s > LAST_STAMP_S {
        let key = if scene.duration_s > scene.epoch_s {
            "duration_s"
        } else {
            "epoch_s"
        };
        return Err(problem(key, PAST_LAST_STAMP));
    }
    if scene.seed >> 56 != 0 {
        return Err(problem(
            "seed",
            format!("found {}, expected a number below 2^56", scene.seed),
        ));
    }
    Ok(())
}

fn freedom(scene: &Scene) -> Result<(), Problem> {
    if scene.freedom.is_empty() {
        return Err(problem(
            "freedom",
            "the list is empty; name at least one of x, y, height, roll, tilt, yaw",
        ));
    }
    if let Some((i, f)) = scene
        .freedom
        .iter()
        .enumerate()
        .find(|(i, f)| scene.freedom[..*i].contains(f))
    {
        return Err(problem(
            "freedom",
            format!(
                "entry {} names {} twice",
                i + 1,
                format!("{f:?}").to_lowercase()
            ),
        ));
    }
    let has = |f| scene.freedom.contains(&f);
    let level = scene.start.roll_pitch_yaw_deg[1].to_radians().cos().abs();
    if has(Roll) && has(Yaw) && !has(Tilt) && level < 0.01 {
        return Err(problem(
            "freedom",
            "roll and yaw are the same turn while the pole is held upright; free the tilt too",
        ));
    }
    Ok(())
}

fn body(scene: &Scene) -> Result<(), Problem> {
    Checker::positive("body.mass_kg", scene.body.mass_kg)?;
    Checker::all_finite("body.gravity_m_per_s2", &scene.body.gravity_m_per_s2)?;
    Body::new(&scene.body).map_err(|message| problem("body.inertia_kg_m2", message))?;
    Ok(())
}

fn carriers(scene: &Scene) -> Result<(), Problem> {
    let n = scene.carriers.count();
    if n == 0 {
        return Err(problem(
            "carriers.handles_m",
            "the list is empty; a carried body needs at least one handle",
        ));
    }
    for handle in &scene.carriers.handles_m {
        Checker::all_finite("carriers.handles_m", handle)?;
    }
    Checker::per_carrier(
        "carriers.shoulder_height_m",
        &scene.carriers.shoulder_height_m,
        n,
    )?;
    Checker::per_carrier("carriers.frequency_hz", &scene.carriers.frequency_hz, n)?;
    let key = "carriers.initial_phase_rad";
    Checker::per_carrier(key, &scene.carriers.initial_phase_rad, n)?;
    let phases = scene.carriers.initial_phase_rad.values();
    phases
        .iter()
        .try_for_each(|x| Checker::angle_rad(key, *x))?;
    Checker::not_negative(
        "carriers.initial_phase_sd_rad",
        scene.carriers.initial_phase_sd_rad,
    )?;
    Checker::all_finite("carriers.walk_m_per_s", &scene.carriers.walk_m_per_s)?;
    Ok(())
}

fn start(scene: &Scene) -> Result<(), Problem> {
    let start = &scene.start;
    if let Some(z) = start.height_m {
        Checker::finite("start.height_m", z)?;
    }
    Checker::all_finite("start.position_m", &start.position_m)?;
    Checker::all_finite("start.roll_pitch_yaw_deg", &start.roll_pitch_yaw_deg)?;
    Checker::all_finite("start.velocity_m_per_s", &start.velocity_m_per_s)?;
    Checker::all_finite(
        "start.angular_velocity_rad_per_s",
        &start.angular_velocity_rad_per_s,
    )?;
    if let Some(left) = crate::freedoms::start_velocities(scene) {
        let asked = [
            ("start.velocity_m_per_s", start.velocity_m_per_s),
            (
                "start.angular_velocity_rad_per_s",
                start.angular_velocity_rad_per_s,
            ),
        ];
        for ((key, asked), left) in asked.into_iter().zip(left) {
            let size = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
            if size([0, 1, 2].map(|a| asked[a] - left[a])) > ROUNDED * size(asked) {
                return Err(problem(
                    key,
                    format!(
                        "found {asked:?}, of which the coordinates that `freedom` names can have {left:?}; free the others too, or leave out what is held"
                    ),
                ));
            }
        }
    }
    Ok(())
}

fn solver(scene: &Scene) -> Result<(), Problem> {
    if !(1e-13..=1e-1).contains(&scene.solver.tolerance) {
        return Err(problem(
            "solver.tolerance",
            format!(
                "found {}, expected 1e-13 to 1e-1: double precision ends below, sense above",
                shown(scene.solver.tolerance)
            ),
        ));
    }
    Checker::positive("solver.step_s", scene.solver.step_s)?;
    let method = crate::solve::method(&scene.solver.method)
        .map_err(|message| problem("solver.method", message))?;
    if !method.adaptive && scene.duration_s / scene.solver.step_s > MOST_STEPS {
        let times = super::Solver::default().step_s / scene.solver.step_s;
        return Err(problem(
            larger(scene.duration_s, "solver.step_s", times),
            format!(
                "{} s in steps of {} s are more than {MOST_STEPS:e}; simulate less, or take longer ones",
                shown(scene.duration_s),
                shown(scene.solver.step_s)
            ),
        ));
    }
    Ok(())
}

//! One scene under many seeds: runs in parallel, results in the order of the seeds.

use crate::statistics::correlation;
use analyze::inputs::{Inputs, Window};
use analyze::metrics::metrics_of;
use rayon::prelude::*;
use sim::run::{Sample, run};
use sim::scene::Scene;
use sim::solve::{Stats, Stopped};

/// The metrics that an ensemble keeps of each run.
pub const KEPT: &[&str] = &[
    "rms_roll_deg",
    "rms_pitch_deg",
    "rms_yaw_deg",
    "contact_loss",
    "contact_loss_mean",
    "synchrony",
    "onset_time_s",
    "unstable",
    "roll_excess_s",
    "dz_pp_m",
    "rms_z_m",
    "t_float",
    "peak_hz",
    "growth_ratio",
    "force_sd_n",
];

/// What is kept of one run.
#[derive(Clone, Debug)]
pub struct Run {
    /// Its seed.
    pub seed: u64,
    /// Value of each metric of [`KEPT`]; `None` where it has none. A yes is 1, a no is 0.
    pub metrics: Vec<Option<f64>>,
    /// Correlation of the first two handles' normal forces over the window.
    pub force_correlation: Option<f64>,
    /// Work of the solver.
    pub stats: Stats,
}

impl Run {
    /// A metric by name.
    pub fn get(&self, name: &str) -> Option<f64> {
        KEPT.iter()
            .position(|n| *n == name)
            .and_then(|i| self.metrics[i])
    }
}

/// Columns of a run for the analyzer, collected in memory.
pub struct Columns {
    /// What `analyze` takes.
    pub inputs: Inputs,
}

impl Columns {
    /// Empty columns for a run of `scene`.
    pub fn new(scene: &Scene) -> Self {
        let n = scene.carriers.count();
        let [gx, gy, gz] = scene.body.gravity_m_per_s2;
        Self {
            inputs: Inputs {
                normal_n: vec![Vec::new(); n],
                mass_kg: Some(scene.body.mass_kg),
                gravity_m_per_s2: (gx * gx + gy * gy + gz * gz).sqrt(),
                ..Inputs::default()
            },
        }
    }

    /// Adds a sample.
    pub fn push(&mut self, s: &Sample) {
        let i = &mut self.inputs;
        let [roll, pitch, yaw] = s.roll_pitch_yaw_rad;
        i.t_s.push(s.t_s);
        i.height_m.push(s.pose.position_m[2]);
        i.roll_rad.push(roll);
        i.pitch_rad.push(pitch);
        i.yaw_rad.push(yaw);
        for (column, n) in i.normal_n.iter_mut().zip(&s.normal_n) {
            column.push(*n);
        }
        if i.phase_rad.is_empty() && !s.phase_rad.is_empty() {
            i.phase_rad = vec![Vec::new(); s.phase_rad.len()];
        }
        for (column, p) in i.phase_rad.iter_mut().zip(&s.phase_rad) {
            column.push(*p);
        }
    }
}

/// Runs a scene and analyses it in memory.
///
/// # Errors
/// [`Stopped`] when the run does not reach its end.
pub fn run_one(scene: &Scene) -> Result<Run, Stopped> {
    let mut columns = Columns::new(scene);
    let stats = run(scene, &mut |s: &Sample| {
        columns.push(s);
        true
    })?;
    let inputs = &columns.inputs;
    let window = Window::from(scene.analysis_start_s);
    let found = metrics_of(inputs, window, |name| KEPT.contains(&name));
    let metrics = KEPT
        .iter()
        .map(|name| {
            let value = found.get(name)?;
            value.as_f64().or_else(|| value.as_bool().map(f64::from))
        })
        .collect();
    let range = window.range(inputs.force_times());
    let force_correlation = match &inputs.normal_n[..] {
        [first, second, ..] => correlation(&first[range.clone()], &second[range]),
        _ => None,
    };
    Ok(Run {
        seed: scene.seed,
        metrics,
        force_correlation,
        stats,
    })
}

/// Runs `scene` once for every seed, on `jobs` threads (0: one per core). `done` is called after each run, in any order;
/// returning `false` from it skips the runs that have not begun. The results are in the order of the seeds.
///
/// # Errors
/// When the threads cannot be had.
pub fn run_all(
    scenes: &[Scene],
    jobs: usize,
    done: impl Fn() -> bool + Sync,
) -> Result<Vec<Option<Result<Run, Stopped>>>, rayon::ThreadPoolBuildError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build()?;
    let going = std::sync::atomic::AtomicBool::new(true);
    let relaxed = std::sync::atomic::Ordering::Relaxed;
    Ok(pool.install(|| {
        scenes
            .par_iter()
            .map(|scene| {
                going.load(relaxed).then(|| {
                    let result = run_one(scene);
                    if !done() {
                        going.store(false, relaxed);
                    }
                    result
                })
            })
            .collect()
    }))
}

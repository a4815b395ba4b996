//! What accuracy costs: every method over a ladder of steps or tolerances, against a reference.
//!
//! The reference is DOP853 with located events at [`REFERENCE_TOLERANCE`], tighter than any rung; an independent one (DOPRI5 at
//! [`SECOND_TOLERANCE`]) must agree with it, and their largest difference in roll is its estimated error. Errors are the
//! largest over all samples; what people quote (RMS roll, contact loss, onset, T_float: docs/metrics) is compared as such.

use crate::model::Model;
use crate::run::{Sample, run_model};
use crate::scene::Scene;
use crate::solve::{METHODS, Method, Settings, Stats};
use std::time::Instant;

/// Tolerance of the reference.
pub const REFERENCE_TOLERANCE: f64 = 1e-11;
/// Tolerance of the second reference.
pub const SECOND_TOLERANCE: f64 = 3e-11;
/// Tolerances of adaptive methods.
pub const TOLERANCES: &[f64] = &[1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9];
/// Steps of fixed-step methods, s. The archive's is 1e-3.
pub const STEPS_S: &[f64] = &[1e-2, 3e-3, 1e-3, 3e-4, 1e-4];
/// Work beyond which a rung is given up, evaluations.
const MOST_EVALUATIONS: u64 = 200_000_000;
/// T_float counts samples whose summed force is at most this part of the weight.
const FLOATING: f64 = 0.05;
/// An onset is a stretch of 2 s with an RMS roll above this, rad.
const ONSET_RAD: f64 = 10.0 * std::f64::consts::PI / 180.0;
const ONSET_S: f64 = 2.0;

/// What people quote about a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quoted {
    /// About zero, over the analysis window, rad.
    pub rms_roll_rad: f64,
    /// Mean over handles of the part of samples with N ≤ 0, 1.
    pub contact_loss: f64,
    /// End of the first 2 s with an RMS roll above 10°, s.
    pub onset_s: Option<f64>,
    /// Part of samples that float, 1.
    pub t_float: f64,
}

/// Samples of a run, what the errors are computed from.
#[derive(Clone, Debug, Default)]
struct Course {
    t_s: Vec<f64>,
    roll_rad: Vec<f64>,
    height_m: Vec<f64>,
    /// Handle after handle of each sample.
    normal_n: Vec<f64>,
    unexplained_j: f64,
    throughput_j: f64,
}

impl Course {
    fn push(&mut self, s: &Sample) {
        self.t_s.push(s.t_s);
        self.roll_rad.push(s.roll_pitch_yaw_rad[0]);
        self.height_m.push(s.pose.position_m[2]);
        self.normal_n.extend_from_slice(&s.normal_n);
        if let Some(e) = &s.energy {
            self.unexplained_j = self.unexplained_j.max(e.unexplained_j.abs());
            self.throughput_j = e.work_in_j.abs() + e.dissipated_j.abs();
        }
    }

    fn quoted(&self, scene: &Scene) -> Quoted {
        let from = self
            .t_s
            .partition_point(|&t| t < scene.analysis_start_s - 1e-9);
        let n = scene.carriers.count();
        let (t, roll, force) = (
            &self.t_s[from..],
            &self.roll_rad[from..],
            &self.normal_n[from * n..],
        );
        if t.is_empty() {
            return Quoted::default();
        }
        let count = t.len() as f64;
        let g = scene
            .body
            .gravity_m_per_s2
            .iter()
            .map(|x| x * x)
            .sum::<f64>()
            .sqrt();
        let weight = scene.body.mass_kg * g;
        let window = ((ONSET_S * scene.log_rate_hz).round() as usize).max(1);
        let onset = roll.windows(window).position(|w| {
            (w.iter().map(|r| r * r).sum::<f64>() / window as f64).sqrt() > ONSET_RAD
        });
        Quoted {
            rms_roll_rad: (roll.iter().map(|r| r * r).sum::<f64>() / count).sqrt(),
            contact_loss: force.iter().filter(|&&f| f <= 0.0).count() as f64 / force.len() as f64,
            onset_s: onset.map(|i| t[i + window - 1]),
            t_float: force
                .chunks_exact(n)
                .filter(|f| f.iter().sum::<f64>() <= FLOATING * weight)
                .count() as f64
                / count,
        }
    }
}

/// One rung of a ladder.
#[derive(Clone, Debug)]
pub struct Rung {
    /// Method name.
    pub method: &'static str,
    /// Tolerance, or step in s.
    pub setting: f64,
    /// Whether the setting is a tolerance.
    pub adaptive: bool,
    /// Median time of a run, s.
    pub wall_s: f64,
    /// Work done.
    pub stats: Stats,
    /// Largest difference of roll from the reference, rad.
    pub error_roll_rad: f64,
    /// Of the height, m.
    pub error_z_m: f64,
    /// Of any N_i, N.
    pub error_normal_n: f64,
    /// What people would quote.
    pub quoted: Quoted,
    /// Largest unexplained energy over the throughput, 1; `None` where nothing moves energy.
    pub unexplained: Option<f64>,
    /// Why it stopped early.
    pub failed: Option<String>,
}

/// The study of one scene.
#[derive(Clone, Debug)]
pub struct Study {
    /// Scene name.
    pub scene: String,
    /// Name and tolerance of the reference.
    pub reference: String,
    /// Largest difference in roll between two independent references, rad.
    pub estimated_error_rad: f64,
    /// In height, m.
    pub estimated_error_m: f64,
    /// What the reference says about the scene.
    pub quoted: Quoted,
    /// Every rung.
    pub runs: Vec<Rung>,
    /// Indices of the rungs that no other beats in both time and roll error, cheapest first.
    pub front: Vec<usize>,
}

fn solve(model: &Model, method: &Method, setting: f64) -> (Course, Stats, Option<String>) {
    let settings = Settings {
        tolerance: setting,
        step_s: setting,
        most_evaluations: MOST_EVALUATIONS,
    };
    let mut course = Course::default();
    let (stats, outcome) = run_model(model, method, &settings, &mut |s: &Sample| {
        course.push(s);
        true
    });
    (course, stats, outcome.err().map(|e| e.to_string()))
}

fn worst(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(x, y)| (x - y).abs())
        .fold(0.0, f64::max)
}

/// Roll is an angle: a whole turn is no error.
fn worst_angle(a: &[f64], b: &[f64]) -> f64 {
    let turn = std::f64::consts::TAU;
    a.iter()
        .zip(b)
        .map(|(x, y)| (x - y - turn * ((x - y) / turn).round()).abs())
        .fold(0.0, f64::max)
}

/// Runs every method over its ladder. `progress` hears each rung before it is run. `repeats` runs are timed, the first warms up.
///
/// # Errors
/// When a reference stops early: a sentence with its cause.
pub fn study(
    scene: &Scene,
    repeats: usize,
    mut progress: impl FnMut(&str),
) -> Result<Study, String> {
    let model = Model::new(scene);
    let named = |name: &str| {
        METHODS
            .iter()
            .find(|m| m.name == name)
            .expect("a method of the table")
    };
    let mut reference = |name: &str, tolerance: f64| {
        progress(&format!("reference: {name} at {tolerance:e}"));
        match solve(&model, named(name), tolerance) {
            (course, _, None) => Ok(course),
            (_, _, Some(cause)) => Err(format!("no reference for scene `{}`: {cause}", scene.name)),
        }
    };
    let best = reference("dop853", REFERENCE_TOLERANCE)?;
    let second = reference("dopri5", SECOND_TOLERANCE)?;
    let mut runs = Vec::new();
    for method in METHODS.iter().filter(|m| m.name != "auto") {
        for &setting in if method.adaptive { TOLERANCES } else { STEPS_S } {
            progress(&format!("{} at {setting:e}", method.name));
            let mut times = Vec::new();
            let (mut course, mut stats, mut failed) = solve(&model, method, setting);
            for _ in 0..repeats {
                let start = Instant::now();
                (course, stats, failed) = solve(&model, method, setting);
                times.push(start.elapsed().as_secs_f64());
            }
            times.sort_by(f64::total_cmp);
            runs.push(Rung {
                method: method.name,
                setting,
                adaptive: method.adaptive,
                wall_s: times.get(times.len() / 2).copied().unwrap_or(f64::NAN),
                stats,
                error_roll_rad: worst_angle(&course.roll_rad, &best.roll_rad),
                error_z_m: worst(&course.height_m, &best.height_m),
                error_normal_n: worst(&course.normal_n, &best.normal_n),
                quoted: course.quoted(scene),
                unexplained: (course.throughput_j > 0.0)
                    .then(|| course.unexplained_j / course.throughput_j),
                failed,
            });
        }
    }
    let mut by_time: Vec<usize> = (0..runs.len())
        .filter(|&i| runs[i].failed.is_none())
        .collect();
    by_time.sort_by(|&a, &b| runs[a].wall_s.total_cmp(&runs[b].wall_s));
    let mut least = f64::INFINITY;
    let front = by_time.into_iter().filter(|&i| {
        runs[i].error_roll_rad < least && {
            least = runs[i].error_roll_rad;
            true
        }
    });
    Ok(Study {
        scene: scene.name.clone(),
        reference: format!(
            "dop853 at {REFERENCE_TOLERANCE:e}, against dopri5 at {SECOND_TOLERANCE:e}"
        ),
        estimated_error_rad: worst_angle(&best.roll_rad, &second.roll_rad),
        estimated_error_m: worst(&best.height_m, &second.height_m),
        quoted: best.quoted(scene),
        front: front.collect(),
        runs,
    })
}

impl Study {
    /// The cheapest rung that is right to `error_rad` in roll.
    pub fn cheapest(&self, error_rad: f64) -> Option<&Rung> {
        self.cheapest_where(|r| r.error_roll_rad <= error_rad)
    }

    fn cheapest_where(&self, right: impl Fn(&Rung) -> bool) -> Option<&Rung> {
        self.runs
            .iter()
            .filter(|r| r.failed.is_none() && right(r))
            .min_by(|a, b| a.wall_s.total_cmp(&b.wall_s))
    }

    /// What a further digit of roll costs: the factor in time per factor ten in error along the front (least squares in
    /// logarithms); `None` with fewer than two points.
    pub fn cost_of_a_digit(&self) -> Option<f64> {
        let points: Vec<(f64, f64)> = self
            .front
            .iter()
            .map(|&i| {
                (
                    -self.runs[i].error_roll_rad.max(1e-300).log10(),
                    self.runs[i].wall_s.log10(),
                )
            })
            .collect();
        let n = points.len() as f64;
        let (mx, my) = (
            points.iter().map(|p| p.0).sum::<f64>() / n,
            points.iter().map(|p| p.1).sum::<f64>() / n,
        );
        let spread: f64 = points.iter().map(|p| (p.0 - mx).powi(2)).sum();
        (points.len() > 1 && spread > 0.0).then(|| {
            10f64.powf(points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>() / spread)
        })
    }

    /// The finding, in one sentence.
    pub fn sentence(&self) -> String {
        let truth = self.quoted.rms_roll_rad;
        let Some(r) =
            self.cheapest_where(|r| (r.quoted.rms_roll_rad - truth).abs() <= 0.01 * truth)
        else {
            return "no setting gives RMS roll to 1 %".into();
        };
        let what = if r.adaptive { "tolerance" } else { "step" };
        let digit = self
            .cost_of_a_digit()
            .map(|c| format!("; each further digit of roll costs × {c:.2}"))
            .unwrap_or_default();
        format!(
            "for RMS roll to 1 % the cheapest is {} at {what} {:e}{}: {:.2} ms{digit}",
            r.method,
            r.setting,
            if r.adaptive { "" } else { " s" },
            r.wall_s * 1e3
        )
    }
}

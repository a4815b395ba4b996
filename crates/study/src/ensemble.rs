//! One scene under many seeds: runs in parallel, results in the order of the seeds.

use crate::pool::in_order;
use crate::statistics::correlation;
use analyze::inputs::{Inputs, Window};
use analyze::metrics::{Metric, Need, metrics_of};
use sim::model::Model;
use sim::remarks::Remarks;
use sim::run::{Listener, Sample, run_abreast, run_model, settings};
use sim::scene::Scene;
use sim::sensors::Reading;
use sim::solve::{Settings, Stats, Stopped, abreast, method};
use std::cell::RefCell;
use std::convert::Infallible;
use std::ops::Range;
use std::sync::atomic::AtomicBool;

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
    /// Whether any of the samples is [`Sample::doubtful`].
    pub doubtful: bool,
    /// What the motion did that nobody carries so.
    pub remarks: Remarks,
    /// Nobody asks for tilt and heading.
    only_roll: bool,
}

impl Columns {
    /// Empty columns for a run of `scene`.
    pub fn new(scene: &Scene) -> Self {
        let n = scene.carriers.count();
        let [gx, gy, gz] = scene.body.gravity_m_per_s2;
        // What a run of minutes needs; a longer one's columns grow as they must.
        let samples = (scene.duration_s * scene.log_rate_hz).min(1e4) as usize + 2;
        let column = || Vec::with_capacity(samples);
        Self {
            inputs: Inputs {
                t_s: column(),
                height_m: column(),
                roll_rad: column(),
                pitch_rad: column(),
                yaw_rad: column(),
                normal_n: (0..n).map(|_| column()).collect(),
                mass_kg: Some(scene.body.mass_kg),
                gravity_m_per_s2: (gx * gx + gy * gy + gz * gz).sqrt(),
                ..Inputs::default()
            },
            doubtful: false,
            remarks: Remarks::of(scene),
            only_roll: false,
        }
    }

    /// The same for these metrics alone.
    fn for_metrics(scene: &Scene, metrics: &[&Metric]) -> Self {
        let tilted = |m: &&Metric| m.needs.contains(&Need::Pitch) || m.needs.contains(&Need::Yaw);
        Self {
            only_roll: !metrics.iter().any(tilted),
            ..Self::new(scene)
        }
    }

    /// Forgets all samples, but not what room they took.
    fn clear(&mut self, scene: &Scene) {
        self.doubtful = false;
        self.remarks = Remarks::of(scene);
        let i = &mut self.inputs;
        let single = [
            &mut i.t_s,
            &mut i.height_m,
            &mut i.roll_rad,
            &mut i.pitch_rad,
            &mut i.yaw_rad,
            &mut i.beat_phase_rad,
        ];
        let several = i.normal_n.iter_mut().chain(&mut i.phase_rad);
        single.into_iter().chain(several).for_each(Vec::clear);
    }

    /// Adds a sample.
    pub fn push(&mut self, s: &Sample) {
        self.doubtful |= s.doubtful;
        self.remarks.look(s);
        let i = &mut self.inputs;
        i.t_s.push(s.t_s);
        i.height_m.push(s.pose.position_m[2]);
        if self.only_roll {
            i.roll_rad.push(s.pose.roll_rad());
        } else {
            let [roll, pitch, yaw] = s.pose.roll_pitch_yaw_rad();
            i.roll_rad.push(roll);
            i.pitch_rad.push(pitch);
            i.yaw_rad.push(yaw);
        }
        for (column, n) in i.normal_n.iter_mut().zip(&s.normal_n) {
            column.push(*n);
        }
        if i.phase_rad.is_empty() && !s.phase_rad.is_empty() {
            i.phase_rad = vec![Vec::new(); s.phase_rad.len()];
        }
        for (column, p) in i.phase_rad.iter_mut().zip(&s.phase_rad) {
            column.push(*p);
        }
        if !s.phase_rad.is_empty() {
            i.beat_phase_rad.push(s.beat_phase_rad.unwrap_or(f64::NAN));
        }
    }
}

/// Runs a scene and collects what the analyzer takes; `also` sees every sample too and may stop the run.
pub fn observe(
    scene: &Scene,
    most_evaluations: Option<u64>,
    also: &mut dyn Listener,
) -> (Columns, Stats, Result<(), Stopped>) {
    let model = Model::new(scene);
    let method = method(&scene.solver.method).expect("a checked scene names a method");
    let mut settings = settings(scene);
    settings.most_evaluations = most_evaluations.unwrap_or(settings.most_evaluations);
    let mut both = Both {
        columns: Columns::new(scene),
        also,
    };
    let (stats, outcome) = run_model(&model, method, &settings, &mut both);
    (both.columns, stats, outcome)
}

/// One scene under several seeds with method `auto`, side by side in the processor's registers, as far as the scene is one for that (else
/// `None`): what `measure` makes of the columns of each run that `metrics` need. What a seed gives does not depend on the others.
pub fn measure_abreast<T>(
    scene: &Scene,
    seeds: Range<u64>,
    metrics: &[&Metric],
    most_evaluations: u64,
    measure: impl Fn(&Columns, &Stats, &Result<(), Stopped>) -> T,
) -> Option<Vec<T>> {
    let model = |seed| {
        let model = Model::new(&Scene {
            seed,
            ..scene.clone()
        });
        abreast::suits(&model).then_some(model)
    };
    let models: Vec<Model> = seeds.map(model).collect::<Option<_>>()?;
    let settings = Settings {
        most_evaluations,
        ..settings(scene)
    };
    let spare = RefCell::new(Vec::new());
    let lane = || Lane {
        scene,
        metrics,
        spare: &spare,
        measure: &measure,
        columns: None,
        found: None,
    };
    let mut lanes: Vec<_> = models.iter().map(|_| lane()).collect();
    run_abreast(&models, &settings, &mut lanes);
    lanes.into_iter().map(|lane| lane.found).collect()
}

/// A run among others, measured as soon as it has ended: as many columns are held as runs are under way, however many there are.
struct Lane<'a, T, M> {
    scene: &'a Scene,
    metrics: &'a [&'a Metric],
    /// Columns that nobody fills.
    spare: &'a RefCell<Vec<Columns>>,
    measure: &'a M,
    columns: Option<Columns>,
    found: Option<T>,
}

impl<T, M> Lane<'_, T, M> {
    fn columns(&mut self) -> &mut Columns {
        let spare = || self.spare.borrow_mut().pop();
        self.columns.get_or_insert_with(|| {
            spare().unwrap_or_else(|| Columns::for_metrics(self.scene, self.metrics))
        })
    }
}

impl<T, M: Fn(&Columns, &Stats, &Result<(), Stopped>) -> T> Listener for Lane<'_, T, M> {
    fn sample(&mut self, sample: &Sample) -> bool {
        self.columns().push(sample);
        true
    }

    fn ended(&mut self, stats: &Stats, outcome: &Result<(), Stopped>) {
        self.columns();
        if let Some(mut columns) = self.columns.take() {
            self.found = Some((self.measure)(&columns, stats, outcome));
            columns.clear(self.scene);
            self.spare.borrow_mut().push(columns);
        }
    }
}

struct Both<'a> {
    columns: Columns,
    also: &'a mut dyn Listener,
}

impl Listener for Both<'_> {
    fn sample(&mut self, sample: &Sample) -> bool {
        self.columns.push(sample);
        self.also.sample(sample)
    }

    fn reading(&mut self, reading: &Reading<'_>) {
        self.also.reading(reading);
    }
}

/// Runs a scene and analyses it in memory.
///
/// # Errors
/// [`Stopped`] when the run does not reach its end.
pub fn run_one(scene: &Scene) -> Result<Run, Stopped> {
    let (columns, stats, outcome) = observe(scene, None, &mut |_: &Sample| true);
    outcome?;
    let inputs = columns.inputs;
    let window = Window::from(scene.analysis_start_s);
    let found = metrics_of(&inputs, window, |name| KEPT.contains(&name));
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

/// Runs every scene on `jobs` threads (0: one per core); the results are in their order. `done` is called after each run;
/// when `stop` is set the rest is left out.
pub fn run_all(
    scenes: &[Scene],
    jobs: usize,
    stop: &AtomicBool,
    mut done: impl FnMut(),
) -> Vec<Result<Run, Stopped>> {
    let mut out = Vec::with_capacity(scenes.len());
    let work = |k: u64| run_one(&scenes[k as usize]);
    let Ok(()) = in_order::<_, Infallible>(scenes.len() as u64, jobs, stop, work, |_, run| {
        out.push(run);
        done();
        Ok(())
    });
    out
}

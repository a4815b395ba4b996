//! Sweeps: a study file becomes a plan, the plan's runs become rows.

pub mod design;
pub mod figures;
pub mod known;
pub mod parts;
pub mod sensitivity;
pub mod shard;
pub mod sobol;
pub mod spec;
pub mod summary;
pub mod table;

use crate::ensemble::{Columns, measure_abreast, observe};
use analyze::inputs::Window;
use analyze::metrics::{Metric, find, metrics_of};
use design::Points;
use recording::write::{RecordingWriter, WriteError, WriterOptions};
use sim::model::Model;
use sim::record::{Recorder, VERSION};
use sim::run::{Listener, Sample, method_of};
use sim::scene::{Scene, Template};
use sim::sensors::Reading;
use sim::solve::{METHODS, Stats, Stopped, abreast};
use spec::{DesignKind, Spec, flatten, number};
use std::ops::Range;
use std::panic::AssertUnwindSafe;
use std::path::Path;
use table::{Cell, Column, Kind};

/// Columns that every table of runs has, beside axes and metrics.
pub const FIXED_COLUMNS: &[&str] = &[
    "run",
    "point",
    "seed",
    "steps",
    "rejected",
    "evaluations",
    "events",
    "remarks",
    "failed",
    "version",
];

/// Of these, the columns behind the metrics.
const AFTER_METRICS: usize = 7;

/// What stands between two remarks of one run.
const BETWEEN_REMARKS: &str = " | ";

/// The key that says whether a run keeps its energy account.
const ACCOUNT: &str = "solver.energy";

/// Work after which a run is given up: a thousand times what a minute of the paper's scenes takes.
const MOST_EVALUATIONS: u64 = 100_000_000;

/// With fewer seeds than lanes runs take less time one by one.
const WORTH_ABREAST: u64 = abreast::RUNS as u64;
/// With few at a time lanes stand empty while the last of them end; from here on that is hardly felt.
const MOST_ABREAST: u64 = 512;
const LEAST_ABREAST: u64 = 16;
/// Runs of more samples are computed one by one.
const LONGEST_ABREAST: f64 = 20e3;

/// A study, ready to run: what run `k` is follows from `k` alone.
pub struct Plan {
    /// The file, as it was read.
    pub spec: Spec,
    points: Points,
    template: Template,
    /// What goes along with each axis: key and factor.
    along: Vec<Vec<(String, f64)>>,
    /// Axes whose key holds a whole number.
    whole: Vec<bool>,
    columns: Vec<Column>,
    /// Whether somebody asks for the energy account, or may read it.
    keeps_account: bool,
    metrics: Vec<&'static Metric>,
}

impl Plan {
    /// Reads a study file.
    ///
    /// # Errors
    /// One sentence: the file, the place in it, what is wrong and what was expected.
    pub fn load(path: &Path) -> Result<Self, String> {
        let origin = path.display().to_string();
        let text = recording::text::read_text(path)
            .map_err(|e| format!("cannot read the study {origin}: {e}"))?;
        let mut spec = spec::parse(&origin, &text)?;
        if spec.name.is_empty() {
            let stem = path.file_stem().unwrap_or_default();
            spec.name = stem.to_string_lossy().into_owned();
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::new(spec, folder).map_err(|e| format!("{origin}: {e}"))
    }

    /// The plan of a checked study; a scene's path is looked for in `folder`.
    ///
    /// # Errors
    /// One sentence.
    pub fn new(spec: Spec, folder: &Path) -> Result<Self, String> {
        let set = flatten(&spec.set);
        let mut asked = set.iter().map(|(key, _)| key);
        let mut axes = spec.axes.iter().map(|axis| &axis.key);
        let keeps_account =
            spec.recordings || asked.any(|k| k == ACCOUNT) || axes.any(|k| k == ACCOUNT);
        let set: Vec<String> = set
            .iter()
            .map(|(key, value)| format!("{key}={value}"))
            .collect();
        let scene = match sim::scene::builtin(&spec.scene) {
            Some(_) => spec.scene.clone(),
            None if folder.join(&spec.scene).exists() => {
                folder.join(&spec.scene).display().to_string()
            }
            None => spec.scene.clone(),
        };
        let template = Template::load(&scene, &set)
            .map_err(|e| format!("scene: {e}").replace("scene: --set: ", "set: "))?;
        for (k, axis) in spec.axes.iter().enumerate() {
            try_axis(axis, &template)?;
            let others = spec
                .axes
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != k);
            no_value_is_hopeless(axis, &template, others.map(|(_, other)| other))?;
        }
        let whole = |axis: &spec::Axis| is_whole(axis, &template);
        let metrics: Vec<&Metric> = spec.metrics.iter().filter_map(|m| find(m)).collect();
        Ok(Self {
            points: Points::new(&spec)?,
            along: spec
                .axes
                .iter()
                .map(|a| {
                    let factor = |(key, value): (String, toml::Value)| Some((key, number(&value)?));
                    flatten(&a.along).into_iter().filter_map(factor).collect()
                })
                .collect(),
            whole: spec.axes.iter().map(whole).collect(),
            columns: columns(&spec, &metrics),
            keeps_account,
            metrics,
            template,
            spec,
        })
    }

    /// The same with another number of runs for every point.
    ///
    /// # Errors
    /// When that makes too many.
    pub fn with_seeds(mut self, seeds: u64) -> Result<Self, String> {
        self.spec.seeds = seeds;
        spec::check_seeds(&self.spec)?;
        self.points = Points::new(&self.spec)?;
        Ok(self)
    }

    /// How many runs there are.
    pub fn runs(&self) -> u64 {
        self.points.len() * self.spec.seeds
    }

    /// Whether it is a study of sensitivity.
    pub fn is_sensitivity(&self) -> bool {
        let design = self.spec.design.as_ref();
        design.is_some_and(|d| d.kind == DesignKind::Sensitivity)
    }

    /// How many points there are.
    pub fn points(&self) -> u64 {
        self.points.len()
    }

    /// The columns of the table.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The study as a file that stands by itself beside [`Plan::scene_text`]: what tells one study from another.
    pub fn text(&self) -> String {
        let spec = Spec {
            scene: "scene.toml".into(),
            ..self.spec.clone()
        };
        // OK because every field is a TOML value.
        toml::to_string(&spec).expect("a study is always expressible in TOML")
    }

    /// The base scene, complete, with what the study sets for all runs.
    pub fn scene_text(&self) -> &str {
        self.template.text()
    }

    /// Runs are kept and skipped in blocks of this many: at most 256 files up to a million runs, whoever computes them.
    pub fn block_runs(&self) -> u64 {
        self.runs().div_ceil(256).clamp(16, 4096)
    }

    /// How many blocks there are.
    pub fn blocks(&self) -> u64 {
        self.runs().div_ceil(self.block_runs())
    }

    /// The runs of a block.
    pub fn block(&self, block: u64) -> Range<u64> {
        let first = block * self.block_runs();
        first..(first + self.block_runs()).min(self.runs())
    }

    /// The values of the axes at a point.
    pub fn values(&self, point: u64) -> Vec<toml::Value> {
        let mut values = self.points.values(point);
        let axes = self.whole.iter().zip(&self.spec.axes);
        for (value, (whole, axis)) in values.iter_mut().zip(axes) {
            let drawn = number(value).filter(|_| *whole && axis.is_sampled());
            *value = match drawn {
                Some(x) => toml::Value::Integer(axis.whole(x)),
                None => as_key(value.clone(), *whole),
            };
        }
        values
    }

    /// The scene of a run.
    ///
    /// # Errors
    /// Why there is no such scene.
    pub fn scene(&self, run: u64) -> Result<Scene, String> {
        let values = self.values(run / self.spec.seeds);
        let along = self.along.iter().zip(&values).flat_map(|(along, value)| {
            let base = number(value);
            along.iter().filter_map(move |(key, factor)| {
                Some((key.as_str(), toml::Value::Float(base? * factor)))
            })
        });
        let own = self.spec.axes.iter().zip(&values);
        let own = own.map(|(axis, value)| (axis.key.as_str(), value.clone()));
        let mut scene = self
            .template
            .with(own.chain(along))
            .map_err(|e| e.to_string())?;
        scene.seed = self.seed(run);
        Ok(scene)
    }

    fn seed(&self, run: u64) -> u64 {
        self.spec.first_seed + run % self.spec.seeds
    }

    /// How `runs` runs are best given to `jobs` threads: one at a time, or, where seeds can go abreast, as many as fill the lanes several
    /// times, and fewer towards the end, so that all threads end together. Only seeds of one point go abreast: a share holds whole points, and no
    /// more of them than a part needs, since what is not in a part is lost with a kill.
    pub fn shares(&self, runs: u64, jobs: usize) -> Shares {
        if !self.goes_abreast() {
            return Shares {
                size: 1,
                whole: runs,
                rest: Vec::new(),
            };
        }
        let threads = jobs as u64;
        let points = self.block_runs().next_multiple_of(self.spec.seeds);
        let most = points.clamp(LEAST_ABREAST, MOST_ABREAST);
        let whole = runs.saturating_sub((threads + 1) * most) / most;
        let mut rest = Vec::new();
        let mut first = whole * most;
        while first < runs {
            let share = (runs - first) / (threads + 1);
            let share = share.clamp(LEAST_ABREAST, most);
            let last = runs.min(first + share.next_multiple_of(WORTH_ABREAST));
            rest.push(first..last);
            first = last;
        }
        Shares {
            size: most,
            whole,
            rest,
        }
    }

    fn goes_abreast(&self) -> bool {
        !self.spec.recordings && self.spec.seeds >= WORTH_ABREAST
    }

    /// Runs some runs: their rows, which say why where there is no result. A recording goes into `recordings` where one is named.
    ///
    /// A row does not depend on which others are computed with it.
    ///
    /// # Errors
    /// A recording that the disk does not take: that says nothing of its run, which has no row until it is made again.
    pub fn run(
        &self,
        runs: Range<u64>,
        recordings: Option<&Path>,
    ) -> Result<Vec<Vec<Cell>>, String> {
        let measure = |runs: Range<u64>| {
            std::panic::catch_unwind(AssertUnwindSafe(|| self.measure(runs, recordings)))
        };
        let mut rows = Vec::new();
        for point in self.by_point(runs) {
            if let Ok(found) = measure(point.clone()) {
                rows.extend(point.zip(found?).map(|(run, found)| self.row(run, found)));
                continue;
            }
            // One of them breaks off; the others need not suffer.
            for run in point {
                let found = measure(run..run + 1).unwrap_or_else(|cause| {
                    let text = cause
                        .downcast_ref::<String>()
                        .map(String::as_str)
                        .or_else(|| cause.downcast_ref::<&str>().copied())
                        .unwrap_or("no message");
                    Ok(vec![Measured::failed(format!(
                        "the program broke off: {text}"
                    ))])
                });
                rows.extend(found?.into_iter().map(|found| self.row(run, found)));
            }
        }
        Ok(rows)
    }

    /// Runs, by the points that they are of.
    fn by_point(&self, runs: Range<u64>) -> impl Iterator<Item = Range<u64>> {
        let seeds = self.spec.seeds;
        let points = runs.start / seeds..runs.end.div_ceil(seeds);
        points.map(move |p| runs.start.max(p * seeds)..runs.end.min((p + 1) * seeds))
    }

    /// What stands before the metrics in the row of a run.
    fn head(&self, run: u64) -> Vec<Cell> {
        let mut row = vec![whole(run), whole(run / self.spec.seeds)];
        for (value, column) in self
            .values(run / self.spec.seeds)
            .iter()
            .zip(&self.columns[2..])
        {
            row.push(match column.kind {
                Kind::Real => number(value).map_or(Cell::Empty, Cell::Real),
                Kind::Truth => value.as_bool().map_or(Cell::Empty, Cell::Truth),
                _ => Cell::Text(
                    value
                        .as_str()
                        .map_or_else(|| value.to_string(), str::to_owned),
                ),
            });
        }
        row.push(whole(self.seed(run)));
        row
    }

    fn row(&self, run: u64, found: Measured) -> Vec<Cell> {
        let Measured {
            metrics,
            stats,
            remarks,
            failed,
        } = found;
        let mut row = self.head(run);
        row.extend(metrics);
        row.resize(3 + self.spec.axes.len() + self.metrics.len(), Cell::Empty);
        let work = |of: fn(&Stats) -> u64| stats.as_ref().map_or(Cell::Empty, |s| whole(of(s)));
        row.extend([
            work(|s| s.steps),
            work(|s| s.rejected),
            work(|s| s.evaluations),
            work(|s| s.events),
        ]);
        row.push(match remarks.is_empty() {
            true => Cell::Empty,
            false => Cell::Text(remarks.join(BETWEEN_REMARKS)),
        });
        row.push(failed.map_or(Cell::Empty, Cell::Text));
        row.push(Cell::Text(VERSION.into()));
        row
    }

    /// How the runs of a scene are computed: by plan and scene alone, not by how many happen to be together, for a row is to be the same however
    /// the runs are shared out.
    fn way(&self, scene: &Scene) -> Way {
        let samples = scene.duration_s * scene.log_rate_hz;
        let auto = scene.solver.method == METHODS[0].name;
        Way {
            // A method that locates contacts keeps its tolerance without the account, and costs less. Others are judged by it alone.
            unwatched: !self.keeps_account && scene.solver.energy && method_of(scene).locates,
            abreast: self.goes_abreast() && auto && samples <= LONGEST_ABREAST,
        }
    }

    fn measure(
        &self,
        runs: Range<u64>,
        recordings: Option<&Path>,
    ) -> Result<Vec<Measured>, String> {
        let mut scene = match self.scene(runs.start) {
            Ok(scene) => scene,
            Err(reason) => return Ok(runs.map(|_| Measured::failed(reason.clone())).collect()),
        };
        let Way { unwatched, abreast } = self.way(&scene);
        scene.solver.energy &= !unwatched;
        if abreast && recordings.is_none() {
            let seeds = scene.seed..scene.seed + (runs.end - runs.start);
            let weigh = |columns: &Columns, stats: &Stats, outcome: &Result<(), Stopped>| {
                let outcome = outcome.clone().map_err(|e| e.to_string());
                let measured = self.weigh(&scene, columns, *stats, outcome);
                (measured, unwatched && columns.doubtful)
            };
            let metrics = &self.metrics;
            let found = measure_abreast(&scene, seeds, metrics, MOST_EVALUATIONS, weigh);
            if let Some(found) = found {
                let sure = |(run, (measured, doubted))| match doubted {
                    true => with_its_account(&scene, self.seed(run), measured),
                    false => measured,
                };
                return Ok(runs.zip(found).map(sure).collect());
            }
        }
        let alone = |run: u64| {
            let seed = self.seed(run);
            let scene = Scene {
                seed,
                ..scene.clone()
            };
            self.measure_alone(run, &scene, unwatched, recordings)
        };
        runs.map(alone).collect()
    }

    fn measure_alone(
        &self,
        run: u64,
        scene: &Scene,
        unwatched: bool,
        recordings: Option<&Path>,
    ) -> Result<Measured, String> {
        let model;
        let mut keeper = Keeper::default();
        if let Some(folder) = recordings {
            model = Model::new(scene);
            let path = folder.join(parts::recording_name(run));
            let recorder = RecordingWriter::create(&path, &WriterOptions::default())
                .and_then(|writer| Recorder::new(&model, writer));
            match recorder {
                Ok(recorder) => keeper.recorder = Some(recorder),
                Err(error) => return of_its_run(&error).map(Measured::failed),
            }
        }
        let (columns, stats, outcome) = observe(scene, Some(MOST_EVALUATIONS), &mut keeper);
        // The writer knows best why it stopped a run.
        let failure = keeper.recorder.as_mut().and_then(Recorder::failure);
        let ended = match (failure, outcome) {
            (Some(error), _) => Err(of_its_run(&error)?),
            // As of a run that `sim record` gives up, nothing is kept.
            (None, Err(stopped)) => Err(stopped.to_string()),
            (None, Ok(())) => match keeper.recorder.map_or(Ok(()), Recorder::finish) {
                Ok(()) => Ok(()),
                Err(error) => Err(of_its_run(&error)?),
            },
        };
        let measured = self.weigh(scene, &columns, stats, ended);
        Ok(match unwatched && keeper.doubtful {
            true => with_its_account(scene, scene.seed, measured),
            false => measured,
        })
    }

    /// The metrics of a run that has ended.
    fn weigh(
        &self,
        scene: &Scene,
        columns: &Columns,
        stats: Stats,
        ended: Result<(), String>,
    ) -> Measured {
        if let Err(reason) = ended {
            return Measured {
                stats: Some(stats),
                ..Measured::failed(reason)
            };
        }
        let inputs = &columns.inputs;
        let wanted = |name: &str| self.metrics.iter().any(|m| m.name == name);
        let found = metrics_of(inputs, Window::from(scene.analysis_start_s), wanted);
        let cell = |metric: &&Metric| {
            found.get(metric.name).map_or(Cell::Empty, |value| {
                let real = value.as_f64().map(Cell::Real);
                real.or_else(|| value.as_bool().map(Cell::Truth))
                    .or_else(|| value.as_word().map(|w| Cell::Text(w.into())))
                    .unwrap_or(Cell::Empty)
            })
        };
        let metrics: Vec<Cell> = self.metrics.iter().map(cell).collect();
        let window = Window::from(scene.analysis_start_s).range(&inputs.t_s);
        let nothing = window.is_empty() && metrics.iter().all(|c| *c == Cell::Empty);
        let why = || {
            format!(
                "the window of analysis begins at {} s (`analysis_start_s`), behind the end of the run at {} s",
                scene.analysis_start_s, scene.duration_s
            )
        };
        Measured {
            metrics,
            stats: Some(stats),
            remarks: columns.remarks.said(scene),
            failed: nothing.then(why),
        }
    }
}

/// What was measured, unless the energy account of the same run ends it.
fn with_its_account(scene: &Scene, seed: u64, measured: Measured) -> Measured {
    if measured.failed.is_some() {
        return measured;
    }
    let mut scene = Scene {
        seed,
        ..scene.clone()
    };
    scene.solver.energy = true;
    let (_, stats, outcome) = observe(&scene, Some(MOST_EVALUATIONS), &mut |_: &Sample| true);
    match outcome {
        Ok(()) => measured,
        Err(reason) => Measured {
            stats: Some(stats),
            ..Measured::failed(reason.to_string())
        },
    }
}

/// How the runs of a point are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Way {
    /// Without their energy account.
    unwatched: bool,
    /// Side by side.
    abreast: bool,
}

/// A count in a table. OK because all these are far below 2^63.
fn whole(n: u64) -> Cell {
    Cell::Whole(n as i64)
}

/// Runs in the order in which threads are given them: shares of one size, then smaller ones.
pub struct Shares {
    size: u64,
    whole: u64,
    rest: Vec<Range<u64>>,
}

impl Shares {
    /// How many.
    pub fn count(&self) -> u64 {
        self.whole + self.rest.len() as u64
    }

    /// The runs of share `k`.
    ///
    /// # Panics
    /// When there are not so many.
    pub fn get(&self, k: u64) -> Range<u64> {
        match k.checked_sub(self.whole) {
            Some(place) => self.rest[place as usize].clone(),
            None => k * self.size..(k + 1) * self.size,
        }
    }
}

/// What came of a run: its metrics in the order of the plan's, the solver's work, and why there are none.
struct Measured {
    metrics: Vec<Cell>,
    stats: Option<Stats>,
    /// What the motion did that nobody carries so.
    remarks: Vec<String>,
    failed: Option<String>,
}

impl Measured {
    fn failed(reason: String) -> Self {
        Self {
            metrics: Vec::new(),
            stats: None,
            remarks: Vec::new(),
            failed: Some(reason),
        }
    }
}

/// What a recording's writer says of the run; an error where it is the disk that it speaks of.
fn of_its_run(error: &WriteError) -> Result<String, String> {
    match error {
        WriteError::Io { .. } => Err(error.to_string()),
        _ => Ok(error.to_string()),
    }
}

/// Records what it sees where that is asked for, and remembers a doubt.
#[derive(Default)]
struct Keeper<'m> {
    recorder: Option<Recorder<'m>>,
    doubtful: bool,
}

impl Listener for Keeper<'_> {
    fn sample(&mut self, sample: &Sample) -> bool {
        self.doubtful |= sample.doubtful;
        self.recorder.as_mut().is_none_or(|r| r.sample(sample))
    }

    fn reading(&mut self, reading: &Reading<'_>) {
        if let Some(recorder) = &mut self.recorder {
            recorder.reading(reading);
        }
    }
}

/// How many values of a row or a range are tried before its key is called a slip.
const TRIED: u64 = 100;

/// A key that no value can be given to is a slip; a value out of a range that a scene may not have is a row with its reason.
fn try_axis(axis: &spec::Axis, template: &Template) -> Result<(), String> {
    let whole = is_whole(axis, template);
    if let (true, Some(broken)) = (
        whole,
        axis.values
            .iter()
            .find(|v| number(v).is_some_and(|x| x.fract() != 0.0)),
    ) {
        return Err(format!(
            "axis `{}`: found {broken}, expected whole numbers",
            axis.key
        ));
    }
    let as_key = |value: toml::Value| as_key(value, whole);
    if let Some(twice) = stands_twice(axis, as_key) {
        let why = if whole && axis.count.is_some() {
            ", rounded to whole numbers,"
        } else {
            ""
        };
        return Err(format!(
            "axis `{}`: its values{why} hold {twice} twice; every point once is enough, `seeds` says how often it is run",
            axis.key
        ));
    }
    let mut why = Ok(());
    for value in tried(axis) {
        let set = with_along(axis, value, template);
        match template.with(set.iter().map(|(k, v)| (k.as_str(), v.clone()))) {
            Ok(_) => return Ok(()),
            Err(error) => why = why.and(Err(format!("axis `{}`: {error}", axis.key))),
        }
    }
    why
}

/// Values of an axis that are tried before a study begins: all that are named, some of many.
fn tried(axis: &spec::Axis) -> Vec<toml::Value> {
    match (axis.is_sampled(), axis.len().min(TRIED)) {
        (true, _) => (0..=TRIED)
            .map(|k| axis.at(k as f64 / TRIED as f64).into())
            .collect(),
        (false, _) if axis.count.is_none() => axis.values.clone(),
        (false, n) => (0..n)
            .map(|k| axis.value(k * (axis.len() - 1) / (n - 1).max(1)))
            .collect(),
    }
}

/// Whether an axis' key holds a whole number.
fn is_whole(axis: &spec::Axis, template: &Template) -> bool {
    let value = template.value(&axis.key);
    value.is_some_and(toml::Value::is_integer)
}

/// A value as its key takes it: rounded where that is a `whole` number.
fn as_key(value: toml::Value, whole: bool) -> toml::Value {
    match value {
        toml::Value::Float(x) if whole => toml::Value::Integer(x.round() as i64),
        other => other,
    }
}

/// What a value of an axis sets: its key, and what goes along with it.
fn with_along(
    axis: &spec::Axis,
    value: toml::Value,
    template: &Template,
) -> Vec<(String, toml::Value)> {
    let value = as_key(value, is_whole(axis, template));
    let along = flatten(&axis.along)
        .into_iter()
        .filter_map(|(key, factor)| Some((key, (number(&value)? * number(&factor)?).into())));
    let along: Vec<(String, toml::Value)> = along.collect();
    [vec![(axis.key.clone(), value)], along].concat()
}

/// A value that is named and can never be, such as a word for a number, would cost all its runs: one that is refused for its own key, alone and beside
/// any value of another axis.
fn no_value_is_hopeless<'a>(
    axis: &spec::Axis,
    template: &Template,
    others: impl Iterator<Item = &'a spec::Axis> + Clone,
) -> Result<(), String> {
    let beside: Vec<Vec<(String, toml::Value)>> = others
        .flat_map(|other| {
            tried(other)
                .into_iter()
                .map(|v| with_along(other, v, template))
        })
        .collect();
    let named = axis.values.iter().filter(|_| axis.count.is_none());
    for value in named {
        let own = with_along(axis, value.clone(), template);
        let made = |beside: &[(String, toml::Value)]| {
            let set = own.iter().chain(beside);
            template.with(set.map(|(k, v)| (k.as_str(), v.clone())))
        };
        let Err(error) = made(&[]) else { continue };
        let error = error.to_string();
        if error.contains(&axis.key) && !beside.iter().any(|other| made(other).is_ok()) {
            return Err(format!("axis `{}`: {error}", axis.key));
        }
    }
    Ok(())
}

/// A value that an axis with values of its own has more than once.
fn stands_twice(
    axis: &spec::Axis,
    as_key: impl Fn(toml::Value) -> toml::Value,
) -> Option<toml::Value> {
    if axis.is_sampled() {
        return None;
    }
    let mut values = (0..axis.len()).map(|k| as_key(axis.value(k)));
    if axis.count.is_some() {
        // A row goes one way.
        let mut last = None;
        return values.find(|v| last.replace(v.clone()).as_ref() == Some(v));
    }
    let mut seen = std::collections::BTreeSet::new();
    // 1 and 1.0 are one value.
    values.find(|v| !seen.insert(number(v).map_or_else(|| v.to_string(), |x| x.to_string())))
}

fn columns(spec: &Spec, metrics: &[&Metric]) -> Vec<Column> {
    let column = |name: &str, kind, unit: &str| Column {
        name: name.into(),
        kind,
        unit: unit.into(),
    };
    let mut out = vec![
        column("run", Kind::Whole, ""),
        column("point", Kind::Whole, ""),
    ];
    for axis in &spec.axes {
        let kind = match &axis.values {
            values if values.iter().all(|v| number(v).is_some()) => Kind::Real,
            values if values.iter().all(toml::Value::is_bool) => Kind::Truth,
            _ => Kind::Text,
        };
        let unit = match kind {
            Kind::Real => recording::signal::unit_of("", &axis.key),
            _ => "",
        };
        out.push(column(&axis.name, kind, unit));
    }
    out.push(column("seed", Kind::Whole, ""));
    for metric in metrics {
        let kind = match metric.unit {
            "bool" => Kind::Truth,
            "-" => Kind::Text,
            _ => Kind::Real,
        };
        let unit = if kind == Kind::Real { metric.unit } else { "" };
        out.push(column(metric.name, kind, unit));
    }
    for name in ["steps", "rejected", "evaluations", "events"] {
        out.push(column(name, Kind::Whole, ""));
    }
    out.push(column("remarks", Kind::Text, ""));
    out.push(column("failed", Kind::Text, ""));
    out.push(column("version", Kind::Text, ""));
    out
}

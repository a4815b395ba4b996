//! Runs that another study has computed: the same scene and seed, computed the same way by the same version, make the same row.

use super::parts::{Foreign, Progress, Store};
use super::shard::Shard;
use super::table::Cell;
use super::{Plan, Way};
use sim::scene::to_toml;
use std::collections::{BTreeMap, HashMap};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Parts that are kept in memory: runs are asked for in order, on several threads.
const MOST_PARTS: usize = 16;
/// Points that are remembered, for the same reason.
const MOST_POINTS: usize = 1024;

type Rows = Arc<Vec<Vec<Cell>>>;

/// A study whose runs another one may take over.
pub struct Known {
    plan: Plan,
    folder: PathBuf,
    /// What of it is there.
    pub progress: Progress,
    /// Its points by a checksum of their scenes.
    points: HashMap<u64, u64>,
    /// Where the metrics of the study that takes over stand in a row here.
    metrics: Vec<usize>,
    parts: Mutex<BTreeMap<u64, Rows>>,
    /// Which point here is a point of the study that takes over.
    found: Mutex<BTreeMap<u64, Option<u64>>>,
    taken: AtomicU64,
}

impl Known {
    /// The study in `folder`, for `plan` to take runs from.
    ///
    /// # Errors
    /// One sentence: a folder without a study, parts of another version of this program, metrics that it has not, recordings that are asked for.
    pub fn load(folder: &Path, plan: &Plan) -> Result<Self, String> {
        let its = Plan::load(&folder.join("study.toml"))?;
        if plan.spec.recordings {
            return Err(format!(
                "{}: runs that are taken over have no recordings here; leave out `recordings = true`, or compute all runs anew",
                folder.display()
            ));
        }
        let place = |name: &str| its.columns.iter().position(|c| c.name == name);
        let names = plan.metrics.iter().map(|m| m.name);
        let has = |name: &&str| its.metrics.iter().any(|m| m.name == *name);
        let lacking: Vec<&str> = names.clone().filter(|n| !has(n)).collect();
        if !lacking.is_empty() {
            return Err(format!(
                "{}: its runs have no {}, which this study asks for, so they cannot be taken over",
                folder.display(),
                lacking.join(", ")
            ));
        }
        let metrics = names.filter_map(place).collect();
        let progress = Store::new(&its, folder)
            .parts(Shard::WHOLE, false)
            .map_err(|foreign| match foreign {
                Foreign::Study(why) | Foreign::Version(why) => why,
            })
            .map_err(|why| format!("{why}; it cannot be taken over"))?;
        let mut points = HashMap::new();
        for point in 0..its.points() {
            if let Some(scene) = Same::of(&its, point) {
                points.entry(scene.checksum()).or_insert(point);
            }
        }
        Ok(Self {
            plan: its,
            folder: folder.into(),
            progress,
            points,
            metrics,
            parts: Mutex::default(),
            found: Mutex::default(),
            taken: AtomicU64::new(0),
        })
    }

    /// How many rows were taken so far.
    pub fn taken(&self) -> u64 {
        self.taken.load(Ordering::Relaxed)
    }

    /// What came of it, behind what is said of `runs` that were asked for.
    pub fn says(&self, runs: u64) -> String {
        let folder = self.folder.display();
        match self.taken() {
            0 if runs == 0 => String::new(),
            0 if self.progress.runs == 0 => format!("; {folder} has no runs to take over"),
            0 => format!(
                "; none was taken over: of the {} runs in {folder} none has the scene and the seed of one here and was computed the same way (side by side or one by one, docs/studies.md)",
                self.progress.runs
            ),
            n => format!("; {n} of them were taken over from {folder}"),
        }
    }

    /// The rows of runs of `plan`, those that are not here from `compute`, which is asked for as many at a time as can be.
    ///
    /// # Errors
    /// Those of `compute`.
    pub fn complete(
        &self,
        plan: &Plan,
        runs: Range<u64>,
        compute: impl Fn(Range<u64>) -> Result<Vec<Vec<Cell>>, String>,
    ) -> Result<Vec<Vec<Cell>>, String> {
        let points = plan.by_point(runs);
        let rows: Result<Vec<_>, String> = points
            .map(|runs| self.complete_point(plan, runs, &compute))
            .collect();
        Ok(rows?.concat())
    }

    /// The same of runs of one point.
    fn complete_point(
        &self,
        plan: &Plan,
        runs: Range<u64>,
        compute: impl Fn(Range<u64>) -> Result<Vec<Vec<Cell>>, String>,
    ) -> Result<Vec<Vec<Cell>>, String> {
        let Some(point) = self.point(plan, runs.start / plan.spec.seeds) else {
            return compute(runs);
        };
        let mut rows: Vec<Vec<Cell>> = Vec::new();
        let mut missing = runs.start..runs.start;
        for run in runs {
            let Some(known) = self.row(point, plan.seed(run)) else {
                missing.end = run + 1;
                continue;
            };
            rows.extend(compute(missing)?);
            missing = run + 1..run + 1;
            let tail = known.len() - super::AFTER_METRICS;
            let metrics = self.metrics.iter().map(|&column| known[column].clone());
            let mut row = plan.head(run);
            row.extend(metrics.chain(known[tail..].iter().cloned()));
            rows.push(row);
            self.taken.fetch_add(1, Ordering::Relaxed);
        }
        rows.extend(compute(missing)?);
        Ok(rows)
    }

    /// Which point here has the scene of a point of `plan`.
    fn point(&self, plan: &Plan, point: u64) -> Option<u64> {
        let remembered = || self.found.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = remembered().get(&point) {
            return *found;
        }
        let same = Same::of(plan, point);
        let found = same.and_then(|scene| {
            let candidate = *self.points.get(&scene.checksum())?;
            (Same::of(&self.plan, candidate)? == scene).then_some(candidate)
        });
        let mut remembered = remembered();
        remembered.insert(point, found);
        if remembered.len() > MOST_POINTS {
            remembered.pop_first();
        }
        found
    }

    fn row(&self, point: u64, seed: u64) -> Option<Vec<Cell>> {
        let its = &self.plan;
        let place = seed.checked_sub(its.spec.first_seed)?;
        if place >= its.spec.seeds {
            return None;
        }
        let run = point * its.spec.seeds + place;
        let rows = self.part(run / its.block_runs());
        rows.get((run % its.block_runs()) as usize).cloned()
    }

    /// The rows of a part; none where it is missing or damaged.
    fn part(&self, block: u64) -> Rows {
        let mut parts = self.parts.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(rows) = parts.get(&block) {
            return rows.clone();
        }
        let read = Store::new(&self.plan, &self.folder).part_rows(block);
        let rows = Rows::new(read.ok().flatten().unwrap_or_default());
        parts.insert(block, rows.clone());
        if parts.len() > MOST_PARTS {
            parts.pop_first();
        }
        rows
    }
}

/// What makes two points' runs of one seed the same.
#[derive(PartialEq, Eq, Hash)]
struct Same {
    scene: String,
    way: Way,
}

impl Same {
    /// Of a point; none where there is no such scene.
    fn of(plan: &Plan, point: u64) -> Option<Self> {
        let mut scene = plan.scene(point * plan.spec.seeds).ok()?;
        scene.seed = 0;
        Some(Self {
            way: plan.way(&scene),
            scene: to_toml(&scene),
        })
    }

    fn checksum(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.hash(&mut hasher);
        hasher.finish()
    }
}

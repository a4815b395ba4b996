//! Hard cases: scenes at the edge of what numbers can do, each with what physics says must hold.
//!
//! One entry in [`CASES`] adds one; every method that claims it runs it, in a test and in `sim accuracy --hard`. What must hold is
//! a closed form, a conserved quantity, the energy ledger or another run that physics says is the same; beside it, whatever
//! the case, every number is finite and every quaternion has length one.

mod check;
mod closed_forms;
mod table;

pub use table::CASES;

use crate::model::Model;
use crate::run::{Listener, Sample, run_model, settings};
use crate::scene::{Scene, parse};
use crate::solve::{Event, METHODS, Method, Settings, Stats};
use check::Checks;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// One hard case.
pub struct Case {
    /// Name.
    pub name: &'static str,
    /// What is hard about it.
    pub about: &'static str,
    /// What must hold.
    pub holds: &'static str,
    claim: fn(&Method) -> bool,
    toml: fn() -> String,
    check: fn(&Run, &mut Checks),
}

/// What a run left behind.
struct Run {
    method: &'static Method,
    scene: Scene,
    samples: Vec<Sample>,
    events: Vec<Event>,
    stats: Stats,
    /// Why it stopped early.
    stopped: Option<String>,
}

/// What a run tells as it goes.
#[derive(Default)]
struct Heard {
    samples: Vec<Sample>,
    events: Vec<Event>,
}

impl Listener for Heard {
    fn sample(&mut self, sample: &Sample) -> bool {
        self.samples.push(sample.clone());
        true
    }
    fn event(&mut self, event: &Event) {
        self.events.push(event.clone());
    }
}

/// How a method did in a case.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// Work done.
    pub stats: Stats,
    /// The largest part of a bound that was used, 1 being all of it.
    pub used: f64,
    /// What did not hold.
    pub broken: Option<String>,
}

/// Far more than any case needs: a method that gets there hangs.
const MOST_EVALUATIONS: u64 = 400_000_000;

impl Run {
    fn new(name: &str, toml: &str, method: &'static Method) -> Result<Self, String> {
        let scene = parse(name, toml, &[]).map_err(|e| e.to_string())?;
        let settings = Settings {
            most_evaluations: MOST_EVALUATIONS,
            ..settings(&scene)
        };
        let mut heard = Heard::default();
        let model = Model::new(&scene);
        let (stats, outcome) = run_model(&model, method, &settings, &mut heard);
        Ok(Self {
            method,
            samples: heard.samples,
            events: heard.events,
            stats,
            stopped: outcome.err().map(|e| e.to_string()),
            scene,
        })
    }

    /// The same method on another scene.
    fn other(&self, toml: &str) -> Result<Self, String> {
        let other = Self::new("other", toml, self.method)?;
        match &other.stopped {
            None => Ok(other),
            Some(cause) => Err(format!("the run to compare with stopped: {cause}")),
        }
    }

    fn last(&self) -> &Sample {
        &self.samples[self.samples.len() - 1]
    }

    /// A bound for methods that control or hardly make errors, and one for those of low order at 1 ms.
    fn bound(&self, fine: f64, low_order: f64) -> f64 {
        if table::precise(self.method) {
            fine
        } else {
            low_order
        }
    }
}

impl Case {
    /// Whether a method claims to do this case.
    pub fn claimed_by(&self, method: &Method) -> bool {
        (self.claim)(method)
    }

    /// Runs the case by a method.
    pub fn run(&self, method: &'static Method) -> Verdict {
        let toml = format!("name = \"{}\"\n{}", self.name, (self.toml)());
        let run = match Run::new(self.name, &toml, method) {
            Ok(run) => run,
            Err(cause) => {
                return Verdict {
                    stats: Stats::default(),
                    used: f64::INFINITY,
                    broken: Some(cause),
                };
            }
        };
        let mut checks = Checks::default();
        checks.sound(&run);
        (self.check)(&run, &mut checks);
        Verdict {
            stats: run.stats,
            used: checks.used,
            broken: checks.broken,
        }
    }
}

/// Every case by every method, `None` where it claims nothing; cases in the order of [`CASES`], methods in that of [`METHODS`].
/// Runs on every core; `progress` hears each case that is done.
pub fn run_all(progress: impl Fn(&Case) + Sync) -> Vec<Vec<Option<Verdict>>> {
    let next = AtomicUsize::new(0);
    let table = Mutex::new(vec![Vec::new(); CASES.len()]);
    let work = || {
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            let Some(case) = CASES.get(i) else { break };
            let row: Vec<Option<Verdict>> = METHODS
                .iter()
                .map(|m| case.claimed_by(m).then(|| case.run(m)))
                .collect();
            // A panic elsewhere ends the whole call: there is nothing to rescue.
            table.lock().unwrap_or_else(|e| e.into_inner())[i] = row;
            progress(case);
        }
    };
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    std::thread::scope(|scope| {
        for _ in 0..cores {
            scope.spawn(work);
        }
    });
    table.into_inner().unwrap_or_else(|e| e.into_inner())
}

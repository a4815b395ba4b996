//! Integration methods: one file each, and one line each in [`METHODS`].

pub mod abreast;
mod adams4;
mod auto;
mod course;
mod dop853;
mod dopri5;
mod events;
mod fehlberg8;
mod first_steps;
mod fixed;
mod pair;
mod radau15;
mod radau5;
mod rk4;
mod rkmk4;
mod semi_implicit_euler;

pub use course::{Event, EventKind};

use crate::model::{Model, Workspace};
use recording::text::meant::did_you_mean;

/// No velocity's error counts as decaying more slowly than this, 1/s: see [`Model::units`].
const SLOWEST_PER_S: f64 = 2.0;

/// What a method is told.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Tolerance of an adaptive method; 1 means one unit of [`Model::units`].
    pub tolerance: f64,
    /// Step of a fixed-step method, s.
    pub step_s: f64,
    /// Most evaluations of the right-hand side before the run is given up.
    pub most_evaluations: u64,
}

/// Who watches a run.
pub trait Observer {
    /// Whether samples must come with forces, which cost an evaluation each.
    fn looks_at_forces(&self) -> bool {
        true
    }
    /// A sample at a log time; `w` holds the forces there, if [`Self::looks_at_forces`]. Returning `false` stops the run.
    fn sample(&mut self, t_s: f64, y: &[f64], w: &Workspace) -> bool;
    /// A tick of one of [`Model::sensor_clocks`]. `w` may be evaluated anew; the next step does not read it.
    fn tick(&mut self, _clock: usize, _tick: u64, _t_s: f64, _y: &[f64], _w: &mut Workspace) {}
    /// Something happened between samples.
    fn event(&mut self, _event: &Event) {}
    /// A run that went side by side with others has ended.
    fn ended(&mut self, _stats: &Stats, _outcome: &Result<(), Stopped>) {}
}

/// Work done by a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stats {
    /// Accepted steps.
    pub steps: u64,
    /// Rejected steps.
    pub rejected: u64,
    /// Evaluations of the right-hand side, those for dense output and event location included.
    pub evaluations: u64,
    /// Contacts opened or closed.
    pub events: u64,
    /// Accepted steps of an implicit method, among the others.
    pub implicit: u64,
}

/// Why a run ended before its time.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Stopped {
    /// The error cannot be kept within the tolerance.
    #[error(
        "{method} gave up at t = {t_s} s: the step fell to {step_s:.1e} s without reaching the tolerance {tolerance:e}; loosen solver.tolerance or soften the scene"
    )]
    StepTooSmall {
        /// Method name.
        method: &'static str,
        /// When, s.
        t_s: f64,
        /// Last step tried, s.
        step_s: f64,
        /// Tolerance asked for.
        tolerance: f64,
    },
    /// A state left the range of numbers.
    #[error(
        "{method} gave up at t = {t_s} s: {state} is no longer a finite number; a smaller --set solver.step_s or an adaptive --method may help"
    )]
    NotFinite {
        /// Method name.
        method: &'static str,
        /// When, s.
        t_s: f64,
        /// Name of the state.
        state: String,
    },
    /// More work than allowed.
    #[error(
        "{method} gave up at t = {t_s} s: {evaluations} evaluations were not enough for the whole run"
    )]
    TooMuchWork {
        /// Method name.
        method: &'static str,
        /// When, s.
        t_s: f64,
        /// Evaluations spent.
        evaluations: u64,
    },
    /// More states than an implicit method can hold matrices of.
    #[error(
        "{method} holds matrices of {states} by {states} numbers, at most {most} are allowed; use an explicit --method"
    )]
    TooManyStates {
        /// Method name.
        method: &'static str,
        /// How many there are.
        states: usize,
        /// How many there may be.
        most: usize,
    },
    /// The energy ledger shows more energy from nowhere than can be believed.
    #[error(
        "{method} gave up at t = {t_s} s: {nowhere_j:.1e} J came from nowhere where {supplied_j:.1e} J were supplied; take a smaller --set solver.step_s, a smaller --tolerance or another --method (an effect that keeps no account in the ledger looks so too)"
    )]
    FromNowhere {
        /// Method name.
        method: &'static str,
        /// When, s.
        t_s: f64,
        /// What the ledger does not explain, J.
        nowhere_j: f64,
        /// What was there at the start, and came from gravity and from the shoulders, J.
        supplied_j: f64,
    },
    /// An effect gave more energy than everything else supplied: its law is used beyond its range.
    #[error(
        "the run was given up at t = {t_s} s: effects.{effect} gave {given_j:.1e} J where {supplied_j:.1e} J were supplied, which its law does beyond the range it is valid in; give it, or the contact, more damping"
    )]
    FedByEffect {
        /// Its name.
        effect: &'static str,
        /// When, s.
        t_s: f64,
        /// What laws gave more than they took, J.
        given_j: f64,
        /// What was there at the start, and came from gravity and from the shoulders, J.
        supplied_j: f64,
    },
    /// The observer asked to stop.
    #[error("stopped at t = {t_s} s")]
    ByObserver {
        /// When, s.
        t_s: f64,
    },
}

impl Stopped {
    /// What happened, without advice that only who chose method and tolerance can follow.
    pub fn what(&self) -> String {
        let said = self.to_string();
        said.split("; ")
            .next()
            .map_or_else(String::new, str::to_owned)
    }
}

type Run = fn(&Model, &Settings, &mut dyn Observer) -> (Stats, Result<(), Stopped>);

/// One line of the table of methods.
pub struct Method {
    /// Name for `--method`.
    pub name: &'static str,
    /// One sentence.
    pub about: &'static str,
    /// Order of accuracy between events.
    pub order: u32,
    /// Whether it chooses its steps by the tolerance.
    pub adaptive: bool,
    /// Whether it locates contact events.
    pub locates: bool,
    /// Integrates a model from its initial state.
    pub run: Run,
}

/// The method that `method` stands for: itself, or what `auto` begins with for this model and these settings.
pub fn resolve(method: &'static Method, model: &Model, settings: &Settings) -> &'static Method {
    match method.name {
        "auto" => self::method(auto::first(model, settings)).unwrap_or(method),
        _ => method,
    }
}

/// Every method. The first is the default.
pub const METHODS: &[Method] = &[
    Method {
        name: "auto",
        about: "the cheapest: radau15 for few carriers, else dop853 below 3e-5 and dopri5 above; radau5 where that is limited by stability",
        order: 8,
        adaptive: true,
        locates: true,
        run: auto::run,
    },
    Method {
        name: "dop853",
        about: "Dormand-Prince 8(5,3), adaptive, contact events located",
        order: 8,
        adaptive: true,
        locates: true,
        run: pair::run::<dop853::Dop853, true>,
    },
    Method {
        name: "dop853-blind",
        about: "the same without locating contact events",
        order: 8,
        adaptive: true,
        locates: false,
        run: pair::run::<dop853::Dop853, false>,
    },
    Method {
        name: "dopri5",
        about: "Dormand-Prince 5(4), adaptive, contact events located",
        order: 5,
        adaptive: true,
        locates: true,
        run: pair::run::<dopri5::Dopri5, true>,
    },
    Method {
        name: "dopri5-blind",
        about: "the same without locating contact events",
        order: 5,
        adaptive: true,
        locates: false,
        run: pair::run::<dopri5::Dopri5, false>,
    },
    Method {
        name: "fehlberg8",
        about: "Runge-Kutta-Fehlberg 8(7), adaptive, contact events located: `sim accuracy` judges the others by it",
        order: 8,
        adaptive: true,
        locates: true,
        run: pair::run::<fehlberg8::Fehlberg8, true>,
    },
    Method {
        name: "radau5",
        about: "Radau IIA 5, implicit, adaptive, contact events located: for very stiff contacts",
        order: 5,
        adaptive: true,
        locates: true,
        run: radau5::run::<true>,
    },
    Method {
        name: "radau5-blind",
        about: "the same without locating contact events",
        order: 5,
        adaptive: true,
        locates: false,
        run: radau5::run::<false>,
    },
    Method {
        name: "radau15",
        about: "Radau IIA 15, eight stages side by side, adaptive, contact events located: for few carriers",
        order: 15,
        adaptive: true,
        locates: true,
        run: radau15::run,
    },
    Method {
        name: "rkmk4",
        about: "Runge-Kutta-Munthe-Kaas of order 4 on the rotation group, fixed step",
        order: 4,
        adaptive: false,
        locates: false,
        run: fixed::run::<rkmk4::Rkmk4>,
    },
    Method {
        name: "rk4",
        about: "the classical fourth-order method, fixed step",
        order: 4,
        adaptive: false,
        locates: false,
        run: fixed::run::<rk4::Rk4>,
    },
    Method {
        name: "adams4",
        about: "four-step Adams with exact damping, one evaluation a fixed step: cheapest where a percent is enough",
        order: 4,
        adaptive: false,
        locates: false,
        run: fixed::run::<adams4::Adams4>,
    },
    Method {
        name: "semi-implicit-euler",
        about: "velocities first, then positions, fixed step: the paper archive's method",
        order: 1,
        adaptive: false,
        locates: false,
        run: fixed::run::<semi_implicit_euler::SemiImplicitEuler>,
    },
];

/// Finds a method by name.
///
/// # Errors
/// A sentence with the nearest name and the names there are.
pub fn method(name: &str) -> Result<&'static Method, String> {
    METHODS.iter().find(|m| m.name == name).ok_or_else(|| {
        let names = || METHODS.iter().map(|m| m.name);
        let hint = did_you_mean(name, names());
        format!(
            "there is no method `{name}`.{hint} There are: {}",
            names().collect::<Vec<_>>().join(", ")
        )
    })
}

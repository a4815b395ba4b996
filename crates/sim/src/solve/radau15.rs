//! Radau IIA of order 15: eight stages side by side, solved by sweeps.
//!
//! ```text
//! Y_i = y₀ + h Σ_j a_ij f(t₀ + c_j h, Y_j),  i, j = 1…8        y₁ = Y₈
//! ```
//! A small system on a wide processor: the right-hand side at all eight stages costs hardly more than at one, and the stages follow from it
//! by one product with (a_ij). Sweeps converge like Picard's iteration, a factor of ten to a hundred each; where a contact damps or drives a
//! motion faster than the step is long, the sweep solves that mode alone exactly ([`modes`]), and positions follow from new velocities,
//! so convergence depends on what is left: geometry and coupling. Carriers who do not feel the load are solved before it. Noise and
//! contacts break a run into pieces of tens of milliseconds, most of which are one such step, where an explicit method needs four of twelve
//! evaluations.
//!
//! A load that is carried in step comes by again and again, so what came after events like the last one is remembered ([`memory`]): when the
//! next is due, and how the slopes went. What a first step after a jump could be, and whether one that reaches the next moment which none
//! may cross is worth trying, is learnt too ([`sizes`]); where friction turns round, how short steps must be is known beforehand ([`turn`]).
//!
//! The stages are a polynomial of degree 8, which holds samples and events; where it does not, the step is taken anew to the moment that
//! is asked for, from what is known of it: for good at a sample of the log or an event, aside for a sensor. Within a step contacts are frozen, as in [`super::pair`].
//!
//! For models that can be evaluated so ([`Model::on_eight`]). Source: Hairer & Wanner, Solving Ordinary Differential Equations II, 2nd ed.
//! (1996), IV.5 and IV.8; the idea of one long step of order 15 by iteration: Everhart, in Dynamics of Comets (1985), 185; Rein &
//! Spiegel, MNRAS 446 (2015), 1424.

mod memory;
mod modes;
mod sizes;
mod stages;
mod tableau;
mod turn;

use super::course::{Course, just_before_s, same_moment_s, smallest_step_s};
use super::events::{self, Looks};
use super::{Observer, SLOWEST_PER_S, Settings, Stats, Stopped, dop853, pair};
use crate::freedoms::rotation;
#[cfg(target_arch = "x86_64")]
use crate::lanes::{Avx2, Avx512};
use crate::lanes::{MOMENTS, Plain8};
use crate::model::{Model, Registers, SideBySide};
use memory::Memory;
use modes::{Mode, Row, modes};
use sizes::Sizes;
use stages::{Demand, Guess, Kept, Solved, Stages, Step};
use tableau::C;
use turn::{Bend, Turn};

const NAME: &str = "radau15";
/// What a step may err by its own estimate, in units of the tolerance asked for; as [`pair::Pair::SHARE`].
const SHARE: f64 = 0.01;
/// What the iteration may leave, in units of what a step may err.
const ITERATION: f64 = 0.02;
/// Above this tolerance it may leave less, as its fourth root: there steps are as long as contacts let them be, and err less than they may
/// but for what the sweeps leave.
const LOOSE: f64 = 5e-6;
/// A step that leaves nothing before a moment that none may cross may err by so many times as much: it stands for two.
const FILLS: f64 = 30.0;
/// Such a step is tried if it is at most so many times as long as another would be: what it saves is worth a few in vain.
const STRETCH: f64 = 1.5;
/// Below this a step's error estimate is rounding.
const FINEST: f64 = 1e-14;
/// Of the error estimate.
const ORDER: i32 = 12;
const SAFETY: f64 = 0.93;
const SHRINK: f64 = 0.2;
const GROW: f64 = 4.0;
/// Where a step may end at an event, its polynomial may err by so much of what a step may err: this estimate is hardly more than the error.
const TRUST: f64 = 0.5;
/// So exactly an event is located, as a part of the step, where a shorter step will locate it again.
const ROUGHLY: f64 = 1e-4;
/// So much of its unit an energy of the ledger counts in the error.
const LEDGER: f64 = 0.5;
/// Modes and units hold until a number of the attitude's quaternion, or half an angle, has changed by so much.
const TURNED: f64 = 0.03;
/// So many sets of them are remembered.
const KNOWN: usize = 16;
/// A step whose iteration does not converge counts as much as so many that do, and this many more than those are too many: another
/// method is better.
const FAILED: u32 = 8;
const MANY: u32 = 400;

/// Integrates a model.
pub fn run(
    model: &Model,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> (Stats, Result<(), Stopped>) {
    let mut course = Course::new(model, NAME, settings, true);
    if let Err(stopped) = course.begin_log(observer) {
        return (course.stats, Err(stopped));
    }
    let (mut course, outcome) = go(course, settings, observer);
    let outcome = match outcome {
        Ok(true) => Ok(()),
        // What the sweeps cannot do is done without them.
        Ok(false) => {
            let (on, outcome) = pair::go::<dop853::Dop853, true>(course, settings, false, observer);
            course = on;
            outcome.map(|_| ())
        }
        Err(stopped) => Err(stopped),
    };
    (course.stats, outcome)
}

/// How many times as long a step may be as one with this error: error^(-1/12), to four percent and never more. Its logarithm is read off
/// its bits, then one step of Newton's.
fn stretch(error: f64) -> f64 {
    let (error, one) = (error as f32, 1.0f32.to_bits() as i32);
    let logarithm = error.to_bits() as i32 - one;
    let near = f32::from_bits((one - logarithm / ORDER) as u32);
    let cube = near * near * near;
    let order = ORDER as f32;
    f64::from(near * ((order + 1.0) - error * (cube * cube) * (cube * cube)) / order)
}

/// Whether it is the cheapest for a model: one that can be evaluated at eight moments at once, on contacts that damp and drive what is
/// free.
pub fn suits(model: &Model) -> bool {
    if !model.on_eight() {
        return false;
    }
    let (mut rows, mut all) = (Vec::new(), Vec::new());
    let (y, w) = (model.initial_state(), model.workspace());
    modes(model, &y, &w, 2..3, &mut rows, &mut all);
    !all.is_empty()
}

/// Goes on from where a course stands: to its end (`true`), or until it turns out that the sweeps limit the steps, or that the model is not
/// one for eight moments at once (`false`).
pub fn go<'m>(
    course: Course<'m>,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> (Course<'m>, Result<bool, Stopped>) {
    if !course.model.on_eight() {
        return (course, Ok(false));
    }
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
            return Run::<Avx512>::new(course, settings).integrate(observer);
        }
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            return Run::<Avx2>::new(course, settings).integrate(observer);
        }
    }
    Run::<Plain8>::new(course, settings).integrate(observer)
}

/// Solves a step with the code for a kind of registers.
trait Solve: Registers {
    fn solve(stages: &mut Stages<Self>, step: &Step<'_>) -> Solved;
    /// Makes the step solved last, which began at `y0`, ready to be read between its ends.
    fn lay(stages: &mut Stages<Self>, y0: &[f64]);
    /// The state at `theta` of it.
    fn between(stages: &Stages<Self>, y0: &[f64], theta: f64, out: &mut [f64]);
    /// The margin there, nearly, with that at the start.
    fn margin_between(stages: &Stages<Self>, start_n: f64, theta: f64) -> f64;
}

macro_rules! solve {
    ($type:ident, $solve:ident, $lay:ident, $between:ident, $margin:ident $(, $features:literal)?) => {
        $(#[cfg(target_arch = "x86_64")] #[target_feature(enable = $features)])?
        fn $solve(stages: &mut Stages<$type>, step: &Step<'_>) -> Solved {
            stages.solve_here(step)
        }
        $(#[cfg(target_arch = "x86_64")] #[target_feature(enable = $features)])?
        fn $lay(stages: &mut Stages<$type>, y0: &[f64]) {
            stages.lay(y0);
        }
        $(#[cfg(target_arch = "x86_64")] #[target_feature(enable = $features)])?
        fn $between(stages: &Stages<$type>, y0: &[f64], theta: f64, out: &mut [f64]) {
            stages.between(y0, theta, out);
        }
        $(#[cfg(target_arch = "x86_64")] #[target_feature(enable = $features)])?
        fn $margin(stages: &Stages<$type>, start_n: f64, theta: f64) -> f64 {
            stages.margin_between(start_n, theta)
        }
        $(#[cfg(target_arch = "x86_64")] #[doc = $features])?
        // SAFETY: stages of this type are made only behind a check of the processor's features, in `go`.
        #[allow(unsafe_code, unused_unsafe)]
        impl Solve for $type {
            fn solve(stages: &mut Stages<Self>, step: &Step<'_>) -> Solved {
                unsafe { $solve(stages, step) }
            }
            fn lay(stages: &mut Stages<Self>, y0: &[f64]) {
                unsafe { $lay(stages, y0) }
            }
            fn between(stages: &Stages<Self>, y0: &[f64], theta: f64, out: &mut [f64]) {
                unsafe { $between(stages, y0, theta, out) }
            }
            fn margin_between(stages: &Stages<Self>, start_n: f64, theta: f64) -> f64 {
                unsafe { $margin(stages, start_n, theta) }
            }
        }
    };
}
solve!(Plain8, solve_plain, lay_plain, between_plain, margin_plain);
solve!(
    Avx2,
    solve_avx2,
    lay_avx2,
    between_avx2,
    margin_avx2,
    "avx2,fma"
);
solve!(
    Avx512,
    solve_avx512,
    lay_avx512,
    between_avx512,
    margin_avx512,
    "avx512f,avx512dq"
);

/// Modes and units, and where they were found: a swaying load comes by again and again.
struct Found {
    modes: Vec<Mode>,
    /// Of the body's states: [`Model::units`].
    units: Vec<f64>,
    /// Which handles rest, a bit each; all bits where nothing has been found yet.
    resting: u32,
    attitude: [f64; 4],
    rotation: [[f64; 3]; 3],
}

struct Run<'m, E: Registers> {
    course: Course<'m>,
    side: SideBySide<'m>,
    demand: Demand,
    asked: f64,
    /// As [`TRUST`], for samples: errors of what is only looked at do not add up.
    trust: f64,
    stages: Stages<E>,
    /// The step that is left alone while a sensor's tick within it is solved.
    kept: Kept<E>,
    /// Slope at the start of the step, and whether the step before has told it, with the margin.
    slope: Vec<f64>,
    slope_known: bool,
    /// Size of the step accepted last, and at which part of it it ended.
    before_s: f64,
    ended: f64,
    at: Vec<f64>,
    rows: Vec<Row>,
    /// What has been found lately, and which of it holds now.
    found: Vec<Found>,
    holds: usize,
    oldest: usize,
    ledger_unit_j: f64,
    looks: Looks,
    margin_n: f64,
    h_next: f64,
    sizes: Sizes,
    turn: Turn,
    memory: Memory<E>,
    /// Whether the step before ended with an event.
    fired: bool,
    /// How often convergence has limited the steps lately.
    limited: u32,
}

impl<'m, E: Solve> Run<'m, E> {
    fn new(mut course: Course<'m>, settings: &Settings) -> Self {
        let model = course.model;
        let size = model.layout().size();
        course.y.truncate(size);
        course.w.least_load_n = f64::NEG_INFINITY;
        let tolerance = (settings.tolerance * SHARE).max(FINEST);
        let strictness = (LOOSE / settings.tolerance).min(1.0).sqrt().sqrt();
        let springs = 3 * model.carriers();
        let nothing = || Found {
            modes: Vec::with_capacity(springs),
            units: vec![0.0; model.layout().body],
            resting: u32::MAX,
            attitude: [0.0; 4],
            rotation: [[0.0; 3]; 3],
        };
        let stages = Stages::new(model);
        Self {
            demand: Demand {
                tolerance,
                iteration: (tolerance * ITERATION * strictness).max(FINEST),
            },
            asked: settings.tolerance,
            trust: (0.1 * settings.tolerance / tolerance).max(TRUST),
            kept: Kept::new(),
            side: model.side_by_side(),
            slope: vec![0.0; size],
            slope_known: false,
            before_s: 1.0,
            ended: 0.0,
            at: vec![0.0; size],
            rows: Vec::with_capacity(springs),
            found: std::iter::repeat_with(nothing).take(KNOWN).collect(),
            holds: 0,
            oldest: 0,
            ledger_unit_j: model.scene.body.ledger_unit_j(),
            looks: Looks::new(),
            margin_n: 0.0,
            h_next: 0.0,
            sizes: Sizes::new(),
            turn: Turn::new(),
            fired: false,
            memory: Memory::new(stages.kept().len()),
            limited: 0,
            stages,
            course,
        }
    }

    fn integrate(mut self, observer: &mut dyn Observer) -> (Course<'m>, Result<bool, Stopped>) {
        self.course.w.spread(&mut self.stages.w);
        self.begin();
        self.h_next = 0.01;
        while !self.course.finished() {
            if let Err(stopped) = self.advance(observer) {
                return (self.course, Err(stopped));
            }
            if self.limited > MANY {
                return (self.course, Ok(false));
            }
        }
        (self.course, Ok(true))
    }

    /// The state or its law has changed at once.
    fn begin(&mut self) {
        self.course.w.refresh(&mut self.stages.w);
        self.stages.look_at(self.course.watch());
    }

    /// Slope and units at the start of a step.
    fn look_around(&mut self) {
        let course = &mut self.course;
        if !std::mem::take(&mut self.slope_known) {
            course.slope(&mut self.slope);
            self.margin_n = course.margin_n();
        }
        self.find();
        let (model, y) = (self.course.model, &self.course.y);
        let units = &self.found[self.holds].units;
        let (body, watched) = (units.len(), model.layout().ledger_range().start);
        for ((scale, unit), y) in self.stages.scale.iter_mut().zip(units).zip(y) {
            *scale = 1.0 / (unit + y.abs());
        }
        self.stages.scale[body..watched].fill(1.0);
        for (scale, y) in self.stages.scale[watched..].iter_mut().zip(&y[watched..]) {
            *scale = LEDGER / (self.ledger_unit_j + LEDGER * y.abs());
        }
    }

    /// Units and modes as they are now: those found here before, if they still hold.
    fn find(&mut self) {
        let course = &self.course;
        let (model, y) = (course.model, &course.y);
        let attitude = &y[model.freedoms().attitude()];
        let mut now = [0.0; 4];
        // A quaternion changes by half the angle.
        let part = if attitude.len() == now.len() {
            1.0
        } else {
            0.5
        };
        for (now, at) in now.iter_mut().zip(attitude) {
            *now = part * at;
        }
        let mut resting = 0;
        for p in &course.w.pair {
            for gain in p.contact_gain.as_array() {
                resting = resting << 1 | u32::from(*gain != 0.0);
            }
        }
        let holds = |found: &Found| {
            let mut turned = now.iter().zip(found.attitude);
            found.resting == resting && turned.all(|(a, b)| (a - b).abs() <= TURNED)
        };
        if holds(&self.found[self.holds]) {
            return;
        }
        if let Some(known) = self.found.iter().position(holds) {
            self.holds = known;
            return;
        }
        self.holds = self.oldest;
        self.oldest = (self.oldest + 1) % KNOWN;
        let found = &mut self.found[self.holds];
        model.units(y, &course.w, SLOWEST_PER_S, &mut found.units);
        found.modes.clear();
        for axes in [0..2, 2..3] {
            modes(model, y, &course.w, axes, &mut self.rows, &mut found.modes);
        }
        (found.resting, found.attitude) = (resting, now);
        if attitude.len() == 4 {
            found.rotation = rotation(attitude);
        }
    }

    /// Solves a step of size h, which counts, and which may err by `room` times what others may.
    fn solve(&mut self, h: f64, part: Option<f64>, room: f64) -> Solved {
        let guess = match part {
            Some(part) => Guess::Part(part),
            None => Guess::Onward {
                before_s: self.before_s,
                ended: self.ended,
            },
        };
        let found = &self.found[self.holds];
        let step = Step {
            side: &self.side,
            t_s: self.course.t_s,
            y: &self.course.y,
            slope: &self.slope,
            h_s: h,
            guess,
            modes: &found.modes,
            found_at: found.rotation,
            demand: Demand {
                tolerance: self.demand.tolerance * room,
                ..self.demand
            },
        };
        let solved = E::solve(&mut self.stages, &step);
        self.course.stats.evaluations += u64::from(solved.sweeps) * MOMENTS as u64;
        Solved {
            error: solved.error * room,
            between: solved.between * room,
            ..solved
        }
    }

    /// One step, cut short where somebody wants to see a state that its polynomial does not hold.
    fn advance(&mut self, observer: &mut dyn Observer) -> Result<(), Stopped> {
        self.look_around();
        let t0 = self.course.t_s;
        let left = self.course.stop_s() - t0;
        let (h, solved) = self.accepted(t0, left)?;
        let (h, solved, event) = self.cut(t0, h, solved)?;
        let end_s = event.map_or(h, |theta| theta * h);
        while let Some(t) = self.course.sample_due(t0 + end_s - just_before_s(t0)) {
            let theta = ((t - t0) / h).clamp(0.0, 1.0);
            if solved.between > self.trust {
                self.aside(theta, h);
            } else {
                self.read(theta);
            }
            self.course.model.freedoms().project(&mut self.at);
            self.course.sample(&self.at, false, observer)?;
        }
        self.arrive(t0, h, left, event, observer)
    }

    /// The longest step that errs little enough, and what is to be tried behind it.
    fn accepted(&mut self, t0: f64, left: f64) -> Result<(f64, Solved), Stopped> {
        let wanted = self.sizes.wanted_s(self.h_next);
        let bend = self.bend();
        let bend_s = bend.map_or(f64::INFINITY, |bend| self.turn.reach_s(&bend));
        let reach_s = self.memory.reach_s(t0);
        let bend = bend.filter(|_| bend_s < wanted.min(left));
        let room = |h: f64| if h == left { FILLS } else { 1.0 };
        // An event leaves no crumb: it begins anew behind it.
        let fitted = self.fitted(wanted.min(bend_s), left).min(reach_s);
        let place = self.sizes.place(self.course.resting());
        let dared =
            fitted < left && left <= reach_s.min(bend_s) && self.sizes.dares(place, left, wanted);
        let mut h = if dared { left } else { fitted };
        let mut solved = self.solve(h, None, room(h));
        let mut rejected = false;
        while !(solved.converged && solved.error <= room(h)) {
            self.course.stats.rejected += 1;
            self.course.check_work()?;
            let factor = if !solved.converged {
                0.5
            } else if let Some(bend) = bend {
                self.turn.learn(&bend, h, solved.error);
                (self.turn.reach_s(&bend) / h).clamp(SHRINK, 0.9)
            } else {
                (SAFETY * stretch(solved.error)).clamp(SHRINK, 0.9)
            };
            let mut shorter = self.fitted(h * factor, left).min(0.95 * h);
            if dared && !rejected {
                self.sizes.dared(place, false);
                shorter = shorter.min(fitted);
            } else if !solved.converged {
                self.limited += FAILED;
            }
            rejected = true;
            if shorter < smallest_step_s(t0) && shorter < left {
                return Err(self.too_small(shorter));
            }
            let part = solved.converged.then_some(shorter / h);
            h = shorter;
            solved = self.solve(h, part, room(h));
        }
        self.limited = self.limited.saturating_sub(1);
        if dared && !rejected {
            self.sizes.dared(place, true);
        }
        if let Some(bend) = bend {
            self.turn.learn(&bend, h, solved.error);
        }
        let tried = h;
        let factor = (SAFETY * stretch(solved.error.max(1e-14)))
            .clamp(SHRINK, if rejected { 1.0 } else { GROW });
        let proposal = tried * factor;
        // A step that was cut to meet a moment says nothing against a longer one.
        let cut = tried < wanted && !rejected;
        self.sizes.held(proposal, cut);
        self.h_next = if cut || bend.is_some() {
            proposal.max(wanted)
        } else {
            proposal
        };
        Ok((h, solved))
    }

    /// Cuts a step short at an event, and before a sample, that its polynomial does not hold; gives where in it the event is, as a part of it.
    fn cut(
        &mut self,
        t0: f64,
        mut h: f64,
        mut solved: Solved,
    ) -> Result<(f64, Solved, Option<f64>), Stopped> {
        loop {
            // Where the polynomial does not hold an event, its place only tells how long the step should be.
            let roughly = solved.between > TRUST;
            let event = self.event(t0, h, roughly);
            let until = event.map_or(h, |theta| theta * h);
            let due = self.course.log_due(t0 + until - just_before_s(t0));
            let cut = match (due, event) {
                (Some(t), _) if solved.between > self.trust => t - t0,
                (_, Some(theta)) if roughly && theta < 0.99 => 1.001 * theta * h + ROUGHLY * h,
                (_, Some(_)) if roughly => return Ok((h, solved, self.event(t0, h, false))),
                _ => return Ok((h, solved, event)),
            };
            self.course.check_work()?;
            solved = self.solve(cut, Some(cut / h), 1.0);
            h = cut;
            // Shorter than what has just been solved, it hardly ever fails.
            while !solved.converged {
                self.course.stats.rejected += 1;
                self.course.check_work()?;
                h *= 0.5;
                if h < smallest_step_s(t0) {
                    return Err(self.too_small(h));
                }
                solved = self.solve(h, None, 1.0);
            }
        }
    }

    /// Goes to the end of a step, or to the event in it, which happens there.
    fn arrive(
        &mut self,
        t0: f64,
        h: f64,
        left: f64,
        event: Option<f64>,
        observer: &mut dyn Observer,
    ) -> Result<(), Stopped> {
        let end_s = event.map_or(h, |theta| theta * h);
        self.read(end_s / h);
        std::mem::swap(&mut self.course.y, &mut self.at);
        let t1 = if h == left && event.is_none() {
            self.course.stop_s()
        } else {
            t0 + end_s
        };
        let switched = t1 >= self.course.stop_s();
        if event.is_none() {
            while self.course.sample_due(t1).is_some() {
                self.at.copy_from_slice(&self.course.y);
                self.course.sample(&self.at, false, observer)?;
            }
        }
        let on_edge = self.course.on_edge();
        self.course.arrive(t1, false, observer)?;
        self.stages.keep();
        (self.before_s, self.ended) = (h, end_s / h);
        if std::mem::take(&mut self.fired) {
            self.memory.note(h, self.stages.kept());
        }
        if event.is_some() {
            let before = self.course.resting();
            self.course.fire(observer);
            let resting = [before, self.course.resting()];
            self.sizes.event(resting);
            self.fired = true;
            if let Some((step_s, slopes)) = self.memory.event(t1, resting) {
                self.stages.recall(slopes);
                (self.before_s, self.ended) = (step_s, 0.0);
            }
        } else if !switched && !on_edge {
            for (slope, f) in self.slope.iter_mut().zip(&self.stages.f) {
                *slope = f.as_array()[MOMENTS - 1];
            }
            self.margin_n = self.stages.margins()[MOMENTS - 1];
            self.slope_known = true;
        }
        if event.is_none() && switched {
            self.sizes.switch(self.course.resting());
        }
        if (event.is_some() || switched) && !self.course.finished() {
            self.begin();
        }
        Ok(())
    }

    /// The bend that friction makes where the body turns round, seen from the start of a step.
    fn bend(&self) -> Option<Bend> {
        let model = self.course.model;
        let soft_rad_per_s = model.turns_softly()?;
        let [rate, ..] = model.freedoms().spin_rad_per_s(&self.course.y);
        let [_, turning] = model.freedoms().acceleration(&self.course.y, &self.slope);
        Some(Bend::new(soft_rad_per_s, rate, turning[0]))
    }

    /// Puts the state at a part of the step into `at`, by a step that ends there and of which nothing else is kept.
    fn aside(&mut self, theta: f64, h: f64) {
        self.stages.save(&mut self.kept);
        let solved = self.solve(theta * h, Some(theta), 1.0);
        if solved.converged {
            self.read(1.0);
        }
        self.stages.restore(&self.kept);
        if !solved.converged {
            // Shorter than one that did converge, it hardly ever does not; the polynomial is then the best there is.
            self.read(theta);
        }
    }

    /// Puts the state at a part of the step solved last into `at`.
    fn read(&mut self, theta: f64) {
        if theta < 1.0 {
            E::lay(&mut self.stages, &self.course.y);
        }
        E::between(&self.stages, &self.course.y, theta, &mut self.at);
    }

    fn too_small(&self, step_s: f64) -> Stopped {
        Stopped::StepTooSmall {
            method: NAME,
            t_s: self.course.t_s,
            step_s,
            tolerance: self.asked,
        }
    }

    /// A step of about h that leaves no crumb before the next moment that must not be crossed.
    fn fitted(&self, h: f64, left: f64) -> f64 {
        if left <= STRETCH * h {
            left
        } else if left < 2.0 * h {
            0.5 * left
        } else {
            h
        }
    }

    /// The first zero of the margins within the step of size h that was solved last.
    fn event(&mut self, t0: f64, h: f64, roughly: bool) -> Option<f64> {
        self.looks.clear();
        self.looks.note_start(self.margin_n);
        for (theta, &margin) in C.into_iter().zip(self.stages.margins()) {
            self.looks.note(theta, margin);
        }
        if !self.looks.suspicious() {
            return None;
        }
        let fine = (0.25 * same_moment_s(t0) / h).max(2.0 * f64::EPSILON);
        let resolution = if roughly {
            fine.max(0.2 * ROUGHLY)
        } else {
            fine
        };
        let y0 = std::mem::take(&mut self.course.y);
        E::lay(&mut self.stages, &y0);
        let (stages, at, course) = (&self.stages, &mut self.at, &mut self.course);
        let mut margin = |theta: f64| {
            E::between(stages, &y0, theta, at);
            course.margin_at_n(t0 + theta * h, at)
        };
        let like = |theta: f64| E::margin_between(stages, self.margin_n, theta);
        let near = self.looks.crossing();
        let near = near.and_then(|looks| events::where_alike(looks, like, resolution, &mut margin));
        let event = near.or_else(|| events::first(&self.looks, resolution, margin));
        self.course.y = y0;
        event
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Workspace;
    use crate::scene::{builtin, parse};

    struct Last(Vec<f64>);

    impl Observer for Last {
        fn sample(&mut self, _t_s: f64, y: &[f64], _w: &Workspace) -> bool {
            self.0 = y.to_vec();
            true
        }
    }

    /// The last state of a scene, and the work, with registers of a kind.
    fn end<E: Solve>(model: &Model) -> (Vec<f64>, Stats) {
        let settings = Settings {
            tolerance: 1e-8,
            step_s: f64::NAN,
            most_evaluations: 1 << 40,
        };
        let course = Course::new(model, NAME, &settings, true);
        let mut last = Last(Vec::new());
        let (course, outcome) = Run::<E>::new(course, &settings).integrate(&mut last);
        assert_eq!(outcome, Ok(true));
        (last.0, course.stats)
    }

    #[test]
    fn a_step_stretches_as_the_root_of_its_error() {
        for k in -140..40 {
            let error = 10f64.powf(0.1 * f64::from(k));
            let exact = error.powf(-1.0 / f64::from(ORDER));
            let part = stretch(error) / exact;
            assert!((0.96..1.0 + 1e-6).contains(&part), "{error}: {part}");
        }
    }

    #[test]
    fn all_registers_give_the_same_run_but_for_rounding() {
        for name in ["music", "eight-carriers"] {
            let brief = ["duration_s=12".to_owned()];
            let scene = parse(name, builtin(name).unwrap(), &brief).unwrap();
            let model = Model::new(&scene);
            let (plain, stats) = end::<Plain8>(&model);
            let near = |(other, work): (Vec<f64>, Stats), what: &str| {
                for (k, (a, b)) in plain.iter().zip(&other).enumerate() {
                    assert!(
                        (a - b).abs() < 1e-7 * (1.0 + a.abs()),
                        "{what} {k}: {a} {b}"
                    );
                }
                assert_eq!(stats.events, work.events);
            };
            #[cfg(target_arch = "x86_64")]
            {
                if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                    near(end::<Avx2>(&model), "avx2");
                }
                if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
                    near(end::<Avx512>(&model), "avx512");
                }
            }
            near(end::<Plain8>(&model), "plain");
        }
    }

    /// Steps of one size, solved to rounding: the error falls as h¹⁵.
    #[test]
    fn the_order_is_fifteen() {
        let scene = r#"
            name = "tumble"
            duration_s = 1.0
            [body]
            gravity_m_per_s2 = [0.0, 0.0, 0.0]
            inertia_kg_m2 = { xx = 1.0, yy = 2.0, zz = 2.5 }
            [start]
            height_m = 0.0
            angular_velocity_rad_per_s = [1.0, 0.7, 2.0]
            [solver]
            energy = false
        "#;
        let model = Model::new(&parse("tumble", scene, &[]).unwrap());
        let spin_after = |steps: u32| {
            let h = 8.0 / f64::from(steps);
            let (mut stages, side) = (Stages::<Plain8>::new(&model), model.side_by_side());
            let mut w = model.workspace();
            model.begin_segment(0.0, &mut w);
            w.spread(&mut stages.w);
            stages.scale.fill(1.0);
            let mut y = model.initial_state();
            let mut slope = vec![0.0; y.len()];
            let demand = Demand {
                tolerance: 1e300,
                iteration: 1e-15,
            };
            for step in 0..steps {
                let t = h * f64::from(step);
                model.rhs(t, &y, &mut slope, &mut w);
                let start = y.clone();
                let step = Step {
                    side: &side,
                    t_s: t,
                    y: &start,
                    slope: &slope,
                    h_s: h,
                    guess: Guess::Onward {
                        before_s: h,
                        ended: 0.0,
                    },
                    modes: &[],
                    found_at: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
                    demand,
                };
                Plain8::solve(&mut stages, &step);
                stages.between(&start, 1.0, &mut y);
                model.freedoms().project(&mut y);
            }
            [y[10], y[11], y[12]]
        };
        let truth = spin_after(64);
        let error = |steps: u32| -> f64 {
            let spin = spin_after(steps);
            let square = |a: usize| (spin[a] - truth[a]).powi(2);
            (square(0) + square(1) + square(2)).sqrt()
        };
        let order = (error(6) / error(12)).log2();
        assert!((order - 15.0).abs() < 1.5, "{order}");
    }
}

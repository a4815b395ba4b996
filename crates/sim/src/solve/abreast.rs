//! Runs abreast: runs of one scene under different seeds, eight and eight side by side in the processor's registers.
//!
//! The explicit method of order 8 (`super::dop853`), each run in a lane of its own with its own time, step size and contacts. All lanes
//! take their steps together, so that one evaluation serves eight runs; whether a step is accepted, where it ends and what happens there is
//! each lane's own affair. No lane feels its neighbours: a run is the same, bit for bit, whoever runs beside it. A lane whose run has ended
//! takes the next one.
//!
//! Steps end at samples, and events are located by steps that end next to them (`Lane::meets`): there is no polynomial to be trusted. What an explicit method should
//! not do, and what does not go forward, is left to `auto` from where it stands.

mod group;
mod lane;

use super::course::{Course, same_moment_s, smallest_step_s};
use super::dop853::Dop853;
use super::events::Ahead;
use super::first_steps::FirstSteps;
use super::pair::Pair as _;
use super::{Observer, Settings, Stats, Stopped, auto};
#[cfg(target_arch = "x86_64")]
use crate::lanes::{Avx2, Avx512};
use crate::lanes::{MOMENTS, Plain8};
use crate::model::{Model, Registers, SideBySide};
use crate::scene::Scene;
use group::Group;
use lane::{Ended, Lane};

/// How many runs go side by side.
pub const RUNS: usize = MOMENTS;
const NAME: &str = "dop853";
const STAGES: usize = Dop853::STAGES;
/// As `super::pair::Pair::SHARE`.
const SHARE: f64 = 8e-3;
/// As `super::SLOWEST_PER_S`, but of many runs the worst count.
const SLOWEST_PER_S: f64 = 0.5;
const SAFETY: f64 = 0.95;
/// What is left to a stop is taken in equal steps, up to so many times what the error asks for, if they are few.
const STRETCH: f64 = 1.04;
const FEW: f64 = 16.0;
const SHRINK: f64 = 0.2;
const GROW: f64 = 6.0;
/// The error of a step counts as at least this when the next one is chosen.
const LEAST_ERROR: f64 = 1e-10;
/// Below this a step's error estimate is rounding.
const FINEST: f64 = 3e-15;
/// The units are found anew when a number of the attitude has changed by so much.
const TURNED: f64 = 0.1;
/// An event so near to the end of a step, in s and as a part of the step, is met by going along the slope there: half the square of that
/// part is below any rounding.
const NEXT_TO_S: f64 = 2e-9;
const NEXT_TO: f64 = 1e-6;
/// So many secants meet one that is not much further, or it is not what it seemed.
const MOST_SECANTS: u32 = 6;
/// A lane that has not met its event after so many steps gives up.
const MOST_TRIES: u32 = 80;
/// So many evaluations, and so many more for each second of motion, and stability rather than accuracy limits the steps.
const PATIENCE: u64 = 20_000;
const PATIENCE_PER_S: f64 = 8_000.0;
/// Below this part of the largest margin the least one is a reason to look for events: as in `super::events`.
const NEAR: f64 = 0.5;

/// So exactly an event is located, s.
fn resolution_s(t_s: f64) -> f64 {
    0.5 * same_moment_s(t_s)
}

/// Whether runs of a model can go abreast: its right-hand side is written for eight, and nothing but the log looks at it.
pub fn suits(model: &Model) -> bool {
    model.on_eight() && model.sensor_clocks().is_empty() && model.layout().ledger == 0
}

/// Integrates models of one scene that differ in their seeds alone; `observers` in the same order.
///
/// # Panics
/// When [`suits`] says no of one of them, when their scenes differ in more than the seed, or when there are not as many observers.
pub fn run(
    models: &[Model],
    settings: &Settings,
    observers: &mut [&mut dyn Observer],
) -> Vec<(Stats, Result<(), Stopped>)> {
    let Some(first) = models.first() else {
        return Vec::new();
    };
    assert_eq!(models.len(), observers.len());
    for model in models {
        let alike = Scene {
            seed: first.scene.seed,
            ..model.scene.clone()
        };
        assert!(suits(model) && alike == first.scene, "not one scene");
    }
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
            return Abreast::<Avx512>::new(first, settings).integrate(models, observers);
        }
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            return Abreast::<Avx2>::new(first, settings).integrate(models, observers);
        }
    }
    Abreast::<Plain8>::new(first, settings).integrate(models, observers)
}

/// What all lanes do at once, in code for a kind of registers.
trait Together: Registers {
    /// A step of every lane from `y` into `y1`, and its error.
    fn step(group: &mut Group<Self>, side: &SideBySide<'_>, tolerance: f64);
    /// The slopes at a stage of it, whose state is known: not to be inlined, for twelve copies would fill the cache of instructions.
    fn evaluate(group: &mut Group<Self>, side: &SideBySide<'_>, stage: usize);
    /// Takes over the step in the lanes that are to move on.
    fn move_on(group: &mut Group<Self>);
}

macro_rules! together {
    ($type:ident, $step:ident, $evaluate:ident, $move_on:ident $(, $features:literal)?) => {
        $(#[cfg(target_arch = "x86_64")] #[target_feature(enable = $features)])?
        fn $step(group: &mut Group<$type>, side: &SideBySide<'_>, tolerance: f64) {
            step_here(group, side, tolerance);
        }
        $(#[cfg(target_arch = "x86_64")] #[target_feature(enable = $features)])?
        #[inline(never)]
        fn $evaluate(group: &mut Group<$type>, side: &SideBySide<'_>, stage: usize) {
            evaluate_here(group, side, stage);
        }
        $(#[cfg(target_arch = "x86_64")] #[target_feature(enable = $features)])?
        fn $move_on(group: &mut Group<$type>) {
            group.move_on_here();
        }
        // SAFETY: lanes of these types are made only behind a check of the processor's features, in `run`.
        $(#[cfg(target_arch = "x86_64")] #[doc = $features])?
        #[allow(unsafe_code, unused_unsafe)]
        impl Together for $type {
            fn step(group: &mut Group<Self>, side: &SideBySide<'_>, tolerance: f64) {
                unsafe { $step(group, side, tolerance) }
            }
            fn evaluate(group: &mut Group<Self>, side: &SideBySide<'_>, stage: usize) {
                unsafe { $evaluate(group, side, stage) }
            }
            fn move_on(group: &mut Group<Self>) {
                unsafe { $move_on(group) }
            }
        }
    };
}
together!(Plain8, step_plain, evaluate_plain, move_on_plain);
together!(Avx2, step_avx2, evaluate_avx2, move_on_avx2, "avx2,fma");
together!(
    Avx512,
    step_avx512,
    evaluate_avx512,
    move_on_avx512,
    "avx512f,avx512dq"
);

#[inline(always)]
fn evaluate_here<E: Together>(group: &mut Group<E>, side: &SideBySide<'_>, stage: usize) {
    let mut octets = [group.octet(stage)];
    side.phases(&mut octets);
    side.shoulders(&mut octets);
    side.load(&mut octets);
    group.keep(stage);
}

#[inline(always)]
fn step_here<E: Together>(group: &mut Group<E>, side: &SideBySide<'_>, tolerance: f64) {
    group.begin_step(side);
    macro_rules! stages {
        ($($i:literal)*) => {$(
            group.combine::<$i>();
            E::evaluate(group, side, $i);
        )*};
    }
    stages!(1 2 3 4 5 6 7 8 9 10 11 12);
    group.survey();
    group.estimate(tolerance);
}

/// All lanes.
struct Abreast<E: Registers> {
    settings: Settings,
    tolerance: f64,
    /// Its cubic root: see [`Lane::meets`].
    near: f64,
    group: Group<E>,
    units: Vec<f64>,
    column: Vec<f64>,
    at: Vec<f64>,
}

impl<E: Together> Abreast<E> {
    fn new(model: &Model, settings: &Settings) -> Self {
        let layout = model.layout();
        let tolerance = (settings.tolerance * SHARE).max(FINEST);
        Self {
            settings: settings.clone(),
            tolerance,
            near: tolerance.cbrt(),
            group: Group::new(model),
            units: vec![0.0; layout.body],
            column: vec![0.0; layout.size()],
            at: vec![0.0; layout.size()],
        }
    }

    fn integrate<'m>(
        mut self,
        models: &'m [Model],
        observers: &mut [&mut dyn Observer],
    ) -> Vec<(Stats, Result<(), Stopped>)> {
        let mut done: Vec<Option<(Stats, Result<(), Stopped>)>> =
            models.iter().map(|_| None).collect();
        let mut waiting = 0..models.len();
        // What the seeds change is in the lanes: any of the models will do.
        let side = models[0].side_by_side();
        let mut lanes: [Option<Lane<'m>>; RUNS] = std::array::from_fn(|_| None);
        loop {
            for (l, lane) in lanes.iter_mut().enumerate() {
                while lane.is_none() {
                    let Some(run) = waiting.next() else { break };
                    match self.enter(l, run, &models[run], observers[run]) {
                        Ok(entered) => *lane = Some(entered),
                        Err(ended) => {
                            observers[run].ended(&ended.0, &ended.1);
                            done[run] = Some(ended);
                        }
                    }
                }
            }
            if lanes.iter().all(Option::is_none) {
                break;
            }
            for (l, lane) in lanes.iter_mut().enumerate() {
                let (mut t_s, mut h_s) = (0.0, 0.0);
                if let Some(lane) = lane {
                    lane.plan();
                    (t_s, h_s) = (lane.course.t_s, lane.h_s);
                }
                self.group.t_s.as_mut_array()[l] = t_s;
                self.group.h_s.as_mut_array()[l] = h_s;
            }
            E::step(&mut self.group, &side, self.tolerance);
            self.group.moves = E::splat(-1.0);
            let mut stopping = [None; RUNS];
            for (l, lane) in lanes.iter_mut().enumerate() {
                if let Some(lane) = lane {
                    stopping[l] = Some(self.judge(l, lane));
                }
            }
            E::move_on(&mut self.group);
            for (l, slot) in lanes.iter_mut().enumerate() {
                let (Some(lane), Some(end)) = (slot.as_mut(), stopping[l]) else {
                    continue;
                };
                let run = lane.run;
                let outcome = match end {
                    Ended::Under => continue,
                    Ended::Stop | Ended::Event => {
                        let event = end == Ended::Event;
                        match self.arrive(l, lane, event, &mut *observers[run]) {
                            Ok(false) => continue,
                            Ok(true) => Ok(()),
                            Err(stopped) => Err(stopped),
                        }
                    }
                    Ended::Given => Ok(()),
                };
                // OK because it has just been there.
                let lane = slot.take().expect("a lane under way");
                let mut ended = (lane.course.stats, outcome);
                if ended.1.is_ok() && !lane.course.finished() {
                    let mut course = lane.course;
                    self.group.read(l, &mut course.y);
                    ended = auto::go(course, &self.settings, &mut *observers[run]);
                }
                observers[run].ended(&ended.0, &ended.1);
                done[run] = Some(ended);
            }
        }
        // OK because every run has ended.
        done.into_iter()
            .map(|ended| ended.expect("an end"))
            .collect()
    }

    /// Begins a run in a lane.
    fn enter<'m>(
        &mut self,
        l: usize,
        run: usize,
        model: &'m Model,
        observer: &mut dyn Observer,
    ) -> Result<Lane<'m>, (Stats, Result<(), Stopped>)> {
        let mut course = Course::new(model, NAME, &self.settings, true);
        course.w.least_load_n = f64::NEG_INFINITY;
        if let Err(stopped) = course.begin_log(observer) {
            return Err((course.stats, Err(stopped)));
        }
        if course.finished() {
            return Err((course.stats, Ok(())));
        }
        let mut lane = Lane {
            course,
            run,
            h_s: 0.0,
            end_s: 0.0,
            stops: false,
            stop_s: 0.0,
            weighed: (0, [f64::INFINITY; 4]),
            h_next_s: 0.0,
            aim_s: None,
            beyond_end_s: 0.0,
            beyond: None,
            short_before: false,
            tries: 0,
            rejected_before: false,
            first: FirstSteps::new(),
        };
        self.begin(l, &mut lane);
        // A tenth of the time in which the state would change by one unit, at tolerance 1; the error refines it.
        let mut squares = 0.0;
        let group = &self.group;
        for (d, y) in group.y.iter().enumerate() {
            let weight = group.weight[d].as_array()[l];
            let relative = group.relative[d].as_array()[l];
            let unit = (1.0 + relative * y.as_array()[l].abs()) / weight;
            squares += (group.k[0][d].as_array()[l] / unit).powi(2);
        }
        let speed = (squares / group.y.len() as f64).sqrt();
        let h = 0.1 * self.tolerance.powf(0.125) / speed.max(1e-3);
        let left = lane.course.stop_s() - lane.course.t_s;
        lane.h_next_s = h.clamp(1e-9, left.max(1e-9));
        lane.look_up_stop();
        Ok(lane)
    }

    /// Writes what has changed at the start of a segment, or at an event.
    fn begin(&mut self, l: usize, lane: &mut Lane<'_>) {
        (lane.aim_s, lane.beyond, lane.tries) = (None, None, 0);
        let course = &mut lane.course;
        course.slope(&mut self.column);
        let margin_n = course.margin_n();
        let group = &mut self.group;
        for (k, slope) in group.k[0].iter_mut().zip(&self.column) {
            k.as_mut_array()[l] = *slope;
        }
        group.short[0].as_mut_array()[l] = -margin_n.max(0.0);
        group.write(l, course);
        lane.weigh(group, l, &mut self.units);
    }

    /// What has become of a lane's step.
    fn judge(&mut self, l: usize, lane: &mut Lane<'_>) -> Ended {
        let stats = &mut lane.course.stats;
        stats.evaluations += STAGES as u64;
        let (group, at, column) = (&mut self.group, &mut self.at[..], &mut self.column[..]);
        let (error, root) = (group.error.as_array()[l], group.root.as_array()[l]);
        if !(error <= 1.0) {
            stats.rejected += 1;
            lane.rejected_before = true;
            (lane.aim_s, lane.beyond) = (None, None);
            let factor = if error.is_finite() {
                (SAFETY / root).clamp(SHRINK, 1.0)
            } else {
                SHRINK
            };
            lane.h_next_s = lane.h_s * factor;
            return if lane.h_next_s < smallest_step_s(lane.course.t_s) {
                Ended::Given
            } else {
                Ended::Under
            };
        }
        let [least, most] = group.range.map(|x| -x.as_array()[l]);
        let dips = least < NEAR * most && group.valley.as_array()[l] >= 0.0;
        let mut event = false;
        if least < 0.0 || dips || lane.beyond.is_some() {
            match group.look(l, lane, dips) {
                // What a longer step saw behind an event may turn out to be none when a shorter one gets there.
                Ahead::Clear => lane.beyond = None,
                Ahead::Here => event = true,
                Ahead::Short(zero) | Ahead::Passed { zero, .. }
                    if lane.meets(zero, most, self.near, (group, l), [at, column]) =>
                {
                    event = true;
                }
                Ahead::Short(zero) => {
                    // What was seen behind may be an early stage of a long step, far off: a step that ends there tells.
                    let behind_s = lane.beyond.filter(|_| lane.short_before).map(|b| b.0);
                    lane.short_before = true;
                    let zero_s = lane.course.t_s + zero * lane.h_s;
                    if lane.again(behind_s.unwrap_or(zero_s)) == Ended::Given {
                        return Ended::Given;
                    }
                }
                Ahead::Passed { zero, beyond } => {
                    let (t0, h) = (lane.course.t_s, lane.h_s);
                    lane.beyond = Some((t0 + beyond.0 * h, beyond.1));
                    lane.short_before = false;
                    return lane.again(t0 + zero * h);
                }
                Ahead::Dip(at) => return lane.again(lane.course.t_s + at * lane.h_s),
            }
        }
        let (aimed, known) = (lane.aim_s.is_some(), lane.beyond.is_some());
        if event || !known {
            (lane.aim_s, lane.beyond, lane.tries) = (None, None, 0);
        }
        let h = lane.h_s;
        let factor = SAFETY / root;
        lane.first
            .held(|| (!aimed).then(|| h * factor.clamp(SHRINK, GROW)));
        let most = if lane.rejected_before || event || aimed {
            1.0
        } else {
            GROW
        };
        let next = h * factor.clamp(SHRINK, most);
        lane.h_next_s = if h < lane.h_next_s {
            lane.h_next_s.max(next)
        } else {
            next
        };
        lane.rejected_before = false;
        group.moves.as_mut_array()[l] = 1.0;
        lane.end_s += lane.beyond_end_s;
        lane.course.t_s = lane.end_s;
        if event {
            Ended::Event
        } else if lane.stops || lane.course.on_edge() {
            Ended::Stop
        } else {
            lane.course.stats.steps += 1;
            Ended::Under
        }
    }

    /// Does what is to be done at the end of a lane's step; whether the run is at its end.
    fn arrive(
        &mut self,
        l: usize,
        lane: &mut Lane<'_>,
        event: bool,
        observer: &mut dyn Observer,
    ) -> Result<bool, Stopped> {
        let t_s = lane.end_s;
        let group = &mut self.group;
        // Else the state is that at the event.
        if std::mem::take(&mut lane.beyond_end_s) == 0.0 {
            group.read(l, &mut lane.course.y);
        }
        let course = &mut lane.course;
        let switched = t_s >= course.stop_s() - same_moment_s(t_s);
        if course.sample_due(t_s).is_some() {
            // The last stage was here.
            group.w.pick(l, &mut course.w);
            self.column.copy_from_slice(&course.y);
        }
        while course.sample_due(t_s).is_some() {
            course.sample(&self.column, true, observer)?;
        }
        course.arrive(t_s, false, observer)?;
        if event {
            course.fire(observer);
        }
        if course.finished() {
            return Ok(true);
        }
        if event {
            lane.weighed.0 = usize::MAX;
        }
        if event || switched {
            self.begin(l, lane);
        } else {
            group.write(l, &lane.course);
            lane.weigh(group, l, &mut self.units);
        }
        lane.look_up_stop();
        let course = &lane.course;
        if event || switched {
            let resting = course.resting_handles();
            lane.h_next_s = lane.first.after(event, resting, lane.h_next_s);
        }
        let patience = PATIENCE + (PATIENCE_PER_S * course.t_s) as u64;
        Ok(course.stats.evaluations > patience)
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

    fn models(name: &str, seeds: std::ops::Range<u64>) -> Vec<Model> {
        let brief = ["duration_s=12".to_owned(), "solver.energy=false".to_owned()];
        let scene = parse(name, builtin(name).unwrap(), &brief).unwrap();
        let with = |seed| {
            Model::new(&Scene {
                seed,
                ..scene.clone()
            })
        };
        seeds.map(with).collect()
    }

    /// The last states of runs abreast, and the events, with registers of a kind.
    fn ends<E: Together>(models: &[Model]) -> Vec<(Vec<f64>, u64)> {
        let settings = Settings {
            tolerance: 1e-7,
            step_s: f64::NAN,
            most_evaluations: 1 << 40,
        };
        let mut last: Vec<Last> = models.iter().map(|_| Last(Vec::new())).collect();
        let mut observers: Vec<&mut dyn Observer> = Vec::new();
        observers.extend(last.iter_mut().map(|l| l as &mut dyn Observer));
        let abreast = Abreast::<E>::new(&models[0], &settings);
        let ended = abreast.integrate(models, &mut observers);
        let both = last.into_iter().zip(ended);
        both.map(|(last, (stats, outcome))| {
            assert_eq!(outcome, Ok(()));
            (last.0, stats.events)
        })
        .collect()
    }

    #[test]
    fn all_registers_give_the_same_runs_but_for_rounding() {
        for name in ["music", "eight-carriers"] {
            let models = models(name, 0..5);
            let plain = ends::<Plain8>(&models);
            let near = |others: Vec<(Vec<f64>, u64)>, what: &str| {
                for ((a, events), (b, others)) in plain.iter().zip(&others) {
                    for (k, (a, b)) in a.iter().zip(b).enumerate() {
                        let near = (a - b).abs() < 1e-6 * (1.0 + a.abs());
                        assert!(near, "{name} {what} {k}: {a} {b}");
                    }
                    assert_eq!(events, others);
                }
            };
            #[cfg(target_arch = "x86_64")]
            {
                if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                    near(ends::<Avx2>(&models), "avx2");
                }
                if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
                    near(ends::<Avx512>(&models), "avx512");
                }
            }
            near(ends::<Plain8>(&models), "plain");
        }
    }

    /// A run is the same, bit for bit, whoever runs beside it, in whichever lane, and whenever it enters.
    #[test]
    fn no_run_feels_its_neighbours() {
        let crowd = ends::<Plain8>(&models("music", 100..140));
        for seed in [100, 107, 121, 139] {
            let alone = ends::<Plain8>(&models("music", seed..seed + 1));
            assert_eq!(alone[0], crowd[(seed - 100) as usize], "{seed}");
        }
    }
}

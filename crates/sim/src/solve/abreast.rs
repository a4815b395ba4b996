//! Runs abreast: runs of one scene under different seeds, eight and eight side by side in the processor's registers.
//!
//! The explicit method of order 8 (`super::dop853`), each run in a lane of its own with its own time, step size and contacts. All lanes
//! take their steps together, so that one evaluation serves eight runs; whether a step is accepted, where it ends and what happens there is
//! each lane's own affair. No lane feels its neighbours: a run is the same, bit for bit, whoever runs beside it. A lane whose run has ended
//! takes the next one.
//!
//! Steps end at samples, and events are located by steps that end there: there is no polynomial to be trusted. What an explicit method should
//! not do, and what does not go forward, is left to `auto` from where it stands.

use super::course::{Course, SAME_MOMENT_S};
use super::dop853::{Dop853, E3, E5, FROM_E3};
use super::events::{Ahead, ahead};
use super::pair::{Pair as _, Row, row};
use super::{Observer, Settings, Stats, Stopped, auto};
#[cfg(target_arch = "x86_64")]
use crate::lanes::{Avx2, Avx512};
use crate::lanes::{Eight, LANES, MOMENTS, Plain8, Two};
use crate::model::{Model, Octet, Registers, SideBySide, Workspace};
use crate::scene::Scene;

const NAME: &str = "dop853";
const STAGES: usize = Dop853::STAGES;
/// As `super::pair::Pair::SHARE`.
const SHARE: f64 = 8e-3;
const SAFETY: f64 = 0.9;
/// What is left to a stop is taken in equal steps, up to so many times what the error asks for.
const STRETCH: f64 = 1.04;
const SHRINK: f64 = 0.2;
const GROW: f64 = 6.0;
/// The error of a step counts as at least this when the next one is chosen.
const LEAST_ERROR: f64 = 1e-10;
/// The 32nd root of 1e-4, which the error of the step before counts as at least.
const LEAST_ROOT_BEFORE: f64 = 0.75;
/// Below this a step's error estimate is rounding.
const FINEST: f64 = 3e-15;
/// The units are found anew when a number of the attitude has changed by so much.
const TURNED: f64 = 0.03;
const SMALLEST_STEP_S: f64 = 1e-13;
/// So exactly an event is located, s.
const RESOLUTION_S: f64 = 0.5 * SAME_MOMENT_S;
/// An event so near to the end of a step, in s and as a part of the step, is met by going along the slope there: half the square of that
/// part is below any rounding. As small the margin must be beside the largest one in the step, or the event is none.
const NEXT_TO_S: f64 = 2e-9;
const NEXT_TO: f64 = 1e-6;
/// A lane that has not met its event after so many steps gives up.
const MOST_TRIES: u32 = 80;
/// So many evaluations, and so many more for each second of motion, and stability rather than accuracy limits the steps.
const PATIENCE: u64 = 20_000;
const PATIENCE_PER_S: f64 = 8_000.0;
/// Below this part of the largest margin the least one is a reason to look for events: as in `super::events`.
const NEAR: f64 = 0.5;

/// The stages in the order of their times; of two at the end the one that is exact there.
const IN_ORDER: [usize; 12] = [0, 1, 2, 3, 6, 4, 7, 5, 9, 8, 10, STAGES];
const TIMES: [f64; STAGES + 1] = {
    let mut times = [1.0; STAGES + 1];
    let mut i = 0;
    while i < STAGES {
        times[i] = Dop853::C[i];
        i += 1;
    }
    times
};

/// Groups of eight lanes that are evaluated together: see [`Octet`].
const GROUPS: usize = 2;

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
    fn step(groups: &mut [Group<Self>; GROUPS], side: &SideBySide<'_>, tolerance: f64);
    /// The slopes at a stage of it, whose state is known: not to be inlined, for twelve copies would fill the cache of instructions.
    fn evaluate(groups: &mut [Group<Self>; GROUPS], side: &SideBySide<'_>, stage: usize);
    /// Takes over the step in the lanes that are to move on.
    fn move_on(group: &mut Group<Self>);
}

macro_rules! together {
    ($type:ident, $step:ident, $evaluate:ident, $move_on:ident $(, $features:literal)?) => {
        $(#[cfg(target_arch = "x86_64")] #[target_feature(enable = $features)])?
        fn $step(groups: &mut [Group<$type>; GROUPS], side: &SideBySide<'_>, tolerance: f64) {
            step_here(groups, side, tolerance);
        }
        $(#[cfg(target_arch = "x86_64")] #[target_feature(enable = $features)])?
        #[inline(never)]
        fn $evaluate(groups: &mut [Group<$type>; GROUPS], side: &SideBySide<'_>, stage: usize) {
            evaluate_here(groups, side, stage);
        }
        $(#[cfg(target_arch = "x86_64")] #[target_feature(enable = $features)])?
        fn $move_on(group: &mut Group<$type>) {
            group.move_on_here();
        }
        // SAFETY: lanes of these types are made only behind a check of the processor's features, in `run`.
        $(#[cfg(target_arch = "x86_64")] #[doc = $features])?
        #[allow(unsafe_code, unused_unsafe)]
        impl Together for $type {
            fn step(groups: &mut [Group<Self>; GROUPS], side: &SideBySide<'_>, tolerance: f64) {
                unsafe { $step(groups, side, tolerance) }
            }
            fn evaluate(groups: &mut [Group<Self>; GROUPS], side: &SideBySide<'_>, stage: usize) {
                unsafe { $evaluate(groups, side, stage) }
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

/// One run under way in a lane.
struct Lane<'m> {
    course: Course<'m>,
    /// Which run it is.
    run: usize,
    /// Where the step under way begins and ends, s, and whether it ends at a moment that none may cross.
    h_s: f64,
    end_s: f64,
    stops: bool,
    /// The next such moment: a sample, or one that the course knows of.
    stop_s: f64,
    /// How many handles rested, and the attitude, where the units were found.
    weighed: (usize, [f64; 4]),
    h_next_s: f64,
    /// Where the step is to end that is to meet an event, s.
    aim_s: Option<f64>,
    /// How far beyond the step's end it was found instead, s.
    beyond_end_s: f64,
    /// A moment behind that event, with the margin there.
    beyond: Option<(f64, f64)>,
    tries: u32,
    /// The 32nd root of the error of the step before.
    error_before: f64,
    rejected_before: bool,
    /// What a first step after a switch could have been, the last time that as many handles rested; see `super::pair`.
    after_switch: [f64; 3],
    switched: Option<usize>,
}

#[inline(always)]
fn smaller<E: Registers>(a: E, b: E) -> E {
    -(-a).larger(-b)
}

#[inline(always)]
fn evaluate_here<E: Together>(
    groups: &mut [Group<E>; GROUPS],
    side: &SideBySide<'_>,
    stage: usize,
) {
    let [a, b] = groups;
    let mut octets = [a.octet(stage), b.octet(stage)];
    side.phases(&mut octets);
    side.shoulders(&mut octets);
    side.load(&mut octets);
    a.keep(stage);
    b.keep(stage);
}

#[inline(always)]
fn step_here<E: Together>(groups: &mut [Group<E>; GROUPS], side: &SideBySide<'_>, tolerance: f64) {
    for group in groups.iter_mut() {
        group.begin_step(side);
    }
    macro_rules! stages {
        ($($i:literal)*) => {$(
            for group in groups.iter_mut() {
                group.combine::<$i>();
            }
            E::evaluate(groups, side, $i);
        )*};
    }
    stages!(1 2 3 4 5 6 7 8 9 10 11 12);
    for group in groups.iter_mut() {
        group.survey();
        group.estimate(tolerance);
    }
}

/// All lanes.
struct Abreast<E: Registers> {
    settings: Settings,
    tolerance: f64,
    groups: [Group<E>; GROUPS],
    units: Vec<f64>,
    column: Vec<f64>,
}

/// Eight lanes, state by state.
struct Group<E: Registers> {
    w: Workspace<Eight<E>>,
    /// Where the step begins, and its size.
    t_s: E,
    h_s: E,
    y: Vec<E>,
    /// The state at the stage under way; in the end that at the end of the step.
    y1: Vec<E>,
    slope: Vec<E>,
    /// The slopes at the stages and at the end, by state.
    k: Vec<[E; STAGES + 1]>,
    /// 1/unit of each state, and how far the unit grows with it.
    weight: Vec<E>,
    relative: Vec<E>,
    /// What makes a margin of N*: factor and summand, both with the sign turned.
    watch: Vec<(Two<E>, Two<E>)>,
    /// What [`Workspace::beat`] is at the stages and at the end.
    beats: [[E; 2]; STAGES + 1],
    /// Minus the margins at the start (where it is not negative: a zero there has fired already), at the stages and at the end.
    short: [E; STAGES + 1],
    /// Minus the least and minus the largest of them.
    range: [E; 2],
    /// Not negative where the margin may fall and rise again.
    valley: E,
    /// The error of the step in units of the tolerance, its 32nd root, and the factor for the next step but for the error before.
    error: E,
    root: E,
    factor: E,
    /// 1 for the lanes that are to move on, −1 for the others.
    moves: E,
}

/// Σ a_j k_j over a row that is known when the program is compiled.
#[inline(always)]
fn sum<E: Registers>(row: Row, k: &[E; STAGES + 1]) -> E {
    let mut out = k[row[0].0] * row[0].1;
    for &(j, a) in &row[1..] {
        out = k[j].madd(E::splat(a), out);
    }
    out
}

impl<E: Together> Group<E> {
    fn new(model: &Model) -> Self {
        let zero = E::splat(0.0);
        let (size, body) = (model.layout().size(), model.layout().body);
        let mut weight = vec![zero; size];
        // Phases are held absolutely, the body relatively too: as in `super::pair`.
        weight[body..].fill(E::splat(1.0));
        let mut one = model.workspace();
        one.least_load_n = f64::NEG_INFINITY;
        let mut w = Workspace::blank();
        one.spread(&mut w);
        let never = Two([E::splat(f64::NEG_INFINITY); 2]);
        Self {
            watch: vec![(Two([zero; 2]), never); w.pair.len()],
            w,
            t_s: zero,
            h_s: zero,
            y: vec![zero; size],
            y1: vec![zero; size],
            slope: vec![zero; size],
            k: vec![[zero; STAGES + 1]; size],
            weight,
            relative: vec![zero; size],
            beats: [[zero; 2]; STAGES + 1],
            short: [zero; STAGES + 1],
            range: [zero; 2],
            valley: zero,
            error: zero,
            root: zero,
            factor: zero,
            moves: zero,
        }
    }

    /// Writes a lane's state and its segment.
    fn write(&mut self, l: usize, course: &Course<'_>) {
        for (y, from) in self.y.iter_mut().zip(&course.y) {
            y.as_mut_array()[l] = *from;
        }
        self.w.segment_s.as_mut_array()[l] = course.w.segment_s;
        for (p, pair) in course.w.pair.iter().enumerate() {
            let to = &mut self.w.pair[p];
            for i in 0..LANES {
                to.constant_rate.0[i].as_mut_array()[l] = pair.constant_rate.as_array()[i];
                to.contact_gain.0[i].as_mut_array()[l] = pair.contact_gain.as_array()[i];
                to.contact_floor.0[i].as_mut_array()[l] = pair.contact_floor.as_array()[i];
            }
        }
        for ((factor, summand), (sense, never)) in self.watch.iter_mut().zip(course.watch()) {
            for i in 0..LANES {
                factor.0[i].as_mut_array()[l] = -sense.as_array()[i];
                summand.0[i].as_mut_array()[l] = -never.as_array()[i];
            }
        }
    }

    /// Writes a lane's units.
    fn weigh(&mut self, l: usize, course: &Course<'_>, units: &mut [f64]) {
        course.model.units(&course.y, &course.w, units);
        for (d, unit) in units.iter().enumerate() {
            self.weight[d].as_mut_array()[l] = 1.0 / unit;
            self.relative[d].as_mut_array()[l] = 1.0 / unit;
        }
    }

    /// Reads a lane's state.
    fn read(&self, l: usize, y: &mut [f64]) {
        for (to, y) in y.iter_mut().zip(&self.y) {
            *to = y.as_array()[l];
        }
    }

    /// Looks for the first event of a lane's step.
    fn look(&self, l: usize, lane: &Lane<'_>, dips: bool) -> Ahead {
        let seen = IN_ORDER.map(|i| (TIMES[i], -self.short[i].as_array()[l]));
        let (t0, h) = (lane.course.t_s, lane.h_s);
        let known = lane.beyond.map(|(t, margin)| ((t - t0) / h, margin));
        let known = known.filter(|(theta, _)| *theta > 1.0);
        ahead(&seen, known, dips, RESOLUTION_S / h)
    }

    /// What depends on time alone, of all stages: these evaluations do not wait for each other.
    #[inline(always)]
    fn begin_step(&mut self, side: &SideBySide<'_>) {
        self.range = [self.short[0]; 2];
        // The last stage is at the end, as the state after the step is.
        for (beat, c) in self.beats[1..STAGES].iter_mut().zip(&TIMES[1..]) {
            side.clock(self.h_s.madd(E::splat(*c), self.t_s), &mut self.w);
            *beat = self.w.beat;
        }
        self.beats[STAGES] = self.beats[STAGES - 1];
    }

    /// The state of stage `I`, from the earlier stages.
    #[inline(always)]
    fn combine<const I: usize>(&mut self) {
        for ((k, y), out) in self.k.iter().zip(&self.y).zip(&mut self.y1) {
            *out = self.h_s.madd(sum::<E>(const { row::<Dop853>(I) }, k), *y);
        }
    }

    /// That state, to be evaluated.
    #[inline(always)]
    fn octet(&mut self, stage: usize) -> Octet<'_, E> {
        self.w.beat = self.beats[stage];
        Octet {
            t_s: self.h_s.madd(E::splat(TIMES[stage]), self.t_s),
            y: &self.y1,
            dy: &mut self.slope,
            w: &mut self.w,
        }
    }

    /// Keeps its slope and its margin.
    #[inline(always)]
    fn keep(&mut self, stage: usize) {
        for (k, slope) in self.k.iter_mut().zip(&self.slope) {
            k[stage] = *slope;
        }
        let mut short = E::splat(f64::NEG_INFINITY);
        for (p, (factor, summand)) in self.w.pair.iter().zip(&self.watch) {
            for i in 0..LANES {
                short = short.larger(p.unclamped.0[i].madd(factor.0[i], summand.0[i]));
            }
        }
        self.short[stage] = short;
        let [least, most] = &mut self.range;
        *most = smaller(*most, short);
        *least = least.larger(short);
    }

    #[inline(always)]
    fn move_on_here(&mut self) {
        for ((k, y), y1) in self.k.iter_mut().zip(&mut self.y).zip(&self.y1) {
            *y = self.moves.if_positive(*y1, *y);
            k[0] = self.moves.if_positive(k[STAGES], k[0]);
        }
        let short = smaller(self.short[STAGES], E::splat(0.0));
        self.short[0] = self.moves.if_positive(short, self.short[0]);
    }

    /// Where the margins may fall and rise again: at a stage, or, by the parabola through three of them, behind the first or before the
    /// last.
    #[inline(always)]
    fn survey(&mut self) {
        let mut rises = [E::splat(0.0); IN_ORDER.len() - 1];
        for (i, rise) in rises.iter_mut().enumerate() {
            let (from, to) = (IN_ORDER[i], IN_ORDER[i + 1]);
            let per_step = 1.0 / (TIMES[to] - TIMES[from]);
            *rise = (self.short[from] - self.short[to]) * per_step;
        }
        let [first, second, .., before, last] = rises;
        let [t0, t1, t2, .., t3, t4, t5] = IN_ORDER;
        let part = (TIMES[t1] - TIMES[t0]) / (TIMES[t2] - TIMES[t0]);
        let start = smaller(first, (second - first) * part - first);
        let part = (TIMES[t5] - TIMES[t4]) / (TIMES[t5] - TIMES[t3]);
        let end = smaller(-last, (last - before) * part + last);
        let mut valley = start.larger(end);
        for i in 1..rises.len() {
            valley = valley.larger(smaller(-rises[i - 1], rises[i]));
        }
        self.valley = valley;
    }

    /// The error of the step.
    #[inline(always)]
    fn estimate(&mut self, tolerance: f64) {
        let (mut five, mut three) = (E::splat(0.0), E::splat(0.0));
        for (d, k) in self.k.iter().enumerate() {
            let (y0, y1) = (self.y[d].abs(), self.y1[d].abs());
            let unit = self.relative[d].madd(y0.larger(y1), E::splat(1.0));
            let w = self.weight[d] / unit;
            let (a, b) = (sum::<E>(E5, k) * w, sum::<E>(E3, k) * w);
            five = a.madd(a, five);
            three = b.madd(b, three);
        }
        // As in `super::dop853`.
        let count = self.k.len() as f64;
        let below = three.madd(E::splat(0.01), five) * count;
        let combined = self.h_s * five / (below.sqrt() * tolerance);
        let combined = below.if_positive(combined, below);
        let from_e3 = self.h_s * self.h_s * three * (FROM_E3 * SHARE / (count * tolerance));
        self.error = combined.larger(from_e3);
        let mut root = self.error.larger(E::splat(LEAST_ERROR));
        for _ in 0..5 {
            root = root.sqrt();
        }
        self.root = root;
        self.factor = E::splat(SAFETY) / (root * root * root);
    }
}

impl<E: Together> Abreast<E> {
    fn new(model: &Model, settings: &Settings) -> Self {
        let layout = model.layout();
        Self {
            settings: settings.clone(),
            tolerance: (settings.tolerance * SHARE).max(FINEST),
            groups: std::array::from_fn(|_| Group::new(model)),
            units: vec![0.0; layout.body],
            column: vec![0.0; layout.size()],
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
        let mut lanes: [Option<Lane<'m>>; GROUPS * MOMENTS] = std::array::from_fn(|_| None);
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
                let group = &mut self.groups[l / MOMENTS];
                group.t_s.as_mut_array()[l % MOMENTS] = t_s;
                group.h_s.as_mut_array()[l % MOMENTS] = h_s;
            }
            E::step(&mut self.groups, &side, self.tolerance);
            for group in &mut self.groups {
                group.moves = E::splat(-1.0);
            }
            let mut stopping = [None; GROUPS * MOMENTS];
            for (l, lane) in lanes.iter_mut().enumerate() {
                if let Some(lane) = lane {
                    stopping[l] = Some(self.judge(l, lane));
                }
            }
            self.groups.iter_mut().for_each(E::move_on);
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
                    self.groups[l / MOMENTS].read(l % MOMENTS, &mut course.y);
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
            tries: 0,
            error_before: LEAST_ROOT_BEFORE,
            rejected_before: false,
            after_switch: [f64::INFINITY; 3],
            switched: None,
        };
        self.begin(l, &mut lane);
        // A tenth of the time in which the state would change by one unit, at tolerance 1; the error refines it.
        let mut squares = 0.0;
        let (group, l) = (&self.groups[l / MOMENTS], l % MOMENTS);
        for (d, y) in group.y.iter().enumerate() {
            let weight = group.weight[d].as_array()[l];
            let relative = group.relative[d].as_array()[l];
            let unit = (1.0 + relative * y.as_array()[l].abs()) / weight;
            squares += (group.k[d][0].as_array()[l] / unit).powi(2);
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
        let (group, l) = (&mut self.groups[l / MOMENTS], l % MOMENTS);
        for (k, slope) in group.k.iter_mut().zip(&self.column) {
            k[0].as_mut_array()[l] = *slope;
        }
        group.short[0].as_mut_array()[l] = -margin_n.max(0.0);
        group.write(l, course);
        lane.weigh(group, l, &mut self.units);
    }

    /// What has become of a lane's step.
    fn judge(&mut self, l: usize, lane: &mut Lane<'_>) -> Ended {
        let stats = &mut lane.course.stats;
        stats.evaluations += STAGES as u64;
        let (group, l) = (&mut self.groups[l / MOMENTS], l % MOMENTS);
        let (error, root) = (group.error.as_array()[l], group.root.as_array()[l]);
        if !(error <= 1.0) {
            stats.rejected += 1;
            lane.rejected_before = true;
            (lane.aim_s, lane.beyond) = (None, None);
            let factor = if error.is_finite() {
                (SAFETY / root.powi(4)).clamp(SHRINK, 1.0)
            } else {
                SHRINK
            };
            lane.h_next_s = lane.h_s * factor;
            return if lane.h_next_s < SMALLEST_STEP_S {
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
                    if lane.next_to_end(zero, -group.short[STAGES].as_array()[l], most) =>
                {
                    event = true;
                }
                Ahead::Short(zero) => {
                    if lane.again(lane.course.t_s + zero * lane.h_s) == Ended::Given {
                        return Ended::Given;
                    }
                }
                Ahead::Passed { zero, beyond } => {
                    let (t0, h) = (lane.course.t_s, lane.h_s);
                    lane.beyond = Some((t0 + beyond.0 * h, beyond.1));
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
        if let Some(resting) = lane.switched.take() {
            lane.after_switch[resting] = h * (SAFETY / root.powi(4)).clamp(SHRINK, GROW);
        }
        // A PI controller: Hairer, Nørsett, Wanner, Solving ODEs I (1993), IV.2, its exponents rounded to 32nds.
        let most = if lane.rejected_before || event || aimed {
            1.0
        } else {
            GROW
        };
        let factor = group.factor.as_array()[l] * lane.error_before;
        let next = h * factor.clamp(SHRINK, most);
        lane.h_next_s = if h < lane.h_next_s {
            lane.h_next_s.max(next)
        } else {
            next
        };
        lane.error_before = root.max(LEAST_ROOT_BEFORE);
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
        let (group, in_group) = (&mut self.groups[l / MOMENTS], l % MOMENTS);
        group.read(in_group, &mut lane.course.y);
        let course = &mut lane.course;
        let further_s = std::mem::take(&mut lane.beyond_end_s);
        if further_s != 0.0 {
            for (y, k) in course.y.iter_mut().zip(&group.k) {
                *y += further_s * k[0].as_array()[in_group];
            }
        }
        let switched = t_s >= course.stop_s() - SAME_MOMENT_S;
        if course.sample_due(t_s).is_some() {
            // The last stage was here.
            group.w.pick(in_group, &mut course.w);
            self.column.copy_from_slice(&course.y);
        }
        while course.sample_due(t_s).is_some() {
            course.sample(&self.column, true, observer)?;
        }
        course.arrive(t_s, observer)?;
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
            group.write(in_group, &lane.course);
            lane.weigh(group, in_group, &mut self.units);
        }
        lane.look_up_stop();
        let course = &lane.course;
        if switched && !event {
            let resting = course.resting_handles().min(2);
            lane.h_next_s = lane.h_next_s.min(lane.after_switch[resting]);
            lane.switched = Some(resting);
        }
        let patience = PATIENCE + (PATIENCE_PER_S * course.t_s) as u64;
        Ok(course.stats.evaluations > patience)
    }
}

impl Lane<'_> {
    /// Gives the states their units, if contacts or the attitude have changed.
    fn weigh<E: Together>(&mut self, group: &mut Group<E>, l: usize, units: &mut [f64]) {
        let attitude = &self.course.y[self.course.model.freedoms().attitude()];
        let same = |(now, then): (&f64, &f64)| (now - then).abs() <= TURNED;
        let resting = self.course.resting_handles();
        if self.weighed.0 != resting || !attitude.iter().zip(&self.weighed.1).all(same) {
            self.weighed.0 = resting;
            self.weighed.1[..attitude.len()].copy_from_slice(attitude);
            group.weigh(l, &self.course, units);
        }
    }

    /// Looks up where the next steps have to end.
    fn look_up_stop(&mut self) {
        let stop_s = self.course.stop_s();
        self.stop_s = self
            .course
            .sample_due(stop_s)
            .map_or(stop_s, |due| stop_s.min(due));
    }

    /// Chooses the next step.
    fn plan(&mut self) {
        let (t0, stop_s) = (self.course.t_s, self.stop_s);
        let left = stop_s - t0;
        let h = self.h_next_s;
        (self.h_s, self.end_s, self.stops) = match self.aim_s {
            Some(aim_s) if aim_s < stop_s => {
                let h = (aim_s - t0).max(0.5 * RESOLUTION_S);
                (h, t0 + h, false)
            }
            _ if left <= h * STRETCH => (left, stop_s, true),
            _ => {
                let h = left / ((left / (h * STRETCH)) as u64 + 1) as f64;
                (h, t0 + h, false)
            }
        };
    }

    /// Whether an event at a part `zero` of the step is so near to its end that nothing has to be solved in between.
    fn next_to_end(&mut self, zero: f64, margin_n: f64, most_n: f64) -> bool {
        let further_s = (zero - 1.0) * self.h_s;
        let near = (zero - 1.0).abs() <= NEXT_TO && further_s.abs() <= NEXT_TO_S;
        let end_s = self.end_s + further_s;
        let is = near && margin_n.abs() <= 10.0 * NEXT_TO * most_n && end_s < self.stop_s;
        if is {
            self.beyond_end_s = further_s;
        }
        is
    }

    /// Aims at another end, for the same step or the next one.
    fn again(&mut self, aim_s: f64) -> Ended {
        self.aim_s = Some(aim_s);
        self.tries += 1;
        if self.tries > MOST_TRIES {
            Ended::Given
        } else {
            Ended::Under
        }
    }
}

/// How a lane's step ended.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ended {
    /// There is nothing to be done before the next.
    Under,
    /// At a moment at which somebody looks or something jumps.
    Stop,
    /// At an event.
    Event,
    /// It is not for this method.
    Given,
}

#[cfg(test)]
mod tests {
    use super::*;
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

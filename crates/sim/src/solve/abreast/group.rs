//! Eight lanes in the registers, state by state: what all of them do at once.

use super::{LEAST_ERROR, Lane, SHARE, SLOWEST_PER_S, STAGES, Together, resolution_s};
use crate::lanes::{Eight, LANES, Two};
use crate::model::{Model, Octet, Registers, SideBySide, Workspace};
use crate::solve::course::Course;
use crate::solve::dop853::{Dop853, E3, E5, FROM_E3};
use crate::solve::events::{Ahead, ahead};
use crate::solve::pair::{Pair as _, Row, row};

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

/// The slopes of stages 1 and 2, which only the next stages read, make room for the last two.
const SLOTS: usize = STAGES - 1;
const fn slot(stage: usize) -> usize {
    if stage < SLOTS {
        stage
    } else {
        STAGES + 1 - stage
    }
}

/// What e₃ counts beside e₅, the authors' 0.01: a smooth step of damped motion errs by hundreds of times less than their combination says,
/// a turn of the friction, which [`FROM_E3`] is for, does not. From measurement: 1,536 seeds of `music`, 256 of `strict-contact`.
const E3_PART: f64 = 0.1;

/// Eight lanes, state by state.
pub(super) struct Group<E: Registers> {
    pub w: Workspace<Eight<E>>,
    /// Where the step begins, and its size.
    pub t_s: E,
    pub h_s: E,
    pub y: Vec<E>,
    /// The state at the stage under way; in the end that at the end of the step.
    pub y1: Vec<E>,
    /// The slopes at the stages and at the end.
    pub k: [Vec<E>; SLOTS],
    /// 1/unit of each state, and how far the unit grows with it.
    pub weight: Vec<E>,
    pub relative: Vec<E>,
    /// What the square of an error of order 3 counts as: see [`FROM_E3`].
    from_e3: f64,
    /// What makes a margin of N*: factor and summand, both with the sign turned.
    pub watch: Vec<(Two<E>, Two<E>)>,
    /// What [`Workspace::beat`] is at the stages and at the end.
    pub beats: [[E; 2]; STAGES + 1],
    /// Minus the margins at the start (where it is not negative: a zero there has fired already), at the stages and at the end.
    pub short: [E; STAGES + 1],
    /// Minus the least and minus the largest of them.
    pub range: [E; 2],
    /// Not negative where the margin may fall and rise again.
    pub valley: E,
    /// The error of the step in units of the tolerance, and its eighth root.
    pub error: E,
    pub root: E,
    /// 1 for the lanes that are to move on, −1 for the others.
    pub moves: E,
}

/// Σ a_j k_j over a row that is known when the program is compiled.
#[inline(always)]
fn sum<E: Registers>(row: Row, k: &[&[E]; SLOTS], d: usize) -> E {
    let mut out = k[slot(row[0].0)][d] * row[0].1;
    for &(j, a) in &row[1..] {
        out = k[slot(j)][d].madd(E::splat(a), out);
    }
    out
}

/// The slopes of every stage, each of as many states.
#[inline(always)]
fn slopes<E>(k: &[Vec<E>; SLOTS], size: usize) -> [&[E]; SLOTS] {
    let mut out: [&[E]; SLOTS] = [&[]; SLOTS];
    for (out, k) in out.iter_mut().zip(k) {
        *out = &k[..size];
    }
    out
}

impl<E: Together> Group<E> {
    pub fn new(model: &Model) -> Self {
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
            k: std::array::from_fn(|_| vec![zero; size]),
            weight,
            relative: vec![zero; size],
            from_e3: if model.has_friction() {
                FROM_E3 * SHARE
            } else {
                0.0
            },
            beats: [[zero; 2]; STAGES + 1],
            short: [zero; STAGES + 1],
            range: [zero; 2],
            valley: zero,
            error: zero,
            root: zero,
            moves: zero,
        }
    }

    /// Writes a lane's state and its segment.
    pub fn write(&mut self, l: usize, course: &Course<'_>) {
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
    pub fn weigh(&mut self, l: usize, course: &Course<'_>, units: &mut [f64]) {
        let model = course.model;
        model.units(&course.y, &course.w, SLOWEST_PER_S, units);
        for (d, unit) in units.iter().enumerate() {
            self.weight[d].as_mut_array()[l] = 1.0 / unit;
            self.relative[d].as_mut_array()[l] = 1.0 / unit;
        }
    }

    /// Reads a lane's state.
    pub fn read(&self, l: usize, y: &mut [f64]) {
        for (to, y) in y.iter_mut().zip(&self.y) {
            *to = y.as_array()[l];
        }
    }

    /// The slopes at the end of the step.
    pub fn end_slope(&self) -> &[E] {
        &self.k[slot(STAGES)]
    }

    /// Looks for the first event of a lane's step.
    pub fn look(&self, l: usize, lane: &Lane<'_>, dips: bool) -> Ahead {
        let seen = IN_ORDER.map(|i| (TIMES[i], -self.short[i].as_array()[l]));
        let (t0, h) = (lane.course.t_s, lane.h_s);
        let known = lane.beyond.map(|(t, margin)| ((t - t0) / h, margin));
        let known = known.filter(|(theta, _)| *theta > 1.0);
        ahead(&seen, known, dips, resolution_s(t0) / h)
    }

    /// What depends on time alone, of all stages: these evaluations do not wait for each other.
    #[inline(always)]
    pub fn begin_step(&mut self, side: &SideBySide<'_>) {
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
    pub fn combine<const I: usize>(&mut self) {
        let size = self.y.len();
        let (k, y1) = (slopes(&self.k, size), &mut self.y1[..size]);
        for (d, y) in self.y.iter().enumerate() {
            let slope = sum::<E>(const { row::<Dop853>(I) }, &k, d);
            y1[d] = self.h_s.madd(slope, *y);
        }
    }

    /// That state, to be evaluated.
    #[inline(always)]
    pub fn octet(&mut self, stage: usize) -> Octet<'_, E> {
        self.w.beat = self.beats[stage];
        Octet {
            t_s: self.h_s.madd(E::splat(TIMES[stage]), self.t_s),
            y: &self.y1,
            dy: &mut self.k[slot(stage)],
            w: &mut self.w,
        }
    }

    /// Keeps its margin.
    #[inline(always)]
    pub fn keep(&mut self, stage: usize) {
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
    pub fn move_on_here(&mut self) {
        for (y, y1) in self.y.iter_mut().zip(&self.y1) {
            *y = self.moves.if_positive(*y1, *y);
        }
        let (first, others) = self.k.split_at_mut(1);
        for (k, end) in first[0].iter_mut().zip(&others[slot(STAGES) - 1]) {
            *k = self.moves.if_positive(*end, *k);
        }
        let short = smaller(self.short[STAGES], E::splat(0.0));
        self.short[0] = self.moves.if_positive(short, self.short[0]);
    }

    /// Where the margins may fall and rise again: at a stage, or, by the parabola through three of them, behind the first or before the
    /// last.
    #[inline(always)]
    pub fn survey(&mut self) {
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
    pub fn estimate(&mut self, tolerance: f64) {
        let (mut five, mut three) = (E::splat(0.0), E::splat(0.0));
        let size = self.y.len();
        let (k, y1) = (slopes(&self.k, size), &self.y1[..size]);
        let (weight, relative) = (&self.weight[..size], &self.relative[..size]);
        for (d, y) in self.y.iter().enumerate() {
            let unit = relative[d].madd(y.abs().larger(y1[d].abs()), E::splat(1.0));
            let w = weight[d] / unit;
            let (a, b) = (sum::<E>(E5, &k, d) * w, sum::<E>(E3, &k, d) * w);
            five = a.madd(a, five);
            three = b.madd(b, three);
        }
        // As in `super::dop853`, but for how much e₃ counts: the more it does, the less a smooth step is said to err.
        let count = size as f64;
        let below = three.madd(E::splat(E3_PART), five) * count;
        let combined = self.h_s * five / (below.sqrt() * tolerance);
        let combined = below.if_positive(combined, below);
        let from_e3 = self.h_s * self.h_s * three * (self.from_e3 / (count * tolerance));
        self.error = combined.larger(from_e3);
        let mut root = self.error.larger(E::splat(LEAST_ERROR));
        for _ in 0..3 {
            root = root.sqrt();
        }
        self.root = root;
    }
}

#[inline(always)]
fn smaller<E: Registers>(a: E, b: E) -> E {
    -(-a).larger(-b)
}

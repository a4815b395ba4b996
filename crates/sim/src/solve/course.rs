//! What every method shares: segments between events, contacts, log times, the count of work.

use super::{Observer, Settings, Stats, Stopped};
use crate::lanes::{LANES, f64x2, pairs};
use crate::model::{Model, Workspace};

/// Times closer than this to `t_s` are the same moment, s: 1e-12, and from 19 minutes on what rounding leaves of times so large.
#[inline(always)]
pub fn same_moment_s(t_s: f64) -> f64 {
    (4.0 * f64::EPSILON * t_s).max(1e-12)
}

/// What is due so near the end of a step is not due before it, s.
pub fn just_before_s(t_s: f64) -> f64 {
    2.0 * same_moment_s(t_s)
}

/// No step is shorter, s, but for what is left before a moment that none may cross.
pub fn smallest_step_s(t_s: f64) -> f64 {
    0.1 * same_moment_s(t_s)
}

/// Something that happened at a moment, between two states.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// When, s.
    pub t_s: f64,
    /// Which handle, from 0.
    pub handle: usize,
    /// What.
    pub kind: EventKind,
}

/// What can happen at a handle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// The handle came down on the shoulder.
    ContactClosed,
    /// The handle lifted off.
    ContactOpened,
}

/// How a handle's contact stands within a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Contact {
    /// N = N* until an event says otherwise.
    Closed,
    /// N = 0 until an event says otherwise.
    Open,
    /// N = max(0, N*) at every evaluation: methods that locate nothing, and handles that sit exactly on the edge.
    Clamped,
}

/// What a handle did of late.
#[derive(Clone, Debug)]
struct Recent {
    /// Its last event, s, and how many came before it at nearly the same moment.
    event_s: f64,
    count: u32,
    /// When it was clamped last, and for how long, s.
    clamped_s: f64,
    clamped_for_s: f64,
}

/// Ticks at k/rate, k = 0, 1, … up to the end of the run.
struct Ticker {
    rate_hz: f64,
    next: u64,
    last: u64,
    /// When the next tick is, or infinity.
    due_s: f64,
}

impl Ticker {
    fn new(rate_hz: f64, duration_s: f64) -> Self {
        // A last tick that the duration misses by rounding alone is still taken.
        Self {
            rate_hz,
            next: 0,
            last: (duration_s * rate_hz * (1.0 + 1e-12)).floor() as u64,
            due_s: 0.0,
        }
    }

    /// Takes the tick that is due; returns its number.
    fn advance(&mut self) -> u64 {
        let tick = self.next;
        self.next += 1;
        self.due_s = if self.next <= self.last {
            self.next as f64 / self.rate_hz
        } else {
            f64::INFINITY
        };
        tick
    }
}

/// One run under way.
pub struct Course<'m> {
    pub model: &'m Model,
    pub w: Workspace,
    pub t_s: f64,
    pub y: Vec<f64>,
    pub stats: Stats,
    method: &'static str,
    end_s: f64,
    /// When somebody wants to see the state: the log first, then the sensors' clocks.
    tickers: Vec<Ticker>,
    switch_s: f64,
    /// When a handle that sits on its edge is looked at again: the sooner it is known where it went, the truer the ledger.
    edge_s: f64,
    /// `Some` where contacts open and close.
    contacts: Vec<Contact>,
    /// Whether each handle was in contact when it was last told of.
    touching: Vec<bool>,
    /// What makes a margin of N*, by pairs: ±1 and 0, or 0 and ∞ for a handle without events.
    watch: Vec<(f64x2, f64x2)>,
    locate: bool,
    recent: Vec<Recent>,
    most_evaluations: u64,
    /// A sample whose contacts stand otherwise than the ledger was last told.
    rebooked: Vec<f64>,
    /// Whether the workspace holds the forces at the present moment, under the present contacts.
    fresh: bool,
}

/// So many changes of one handle at the same moment, and it is treated as sitting on the edge.
const CHATTER: u32 = 6;
/// Changes of one handle that are no further apart than this are of the same moment, s.
fn chatter_s(t_s: f64) -> f64 {
    1e3 * same_moment_s(t_s)
}
/// So many times that it is then clamped; twice as long as the last time, up to the longest, if it has been off the edge for less than so many
/// times as long.
const CLAMPED: f64 = 2.0;
const LONGEST_CLAMPED_S: f64 = 1e-5;
/// The same where nothing moves the handle off its edge: then the moment at which something does is known to this.
const LONGEST_AT_REST_S: f64 = 1e-3;
const BACK_AT_ONCE: f64 = 32.0;

/// Whether every number is at most `most` in size; false for what is not a number. Without a branch for each.
#[inline(always)]
fn within(y: &[f64], most: f64) -> bool {
    let (pairs, odd) = y.as_chunks();
    let limit = f64x2::splat(most);
    let sound = |ok: f64x2, x: &[f64; LANES]| ok & f64x2::new(*x).abs().simd_le(limit);
    let all = pairs.iter().fold(f64x2::ZERO.simd_le(limit), sound);
    odd.iter().fold(all.all(), |ok, x| ok & (x.abs() <= most))
}

impl<'m> Course<'m> {
    pub fn new(model: &'m Model, method: &'static str, settings: &Settings, locate: bool) -> Self {
        let scene = &model.scene;
        let n = if model.watches_contact() {
            model.carriers()
        } else {
            0
        };
        let mut course = Self {
            model,
            w: model.workspace(),
            t_s: 0.0,
            y: model.initial_state(),
            stats: Stats::default(),
            method,
            end_s: scene.duration_s,
            tickers: std::iter::once(scene.log_rate_hz)
                .chain(model.sensor_clocks().iter().map(|c| c.rate_hz))
                .map(|rate_hz| Ticker::new(rate_hz, scene.duration_s))
                .collect(),
            switch_s: f64::INFINITY,
            edge_s: f64::INFINITY,
            contacts: vec![Contact::Clamped; n],
            touching: vec![false; n],
            watch: vec![(f64x2::ZERO, f64x2::splat(f64::INFINITY)); pairs(n)],
            locate,
            recent: vec![
                Recent {
                    event_s: f64::NEG_INFINITY,
                    count: 0,
                    clamped_s: f64::NEG_INFINITY,
                    clamped_for_s: CLAMPED * chatter_s(0.0),
                };
                n
            ],
            most_evaluations: settings.most_evaluations,
            rebooked: Vec::with_capacity(if locate { 0 } else { model.layout().size() }),
            fresh: false,
        };
        course.begin_segment();
        for i in 0..n {
            course.touching[i] = course.w.of(i, |p| p.normal) > 0.0;
        }
        course
    }

    /// The next moment that a step must not cross.
    pub fn stop_s(&self) -> f64 {
        self.switch_s.min(self.end_s).min(self.edge_s)
    }

    /// Whether the run has reached its end.
    pub fn finished(&self) -> bool {
        self.t_s >= self.end_s
    }

    /// Whose tick comes next, and when.
    fn next_tick(&self) -> (usize, f64) {
        let mut first = (0, self.tickers[0].due_s);
        for (i, ticker) in self.tickers.iter().enumerate().skip(1) {
            if ticker.due_s < first.1 {
                first = (i, ticker.due_s);
            }
        }
        first
    }

    /// The next moment, up to and including `t_s`, at which the log or a sensor wants the state.
    #[inline]
    pub fn sample_due(&self, t_s: f64) -> Option<f64> {
        let (_, due) = self.next_tick();
        (due <= t_s + same_moment_s(t_s)).then_some(due)
    }

    /// The same of the log alone. A step may be cut short for it, as it may not for a sensor, which must leave no trace in the motion.
    pub fn log_due(&self, t_s: f64) -> Option<f64> {
        let due = self.tickers[0].due_s;
        (due <= t_s + same_moment_s(t_s)).then_some(due)
    }

    /// Hands the state that [`Self::sample_due`] asked for to the observer. `evaluated`: the workspace holds the forces there already. Returns
    /// whether it does afterwards.
    pub fn sample(
        &mut self,
        y: &[f64],
        evaluated: bool,
        observer: &mut dyn Observer,
    ) -> Result<bool, Stopped> {
        self.fresh = false;
        let (who, t_s) = self.next_tick();
        let tick = self.tickers[who].advance();
        if who > 0 {
            observer.tick(who - 1, tick, t_s, y, &mut self.w);
            return Ok(false);
        }
        // Where nothing acts on the handles, an evaluation of the step has not placed them.
        let evaluated = evaluated && self.model.places_handles();
        let forces = evaluated || observer.looks_at_forces();
        if forces && !evaluated {
            self.model.forces(t_s, y, &mut self.w);
            self.stats.evaluations += 1;
        }
        // Within a rounding of an opening, N = N* can be a hair below zero.
        if forces && self.model.watches_contact() {
            for p in &mut self.w.pair {
                p.normal = p.normal.fast_max(f64x2::ZERO);
            }
        }
        let rebooked = forces && !self.locate && self.rebook(y);
        let y = if rebooked { &self.rebooked } else { y };
        if observer.sample(t_s, y, &self.w) {
            Ok(forces)
        } else {
            Err(Stopped::ByObserver { t_s })
        }
    }

    /// Where nothing is located, a contact changes when a step has ended, and so do the books; a sample of that step sees springs as they
    /// stand by then, which hold more or less by ½kδ². Its page is put right for it alone. Returns whether it had to be.
    fn rebook(&mut self, y: &[f64]) -> bool {
        let touches = |i: usize| self.w.of(i, |p| p.normal) > 0.0;
        let changed = |i: &usize| touches(*i) != self.touching[*i];
        let mut all = (0..self.touching.len()).filter(changed).peekable();
        if all.peek().is_none() {
            return false;
        }
        self.rebooked.clear();
        // Some methods' states are longer, by padding.
        self.rebooked
            .extend_from_slice(&y[..self.model.layout().size()]);
        for i in all {
            let gap_m = self.w.of(i, |p| p.gap[2]);
            self.model
                .book_contact(i, self.touching[i], gap_m, &mut self.rebooked);
        }
        true
    }

    /// Hands over the samples at the start.
    pub fn begin_log(&mut self, observer: &mut dyn Observer) -> Result<(), Stopped> {
        let start = self.y.clone();
        while self.sample_due(self.t_s).is_some() {
            self.sample(&start, false, observer)?;
        }
        Ok(())
    }

    /// How many handles are in contact, as far as contacts open and close.
    pub fn resting_handles(&self) -> usize {
        let resting = |c: &&Contact| **c == Contact::Closed;
        self.contacts.iter().filter(resting).count()
    }

    /// Which handles are in contact, as far as contacts open and close: a bit each, of the last 64.
    pub fn resting(&self) -> u64 {
        let bit = |bits: u64, c: &Contact| bits << 1 | u64::from(*c == Contact::Closed);
        self.contacts.iter().fold(0, bit)
    }

    /// Whether a handle sits on its edge, whose law may change at the end of any step.
    pub fn on_edge(&self) -> bool {
        self.contacts.contains(&Contact::Clamped)
    }

    /// Whether the work is still within what is allowed.
    pub fn check_work(&self) -> Result<(), Stopped> {
        if self.stats.evaluations > self.most_evaluations {
            return Err(Stopped::TooMuchWork {
                method: self.method,
                t_s: self.t_s,
                evaluations: self.stats.evaluations,
            });
        }
        Ok(())
    }

    /// The right-hand side at (t, y).
    #[inline]
    pub fn rhs(&mut self, t_s: f64, y: &[f64], dy: &mut [f64]) {
        self.fresh = false;
        self.stats.evaluations += 1;
        self.model.rhs(t_s, y, dy, &mut self.w);
    }

    /// The same without the ledger.
    #[inline]
    pub fn rhs_of_motion(&mut self, t_s: f64, y: &[f64], dy: &mut [f64]) {
        self.fresh = false;
        self.stats.evaluations += 1;
        self.model.rhs_of_motion(t_s, y, dy, &mut self.w);
    }

    /// The right-hand side at the present state.
    pub fn slope(&mut self, dy: &mut [f64]) {
        if !std::mem::take(&mut self.fresh) {
            self.stats.evaluations += 1;
            self.model.forces(self.t_s, &self.y, &mut self.w);
        }
        self.model.rates(&self.y, dy, &mut self.w);
    }

    /// What makes a margin of N*, by pairs: factor and summand.
    pub fn watch(&self) -> &[(f64x2, f64x2)] {
        &self.watch
    }

    /// How far the contacts are from an event at the last evaluation: negative when one has happened, N.
    #[inline]
    pub fn margin_n(&self) -> f64 {
        let mut least = f64x2::splat(f64::INFINITY);
        for (p, (sense, never)) in self.w.pair.iter().zip(&self.watch) {
            least = least.fast_min(p.unclamped * *sense + *never);
        }
        let [a, b] = least.to_array();
        a.min(b)
    }

    /// The margin at a state between steps, N.
    pub fn margin_at_n(&mut self, t_s: f64, y: &[f64]) -> f64 {
        self.fresh = false;
        self.stats.evaluations += 1;
        self.model.forces(t_s, y, &mut self.w);
        self.margin_n()
    }

    /// Moves to the end of an accepted step. `evaluated`: the workspace holds the forces there already.
    pub fn arrive(
        &mut self,
        t_s: f64,
        evaluated: bool,
        observer: &mut dyn Observer,
    ) -> Result<(), Stopped> {
        self.model.freedoms().project(&mut self.y);
        self.check(t_s, &self.y, f64::MAX)?;
        self.arrive_checked(t_s, evaluated, observer)
    }

    /// Whether all numbers of a state are finite, and those of the body at most `most`.
    #[inline]
    pub fn check(&self, t_s: f64, y: &[f64], most: f64) -> Result<(), Stopped> {
        if within(y, most) {
            Ok(())
        } else {
            self.check_each(t_s, y, most)
        }
    }

    #[cold]
    fn check_each(&self, t_s: f64, y: &[f64], most: f64) -> Result<(), Stopped> {
        let body = &y[..self.model.layout().body];
        let bad = y.iter().position(|x| !x.is_finite());
        match bad.or_else(|| body.iter().position(|x| x.abs() > most)) {
            None => Ok(()),
            Some(bad) => Err(Stopped::NotFinite {
                method: self.method,
                t_s,
                state: self.model.state_names().swap_remove(bad),
            }),
        }
    }

    /// As [`Self::arrive`], at a state on its manifold that has been checked.
    pub fn arrive_checked(
        &mut self,
        t_s: f64,
        evaluated: bool,
        observer: &mut dyn Observer,
    ) -> Result<(), Stopped> {
        self.t_s = t_s;
        self.stats.steps += 1;
        self.check_work()?;
        if !self.locate {
            self.note_unlocated(evaluated, observer);
        } else if self.on_edge() {
            self.settle();
            self.note_standing(observer);
        }
        if self.t_s >= self.switch_s - same_moment_s(self.t_s) {
            self.t_s = self.t_s.max(self.switch_s.min(self.end_s));
            self.begin_segment();
            self.note_standing(observer);
        }
        Ok(())
    }

    /// Changes the contacts that have passed their zero at the present state, whose margin is not positive.
    ///
    /// The two laws agree at the zero, so the state and its rate are continuous there. Handles that rounding cannot tell from the one
    /// that is there change with it. A handle that changes again and again at one moment sits on its edge: it is clamped,
    /// which is exact for it, until it has left the edge.
    pub fn fire(&mut self, observer: &mut dyn Observer) {
        // A segment that begins at this very moment has just said how they stand.
        if self.fresh {
            return;
        }
        self.model.forces(self.t_s, &self.y, &mut self.w);
        self.stats.evaluations += 1;
        // The located zero is one to rounding: its handle may be a hair short of it.
        let edge = self.margin_n().max(0.0);
        let chatter_s = chatter_s(self.t_s);
        for i in 0..self.contacts.len() {
            let free = self.w.of(i, |p| p.unclamped);
            let height_m = self.w.of(i, |p| p.base[2].abs() + p.gap[2].abs());
            let near = if self.t_s - self.recent[i].event_s < chatter_s {
                edge
            } else {
                edge + self.model.contact_rounding_n(i, height_m)
            };
            let (kind, next) = match self.contacts[i] {
                Contact::Closed if free <= near => (EventKind::ContactOpened, Contact::Open),
                Contact::Open if -free <= near => (EventKind::ContactClosed, Contact::Closed),
                _ => continue,
            };
            let t_s = self.t_s;
            let recent = &mut self.recent[i];
            recent.count = if t_s - recent.event_s < chatter_s {
                recent.count + 1
            } else {
                0
            };
            recent.event_s = t_s;
            let next = if recent.count >= CHATTER {
                let back_s = t_s - recent.clamped_s;
                recent.clamped_for_s = if back_s < BACK_AT_ONCE * recent.clamped_for_s {
                    (2.0 * recent.clamped_for_s).min(LONGEST_CLAMPED_S)
                } else {
                    CLAMPED * chatter_s
                };
                recent.clamped_s = t_s;
                Contact::Clamped
            } else {
                next
            };
            self.set_contact(i, next);
            // What rounding leaves on the wrong side of the zero is the zero of the new segment.
            let (sense, zero) = &mut self.watch[i / LANES];
            let short = (sense.as_array()[i % LANES] * free).min(0.0);
            zero.as_mut_array()[i % LANES] -= short;
            let pair = &mut self.w.pair[i / LANES];
            pair.normal = (pair.unclamped * pair.contact_gain).fast_max(pair.contact_floor);
            self.changed(i, kind, observer);
        }
        // The laws agree at the zero: nothing that goes with N has to be asked again.
        self.fresh = !self.model.jumps_at_contact();
    }

    fn changed(&mut self, handle: usize, kind: EventKind, observer: &mut dyn Observer) {
        self.stats.events += 1;
        self.touching[handle] = kind == EventKind::ContactClosed;
        let gap_m = self.w.of(handle, |p| p.gap[2]);
        self.model
            .book_contact(handle, kind == EventKind::ContactOpened, gap_m, &mut self.y);
        observer.event(&Event {
            t_s: self.t_s,
            handle,
            kind,
        });
    }

    fn begin_segment(&mut self) {
        self.model.begin_segment(self.t_s, &mut self.w);
        self.switch_s = self.model.next_switch_s(self.t_s);
        self.model.forces(self.t_s, &self.y, &mut self.w);
        self.stats.evaluations += 1;
        if self.locate {
            let mut changed = false;
            for i in 0..self.contacts.len() {
                let contact = Self::standing(self.w.of(i, |p| p.unclamped));
                changed |= contact != self.contacts[i];
                self.set_contact(i, contact);
            }
            if changed {
                self.model.forces(self.t_s, &self.y, &mut self.w);
                self.stats.evaluations += 1;
            }
        }
        self.fresh = true;
    }

    /// Takes handles off the edge once they have left it.
    fn settle(&mut self) {
        self.fresh = false;
        self.edge_s = f64::INFINITY;
        self.model.forces(self.t_s, &self.y, &mut self.w);
        self.stats.evaluations += 1;
        for i in 0..self.contacts.len() {
            if self.contacts[i] != Contact::Clamped {
                continue;
            }
            let contact = Self::standing(self.w.of(i, |p| p.unclamped));
            let recent = &mut self.recent[i];
            if self.t_s - recent.event_s < 0.5 * recent.clamped_for_s {
                self.edge_s = self.edge_s.min(recent.event_s + recent.clamped_for_s);
                continue;
            }
            if contact == Contact::Clamped {
                recent.clamped_for_s = (2.0 * recent.clamped_for_s).min(LONGEST_AT_REST_S);
            }
            self.set_contact(i, contact);
        }
    }

    fn standing(unclamped_n: f64) -> Contact {
        if unclamped_n > 0.0 {
            Contact::Closed
        } else if unclamped_n < 0.0 {
            Contact::Open
        } else {
            Contact::Clamped
        }
    }

    fn set_contact(&mut self, i: usize, contact: Contact) {
        self.contacts[i] = contact;
        if contact == Contact::Clamped {
            let until_s = self.t_s + self.recent[i].clamped_for_s;
            self.edge_s = self.edge_s.min(until_s);
        }
        let (gain, floor) = match contact {
            Contact::Closed => (1.0, f64::NEG_INFINITY),
            Contact::Open => (0.0, 0.0),
            Contact::Clamped => (1.0, 0.0),
        };
        *self.w.of_mut(i, |p| &mut p.contact_gain) = gain;
        *self.w.of_mut(i, |p| &mut p.contact_floor) = floor;
        let (sense, never) = match contact {
            Contact::Closed => (1.0, 0.0),
            Contact::Open => (-1.0, 0.0),
            Contact::Clamped => (0.0, f64::INFINITY),
        };
        self.watch[i / LANES].0.as_mut_array()[i % LANES] = sense;
        self.watch[i / LANES].1.as_mut_array()[i % LANES] = never;
    }

    /// Tells of contacts that stand otherwise than was last told, as a handle may that comes off its edge or meets a switch.
    fn note_standing(&mut self, observer: &mut dyn Observer) {
        if !self.locate {
            return;
        }
        for i in 0..self.contacts.len() {
            match (self.contacts[i], self.touching[i]) {
                (Contact::Open, true) => self.changed(i, EventKind::ContactOpened, observer),
                (Contact::Closed, false) => self.changed(i, EventKind::ContactClosed, observer),
                _ => {}
            }
        }
    }

    fn note_unlocated(&mut self, evaluated: bool, observer: &mut dyn Observer) {
        if self.touching.is_empty() {
            return;
        }
        if !evaluated {
            self.stats.evaluations += 1;
            self.model.forces(self.t_s, &self.y, &mut self.w);
        }
        self.fresh = true;
        let mut changed = false;
        for (touching, p) in self.touching.chunks(LANES).zip(&self.w.pair) {
            for (touched, normal_n) in touching.iter().zip(p.normal.as_array()) {
                changed |= *touched != (*normal_n > 0.0);
            }
        }
        if !changed {
            return;
        }
        for i in 0..self.touching.len() {
            let now = self.w.of(i, |p| p.normal) > 0.0;
            if now != self.touching[i] {
                self.changed(
                    i,
                    if now {
                        EventKind::ContactClosed
                    } else {
                        EventKind::ContactOpened
                    },
                    observer,
                );
            }
        }
    }
}

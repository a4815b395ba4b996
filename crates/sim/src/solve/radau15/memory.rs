//! What came after events before: a load that is carried in step comes by again and again.
//!
//! After an event the step before tells little of what follows. But the last time that the same handles came off or down after about as
//! long a stretch, the next event came after some time, and the slopes went some way until then. Both only say where to begin: how far a
//! step should reach, and from where its sweeps start. Neither is trusted: what a step errs is judged as ever, and an event is looked for.

/// So many events are remembered.
const EVENTS: usize = 16;
/// A stretch is like another if neither lasted more than so many times as long.
const ALIKE: f64 = 1.6;
/// An older one is preferred only if it is so much nearer.
const CLOSER: f64 = 0.5;
/// An expected event is met by a step that ends a little beyond it, in parts of the way there.
const BEYOND: f64 = 1.05;
/// No stretch counts as shorter than this, s.
const SHORTEST_S: f64 = 1e-12;

/// An event, and what came after it.
struct Past<E> {
    /// Which handles rested before it and after it, a bit each.
    resting: [u64; 2],
    /// How long after the event before it, s.
    after_s: f64,
    /// How long before the next, s; infinite until that has happened.
    until_s: f64,
    /// The size of the step that began with it, s.
    step_s: f64,
    /// The Legendre coefficients of the slopes of that step.
    slopes: Vec<E>,
}

/// The events that have happened lately.
pub struct Memory<E> {
    past: Vec<Past<E>>,
    /// The last one, and when it was.
    last: usize,
    event_s: f64,
    /// When the next one is expected.
    expected_s: f64,
}

impl<E: Copy> Memory<E> {
    /// Of nothing yet, with room for slopes of so many states.
    pub fn new(states: usize) -> Self {
        let nothing = || Past {
            resting: [0; 2],
            after_s: f64::NEG_INFINITY,
            until_s: f64::INFINITY,
            step_s: 0.0,
            slopes: Vec::with_capacity(states),
        };
        Self {
            past: std::iter::repeat_with(nothing).take(EVENTS).collect(),
            last: 0,
            event_s: f64::NEG_INFINITY,
            expected_s: f64::INFINITY,
        }
    }

    /// An event has happened at `t_s`. Tells of the step that began with the one most like it: its size, s, and its slopes.
    pub fn event(&mut self, t_s: f64, resting: [u64; 2]) -> Option<(f64, &[E])> {
        let after_s = (t_s - self.event_s).max(SHORTEST_S);
        self.past[self.last].until_s = after_s;
        self.event_s = t_s;
        // The oldest gives way to the new one.
        self.last = (self.last + 1) % EVENTS;
        let last = &mut self.past[self.last];
        (last.resting, last.after_s, last.until_s) = (resting, after_s, f64::INFINITY);
        last.slopes.clear();
        let (mut nearest, mut like) = ((ALIKE - 1.0) / CLOSER, None);
        for back in 1..EVENTS {
            let past = &self.past[(self.last + EVENTS - back) % EVENTS];
            let apart = (past.after_s / after_s).max(after_s / past.after_s) - 1.0;
            if past.resting == resting && apart < CLOSER * nearest && !past.slopes.is_empty() {
                (nearest, like) = (apart, Some(past));
            }
        }
        self.expected_s = like.map_or(f64::INFINITY, |past| t_s + past.until_s);
        like.map(|past| (past.step_s, &*past.slopes))
    }

    /// The step that began with the last event was `step_s` long, and its slopes had these coefficients.
    pub fn note(&mut self, step_s: f64, slopes: &[E]) {
        let last = &mut self.past[self.last];
        last.step_s = step_s;
        last.slopes.extend_from_slice(slopes);
    }

    /// How long a step from `t_s` should be at most, s: to a little beyond the event that is expected.
    pub fn reach_s(&self, t_s: f64) -> f64 {
        let ahead_s = self.expected_s - t_s;
        if ahead_s > SHORTEST_S {
            BEYOND * ahead_s
        } else {
            f64::INFINITY
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A handle that comes off every second, and down 0.3 s later, beside one that rests.
    fn paced(memory: &mut Memory<f64>, from: u32, to: u32) {
        for second in from..to {
            let t_s = f64::from(second);
            let off = memory.event(t_s, [3, 1]).is_some();
            assert_eq!(off, second > 1, "{second}");
            memory.note(0.1, &[f64::from(second)]);
            let down = memory.event(t_s + 0.3, [1, 3]).is_some();
            assert_eq!(down, second > 0, "{second}");
            memory.note(0.2, &[-f64::from(second)]);
        }
    }

    #[test]
    fn what_came_the_last_time_is_expected_again() {
        let mut memory = Memory::new(1);
        paced(&mut memory, 0, 30);
        assert_eq!(memory.event(30.0, [3, 1]), Some((0.1, &[29.0][..])));
        assert!((memory.reach_s(30.0) - 0.3 * BEYOND).abs() < 1e-12);
        assert!((memory.reach_s(30.2) - 0.1 * BEYOND).abs() < 1e-12);
        // What did not come is not waited for.
        assert_eq!(memory.reach_s(30.31), f64::INFINITY);
    }

    #[test]
    fn neither_another_contact_nor_another_pace_is_alike() {
        let mut memory = Memory::new(1);
        paced(&mut memory, 0, 4);
        // The other handle comes off.
        assert_eq!(memory.event(4.0, [3, 2]), None);
        assert_eq!(memory.reach_s(4.0), f64::INFINITY);
        memory.note(0.1, &[1.0]);
        // The first one, after a stretch twice as long as ever.
        assert_eq!(memory.event(5.4, [3, 1]), None);
    }

    #[test]
    fn the_oldest_is_forgotten() {
        let mut memory = Memory::new(1);
        paced(&mut memory, 0, 4);
        for k in 0..EVENTS {
            memory.event(4.3 + k as f64, [0, 4]);
            memory.note(1.0, &[0.0]);
        }
        let past = (memory.past.iter()).filter(|past| past.resting != [0, 4]);
        assert_eq!(past.count(), 0);
    }
}

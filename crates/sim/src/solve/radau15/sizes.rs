//! How long a step is tried, from what became of those before it.
//!
//! A jump (an event, the next value of a noise) excites what the step before it has not met, so the law of the step size knows nothing of
//! the steps that follow: what they could be is learnt from jumps of the same kind. Where there is a moment ahead that no step may cross, a
//! step that reaches it saves one or two others; it is tried as often as it goes well.

/// No two events are alike: a first step after one may be so much of what it could have been the last time.
const CAUTION: f64 = 0.9;
/// A step to the next moment that none may cross is tried if it is no more than so many times as long as one that is expected to hold.
const DARING: f64 = 3.0;
/// After failing again and again it is tried once in so many times.
const SELDOM: u32 = 32;
/// Handles that rest are counted to 2, and so are steps since a jump.
const COUNTED: usize = 3;

/// How often something is tried.
#[derive(Clone, Copy)]
struct Chance {
    /// So many times it is left out now, and after the next failure.
    left_out: u32,
    next: u32,
}

/// Where a course stands, as far as sizes were learnt for it.
#[derive(Clone, Copy)]
pub struct Place {
    since: usize,
    resting: usize,
}

/// What was learnt.
pub struct Sizes {
    /// What a first step could be, s: after events, by how many handles rested before and rest after; in the last row after other jumps.
    first_s: [[f64; COUNTED]; COUNTED + 1],
    /// Which of them it is that comes next.
    jump: Option<[usize; 2]>,
    /// Steps since the last jump.
    since: usize,
    chances: [[Chance; COUNTED]; COUNTED],
}

fn counted(handles: u64) -> usize {
    (handles.count_ones() as usize).min(COUNTED - 1)
}

impl Sizes {
    /// Nothing yet.
    pub fn new() -> Self {
        let untried = Chance {
            left_out: 0,
            next: 0,
        };
        Self {
            first_s: [[f64::INFINITY; COUNTED]; COUNTED + 1],
            jump: None,
            since: 0,
            chances: [[untried; COUNTED]; COUNTED],
        }
    }

    /// An event has happened; which handles rested before it and after it, a bit each.
    pub fn event(&mut self, [before, after]: [u64; 2]) {
        self.jump = Some([counted(before), counted(after)]);
        self.since = 0;
    }

    /// The law has changed, and no contact with it.
    pub fn switch(&mut self, resting: u64) {
        self.jump = Some([COUNTED, counted(resting)]);
        self.since = 0;
    }

    /// Where a step begins.
    pub fn place(&self, resting: u64) -> Place {
        Place {
            since: self.since.min(COUNTED - 1),
            resting: counted(resting),
        }
    }

    /// How long a step should be that is to be `next_s` by the law of the step size, s.
    pub fn wanted_s(&self, next_s: f64) -> f64 {
        match self.jump {
            Some([before, after]) => {
                let caution = if before < COUNTED { CAUTION } else { 1.0 };
                next_s.min(caution * self.first_s[before][after])
            }
            None => next_s,
        }
    }

    /// Whether a step is tried that is as long as there is time left where one of `expected_s` is expected to hold.
    pub fn dares(&mut self, place: Place, left_s: f64, expected_s: f64) -> bool {
        if left_s > DARING * expected_s {
            return false;
        }
        let chance = &mut self.chances[place.since][place.resting];
        let now = chance.left_out == 0;
        chance.left_out = chance.left_out.saturating_sub(1);
        now
    }

    /// What became of a step that was dared.
    pub fn dared(&mut self, place: Place, held: bool) {
        let chance = &mut self.chances[place.since][place.resting];
        if held {
            chance.next /= 2;
        } else {
            chance.left_out = chance.next;
            chance.next = (2 * chance.next + 1).min(SELDOM - 1);
        }
    }

    /// A step held. If it was the first after a jump: what it could have been, s, or if it was not judged by its error, at least.
    pub fn held(&mut self, could_s: f64, at_least: bool) {
        self.since += 1;
        if let Some([before, after]) = self.jump.take() {
            let first = &mut self.first_s[before][after];
            *first = if at_least {
                first.max(could_s)
            } else {
                could_s
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How often it is dared in a hundred steps of which every `nth` holds.
    fn dared(nth: usize) -> usize {
        let mut sizes = Sizes::new();
        let mut count = 0;
        for k in 0..100 {
            sizes.switch(3);
            let place = sizes.place(3);
            if sizes.dares(place, 2.0, 1.0) {
                sizes.dared(place, nth > 0 && k % nth == 0);
                count += 1;
            }
        }
        count
    }

    #[test]
    fn what_goes_well_is_tried_again_and_what_does_not_is_not() {
        assert_eq!(dared(1), 100);
        assert!(dared(2) > 30);
        // At 0, 1, 3, 7, 15, 31, 63 and 95.
        assert_eq!(dared(0), 8);
        let mut sizes = Sizes::new();
        let place = sizes.place(0);
        assert!(!sizes.dares(place, 3.1, 1.0));
    }

    #[test]
    fn a_first_step_is_what_it_could_have_been_after_such_a_jump() {
        let mut sizes = Sizes::new();
        sizes.switch(3);
        assert_eq!(sizes.wanted_s(1.0), 1.0);
        sizes.held(0.5, false);
        assert_eq!(sizes.wanted_s(1.0), 1.0);
        sizes.held(0.7, false);
        sizes.event([3, 1]);
        assert_eq!(sizes.wanted_s(1.0), 1.0);
        sizes.held(0.3, false);
        sizes.switch(3);
        assert_eq!(sizes.wanted_s(1.0), 0.5);
        // Cut for another reason, it says nothing against a longer one.
        sizes.held(0.1, true);
        sizes.switch(3);
        assert_eq!(sizes.wanted_s(1.0), 0.5);
        sizes.held(0.1, false);
        sizes.event([3, 1]);
        assert!((sizes.wanted_s(1.0) - 0.3 * CAUTION).abs() < 1e-15);
    }
}

//! How long the first step after a jump may be: a jump excites what the step before it has not met, so the law of the step size knows nothing
//! of what follows. Jumps of the same kind come by again and again.

/// Handles that rest are counted to 2.
const COUNTED: usize = 3;

/// What a first step could have been, s, the last time that as many handles rested: after a switch (noise, music), and after an event, where
/// another law begins.
pub struct FirstSteps {
    could_s: [[f64; COUNTED]; 2],
    /// Which of them the step under way will tell.
    next: Option<(usize, usize)>,
}

impl FirstSteps {
    /// Of nothing yet.
    pub fn new() -> Self {
        Self {
            could_s: [[f64::INFINITY; COUNTED]; 2],
            next: None,
        }
    }

    /// After a jump: how long the next step should be that is to be `next_s` by the law of the step size, s.
    pub fn after(&mut self, event: bool, resting_handles: usize, next_s: f64) -> f64 {
        let (event, resting) = (usize::from(event), resting_handles.min(COUNTED - 1));
        self.next = Some((event, resting));
        next_s.min(self.could_s[event][resting])
    }

    /// A step has held. Where it was the first after a jump, this keeps what it could have been, s; `None` says that it tells nothing.
    pub fn held(&mut self, could_s: impl FnOnce() -> Option<f64>) {
        if let Some((event, resting)) = self.next.take()
            && let Some(could_s) = could_s()
        {
            self.could_s[event][resting] = could_s;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_first_step_is_at_most_what_the_last_after_such_a_jump_could_have_been() {
        let mut first = FirstSteps::new();
        assert_eq!(first.after(true, 1, 0.3), 0.3);
        first.held(|| Some(0.1));
        // Only a first step tells.
        first.held(|| Some(0.01));
        // Another number of handles, and a switch.
        assert_eq!(first.after(true, 0, 0.3), 0.3);
        first.held(|| None);
        assert_eq!(first.after(false, 1, 0.3), 0.3);
        first.held(|| Some(0.2));
        assert_eq!(first.after(true, 1, 0.3), 0.1);
        assert_eq!(first.after(true, 1, 0.05), 0.05);
        // Many are as two.
        assert_eq!(first.after(false, 2, 0.3), 0.3);
        first.held(|| Some(0.15));
        assert_eq!(first.after(false, 900, 0.3), 0.15);
    }
}

//! Where in a step the first contact changes.
//!
//! The margin is N* for a closed contact, −N* for an open one, the least of all handles: positive until an event. Stages
//! give it at their own times for nothing. The rule: an event fires at the first zero on (t₀, t₁]; a step that begins on a
//! zero does not fire again; a margin that touches zero from above without passing it (grazing) is no event.

/// Margins seen at the stages of one step, in the order of their times.
pub struct Looks {
    seen: [(f64, f64); MOST],
    count: usize,
    least: f64,
    most: f64,
    spoilt: bool,
}

const MOST: usize = 16;
/// A least margin below this part of the largest may hide a zero between two stages.
const NEAR: f64 = 0.05;

impl Looks {
    pub fn new() -> Self {
        Self {
            seen: [(0.0, 0.0); MOST],
            count: 0,
            least: f64::INFINITY,
            most: 0.0,
            spoilt: false,
        }
    }

    #[inline(always)]
    pub fn clear(&mut self) {
        (self.count, self.least, self.most, self.spoilt) = (0, f64::INFINITY, 0.0, false);
    }

    /// A margin at `theta` of the step.
    #[inline(always)]
    pub fn note(&mut self, theta: f64, margin: f64) {
        self.seen[self.count % MOST] = (theta, margin);
        self.count += 1;
        self.least = self.least.min(margin);
        self.most = self.most.max(margin);
    }

    /// Whether the step has to be looked at.
    #[inline(always)]
    pub fn suspicious(&self) -> bool {
        self.least < 0.0 || (self.least < NEAR * self.most && self.dips())
    }

    /// Whether a low margin lies between two higher ones.
    fn dips(&self) -> bool {
        let (seen, n) = self.sorted();
        seen[..n]
            .windows(3)
            .any(|w| w[1].1 < NEAR * self.most && w[1].1 <= w[0].1 && w[1].1 < w[2].1)
    }

    /// Says that the stages of the step have been overwritten.
    pub fn spoil(&mut self) {
        self.spoilt = true;
    }

    pub fn spoilt(&self) -> bool {
        self.spoilt
    }

    fn sorted(&self) -> ([(f64, f64); MOST], usize) {
        let (mut seen, n) = (self.seen, self.count.min(MOST));
        seen[..n].sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        (seen, n)
    }
}

/// The first zero of `margin` on (0, 1], to `resolution`. The stages say where to look; their states are less accurate than those
/// that `margin` sees (the first ones are of first order), so both ends of a bracket are looked at again.
pub fn first(looks: &Looks, resolution: f64, mut margin: impl FnMut(f64) -> f64) -> Option<f64> {
    let (seen, n) = looks.sorted();
    let seen = &seen[..n];
    for (i, &(theta, value)) in seen.iter().enumerate() {
        if value < 0.0 {
            let b = (theta, margin(theta));
            if b.1 <= 0.0 {
                return Some(back_from(b, &seen[..i], resolution, margin));
            }
        } else {
            // A dip between stages shows as the lowest of three neighbours.
            if let (Some(before), Some(after)) =
                (i.checked_sub(1).map(|j| seen[j]), seen.get(i + 1))
                && value < NEAR * looks.most
                && value <= before.1
                && value <= after.1
                && after.1 >= 0.0
            {
                let at = lowest(before, (theta, value), *after);
                let b = (at, margin(at));
                if b.1 < 0.0 {
                    return Some(back_from(b, &seen[..i], resolution, margin));
                }
            }
        }
    }
    None
}

/// The zero before `b` (margin ≤ 0), behind the last of the looks before it whose margin is positive indeed.
fn back_from(
    mut b: (f64, f64),
    before: &[(f64, f64)],
    resolution: f64,
    mut margin: impl FnMut(f64) -> f64,
) -> f64 {
    for &(theta, _) in before.iter().rev() {
        let here = (theta, margin(theta));
        if here.1 > 0.0 {
            return between(here, b, resolution, margin);
        }
        b = here;
    }
    // A zero at the step's start has fired already: the step begins on its far side.
    between((0.0, 0.0), b, resolution, margin)
}

/// Where the parabola through three points is lowest, within them.
fn lowest(l: (f64, f64), m: (f64, f64), r: (f64, f64)) -> f64 {
    let (left, right) = ((m.1 - l.1) / (m.0 - l.0), (r.1 - m.1) / (r.0 - m.0));
    let bend = right - left;
    if bend > 0.0 {
        (0.5 * (l.0 + m.0) - left * 0.5 * (r.0 - l.0) / bend).clamp(l.0, r.0)
    } else {
        m.0
    }
}

/// The zero between `a` (margin > 0) and `b` (margin ≤ 0). Chandrupatla's method (1997): inverse quadratic where the margin is
/// straight enough for it to be safe, bisection elsewhere; never slower than bisection by more than a factor of two.
fn between(
    mut a: (f64, f64),
    mut b: (f64, f64),
    resolution: f64,
    mut margin: impl FnMut(f64) -> f64,
) -> f64 {
    if b.1 == 0.0 {
        return b.0;
    }
    // The margin at the start may be zero, which says nothing about where the next zero is.
    let mut guess = if a.1 > 0.0 { a.1 / (a.1 - b.1) } else { 0.5 };
    a.1 = a.1.max(f64::MIN_POSITIVE);
    loop {
        let width = (b.0 - a.0).abs();
        let least = (resolution / width).min(0.5);
        let theta = a.0 + guess.clamp(least, 1.0 - least) * (b.0 - a.0);
        let f = margin(theta);
        // `c` is the point that falls out of the bracket.
        let c;
        if (f > 0.0) == (a.1 > 0.0) {
            c = a;
        } else {
            c = b;
            b = a;
        }
        a = (theta, f);
        let best = if f.abs() < b.1.abs() { a } else { b };
        if f == 0.0 || (b.0 - a.0).abs() <= 2.0 * resolution {
            return best.0;
        }
        let xi = (a.0 - b.0) / (c.0 - b.0);
        let phi = (a.1 - b.1) / (c.1 - b.1);
        guess = if phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi {
            a.1 / (b.1 - a.1) * c.1 / (b.1 - c.1)
                + (c.0 - a.0) / (b.0 - a.0) * a.1 / (c.1 - a.1) * b.1 / (c.1 - b.1)
        } else {
            0.5
        };
        if !guess.is_finite() {
            guess = 0.5;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn looks(f: impl Fn(f64) -> f64, at: &[f64]) -> Looks {
        let mut looks = Looks::new();
        at.iter().for_each(|&t| looks.note(t, f(t)));
        looks
    }

    const STAGES: [f64; 12] = [
        0.05, 0.08, 0.12, 0.28, 0.33, 0.25, 0.31, 0.65, 0.6, 0.86, 1.0, 1.0,
    ];

    fn find(f: impl Fn(f64) -> f64) -> (Option<f64>, u32) {
        let mut calls = 0;
        let seen = looks(&f, &STAGES);
        let found = seen.suspicious().then(|| {
            first(&seen, 1e-15, |t| {
                calls += 1;
                f(t)
            })
        });
        (found.flatten(), calls)
    }

    #[test]
    fn zeros_are_found_to_rounding_in_few_looks() {
        for zero in [0.001, 0.1, 0.3, 0.47, 0.777, 0.999] {
            let (found, calls) = find(|t| (zero - t) * (1.0 + t + (3.0 * t).sin()));
            assert!((found.unwrap() - zero).abs() < 2e-15, "{found:?}");
            assert!(calls <= 8, "{calls}");
        }
    }

    #[test]
    fn a_short_dip_between_stages_is_an_event_and_a_touch_is_not() {
        let dip = |depth: f64| move |t: f64| (t - 0.45) * (t - 0.45) - depth;
        let (found, _) = find(dip(1e-4));
        assert!(
            (found.unwrap() - 0.44).abs() < 1e-9,
            "the first of its two zeros: {found:?}"
        );
        assert_eq!(find(dip(-1e-6)).0, None);
        assert_eq!(find(dip(0.0)).0, None);
    }

    #[test]
    fn a_stage_that_sees_too_much_margin_does_not_hide_the_zero() {
        // A fall from 0.1 m, seen in one step of 0.4 s: the first stage has not yet felt gravity.
        let gap = |t: f64| 0.1 - 0.5 * 9.81 * (0.4 * t).powi(2);
        let mut seen = Looks::new();
        seen.note(0.4, 0.1);
        [0.45, 0.8, 8.0 / 9.0, 1.0]
            .iter()
            .for_each(|&t| seen.note(t, gap(t)));
        let zero = (0.2f64 / 9.81).sqrt() / 0.4;
        assert!(zero < 0.4);
        assert!((first(&seen, 1e-15, gap).unwrap() - zero).abs() < 2e-15);
    }

    #[test]
    fn the_first_of_two_crossings_is_taken() {
        let (found, _) = find(|t| (0.2 - t).min(0.4 - 2.5 * t));
        assert!((found.unwrap() - 0.16).abs() < 2e-15, "{found:?}");
    }

    #[test]
    fn a_step_that_begins_on_a_zero_does_not_fire_again() {
        assert_eq!(find(|t| t * (2.0 - t)).0, None);
        // Another handle's zero soon after it is found all the same.
        let (found, _) = find(|t| (3.0 * t).min(0.02 - t));
        assert!((found.unwrap() - 0.02).abs() < 2e-15, "{found:?}");
    }
}

//! Where in a step the first contact changes.
//!
//! The margin is N* for a closed contact, −N* for an open one, the least of all handles: positive until an event. Stages
//! give it at their own times for nothing. The rule: an event fires at the first zero on (t₀, t₁]; a step that begins on a
//! zero does not fire again; a margin that touches zero from above without passing it (grazing) is no event.

/// Margins seen at the start and the stages of one step.
#[derive(Clone)]
pub struct Looks {
    seen: [Look; MOST],
    count: usize,
    least: f64,
    most: f64,
    /// Whether they came in the order of their times.
    ordered: bool,
    spoilt: bool,
}

/// A part of the step, and the margin there, N.
type Look = (f64, f64);

const MOST: usize = 16;
const NO_LOOKS: [Look; MOST] = [(0.0, 0.0); MOST];
/// A least margin above this part of the largest hides no zero between two looks.
const NEAR: f64 = 0.5;
/// So far a parabola through three looks may be wrong about how low a dip goes, in parts of the dip.
const DOUBT: f64 = 0.3;

impl Looks {
    pub fn new() -> Self {
        Self {
            seen: NO_LOOKS,
            count: 0,
            least: f64::INFINITY,
            most: 0.0,
            ordered: true,
            spoilt: false,
        }
    }

    #[inline(always)]
    pub fn clear(&mut self) {
        (self.count, self.least, self.most) = (0, f64::INFINITY, 0.0);
        (self.ordered, self.spoilt) = (true, false);
    }

    /// The margin at the start of the step. A start on a zero may be a hair behind it.
    #[inline(always)]
    pub fn note_start(&mut self, margin: f64) {
        self.note(0.0, margin.max(0.0));
    }

    /// The margin noted last, which is that at the end of the step once all stages are through.
    #[inline(always)]
    pub fn latest(&self) -> f64 {
        self.last().1
    }

    fn last(&self) -> (f64, f64) {
        self.seen[(self.count + MOST - 1) % MOST]
    }

    /// A margin at `theta` of the step.
    #[inline(always)]
    pub fn note(&mut self, theta: f64, margin: f64) {
        self.ordered &= self.count == 0 || self.last().0 < theta;
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
        let mut room = NO_LOOKS;
        let seen = self.sorted(&mut room);
        (0..seen.len()).any(|i| dip(seen, i).is_some())
    }

    /// Between which looks the margin falls below zero, unless it may have done so before: for looks that are nearly as true as the margins
    /// which [`where_alike`] then asks for.
    pub fn crossing(&self) -> Option<[(f64, f64); 2]> {
        let mut room = NO_LOOKS;
        let seen = self.sorted(&mut room);
        let beyond = seen.iter().position(|s| s.1 < 0.0)?;
        // A start on a zero may be a hair off it, and so may the first look be.
        let clear = beyond > 1 && (0..beyond).all(|i| dip(seen, i).is_none());
        clear.then(|| [seen[beyond - 1], seen[beyond]])
    }

    /// Says that the stages of the step have been overwritten.
    pub fn spoil(&mut self) {
        self.spoilt = true;
    }

    pub fn spoilt(&self) -> bool {
        self.spoilt
    }

    /// In the order of their times; of two at one time, the one noted last, which is the more accurate. `room`: where to sort them.
    #[inline]
    fn sorted<'a>(&'a self, room: &'a mut [Look; MOST]) -> &'a [Look] {
        if self.ordered && self.count <= MOST {
            return &self.seen[..self.count];
        }
        let mut n = 0;
        for &look in &self.seen[..self.count.min(MOST)] {
            let at = room[..n].partition_point(|s| s.0 < look.0);
            if at == n || room[at].0 > look.0 {
                room.copy_within(at..n, at + 1);
                n += 1;
            }
            room[at] = look;
        }
        &room[..n]
    }
}

/// The neighbourhood of look `i` if a dip there may reach zero, as (left, lowest, right): around a look between two higher ones, or
/// at the step's border towards which the margin falls and rises again.
#[inline]
fn dip(seen: &[Look], i: usize) -> Option<[f64; 3]> {
    let last = seen.len().checked_sub(1).filter(|&last| last >= 2)?;
    let low = seen[i].1;
    let falls = i == 0 || low <= seen[i - 1].1;
    let rises = i == last || low <= seen[i + 1].1;
    if falls && rises {
        dip_around(seen, i)
    } else {
        None
    }
}

fn dip_around(seen: &[Look], i: usize) -> Option<[f64; 3]> {
    let last = seen.len() - 1;
    let middle = i.clamp(1, last - 1);
    let [l, m, r] = [seen[middle - 1], seen[middle], seen[middle + 1]];
    let (from, to) = if i == 0 {
        (l.0, m.0)
    } else if i == last {
        (m.0, r.0)
    } else {
        (l.0, r.0)
    };
    let (at, margin) = lowest(l, m, r)?;
    // The parabola is right to a part of the dip's own depth.
    let near = margin < DOUBT * (l.1.max(r.1) - margin);
    (near && from < at && at < to).then_some([from, at, to])
}

/// The first zero of `margin` on (0, 1], to `resolution`. The looks say where to search; their states are less accurate than those
/// that `margin` sees (the first ones are of first order), so both ends of a bracket are looked at again.
pub fn first(looks: &Looks, resolution: f64, mut margin: impl FnMut(f64) -> f64) -> Option<f64> {
    let mut room = NO_LOOKS;
    let seen = looks.sorted(&mut room);
    for (i, &(theta, value)) in seen.iter().enumerate() {
        let beyond = if value < 0.0 {
            let b = (theta, margin(theta));
            (b.1 <= 0.0).then_some(b)
        } else {
            dip(seen, i).and_then(|around| depth(around, &mut margin))
        };
        if let Some(b) = beyond {
            let before = seen.partition_point(|s| s.0 < b.0);
            return Some(back_from(b, &seen[..before], resolution, margin));
        }
    }
    None
}

/// What a step says of the first event, to whoever locates events by steps that end there rather than by a polynomial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ahead {
    /// None within it.
    Clear,
    /// One at its end.
    Here,
    /// It went past one, which is at about `zero`; `beyond` is a place behind it, with the margin there.
    Passed { zero: f64, beyond: (f64, f64) },
    /// The margin may fall to zero at this part of the step and rise again: a step that ends there will tell.
    Dip(f64),
    /// It ended before the one that was known to be ahead, which is at about this part of it, beyond its end.
    Short(f64),
}

/// Where the first zero on (0, 1] is. `seen`: the margins at the start, between and at the end, in order. `known`: a place behind the
/// step's end where the margin is known to be negative, from a longer step. `dips`: whether the margin may fall to zero and rise again.
/// `resolution`: as a part of the step.
pub fn ahead(seen: &[(f64, f64)], known: Option<(f64, f64)>, dips: bool, resolution: f64) -> Ahead {
    let n = seen.len();
    for i in 1..n {
        let (theta, margin) = seen[i];
        if margin < 0.0 {
            let before = seen[i - 1];
            // The nearest of the places around them, so that the steps close in as the secant's do.
            let around = [i.checked_sub(2).map(|k| seen[k]), known];
            let around = around.into_iter().flatten();
            let third = around.min_by(|a, b| (a.0 - theta).abs().total_cmp(&(b.0 - theta).abs()));
            let zero = crossing(before, seen[i], third);
            // A step that is one moment has its event at its end, whichever look shows it.
            return if resolution >= 1.0 || i == n - 1 && theta - zero <= resolution {
                Ahead::Here
            } else {
                let beyond = seen[i];
                Ahead::Passed { zero, beyond }
            };
        }
        match dips.then(|| dip(seen, i - 1)).flatten() {
            Some([_, at, _]) if at > LEAST_DIP && at < 1.0 - LEAST_DIP => return Ahead::Dip(at),
            _ => {}
        }
    }
    match (known, seen) {
        (Some(beyond), [.., third, end]) => {
            let zero = crossing(*end, beyond, Some(*third));
            if zero - end.0 <= resolution {
                Ahead::Here
            } else {
                Ahead::Short(zero)
            }
        }
        _ => Ahead::Clear,
    }
}

/// A dip so near to the border of a step is no reason to step there.
const LEAST_DIP: f64 = 1e-3;

/// The zero between `a` (margin ≥ 0) and `b` (margin < 0) of the parabola through them and a third point.
fn crossing(a: (f64, f64), b: (f64, f64), third: Option<(f64, f64)>) -> f64 {
    let width = b.0 - a.0;
    if a.1 <= 0.0 {
        // A zero at the step's start has fired already, and says nothing of the next one.
        return a.0 + 0.5 * width;
    }
    let straight = (b.1 - a.1) / width;
    let bend = third.map_or(0.0, |c| {
        ((c.1 - b.1) / (c.0 - b.0) - straight) / (c.0 - a.0)
    });
    let slope = straight - bend * width;
    let root = (slope * slope - 4.0 * bend * a.1).sqrt();
    let at = 2.0 * a.1 / (root - slope);
    let at = if at > 0.0 && at < width {
        at
    } else {
        -a.1 / straight
    };
    a.0 + at
}

/// The lowest place near the middle of three, if the margin is negative there: two parabolas, through true margins.
fn depth(around: [f64; 3], margin: &mut impl FnMut(f64) -> f64) -> Option<(f64, f64)> {
    let mut middle = (around[1], margin(around[1]));
    if middle.1 >= 0.0 {
        let [mut l, mut r] = [around[0], around[2]].map(|theta| (theta, margin(theta)));
        for _ in 0..2 {
            let (theta, _) = lowest(l, middle, r).filter(|lowest| lowest.0 != middle.0)?;
            let next = (theta, margin(theta));
            if next.1 < 0.0 {
                middle = next;
                break;
            }
            let (near, far) = if theta < middle.0 {
                (&mut r, &mut l)
            } else {
                (&mut l, &mut r)
            };
            if next.1 < middle.1 {
                *near = middle;
                middle = next;
            } else {
                *far = next;
            }
        }
    }
    (middle.1 < 0.0).then_some(middle)
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
        if theta > 0.0 {
            b = here;
        }
    }
    // A zero at the step's start has fired already: the step begins on its far side.
    between((0.0, 0.0), b, resolution, margin)
}

/// A look-alike's zero is found to this part of the way between two looks.
const ALIKE: f64 = 1e-6;
/// So much, at most, the slope of a margin changes over the way between two looks, in parts of itself.
const BENT: f64 = 100.0;
/// Secants that have not found a zero by then will not.
const MOST_SECANTS: usize = 8;

/// The zero of `margin`, to `resolution`, between two looks that are nearly true; `like` is nearly the margin, and cheap: from its zero on
/// with its slope there, then by secants. `None` where they lead elsewhere.
pub fn where_alike(
    [a, b]: [(f64, f64); 2],
    like: impl Fn(f64) -> f64,
    resolution: f64,
    mut margin: impl FnMut(f64) -> f64,
) -> Option<f64> {
    let width = b.0 - a.0;
    let within = |theta: f64| a.0 < theta && theta < b.0;
    let (mut here, mut slope) = (b, (b.1 - a.1) / width);
    let mut theta = b.0 - b.1 / slope;
    for _ in 0..MOST_SECANTS {
        if !within(theta) || (theta - here.0).abs() <= ALIKE * width {
            break;
        }
        let next = (theta, like(theta));
        slope = (next.1 - here.1) / (next.0 - here.0);
        here = next;
        theta -= here.1 / slope;
    }
    let (mut before, mut last) = (None, f64::INFINITY);
    for _ in 0..MOST_SECANTS {
        if !within(theta) {
            break;
        }
        let here = (theta, margin(theta));
        if let Some((there, value)) = before.replace(here) {
            slope = (here.1 - value) / (here.0 - there);
        }
        theta -= here.1 / slope;
        let moved = (theta - here.0).abs();
        // A secant errs by the product of the last two steps, in parts of the way in which the slope changes by itself.
        if moved <= resolution || BENT * moved * moved.max(last) <= resolution * width {
            return (slope < 0.0).then_some(theta.clamp(a.0, b.0));
        }
        last = moved;
    }
    None
}

/// Where and how low the parabola through three points is lowest, within them.
fn lowest(l: (f64, f64), m: (f64, f64), r: (f64, f64)) -> Option<(f64, f64)> {
    let (left, right) = ((m.1 - l.1) / (m.0 - l.0), (r.1 - m.1) / (r.0 - m.0));
    let bend = (right - left) / (r.0 - l.0);
    let at = (0.5 * (l.0 + m.0 - left / bend)).clamp(l.0, r.0);
    (bend > 0.0).then_some((at, l.1 + (at - l.0) * (left + bend * (at - m.0))))
}

/// The zero between `a` (margin > 0) and `b` (margin ≤ 0). Chandrupatla's method (1997): inverse quadratic
/// where the margin is straight enough for it to be safe, bisection elsewhere; never slower than bisection by more than a factor of
/// two. It ends early as secants do: [`where_alike`].
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
    let whole = (b.0 - a.0).abs();
    loop {
        // Margins may be beyond all numbers, or alike.
        if !guess.is_finite() {
            guess = 0.5;
        }
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
        let moved = (theta - a.0).abs();
        a = (theta, f);
        let best = if f.abs() < b.1.abs() { a } else { b };
        if f == 0.0 || (b.0 - a.0).abs() <= 2.0 * resolution {
            return best.0;
        }
        let xi = (a.0 - b.0) / (c.0 - b.0);
        let phi = (a.1 - b.1) / (c.1 - b.1);
        let safe = phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi;
        guess = if safe {
            a.1 / (b.1 - a.1) * c.1 / (b.1 - c.1)
                + (c.0 - a.0) / (b.0 - a.0) * a.1 / (c.1 - a.1) * b.1 / (c.1 - b.1)
        } else {
            0.5
        };
        let next = guess * (b.0 - a.0);
        if safe && BENT * next.abs() * moved.max(next.abs()) <= resolution * whole {
            return a.0 + next;
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
    fn a_margin_beyond_all_numbers_is_halved_towards_its_zero() {
        let (found, calls) = find(|t| (0.4 - t) * f64::INFINITY);
        assert!((found.unwrap() - 0.4).abs() < 1e-14, "{found:?}");
        assert!(calls <= 60, "{calls}");
    }

    /// With a look-alike that is off by so much of the margin, or has a kink beside it.
    #[test]
    fn a_look_alike_leads_to_the_same_zero() {
        for zero in [0.05, 0.3, 0.47, 0.777] {
            let margin = |t: f64| (zero - t) * (1.0 + t + (3.0 * t).sin());
            let likes: [&dyn Fn(f64) -> f64; 3] = [
                &|t| margin(t) + 1e-7 * (20.0 * t).sin(),
                &|t| margin(t) + 1e-3,
                &|t| margin(t).min(0.3 * margin(t)),
            ];
            for (like, most) in likes.into_iter().zip([3, 5, 7]) {
                let mut calls = 0;
                let looks = [0.0, 0.9].map(|t| (t, margin(t)));
                let found = where_alike(looks, like, 1e-15, |t| {
                    calls += 1;
                    margin(t)
                });
                let found = found.unwrap();
                assert!((found - zero).abs() < 2e-15, "{zero}: {found}");
                assert!(calls <= most, "{zero}: {calls} of {most}");
            }
        }
        // A jump has no zero, and looks that were not true lead to none.
        let jump = |t: f64| if t < 0.5 { 1e-300 } else { -1.0 };
        let looks = [(0.0, 1e-300), (1.0, -1.0)];
        assert_eq!(where_alike(looks, jump, 1e-15, jump), None);
        let line = |t: f64| -0.1 - t;
        let looks = [(0.0, 0.1), (1.0, -1.1)];
        assert_eq!(where_alike(looks, |t| 0.1 - 1.2 * t, 1e-15, line), None);
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

    /// Locates the first zero by steps that end ever closer to it; returns it and how many steps that took.
    fn walk(f: impl Fn(f64) -> f64, to: f64) -> (Option<f64>, u32) {
        let (mut t0, mut aim, mut known) = (0.0, to, None::<(f64, f64)>);
        for steps in 1..40 {
            let h: f64 = aim - t0;
            let at = |part: f64| {
                (
                    part,
                    f(t0 + part * h).max(if part == 0.0 { 0.0 } else { f64::MIN }),
                )
            };
            let seen = [0.0, 0.05, 0.12, 0.28, 0.6, 0.86, 1.0].map(at);
            let ahead_of = known.map(|(t, m)| ((t - t0) / h, m)).filter(|k| k.0 > 1.0);
            match ahead(&seen, ahead_of, true, 1e-13 / h) {
                Ahead::Clear if aim < to => (t0, aim) = (aim, to),
                Ahead::Clear => return (None, steps),
                Ahead::Here => return (Some(aim), steps),
                Ahead::Passed { zero, beyond } => {
                    known = Some((t0 + beyond.0 * h, beyond.1));
                    aim = t0 + zero * h;
                }
                Ahead::Dip(part) => aim = t0 + part * h,
                Ahead::Short(zero) => (t0, aim) = (aim, t0 + zero * h),
            }
        }
        panic!("no end");
    }

    #[test]
    fn steps_find_what_polynomials_find() {
        for zero in [0.001, 0.1, 0.3, 0.47, 0.777, 0.999] {
            let (found, steps) = walk(|t| (zero - t) * (1.0 + t + (3.0 * t).sin()), 1.0);
            assert!((found.unwrap() - zero).abs() < 2e-13, "{zero}: {found:?}");
            assert!(steps <= 8, "{zero}: {steps}");
        }
        let (found, _) = walk(|t| (0.2 - t).min(0.4 - 2.5 * t), 1.0);
        assert!(
            (found.unwrap() - 0.16).abs() < 2e-13,
            "the first of two: {found:?}"
        );
        let dip = |depth: f64| move |t: f64| (t - 0.45) * (t - 0.45) - depth;
        let (found, _) = walk(dip(1e-4), 1.0);
        assert!((found.unwrap() - 0.44).abs() < 1e-9, "{found:?}");
        assert_eq!(walk(dip(-1e-6), 1.0).0, None);
        assert_eq!(walk(|t| t * (2.0 - t), 1.0).0, None, "a start on a zero");
        let (found, _) = walk(|t| (3.0 * t).min(0.02 - t), 1.0);
        assert!((found.unwrap() - 0.02).abs() < 2e-13, "{found:?}");
    }
}

//! Clocks and counters that begin anew at a largest value.

/// Goes on past the wraps of a clock that counts from 0 to below `range`.
#[derive(Debug)]
pub(super) struct Wrapping {
    range: i64,
    late: i64,
    latest: i64,
}

impl Wrapping {
    /// Values may come up to `late` behind the latest, over a wrap too.
    pub fn new(range: i64, late: i64) -> Self {
        Wrapping {
            range,
            late,
            latest: 0,
        }
    }

    /// The next value since the first 0: a step back by more than half the range is a wrap, a smaller one an error of the log that stays. `None`
    /// beyond all numbers.
    pub fn next(&mut self, value: i64) -> Option<i64> {
        let begun = self.latest - self.latest % self.range;
        let here = begun.checked_add(value)?;
        let before = here - self.range;
        let is_late = before >= 0 && self.latest - before <= self.late;
        let next = if is_late {
            before
        } else if self.latest - here > self.range / 2 {
            here.checked_add(self.range)?
        } else {
            here
        };
        self.latest = self.latest.max(next);
        Some(next)
    }

    /// How often it has wrapped.
    pub fn wraps(&self) -> i64 {
        self.latest / self.range
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wraps_are_counted_once_though_values_come_late() {
        let mut clock = Wrapping::new(1000, 100);
        let came = [900, 990, 10, 960, 20, 400, 390, 950, 5, 995, 30];
        let known = [
            900, 990, 1010, 960, 1020, 1400, 1390, 1950, 2005, 1995, 2030,
        ];
        assert_eq!(came.map(|x| clock.next(x)), known.map(Some));
        assert_eq!(clock.wraps(), 2);
        // Too late to be of the round before; and half the range forward is no wrap.
        assert_eq!(clock.next(850), Some(2850));
        assert_eq!(Wrapping::new(1000, 100).next(700), Some(700));
        let mut last = Wrapping::new(i64::MAX, 1);
        assert_eq!(last.next(i64::MAX - 1), Some(i64::MAX - 1));
        assert_eq!(last.next(5), None);
    }
}

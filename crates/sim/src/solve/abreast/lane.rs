//! A run under way in a lane: where its steps end, and what has become of them.

use super::group::Group;
use super::{
    FEW, MOST_SECANTS, MOST_TRIES, NEXT_TO, NEXT_TO_S, STAGES, STRETCH, TURNED, Together,
    resolution_s,
};
use crate::solve::course::Course;
use crate::solve::first_steps::FirstSteps;

/// One run under way in a lane.
pub(super) struct Lane<'m> {
    pub course: Course<'m>,
    /// Which run it is.
    pub run: usize,
    /// How long the step under way is and where it ends, s, and whether that is a moment that none may cross.
    pub h_s: f64,
    pub end_s: f64,
    pub stops: bool,
    /// The next such moment: a sample, or one that the course knows of.
    pub stop_s: f64,
    /// How many handles rested, and the attitude, where the units were found.
    pub weighed: (usize, [f64; 4]),
    pub h_next_s: f64,
    /// Where the step is to end that is to meet an event, s.
    pub aim_s: Option<f64>,
    /// How far beyond the step's end it was found instead, s; then the state there is in `course.y`.
    pub beyond_end_s: f64,
    /// A moment behind that event, with the margin there.
    pub beyond: Option<(f64, f64)>,
    /// Whether a step has ended short of the event since.
    pub short_before: bool,
    pub tries: u32,
    pub rejected_before: bool,
    pub first: FirstSteps,
}

impl Lane<'_> {
    /// Gives the states their units, if contacts or the attitude have changed.
    pub fn weigh<E: Together>(&mut self, group: &mut Group<E>, l: usize, units: &mut [f64]) {
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
    pub fn look_up_stop(&mut self) {
        let stop_s = self.course.stop_s();
        self.stop_s = self
            .course
            .sample_due(stop_s)
            .map_or(stop_s, |due| stop_s.min(due));
    }

    /// Chooses the next step.
    pub fn plan(&mut self) {
        let (t0, stop_s) = (self.course.t_s, self.stop_s);
        let left = stop_s - t0;
        let h = self.h_next_s;
        (self.h_s, self.end_s, self.stops) = match self.aim_s {
            Some(aim_s) if aim_s < stop_s => {
                let h = (aim_s - t0).max(0.5 * resolution_s(t0));
                (h, t0 + h, false)
            }
            _ if left <= h * STRETCH => (left, stop_s, true),
            _ => {
                let steps = left / (h * STRETCH);
                let h = if steps < FEW {
                    left / f64::from(steps as i32 + 1)
                } else {
                    h
                };
                (h, t0 + h, false)
            }
        };
    }

    /// Whether an event at a part `zero` of the step, whose margins were `most_n` at most, is so near to its end that no step has to be
    /// solved in between. If so the state there is in `course.y`.
    ///
    /// The rest of the way, δ, goes along the slopes at its two ends, which errs by (δ/h)³ of what the step changed, or along the first alone
    /// where (δ/h)² is as small; `near` is the largest δ/h. The place is a zero of the secant through the margins there.
    pub fn meets<E: Together>(
        &mut self,
        zero: f64,
        most_n: f64,
        near: f64,
        (group, l): (&Group<E>, usize),
        [at, slope]: [&mut [f64]; 2],
    ) -> bool {
        let nearest_s = near * self.h_s;
        let margin_n = -group.short[STAGES].as_array()[l];
        let mut further_s = (zero - 1.0) * self.h_s;
        if further_s.abs() > nearest_s || margin_n.abs() > 10.0 * near * most_n {
            return false;
        }
        let end_slope = group.end_slope();
        for (slope, k) in slope.iter_mut().zip(end_slope) {
            *slope = k.as_array()[l];
        }
        let alone = further_s.abs() <= NEXT_TO_S.min(NEXT_TO * self.h_s);
        for tried in 0..MOST_SECANTS {
            let t_s = self.end_s + further_s;
            if further_s.abs() > nearest_s || t_s >= self.stop_s {
                return false;
            }
            for (d, at) in at.iter_mut().enumerate() {
                let mean = 0.5 * (end_slope[d].as_array()[l] + slope[d]);
                *at = group.y1[d].as_array()[l] + further_s * mean;
            }
            let next_s = if alone {
                further_s
            } else {
                self.course.rhs(t_s, at, slope);
                let here_n = self.course.margin_n();
                further_s * margin_n / (margin_n - here_n)
            };
            let straight = (further_s / self.h_s).powi(2) <= near.powi(3);
            if (next_s - further_s).abs() <= resolution_s(self.end_s) && (tried > 0 || straight) {
                self.course.y.copy_from_slice(at);
                self.beyond_end_s = further_s;
                return true;
            }
            further_s = next_s;
        }
        false
    }

    /// Aims at another end, for the same step or the next one.
    pub fn again(&mut self, aim_s: f64) -> Ended {
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
pub(super) enum Ended {
    /// There is nothing to be done before the next.
    Under,
    /// At a moment at which somebody looks or something jumps.
    Stop,
    /// At an event.
    Event,
    /// It is not for this method.
    Given,
}

//! The default: stages side by side where the model is one for that, else an explicit pair chosen by the tolerance, and Radau IIA of order 5
//! where the explicit steps are limited by stability.
//!
//! The test for stiffness is that of [`super::pair`]. The implicit method is kept only where it is cheaper: once it has spent more
//! evaluations per second of motion than the explicit one before it, the explicit one goes on, and is not watched any more.

use super::course::Course;
use super::pair::{self, End};
use super::{Observer, Settings, Stats, Stopped};
use super::{dop853, dopri5, radau5, radau15};
use crate::model::Model;

/// Above this many states the matrices of the implicit method cost more than any stiffness.
const MOST_STATES: usize = 200;

/// Tolerances below this are worth the twelve stages of order 8. Measured on `music`: at 1e-4 order 5 costs 0.8 as much, at 1e-6
/// as much for an error fourteen times larger, at 1e-8 1.4 times as much.
const WORTH_ORDER_8: f64 = 3e-5;

/// The name of the method that goes first.
pub(super) fn first(model: &Model, settings: &Settings) -> &'static str {
    if radau15::suits(model) {
        "radau15"
    } else if settings.tolerance < WORTH_ORDER_8 {
        "dop853"
    } else {
        "dopri5"
    }
}

/// Integrates a model.
pub fn run(
    model: &Model,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> (Stats, Result<(), Stopped>) {
    let mut course = Course::new(model, first(model, settings), settings, true);
    match course.begin_log(observer) {
        Ok(()) => go(course, settings, observer),
        Err(stopped) => (course.stats, Err(stopped)),
    }
}

/// Goes on from where a course stands, to its end.
pub fn go(
    mut course: Course<'_>,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> (Stats, Result<(), Stopped>) {
    let mut watch = course.model.layout().size() <= MOST_STATES;
    if radau15::suits(course.model) {
        let outcome;
        (course, outcome) = radau15::go(course, settings, observer);
        match outcome {
            Ok(true) => return (course.stats, Ok(())),
            Ok(false) => {}
            Err(stopped) => return (course.stats, Err(stopped)),
        }
    }
    loop {
        let outcome;
        (course, outcome) = if settings.tolerance < WORTH_ORDER_8 {
            pair::go::<dop853::Dop853, true>(course, settings, watch, observer)
        } else {
            pair::go::<dopri5::Dopri5, true>(course, settings, watch, observer)
        };
        let stopped = match outcome {
            Ok(End::Finished) => Ok(()),
            Ok(End::Stiff { evaluations_per_s }) => {
                let rival = Some(evaluations_per_s);
                match radau5::integrate::<true>(&mut course, settings, rival, observer) {
                    Ok(true) => Ok(()),
                    Ok(false) => {
                        watch = false;
                        continue;
                    }
                    Err(stopped) => Err(stopped),
                }
            }
            Err(stopped) => Err(stopped),
        };
        return (course.stats, stopped);
    }
}

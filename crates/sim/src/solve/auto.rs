//! The default: an explicit pair chosen by the tolerance, and Radau IIA where the explicit steps are limited by stability.
//!
//! The test for stiffness is that of [`super::pair`]. The implicit method is kept only where it is cheaper: once it has spent more
//! evaluations per second of motion than the explicit one before it, the explicit one goes on, and is not watched any more.

use super::course::Course;
use super::pair::{self, End};
use super::{METHODS, Observer, Settings, Stats, Stopped, dop853, dopri5, radau5, resolve};
use crate::model::Model;

/// Above this many states the matrices of the implicit method cost more than any stiffness.
const MOST_STATES: usize = 200;

/// Integrates a model.
pub fn run(
    model: &Model,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> (Stats, Result<(), Stopped>) {
    let order_8 = resolve(&METHODS[0], settings).name == "dop853";
    let name = if order_8 { "dop853" } else { "dopri5" };
    let mut course = Course::new(model, name, settings, true);
    let mut watch = model.layout().size() <= MOST_STATES;
    if let Err(stopped) = course.begin_log(observer) {
        return (course.stats, Err(stopped));
    }
    loop {
        let outcome;
        (course, outcome) = if order_8 {
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

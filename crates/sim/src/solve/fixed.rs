//! Fixed steps: no error control, no located events; N = max(0, N*) at every evaluation.
//!
//! Steps are of `step_s`, shortened evenly where a moment (noise grid, onset, end) must be met. Samples between steps come
//! from the cubic through both ends and their slopes, which is of fourth order.

use super::course::{Course, same_moment_s};
use super::{Observer, Settings, Stats, Stopped};
use crate::model::Model;

/// Beyond this the body has blown up, whatever the scene: a step too large for its method.
const BLOWN_UP: f64 = 1e12;

/// One step of a fixed-step method.
pub trait Step {
    /// Name for messages.
    const NAME: &'static str;
    /// For states of this size.
    fn new(size: usize) -> Self;
    /// From (t, `course.y`), whose derivative is `f0`, to `out` at t + h.
    fn step(&mut self, course: &mut Course, h: f64, f0: &[f64], out: &mut [f64]);
}

/// Integrates a model with method `S`.
pub fn run<S: Step>(
    model: &Model,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> (Stats, Result<(), Stopped>) {
    let mut course = Course::new(model, S::NAME, settings, false);
    let outcome = integrate::<S>(&mut course, settings.step_s, observer);
    (course.stats, outcome)
}

fn integrate<S: Step>(
    course: &mut Course,
    step_s: f64,
    observer: &mut dyn Observer,
) -> Result<(), Stopped> {
    let size = course.y.len();
    let mut method = S::new(size);
    let (mut f0, mut f1, mut y1, mut at) = (
        vec![0.0; size],
        vec![0.0; size],
        vec![0.0; size],
        vec![0.0; size],
    );
    let y0 = course.y.clone();
    while course.sample_due(0.0).is_some() {
        course.sample(&y0, false, observer)?;
    }
    while !course.finished() {
        let begin = course.t_s;
        let stop = course.stop_s();
        // A step that misses the stop by rounding alone is not cut in two.
        let steps = ((stop - begin) / step_s * (1.0 - 1e-9)).ceil().max(1.0);
        let h = (stop - begin) / steps;
        for i in 0..steps as u64 {
            let t0 = course.t_s;
            course.slope(&mut f0);
            method.step(course, h, &f0, &mut y1);
            let t1 = if i + 1 == steps as u64 {
                stop
            } else {
                begin + (i + 1) as f64 * h
            };
            let inner = t1 - 2.0 * same_moment_s(t1);
            if course.sample_due(inner).is_some() {
                course.rhs(t1, &y1, &mut f1);
                while let Some(t) = course.sample_due(inner) {
                    hermite((t - t0) / h, h, &course.y, &f0, &y1, &f1, &mut at);
                    course.model.freedoms().project(&mut at);
                    course.check(t, &at, BLOWN_UP)?;
                    course.sample(&at, false, observer)?;
                }
            }
            // Here and not only on arrival, so that forces that a sample asked for are those of the next step to the last bit.
            course.model.freedoms().project(&mut y1);
            course.check(t1, &y1, BLOWN_UP)?;
            let mut evaluated = false;
            while course.sample_due(t1).is_some() {
                evaluated = course.sample(&y1, evaluated, observer)?;
            }
            std::mem::swap(&mut course.y, &mut y1);
            course.arrive_checked(t1, evaluated, observer)?;
        }
    }
    Ok(())
}

/// The cubic with the given ends and slopes.
fn hermite(s: f64, h: f64, y0: &[f64], f0: &[f64], y1: &[f64], f1: &[f64], out: &mut [f64]) {
    let (r, s2) = (1.0 - s, s * s);
    for d in 0..out.len() {
        let chord = y1[d] - y0[d];
        let bend = r * (h * f0[d] - chord) - s * (h * f1[d] - chord);
        out[d] = y0[d] + s * chord + (s - s2) * bend;
    }
}

//! Other solvers on the same equations, each at its own dense output of 30 Hz.

use crate::by_hand::{Problem, State, rhs, unclamped};
use crate::{Course, Look};
use diffsol::{NalgebraMat, OdeBuilder, OdeSolverMethod, OdeSolverStopReason, VectorCommon};
use std::cell::Cell;

/// A peer: name, and a run at a tolerance.
pub type Peer = (&'static str, fn(&Problem, f64) -> Course);

/// All of them.
pub const PEERS: &[Peer] = &[
    ("ode_solvers Dopri5", dopri5),
    ("ode_solvers Dop853", dop853),
    ("diffsol tsit45 with roots", tsit45),
];

struct System(Problem);

impl ode_solvers::System<f64, State> for System {
    fn system(&self, t: f64, y: &State, dy: &mut State) {
        rhs(&self.0, t, y.as_slice(), dy.as_mut_slice());
    }
}

fn look(y: &[f64]) -> Look {
    let length = y[3..7].iter().map(|q| q * q).sum::<f64>().sqrt();
    Look {
        turn: [y[6], y[3], y[4], y[5]].map(|q| q / length),
        spin: [y[10], y[11], y[12]],
    }
}

const END_S: f64 = 60.0;
const SAMPLES: usize = 1801;

macro_rules! classical {
    ($name:ident, $method:ident) => {
        fn $name(problem: &Problem, tolerance: f64) -> Course {
            let start = State::from_column_slice(&problem.start());
            let mut solver = ode_solvers::$method::new(
                System(*problem),
                0.0,
                END_S,
                1.0 / 30.0,
                start,
                tolerance,
                tolerance,
            );
            let evaluations = solver
                .integrate()
                .map_or(0, |stats| u64::from(stats.num_eval));
            // Its last sample is at the end or one short of it.
            let mut looks: Vec<Look> = solver.y_out().iter().map(|y| look(y.as_slice())).collect();
            looks.truncate(SAMPLES);
            if looks.len() + 1 == SAMPLES {
                looks.extend(looks.last().copied());
            }
            Course { looks, evaluations }
        }
    };
}

classical!(dopri5, Dopri5);
classical!(dop853, Dop853);

fn tsit45(problem: &Problem, tolerance: f64) -> Course {
    let evaluations = Cell::new(0u64);
    let failed = || Course {
        looks: Vec::new(),
        evaluations: 0,
    };
    let builder = OdeBuilder::<NalgebraMat<f64>>::new()
        .rtol(tolerance)
        .atol([tolerance])
        .h0(1e-4)
        .rhs(|y, _p, t, dy| {
            evaluations.set(evaluations.get() + 1);
            rhs(problem, t, y, dy);
        })
        .init(|_p, _t, y| y.copy_from_slice(&problem.start()), 15)
        .root(
            |y, _p, t, out| out.copy_from_slice(&unclamped(problem, t, y)),
            2,
        );
    let Ok(built) = builder.build() else {
        return failed();
    };
    let Ok(mut solver) = built.tsit45() else {
        return failed();
    };
    let mut looks = Vec::with_capacity(SAMPLES);
    let due = |n: usize| n as f64 / 30.0;
    if solver.set_stop_time(END_S).is_err() {
        return failed();
    }
    loop {
        let reason = match solver.step() {
            Ok(reason) => reason,
            Err(_) => {
                return Course {
                    looks,
                    evaluations: evaluations.get(),
                };
            }
        };
        let until = match reason {
            OdeSolverStopReason::RootFound(t, _) => t,
            _ => solver.state().t,
        };
        while looks.len() < SAMPLES && due(looks.len()) <= until + 1e-12 {
            match solver.interpolate(due(looks.len()).min(until)) {
                Ok(y) => looks.push(look(y.inner().as_slice())),
                Err(_) => {
                    return Course {
                        looks,
                        evaluations: evaluations.get(),
                    };
                }
            }
        }
        match reason {
            OdeSolverStopReason::TstopReached => break,
            OdeSolverStopReason::RootFound(t, _) => {
                if solver.state_mut_back(t).is_err() || solver.set_stop_time(END_S).is_err() {
                    break;
                }
            }
            OdeSolverStopReason::InternalTimestep => {}
        }
    }
    Course {
        looks,
        evaluations: evaluations.get(),
    }
}

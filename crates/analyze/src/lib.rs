//! Findings: what a recording, or a run in memory, says about how a carried thing moves.
//!
//! The numeric core takes slices and opens nothing:
//!
//! * [`Inputs`] and a [`Window`] go in, [`metrics()`] come out; the table of all metrics is [`metrics::METRICS`].
//! * [`spectrum`], [`filter`] and [`phase`] have SciPy's arguments and SciPy's numbers.
//! * [`mechanism`] says what drives the roll, [`events`] what happened when, [`peaks`] which lines a spectrum has.
//!
//! [`examine`] puts them to work on a recording in one pass, [`report`] shows what came out.

pub mod arrivals;
pub mod beat;
pub mod clock;
pub mod envelope;
pub mod events;
pub mod examine;
pub mod field;
pub mod filter;
mod holes;
pub mod imu;
pub mod inputs;
mod line;
pub mod mechanism;
mod median;
pub mod metrics;
mod pairs;
pub mod peaks;
pub mod phase;
pub mod quality;
pub mod quaternion;
mod random;
pub mod report;
pub mod request;
pub mod roles;
pub mod spectrum;
pub mod spline;
pub mod steps;
pub mod summary;
pub mod table;
pub mod window;

pub use inputs::{Inputs, Window};
pub use metrics::{Metrics, metrics, metrics_of};

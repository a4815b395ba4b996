//! Findings: what a recording, or a run in memory, says about how a carried thing moves.
pub mod filter;
pub mod inputs;
pub mod mechanism;
pub mod metrics;
pub mod phase;
pub mod spectrum;
pub use inputs::{Inputs, Window};
pub use metrics::{Metrics, metrics, metrics_of};

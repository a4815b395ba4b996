//! Findings: what a recording, or a run in memory, says about how a carried thing moves.
pub mod filter;
pub mod phase;
pub mod spectrum;

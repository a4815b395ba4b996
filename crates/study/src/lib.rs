//! Many runs, one table. The only crate that puts `sim` and `analyze` together, in memory.

pub mod draw;
pub mod ensemble;
pub mod fit;
pub mod paper;
pub mod pool;
pub mod predictions;
pub mod statistics;
pub mod sweep;
pub mod twin;

//! A recording drives the model: the carriers' measured motion instead of the oscillators, and how far the body's motion then lies
//! from the measured one.
//!
//! [`Take::read`] finds what was measured, [`Take::scene`] makes a scene of it that runs like any other, [`misfit`] compares.

mod beat;
mod drive;
mod misfit;
mod take;

pub use drive::{Drive, Options, Replay};
pub use misfit::{Course, Misfit, misfit};
pub use take::Take;

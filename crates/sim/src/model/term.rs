//! What an effect adds to the right-hand side: terms, moments at which it may jump, pages in the energy ledger.

use super::workspace::{All, Block, Pair, Part, Workspace};

/// A part of the right-hand side.
pub trait Term: Send + Sync {
    /// Adds its part to the workspace at time `t_s`.
    fn apply(&self, t_s: f64, w: &mut Workspace);
    /// The same for a block of pairs, if each is treated by itself.
    fn on_block(&self) -> Option<&dyn OnBlock> {
        None
    }
}

/// A term that treats every pair by itself: where there are thousands, all such terms are applied block by block.
pub trait Local: Send + Sync {
    /// As [`Term::apply`], on some of the pairs.
    fn act(&self, t_s: f64, w: &mut Workspace, part: impl Part);
}

/// [`Local::act`] on a block.
pub trait OnBlock {
    /// Adds its part to a block.
    fn apply_to(&self, t_s: f64, w: &mut Workspace, block: Block);
}

impl<T: Local> OnBlock for T {
    fn apply_to(&self, t_s: f64, w: &mut Workspace, block: Block) {
        self.act(t_s, w, block);
    }
}

impl<T: Local> Term for T {
    fn apply(&self, t_s: f64, w: &mut Workspace) {
        self.act(t_s, w, All);
    }
    fn on_block(&self) -> Option<&dyn OnBlock> {
        Some(self)
    }
}

/// Where a term belongs in an evaluation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Adds to the phase rates.
    Phases,
    /// Moves the shoulders.
    Shoulders,
    /// Moves the party as a whole, shoulders and all.
    Party,
    /// Moves the handles against the rigid body.
    Bends,
    /// Sets forces at the handles.
    Handles,
    /// Adds torque on the body.
    Body,
}

/// Moments, known beforehand, at which the right-hand side may jump.
pub trait Switch: Send + Sync {
    /// The first such moment after `after_s`, or infinity.
    fn next_s(&self, after_s: f64) -> f64;
    /// Prepares the segment that begins at `t_s`.
    fn begin(&self, _t_s: f64, _w: &mut Workspace) {}
}

/// What an effect does with energy.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Power {
    /// Fed in by the carriers, W.
    pub work_w: f64,
    /// Taken out for good, W.
    pub dissipated_w: f64,
}

/// An effect's page in the energy ledger.
pub trait Account: Send + Sync {
    /// Power at the evaluated state, of `pairs` alone: those from the pair numbered `first` on.
    fn power(&self, w: &Workspace, pairs: &[Pair], first: usize) -> Power;
    /// Energy stored in the effect's springs, J.
    fn stored_j(&self, _w: &Workspace) -> f64 {
        0.0
    }
}

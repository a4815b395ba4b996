//! The numbers of one evaluation, and which of them a term treats.

use crate::lanes::{LANES, f64x2};
use std::ops::Range;

/// The numbers of two carriers in one evaluation, and in the present segment. Padding exerts nothing.
///
/// What is used together lies together, in whole lines of the cache: with thousands of carriers these are fetched anew by every term that treats
/// all of them.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Pair {
    /// Natural frequency and the segment's noise, rad/s.
    pub constant_rate: f64x2,
    /// sin φ
    pub sin: f64x2,
    /// cos φ
    pub cos: f64x2,
    /// φ̇, rad/s
    pub rate: f64x2,
    /// Shoulders b, m.
    pub base: [f64x2; 3],
    /// What multiplies N*: 1 where it acts, 0 on a slack handle.
    pub contact_gain: f64x2,
    /// ḃ, m/s
    pub base_rate: [f64x2; 3],
    /// The least that N can be: 0 (slack, or undecided), −∞ (in contact for the whole segment).
    pub contact_floor: f64x2,
    /// Shoulder minus handle, m.
    pub gap: [f64x2; 3],
    /// N* before the clamp, N.
    pub unclamped: f64x2,
    /// Rate of the gap, m/s.
    pub gap_rate: [f64x2; 3],
    /// N, N
    pub normal: f64x2,
    /// Handles relative to the centre of mass, in the world, m.
    pub arm: [f64x2; 3],
    /// T in x and y, N
    pub tangential: [f64x2; 2],
    /// Resting shoulders, m.
    pub rest: [f64x2; 3],
}

impl Pair {
    /// Puts the shoulders at rest.
    #[inline(always)]
    pub(super) fn stand(&mut self) {
        for axis in 0..3 {
            self.base[axis] = self.rest[axis];
            self.base_rate[axis] = f64x2::ZERO;
        }
    }
}

/// The numbers of one evaluation and of the present segment.
#[derive(Clone, Debug)]
pub struct Workspace {
    /// When the present segment began, s.
    pub segment_s: f64,
    /// The carriers, two by two: carrier i is lane i mod 2 of pair i / 2.
    pub pair: Vec<Pair>,
    /// Rows of the rotation body → world; where the freedoms do not need it, set only if something bends.
    pub rotation: [[f64; 3]; 3],
    /// Angular velocity in the body, rad/s.
    pub spin: [f64; 3],
    /// What a law in proportion to the load of a unilateral contact takes for the least load, N: 0, or −∞ where a method freezes contacts
    /// within a step and wants the law to go on as it was behind a lift-off that is still to be located. A kink there would be taken for
    /// an error.
    pub least_load_n: f64,
    /// Torque on the body beside that of the handle forces, body axes, N·m.
    pub body_torque: [f64; 3],
    /// States of the effects' own.
    pub extra: Vec<f64>,
    /// Their rates.
    pub extra_rate: Vec<f64>,
}

impl Workspace {
    /// A number of carrier `i`.
    #[inline(always)]
    pub fn of(&self, i: usize, pick: impl Fn(&Pair) -> f64x2) -> f64 {
        pick(&self.pair[i / LANES]).as_array()[i % LANES]
    }

    /// A number of carrier `i`, to be changed.
    #[inline(always)]
    pub fn of_mut(&mut self, i: usize, pick: impl Fn(&mut Pair) -> &mut f64x2) -> &mut f64 {
        &mut pick(&mut self.pair[i / LANES]).as_mut_array()[i % LANES]
    }
}

/// Which pairs are treated.
pub trait Part {
    /// Their places among `pairs`.
    fn range(&self, pairs: usize) -> Range<usize>;
    /// What belongs to them.
    fn of<'a, T>(&self, all: &'a [T]) -> &'a [T];
    /// The same, to be changed.
    fn of_mut<'a, T>(&self, all: &'a mut [T]) -> &'a mut [T];
}

/// All of them.
pub struct All;

impl Part for All {
    #[inline(always)]
    fn range(&self, pairs: usize) -> Range<usize> {
        0..pairs
    }
    #[inline(always)]
    fn of<'a, T>(&self, all: &'a [T]) -> &'a [T] {
        all
    }
    #[inline(always)]
    fn of_mut<'a, T>(&self, all: &'a mut [T]) -> &'a mut [T] {
        all
    }
}

/// As many as the first cache holds.
pub type Block = Range<usize>;

impl Part for Block {
    fn range(&self, _pairs: usize) -> Range<usize> {
        self.clone()
    }
    fn of<'a, T>(&self, all: &'a [T]) -> &'a [T] {
        &all[self.clone()]
    }
    fn of_mut<'a, T>(&self, all: &'a mut [T]) -> &'a mut [T] {
        &mut all[self.clone()]
    }
}

/// So many pairs, with what the terms know of them, leave room in the first cache of any processor (32 kB).
pub(super) const BLOCK: usize = 32;

/// Pairs by blocks.
pub(super) fn blocks(pairs: usize) -> impl Iterator<Item = Block> {
    let starts = (0..pairs).step_by(BLOCK);
    starts.map(move |start| start..pairs.min(start + BLOCK))
}

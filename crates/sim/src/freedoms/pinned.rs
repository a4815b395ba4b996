//! Three free angles, some of the translations held.

use super::{Coordinates, Freedoms, Pose, Six};
use crate::lanes::{Moments, Number, f64x2};
use crate::model::workspace::{Block, Pair, Part, Workspace};
use crate::scene::parts::Start;
use std::ops::Range;

/// The attitude of [`Six`] with a centre of mass on rails.
pub(super) struct Pinned {
    six: Six,
    free: [bool; 3],
}

impl Pinned {
    /// `free`: whether x, y and z are.
    pub fn new(six: Six, free: [bool; 3]) -> Self {
        Self { six, free }
    }

    fn hold(&self, v: &mut [f64]) {
        for (v, free) in v.iter_mut().zip(self.free) {
            if !free {
                *v = 0.0;
            }
        }
    }
}

impl Coordinates for Pinned {
    #[inline(always)]
    fn gaps_at<N: Moments>(&self, y: &[N::Each], w: &mut Workspace<N>, part: impl Part) {
        self.six.gaps_at(y, w, part);
    }
    #[inline(always)]
    fn orient_at<N: Moments>(&self, y: &[N::Each], w: &mut Workspace<N>) {
        self.six.orient_at(y, w);
    }
    #[inline(always)]
    fn rates_at<N: Moments>(&self, y: &[N::Each], w: &Workspace<N>, dy: &mut [N::Each]) {
        self.six.rates_at(y, w, dy);
        for (dy, free) in dy[7..10].iter_mut().zip(self.free) {
            if !free {
                *dy = N::Each::splat(0.0);
            }
        }
    }
}

impl Freedoms for Pinned {
    fn size(&self) -> usize {
        self.six.size()
    }
    fn names(&self) -> &[&'static str] {
        self.six.names()
    }
    fn positions(&self) -> usize {
        self.six.positions()
    }
    fn place(&self, start: &Start, height_m: f64, y: &mut [f64]) {
        self.six.place(start, height_m, y);
        self.hold(&mut y[7..10]);
    }
    fn gaps(&self, y: &[f64], w: &mut Workspace) {
        self.six.gaps(y, w);
    }
    fn gaps_of(&self, y: &[f64], w: &mut Workspace, block: Block) {
        self.six.gaps_of(y, w, block);
    }
    fn orient(&self, y: &[f64], w: &mut Workspace) {
        self.six.orient(y, w);
    }
    fn accelerate(&self, y: &[f64], w: &mut Workspace, dy: &mut [f64]) {
        self.rates_at(y, w, dy);
    }
    fn attitude(&self) -> Range<usize> {
        self.six.attitude()
    }
    fn levers(&self, y: &[f64], handle_m: [f64; 3], axis: usize) -> [f64; 6] {
        self.six.levers(y, handle_m, axis)
    }
    fn inverse_masses(&self, y: &[f64]) -> [f64; 6] {
        let mut inverse = self.six.inverse_masses(y);
        self.hold(&mut inverse[..3]);
        inverse
    }
    fn spin_rad_per_s(&self, y: &[f64]) -> [f64; 3] {
        self.six.spin_rad_per_s(y)
    }
    fn pose(&self, y: &[f64]) -> Pose {
        self.six.pose(y)
    }
    fn acceleration(&self, y: &[f64], dy: &[f64]) -> [[f64; 3]; 2] {
        self.six.acceleration(y, dy)
    }
    fn project(&self, y: &mut [f64]) {
        self.six.project(y);
    }
    fn drift(&self, h_s: f64, y: &mut [f64]) {
        self.six.drift(h_s, y);
    }
    fn energy_j(&self, y: &[f64]) -> [f64; 2] {
        self.six.energy_j(y)
    }
    fn rotation(&self) -> Option<[usize; 2]> {
        self.six.rotation()
    }
    fn scales(&self) -> &[f64] {
        self.six.scales()
    }
    fn damping_per_s(&self, y: &[f64], pairs: &[Pair], damping: [&[f64x2]; 2], rates: &mut [f64]) {
        self.six.damping_per_s(y, pairs, damping, rates);
    }
}

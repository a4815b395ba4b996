//! The numbers of one evaluation, and which of them a term treats.

#[cfg(target_arch = "x86_64")]
use crate::lanes::Fused;
use crate::lanes::{Eight, LANES, Moments, Now, Number, Two, Wide, f64x2};
use std::ops::Range;

/// The numbers of two carriers in one evaluation, and in the present segment. Padding exerts nothing.
///
/// What is used together lies together, in whole lines of the cache: with thousands of carriers these are fetched anew by every term that treats
/// all of them.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Pair<N: Moments = Now> {
    /// Natural frequency and the segment's noise, rad/s.
    pub constant_rate: N::Pair,
    /// sin φ
    pub sin: N::Pair,
    /// cos φ
    pub cos: N::Pair,
    /// φ̇, rad/s
    pub rate: N::Pair,
    /// Shoulders b, m.
    pub base: [N::Pair; 3],
    /// What multiplies N*: 1 where it acts, 0 on a slack handle.
    pub contact_gain: N::Pair,
    /// ḃ, m/s
    pub base_rate: [N::Pair; 3],
    /// The least that N can be: 0 (slack, or undecided), −∞ (in contact for the whole segment).
    pub contact_floor: N::Pair,
    /// Shoulder minus handle, m.
    pub gap: [N::Pair; 3],
    /// N* before the clamp, N.
    pub unclamped: N::Pair,
    /// Rate of the gap, m/s.
    pub gap_rate: [N::Pair; 3],
    /// N, N
    pub normal: N::Pair,
    /// Handles relative to the centre of mass, in the world, m.
    pub arm: [N::Pair; 3],
    /// T in x and y, N
    pub tangential: [N::Pair; 2],
    /// Resting shoulders, m.
    pub rest: [N::Pair; 3],
}

impl<N: Moments> Pair<N> {
    /// Above 0 where N acts, which is always in a bilateral contact, else where it pushes.
    #[inline(always)]
    pub fn acts(&self) -> N::Pair {
        // The floor is 0 or −∞.
        self.normal.larger(-self.contact_floor)
    }

    /// Puts the shoulders at rest.
    #[inline(always)]
    pub(super) fn stand(&mut self) {
        for axis in 0..3 {
            self.base[axis] = self.rest[axis];
            self.base_rate[axis] = N::Pair::splat(0.0);
        }
    }
}

/// The numbers of one evaluation and of the present segment.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Workspace<N: Moments = Now> {
    /// When the present segment began, s.
    pub segment_s: N::Each,
    /// The carriers, two by two: carrier i is lane i mod 2 of pair i / 2.
    pub pair: Box<[Pair<N>]>,
    /// Rows of the rotation body → world; where the freedoms do not need it, set only if something looks at the body.
    pub rotation: [[N::Each; 3]; 3],
    /// Angular velocity in the body, rad/s.
    pub spin: [N::Each; 3],
    /// What a law in proportion to the load of a unilateral contact takes for the least load, N: 0, or −∞ where a method freezes contacts
    /// within a step and wants the law to go on as it was behind a lift-off that is still to be located. A kink there would be taken for
    /// an error.
    pub least_load_n: f64,
    /// Sine and cosine of the beat's phase, times how far its pull has grown; 0 in silence.
    pub beat: [N::Each; 2],
    /// Acceleration of the centre of mass beside that by the handle forces, in the world, m/s²: gravity, and what else pulls.
    pub free_fall: [N::Each; 3],
    /// When this is evaluated, s; set only where something looks at the body.
    pub t_s: N::Each,
    /// Velocity of the centre of mass in the world, m/s; set likewise.
    pub velocity: [N::Each; 3],
    /// Torque on the body beside that of the handle forces, body axes, N·m.
    pub body_torque: [N::Each; 3],
    /// States of the effects' own.
    pub extra: Box<[N::Each]>,
    /// Their rates.
    pub extra_rate: Box<[N::Each]>,
}

impl<N: Moments> Workspace<N> {
    /// Without carriers: for [`Workspace::spread`] to fill.
    #[inline(always)]
    pub fn blank() -> Self {
        let zero = N::Each::splat(0.0);
        Self {
            segment_s: zero,
            pair: Box::default(),
            rotation: [[zero; 3]; 3],
            spin: [zero; 3],
            least_load_n: 0.0,
            beat: [zero; 2],
            free_fall: [zero; 3],
            t_s: zero,
            velocity: [zero; 3],
            body_torque: [zero; 3],
            extra: Box::default(),
            extra_rate: Box::default(),
        }
    }

    /// A number of carrier `i`.
    #[inline(always)]
    pub fn of(&self, i: usize, pick: impl Fn(&Pair<N>) -> N::Pair) -> N::Each {
        N::of(pick(&self.pair[i / LANES]), i % LANES)
    }

    /// Changes a number of carrier `i`.
    #[inline(always)]
    pub fn set(&mut self, i: usize, pick: impl Fn(&mut Pair<N>) -> &mut N::Pair, to: N::Each) {
        N::set(pick(&mut self.pair[i / LANES]), i % LANES, to);
    }
}

/// The same pairs, to be computed with by [`Fused`].
#[cfg(target_arch = "x86_64")]
#[inline(always)]
#[allow(unsafe_code)]
pub(super) fn fused(pairs: &[Pair]) -> &[Pair<Fused>] {
    // SAFETY: both are `repr(C)`, their fields in turn the same numbers in the same places.
    unsafe { &*(std::ptr::from_ref(pairs) as *const [Pair<Fused>]) }
}

impl Workspace {
    /// The same numbers, to be computed with by [`Fused`].
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    #[allow(unsafe_code)]
    pub(crate) fn fused(&mut self) -> &mut Workspace<Fused> {
        // SAFETY: both are `repr(C)`, their fields in turn the same numbers in the same places.
        unsafe { &mut *std::ptr::from_mut(self).cast() }
    }

    /// As [`Self::fused`].
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    #[allow(unsafe_code)]
    pub(crate) fn as_fused(&self) -> &Workspace<Fused> {
        // SAFETY: as above.
        unsafe { &*std::ptr::from_ref(self).cast() }
    }

    /// A number of carrier `i`, to be changed.
    #[inline(always)]
    pub fn of_mut(&mut self, i: usize, pick: impl Fn(&mut Pair) -> &mut f64x2) -> &mut f64 {
        &mut pick(&mut self.pair[i / LANES]).as_mut_array()[i % LANES]
    }

    /// What changes from one segment to the next, for an evaluation at other moments.
    pub fn refresh<M: Moments>(&self, to: &mut Workspace<M>) {
        to.segment_s = M::Each::splat(self.segment_s);
        for (to, p) in to.pair.iter_mut().zip(&self.pair) {
            to.constant_rate = M::always(p.constant_rate);
            to.contact_gain = M::always(p.contact_gain);
            to.contact_floor = M::always(p.contact_floor);
        }
    }

    /// The same segment for an evaluation at other moments: what `M` does not compute itself is what it is here.
    pub fn spread<M: Moments>(&self, to: &mut Workspace<M>) {
        let zero = M::Each::splat(0.0);
        to.segment_s = M::Each::splat(self.segment_s);
        to.free_fall = self.free_fall.map(M::Each::splat);
        to.least_load_n = self.least_load_n;
        to.extra = vec![zero; self.extra.len()].into();
        to.extra_rate = to.extra.clone();
        let pair = |p: &Pair| {
            let zero = M::Pair::splat(0.0);
            let rest = p.rest.map(M::always);
            Pair {
                constant_rate: M::always(p.constant_rate),
                sin: zero,
                cos: zero,
                rate: zero,
                base: rest,
                contact_gain: M::always(p.contact_gain),
                base_rate: [zero; 3],
                contact_floor: M::always(p.contact_floor),
                gap: [zero; 3],
                unclamped: zero,
                gap_rate: [zero; 3],
                normal: zero,
                arm: [zero; 3],
                tangential: [zero; 2],
                rest,
            }
        };
        to.pair = self.pair.iter().map(pair).collect();
    }
}

impl<E: Wide> Workspace<Eight<E>> {
    /// What was evaluated at one of the moments.
    pub fn pick(&self, moment: usize, to: &mut Workspace) {
        let one = |x: &E| x.as_array()[moment];
        let two = |x: &Two<E>| f64x2::new([one(&x.0[0]), one(&x.0[1])]);
        for (to, p) in to.pair.iter_mut().zip(&self.pair) {
            to.sin = two(&p.sin);
            to.cos = two(&p.cos);
            to.rate = two(&p.rate);
            to.unclamped = two(&p.unclamped);
            to.normal = two(&p.normal);
            for axis in 0..3 {
                to.base[axis] = two(&p.base[axis]);
                to.base_rate[axis] = two(&p.base_rate[axis]);
                to.gap[axis] = two(&p.gap[axis]);
                to.gap_rate[axis] = two(&p.gap_rate[axis]);
                to.arm[axis] = two(&p.arm[axis]);
            }
            for axis in 0..2 {
                to.tangential[axis] = two(&p.tangential[axis]);
            }
        }
        for axis in 0..3 {
            for other in 0..3 {
                to.rotation[axis][other] = one(&self.rotation[axis][other]);
            }
            to.spin[axis] = one(&self.spin[axis]);
            to.body_torque[axis] = one(&self.body_torque[axis]);
            to.free_fall[axis] = one(&self.free_fall[axis]);
            to.velocity[axis] = one(&self.velocity[axis]);
        }
        to.beat = [one(&self.beat[0]), one(&self.beat[1])];
        to.t_s = one(&self.t_s);
        for (to, from) in to.extra.iter_mut().zip(&self.extra) {
            *to = one(from);
        }
        for (to, from) in to.extra_rate.iter_mut().zip(&self.extra_rate) {
            *to = one(from);
        }
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

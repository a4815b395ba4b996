//! What an effect adds to the right-hand side: terms, moments at which it may jump, pages in the energy ledger.

#[cfg(target_arch = "x86_64")]
use super::workspace::fused;
use super::workspace::{All, Block, Pair, Part, Workspace};
#[cfg(target_arch = "x86_64")]
use crate::lanes::{Avx2, Avx512, Fused, FusedEach};
use crate::lanes::{Eight, Moments, Plain8, Slope, Slopes};

/// A part of the right-hand side.
pub trait Term: Send + Sync {
    /// Adds its part to the workspace at time `t_s`.
    fn apply(&self, t_s: f64, w: &mut Workspace);
    /// The same by fused arithmetic ([`crate::lanes`]).
    ///
    /// # Safety
    /// The processor has AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    unsafe fn apply_fused(&self, t_s: f64, w: &mut Workspace);
    /// The same for a block of pairs, if each is treated by itself.
    fn on_block(&self) -> Option<&dyn OnBlock> {
        None
    }
    /// The same at eight moments side by side, and with derivatives.
    fn on_eight(&self) -> &dyn OnEight;
}

/// A term written for any number of moments that treats every pair by itself: where there are thousands of pairs, all such terms are
/// applied block by block.
pub trait Local: Send + Sync {
    /// As [`Term::apply`], on some of the pairs.
    fn act<N: Moments>(&self, t_s: N::Each, w: &mut Workspace<N>, part: impl Part);
}

/// A term written for any number of moments that looks at all pairs at once.
pub trait Whole: Send + Sync {
    /// As [`Term::apply`].
    fn act<N: Moments>(&self, t_s: N::Each, w: &mut Workspace<N>);
}

/// Makes a [`Term`] of what is [`Whole`].
#[derive(Debug)]
pub struct AsWhole<T>(pub T);

/// [`Local::act`] on a block.
pub trait OnBlock {
    /// Adds its part to a block.
    fn apply_to(&self, t_s: f64, w: &mut Workspace, block: Block);
    /// The same by fused arithmetic.
    ///
    /// # Safety
    /// The processor has AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    unsafe fn apply_to_fused(&self, t_s: f64, w: &mut Workspace, block: Block);
}

impl<T: Local> OnBlock for T {
    fn apply_to(&self, t_s: f64, w: &mut Workspace, block: Block) {
        self.act(t_s, w, block);
    }
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    #[allow(unsafe_code)]
    unsafe fn apply_to_fused(&self, t_s: f64, w: &mut Workspace, block: Block) {
        self.act(FusedEach(t_s), w.fused(), block);
    }
}

impl<T: Local> Term for T {
    fn apply(&self, t_s: f64, w: &mut Workspace) {
        self.act(t_s, w, All);
    }
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    #[allow(unsafe_code)]
    unsafe fn apply_fused(&self, t_s: f64, w: &mut Workspace) {
        self.act(FusedEach(t_s), w.fused(), All);
    }
    fn on_block(&self) -> Option<&dyn OnBlock> {
        Some(self)
    }
    fn on_eight(&self) -> &dyn OnEight {
        self
    }
}

impl<T: Whole> Term for AsWhole<T> {
    fn apply(&self, t_s: f64, w: &mut Workspace) {
        self.0.act(t_s, w);
    }
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    #[allow(unsafe_code)]
    unsafe fn apply_fused(&self, t_s: f64, w: &mut Workspace) {
        self.0.act(FusedEach(t_s), w.fused());
    }
    fn on_eight(&self) -> &dyn OnEight {
        self
    }
}

/// [`Term::apply`] at eight moments, for each kind of registers, or at one with derivatives in eight directions.
///
/// A trait object's functions do not inherit the processor features of their caller: each asks for its own.
#[allow(missing_docs)]
pub trait OnEight {
    fn slopes(&self, t_s: Slope, w: &mut Workspace<Slopes>);
    fn plain(&self, t_s: Plain8, w: &mut Workspace<Eight<Plain8>>);
    /// # Safety
    /// The processor has AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    unsafe fn avx2(&self, t_s: Avx2, w: &mut Workspace<Eight<Avx2>>);
    /// # Safety
    /// The processor has AVX-512 F and DQ.
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    unsafe fn avx512(&self, t_s: Avx512, w: &mut Workspace<Eight<Avx512>>);
}

macro_rules! on_eight {
    ($bound:ident, $type:ty, |$self:ident, $t:ident, $w:ident| $act:expr) => {
        impl<T: $bound> OnEight for $type {
            fn slopes(&self, $t: Slope, $w: &mut Workspace<Slopes>) {
                let $self = self;
                $act
            }
            fn plain(&self, $t: Plain8, $w: &mut Workspace<Eight<Plain8>>) {
                let $self = self;
                $act
            }
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,fma")]
            #[allow(unsafe_code)]
            unsafe fn avx2(&self, $t: Avx2, $w: &mut Workspace<Eight<Avx2>>) {
                let $self = self;
                $act
            }
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f,avx512dq")]
            #[allow(unsafe_code)]
            unsafe fn avx512(&self, $t: Avx512, $w: &mut Workspace<Eight<Avx512>>) {
                let $self = self;
                $act
            }
        }
    };
}
on_eight!(Local, T, |term, t, w| term.act(t, w, All));
on_eight!(Whole, AsWhole<T>, |term, t, w| term.0.act(t, w));

/// Where a term belongs in an evaluation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Sets what depends on time alone.
    Clock,
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
    /// Adds to the fall of the body and to the torque on it.
    Body,
}

impl Stage {
    /// Which part of an evaluation it is of, and its place there: stages with nothing else between them make a part.
    #[inline(always)]
    fn part(self) -> (usize, usize) {
        match self {
            Self::Clock => (0, 0),
            Self::Phases => (0, 1),
            Self::Shoulders => (0, 2),
            Self::Party => (1, 0),
            Self::Bends => (2, 0),
            Self::Handles => (3, 0),
            Self::Body => (3, 1),
        }
    }
}

/// Things in the order of their stages, a part's side by side: they are gone through in one loop.
#[derive(Clone, Debug)]
pub(crate) struct Staged<T> {
    parts: [Vec<T>; 4],
    /// Where each stage ends in its part.
    ends: [[usize; 3]; 4],
}

impl<T> Default for Staged<T> {
    fn default() -> Self {
        Self {
            parts: Default::default(),
            ends: Default::default(),
        }
    }
}

impl<T> Staged<T> {
    /// Adds one at the end of its stage.
    pub fn add(&mut self, stage: Stage, one: T) {
        let (part, place) = stage.part();
        self.parts[part].insert(self.ends[part][place], one);
        for end in &mut self.ends[part][place..] {
            *end += 1;
        }
    }

    /// Those of one stage.
    #[inline(always)]
    pub fn of(&self, stage: Stage) -> &[T] {
        let (part, place) = stage.part();
        let start = if place == 0 {
            0
        } else {
            self.ends[part][place - 1]
        };
        &self.parts[part][start..self.ends[part][place]]
    }

    /// Those of the whole part that a stage is of.
    #[inline(always)]
    pub fn with(&self, stage: Stage) -> &[T] {
        &self.parts[stage.part().0]
    }

    /// All of them.
    pub fn all(&self) -> impl Iterator<Item = &T> {
        self.parts.iter().flatten()
    }

    /// What `of` makes of each.
    pub fn map<'a, U>(&'a self, of: impl Fn(&'a T) -> U) -> Staged<U> {
        let part = |part: &'a Vec<T>| part.iter().map(&of).collect();
        Staged {
            parts: self.parts.each_ref().map(part),
            ends: self.ends,
        }
    }
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
pub struct Power<T = f64> {
    /// Fed in by the carriers and by who else pushes, W.
    pub work_w: T,
    /// Taken out for good, W.
    pub dissipated_w: T,
}

/// An effect's page in the energy ledger.
pub trait Account: Send + Sync {
    /// Power at the evaluated state, of `pairs` alone: those from the pair numbered `first` on. It is asked for each block of pairs and summed: what
    /// belongs to no pair counts where `first` is 0 alone.
    fn power(&self, w: &Workspace, pairs: &[Pair], first: usize) -> Power;
    /// The same by fused arithmetic.
    ///
    /// # Safety
    /// The processor has AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    unsafe fn power_fused(&self, w: &Workspace, pairs: &[Pair], first: usize) -> Power;
    /// Energy stored in the effect's springs, J.
    fn stored_j(&self, w: &Workspace) -> f64;
    /// What of it no spring holds, J: it is told as dissipated.
    fn lent_j(&self, w: &Workspace) -> f64;
    /// The power at eight moments side by side.
    fn on_eight(&self) -> &dyn PowerOnEight;
}

/// An account written for any number of moments.
pub trait Book: Send + Sync {
    /// As [`Account::power`].
    fn power<N: Moments>(
        &self,
        w: &Workspace<N>,
        pairs: &[Pair<N>],
        first: usize,
    ) -> Power<N::Each>;
    /// As [`Account::stored_j`].
    fn stored_j(&self, _w: &Workspace) -> f64 {
        0.0
    }
    /// As [`Account::lent_j`].
    fn lent_j(&self, _w: &Workspace) -> f64 {
        0.0
    }
}

impl<T: Book> Account for T {
    fn power(&self, w: &Workspace, pairs: &[Pair], first: usize) -> Power {
        Book::power(self, w, pairs, first)
    }
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    #[allow(unsafe_code)]
    unsafe fn power_fused(&self, w: &Workspace, pairs: &[Pair], first: usize) -> Power {
        let power = Book::power::<Fused>(self, w.as_fused(), fused(pairs), first);
        Power {
            work_w: power.work_w.0,
            dissipated_w: power.dissipated_w.0,
        }
    }
    fn stored_j(&self, w: &Workspace) -> f64 {
        Book::stored_j(self, w)
    }
    fn lent_j(&self, w: &Workspace) -> f64 {
        Book::lent_j(self, w)
    }
    fn on_eight(&self) -> &dyn PowerOnEight {
        self
    }
}

/// [`Account::power`] of all pairs at eight moments, as [`OnEight`].
#[allow(missing_docs)]
pub trait PowerOnEight {
    fn plain(&self, w: &Workspace<Eight<Plain8>>) -> Power<Plain8>;
    /// # Safety
    /// The processor has AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    unsafe fn avx2(&self, w: &Workspace<Eight<Avx2>>) -> Power<Avx2>;
    /// # Safety
    /// The processor has AVX-512 F and DQ.
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    unsafe fn avx512(&self, w: &Workspace<Eight<Avx512>>) -> Power<Avx512>;
}

impl<T: Book> PowerOnEight for T {
    fn plain(&self, w: &Workspace<Eight<Plain8>>) -> Power<Plain8> {
        Book::power(self, w, &w.pair, 0)
    }
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    #[allow(unsafe_code)]
    unsafe fn avx2(&self, w: &Workspace<Eight<Avx2>>) -> Power<Avx2> {
        Book::power(self, w, &w.pair, 0)
    }
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512dq")]
    #[allow(unsafe_code)]
    unsafe fn avx512(&self, w: &Workspace<Eight<Avx512>>) -> Power<Avx512> {
        Book::power(self, w, &w.pair, 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn things_lie_in_the_order_of_their_stages_whatever_comes_first() {
        use Stage::*;
        let order = [Clock, Phases, Shoulders, Party, Bends, Handles, Body];
        let mut staged = Staged::default();
        for (k, place) in [5, 0, 6, 2, 4, 1, 3, 6, 0, 5, 2].into_iter().enumerate() {
            staged.add(order[place], (place, k));
        }
        let of = |stage: Stage| staged.of(stage).to_vec();
        assert_eq!(of(Clock), [(0, 1), (0, 8)]);
        assert_eq!(of(Phases), [(1, 5)]);
        assert_eq!(of(Shoulders), [(2, 3), (2, 10)]);
        assert_eq!(of(Body), [(6, 2), (6, 7)]);
        let all: Vec<_> = staged.all().copied().collect();
        assert!(all.is_sorted(), "{all:?}");
        // A part is all its stages, one after the other, and so is what is made of it.
        let names = staged.map(|(place, _)| order[*place]);
        assert_eq!(
            names.with(Phases),
            [Clock, Clock, Phases, Shoulders, Shoulders]
        );
        assert_eq!(names.with(Body), [Handles, Handles, Body, Body]);
        assert_eq!(names.of(Handles), [Handles; 2]);
        assert!(Staged::<u8>::default().with(Clock).is_empty());
    }
}

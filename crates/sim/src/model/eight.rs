//! The right-hand side at eight moments side by side, for models all of whose parts are written for that.

use super::{Model, OnEight, Pair, Power, PowerOnEight, Stage, Workspace};
use crate::freedoms::FreedomsOnEight;
#[cfg(target_arch = "x86_64")]
use crate::lanes::{Avx2, Avx512};
use crate::lanes::{Eight, LANES, Moments, Number, Plain8, Two, Wide};

/// More pairs than this, at eight moments, do not fit into the first cache.
const MOST_PAIRS: usize = 8;

/// A kind of registers, and the code that was compiled for it.
pub trait Registers: Wide {
    /// Applies a term. Only code that runs behind a check of the processor's features may have numbers of this type.
    fn apply(term: &dyn OnEight, t_s: Self, w: &mut Workspace<Eight<Self>>);
    /// Places the handles.
    fn gaps(freedoms: &dyn FreedomsOnEight, y: &[Self], w: &mut Workspace<Eight<Self>>);
    /// Writes the rates of the body's states.
    fn rates(
        freedoms: &dyn FreedomsOnEight,
        y: &[Self],
        w: &Workspace<Eight<Self>>,
        dy: &mut [Self],
    );
    /// Asks an account.
    fn power(account: &dyn PowerOnEight, w: &Workspace<Eight<Self>>) -> Power<Self>;
}

macro_rules! registers {
    ($type:ident, $apply:ident, $gaps:ident, $rates:ident) => {
        // SAFETY: numbers of these types exist only where the processor has the features (see `Registers::apply`).
        #[allow(unsafe_code, unused_unsafe)]
        impl Registers for $type {
            #[inline(always)]
            fn apply(term: &dyn OnEight, t_s: Self, w: &mut Workspace<Eight<Self>>) {
                unsafe { term.$apply(t_s, w) }
            }
            #[inline(always)]
            fn gaps(freedoms: &dyn FreedomsOnEight, y: &[Self], w: &mut Workspace<Eight<Self>>) {
                unsafe { freedoms.$gaps(y, w) }
            }
            #[inline(always)]
            fn rates(
                freedoms: &dyn FreedomsOnEight,
                y: &[Self],
                w: &Workspace<Eight<Self>>,
                dy: &mut [Self],
            ) {
                unsafe { freedoms.$rates(y, w, dy) }
            }
            #[inline(always)]
            fn power(account: &dyn PowerOnEight, w: &Workspace<Eight<Self>>) -> Power<Self> {
                unsafe { account.$apply(w) }
            }
        }
    };
}
registers!(Plain8, plain, gaps_plain, rates_plain);
#[cfg(target_arch = "x86_64")]
registers!(Avx2, avx2, gaps_avx2, rates_avx2);
#[cfg(target_arch = "x86_64")]
registers!(Avx512, avx512, gaps_avx512, rates_avx512);

impl Model {
    /// Whether the right-hand side can be evaluated at eight moments side by side: few carriers, and every effect written for it.
    pub fn on_eight(&self) -> bool {
        let empty = |stage: Stage| self.terms[stage as usize].is_empty();
        super::pairs(self.carriers()) <= MOST_PAIRS
            && empty(Stage::Party)
            && empty(Stage::Bends)
            && self.terms.iter().flatten().all(|t| t.on_eight().is_some())
            && self.accounts.iter().all(|(_, a)| a.on_eight().is_some())
    }

    /// Whether the carriers go their way whatever the load does, so that their phases can be solved before it: only states of an effect's
    /// own can tell them.
    pub(crate) fn carriers_lead(&self) -> bool {
        self.layout.extra_range().is_empty()
    }

    #[inline(always)]
    fn apply_at_eight<E: Registers>(&self, stage: Stage, t_s: E, w: &mut Workspace<Eight<E>>) {
        for term in &self.terms[stage as usize] {
            E::apply(term.on_eight().expect("written for eight"), t_s, w);
        }
    }

    /// What depends on time alone, at eight moments.
    #[inline(always)]
    pub(crate) fn clock_at_eight<E: Registers>(&self, t_s: E, w: &mut Workspace<Eight<E>>) {
        self.apply_at_eight(Stage::Clock, t_s, w);
    }

    /// The rates of the phases at eight moments.
    #[inline(always)]
    pub(crate) fn phases_at_eight<E: Registers>(
        &self,
        t_s: E,
        y: &[E],
        dy: &mut [E],
        w: &mut Workspace<Eight<E>>,
    ) {
        let (phases, extra) = (self.layout.phase_range(), self.layout.extra_range());
        if !w.extra.is_empty() {
            w.extra.copy_from_slice(&y[extra]);
        }
        for (p, phase) in w.pair.iter_mut().zip(y[phases.clone()].chunks(LANES)) {
            let second = phase.get(1).copied().unwrap_or(E::splat(0.0));
            (p.sin, p.cos) = Two([phase[0], second]).sin_cos();
            p.rate = p.constant_rate;
        }
        self.apply_at_eight(Stage::Phases, t_s, w);
        for (p, rate) in w.pair.iter().zip(dy[phases].chunks_mut(LANES)) {
            for (lane, rate) in rate.iter_mut().enumerate() {
                *rate = Eight::of(p.rate, lane);
            }
        }
    }

    /// The shoulders at eight moments, where [`Self::phases_at_eight`] has just been called.
    #[inline(always)]
    pub(crate) fn shoulders_at_eight<E: Registers>(&self, t_s: E, w: &mut Workspace<Eight<E>>) {
        w.pair.iter_mut().for_each(Pair::stand);
        self.apply_at_eight(Stage::Shoulders, t_s, w);
    }

    /// The rates of body and extra states at eight moments, where the shoulders are known.
    #[inline(always)]
    pub(crate) fn load_at_eight<E: Registers>(
        &self,
        t_s: E,
        y: &[E],
        dy: &mut [E],
        w: &mut Workspace<Eight<E>>,
    ) {
        let freedoms = self.freedoms.on_eight();
        E::gaps(freedoms, y, w);
        self.apply_at_eight(Stage::Handles, t_s, w);
        w.body_torque = [E::splat(0.0); 3];
        self.apply_at_eight(Stage::Body, t_s, w);
        E::rates(freedoms, y, w, dy);
        if !w.extra.is_empty() {
            dy[self.layout.extra_range()].copy_from_slice(&w.extra_rate);
        }
    }

    /// The rates of the ledger where [`Self::load_at_eight`] has just been called.
    #[inline(always)]
    pub(crate) fn powers_at_eight<E: Registers>(&self, dy: &mut [E], w: &Workspace<Eight<E>>) {
        let ledger = self.layout.ledger_range();
        for ((_, account), out) in self.accounts.iter().zip(dy[ledger].chunks_exact_mut(2)) {
            let power = E::power(account.on_eight().expect("written for eight"), w);
            out.copy_from_slice(&[power.work_w, power.dissipated_w]);
        }
    }
}

//! The right-hand side at eight moments side by side, for models all of whose parts are written for that.

use super::{Model, Workspace};
use super::{OnEight, Power, PowerOnEight, Stage};
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

impl Registers for Plain8 {
    #[inline(always)]
    fn apply(term: &dyn OnEight, t_s: Self, w: &mut Workspace<Eight<Self>>) {
        term.plain(t_s, w);
    }
    #[inline(always)]
    fn gaps(freedoms: &dyn FreedomsOnEight, y: &[Self], w: &mut Workspace<Eight<Self>>) {
        freedoms.gaps_plain(y, w);
    }
    #[inline(always)]
    fn rates(
        freedoms: &dyn FreedomsOnEight,
        y: &[Self],
        w: &Workspace<Eight<Self>>,
        dy: &mut [Self],
    ) {
        freedoms.rates_plain(y, w, dy);
    }
    #[inline(always)]
    fn power(account: &dyn PowerOnEight, w: &Workspace<Eight<Self>>) -> Power<Self> {
        account.plain(w)
    }
}

// SAFETY: numbers of these types exist only where the processor has the features (see `Registers::apply`).
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
impl Registers for Avx2 {
    #[inline(always)]
    fn apply(term: &dyn OnEight, t_s: Self, w: &mut Workspace<Eight<Self>>) {
        unsafe { term.avx2(t_s, w) }
    }
    #[inline(always)]
    fn gaps(freedoms: &dyn FreedomsOnEight, y: &[Self], w: &mut Workspace<Eight<Self>>) {
        unsafe { freedoms.gaps_avx2(y, w) }
    }
    #[inline(always)]
    fn rates(
        freedoms: &dyn FreedomsOnEight,
        y: &[Self],
        w: &Workspace<Eight<Self>>,
        dy: &mut [Self],
    ) {
        unsafe { freedoms.rates_avx2(y, w, dy) }
    }
    #[inline(always)]
    fn power(account: &dyn PowerOnEight, w: &Workspace<Eight<Self>>) -> Power<Self> {
        unsafe { account.avx2(w) }
    }
}

// SAFETY: as above.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
impl Registers for Avx512 {
    #[inline(always)]
    fn apply(term: &dyn OnEight, t_s: Self, w: &mut Workspace<Eight<Self>>) {
        unsafe { term.avx512(t_s, w) }
    }
    #[inline(always)]
    fn gaps(freedoms: &dyn FreedomsOnEight, y: &[Self], w: &mut Workspace<Eight<Self>>) {
        unsafe { freedoms.gaps_avx512(y, w) }
    }
    #[inline(always)]
    fn rates(
        freedoms: &dyn FreedomsOnEight,
        y: &[Self],
        w: &Workspace<Eight<Self>>,
        dy: &mut [Self],
    ) {
        unsafe { freedoms.rates_avx512(y, w, dy) }
    }
    #[inline(always)]
    fn power(account: &dyn PowerOnEight, w: &Workspace<Eight<Self>>) -> Power<Self> {
        unsafe { account.avx512(w) }
    }
}

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

    /// The rates of everything but the ledger at eight moments.
    ///
    /// # Panics
    /// When the model is not for eight moments at once ([`Self::on_eight`]).
    #[inline(always)]
    pub(crate) fn motion_at_eight<E: Registers>(
        &self,
        t_s: E,
        y: &[E],
        dy: &mut [E],
        w: &mut Workspace<Eight<E>>,
    ) {
        let freedoms = self.freedoms.on_eight();
        let (phases, extra) = (self.layout.phase_range(), self.layout.extra_range());
        let apply = |stage: Stage, w: &mut Workspace<Eight<E>>| {
            for term in &self.terms[stage as usize] {
                E::apply(term.on_eight().expect("written for eight"), t_s, w);
            }
        };
        if !w.extra.is_empty() {
            w.extra.copy_from_slice(&y[extra.clone()]);
        }
        if self.has_phases {
            for (p, phase) in w.pair.iter_mut().zip(y[phases.clone()].chunks(LANES)) {
                let second = phase.get(1).copied().unwrap_or(E::splat(0.0));
                (p.sin, p.cos) = Two([phase[0], second]).sin_cos();
                p.rate = p.constant_rate;
                p.stand();
            }
            apply(Stage::Phases, w);
            apply(Stage::Shoulders, w);
        }
        E::gaps(freedoms, y, w);
        apply(Stage::Handles, w);
        w.body_torque = [E::splat(0.0); 3];
        apply(Stage::Body, w);
        E::rates(freedoms, y, w, dy);
        for (p, rate) in w.pair.iter().zip(dy[phases].chunks_mut(LANES)) {
            for (lane, rate) in rate.iter_mut().enumerate() {
                *rate = Eight::of(p.rate, lane);
            }
        }
        if !w.extra.is_empty() {
            dy[extra].copy_from_slice(&w.extra_rate);
        }
    }

    /// The rates of the ledger where [`Self::motion_at_eight`] has just been called.
    #[inline(always)]
    pub(crate) fn powers_at_eight<E: Registers>(&self, dy: &mut [E], w: &Workspace<Eight<E>>) {
        let ledger = self.layout.ledger_range();
        for ((_, account), out) in self.accounts.iter().zip(dy[ledger].chunks_exact_mut(2)) {
            let power = E::power(account.on_eight().expect("written for eight"), w);
            out.copy_from_slice(&[power.work_w, power.dissipated_w]);
        }
    }
}

//! The right-hand side at eight moments side by side.

use super::term::Staged;
use super::{Layout, Model, OnEight, Pair, Power, PowerOnEight, Stage, Workspace};
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
    /// Says where the body is and how it moves.
    fn orient(freedoms: &dyn FreedomsOnEight, y: &[Self], w: &mut Workspace<Eight<Self>>);
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
    ($type:ident, $apply:ident, $gaps:ident, $orient:ident, $rates:ident) => {
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
            fn orient(freedoms: &dyn FreedomsOnEight, y: &[Self], w: &mut Workspace<Eight<Self>>) {
                unsafe { freedoms.$orient(y, w) }
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
registers!(Plain8, plain, gaps_plain, orient_plain, rates_plain);
#[cfg(target_arch = "x86_64")]
registers!(Avx2, avx2, gaps_avx2, orient_avx2, rates_avx2);
#[cfg(target_arch = "x86_64")]
registers!(Avx512, avx512, gaps_avx512, orient_avx512, rates_avx512);

impl Model {
    /// Whether the right-hand side can be evaluated at eight moments side by side: few carriers, and nothing that moves them after their phases
    /// or bends what they hold.
    pub fn on_eight(&self) -> bool {
        let empty = |stage: Stage| self.terms.of(stage).is_empty();
        super::pairs(self.carriers()) <= MOST_PAIRS && empty(Stage::Party) && empty(Stage::Bends)
    }

    /// Whether the carriers go their way whatever the load does, so that their phases can be solved before it: only states of an effect's
    /// own can tell them.
    pub(crate) fn carriers_lead(&self) -> bool {
        self.layout.extra_range().is_empty()
    }

    /// The right-hand side for eight moments, where [`Self::on_eight`] says yes.
    pub(crate) fn side_by_side(&self) -> SideBySide<'_> {
        SideBySide {
            layout: &self.layout,
            freedoms: &*self.freedoms,
            look: (self.looks_at_body).then(|| self.body.gravity_m_per_s2.into()),
            terms: self.terms.map(|t| t.on_eight()),
            accounts: self.accounts.iter().map(|(_, a)| a.on_eight()).collect(),
        }
    }
}

/// What a model does at eight moments side by side.
pub(crate) struct SideBySide<'m> {
    pub layout: &'m Layout,
    freedoms: &'m dyn FreedomsOnEight,
    /// Gravity, m/s², where an effect looks at the body.
    look: Option<[f64; 3]>,
    terms: Staged<&'m dyn OnEight>,
    accounts: Vec<&'m dyn PowerOnEight>,
}

/// Eight moments, the states there, where their rates go, and the numbers of the evaluation.
///
/// Several are evaluated term by term: while the processor waits for one it does the other.
pub(crate) struct Octet<'a, E: Registers> {
    pub t_s: E,
    pub y: &'a [E],
    pub dy: &'a mut [E],
    pub w: &'a mut Workspace<Eight<E>>,
}

impl SideBySide<'_> {
    #[inline(always)]
    fn apply<E: Registers>(terms: &[&dyn OnEight], octets: &mut [Octet<'_, E>]) {
        for term in terms {
            for at in octets.iter_mut() {
                E::apply(*term, at.t_s, at.w);
            }
        }
    }

    /// What depends on time alone.
    #[inline(always)]
    pub fn clock<E: Registers>(&self, t_s: E, w: &mut Workspace<Eight<E>>) {
        for term in self.terms.of(Stage::Clock) {
            E::apply(*term, t_s, w);
        }
    }

    /// The rates of the phases.
    #[inline(always)]
    pub fn phases<E: Registers>(&self, octets: &mut [Octet<'_, E>]) {
        let (phases, extra) = (self.layout.phase_range(), self.layout.extra_range());
        for at in octets.iter_mut() {
            if !at.w.extra.is_empty() {
                at.w.extra.copy_from_slice(&at.y[extra.clone()]);
            }
            let states = at.y[phases.clone()].chunks(LANES);
            for (p, phase) in at.w.pair.iter_mut().zip(states) {
                let second = phase.get(1).copied().unwrap_or(E::splat(0.0));
                (p.sin, p.cos) = Two([phase[0], second]).sin_cos();
                p.rate = p.constant_rate;
            }
        }
        Self::apply(self.terms.of(Stage::Phases), octets);
        for at in octets.iter_mut() {
            let rates = at.dy[phases.clone()].chunks_mut(LANES);
            for (p, rate) in at.w.pair.iter().zip(rates) {
                for (lane, rate) in rate.iter_mut().enumerate() {
                    *rate = Eight::of(p.rate, lane);
                }
            }
        }
    }

    /// The shoulders, where [`Self::phases`] has just been called.
    #[inline(always)]
    pub fn shoulders<E: Registers>(&self, octets: &mut [Octet<'_, E>]) {
        for at in octets.iter_mut() {
            at.w.pair.iter_mut().for_each(Pair::stand);
        }
        Self::apply(self.terms.of(Stage::Shoulders), octets);
    }

    /// The rates of body and extra states, where the shoulders are known.
    #[inline(always)]
    pub fn load<E: Registers>(&self, octets: &mut [Octet<'_, E>]) {
        for at in octets.iter_mut() {
            E::gaps(self.freedoms, at.y, at.w);
            if let Some(gravity) = self.look {
                E::orient(self.freedoms, at.y, at.w);
                at.w.t_s = at.t_s;
                at.w.free_fall = gravity.map(E::splat);
            }
            at.w.body_torque = [E::splat(0.0); 3];
        }
        Self::apply(self.terms.with(Stage::Handles), octets);
        for at in octets.iter_mut() {
            E::rates(self.freedoms, at.y, at.w, at.dy);
            if !at.w.extra.is_empty() {
                at.dy[self.layout.extra_range()].copy_from_slice(&at.w.extra_rate);
            }
        }
    }

    /// The rates of the ledger where [`Self::load`] has just been called.
    #[inline(always)]
    pub fn powers<E: Registers>(&self, dy: &mut [E], w: &Workspace<Eight<E>>) {
        let ledger = self.layout.ledger_range();
        for (account, out) in self.accounts.iter().zip(dy[ledger].chunks_exact_mut(2)) {
            let power = E::power(*account, w);
            out.copy_from_slice(&[power.work_w, power.dissipated_w]);
        }
    }
}

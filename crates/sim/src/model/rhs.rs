//! One evaluation of the right-hand side, stage by stage.

use super::Model;
use super::term::{Account, Power, Stage, Term};
use super::workspace::{Block, Pair, Workspace, blocks};
use crate::lanes::{self, f64x2};
#[cfg(target_arch = "x86_64")]
use crate::lanes::{FusedPair, Number};

impl Model {
    /// Begins a segment at `t_s`: noise, music and contacts take the values they have just after it.
    pub fn begin_segment(&self, t_s: f64, w: &mut Workspace) {
        w.segment_s = t_s;
        for (i, rate) in self.natural_rad_per_s.iter().enumerate() {
            *w.of_mut(i, |p| &mut p.constant_rate) = *rate;
        }
        for switch in &self.switches {
            switch.begin(t_s, w);
        }
    }

    /// The right-hand side: dy = f(t, y).
    #[inline]
    pub fn rhs(&self, t_s: f64, y: &[f64], dy: &mut [f64], w: &mut Workspace) {
        self.rhs_of_motion(t_s, y, dy, w);
        self.powers(dy, w);
    }

    /// The same without the ledger, whose rates in `dy` stay as they were; nothing but the ledger feels it.
    #[inline]
    pub fn rhs_of_motion(&self, t_s: f64, y: &[f64], dy: &mut [f64], w: &mut Workspace) {
        if self.carried {
            #[cfg(target_arch = "x86_64")]
            if self.fused {
                // SAFETY: the processor was asked.
                #[allow(unsafe_code)]
                return unsafe { self.rhs_fused(t_s, y, dy, w) };
            }
            self.forces_by::<false>(t_s, y, w);
            return self.motion_by::<false>(y, dy, w);
        }
        // Nothing acts on the handles: nobody asks where they are until a sample does.
        let pairs = std::mem::take(&mut w.pair);
        self.forces(t_s, y, w);
        self.motion(y, dy, w);
        w.pair = pairs;
    }

    /// Whether the right-hand side leaves the handles in the workspace where its state has them, as [`Self::forces`] always does.
    pub fn places_handles(&self) -> bool {
        self.carried
    }

    /// The right-hand side where [`Self::forces`] has just been called.
    pub fn rates(&self, y: &[f64], dy: &mut [f64], w: &mut Workspace) {
        self.motion(y, dy, w);
        self.powers(dy, w);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn rhs_fused(&self, t_s: f64, y: &[f64], dy: &mut [f64], w: &mut Workspace) {
        self.forces_by::<true>(t_s, y, w);
        self.motion_by::<true>(y, dy, w);
    }

    #[inline]
    fn motion(&self, y: &[f64], dy: &mut [f64], w: &mut Workspace) {
        #[cfg(target_arch = "x86_64")]
        if self.fused {
            // SAFETY: the processor was asked.
            #[allow(unsafe_code)]
            return unsafe { self.motion_fused(y, dy, w) };
        }
        self.motion_by::<false>(y, dy, w);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn motion_fused(&self, y: &[f64], dy: &mut [f64], w: &mut Workspace) {
        self.motion_by::<true>(y, dy, w);
    }

    #[inline(always)]
    fn motion_by<const FUSED: bool>(&self, y: &[f64], dy: &mut [f64], w: &mut Workspace) {
        self.accelerate::<FUSED>(y, w, dy);
        let phases = self.layout.phase_range();
        lanes::store(w.pair.iter().map(|p| p.rate), &mut dy[phases]);
        if !w.extra.is_empty() {
            dy[self.layout.extra_range()].copy_from_slice(&w.extra_rate);
        }
    }

    #[inline(always)]
    fn accelerate<const FUSED: bool>(&self, y: &[f64], w: &mut Workspace, dy: &mut [f64]) {
        #[cfg(target_arch = "x86_64")]
        if FUSED {
            // SAFETY: where this is true the processor was asked.
            #[allow(unsafe_code)]
            return unsafe { self.freedoms.accelerate_fused(y, w, dy) };
        }
        self.freedoms.accelerate(y, w, dy);
    }

    #[inline(always)]
    fn powers(&self, dy: &mut [f64], w: &Workspace) {
        if self.in_blocks {
            return self.powers_in_blocks(dy, w);
        }
        let out = dy[self.layout.ledger_range()].chunks_exact_mut(2);
        for ((_, account), out) in self.accounts.iter().zip(out) {
            let power = self.power(&**account, w, &w.pair, 0);
            out.copy_from_slice(&[power.work_w, power.dissipated_w]);
        }
    }

    #[inline(always)]
    fn power(&self, account: &dyn Account, w: &Workspace, pairs: &[Pair], first: usize) -> Power {
        #[cfg(target_arch = "x86_64")]
        if self.fused {
            // SAFETY: the processor was asked.
            #[allow(unsafe_code)]
            return unsafe { account.power_fused(w, pairs, first) };
        }
        account.power(w, pairs, first)
    }

    #[cold]
    fn powers_in_blocks(&self, dy: &mut [f64], w: &Workspace) {
        let ledger = &mut dy[self.layout.ledger_range()];
        ledger.fill(0.0);
        for block in blocks(w.pair.len()) {
            let pairs = &w.pair[block.clone()];
            for ((_, account), out) in self.accounts.iter().zip(ledger.chunks_exact_mut(2)) {
                let power = self.power(&**account, w, pairs, block.start);
                out[0] += power.work_w;
                out[1] += power.dissipated_w;
            }
        }
    }

    /// Everything up to the forces; what the accelerations need.
    #[inline]
    pub fn forces(&self, t_s: f64, y: &[f64], w: &mut Workspace) {
        #[cfg(target_arch = "x86_64")]
        if self.fused {
            // SAFETY: the processor was asked.
            #[allow(unsafe_code)]
            return unsafe { self.forces_fused(t_s, y, w) };
        }
        self.forces_by::<false>(t_s, y, w);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn forces_fused(&self, t_s: f64, y: &[f64], w: &mut Workspace) {
        self.forces_by::<true>(t_s, y, w);
    }

    #[inline(always)]
    fn forces_by<const FUSED: bool>(&self, t_s: f64, y: &[f64], w: &mut Workspace) {
        // Even a copy of nothing would be a call.
        if !w.extra.is_empty() {
            w.extra.copy_from_slice(&y[self.layout.extra_range()]);
        }
        if self.has_phases {
            self.phases::<FUSED>(t_s, y, w);
        }
        w.body_torque = [0.0; 3];
        if self.in_blocks {
            self.handles_in_blocks::<FUSED>(t_s, y, w);
        } else {
            self.handles::<FUSED>(t_s, y, w);
        }
    }

    #[inline(always)]
    fn apply<const FUSED: bool>(terms: &[Box<dyn Term>], t_s: f64, w: &mut Workspace) {
        for term in terms {
            #[cfg(target_arch = "x86_64")]
            if FUSED {
                // SAFETY: where this is true the processor was asked.
                #[allow(unsafe_code)]
                unsafe {
                    term.apply_fused(t_s, w);
                }
                continue;
            }
            term.apply(t_s, w);
        }
    }

    /// Handles, the forces there, and what else turns the body, where the shoulders are known.
    #[inline(always)]
    fn handles<const FUSED: bool>(&self, t_s: f64, y: &[f64], w: &mut Workspace) {
        if !self.terms.with(Stage::Party).is_empty() {
            self.party(t_s, w);
        }
        self.place::<FUSED>(y, w);
        if self.looks_at_body {
            self.look(t_s, y, w);
        }
        Self::apply::<FUSED>(self.terms.with(Stage::Handles), t_s, w);
    }

    /// What few effects ask for.
    #[cold]
    fn look(&self, t_s: f64, y: &[f64], w: &mut Workspace) {
        self.freedoms.orient(y, w);
        w.t_s = t_s;
        w.free_fall = self.body.gravity_m_per_s2.into();
        for term in self.terms.with(Stage::Bends) {
            term.apply(t_s, w);
        }
    }

    #[inline(always)]
    fn place<const FUSED: bool>(&self, y: &[f64], w: &mut Workspace) {
        #[cfg(target_arch = "x86_64")]
        if FUSED {
            // SAFETY: where this is true the processor was asked.
            #[allow(unsafe_code)]
            return unsafe { self.freedoms.gaps_fused(y, w) };
        }
        self.freedoms.gaps(y, w);
    }

    /// The same, with everything about a block done before it leaves the first cache.
    #[cold]
    fn handles_in_blocks<const FUSED: bool>(&self, t_s: f64, y: &[f64], w: &mut Workspace) {
        for block in blocks(w.pair.len()) {
            if self.has_phases {
                w.pair[block.clone()].iter_mut().for_each(Pair::stand);
                self.apply_to::<FUSED>(Stage::Shoulders, t_s, w, &block);
            }
            self.place_block::<FUSED>(y, w, &block);
            self.apply_to::<FUSED>(Stage::Handles, t_s, w, &block);
        }
        Self::apply::<FUSED>(self.terms.of(Stage::Body), t_s, w);
    }

    #[inline(always)]
    fn apply_to<const FUSED: bool>(
        &self,
        stage: Stage,
        t_s: f64,
        w: &mut Workspace,
        block: &Block,
    ) {
        let terms = self.terms.of(stage).iter();
        for term in terms.filter_map(|term| term.on_block()) {
            #[cfg(target_arch = "x86_64")]
            if FUSED {
                // SAFETY: where this is true the processor was asked.
                #[allow(unsafe_code)]
                unsafe {
                    term.apply_to_fused(t_s, w, block.clone());
                }
                continue;
            }
            term.apply_to(t_s, w, block.clone());
        }
    }

    #[inline(always)]
    fn place_block<const FUSED: bool>(&self, y: &[f64], w: &mut Workspace, block: &Block) {
        #[cfg(target_arch = "x86_64")]
        if FUSED {
            // SAFETY: where this is true the processor was asked.
            #[allow(unsafe_code)]
            return unsafe { self.freedoms.gaps_of_fused(y, w, block.clone()) };
        }
        self.freedoms.gaps_of(y, w, block.clone());
    }

    #[inline(always)]
    fn phases<const FUSED: bool>(&self, t_s: f64, y: &[f64], w: &mut Workspace) {
        for (pair, phase) in w
            .pair
            .iter_mut()
            .zip(lanes::load(&y[self.layout.phase_range()]))
        {
            (pair.sin, pair.cos) = sin_cos::<FUSED>(phase);
            pair.rate = pair.constant_rate;
            // Blocks do it when they are at hand.
            if !self.in_blocks {
                pair.stand();
            }
        }
        if self.in_blocks {
            // The shoulders are moved block by block.
            Self::apply::<FUSED>(self.terms.of(Stage::Clock), t_s, w);
            Self::apply::<FUSED>(self.terms.of(Stage::Phases), t_s, w);
        } else {
            Self::apply::<FUSED>(self.terms.with(Stage::Shoulders), t_s, w);
        }
    }

    #[cold]
    fn party(&self, t_s: f64, w: &mut Workspace) {
        if !self.has_phases {
            w.pair.iter_mut().for_each(Pair::stand);
        }
        for term in self.terms.of(Stage::Party) {
            term.apply(t_s, w);
        }
    }

    /// Applies the terms of one effect alone to an evaluated workspace, stage by stage.
    pub fn apply_only(&self, effect: &str, t_s: f64, w: &mut Workspace) {
        for (term, owner) in self.terms.all().zip(self.owners.all()) {
            if *owner == effect {
                term.apply(t_s, w);
            }
        }
    }

    /// Energy in the springs at the evaluated state, J.
    pub fn stored_j(&self, w: &Workspace) -> f64 {
        self.accounts.iter().map(|(_, a)| a.stored_j(w)).sum()
    }

    /// [`Account::lent_j`] of every account.
    pub(crate) fn lent_j<'a>(&'a self, w: &'a Workspace) -> impl Iterator<Item = f64> + 'a {
        self.accounts.iter().map(|(_, a)| a.lent_j(w))
    }
}

/// [`lanes::sin_cos`], in code compiled for fused arithmetic or not.
#[inline(always)]
fn sin_cos<const FUSED: bool>(x: f64x2) -> (f64x2, f64x2) {
    #[cfg(target_arch = "x86_64")]
    if FUSED {
        let (sin, cos) = FusedPair(x).sin_cos();
        return (sin.0, cos.0);
    }
    lanes::sin_cos(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::parse;

    /// The same numbers with one rounding instead of two, ledger included: every built-in scene, at a state with everything in motion.
    #[test]
    fn fused_arithmetic_gives_the_same_but_for_rounding() {
        for (name, text) in crate::scene::BUILTIN {
            let scene = parse(name, text, &[]).unwrap_or_else(|e| panic!("{e}"));
            let mut model = Model::new(&scene);
            let mut y = model.initial_state();
            let body = model.layout().body;
            for (k, y) in y[..body].iter_mut().enumerate() {
                *y += 0.01 * (1.0 + k as f64).sin();
            }
            model.freedoms().project(&mut y);
            let rates = |model: &Model| {
                let (mut dy, mut w) = (vec![f64::NAN; y.len()], model.workspace());
                model.begin_segment(7.0, &mut w);
                model.rhs(7.01, &y, &mut dy, &mut w);
                dy
            };
            let fused = rates(&model);
            model.fused = false;
            let plain = rates(&model);
            let largest = plain.iter().fold(0.0f64, |a, b| a.max(b.abs()));
            for (k, (a, b)) in fused.iter().zip(&plain).enumerate() {
                let apart = (a - b).abs() / (1.0 + largest);
                assert!(apart < 1e-14, "{name} {k}: {a} {b}"); // measured 1.9e-16
            }
        }
    }

    #[test]
    fn blocks_give_what_all_pairs_at_once_give() {
        let springs = "[effects.contact]\n[effects.hold]\n[effects.friction]";
        let bristles =
            "[effects.contact]\nlaw = \"hunt-crossley\"\n[effects.friction]\nlaw = \"bristle\"";
        let straps = "[effects.contact]\n[effects.sling]\ndamping_s = 0.1\n[effects.pole_friction]";
        for freedom in [
            "[\"height\", \"roll\"]",
            "[\"height\", \"roll\", \"yaw\"]",
            "[\"height\", \"roll\", \"tilt\", \"yaw\"]",
            "[\"x\", \"y\", \"height\", \"roll\", \"tilt\", \"yaw\"]",
        ] {
            for forces in [springs, bristles, straps] {
                let text = format!(
                    r#"
                    name = "crowd"
                    duration_s = 60.0
                    freedom = {freedom}
                    [body]
                    mass_kg = 4500.0
                    inertia_kg_m2 = {{ xx = 300.0, yy = 9000.0, zz = 9300.0 }}
                    [start]
                    roll_pitch_yaw_deg = [3.0, 2.0, 1.0]
                    [carriers]
                    initial_phase_sd_rad = 1.0
                    [carriers.along_poles]
                    count = 151
                    {forces}
                    [effects.gait]
                    [[effects.gait.harmonics]]
                    order = 2
                    amplitude_m = [0.0, 0.01, 0.02]
                    [effects.lift]
                    build_up_s = 5.0
                    [effects.coupling]
                    [effects.music]
                    "#
                );
                let mut scene = parse("crowd", &text, &[]).unwrap_or_else(|e| panic!("{e}"));
                scene.start.angular_velocity_rad_per_s = [0.3, 0.2, 0.1];
                scene.keep_to_freedoms();
                let mut model = Model::new(&scene);
                assert!(model.in_blocks, "{freedom} {forces}");
                let y = model.initial_state();
                let rates = |model: &Model| {
                    let (mut dy, mut w) = (vec![f64::NAN; y.len()], model.workspace());
                    model.begin_segment(30.0, &mut w);
                    model.rhs(31.0, &y, &mut dy, &mut w);
                    dy
                };
                // By fused arithmetic, where the processor has it, and without.
                let kinds = [model.fused, false];
                let ledger = model.layout().ledger_range();
                for fused in kinds {
                    model.fused = fused;
                    let [blocks, at_once] = [true, false].map(|in_blocks| {
                        model.in_blocks = in_blocks;
                        rates(&model)
                    });
                    for (k, (a, b)) in blocks.iter().zip(at_once).enumerate() {
                        // Only sums of the ledger come in another order.
                        let same = if ledger.contains(&k) {
                            (a - b).abs() <= 1e-12 * (1e3 + b.abs())
                        } else {
                            a.to_bits() == b.to_bits()
                        };
                        assert!(same, "{freedom} {forces} {fused} {k}: {a} {b}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_body_that_nobody_carries_turns_as_ever_however_many_its_handles() {
        let rates = |count: usize| {
            let text = format!(
                r#"
                name = "thrown"
                duration_s = 1.0
                [body]
                mass_kg = 60.0
                inertia_kg_m2 = {{ xx = 3.0, yy = 9.0, zz = 10.0 }}
                [start]
                height_m = 1.0
                angular_velocity_rad_per_s = [0.3, 0.2, 0.1]
                [carriers.along_poles]
                count = {count}
                "#
            );
            let scene = parse("thrown", &text, &[]).unwrap_or_else(|e| panic!("{e}"));
            let model = Model::new(&scene);
            let y = model.initial_state();
            let (mut dy, mut w) = (vec![f64::NAN; y.len()], model.workspace());
            model.begin_segment(0.0, &mut w);
            model.rhs(0.0, &y, &mut dy, &mut w);
            dy
        };
        let few = rates(2);
        assert!(few[10] != 0.0);
        assert_eq!(few, rates(200));
    }
}

//! Scene → [`Model`]: only the effects asked for, the state they need, and their right-hand side.
//!
//! A model is constant; what changes is the state `y` and a [`Workspace`]. One evaluation runs through stages, each a list
//! of the terms that the effects added:
//!
//! ```text
//! phases ─► phase rates ─► shoulders b, ḃ ─► gaps d = b − s, ḋ ─► forces N, T ─► torque on the body ─► accelerations
//! ```
//!
//! Between events the right-hand side is smooth: whether a handle is in contact, which noise cell it is and whether the
//! music has begun are fixed for a *segment* and change only between two of them.

mod eight;
mod heading;
mod rest;
mod sideways;
mod slopes;
mod term;
mod workspace;

pub use eight::Registers;
pub(crate) use eight::{Octet, SideBySide};
pub use heading::Heading;
pub(crate) use rest::Bend;
pub(crate) use sideways::Sideways;
pub(crate) use slopes::Differentiator;
pub use term::{
    Account, AsWhole, Book, Local, OnBlock, OnEight, Power, PowerOnEight, Stage, Switch, Term,
    Whole,
};
pub use workspace::{All, Block, Pair, Part, Workspace};

use crate::beat::Beat;
use crate::body::Body;
use crate::effects;
use crate::freedoms::{Freedoms, Six, choose};
use crate::lanes::{self, f64x2, pack, pairs};
#[cfg(target_arch = "x86_64")]
use crate::lanes::{FusedPair, Number};
use crate::random::{Stream, normal};
use crate::scene::Scene;
use crate::sensors::drum::Track;
use crate::sensors::{Clock, Imu};
use rest::Springs;
use std::ops::Range;
use term::Staged;
use workspace::{BLOCK, blocks};

/// Where things are in the state vector.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Coordinates and velocities of the body come first.
    pub body: usize,
    /// Then the phases.
    pub phases: usize,
    /// Then the effects' own states.
    pub extra: usize,
    /// Then work and dissipation of each account.
    pub ledger: usize,
}

impl Layout {
    /// Length of the state vector.
    pub fn size(&self) -> usize {
        self.body + self.phases + self.extra + self.ledger
    }

    /// Where the phases are.
    pub fn phase_range(&self) -> Range<usize> {
        self.body..self.body + self.phases
    }

    /// Where the effects' own states are.
    pub fn extra_range(&self) -> Range<usize> {
        let first = self.body + self.phases;
        first..first + self.extra
    }

    /// Where the ledger is.
    pub fn ledger_range(&self) -> Range<usize> {
        self.extra_range().end..self.size()
    }
}

/// The unit of a coordinate of the body, m or rad.
const COORDINATE: f64 = 0.1;
/// So much of an acceleration, m/s² or rad/s², one unit of a velocity may make where it is more than its scale.
const LOOSEST: f64 = 2400.0;

/// The equations of one scene.
pub struct Model {
    /// The scene it was made from.
    pub scene: Scene,
    /// Mass properties.
    pub body: Body,
    freedoms: Box<dyn Freedoms>,
    layout: Layout,
    natural_rad_per_s: Vec<f64>,
    initial_phases: Vec<f64>,
    has_phases: bool,
    /// Whether anything looks at the carriers or acts on the handles.
    carried: bool,
    terms: Staged<Box<dyn Term>>,
    /// Whose each term is, in the same order.
    owners: Staged<&'static str>,
    building: &'static str,
    /// Names and first values of the effects' own states.
    extra: Vec<(String, f64)>,
    switches: Vec<Box<dyn Switch>>,
    accounts: Vec<(&'static str, Box<dyn Account>)>,
    beat: Option<Beat>,
    heading: Option<Heading>,
    bends: Vec<Bend>,
    /// Where the body starts, m.
    start_height_m: f64,
    contact_stiffness: Vec<f64>,
    contact_exponent: f64,
    contact_damping: Vec<f64x2>,
    /// N·s/m of every carrier's hold and straps, sideways, under an equal share of the load.
    side_damping: Vec<f64x2>,
    /// Damping and stiffness of every carrier's hold, both ways.
    sideways: [Vec<f64x2>; 2],
    /// The same of the straps, per newton of load: τ/L (s/m), 1/L (1/m).
    straps: [f64; 2],
    watches_contact: bool,
    has_friction: bool,
    jumps_at_contact: bool,
    turns_softly: Option<f64>,
    /// Whether there are so many carriers that they are treated block by block.
    in_blocks: bool,
    /// Whether the processor has AVX2 and FMA, and the carriers are not in blocks.
    fused: bool,
    sensor_clocks: Vec<Clock>,
    imus: Vec<Imu>,
    track: Option<Track>,
}

impl Model {
    /// Builds the equations of a checked scene.
    ///
    /// # Panics
    /// When the scene does not pass [`crate::scene::check`].
    pub fn new(scene: &Scene) -> Self {
        let body = Body::new(&scene.body).expect("a checked scene has a possible inertia");
        let n = scene.carriers.count();
        let freedoms = Box::new(Six::new(&body, &scene.carriers.handles_m));
        let mut model = Self {
            scene: scene.clone(),
            layout: Layout {
                body: freedoms.size(),
                phases: 0,
                extra: 0,
                ledger: 0,
            },
            freedoms,
            body,
            natural_rad_per_s: (0..n)
                .map(|i| std::f64::consts::TAU * scene.carriers.frequency_hz.get(i))
                .collect(),
            initial_phases: (0..n)
                .map(|i| {
                    let spread = match scene.carriers.initial_phase_sd_rad {
                        0.0 => 0.0,
                        sd => sd * normal(scene.seed, Stream::InitialPhase, i, 0),
                    };
                    scene.carriers.initial_phase_rad.get(i) + spread
                })
                .collect(),
            has_phases: false,
            carried: true,
            terms: Default::default(),
            owners: Default::default(),
            building: "",
            switches: Vec::new(),
            accounts: Vec::new(),
            beat: None,
            heading: None,
            bends: Vec::new(),
            start_height_m: 0.0,
            contact_stiffness: Vec::new(),
            contact_exponent: 1.0,
            contact_damping: Vec::new(),
            side_damping: Vec::new(),
            sideways: Default::default(),
            straps: [0.0; 2],
            extra: Vec::new(),
            watches_contact: false,
            has_friction: false,
            jumps_at_contact: false,
            turns_softly: None,
            in_blocks: false,
            fused: false,
            sensor_clocks: Vec::new(),
            imus: Vec::new(),
            track: None,
        };
        for effect in effects::TABLE {
            model.building = effect.name;
            (effect.build)(scene, &mut model);
        }
        let share_n = model.body.mass_kg * model.body.gravity_m_per_s2.norm() / n.max(1) as f64;
        let [hold, _] = &model.sideways;
        let held = |p: usize| hold.get(p).copied().unwrap_or(f64x2::ZERO);
        model.side_damping = (0..pairs(n))
            .map(|p| held(p) + f64x2::splat(model.straps[0] * share_n))
            .collect();
        if !scene.solver.energy {
            model.accounts.clear();
        }
        // Only now, when every effect has said what it does to gravity and to the springs that the body rests on.
        model.start_height_m = scene.start.height_m.unwrap_or_else(|| model.come_to_rest());
        model.freedoms = choose(
            &model.body,
            &scene.carriers.handles_m,
            &scene.freedom,
            &scene.start,
            model.start_height_m,
        );
        model.layout.body = model.freedoms.size();
        model.layout.phases = if model.has_phases { n } else { 0 };
        model.layout.extra = model.extra.len();
        model.layout.ledger = 2 * model.accounts.len();
        model.carried =
            model.has_phases || !model.accounts.is_empty() || model.terms.all().next().is_some();
        // What bends a pole or moves the party is not the affair of one pair.
        let stage = |stage: Stage| model.terms.of(stage).iter();
        model.in_blocks = model.carried
            && pairs(n) > BLOCK
            && stage(Stage::Party).chain(stage(Stage::Bends)).count() == 0
            && stage(Stage::Shoulders)
                .chain(stage(Stage::Handles))
                .all(|term| term.on_block().is_some());
        #[cfg(target_arch = "x86_64")]
        {
            model.fused = !model.in_blocks
                && is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("fma");
        }
        model
    }

    /// Bends the poles as they are bent at rest, and gives the height at which the level body rests, m.
    fn come_to_rest(&mut self) -> f64 {
        let carriers = &self.scene.carriers;
        let level = |i: usize| carriers.shoulder_height_m.get(i) - carriers.handles_m[i][2];
        let springs = Springs {
            level_m: (0..self.carriers()).map(level).collect(),
            stiffness: &self.contact_stiffness,
            exponent: self.contact_exponent,
            pull: self.contact_pulls(),
            weight_n: -self.body.mass_kg * self.body.gravity_m_per_s2.z,
            bends: &self.bends,
        };
        let (height_m, bent_m) = springs.rest();
        for (bend, bent_m) in self.bends.iter().zip(bent_m) {
            self.extra[bend.state].1 = bent_m;
        }
        height_m
    }

    // What effects call while they are built.

    /// Adds a term to a stage.
    pub(crate) fn add(&mut self, stage: Stage, term: impl Term + 'static) {
        self.owners.add(stage, self.building);
        self.terms.add(stage, Box::new(term));
    }

    /// Adds states of an effect's own, by name and first value; returns the place of the first in [`Workspace::extra`].
    pub(crate) fn add_states(&mut self, states: impl IntoIterator<Item = (String, f64)>) -> usize {
        let first = self.extra.len();
        self.extra.extend(states);
        first
    }

    /// Gives gravity another direction, m/s².
    pub(crate) fn lean(&mut self, gravity_m_per_s2: [f64; 3]) {
        self.body.gravity_m_per_s2 = gravity_m_per_s2.into();
    }

    /// Adds moments at which the right-hand side may jump.
    pub(crate) fn add_switch(&mut self, switch: impl Switch + 'static) {
        self.switches.push(Box::new(switch));
    }

    /// Opens a page in the energy ledger.
    pub(crate) fn add_account(&mut self, name: &'static str, account: impl Account + 'static) {
        self.accounts.push((name, Box::new(account)));
    }

    /// Asks for phases in the state.
    pub(crate) fn need_phases(&mut self) {
        self.has_phases = true;
    }

    /// Gives the phases other first values, rad.
    pub(crate) fn set_phases_at_start(&mut self, phases_rad: Vec<f64>) {
        self.initial_phases = phases_rad;
    }

    /// Shifts the natural frequencies, rad/s.
    pub(crate) fn shift_frequencies(&mut self, shift: impl Fn(usize) -> f64) {
        for (i, w) in self.natural_rad_per_s.iter_mut().enumerate() {
            *w += shift(i);
        }
    }

    pub(crate) fn set_beat(&mut self, beat: Beat) {
        self.beat = Some(beat);
    }

    /// Says which poles bend.
    pub(crate) fn set_bends(&mut self, bends: Vec<Bend>) {
        self.bends = bends;
    }

    pub(crate) fn set_heading(&mut self, heading: Heading) {
        self.heading = Some(heading);
    }

    pub(crate) fn set_contact_springs(
        &mut self,
        bilateral: bool,
        stiffness: impl Iterator<Item = f64>,
        exponent: f64,
    ) {
        self.contact_exponent = exponent;
        self.contact_stiffness = stiffness.collect();
        self.watches_contact = !bilateral;
    }

    /// Says that a force turns with the sense of a motion.
    pub(crate) fn expect_friction(&mut self) {
        self.has_friction = true;
    }

    /// Says that a rate jumps where a handle opens or closes; forces never do.
    pub(crate) fn jump_at_contact(&mut self) {
        self.jumps_at_contact = true;
    }

    /// A torque about the body's x axis turns with the sense of the motion, within about this rate, rad/s.
    pub(crate) fn turn_softly(&mut self, within_rad_per_s: f64) {
        self.turns_softly = Some(within_rad_per_s);
    }

    /// Whether a contact can pull: for effects that come after it in the table.
    pub(crate) fn contact_pulls(&self) -> bool {
        !self.contact_stiffness.is_empty() && !self.watches_contact
    }

    /// N·s/m of every carrier's contact, where it is the same whatever the load.
    pub(crate) fn set_contact_damping(&mut self, damping: Vec<f64x2>) {
        self.contact_damping = damping;
    }

    /// N·s/m and N/m of every carrier's hold on the handle, sideways.
    pub(crate) fn set_sideways_springs(&mut self, damping: Vec<f64x2>, stiffness: Vec<f64x2>) {
        self.sideways = [damping, stiffness];
    }

    /// Damping (s/m) and stiffness (1/m) of every carrier's straps, sideways, per newton of load.
    pub(crate) fn set_straps(&mut self, damping_s_per_m: f64, stiffness_per_m: f64) {
        self.straps = [damping_s_per_m, stiffness_per_m];
    }

    /// The clock that ticks at `rate_hz`; sensors of one rate share it.
    pub(crate) fn sensor_clock(&mut self, rate_hz: f64) -> usize {
        let clock = Clock { rate_hz };
        self.sensor_clocks
            .iter()
            .position(|c| *c == clock)
            .unwrap_or_else(|| {
                self.sensor_clocks.push(clock);
                self.sensor_clocks.len() - 1
            })
    }

    pub(crate) fn set_track(&mut self, track: Track) {
        self.track = Some(track);
    }

    pub(crate) fn add_imu(&mut self, imu: Imu) {
        self.imus.push(imu);
    }

    // What everybody else asks.

    /// The clocks on which sensors sample, beside the log's.
    pub fn sensor_clocks(&self) -> &[Clock] {
        &self.sensor_clocks
    }

    /// The sound of the drum, where the scene has it.
    pub fn track(&self) -> Option<&Track> {
        self.track.as_ref()
    }

    /// Every inertial sensor.
    pub fn imus(&self) -> &[Imu] {
        &self.imus
    }

    /// Where the party faces, rad, and how fast it turns, rad/s.
    pub fn heading(&self, t_s: f64) -> [f64; 2] {
        self.heading.map_or([0.0; 2], |heading| heading.at(t_s))
    }

    /// How many carriers there are.
    pub fn carriers(&self) -> usize {
        self.scene.carriers.count()
    }

    /// Where things are in the state vector.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The body's coordinates.
    pub fn freedoms(&self) -> &dyn Freedoms {
        &*self.freedoms
    }

    /// What counts as one unit of each of the body's states in an error norm: [`Freedoms::scales`], and for a velocity, where contacts damp,
    /// what is made of it before it is forgotten.
    ///
    /// An error of a velocity that decays at rate λ moves its coordinate by 1/λ of it: its unit is that of the coordinate times λ. One that
    /// hardly decays, as roll's on a pole, is not forgotten, and where the music makes roll grow it grows too: it counts as if it
    /// decayed at `slowest_per_s`. But forces show an error of any velocity undiminished, and a force that errs opens contacts that are closed: the
    /// unit is no more than so much that it is worth 2400 m/s² or rad/s², so nothing is loosened for stiff contacts.
    pub fn units(&self, y: &[f64], w: &Workspace, slowest_per_s: f64, units: &mut [f64]) {
        let scales = self.freedoms.scales();
        units.copy_from_slice(scales);
        if self.contact_damping.is_empty() {
            return;
        }
        let positions = self.freedoms.positions();
        self.damping_per_s(y, w, units);
        for (unit, &scale) in units.iter_mut().zip(scales).skip(positions) {
            let damping_per_s = *unit;
            let most = (LOOSEST / damping_per_s).max(scale);
            *unit = (COORDINATE * damping_per_s).clamp(COORDINATE * slowest_per_s, most);
        }
    }

    /// −∂v̇/∂v of each of the body's velocities, 1/s, that contacts, holds and straps make as they stand in the workspace; `rates` has the
    /// body's states, of which the positions are left alone.
    pub fn damping_per_s(&self, y: &[f64], w: &Workspace, rates: &mut [f64]) {
        rates[self.freedoms.positions()..].fill(0.0);
        if !self.contact_damping.is_empty() {
            let damping = [&self.side_damping[..], &self.contact_damping];
            self.freedoms.damping_per_s(y, &w.pair, damping, rates);
        }
    }

    /// Damping (N·s/m) and stiffness (N/m) of the springs at a carrier's handle along one of the world's axes, and what straps add to both
    /// per newton of its load (s/m, 1/m); zero where there are none.
    pub(crate) fn springs(&self, carrier: usize, axis: usize) -> [f64; 4] {
        let of = |springs: &[f64x2]| {
            let pair = springs.get(carrier / lanes::LANES);
            pair.map_or(0.0, |x| x.as_array()[carrier % lanes::LANES])
        };
        if axis < 2 {
            let [damping, stiffness] = &self.sideways;
            return [of(damping), of(stiffness), self.straps[0], self.straps[1]];
        }
        let stiffness = self.contact_stiffness.get(carrier).copied();
        [
            of(&self.contact_damping),
            stiffness.unwrap_or(0.0),
            0.0,
            0.0,
        ]
    }

    /// Natural gait frequencies, rad/s.
    pub fn natural_rad_per_s(&self) -> &[f64] {
        &self.natural_rad_per_s
    }

    /// The music's beat.
    pub fn beat(&self) -> Option<&Beat> {
        self.beat.as_ref()
    }

    /// Whether a rate jumps where a handle opens or closes.
    pub(crate) fn jumps_at_contact(&self) -> bool {
        self.jumps_at_contact
    }

    /// Whether a force turns with the sense of a motion, faster than the motion itself changes.
    pub fn has_friction(&self) -> bool {
        self.has_friction
    }

    /// Within which rate of rolling, rad/s, a friction about the body's x axis turns round, if there is one.
    pub fn turns_softly(&self) -> Option<f64> {
        self.turns_softly
    }

    /// Whether contacts can open and close.
    pub fn watches_contact(&self) -> bool {
        self.watches_contact
    }

    /// Names of the pages of the energy ledger.
    pub fn accounts(&self) -> impl Iterator<Item = &'static str> {
        self.accounts.iter().map(|(name, _)| *name)
    }

    /// Every state by name, in order.
    pub fn state_names(&self) -> Vec<String> {
        let mut names: Vec<String> = self
            .freedoms
            .names()
            .iter()
            .map(|n| (*n).to_string())
            .collect();
        names.extend((1..=self.layout.phases).map(|i| format!("phase_{i}_rad")));
        names.extend(self.extra.iter().map(|(name, _)| name.clone()));
        for (name, _) in &self.accounts {
            names.push(format!("{name}_work_j"));
            names.push(format!("{name}_dissipated_j"));
        }
        names
    }

    /// A workspace for this model; shoulders at rest, contacts undecided.
    pub fn workspace(&self) -> Workspace {
        let n = self.carriers();
        let handles = &self.scene.carriers.handles_m;
        let present = pack((0..n).map(|_| 1.0));
        let rest = [
            pack(handles.iter().map(|h| h[0])),
            pack(handles.iter().map(|h| h[1])),
            pack((0..n).map(|i| self.scene.carriers.shoulder_height_m.get(i))),
        ];
        let zero = f64x2::ZERO;
        let floor = if self.watches_contact {
            0.0
        } else {
            f64::NEG_INFINITY
        };
        let pair = |p: usize| {
            let rest = [rest[0][p], rest[1][p], rest[2][p]];
            Pair {
                rest,
                constant_rate: zero,
                contact_gain: present[p],
                contact_floor: f64x2::splat(floor),
                sin: zero,
                cos: zero,
                rate: zero,
                base: rest,
                base_rate: [zero; 3],
                arm: [zero; 3],
                gap: [zero; 3],
                gap_rate: [zero; 3],
                unclamped: zero,
                normal: zero,
                tangential: [zero; 2],
            }
        };
        Workspace {
            segment_s: 0.0,
            pair: (0..pairs(n)).map(pair).collect(),
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            spin: [0.0; 3],
            least_load_n: 0.0,
            beat: [0.0; 2],
            body_torque: [0.0; 3],
            extra: self.extra.iter().map(|(_, first)| *first).collect(),
            extra_rate: vec![0.0; self.extra.len()].into(),
        }
    }

    /// The state at t = 0.
    pub fn initial_state(&self) -> Vec<f64> {
        let mut y = vec![0.0; self.layout.size()];
        self.freedoms
            .place(&self.scene.start, self.start_height_m, &mut y);
        y[self.layout.phase_range()].copy_from_slice(&self.initial_phases[..self.layout.phases]);
        for (y, (_, first)) in y[self.layout.extra_range()].iter_mut().zip(&self.extra) {
            *y = *first;
        }
        y
    }

    /// The first moment after `after_s` at which the right-hand side may jump.
    pub fn next_switch_s(&self, after_s: f64) -> f64 {
        self.switches
            .iter()
            .map(|s| s.next_s(after_s))
            .fold(f64::INFINITY, f64::min)
    }

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
            let power = self.power(&**account, w);
            out.copy_from_slice(&[power.work_w, power.dissipated_w]);
        }
    }

    #[inline(always)]
    fn power(&self, account: &dyn Account, w: &Workspace) -> Power {
        #[cfg(target_arch = "x86_64")]
        if self.fused {
            // SAFETY: the processor was asked.
            #[allow(unsafe_code)]
            return unsafe { account.power_fused(w) };
        }
        account.power(w, &w.pair, 0)
    }

    #[cold]
    fn powers_in_blocks(&self, dy: &mut [f64], w: &Workspace) {
        let ledger = &mut dy[self.layout.ledger_range()];
        ledger.fill(0.0);
        for block in blocks(w.pair.len()) {
            let pairs = &w.pair[block.clone()];
            for ((_, account), out) in self.accounts.iter().zip(ledger.chunks_exact_mut(2)) {
                let power = account.power(w, pairs, block.start);
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
            self.handles_in_blocks(t_s, y, w);
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
        let bends = self.terms.with(Stage::Bends);
        if !bends.is_empty() {
            self.freedoms.orient(y, w);
            for term in bends {
                term.apply(t_s, w);
            }
        }
        Self::apply::<FUSED>(self.terms.with(Stage::Handles), t_s, w);
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
    fn handles_in_blocks(&self, t_s: f64, y: &[f64], w: &mut Workspace) {
        let local = |stage: Stage| {
            let terms = self.terms.of(stage).iter();
            terms.filter_map(|term| term.on_block())
        };
        for block in blocks(w.pair.len()) {
            if self.has_phases {
                w.pair[block.clone()].iter_mut().for_each(Pair::stand);
                local(Stage::Shoulders).for_each(|term| term.apply_to(t_s, w, block.clone()));
            }
            self.freedoms.gaps_of(y, w, block.clone());
            local(Stage::Handles).for_each(|term| term.apply_to(t_s, w, block.clone()));
        }
        Self::apply::<false>(self.terms.of(Stage::Body), t_s, w);
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
            Self::apply::<false>(self.terms.of(Stage::Clock), t_s, w);
            Self::apply::<false>(self.terms.of(Stage::Phases), t_s, w);
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

impl Model {
    /// What rounding makes of N* of a handle where the heights that it compares are of size `height_m`, N.
    pub(crate) fn contact_rounding_n(&self, handle: usize, height_m: f64) -> f64 {
        8.0 * f64::EPSILON * self.contact_stiffness[handle] * height_m.abs()
    }

    /// Books what the contact spring of a handle loses when it opens, or is given when it closes, at `gap_m` ≠ 0.
    pub(crate) fn book_contact(&self, handle: usize, opened: bool, gap_m: f64, y: &mut [f64]) {
        if let Some(page) = self
            .accounts
            .iter()
            .position(|(name, _)| *name == "contact")
        {
            // ∫ k δ^p dδ; for δ < 0 a linear spring that is frozen in contact holds ½kδ² too.
            let p = self.contact_exponent;
            let spring_j = self.contact_stiffness[handle] * gap_m.abs().powf(p + 1.0) / (p + 1.0);
            y[self.layout.ledger_range().start + 2 * page + 1] +=
                if opened { spring_j } else { -spring_j };
        }
    }
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
                    angular_velocity_rad_per_s = [0.3, 0.2, 0.1]
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
                let scene = parse("crowd", &text, &[]).unwrap_or_else(|e| panic!("{e}"));
                let mut model = Model::new(&scene);
                assert!(model.in_blocks, "{freedom} {forces}");
                let y = model.initial_state();
                let rates = |model: &Model| {
                    let (mut dy, mut w) = (vec![f64::NAN; y.len()], model.workspace());
                    model.begin_segment(30.0, &mut w);
                    model.rhs(31.0, &y, &mut dy, &mut w);
                    dy
                };
                let blocks = rates(&model);
                model.in_blocks = false;
                let ledger = model.layout().ledger_range();
                for (k, (a, b)) in blocks.iter().zip(rates(&model)).enumerate() {
                    // Only sums of the ledger come in another order.
                    let same = if ledger.contains(&k) {
                        (a - b).abs() <= 1e-12 * (1e3 + b.abs())
                    } else {
                        a.to_bits() == b.to_bits()
                    };
                    assert!(same, "{freedom} {forces} {k}: {a} {b}");
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

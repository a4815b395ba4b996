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

mod building;
mod eight;
mod heading;
mod rest;
mod rhs;
mod sideways;
mod slopes;
mod term;
pub(crate) mod workspace;

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
use crate::random::{Stream, normal};
use crate::scene::Scene;
use crate::sensors::drum::Track;
use crate::sensors::{Clock, Imu};
use rest::Springs;
use std::ops::Range;
use term::Staged;
use workspace::BLOCK;

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
    /// Whether an effect asks where the body is and how it moves.
    looks_at_body: bool,
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
    /// N·s/m per newton of load that friction damps by where nothing slides, s/m.
    friction_damping_s_per_m: f64,
    jumps_at_contact: bool,
    turns_softly: Option<f64>,
    /// Whether there are so many carriers that they are treated block by block.
    in_blocks: bool,
    /// Whether the processor has AVX2 and FMA.
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
            looks_at_body: false,
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
            friction_damping_s_per_m: 0.0,
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
        // What bends a pole, moves the party or looks at the body is not the affair of one pair.
        let stage = |stage: Stage| model.terms.of(stage).iter();
        model.in_blocks = model.carried
            && pairs(n) > BLOCK
            && !model.looks_at_body
            && stage(Stage::Party).count() == 0
            && stage(Stage::Shoulders)
                .chain(stage(Stage::Handles))
                .all(|term| term.on_block().is_some());
        #[cfg(target_arch = "x86_64")]
        {
            model.fused = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
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

    /// The same with what friction adds where each handle bears `loads_n`, one pair after the other: as much as it can, for the more it slides the
    /// less it damps. Not for units: an error is forgotten as the slowest law forgets it. Dampers sideways and vertical are collected in what is lent.
    pub(crate) fn damping_with_friction_per_s(
        &self,
        y: &[f64],
        w: &Workspace,
        loads_n: &[f64x2],
        [sideways, vertical]: &mut [Vec<f64x2>; 2],
        rates: &mut [f64],
    ) {
        let rubs = |(held, load): (&f64x2, &f64x2)| *held + *load * self.friction_damping_s_per_m;
        sideways.clear();
        sideways.extend(self.side_damping.iter().zip(loads_n).map(rubs));
        // Hunt and Crossley's dampers go with the compression, and are left out.
        vertical.clear();
        vertical.extend_from_slice(&self.contact_damping);
        vertical.resize(loads_n.len(), f64x2::ZERO);
        let dampers = [&sideways[..], vertical];
        self.freedoms.damping_per_s(y, &w.pair, dampers, rates);
    }

    /// N·s/m per newton of load that friction damps a handle by where nothing slides, s/m; 0 without friction.
    pub(crate) fn friction_damping_s_per_m(&self) -> f64 {
        self.friction_damping_s_per_m
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

    /// The poles that bend.
    pub(crate) fn bends(&self) -> &[Bend] {
        &self.bends
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
            free_fall: self.body.gravity_m_per_s2.into(),
            t_s: 0.0,
            velocity: [0.0; 3],
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

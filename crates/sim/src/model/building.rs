//! What effects call while they are built.

use super::{Account, Bend, Heading, Model, Stage, Switch, Term};
use crate::beat::Beat;
use crate::lanes::f64x2;
use crate::sensors::drum::Track;
use crate::sensors::{Clock, Imu};

impl Model {
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

    /// Asks for [`Workspace::rotation`], [`Workspace::velocity`] and [`Workspace::t_s`] from [`Stage::Bends`] on.
    pub(crate) fn look_at_body(&mut self) {
        self.looks_at_body = true;
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

    /// N·s/m per newton of load that friction damps a handle by where nothing slides.
    pub(crate) fn set_friction_damping(&mut self, s_per_m: f64) {
        self.friction_damping_s_per_m = s_per_m;
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
}

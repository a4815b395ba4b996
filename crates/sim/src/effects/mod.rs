//! The effects a scene can call for: one file each, and one line each in [`TABLE`].
//!
//! An effect's `build` adds terms to a [`Model`]: to the phase rates, to the motion of the shoulders, to the forces at
//! the handles, to the fall of the body and the torque on it; moments at which the right-hand side jumps; states; an account of energy.
//! An effect that the scene does not name adds nothing, so it has no branch, no state and no cost.

pub mod contact;
pub mod coupling;
pub mod drum;
pub mod feedback;
pub mod flexure;
pub mod frequency_spread;
pub mod friction;
pub mod gait;
pub mod hold;
pub mod imu;
pub mod lift;
pub mod measured;
pub mod music;
pub mod noise;
pub mod path;
pub mod pole_friction;
pub mod push;
pub mod sling;

use crate::model::Model;
use crate::scene::Scene;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// The `[effects.NAME]` tables of a scene; absent means off.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Effects {
    pub contact: Option<contact::Contact>,
    pub hold: Option<hold::Hold>,
    pub friction: Option<friction::Friction>,
    pub sling: Option<sling::Sling>,
    pub pole_friction: Option<pole_friction::PoleFriction>,
    pub gait: Option<gait::Gait>,
    pub lift: Option<lift::Lift>,
    pub frequency_spread: Option<frequency_spread::FrequencySpread>,
    pub coupling: Option<coupling::Coupling>,
    pub music: Option<music::Music>,
    pub noise: Option<noise::Noise>,
    pub feedback: Option<feedback::Feedback>,
    pub measured: Option<measured::Measured>,
    pub path: Option<path::Path>,
    pub flexure: Option<flexure::Flexure>,
    pub push: Option<push::Push>,
    pub imu: Option<imu::Imu>,
    pub drum: Option<drum::Drum>,
}

/// One line of the table of effects.
pub struct Entry {
    /// The name in `[effects.NAME]`.
    pub name: &'static str,
    /// One sentence for `sim explain`.
    pub about: &'static str,
    /// Whether a scene has it.
    pub is_on: fn(&Effects) -> bool,
    /// Why it does nothing though it is on, if it does nothing.
    pub idle: fn(&Scene) -> Option<Cow<'static, str>>,
    /// Takes it out of a scene.
    pub switch_off: fn(&mut Effects),
    /// Checks its parameters.
    pub check: fn(&Scene) -> Result<(), crate::scene::problem::Problem>,
    /// Adds it to the model.
    pub build: fn(&Scene, &mut Model),
}

macro_rules! entry {
    ($name:ident, $about:literal) => {
        entry!($name, $about, |_| None)
    };
    ($name:ident, $about:literal, $idle:expr) => {
        Entry {
            name: stringify!($name),
            about: $about,
            is_on: |e| e.$name.is_some(),
            idle: |s| s.effects.$name.as_ref().and_then(|_| $idle(s)),
            switch_off: |e| e.$name = None,
            check: |s| s.effects.$name.as_ref().map_or(Ok(()), |p| p.check(s)),
            build: |s, m| {
                if let Some(p) = &s.effects.$name {
                    p.build(s, m);
                }
            },
        }
    };
}

/// For what acts through the load on a shoulder.
fn without_contact(s: &Scene) -> Option<Cow<'static, str>> {
    let why = "there is no `effects.contact` that would load a shoulder";
    s.effects.contact.is_none().then_some(why.into())
}

/// For what acts on the phases alone.
fn phases_measured(s: &Scene) -> Option<Cow<'static, str>> {
    let measured = s.effects.measured.as_ref();
    let measured = measured.filter(|m| !m.phase_rad.is_empty());
    measured.map(|_| "the phases are those of `effects.measured`".into())
}

/// For what moves shoulders.
fn shoulders_measured(s: &Scene) -> Option<Cow<'static, str>> {
    let measured = s.effects.measured.as_ref();
    let measured = measured.filter(|m| !m.shoulder_m.is_empty());
    measured.map(|_| "the shoulders move as `effects.measured` says".into())
}

/// For what begins at `onset_s`.
fn after_the_end(s: &Scene, onset_s: f64) -> Option<Cow<'static, str>> {
    let end_s = s.duration_s;
    (onset_s >= end_s)
        .then(|| format!("it begins at {onset_s} s, and the run ends at {end_s} s").into())
}

/// Every effect, in the order in which terms of the same kind are applied.
pub const TABLE: &[Entry] = &[
    // Before who asks where gravity points.
    entry!(path, "the way slopes and turns"),
    entry!(
        frequency_spread,
        "natural gait frequencies differ from carrier to carrier",
        phases_measured
    ),
    entry!(
        coupling,
        "carriers adjust to each other (Kuramoto)",
        phases_measured
    ),
    entry!(
        music,
        "carriers are entrained by a beat (Adler)",
        |s: &Scene| after_the_end(s, s.effects.music.as_ref()?.onset_s)
    ),
    entry!(
        noise,
        "gait phases wander (white phase noise)",
        phases_measured
    ),
    entry!(
        gait,
        "shoulders move with the gait phase",
        shoulders_measured
    ),
    entry!(
        lift,
        "shoulders lift harder or softer than the gait alone",
        |s: &Scene| {
            let onset_s = s.effects.lift.as_ref()?.onset_s;
            shoulders_measured(s).or_else(|| after_the_end(s, onset_s))
        }
    ),
    entry!(contact, "handles rest on shoulders: spring and damper"),
    entry!(
        hold,
        "hands hold the handles sideways: spring and damper",
        // Friction holds what the load presses, which is nothing.
        |s: &Scene| without_contact(s).filter(|_| s.effects.friction.is_some())
    ),
    entry!(
        sling,
        "straps pull a handle back sideways, in proportion to the load",
        without_contact
    ),
    // After what it limits.
    entry!(
        friction,
        "sideways force at a handle is limited by Coulomb friction",
        |s: &Scene| without_contact(s).filter(|_| s.effects.hold.is_none())
    ),
    entry!(
        pole_friction,
        "turning about the pole rubs on the shoulders, saturating",
        without_contact
    ),
    entry!(
        feedback,
        "the load that a carrier feels shifts the gait's phase",
        phases_measured
    ),
    // After everything that has a say in phase rates.
    entry!(measured, "carriers move as somebody measured"),
    entry!(
        flexure,
        "poles bend: their first mode",
        // A grip bends them too, as long as nothing limits it by the load.
        |s: &Scene| {
            let (hold, friction) = (&s.effects.hold, &s.effects.friction);
            without_contact(s).filter(|_| hold.is_none() || friction.is_some())
        }
    ),
    entry!(
        push,
        "somebody beside the party pushes the load",
        |s: &Scene| {
            let pushes = &s.effects.push.as_ref()?.pushes;
            match pushes.iter().map(|p| p.start_s).reduce(f64::min) {
                Some(first_s) => after_the_end(s, first_s),
                None => Some("`effects.push.pushes` is empty".into()),
            }
        }
    ),
    entry!(imu, "virtual inertial sensors on body and carriers"),
    entry!(drum, "the sound of the drum, as a microphone hears it"),
];

/// The effects that are on and do nothing, and why.
pub fn idle(scene: &Scene) -> impl Iterator<Item = (&'static str, Cow<'static, str>)> {
    let idle = |e: &Entry| Some((e.name, (e.idle)(scene)?));
    TABLE.iter().filter_map(idle)
}

/// Checks the parameters of every effect that is on.
pub(crate) fn check(scene: &Scene) -> Result<(), crate::scene::problem::Problem> {
    TABLE.iter().try_for_each(|e| (e.check)(scene))
}

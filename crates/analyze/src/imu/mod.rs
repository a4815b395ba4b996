//! From inertial sensors to motion: orientation, height, and the paper's metrics, without a force sensor or a camera.
//!
//! Everything here takes slices of times and samples. The accelerometer reads *specific force* (REP-145: at rest with
//! z up it reads +g), the gyroscope the angular velocity, both in the sensor's frame.
//!
//! | module | gives |
//! |---|---|
//! | [`track`] | a clean series of samples out of whatever columns a file had |
//! | [`held`] | readings that only repeat |
//! | [`stray`] | samples that nothing carried could have felt |
//! | [`bridge`] | what short holes most likely held |
//! | [`orientation`] | sensor → earth (z up), causal and batch |
//! | [`vertical`] | height by drift-free double integration, with its valid band |
//! | [`rath`] | the body's motion |
//! | [`budget`] | how sure a sensor can be |
//! | [`interval`] | every metric that rests on the motion, with its interval |
//! | [`unloading`] | when the support falls below a share of the weight |
//! | [`floating`] | for what part of the time it is there |
//! | [`saturation`] | where a sensor came to the end of its range |
//! | [`gravity`] | how well rates keep gravity where it is |
//! | [`mod@unit`] | whether a gyroscope's unit is another than it is said to be |
//! | [`mod@bias`] | a gyroscope that is far off |
//! | [`axes`] | whether a gyroscope stands on its accelerometer's axes |
//! | [`frozen`] | where a sensor stands still in moving hands |
//! | [`turned`] | whether a sensor slipped in its mounting |
//! | [`truth`] | errors against a recorded truth |

pub mod axes;
pub mod bias;
pub mod bridge;
pub mod budget;
pub mod floating;
pub mod frozen;
pub mod gravity;
pub mod held;
pub mod interval;
pub mod orientation;
pub mod rath;
pub mod saturation;
pub mod stray;
pub mod track;
pub mod truth;
pub mod turned;
pub mod unit;
pub mod unloading;
pub mod vertical;

pub use track::Track;

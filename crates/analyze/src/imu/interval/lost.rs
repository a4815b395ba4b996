//! What a sensor did not tell of the motion, and what is left of the intervals then.

use super::is_of_height;
use crate::imu::track::Instrument;
use crate::metrics::Metrics;

/// What a sensor did not tell of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lost {
    /// What went beyond its range.
    Peaks(Instrument),
    /// All, while it stood still.
    All(Instrument),
    /// About which axes it turned.
    Axes,
    /// In which unit it turned.
    Unit,
    /// How it sits on the body.
    Mounting,
    /// That it sits there as it did before.
    Turned,
    /// Which way is forward.
    Forward,
}

/// Takes the intervals from numbers that rest on what was lost, which is in no budget. An accelerometer's missing peaks hardly turn the attitude.
pub fn without(metrics: &mut Metrics, lost: Lost) {
    without_those(metrics, lost, |name| match lost {
        Lost::Peaks(Instrument::Accelerometer) => is_of_height(name) || name == "t_float",
        Lost::Forward => !is_of_height(name) && name != "t_float" || name == "subharmonic_ratio",
        _ => true,
    });
}

/// The same of those that `rests_on` names.
pub fn without_those(metrics: &mut Metrics, lost: Lost, rests_on: impl Fn(&str) -> bool) {
    let (instrument, why) = match lost {
        Lost::Peaks(of) => (of, "came to the end of its range"),
        Lost::All(of) => (of, "gave one reading while the device moved"),
        Lost::Axes => (
            Instrument::Gyroscope,
            "does not stand on the accelerometer's axes",
        ),
        Lost::Unit => (Instrument::Gyroscope, "reads no rad/s"),
        Lost::Mounting => (
            Instrument::Accelerometer,
            "shows gravity elsewhere than below the load as the sensor is said to be mounted",
        ),
        Lost::Turned => (
            Instrument::Accelerometer,
            "shows gravity elsewhere in the sensor's axes from a moment of the window on",
        ),
        Lost::Forward => (
            Instrument::Accelerometer,
            "shows the sensor's x upright, which does not tell forward",
        ),
    };
    let why = format!("without an interval: the {} {why}", instrument.name());
    without_an_interval(metrics, &why, rests_on);
}

/// The same of those that `rests_on` names, for a reason.
pub fn without_an_interval(metrics: &mut Metrics, why: &str, rests_on: impl Fn(&str) -> bool) {
    for (name, value) in &mut metrics.0 {
        if rests_on(name) && value.ci95.take().is_some() {
            value.reason = Some(match value.reason.take() {
                Some(reason) => format!("{why}; {reason}"),
                None => why.to_owned(),
            });
        }
    }
}

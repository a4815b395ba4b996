//! Which coordinates a scene's freedoms ask for.

use super::gimbal::Gimbal;
use super::hinge::{ASKEW, Hinge};
use super::pinned::Pinned;
use super::reduced::{Rails, Reduced};
use super::{Freedoms, Six};
use crate::body::Body;
use crate::scene::parts::{Freedom, Start};

/// The coordinates for a choice of freedoms.
pub fn choose(
    body: &Body,
    handles_m: &[[f64; 3]],
    free: &[Freedom],
    start: &Start,
    height_m: f64,
) -> Box<dyn Freedoms> {
    let is_free = Freedom::ALL.map(|f| free.contains(&f));
    let six = || Six::new(body, handles_m);
    let rails = || Rails::new(body, is_free, start, height_m);
    match is_free {
        [true, true, true, true, true, true] => Box::new(six()),
        [x, y, z, true, true, true] => Box::new(Pinned::new(six(), [x, y, z])),
        [.., roll, tilt, yaw] if u8::from(roll) + u8::from(tilt) + u8::from(yaw) == 2 => {
            Box::new(Reduced::<Gimbal>::new(rails(), handles_m))
        }
        [.., roll, tilt, yaw] => {
            let [_, pitch_deg, yaw_deg] = start.roll_pitch_yaw_deg;
            match (roll, tilt, yaw) {
                (true, ..) if pitch_deg == 0.0 && yaw_deg == 0.0 => {
                    Box::new(Reduced::<Hinge<0>>::new(rails(), handles_m))
                }
                (_, true, _) if yaw_deg == 0.0 => {
                    Box::new(Reduced::<Hinge<1>>::new(rails(), handles_m))
                }
                (.., true) => Box::new(Reduced::<Hinge<2>>::new(rails(), handles_m)),
                _ => Box::new(Reduced::<Hinge<ASKEW>>::new(rails(), handles_m)),
            }
        }
    }
}

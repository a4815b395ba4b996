//! One clock for every device, set by taps: what is struck on the rath is felt by the sensors held against it and heard by a microphone near it.
//!
//! The clock of the rath's own sensor is everybody's. A device keeps its own where too little is shared, and that is said.

use crate::clock::{Clock, ClockError, from_events, taps};
use crate::examine::Quality;
use crate::imu::Track;

use super::remark;

/// Fewer taps than this set no clock: two may be chance.
const FEWEST: usize = 3;
/// This share of the taps has to be found on the other device too.
const SHARE: f64 = 0.6;
/// How far clocks are looked for, s: those of phones that know the date are within seconds of each other.
const SEARCH_S: f64 = 300.0;
/// A tap of one and the same tap of the other are this near, s: half a sample of each at 50 Hz.
const TOLERANCE_S: f64 = 0.02;
/// Standard error of every moment heard alike, s: windows of 32 ms every 10 ms tell when a sound begins.
const HEARD_SD_S: f64 = 0.003;

/// The clocks that taps have set.
#[derive(Default)]
pub struct Clocks {
    /// Topic of the rath's sensor.
    rath: String,
    /// Taps on it, s.
    tap_s: Vec<f64>,
    /// Whether any other clock was set.
    pub any_set: bool,
    /// What there is to say.
    pub remarks: Vec<Quality>,
}

impl Clocks {
    /// The clock of the rath's sensor.
    pub fn of_rath(topic: &str, track: &Track) -> Self {
        Self {
            rath: topic.to_owned(),
            tap_s: felt(track),
            ..Self::default()
        }
    }

    /// Puts the samples of another sensor on the rath's clock, where taps tell how.
    pub fn put_right(&mut self, topic: &str, track: &mut Track) {
        if self.tap_s.len() < FEWEST {
            return;
        }
        let tap_s = felt(track);
        let fit = from_events(&tap_s, &self.tap_s, SEARCH_S, TOLERANCE_S);
        if let Some(clock) = self.found(topic, fit, tap_s.len().min(self.tap_s.len())) {
            let ahead_s = clock.at_s - clock.reference_s(clock.at_s);
            self.say(topic, &clock, ahead_s, -clock.drift_ppm);
            for t in &mut track.t_s {
                *t = clock.reference_s(*t);
            }
        }
    }

    /// Puts what was heard on the rath's clock; `onset_s` is everything that begins in the sound.
    pub fn put_sound_right(&mut self, topic: &str, onset_s: &[f64], heard_s: &mut [f64]) {
        if self.tap_s.len() < FEWEST {
            return;
        }
        // The other way round: the taps are few, and sound begins all the time.
        let fit = from_events(&self.tap_s, onset_s, SEARCH_S, TOLERANCE_S);
        if let Some(clock) = self.found(topic, fit, self.tap_s.len()) {
            let clock = Clock {
                offset_sd_s: clock.offset_sd_s.hypot(HEARD_SD_S),
                ..clock
            };
            let ahead_s = clock.reference_s(clock.at_s) - clock.at_s;
            self.say(topic, &clock, ahead_s, clock.drift_ppm);
            for t in heard_s {
                *t = clock.device_s(*t);
            }
        }
    }

    /// A clock that rests on enough of `taps`; otherwise it is said why there is none.
    fn found(
        &mut self,
        topic: &str,
        clock: Result<Clock, ClockError>,
        taps: usize,
    ) -> Option<Clock> {
        let why = match clock {
            Ok(clock) if clock.points >= FEWEST.max((SHARE * taps as f64).ceil() as usize) => {
                return Some(clock.believed());
            }
            Ok(clock) => format!("only {} are found here", clock.points),
            Err(ClockError::Ambiguous {
                first_s, second_s, ..
            }) => {
                format!("they fit {first_s:+.2} and {second_s:+.2} s off alike")
            }
            Err(_) => "none are found here".to_owned(),
        };
        self.remarks.push(remark(
            topic,
            "no_taps",
            format!(
                "{} was tapped {} times; {why}, so this clock is not set by them",
                self.rath,
                self.tap_s.len()
            ),
        ));
        None
    }

    fn say(&mut self, topic: &str, clock: &Clock, ahead_s: f64, fast_ppm: f64) {
        self.remarks.push(remark(
            topic,
            "clock_offset",
            format!(
                "runs {:+.1} ± {:.1} ms off {} and {:+.0} ± {:.0} ppm fast, by {} taps; put right",
                1e3 * ahead_s,
                1.96e3 * clock.offset_sd_s,
                self.rath,
                fast_ppm,
                1.96 * clock.drift_sd_ppm.unwrap_or_default(),
                clock.points
            ),
        ));
        self.any_set = true;
    }
}

/// Taps that a sensor felt, s.
fn felt(track: &Track) -> Vec<f64> {
    let norm: Vec<f64> = track
        .accel_m_per_s2
        .iter()
        .map(|a| nalgebra::Vector3::from(*a).norm())
        .collect();
    taps(&track.t_s, &norm)
}

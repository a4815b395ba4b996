//! One clock for every device, set by taps: what is struck on the rath is felt by the sensors held against it and heard by a microphone near it.
//!
//! The clock of the rath's own sensor is everybody's. A device keeps its own where too little is shared, and that is said.

use crate::clock::{Clock, ClockError, MOST_DRIFT, from_events, from_signals, taps};
use crate::imu::Track;
use crate::imu::track::period_s;
use crate::inputs::Window;
use crate::quality::Quality;
use crate::spectrum::chi_square_cdf;

/// Fewer taps than this set no clock: two may be chance.
const FEWEST: usize = 3;
/// This share of the taps has to be found on the other device too.
const SHARE: f64 = 0.6;
/// How far clocks are looked for, s: those of phones that know the date are within seconds of each other.
const SEARCH_S: f64 = 300.0;
/// A tap of one and the same tap of the other are this near, s: half a sample of each at 50 Hz.
const TOLERANCE_S: f64 = 0.02;
/// What is noticed so near the taps tells how often something is, s.
const ABOUT_S: f64 = 5.0;
/// Clocks that chance finds more often are not set.
const MOST_BY_CHANCE: f64 = 1e-3;
/// Taps so far apart are those before a walk and those behind it, s.
const WALK_S: f64 = 10.0;
/// A beat that comes so soon after the last tap is one, s.
const TAPPING_S: f64 = 0.5;
/// What begins so near a beat is on it, s.
const ON_BEAT_S: f64 = 0.07;
/// Standard error of every moment heard alike, s: windows of 32 ms every 10 ms tell when a sound begins.
const HEARD_SD_S: f64 = 0.003;

/// The clocks that taps have set.
#[derive(Default)]
pub struct Clocks {
    /// Topic of the rath's sensor.
    rath: String,
    /// Taps on it, s.
    tap_s: Vec<f64>,
    /// When and how fast it turns, s and rad/s.
    turning: (Vec<f64>, Vec<f64>),
    /// Clocks are left as they are; it is only said how they differ.
    leave: bool,
    /// Topics of the sensors of whose clocks taps tell how they go.
    pub set: Vec<String>,
    /// Whether any differs by more than taps err, and was left.
    pub any_apart: bool,
    /// What there is to say.
    pub remarks: Vec<Quality>,
}

impl Clocks {
    /// The clock of the rath's sensor; with `leave` the others are left as they are, and it is only said how they differ.
    pub fn of_rath(topic: &str, track: &Track, leave: bool) -> Self {
        Self {
            leave,
            rath: topic.to_owned(),
            tap_s: felt(track),
            turning: (track.t_s.clone(), norms(&track.gyro_rad_per_s)),
            ..Self::default()
        }
    }

    /// Puts the samples of another sensor on the rath's clock, where taps tell how; gives the standard error of their times in the middle of
    /// `window` (s), 0 where nothing was done.
    pub fn put_right(&mut self, topic: &str, track: &mut Track, window: Window) -> f64 {
        if self.tap_s.len() < FEWEST {
            return 0.0;
        }
        let tap_s = felt(track);
        let fit = paired(&tap_s, &self.tap_s);
        let taps = tap_s.len().min(self.tap_s.len());
        self.found(topic, fit, taps).map_or(0.0, |mut clock| {
            // A tap falls anywhere between two samples, of either sensor; the scatter does not show it where both samplings keep step.
            let spread_s = |t_s: &[f64]| period_s(t_s).unwrap_or_default() / 12f64.sqrt();
            let sampled_s = spread_s(&track.t_s).hypot(spread_s(&self.turning.0));
            let floor_s = sampled_s / (clock.points as f64).sqrt();
            clock.offset_sd_s = clock.offset_sd_s.max(floor_s);
            self.say(topic, &clock, clock.ahead());
            self.set.push(topic.to_owned());
            if self.leave {
                return 0.0;
            }
            let within = window.range(&track.t_s);
            let middle_s = track.t_s.get((within.start + within.end) / 2);
            let sd_s = clock.reference_sd_s(middle_s.copied().unwrap_or(clock.at_s));
            for t in &mut track.t_s {
                *t = clock.reference_s(*t);
            }
            sd_s
        })
    }

    /// Says how the clock of another sensor on the load goes, by how fast both turn: on a rigid body that is the same everywhere, whichever way a
    /// sensor is mounted. Nothing is put right: no estimate rests on it.
    pub fn hold_against(&mut self, topic: &str, track: &Track) {
        let (t_s, turning) = &self.turning;
        let own = norms(&track.gyro_rad_per_s);
        let found = from_signals((&track.t_s, &own), (t_s, turning), SEARCH_S);
        let (kind, text) = match found {
            Ok(clock) => (
                "clock_offset",
                format!(
                    "{}, by how fast both turn; motion is estimated from {} alone",
                    self.against(&clock, clock.ahead()),
                    self.rath
                ),
            ),
            Err(error) => (
                "turns_otherwise",
                format!(
                    "is named as a sensor on the load and held against {}: {error}",
                    self.rath
                ),
            ),
        };
        self.remarks.push(Quality::remark(topic, kind, text));
    }

    /// Puts the beats that were heard on the rath's clock, and leaves out those that are taps; `onset_s` is everything that begins in the sound. Says
    /// whether that was done.
    pub fn put_sound_right(
        &mut self,
        topic: &str,
        onset_s: &[f64],
        heard_s: &mut Vec<f64>,
    ) -> bool {
        if self.tap_s.len() < FEWEST {
            return false;
        }
        // The other way round: the taps are few, and sound begins all the time.
        let fit = paired(&self.tap_s, onset_s);
        // A tap is felt at the largest sample of its ringing, up to a sample behind its beginning, every time alike; between two sensors that cancels.
        let felt_late_s = 0.5 * period_s(&self.turning.0).unwrap_or_default();
        if let Some(clock) = self.found(topic, fit, self.tap_s.len()) {
            let clock = Clock {
                offset_sd_s: clock.offset_sd_s.hypot(HEARD_SD_S).hypot(felt_late_s),
                ..clock
            };
            self.say(topic, &clock, clock.ahead().map(|of_rath| -of_rath));
            if self.leave {
                return false;
            }
            for t in &mut *heard_s {
                *t = clock.device_s(*t);
            }
            let begins_s: Vec<f64> = onset_s.iter().map(|t| clock.device_s(*t)).collect();
            self.leave_taps_out(&begins_s, heard_s);
            return true;
        }
        false
    }

    /// Leaves out what was taken for beats while somebody tapped, before the walk or behind it, and in the silence between taps and music, where
    /// nothing begins (s).
    fn leave_taps_out(&self, begins_s: &[f64], beat_s: &mut Vec<f64>) {
        let middle_s = beat_s.get(beat_s.len() / 2).copied().unwrap_or_default();
        let walk = self.tap_s.windows(2).position(|t| t[1] - t[0] > WALK_S);
        let before = walk.map_or_else(
            || self.tap_s.partition_point(|t| *t < middle_s),
            |last| last + 1,
        );
        let (before, behind) = self.tap_s.split_at(before);
        beat_s.retain(|beat| {
            before.last().is_none_or(|tap| *beat > tap + TAPPING_S)
                && behind.first().is_none_or(|tap| *beat < tap - TAPPING_S)
        });
        let heard = |beat: &f64| begins_s.iter().any(|t| (t - beat).abs() < ON_BEAT_S);
        beat_s.truncate(beat_s.iter().rposition(heard).map_or(0, |last| last + 1));
        beat_s.drain(..beat_s.iter().position(heard).unwrap_or_default());
    }

    /// A clock that rests on enough of `taps` and on more of what was noticed than chance pairs; otherwise it is said why there is none.
    fn found(
        &mut self,
        topic: &str,
        (clock, by_chance): (Result<Clock, ClockError>, f64),
        taps: usize,
    ) -> Option<Clock> {
        let why = match clock {
            Ok(clock) if by_chance > MOST_BY_CHANCE => format!(
                "the {} found here stand among so much else that chance finds as many",
                clock.points
            ),
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
        self.remarks.push(Quality::remark(
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

    /// A clock beside that of the rath's sensor, in words.
    fn against(&self, clock: &Clock, [ahead_s, fast_ppm]: [f64; 2]) -> String {
        let fast = match clock.drift_sd_ppm {
            // A drift that rounds to none has no sign.
            Some(sd_ppm) => format!(
                "{:+.0} ± {:.0} ppm fast",
                fast_ppm.round() + 0.0,
                1.96 * sd_ppm
            ),
            None => "too short to tell how fast".to_owned(),
        };
        format!(
            "runs {:+.1} ± {:.1} ms off {} and {fast}",
            1e3 * ahead_s,
            1.96e3 * clock.offset_sd_s,
            self.rath,
        )
    }

    fn say(&mut self, topic: &str, clock: &Clock, ahead: [f64; 2]) {
        let done = match self.leave {
            true => "left as it is",
            false => "put right",
        };
        self.any_apart |= self.leave && ahead[0].abs() > 1.96 * clock.offset_sd_s;
        self.remarks.push(Quality::remark(
            topic,
            "clock_offset",
            format!(
                "{}, by {} taps; {done}",
                self.against(clock, ahead),
                clock.points,
            ),
        ));
    }
}

/// What events of a device and of a reference tell of its clock, and how probable chance makes that.
fn paired(device_s: &[f64], reference_s: &[f64]) -> (Result<Clock, ClockError>, f64) {
    let clock = from_events(device_s, reference_s, SEARCH_S, TOLERANCE_S);
    let by_chance = (clock.as_ref()).map_or(0.0, |c| by_chance(c, [device_s, reference_s]));
    (clock, by_chance)
}

/// Probability that so many events pair at any of the offsets that are looked through, if none is shared: others about them, the device's or the reference's, come
/// as often as chance has it.
///
/// ```text
/// p = M P(N ≥ n),    N Poisson of mean λ = 2 ε m ρ
/// ```
/// n the pairs found, m events of one device, ρ what else the other noticed about these per second, ε the tolerance, M the offsets and drifts that differ by it.
fn by_chance(clock: &Clock, [device_s, reference_s]: [&[f64]; 2]) -> f64 {
    let there: Vec<f64> = device_s.iter().map(|t| clock.reference_s(*t)).collect();
    let expected = |few: &[f64], others: &[f64]| {
        let (mut about_s, mut end_s) = (0.0, f64::MIN);
        let mut count = 0;
        for t in few {
            let (from, to) = ((t - ABOUT_S).max(end_s), t + ABOUT_S);
            about_s += to - from;
            count += others.partition_point(|o| *o < to) - others.partition_point(|o| *o < from);
            end_s = to;
        }
        let else_per_s = count.saturating_sub(clock.points) as f64 / f64::max(about_s, ABOUT_S);
        2.0 * TOLERANCE_S * few.len() as f64 * else_per_s
    };
    let mean = expected(&there, reference_s).max(expected(reference_s, &there));
    // P(N ≥ n) of a Poisson distribution of mean λ is P(χ²_2n ≤ 2λ).
    let tail = chi_square_cdf(2.0 * mean, 2.0 * clock.points as f64);
    let span_s = |t: &[f64]| t.last().unwrap_or(&0.0) - t.first().unwrap_or(&0.0);
    let offsets = (SEARCH_S / TOLERANCE_S).min((device_s.len() * reference_s.len()) as f64);
    let drifts = 1.0 + MOST_DRIFT * span_s(device_s) / TOLERANCE_S;
    offsets * drifts * tail
}

/// Taps that a sensor felt, s.
fn felt(track: &Track) -> Vec<f64> {
    taps(&track.t_s, &track.accel_m_per_s2)
}

/// Lengths of vectors.
fn norms(vectors: &[[f64; 3]]) -> Vec<f64> {
    let length = |v: &[f64; 3]| nalgebra::Vector3::from(*v).norm();
    vectors.iter().map(length).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body that turns without repeating itself, seen by a clock that is ahead by `ahead_s` at 30 s and fast by `fast_ppm`.
    fn seen(ahead_s: f64, fast_ppm: f64, turned: bool) -> Track {
        let mut track = Track::default();
        for k in 0..6000 {
            let t = f64::from(k) * 0.01;
            let roll = (2.0 * t).sin() + 0.7 * (3.3 * t + (0.21 * t).sin() * 2.0).sin();
            let pitch = 0.5 * (0.37 * t * t.sqrt()).cos();
            track.t_s.push(t + ahead_s + 1e-6 * fast_ppm * (t - 30.0));
            track.gyro_rad_per_s.push(if turned {
                [pitch, 0.0, -roll]
            } else {
                [roll, pitch, 0.0]
            });
            track.accel_m_per_s2.push([0.0, 0.0, 9.8]);
        }
        track
    }

    #[test]
    fn a_drift_that_rounds_to_none_has_no_sign() {
        let clock = Clock {
            offset_s: 0.0,
            offset_sd_s: 0.0015,
            drift_ppm: 0.0,
            drift_sd_ppm: Some(10.7),
            at_s: 0.0,
            points: 9,
        };
        let said = |fast_ppm| Clocks::default().against(&clock, [-3.0638, fast_ppm]);
        assert!(
            said(-0.2).ends_with(" and +0 ± 21 ppm fast"),
            "{}",
            said(-0.2)
        );
        assert!(said(-17.4).ends_with(" and -17 ± 21 ppm fast"));
    }

    /// Four taps in silence set a clock; four that are found among talk and drums of four onsets a second do not.
    #[test]
    fn what_chance_pairs_as_often_sets_no_clock() {
        let taps_s = [3.0, 3.7, 5.1, 5.5];
        let mut random = crate::random::Random(5);
        let mut dense: Vec<f64> = (0..240).map(|_| 60.0 * random.uniform()).collect();
        dense.extend(taps_s);
        dense.sort_by(f64::total_cmp);
        let walk = (0..100).map(|k| 20.0 + 0.47 * f64::from(k));
        let silent: Vec<f64> = taps_s.into_iter().chain(walk).collect();
        for (onsets_s, set) in [(silent, true), (dense, false)] {
            let clock = Clock {
                offset_s: 0.0,
                offset_sd_s: 1e-3,
                drift_ppm: 0.0,
                drift_sd_ppm: None,
                at_s: 0.0,
                points: 4,
            };
            let p = by_chance(&clock, [&taps_s, &onsets_s]);
            assert_eq!(p < MOST_BY_CHANCE, set, "{p}");
            // Whichever of the two is called the device.
            let p = by_chance(&clock, [&onsets_s, &taps_s]);
            assert_eq!(p < MOST_BY_CHANCE, set, "{p}");
        }
    }

    #[test]
    fn taps_are_no_beats() {
        let left = |tap_s: &[f64]| {
            let clocks = Clocks {
                tap_s: tap_s.to_vec(),
                ..Clocks::default()
            };
            let mut beat_s = vec![1.0, 1.6, 2.4, 10.0, 10.5, 11.0, 30.0, 30.8, 31.1];
            let begins_s = beat_s.clone();
            clocks.leave_taps_out(&begins_s, &mut beat_s);
            beat_s
        };
        assert_eq!(left(&[1.0, 1.6, 2.4, 30.0, 30.8, 31.1]), [10.0, 10.5, 11.0]);
        assert_eq!(left(&[1.0, 1.6, 2.4])[0], 10.0);
        assert_eq!(left(&[30.0, 30.8, 31.1]).last(), Some(&11.0));
        assert_eq!(left(&[]).len(), 9);
        // Beats are carried on into silence.
        let (clocks, mut beat_s) = (Clocks::default(), vec![8.0, 9.0, 10.0, 11.0, 12.0, 13.0]);
        clocks.leave_taps_out(&[1.0, 10.02, 11.98], &mut beat_s);
        assert_eq!(beat_s, [10.0, 11.0, 12.0]);
    }

    #[test]
    fn sensors_on_one_body_tell_each_others_clocks() {
        let mut clocks = Clocks::of_rath("/imu/rath", &seen(0.0, 0.0, false), false);
        clocks.hold_against("/imu/rath_2", &seen(0.12, 80.0, true));
        let mut still = seen(0.0, 0.0, false);
        still.gyro_rad_per_s.fill([0.0; 3]);
        clocks.hold_against("/imu/pole", &still);
        let [first, second] = &clocks.remarks[..] else {
            panic!("{:?}", clocks.remarks)
        };
        let numbers: Vec<f64> = first
            .text
            .split_whitespace()
            .filter_map(|word| word.parse().ok())
            .collect();
        assert_eq!(first.kind, "clock_offset");
        assert!((numbers[0] - 120.0).abs() < 1.0, "{}", first.text);
        assert!((numbers[2] - 80.0).abs() < 10.0, "{}", first.text);
        assert_eq!(second.kind, "turns_otherwise", "{}", second.text);
        assert!(clocks.set.is_empty());
    }
}

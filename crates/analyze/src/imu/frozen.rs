//! Where a sensor gives the same reading again and again while the other one of the same device tells of motion: its driver has stopped, a wire
//! is off, a logger writes the last value it has.

use super::track::{Instrument, Track};

/// So long, s, and so many samples.
const LEAST_S: f64 = 1.0;
const LEAST_SAMPLES: usize = 20;
/// What the other sensor's readings range over meanwhile, in its unit: more than a coarse sensor's last digit, and than anybody who stands still.
const fn moves(of: Instrument) -> f64 {
    match of {
        Instrument::Gyroscope => 0.2,
        Instrument::Accelerometer => 1.0,
    }
}
/// A fine sensor's axis takes so many values.
const FINE: usize = 100;

/// A sensor that stood still in moving hands.
#[derive(Clone, Debug, PartialEq)]
pub struct Frozen {
    /// What did.
    pub instrument: Instrument,
    /// The axis, if it is one alone, for all the time.
    pub axis: Option<usize>,
    /// Which samples, ascending.
    pub samples: Vec<usize>,
}

impl Frozen {
    /// One line for people.
    pub fn told(&self, all: usize) -> String {
        let what = self.instrument.name();
        match self.axis {
            Some(axis) => format!(
                "the {what}'s {} never changes while its other axes do: if that is no made-up motion, this axis is dead",
                ["x", "y", "z"][axis]
            ),
            None => format!(
                "the {what} gives one reading for a second or more while the device moves, in {} of {all} samples: no interval knows of it",
                self.samples.len()
            ),
        }
    }
}

/// What of a track is frozen.
pub fn frozen(track: &Track) -> Vec<Frozen> {
    let mut out = Vec::new();
    for instrument in Instrument::BOTH {
        let (own, other) = (track.readings(instrument), instrument.other());
        let moved = |run: &std::ops::Range<usize>| {
            let ranges = ranges(&track.readings(other)[run.clone()]);
            ranges.iter().any(|range| *range > moves(other))
        };
        let samples: Vec<usize> = runs(own)
            .filter(|run| run.len() >= LEAST_SAMPLES)
            .filter(|run| track.t_s[run.end - 1] - track.t_s[run.start] >= LEAST_S)
            .filter(moved)
            .flatten()
            .collect();
        if !samples.is_empty() {
            out.push(Frozen {
                instrument,
                axis: None,
                samples,
            });
        } else if let Some(axis) = dead_axis(own, moves(instrument)) {
            out.push(Frozen {
                instrument,
                axis: Some(axis),
                samples: (0..track.len()).collect(),
            });
        }
    }
    out
}

/// Stretches of equal readings.
pub(super) fn runs(readings: &[[f64; 3]]) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
    let mut start = 0;
    readings.chunk_by(|a, b| a == b).map(move |run| {
        let range = start..start + run.len();
        start = range.end;
        range
    })
}

/// How much a reading ranges over, axis by axis.
fn ranges(readings: &[[f64; 3]]) -> [f64; 3] {
    [0, 1, 2].map(|axis| {
        let each = readings.iter().map(|r| r[axis]);
        each.clone().fold(f64::MIN, f64::max) - each.fold(f64::MAX, f64::min)
    })
}

/// The one axis that never changes, where both others do by more than `least`, in many steps: what a coarse sensor's axis feels may be less than its
/// last digit.
fn dead_axis(readings: &[[f64; 3]], least: f64) -> Option<usize> {
    let ranges = ranges(readings);
    let axis = ranges.iter().position(|range| *range == 0.0)?;
    let steps = |axis: usize| {
        let mut values: Vec<f64> = readings.iter().map(|r| r[axis]).collect();
        values.sort_unstable_by(f64::total_cmp);
        values.dedup();
        values.len()
    };
    let mut others = (0..3).filter(|other| *other != axis);
    let alive = others.all(|other| ranges[other] > least && steps(other) >= FINE);
    alive.then_some(axis)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sway with some noise, read to so many digits.
    fn swaying(quantum: f64) -> Track {
        let mut track = Track::default();
        for k in 0..2000 {
            let t = 0.01 * f64::from(k);
            let noise = |n: u32| 0.01 * (f64::from(k * (7919 + n)) * 0.7).sin();
            let read = |x: f64| (x / quantum).round() * quantum;
            let swing = (6.9 * t).sin();
            track.t_s.push(t);
            track
                .gyro_rad_per_s
                .push([0.5 * swing + noise(1), 0.2 * swing + noise(2), noise(3)].map(read));
            track.accel_m_per_s2.push(
                [
                    swing + noise(4),
                    0.3 * swing + noise(5),
                    9.8 + swing + noise(6),
                ]
                .map(read),
            );
        }
        track
    }

    #[test]
    fn a_sensor_that_stops_is_seen_and_one_that_works_is_not() {
        for quantum in [1e-6, 0.01, 0.1] {
            let sound = swaying(quantum);
            assert!(frozen(&sound).is_empty(), "{quantum}");
            let mut stopped = sound.clone();
            let last = stopped.accel_m_per_s2[700];
            stopped.accel_m_per_s2[700..].fill(last);
            let found = frozen(&stopped);
            assert_eq!(found.len(), 1);
            assert!(found[0].instrument == Instrument::Accelerometer && found[0].axis.is_none());
            assert_eq!(found[0].samples.last(), Some(&1999));
            assert!(found[0].samples[0].abs_diff(700) < 3, "{quantum}");
            let mut silent = sound.clone();
            silent.gyro_rad_per_s.fill([0.0; 3]);
            assert_eq!(frozen(&silent)[0].samples.len(), 2000);
            assert_eq!(frozen(&silent)[0].instrument, Instrument::Gyroscope);
        }
    }

    #[test]
    fn an_axis_that_is_dead_is_seen() {
        let mut dead = swaying(0.001);
        dead.gyro_rad_per_s.iter_mut().for_each(|w| w[2] = 0.013);
        let found = frozen(&dead);
        assert_eq!(found.len(), 1);
        let found = (found[0].instrument, found[0].axis);
        assert_eq!(found, (Instrument::Gyroscope, Some(2)));
    }

    #[test]
    fn rest_is_not_frozen() {
        let mut track = swaying(0.05);
        for k in 500..1500 {
            track.gyro_rad_per_s[k] = [0.0; 3];
            track.accel_m_per_s2[k] = [0.0, 0.0, 9.8];
        }
        assert!(frozen(&track).is_empty());
    }

    /// A second counts, a shorter stop does not, late in a recording too.
    #[test]
    fn a_stop_of_less_than_a_second_is_none() {
        for (samples, is_frozen) in [(60, false), (99, false), (102, true)] {
            let mut track = swaying(1e-6);
            let last = track.gyro_rad_per_s[1500];
            track.gyro_rad_per_s[1500..1500 + samples].fill(last);
            assert_eq!(!frozen(&track).is_empty(), is_frozen, "{samples}");
        }
    }
}

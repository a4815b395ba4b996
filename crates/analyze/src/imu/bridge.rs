//! Short holes in a sensor's samples, drawn through: a radio loses a few samples at a time, and a tilt that began anew behind each hole, without height
//! near it, would leave nothing of a minute.
//!
//! Each axis goes on as the samples beside the hole let expect (linear prediction, `holes.rs`). What that may be wrong by is measured: as many samples are left out
//! half way between two holes as the hole has, and drawn likewise. The motion is estimated once more with those holes too, and what changes by that is what the
//! holes that are there may have changed.

use super::track::Track;
use crate::holes::{fill, memory};
use std::ops::Range;

/// The longest hole that is drawn through, s.
pub const LONGEST_S: f64 = 0.3;
/// A prediction rests on so much beside a hole, s, and on no more samples.
const MEMORY_S: f64 = 0.4;
const MEMORY: usize = 128;

/// A track without holes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawn {
    /// Its samples, measured and drawn.
    pub track: Track,
    /// How far each acceleration may be off, m/s²: 0 where it was measured. As of errors without memory: √n times that of an error that holds through n samples.
    pub unsure_m_per_s2: Vec<f64>,
}

impl Drawn {
    /// Nothing of it is drawn.
    pub fn measured(track: Track) -> Self {
        let unsure_m_per_s2 = vec![0.0; track.len()];
        Self {
            track,
            unsure_m_per_s2,
        }
    }

    /// These samples and, behind them, later ones.
    pub fn append(&mut self, mut later: Self) {
        self.track.append(later.track);
        self.unsure_m_per_s2.append(&mut later.unsure_m_per_s2);
    }
}

/// An evenly sampled track drawn through its `holes`, which ascend, and the same with as many holes again. `None` where they lie so close that nothing tells
/// how well.
pub fn bridge(track: &Track, holes: &[Range<usize>], period_s: f64) -> Option<[Drawn; 2]> {
    let probes = probes(holes, track.len());
    if probes.is_empty() {
        return None;
    }
    let mut both: Vec<Range<usize>> = holes.iter().chain(&probes).cloned().collect();
    both.sort_unstable_by_key(|r| r.start);
    let samples = memory(MEMORY_S, period_s, MEMORY);
    let [mut once, mut twice] = [track.clone(), track.clone()];
    for axis in 0..3 {
        draw(&mut once.gyro_rad_per_s, axis, holes, samples);
        draw(&mut once.accel_m_per_s2, axis, holes, samples);
        draw(&mut twice.gyro_rad_per_s, axis, &both, samples);
        draw(&mut twice.accel_m_per_s2, axis, &both, samples);
    }
    let off = off(&probes, &once.accel_m_per_s2, &twice.accel_m_per_s2);
    let unsure = |holes: &[Range<usize>]| {
        let mut out = vec![0.0; track.len()];
        for hole in holes {
            out[hole.clone()].fill(off * (hole.len() as f64).sqrt());
        }
        out
    };
    Some([
        Drawn {
            unsure_m_per_s2: unsure(holes),
            track: once,
        },
        Drawn {
            unsure_m_per_s2: unsure(&both),
            track: twice,
        },
    ])
}

fn draw(readings: &mut [[f64; 3]], axis: usize, holes: &[Range<usize>], samples: usize) {
    let mean = readings.iter().map(|v| v[axis]).sum::<f64>() / readings.len() as f64;
    let mut about: Vec<f64> = readings.iter().map(|v| v[axis] - mean).collect();
    fill(&mut about, holes, samples);
    for k in holes.iter().cloned().flatten() {
        readings[k][axis] = mean + about[k];
    }
}

/// By how much what is drawn is off, RMS of what the probes make of their integrals, along the worst axis.
fn off(probes: &[Range<usize>], measured: &[[f64; 3]], drawn: &[[f64; 3]]) -> f64 {
    let lengths: usize = probes.iter().map(|r| r.len().pow(2)).sum();
    let along = |axis: usize| -> f64 {
        let sum = |r: &Range<usize>| r.clone().map(|k| drawn[k][axis] - measured[k][axis]).sum();
        let squares = probes.iter().map(|r| f64::powi(sum(r), 2));
        squares.sum::<f64>() / lengths as f64
    };
    (0..3).map(along).fold(0.0, f64::max).sqrt()
}

/// As long as each hole, half way to the next one or the end, where as much is left on both sides.
fn probes(holes: &[Range<usize>], len: usize) -> Vec<Range<usize>> {
    let next = holes.iter().skip(1).map(|r| r.start).chain([len]);
    let between = holes.iter().zip(next).filter_map(|(hole, next)| {
        let room = next - hole.end;
        let begin = hole.end + room.saturating_sub(hole.len()) / 2;
        (room >= 3 * hole.len()).then(|| begin..begin + hole.len())
    });
    between.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use std::f64::consts::TAU;

    const PERIOD_S: f64 = 0.01;

    fn track(reading: impl Fn(usize) -> [[f64; 3]; 2]) -> Track {
        let mut track = Track::default();
        for k in 0..2000 {
            let [gyro, accel] = reading(k);
            track.t_s.push(PERIOD_S * k as f64);
            track.gyro_rad_per_s.push(gyro);
            track.accel_m_per_s2.push(accel);
        }
        track
    }

    /// A hole of `len` samples every two seconds.
    fn every_two_seconds(len: usize) -> Vec<Range<usize>> {
        (1..10).map(|k| 200 * k..200 * k + len).collect()
    }

    #[test]
    fn as_many_again_lie_half_way_where_there_is_room() {
        // Nine samples behind three lost ones are room for three more, five behind two are too few for two.
        let found = probes(&[10..13, 22..24, 29..30], 40);
        assert_eq!(found, [16..19, 34..35]);
    }

    /// Swings about gravity and a turn go on through holes; what was measured stays as it is and is sure.
    #[test]
    fn a_motion_goes_on_through_holes() {
        let swing = |k: usize, hz: f64| (TAU * hz * PERIOD_S * k as f64).sin();
        let truth = track(|k| {
            [
                [0.5 + swing(k, 1.1), 0.0, 0.1 * swing(k, 2.2)],
                [0.3 * swing(k, 1.1), -1.0, 9.81 + 4.0 * swing(k, 2.2)],
            ]
        });
        let holes = every_two_seconds(8);
        let lost = |k: usize| holes.iter().any(|h| h.contains(&k));
        let mut holed = truth.clone();
        for k in (0..holed.len()).filter(|k| lost(*k)) {
            holed.gyro_rad_per_s[k] = [7.0; 3];
            holed.accel_m_per_s2[k] = [7.0; 3];
        }
        let [once, twice] = bridge(&holed, &holes, PERIOD_S).unwrap();
        for drawn in [&once, &twice] {
            let both = [
                (&drawn.track.gyro_rad_per_s, &truth.gyro_rad_per_s),
                (&drawn.track.accel_m_per_s2, &truth.accel_m_per_s2),
            ];
            for (found, truth) in both {
                for (found, truth) in found.iter().flatten().zip(truth.iter().flatten()) {
                    assert!((found - truth).abs() < 0.02, "{found} {truth}");
                }
            }
            assert!(drawn.unsure_m_per_s2.iter().all(|u| *u < 0.05));
        }
        for k in (0..truth.len()).filter(|k| !lost(*k)) {
            let same = once.track.accel_m_per_s2[k] == truth.accel_m_per_s2[k];
            assert!(same && once.unsure_m_per_s2[k] == 0.0);
        }
        assert!(once.unsure_m_per_s2[200] > 0.0 && twice.unsure_m_per_s2[300] > 0.0);
    }

    /// Nothing is told of white noise of deviation σ but its mean: each sample is off by σ, and errors without memory are σ.
    #[test]
    fn of_noise_nothing_is_known() {
        let noise = |seed: u64, sd: f64| {
            let mut random = Random(seed);
            (0..2000)
                .map(|_| sd * random.normal())
                .collect::<Vec<f64>>()
        };
        let [x, y, z] = [(1, 0.1), (2, 0.7), (3, 0.2)].map(|(seed, sd)| noise(seed, sd));
        let track = track(|k| [[0.0; 3], [5.0 + x[k], y[k], 9.8 + z[k]]]);
        let mut squares = 0.0;
        let lengths = [2, 4, 8];
        for len in lengths {
            let holes = every_two_seconds(len);
            let [once, _] = bridge(&track, &holes, PERIOD_S).unwrap();
            squares += once.unsure_m_per_s2[200].powi(2) / lengths.len() as f64;
        }
        // Of 27 probes: 14 %, twice.
        assert!((squares.sqrt() / 0.7 - 1.0).abs() < 0.28, "{squares}");
    }

    #[test]
    fn where_nothing_tells_how_well_nothing_is_drawn() {
        let track = track(|_| [[0.0; 3], [0.0, 0.0, 9.8]]);
        let crowded: Vec<_> = (1..100).map(|k| 20 * k..20 * k + 9).collect();
        assert!(bridge(&track, &crowded, PERIOD_S).is_none());
        assert!(bridge(&track, &crowded[50..51], PERIOD_S).is_some());
    }
}

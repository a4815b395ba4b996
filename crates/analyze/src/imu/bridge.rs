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
pub const LONGEST_S: f64 = 0.1;
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

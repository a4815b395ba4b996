//! What is kept of a run to compare it: roll, height, forces, and the figures that people quote.

use crate::run::Sample;
use crate::scene::Scene;
use std::f64::consts::TAU;

/// T_float counts samples whose summed force is at most this part of the weight.
const FLOATING: f64 = 0.05;
/// An onset is a stretch of so long, s, with an RMS roll above [`ONSET_RAD`].
const ONSET_S: f64 = 2.0;
const ONSET_RAD: f64 = 10.0 * std::f64::consts::PI / 180.0;
/// A roll that stays below this is none, rad.
const NO_ROLL_RAD: f64 = 1e-9;

/// What people quote about a run, over its analysis window; defined in docs/metrics.md.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quoted {
    /// Root mean square of the roll about zero, rad.
    pub rms_roll_rad: f64,
    /// Mean over handles of the part of samples with N ≤ 0, 1.
    pub contact_loss: f64,
    /// End of the first 2 s with an RMS roll above 10°, s.
    pub onset_s: Option<f64>,
    /// Part of samples whose summed force is at most 5 % of the weight, 1.
    pub t_float: f64,
}

/// Largest differences between two courses.
pub(super) struct Errors {
    pub roll_rad: f64,
    pub height_m: f64,
    pub normal_n: f64,
}

impl Errors {
    /// Of a run that did not reach its end.
    pub const UNKNOWN: Self = Self {
        roll_rad: f64::INFINITY,
        height_m: f64::INFINITY,
        normal_n: f64::INFINITY,
    };
}

/// The samples of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct Course {
    t_s: Vec<f64>,
    roll_rad: Vec<f64>,
    height_m: Vec<f64>,
    /// Handle after handle of each sample.
    normal_n: Vec<f64>,
    unexplained_j: f64,
    throughput_j: f64,
}

/// Roll is an angle: a whole turn is no difference.
fn turned(a: f64, b: f64) -> f64 {
    let d = a - b;
    (d - TAU * (d / TAU).round()).abs()
}

fn worst(a: &[f64], b: &[f64], difference: impl Fn(f64, f64) -> f64) -> f64 {
    a.iter()
        .zip(b)
        .map(|(x, y)| difference(*x, *y))
        .fold(0.0, f64::max)
}

impl Course {
    pub fn push(&mut self, s: &Sample) {
        self.t_s.push(s.t_s);
        self.roll_rad.push(s.pose.roll_pitch_yaw_rad()[0]);
        self.height_m.push(s.pose.position_m[2]);
        self.normal_n.extend_from_slice(&s.normal_n);
        if let Some(e) = &s.energy {
            self.unexplained_j = self.unexplained_j.max(e.unexplained_j.abs());
            // What a body at rest holds counts as well: nothing goes through it.
            let held_j = e.kinetic_j + e.elastic_j.abs();
            let throughput_j = e.work_in_j.abs() + e.dissipated_j.abs() + held_j;
            self.throughput_j = self.throughput_j.max(throughput_j);
        }
    }

    /// When the sample before `until` was taken, s.
    pub fn time(&self, until: usize) -> f64 {
        self.t_s[until - 1]
    }

    /// Whether there is a roll to speak of.
    pub fn rolls(&self) -> bool {
        self.roll_rad.iter().any(|r| r.abs() > NO_ROLL_RAD)
    }

    /// Unexplained energy over the throughput, 1.
    pub fn unexplained(&self) -> Option<f64> {
        (self.throughput_j > 0.0).then(|| self.unexplained_j / self.throughput_j)
    }

    /// How many samples from the start agree with those of `other` to `within` in roll and height; at least one, the start.
    pub fn agrees_with(&self, other: &Self, within: f64) -> usize {
        let apart = (0..self.t_s.len()).position(|i| {
            !(turned(self.roll_rad[i], other.roll_rad[i]) <= within
                && (self.height_m[i] - other.height_m[i]).abs() <= within)
        });
        apart.unwrap_or(self.t_s.len()).max(1)
    }

    /// The largest differences over the first `until` samples; both have them all.
    pub fn errors(&self, other: &Self, until: usize) -> Errors {
        let handles = self.normal_n.len() / self.t_s.len();
        let plain = |x: f64, y: f64| (x - y).abs();
        Errors {
            roll_rad: worst(&self.roll_rad[..until], &other.roll_rad, turned),
            height_m: worst(&self.height_m[..until], &other.height_m, plain),
            normal_n: worst(&self.normal_n[..until * handles], &other.normal_n, plain),
        }
    }

    /// How many samples there are.
    pub fn samples(&self) -> usize {
        self.t_s.len()
    }

    /// What people quote, over the scene's analysis; over all of a run that ends before it would begin, as `analyze` does.
    pub fn quoted(&self, scene: &Scene) -> Quoted {
        let from = match self
            .t_s
            .partition_point(|&t| t < scene.analysis_start_s - 1e-9)
        {
            from if from == self.t_s.len() => 0,
            from => from,
        };
        let n = scene.carriers.count();
        let (t, roll, force) = (
            &self.t_s[from..],
            &self.roll_rad[from..],
            &self.normal_n[from * n..],
        );
        if t.is_empty() {
            return Quoted::default();
        }
        let count = t.len() as f64;
        let mean_square = |r: &[f64]| r.iter().map(|x| x * x).sum::<f64>() / r.len() as f64;
        let gravity = scene.body.gravity_m_per_s2;
        let weight = scene.body.mass_kg * gravity.iter().map(|x| x * x).sum::<f64>().sqrt();
        let window = ((ONSET_S * scene.log_rate_hz).round() as usize).max(1);
        let onset = roll
            .windows(window)
            .position(|w| mean_square(w).sqrt() > ONSET_RAD);
        let floats = |f: &&[f64]| f.iter().sum::<f64>() <= FLOATING * weight;
        Quoted {
            rms_roll_rad: mean_square(roll).sqrt(),
            contact_loss: force.iter().filter(|&&f| f <= 0.0).count() as f64 / force.len() as f64,
            onset_s: onset.map(|i| t[i + window - 1]),
            t_float: force.chunks_exact(n).filter(floats).count() as f64 / count,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::parse;

    /// A second at 10 Hz: the roll is 0.1 rad, and from half a second on 0.3 rad without forces.
    fn course() -> Course {
        let late = |i: usize| i >= 5;
        Course {
            t_s: (0..10).map(|i| 0.1 * i as f64).collect(),
            roll_rad: (0..10).map(|i| if late(i) { 0.3 } else { 0.1 }).collect(),
            height_m: vec![1.0; 10],
            normal_n: (0..20)
                .map(|i| if late(i / 2) { 0.0 } else { 300.0 })
                .collect(),
            ..Course::default()
        }
    }

    #[test]
    fn what_is_quoted_is_what_the_samples_say() {
        let scene = parse("t", "name = \"t\"\nlog_rate_hz = 1.0\n", &[]).unwrap();
        let q = course().quoted(&scene);
        assert!((q.rms_roll_rad - 0.05f64.sqrt()).abs() < 1e-15);
        assert_eq!((q.contact_loss, q.t_float), (0.5, 0.5));
        // A window is two samples: the first with an RMS above 10° ends with the first large one.
        assert_eq!(q.onset_s, Some(0.5));
        // Nothing lies after 3 s: all of it counts.
        let late = "name = \"t\"\nlog_rate_hz = 1.0\nanalysis_start_s = 3.0\n";
        let all = course().quoted(&parse("t", late, &[]).unwrap());
        assert_eq!(all.rms_roll_rad, q.rms_roll_rad);
    }

    #[test]
    fn a_whole_turn_is_no_difference_and_courses_part_where_they_part() {
        let (a, mut b) = (course(), course());
        b.roll_rad[3] += TAU;
        assert_eq!(a.agrees_with(&b, 1e-9), 10);
        assert!(a.errors(&b, 10).roll_rad < 1e-15);
        b.height_m[7] += 1e-3;
        assert_eq!(a.agrees_with(&b, 1e-6), 7);
        assert_eq!(a.errors(&b, 7).height_m, 0.0);
        assert!((a.errors(&b, 10).height_m - 1e-3).abs() < 1e-15);
    }
}

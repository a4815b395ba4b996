//! What is kept of a run to compare it: its motion, forces, and the figures that people quote.

use crate::freedoms::nearest_turn;
use crate::run::Sample;
use crate::scene::Scene;
use nalgebra::{Quaternion, UnitQuaternion};

/// T_float counts samples whose summed force is at most this part of the weight.
const FLOATING: f64 = 0.05;
/// An onset is a stretch of so long, s, with an RMS roll above [`ONSET_RAD`].
const ONSET_S: f64 = 2.0;
const ONSET_RAD: f64 = 10.0 * std::f64::consts::PI / 180.0;
/// A coordinate that stays within this of where it began does not move, rad or m.
const NO_MOTION: f64 = 1e-9;
/// Nobody asks for a percent of an x, y, pitch or yaw that stays within this, m or rad.
const NO_SWAY: f64 = 1e-4;

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
    /// x, y (m), pitch and yaw (rad).
    pub others: [f64; 4],
}

impl Errors {
    /// Of a run that did not reach its end.
    pub const UNKNOWN: Self = Self {
        roll_rad: f64::INFINITY,
        height_m: f64::INFINITY,
        normal_n: f64::INFINITY,
        others: [f64::INFINITY; 4],
    };

    /// The largest of x, y, pitch and yaw, m or rad.
    pub fn other(&self) -> f64 {
        self.others.into_iter().fold(0.0, f64::max)
    }
}

/// The samples of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct Course {
    t_s: Vec<f64>,
    roll_rad: Vec<f64>,
    height_m: Vec<f64>,
    /// x and y.
    place_m: Vec<[f64; 2]>,
    orientation: Vec<UnitQuaternion<f64>>,
    /// Handle after handle of each sample.
    normal_n: Vec<f64>,
    unexplained_j: f64,
    throughput_j: f64,
}

/// Roll is an angle: a whole turn is no difference.
fn turned(a: f64, b: f64) -> f64 {
    nearest_turn(a - b, 0.0).abs()
}

/// By how much two orientations differ about the body's y and z axes, rad: pitch and yaw, which have no pole so.
fn aside(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> [f64; 2] {
    let turn = (a.inverse() * b).scaled_axis();
    [turn.y.abs(), turn.z.abs()]
}

/// The largest error of x, y, pitch or yaw in parts of how far it goes; none where none goes far.
pub(super) fn part_of(others: [f64; 4], excursions: [f64; 4]) -> f64 {
    let each = others.into_iter().zip(excursions);
    let moved = each.filter(|(_, most)| *most > NO_SWAY);
    moved.map(|(error, most)| error / most).fold(0.0, f64::max)
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
        let ([x, y, z], [i, j, k, w]) = (s.pose.position_m, s.pose.orientation);
        self.height_m.push(z);
        self.place_m.push([x, y]);
        let orientation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
        self.orientation.push(orientation);
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

    /// Whether there is a roll to speak of: one that is held is none, wherever it is held.
    pub fn rolls(&self) -> bool {
        let first = self.roll_rad[0];
        self.roll_rad.iter().any(|r| turned(*r, first) > NO_MOTION)
    }

    /// Whether the height changes.
    pub fn heaves(&self) -> bool {
        let first = self.height_m[0];
        self.height_m.iter().any(|z| (z - first).abs() > NO_MOTION)
    }

    /// How far x, y (m), pitch and yaw (rad) go from where they began, beside a walk (m/s).
    pub fn excursions(&self, walk_m_per_s: [f64; 3]) -> [f64; 4] {
        let mut most = [0.0f64; 4];
        for i in 0..self.t_s.len() {
            let walked = |axis: usize| walk_m_per_s[axis] * (self.t_s[i] - self.t_s[0]);
            let moved = |axis: usize| self.place_m[i][axis] - self.place_m[0][axis] - walked(axis);
            let [pitch, yaw] = aside(&self.orientation[0], &self.orientation[i]);
            let gone = [moved(0).abs(), moved(1).abs(), pitch, yaw];
            for (most, gone) in most.iter_mut().zip(gone) {
                *most = most.max(gone);
            }
        }
        most
    }

    /// How far x, y (m), pitch and yaw (rad) of sample `i` are apart.
    fn others_apart(&self, other: &Self, i: usize) -> [f64; 4] {
        let place = |axis: usize| (self.place_m[i][axis] - other.place_m[i][axis]).abs();
        let [pitch, yaw] = aside(&self.orientation[i], &other.orientation[i]);
        [place(0), place(1), pitch, yaw]
    }

    /// Unexplained energy over the throughput, 1.
    pub fn unexplained(&self) -> Option<f64> {
        (self.throughput_j > 0.0).then(|| self.unexplained_j / self.throughput_j)
    }

    /// How many samples from the start agree with those of `other` to `within` in every coordinate; at least one, the start.
    pub fn agrees_with(&self, other: &Self, within: f64) -> usize {
        let apart = (0..self.t_s.len()).position(|i| {
            !(turned(self.roll_rad[i], other.roll_rad[i]) <= within
                && (self.height_m[i] - other.height_m[i]).abs() <= within
                && self.others_apart(other, i).iter().all(|x| *x <= within))
        });
        apart.unwrap_or(self.t_s.len()).max(1)
    }

    /// The largest differences over the first `until` samples; both have them all.
    pub fn errors(&self, other: &Self, until: usize) -> Errors {
        let handles = self.normal_n.len() / self.t_s.len();
        let plain = |x: f64, y: f64| (x - y).abs();
        let mut others = [0.0f64; 4];
        for i in 0..until {
            for (most, apart) in others.iter_mut().zip(self.others_apart(other, i)) {
                *most = most.max(apart);
            }
        }
        Errors {
            others,
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
            place_m: vec![[0.0; 2]; 10],
            orientation: vec![UnitQuaternion::identity(); 10],
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
        b.roll_rad[3] += std::f64::consts::TAU;
        assert_eq!(a.agrees_with(&b, 1e-9), 10);
        assert!(a.errors(&b, 10).roll_rad < 1e-15);
        b.height_m[7] += 1e-3;
        assert_eq!(a.agrees_with(&b, 1e-6), 7);
        assert_eq!(a.errors(&b, 7).height_m, 0.0);
        assert!((a.errors(&b, 10).height_m - 1e-3).abs() < 1e-15);
        b.place_m[5][1] = 2e-3;
        b.orientation[6] = UnitQuaternion::from_euler_angles(0.0, 0.0, 4e-3);
        assert_eq!(a.agrees_with(&b, 1e-6), 5);
        let errors = a.errors(&b, 10);
        assert!((errors.other() - 4e-3).abs() < 1e-15, "{:?}", errors.others);
        // A half of y, and all of a yaw that goes 4 mrad; what stays within a tenth of a millimetre does not count.
        let went = [1e-5, 4e-3, 0.0, 4e-3];
        assert!((part_of(errors.others, went) - 1.0).abs() < 1e-12);
        assert!((part_of([1e-5, 2e-3, 0.0, 0.0], went) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn what_is_held_does_not_move_and_a_walk_is_no_excursion() {
        let (mut a, walk) = (course(), [0.5, 0.0, 0.0]);
        assert!(a.rolls() && !a.heaves());
        a.roll_rad.fill(0.1);
        a.height_m[9] = 1.1;
        assert!(!a.rolls() && a.heaves());
        for i in 0..10 {
            a.place_m[i] = [0.5 * a.t_s[i], 0.0];
        }
        a.orientation[3] = UnitQuaternion::from_euler_angles(0.0, -0.2, 0.0);
        let went = a.excursions(walk);
        let expected = [0.0, 0.0, 0.2, 0.0];
        assert!(
            (0..4).all(|k| (went[k] - expected[k]).abs() < 1e-12),
            "{went:?}"
        );
    }
}

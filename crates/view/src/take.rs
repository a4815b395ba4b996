//! What there is to draw: columns on the time axes of their topics, and what the scene says about the things carried.

use analyze::events::Event;
use analyze::{Inputs, Metrics, Window};

/// Everything that is drawn of one recording. What is not known is empty or `None`, and is then not drawn.
#[derive(Clone, Debug)]
pub struct Take {
    /// What it is called.
    pub name: String,
    /// Log time of the first message, ns.
    pub start_ns: i64,
    /// Log time of the last message, ns.
    pub end_ns: i64,
    /// More may come: axes cannot be fixed yet.
    pub growing: bool,
    /// The columns that `analyze` computes from.
    pub inputs: Inputs,
    /// Times of the angles, ns: what `inputs` has in seconds.
    pub state_ns: Vec<i64>,
    /// Times of the height, ns: those of the angles, unless it comes on a clock of its own.
    pub height_ns: Vec<i64>,
    /// Log times of the forces, ns.
    pub force_ns: Vec<i64>,
    /// Sideways force on the body at each handle, x and y of the world, N, at the times of the forces; empty where that is not recorded.
    pub tangential_n: Vec<Vec<[f64; 2]>>,
    /// How far each handle is pressed into its shoulder, m, at the times of the forces; empty where that is not recorded.
    pub compression_m: Vec<Vec<f64>>,
    /// Log times of the phases, ns.
    pub phase_ns: Vec<i64>,
    /// The window that the metrics are computed in.
    pub window: Window,
    /// The metrics.
    pub metrics: Metrics,
    /// Where the body is.
    pub pose: Option<Pose>,
    /// Where the carriers are.
    pub carriers: Option<Carriers>,
    /// Handles and body.
    pub shape: Shape,
    /// The energy ledger.
    pub energy: Option<Ledger>,
    /// Topic of the inertial sensor on the load, where one is known as that.
    pub main_imu: Option<String>,
    /// Inertial sensors, that of the load first.
    pub imus: Vec<Sensor>,
    /// Every other topic with numbers.
    pub topics: Vec<Topic>,
    /// What happened when.
    pub events: Vec<Event>,
    /// What the reader remarked, one line each with its time in seconds where it has one.
    pub remarks: Vec<(Option<f64>, String)>,
    /// What the user should know of file, analysis and drawing, in sentences.
    pub notes: Vec<String>,
}

/// Where the body is over time.
#[derive(Clone, Debug, Default)]
pub struct Pose {
    /// Log times, ns.
    pub times_ns: Vec<i64>,
    /// Centre of mass in the world, m.
    pub position_m: Vec<[f64; 3]>,
    /// Body in the world, quaternion x, y, z, w.
    pub orientation: Vec<[f64; 4]>,
}

/// What begins no farther from the world's origin is drawn about that, m: the viewer's numbers have seven digits.
const NEAR_M: f64 = 1000.0;

/// A place about another one, m.
fn about([x, y, z]: &[f64; 3], origin_m: [f64; 2]) -> [f64; 3] {
    [x - origin_m[0], y - origin_m[1], *z]
}

impl Pose {
    /// Whole metres that the body is drawn about, x and y in the world: where it begins, if that is far away. `None` where its place is never known.
    pub fn begins_m(&self) -> Option<[f64; 2]> {
        let known = |p: &&[f64; 3]| p[0].is_finite() && p[1].is_finite();
        let [x, y, _] = *self.position_m.iter().find(known)?;
        Some(match x.hypot(y) > NEAR_M {
            true => [x.round(), y.round()],
            false => [0.0; 2],
        })
    }

    /// The same about a place on the ground, m.
    pub fn about(&self, origin_m: [f64; 2]) -> Self {
        let places = self.position_m.iter();
        Pose {
            times_ns: self.times_ns.clone(),
            position_m: places.map(|p| about(p, origin_m)).collect(),
            orientation: self.orientation.clone(),
        }
    }

    /// A vector of the body (m) in the world's axes at sample `k`, for a unit quaternion: v + 2w(u × v) + 2u × (u × v).
    pub fn in_world(&self, k: usize, v: &[f64; 3]) -> [f64; 3] {
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [
                a[1] * b[2] - a[2] * b[1],
                a[2] * b[0] - a[0] * b[2],
                a[0] * b[1] - a[1] * b[0],
            ]
        };
        let [x, y, z, w] = self.orientation[k];
        let u = [x, y, z];
        let once = cross(u, *v);
        let twice = cross(u, once);
        [0, 1, 2].map(|i| v[i] + 2.0 * (w * once[i] + twice[i]))
    }

    /// The sample in force at a time: the last one not after it.
    pub fn moment(&self, t_ns: i64) -> usize {
        self.times_ns.partition_point(|p| *p <= t_ns).max(1) - 1
    }

    /// Places in the body's coordinates, m, in the world at sample `k`.
    pub fn places_in_world(&self, k: usize, places_m: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let place = self.position_m[k];
        let turned = places_m.iter().map(|v| self.in_world(k, v));
        turned
            .map(|[x, y, z]| [place[0] + x, place[1] + y, place[2] + z])
            .collect()
    }
}

/// The carriers' points over time.
#[derive(Clone, Debug, Default)]
pub struct Carriers {
    /// Log times, ns.
    pub times_ns: Vec<i64>,
    /// One path per carrier, m.
    pub points_m: Vec<Vec<[f64; 3]>>,
}

impl Carriers {
    /// The same about a place on the ground, m.
    pub fn about(&self, origin_m: [f64; 2]) -> Self {
        let moved = |points: &Vec<[f64; 3]>| points.iter().map(|p| about(p, origin_m)).collect();
        Carriers {
            times_ns: self.times_ns.clone(),
            points_m: self.points_m.iter().map(moved).collect(),
        }
    }
}

/// Where the body is held, and what it looks like.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shape {
    /// Handles in body coordinates, m.
    pub handles_m: Vec<[f64; 3]>,
    /// Box around the centre of mass, m, for the eye alone.
    pub box_m: [f64; 3],
}

/// The energy ledger.
#[derive(Clone, Debug, Default)]
pub struct Ledger {
    /// Log times, ns.
    pub times_ns: Vec<i64>,
    /// Name and values in J.
    pub columns: Vec<(&'static str, Vec<f64>)>,
}

/// One curve: its own times, because it may have been thinned.
#[derive(Clone, Debug, Default)]
pub struct Curve {
    /// What it is, as the viewer shows it.
    pub name: String,
    /// Log times, ns.
    pub times_ns: Vec<i64>,
    /// Values.
    pub values: Vec<f64>,
}

impl Curve {
    /// Whether there are points at more than one moment: one makes no curve.
    pub fn has_two(&self) -> bool {
        let points = self.times_ns.iter().zip(&self.values);
        let mut moments = points.filter(|(_, x)| x.is_finite()).map(|(t, _)| t);
        let first = moments.next();
        moments.any(|t| Some(t) != first)
    }

    /// Whether its values differ.
    pub fn changes(&self) -> bool {
        let mut values = self.values.iter().filter(|x| x.is_finite());
        let first = values.next();
        values.any(|x| Some(x) != first)
    }
}

/// An inertial sensor.
#[derive(Clone, Debug, Default)]
pub struct Sensor {
    /// Its topic.
    pub topic: String,
    /// Angular velocity, rad/s; three curves or none.
    pub gyro: Vec<Curve>,
    /// Specific force, m/s²; three curves or none.
    pub accel: Vec<Curve>,
    /// Estimated roll and pitch, deg; two curves or none.
    pub attitude: Vec<Curve>,
    /// Spectra of the angular velocity, (rad/s)²/Hz, x y z.
    pub gyro_spectra: Vec<analyze::spectrum::Spectrum>,
    /// Spectra of the specific force, (m/s²)²/Hz, x y z.
    pub accel_spectra: Vec<analyze::spectrum::Spectrum>,
}

/// A topic that is nothing in particular.
#[derive(Clone, Debug, Default)]
pub struct Topic {
    /// Its name.
    pub name: String,
    /// Curves by unit: those of one unit share a plot.
    pub plots: Vec<(String, Vec<Curve>)>,
}

/// Carriers times moments that are drawn one by one: what a viewer loads within seconds.
const MOST_PLACES: usize = 500_000;

/// Of `rows` moments every so many are drawn where each has `count` carriers.
pub fn every(rows: usize, count: usize) -> usize {
    rows.saturating_mul(count).div_ceil(MOST_PLACES).max(1)
}

/// A hole as long as this or longer takes away what was drawn, s: figures that go for a few lost frames would flicker.
const GONE_AFTER_S: f64 = 0.5;

/// From when until when something is there, ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stay {
    /// Its first sample.
    pub from_ns: i64,
    /// A step after its last one; `None` where nothing else is recorded after that.
    pub until_ns: Option<i64>,
}

/// The stretches of `times_ns` between holes, in a recording that ends at `end_ns`: the viewer keeps the latest, in a hole too.
pub fn stays(times_ns: &[i64], end_ns: i64) -> Vec<Stay> {
    let Some(first_ns) = times_ns.first().copied() else {
        return Vec::new();
    };
    let t_s = recording::signal::seconds_since(times_ns, first_ns);
    let parts = analyze::inputs::stretches(&t_s, GONE_AFTER_S);
    let step_s = analyze::inputs::mean_step_in(&t_s, &parts);
    let until = |last: usize| {
        // OK because a step is shorter than the recording.
        let gone_ns = times_ns[last].saturating_add((step_s? * 1e9) as i64);
        let goes_on = match times_ns.get(last + 1) {
            Some(next) => gone_ns < *next,
            None => (end_ns as f64 - times_ns[last] as f64) / 1e9 > GONE_AFTER_S.max(2.0 * step_s?),
        };
        goes_on.then_some(gone_ns)
    };
    let stay = |part: std::ops::Range<usize>| Stay {
        from_ns: times_ns[part.start],
        until_ns: until(part.end - 1),
    };
    parts.into_iter().map(stay).collect()
}

impl Take {
    /// The stretches of `times_ns`, which has the times of something in this recording.
    pub fn stays(&self, times_ns: &[i64]) -> Vec<Stay> {
        // What grows may have the rest of it still to come.
        let end_ns = if self.growing { i64::MIN } else { self.end_ns };
        stays(times_ns, end_ns)
    }

    /// When something that has the times `times_ns` is there no more, ns.
    pub fn ends(&self, times_ns: &[i64]) -> Vec<i64> {
        let stays = self.stays(times_ns).into_iter();
        stays.filter_map(|stay| stay.until_ns).collect()
    }

    /// Weight M·g, N, where the mass is known.
    pub fn weight_n(&self) -> Option<f64> {
        self.inputs
            .mass_kg
            .map(|mass_kg| mass_kg * self.inputs.gravity_m_per_s2)
            .filter(|weight_n| *weight_n > 0.0)
    }

    /// What forces are scaled by, N, and its name: the weight, or the mean support where the mass is not known (over many strides
    /// what is carried neither rises nor falls). `None` without forces.
    pub fn force_scale(&self) -> Option<(f64, &'static str)> {
        if let Some(weight_n) = self.weight_n() {
            return Some((weight_n, "Mg"));
        }
        let total = self.inputs.total_force_n();
        let finite: Vec<f64> = total.into_iter().filter(|n| n.is_finite()).collect();
        let mean = finite.iter().sum::<f64>() / finite.len() as f64;
        (mean > 0.0).then_some((mean, "mean support"))
    }

    /// Leaves out what is estimated of times from `until_ns` on: what is still to come changes it.
    pub fn keep_settled(&mut self, until_ns: i64) {
        let settled = |times_ns: &[i64]| times_ns.partition_point(|t| *t < until_ns);
        let i = &mut self.inputs;
        if i.sources.attitude == "imu" {
            let n = settled(&self.state_ns);
            let shared = [&mut i.t_s, &mut i.height_m, &mut i.support_ratio];
            let angles = [&mut i.roll_rad, &mut i.pitch_rad, &mut i.yaw_rad];
            let all = shared.into_iter().chain(angles).chain(&mut i.heave_m);
            all.for_each(|column| column.truncate(n));
            self.state_ns.truncate(n);
            // What was measured beside it is on a clock of its own.
            if i.height_alone.is_none() {
                self.height_ns.truncate(n);
            }
            if i.normal_n.is_empty() {
                self.force_ns.truncate(n);
            }
            if let Some(pose) = &mut self.pose {
                let n = settled(&pose.times_ns);
                pose.times_ns.truncate(n);
                pose.position_m.truncate(n);
                pose.orientation.truncate(n);
            }
        }
        if i.phases_are_measured {
            let n = settled(&self.phase_ns);
            let columns = [&mut i.phase_t_s, &mut i.beat_phase_rad];
            let all = columns.into_iter().chain(&mut i.phase_rad);
            all.for_each(|column| column.truncate(n));
            self.phase_ns.truncate(n);
        }
    }

    /// Length, s.
    pub fn duration_s(&self) -> f64 {
        (i128::from(self.end_ns) - i128::from(self.start_ns)) as f64 / 1e9
    }
}

impl Default for Take {
    /// Nothing.
    fn default() -> Self {
        Take {
            name: String::new(),
            start_ns: 0,
            end_ns: 0,
            growing: false,
            inputs: Inputs::default(),
            state_ns: Vec::new(),
            height_ns: Vec::new(),
            force_ns: Vec::new(),
            tangential_n: Vec::new(),
            compression_m: Vec::new(),
            phase_ns: Vec::new(),
            window: Window::ALL,
            metrics: Metrics(Vec::new()),
            pose: None,
            carriers: None,
            shape: Shape::default(),
            energy: None,
            main_imu: None,
            imus: Vec::new(),
            topics: Vec::new(),
            events: Vec::new(),
            remarks: Vec::new(),
            notes: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_there_goes_in_holes_and_before_the_end() {
        const MS: i64 = 1_000_000;
        // 10 Hz: one sample lost, three seconds lost, and an end at 6.9 s.
        let times = (0..20).filter(|k| *k != 7).chain(50..70);
        let times: Vec<i64> = times.map(|k| 100 * k * MS).collect();
        let stay = |from_ms: i64, until_ms: Option<i64>| Stay {
            from_ns: from_ms * MS,
            until_ns: until_ms.map(|ms| ms * MS),
        };
        let parts = |end_ms: i64| {
            let near = |ns: i64| ns / (10 * MS) * 10 * MS;
            let mut parts = stays(&times, end_ms * MS);
            // The mean step is longer than the usual one by what was lost.
            parts
                .iter_mut()
                .for_each(|p| p.until_ns = p.until_ns.map(near));
            parts
        };
        assert_eq!(parts(6900), [stay(0, Some(2000)), stay(5000, None)]);
        assert_eq!(parts(7300), [stay(0, Some(2000)), stay(5000, None)]);
        assert_eq!(parts(9000), [stay(0, Some(2000)), stay(5000, Some(7000))]);
        assert_eq!(
            stays(&[5], 9_000 * MS),
            [Stay {
                from_ns: 5,
                until_ns: None
            }]
        );
        assert_eq!(stays(&[], 9_000 * MS), []);
        let mut take = Take {
            end_ns: 9_000 * MS,
            ..Take::default()
        };
        assert_eq!(take.ends(&times).len(), 2);
        take.growing = true;
        assert_eq!(take.ends(&times).len(), 1);
    }

    #[test]
    fn a_quarter_turn_about_x_takes_y_to_z() {
        let h = 0.5f64.sqrt();
        let pose = Pose {
            orientation: vec![[h, 0.0, 0.0, h]],
            ..Pose::default()
        };
        let v = pose.in_world(0, &[1.0, 2.0, 0.0]);
        for (got, expected) in v.iter().zip([1.0, 0.0, 2.0]) {
            assert!((got - expected).abs() < 1e-12, "{v:?}");
        }
    }
}

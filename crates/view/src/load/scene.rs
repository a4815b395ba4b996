//! The things of the scene, out of signals that were collected whole: body, carriers, handles, ledger.

use std::collections::BTreeMap;

use recording::read::Recording;
use recording::signal::Signal;
use recording::topics;

use crate::take::{Carriers, Ledger, Pose, Shape, Take};

/// Height of the handles above the centre of mass where the recording does not say, m (the archive's rath).
const HANDLE_HEIGHT_M: f64 = 0.1;
/// The box that stands for the body, m, as in the recording's own URDF.
const BOX_M: [f64; 3] = [0.7, 0.5, 0.6];

/// Signals in a row, those of the paths for 0, 1, … as far as they have the times of the first.
fn numbered<'s>(
    signals: &BTreeMap<&str, &'s Signal>,
    path: impl Fn(usize) -> String,
) -> Vec<&'s Signal> {
    let mut out: Vec<&Signal> = Vec::new();
    while let Some(signal) = signals.get(path(out.len()).as_str()) {
        if out
            .first()
            .is_some_and(|first| first.times_ns != signal.times_ns)
        {
            break;
        }
        out.push(signal);
    }
    out
}

/// Where the body is, on the times of the state.
pub fn pose(signals: &BTreeMap<&str, &Signal>) -> Option<Pose> {
    let parts = |field: &str, names: &[&str]| -> Option<Vec<&Signal>> {
        let path = |name: &&str| format!("{}.{field}.{name}", topics::STATE);
        names
            .iter()
            .map(|n| signals.get(path(n).as_str()).copied())
            .collect()
    };
    let p = parts("position_m", &["x", "y", "z"])?;
    let q = parts("orientation", &["x", "y", "z", "w"])?;
    let times = &p[0].times_ns;
    if p.iter().chain(&q).any(|s| s.times_ns != *times) {
        return None;
    }
    Some(Pose {
        times_ns: times.to_vec(),
        position_m: (0..times.len())
            .map(|k| [0, 1, 2].map(|i| p[i].values[k]))
            .collect(),
        orientation: (0..times.len())
            .map(|k| [0, 1, 2, 3].map(|i| q[i].values[k]))
            .collect(),
    })
}

/// How high the centre of mass is drawn where only its motion about the mean is known, or nothing, m: about a shoulder's height.
const USUAL_HEIGHT_M: f64 = 0.9;
/// More moments than these no eye tells apart.
const MOST_MOMENTS: usize = 100_000;

/// Where the body is by what `analyze` found of its motion, be it by a pose or by an inertial sensor: on the spot where `place`, whose `.x`
/// and `.y` it is, is not known. `None` where nothing tells how it is turned. A place that is no number is a hole.
pub fn found(signals: &BTreeMap<&str, &Signal>, take: &Take, place: Option<&str>) -> Option<Pose> {
    let inputs = &take.inputs;
    let [roll, pitch, yaw] = [&inputs.roll_rad, &inputs.pitch_rad, &inputs.yaw_rad];
    let known = |x: Option<&f64>| x.copied().filter(|x| x.is_finite());
    let turned = |k: &usize| known(roll.get(*k)).or(known(pitch.get(*k))).is_some();
    let mut rows: Vec<usize> = (0..take.state_ns.len()).filter(turned).collect();
    if rows.len() < 2 {
        return None;
    }
    let step = rows.len().div_ceil(MOST_MOMENTS);
    rows = rows.into_iter().step_by(step).collect();
    let times_ns: Vec<i64> = rows.iter().map(|k| take.state_ns[*k]).collect();
    let s = |t: &[i64]| recording::signal::seconds_since(t, take.start_ns);
    let at = s(&times_ns);
    let along = |axis: &str| {
        let signal = signals.get(format!("{}.{axis}", place?).as_str())?;
        // As `analyze` takes the height.
        let unit_m = match signal.unit.as_str() {
            "mm" => 1e-3,
            "cm" => 1e-2,
            _ => 1.0,
        };
        let mut of_m = analyze::inputs::interpolate(&s(&signal.times_ns), &signal.values, &at);
        of_m.iter_mut().for_each(|x| *x *= unit_m);
        of_m.iter().any(|x| is_drawn(*x)).then_some(of_m)
    };
    let [x_m, y_m] = ["x", "y"].map(along);
    let (height_s, height_m) = inputs.height();
    let is_told = height_m.iter().any(|z| is_drawn(*z));
    let height_m = is_told.then(|| analyze::inputs::interpolate(height_s, height_m, &at));
    let is_motion = inputs.sources.height == "imu";
    let or_nought = |column: &[f64], n: usize| known(column.get(n)).unwrap_or(0.0);
    // What nobody tells is at the origin, what is told and no number is nowhere.
    let told = |axis_m: &Option<Vec<f64>>, n: usize| {
        let x_m = axis_m.as_ref().map_or(0.0, |axis_m| axis_m[n]);
        is_drawn(x_m).then_some(x_m)
    };
    let place = |n: usize| {
        let z_m = match &height_m {
            None => USUAL_HEIGHT_M,
            Some(motion_m) if is_motion => USUAL_HEIGHT_M + or_nought(motion_m, n),
            _ => told(&height_m, n)?,
        };
        Some([told(&x_m, n)?, told(&y_m, n)?, z_m])
    };
    let mut pose = Pose::default();
    for (n, k) in rows.into_iter().enumerate() {
        let Some(position_m) = place(n) else {
            continue;
        };
        let turned = [roll, pitch, yaw].map(|column| or_nought(column, k));
        pose.times_ns.push(times_ns[n]);
        pose.position_m.push(position_m);
        pose.orientation.push(quaternion(turned));
    }
    (pose.times_ns.len() > 1).then_some(pose)
}

/// Whether it is a number, and to the viewer too.
fn is_drawn(x: f64) -> bool {
    (x as f32).is_finite()
}

/// The quaternion x, y, z, w of R = R_z(yaw) R_y(pitch) R_x(roll), as `analyze` takes its angles.
fn quaternion([roll_rad, pitch_rad, yaw_rad]: [f64; 3]) -> [f64; 4] {
    let turn = nalgebra::UnitQuaternion::from_euler_angles(roll_rad, pitch_rad, yaw_rad);
    turn.into_inner().coords.into()
}

/// The carriers' frames in `/tf` of a recording of our own: `carrier_1` and so on where items are read by their names; by their places, the
/// first is the body's and the others are theirs. Nobody else's frames are people.
pub fn carriers(signals: &BTreeMap<&str, &Signal>) -> Option<Carriers> {
    let path = |item: String, axis: &str| {
        format!(
            "{}.transforms[{item}].transform.translation.{axis}",
            topics::TF
        )
    };
    let frame = |i: usize| format!("carrier_{}", i + 1);
    let by_name = signals.contains_key(path(frame(0), "x").as_str());
    let item = |i: usize| {
        if by_name {
            frame(i)
        } else {
            (i + 1).to_string()
        }
    };
    let axes = ["x", "y", "z"].map(|axis| numbered(signals, |i| path(item(i), axis)));
    let count = axes.iter().map(Vec::len).min()?;
    if count == 0 {
        return None;
    }
    let times_ns = axes[0][0].times_ns.to_vec();
    let points_m = (0..count)
        .map(|i| {
            (0..times_ns.len())
                .map(|k| [0, 1, 2].map(|a| axes[a][i].values[k]))
                .collect()
        })
        .collect();
    Some(Carriers { times_ns, points_m })
}

/// How far the handles are pressed into the shoulders, at the times of the forces.
pub fn compressions(signals: &BTreeMap<&str, &Signal>, take: &Take) -> Vec<Vec<f64>> {
    let found = numbered(signals, |i| {
        format!("{}.compression_m[{i}]", topics::FORCES)
    });
    if found
        .iter()
        .any(|signal| signal.times_ns[..] != take.force_ns[..])
    {
        return Vec::new();
    }
    found.iter().map(|signal| signal.values.to_vec()).collect()
}

/// Sideways forces of the handles, at the times of the forces.
pub fn tangentials(signals: &BTreeMap<&str, &Signal>, take: &Take) -> Vec<Vec<[f64; 2]>> {
    let axis = |name: &str| {
        numbered(signals, |i| {
            format!("{}.tangential_n[{i}].{name}", topics::FORCES)
        })
    };
    let [x, y] = ["x", "y"].map(axis);
    let on_time = |s: &&Signal| s.times_ns[..] == take.force_ns[..];
    if x.len() != y.len() || !x.iter().chain(&y).all(on_time) {
        return Vec::new();
    }
    let pairs = |(x, y): (&&Signal, &&Signal)| {
        let each = x.values.iter().zip(y.values.iter());
        each.map(|(x, y)| [*x, *y]).collect()
    };
    x.iter().zip(&y).map(pairs).collect()
}

/// Handles as the attached scene gives them; otherwise where the carriers are beside the body, at the middle of what they do.
pub fn shape(recording: &Recording, take: &Take) -> Shape {
    let from_scene = || -> Option<Vec<[f64; 3]>> {
        let text = String::from_utf8(recording.attachment("scene.toml")?).ok()?;
        let scene: toml::Table = text.parse().ok()?;
        let handles = scene.get("carriers")?.get("handles_m")?.as_array()?;
        let number = |v: &toml::Value| v.as_float().or_else(|| v.as_integer().map(|i| i as f64));
        handles
            .iter()
            .map(|h| {
                let h = h.as_array()?;
                (h.len() == 3).then_some(())?;
                Some([number(&h[0])?, number(&h[1])?, number(&h[2])?])
            })
            .collect()
    };
    Shape {
        handles_m: from_scene().or_else(|| beside(take)).unwrap_or_default(),
        box_m: BOX_M,
    }
}

/// Where the carriers are beside the body, at the middle of what they do.
fn beside(take: &Take) -> Option<Vec<[f64; 3]>> {
    let (carriers, pose) = (take.carriers.as_ref()?, take.pose.as_ref()?);
    if carriers.times_ns != pose.times_ns {
        return None;
    }
    // Beside the body: along its own x axis over the ground, and to the left of it.
    let ahead: Vec<[f64; 2]> = (pose.orientation.iter())
        .map(|[x, y, z, w]| {
            let (cos, sin) = (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w));
            let length = cos.hypot(sin);
            [cos / length, sin / length]
        })
        .collect();
    let middle = |mut x: Vec<f64>| -> f64 {
        x.retain(|x| x.is_finite());
        x.sort_by(f64::total_cmp);
        x.get(x.len() / 2).copied().unwrap_or(0.0)
    };
    let offset = |points: &Vec<[f64; 3]>, axis: usize| {
        let each = points.iter().zip(&pose.position_m).zip(&ahead);
        let along = each.map(|((c, p), [cos, sin])| {
            let (dx, dy) = (c[0] - p[0], c[1] - p[1]);
            [dx * cos + dy * sin, dy * cos - dx * sin][axis]
        });
        middle(along.collect())
    };
    let round = |x: f64| (x * 100.0).round() / 100.0;
    Some(
        carriers
            .points_m
            .iter()
            .map(|c| [round(offset(c, 0)), round(offset(c, 1)), HANDLE_HEIGHT_M])
            .collect(),
    )
}

/// The ledger; the potential, whose zero is arbitrary, is counted from its beginning, which no later sample changes.
pub fn energy(signals: &BTreeMap<&str, &Signal>) -> Option<Ledger> {
    const COLUMNS: [(&str, &str); 6] = [
        ("kinetic", "kinetic_j"),
        ("potential since the beginning", "potential_j"),
        ("elastic", "elastic_j"),
        ("work in", "work_in_j"),
        ("dissipated", "dissipated_j"),
        ("unexplained", "unexplained_j"),
    ];
    let mut ledger = Ledger::default();
    for (name, field) in COLUMNS {
        let Some(signal) = signals.get(format!("{}.{field}", topics::ENERGY).as_str()) else {
            continue;
        };
        if ledger.times_ns.is_empty() {
            ledger.times_ns = signal.times_ns.to_vec();
        }
        if signal.times_ns[..] == ledger.times_ns[..] {
            let first = signal.values.iter().find(|j| j.is_finite());
            let from = first.filter(|_| field == "potential_j").unwrap_or(&0.0);
            ledger
                .columns
                .push((name, signal.values.iter().map(|j| j - from).collect()));
        }
    }
    (!ledger.columns.is_empty()).then_some(ledger)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_found_of_the_motion_is_a_pose() {
        use std::f64::consts::FRAC_PI_2;
        let mut take = Take {
            state_ns: (0..5).map(|k| k * 10_000_000).collect(),
            ..Take::default()
        };
        assert!(found(&BTreeMap::new(), &take, None).is_none());
        take.inputs.t_s = (0..5).map(|k| f64::from(k) * 0.01).collect();
        take.inputs.sources.height = "imu".into();
        take.inputs.height_m = vec![0.0, 0.01, 0.02, f64::NAN, 0.01];
        take.inputs.roll_rad = vec![0.0, FRAC_PI_2, 0.0, f64::NAN, 0.3];
        take.inputs.pitch_rad = vec![0.0, 0.0, FRAC_PI_2, f64::NAN, f64::NAN];
        let pose = found(&BTreeMap::new(), &take, None).unwrap();
        // Nothing is known of the fourth sample.
        assert_eq!(pose.times_ns, [0, 10_000_000, 20_000_000, 40_000_000]);
        assert_eq!(pose.position_m[1], [0.0, 0.0, USUAL_HEIGHT_M + 0.01]);
        let turned = |k: usize, v: [f64; 3]| pose.in_world(k, &v).map(|x| (1e9 * x).round() / 1e9);
        // Roll takes left to up, pitch ahead to down.
        assert_eq!(turned(1, [0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]);
        assert_eq!(turned(2, [1.0, 0.0, 0.0]), [0.0, 0.0, -1.0]);

        // A pose has a place and a height of its own.
        take.inputs.sources.height = "pose".into();
        let signal = |part: &str, x: f64| Signal {
            path: format!("/odom.p.{part}"),
            times_ns: take.state_ns.clone().into(),
            values: vec![x; 5],
            topic: "/odom".into(),
            unit: "m".into(),
        };
        let mut place = [signal("x", 3.0), signal("y", -2000.0)];
        place[1].unit = "mm".into();
        // It is nowhere where any part of its place is no number, and on the spot by an axis that never is one.
        for (lost, times) in [
            (0.0, vec![0, 1, 2, 4]),
            (f64::NAN, vec![0, 2, 4]),
            (1e300, vec![0, 2, 4]),
        ] {
            place[0].values[1] += lost;
            let signals = place.iter().map(|s| (s.path.as_str(), s)).collect();
            let pose = found(&signals, &take, Some("/odom.p")).unwrap();
            assert_eq!(
                pose.times_ns,
                times.iter().map(|k| 10_000_000 * k).collect::<Vec<i64>>()
            );
            assert!(pose.position_m.contains(&[3.0, -2.0, 0.02]));
            assert!(pose.position_m.iter().all(|p| p[..2] == [3.0, -2.0]));
            place[0].values[1] = 3.0;
        }
        take.inputs.height_m[1] = f64::INFINITY;
        place[0].values = vec![f64::NAN; 5];
        let signals = place.iter().map(|s| (s.path.as_str(), s)).collect();
        let pose = found(&signals, &take, Some("/odom.p")).unwrap();
        assert_eq!(pose.times_ns, [0, 20_000_000, 40_000_000]);
        assert_eq!(pose.position_m[1], [0.0, -2.0, 0.02]);
        // Yaw goes first in the world, roll first in the body.
        let q = quaternion([0.3, -0.4, 2.0]);
        let pose = Pose {
            orientation: vec![q],
            ..Pose::default()
        };
        let ahead = pose.in_world(0, &[1.0, 0.0, 0.0]);
        let (sp, cp) = (-0.4f64).sin_cos();
        let (sy, cy) = 2.0f64.sin_cos();
        for (got, expected) in ahead.iter().zip([cp * cy, cp * sy, -sp]) {
            assert!((got - expected).abs() < 1e-12, "{ahead:?}");
        }
    }

    #[test]
    fn carriers_are_beside_the_body_whichever_way_it_faces() {
        // A walk along x, a quarter turn to the left, and on along y; two carriers 2 m ahead and behind, 0.3 m to the left.
        let mut take = Take::default();
        let (mut pose, mut points_m) = (Pose::default(), [Vec::new(), Vec::new()]);
        for k in 0..100i64 {
            let along_m = k as f64 / 10.0;
            let (yaw_rad, place) = match k {
                0..40 => (0.0f64, [along_m, 0.0, 0.8]),
                _ => (0.5 * std::f64::consts::PI, [4.0, along_m - 4.0, 0.8]),
            };
            let ((sin, cos), (sin_half, cos_half)) = (yaw_rad.sin_cos(), (0.5 * yaw_rad).sin_cos());
            for (points, ahead_m) in points_m.iter_mut().zip([2.0, -2.0]) {
                let (x, y) = (ahead_m * cos - 0.3 * sin, ahead_m * sin + 0.3 * cos);
                points.push([place[0] + x, place[1] + y, 0.9]);
            }
            pose.times_ns.push(k);
            pose.position_m.push(place);
            pose.orientation.push([0.0, 0.0, sin_half, cos_half]);
        }
        take.carriers = Some(Carriers {
            times_ns: pose.times_ns.clone(),
            points_m: points_m.to_vec(),
        });
        take.pose = Some(pose);
        let expected = [2.0, -2.0].map(|x| [x, 0.3, HANDLE_HEIGHT_M]);
        assert_eq!(beside(&take).unwrap(), expected);
    }
}

//! Prediction 3: longer poles, larger roll torques.

use super::{Finding, Lab, Verdict, columns, mean, number, row, scene, slope, template};
use crate::draw::{Figure, Layer};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use sim::run::Sample;
use sim::scene::{Scene, Template};

/// Where moments are taken from, s: the scenes' own window.
const FROM_S: f64 = 15.0;

/// What the handles do to the body in a run: RMS about the mean of N₁ − N₂ (N), of the moment about the long axis of roll and about
/// the other level axis (N·m), and RMS roll (deg).
fn moments(scene: &Scene) -> Result<[f64; 4], String> {
    let mut rows: Vec<[f64; 3]> = Vec::new();
    let inputs = columns(scene, &mut |s: &Sample| {
        if s.t_s >= FROM_S {
            let [x, y, z, w] = s.pose.orientation;
            let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
            let centre = Vector3::from(s.pose.position_m);
            let moment: Vector3<f64> = (0..s.normal_n.len())
                .map(|i| {
                    let [tx, ty] = s.tangential_n[i];
                    let force = Vector3::new(tx, ty, s.normal_n[i]);
                    (Vector3::from(s.handle_m[i]) - centre).cross(&force)
                })
                .sum();
            let body = turn.inverse() * moment;
            rows.push([s.normal_n[0] - s.normal_n[1], body.x, body.y]);
        }
        true
    })?;
    let rms = |k: usize| {
        let middle = mean(rows.iter().map(|r| r[k]));
        mean(rows.iter().map(|r| (r[k] - middle).powi(2))).sqrt()
    };
    let from = inputs.t_s.partition_point(|t| *t < FROM_S);
    let roll = mean(inputs.roll_rad[from..].iter().map(|x| x * x)).sqrt();
    Ok([rms(0), rms(1), rms(2), roll.to_degrees()])
}

/// Does it.
pub fn run(lab: &Lab) -> Result<Finding, String> {
    let baseline = template("baseline", &[])?;
    let music = template("music", &[])?;
    // The same pair, one to the left and one to the right, under a plank: now the ends are arms about the axis of roll.
    let abreast = template(
        "baseline",
        &[
            "carriers.handles_m=[[0.00031, 2.45, 0.1], [0.00031, -2.45, 0.1]]",
            "body.inertia_kg_m2={ xx = 20.0, yy = 2.6, zz = 20.0 }",
            "effects.pole_friction=false",
        ],
    )?;
    let rigs: [(&str, &Template, usize, bool); 4] = [
        ("in line, own rhythms", &baseline, 0, false),
        (
            "in line, own rhythms, inertia grows with length²",
            &baseline,
            0,
            true,
        ),
        ("in line, music", &music, 0, false),
        ("abreast, own rhythms", &abreast, 1, false),
    ];
    let lengths = row(2.5, 8.0, 12);
    let cases: Vec<(usize, f64)> = (0..rigs.len())
        .flat_map(|r| lengths.iter().map(move |l| (r, *l)))
        .collect();
    let runs = lab.with_seeds(&cases);
    let found = lab.map(&runs, |((rig, length), seed)| {
        let (_, template, axis, grows) = rigs[*rig];
        let ends = [0, 1].map(|i| format!("carriers.handles_m.{i}.{axis}"));
        let mut values = vec![(&ends[0][..], length / 2.0), (&ends[1][..], -length / 2.0)];
        if grows {
            let inertia = 20.0 * (length / 4.9).powi(2);
            values.extend([
                ("body.inertia_kg_m2.yy", inertia),
                ("body.inertia_kg_m2.zz", inertia),
            ]);
        }
        moments(&scene(template, &values, *seed)?)
    })?;
    let seeds = lab.seeds as usize;
    // Means over the seeds: [rig][length] of N₁ − N₂, roll moment, tilt moment, roll.
    let means: Vec<Vec<[f64; 4]>> = found
        .chunks(seeds * lengths.len())
        .map(|rig| {
            rig.chunks(seeds)
                .map(|runs| [0, 1, 2, 3].map(|k| mean(runs.iter().map(|r| r[k]))))
                .collect()
        })
        .collect();
    // Slope of log moment against log length, over all runs.
    let exponent = |rig: usize, k: usize| {
        let runs = found[rig * seeds * lengths.len()..]
            .iter()
            .take(seeds * lengths.len());
        let points: Vec<(f64, f64)> = runs
            .enumerate()
            .map(|(i, r)| (lengths[i / seeds].ln(), r[k].ln()))
            .collect();
        slope(&points)
    };
    let per_force = |rig: usize, k: usize| {
        let runs = found[rig * seeds * lengths.len()..]
            .iter()
            .take(seeds * lengths.len());
        let points: Vec<(f64, f64)> = runs
            .enumerate()
            .map(|(i, r)| (lengths[i / seeds].ln(), (r[k] / r[0]).ln()))
            .collect();
        slope(&points)
    };
    let (in_line, across) = (per_force(0, 2), per_force(3, 1));
    let roll_music = exponent(2, 1);
    let roll_change = means[2][lengths.len() - 1][3] / means[2][0][3];
    let verdict = match ((across.0 - 1.0).abs() < 0.1, roll_music.0 > 0.5) {
        (true, true) => Verdict::Supported,
        (true, false) => Verdict::Depends,
        _ => Verdict::NotSupported,
    };
    let curve = |rig: usize, k: usize| -> Vec<(f64, f64)> {
        lengths
            .iter()
            .zip(&means[rig])
            .map(|(l, m)| (*l, m[k]))
            .collect()
    };
    Ok(Finding {
        title: "3. Lever arm",
        claim: "Longer pole configurations should show larger roll torques for similar force asymmetries.",
        experiment: format!(
            "The distance between the two handles from 2.5 to 8 m, {seeds} seeds at each of {} lengths: carriers in line as in the paper (own rhythms; the same with an inertia that grows with \
             the pole; music), and the same two carriers abreast, one to the left and one to the right. In each run: RMS of the difference of the handle forces ΔN, of the moment that all handle forces \
             have about the axis of roll, and about the other level axis (which tilts the pole).",
            lengths.len()
        ),
        verdict: Some(verdict),
        because: format!(
            "Moment per ΔN grows with length to the power {:.2} about the axis across the pole (the tilt), and {:.2} about the axis of roll when the carriers walk abreast. For carriers in line, the paper's \
             case, the pole *is* the axis of roll: ΔN has no arm there, and from 2.5 to 8 m the roll in music changes by the factor {roll_change:.2} only.",
            in_line.0, across.0
        ),
        numbers: vec![
            number(
                "tilt_per_force",
                "exponent of (tilt moment / ΔN) with length, in line",
                in_line.0,
                "",
                3,
            ),
            number(
                "roll_per_force_abreast",
                "exponent of (roll moment / ΔN), abreast",
                across.0,
                "",
                3,
            ),
            number(
                "roll_moment_music",
                "exponent of the roll moment in music, in line",
                roll_music.0,
                "",
                3,
            ),
            number(
                "roll_moment_music_se",
                "its standard error",
                roll_music.1,
                "",
                3,
            ),
            number(
                "force_fixed",
                "exponent of ΔN, in line, inertia fixed",
                exponent(0, 0).0,
                "",
                2,
            ),
            number(
                "force_grows",
                "exponent of ΔN, in line, inertia grows with length²",
                exponent(1, 0).0,
                "",
                2,
            ),
            number(
                "roll_short",
                "RMS roll in music at 2.5 m",
                means[2][0][3],
                "°",
                1,
            ),
            number(
                "roll_long",
                "RMS roll in music at 8 m",
                means[2][lengths.len() - 1][3],
                "°",
                1,
            ),
            number(
                "abreast_short",
                "RMS roll abreast at 2.5 m",
                means[3][0][3],
                "°",
                1,
            ),
            number(
                "abreast_long",
                "RMS roll abreast at 8 m",
                means[3][lengths.len() - 1][3],
                "°",
                1,
            ),
        ],
        pictures: vec![(
            "lever",
            "RMS moments of the handle forces against the distance of the handles: about the level axis across the pole (tilt) and about the axis of roll; in line with own rhythms, with an inertia that grows with the square of the length (I ~ L²), with music, and abreast.".into(),
            Figure {
                title: "Moments and the length of the pole".into(),
                x_label: "distance of the handles, m".into(),
                y_label: "RMS moment, N m".into(),
                layers: vec![
                    Layer::line("tilt", curve(0, 2), 0),
                    Layer::dashed("tilt, I ~ L²", curve(1, 2), 0),
                    Layer::line("roll", curve(0, 1), 1),
                    Layer::dashed("roll, music", curve(2, 1), 1),
                    Layer::dashed("roll, abreast", curve(3, 1), 2),
                ],
                ..Figure::default()
            },
        )],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::predictions::{Verdict, measure};

    /// Two forces at the ends of a pole have a moment of half its length times their difference; about the pole they have what turns the body, by Euler's
    /// equations of a body with I_yy = I_zz: M_x = I_xx ω̇_x, M_y = I_yy ω̇_y − (I_zz − I_xx) ω_z ω_x.
    #[test]
    fn moments_are_those_that_turn_the_body() {
        let settings = [
            "effects.pole_friction=false",
            "log_rate_hz=600.0",
            "duration_s=30.0",
        ];
        let template = template("music", &settings).unwrap();
        let scene = scene(&template, &[], 3).unwrap();
        let mut turns: Vec<UnitQuaternion<f64>> = Vec::new();
        columns(&scene, &mut |s: &Sample| {
            if s.t_s >= FROM_S {
                let [x, y, z, w] = s.pose.orientation;
                turns.push(UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)));
            }
            true
        })
        .unwrap();
        // The body's rate over each step, and its change from step to step.
        let rates: Vec<Vector3<f64>> = turns
            .windows(2)
            .map(|w| 600.0 * (w[0].inverse() * w[1]).scaled_axis())
            .collect();
        let torques = rates.windows(2).map(|w| {
            let (bend, rate) = (600.0 * (w[1] - w[0]), 0.5 * (w[0] + w[1]));
            [2.6 * bend.x, 20.0 * bend.y - (20.0 - 2.6) * rate.z * rate.x]
        });
        let torques: Vec<[f64; 2]> = torques.collect();
        let rms = |k: usize| mean(torques.iter().map(|m| m[k] * m[k])).sqrt();
        let [apart, about_pole, across, roll] = moments(&scene).unwrap();
        for (found, known) in [(about_pole, rms(0)), (across, rms(1))] {
            assert!((found / known - 1.0).abs() < 0.005, "{found} {known}");
        }
        assert!(
            (across / apart / 2.45 - 1.0).abs() < 0.03,
            "{across} {apart}"
        );
        let [metric] = measure(&scene, ["rms_roll_deg"]).unwrap();
        assert!((roll - metric).abs() < 1e-9, "{roll} {metric}");
    }

    #[test]
    fn the_arm_grows_with_the_pole() {
        let found = run(&Lab::quiet(1)).unwrap();
        for name in ["tilt_per_force", "roll_per_force_abreast"] {
            let exponent = found.number(name).unwrap();
            assert!((exponent - 1.0).abs() < 0.01, "{name}: {exponent}");
        }
        assert_ne!(found.verdict, Some(Verdict::NotSupported));
    }
}

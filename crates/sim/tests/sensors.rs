//! Virtual instruments: what they show of known motions, and that their noise is what the scene says.

mod common;

use common::{readings, samples, scene};
use nalgebra::Vector3;
use sim::beat::Stroke;
use sim::effects::imu::Imu;
use sim::model::Model;
use sim::run::Sample;
use sim::scene::{load, parse};
use sim::sensors::drum::Track;
use sim::solve::METHODS;
use std::f64::consts::TAU;

/// At rest the specific force is +g along the axis that points up, whichever axis that is.
#[test]
fn at_rest_the_axis_that_points_up_shows_plus_g() {
    let scene = scene(
        r#"
        name = "rest"
        duration_s = 0.5
        [effects.contact]
        [effects.imu]
        ideal = true
        sensors = [
            { on = "rath" },
            { on = "rath", name = "on_its_side", place_m = [0.3, 0.1, -0.2], mounting_roll_pitch_yaw_deg = [90.0, 0.0, 0.0] },
            { on = "carrier_2" },
        ]
        "#,
    );
    let (shown, _) = readings(&scene);
    assert_eq!(shown.len(), 3 * 101);
    for r in shown {
        let expected = if r.topic == "/imu/on_its_side" {
            [0.0, 9.81, 0.0]
        } else {
            [0.0, 0.0, 9.81]
        };
        for axis in 0..3 {
            assert!((r.force[axis] - expected[axis]).abs() < 1e-9, "{r:?}");
            assert!(r.spin[axis].abs() < 1e-9);
        }
    }
}

/// A symmetric top in free fall: a sensor off the centre shows ω × (ω × p) + α × p and nothing else.
///
/// ω = (b cos λt, b sin λt, s) for I = diag(I₁, I₁, I₃), λ = (I₃ − I₁) s/I₁. Landau & Lifshitz, Mechanics, §33.
#[test]
fn val_off_centre_sensor_on_a_free_top() {
    let scene = scene(
        r#"
        name = "top"
        duration_s = 10.0
        [body]
        inertia_kg_m2 = { xx = 2.0, yy = 2.0, zz = 3.0 }
        [start]
        height_m = 500.0
        angular_velocity_rad_per_s = [0.8, 0.0, 5.0]
        [solver]
        tolerance = 1e-13
        [effects.imu]
        ideal = true
        sensors = [{ on = "rath", place_m = [0.4, -0.3, 0.7] }]
        "#,
    );
    let (b, s, p) = (0.8, 5.0, Vector3::new(0.4, -0.3, 0.7));
    let turn = (3.0 - 2.0) * s / 2.0;
    for r in readings(&scene).0 {
        let (sin, cos) = (turn * r.t_s).sin_cos();
        let spin = Vector3::new(b * cos, b * sin, s);
        let change = Vector3::new(-b * turn * sin, b * turn * cos, 0.0);
        let expected = spin.cross(&spin.cross(&p)) + change.cross(&p);
        assert!(
            (Vector3::from(r.force) - expected).norm() < 1e-9,
            "t = {}: {:.1e}",
            r.t_s,
            (Vector3::from(r.force) - expected).norm()
        );
        assert!((Vector3::from(r.spin) - spin).norm() < 1e-9);
    }
}

/// A shoulder that goes up and down as A sin φ, φ̇ constant, is felt as g − A φ̇² sin φ.
#[test]
fn val_shoulder_sensor_of_a_steady_gait() {
    let scene = scene(
        r#"
        name = "steps"
        duration_s = 5.0
        [carriers]
        initial_phase_rad = [0.3, 1.0]
        [effects.gait]
        amplitude_m = 0.06
        [effects.imu]
        ideal = true
        rate_hz = 90.0
        sensors = [{ on = "carrier_2" }]
        "#,
    );
    let w = TAU * 2.0;
    for r in readings(&scene).0 {
        let expected = 9.81 - 0.06 * w * w * (1.0 + w * r.t_s).sin();
        // The five-point difference: h⁴/30 · A ω⁶ = 1e-11, rounding 1e-9.
        assert!(
            (r.force[2] - expected).abs() < 5e-9,
            "{:.1e}",
            r.force[2] - expected
        );
    }
}

/// Instruments touch nothing: with any method the samples are the same to the last bit, however long its steps are and however loose the
/// polynomials between their ends.
#[test]
fn sensors_only_watch() {
    let scenes = [
        ("field-imu", 1e-6),
        ("music", 1e-3),
        ("music", 1e-9),
        ("long-pole", 1e-5),
    ];
    for (name, tolerance) in scenes {
        for method in METHODS {
            let set = [
                "duration_s=12.0".to_owned(),
                format!("solver.method={:?}", method.name),
                format!("solver.tolerance={tolerance:e}"),
            ];
            let text = sim::scene::builtin(name).unwrap();
            let mut without = parse(name, text, &set).unwrap();
            without.effects.imu = None;
            let mut with = without.clone();
            with.effects.imu = Some(Imu {
                rate_hz: 71.0,
                ideal: true,
                ..Imu::default()
            });
            let motion = |s: &sim::scene::Scene| {
                let bits = |s: &Sample| {
                    let q = s.pose.orientation.map(f64::to_bits);
                    (s.pose.position_m.map(f64::to_bits), q)
                };
                samples(s).iter().map(bits).collect::<Vec<_>>()
            };
            assert!(motion(&with) == motion(&without), "{name} {}", method.name);
        }
    }
}

/// Its own clock: stamps begin at the offset and tick nominally while true time runs at the drifting rate; samples get lost.
#[test]
fn clocks_drift_and_samples_get_lost() {
    let text = r#"
        name = "clock"
        duration_s = 200.0
        epoch_s = 1e9
        [effects.imu]
        rate_hz = 100.0
        dropout = 0.1
        sensors = [{ on = "rath", clock_offset_s = -2.5, clock_drift_ppm = 500.0 }]
    "#;
    let (shown, _) = readings(&scene(text));
    // 20,011 ticks of a clock that is 100 ms ahead after 200 s, a tenth of them lost, within four standard errors.
    assert!(
        (17_840..=18_180).contains(&shown.len()),
        "{} of 20,011 arrived",
        shown.len()
    );
    for r in &shown {
        assert!(
            (r.stamp_s - (-2.5 + r.t_s * (1.0 + 500e-6))).abs() < 1e-9,
            "{r:?}"
        );
    }
    assert!(shown.windows(2).all(|w| w[0].t_s < w[1].t_s));
}

/// Rows of five, of which a few meet: holes of five samples and more, as much lost in all as is said.
#[test]
fn samples_get_lost_in_rows() {
    let text = r#"
        name = "radio"
        duration_s = 200.0
        [effects.imu]
        rate_hz = 100.0
        dropout = 0.1
        dropout_row = 5
        sensors = [{ on = "rath" }]
    "#;
    let (shown, _) = readings(&scene(text));
    // A tenth of 20,001; rows make the standard error √5 times as large: 95, of which four.
    assert!((17_620..=18_380).contains(&shown.len()), "{}", shown.len());
    let ticks: Vec<i64> = shown
        .iter()
        .map(|r| (r.t_s * 100.0).round() as i64)
        .collect();
    let holes: Vec<i64> = ticks
        .windows(2)
        .map(|w| w[1] - w[0] - 1)
        .filter(|lost| *lost > 0)
        .collect();
    assert!(holes.iter().all(|lost| *lost >= 5));
    // (1 − p_b)^5 of them meet no other, p_b = 1 − 0.9^(1/5): nine of ten.
    let alone = holes.iter().filter(|lost| **lost == 5).count() as f64 / holes.len() as f64;
    assert!((alone - 0.9).abs() < 0.06, "{alone}");
}

/// Ranges clip and digits round.
#[test]
fn ranges_clip_and_digits_round() {
    let (shown, _) = readings(&scene(
        r#"
        name = "coarse"
        duration_s = 1.0
        [start]
        height_m = 100.0
        angular_velocity_rad_per_s = [0.0, 0.0, 7.03]
        [effects.imu]
        gyro_range_rad_per_s = 5.0
        accel_resolution_m_per_s2 = 0.5
        sensors = [{ on = "rath", place_m = [0.1, 0.0, 0.0] }]
        "#,
    ));
    for r in shown {
        // The last digit within the range: 0.04 deg/s apart.
        assert!(
            (5.0 - 0.04_f64.to_radians()..=5.0).contains(&r.spin[2]),
            "{r:?}"
        );
        assert!(
            r.force
                .iter()
                .all(|f| (f / 0.5 - (f / 0.5).round()).abs() < 1e-12),
            "{r:?}"
        );
        assert!((r.force[0] + 0.1 * 7.03 * 7.03).abs() < 0.5, "{r:?}");
    }
}

/// A range of whole digits is reached, though its quotient is rounded below a whole number.
#[test]
fn a_range_of_whole_digits_is_reached() {
    let (shown, _) = readings(&scene(
        r#"
        name = "heavy"
        duration_s = 0.1
        [body]
        gravity_m_per_s2 = [0.0, 0.0, -20.0]
        [effects.contact]
        [effects.imu]
        accel_range_m_per_s2 = 9.6
        accel_resolution_m_per_s2 = 0.4
        sensors = [{ on = "rath" }]
        "#,
    ));
    assert!(!shown.is_empty());
    assert!(shown.iter().all(|r| (r.force[2] - 9.6).abs() < 1e-12));
}

/// Overlapping Allan variance at averaging times of `m` samples. IEEE Std 952-1997, annex C.
fn allan_variance(x: &[f64], rate_hz: f64, m: usize) -> f64 {
    let mut sums = vec![0.0];
    for v in x {
        sums.push(sums[sums.len() - 1] + v / rate_hz);
    }
    let tau = m as f64 / rate_hz;
    let terms = sums.len() - 2 * m;
    let total: f64 = (0..terms)
        .map(|k| (sums[k + 2 * m] - 2.0 * sums[k + m] + sums[k]).powi(2))
        .sum();
    total / (2.0 * tau * tau * terms as f64)
}

/// A static log of an hour shows the scene's noise density and bias walk in its Allan deviation: the walks within 5 %, the densities, of which
/// there is more to see, within 1 % and 2 %.
#[test]
fn val_allan_deviation_of_an_hour_at_rest() {
    let scene = scene(
        r#"
        name = "hour"
        duration_s = 3600.0
        log_rate_hz = 0.1
        [effects.imu]
        rate_hz = 100.0
        sensors = [{ on = "rath" }]
        [solver]
        energy = false
        [effects.contact]
        "#,
    );
    let (shown, _) = readings(&scene);
    assert_eq!(shown.len(), 360_001);
    let axes = |pick: fn(&common::Shown) -> [f64; 3]| -> [Vec<f64>; 3] {
        std::array::from_fn(|a| shown.iter().map(|r| pick(r)[a]).collect())
    };
    // σ²(τ) = D²/τ + W² τ/3: the mean over the axes at a short and at a long averaging time gives both.
    let fit = |signals: [Vec<f64>; 3], short: usize, long: usize| {
        let mean = |m: usize| {
            signals
                .iter()
                .map(|x| allan_variance(x, 100.0, m))
                .sum::<f64>()
                / 3.0
        };
        let (ts, tl, vs, vl) = (
            short as f64 / 100.0,
            long as f64 / 100.0,
            mean(short),
            mean(long),
        );
        let walk2 = (vl * tl - vs * ts) * 3.0 / (tl * tl - ts * ts);
        ((vs * ts - walk2 * ts * ts / 3.0).sqrt(), walk2.sqrt())
    };
    // Rounding to digits of q is noise too: q²/12 a sample.
    let with_digits =
        |density: f64, digit: f64| (density * density + digit * digit / 1200.0).sqrt();
    let (density, walk) = fit(axes(|r| r.force), 10, 400);
    assert!(
        (density / with_digits(2.0e-3, 8.17e-3) - 1.0).abs() < 0.01,
        "accelerometer density {density:.3e}"
    );
    assert!(
        (walk / 3.0e-3 - 1.0).abs() < 0.05,
        "accelerometer walk {walk:.3e}"
    );
    let (density, walk) = fit(axes(|r| r.spin), 50, 4000);
    assert!(
        (density / with_digits(1.6968e-4, 6.98e-4) - 1.0).abs() < 0.02,
        "gyroscope density {density:.3e}"
    );
    assert!(
        (walk / 1.9393e-5 - 1.0).abs() < 0.05,
        "gyroscope walk {walk:.3e}"
    );
}

/// Scale errors, angles between axes and first biases of many instruments spread as the scene says.
#[test]
fn instruments_differ_from_each_other_as_said() {
    let list: Vec<String> = (0..1000)
        .map(|i| format!("{{ on = \"rath\", name = \"s{i}\" }}"))
        .collect();
    let with = |errors: &str| {
        let noiseless = [
            "gyro_noise_rad_per_s_per_sqrt_hz",
            "gyro_bias_walk_rad_per_s2_per_sqrt_hz",
            "gyro_resolution_rad_per_s",
            "accel_noise_m_per_s2_per_sqrt_hz",
            "accel_bias_walk_m_per_s3_per_sqrt_hz",
            "accel_resolution_m_per_s2",
        ]
        .map(|key| format!("{key} = 0.0\n"));
        let text = format!(
            "name = \"many\"\nduration_s = 0.01\nfreedom = [\"yaw\"]\n[start]\nheight_m = 1.0\nangular_velocity_rad_per_s = [0.0, 0.0, 5.0]\n\
             [effects.imu]\nrate_hz = 10.0\n{}{errors}sensors = [{}]",
            noiseless.concat(),
            list.join(", ")
        );
        readings(&scene(&text)).0
    };
    // Held up, the accelerometer feels nothing but g along z, the gyroscope a turn about z.
    let spread = |x: &[f64], said: f64, what: &str| {
        let sd = (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt();
        let off = (sd / said - 1.0).abs();
        // Four standard errors.
        let within = 4.0 / (2.0 * x.len() as f64).sqrt();
        assert!(off < within, "{what}: {sd} found, {said} expected");
    };
    let gains = with("scale_error_sd = 0.01\nmisalignment_sd_deg = 0.5\n");
    assert_eq!(gains.len(), 1000);
    let biases = with("gyro_bias_sd_rad_per_s = 0.02\naccel_bias_sd_m_per_s2 = 0.3\n");
    type Pick = fn(&common::Shown) -> [f64; 3];
    let triads: [(Pick, f64, f64, &str); 2] = [
        (|r| r.spin, 5.0, 0.02, "gyroscope"),
        (|r| r.force, 9.81, 0.3, "accelerometer"),
    ];
    for (pick, truth, bias_sd, what) in triads {
        let scale: Vec<f64> = gains.iter().map(|r| pick(r)[2] / truth - 1.0).collect();
        spread(&scale, 0.01, what);
        let across = gains.iter().flat_map(|r| [pick(r)[0], pick(r)[1]]);
        let angles: Vec<f64> = across.map(|x| x / truth).collect();
        spread(&angles, 0.5_f64.to_radians(), what);
        let bias = biases.iter().flat_map(|r| {
            let [x, y, z] = pick(r);
            [x, y, z - truth]
        });
        spread(&bias.collect::<Vec<f64>>(), bias_sd, what);
    }
}

fn sound(noise: f64, strokes: impl Iterator<Item = f64>) -> (Track, Vec<f64>) {
    let track = Track {
        rate_hz: 8000,
        samples: 160_000,
        clock_offset_s: 0.0,
        clock_drift: 1e-3,
        pitch_hz: 90.0,
        decay_s: 0.02,
        level: 0.5,
        noise,
        seed: 1,
        strokes: strokes.map(|t_s| Stroke { t_s, tempo_hz: 2.0 }).collect(),
    };
    let blocks = (0..).map_while(|i| track.block(i));
    let x = blocks.flat_map(|b| b.sound).map(|x| f64::from(x) / 32767.0);
    let x = x.collect();
    (track, x)
}

/// A stroke is a tone that glides from 1.6 times its pitch down to it and dies away, behind a click; strokes add up, over the noise of the place.
#[test]
fn val_a_drum_is_a_gliding_tone_and_a_click() {
    let (_, quiet) = sound(0.1, std::iter::empty());
    let power = quiet.iter().map(|x| x * x).sum::<f64>() / quiet.len() as f64;
    // Four standard errors.
    assert!((power.sqrt() / 0.1 - 1.0).abs() < 4.0 / 320_000f64.sqrt());

    // Each stroke begins while the one before can still be heard.
    let (track, x) = sound(0.0, (0..200).map(|k| 0.05 + 0.0937 * f64::from(k)));
    let step_s = 1.0 / (8000.0 * 1.001);
    let mut tone = vec![0.0; x.len()];
    for stroke in &track.strokes {
        // The turns are the integral of the pitch, by the midpoint rule.
        let (mut turns, mut at_s) = (0.0, 0.0);
        let first = (stroke.t_s / step_s).ceil() as usize;
        for (k, tone) in tone.iter_mut().enumerate().skip(first).take(1600) {
            let s = k as f64 * step_s - stroke.t_s;
            let parts = 20.0;
            let h = (s - at_s) / parts;
            for part in 0..20 {
                let middle = at_s + (f64::from(part) + 0.5) * h;
                turns += h * 90.0 * (1.0 + 0.6 * (-middle / 0.02).exp());
            }
            at_s = s;
            *tone += 0.5 * (-s / 0.02).exp() * (TAU * turns).sin();
        }
    }
    let since = |k: usize| {
        let t_s = k as f64 * step_s;
        let before = track.strokes.iter().rev().find(|stroke| stroke.t_s <= t_s);
        before.map_or(f64::INFINITY, |stroke| t_s - stroke.t_s)
    };
    let mut clicks = Vec::new();
    for (k, (x, tone)) in x.iter().zip(&tone).enumerate() {
        let (s, digit) = (since(k), 1.0 / 32767.0);
        if s < 0.008 {
            clicks.push((x - tone) / (0.5 * 0.3 * (-s / 0.02 - s / 0.004).exp()));
        } else if s > 0.05 {
            // What is left of the click is far below a digit, and so is a stroke that is ten decays old.
            assert!((x - tone).abs() < 1.2 * digit, "{s} s: {x} {tone}");
        }
    }
    let power = clicks.iter().map(|x| x * x).sum::<f64>() / clicks.len() as f64;
    let within = 4.0 * (2.0 / clicks.len() as f64).sqrt();
    assert!((power - 1.0).abs() < within, "{power} of {}", clicks.len());
}

/// A recorder whose clock is fast writes more samples of the same minute.
#[test]
fn a_drum_track_lasts_as_long_as_the_scene() {
    for (drift_ppm, samples) in [(0.0, 80_001), (1005.0, 80_081), (-1005.0, 79_920)] {
        let set = [
            "duration_s=10".to_owned(),
            "effects.drum.sample_rate_hz=8000".to_owned(),
            format!("effects.drum.clock_drift_ppm={drift_ppm:?}"),
        ];
        let model = Model::new(&load("music", &set).unwrap());
        assert_eq!(
            model.track().map(|t| t.samples),
            Some(samples),
            "{drift_ppm}"
        );
    }
}

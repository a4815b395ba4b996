use super::*;
use crate::imu::interval::metrics;
use crate::metrics::Metrics;
use crate::random::Random;
use std::f64::consts::TAU;

/// A body that rolls and heaves, seen by a sensor `lever` off its centre, turned by `mount`.
fn twin(lever: [f64; 3], mount: UnitQuaternion<f64>) -> (Track, Vec<f64>, Vec<f64>, Vec<f64>) {
    let (dt, n) = (0.005, 8000);
    let (f, g) = (1.07, 9.80665);
    let (amplitude, swing) = (0.3, 0.06);
    let mut track = Track::default();
    let (mut roll, mut height, mut support) = (vec![], vec![], vec![]);
    for k in 0..n {
        let t = k as f64 * dt;
        let w = TAU * f;
        let phi = amplitude * (w * t).sin();
        let rate = Vector3::new(amplitude * w * (w * t).cos(), 0.0, 0.0);
        let alpha = Vector3::new(-amplitude * w * w * (w * t).sin(), 0.0, 0.0);
        let z = swing * (2.0 * w * t).sin();
        let up = -swing * 4.0 * w * w * (2.0 * w * t).sin() + g;
        let earth_from_body = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), phi);
        let r = Vector3::from(lever);
        let force = earth_from_body.inverse() * Vector3::new(0.0, 0.0, up)
            + alpha.cross(&r)
            + rate.cross(&rate.cross(&r));
        track.t_s.push(t);
        track
            .gyro_rad_per_s
            .push((mount.inverse() * rate + Vector3::new(0.004, -0.003, 0.002)).into());
        track.accel_m_per_s2.push((mount.inverse() * force).into());
        roll.push(phi);
        height.push(z);
        support.push(up / g);
    }
    (track, roll, height, support)
}

fn rms(x: impl Iterator<Item = f64>) -> f64 {
    let v: Vec<f64> = x.collect();
    (v.iter().map(|x| x * x).sum::<f64>() / v.len() as f64).sqrt()
}

#[test]
fn x_along_the_pole_is_forward_however_the_sensor_is_rolled() {
    for roll_deg in [0.0, 45.0, 90.0, 160.0, 175.0, 180.0, -178.0] {
        for pitch_deg in [0.0, 5.0, -20.0] {
            let [roll, pitch] = [roll_deg, pitch_deg].map(f64::to_radians);
            let mount = UnitQuaternion::from_euler_angles(0.0, pitch, 0.0)
                * UnitQuaternion::from_euler_angles(roll, 0.0, 0.0);
            let (track, truth, ..) = twin([0.0; 3], mount);
            let found = motion(&track, &Settings::default()).unwrap().inputs;
            let [roll, pitch] = [&found.roll_rad, &found.pitch_rad]
                .map(|x| rms(x[2000..6000].iter().copied()).to_degrees());
            let truth = rms(truth[2000..6000].iter().copied()).to_degrees();
            assert!(
                (roll - truth).abs() < 0.02 * truth && pitch < 0.02 * truth,
                "{roll_deg} {pitch_deg}: {roll} {pitch} {truth}"
            );
        }
    }
}

/// A sensor that sits otherwise than declared is found out, one as declared is not, nor what nobody declared.
#[test]
fn a_load_on_its_side_or_back_is_another_mounting() {
    let declared = UnitQuaternion::from_euler_angles(0.3, -0.2, 0.5);
    for (turned_deg, found) in [(0.0, false), (30.0, false), (90.0, true), (180.0, true)] {
        let turn = UnitQuaternion::from_euler_angles(f64::to_radians(turned_deg), 0.0, 0.0);
        let (track, ..) = twin([0.0; 3], turn * declared);
        let lean_deg = |mounting| {
            let settings = Settings {
                mounting,
                ..Settings::default()
            };
            motion(&track, &settings).unwrap().misdeclared_deg()
        };
        let seen = lean_deg(Mounting::Known(declared));
        assert_eq!(seen.is_some(), found, "{turned_deg}: {seen:?}");
        assert!(
            seen.is_none_or(|seen| (seen - turned_deg).abs() < 3.0),
            "{seen:?}"
        );
        assert_eq!(lean_deg(Mounting::Levelled), None);
    }
}

/// A slow sensor off the centre loses nothing of the heave: to 3e-4 at 2.14 Hz and 50 Hz.
#[test]
fn weights_take_nothing_from_the_height() {
    let lever = [0.4, 0.05, 0.25];
    let (fast, _, height, _) = twin(lever, UnitQuaternion::identity());
    let slow = |x: &[[f64; 3]]| x.iter().copied().step_by(4).collect();
    let track = Track {
        t_s: fast.t_s.iter().copied().step_by(4).collect(),
        gyro_rad_per_s: slow(&fast.gyro_rad_per_s),
        accel_m_per_s2: slow(&fast.accel_m_per_s2),
        dropped: 0,
    };
    let settings = |lever_m| Settings {
        lever_m,
        orientation: Options::without_latency(),
        ..Settings::default()
    };
    let rms_of = |track: &Track, lever| {
        let found = motion(track, &settings(lever)).unwrap().inputs.height_m;
        rms(found[500..1500].iter().copied())
    };
    // What the double integral itself makes of so few samples is not the weights' doing.
    let central = {
        let (fast, ..) = twin([0.0; 3], UnitQuaternion::identity());
        Track {
            t_s: track.t_s.clone(),
            gyro_rad_per_s: slow(&fast.gyro_rad_per_s),
            accel_m_per_s2: slow(&fast.accel_m_per_s2),
            dropped: 0,
        }
    };
    let (off, at) = (rms_of(&track, lever), rms_of(&central, [0.0; 3]));
    println!("{off} {at} {}", rms(height[2000..6000].iter().copied()));
    assert!((off / at - 1.0).abs() < 1e-3, "{off} {at}");
}

/// What jumps feels more than gravity on average: the accelerometer is not to blame for a gyroscope in degrees all the same.
#[test]
fn jumping_hides_no_gyroscope_in_degrees() {
    let (mut track, ..) = twin([0.0; 3], UnitQuaternion::identity());
    let samples = track
        .gyro_rad_per_s
        .iter_mut()
        .zip(&mut track.accel_m_per_s2);
    for ((rate, accel), k) in samples.zip(0..) {
        *rate = rate.map(f64::to_degrees);
        accel[1] += if k % 2 == 0 { 15.0 } else { -15.0 };
    }
    let error = motion(&track, &Settings::default()).unwrap_err();
    assert!(matches!(error, MotionError::Turning { .. }), "{error}");
    for accel in &mut track.accel_m_per_s2 {
        accel[2] -= 9.81;
    }
    let error = motion(&track, &Settings::default()).unwrap_err();
    assert!(matches!(error, MotionError::NoGravity { .. }), "{error}");
}

#[test]
fn a_swinging_body_comes_back_from_a_sensor_off_its_centre() {
    let lever = [0.4, 0.05, 0.25];
    // About one axis: levelling by gravity cannot see a turn about the vertical.
    let mount = UnitQuaternion::from_euler_angles(0.1, 0.0, 0.0);
    let (track, roll, height, support) = twin(lever, mount);
    let settings = Settings {
        lever_m: lever,
        orientation: Options::without_latency(),
        ..Settings::default()
    };
    let found = motion(&track, &settings).unwrap();
    let inner = 2000..6000;
    let error = |a: &[f64], b: &[f64]| rms(inner.clone().map(|i| a[i] - b[i]));
    assert!(
        error(&found.inputs.roll_rad, &roll).to_degrees() < 0.2,
        "{}",
        error(&found.inputs.roll_rad, &roll).to_degrees()
    );
    let lost = error(&found.inputs.height_m, &height) / rms(height.iter().copied());
    assert!(lost < 0.01, "{lost}");
    assert!(error(&found.inputs.support_ratio, &support) < 0.02);
    let m = metrics(
        &found,
        Window {
            start_s: 10.0,
            end_s: 30.0,
        },
    );
    let value = m.get("rms_roll_deg").unwrap();
    let true_deg = rms(roll[2000..6000].iter().copied()).to_degrees();
    assert!(
        (value.as_f64().unwrap() - true_deg).abs() < 0.1,
        "{value:?}"
    );
    assert_eq!(value.source, "imu");
    let [low, high] = value.ci95.unwrap();
    assert!(low < true_deg && true_deg < high);
    assert!(m.get("z_mean_m").unwrap().reason.is_some());
}

#[test]
fn a_height_that_wanders_slowly_is_less_sure() {
    let (settings, window) = most();
    let mut random = Random(11);
    let (mut kept, mut widths) = ([0; 2], [0.0; 2]);
    for _ in 0..12 {
        // Lines from well below the corner to twice it, 4 mm RMS in all.
        let lines: Vec<[f64; 3]> = (1..=8)
            .map(|k| [0.05 * f64::from(k), 0.002, TAU * random.uniform()])
            .collect();
        for (which, lines) in [&lines[..0], &lines].into_iter().enumerate() {
            let (mut track, roll, mut height, _) = twin([0.0; 3], UnitQuaternion::identity());
            for (k, t) in track.t_s.iter().enumerate() {
                let mut up = 0.0;
                for [hz, amplitude, phase] in lines {
                    let line = amplitude * (TAU * hz * t + phase).sin();
                    height[k] += line;
                    up -= (TAU * hz).powi(2) * line;
                }
                let body_from_earth = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -roll[k]);
                let felt = Vector3::from(track.accel_m_per_s2[k]);
                track.accel_m_per_s2[k] =
                    (felt + body_from_earth * Vector3::new(0.0, 0.0, up)).into();
            }
            let found = metrics(&motion(&track, &settings).unwrap(), window);
            let height = &height[window.range(&track.t_s)];
            let (least, most) = height
                .iter()
                .fold((f64::MAX, f64::MIN), |(a, b), z| (a.min(*z), b.max(*z)));
            let [low, high] = found.get("dz_pp_m").unwrap().ci95.unwrap();
            kept[which] += usize::from((low..=high).contains(&(most - least)));
            widths[which] += (high - low) / 12.0;
        }
    }
    // Without the share of the course below the corner 12 and 0 held the truth, 6 and 7 mm wide.
    assert!(kept[0] >= 11 && kept[1] >= 11, "{kept:?} {widths:?}");
    assert!(
        widths[0] < 0.012 && widths[1] > 1.5 * widths[0],
        "{widths:?}"
    );
}

/// The longer noise is looked at, the more it adds to the largest and takes from the smallest: ten minutes of a small heave held the truth never.
#[test]
fn what_noise_adds_to_a_largest_minus_a_smallest_is_in_its_interval() {
    let (swing_m, dt, hz) = (0.02, 0.005, 2.1);
    for seed in 1..=6 {
        let mut random = Random(seed);
        let mut track = Track::default();
        for k in 0..120_000 {
            let t = f64::from(k) * dt;
            let up = -swing_m * (TAU * hz).powi(2) * (TAU * hz * t).sin();
            let mut noise = |sd: f64| sd * random.normal();
            track.gyro_rad_per_s.push([0; 3].map(|_| noise(2e-3)));
            track
                .accel_m_per_s2
                .push([noise(0.04), noise(0.04), 9.80665 + up + noise(0.04)]);
            track.t_s.push(t);
        }
        let found = metrics(
            &motion(&track, &Settings::default()).unwrap(),
            Window::from(5.0),
        );
        let dz = found.get("dz_pp_m").unwrap();
        let [low, high] = dz.ci95.unwrap();
        assert!(
            (low..=high).contains(&(2.0 * swing_m)) && high - low < 0.02,
            "{dz:?}"
        );
    }
}

/// A roll that begins three quarters into the window, seen at 26 Hz.
#[test]
fn what_a_slow_sensor_feels_late_counts_too() {
    let (settings, window) = most();
    let (w, hz) = (TAU * 1.07, 26.0);
    let swell = |t: f64| 0.15 * (1.0 + (t - 28.0).tanh());
    let roll = |t: f64| swell(t) * (w * t).sin();
    let mut track = Track::default();
    for t in (0..40 * 26).map(|k| f64::from(k) / hz) {
        let swells = 0.15 / (t - 28.0).cosh().powi(2);
        let rate = swells * (w * t).sin() + swell(t) * w * (w * t).cos();
        let felt = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -roll(t))
            * Vector3::new(0.0, 0.0, settings.gravity_m_per_s2);
        track.t_s.push(t);
        track.gyro_rad_per_s.push([rate, 0.0, 0.0]);
        track.accel_m_per_s2.push(felt.into());
    }
    let true_deg = rms((5000..35_000).map(|k| roll(f64::from(k) / 1e3))).to_degrees();
    let found = metrics(&motion(&track, &settings).unwrap(), window);
    let found = found.get("rms_roll_deg").unwrap();
    let [low, high] = found.ci95.unwrap();
    assert!(
        low <= true_deg && true_deg <= high,
        "{found:?}, true {true_deg}"
    );
    assert!(
        (found.as_f64().unwrap() - true_deg).abs() < 0.005 * true_deg,
        "{found:?}"
    );
}

/// A rattle of 49.5 Hz moves nothing by a micrometre, but at 50 Hz looks like a course of 0.5 Hz.
#[test]
fn what_folds_onto_a_slow_course_is_less_sure() {
    let (settings, window) = most();
    let (mut track, _, height, _) = twin([0.0; 3], UnitQuaternion::identity());
    for (t, felt) in track.t_s.iter().zip(&mut track.accel_m_per_s2) {
        felt[2] += 0.05 * (TAU * 49.5 * t).sin();
    }
    let mut slow = Track::default();
    for k in (0..track.len()).step_by(4) {
        slow.append(track.part(k..k + 1));
    }
    let height = &height[window.range(&track.t_s)];
    let (least, most) =
        (height.iter()).fold((f64::MAX, f64::MIN), |(a, b), z| (a.min(*z), b.max(*z)));
    let [fast, slow] = [track, slow].map(|track| {
        let found = metrics(&motion(&track, &settings).unwrap(), window);
        let found = found.get("dz_pp_m").unwrap();
        let [low, high] = found.ci95.unwrap();
        assert!(low <= most - least && most - least <= high, "{found:?}");
        (found.as_f64().unwrap() - (most - least), high - low)
    });
    assert!(fast.0.abs() < 0.001 && fast.1 < 0.012, "{fast:?}");
    assert!(slow.0 > 0.005, "{slow:?}");
}

/// Most of a twin, whose samples are true at their stamps.
fn most() -> (Settings, Window) {
    let settings = Settings {
        orientation: Options::without_latency(),
        ..Settings::default()
    };
    let window = Window {
        start_s: 5.0,
        end_s: 35.0,
    };
    (settings, window)
}

#[test]
fn a_hole_takes_away_what_it_hides_and_nothing_else() {
    let (track, roll, height, _) = twin([0.0; 3], UnitQuaternion::identity());
    let (settings, window) = most();
    let true_deg = rms(roll[1000..7000].iter().copied()).to_degrees();
    let swing_m =
        height.iter().copied().fold(0.0, f64::max) - height.iter().copied().fold(0.0, f64::min);
    let whole = metrics(&motion(&track, &settings).unwrap(), window);
    for hole_s in [0.35, 0.5, 2.0] {
        let (before, behind) = (0..3600, 3600 + (hole_s / 0.005) as usize..track.len());
        let mut holed = track.part(before);
        holed.append(track.part(behind));
        let found = motion(&holed, &settings).unwrap();
        assert_eq!(found.stretches.len(), 2);
        assert!(
            (found.left_out_s(Window::ALL)[0] - hole_s).abs() < 0.006,
            "{}",
            found.left_out_s(Window::ALL)[0]
        );
        let m = metrics(&found, window);
        for (name, truth) in [
            ("rms_roll_deg", true_deg),
            ("dz_pp_m", swing_m),
            ("peak_hz", 2.14),
            ("roll_peak_hz", 1.07),
        ] {
            let [low, high] = m.get(name).unwrap().ci95.unwrap();
            println!("{hole_s} s out: {name} {low:.4} … {high:.4}, true {truth:.4}");
            assert!(low < truth && truth < high, "{name} {low} {truth} {high}");
        }
        let word = |m: &Metrics| m.get("mechanism").unwrap().as_word().map(str::to_owned);
        assert_eq!(word(&m), word(&whole));
    }
    // One sample an hour late is a stretch too short to count.
    let mut late = track.clone();
    late.append(track.part(0..1));
    *late.t_s.last_mut().unwrap() = 3640.0;
    assert_eq!(
        motion(&late, &settings).unwrap().inputs.t_s.len(),
        track.len()
    );
}

/// What a twin does from 5 to 35 s.
fn truths(roll: &[f64], height: &[f64]) -> [(&'static str, f64); 3] {
    let inner = 1000..7000;
    [
        (
            "rms_roll_deg",
            rms(roll[inner.clone()].iter().copied()).to_degrees(),
        ),
        ("dz_pp_m", 0.12),
        ("rms_z_m", rms(height[inner].iter().copied())),
    ]
}

/// The twin with a sensor's noise.
fn noisy_twin() -> (Track, Vec<f64>, Vec<f64>) {
    let (mut track, roll, height, _) = twin([0.0; 3], UnitQuaternion::identity());
    let mut random = Random(7);
    for (readings, sd) in [
        (&mut track.gyro_rad_per_s, 0.003),
        (&mut track.accel_m_per_s2, 0.05),
    ] {
        let all = readings.iter_mut().flatten();
        all.for_each(|x| *x += sd * random.normal());
    }
    (track, roll, height)
}

/// Without rows of so many samples, a share of all, that begin anywhere.
fn without_rows(track: &Track, row: usize, share: f64, seed: u64) -> Track {
    let mut random = Random(seed);
    let mut lost = vec![false; track.len()];
    while (lost.iter().filter(|l| **l).count() as f64) < share * track.len() as f64 {
        let begin = 1 + (random.uniform() * (track.len() - row - 2) as f64) as usize;
        if !lost[begin - 1..=begin + row].contains(&true) {
            lost[begin..begin + row].fill(true);
        }
    }
    let mut kept = Track::default();
    for (k, _) in lost.iter().enumerate().filter(|(_, lost)| !**lost) {
        kept.append(track.part(k..k + 1));
    }
    kept
}

#[test]
fn short_holes_are_drawn_through() {
    let (track, roll, height) = noisy_twin();
    let (settings, window) = most();
    let lines = [("peak_hz", 2.14), ("roll_peak_hz", 1.07)];
    let truths = [&truths(&roll, &height)[..], &lines].concat();
    for (row, share) in [
        (3, 0.03),
        (10, 0.03),
        (18, 0.03),
        (5, 0.1),
        (40, 0.03),
        (20, 0.1),
    ] {
        for seed in 1..4 {
            let found = motion(&without_rows(&track, row, share, seed), &settings).unwrap();
            assert_eq!(found.stretches.len(), 1, "{row}");
            assert!(found.left_out_s(Window::ALL)[0] < 1e-9 && found.again.is_some());
            let drawn = found.drawn_s() / 40.0;
            assert!((drawn / share - 1.0).abs() < 0.1, "{drawn} of {share}");
            let m = metrics(&found, window);
            for &(name, truth) in &truths {
                let [low, high] = m.get(name).unwrap().ci95.unwrap();
                println!("{row} {share} {name} {low:.4} … {high:.4}, true {truth:.4}");
                assert!(low < truth && truth < high, "{name} {low} {truth} {high}");
            }
        }
    }
}

/// A hole that no other hole leaves room to try is not drawn through.
#[test]
fn holes_that_nothing_tells_of_part_a_track() {
    let (track, ..) = noisy_twin();
    let (settings, _) = most();
    let mut holed = track.part(0..4000);
    // Ten samples are lost, four there, ten lost, and so on to the end.
    for begin in (4010..4400).step_by(14) {
        holed.append(track.part(begin..begin + 4));
    }
    let found = motion(&holed, &settings).unwrap();
    assert_eq!(found.inputs.t_s.len(), 4000);
    assert!(found.again.is_none() && found.drawn_s() == 0.0);
    assert!(
        (found.left_out_s(Window::ALL)[0] - 1.96).abs() < 0.04,
        "{}",
        found.left_out_s(Window::ALL)[0]
    );
}

#[test]
fn single_samples_may_be_lost() {
    let (track, roll, height, _) = twin([0.0; 3], UnitQuaternion::identity());
    let (settings, window) = most();
    let truths = truths(&roll, &height);
    // One in a hundred at 50 Hz, one in twenty at 100 and 200 Hz.
    for (every, share) in [(4, 0.01), (2, 0.05), (1, 0.05)] {
        let mut random = Random(5);
        let mut kept = Track::default();
        for k in (0..track.len()).step_by(every) {
            if k == 0 || random.uniform() >= share {
                kept.append(track.part(k..k + 1));
            }
        }
        let m = metrics(&motion(&kept, &settings).unwrap(), window);
        for (name, truth) in truths {
            let [low, high] = m.get(name).unwrap().ci95.unwrap();
            println!("{every} {share} {name} {low:.4} … {high:.4}, true {truth:.4}");
            assert!(low < truth && truth < high, "{name} {low} {truth} {high}");
        }
    }
}

/// Times of a log scatter: of two samples that came together no cubic may make a slope. It made RMS roll up to 14 % too large.
#[test]
fn samples_that_came_late_bend_no_rate() {
    let (track, roll, ..) = twin([0.0; 3], UnitQuaternion::identity());
    let (settings, window) = most();
    let truth = rms(roll[1000..7000].iter().copied()).to_degrees();
    for (share, seed) in [0.0, 0.03]
        .into_iter()
        .flat_map(|s| (0..8).map(move |k| (s, k)))
    {
        let mut random = Random(seed);
        let mut kept = Track::default();
        for k in 0..track.len() {
            let mut sample = track.part(k..k + 1);
            sample.t_s[0] -= 0.002 * (1.0 - random.uniform()).ln();
            let later = kept.t_s.last().is_none_or(|last| sample.t_s[0] > *last);
            if later && random.uniform() >= share {
                kept.append(sample);
            }
        }
        let m = metrics(&motion(&kept, &settings).unwrap(), window);
        let found = m.number("rms_roll_deg").unwrap();
        // Measured: −0.1 to +0.1 %.
        assert!(
            (found / truth - 1.0).abs() < 0.002,
            "{share} {seed}: {found} {truth}"
        );
    }
}

#[test]
fn up_is_found_in_the_window_whatever_was_before() {
    let (mut track, roll, ..) = twin([0.0; 3], UnitQuaternion::identity());
    // On its side for the first 8 s.
    for k in 0..1600 {
        track.accel_m_per_s2[k] = [0.0, 9.80665, 0.0];
        track.gyro_rad_per_s[k] = [0.0; 3];
    }
    for k in 1600..1800 {
        track.accel_m_per_s2[k] = [0.0, 9.80665, 0.0];
        track.gyro_rad_per_s[k] = [std::f64::consts::FRAC_PI_2, 0.0, 0.0];
    }
    let window = Window {
        start_s: 20.0,
        end_s: 38.0,
    };
    let settings = Settings {
        orientation: Options::without_latency(),
        level_over: window,
        ..Settings::default()
    };
    let found = metrics(&motion(&track, &settings).unwrap(), window);
    let [low, high] = found.get("rms_roll_deg").unwrap().ci95.unwrap();
    let true_deg = rms(roll[4000..7600].iter().copied()).to_degrees();
    assert!(low < true_deg && true_deg < high, "{low} {true_deg} {high}");
}

#[test]
fn a_gyroscope_in_degrees_is_said() {
    let (mut track, ..) = twin([0.0; 3], UnitQuaternion::identity());
    for w in track.gyro_rad_per_s.iter_mut().flatten() {
        *w = w.to_degrees();
    }
    let error = motion(&track, &Settings::default()).unwrap_err();
    assert!(matches!(error, MotionError::Turning { .. }), "{error}");
    // Off the centre a part of gravity is taken back.
    for a in track.accel_m_per_s2.iter_mut().flatten() {
        *a *= 0.7;
    }
    let error = motion(&track, &Settings::default()).unwrap_err();
    assert!(matches!(error, MotionError::Turning { .. }), "{error}");
}

/// Height is given away at its ends: half a period of the corner, at most a tenth of all, and 0.8 of it beside a hole; nothing else is.
#[test]
fn height_is_unknown_for_as_long_as_is_said() {
    let (track, ..) = twin([0.0; 3], UnitQuaternion::identity());
    let (settings, _) = most();
    let unknown = |track: &Track| -> Vec<Range<usize>> {
        let found = motion(track, &settings).unwrap().inputs.height_m;
        let mut at = 0;
        let runs = found.chunk_by(|a, b| a.is_nan() == b.is_nan());
        let ranges = runs.map(|run| {
            at += run.len();
            (run[0].is_nan(), at - run.len()..at)
        });
        ranges.filter(|r| r.0).map(|r| r.1).collect()
    };
    // 2.5 s of 40 s, a tenth of 12 s.
    assert_eq!(unknown(&track), [0..500, 7500..8000]);
    assert_eq!(unknown(&track.part(0..2400)), [0..240, 2160..2400]);
    // Half a second is lost at 18 s: 4 s on both sides.
    let mut holed = track.part(0..3600);
    holed.append(track.part(3700..8000));
    assert_eq!(unknown(&holed), [0..500, 2800..4400, 7400..7900]);
    // And so much is said to be left out, whenever it began.
    let mut later = holed.clone();
    later.t_s.iter_mut().for_each(|t| *t += 1000.0);
    let found = motion(&later, &settings).unwrap();
    assert!(
        (found.left_out_s(Window::ALL)[0] - 0.505).abs() < 1e-6,
        "{}",
        found.left_out_s(Window::ALL)[0]
    );
    // A stretch of 6 s between two holes has none.
    let mut twice = holed.part(0..4700);
    twice.append(holed.part(4800..7900));
    assert_eq!(unknown(&twice), [0..500, 2800..5500, 7300..7800]);
}

/// 25 Hz are enough, also by a clock that runs 50 ppm slow, and by stamps with a rounding in them.
#[test]
fn the_least_rate_is_enough() {
    let at = |hz: f64, begins_s: f64| {
        let mut track = Track::default();
        for k in 0..1000 {
            track.t_s.push(begins_s + f64::from(k) / hz);
            track.gyro_rad_per_s.push([0.0; 3]);
            track.accel_m_per_s2.push([0.0, 0.0, 9.80665]);
        }
        motion(&track, &Settings::default())
    };
    for (hz, begins_s) in [(25.0, 0.0), (25.0, 0.1), (25.0, 1234.5), (24.99875, 0.0)] {
        assert!(at(hz, begins_s).is_ok(), "{hz} Hz from {begins_s} s on");
    }
    let error = at(24.0, 0.0).unwrap_err().to_string();
    assert!(
        error.contains("sampled at 24.0 Hz") && error.contains("at least 25 Hz"),
        "{error}"
    );
}

/// Pushed to and fro in step with its roll, by an accelerometer that is 20 ms old at its stamps: turned as it lies by then it would feel a support
/// 3 % off. The bias upwards is found.
#[test]
fn an_accelerometer_that_is_late_feels_the_same_support() {
    let (w, swing) = (TAU * 1.07, 0.35);
    let roll = |t: f64| swing * (w * t).sin();
    let mut track = Track::default();
    let age_s = 0.02;
    for t in (0..8000).map(|k| 0.005 * f64::from(k)) {
        let then = t - age_s;
        let earth_from_body = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), roll(then));
        let push = Vector3::new(0.0, 4.0 * (w * then).sin(), 9.80665 + 0.2);
        track.t_s.push(t);
        track
            .gyro_rad_per_s
            .push([swing * w * (w * t).cos(), 0.0, 0.0]);
        track
            .accel_m_per_s2
            .push((earth_from_body.inverse() * push).into());
    }
    let settings = Settings {
        orientation: Options {
            accel_latency_s: age_s,
            ..Options::without_latency()
        },
        ..Settings::default()
    };
    let found = motion(&track, &settings).unwrap();
    let known = 1.0 + 0.2 / 9.80665;
    for ratio in &found.inputs.support_ratio[2000..6000] {
        assert!((ratio - known).abs() < 0.01, "{ratio} {known}");
    }
    assert!((found.gravity_off_m_per_s2 - 0.2).abs() < 0.03);
    let mean = found.accel_up_m_per_s2.iter().sum::<f64>();
    assert!(mean.abs() < 1e-6, "{mean}");
}

/// A cubic is drawn through four samples about one that is lost, and straight lines everywhere else.
#[test]
fn what_is_lost_is_drawn_as_a_cubic_where_samples_are_even() {
    let cube = |t: &f64| t.powi(3);
    let at = |t_s: &[f64], at_s: f64| {
        let x: Vec<f64> = t_s.iter().map(cube).collect();
        drawn(t_s, &x, &[at_s], 1.0)[0]
    };
    let straight = |a: f64, b: f64| 0.5 * (cube(&a) + cube(&b));
    let lost = [10.0, 11.0, 12.0, 14.0, 15.0, 16.0];
    assert!((at(&lost, 13.0) - cube(&13.0)).abs() < 1e-9);
    assert_eq!(at(&lost, 11.5), straight(11.0, 12.0));
    // A little late is even enough, a third is not.
    let late = |k: f64| at(&[11.0, 12.0, k, 14.0, 16.0, 17.0], 15.0);
    assert!((late(12.9) - cube(&15.0)).abs() < 1e-9);
    for k in [12.7, 12.33, 13.6] {
        assert_eq!(late(k), straight(14.0, 16.0), "{k}");
    }
}

/// What is faster than people move is taken from a fast sensor, by a gain of 1/(1 + (f/60 Hz)⁴), before it is differentiated.
#[test]
fn a_fast_sensor_is_smoothed_before_it_is_differentiated() {
    let sine = |hz: f64, rate_hz: f64| -> Vec<Vector3<f64>> {
        let at = |k: u32| (TAU * hz * f64::from(k) / rate_hz).sin();
        (0..4000)
            .map(|k| Vector3::new(at(k), 0.0, -at(k)))
            .collect()
    };
    let size = |v: &[Vector3<f64>]| rms(v[1000..3000].iter().map(|v| v.x));
    for (hz, gain) in [
        (10.0, 1.0 / (1.0 + (1.0f64 / 6.0).powi(4))),
        (90.0, 1.0 / (1.0 + 1.5f64.powi(4))),
    ] {
        let fast = sine(hz, 2000.0);
        let found = size(&below(&fast, 1.0 / 2000.0)) / size(&fast);
        assert!((found - gain).abs() < 0.01, "{hz} Hz: {found}");
        let slow = sine(hz, 250.0);
        assert_eq!(below(&slow, 1.0 / 250.0), slow);
    }
}

#[test]
fn removed_gravity_is_said() {
    let (mut track, ..) = twin([0.0; 3], UnitQuaternion::identity());
    for a in &mut track.accel_m_per_s2 {
        a[2] -= 9.8;
    }
    let error = motion(&track, &Settings::default()).unwrap_err();
    assert!(matches!(error, MotionError::NoGravity { .. }), "{error}");
    assert!(matches!(
        motion(&Track::default(), &Settings::default()),
        Err(MotionError::TooShort { .. })
    ));
}

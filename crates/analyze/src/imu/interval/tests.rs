use super::draws::walked;
use super::*;
use crate::imu::orientation::Options;
use crate::imu::rath::{Mounting, Settings, motion};
use crate::imu::track::Instrument;
use crate::imu::track::Track;
use crate::random::Random;
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::{PI, TAU};

const G: f64 = 9.80665;
const MOST: Window = Window {
    start_s: 5.0,
    end_s: 35.0,
};

fn beyond(name: &str, motion: &Motion, window: Window) -> f64 {
    Beyond::of(motion, window).unwrap().sd(name)
}

/// What a sensor at the centre of mass makes of a roll [rad] and of a support [1] over time, its gyroscope's scale off and its accelerometer biased.
fn felt(
    roll: impl Fn(f64) -> f64,
    support: impl Fn(f64) -> f64,
    scale: f64,
    bias: [f64; 3],
    mounting: Mounting,
    told: Option<f64>,
) -> Motion {
    let mut track = Track::default();
    for t in (0..4000).map(|k| 0.01 * f64::from(k)) {
        let rate = (roll(t + 1e-5) - roll(t - 1e-5)) / 2e-5;
        let body_from_earth = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -roll(t));
        let force = body_from_earth * Vector3::new(0.0, 0.0, G * support(t));
        track.t_s.push(t);
        track.gyro_rad_per_s.push([scale * rate, 0.0, 0.0]);
        track
            .accel_m_per_s2
            .push((force + Vector3::from(bias)).into());
    }
    let settings = Settings {
        orientation: Options::without_latency(),
        mounting,
        gravity_m_per_s2: G,
        budget: Budget {
            accel_bias_m_per_s2: told,
            gyro_scale_error: told.map(|_| 0.0),
            mounting_error_rad: told.map(|_| 0.0),
            ..Budget::default()
        },
        ..Settings::default()
    };
    motion(&track, &settings).unwrap()
}

const AS_IT_SITS: Mounting = Mounting::Known(UnitQuaternion::new_unchecked(
    nalgebra::Quaternion::new(1.0, 0.0, 0.0, 0.0),
));

/// Where a load does not roll at f, a ratio to that is one to the sensor's noise: eight of these differed by far more than their intervals.
#[test]
fn a_ratio_to_nothing_has_no_interval() {
    for (at_f_rad, told) in [(0.0, false), (0.01, true)] {
        let motion = felt(
            |t| 0.15 * (TAU * 1.05 * t).sin() + at_f_rad * (TAU * 2.1 * t).sin(),
            |t| 1.0 + 0.3 * (TAU * 2.1 * t).sin(),
            1.0,
            [0.0; 3],
            AS_IT_SITS,
            None,
        );
        let found = metrics(&motion, MOST);
        let ratio = found.get("subharmonic_ratio").unwrap();
        assert_eq!(ratio.ci95.is_some(), told, "{ratio:?}");
        assert_eq!(ratio.as_f64().unwrap() < 1e6, told, "{ratio:?}");
    }
}

/// A bias of 1.8 standard deviations is within every interval, and without one that of a calibrated sensor is narrow.
#[test]
fn a_bias_is_in_the_intervals_of_a_known_mounting() {
    let roll = |t: f64| 0.02 * (TAU * 1.07 * t).sin();
    for (sd, told) in [(0.03, Some(0.03)), (0.2, Some(0.2)), (0.1, None)] {
        let off = 1.8 * sd;
        let found = felt(roll, |_| 1.0, 1.0, [off, -off, 0.0], AS_IT_SITS, told);
        let found = metrics(&found, MOST);
        for (name, truth) in [
            ("rms_roll_deg", 0.02f64.to_degrees() / 2f64.sqrt()),
            ("rms_pitch_deg", 0.0),
        ] {
            let [low, high] = found.get(name).unwrap().ci95.unwrap();
            assert!((low..=high).contains(&truth), "{sd} {name}: {low} {high}");
        }
        let said = found.get("rms_roll_deg").unwrap().reason.is_some();
        assert_eq!(said, told.is_none());
    }
    let width = |mounting, told| {
        let found = metrics(&felt(roll, |_| 1.0, 1.0, [0.0; 3], mounting, told), MOST);
        let [low, high] = found.get("rms_pitch_deg").unwrap().ci95.unwrap();
        high - low
    };
    assert!(width(AS_IT_SITS, Some(0.0)) < 0.2 && width(Mounting::Levelled, None) < 0.2);
}

/// A roll of 18.7° RMS and a pitch of 0.4°, both about means of their own, seen by a sensor that was turned about the vertical: the pitch's interval holds it 95
/// times in a hundred or more, and where nothing is turned it is as wide as before.
#[test]
fn what_a_turned_sensor_takes_for_pitch_is_in_its_interval() {
    let mut random = Random(17);
    let t = |k: u32| 0.01 * f64::from(k);
    let roll: Vec<f64> = (0..3000)
        .map(|k| 0.46 * (TAU * 1.07 * t(k)).sin())
        .collect();
    let amplitude = 0.4f64.to_radians() * 2f64.sqrt();
    let rms_deg = |x: &[f64]| {
        let square = x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64;
        square.sqrt().to_degrees()
    };
    let mut held = 0;
    for _ in 0..400 {
        let (turned, phase) = (0.02 * random.normal(), TAU * random.uniform());
        let own: Vec<f64> = (0..3000)
            .map(|k| amplitude * (TAU * 2.14 * t(k) + phase).sin())
            .collect();
        let pitch: Vec<f64> = (own.iter().zip(&roll))
            .map(|(own, roll)| own + turned * roll)
            .collect();
        let (true_deg, root) = (rms_deg(&own), rms_deg(&pitch));
        let [low, high] = mixed(root, [root; 2], &pitch, &roll, 1.96 * 0.02);
        held += u32::from((low..=high).contains(&true_deg));
        let [low, high] = mixed(root, [root - 0.1, root + 0.1], &pitch, &roll, 0.0);
        assert!((low - root + 0.1).abs() < 1e-9 && (high - root - 0.1).abs() < 1e-9);
    }
    assert!((370..=400).contains(&held), "{held}");
}

/// A gyroscope's scale that is 1.8 standard deviations off is in the interval, of one that somebody told of and of one that nobody did.
#[test]
fn a_gyroscopes_scale_is_in_the_interval_of_the_roll() {
    let roll = |t: f64| 0.3 * (TAU * 1.07 * t).sin();
    let truth = 0.3f64.to_degrees() / 2f64.sqrt();
    for (sd, told) in [(0.0, Some(0.0)), (0.02, Some(0.02)), (0.005, None)] {
        for off in [-1.8 * sd, 1.8 * sd] {
            let mut found = felt(roll, |_| 1.0, 1.0 + off, [0.0; 3], AS_IT_SITS, Some(0.0));
            found.settings.budget.gyro_scale_error = told;
            let found = metrics(&found, MOST);
            let value = found.get("rms_roll_deg").unwrap();
            let [low, high] = value.ci95.unwrap();
            assert!((low..=high).contains(&truth), "{sd}: {low} {truth} {high}");
            let half = 0.5 * (high - low) / 1.96 / truth;
            let by_hand = sd.hypot(0.003);
            assert!(
                (half / by_hand - 1.0).abs() < 0.3,
                "{half}, by hand {by_hand}"
            );
            let said = value.reason.as_deref().unwrap_or("");
            assert_eq!(said.contains("gyro_scale_error"), told.is_none(), "{said}");
        }
    }
}

/// A constant angle seen with one that is off at random: what is stated holds it 95 times in a hundred.
#[test]
fn a_lean_is_held_as_often_as_stated() {
    let mut random = Random(9);
    for (mean, swing, lean) in [(0.0, 0.0, 1.0), (0.0, 1.0, 1.0), (2.0, 0.5, 0.3)] {
        let truth = f64::hypot(mean, swing);
        let rounds = 4000;
        let mut kept = 0;
        for _ in 0..rounds {
            let seen = mean + lean * random.normal();
            let root = f64::hypot(seen, swing);
            let [low, high] = tilted(root, [root; 2], seen, 1.96 * lean);
            kept += usize::from(low <= truth + 1e-12 && truth <= high);
        }
        let covers = f64::from(u32::try_from(kept).unwrap()) / f64::from(rounds);
        assert!((0.94..1.0).contains(&covers), "{mean} {swing}: {covers}");
    }
}

/// Gravity 2 % too long may be a scale, of which nothing is left when nothing is felt, or a bias, of which all is.
#[test]
fn a_bias_upwards_is_in_the_interval_of_what_floats() {
    let support = |t: f64| 1.0 + 1.2 * (TAU * 1.8 * t).sin();
    let truth = (PI - 2.0 * (0.95f64 / 1.2).asin()) / TAU;
    for off in [-0.2, 0.2] {
        let found = felt(
            |_| 0.0,
            support,
            1.0,
            [0.0, 0.0, off],
            Mounting::Levelled,
            None,
        );
        let found = metrics(&found, MOST);
        let [low, high] = found.get("t_float").unwrap().ci95.unwrap();
        assert!((low..=high).contains(&truth), "{off}: {low} {truth} {high}");
    }
}

/// A roll that jumps to just below the threshold and later beyond it, seen by a gyroscope that shows 0.5 % too much: 1.7 standard deviations.
#[test]
fn an_onset_near_a_landing_is_in_its_interval() {
    for k in 0..40 {
        let at = 10.0 + 0.025 * f64::from(k);
        let jump = |t: f64| 1.0 + (t / 0.1).tanh();
        let amplitude = |t: f64| 6.0 + 4.0 * jump(t - at) + 2.0 * jump(t - at - 9.0);
        let roll = |t: f64| amplitude(t).to_radians() * (TAU * 1.07 * t).sin();
        let t_s: Vec<f64> = (150..1050).map(|k| f64::from(k) / 30.0).collect();
        let truth = Inputs {
            roll_rad: t_s.iter().map(|t| roll(*t)).collect(),
            t_s,
            ..Inputs::default()
        };
        let truth = metrics_of(&truth, Window::ALL, |n| n == "onset_time_s");
        let truth = truth.number("onset_time_s").unwrap();
        let found = felt(roll, |_| 1.0, 1.005, [0.0; 3], AS_IT_SITS, Some(0.0));
        let found = metrics(&found, MOST);
        let [low, high] = found.get("onset_time_s").unwrap().ci95.unwrap();
        assert!((low..=high).contains(&truth), "{k}: {low} {truth} {high}");
        assert!(high - low < 1.5, "{k}: {low} {high}");
    }
}

/// A roll of 28 samples to a period: each of its swings beyond the threshold is counted alike, one sample more or less.
#[test]
fn what_is_counted_of_samples_that_keep_step_is_in_its_interval() {
    let roll = |t: f64| 16.5f64.to_radians() * (TAU * 30.0 / 28.0 * t).sin();
    let found = felt(roll, |_| 1.0, 1.0, [0.0; 3], AS_IT_SITS, Some(0.0));
    let found = metrics(&found, MOST);
    let [low, high] = found.get("roll_excess_s").unwrap().ci95.unwrap();
    let counted = |phase: f64| {
        let t_s: Vec<f64> = (150..1050).map(|k| (f64::from(k) + phase) / 30.0).collect();
        let inputs = Inputs {
            roll_rad: t_s.iter().map(|t| roll(*t)).collect(),
            t_s,
            ..Inputs::default()
        };
        let counted = metrics_of(&inputs, Window::ALL, |n| n == "roll_excess_s");
        counted.number("roll_excess_s").unwrap()
    };
    let counts: Vec<f64> = (0..50).map(|k| counted(0.02 * f64::from(k))).collect();
    let kept = counts.iter().filter(|c| (low..=high).contains(c)).count();
    assert!(kept >= 47, "{kept} of 50 in {low} {high}: {counts:?}");
    assert!(high - low < 4.0, "{low} {high}");
}

/// Whether a roll has an onset whose 2 s, at most √(1 + |sin 4πf s| / 4πf s) times the mean, just reach the threshold, nobody knows.
#[test]
fn an_onset_that_others_would_not_find_is_said_to_be_doubtful() {
    let roll = |t: f64| {
        13.76f64.to_radians() * (TAU * 1.07 * t).sin() / (1.0 + (0.05 * (t - 20.0)).powi(4))
    };
    let found = felt(roll, |_| 1.0, 1.0, [0.0; 3], AS_IT_SITS, Some(0.0));
    let found = metrics(&found, MOST);
    for name in ["onset_time_s", "unstable"] {
        let said = found.get(name).unwrap().reason.as_deref().unwrap_or("");
        assert!(said.contains("sensors as good"), "{name}: {said}");
    }
}

const SURE: Budget = Budget {
    accel_bias_m_per_s2: Some(0.0),
    gyro_scale_error: Some(0.0),
    mounting_error_rad: Some(0.0),
    tilt_offset_rad: 0.0,
    tilt_wander_rad: 0.0,
    tilt_walk_rad_per_sqrt_s: 0.0,
    angle_scale: 0.0,
    height_scale: 0.0,
    height_wander_m: 0.0,
    support_offset: 0.0,
    support_scale: 0.0,
    support_noise: 0.0,
};

/// What each part of a budget makes of a metric by itself is known to first order. Forty draws know a standard deviation to 11 %.
#[test]
fn a_part_of_the_budget_alone_has_the_width_it_has_to_have() {
    // No samples of 30 Hz keep step with that.
    let (swing, hz) = (0.1, 1.8347);
    let support = |t: f64| 1.0 + 1.2 * (TAU * hz * t).sin();
    let sine = |t: f64| swing * (TAU * 1.07 * t).sin();
    let lean = |_: f64| swing;
    let half = |roll: &dyn Fn(f64) -> f64, up, budget, name: &str| {
        let mut found = felt(roll, support, 1.0, [0.0, 0.0, up], AS_IT_SITS, Some(0.0));
        found.settings.budget = budget;
        let [low, high] = metrics(&found, MOST).get(name).unwrap().ci95.unwrap();
        0.5 * (high - low) / 1.96
    };
    let deg = swing.to_degrees();
    // Share of time at or below c by c: T = (π − 2 asin((1 − c)/1.2))/2π.
    let by_c = 1.0 / (PI * (1.2f64.powi(2) - 0.95 * 0.95).sqrt());
    // Samples in which chance decides, twice in each period: ∫ Φ (1 − Φ) = σ/√π, in samples.
    let steep = (1.2f64.powi(2) - 0.95 * 0.95).sqrt() * TAU * hz * COUNTED_S;
    let by_chance = (2.0 * 30.0 * hz * 0.1 / steep / PI.sqrt()).sqrt() / (30.0 / COUNTED_S);
    #[rustfmt::skip]
    let cases: [(&str, &dyn Fn(f64) -> f64, f64, Budget, f64); 6] = [
        ("rms_roll_deg", &sine, 0.0, Budget { angle_scale: 0.03, ..SURE }, 0.03 * deg / 2f64.sqrt()),
        ("rms_roll_deg", &lean, 0.0, Budget { tilt_offset_rad: 0.002, ..SURE }, 0.02 * deg),
        ("rms_z_m", &lean, 0.0, Budget { height_scale: 0.05, ..SURE }, 0.05 * 1.2 * G / (TAU * hz).powi(2) / 2f64.sqrt()),
        ("t_float", &lean, 0.0, Budget { support_offset: 0.03, ..SURE }, 0.03 * by_c),
        // Seen as gravity that is 4 % too long.
        ("t_float", &lean, 0.04 * G, SURE, 0.04 * by_c),
        ("t_float", &lean, 0.0, Budget { support_noise: 0.1, ..SURE }, by_chance),
    ];
    for (name, roll, up, budget, sd) in cases {
        let sampled = half(roll, 0.0, SURE, name);
        let found = half(roll, up, budget, name);
        // Noise of that size blurs where samples fall.
        let own = match budget.support_noise > 0.0 {
            true => found,
            false => (found * found - sampled * sampled).sqrt(),
        };
        assert!(
            (own / sd - 1.0).abs() < 0.22,
            "{name} {budget:?}: {own}, by hand {sd}"
        );
    }
}

/// A load that leans by m and swings about it by v leans by m ± c or not at all: the roots of v + (m ± c)².
#[test]
fn a_bias_moves_the_lean_and_not_the_swing() {
    let [low, high] = tilted(5.0, [5.0; 2], -3.0, 1.0);
    assert!((low - 20f64.sqrt()).abs() < 1e-12 && (high - 32f64.sqrt()).abs() < 1e-12);
    assert_eq!(tilted(5.0, [4.0, 7.0], -3.0, 0.0), [4.0, 7.0]);
    let mut found = felt(
        |_| 3f64.to_radians(),
        |_| 1.0,
        1.0,
        [0.0; 3],
        AS_IT_SITS,
        None,
    );
    found.settings.budget = Budget {
        accel_bias_m_per_s2: Some(0.05),
        ..SURE
    };
    let [low, high] = metrics(&found, MOST)
        .get("rms_roll_deg")
        .unwrap()
        .ci95
        .unwrap();
    let most = (1.96 * 0.05 / G).to_degrees();
    assert!((3.0 - low - most).abs() < 1e-3 && (high - 3.0 - most).abs() < 1e-3);
}

/// A motion whose height is known, between its unknown ends.
fn thrown(height_m: impl Fn(f64) -> f64, roll: impl Fn(f64) -> f64) -> Motion {
    let h = 1e-3;
    let up = |t: f64| (height_m(t + h) - 2.0 * height_m(t) + height_m(t - h)) / (h * h);
    let support = |t: f64| 1.0 + up(t) / G;
    let mut found = felt(roll, support, 1.0, [0.0; 3], AS_IT_SITS, Some(0.0));
    let inputs = &mut found.inputs;
    for (z, t) in inputs.height_m.iter_mut().zip(&inputs.t_s) {
        if z.is_finite() {
            *z = height_m(*t);
        }
    }
    found
}

/// What no draw shows, against closed forms.
#[test]
fn what_the_window_holds_beyond_the_budget_is_known_by_hand() {
    let all = Window::ALL;
    // 3001 samples: bins of 1/30.01 Hz. Two errors, each even over half a bin either way: variance (½ bin)²/3 each.
    let bin_hz = 1.0 / 30.01;
    let line = |bins: f64| move |t: f64| (TAU * bins * bin_hz * (t - 5.0)).sin();
    let on_bins = bin_hz / 6f64.sqrt();
    let two = |t: f64| 0.3 * (line(32.0)(t) + 0.9 * line(38.0)(t));
    let one = thrown(|t| 0.05 * line(54.0)(t), two);
    let torn = on_bins.hypot(6.0 * bin_hz / 1.96);
    // Of the line at bin 60 the taper puts 1/4, 1, 1/4 on bins 59, 60, 61, and the band about bin 54 ends at 59.4: of 53 at 58.3, of 55 at 60.5.
    let three = |t: f64| 0.3 * line(27.0)(t) + 0.01 * (line(54.0)(t) + line(60.0)(t));
    let edged = thrown(|t| 0.05 * line(54.0)(t), three);
    let shares = |of_third: f64| 1.5 * 0.3f64.powi(2) / (0.01f64.powi(2) * (1.5 + of_third));
    // Two lines 59 and 118 periods long; without half a period the one falls between bins, where it is 2/π as high, the other on one.
    let harmonic = thrown(
        |t| 0.05 * (TAU * 2.0 * t).sin() + 0.015 * (TAU * 4.0 * t + 1.0).sin(),
        |_| 0.0,
    );
    let whole = Window {
        start_s: 5.0,
        end_s: 34.495,
    };
    // Grows by e^(0.02 t): between the ends, 5 s in all, for 35 s; without 15 s more it grows for 20 s.
    let growing = thrown(|t| 0.02 * (0.02 * t).exp() * (TAU * 2.0 * t).sin(), |_| 0.0);
    let thirds = |length_s: f64| (0.02 * 2.0 / 3.0 * length_s).exp();
    // Its mean square grows as e^(0.04 t): so it is from a to b, and its seven parts of 5 s spread about that of all; 5 s are 3/7 of a third.
    let mean = |a: f64, b: f64| ((0.04 * b).exp() - (0.04 * a).exp()) / (0.04 * (b - a));
    let parts = (0..7).map(|k| 5.0 * f64::from(k)).map(|a| mean(a, a + 5.0));
    let variance = parts.map(|p| (p - mean(0.0, 35.0)).powi(2)).sum::<f64>() / 7.0;
    let missing = 3.0 / 7.0 * variance.sqrt() / (2.0 * mean(0.0, 35.0 / 3.0));
    let grown = ((thirds(35.0) - thirds(20.0)) / 1.96).hypot(thirds(35.0) * missing);
    // Its mean square grows from 0.3 to 1.7 mm² over 35 s: seven parts of 5 s have it 0.2 mm² apart, with an SD of 0.4 mm².
    let power = |t: f64| 1e-6 * (1.0 + 0.04 * (t - 20.0)).max(0.01);
    let filling = thrown(|t| (2.0 * power(t)).sqrt() * (TAU * 2.0 * t).sin(), |_| 0.0);
    let ends_m = 5.0 / 40.0 * 0.4e-6 / (2.0 * 1e-3);
    for (motion, name, window, known, within) in [
        (&one, "peak_hz", MOST, on_bins, 1e-3),
        (&one, "roll_peak_hz", MOST, torn, 1e-3),
        (
            &edged,
            "subharmonic_ratio",
            MOST,
            (shares(0.25) - shares(1.25)) / 1.96,
            0.01,
        ),
        (
            &harmonic,
            "h2_ratio",
            whole,
            0.3 * (PI / 2.0 - 1.0) / 1.96,
            0.05,
        ),
        (&growing, "growth_ratio", all, grown, 0.02),
        (&filling, "rms_z_m", all, ends_m, 0.03),
    ] {
        let found = beyond(name, motion, window);
        assert!(
            (found / known - 1.0).abs() < within,
            "{name}: {found}, by hand {known}"
        );
    }
    // And it is in the interval, whatever the draws say.
    let mut sure = one.clone();
    sure.settings.budget = SURE;
    let found = metrics(&sure, MOST);
    let [low, high] = found.get("roll_peak_hz").unwrap().ci95.unwrap();
    assert!(
        (0.5 * (high - low) / (1.96 * torn) - 1.0).abs() < 0.05,
        "{low} {high}"
    );
    assert!((0.5 * (low + high) - 32.0 * bin_hz).abs() < 1e-6);
}

/// A course of 1.2 mm at 0.3 Hz: 1/(1 + (f₀/f)⁴) of it is left by f₀ = 0.2 Hz, and less by 0.4 Hz. Beyond what the budget wanders by itself
/// it stands for one that is not seen. Of that all may be in one third, which holds 3 whole swings of the course and 20 of a heave of 5 mm at 2 Hz,
/// so that cuts hardly count.
#[test]
fn a_course_that_is_seen_stands_for_one_that_is_not() {
    let of = |heave_m: f64| {
        let parts = move |t: f64| {
            [(0.0012, TAU * 0.3), (heave_m, TAU * 2.0)].map(|(a, w)| -a * w * w * (w * t).sin())
        };
        felt(
            |_| 0.0,
            move |t| 1.0 + parts(t).iter().sum::<f64>() / G,
            1.0,
            [0.0; 3],
            AS_IT_SITS,
            Some(0.0),
        )
    };
    let gain = |corner_hz: f64| 1.0 / (1.0 + (corner_hz / 0.3).powi(4));
    let rms_m = 0.0012 / 2f64.sqrt();
    let seen_m = (gain(0.2) - gain(0.4)) * rms_m;
    let lost_m = 3.8 * (seen_m.powi(2) - (0.185f64 * 0.002).powi(2)).sqrt();
    let whole_m = gain(0.2) * rms_m;
    let third_m = whole_m.hypot(0.005 / 2f64.sqrt());
    for (heave_m, name, known) in [
        (0.0, "dz_pp_m", lost_m),
        (0.0, "rms_z_m", whole_m.hypot(lost_m) - whole_m),
        (0.005, "growth_ratio", 1f64.hypot(lost_m / third_m) - 1.0),
    ] {
        let found = beyond(name, &of(heave_m), MOST);
        assert!(
            (found / known - 1.0).abs() < 0.05,
            "{name}: {found}, by hand {known}"
        );
    }
}

/// A roll at half the frequency of its heave, once with a sensor that nobody placed.
#[test]
fn what_hangs_on_the_sensors_place_says_so() {
    let mut found = felt(
        |t| 0.3 * (TAU * 0.9 * t).sin(),
        |t| 1.0 + 0.8 * (TAU * 1.8 * t).sin(),
        1.0,
        [0.0; 3],
        AS_IT_SITS,
        Some(0.0),
    );
    let say_so = |found: &Motion| -> Vec<&str> {
        let all = metrics(found, MOST).0.into_iter();
        all.filter(|(_, v)| v.reason.as_ref().is_some_and(|r| r.contains("imu_place_m")))
            .map(|(name, _)| name)
            .collect()
    };
    let hang = [
        "dz_pp_m",
        "rms_z_m",
        "t_float",
        "h2_ratio",
        "growth_ratio",
        "mechanism",
    ];
    assert_eq!(say_so(&found), hang);
    found.settings.lever_is_known = true;
    assert_eq!(say_so(&found), [""; 0]);
}

/// With a lever each touch-down is off by 0.3 of a sample at 100 Hz and 0.4 at 50 Hz, all to one side: 54 periods of two.
#[test]
fn touch_downs_of_a_sensor_off_the_centre_err_by_parts_of_a_sample() {
    let mut found = felt(
        |_| 0.0,
        |t| 1.0 + 1.2 * (TAU * 1.8 * t).sin(),
        1.0,
        [0.0; 3],
        AS_IT_SITS,
        Some(0.0),
    );
    assert_eq!(beyond("t_float", &found, MOST), 0.0);
    found.settings.lever_m = [0.0, 0.0, 0.1];
    let fast = beyond("t_float", &found, MOST);
    let said = |found: &Motion, name: &str| -> String {
        let all = metrics(found, MOST);
        all.get(name).unwrap().reason.clone().unwrap_or_default()
    };
    assert!(said(&found, "t_float").contains("imu_place_m"));
    assert!(!said(&found, "t_float").contains("fall between samples"));
    found.settings.lever_is_known = true;
    assert_eq!(said(&found, "t_float"), "");
    let half = |x: &[f64]| x.iter().copied().step_by(2).collect::<Vec<f64>>();
    let inputs = &mut found.inputs;
    for x in [
        &mut inputs.t_s,
        &mut inputs.support_ratio,
        &mut inputs.roll_rad,
        &mut inputs.pitch_rad,
        &mut inputs.height_m,
    ] {
        *x = half(x);
    }
    found.accel_up_m_per_s2 = half(&found.accel_up_m_per_s2);
    found.stretches[0].end = 2000;
    let slow = beyond("t_float", &found, MOST);
    for (found, known) in [(fast, 0.3 * 0.01), (slow, 0.4 * 0.02)] {
        assert!(
            (found / (108.0 * known / 30.0) - 1.0).abs() < 0.02,
            "{found}"
        );
    }
    for name in ["t_float", "dz_pp_m"] {
        let said = said(&found, name);
        assert!(
            said.contains("at 50 Hz touch-downs fall between samples"),
            "{said}"
        );
    }
    assert!(!said(&found, "rms_z_m").contains("touch-downs"));
}

#[test]
fn an_onset_that_all_would_find_is_not_doubtful() {
    let roll = |t: f64| 0.1 * (1.0 + ((t - 20.0) / 0.5).tanh()) * 3.0 * (TAU * 1.07 * t).sin();
    let found = felt(roll, |_| 1.0, 1.0, [0.0; 3], AS_IT_SITS, Some(0.0));
    let found = metrics(&found, MOST);
    for name in ["onset_time_s", "unstable"] {
        let value = found.get(name).unwrap();
        assert_eq!(value.reason, None, "{name}");
    }
    assert_eq!(found.get("unstable").unwrap().as_bool(), Some(true));
}

/// An onset that holes may have made, or hidden, is told as one.
#[test]
fn an_onset_that_holes_decide_is_said_to_be() {
    let onset = |t: f64| 0.1 * (1.0 + ((t - 20.0) / 0.5).tanh()) * 3.0 * (TAU * 1.07 * t).sin();
    let rest = |_: f64| 0.0;
    let felt = |roll: fn(f64) -> f64| felt(roll, |_| 1.0, 1.0, [0.0; 3], AS_IT_SITS, Some(0.0));
    for (roll, as_many, name, said) in [
        (
            onset as fn(f64) -> f64,
            rest as fn(f64) -> f64,
            "unstable",
            Some("none"),
        ),
        (onset, rest, "onset_time_s", Some("none")),
        (rest, onset, "unstable", Some("one")),
        (onset, onset, "unstable", None),
        (rest, rest, "unstable", None),
    ] {
        let mut found = felt(roll);
        found.again = Some(Box::new(felt(as_many).inputs));
        let found = metrics(&found, MOST);
        let said = said.map(|what| format!("with as many holes again {what} would be found"));
        assert_eq!(found.get(name).unwrap().reason, said, "{name}");
    }
}

/// Peaks that an accelerometer lost are in what it alone tells; all else that is lost is in the attitude, and by it in everything.
#[test]
fn what_rests_on_what_was_lost_has_no_interval() {
    let roll = |t: f64| 0.3 * (TAU * 1.07 * t).sin();
    let support = |t: f64| 1.0 + 1.2 * (TAU * 2.14 * t).sin();
    let found = felt(roll, support, 1.0, [0.0; 3], AS_IT_SITS, Some(0.0));
    let whole = metrics(&found, MOST);
    let sure = |metrics: &Metrics| -> Vec<&'static str> {
        let sure = metrics.0.iter().filter(|(_, v)| v.ci95.is_some());
        sure.map(|(name, _)| *name).collect()
    };
    let of_angles = [
        "rms_roll_deg",
        "rms_pitch_deg",
        "onset_time_s",
        "roll_excess_s",
        "roll_peak_hz",
    ];
    assert!(
        sure(&whole).len() > of_angles.len() && of_angles.iter().all(|n| sure(&whole).contains(n))
    );
    for lost in [
        Lost::Peaks(Instrument::Accelerometer),
        Lost::Peaks(Instrument::Gyroscope),
        Lost::All(Instrument::Accelerometer),
        Lost::Axes,
        Lost::Unit,
        Lost::Turned,
    ] {
        let mut left = whole.clone();
        without(&mut left, lost);
        let is_of_force = lost == Lost::Peaks(Instrument::Accelerometer);
        let mut kept = sure(&left);
        kept.sort_unstable();
        let mut known = of_angles.to_vec();
        known.sort_unstable();
        assert_eq!(kept, if is_of_force { known } else { vec![] }, "{lost:?}");
        let why = left.get("t_float").unwrap().reason.clone().unwrap();
        assert!(why.starts_with("without an interval: the "), "{why}");
    }
    // Which way is forward does not matter to what goes up and down.
    let mut left = whole.clone();
    without(&mut left, Lost::Forward);
    let kept = sure(&left);
    assert!(!of_angles.iter().any(|n| kept.contains(n)), "{kept:?}");
    assert!(
        ["dz_pp_m", "t_float", "peak_hz"]
            .iter()
            .all(|n| kept.contains(n))
    );
}

/// Where most of the height is not known, because a radio falls silent for half a second again and again, or because the window is hardly longer than what
/// has none at its end, parts of what is known tell nothing of the rest.
#[test]
fn a_height_of_which_little_is_known_has_no_interval() {
    let heave = |t: f64| 1.0 - 0.01 / G * (TAU * 2.0f64).powi(2) * (TAU * 2.0 * t).sin();
    let whole = felt(|_| 0.0, heave, 1.0, [0.0; 3], AS_IT_SITS, Some(0.0));
    let sure = |motion: &Motion, window| {
        let found = metrics(motion, window);
        let value = found.get("rms_z_m").unwrap();
        assert!(value.as_f64().is_some(), "{value:?}");
        value.ci95.is_some()
    };
    assert!(sure(&whole, MOST));
    let mut torn = whole.clone();
    for (t, z) in torn.inputs.t_s.iter().zip(&mut torn.inputs.height_m) {
        if t % 9.0 < 5.5 {
            *z = f64::NAN;
        }
    }
    assert!(!sure(&torn, MOST));
    let short = |start_s| Window {
        start_s,
        end_s: 40.0,
    };
    assert!(sure(&whole, short(20.0)) && !sure(&whole, short(36.0)));
}

/// A walk of density w has a mean square of w² T/6 about its mean (∫∫ |t − s|/2 over T²); a minute of it is none.
#[test]
fn a_bias_walks_on_beyond_a_minute() {
    let mut random = Random(8);
    let (w, step_s) = (3e-4, 0.1);
    assert_eq!(walked(&mut random, 600, step_s, w), [0.0; 600]);
    let n = 12_000;
    let square = |x: Vec<f64>| x.iter().map(|x| x * x).sum::<f64>() / n as f64;
    let draws = 400;
    let found: f64 = (0..draws)
        .map(|_| square(walked(&mut random, n, step_s, w)))
        .sum();
    let known = w * w * (1200.0 - 60.0) / 6.0;
    // Its variance is T² w⁴/45: 4.5 % with 400 draws, three times.
    assert!((found / f64::from(draws) / known - 1.0).abs() < 0.14);
}

#[test]
fn noise_is_taken_out_of_a_mean_square() {
    // A constant of 1 seen through errors of 0.1 and 0.3: its square is 1, not 1.01 and 1.09. Its interval is of first order: an estimate that
    // came out low draws a narrow one, which shows at 0.3.
    for (sd, least) in [(0.1, 0.92), (0.3, 0.88)] {
        let rounds = 4000;
        let mut random = Random(7);
        let (mut sum, mut kept) = (0.0, 0);
        for _ in 0..rounds {
            let x = 1.0 + sd * random.normal();
            let drawn: Vec<f64> = (0..DRAWS).map(|_| x + sd * random.normal()).collect();
            let (root, [low, high]) = without_noise(x, &drawn);
            sum += root * root;
            kept += usize::from(low <= 1.0 && 1.0 <= high);
        }
        let mean = sum / f64::from(rounds);
        assert!((mean - 1.0).abs() < 0.1 * sd, "{sd}: {mean}");
        let covers = kept as f64 / f64::from(rounds);
        assert!((least..0.98).contains(&covers), "{sd}: {covers}");
    }
}

#[test]
fn a_metric_of_the_motion_alone_is_the_sensors() {
    for name in [
        "rms_roll_deg",
        "rms_z_m",
        "t_float",
        "subharmonic_ratio",
        "mechanism",
    ] {
        assert!(gives(name), "{name}");
    }
    for name in [
        "contact_loss",
        "force_mean_n",
        "synchrony",
        "roll_lock",
        "step_rate_hz",
        "none",
    ] {
        assert!(!gives(name), "{name}");
    }
}

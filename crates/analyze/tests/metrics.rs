//! Every metric that docs/metrics.md defines by a formula, against NumPy's and SciPy's answers (tests/data/metrics.json, made from that page by
//! tests/data/make_metrics.py); and what lies exactly on a definition's edge.

mod noise;

use analyze::metrics::{Context, Datum, METRICS, mechanism_evidence};
use analyze::{Inputs, Window, metrics};
use noise::noise;
use serde_json::Value;
use std::f64::consts::TAU;

/// The largest difference allowed, relative. Measured: 7e-15.
const AGREEMENT: f64 = 1e-10;

/// Metrics that are estimates or words, tested where they are made.
const OTHERWISE: &[&str] = &[
    "detuning_rad_per_s",
    "pull_rad_per_s",
    "coupling_rad_per_s",
    "captured",
    "unstable",
];

/// A minute of a rath under three handles at 30 Hz, the beat from 25 s on.
fn walk() -> Inputs {
    let t_s: Vec<f64> = (0..1801).map(|k| f64::from(k) / 30.0).collect();
    let column = |seed: u64, of: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
        let each = t_s.iter().zip(noise(t_s.len(), seed));
        each.map(|(t, noise)| of(*t, noise)).collect()
    };
    let taken = |seed: u64, step_s: f64, scatter_s: f64, pause_s: f64| -> Vec<f64> {
        let mut now_s = 0.0;
        let each = noise(130, seed).into_iter().enumerate();
        each.map(|(k, noise)| {
            now_s += step_s + scatter_s * noise + if k == 60 { pause_s } else { 0.0 };
            now_s
        })
        .collect()
    };
    Inputs {
        height_m: column(1, &|t, noise| {
            let heave = (0.04 + 0.0004 * t) * (TAU * 2.15 * t).sin();
            1.2 + heave + 0.004 * (TAU * 4.3 * t + 1.0).sin() + 0.002 * noise
        }),
        roll_rad: column(2, &|t, noise| {
            let sway = 0.3 * (1.0 - (-t / 20.0).exp()) * (TAU * 1.075 * t + 0.4).sin();
            0.01 + sway + 0.02 * (TAU * 2.1 * t).sin() + 0.002 * noise
        }),
        pitch_rad: column(3, &|t, noise| {
            0.01 + 0.004 * (TAU * 2.15 * t).sin() + 0.001 * noise
        }),
        yaw_rad: column(4, &|t, noise| {
            -0.02 + 0.003 * (TAU * 0.9 * t).sin() + 0.001 * noise
        }),
        normal_n: (0..3u8)
            .map(|i| {
                let (seed, i) = (5 + u64::from(i), f64::from(i));
                column(seed, &|t, noise| {
                    let thrown = (240.0 + 20.0 * i) * (TAU * 2.15 * t + 0.5 * i).sin();
                    (200.0 + thrown + 40.0 * noise).max(0.0)
                })
            })
            .collect(),
        phase_rad: (0..3u8)
            .map(|i| {
                let (seed, i) = (8 + u64::from(i), f64::from(i));
                column(seed, &|t, noise| {
                    let steady = TAU * (2.15 + 0.002 * i) * t + 0.6 * i;
                    steady + 0.5 * (0.3 * t + i).sin() + 0.1 * noise
                })
            })
            .collect(),
        beat_phase_rad: column(0, &|t, _| {
            if t < 25.0 { f64::NAN } else { TAU * 2.15 * t }
        }),
        step_s: vec![taken(11, 0.46, 0.02, 0.0), taken(12, 0.47, 0.03, 2.0)],
        mass_kg: Some(60.0),
        gravity_m_per_s2: 9.81,
        t_s,
        ..Inputs::default()
    }
}

/// NumPy's and SciPy's answers.
fn answers() -> Value {
    let text = include_str!("data/metrics.json");
    let all: Value = serde_json::from_str(text).unwrap();
    all["metrics"].clone()
}

#[track_caller]
fn close(ours: f64, theirs: &Value, agreement: f64, what: &str) {
    let theirs = theirs.as_f64().unwrap();
    assert!(
        (ours - theirs).abs() <= agreement * theirs.abs(),
        "{what}: ours {ours:e}, NumPy's {theirs:e}"
    );
}

#[test]
fn metrics_are_what_numpy_makes_of_their_definitions() {
    let found = metrics(&walk(), Window::from(15.0));
    let answers = answers();
    let numbers = answers.as_object().unwrap().iter();
    for (name, theirs) in
        numbers.filter(|(name, _)| !["roll_lock", "mechanism"].contains(&&***name))
    {
        let ours = found.get(name).unwrap();
        let value = ours.as_f64().unwrap_or_else(|| panic!("{name}: {ours:?}"));
        // Integrals by another way: measured 4e-7.
        let agreement = if name == "synchrony_chance" {
            1e-6
        } else {
            AGREEMENT
        };
        let the_number = if theirs.is_object() {
            &theirs["value"]
        } else {
            theirs
        };
        close(value, the_number, agreement, name);
        let lists = [
            ("per", ours.per.clone()),
            ("ci95", ours.ci95.map(Vec::from).unwrap_or_default()),
        ];
        for (key, ours) in lists {
            for (k, theirs) in theirs[key].as_array().into_iter().flatten().enumerate() {
                close(ours[k], theirs, agreement, &format!("{name} {key} {k}"));
            }
        }
    }
    for metric in METRICS {
        let compared = !answers[metric.name].is_null();
        assert_ne!(
            compared,
            OTHERWISE.contains(&metric.name),
            "{}: tests/data/make_metrics.py should compute it anew, or OTHERWISE name it",
            metric.name
        );
    }
    assert_eq!(found.get("unstable").unwrap().as_bool(), Some(true));
}

#[test]
fn the_lock_of_roll_to_beat_is_numpys() {
    let found = metrics(&walk(), Window::from(15.0));
    let lock = found.get("roll_lock").unwrap();
    assert_eq!(lock.as_word(), Some("1:2"));
    let reason = lock.reason.clone().unwrap();
    for (ratio, theirs) in answers()["roll_lock"].as_object().unwrap() {
        let told = format!("{ratio} {:.3}", theirs.as_f64().unwrap());
        assert!(reason.contains(&told), "{told} in {reason}");
    }
}

#[test]
fn the_evidence_of_the_mechanism_is_numpys() {
    let inputs = walk();
    let context = Context::new(&inputs, Window::from(15.0));
    let ours = mechanism_evidence(&context).unwrap();
    let fit = ours.fit.unwrap();
    let theirs = &answers()["mechanism"];
    for (name, ours) in [
        ("a", fit.a),
        ("b_per_s", fit.b_per_s),
        ("r2", fit.r2),
        ("delta_n_gain", fit.delta_n_gain.unwrap()),
        ("share_at_half", ours.share_at_half.unwrap()),
        ("share_at_f", ours.share_at_f.unwrap()),
    ] {
        close(ours, &theirs[name], AGREEMENT, name);
    }
    close(
        ours.rms_roll_rad.to_degrees(),
        &answers()["rms_roll_deg"],
        AGREEMENT,
        "RMS roll",
    );
}

/// Twenty samples at 10 Hz of two handles, whose weight of 400 N has a twentieth that doubles know exactly.
fn stand(normal_n: [&[f64]; 2]) -> Inputs {
    let all = |x: &[f64]| x.iter().copied().cycle().take(20).collect();
    Inputs {
        t_s: (0..20).map(|k| f64::from(k) / 10.0).collect(),
        normal_n: normal_n.map(all).into(),
        mass_kg: Some(40.0),
        gravity_m_per_s2: 10.0,
        ..Inputs::default()
    }
}

#[test]
fn a_handle_without_force_is_lost_and_a_twentieth_of_the_weight_floats() {
    let number = |inputs: &Inputs, name: &str| metrics(inputs, Window::ALL).number(name).unwrap();
    let edge = stand([
        &[0.0, 20.0, 1e-9, 400.0, 400.0],
        &[20.0, 0.0, 20.0, 400.0, 400.0],
    ]);
    assert_eq!(number(&edge, "contact_loss"), 0.4);
    assert_eq!(number(&edge, "contact_loss_mean"), 0.2);
    assert_eq!(number(&edge, "t_float"), 0.4);
    // Without a mass the weight is the mean support: 200 N of 10, 390 and 200.
    let unknown = Inputs {
        mass_kg: None,
        ..stand([&[10.0, 390.0, 200.0, 200.0], &[0.0; 4]])
    };
    assert_eq!(number(&unknown, "t_float"), 0.25);
    let measured = Inputs {
        normal_n: Vec::new(),
        support_ratio: [0.05, 0.05 + 1e-9, 1.0, 1.0].repeat(5),
        ..stand([&[1.0], &[1.0]])
    };
    assert_eq!(number(&measured, "t_float"), 0.25);
}

#[test]
fn forces_that_do_not_change_have_no_correlation() {
    let number = |inputs: &Inputs| metrics(inputs, Window::ALL).number("force_correlation");
    assert_eq!(number(&stand([&[294.3], &[294.3, 294.4]])), None);
    assert!(
        number(&stand([&[294.3, 294.4], &[294.4, 294.3]])).is_some_and(|r| (r + 1.0).abs() < 1e-9)
    );
}

/// A swing and a heave of a minute at 30 Hz, sampled unevenly by up to 6 ms, and with one sample in 23 lost: lines and what drives them stay what they are.
#[test]
fn lost_and_uneven_samples_change_no_line() {
    let at = |t_s: Vec<f64>| Inputs {
        height_m: (t_s.iter())
            .map(|t| 1.2 + 0.05 * (TAU * 2.15 * t).sin() + 0.004 * (TAU * 4.3 * t).sin())
            .collect(),
        roll_rad: (t_s.iter())
            .map(|t| 0.2 * (TAU * 1.075 * t).sin() + 0.02 * (TAU * 2.15 * t).cos())
            .collect(),
        normal_n: vec![
            (t_s.iter())
                .map(|t| 590.0 - 60.0 * (TAU * 2.15 * t).sin())
                .collect(),
        ],
        mass_kg: Some(60.0),
        gravity_m_per_s2: 9.81,
        t_s,
        ..Inputs::default()
    };
    let even = || (0..1801).map(|k| f64::from(k) / 30.0);
    let late = noise(1801, 3);
    let uneven = even()
        .zip(&late)
        .map(|(t, x)| t + 0.006 * x.clamp(-1.0, 1.0));
    let kept = |(k, _): &(usize, f64)| k % 23 != 11;
    let lost = even().enumerate().filter(kept).map(|(_, t)| t);
    let found = |inputs: &Inputs| {
        let evidence = mechanism_evidence(&Context::new(inputs, Window::ALL)).unwrap();
        let fit = evidence.fit.unwrap();
        let all = metrics(inputs, Window::ALL);
        let word = all.get("mechanism").unwrap().datum.clone();
        let named = |name| all.number(name).unwrap();
        let numbers = [
            ("h2_ratio", named("h2_ratio"), 0.03),
            ("subharmonic_ratio", named("subharmonic_ratio"), 0.01),
            ("peak_hz", named("peak_hz"), 1e-3),
            ("roll_peak_hz", named("roll_peak_hz"), 1e-3),
            ("a", fit.a, 0.01),
            ("R²", fit.r2, 0.005),
        ];
        (numbers, word)
    };
    let (truth, word) = found(&at(even().collect()));
    assert_eq!(word, Datum::Word("parametric"));
    for (sampled, what) in [
        (uneven.collect::<Vec<_>>(), "uneven"),
        (lost.collect(), "lost"),
    ] {
        let (numbers, said) = found(&at(sampled));
        assert_eq!(said, word, "{what}");
        for ((name, x, part), (_, y, _)) in numbers.into_iter().zip(&truth) {
            assert!((x / y - 1.0).abs() < part, "{what} {name}: {x} for {y}");
        }
    }
}

/// Neighbouring doubles are one height, and one force; a nanometre is a motion.
#[test]
fn rounding_is_no_motion() {
    let number = |inputs: &Inputs, name: &str| metrics(inputs, Window::ALL).number(name).unwrap();
    let between = |step_m: f64| Inputs {
        height_m: [0.8, 0.8 + step_m].repeat(10),
        ..stand([&[294.3, 294.3f64.next_up()], &[294.3]])
    };
    assert_eq!(number(&between(2e-16), "force_sd_n"), 0.0);
    let moved = number(&between(1e-9), "dz_pp_m");
    assert!((moved - 1e-9).abs() < 1e-15, "{moved}");
}

#[test]
fn fifteen_degrees_are_no_excess_and_both_ends_of_the_window_count() {
    let limit = 15f64.to_radians();
    let inputs = Inputs {
        t_s: (0..20).map(|k| f64::from(k) / 10.0).collect(),
        roll_rad: [limit, -limit, limit.next_up(), -limit.next_up()].repeat(5),
        ..Inputs::default()
    };
    let found = |window| metrics(&inputs, window).number("roll_excess_s").unwrap();
    assert!((found(Window::ALL) - 1.0).abs() < 1e-12);
    let window = Window {
        start_s: 0.2,
        end_s: 0.3,
    };
    assert!((found(window) - 0.2).abs() < 1e-12);
}

//! The paper's table, of runs whose numbers are known.

use sim::solve::Stats;
use study::draw::Layer;
use study::ensemble::{KEPT, Run};
use study::paper::{CONDITIONS, Condition, figures, table, to_json};

/// A run of which these metrics are known.
fn run(seed: u64, known: &[(&str, f64)], force_correlation: Option<f64>) -> Run {
    let of = |name: &&str| known.iter().find(|(n, _)| n == name).map(|(_, x)| *x);
    Run {
        seed,
        metrics: KEPT.iter().map(of).collect(),
        force_correlation,
        stats: Stats::default(),
    }
}

/// Two runs of `baseline`, three of `music`, one of which has no onset.
fn conditions() -> [Condition; 2] {
    let roll = |deg: f64| [("rms_roll_deg", deg), ("synchrony", 0.5), ("unstable", 0.0)];
    let music = |deg: f64, onset_s: Option<f64>| {
        let unstable = ("unstable", f64::from(u8::from(onset_s.is_some())));
        let onset = onset_s.map(|s| ("onset_time_s", s));
        let known = [("rms_roll_deg", deg), ("synchrony", 0.99), unstable];
        known.into_iter().chain(onset).collect::<Vec<_>>()
    };
    [
        Condition {
            name: CONDITIONS[0],
            runs: vec![run(7, &roll(0.1), Some(0.9)), run(8, &roll(0.3), Some(0.7))],
        },
        Condition {
            name: CONDITIONS[1],
            runs: vec![
                run(7, &music(18.0, Some(20.0)), None),
                run(8, &music(19.0, Some(24.0)), None),
                run(9, &music(20.0, None), None),
            ],
        },
    ]
}

/// Mean 0.2 and 19, SD √0.02 and 1; the paper has 0.148 ± 0.019 and 18.387 ± 0.814, the archive 0.148 ± 0.0195 and 18.39 ± 0.81.
#[test]
fn what_is_here_stands_before_the_papers_and_the_archives() {
    let table = table(&conditions());
    let line = |condition: usize, label: &str| {
        let mut lines = table.lines().filter(|l| l.trim_start().starts_with(label));
        let line = lines.nth(condition).unwrap();
        line.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    assert!(
        table.starts_with("baseline (2 runs, seeds 7..8)\n"),
        "{table}"
    );
    assert!(table.contains("music (3 runs, seeds 7..9)\n"), "{table}");
    assert_eq!(
        line(0, "RMS roll"),
        "RMS roll, deg 0.200 ± 0.141 0.148 ± 0.019 +2.7 0.148 ± 0.019 +2.7"
    );
    assert_eq!(
        line(1, "RMS roll"),
        "RMS roll, deg 19.000 ± 1.000 18.387 ± 0.814 +0.8 18.390 ± 0.810 +0.8"
    );
    // (0.5 − 0.629)/0.032 and (0.5 − 0.633)/0.106.
    assert_eq!(
        line(0, "synchrony"),
        "synchrony 0.500 ± 0.000 0.629 ± 0.032 -4.0 0.633 ± 0.106 -1.3"
    );
    assert_eq!(line(1, "onset"), "onset, s 22.0 ± 2.8 – 20.5 ± 4.0 +0.4");
    assert_eq!(line(1, "unstable"), "unstable 2/3 30/30 30/30");
    assert_eq!(
        line(0, "correlation"),
        "correlation of the handle forces 0.800 ± 0.141 – 0.996"
    );
}

/// Student's interval of three runs is 4.3027 SD/√3; who ran once shows no spread.
#[test]
fn programs_get_the_same_numbers() {
    let mut conditions = conditions();
    let json = to_json(&conditions, 1.5);
    let roll = &json["conditions"]["music"]["metrics"]["rms_roll_deg"];
    assert_eq!((&roll["mean"], &roll["sd"]), (&19.0.into(), &1.0.into()));
    let half = roll["ci95"].as_f64().unwrap();
    assert!(
        (half - 4.302_652_730 / 3.0_f64.sqrt()).abs() < 1e-9,
        "{half}"
    );
    assert_eq!(
        json["conditions"]["music"]["metrics"]["onset_time_s"]["runs"],
        2
    );
    let none = &json["conditions"]["baseline"]["metrics"]["onset_time_s"];
    assert!(none["mean"].is_null() && none["runs"] == 0, "{none}");
    assert_eq!(json["conditions"]["music"]["unstable"], 2);
    assert_eq!(json["conditions"]["baseline"]["unstable"], 0);
    assert_eq!(json["paper"]["music"]["rms_roll_deg"]["mean"], 18.387);
    assert_eq!(json["archive"]["music"]["rms_roll_deg"]["spread"], 0.81);
    assert_eq!(json["archive"]["baseline"]["contact_loss"]["mean"], 0.078);
    assert_eq!(json["paper"]["music"]["unstable"], 30);
    assert_eq!(json["wall_s"], 1.5);
    conditions[0].runs.truncate(1);
    let once = &to_json(&conditions, 0.0)["conditions"]["baseline"]["metrics"]["rms_roll_deg"];
    assert!(once["sd"].is_null() && once["ci95"].is_null(), "{once}");
}

/// Across the metric of the picture's name, up the roll; the paper's cross about its mean.
#[test]
fn pictures_have_their_axes() {
    let (stem, figure) = &figures(&conditions())[1];
    assert_eq!(*stem, "table1-synchrony");
    assert_eq!(
        (&*figure.x_label, &*figure.y_label),
        ("synchrony", "RMS roll, deg")
    );
    let Layer::Points { points, .. } = &figure.layers[0] else {
        panic!("{figure:?}");
    };
    assert_eq!(points[..], [(0.5, 0.1), (0.5, 0.3)]);
    let cross: Vec<_> = figure.layers[1..3]
        .iter()
        .map(|layer| match layer {
            Layer::Line { points, .. } => points.clone(),
            other => panic!("{other:?}"),
        })
        .collect();
    let near = |a: (f64, f64), b: (f64, f64)| (a.0 - b.0).abs() + (a.1 - b.1).abs() < 1e-12;
    for (bar, ends) in cross.iter().zip([
        [(0.597, 0.148), (0.661, 0.148)],
        [(0.629, 0.129), (0.629, 0.167)],
    ]) {
        assert!(near(bar[0], ends[0]) && near(bar[1], ends[1]), "{bar:?}");
    }
}

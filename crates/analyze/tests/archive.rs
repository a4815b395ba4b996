//! The paper's archive: every statistic of every `stats.json` but `envelope_growth_rate`, to a relative 1e-9, and what its logs say of the
//! mechanism. It is others' to ship, so these tests are run when asked for, with its folder:
//!
//!     RATH_ARCHIVE=FOLDER cargo test --release -p recording -p analyze -p study archive -- --ignored

mod archive_names;

use std::path::{Path, PathBuf};

use analyze::metrics::{Context, mechanism_evidence};
use analyze::{Inputs, Metrics, Window, metrics};

/// The folders of the runs.
fn runs() -> Vec<PathBuf> {
    let archive = archive_names::folder();
    let mut runs = Vec::new();
    for condition in ["baseline", "music"] {
        let entries = std::fs::read_dir(archive.join(condition)).unwrap();
        runs.extend(entries.map(|e| e.unwrap().path()));
    }
    runs.sort();
    runs
}

/// A run's columns straight from `logs.npz`.
fn inputs(run: &Path) -> Inputs {
    let mut npz = npyz::npz::NpzArchive::open(run.join("logs.npz")).unwrap();
    let mut column =
        |name: &str| -> Vec<f64> { npz.by_name(name).unwrap().unwrap().into_vec().unwrap() };
    let split = |x: Vec<f64>| {
        (0..2)
            .map(|i| x.iter().skip(i).step_by(2).copied().collect())
            .collect()
    };
    Inputs {
        t_s: column("t"),
        height_m: column("y"),
        roll_rad: column("roll"),
        yaw_rad: column("pitch"),
        normal_n: split(column("forces")),
        phase_rad: split(column("walker_phase")),
        mass_kg: Some(60.0),
        gravity_m_per_s2: 9.81,
        ..Inputs::default()
    }
}

#[track_caller]
fn close(ours: f64, theirs: f64, what: &str) {
    let bound = 1e-9 * theirs.abs();
    assert!(
        (ours - theirs).abs() <= bound,
        "{what}: ours {ours:e}, stats.json {theirs:e}"
    );
}

fn check(m: &Metrics, stats: &serde_json::Value, run: &str) {
    let number = |name: &str| {
        m.number(name)
            .unwrap_or_else(|| panic!("{run} {name}: {:?}", m.get(name)))
    };
    for (ours, theirs) in archive_names::NUMBERS {
        close(
            number(ours),
            stats[theirs].as_f64().unwrap(),
            &format!("{run} {ours}"),
        );
    }
    for (ours, theirs) in archive_names::PER_HANDLE {
        for (a, b) in m
            .get(ours)
            .unwrap()
            .per
            .iter()
            .zip(stats[theirs].as_array().unwrap())
        {
            close(*a, b.as_f64().unwrap(), &format!("{run} {ours} per handle"));
        }
    }
    let onset = stats["uncontrolled_onset_time"].as_f64().unwrap();
    match m.number("onset_time_s") {
        Some(t) => close(t, onset, &format!("{run} onset")),
        None => assert_eq!(onset, -1.0, "{run}"),
    }
    assert_eq!(
        m.get("unstable").unwrap().as_bool(),
        Some(onset > 0.0),
        "{run}"
    );
}

#[test]
#[ignore = "needs the paper's archive, which is not shipped: see the head of the file"]
fn the_archives_statistics_are_reproduced_from_its_logs() {
    for run in runs() {
        let stats = serde_json::from_str(&std::fs::read_to_string(run.join("stats.json")).unwrap())
            .unwrap();
        check(
            &metrics(&inputs(&run), Window::from(15.0)),
            &stats,
            &run.display().to_string(),
        );
    }
}

#[test]
#[ignore = "needs the paper's archive, which is not shipped: see the head of the file"]
fn the_archives_mechanism_is_found() {
    let runs = runs();
    let (mut a, mut b, mut r2) = (Vec::new(), Vec::new(), Vec::new());
    for run in &runs {
        let inputs = inputs(run);
        let m = metrics(&inputs, Window::from(15.0));
        let music = run.parent().unwrap().ends_with("music");
        let word = m.get("mechanism").unwrap();
        println!(
            "{}: {} ({})",
            run.display(),
            word.as_word().unwrap(),
            word.reason.as_ref().unwrap()
        );
        assert_eq!(
            word.as_word(),
            Some(if music { "parametric" } else { "quiet" }),
            "{}",
            run.display()
        );
        if music {
            let context = Context::new(&inputs, Window::from(15.0));
            let fit = mechanism_evidence(&context).unwrap().fit.unwrap();
            a.push(fit.a);
            b.push(fit.b_per_s);
            r2.push(fit.r2);
            // "Exactly half": on the grid of a 45 s window, 0.022 Hz wide.
            let (roll, height) = (
                m.number("roll_peak_hz").unwrap(),
                m.number("peak_hz").unwrap(),
            );
            assert!((roll - height / 2.0).abs() < 0.023, "{roll} {height}");
        }
    }
    if !a.is_empty() {
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
        println!(
            "a = {:.6}, b = {:.4}, R2 = {:.4}",
            mean(&a),
            mean(&b),
            mean(&r2)
        );
        assert!(
            (mean(&a) - 0.04795).abs() < 0.0001
                && (mean(&b) - 0.392).abs() < 0.007
                && (mean(&r2) - 0.992).abs() < 0.001
        );
        assert!(
            a.iter().all(|a| (a - 0.04795).abs() < 0.00015)
                && b.iter().all(|b| (b - 0.392).abs() < 0.021)
        );
    }
}

#[test]
#[ignore = "needs the paper's archive, which is not shipped: see the head of the file"]
fn the_archives_floating_and_loss_are_found() {
    let runs = runs();
    for (condition, t_float, any, mean_loss) in [
        ("baseline", 0.089, 0.078, 0.039),
        ("music", 0.230, 0.434, 0.317),
    ] {
        let of: Vec<Metrics> = runs
            .iter()
            .filter(|r| r.parent().unwrap().ends_with(condition))
            .map(|r| metrics(&inputs(r), Window::from(15.0)))
            .collect();
        if of.is_empty() {
            continue;
        }
        let mean =
            |name: &str| of.iter().map(|m| m.number(name).unwrap()).sum::<f64>() / of.len() as f64;
        println!(
            "{condition}: t_float {:.4}, any {:.4}, mean {:.4}",
            mean("t_float"),
            mean("contact_loss"),
            mean("contact_loss_mean")
        );
        // Ten of the thirty seeds: within a standard deviation of the whole ensemble.
        assert!((mean("t_float") - t_float).abs() < 0.028, "{condition}");
        assert!((mean("contact_loss") - any).abs() < 0.027, "{condition}");
        assert!(
            (mean("contact_loss_mean") - mean_loss).abs() < 0.013,
            "{condition}"
        );
    }
}

#[test]
#[ignore = "needs the paper's archive, which is not shipped: see the head of the file"]
fn metrics_of_an_archive_log_are_cheap_enough_for_a_study() {
    let run = runs().pop().unwrap();
    let inputs = inputs(&run);
    let study = [
        "rms_roll_deg",
        "contact_loss_mean",
        "synchrony",
        "onset_time_s",
        "dz_pp_m",
        "t_float",
        "unstable",
    ];
    let time = |f: &dyn Fn() -> Metrics| {
        f();
        let start = std::time::Instant::now();
        (0..100).for_each(|_| drop(std::hint::black_box(f())));
        start.elapsed().as_secs_f64() / 100.0
    };
    let few = time(&|| analyze::metrics_of(&inputs, Window::from(15.0), |n| study.contains(&n)));
    let all = time(&|| metrics(&inputs, Window::from(15.0)));
    // Printed, not asserted: machines differ.
    println!(
        "{:.0} µs for a study's metrics, {:.0} µs for all",
        few * 1e6,
        all * 1e6
    );
}

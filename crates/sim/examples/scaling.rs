//! How cost grows with the number of carriers: `cargo run --release -p sim --example scaling -- (N) [SECONDS]`.
//!
//! Without arguments: a table of the right-hand side's time from 1 to 10,000 carriers, and a run of 60 s at each N from 10 on. With N and
//! SECONDS: one run, for an instruction count.

use sim::model::Model;
use sim::run::{Sample, run};
use sim::scene::{Scene, parse};
use std::time::Instant;

fn scene(n: usize, seconds: f64) -> Scene {
    let text = format!(
        r#"
        name = "crowd"
        duration_s = {seconds:?}
        [body]
        mass_kg = {:?}
        inertia_kg_m2 = {{ xx = {:?}, yy = {:?}, zz = {:?} }}
        [carriers]
        initial_phase_sd_rad = 1.0
        [carriers.along_poles]
        count = {n}
        poles = {}
        [effects.contact]
        [effects.hold]
        [effects.gait]
        amplitude_m = 0.03
        [effects.frequency_spread]
        [effects.coupling]
        [effects.music]
        [effects.noise]
        "#,
        // 30 kg for each, spread like a plate of 4.9 m by 0.9 m: tilt and roll stay as slow as they are for two.
        30.0 * n as f64,
        2.0 * n as f64,
        60.0 * n as f64,
        62.0 * n as f64,
        n.min(2),
    );
    parse("crowd", &text, &[]).unwrap_or_else(|e| panic!("{e}"))
}

/// Time of one right-hand side, ns: the least of many means.
fn rhs_ns(scene: &Scene) -> f64 {
    let model = Model::new(scene);
    let (y, mut w) = (model.initial_state(), model.workspace());
    model.begin_segment(0.0, &mut w);
    let mut dy = vec![0.0; y.len()];
    let calls = (200_000 / y.len()).max(3);
    (0..40)
        .map(|_| {
            let began = Instant::now();
            for _ in 0..calls {
                model.rhs(std::hint::black_box(0.1), &y, &mut dy, &mut w);
                std::hint::black_box(&dy);
            }
            began.elapsed().as_secs_f64() * 1e9 / calls as f64
        })
        .fold(f64::INFINITY, f64::min)
}

/// The most memory this process has held, MB; 0 where the system does not say.
fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.split_whitespace().next()?.parse::<f64>().ok())
        .map_or(0.0, |kb| kb / 1024.0)
}

fn timed(n: usize, seconds: f64) -> (f64, u64) {
    let scene = scene(n, seconds);
    let began = Instant::now();
    let stats = run(&scene, &mut |_: &Sample| true).unwrap_or_else(|e| panic!("{n} carriers: {e}"));
    (began.elapsed().as_secs_f64(), stats.evaluations)
}

fn main() {
    let arguments: Vec<f64> = std::env::args()
        .skip(1)
        .filter_map(|a| a.parse().ok())
        .collect();
    if let [n, seconds] = arguments[..] {
        let (wall_s, evaluations) = timed(n as usize, seconds);
        println!(
            "{n} carriers, {seconds} s: {wall_s:.3} s, {evaluations} evaluations, {:.1} MB",
            peak_mb()
        );
        return;
    }
    println!(
        "{:>7} {:>14} {:>12} {:>12} {:>9}",
        "N", "rhs, ns", "60 s, s", "evaluations", "RAM, MB"
    );
    for n in [1, 2, 5, 10, 30, 100, 300, 1000, 3000, 10_000] {
        let rhs = rhs_ns(&scene(n, 60.0));
        let (wall_s, evaluations) = timed(n, 60.0);
        println!(
            "{n:>7} {rhs:>14.0} {wall_s:>12.3} {evaluations:>12} {:>9.1}",
            peak_mb()
        );
    }
}

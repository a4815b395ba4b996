//! How cost grows with the number of carriers: `cargo run --release -p sim --example scaling`.
//!
//! Without arguments: one line for each N from 1 to 10,000, as CSV: time of one right-hand side, and in a process of its own a run of 60 s with
//! its processor time, work and memory. `scaling N [SECONDS [METHOD [AMPLITUDE_M]]]` makes one such run.

use sim::model::Model;
use sim::run::{Sample, run};
use sim::scene::{Scene, parse};
use std::time::Instant;

/// A gait, m, at which nobody's handle lifts off: the springs give 0.1 m under the weight.
const AMPLITUDE_M: f64 = 0.015;

fn scene(n: usize, seconds: f64, method: &str, amplitude_m: f64) -> Scene {
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
        [solver]
        method = "{method}"
        [effects.contact]
        [effects.hold]
        [effects.gait]
        amplitude_m = {amplitude_m:?}
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

/// Time of one right-hand side, ns: the least of many means, each over less than a millisecond, so that some are undisturbed.
fn rhs_ns(scene: &Scene) -> f64 {
    let model = Model::new(scene);
    let (y, mut w) = (model.initial_state(), model.workspace());
    model.begin_segment(30.0, &mut w);
    let mut dy = vec![0.0; y.len()];
    let calls = (20_000 / y.len()).max(1);
    (0..2000)
        .map(|_| {
            let began = Instant::now();
            for _ in 0..calls {
                model.rhs(std::hint::black_box(30.0), &y, &mut dy, &mut w);
                std::hint::black_box(&dy);
            }
            began.elapsed().as_secs_f64() * 1e9 / calls as f64
        })
        .fold(f64::INFINITY, f64::min)
}

/// What Linux says of this process; 0 where the system does not say: the most memory held, MB, and processor time, s.
fn used() -> (f64, f64) {
    let first = |text: &str| {
        text.split_whitespace()
            .next()
            .and_then(|x| x.parse::<f64>().ok())
    };
    let read = |file: &str| std::fs::read_to_string(file).unwrap_or_default();
    let status = read("/proc/self/status");
    let peak_kb = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    // The process's own file of this is as old as the last tick of the scheduler.
    #[cfg(target_os = "linux")]
    let cpu_s = {
        let t = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64
    };
    #[cfg(not(target_os = "linux"))]
    let cpu_s = 0.0;
    (peak_kb.and_then(first).unwrap_or(0.0) / 1024.0, cpu_s)
}

/// One run: its processor time, evaluations, contact events, memory.
fn once(n: usize, seconds: f64, method: &str, amplitude_m: f64) {
    let scene = scene(n, seconds, method, amplitude_m);
    let stats = run(&scene, &mut |_: &Sample| true).unwrap_or_else(|e| panic!("{n} carriers: {e}"));
    let (peak_mb, cpu_s) = used();
    println!(
        "{cpu_s:.4},{},{},{peak_mb:.1}",
        stats.evaluations, stats.events
    );
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize| arguments.get(i).and_then(|a| a.parse::<f64>().ok());
    if let Some(n) = number(0) {
        let method = arguments.get(2).map_or("auto", String::as_str);
        let amplitude_m = number(3).unwrap_or(AMPLITUDE_M);
        return once(n as usize, number(1).unwrap_or(60.0), method, amplitude_m);
    }
    println!("carriers,rhs_ns,cpu_s_for_60_s,evaluations,contact_events,peak_mb");
    let myself = std::env::current_exe().unwrap_or_else(|e| panic!("{e}"));
    for n in [1, 2, 5, 10, 30, 100, 300, 1000, 3000, 10_000] {
        let rhs = rhs_ns(&scene(n, 60.0, "auto", AMPLITUDE_M));
        let alone = std::process::Command::new(&myself)
            .arg(n.to_string())
            .output();
        let said = alone.unwrap_or_else(|e| panic!("{e}")).stdout;
        print!("{n},{rhs:.1},{}", String::from_utf8_lossy(&said));
    }
}

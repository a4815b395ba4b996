//! How well a tolerance is kept over many seeds of a scene, by one run after the other and by runs abreast:
//! `cargo run --release -p sim --example seeds -- music 1001 512 1e-6`.
//!
//! Errors are the larger of roll's and height's over the whole run, against `dop853` at 1e-11, in tolerances times half the range of the
//! motion (of 0.1 where it hardly moves): ten of them are promised.

use sim::model::Model;
use sim::run::{Listener, Sample, run_abreast, run_model};
use sim::scene::{Scene, load};
use sim::solve::{Settings, Stats, Stopped, abreast, method};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Roll, rad, and height, m, at every sample.
#[derive(Default)]
struct Seen(Vec<[f64; 2]>);

impl Listener for Seen {
    fn sample(&mut self, sample: &Sample) -> bool {
        let roll_rad = sample.pose.roll_pitch_yaw_rad()[0];
        self.0.push([roll_rad, sample.pose.position_m[2]]);
        true
    }
}

type Run = (Seen, Stats);

fn settings(tolerance: f64) -> Settings {
    Settings {
        tolerance,
        step_s: f64::NAN,
        most_evaluations: 1 << 40,
    }
}

fn whole((stats, outcome): (Stats, Result<(), Stopped>)) -> Stats {
    outcome.unwrap_or_else(|stopped| panic!("{stopped}"));
    stats
}

/// Every model by itself, on all processors.
fn alone(models: &[Model], name: &str, tolerance: f64) -> Vec<Run> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, Run)>> = Mutex::default();
    let work = || {
        while let Some((i, model)) = at(models, &next) {
            let mut seen = Seen::default();
            let named = method(name).expect("a method of the table");
            let stats = whole(run_model(model, named, &settings(tolerance), &mut seen));
            done.lock().expect("no panic").push((i, (seen, stats)));
        }
    };
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    std::thread::scope(|scope| (0..cores).for_each(|_| drop(scope.spawn(work))));
    let mut done = done.into_inner().expect("no panic");
    done.sort_by_key(|(i, _)| *i);
    done.into_iter().map(|(_, run)| run).collect()
}

fn at<'m>(models: &'m [Model], next: &AtomicUsize) -> Option<(usize, &'m Model)> {
    let i = next.fetch_add(1, Ordering::Relaxed);
    models.get(i).map(|model| (i, model))
}

fn together(models: &[Model], tolerance: f64) -> Vec<Run> {
    let mut seen: Vec<Seen> = models.iter().map(|_| Seen::default()).collect();
    let ended = run_abreast(models, &settings(tolerance), &mut seen);
    seen.into_iter().zip(ended.into_iter().map(whole)).collect()
}

/// The larger of the errors of roll and height, in tolerances times half the range of the truth.
fn error(seen: &Seen, truth: &Seen, tolerance: f64) -> f64 {
    let of = |a: usize| {
        let values = truth.0.iter().map(|x| x[a]);
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
        let size = if high - low < 1e-3 {
            0.1
        } else {
            0.5 * (high - low)
        };
        let both = seen.0.iter().zip(&truth.0);
        both.map(|(x, y)| (x[a] - y[a]).abs()).fold(0.0, f64::max) / (size * tolerance)
    };
    of(0).max(of(1))
}

fn tell(name: &str, runs: &[Run], truth: &[Run], tolerance: f64) {
    let both = runs.iter().zip(truth);
    let mut errors: Vec<f64> = both.map(|(r, t)| error(&r.0, &t.0, tolerance)).collect();
    errors.sort_by(f64::total_cmp);
    let part = |q: f64| errors[(q * (errors.len() - 1) as f64).round() as usize];
    let beyond = errors.iter().filter(|e| **e > 10.0).count();
    let evaluations: u64 = runs.iter().map(|r| r.1.evaluations).sum();
    println!(
        "{name:<10}{:>8.2}{:>8.2}{:>8.2}{:>10.2}{beyond:>8}{:>14.0}",
        part(0.5),
        part(0.9),
        part(0.99),
        part(1.0),
        evaluations as f64 / runs.len() as f64
    );
}

fn main() {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let said = |i: usize, default: &str| given.get(i).map_or(default, |s| s).to_owned();
    let name = said(0, "music");
    let number = |i, default| -> f64 { said(i, default).parse().expect("a number") };
    let (first, count, tolerance) = (number(1, "1001"), number(2, "64"), number(3, "1e-6"));
    let off = ["solver.energy=false".to_owned()];
    let scene = load(&name, &off).unwrap_or_else(|problem| panic!("{problem}"));
    let seeds = first as u64..(first + count) as u64;
    let models: Vec<Model> = seeds
        .map(|seed| {
            Model::new(&Scene {
                seed,
                ..scene.clone()
            })
        })
        .collect();
    let truth = alone(&models, "dop853", 1e-11);
    println!(
        "{name}, {count} seeds from {first}, at {tolerance:e}: errors in tolerances, ten are promised"
    );
    println!("              median    90 %    99 %   largest  beyond   evaluations");
    if abreast::suits(&models[0]) {
        tell("abreast", &together(&models, tolerance), &truth, tolerance);
    }
    for name in ["dop853", "dopri5", "radau15"] {
        tell(name, &alone(&models, name, tolerance), &truth, tolerance);
    }
}

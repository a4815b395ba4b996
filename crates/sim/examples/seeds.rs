//! How well a tolerance is kept over many seeds of a scene, by one run after the other and by runs abreast:
//! `cargo run --release -p sim --example seeds -- music 1001 512 1e-6`.
//!
//! Errors are the larger of roll's and height's over the whole run, against `dop853` at 1e-11, in tolerances times half the range of the
//! motion (of 0.1 where it hardly moves): ten of them are promised.

#[path = "../tests/common/promise.rs"]
mod promise;

use sim::model::Model;
use sim::run::{Listener, Sample, run_abreast, run_model};
use sim::scene::{Scene, load};
use sim::solve::{Settings, Stats, Stopped, abreast, method};
use std::fmt::Debug;
use std::str::FromStr;

/// Roll, rad, and height, m, at every sample.
#[derive(Default)]
struct Seen(Vec<[f64; 2]>);

impl Listener for Seen {
    fn sample(&mut self, sample: &Sample) -> bool {
        self.0.push(promise::look(sample));
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
    let named = method(name).expect("a method of the table");
    let run = |model: &Model| {
        let mut seen = Seen::default();
        let stats = whole(run_model(model, named, &settings(tolerance), &mut seen));
        (seen, stats)
    };
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    std::thread::scope(|scope| {
        let parts = models.chunks(models.len().div_ceil(cores));
        let parts: Vec<_> = parts
            .map(|part| scope.spawn(move || part.iter().map(run).collect::<Vec<Run>>()))
            .collect();
        let joined = parts.into_iter().map(|part| part.join().expect("no panic"));
        joined.flatten().collect()
    })
}

fn together(models: &[Model], tolerance: f64) -> Vec<Run> {
    let mut seen: Vec<Seen> = models.iter().map(|_| Seen::default()).collect();
    let ended = run_abreast(models, &settings(tolerance), &mut seen);
    seen.into_iter().zip(ended.into_iter().map(whole)).collect()
}

fn tell(name: &str, runs: &[Run], truth: &[Run], tolerance: f64) {
    let both = runs.iter().zip(truth);
    let mut errors: Vec<f64> = both
        .map(|(run, truth)| {
            let [roll, height] = promise::errors(&run.0.0, &truth.0.0);
            roll.max(height) / tolerance
        })
        .collect();
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

/// What was said in the i-th place.
fn said<T: FromStr<Err: Debug>>(i: usize, default: &str) -> T {
    let given = std::env::args().nth(i);
    let text = given.as_deref().unwrap_or(default);
    text.parse()
        .expect("a scene, two whole numbers and a number")
}

fn main() {
    let name: String = said(1, "music");
    let (first, count, tolerance): (u64, u64, f64) =
        (said(2, "1001"), said(3, "64"), said(4, "1e-6"));
    let off = ["solver.energy=false".to_owned()];
    let scene = load(&name, &off).unwrap_or_else(|problem| panic!("{problem}"));
    let models: Vec<Model> = (first..first + count)
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

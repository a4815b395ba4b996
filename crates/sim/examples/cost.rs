//! Runs a scene and writes nothing, for counting instructions: `cost SCENE [KEY=VALUE]...`.
//!
//! `valgrind --tool=callgrind --toggle-collect='cost::counted' target/release/examples/cost music duration_s=20.0`
//! counts the run alone, without reading the scene.

use sim::model::Model;
use sim::run::{Sample, run_model, settings};
use sim::scene::load;
use sim::solve::{Stats, method};

/// The part that is counted.
#[inline(never)]
fn counted(model: &Model) -> Stats {
    let method = method(&model.scene.solver.method).unwrap_or_else(|e| panic!("{e}"));
    let (stats, outcome) = run_model(model, method, &settings(&model.scene), &mut |_: &Sample| {
        true
    });
    outcome.unwrap_or_else(|e| panic!("{e}"));
    stats
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let scene = arguments.next().unwrap_or_else(|| "music".into());
    let scene = load(&scene, &arguments.collect::<Vec<_>>()).unwrap_or_else(|e| panic!("{e}"));
    let stats = counted(&Model::new(&scene));
    println!(
        "{} s, {} steps, {} rejected, {} events, {} evaluations",
        scene.duration_s, stats.steps, stats.rejected, stats.events, stats.evaluations
    );
}

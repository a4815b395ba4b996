//! `--tolerance X` means what it says: over 60 s, roll and height of every built-in scene stay within 10 X of a far tighter run,
//! relative to the motion's own size, the growth of errors by the scene itself included (`music` grows a difference in the first roll
//! 460 times, `tumble` 70 times).

#[path = "common/promise.rs"]
mod promise;

use promise::{errors, look};
use sim::model::Model;
use sim::run::{Sample, run_model};
use sim::scene::{BUILTIN, builtin, parse};
use sim::solve::{METHODS, Settings, method};

fn course(model: &Model, name: &str, tolerance: f64) -> Vec<[f64; 2]> {
    let mut all = Vec::new();
    let settings = Settings {
        tolerance,
        step_s: 1e-3,
        most_evaluations: 1 << 40,
    };
    let (_, outcome) = run_model(
        model,
        method(name).unwrap(),
        &settings,
        &mut |s: &Sample| {
            all.push(look(s));
            true
        },
    );
    outcome.unwrap();
    all
}

/// Whoever names a method that chooses its steps and locates events gets what `auto` promises; those that are blind to events do not (`dopri5-blind` errs by 34).
#[test]
fn the_tolerance_means_so_much_to_each_method_that_locates_events() {
    let mut missed = Vec::new();
    for &(name, text) in BUILTIN {
        let mut scene = parse(name, text, &[]).unwrap();
        scene.duration_s = scene.duration_s.min(60.0);
        scene.solver.energy = false;
        let model = Model::new(&scene);
        let truth = course(&model, "dop853", 1e-10);
        for m in METHODS.iter().filter(|m| m.adaptive && m.locates) {
            for tolerance in [1e-6, 1e-8] {
                let [roll, height] = errors(&course(&model, m.name, tolerance), &truth);
                println!("{name} {} {tolerance:e}: {roll:.1e} {height:.1e}", m.name);
                if roll.max(height) > 10.0 * tolerance {
                    missed.push(format!(
                        "{name} by {} at {tolerance:e}: roll errs by {roll:.1e}, height by {height:.1e}",
                        m.name
                    ));
                }
            }
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
}

#[test]
fn the_tolerance_means_what_it_says_on_every_built_in_scene() {
    let mut missed = Vec::new();
    let as_they_are = BUILTIN.iter().map(|&(name, text)| (name, text, None));
    // What a step may err where it ends at an event: another seed, whose errors grow more.
    let music = builtin("music").unwrap();
    let seeds = [7, 1006].map(|seed| ("music", music, Some(format!("seed={seed}"))));
    for (name, text, seed) in as_they_are.chain(seeds) {
        let seed: Vec<String> = seed.into_iter().collect();
        let mut scene = parse(name, text, &seed).unwrap();
        scene.duration_s = scene.duration_s.min(60.0);
        scene.solver.energy = false;
        let model = Model::new(&scene);
        let truth = course(&model, "dop853", 1e-10);
        for tolerance in [1e-4, 1e-6, 1e-8] {
            let seen = course(&model, "auto", tolerance);
            let worst = errors(&seen, &truth);
            for (what, worst) in ["roll", "height"].into_iter().zip(worst) {
                println!("{name} {seed:?} {tolerance:e}: {what} {worst:.1e}");
                if worst > 10.0 * tolerance {
                    missed.push(format!(
                        "{name} {seed:?} at {tolerance:e}: {what} errs by {worst:.1e}"
                    ));
                }
            }
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
}

//! `--tolerance X` means what it says: over 60 s, roll and height of every built-in scene stay within 10 X of a far tighter run,
//! relative to the motion's own size, the growth of errors by the scene itself included (`music` grows a difference in the first roll
//! 460 times, `tumble` 70 times).

use sim::model::Model;
use sim::run::{Sample, run_model};
use sim::scene::{BUILTIN, builtin, parse};
use sim::solve::{Settings, method};

/// Below this a motion is rest, and errors are absolute: the units of `Freedoms::scales`, m and rad.
const REST: f64 = 0.1;

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
            all.push([s.pose.roll_pitch_yaw_rad()[0], s.pose.position_m[2]]);
            true
        },
    );
    outcome.unwrap();
    all
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
        // Half its range. A motion that is hardly one is held absolutely.
        let size = [0, 1].map(|a| {
            let (low, high) = truth
                .iter()
                .fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x[a]), h.max(x[a])));
            if high - low < 1e-3 {
                REST
            } else {
                0.5 * (high - low)
            }
        });
        for tolerance in [1e-4, 1e-6, 1e-8] {
            let seen = course(&model, "auto", tolerance);
            for (a, what) in ["roll", "height"].into_iter().enumerate() {
                let worst = seen
                    .iter()
                    .zip(&truth)
                    .map(|(x, y)| (x[a] - y[a]).abs())
                    .fold(0.0, f64::max)
                    / size[a];
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

//! What a log that lost some of its messages says of a run, beside what all of them say.

use analyze::inputs::{Inputs, Window};
use analyze::metrics;
use sim::run::Sample;
use sim::scene::load;
use study::ensemble::observe;

const W: Window = Window {
    start_s: 15.0,
    end_s: f64::INFINITY,
};

/// Without rows of so many samples, a share of all, that begin anywhere but where W does or ends: a shorter W has other bins, and without a taper the ratio
/// of two lines hangs on them.
fn without_rows(of: &Inputs, row: usize, share: f64, seed: u64) -> Inputs {
    let n = of.t_s.len();
    let mut lost = vec![false; n];
    // Knuth's generator: which rows are lost does not matter, only that they are the same each time.
    let mut state = seed;
    while (lost.iter().filter(|l| **l).count() as f64) < share * n as f64 {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        let begin = 1 + (state >> 33) as usize % (n - row - 1);
        let inside = W.start_s < of.t_s[begin - 1] || of.t_s[begin + row] < W.start_s;
        if !inside {
            continue;
        }
        lost[begin..begin + row].fill(true);
    }
    let pick = |x: &[f64]| -> Vec<f64> { (0..n).filter(|k| !lost[*k]).map(|k| x[k]).collect() };
    Inputs {
        t_s: pick(&of.t_s),
        height_m: pick(&of.height_m),
        roll_rad: pick(&of.roll_rad),
        gravity_m_per_s2: of.gravity_m_per_s2,
        ..Inputs::default()
    }
}

#[test]
fn lost_states_leave_the_lines_of_music() {
    let scene = load("music", &["solver.energy=false".into()]).unwrap();
    let (columns, _, outcome) = observe(&scene, None, &mut |_: &Sample| true);
    let inputs = columns.inputs;
    outcome.unwrap();
    let read = |inputs: &Inputs| {
        let found = metrics(inputs, W);
        ["peak_hz", "roll_peak_hz", "h2_ratio", "subharmonic_ratio"]
            .map(|name| found.number(name).unwrap())
    };
    let truth = read(&inputs);
    for (share, most) in [
        (0.03, [1e-4, 1e-4, 0.002, 0.006]),
        (0.1, [1e-3, 1e-3, 0.06, 0.08]),
    ] {
        for row in [2, 3, 5, 10] {
            let mut worst = [0.0f64; 4];
            for seed in 1..=6 {
                let found = read(&without_rows(&inputs, row, share, seed));
                for (k, worst) in worst.iter_mut().enumerate() {
                    *worst = worst.max((found[k] / truth[k] - 1.0).abs());
                }
            }
            println!("{share} lost, {row} in a row: off by up to {worst:.4?}");
            for (worst, most) in worst.iter().zip(most) {
                assert!(*worst < most, "{share} {row}: {worst} of {most}");
            }
        }
    }
}

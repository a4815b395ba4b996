//! palanquin-bench: the methods of `sim` beside `ode_solvers` and `diffsol`, on one thread, in one run, answers checked.
//!
//! One rigid body on two handles, carried by two phase oscillators that a drum pulls; smooth but for the clamp N ≥ 0. Cases and
//! references (binary128, good to 1e-11 rad) are those of `crates/sim/tests/palanquin_bench`. Every solver runs over a ladder of
//! tolerances; the cheapest setting that keeps max |roll error| over 60 s below 1e-3, 1e-6, 1e-9 rad counts; in case C the angle
//! between the orientations below 1e-3, 1e-6, 1e-7 rad, there with energy and momentum to 1e-9. Times are the least of several runs. The ladders go to stderr, what comes of them to stdout.
//!
//! Before them: one right-hand side beside one written by hand, and what a run of `music` costs, alone and recorded (medians).
//!
//! `cargo run --release --manifest-path crates/bench/Cargo.toml`

mod by_hand;
mod peers;

use by_hand::Problem;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use recording::read::{ReadOptions, Recording};
use recording::write::{RecordingWriter, WriterOptions};
use sim::model::Model;
use sim::record::Recorder;
use sim::run::{Listener, Sample, method_of, run_model, settings};
use sim::solve::{METHODS, Method, Settings};
use std::hint::black_box;
use std::time::Instant;

/// The body at a moment.
#[derive(Clone, Copy)]
pub struct Look {
    /// Quaternion w, x, y, z.
    pub turn: [f64; 4],
    /// Angular velocity in the body, rad/s.
    pub spin: [f64; 3],
}

/// What a solver made of a case.
pub struct Course {
    /// At 30 Hz.
    pub looks: Vec<Look>,
    /// Evaluations of the right-hand side; 0 where a peer does not count them.
    pub evaluations: u64,
}

struct Case {
    name: &'static str,
    model: Model,
    problem: Problem,
    truth: Vec<[f64; 4]>,
}

fn case(name: &'static str) -> Case {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/tests/palanquin_bench");
    let text = std::fs::read_to_string(format!("{folder}/{name}.toml")).expect("the case");
    let scene = sim::scene::parse(name, &text, &[]).unwrap_or_else(|e| panic!("{e}"));
    let table = std::fs::read_to_string(format!("{folder}/ref_{name}.csv")).expect("the truth");
    let row = |line: &str| {
        let mut numbers = line
            .split(',')
            .skip(5)
            .map(|x| x.parse().expect("a number"));
        std::array::from_fn(|_| numbers.next().expect("four numbers"))
    };
    Case {
        name,
        model: Model::new(&scene),
        problem: Problem::case(name),
        truth: table.lines().skip(1).map(row).collect(),
    }
}

/// The largest; NaN where one is, which `max` would step over.
fn worst(of: impl Iterator<Item = f64>) -> f64 {
    of.fold(0.0, |a, b| if b > a || b.is_nan() { b } else { a })
}

/// rad
fn roll([w, x, y, z]: [f64; 4]) -> f64 {
    (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y))
}

/// Largest error over the run, rad: of roll, or in case C of the whole orientation. NaN where samples are missing.
fn error(case: &Case, course: &Course) -> f64 {
    if course.looks.len() != case.truth.len() {
        return f64::NAN;
    }
    let of = |(a, b): (&Look, &[f64; 4])| {
        if case.name != "C" {
            return (roll(a.turn) - roll(*b)).abs();
        }
        let ([w, x, y, z], [rw, rx, ry, rz]) = (a.turn, *b);
        let real = w * rw + x * rx + y * ry + z * rz;
        let part = [
            w * rx - x * rw - y * rz + z * ry,
            w * ry - y * rw - z * rx + x * rz,
            w * rz - z * rw - x * ry + y * rx,
        ];
        let part = part.iter().map(|p| p * p).sum::<f64>().sqrt();
        2.0 * part.atan2(real.abs())
    };
    worst(course.looks.iter().zip(&case.truth).map(of))
}

/// How far energy and angular momentum drift in case C, where both stay, in parts of themselves.
fn drift(case: &Case, course: &Course) -> f64 {
    let of = |look: &Look| {
        let [w, x, y, z] = look.turn;
        let turn = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
        let (spin, inertia) = (
            Vector3::from(look.spin),
            Vector3::from(case.problem.inertia),
        );
        let momentum = inertia.component_mul(&spin);
        (momentum.dot(&spin), turn * momentum)
    };
    let Some((energy, momentum)) = course.looks.first().map(of) else {
        return f64::NAN;
    };
    let from_first = course.looks.iter().map(of).map(|(e, m)| {
        let energy = (e / energy - 1.0).abs();
        worst([energy, (m - momentum).norm() / momentum.norm()].into_iter())
    });
    worst(from_first)
}

fn ours(model: &Model, method: &Method, setting: f64) -> Course {
    let settings = Settings {
        tolerance: setting,
        step_s: setting,
        // What takes longer wins nothing.
        most_evaluations: 2_000_000,
    };
    let mut poses = Poses(Vec::with_capacity(1801));
    let (stats, _) = run_model(model, method, &settings, &mut poses);
    Course {
        looks: poses.0,
        evaluations: stats.evaluations,
    }
}

/// Keeps what the peers keep.
struct Poses(Vec<Look>);

impl Listener for Poses {
    fn looks_at_forces(&self) -> bool {
        false
    }
    fn sample(&mut self, s: &Sample) -> bool {
        let [x, y, z, w] = s.pose.orientation;
        self.0.push(Look {
            turn: [w, x, y, z],
            spin: s.pose.spin_rad_per_s,
        });
        true
    }
}

/// Least time of several runs, s; a slow run is not repeated as often.
fn least(mut run: impl FnMut() -> Course) -> (f64, Course) {
    let (mut best, mut spent, mut course) = (f64::INFINITY, 0.0, None);
    for i in 0..15 {
        let start = Instant::now();
        let got = black_box(run());
        let took = start.elapsed().as_secs_f64();
        (best, spent) = (best.min(took), spent + took);
        course = Some(got);
        if i >= 2 && spent > 0.5 {
            break;
        }
    }
    (best, course.expect("ran"))
}

/// At the finest, energy and angular momentum of case C stay within this part of themselves.
const DRIFT: f64 = 1e-9;

struct Rung {
    who: String,
    ours: bool,
    wall_s: f64,
    /// rad
    error: f64,
    /// In case C.
    drift: f64,
}

fn main() {
    let only = std::env::args().nth(1);
    right_hand_sides();
    music();
    // Four to a factor of ten: the cheapest setting that is good enough lies between coarser ones.
    let tolerances: Vec<f64> = (-8..=52)
        .map(|i| 10f64.powf(-0.25 * f64::from(i)))
        .collect();
    for name in ["A", "B", "C"] {
        if only.as_deref().is_some_and(|only| only != name) {
            continue;
        }
        let case = case(name);
        let mut rungs = Vec::new();
        let mut add = |who: String, ours: bool, run: &mut dyn FnMut() -> Course| {
            let (wall_s, course) = least(run);
            let error = error(&case, &course);
            let drift = if name == "C" {
                drift(&case, &course)
            } else {
                0.0
            };
            let (ms, calls) = (wall_s * 1e3, course.evaluations);
            let told = match error.is_finite() {
                true => format!("error {error:.1e} rad"),
                false => "stopped before the end".to_owned(),
            };
            eprintln!("{name}  {who:<34} {ms:>9.3} ms  {calls:>9} evaluations  {told}");
            rungs.push(Rung {
                who,
                ours,
                wall_s,
                error,
                drift,
            });
        };
        for method in METHODS.iter().filter(|m| m.adaptive && m.name != "auto") {
            // Case B by an implicit method at the finest tolerances takes seconds and wins nothing.
            for &tolerance in tolerances.iter().filter(|t| **t > 1e-11) {
                let who = format!("sim {} {tolerance:.0e}", method.name);
                add(who, true, &mut || ours(&case.model, method, tolerance));
            }
        }
        // Equal parts of the time between two samples; what is not worth a thousandth is left to the others.
        for method in METHODS.iter().filter(|m| !m.adaptive) {
            for parts in [2, 3, 4, 5, 6, 8, 12, 16, 32] {
                let step_s = 1.0 / f64::from(30 * parts);
                let who = format!("sim {} {:.2} ms", method.name, 1e3 * step_s);
                add(who, true, &mut || ours(&case.model, method, step_s));
            }
        }
        for (peer, solve) in peers::PEERS {
            for &tolerance in &tolerances {
                let who = format!("{peer} {tolerance:.0e}");
                add(who, false, &mut || solve(&case.problem, tolerance));
            }
        }
        // Case C begins so near a separatrix that double precision costs 1e-8 to 1e-7 rad by the end.
        let finest = if name == "C" { 1e-7 } else { 1e-9 };
        for within in [1e-3, 1e-6, finest] {
            let cheapest = |ours: bool| {
                let exact = |r: &&Rung| within > finest || r.drift <= DRIFT;
                let good = rungs.iter().filter(|r| r.ours == ours && r.error <= within);
                let good = good.filter(exact);
                good.min_by(|a, b| a.wall_s.total_cmp(&b.wall_s))
            };
            let told = |r: Option<&Rung>| {
                r.map_or("none".into(), |r| {
                    format!("{} {:.3} ms", r.who, r.wall_s * 1e3)
                })
            };
            let (us, them) = (cheapest(true), cheapest(false));
            let ratio = us.zip(them).map_or(String::new(), |(us, them)| {
                format!("  ratio 1/{:.1}", them.wall_s / us.wall_s)
            });
            println!(
                "{name} to {within:.0e} rad: {}; peers: {}{ratio}",
                told(us),
                told(them)
            );
        }
        println!();
    }
}

/// One evaluation of case A: the model's, term by term, and one written by hand; both must give the same.
fn right_hand_sides() {
    let case = case("A");
    let mut y = case.model.initial_state();
    let (mut dy, mut w) = (vec![0.0; y.len()], case.model.workspace());
    case.model.begin_segment(0.0, &mut w);
    let hand = by_hand::State::from_column_slice(&y[..15]);
    let mut slope = hand;
    case.model.rhs(0.0, &y, &mut dy, &mut w);
    by_hand::rhs(&case.problem, 0.0, hand.as_slice(), slope.as_mut_slice());
    for (a, b) in dy.iter().zip(slope.iter()) {
        assert!(
            (a - b).abs() < 1e-9,
            "the two right-hand sides differ: {a} {b}"
        );
    }
    let time = |run: &mut dyn FnMut()| {
        let round = |run: &mut dyn FnMut()| {
            let start = Instant::now();
            (0..100_000).for_each(|_| run());
            start.elapsed().as_secs_f64() * 1e9 / 1e5
        };
        let mut rounds: Vec<f64> = (0..15).map(|_| round(run)).collect();
        rounds.sort_by(f64::total_cmp);
        (rounds[0], rounds[7])
    };
    let (least, median) = time(&mut || {
        case.model.rhs(0.1, black_box(&y), &mut dy, &mut w);
        black_box(&dy);
    });
    println!("one right-hand side of case A: sim {least:.1} ns (median {median:.1})");
    y.truncate(15);
    let (least, median) = time(&mut || {
        by_hand::rhs(&case.problem, 0.1, black_box(&y), slope.as_mut_slice());
        black_box(&slope);
    });
    println!("                               by hand {least:.1} ns (median {median:.1})\n");
}

/// A minute of the scene `music` at 1e-6: alone, with its energy ledger, and as `sim record` runs it, from the scene to the file under its name.
fn music() {
    let asked = |ledger: bool| {
        let given = [
            "solver.tolerance=1e-6".into(),
            format!("solver.energy={ledger}"),
        ];
        sim::scene::load("music", &given).unwrap_or_else(|e| panic!("{e}"))
    };
    let median = |run: &mut dyn FnMut()| {
        let mut all: Vec<f64> = (0..41)
            .map(|_| {
                let start = Instant::now();
                run();
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    for ledger in [false, true] {
        let scene = asked(ledger);
        let model = Model::new(&scene);
        let mut seen = Vec::new();
        let ms = median(&mut || {
            seen = ours(&model, method_of(&scene), scene.solver.tolerance).looks;
        });
        let reference = sim::solve::method("dop853").expect("a method of the table");
        let truth = ours(&model, reference, 1e-11).looks;
        assert_eq!([seen.len(), truth.len()], [1801; 2], "samples");
        let apart = |(a, b): (&Look, &Look)| (roll(a.turn) - roll(b.turn)).abs();
        let error = worst(seen.iter().zip(&truth).map(apart));
        assert!(error < 1e-6, "roll errs by {error:.1e} rad");
        let what = if ledger {
            "with its energy ledger"
        } else {
            "a minute at 1e-6"
        };
        println!("music, {what}: {ms:.1} ms (median), error of roll {error:.1e} rad");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("music.mcap");
    let ms = median(&mut || {
        let scene = asked(true);
        let model = Model::new(&scene);
        let options = WriterOptions::beside();
        let writer = RecordingWriter::create(&path, &options).expect("begins");
        let mut recorder = Recorder::new(&model, writer).expect("begins");
        let (_, outcome) = run_model(&model, method_of(&scene), &settings(&scene), &mut recorder);
        outcome.unwrap_or_else(|stopped| panic!("{stopped}"));
        recorder.finish().expect("writes");
    });
    let recording = Recording::open(&path, &ReadOptions::default()).expect("opens");
    let states = recording
        .info()
        .channels
        .iter()
        .find(|c| c.topic == "/rath/state");
    assert_eq!(states.map(|c| c.messages), Some(1801));
    println!("music, recorded, from the scene to the file: {ms:.1} ms (median)\n");
}

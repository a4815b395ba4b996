//! palanquin-bench: one rigid body on two handles, three cases, a reference good to 1e-11 rad.
//!
//! References `palanquin_bench/ref_*.csv` (t, roll, z, N1, N2, q w x y z at 30 Hz): a binary128 extrapolation code restarted at
//! every N*_i = 0; an independent double-precision route agrees to 4e-12 (A) and 5e-12 rad (B), Jacobi's functions for C.

use sim::model::Model;
use sim::run::{Sample, run_model};
use sim::scene::parse;
use sim::solve::{Settings, Stats, method};

struct Errors {
    roll_rad: f64,
    z_m: f64,
    turn_rad: f64,
    stats: Stats,
}

fn errors(case: &str, name: &str, tolerance: f64) -> Errors {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/palanquin_bench");
    let text = std::fs::read_to_string(format!("{folder}/{case}.toml")).unwrap();
    let model = Model::new(&parse(case, &text, &[]).unwrap());
    let reference = std::fs::read_to_string(format!("{folder}/ref_{case}.csv")).unwrap();
    let rows: Vec<Vec<f64>> = reference
        .lines()
        .skip(1)
        .map(|l| l.split(',').map(|x| x.parse().unwrap()).collect())
        .collect();
    let mut e = Errors {
        roll_rad: 0.0,
        z_m: 0.0,
        turn_rad: 0.0,
        stats: Stats::default(),
    };
    let mut seen = 0;
    let settings = Settings {
        tolerance,
        step_s: tolerance,
        most_evaluations: 1 << 40,
    };
    let (stats, outcome) = run_model(
        &model,
        method(name).unwrap(),
        &settings,
        &mut |s: &Sample| {
            let row = &rows[seen];
            seen += 1;
            assert!((s.t_s - row[0]).abs() < 1e-9);
            let [x, y, z, w] = s.pose.orientation;
            let [rw, rx, ry, rz] = [row[5], row[6], row[7], row[8]];
            // The rotation between the two: q* ∘ q_ref.
            let real = w * rw + x * rx + y * ry + z * rz;
            let part = [
                w * rx - x * rw - y * rz + z * ry,
                w * ry - y * rw - z * rx + x * rz,
                w * rz - z * rw - x * ry + y * rx,
            ];
            let turn = 2.0
                * part
                    .iter()
                    .map(|p| p * p)
                    .sum::<f64>()
                    .sqrt()
                    .atan2(real.abs());
            e.roll_rad = e
                .roll_rad
                .max((s.pose.roll_pitch_yaw_rad()[0] - row[1]).abs());
            e.z_m = e.z_m.max((s.pose.position_m[2] - row[2]).abs());
            e.turn_rad = e.turn_rad.max(turn);
            true
        },
    );
    outcome.unwrap();
    assert_eq!(seen, rows.len(), "one sample per row, the last included");
    e.stats = stats;
    e
}

#[test]
fn val_case_a_and_its_507_events() {
    for (tolerance, roll_rad) in [(1e-3, 1e-3), (1e-6, 1e-6), (1e-9, 1e-9)] {
        let e = errors("A", "auto", tolerance);
        assert!(
            e.roll_rad <= roll_rad && e.z_m <= roll_rad,
            "{tolerance:e}: roll {:e} z {:e}",
            e.roll_rad,
            e.z_m
        );
        assert_eq!(e.stats.events, 507, "at {tolerance:e}");
    }
}

#[test]
fn val_case_b_and_its_1779_events() {
    for (tolerance, roll_rad) in [(1e-3, 1e-3), (1e-6, 1e-6), (1e-9, 1e-9)] {
        let e = errors("B", "auto", tolerance);
        assert!(
            e.roll_rad <= roll_rad && e.z_m <= roll_rad,
            "{tolerance:e}: roll {:e} z {:e}",
            e.roll_rad,
            e.z_m
        );
        assert_eq!(e.stats.events, 1779, "at {tolerance:e}");
    }
}

#[test]
fn val_case_c_to_what_double_precision_allows() {
    let e = errors("C", "dop853", 1e-9);
    assert!(e.turn_rad <= 1e-6, "{:e}", e.turn_rad);
    assert_eq!(e.stats.events, 0);
}

#[test]
fn loose_tolerances_neither_chatter_nor_fail() {
    for name in ["dopri5", "dop853"] {
        let e = errors("B", name, 1e-3);
        assert!(e.roll_rad < 1e-2, "{name}: {:e}", e.roll_rad);
        assert!(
            (1600..2200).contains(&e.stats.events),
            "{name}: {} events, the truth has 1779",
            e.stats.events
        );
    }
}

#[test]
fn errors_fall_with_the_step_at_the_method_s_order_only_where_events_are_located() {
    // Between two tolerances a factor 10³ apart the located method gains almost as much, the blind one much less evenly.
    let gain = |name: &str| errors("A", name, 1e-5).z_m / errors("A", name, 1e-8).z_m;
    assert!(gain("dopri5") > 100.0, "{}", gain("dopri5"));
}

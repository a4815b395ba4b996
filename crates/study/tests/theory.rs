//! Edges that theory gives, found by the simulator: Adler's tongue and Floquet's boundary.

use study::predictions::floquet::Hanging;
use study::predictions::{locking, stability};

/// |Δω| = K_m: Adler (1946); in the whole model, load and all.
#[test]
fn val_the_tongue_s_edge_is_adlers() {
    let quiet = locking::quiet().unwrap();
    for (pull, sign) in [(0.5, 1.0), (1.5, -1.0), (2.7, 1.0), (3.9, -1.0)] {
        let edge = locking::edge(&quiet, pull, sign).unwrap();
        assert!(
            (edge / pull - 1.0).abs() < 0.03,
            "K_m = {pull}: edge at {edge} rad/s"
        );
    }
}

/// The least depth at which roll grows, in unilateral contact that is kept, against the equations alone.
#[test]
fn val_the_simulated_floquet_boundary() {
    let drive = stability::drive().unwrap();
    let theory = Hanging::of(&drive.with([]).unwrap()).unwrap();
    let [_, roll_hz] = theory.natural_hz();
    for ratio in [1.2, 1.8, 2.0, 2.25] {
        let hz = ratio * roll_hz;
        let expected = theory.threshold(hz, 0.95).unwrap();
        let found = stability::simulated_threshold(&drive, &theory, hz)
            .unwrap()
            .unwrap();
        assert!(
            (found / expected - 1.0).abs() < 0.03,
            "{ratio}: {found}, Floquet {expected}"
        );
        let (_, kept) = stability::simulated(&drive, &theory, hz, 0.9 * expected).unwrap();
        assert!(kept, "{ratio}: contact is lost");
    }
}

/// How fast roll grows well inside the first tongue.
#[test]
fn val_the_simulated_growth_is_floquets() {
    let drive = stability::drive().unwrap();
    let theory = Hanging::of(&drive.with([]).unwrap()).unwrap();
    let [_, roll_hz] = theory.natural_hz();
    for depth in [0.4, 0.6] {
        let known = theory.growth_per_s(2.0 * roll_hz, depth);
        let (found, _) = stability::simulated(&drive, &theory, 2.0 * roll_hz, depth).unwrap();
        println!("{depth}: {found}, Floquet {known}");
        assert!(
            (found - known).abs() < 0.005,
            "{depth}: {found}, Floquet {known}"
        );
    }
}

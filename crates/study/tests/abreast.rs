//! A row of a sweep does not depend on which runs are computed with it, nor on how many threads there are.

use std::path::Path;
use study::sweep::Plan;
use study::sweep::spec::parse;

fn plan(seeds: u64) -> Plan {
    let text = format!(
        r#"
        name = "few"
        scene = "music"
        seeds = {seeds}
        metrics = ["rms_roll_deg", "contact_loss_mean"]
        [set]
        duration_s = 20.0
        [[axes]]
        key = "effects.music.strength_rad_per_s"
        values = [2.0, 2.7]
        "#
    );
    Plan::new(parse("few", &text).unwrap(), Path::new("")).unwrap()
}

#[test]
fn rows_are_the_same_however_the_runs_are_shared_out() {
    let plan = plan(20);
    let all = plan.run(0..40, None).unwrap();
    assert_eq!(all.len(), 40);
    for piece in [0..1, 7..13, 15..29, 39..40] {
        let (first, last) = (piece.start as usize, piece.end as usize);
        assert_eq!(plan.run(piece, None).unwrap(), all[first..last]);
    }
}

#[test]
fn shares_are_all_runs_once_in_whole_lanes() {
    let many = plan(20);
    for (runs, jobs) in [(1, 1), (40, 1), (1200, 2), (5000, 2), (100_003, 7)] {
        let shares = many.shares(runs, jobs);
        let mut next = 0;
        for k in 0..shares.count() {
            let share = shares.get(k);
            assert_eq!(share.start, next);
            assert!(share.end > next);
            next = share.end;
            let size = next - share.start;
            let whole = size.is_multiple_of(8)
                || (size.is_multiple_of(20) && share.start.is_multiple_of(20));
            assert!(next == runs || whole, "{share:?} of {runs}");
            // Whatever is computed, a kill takes no more from any thread than a part and the rest of a point.
            assert!(size < many.block_runs() + 20, "{share:?} of {runs}");
        }
        assert_eq!(next, runs);
        // What the last one leaves the other threads to wait for.
        let last = shares.get(shares.count() - 1);
        assert!(last.end - last.start <= 16, "{last:?} of {runs}");
    }
    let one_by_one = plan(2).shares(1000, 2);
    assert_eq!((one_by_one.count(), one_by_one.get(999)), (1000, 999..1000));
}

/// Seeds side by side are as exact as seeds by themselves, which a study of few seeds takes.
#[test]
fn many_seeds_give_what_few_give_within_the_tolerance() {
    let (many, few) = (plan(20), plan(2));
    let column = |plan: &Plan, name: &str| {
        let mut columns = plan.columns().iter();
        columns.position(|c| c.name == name).unwrap()
    };
    for (run, other) in [(0, 0), (1, 1), (20, 2)] {
        let (a, b) = (
            many.run(run..run + 1, None).unwrap(),
            few.run(other..other + 1, None).unwrap(),
        );
        let place = column(&many, "rms_roll_deg");
        let number = |cell: &study::sweep::table::Cell| match cell {
            study::sweep::table::Cell::Real(x) => *x,
            other => panic!("{other:?}"),
        };
        let (a, b) = (number(&a[0][place]), number(&b[0][place]));
        assert!((a - b).abs() <= 1e-4 * a.abs(), "{a} {b}");
    }
}

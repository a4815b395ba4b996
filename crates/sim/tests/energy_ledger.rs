//! The energy ledger closes: for the default method the unexplained rest stays below 1e-8 of the throughput over 60 s, on the default
//! scene and on every built-in scene whose handles touch anything.

use sim::run::{Sample, run};
use sim::scene::{BUILTIN, load};

#[test]
fn the_rest_is_below_a_hundred_millionth_of_what_went_through() {
    for (name, _) in BUILTIN {
        let mut scene = load(name, &[]).unwrap();
        if scene.effects.contact.is_none() {
            continue;
        }
        scene.duration_s = 60.0;
        assert_eq!(scene.solver.method, "auto");
        let (mut rest, mut throughput) = (0.0f64, 0.0f64);
        run(&scene, &mut |s: &Sample| {
            let e = s.energy.expect("the default keeps a ledger");
            rest = rest.max(e.unexplained_j.abs());
            // What a body at rest holds counts as well: nothing goes through `stand-still`.
            let held = e.kinetic_j + e.elastic_j.abs();
            throughput = throughput.max(e.work_in_j.abs() + e.dissipated_j.abs() + held);
            true
        })
        .unwrap();
        println!("{name}: {rest:.1e} J of {throughput:.1e} J");
        assert!(
            rest < 1e-8 * throughput,
            "{name}: {rest:e} J of {throughput:e} J"
        );
    }
}

#[test]
fn the_shares_of_the_effects_are_all_that_is_booked() {
    let effects = "effects.hold={stiffness_n_per_m=800.0,damping_n_s_per_m=40.0}";
    let scene = load("music", &[effects.to_owned(), "duration_s=20.0".into()]).unwrap();
    let model = sim::model::Model::new(&scene);
    let names: Vec<&str> = model.accounts().collect();
    assert_eq!(names, ["contact", "hold", "pole_friction"]);
    let mut last = None;
    run(&scene, &mut |s: &Sample| {
        let e = s.energy.expect("the default keeps a ledger");
        let sum = |k: usize| s.shares_j.iter().map(|share| share[k]).sum::<f64>();
        assert_eq!((sum(0), sum(1)), (e.work_in_j, e.dissipated_j));
        last = Some(s.shares_j.clone());
        true
    })
    .unwrap();
    let last = last.unwrap();
    // Shoulders that move a body up and down dissipate in every damper.
    assert!(last.iter().all(|[_, lost]| *lost > 0.1), "{last:?}");
}

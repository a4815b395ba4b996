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

/// What a contact's damper has taken never comes back: not when a handle comes down fast and pushes before it touches, nor when it lifts
/// off a spring that is still pressed.
#[test]
fn what_a_contact_dissipates_never_falls() {
    let laws = ["spring-damper", "hunt-crossley"];
    for (name, law) in BUILTIN
        .iter()
        .flat_map(|(name, _)| laws.map(|law| (name, law)))
    {
        let law = [format!("effects.contact.law=\"{law}\"")];
        let scene = load(name, &[]).unwrap();
        if scene.effects.contact.is_none_or(|c| c.bilateral) {
            continue;
        }
        let mut scene = load(name, &law).unwrap();
        scene.duration_s = scene.duration_s.min(60.0);
        let model = sim::model::Model::new(&scene);
        let contact = model.accounts().position(|a| a == "contact").unwrap();
        let (mut most, mut fell) = (0.0f64, 0.0f64);
        run(&scene, &mut |s: &Sample| {
            let lost = s.shares_j[contact][1];
            most = most.max(lost);
            fell = fell.max(most - lost);
            true
        })
        .unwrap();
        println!("{name}, {law:?}: {most:.1e} J, fell by {fell:.1e} J");
        assert!(
            fell <= 1e-12 * (1.0 + most),
            "{name}, {law:?}: fell by {fell:e} J of {most:e} J"
        );
    }
}

/// The energy of springs is that of contacts that are pressed, and of none that a handle has left.
#[test]
fn springs_store_what_their_compression_says() {
    let set = ["sling", "pole_friction"].map(|e| format!("effects.{e}=false"));
    let scene = load("music", &set).unwrap();
    let contact = scene.effects.contact.as_ref().unwrap();
    let (mut slack, mut pressed) = (0, 0);
    run(&scene, &mut |s: &Sample| {
        let each = s.compression_m.iter().enumerate();
        let stored_j: f64 = each
            .map(|(i, d)| 0.5 * contact.stiffness_n_per_m.get(i) * d.max(0.0).powi(2))
            .sum();
        let told_j = s.energy.unwrap().elastic_j;
        assert!(
            (told_j - stored_j).abs() <= 1e-9 * (1.0 + stored_j),
            "{} s: {told_j} J told, {stored_j} J stored",
            s.t_s
        );
        slack += s.compression_m.iter().filter(|d| **d < 0.0).count();
        let pulls = s.compression_m.iter().zip(&s.normal_n);
        pressed += pulls.filter(|(d, n)| **d > 0.0 && **n == 0.0).count();
        true
    })
    .unwrap();
    // Handles that have left their shoulders, and those let go while they were pressed.
    assert!(slack > 100 && pressed > 10, "{slack} {pressed}");
}

/// Straps that hardly damp are fed by a load that bounces, without bound: such a run ends with its cause; one that merely swings goes on.
#[test]
fn a_law_that_feeds_a_run_ends_it() {
    for (damping_s, damping_n_s_per_m) in [(0.0, 400.0), (0.0, 10.0), (0.01, 100.0)] {
        let set = [
            format!("effects.sling.damping_s={damping_s}"),
            format!("effects.contact.damping_n_s_per_m={damping_n_s_per_m:?}"),
        ];
        let (mut largest_j, mut supplied_j) = (0.0f64, 0.0f64);
        let outcome = run(&load("music", &set).unwrap(), &mut |s: &Sample| {
            let e = s.energy.expect("the default keeps a ledger");
            largest_j = largest_j.max(e.kinetic_j);
            supplied_j = supplied_j.max(e.work_in_j.abs());
            true
        });
        let text = outcome.unwrap_err().to_string();
        assert!(text.contains("effects.sling gave"), "{text}");
        assert!(
            largest_j < 2.0 * supplied_j + 2e3,
            "{largest_j:e} {supplied_j:e}"
        );
    }
    // 0.3 m aside in straps of 0.7 m lends 38 J for ever, without anything supplied.
    let text = "name = \"swing\"\nduration_s = 100.0\nfreedom = [\"y\"]\n[start]\nposition_m = [0.0, 0.3]\n\
                [effects.contact]\n[effects.sling]\ndamping_s = 0.0";
    let scene = sim::scene::parse("swing", text, &[]).unwrap();
    run(&scene, &mut |_: &Sample| true).unwrap();
}

/// A method that locates nothing changes a contact when its step has ended; what is sampled within that step balances all the same, and no
/// sound run stops over it.
#[test]
fn samples_of_a_step_that_changes_a_contact_balance() {
    // On the log's grid, and between the steps.
    for rate_hz in [100.0, 970.0] {
        let rate = format!("log_rate_hz={rate_hz:?}");
        let mut scene = load("music", &["duration_s=0.5".into(), rate]).unwrap();
        for method in ["rk4", "adams4", "dopri5-blind"] {
            scene.solver.method = method.into();
            let mut rest = 0.0f64;
            run(&scene, &mut |s: &Sample| {
                rest = rest.max(s.energy.unwrap().unexplained_j.abs());
                true
            })
            .unwrap();
            // ½kδ² is 40 J; a step's own error in booking it is of a joule or two.
            assert!(rest < 4.0, "{method} at {rate_hz} Hz: {rest} J");
        }
    }
    let sets = ["seed=52", "duration_s=0.5", "solver.method=\"rk4\""];
    let scene = load("baseline", &sets.map(String::from)).unwrap();
    run(&scene, &mut |_: &Sample| true).unwrap();
}

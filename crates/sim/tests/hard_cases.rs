//! Every hard case, by every method that claims it.

use sim::cases::{CASES, run_all};
use sim::solve::METHODS;

#[test]
fn every_hard_case_holds_for_every_method_that_claims_it() {
    assert!(CASES.len() >= 30, "{}", CASES.len());
    let rows = run_all(|case| println!("{}: {}", case.name, case.holds));
    let mut broken = Vec::new();
    for (case, row) in CASES.iter().zip(&rows) {
        assert!(
            row.iter().any(Option::is_some),
            "nobody claims {}",
            case.name
        );
        for (method, verdict) in METHODS.iter().zip(row) {
            if let Some(why) = verdict.as_ref().and_then(|v| v.broken.as_ref()) {
                broken.push(format!("{} by {}: {why}", case.name, method.name));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
}

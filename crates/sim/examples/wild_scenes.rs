//! Random scenes inside and far outside the physical range, and what came of them:
//! `cargo run --release -p sim --example wild_scenes -- FROM TO`. The seed is the number of the scene.

#[path = "../tests/common/wild.rs"]
mod wild;

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use wild::{Outcome, outcome};

fn main() {
    let numbers: Vec<u64> = std::env::args()
        .skip(1)
        .filter_map(|a| a.parse().ok())
        .collect();
    let (from, to) = match numbers[..] {
        [seed] => {
            println!(
                "{}# by {}: {:?}",
                wild::wild(seed),
                wild::method_of(seed).name,
                outcome(seed)
            );
            return;
        }
        [from, to] => (from, to),
        _ => (0, 10_000),
    };
    // A panic is counted, not printed.
    std::panic::set_hook(Box::new(|_| {}));
    let next = AtomicU64::new(from);
    let seen: Mutex<BTreeMap<u64, Outcome>> = Mutex::default();
    let work = || {
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= to {
                break;
            }
            let came = outcome(seed);
            seen.lock()
                .unwrap_or_else(|e| e.into_inner())
                .insert(seed, came);
        }
    };
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    std::thread::scope(|scope| (0..cores).for_each(|_| drop(scope.spawn(work))));
    let seen = seen.into_inner().unwrap_or_else(|e| e.into_inner());
    let count = |is: fn(&Outcome) -> bool| seen.values().filter(|o| is(o)).count();
    println!("scenes {from} to {}:", to - 1);
    for (what, is) in [
        (
            "right: the ledger closes to 1e-3",
            (|o| *o == Outcome::Right) as fn(&Outcome) -> bool,
        ),
        (
            "ended, by a method or tolerance that promises no ledger",
            |o| *o == Outcome::Uncontrolled,
        ),
        ("stopped, with time and cause", |o| *o == Outcome::Stopped),
        ("refused, with a sentence", |o| *o == Outcome::Refused),
        ("wrong, not finite, panicked or hung", |o| !o.allowed()),
    ] {
        println!("{:>7}  {what}", count(is));
    }
    for (seed, came) in seen.iter().filter(|(_, o)| !o.allowed()) {
        println!("  scene {seed}: {came:?}");
    }
    if seen.values().any(|o| !o.allowed()) {
        std::process::exit(1);
    }
}

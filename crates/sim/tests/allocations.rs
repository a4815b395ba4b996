//! Nothing is allocated inside a step: a run ten times as long allocates as often.

use sim::effects::imu::Imu;
use sim::model::Model;
use sim::run::{Sample, run_model};
use sim::scene::{Scene, builtin, parse};
use sim::solve::{METHODS, Method, Settings, method};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

struct Counting;

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call is passed on to the system's allocator as it is.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(scene: &Scene, method: &Method, tolerance: f64, duration_s: f64) -> u64 {
    let mut scene = scene.clone();
    scene.duration_s = duration_s;
    let model = Model::new(&scene);
    let settings = Settings {
        tolerance,
        step_s: 1e-3,
        most_evaluations: 1 << 40,
    };
    let before = COUNT.get();
    let (_, outcome) = run_model(&model, method, &settings, &mut |_: &Sample| true);
    outcome.unwrap();
    COUNT.get() - before
}

/// A tick that the polynomial of a step does not hold is solved aside.
#[test]
fn nor_do_ticks_between_loose_steps() {
    let mut scene = parse("music", builtin("music").unwrap(), &[]).unwrap();
    scene.effects.imu = Some(Imu {
        rate_hz: 71.0,
        ideal: true,
        ..Imu::default()
    });
    let method = method("radau15").unwrap();
    let (short, long) = (
        allocations(&scene, method, 1e-3, 3.0),
        allocations(&scene, method, 1e-3, 30.0),
    );
    assert_eq!(short, long);
}

#[test]
fn a_longer_run_allocates_no_more() {
    let implicit = |m: &Method| m.name.starts_with("radau5"); // factors matrices anew
    for name in ["music", "field-imu", "eight-carriers"] {
        let scene = parse(name, builtin(name).unwrap(), &[]).unwrap();
        for method in METHODS.iter().filter(|m| !implicit(m)) {
            let (short, long) = (
                allocations(&scene, method, 1e-6, 3.0),
                allocations(&scene, method, 1e-6, 30.0),
            );
            assert_eq!(short, long, "{name} by {}", method.name);
        }
    }
}

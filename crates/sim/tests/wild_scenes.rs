//! Five hundred random scenes far outside the physical range; the example `wild_scenes` runs ten thousand (docs/accuracy.md).

#[path = "common/wild.rs"]
mod wild;

#[test]
fn whatever_is_asked_for_the_answer_is_right_or_a_clear_stop() {
    let mut seen = [0; 2];
    for seed in 0..500 {
        let came = wild::outcome(seed);
        assert!(
            came.allowed(),
            "scene {seed} by {}: {came:?}\n{}",
            wild::method_of(seed).name,
            wild::wild(seed)
        );
        seen[0] += u32::from(came == wild::Outcome::Right);
        seen[1] += u32::from(came == wild::Outcome::Stopped);
    }
    assert!(
        seen[0] > 50 && seen[1] > 20,
        "too tame or too wild: {seen:?}"
    );
}

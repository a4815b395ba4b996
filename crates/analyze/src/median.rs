//! The middle of numbers.

/// The upper median, reordering `x`; `None` of nothing.
pub(crate) fn median(x: &mut [f64]) -> Option<f64> {
    let middle = x.len() / 2;
    (!x.is_empty()).then(|| *x.select_nth_unstable_by(middle, f64::total_cmp).1)
}

//! Numbers of many carriers side by side: pairs of `f64` that one SSE2 or NEON instruction treats together.
//!
//! Carrier i sits in lane i mod 2 of pair i / 2. With an odd number of carriers the last lane is padding: its
//! parameters are zero, so that it exerts nothing.

pub use wide::f64x2;

/// Lanes in a pair.
pub const LANES: usize = 2;

/// How many pairs hold `n` carriers.
pub const fn pairs(n: usize) -> usize {
    n.div_ceil(LANES)
}

/// Packs one number per carrier; padding lanes are zero.
pub fn pack(values: impl ExactSizeIterator<Item = f64>) -> Vec<f64x2> {
    let mut packed = vec![f64x2::ZERO; pairs(values.len())];
    for (i, v) in values.enumerate() {
        packed[i / LANES].as_mut_array()[i % LANES] = v;
    }
    packed
}

/// Lane `i` of packed numbers.
pub fn lane(packed: &[f64x2], i: usize) -> f64 {
    packed[i / LANES].as_array()[i % LANES]
}

/// Sets lane `i` of packed numbers.
pub fn set_lane(packed: &mut [f64x2], i: usize, value: f64) {
    packed[i / LANES].as_mut_array()[i % LANES] = value;
}

/// Reads `y` (one number per carrier, contiguous) into pairs.
#[inline(always)]
pub fn load(y: &[f64], out: &mut [f64x2]) {
    let mut chunks = y.chunks_exact(LANES);
    for (o, c) in out.iter_mut().zip(&mut chunks) {
        *o = f64x2::new([c[0], c[1]]);
    }
    if let [last] = chunks.remainder() {
        out[out.len() - 1] = f64x2::new([*last, 0.0]);
    }
}

/// Writes pairs into `y` (one number per carrier, contiguous).
#[inline(always)]
pub fn store(packed: &[f64x2], y: &mut [f64]) {
    let mut chunks = y.chunks_exact_mut(LANES);
    for (c, p) in (&mut chunks).zip(packed) {
        c.copy_from_slice(p.as_array());
    }
    if let [last] = chunks.into_remainder() {
        *last = packed[packed.len() - 1].as_array()[0];
    }
}

/// Sum over both lanes.
#[inline(always)]
pub fn sum(v: f64x2) -> f64 {
    let [a, b] = v.to_array();
    a + b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odd_counts_survive_the_round_trip() {
        for n in 1..6 {
            let y: Vec<f64> = (0..n).map(|i| i as f64 + 0.5).collect();
            let packed = pack(y.iter().copied());
            let mut loaded = vec![f64x2::splat(9.0); pairs(n)];
            load(&y, &mut loaded);
            assert_eq!(packed, loaded);
            let mut back = vec![0.0; n];
            store(&loaded, &mut back);
            assert_eq!(y, back);
        }
    }
}

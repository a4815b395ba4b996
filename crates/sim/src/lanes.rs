//! Numbers of many carriers side by side: pairs of `f64` that one SSE2 or NEON instruction treats together.
//!
//! Carrier i sits in lane i mod 2 of pair i / 2. With an odd number of carriers the last lane is padding: its
//! parameters are zero, so that it exerts nothing.
//!
//! Every processor can do what is written for [`Now`]. One that has FMA and AVX2 does the same by fused arithmetic, with one instruction and one
//! rounding where there are two, so that results differ between the two by rounding alone; several moments at once are [`Eight`], one moment with its
//! derivatives is [`Slopes`].

mod eight;
#[cfg(target_arch = "x86_64")]
mod fused;
mod number;
mod slope;

pub use eight::*;
#[cfg(target_arch = "x86_64")]
pub use fused::{Fused, FusedEach, FusedPair};
pub use number::{Eight, Moments, Now, Number, Two};
pub use slope::{Slope, Slopes};
use wide::bytemuck::cast;
pub use wide::f64x2;
use wide::i64x2;

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

/// Reads `y` (one number per carrier, contiguous) pair by pair; padding is zero.
#[inline(always)]
pub fn load(y: &[f64]) -> impl Iterator<Item = f64x2> {
    y.chunks(LANES).map(|c| {
        f64x2::new(if let [a, b] = c {
            [*a, *b]
        } else {
            [c[0], 0.0]
        })
    })
}

/// Writes pairs into `y` (one number per carrier, contiguous).
#[inline(always)]
pub fn store(packed: impl Iterator<Item = f64x2>, y: &mut [f64]) {
    for (to, from) in y.chunks_mut(LANES).zip(packed) {
        let [a, b] = from.to_array();
        to[0] = a;
        if let [_, second] = to {
            *second = b;
        }
    }
}

/// Sum over both lanes.
#[inline(always)]
pub fn sum(v: f64x2) -> f64 {
    let [a, b] = v.to_array();
    a + b
}

/// Beyond this, rad, the reduction below would lose digits and libm takes over.
const FAR_RAD: f64 = 4.0e6;

/// What makes the last digit of a sum a whole number: 1.5·2⁵².
const ROUND: f64 = 6_755_399_441_055_744.0;

/// Sine and cosine of both lanes, to 1 ulp of 1 or better (the test holds it to 2⁻⁵²).
///
/// ```text
/// x = n·π/2 + r,  |r| ≤ π/4;   n from adding 1.5·2⁵², r by subtracting π/2 in three parts of 31, 31 and 53 bits, or in two of 53 where
///                              products are not rounded
/// ```
/// Polynomials are those of Cephes (Moshier 1989), as in Fog's vector class library. Valid for every number; beyond 4·10⁶ rad
/// libm does it, and what is not finite gives NaN. Source of the reduction: Cody & Waite (1980).
#[inline(always)]
pub fn sin_cos(x: f64x2) -> (f64x2, f64x2) {
    sin_cos_by::<f64x2>(x)
}

/// A pair of numbers, however it is multiplied and added.
trait Pairwise: Number {
    fn of(x: f64x2) -> Self;
    fn as_pair(self) -> f64x2;
}

impl Pairwise for f64x2 {
    #[inline(always)]
    fn of(x: f64x2) -> Self {
        x
    }
    #[inline(always)]
    fn as_pair(self) -> f64x2 {
        self
    }
}

/// [`sin_cos`] by the operations of `P`.
#[inline(always)]
fn sin_cos_by<P: Pairwise>(x: f64x2) -> (f64x2, f64x2) {
    let splat = f64x2::splat;
    // Also true for NaN.
    if !x.abs().simd_le(splat(FAR_RAD)).all() {
        return far(x);
    }
    // Functions, as closures would not be inlined into code compiled for more of the processor.
    #[inline(always)]
    fn madd<P: Pairwise>(a: f64x2, b: f64x2, c: f64x2) -> f64x2 {
        P::of(a).madd(P::of(b), P::of(c)).as_pair()
    }
    #[inline(always)]
    fn poly<P: Pairwise>(c: &[f64x2; 6], z: f64x2, z2: f64x2) -> f64x2 {
        // By pairs (Estrin) rather than one after the other: the stages of a step wait for this.
        let (high, middle) = (madd::<P>(c[0], z, c[1]), madd::<P>(c[2], z, c[3]));
        let low = madd::<P>(c[4], z, c[5]);
        madd::<P>(madd::<P>(high, z2, middle), z2, low)
    }
    let shifted = madd::<P>(x, splat(std::f64::consts::FRAC_2_PI), splat(ROUND));
    let quadrant: i64x2 = cast(shifted);
    let n = splat(ROUND) - shifted;
    let mut r = x;
    for part in half_pi(P::ONE_ROUNDING) {
        r = madd::<P>(n, *part, r);
    }
    let z = r * r;
    let z2 = z * z;
    let s = madd::<P>(r * z, poly::<P>(&SIN, z, z2), r);
    let upper = madd::<P>(z, splat(-0.5), splat(1.0));
    let c = madd::<P>(z2, poly::<P>(&COS, z, z2), upper);
    // Odd quadrants swap; bit 1 of n and of n + 1 is the sign.
    let odd: f64x2 = cast(i64x2::ZERO - (quadrant & i64x2::splat(1)));
    let swapped = (s ^ c) & odd;
    let sign = i64x2::splat(i64::MIN);
    let sin_sign: f64x2 = cast((quadrant << 62) & sign);
    let cos_sign: f64x2 = cast(((quadrant + i64x2::splat(1)) << 62) & sign);
    (s ^ swapped ^ sin_sign, c ^ swapped ^ cos_sign)
}

#[cold]
fn far(x: f64x2) -> (f64x2, f64x2) {
    let [a, b] = x.to_array().map(f64::sin_cos);
    (f64x2::new([a.0, b.0]), f64x2::new([a.1, b.1]))
}

/// The same constants in both lanes.
const fn both<const N: usize>(values: [f64; N]) -> [f64x2; N] {
    let mut out = [f64x2::ZERO; N];
    let mut i = 0;
    while i < N {
        out[i] = f64x2::new([values[i]; 2]);
        i += 1;
    }
    out
}

/// π/2 in three parts; the first two have 31 bits, so that their products with n < 2²² are exact.
const HALF_PI: [f64x2; 3] = both([
    1.570_796_326_734_125_6,
    6.077_100_503_593_46e-11,
    2.912_732_056_093_356e-20,
]);
/// π/2 in two parts, for products that are not rounded before they are added: n times the first is then exact however many bits it has.
const WHOLE: [f64x2; 2] = both([std::f64::consts::FRAC_PI_2, 6.123_233_995_736_766e-17]);
/// The parts of π/2 for products that are rounded before they are added, or not.
#[inline(always)]
fn half_pi(one_rounding: bool) -> &'static [f64x2] {
    if one_rounding { &WHOLE } else { &HALF_PI }
}
const SIN: [f64x2; 6] = both([
    1.589_623_015_765_465_6e-10,
    -2.505_074_776_285_780_7e-8,
    2.755_731_362_138_572_2e-6,
    -1.984_126_982_958_953_9e-4,
    8.333_333_333_322_118e-3,
    -1.666_666_666_666_663e-1,
]);
const COS: [f64x2; 6] = both([
    -1.135_853_652_138_768_2e-11,
    2.087_570_084_197_473e-9,
    -2.755_731_417_929_673_9e-7,
    2.480_158_728_885_170_5e-5,
    -1.388_888_888_887_305_6e-3,
    4.166_666_666_666_659e-2,
]);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_and_cosines_are_those_of_libm() {
        let mut worst: f64 = 0.0;
        for i in 0..200_000 {
            let spread = [1.0, 30.0, 1e4, 3.9e6, 1e9][i % 5];
            let x = spread * ((i as f64 * 0.618_033_988_749_895).fract() * 2.0 - 1.0);
            let (s, c) = sin_cos(f64x2::new([x, -x]));
            let [s, c] = [s.to_array(), c.to_array()];
            assert!(s[0] == -s[1] && c[0] == c[1]);
            worst = worst
                .max((s[0] - x.sin()).abs())
                .max((c[0] - x.cos()).abs());
        }
        assert!(worst <= f64::EPSILON, "{worst:e}"); // measured 1.7e-16
        let (s, c) = sin_cos(f64x2::new([f64::INFINITY, f64::NAN]));
        assert!(s.is_nan().all() && c.is_nan().all());
    }

    #[test]
    fn odd_counts_survive_the_round_trip() {
        for n in 1..6 {
            let y: Vec<f64> = (0..n).map(|i| i as f64 + 0.5).collect();
            let packed = pack(y.iter().copied());
            let loaded: Vec<f64x2> = load(&y).collect();
            assert_eq!(packed, loaded);
            let mut back = vec![0.0; n];
            store(loaded.into_iter(), &mut back);
            assert_eq!(y, back);
        }
    }
}

//! Eight numbers side by side, in the widest registers that the processor has.
//!
//! The same operations in the same order in all three, so a run differs between processors by rounding alone.

use super::number::Number;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// How many moments lie side by side.
pub const MOMENTS: usize = 8;

/// Eight numbers.
pub trait Wide: Number {
    /// From an array.
    fn load(x: &[f64; MOMENTS]) -> Self;
    /// As an array.
    fn as_array(&self) -> &[f64; MOMENTS];
    /// The same, to be changed.
    fn as_mut_array(&mut self) -> &mut [f64; MOMENTS];
    /// The last four before the first four.
    fn swapped(self) -> Self;
    /// The first of each, the second of each, and so on.
    fn transposed(of: [Self; MOMENTS]) -> [Self; MOMENTS];
    /// The sum of each.
    #[inline(always)]
    fn sums(of: [Self; MOMENTS]) -> Self {
        let [a, b, c, d, e, f, g, h] = Self::transposed(of);
        ((a + b) + (c + d)) + ((e + f) + (g + h))
    }
    /// The bits of 2^n for a whole number n within ±1022 that 1.5·2⁵² has been added to.
    #[doc(hidden)]
    fn power_of_two(shifted: Self) -> Self;
    /// Swaps `s` and `c` where the low bit of `shifted` is set, and gives each its sign: [`super::sin_cos`].
    #[doc(hidden)]
    fn quadrant(shifted: Self, s: Self, c: Self) -> (Self, Self);
    /// Whether all are at most `most` in size; false for what is not a number.
    #[doc(hidden)]
    fn all_within(self, most: f64) -> bool;
}

/// Eight numbers that the compiler does with as it likes.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Plain8(pub [f64; MOMENTS]);

macro_rules! derived {
    ($type:ident) => {
        impl AddAssign for $type {
            #[inline(always)]
            fn add_assign(&mut self, other: Self) {
                *self = *self + other;
            }
        }
        impl SubAssign for $type {
            #[inline(always)]
            fn sub_assign(&mut self, other: Self) {
                *self = *self - other;
            }
        }
        impl Mul<f64> for $type {
            type Output = Self;
            #[inline(always)]
            fn mul(self, by: f64) -> Self {
                self * Self::splat(by)
            }
        }
        impl Add<f64> for $type {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: f64) -> Self {
                self + Self::splat(other)
            }
        }
        impl Neg for $type {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self::splat(-0.0) - self
            }
        }
    };
}
pub(super) use derived;
derived!(Plain8);

macro_rules! plain {
    ($($trait:ident $op:ident),*) => {$(
        impl $trait for Plain8 {
            type Output = Self;
            #[inline(always)]
            fn $op(self, other: Self) -> Self {
                Plain8(std::array::from_fn(|l| $trait::$op(self.0[l], other.0[l])))
            }
        }
    )*};
}
plain!(Add add, Sub sub, Mul mul, Div div);

/// eˣ to 1 ulp or so; 0 below −700, and the value there above 700.
///
/// ```text
/// x = n ln 2 + r,  |r| ≤ ½ ln 2;   eˣ = 2ⁿ Σ rᵏ/k!  (k ≤ 13)
/// ```
/// Source: Cody & Waite (1980); the sum errs by less than 5e-18.
#[inline(always)]
fn exp<E: Wide>(x: E) -> E {
    use super::ROUND;
    let splat = E::splat;
    let clamped = x.larger(splat(-700.0));
    let clamped = -((-clamped).larger(splat(-700.0)));
    let shifted = clamped.madd(splat(std::f64::consts::LOG2_E), splat(ROUND));
    let n = shifted - splat(ROUND);
    let r = n.madd(splat(-6.931_471_803_691_238e-1), clamped);
    let r = n.madd(splat(-1.908_214_929_270_587_7e-10), r);
    // Odd and even powers apart: two chains half as long, which do not wait for each other.
    let square = r * r;
    let mut odd = splat(1.0 / 6_227_020_800.0);
    for factorial in [39_916_800.0, 362_880.0, 5_040.0, 120.0, 6.0, 1.0] {
        odd = odd.madd(square, splat(1.0 / factorial));
    }
    let mut even = splat(1.0 / 479_001_600.0);
    for factorial in [3_628_800.0, 40_320.0, 720.0, 24.0, 2.0, 1.0] {
        even = even.madd(square, splat(1.0 / factorial));
    }
    let sum = odd.madd(r, even);
    let value = sum * E::power_of_two(shifted);
    (x + 700.0).if_positive(value, splat(0.0))
}

#[inline(always)]
fn of_both<E: Wide>(constant: &super::f64x2) -> E {
    E::splat(constant.as_array()[0])
}

/// A polynomial of degree 5 by pairs, as in [`super::sin_cos`].
#[inline(always)]
fn poly<E: Wide>(c: &[super::f64x2; 6], z: E, z2: E) -> E {
    let high = of_both::<E>(&c[0]).madd(z, of_both(&c[1]));
    let middle = of_both::<E>(&c[2]).madd(z, of_both(&c[3]));
    let low = of_both::<E>(&c[4]).madd(z, of_both(&c[5]));
    high.madd(z2, middle).madd(z2, low)
}

/// As [`super::sin_cos`], eight at a time.
#[inline(always)]
fn sin_cos<E: Wide>(x: E) -> (E, E) {
    use super::{COS, FAR_RAD, ROUND, SIN, half_pi};
    let splat = E::splat;
    let shifted = x.madd(splat(std::f64::consts::FRAC_2_PI), splat(ROUND));
    let n = splat(ROUND) - shifted;
    let mut r = x;
    for part in half_pi(E::ONE_ROUNDING) {
        r = n.madd(of_both(part), r);
    }
    let z = r * r;
    let z2 = z * z;
    let s = (r * z).madd(poly(&SIN, z, z2), r);
    let c = z2.madd(poly(&COS, z, z2), z.madd(splat(-0.5), splat(1.0)));
    let turned = E::quadrant(shifted, s, c);
    if x.all_within(FAR_RAD) {
        return turned;
    }
    let mut mended = turned;
    far(&x, &mut mended);
    mended
}

/// Those that are far by libm. The others keep what they have: runs side by side must not feel each other.
#[cold]
#[inline(never)]
fn far<E: Wide>(x: &E, (sin, cos): &mut (E, E)) {
    use super::FAR_RAD;
    for (l, x) in x.as_array().iter().enumerate() {
        if x.is_nan() || x.abs() > FAR_RAD {
            (sin.as_mut_array()[l], cos.as_mut_array()[l]) = x.sin_cos();
        }
    }
}

macro_rules! shared {
    () => {
        #[inline(always)]
        fn exp(self) -> Self {
            exp(self)
        }
        #[inline(always)]
        fn sin_cos(self) -> (Self, Self) {
            sin_cos(self)
        }
        #[cold]
        fn signed_power(self, p: f64) -> Self {
            Self::load(&self.as_array().map(|x| x.signed_power(p)))
        }
    };
}

impl Number for Plain8 {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Plain8([x; MOMENTS])
    }
    #[inline(always)]
    fn madd(self, b: Self, c: Self) -> Self {
        self * b + c
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        Plain8(std::array::from_fn(|l| self.0[l].max(other.0[l])))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Plain8(self.0.map(f64::abs))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Plain8(self.0.map(f64::sqrt))
    }
    #[inline(always)]
    fn if_positive(self, then: Self, other: Self) -> Self {
        Plain8(std::array::from_fn(|l| {
            if self.0[l] > 0.0 {
                then.0[l]
            } else {
                other.0[l]
            }
        }))
    }
    shared!();
}

impl Wide for Plain8 {
    #[inline(always)]
    fn load(x: &[f64; MOMENTS]) -> Self {
        Plain8(*x)
    }
    #[inline(always)]
    fn as_array(&self) -> &[f64; MOMENTS] {
        &self.0
    }
    #[inline(always)]
    fn as_mut_array(&mut self) -> &mut [f64; MOMENTS] {
        &mut self.0
    }
    #[inline(always)]
    fn swapped(self) -> Self {
        Plain8(std::array::from_fn(|l| self.0[(l + 4) % MOMENTS]))
    }
    #[inline(always)]
    fn transposed(of: [Self; MOMENTS]) -> [Self; MOMENTS] {
        std::array::from_fn(|k| Plain8(std::array::from_fn(|l| of[l].0[k])))
    }
    #[inline(always)]
    fn power_of_two(shifted: Self) -> Self {
        Plain8(
            shifted
                .0
                .map(|x| f64::from_bits((x.to_bits() << 52).wrapping_add(1023 << 52))),
        )
    }
    #[inline(always)]
    fn quadrant(shifted: Self, s: Self, c: Self) -> (Self, Self) {
        let (mut sin, mut cos) = (s, c);
        for l in 0..MOMENTS {
            let quadrant = shifted.0[l].to_bits();
            let (s, c) = if quadrant & 1 == 0 {
                (s.0[l], c.0[l])
            } else {
                (c.0[l], s.0[l])
            };
            sin.0[l] = f64::from_bits(s.to_bits() ^ ((quadrant & 2) << 62));
            cos.0[l] = f64::from_bits(c.to_bits() ^ ((quadrant.wrapping_add(1) & 2) << 62));
        }
        (sin, cos)
    }
    #[inline(always)]
    fn all_within(self, most: f64) -> bool {
        self.0.iter().all(|x| x.abs() <= most)
    }
}

#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod x86 {
    //! SAFETY of every block here: values of these types are made only by code that runs behind a check of the processor's features
    //! (`crate::solve::radau15`), and every pointer is to eight numbers.

    use super::*;
    use std::arch::x86_64::*;

    /// Eight numbers in one register of AVX-512.
    #[derive(Clone, Copy, Debug)]
    #[repr(transparent)]
    pub struct Avx512(__m512d);

    /// Eight numbers in two registers of AVX2, with fused multiplication and addition.
    #[derive(Clone, Copy, Debug)]
    #[repr(transparent)]
    pub struct Avx2([__m256d; 2]);

    derived!(Avx512);
    derived!(Avx2);

    macro_rules! arithmetic {
        ($($trait:ident $op:ident $wide:ident $narrow:ident),*) => {$(
            impl $trait for Avx512 {
                type Output = Self;
                #[inline(always)]
                fn $op(self, other: Self) -> Self {
                    Avx512(unsafe { $wide(self.0, other.0) })
                }
            }
            impl $trait for Avx2 {
                type Output = Self;
                #[inline(always)]
                fn $op(self, other: Self) -> Self {
                    let ([a, b], [c, d]) = (self.0, other.0);
                    Avx2(unsafe { [$narrow(a, c), $narrow(b, d)] })
                }
            }
        )*};
    }
    arithmetic!(
        Add add _mm512_add_pd _mm256_add_pd,
        Sub sub _mm512_sub_pd _mm256_sub_pd,
        Mul mul _mm512_mul_pd _mm256_mul_pd,
        Div div _mm512_div_pd _mm256_div_pd
    );

    impl Number for Avx512 {
        const ONE_ROUNDING: bool = true;
        #[inline(always)]
        fn splat(x: f64) -> Self {
            Avx512(unsafe { _mm512_set1_pd(x) })
        }
        #[inline(always)]
        fn madd(self, b: Self, c: Self) -> Self {
            Avx512(unsafe { _mm512_fmadd_pd(self.0, b.0, c.0) })
        }
        #[inline(always)]
        fn larger(self, other: Self) -> Self {
            Avx512(unsafe { _mm512_max_pd(self.0, other.0) })
        }
        #[inline(always)]
        fn abs(self) -> Self {
            Avx512(unsafe { _mm512_abs_pd(self.0) })
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            Avx512(unsafe { _mm512_sqrt_pd(self.0) })
        }
        #[inline(always)]
        fn if_positive(self, then: Self, other: Self) -> Self {
            unsafe {
                let positive = _mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.0, _mm512_setzero_pd());
                Avx512(_mm512_mask_blend_pd(positive, other.0, then.0))
            }
        }
        shared!();
    }

    impl Wide for Avx512 {
        #[inline(always)]
        fn load(x: &[f64; MOMENTS]) -> Self {
            Avx512(unsafe { _mm512_loadu_pd(x.as_ptr()) })
        }
        #[inline(always)]
        fn as_array(&self) -> &[f64; MOMENTS] {
            // A register in memory is its numbers in order.
            unsafe { &*std::ptr::from_ref(self).cast() }
        }
        #[inline(always)]
        fn as_mut_array(&mut self) -> &mut [f64; MOMENTS] {
            unsafe { &mut *std::ptr::from_mut(self).cast() }
        }
        #[inline(always)]
        fn swapped(self) -> Self {
            Avx512(unsafe { _mm512_shuffle_f64x2::<0b01_00_11_10>(self.0, self.0) })
        }
        #[inline(always)]
        fn transposed(of: [Self; MOMENTS]) -> [Self; MOMENTS] {
            // Quarters 0 and 2 of each, and 1 and 3. A closure would be a call.
            #[inline(always)]
            fn quarters(a: __m512d, b: __m512d) -> [__m512d; 2] {
                unsafe {
                    [
                        _mm512_shuffle_f64x2::<0x88>(a, b),
                        _mm512_shuffle_f64x2::<0xdd>(a, b),
                    ]
                }
            }
            #[inline(always)]
            fn four(a: Avx512, b: Avx512, c: Avx512, d: Avx512) -> [__m512d; 4] {
                let (even, odd) = unsafe {
                    (
                        quarters(_mm512_unpacklo_pd(a.0, b.0), _mm512_unpacklo_pd(c.0, d.0)),
                        quarters(_mm512_unpackhi_pd(a.0, b.0), _mm512_unpackhi_pd(c.0, d.0)),
                    )
                };
                // Numbers 0 and 4, 1 and 5, 2 and 6, 3 and 7.
                [even[0], odd[0], even[1], odd[1]]
            }
            let [a, b, c, d, e, f, g, h] = of;
            let (upper, lower) = (four(a, b, c, d), four(e, f, g, h));
            let [p, t] = quarters(upper[0], lower[0]);
            let [q, u] = quarters(upper[1], lower[1]);
            let [r, v] = quarters(upper[2], lower[2]);
            let [s, w] = quarters(upper[3], lower[3]);
            [p, q, r, s, t, u, v, w].map(Avx512)
        }
        #[inline(always)]
        fn power_of_two(shifted: Self) -> Self {
            unsafe {
                let n = _mm512_slli_epi64::<52>(_mm512_castpd_si512(shifted.0));
                let one = _mm512_set1_epi64(1023 << 52);
                Avx512(_mm512_castsi512_pd(_mm512_add_epi64(n, one)))
            }
        }
        #[inline(always)]
        fn quadrant(shifted: Self, s: Self, c: Self) -> (Self, Self) {
            unsafe {
                let n = _mm512_castpd_si512(shifted.0);
                let odd = _mm512_test_epi64_mask(n, _mm512_set1_epi64(1));
                let (sin, cos) = (
                    _mm512_mask_blend_pd(odd, s.0, c.0),
                    _mm512_mask_blend_pd(odd, c.0, s.0),
                );
                let (two, one) = (_mm512_set1_epi64(2), _mm512_set1_epi64(1));
                let of_sin = _mm512_slli_epi64::<62>(_mm512_and_si512(n, two));
                let of_cos = _mm512_and_si512(_mm512_add_epi64(n, one), two);
                let of_cos = _mm512_slli_epi64::<62>(of_cos);
                (
                    Avx512(_mm512_xor_pd(sin, _mm512_castsi512_pd(of_sin))),
                    Avx512(_mm512_xor_pd(cos, _mm512_castsi512_pd(of_cos))),
                )
            }
        }
        #[inline(always)]
        fn all_within(self, most: f64) -> bool {
            unsafe {
                _mm512_cmp_pd_mask::<_CMP_LE_OQ>(_mm512_abs_pd(self.0), _mm512_set1_pd(most)) == 255
            }
        }
    }

    // Functions rather than closures, which would not be inlined into code compiled for these registers.

    #[inline(always)]
    fn size(x: __m256d) -> __m256d {
        unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), x) }
    }

    #[inline(always)]
    fn choose(x: __m256d, then: __m256d, other: __m256d) -> __m256d {
        unsafe {
            let positive = _mm256_cmp_pd::<_CMP_GT_OQ>(x, _mm256_setzero_pd());
            _mm256_blendv_pd(other, then, positive)
        }
    }

    #[inline(always)]
    fn power_of_two(shifted: __m256d) -> __m256d {
        unsafe {
            let n = _mm256_slli_epi64::<52>(_mm256_castpd_si256(shifted));
            let one = _mm256_set1_epi64x(1023 << 52);
            _mm256_castsi256_pd(_mm256_add_epi64(n, one))
        }
    }

    #[inline(always)]
    fn quadrant(shifted: __m256d, s: __m256d, c: __m256d) -> (__m256d, __m256d) {
        unsafe {
            let n = _mm256_castpd_si256(shifted);
            // The lowest bit as the sign, which is what a blend looks at.
            let odd = _mm256_castsi256_pd(_mm256_slli_epi64::<63>(n));
            let (sin, cos) = (_mm256_blendv_pd(s, c, odd), _mm256_blendv_pd(c, s, odd));
            let (two, one) = (_mm256_set1_epi64x(2), _mm256_set1_epi64x(1));
            let of_sin = _mm256_slli_epi64::<62>(_mm256_and_si256(n, two));
            let of_cos = _mm256_and_si256(_mm256_add_epi64(n, one), two);
            let of_cos = _mm256_slli_epi64::<62>(of_cos);
            (
                _mm256_xor_pd(sin, _mm256_castsi256_pd(of_sin)),
                _mm256_xor_pd(cos, _mm256_castsi256_pd(of_cos)),
            )
        }
    }

    #[inline(always)]
    fn within(x: __m256d, most: f64) -> bool {
        unsafe {
            let below = _mm256_cmp_pd::<_CMP_LE_OQ>(size(x), _mm256_set1_pd(most));
            _mm256_movemask_pd(below) == 15
        }
    }

    impl Number for Avx2 {
        const ONE_ROUNDING: bool = true;
        #[inline(always)]
        fn splat(x: f64) -> Self {
            Avx2(unsafe { [_mm256_set1_pd(x); 2] })
        }
        #[inline(always)]
        fn madd(self, b: Self, c: Self) -> Self {
            Avx2(unsafe {
                [
                    _mm256_fmadd_pd(self.0[0], b.0[0], c.0[0]),
                    _mm256_fmadd_pd(self.0[1], b.0[1], c.0[1]),
                ]
            })
        }
        #[inline(always)]
        fn larger(self, other: Self) -> Self {
            let ([a, b], [c, d]) = (self.0, other.0);
            Avx2(unsafe { [_mm256_max_pd(a, c), _mm256_max_pd(b, d)] })
        }
        #[inline(always)]
        fn abs(self) -> Self {
            Avx2([size(self.0[0]), size(self.0[1])])
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            Avx2(unsafe { [_mm256_sqrt_pd(self.0[0]), _mm256_sqrt_pd(self.0[1])] })
        }
        #[inline(always)]
        fn if_positive(self, then: Self, other: Self) -> Self {
            Avx2([
                choose(self.0[0], then.0[0], other.0[0]),
                choose(self.0[1], then.0[1], other.0[1]),
            ])
        }
        shared!();
    }

    impl Wide for Avx2 {
        #[inline(always)]
        fn load(x: &[f64; MOMENTS]) -> Self {
            Avx2(unsafe {
                [
                    _mm256_loadu_pd(x.as_ptr()),
                    _mm256_loadu_pd(x[4..].as_ptr()),
                ]
            })
        }
        #[inline(always)]
        fn as_array(&self) -> &[f64; MOMENTS] {
            unsafe { &*std::ptr::from_ref(self).cast() }
        }
        #[inline(always)]
        fn as_mut_array(&mut self) -> &mut [f64; MOMENTS] {
            unsafe { &mut *std::ptr::from_mut(self).cast() }
        }
        #[inline(always)]
        fn swapped(self) -> Self {
            Avx2([self.0[1], self.0[0]])
        }
        #[inline(always)]
        fn transposed(of: [Self; MOMENTS]) -> [Self; MOMENTS] {
            #[inline(always)]
            fn four(a: __m256d, b: __m256d, c: __m256d, d: __m256d) -> [__m256d; 4] {
                unsafe {
                    let (p, q) = (_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b));
                    let (r, s) = (_mm256_unpacklo_pd(c, d), _mm256_unpackhi_pd(c, d));
                    [
                        _mm256_permute2f128_pd::<0x20>(p, r),
                        _mm256_permute2f128_pd::<0x20>(q, s),
                        _mm256_permute2f128_pd::<0x31>(p, r),
                        _mm256_permute2f128_pd::<0x31>(q, s),
                    ]
                }
            }
            let [a, b, c, d, e, f, g, h] = of;
            let (p, q) = (
                four(a.0[0], b.0[0], c.0[0], d.0[0]),
                four(e.0[0], f.0[0], g.0[0], h.0[0]),
            );
            let (r, s) = (
                four(a.0[1], b.0[1], c.0[1], d.0[1]),
                four(e.0[1], f.0[1], g.0[1], h.0[1]),
            );
            [
                Avx2([p[0], q[0]]),
                Avx2([p[1], q[1]]),
                Avx2([p[2], q[2]]),
                Avx2([p[3], q[3]]),
                Avx2([r[0], s[0]]),
                Avx2([r[1], s[1]]),
                Avx2([r[2], s[2]]),
                Avx2([r[3], s[3]]),
            ]
        }
        #[inline(always)]
        fn power_of_two(shifted: Self) -> Self {
            Avx2([power_of_two(shifted.0[0]), power_of_two(shifted.0[1])])
        }
        #[inline(always)]
        fn quadrant(shifted: Self, s: Self, c: Self) -> (Self, Self) {
            let low = quadrant(shifted.0[0], s.0[0], c.0[0]);
            let high = quadrant(shifted.0[1], s.0[1], c.0[1]);
            (Avx2([low.0, high.0]), Avx2([low.1, high.1]))
        }
        #[inline(always)]
        fn all_within(self, most: f64) -> bool {
            within(self.0[0], most) && within(self.0[1], most)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn functions_are_those_of_libm<E: Wide>() {
        let (mut worst, mut worst_exp) = (0.0_f64, 0.0_f64);
        for i in 0..50_000 {
            let x: [f64; MOMENTS] = std::array::from_fn(|l| {
                let spread = [1.0, 30.0, 1e4, 3.9e6, 1e9][i % 5];
                let part = ((8 * i + l) as f64 * 0.618_033_988_749_895).fract();
                spread * (2.0 * part - 1.0)
            });
            let (sin, cos) = E::load(&x).sin_cos();
            let small = x.map(|x| x.clamp(-690.0, 690.0));
            let exp = E::load(&small).exp();
            for l in 0..MOMENTS {
                worst = worst
                    .max((sin.as_array()[l] - x[l].sin()).abs())
                    .max((cos.as_array()[l] - x[l].cos()).abs());
                worst_exp = worst_exp.max((exp.as_array()[l] / small[l].exp() - 1.0).abs());
            }
        }
        assert!(worst <= f64::EPSILON, "{worst:e}");
        assert!(worst_exp <= 2.0 * f64::EPSILON, "{worst_exp:e}");
        let edges = [f64::NAN, f64::INFINITY, 0.0, -1e4, 1e4, 1.0, -1.0, -0.0];
        let exp = E::load(&edges).exp();
        assert!(exp.as_array()[2..4] == [1.0, 0.0] && exp.as_array()[4] > 1e304);
        let (sin, cos) = E::load(&edges).sin_cos();
        for l in 0..2 {
            assert!(sin.as_array()[l].is_nan() && cos.as_array()[l].is_nan());
        }
        assert_eq!(E::load(&edges).abs().as_array()[6], 1.0);
        let signs = E::load(&edges).if_positive(E::splat(1.0), E::splat(2.0));
        assert_eq!(signs.as_array()[2..], [2.0, 2.0, 1.0, 1.0, 2.0, 2.0]);
        let swapped = E::load(&edges).swapped();
        assert_eq!(swapped.as_array()[..4], edges[4..]);
        assert_eq!(swapped.as_array()[5..], edges[1..4]);
        let square: [E; MOMENTS] =
            std::array::from_fn(|k| E::load(&std::array::from_fn(|l| (MOMENTS * k + l) as f64)));
        let (turned, sums) = (E::transposed(square), E::sums(square));
        for k in 0..MOMENTS {
            for l in 0..MOMENTS {
                assert_eq!(turned[l].as_array()[k], square[k].as_array()[l]);
            }
            assert_eq!(sums.as_array()[k], (64 * k + 28) as f64);
        }
        assert_eq!(E::splat(2.0).signed_power(3.0).as_array()[0], 8.0);
        assert_eq!((-E::splat(9.0)).signed_power(0.5).as_array()[7], -3.0);
    }

    #[test]
    fn any_processor() {
        functions_are_those_of_libm::<Plain8>();
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn wide_registers() {
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            functions_are_those_of_libm::<Avx2>();
        }
        if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
            functions_are_those_of_libm::<Avx512>();
        }
    }
}

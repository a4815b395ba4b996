//! One moment, on a processor that multiplies and adds in one instruction (FMA; AVX2, so that no instruction has to copy a number first).
//!
//! Numbers lie in memory as those of [`Now`](super::Now) do, so an evaluation can be done by either.
//!
//! SAFETY of every block here: values of these types are computed with only by code that runs behind a check of the processor's features
//! (`crate::model::Model`).
#![allow(unsafe_code)]

use super::eight::derived;
use super::{Moments, Number, Pairwise, f64x2, sin_cos_by};
use std::arch::x86_64::{__m128d, _mm_fmadd_pd};
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};
use wide::bytemuck::cast;

/// As [`Now`](super::Now).
#[derive(Clone, Copy, Debug)]
pub struct Fused;

/// A number.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct FusedEach(pub f64);

impl FusedEach {
    /// Numbers as these.
    #[inline(always)]
    pub fn all(x: &[f64]) -> &[Self] {
        // SAFETY: nothing but another name for the same numbers.
        unsafe { &*(std::ptr::from_ref(x) as *const [Self]) }
    }

    /// The same, to be changed.
    #[inline(always)]
    pub fn all_mut(x: &mut [f64]) -> &mut [Self] {
        // SAFETY: as above.
        unsafe { &mut *(std::ptr::from_mut(x) as *mut [Self]) }
    }
}

/// Numbers of two carriers.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct FusedPair(pub f64x2);

macro_rules! arithmetic {
    ($type:ident: $($trait:ident $op:ident),*) => {
        derived!($type);
        $(impl $trait for $type {
            type Output = Self;
            #[inline(always)]
            fn $op(self, other: Self) -> Self {
                $type($trait::$op(self.0, other.0))
            }
        })*
    };
}
arithmetic!(FusedEach: Add add, Sub sub, Mul mul, Div div);
arithmetic!(FusedPair: Add add, Sub sub, Mul mul, Div div);

#[inline(always)]
fn madd(a: f64x2, b: f64x2, c: f64x2) -> f64x2 {
    let [a, b, c]: [__m128d; 3] = [cast(a), cast(b), cast(c)];
    cast(unsafe { _mm_fmadd_pd(a, b, c) })
}

macro_rules! number {
    ($type:ident, $inner:ty, |$a:ident, $b:ident, $c:ident| $madd:expr, |$x:ident| $sin_cos:expr) => {
        impl Number for $type {
            const ONE_ROUNDING: bool = true;
            #[inline(always)]
            fn splat(x: f64) -> Self {
                $type(<$inner as Number>::splat(x))
            }
            #[inline(always)]
            fn madd(self, b: Self, c: Self) -> Self {
                let ($a, $b, $c) = (self.0, b.0, c.0);
                $type($madd)
            }
            #[inline(always)]
            fn larger(self, other: Self) -> Self {
                $type(Number::larger(self.0, other.0))
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $type(Number::abs(self.0))
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $type(Number::sqrt(self.0))
            }
            #[inline(always)]
            fn exp(self) -> Self {
                $type(Number::exp(self.0))
            }
            #[inline(always)]
            fn sin_cos(self) -> (Self, Self) {
                let $x = self.0;
                let (sin, cos) = $sin_cos;
                ($type(sin), $type(cos))
            }
            #[inline(always)]
            fn if_positive(self, then: Self, other: Self) -> Self {
                $type(self.0.if_positive(then.0, other.0))
            }
            fn signed_power(self, p: f64) -> Self {
                $type(self.0.signed_power(p))
            }
        }
    };
}
number!(FusedEach, f64, |a, b, c| a.mul_add(b, c), |x| {
    let (s, c) = sin_cos_by::<FusedPair>(f64x2::splat(x));
    (s.to_array()[0], c.to_array()[0])
});
number!(FusedPair, f64x2, |a, b, c| madd(a, b, c), |x| sin_cos_by::<
    FusedPair,
>(x));

impl Pairwise for FusedPair {
    #[inline(always)]
    fn of(x: f64x2) -> Self {
        Self(x)
    }
    #[inline(always)]
    fn as_pair(self) -> f64x2 {
        self.0
    }
}

impl Moments for Fused {
    type Each = FusedEach;
    type Pair = FusedPair;
    #[inline(always)]
    fn always(pair: f64x2) -> FusedPair {
        FusedPair(pair)
    }
    #[inline(always)]
    fn both(each: FusedEach) -> FusedPair {
        FusedPair(f64x2::splat(each.0))
    }
    #[inline(always)]
    fn sum(pair: FusedPair) -> FusedEach {
        FusedEach(super::sum(pair.0))
    }
    #[inline(always)]
    fn of(pair: FusedPair, lane: usize) -> FusedEach {
        FusedEach(pair.0.as_array()[lane])
    }
    #[inline(always)]
    fn set(pair: &mut FusedPair, lane: usize, each: FusedEach) {
        pair.0.as_mut_array()[lane] = each.0;
    }
    #[inline(always)]
    fn look_up<const I: usize, const K: usize>(
        at: [FusedEach; I],
        table: impl Fn([f64; I]) -> [f64; K],
    ) -> [FusedEach; K] {
        table(at.map(|at| at.0)).map(FusedEach)
    }
}

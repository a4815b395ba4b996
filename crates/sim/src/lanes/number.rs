//! Arithmetic that is written once and done at one moment or at eight moments side by side.

use super::{MOMENTS, Wide, f64x2};
use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// What an effect computes with: a number, numbers of two carriers, or either at eight moments.
pub trait Number:
    Copy
    + Debug
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + Mul<f64, Output = Self>
    + Add<f64, Output = Self>
{
    /// Whether [`Self::madd`] rounds once.
    const ONE_ROUNDING: bool = false;
    /// The same number everywhere.
    fn splat(x: f64) -> Self;
    /// self·b + c; with one rounding where the processor does that as fast as with two.
    fn madd(self, b: Self, c: Self) -> Self;
    /// c − self·b; rounded as [`Self::madd`].
    #[inline(always)]
    fn nmadd(self, b: Self, c: Self) -> Self {
        (-self).madd(b, c)
    }
    /// The larger; which one where either is not a number is left open.
    fn larger(self, other: Self) -> Self;
    /// |x|
    fn abs(self) -> Self;
    /// √x
    fn sqrt(self) -> Self;
    /// eˣ
    fn exp(self) -> Self;
    /// sin x and cos x
    fn sin_cos(self) -> (Self, Self);
    /// `then` where self > 0, else `other`.
    fn if_positive(self, then: Self, other: Self) -> Self;
    /// |x|^p with the sign of x.
    fn signed_power(self, p: f64) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn madd(self, b: Self, c: Self) -> Self {
        self * b + c
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        self.max(other)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline(always)]
    fn exp(self) -> Self {
        self.exp()
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = super::sin_cos(f64x2::splat(self));
        (s.to_array()[0], c.to_array()[0])
    }
    #[inline(always)]
    fn if_positive(self, then: Self, other: Self) -> Self {
        if self > 0.0 { then } else { other }
    }
    fn signed_power(self, p: f64) -> Self {
        self.abs().powf(p).copysign(self)
    }
}

impl Number for f64x2 {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        f64x2::splat(x)
    }
    #[inline(always)]
    fn madd(self, b: Self, c: Self) -> Self {
        self * b + c
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        self.fast_max(other)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline(always)]
    fn exp(self) -> Self {
        f64x2::new(self.to_array().map(f64::exp))
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        super::sin_cos(self)
    }
    #[inline(always)]
    fn if_positive(self, then: Self, other: Self) -> Self {
        self.simd_gt(f64x2::ZERO).select(then, other)
    }
    fn signed_power(self, p: f64) -> Self {
        f64x2::new(self.to_array().map(|x| x.signed_power(p)))
    }
}

/// At how many moments an evaluation treats the carriers.
pub trait Moments: Copy + Debug + Send + Sync + 'static {
    /// A number at each moment.
    type Each: Number;
    /// Numbers of two carriers at each moment.
    type Pair: Number;
    /// What two carriers have at every moment.
    fn always(pair: f64x2) -> Self::Pair;
    /// What both carriers share.
    fn both(each: Self::Each) -> Self::Pair;
    /// The sum over both carriers.
    fn sum(pair: Self::Pair) -> Self::Each;
    /// The numbers of one carrier of the two.
    fn of(pair: Self::Pair, lane: usize) -> Self::Each;
    /// The same, to be changed.
    fn set(pair: &mut Self::Pair, lane: usize, each: Self::Each);
    /// What a table says at each moment; it is asked by numbers that depend on time alone.
    fn look_up<const I: usize, const K: usize>(
        at: [Self::Each; I],
        table: impl Fn([f64; I]) -> [f64; K],
    ) -> [Self::Each; K];
}

/// One moment.
#[derive(Clone, Copy, Debug)]
pub struct Now;

impl Moments for Now {
    type Each = f64;
    type Pair = f64x2;
    #[inline(always)]
    fn always(pair: f64x2) -> f64x2 {
        pair
    }
    #[inline(always)]
    fn both(each: f64) -> f64x2 {
        f64x2::splat(each)
    }
    #[inline(always)]
    fn sum(pair: f64x2) -> f64 {
        super::sum(pair)
    }
    #[inline(always)]
    fn of(pair: f64x2, lane: usize) -> f64 {
        pair.as_array()[lane]
    }
    #[inline(always)]
    fn set(pair: &mut f64x2, lane: usize, each: f64) {
        pair.as_mut_array()[lane] = each;
    }
    #[inline(always)]
    fn look_up<const I: usize, const K: usize>(
        at: [f64; I],
        table: impl Fn([f64; I]) -> [f64; K],
    ) -> [f64; K] {
        table(at)
    }
}

/// Eight moments side by side, in the registers that `E` stands for.
#[derive(Clone, Copy, Debug)]
pub struct Eight<E>(std::marker::PhantomData<E>);

/// Numbers of two carriers, of which each is several.
#[derive(Clone, Copy, Debug)]
pub struct Two<E>(pub [E; 2]);

impl<E: Wide> Moments for Eight<E> {
    type Each = E;
    type Pair = Two<E>;
    #[inline(always)]
    fn always(pair: f64x2) -> Two<E> {
        let [a, b] = pair.to_array();
        Two([E::splat(a), E::splat(b)])
    }
    #[inline(always)]
    fn both(each: E) -> Two<E> {
        Two([each, each])
    }
    #[inline(always)]
    fn sum(pair: Two<E>) -> E {
        pair.0[0] + pair.0[1]
    }
    #[inline(always)]
    fn of(pair: Two<E>, lane: usize) -> E {
        pair.0[lane]
    }
    #[inline(always)]
    fn set(pair: &mut Two<E>, lane: usize, each: E) {
        pair.0[lane] = each;
    }
    #[inline(always)]
    fn look_up<const I: usize, const K: usize>(
        at: [E; I],
        table: impl Fn([f64; I]) -> [f64; K],
    ) -> [E; K] {
        let mut out = [E::splat(0.0); K];
        for moment in 0..MOMENTS {
            let found = table(at.map(|at| at.as_array()[moment]));
            for (out, found) in out.iter_mut().zip(found) {
                out.as_mut_array()[moment] = found;
            }
        }
        out
    }
}

macro_rules! by_carrier {
    ($($trait:ident $op:ident),*) => {$(
        impl<E: Number> $trait for Two<E> {
            type Output = Self;
            #[inline(always)]
            fn $op(self, other: Self) -> Self {
                Two([$trait::$op(self.0[0], other.0[0]), $trait::$op(self.0[1], other.0[1])])
            }
        }
    )*};
}
by_carrier!(Add add, Sub sub, Mul mul, Div div);

impl<E: Number> Neg for Two<E> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Two([-self.0[0], -self.0[1]])
    }
}
impl<E: Number> AddAssign for Two<E> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}
impl<E: Number> SubAssign for Two<E> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}
impl<E: Number> Mul<f64> for Two<E> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, by: f64) -> Self {
        Two([self.0[0] * by, self.0[1] * by])
    }
}
impl<E: Number> Add<f64> for Two<E> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: f64) -> Self {
        Two([self.0[0] + other, self.0[1] + other])
    }
}

impl<E: Number> Number for Two<E> {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Two([E::splat(x); 2])
    }
    #[inline(always)]
    fn madd(self, b: Self, c: Self) -> Self {
        Two([
            self.0[0].madd(b.0[0], c.0[0]),
            self.0[1].madd(b.0[1], c.0[1]),
        ])
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        Two([self.0[0].larger(other.0[0]), self.0[1].larger(other.0[1])])
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Two([self.0[0].abs(), self.0[1].abs()])
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Two([self.0[0].sqrt(), self.0[1].sqrt()])
    }
    #[inline(always)]
    fn exp(self) -> Self {
        Two([self.0[0].exp(), self.0[1].exp()])
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (a, b) = (self.0[0].sin_cos(), self.0[1].sin_cos());
        (Two([a.0, b.0]), Two([a.1, b.1]))
    }
    #[inline(always)]
    fn if_positive(self, then: Self, other: Self) -> Self {
        Two([
            self.0[0].if_positive(then.0[0], other.0[0]),
            self.0[1].if_positive(then.0[1], other.0[1]),
        ])
    }
    fn signed_power(self, p: f64) -> Self {
        Two([self.0[0].signed_power(p), self.0[1].signed_power(p)])
    }
}

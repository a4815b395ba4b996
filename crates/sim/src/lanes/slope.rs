//! A number with its derivatives in eight directions: forward automatic differentiation.
//!
//! ```text
//! x + ε·x′,  ε_i ε_j = 0:   f(x + ε·x′) = f(x) + ε·f′(x) x′
//! ```
//! Exact but for rounding. Where a function has a kink (|x|, √x at 0, the larger of two that are equal) the derivative is that of one side, or 0 where
//! it would be infinite. Source: Griewank & Walther, Evaluating Derivatives, 2nd ed. (2008), ch. 3.

use super::eight::derived;
use super::number::{Moments, Number, Two};
use super::{MOMENTS, f64x2};
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A number and how it changes.
#[derive(Clone, Copy, Debug)]
pub struct Slope {
    /// The number.
    pub here: f64,
    /// Its derivative in each direction.
    pub along: [f64; MOMENTS],
}

impl Slope {
    /// `here`, where `self` changes at `rate` times what it does.
    #[inline(always)]
    fn onto(self, here: f64, rate: f64) -> Self {
        Self {
            here,
            along: self.along.map(|x| x * rate),
        }
    }

    /// `here`, which changes by `of` of what both do.
    #[inline(always)]
    fn with(self, other: Self, here: f64, of: impl Fn(f64, f64) -> f64) -> Self {
        Self {
            here,
            along: std::array::from_fn(|k| of(self.along[k], other.along[k])),
        }
    }

    /// (xy)′ = x′y + y′x
    #[inline(always)]
    fn times(self, b: Self) -> Self {
        self.with(b, self.here * b.here, |x, y| x * b.here + y * self.here)
    }

    /// (x/y)′ = (x′ − y′ x/y)/y
    #[inline(always)]
    fn over(self, b: Self) -> Self {
        let ratio = self.here / b.here;
        self.with(b, ratio, |x, y| (x - y * ratio) / b.here)
    }
}

derived!(Slope);

impl Add for Slope {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        self.with(b, self.here + b.here, |x, y| x + y)
    }
}

impl Sub for Slope {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self.with(b, self.here - b.here, |x, y| x - y)
    }
}

impl Mul for Slope {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        self.times(b)
    }
}

impl Div for Slope {
    type Output = Self;
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        self.over(b)
    }
}

impl Number for Slope {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self {
            here: x,
            along: [0.0; MOMENTS],
        }
    }
    #[inline(always)]
    fn madd(self, b: Self, c: Self) -> Self {
        self * b + c
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        if self.here >= other.here { self } else { other }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        if self.here < 0.0 { -self } else { self }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.here.sqrt();
        self.onto(root, if root > 0.0 { 0.5 / root } else { 0.0 })
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let value = self.here.exp();
        self.onto(value, value)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = Number::sin_cos(self.here);
        (self.onto(sin, cos), self.onto(cos, -sin))
    }
    #[inline(always)]
    fn if_positive(self, then: Self, other: Self) -> Self {
        if self.here > 0.0 { then } else { other }
    }
    fn signed_power(self, p: f64) -> Self {
        let rate = p * self.here.abs().powf(p - 1.0);
        self.onto(
            self.here.signed_power(p),
            if rate.is_finite() { rate } else { 0.0 },
        )
    }
}

/// One moment, with derivatives in eight directions of the state.
#[derive(Clone, Copy, Debug)]
pub struct Slopes;

impl Moments for Slopes {
    type Each = Slope;
    type Pair = Two<Slope>;
    #[inline(always)]
    fn always(pair: f64x2) -> Two<Slope> {
        Two(pair.to_array().map(Slope::splat))
    }
    #[inline(always)]
    fn both(each: Slope) -> Two<Slope> {
        Two([each; 2])
    }
    #[inline(always)]
    fn sum(pair: Two<Slope>) -> Slope {
        pair.0[0] + pair.0[1]
    }
    #[inline(always)]
    fn of(pair: Two<Slope>, lane: usize) -> Slope {
        pair.0[lane]
    }
    #[inline(always)]
    fn set(pair: &mut Two<Slope>, lane: usize, each: Slope) {
        pair.0[lane] = each;
    }
    /// Only moments are looked up, which no state moves.
    #[inline(always)]
    fn look_up<const I: usize, const K: usize>(
        at: [Slope; I],
        table: impl Fn([f64; I]) -> [f64; K],
    ) -> [Slope; K] {
        table(at.map(|at| at.here)).map(Slope::splat)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// f′ of `of` at `x`, and what the steps of Richardson's extrapolation make of central differences.
    fn both_ways(x: f64, of: impl Fn(Slope) -> Slope) -> [f64; 2] {
        let mut at = Slope::splat(x);
        at.along[3] = 1.0;
        let value = |x: f64| of(Slope::splat(x)).here;
        let central = |h: f64| (value(x + h) - value(x - h)) / (2.0 * h);
        let slope = of(at);
        for k in (0..MOMENTS).filter(|&k| k != 3) {
            assert_eq!(slope.along[k], 0.0);
        }
        let h = 1e-3;
        [slope.along[3], (4.0 * central(h / 2.0) - central(h)) / 3.0]
    }

    #[test]
    fn derivatives_are_those_of_small_differences() {
        let c = |x: f64| Slope::splat(x);
        for x in [-1.3, -0.2, 0.7, 2.1] {
            let of: [(&str, fn(Slope) -> Slope); 12] = [
                ("product", |x| (x * 2.5 + 1.0) * x),
                ("quotient", |x| (x + 4.0) / (x * x + 1.0)),
                ("madd", |x| x.madd(x, x * 3.0)),
                ("nmadd", |x| x.nmadd(x, x * 3.0)),
                ("root", |x| (x * x + 0.3).sqrt()),
                ("exp", |x| (x * -0.7).exp()),
                ("sin", |x| (x * 3.0).sin_cos().0),
                ("cos", |x| (x * 3.0).sin_cos().1),
                ("abs", |x| x.abs() * x),
                ("power", |x| x.signed_power(1.5)),
                ("larger", |x| x.larger(x * 2.0)),
                ("choice", |x| x.if_positive(x * x, -x)),
            ];
            for (name, of) in of {
                let [exact, differences] = both_ways(x, of);
                let off = (exact - differences).abs();
                assert!(
                    off < 1e-9 * (1.0 + exact.abs()),
                    "{name} at {x}: {exact} {differences}"
                );
            }
        }
        // Several directions at once, in several numbers: ∂(xy)/∂x = y, ∂(xy)/∂y = x.
        let (mut x, mut y) = (c(3.0), c(-5.0));
        (x.along[0], y.along[1]) = (1.0, 1.0);
        let product = x * y;
        assert_eq!(
            (product.here, &product.along[..3]),
            (-15.0, &[-5.0, 3.0, 0.0][..])
        );
    }

    #[test]
    fn a_kink_has_a_slope_that_is_finite() {
        let mut zero = Slope::splat(0.0);
        zero.along = [1.0; MOMENTS];
        for slope in [
            zero.sqrt(),
            (zero * zero).sqrt(),
            zero.abs(),
            zero.signed_power(1.0),
            zero.signed_power(0.5),
            zero.larger(-zero),
        ] {
            assert!(slope.here == 0.0 && slope.along.iter().all(|x| x.is_finite()));
        }
    }
}

//! Numbers that carry their derivatives along (forward differentiation).

use std::ops::{Add, Mul, Sub};

/// A number and its derivatives by `N` unknowns.
#[derive(Clone, Copy, Debug)]
pub struct Dual<const N: usize> {
    pub value: f64,
    pub slope: [f64; N],
}

impl<const N: usize> Dual<N> {
    pub const ZERO: Self = Dual {
        value: 0.0,
        slope: [0.0; N],
    };

    pub fn constant(value: f64) -> Self {
        Dual {
            value,
            ..Self::ZERO
        }
    }

    /// The unknown number `which`.
    pub fn unknown(value: f64, which: usize) -> Self {
        let mut out = Dual::constant(value);
        out.slope[which] = 1.0;
        out
    }

    /// A function of it, by the function's value and derivative there.
    #[inline(always)]
    pub fn through(self, value: f64, derivative: f64) -> Self {
        Dual {
            value,
            slope: self.slope.map(|s| s * derivative),
        }
    }

    /// It and `more`, whose slopes are those of these numbers, each times its factor.
    #[inline(always)]
    pub fn with<const M: usize>(&self, more: f64, by: [(f64, &Self); M]) -> Self {
        let slope = |k: usize| {
            by.iter()
                .fold(self.slope[k], |s, (c, x)| s + c * x.slope[k])
        };
        Dual {
            value: self.value + more,
            slope: std::array::from_fn(slope),
        }
    }

    #[inline(always)]
    pub fn exp(self) -> Self {
        let e = self.value.exp();
        self.through(e, e)
    }

    /// 1/(1 + e^x).
    pub fn logistic(self) -> Self {
        let p = 1.0 / (1.0 + self.value.exp());
        self.through(p, -p * (1.0 - p))
    }

    /// Mean of e^{−u} over u = 0 … x.
    pub fn mean_of_decay(self) -> Self {
        let mean = -(-self.value).exp_m1() / self.value;
        self.through(mean, ((-self.value).exp() - mean) / self.value)
    }

    #[inline(always)]
    pub fn inverse(self) -> Self {
        let i = 1.0 / self.value;
        self.through(i, -i * i)
    }
}

impl<const N: usize> Add for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        self.value += other.value;
        for k in 0..N {
            self.slope[k] += other.slope[k];
        }
        self
    }
}

impl<const N: usize> Sub for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self + other * -1.0
    }
}

impl<const N: usize> Mul for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(mut self, other: Self) -> Self {
        for k in 0..N {
            self.slope[k] = self.slope[k] * other.value + self.value * other.slope[k];
        }
        self.value *= other.value;
        self
    }
}

impl<const N: usize> Add<f64> for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn add(mut self, other: f64) -> Self {
        self.value += other;
        self
    }
}

impl<const N: usize> Mul<f64> for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        self.through(self.value * factor, factor)
    }
}

#[test]
fn derivatives_are_the_differences_limits() {
    let f = |x: f64, y: f64| {
        let (x, y) = (Dual::<2>::unknown(x, 0), Dual::<2>::unknown(y, 1));
        (x * y - x.exp() * 2.0 + y.logistic()) * (y + 3.0).inverse() + x.mean_of_decay()
    };
    let (h, at) = (1e-6, f(0.3, 0.7));
    for (k, (up, down)) in [
        (f(0.3 + h, 0.7), f(0.3 - h, 0.7)),
        (f(0.3, 0.7 + h), f(0.3, 0.7 - h)),
    ]
    .into_iter()
    .enumerate()
    {
        assert!((at.slope[k] - (up.value - down.value) / (2.0 * h)).abs() < 1e-9);
    }
}

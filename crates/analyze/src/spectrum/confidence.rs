//! The χ² distribution, as far as a spectrum's confidence band needs it.

/// P(X ≤ x) for a χ² variable with ν degrees of freedom: the regularised lower incomplete gamma function P(ν/2, x/2).
///
/// ν > 0, not necessarily whole; 0 for x ≤ 0. Series below a + 1, Lentz's continued fraction above.
/// Source: Abramowitz & Stegun 6.5.29, 6.5.31.
pub fn chi_square_cdf(x: f64, nu: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    let (a, x) = (nu / 2.0, x / 2.0);
    let front = (a * x.ln() - x - libm::lgamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-17 {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        (front * sum).min(1.0)
    } else {
        let tiny = 1e-300;
        let mut b = x + 1.0 - a;
        let mut c = 1.0 / tiny;
        let mut d = 1.0 / b;
        let mut h = d;
        for i in 1..10_000 {
            let an = -(i as f64) * (i as f64 - a);
            b += 2.0;
            d = 1.0 / nonzero(an * d + b, tiny);
            c = nonzero(b + an / c, tiny);
            h *= d * c;
            if (d * c - 1.0).abs() < 1e-16 {
                break;
            }
        }
        (1.0 - front * h).clamp(0.0, 1.0)
    }
}

fn nonzero(x: f64, tiny: f64) -> f64 {
    if x.abs() < tiny { tiny } else { x }
}

/// The x with P(X ≤ x) = `p` for a χ² variable with ν degrees of freedom; `p` in (0, 1).
///
/// Newton's steps, and a halving where one would leave what is known to hold the answer.
pub fn chi_square_quantile(p: f64, nu: f64) -> f64 {
    let (mut low, mut high) = (0.0, nu.max(1.0));
    while chi_square_cdf(high, nu) < p {
        high *= 2.0;
    }
    let a = nu / 2.0;
    let density = |x: f64| 0.5 * ((a - 1.0) * (x / 2.0).ln() - x / 2.0 - libm::lgamma(a)).exp();
    let mut x = 0.5 * (low + high);
    // 200 halvings: until nothing lies between the ends.
    for _ in 0..200 {
        let excess = chi_square_cdf(x, nu) - p;
        if excess < 0.0 {
            low = x
        } else {
            high = x
        }
        let newton = x - excess / density(x);
        let next = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
        let step = (next - x).abs();
        x = next;
        if step <= 1e-15 * x {
            break;
        }
    }
    x
}

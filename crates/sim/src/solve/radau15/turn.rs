//! Where friction turns round: a narrow bend in a force that the steps have to close in on.
//!
//! ```text
//! τ ∝ ω/√(ω² + ω_s²),   ω = α (t − p) nearby   ⇒   no longer smooth at t = p ± i a,   p = t₀ − ω₀/α,   a = ω_s/|α|
//! ```
//! ω turning rate (rad/s), α its rate (rad/s²), ω_s the law's regularising rate (rad/s). The Legendre coefficients of a function on a step fall
//! as R^-k where R is half the sum of the axes, in units of half the step, of the ellipse about the step's ends that goes through the place
//! nearest to it where the function is not smooth. So a step of size h that begins at 0 has
//!
//! ```text
//! K = (√(p² + a²) + √((p − h)² + a²))/h,   R = K + √(K² − 1)        h = 2 (K √(p² + a²) − p)/(K² − 1)
//! ```
//! Which R is needed is learnt: it depends on how much of the load the friction is, and on the tolerance. A step that is much too long is
//! told from one that fits before either is tried, and behind the bend steps grow as fast as they may. Valid while α is nearly constant
//! until the turn; where it is not, the error estimate decides as ever. Source: Trefethen, Approximation Theory and Approximation Practice
//! (2013), ch. 8 (the ellipse is Bernstein's).

/// What is needed at first.
const FIRST: f64 = 3.0;
/// Between these: below, a bend hardly matters; above, nothing is a bend.
const LEAST: f64 = 1.05;
const MOST: f64 = 10.0;
/// The error falls as this power of R: the estimate takes e₇ (e₇/e₅)², R^-7 (R^-2)², and 1/R comes from the size of such a step.
const POWER: f64 = 10.0;
/// Such an error is aimed at, in units of what a step may err.
const AIM: f64 = 0.3;
/// An error says no more below this.
const CLEAR: f64 = 1e-6;
/// How much of a smaller need is believed.
const RELAX: f64 = 0.2;
/// No bend, however sharp, asks for a shorter step than this, s: if its error does, that will be seen.
const SHORTEST_S: f64 = 1e-9;

/// A bend ahead of the start of a step, or behind it.
#[derive(Clone, Copy, Debug)]
pub struct Bend {
    /// p, a; s
    ahead_s: f64,
    wide_s: f64,
}

impl Bend {
    /// Of a friction regularised at `soft_rad_per_s`, where the rate and its rate are as given.
    pub fn new(soft_rad_per_s: f64, rate_rad_per_s: f64, rate_per_s: f64) -> Self {
        Self {
            ahead_s: -rate_rad_per_s / rate_per_s,
            wide_s: soft_rad_per_s / rate_per_s.abs(),
        }
    }

    /// R of a step.
    fn roundness(&self, step_s: f64) -> f64 {
        let to = |from: f64| distance(self.ahead_s - from, self.wide_s);
        let k = ((to(0.0) + to(step_s)) / step_s).max(1.0);
        k + (k * k - 1.0).sqrt()
    }

    /// The longest step of that R, s.
    fn step_s(&self, roundness: f64) -> f64 {
        let k = 0.5 * (roundness + 1.0 / roundness);
        let far = distance(self.ahead_s, self.wide_s);
        let step_s = 2.0 * (k * far - self.ahead_s) / (k * k - 1.0);
        // No bend where the rate stays what it is.
        if step_s.is_nan() {
            f64::INFINITY
        } else {
            step_s
        }
    }
}

/// √(x² + y²), where neither square is beyond what a number holds; where one is, infinite: no bend.
fn distance(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

/// What was learnt of a friction's bends.
pub struct Turn {
    roundness: f64,
}

impl Turn {
    /// Nothing yet.
    pub fn new() -> Self {
        Self { roundness: FIRST }
    }

    /// How long a step should be at most, s.
    pub fn reach_s(&self, bend: &Bend) -> f64 {
        bend.step_s(self.roundness).max(SHORTEST_S)
    }

    /// A step that a bend limited had this error, in units of what it may err.
    pub fn learn(&mut self, bend: &Bend, step_s: f64, error: f64) {
        if error.is_nan() {
            return;
        }
        let needed = bend.roundness(step_s) * (error.max(CLEAR) / AIM).powf(1.0 / POWER);
        let needed = needed.clamp(LEAST, MOST);
        self.roundness += if needed > self.roundness {
            needed - self.roundness
        } else {
            RELAX * (needed - self.roundness)
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_of_a_roundness_has_it() {
        for (rate, rate_per_s) in [(1.0, -20.0), (-1.0, -20.0), (0.0, 30.0), (2.0, -0.1)] {
            let bend = Bend::new(0.02, rate, rate_per_s);
            for roundness in [1.1, 2.0, 3.0, 9.0] {
                let step_s = bend.step_s(roundness);
                assert!((bend.roundness(step_s) / roundness - 1.0).abs() < 1e-9);
            }
        }
        // A body that does not turn has no bend.
        assert_eq!(Bend::new(0.02, 0.0, 0.0).step_s(3.0), f64::INFINITY);
        assert_eq!(Bend::new(0.02, 1.0, 0.0).step_s(3.0), f64::INFINITY);
    }

    /// The Legendre coefficient of an order, by Simpson's rule.
    fn coefficient(order: u32, of: impl Fn(f64) -> f64) -> f64 {
        let n = 20_000;
        let mut sum = 0.0;
        for i in 0..=n {
            let x = 2.0 * f64::from(i) / f64::from(n) - 1.0;
            let (mut before, mut p) = (1.0, x);
            for k in 1..order {
                let k = f64::from(k);
                (before, p) = (p, ((2.0 * k + 1.0) * x * p - k * before) / (k + 1.0));
            }
            let weight = match i {
                0 => 1.0,
                _ if i == n => 1.0,
                _ if i % 2 == 1 => 4.0,
                _ => 2.0,
            };
            sum += weight * of(x) * p;
        }
        sum * (2.0 * f64::from(order) + 1.0) / (3.0 * f64::from(n))
    }

    #[test]
    fn coefficients_fall_as_the_ellipse_says() {
        for rate in [0.1, 0.01, -0.02] {
            let bend = Bend::new(0.02, rate, -10.0);
            for roundness in [1.5, 2.0, 3.0] {
                let step_s = bend.step_s(roundness);
                let law = |x: f64| {
                    let rate = rate - 10.0 * step_s * 0.5 * (x + 1.0);
                    rate / rate.hypot(0.02)
                };
                // They come with any sign and phase: the largest of a few.
                let around = |order: u32| {
                    let of = |k: u32| coefficient(k, law).abs() * f64::powi(roundness, k as i32);
                    (order..order + 8).map(of).fold(0.0, f64::max)
                };
                let fall = roundness * (around(4) / around(12)).powf(1.0 / 8.0);
                assert!(
                    (fall / roundness - 1.0).abs() < 0.05,
                    "{rate} {roundness}: {fall}"
                );
            }
        }
    }

    #[test]
    fn what_is_needed_is_learnt() {
        let mut turn = Turn::new();
        let bend = Bend::new(0.02, 0.1, -10.0);
        let step_s = turn.reach_s(&bend);
        turn.learn(&bend, step_s, 300.0);
        let shorter = turn.reach_s(&bend);
        assert!(shorter < 0.8 * step_s);
        turn.learn(&bend, shorter, AIM);
        assert!((turn.reach_s(&bend) / shorter - 1.0).abs() < 1e-9);
        for _ in 0..100 {
            turn.learn(&bend, turn.reach_s(&bend), 0.0);
        }
        let longer = turn.reach_s(&bend);
        assert!(longer > 1.5 * step_s);
        turn.learn(&bend, longer, f64::NAN);
        assert_eq!(turn.reach_s(&bend), longer);
    }

    #[test]
    fn a_bend_as_sharp_as_an_edge_still_leaves_a_step() {
        let edge = Bend::new(1e-300, 0.0, -10.0);
        assert_eq!(Turn::new().reach_s(&edge), SHORTEST_S);
    }
}

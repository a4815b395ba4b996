//! Numbers drawn for surrogates and intervals: the same for the same seed, on every machine.

use std::f64::consts::TAU;

/// SplitMix64. Source: Steele, Lea & Flood, "Fast splittable pseudorandom number generators", OOPSLA (2014).
pub(crate) struct Random(pub u64);

impl Random {
    /// 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Evenly in 0 … 1, 1 left out.
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Standard normal (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let (u, v) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
    }

    /// An Ornstein–Uhlenbeck path of `n` steps with standard deviation `sd` and correlation time `time_s` (s).
    pub fn wander(&mut self, n: usize, step_s: f64, sd: f64, time_s: f64) -> Vec<f64> {
        let keep = (-step_s / time_s).exp();
        let kick = sd * (1.0 - keep * keep).sqrt();
        let mut x = sd * self.normal();
        (0..n)
            .map(|_| {
                let now = x;
                x = keep * x + kick * self.normal();
                now
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_those_of_the_published_generator() {
        // First two of the reference code (Vigna, prng.di.unimi.it/splitmix64.c) seeded with 1234567.
        let mut random = Random(1_234_567);
        assert_eq!(random.bits(), 6_457_827_717_110_365_317);
        assert_eq!(random.bits(), 3_203_168_211_198_807_973);
    }

    #[test]
    fn normal_numbers_have_mean_0_and_variance_1() {
        let mut random = Random(1);
        let x: Vec<f64> = (0..100_000).map(|_| random.normal()).collect();
        let mean = x.iter().sum::<f64>() / 1e5;
        let square = x.iter().map(|x| x * x).sum::<f64>() / 1e5;
        assert!(
            mean.abs() < 0.01 && (square - 1.0).abs() < 0.02,
            "{mean} {square}"
        );
    }
}

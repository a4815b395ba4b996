//! Dice for random scenes.

/// SplitMix64: Steele, Lea, Flood (2014).
pub struct Dice(pub u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
    /// Evenly from `low` to `high`.
    pub fn from(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
    /// 0 to n − 1.
    pub fn below(&mut self, n: u64) -> u64 {
        self.next() % n
    }
    /// Whether something of probability `p` happens.
    pub fn chance(&mut self, p: f64) -> bool {
        self.from(0.0, 1.0) < p
    }
}

//! Where the party faces.

/// A turn.
///
/// ```text
/// χ(t) = Δχ S((t − t₀)/T),   S(u) = u³(10 − 15u + 6u²) on 0 … 1, held beyond
/// ```
/// Source: the quintic of least jerk, Flash & Hogan, J. Neurosci. 5 (1985).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heading {
    /// Δχ, rad.
    pub turn_rad: f64,
    /// t₀, s.
    pub start_s: f64,
    /// T, s.
    pub time_s: f64,
}

impl Heading {
    /// χ (rad), χ̇ (rad/s)
    pub fn at(&self, t_s: f64) -> [f64; 2] {
        let u = ((t_s - self.start_s) / self.time_s).clamp(0.0, 1.0);
        let heading = u * u * u * (10.0 + u * (6.0 * u - 15.0));
        let rate = 30.0 * u * u * (1.0 - u) * (1.0 - u) / self.time_s;
        [self.turn_rad * heading, self.turn_rad * rate]
    }
}

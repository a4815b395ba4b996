//! What Adler's test looks for, and where each stands in the vector of unknowns.

/// Unknowns of one carrier, of which the first [`SHARED`] are those of all: ln K, ln τ, ln σ², ln ε², ln(1/a − 1) (where the
/// beginning was heard: how long before the first beat the pull began, from the middle of what may be, in SDs of an even spread), K_c, ω, Δ.
pub const PULL: usize = 0;
pub const BUILD_UP: usize = 1;
pub const NOISE: usize = 2;
pub const ERROR: usize = 3;
pub const BEGUN: usize = 4;
pub const COUPLING: usize = 5;
pub const OWN: usize = 6;
pub const OFFSET: usize = 7;
/// How many.
pub const N: usize = 8;
pub const SHARED: usize = 6;

/// Where unknown `k` of carrier `c` stands among all.
pub fn place(k: usize, c: usize) -> usize {
    if k < SHARED { k } else { k + 2 * c }
}

/// Pulls looked for, rad/s. A stronger one settles a carrier within a third of a step, faster than a step tells.
pub const LEAST: f64 = 0.01;
pub const MOST: f64 = 6.0;

//! Counter-based random numbers: a draw is a function of (seed, stream, item, index), whatever was drawn before.
//!
//! Philox4x32-10: Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC'11. A noise path is
//! therefore the same for every step size and every number of threads.

/// What a random number is for; each use has numbers of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Stream {
    /// Spread of the carriers' natural frequencies.
    Frequency = 1,
    /// Spread of the carriers' first phases.
    InitialPhase = 2,
    /// Phase noise on its grid.
    PhaseNoise = 3,
    /// Sensor noise.
    Sensor = 4,
    /// Points of a study's design.
    Design = 5,
}

/// One block of Philox4x32 with ten rounds.
fn philox4x32(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    for round in 0..10 {
        if round > 0 {
            key[0] = key[0].wrapping_add(0x9E37_79B9);
            key[1] = key[1].wrapping_add(0xBB67_AE85);
        }
        let a = u64::from(counter[0]) * 0xD251_1F53;
        let b = u64::from(counter[2]) * 0xCD9E_8D57;
        counter = [
            (b >> 32) as u32 ^ counter[1] ^ key[0],
            b as u32,
            (a >> 32) as u32 ^ counter[3] ^ key[1],
            a as u32,
        ];
    }
    counter
}

/// Two independent uniform numbers in (0, 1], multiples of 2⁻⁵³.
pub fn uniform_pair(seed: u64, stream: Stream, item: u32, index: u64) -> [f64; 2] {
    // The stream goes into the key's upper bits by xor: seeds below 2⁵⁶ never meet another stream's numbers.
    let key = seed ^ (u64::from(stream as u32) << 56);
    let out = philox4x32(
        [index as u32, (index >> 32) as u32, item, 0],
        [key as u32, (key >> 32) as u32],
    );
    let unit = |low: u32, high: u32| {
        let bits = (u64::from(high) << 32 | u64::from(low)) >> 11;
        (bits + 1) as f64 * (1.0 / 9_007_199_254_740_992.0)
    };
    [unit(out[0], out[1]), unit(out[2], out[3])]
}

/// Two independent standard normal numbers (Box–Muller).
pub fn normal_pair(seed: u64, stream: Stream, item: u32, index: u64) -> [f64; 2] {
    let [u, v] = uniform_pair(seed, stream, item, index);
    let radius = (-2.0 * u.ln()).sqrt();
    let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
    [radius * cos, radius * sin]
}

/// The standard normal number of one item; items 2j and 2j + 1 share a pair.
pub fn normal(seed: u64, stream: Stream, item: usize, index: u64) -> f64 {
    normal_pair(seed, stream, (item / 2) as u32, index)[item % 2]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known-answer vectors of Random123 1.14, file kat_vectors, lines `philox4x32 10`.
    #[test]
    fn val_random123_vectors() {
        assert_eq!(
            philox4x32([0; 4], [0; 2]),
            [0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8]
        );
        assert_eq!(
            philox4x32([u32::MAX; 4], [u32::MAX; 2]),
            [0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd]
        );
        assert_eq!(
            philox4x32(
                [0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344],
                [0xa4093822, 0x299f31d0]
            ),
            [0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1]
        );
    }

    #[test]
    fn normal_numbers_have_the_normal_moments() {
        let n = 200_000;
        let draws: Vec<f64> = (0..n)
            .map(|i| normal(7, Stream::PhaseNoise, i % 4, (i / 4) as u64))
            .collect();
        let mean = draws.iter().sum::<f64>() / n as f64;
        let var = draws.iter().map(|x| x * x).sum::<f64>() / n as f64;
        let fourth = draws.iter().map(|x| x.powi(4)).sum::<f64>() / n as f64;
        // Four standard errors of each moment: 1/√n, √2/√n, √96/√n.
        let e = 4.0 / (n as f64).sqrt();
        assert!(
            mean.abs() < e && (var - 1.0).abs() < 1.42 * e && (fourth - 3.0).abs() < 9.8 * e,
            "{mean} {var} {fourth}"
        );
    }
}

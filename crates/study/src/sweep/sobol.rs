//! Sobol's sequence: points that fill a cube evenly, however many are taken.
//!
//! ```text
//! x_d(n) = 2⁻³² ⊕_{k: bit k of n ⊕ ⌊n/2⌋ is set} v_{d,k}
//! v_{d,k} = v_{d,k−s} ⊕ ⌊v_{d,k−s}/2^s⌋ ⊕ (the v_{d,k−j} whose coefficient j of the polynomial of degree s is set)
//! ```
//! n number of the point, from 0; ⊕ exclusive or. In Gray code's order, as SciPy's `qmc.Sobol(scramble=False)` gives
//! them; the first point is the origin. Any power of two of points has one in each of as many equal slices of every axis.
//! Source: Sobol (1967); directions of Joe & Kuo, SIAM J. Sci. Comput. 30 (2008), file new-joe-kuo-6.21201.

/// The most dimensions there are directions for.
pub const MOST_DIMENSIONS: usize = 1 + DIRECTIONS.len();

const BITS: usize = 32;

/// The sequence in some number of dimensions.
#[derive(Clone, Debug)]
pub struct Sobol(Vec<[u32; BITS]>);

impl Sobol {
    /// In `dimensions` dimensions.
    ///
    /// # Panics
    /// Above [`MOST_DIMENSIONS`].
    pub fn new(dimensions: usize) -> Self {
        assert!(dimensions <= MOST_DIMENSIONS);
        let first = std::array::from_fn(|k| 1 << (BITS - 1 - k));
        let others = DIRECTIONS.iter().map(|(polynomial, start)| {
            let degree = start.len();
            let mut m = [0u64; BITS];
            m[..degree].copy_from_slice(start);
            for k in degree..BITS {
                m[k] = m[k - degree];
                for j in 1..=degree {
                    if polynomial >> (degree - j) & 1 == 1 {
                        m[k] ^= m[k - j] << j;
                    }
                }
            }
            // OK because m_k is odd and below 2^(k+1).
            std::array::from_fn(|k| (m[k] << (BITS - 1 - k)) as u32)
        });
        Self(
            std::iter::once(first)
                .chain(others)
                .take(dimensions)
                .collect(),
        )
    }

    /// Coordinate `dimension` of point `n`, in [0, 1).
    pub fn at(&self, n: u32, dimension: usize) -> f64 {
        let gray = n ^ (n >> 1);
        let bits = (0..BITS)
            .filter(|k| gray >> k & 1 == 1)
            .fold(0, |x, k| x ^ self.0[dimension][k]);
        f64::from(bits) / 4_294_967_296.0
    }
}

/// Primitive polynomial (bits, highest power first) and first direction numbers of dimensions 2, 3, …
#[rustfmt::skip]
const DIRECTIONS: &[(u64, &[u64])] = &[
    (3, &[1]),
    (7, &[1, 3]),
    (11, &[1, 3, 1]),
    (13, &[1, 1, 1]),
    (19, &[1, 1, 3, 3]),
    (25, &[1, 3, 5, 13]),
    (37, &[1, 1, 5, 5, 17]),
    (41, &[1, 1, 5, 5, 5]),
    (47, &[1, 1, 7, 11, 19]),
    (55, &[1, 1, 5, 1, 1]),
    (59, &[1, 1, 1, 3, 11]),
    (61, &[1, 3, 5, 5, 31]),
    (67, &[1, 3, 3, 9, 7, 49]),
    (91, &[1, 1, 1, 15, 21, 21]),
    (97, &[1, 3, 1, 13, 27, 49]),
    (103, &[1, 1, 1, 15, 7, 5]),
    (109, &[1, 3, 1, 15, 13, 25]),
    (115, &[1, 1, 5, 5, 19, 61]),
    (131, &[1, 3, 7, 11, 23, 15, 103]),
    (137, &[1, 3, 7, 13, 13, 15, 69]),
    (143, &[1, 1, 3, 13, 7, 35, 63]),
    (145, &[1, 3, 5, 9, 1, 25, 53]),
    (157, &[1, 3, 1, 13, 9, 35, 107]),
    (167, &[1, 3, 1, 5, 27, 61, 31]),
    (171, &[1, 1, 5, 11, 19, 41, 61]),
    (185, &[1, 3, 5, 3, 3, 13, 69]),
    (191, &[1, 1, 7, 13, 1, 19, 1]),
    (193, &[1, 3, 7, 5, 13, 19, 59]),
    (203, &[1, 1, 3, 9, 25, 29, 41]),
    (211, &[1, 3, 5, 13, 23, 1, 55]),
    (213, &[1, 3, 7, 3, 13, 59, 17]),
    (229, &[1, 3, 1, 3, 5, 53, 69]),
    (239, &[1, 1, 5, 5, 23, 33, 13]),
    (241, &[1, 1, 7, 7, 1, 61, 123]),
    (247, &[1, 1, 7, 9, 13, 61, 49]),
    (253, &[1, 3, 3, 5, 3, 55, 33]),
    (285, &[1, 3, 1, 15, 31, 13, 49, 245]),
    (299, &[1, 3, 5, 15, 31, 59, 63, 97]),
    (301, &[1, 3, 1, 11, 11, 11, 77, 249]),
    (333, &[1, 3, 1, 11, 27, 43, 71, 9]),
    (351, &[1, 1, 7, 15, 21, 11, 81, 45]),
    (355, &[1, 3, 7, 3, 25, 31, 65, 79]),
    (357, &[1, 3, 1, 1, 19, 11, 3, 205]),
    (361, &[1, 1, 5, 9, 19, 21, 29, 157]),
    (369, &[1, 3, 7, 11, 1, 33, 89, 185]),
    (391, &[1, 3, 3, 3, 15, 9, 79, 71]),
    (397, &[1, 3, 7, 11, 15, 39, 119, 27]),
    (425, &[1, 1, 3, 1, 11, 31, 97, 225]),
    (451, &[1, 1, 1, 3, 23, 43, 57, 177]),
    (463, &[1, 3, 7, 7, 17, 17, 37, 71]),
    (487, &[1, 3, 1, 5, 27, 63, 123, 213]),
    (501, &[1, 1, 3, 5, 11, 43, 53, 133]),
    (529, &[1, 3, 5, 5, 29, 17, 47, 173, 479]),
    (539, &[1, 3, 3, 11, 3, 1, 109, 9, 69]),
    (545, &[1, 1, 1, 5, 17, 39, 23, 5, 343]),
    (557, &[1, 3, 1, 5, 25, 15, 31, 103, 499]),
    (563, &[1, 1, 1, 11, 11, 17, 63, 105, 183]),
    (601, &[1, 1, 5, 11, 9, 29, 97, 231, 363]),
    (607, &[1, 1, 5, 15, 19, 45, 41, 7, 383]),
    (617, &[1, 3, 7, 7, 31, 19, 83, 137, 221]),
    (623, &[1, 1, 1, 3, 23, 15, 111, 223, 83]),
    (631, &[1, 1, 5, 13, 31, 15, 55, 25, 161]),
    (637, &[1, 1, 3, 13, 25, 47, 39, 87, 257]),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// SciPy's own points: tests/data/sobol.py made the file.
    #[test]
    fn val_scipy_sobol_points() {
        let text = include_str!("../../tests/data/sobol.csv");
        let sobol = Sobol::new(MOST_DIMENSIONS);
        let mut rows = 0;
        for line in text.lines().filter(|l| !l.starts_with('#')) {
            let mut cells = line.split(',');
            let n: u32 = cells.next().unwrap().parse().unwrap();
            for (dimension, cell) in cells.enumerate() {
                let theirs: f64 = cell.parse().unwrap();
                assert_eq!(
                    sobol.at(n, dimension),
                    theirs,
                    "point {n}, dimension {dimension}"
                );
            }
            rows += 1;
        }
        assert!(rows > 60);
    }

    #[test]
    fn every_slice_of_every_axis_has_one_point() {
        let sobol = Sobol::new(MOST_DIMENSIONS);
        for dimension in 0..MOST_DIMENSIONS {
            let mut seen = [false; 256];
            for n in 0..256 {
                seen[(sobol.at(n, dimension) * 256.0) as usize] = true;
            }
            assert!(seen.iter().all(|s| *s), "dimension {dimension}");
        }
    }
}

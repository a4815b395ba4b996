//! A cubic spline through samples: value and slope between them, with continuous second derivative.
//!
//! ```text
//! x(t) = x_k + b s + c s² + d s³,  s = t − t_k        h_{k−1} m_{k−1} + 2(h_{k−1} + h_k) m_k + h_k m_{k+1} = 6(Δ_k − Δ_{k−1})
//! ```
//! m second derivatives, h steps of time (s), Δ slopes of the chords. At both ends m is that of the cubic through the four
//! nearest samples. Error of the slope of a sine of ω, in parts of it: (ωh)⁴/180 at a sample, √3 (ωh)³/216 between two (that of the
//! cubic through values and slopes), 1 % at an end for ωh = 0.4. Source: de Boor, A Practical Guide to Splines (1978), ch. IV.

/// A spline; times ascend strictly.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    t_s: Vec<f64>,
    /// x, b, c, d of each piece.
    pieces: Vec<[f64; 4]>,
}

impl Spline {
    /// Fewest samples.
    pub const LEAST: usize = 4;

    /// A spline through `x` at `t_s`; `None` for fewer than four samples, unequal lengths, times that do not ascend or numbers that are none.
    pub fn new(t_s: &[f64], x: &[f64]) -> Option<Self> {
        let n = t_s.len();
        let finite = t_s.iter().chain(x).all(|v| v.is_finite());
        if n < Self::LEAST || x.len() != n || !finite || t_s.windows(2).any(|w| w[1] <= w[0]) {
            return None;
        }
        let h: Vec<f64> = t_s.windows(2).map(|w| w[1] - w[0]).collect();
        let chord: Vec<f64> = (0..n - 1).map(|k| (x[k + 1] - x[k]) / h[k]).collect();
        let mut m = vec![0.0; n];
        let end = |at: [usize; 4]| {
            let [a, b, c, d] = at.map(|k| (t_s[k], x[k]));
            let slope = |p: (f64, f64), q: (f64, f64)| (q.1 - p.1) / (q.0 - p.0);
            let (ab, bc, cd) = (slope(a, b), slope(b, c), slope(c, d));
            let (abc, bcd) = ((bc - ab) / (c.0 - a.0), (cd - bc) / (d.0 - b.0));
            let abcd = (bcd - abc) / (d.0 - a.0);
            2.0 * abc + 2.0 * abcd * ((a.0 - b.0) + (a.0 - c.0))
        };
        m[0] = end([0, 1, 2, 3]);
        m[n - 1] = end([n - 1, n - 2, n - 3, n - 4]);
        // Thomas: the matrix is diagonally dominant, so no pivots are needed.
        let (mut ratio, mut right) = (vec![0.0; n], vec![0.0; n]);
        right[0] = m[0];
        for k in 1..n - 1 {
            let pivot = 2.0 * (h[k - 1] + h[k]) - h[k - 1] * ratio[k - 1];
            ratio[k] = h[k] / pivot;
            right[k] = (6.0 * (chord[k] - chord[k - 1]) - h[k - 1] * right[k - 1]) / pivot;
        }
        for k in (1..n - 1).rev() {
            m[k] = right[k] - ratio[k] * m[k + 1];
        }
        let pieces = (0..n - 1)
            .map(|k| {
                let b = chord[k] - h[k] * (2.0 * m[k] + m[k + 1]) / 6.0;
                [x[k], b, 0.5 * m[k], (m[k + 1] - m[k]) / (6.0 * h[k])]
            })
            .collect();
        Some(Self {
            t_s: t_s.to_vec(),
            pieces,
        })
    }

    /// First and last moment, s.
    pub fn span_s(&self) -> [f64; 2] {
        [self.t_s[0], self.t_s[self.t_s.len() - 1]]
    }

    /// The piece in force at `t_s`; at a sample the later one.
    pub fn piece(&self, t_s: f64) -> usize {
        let after = self.t_s.partition_point(|t| *t <= t_s);
        after.saturating_sub(1).min(self.pieces.len() - 1)
    }

    /// Value and slope of a piece at `t_s`, also where it lies beyond the piece's ends.
    #[inline]
    pub fn of_piece(&self, piece: usize, t_s: f64) -> [f64; 2] {
        let (s, [x, b, c, d]) = (t_s - self.t_s[piece], self.pieces[piece]);
        [
            x + s * (b + s * (c + s * d)),
            b + s * (2.0 * c + s * 3.0 * d),
        ]
    }

    /// Value and slope at `t_s`.
    pub fn at(&self, t_s: f64) -> [f64; 2] {
        self.of_piece(self.piece(t_s), t_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubics_are_exact_and_a_sine_is_as_good_as_said() {
        let t = [0.0, 0.1, 0.25, 0.3, 0.7, 0.8, 1.0];
        let cubic = |t: f64| 1.0 + t * (2.0 + t * (-3.0 + 4.0 * t));
        let s = Spline::new(&t, &t.map(cubic)).unwrap();
        for k in 0..=100 {
            let at = f64::from(k) / 100.0;
            let [x, slope] = s.at(at);
            assert!((x - cubic(at)).abs() < 1e-13, "{at}");
            assert!(
                (slope - (2.0 + at * (-6.0 + 12.0 * at))).abs() < 1e-12,
                "{at}"
            );
        }
        // At a sample the later piece; beyond the ends the nearest.
        for (at, piece) in [
            (-1.0, 0),
            (0.0, 0),
            (0.1, 1),
            (0.25, 2),
            (0.29, 2),
            (1.0, 5),
            (2.0, 5),
        ] {
            assert_eq!(s.piece(at), piece, "{at}");
        }
        let (h, w) = (1.0 / 30.0, 4.0 * std::f64::consts::PI);
        let t: Vec<f64> = (0..300).map(|k| f64::from(k) * h).collect();
        let s = Spline::new(&t, &t.iter().map(|t| (w * t).sin()).collect::<Vec<_>>()).unwrap();
        let miss = |at: f64| (s.at(at)[1] - w * (w * at).cos()).abs() / w;
        let worst = |from: u32, step: usize| {
            let looks = (from..5400).step_by(step);
            looks
                .map(|k| miss(f64::from(k) / 600.0))
                .fold(0.0, f64::max)
        };
        let (at_samples, between) = (worst(600, 20), worst(600, 1));
        let (said, said_between) = (
            (w * h).powi(4) / 180.0,
            3f64.sqrt() * (w * h).powi(3) / 216.0,
        );
        assert!((at_samples / said - 1.0).abs() < 0.1, "{at_samples}");
        assert!((between / said_between - 1.0).abs() < 0.1, "{between}");
        assert!(miss(0.0) < 0.01, "{}", miss(0.0));
    }

    #[test]
    fn what_is_no_course_makes_no_spline() {
        let x = [0.0; 4];
        assert!(Spline::new(&[0.0, 1.0, 2.0], &x[..3]).is_none());
        assert!(Spline::new(&[0.0, 1.0, 1.0, 2.0], &x).is_none());
        assert!(Spline::new(&[0.0, 1.0, 2.0, 3.0], &[0.0, f64::NAN, 0.0, 0.0]).is_none());
        assert!(Spline::new(&[0.0, 1.0, 2.0, 3.0], &x[..3]).is_none());
    }
}

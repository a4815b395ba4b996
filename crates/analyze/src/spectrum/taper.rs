//! Window functions (tapers), as `scipy.signal.get_window` gives them with `fftbins=True` (periodic).

use std::cell::RefCell;
use std::f64::consts::PI;
use std::sync::Arc;

/// A taper that a segment is multiplied by before its transform.
///
/// ```text
/// cosine sums:  w[k] = Σ_j (−1)^j a_j cos(2πjk/N),  k = 0 … N−1   (periodic)
/// Tukey:        a flat top with cosine flanks that together take the share α of the segment
/// ```
/// Dimensionless. N = 1 gives (1). Source: Harris, Proc. IEEE 66 (1978) 51.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Taper {
    /// Ones.
    Boxcar,
    /// a = (0.5, 0.5): SciPy's default for `welch`.
    Hann,
    /// a = (0.54, 0.46).
    Hamming,
    /// a = (0.42, 0.50, 0.08).
    Blackman,
    /// Flanks take this share of the segment, 0 … 1 (SciPy's `spectrogram` uses 0.25).
    Tukey(f64),
}

impl Taper {
    /// The `n` values of the taper.
    pub fn values(self, n: usize) -> Vec<f64> {
        if n <= 1 {
            return vec![1.0; n];
        }
        match self {
            Taper::Boxcar => vec![1.0; n],
            Taper::Hann => cosine_sum(&[0.5, 0.5], n),
            Taper::Hamming => cosine_sum(&[0.54, 0.46], n),
            Taper::Blackman => cosine_sum(&[0.42, 0.50, 0.08], n),
            Taper::Tukey(alpha) => tukey(alpha, n),
        }
    }
}

/// The values of a taper and what is needed of them again and again.
pub(crate) struct Weights {
    pub values: Vec<f64>,
    /// Σ w.
    pub sum: f64,
    /// Σ w².
    pub squares: f64,
}

/// So many of a thread's tapers are kept: signals of one topic share one, topics have few rates.
const KEPT: usize = 8;

thread_local! {
    static KNOWN: RefCell<Vec<(Taper, Arc<Weights>)>> = const { RefCell::new(Vec::new()) };
}

impl Weights {
    /// `n` values of a taper, shared by all that ask for the same.
    pub fn of(taper: Taper, n: usize) -> Arc<Self> {
        KNOWN.with_borrow_mut(|known| {
            let same = |(t, w): &(Taper, Arc<Weights>)| *t == taper && w.values.len() == n;
            if let Some(at) = known.iter().position(same) {
                return known[at].1.clone();
            }
            let values = taper.values(n);
            let weights = Arc::new(Weights {
                sum: values.iter().sum(),
                squares: values.iter().map(|w| w * w).sum(),
                values,
            });
            if known.len() >= KEPT {
                known.remove(0);
            }
            known.push((taper, weights.clone()));
            weights
        })
    }
}

fn cosine_sum(a: &[f64], n: usize) -> Vec<f64> {
    // SciPy sums a_j cos(jx) with x from −π to π: the signs (−1)^j are then in the cosine.
    let step = 2.0 * PI / n as f64;
    (0..n)
        .map(|k| {
            let x = -PI + step * k as f64;
            a.iter()
                .enumerate()
                .map(|(j, a)| a * (j as f64 * x).cos())
                .sum()
        })
        .collect()
}

fn tukey(alpha: f64, n: usize) -> Vec<f64> {
    if alpha <= 0.0 {
        return vec![1.0; n];
    }
    if alpha >= 1.0 {
        return cosine_sum(&[0.5, 0.5], n);
    }
    // Periodic: the symmetric window of n + 1 points without its last. There M − 1 = n.
    let m = n as f64;
    let flank = (alpha * m / 2.0).floor();
    (0..n)
        .map(|k| {
            let k = k as f64;
            if k <= flank {
                0.5 * (1.0 + (PI * (-1.0 + 2.0 * k / (alpha * m))).cos())
            } else if k < m - flank {
                1.0
            } else {
                0.5 * (1.0 + (PI * (-2.0 / alpha + 1.0 + 2.0 * k / (alpha * m))).cos())
            }
        })
        .collect()
}

//! Butterworth filters in second-order sections and zero-phase filtering, with SciPy's numbers.

use realfft::num_complex::Complex64;
use std::f64::consts::PI;

/// One second-order section: b₀ b₁ b₂ a₁ a₂ (a₀ = 1).
///
/// ```text
/// H(z) = (b₀ + b₁ z⁻¹ + b₂ z⁻²) / (1 + a₁ z⁻¹ + a₂ z⁻²)
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// b₀, b₁, b₂.
    pub b: [f64; 3],
    /// a₁, a₂.
    pub a: [f64; 2],
}

/// What a filter lets through; corner frequencies in Hz, at −3 dB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Band {
    /// Below.
    Low(f64),
    /// Above.
    High(f64),
    /// Between.
    Pass(f64, f64),
    /// Not between.
    Stop(f64, f64),
}

/// Why a filter could not be made or applied.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FilterError {
    /// Corners out of order or outside (0, f_s/2).
    #[error(
        "filter corners {0:?} do not fit a sampling rate of {1} Hz: they have to ascend between 0 and half the rate"
    )]
    Corners(Band, f64),
    /// Order 0 or above 20, where sections lose their accuracy.
    #[error("filter order is {0}; it has to be between 1 and 20")]
    Order(usize),
    /// The signal is not longer than the padding.
    #[error(
        "the signal has {found} samples; zero-phase filtering with this filter needs more than {needed}"
    )]
    TooShort {
        /// Samples there.
        found: usize,
        /// Samples of padding.
        needed: usize,
    },
}

/// `scipy.signal.butter(order, Wn, btype, output="sos", fs=fs_hz)`.
///
/// ```text
/// |H(f)|² = 1 / (1 + (tan(πf/f_s) / tan(πf_c/f_s))^{2n})        (low-pass; the bilinear transform with pre-warping)
/// ```
/// Order n 1 … 20; a band-pass or band-stop of order n has 2n poles, as in SciPy. Sections may be paired otherwise
/// than SciPy pairs them: the filter is the same. Source: Butterworth (1930); SciPy 1.17 `iirfilter`.
///
/// # Errors
/// [`FilterError`] for corners or orders out of range.
pub fn butter(order: usize, band: Band, fs_hz: f64) -> Result<Vec<Section>, FilterError> {
    if !(1..=20).contains(&order) {
        return Err(FilterError::Order(order));
    }
    let (low, high) = match band {
        Band::Low(f) | Band::High(f) => (f, f),
        Band::Pass(low, high) | Band::Stop(low, high) => (low, high),
    };
    let ordered = matches!(band, Band::Low(_) | Band::High(_)) || low < high;
    if !(low > 0.0 && high < fs_hz / 2.0 && ordered) {
        return Err(FilterError::Corners(band, fs_hz));
    }
    // Poles of the analog prototype, on the unit circle's left half.
    let n = order as i64;
    let prototype =
        (1..=n).map(|k| -Complex64::from_polar(1.0, PI * (2 * k - n - 1) as f64 / (2 * n) as f64));
    let warp = |f: f64| 4.0 * (PI * f / fs_hz).tan();
    let (w_low, w_high) = (warp(low), warp(high));
    let (width, centre) = (w_high - w_low, (w_low * w_high).sqrt());
    let one = Complex64::new(1.0, 0.0);
    // The two poles of s² − 2qs + centre² = 0.
    let split = |q: Complex64| {
        let root = (q * q - centre * centre).sqrt();
        [q + root, q - root]
    };
    let poles: Vec<Complex64> = match band {
        Band::Low(_) => prototype.map(|p| p * w_low).collect(),
        Band::High(_) => prototype.map(|p| w_low / p).collect(),
        Band::Pass(..) => prototype.flat_map(|p| split(p * (width / 2.0))).collect(),
        Band::Stop(..) => prototype
            .flat_map(|p| split(one / p * (width / 2.0)))
            .collect(),
    };
    // Bilinear transform at the rate 2: z = (4 + s) / (4 − s).
    let bilinear = |s: Complex64| (4.0 + s) / (4.0 - s);
    let denominators = pair(&poles.into_iter().map(bilinear).collect::<Vec<_>>());
    let zero = bilinear(Complex64::new(0.0, centre));
    let numerator = |first_order: bool| match (band, first_order) {
        (Band::Low(_), false) => [1.0, 2.0, 1.0],
        (Band::Low(_), true) => [1.0, 1.0, 0.0],
        (Band::High(_), false) => [1.0, -2.0, 1.0],
        (Band::High(_), true) => [1.0, -1.0, 0.0],
        (Band::Pass(..), _) => [1.0, 0.0, -1.0],
        (Band::Stop(..), _) => [1.0, -2.0 * zero.re, zero.norm_sqr()],
    };
    let mut sections: Vec<Section> = denominators
        .into_iter()
        .map(|(a, first_order)| Section {
            b: numerator(first_order),
            a,
        })
        .collect();
    // Unit gain where the band is: at 0, at the Nyquist frequency, or at the digital image of the centre.
    let at = match band {
        Band::Low(_) | Band::Stop(..) => one,
        Band::High(_) => -one,
        Band::Pass(..) => zero,
    };
    let gain = sections
        .iter()
        .map(|s| response(s, at))
        .product::<Complex64>()
        .norm();
    sections[0].b.iter_mut().for_each(|b| *b /= gain);
    Ok(sections)
}

/// H(z) of one section.
fn response(s: &Section, z: Complex64) -> Complex64 {
    let i = z.inv();
    (s.b[0] + (s.b[1] + s.b[2] * i) * i) / (1.0 + (s.a[0] + s.a[1] * i) * i)
}

/// Denominators of the sections: conjugate pairs, then the real poles two by two; `true` marks a lone real pole.
fn pair(poles: &[Complex64]) -> Vec<([f64; 2], bool)> {
    let tiny = 1e-12;
    let mut out: Vec<([f64; 2], bool)> = Vec::new();
    let mut real: Vec<f64> = poles
        .iter()
        .filter(|p| p.im.abs() <= tiny)
        .map(|p| p.re)
        .collect();
    real.sort_by(f64::total_cmp);
    for pair in real.chunks(2) {
        match pair {
            [p, q] => out.push(([-(p + q), p * q], false)),
            _ => out.push(([-pair[0], 0.0], true)),
        }
    }
    out.extend(
        poles
            .iter()
            .filter(|p| p.im > tiny)
            .map(|p| ([-2.0 * p.re, p.norm_sqr()], false)),
    );
    out
}

/// Causal filtering from the state `z` (two numbers per section), which is left as it is afterwards.
pub fn sosfilt(sections: &[Section], x: &mut [f64], z: &mut [[f64; 2]]) {
    for (s, z) in sections.iter().zip(z) {
        let ([b0, b1, b2], [a1, a2]) = (s.b, s.a);
        let [mut z0, mut z1] = *z;
        for x in x.iter_mut() {
            let y = b0 * *x + z0;
            z0 = b1 * *x - a1 * y + z1;
            z1 = b2 * *x - a2 * y;
            *x = y;
        }
        *z = [z0, z1];
    }
}

/// `scipy.signal.sosfilt_zi`: the state in which a constant input of 1 gives a constant output.
pub fn sosfilt_zi(sections: &[Section]) -> Vec<[f64; 2]> {
    let mut scale = 1.0;
    let state = |s: &Section| {
        let ([b0, b1, b2], [a1, a2]) = (s.b, s.a);
        let (c0, c1) = (b1 - a1 * b0, b2 - a2 * b0);
        let first = (c0 + c1) / (1.0 + a1 + a2);
        let z = [scale * first, scale * ((1.0 + a1) * first - c0)];
        scale *= (b0 + b1 + b2) / (1.0 + a1 + a2);
        z
    };
    sections.iter().map(state).collect()
}

/// `scipy.signal.sosfiltfilt(sos, x)`: forwards and backwards, so without phase shift; ends padded by odd reflection.
///
/// # Errors
/// [`FilterError::TooShort`] when the signal is not longer than the padding, 3 × the number of taps.
pub fn sosfiltfilt(sections: &[Section], x: &[f64]) -> Result<Vec<f64>, FilterError> {
    let zeros = |f: fn(&Section) -> f64| sections.iter().filter(|s| f(s) == 0.0).count();
    let edge = 3 * (2 * sections.len() + 1 - zeros(|s| s.b[2]).min(zeros(|s| s.a[1])));
    let n = x.len();
    if n <= edge {
        return Err(FilterError::TooShort {
            found: n,
            needed: edge,
        });
    }
    let mut y = Vec::with_capacity(n + 2 * edge);
    y.extend((1..=edge).rev().map(|k| 2.0 * x[0] - x[k]));
    y.extend_from_slice(x);
    y.extend((1..=edge).map(|k| 2.0 * x[n - 1] - x[n - 1 - k]));
    let rest = sosfilt_zi(sections);
    for _ in 0..2 {
        let first = y[0];
        let mut state: Vec<[f64; 2]> = rest.iter().map(|z| [z[0] * first, z[1] * first]).collect();
        sosfilt(sections, &mut y, &mut state);
        y.reverse();
    }
    Ok(y[edge..edge + n].to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_at_minus_3_db_and_the_band_at_0_db() {
        for order in 1..=8 {
            for (band, corners, inside) in [
                (Band::Low(3.0), vec![3.0], 1e-9),
                (Band::High(3.0), vec![3.0], 50.0 - 1e-9),
                (Band::Pass(1.0, 4.0), vec![1.0, 4.0], 2.02),
                (Band::Stop(1.0, 4.0), vec![1.0, 4.0], 1e-9),
            ] {
                let sections = butter(order, band, 100.0).unwrap();
                let gain = |f: f64| {
                    let z = Complex64::from_polar(1.0, 2.0 * PI * f / 100.0);
                    sections
                        .iter()
                        .map(|s| response(s, z))
                        .product::<Complex64>()
                        .norm()
                };
                for corner in corners {
                    assert!(
                        (gain(corner) - 0.5f64.sqrt()).abs() < 1e-7,
                        "{order} {band:?} {}",
                        gain(corner)
                    );
                }
                assert!(
                    (gain(inside) - 1.0).abs() < 1e-3,
                    "{order} {band:?} {}",
                    gain(inside)
                );
            }
        }
    }

    #[test]
    fn out_of_range_is_refused() {
        assert!(butter(4, Band::Pass(4.0, 1.0), 100.0).is_err());
        assert!(butter(4, Band::Low(50.0), 100.0).is_err());
        assert!(butter(0, Band::Low(5.0), 100.0).is_err());
        let sections = butter(4, Band::Low(5.0), 100.0).unwrap();
        assert!(sosfiltfilt(&sections, &[1.0; 15]).is_err());
        assert!(sosfiltfilt(&sections, &[1.0; 16]).is_ok());
    }
}

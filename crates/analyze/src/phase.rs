//! Phases: how together carriers are, and how together they would be by chance.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};
use std::sync::Mutex;

use crate::pairs::products;
use crate::random::Random;
use crate::summary::ends;
use nalgebra::DMatrix;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;

/// Kuramoto's order parameter at every sample.
///
/// ```text
/// r(t) = |(1/N) Σ_j e^{iφ_j(t)}|
/// ```
/// φ_j phase of carrier j (rad), wrapped or not; r 0 (spread out) … 1 (together). One carrier gives 1; none gives nothing.
/// Source: Acebrón et al., Rev. Mod. Phys. 77 (2005) 137.
pub fn order_parameter(phases_rad: &[&[f64]]) -> Vec<f64> {
    let samples = phases_rad.iter().map(|p| p.len()).min().unwrap_or(0);
    let n = phases_rad.len() as f64;
    let mut sums = vec![(0.0f64, 0.0f64); samples];
    for phase in phases_rad {
        for (sum, phi) in sums.iter_mut().zip(*phase) {
            let (sin, cos) = phi.sin_cos();
            sum.0 += cos;
            sum.1 += sin;
        }
    }
    sums.into_iter()
        .map(|(c, s)| (c * c + s * s).sqrt() / n)
        .collect()
}

/// What r is when the phases are independent and uniform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chance {
    /// Its mean.
    pub mean: f64,
    /// The ends of the interval that holds 95 % of it.
    pub band: [f64; 2],
}

/// The chance level of r for `n` carriers with independent, uniform phases.
///
/// ```text
/// mean    E r = (1/N) ∫₀^∞ (1 − J₀(t)^N) t⁻² dt                   (N = 2: 2/π)
/// CDF     P(N·r ≤ x) = Σ_k 2 J₀(j_k/N)^N · x J₁(j_k x/N) / (N j_k J₁(j_k)²)   (N = 2: (2/π) asin(r))
/// ```
/// J₀, J₁ Bessel functions, j_k the zeros of J₀. The CDF is the Fourier–Bessel series of the density on the disc of radius N,
/// beyond which N unit vectors cannot reach; it is exact, and cut where its terms are below 1e-6. N = 3, whose series converges slowly, is integrated directly. N = 1 gives 1, N = 0 gives 0.
/// Source: Kluyver (1906) for the walk of N unit steps; checked against Borwein et al. (2011), W₃(1) = 1.57459723755, W₄(1) = 1.79909248.
pub fn chance_level(n: usize) -> Chance {
    static KNOWN: Mutex<Option<HashMap<usize, Chance>>> = Mutex::new(None);
    match n {
        0 => {
            return Chance {
                mean: 0.0,
                band: [0.0, 0.0],
            };
        }
        1 => {
            return Chance {
                mean: 1.0,
                band: [1.0, 1.0],
            };
        }
        2 => {
            let quantile = |p: f64| (p * PI / 2.0).sin();
            return Chance {
                mean: 2.0 / PI,
                band: [quantile(0.025), quantile(0.975)],
            };
        }
        _ => {}
    }
    // A poisoned lock still holds whole entries: each is inserted in one step.
    let mut known = KNOWN.lock().unwrap_or_else(|e| e.into_inner());
    *known.get_or_insert_default().entry(n).or_insert_with(|| {
        let cdf = ResultantCdf::new(n);
        Chance {
            mean: mean_resultant(n),
            band: [cdf.quantile(0.025), cdf.quantile(0.975)],
        }
    })
}

/// What is smaller makes no digit of a chance level that anybody reads.
const NOTHING: f64 = 1e-10;

/// The t from which J₀(t)^N is nothing: |J₀(t)| ≤ √(2/πt).
fn reach(n: usize) -> f64 {
    2.0 / PI * NOTHING.powf(-2.0 / n as f64)
}

/// (1/N) ∫₀^∞ (1 − J₀(t)^N) t⁻² dt by Simpson's rule; the tail beyond T is 1/T.
fn mean_resultant(n: usize) -> f64 {
    let h = 0.01;
    let steps = 2 * (reach(n).min(400.0) / (2.0 * h)).ceil() as usize;
    let end = steps as f64 * h;
    let value = |k: usize| {
        if k == 0 {
            return n as f64 / 4.0;
        }
        let t = k as f64 * h;
        (1.0 - libm::j0(t).powi(n as i32)) / (t * t)
    };
    let inner: f64 = (1..steps)
        .map(|k| value(k) * if k % 2 == 1 { 4.0 } else { 2.0 })
        .sum();
    ((value(0) + inner + value(steps)) * h / 3.0 + 1.0 / end) / n as f64
}

/// The distribution of r for N ≥ 3.
enum ResultantCdf {
    /// Halves of the angle between the first two unit vectors, whose sum is 2 cos of it.
    Three(Vec<f64>),
    /// (j_k/N, coefficient) of the Fourier–Bessel series.
    Series(usize, Vec<(f64, f64)>),
}

impl ResultantCdf {
    fn new(n: usize) -> Self {
        if n == 3 {
            let m = 20_000;
            return ResultantCdf::Three(
                (0..m)
                    .map(|k| 2.0 * (PI / 2.0 * (k as f64 + 0.5) / m as f64).cos())
                    .collect(),
            );
        }
        let term = |k: usize| {
            let zero = j0_zero(k);
            let a = zero / n as f64;
            (
                a,
                2.0 * libm::j0(a).powi(n as i32) / (n as f64 * zero * libm::j1(zero).powi(2)),
            )
        };
        let (terms, end) = ((1..=4000.max(4 * n)).map(term), reach(n));
        ResultantCdf::Series(n, terms.take_while(|(a, _)| *a < end).collect())
    }

    fn at(&self, r: f64) -> f64 {
        match self {
            ResultantCdf::Three(pairs) => {
                let x = 3.0 * r;
                // |s + u| ≤ x for a unit vector u at the angle θ to s: cos θ ≤ (x² − s² − 1) / 2s.
                let share = |s: &f64| {
                    1.0 - ((x * x - s * s - 1.0) / (2.0 * s)).clamp(-1.0, 1.0).acos() / PI
                };
                pairs.iter().map(share).sum::<f64>() / pairs.len() as f64
            }
            ResultantCdf::Series(n, terms) => {
                let x = r * *n as f64;
                x * terms.iter().map(|(a, c)| c * libm::j1(a * x)).sum::<f64>()
            }
        }
    }

    fn quantile(&self, p: f64) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if self.at(middle) < p {
                low = middle
            } else {
                high = middle
            }
        }
        0.5 * (low + high)
    }
}

/// The k-th zero of J₀ (k ≥ 1): McMahon's expansion, then Newton's method.
fn j0_zero(k: usize) -> f64 {
    let b = PI * (k as f64 - 0.25);
    let mut z = b + 1.0 / (8.0 * b) - 31.0 / (384.0 * b.powi(3));
    for _ in 0..3 {
        z += libm::j0(z) / libm::j1(z);
    }
    z
}

/// Mean direction, concentration and spread of angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circular {
    /// Mean direction (rad), −π … π.
    pub mean_rad: f64,
    /// Resultant length, 0 … 1; of a relative phase this is the phase-locking value (PLV).
    pub resultant: f64,
    /// Circular standard deviation √(−2 ln R) (rad); infinite spread is given as `None`.
    pub sd_rad: Option<f64>,
}

/// Circular statistics of angles (rad). `None` for no angles. Source: Mardia & Jupp, Directional Statistics (2000), ch. 2.
pub fn circular(angles_rad: impl IntoIterator<Item = f64>) -> Option<Circular> {
    let (mut c, mut s, mut n) = (0.0, 0.0, 0usize);
    for angle in angles_rad {
        let (sin, cos) = angle.sin_cos();
        c += cos;
        s += sin;
        n += 1;
    }
    if n == 0 {
        return None;
    }
    let resultant = ((c * c + s * s).sqrt() / n as f64).min(1.0);
    let sd_rad = (resultant > 0.0).then(|| (-2.0 * resultant.ln()).max(0.0).sqrt());
    Some(Circular {
        mean_rad: s.atan2(c),
        resultant,
        sd_rad,
    })
}

/// Statistics of the generalised relative phase p·φ − q·ψ: p:q locking; 1, 1 is the plain relative phase, whose
/// `resultant` is the PLV |⟨e^{i(φ−ψ)}⟩| (Lachaux et al., Hum. Brain Mapp. 8 (1999) 194). `None` for empty phases.
pub fn relative_phase(phi_rad: &[f64], psi_rad: &[f64], p: f64, q: f64) -> Option<Circular> {
    circular(phi_rad.iter().zip(psi_rad).map(|(a, b)| p * a - q * b))
}

/// PLV |⟨e^{i(φ_j − φ_k)}⟩| of every pair of carriers, (0, 1), (0, 2), …: products of their unit vectors, N sines for N²/2 differences.
pub fn locking(phases_rad: &[&[f64]]) -> Vec<f64> {
    let samples = phases_rad.iter().map(|p| p.len()).min().unwrap_or(0);
    if samples == 0 {
        return Vec::new();
    }
    let (mut unit, mut turned) = (Vec::new(), Vec::new());
    for phases in phases_rad {
        let (sin, cos): (Vec<f64>, Vec<f64>) =
            phases[..samples].iter().map(|phi| phi.sin_cos()).unzip();
        turned.extend(sin.iter().copied().chain(cos.iter().map(|c| -c)));
        unit.extend(cos.into_iter().chain(sin));
    }
    let columns = |x| DMatrix::from_vec(2 * samples, phases_rad.len(), x);
    let (unit, turned) = (columns(unit), columns(turned));
    let length = |(re, im): (f64, f64)| ((re * re + im * im).sqrt() / samples as f64).min(1.0);
    let parts = products(&unit, &unit).into_iter();
    parts.zip(products(&turned, &unit)).map(length).collect()
}

/// What mean r the same phases give when each carrier is shifted in time by a random, circular amount: the chance level of *measured*
/// phases, with their own drifts and wobbles.
///
/// Returns the `draws` surrogate means, ascending. Deterministic in `seed`. Shifts keep at least a tenth of the window between
/// the first carrier's clock and each other's; two others may be shifted alike, which can only raise the level.
/// Carriers that keep one steady tempo stay locked when they are shifted: their surrogates then scatter over 0 … 1, and say so.
/// Source: time-shifted surrogates, Moulder et al., Psychol. Methods 23 (2018) 757 ("data sliding").
pub fn surrogate_synchrony(phases_rad: &[&[f64]], draws: usize, seed: u64) -> Vec<f64> {
    let samples = phases_rad.iter().map(|p| p.len()).min().unwrap_or(0);
    if samples == 0 || phases_rad.is_empty() {
        return Vec::new();
    }
    let unit: Vec<Vec<Complex64>> = phases_rad
        .iter()
        .map(|p| {
            p[..samples]
                .iter()
                .map(|phi| Complex64::from_polar(1.0, *phi))
                .collect()
        })
        .collect();
    let mut random = Random(seed);
    let mut sum = vec![Complex64::default(); samples];
    let mut out: Vec<f64> = (0..draws)
        .map(|_| {
            sum.copy_from_slice(&unit[0]);
            for carrier in &unit[1..] {
                let least = samples / 10;
                let shift = least + (random.bits() % (samples - 2 * least).max(1) as u64) as usize;
                let (head, tail) = carrier.split_at(shift);
                for (s, z) in sum.iter_mut().zip(tail.iter().chain(head)) {
                    *s += z;
                }
            }
            sum.iter().map(|z| z.norm()).sum::<f64>() / (samples * unit.len()) as f64
        })
        .collect();
    out.sort_by(f64::total_cmp);
    out
}

/// `scipy.signal.hilbert(x)`: the analytic signal, whose real part is x. Empty for an empty signal.
///
/// ```text
/// z = x + i·H[x],   transform of H[x]: −i·sgn(f)·X(f), 0 at 0 and at f_s/2
/// ```
/// The signal is taken as periodic: drop a few periods at both ends before using its phase. Source: Marple, IEEE Trans. Signal Process. 47 (1999) 2600.
pub fn hilbert(x: &[f64]) -> Vec<Complex64> {
    let n = x.len();
    if n == 0 {
        return Vec::new();
    }
    let mut transform = crate::spectrum::rfft(x);
    let last = transform.len() - 1;
    for (k, z) in transform.iter_mut().enumerate() {
        let alone = k == 0 || (n.is_multiple_of(2) && k == last);
        *z = if alone {
            Complex64::default()
        } else {
            Complex64::new(z.im, -z.re)
        };
    }
    let plan = RealFftPlanner::<f64>::new().plan_fft_inverse(n);
    let mut imaginary = plan.make_output_vec();
    // OK because the lengths are the plan's own and the bins that have to be real are zero.
    plan.process(&mut transform, &mut imaginary)
        .expect("buffers of the plan's own length");
    x.iter()
        .zip(imaginary)
        .map(|(x, y)| Complex64::new(*x, y / n as f64))
        .collect()
}

/// The same angle within −π … π, rad.
pub fn wrap(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(TAU) - PI
}

/// `numpy.unwrap`: adds multiples of 2π so that neighbours differ by at most π; but what is not finite stays so, and is no neighbour.
pub fn unwrap(phase_rad: &[f64]) -> Vec<f64> {
    let mut out = Vec::with_capacity(phase_rad.len());
    let mut turns = 0.0;
    let mut last: Option<f64> = None;
    for phi in phase_rad {
        if !phi.is_finite() {
            out.push(f64::NAN);
            continue;
        }
        if let Some(last) = last {
            turns -= ((phi - last) / TAU).round();
        }
        out.push(phi + turns * TAU);
        last = Some(*phi);
    }
    out
}

/// Whether a phase (rad) comes unwrapped: it takes more than a turn, and never falls by half of one from a sample to the next. Over what is not
/// finite nobody knows how it went.
pub fn comes_unwrapped(phase_rad: &[f64]) -> bool {
    let [low, high] = ends(phase_rad);
    let falls = phase_rad.windows(2).any(|pair| pair[1] - pair[0] < -PI);
    high - low > TAU && !falls
}

/// A phase that goes on, rad. One that comes unwrapped goes on already: where it leaps, it advanced.
pub fn continuous(phase_rad: &[f64]) -> Vec<f64> {
    match comes_unwrapped(phase_rad) {
        true => phase_rad.to_vec(),
        false => unwrap(phase_rad),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_phase_that_goes_on_is_left_as_it_is() {
        // 3.2 rad from one sample to the next: unwrapping would take it back.
        let fast: Vec<f64> = (0..50).map(|k| 3.2 * f64::from(k)).collect();
        assert_eq!(continuous(&fast), fast);
        let slow: Vec<f64> = (0..50).map(|k| 0.5 * f64::from(k)).collect();
        let wrapped: Vec<f64> = slow.iter().map(|x| wrap(*x)).collect();
        for (a, b) in continuous(&wrapped).iter().zip(&slow) {
            assert!((a - b).abs() < 1e-12);
        }
        let mut lost = fast.clone();
        lost[20] = f64::NAN;
        let found = continuous(&lost);
        assert!(found[20].is_nan() && found[21] == fast[21]);
    }

    #[test]
    fn locking_of_pairs_is_that_of_their_relative_phases() {
        let mut random = Random(3);
        let mut walk = |turns: f64| {
            let mut phase = 0.0;
            let step = |k| {
                phase += random.uniform() - 0.5;
                phase + turns * f64::from(k)
            };
            (0..900).map(step).collect::<Vec<f64>>()
        };
        let phases: Vec<Vec<f64>> = (0..70).map(|c| walk(0.4 + 0.001 * f64::from(c))).collect();
        let phases: Vec<&[f64]> = phases.iter().map(|p| &p[..]).collect();
        let mut found = locking(&phases).into_iter();
        for (j, a) in phases.iter().enumerate() {
            for b in &phases[j + 1..] {
                let plain = relative_phase(a, b, 1.0, 1.0).unwrap().resultant;
                assert!((found.next().unwrap() - plain).abs() < 1e-12);
            }
        }
        assert!(found.next().is_none());
        assert!(locking(&[&[], &[]]).is_empty());
    }

    #[test]
    fn a_hole_does_not_swallow_what_comes_after_it() {
        let found = unwrap(&[f64::NAN, 3.0, -3.0, f64::INFINITY, 3.1]);
        assert!(found[0].is_nan() && found[3].is_nan());
        let expected = [3.0, TAU - 3.0, 3.1];
        for (a, b) in [found[1], found[2], found[4]].iter().zip(expected) {
            assert!((a - b).abs() < 1e-12, "{found:?}");
        }
    }

    #[test]
    fn val_chance_level_of_two_is_two_over_pi() {
        let c = chance_level(2);
        assert_eq!(c.mean, 2.0 / PI);
        // r = |cos(Δ/2)| with Δ uniform.
        assert!((c.band[0] - 0.03925981575906861).abs() < 1e-15);
    }

    #[test]
    fn val_mean_of_random_walks_borwein_2011() {
        assert!((chance_level(3).mean * 3.0 - 1.574_597_237_551_89).abs() < 1e-7);
        assert!((chance_level(4).mean * 4.0 - 1.799_092_479_3).abs() < 1e-7);
        assert!((mean_resultant(2) - 2.0 / PI).abs() < 3e-6);
    }

    #[test]
    fn many_phases_follow_rayleigh() {
        // r² is exponential with mean 1/N for large N; the first correction is of the order 1/N.
        for n in [100usize, 400] {
            let c = chance_level(n);
            let rayleigh = |p: f64| (-(1.0 - p).ln() / n as f64).sqrt();
            assert!(
                (c.mean / (PI / (4.0 * n as f64)).sqrt() - 1.0).abs() < 0.5 / n as f64,
                "{n} {c:?}"
            );
            assert!(
                (c.band[0] / rayleigh(0.025) - 1.0).abs() < 1.0 / n as f64,
                "{n} {c:?}"
            );
            assert!(
                (c.band[1] / rayleigh(0.975) - 1.0).abs() < 1.0 / n as f64,
                "{n} {c:?}"
            );
        }
    }

    #[test]
    fn the_band_holds_95_percent_of_drawn_phases() {
        let mut random = Random(7);
        for n in [3usize, 4, 5, 8] {
            let chance = chance_level(n);
            let draws = 40_000;
            let (mut below, mut above, mut sum) = (0, 0, 0.0);
            for _ in 0..draws {
                let z: Complex64 = (0..n)
                    .map(|_| Complex64::from_polar(1.0, TAU * random.uniform()))
                    .sum();
                let r = z.norm() / n as f64;
                sum += r;
                below += usize::from(r < chance.band[0]);
                above += usize::from(r > chance.band[1]);
            }
            // 1000 ± 31 are expected at each side.
            assert!(
                (850..1150).contains(&below) && (850..1150).contains(&above),
                "n = {n}: {below}, {above}, {chance:?}"
            );
            assert!((sum / draws as f64 - chance.mean).abs() < 0.005, "n = {n}");
        }
    }

    #[test]
    fn locked_phases_have_plv_1_and_their_own_lag() {
        let phi: Vec<f64> = (0..500).map(|k| 0.05 * k as f64).collect();
        let psi: Vec<f64> = phi.iter().map(|p| p - 0.3).collect();
        let c = relative_phase(&phi, &psi, 1.0, 1.0).unwrap();
        assert!((c.resultant - 1.0).abs() < 1e-12 && (c.mean_rad - 0.3).abs() < 1e-12);
        let half: Vec<f64> = phi.iter().map(|p| p / 2.0).collect();
        assert!((relative_phase(&phi, &half, 1.0, 2.0).unwrap().resultant - 1.0).abs() < 1e-12);
        assert!(relative_phase(&phi, &half, 1.0, 1.0).unwrap().resultant < 0.2);
    }

    #[test]
    fn order_parameter_of_opposite_phases_is_zero() {
        let a = [0.0, 1.0, 2.0];
        let b = [PI, 1.0, 2.0 + PI / 2.0];
        let r = order_parameter(&[&a, &b]);
        assert!(r[0] < 1e-15 && (r[1] - 1.0).abs() < 1e-15 && (r[2] - 0.5f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn unwrap_follows_a_growing_phase() {
        let grown: Vec<f64> = (0..100).map(|k| 0.7 * k as f64).collect();
        let wrapped: Vec<f64> = grown.iter().map(|p| p.rem_euclid(TAU)).collect();
        for (a, b) in unwrap(&wrapped).iter().zip(grown) {
            assert!((a - b).abs() < 1e-10);
        }
    }
}

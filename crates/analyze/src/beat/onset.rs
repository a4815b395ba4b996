//! Onset strength: how much new sound begins at each moment.
//!
//! ```text
//! O(t) = Σ_b max(0, L_b(t) − L_b(t−2)),   L_b = ln(1 + E_b/E̅_b)      in every band b
//! A(t) = Σ_b max(0, S_b(t) − S_b(t−2)),   S_b = √E_b                  in the bands below 1 kHz
//! ```
//! E_b energy of band b in a Hann window, E̅_b its median over time, at least 10⁻⁴ of its largest, t in frames of 10 ms. The logarithm lets quiet onsets
//! through; the root keeps how hard was struck, which tells a beat from a hi-hat between beats.
//! Source: D. Ellis, "Beat tracking by dynamic programming", J. New Music Res. 36 (2007); spectral flux as in S. Dixon,
//! "Onset detection revisited", DAFx (2006).

use crate::median::median;
use crate::spectrum::{Complex64, Taper};
use realfft::RealFftPlanner;

/// Frames per second.
pub const FRAME_HZ: f64 = 100.0;
/// Length of the window, s.
const WINDOW_S: f64 = 0.032;
/// Lowest band edge and bands per octave.
const LOWEST_HZ: f64 = 40.0;
const BANDS_PER_OCTAVE: f64 = 3.0;
/// Highest band edge, Hz.
const HIGHEST_HZ: f64 = 10_000.0;
/// Only what is below this counts for the accent, Hz.
const ACCENT_HZ: f64 = 1_000.0;

/// Onset strengths at [`FRAME_HZ`].
#[derive(Clone, Debug, PartialEq)]
pub struct Onsets {
    /// Time of the first frame, s.
    pub start_s: f64,
    /// Onset strength, root mean square 1.
    pub strength: Vec<f64>,
    /// Accent: how much low sound begins; 0 and up, mean of its peaks about 1.
    pub accent: Vec<f64>,
    /// Whether the sound is known where a frame tells what begins.
    pub known: Vec<bool>,
}

impl Onsets {
    /// Onset strengths of one channel.
    pub fn of(sound: &[f32], rate_hz: f64) -> Self {
        let window = (WINDOW_S * rate_hz).round().max(16.0) as usize;
        let edges = band_edges(rate_hz, window);
        let bands = edges.len() - 1;
        let taper = Taper::Hann.values(window);
        let sways = sways(&taper);
        let plan = RealFftPlanner::<f64>::new().plan_fft_forward(window);
        let (mut input, mut output) = (plan.make_input_vec(), plan.make_output_vec());
        // None reaches past the end: silence there would end what sounds, in every band at once.
        let frames = (sound.len().checked_sub(window))
            .map_or(0, |last| (last as f64 / rate_hz * FRAME_HZ) as usize + 1);
        let mut energy = vec![0.0; frames * bands];
        let mut heard = vec![true; frames];
        for frame in 0..frames {
            let first = (frame as f64 / FRAME_HZ * rate_hz) as usize;
            let within = sound[first..first + window].iter().zip(&taper);
            for (x, (s, w)) in input.iter_mut().zip(within) {
                let s = f64::from(*s);
                heard[frame] &= s.is_finite();
                *x = if s.is_finite() { s * w } else { 0.0 };
            }
            for sway in &sways {
                let size: f64 = sway.iter().zip(&input).map(|(q, x)| q * x).sum();
                for ((x, q), w) in input.iter_mut().zip(sway).zip(&taper) {
                    *x -= size * q * w;
                }
            }
            // OK because both buffers were made by the plan.
            plan.process(&mut input, &mut output)
                .expect("buffers of the plan's own length");
            for b in 0..bands {
                let band = output[edges[b]..edges[b + 1]].iter();
                energy[frame * bands + b] = match heard[frame] {
                    true => band.map(Complex64::norm_sqr).sum(),
                    false => f64::NAN,
                };
            }
        }
        let low = (0..bands)
            .take_while(|&b| edges[b] as f64 * rate_hz / (window as f64) < ACCENT_HZ)
            .count();
        let mut strength = flux(&energy, bands, bands, true);
        let mut accent = flux(&energy, bands, low, false);
        normalise(&mut strength);
        let top = top_mean(&accent);
        if top > 0.0 {
            accent.iter_mut().for_each(|a| *a /= top);
        }
        Self {
            start_s: 0.5 * window as f64 / rate_hz,
            strength,
            accent,
            known: (0..frames)
                .map(|f| heard[f] && heard[f.saturating_sub(2)])
                .collect(),
        }
    }

    /// Everything that begins: the maxima of the strength that stand out, s.
    pub fn times_s(&self) -> Vec<f64> {
        let frames = self.strength.windows(3).enumerate();
        frames
            .filter(|(k, w)| {
                let known = self.known[*k..k + 3].iter().all(|k| *k);
                known && w[1] > 1.0 && w[1] >= w[0] && w[1] > w[2]
            })
            .map(|(k, _)| self.time_s((k + 1) as f64))
            .collect()
    }

    /// Time of a frame (which may be fractional), s.
    pub fn time_s(&self, frame: f64) -> f64 {
        self.start_s + frame / FRAME_HZ
    }
}

/// Parabolas, orthonormal under a window: what sways through it as they do, wind or a hand at the microphone, is below the lowest band and would
/// leak into it. Without them 10 Hz are 40 dB weaker there, 20 Hz 11 dB, and a drum of 60 Hz 2 dB.
fn sways(taper: &[f64]) -> [Vec<f64>; 3] {
    let mut out = [const { Vec::new() }; 3];
    for power in 0..3 {
        let place = |k: usize| 2.0 * k as f64 / taper.len() as f64 - 1.0;
        let mut sway: Vec<f64> = (0..taper.len()).map(|k| place(k).powi(power)).collect();
        let under = |a: &[f64], b: &[f64]| -> f64 {
            let both = a.iter().zip(b).zip(taper);
            both.map(|((a, b), w)| a * b * w).sum()
        };
        for other in &out[..power as usize] {
            let size = under(other, &sway);
            sway.iter_mut().zip(other).for_each(|(x, q)| *x -= size * q);
        }
        let norm = under(&sway, &sway).sqrt();
        sway.iter_mut().for_each(|x| *x /= norm);
        out[power as usize] = sway;
    }
    out
}

/// Bins at which the bands begin, ascending, each band at least one bin wide.
fn band_edges(rate_hz: f64, window: usize) -> Vec<usize> {
    let bin_hz = rate_hz / window as f64;
    let mut edges: Vec<usize> = Vec::new();
    let mut hz = LOWEST_HZ;
    while hz < HIGHEST_HZ.min(0.45 * rate_hz) {
        let bin = (hz / bin_hz).round().max(1.0) as usize;
        if edges.last().is_none_or(|&last| bin > last) {
            edges.push(bin);
        }
        hz *= 2f64.powf(1.0 / BANDS_PER_OCTAVE);
    }
    edges
}

/// Summed rise of the first `count` bands from two frames ago.
fn flux(energy: &[f64], bands: usize, count: usize, logarithmic: bool) -> Vec<f64> {
    let frames = energy.len() / bands.max(1);
    let mut out = vec![0.0; frames];
    for b in 0..count {
        let mut level: Vec<f64> = (0..frames).map(|f| energy[f * bands + b]).collect();
        if logarithmic {
            let known = level.iter().copied().filter(|e| e.is_finite());
            let Some(median) = median(&mut known.collect::<Vec<f64>>()) else {
                continue;
            };
            let peak = level.iter().copied().fold(0.0, f64::max);
            // Silence between strokes has a median of nothing.
            let floor = median.max(1e-4 * peak);
            if floor <= 0.0 {
                continue;
            }
            level.iter_mut().for_each(|e| *e = (*e / floor).ln_1p());
        } else {
            level.iter_mut().for_each(|e| *e = e.sqrt());
        }
        for f in 2..frames {
            // 0 where one of them is not known.
            out[f] += (level[f] - level[f - 2]).max(0.0);
        }
    }
    out
}

/// Takes off the local mean (1 s), keeps what is above, and scales to a root mean square of 1.
fn normalise(x: &mut [f64]) {
    let half = (0.5 * FRAME_HZ) as usize;
    let mut sums = vec![0.0];
    for v in x.iter() {
        sums.push(sums[sums.len() - 1] + v);
    }
    let n = x.len();
    for (i, v) in x.iter_mut().enumerate() {
        let (a, b) = (i.saturating_sub(half), (i + half + 1).min(n));
        *v = (*v - (sums[b] - sums[a]) / (b - a) as f64).max(0.0);
    }
    let power = x.iter().map(|v| v * v).sum::<f64>() / n.max(1) as f64;
    if power > 0.0 {
        x.iter_mut().for_each(|v| *v /= power.sqrt());
    }
}

/// Mean of the local maxima that are above the mean.
fn top_mean(x: &[f64]) -> f64 {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    let tops: Vec<f64> = x
        .windows(3)
        .filter(|w| w[1] > mean && w[1] >= w[0] && w[1] > w[2])
        .map(|w| w[1])
        .collect();
    tops.iter().sum::<f64>() / tops.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beat::beats;
    use crate::beat::synth::{Drums, drums};
    use crate::steps::agreement;

    #[test]
    fn clicks_are_found_where_they_are() {
        for rate_hz in [8_000.0, 22_050.0, 44_100.0, 48_000.0] {
            let n = (10.0 * rate_hz) as usize;
            let mut sound = vec![0.0f32; n];
            let clicks: Vec<f64> = (0..18).map(|k| 0.5 + 0.5013 * f64::from(k)).collect();
            for t in &clicks {
                let first = (t * rate_hz) as usize;
                for k in 0..(0.05 * rate_hz) as usize {
                    let t = k as f64 / rate_hz;
                    sound[first + k] += ((-t / 0.01).exp() * (2e3 * t).sin()) as f32;
                }
            }
            let onsets = Onsets::of(&sound, rate_hz);
            let mut mean = 0.0;
            for t in &clicks {
                let near = |f: &usize| (onsets.time_s(*f as f64) - t).abs() < 0.1;
                let best = (0..onsets.strength.len())
                    .filter(near)
                    .max_by(|a, b| onsets.strength[*a].total_cmp(&onsets.strength[*b]))
                    .unwrap();
                let error = onsets.time_s(best as f64) - t;
                assert!(error.abs() < 0.015, "{rate_hz}: {error}");
                mean += error / clicks.len() as f64;
            }
            println!("{rate_hz}: {mean}");
            assert!(mean.abs() < 0.005, "{rate_hz}: {mean}");
        }
    }

    /// Wind and a hand at the microphone, twice as strong as the drum and more.
    #[test]
    fn what_sways_below_the_lowest_band_hides_no_drum() {
        for (hz, loud) in [(0.0, 20.0), (3.0, 10.0), (10.0, 3.0), (15.0, 1.5)] {
            let (mut sound, truth) = drums(&Drums::default());
            let power: f32 = sound.iter().map(|x| x * x).sum();
            let rms = f64::from(power / sound.len() as f32).sqrt();
            for (k, x) in sound.iter_mut().enumerate() {
                let t = k as f64 / 22_050.0;
                *x += (loud * rms * (std::f64::consts::TAU * hz * t + 1.0).sin()) as f32;
            }
            let found = beats(&sound, 22_050.0).unwrap();
            let f1 = agreement(&found.beat_s, &truth, 0.07).f1;
            println!("{hz} Hz: {f1}");
            assert!(f1 >= 0.95, "{hz} Hz: {f1}");
        }
    }

    /// A file is cut off while something sounds: nothing begins there, nor where it begins.
    #[test]
    fn nothing_begins_where_a_file_ends() {
        let rate_hz = 16_000.0;
        for hz in [0.0, 50.0, 110.0, 220.0] {
            let sound: Vec<f32> = (0..160_000)
                .map(|k| {
                    let t = f64::from(k) / rate_hz;
                    let struck = (-(t % 0.5) / 0.02).exp() * (t * 2e3).sin();
                    let drum = if (1.0..9.0).contains(&t) { struck } else { 0.0 };
                    (drum + 0.1 * (std::f64::consts::TAU * hz * t + 1.0).sin()) as f32
                })
                .collect();
            let onsets = Onsets::of(&sound, rate_hz);
            let far = |t: &&f64| !(0.9..8.7).contains(*t);
            assert_eq!(onsets.times_s().iter().find(far), None, "{hz}");
            let last = onsets.strength.len() - 1;
            assert!((onsets.time_s(last as f64) - 10.0).abs() < 0.03);
        }
    }
}

//! A synthesised drum track: what a microphone beside the drum would record.
//!
//! ```text
//! x(t) = a Σ_k e^{−(t − t_k)/d} [ sin(2π p (t − t_k + g d (1 − e^{−(t − t_k)/d}))) + c e^{−(t − t_k)/0.004} n(t) ] + σ n(t),   t ≥ t_k
//! ```
//! t_k strokes of the beat (s); a level, d decay (s), p pitch (Hz), g = 0.6 glide of the skin from 1.6 p down to p (1), c = 0.3 click of the
//! stick (1); n white noise of unit variance, σ noise of the place (1). Full scale is 1: sums beyond it clip, as they do in a microphone.
//! The recorder's own clock: sample k is taken at k/(rate (1 + drift)) true time and stamped offset + k/rate. Source: the usual model of a
//! membrane struck once, Fletcher & Rossing, *The Physics of Musical Instruments* (1998), ch. 18.

use crate::beat::Stroke;
use crate::random::{Stream, normal_pair};
use std::f64::consts::TAU;

/// A track, as a function of the number of its sample.
#[derive(Clone, Debug)]
pub struct Track {
    /// Samples per second by the recorder's clock, Hz.
    pub rate_hz: u32,
    /// How many samples there are.
    pub samples: u64,
    /// What the recorder's clock shows at t = 0, s.
    pub clock_offset_s: f64,
    /// How much faster it runs, 1.
    pub clock_drift: f64,
    /// p, Hz
    pub pitch_hz: f64,
    /// d, s
    pub decay_s: f64,
    /// a, 1
    pub level: f64,
    /// σ, 1
    pub noise: f64,
    /// The scene's seed.
    pub seed: u64,
    /// When the drum is struck.
    pub strokes: Vec<Stroke>,
}

/// Samples of one message: a tenth of a second.
const BLOCKS_PER_S: u32 = 10;
/// A stroke is over after so many decays: e^{−10} of full scale is a digit and a half of sixteen bits, of the default level less than one.
const DECAYS: f64 = 10.0;
const GLIDE: f64 = 0.6;
const CLICK: f64 = 0.3;
const CLICK_S: f64 = 0.004;
/// An instrument number that no inertial sensor has.
const NOISE_ITEM: u32 = u32::MAX;

/// A stretch of sound.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// Time of its first sample by the recorder's clock, s since the start.
    pub stamp_s: f64,
    /// True time of its last sample, s.
    pub end_s: f64,
    /// The samples.
    pub sound: Vec<i16>,
}

impl Track {
    /// Sample `k`, in parts of full scale.
    fn sample(&self, k: u64) -> f64 {
        let t_s = k as f64 / (f64::from(self.rate_hz) * (1.0 + self.clock_drift));
        let draw = normal_pair(self.seed, Stream::Sensor, NOISE_ITEM, k / 2)[(k % 2) as usize];
        let after = self.strokes.partition_point(|s| s.t_s <= t_s);
        let mut x = self.noise * draw;
        for stroke in self.strokes[..after].iter().rev() {
            let s = t_s - stroke.t_s;
            if s > DECAYS * self.decay_s {
                break;
            }
            let fade = (-s / self.decay_s).exp();
            let turns = self.pitch_hz * (s + GLIDE * self.decay_s * (1.0 - fade));
            x += self.level * fade * ((TAU * turns).sin() + CLICK * (-s / CLICK_S).exp() * draw);
        }
        x
    }

    /// Block number `index`, or nothing behind the end.
    pub fn block(&self, index: u64) -> Option<Block> {
        let length = u64::from((self.rate_hz / BLOCKS_PER_S).max(1));
        let first = index * length;
        if first >= self.samples {
            return None;
        }
        let last = (first + length).min(self.samples);
        let digits = |x: f64| (x * 32767.0).round().clamp(-32767.0, 32767.0) as i16;
        Some(Block {
            stamp_s: self.clock_offset_s + first as f64 / f64::from(self.rate_hz),
            end_s: (last - 1) as f64 / (f64::from(self.rate_hz) * (1.0 + self.clock_drift)),
            sound: (first..last).map(|k| digits(self.sample(k))).collect(),
        })
    }

    /// The whole track as a WAV file: one channel of 16-bit PCM. Source: Microsoft & IBM, RIFF (1991).
    ///
    /// # Errors
    /// Where it is longer than such a file can be, 4 GiB.
    pub fn wav(&self) -> Result<Vec<u8>, String> {
        let bytes = self.samples * 2;
        let Ok(length) = u32::try_from(bytes + 36) else {
            return Err(format!(
                "{bytes} bytes of sound are more than a WAV file can hold; shorten the scene or lower its rate"
            ));
        };
        let mut out = Vec::with_capacity(bytes as usize + 44);
        out.extend_from_slice(b"RIFF");
        out.extend_from_slice(&length.to_le_bytes());
        out.extend_from_slice(b"WAVEfmt ");
        out.extend_from_slice(&16u32.to_le_bytes());
        for half in [1u16, 1] {
            out.extend_from_slice(&half.to_le_bytes());
        }
        out.extend_from_slice(&self.rate_hz.to_le_bytes());
        out.extend_from_slice(&(self.rate_hz * 2).to_le_bytes());
        for half in [2u16, 16] {
            out.extend_from_slice(&half.to_le_bytes());
        }
        out.extend_from_slice(b"data");
        out.extend_from_slice(&(length - 36).to_le_bytes());
        for block in (0..).map_while(|i| self.block(i)) {
            block
                .sound
                .iter()
                .for_each(|s| out.extend_from_slice(&s.to_le_bytes()));
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track() -> Track {
        Track {
            rate_hz: 8000,
            samples: 16001,
            clock_offset_s: -0.5,
            clock_drift: 1e-3,
            pitch_hz: 90.0,
            decay_s: 0.1,
            level: 0.7,
            noise: 0.0,
            seed: 1,
            strokes: [0.25, 0.75, 1.25, 1.75]
                .map(|t_s| Stroke { t_s, tempo_hz: 2.0 })
                .to_vec(),
        }
    }

    #[test]
    fn strokes_are_where_the_sound_begins() {
        let track = track();
        let sound: Vec<i16> = (0..)
            .map_while(|i| track.block(i))
            .flat_map(|b| b.sound)
            .collect();
        assert_eq!(sound.len(), 16001);
        for stroke in &track.strokes {
            let at = (stroke.t_s * 8000.0 * 1.001).ceil() as usize;
            let power = |a: usize, b: usize| {
                sound[a..b]
                    .iter()
                    .map(|&x| f64::from(x).powi(2))
                    .sum::<f64>()
            };
            assert!(
                power(at, at + 160) > 30.0 * power(at - 160, at),
                "{stroke:?}"
            );
        }
        assert!(
            sound[..1900].iter().all(|&x| x == 0),
            "silence before the first stroke"
        );
        assert_eq!(track.block(3).unwrap().stamp_s, -0.5 + 0.3);
    }

    /// The formula at the head, stroke after stroke, each to its end; of noise what a click leaves out.
    #[test]
    fn the_sound_is_that_of_the_formula() {
        let quiet = Track {
            strokes: vec![
                Stroke {
                    t_s: 0.25,
                    tempo_hz: 2.0,
                },
                Stroke {
                    t_s: 0.4,
                    tempo_hz: 2.0,
                },
            ],
            ..track()
        };
        let (d, p, rate) = (quiet.decay_s, quiet.pitch_hz, 8000.0 * 1.001);
        for k in 0..16001_u64 {
            let t = k as f64 / rate;
            let mut expected = 0.0;
            let mut clicks = 0.0;
            for struck in [0.25, 0.4] {
                let s = t - struck;
                if s < 0.0 {
                    continue;
                }
                let fade = (-s / d).exp();
                expected += 0.7 * fade * (TAU * p * (s + 0.6 * d * (1.0 - fade))).sin();
                // A normal number beyond six is one in a billion.
                clicks += 6.0 * 0.7 * fade * 0.3 * (-s / 0.004).exp();
            }
            let apart = (quiet.sample(k) - expected).abs();
            assert!(apart <= clicks + 1e-4, "{t} s: {apart}");
        }
        let block = quiet.block(2).unwrap();
        assert_eq!(
            (block.sound.len(), quiet.block(20).unwrap().sound.len()),
            (800, 1)
        );
        assert_eq!(block.end_s, 2399.0 / rate);
        assert_eq!(quiet.block(20).unwrap().end_s, 16000.0 / rate);
        assert_eq!(quiet.block(21), None);
    }

    #[test]
    fn noise_of_the_place_is_white_and_of_the_strength_asked_for() {
        let noisy = Track {
            noise: 0.1,
            strokes: Vec::new(),
            ..track()
        };
        let x: Vec<f64> = (0..16000).map(|k| noisy.sample(k)).collect();
        let mean_of = |lag: usize| {
            let pairs = x.iter().zip(&x[lag..]);
            pairs.map(|(a, b)| a * b).sum::<f64>() / (x.len() - lag) as f64
        };
        // Four standard errors: σ²√(2/n), and σ²/√n.
        assert!((mean_of(0) - 0.01).abs() < 0.01 * 4.0 * (2.0 / 16e3f64).sqrt());
        for lag in 1..5 {
            assert!(mean_of(lag).abs() < 0.01 * 4.0 / 16e3f64.sqrt(), "{lag}");
        }
    }

    #[test]
    fn a_wav_file_says_how_long_it_is() {
        let wav = track().wav().unwrap();
        assert_eq!(wav.len(), 44 + 2 * 16001);
        assert_eq!(
            u32::from_le_bytes(wav[4..8].try_into().unwrap()) as usize,
            wav.len() - 8
        );
        assert_eq!(
            u32::from_le_bytes(wav[40..44].try_into().unwrap()),
            2 * 16001
        );
        // Samples and bytes of them in a second.
        let rates = [24, 28].map(|at| u32::from_le_bytes(wav[at..at + 4].try_into().unwrap()));
        assert_eq!(rates, [8000, 16_000]);
    }
}

//! Synthesised drums with known beats, for tests: kick and snare on the beats, swung hi-hats between, a fill at the end of
//! every fourth bar, loose timing, a drifting tempo, noise.

use std::f64::consts::TAU;

/// What is played.
pub struct Drums {
    /// Beats per minute at the start.
    pub bpm: f64,
    /// Where the off-beat falls within the beat: 0.5 straight, 0.67 triplet swing.
    pub swing: f64,
    /// Relative change of tempo from start to end.
    pub drift: f64,
    /// Signal to noise ratio, dB.
    pub snr_db: f64,
    /// Standard deviation of a stroke's time, s.
    pub loose_s: f64,
    /// Length, s.
    pub length_s: f64,
    /// Sampling rate, Hz.
    pub rate_hz: f64,
    /// Seed of everything random.
    pub seed: u64,
}

impl Default for Drums {
    fn default() -> Self {
        Self {
            bpm: 120.0,
            swing: 0.5,
            drift: 0.0,
            snr_db: 10.0,
            loose_s: 0.005,
            length_s: 40.0,
            rate_hz: 22_050.0,
            seed: 1,
        }
    }
}

/// Uniform in −1 … 1 (xorshift64*).
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let bits = self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11;
        bits as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() / 2.0
    }
}

/// Sound, and the times of its beats, s.
pub fn drums(d: &Drums) -> (Vec<f32>, Vec<f64>) {
    let mut random = Random(d.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let mut sound = vec![0.0f64; (d.length_s * d.rate_hz) as usize];
    let mut beats = Vec::new();
    let mut t = 0.4;
    while t < d.length_s - 0.3 {
        let number = beats.len();
        let period = 60.0 / d.bpm / (1.0 + d.drift * t / d.length_s);
        beats.push(t);
        let mut loose = || d.loose_s * random.normal();
        let (l0, l1, l2, l3) = (loose(), loose(), loose(), loose());
        if number % 2 == 0 {
            kick(&mut sound, d.rate_hz, t + l0, 1.0);
        } else {
            snare(&mut sound, d.rate_hz, t + l0, 0.7, &mut random);
        }
        hat(&mut sound, d.rate_hz, t + l1, 0.2, &mut random);
        hat(
            &mut sound,
            d.rate_hz,
            t + d.swing * period + l2,
            0.2,
            &mut random,
        );
        if number % 16 == 15 {
            for k in 1..4 {
                let at = t + f64::from(k) * period / 4.0 + l3;
                snare(&mut sound, d.rate_hz, at, 0.5, &mut random);
            }
        }
        t += period;
    }
    let power = sound.iter().map(|s| s * s).sum::<f64>() / sound.len() as f64;
    let noise = (power * 10f64.powf(-d.snr_db / 10.0)).sqrt();
    for s in &mut sound {
        *s += noise * random.normal();
    }
    (sound.into_iter().map(|s| s as f32).collect(), beats)
}

fn add(
    sound: &mut [f64],
    rate_hz: f64,
    at_s: f64,
    length_s: f64,
    mut wave: impl FnMut(f64) -> f64,
) {
    let first = (at_s.max(0.0) * rate_hz) as usize;
    for k in 0..(length_s * rate_hz) as usize {
        if let Some(s) = sound.get_mut(first + k) {
            *s += wave(k as f64 / rate_hz);
        }
    }
}

fn kick(sound: &mut [f64], rate_hz: f64, at_s: f64, gain: f64) {
    add(sound, rate_hz, at_s, 0.25, |t| {
        let phase = TAU * (50.0 * t + 60.0 * 0.03 * (1.0 - (-t / 0.03).exp()));
        gain * (-t / 0.08).exp() * phase.sin()
    });
}

fn snare(sound: &mut [f64], rate_hz: f64, at_s: f64, gain: f64, random: &mut Random) {
    add(sound, rate_hz, at_s, 0.2, |t| {
        gain * (-t / 0.05).exp() * (0.5 * (TAU * 185.0 * t).sin() + 0.5 * random.uniform())
    });
}

fn hat(sound: &mut [f64], rate_hz: f64, at_s: f64, gain: f64, random: &mut Random) {
    let mut last = 0.0;
    add(sound, rate_hz, at_s, 0.06, |t| {
        let white = random.uniform();
        let high = white - last;
        last = white;
        gain * (-t / 0.02).exp() * high
    });
}

//! Beats and tempo from sound, and how carriers stand to them.
//!
//! | module | gives |
//! |---|---|
//! | [`onset`] | onset strength: how much new sound begins at each moment |
//! | [`tempo`] | tempogram, and the beat's period over time |
//! | [`track`] | the beats themselves, by dynamic programming |
//! | [`mod@adler`] | Adler's test: detuning, pull, capture range |
//! | [`lock`] | the beat's phase, p:q locking |
//! | [`mod@smooth`] | a slow course through points that err |

pub mod adler;
pub mod lock;
pub mod onset;
pub mod smooth;
#[cfg(test)]
pub(crate) mod synth;
pub mod tempo;
pub mod track;

use crate::inputs::Window;
use onset::Onsets;

/// Why there are no beats.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BeatError {
    /// Too short for a tempo.
    #[error("{found_s:.1} s of sound; beats need at least 4 s")]
    TooShort {
        /// Length found, s.
        found_s: f64,
    },
    /// Too slowly sampled.
    #[error("the sound was sampled at {found_hz:.0} Hz; beats need at least 4000 Hz")]
    TooSlow {
        /// Rate found, Hz.
        found_hz: f64,
    },
    /// Silence or steady noise.
    #[error("nothing in the sound begins periodically")]
    NoBeat,
}

/// The beats of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Beats {
    /// Time of each beat since the first sample, s.
    pub beat_s: Vec<f64>,
    /// Beats per second over the time in which they sound, Hz.
    pub tempo_hz: f64,
    /// Half the 95 % interval of the tempo, Hz.
    pub tempo_ci95_hz: f64,
}

/// Beats from sound.
///
/// `sound` is one channel at `rate_hz`, of any scale; what begins in samples that are not finite is not known, and no beat is
/// heard there. Range: 50 to 200 beats per minute. Where two metrical levels fit equally well, the one nearer to 110 per minute is taken.
///
/// # Errors
/// When the sound is too short, too slowly sampled, or holds nothing periodic.
pub fn beats(sound: &[f32], rate_hz: f64) -> Result<Beats, BeatError> {
    beats_among(&onsets(sound, rate_hz)?)
}

/// Everything that begins in a sound, as for [`beats`].
///
/// # Errors
/// When the sound is too short or too slowly sampled.
pub fn onsets(sound: &[f32], rate_hz: f64) -> Result<Onsets, BeatError> {
    let found_s = sound.len() as f64 / rate_hz;
    if !(rate_hz >= 4000.0) {
        return Err(BeatError::TooSlow { found_hz: rate_hz });
    }
    if found_s < 4.0 {
        return Err(BeatError::TooShort { found_s });
    }
    Ok(Onsets::of(sound, rate_hz))
}

/// The beats among what begins.
///
/// # Errors
/// When nothing is periodic.
pub fn beats_among(onsets: &Onsets) -> Result<Beats, BeatError> {
    let beat_s = track::beats(onsets).ok_or(BeatError::NoBeat)?;
    let course = lock::Course::of(&beat_s, None);
    let (tempo_hz, tempo_ci95_hz) = course.tempo(Window::ALL).ok_or(BeatError::NoBeat)?;
    Ok(Beats {
        beat_s,
        tempo_hz,
        tempo_ci95_hz,
    })
}

#[cfg(test)]
mod tests {
    use super::synth::{Drums, drums};
    use super::*;
    use crate::random::Random;
    use crate::steps::agreement;

    #[test]
    fn drums_of_every_tempo_with_swing_fills_noise_and_drift() {
        let mut worst: f64 = 1.0;
        for bpm in [60.0, 75.0, 90.0, 105.0, 120.0, 135.0, 150.0, 165.0, 180.0] {
            for (swing, drift, seed) in [(0.5, 0.0, 1), (0.62, 0.04, 2), (0.67, -0.06, 3)] {
                let (sound, truth) = drums(&Drums {
                    bpm,
                    swing,
                    drift,
                    seed,
                    ..Drums::default()
                });
                let found = beats(&sound, 22_050.0).unwrap();
                let f = agreement(&found.beat_s, &truth, 0.07).f1;
                println!("{bpm} {swing} {drift}: {f:.3}");
                worst = worst.min(f);
            }
        }
        assert!(worst >= 0.95, "{worst}");
    }

    #[test]
    fn silence_and_noise_have_no_beat_or_say_so() {
        assert_eq!(beats(&vec![0.0; 200_000], 22_050.0), Err(BeatError::NoBeat));
        assert!(matches!(
            beats(&[0.0; 100], 22_050.0),
            Err(BeatError::TooShort { .. })
        ));
        assert!(matches!(
            beats(&[0.0; 100], f64::NAN),
            Err(BeatError::TooSlow { .. })
        ));
    }

    /// Bursts of sound at random times, so many seconds apart on average.
    fn bursts(length_s: f64, apart_s: f64, seed: u64) -> Vec<f32> {
        let (mut random, mut sound) = (Random(seed), vec![0.0; (8000.0 * length_s) as usize]);
        let mut t_s = 0.0;
        loop {
            t_s -= apart_s * (1.0 - random.uniform()).ln();
            let (loud, hz) = (0.2 + random.uniform(), 150.0 + 350.0 * random.uniform());
            let Some(rest) = sound.get_mut((8000.0 * t_s) as usize..) else {
                return sound;
            };
            for (k, x) in rest.iter_mut().take(2000).enumerate() {
                let t = k as f64 / 8000.0;
                let wave = (-t / 0.05).exp() * (std::f64::consts::TAU * hz * t).sin();
                *x += (loud * wave) as f32;
            }
        }
    }

    /// Irregular sound repeats by chance; the shorter it is, the more.
    #[test]
    fn what_begins_at_random_is_no_beat() {
        for (length_s, apart_s) in [(6.0, 0.35), (20.0, 0.2), (20.0, 0.6), (60.0, 0.35)] {
            for seed in 1..=4 {
                let found = beats(&bursts(length_s, apart_s, seed), 8000.0);
                assert_eq!(found, Err(BeatError::NoBeat), "{length_s} {apart_s} {seed}");
            }
        }
    }

    /// A drum that pauses, in silence and in noise, and one that stops while somebody talks.
    #[test]
    fn where_nothing_is_struck_no_beat_is_heard() {
        let rate_hz = 22_050.0;
        let (sound, truth) = drums(&Drums::default());
        let talk = bursts(40.0, 0.35, 5);
        let hush = |k: usize| 0.01 * ((k * 7919) % 1000) as f32 / 1000.0;
        let other: [(f64, f64, &dyn Fn(usize) -> f32); 4] = [
            (15.0, 23.0, &|_| 0.0),
            (15.0, 18.0, &|_| 0.0),
            (15.0, 23.0, &hush),
            (25.0, 40.0, &|k| 0.1 * talk[k * 8000 / 22_050]),
        ];
        for (k, (from_s, to_s, instead)) in other.iter().enumerate() {
            let mut sound = sound.clone();
            let (from, to) = ((from_s * rate_hz) as usize, (to_s * rate_hz) as usize);
            (from..to).for_each(|k| sound[k] = instead(k));
            let found = beats(&sound, rate_hz).unwrap();
            let silent = |t: &&f64| (from_s + 0.1..to_s - 0.1).contains(*t);
            assert_eq!(found.beat_s.iter().find(silent), None, "{k}");
            let struck: Vec<f64> = truth.iter().filter(|t| !silent(t)).copied().collect();
            let f1 = agreement(&found.beat_s, &struck, 0.07).f1;
            assert!(f1 > 0.97, "{k}: {f1}");
            let off_hz = (found.tempo_hz - 2.0).abs();
            assert!(off_hz < found.tempo_ci95_hz.max(5e-4), "{k}: {off_hz}");
            let gaps = lock::beats_between(&found.beat_s, None);
            assert_eq!(gaps.contains(&None), k == 0 || k == 2, "{k}");
        }
    }

    /// Its centre is not known where a part of it is not heard: it was 6 ms early, and a pull by such beats too weak by half its interval.
    #[test]
    fn a_stroke_that_the_end_cuts_is_no_beat() {
        let rate_hz = 22_050.0;
        let (sound, truth) = drums(&Drums {
            snr_db: 40.0,
            loose_s: 0.0,
            ..Drums::default()
        });
        for after_s in [0.01, 0.02, 0.03, 0.05, 0.1] {
            let cut = ((truth[60] + after_s) * rate_hz) as usize;
            let found = beats(&sound[..cut], rate_hz).unwrap();
            let nearest = |t: &f64| {
                truth
                    .iter()
                    .min_by(|a, b| (*a - t).abs().total_cmp(&(*b - t).abs()))
            };
            let off_s = |t: &f64| t - nearest(t).unwrap();
            let (last, others) = found.beat_s.split_last().unwrap();
            let usual = others.iter().map(off_s).sum::<f64>() / others.len() as f64;
            assert!((off_s(last) - usual).abs() < 2e-3, "{after_s}");
        }
    }

    /// Single beats that nobody strikes are beats all the same.
    #[test]
    fn a_beat_that_is_missed_is_no_pause() {
        let (mut sound, truth) = drums(&Drums {
            snr_db: 40.0,
            ..Drums::default()
        });
        for t in truth.iter().skip(7).step_by(9) {
            let at = ((t - 0.03) * 22_050.0) as usize;
            sound[at..at + 5000].fill(0.0);
        }
        let found = beats(&sound, 22_050.0).unwrap();
        let f1 = agreement(&found.beat_s, &truth, 0.07).f1;
        assert!(f1 > 0.98 && !lock::beats_between(&found.beat_s, None).contains(&None));
    }

    #[test]
    fn a_steady_series_has_its_tempo() {
        let t: Vec<f64> = (0..100).map(|k| 3.0 + f64::from(k) / 2.15).collect();
        let tempo = |t: &[f64]| lock::Course::of(t, None).tempo(Window::ALL).unwrap();
        let (hz, ci) = tempo(&t);
        assert!((hz - 2.15).abs() < 1e-12 && ci < 1e-12);
        // A beat that was lost and a pause change nothing.
        let paused = |k: &usize| *k != 30 && !(60..80).contains(k);
        let late = |k: usize| t[k] + if k < 60 { 0.0 } else { 0.2 };
        let some: Vec<f64> = (0..100).filter(paused).map(late).collect();
        let (hz, ci) = tempo(&some);
        assert!((hz - 2.15).abs() < 1e-12 && ci < 1e-12, "{hz} {ci}");
    }
}

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

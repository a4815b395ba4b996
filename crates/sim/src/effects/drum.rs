//! The drum as a microphone hears it; the sound itself is [`crate::sensors::drum`].
//!
//! It needs `effects.music`, whose strokes it sounds, and changes nothing about the motion.

use crate::model::Model;
use crate::scene::Scene;
use crate::scene::problem::{Checker, Problem, check_clock, problem, shown};
use crate::sensors::drum::Track;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[effects.drum]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Drum {
    /// Samples per second, Hz.
    pub sample_rate_hz: u32,
    /// Pitch of the drum, Hz.
    pub pitch_hz: f64,
    /// Time in which a stroke falls to 1/e, s.
    pub decay_s: f64,
    /// Loudness of a stroke, 1 is full scale.
    pub level: f64,
    /// Noise of the place, RMS, 1 is full scale.
    pub noise: f64,
    /// What the recorder's clock shows at t = 0, s.
    pub clock_offset_s: f64,
    /// How much faster that clock runs, parts per million.
    pub clock_drift_ppm: f64,
}

impl Default for Drum {
    fn default() -> Self {
        Self {
            sample_rate_hz: 16_000,
            pitch_hz: 90.0,
            decay_s: 0.08,
            level: 0.6,
            noise: 0.01,
            clock_offset_s: 0.0,
            clock_drift_ppm: 0.0,
        }
    }
}

impl Drum {
    pub(super) fn check(&self, scene: &Scene) -> Result<(), Problem> {
        let key = |name: &str| format!("effects.drum.{name}");
        if scene.effects.music.is_none() {
            return Err(problem(
                "effects.drum",
                "there is no `effects.music` whose beat it could sound",
            ));
        }
        if !(1000..=192_000).contains(&self.sample_rate_hz) {
            return Err(problem(
                &key("sample_rate_hz"),
                format!("found {}, expected 1000 to 192000", self.sample_rate_hz),
            ));
        }
        Checker::positive(&key("pitch_hz"), self.pitch_hz)?;
        let most_hz = 0.5 * f64::from(self.sample_rate_hz);
        if self.pitch_hz >= most_hz {
            return Err(problem(
                &key("pitch_hz"),
                format!(
                    "found {}, expected less than half the sample rate, {most_hz}",
                    shown(self.pitch_hz)
                ),
            ));
        }
        Checker::positive(&key("decay_s"), self.decay_s)?;
        Checker::not_negative(&key("level"), self.level)?;
        Checker::not_negative(&key("noise"), self.noise)?;
        check_clock(scene, &key, self.clock_offset_s, self.clock_drift_ppm)
    }

    pub(super) fn build(&self, scene: &Scene, model: &mut Model) {
        let Some(beat) = model.beat() else { return };
        let clock_drift = self.clock_drift_ppm * 1e-6;
        let strokes = beat.strokes(scene.duration_s);
        // OK because a checked scene lasts less than 2^53 samples.
        let samples = (scene.duration_s * f64::from(self.sample_rate_hz) * (1.0 + clock_drift))
            .floor() as u64
            + 1;
        model.set_track(Track {
            rate_hz: self.sample_rate_hz,
            samples,
            clock_offset_s: self.clock_offset_s,
            clock_drift,
            pitch_hz: self.pitch_hz,
            decay_s: self.decay_s,
            level: self.level,
            noise: self.noise,
            seed: scene.seed,
            strokes,
        });
    }
}

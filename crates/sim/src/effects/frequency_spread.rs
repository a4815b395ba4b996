//! Natural frequencies differ from carrier to carrier: ω_i = 2π (f_i + s·z_i), z_i standard normal from the seed.
//!
//! s standard deviation (Hz). Source: the archive's logs, 1.999 Hz mean and 0.0553 Hz SD across carriers.

use crate::model::Model;
use crate::random::{Stream, normal};
use crate::scene::Scene;
use crate::scene::problem::{Checker, Problem};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[effects.frequency_spread]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FrequencySpread {
    /// s, Hz.
    pub sd_hz: f64,
}

impl Default for FrequencySpread {
    fn default() -> Self {
        Self { sd_hz: 0.0553 }
    }
}

impl FrequencySpread {
    pub(super) fn check(&self, _scene: &Scene) -> Result<(), Problem> {
        Checker::not_negative("effects.frequency_spread.sd_hz", self.sd_hz)
    }

    pub(super) fn build(&self, scene: &Scene, model: &mut Model) {
        model.shift_frequencies(|i| {
            std::f64::consts::TAU * self.sd_hz * normal(scene.seed, Stream::Frequency, i, 0)
        });
    }
}

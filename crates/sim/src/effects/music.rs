//! Musical entrainment: every carrier is pulled towards the beat.
//!
//! ```text
//! φ̇_i += K_i m(t) sin(ψ − φ_i)        m(t) = 1 − e^{−(t − t₀)/τ}  while the drum sounds,  0 before t₀ and in pauses
//! ψ = ψ₀ + 2π ∫ f_m dt        f_m steady but for changes of tempo, each a jump or a straight ramp
//! ```
//! K_i strength, one for all or one for each carrier [rad/s]; f_m beat (Hz); ψ₀ beat phase at t = 0 (rad), from which ψ counts, not from t₀;
//! t₀ onset (s); τ build-up (s), where 0 means K from t₀ on. In a pause the players count on: ψ goes on unheard. One carrier locks where
//! |2πf_m − ω| < K, at sin(ψ − φ) = (2πf_m − ω)/K; outside it drifts at √(Δω² − K²). At t₀ with τ = 0, at the ends of pauses
//! and at changes of tempo the phase rates jump or bend: events. Source: paper, eqs. (music), (adler); Adler (1946).

use crate::beat::{Beat, Pause, TempoChange};
use crate::lanes::{Moments, Number, f64x2, pack};
use crate::model::{AsWhole, Model, Stage, Switch, Whole, Workspace};
use crate::scene::Scene;
use crate::scene::per_carrier::PerCarrier;
use crate::scene::problem::{Checker, Problem, problem};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[effects.music]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Music {
    /// f_m, Hz. Measured in the paper's logs: 2.1507.
    pub beat_hz: f64,
    /// K, rad/s. Measured: 2.7.
    pub strength_rad_per_s: PerCarrier,
    /// t₀, s. Measured: 5.
    pub onset_s: f64,
    /// τ, s. Measured: 11.
    pub build_up_s: f64,
    /// ψ₀, rad.
    pub beat_phase_rad: f64,
    /// Changes of tempo, in order of time.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tempo_changes: Vec<TempoChange>,
    /// When the drum is silent, in order of time.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pauses: Vec<Pause>,
}

impl Default for Music {
    fn default() -> Self {
        Self {
            beat_hz: 2.1507,
            strength_rad_per_s: 2.7.into(),
            onset_s: 5.0,
            build_up_s: 11.0,
            beat_phase_rad: 0.0,
            tempo_changes: Vec::new(),
            pauses: Vec::new(),
        }
    }
}

impl Music {
    pub(super) fn check(&self, scene: &Scene) -> Result<(), Problem> {
        Checker::within("effects.music.beat_hz", self.beat_hz, 0.0..=FASTEST_HZ)?;
        Checker::per_carrier(
            "effects.music.strength_rad_per_s",
            &self.strength_rad_per_s,
            scene.carriers.count(),
        )?;
        Checker::not_negative("effects.music.onset_s", self.onset_s)?;
        Checker::not_negative("effects.music.build_up_s", self.build_up_s)?;
        Checker::angle_rad("effects.music.beat_phase_rad", self.beat_phase_rad)?;
        let mut free_s = 0.0;
        for (k, change) in self.tempo_changes.iter().enumerate() {
            let key = |name: &str| format!("effects.music.tempo_changes.{k}.{name}");
            Checker::not_negative(&key("over_s"), change.over_s)?;
            Checker::within(&key("beat_hz"), change.beat_hz, 0.0..=FASTEST_HZ)?;
            if !change.at_s.is_finite() || change.at_s < free_s || change.at_s <= 0.0 {
                return Err(problem(
                    &key("at_s"),
                    format!("found {}, expected a time after {free_s} s", change.at_s),
                ));
            }
            free_s = change.at_s + change.over_s;
        }
        let mut free_s = 0.0;
        for (k, pause) in self.pauses.iter().enumerate() {
            let key = |name: &str| format!("effects.music.pauses.{k}.{name}");
            if !pause.from_s.is_finite() || pause.from_s < free_s {
                return Err(problem(
                    &key("from_s"),
                    format!("found {}, expected {free_s} or later", pause.from_s),
                ));
            }
            if !pause.to_s.is_finite() || pause.to_s <= pause.from_s {
                return Err(problem(
                    &key("to_s"),
                    format!(
                        "found {}, expected a time after from_s = {}",
                        pause.to_s, pause.from_s
                    ),
                ));
            }
            free_s = pause.to_s;
        }
        Ok(())
    }

    pub(super) fn build(&self, scene: &Scene, model: &mut Model) {
        model.need_phases();
        let beat = Beat::new(
            self.onset_s,
            self.beat_phase_rad,
            self.beat_hz,
            &self.tempo_changes,
            &self.pauses,
        );
        let strength = pack((0..scene.carriers.count()).map(|i| self.strength_rad_per_s.get(i)));
        let mut moments = vec![self.onset_s];
        moments.extend(self.pauses.iter().flat_map(|p| [p.from_s, p.to_s]));
        moments.extend(
            self.tempo_changes
                .iter()
                .flat_map(|c| [c.at_s, c.at_s + c.over_s]),
        );
        moments.retain(|t| *t > 0.0);
        moments.sort_by(f64::total_cmp);
        moments.dedup();
        let per_s = if self.build_up_s == 0.0 {
            None
        } else {
            Some(1.0 / self.build_up_s)
        };
        if beat.pieces.len() == 1 && self.pauses.is_empty() {
            let (rate, phase) = (beat.pieces[0].rate, beat.pieces[0].phase);
            model.add(
                Stage::Clock,
                AsWhole(Steady {
                    onset_s: self.onset_s,
                    rate,
                    phase,
                    per_s,
                }),
            );
        } else {
            model.add(
                Stage::Clock,
                AsWhole(Varied {
                    beat: beat.clone(),
                    per_s,
                }),
            );
        }
        model.add(Stage::Phases, AsWhole(Pull { strength }));
        if !moments.is_empty() {
            model.add_switch(Times(moments));
        }
        model.set_beat(beat);
    }
}

/// Beyond this nobody hears a beat.
const FASTEST_HZ: f64 = 1000.0;

/// Draws the phases to the beat that [`Workspace::beat`] tells of.
#[derive(Debug)]
struct Pull {
    strength: Vec<f64x2>,
}

impl Whole for Pull {
    #[inline(always)]
    fn act<N: Moments>(&self, _t_s: N::Each, w: &mut Workspace<N>) {
        // K sin(ψ − φ) from the sines and cosines that are there already, the beat's last, as they are known last.
        let [sin, cos] = w.beat.map(N::both);
        for (p, strength) in w.pair.iter_mut().zip(&self.strength) {
            let strength = N::always(*strength);
            let slowed = (strength * p.sin).nmadd(cos, p.rate);
            p.rate = (strength * p.cos).madd(sin, slowed);
        }
    }
}

/// What [`Workspace::beat`] is told: the beat's phase where the drum sounds, and silence elsewhere.
#[inline(always)]
fn heard<T: Number>(silent: T, phase: T, per_s: Option<f64>, heard_s: T) -> [T; 2] {
    let grown = match per_s {
        // Beside 1 the digits that `exp_m1` would save are nothing.
        Some(per_s) => -(heard_s * -per_s).exp() + 1.0,
        None => T::splat(1.0),
    };
    let (sin, cos) = phase.sin_cos();
    let grown = silent.if_positive(T::splat(0.0), grown);
    [sin * grown, cos * grown]
}

/// One tempo, no pauses.
#[derive(Debug)]
struct Steady {
    onset_s: f64,
    rate: f64,
    phase: f64,
    per_s: Option<f64>,
}

impl Whole for Steady {
    #[inline(always)]
    fn act<N: Moments>(&self, t_s: N::Each, w: &mut Workspace<N>) {
        // `segment_s` decides, not t: the last stage of the step that ends at the onset still hears nothing.
        let silent = -w.segment_s + self.onset_s;
        let phase = t_s * self.rate + self.phase;
        w.beat = heard(silent, phase, self.per_s, t_s + -self.onset_s);
    }
}

#[derive(Debug)]
struct Varied {
    beat: Beat,
    per_s: Option<f64>,
}

impl Whole for Varied {
    #[inline(always)]
    fn act<N: Moments>(&self, t_s: N::Each, w: &mut Workspace<N>) {
        let [silent, begin_s, rate, bend, phase] = N::look_up([w.segment_s], |[segment_s]| {
            let piece = self.beat.piece(segment_s);
            let silent = f64::from(!self.beat.sounds(segment_s));
            [
                silent,
                piece.begin_s,
                piece.rate,
                0.5 * piece.bend,
                piece.phase,
            ]
        });
        let s = t_s - begin_s;
        let phase = s * (s * bend + rate) + phase;
        w.beat = heard(silent, phase, self.per_s, t_s + -self.beat.onset_s);
    }
}

/// Moments known beforehand, in order.
#[derive(Debug)]
struct Times(Vec<f64>);

impl Switch for Times {
    fn next_s(&self, after_s: f64) -> f64 {
        self.0
            .get(self.0.partition_point(|t| *t <= after_s))
            .copied()
            .unwrap_or(f64::INFINITY)
    }
}

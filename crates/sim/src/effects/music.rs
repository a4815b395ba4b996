//! Musical entrainment: every carrier is pulled towards the beat.
//!
//! ```text
//! φ̇_i += K_i m(t) sin(ψ − φ_i)        m(t) = 1 − e^{−(t − t₀)/τ}  while the drum sounds,  0 before t₀ and in pauses
//! ψ = ψ₀ + 2π ∫ f_m dt        f_m steady but for changes of tempo, each a jump or a straight ramp
//! ```
//! K_i strength, one for all or one for each carrier [rad/s]; f_m beat (Hz); ψ₀ beat phase at t = 0 (rad); t₀ onset (s); τ build-up
//! (s), where 0 means K from t₀ on. In a pause the players count on: ψ goes on unheard. One carrier locks where
//! |2πf_m − ω| < K, at sin(ψ − φ) = (2πf_m − ω)/K; outside it drifts at √(Δω² − K²). At t₀ with τ = 0, at the ends of pauses
//! and at changes of tempo the phase rates jump or bend: events. Source: paper, eqs. (music), (adler); Adler (1946).

use crate::lanes::{f64x2, pack, sin_cos};
use crate::model::{Model, Stage, Switch, Term, Workspace};
use crate::scene::{Checker, PerCarrier, Problem, Scene, problem};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

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

/// The beat goes over to another tempo.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TempoChange {
    /// When it begins, s.
    pub at_s: f64,
    /// How long it takes, s; 0 is a jump.
    #[serde(default)]
    pub over_s: f64,
    /// The tempo afterwards, Hz.
    pub beat_hz: f64,
}

/// The drum is silent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pause {
    /// From, s.
    pub from_s: f64,
    /// To, s.
    pub to_s: f64,
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
        Checker::not_negative("effects.music.beat_hz", self.beat_hz)?;
        Checker::per_carrier(
            "effects.music.strength_rad_per_s",
            &self.strength_rad_per_s,
            scene.carriers.count(),
        )?;
        Checker::not_negative("effects.music.onset_s", self.onset_s)?;
        Checker::not_negative("effects.music.build_up_s", self.build_up_s)?;
        Checker::finite("effects.music.beat_phase_rad", self.beat_phase_rad)?;
        if self.beat_hz > FASTEST_HZ {
            return Err(problem(
                "effects.music.beat_hz",
                format!("found {}, expected at most {FASTEST_HZ}", self.beat_hz),
            ));
        }
        let mut free_s = 0.0;
        for (k, change) in self.tempo_changes.iter().enumerate() {
            let key = |name: &str| format!("effects.music.tempo_changes.{k}.{name}");
            Checker::not_negative(&key("over_s"), change.over_s)?;
            Checker::not_negative(&key("beat_hz"), change.beat_hz)?;
            if change.beat_hz > FASTEST_HZ {
                return Err(problem(
                    &key("beat_hz"),
                    format!("found {}, expected at most {FASTEST_HZ}", change.beat_hz),
                ));
            }
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
        let beat = Beat::new(self);
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
                Stage::Phases,
                Steady {
                    onset_s: self.onset_s,
                    rate,
                    phase,
                    strength,
                    per_s,
                },
            );
        } else {
            model.add(
                Stage::Phases,
                Varied {
                    beat: beat.clone(),
                    strength,
                    per_s,
                },
            );
        }
        if !moments.is_empty() {
            model.add_switch(Moments(moments));
        }
        model.set_beat(beat);
    }
}

/// Beyond this nobody hears a beat.
const FASTEST_HZ: f64 = 1000.0;

/// ψ from `begin_s` on: phase + rate·s + ½ bend·s², s = t − begin.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    begin_s: f64,
    phase: f64,
    rate: f64,
    bend: f64,
}

/// The beat of the music: when it sounds, and ψ(t).
#[derive(Clone, Debug, PartialEq)]
pub struct Beat {
    /// When it begins, s.
    pub onset_s: f64,
    pieces: Vec<Piece>,
    pauses: Vec<Pause>,
}

/// One stroke of the drum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    /// When, s.
    pub t_s: f64,
    /// Tempo at that moment, Hz.
    pub tempo_hz: f64,
}

impl Beat {
    fn new(music: &Music) -> Self {
        let mut last = Piece {
            begin_s: 0.0,
            phase: music.beat_phase_rad,
            rate: TAU * music.beat_hz,
            bend: 0.0,
        };
        let mut pieces = vec![last];
        for change in &music.tempo_changes {
            let rate = TAU * change.beat_hz;
            let mut at = |last: &mut Piece, begin_s: f64, bend: f64| {
                let s = begin_s - last.begin_s;
                *last = Piece {
                    begin_s,
                    phase: last.phase + s * (last.rate + 0.5 * last.bend * s),
                    rate: last.rate + last.bend * s,
                    bend,
                };
                pieces.push(*last);
            };
            if change.over_s > 0.0 {
                let bend = (rate - last.rate) / change.over_s;
                at(&mut last, change.at_s, bend);
            }
            at(&mut last, change.at_s + change.over_s, 0.0);
            last.rate = rate;
            let end = pieces.len() - 1;
            pieces[end] = last;
        }
        Self {
            onset_s: music.onset_s,
            pieces,
            pauses: music.pauses.clone(),
        }
    }

    /// The piece in force at `t_s`; at a seam the later one.
    fn piece(&self, t_s: f64) -> &Piece {
        let after = self.pieces.partition_point(|p| p.begin_s <= t_s);
        &self.pieces[after.saturating_sub(1)]
    }

    /// ψ(t), rad.
    pub fn phase_at(&self, t_s: f64) -> f64 {
        let p = self.piece(t_s);
        let s = t_s - p.begin_s;
        p.phase + s * (p.rate + 0.5 * p.bend * s)
    }

    /// Tempo at `t_s`, Hz.
    pub fn tempo_hz(&self, t_s: f64) -> f64 {
        let p = self.piece(t_s);
        (p.rate + p.bend * (t_s - p.begin_s)) / TAU
    }

    /// Whether the drum sounds at `t_s`.
    pub fn sounds(&self, t_s: f64) -> bool {
        t_s >= self.onset_s
            && !self
                .pauses
                .iter()
                .any(|p| (p.from_s..p.to_s).contains(&t_s))
    }

    /// Every stroke up to and including `until_s`: where ψ passes a whole number of turns while the drum sounds.
    pub fn strokes(&self, until_s: f64) -> Vec<Stroke> {
        let mut strokes = Vec::new();
        for (k, p) in self.pieces.iter().enumerate() {
            let end_s = self
                .pieces
                .get(k + 1)
                .map_or(f64::INFINITY, |next| next.begin_s)
                .min(until_s);
            if end_s < p.begin_s {
                break;
            }
            let s = end_s - p.begin_s;
            let last = p.phase + s * (p.rate + 0.5 * p.bend * s);
            // A stroke on a seam belongs to the piece that it begins.
            let mut turn = (p.phase / TAU - 1e-9).ceil();
            let is_last_piece = end_s == until_s;
            while turn * TAU <= last + 1e-9 && (is_last_piece || turn * TAU < last - TAU * 1e-9) {
                let rest = (turn * TAU - p.phase).max(0.0);
                // rate·s + ½ bend·s² = rest, by the form that stays exact for bend → 0.
                let root = (p.rate * p.rate + 2.0 * p.bend * rest).max(0.0).sqrt();
                let s = if rest == 0.0 {
                    0.0
                } else {
                    2.0 * rest / (p.rate + root)
                };
                let t_s = p.begin_s + s;
                if !s.is_finite() {
                    break;
                }
                if self.sounds(t_s) && t_s <= until_s {
                    strokes.push(Stroke {
                        t_s,
                        tempo_hz: self.tempo_hz(t_s),
                    });
                }
                turn += 1.0;
                if p.rate == 0.0 && p.bend == 0.0 {
                    break;
                }
            }
        }
        strokes
    }
}

#[inline(always)]
fn pull(w: &mut Workspace, beat_phase: f64, strength: &[f64x2], grown: f64) {
    // sin(ψ − φ) from the sines and cosines that are there already.
    let (sin, cos) = sin_cos(f64x2::splat(beat_phase));
    let (sin, cos) = (sin * grown, cos * grown);
    for (p, strength) in w.pair.iter_mut().zip(strength) {
        p.rate += *strength * (p.cos * sin - p.sin * cos);
    }
}

#[inline(always)]
fn grown(per_s: Option<f64>, heard_s: f64) -> f64 {
    match per_s {
        Some(per_s) => -(-heard_s * per_s).exp_m1(),
        None => 1.0,
    }
}

/// One tempo, no pauses.
#[derive(Debug)]
struct Steady {
    onset_s: f64,
    rate: f64,
    phase: f64,
    strength: Vec<f64x2>,
    per_s: Option<f64>,
}

impl Term for Steady {
    fn apply(&self, t_s: f64, w: &mut Workspace) {
        // `segment_s` decides, not t: the last stage of the step that ends at the onset still hears nothing.
        if w.segment_s >= self.onset_s {
            pull(
                w,
                self.phase + self.rate * t_s,
                &self.strength,
                grown(self.per_s, t_s - self.onset_s),
            );
        }
    }
}

#[derive(Debug)]
struct Varied {
    beat: Beat,
    strength: Vec<f64x2>,
    per_s: Option<f64>,
}

impl Term for Varied {
    fn apply(&self, t_s: f64, w: &mut Workspace) {
        if self.beat.sounds(w.segment_s) {
            let piece = self.beat.piece(w.segment_s);
            let s = t_s - piece.begin_s;
            let phase = piece.phase + s * (piece.rate + 0.5 * piece.bend * s);
            pull(
                w,
                phase,
                &self.strength,
                grown(self.per_s, t_s - self.beat.onset_s),
            );
        }
    }
}

/// Moments known beforehand, in order.
#[derive(Debug)]
struct Moments(Vec<f64>);

impl Switch for Moments {
    fn next_s(&self, after_s: f64) -> f64 {
        self.0
            .get(self.0.partition_point(|t| *t <= after_s))
            .copied()
            .unwrap_or(f64::INFINITY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changing() -> Beat {
        Beat::new(&Music {
            beat_hz: 2.0,
            onset_s: 1.0,
            tempo_changes: vec![
                TempoChange {
                    at_s: 4.0,
                    over_s: 2.0,
                    beat_hz: 3.0,
                },
                TempoChange {
                    at_s: 8.0,
                    over_s: 0.0,
                    beat_hz: 1.0,
                },
            ],
            pauses: vec![Pause {
                from_s: 2.0,
                to_s: 3.0,
            }],
            ..Music::default()
        })
    }

    #[test]
    fn the_phase_is_the_integral_of_the_tempo() {
        let beat = changing();
        let h = 1e-4;
        let mut phase = 0.0;
        for i in 0..100_000 {
            let t = f64::from(i) * h;
            assert!((beat.phase_at(t) - phase).abs() < 1e-6, "t = {t}");
            // The midpoint rule is exact on ramps; the jump lies on the grid.
            phase += TAU * h * beat.tempo_hz(t + 0.5 * h);
        }
        assert!((beat.tempo_hz(5.0) - 2.5).abs() < 1e-12 && beat.tempo_hz(8.5) == 1.0);
    }

    #[test]
    fn strokes_fall_on_whole_turns_and_never_in_a_pause() {
        let beat = changing();
        let strokes = beat.strokes(10.0);
        for s in &strokes {
            let turns = beat.phase_at(s.t_s) / TAU;
            assert!((turns - turns.round()).abs() < 1e-9, "{s:?}");
            assert!(s.t_s >= 1.0 && !(2.0..3.0).contains(&s.t_s));
        }
        // 1 s to 2 s: 1.0, 1.5; 3 s to 4 s: 3.0, 3.5; then 5 turns in the ramp, 6 to 8 s, and 2 in the last 2 s.
        assert_eq!(strokes.len(), 2 + 2 + 5 + 6 + 3, "{strokes:?}");
        assert!(strokes.windows(2).all(|w| w[1].t_s - w[0].t_s > 0.3));
    }
}

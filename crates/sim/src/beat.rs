//! A beat: its phase ψ through changes of tempo, when it sounds, and its strokes.
//!
//! ```text
//! ψ = ψ₀ + 2π ∫ f dt        f steady but for changes of tempo, each a jump or a straight ramp        a stroke wherever ψ/2π is whole
//! ```
//! f tempo (Hz); ψ phase (rad). In a pause the players count on: ψ goes on unheard. ψ is piecewise quadratic, so it and the moments of the
//! strokes are exact. The effect `music` makes one; recordings and the sound of the drum read it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

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

/// ψ from `begin_s` on: phase + rate·s + ½ bend·s², s = t − begin (rad, s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Piece {
    pub begin_s: f64,
    pub phase: f64,
    pub rate: f64,
    pub bend: f64,
}

impl Piece {
    /// Whether ψ stands still.
    fn stands(&self) -> bool {
        self.rate == 0.0 && self.bend == 0.0
    }
}

/// The beat of the music: when it sounds, and ψ(t).
#[derive(Clone, Debug, PartialEq)]
pub struct Beat {
    /// When it begins, s.
    pub onset_s: f64,
    pub(crate) pieces: Vec<Piece>,
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
    /// A beat that begins at `onset_s`; ψ starts from `phase_rad` at t = 0 with `beat_hz`. Changes and pauses in order of time.
    pub fn new(
        onset_s: f64,
        phase_rad: f64,
        beat_hz: f64,
        changes: &[TempoChange],
        pauses: &[Pause],
    ) -> Self {
        let mut last = Piece {
            begin_s: 0.0,
            phase: phase_rad,
            rate: TAU * beat_hz,
            bend: 0.0,
        };
        let mut pieces = vec![last];
        for change in changes {
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
            onset_s,
            pieces,
            pauses: pauses.to_vec(),
        }
    }

    /// The piece in force at `t_s`; at a seam the later one.
    pub(crate) fn piece(&self, t_s: f64) -> &Piece {
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
            // A stroke on a seam belongs to the piece that it begins, also to one that stands still; whoever goes on from there is past it.
            let stood = k > 0 && self.pieces[k - 1].stands();
            let mut turn = match stood {
                true => (p.phase / TAU + 1e-9).floor() + 1.0,
                false => (p.phase / TAU - 1e-9).ceil(),
            };
            let next = self.pieces.get(k + 1);
            let has_end = p.stands() || next.is_none_or(|next| next.begin_s > until_s);
            while turn * TAU <= last + 1e-9 && (has_end || turn * TAU < last - TAU * 1e-9) {
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
                if p.stands() {
                    break;
                }
            }
        }
        strokes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changing() -> Beat {
        Beat::new(
            1.0,
            0.0,
            2.0,
            &[
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
            &[Pause {
                from_s: 2.0,
                to_s: 3.0,
            }],
        )
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
    fn a_stroke_at_the_end_and_on_a_seam_is_one() {
        let change = TempoChange {
            at_s: 2.0,
            over_s: 0.0,
            beat_hz: 3.0,
        };
        let beat = Beat::new(0.0, 0.0, 2.0, &[change], &[]);
        let at: Vec<f64> = beat.strokes(2.0).iter().map(|s| s.t_s).collect();
        assert_eq!(at, [0.0, 0.5, 1.0, 1.5, 2.0]);
    }

    #[test]
    fn a_drum_that_stops_on_a_stroke_strikes_it_once() {
        let change = |at_s, over_s, beat_hz| TempoChange {
            at_s,
            over_s,
            beat_hz,
        };
        let at = |beat_hz: f64, changes: &[TempoChange]| -> Vec<f64> {
            let strokes = Beat::new(0.0, 0.0, beat_hz, changes, &[]).strokes(3.5);
            strokes.iter().map(|s| s.t_s).collect()
        };
        // A jump and a ramp to 0 Hz that end on a whole turn, standing still twice over, and from the start.
        let on = change(3.0, 0.0, 2.0);
        let (jump, ramp) = (change(1.0, 0.0, 0.0), change(0.5, 1.0, 0.0));
        assert_eq!(at(1.0, &[jump, on]), [0.0, 1.0, 3.5]);
        assert_eq!(at(1.0, &[jump, change(2.0, 0.0, 0.0), on]), [0.0, 1.0, 3.5]);
        assert_eq!(at(1.0, &[ramp, on]), [0.0, 1.5, 3.5]);
        assert_eq!(at(1.0, &[jump]), [0.0, 1.0]);
        assert_eq!(at(0.0, &[on]), [0.0, 3.5]);
        // Between two strokes none is made up.
        assert_eq!(at(1.0, &[change(1.25, 0.0, 0.0), on]), [0.0, 1.0, 3.375]);
        // A tempo that passes 0 Hz without standing there.
        let turn = [ramp, change(1.5, 2.0, 2.0)];
        assert_eq!(at(1.0, &turn)[..2], [0.0, 1.5]);
    }

    #[test]
    fn strokes_fall_on_whole_turns_and_never_in_a_pause() {
        let beat = changing();
        let strokes = beat.strokes(10.0);
        for s in &strokes {
            let turns = beat.phase_at(s.t_s) / TAU;
            assert!((turns - turns.round()).abs() < 1e-9, "{s:?}");
            assert!(s.t_s >= 1.0 && !(2.0..3.0).contains(&s.t_s));
            // Tempo is how fast the phase goes on from there.
            let turned = (beat.phase_at(s.t_s + 1e-6) - beat.phase_at(s.t_s)) / TAU;
            assert!((turned * 1e6 - s.tempo_hz).abs() < 1e-5, "{s:?}");
        }
        // 1 s to 2 s: 1.0, 1.5; 3 s to 4 s: 3.0, 3.5; then 5 turns in the ramp, 6 to 8 s, and 2 in the last 2 s.
        assert_eq!(strokes.len(), 2 + 2 + 5 + 6 + 3, "{strokes:?}");
        assert!(strokes.windows(2).all(|w| w[1].t_s - w[0].t_s > 0.3));
    }
}

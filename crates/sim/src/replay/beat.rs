//! Beats that somebody heard → the tempo changes and pauses of `effects.music`.
//!
//! ```text
//! ψ(t_k) = 2πk,  between two beats f = m/(t_{k+1} − t_k)        m = the interval over the median one, rounded: m − 1 were not heard
//! ```
//! Beats that are even to a millionth of their interval are one steady tempo; where tempos change, the median is that of the intervals around. Where
//! three or more were not heard the drum is silent, from half a beat after the last to half a beat before the next; behind the last, too.

use crate::beat::{Pause, TempoChange};
use crate::effects::music::Music;
use std::f64::consts::TAU;

/// So many intervals before and behind one tell how long it usually is.
const AROUND: usize = 4;
/// A gap of so many beats is a pause: of fewer, some were not heard.
const PAUSE: f64 = 4.0;
/// More even than this no clock of a recording is.
const EVEN: f64 = 1e-6;

/// `music` with the beat of `beats_s` (s, ascending, counted from the start of the replay) up to `end_s`, heard from `heard_s` on.
/// `None` for fewer than three beats.
pub(super) fn follow(music: &Music, beats_s: &[f64], heard_s: f64, end_s: f64) -> Option<Music> {
    let whole: Vec<f64> = beats_s.windows(2).map(|w| w[1] - w[0]).collect();
    if whole.len() < 2 || whole.iter().any(|g| *g <= 0.0) {
        return None;
    }
    let usual = |k: usize| {
        let (from, to) = (k.saturating_sub(AROUND), (k + AROUND + 1).min(whole.len()));
        let mut around = whole[from..to].to_vec();
        around.sort_by(f64::total_cmp);
        around[around.len() / 2]
    };
    let turns: Vec<f64> = (whole.iter().enumerate())
        .map(|(k, gap)| (gap / usual(k)).round().max(1.0))
        .collect();
    let span = beats_s[beats_s.len() - 1] - beats_s[0];
    let mean_hz = turns.iter().sum::<f64>() / span;
    let even = whole
        .iter()
        .zip(&turns)
        .all(|(g, m)| (g * mean_hz / m - 1.0).abs() < EVEN);
    let tempo = |k: usize| {
        if even { mean_hz } else { turns[k] / whole[k] }
    };
    // The interval in which the replay begins; before the first beat its tempo counts backwards.
    let first = beats_s
        .partition_point(|t| *t <= 0.0)
        .saturating_sub(1)
        .min(whole.len() - 1);
    let mut tempo_changes = Vec::new();
    let mut pauses = Vec::new();
    for k in first..whole.len() {
        let (from_s, to_s) = (beats_s[k], beats_s[k + 1]);
        if !even && k > first && from_s > 0.0 && from_s < end_s {
            tempo_changes.push(TempoChange {
                at_s: from_s,
                over_s: 0.0,
                beat_hz: tempo(k),
            });
        }
        let half = 0.5 / tempo(k);
        if turns[k] >= PAUSE && to_s - half > 0.0 && from_s < end_s {
            pauses.push(Pause {
                from_s: (from_s + half).max(0.0),
                to_s: to_s - half,
            });
        }
    }
    let last = whole.len() - 1;
    let silent_s = beats_s[last + 1] + 0.5 / tempo(last);
    // Where one more could have been heard, and was not.
    if silent_s.max(0.0) + 0.5 / tempo(last) < end_s {
        pauses.push(Pause {
            from_s: silent_s.max(0.0),
            to_s: end_s,
        });
    }
    Some(Music {
        beat_hz: tempo(first),
        beat_phase_rad: (-TAU * beats_s[first] * tempo(first)).rem_euclid(TAU),
        onset_s: heard_s.max(0.0),
        tempo_changes,
        pauses,
        ..music.clone()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beat::Beat;

    fn beat(m: &Music) -> Beat {
        Beat::new(
            m.onset_s,
            m.beat_phase_rad,
            m.beat_hz,
            &m.tempo_changes,
            &m.pauses,
        )
    }

    #[test]
    fn strokes_fall_where_they_were_heard() {
        let uneven: Vec<f64> = (0..40)
            .map(|k| f64::from(k) * 0.5 + 0.03 * f64::from(k).sin() - 1.2)
            .filter(|t| !(4.2..6.0).contains(t))
            .collect();
        let music = follow(&Music::default(), &uneven, 0.0, 15.0).unwrap();
        // Between two that were heard, m beats apart, it is silent but for half a beat at either end.
        let gap = uneven.windows(2).find(|w| w[1] - w[0] > 1.0).unwrap();
        let missed = ((gap[1] - gap[0]) / 0.5).round();
        let half_s = 0.5 * (gap[1] - gap[0]) / missed;
        let [pause] = music.pauses[..] else {
            panic!("{:?}", music.pauses)
        };
        assert!((pause.from_s - gap[0] - half_s).abs() < 1e-12);
        assert!((gap[1] - pause.to_s - half_s).abs() < 1e-12);
        let strokes = beat(&music).strokes(15.0);
        let heard: Vec<f64> = uneven
            .into_iter()
            .filter(|t| (0.0..=15.0).contains(t))
            .collect();
        assert_eq!(strokes.len(), heard.len());
        for (s, t) in strokes.iter().zip(heard) {
            assert!((s.t_s - t).abs() < 1e-9, "{} {t}", s.t_s);
        }
    }

    #[test]
    fn an_even_beat_is_one_tempo() {
        let even: Vec<f64> = (0..100).map(|k| 5.2 + f64::from(k) / 2.1507).collect();
        let music = follow(&Music::default(), &even, 5.0, 51.5).unwrap();
        assert!(music.tempo_changes.is_empty() && music.pauses.is_empty());
        assert!((music.beat_hz - 2.1507).abs() < 1e-9 && music.onset_s == 5.0);
        assert!((beat(&music).strokes(60.0)[0].t_s - 5.2).abs() < 1e-9);
        assert!(follow(&Music::default(), &even[..2], 0.0, 60.0).is_none());
    }

    #[test]
    fn a_drum_that_slows_down_loses_a_beat_or_stops_is_heard_so() {
        // From 2.2 Hz to 1.2 Hz, two beats lost, and none behind 20 s.
        let fast = (0..22).map(|k| f64::from(k) / 2.2);
        let slow = (0..12).map(|k| 10.0 + f64::from(k) / 1.2);
        let all: Vec<f64> = fast.chain(slow).collect();
        let heard: Vec<f64> = (all.iter().copied())
            .filter(|t| ![4.0, 15.0].iter().any(|lost| (t - lost).abs() < 0.4))
            .collect();
        assert_eq!(heard.len(), all.len() - 3);
        let music = follow(&Music::default(), &heard, 0.0, 30.0).unwrap();
        let strokes = beat(&music).strokes(30.0);
        assert_eq!(strokes.len(), all.len());
        for (stroke, t) in strokes.iter().zip(&all) {
            assert!((stroke.t_s - t).abs() < 1e-9, "{} {t}", stroke.t_s);
        }
        let [pause] = music.pauses[..] else {
            panic!("{:?}", music.pauses)
        };
        let last_s = all[all.len() - 1];
        assert!((pause.from_s - last_s - 0.5 / 1.2).abs() < 1e-9 && pause.to_s == 30.0);
    }
}

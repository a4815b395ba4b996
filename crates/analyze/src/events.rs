//! What happened when: contact lost and regained, jumps, the beat, the onset of instability.

use std::f64::consts::TAU;

use crate::beat::adler::turns::Turns;
use crate::inputs::{Inputs, Window, finite, stretches};
use crate::metrics::Context;
use crate::phase;

/// One event.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Event {
    /// When (s) after the recording's first message.
    pub t_s: f64,
    /// `onset`, `contact_lost`, `contact_regained`, `jump`, `beat_start`, `locked`, `gap`, ...
    pub kind: &'static str,
    /// One line for people.
    pub what: String,
}

/// Mean order parameter from which a stretch of [`LOCK_STRETCH_S`] counts as locked.
const LOCKED: f64 = 0.95;
/// Length of a stretch judged for locking (s).
const LOCK_STRETCH_S: f64 = 5.0;
/// The tempo is that of the beat's first so many seconds (s).
const TEMPO_S: f64 = 10.0;
/// A beat has ended when none comes for so many beats.
const AWAITED: f64 = 1.5;
/// The support below this share of the weight is a jump's flight.
const FLIGHT: f64 = crate::metrics::FLOAT_SHARE;

/// Every event of a run, in order of time.
///
/// Contact, jumps, beat and locking are looked for in the whole run (what is before the window is part of its story); the onset, like its
/// metric, inside `window`.
pub fn events(inputs: &Inputs, window: Window) -> Vec<Event> {
    let context = Context::new(inputs, window);
    let mut out = Vec::new();
    contact(inputs, &mut out);
    jumps(&context, &mut out);
    beat(inputs, &mut out);
    locking(inputs, &mut out);
    if let Some(t_s) = context.onset() {
        out.push(Event {
            t_s,
            kind: "onset",
            what: "RMS roll of the last 2 s exceeds 10° for the first time".into(),
        });
    }
    out.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
    out
}

/// A handle's force falls to 0, or rises above it again. The first sample is no event, nor is that behind a hole, and a tied handle never lets go.
fn contact(inputs: &Inputs, out: &mut Vec<Event>) {
    if inputs.pulled_n().is_some() {
        return;
    }
    for (handle, force) in inputs.normal_n.iter().enumerate() {
        let (t_s, force) = finite(inputs.force_times(), force);
        for part in stretches(&t_s, 0.0) {
            of_stretch(handle, &t_s[part.clone()], &force[part], out);
        }
    }
}

/// The same of one handle in a stretch without a hole.
fn of_stretch(handle: usize, t_s: &[f64], force_n: &[f64], out: &mut Vec<Event>) {
    let mut held: Option<bool> = None;
    for (t_s, n) in t_s.iter().zip(force_n) {
        let holds = *n > 0.0;
        if held.is_some_and(|h| h != holds) {
            let number = handle + 1;
            out.push(match holds {
                true => Event {
                    t_s: *t_s,
                    kind: "contact_regained",
                    what: format!("handle {number} presses with {n:.*} N", decimals(*n)),
                },
                false => Event {
                    t_s: *t_s,
                    kind: "contact_lost",
                    what: format!("handle {number} goes slack"),
                },
            });
        }
        held = Some(holds);
    }
}

/// Decimals that show two digits of a positive number or more.
fn decimals(x: f64) -> usize {
    // OK because it is clamped, and zero decimals are right where it is no number.
    (1.0 - x.log10().floor()).clamp(0.0, 9.0) as usize
}

/// Stretches of at least two samples in which next to nothing holds the weight.
fn jumps(c: &Context, out: &mut Vec<Event>) {
    let inputs = c.inputs;
    let (t_s, ratio) = if inputs.normal_n.is_empty() {
        (&inputs.t_s[..], inputs.support_ratio.clone())
    } else {
        // What tells no weight tells no jump.
        let (total_n, Ok(weight_n)) = (inputs.total_force_n(), c.weight_n()) else {
            return;
        };
        let ratio = total_n.iter().map(|n| n / weight_n).collect();
        (inputs.force_times(), ratio)
    };
    if ratio.len() != t_s.len() {
        return;
    }
    // What a sensor feels passes the threshold between samples; a recorded force is counted as the metrics count it.
    let passes = |k: usize| match inputs.normal_n.is_empty() {
        true => {
            t_s[k - 1] + (t_s[k] - t_s[k - 1]) * (ratio[k - 1] - FLIGHT) / (ratio[k - 1] - ratio[k])
        }
        false => t_s[k],
    };
    // None goes on through a hole.
    for stretch in stretches(t_s, 0.0) {
        let last = stretch.end - 1;
        let mut start: Option<usize> = None;
        for k in stretch.start..=stretch.end {
            let flies = k < stretch.end && ratio[k] <= FLIGHT;
            match (start, flies) {
                (None, true) => start = Some(k),
                (Some(from), false) => {
                    if k - from >= 2 {
                        let begins_s = match from > stretch.start && ratio[from - 1].is_finite() {
                            true => passes(from),
                            false => t_s[from],
                        };
                        let ends_s = match k <= last && ratio[k].is_finite() {
                            true => passes(k),
                            false => t_s[k.min(last)],
                        };
                        let mean = ratio[from..k].iter().sum::<f64>() / (k - from) as f64;
                        let how = match mean < -FLIGHT {
                            true => "it is pulled down",
                            false => "next to nothing holds it",
                        };
                        out.push(Event {
                            t_s: begins_s,
                            kind: "jump",
                            what: format!("{how} for {:.2} s", ends_s - begins_s),
                        });
                    }
                    start = None;
                }
                _ => {}
            }
        }
    }
}

fn beat(inputs: &Inputs, out: &mut Vec<Event>) {
    let (t_s, psi) = (inputs.phase_times(), &inputs.beat_phase_rad);
    let n = psi.len().min(t_s.len());
    let (t_s, psi) = (&t_s[..n], &psi[..n]);
    let ends_s = t_s.last().copied().unwrap_or_default();
    let mut start = 0;
    for sounding in psi.chunk_by(|a, b| a.is_finite() == b.is_finite()) {
        let (from, to) = (start, start + sounding.len());
        start = to;
        if !sounding[0].is_finite() {
            continue;
        }
        let times_s = &t_s[from..to];
        let early = times_s.partition_point(|t| *t <= t_s[from] + TEMPO_S);
        let begins = match from {
            0 => "is there from the first sample on",
            _ => "begins",
        };
        let what = tempo_hz(&times_s[..early], &sounding[..early])
            .map_or(format!("a beat {begins}"), |hz| {
                format!("a beat of {hz:.3} Hz {begins}")
            });
        out.push(Event {
            t_s: t_s[from],
            kind: "beat_start",
            what,
        });
        if to == n {
            continue;
        }
        let late = times_s.partition_point(|t| *t < t_s[to - 1] - TEMPO_S);
        let last_beat_s = tempo_hz(&times_s[late..], &sounding[late..]).map_or(0.0, |hz| 1.0 / hz);
        // Where the recording ends before another beat was due, the beat may go on.
        if !(ends_s - t_s[to] < AWAITED * last_beat_s) {
            out.push(Event {
                t_s: t_s[to],
                kind: "beat_end",
                what: "the beat ends".into(),
            });
        }
    }
}

/// Tempo of a beat by its advance from the first sample to the last (Hz); `None` where the samples do not tell how often it turns between them.
fn tempo_hz(t_s: &[f64], psi_rad: &[f64]) -> Option<f64> {
    let turns = Turns::of(t_s, psi_rad);
    let each = t_s.windows(2).zip(psi_rad.windows(2));
    let turned: f64 = each
        .map(|(t, x)| turns.over(t[1] - t[0], x[1] - x[0]))
        .sum();
    let hz = turned / TAU / (t_s.last()? - t_s.first()?);
    (hz > 0.0 && hz.is_finite() && !turns.folded()).then_some(hz)
}

/// The end of the first stretch of 5 s whose mean r exceeds 0.95, if an earlier stretch was looser.
fn locking(inputs: &Inputs, out: &mut Vec<Event>) {
    let phases: Vec<&[f64]> = inputs.phase_rad.iter().map(|p| &p[..]).collect();
    if phases.len() < 2 {
        return;
    }
    let t_s = inputs.phase_times();
    let r = phase::order_parameter(&phases);
    let Some(step_s) = crate::inputs::mean_step_s(t_s) else {
        return;
    };
    let m = ((LOCK_STRETCH_S / step_s).round() as usize).max(1);
    let (mut sum, mut first) = (0.0, 0);
    let mut loose = false;
    // Behind a hole the stretch begins anew, as where somebody's phase is not known.
    let begin: Vec<usize> = stretches(t_s, 0.0).iter().map(|s| s.start).collect();
    for k in 0..r.len().min(t_s.len()) {
        if begin.binary_search(&k).is_ok() {
            (sum, first) = (0.0, k);
        }
        if !r[k].is_finite() {
            (sum, first) = (0.0, k + 1);
            continue;
        }
        sum += r[k];
        if k >= first + m {
            sum -= r[k - m];
        }
        if k + 1 < first + m {
            continue;
        }
        let mean = sum / m as f64;
        if mean > LOCKED && loose {
            let what = format!(
                "the carriers walk together: mean r of the last {LOCK_STRETCH_S:.0} s exceeds {LOCKED}"
            );
            out.push(Event {
                t_s: t_s[k],
                kind: "locked",
                what,
            });
            return;
        }
        loose |= mean <= LOCKED;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What was held before a hole and is slack behind it went slack nobody knows when.
    #[test]
    fn what_one_handle_did_while_it_was_not_seen_is_no_event() {
        let t_s: Vec<f64> = (0..600).map(|k| f64::from(k) / 30.0).collect();
        let right = t_s.iter().map(|t| match t {
            5.0..10.0 => f64::NAN,
            10.0..12.0 => 0.0,
            _ => 300.0,
        });
        let inputs = Inputs {
            normal_n: vec![vec![300.0; 600], right.collect()],
            t_s,
            ..Inputs::default()
        };
        let found = events(&inputs, Window::ALL);
        let contacts: Vec<_> = found
            .iter()
            .filter(|e| e.kind.starts_with("contact"))
            .collect();
        assert_eq!(contacts.len(), 1, "{contacts:?}");
        assert_eq!(
            (contacts[0].kind, contacts[0].t_s),
            ("contact_regained", 12.0)
        );
    }

    #[test]
    fn a_hop_is_told_as_it_happened() {
        let n = 100;
        let inputs = Inputs {
            t_s: (0..n).map(|k| k as f64 / 10.0).collect(),
            normal_n: vec![
                (0..n)
                    .map(|k| if (20..25).contains(&k) { 0.0 } else { 300.0 })
                    .collect(),
                (0..n)
                    .map(|k| if (22..24).contains(&k) { 0.0 } else { 300.0 })
                    .collect(),
            ],
            beat_phase_rad: (0..n)
                .map(|k| if k < 50 { f64::NAN } else { k as f64 * 1.2 })
                .collect(),
            mass_kg: Some(60.0),
            ..Inputs::default()
        };
        // Without a mass the mean support is the weight.
        let unweighed = Inputs {
            mass_kg: None,
            ..inputs.clone()
        };
        assert_eq!(
            events(&unweighed, Window::ALL),
            events(&inputs, Window::ALL)
        );
        let told: Vec<(f64, &str)> = events(&inputs, Window::ALL)
            .iter()
            .map(|e| (e.t_s, e.kind))
            .collect();
        assert_eq!(
            told,
            [
                (2.0, "contact_lost"),
                (2.2, "contact_lost"),
                (2.2, "jump"),
                (2.4, "contact_regained"),
                (2.5, "contact_regained"),
                (5.0, "beat_start")
            ]
        );
    }

    /// A load thrown at 2 Hz: what a sensor feels passes a twentieth of the weight 73 and 177 ms behind each half second, wherever its samples fall.
    #[test]
    fn a_jump_that_a_sensor_feels_begins_and_ends_between_samples() {
        let ratio = |t: &f64| 1.0 - 1.2 * (TAU * 2.0 * t).sin();
        let passes_s = (0.95f64 / 1.2).asin() / TAU / 2.0;
        for shift in [0.0, 0.3, 0.7] {
            let t_s: Vec<f64> = (0..200).map(|k| 0.01 * (f64::from(k) + shift)).collect();
            let inputs = Inputs {
                support_ratio: t_s.iter().map(ratio).collect(),
                t_s,
                ..Inputs::default()
            };
            let jumps = events(&inputs, Window::ALL);
            assert_eq!(jumps.len(), 4, "{jumps:?}");
            for (k, jump) in jumps.iter().enumerate() {
                let off_s = jump.t_s - 0.5 * k as f64 - passes_s;
                assert!(off_s.abs() < 5e-4, "{shift}: {jump:?} {passes_s}");
                assert!(jump.what.ends_with("for 0.10 s"), "{jump:?}");
            }
        }
    }

    /// 2.15 Hz: unwrapped at a sample a second, wrapped at 30 Hz with steps that scatter, and wrapped at a sample a second, which tells no tempo.
    #[test]
    fn a_beat_begins_with_its_tempo() {
        let at = |t: &f64| TAU * 2.15 * t;
        let told = |t_s: Vec<f64>, phase: fn(f64) -> f64| -> Vec<String> {
            let psi = t_s.iter().map(|t| match *t {
                t if t < 10.0 => f64::NAN,
                t => phase(at(&t)),
            });
            let inputs = Inputs {
                beat_phase_rad: psi.collect(),
                phase_t_s: t_s,
                ..Inputs::default()
            };
            let told = events(&inputs, Window::ALL).into_iter();
            told.map(|e| e.what).collect()
        };
        let slow = || (0..120).map(f64::from).collect();
        let loose = (0..1800).map(|k| f64::from(k) / 30.0 + 0.015 * f64::from(7 * k % 11) / 11.0);
        let begins = "a beat of 2.150 Hz begins";
        assert_eq!(told(slow(), |x| x), [begins]);
        assert_eq!(told(loose.collect(), phase::wrap), [begins]);
        assert_eq!(told(slow(), phase::wrap), ["a beat begins"]);
        let late = (10..60).map(f64::from).collect();
        let there = "a beat of 2.150 Hz is there from the first sample on";
        assert_eq!(told(late, |x| x), [there]);
    }

    /// Of two handles one lets go within a hole, and is held again behind it.
    #[test]
    fn what_happened_in_a_hole_is_no_event_behind_it() {
        let seen = (0..300).map(|k| f64::from(k) / 30.0);
        let t_s: Vec<f64> = seen.filter(|t| !(4.0..6.0).contains(t)).collect();
        let force = |t: &f64| match *t {
            t if (5.0..8.0).contains(&t) => 0.0,
            _ => 300.0,
        };
        let inputs = Inputs {
            normal_n: vec![t_s.iter().map(force).collect(), vec![300.0; t_s.len()]],
            t_s,
            ..Inputs::default()
        };
        let events = events(&inputs, Window::ALL);
        let told: Vec<(f64, &str)> = events.iter().map(|e| (e.t_s, e.kind)).collect();
        assert_eq!(told, [(8.0, "contact_regained")]);
    }

    #[test]
    fn a_tied_load_that_is_pulled_down_is_told_so() {
        let told = |least_n: f64| {
            let force = |k| {
                if (20..25).contains(&k) {
                    least_n
                } else {
                    300.0
                }
            };
            let inputs = Inputs {
                t_s: (0..100).map(|k| f64::from(k) / 10.0).collect(),
                normal_n: vec![(0..100).map(force).collect(); 2],
                mass_kg: Some(60.0),
                ..Inputs::default()
            };
            let mut events = events(&inputs, Window::ALL).into_iter();
            events.find(|e| e.kind == "jump").unwrap().what
        };
        assert_eq!(told(-500.0), "it is pulled down for 0.50 s");
        assert_eq!(told(0.0), "next to nothing holds it for 0.50 s");
    }

    /// Loose up to 20 s, together from there on, but nothing is known from 23 s to 43 s.
    #[test]
    fn nobody_walks_together_through_a_hole() {
        let seen = (0..1800).map(|k| f64::from(k) / 30.0);
        let t_s: Vec<f64> = seen.filter(|t| !(23.0..43.0).contains(t)).collect();
        let inputs = Inputs {
            phase_rad: vec![
                t_s.iter().map(|t| 12.0 * t).collect(),
                t_s.iter()
                    .map(|t| 12.0 * t + 1.3 * (t - 20.0).min(0.0))
                    .collect(),
            ],
            t_s,
            ..Inputs::default()
        };
        let events = events(&inputs, Window::ALL);
        assert_eq!(events.len(), 1, "{events:?}");
        // 5 s behind the hole.
        assert!((events[0].t_s - 48.0).abs() < 0.05, "{events:?}");
    }

    #[test]
    fn carriers_that_fall_into_step_are_noticed_once() {
        let t_s: Vec<f64> = (0..600).map(|k| k as f64 / 30.0).collect();
        let inputs = Inputs {
            phase_rad: vec![
                t_s.iter().map(|t| 12.0 * t).collect(),
                t_s.iter().map(|t| 12.0 * t + (10.0 - t).max(0.0)).collect(),
            ],
            t_s,
            ..Inputs::default()
        };
        let mut late = inputs.clone();
        late.phase_rad[0][..45].fill(f64::NAN);
        for inputs in [inputs, late] {
            let events = events(&inputs, Window::ALL);
            assert_eq!(events.len(), 1);
            assert!(
                events[0].kind == "locked" && (11.0..15.0).contains(&events[0].t_s),
                "{events:?}"
            );
        }
    }
}

//! How carriers and body stand to the beat: lead or lag, detuning, pull and capture, p:q locking of the roll.

use super::contact::mean;
use super::{Context, Value};
use crate::beat::adler::turns::{FOLDED, Turns};
use crate::beat::adler::{Adler, VAGUE_RAD_PER_S};
use crate::beat::lock::RATIOS;
use crate::inputs::between;
use crate::phase::{Circular, circular, hilbert, relative_phase, unwrap};
use std::f64::consts::TAU;

/// A relative phase of this resultant or more stays.
const STAYS: f64 = 0.9;
/// A relative phase of a smaller resultant has no mean worth a name: beside it the phase is anywhere.
const FOLLOWS: f64 = 0.5;
/// The analytic signal knows no phase so near its ends, s.
const ENDS_S: f64 = 2.0;
/// Any two rhythms keep step for a shorter time than this, s.
const SHORTEST_S: f64 = 8.0;

/// φ_j − ψ of every carrier, over the part of the window in which a beat sounds.
pub(super) fn carriers(c: &Context) -> Vec<Circular> {
    let table = c.beat();
    let (beat, carriers) = (&table.columns[0], &table.columns[1..]);
    let to_beat = |p: &std::borrow::Cow<[f64]>| relative_phase(p, beat, 1.0, 1.0);
    carriers.iter().filter_map(to_beat).collect()
}

pub fn beat_lead_deg(c: &Context) -> Value {
    let all = carriers(c);
    if all.is_empty() {
        return Value::missing("no carrier's phase in the window");
    }
    let follow = |p: &&Circular| p.resultant >= FOLLOWS;
    let leads = all.iter().filter(follow).map(|p| p.mean_rad);
    let resultants: Vec<String> = all.iter().map(|p| format!("{:.2}", p.resultant)).collect();
    let resultants = resultants.join(", ");
    let Some(lead) = circular(leads.clone()) else {
        return Value::missing(format!(
            "no carrier follows the beat: |⟨exp(i(φ_j − ψ))⟩| = {resultants}"
        ));
    };
    let left_out = leads.count() < all.len();
    Value {
        reason: left_out.then(|| {
            format!(
                "of those who follow the beat, by at least {FOLLOWS}: |⟨exp(i(φ_j − ψ))⟩| = {resultants}"
            )
        }),
        ..Value::number(lead.mean_rad.to_degrees())
            .per(all.iter().map(|p| p.mean_rad.to_degrees()).collect())
    }
}

pub fn detuning_rad_per_s(c: &Context) -> Value {
    let found = match c.adler() {
        Ok(found) => found,
        Err(why) => return Value::missing(*why),
    };
    let (each, halves) = (&found.detuning_rad_per_s, &found.detuning_half_rad_per_s);
    if halves.iter().any(|half| !(*half <= VAGUE_RAD_PER_S)) {
        return Value::missing(
            "nobody saw how the carriers came to the beat: who is with it does not show what they would do alone",
        );
    }
    let intervals = || format!("each carrier's: {}", with_intervals(found));
    Value {
        reason: found.strained().or_else(|| Some(intervals())),
        ..Value::number(mean(each)).per(each.clone())
    }
}

/// Every Δω with half its 95 % interval.
fn with_intervals(found: &Adler) -> String {
    let each = found.detuning_rad_per_s.iter();
    let each = each.zip(&found.detuning_half_rad_per_s);
    let words: Vec<String> = each
        .map(|(d, half)| format!("{d:.3} ± {half:.3}"))
        .collect();
    words.join(", ")
}

pub fn pull_rad_per_s(c: &Context) -> Value {
    let found = match c.adler() {
        Ok(found) => found,
        Err(why) => return Value::missing(*why),
    };
    let [low, high] = found.pull_ci95_rad_per_s;
    if high.is_infinite() {
        return Value::missing(match low > 0.0 {
            true => format!(
                "at least {low:.2} rad/s (95 %): a stronger pull would show the same phases"
            ),
            false => "the phases go with no pull as with any".to_owned(),
        });
    }
    if let Some(why) = found.strained() {
        return Value {
            reason: Some(why),
            ..Value::number(found.pull_rad_per_s)
        };
    }
    Value {
        reason: Some(format!(
            "grows in τ = {:.1} s; phase noise {:.4} rad/√s",
            found.build_up_s, found.noise_rad_per_sqrt_s,
        )),
        ..Value::number(found.pull_rad_per_s).ci95(low, high)
    }
}

pub fn coupling_rad_per_s(c: &Context) -> Value {
    let found = match c.adler() {
        Ok(found) => found,
        Err(why) => return Value::missing(*why),
    };
    let Some([strength, half]) = found.coupling_rad_per_s else {
        return Value::missing("one carrier alone minds no other");
    };
    let [low, high] = [strength - half, strength + half];
    if half > VAGUE_RAD_PER_S {
        return Value::missing(format!(
            "anything from {low:.1} to {high:.1} rad/s goes with the phases (95 %)"
        ));
    }
    if let Some(why) = found.strained() {
        return Value {
            reason: Some(why),
            ..Value::number(strength)
        };
    }
    let none = low <= 0.0 && high >= 0.0;
    Value {
        reason: none.then(|| "none is seen: 0 is within".to_owned()),
        ..Value::number(strength).ci95(low, high)
    }
}

/// Whether a relative phase runs through a whole turn.
fn slips(phi: &[f64], psi: &[f64]) -> bool {
    let relative: Vec<f64> = phi.iter().zip(psi).map(|(a, b)| a - b).collect();
    let range = unwrap(&relative)
        .into_iter()
        .fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
    range.1 - range.0 >= TAU
}

pub fn captured(c: &Context) -> Value {
    let table = c.beat();
    let (beat, phases) = (&table.columns[0], &table.columns[1..]);
    let stays = !phases.is_empty()
        && carriers(c).iter().all(|p| p.resultant >= STAYS)
        && !phases.iter().any(|phi| slips(phi, beat));
    let tested = c.adler().as_ref().ok().and_then(|a| Some((a, a.inside()?)));
    let Some((found, inside)) = tested else {
        return Value::bool(stays);
    };
    if let Some(why) = found.strained() {
        return Value {
            reason: Some(format!("by the phases alone: {why}")),
            ..Value::bool(stays)
        };
    }
    let [low, high] = found.pull_ci95_rad_per_s;
    Value {
        reason: Some(format!(
            "Δω = {} rad/s, {} the capture range of K = {:.2} ({low:.2} … {high:.2}) rad/s",
            with_intervals(found),
            if inside { "inside" } else { "not all inside" },
            found.pull_rad_per_s,
        )),
        ..Value::bool(stays && inside)
    }
}

pub fn roll_lock(c: &Context) -> Value {
    let (i, roll) = (c.inputs, c.roll());
    let (times, beat): (Vec<f64>, Vec<f64>) = i
        .phase_times()
        .iter()
        .zip(&i.beat_phase_rad)
        .filter(|(_, b)| b.is_finite())
        .map(|(t, b)| (*t, *b))
        .unzip();
    let (Some(first), Some(last)) = (times.first(), times.last()) else {
        return Value::missing("no beat in the window");
    };
    let level = mean(&roll.x);
    let swing: Vec<f64> = roll.x.iter().map(|x| x - level).collect();
    let phase: Vec<f64> = hilbert(&swing).iter().map(|z| z.im.atan2(z.re)).collect();
    let (from, to) = match (roll.t_s.first(), roll.t_s.last()) {
        (Some(a), Some(b)) => (first.max(a + ENDS_S), last.min(b - ENDS_S)),
        _ => (0.0, 0.0),
    };
    if to - from < SHORTEST_S {
        return Value::missing(format!(
            "roll and beat share less than {SHORTEST_S} s of the window"
        ));
    }
    let inside = roll.t_s.partition_point(|t| *t < from)..roll.t_s.partition_point(|t| *t <= to);
    let phi = unwrap(&phase[inside.clone()]);
    // Where the beat pauses there is nothing to be in step with.
    let turns = Turns::of(&times, &beat);
    if turns.folded() {
        return Value::missing(FOLDED);
    }
    let straight = turns.straightened(&times, &beat);
    let psi = between(&times, &straight, &roll.t_s[inside]);
    let (phi, psi): (Vec<f64>, Vec<f64>) = phi
        .into_iter()
        .zip(psi)
        .filter(|(_, psi)| psi.is_finite())
        .unzip();
    if phi.len() as f64 * roll.step_s().unwrap_or(0.0) < SHORTEST_S {
        return Value::missing(format!(
            "a beat sounds for less than {SHORTEST_S} s of the roll"
        ));
    }
    let firm = |p: u32, q: u32| {
        relative_phase(&phi, &psi, p.into(), q.into()).map_or(0.0, |found| found.resultant)
    };
    let mut found = RATIOS.map(|(p, q)| (p, q, firm(p, q)));
    found.sort_by(|a, b| b.2.total_cmp(&a.2));
    let each: Vec<String> = found
        .iter()
        .map(|(p, q, resultant)| format!("{q}:{p} {resultant:.3}"))
        .collect();
    let word = match found[0] {
        (.., resultant) if resultant < STAYS => "none",
        (1, 1, _) => "1:1",
        (2, 1, _) => "1:2",
        (1, 2, _) => "2:1",
        (3, 2, _) => "2:3",
        _ => "3:2",
    };
    Value::word(
        word,
        format!("|⟨exp(i(pφ − qψ))⟩| of q:p: {}", each.join(", ")),
    )
}

#[cfg(test)]
mod tests {
    use crate::inputs::{Inputs, Window};
    use crate::metrics::{Metrics, metrics};
    use std::f64::consts::TAU;

    /// Two carriers 30° and 50° ahead of a beat of 2 Hz, a body that rolls at `roll_hz`.
    fn walk(roll_hz: f64, slip_hz: f64) -> Inputs {
        let t_s: Vec<f64> = (0..1800).map(|k| f64::from(k) / 30.0).collect();
        let of = |hz: f64, ahead: f64| -> Vec<f64> {
            t_s.iter().map(|t| TAU * hz * t + ahead).collect()
        };
        Inputs {
            roll_rad: t_s
                .iter()
                .map(|t| 0.2 * (TAU * roll_hz * t + 1.0).sin())
                .collect(),
            phase_rad: vec![
                of(2.0 + slip_hz, 30f64.to_radians()),
                of(2.0, 50f64.to_radians()),
            ],
            beat_phase_rad: of(2.0, 0.0),
            t_s,
            ..Inputs::default()
        }
    }

    /// A beat of 2 Hz and a roll at half of it, seen too seldom, or for too short between pauses; and one that begins again behind a pause.
    #[test]
    fn what_is_seen_too_seldom_or_too_briefly_is_locked_to_nothing() {
        let of = |rate_hz: f64, sounds: fn(f64) -> bool, anew_s: f64| {
            let t_s: Vec<f64> = (0..(60.0 * rate_hz) as u32)
                .map(|k| f64::from(k) / rate_hz)
                .collect();
            let psi = |t: f64| TAU * 2.0 * if t < anew_s { t } else { t - anew_s };
            let beat = t_s
                .iter()
                .map(|t| if sounds(*t) { psi(*t) } else { f64::NAN });
            let inputs = Inputs {
                beat_phase_rad: beat.collect(),
                roll_rad: t_s.iter().map(|t| 0.2 * (TAU * t + 1.0).sin()).collect(),
                phase_rad: vec![t_s.iter().map(|t| TAU * 2.0 * t).collect()],
                t_s,
                ..Inputs::default()
            };
            metrics(&inputs, Window::ALL)
        };
        let seldom = of(1.7, |_| true, 60.0);
        for name in ["roll_lock", "roll_peak_hz"] {
            let found = seldom.get(name).unwrap();
            let why = found.reason.as_deref().unwrap();
            assert!(
                why.contains("too few for a motion at the beat's 2.00 Hz"),
                "{why}"
            );
        }
        let brief = of(
            30.0,
            |t| (10.0..12.5).contains(&t) || (45.0..48.0).contains(&t),
            60.0,
        );
        let why = brief.get("roll_lock").unwrap().reason.clone().unwrap();
        assert!(why.contains("for less than 8 s"), "{why}");
        let again = of(4.5, |t| !(30.0..40.0).contains(&t), 40.0);
        assert_eq!(again.get("roll_lock").unwrap().as_word(), Some("1:2"));
        assert!((again.number("beat_hz").unwrap() - 2.0).abs() < 1e-9);
    }

    #[test]
    fn a_roll_at_half_the_beat_is_locked_one_to_two() {
        for (hz, word) in [(1.0, "1:2"), (2.0, "1:1"), (3.0, "3:2"), (1.13, "none")] {
            let m = metrics(&walk(hz, 0.0), Window::from(10.0));
            assert_eq!(m.get("roll_lock").unwrap().as_word(), Some(word), "{hz} Hz");
        }
        let m = metrics(
            &walk(1.0, 0.0),
            Window {
                start_s: 10.0,
                end_s: 20.0,
            },
        );
        assert!(m.get("roll_lock").unwrap().reason.is_some());
        assert_eq!(m.get("roll_lock").unwrap().as_word(), None);
    }

    /// One follows, one walks 0.3 Hz faster: the lead is the first's.
    #[test]
    fn who_does_not_follow_the_beat_has_no_lead() {
        let mut inputs = walk(1.0, 0.3);
        inputs.phase_rad.swap(0, 1);
        let lead = |inputs: &Inputs| {
            metrics(inputs, Window::ALL)
                .get("beat_lead_deg")
                .unwrap()
                .clone()
        };
        let found = lead(&inputs);
        assert!((found.as_f64().unwrap() - 50.0).abs() < 1e-6, "{found:?}");
        assert!(found.reason.unwrap().starts_with("of those who follow"));
        inputs.phase_rad.swap_remove(0);
        let found = lead(&inputs);
        assert_eq!(found.as_f64(), None);
        assert!(found.reason.unwrap().contains("no carrier follows"));
    }

    /// 2 Hz told 3.75 times a second, as it goes on: from one message to the next it turns by more than half.
    #[test]
    fn a_beat_that_comes_unwrapped_may_come_seldom() {
        let mut inputs = walk(3.0, 0.0);
        let every = |x: &[f64]| x.iter().copied().step_by(8).collect::<Vec<f64>>();
        inputs.phase_t_s = every(&inputs.t_s);
        inputs.beat_phase_rad = every(&inputs.beat_phase_rad);
        inputs.phase_rad = inputs.phase_rad.iter().map(|p| every(p)).collect();
        let m = metrics(&inputs, Window::from(10.0));
        assert_eq!(m.get("roll_lock").unwrap().as_word(), Some("3:2"));
    }

    #[test]
    fn carriers_ahead_of_the_beat_lead_it_and_those_who_slip_are_not_captured() {
        let m = metrics(&walk(1.0, 0.0), Window::ALL);
        let lead = m.get("beat_lead_deg").unwrap();
        assert!((lead.as_f64().unwrap() - 40.0).abs() < 1e-6);
        assert!((lead.per[0] - 30.0).abs() < 1e-6 && (lead.per[1] - 50.0).abs() < 1e-6);
        assert_eq!(m.get("captured").unwrap().as_bool(), Some(true));
        let slips = metrics(&walk(1.0, 0.05), Window::ALL);
        assert_eq!(slips.get("captured").unwrap().as_bool(), Some(false));
    }

    #[test]
    fn one_carrier_stands_to_the_beat_but_not_in_step() {
        let mut alone = walk(1.0, 0.0);
        alone.phase_rad.truncate(1);
        let m = metrics(&alone, Window::ALL);
        assert!((m.number("beat_lead_deg").unwrap() - 30.0).abs() < 1e-6);
        for name in ["synchrony", "synchrony_chance", "plv"] {
            let value = m.get(name).unwrap();
            assert!(value.as_f64().is_none() && value.reason.is_some(), "{name}");
        }
    }

    /// Two carriers of their own frequencies who mind nobody, pulled from 10 s on: Adler's equation by small steps.
    fn pulled(pulls: [f64; 2], detuning: [f64; 2], noise_rad_per_sqrt_s: f64) -> Inputs {
        let mut random = crate::random::Random(11);
        let (dt, omega) = (1.0 / 300.0, TAU * 2.0);
        let mut inputs = walk(1.0, 0.0);
        let mut phase = [0.3, 2.0];
        inputs.phase_rad = vec![vec![], vec![]];
        for k in 0..18_000 {
            let t = f64::from(k) * dt;
            for c in 0..2 {
                if k % 10 == 0 {
                    inputs.phase_rad[c].push(phase[c]);
                }
                let heard = if t < 10.0 { 0.0 } else { pulls[c] };
                phase[c] += dt * (omega + detuning[c] + heard * (omega * t - phase[c]).sin());
                phase[c] += noise_rad_per_sqrt_s * f64::sqrt(dt) * random.normal();
            }
        }
        inputs.beat_phase_rad[..300].fill(f64::NAN);
        inputs
    }

    /// One K for all, where the beat pulls one carrier and not the other, would come out in between, with an interval as narrow as ever.
    #[test]
    fn a_pull_that_is_not_the_same_for_all_is_said() {
        for (pulls, same) in [([1.5, 1.5], true), ([1.5, 1.0], false), ([1.5, 0.0], false)] {
            let m = metrics(&pulled(pulls, [0.5, -0.7], 0.02), Window::ALL);
            for name in ["pull_rad_per_s", "coupling_rad_per_s", "detuning_rad_per_s"] {
                let found = m.get(name).unwrap();
                let why = found.reason.as_deref().unwrap_or_default();
                assert_eq!(
                    !why.contains("do more than follow"),
                    same,
                    "{pulls:?} {name}: {found:?}"
                );
                assert!(same || found.ci95.is_none(), "{pulls:?} {name}: {found:?}");
            }
        }
    }

    #[test]
    fn adlers_test_uses_what_was_before_the_window() {
        let late = Window::from(40.0);
        let inside = metrics(&pulled([1.5; 2], [0.5, -0.9], 0.0), late);
        let number = |m: &Metrics, name: &str| m.number(name).unwrap();
        let pull = number(&inside, "pull_rad_per_s");
        assert!(
            (pull - 1.5).abs() < 0.05,
            "{:?}",
            inside.get("pull_rad_per_s")
        );
        assert!((number(&inside, "detuning_rad_per_s") + 0.2).abs() < 0.002);
        let detuning = inside.get("detuning_rad_per_s").unwrap();
        assert!((detuning.per[0] - 0.5).abs() < 0.003);
        assert_eq!(inside.get("captured").unwrap().as_bool(), Some(true));
        // At the edge a carrier waits for most of each slow turn: together with the beat, but not captured.
        let outside = pulled([0.5; 2], [0.505, 0.1], 0.0);
        let dwelling = Window {
            start_s: 25.0,
            end_s: 40.0,
        };
        assert!(
            metrics(&outside, dwelling)
                .number("beat_synchrony")
                .unwrap()
                > 0.9
        );
        for window in [late, dwelling] {
            let m = metrics(&outside, window);
            assert_eq!(m.get("captured").unwrap().as_bool(), Some(false));
            assert!((number(&m, "pull_rad_per_s") - 0.5).abs() < 0.01);
        }
    }

    #[test]
    fn without_a_beginning_there_is_no_pull_but_a_reason() {
        let m = metrics(&walk(1.0, 0.0), Window::ALL);
        for name in ["pull_rad_per_s", "detuning_rad_per_s"] {
            assert!(m.get(name).unwrap().reason.is_some(), "{name}");
            assert_eq!(m.number(name), None, "{name}");
        }
    }
}

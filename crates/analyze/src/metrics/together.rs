//! How together the carriers are.

use super::beat::carriers;
use super::contact::mean;
use super::{Context, Value};
use crate::beat::adler::turns::{FOLDED, Turns};
use crate::inputs::{mean_step_s, stretches};
use crate::phase;
use crate::steps::rate_of;
use std::f64::consts::TAU;

/// How many surrogates the chance level of measured phases is made from.
const SURROGATES: usize = 400;

const ALONE: &str = "one carrier alone is always in step";

/// A phase that is always so near to its mean stands still (rad).
const STILL_RAD: f64 = 0.01;
/// So long nobody who walks stands still, and seldomer nobody sees a step (s).
const STILL_S: f64 = 2.0;
const SEEN_S: f64 = 0.25;

/// Whoever stands still keeps step with all others who do, whatever they would do when they walk.
fn standing(t_s: &[f64], phases: &[&[f64]]) -> Option<String> {
    let span_s = t_s.last()? - t_s[0];
    if span_s < STILL_S || mean_step_s(t_s)? > SEEN_S {
        return None;
    }
    let still = |x: &&&[f64]| {
        let mean = phase::circular(x.iter().copied()).map_or(f64::NAN, |all| all.mean_rad);
        x.iter().all(|x| phase::wrap(x - mean).abs() < STILL_RAD)
    };
    let count = phases.iter().filter(still).count();
    (count > 1).then(|| {
        let of = phases.len();
        format!(
            "the phases of {count} of {of} carriers stand still: how these keep step says nothing"
        )
    })
}

pub fn synchrony(c: &Context) -> Value {
    match &c.phases().slices()[..] {
        [_] => Value::missing(ALONE),
        phases => Value::number(mean(&phase::order_parameter(phases)))
            .remark(standing(&c.phases().t_s, phases)),
    }
}

pub fn synchrony_chance(c: &Context) -> Value {
    let phases = c.phases();
    if phases.columns.len() == 1 {
        return Value::missing(ALONE);
    }
    if c.inputs.phases_are_measured && phases.len() >= 20 {
        // Seeded by a constant: the same recording gives the same chance level every time.
        let means = phase::surrogate_synchrony(&phases.slices(), SURROGATES, 1);
        let at = |share: f64| means[((means.len() - 1) as f64 * share).round() as usize];
        let seen = mean(&phase::order_parameter(&phases.slices()));
        let above = means.len() - means.partition_point(|m| *m < seen);
        let p = (1 + above) as f64 / (1 + means.len()) as f64;
        return Value {
            reason: Some(format!(
                "p = {p:.3}: the share of {SURROGATES} time-shifted copies that are as much in step as the carriers are"
            )),
            ..Value::number(mean(&means)).per(vec![at(0.025), at(0.975)])
        };
    }
    let chance = phase::chance_level(phases.columns.len());
    Value::number(chance.mean).per(chance.band.to_vec())
}

pub fn step_rate_hz(c: &Context) -> Value {
    let of = |step_s: &Vec<f64>| {
        let inside = &step_s[c.window.range(step_s)];
        (inside.len() >= 3).then(|| rate_of(inside))
    };
    let steps: Vec<(f64, f64)> = c.inputs.step_s.iter().filter_map(of).collect();
    if steps.is_empty() {
        return Value::missing("nobody takes three steps in the window");
    }
    let n = steps.len() as f64;
    let rates: Vec<f64> = steps.iter().map(|(rate, _)| *rate).collect();
    let half = steps
        .iter()
        .map(|(_, half)| half * half)
        .sum::<f64>()
        .sqrt()
        / n;
    let rate = mean(&rates);
    Value::number(rate)
        .per(rates)
        .ci95(rate - half, rate + half)
}

pub fn plv(c: &Context) -> Value {
    let (t_s, phases) = (&c.phases().t_s, c.phases().slices());
    let per = phase::locking(&phases);
    if per.is_empty() {
        return Value::missing("a pair needs two carriers");
    }
    Value::number(mean(&per))
        .per(per)
        .remark(standing(t_s, &phases))
}

pub fn beat_synchrony(c: &Context) -> Value {
    let per: Vec<f64> = carriers(c).iter().map(|p| p.resultant).collect();
    Value::number(mean(&per)).per(per)
}

pub fn beat_hz(c: &Context) -> Value {
    let beat = c.beat_alone();
    let turns = Turns::of(&beat.t_s, &beat.x);
    if turns.usual_rad_per_s.is_nan() {
        return Value::missing("the beat sounds at a single sample of the window");
    }
    if turns.folded() {
        return Value::missing(FOLDED);
    }
    // Over silence and over many lost messages nobody counted the turns; messages may be early and late.
    let (mut turned, mut sounds_s) = (0.0, 0.0);
    for part in stretches(&beat.t_s, 0.0) {
        for k in part.start + 1..part.end {
            let step_s = beat.t_s[k] - beat.t_s[k - 1];
            turned += turns.over(step_s, beat.x[k] - beat.x[k - 1]);
            sounds_s += step_s;
        }
    }
    Value::number(turned / (TAU * sounds_s))
}

#[cfg(test)]
mod tests {
    use crate::inputs::{Inputs, Window};
    use crate::metrics::metrics;
    use crate::phase;
    use crate::random::Random;
    use std::f64::consts::{PI, TAU};

    /// p of the synchrony of two carriers found from steps, whose tempo wanders alike or each by itself.
    fn p_value(together: bool, seed: u64) -> f64 {
        let mut random = Random(seed);
        let step_s = 1.0 / 30.0;
        let mut walk = || {
            let mut phase = 0.0;
            let tempo = random.wander(1800, step_s, 0.8, 3.0);
            let each = tempo.into_iter().map(|off| {
                phase += (TAU * 2.0 + off) * step_s;
                phase
            });
            each.collect::<Vec<f64>>()
        };
        let first = walk();
        let second = if together { first.clone() } else { walk() };
        let inputs = Inputs {
            phase_t_s: (0..1800).map(|k| f64::from(k) * step_s).collect(),
            phase_rad: vec![first, second],
            phases_are_measured: true,
            ..Inputs::default()
        };
        let found = metrics(&inputs, Window::ALL);
        let reason = found.get("synchrony_chance").unwrap().reason.clone();
        let words = reason.unwrap();
        let number = words.strip_prefix("p = ").unwrap().split(':').next();
        number.unwrap().parse().unwrap()
    }

    #[test]
    fn who_walks_together_is_seldom_so_much_in_step_by_chance() {
        for seed in 1..=10 {
            assert!(p_value(true, seed) < 0.01);
        }
        let by_chance = (1..=60).filter(|s| p_value(false, *s) < 0.1).count();
        // Six of sixty are expected, more than twelve in one series of a hundred.
        assert!(by_chance <= 12, "{by_chance}");
    }

    #[test]
    fn who_stands_still_is_in_step_for_nothing() {
        let walks = |hz: f64| (0..300).map(move |k| TAU * hz * f64::from(k) / 30.0);
        // About half a turn, which is wrapped to and fro.
        let stands = || {
            (0..300)
                .map(|k| phase::wrap(PI + 1e-3 * f64::from(k % 3 - 1)))
                .collect()
        };
        let said = |phases: &[Vec<f64>; 3], rate_hz: f64| {
            let samples = 0..phases[0].len() as u32;
            let inputs = Inputs {
                phase_t_s: samples.map(|k| f64::from(k) / rate_hz).collect(),
                phase_rad: phases.to_vec(),
                ..Inputs::default()
            };
            let found = metrics(&inputs, Window::ALL);
            ["synchrony", "plv"].map(|name| found.get(name).unwrap().reason.clone())
        };
        let two = [stands(), walks(2.0).collect(), stands()];
        for reason in said(&two, 30.0) {
            assert!(reason.unwrap().starts_with("the phases of 2 of 3 carriers"));
        }
        let one = [stands(), walks(2.0).collect(), walks(2.0).collect()];
        assert_eq!(said(&one, 30.0), [None, None]);
        // Who is seen once a second, or for a second, may walk all the same.
        assert_eq!(said(&two, 1.0), [None, None]);
        let brief = two.map(|x: Vec<f64>| x[..30].to_vec());
        assert_eq!(said(&brief, 30.0), [None, None]);
    }

    #[test]
    fn late_and_lost_messages_do_not_change_the_beat() {
        for (late_s, lost) in [(0.003, 0.0), (0.02, 0.0), (0.003, 0.3)] {
            let mut random = Random(4);
            let mut came: Vec<(f64, f64)> = (0..1800)
                .map(|k| f64::from(k) / 30.0)
                .map(|t| (t, random.uniform(), random.uniform()))
                .filter(|(t, _, kept)| *kept >= lost && !(20.0..23.3).contains(t))
                .map(|(t, late, _)| (t - late_s * late.ln(), TAU * 2.0 * t))
                .collect();
            came.sort_by(|a, b| a.0.total_cmp(&b.0));
            let (t_s, beat_phase_rad) = came.into_iter().unzip();
            let inputs = Inputs {
                t_s,
                beat_phase_rad,
                ..Inputs::default()
            };
            let hz = metrics(&inputs, Window::ALL).number("beat_hz").unwrap();
            assert!((hz - 2.0).abs() < 0.005, "{late_s} {lost}: {hz}");
        }
    }

    /// Of a beat of 2.1507 Hz at so many samples a second, its phase wrapped or not.
    fn beat_at(rate_hz: f64, wrapped: bool) -> Option<f64> {
        let t_s: Vec<f64> = (0..120).map(|k| f64::from(k) / rate_hz).collect();
        let phase = t_s.iter().map(|t| TAU * 2.1507 * t);
        let beat_phase_rad = match wrapped {
            true => phase.map(phase::wrap).collect(),
            false => phase.collect(),
        };
        let inputs = Inputs {
            t_s,
            beat_phase_rad,
            ..Inputs::default()
        };
        metrics(&inputs, Window::ALL).number("beat_hz")
    }

    #[test]
    fn a_beat_that_turns_oftener_than_it_is_sampled_is_told_only_unwrapped() {
        for rate_hz in [1.0, 2.0, 3.0, 4.0, 5.0, 30.0] {
            let hz = beat_at(rate_hz, false).unwrap();
            assert!((hz - 2.1507).abs() < 1e-9, "{rate_hz}: {hz}");
            let hz = beat_at(rate_hz, true);
            assert_eq!(hz.is_some(), rate_hz > 2.0 * 2.1507, "{rate_hz}: {hz:?}");
            assert!(hz.is_none_or(|hz| (hz - 2.1507).abs() < 1e-9));
        }
    }

    /// More than half a turn over a lost message: only the usual rate tells that it was not less than half the other way.
    #[test]
    fn turns_over_a_lost_message_are_counted_by_the_usual_rate() {
        let kept = (0..400).filter(|k| k % 5 != 4).map(|k| f64::from(k) / 8.0);
        let (t_s, beat_phase_rad) = kept.map(|t| (t, TAU * 2.5 * t)).unzip();
        let inputs = Inputs {
            t_s,
            beat_phase_rad,
            ..Inputs::default()
        };
        let hz = metrics(&inputs, Window::ALL).number("beat_hz").unwrap();
        assert!((hz - 2.5).abs() < 1e-9, "{hz}");
    }
}

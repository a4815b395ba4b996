//! What drives the roll, as one word with its evidence.

use super::contact::deviation;
use super::{Context, Value};
use crate::inputs::{between, mean_step_s, stretches};
use crate::line::Shares;
use crate::mechanism::{self, Evidence, Verdict};

/// So many samples to a period of the height's line show its second harmonic too.
const OFTEN: f64 = 4.0;

/// The evidence for this window. `None` where the roll does not move or has no step.
pub fn evidence(c: &Context) -> Option<Evidence> {
    let roll = c.roll();
    roll.step_s()?;
    let rms_roll_rad = (roll.x.iter().map(|x| x * x).sum::<f64>() / roll.x.len() as f64).sqrt();
    let f_hz = c.height_line().map(|l| l.hz);
    let shares = f_hz.and_then(|f| Shares::of(&roll.t_s, &roll.x, f));
    let forces = c.forces();
    // Between samples of a force that comes too seldom, or of another direction, nothing is known that could drive a roll.
    let often = |f: f64| mean_step_s(&forces.t_s).is_some_and(|step_s| OFTEN * f * step_s < 1.0);
    let tells = c.upright().is_ok() && f_hz.is_none_or(often);
    let on_roll: Vec<Vec<f64>> = if forces.is_empty() || !tells {
        Vec::new()
    } else if forces.t_s == roll.t_s {
        forces.columns.iter().map(|n| n.to_vec()).collect()
    } else {
        forces
            .columns
            .iter()
            .map(|n| between(&forces.t_s, n, &roll.t_s))
            .collect()
    };
    let support = c.support_ratio();
    let per_mass = forces.is_empty();
    let handles = match per_mass {
        false => on_roll,
        // N_tot / (M g) times g: the force on one kilogram.
        true if !support.x.is_empty() && support.t_s == roll.t_s => {
            let g = c.inputs.gravity_m_per_s2;
            vec![support.x.iter().map(|x| x * g).collect()]
        }
        true => Vec::new(),
    };
    let fit = mechanism::fit_roll(&roll.t_s, &roll.x, &handles, &stretches(&roll.t_s, 0.0));
    Some(Evidence {
        rms_roll_rad,
        swing_rad: deviation(&roll.x),
        f_hz,
        share_at_half: shares.map(|s| s.at_half),
        share_at_f: shares.map(|s| s.at_f),
        fit,
        per_mass,
    })
}

pub fn mechanism(c: &Context) -> Value {
    let Some(evidence) = evidence(c) else {
        return Value::missing("fewer than two samples of roll in the window");
    };
    match (evidence.verdict(), c.aliased().or_else(|| c.too_slow())) {
        (Ok(verdict), Some(why)) if verdict != Verdict::Quiet => Value::missing(why),
        (Ok(verdict), _) => Value::word(verdict.word(), evidence.to_string()),
        (Err(reason), _) => Value::missing(reason),
    }
}

#[cfg(test)]
mod tests {
    use crate::inputs::{Inputs, Window};
    use crate::metrics::metrics;
    use std::f64::consts::TAU;

    /// A load that heaves at 2.15 Hz and rolls at half of it, seen `height_hz` and `force_hz` times a second, with a beat.
    fn carried(height_hz: f64, force_hz: f64) -> Inputs {
        let times =
            |hz: f64| -> Vec<f64> { (0..(60.0 * hz) as u32).map(|k| f64::from(k) / hz).collect() };
        let (t_s, phase_t_s, force_t_s) = (times(30.0), times(30.0), times(force_hz));
        let heave = |t: &f64| (TAU * 2.15 * t).sin();
        let height_s = times(height_hz);
        let height_m = height_s.iter().map(|t| 0.8 + 0.05 * heave(t)).collect();
        let n: Vec<f64> = force_t_s
            .iter()
            .map(|t| 294.3 * (1.0 - 0.5 * heave(t)))
            .collect();
        Inputs {
            roll_rad: t_s.iter().map(|t| 0.3 * (TAU * 1.075 * t).sin()).collect(),
            height_alone: Some((height_s, height_m)),
            beat_phase_rad: phase_t_s.iter().map(|t| TAU * 2.15 * t).collect(),
            phase_rad: vec![phase_t_s.iter().map(|t| TAU * 2.15 * t).collect(); 2],
            normal_n: vec![n.clone(), n],
            mass_kg: Some(60.0),
            gravity_m_per_s2: 9.81,
            t_s,
            phase_t_s,
            force_t_s,
            ..Inputs::default()
        }
    }

    #[test]
    fn what_is_seen_too_seldom_is_not_made_anything_of() {
        let m = metrics(&carried(30.0, 30.0), Window::ALL);
        assert!((m.number("peak_hz").unwrap() - 2.15).abs() < 0.01);
        let evidence =
            |m: &crate::metrics::Metrics| m.get("mechanism").unwrap().reason.clone().unwrap();
        assert!(evidence(&m).contains("N_tot"), "{}", evidence(&m));
        // An alias of the heave would stand at 1.6 Hz.
        let m = metrics(&carried(3.75, 30.0), Window::ALL);
        for name in [
            "peak_hz",
            "h2_ratio",
            "subharmonic_ratio",
            "growth_ratio",
            "mechanism",
        ] {
            let found = m.get(name).unwrap();
            assert!(
                found.as_f64().is_none() && found.as_word().is_none(),
                "{found:?}"
            );
            let why = found.reason.as_deref().unwrap();
            assert!(
                why.contains("too few for a motion at the beat's 2.15 Hz"),
                "{why}"
            );
        }
        // Forces between whose samples a heave passes fit no pendulum.
        let m = metrics(&carried(30.0, 6.0), Window::ALL);
        assert_eq!(m.get("mechanism").unwrap().as_word(), Some("parametric"));
        assert!(!evidence(&m).contains("N_tot"), "{}", evidence(&m));
    }
}

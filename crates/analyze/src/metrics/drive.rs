//! What drives the roll, as one word with its evidence.

use super::{Context, Value};
use crate::inputs::{between, stretches};
use crate::line::Shares;
use crate::mechanism::{self, Evidence, Verdict};

/// The evidence for this window. `None` where the roll does not move or has no step.
pub fn evidence(c: &Context) -> Option<Evidence> {
    let roll = c.roll();
    roll.step_s()?;
    let rms_roll_rad = (roll.x.iter().map(|x| x * x).sum::<f64>() / roll.x.len() as f64).sqrt();
    let f_hz = c.height_line().map(|l| l.hz);
    let shares = f_hz.and_then(|f| Shares::of(&roll.t_s, &roll.x, f));
    let forces = c.forces();
    let on_roll: Vec<Vec<f64>> = if forces.is_empty() {
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
    let per_mass = on_roll.is_empty();
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
    match (evidence.verdict(), c.too_slow()) {
        (Ok(verdict), Some(why)) if verdict != Verdict::Quiet => Value::missing(why),
        (Ok(verdict), _) => Value::word(verdict.word(), evidence.to_string()),
        (Err(reason), _) => Value::missing(reason),
    }
}

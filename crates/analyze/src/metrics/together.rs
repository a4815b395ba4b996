//! How together the carriers are.

use super::beat::carriers;
use super::contact::mean;
use super::{Context, Value};
use crate::phase;

/// How many surrogates the chance level of measured phases is made from.
const SURROGATES: usize = 400;

pub fn synchrony(c: &Context) -> Value {
    Value::number(mean(&phase::order_parameter(&c.phases().slices())))
}

pub fn synchrony_chance(c: &Context) -> Value {
    let phases = c.phases();
    if c.inputs.phases_are_measured && phases.columns.len() > 1 && phases.len() >= 20 {
        // Seeded by a constant: the same recording gives the same chance level every time.
        let means = phase::surrogate_synchrony(&phases.slices(), SURROGATES, 1);
        let at = |share: f64| means[((means.len() - 1) as f64 * share).round() as usize];
        return Value::number(mean(&means)).per(vec![at(0.025), at(0.975)]);
    }
    let chance = phase::chance_level(phases.columns.len());
    Value::number(chance.mean).per(chance.band.to_vec())
}

pub fn plv(c: &Context) -> Value {
    let pairs = phase::pairs(&c.phases().slices());
    if pairs.is_empty() {
        return Value::missing("a pair needs two carriers");
    }
    let per: Vec<f64> = pairs.iter().map(|(_, _, p)| p.resultant).collect();
    Value::number(mean(&per)).per(per)
}

pub fn beat_synchrony(c: &Context) -> Value {
    let per: Vec<f64> = carriers(c).iter().map(|p| p.resultant).collect();
    Value::number(mean(&per)).per(per)
}

pub fn beat_hz(c: &Context) -> Value {
    let table = c.beat();
    let psi = phase::unwrap(&table.columns[0]);
    let span_s = table.t_s[table.len() - 1] - table.t_s[0];
    if span_s <= 0.0 {
        return Value::missing("the beat sounds at a single sample of the window");
    }
    Value::number((psi[psi.len() - 1] - psi[0]) / (std::f64::consts::TAU * span_s))
}

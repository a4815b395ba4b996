//! Who holds it and when nobody does: contact, unloading, force statistics.

use super::{Context, Value};
use crate::pairs::products;
use crate::summary::rounding;
use nalgebra::DMatrix;

/// The share ε of the weight below which the support counts as gone (paper: 0.05).
pub const FLOAT_SHARE: f64 = 0.05;

/// A mean support that differs from M·g by more than this factor, a quarter (ln), is another load's, or forces are missing or there twice.
const ANOTHER_WEIGHT: f64 = 0.25;

fn share(count: usize, of: usize) -> f64 {
    count as f64 / of as f64
}

pub fn contact_loss(c: &Context) -> Value {
    if let Err(why) = c.upright() {
        return Value::missing(why);
    }
    let forces = c.forces();
    let slack = (0..forces.len())
        .filter(|k| forces.columns.iter().any(|n| n[*k] <= 0.0))
        .count();
    Value {
        reason: tied(c),
        ..Value::number(share(slack, forces.len()))
    }
}

pub fn contact_loss_mean(c: &Context) -> Value {
    if let Err(why) = c.upright() {
        return Value::missing(why);
    }
    let forces = c.forces();
    let per: Vec<f64> = forces
        .columns
        .iter()
        .map(|n| share(n.iter().filter(|n| **n <= 0.0).count(), n.len()))
        .collect();
    Value {
        reason: tied(c),
        ..Value::number(mean(&per)).per(per)
    }
}

/// Said where a handle is pulled down, which one that only rests never is.
fn tied(c: &Context) -> Option<String> {
    let least_n = c.inputs.pulled_n()?;
    Some(format!(
        "handles are pulled, with up to {:.0} N: they are tied, and where N ≤ 0 they are not slack",
        -least_n
    ))
}

pub fn t_float(c: &Context) -> Value {
    if c.inputs.normal_n.is_empty() {
        let ratio = c.support_ratio();
        return Value::number(share(
            ratio.x.iter().filter(|r| **r <= FLOAT_SHARE).count(),
            ratio.x.len(),
        ));
    }
    let (total, weight_n) = match c.weight_n() {
        Ok(weight_n) => (c.total_force_n(), weight_n),
        Err(why) => return Value::missing(why),
    };
    let source = match c.inputs.mass_kg {
        Some(_) => String::new(),
        None => "forces; M·g taken as the mean support".to_owned(),
    };
    let mean_n = mean(&total);
    let other = ((mean_n / weight_n).ln().abs() > ANOTHER_WEIGHT).then(|| {
        format!("the mean support is {mean_n:.0} N, but M·g is {weight_n:.0} N: is mass_kg right, and is every handle there once?")
    });
    let held = |n: &&f64| **n <= FLOAT_SHARE * weight_n;
    Value {
        reason: other,
        ..Value::number(share(total.iter().filter(held).count(), total.len())).source(source)
    }
}

pub fn force_mean_n(c: &Context) -> Value {
    let per: Vec<f64> = c.forces().columns.iter().map(|n| mean(n)).collect();
    Value::number(mean(&per)).per(per)
}

pub fn force_sd_n(c: &Context) -> Value {
    let per: Vec<f64> = c.forces().columns.iter().map(|n| deviation(n)).collect();
    Value::number(mean(&per)).per(per)
}

pub fn force_correlation(c: &Context) -> Value {
    let columns = &c.forces().columns;
    if columns.len() < 2 {
        return Value::missing("a correlation needs two handles");
    }
    // Off the mean, over √n σ.
    let scaled = columns.iter().flat_map(|x| {
        let (m, sd) = (mean(x), deviation(x));
        let size = match sd {
            0.0 => f64::NAN,
            _ => sd * (x.len() as f64).sqrt(),
        };
        x.iter().map(move |x| (x - m) / size)
    });
    let scaled = DMatrix::from_iterator(columns[0].len(), columns.len(), scaled);
    let per = products(&scaled, &scaled);
    Value::number(mean(&per)).per(per)
}

pub fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

/// Population standard deviation; what remains of a constant is rounding, and none.
pub fn deviation(x: &[f64]) -> f64 {
    let sd = variance(x).sqrt();
    if sd <= rounding(x) { 0.0 } else { sd }
}

/// Population variance, less what the mean's own rounding adds to it (Chan, Golub and LeVeque 1983).
fn variance(x: &[f64]) -> f64 {
    let (m, n) = (mean(x), x.len() as f64);
    let off = x.iter().map(|x| x - m);
    let (sum, squares) = off.fold((0.0, 0.0), |(s, q), d| (s + d, q + d * d));
    let v = (squares - sum * sum / n) / n;
    // What is no number stays none.
    if v < 0.0 { 0.0 } else { v }
}

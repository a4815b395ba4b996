//! Who holds it and when nobody does: contact, unloading, force statistics.

use super::{Context, Value};
use crate::inputs::pulled_n;
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
        reason: doubt(c),
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
        reason: doubt(c),
        ..Value::number(mean(&per)).per(per)
    }
}

/// Why N ≤ 0 does not say who is slack, where it does not.
fn doubt(c: &Context) -> Option<String> {
    tied(c).or_else(|| floats_without_slack(c))
}

/// Said where a handle is pulled down, which one that only rests never is.
fn tied(c: &Context) -> Option<String> {
    let least_n = pulled_n(&c.forces().columns)?;
    Some(format!(
        "handles are pulled, with up to {:.0} N: they are tied, and where N ≤ 0 they are not slack",
        -least_n
    ))
}

/// So many samples show a zero.
const FEWEST_AFLOAT: usize = 10;

/// Said where nobody holds the load and yet no handle reads nought: what a sensor reads of nothing is its zero.
fn floats_without_slack(c: &Context) -> Option<String> {
    let weight_n = c.weight_n().ok()?;
    let (forces, total) = (c.forces(), c.total_force_n());
    let afloat = |k: &usize| total[*k] <= FLOAT_SHARE * weight_n;
    let afloat: Vec<usize> = (0..total.len()).filter(afloat).collect();
    let held = |k: &&usize| forces.columns.iter().all(|n| n[**k] > 0.0);
    let held = afloat.iter().filter(held).count();
    (afloat.len() >= FEWEST_AFLOAT && 2 * held > afloat.len()).then(|| format!(
        "in {:.1} % of the window the summed support is below {FLOAT_SHARE} M·g (`t_float`), and in most of that no handle reads N ≤ 0: the sensors' zeros are off, and contact is lost more often than they say",
        100.0 * share(afloat.len(), total.len())
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

#[cfg(test)]
mod tests {
    use crate::inputs::{Inputs, Window};
    use crate::metrics::metrics;

    /// Two handles of 60 kg that are thrown for a third of every second, read by sensors whose zero is off by `zero_n`.
    fn thrown(zero_n: f64) -> Inputs {
        let t_s: Vec<f64> = (0..600).map(|k| f64::from(k) / 30.0).collect();
        let held = |t: &f64| {
            if (t.fract() * 30.0).round() < 10.0 {
                0.0
            } else {
                441.45
            }
        };
        let n: Vec<f64> = t_s.iter().map(|t| held(t) + zero_n).collect();
        Inputs {
            normal_n: vec![n.clone(), n],
            mass_kg: Some(60.0),
            gravity_m_per_s2: 9.81,
            t_s,
            ..Inputs::default()
        }
    }

    #[test]
    fn sensors_that_read_something_of_nothing_are_said() {
        for (zero_n, lost) in [(0.0, 1.0 / 3.0), (3.0, 0.0)] {
            let m = metrics(&thrown(zero_n), Window::ALL);
            for name in ["contact_loss", "contact_loss_mean"] {
                let found = m.get(name).unwrap();
                assert!((found.as_f64().unwrap() - lost).abs() < 0.01, "{found:?}");
                let said = found.reason.as_deref().unwrap_or_default();
                assert_eq!(said.contains("zeros are off"), zero_n > 0.0, "{said}");
            }
        }
    }

    #[test]
    fn a_pull_outside_the_window_says_nothing_of_it() {
        let mut inputs = thrown(0.0);
        inputs.normal_n[0][0] = -1300.0;
        let said = |window| {
            metrics(&inputs, window)
                .get("contact_loss")
                .unwrap()
                .reason
                .clone()
        };
        assert!(said(Window::ALL).unwrap().contains("up to 1300 N"));
        assert_eq!(said(Window::from(5.0)), None);
    }
}

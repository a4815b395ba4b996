//! The study file: what a sweep is to do, as TOML.

use recording::text::meant::did_you_mean;
use serde::{Deserialize, Serialize};
use sim::scene::{SceneError, from_toml};

/// A study file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spec {
    /// Name of the study; the file's own name where it is left out.
    #[serde(default)]
    pub name: String,
    /// One sentence for people.
    #[serde(default)]
    pub about: String,
    /// A built-in scene, or the path of one beside the study file.
    pub scene: String,
    /// Runs of every point, each with a seed of its own.
    #[serde(default = "one")]
    pub seeds: u64,
    /// The first of these seeds.
    #[serde(default = "first_seed")]
    pub first_seed: u64,
    /// What is kept of every run: names of metrics (docs/metrics.md).
    #[serde(default = "usual_metrics")]
    pub metrics: Vec<String>,
    /// Whether every run is kept as a recording too.
    #[serde(default)]
    pub recordings: bool,
    /// Keys of the scene that are the same in all runs.
    #[serde(default)]
    pub set: toml::Table,
    /// What varies.
    #[serde(default)]
    pub axes: Vec<Axis>,
    /// How axes without a `count` are sampled.
    pub design: Option<Design>,
}

/// Something that varies: a list of values, a row of `count` values, or a range that the design samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// Dotted key of the scene, as for `sim record --set`.
    pub key: String,
    /// Name of the column; the key where it is left out.
    #[serde(default)]
    pub name: String,
    /// The values themselves.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub values: Vec<toml::Value>,
    /// First value of a row or lower end of a range.
    pub from: Option<f64>,
    /// Last value or upper end.
    pub to: Option<f64>,
    /// How many values from `from` to `to`, both included.
    pub count: Option<u64>,
    /// Whether steps are equal or factors are.
    #[serde(default)]
    pub spacing: Spacing,
    /// Other keys that go along: value times this factor.
    #[serde(
        default,
        rename = "with",
        skip_serializing_if = "toml::Table::is_empty"
    )]
    pub along: toml::Table,
}

/// How a row or a range is divided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Spacing {
    /// Equal steps.
    #[default]
    Linear,
    /// Equal factors.
    Log,
}

/// How ranges are sampled together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Design {
    /// Which design.
    pub kind: DesignKind,
    /// How many points; of a sensitivity study, base points.
    pub points: u64,
    /// Seed of a Latin hypercube.
    #[serde(default)]
    pub seed: u64,
}

/// The designs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DesignKind {
    /// One point in each of `points` slices of every axis, paired at random (McKay et al. 1979).
    LatinHypercube,
    /// Sobol's sequence.
    Sobol,
    /// Saltelli's arrangement of Sobol points: `points` × (axes + 2) in all, for indices of sensitivity.
    Sensitivity,
}

fn one() -> u64 {
    1
}

fn first_seed() -> u64 {
    crate::paper::FIRST_SEED
}

fn usual_metrics() -> Vec<String> {
    crate::ensemble::KEPT.iter().map(|n| (*n).into()).collect()
}

/// Reads and checks a study file; `origin` names it in errors.
///
/// # Errors
/// One sentence with the place and what is wrong there.
pub fn parse(origin: &str, text: &str) -> Result<Spec, String> {
    let mut spec: Spec = from_toml(origin, text).map_err(|e: SceneError| e.to_string())?;
    check(&mut spec).map_err(|e| format!("{origin}: {e}"))?;
    Ok(spec)
}

fn check(spec: &mut Spec) -> Result<(), String> {
    if spec.seeds == 0 {
        return Err("seeds: found 0, expected at least one run of every point".into());
    }
    check_seeds(spec)?;
    let names = || analyze::metrics::METRICS.iter().map(|m| m.name);
    if spec.metrics.is_empty() {
        return Err("metrics: none is named; leave the line out for the usual ones".into());
    }
    for (k, name) in spec.metrics.iter().enumerate() {
        if !names().any(|n| n == name) {
            let hint = did_you_mean(name, names());
            return Err(format!(
                "metrics: there is no metric `{name}`.{hint} `docs/metrics.md` lists them all"
            ));
        }
        if spec.metrics[..k].contains(name) {
            return Err(format!("metrics: `{name}` stands twice"));
        }
    }
    if spec.set.contains_key("seed") {
        return Err("set.seed: seeds have lines of their own, `seeds` and `first_seed`".into());
    }
    for k in 0..spec.axes.len() {
        let axis = &mut spec.axes[k];
        if axis.name.is_empty() {
            axis.name.clone_from(&axis.key);
        }
        check_axis(axis).map_err(|e| format!("axes.{k} (`{}`): {e}", spec.axes[k].key))?;
        if let Some((key, set)) = set_and_varied(&spec.set, &spec.axes[k]) {
            return Err(format!(
                "axes.{k}: `{key}` stands beside `{set}` of [set]; one of the two would not count"
            ));
        }
        let name = &spec.axes[k].name;
        let taken = super::FIXED_COLUMNS.contains(&name.as_str())
            || super::summary::has_column(name, &spec.metrics)
            || spec.metrics.contains(name)
            || spec.axes[..k].iter().any(|a| a.name == *name);
        if let Some((key, other, before)) = said_twice(&spec.axes[..=k]) {
            return Err(format!(
                "axes.{k}: `{key}` stands beside `{other}` of axis `{before}`; one of the two would not count"
            ));
        }
        if taken {
            return Err(format!(
                "axes.{k}: there is a column `{name}` already; give the axis another `name`"
            ));
        }
    }
    let sampled = spec.axes.iter().filter(|a| a.is_sampled()).count();
    match &spec.design {
        None if sampled > 0 => {
            let axis = spec.axes.iter().find(|a| a.is_sampled());
            Err(format!(
                "axis `{}` is a range without a `count`, and there is no [design] to sample it; give either",
                axis.map_or("", |a| &a.key)
            ))
        }
        Some(_) if sampled == 0 => {
            Err("[design] has nothing to sample: every axis has its values".into())
        }
        Some(d) if d.points == 0 || d.points > 1 << 30 => Err(format!(
            "design.points: found {}, expected 1 to 2^30",
            d.points
        )),
        Some(d) if d.seed != 0 && d.kind != DesignKind::LatinHypercube => Err(format!(
            "design.seed: found {}, but only a Latin hypercube is drawn by a seed: Sobol's points are the same every time; another `first_seed` gives other runs",
            d.seed
        )),
        Some(d) if d.kind == DesignKind::Sensitivity && sampled < spec.axes.len() => {
            Err("a sensitivity study samples all its axes; take `values` and `count` away".into())
        }
        Some(d) if d.kind == DesignKind::LatinHypercube && d.points > 1 << 24 => {
            Err("a Latin hypercube has at most 2^24 points; take `sobol`".into())
        }
        Some(d)
            if sampled > MOST_SAMPLED || dimensions(d, sampled) > super::sobol::MOST_DIMENSIONS =>
        {
            Err(format!(
                "{sampled} sampled axes are too many: at most {MOST_SAMPLED}"
            ))
        }
        _ => Ok(()),
    }
}

/// Tables hold seeds as signed numbers.
pub(super) fn check_seeds(spec: &Spec) -> Result<(), String> {
    let last = spec.first_seed.checked_add(spec.seeds - 1);
    match last.is_some_and(|seed| seed >> 56 == 0) {
        true => Ok(()),
        false => Err(format!(
            "first_seed: found {} and {} seeds from it on, expected the last to be below 2^56",
            spec.first_seed, spec.seeds
        )),
    }
}

/// The key of an axis, with what goes along.
fn keys(axis: &Axis) -> Vec<String> {
    let along = flatten(&axis.along).into_iter().map(|(key, _)| key);
    [axis.key.clone()].into_iter().chain(along).collect()
}

/// Whether a key is another, or stands below it.
fn within(inner: &str, outer: &str) -> bool {
    inner
        .strip_prefix(outer)
        .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

/// A key of an axis and one of [set] of which one would not count: what an axis replaces as a whole, or what [set] turns off. The axis' own key is
/// what [set] begins with.
fn set_and_varied(set: &toml::Table, axis: &Axis) -> Option<(String, String)> {
    let set = flatten(set);
    keys(axis).into_iter().find_map(|key| {
        let clash = |(s, value): &&(String, toml::Value)| {
            let replaced = within(s, &key);
            let turned_off = within(&key, s) && value.as_bool() == Some(false);
            *s != key && (replaced || turned_off)
        };
        let (s, _) = set.iter().find(clash)?;
        Some((key, s.clone()))
    })
}

/// A key of the last axis, with what goes along, that sets what another key sets as well: both, and the other's axis.
fn said_twice(axes: &[Axis]) -> Option<(String, String, &str)> {
    let (last, before) = axes.split_last()?;
    let own = keys(last);
    for (k, key) in own.iter().enumerate() {
        let earlier = before
            .iter()
            .flat_map(|a| keys(a).into_iter().map(|o| (o, &*a.name)));
        let mut others = earlier.chain(own[..k].iter().map(|o| (o.clone(), &*last.name)));
        if let Some((other, name)) = others.find(|(o, _)| within(key, o) || within(o, key)) {
            return Some((key.clone(), other, name));
        }
    }
    None
}

/// The most axes that a design samples: Sobol's sequence needs two dimensions for each in a sensitivity study.
const MOST_SAMPLED: usize = super::sobol::MOST_DIMENSIONS / 2;

fn dimensions(design: &Design, sampled: usize) -> usize {
    match design.kind {
        DesignKind::Sensitivity => 2 * sampled,
        _ => sampled,
    }
}

fn check_axis(axis: &Axis) -> Result<(), String> {
    if axis.key.is_empty() || axis.key == "seed" {
        return Err("expected a key of the scene; seeds have a line of their own, `seeds`".into());
    }
    if let Some((key, _)) = flatten(&axis.along)
        .iter()
        .find(|(_, v)| number(v).is_none())
    {
        return Err(format!("with.{key}: expected the factor as a number"));
    }
    match (axis.values.is_empty(), axis.from, axis.to) {
        (false, None, None) if axis.count.is_none() => {
            if !axis.along.is_empty() && axis.values.iter().any(|v| number(v).is_none()) {
                return Err("`with` needs numbers in `values`".into());
            }
            let factor = |v: &toml::Value| number(v).is_some_and(|x| x > 0.0);
            if axis.spacing == Spacing::Log && !axis.values.iter().all(factor) {
                return Err("equal factors need numbers above zero in `values`".into());
            }
            Ok(())
        }
        (true, Some(from), Some(to)) => {
            if !(from.is_finite() && to.is_finite()) {
                return Err("`from` and `to` must be finite".into());
            }
            if !(to - from).is_finite() {
                return Err(format!(
                    "`from` {from:e} and `to` {to:e} are further apart than a number can say; bring them nearer"
                ));
            }
            if axis.count.is_none() && from == to {
                return Err(format!(
                    "`from` and `to` are both {from}, and every point would be the same; give a range, or put the key into [set]"
                ));
            }
            if axis.spacing == Spacing::Log && !(from > 0.0 && to > 0.0) {
                return Err("equal factors need `from` and `to` above zero".into());
            }
            match axis.count {
                Some(0) => Err("count: found 0, expected at least 1".into()),
                Some(1) if from != to => Err("one value cannot be both `from` and `to`".into()),
                Some(n) if n > 1 << 24 => Err(format!("count: {n} values are too many")),
                _ => Ok(()),
            }
        }
        _ if axis.from.is_none() && axis.to.is_none() => {
            Err("it has no values: expected either `values`, or `from` and `to`".into())
        }
        _ => Err("expected either `values`, or `from` and `to`".into()),
    }
}

/// A TOML number, whole or not.
pub fn number(value: &toml::Value) -> Option<f64> {
    match value {
        toml::Value::Float(x) => Some(*x),
        // OK because whole numbers of scenes are far below 2^53.
        toml::Value::Integer(i) => Some(*i as f64),
        _ => None,
    }
}

impl Axis {
    /// Whether the design samples it.
    pub fn is_sampled(&self) -> bool {
        self.values.is_empty() && self.count.is_none()
    }

    /// How many values it has of its own.
    pub fn len(&self) -> u64 {
        self.count.unwrap_or(self.values.len() as u64)
    }

    /// Whether it has none of its own.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Where a share 0 … 1 of the way from `from` to `to` leads.
    pub fn at(&self, share: f64) -> f64 {
        let (from, to) = (self.from.unwrap_or(0.0), self.to.unwrap_or(0.0));
        match self.spacing {
            Spacing::Linear => from + (to - from) * share,
            Spacing::Log => from * (to / from).powf(share),
        }
    }

    /// The whole number for a value that was drawn between its ends: each as likely as any other, those at the ends too.
    pub fn whole(&self, drawn: f64) -> i64 {
        let (from, to) = (self.from.unwrap_or(0.0), self.to.unwrap_or(0.0));
        let (least, most) = (from.round(), to.round());
        let share = match self.spacing {
            Spacing::Linear if from != to => (drawn - from) / (to - from),
            // By ratios no two are alike.
            _ => return drawn.round() as i64,
        };
        let end = (most - least).signum();
        let spread = least - 0.5 * end + share * (most - least + end);
        // OK because it lies between two that a key takes.
        spread.round().clamp(least.min(most), least.max(most)) as i64
    }

    /// Value `k` of its own.
    pub fn value(&self, k: u64) -> toml::Value {
        match self.count {
            None => self.values[k as usize].clone(),
            // The ends exactly as they were written.
            Some(n) if k + 1 == n && n > 1 => toml::Value::Float(self.to.unwrap_or(0.0)),
            Some(n) => toml::Value::Float(self.at(k as f64 / (n.max(2) - 1) as f64)),
        }
    }
}

/// A table's values by dotted key: `a.b.c = 1` and `"a.b.c" = 1` are the same.
pub fn flatten(table: &toml::Table) -> Vec<(String, toml::Value)> {
    let mut out = Vec::new();
    for (key, value) in table {
        match value {
            toml::Value::Table(inner) if !inner.is_empty() => {
                let inner = flatten(inner).into_iter();
                out.extend(inner.map(|(k, v)| (format!("{key}.{k}"), v)));
            }
            _ => out.push((key.clone(), value.clone())),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_are_drawn_as_often_as_each_other() {
        for (from, to, ends) in [(2.0, 6.0, [2, 6]), (6.0, 2.0, [2, 6]), (1.8, 4.1, [2, 4])] {
            let text = format!("key = \"k\"\nfrom = {from:?}\nto = {to:?}\n");
            let axis: Axis = toml::from_str(&text).unwrap();
            let mut seen = std::collections::BTreeMap::new();
            for k in 0..6000 {
                let drawn = axis.at((f64::from(k) + 0.5) / 6000.0);
                *seen.entry(axis.whole(drawn)).or_insert(0) += 1;
            }
            let count = i64::from(ends[1] - ends[0] + 1);
            assert_eq!(seen.len() as i64, count);
            assert!(
                seen.keys()
                    .all(|x| (ends[0].into()..=ends[1].into()).contains(x))
            );
            assert!(seen.values().all(|n| *n == 6000 / count), "{seen:?}");
        }
    }
}

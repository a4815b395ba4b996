//! Any CSV with inertial columns, by a layout in TOML; docs/recording.md has one with every key.

use std::{collections::HashSet, path::Path};

use serde::Deserialize;

use super::{
    HEADER_LINES, ImportError,
    date::times_ns,
    imu::{self, Log, STANDARD_GRAVITY, Track},
    table::{Table, below_header, plain},
};
use crate::text::{document::from_toml, read_text};

/// Layouts that come with the program; of two that fit a file, the first is taken.
pub const BUILT_IN: &[(&str, &str)] = &[
    ("x-io", include_str!("layouts/x-io.toml")),
    ("x-imu3", include_str!("layouts/x-imu3.toml")),
    (
        "physics-toolbox",
        include_str!("layouts/physics-toolbox.toml"),
    ),
    ("sensorlog", include_str!("layouts/sensorlog.toml")),
    (
        "sensorlog-motion",
        include_str!("layouts/sensorlog-motion.toml"),
    ),
    ("androsensor", include_str!("layouts/androsensor.toml")),
];

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Layout {
    header: Option<String>,
    device: Option<String>,
    time: Time,
    acceleration: Option<Vector>,
    angular_velocity: Option<Vector>,
}

impl Layout {
    fn is_header(&self, line: &str) -> bool {
        match &self.header {
            Some(header) => line.trim_start_matches('"').starts_with(header.as_str()),
            None => !line.is_empty(),
        }
    }

    /// The names of all columns.
    fn columns(&self) -> impl Iterator<Item = &str> {
        let vectors = [&self.acceleration, &self.angular_velocity];
        let of_vectors = vectors.into_iter().flatten().flat_map(|v| &v.columns);
        let all = of_vectors.chain([&self.time.column]);
        all.map(String::as_str)
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Time {
    column: String,
    unit: TimeUnit,
    #[serde(default)]
    start_s: f64,
}

#[derive(Clone, Copy, Debug, Deserialize)]
enum TimeUnit {
    #[serde(rename = "s")]
    Seconds,
    #[serde(rename = "ms")]
    Milliseconds,
    #[serde(rename = "us")]
    Microseconds,
    #[serde(rename = "ns")]
    Nanoseconds,
}

impl TimeUnit {
    fn ns(self) -> i64 {
        match self {
            TimeUnit::Seconds => 1_000_000_000,
            TimeUnit::Milliseconds => 1_000_000,
            TimeUnit::Microseconds => 1_000,
            TimeUnit::Nanoseconds => 1,
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Vector {
    columns: [String; 3],
    unit: String,
    #[serde(default = "one", deserialize_with = "sign")]
    sign: f64,
    /// Its columns may be missing.
    #[serde(default)]
    optional: bool,
}

fn one() -> f64 {
    1.0
}

/// Takes a sign.
fn sign<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    match f64::deserialize(from)? {
        x if x.abs() == 1.0 => Ok(x),
        x => Err(serde::de::Error::custom(format!(
            "sign: found {x}, expected 1 or -1"
        ))),
    }
}

/// Finds a layout: a built-in name, or a file.
pub(super) fn find(name: &str) -> Result<Layout, ImportError> {
    let problem = |problem| ImportError::Content {
        name: name.to_owned(),
        problem,
    };
    let text = match BUILT_IN.iter().find(|(known, _)| *known == name) {
        Some((_, text)) => (*text).to_owned(),
        None if Path::new(name).exists() => {
            read_text(Path::new(name)).map_err(|cause| ImportError::Io {
                name: name.to_owned(),
                cause,
            })?
        }
        None => {
            let known: Vec<&str> = BUILT_IN.iter().map(|(known, _)| *known).collect();
            return Err(problem(format!(
                "is neither a file nor a built-in layout; built in are {}",
                known.join(", ")
            )));
        }
    };
    let layout: Layout = from_toml(&text).map_err(|wrong| ImportError::Content {
        name: wrong.place(name),
        problem: format!("is no layout: {}", wrong.message),
    })?;
    let mut seen = HashSet::new();
    let mut again = layout
        .columns()
        .filter(|column| !seen.insert(plain(column)));
    let twice = again.next().map(str::to_owned);
    drop(again);
    match twice {
        Some(twice) => Err(problem(format!(
            "is no layout: it names the column {twice:?} twice; expected another for each number"
        ))),
        None => Ok(layout),
    }
}

/// The built-in layout that fits a text: its header is there, with the columns that it needs.
pub(super) fn fitting(text: &str) -> Option<Layout> {
    let built_in = BUILT_IN
        .iter()
        .filter_map(|(_, text)| toml::from_str::<Layout>(text).ok());
    let mut found = built_in.filter(|layout| fits(layout, text));
    found.next()
}

/// Whether a text has the header, with the columns that a layout needs.
pub(super) fn fits(layout: &Layout, text: &str) -> bool {
    let is_header = |line: &str| layout.is_header(line);
    let Some((_, text)) = below_header(text, HEADER_LINES, is_header) else {
        return false;
    };
    let needed = [&layout.acceleration, &layout.angular_velocity];
    let needed = needed.into_iter().flatten().filter(|v| !v.optional);
    let mut needed = needed.flat_map(|v| &v.columns).chain([&layout.time.column]);
    Table::header_of(text).is_ok_and(|table| needed.all(|column| table.find(column).is_some()))
}

/// Other spellings of units, and the one that is meant.
const SPELLINGS: [(&str, &str); 5] = [
    ("m/s²", "m/s^2"),
    ("m/s2", "m/s^2"),
    ("°/s", "deg/s"),
    ("º/s", "deg/s"),
    ("dps", "deg/s"),
];

fn factor(vector: &Vector, units: &[(&str, f64)], name: &str) -> Result<f64, ImportError> {
    let given = vector.unit.as_str();
    let meant = SPELLINGS.iter().find(|(other, _)| *other == given);
    let meant = meant.map_or(given, |(_, unit)| unit);
    match units.iter().find(|(unit, _)| *unit == meant) {
        Some((_, factor)) => Ok(factor * vector.sign),
        None => {
            let known: Vec<&str> = units.iter().map(|(unit, _)| *unit).collect();
            let problem = format!(
                "the layout has the unit {:?}; expected {}",
                vector.unit,
                known.join(" or ")
            );
            Err(ImportError::Content {
                name: name.to_owned(),
                problem,
            })
        }
    }
}

pub(super) fn read(layout: &Layout, name: &str, text: &str) -> Result<Log, ImportError> {
    let mut table = Table::parse(name, text, |line| layout.is_header(line))?;
    let mut notes = Vec::new();
    table.take_units();
    table.drop_broken_rows(name, &mut notes);
    let time = table.find_all([layout.time.column.as_str()])?[0];
    table.drop_untimed(time, name, &mut notes);
    let mut lacking = Vec::new();
    let mut columns = |vector: &Option<Vector>, units: &[(&str, f64)]| {
        let there = |v: &&Vector| !v.optional || v.columns.iter().any(|c| table.find(c).is_some());
        let Some(vector) = vector.as_ref().filter(there) else {
            lacking.extend(vector.iter().flat_map(|v| v.columns.iter().cloned()));
            return Ok(None);
        };
        let found = table.find_all(vector.columns.each_ref().map(String::as_str))?;
        Ok::<_, ImportError>(Some((found, factor(vector, units, name)?)))
    };
    let force = columns(
        &layout.acceleration,
        &[("m/s^2", 1.0), ("g", STANDARD_GRAVITY)],
    )?;
    let rate = columns(
        &layout.angular_velocity,
        &[("rad/s", 1.0), ("deg/s", 1f64.to_radians())],
    )?;
    if force.is_none() && rate.is_none() {
        return Err(
            table.problem("the layout names neither acceleration nor angular_velocity".to_owned())
        );
    }
    if !lacking.is_empty() {
        // Under another name nobody knows which axis is which.
        let like = |name: &&String| {
            let name = name.to_lowercase();
            ["gyro", "rotation", "angular"]
                .iter()
                .any(|word| name.contains(word))
        };
        let others: Vec<&str> = table
            .columns
            .iter()
            .filter(like)
            .map(|c| c.trim())
            .collect();
        let others = match others.is_empty() {
            true => String::new(),
            false => format!(
                "; {} are left out, for they do not tell its axes: if you know which is which, give a layout",
                others.join(", ")
            ),
        };
        notes.push(format!("it has no {}{others}", lacking.join(", ")));
    }
    let start_ns = imu::nanoseconds(layout.time.start_s)
        .ok_or_else(|| table.problem("the layout's start_s is no time since 1970".to_owned()))?;
    let since = |t_ns: i64| t_ns.checked_add(start_ns);
    let times_ns: Option<Vec<i64>> = times_ns(&table, time, layout.time.unit.ns())?
        .into_iter()
        .map(since)
        .collect();
    let times_ns = times_ns.ok_or_else(|| {
        table.problem("a time after the layout's start_s is beyond 2262".to_owned())
    })?;
    let mut track = |columns: Option<([usize; 3], f64)>, what: &str| {
        let Some((columns, factor)) = columns else {
            return Ok::<_, ImportError>(Track::new());
        };
        let mut track = table.track(&times_ns, columns, factor)?;
        // Others may have a row of their own.
        track.retain(|(_, values)| !values.iter().all(|x| x.is_nan()));
        if let Some(new) = imu::without_repeats(&track) {
            notes.push(format!(
                "{} of {} rows repeat the {what} of the one before: they hold no sample of it and are left out",
                track.len() - new.len(),
                track.len()
            ));
            track = new;
        }
        Ok(track)
    };
    let (force, rate) = (
        track(force, "acceleration")?,
        track(rate, "angular velocity")?,
    );
    let device = layout.device.as_deref();
    let device = device.map_or_else(|| imu::device_name(name), imu::spelled);
    Ok(Log::join(device, force, rate, notes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_built_in_can_be_read() {
        for (name, _) in BUILT_IN {
            let layout = find(name).expect(name);
            assert!(layout.acceleration.is_some_and(|force| !force.optional));
        }
    }
}

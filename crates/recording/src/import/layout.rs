//! Any CSV with inertial columns, by a layout in TOML; docs/recording.md has one with every key.

use std::path::Path;

use serde::Deserialize;

use super::{
    ImportError,
    imu::{self, Log, STANDARD_GRAVITY, Sample},
    table::Table,
};
use crate::text::read_text;

/// Layouts that come with the program.
pub const BUILT_IN: &[(&str, &str)] = &[
    (
        "x-io",
        "header = \"Time (s)\"\n[time]\ncolumn = \"Time (s)\"\nunit = \"s\"\n\
         [acceleration]\ncolumns = [\"Accelerometer X (g)\", \"Accelerometer Y (g)\", \"Accelerometer Z (g)\"]\nunit = \"g\"\n\
         [angular_velocity]\ncolumns = [\"Gyroscope X (deg/s)\", \"Gyroscope Y (deg/s)\", \"Gyroscope Z (deg/s)\"]\nunit = \"deg/s\"\n",
    ),
    (
        "physics-toolbox",
        "header = \"time\"\n[time]\ncolumn = \"time\"\nunit = \"s\"\n\
         [acceleration]\ncolumns = [\"gFx\", \"gFy\", \"gFz\"]\nunit = \"g\"\n",
    ),
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
    #[serde(default = "one")]
    sign: f64,
}

fn one() -> f64 {
    1.0
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
    toml::from_str(&text)
        .map_err(|error| problem(format!("is no layout: {}", error.to_string().trim_end())))
}

fn factor(vector: &Vector, units: &[(&str, f64)], name: &str) -> Result<f64, ImportError> {
    match units.iter().find(|(unit, _)| *unit == vector.unit) {
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
    let mut table = Table::parse(name, text, |line| match &layout.header {
        Some(header) => line
            .trim_start_matches(['\u{feff}', '"'])
            .starts_with(header.as_str()),
        None => !line.is_empty(),
    })?;
    let mut notes = Vec::new();
    table.drop_cut_row(name, &mut notes);
    let time = table.find_all([layout.time.column.as_str()])?[0];
    let columns = |vector: &Option<Vector>, units: &[(&str, f64)]| match vector {
        Some(vector) => {
            let found = table.find_all(
                [&vector.columns[0], &vector.columns[1], &vector.columns[2]].map(String::as_str),
            )?;
            Ok::<_, ImportError>(Some((found, factor(vector, units, name)?)))
        }
        None => Ok(None),
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
    let start = imu::nanoseconds(layout.time.start_s)
        .ok_or_else(|| table.problem("the layout's start_s is no time since 1970".to_owned()))?;
    let mut samples = Vec::with_capacity(table.len());
    for row in 0..table.len() {
        let t_ns = match table.text(row, time).parse::<i64>() {
            // Whole numbers keep all their digits.
            Ok(whole) => whole.checked_mul(layout.time.unit.ns()),
            Err(_) => {
                imu::nanoseconds(table.number(row, time)? * (layout.time.unit.ns() as f64 / 1e9))
            }
        };
        let Some(t_ns) = t_ns
            .and_then(|t_ns| t_ns.checked_add(start))
            .filter(|t_ns| *t_ns >= 0)
        else {
            let found = table.text(row, time);
            return Err(table.problem(format!(
                "has the time {found:?} in row {}; expected a time from 0 on",
                row + 1
            )));
        };
        let vector = |columns: Option<([usize; 3], f64)>| match columns {
            Some((columns, factor)) => Ok::<_, ImportError>(Some(
                table.vector(row, columns)?.map(|value| value * factor),
            )),
            None => Ok(None),
        };
        samples.push(Sample {
            t_ns,
            force: vector(force)?,
            rate: vector(rate)?,
            orientation: None,
        });
    }
    let device = layout.device.as_deref().unwrap_or(name);
    Ok(Log {
        name: imu::device_name(device),
        samples,
        notes,
    })
}

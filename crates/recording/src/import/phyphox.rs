//! phyphox exports: a zip of one CSV per sensor with `meta/time.csv`, or one such CSV, in any of the five forms that the app
//! offers (comma, tab or semicolon with a decimal point; tab or semicolon with a decimal comma).
//!
//! Times restart at 0; the only absolute clock is `meta/time.csv`, whose START and PAUSE events pair experiment time with UNIX
//! time. `Acceleration` includes gravity, as REP-145 asks; `Linear Acceleration` does not and is used only where nothing else is there.

use super::{
    Files, ImportError, has_header,
    imu::{self, Log, Track},
    is_called,
    table::Table,
};

/// The column of times.
const TIME: &str = "Time (s)";

/// Whether a line is the header of a phyphox table.
pub(super) fn is_header(line: &str) -> bool {
    line.trim_start_matches('"').starts_with(TIME) && line.contains(" x (")
}

const SENSORS: &[(&str, &str)] = &[
    ("Acceleration", "m/s^2"),
    ("Linear Acceleration", "m/s^2"),
    ("Gyroscope", "rad/s"),
];

pub(super) fn read(files: &Files) -> Result<Log, ImportError> {
    let mut notes = Vec::new();
    let starts = match files.only("meta/time.csv", |name, _| is_called(name, "meta/time.csv"))? {
        Some((name, text)) => starts(name, text, &mut notes)?,
        None => Vec::new(),
    };
    let mut tracks: [(&str, Track); 3] = Default::default();
    let (mut seen, mut known) = (Vec::new(), false);
    for (name, text) in files.texts() {
        if !has_header(text, is_header) {
            continue;
        }
        let mut table = Table::parse(name, text, is_header)?;
        table.drop_broken_rows(&files.name, &mut notes);
        table.note_empty(&files.name, &mut notes);
        if let Some(time) = table.find(TIME) {
            table.drop_untimed(time, &files.name, &mut notes);
        }
        seen.extend(table.columns.iter().cloned());
        for ((sensor, unit), (from, track)) in SENSORS.iter().zip(&mut tracks) {
            let names = ["x", "y", "z"].map(|axis| format!("{sensor} {axis} ({unit})"));
            if table.find(&names[0]).is_none() {
                continue;
            }
            known = true;
            let found = read_track(&table, names.each_ref().map(String::as_str), &starts)?;
            if !track.is_empty() && !found.is_empty() {
                return Err(files.two(&names[0], from, name));
            }
            if track.is_empty() {
                (*from, *track) = (name, found);
            }
        }
    }
    let [with_gravity, without, rate] = tracks.map(|(_, track)| track);
    if starts.is_empty() {
        notes.push("there is no meta/time.csv: times begin at 0, not at a date".to_owned());
    }
    let force = if with_gravity.is_empty() {
        if !without.is_empty() {
            notes.push(
                "only the acceleration without gravity was logged: it is no specific force"
                    .to_owned(),
            );
        }
        without
    } else {
        with_gravity
    };
    if force.is_empty() && rate.is_empty() && !known {
        let problem = format!(
            "has no acceleration and no gyroscope columns; found {}",
            seen.join(", ")
        );
        return Err(ImportError::Content {
            name: files.name.clone(),
            problem,
        });
    }
    Ok(Log::join(imu::device_name(&files.name), force, rate, notes))
}

/// Experiment and UNIX time of every START, s.
fn starts(name: &str, text: &str, notes: &mut Vec<String>) -> Result<Vec<(f64, f64)>, ImportError> {
    let mut table = Table::parse(name, text, |line| line.contains("experiment time"))?;
    table.drop_broken_rows("", notes);
    let [event, experiment, system] =
        table.find_all(["event", "experiment time", "system time"])?;
    let mut starts = Vec::new();
    for row in 0..table.len() {
        if table.text(row, event).eq_ignore_ascii_case("START") {
            let start = (table.number(row, experiment)?, table.number(row, system)?);
            if !start.0.is_finite() {
                let problem = "has a START without an experiment time; expected seconds";
                return Err(table.problem_in(row, problem));
            }
            starts.push(start);
        }
    }
    Ok(starts)
}

fn read_track(
    table: &Table,
    names: [&str; 3],
    starts: &[(f64, f64)],
) -> Result<Track, ImportError> {
    let time = table.find_all([TIME])?[0];
    let axes = table.find_all(names)?;
    let mut track = Track::new();
    for row in 0..table.len() {
        let t_s = table.number(row, time)?;
        // The last START before the sample; a sample a hair before the first belongs to it.
        let start = starts
            .iter()
            .rev()
            .find(|(experiment, _)| *experiment <= t_s)
            .or_else(|| starts.first());
        let t_ns = match start {
            // The parts are rounded one by one: a UNIX time in seconds has no digits left for nanoseconds.
            Some((experiment, system)) => imu::nanoseconds(*system)
                .and_then(|base| base.checked_add(((t_s - experiment) * 1e9).round() as i64)),
            None => imu::nanoseconds(t_s),
        };
        // What is too large became the largest.
        let Some(t_ns) = t_ns.filter(|t_ns| (0..i64::MAX).contains(t_ns)) else {
            let problem = format!("has the time {t_s} s; expected seconds from 0 on");
            return Err(table.problem_in(row, &problem));
        };
        track.push((t_ns, table.vector(row, axes)?));
    }
    table.put_in_order(&mut track, |row| row.0)?;
    Ok(track)
}

//! Sensor Logger exports: a folder or zip of `Accelerometer.csv`, `Gravity.csv`, `TotalAcceleration.csv`, `Gyroscope.csv`, `Metadata.csv`.
//!
//! Columns are found by name (`time` in ns since 1970, `x`, `y`, `z`). `Accelerometer.csv` has gravity removed; the specific force is
//! `TotalAcceleration`, or else accelerometer plus gravity. iOS without the app's 'standardisation' has the opposite sign on all axes, and
//! counts uncalibrated accelerations in g.

use super::{
    Files, ImportError, file_name,
    imu::{self, Between, Log, STANDARD_GRAVITY, Track},
    table::Table,
};

/// Times that disagree by so many times are in another unit.
const UNIT: f64 = 300.0;

/// Whether a line is the header of a Sensor Logger table.
pub(super) fn is_header(line: &str) -> bool {
    line.contains("seconds_elapsed")
}

pub(super) fn read(files: &Files) -> Result<Log, ImportError> {
    let mut notes = Vec::new();
    let flipped = flipped(files, &mut notes)?;
    let mut cut = Vec::new();
    let mut track = |sensor: &str| match named(files, sensor)? {
        Some((name, text)) => read_track(name, text, &files.name, &mut cut),
        None => Ok(Track::new()),
    };
    let (total, plain, gravity) = (
        track("TotalAcceleration.csv")?,
        track("Accelerometer.csv")?,
        track("Gravity.csv")?,
    );
    let mut force = if !total.is_empty() {
        total
    } else if !plain.is_empty() && !gravity.is_empty() {
        let [of_gravity, of_plain] = [&gravity, &plain].map(Between::of);
        notes.push("the specific force is Accelerometer plus Gravity".to_owned());
        let without = imu::unpaired(&of_plain, &of_gravity);
        let what = "samples of Accelerometer.csv have no gravity and are left out";
        notes.extend(imu::told(without, plain.len(), what));
        plain
            .iter()
            .filter_map(|&(t_ns, a)| {
                let g = of_gravity.at(t_ns)?;
                Some((t_ns, std::array::from_fn(|axis| a[axis] + g[axis])))
            })
            .collect()
    } else if !plain.is_empty() {
        notes.push(
            "only the acceleration without gravity was logged: it is no specific force".to_owned(),
        );
        plain
    } else {
        track("AccelerometerUncalibrated.csv")?
    };
    // At rest a force of 1 is one g, a force of 9.8 is metres per second squared.
    if imu::usual_length(&force).is_some_and(|length| (0.8..1.3).contains(&length))
        && named(files, "Accelerometer.csv")?.is_none()
    {
        notes.push("accelerations were in g".to_owned());
        for (_, value) in &mut force {
            *value = value.map(|component| component * STANDARD_GRAVITY);
        }
    }
    if flipped {
        for (_, value) in &mut force {
            *value = value.map(|component| -component);
        }
    }
    let mut rate = track("Gyroscope.csv")?;
    if rate.is_empty() {
        rate = track("GyroscopeUncalibrated.csv")?;
    }
    notes.extend(cut);
    if force.is_empty() && rate.is_empty() {
        let names: Vec<&str> = files.texts().map(|(name, _)| name).collect();
        let problem = format!(
            "has no Accelerometer.csv, TotalAcceleration.csv or Gyroscope.csv with rows; found {}",
            names.join(", ")
        );
        return Err(ImportError::Content {
            name: files.name.clone(),
            problem,
        });
    }
    Ok(Log::join(imu::device_name(&files.name), force, rate, notes))
}

/// The file of a name, in whatever folder of a zip.
fn named<'a>(files: &'a Files, file: &str) -> Result<Option<(&'a str, &'a str)>, ImportError> {
    files.only(&format!("the name {file}"), |name, _| {
        file_name(name) == file
    })
}

/// Whether the signs must be turned: iOS without standardisation.
fn flipped(files: &Files, notes: &mut Vec<String>) -> Result<bool, ImportError> {
    let Some((name, text)) = named(files, "Metadata.csv")? else {
        notes.push("there is no Metadata.csv: signs are taken to be Android's".to_owned());
        return Ok(false);
    };
    let table = Table::parse(name, text, |line| {
        line.contains("version") || line.contains("device")
    })?;
    let cell = |column: &str| {
        table
            .find(column)
            .map(|column| table.text(0, column).to_lowercase())
            .unwrap_or_default()
    };
    let ios = cell("platform").contains("ios")
        || cell("device name").contains("iphone")
        || cell("device name").contains("ipad");
    let standard = matches!(cell("standardisation").as_str(), "true" | "1" | "yes");
    if ios && !standard {
        notes.push(
            "iOS signs without standardisation: accelerations were turned to +g up at rest"
                .to_owned(),
        );
    }
    Ok(ios && !standard)
}

fn read_track(
    name: &str,
    text: &str,
    log: &str,
    notes: &mut Vec<String>,
) -> Result<Track, ImportError> {
    let mut table = Table::parse(name, text, is_header)?;
    table.drop_broken_rows(log, notes);
    table.note_empty(log, notes);
    let [time, x, y, z] = table.find_all(["time", "x", "y", "z"])?;
    let elapsed = table.find("seconds_elapsed");
    table.drop_untimed(time, log, notes);
    let mut track = Track::new();
    let mut ends: Option<[(i64, f64); 2]> = None;
    for row in 0..table.len() {
        // Nanoseconds since 1970 have more digits than a double holds.
        let t_ns = match table.text(row, time).parse::<i64>() {
            Ok(t_ns) => t_ns,
            Err(_) => table.number(row, time)? as i64,
        };
        // What is too large became the largest.
        if !(0..i64::MAX).contains(&t_ns) {
            let problem = format!("has the time {t_ns}; expected nanoseconds since 1970");
            return Err(table.problem_in(row, &problem));
        }
        track.push((t_ns, table.vector(row, [x, y, z])?));
        if let Some(elapsed) = elapsed {
            let here = (t_ns, table.number(row, elapsed)?);
            ends = Some([ends.map_or(here, |ends| ends[0]), here]);
        }
    }
    if let Some([(from_ns, from_s), (to_ns, to_s)]) = ends
        && track.is_sorted_by_key(|(t_ns, _)| *t_ns)
    {
        let (span_s, elapsed_s) = ((to_ns - from_ns) as f64 / 1e9, to_s - from_s);
        // Units are a thousand apart; a clock that is set anew changes less.
        if elapsed_s > 0.0 && !(1.0 / UNIT..UNIT).contains(&(span_s / elapsed_s)) {
            return Err(table.problem(format!(
                "has times that span {span_s:e} s as nanoseconds, but seconds_elapsed spans {elapsed_s} s: the column `time` is not in nanoseconds since 1970, as expected"
            )));
        }
    }
    if !track.is_sorted_by_key(|(t_ns, _)| *t_ns) {
        let late = track.windows(2).filter(|w| w[1].0 < w[0].0).count();
        let often = match late {
            1 => "once".to_owned(),
            n => format!("{n} times"),
        };
        notes.push(format!(
            "{name}: the clock steps back {often}; rows were put in the order of their times"
        ));
    }
    table.put_in_order(&mut track, |row| row.0)?;
    Ok(track)
}

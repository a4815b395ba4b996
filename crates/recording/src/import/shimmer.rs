//! Shimmer exports of Consensys: tab or comma, a line `sep=`, a header whose names begin with the device's (`Shimmer_8665_Accel_LN_X_CAL`), a row of
//! units.
//!
//! Times are ms since 1970, or dates; those put on one clock (`TimestampSync`) are preferred. There are up to two accelerometers, both specific
//! force in m/s²: the low-noise one (`LN`) ends at 2 g, which a step can pass, the wide-range one (`WR`) does not.

use super::{
    ImportError,
    date::times_ns,
    imu::{self, Log, STANDARD_GRAVITY, Track},
    table::Table,
};

/// A low-noise sensor that comes so near to its end, m/s², may have been cut off there.
const LOW_NOISE_END: f64 = 1.95 * STANDARD_GRAVITY;

/// How the names of the columns of times end, the best first.
const TIMES: [&str; 4] = [
    "_TimestampSync_Unix_CAL",
    "_TimestampSync_FormattedUnix_CAL",
    "_Timestamp_Unix_CAL",
    "_Timestamp_FormattedUnix_CAL",
];

/// Whether a line is the header of an export.
pub(super) fn is_header(line: &str) -> bool {
    line.contains("_CAL") && TIMES.iter().any(|end| line.contains(end))
}

pub(super) fn read(name: &str, text: &str) -> Result<Log, ImportError> {
    let mut table = Table::parse(name, text, is_header)?;
    let mut notes = Vec::new();
    let units = table.take_units();
    table.drop_broken_rows(name, &mut notes);
    let ends = |end: &str| table.columns.iter().position(|name| name.ends_with(end));
    // The header has one of them.
    let time = TIMES.iter().find_map(|end| ends(end)).unwrap_or_default();
    let device = TIMES
        .iter()
        .find_map(|end| table.columns[time].strip_suffix(end));
    let device = device.unwrap_or_default().to_owned();
    table.drop_untimed(time, name, &mut notes);
    let others = table.columns.iter().filter(|name| {
        !name.is_empty()
            && !name
                .strip_prefix(&device)
                .is_some_and(|end| end.starts_with('_'))
    });
    if others.count() > 0 {
        notes.push(format!(
            "it has columns of other devices too: those of {device} are taken"
        ));
    }
    let axes = |sensor: &str| {
        let names = ["X", "Y", "Z"].map(|axis| format!("{device}_{sensor}_{axis}_CAL"));
        let there = names.iter().any(|name| table.find(name).is_some());
        let columns = there.then(|| table.find_all(names.each_ref().map(String::as_str)));
        columns.transpose()
    };
    let times_ns = times_ns(&table, time, 1_000_000)?;
    let track = |columns: Option<[usize; 3]>, factor: f64| {
        columns.map_or(Ok(Track::new()), |columns| {
            table.track(&times_ns, columns, factor)
        })
    };
    let (low_noise, wide) = (
        track(axes("Accel_LN")?, 1.0)?,
        track(axes("Accel_WR")?, 1.0)?,
    );
    let at_its_end = low_noise
        .iter()
        .any(|(_, force)| force.iter().any(|x| x.abs() > LOW_NOISE_END));
    let force = if low_noise.is_empty() || at_its_end && !wide.is_empty() {
        if at_its_end {
            notes.push(
                "the low-noise accelerometer came to its end at 2 g: the wide-range one is taken"
                    .to_owned(),
            );
        }
        wide
    } else {
        low_noise
    };
    let gyro = axes("Gyro")?;
    let unit = gyro.and_then(|[x, ..]| units.as_ref()?.get(x));
    let factor = match unit {
        Some("rad/s") => 1.0,
        None | Some("deg/s") => 1f64.to_radians(),
        Some(unit) => {
            return Err(table.problem(format!(
                "has the unit {unit:?} for the gyroscope; expected deg/s or rad/s"
            )));
        }
    };
    let rate = track(gyro, factor)?;
    if force.is_empty() && rate.is_empty() && table.len() > 0 {
        return Err(table.problem(format!(
            "has neither {device}_Accel_LN_X_CAL, {device}_Accel_WR_X_CAL nor {device}_Gyro_X_CAL; found {}",
            table.listed()
        )));
    }
    Ok(Log::join(imu::device_name(name), force, rate, notes))
}

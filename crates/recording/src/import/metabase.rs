//! MetaBase exports of MbientLab sensors: a CSV for the accelerometer (`x-axis (g)`) and one for the gyroscope (`x-axis (deg/s)`), each with its time as
//! `epoc (ms)` since 1970. Both of one device come as a folder or zip; of more than one, nothing tells which belong together.

use super::{
    Files, ImportError,
    date::times_ns,
    has_header,
    imu::{self, Log, STANDARD_GRAVITY, Track},
    table::Table,
};

const FORCE: &str = "x-axis (g)";
const RATE: &str = "x-axis (deg/s)";

/// Whether a line is the header of an export.
pub(super) fn is_header(line: &str) -> bool {
    line.contains("epoc") && (line.contains(FORCE) || line.contains(RATE))
}

pub(super) fn read(files: &Files) -> Result<Log, ImportError> {
    let mut notes = Vec::new();
    let mut track = |first: &str, unit: &str, factor: f64| {
        let head =
            |_: &str, text: &str| has_header(text, |line| is_header(line) && line.contains(first));
        let Some((name, text)) = files.only(first, head)? else {
            return Ok(Track::new());
        };
        let mut table = Table::parse(name, text, is_header)?;
        table.drop_broken_rows(&files.name, &mut notes);
        table.note_empty(&files.name, &mut notes);
        let epoch = if table.find("epoch (ms)").is_some() {
            "epoch (ms)"
        } else {
            "epoc (ms)"
        };
        let time = table.find_all([epoch])?[0];
        table.drop_untimed(time, &files.name, &mut notes);
        let names = ["x", "y", "z"].map(|axis| format!("{axis}-axis ({unit})"));
        let axes = table.find_all(names.each_ref().map(String::as_str))?;
        table.track(&times_ns(&table, time, 1_000_000)?, axes, factor)
    };
    let force = track(FORCE, "g", STANDARD_GRAVITY)?;
    let rate = track(RATE, "deg/s", 1f64.to_radians())?;
    Ok(Log::join(imu::device_name(&files.name), force, rate, notes))
}

//! Raw CSV exports of Axivity's AX3 and AX6 (OmGui, cwa-convert): no header, a date and a clock, the acceleration in g, of an AX6 the angular velocity in
//! deg/s behind it.

use super::{
    ImportError,
    date::times_ns,
    imu::{self, Log, STANDARD_GRAVITY, Track},
    table::Table,
};

pub(super) const NAME: &str = "Axivity";
const COLUMNS: [&str; 7] = ["time", "ax", "ay", "az", "gx", "gy", "gz"];
/// Lengths of the specific force at rest that are one g, in g.
const ONE_G: std::ops::Range<f64> = 0.8..1.3;

/// Whether a text's first row is one of an export.
pub(super) fn is_export(text: &str) -> bool {
    let first = text.lines().next();
    let cells: Vec<&str> = first.unwrap_or_default().split(',').collect();
    let dated = |cell: &str| {
        // 2025-11-24 16:00:00.000
        cell.get(..11)
            .is_some_and(|d| d.chars().filter(|c| *c == '-').count() == 2 && d.ends_with(' '))
            && cell.matches(':').count() == 2
    };
    matches!(cells.len(), 4 | 7)
        && dated(cells[0])
        && cells[1..].iter().all(|cell| cell.parse::<f64>().is_ok())
}

pub(super) fn read(name: &str, text: &str) -> Result<Log, ImportError> {
    let mut table = Table::headless(name, text, &COLUMNS)?;
    let turns = table.columns.len() == COLUMNS.len();
    let behind = if turns {
        ", angular velocity in deg/s"
    } else {
        ""
    };
    let mut notes = vec![format!(
        "it has no header: taken for an export of Axivity's, a date (UTC), acceleration in g{behind}"
    )];
    table.drop_broken_rows(name, &mut notes);
    table.drop_untimed(0, name, &mut notes);
    let times_ns = times_ns(&table, 0, 1)?;
    let force = table.track(&times_ns, [1, 2, 3], STANDARD_GRAVITY)?;
    let usual_g = imu::usual_length(&force).unwrap_or(0.0) / STANDARD_GRAVITY;
    if !ONE_G.contains(&usual_g) {
        return Err(table.problem(format!(
            "is laid out as an export of Axivity's, but the acceleration is {usual_g:.2} as a rule; expected 1 g"
        )));
    }
    let rate = match turns {
        true => table.track(&times_ns, [4, 5, 6], 1f64.to_radians())?,
        false => Track::new(),
    };
    Ok(Log::join(imu::device_name(name), force, rate, notes))
}

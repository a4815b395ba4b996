//! Times as logs write them: numbers, a date and a clock, or a clock alone.

use std::str::FromStr as _;

use prost_types::Timestamp;

use super::{ImportError, imu, table::Table, wrapping::Wrapping};

const DAY_NS: i64 = 86_400_000_000_000;
/// A row of a clock alone may be so late, over midnight too.
const LATE_NS: i64 = 1_000_000_000;

/// The times of all rows, ns from 1970 or from the device's start: numbers of so many nanoseconds, dates or clocks.
pub(super) fn times_ns(
    table: &Table,
    column: usize,
    unit_ns: i64,
) -> Result<Vec<i64>, ImportError> {
    let mut clock = Wrapping::new(DAY_NS, LATE_NS);
    let read = |row| {
        let cell = table.text(row, column);
        let t_ns = if cell.contains(':') {
            read_date(cell, &mut clock)
        } else if let Ok(whole) = cell.parse::<i64>() {
            // Whole numbers keep all their digits.
            whole.checked_mul(unit_ns)
        } else {
            imu::nanoseconds(table.number(row, column)? * (unit_ns as f64 / 1e9))
        };
        t_ns.filter(|t_ns| *t_ns >= 0).ok_or_else(|| {
            let problem =
                format!("has the time {cell:?}; expected a time from 0 on, or a date and a clock");
            table.problem_in(row, &problem)
        })
    };
    (0..table.len()).map(read).collect()
}

/// Nanoseconds since 1970 (UTC where no zone is given) of `2018-10-03 17:23:55.464`, RFC 3339 or the same with slashes; of a clock alone,
/// `17:23:55.464` or `17:23:55:464`, since its first midnight. `None` for anything else, and for times before 1970.
fn read_date(cell: &str, clock: &mut Wrapping) -> Option<i64> {
    let cell = cell.replace('/', "-").replace(',', ".");
    if cell.find(':')? > 2 {
        return nanoseconds(&cell);
    }
    // Behind the last colon of four parts stand milliseconds, with or without zeros before them.
    let time = match cell.rsplit_once(':') {
        Some((whole, part)) if whole.matches(':').count() == 2 && !part.is_empty() => {
            format!("{whole}.{part:0>3}")
        }
        _ => cell,
    };
    let padding = if time.find(':')? == 1 { "0" } else { "" };
    clock.next(nanoseconds(&format!("1970-01-01 {padding}{time}"))?)
}

fn nanoseconds(text: &str) -> Option<i64> {
    let time = Timestamp::from_str(text).ok()?;
    let ns = time
        .seconds
        .checked_mul(1_000_000_000)?
        .checked_add(i64::from(time.nanos))?;
    (ns >= 0).then_some(ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_and_clocks() {
        let clock = || Wrapping::new(DAY_NS, LATE_NS);
        // 17,807 days after 1970-01-01, as `date -d @1538587435 -u` says.
        let expected = 1_538_587_435_464_000_000;
        for text in [
            "2018-10-03 17:23:55.4640",
            "2018-10-03T17:23:55.464Z",
            "2018/10/03 17:23:55.464",
            "2018-10-03 17:23:55,464",
            "2018-10-03T19:23:55.464+02:00",
        ] {
            assert_eq!(read_date(text, &mut clock()), Some(expected), "{text}");
        }
        let mut one = clock();
        let hour = 3_600_000_000_000;
        for (text, ns) in [
            ("9:00:00.5", 9 * hour + 500_000_000),
            ("23:00:00:500", 23 * hour + 500_000_000),
            ("22:59:59.9", 23 * hour - 100_000_000),
            ("00:00:00.25", 24 * hour + 250_000_000),
            ("23:59:59.75", 24 * hour - 250_000_000),
            ("01:00:00", 25 * hour),
            ("01:00:01:0", 25 * hour + 1_000_000_000),
            ("01:00:01:10", 25 * hour + 1_010_000_000),
            ("01:00:01:250", 25 * hour + 1_250_000_000),
        ] {
            assert_eq!(read_date(text, &mut one), Some(ns), "{text}");
        }
        for text in [
            "",
            "12",
            "1.5",
            "x:y:z",
            "25:00:00",
            "10:00:00:",
            "10:00:",
            "10:00:00.5:",
            "2018-10-03 17:23:55:",
            "2018-10-03T17:23:",
            "1969-12-31 23:59:59",
            "2018-13-03 00:00:00",
        ] {
            assert_eq!(read_date(text, &mut clock()), None, "{text}");
        }
    }
}

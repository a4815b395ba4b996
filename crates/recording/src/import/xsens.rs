//! Movella DOT and Xsens exports: some preamble lines, then a header with `SampleTimeFine`, a count of the sensor's clock that wraps
//! at 2³².
//!
//! It counts microseconds in DOT exports and 1/10,000 s in those that MT Manager makes of MTi devices. The latter tell the rate
//! (`// Update Rate: 100.0Hz`), and the rate tells the unit.
//!
//! `Acc_*` is specific force. Where only `FreeAcc_*` is there (gravity removed, earth frame), the specific force follows from
//! it and the orientation: f = R⁻¹ (a + g ẑ). `Gyr_*` is in deg/s in DOT exports and in rad/s in those of MT Manager, which begin
//! with `//`.

use super::{
    ImportError,
    imu::{self, Log, STANDARD_GRAVITY, Sample},
    table::Table,
    wrapping::Wrapping,
};
use crate::text::counted;

/// A sample may come so many counts late, over a wrap too.
const LATE: i64 = 1_000_000;

/// Whether a line is the header of an export.
pub(super) fn is_header(line: &str) -> bool {
    line.contains("SampleTimeFine")
}

pub(super) fn read(name: &str, text: &str) -> Result<Log, ImportError> {
    let mut table = Table::parse(name, text, is_header)?;
    let mut notes = Vec::new();
    table.drop_broken_rows(name, &mut notes);
    let time = table.find_all(["SampleTimeFine"])?[0];
    table.drop_untimed(time, name, &mut notes);
    let all = |names: [&str; 3]| {
        names[0..]
            .iter()
            .any(|name| table.find(name).is_some())
            .then(|| table.find_all(names))
            .transpose()
    };
    let force = all(["Acc_X", "Acc_Y", "Acc_Z"])?;
    let free = all(["FreeAcc_X", "FreeAcc_Y", "FreeAcc_Z"])?;
    let rate = all(["Gyr_X", "Gyr_Y", "Gyr_Z"])?;
    let euler = all(["Euler_X", "Euler_Y", "Euler_Z"])?.or(all(["Roll", "Pitch", "Yaw"])?);
    let quaternion = match table.find("Quat_W").or_else(|| table.find("Quat_q0")) {
        Some(_) if table.find("Quat_W").is_some() => {
            Some(table.find_all(["Quat_X", "Quat_Y", "Quat_Z", "Quat_W"])?)
        }
        Some(_) => Some(table.find_all(["Quat_q1", "Quat_q2", "Quat_q3", "Quat_q0"])?),
        None => None,
    };
    if force.is_none() && free.is_none() && rate.is_none() {
        return Err(table.problem(format!(
            "has neither Acc_X, FreeAcc_X nor Gyr_X; found {}",
            table.listed()
        )));
    }
    let radians = text.trim_start().starts_with("//");
    if rate.is_some() && !radians {
        notes.push("angular velocities were in deg/s".to_owned());
    }
    let from_free = force.is_none() && free.is_some() && (quaternion.is_some() || euler.is_some());
    if from_free {
        notes.push("the specific force was computed from FreeAcc and the orientation".to_owned());
    } else if force.is_none() && free.is_some() {
        notes.push(
            "FreeAcc without an orientation is no specific force and was left out".to_owned(),
        );
    }

    let (counts, turns) = counts(&table, time)?;
    let tick_ns = tick_ns(&table, &counts, told_rate(text), radians, &mut notes)?;
    let mut samples = Vec::with_capacity(table.len());
    for (row, count) in counts.into_iter().enumerate() {
        let orientation = match (quaternion, euler) {
            (Some([x, y, z, w]), _) => Some([
                table.number(row, x)?,
                table.number(row, y)?,
                table.number(row, z)?,
                table.number(row, w)?,
            ]),
            (None, Some(angles)) => Some(from_euler_deg(table.vector(row, angles)?)),
            (None, None) => None,
        };
        let force = match (force, free, orientation) {
            (Some(columns), _, _) => Some(table.vector(row, columns)?),
            (None, Some(columns), Some(orientation)) => {
                let [x, y, z] = table.vector(row, columns)?;
                Some(into_sensor(orientation, [x, y, z + STANDARD_GRAVITY]))
            }
            _ => None,
        };
        let rate = match rate {
            Some(columns) if radians => Some(table.vector(row, columns)?),
            Some(columns) => Some(table.vector(row, columns)?.map(f64::to_radians)),
            None => None,
        };
        samples.push(Sample {
            t_ns: count.saturating_mul(tick_ns),
            force,
            rate,
            orientation,
        });
    }
    table.put_in_order(&mut samples, |sample| sample.t_ns)?;
    if turns > 0 {
        let times = counted(turns.unsigned_abs(), "time", "times");
        notes.push(format!("SampleTimeFine wrapped {times}"));
    }
    Ok(Log {
        name: imu::device_name(name),
        samples,
        notes,
    })
}

/// SampleTimeFine of every row, going on past its wraps, and how many these are.
fn counts(table: &Table, time: usize) -> Result<(Vec<i64>, i64), ImportError> {
    let mut counts = Vec::with_capacity(table.len());
    let mut clock = Wrapping::new(1 << 32, LATE);
    for row in 0..table.len() {
        let fine = table.number(row, time)?;
        // OK because the range is checked.
        let count = (0.0..4_294_967_296.0)
            .contains(&fine)
            .then(|| clock.next(fine as i64));
        let Some(count) = count.flatten() else {
            let problem = format!("has SampleTimeFine {fine}; expected a count below 2^32");
            return Err(table.problem_in(row, &problem));
        };
        counts.push(count);
    }
    Ok((counts, clock.wraps()))
}

/// The rate that the preamble tells, Hz.
fn told_rate(text: &str) -> Option<f64> {
    let preamble = text.lines().take_while(|line| !is_header(line));
    preamble
        .filter_map(|line| line.trim().strip_prefix("//")?.split_once(':'))
        .find(|(name, _)| name.trim().eq_ignore_ascii_case("update rate"))
        .and_then(|(_, rate)| {
            let rate = rate.trim_matches(|c: char| !c.is_ascii_digit());
            rate.replace(',', ".").parse().ok()
        })
        .filter(|rate| *rate > 0.0)
}

/// What SampleTimeFine counts, ns: the unit in which the usual step fits the rate, microseconds where no rate is told.
fn tick_ns(
    table: &Table,
    counts: &[i64],
    told_hz: Option<f64>,
    of_mt_manager: bool,
    notes: &mut Vec<String>,
) -> Result<i64, ImportError> {
    const MICROSECOND: i64 = 1_000;
    const TENTH_OF_MILLISECOND: i64 = 100_000;
    /// The usual step may differ by so much from what the rate says.
    const TOLERANCE: f64 = 0.2;
    let mut steps: Vec<i64> = counts.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.retain(|step| *step > 0);
    steps.sort_unstable();
    let (Some(rate_hz), Some(&step)) = (told_hz, steps.get(steps.len() / 2)) else {
        if of_mt_manager {
            notes.push(
                "no update rate is told: SampleTimeFine is taken to count microseconds".to_owned(),
            );
        }
        return Ok(MICROSECOND);
    };
    let fits = |tick_ns: &i64| ((step * tick_ns) as f64 / 1e9 * rate_hz - 1.0).abs() <= TOLERANCE;
    match [MICROSECOND, TENTH_OF_MILLISECOND].into_iter().find(fits) {
        Some(MICROSECOND) => Ok(MICROSECOND),
        Some(tick_ns) => {
            notes.push(format!(
                "SampleTimeFine counts 1/10,000 s: its usual step is {step} at an update rate of {rate_hz} Hz"
            ));
            Ok(tick_ns)
        }
        None => Err(table.problem(format!(
            "has a usual step of SampleTimeFine of {step} at an update rate of {rate_hz} Hz; expected about {:.0} (1/10,000 s) or {:.0} (microseconds)",
            1e4 / rate_hz,
            1e6 / rate_hz
        ))),
    }
}

/// Quaternion (x, y, z, w) of R = R_z(yaw) R_y(pitch) R_x(roll), angles in degrees.
fn from_euler_deg(angles: [f64; 3]) -> [f64; 4] {
    let [(sr, cr), (sp, cp), (sy, cy)] = angles.map(|angle| (angle.to_radians() / 2.0).sin_cos());
    [
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    ]
}

/// A vector of the earth frame in the sensor's: v' = R⁻¹ v for a unit quaternion.
fn into_sensor([x, y, z, w]: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    // v' = v + 2 w (v × u) + 2 (v × u) × u, with u = (x, y, z): the rotation by the conjugate.
    let u = [x, y, z];
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let t = cross(v, u);
    let tt = cross(t, u);
    std::array::from_fn(|i| v[i] + 2.0 * w * t[i] + 2.0 * tt[i])
}

//! Movella DOT and Xsens exports: some preamble lines, then a header with `SampleTimeFine`, microseconds of the sensor's clock that
//! wrap at 2³².
//!
//! `Acc_*` is specific force. Where only `FreeAcc_*` is there (gravity removed, earth frame), the specific force follows from
//! it and the orientation: f = R⁻¹ (a + g ẑ). `Gyr_*` is in deg/s in DOT exports and in rad/s in those of MT Manager, which begin
//! with `//`.

use super::{
    ImportError,
    imu::{self, Log, STANDARD_GRAVITY, Sample},
    table::Table,
};

/// Whether a line is the header of an export.
pub(super) fn is_header(line: &str) -> bool {
    line.contains("SampleTimeFine")
}

pub(super) fn read(name: &str, text: &str) -> Result<Log, ImportError> {
    let table = Table::parse(name, text, is_header)?;
    let time = table.find_all(["SampleTimeFine"])?[0];
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
            table.columns.join(", ")
        )));
    }
    let mut notes = Vec::new();
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

    let mut samples = Vec::with_capacity(table.len());
    let (mut turns, mut last) = (0i64, None::<i64>);
    for row in 0..table.len() {
        let fine = table.number(row, time)?;
        if !(0.0..4_294_967_296.0).contains(&fine) {
            return Err(table.problem(format!(
                "has SampleTimeFine {fine} in row {}; expected microseconds below 2^32",
                row + 1
            )));
        }
        // OK because the range was checked.
        let fine = fine as i64;
        // A step back of more than half the range is the clock's wrap, a smaller one is an error of the log and stays.
        if last.is_some_and(|last| last - fine > 1 << 31) {
            turns += 1;
        }
        last = Some(fine);
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
            t_ns: (fine + (turns << 32)) * 1000,
            force,
            rate,
            orientation,
        });
    }
    if turns > 0 {
        notes.push(format!("SampleTimeFine wrapped {turns} times"));
    }
    Ok(Log {
        name: imu::device_name(name),
        samples,
        notes,
    })
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

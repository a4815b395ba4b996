//! The published archive's logs (`logs.npz`, NumPy) as recordings of the project's own topics.
//!
//! The archive's vertical axis is y: a vector (x, y, z) of it is (x, −z, y) here, a quarter turn C about x. A rotation R becomes
//! C R Cᵀ, so a quaternion (x, y, z, w) becomes (x, −z, y, w). The logged angles stay as they are: its `roll` is our roll, its `pitch`
//! turns about its vertical and is our yaw; the tilt of the pole is not logged and follows from the quaternion, with
//! R = R_z(γ) R_y(β) R_x(α) in the archive's axes: pitch = −γ = −atan2(R₂₁, R₁₁).

use std::{
    collections::BTreeMap,
    f64::consts::TAU,
    fs::File,
    io::{BufReader, Read as _},
    path::Path,
};

use zip::{ZipArchive, result::ZipError};

use super::ImportError;
use crate::{
    cdr::{Header, Quaternion, TfMessage, Time, Transform, TransformStamped},
    schema::rath,
    topics::{self, MessageKind},
    write::RecordingWriter,
};

/// Total mass of body and load in the archive's runs, kg.
const MASS_KG: f64 = 60.0;
/// Where the archive's statistics begin, s.
const ANALYSIS_START_S: f64 = 15.0;

/// A larger array is no log of a walk.
const MAX_ARRAY_BYTES: u64 = 1 << 30;

/// One run as the archive logs it, in the archive's axes.
struct Log {
    t_s: Vec<f64>,
    y_m: Vec<f64>,
    roll_rad: Vec<f64>,
    pitch_rad: Vec<f64>,
    position_m: Vec<[f64; 3]>,
    quaternion: Vec<[f64; 4]>,
    carriers_m: Vec<Vec<[f64; 3]>>,
    phase_rad: Vec<Vec<f64>>,
    force_n: Vec<Vec<f64>>,
}

/// Writes the log at `path` as a recording; `writer` has had no message yet. Returns the number of messages.
///
/// Times become whole nanoseconds, which the archive's step of 33 ms is exactly.
pub fn ingest(path: &Path, writer: &mut RecordingWriter) -> Result<u64, ImportError> {
    let log = read(path)?;
    writer.metadata("rath", &metadata(path))?;
    write(&log, writer)
}

fn metadata(path: &Path) -> BTreeMap<String, String> {
    let mut values: BTreeMap<String, String> = [
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
        ("source", "archive".to_owned()),
        ("analysis_start_s", ANALYSIS_START_S.to_string()),
        ("mass_kg", MASS_KG.to_string()),
        ("gravity_m_per_s2", "9.81".to_owned()),
    ]
    .map(|(key, value)| (key.to_owned(), value))
    .into();
    // The archive's folders are named CONDITION/seed_N.
    let mut folders = path.iter().rev().skip(1).filter_map(|part| part.to_str());
    if let Some(seed) = folders
        .next()
        .and_then(|folder| folder.strip_prefix("seed_"))
    {
        values.insert("seed".to_owned(), seed.to_owned());
        if let Some(condition) = folders.next() {
            values.insert("scene".to_owned(), condition.to_owned());
        }
    }
    values
}

/// A column of the archive as rows of `width` numbers.
struct Columns<'a> {
    name: &'a str,
    archive: ZipArchive<BufReader<File>>,
}

impl Columns<'_> {
    fn problem(&self, problem: String) -> ImportError {
        ImportError::Content {
            name: self.name.to_owned(),
            problem,
        }
    }

    /// Reads an array; `shape` has `None` where any length is right. Returns the lengths and the numbers in C order.
    fn array(
        &mut self,
        key: &str,
        shape: &[Option<u64>],
    ) -> Result<(Vec<u64>, Vec<f64>), ImportError> {
        let mut names: Vec<String> = self
            .archive
            .file_names()
            .map(|file| file.trim_end_matches(".npy").to_owned())
            .collect();
        let name = self.name;
        let problem = |problem: String| ImportError::Content {
            name: name.to_owned(),
            problem,
        };
        let entry = match self.archive.by_name(&format!("{key}.npy")) {
            Ok(entry) => entry,
            Err(ZipError::FileNotFound) => {
                names.sort_unstable();
                return Err(problem(format!(
                    "has no array {key:?}; found {}",
                    names.join(", ")
                )));
            }
            Err(error) => return Err(problem(format!("array {key:?} cannot be read: {error}"))),
        };
        let array = npyz::NpyFile::new(entry.take(MAX_ARRAY_BYTES))
            .map_err(|error| problem(format!("array {key:?} cannot be read: {error}")))?;
        let lengths = array.shape().to_vec();
        let fits = lengths.len() == shape.len()
            && lengths
                .iter()
                .zip(shape)
                .all(|(found, wanted)| wanted.is_none_or(|wanted| wanted == *found));
        if !fits {
            let wanted: Vec<String> = shape
                .iter()
                .map(|length| length.map_or("any".to_owned(), |length| length.to_string()))
                .collect();
            return Err(problem(format!(
                "array {key:?} has the shape {lengths:?}; expected [{}]",
                wanted.join(", ")
            )));
        }
        if lengths.len() > 1 && array.order() != npyz::Order::C {
            return Err(problem(format!(
                "array {key:?} is in Fortran order; expected C order"
            )));
        }
        // A header may claim any shape: what is not there is found out before memory is taken for it.
        let count = lengths
            .iter()
            .try_fold(1u64, |count, &length| count.checked_mul(length));
        if count.is_none_or(|count| count > MAX_ARRAY_BYTES / 8) {
            return Err(problem(format!(
                "array {key:?} has the shape {lengths:?}; at most {} numbers can be read",
                MAX_ARRAY_BYTES / 8
            )));
        }
        match array.into_vec::<f64>() {
            Ok(values) => Ok((lengths, values)),
            Err(error) => Err(problem(format!(
                "array {key:?} does not hold float64 numbers: {error}"
            ))),
        }
    }

    fn rows<const N: usize>(&mut self, key: &str, rows: u64) -> Result<Vec<[f64; N]>, ImportError> {
        let (_, values) = self.array(key, &[Some(rows), Some(N as u64)])?;
        Ok(values.as_chunks::<N>().0.to_vec())
    }

    fn table(
        &mut self,
        key: &str,
        rows: u64,
        width: Option<u64>,
    ) -> Result<Vec<Vec<f64>>, ImportError> {
        let (lengths, values) = self.array(key, &[Some(rows), width])?;
        // OK because the array was read, so its lengths fit in memory; a width of zero gives no rows to cut.
        let width = lengths[1] as usize;
        if width == 0 {
            return Err(self.problem(format!(
                "array {key:?} has no columns; expected one per carrier"
            )));
        }
        Ok(values.chunks_exact(width).map(<[f64]>::to_vec).collect())
    }
}

fn read(path: &Path) -> Result<Log, ImportError> {
    let name = path.display().to_string();
    let file = File::open(path).map_err(|cause| ImportError::Io {
        name: name.clone(),
        cause,
    })?;
    let archive = ZipArchive::new(BufReader::new(file)).map_err(|error| ImportError::Content {
        name: name.clone(),
        problem: format!("is not a NumPy archive (.npz): {error}"),
    })?;
    let mut columns = Columns {
        name: &name,
        archive,
    };
    let (lengths, t_s) = columns.array("t", &[None])?;
    let n = lengths[0];
    if n == 0 {
        return Err(
            columns.problem("array \"t\" is empty; expected at least one sample".to_owned())
        );
    }
    if let Some(position) = t_s.iter().position(|t| !(0.0..9e9).contains(t)) {
        return Err(columns.problem(format!(
            "t[{position}] is {}; expected seconds from 0 on",
            t_s[position]
        )));
    }
    if let Some(late) = t_s.windows(2).position(|pair| pair[1] < pair[0]) {
        return Err(columns.problem(format!(
            "t[{}] is {} after {}; expected times that go on",
            late + 1,
            t_s[late + 1],
            t_s[late]
        )));
    }
    let phase_rad = columns.table("walker_phase", n, None)?;
    let carriers = phase_rad[0].len() as u64;
    let (_, positions) = columns.array("walker_pos", &[Some(n), Some(carriers), Some(3)])?;
    Ok(Log {
        y_m: columns.array("y", &[Some(n)])?.1,
        roll_rad: columns.array("roll", &[Some(n)])?.1,
        pitch_rad: columns.array("pitch", &[Some(n)])?.1,
        position_m: columns.rows("pal_pos", n)?,
        quaternion: columns.rows("pal_quat", n)?,
        carriers_m: positions
            .chunks_exact(3 * carriers as usize)
            .map(|row| row.as_chunks::<3>().0.to_vec())
            .collect(),
        force_n: columns.table("forces", n, Some(carriers))?,
        phase_rad,
        t_s,
    })
}

/// An archive vector in our axes.
fn turned([x, y, z]: [f64; 3]) -> [f64; 3] {
    [x, -z, y]
}

/// γ of R = R_z(γ) R_y(β) R_x(α), rad, from the archive's quaternion: atan2(R₂₁, R₁₁).
fn gamma_rad([x, y, z, w]: [f64; 4]) -> f64 {
    (2.0 * (x * y + z * w)).atan2(1.0 - 2.0 * (y * y + z * z))
}

fn vector([x, y, z]: [f64; 3]) -> rath::Vector3 {
    rath::Vector3 { x, y, z }
}

/// A phase without jumps of whole turns, on from the last one that is a number, which is NaN before the first.
fn unwrapped(last_rad: &mut f64, phase_rad: f64) -> f64 {
    let turns = match last_rad.is_finite() {
        true => ((*last_rad - phase_rad) / TAU).round(),
        false => 0.0,
    };
    let on = phase_rad + turns * TAU;
    if on.is_finite() {
        *last_rad = on;
    }
    on
}

fn write(log: &Log, writer: &mut RecordingWriter) -> Result<u64, ImportError> {
    let state = writer.channel(topics::STATE, MessageKind::RathState)?;
    let phases = writer.channel(topics::PHASES, MessageKind::Phases)?;
    let forces = writer.channel(topics::FORCES, MessageKind::HandleForces)?;
    let tf = writer.channel(topics::TF, MessageKind::Tf)?;
    let mut last_rad = vec![f64::NAN; log.phase_rad[0].len()];
    for i in 0..log.t_s.len() {
        // OK because times were checked to lie within nanoseconds in 63 bits.
        let t_ns = (log.t_s[i] * 1e9).round() as i64;
        let time_s = log.t_s[i];
        let [x, y, z] = turned(log.position_m[i]);
        let [qx, qy, qz] = turned([
            log.quaternion[i][0],
            log.quaternion[i][1],
            log.quaternion[i][2],
        ]);
        let qw = log.quaternion[i][3];
        debug_assert_eq!(z, log.y_m[i]);
        writer.message(
            state,
            t_ns,
            &rath::State {
                time_s,
                // The height column is the archive's own; it is what its statistics are made of.
                position_m: Some(vector([x, y, log.y_m[i]])),
                orientation: Some(rath::Quaternion {
                    x: qx,
                    y: qy,
                    z: qz,
                    w: qw,
                }),
                velocity_m_per_s: None,
                angular_velocity_rad_per_s: None,
                roll_rad: log.roll_rad[i],
                pitch_rad: -gamma_rad(log.quaternion[i]),
                yaw_rad: log.pitch_rad[i],
            },
        )?;
        let phases_now = last_rad.iter_mut().zip(&log.phase_rad[i]);
        let phase_rad: Vec<f64> = phases_now
            .map(|(last, phase)| unwrapped(last, *phase))
            .collect();
        let (sin, cos) = log.phase_rad[i]
            .iter()
            .fold((0.0, 0.0), |(sin, cos), phase| {
                (sin + phase.sin(), cos + phase.cos())
            });
        writer.message(
            phases,
            t_ns,
            &rath::Phases {
                time_s,
                order_parameter: f64::hypot(sin, cos) / phase_rad.len() as f64,
                phase_rad,
                ..rath::Phases::default()
            },
        )?;
        writer.message(
            forces,
            t_ns,
            &rath::HandleForces {
                time_s,
                normal_n: log.force_n[i].clone(),
                in_contact: log.force_n[i].iter().map(|force| *force > 0.0).collect(),
                ..rath::HandleForces::default()
            },
        )?;
        let placed =
            |child: String, translation: [f64; 3], rotation: Quaternion| TransformStamped {
                header: Header {
                    stamp: Time::from_ns(t_ns),
                    frame_id: "world".to_owned(),
                },
                child_frame_id: child,
                transform: Transform {
                    translation: translation.into(),
                    rotation,
                },
            };
        let mut transforms = vec![placed(
            "rath".to_owned(),
            [x, y, z],
            Quaternion {
                x: qx,
                y: qy,
                z: qz,
                w: qw,
            },
        )];
        for (number, carrier) in log.carriers_m[i].iter().enumerate() {
            transforms.push(placed(
                format!("carrier_{}", number + 1),
                turned(*carrier),
                Quaternion::default(),
            ));
        }
        writer.message(tf, t_ns, &TfMessage { transforms })?;
    }
    Ok(4 * log.t_s.len() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_phase_goes_on_past_what_is_no_number() {
        let mut last = f64::NAN;
        let known = [3.0, 3.5, f64::NAN, 6.5, 9.0];
        let found = [3.0, 3.5 - TAU, f64::NAN, 6.5 - TAU, 9.0 - TAU];
        for (phase, known) in found.into_iter().zip(known) {
            let on = unwrapped(&mut last, phase);
            assert!(
                (on - known).abs() < 1e-12 || on.is_nan() && known.is_nan(),
                "{on}"
            );
        }
    }

    #[test]
    fn tilt_is_the_third_angle() {
        // R_z(γ) with γ = 0.3.
        let half = 0.15f64;
        assert!((gamma_rad([0.0, 0.0, half.sin(), half.cos()]) - 0.3).abs() < 1e-15);
    }
}

//! `--out`: the signals as one table, a row per time, a column per signal named by its path.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io::Write;
use std::path::Path;

use recording::read::{ReadError, Recording};
use recording::signal::field_of;
use recording::{Finding, Signal};

use crate::examine::Request;
use crate::quaternion::{ANGLES, angles};
use crate::report::quoted;

/// Why a table could not be written. Nothing is left under the final name.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The name says neither CSV nor Parquet.
    #[error("{0}: cannot tell what kind of table to write; name it .csv or .parquet")]
    Kind(String),
    /// This program was built without Parquet.
    #[error("{0}: this program was built without Parquet (feature `tables`); write .csv instead")]
    Without(String),
    /// No signal fits.
    #[error("{0}: no signal fits, so there is no table to write")]
    Empty(String),
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The file cannot be written.
    #[error("{name}: cannot be written: {source}; no file of that name was made or changed")]
    Io {
        /// The file.
        name: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The table's library refused.
    #[error("{name}: cannot be written: {problem}; no file of that name was made or changed")]
    Format {
        /// The file.
        name: String,
        /// What the library said.
        problem: String,
    },
}

/// Signals on one time axis, the union of their times. They are put on it block by block of rows, so that nothing is held but them.
struct Table {
    /// Log time of each row, nanoseconds, ascending.
    time_ns: Vec<i64>,
    start_ns: i64,
    signals: Vec<Signal>,
    written: Written,
}

/// What is to be said of a table that was written.
#[derive(Debug, Default)]
pub struct Written {
    /// Messages that have no row, because one of the same topic and time came after them.
    pub overlaid: u64,
    /// What the reader remarked.
    pub findings: Vec<Finding>,
}

impl Table {
    /// How many rows are put on the axis at a time: so many that a block has about four million cells.
    fn block_rows(&self) -> usize {
        ((1 << 22) / self.signals.len().max(1)).clamp(1 << 10, 1 << 20)
    }

    /// Seconds after the recording's first message.
    fn seconds(&self, time_ns: i64) -> f64 {
        (i128::from(time_ns) - i128::from(self.start_ns)) as f64 / 1e9
    }
}

/// Writes the signals that `request` names, all of them where it names none, in the window it names; one row of each topic in
/// `downsample`.
///
/// # Errors
/// [`TableError`]; nothing is left under the final name then.
pub fn write(
    recording: &Recording,
    request: &Request,
    downsample: u64,
    out: &Path,
) -> Result<Written, TableError> {
    let name = out.display().to_string();
    let kind = out
        .extension()
        .and_then(|e| e.to_str())
        .unwrap_or("")
        .to_lowercase();
    if !matches!(kind.as_str(), "csv" | "parquet") {
        return Err(TableError::Kind(name));
    }
    let table = collect(recording, request, downsample)?;
    if table.signals.is_empty() {
        return Err(TableError::Empty(name));
    }
    let io = |source| TableError::Io {
        name: name.clone(),
        source,
    };
    // Both kinds of failure in one type, sorted out afterwards.
    let written: Result<(), Trouble> =
        recording::whole::write_whole(out, |file| match kind.as_str() {
            "csv" => Ok(csv(&table, file)?),
            _ => parquet(&table, file, &name).map_err(Trouble::Table),
        });
    written.map_err(|trouble| match trouble {
        Trouble::Io(source) => io(source),
        Trouble::Table(error) => error,
    })?;
    Ok(table.written)
}

/// What can go wrong while a table is written.
enum Trouble {
    Io(std::io::Error),
    Table(TableError),
}

impl From<std::io::Error> for Trouble {
    fn from(source: std::io::Error) -> Self {
        Trouble::Io(source)
    }
}

/// Reads the wanted signals and joins them by time.
fn collect(recording: &Recording, request: &Request, downsample: u64) -> Result<Table, ReadError> {
    let lists = |path: &str| request.lists_path(path);
    let select = |path: &str| {
        lists(path)
            || path
                .rsplit_once('.')
                .filter(|(_, last)| matches!(*last, "x" | "y" | "z" | "w"))
                .is_some_and(|(prefix, _)| ANGLES.iter().any(|a| lists(&format!("{prefix}.{a}"))))
    };
    let (mut signals, findings) = recording.signals(&select)?;
    let derived: Vec<Signal> = quaternions(&signals);
    signals.extend(derived);
    signals.retain(|s| lists(&s.path));
    signals.sort_by(|a, b| a.path.cmp(&b.path));
    let start_ns = recording.info().start_ns;
    let seconds = |t: i64| (i128::from(t) - i128::from(start_ns)) as f64 / 1e9;
    let inside = |t: &i64| request.holds(seconds(*t));
    let channels = &recording.info().channels;
    let mut topics: BTreeMap<&str, Rows> = BTreeMap::new();
    let mut axes: Vec<*const i64> = Vec::new();
    for s in &signals {
        // Complete signals of one topic share their axis: take it once.
        if !axes.contains(&s.times_ns.as_ptr()) {
            axes.push(s.times_ns.as_ptr());
            let of = |topic: &&str| s.path == *topic || field_of(&s.path, topic).is_some();
            let topic = channels.iter().map(|c| c.topic.as_str()).filter(of);
            let topic = topic.max_by_key(|topic| topic.len()).unwrap_or_default();
            let rows = topics.entry(topic).or_default();
            rows.take(s.times_ns.iter().copied().filter(inside));
        }
    }
    // Each topic is thinned by itself, so that all keep rows.
    let step = usize::try_from(downsample).unwrap_or(usize::MAX).max(1);
    let kept = topics
        .values()
        .flat_map(|rows| rows.times_ns.iter().step_by(step));
    let mut time_ns: Vec<i64> = kept.copied().collect();
    time_ns.sort_unstable();
    time_ns.dedup();
    let overlaid = topics.values().map(|rows| rows.again.len() as u64).sum();
    Ok(Table {
        time_ns,
        start_ns,
        signals,
        written: Written { overlaid, findings },
    })
}

/// The messages of a topic, as its signals tell them.
#[derive(Default)]
struct Rows {
    /// Their times, ascending, each once.
    times_ns: Vec<i64>,
    /// Times that come again, and how many messages came before in that time.
    again: BTreeSet<(i64, u32)>,
}

impl Rows {
    /// Adds the times of a signal's values, which ascend.
    fn take(&mut self, times_ns: impl Iterator<Item = i64>) {
        let (mut last, mut before) = (None, 0);
        for time_ns in times_ns {
            if last == Some(time_ns) {
                before += 1;
                self.again.insert((time_ns, before));
            } else {
                (last, before) = (Some(time_ns), 0);
                self.times_ns.push(time_ns);
            }
        }
        // Stable: quick where two ascending runs become one.
        self.times_ns.sort();
        self.times_ns.dedup();
    }
}

/// The signal's last value at each time of a stretch of the axis, where it has one there; `next` is where the signal goes on.
fn on_axis(s: &Signal, next: &mut usize, axis: &[i64]) -> Vec<Option<f64>> {
    let mut k = *next;
    let values = axis
        .iter()
        .map(|at| {
            while k < s.times_ns.len() && s.times_ns[k] < *at {
                k += 1;
            }
            let mut value = None;
            while k < s.times_ns.len() && s.times_ns[k] == *at {
                value = Some(s.values[k]);
                k += 1;
            }
            value.filter(|x| x.is_finite())
        })
        .collect();
    *next = k;
    values
}

/// Roll, pitch and yaw of every quaternion among the signals, when all of it is there; a field of such a name has it for itself.
fn quaternions(signals: &[Signal]) -> Vec<Signal> {
    let named: HashMap<&str, &Signal> = signals.iter().map(|s| (s.path.as_str(), s)).collect();
    let mut out = Vec::new();
    for w in signals {
        let Some(prefix) = w.path.strip_suffix(".w") else {
            continue;
        };
        let at = |last: &str| named.get(format!("{prefix}.{last}").as_str());
        let (Some(x), Some(y), Some(z)) = (at("x"), at("y"), at("z")) else {
            continue;
        };
        let (mut times_ns, mut values) = (Vec::new(), [const { Vec::new() }; 3]);
        let mut parts = [x, y, z, &w].map(|part| (part, 0));
        for axis in w.times_ns.chunks(1 << 16) {
            let parts = parts.each_mut();
            let parts = parts.map(|(part, next)| on_axis(part, next, axis));
            for (k, time_ns) in axis.iter().enumerate() {
                if let [Some(x), Some(y), Some(z), Some(w)] = [0, 1, 2, 3].map(|i| parts[i][k]) {
                    times_ns.push(*time_ns);
                    for (values, angle) in values.iter_mut().zip(angles(x, y, z, w)) {
                        values.push(angle);
                    }
                }
            }
        }
        if values[0].iter().all(|roll: &f64| roll.is_nan()) {
            continue;
        }
        // The axis of what is complete is shared.
        let times_ns = match times_ns.len() == w.times_ns.len() {
            true => w.times_ns.clone(),
            false => times_ns.into(),
        };
        for (angle, values) in ANGLES.iter().zip(values) {
            let path = format!("{prefix}.{angle}");
            if !named.contains_key(path.as_str()) {
                out.push(Signal {
                    path,
                    unit: "rad".into(),
                    times_ns: times_ns.clone(),
                    values,
                });
            }
        }
    }
    out
}

fn csv(table: &Table, out: &mut impl Write) -> std::io::Result<()> {
    let mut out = std::io::BufWriter::with_capacity(1 << 20, out);
    write!(out, "time_ns,t_s")?;
    for s in &table.signals {
        let name = if s.unit.is_empty() {
            s.path.clone()
        } else {
            format!("{} [{}]", s.path, s.unit)
        };
        write!(out, ",{}", quoted(&name))?;
    }
    writeln!(out)?;
    let mut next = vec![0; table.signals.len()];
    for axis in table.time_ns.chunks(table.block_rows()) {
        let columns: Vec<Vec<Option<f64>>> = (table.signals.iter().zip(&mut next))
            .map(|(s, next)| on_axis(s, next, axis))
            .collect();
        for (row, time_ns) in axis.iter().enumerate() {
            write!(out, "{time_ns},{}", table.seconds(*time_ns))?;
            for values in &columns {
                match values[row] {
                    Some(x) => write!(out, ",{x}")?,
                    None => write!(out, ",")?,
                }
            }
            writeln!(out)?;
        }
    }
    out.flush()
}

#[cfg(not(feature = "tables"))]
fn parquet(_: &Table, _: &mut impl Write, name: &str) -> Result<(), TableError> {
    Err(TableError::Without(name.to_owned()))
}

#[cfg(feature = "tables")]
fn parquet(table: &Table, out: &mut (impl Write + Send), name: &str) -> Result<(), TableError> {
    use std::sync::Arc;

    use parquet::basic::{Compression, Repetition, Type as Physical, ZstdLevel};
    use parquet::data_type::{DoubleType, Int64Type};
    use parquet::file::metadata::KeyValue;
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::types::Type;

    let problem = |e: parquet::errors::ParquetError| TableError::Format {
        name: name.to_owned(),
        problem: e.to_string(),
    };
    let field = |path: &str, physical, repetition| {
        Type::primitive_type_builder(path, physical)
            .with_repetition(repetition)
            .build()
            .map(Arc::new)
    };
    let mut fields = vec![
        field("time_ns", Physical::INT64, Repetition::REQUIRED).map_err(problem)?,
        field("t_s", Physical::DOUBLE, Repetition::REQUIRED).map_err(problem)?,
    ];
    for s in &table.signals {
        fields.push(field(&s.path, Physical::DOUBLE, Repetition::OPTIONAL).map_err(problem)?);
    }
    let schema = Arc::new(
        Type::group_type_builder("signals")
            .with_fields(fields)
            .build()
            .map_err(problem)?,
    );
    // Units travel as metadata of the file, so that columns are named by their paths alone.
    let units = table
        .signals
        .iter()
        .filter(|s| !s.unit.is_empty())
        .map(|s| KeyValue::new(format!("unit:{}", s.path), s.unit.clone()))
        .collect();
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(units))
        .set_created_by(concat!("rath ", env!("CARGO_PKG_VERSION")).to_owned())
        .build();
    let mut file = SerializedFileWriter::new(out, schema, Arc::new(properties)).map_err(problem)?;
    let rows = table.time_ns.len();
    // An empty table still has a row group.
    let group_rows = table.block_rows();
    let mut next = vec![0; table.signals.len()];
    for start in (0..rows.max(1)).step_by(group_rows) {
        let axis = &table.time_ns[start..(start + group_rows).min(rows)];
        let t_s: Vec<f64> = axis.iter().map(|t| table.seconds(*t)).collect();
        let mut group = file.next_row_group().map_err(problem)?;
        let mut column = 0;
        while let Some(mut writer) = group.next_column().map_err(problem)? {
            match column {
                0 => drop(
                    writer
                        .typed::<Int64Type>()
                        .write_batch(axis, None, None)
                        .map_err(problem)?,
                ),
                1 => drop(
                    writer
                        .typed::<DoubleType>()
                        .write_batch(&t_s, None, None)
                        .map_err(problem)?,
                ),
                k => {
                    let values = on_axis(&table.signals[k - 2], &mut next[k - 2], axis);
                    let present: Vec<f64> = values.iter().flatten().copied().collect();
                    let levels: Vec<i16> = values.iter().map(|v| i16::from(v.is_some())).collect();
                    writer
                        .typed::<DoubleType>()
                        .write_batch(&present, Some(&levels), None)
                        .map_err(problem)?;
                }
            }
            writer.close().map_err(problem)?;
            column += 1;
        }
        group.close().map_err(problem)?;
    }
    file.close().map_err(problem)?;
    Ok(())
}

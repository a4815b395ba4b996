//! `--out`: the signals as one table, a column per signal named by its path, a row per time: where a topic has several messages of one time, as many as
//! the topic with most of them has, each row with one message of each topic.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::io::Write;
use std::path::Path;

use recording::read::{ReadError, Recording};
use recording::{Finding, Kind, Signal};

use crate::examine::with_angles;
use crate::quaternion::{ANGLES, angles};
use crate::report::{exact, quoted};
use crate::request::Request;

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

/// A row: its log time (ns), and which message of that time it holds of each topic.
type Row = (i64, u32);

/// A signal, and the number of each value's message among those of its topic and time; empty where none shares its time.
struct Column {
    signal: Signal,
    nth: Vec<u32>,
}

impl Column {
    /// `shared` are the rows of those values whose messages share their times.
    fn new(signal: Signal, shared: Option<&Vec<Row>>) -> Self {
        let number = |shared: &Vec<Row>| {
            let mut shared = shared.iter().peekable();
            let mut of = |t: &i64| shared.next_if(|row| row.0 == *t).map_or(0, |row| row.1);
            signal.times_ns.iter().map(&mut of).collect()
        };
        let nth = shared.map(number).unwrap_or_default();
        Column { signal, nth }
    }

    /// The row of a value.
    fn row(&self, k: usize) -> Row {
        let nth = self.nth.get(k).copied().unwrap_or(0);
        (self.signal.times_ns[k], nth)
    }

    fn rows(&self) -> impl Iterator<Item = Row> {
        (0..self.signal.times_ns.len()).map(|k| self.row(k))
    }

    /// Leaves the values that are in these rows, which ascend.
    fn keep(&mut self, rows: &[Row]) {
        let values = on_axis(self, &mut 0, rows);
        let there = rows.iter().zip(values);
        let there = there.filter_map(|(row, value)| Some((*row, value?)));
        let (rows, values): (Vec<Row>, Vec<f64>) = there.unzip();
        self.signal.times_ns = rows.iter().map(|row| row.0).collect();
        self.signal.values = values;
        if !self.nth.is_empty() {
            self.nth = rows.iter().map(|row| row.1).collect();
        }
    }
}

/// Signals on one axis, the union of their rows. They are put on it block by block of rows, so that nothing is held but them.
struct Table {
    /// Ascending.
    rows: Vec<Row>,
    start_ns: i64,
    columns: Vec<Column>,
    findings: Vec<Finding>,
}

impl Table {
    /// How many rows are put on the axis at a time: so many that a block has about four million cells.
    fn block_rows(&self) -> usize {
        ((1 << 22) / self.columns.len().max(1)).clamp(1 << 10, 1 << 20)
    }

    /// Seconds after the recording's first message.
    fn seconds(&self, time_ns: i64) -> f64 {
        (i128::from(time_ns) - i128::from(self.start_ns)) as f64 / 1e9
    }
}

/// Writes the signals that `request` names, all of them where it names none, in the window it names; one row of each topic in
/// `downsample`. What the reader remarked.
///
/// # Errors
/// [`TableError`]; nothing is left under the final name then.
pub fn write(
    recording: &Recording,
    request: &Request,
    downsample: u64,
    out: &Path,
) -> Result<Vec<Finding>, TableError> {
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
    if table.columns.is_empty() {
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
    Ok(table.findings)
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
    let select = |path: &str| with_angles(path, |path| request.may_list(path));
    let (signals, findings) = recording.signals(&select)?;
    let shared = match may_share(recording, &findings) {
        true => shared(recording, &select)?,
        false => HashMap::new(),
    };
    let columns = signals.into_iter().map(|signal| {
        let of_signal = shared.get(&signal.path);
        Column::new(signal, of_signal)
    });
    let mut columns: Vec<Column> = columns.collect();
    let derived = quaternions(&columns);
    columns.extend(derived);
    columns.retain(|c| request.lists(&c.signal.topic, &c.signal.path));
    columns.sort_by(|a, b| a.signal.path.cmp(&b.signal.path));
    let start_ns = recording.info().start_ns;
    let seconds = |t: i64| (i128::from(t) - i128::from(start_ns)) as f64 / 1e9;
    let inside = |row: &Row| request.holds(seconds(row.0));
    let mut topics: BTreeMap<String, Vec<Row>> = BTreeMap::new();
    let mut axes: Vec<*const i64> = Vec::new();
    for c in &columns {
        let s = &c.signal;
        // Complete signals of one topic share their axis: take it once.
        if !axes.contains(&s.times_ns.as_ptr()) {
            axes.push(s.times_ns.as_ptr());
            let rows = topics.entry(s.topic.clone()).or_default();
            rows.extend(c.rows().filter(inside));
            // Stable: quick where two ascending runs become one.
            rows.sort();
            rows.dedup();
        }
    }
    // Each topic is thinned by itself, so that all keep rows.
    let step = usize::try_from(downsample).unwrap_or(usize::MAX).max(1);
    if step > 1 {
        for rows in topics.values_mut() {
            *rows = rows.iter().step_by(step).copied().collect();
        }
        for column in &mut columns {
            column.keep(&topics[&column.signal.topic]);
        }
    }
    let mut rows: Vec<Row> = topics.into_values().flatten().collect();
    rows.sort_unstable();
    rows.dedup();
    Ok(Table {
        rows,
        start_ns,
        columns,
        findings,
    })
}

/// Whether messages of one topic may share a time, as far as channels and the reader's remarks tell.
fn may_share(recording: &Recording, findings: &[Finding]) -> bool {
    let odd = [Kind::Duplicate, Kind::Backward, Kind::Early];
    let mut known = HashSet::new();
    let mut channels = recording.info().channels.iter();
    findings.iter().any(|f| odd.contains(&f.kind)) || !channels.all(|c| known.insert(&c.topic))
}

/// Of messages that share topic and time, the rows of their values, by the path of the signal, in the order of its values. Channels of one topic
/// come in the order in which they begin, as in its signals.
fn shared(
    recording: &Recording,
    select: &(dyn Fn(&str) -> bool + Sync),
) -> Result<HashMap<String, Vec<Row>>, ReadError> {
    let mut channels: Vec<usize> = Vec::new();
    let mut came: HashMap<String, Vec<(i64, usize)>> = HashMap::new();
    recording.stream(&|_| false, &mut |batch| {
        let begun = channels.iter().position(|c| *c == batch.channel);
        let place = begun.unwrap_or(channels.len());
        if begun.is_none() {
            channels.push(batch.channel);
        }
        let came = came.entry(batch.topic.to_owned()).or_default();
        came.extend(batch.times_ns.iter().map(|t| (*t, place)));
    })?;
    // By channel and time: the number of the next message.
    let mut next: HashMap<(usize, i64), u32> = HashMap::new();
    for came in came.values_mut() {
        came.sort_unstable();
        for messages in came.chunk_by(|a, b| a.0 == b.0).filter(|m| m.len() > 1) {
            for (nth, (t, place)) in (0..).zip(messages) {
                next.entry((channels[*place], *t)).or_insert(nth);
            }
        }
    }
    let mut found: HashMap<String, Vec<Row>> = HashMap::new();
    recording.stream(select, &mut |batch| {
        let numbered = batch.times_ns.iter().map(|t| {
            let next = next.get_mut(&(batch.channel, *t))?;
            *next += 1;
            Some((*t, *next - 1))
        });
        let rows: Vec<Option<Row>> = numbered.collect();
        for column in batch.columns {
            let found = found.entry(column.path.to_owned()).or_default();
            match column.rows {
                Some(there) => found.extend(there.iter().filter_map(|k| rows[*k as usize])),
                None => found.extend(rows.iter().flatten()),
            }
        }
    })?;
    found.values_mut().for_each(|rows| rows.sort_unstable());
    Ok(found)
}

/// The signal's value in each row of a stretch of the axis, where it has one there; `next` is where the signal goes on.
fn on_axis(c: &Column, next: &mut usize, axis: &[Row]) -> Vec<Option<f64>> {
    let values = &c.signal.values;
    let mut k = *next;
    let found = axis.iter().map(|at| {
        while k < values.len() && c.row(k) < *at {
            k += 1;
        }
        (k < values.len() && c.row(k) == *at).then(|| values[k])
    });
    let found = found.collect();
    *next = k;
    found
}

/// Roll, pitch and yaw of every quaternion among the signals, where all of it is there and it is a rotation; a field of such a name has it for itself.
fn quaternions(columns: &[Column]) -> Vec<Column> {
    let named: HashMap<&str, &Column> = (columns.iter())
        .map(|c| (c.signal.path.as_str(), c))
        .collect();
    let mut out = Vec::new();
    for w in columns {
        let Some(prefix) = w.signal.path.strip_suffix(".w") else {
            continue;
        };
        let at = |last: &str| named.get(format!("{prefix}.{last}").as_str());
        let (Some(x), Some(y), Some(z)) = (at("x"), at("y"), at("z")) else {
            continue;
        };
        let (mut rows, mut values) = (Vec::new(), [const { Vec::new() }; 3]);
        let mut parts = [x, y, z, &w].map(|part| (part, 0));
        let all: Vec<Row> = w.rows().collect();
        for axis in all.chunks(1 << 16) {
            let parts = parts.each_mut();
            let parts = parts.map(|(part, next)| on_axis(part, next, axis));
            for (k, row) in axis.iter().enumerate() {
                if let [Some(x), Some(y), Some(z), Some(w)] = [0, 1, 2, 3].map(|i| parts[i][k])
                    && let angles = angles(x, y, z, w)
                    && angles.iter().all(|angle| angle.is_finite())
                {
                    rows.push(*row);
                    for (values, angle) in values.iter_mut().zip(angles) {
                        values.push(angle);
                    }
                }
            }
        }
        if rows.is_empty() {
            continue;
        }
        // The axis of what is complete is shared.
        let times_ns = match rows.len() == all.len() {
            true => w.signal.times_ns.clone(),
            false => rows.iter().map(|row| row.0).collect(),
        };
        let nth: Vec<u32> = match w.nth.is_empty() {
            true => Vec::new(),
            false => rows.iter().map(|row| row.1).collect(),
        };
        for (angle, values) in ANGLES.iter().zip(values) {
            let path = format!("{prefix}.{angle}");
            if !named.contains_key(path.as_str()) {
                out.push(Column {
                    signal: Signal {
                        topic: w.signal.topic.clone(),
                        path,
                        unit: "rad".into(),
                        times_ns: times_ns.clone(),
                        values,
                    },
                    nth: nth.clone(),
                });
            }
        }
    }
    out
}

fn csv(table: &Table, out: &mut impl Write) -> std::io::Result<()> {
    let mut out = std::io::BufWriter::with_capacity(1 << 20, out);
    write!(out, "time_ns,t_s")?;
    for Column { signal: s, .. } in &table.columns {
        let name = if s.unit.is_empty() {
            s.path.clone()
        } else {
            format!("{} [{}]", s.path, s.unit)
        };
        write!(out, ",{}", quoted(&name))?;
    }
    writeln!(out)?;
    let mut next = vec![0; table.columns.len()];
    for axis in table.rows.chunks(table.block_rows()) {
        let columns: Vec<Vec<Option<f64>>> = (table.columns.iter().zip(&mut next))
            .map(|(c, next)| on_axis(c, next, axis))
            .collect();
        for (row, (time_ns, _)) in axis.iter().enumerate() {
            write!(out, "{time_ns},{}", table.seconds(*time_ns))?;
            for values in &columns {
                match values[row] {
                    Some(x) => write!(out, ",{}", exact(x))?,
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
    for Column { signal: s, .. } in &table.columns {
        fields.push(field(&s.path, Physical::DOUBLE, Repetition::OPTIONAL).map_err(problem)?);
    }
    let schema = Arc::new(
        Type::group_type_builder("signals")
            .with_fields(fields)
            .build()
            .map_err(problem)?,
    );
    // Units travel as metadata of the file, so that columns are named by their paths alone.
    let units = (table.columns.iter().map(|c| &c.signal))
        .filter(|s| !s.unit.is_empty())
        .map(|s| KeyValue::new(format!("unit:{}", s.path), s.unit.clone()))
        .collect();
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(units))
        .set_created_by(concat!("rath ", env!("CARGO_PKG_VERSION")).to_owned())
        .build();
    let mut file = SerializedFileWriter::new(out, schema, Arc::new(properties)).map_err(problem)?;
    let rows = table.rows.len();
    // An empty table still has a row group.
    let group_rows = table.block_rows();
    let mut next = vec![0; table.columns.len()];
    for start in (0..rows.max(1)).step_by(group_rows) {
        let axis = &table.rows[start..(start + group_rows).min(rows)];
        let time_ns: Vec<i64> = axis.iter().map(|row| row.0).collect();
        let t_s: Vec<f64> = time_ns.iter().map(|t| table.seconds(*t)).collect();
        let mut group = file.next_row_group().map_err(problem)?;
        let mut column = 0;
        while let Some(mut writer) = group.next_column().map_err(problem)? {
            match column {
                0 => drop(
                    writer
                        .typed::<Int64Type>()
                        .write_batch(&time_ns, None, None)
                        .map_err(problem)?,
                ),
                1 => drop(
                    writer
                        .typed::<DoubleType>()
                        .write_batch(&t_s, None, None)
                        .map_err(problem)?,
                ),
                k => {
                    let values = on_axis(&table.columns[k - 2], &mut next[k - 2], axis);
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

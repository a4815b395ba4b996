//! Rows to Parquet and back, a row group at a time.

use parquet::basic::{
    Compression, ConvertedType, LogicalType, Repetition, Type as Physical, ZstdLevel,
};
use parquet::column::reader::ColumnReader;
use parquet::column::writer::ColumnWriter;
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Real numbers.
    Real,
    /// Whole numbers.
    Whole,
    /// Yes or no.
    Truth,
    /// Words.
    Text,
}

/// A column: any of its cells may be empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// What it holds.
    pub kind: Kind,
    /// Its unit; empty where it has none.
    pub unit: String,
}

/// What stands in a row under a column.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Cell {
    Empty,
    Real(f64),
    Whole(i64),
    Truth(bool),
    Text(String),
}

impl Cell {
    /// As a number, a yes as 1.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Real(x) => Some(*x),
            // OK because whole numbers in these tables are far below 2^53.
            Self::Whole(i) => Some(*i as f64),
            Self::Truth(b) => Some(f64::from(*b)),
            Self::Empty | Self::Text(_) => None,
        }
    }
}

/// Facts about a table that travel in its file.
pub type Notes = Vec<(String, String)>;

/// The fact that holds the checksum of all rows, in hexadecimal.
const CHECKSUM: &str = "rows_crc32";

/// A table that is being written.
pub struct Writer<W: Write + Send> {
    file: SerializedFileWriter<W>,
    columns: Vec<Column>,
    checksum: Checksum,
}

/// CRC-32 of rows as they are, whatever Parquet makes of them: its own checksums are of pages, and nobody's reader has to look at them.
#[derive(Default)]
struct Checksum(crc32fast::Hasher);

impl Checksum {
    fn take(&mut self, rows: &[Vec<Cell>]) {
        for cell in rows.iter().flatten() {
            let (kind, bits) = match cell {
                Cell::Empty => (0, 0),
                Cell::Real(x) => (1, x.to_bits()),
                Cell::Whole(x) => (2, x.cast_unsigned()),
                Cell::Truth(x) => (3, u64::from(*x)),
                Cell::Text(x) => (4, x.len() as u64),
            };
            self.0.update(&[kind]);
            self.0.update(&bits.to_le_bytes());
            if let Cell::Text(x) = cell {
                self.0.update(x.as_bytes());
            }
        }
    }

    fn told(self) -> String {
        format!("{:08x}", self.0.finalize())
    }
}

impl<W: Write + Send> Writer<W> {
    /// Begins a table.
    ///
    /// # Errors
    /// What the library says.
    pub fn new(out: W, columns: &[Column], notes: &Notes) -> Result<Self, ParquetError> {
        let fields = columns.iter().map(field).collect::<Result<Vec<_>, _>>()?;
        let schema = Type::group_type_builder("runs")
            .with_fields(fields)
            .build()?;
        let mut notes: Vec<KeyValue> = notes
            .iter()
            .map(|(k, v)| KeyValue::new(k.clone(), v.clone()))
            .collect();
        notes.extend(
            columns
                .iter()
                .filter(|c| !c.unit.is_empty())
                .map(|c| KeyValue::new(format!("unit:{}", c.name), c.unit.clone())),
        );
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_key_value_metadata(Some(notes))
            .set_created_by(concat!("rath ", env!("CARGO_PKG_VERSION")).to_owned())
            .build();
        Ok(Self {
            file: SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties))?,
            columns: columns.to_vec(),
            checksum: Checksum::default(),
        })
    }

    /// Writes rows as a row group of their own.
    ///
    /// # Errors
    /// What the library says.
    pub fn group(&mut self, rows: &[Vec<Cell>]) -> Result<(), ParquetError> {
        self.checksum.take(rows);
        let mut group = self.file.next_row_group()?;
        for k in 0..self.columns.len() {
            let Some(mut column) = group.next_column()? else {
                break;
            };
            let levels: Vec<i16> = rows
                .iter()
                .map(|r| i16::from(r[k] != Cell::Empty))
                .collect();
            let cells = rows.iter().map(|r| &r[k]);
            macro_rules! put {
                ($writer:expr, $pattern:pat => $value:expr) => {{
                    let values: Vec<_> = cells
                        .filter_map(|c| match c {
                            $pattern => Some($value),
                            _ => None,
                        })
                        .collect();
                    $writer.write_batch(&values, Some(&levels), None)?
                }};
            }
            match column.untyped() {
                ColumnWriter::DoubleColumnWriter(w) => put!(w, Cell::Real(x) => *x),
                ColumnWriter::Int64ColumnWriter(w) => put!(w, Cell::Whole(x) => *x),
                ColumnWriter::BoolColumnWriter(w) => put!(w, Cell::Truth(x) => *x),
                ColumnWriter::ByteArrayColumnWriter(w) => {
                    put!(w, Cell::Text(x) => ByteArray::from(x.as_str()))
                }
                _ => return Err(ParquetError::General("a column of an unknown type".into())),
            };
            column.close()?;
        }
        group.close()?;
        Ok(())
    }

    /// Completes the table.
    ///
    /// # Errors
    /// What the library says.
    pub fn close(mut self) -> Result<(), ParquetError> {
        let checksum = KeyValue::new(CHECKSUM.into(), self.checksum.told());
        self.file.append_key_value_metadata(checksum);
        self.file.close().map(drop)
    }
}

fn field(column: &Column) -> Result<Arc<Type>, ParquetError> {
    let physical = match column.kind {
        Kind::Real => Physical::DOUBLE,
        Kind::Whole => Physical::INT64,
        Kind::Truth => Physical::BOOLEAN,
        Kind::Text => Physical::BYTE_ARRAY,
    };
    let builder =
        Type::primitive_type_builder(&column.name, physical).with_repetition(Repetition::OPTIONAL);
    let builder = match column.kind {
        Kind::Text => builder
            .with_logical_type(Some(LogicalType::String))
            .with_converted_type(ConvertedType::UTF8),
        _ => builder,
    };
    builder.build().map(Arc::new)
}

/// A table in a file, opened.
pub struct Reader {
    file: SerializedFileReader<File>,
    /// Its columns.
    pub columns: Vec<Column>,
    /// Its facts, units left out.
    pub notes: Notes,
    /// How many rows it has.
    pub rows: u64,
}

impl Reader {
    /// Opens a table that [`Writer`] wrote.
    ///
    /// # Errors
    /// What the library or the system says; a column of a type that is never written.
    pub fn open(path: &Path) -> Result<Self, ParquetError> {
        let file = SerializedFileReader::new(File::open(path)?)?;
        let metadata = file.metadata().file_metadata();
        let (mut notes, mut units) = (Notes::new(), Notes::new());
        for pair in metadata.key_value_metadata().into_iter().flatten() {
            let value = pair.value.clone().unwrap_or_default();
            match pair.key.strip_prefix("unit:") {
                Some(column) => units.push((column.into(), value)),
                None => notes.push((pair.key.clone(), value)),
            }
        }
        let columns = metadata
            .schema_descr()
            .columns()
            .iter()
            .map(|c| {
                let kind = match c.physical_type() {
                    Physical::DOUBLE => Kind::Real,
                    Physical::INT64 => Kind::Whole,
                    Physical::BOOLEAN => Kind::Truth,
                    Physical::BYTE_ARRAY => Kind::Text,
                    other => {
                        return Err(ParquetError::General(format!(
                            "column `{}` holds {other}, which no study writes",
                            c.name()
                        )));
                    }
                };
                let unit = units.iter().find(|(k, _)| k == c.name());
                Ok(Column {
                    name: c.name().into(),
                    kind,
                    unit: unit.map_or_else(String::new, |(_, u)| u.clone()),
                })
            })
            .collect::<Result<_, _>>()?;
        // OK because a count of rows is never negative.
        let rows = metadata.num_rows() as u64;
        Ok(Self {
            columns,
            notes,
            rows,
            file,
        })
    }

    /// A fact by name.
    pub fn note(&self, name: &str) -> Option<&str> {
        self.notes
            .iter()
            .find(|(k, _)| k == name)
            .map(|(_, v)| v.as_str())
    }

    /// How many row groups there are.
    pub fn groups(&self) -> usize {
        self.file.num_row_groups()
    }

    /// All rows, if they are those that were written.
    ///
    /// # Errors
    /// What the library says; that they are others.
    pub fn checked(&self) -> Result<Vec<Vec<Cell>>, ParquetError> {
        let (mut rows, mut checksum) = (Vec::new(), Checksum::default());
        for group in 0..self.groups() {
            rows.extend(self.group(group)?);
        }
        checksum.take(&rows);
        match self.note(CHECKSUM) {
            Some(told) if told == checksum.told() => Ok(rows),
            _ => Err(ParquetError::General(
                "its rows are not those that were written: their checksum is another".into(),
            )),
        }
    }

    /// The rows of one row group.
    ///
    /// # Errors
    /// What the library says.
    pub fn group(&self, index: usize) -> Result<Vec<Vec<Cell>>, ParquetError> {
        let group = self.file.get_row_group(index)?;
        // OK because a row group that was written from memory fits into it.
        let rows = group.metadata().num_rows() as usize;
        let mut out = vec![Vec::with_capacity(self.columns.len()); rows];
        for k in 0..self.columns.len() {
            let cells: Vec<Cell> = match group.get_column_reader(k)? {
                ColumnReader::DoubleColumnReader(r) => cells::<DoubleType>(r, rows, Cell::Real)?,
                ColumnReader::Int64ColumnReader(r) => cells::<Int64Type>(r, rows, Cell::Whole)?,
                ColumnReader::BoolColumnReader(r) => cells::<BoolType>(r, rows, Cell::Truth)?,
                ColumnReader::ByteArrayColumnReader(r) => cells::<ByteArrayType>(r, rows, |b| {
                    Cell::Text(String::from_utf8_lossy(b.data()).into_owned())
                })?,
                _ => return Err(ParquetError::General("a column of an unknown type".into())),
            };
            if cells.len() != rows {
                return Err(ParquetError::General(format!(
                    "column `{}` has {} of {rows} rows",
                    self.columns[k].name,
                    cells.len()
                )));
            }
            out.iter_mut()
                .zip(cells)
                .for_each(|(row, cell)| row.push(cell));
        }
        Ok(out)
    }
}

fn cells<T: DataType>(
    mut reader: parquet::column::reader::ColumnReaderImpl<T>,
    rows: usize,
    cell: impl Fn(T::T) -> Cell,
) -> Result<Vec<Cell>, ParquetError> {
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    while levels.len() < rows {
        let (records, _, _) =
            reader.read_records(rows - levels.len(), Some(&mut levels), None, &mut values)?;
        if records == 0 {
            break;
        }
    }
    let mut values = values.into_iter();
    Ok(levels
        .iter()
        .map(|level| match level {
            0 => Cell::Empty,
            _ => values.next().map_or(Cell::Empty, &cell),
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let column = |name: &str, kind, unit: &str| Column {
            name: name.into(),
            kind,
            unit: unit.into(),
        };
        let columns = [
            column("x", Kind::Real, "m"),
            column("k", Kind::Whole, ""),
            column("ok", Kind::Truth, ""),
            column("why", Kind::Text, ""),
        ];
        let rows: Vec<Vec<Cell>> = (0..5000i64)
            .map(|i| match i % 3 {
                0 => vec![
                    Cell::Real(i as f64 / 7.0),
                    Cell::Whole(i),
                    Cell::Truth(i % 2 == 0),
                    Cell::Empty,
                ],
                1 => vec![
                    Cell::Empty,
                    Cell::Whole(-i),
                    Cell::Empty,
                    Cell::Text(format!("because {i}, ü")),
                ],
                _ => vec![Cell::Empty, Cell::Empty, Cell::Empty, Cell::Empty],
            })
            .collect();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        let notes = vec![("study".to_owned(), "mine".to_owned())];
        let mut writer = Writer::new(File::create(&path).unwrap(), &columns, &notes).unwrap();
        writer.group(&rows[..3000]).unwrap();
        writer.group(&rows[3000..]).unwrap();
        writer.close().unwrap();
        let reader = Reader::open(&path).unwrap();
        assert_eq!((reader.rows, reader.groups()), (5000, 2));
        assert_eq!(reader.columns, columns);
        assert_eq!(reader.note("study"), Some("mine"));
        assert_eq!(reader.checked().unwrap(), rows);
        assert_eq!(reader.group(0).unwrap(), rows[..3000]);
        assert_eq!(reader.group(1).unwrap(), rows[3000..]);
    }
}

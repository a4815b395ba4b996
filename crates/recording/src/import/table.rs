//! Delimited text as a table: separator and decimal sign found out, columns by name, a sentence for every number that is none.

use std::borrow::Cow;

use super::{ImportError, imu::Track, without_rows};
use crate::text::counted;

/// How programs write a value that is missing.
const NOTHING: [&str; 7] = ["null", "none", "na", "n/a", "∞", "+∞", "-∞"];

/// A table of text cells.
pub(super) struct Table {
    /// The file, for messages.
    pub name: String,
    /// The header's names.
    pub columns: Vec<String>,
    rows: Vec<csv::StringRecord>,
    decimal_comma: bool,
    /// Line of the header in the file, from 1.
    header_line: usize,
    /// Rows that have more cells than the header, where they are left out: their lines, the first and how many.
    overlong: (usize, u64),
    /// Whether its last line ends.
    ends: bool,
}

impl Table {
    /// Reads a table whose header is the first line of `text` for which `is_header` holds.
    pub fn parse(
        name: &str,
        text: &str,
        is_header: impl Fn(&str) -> bool,
    ) -> Result<Self, ImportError> {
        let problem = |problem: String| ImportError::Content {
            name: name.to_owned(),
            problem,
        };
        let Some((header_line, rest)) = below_header(text, usize::MAX, is_header) else {
            let first: String = text
                .lines()
                .next()
                .unwrap_or_default()
                .chars()
                .take(80)
                .collect();
            return Err(problem(format!(
                "has no header line that is known; it begins with {first:?}"
            )));
        };
        let length = rest.find('\n').unwrap_or(rest.len());
        if length > MOST_HEADER_BYTES {
            return Err(problem(format!(
                "line {header_line}, the header, has {length} bytes; expected names of columns in at most {MOST_HEADER_BYTES}: are line ends missing?"
            )));
        }
        Self::below(name, rest, separator(rest), header_line)
    }

    /// Reads the header that a text begins with as a table without rows.
    pub fn header_of(text: &str) -> Result<Self, ImportError> {
        let header = text.lines().next().unwrap_or_default();
        Self::below("", header, separator(text), 1)
    }

    /// Reads a table that begins with its header.
    fn below(
        name: &str,
        text: &str,
        separator: u8,
        header_line: usize,
    ) -> Result<Self, ImportError> {
        let problem = |problem: String| ImportError::Content {
            name: name.to_owned(),
            problem,
        };
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(separator)
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let columns = reader
            .headers()
            .map_err(|error| problem(format!("its header cannot be read: {error}")))?;
        let columns: Vec<String> = columns.iter().map(str::to_owned).collect();
        let (mut rows, mut overlong) = (Vec::new(), (0, 0));
        for row in reader.records() {
            let mut row = row.map_err(|error| problem(format!("cannot be read: {error}")))?;
            // The reader begins a row with the empty lines before it.
            if let Some(mut at) = row.position().cloned() {
                // OK because a place in the text fits.
                let rest = &text.as_bytes()[at.byte() as usize..];
                let ends = rest.iter().take_while(|b| matches!(b, b'\r' | b'\n'));
                let empty = ends.filter(|b| **b == b'\n').count() as u64;
                at.set_line(at.line() + empty);
                row.set_position(Some(at));
            }
            // OK because a line's number fits where the text does.
            let line = row.position().map_or(0, |at| at.line() as usize) + header_line - 1;
            let breaks = row.iter().map(|cell| cell.matches('\n').count());
            let swallowed: usize = breaks.sum();
            if swallowed > 0 {
                let lines = counted(swallowed as u64, "line", "lines");
                return Err(problem(format!(
                    "line {line} begins a quotation that takes in {lines} behind it; expected each row on one line: is there a quotation mark too many?"
                )));
            }
            // A comma too many, as of a decimal sign, moves all that follow it.
            if row.iter().skip(columns.len()).any(|cell| !cell.is_empty()) {
                if overlong.1 == 0 {
                    overlong.0 = line;
                }
                overlong.1 += 1;
            } else if row.iter().any(|cell| !cell.is_empty()) {
                rows.push(row);
            }
        }
        if overlong.1 > MOST_OVERLONG * rows.len() as u64 / 100 + 1 {
            return Err(problem(format!(
                "line {} and {} more have more cells than the header, which has {}: are there commas within numbers, or do columns have no name?",
                overlong.0,
                overlong.1 - 1,
                columns.len()
            )));
        }
        // With another separator a comma can only be the decimal sign.
        let has_comma = |row: &csv::StringRecord| row.iter().any(|cell| cell.contains(','));
        let decimal_comma = separator != b',' && rows.iter().any(has_comma);
        Ok(Table {
            name: name.to_owned(),
            columns,
            rows,
            decimal_comma,
            header_line,
            overlong,
            ends: text.ends_with(['\n', '\r']),
        })
    }

    /// Reads a table without a header; as many of `columns` as its first row has cells.
    pub fn headless(name: &str, text: &str, columns: &[&str]) -> Result<Self, ImportError> {
        let cells = text.lines().next().unwrap_or_default().split(',').count();
        let header = columns[..cells.min(columns.len())].join(",");
        Self::below(name, &format!("{header}\n{text}"), b',', 0)
    }

    /// Leaves out a last row that was cut off, and says which rows are left out as broken; `log` is the log that this table belongs to.
    ///
    /// Its last cell may be half a number. Rows may all be shorter than the header: what counts is also the row before.
    pub fn drop_broken_rows(&mut self, log: &str, notes: &mut Vec<String>) {
        if let (first, rows @ 1..) = self.overlong {
            let one = "row has more cells than the header and is";
            let rows = counted(rows, one, "rows have more cells than the header and are");
            notes.push(format!(
                "{}{rows} left out, the first in line {first}",
                self.told_in(log)
            ));
        }
        let [.., last] = self.rows.as_slice() else {
            return;
        };
        let before = self.rows.iter().rev().nth(1);
        let usual = before.map_or(usize::MAX, csv::StringRecord::len);
        let (found, expected) = (last.len(), usual.min(self.columns.len()));
        let lacks = if found < expected {
            format!("has {found} of {expected} cells")
        } else if !self.ends && self.ends_shorter() {
            "does not end, and its last cell is shorter than those before".to_owned()
        } else {
            return;
        };
        let file = self.told_in(log);
        let line = self.line(self.rows.len() - 1);
        notes.push(format!(
            "{file}line {line}, the last, {lacks}: it was cut off and is left out"
        ));
        self.rows.pop();
    }

    /// Whether the last row's last cell is shorter than those of the rows before it.
    fn ends_shorter(&self) -> bool {
        let length = |row: &csv::StringRecord| row.iter().next_back().map_or(0, str::len);
        let mut lengths = self.rows.iter().rev().take(CELLS).map(length);
        let last = lengths.next();
        self.rows.len() >= CELLS && lengths.all(|length| Some(length) > last)
    }

    /// Notes that nothing was logged, of one table of several.
    pub fn note_empty(&self, log: &str, notes: &mut Vec<String>) {
        if self.len() == 0 && self.name != log {
            notes.push(without_rows(&self.name));
        }
    }

    /// Leaves out the rows that tell no time in a column, with a note.
    pub fn drop_untimed(&mut self, time: usize, log: &str, notes: &mut Vec<String>) {
        let all = self.rows.len();
        let none = |cell: &str| is_missing(cell) || cell.parse().is_ok_and(f64::is_nan);
        self.rows.retain(|row| !row.get(time).is_none_or(none));
        let rows = (all - self.rows.len()) as u64;
        if rows > 0 {
            let one = "row has no time and is";
            let rows = counted(rows, one, "rows have no time and are");
            notes.push(format!("{}{rows} left out", self.told_in(log)));
        }
    }

    /// How a note of `log` about this table begins.
    fn told_in(&self, log: &str) -> String {
        match self.name == log {
            true => String::new(),
            false => format!("{}: ", self.name),
        }
    }

    /// Takes out the row under the header where that tells units: it has no number in it.
    pub fn take_units(&mut self) -> Option<csv::StringRecord> {
        let first = self.rows.first()?;
        let a_number = |cell: &str| cell.replace(',', ".").parse::<f64>().is_ok();
        let told = first.iter().any(|cell| !cell.is_empty()) && !first.iter().any(a_number);
        // A row of missing values is none of units.
        (told && !first.iter().all(is_missing)).then(|| self.rows.remove(0))
    }

    /// The number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// The position of a column; names are compared without regard to case, spaces, underscores and the way ² is written.
    pub fn find(&self, name: &str) -> Option<usize> {
        let wanted = plain(name);
        self.columns
            .iter()
            .position(|column| plain(column) == wanted)
    }

    /// The positions of columns that must all be there.
    pub fn find_all<const N: usize>(&self, names: [&str; N]) -> Result<[usize; N], ImportError> {
        let missing: Vec<&str> = names
            .into_iter()
            .filter(|name| self.find(name).is_none())
            .collect();
        if !missing.is_empty() {
            return Err(self.problem(format!(
                "lacks the column{} {}; found {}",
                if missing.len() == 1 { "" } else { "s" },
                missing.join(", "),
                self.listed()
            )));
        }
        let times = |wanted: &&str| {
            let wanted = plain(wanted);
            self.columns.iter().filter(|c| plain(c) == wanted).count()
        };
        if let Some(twice) = names.iter().find(|name| times(name) > 1) {
            return Err(self.problem(format!(
                "has the column {twice} {} times; expected one of that name",
                times(twice)
            )));
        }
        Ok(names.map(|name| self.find(name).unwrap_or(0)))
    }

    /// The columns' names for a message: the first few, each cut to what one line takes.
    pub fn listed(&self) -> String {
        const MOST: usize = 30;
        let one_line = |c: char| if c.is_control() { ' ' } else { c };
        let short = |name: &String| name.chars().take(60).map(one_line).collect::<String>();
        let mut names: Vec<String> = self.columns.iter().take(MOST).map(short).collect();
        if self.columns.len() > MOST {
            names.push(format!("… ({} in all)", self.columns.len()));
        }
        names.join(", ")
    }

    /// An error about this table.
    pub fn problem(&self, problem: String) -> ImportError {
        ImportError::Content {
            name: self.name.clone(),
            problem,
        }
    }

    /// An error about a row; `problem` goes on after its line.
    pub fn problem_in(&self, row: usize, problem: &str) -> ImportError {
        self.problem(format!("line {} {problem}", self.line(row)))
    }

    /// A cell's text.
    pub fn text(&self, row: usize, column: usize) -> &str {
        self.rows
            .get(row)
            .and_then(|cells| cells.get(column))
            .unwrap_or_default()
    }

    /// The line of a row in the file, from 1; empty lines count.
    fn line(&self, row: usize) -> usize {
        let at = self.rows.get(row).and_then(csv::StringRecord::position);
        // OK because a line's number fits where the text does.
        at.map_or(0, |at| at.line() as usize) + self.header_line - 1
    }

    /// A cell's number; one that is empty, or says that there is none, is NaN.
    pub fn number(&self, row: usize, column: usize) -> Result<f64, ImportError> {
        // Some programs write the minus of typography.
        let mut cell = Cow::from(self.text(row, column));
        if cell.contains('\u{2212}') {
            cell = cell.replace('\u{2212}', "-").into();
        }
        if is_missing(&cell) {
            return Ok(f64::NAN);
        }
        let parsed = if self.decimal_comma {
            cell.replace(',', ".").parse()
        } else {
            cell.parse()
        };
        parsed.map_err(|_| {
            let cell: String = cell.chars().take(40).collect();
            self.problem(format!(
                "line {}, column {:?}: found {cell:?}, expected a number",
                self.line(row),
                self.columns.get(column).map_or("", String::as_str)
            ))
        })
    }

    /// Three numbers of every row, times `factor`, at its time.
    pub fn track(
        &self,
        times_ns: &[i64],
        columns: [usize; 3],
        factor: f64,
    ) -> Result<Track, ImportError> {
        let times = times_ns.iter().enumerate();
        let each =
            times.map(|(row, t_ns)| Ok((*t_ns, self.vector(row, columns)?.map(|x| x * factor))));
        let mut track = each.collect::<Result<Track, ImportError>>()?;
        self.put_in_order(&mut track, |row| row.0)?;
        Ok(track)
    }

    /// Puts what its rows tell in the order of their times; one clock may be late, it does not begin again.
    pub fn put_in_order<T>(
        &self,
        rows: &mut [T],
        t_ns: impl Fn(&T) -> i64,
    ) -> Result<(), ImportError> {
        let mut latest_ns = i64::MIN;
        for row in rows.iter() {
            let back_s = latest_ns.saturating_sub(t_ns(row)) as f64 / 1e9;
            if back_s > LATE_S {
                let from_s = latest_ns.saturating_sub(t_ns(&rows[0])) as f64 / 1e9;
                return Err(self.problem(format!(
                    "its times step back by {back_s:.3} s, {from_s:.3} s behind the first: two recordings in one, or a clock that was set anew; expected one that goes on, cut the file there"
                )));
            }
            latest_ns = latest_ns.max(t_ns(row));
        }
        rows.sort_by_key(t_ns);
        Ok(())
    }

    /// Three numbers of a row.
    pub fn vector(&self, row: usize, columns: [usize; 3]) -> Result<[f64; 3], ImportError> {
        Ok([
            self.number(row, columns[0])?,
            self.number(row, columns[1])?,
            self.number(row, columns[2])?,
        ])
    }
}

/// No table has names as long as this.
const MOST_HEADER_BYTES: usize = 1 << 20;

/// So many cells of a column tell how long they are.
const CELLS: usize = 20;

/// Of a hundred rows at most so many may be broken.
const MOST_OVERLONG: u64 = 10;

/// Rows that come later than this behind their time belong to another recording.
const LATE_S: f64 = 1.0;

/// Which of so many first lines of a text is its header, from 1, and the text from there on.
pub(super) fn below_header(
    text: &str,
    lines: usize,
    is_header: impl Fn(&str) -> bool,
) -> Option<(usize, &str)> {
    let mut rest = text;
    for (number, line) in text.split_inclusive('\n').take(lines).enumerate() {
        if is_header(line.trim_end()) {
            return Some((number + 1, rest));
        }
        rest = &rest[line.len()..];
    }
    None
}

/// Signs that separate cells; of two that fit as well, the first: a comma may also be a decimal sign, or stand in a name.
const SEPARATORS: [u8; 3] = [b'\t', b';', b','];

/// The sign that separates the cells of a text that begins with its header: of those that most of the first rows have as often as the header, or of
/// all where none is, the commonest in the header.
fn separator(text: &str) -> u8 {
    let mut lines = text.lines().map(separators);
    let header = lines.next().unwrap_or_default();
    let rows = lines.filter(|counts| counts.iter().any(|count| *count > 0));
    let rows: Vec<[usize; 3]> = rows.take(CELLS).collect();
    let fits = |k: usize| {
        let alike = rows.iter().filter(|counts| counts[k] == header[k]).count();
        header[k] > 0 && alike > 0 && 2 * alike >= rows.len()
    };
    let best = (0..3).rev().max_by_key(|k| (fits(*k), header[*k]));
    best.map_or(b',', |k| SEPARATORS[k])
}

/// How often each separator stands in a line, outside quotes.
fn separators(line: &str) -> [usize; 3] {
    let mut counts = [0; 3];
    let mut quoted = false;
    for byte in line.bytes() {
        quoted ^= byte == b'"';
        if let Some(k) = SEPARATORS.iter().position(|sign| *sign == byte && !quoted) {
            counts[k] += 1;
        }
    }
    counts
}

/// Whether a cell has no value, or says so.
fn is_missing(cell: &str) -> bool {
    cell.is_empty() || NOTHING.iter().any(|word| cell.eq_ignore_ascii_case(word))
}

/// A column's name without what does not count in it.
pub(super) fn plain(name: &str) -> String {
    name.replace('²', "^2")
        .chars()
        .filter(|c| !matches!(c, ' ' | '_' | '"'))
        .flat_map(char::to_lowercase)
        .collect()
}

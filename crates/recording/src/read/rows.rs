//! Columns under construction: where decoders put the numbers of a batch of messages, one row per message.

use std::{collections::HashMap, sync::Arc};

/// No column: a field that nobody wants.
pub(super) const UNWANTED: u32 = u32::MAX;

/// More columns than this in one channel are refused: items of items of items would otherwise fill the memory.
pub(super) const MAX_COLUMNS: usize = 1 << 16;

/// More places than this in the items, entries and keys of one message are left out, and a decoder that remembers more forgets them: messages that
/// nest sequences in sequences, or never stop inventing keys, would otherwise fill the memory.
pub(super) const MAX_PLACES: usize = 1 << 16;

/// Stands for the name of a field where a message has more.
pub(super) const ANY_PLACE: &str = "[*]";

/// What is said where there are more columns.
pub(super) fn too_many_columns() -> String {
    format!("it has more than {MAX_COLUMNS} numeric fields; the others are left out")
}

/// One numeric field while a batch is decoded.
#[derive(Debug, Default)]
pub(super) struct RowColumn {
    /// `TOPIC.field.path`.
    pub path: Arc<str>,
    /// The values.
    pub values: Vec<f64>,
    /// The row of each value once some row had none; empty while every row has one.
    pub rows: Vec<u32>,
    sparse: bool,
}

/// Decoded numbers of one channel, and what the decoder noticed on the way.
pub(super) struct Rows<'a> {
    topic: String,
    select: Selection<'a>,
    /// All columns that somebody wants, in the order of first sight.
    pub columns: Vec<RowColumn>,
    index: HashMap<Arc<str>, u32>,
    /// Columns with values, in the order of their first ones: that of `columns` is of all batches that this thread happened to decode.
    pub order: Vec<u32>,
    /// There were more columns than are taken.
    pub full: bool,
    /// Places that the decoder remembers because messages had them: keys, items, and the fields of these.
    pub places: usize,
    /// Those in the message in hand.
    entered: usize,
    row: u32,
    /// Header stamp of the message that is being decoded.
    pub stamp_ns: Option<i64>,
    /// Header stamps of the rows; short of some where not every message has one.
    stamps: Vec<i64>,
    /// Fields that messages declare as not given, with how many do.
    pub absent: Vec<(String, u64)>,
    /// Sequences that were too long to become signals: field and count.
    pub long: Vec<(String, u64)>,
    /// The same for arrays that their type makes too long.
    pub long_types: Vec<(String, u64)>,
    /// What the decoder has to say about the schema.
    pub remark: Option<String>,
    /// What the message in hand added to these counts, to be taken back with it.
    noted: Vec<Noted>,
    /// Messages with bytes left over.
    pub trailing: u64,
    /// Up to how many items of a sequence become signals.
    pub max_items: usize,
}

/// A count in `absent`, `long` or `long_types`, by its place there.
#[derive(Clone, Copy)]
enum Noted {
    Absent(u32, u64),
    Long(usize),
    LongType(u32, u64),
}

/// Which signals are wanted, by path.
pub(super) type Selection<'a> = &'a (dyn Fn(&str) -> bool + Sync);

impl<'a> Rows<'a> {
    pub fn new(topic: &str, select: Selection<'a>, max_items: usize) -> Self {
        Rows {
            topic: topic.to_owned(),
            select,
            columns: Vec::new(),
            index: HashMap::new(),
            order: Vec::new(),
            full: false,
            places: 0,
            entered: 0,
            row: 0,
            stamp_ns: None,
            stamps: Vec::new(),
            absent: Vec::new(),
            long: Vec::new(),
            long_types: Vec::new(),
            remark: None,
            noted: Vec::new(),
            trailing: 0,
            max_items,
        }
    }

    /// The column of a field, or [`UNWANTED`].
    ///
    /// `field` is the path without the topic; it is empty where the message itself is the value.
    pub fn column(&mut self, field: &str) -> u32 {
        let path = if field.is_empty() {
            self.topic.clone()
        } else {
            format!("{}.{field}", self.topic)
        };
        if !(self.select)(&path) {
            return UNWANTED;
        }
        // A second look-up of the same field happens when a layout is compiled again for another representation.
        if let Some(&known) = self.index.get(path.as_str()) {
            return known;
        }
        if self.columns.len() >= MAX_COLUMNS {
            self.remark = Some(too_many_columns());
            self.full = true;
            return UNWANTED;
        }
        // Every row so far is without this field.
        let sparse = self.row > 0;
        // OK because MAX_COLUMNS fits.
        let column = self.columns.len() as u32;
        let path: Arc<str> = path.into();
        self.index.insert(path.clone(), column);
        self.columns.push(RowColumn {
            path,
            sparse,
            ..RowColumn::default()
        });
        column
    }

    /// Sets a column's value in the current row.
    #[inline]
    pub fn push(&mut self, column: u32, value: f64) {
        let row = self.row;
        // OK because callers only pass what `column` gave them; UNWANTED is checked by them or falls through here.
        let Some(known) = self.columns.get_mut(column as usize) else {
            return;
        };
        if !known.sparse && row > 0 && known.values.len() == row as usize {
            known.values.push(value);
        } else {
            if known.values.is_empty() {
                self.order.push(column);
            }
            known.push_slowly(row, value);
        }
    }

    /// Gives a column one value for each of the next rows, which [`Self::keep_alike`] then keeps.
    ///
    /// No column may get values twice.
    #[inline]
    pub fn extend(&mut self, column: u32, values: impl ExactSizeIterator<Item = f64>) {
        let row = self.row;
        let Some(known) = self.columns.get_mut(column as usize) else {
            return;
        };
        if known.values.is_empty() {
            self.order.push(column);
        }
        if !known.sparse && known.values.len() == row as usize {
            known.values.extend(values);
        } else {
            for (row, value) in (row..).zip(values) {
                known.push_slowly(row, value);
            }
        }
    }

    /// Keeps rows that were given by [`Self::extend`], all with a header stamp or all without.
    pub fn keep_alike(&mut self, rows: u32, stamps: impl ExactSizeIterator<Item = i64>) {
        self.row += rows;
        self.stamps.extend(stamps);
    }

    /// The header stamps of the rows; none where not every row has one. `empty` gives memory for about so many of the next batch.
    pub fn take_stamps(&mut self, empty: impl FnOnce(usize) -> Vec<i64>) -> Vec<i64> {
        let next = empty(self.stamps.len());
        let stamps = std::mem::replace(&mut self.stamps, next);
        if stamps.len() == self.row as usize {
            stamps
        } else {
            Vec::new()
        }
    }

    /// Counts a sequence that is too long to become signals.
    pub fn note_long(&mut self, field: &str) {
        let place = count(&mut self.long, field);
        self.noted.push(Noted::Long(place));
    }

    /// Whether so many further places of the message in hand may be read. It depends on the message alone, not on what is remembered.
    pub fn has_room(&self, places: usize) -> bool {
        self.entered.saturating_add(places) <= MAX_PLACES
    }

    /// Counts further places of the message in hand, where there is room for them; from where there is none on, nothing is.
    pub fn enter(&mut self, places: usize) -> bool {
        let room = self.has_room(places);
        if room {
            self.entered += places;
        } else if self.has_room(0) {
            self.entered = MAX_PLACES + 1;
            self.note_long(ANY_PLACE);
        }
        room
    }

    /// The number under which an array is counted that its type makes too long to become signals.
    pub fn long_type(&mut self, field: &str) -> u32 {
        numbered(&mut self.long_types, field)
    }

    /// Counts messages with such an array.
    #[inline]
    pub fn note_long_type(&mut self, field: u32, messages: u64) {
        if let Some((_, count)) = self.long_types.get_mut(field as usize) {
            *count += messages;
            self.noted.push(Noted::LongType(field, messages));
        }
    }

    /// The number under which a field is counted that messages may declare as not given.
    pub fn absent_field(&mut self, field: &str) -> u32 {
        numbered(&mut self.absent, field)
    }

    /// Counts messages that declare a field as not given.
    #[inline]
    pub fn note_absent(&mut self, field: u32, messages: u64) {
        if let Some((_, count)) = self.absent.get_mut(field as usize) {
            *count += messages;
            self.noted.push(Noted::Absent(field, messages));
        }
    }

    /// Begins the next message.
    pub fn begin(&mut self) {
        self.stamp_ns = None;
        self.entered = 0;
        self.noted.clear();
    }

    /// Keeps the message that was decoded.
    pub fn keep(&mut self) {
        self.row += 1;
        self.stamps.extend(self.stamp_ns);
    }

    /// Takes back what a message gave before it turned out to be broken.
    pub fn abort(&mut self) {
        let row = self.row;
        for column in &mut self.columns {
            if column.sparse {
                while column.rows.last() == Some(&row) {
                    column.rows.pop();
                    column.values.pop();
                }
            } else {
                column.values.truncate(row as usize);
            }
        }
        self.take_back_counts();
        let columns = &self.columns;
        self.order
            .retain(|column| !columns[*column as usize].values.is_empty());
    }

    /// Takes back what was counted of the message in hand, which is read again.
    pub fn take_back_counts(&mut self) {
        self.entered = 0;
        for noted in self.noted.drain(..) {
            match noted {
                Noted::Absent(field, messages) => self.absent[field as usize].1 -= messages,
                Noted::Long(place) => self.long[place].1 -= 1,
                Noted::LongType(field, messages) => self.long_types[field as usize].1 -= messages,
            }
        }
        self.long.retain(|(_, count)| *count > 0);
    }

    /// Ends the batch: the number of rows; columns with fewer values than rows know which rows they have.
    pub fn finish(&mut self) -> usize {
        let rows = self.row as usize;
        for column in &mut self.columns {
            if !column.sparse && column.values.len() != rows {
                column.become_sparse();
            }
        }
        rows
    }

    /// Empties everything for the next batch but keeps the columns and their memory.
    pub fn clear(&mut self) {
        self.row = 0;
        for (_, count) in self.absent.iter_mut().chain(&mut self.long_types) {
            *count = 0;
        }
        self.order.clear();
        self.stamps.clear();
        self.long.clear();
        self.noted.clear();
        self.trailing = 0;
        for column in &mut self.columns {
            column.values.clear();
            column.rows.clear();
            column.sparse = false;
        }
    }
}

impl RowColumn {
    fn become_sparse(&mut self) {
        self.sparse = true;
        // OK because rows are counted in u32.
        self.rows = (0..self.values.len() as u32).collect();
    }

    #[cold]
    fn push_slowly(&mut self, row: u32, value: f64) {
        if !self.sparse {
            if self.values.len() == row as usize {
                self.values.push(value);
                return;
            }
            if self.values.len() == row as usize + 1 {
                // Twice in one message: the last one counts, as in protobuf.
                self.values[row as usize] = value;
                return;
            }
            self.become_sparse();
        }
        if self.rows.last() == Some(&row) {
            if let Some(last) = self.values.last_mut() {
                *last = value;
            }
        } else {
            self.rows.push(row);
            self.values.push(value);
        }
    }
}

/// The number of a field among those that are counted.
fn numbered(counts: &mut Vec<(String, u64)>, field: &str) -> u32 {
    let known = counts.iter().position(|(known, _)| known == field);
    // OK because there are at most as many as columns.
    known.unwrap_or_else(|| {
        counts.push((field.to_owned(), 0));
        counts.len() - 1
    }) as u32
}

/// Counts a field and returns its place.
fn count(counts: &mut Vec<(String, u64)>, field: &str) -> usize {
    match counts.iter().position(|(known, _)| known == field) {
        Some(place) => {
            counts[place].1 += 1;
            place
        }
        None => {
            counts.push((field.to_owned(), 1));
            counts.len() - 1
        }
    }
}

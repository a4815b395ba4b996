//! Columns under construction: where decoders put the numbers of a batch of messages, one row per message.

use std::{collections::HashMap, hash::Hash, sync::Arc};

use super::names::Names;

/// No column: a field that nobody wants.
pub(super) const UNWANTED: u32 = u32::MAX;

/// More columns than this in one channel are refused: items of items of items would otherwise fill the memory.
pub(super) const MAX_COLUMNS: usize = 1 << 16;
/// Numeric fields of all topics beyond these are left out: what is known of each takes up to four kilobytes in the end.
pub(super) const MAX_SIGNALS: usize = 1 << 18;

/// More places than this in the items, entries and keys of one message are left out, and a decoder that remembers more forgets them: messages that
/// nest sequences in sequences, or never stop inventing keys, would otherwise fill the memory.
pub(super) const MAX_PLACES: usize = 1 << 16;

/// How many places one takes whose name is so long: names fill the memory too.
pub(super) fn places_of(name_bytes: usize) -> usize {
    1 + name_bytes / 256
}

/// What a message has more of than become signals.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum Long {
    /// Items of the sequence, array or map of this name.
    Items(String),
    /// Keys of the object of this name.
    Keys(String),
    /// Places altogether.
    Places,
}

/// How often things were seen, in the order of the first sight.
#[derive(Debug)]
pub(super) struct Counts<K> {
    pub list: Vec<(K, u64)>,
    places: HashMap<K, usize>,
}

impl<K> Default for Counts<K> {
    fn default() -> Self {
        Counts {
            list: Vec::new(),
            places: HashMap::new(),
        }
    }
}

impl<K: Clone + Eq + Hash> Counts<K> {
    /// The place of one in the list, where it begins with nought.
    pub fn place(&mut self, of: K) -> usize {
        *self.places.entry(of).or_insert_with_key(|of| {
            self.list.push((of.clone(), 0));
            self.list.len() - 1
        })
    }

    /// Counts one, and says where.
    pub fn add(&mut self, of: K, times: u64) -> usize {
        let place = self.place(of);
        self.list[place].1 += times;
        place
    }

    /// Those that were seen at all.
    pub fn some(&self) -> impl Iterator<Item = (K, u64)> {
        self.list.iter().filter(|(_, count)| *count > 0).cloned()
    }

    /// None of them were seen; they keep their places.
    fn zero(&mut self) {
        self.list.iter_mut().for_each(|(_, count)| *count = 0);
    }

    fn clear(&mut self) {
        self.list.clear();
        self.places.clear();
    }
}

/// What is said where there are more columns.
pub(super) fn too_many_signals() -> String {
    format!(
        "the recording has more than {MAX_SIGNALS} numeric fields in all; the others of this topic are left out"
    )
}

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
    /// At least so many fields the decoder remembers of the type, columns or not.
    pub fields: usize,
    /// Those in the message in hand.
    entered: usize,
    row: u32,
    /// Header stamp of the message that is being decoded.
    pub stamp_ns: Option<i64>,
    /// Header stamps of the rows; short of some where not every message has one.
    stamps: Vec<i64>,
    /// Fields that messages declare as not given, with how many do.
    pub absent: Counts<String>,
    /// What was too long to become signals, and in how many messages.
    pub long: Counts<Long>,
    /// The same for arrays that their type makes too long.
    pub long_types: Counts<Long>,
    /// What the decoder has to say about the schema.
    pub remark: Option<String>,
    /// The first field that has two places in one message, as `a.b` and `b` of `a` in JSON.
    pub twice: Option<String>,
    /// What the message in hand added to these counts, to be taken back with it.
    noted: Vec<Noted>,
    /// The columns that the message in hand gave a number.
    given: Vec<u32>,
    /// How many numbers the rows hold, at most.
    pub held: usize,
    /// Messages with bytes left over.
    pub trailing: u64,
    /// Up to how many items of a sequence become signals.
    pub max_items: usize,
    /// Whether items are called by the names they carry.
    pub by_name: bool,
    /// What the places of lists were called, where they are called by their place.
    pub names: Names,
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
    pub fn new(topic: &str, select: Selection<'a>, max_items: usize, by_name: bool) -> Self {
        Rows {
            topic: topic.to_owned(),
            select,
            columns: Vec::new(),
            index: HashMap::new(),
            order: Vec::new(),
            full: false,
            places: 0,
            fields: 0,
            entered: 0,
            row: 0,
            stamp_ns: None,
            stamps: Vec::new(),
            absent: Counts::default(),
            long: Counts::default(),
            long_types: Counts::default(),
            remark: None,
            twice: None,
            noted: Vec::new(),
            given: Vec::new(),
            held: 0,
            trailing: 0,
            max_items,
            by_name,
            names: Names::default(),
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
        self.given.push(column);
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
        self.held += values.len();
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

    /// Counts what is too long to become signals.
    pub fn note_long(&mut self, what: Long) {
        let place = self.long.add(what, 1);
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
            self.note_long(Long::Places);
        }
        room
    }

    /// The number under which an array is counted that its type makes too long to become signals.
    pub fn long_type(&mut self, field: &str) -> u32 {
        // OK because there are at most as many as columns.
        self.long_types.place(Long::Items(field.to_owned())) as u32
    }

    /// Counts messages with such an array.
    #[inline]
    pub fn note_long_type(&mut self, field: u32, messages: u64) {
        if let Some((_, count)) = self.long_types.list.get_mut(field as usize) {
            *count += messages;
            self.noted.push(Noted::LongType(field, messages));
        }
    }

    /// The number under which a field is counted that messages may declare as not given.
    pub fn absent_field(&mut self, field: &str) -> u32 {
        // OK because there are at most as many as columns.
        self.absent.place(field.to_owned()) as u32
    }

    /// Counts messages that declare a field as not given.
    #[inline]
    pub fn note_absent(&mut self, field: u32, messages: u64) {
        if let Some((_, count)) = self.absent.list.get_mut(field as usize) {
            *count += messages;
            self.noted.push(Noted::Absent(field, messages));
        }
    }

    /// Begins the next message.
    pub fn begin(&mut self) {
        self.stamp_ns = None;
        self.entered = 0;
        self.noted.clear();
        self.given.clear();
        self.names.take_back();
    }

    /// Keeps the message that was decoded.
    pub fn keep(&mut self) {
        self.row += 1;
        self.held += self.given.len();
        self.stamps.extend(self.stamp_ns);
        self.names.keep();
    }

    /// Takes back what a message gave before it turned out to be broken.
    pub fn abort(&mut self) {
        self.take_back_counts();
        // Only the columns it gave a number: with thousands, a look at each would take longer than the message.
        for &column in &self.given {
            self.columns[column as usize].cut(self.row);
        }
        self.given.clear();
        // Columns without values from before it stand last.
        while let Some(&last) = self.order.last()
            && self.columns[last as usize].values.is_empty()
        {
            self.order.pop();
        }
    }

    /// Takes back what was counted of the message in hand, which is read again.
    pub fn take_back_counts(&mut self) {
        self.entered = 0;
        self.names.take_back();
        for noted in self.noted.drain(..) {
            match noted {
                Noted::Absent(field, messages) => self.absent.list[field as usize].1 -= messages,
                Noted::Long(place) => self.long.list[place].1 -= 1,
                Noted::LongType(field, messages) => {
                    self.long_types.list[field as usize].1 -= messages;
                }
            }
        }
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
        (self.row, self.held) = (0, 0);
        self.absent.zero();
        self.long_types.zero();
        self.order.clear();
        self.stamps.clear();
        self.long.clear();
        self.noted.clear();
        self.trailing = 0;
        self.twice = None;
        for column in &mut self.columns {
            column.values.clear();
            column.rows.clear();
            column.sparse = false;
        }
    }
}

impl RowColumn {
    /// Takes back the value of a row, which is the last one.
    fn cut(&mut self, row: u32) {
        if !self.sparse {
            self.values.truncate(row as usize);
        } else if self.rows.last() == Some(&row) {
            self.rows.pop();
            self.values.pop();
        }
    }

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

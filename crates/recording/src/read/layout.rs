//! A message type compiled to where its numbers lie: the decoder of ROS 1, ROS 2 CDR and IDL messages.
//!
//! Fields of fixed size that follow each other are one *run*. Where in the run each lies depends only on the alignment of the run's
//! start, so every run has at most eight tables of offsets, made when first needed; a run is checked against the message's end once.
//! Between runs stand the things of varying length: strings, sequences, arrays of structs that hold either.

mod items;

use std::ops::Range;

use items::{Items, Names};

use super::{
    decode::Place,
    names,
    rows::{Rows, UNWANTED, places_of},
    types::{Extensible, MAX_FIELDS, Prim, Type, Types},
};

/// How the bytes are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    pub big_endian: bool,
    /// Numbers are aligned to their size, but to no more than this: 8 in XCDR1, 4 in XCDR2, 1 in ROS 1.
    pub max_align: usize,
    pub headers: Headers,
    /// Whether each row of an array of several dimensions begins with its size too, not the whole alone.
    pub each_row: bool,
    pub sizes: Sizes,
    /// Bytes per character of a wide string.
    pub wide: usize,
    /// A struct without fields takes one byte (ROS 2).
    pub empty_takes_byte: bool,
}

/// Which arrays and sequences begin with their size in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Headers {
    None,
    /// Those of structs and strings, as Fast CDR writes XCDR2.
    NotEnums,
    /// All but those of numbers: XTypes 1.3, 7.4.3.5.3, rules 9 and 12.
    All,
}

/// Which structs within others begin with their size in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sizes {
    None,
    /// Those that are said to be `@appendable`.
    Appendable,
    /// Those too of which nothing is said: XTypes 1.3, 7.3.3.1, gives them the same meaning.
    NotFinal,
}

impl Shape {
    /// Whether a struct within another begins with its size.
    fn has_size(self, extensible: Extensible) -> bool {
        match extensible {
            Extensible::No => false,
            Extensible::Unsaid => self.sizes == Sizes::NotFinal,
            Extensible::Yes => self.sizes != Sizes::None,
        }
    }

    /// Whether an array or sequence begins with its size.
    fn has_header(self, collection: &Type) -> bool {
        match collection.item() {
            Type::Prim(_) => false,
            Type::Enum => self.headers == Headers::All,
            _ => self.headers != Headers::None,
        }
    }
}

/// Why a message could not be decoded.
#[derive(Debug, PartialEq)]
pub(super) struct Fail {
    /// Byte at which it stopped, counted from after the representation header.
    pub at: usize,
    /// The field that it was reading.
    pub field: String,
    /// What was wrong.
    pub problem: Problem,
}

impl Fail {
    /// Names the field from further outside.
    fn within(self, outer: &str) -> Self {
        let field = match self.field.as_str() {
            "" => outer.to_owned(),
            inner => format!("{outer}.{inner}"),
        };
        Fail { field, ..self }
    }
}

#[derive(Debug, PartialEq)]
pub(super) enum Problem {
    /// The message ends before the field does.
    Short,
    /// Anything else, in words.
    Other(&'static str),
}

/// Where a number of a run goes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sink {
    Nowhere,
    Column(u32),
    StampSeconds,
    StampNanoseconds,
    /// First element of a covariance: −1 says that the field is not given. The number under which the rows count it.
    Covariance(u32),
    /// First element of an array that is too long to become signals. The number under which the rows count it.
    Long(u32),
}

#[derive(Clone, Debug)]
struct RunField {
    prim: Prim,
    count: usize,
    sinks: [Sink; 2],
    name: String,
}

#[derive(Clone, Copy, Debug)]
struct Load {
    offset: u32,
    prim: Prim,
    sink: Sink,
}

/// Offsets for one alignment of a run's start.
#[derive(Clone, Debug, Default)]
struct Table {
    /// Doubles that go to columns, the bulk of most messages: offset and column.
    doubles: Vec<(u32, u32)>,
    others: Vec<Load>,
    length: usize,
}

#[derive(Clone, Debug, Default)]
struct Run {
    fields: Vec<RunField>,
    tables: [Option<Box<Table>>; 8],
}

#[derive(Clone, Debug)]
enum Op {
    Run(Run),
    Text(String),
    WideText(String),
    /// The size of a struct, before it.
    Size(String),
    /// Where a struct with a size ends.
    End,
    Sequence(Box<Items>),
    /// An array whose items vary in length.
    Array(Box<Items>, usize),
}

/// A compiled type in one shape.
#[derive(Clone, Debug, Default)]
pub(super) struct Program {
    ops: Vec<Op>,
    /// How many fields it has, without those of items, at least one.
    places: usize,
    /// Of a message: what walks over items of a type, parts of an array or not, without taking anything.
    skips: Vec<(Type, bool, Program)>,
    flat: Option<Box<Flat>>,
    /// How many messages in a row did not fit the flat table.
    misses: u32,
}

/// Where everything lay in the last message. It holds for every message of the same length whose counts and text lengths are the
/// same, which in most topics are nearly all.
#[derive(Clone, Debug, Default)]
struct Flat {
    length: usize,
    /// Places of 32-bit lengths, and their bytes.
    checks: Vec<(u32, [u8; 4])>,
    doubles: Vec<(u32, u32)>,
    others: Vec<Load>,
    end: usize,
    /// Whether every column gets one value: then messages can be taken column by column.
    simple: bool,
}

/// Another reading may use up a message too.
const OTHER_SIZE: &str = "its size in bytes is another";

const TOO_MANY: &str = "its items have too many fields";

/// What a message is decoded with.
struct Context<'a> {
    types: &'a Types,
    shape: Shape,
    data: &'a [u8],
    skips: Vec<(Type, bool, Program)>,
    /// Where the texts of the last list of names lie.
    names: Vec<Range<usize>>,
    /// The flat table in the making; `None` where it is not wanted, or once something was met that it cannot hold.
    trace: Option<Box<Flat>>,
}

impl Flat {
    #[inline]
    fn fits(&self, data: &[u8]) -> bool {
        data.len() == self.length
            && self.checks.iter().all(|(at, bytes)| {
                data.get(*at as usize..).and_then(<[u8]>::first_chunk) == Some(bytes)
            })
    }

    #[inline]
    fn take<const BIG: bool>(&self, data: &[u8], rows: &mut Rows) {
        for &(offset, column) in &self.doubles {
            rows.push(
                column,
                f64::from_bits(load::<8, BIG>(data, offset as usize)),
            );
        }
        for load in &self.others {
            load.take::<BIG>(data, rows);
        }
    }

    /// Takes and keeps messages that all fit, column by column; their fields begin `skip` bytes into them.
    fn take_alike<const BIG: bool>(
        &self,
        block: &[u8],
        places: &[Place],
        skip: usize,
        rows: &mut Rows,
    ) {
        let starts = places.iter().map(|place| place.bytes.start + skip);
        for &(offset, column) in &self.doubles {
            let at = |start| f64::from_bits(load::<8, BIG>(block, start + offset as usize));
            rows.extend(column, starts.clone().map(at));
        }
        let (mut stamped, mut stamps) = (0, vec![0i64; places.len()]);
        for load in &self.others {
            let offset = load.offset as usize;
            let values = starts
                .clone()
                .map(|start| read::<BIG>(load.prim, block, start + offset));
            let mut stamp = |scale: i64| {
                stamped = places.len();
                for (stamp, value) in stamps.iter_mut().zip(values.clone()) {
                    *stamp = stamp.wrapping_add((value as i64).wrapping_mul(scale));
                }
            };
            match load.sink {
                Sink::StampSeconds => stamp(1_000_000_000),
                Sink::StampNanoseconds => stamp(1),
                Sink::Column(column) => rows.extend(column, values),
                Sink::Covariance(field) => {
                    // Only those of doubles are marked so.
                    let absent = (-1f64).to_bits();
                    let marked = starts
                        .clone()
                        .filter(|start| self::load::<8, BIG>(block, start + offset) == absent);
                    rows.note_absent(field, marked.count() as u64);
                }
                Sink::Long(field) => rows.note_long_type(field, places.len() as u64),
                Sink::Nowhere => {}
            }
        }
        // OK because rows are counted in u32 and a block is far from having as many messages.
        rows.keep_alike(places.len() as u32, stamps[..stamped].iter().copied());
    }

    /// Whether no column gets two values, as those of a schema with two fields of one name do.
    fn is_simple(&self) -> bool {
        let doubles = self.doubles.iter().map(|(_, column)| *column);
        let others = self.others.iter().filter_map(|load| match load.sink {
            Sink::Column(column) => Some(column),
            _ => None,
        });
        let mut columns: Vec<u32> = doubles.chain(others).collect();
        columns.sort_unstable();
        columns.windows(2).all(|pair| pair[0] != pair[1])
    }
}

struct Compiler<'a, 'r> {
    types: &'a Types,
    shape: Shape,
    take: bool,
    rows: &'a mut Rows<'r>,
    program: Program,
    run: Run,
    fields: usize,
    /// Whether the field in hand is a list of names, or a list behind one.
    names: Names,
}

impl Program {
    /// Compiles the message type: the first struct of `types`.
    pub fn message(types: &Types, shape: Shape, rows: &mut Rows) -> Result<Self, String> {
        let program = compile(types, &Type::Struct(0), "", shape, rows, (true, false))?;
        let parsed = types.structs.iter().map(|s| s.fields.len());
        rows.fields += program.places + parsed.sum::<usize>();
        Ok(program)
    }

    /// Decodes a message, aligned from the slice's start, and returns where it ended.
    pub fn decode(
        &mut self,
        types: &Types,
        shape: Shape,
        data: &[u8],
        rows: &mut Rows,
    ) -> Result<usize, Fail> {
        if let Some(flat) = &self.flat
            && flat.fits(data)
        {
            self.misses = 0;
            if shape.big_endian {
                flat.take::<true>(data, rows);
            } else {
                flat.take::<false>(data, rows);
            }
            return Ok(flat.end);
        }
        // A topic whose messages all differ is not worth a table each time.
        self.misses = self.misses.saturating_add(1);
        let worth = (self.misses < 8 || self.misses.is_multiple_of(64))
            && u32::try_from(data.len()).is_ok();
        let trace = worth.then(|| {
            Box::new(Flat {
                length: data.len(),
                ..Flat::default()
            })
        });
        let mut context = Context {
            types,
            shape,
            data,
            skips: std::mem::take(&mut self.skips),
            names: Vec::new(),
            trace,
        };
        let end = self.run(&mut context, 0, rows);
        self.skips = context.skips;
        let end = end?;
        if let Some(mut flat) = context.trace {
            flat.end = end;
            flat.simple = flat.is_simple();
            self.flat = Some(flat);
        }
        Ok(end)
    }

    /// Bytes after the last field of the last message that was laid out like the one before; none before there is one.
    pub fn bytes_left(&self) -> Option<usize> {
        self.flat.as_ref().map(|flat| flat.length - flat.end)
    }

    /// Decodes and keeps, column by column, as many of the first messages at `places` as lie like the last one and as `suits` lets
    /// through; their fields begin `skip` bytes into them. Returns how many.
    pub fn decode_alike(
        &mut self,
        shape: Shape,
        block: &[u8],
        places: &[Place],
        skip: usize,
        suits: impl Fn(&[u8]) -> bool,
        rows: &mut Rows,
    ) -> usize {
        let Some(flat) = self.flat.as_ref().filter(|flat| flat.simple) else {
            return 0;
        };
        let fits = |place: &&Place| {
            let message = &block[place.bytes.clone()];
            suits(message) && message.get(skip..).is_some_and(|body| flat.fits(body))
        };
        let count = places.iter().take_while(fits).count();
        if count > 0 {
            self.misses = 0;
            if shape.big_endian {
                flat.take_alike::<true>(block, &places[..count], skip, rows);
            } else {
                flat.take_alike::<false>(block, &places[..count], skip, rows);
            }
        }
        count
    }

    fn run(
        &mut self,
        context: &mut Context<'_>,
        mut at: usize,
        rows: &mut Rows,
    ) -> Result<usize, Fail> {
        // Where the structs in hand end that have a size, and their names.
        let mut ends = Vec::new();
        for op in &mut self.ops {
            at = match op {
                Op::Run(run) if context.shape.big_endian => run.read::<true>(context, at, rows)?,
                Op::Run(run) => run.read::<false>(context, at, rows)?,
                Op::Text(field) => context.text(at, field)?.end,
                Op::WideText(field) => {
                    let (length, at) = context.length(at, field)?;
                    let bytes = length
                        .checked_mul(context.shape.wide)
                        .ok_or_else(|| short(at, field))?;
                    end_of(context.data, at, bytes, field)?
                }
                Op::Size(field) => {
                    let (size, at) = context.length(at, field)?;
                    ends.push((at.saturating_add(size), field));
                    at
                }
                Op::End => match ends.pop() {
                    Some((end, field)) if end != at => return Err(other(at, field, OTHER_SIZE)),
                    _ => at,
                },
                Op::Sequence(items) => {
                    let (end, start) = items.header(context, at)?;
                    let (count, at) = context.length(start, &items.field)?;
                    let at = items.read(context, at, count, rows)?;
                    items.check(end, at)?
                }
                Op::Array(items, count) => {
                    let (end, at) = items.header(context, at)?;
                    let at = items.read(context, at, *count, rows)?;
                    items.check(end, at)?
                }
            };
        }
        Ok(at)
    }
}

impl Context<'_> {
    /// A 32-bit length and the place after it.
    #[inline]
    fn length(&mut self, at: usize, field: &str) -> Result<(usize, usize), Fail> {
        let at = align(at, 4, self.shape);
        let Some(bytes) = self.data.get(at..).and_then(<[u8]>::first_chunk::<4>) else {
            return Err(short(self.data.len(), field));
        };
        if let Some(flat) = &mut self.trace {
            // OK because messages with a flat table are shorter than 4 GiB.
            flat.checks.push((at as u32, *bytes));
        }
        let length = if self.shape.big_endian {
            u32::from_be_bytes(*bytes)
        } else {
            u32::from_le_bytes(*bytes)
        };
        Ok((length as usize, at + 4))
    }

    /// Where a text lies.
    fn text(&mut self, at: usize, field: &str) -> Result<Range<usize>, Fail> {
        let (length, at) = self.length(at, field)?;
        Ok(at..end_of(self.data, at, length, field)?)
    }

    /// The flat table is to hold only for messages with the same text there.
    fn hold_to(&mut self, text: &Range<usize>) {
        let Some(flat) = &mut self.trace else { return };
        for at in text.clone().step_by(4) {
            // Its length stands before it, and is as much the same.
            let at = at.min(text.end - 4);
            let bytes = std::array::from_fn(|k| self.data[at + k]);
            // OK because messages with a flat table are shorter than 4 GiB.
            flat.checks.push((at as u32, bytes));
        }
    }
}

fn compile(
    types: &Types,
    kind: &Type,
    field: &str,
    shape: Shape,
    rows: &mut Rows,
    (take, part): (bool, bool),
) -> Result<Program, String> {
    let mut compiler = Compiler {
        types,
        shape,
        take,
        rows,
        program: Program::default(),
        run: Run::default(),
        fields: 0,
        names: Names::None,
    };
    match part {
        true => compiler.part(kind, field)?,
        false => compiler.add(kind, field, Role::Plain)?,
    }
    compiler.close_run();
    let mut program = compiler.program;
    let fields = |op: &Op| match op {
        Op::Run(run) => run.fields.iter().map(|f| places_of(f.name.len())).sum(),
        Op::Text(name) | Op::WideText(name) | Op::Size(name) => places_of(name.len()),
        Op::End => 1,
        Op::Sequence(items) | Op::Array(items, _) => places_of(items.field.len()),
    };
    program.places = program.ops.iter().map(fields).sum::<usize>().max(1);
    Ok(program)
}

/// What a field means beyond its type.
#[derive(Clone, Copy, PartialEq)]
enum Role {
    Plain,
    /// The header of the message.
    Header,
    /// The stamp in the header.
    Stamp,
    StampSeconds,
    StampNanoseconds,
}

impl Compiler<'_, '_> {
    fn count(&mut self, field: &str) -> Result<(), String> {
        self.fields += places_of(field.len());
        if self.fields > MAX_FIELDS {
            return Err(format!(
                "the message type has more than {MAX_FIELDS} fields, or names that take as much room"
            ));
        }
        Ok(())
    }

    /// An item of an array: of several dimensions, the whole has a size before it, and its rows may have none.
    fn part(&mut self, kind: &Type, field: &str) -> Result<(), String> {
        match kind {
            Type::Array(inner, count) if !self.shape.each_row => {
                self.count(field)?;
                self.array(inner, *count, false, field)
            }
            _ => self.add(kind, field, Role::Plain),
        }
    }

    fn add(&mut self, kind: &Type, field: &str, role: Role) -> Result<(), String> {
        self.count(field)?;
        match kind {
            Type::Prim(prim) => self.number(*prim, 1, field, role),
            Type::Enum => self.number(Prim::U32, 1, field, role),
            Type::Text => self.push(Op::Text(field.to_owned())),
            Type::WideText => self.push(Op::WideText(field.to_owned())),
            Type::Struct(index) => {
                let types = self.types;
                let fields = &types.structs[*index].fields;
                let name = &types.structs[*index].name;
                // The message itself stands in no other.
                let sized = *index > 0 && self.shape.has_size(types.structs[*index].extensible);
                if sized {
                    self.push(Op::Size(field.to_owned()));
                }
                if fields.is_empty() && self.shape.empty_takes_byte {
                    self.run.fields.push(RunField {
                        prim: Prim::U8,
                        count: 1,
                        sinks: [Sink::Nowhere; 2],
                        name: field.to_owned(),
                    });
                }
                // A message that is a header is stamped too.
                let header =
                    role == Role::Header || (field.is_empty() && name.ends_with("/Header"));
                let names = names::list_of(&types.structs[*index]);
                for (k, (inner, kind)) in fields.iter().enumerate() {
                    let role = match inner.as_str() {
                        "header" if field.is_empty() => Role::Header,
                        "stamp" if header => Role::Stamp,
                        "sec" if role == Role::Stamp => Role::StampSeconds,
                        "nanosec" | "nsec" if role == Role::Stamp => Role::StampNanoseconds,
                        _ => Role::Plain,
                    };
                    let path = if field.is_empty() {
                        inner.clone()
                    } else {
                        format!("{field}.{inner}")
                    };
                    self.names = match names {
                        Some(list) if list == k && self.take => {
                            Names::Of(self.rows.names.list(&path))
                        }
                        Some(list) if list < k && self.take => Names::Beside,
                        _ => Names::None,
                    };
                    self.add(kind, &path, role)?;
                    self.names = Names::None;
                }
                if sized {
                    self.push(Op::End);
                }
            }
            Type::Array(inner, count) => {
                let headed = self.shape.has_header(kind);
                self.array(inner, *count, headed, field)?;
            }
            Type::Sequence(inner) => {
                let names = std::mem::replace(&mut self.names, Names::None);
                let how = (self.take, self.shape.has_header(kind), false);
                let mut items = Items::new(self.types, self.rows, inner, how, field);
                items.call(names);
                self.push(Op::Sequence(Box::new(items)));
            }
        }
        Ok(())
    }

    fn number(&mut self, prim: Prim, count: usize, field: &str, role: Role) {
        let mut sinks = [Sink::Nowhere; 2];
        if self.take && count == 1 {
            let column = self.rows.column(field);
            if column != UNWANTED {
                sinks[0] = Sink::Column(column);
            }
            sinks[1] = match role {
                Role::StampSeconds => Sink::StampSeconds,
                Role::StampNanoseconds => Sink::StampNanoseconds,
                _ => Sink::Nowhere,
            };
        }
        self.run.fields.push(RunField {
            prim,
            count,
            sinks,
            name: field.to_owned(),
        });
    }

    fn array(
        &mut self,
        inner: &Type,
        count: usize,
        headed: bool,
        field: &str,
    ) -> Result<(), String> {
        let items_wanted = self.take && count <= self.rows.max_items;
        if let Some(prim) = inner.prim().filter(|_| !headed) {
            if !items_wanted {
                if count > 0 {
                    self.number(prim, count, field, Role::Plain);
                }
                if self.take
                    && self.rows.column(&format!("{field}[0]")) != UNWANTED
                    && let Some(array) = self.run.fields.last_mut()
                {
                    array.sinks[0] = Sink::Long(self.rows.long_type(field));
                }
                return Ok(());
            }
            for item in 0..count {
                self.fields += places_of(field.len());
                self.number(prim, 1, &format!("{field}[{item}]"), Role::Plain);
            }
            // ROS says with −1 in a covariance's first element that its field is not given.
            if let (Some(given), Prim::F64, Some(first)) = (
                field.strip_suffix("_covariance"),
                prim,
                self.run.fields.len().checked_sub(count.max(1)),
            ) && count > 0
            {
                self.run.fields[first].sinks[1] = Sink::Covariance(self.rows.absent_field(given));
            }
            return Ok(());
        }
        if items_wanted && !headed {
            for item in 0..count {
                self.part(inner, &format!("{field}[{item}]"))?;
            }
            return Ok(());
        }
        let items = Items::new(
            self.types,
            self.rows,
            inner,
            (self.take, headed, true),
            field,
        );
        self.push(Op::Array(Box::new(items), count));
        Ok(())
    }

    fn push(&mut self, op: Op) {
        self.close_run();
        self.program.ops.push(op);
    }

    fn close_run(&mut self) {
        if !self.run.fields.is_empty() {
            self.program
                .ops
                .push(Op::Run(std::mem::take(&mut self.run)));
        }
    }
}

impl Load {
    /// Puts the number where it belongs.
    #[inline]
    fn take<const BIG: bool>(&self, bytes: &[u8], rows: &mut Rows) {
        let value = read::<BIG>(self.prim, bytes, self.offset as usize);
        // OK because stamps are 32-bit integers, which doubles hold exactly.
        let stamp = |ns: i64, rows: &mut Rows| {
            rows.stamp_ns = Some(rows.stamp_ns.unwrap_or(0).wrapping_add(ns))
        };
        match self.sink {
            Sink::Column(column) => rows.push(column, value),
            Sink::StampSeconds => stamp((value as i64).wrapping_mul(1_000_000_000), rows),
            Sink::StampNanoseconds => stamp(value as i64, rows),
            Sink::Covariance(field) if value == -1.0 => rows.note_absent(field, 1),
            Sink::Long(field) => rows.note_long_type(field, 1),
            Sink::Covariance(_) | Sink::Nowhere => {}
        }
    }
}

impl Run {
    #[inline]
    fn read<const BIG: bool>(
        &mut self,
        context: &mut Context<'_>,
        at: usize,
        rows: &mut Rows,
    ) -> Result<usize, Fail> {
        let phase = at % 8;
        if self.tables[phase].is_none() {
            self.tables[phase] = Some(Box::new(self.table(context.shape, phase)));
        }
        let Some(table) = &self.tables[phase] else {
            return Ok(at);
        };
        let Some(bytes) = context.data.get(at..at.saturating_add(table.length)) else {
            return Err(self.name_shortfall(context.shape, context.data.len(), at));
        };
        for &(offset, column) in &table.doubles {
            rows.push(
                column,
                f64::from_bits(load::<8, BIG>(bytes, offset as usize)),
            );
        }
        for load in &table.others {
            load.take::<BIG>(bytes, rows);
        }
        if let Some(flat) = &mut context.trace {
            // OK because messages with a flat table are shorter than 4 GiB.
            let start = at as u32;
            flat.doubles.extend(
                table
                    .doubles
                    .iter()
                    .map(|&(offset, column)| (start + offset, column)),
            );
            flat.others.extend(table.others.iter().map(|load| Load {
                offset: start + load.offset,
                ..*load
            }));
        }
        Ok(at + table.length)
    }

    fn table(&self, shape: Shape, phase: usize) -> Table {
        let mut table = Table::default();
        let mut at = phase;
        for field in &self.fields {
            at = align(at, field.prim.size(), shape);
            // OK because a type has at most MAX_FIELDS fields and arrays that are not taken have no load.
            let offset = (at - phase) as u32;
            for sink in field.sinks {
                match sink {
                    Sink::Nowhere => {}
                    Sink::Column(column) if field.prim == Prim::F64 => {
                        table.doubles.push((offset, column))
                    }
                    sink => table.others.push(Load {
                        offset,
                        prim: field.prim,
                        sink,
                    }),
                }
            }
            at = at.saturating_add(field.prim.size().saturating_mul(field.count));
        }
        table.length = at - phase;
        table
    }

    /// Finds the field at which a message of `length` bytes ends too soon.
    fn name_shortfall(&self, shape: Shape, length: usize, start: usize) -> Fail {
        let mut at = start;
        for field in &self.fields {
            at = align(at, field.prim.size(), shape)
                .saturating_add(field.prim.size().saturating_mul(field.count));
            if at > length {
                return short(length, &field.name);
            }
        }
        short(length, "the end")
    }
}

#[inline]
fn align(at: usize, size: usize, shape: Shape) -> usize {
    at.next_multiple_of(size.min(shape.max_align))
}

fn short(at: usize, field: &str) -> Fail {
    Fail {
        at,
        field: field.to_owned(),
        problem: Problem::Short,
    }
}

fn other(at: usize, field: &str, what: &'static str) -> Fail {
    Fail {
        at,
        field: field.to_owned(),
        problem: Problem::Other(what),
    }
}

fn end_of(data: &[u8], at: usize, bytes: usize, field: &str) -> Result<usize, Fail> {
    match at.checked_add(bytes) {
        Some(end) if end <= data.len() => Ok(end),
        _ => Err(short(data.len(), field)),
    }
}

/// `N` bytes at `offset` as an unsigned integer. The caller has checked the run's length; a wrong offset would panic, never read outside.
#[inline]
fn load<const N: usize, const BIG: bool>(bytes: &[u8], offset: usize) -> u64 {
    let mut word = [0u8; 8];
    if BIG {
        word[8 - N..].copy_from_slice(&bytes[offset..offset + N]);
        u64::from_be_bytes(word)
    } else {
        word[..N].copy_from_slice(&bytes[offset..offset + N]);
        u64::from_le_bytes(word)
    }
}

/// A number as a double: integers beyond 2⁵³ are rounded.
#[inline(always)]
fn read<const BIG: bool>(prim: Prim, bytes: &[u8], at: usize) -> f64 {
    match prim {
        Prim::Bool => f64::from(u8::from(bytes[at] != 0)),
        Prim::U8 => f64::from(bytes[at]),
        Prim::I8 => f64::from(bytes[at] as i8),
        Prim::U16 => load::<2, BIG>(bytes, at) as f64,
        Prim::I16 => f64::from(load::<2, BIG>(bytes, at) as i16),
        Prim::U32 => load::<4, BIG>(bytes, at) as f64,
        Prim::I32 => f64::from(load::<4, BIG>(bytes, at) as i32),
        Prim::U64 => load::<8, BIG>(bytes, at) as f64,
        Prim::I64 => load::<8, BIG>(bytes, at) as i64 as f64,
        Prim::F32 => f64::from(f32::from_bits(load::<4, BIG>(bytes, at) as u32)),
        Prim::F64 => f64::from_bits(load::<8, BIG>(bytes, at)),
    }
}

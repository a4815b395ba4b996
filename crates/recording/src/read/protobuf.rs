//! Protobuf messages, laid out by the `FileDescriptorSet` in the file: every number, truth value and enum is a signal.
//!
//! A plan per message type says what each field number holds. Values wait in the plan until the message is whole, because fields may
//! come in any order and more than once (the last one counts), and fields that are not there have the value zero where proto3 says so.

use std::collections::HashMap;

use prost_reflect::{FieldDescriptor, Kind as FieldKind, MessageDescriptor};

use super::{
    decode::{Decoder, SchemaRef},
    decoders::{NoDecoder, Opened},
    names,
    rows::{Long, MAX_PLACES, Rows, UNWANTED, places_of},
};

/// Messages nested deeper than this are refused.
const MAX_DEPTH: usize = 64;

struct Protobuf {
    descriptor: MessageDescriptor,
    root: Node,
}

pub(super) fn open(schema: &SchemaRef<'_>, rows: &mut Rows) -> Opened {
    let descriptor = descriptor(schema)?;
    let root = Node::new(&descriptor, "", rows);
    Ok(Box::new(Protobuf { descriptor, root }))
}

/// The message's descriptor out of the set in the file.
fn descriptor(schema: &SchemaRef<'_>) -> Result<MessageDescriptor, NoDecoder> {
    let pool = schema.pools.of(schema.data)?;
    pool.get_message_by_name(schema.name).ok_or_else(|| {
        NoDecoder::BadSchema(format!(
            "the FileDescriptorSet does not define the message {}",
            schema.name
        ))
    })
}

/// How a number is on the wire.
#[derive(Clone, Copy, PartialEq)]
enum Number {
    Double,
    Float,
    Signed32,
    Signed64,
    Unsigned,
    Unsigned32,
    Zigzag,
    Fixed32,
    Fixed64,
    SignedFixed32,
    SignedFixed64,
    Bool,
}

impl Number {
    fn of(kind: &FieldKind) -> Option<Self> {
        Some(match kind {
            FieldKind::Double => Number::Double,
            FieldKind::Float => Number::Float,
            FieldKind::Int32 | FieldKind::Enum(_) => Number::Signed32,
            FieldKind::Int64 => Number::Signed64,
            FieldKind::Uint32 => Number::Unsigned32,
            FieldKind::Uint64 => Number::Unsigned,
            FieldKind::Sint32 | FieldKind::Sint64 => Number::Zigzag,
            FieldKind::Fixed32 => Number::Fixed32,
            FieldKind::Fixed64 => Number::Fixed64,
            FieldKind::Sfixed32 => Number::SignedFixed32,
            FieldKind::Sfixed64 => Number::SignedFixed64,
            FieldKind::Bool => Number::Bool,
            FieldKind::String | FieldKind::Bytes | FieldKind::Message(_) => return None,
        })
    }

    /// The wire type that it has outside packed fields.
    fn wire(self) -> u8 {
        match self {
            Number::Double | Number::Fixed64 | Number::SignedFixed64 => 1,
            Number::Float | Number::Fixed32 | Number::SignedFixed32 => 5,
            _ => 0,
        }
    }

    fn read(self, input: &mut Input<'_>) -> Result<f64, &'static str> {
        Ok(match self {
            Number::Double => f64::from_le_bytes(input.take()?),
            Number::Float => f64::from(f32::from_le_bytes(input.take()?)),
            Number::Fixed64 => u64::from_le_bytes(input.take()?) as f64,
            Number::SignedFixed64 => i64::from_le_bytes(input.take()?) as f64,
            Number::Fixed32 => f64::from(u32::from_le_bytes(input.take()?)),
            Number::SignedFixed32 => f64::from(i32::from_le_bytes(input.take()?)),
            Number::Signed32 => f64::from(input.varint()? as i32),
            Number::Signed64 => input.varint()? as i64 as f64,
            Number::Unsigned32 => f64::from(input.varint()? as u32),
            Number::Unsigned => input.varint()? as f64,
            Number::Bool => f64::from(u8::from(input.varint()? != 0)),
            Number::Zigzag => unfolded(input.varint()?) as f64,
        })
    }
}

/// A number whose sign is its last bit.
fn unfolded(bits: u64) -> i64 {
    (bits >> 1) as i64 ^ -((bits & 1) as i64)
}

/// The bytes that are left of a message.
#[derive(Clone)]
struct Input<'a> {
    rest: &'a [u8],
}

impl<'a> Input<'a> {
    #[inline]
    fn take<const N: usize>(&mut self) -> Result<[u8; N], &'static str> {
        let (taken, rest) = self
            .rest
            .split_first_chunk::<N>()
            .ok_or("it ends inside a number")?;
        self.rest = rest;
        Ok(*taken)
    }

    #[inline(always)]
    fn varint(&mut self) -> Result<u64, &'static str> {
        // Tags and lengths mostly take one byte.
        match self.rest {
            [byte @ ..0x80, rest @ ..] => {
                self.rest = rest;
                Ok(u64::from(*byte))
            }
            _ => self.long_varint(),
        }
    }

    fn long_varint(&mut self) -> Result<u64, &'static str> {
        let mut value = 0u64;
        for (position, &byte) in self.rest.iter().take(10).enumerate() {
            value |= u64::from(byte & 0x7f) << (7 * position);
            if byte < 0x80 {
                self.rest = &self.rest[position + 1..];
                return Ok(value);
            }
        }
        Err(if self.rest.len() < 10 {
            "it ends inside a number"
        } else {
            "a number has more than ten bytes"
        })
    }

    fn bytes(&mut self) -> Result<&'a [u8], &'static str> {
        let length =
            usize::try_from(self.varint()?).map_err(|_| "a length is beyond the message")?;
        if length > self.rest.len() {
            return Err("a length is beyond the message");
        }
        let (taken, rest) = self.rest.split_at(length);
        self.rest = rest;
        Ok(taken)
    }

    /// Steps over a field that nobody wants.
    fn skip(&mut self, wire: u8, number: u64, depth: usize) -> Result<(), &'static str> {
        match wire {
            0 => self.varint().map(drop),
            1 => self.take::<8>().map(drop),
            2 => self.bytes().map(drop),
            5 => self.take::<4>().map(drop),
            3 if depth < MAX_DEPTH => loop {
                let tag = self.varint()?;
                if (tag & 7) == 4 {
                    return if tag >> 3 == number {
                        Ok(())
                    } else {
                        Err("a group ends that did not begin")
                    };
                }
                self.skip((tag & 7) as u8, tag >> 3, depth + 1)?;
            },
            _ => Err("a field has an unknown wire type"),
        }
    }
}

/// How many places a message takes that is called so: its fields, at least one.
fn places(descriptor: &MessageDescriptor, field: &str) -> usize {
    let each = |inner: FieldDescriptor| places_of(field.len() + 1 + inner.name().len());
    descriptor.fields().map(each).sum::<usize>().max(1)
}

/// The plan of one message, at one place.
struct Node {
    /// In the order of their numbers.
    fields: Vec<Field>,
    /// By oneof: the place of the member that came last.
    chosen: Vec<usize>,
    present: bool,
    stamp: bool,
}

struct Field {
    number: u64,
    /// Which oneof it is a member of.
    oneof: Option<usize>,
    plan: Plan,
}

enum Plan {
    /// A number; `implied` where an absent one is zero.
    Number {
        number: Number,
        column: u32,
        implied: bool,
        value: Option<f64>,
    },
    /// A message; its plan is made when the first one comes, because types may contain themselves.
    Message {
        descriptor: MessageDescriptor,
        field: String,
        places: usize,
        node: Option<Box<Node>>,
    },
    Numbers {
        number: Number,
        field: String,
        columns: Vec<u32>,
        values: Vec<f64>,
        count: usize,
    },
    Messages {
        descriptor: MessageDescriptor,
        field: String,
        /// Of each.
        places: usize,
        /// By place, or in the order of the first sight of their names.
        items: Vec<Node>,
        /// Those in the message, in its order: on no other may that of columns rest, for each thread has seen other messages before.
        came: Vec<usize>,
        /// Number of the text that names an item, and of the list among those with names.
        name: Option<(u64, usize)>,
        /// Places among the items.
        by_name: HashMap<Vec<u8>, usize>,
        count: usize,
    },
    Map {
        entry: MessageDescriptor,
        field: String,
        entries: Entries,
    },
    /// Text and bytes.
    Opaque,
}

/// The entries of a map.
#[derive(Default)]
struct Entries {
    plans: Vec<Plan>,
    /// Places among the plans.
    by_key: HashMap<String, usize>,
    /// Those in the message, in its order.
    present: Vec<usize>,
    /// The message has further ones.
    long: bool,
}

impl Plan {
    fn new(descriptor: &FieldDescriptor, field: String, rows: &mut Rows) -> Self {
        let kind = descriptor.kind();
        if descriptor.is_map()
            && let FieldKind::Message(entry) = kind
        {
            // A schema may call a message an entry that lacks a key or a value.
            if [1, 2]
                .iter()
                .any(|number| entry.get_field(*number).is_none())
            {
                return Plan::Opaque;
            }
            return Plan::Map {
                entry,
                field,
                entries: Entries::default(),
            };
        }
        match (kind, descriptor.is_list()) {
            (FieldKind::Message(descriptor), true) => Plan::Messages {
                name: name_of(&descriptor).map(|name| (name, rows.names.list(&field))),
                by_name: HashMap::new(),
                places: places(&descriptor, &field),
                descriptor,
                field,
                items: Vec::new(),
                came: Vec::new(),
                count: 0,
            },
            (FieldKind::Message(descriptor), false) => Plan::Message {
                places: places(&descriptor, &field),
                descriptor,
                field,
                node: None,
            },
            (kind, list) => match Number::of(&kind) {
                None => Plan::Opaque,
                Some(number) if list => Plan::Numbers {
                    number,
                    field,
                    columns: Vec::new(),
                    values: Vec::new(),
                    count: 0,
                },
                Some(number) => Plan::Number {
                    number,
                    column: rows.column(&field),
                    implied: !descriptor.supports_presence(),
                    value: None,
                },
            },
        }
    }
}

impl Node {
    fn new(descriptor: &MessageDescriptor, field: &str, rows: &mut Rows) -> Self {
        let mut oneofs = HashMap::new();
        for (k, oneof) in descriptor.oneofs().enumerate() {
            oneofs.extend(oneof.fields().map(|field| (field.number(), k)));
        }
        let mut fields: Vec<Field> = descriptor
            .fields()
            .map(|inner| {
                let path = if field.is_empty() {
                    inner.name().to_owned()
                } else {
                    format!("{field}.{}", inner.name())
                };
                Field {
                    number: u64::from(inner.number()),
                    oneof: oneofs.get(&inner.number()).copied(),
                    plan: Plan::new(&inner, path, rows),
                }
            })
            .collect();
        fields.sort_by_key(|field| field.number);
        rows.places += places(descriptor, field);
        let stamp = matches!(
            field,
            "timestamp" | "stamp" | "header.stamp" | "header.timestamp"
        ) && descriptor.full_name() == "google.protobuf.Timestamp";
        Node {
            chosen: vec![0; descriptor.oneofs().len()],
            fields,
            present: false,
            stamp,
        }
    }

    /// Reads fields until the input ends, or until the group `group` does.
    fn read(
        &mut self,
        input: &mut Input<'_>,
        group: Option<u64>,
        depth: usize,
        rows: &mut Rows,
    ) -> Result<(), &'static str> {
        if depth > MAX_DEPTH {
            return Err("messages are nested more than 64 deep");
        }
        self.present = true;
        let mut hint = 0;
        while !input.rest.is_empty() {
            let tag = input.varint()?;
            let (number, wire) = (tag >> 3, (tag & 7) as u8);
            if wire == 4 {
                return if group == Some(number) {
                    Ok(())
                } else {
                    Err("a group ends that did not begin")
                };
            }
            // Fields mostly come in order.
            let position = match self.fields.get(hint) {
                Some(known) if known.number == number => Ok(hint),
                _ => self
                    .fields
                    .binary_search_by_key(&number, |known| known.number),
            };
            let Ok(position) = position else {
                input.skip(wire, number, depth)?;
                continue;
            };
            // Of a oneof the last member counts, and the others are as if they had not come.
            if let Some(oneof) = self.fields[position].oneof {
                let before = std::mem::replace(&mut self.chosen[oneof], position);
                if before != position && self.fields[before].oneof == Some(oneof) {
                    self.fields[before].plan.flush(rows, false);
                }
            }
            hint = position + 1;
            match &mut self.fields[position].plan {
                // Most fields are: read in place, a call each would take longer.
                Plan::Number { number, value, .. } if wire == number.wire() => {
                    *value = Some(number.read(input)?);
                }
                plan => {
                    if matches!(plan, Plan::Messages { .. } | Plan::Map { .. }) {
                        hint = position;
                    }
                    plan.read(input, wire, number, depth, rows)?;
                }
            }
        }
        if group.is_some() {
            Err("a group has no end")
        } else {
            Ok(())
        }
    }

    /// Gives the values to the current row, or forgets them, and is ready for the next message.
    fn flush(&mut self, rows: &mut Rows, keep: bool) {
        let present = std::mem::take(&mut self.present);
        if !present {
            return;
        }
        if self.stamp && keep {
            let part = |number: u64| {
                self.fields.iter().find_map(|field| match field.plan {
                    Plan::Number { value, .. } if field.number == number => value,
                    _ => None,
                })
            };
            // OK because casts of doubles saturate.
            let (seconds, nanoseconds) =
                (part(1).unwrap_or(0.0) as i64, part(2).unwrap_or(0.0) as i64);
            rows.stamp_ns = Some(
                seconds
                    .saturating_mul(1_000_000_000)
                    .saturating_add(nanoseconds),
            );
        }
        for field in &mut self.fields {
            field.plan.flush(rows, keep);
        }
    }
}

impl Plan {
    fn read(
        &mut self,
        input: &mut Input<'_>,
        wire: u8,
        tag: u64,
        depth: usize,
        rows: &mut Rows,
    ) -> Result<(), &'static str> {
        const WRONG: &str = "a field has another wire type than its schema says";
        match self {
            Plan::Number { number, value, .. } => {
                if wire == 2 {
                    // A packed list where the schema has one value: the last one counts.
                    let mut packed = Input {
                        rest: input.bytes()?,
                    };
                    while !packed.rest.is_empty() {
                        *value = Some(number.read(&mut packed)?);
                    }
                    return Ok(());
                }
                if wire != number.wire() {
                    return Err(WRONG);
                }
                *value = Some(number.read(input)?);
            }
            Plan::Message {
                descriptor,
                field,
                places,
                node,
            } => {
                let begun = node.as_ref().is_some_and(|node| node.present);
                if !begun && !rows.enter(*places) {
                    return input.skip(wire, tag, depth);
                }
                let node = node.get_or_insert_with(|| Box::new(Node::new(descriptor, field, rows)));
                read_message(node, input, wire, tag, depth, rows)?;
            }
            Plan::Numbers {
                number,
                values,
                count,
                ..
            } => {
                let mut add = |value| {
                    *count += 1;
                    if *count <= rows.max_items {
                        values.push(value);
                    }
                };
                if wire == 2 {
                    let mut packed = Input {
                        rest: input.bytes()?,
                    };
                    while !packed.rest.is_empty() {
                        add(number.read(&mut packed)?);
                    }
                } else if wire == number.wire() {
                    add(number.read(input)?);
                } else {
                    return Err(WRONG);
                }
            }
            Plan::Messages {
                descriptor,
                field,
                places,
                items,
                came,
                name,
                by_name,
                count,
            } => {
                *count += 1;
                if *count > rows.max_items || !rows.enter(*places) {
                    return input.skip(wire, tag, depth);
                }
                let (mut position, mut label) = (*count - 1, (*count - 1).to_string());
                if let Some((number, list)) = *name {
                    let name = match wire {
                        2 => text_of(input.clone().bytes()?, number, depth)?,
                        _ => &[],
                    };
                    if rows.by_name {
                        // One without a name is called by its place, as no name looks.
                        let mut key = [b"\0", label.as_bytes()].concat();
                        if !name.is_empty() {
                            label = String::from_utf8_lossy(name).into_owned();
                            key = name.to_vec();
                        }
                        position = *by_name.entry(key).or_insert(items.len());
                    } else {
                        rows.names.see(list, position, name);
                    }
                }
                match items.get_mut(position) {
                    // Of those with one name the last counts.
                    Some(known) if known.present => known.flush(rows, false),
                    Some(_) => came.push(position),
                    None => {
                        let field = format!("{field}[{label}]");
                        items.push(Node::new(descriptor, &field, rows));
                        came.push(position);
                    }
                }
                read_message(&mut items[position], input, wire, tag, depth, rows)?;
            }
            Plan::Map {
                entry,
                field,
                entries,
            } => {
                if wire != 2 {
                    return Err(WRONG);
                }
                read_entry(entry, field, entries, input.bytes()?, depth, rows)?;
            }
            Plan::Opaque => input.skip(wire, tag, depth)?,
        }
        Ok(())
    }

    fn flush(&mut self, rows: &mut Rows, keep: bool) {
        match self {
            Plan::Number {
                column,
                implied,
                value,
                ..
            } => {
                let value = value.take();
                if keep && *column != UNWANTED {
                    if let Some(value) = value {
                        rows.push(*column, value);
                    } else if *implied {
                        rows.push(*column, 0.0);
                    }
                }
            }
            Plan::Message {
                node: Some(node), ..
            } => node.flush(rows, keep),
            Plan::Message { node: None, .. } | Plan::Opaque => {}
            Plan::Numbers {
                field,
                columns,
                values,
                count,
                ..
            } => {
                let fits = *count <= rows.max_items;
                if !fits && keep {
                    rows.note_long(Long::Items(field.clone()));
                }
                while columns.len() < values.len() && fits {
                    columns.push(rows.column(&format!("{field}[{}]", columns.len())));
                }
                if fits && keep {
                    for (&column, &value) in columns.iter().zip(values.iter()) {
                        rows.push(column, value);
                    }
                }
                values.clear();
                *count = 0;
            }
            Plan::Messages {
                field,
                items,
                came,
                count,
                ..
            } => {
                let fits = *count <= rows.max_items;
                if !fits && keep {
                    rows.note_long(Long::Items(field.clone()));
                }
                for position in came.drain(..) {
                    items[position].flush(rows, keep && fits);
                }
                *count = 0;
            }
            Plan::Map { field, entries, .. } => {
                let fits = !std::mem::take(&mut entries.long);
                if !fits && keep {
                    rows.note_long(Long::Items(field.clone()));
                }
                for position in entries.present.drain(..) {
                    entries.plans[position].flush(rows, keep && fits);
                }
            }
        }
    }
}

/// The number of the text field that names a message of a list.
fn name_of(descriptor: &MessageDescriptor) -> Option<u64> {
    let texts = (descriptor.fields())
        .filter(|field| matches!(field.kind(), FieldKind::String) && !field.is_list());
    let texts: Vec<FieldDescriptor> = texts.collect();
    let name = names::of_item(texts.iter().map(FieldDescriptor::name))?;
    let field = texts.iter().find(|field| field.name() == name)?;
    Some(u64::from(field.number()))
}

/// The text of a field in a message, the last one; empty where there is none.
fn text_of(message: &[u8], field: u64, depth: usize) -> Result<&[u8], &'static str> {
    let (mut input, mut text) = (Input { rest: message }, &[][..]);
    while !input.rest.is_empty() {
        let tag = input.varint()?;
        let (number, wire) = (tag >> 3, (tag & 7) as u8);
        match (number == field, wire) {
            (true, 2) => text = input.bytes()?,
            _ => input.skip(wire, number, depth)?,
        }
    }
    Ok(text)
}

fn read_message(
    node: &mut Node,
    input: &mut Input<'_>,
    wire: u8,
    tag: u64,
    depth: usize,
    rows: &mut Rows,
) -> Result<(), &'static str> {
    match wire {
        2 => node.read(
            &mut Input {
                rest: input.bytes()?,
            },
            None,
            depth + 1,
            rows,
        ),
        3 => node.read(input, Some(tag), depth + 1, rows),
        _ => Err("a field has another wire type than its schema says"),
    }
}

/// Reads one entry of a map: the value goes to the plan of its key.
fn read_entry(
    entry: &MessageDescriptor,
    field: &str,
    entries: &mut Entries,
    bytes: &[u8],
    depth: usize,
    rows: &mut Rows,
) -> Result<(), &'static str> {
    let key_kind = entry.map_entry_key_field().kind();
    let value_field = entry.map_entry_value_field();
    let mut key = match key_kind {
        FieldKind::String => String::new(),
        FieldKind::Bool => "false".to_owned(),
        _ => "0".to_owned(),
    };
    // The key may follow the value: find it first.
    let mut input = Input { rest: bytes };
    let mut values = Vec::new();
    while !input.rest.is_empty() {
        let tag = input.varint()?;
        let (number, wire) = (tag >> 3, (tag & 7) as u8);
        let before = input.rest;
        if number == 1 {
            key = match (&key_kind, Number::of(&key_kind)) {
                (FieldKind::String, _) if wire == 2 => {
                    String::from_utf8_lossy(input.bytes()?).into_owned()
                }
                (FieldKind::Bool, Some(number)) if wire == 0 => {
                    (number.read(&mut input)? != 0.0).to_string()
                }
                // A float has no room for these.
                (FieldKind::Uint64, _) if wire == 0 => input.varint()?.to_string(),
                (FieldKind::Int64, _) if wire == 0 => (input.varint()? as i64).to_string(),
                (FieldKind::Sint64, _) if wire == 0 => unfolded(input.varint()?).to_string(),
                (FieldKind::Fixed64, _) if wire == 1 => {
                    u64::from_le_bytes(input.take()?).to_string()
                }
                (FieldKind::Sfixed64, _) if wire == 1 => {
                    i64::from_le_bytes(input.take()?).to_string()
                }
                (_, Some(number)) if wire == number.wire() => number.read(&mut input)?.to_string(),
                _ => return Err("a map's key has another wire type than its schema says"),
            };
        } else {
            input.skip(wire, number, depth)?;
            if number == 2 {
                values.push((wire, before));
            }
        }
    }
    let known = entries.by_key.get(&key).copied();
    let present = known.is_some_and(|known| entries.present.contains(&known));
    if !present && entries.present.len() >= rows.max_items {
        entries.long = true;
        return Ok(());
    }
    let takes = places_of(field.len() + key.len());
    if !present && !rows.enter(takes) {
        return Ok(());
    }
    let position = known.unwrap_or_else(|| {
        let mut plan = Plan::new(&value_field, format!("{field}[{key}]"), rows);
        // An entry that is not there has no value, unlike a field.
        if let Plan::Number { implied, .. } = &mut plan {
            *implied = false;
        }
        rows.places += takes;
        entries.by_key.insert(key, entries.plans.len());
        entries.plans.push(plan);
        entries.plans.len() - 1
    });
    let plan = &mut entries.plans[position];
    if present {
        // Of entries with one key the last counts.
        plan.flush(rows, false);
    } else {
        entries.present.push(position);
    }
    match (plan, values.as_slice()) {
        (Plan::Number { value, .. }, []) => *value = Some(0.0),
        // An empty message.
        (_, []) => values.push((2, &[0])),
        _ => {}
    }
    let plan = &mut entries.plans[position];
    for (wire, rest) in values {
        plan.read(&mut Input { rest }, wire, 2, depth + 1, rows)?;
    }
    Ok(())
}

impl Decoder for Protobuf {
    fn decode(&mut self, message: &[u8], rows: &mut Rows) -> Result<(), String> {
        if rows.places > MAX_PLACES {
            self.root = Node::new(&self.descriptor, "", rows);
            rows.places = 0;
        }
        let read = self.root.read(&mut Input { rest: message }, None, 0, rows);
        self.root.flush(rows, read.is_ok());
        read.map_err(|problem| format!("protobuf message of {} bytes: {problem}", message.len()))
    }
}

//! JSON messages (`json`), with a JSON Schema or none: every number and truth value is a signal.

use std::collections::HashMap;

use serde::de::{DeserializeSeed, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::Value;

use super::{
    decode::{Decoder, SchemaRef},
    decoders::Opened,
    names,
    rows::{Long, MAX_PLACES, Rows, UNWANTED, places_of},
};

struct Json {
    root: Node,
    pending: Pending,
}

/// The numbers of the message in hand: a text that turns out to be no JSON gives none.
#[derive(Default)]
struct Pending {
    values: Vec<(u32, f64)>,
    /// The last message that gave each column a number, and the node there.
    givers: Vec<(u64, u32)>,
    message: u64,
    /// How many nodes have a column.
    nodes: u32,
    /// The first field that two nodes of the message give a number.
    twice: Option<String>,
}

impl Pending {
    fn begin(&mut self) {
        self.values.clear();
        self.twice = None;
        self.message += 1;
    }

    /// Puts a number, and says whether another node of this message gave the column one.
    fn put(&mut self, (column, node): (u32, u32), value: f64) -> bool {
        self.values.push((column, value));
        let column = column as usize;
        if self.givers.len() <= column {
            self.givers.resize(column + 1, (0, 0));
        }
        let (message, giver) = std::mem::replace(&mut self.givers[column], (self.message, node));
        message == self.message && giver != node
    }
}

/// One place in the document: what has been seen there.
#[derive(Default)]
struct Node {
    field: String,
    /// Its column, and its number among the nodes that have one.
    column: Option<(u32, u32)>,
    children: Vec<(String, Node)>,
    /// Places among the children.
    by_key: HashMap<String, usize>,
    /// Items by their place, and by their names.
    items: Vec<Node>,
    by_name: HashMap<String, Node>,
    /// Its number among the lists with names.
    list: Option<usize>,
}

impl Node {
    fn item(&self, label: impl std::fmt::Display) -> Node {
        Node {
            field: format!("{}[{label}]", self.field),
            ..Node::default()
        }
    }
}

pub(super) fn open(schema: &SchemaRef<'_>, rows: &mut Rows) -> Opened {
    if schema.encoding == "jsonschema"
        && let Err(problem) = serde_json::from_slice::<IgnoredAny>(schema.data)
    {
        rows.remark = Some(format!(
            "its JSON Schema is not JSON ({problem}); the messages are read without it"
        ));
    }
    Ok(Box::new(Json {
        root: Node::default(),
        pending: Pending::default(),
    }))
}

impl Decoder for Json {
    fn decode(&mut self, message: &[u8], rows: &mut Rows) -> Result<(), String> {
        if rows.places > MAX_PLACES {
            rows.places = 0;
            self.root = Node::default();
        }
        let text = message.strip_prefix(BYTE_ORDER_MARK).unwrap_or(message);
        let stamp = self.read(text, rows).or_else(|problem| {
            // Python's and other writers put what JSON does not have.
            match mend(text) {
                Some(mended) => {
                    rows.take_back_counts();
                    self.read(&mended, rows)
                }
                None => Err(problem),
            }
        });
        let stamp = stamp
            .map_err(|problem| format!("JSON message of {} bytes: {problem}", message.len()))?;
        for &(column, value) in &self.pending.values {
            rows.push(column, value);
        }
        rows.twice = rows.twice.take().or(self.pending.twice.take());
        rows.stamp_ns = stamp.ns();
        Ok(())
    }
}

impl Json {
    fn read(&mut self, message: &[u8], rows: &mut Rows) -> Result<Stamp, serde_json::Error> {
        self.pending.begin();
        let mut stamp = Stamp::default();
        let mut deserializer = serde_json::Deserializer::from_slice(message);
        let place = Place {
            node: &mut self.root,
            rows,
            pending: &mut self.pending,
            stamp: &mut stamp,
            names: &[],
            item: None,
        };
        place.deserialize(&mut deserializer)?;
        deserializer.end()?;
        Ok(stamp)
    }
}

/// Words for numbers that JSON does not have, and what they mean.
const WORDS: [(&str, f64); 3] = [
    ("NaN", f64::NAN),
    ("-Infinity", f64::NEG_INFINITY),
    ("Infinity", f64::INFINITY),
];

/// Marks a text that was such a word; no writer begins a text so.
const MARK: char = '\u{1}';

/// Some writers put it before the document.
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// The document with its bare words as marked texts, and U+FFFD for each half of a surrogate pair that stands alone; `None` where it has
/// neither.
fn mend(message: &[u8]) -> Option<Vec<u8>> {
    let mut mended = Vec::new();
    let (mut rest, mut inside, mut found) = (message, false, false);
    while let Some((&byte, after)) = rest.split_first() {
        if !inside
            && let Some((word, _)) = WORDS.iter().find(|(w, _)| rest.starts_with(w.as_bytes()))
        {
            mended.extend(format!("\"\\u0001{word}\"").bytes());
            rest = &rest[word.len()..];
            found = true;
            continue;
        }
        if inside && let Some(half @ 0xd800..0xe000) = escaped(rest) {
            let (first, behind) = rest.split_at(ESCAPE);
            rest = behind;
            if half < 0xdc00 && matches!(escaped(behind), Some(0xdc00..0xe000)) {
                mended.extend_from_slice(first);
                mended.extend_from_slice(&behind[..ESCAPE]);
                rest = &behind[ESCAPE..];
            } else {
                mended.extend_from_slice(b"\\ufffd");
                found = true;
            }
            continue;
        }
        mended.push(byte);
        rest = after;
        match byte {
            b'"' => inside = !inside,
            b'\\' if inside => {
                // The character behind does not end the text.
                if let Some((&next, after)) = rest.split_first() {
                    mended.push(next);
                    rest = after;
                }
            }
            _ => {}
        }
    }
    found.then_some(mended)
}

/// Bytes of an escape as `\ud800`.
const ESCAPE: usize = 6;

/// The value of such an escape, if one begins here.
fn escaped(text: &[u8]) -> Option<u16> {
    let digits = text.get(..ESCAPE)?.strip_prefix(b"\\u")?;
    u16::from_str_radix(str::from_utf8(digits).ok()?, 16).ok()
}

/// Seconds and nanoseconds of the header's stamp, or of a `timestamp`.
#[derive(Default)]
struct Stamp {
    seconds: Option<f64>,
    nanoseconds: f64,
}

impl Stamp {
    fn ns(&self) -> Option<i64> {
        let seconds = self.seconds?;
        // OK because a cast of a double saturates.
        Some(
            (seconds as i64)
                .saturating_mul(1_000_000_000)
                .saturating_add(self.nanoseconds as i64),
        )
    }

    fn see(&mut self, field: &str, value: f64) {
        match field {
            "header.stamp.sec" | "timestamp.sec" | "header.stamp.secs" => {
                self.seconds = Some(value)
            }
            "header.stamp.nanosec"
            | "header.stamp.nsec"
            | "timestamp.nsec"
            | "header.stamp.nsecs" => self.nanoseconds = value,
            _ => {}
        }
    }
}

struct Place<'a, 'r> {
    node: &'a mut Node,
    rows: &'a mut Rows<'r>,
    pending: &'a mut Pending,
    stamp: &'a mut Stamp,
    /// What a list of names before this value calls its items, if it is a list.
    names: &'a [String],
    /// Which list it is an item of, and where.
    item: Option<(usize, usize)>,
}

impl Place<'_, '_> {
    fn number(self, value: f64) {
        let column = *self.node.column.get_or_insert_with(|| {
            self.pending.nodes = self.pending.nodes.wrapping_add(1);
            (self.rows.column(&self.node.field), self.pending.nodes)
        });
        if column.0 != UNWANTED && self.pending.put(column, value) {
            let field = || self.node.field.clone();
            self.pending.twice.get_or_insert_with(field);
        }
        self.stamp.see(&self.node.field, value);
    }
}

impl<'de> DeserializeSeed<'de> for Place<'_, '_> {
    type Value = ();

    fn deserialize<D: serde::Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        self.rows.enter(places_of(self.node.field.len()));
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Place<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("any JSON value")
    }

    fn visit_bool<E>(self, value: bool) -> Result<(), E> {
        self.number(f64::from(u8::from(value)));
        Ok(())
    }

    fn visit_i64<E>(self, value: i64) -> Result<(), E> {
        self.number(value as f64);
        Ok(())
    }

    fn visit_u64<E>(self, value: u64) -> Result<(), E> {
        self.number(value as f64);
        Ok(())
    }

    fn visit_f64<E>(self, value: f64) -> Result<(), E> {
        self.number(value);
        Ok(())
    }

    fn visit_str<E>(self, text: &str) -> Result<(), E> {
        let word = text.strip_prefix(MARK);
        if let Some((_, value)) = word.and_then(|w| WORDS.iter().find(|(known, _)| *known == w)) {
            self.number(*value);
        }
        Ok(())
    }

    fn visit_unit<E>(self) -> Result<(), E> {
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let Place {
            node,
            rows,
            pending,
            stamp,
            item,
            ..
        } = self;
        // Keys mostly come in the same order, so the next one is tried first.
        let (mut hint, mut keys) = (0, 0);
        let (mut names, mut texts): (Vec<String>, Vec<(String, String)>) = Default::default();
        while let Some(key) = map.next_key::<std::borrow::Cow<'_, str>>()? {
            keys += 1;
            if keys > MAX_KEYS {
                map.next_value::<IgnoredAny>()?;
                if keys == MAX_KEYS + 1 {
                    rows.note_long(Long::Keys(node.field.clone()));
                }
                continue;
            }
            let takes = places_of(node.field.len() + 1 + key.len());
            if !rows.has_room(takes) {
                rows.enter(takes);
                map.next_value::<IgnoredAny>()?;
                continue;
            }
            let called = names::is_name(&key).then(|| key.to_string());
            let known = match node.children.get(hint) {
                Some((known, _)) if *known == key => Some(hint),
                _ => node.by_key.get(&*key).copied(),
            };
            let position = known.unwrap_or_else(|| {
                let field = if node.field.is_empty() {
                    key.to_string()
                } else {
                    format!("{}.{key}", node.field)
                };
                let child = Node {
                    field,
                    ..Node::default()
                };
                rows.places += takes;
                node.by_key.insert(key.to_string(), node.children.len());
                node.children.push((key.into_owned(), child));
                node.children.len() - 1
            });
            hint = position + 1;
            let child = &mut node.children[position].1;
            let mut value = None;
            if let Some(key) = called {
                let told: Value = map.next_value()?;
                match &told {
                    Value::String(text) => texts.push((key, text.clone())),
                    Value::Array(list) if names::is_list(&key) => {
                        let text = |item: &Value| item.as_str().map(str::to_owned);
                        names = list.iter().map_while(text).collect();
                        let list =
                            *(child.list).get_or_insert_with(|| rows.names.list(&child.field));
                        for (place, name) in names.iter().enumerate().filter(|_| !rows.by_name) {
                            rows.names.see(list, place, name.as_bytes());
                        }
                    }
                    _ => {}
                }
                value = Some(told);
            }
            let place = Place {
                node: child,
                rows,
                pending,
                stamp,
                names: &names,
                item: None,
            };
            match value {
                Some(value) => place.deserialize(value).map_err(A::Error::custom)?,
                None => map.next_value_seed(place)?,
            }
        }
        let text = names::of_item(texts.iter().map(|(key, _)| key.as_str()));
        if let (Some((list, place)), Some(key)) = (item, text)
            && let Some((_, name)) = texts.iter().find(|(known, _)| known == key)
            && !rows.by_name
        {
            rows.names.see(list, place, name.as_bytes());
        }
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<(), A::Error> {
        let Place {
            node,
            rows,
            pending,
            stamp,
            names,
            ..
        } = self;
        let list = *(node.list).get_or_insert_with(|| rows.names.list(&node.field));
        let before = pending.values.len();
        let takes = places_of(node.field.len());
        let mut item = 0;
        loop {
            if item >= rows.max_items {
                if seq.next_element::<IgnoredAny>()?.is_none() {
                    break;
                }
                if item == rows.max_items {
                    rows.note_long(Long::Items(node.field.clone()));
                    pending.values.truncate(before);
                }
            } else if !rows.has_room(takes) {
                if seq.next_element::<IgnoredAny>()?.is_none() {
                    break;
                }
                rows.enter(takes);
            } else {
                let (mut value, mut name) = (None, None);
                if rows.by_name {
                    let Some(told) = seq.next_element::<Value>()? else {
                        break;
                    };
                    name = name_of(&told).or_else(|| names.get(item).cloned());
                    value = Some(told);
                }
                let inner = match name.filter(|name| !name.is_empty()) {
                    Some(name) => {
                        if !node.by_name.contains_key(&name) {
                            let inner = node.item(&name);
                            rows.places += places_of(inner.field.len());
                            node.by_name.insert(name.clone(), inner);
                        }
                        node.by_name.get_mut(&name)
                    }
                    None => {
                        // Those before it may have names.
                        while node.items.len() <= item {
                            rows.places += takes;
                            let inner = node.item(node.items.len());
                            node.items.push(inner);
                        }
                        node.items.get_mut(item)
                    }
                };
                let Some(inner) = inner else { break };
                let place = Place {
                    node: inner,
                    rows,
                    pending,
                    stamp,
                    names: &[],
                    item: Some((list, item)),
                };
                match value {
                    Some(value) => place.deserialize(value).map_err(A::Error::custom)?,
                    None => {
                        if seq.next_element_seed(place)?.is_none() {
                            break;
                        }
                    }
                }
            }
            item += 1;
        }
        Ok(())
    }
}

/// What an item calls itself.
fn name_of(item: &Value) -> Option<String> {
    let object = item.as_object()?;
    let texts = object.iter().filter(|(_, value)| value.is_string());
    let key = names::of_item(texts.map(|(key, _)| key.as_str()))?;
    object[key].as_str().map(str::to_owned)
}

/// Keys of one object that become signals.
pub(super) const MAX_KEYS: usize = 4096;

//! The table of decoders: message encoding and schema encoding to the code that turns messages into numbers.

use std::ops::Range;

use super::{cdr, json, protobuf, ros1, rows::Rows};

/// Where a message lies in the bytes of its block.
#[derive(Clone, Debug)]
pub(super) struct Place {
    pub bytes: Range<usize>,
    /// Log time, ns.
    pub time: i64,
}

/// Turns the messages of one channel into rows of numbers.
pub(super) trait Decoder: Send {
    /// Decodes and keeps as many of the first messages at `places` in `block` as it can take column by column, which is several
    /// times quicker; returns how many. The caller decodes the next one alone.
    fn decode_alike(&mut self, _block: &[u8], _places: &[Place], _rows: &mut Rows) -> usize {
        0
    }

    /// Decodes one message into the current row; on an error the caller takes the row back.
    fn decode(&mut self, message: &[u8], rows: &mut Rows) -> Result<(), String>;
}

/// A schema as the file gives it.
#[derive(Clone, Copy, Debug)]
pub(super) struct SchemaRef<'a> {
    pub name: &'a str,
    pub encoding: &'a str,
    pub data: &'a [u8],
}

/// What [`open`] can say instead of a decoder.
#[derive(Debug)]
pub(super) enum NoDecoder {
    /// No line of the table fits.
    Unknown,
    /// The schema cannot be understood: why.
    BadSchema(String),
}

type Open = fn(&SchemaRef<'_>, &mut Rows) -> Result<Box<dyn Decoder>, String>;

/// Message encoding, schema encoding (`*`: any, or none) and how to begin.
const DECODERS: &[(&str, &str, Open)] = &[
    ("cdr", "ros2msg", cdr::open_ros2msg),
    ("cdr", "ros2idl", cdr::open_idl),
    ("cdr", "omgidl", cdr::open_idl),
    ("ros1", "ros1msg", ros1::open),
    ("protobuf", "protobuf", protobuf::open),
    ("json", "*", json::open),
];

/// The encodings that can be read, as `message encoding/schema encoding`.
pub fn supported() -> impl Iterator<Item = (&'static str, &'static str)> {
    DECODERS
        .iter()
        .map(|(message, schema, _)| (*message, *schema))
}

/// Finds the decoder of a channel and lets it read the schema.
pub(super) fn open(
    message_encoding: &str,
    schema: &SchemaRef<'_>,
    rows: &mut Rows,
) -> Result<Box<dyn Decoder>, NoDecoder> {
    let open = DECODERS
        .iter()
        .find(|(message, encoding, _)| {
            *message == message_encoding && (*encoding == "*" || *encoding == schema.encoding)
        })
        .map(|(_, _, open)| open)
        .ok_or(NoDecoder::Unknown)?;
    open(schema, rows).map_err(NoDecoder::BadSchema)
}

//! The table of decoders: message encoding and schema encoding to the code that turns messages into numbers.

use super::{
    cdr,
    decode::{Decoder, SchemaRef},
    json, protobuf, ros1,
    rows::Rows,
};

/// What [`open`] can say instead of a decoder.
#[derive(Clone, Debug)]
pub(super) enum NoDecoder {
    /// No line of the table fits.
    Unknown,
    /// The schema is written in a language that is not read: which.
    Unread(String),
    /// The schema cannot be understood: why.
    BadSchema(String),
}

impl From<String> for NoDecoder {
    fn from(problem: String) -> Self {
        NoDecoder::BadSchema(problem)
    }
}

/// What a line of the table gives.
pub(super) type Opened = Result<Box<dyn Decoder>, NoDecoder>;

type Open = fn(&SchemaRef<'_>, &mut Rows) -> Opened;

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

/// The same in a sentence.
pub(super) fn listed() -> String {
    let each = supported().map(|(message, schema)| match schema {
        "*" => message.to_owned(),
        _ => format!("{message}/{schema}"),
    });
    each.collect::<Vec<_>>().join(", ")
}

/// Finds the decoder of a channel and lets it read the schema.
pub(super) fn open(message_encoding: &str, schema: &SchemaRef<'_>, rows: &mut Rows) -> Opened {
    let open = DECODERS
        .iter()
        .find(|(message, encoding, _)| {
            *message == message_encoding && (*encoding == "*" || *encoding == schema.encoding)
        })
        .map(|(_, _, open)| open)
        .ok_or(NoDecoder::Unknown)?;
    open(schema, rows)
}

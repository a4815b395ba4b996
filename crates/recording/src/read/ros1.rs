//! ROS 1 messages (`ros1`): packed little-endian fields, laid out by `ros1msg` text.

use super::{
    decode::{Decoder, Place, SchemaRef},
    decoders::Opened,
    layout::{Fail, Headers, Problem, Program, Shape, Sizes},
    ros2msg::{self, Dialect},
    rows::{MAX_PLACES, Rows},
    types::Types,
};

const SHAPE: Shape = Shape {
    big_endian: false,
    max_align: 1,
    headers: Headers::None,
    each_row: false,
    sizes: Sizes::None,
    wide: 2,
    empty_takes_byte: false,
};

struct Ros1 {
    types: Types,
    program: Program,
}

pub(super) fn open(schema: &SchemaRef<'_>, rows: &mut Rows) -> Opened {
    let text =
        str::from_utf8(schema.data).map_err(|_| "the definition is not UTF-8 text".to_owned())?;
    let types = ros2msg::parse(schema.name, text, Dialect::Ros1)?;
    let program = Program::message(&types, SHAPE, rows)?;
    Ok(Box::new(Ros1 { types, program }))
}

impl Decoder for Ros1 {
    fn decode_alike(&mut self, block: &[u8], places: &[Place], rows: &mut Rows) -> usize {
        let count = self
            .program
            .decode_alike(SHAPE, block, places, 0, |_| true, rows);
        if self.program.bytes_left() > Some(0) {
            rows.trailing += count as u64;
        }
        count
    }

    fn decode(&mut self, message: &[u8], rows: &mut Rows) -> Result<(), String> {
        if rows.places > MAX_PLACES {
            (rows.places, rows.fields) = (0, 0);
            self.program = Program::message(&self.types, SHAPE, rows)?;
        }
        let end = self
            .program
            .decode(&self.types, SHAPE, message, rows)
            .map_err(|fail| describe(&fail, "ROS 1 message", message.len()))?;
        if end < message.len() {
            rows.trailing += 1;
        }
        Ok(())
    }
}

/// The sentence for a message that does not fit its schema.
pub(super) fn describe(fail: &Fail, what: &str, length: usize) -> String {
    match fail.problem {
        Problem::Short => format!(
            "{what} of {length} bytes ends while reading {:?}",
            fail.field
        ),
        Problem::Other(problem) => format!(
            "{what} stopped at byte {} in {:?}: {problem}",
            fail.at, fail.field
        ),
    }
}

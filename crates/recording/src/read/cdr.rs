//! ROS 2 messages (`cdr`): XCDR1 and plain XCDR2, both byte orders, laid out by `ros2msg` or IDL text.
//!
//! Three points of the representation differ between implementations: whether plain XCDR2 puts a size before collections of structs
//! and strings, and before those of enums, whether it puts one before structs that are neither `@final` nor `@appendable`, and how many
//! bytes a wide character takes. A message tells by being used up exactly; the reading that
//! does so is tried first on the channel's next message. Only where none does, padding may be left.

use super::{
    decode::{Decoder, Place, SchemaRef},
    decoders::Opened,
    idl,
    layout::{Fail, Headers, Program, Shape, Sizes},
    ros1::describe,
    ros2msg::{self, Dialect},
    rows::{MAX_PLACES, Rows},
    types::{Extensible, Struct, Type, Types},
};

/// Bytes that say how a message is represented.
const HEADER: usize = 4;

/// So many bytes of padding may follow a message.
const PADDING: usize = 3;

struct Cdr {
    types: Types,
    /// Whether the message has wide text, collections of structs and text, collections of enums, or arrays of several dimensions of
    /// any of these, or structs that may be extended or not: where readings differ.
    wide: bool,
    collections: bool,
    enums: bool,
    grids: bool,
    unsaid: bool,
    programs: Vec<(Shape, Program)>,
    /// The readings to try, by representation; the one that fitted last comes first.
    readings: Vec<(u8, Vec<Shape>)>,
}

pub(super) fn open_ros2msg(schema: &SchemaRef<'_>, _rows: &mut Rows) -> Opened {
    let text =
        str::from_utf8(schema.data).map_err(|_| "the definition is not UTF-8 text".to_owned())?;
    begin(ros2msg::parse(schema.name, text, Dialect::Ros2)?)
}

pub(super) fn open_idl(schema: &SchemaRef<'_>, _rows: &mut Rows) -> Opened {
    let text =
        str::from_utf8(schema.data).map_err(|_| "the definition is not UTF-8 text".to_owned())?;
    begin(idl::parse(schema.name, text)?)
}

fn begin(types: Types) -> Opened {
    let (mut wide, mut collections, mut enums, mut grids) = (false, false, false, false);
    for kind in types
        .structs
        .iter()
        .flat_map(|message| message.fields.iter().map(|(_, kind)| kind))
    {
        let mut kind = kind;
        while let Type::Array(inner, _) | Type::Sequence(inner) = kind {
            let item = kind.item();
            enums |= *item == Type::Enum;
            collections |= item.prim().is_none();
            grids |= item != &**inner && !matches!(item, Type::Prim(_));
            kind = inner;
        }
        wide |= *kind == Type::WideText;
    }
    let unsaid = |message: &Struct| message.extensible == Extensible::Unsaid;
    Ok(Box::new(Cdr {
        unsaid: types.structs.iter().skip(1).any(unsaid),
        types,
        wide,
        collections,
        enums,
        grids,
        programs: Vec::new(),
        readings: Vec::new(),
    }))
}

impl Cdr {
    /// The readings to try for a representation, the likeliest first.
    fn readings_of(&self, representation: u8) -> Result<Vec<Shape>, String> {
        let (big_endian, second) = match representation {
            0x00 => (true, false),
            0x01 => (false, false),
            // Writers number XCDR2 in two ways.
            0x06 | 0x10 => (true, true),
            0x07 | 0x11 => (false, true),
            0x02 | 0x03 | 0x0a | 0x0b | 0x12 | 0x13 => {
                return Err("the message is a CDR parameter list, which has no decoder".to_owned());
            }
            0x08 | 0x09 | 0x14 | 0x15 => {
                return Err("the message is delimited CDR, which has no decoder".to_owned());
            }
            other => {
                return Err(format!(
                    "the representation identifier 0x00{other:02x} is not known"
                ));
            }
        };
        let shape = Shape {
            big_endian,
            max_align: if second { 4 } else { 8 },
            headers: Headers::None,
            each_row: false,
            sizes: Sizes::None,
            wide: 2,
            empty_takes_byte: true,
        };
        let headers = match (second, self.collections, self.enums) {
            (true, true, true) => &[Headers::All, Headers::NotEnums, Headers::None][..],
            (true, true, false) | (true, false, true) => &[Headers::All, Headers::None],
            _ => &[Headers::None],
        };
        // One size before a whole array (XTypes 1.3: an array of several dimensions is one), or nested arrays as writers hold them.
        let rows = |headers: Headers| match self.grids && headers != Headers::None {
            true => &[false, true][..],
            false => &[false],
        };
        // Of a message without a size, nothing said means no size; where the message alone is said to be @final, it means one.
        let sizes = match (second, self.unsaid, self.types.structs[0].extensible) {
            (false, ..) => &[Sizes::None][..],
            (true, false, _) => &[Sizes::Appendable],
            (true, true, Extensible::No) => &[Sizes::NotFinal, Sizes::Appendable],
            (true, true, _) => &[Sizes::Appendable, Sizes::NotFinal],
        };
        let mut readings = Vec::new();
        for &sizes in sizes {
            for &headers in headers {
                readings.extend(rows(headers).iter().map(|&each_row| Shape {
                    headers,
                    each_row,
                    sizes,
                    ..shape
                }));
            }
        }
        if self.wide {
            let four: Vec<Shape> = readings
                .iter()
                .map(|shape| Shape { wide: 4, ..*shape })
                .collect();
            readings.extend(four);
        }
        Ok(readings)
    }

    fn run(
        &mut self,
        shape: Shape,
        body: &[u8],
        rows: &mut Rows,
    ) -> Result<Result<usize, Fail>, String> {
        let position = match self.programs.iter().position(|(known, _)| *known == shape) {
            Some(position) => position,
            None => {
                self.programs
                    .push((shape, Program::message(&self.types, shape, rows)?));
                self.programs.len() - 1
            }
        };
        Ok(self.programs[position]
            .1
            .decode(&self.types, shape, body, rows))
    }
}

impl Decoder for Cdr {
    fn begin_block(&mut self) {
        self.readings.clear();
    }

    fn decode_alike(&mut self, block: &[u8], places: &[Place], rows: &mut Rows) -> usize {
        let Some(first) = places.first().map(|place| &block[place.bytes.clone()]) else {
            return 0;
        };
        let Some((representation, readings)) = self
            .readings
            .iter()
            .find(|(known, _)| first.starts_with(&[0, *known]))
        else {
            return 0;
        };
        let (representation, shape) = (*representation, readings[0]);
        // Another reading might use up exactly what this one leaves padding of.
        let may_be_left = if readings.len() == 1 { PADDING } else { 0 };
        let Some((_, program)) = self.programs.iter_mut().find(|(known, _)| *known == shape) else {
            return 0;
        };
        if program.bytes_left().is_none_or(|left| left > may_be_left) {
            return 0;
        }
        let suits = |message: &[u8]| message.first_chunk() == Some(&[0, representation]);
        program.decode_alike(shape, block, places, HEADER, suits, rows)
    }

    fn decode(&mut self, message: &[u8], rows: &mut Rows) -> Result<(), String> {
        let Some((header, body)) = message.split_first_chunk::<HEADER>() else {
            return Err(format!(
                "CDR message of {} bytes has no room for its header of {HEADER}",
                message.len()
            ));
        };
        let [first, representation, ..] = *header;
        if first != 0 {
            return Err(format!(
                "the representation identifier 0x{first:02x}{representation:02x} is not known"
            ));
        }
        if rows.places > MAX_PLACES {
            (rows.places, rows.fields) = (0, 0);
            self.programs.clear();
        }
        let known = match self
            .readings
            .iter()
            .position(|(known, _)| *known == representation)
        {
            Some(known) => known,
            None => {
                let readings = self.readings_of(representation)?;
                self.readings.push((representation, readings));
                self.readings.len() - 1
            }
        };
        let count = self.readings[known].1.len();
        let (mut padded, mut best) = (None, None::<Result<usize, Fail>>);
        for number in 0..count {
            if number > 0 {
                rows.abort();
                rows.begin();
            }
            let shape = self.readings[known].1[number];
            let result = self.run(shape, body, rows)?;
            match result.as_ref().map(|end| body.len() - end) {
                Ok(left) if left == 0 || (count == 1 && left <= PADDING) => {
                    self.readings[known].1[..=number].rotate_right(1);
                    return Ok(());
                }
                Ok(left) if left <= PADDING && padded.is_none() => padded = Some(number),
                _ => {}
            }
            if best.is_none() || (matches!(best, Some(Err(_))) && result.is_ok()) {
                best = Some(result);
            }
        }
        if let Some(number) = padded {
            let shape = self.readings[known].1[number];
            self.readings[known].1[..=number].rotate_right(1);
            rows.abort();
            rows.begin();
            // It has decoded this very message before.
            return match self.run(shape, body, rows)? {
                Ok(_) => Ok(()),
                Err(fail) => Err(describe(&fail, "CDR message", message.len())),
            };
        }
        match best {
            Some(Ok(_)) if count == 1 => {
                rows.trailing += 1;
                Ok(())
            }
            Some(Ok(end)) => Err(format!(
                "CDR message of {} bytes holds {} after its last field",
                message.len(),
                body.len() - end
            )),
            Some(Err(fail)) => Err(describe(&fail, "CDR message", message.len())),
            None => Ok(()),
        }
    }
}

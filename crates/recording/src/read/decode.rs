//! What a decoder is: it turns the messages of one channel into rows of numbers.

use std::{ops::Range, sync::Arc};

use super::{descriptors::Pools, rows::Rows};

/// Where a message lies in the bytes of its block.
#[derive(Clone, Debug)]
pub(super) struct Place {
    pub bytes: Range<usize>,
    /// Log time, ns.
    pub time: i64,
}

/// Turns the messages of one channel into rows of numbers.
pub(super) trait Decoder: Send {
    /// Forgets whatever would make the messages of the next block read otherwise than by a decoder that saw no block before.
    fn begin_block(&mut self) {}

    /// Decodes and keeps as many of the first messages at `places` in `block` as it can take column by column, which is several
    /// times quicker; returns how many. The caller decodes the next one alone.
    fn decode_alike(&mut self, _block: &[u8], _places: &[Place], _rows: &mut Rows) -> usize {
        0
    }

    /// Decodes one message into the current row; on an error the caller takes the row back.
    fn decode(&mut self, message: &[u8], rows: &mut Rows) -> Result<(), String>;
}

/// A schema as the file gives it.
#[derive(Clone, Copy)]
pub(super) struct SchemaRef<'a> {
    pub name: &'a str,
    pub encoding: &'a str,
    pub data: &'a Arc<[u8]>,
    /// Descriptors of the recording's schemas.
    pub pools: &'a Pools,
}

//! Messages that are dated long before all others: kept from before a clock was set, or stamped with nothing. Counted from their times the rest would begin
//! an hour or half a century later, and a window of it would be another.

use super::container::{Block, chunk_header};
use std::collections::BinaryHeap;

/// More are no exception.
const MOST: usize = 1000;
/// Nor is more than one in so many messages.
const SHARE: u64 = 100;

/// The earliest log times of a recording.
#[derive(Clone, Default)]
pub(super) struct Early(BinaryHeap<u64>);

impl Early {
    /// Takes in a log time.
    #[inline]
    pub fn see(&mut self, time: u64) {
        if self.0.len() <= MOST {
            self.0.push(time);
        } else if self.0.peek().is_some_and(|&most| time < most) {
            self.0.pop();
            self.0.push(time);
        }
    }

    /// How many of so many messages lie further before the rest than the rest lasts, to its `end`, and where the rest begins; `None` where none do.
    pub fn before(&self, messages: u64, end: Option<u64>) -> Option<(u64, u64)> {
        let (mut times, end) = (self.0.clone().into_vec(), end?);
        times.sort_unstable();
        let few = |early: &usize| *early as u64 * SHARE <= messages;
        let counts = (1..times.len()).take_while(few);
        let early = counts
            .filter(|&early| apart(times[early - 1], times[early], end))
            .last()?;
        Some((early as u64, times[early]))
    }
}

/// Whether one time lies further before the next than that before the end.
fn apart(time: u64, next: u64, end: u64) -> bool {
    next.saturating_sub(time) > end.saturating_sub(next)
}

/// Whether there may be some, as far as the times tell at which chunks begin and end; those of messages outside chunks are unknown. Where a chunk holds one and
/// others, it spans half of the whole recording and more, as few chunks do in order.
pub(super) fn may_be(data: &[u8], blocks: &[Block], start: Option<u64>, end: Option<u64>) -> bool {
    let (Some(start), Some(end)) = (start, end) else {
        return false;
    };
    let header = |block: &Block| match block {
        Block::Chunk { body, .. } => chunk_header(&data[body.clone()]),
        Block::CutChunk(_) | Block::Loose(_) => None,
    };
    let half = (end - start.min(end)) / 2;
    let (mut begin, mut wide) = (Vec::new(), false);
    for chunk in blocks.iter().filter_map(header) {
        begin.push(chunk.start_time);
        wide |= chunk.end_time.saturating_sub(chunk.start_time) > half;
    }
    begin.sort_unstable();
    let alone = |pair: &[u64]| apart(pair[0], pair[1], end);
    wide || begin.first() != Some(&start) || begin.windows(2).take(begin.len() / 2).any(alone)
}

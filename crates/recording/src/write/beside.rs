//! Messages on their way to a thread that compresses and writes them.

use std::{
    mem,
    panic::resume_unwind,
    sync::mpsc::{Receiver, SyncSender, channel, sync_channel},
    thread::{Builder, JoinHandle},
};

use mcap::{McapResult, records::MessageHeader};

use super::container::Container;

/// A batch with so many bytes, or so many messages, goes on its way.
const BATCH_BYTES: usize = 32 << 10;
const BATCH_MESSAGES: usize = 1024;
/// So much log time, ns, a batch keeps back from the file at most.
const BATCH_NS: u64 = 1_000_000_000;
/// So many batches wait for the thread before the caller does; with a few the two take turns, often on one processor, while another is idle.
const WAITING: usize = 64;

/// Messages one after the other.
#[derive(Default)]
pub struct Batch {
    pub bytes: Vec<u8>,
    /// Each with where its bytes end.
    headers: Vec<(MessageHeader, usize)>,
}

impl Batch {
    /// Where the bytes of the next message begin.
    pub fn end(&self) -> usize {
        self.headers.last().map_or(0, |(_, end)| *end)
    }

    /// What has been appended since the last message is one.
    pub fn close(&mut self, header: MessageHeader) {
        self.headers.push((header, self.bytes.len()));
    }

    pub fn is_full(&self) -> bool {
        let spans_ns = match &self.headers[..] {
            [first, .., last] => last.0.log_time.saturating_sub(first.0.log_time),
            _ => 0,
        };
        self.bytes.len() >= BATCH_BYTES
            || self.headers.len() >= BATCH_MESSAGES
            || spans_ns >= BATCH_NS
    }

    /// Writes all messages; nothing is left here, whatever comes of it.
    pub fn write(&mut self, to: &mut Container) -> McapResult<()> {
        let mut begin = 0;
        let outcome = self.headers.iter().try_for_each(|(header, end)| {
            let data = &self.bytes[mem::replace(&mut begin, *end)..*end];
            to.message(header, data)
        });
        self.headers.clear();
        self.bytes.clear();
        outcome
    }
}

/// The container, and what became of writing to it.
type Written = (Box<Container>, McapResult<()>);

/// The thread, with the container in its hands.
pub struct Beside {
    /// `None` once nothing more will come.
    to: Option<SyncSender<Batch>>,
    /// Batches that have been written, to be filled again.
    back: Receiver<Batch>,
    /// `None` once it has ended.
    thread: Option<JoinHandle<Option<Written>>>,
}

impl Beside {
    /// Starts it, or gives the container back where the system has no thread to give.
    pub fn start(container: Box<Container>) -> Result<Self, Box<Container>> {
        let (give, given) = sync_channel::<Box<Container>>(1);
        let (to, taken) = sync_channel::<Batch>(WAITING);
        let (emptied, back) = channel();
        let work = move || {
            let mut container = given.recv().ok()?;
            let outcome = taken.iter().try_for_each(|mut batch| {
                let outcome = batch.write(&mut container);
                // Nobody may want it any more.
                let _ = emptied.send(batch);
                outcome
            });
            Some((container, outcome))
        };
        let Ok(thread) = Builder::new().name("recording".into()).spawn(work) else {
            return Err(container);
        };
        give.send(container).map_err(|unsent| unsent.0)?;
        Ok(Self {
            to: Some(to),
            back,
            thread: Some(thread),
        })
    }

    /// Hands a batch over and leaves an empty one in its place; `false` if the thread takes no more: [`Self::end`] says why.
    pub fn take(&self, batch: &mut Batch) -> bool {
        let empty = self.back.try_recv().unwrap_or_default();
        let full = mem::replace(batch, empty);
        self.to.as_ref().is_some_and(|to| to.send(full).is_ok())
    }

    /// Waits until everything is written.
    pub fn end(mut self) -> Written {
        self.to = None;
        let thread = self.thread.take().expect("it ends once");
        let written = thread.join().unwrap_or_else(|panic| resume_unwind(panic));
        written.expect("it was given a container")
    }
}

impl Drop for Beside {
    /// Whoever lets a recording go unfinished goes on when its temporary file is gone.
    fn drop(&mut self) {
        self.to = None;
        if let Some(thread) = self.thread.take() {
            // A panic there has been told of there.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a batch of so many messages of so many bytes, so far apart, goes on its way.
    fn full(messages: u64, bytes: usize, step_ns: u64) -> bool {
        let mut batch = Batch::default();
        for i in 0..messages {
            batch.bytes.extend(vec![7; bytes]);
            batch.close(MessageHeader {
                channel_id: 0,
                sequence: 0,
                log_time: i * step_ns,
                publish_time: 0,
            });
        }
        batch.is_full()
    }

    #[test]
    fn a_batch_is_full_by_bytes_by_messages_and_by_log_time() {
        assert!(!full(1, (32 << 10) - 1, 0) && full(1, 32 << 10, 0));
        assert!(!full(1023, 0, 0) && full(1024, 0, 0));
        assert!(!full(2, 0, 999_999_999) && full(2, 0, 1_000_000_000));
    }
}

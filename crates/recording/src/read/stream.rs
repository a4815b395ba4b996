//! The stream of batches: threads unpack and decode blocks, the caller's thread takes them in the order of the file.

use std::{
    collections::BTreeMap,
    sync::{Condvar, Mutex, MutexGuard, PoisonError},
};

use super::{
    ReadError, Recording,
    block::{BlockResult, Worker},
    container::Block,
    rows::Selection,
    taker::{Batch, Taker},
};
use crate::Finding;

/// How far blocks may be ahead of the one that is taken: the bound on memory.
#[derive(Clone, Copy)]
struct Window {
    threads: usize,
}

/// While what is ready holds no more than this, further blocks are begun, so that threads seldom have to wait for each other (bytes).
const READY_BYTES: usize = 16 << 20;

impl Window {
    /// Whether a block may be begun.
    fn is_open(self, progress: &Progress, blocks: usize) -> bool {
        let ahead = progress.next - progress.taken;
        let most = match progress.ready_bytes {
            0..READY_BYTES => 8 * self.threads + 1,
            _ => 2 * self.threads + 1,
        };
        progress.next < blocks && ahead < most
    }
}

/// The blocks in work: who has taken which, and what is ready.
struct Progress {
    next: usize,
    taken: usize,
    ready: BTreeMap<usize, BlockResult>,
    ready_bytes: usize,
    /// Results whose memory can be used again.
    spent: Vec<BlockResult>,
    stop: bool,
}

impl Progress {
    fn put(&mut self, position: usize, result: BlockResult) {
        self.ready_bytes += result.bytes();
        self.ready.insert(position, result);
    }
}

struct Shared {
    progress: Mutex<Progress>,
    changed: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Progress> {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Stops the helpers when the caller's thread leaves, in whatever way.
struct StopOnDrop<'a>(&'a Shared);

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        self.0.lock().stop = true;
        self.0.changed.notify_all();
    }
}

pub(super) fn run(
    recording: &Recording,
    select: Selection<'_>,
    sink: &mut dyn FnMut(&Batch<'_>),
) -> Result<Vec<Finding>, ReadError> {
    let blocks = &recording.container.blocks;
    let threads = match recording.options.threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        threads => threads,
    }
    .min(blocks.len().max(1));
    let window = Window { threads };
    let shared = Shared {
        progress: Mutex::new(Progress {
            next: 0,
            taken: 0,
            ready: BTreeMap::new(),
            ready_bytes: 0,
            spent: Vec::new(),
            stop: false,
        }),
        changed: Condvar::new(),
    };
    let mut taker = Taker::new(recording);
    std::thread::scope(|scope| {
        let _stop = StopOnDrop(&shared);
        for _ in 1..threads {
            scope.spawn(|| help(&shared, Worker::new(recording, select), blocks, window));
        }
        let mut worker = Worker::new(recording, select);
        for (position, block) in blocks.iter().enumerate() {
            let mut result = wait_for(position, &shared, &mut worker, blocks, window);
            if result.large {
                worker.large(block, &mut |mut result| taker.take(&mut result, sink));
            } else {
                taker.take(&mut result, sink);
            }
            recording.data.forget(block.range());
            let mut progress = shared.lock();
            progress.taken = position + 1;
            progress.spent.push(result);
            drop(progress);
            shared.changed.notify_all();
        }
    });
    Ok(taker.findings())
}

/// A helper's life: take the next block, decode it, put it down.
fn help(shared: &Shared, mut worker: Worker<'_>, blocks: &[Block], window: Window) {
    loop {
        let (position, spent) = {
            let mut progress = shared.lock();
            loop {
                if progress.stop || progress.next >= blocks.len() {
                    return;
                }
                if window.is_open(&progress, blocks.len()) {
                    break;
                }
                progress = shared
                    .changed
                    .wait(progress)
                    .unwrap_or_else(PoisonError::into_inner);
            }
            progress.next += 1;
            (progress.next - 1, progress.spent.pop())
        };
        spent.into_iter().for_each(|spent| worker.reuse(spent));
        let result = worker.block(&blocks[position]);
        shared.lock().put(position, result);
        shared.changed.notify_all();
    }
}

/// The caller's thread needs block `position`; while another thread works on it, this one helps with those that follow.
fn wait_for(
    position: usize,
    shared: &Shared,
    worker: &mut Worker<'_>,
    blocks: &[Block],
    window: Window,
) -> BlockResult {
    let mut progress = shared.lock();
    loop {
        if let Some(result) = progress.ready.remove(&position) {
            progress.ready_bytes -= result.bytes();
            return result;
        }
        if window.is_open(&progress, blocks.len()) {
            let mine = progress.next;
            progress.next += 1;
            let spent = progress.spent.pop();
            drop(progress);
            spent.into_iter().for_each(|spent| worker.reuse(spent));
            let result = worker.block(&blocks[mine]);
            if mine == position {
                return result;
            }
            progress = shared.lock();
            progress.put(mine, result);
        } else {
            progress = shared
                .changed
                .wait(progress)
                .unwrap_or_else(PoisonError::into_inner);
        }
    }
}

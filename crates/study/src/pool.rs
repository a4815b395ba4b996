//! Work shared out to threads, results handed back in order.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, mpsc};

/// How far threads may run ahead of a slow run, in runs per thread: what bounds the memory.
const AHEAD: u64 = 256;

/// How many threads `jobs` stands for: 0 is one for each core.
pub fn threads(jobs: usize) -> usize {
    match jobs {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        n => n,
    }
}

/// Calls `work` for 0 … `count` − 1 on `jobs` threads (0: one per core) and `take` with the results, in order, on this thread.
///
/// When `stop` is set no more work is begun and what is not yet in order is dropped. The first error of `take` ends it too.
///
/// # Errors
/// Those of `take`.
pub fn in_order<T: Send, E>(
    count: u64,
    jobs: usize,
    stop: &AtomicBool,
    work: impl Fn(u64) -> T + Sync,
    mut take: impl FnMut(u64, T) -> Result<(), E>,
) -> Result<(), E> {
    let next = AtomicU64::new(0);
    let over = AtomicBool::new(false);
    let taken = Mutex::new(0u64);
    let moved = Condvar::new();
    let jobs = threads(jobs)
        .min(usize::try_from(count).unwrap_or(usize::MAX))
        .max(1);
    let window = AHEAD * jobs as u64;
    let ended = || over.load(Ordering::Relaxed) || stop.load(Ordering::Relaxed);
    std::thread::scope(|scope| {
        let (sender, receiver) = mpsc::channel();
        for _ in 0..jobs {
            let sender = sender.clone();
            let (next, taken, moved, work, ended) = (&next, &taken, &moved, &work, &ended);
            scope.spawn(move || {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= count {
                        break;
                    }
                    // A poisoned lock only says that another thread is gone already.
                    let mut so_far = taken.lock().unwrap_or_else(|e| e.into_inner());
                    while index >= *so_far + window && !ended() {
                        so_far = moved
                            .wait_timeout(so_far, std::time::Duration::from_millis(100))
                            .map_or_else(|e| e.into_inner().0, |(guard, _)| guard);
                    }
                    drop(so_far);
                    if ended() || sender.send((index, work(index))).is_err() {
                        break;
                    }
                }
            });
        }
        drop(sender);
        let mut early = BTreeMap::new();
        let mut wanted = 0;
        for (index, result) in receiver {
            early.insert(index, result);
            while let Some(result) = early.remove(&wanted) {
                if let Err(error) = take(wanted, result) {
                    over.store(true, Ordering::Relaxed);
                    moved.notify_all();
                    return Err(error);
                }
                wanted += 1;
                *taken.lock().unwrap_or_else(|e| e.into_inner()) = wanted;
                moved.notify_all();
            }
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    #[test]
    fn results_come_in_order_whatever_the_threads() {
        for jobs in [1, 2, 7] {
            let mut seen = Vec::new();
            let stop = AtomicBool::new(false);
            in_order::<_, Infallible>(
                3000,
                jobs,
                &stop,
                |i| {
                    if i % 97 == 0 {
                        std::thread::sleep(std::time::Duration::from_micros(300));
                    }
                    i * i
                },
                |i, x| {
                    seen.push((i, x));
                    Ok(())
                },
            )
            .unwrap();
            assert!(
                seen.iter()
                    .enumerate()
                    .all(|(k, (i, x))| *i == k as u64 && *x == i * i)
            );
            assert_eq!(seen.len(), 3000);
        }
    }

    #[test]
    fn a_stop_and_an_error_end_it() {
        let stop = AtomicBool::new(false);
        let mut seen = 0;
        let ended = in_order(
            100_000,
            2,
            &stop,
            |i| i,
            |i, _| {
                seen += 1;
                if i == 10 { Err("full") } else { Ok(()) }
            },
        );
        assert_eq!((ended, seen), (Err("full"), 11));
        let mut seen = 0;
        in_order::<_, Infallible>(
            100_000,
            2,
            &stop,
            |i| i,
            |i, _| {
                seen += 1;
                if i == 10 {
                    stop.store(true, Ordering::Relaxed);
                }
                Ok(())
            },
        )
        .unwrap();
        assert!((11..100_000).contains(&seen), "{seen}");
    }
}

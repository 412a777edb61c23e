//! Work on groups of arms, shared among threads.

use std::sync::{Mutex, PoisonError};
use std::thread;

/// Does `work` on each of the groups, on `threads` threads, this one included. Each thread takes the next group, so the threads
/// end together also if some groups take longer.
pub(crate) fn share<T, I>(threads: usize, groups: I, work: impl Fn(T) + Sync)
where
    T: Send,
    I: Iterator<Item = T> + Send,
{
    let groups = Mutex::new(groups);
    let next = || groups.lock().unwrap_or_else(PoisonError::into_inner).next();
    let run = || {
        while let Some(group) = next() {
            work(group);
        }
    };
    thread::scope(|scope| {
        for _ in 1..threads {
            // If a thread cannot be started, the others do its work.
            let _ = thread::Builder::new().spawn_scoped(scope, run);
        }
        run();
    });
}

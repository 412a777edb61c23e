//! A copy of the bytes on the host line.

use alloc::boxed::Box;
use core::fmt::Debug;

use protocol_core::time::{Duration, Instant};

/// Receives a copy of the bytes on the host line.
pub trait Tap: Debug + Send {
    /// The line starts, or starts again. `gap` is the idle time after which the arm looks for frames inside an unfinished one
    /// (D4).
    fn restart(&mut self, gap: Duration);
    /// The arm received these bytes from the host. No bytes: the host's line is idle at `now`.
    fn received(&mut self, now: Instant, bytes: &[u8]);
    /// The arm sent these bytes to the host.
    fn sent(&mut self, now: Instant, bytes: &[u8]);
}

/// An optional observer of an arm. A clone is empty, so a copy of the arm has no observer.
#[derive(Debug)]
pub(crate) struct Watcher<T: ?Sized>(Option<Box<T>>);

impl<T: ?Sized> Watcher<T> {
    pub(crate) const fn holding(watcher: Box<T>) -> Self {
        Self(Some(watcher))
    }

    pub(crate) const fn is_empty(&self) -> bool {
        self.0.is_none()
    }

    pub(crate) fn get(&mut self) -> Option<&mut T> {
        self.0.as_deref_mut()
    }
}

impl<T: ?Sized> Default for Watcher<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T: ?Sized> Clone for Watcher<T> {
    fn clone(&self) -> Self {
        Self::default()
    }
}

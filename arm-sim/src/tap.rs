//! A copy of the bytes on the host line.

use alloc::boxed::Box;
use core::fmt::Debug;

use protocol_core::time::{Duration, Instant};

/// Gets a copy of the bytes on the host line.
pub trait Tap: Debug + Send {
    /// The line starts, or starts again. `gap` is the idle time by which the arm separates frames (D4).
    fn restart(&mut self, gap: Duration);
    /// The arm received these bytes from the host. No bytes: the host's line is idle at `now`.
    fn received(&mut self, now: Instant, bytes: &[u8]);
    /// The arm sent these bytes to the host.
    fn sent(&mut self, now: Instant, bytes: &[u8]);
}

/// A place for a tap. A copy of an arm has no tap.
#[derive(Debug, Default)]
pub(crate) struct TapSlot(Option<Box<dyn Tap>>);

impl TapSlot {
    pub(crate) fn holding(tap: impl Tap + 'static) -> Self {
        Self(Some(Box::new(tap)))
    }

    pub(crate) fn get(&mut self) -> Option<&mut (dyn Tap + 'static)> {
        self.0.as_deref_mut()
    }
}

impl Clone for TapSlot {
    fn clone(&self) -> Self {
        Self::default()
    }
}

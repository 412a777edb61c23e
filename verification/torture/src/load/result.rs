use std::fmt::{self, Display};
use std::time::Duration;

use super::memory::Memory;
use super::round_trips::RoundTrips;

/// The counts and times of a load, and the memory of the other end. It prints itself as text.
#[derive(Debug, Default)]
pub struct LoadResult {
    pub(super) reads: u64,
    pub(super) writes: u64,
    pub(super) replies: u64,
    pub(super) reports: u64,
    pub(super) lost: u64,
    /// Replies that match no pending read.
    pub(super) unexpected: u64,
    pub(super) corrupted: u64,
    pub(super) bytes: u64,
    /// The largest number of request bytes without a reply yet, and of bytes in the replies that are still expected.
    pub(super) max_pending: (u64, u64),
    pub(super) round_trips: RoundTrips,
    pub(super) memory: Memory,
    pub(super) elapsed: Duration,
}

impl LoadResult {
    /// True if every reply arrived, in order and without corruption.
    #[must_use]
    pub const fn is_clean(&self) -> bool {
        self.lost == 0 && self.unexpected == 0 && self.corrupted == 0
    }
}

impl Display for LoadResult {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = self.elapsed.as_secs_f64().max(1e-9);
        #[allow(clippy::cast_precision_loss)] // Shown with two decimals.
        let rate = |count: u64| count as f64 / seconds;
        writeln!(out, "time                        {seconds:.0} s")?;
        writeln!(out, "reads, writes               {}, {}", self.reads, self.writes)?;
        writeln!(out, "replies                     {} ({:.0}/s)", self.replies, rate(self.replies))?;
        writeln!(out, "reports                     {} ({:.2}/s)", self.reports, rate(self.reports))?;
        writeln!(out, "bytes from the arm          {} ({:.0}/s)", self.bytes, rate(self.bytes))?;
        writeln!(out, "lost replies                {}", self.lost)?;
        writeln!(out, "replies without a read      {}", self.unexpected)?;
        writeln!(out, "corrupted frames            {}", self.corrupted)?;
        let (requests, replies) = self.max_pending;
        writeln!(out, "most pending bytes          {requests} of requests, {replies} of replies")?;
        writeln!(out, "round trip                  {}", self.round_trips)?;
        write!(out, "memory of the other end     {}", self.memory)
    }
}

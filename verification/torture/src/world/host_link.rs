//! The two directions of the host link: arrival times and free space. Does not know frames.

use std::collections::VecDeque;

use protocol_core::time::{Duration, Instant};

/// Nanoseconds per byte at one baud: ten bits.
const TEN_BITS_NS: u64 = 10_000_000_000;

fn time_of(bytes: usize, baud: u32) -> Duration {
    let nanos = (bytes as u64).saturating_mul(TEN_BITS_NS).checked_div(u64::from(baud)).unwrap_or(0);
    Duration::from_micros(nanos.div_ceil(1_000))
}

/// The direction from the host to the arm. Bytes wait while the arm has no room for them.
#[derive(Debug)]
pub(super) struct HostToArm {
    baud: u32,
    free_at: Instant,
    in_transit: VecDeque<(Instant, Vec<u8>)>,
    waiting: VecDeque<u8>,
    last_taken_at: Instant,
}

impl HostToArm {
    pub(super) const fn new(baud: u32) -> Self {
        Self {
            baud,
            free_at: Instant::ZERO,
            in_transit: VecDeque::new(),
            waiting: VecDeque::new(),
            last_taken_at: Instant::ZERO,
        }
    }

    /// Transmits bytes after a pause. Returns the arrival time of the last byte.
    pub(super) fn send(&mut self, now: Instant, pause: Duration, bytes: &[u8]) -> Instant {
        self.free_at = self.free_at.max(now) + pause;
        // Bytes arrive in batches of a millisecond, so that the simulation has fewer events.
        let batch = usize::try_from(self.baud / 10_000).unwrap_or(1).max(1);
        for part in bytes.chunks(batch) {
            self.free_at = self.free_at + time_of(part.len(), self.baud);
            self.in_transit.push_back((self.free_at, part.to_vec()));
        }
        self.free_at
    }

    /// The time at which the line is free.
    pub(super) const fn free_at(&self) -> Instant {
        self.free_at
    }

    pub(super) fn next_arrival(&self) -> Option<Instant> {
        self.in_transit.front().map(|(at, _)| *at)
    }

    pub(super) fn arrive(&mut self, now: Instant) {
        while self.in_transit.front().is_some_and(|(at, _)| *at <= now) {
            self.in_transit.pop_front().into_iter().for_each(|(_, bytes)| self.waiting.extend(bytes));
        }
    }

    /// The bytes that wait for room in the arm, or the first part of them.
    pub(super) fn waiting(&self) -> &[u8] {
        self.waiting.as_slices().0
    }

    pub(super) fn take(&mut self, now: Instant, count: usize) {
        self.waiting.drain(..count);
        self.last_taken_at = now;
    }

    /// The last time at which the arm took bytes. The arm measures silence from this time on.
    pub(super) const fn last_taken_at(&self) -> Instant {
        self.last_taken_at
    }
}

/// The direction from the arm to the host: a transmit buffer that drains at the baud rate.
#[derive(Debug)]
pub(super) struct ArmToHost {
    baud: u32,
    level: usize,
    /// The time at which `level` was computed.
    now: Instant,
    /// The host does not read before this time.
    blocked_until: Instant,
}

impl ArmToHost {
    /// Room for two of the longest frames, in bytes.
    const CAPACITY: usize = 524;

    pub(super) const fn new(baud: u32, now: Instant) -> Self {
        Self { baud, level: 0, now, blocked_until: Instant::ZERO }
    }

    pub(super) fn block(&mut self, until: Instant) {
        self.blocked_until = self.blocked_until.max(until);
    }

    pub(super) fn push(&mut self, count: usize) {
        self.level += count;
    }

    pub(super) fn room(&mut self, now: Instant) -> usize {
        if self.level == 0 {
            self.now = now;
            return Self::CAPACITY;
        }
        let since = self.now.max(self.blocked_until.min(now));
        let byte = time_of(1, self.baud).as_micros().max(1);
        let sent = usize::try_from((now - since).as_micros() / byte).unwrap_or(usize::MAX);
        if sent >= self.level {
            (self.level, self.now) = (0, now);
        } else {
            self.level -= sent;
            self.now = since + Duration::from_micros(sent as u64 * byte);
        }
        Self::CAPACITY.saturating_sub(self.level)
    }

    /// The time at which there is room for the longest frame.
    pub(super) fn room_at(&self, now: Instant) -> Instant {
        let excess = self.level.saturating_sub(Self::CAPACITY / 2);
        let byte = time_of(1, self.baud).as_micros().max(1);
        self.now.max(self.blocked_until).max(now) + Duration::from_micros(excess as u64 * byte)
    }
}

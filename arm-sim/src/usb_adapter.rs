//! A simulated USB adapter between the servo bus and a computer. It delays the bytes from the servos to the computer.
//!
//! ```text
//!   byte from the wire ──▶ block ──▶ the computer, when the block is full or its latency timer ends
//! ```
//!
//! The same seed gives the same delays. This module does not interpret the bytes.

use alloc::vec::Vec;
use core::str::FromStr;

use protocol_core::time::{Duration, Instant};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// An FTDI chip sends a block at once when it has this many bytes: a packet of 64 bytes less two bytes of status.
const BLOCK: usize = 62;
/// The longest possible setting, in milliseconds.
const LONGEST_MS: u64 = 1_000;

/// The latency of an adapter: each block gets a random delay within these bounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Latency {
    shortest: Duration,
    longest: Duration,
}

/// The text is not a latency.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("use milliseconds from 0 to {LONGEST_MS}: one number as 16, or two bounds as 1-20")]
pub struct UnknownLatency;

/// `16` means 16 ms for each block, `1-20` a random delay from 1 to 20 ms.
impl FromStr for Latency {
    type Err = UnknownLatency;

    fn from_str(text: &str) -> Result<Self, UnknownLatency> {
        let (shortest, longest) = text.split_once('-').unwrap_or((text, text));
        let millis =
            |text: &str| text.parse().ok().filter(|&millis| millis <= LONGEST_MS).ok_or(UnknownLatency);
        let (shortest, longest) = (millis(shortest)?, millis(longest)?);
        if shortest > longest {
            return Err(UnknownLatency);
        }
        Ok(Self { shortest: Duration::from_millis(shortest), longest: Duration::from_millis(longest) })
    }
}

/// The direction from the adapter to the computer.
#[derive(Clone, Debug)]
pub struct UsbAdapter {
    latency: Latency,
    random: SplitMix64,
    block: Vec<u8>,
    /// When the block is sent, unless it is full earlier.
    due: Instant,
}

impl UsbAdapter {
    /// An adapter with an empty buffer.
    #[must_use]
    pub fn new(latency: Latency, seed: u64) -> Self {
        Self { latency, random: SplitMix64::seed_from_u64(seed), block: Vec::new(), due: Instant::ZERO }
    }

    /// Drops the bytes that wait in the buffer.
    pub fn clear(&mut self) {
        self.block.clear();
    }

    /// Takes bytes that the servos have sent by `now`.
    pub fn push(&mut self, now: Instant, bytes: &[u8]) {
        if self.block.is_empty() && !bytes.is_empty() {
            self.due = now + self.delay();
        }
        self.block.extend_from_slice(bytes);
    }

    /// The bytes that the computer receives at `now`: the whole block, or none.
    #[must_use]
    pub fn take(&mut self, now: Instant) -> Vec<u8> {
        let is_due = now >= self.due || self.block.len() >= BLOCK;
        if is_due { core::mem::take(&mut self.block) } else { Vec::new() }
    }

    /// When the block is sent, unless it is full earlier; `None` if it is empty.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        (!self.block.is_empty()).then_some(self.due)
    }

    fn delay(&mut self) -> Duration {
        let (shortest, longest) = (self.latency.shortest.as_micros(), self.latency.longest.as_micros());
        // The bias of the remainder is negligible: the bounds are far below 2^64.
        Duration::from_micros(shortest + self.random.next_u64() % (longest - shortest + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    #[test]
    fn a_latency_is_one_number_or_two_bounds() {
        assert_eq!("0".parse(), Ok(Latency::default()));
        let bounds = Latency { shortest: Duration::from_millis(1), longest: Duration::from_millis(20) };
        assert_eq!("1-20".parse(), Ok(bounds));
        for wrong in ["", "-", "-1", "20-1", "1-", "x", "1001", "1-2-3"] {
            assert_eq!(wrong.parse::<Latency>(), Err(UnknownLatency), "{wrong}");
        }
    }

    #[test]
    fn a_block_is_sent_when_its_latency_has_passed() {
        let mut adapter = UsbAdapter::new("16".parse().unwrap(), 1);
        assert_eq!(adapter.deadline(), None);
        adapter.push(at(1_000), b"");
        assert_eq!(adapter.deadline(), None);
        adapter.push(at(1_000), b"ab");
        adapter.push(at(9_000), b"c");
        assert_eq!(adapter.deadline(), Some(at(17_000)));
        assert_eq!(adapter.take(at(16_999)), b"");
        assert_eq!(adapter.take(at(17_000)), b"abc");
        assert_eq!(adapter.take(at(99_000)), b"");
    }

    #[test]
    fn a_full_block_is_sent_at_once() {
        let mut adapter = UsbAdapter::new("16".parse().unwrap(), 1);
        adapter.push(at(0), &[7; BLOCK - 1]);
        assert_eq!(adapter.take(at(1)), b"");
        adapter.push(at(1), &[7]);
        assert_eq!(adapter.take(at(1)), [7; BLOCK]);
    }

    #[test]
    fn delays_are_within_their_bounds_and_the_same_for_the_same_seed() {
        let delays = |seed| {
            let mut adapter = UsbAdapter::new("1-20".parse().unwrap(), seed);
            let delays: Vec<u64> = (0..1_000).map(|_| adapter.delay().as_micros()).collect();
            delays
        };
        assert!(delays(1).iter().all(|delay| (1_000..=20_000).contains(delay)));
        assert!(
            delays(1).iter().any(|&delay| delay < 2_000) && delays(1).iter().any(|&delay| delay > 19_000)
        );
        assert_eq!(delays(5), delays(5));
        assert_ne!(delays(5), delays(6));
    }
}

//! A simulated USB adapter between the servo bus and a computer: when bytes of the servos reach the computer.
//!
//! ```text
//!   byte from the wire ──▶ block ──▶ the computer, when the block is full or its first byte is old enough
//! ```
//!
//! A USB adapter does not hand over bytes one by one. It gathers them until its latency timer ends or its buffer is
//! full. Knows no clock and nothing of frames. The same seed gives the same delays.

use std::str::FromStr;

use protocol_core::time::{Duration, Instant};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// An FTDI chip sends a block at once when it holds so many bytes: a packet of 64 less two bytes of status.
const BLOCK: usize = 62;
/// The longest delay that can be chosen, in milliseconds.
const LONGEST_MS: u64 = 1_000;

/// How long the adapter keeps the first byte of a block: each time another delay within these bounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Latency {
    shortest: Duration,
    longest: Duration,
}

/// A latency that cannot be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("use milliseconds from 0 to {LONGEST_MS}: one number as 16, or two bounds as 1-20")]
pub struct NoLatency;

/// `16` is always 16 ms, `1-20` is anything from 1 to 20 ms.
impl FromStr for Latency {
    type Err = NoLatency;

    fn from_str(text: &str) -> Result<Self, NoLatency> {
        let (shortest, longest) = text.split_once('-').unwrap_or((text, text));
        let millis = |text: &str| text.parse().ok().filter(|&millis| millis <= LONGEST_MS).ok_or(NoLatency);
        let (shortest, longest) = (millis(shortest)?, millis(longest)?);
        if shortest > longest {
            return Err(NoLatency);
        }
        Ok(Self { shortest: Duration::from_millis(shortest), longest: Duration::from_millis(longest) })
    }
}

/// An adapter's direction towards the computer.
#[derive(Clone, Debug)]
pub struct Adapter {
    latency: Latency,
    random: SplitMix64,
    block: Vec<u8>,
    /// When the block is handed over, if it is not full before.
    due: Instant,
}

impl Adapter {
    /// An adapter with an empty buffer.
    #[must_use]
    pub fn new(latency: Latency, seed: u64) -> Self {
        Self { latency, random: SplitMix64::seed_from_u64(seed), block: Vec::new(), due: Instant::ZERO }
    }

    /// Takes bytes that the servos have sent by `now`.
    pub fn push(&mut self, now: Instant, bytes: &[u8]) {
        if self.block.is_empty() && !bytes.is_empty() {
            self.due = now + self.delay();
        }
        self.block.extend_from_slice(bytes);
    }

    /// Hands over what the computer receives by `now`: everything in the buffer, or nothing.
    #[must_use]
    pub fn take(&mut self, now: Instant) -> Vec<u8> {
        let is_due = now >= self.due || self.block.len() >= BLOCK;
        if is_due { std::mem::take(&mut self.block) } else { Vec::new() }
    }

    /// When the block will be handed over; `None` while it is empty.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        (!self.block.is_empty()).then_some(self.due)
    }

    fn delay(&mut self) -> Duration {
        let (shortest, longest) = (self.latency.shortest.as_micros(), self.latency.longest.as_micros());
        // The remainder is even enough: the bounds are far below 2^64.
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
            assert_eq!(wrong.parse::<Latency>(), Err(NoLatency), "{wrong}");
        }
    }

    #[test]
    fn bytes_come_in_one_block_when_the_first_is_old_enough() {
        let mut adapter = Adapter::new("16".parse().unwrap(), 1);
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
    fn a_full_block_does_not_wait() {
        let mut adapter = Adapter::new("16".parse().unwrap(), 1);
        adapter.push(at(0), &[7; BLOCK - 1]);
        assert_eq!(adapter.take(at(1)), b"");
        adapter.push(at(1), &[7]);
        assert_eq!(adapter.take(at(1)), [7; BLOCK]);
    }

    #[test]
    fn delays_stay_within_their_bounds_and_come_again_with_the_same_seed() {
        let delays = |seed| {
            let mut adapter = Adapter::new("1-20".parse().unwrap(), seed);
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

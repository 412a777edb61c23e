//! One direction of the host line: its timing, and faults that lose, damage or delay bytes.
//!
//! ```text
//!   push ──▶ loss, corruption ──▶ [ delayed ] ──▶ Pacer ──▶ arrived, take
//! ```
//!
//! The same seed and the same bytes give the same faults.

use alloc::collections::VecDeque;
use core::fmt::{self, Display, Formatter};
use core::str::FromStr;

use protocol_core::time::{Duration, Instant};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use crate::fault_count::FaultCount;
use crate::pace::{CAPACITY, Pacer};

/// A share of 100 %, in millionths.
const MILLION: u32 = 1_000_000;
/// The longest delay of a byte, in milliseconds.
const LONGEST_DELAY_MS: u64 = 10_000;

/// A fault of the host line, in both directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum LineFault {
    /// This share of the bytes is lost, in millionths.
    Loss(u32),
    /// One bit is wrong in this share of the bytes, in millionths.
    Corruption(u32),
    /// Each byte arrives this much later.
    Delay(Duration),
}

/// The word is not a fault of the host line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "use line=loss=PERCENT or line=corruption=PERCENT, as line=loss=0.5%, or line=delay=MILLISECONDS with 1 to 10000"
)]
pub struct UnknownLineFault;

impl FromStr for LineFault {
    type Err = UnknownLineFault;

    fn from_str(word: &str) -> Result<Self, UnknownLineFault> {
        let fault = match word.split_once('=') {
            Some(("loss", share)) => millionths(share).map(Self::Loss),
            Some(("corruption", share)) => millionths(share).map(Self::Corruption),
            Some(("delay", millis)) => {
                let millis = millis.parse().ok().filter(|millis| (1..=LONGEST_DELAY_MS).contains(millis));
                millis.map(|millis| Self::Delay(Duration::from_millis(millis)))
            }
            _ => None,
        };
        fault.ok_or(UnknownLineFault)
    }
}

/// Parses percent with at most four decimals, above 0 and up to 100.
fn millionths(text: &str) -> Option<u32> {
    let text = text.strip_suffix('%').unwrap_or(text);
    let (whole, decimals) = text.split_once('.').unwrap_or((text, "0"));
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|digit| digit.is_ascii_digit());
    if !is_number(whole) || !is_number(decimals) || decimals.len() > 4 {
        return None;
    }
    let scale = 10_u32.pow(4 - u32::try_from(decimals.len()).ok()?);
    let share = whole.parse::<u32>().ok()?.checked_mul(10_000)? + decimals.parse::<u32>().ok()? * scale;
    (1..=MILLION).contains(&share).then_some(share)
}

impl Display for LineFault {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        let percent = |millionths: u32| (millionths / 10_000, millionths % 10_000);
        let (name, (whole, decimals)) = match self {
            Self::Delay(delay) => return write!(out, "delay={}", delay.as_micros() / 1_000),
            Self::Loss(share) => ("loss", percent(*share)),
            Self::Corruption(share) => ("corruption", percent(*share)),
        };
        match decimals {
            0 => write!(out, "{name}={whole}%"),
            _ if decimals % 1_000 == 0 => write!(out, "{name}={whole}.{}%", decimals / 1_000),
            _ => write!(out, "{name}={whole}.{decimals:04}%"),
        }
    }
}

/// A fault that hits a random share of the bytes.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct RandomFault {
    millionths: u32,
    random: SplitMix64,
    count: FaultCount,
}

impl RandomFault {
    fn new(seed: u64) -> Self {
        Self { millionths: 0, random: SplitMix64::seed_from_u64(seed), count: FaultCount::default() }
    }

    fn set(&mut self, millionths: u32) {
        self.millionths = millionths;
        self.count = FaultCount::default();
    }

    /// Decides whether the fault hits the next byte. Returns a random number if so.
    fn hits(&mut self) -> Option<u64> {
        if self.millionths == 0 {
            return None;
        }
        let hit = self.random.next_u64();
        let is_hit = hit % u64::from(MILLION) < u64::from(self.millionths);
        self.count.count(is_hit);
        is_hit.then(|| self.random.next_u64())
    }
}

/// One direction of the host line.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct LineDirection {
    pacer: Pacer,
    loss: RandomFault,
    corruption: RandomFault,
    delay: Duration,
    delay_count: FaultCount,
    /// Each byte has its own deadline.
    is_bytewise: bool,
    /// Delayed bytes, and the times at which they enter the pacer.
    delayed: VecDeque<(Instant, u8)>,
}

impl LineDirection {
    /// An idle line whose faults are drawn from `seed`.
    pub(crate) fn new(seed: u64) -> Self {
        Self {
            pacer: Pacer::new(None),
            loss: RandomFault::new(seed),
            corruption: RandomFault::new(!seed),
            delay: Duration::ZERO,
            delay_count: FaultCount::default(),
            is_bytewise: false,
            delayed: VecDeque::new(),
        }
    }

    /// The two directions of a host line, to the arm and to the host.
    pub(crate) fn pair(seed: u64) -> (Self, Self) {
        (Self::new(seed), Self::new(seed.rotate_left(32)))
    }

    /// Drops all bytes. `baud` is as in [`Pacer::new`]. The faults stay.
    pub(crate) fn clear(&mut self, baud: Option<u32>) {
        self.pacer = Pacer::new(baud);
        self.delayed.clear();
        if self.is_bytewise {
            self.pacer.set_bytewise();
        }
    }

    /// Gives each byte its own deadline, as [`Pacer::set_bytewise`] does.
    pub(crate) const fn set_bytewise(&mut self) {
        self.is_bytewise = true;
        self.pacer.set_bytewise();
    }

    /// Begins a fault. Its count begins at 0.
    pub(crate) fn set_fault(&mut self, fault: LineFault) {
        match fault {
            LineFault::Loss(share) => self.loss.set(share),
            LineFault::Corruption(share) => self.corruption.set(share),
            LineFault::Delay(delay) => {
                self.delay = delay;
                self.delay_count = FaultCount::default();
            }
        }
    }

    /// Ends a fault of this kind.
    pub(crate) fn end_fault(&mut self, fault: LineFault) {
        self.set_fault(match fault {
            LineFault::Loss(_) => LineFault::Loss(0),
            LineFault::Corruption(_) => LineFault::Corruption(0),
            LineFault::Delay(_) => LineFault::Delay(Duration::ZERO),
        });
    }

    /// How many bytes a fault of this kind hit.
    pub(crate) const fn fault_count(&self, fault: LineFault) -> FaultCount {
        match fault {
            LineFault::Loss(_) => self.loss.count,
            LineFault::Corruption(_) => self.corruption.count,
            LineFault::Delay(_) => self.delay_count,
        }
    }

    /// Number of bytes that the line accepts.
    pub(crate) fn room(&self) -> usize {
        CAPACITY.saturating_sub(self.len())
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of bytes, delayed, in transit or arrived.
    pub(crate) fn len(&self) -> usize {
        self.pacer.len() + self.delayed.len()
    }

    /// Is a byte delayed or in transit?
    pub(crate) fn is_in_transit(&self) -> bool {
        !self.delayed.is_empty() || self.pacer.in_transit() > 0
    }

    /// Starts to send bytes at `now`. Returns how many were accepted; faults act on these.
    pub(crate) fn push(&mut self, now: Instant, bytes: &[u8]) -> usize {
        let taken = bytes.get(..self.room()).unwrap_or(bytes);
        if !self.has_fault() {
            return self.pacer.push(now, taken);
        }
        for &byte in taken {
            if self.loss.hits().is_some() {
                continue;
            }
            let damage = self.corruption.hits().map_or(0, |random| 1_u8 << (random % 8));
            if self.delay > Duration::ZERO {
                self.delay_count.count(true);
            }
            // A byte never overtakes an earlier one.
            let last = self.delayed.back().map_or(now, |&(due, _)| due);
            self.delayed.push_back(((now + self.delay).max(last), byte ^ damage));
        }
        self.advance(now);
        taken.len()
    }

    fn has_fault(&self) -> bool {
        self.loss.millionths > 0
            || self.corruption.millionths > 0
            || self.delay > Duration::ZERO
            || !self.delayed.is_empty()
    }

    /// Advances the bytes on the line up to `now`. Inlined, because most calls find an idle line.
    #[inline]
    pub(crate) fn advance(&mut self, now: Instant) {
        if self.is_in_transit() {
            self.move_on(now);
        }
    }

    fn move_on(&mut self, now: Instant) {
        while let Some(&(due, byte)) = self.delayed.front().filter(|(due, _)| *due <= now) {
            self.pacer.push(due, &[byte]);
            self.delayed.pop_front();
        }
        self.pacer.advance(now);
    }

    /// The first bytes that have arrived, possibly not all of them.
    pub(crate) fn arrived(&self) -> &[u8] {
        self.pacer.arrived()
    }

    /// Removes the first `count` of the bytes that have arrived.
    pub(crate) fn take(&mut self, count: usize) {
        self.pacer.take(count);
    }

    /// When the next bytes arrive or end their delay; `None` if none are on the way.
    pub(crate) fn deadline(&self) -> Option<Instant> {
        let arrival = self.pacer.deadline();
        let Some(&(due, _)) = self.delayed.front() else { return arrival };
        Some(arrival.map_or(due, |arrival| arrival.min(due)))
    }
}

#[cfg(test)]
mod tests;

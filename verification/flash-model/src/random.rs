//! Pseudo-random numbers, the same on every machine. Not for cryptography.

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// A sequence of numbers that depends only on its seed.
#[derive(Clone, Debug)]
pub struct Random(SplitMix64);

impl Random {
    /// Begins the sequence of `seed`, which may be any number.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(SplitMix64::seed_from_u64(seed))
    }

    /// The next 64 bits. All other methods take theirs from it.
    #[expect(clippy::should_implement_trait, reason = "the sequence has no end")]
    pub fn next(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// The low half of the next 64 bits.
    pub fn word(&mut self) -> u32 {
        let [a, b, c, d, ..] = self.next().to_le_bytes();
        u32::from_le_bytes([a, b, c, d])
    }

    /// The high byte of the next 64 bits.
    pub fn byte(&mut self) -> u8 {
        let [byte, ..] = self.next().to_be_bytes();
        byte
    }

    /// A number below `limit`; 0 if `limit` is 0. Nearly uniform for limits far below 2^64.
    pub fn below(&mut self, limit: u64) -> u64 {
        self.next().checked_rem(limit).unwrap_or(0)
    }

    /// An index below `limit`; 0 if `limit` is 0.
    pub fn index(&mut self, limit: usize) -> usize {
        usize::try_from(self.below(limit as u64)).unwrap_or(0)
    }

    /// One of the set bits of `bits`; 0 if no bit is set.
    pub fn one_of(&mut self, bits: u32) -> u32 {
        let mut rest = bits;
        for _ in 0..self.below(u64::from(bits.count_ones())) {
            rest &= rest.wrapping_sub(1);
        }
        rest & rest.wrapping_neg()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_gives_the_sequence_of_the_reference_implementation() {
        // From https://prng.di.unimi.it/splitmix64.c. The recorded seeds of its users rely on this sequence.
        let mut random = Random::new(1_234_567);
        assert_eq!(random.next(), 6_457_827_717_110_365_317);
        assert_eq!(random.next(), 3_203_168_211_198_807_973);
    }

    #[test]
    fn one_of_returns_each_set_bit_and_no_other() {
        let mut random = Random::new(1);
        let mut seen = 0;
        for _ in 0..500 {
            let bit = random.one_of(0x8001_0110);
            assert_eq!(bit.count_ones(), 1);
            seen |= bit;
        }
        assert_eq!(seen, 0x8001_0110);
        assert_eq!(random.one_of(0), 0);
    }
}

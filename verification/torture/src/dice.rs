//! Chance, from a seed: the same on every machine.

use flash_model::Random;
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::time::Duration;

/// What a world's chance comes from.
#[derive(Clone, Debug)]
pub struct Dice(Random);

impl Dice {
    /// The dice of this seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(Random::new(seed))
    }

    /// Any number.
    pub fn any(&mut self) -> u64 {
        self.0.next()
    }

    /// Any byte.
    pub fn byte(&mut self) -> u8 {
        self.0.byte()
    }

    /// A number from 0 to below `limit`, as a place or a count.
    pub fn below(&mut self, limit: usize) -> usize {
        self.0.index(limit)
    }

    /// A byte from 0 to `most`.
    pub fn up_to(&mut self, most: u8) -> u8 {
        u8::try_from(self.0.below(u64::from(most) + 1)).unwrap_or(0)
    }

    /// True so many times in a million.
    pub fn in_a_million(&mut self, times: u64) -> bool {
        self.0.below(1_000_000) < times
    }

    /// True one time in so many.
    pub fn one_in(&mut self, many: u64) -> bool {
        self.0.below(many) == 0
    }

    /// A time between two.
    pub fn between(&mut self, shortest: Duration, longest: Duration) -> Duration {
        let (low, high) = (shortest.as_micros(), longest.as_micros());
        Duration::from_micros(low + self.0.below(high.saturating_sub(low) + 1))
    }

    /// A time of any order of magnitude between two: short ones as often as long ones.
    pub fn any_scale(&mut self, shortest: Duration, longest: Duration) -> Duration {
        let mut limit = longest;
        while limit > shortest && self.one_in(2) {
            limit = Duration::from_micros(limit.as_micros() / 3);
        }
        self.between(shortest, limit.max(shortest))
    }

    /// A time until something that happens once in `mean`, on average.
    pub fn wait(&mut self, mean: Duration) -> Duration {
        self.between(Duration::from_micros(1), Duration::from_micros(mean.as_micros() * 2))
    }

    /// One of several.
    pub fn one_of<T: Copy>(&mut self, choices: &[T], otherwise: T) -> T {
        let place = self.below(choices.len());
        choices.get(place).copied().unwrap_or(otherwise)
    }

    /// Any joint.
    pub fn joint(&mut self) -> Joint {
        let index = self.below(JOINTS);
        Joint::ALL.get(index).copied().unwrap_or(Joint::ALL[0])
    }
}

//! Random numbers from a seed, the same on every machine.

use flash_model::Random;
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::time::Duration;

/// The random numbers of one world.
#[derive(Clone, Debug)]
pub struct SeededRng(Random);

impl SeededRng {
    /// Begins the sequence of this seed. The same seed gives the same numbers.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(Random::new(seed))
    }

    /// A number from the whole range.
    pub fn any(&mut self) -> u64 {
        self.0.next()
    }

    /// A byte from the whole range.
    pub fn byte(&mut self) -> u8 {
        self.0.byte()
    }

    /// A number below `limit`, as an index or a count; 0 if `limit` is 0.
    pub fn below(&mut self, limit: usize) -> usize {
        self.0.index(limit)
    }

    /// A byte from 0 to `most`.
    pub fn up_to(&mut self, most: u8) -> u8 {
        u8::try_from(self.0.below(u64::from(most) + 1)).unwrap_or(0)
    }

    /// True with a probability of `times` in a million.
    pub fn in_a_million(&mut self, times: u64) -> bool {
        self.0.below(1_000_000) < times
    }

    /// True with a probability of 1 in `many`.
    pub fn one_in(&mut self, many: u64) -> bool {
        self.0.below(many) == 0
    }

    /// A time from `shortest` to `longest`, all equally likely.
    pub fn between(&mut self, shortest: Duration, longest: Duration) -> Duration {
        let (low, high) = (shortest.as_micros(), longest.as_micros());
        Duration::from_micros(low + self.0.below(high.saturating_sub(low) + 1))
    }

    /// A time from `shortest` to `longest`, with more short times than [`Self::between`] gives: at least half of the times are at
    /// most a third of `longest`, at least a quarter at most a ninth, and so on down to `shortest`.
    pub fn any_scale(&mut self, shortest: Duration, longest: Duration) -> Duration {
        let mut limit = longest;
        while limit > shortest && self.one_in(2) {
            limit = Duration::from_micros(limit.as_micros() / 3);
        }
        self.between(shortest, limit.max(shortest))
    }

    /// The time until an event with this mean interval: at most twice the mean, all times equally likely.
    pub fn wait(&mut self, mean: Duration) -> Duration {
        self.between(Duration::from_micros(1), Duration::from_micros(mean.as_micros() * 2))
    }

    /// One of the choices; `otherwise` if there are none.
    pub fn one_of<T: Copy>(&mut self, choices: &[T], otherwise: T) -> T {
        let index = self.below(choices.len());
        choices.get(index).copied().unwrap_or(otherwise)
    }

    /// A joint. All are equally likely.
    pub fn joint(&mut self) -> Joint {
        let index = self.below(JOINTS);
        Joint::ALL.get(index).copied().unwrap_or(Joint::ALL[0])
    }
}

//! The servo bus behind the controller: simulated servos, or real ones.

use protocol_core::time::{Duration, Instant};

use crate::plant::Plant;

/// A servo bus as the controller uses it.
pub trait ServoBus {
    /// Is it there in real time? Then what was missed cannot be made up for.
    const IS_REAL: bool;

    /// How much later than on the wire an answer may arrive.
    fn answer_delay(&self) -> Duration;

    /// Takes bytes that the controller began to send at `now`.
    fn bytes(&mut self, now: Instant, bytes: &[u8]);

    /// Gives the bytes that are through to the controller by `now`.
    fn poll(&mut self, now: Instant) -> Vec<u8>;

    /// When bytes will be through to the controller; `None` if none are on their way, or nobody can know.
    fn deadline(&self) -> Option<Instant>;

    /// Power off and on, where that is possible.
    fn power_cycle(&mut self, now: Instant);
}

impl ServoBus for Plant {
    const IS_REAL: bool = false;

    fn answer_delay(&self) -> Duration {
        Duration::ZERO
    }

    fn bytes(&mut self, now: Instant, bytes: &[u8]) {
        Self::bytes(self, now, bytes);
    }

    fn poll(&mut self, now: Instant) -> Vec<u8> {
        Self::poll(self, now)
    }

    fn deadline(&self) -> Option<Instant> {
        Self::deadline(self)
    }

    fn power_cycle(&mut self, now: Instant) {
        Self::power_cycle(self, now);
    }
}

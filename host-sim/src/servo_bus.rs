//! What is behind the controller: simulated servos, or the end of a line to real ones.

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

/// The controller's end of a line to real servos. Whoever owns the port moves the bytes.
#[derive(Clone, Debug)]
pub struct BusLine {
    answer_delay: Duration,
    to_servos: Vec<u8>,
    from_servos: Vec<u8>,
}

impl BusLine {
    /// A line on which answers arrive at most so much later than on the wire.
    #[must_use]
    pub const fn new(answer_delay: Duration) -> Self {
        Self { answer_delay, to_servos: Vec::new(), from_servos: Vec::new() }
    }

    /// Takes bytes that arrived from the servos.
    pub fn push(&mut self, bytes: &[u8]) {
        self.from_servos.extend_from_slice(bytes);
    }

    /// Gives the bytes that are to go to the servos.
    pub fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.to_servos)
    }
}

impl ServoBus for BusLine {
    const IS_REAL: bool = true;

    fn answer_delay(&self) -> Duration {
        self.answer_delay
    }

    fn bytes(&mut self, _: Instant, bytes: &[u8]) {
        self.to_servos.extend_from_slice(bytes);
    }

    fn poll(&mut self, _: Instant) -> Vec<u8> {
        std::mem::take(&mut self.from_servos)
    }

    fn deadline(&self) -> Option<Instant> {
        None
    }

    /// Nobody here can switch off the supply of real servos.
    fn power_cycle(&mut self, _: Instant) {}
}

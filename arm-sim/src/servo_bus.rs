//! The servo bus behind the controller: simulated servos, or real ones.

use protocol_core::time::{Duration, Instant};

use crate::plant::Plant;

/// A servo bus from the side of the controller.
pub trait ServoBus {
    /// Do the servos run in real time? If so, a late caller cannot catch up.
    const IS_REAL: bool;

    /// The baud rate, in bits per second.
    fn baud(&self) -> u32;

    /// The longest delay of an answer between the wire and the controller; zero for simulated servos.
    fn answer_delay(&self) -> Duration;

    /// Takes bytes that the controller starts to send at `now`.
    fn bytes(&mut self, now: Instant, bytes: &[u8]);

    /// Returns the bytes that the controller has received by `now`.
    fn poll(&mut self, now: Instant) -> &[u8];

    /// When the next bytes arrive. `None` if no bytes are on the way, or if the time is unknown.
    fn deadline(&self) -> Option<Instant>;

    /// Switches the power of the servos off and on, if that is possible.
    fn power_cycle(&mut self, now: Instant);

    /// The simulated servos, to disturb them; `None` for real ones, or if the bus does not pass them on.
    fn plant_mut(&mut self) -> Option<&mut Plant> {
        None
    }
}

impl ServoBus for Plant {
    const IS_REAL: bool = false;

    fn baud(&self) -> u32 {
        Self::baud(self)
    }

    fn answer_delay(&self) -> Duration {
        Duration::ZERO
    }

    fn bytes(&mut self, now: Instant, bytes: &[u8]) {
        Self::bytes(self, now, bytes);
    }

    fn poll(&mut self, now: Instant) -> &[u8] {
        Self::poll(self, now)
    }

    fn deadline(&self) -> Option<Instant> {
        Self::deadline(self)
    }

    fn power_cycle(&mut self, now: Instant) {
        Self::power_cycle(self, now);
    }

    fn plant_mut(&mut self) -> Option<&mut Plant> {
        Some(self)
    }
}

//! The controller's end of a line to real servos.

use arm_sim::servo_bus::ServoBus;
use protocol_core::time::{Duration, Instant};

/// Holds the bytes of both directions until the owner of the port moves them.
#[derive(Clone, Debug)]
pub struct BusLine {
    baud: u32,
    answer_delay: Duration,
    to_servos: Vec<u8>,
    from_servos: Vec<u8>,
    /// The bytes that the last poll returned.
    polled: Vec<u8>,
}

impl BusLine {
    /// A line at `baud` bits per second. `answer_delay` is the longest delay of an answer between the wire and this computer.
    #[must_use]
    pub const fn new(baud: u32, answer_delay: Duration) -> Self {
        Self { baud, answer_delay, to_servos: Vec::new(), from_servos: Vec::new(), polled: Vec::new() }
    }

    /// Adds bytes that have arrived from the servos.
    pub fn push(&mut self, bytes: &[u8]) {
        self.from_servos.extend_from_slice(bytes);
    }

    /// Takes the bytes that the controller has sent to the servos.
    pub fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.to_servos)
    }
}

impl ServoBus for BusLine {
    const IS_REAL: bool = true;

    fn baud(&self) -> u32 {
        self.baud
    }

    fn answer_delay(&self) -> Duration {
        self.answer_delay
    }

    fn bytes(&mut self, _: Instant, bytes: &[u8]) {
        self.to_servos.extend_from_slice(bytes);
    }

    fn poll(&mut self, _: Instant) -> &[u8] {
        self.polled.clear();
        std::mem::swap(&mut self.polled, &mut self.from_servos);
        &self.polled
    }

    fn deadline(&self) -> Option<Instant> {
        None
    }

    /// Has no effect: the supply of real servos cannot be switched from here.
    fn power_cycle(&mut self, _: Instant) {}
}

//! The controller inside a simulated arm: this project's, or the maker's.

use core::fmt::Debug;

use motion_core::{Config, Controller, Output};
use protocol_core::registers::{Image, RegisterFile};
use protocol_core::settings::Storage;
use protocol_core::time::{Duration, Instant};

/// A controller without hardware: bytes in, bytes out, time as an argument. [`Controller`] describes the calls.
pub trait ArmController: Clone + Debug {
    /// A controller that is powered up at `now`, with the settings found in the storage.
    fn power_up(now: Instant, config: Config, stored: Option<&Image>, storage: Storage) -> Self;

    /// Sets the longest delay of a servo's answer between the wire and the controller, such as the delay of a USB adapter.
    fn set_answer_delay(&mut self, delay: Duration);

    /// Takes bytes from the host, and returns how many it took. An empty slice states that the host's line is silent.
    fn host_bytes(&mut self, now: Instant, bytes: &[u8]) -> usize;

    /// Takes all bytes that were received from the servo bus.
    fn servo_bytes(&mut self, now: Instant, bytes: &[u8]);

    /// The next action. Call it until it returns [`Output::Wait`].
    fn poll(&mut self, now: Instant, host_room: usize) -> Output<'_>;

    /// A poll can be delayed until this time without a difference for the host, unless bytes arrive earlier, or the maker's
    /// controller beeps or wakes up.
    fn host_deadline(&self) -> Instant;

    /// Sets the state of the storage, after an [`Output::Save`] and after every change.
    fn set_storage(&mut self, storage: Storage);

    /// The last client has closed the port (M12).
    fn host_left(&mut self, now: Instant);

    /// The baud rate of the host link, in bits per second.
    fn baud(&self) -> u32;

    /// The registers; `None` if the controller does not use this project's register file.
    fn registers(&self) -> Option<&RegisterFile> {
        None
    }
}

impl ArmController for Controller {
    fn power_up(now: Instant, config: Config, stored: Option<&Image>, storage: Storage) -> Self {
        Self::new(now, config, stored, storage)
    }

    fn set_answer_delay(&mut self, delay: Duration) {
        Self::set_answer_delay(self, delay);
    }

    fn host_bytes(&mut self, now: Instant, bytes: &[u8]) -> usize {
        Self::host_bytes(self, now, bytes)
    }

    fn servo_bytes(&mut self, now: Instant, bytes: &[u8]) {
        Self::servo_bytes(self, now, bytes);
    }

    fn poll(&mut self, now: Instant, host_room: usize) -> Output<'_> {
        Self::poll(self, now, host_room)
    }

    fn host_deadline(&self) -> Instant {
        Self::host_deadline(self)
    }

    fn set_storage(&mut self, storage: Storage) {
        Self::set_storage(self, storage);
    }

    fn host_left(&mut self, now: Instant) {
        Self::host_left(self, now);
    }

    fn baud(&self) -> u32 {
        Self::baud(self)
    }

    fn registers(&self) -> Option<&RegisterFile> {
        Some(Self::registers(self))
    }
}

//! Everything the arm is, less its hardware: bytes in, bytes out, time as an argument.
//!
//! ```text
//!   loop {
//!       controller.host_bytes(now, ...);       what came from the host; empty: its line is silent
//!       controller.servo_bytes(now, ...);      what came from the servo bus
//!       match controller.poll(now, room) {     until Wait: then sleep until then, or until bytes come
//!           Output::ToHost(bytes) => ...
//!           ...
//!       }
//!   }
//! ```

use protocol_core::registers::{Image, RegisterFile};
use protocol_core::time::{Duration, Instant};

/// What the controller wants done. Each is asked for once.
#[must_use]
#[derive(Debug, PartialEq, Eq)]
pub enum Output<'a> {
    /// Send these bytes to the host. Never more than the room that `poll` was told of.
    ToHost(&'a [u8]),
    /// Send these bytes on the servo bus. The bus is idle: one transaction is outstanding at most.
    ToServos(&'a [u8]),
    /// Switch the pump and the valve (D20).
    Vacuum(Vacuum),
    /// Store this image, then call [`Controller::storage`] with what became of it. Nothing the host asks
    /// afterwards is answered before.
    Save(Image),
    /// Nothing to do before this time, unless bytes come or the host link gets room.
    Wait(Instant),
}

/// The two outputs of the vacuum gripper.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Vacuum {
    /// The pump runs.
    pub pump: bool,
    /// The valve is open: air comes in and the cup lets go.
    pub valve: bool,
}

/// What the settings storage can still do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Storage {
    /// It takes another image.
    Ready,
    /// It is full until the next restart: writes that would change a setting are refused (D19).
    Full,
    /// It does not keep what it is given: settings live in RAM only.
    Broken,
}

/// What differs from board to board and from arm to arm, and what is known at start.
#[derive(Clone, Copy, Debug)]
pub struct Config {
    /// The chip id, most significant byte first (D8).
    pub chip_id: [u8; 6],
    /// Fault bits known at start: reset cause, clock (`protocol_core::registers::map::fault`).
    pub faults: u8,
    /// How long a servo may take to answer, from the last byte sent to the last byte received.
    pub servo_timeout: Duration,
    /// What the servos' torque switch (their register 40) means on this arm.
    pub torque_codes: TorqueCodes,
}

/// The two published meanings of servo register 40.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TorqueCodes {
    /// 0 damping, 1 on, 2 free: the older table, and the same as register 29 of the arm.
    #[default]
    DampingOnFree,
    /// 0 free, 1 on, 2 damping: Feetech's current table.
    FreeOnDamping,
}

/// The arm.
#[derive(Debug)]
pub struct Controller {
    registers: RegisterFile,
}

impl Controller {
    /// An arm that was powered up at `now`, with the settings found in storage and the state of that storage.
    #[must_use]
    pub fn new(now: Instant, config: Config, stored: Option<&Image>, storage: Storage) -> Self {
        let _ = (now, config.faults, storage);
        Self { registers: RegisterFile::new(config.chip_id, stored) }
    }

    /// Takes bytes from the host, and says how many; offer the rest again after the next `poll`. An empty
    /// slice says that the host's line is silent as of `now` and that nothing waits anywhere.
    pub fn host_bytes(&mut self, now: Instant, bytes: &[u8]) -> usize {
        let _ = now;
        bytes.len()
    }

    /// Takes bytes from the servo bus, all of them.
    pub fn servo_bytes(&mut self, now: Instant, bytes: &[u8]) {
        let _ = (now, bytes);
    }

    /// What is to be done at `now`; call it again and again until it says [`Output::Wait`]. `host_room` is
    /// how many bytes the host link takes at once at this moment. With less than the longest frame (262
    /// bytes) requests wait where they are: give the link at least that much.
    pub fn poll(&mut self, now: Instant, host_room: usize) -> Output<'_> {
        let _ = host_room;
        Output::Wait(now + Duration::from_millis(10))
    }

    /// Tells what became of the storage: after every [`Output::Save`], and whenever it changes.
    pub fn storage(&mut self, storage: Storage) {
        let _ = storage;
    }

    /// Raises fault bits (`protocol_core::registers::map::fault`) that only the shell can see.
    pub fn raise_faults(&mut self, bits: u8) {
        let _ = bits;
    }

    /// The baud rate of the host link in force since start, in bits per second: register 12 as it was stored.
    #[must_use]
    pub fn baud(&self) -> u32 {
        115_200
    }

    /// The registers, to look at.
    #[must_use]
    pub fn registers(&self) -> &RegisterFile {
        &self.registers
    }
}

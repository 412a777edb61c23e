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

use protocol_core::registers::map::{FRAMES_ACCEPTED, FRAMES_CORRUPTED, PRESENT_POSITION, refusal};
use protocol_core::registers::{Image, RegisterFile};
use protocol_core::request::{Reply, Request};
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::{Defect, Deframer, FrameBuffer, MAX_LENGTH, ToArm, deframer};

use crate::arm::Arm;
use crate::servo_bus::TorqueCodes;
use crate::vacuum::Vacuum;

/// What the controller wants done. Each is asked for once.
#[must_use]
#[derive(Debug, PartialEq, Eq)]
pub enum Output<'a> {
    /// Send these bytes to the host. Never more than the room that `poll` was told of.
    ToHost(&'a [u8]),
    /// Send these bytes on the servo bus. It is idle: one transaction is outstanding at most.
    ToServos(&'a [u8]),
    /// Switch the pump and the valve (D20).
    Vacuum(Vacuum),
    /// Store this image, then call [`Controller::set_storage`] with what became of it. Nothing the host asks
    /// afterwards is answered before.
    Save(Image),
    /// Nothing to do before this time, unless bytes come or the host link gets room.
    Wait(Instant),
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

/// The controller of one arm.
#[derive(Debug)]
pub struct Controller {
    deframer: Deframer<ToArm>,
    arm: Arm,
    to_host: FrameBuffer,
}

impl Controller {
    /// An arm that was powered up at `now`, with the settings found in storage and the state of that storage.
    #[must_use]
    pub fn new(now: Instant, config: Config, stored: Option<&Image>, storage: Storage) -> Self {
        let arm = Arm::new(now, config, stored, storage);
        Self { deframer: Deframer::new(deframer::gap(arm.baud())), arm, to_host: FrameBuffer::new() }
    }

    /// Takes bytes from the host, and says how many; offer the rest again after the next `poll`. An empty
    /// slice says that the host's line is silent as of `now` and that nothing waits anywhere.
    pub fn host_bytes(&mut self, now: Instant, bytes: &[u8]) -> usize {
        self.deframer.push(now, bytes)
    }

    /// How many bytes from the host may make a difference. With fewer, and nothing else to do, a shell may go on
    /// sleeping for a while: silence on the line begins to count when the bytes are handed over.
    #[must_use]
    pub fn host_bytes_wanted(&self) -> usize {
        self.deframer.wanted()
    }

    /// Takes bytes from the servo bus, all of them.
    pub fn servo_bytes(&mut self, bytes: &[u8]) {
        self.arm.bus.bytes(bytes);
    }

    /// What is to be done at `now`; call it again and again until it says [`Output::Wait`]. `host_room` is
    /// how many bytes the host link takes at once at this moment. With less than the longest frame (262
    /// bytes) requests wait where they are (D5): give the link at least that much.
    pub fn poll(&mut self, now: Instant, host_room: usize) -> Output<'_> {
        let has_room = host_room >= MAX_LENGTH;
        self.arm.advance(now);
        if self.arm.command_servos(now) {
            return Output::ToServos(self.arm.bus.frame());
        }
        if has_room && self.answer(now) {
            return Output::ToHost(&self.to_host);
        }
        if let Some(image) = self.arm.to_save.take() {
            return Output::Save(image);
        }
        if let Some(vacuum) = self.arm.gripper.poll(now) {
            return Output::Vacuum(vacuum);
        }
        // All requests are answered. A report that finds no room is skipped, not delayed (D14).
        if self.arm.feedback.strike(now) && has_room {
            self.reply_with(PRESENT_POSITION.address, PRESENT_POSITION.count);
            return Output::ToHost(&self.to_host);
        }
        Output::Wait(self.deadline(now, has_room))
    }

    /// Carries out requests until one has an answer, or something has to be saved before the next. Says
    /// whether there is an answer.
    fn answer(&mut self, now: Instant) -> bool {
        while self.arm.to_save.is_none()
            && let Some(frame) = self.deframer.pull()
        {
            match frame.map(Request::from_frame) {
                Ok(Request::Read { address, count }) => {
                    self.arm.registers.increment(&FRAMES_ACCEPTED);
                    self.reply_with(address, count);
                    return true;
                }
                Ok(Request::Write { address, values }) => self.arm.write(now, address, values),
                Err(Defect::MalformedRange { address }) => self.arm.refuse(refusal::MALFORMED_RANGE, address),
                Err(Defect::WrongCrc | Defect::NoFrame) => self.arm.registers.increment(&FRAMES_CORRUPTED),
            }
        }
        false
    }

    fn reply_with(&mut self, address: u8, count: u8) {
        let values = self.arm.registers.read(address, count);
        Reply { address, values }.encode(&mut self.to_host);
    }

    fn deadline(&self, now: Instant, has_room: bool) -> Instant {
        // While requests wait for room, silence behind them says nothing.
        let silence = self.deframer.deadline().filter(|_| has_room);
        self.arm.deadline(now).min(silence.unwrap_or(Instant::FAR_FUTURE))
    }

    /// When the host may hear something, or silence on its line may matter, unless bytes come before: until then
    /// nobody outside can tell whether `poll` was called, as long as it is called for each time in between.
    #[must_use]
    pub fn host_deadline(&self) -> Instant {
        self.arm.feedback.due().min(self.deframer.deadline().unwrap_or(Instant::FAR_FUTURE))
    }

    /// Tells what became of the storage: after every [`Output::Save`], and whenever it changes.
    pub fn set_storage(&mut self, storage: Storage) {
        self.arm.set_storage(storage);
    }

    /// Raises fault bits (`protocol_core::registers::map::fault`) that only the shell can see. They stay
    /// until the next restart.
    pub fn raise_faults(&mut self, bits: u8) {
        self.arm.raise_faults(bits);
    }

    /// The baud rate of the host link in force since start, in bits per second: register 12 as it was stored.
    #[must_use]
    pub const fn baud(&self) -> u32 {
        self.arm.baud()
    }

    /// The registers, to look at.
    #[must_use]
    pub const fn registers(&self) -> &RegisterFile {
        &self.arm.registers
    }
}

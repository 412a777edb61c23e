//! The controller of one arm, without hardware: bytes in, bytes out, time as an argument.
//!
//! ```text
//!   loop {
//!       controller.host_bytes(now, ...);       bytes from the host; empty: the line is silent
//!       controller.servo_bytes(now, ...);      bytes from the servo bus
//!       match controller.poll(now, room) {     repeat until Wait, then sleep until then or until bytes come
//!           Output::ToHost(bytes) => ...
//!           ...
//!       }
//!   }
//! ```

use protocol_core::registers::map::{BAUD_RATE, baud_rate};
use protocol_core::registers::{Image, JOINTS, Map, RegisterFile};
use protocol_core::settings::Storage;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::MIN_LENGTH;

use crate::arm_control::ArmControl;
use crate::config::Config;
use crate::host_port::{HostInput, HostPort};
use crate::vacuum::Vacuum;

/// An action for the shell. `poll` returns each action once.
#[must_use]
#[derive(Debug, PartialEq, Eq)]
pub enum Output<'a> {
    /// Send these bytes to the host. They fit the room that was passed to `poll`.
    ToHost(&'a [u8]),
    /// Send this frame on the servo bus. The bus is free: at most one read is outstanding.
    ToServos(&'a [u8]),
    /// Switch the pump and the valve ([D20](protocol_core::decisions#d20)).
    Vacuum(Vacuum),
    /// Store this image, then call [`Controller::set_storage`] with the result, before the next `poll`. So no later
    /// request is answered before the image is stored.
    Save(Image),
    /// There is nothing to do before this time, unless bytes come or the host link gets room.
    Wait(Instant),
}

/// The logic of one arm's controller. A shell passes bytes and time to it, and executes each [`Output`].
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Controller {
    host: HostPort,
    arm: ArmControl,
}

impl Controller {
    /// An arm that was powered up at `now`. `stored` holds the settings found in the storage.
    #[must_use]
    pub fn new(now: Instant, config: Config, stored: Option<&Image>, storage: Storage) -> Self {
        let arm = ArmControl::new(now, config, stored, storage);
        Self { host: HostPort::new(baud_rate(arm.registers.get(BAUD_RATE.address))), arm }
    }

    /// Takes bytes from the host, and returns how many. Offer the rest again after the next `poll`. An empty slice
    /// states that the host's line is silent at `now` and that no byte waits anywhere.
    pub fn host_bytes(&mut self, now: Instant, bytes: &[u8]) -> usize {
        self.host.bytes(now, bytes)
    }

    /// How many more bytes from the host are needed for a new event. A shell may keep sleeping until it has them or a
    /// deadline comes. Silence on the line counts from the call that takes the bytes.
    #[must_use]
    pub fn host_bytes_wanted(&self) -> usize {
        self.host.bytes_wanted()
    }

    /// Takes all bytes that were received from the servo bus by `now`.
    pub fn servo_bytes(&mut self, now: Instant, bytes: &[u8]) {
        self.arm.bus.servo_bytes(now, bytes);
    }

    /// A byte from the servo bus was received damaged by `now`: with a framing error, noise or a parity error. Call this after
    /// the bytes before that byte were taken. The answer that the byte belongs to fails.
    pub fn servo_byte_damaged(&mut self, now: Instant) {
        self.arm.bus.servo_byte_damaged(now);
    }

    /// A byte from the host was received damaged. Call this after the bytes before that byte were taken. No frame continues
    /// across it: complete frames before it are executed, an incomplete one is dropped.
    pub fn host_byte_damaged(&mut self) {
        self.host.byte_damaged();
    }

    /// The next action at `now`. Call it until it returns [`Output::Wait`]. `host_room` is how many bytes the host link can
    /// take at once now. A read whose reply does not fit waits, and every request behind it waits, too
    /// ([D5](protocol_core::decisions#d5)). An idle link must take the longest frame, 262 bytes.
    pub fn poll(&mut self, now: Instant, host_room: usize) -> Output<'_> {
        self.arm.take_answers(now);
        // Before the control cycle, so that its goals include new targets. A read that waits for room, a save and an alarm
        // delay the requests behind them.
        self.execute_requests(now, host_room);
        self.arm.advance(now);
        // The frame that results from an action of the watchdog is sent at once, if the bus is free.
        if self.arm.prepare_servo_frame(now)
            || (self.arm.watchdog_is_due && self.arm.poll_watchdog(now) && self.arm.prepare_servo_frame(now))
        {
            return Output::ToServos(self.arm.bus.frame());
        }
        if let Some(alarm) = self.arm.alarm.take() {
            return Output::ToHost(self.host.alarm(alarm));
        }
        if let Some(read) = self.host.take_read(host_room) {
            self.arm.heard_host(now);
            self.arm.count_accepted();
            if read.is_extended() {
                self.arm.show_extended();
            }
            return Output::ToHost(self.host.reply(read, &self.arm.registers));
        }
        if let Some(image) = self.arm.to_save.take() {
            return Output::Save(image);
        }
        if let Some(vacuum) = self.arm.vacuum.poll(now) {
            return Output::Vacuum(vacuum);
        }
        if let Some(report) = self.host.take_report(now, host_room) {
            if report.is_extended() {
                self.arm.show_extended();
            }
            return Output::ToHost(self.host.report(report, &self.arm.registers));
        }
        Output::Wait(self.arm.deadline(now).min(self.host.deadline()))
    }

    /// Executes requests up to the next read, or until settings have to be saved or an alarm has to be sent. An alarm that
    /// does not fit `host_room` is skipped.
    fn execute_requests(&mut self, now: Instant, host_room: usize) {
        while self.arm.to_save.is_none()
            && self.arm.alarm.is_none()
            && let Some(input) = self.host.next_input()
        {
            match input {
                HostInput::Write { map, address, values } => {
                    self.arm.heard_host(now);
                    let changes_reports = match map {
                        Map::V22 => self.arm.write(now, address, values),
                        Map::V21 => self.arm.write_map21(now, address, values, MIN_LENGTH <= host_room),
                    };
                    if changes_reports {
                        self.host.set_report_frequencies(now, &self.arm.registers);
                    }
                }
                HostInput::MalformedRange { address } => self.arm.refuse_range(address),
                HostInput::Corrupted => self.arm.count_corrupted(),
            }
        }
    }

    /// When the next report is due, or silence on the line has an effect. A `poll` that is late, but comes before this time,
    /// makes no difference to the host unless bytes came. A late shell still has to call `poll` for each deadline that it missed.
    #[must_use]
    pub fn host_deadline(&self) -> Instant {
        self.host.deadline()
    }

    /// The last host has closed the link: ends the reports, and forgets in which map the last write was
    /// ([M12](protocol_core::decisions#m12)).
    pub fn host_left(&mut self, now: Instant) {
        self.arm.forget_host();
        self.host.set_report_frequencies(now, &self.arm.registers);
    }

    /// Sets the state of the storage. Call it after every [`Output::Save`] and after every change.
    pub fn set_storage(&mut self, storage: Storage) {
        self.arm.set_storage(storage);
    }

    /// Raises fault bits (`protocol_core::registers::map::fault`) that only the shell can detect. They stay until the next
    /// restart.
    pub fn raise_faults(&mut self, bits: u8) {
        self.arm.raise_faults(bits);
    }

    /// Sets how long a USB adapter may buffer the answers of the servos; 0 at start. The delay is added to
    /// `Config::servo_timeout` and does not delay goals.
    pub fn set_answer_delay(&mut self, delay: Duration) {
        self.arm.bus.set_answer_delay(delay);
    }

    /// The longest answer time of each servo since the last call, in microseconds from the last byte of the read; 0 if the
    /// servo did not answer.
    pub const fn take_longest_answers(&mut self) -> [u16; JOINTS] {
        self.arm.bus.take_longest_answers()
    }

    /// The baud rate of the host link since start, in bits per second: register 12 as it was stored.
    #[must_use]
    pub const fn baud(&self) -> u32 {
        self.host.baud()
    }

    /// The registers. The values of the joints in the extended block and the protection block are updated only when they
    /// are sent to the host.
    #[must_use]
    pub const fn registers(&self) -> &RegisterFile {
        &self.arm.registers
    }
}

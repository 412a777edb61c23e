//! The registers of a simulated servo: executes the instructions of frames and encodes the answers.
//!
//! The goal registers control the motor, and the measurements of the motor are written into the registers. This module knows no
//! time: the caller decides when an answer is sent.

mod memory;

use memory::{COUNT, MAX_ID, RAM, factory_settings, is_writable};

use motion_core::servo_bus::frame::{
    self, BAUD_RATES, BROADCAST, Instruction, Reading, ServoFrame, ServoFrameBuffer, register,
};

use super::protection::Limits;

/// The bytes of registers 0 to 70, which frames read and write.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct ServoRegisters {
    #[cfg_attr(feature = "serde", serde(with = "serde_bytes"))]
    registers: [u8; COUNT],
    has_new_goal: bool,
    /// A frame wrote the torque switch since the servo's start.
    is_torque_written: bool,
}

/// A goal position with its time and speed: registers 42 to 47.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ServoGoal {
    /// The goal position, 0 to 1023.
    pub(super) position_counts: u16,
    /// The duration of the move, in milliseconds; ignored unless the speed is 0.
    pub(super) time_ms: u16,
    /// The speed, in counts per second; 0 is the motor's maximum.
    pub(super) speed: u16,
}

impl ServoRegisters {
    /// A servo after its first power-up: the EEPROM holds Feetech's factory settings; torque switch, goal and
    /// measurements are 0.
    pub(super) fn new(id: u8) -> Self {
        Self { registers: factory_settings(id), has_new_goal: false, is_torque_written: false }
    }

    /// Switches power off and on: the EEPROM keeps its values, the RAM is as after [`ServoRegisters::new`].
    pub(super) fn power_cycle(&mut self) {
        let fresh = factory_settings(self.id());
        for (slot, byte) in self.registers.iter_mut().zip(fresh).skip(usize::from(RAM)) {
            *slot = byte;
        }
        self.has_new_goal = false;
        self.is_torque_written = false;
    }

    pub(super) fn id(&self) -> u8 {
        let [id] = self.field(register::ID);
        id
    }

    /// The baud rate in bits per second. An invalid code counts as code 0, 1 Mbaud.
    pub(super) fn baud(&self) -> u32 {
        let [code] = self.field(register::BAUD_RATE);
        BAUD_RATES.get(usize::from(code)).copied().unwrap_or(1_000_000)
    }

    /// Is a frame for this servo, or for all servos?
    pub(super) fn is_addressed_by(&self, frame: &ServoFrame<'_>) -> bool {
        frame.id == self.id() || frame.id == BROADCAST
    }

    /// Executes a frame that is addressed to this servo, and returns the answer if there is one.
    ///
    /// A write is acknowledged if register 8 is not 0. A broadcast, an unknown instruction and a range beyond register 70
    /// have no answer. The acknowledgement of a write that changes the id carries the new id; Feetech's tables do not
    /// say whether a real servo sends the old or the new one.
    pub(super) fn handle_frame(&mut self, frame: &ServoFrame<'_>) -> Option<ServoFrameBuffer> {
        let is_addressed = frame.id == self.id();
        if !is_addressed && frame.id != BROADCAST {
            return None;
        }
        let answer = self.execute(frame)?;
        is_addressed.then_some(answer)
    }

    /// Executes an instruction, and returns the answer if there is one.
    fn execute(&mut self, frame: &ServoFrame<'_>) -> Option<ServoFrameBuffer> {
        match (Instruction::from_code(frame.code)?, frame.params) {
            (Instruction::Ping, []) => Some(self.answer(&[])),
            (Instruction::Read, &[register, count]) => Some(self.answer(self.read(register, count)?)),
            (Instruction::Write, [first, data @ ..]) => {
                self.write(*first, data)?;
                (self.field(register::RESPONSE_LEVEL) != [0]).then(|| self.answer(&[]))
            }
            (Instruction::SyncWrite, [register, width, items @ ..]) => {
                self.execute_item(*register, *width, items);
                None
            }
            _ => None,
        }
    }

    fn answer(&self, values: &[u8]) -> ServoFrameBuffer {
        let mut answer = ServoFrameBuffer::new();
        frame::status(&mut answer, self.id(), self.errors(), values);
        answer
    }

    fn read(&self, register: u8, count: u8) -> Option<&[u8]> {
        let start = usize::from(register);
        self.registers.get(start..start + usize::from(count))
    }

    /// Writes registers. Returns `None` and writes nothing if the range ends beyond the registers. Registers that a
    /// master cannot write keep their values.
    fn write(&mut self, register: u8, data: &[u8]) -> Option<()> {
        let start = usize::from(register);
        let written = start..start + data.len();
        let is_locked = self.field(register::LOCK) != [0];
        let slots = self.registers.get_mut(written.clone())?;
        // Most writes repeat the goal that the servo already holds.
        if slots != data {
            for ((slot, &byte), address) in slots.iter_mut().zip(data).zip(register..) {
                if is_writable(address, is_locked) && !(address == register::ID && byte > MAX_ID) {
                    *slot = byte;
                }
            }
        }
        let includes_any =
            |first: u8, end: u8| written.start < usize::from(end) && usize::from(first) < written.end;
        self.has_new_goal |= !data.is_empty() && includes_any(register::GOAL_POSITION, register::LOCK);
        self.is_torque_written |= written.contains(&usize::from(register::TORQUE_SWITCH));
        Some(())
    }

    /// Executes this servo's item of a sync write, if there is one.
    fn execute_item(&mut self, register: u8, width: u8, items: &[u8]) {
        if let Some(data) = self.item(width, items) {
            // A range beyond the registers has no effect, as in any write.
            let _ = self.write(register, data);
        }
    }

    /// The values for this servo in the items of a sync write.
    fn item<'a>(&self, width: u8, items: &'a [u8]) -> Option<&'a [u8]> {
        let id = self.id();
        let mut items = items.chunks_exact(usize::from(width) + 1).filter_map(<[u8]>::split_first);
        items.find(|(first, _)| **first == id).map(|(_, data)| data)
    }

    /// Do the registers already hold the values of a sync write? Such a frame can still start a move, if the motor has not
    /// started one to this goal.
    pub(super) fn holds(&self, frame: &ServoFrame<'_>) -> bool {
        match (Instruction::from_code(frame.code), frame.params) {
            (Some(Instruction::SyncWrite), [register, width, items @ ..]) => {
                self.item(*width, items).is_none_or(|data| self.read(*register, *width) == Some(data))
            }
            _ => false,
        }
    }

    /// The code in the torque switch. [`ServoConfig::torque_codes`](super::ServoConfig::torque_codes) defines its meaning.
    pub(super) fn torque_switch(&self) -> u8 {
        let [code] = self.field(register::TORQUE_SWITCH);
        code
    }

    /// Sets the code in the torque switch without a frame: [`ServoRegisters::is_torque_written`] does not change.
    pub(super) fn set_torque_switch(&mut self, code: u8) {
        self.set_field(register::TORQUE_SWITCH, [code]);
    }

    /// Did a frame write the torque switch since the servo's start?
    pub(super) const fn is_torque_written(&self) -> bool {
        self.is_torque_written
    }

    /// The goal, within the position limits of the EEPROM and 1023.
    pub(super) fn goal(&self) -> ServoGoal {
        let word = |register| u16::from_be_bytes(self.field(register));
        let (lowest, highest) = (word(register::MIN_POSITION), word(register::MAX_POSITION));
        ServoGoal {
            position_counts: word(register::GOAL_POSITION)
                .min(highest)
                .max(lowest)
                .min(Reading::MAX_POSITION),
            time_ms: word(register::GOAL_TIME),
            speed: word(register::GOAL_SPEED),
        }
    }

    /// The goal, if any part of it was written since the last call. A new goal starts a move, even to the same position.
    pub(super) fn take_new_goal(&mut self) -> Option<ServoGoal> {
        core::mem::take(&mut self.has_new_goal).then(|| self.goal())
    }

    /// The limits for alarms, in registers 13 to 15 and 19.
    pub(super) fn limits(&self) -> Limits {
        let [max_celsius, max_decivolts, min_decivolts] = self.field(register::MAX_TEMPERATURE);
        let [unloading] = self.field(register::UNLOAD_CONDITIONS);
        Limits { max_celsius, max_decivolts, min_decivolts, unloading }
    }

    /// Writes the measurements into the registers from the present position (56) on.
    pub(super) fn set_reading(&mut self, reading: &Reading) {
        self.set_field(register::PRESENT_POSITION, reading.to_bytes());
    }

    pub(super) fn set_moving(&mut self, moving: bool) {
        self.set_field(register::MOVING, [u8::from(moving)]);
    }

    /// Sets the error bits, see [`frame::error`]. They appear in a register and in every answer.
    pub(super) fn set_errors(&mut self, errors: u8) {
        self.set_field(register::STATUS, [errors]);
    }

    /// The error bits, see [`frame::error`].
    pub(super) fn errors(&self) -> u8 {
        let [errors] = self.field(register::STATUS);
        errors
    }

    fn field<const N: usize>(&self, register: u8) -> [u8; N] {
        let start = usize::from(register);
        self.registers.get(start..).and_then(<[u8]>::first_chunk).copied().unwrap_or([0; N])
    }

    fn set_field<const N: usize>(&mut self, register: u8, bytes: [u8; N]) {
        let start = usize::from(register);
        if let Some(field) = self.registers.get_mut(start..).and_then(<[u8]>::first_chunk_mut) {
            *field = bytes;
        }
    }
}

#[cfg(test)]
mod tests;

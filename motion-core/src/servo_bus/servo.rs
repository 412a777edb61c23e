//! The servo's end of the wire, for simulators: what a servo makes of a frame, and what it answers.
//!
//! Holds the servo's registers and nothing else: whatever turns the motor reads the goal here and writes
//! back what it measures. Knows no time, so neither does an answer: when it goes out is the caller's
//! business.

use super::frame::{self, BROADCAST, Frame, FrameBuffer, Instruction, Reading, register};

/// The first register kept here; those before it are the servo's own EEPROM, which nobody here reads.
const FIRST: u8 = register::TORQUE_SWITCH;
/// How many are kept: up to 70, the last of a read of 15 from the present position.
const COUNT: usize = 31;
/// How many of them a master can change: up to the lock. The others are measurements.
const WRITABLE: usize = (register::LOCK - FIRST) as usize + 1;
/// What of them makes up a goal.
const GOAL: core::ops::Range<usize> =
    (register::GOAL_POSITION - FIRST) as usize..(register::LOCK - FIRST) as usize;

/// A servo, as its master sees it.
#[derive(Clone, Debug)]
pub struct Servo {
    id: u8,
    registers: [u8; COUNT],
    has_new_goal: bool,
}

/// Where a servo is to go, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Goal {
    /// Where to, 0 to 1023.
    pub position_counts: u16,
    /// How long it is to take, in milliseconds; counts only where the speed is 0.
    pub time_ms: u16,
    /// How fast, in counts per second; 0 is as fast as the motor can.
    pub speed: u16,
}

impl Servo {
    /// The servo with this id after power-up: torque switch and goal are 0, nothing is measured yet.
    #[must_use]
    pub const fn new(id: u8) -> Self {
        Self { id, registers: [0; COUNT], has_new_goal: false }
    }

    /// Does what a frame from the master says, if it is for this servo, and gives the answer if it wants
    /// one. A frame to all is never answered; neither is an instruction that is unknown or a range that
    /// reaches outside the registers 40 to 70, which leaves the master to its time-out.
    pub fn hear(&mut self, frame: &Frame<'_>) -> Option<FrameBuffer> {
        let is_alone_addressed = frame.id == self.id;
        if !is_alone_addressed && frame.id != BROADCAST {
            return None;
        }
        let answer = self.obey(frame)?;
        is_alone_addressed.then_some(answer)
    }

    /// Carries out an instruction, and gives the answer if there is one.
    fn obey(&mut self, frame: &Frame<'_>) -> Option<FrameBuffer> {
        match (Instruction::from_code(frame.code)?, frame.params) {
            (Instruction::Ping, []) => Some(self.answer(&[])),
            (Instruction::Read, &[register, count]) => Some(self.answer(self.read(register, count)?)),
            (Instruction::Write, [register, data @ ..]) => {
                self.write(*register, data)?;
                Some(self.answer(&[]))
            }
            (Instruction::SyncWrite, [register, width, items @ ..]) => {
                self.take_share(*register, *width, items);
                None
            }
            _ => None,
        }
    }

    fn answer(&self, values: &[u8]) -> FrameBuffer {
        let mut answer = FrameBuffer::new();
        frame::status(&mut answer, self.id, self.errors(), values);
        answer
    }

    fn read(&self, register: u8, count: u8) -> Option<&[u8]> {
        let start = usize::from(register.checked_sub(FIRST)?);
        self.registers.get(start..start + usize::from(count))
    }

    /// `None` if the range reaches outside the registers; nothing is written then.
    fn write(&mut self, register: u8, data: &[u8]) -> Option<()> {
        let start = usize::from(register.checked_sub(FIRST)?);
        let end = start + data.len();
        if end > COUNT {
            return None;
        }
        for (slot, byte) in self.registers.iter_mut().take(WRITABLE).skip(start).zip(data) {
            *slot = *byte;
        }
        self.has_new_goal |= start < GOAL.end && end > GOAL.start;
        Some(())
    }

    /// Takes this servo's item out of a sync write, if there is one.
    fn take_share(&mut self, register: u8, width: u8, items: &[u8]) {
        let share = items.chunks_exact(usize::from(width) + 1).find(|item| item.first() == Some(&self.id));
        if let Some([_, data @ ..]) = share {
            // Outside the registers it has no effect, as with any write.
            let _ = self.write(register, data);
        }
    }

    /// The code in the torque switch; what it means is a setting of the arm.
    #[must_use]
    pub fn torque_switch(&self) -> u8 {
        let [code] = self.field(register::TORQUE_SWITCH);
        code
    }

    /// Where the servo is to go. A position past 1023 counts as 1023.
    #[must_use]
    pub fn goal(&self) -> Goal {
        let word = |register| u16::from_be_bytes(self.field(register));
        Goal {
            position_counts: word(register::GOAL_POSITION).min(Reading::MAX_POSITION),
            time_ms: word(register::GOAL_TIME),
            speed: word(register::GOAL_SPEED),
        }
    }

    /// The goal, if any part of it was written since the last call: a move begins, even to the same place.
    pub fn take_new_goal(&mut self) -> Option<Goal> {
        core::mem::take(&mut self.has_new_goal).then(|| self.goal())
    }

    /// Shows what the servo measures.
    pub fn set_reading(&mut self, reading: &Reading) {
        self.set_field(register::PRESENT_POSITION, reading.to_bytes());
    }

    /// Shows whether the servo moves.
    pub fn set_moving(&mut self, moving: bool) {
        self.set_field(register::MOVING, [u8::from(moving)]);
    }

    /// Shows what the servo complains about, bits of [`frame::error`]: in a register and in every answer.
    pub fn set_errors(&mut self, errors: u8) {
        self.set_field(register::STATUS, [errors]);
    }

    /// What the servo complains about, bits of [`frame::error`].
    #[must_use]
    pub fn errors(&self) -> u8 {
        let [errors] = self.field(register::STATUS);
        errors
    }

    fn field<const N: usize>(&self, register: u8) -> [u8; N] {
        let start = usize::from(register - FIRST);
        self.registers.get(start..).and_then(<[u8]>::first_chunk).copied().unwrap_or([0; N])
    }

    fn set_field<const N: usize>(&mut self, register: u8, bytes: [u8; N]) {
        let start = usize::from(register - FIRST);
        if let Some(field) = self.registers.get_mut(start..).and_then(<[u8]>::first_chunk_mut) {
            *field = bytes;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::servo_bus::frame::{error, ping, read, sync_write, write};

    const READING: Reading = Reading {
        position_counts: 511,
        speed: -300,
        load: 45,
        voltage_decivolts: 74,
        temperature_celsius: 31,
    };

    /// What the servo answers to a frame on the wire; empty: nothing.
    fn answer(servo: &mut Servo, encode: impl FnOnce(&mut FrameBuffer)) -> Vec<u8> {
        let (mut buffer, mut decoder) = (FrameBuffer::new(), frame::Decoder::new());
        encode(&mut buffer);
        decoder.push(&buffer);
        let heard = decoder.pull().unwrap().unwrap();
        servo.hear(&heard).map_or_else(Vec::new, |answer| answer.to_vec())
    }

    #[test]
    fn answers_byte_for_byte() {
        let mut servo = Servo::new(2);
        servo.set_reading(&READING);
        assert_eq!(answer(&mut servo, |b| ping(b, 2)), [0xFF, 0xFF, 2, 2, 0, 0xFB]);
        assert_eq!(answer(&mut servo, |b| write(b, 2, 40, &[1])), [0xFF, 0xFF, 2, 2, 0, 0xFB]);
        servo.set_errors(error::OVERLOAD);
        assert_eq!(
            answer(&mut servo, |b| read(b, 2, register::PRESENT_POSITION, 8)),
            [0xFF, 0xFF, 2, 10, 0x20, 0x01, 0xFF, 0x81, 0x2C, 0x00, 0x2D, 74, 31, 0x90]
        );
    }

    #[test]
    fn a_long_read_shows_status_and_moving_too() {
        let mut servo = Servo::new(0);
        servo.set_reading(&READING);
        servo.set_moving(true);
        servo.set_errors(error::OVERHEAT);
        let answer = answer(&mut servo, |b| read(b, 0, register::PRESENT_POSITION, 15));
        assert_eq!(answer[5..20], [1, 0xFF, 0x81, 0x2C, 0, 0x2D, 74, 31, 0, 4, 1, 0, 0, 0, 0]);
    }

    #[test]
    fn others_frames_are_not_heard() {
        let mut servo = Servo::new(2);
        assert!(answer(&mut servo, |b| ping(b, 3)).is_empty());
        assert!(answer(&mut servo, |b| write(b, 3, register::TORQUE_SWITCH, &[1])).is_empty());
        assert_eq!(servo.torque_switch(), 0);
    }

    #[test]
    fn a_frame_to_all_is_obeyed_and_not_answered() {
        let mut servo = Servo::new(2);
        assert!(answer(&mut servo, |b| ping(b, BROADCAST)).is_empty());
        assert!(answer(&mut servo, |b| read(b, BROADCAST, register::PRESENT_POSITION, 8)).is_empty());
        assert!(answer(&mut servo, |b| write(b, BROADCAST, register::TORQUE_SWITCH, &[1])).is_empty());
        assert_eq!(servo.torque_switch(), 1);
    }

    #[test]
    fn each_servo_takes_its_own_item_of_a_sync_write() {
        let goals = |b: &mut FrameBuffer| {
            let item = |id: u8| (id, [1, id, 0, 10 + id, 2, 20 + id]);
            sync_write(b, register::GOAL_POSITION, [4, 2, 6].map(item).into_iter());
        };
        let mut servo = Servo::new(2);
        assert!(answer(&mut servo, goals).is_empty());
        let goal = Goal { position_counts: 258, time_ms: 12, speed: 534 };
        assert_eq!(servo.goal(), goal);
        assert_eq!(servo.take_new_goal(), Some(goal));
        assert_eq!(servo.take_new_goal(), None, "one write, one move");
        let mut absent = Servo::new(3);
        answer(&mut absent, goals);
        assert_eq!(absent.take_new_goal(), None);
    }

    #[test]
    fn any_part_of_a_goal_makes_a_new_one_and_nothing_else_does() {
        let mut servo = Servo::new(0);
        for (register, starts) in [(40, false), (41, false), (42, true), (46, true), (47, true), (48, false)]
        {
            answer(&mut servo, |b| write(b, 0, register, &[0]));
            assert_eq!(servo.take_new_goal().is_some(), starts, "register {register}");
        }
        answer(&mut servo, |b| write(b, 0, register::GOAL_POSITION, &[0xFF, 0xFF]));
        assert_eq!(servo.goal().position_counts, 1023);
    }

    #[test]
    fn measurements_cannot_be_written() {
        let mut servo = Servo::new(0);
        servo.set_reading(&READING);
        assert!(!answer(&mut servo, |b| write(b, 0, 40, &[9; 31])).is_empty(), "acknowledged all the same");
        assert_eq!(answer(&mut servo, |b| read(b, 0, 48, 9))[5..14], [9, 0, 0, 0, 0, 0, 0, 0, 1]);
    }

    #[test]
    fn what_reaches_outside_the_registers_is_not_answered() {
        let mut servo = Servo::new(0);
        for (register, count) in [(0, 1), (39, 2), (70, 2), (71, 1), (255, 255)] {
            assert!(answer(&mut servo, |b| read(b, 0, register, count)).is_empty(), "{register}, {count}");
        }
        assert!(answer(&mut servo, |b| write(b, 0, 39, &[1, 1])).is_empty());
        assert!(answer(&mut servo, |b| write(b, 0, 40, &[1; 32])).is_empty());
        answer(&mut servo, |b| sync_write(b, 39, [(0, [1, 1])].into_iter()));
        assert_eq!(servo.torque_switch(), 0);
    }

    #[test]
    fn frames_of_a_wrong_shape_are_not_answered() {
        let mut servo = Servo::new(0);
        for (code, params) in
            [(1, [].as_slice()), (2, &[56]), (2, &[56, 8, 0]), (3, &[]), (0x83, &[40]), (9, &[])]
        {
            let is_answered = servo.hear(&Frame { id: 0, code, params }).is_some();
            assert_eq!(is_answered, code == 1, "instruction {code}, {params:?}");
        }
        servo.hear(&Frame { id: BROADCAST, code: 0x83, params: &[40, 1, 0] });
        servo.hear(&Frame { id: BROADCAST, code: 0x83, params: &[40, 255, 0, 1] });
        assert_eq!(servo.torque_switch(), 0, "an item that is cut short is none");
    }
}

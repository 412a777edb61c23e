//! The only frames that the self-test image sends to the servos, except in a crash: pings and reads. No constructor of
//! [`BusQuestion`] makes a write, so the image cannot switch torque on or send a goal.

use motion_core::servo_bus::frame::{self, Decoder, Reading, ServoFrameBuffer, register};

/// A ping or a read: a frame that changes nothing in a servo.
#[derive(Clone, Debug)]
pub struct BusQuestion {
    frame: ServoFrameBuffer,
    id: u8,
    /// Length of the answer's parameters, in bytes.
    length: u8,
}

/// The first of the ids that stand for absent servos. The servos of this arm have ids 0 to 6.
const FIRST_ABSENT_ID: u8 = 8;
/// How many ids there are from [`FIRST_ABSENT_ID`] to 253. 254 is the broadcast id.
const ABSENT_IDS: u16 = 246;

impl BusQuestion {
    /// A ping, whose answer has no parameters.
    #[must_use]
    pub fn ping(id: u8) -> Self {
        Self::new(id, 0, |frame| frame::ping(frame, id))
    }

    /// A read of position, speed, load, voltage and temperature: see [`Reading`].
    #[must_use]
    pub fn measure(id: u8) -> Self {
        Self::read(id, register::PRESENT_POSITION, Reading::REGISTERS)
    }

    /// A read of the torque switch.
    #[must_use]
    pub fn torque_switch(id: u8) -> Self {
        Self::read(id, register::TORQUE_SWITCH, 1)
    }

    /// A ping of an id that no servo has, so that only the echo comes back. `number` selects the id.
    #[must_use]
    pub fn to_absent_servo(number: u16) -> Self {
        let [id, _] = (number % ABSENT_IDS).to_le_bytes();
        Self::ping(FIRST_ABSENT_ID + id)
    }

    fn read(id: u8, register: u8, count: u8) -> Self {
        Self::new(id, count, |frame| frame::read(frame, id, register, count))
    }

    fn new(id: u8, length: u8, encode: impl FnOnce(&mut ServoFrameBuffer)) -> Self {
        let mut frame = ServoFrameBuffer::new();
        encode(&mut frame);
        Self { frame, id, length }
    }

    /// The bytes for the servo bus, from the header to the checksum.
    #[must_use]
    pub fn frame(&self) -> &[u8] {
        &self.frame
    }

    /// Finds the answer in the received bytes and returns its parameters; `None` without an answer. The echo may come first.
    #[must_use]
    pub fn answer(&self, received: &[u8]) -> Option<AnswerParams> {
        let mut decoder = Decoder::new();
        decoder.push(self.without_echo(received));
        while let Some(frame) = decoder.pull() {
            if let Ok(frame) = frame
                && frame.id == self.id
                && frame.params.len() == usize::from(self.length)
            {
                return AnswerParams::from_slice(frame.params).ok();
            }
        }
        None
    }

    /// Removes the echo. The echo of a ping would parse as an answer, because the two differ only in code and checksum.
    fn without_echo<'a>(&self, received: &'a [u8]) -> &'a [u8] {
        received.strip_prefix(self.frame.as_slice()).unwrap_or(received)
    }
}

/// The parameters of an answer.
pub type AnswerParams = heapless::Vec<u8, { Reading::REGISTERS as usize }>;

/// Counts of the echoes of frames without an answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct Echoes {
    /// The echo equals the frame.
    pub right: u16,
    /// The echo differs from the frame.
    pub wrong: u16,
    /// No byte came back.
    pub missing: u16,
}

impl Echoes {
    /// Compares the received bytes with the frame that was sent, and counts the result.
    pub fn count(&mut self, sent: &[u8], received: &[u8]) {
        match received {
            [] => self.missing += 1,
            received if received == sent => self.right += 1,
            _ => self.wrong += 1,
        }
    }

    /// How many frames were sent.
    #[must_use]
    pub const fn sent(self) -> u16 {
        self.right + self.wrong + self.missing
    }

    /// True if at least 20 frames were sent and not one byte came back.
    #[must_use]
    pub const fn is_silent(self) -> bool {
        self.missing >= 20 && self.right == 0 && self.wrong == 0
    }
}

#[cfg(test)]
mod tests {
    use motion_core::servo_bus::frame::Instruction;

    use super::*;

    /// Every question that the constructors can make.
    fn all() -> impl Iterator<Item = BusQuestion> {
        let kinds = [BusQuestion::ping, BusQuestion::measure, BusQuestion::torque_switch];
        let to_servos = kinds.into_iter().flat_map(|kind| (0..=u8::MAX).map(kind));
        to_servos.chain((0..=u16::MAX).map(BusQuestion::to_absent_servo))
    }

    #[test]
    fn no_question_is_a_write() {
        for question in all() {
            let code = Instruction::from_code(question.frame()[4]);
            assert!(matches!(code, Some(Instruction::Ping | Instruction::Read)), "{question:?}");
        }
    }

    #[test]
    fn a_ping_of_an_absent_servo_addresses_no_servo_of_the_arm_and_is_no_broadcast() {
        for number in 0..=u16::MAX {
            assert!((FIRST_ABSENT_ID..0xFE).contains(&BusQuestion::to_absent_servo(number).frame()[2]));
        }
    }

    #[test]
    fn an_answer_is_found_with_and_without_an_echo() {
        let question = BusQuestion::torque_switch(3);
        let answer = [0xFF, 0xFF, 3, 3, 0, 2, 0xF7];
        assert_eq!(question.answer(&answer).unwrap(), [2]);
        assert_eq!(question.answer(&[question.frame(), &answer].concat()).unwrap(), [2]);
        assert_eq!(question.answer(question.frame()), None, "echo only");
        assert_eq!(question.answer(&[0xFF, 0xFF, 4, 3, 0, 2, 0xF6]), None, "answer of another servo");
        assert_eq!(BusQuestion::ping(3).answer(BusQuestion::ping(3).frame()), None, "echo of a ping");
        assert_eq!(BusQuestion::ping(3).answer(&[0xFF, 0xFF, 3, 2, 0, 0xFA]).unwrap(), []);
    }

    #[test]
    fn each_echo_counts_as_right_wrong_or_missing() {
        let mut echoes = Echoes::default();
        echoes.count(&[1, 2], &[1, 2]);
        echoes.count(&[1, 2], &[1, 3]);
        echoes.count(&[1, 2], &[1]);
        echoes.count(&[1, 2], &[]);
        assert_eq!(echoes, Echoes { right: 1, wrong: 2, missing: 1 });
        assert_eq!(echoes.sent(), 4);
        assert!(!echoes.is_silent());
        let mut silent = Echoes::default();
        (0..20).for_each(|_| silent.count(&[1], &[]));
        assert!(silent.is_silent());
    }
}

//! The master's end of the servo bus: one transaction at a time, and what came of it.
//!
//! Whatever does not answer the question that was asked is dropped here: the echo of our own bytes on the
//! one wire, the late answer to an earlier question, another servo's answer, garbage. A question has one
//! outcome, a reading or a failure, so a failed read never becomes data.

use protocol_core::registers::{JOINTS, Joint};
use protocol_core::time::{Duration, Instant};

use super::frame::{self, Decoder, FrameBuffer, Reading, register};
use crate::CYCLE;

/// Time on the wire of one byte at 1 Mbaud, ten bits.
const BYTE_TIME_US: usize = 10;
/// How many lengths of question there are.
const LENGTHS: u8 = 4;

/// What a motor does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Torque {
    /// It brakes.
    Damping,
    /// It goes to its goal and holds it.
    On,
    /// It turns freely.
    Free,
}

/// The two published meanings of servo register 40, the torque switch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TorqueCodes {
    /// 0 damping, 1 on, 2 free: the older table, and the same as register 29 of the arm.
    #[default]
    DampingOnFree,
    /// 0 free, 1 on, 2 damping: Feetech's current table.
    FreeOnDamping,
}

impl TorqueCodes {
    /// The value of the torque switch for `torque`.
    #[must_use]
    pub const fn code(self, torque: Torque) -> u8 {
        match (self, torque) {
            (_, Torque::On) => 1,
            (Self::DampingOnFree, Torque::Damping) | (Self::FreeOnDamping, Torque::Free) => 0,
            (Self::DampingOnFree, Torque::Free) | (Self::FreeOnDamping, Torque::Damping) => 2,
        }
    }
}

/// What came of a question to a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It answered.
    Measured {
        /// Which servo.
        joint: Joint,
        /// What it measured.
        reading: Reading,
        /// What it complains about: bits of [`frame::error`].
        alarms: u8,
    },
    /// It did not answer in time, or not in a form that can be trusted.
    Failed {
        /// Which servo.
        joint: Joint,
    },
}

/// The master's end of the wire.
#[derive(Clone, Debug)]
pub struct Bus {
    timeout: Duration,
    codes: TorqueCodes,
    decoder: Decoder,
    frame: FrameBuffer,
    /// Who was asked and has not answered yet.
    awaited: Option<Joint>,
    /// By how much the next question to each servo is longer than it needs to be. It changes with every
    /// question that got no answer: so a late answer to that one is told from the answer to the next.
    surplus: [u8; JOINTS],
    /// When the time for the answer is over, or, where none is expected, when the wire is free again.
    busy_until: Instant,
}

impl Bus {
    /// A silent bus on which a servo answers within `timeout` of the last byte sent.
    #[must_use]
    pub const fn new(timeout: Duration, codes: TorqueCodes) -> Self {
        Self {
            timeout,
            codes,
            decoder: Decoder::new(),
            frame: FrameBuffer::new(),
            awaited: None,
            surplus: [0; JOINTS],
            busy_until: Instant::ZERO,
        }
    }

    /// Takes bytes from the wire.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.decoder.push(bytes);
    }

    /// What came of the outstanding question, once that is known.
    pub fn poll(&mut self, now: Instant) -> Option<Outcome> {
        let outcome = self.answer().or_else(|| self.expired(now))?;
        self.awaited = None;
        self.busy_until = now;
        Some(outcome)
    }

    fn answer(&mut self) -> Option<Outcome> {
        let joint = self.awaited?;
        let surplus = self.surplus_of(joint);
        while let Some(result) = self.decoder.pull() {
            if let Ok(answer) = result
                && answer.id == joint.index()
                && answer.params.len() == usize::from(Reading::REGISTERS + surplus)
                && let Some(reading) =
                    answer.params.get(..usize::from(Reading::REGISTERS)).and_then(Reading::parse)
            {
                return Some(Outcome::Measured { joint, reading, alarms: answer.code });
            }
        }
        None
    }

    fn surplus_of(&self, joint: Joint) -> u8 {
        self.surplus.get(usize::from(joint.index())).copied().unwrap_or(0)
    }

    fn expired(&mut self, now: Instant) -> Option<Outcome> {
        let joint = self.awaited.filter(|_| now >= self.busy_until)?;
        if let Some(surplus) = self.surplus.get_mut(usize::from(joint.index())) {
            *surplus = (*surplus + 1) % LENGTHS;
        }
        Some(Outcome::Failed { joint })
    }

    /// May something be sent?
    #[must_use]
    pub fn is_idle(&self, now: Instant) -> bool {
        self.awaited.is_none() && now >= self.busy_until
    }

    /// When the bus is idle again, at the latest; meaningless while it is idle.
    #[must_use]
    pub const fn busy_until(&self) -> Instant {
        self.busy_until
    }

    /// The frame to send, after one of the calls below.
    #[must_use]
    pub fn frame(&self) -> &[u8] {
        &self.frame
    }

    /// Asks a joint's servo where it is and how it is.
    pub fn ask(&mut self, now: Instant, joint: Joint) {
        self.decoder.clear();
        let count = Reading::REGISTERS + self.surplus_of(joint);
        frame::read(&mut self.frame, joint.index(), register::PRESENT_POSITION, count);
        self.awaited = Some(joint);
        self.busy_until = self.sent(now) + self.timeout;
    }

    /// Sets all torque switches at one instant. No servo answers.
    pub fn set_torque(&mut self, now: Instant, torque: &[Torque; JOINTS]) {
        let items = Joint::ALL.iter().zip(torque);
        let codes = self.codes;
        frame::sync_write(
            &mut self.frame,
            register::TORQUE_SWITCH,
            items.map(|(joint, &torque)| (joint.index(), [codes.code(torque)])),
        );
        self.busy_until = self.sent(now);
    }

    /// Gives joints their goals in servo counts, all at one instant. Each is to be reached within a control
    /// cycle, so that a row of goals makes an even movement. No servo answers.
    pub fn set_goals(&mut self, now: Instant, goals: impl Iterator<Item = (Joint, u16)>) {
        let [time_high, time_low] = const { cycle_in_millis().to_be_bytes() };
        frame::sync_write(
            &mut self.frame,
            register::GOAL_POSITION,
            goals.map(|(joint, counts)| {
                let [high, low] = counts.to_be_bytes();
                (joint.index(), [high, low, time_high, time_low, 0, 0])
            }),
        );
        self.busy_until = self.sent(now);
    }

    /// When the last byte of the frame is on the wire.
    fn sent(&self, now: Instant) -> Instant {
        let micros = u64::try_from(self.frame.len() * BYTE_TIME_US).unwrap_or(0);
        now + Duration::from_micros(micros)
    }
}

#[allow(clippy::cast_possible_truncation)] // Evaluated when compiled: 10.
const fn cycle_in_millis() -> u16 {
    (CYCLE.as_micros() / 1_000) as u16
}

#[cfg(test)]
mod tests {
    use super::super::frame::{error, status};
    use super::*;

    const J3: Joint = Joint::ALL[2];

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    fn bus() -> Bus {
        Bus::new(Duration::from_millis(3), TorqueCodes::default())
    }

    fn reading() -> Reading {
        Reading { position_counts: 500, speed: 0, load: 0, voltage_decivolts: 74, temperature_celsius: 30 }
    }

    fn answer_of(id: u8, error: u8) -> Vec<u8> {
        let mut buffer = FrameBuffer::new();
        status(&mut buffer, id, error, &reading().to_bytes());
        buffer.to_vec()
    }

    fn measured(alarms: u8) -> Option<Outcome> {
        Some(Outcome::Measured { joint: J3, reading: reading(), alarms })
    }

    #[test]
    fn a_question_is_answered() {
        let mut bus = bus();
        bus.ask(at(0), J3);
        assert_eq!(bus.frame(), [0xFF, 0xFF, 2, 4, 2, 56, 8, 0xB7]);
        assert!(!bus.is_idle(at(1)));
        let answer = answer_of(2, error::OVERLOAD);
        bus.bytes(&answer[..5]);
        assert_eq!(bus.poll(at(200)), None);
        bus.bytes(&answer[5..]);
        assert_eq!(bus.poll(at(300)), measured(error::OVERLOAD));
        assert!(bus.is_idle(at(300)));
    }

    #[test]
    fn silence_is_a_failure_once_its_time_is_over() {
        let mut bus = bus();
        bus.ask(at(0), J3);
        assert_eq!(bus.busy_until(), at(3_080), "eight bytes and the time-out");
        assert_eq!(bus.poll(at(3_079)), None);
        assert_eq!(bus.poll(at(3_080)), Some(Outcome::Failed { joint: J3 }));
        assert_eq!(bus.poll(at(3_081)), None, "said once");
    }

    #[test]
    fn echo_garbage_and_others_answers_are_dropped() {
        let mut bus = bus();
        bus.ask(at(0), J3);
        let echo = bus.frame().to_vec();
        bus.bytes(&echo);
        bus.bytes(&[0xFF, 0x00, 0xFF, 0xFF]);
        bus.bytes(&answer_of(1, 0));
        let mut garbled = answer_of(2, 0);
        garbled[6] ^= 1;
        bus.bytes(&garbled);
        assert_eq!(bus.poll(at(500)), None);
        bus.bytes(&answer_of(2, 0));
        assert_eq!(bus.poll(at(600)), measured(0));
    }

    #[test]
    fn a_late_answer_is_not_taken_for_the_next_one() {
        let mut bus = bus();
        bus.ask(at(0), Joint::ALL[1]);
        assert!(bus.poll(at(4_000)).is_some());
        bus.bytes(&answer_of(1, 0));
        bus.ask(at(4_000), J3);
        assert_eq!(bus.poll(at(4_001)), None, "cleared before the question");
        bus.bytes(&answer_of(1, 0));
        assert_eq!(bus.poll(at(4_002)), None, "of another servo");
    }

    #[test]
    fn a_late_answer_of_the_same_servo_is_told_by_its_length() {
        let mut bus = bus();
        bus.ask(at(0), J3);
        assert_eq!(bus.poll(at(4_000)), Some(Outcome::Failed { joint: J3 }));
        bus.ask(at(4_000), J3);
        assert_eq!(bus.frame()[6], 9, "one register more");
        bus.bytes(&answer_of(2, 0));
        assert_eq!(bus.poll(at(4_300)), None, "that is the answer to the first question");
        let mut longer = FrameBuffer::new();
        status(&mut longer, 2, 0, &[reading().to_bytes().as_slice(), &[0]].concat());
        bus.bytes(&longer);
        assert_eq!(bus.poll(at(4_400)), measured(0));
    }

    #[test]
    fn an_answer_that_is_no_measurement_is_a_failure() {
        let mut bus = bus();
        bus.ask(at(0), J3);
        let mut buffer = FrameBuffer::new();
        status(&mut buffer, 2, 0, &[0xFF; 8]);
        bus.bytes(&buffer);
        assert_eq!(bus.poll(at(100)), None);
        assert_eq!(bus.poll(at(9_000)), Some(Outcome::Failed { joint: J3 }));
    }

    #[test]
    fn all_goals_leave_in_one_frame() {
        let mut bus = bus();
        bus.set_goals(at(0), Joint::ALL.into_iter().map(|joint| (joint, 511 + u16::from(joint.index()))));
        assert_eq!(bus.frame().len(), 57);
        assert_eq!(bus.frame()[..14], [0xFF, 0xFF, 0xFE, 53, 0x83, 42, 6, 0, 1, 0xFF, 0, 10, 0, 0]);
        assert_eq!(bus.busy_until(), at(570));
        assert!(!bus.is_idle(at(569)) && bus.is_idle(at(570)));
    }

    #[test]
    fn torque_codes_follow_the_arm_s_table() {
        let all = [Torque::Damping, Torque::On, Torque::Free];
        assert_eq!(all.map(|torque| TorqueCodes::DampingOnFree.code(torque)), [0, 1, 2]);
        assert_eq!(all.map(|torque| TorqueCodes::FreeOnDamping.code(torque)), [2, 1, 0]);
        let mut bus = Bus::new(Duration::ZERO, TorqueCodes::FreeOnDamping);
        bus.set_torque(at(0), &[Torque::Free; JOINTS]);
        assert_eq!(bus.frame()[5..9], [40, 1, 0, 0]);
    }

    #[test]
    fn a_cycle_in_milliseconds_is_a_cycle() {
        assert_eq!(u64::from(cycle_in_millis()) * 1_000, CYCLE.as_micros());
    }
}

//! The master's end of the servo bus: one outstanding read at a time.
//!
//! A read has one outcome, a reading or a failure, so a failed read never becomes data. Bytes that do not answer the
//! outstanding read are dropped: the echo of our own bytes, a late answer, another servo's answer, noise.

use protocol_core::registers::{JOINTS, Joint};
use protocol_core::time::{Duration, Instant};

use super::byte_time::ByteTime;
use super::frame::{self, Decoder, Reading, ServoFrameBuffer, register};
use super::torque::{Torque, TorqueCodes};
use crate::CYCLE;

/// The longest time that noise may delay a frame. A frame that damps the servos must not wait for noise to end.
const MAX_NOISE_DELAY: Duration = Duration::from_millis(1);
/// The number of registers of a goal: position, time and speed have two each.
const GOAL_REGISTERS: usize = 6;
/// In how many lengths each question is asked, so that its answer is not taken for one to an earlier question.
const READ_LENGTHS: u8 = 4;

/// The content of a valid answer of a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Position, speed, load, supply voltage and temperature.
    pub reading: Reading,
    /// The error bits, see [`frame::error`].
    pub alarms: u8,
    /// Its torque and its goal, if the read asked for them.
    pub torque: Option<HeldGoal>,
    /// From the last byte of the read to the last byte of the answer, in microseconds: the servo measured in this time.
    pub answer_micros: u16,
}

/// The torque and the goal of a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeldGoal {
    /// Is its torque switch on?
    pub is_on: bool,
    /// The goal that it holds or moves to, in counts.
    pub goal_counts: u16,
}

/// Which registers a read asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Question {
    /// The measurements, without the torque switch and the goal.
    Reading,
    /// The torque switch, the goal, and the measurements.
    TorqueAndReading,
}

impl Question {
    /// The distance of the measurements from the torque switch, in registers.
    const DISTANCE: u8 = register::PRESENT_POSITION - register::TORQUE_SWITCH;

    const fn first(self) -> u8 {
        match self {
            Self::Reading => register::PRESENT_POSITION,
            Self::TorqueAndReading => register::TORQUE_SWITCH,
        }
    }

    const fn count(self) -> u8 {
        match self {
            Self::Reading => Reading::REGISTERS,
            Self::TorqueAndReading => Self::DISTANCE + Reading::REGISTERS,
        }
    }

    /// Parses the values of an answer.
    fn parse(self, values: &[u8], alarms: u8, codes: TorqueCodes) -> Option<Answer> {
        let measurements = values.get(usize::from(self.count() - Reading::REGISTERS)..)?;
        let reading = Reading::parse(measurements.get(..usize::from(Reading::REGISTERS))?)?;
        let torque = match (self, values) {
            (Self::TorqueAndReading, &[code, _, high, low, ..]) => Some(HeldGoal {
                is_on: code == codes.code(Torque::On),
                goal_counts: u16::from_be_bytes([high, low]),
            }),
            _ => None,
        };
        Some(Answer { reading, alarms, torque, answer_micros: 0 })
    }
}

/// The outcome of a read from a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The servo sent a valid answer, and it came before the timeout was noticed.
    Measured {
        /// The joint whose servo was asked.
        joint: Joint,
        /// The measurements, the error bits and the answer time.
        answer: Answer,
        /// Was the answer processed within a control cycle after the timeout? After that the joint may have moved.
        is_timely: bool,
    },
    /// The servo did not send a valid answer in time.
    Failed {
        /// The joint whose servo was asked.
        joint: Joint,
    },
}

/// The master's end of the servo bus.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Bus {
    byte_time: ByteTime,
    timeout: Duration,
    guard_time: Duration,
    /// How much later than on the wire an answer may arrive here, because a USB adapter buffers it.
    answer_delay: Duration,
    codes: TorqueCodes,
    decoder: Decoder,
    frame: ServoFrameBuffer,
    /// The outstanding read.
    awaited: Option<(Joint, Question)>,
    /// How many additional registers the next read of each servo asks for. The number changes with each read that
    /// failed, so a late answer to that read differs in length from the answer to the next.
    read_length_tags: [u8; JOINTS],
    /// The longest answer time of each servo since the last call that took it, in microseconds.
    longest_answers: [u16; JOINTS],
    /// Until when the wire is busy: with an answer on the wire, or with a frame that has no answer.
    busy_until: Instant,
    /// When the present run of bytes began: bytes without a pause of the guard time between them.
    heard_since: Instant,
    /// When the guard time after the last byte received ends.
    quiet_at: Instant,
    /// When the wire is free for a frame: neither busy nor noisy. It follows from the three times above.
    free_at: Instant,
    /// When the outstanding read fails: after the timeout on the wire and the answer delay.
    answer_until: Instant,
    /// When the guard time after the last frame without an answer ends.
    sent_until: Instant,
}

impl Bus {
    /// An idle bus at `baud` bits per second. A servo has to answer within `timeout` of the last byte sent. A frame
    /// begins at least `guard_time` after the byte before it, unless noise lasts for 1 ms.
    #[must_use]
    pub const fn new(baud: u32, timeout: Duration, guard_time: Duration, codes: TorqueCodes) -> Self {
        Self {
            byte_time: ByteTime::at_baud(baud),
            timeout,
            guard_time,
            answer_delay: Duration::ZERO,
            codes,
            decoder: Decoder::new(),
            frame: ServoFrameBuffer::new(),
            awaited: None,
            read_length_tags: [0; JOINTS],
            longest_answers: [0; JOINTS],
            busy_until: Instant::ZERO,
            heard_since: Instant::ZERO,
            quiet_at: Instant::ZERO,
            free_at: Instant::ZERO,
            answer_until: Instant::ZERO,
            sent_until: Instant::ZERO,
        }
    }

    /// Sets how much later than on the wire answers may arrive here. Meanwhile the wire is free for frames without an
    /// answer.
    pub const fn set_answer_delay(&mut self, delay: Duration) {
        self.answer_delay = delay;
    }

    /// Takes bytes that were received by `now`. The guard time begins after them, also after an echo or noise.
    pub fn bytes(&mut self, now: Instant, bytes: &[u8]) {
        self.decoder.push(bytes);
        if !bytes.is_empty() {
            self.heard(now);
        }
    }

    /// Takes a byte that was received damaged by `now`: with a framing error, noise or a parity error. It belongs to no
    /// frame, so the answer around it fails. A whole answer before or behind it counts.
    pub fn damaged_byte(&mut self, now: Instant) {
        self.decoder.push_damaged();
        self.heard(now);
    }

    fn heard(&mut self, now: Instant) {
        if now >= self.quiet_at {
            self.heard_since = now;
        }
        self.quiet_at = now + self.guard_time;
        self.update_free_at();
    }

    /// The outcome of the outstanding read, once it is known.
    pub fn poll(&mut self, now: Instant) -> Option<Outcome> {
        let (joint, question) = self.awaited?;
        if let Some(mut answer) = self.answer(joint, question) {
            self.awaited = None;
            answer.answer_micros = self.note_answer(now, joint);
            self.set_busy_until(self.sent_until.max(now + self.guard_time));
            let is_timely = now <= self.answer_until + CYCLE;
            return Some(Outcome::Measured { joint, answer, is_timely });
        }
        if now < self.answer_until {
            return None;
        }
        self.awaited = None;
        if let Some(tag) = self.read_length_tags.get_mut(usize::from(joint.index())) {
            *tag = (*tag + 1) % READ_LENGTHS;
        }
        Some(Outcome::Failed { joint })
    }

    /// The answer to this read, if it is among the received bytes.
    fn answer(&mut self, joint: Joint, question: Question) -> Option<Answer> {
        let count = usize::from(question.count() + self.read_length_tag(joint));
        while let Some(result) = self.decoder.pull() {
            if let Ok(frame) = result
                && frame.id == joint.index()
                && frame.params.len() == count
                && let Some(answer) = question.parse(frame.params, frame.code, self.codes)
            {
                return Some(answer);
            }
        }
        None
    }

    /// Records and returns the answer time, from the last byte of the read to the last byte of the answer.
    fn note_answer(&mut self, now: Instant, joint: Joint) -> u16 {
        let whole = self.timeout.as_micros().saturating_add(self.answer_delay.as_micros());
        let taken = whole.saturating_sub((self.answer_until - now).as_micros());
        let taken = u16::try_from(taken).unwrap_or(u16::MAX);
        if let Some(longest) = self.longest_answers.get_mut(usize::from(joint.index())) {
            *longest = (*longest).max(taken);
        }
        taken
    }

    /// The longest answer time of each servo since the last call, in microseconds; 0 if it did not answer.
    pub const fn take_longest_answers(&mut self) -> [u16; JOINTS] {
        core::mem::replace(&mut self.longest_answers, [0; JOINTS])
    }

    fn read_length_tag(&self, joint: Joint) -> u8 {
        self.read_length_tags.get(usize::from(joint.index())).copied().unwrap_or(0)
    }

    /// Is a read outstanding? Until its outcome, no other read may be sent.
    #[must_use]
    pub const fn is_asking(&self) -> bool {
        self.awaited.is_some()
    }

    /// Is the wire free for a frame?
    #[must_use]
    pub fn is_free(&self, now: Instant) -> bool {
        now >= self.free_at
    }

    fn set_busy_until(&mut self, until: Instant) {
        self.busy_until = until;
        self.update_free_at();
    }

    fn update_free_at(&mut self) {
        self.free_at = self.busy_until.max(self.quiet_at.min(self.heard_since + MAX_NOISE_DELAY));
    }

    /// When the bus becomes free or the outstanding read fails; `None` while the bus is idle.
    #[must_use]
    pub fn deadline(&self, now: Instant) -> Option<Instant> {
        match (self.is_free(now), self.awaited) {
            (false, _) => Some(self.free_at),
            (true, Some(_)) => Some(self.answer_until),
            (true, None) => None,
        }
    }

    /// The frame to send, from the last call of [`Bus::ask`], [`Bus::set_torque`] or [`Bus::set_goals`].
    #[must_use]
    pub fn frame(&self) -> &[u8] {
        &self.frame
    }

    /// Encodes a read of a joint's servo, which is outstanding from now on. Drops all bytes received before.
    pub fn ask(&mut self, now: Instant, joint: Joint, question: Question) {
        self.decoder.clear();
        let count = question.count() + self.read_length_tag(joint);
        frame::read(&mut self.frame, joint.index(), question.first(), count);
        self.awaited = Some((joint, question));
        self.set_busy_until(self.sent(now) + self.timeout);
        self.answer_until = self.busy_until + self.answer_delay;
    }

    /// Encodes a frame that sets the torque switches of some joints simultaneously. No servo answers.
    pub fn set_torque(&mut self, now: Instant, switches: impl Iterator<Item = (Joint, Torque)>) {
        let codes = self.codes;
        frame::sync_write(
            &mut self.frame,
            register::TORQUE_SWITCH,
            switches.map(|(joint, torque)| (joint.index(), [codes.code(torque)])),
        );
        self.rest_after_frame(now);
    }

    /// Encodes a frame that sets the goals of some joints, in servo counts, simultaneously. Each goal time is one control
    /// cycle, so that consecutive goals give an even movement. No servo answers.
    pub fn set_goals(&mut self, now: Instant, goals: impl Iterator<Item = (Joint, u16)>) {
        let [time_high, time_low] = const { cycle_in_millis().to_be_bytes() };
        frame::sync_write(
            &mut self.frame,
            register::GOAL_POSITION,
            goals.map(|(joint, counts)| {
                let [high, low] = counts.to_be_bytes();
                let values: [u8; GOAL_REGISTERS] = [high, low, time_high, time_low, 0, 0];
                (joint.index(), values)
            }),
        );
        self.rest_after_frame(now);
    }

    /// Keeps the wire busy for a frame without an answer and the guard time after it.
    fn rest_after_frame(&mut self, now: Instant) {
        self.sent_until = self.sent(now) + self.guard_time;
        self.set_busy_until(self.sent_until);
    }

    /// When the last byte of the frame has left.
    fn sent(&self, now: Instant) -> Instant {
        now + self.byte_time.of(self.frame.len())
    }
}

#[allow(clippy::cast_possible_truncation)] // 10, evaluated at compile time.
const fn cycle_in_millis() -> u16 {
    (CYCLE.as_micros() / 1_000) as u16
}

#[cfg(test)]
mod tests;

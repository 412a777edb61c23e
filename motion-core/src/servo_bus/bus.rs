//! The master's end of the servo bus: one transaction at a time.
//!
//! A read has one outcome, a reading or a failure, so a failed read never becomes data. Bytes that do not answer the
//! outstanding read are dropped: the echo of our own bytes, a late answer, another servo's answer, noise.

use protocol_core::registers::{JOINTS, Joint};
use protocol_core::time::{Duration, Instant};

use super::frame::{self, Decoder, Reading, ServoFrameBuffer, register};
use super::torque::{Torque, TorqueCodes};
use crate::CYCLE;

/// Time on the wire of one byte at 1 Mbaud, ten bits.
const BYTE_TIME_US: usize = 10;
/// The longest time that noise may delay a frame. A frame that damps the servos must not wait for noise to end.
const MAX_NOISE_DELAY: Duration = Duration::from_millis(1);
/// The registers of a goal: position, time and speed, two bytes each.
const GOAL_REGISTERS: usize = 6;
/// How many different read lengths there are.
const READ_LENGTHS: u8 = 4;

/// The outcome of a read from a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The servo answered.
    Measured {
        /// The joint of the servo.
        joint: Joint,
        /// The measured values.
        reading: Reading,
        /// The error bits of the answer, see [`frame::error`].
        alarms: u8,
        /// Was the answer processed within a control cycle after the timeout? After that the joint may have moved.
        is_timely: bool,
    },
    /// The servo did not send a valid answer in time.
    Failed {
        /// The joint of the servo.
        joint: Joint,
    },
}

/// The master's end of the servo bus.
#[derive(Clone, Debug)]
pub struct Bus {
    timeout: Duration,
    guard_time: Duration,
    /// How much later than on the wire an answer may arrive here, because a USB adapter buffers it.
    answer_delay: Duration,
    codes: TorqueCodes,
    decoder: Decoder,
    frame: ServoFrameBuffer,
    /// The joint of the outstanding read.
    awaited: Option<Joint>,
    /// How many additional registers the next read of each servo asks for. The number changes with each read that
    /// failed, so a late answer to that read differs in length from the answer to the next.
    read_length_tags: [u8; JOINTS],
    /// The longest answer time of each servo since the last call that took it, in microseconds.
    longest_answers: [u16; JOINTS],
    /// Until when the wire is busy: with an answer on the wire, or with a frame that has no answer.
    busy_until: Instant,
    /// When the bytes began that have come without a pause of the guard time.
    heard_since: Instant,
    /// When the guard time after the last byte received ends.
    quiet_at: Instant,
    /// When the outstanding read fails. Later than `busy_until` by the answer delay.
    answer_until: Instant,
    /// When the guard time after the last frame without an answer ends.
    sent_until: Instant,
}

impl Bus {
    /// An idle bus. A servo has to answer within `timeout` of the last byte sent. A frame follows the byte before it
    /// after `guard_time` at the earliest.
    #[must_use]
    pub const fn new(timeout: Duration, guard_time: Duration, codes: TorqueCodes) -> Self {
        Self {
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
            answer_until: Instant::ZERO,
            sent_until: Instant::ZERO,
        }
    }

    /// Sets how much later than on the wire answers may arrive here. Meanwhile the wire is free for frames without an
    /// answer.
    pub const fn set_answer_delay(&mut self, delay: Duration) {
        self.answer_delay = delay;
    }

    /// Takes bytes that were received by `now`. The guard time begins after them, whoever sent them.
    pub fn bytes(&mut self, now: Instant, bytes: &[u8]) {
        self.decoder.push(bytes);
        if bytes.is_empty() {
            return;
        }
        if now >= self.quiet_at {
            self.heard_since = now;
        }
        self.quiet_at = now + self.guard_time;
    }

    /// The outcome of the outstanding read, once it is known.
    pub fn poll(&mut self, now: Instant) -> Option<Outcome> {
        let outcome = self.answer(now).or_else(|| self.expired(now))?;
        if let Outcome::Measured { joint, .. } = outcome {
            self.note_answer(now, joint);
            self.busy_until = self.sent_until.max(now + self.guard_time);
        }
        self.awaited = None;
        Some(outcome)
    }

    fn answer(&mut self, now: Instant) -> Option<Outcome> {
        let joint = self.awaited?;
        let tag = self.read_length_tag(joint);
        while let Some(result) = self.decoder.pull() {
            if let Ok(answer) = result
                && answer.id == joint.index()
                && answer.params.len() == usize::from(Reading::REGISTERS + tag)
                && let Some(reading) =
                    answer.params.get(..usize::from(Reading::REGISTERS)).and_then(Reading::parse)
            {
                let is_timely = now <= self.answer_until + CYCLE;
                return Some(Outcome::Measured { joint, reading, alarms: answer.code, is_timely });
            }
        }
        None
    }

    /// Records the answer time, from the last byte of the read to the last byte of the answer.
    fn note_answer(&mut self, now: Instant, joint: Joint) {
        let whole = self.timeout.as_micros().saturating_add(self.answer_delay.as_micros());
        let taken = whole.saturating_sub((self.answer_until - now).as_micros());
        if let Some(longest) = self.longest_answers.get_mut(usize::from(joint.index())) {
            *longest = (*longest).max(u16::try_from(taken).unwrap_or(u16::MAX));
        }
    }

    /// The longest answer time of each servo since the last call, in microseconds; 0 if it did not answer.
    pub const fn take_longest_answers(&mut self) -> [u16; JOINTS] {
        core::mem::replace(&mut self.longest_answers, [0; JOINTS])
    }

    fn read_length_tag(&self, joint: Joint) -> u8 {
        self.read_length_tags.get(usize::from(joint.index())).copied().unwrap_or(0)
    }

    fn expired(&mut self, now: Instant) -> Option<Outcome> {
        let joint = self.awaited.filter(|_| now >= self.answer_until)?;
        if let Some(tag) = self.read_length_tags.get_mut(usize::from(joint.index())) {
            *tag = (*tag + 1) % READ_LENGTHS;
        }
        Some(Outcome::Failed { joint })
    }

    /// Is a read outstanding? Until its outcome, no other read may be sent.
    #[must_use]
    pub const fn is_asking(&self) -> bool {
        self.awaited.is_some()
    }

    /// Is the wire free for a frame?
    #[must_use]
    pub fn is_free(&self, now: Instant) -> bool {
        now >= self.free_at()
    }

    fn free_at(&self) -> Instant {
        self.busy_until.max(self.quiet_at.min(self.heard_since + MAX_NOISE_DELAY))
    }

    /// When the bus becomes free or the outstanding read fails; `None` while the bus is idle.
    #[must_use]
    pub fn deadline(&self, now: Instant) -> Option<Instant> {
        match (self.is_free(now), self.awaited) {
            (false, _) => Some(self.free_at()),
            (true, Some(_)) => Some(self.answer_until),
            (true, None) => None,
        }
    }

    /// The frame to send, after one of the calls below.
    #[must_use]
    pub fn frame(&self) -> &[u8] {
        &self.frame
    }

    /// Reads the measurements of a joint's servo.
    pub fn ask(&mut self, now: Instant, joint: Joint) {
        self.decoder.clear();
        let count = Reading::REGISTERS + self.read_length_tag(joint);
        frame::read(&mut self.frame, joint.index(), register::PRESENT_POSITION, count);
        self.awaited = Some(joint);
        self.busy_until = self.sent(now) + self.timeout;
        self.answer_until = self.busy_until + self.answer_delay;
    }

    /// Sets the torque switches of some joints simultaneously. No servo answers.
    pub fn set_torque(&mut self, now: Instant, switches: impl Iterator<Item = (Joint, Torque)>) {
        let codes = self.codes;
        frame::sync_write(
            &mut self.frame,
            register::TORQUE_SWITCH,
            switches.map(|(joint, torque)| (joint.index(), [codes.code(torque)])),
        );
        self.rest_after_frame(now);
    }

    /// The first bytes of the frame that [`Bus::set_goals`] prepares for this many joints.
    pub fn begin_goals(&mut self, joints: usize) {
        frame::sync_write_start::<GOAL_REGISTERS>(&mut self.frame, register::GOAL_POSITION, joints);
    }

    /// Sets the goals of some joints in servo counts, simultaneously. Each goal time is one control cycle, so that
    /// consecutive goals give an even movement. No servo answers.
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
        self.busy_until = self.sent_until;
    }

    /// When the last byte of the frame has left.
    fn sent(&self, now: Instant) -> Instant {
        let micros = u64::try_from(self.frame.len() * BYTE_TIME_US).unwrap_or(0);
        now + Duration::from_micros(micros)
    }
}

#[allow(clippy::cast_possible_truncation)] // 10, evaluated at compile time.
const fn cycle_in_millis() -> u16 {
    (CYCLE.as_micros() / 1_000) as u16
}

#[cfg(test)]
mod tests;

//! The state of each servo as the controller can know it from the replies.

use motion_core::TorqueCodes;
use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::Decoder;
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use super::status_reply::{goal, measurements, torque_switch};
use crate::per_joint::PerJoint;

/// Start-up may end once each servo has sent this many replies.
const START_UP_REPLIES: u8 = 2;
/// Servos that were silent for a second may have lost their supply (D29). The margin of 100 ms is for the controller, whose second
/// starts when a read fails, not when it is sent.
const LOST_AFTER: Duration = Duration::from_millis(900);
/// The end of a silence may have effects for this long.
const NOTICE_TIME: Duration = Duration::from_millis(3_000);
/// A joint is let go once its torque was read as off this many times: one reading may be false.
const LOST_BY: u8 = 2;

/// The number of registers in a reading.
const READING: usize = 8;

/// The knowledge about one servo.
#[derive(Clone, Copy, Debug, Default)]
struct Known {
    replies: u8,
    /// Reads since the last reply.
    unanswered: u8,
    asked_at: Instant,
    /// The number of registers in the last read. A late reply to an earlier read may have another length.
    asked_count: u8,
    /// The first read of the present silence.
    silent_since: Option<Instant>,
    /// The start and the end of the last silence.
    silence: (Instant, Instant),
    /// A driven servo left a question unanswered, and its torque was not read since then.
    is_doubtful: bool,
    /// True if the servo was driven at the last read that followed an answered read.
    is_driven: bool,
    /// True if its torque was read as on since it was last switched on or refreshed. A later read that is unanswered or shows it
    /// off clears this.
    is_read_on: bool,
    /// True if its torque was off when it was last read.
    is_read_off: bool,
    /// How many times in a row its torque was read as off.
    offs: u8,
    /// As `offs`, without the first answers after a silence, which the controller may reject.
    taken_offs: u8,
    /// True if its torque was read as off [`LOST_BY`] times in a row since it was last given torque.
    was_lost: bool,
    /// When a read of its torque last ended a doubt, and how many doubts ended since its last goal.
    trusted_at: Instant,
    ended_doubts: u64,
    /// The goal that it held with torque when its torque was read last, in counts.
    held_goal: Option<u16>,
    /// The last measured position, in counts.
    position: Option<u16>,
    /// The lowest and the highest position in counts: since the last goal, and in the last time between two goals with a reading.
    positions: [Option<(u16, u16)>; 2],
}

#[derive(Clone, Debug)]
pub(super) struct ServoReplies {
    codes: TorqueCodes,
    /// Decodes the bytes that the controller receives.
    decoder: Decoder,
    /// The servo that was asked last, until it answers. The controller waits for no other.
    asked: Option<Joint>,
    servos: PerJoint<Known>,
    /// All driven servos were silent at once for a second. Since then none was read with torque, and the host has not written the
    /// motor state.
    was_outage: bool,
}

impl ServoReplies {
    pub(super) fn new(codes: TorqueCodes) -> Self {
        Self { codes, decoder: Decoder::new(), asked: None, servos: PerJoint::default(), was_outage: false }
    }

    /// The controller reads a servo.
    pub(super) fn asked(&mut self, now: Instant, joint: Joint, count: u8, is_driven: bool) {
        let servo = &mut self.servos[joint];
        if servo.unanswered > 0 {
            servo.silent_since.get_or_insert(servo.asked_at);
            servo.is_doubtful |= servo.is_driven;
            servo.is_read_on = false;
        } else {
            servo.is_driven = is_driven && servo.taken_offs < LOST_BY;
        }
        servo.unanswered = servo.unanswered.saturating_add(1);
        servo.asked_at = now;
        servo.asked_count = count;
        self.asked = Some(joint);
        let mut driven = self.servos.0.iter().filter(|servo| servo.is_driven).peekable();
        self.was_outage |= driven.peek().is_some() && driven.all(|servo| servo.is_lost(now));
        // The controller does the same: bytes that came before a read are not its reply.
        self.decoder.clear();
    }

    /// Decodes bytes that the controller receives, and records the reply to the last read.
    pub(super) fn received(&mut self, now: Instant, bytes: &[u8]) {
        for piece in bytes.chunks(Decoder::CAPACITY / 2) {
            self.decoder.push(piece);
            while let Some(heard) = self.decoder.pull() {
                let Some(frame) = heard.ok().filter(|frame| frame.params.len() >= READING) else { continue };
                let Some(joint) = self.asked.filter(|asked| asked.index() == frame.id) else { continue };
                if frame.params.len() != usize::from(self.servos[joint].asked_count) {
                    continue;
                }
                self.asked = None;
                let has_torque = self.servos[joint].answered(now, frame.params, self.codes.code(Torque::On));
                self.was_outage &= !has_torque;
            }
        }
    }

    /// True if each servo has replied often enough for the end of start-up.
    pub(super) fn have_all_started(&self) -> bool {
        self.servos.0.iter().all(|servo| servo.replies >= START_UP_REPLIES)
    }

    /// Reads since the last reply.
    pub(super) fn unanswered(&self, joint: Joint) -> u8 {
        self.servos[joint].unanswered
    }

    /// The last measured position, in counts.
    pub(super) fn position(&self, joint: Joint) -> Option<u16> {
        self.servos[joint].position
    }

    /// The lowest and the highest measured positions from which the next goal may be computed. A position that was read
    /// shortly before the last goal may have come too late for that goal, because goals are computed once in each control cycle.
    pub(super) fn positions(&self, joint: Joint) -> impl Iterator<Item = u16> {
        self.servos[joint].positions.into_iter().flatten().flat_map(|(lowest, highest)| [lowest, highest])
    }

    /// Records that a goal is sent to the servo.
    pub(super) fn goal_is_sent(&mut self, joint: Joint) {
        let [since_goal, before] = self.servos[joint].positions;
        self.servos[joint].positions = [None, since_goal.or(before)];
    }

    /// The goal that the servo held with torque when its torque was read last, in counts.
    pub(super) fn held_goal(&self, joint: Joint) -> Option<u16> {
        self.servos[joint].held_goal
    }

    /// True if a driven servo left a question unanswered, and its torque was not read since then.
    pub(super) fn is_doubtful(&self, joint: Joint) -> bool {
        self.servos[joint].is_doubtful
    }

    /// The time in which the set-point of a joint may have moved since the last goal of its servo. The set-point moves after
    /// that goal and after the end of each doubt, until a read fails, at most for `until_doubt`. Call this for each goal, because
    /// it resets the number of ended doubts.
    pub(super) fn take_trusted_time(
        &mut self,
        joint: Joint,
        now: Instant,
        until_doubt: Duration,
    ) -> Duration {
        let servo = &mut self.servos[joint];

        let phases = std::mem::take(&mut servo.ended_doubts).max(1);
        let last = now - servo.trusted_at;
        Duration::from_micros(phases * until_doubt.as_micros() + last.as_micros())
    }

    /// Forgets doubts and torque readings: the joint is given torque at its measured position, or is no longer driven.
    pub(super) fn forget_doubt(&mut self, joint: Joint) {
        let servo = &mut self.servos[joint];
        (servo.is_doubtful, servo.is_read_on, servo.is_read_off) = (false, false, false);
        (servo.offs, servo.taken_offs, servo.was_lost) = (0, 0, false);
        servo.is_driven = false;
    }

    /// True if the torque was read as on since the last call, and no later read was unanswered or showed it off.
    pub(super) fn take_read_on(&mut self, joint: Joint) -> bool {
        std::mem::take(&mut self.servos[joint].is_read_on)
    }

    /// True if the torque was off when it was read last.
    pub(super) fn was_read_off(&self, joint: Joint) -> bool {
        self.servos[joint].is_read_off
    }

    /// True if the torque was lost since the joint was last given torque. A goal may have switched it on again.
    pub(super) fn was_lost(&self, joint: Joint) -> bool {
        self.servos[joint].was_lost
    }

    /// True if a silence of at least [`LOST_AFTER`] ended less than [`NOTICE_TIME`] ago.
    pub(super) fn was_silent_for_a_second(&self, joint: Joint, now: Instant) -> bool {
        let (start, end) = self.servos[joint].silence;
        end - start >= LOST_AFTER && now - end < NOTICE_TIME
    }

    /// True if all driven servos were silent at once for a second, and since then none was read with torque and the motor state
    /// was not written.
    pub(super) const fn was_outage(&self) -> bool {
        self.was_outage
    }

    /// Forgets an outage, because the host has written the motor state since then.
    pub(super) const fn forget_outage(&mut self) {
        self.was_outage = false;
    }

    /// True if the last silence of the servo ended more than [`NOTICE_TIME`] ago.
    pub(super) fn is_steady(&self, joint: Joint, now: Instant) -> bool {
        let servo = &self.servos[joint];
        servo.silent_since.is_none() && now - servo.silence.1 > NOTICE_TIME
    }
}

impl Known {
    /// True if the servo is silent for so long that it may have lost its supply.
    fn is_lost(&self, now: Instant) -> bool {
        self.silent_since.is_some_and(|since| now - since >= LOST_AFTER)
    }

    /// Records an answer. Returns true if it shows torque.
    fn answered(&mut self, now: Instant, params: &[u8], on: u8) -> bool {
        self.replies = self.replies.saturating_add(1);
        self.unanswered = 0;
        let ended_silence = self.silent_since.take();
        if let Some(since) = ended_silence {
            self.silence = (since, now);
        }
        if let Some(&[high, low, ..]) = measurements(params) {
            let position = u16::from_be_bytes([high, low]);
            self.position = Some(position);
            let [since_goal, _] = &mut self.positions;
            let (lowest, highest) = since_goal.get_or_insert((position, position));
            (*lowest, *highest) = (position.min(*lowest), position.max(*highest));
        }
        if let Some(code) = torque_switch(params) {
            if self.is_doubtful {
                (self.is_doubtful, self.trusted_at) = (false, now);
                self.ended_doubts += 1;
            }
            self.is_read_on = code == on;
            self.is_read_off = code != on;
            self.offs = if code == on { 0 } else { self.offs.saturating_add(1) };
            let is_taken = ended_silence.is_none();
            self.taken_offs = if code == on { 0 } else { self.taken_offs.saturating_add(is_taken.into()) };
            self.was_lost |= self.offs >= LOST_BY;
            self.held_goal = goal(params).filter(|_| code == on);
        }
        torque_switch(params) == Some(on)
    }
}

#[cfg(test)]
mod tests;

//! The hub holds the arm by itself when the watchdog of a client acts and does not damp the motors
//! ([D24](protocol_core::decisions#d24)), for a command to stop, and for a stop or a hold that comes too late or while the arm is
//! silent. It also repeats a hold that an outage interrupted.
//!
//! ```text
//!   read which joints are silent or move ──▶ none, and no stream: the arm holds
//!     └─▶ read targets and positions ──▶ write the positions of these joints as targets ──▶ read again, until no target differs
//!           └─▶ read the set-point period if it was changed, and then the motor state and the speeds, until these are restored
//!               (`holding`)
//! ```
//!
//! If the arm tells which joints move, a joint that has reached its target keeps it ([D24](protocol_core::decisions#d24)). Its
//! load draws it some tenths of a degree off its target: if its position became its target, it would sink by as much again in
//! each hold. A joint that still brakes after a stop or a hold keeps its target, too ([`HeldTargets`]).

use host_link::keep_limits;
use protocol_core::registers::map::{
    FINE_POSITION, FINE_TARGET, LIMITS, MISSING_SERVOS, MOTOR_STATE, MOVING_JOINTS, PRESENT_POSITION,
    SET_POINT_PERIOD, SPEED, TARGET_POSITION,
};
use protocol_core::registers::{JOINTS, Joint, Register};
use protocol_core::time::{Duration, Instant};

use super::angles::{DEGREE, JointAngles, UNMEASURED, angles_in, limits_in};
use super::held_targets::HeldTargets;

/// The hold has failed after this many replies that do not confirm it.
const MOST_ROUNDS: u8 = 10;
/// A read without a reply is repeated after this time. Unless the hold restores, the brake is written again before the repeat.
const REPEAT_PERIOD: Duration = Duration::from_millis(100);
/// How often a hold is repeated while a joint whose set-point moves was not measured yet. All repeats together take at least
/// 0.2 s, and an arm takes 0.2 s to measure its joints after power-up.
const MOST_REPEATS: u8 = 40;

/// A frame to write: the first register, and the values.
pub(crate) type RegisterWrite = (u8, Vec<u8>);

/// The value that is being restored once the arm holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Restoring {
    /// The set-point period.
    Period,
    Speeds,
}

#[derive(Debug)]
pub(crate) struct ArmHold {
    /// The arm has positions in hundredths of a degree, and tells which joints move.
    is_fine: bool,
    /// The set-point period is not 0: targets are points of a stream, and older points may still be ahead of the newest one.
    is_streaming: bool,
    /// The joints to hold at their positions, one bit each; `None`: not known yet.
    moving: Option<u8>,
    /// The joints of `moving` whose set-points move, one bit each.
    driven: u8,
    /// A joint whose set-point moves was not measured yet. It goes on moving once it is measured.
    has_unmeasured: bool,
    repeats: u8,
    /// Replies so far; while the hold restores, tries to restore the value.
    rounds: u8,
    sent: Vec<RegisterWrite>,
    /// Joints that a client held after the pending read was first sent, one bit each.
    held_meanwhile: u8,
    /// When to repeat the read that has no reply yet; `None`: the next read is due now.
    repeat_at: Option<Instant>,
    /// All joints have to be slowed down before the next read.
    is_brake_due: bool,
    /// The arm holds.
    is_done: bool,
    /// The arm holds, and this is being restored.
    restoring: Option<Restoring>,
    /// The arm did not take back something that was to be restored.
    is_unrestored: bool,
    /// Another hold was requested meanwhile. It has to follow, because this one may have read the arm before that request.
    is_wanted_again: bool,
}

impl ArmHold {
    /// A hold that has read nothing from the arm yet.
    pub(crate) const fn new(is_fine: bool, is_streaming: bool) -> Self {
        // Without the status block every joint may move.
        let moving = if is_fine { None } else { Some(u8::MAX) };
        Self {
            is_fine,
            is_streaming,
            moving,
            driven: 0,
            has_unmeasured: false,
            repeats: MOST_REPEATS,
            rounds: 0,
            sent: Vec::new(),
            held_meanwhile: 0,
            repeat_at: None,
            is_brake_due: true,
            is_done: false,
            restoring: None,
            is_unrestored: false,
            is_wanted_again: false,
        }
    }

    /// Notes that another hold has to follow this one.
    pub(crate) const fn want_again(&mut self) {
        self.is_wanted_again = true;
    }

    /// Does another hold have to follow?
    pub(crate) const fn is_wanted_again(&self) -> bool {
        self.is_wanted_again
    }

    /// The hold that follows this one because a joint whose set-point moves was not measured yet.
    pub(crate) fn for_unmeasured(&self) -> Option<Self> {
        let repeats = self.repeats.checked_sub(1).filter(|_| self.has_unmeasured)?;
        Some(Self { repeats, is_brake_due: false, ..Self::new(self.is_fine, self.is_streaming) })
    }

    /// Notes that a client holds the joints that have a target here. What a pending read shows of them is out of date.
    pub(crate) fn note_held(&mut self, targets: &JointAngles) {
        let held = Joint::ALL.into_iter().zip(targets).filter(|(_, target)| target.is_some());
        self.held_meanwhile = held.fold(self.held_meanwhile, |bits, (joint, _)| bits | joint.bit());
    }

    /// The read that is due: the first register, and how many. `None` if no read is due.
    pub(crate) fn next_read(&mut self, now: Instant) -> Option<(u8, u8)> {
        if now < self.due() {
            return None;
        }
        if self.repeat_at.replace(now + REPEAT_PERIOD).is_some() {
            self.is_brake_due = self.restoring.is_none();
        } else {
            self.held_meanwhile = 0;
        }
        let (first, last) = match (self.restoring, self.moving) {
            (Some(Restoring::Period), _) => (SET_POINT_PERIOD, SET_POINT_PERIOD),
            (Some(Restoring::Speeds), _) => (MOTOR_STATE, SPEED),
            (None, None) => (MISSING_SERVOS, MOVING_JOINTS),
            (None, Some(_)) if self.is_fine => (FINE_TARGET, LIMITS),
            (None, Some(_)) => (TARGET_POSITION, PRESENT_POSITION),
        };
        Some((first.address, last.address + last.count - first.address))
    }

    /// The time from which on [`Self::next_read`] returns a read.
    pub(crate) fn due(&self) -> Instant {
        self.repeat_at.unwrap_or(Instant::ZERO)
    }

    /// Do all joints have to be slowed down before the read that is sent now? True once for each brake.
    pub(crate) const fn take_brake(&mut self) -> bool {
        std::mem::replace(&mut self.is_brake_due, false)
    }

    /// The arm holds: begins to restore `what`.
    pub(crate) const fn restore(mut self, what: Restoring) -> Self {
        (self.restoring, self.rounds, self.repeat_at) = (Some(what), 0, None);
        self
    }

    /// The value that is being restored; `None`: the hold is not at that step.
    pub(crate) const fn restoring(&self) -> Option<Restoring> {
        self.restoring
    }

    /// The values to restore were written, and have to be read back.
    pub(crate) const fn verify(&mut self) {
        self.repeat_at = None;
        self.rounds += 1;
    }

    /// Notes that the arm did not take back what was to be restored.
    pub(crate) const fn give_up_restoring(&mut self) {
        self.is_unrestored = true;
    }

    /// Is there something that the arm did not take back?
    pub(crate) const fn is_unrestored(&self) -> bool {
        self.is_unrestored
    }

    /// The registers of the targets and of the positions.
    const fn rows(&self) -> (&'static Register, &'static Register) {
        if self.is_fine { (&FINE_TARGET, &FINE_POSITION) } else { (&TARGET_POSITION, &PRESENT_POSITION) }
    }

    /// Is this step over? Either the arm holds and nothing is being restored, or the step was tried often enough.
    pub(crate) const fn is_over(&self) -> bool {
        (self.is_done && self.restoring.is_none()) || self.rounds >= MOST_ROUNDS
    }

    /// Has the arm confirmed that it holds?
    pub(crate) const fn is_confirmed(&self) -> bool {
        self.is_done && !self.has_unmeasured
    }

    /// Processes a reply, and returns the frames to write.
    pub(crate) fn frames(&mut self, address: u8, values: &[u8], held: &HeldTargets) -> Vec<RegisterWrite> {
        self.repeat_at = None;
        self.rounds += 1;
        let Some(moving) = self.moving else {
            // `values` are the silent and the moving joints. The set-point of a silent joint stands still, but goes on to its
            // target when the joint answers.
            let moving = values.iter().fold(0, |bits, value| bits | value);
            self.moving = Some(moving);
            self.driven = values.last().copied().unwrap_or_default();
            self.is_done = moving == 0 && !self.is_streaming;
            return Vec::new();
        };
        let is_taken = |(start, wanted): &RegisterWrite| {
            let place = usize::from(start.saturating_sub(address));
            values.get(place..place + wanted.len()) == Some(wanted.as_slice())
        };
        if !self.sent.is_empty() && self.sent.iter().all(is_taken) {
            self.is_done = true;
            return Vec::new();
        }
        let mut positions = Joint::ALL.into_iter().zip(angles_in(self.rows().1, address, values));
        let is_unmeasured =
            |(joint, at): (Joint, _)| self.driven & joint.bit() != 0 && at == Some(UNMEASURED);
        self.has_unmeasured = positions.any(is_unmeasured);
        self.sent = self.frames_that_hold(moving, address, values, held);
        self.is_done = self.sent.is_empty();
        self.sent.clone()
    }

    /// One frame for each run of adjacent joints that get a target.
    fn frames_that_hold(
        &self,
        moving: u8,
        address: u8,
        values: &[u8],
        held: &HeldTargets,
    ) -> Vec<RegisterWrite> {
        let (targets, positions) = self.rows();
        let [present, measured] = [targets, positions].map(|row| angles_in(row, address, values));
        let mut wanted = [None; JOINTS];
        for (((wanted, target), position), joint) in
            wanted.iter_mut().zip(present).zip(measured).zip(Joint::ALL)
        {
            let position = position.filter(|&at| at != UNMEASURED);
            let kept = match moving & joint.bit() {
                0 => target,
                _ => position.and_then(|position| self.held_target(joint, position, target, held)),
            };
            // In a stream, also write the target of a joint that keeps it. Otherwise older points would still move the joint.
            *wanted = kept.map_or(position, |kept| self.is_streaming.then_some(kept));
        }
        let present = present.map(Option::unwrap_or_default);
        keep_limits(limits_in(address, values), &present, &mut wanted);
        let wanted = Joint::ALL.into_iter().zip(wanted);
        joined(wanted.filter_map(|(joint, wanted)| Some((targets.of(joint), self.bytes(wanted?)))))
    }

    /// The target of a stop or a hold near this position, if the arm still has it (`read`), or if a client wrote it after
    /// the read was sent. The joint then keeps it.
    fn held_target(&self, joint: Joint, position: u16, read: Option<u16>, held: &HeldTargets) -> Option<u16> {
        let is_newer = self.held_meanwhile & joint.bit() != 0;
        held.near(joint, position).filter(|&target| is_newer || Some(target) == read)
    }

    /// The bytes of a target in hundredths of a degree.
    fn bytes(&self, value: u16) -> Vec<u8> {
        match self.is_fine {
            true => value.to_le_bytes().to_vec(),
            false => u8::try_from(value / DEGREE).into_iter().collect(),
        }
    }
}

/// Joins writes to consecutive registers into one frame.
pub(crate) fn joined(writes: impl Iterator<Item = RegisterWrite>) -> Vec<RegisterWrite> {
    let mut frames: Vec<RegisterWrite> = Vec::new();
    for (address, bytes) in writes {
        match frames.last_mut() {
            Some((first, values)) if usize::from(*first) + values.len() == usize::from(address) => {
                values.extend(bytes);
            }
            _ => frames.push((address, bytes)),
        }
    }
    frames
}

#[cfg(test)]
mod tests;

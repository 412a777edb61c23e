//! The hub holds the arm by itself: for a client whose watchdog acts ([D24](protocol_core::decisions#d24)), or that sent the
//! command to stop.
//!
//! ```text
//!   read which joints are silent or move ──▶ none: the arm holds
//!     └─▶ read targets and positions ──▶ write the positions of these joints as targets ──▶ read again, until no target differs
//! ```
//!
//! A joint that has reached its target keeps it ([D24](protocol_core::decisions#d24)). Its load draws it some tenths of a degree
//! off its target: with its position as the new target it would sink by as much in each hold. A joint that still brakes after a stop
//! or a hold keeps its target, too ([`HeldTargets`]).

use host_link::keep_limits;
use protocol_core::registers::map::{
    FINE_POSITION, FINE_TARGET, LIMITS, MISSING_SERVOS, MOVING_JOINTS, PRESENT_POSITION, TARGET_POSITION,
};
use protocol_core::registers::{JOINTS, Joint, Register};

use super::angles::{Angles, DEGREE, UNMEASURED, angles_in, limits_in};
use super::held_targets::HeldTargets;

/// Reads and writes are repeated this often.
const MOST_ROUNDS: u8 = 5;
/// A hold is repeated this often until each joint whose set-point moves was measured: for 0.2 s or more. It takes
/// 0.2 s after power-up.
const MOST_REPEATS: u8 = 40;

/// A frame to write: the first register, and the values.
pub(crate) type Frame = (u8, Vec<u8>);

/// A hold in progress.
#[derive(Debug)]
pub(crate) struct ArmHold {
    /// The arm has positions in hundredths of a degree, and tells which joints move.
    is_fine: bool,
    /// Targets are points of a stream, and older points may be ahead of the newest one.
    is_streaming: bool,
    /// The joints to hold at their positions, one bit each; `None`: not known yet.
    moving: Option<u8>,
    /// Those of them whose set-points move, one bit each.
    driven: u8,
    /// A joint whose set-point moves was not measured yet: it goes on once it is.
    has_unmeasured: bool,
    repeats: u8,
    rounds: u8,
    sent: Vec<Frame>,
    /// Joints that a client held after the last read was sent, one bit each.
    held_meanwhile: u8,
    /// Its read has no reply yet.
    waits: bool,
    /// The arm holds.
    is_done: bool,
    /// Another hold was wanted meanwhile: what this one has read may be older than that.
    is_wanted_again: bool,
}

impl ArmHold {
    /// A hold of an arm of which nothing is known.
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
            waits: false,
            is_done: false,
            is_wanted_again: false,
        }
    }

    /// Another hold has to follow this one.
    pub(crate) const fn want_again(&mut self) {
        self.is_wanted_again = true;
    }

    /// Has another hold to follow?
    pub(crate) const fn is_wanted_again(&self) -> bool {
        self.is_wanted_again
    }

    /// The hold that follows this one because a joint whose set-point moves was not measured yet.
    pub(crate) fn for_unmeasured(&self) -> Option<Self> {
        let repeats = self.repeats.checked_sub(1).filter(|_| self.has_unmeasured)?;
        Some(Self { repeats, ..Self::new(self.is_fine, self.is_streaming) })
    }

    /// A client holds the joints that have a target here: what was read of them before is out of date.
    pub(crate) fn note_held(&mut self, targets: &Angles) {
        let held = Joint::ALL.into_iter().zip(targets).filter(|(_, target)| target.is_some());
        self.held_meanwhile = held.fold(self.held_meanwhile, |bits, (joint, _)| bits | joint.bit());
    }

    /// The registers to read now, and how many.
    pub(crate) fn next_read(&mut self) -> Option<(u8, u8)> {
        if self.waits {
            return None;
        }
        self.waits = true;
        self.held_meanwhile = 0;
        self.rounds += 1;
        if self.moving.is_none() {
            return Some((MISSING_SERVOS.address, MOVING_JOINTS.address + 1 - MISSING_SERVOS.address));
        }
        let last = if self.is_fine { LIMITS } else { PRESENT_POSITION };
        let first = self.rows().0.address;
        Some((first, last.address + last.count - first))
    }

    /// The registers of the targets and of the positions.
    const fn rows(&self) -> (&'static Register, &'static Register) {
        if self.is_fine { (&FINE_TARGET, &FINE_POSITION) } else { (&TARGET_POSITION, &PRESENT_POSITION) }
    }

    /// Is the hold over? Either the arm holds, or it was tried often enough.
    pub(crate) const fn is_over(&self) -> bool {
        self.is_done || self.rounds >= MOST_ROUNDS
    }

    /// Has the arm confirmed that it holds?
    pub(crate) const fn is_confirmed(&self) -> bool {
        self.is_done && !self.has_unmeasured
    }

    /// The reply did not come.
    pub(crate) const fn note_no_reply(&mut self) {
        self.waits = false;
    }

    /// The frames to write for this reply.
    pub(crate) fn frames(&mut self, address: u8, values: &[u8], held: &HeldTargets) -> Vec<Frame> {
        self.waits = false;
        let Some(moving) = self.moving else {
            // The set-point of a silent joint stands still, and would go on to its target.
            let moving = values.iter().fold(0, |bits, value| bits | value);
            self.moving = Some(moving);
            self.driven = values.last().copied().unwrap_or_default();
            self.is_done = moving == 0 && !self.is_streaming;
            return Vec::new();
        };
        let is_taken = |(start, wanted): &Frame| {
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

    /// One frame for each row of joints that get a target.
    fn frames_that_hold(&self, moving: u8, address: u8, values: &[u8], held: &HeldTargets) -> Vec<Frame> {
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
            // The points of a stream that are ahead would move a joint which keeps its target.
            *wanted = kept.map_or(position, |kept| self.is_streaming.then_some(kept));
        }
        let present = present.map(Option::unwrap_or_default);
        keep_limits(limits_in(address, values), &present, &mut wanted);
        let mut frames: Vec<Frame> = Vec::new();
        for (joint, wanted) in Joint::ALL.into_iter().zip(wanted) {
            let Some(bytes) = wanted.map(|wanted| self.bytes(wanted)) else { continue };
            match frames.last_mut() {
                Some((first, values))
                    if usize::from(*first) + values.len() == usize::from(targets.of(joint)) =>
                {
                    values.extend(bytes);
                }
                _ => frames.push((targets.of(joint), bytes)),
            }
        }
        frames
    }

    /// The target of a joint that was held before: as it was read, or one that a client wrote meanwhile.
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

#[cfg(test)]
mod tests {
    use super::super::intent::Intent;
    use super::*;

    /// Targets 1..14, and positions of which that of joint 3 was not measured.
    fn values() -> Vec<u8> {
        let mut values: Vec<u8> = (1..15).collect();
        values.extend([21, 22, 23, 24, 0xFF, 0xFF, 25, 26, 27, 28, 29, 30, 31, 32]);
        values
    }

    /// A hold that knows which joints move.
    fn hold(moving: u8, is_streaming: bool) -> ArmHold {
        let mut hold = ArmHold::new(true, is_streaming);
        assert_eq!(hold.next_read(), Some((242, 2)));
        assert_eq!(hold.next_read(), None);
        assert_eq!(hold.frames(242, &[0, moving], &HeldTargets::default()), []);
        hold
    }

    #[test]
    fn joints_that_move_or_are_silent_get_their_positions() {
        let mut hold = hold(0b111_0111, false);
        assert!(!hold.is_over());
        assert_eq!(hold.next_read(), Some((128, 61)));
        let mut values = values();
        let frames = hold.frames(128, &values, &HeldTargets::default());
        assert_eq!(frames, [(128, vec![21, 22, 23, 24]), (136, vec![27, 28, 29, 30, 31, 32])]);
        assert!(!hold.is_over());
        assert_eq!(hold.next_read(), Some((128, 61)));
        values[..4].copy_from_slice(&[21, 22, 23, 24]);
        values[8..14].copy_from_slice(&[27, 28, 29, 30, 31, 32]);
        assert_eq!(hold.frames(128, &values, &HeldTargets::default()), []);
        assert!(hold.is_over());
    }

    #[test]
    fn a_joint_that_moves_and_was_not_measured_is_not_held() {
        for (moving, is_confirmed) in [(0b100, false), (0b1, true)] {
            let mut hold = hold(moving, false);
            for _ in 0..2 {
                assert_eq!(hold.next_read(), Some((128, 61)));
                let mut values = values();
                values[..2].copy_from_slice(&[21, 22]);
                hold.frames(128, &values, &HeldTargets::default());
            }
            assert!(hold.is_over());
            assert_eq!(hold.is_confirmed(), is_confirmed, "{moving:b}");
            let next = hold.for_unmeasured();
            assert_eq!(next.as_ref().map(|next| next.repeats), (!is_confirmed).then_some(MOST_REPEATS - 1));
            let last = next.map(|next| ArmHold { repeats: 0, has_unmeasured: true, ..next });
            assert!(
                last.is_none_or(|last| last.for_unmeasured().is_none()),
                "others have to have their turns"
            );
        }
    }

    #[test]
    fn d24_joints_that_have_reached_their_targets_keep_them() {
        assert!(hold(0, false).is_over(), "nothing is read or written");
        let mut hold = hold(0, true);
        assert_eq!(hold.next_read(), Some((128, 61)));
        let frames = hold.frames(128, &values(), &HeldTargets::default());
        assert_eq!(frames, [(128, (1..15).collect())], "the end of a stream that has points left");
    }

    #[test]
    fn an_arm_without_hundredths_is_held_in_whole_degrees() {
        let mut hold = ArmHold::new(false, false);
        assert_eq!(hold.next_read(), Some((46, 15)));
        hold.note_no_reply();
        assert!(!hold.is_over());
        assert_eq!(hold.next_read(), Some((46, 15)));
        let values = [9, 9, 9, 9, 9, 9, 9, 0, 1, 2, 3, 4, 5, 6, 7];
        assert_eq!(hold.frames(46, &values, &HeldTargets::default()), [(46, vec![1, 2, 3, 4, 5, 6, 7])]);
    }

    #[test]
    fn a_joint_that_brakes_towards_the_target_of_a_stop_keeps_it() {
        let mut held = HeldTargets::default();
        let targets = [Some(0x0201), None, None, None, None, None, None];
        held.note_write(Intent::Stop, &targets);
        let mut values = values();
        values[14..16].copy_from_slice(&[1, 3]);
        let mut braking = hold(0b1, false);
        braking.next_read();
        assert_eq!(braking.frames(128, &values, &held), []);
        assert!(braking.is_over());
        values[14..16].copy_from_slice(&[1, 9]);
        let mut far = hold(0b1, false);
        far.next_read();
        assert_eq!(far.frames(128, &values, &held), [(128, vec![1, 9])], "it moves back from far away");
        held.note_write(Intent::Motion, &[None; 7]);
        values[14..16].copy_from_slice(&[1, 3]);
        let mut moving = hold(0b1, false);
        moving.next_read();
        assert_eq!(moving.frames(128, &values, &held), [(128, vec![1, 3])], "it moves elsewhere");
    }

    #[test]
    fn what_a_client_held_after_the_read_was_sent_is_not_overwritten() {
        let mut held = HeldTargets::default();
        let mut hold = hold(0b11, false);
        hold.next_read();
        let targets = [Some(0x1614), None, None, None, None, None, None];
        held.note_write(Intent::Stop, &targets);
        hold.note_held(&targets);
        assert_eq!(hold.frames(128, &values(), &held), [(130, vec![23, 24])], "the other joint");
    }
}

//! The hub holds the arm by itself: for a client whose watchdog acts ([D24](protocol_core::decisions#d24)), or that sent the
//! command to stop.
//!
//! ```text
//!   read which joints are silent or move ──▶ none: the arm holds
//!     └─▶ read targets and positions ──▶ write the positions of these joints as targets ──▶ read again, until no target differs
//! ```
//!
//! A joint that has reached its target keeps it ([D24](protocol_core::decisions#d24)). Its load draws it some tenths of a degree
//! off its target: with its position as the new target it would sink by as much in each hold.

use protocol_core::registers::Joint;
use protocol_core::registers::map::{
    FINE_POSITION, FINE_TARGET, MISSING_SERVOS, MOVING_JOINTS, PRESENT_POSITION, TARGET_POSITION,
};

/// Reads and writes are repeated this often.
const MOST_ROUNDS: u8 = 5;
/// The value of a fine position that was not measured.
const UNMEASURED: u16 = u16::MAX;

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
    rounds: u8,
    sent: Vec<Frame>,
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
            rounds: 0,
            sent: Vec::new(),
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

    /// The registers to read now, and how many.
    pub(crate) fn next_read(&mut self) -> Option<(u8, u8)> {
        if self.waits {
            return None;
        }
        self.waits = true;
        self.rounds += 1;
        if self.moving.is_none() {
            return Some((MISSING_SERVOS.address, MOVING_JOINTS.address + 1 - MISSING_SERVOS.address));
        }
        let (targets, positions) =
            if self.is_fine { (&FINE_TARGET, &FINE_POSITION) } else { (&TARGET_POSITION, &PRESENT_POSITION) };
        Some((targets.address, positions.address + positions.count - targets.address))
    }

    /// Is the hold over? Either the arm holds, or it was tried often enough.
    pub(crate) const fn is_over(&self) -> bool {
        self.is_done || self.rounds >= MOST_ROUNDS
    }

    /// The reply did not come.
    pub(crate) const fn note_no_reply(&mut self) {
        self.waits = false;
    }

    /// The frames to write for this reply.
    pub(crate) fn frames(&mut self, address: u8, values: &[u8]) -> Vec<Frame> {
        self.waits = false;
        let Some(moving) = self.moving else {
            // The set-point of a silent joint stands still, and would go on to its target.
            let moving = values.iter().fold(0, |bits, value| bits | value);
            self.moving = Some(moving);
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
        self.sent = if self.is_fine {
            self.fine_frames(address, values, moving)
        } else {
            coarse_frames(address, values)
        };
        self.is_done = self.sent.is_empty();
        self.sent.clone()
    }

    /// One frame for each row of joints that have a target.
    fn fine_frames(&self, address: u8, values: &[u8], moving: u8) -> Vec<Frame> {
        let mut frames: Vec<Frame> = Vec::new();
        for joint in Joint::ALL {
            let target = FINE_TARGET.of(joint);
            let value = match moving & joint.bit() {
                0 if self.is_streaming => word(values, address, target),
                0 => None,
                _ => word(values, address, FINE_POSITION.of(joint)),
            };
            let Some(bytes) = value.filter(|&value| value != UNMEASURED).map(u16::to_le_bytes) else {
                continue;
            };
            match frames.last_mut() {
                Some((first, values)) if usize::from(*first) + values.len() == usize::from(target) => {
                    values.extend(bytes);
                }
                _ => frames.push((target, bytes.to_vec())),
            }
        }
        frames
    }
}

/// A register of two bytes in the values from `address` on.
fn word(values: &[u8], address: u8, register: u8) -> Option<u16> {
    let start = usize::from(register.checked_sub(address)?);
    Some(u16::from_le_bytes(*values.get(start..)?.first_chunk()?))
}

fn coarse_frames(address: u8, values: &[u8]) -> Vec<Frame> {
    let start = usize::from(PRESENT_POSITION.address.saturating_sub(address));
    let positions = values.get(start..start + usize::from(PRESENT_POSITION.count));
    positions.map(|positions| (TARGET_POSITION.address, positions.to_vec())).into_iter().collect()
}

#[cfg(test)]
mod tests {
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
        assert_eq!(hold.frames(242, &[0, moving]), []);
        hold
    }

    #[test]
    fn joints_that_move_or_are_silent_get_their_positions() {
        let mut hold = hold(0b111_0111, false);
        assert!(!hold.is_over());
        assert_eq!(hold.next_read(), Some((128, 28)));
        let mut values = values();
        let frames = hold.frames(128, &values);
        assert_eq!(frames, [(128, vec![21, 22, 23, 24]), (136, vec![27, 28, 29, 30, 31, 32])]);
        assert!(!hold.is_over());
        assert_eq!(hold.next_read(), Some((128, 28)));
        values[..4].copy_from_slice(&[21, 22, 23, 24]);
        values[8..14].copy_from_slice(&[27, 28, 29, 30, 31, 32]);
        assert_eq!(hold.frames(128, &values), []);
        assert!(hold.is_over());
    }

    #[test]
    fn d24_joints_that_have_reached_their_targets_keep_them() {
        assert!(hold(0, false).is_over(), "nothing is read or written");
        let mut hold = hold(0, true);
        assert_eq!(hold.next_read(), Some((128, 28)));
        let frames = hold.frames(128, &values());
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
        assert_eq!(hold.frames(46, &values), [(46, vec![1, 2, 3, 4, 5, 6, 7])]);
    }
}

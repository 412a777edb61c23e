//! The hub holds the arm by itself: for a client whose watchdog acts ([D24](protocol_core::decisions#d24)), or that sent the
//! command to stop.
//!
//! ```text
//!   read targets and positions ──▶ write the positions as targets ──▶ read again, until no target differs
//! ```

use protocol_core::registers::Joint;
use protocol_core::registers::map::{FINE_POSITION, FINE_TARGET, PRESENT_POSITION, TARGET_POSITION};

/// Reads and writes are repeated this often.
const MOST_ROUNDS: u8 = 5;
/// The value of a fine position that was not measured.
const UNMEASURED: u16 = u16::MAX;

/// A frame to write: the first register, and the values.
pub(crate) type Frame = (u8, Vec<u8>);

/// A hold in progress.
#[derive(Debug)]
pub(crate) struct ArmHold {
    /// The arm has positions in hundredths of a degree.
    is_fine: bool,
    rounds: u8,
    sent: Vec<Frame>,
    /// Its read has no reply yet.
    waits: bool,
}

impl ArmHold {
    pub(crate) const fn new(is_fine: bool) -> Self {
        Self { is_fine, rounds: 0, sent: Vec::new(), waits: false }
    }

    /// The registers to read now, and how many.
    pub(crate) fn next_read(&mut self) -> Option<(u8, u8)> {
        if self.waits {
            return None;
        }
        self.waits = true;
        self.rounds += 1;
        let (targets, positions) =
            if self.is_fine { (&FINE_TARGET, &FINE_POSITION) } else { (&TARGET_POSITION, &PRESENT_POSITION) };
        Some((targets.address, positions.address + positions.count - targets.address))
    }

    /// Is the hold over? Either the arm took the targets, or it was tried often enough.
    pub(crate) fn is_over(&self, replied: &[Frame]) -> bool {
        replied.is_empty() || self.rounds >= MOST_ROUNDS
    }

    /// The reply did not come. Returns whether it is tried again.
    pub(crate) fn note_no_reply(&mut self) -> bool {
        self.waits = false;
        self.rounds < MOST_ROUNDS
    }

    /// The frames to write for this reply; none if the arm has taken those of the reply before.
    pub(crate) fn frames(&mut self, address: u8, values: &[u8]) -> Vec<Frame> {
        self.waits = false;
        let is_taken = |(start, wanted): &Frame| {
            let place = usize::from(start.saturating_sub(address));
            values.get(place..place + wanted.len()) == Some(wanted.as_slice())
        };
        if !self.sent.is_empty() && self.sent.iter().all(is_taken) {
            return Vec::new();
        }
        self.sent = if self.is_fine { fine_frames(address, values) } else { coarse_frames(address, values) };
        self.sent.clone()
    }
}

fn coarse_frames(address: u8, values: &[u8]) -> Vec<Frame> {
    let start = usize::from(PRESENT_POSITION.address.saturating_sub(address));
    let positions = values.get(start..start + usize::from(PRESENT_POSITION.count));
    positions.map(|positions| (TARGET_POSITION.address, positions.to_vec())).into_iter().collect()
}

/// One frame for each row of joints that were measured.
fn fine_frames(address: u8, values: &[u8]) -> Vec<Frame> {
    let mut frames: Vec<Frame> = Vec::new();
    for joint in Joint::ALL {
        let start = usize::from(FINE_POSITION.of(joint).saturating_sub(address));
        let Some(&[low, high]) = values.get(start..start + 2) else { continue };
        if u16::from_le_bytes([low, high]) == UNMEASURED {
            continue;
        }
        let target = FINE_TARGET.of(joint);
        match frames.last_mut() {
            Some((first, values)) if usize::from(*first) + values.len() == usize::from(target) => {
                values.extend([low, high]);
            }
            _ => frames.push((target, vec![low, high])),
        }
    }
    frames
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_that_were_not_measured_get_no_target() {
        let mut values = vec![0; 28];
        values[14..].copy_from_slice(&[1, 2, 3, 4, 0xFF, 0xFF, 5, 6, 7, 8, 9, 10, 11, 12]);
        let mut hold = ArmHold::new(true);
        assert_eq!(hold.next_read(), Some((128, 28)));
        assert_eq!(hold.next_read(), None);
        let frames = hold.frames(128, &values);
        assert_eq!(frames, [(128, vec![1, 2, 3, 4]), (134, vec![5, 6, 7, 8, 9, 10, 11, 12])]);
        assert!(!hold.is_over(&frames));
        assert_eq!(hold.next_read(), Some((128, 28)));
        values[..4].copy_from_slice(&[1, 2, 3, 4]);
        values[6..14].copy_from_slice(&[5, 6, 7, 8, 9, 10, 11, 12]);
        let frames = hold.frames(128, &values);
        assert!(hold.is_over(&frames) && frames.is_empty());
    }

    #[test]
    fn an_arm_without_hundredths_is_held_in_whole_degrees() {
        let mut hold = ArmHold::new(false);
        assert_eq!(hold.next_read(), Some((46, 15)));
        assert!(hold.note_no_reply());
        let values = [9, 9, 9, 9, 9, 9, 9, 0, 1, 2, 3, 4, 5, 6, 7];
        assert_eq!(hold.frames(46, &values), [(46, vec![1, 2, 3, 4, 5, 6, 7])]);
    }
}

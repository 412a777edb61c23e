//! Some of the joints: targets for those, and stopping where the arm is.
//!
//! Knows which joints may be written to, not why somebody wants them to move or to stop.

use protocol_core::registers::map::{PRESENT_POSITION, TARGET_POSITION};
use protocol_core::registers::{Joint, Register};

use crate::arm::Arm;
use crate::error::Error;
use crate::snapshot::Span;

impl Arm {
    /// Makes every joint hold where it is.
    ///
    /// A joint whose servo does not answer is left out: its measured position may be an old one, or none at
    /// all, and it would be driven there as soon as it answers again (D12).
    ///
    /// # Errors
    /// As [`Arm::read`] and [`Arm::write`].
    pub fn hold(&mut self) -> Result<(), Error> {
        let missing = self.status()?.map_or(0, |status| status.missing());
        let present = self.read_span(Span::of(&PRESENT_POSITION))?;
        let is_there = |joint: Joint| missing & joint.bit() == 0;
        let target = |joint| is_there(joint).then(|| present.at(PRESENT_POSITION.of(joint)));
        for (address, positions) in frames_for(&TARGET_POSITION, &Joint::ALL.map(target)) {
            self.write(address, &positions)?;
        }
        Ok(())
    }
}

/// The writes that give new values to some of a row's joints, joint 1 first, and leave the others alone: one
/// frame for each run of neighbours.
#[must_use]
pub fn frames_for(row: &Register, values: &[Option<u8>; 7]) -> Vec<(u8, Vec<u8>)> {
    let pairs: Vec<_> = Joint::ALL.into_iter().zip(values).collect();
    let runs = pairs.chunk_by(|one, next| one.1.is_some() == next.1.is_some());
    let frame = |run: &[(Joint, &Option<u8>)]| {
        let values: Vec<u8> = run.iter().filter_map(|(_, value)| **value).collect();
        let (first, _) = run.first()?;
        (!values.is_empty()).then(|| (row.of(*first), values))
    };
    runs.filter_map(frame).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_that_are_left_out_are_not_written_to() {
        let frames = |left_out: &[u8]| {
            let value = |joint: Joint| (!left_out.contains(&joint.number())).then_some(joint.number());
            frames_for(&TARGET_POSITION, &Joint::ALL.map(value))
        };
        assert_eq!(frames(&[]), [(46, vec![1, 2, 3, 4, 5, 6, 7])]);
        assert_eq!(frames(&[3, 7]), [(46, vec![1, 2]), (49, vec![4, 5, 6])]);
        assert_eq!(frames(&[1, 2, 3, 4, 5, 6, 7]), []);
    }
}

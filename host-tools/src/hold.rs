//! Stopping where the arm is: targets become measured positions.
//!
//! Knows which joints may be written to, not why somebody wants them to stop.

use protocol_core::registers::Joint;
use protocol_core::registers::map::{PRESENT_POSITION, TARGET_POSITION};

use crate::arm::Arm;
use crate::error::Error;
use crate::snapshot::{Snapshot, Span};

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
        for (first, positions) in runs(&present, missing) {
            self.write(TARGET_POSITION.of(first), &positions)?;
        }
        Ok(())
    }
}

/// The measured positions of the joints that are not missing, one run of neighbours a frame.
fn runs(present: &Snapshot, missing: u8) -> Vec<(Joint, Vec<u8>)> {
    let is_missing = |joint: &Joint| missing & joint.bit() != 0;
    let stretches = Joint::ALL.chunk_by(|one, next| is_missing(one) == is_missing(next));
    let driven = stretches.filter(|joints| joints.iter().all(|joint| !is_missing(joint)));
    let position = |joint: &Joint| present.at(PRESENT_POSITION.of(*joint));
    driven.filter_map(|run| Some((*run.first()?, run.iter().map(position).collect()))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_joint_is_not_written_to() {
        let present = Snapshot { address: PRESENT_POSITION.address, values: vec![1, 2, 0, 4, 5, 6, 0] };
        let written = |missing| -> Vec<(u8, Vec<u8>)> {
            runs(&present, missing).into_iter().map(|(joint, values)| (joint.number(), values)).collect()
        };
        assert_eq!(written(0), [(1, vec![1, 2, 0, 4, 5, 6, 0])]);
        assert_eq!(written(0b100_0100), [(1, vec![1, 2]), (4, vec![4, 5, 6])]);
        assert_eq!(written(0b111_1111), []);
    }
}

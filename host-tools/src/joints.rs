//! Some of the joints: targets for those, and stopping where the arm is.
//!
//! Knows which joints may be written to, not why somebody wants them to move or to stop.

use std::thread::sleep;
use std::time::{Duration, Instant};

use protocol_core::registers::map::{PRESENT_POSITION, TARGET_POSITION};
use protocol_core::registers::{Joint, Register};

use crate::arm::Arm;
use crate::error::Error;
use crate::snapshot::{Snapshot, Span};

/// So long after its start an arm has measured a joint, or calls it missing (D12), with time for the answer.
const START_UP: Duration = Duration::from_millis(700);
/// Time between two looks at an arm that starts.
const LOOK_EVERY: Duration = Duration::from_millis(20);

impl Arm {
    /// Makes every joint hold where it is.
    ///
    /// A joint whose servo does not answer is left out: its measured position may be an old one, or none at
    /// all, and it would be driven there as soon as it answers again (D12). A joint that may not be measured
    /// yet, because the arm was just switched on, is waited for.
    ///
    /// # Errors
    /// As [`Arm::read`] and [`Arm::write`].
    pub fn hold(&mut self) -> Result<(), Error> {
        let now = self.stand()?;
        self.hold_joints(&now, |joint| !now.is_doubtful(joint))?;
        if now.is_clear() {
            return Ok(());
        }
        let later = self.wait_for_positions()?;
        self.hold_joints(&later, |joint| now.is_doubtful(joint))
    }

    /// Waits until the arm knows where its joints are, which after its start takes up to half a second. Its
    /// targets then are where it stands, if nobody has written others (D12).
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn wait_until_measured(&mut self) -> Result<(), Error> {
        self.wait_for_positions().map(drop)
    }

    fn wait_for_positions(&mut self) -> Result<Stand, Error> {
        let deadline = Instant::now() + START_UP;
        loop {
            let stand = self.stand()?;
            if stand.is_clear() || Instant::now() >= deadline {
                return Ok(stand);
            }
            sleep(LOOK_EVERY);
        }
    }

    fn stand(&mut self) -> Result<Stand, Error> {
        let missing = self.status()?.map_or(0, |status| status.missing());
        let registers = self.read_span(Span::between(&TARGET_POSITION, &PRESENT_POSITION))?;
        Ok(Stand { missing, registers })
    }

    fn hold_joints(&mut self, stand: &Stand, is_meant: impl Fn(Joint) -> bool) -> Result<(), Error> {
        let held = |joint| is_meant(joint) && !stand.is_missing(joint);
        let targets = Joint::ALL.map(|joint| held(joint).then(|| stand.present(joint)));
        for (address, positions) in frames_for(&TARGET_POSITION, &targets) {
            self.write(address, &positions)?;
        }
        Ok(())
    }
}

/// Where an arm's joints are, and should be.
struct Stand {
    missing: u8,
    /// Targets to present positions.
    registers: Snapshot,
}

impl Stand {
    fn is_missing(&self, joint: Joint) -> bool {
        self.missing & joint.bit() != 0
    }

    fn present(&self, joint: Joint) -> u8 {
        self.registers.at(PRESENT_POSITION.of(joint))
    }

    fn is_clear(&self) -> bool {
        !Joint::ALL.into_iter().any(|joint| self.is_doubtful(joint))
    }

    /// A position reads 0 until it is measured. Whose target is 0 as well is there.
    fn is_doubtful(&self, joint: Joint) -> bool {
        let target = self.registers.at(TARGET_POSITION.of(joint));
        self.present(joint) == 0 && target != 0 && !self.is_missing(joint)
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

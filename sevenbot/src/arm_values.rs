//! Positions and targets of all joints, as typed values.

use protocol_core::registers::Joint;
use protocol_core::registers::map::{PRESENT_POSITION, TARGET_POSITION};

use crate::arm::Arm;
use crate::error::Error;
use crate::units::Angle;
use host_link::Span;

impl Arm {
    /// The present positions, joint 1 first.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn positions(&mut self) -> Result<[Angle; 7], Error> {
        let snapshot = self.read_span(Span::of(&PRESENT_POSITION))?;
        Ok(snapshot.joints(&PRESENT_POSITION).map(Angle::from_register))
    }

    /// The target positions, joint 1 first.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn targets(&mut self) -> Result<[Angle; 7], Error> {
        let snapshot = self.read_span(Span::of(&TARGET_POSITION))?;
        Ok(snapshot.joints(&TARGET_POSITION).map(Angle::from_register))
    }

    /// Sets the target of one joint.
    ///
    /// # Errors
    /// As [`Arm::write`].
    pub fn set_target(&mut self, joint: Joint, angle: Angle) -> Result<(), Error> {
        self.write(TARGET_POSITION.of(joint), &[angle.degrees()])
    }

    /// Sets the targets of all joints, joint 1 first. They start together.
    ///
    /// # Errors
    /// As [`Arm::write`].
    pub fn set_targets(&mut self, pose: [Angle; 7]) -> Result<(), Error> {
        self.write(TARGET_POSITION.address, &pose.map(Angle::degrees))
    }
}

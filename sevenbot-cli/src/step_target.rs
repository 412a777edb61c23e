//! The target of a relative step.

use std::fmt::Display;

use sevenbot::Joint;
use sevenbot::joints::{JointSnapshot, StepBaseError};

use crate::command_error::CommandError;

/// The target after a relative step, in degrees. It may be out of range.
pub(crate) fn step_target(joints: &JointSnapshot, joint: Joint, degrees: i16) -> Result<i16, CommandError> {
    let base = joints.step_base(joint).map_err(|reason| {
        let advice = match reason {
            StepBaseError::Silent => "",
            StepBaseError::PowerUpTarget { .. } => "; `sevenbot stop` sets its target to its position",
        };
        CommandError::Arm(format!(
            "joint {} cannot make a step: {reason}{advice}; nothing was moved",
            joint.number()
        ))
    })?;
    Ok(i16::from(base).saturating_add(degrees))
}

/// The error of a step that leaves the range of the joint.
pub(crate) fn out_of_range(joint: Joint, degrees: impl Display) -> CommandError {
    let number = joint.number();
    CommandError::Arm(format!("joint {number} would go to {degrees}°: it takes 0 to 180; nothing was moved"))
}

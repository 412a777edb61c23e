//! The joints at one instant: which positions are measured, and from where a relative step starts.
//!
//! ```text
//!   motor state, targets, positions, missing and moving joints ──▶ JointSnapshot ──▶ base of a relative step
//!                                                                              └──▶ targets that hold the arm
//! ```
//!
//! Position 0 is either 0 degrees or a joint that was never measured: in the first half second after power-up, or because its
//! servo is silent. Only the extended block tells the two apart. On other arms, start-up is over for a joint if one of these
//! holds. Then the joint is measured or its servo is silent:
//!
//! - Register 242 lists a missing servo, because the arm lists one only after start-up.
//! - The joint is at rest with target 0, which is not the default of any joint in this project's firmware.
//! - 700 ms have passed since the first read.

use std::time::Duration;

use protocol_core::registers::map::{MOTOR_STATE, PRESENT_POSITION, SPEED, TARGET_POSITION, motor_state};
use protocol_core::registers::{Joint, Register};

use crate::arm::Arm;
use crate::error::Error;
use crate::status_block::StatusBlock;
use crate::units::Speed;
use host_link::{Snapshot, Span};

/// After power-up the arm measures each joint or finds it missing within 500 ms ([D12](protocol_core::decisions#d12)).
/// The other 200 ms are for the reply.
pub const START_UP_TIME: Duration = Duration::from_millis(700);
/// Time between two reads during start-up.
pub(crate) const POLL_PERIOD: Duration = Duration::from_millis(20);
/// A joint within this distance of its target has arrived: a loaded servo stops a few degrees short.
const AT_TARGET_DEGREES: u8 = 5;

/// Why the base of a relative step is unknown.
///
/// ```
/// assert_eq!(sevenbot::joints::StepBaseError::Silent.to_string(), "its servo does not answer");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StepBaseError {
    /// Its servo does not answer, so its position is unknown.
    #[error("its servo does not answer")]
    Silent,
    /// Its target may be the default of power-up, and the joint is elsewhere.
    #[error("it is at {present}°, and its target of {target}° may be the default of power-up")]
    PowerUpTarget {
        /// The target in degrees.
        target: u8,
        /// The present position in degrees.
        present: u8,
    },
}

/// These joints, as [`Joint::bit`]s.
pub(crate) fn bits(joints: impl IntoIterator<Item = Joint>) -> u8 {
    joints.into_iter().fold(0, |bits, joint| bits | joint.bit())
}

/// The joints with a target, as [`Joint::bit`]s.
pub(crate) fn joints_of<T>(targets: &[Option<T>; 7]) -> u8 {
    let joints = Joint::ALL.into_iter().zip(targets).filter(|(_, target)| target.is_some());
    bits(joints.map(|(joint, _)| joint))
}

impl Arm {
    /// Reads the joints, and before them the status block if the firmware has one.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn joints(&mut self) -> Result<JointSnapshot, Error> {
        let status = self.status()?;
        Ok(JointSnapshot::new(self.read_span(JointSnapshot::REGISTERS)?, status))
    }

    /// Waits up to 0.7 s until no joint has the default target of power-up and stands elsewhere. The arm replaces these
    /// targets within half a second ([D12](protocol_core::decisions#d12)). Returns the joints at the end of the wait.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn wait_until_settled(&mut self) -> Result<JointSnapshot, Error> {
        let deadline = self.now() + START_UP_TIME;
        loop {
            let joints = self.joints()?;
            let is_settled = !Joint::ALL.into_iter().any(|joint| joints.has_power_up_target(joint));
            if is_settled || self.now() >= deadline {
                return Ok(joints);
            }
            self.sleep(POLL_PERIOD);
        }
    }
}

/// All joints of an arm, and its status block if the firmware has one.
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let mut arm = sevenbot::Arm::open("/dev/ttyUSB0", 115_200)?;
/// println!("{:?}", arm.hold()?.positions());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointSnapshot {
    /// Holds at least [`Self::REGISTERS`].
    registers: Snapshot,
    /// `None` from firmware without a status block.
    pub(crate) status: Option<StatusBlock>,
}

impl JointSnapshot {
    /// The registers of a snapshot, from the motor state to the present positions.
    pub const REGISTERS: Span = Span::between(&MOTOR_STATE, &PRESENT_POSITION);

    /// From a read that holds [`Self::REGISTERS`], and the status block if the firmware has one.
    #[must_use]
    pub const fn new(registers: Snapshot, status: Option<StatusBlock>) -> Self {
        Self { registers, status }
    }

    /// The status block; `None` if the firmware has none.
    #[must_use]
    pub const fn status(&self) -> Option<&StatusBlock> {
        self.status.as_ref()
    }

    /// Register 29, see [`motor_state`].
    #[must_use]
    pub fn motor_state(&self) -> u8 {
        self.registers.byte(&MOTOR_STATE)
    }

    /// Do the motors drive the joints?
    #[must_use]
    pub fn is_driven(&self) -> bool {
        self.motor_state() == motor_state::SERVO
    }

    /// The target position in degrees.
    #[must_use]
    pub fn target(&self, joint: Joint) -> u8 {
        self.registers.at(TARGET_POSITION.of(joint))
    }

    /// The present position in degrees; also 0 if the joint was never measured.
    #[must_use]
    pub fn present(&self, joint: Joint) -> u8 {
        self.registers.at(PRESENT_POSITION.of(joint))
    }

    /// The target positions in degrees, joint 1 first.
    #[must_use]
    pub fn targets(&self) -> [u8; 7] {
        self.registers.joints(&TARGET_POSITION)
    }

    /// The present positions in degrees, joint 1 first.
    #[must_use]
    pub fn positions(&self) -> [u8; 7] {
        self.registers.joints(&PRESENT_POSITION)
    }

    /// The joints whose servo does not answer, as [`Joint::bit`]s; 0 without a status block.
    #[must_use]
    pub fn missing(&self) -> u8 {
        self.status.as_ref().map_or(0, StatusBlock::missing)
    }

    /// The speed of the joint's moves.
    #[must_use]
    pub fn speed(&self, joint: Joint) -> Speed {
        Speed::from_steps(self.registers.at(SPEED.of(joint))).unwrap_or(Speed::MAXIMUM)
    }

    /// Does the joint's servo not answer? `false` without a status block.
    #[must_use]
    pub fn is_missing(&self, joint: Joint) -> bool {
        self.missing() & joint.bit() != 0
    }

    /// Does the joint's set-point move? `false` without a status block.
    #[must_use]
    pub fn is_moving(&self, joint: Joint) -> bool {
        self.status.as_ref().is_some_and(|status| status.is_moving(joint))
    }

    /// Has the controller restarted since this earlier instant, a few seconds ago at most? `false` without a status block.
    #[must_use]
    pub fn has_restarted_since(&self, before: &Self) -> bool {
        let statuses = before.status.as_ref().zip(self.status.as_ref());
        statuses.is_some_and(|(before, after)| after.has_restarted_since(before))
    }

    /// The base of a relative step of this joint: its target, in degrees.
    ///
    /// # Errors
    /// The joint's position or its target is unknown.
    pub fn step_base(&self, joint: Joint) -> Result<u8, StepBaseError> {
        let (target, present) = (self.target(joint), self.present(joint));
        match () {
            () if self.is_missing(joint) => Err(StepBaseError::Silent),
            () if self.has_power_up_target(joint) => Err(StepBaseError::PowerUpTarget { target, present }),
            () => Ok(target),
        }
    }

    /// Is the target possibly the default of power-up, with the joint elsewhere?
    fn has_power_up_target(&self, joint: Joint) -> bool {
        let (target, present) = (self.target(joint), self.present(joint));
        // The maker's firmware may start with other targets, probably 0.
        let is_default = target == TARGET_POSITION.default_at(TARGET_POSITION.of(joint))
            || (self.status.is_none() && target == 0);
        is_default
            && self.is_driven()
            && !self.is_missing(joint)
            && !self.is_moving(joint)
            && target.abs_diff(present) > AT_TARGET_DEGREES
    }

    /// Is position 0 possibly a joint that is not measured yet?
    pub(crate) fn may_be_unmeasured(&self, joint: Joint, is_past_start_up: bool) -> bool {
        let is_start_up_over = is_past_start_up || self.missing() != 0;
        // The default target is not 0, and a joint with a target from the host moves during start-up.
        let was_measured = self.target(joint) == 0 && !self.is_moving(joint);
        self.present(joint) == 0 && !is_start_up_over && !was_measured
    }
}

/// One write for each run of neighbouring joints with a value, joint 1 first: address and values.
#[must_use]
pub fn frames_for(row: &Register, values: &[Option<u8>; 7]) -> Vec<(u8, Vec<u8>)> {
    frames_of(row, &values.map(|value| value.map(|byte| [byte])))
}

/// As [`frames_for`], with values of `N` bytes.
pub(crate) fn frames_of<const N: usize>(row: &Register, values: &[Option<[u8; N]>; 7]) -> Vec<(u8, Vec<u8>)> {
    let pairs: Vec<_> = Joint::ALL.into_iter().zip(values).collect();
    let runs = pairs.chunk_by(|one, next| one.1.is_some() == next.1.is_some());
    let frame = |run: &[(Joint, &Option<[u8; N]>)]| {
        let values: Vec<u8> = run.iter().filter_map(|(_, value)| **value).flatten().collect();
        let (first, _) = run.first()?;
        (!values.is_empty()).then(|| (row.of(*first), values))
    };
    runs.filter_map(frame).collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use protocol_core::registers::map::{MISSING_SERVOS, MOVING_JOINTS};

    pub(crate) const POSE: [u8; 7] = [120, 90, 65, 90, 90, 90, 80];

    pub(crate) fn joint_snapshot(
        targets: [u8; 7],
        positions: [u8; 7],
        missing: u8,
        moving: u8,
    ) -> JointSnapshot {
        let mut registers = Snapshot { address: MOTOR_STATE.address, values: vec![0; 32] };
        registers.values[0] = motor_state::SERVO;
        registers.values[17..24].copy_from_slice(&targets);
        registers.values[25..32].copy_from_slice(&positions);
        let mut status = Snapshot { address: 240, values: vec![0; 16] };
        status.values[usize::from(MISSING_SERVOS.address - 240)] = missing;
        status.values[usize::from(MOVING_JOINTS.address - 240)] = moving;
        JointSnapshot { registers, status: Some(StatusBlock::from(status)) }
    }

    pub(crate) fn power_up(positions: [u8; 7], missing: u8, moving: u8) -> JointSnapshot {
        joint_snapshot(TARGET_POSITION.default_bytes(), positions, missing, moving)
    }

    #[test]
    fn the_default_target_is_no_base_of_a_step() {
        let base = |joints: &JointSnapshot| joints.step_base(Joint::ALL[0]);
        assert_eq!(
            base(&power_up(POSE, 0, 0)),
            Err(StepBaseError::PowerUpTarget { target: 90, present: 120 })
        );
        assert_eq!(
            base(&power_up([0; 7], 0, 0)),
            Err(StepBaseError::PowerUpTarget { target: 90, present: 0 })
        );
        assert_eq!(base(&power_up(POSE, 1, 0)), Err(StepBaseError::Silent));
        assert_eq!(base(&power_up(POSE, 0, 1)), Ok(90), "on its way there");
        assert_eq!(base(&power_up([92, 90, 65, 90, 90, 90, 80], 0, 0)), Ok(90), "it stands there");
        assert_eq!(
            base(&joint_snapshot([100, 90, 65, 90, 90, 90, 80], POSE, 0, 0)),
            Ok(100),
            "no power-up value"
        );
        assert_eq!(base(&joint_snapshot([0; 7], [0; 7], 0, 0)), Ok(0), "0 degrees is a position");
    }

    #[test]
    fn joints_without_a_value_are_not_written() {
        let frames = |left_out: &[u8]| {
            let value = |joint: Joint| (!left_out.contains(&joint.number())).then_some(joint.number());
            frames_for(&TARGET_POSITION, &Joint::ALL.map(value))
        };
        assert_eq!(frames(&[]), [(46, vec![1, 2, 3, 4, 5, 6, 7])]);
        assert_eq!(frames(&[3, 7]), [(46, vec![1, 2]), (49, vec![4, 5, 6])]);
        assert_eq!(frames(&[1, 2, 3, 4, 5, 6, 7]), []);
    }
}

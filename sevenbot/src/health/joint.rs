//! The health of one joint.

use protocol_core::registers::map::{
    BLOCKED_JOINTS, EFFECTOR_TYPE, FINE_POSITION, FINE_TARGET, GRIP_LIMIT, LET_GO_JOINTS, LOAD,
    MEASURED_JOINTS, MISSING_SERVOS, MOTOR_STATE, MOVING_JOINTS, PRESENT_POSITION, TARGET_POSITION, VELOCITY,
    effector, motor_state,
};
use protocol_core::registers::{Joint, Register};

use super::problem::ProblemKind;
use crate::fine_angle::FineAngle;
use crate::units::Angle;
use host_link::Snapshot;

/// The claw. While the effector is a gripper, an obstacle of this joint is a held object.
pub(super) const CLAW: Option<Joint> = Joint::new(7);
/// A joint at rest within this distance of its target counts as there: under a load a servo stops a few degrees short.
const AT_TARGET_DEGREES: f64 = 3.0;

/// One joint at one instant. A value is `None` where the firmware does not tell it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointHealth {
    /// The joint that the other values are about.
    pub joint: Joint,
    /// The target, in whole degrees from firmware without the extended block.
    pub target: FineAngle,
    /// The measured position; of a silent joint, the last one. `None` if the joint was never measured. Firmware without the
    /// extended block gives whole degrees, and 0 for a joint that was never measured.
    pub position: Option<FineAngle>,
    /// The velocity in degrees per second, positive towards greater angles.
    pub velocity: Option<f64>,
    /// The load in percent of the stall torque, positive if the motor pushes towards greater angles.
    pub load_percent: Option<f64>,
    /// Does the set-point move?
    pub is_moving: Option<bool>,
    /// Does the servo not answer?
    pub is_silent: Option<bool>,
    /// Does an obstacle keep the joint from its target ([D27](protocol_core::decisions#d27))? Never true for a gripper,
    /// which may hold something.
    pub is_blocked: Option<bool>,
    /// Does the gripper hold something? Something stopped it, and its load is at least half of the grip limit.
    pub is_gripping: Option<bool>,
    /// Does the servo hold no torque although it should ([D28](protocol_core::decisions#d28))?
    pub has_let_go: Option<bool>,
    /// Is the joint driven, at rest as far as the firmware tells, and within 3 degrees of its target?
    pub is_at_target: bool,
}

impl JointHealth {
    pub(super) fn new(joint: Joint, registers: &Snapshot) -> Self {
        let [is_fine, has_status, is_protected] =
            [registers.has_extended_block(), registers.has_status_block(), registers.has_protection_block()];
        let bit = |is_told: bool, row: &Register| is_told.then(|| registers.byte(row) & joint.bit() != 0);
        let tenths =
            |row: &Register| is_fine.then(|| f64::from(registers.word(row.of(joint)).cast_signed()) / 10.0);
        let (target, position) = if is_fine { fine(joint, registers) } else { whole(joint, registers) };
        let is_moving = bit(has_status, &MOVING_JOINTS);
        let is_gripper = CLAW == Some(joint) && registers.byte(&EFFECTOR_TYPE) == effector::GRIPPER;
        let is_stopped = bit(is_protected, &BLOCKED_JOINTS);
        let load_percent = tenths(&LOAD);
        let least_grip = f64::from(registers.byte(&GRIP_LIMIT)) / 2.0;
        let presses = load_percent.is_none_or(|percent| percent.abs() >= least_grip);
        let is_near = position
            .is_some_and(|position| (position.degrees() - target.degrees()).abs() <= AT_TARGET_DEGREES);
        Self {
            joint,
            target,
            position,
            velocity: tenths(&VELOCITY),
            load_percent,
            is_moving,
            is_silent: bit(has_status, &MISSING_SERVOS),
            is_blocked: is_stopped.map(|stopped| stopped && !is_gripper),
            is_gripping: is_stopped.map(|stopped| stopped && is_gripper && presses),
            has_let_go: bit(is_protected, &LET_GO_JOINTS),
            is_at_target: is_near
                && is_moving != Some(true)
                && registers.byte(&MOTOR_STATE) == motor_state::SERVO,
        }
    }

    /// What is wrong with the joint, the most important first.
    pub fn problems(&self) -> impl Iterator<Item = ProblemKind> + use<> {
        let rows = [
            (self.is_silent, ProblemKind::NoAnswer),
            (self.has_let_go, ProblemKind::LetGo),
            (self.is_blocked, ProblemKind::Blocked),
        ];
        rows.into_iter().filter(|(is_so, _)| *is_so == Some(true)).map(|(_, kind)| kind)
    }

    /// What the joint does: its most important problem, or `holds something`, `moving`, `at its target`, `not measured`,
    /// `3.2° from its target`. Empty if there is no problem and the motors are off.
    #[must_use]
    pub fn word(&self, is_driven: bool) -> String {
        if let Some(problem) = self.problems().next() {
            return problem.name().to_owned();
        }
        match (is_driven, self.is_moving, self.position) {
            (false, ..) => String::new(),
            _ if self.is_gripping == Some(true) => "holds something".to_owned(),
            (_, Some(true), _) => "moving".to_owned(),
            _ if self.is_at_target => "at its target".to_owned(),
            (.., None) => "not measured".to_owned(),
            (.., Some(position)) => {
                let away = (position.degrees() - self.target.degrees()).abs();
                format!("{away:.1}° from its target")
            }
        }
    }
}

/// Target and position in hundredths of a degree.
fn fine(joint: Joint, registers: &Snapshot) -> (FineAngle, Option<FineAngle>) {
    let angle = |row: &Register| FineAngle::from_hundredths(registers.word(row.of(joint)));
    let is_measured = registers.byte(&MEASURED_JOINTS) & joint.bit() != 0;
    let target = angle(&FINE_TARGET).unwrap_or_else(|| Angle::from_register(0).into());
    (target, angle(&FINE_POSITION).filter(|_| is_measured))
}

/// Target and position in whole degrees.
fn whole(joint: Joint, registers: &Snapshot) -> (FineAngle, Option<FineAngle>) {
    let angle = |row: &Register| Angle::from_register(registers.at(row.of(joint))).into();
    (angle(&TARGET_POSITION), Some(angle(&PRESENT_POSITION)))
}

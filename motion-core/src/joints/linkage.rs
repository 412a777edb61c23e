//! Joints 2 and 3 keep the limits of the linkage ([D25](protocol_core::decisions#d25)).

use protocol_core::registers::map::{LIMITS, MOTOR_STATE, limit, motor_state};
use protocol_core::registers::{Joint, RegisterFile};

use super::Joints;
use crate::calibration::MicroDegrees;
use crate::joint_state::{JointState, Measured};
use crate::limit_check::LimitCheck;
use crate::limits::linkage_step;
use crate::motor_state::MotorState;

impl Joints {
    /// The lowest register for which a limit refuses a write; `None` if no limit refuses it
    /// ([D25](protocol_core::decisions#d25)).
    pub(crate) fn against_limit(&self, check: &LimitCheck<'_>) -> Option<u8> {
        let enters_servo = self.state != MotorState::Servo
            && check.accepted.value_at(MOTOR_STATE.address) == Some(motor_state::SERVO);
        let target = |state: &JointState| {
            let measured = if enters_servo { state.known_angle() } else { None };
            Some(measured.unwrap_or(state.target()))
        };
        let set_point = |state: &JointState| state.drive.has_set_point().then_some(state.drive.set_point());
        check.first_refused(&self.joints.each_ref().map(target), &self.joints.each_ref().map(set_point))
    }

    /// The set-points of joints 2 and 3, if both have one and the linkage limits them.
    pub(super) fn kept_linkage(&self, registers: &RegisterFile) -> Option<[MicroDegrees; 2]> {
        let keeps_linkage = registers.get(LIMITS.address) & limit::LINKAGE != 0;
        if keeps_linkage { self.linkage_set_points() } else { None }
    }

    /// The set-points of joints 2 and 3, if both have one.
    fn linkage_set_points(&self) -> Option<[MicroDegrees; 2]> {
        let [_, two, three, ..] = &self.joints;
        let both = two.drive.has_set_point() && three.drive.has_set_point();
        both.then(|| [two.drive.set_point(), three.drive.set_point()])
    }

    /// Lets joints 2 and 3 wait for each other where their step would break the linkage
    /// ([D25](protocol_core::decisions#d25)). A joint that gives way to an obstacle does not wait, because it would go
    /// on pushing until its servo switches itself off ([D27](protocol_core::decisions#d27)).
    pub(super) fn keep_linkage(
        &mut self,
        before: [MicroDegrees; 2],
        gives_way: impl Fn(&JointState, MicroDegrees) -> bool,
    ) {
        let Some(after) = self.linkage_set_points() else { return };
        let allowed = linkage_step(before, after);
        let [_, two, three, ..] = &mut self.joints;
        for ((joint, before), (after, allowed)) in
            [two, three].into_iter().zip(before).zip(after.into_iter().zip(allowed))
        {
            if allowed != after && !gives_way(joint, before) {
                joint.drive.hold_back(allowed);
            }
        }
    }

    /// Moves the set-point to where the joint is, after the joint turned past the set-point. Otherwise the servo would turn
    /// the joint back ([D27](protocol_core::decisions#d27)). The linkage goes first: from outside, set-points go only inwards
    /// ([D25](protocol_core::decisions#d25)).
    #[inline(never)]
    pub(super) fn catch_up(&mut self, joint: Joint, registers: &RegisterFile) -> Measured {
        let before = self.kept_linkage(registers);
        self.joint_mut(joint).into_iter().for_each(JointState::catch_up);
        if let Some(before) = before {
            self.keep_linkage(before, |_, _| false);
        }
        Measured::ServoChanged
    }
}

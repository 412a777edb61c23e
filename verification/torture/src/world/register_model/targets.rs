//! The targets: as the host wrote them, or as the arm set them (D12, D13, D24).

use motion_core::calibration::{MicroDegrees, counts_from_angle};
use protocol_core::registers::map::{MOTOR_STATE, TARGET_POSITION, motor_state};
use protocol_core::registers::{Joint, RegisterFile};

use super::RegisterModel;
use crate::per_joint::PerJoint;

impl RegisterModel {
    /// The host set the target of a joint.
    pub(super) fn set_target(&mut self, joint: Joint, target: MicroDegrees) {
        self.set(TARGET_POSITION.of(joint), target.nearest_degree());
        self.targets[joint] = Some(target);
        self.target_writes[joint] += 1;
        self.has_host_target[joint] = self.is_servo();
    }

    /// The arm set the target of a joint: its register shows `degrees`.
    pub(crate) fn take_target(&mut self, joint: Joint, degrees: u8) {
        self.set(TARGET_POSITION.of(joint), degrees);
        self.forget_target(joint);
    }

    /// A measured position may replace the target of a joint.
    pub(crate) fn forget_target(&mut self, joint: Joint) {
        self.targets[joint] = None;
        self.has_host_target[joint] = false;
    }

    /// After a change to or from motor state servo, no target of the host is in force. On entry into servo, measured positions
    /// become the targets (D13).
    pub(super) fn state_changed(&mut self, was_servo: bool) {
        if self.is_servo() != was_servo {
            self.has_host_target = PerJoint::all(false);
        }
        if self.is_servo() && !was_servo {
            self.targets = PerJoint::all(None);
        }
    }

    /// The watchdog damped the arm (D24), or its supply was lost (D29).
    pub(crate) fn damp(&mut self) {
        let was_servo = self.is_servo();
        self.set(MOTOR_STATE.address, motor_state::DAMPING);
        self.state_changed(was_servo);
    }

    /// The arm entered state 0 because its supply was lost (D29).
    pub(crate) fn lose_supply(&mut self) {
        self.damp();
        self.set(super::protection_model::SUPPLY_LOST, 1);
    }

    /// The target of the host with its fraction, if it is in force.
    pub(crate) fn host_target(&self, joint: Joint) -> Option<MicroDegrees> {
        self.targets[joint].filter(|_| self.has_host_target[joint])
    }

    /// The target of a joint in counts: with its fraction if the host's target is in force, otherwise from the register.
    pub(crate) fn target_counts(&self, joint: Joint, registers: &RegisterFile) -> u16 {
        let shown = MicroDegrees::from_degrees(registers.get(TARGET_POSITION.of(joint)));
        counts_from_angle(joint, self.host_target(joint).unwrap_or(shown), self.offset(joint))
    }
}

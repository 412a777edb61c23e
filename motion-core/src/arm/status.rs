//! The status block: what the arm shows of its own health.

use protocol_core::registers::Joint;
use protocol_core::registers::map::{
    FAULTS, MISSING_SERVOS, MOVING_JOINTS, SERVO_TEMPERATURE, SUPPLY_VOLTAGE, fault,
};

use super::{Arm, JointState};
use crate::controller::Storage;

impl Arm {
    /// What became of the settings storage.
    pub(crate) fn set_storage(&mut self, storage: Storage) {
        self.storage = storage;
        self.show_faults();
    }

    /// Raises fault bits until the next restart.
    pub(crate) fn raise_faults(&mut self, bits: u8) {
        self.lasting_faults |= bits;
        self.show_faults();
    }

    pub(super) fn show_moving(&mut self) {
        // A joint whose servo does not answer is not on its way, whatever the host wants of it.
        let starting = self.starting_until.is_some();
        let moving = self.joint_set(|joint| joint.drive.is_moving() && (starting || joint.sensor.is_known()));
        self.registers.set(MOVING_JOINTS.address, moving);
    }

    pub(super) fn show_servos(&mut self) {
        let starting = self.starting_until.is_some();
        let missing = self.joint_set(|joint| !starting && !joint.sensor.is_known());
        self.registers.set(MISSING_SERVOS.address, missing);
        let hottest = self.joints.iter().map(|joint| joint.temperature).max().unwrap_or(0);
        self.registers.set(SERVO_TEMPERATURE.address, hottest);
        if missing == 0x7F {
            self.registers.set(SUPPLY_VOLTAGE.address, 0);
        }
        self.show_moving();
        self.show_faults();
    }

    pub(super) fn show_faults(&mut self) {
        let storage = if self.storage == Storage::Ready { 0 } else { fault::SETTINGS_STORAGE };
        let missing = self.registers.get(MISSING_SERVOS.address) != 0;
        let alarmed = self.joints.iter().any(|joint| joint.alarms != 0);
        let servos = if missing || alarmed { fault::SERVO_BUS } else { 0 };
        self.registers.set(FAULTS.address, self.lasting_faults | storage | servos);
    }

    fn joint_set(&self, belongs: impl Fn(&JointState) -> bool) -> u8 {
        let members = Joint::ALL.into_iter().zip(&self.joints).filter(|(_, state)| belongs(state));
        members.fold(0, |bits, (joint, _)| bits | joint.bit())
    }
}

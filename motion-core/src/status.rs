//! The status block: faults, missing servos, moving joints and refused frames.

use protocol_core::registers::RegisterFile;
use protocol_core::registers::map::{
    FAULTS, FRAMES_REFUSED, LAST_REFUSAL, LAST_REFUSED_REGISTER, MISSING_SERVOS, MOVING_JOINTS,
    SERVO_TEMPERATURE, SUPPLY_VOLTAGE, fault,
};
use protocol_core::settings::Storage;

use crate::joints::Joints;

const ALL_JOINTS: u8 = 0x7F;

/// The part of the status block that does not come from the joints.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct ControllerStatus {
    storage: Storage,
    /// Fault bits that stay until the next restart, or until [`ControllerStatus::clear_faults`].
    lasting_faults: u8,
}

impl ControllerStatus {
    /// The state of the settings storage, and the fault bits known at start.
    pub(crate) const fn new(storage: Storage, faults: u8) -> Self {
        Self { storage, lasting_faults: faults }
    }

    /// The state of the settings storage.
    pub(crate) const fn storage(&self) -> Storage {
        self.storage
    }

    /// Sets the state of the settings storage.
    pub(crate) const fn set_storage(&mut self, storage: Storage) {
        self.storage = storage;
    }

    /// Raises fault bits. They stay until the next restart, or until [`ControllerStatus::clear_faults`].
    pub(crate) const fn raise_faults(&mut self, bits: u8) {
        self.lasting_faults |= bits;
    }

    /// Clears fault bits that were raised.
    pub(crate) const fn clear_faults(&mut self, bits: u8) {
        self.lasting_faults &= !bits;
    }

    /// Shows which joints move. A joint whose servo is silent does not count as moving.
    pub(crate) fn show_moving(registers: &mut RegisterFile, joints: &Joints) {
        let silent = registers.get(MISSING_SERVOS.address);
        registers.set(MOVING_JOINTS.address, joints.moving() & !silent);
    }

    /// Shows the state of the servos. During start-up no servo counts as silent.
    pub(crate) fn show_servos(&self, registers: &mut RegisterFile, joints: &Joints, is_starting: bool) {
        let silent = if is_starting { 0 } else { joints.silent() };
        registers.set(MISSING_SERVOS.address, silent);
        registers.set(SERVO_TEMPERATURE.address, joints.hottest());
        if silent == ALL_JOINTS {
            registers.set(SUPPLY_VOLTAGE.address, 0);
        }
        Self::show_moving(registers, joints);
        self.show_faults(registers, joints);
    }

    pub(crate) fn show_faults(&self, registers: &mut RegisterFile, joints: &Joints) {
        let storage = if self.storage == Storage::Ready { 0 } else { fault::SETTINGS_STORAGE };
        let is_faulty = registers.get(MISSING_SERVOS.address) != 0 || joints.any_alarm();
        let servos = if is_faulty { fault::SERVO_BUS } else { 0 };
        registers.set(FAULTS.address, self.lasting_faults | storage | servos);
    }

    /// Counts a refused frame and shows the reason.
    pub(crate) fn refuse(registers: &mut RegisterFile, reason: u8, address: u8) {
        registers.increment(&FRAMES_REFUSED);
        registers.set(LAST_REFUSAL.address, reason);
        registers.set(LAST_REFUSED_REGISTER.address, address);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor_state::MotorState;
    use protocol_core::registers::map::refusal;

    #[test]
    fn servos_count_as_silent_only_after_start_up() {
        let (mut registers, joints) = (RegisterFile::new([0; 6], None), Joints::new(MotorState::Servo));
        let status = ControllerStatus::new(Storage::Ready, 0);
        registers.set(SUPPLY_VOLTAGE.address, 74);
        status.show_servos(&mut registers, &joints, true);
        assert_eq!(registers.read(FAULTS.address, 2), [0, 0]);
        assert_eq!(registers.get(SUPPLY_VOLTAGE.address), 74);
        status.show_servos(&mut registers, &joints, false);
        assert_eq!(registers.read(FAULTS.address, 2), [fault::SERVO_BUS, ALL_JOINTS]);
        assert_eq!(registers.get(SUPPLY_VOLTAGE.address), 0, "unknown");
    }

    #[test]
    fn lasting_faults_stay_beside_the_storage_fault() {
        let (mut registers, joints) = (RegisterFile::new([0; 6], None), Joints::new(MotorState::Servo));
        let mut status = ControllerStatus::new(Storage::Broken, fault::WATCHDOG_RESTART);
        status.raise_faults(fault::RECEIVE_OVERRUN);
        status.show_faults(&mut registers, &joints);
        let lasting = fault::WATCHDOG_RESTART | fault::RECEIVE_OVERRUN;
        assert_eq!(registers.get(FAULTS.address), lasting | fault::SETTINGS_STORAGE);
        status.set_storage(Storage::Ready);
        status.show_faults(&mut registers, &joints);
        assert_eq!(registers.get(FAULTS.address), lasting);
    }

    #[test]
    fn a_refusal_shows_its_reason_and_its_register() {
        let mut registers = RegisterFile::new([0; 6], None);
        ControllerStatus::refuse(&mut registers, refusal::OUT_OF_RANGE, 46);
        assert_eq!(registers.read(LAST_REFUSAL.address, 2), [refusal::OUT_OF_RANGE, 46]);
        assert_eq!(registers.get(FRAMES_REFUSED.address), 1);
    }
}

//! The registers of the arm that the hub knows without a read. The EEPROM lock and register 20 decide which writes the arm
//! refuses, and in which form a client that has written nothing reads the offsets. A hold restores the speeds.
//!
//! They are read when the arm is found, except for the registers behind the speeds: those count as after power-up until the
//! hub writes them. Once the arm is found, only the hub writes to it. The hub does not know whether the settings storage is
//! full, nor whether the controller restarted. A restart locks the EEPROM.

use motion_core::reach;
use protocol_core::registers::map::{
    CHIP_ID, DEVICE_CODE, EEPROM_LOCK, FINE_TARGET, FIRMWARE_VERSION, SPEED, TARGET_POSITION, WATCHDOG_ACTION,
};
use protocol_core::registers::map21::{OPTIONS, option};
use protocol_core::registers::{Accepted, Joint, Map, RegisterFile};

use super::angles::JointAngles;

/// The registers of the arm that the hub knows.
#[derive(Debug)]
pub(crate) struct KnownRegisters(RegisterFile);

impl KnownRegisters {
    /// The read that finds an arm, from the device code to the speeds: the first register, and how many.
    pub(crate) const IDENTITY: (u8, u8) = (DEVICE_CODE.address, SPEED.address + SPEED.count);

    /// The registers of an arm that has just started.
    pub(crate) fn new() -> Self {
        Self(RegisterFile::new([0; 6], None))
    }

    /// The registers of the arm that answered a read of [`KnownRegisters::IDENTITY`]; `None` if it is no 7Bot V2.
    pub(crate) fn of_arm(values: &[u8]) -> Option<Self> {
        let mut known = Self::new();
        for (address, &value) in (Self::IDENTITY.0..).zip(values) {
            let known_rows = [DEVICE_CODE, FIRMWARE_VERSION, CHIP_ID, EEPROM_LOCK, OPTIONS, SPEED];
            if known_rows.iter().any(|register| register.holds(address)) {
                known.0.set(address, value);
            }
        }
        let has_code = values.first() == Some(&DEVICE_CODE.default_at(DEVICE_CODE.address));
        has_code.then_some(known)
    }

    /// The chip id: 6 bytes, the most significant one first.
    pub(crate) fn chip_id(&self) -> &[u8] {
        self.0.read(CHIP_ID.address, CHIP_ID.count)
    }

    /// Does the arm have the extended block and the status block?
    pub(crate) fn is_ours(&self) -> bool {
        self.0.get(FIRMWARE_VERSION.address) == FIRMWARE_VERSION.default_at(FIRMWARE_VERSION.address)
    }

    /// Does the watchdog switch the motors off (register 187)?
    pub(crate) fn watchdog_damps(&self) -> bool {
        self.0.get(WATCHDOG_ACTION.address) != 0
    }

    /// The speeds of all joints, without the hub's brake.
    pub(crate) fn speeds(&self) -> &[u8] {
        self.0.read(SPEED.address, SPEED.count)
    }

    /// Sets the speeds that a hold restores.
    pub(crate) fn set_speeds(&mut self, speeds: &[u8]) {
        (SPEED.address..).zip(speeds).for_each(|(address, &speed)| self.0.set(address, speed));
    }

    pub(crate) fn byte(&self, address: u8) -> u8 {
        self.0.get(address)
    }

    pub(crate) fn word(&self, address: u8) -> u16 {
        self.0.word(address)
    }

    /// Does the arm accept a write by [D16](protocol_core::decisions#d16) and [M7](protocol_core::decisions#m7)? Does not check the
    /// limits of [D25](protocol_core::decisions#d25).
    pub(crate) fn accepts(&self, map: Map, address: u8, values: &[u8]) -> bool {
        self.check(map, address, values).is_some()
    }

    /// Notes a write to the arm. A write that the arm refuses has no effect.
    pub(crate) fn write(&mut self, map: Map, address: u8, values: &[u8]) {
        if let Some(accepted) = self.check(map, address, values) {
            self.0.apply(&accepted);
        }
    }

    /// The targets in a write that the arm accepts, in hundredths of a degree.
    pub(crate) fn targets_in(&self, map: Map, address: u8, values: &[u8]) -> JointAngles {
        let Some(accepted) = self.check(map, address, values) else { return JointAngles::default() };
        Joint::ALL.map(|joint| {
            let degrees = accepted.value_at(TARGET_POSITION.of(joint));
            let fine = || accepted.word_at(FINE_TARGET.of(joint));
            degrees.map(|degrees| 100 * u16::from(degrees)).or_else(fine)
        })
    }

    fn check<'a>(&self, map: Map, address: u8, values: &'a [u8]) -> Option<Accepted<'a>> {
        match map {
            Map::V22 => self.0.check(address, values).ok(),
            Map::V21 => self.0.check_map21(address, values).ok().filter(reach::is_within),
        }
    }

    /// The map that determines the form of the offsets for a client that has written nothing
    /// ([M5](protocol_core::decisions#m5), [M6](protocol_core::decisions#m6)).
    pub(crate) fn form_before_writes(&self) -> Map {
        if self.0.get(OPTIONS.address) & option::BIASED_OFFSETS == 0 { Map::V22 } else { Map::V21 }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use super::*;

    const UNLOCK: (u8, &[u8]) = (28, &[0]);

    fn unlocked() -> KnownRegisters {
        let mut known = KnownRegisters::new();
        known.write(Map::V22, UNLOCK.0, UNLOCK.1);
        known
    }

    #[test]
    fn values_out_of_range_are_refused_in_the_map_of_the_frame() {
        let known = KnownRegisters::new();
        for (map, address, value, accepts) in [
            (Map::V22, 53, 50, true),
            (Map::V22, 53, 51, false),
            (Map::V21, 53, 51, true),
            (Map::V21, 82, 100, true),
            (Map::V21, 82, 101, false),
            (Map::V22, 82, 101, true),
            (Map::V21, 46, 181, false),
        ] {
            assert_eq!(known.accepts(map, address, &[value]), accepts, "{map:?} {address} {value}");
        }
    }

    #[test]
    fn the_lock_decides_about_settings_and_follows_the_writes() {
        let mut known = KnownRegisters::new();
        assert!(known.accepts(Map::V21, 13, &[20]), "locked: without effect (D15)");
        known.write(Map::V21, 28, &[2]);
        known.write(Map::V21, 28, &[0]);
        assert!(!known.accepts(Map::V21, 13, &[20]));
        assert!(!known.accepts(Map::V22, 13, &[20]));
        let mut found = [0; 29];
        (found[0], found[28]) = (7, 1);
        let known = KnownRegisters::of_arm(&found).unwrap();
        assert!(known.accepts(Map::V21, 13, &[20]));
    }

    #[test]
    fn a_position_out_of_reach_is_refused() {
        let known = KnownRegisters::new();
        let far = [0x05, 0xF4, 0x04, 0xB9, 0x04, 0x32, 0x80, 0x80, 0x7F];
        assert!(!known.accepts(Map::V21, 54, &far), "golden frame: IK6 (500,185,50)");
        assert!(known.accepts(Map::V21, 54, &far[..8]), "a part is stored only");
        assert!(known.accepts(Map::V22, 54, &far), "no block of map 2.2");
        let near = [0x04, 0x32, 0x04, 0xB9, 0x04, 0x32, 0x80, 0x80, 0x7F];
        assert!(known.accepts(Map::V21, 54, &near), "golden frame: IK6 (50,185,50)");
    }

    #[test]
    fn register_20_chooses_the_form_of_offsets() {
        let mut known = unlocked();
        assert_eq!(known.form_before_writes(), Map::V22);
        known.write(Map::V22, 20, &[1]);
        assert_eq!(known.form_before_writes(), Map::V22, "reserved in map 2.2");
        known.write(Map::V21, 20, &[1]);
        assert_eq!(known.form_before_writes(), Map::V21);
        known.write(Map::V21, 20, &[2]);
        assert_eq!(known.form_before_writes(), Map::V22, "alarms only");
        let mut found = [0; 29];
        (found[0], found[2], found[20]) = (7, 0xA5, 3);
        let known = KnownRegisters::of_arm(&found).unwrap();
        assert_eq!((known.form_before_writes(), known.chip_id()[0]), (Map::V21, 0xA5));
        assert!(KnownRegisters::of_arm(&[6; 29]).is_none(), "another device");
    }
}

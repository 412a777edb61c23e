//! The arm's registers as the hub knows them without a read: the EEPROM lock and register 20. They decide which writes
//! the arm refuses, and how it shows offsets before a write.
//!
//! Both are read when the arm is found. After that only the hub writes to the arm. Full settings storage is
//! unknown here, and so is a restart of the controller, which locks the EEPROM.

use motion_core::reach;
use protocol_core::registers::map::EEPROM_LOCK;
use protocol_core::registers::map21::{OPTIONS, option};
use protocol_core::registers::{Accepted, Map, RegisterFile};

/// The registers of the arm that the hub knows.
#[derive(Debug)]
pub(crate) struct KnownRegisters(RegisterFile);

impl KnownRegisters {
    /// The registers of an arm that has just started.
    pub(crate) fn new() -> Self {
        Self(RegisterFile::new([0; 6], None))
    }

    /// Takes over the values that were read from the arm.
    pub(crate) fn set(&mut self, address: u8, values: &[u8]) {
        for (address, &value) in (address..=u8::MAX).zip(values) {
            if EEPROM_LOCK.holds(address) || OPTIONS.holds(address) {
                self.0.set(address, value);
            }
        }
    }

    /// Does the arm accept a write (D16, M7)?
    pub(crate) fn accepts(&self, map: Map, address: u8, values: &[u8]) -> bool {
        self.check(map, address, values).is_some()
    }

    /// The arm got a write. A refused one has no effect.
    pub(crate) fn write(&mut self, map: Map, address: u8, values: &[u8]) {
        if let Some(accepted) = self.check(map, address, values) {
            self.0.apply(&accepted);
        }
    }

    fn check<'a>(&self, map: Map, address: u8, values: &'a [u8]) -> Option<Accepted<'a>> {
        match map {
            Map::V22 => self.0.check(address, values).ok(),
            Map::V21 => self.0.check_map21(address, values).ok().filter(reach::is_within),
        }
    }

    /// The map whose form offsets have for a client that has written nothing (M5, M6).
    pub(crate) fn form_before_writes(&self) -> Map {
        if self.0.get(OPTIONS.address) & option::BIASED_OFFSETS == 0 { Map::V22 } else { Map::V21 }
    }
}

#[cfg(test)]
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
        known.set(0, &[1; 29]);
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
        known.set(20, &[3]);
        assert_eq!(known.form_before_writes(), Map::V21);
    }
}

//! The identity of an arm: device code, firmware version, chip id.

use protocol_core::registers::map::{CHIP_ID, DEVICE_CODE, FIRMWARE_VERSION};
use protocol_core::registers::map21::Map;

use host_link::Snapshot;

/// The highest version of the maker's firmware, in tenths, with map 2.1. The maker's 2.2 has map 2.2.
const LAST_VERSION_WITH_MAP_21: u8 = 21;

/// Registers 0 to 7 of an arm.
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let arm = sevenbot::Arm::open("/dev/ttyUSB0", 115_200)?;
/// println!("firmware {}, chip {}", arm.identity().version(), arm.identity().chip_name());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity(Snapshot);

/// Which firmware an arm runs, by its version in register 1 ([D7](protocol_core::decisions#d7)).
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let arm = sevenbot::Arm::open("/dev/ttyUSB0", 115_200)?;
/// if arm.identity().firmware() == sevenbot::Firmware::Makers {
///     println!("this arm does not say what it refuses");
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Firmware {
    /// This project's, 3.0 or later: with map 2.2 all functions work.
    Ours,
    /// The maker's, 1.0 to 2.4. It has no status block and checks no ranges. It reports no refusal, except by alarms in map 2.1.
    Makers,
    /// Any other version.
    Unknown,
}

impl From<Snapshot> for Identity {
    fn from(registers: Snapshot) -> Self {
        Self(registers)
    }
}

impl Identity {
    /// Register 0: 7 for a 7Bot V2.
    pub(crate) fn device_code(&self) -> u8 {
        self.0.byte(&DEVICE_CODE)
    }

    /// The firmware version, such as `3.0`.
    #[must_use]
    pub fn version(&self) -> String {
        let tenths = self.0.byte(&FIRMWARE_VERSION);
        format!("{}.{}", tenths / 10, tenths % 10)
    }

    /// Whose firmware the arm runs, by the version in register 1.
    #[must_use]
    pub fn firmware(&self) -> Firmware {
        match self.0.byte(&FIRMWARE_VERSION) {
            version if version >= FIRMWARE_VERSION.default_at(FIRMWARE_VERSION.address) => Firmware::Ours,
            10..=24 => Firmware::Makers,
            _ => Firmware::Unknown,
        }
    }

    /// The register map of this firmware. Ours serves map 2.1, too.
    #[must_use]
    pub fn map(&self) -> Map {
        if self.0.byte(&FIRMWARE_VERSION) <= LAST_VERSION_WITH_MAP_21 { Map::V21 } else { Map::V22 }
    }

    /// Are registers 240 to 255 the status block (docs/protocol.md, section 6)?
    #[must_use]
    pub fn has_status_block(&self) -> bool {
        self.firmware() == Firmware::Ours
    }

    /// The chip's unique number, most significant byte first ([D8](protocol_core::decisions#d8)).
    #[must_use]
    pub fn chip_id(&self) -> [u8; 6] {
        [0, 1, 2, 3, 4, 5].map(|offset| self.0.at(CHIP_ID.address + offset))
    }

    /// The chip id as twelve hexadecimal digits.
    #[must_use]
    pub fn chip_name(&self) -> String {
        self.chip_id().map(|byte| format!("{byte:02X}")).concat()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_selects_the_firmware() {
        let firmware = |version| Identity(Snapshot { address: 0, values: vec![7, version] }).firmware();
        for makers in [10, 21, 22, 24] {
            assert_eq!(firmware(makers), Firmware::Makers, "{makers}");
        }
        assert_eq!((firmware(30), firmware(31)), (Firmware::Ours, Firmware::Ours));
        assert_eq!((firmware(0), firmware(25)), (Firmware::Unknown, Firmware::Unknown));
        let map = |version| Identity(Snapshot { address: 0, values: vec![7, version] }).map();
        assert_eq!([10, 21, 22, 30].map(map), [Map::V21, Map::V21, Map::V22, Map::V22]);
    }
}

//! `cargo xtask docs`: docs/registers.md, generated from the register tables of the arm.

use sevenbot::table;

use crate::generated::GeneratedFile;
use crate::run::TaskResult;

const INTRODUCTION: &str = "\
# Registers

<!-- Generated from protocol-core/src/registers/map.rs and map21.rs by `cargo xtask docs`. Change the tables there. -->

The maker has two register maps. Function 06 writes map 2.2, function 04 writes map 2.1. Reads are the same for both: an
address gives the register of map 2.2, or else that of map 2.1. Only 13 to 19 read in the encoding of the last write.
An address that is in neither table reads 0. An address is one byte: a value of two bytes takes two addresses, low byte
first. [protocol.md](protocol.md) defines the effect of a write, and the decisions D1 to D30 and M1 to M12.

* **Region**: ROM is fixed for a chip and its firmware. EEPROM survives power cuts and is writable only while
  the EEPROM lock is open. RAM starts from its defaults at every power-up.
* **Access**: RW reads and writes, RO reads only, reserved reads 0. A write to RO or reserved has no effect.
* **Range**: the values that a write may have. In one byte with negative values bit 7 is the sign and the rest the
  magnitude: -5 is 0x85. In map 2.1 such a byte is 128 plus the number: -5 is 123. Two bytes are two's complement.
* **Default**: the value after power-up; in EEPROM, of a new arm. A row of seven registers has one for each
  joint, 1 to 7, and lists them if they differ. The arm replaces a default once it knows, measures or counts the value.

";

pub(crate) fn files() -> TaskResult<Vec<GeneratedFile>> {
    Ok(vec![("docs/registers.md".to_owned(), (INTRODUCTION.to_owned() + &table::markdown()).into_bytes())])
}

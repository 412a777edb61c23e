//! `cargo xtask docs`: the register table as a page to read, written from the table the arm is built from.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use protocol_core::registers::{Access, JOINTS, MAP, Range, Region, Register};

use crate::run::{Outcome, root};

const INTRODUCTION: &str = "\
# Registers

<!-- Generated from protocol-core/src/registers/map.rs by `cargo xtask docs`. Change the table there. -->

One register is one byte. A read of any address answers; an address that is not listed here reads 0.
What a write does is in [protocol.md](protocol.md), as are the decisions that D-numbers refer to.

* **Region**: ROM is fixed for a chip and its firmware; EEPROM survives power cuts and is written only while
  the EEPROM lock is open; RAM starts from its defaults at every power-up.
* **Access**: RW reads and writes, RO reads only, reserved reads 0. A write to RO or reserved has no effect.
* **Range**: the numbers a write may bring. In a range with negative numbers bit 7 is the sign and the rest
  the magnitude: -5 is 0x85.
* **Default**: the value after power-up; in EEPROM, of a new arm. A row of seven registers has one for each
  joint, 1 to 7, and lists them where they differ. What the arm itself knows, measures or counts replaces it
  as soon as it is there.

| address | name | region | access | range | default | unit | meaning |
| --- | --- | --- | --- | --- | --- | --- | --- |
";

/// Writes the page.
pub(crate) fn write() -> Outcome {
    Ok(fs::write(path(), page())?)
}

/// Fails if the page is not what [`write()`] would write.
pub(crate) fn check() -> Outcome {
    let found = fs::read_to_string(path()).unwrap_or_default();
    if found == page() {
        println!("docs/registers.md says what the table says");
        return Ok(());
    }
    Err("docs/registers.md is not what the register table says; run `cargo xtask docs`".into())
}

fn path() -> PathBuf {
    root().join("docs/registers.md")
}

fn page() -> String {
    let mut page = INTRODUCTION.to_owned();
    for row in MAP {
        // Writing to a string cannot fail.
        let _ = writeln!(page, "{}", line(row));
    }
    page
}

fn line(row: &Register) -> String {
    let cells = [
        addresses(row),
        format!("`{}`", row.name),
        region(row.region).to_owned(),
        access(row.access).to_owned(),
        range(row),
        default(row),
        row.unit.symbol().to_owned(),
        meaning(row),
    ];
    format!("| {} |", cells.join(" | "))
}

fn addresses(row: &Register) -> String {
    let last = usize::from(row.address) + usize::from(row.count) - 1;
    if row.count == 1 { row.address.to_string() } else { format!("{}..{last}", row.address) }
}

const fn region(region: Region) -> &'static str {
    match region {
        Region::Rom => "ROM",
        Region::Eeprom => "EEPROM",
        Region::Ram => "RAM",
    }
}

const fn access(access: Access) -> &'static str {
    match access {
        Access::ReadOnly => "RO",
        Access::ReadWrite => "RW",
        Access::Reserved => "reserved",
    }
}

fn range(row: &Register) -> String {
    let (low, high) = row.range.bounds();
    let whole_byte = row.range == Range::UpTo(u8::MAX) && row.access != Access::ReadWrite;
    if whole_byte { "-".to_owned() } else { format!("{low}..{high}") }
}

fn default(row: &Register) -> String {
    let numbers: Vec<_> = row.defaults.iter().map(|&byte| row.range.decode(byte).to_string()).collect();
    match numbers.first() {
        Some(first) if numbers.iter().all(|number| number == first) => first.clone(),
        _ => numbers.join(" "),
    }
}

fn meaning(row: &Register) -> String {
    let words = row.doc.iter().map(|line| line.trim()).collect::<Vec<_>>().join(" ");
    if row.per_joint { format!("Joint 1..{JOINTS}. {words}") } else { words }
}

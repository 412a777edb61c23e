//! The register tables as text: Markdown, C, Python.

use std::fmt::Write as _;

use protocol_core::registers::map::BAUD_RATES;
use protocol_core::registers::map21::find_readable;
use protocol_core::registers::{Access, JOINTS, MAP, MAP_21, Map, Range, Region, Register};

use host_link::Span;

/// The rows that are settings: writable, and kept without power. The offsets are those of map 2.2.
pub fn settings() -> impl Iterator<Item = &'static Register> {
    let is_shown = |row: &&Register| find_readable(row.address) == Some(*row);
    rows().filter(is_shown).filter(|row| row.region == Region::Eeprom && row.access == Access::ReadWrite)
}

/// The rows of both maps. A row that is the same in both appears once.
pub fn rows() -> impl Iterator<Item = &'static Register> {
    MAP.iter().chain(only_map21())
}

/// The rows of map 2.1 that map 2.2 does not have.
pub fn only_map21() -> impl Iterator<Item = &'static Register> {
    MAP_21.iter().filter(|row| !MAP.contains(row))
}

/// The versions of the maps that have this row.
pub fn versions(row: &Register) -> impl Iterator<Item = &'static str> {
    Map::ALL.into_iter().filter(|map| map.rows().contains(row)).map(Map::version)
}

/// The tables of `docs/registers.md`.
#[must_use]
pub fn markdown() -> String {
    let table = |map: Map| format!("## Map {}\n\n{}", map.version(), markdown_table(map));
    Map::ALL.map(table).join("\n")
}

fn markdown_table(map: Map) -> String {
    let mut page = "\
| address | name | region | access | range | default | unit | meaning |
| --- | --- | --- | --- | --- | --- | --- | --- |
"
    .to_owned();
    for row in map.rows() {
        let [address, name, rest @ ..] = cells(row);
        let joints = if row.per_joint { format!("Joint 1..{JOINTS}. ") } else { String::new() };
        let line = format!("| {address} | `{name}` | {} | {joints}{} |", rest.join(" | "), description(row));
        push_line(&mut page, &line);
    }
    page
}

/// Constants for C and C++: the output of `sevenbot registers --format c`.
#[must_use]
pub fn c_header() -> String {
    let mut header = "\
/* Registers of the 7Bot V2. Written by `sevenbot registers --format c`. */
#ifndef SEVENBOT_REGISTERS_H
#define SEVENBOT_REGISTERS_H
"
    .to_owned();
    for (prefix, row) in prefixed_rows() {
        push_line(&mut header, &format!("\n/* {} */", description(row)));
        for (suffix, number) in constants(row) {
            push_line(&mut header, &format!("#define SEVENBOT_{prefix}{}{suffix} {number}", row.name));
        }
    }
    let rates = BAUD_RATES.map(|rate| format!("{rate}L")).join(", ");
    push_line(&mut header, "\n/* Baud rates by their codes. */");
    push_line(&mut header, &format!("#define SEVENBOT_BAUD_RATES {{ {rates} }}"));
    push_line(&mut header, "\n#endif");
    header
}

/// Constants for Python: the output of `sevenbot registers --format python`.
#[must_use]
pub fn python() -> String {
    let mut module =
        "\"\"\"Registers of the 7Bot V2. Written by `sevenbot registers --format python`.\"\"\"\n".to_owned();
    for (prefix, row) in prefixed_rows() {
        push_line(&mut module, &format!("\n# {}", description(row)));
        for (suffix, number) in constants(row) {
            push_line(&mut module, &format!("{prefix}{}{suffix} = {number}", row.name));
        }
    }
    let rates = BAUD_RATES.map(|rate| rate.to_string()).join(", ");
    push_line(&mut module, &format!("\n# Baud rates by their codes.\nBAUD_RATES = ({rates})"));
    module
}

/// The rows of both maps, with the prefix of their constants.
fn prefixed_rows() -> impl Iterator<Item = (&'static str, &'static Register)> {
    MAP.iter().map(|row| ("", row)).chain(only_map21().map(|row| ("MAP21_", row)))
}

fn push_line(text: &mut String, line: &str) {
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{line}");
}

/// Address, name, region, access, range, default and unit of a row.
#[must_use]
pub fn cells(row: &Register) -> [String; 7] {
    [
        addresses(row),
        row.name.to_owned(),
        region(row.region).to_owned(),
        access(row.access).to_owned(),
        range(row).map_or_else(|| "-".to_owned(), |bounds| range_text(row.range, bounds)),
        default(row),
        row.unit.symbol().to_owned(),
    ]
}

/// The constants of a row: suffix of the name, and value.
fn constants(row: &Register) -> Vec<(&'static str, i32)> {
    let mut constants = vec![("", i32::from(row.address))];
    if row.count > 1 {
        constants.push(("_COUNT", i32::from(row.count)));
    }
    if row.range.width() > 1 {
        constants.push(("_WIDTH", i32::from(row.range.width())));
    }
    if let Some((low, high)) = range(row).filter(|_| row.access == Access::ReadWrite) {
        constants.extend([("_MIN", low), ("_MAX", high)]);
    }
    constants
}

fn addresses(row: &Register) -> String {
    if row.count == 1 { row.address.to_string() } else { Span::of(row).to_string() }
}

/// `ROM`, `EEPROM` or `RAM`, as the tables show it.
#[must_use]
pub const fn region(region: Region) -> &'static str {
    match region {
        Region::Rom => "ROM",
        Region::Eeprom => "EEPROM",
        Region::Ram => "RAM",
    }
}

/// `RO`, `RW` or `reserved`, as the tables show it.
#[must_use]
pub const fn access(access: Access) -> &'static str {
    match access {
        Access::ReadOnly => "RO",
        Access::ReadWrite => "RW",
        Access::Reserved => "reserved",
    }
}

/// The range of a row; `None` for a row that cannot be written and may hold any byte.
#[must_use]
pub fn range(row: &Register) -> Option<(i32, i32)> {
    let is_any_byte = row.range == Range::UpTo(u8::MAX) && row.access != Access::ReadWrite;
    (!is_any_byte).then(|| row.range.bounds())
}

fn range_text(range: Range, (low, high): (i32, i32)) -> String {
    match range {
        Range::ZeroOr(least, most) => format!("0, {least}..{most}"),
        _ => format!("{low}..{high}"),
    }
}

fn default(row: &Register) -> String {
    let constants = row.defaults.map(|byte| row.range.decode(byte).to_string());
    match constants.as_slice() {
        [first, rest @ ..] if rest.iter().all(|number| number == first) => first.clone(),
        _ => constants.join(" "),
    }
}

/// The doc comment of the row in the register map, as one line.
#[must_use]
pub fn description(row: &Register) -> String {
    row.doc.iter().map(|line| line.trim()).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol_core::registers::map::TARGET_POSITION;

    #[test]
    fn the_markdown_table_is_the_documented_one() {
        assert!(include_str!("../../docs/registers.md").ends_with(&markdown()));
    }

    #[test]
    fn each_form_has_every_row() {
        for row in MAP {
            assert!(c_header().contains(&format!("#define SEVENBOT_{} {}\n", row.name, row.address)));
            assert!(python().contains(&format!("\n{} = {}\n", row.name, row.address)));
        }
        assert!(c_header().contains("SEVENBOT_OFFSET_MIN -16"));
        assert!(c_header().contains("#define SEVENBOT_MAP21_PRESENT_LOAD 91\n"));
        assert!(python().contains("\nMAP21_ANGLE_FEEDBACK_FREQUENCY_MAX = 100\n"));
        assert!(c_header().contains("#define SEVENBOT_FINE_TARGET_WIDTH 2\n"), "bytes of a value");
        assert!(python().contains("\nFINE_TARGET_MAX = 18000\n"));
        assert!(!c_header().contains("MAP21_SPEED"), "as in map 2.2");
        assert_eq!((rows().count(), versions(&TARGET_POSITION).count()), (MAP.len() + 13, 2));
    }
}

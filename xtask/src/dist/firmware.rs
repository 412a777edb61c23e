//! The image for the arm in the forms that flash programs read.
//!
//! ```text
//!   ELF ──▶ segments ──▶ .hex, .dfu: they name addresses, and leave out the range of the settings
//!                   └──▶ .bin: one range from the start of the flash; overwrites the settings
//! ```

use std::env;
use std::fs;
use std::process::Command;

use ihex::Record;
use linked_image::{LoadedRange, Program};
use torture::text_table::Column::{Left, Right};
use torture::text_table::TextTable;

use super::dfu;
use super::platform::{build_directory, reproducible};
use super::release::Release;
use crate::run::{CHIP, TaskResult, root, run_command};

/// The value of an erased byte of flash.
const ERASED: u8 = 0xFF;
/// Bytes in a line of a `.hex` file.
const HEX_LINE: usize = 16;

pub(super) fn names(release: &Release) -> Vec<String> {
    let tails = [".elf", ".bin", ".hex", ".dfu", ".map", ".sizes.txt"];
    let image = tails.map(|tail| release.name("firmware-stm32", tail));
    image.into_iter().chain([release.name("firmware-self-test", ".hex")]).collect()
}

/// The name of the file for the boot loader on USB.
pub(super) fn dfu_name(release: &Release) -> String {
    release.name("firmware-stm32", ".dfu")
}

/// Builds the image and the self-test image, and writes the files.
pub(super) fn write(release: &Release) -> TaskResult {
    let map = build_directory().join("firmware.map");
    // cargo hashes the arguments of the linker into the names of symbols. So use a path that is the same in each clone.
    let map = map.strip_prefix(root()).unwrap_or(&map);
    build(release, "self-test", "")?;
    build(release, "firmware-stm32", &format!("-Clink-arg=-Map={}", map.display()))?;
    let built = build_directory().join(CHIP).join("firmware");
    let elf = fs::read(built.join("firmware-stm32"))?;
    if !elf.windows(release.text().len()).any(|window| window == release.text().as_bytes()) {
        return Err("the image does not contain its version".into());
    }
    let ranges = linked_image::loaded_ranges(&elf)?;
    let put =
        |tail: &str, bytes: &[u8]| fs::write(release.path(&release.name("firmware-stm32", tail)), bytes);
    put(".bin", &flat(&ranges)?)?;
    put(".hex", hex(&ranges)?.as_bytes())?;
    put(".dfu", &dfu::file(&ranges)?)?;
    put(".map", portable(&fs::read_to_string(root().join(map))?).as_bytes())?;
    put(".sizes.txt", sizes(&elf)?.as_bytes())?;
    put(".elf", &elf)?;
    let self_test = fs::read(built.join("self-test"))?;
    let self_test = hex(&linked_image::loaded_ranges(&self_test)?)?;
    Ok(fs::write(release.path(&release.name("firmware-self-test", ".hex")), self_test)?)
}

fn build(release: &Release, program: &str, flags: &str) -> TaskResult {
    let mut cargo = Command::new("cargo");
    cargo.args(["rustc", "--quiet", "--locked", "--package", "firmware-stm32", "--bin", program]);
    cargo.args(["--target", CHIP, "--profile", "firmware", "--"]).args(flags.split_whitespace());
    reproducible(&mut cargo, release, CHIP)?;
    run_command(cargo.current_dir(root()))
}

/// All ranges in one, with erased flash between them.
fn flat(ranges: &[LoadedRange]) -> TaskResult<Vec<u8>> {
    let start = ranges.iter().map(|range| range.address).min().ok_or("the image is empty")?;
    let mut bytes = Vec::new();
    for range in ranges {
        let at = usize::try_from(range.address - start)?;
        bytes.resize(bytes.len().max(at + range.bytes.len()), ERASED);
        bytes
            .get_mut(at..at + range.bytes.len())
            .ok_or("a range lies outside")?
            .copy_from_slice(&range.bytes);
    }
    Ok(bytes)
}

/// Intel's format: lines with addresses.
fn hex(ranges: &[LoadedRange]) -> TaskResult<String> {
    let mut records = Vec::new();
    for range in ranges {
        let mut upper = None;
        for (address, line) in (range.address..).step_by(HEX_LINE).zip(range.bytes.chunks(HEX_LINE)) {
            let [high, low] = [address >> 16, address & 0xFFFF].map(u16::try_from);
            let (high, offset) = (high?, low?);
            if upper.replace(high) != Some(high) {
                records.push(Record::ExtendedLinearAddress(high));
            }
            records.push(Record::Data { offset, value: line.to_vec() });
        }
    }
    records.push(Record::EndOfFile);
    let lines: Result<Vec<_>, _> = records.iter().map(Record::to_record_string).collect();
    Ok(lines?.iter().map(|line| format!("{line}\r\n")).collect())
}

fn sizes(elf: &[u8]) -> TaskResult<String> {
    let mut table = TextTable::new([Right("bytes"), Right("address"), Left("section")]);
    for section in Program::read(elf)?.sections {
        table.add([section.size.to_string(), format!("{:#010x}", section.address), section.name]);
    }
    Ok(format!("{table}\n"))
}

/// A map without the paths of this computer.
fn portable(map: &str) -> String {
    let home = env::home_dir().unwrap_or_default().display().to_string();
    let map = map.replace(&root().display().to_string(), "/sevenbot");
    if home.is_empty() { map } else { map.replace(&home, "~") }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use super::*;

    fn ranges() -> Vec<LoadedRange> {
        vec![
            LoadedRange { address: 0x0800_0000, bytes: vec![1, 2] },
            LoadedRange { address: 0x0800_FFF8, bytes: (0..20).collect() },
        ]
    }

    #[test]
    fn a_flat_image_is_erased_between_the_ranges() {
        let bytes = flat(&ranges()).unwrap();
        assert_eq!(bytes.len(), 0xFFF8 + 20);
        assert_eq!(bytes[..3], [1, 2, ERASED]);
        assert_eq!(bytes[0xFFF7..0xFFFA], [ERASED, 0, 1]);
    }

    #[test]
    fn the_hex_file_names_the_addresses_and_leaves_the_gap_out() {
        let text = hex(&ranges()).unwrap();
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(
            lines,
            [
                ":020000040800F2",
                ":020000000102FB",
                ":020000040800F2",
                ":10FFF800000102030405060708090A0B0C0D0E0F81",
                ":020000040801F1",
                ":0400080010111213AE",
                ":00000001FF",
            ]
        );
    }
}

//! The parts of a linked program that are written to the flash.

use object::Endianness;
use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{FileHeader, ProgramHeader};

use crate::ReadResult;

/// Bytes that are written to the flash from an address on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LoadedRange {
    /// The address of the first byte.
    pub address: u32,
    /// The bytes, at least one.
    pub bytes: Vec<u8>,
}

/// The ranges that the ELF file of a program writes to the flash, in ascending order of address. Initial values of
/// static data have their addresses in the flash, not in RAM.
///
/// # Errors
/// The file is not a 32-bit ELF file, or a segment lies outside it.
pub fn loaded_ranges(file: &[u8]) -> ReadResult<Vec<LoadedRange>> {
    let header = FileHeader32::<Endianness>::parse(file)?;
    let endian = header.endian()?;
    let mut ranges: Vec<LoadedRange> = Vec::new();
    for segment in header.program_headers(endian, file)? {
        let bytes = segment.data(endian, file).map_err(|()| "a segment lies outside the file")?;
        if segment.p_type(endian) == PT_LOAD && !bytes.is_empty() {
            ranges.push(LoadedRange { address: segment.p_paddr(endian), bytes: bytes.to_vec() });
        }
    }
    ranges.sort_by_key(|range| range.address);
    Ok(joined(ranges))
}

/// Joins adjacent ranges.
fn joined(ranges: Vec<LoadedRange>) -> Vec<LoadedRange> {
    let mut joined: Vec<LoadedRange> = Vec::new();
    for range in ranges {
        match joined.last_mut() {
            Some(last) if u64::from(last.address) + last.bytes.len() as u64 == u64::from(range.address) => {
                last.bytes.extend(range.bytes);
            }
            _ => joined.push(range),
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_that_touch_become_one() {
        let range = |address, bytes: &[u8]| LoadedRange { address, bytes: bytes.to_vec() };
        let ranges = vec![range(0, &[1, 2]), range(2, &[3]), range(8, &[4])];
        assert_eq!(joined(ranges), [range(0, &[1, 2, 3]), range(8, &[4])]);
    }
}

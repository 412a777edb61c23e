//! A `.dfu` file for the boot loader in the chip's ROM: ST's format DfuSe (UM0391), with the suffix of the USB standard for
//! firmware updates (DFU 1.1, appendix B).
//!
//! ```text
//!   prefix │ target: ranges, each with address and length │ suffix: USB ids, CRC-32
//! ```

use linked_image::LoadedRange;

use crate::run::TaskResult;

/// The boot loader of the chip on USB: ST's vendor id, and the product id of its loaders (AN2606).
const VENDOR: u16 = 0x0483;
const PRODUCT: u16 = 0xDF11;
/// Any version of the device.
const ANY_DEVICE: u16 = 0xFFFF;
/// Version of the suffix for DfuSe files.
const DFUSE: u16 = 0x011A;
/// Length of the prefix and of the suffix.
const PREFIX: usize = 11;
const SUFFIX: u8 = 16;
/// Length of the field for the target's name.
const NAME: usize = 255;

/// The file for these ranges of the flash.
pub(super) fn file(ranges: &[LoadedRange]) -> TaskResult<Vec<u8>> {
    let mut elements = Vec::new();
    for range in ranges {
        elements.extend(range.address.to_le_bytes());
        elements.extend(u32::try_from(range.bytes.len())?.to_le_bytes());
        elements.extend(&range.bytes);
    }
    let mut target = b"Target\0".to_vec();
    target.extend(1_u32.to_le_bytes()); // It has a name.
    let mut name = b"7Bot V2".to_vec();
    name.resize(NAME, 0);
    target.extend(name);
    target.extend(u32::try_from(elements.len())?.to_le_bytes());
    target.extend(u32::try_from(ranges.len())?.to_le_bytes());
    target.extend(elements);

    let mut file = b"DfuSe\x01".to_vec();
    file.extend(u32::try_from(PREFIX + target.len())?.to_le_bytes());
    file.push(1); // One target.
    file.extend(target);
    for word in [ANY_DEVICE, PRODUCT, VENDOR, DFUSE] {
        file.extend(word.to_le_bytes());
    }
    file.extend(b"UFD");
    file.push(SUFFIX);
    // CRC-32 of Ethernet, without its last inversion.
    let crc = !crc32(&file);
    file.extend(crc.to_le_bytes());
    Ok(file)
}

fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    crc.update(bytes);
    crc.sum()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use super::*;

    #[test]
    fn each_field_is_where_the_format_has_it() {
        let ranges = [
            LoadedRange { address: 0x0800_0000, bytes: vec![1, 2, 3] },
            LoadedRange { address: 0x0800_C000, bytes: vec![4] },
        ];
        let file = file(&ranges).unwrap();
        let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap());
        assert_eq!(file[..6], *b"DfuSe\x01");
        assert_eq!(word(6) as usize, file.len() - 16, "length without the suffix");
        assert_eq!(file[11..18], *b"Target\0");
        let elements = 11 + 274;
        assert_eq!((word(elements - 8), word(elements - 4)), (8 + 3 + 8 + 1, 2));
        assert_eq!((word(elements), word(elements + 4)), (0x0800_0000, 3));
        assert_eq!(file[elements + 8..elements + 11], [1, 2, 3]);
        assert_eq!((word(elements + 11), word(elements + 15)), (0x0800_C000, 1));
        let suffix = &file[file.len() - 16..];
        assert_eq!(suffix[..12], [0xFF, 0xFF, 0x11, 0xDF, 0x83, 0x04, 0x1A, 0x01, b'U', b'F', b'D', 16]);
        assert_eq!(crc32(&file), u32::MAX, "a CRC with its value behind it has a fixed remainder");
    }
}

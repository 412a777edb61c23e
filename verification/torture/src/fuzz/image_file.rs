//! The simulator's settings image with any content. A file of another length is refused. A damaged file is refused and not
//! changed. The settings of any other file are in range (D19), stay the same after a restart, and can be replaced.

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use arbitrary::Arbitrary;
use arm_sim::flash::{ERASED, SECTOR_SIZE, SIZE};
use host_sim::eeprom::{Eeprom, ImageError};
use protocol_core::registers::map21::OPTIONS;
use protocol_core::registers::{Access, Image, MAP, Region, RegisterFile};
use protocol_core::settings::{Settings, Storage};
use tempfile::NamedTempFile;

static FILE: LazyLock<NamedTempFile> = LazyLock::new(|| NamedTempFile::new_in("/dev/shm").expect("a file"));
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// The content of the file, and the settings that replace those in it.
#[derive(Arbitrary, Debug)]
pub struct Input<'a> {
    filled_with: u8,
    patches: Vec<ImagePatch<'a>>,
    /// If 7 modulo 8, the last byte of the file is missing.
    missing: u8,
    next: [u8; Image::LENGTH],
}

#[derive(Arbitrary, Debug)]
enum ImagePatch<'a> {
    Bytes {
        at: u16,
        bytes: &'a [u8],
    },
    /// The mark of a blank sector.
    Mark {
        is_second: bool,
        generation: u32,
    },
    /// A slot with a valid checksum, sealed or not.
    Record {
        at: u16,
        generation: u32,
        settings: [u8; Image::LENGTH],
        is_sealed: bool,
    },
    Flip {
        bit: u32,
    },
}

/// Opens the image. Panics if an invariant is violated.
pub fn run(input: &Input<'_>) {
    let bytes = content(input);
    fs::write(FILE.path(), &bytes).expect("a file can be written");
    match start(FILE.path()) {
        Err(ImageError::NotAnImage { .. }) => assert_ne!(bytes.len(), SIZE),
        Err(ImageError::Damaged(_)) => assert!(fs::read(FILE.path()).is_ok_and(|now| now == bytes)),
        Err(other) => panic!("{other}"),
        Ok(settings) => check_store(settings, input.next),
    }
}

type FileSettings = Settings<arm_sim::flash::Flash<host_sim::image_file::ImageFile>>;

fn start(path: &Path) -> Result<FileSettings, ImageError> {
    Ok(Settings::open(Eeprom::File(path.to_owned()).open(None)?))
}

fn check_store(mut settings: FileSettings, next: [u8; Image::LENGTH]) {
    check_settings(settings.found());
    // There is room for a save: either the sectors are blank, or the start has made room.
    assert_eq!(settings.storage(), Storage::Ready);
    let found = settings.found().copied();
    settings = restart(settings, found);
    let next = RegisterFile::new([0; 6], Some(&Image(next))).image();
    assert_eq!(settings.save(&next), Storage::Ready);
    restart(settings, Some(next));
}

fn restart(settings: FileSettings, expected: Option<Image>) -> FileSettings {
    // An open image is locked, so close it before it is opened again.
    drop(settings);
    match start(FILE.path()) {
        Ok(settings) => {
            assert_eq!(settings.found().copied(), expected);
            settings
        }
        Err(error) => panic!("{error}"),
    }
}

/// Checks the settings in the registers after a start.
fn check_settings(stored: Option<&Image>) {
    let file = RegisterFile::new([0; 6], stored);
    let Image(settings) = file.image();
    for row in MAP.iter().filter(|row| row.region == Region::Eeprom) {
        for address in (row.address..).take(row.count.into()) {
            // The EEPROM region begins at address 8.
            let value = settings[usize::from(address - 8)];
            assert!(row.range.contains(value.into()), "register {address} is {value}");
            let most = if OPTIONS.holds(address) { 3 } else { 0 };
            assert!(row.access == Access::ReadWrite || value <= most, "register {address} is {value}");
        }
    }
}

fn content(input: &Input<'_>) -> Vec<u8> {
    let mut content =
        vec![if input.filled_with.is_multiple_of(4) { ERASED } else { input.filled_with }; SIZE];
    for patch in &input.patches {
        match patch {
            ImagePatch::Bytes { at, bytes } => put(&mut content, usize::from(*at) % SIZE, bytes),
            ImagePatch::Mark { is_second, generation } => {
                let mark = CRC.checksum(&generation.to_le_bytes()).to_le_bytes();
                put(&mut content, usize::from(*is_second) * SECTOR_SIZE, &mark);
            }
            ImagePatch::Record { at, generation, settings, is_sealed } => {
                let mut slot = [generation.to_le_bytes().as_slice(), settings].concat();
                slot.extend(CRC.checksum(&slot).to_le_bytes());
                slot.extend(if *is_sealed { [0x5E, 0xA1, 0xC3, 0x96] } else { [ERASED; 4] });
                put(&mut content, usize::from(*at) * 32 % SIZE, &slot);
            }
            ImagePatch::Flip { bit } => content[*bit as usize / 8 % SIZE] ^= 1 << (bit % 8),
        }
    }
    content.truncate(SIZE - usize::from(input.missing % 8 == 7));
    content
}

fn put(content: &mut [u8], at: usize, bytes: &[u8]) {
    content[at..].iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
}

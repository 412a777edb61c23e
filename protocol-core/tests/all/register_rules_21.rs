//! Writes in map 2.1 against the text of the protocol (M2, M3, M5, M6). The writes cover every range of addresses in each lock
//! state; all bytes of such a write are equal. Other writes cover every value of each register.

use protocol_core::registers::map::LAST_REFUSAL;
use protocol_core::registers::map21::find_readable;
use protocol_core::registers::{Accepted, Image, Map, RegisterFile};

const LOCK: u8 = 28;
const OFFSETS: std::ops::RangeInclusive<u8> = 13..=19;

/// Does a write of function 04 have an effect at this address? This follows the text of M2, not the table.
fn takes_effect(address: u8, lock: u8) -> bool {
    match address {
        11..=20 => lock == 0,
        28..=52 | 54..=66 | 68..=73 | 82 | 90 => true,
        _ => false,
    }
}

fn is_in_range(address: u8, value: u8) -> bool {
    match address {
        12 => value <= 7,
        13..=19 => matches!(value, 0..=16 | 112..=144 | 240..=255),
        20 => value <= 3,
        28 | 30 | 31 | 66 => value <= 1,
        29 => value <= 2,
        32..=45 | 82 | 90 => value <= 100,
        46..=52 => value <= 180,
        _ => true,
    }
}

/// What a read gives after a write of this byte.
fn shown(address: u8, value: u8) -> u8 {
    match (address, value) {
        (13..=19, 0..=16) => 128 + value,
        (13..=19, 240..=255) => value - 128,
        _ => value,
    }
}

fn expected(before: &[u8; 256], address: u8, values: &[u8]) -> Result<[u8; 256], u8> {
    let lock = before[usize::from(LOCK)];
    let mut after = *before;
    // After a write in map 2.1, an offset of 0 reads 128 (M5).
    for at in OFFSETS.filter(|&at| before[usize::from(at)] == 0) {
        after[usize::from(at)] = 128;
    }
    for (at, &value) in (address..=255).zip(values) {
        if takes_effect(at, lock) {
            if !is_in_range(at, value) {
                return Err(at);
            }
            // A read of 54 to 60 gives the present positions.
            if !(54..=60).contains(&at) {
                after[usize::from(at)] = shown(at, value);
            }
        }
    }
    Ok(after)
}

fn snapshot(file: &RegisterFile) -> [u8; 256] {
    std::array::from_fn(|address| file.get(u8::try_from(address).unwrap()))
}

fn apply(file: &mut RegisterFile, accepted: &Accepted<'_>) -> [u8; 256] {
    file.apply(accepted);
    snapshot(file)
}

fn write(file: &mut RegisterFile, address: u8, values: &[u8]) -> Result<[u8; 256], u8> {
    let accepted = file.check_map21(address, values).map_err(|wrong| wrong.address)?;
    Ok(apply(file, &accepted))
}

fn write_22(file: &mut RegisterFile, address: u8, values: &[u8]) -> [u8; 256] {
    let accepted = file.check(address, values).unwrap();
    apply(file, &accepted)
}

fn file(lock: u8) -> RegisterFile {
    let mut file = RegisterFile::new([1, 2, 3, 4, 5, 6], None);
    file.set(LOCK, lock);
    file
}

fn offsets(file: &RegisterFile) -> [u8; 7] {
    file.read(13, 7).try_into().unwrap()
}

#[test]
fn m02_every_range_of_addresses() {
    for lock in [0, 1] {
        let fresh = file(lock);
        let before = snapshot(&fresh);
        for filler in [0, 1, 2, 4, 8, 17, 101, 112, 128, 145, 181, 239, 240, 255] {
            let values = [filler; 255];
            for address in 0..=255_u8 {
                for count in 0..=255_usize.min(256 - usize::from(address)) {
                    let mut file = fresh.clone();
                    let outcome = write(&mut file, address, &values[..count]);
                    let wanted = expected(&before, address, &values[..count]);
                    assert_eq!(outcome, wanted, "{address} {count} {filler}");
                    if outcome.is_err() {
                        assert_eq!(snapshot(&file), before, "whole frame or nothing");
                    }
                }
            }
        }
    }
}

#[test]
fn m02_every_value_of_every_register() {
    for lock in [0, 1] {
        let fresh = file(lock);
        let before = snapshot(&fresh);
        for address in 0..=255 {
            for value in 0..=255 {
                let outcome = write(&mut fresh.clone(), address, &[value]);
                assert_eq!(outcome, expected(&before, address, &[value]), "{address} = {value}");
            }
        }
    }
}

#[test]
fn m03_reads_are_a_union_of_both_maps() {
    let name = |address| find_readable(address).map(|row| row.name);
    assert_eq!(name(20), Some("OPTIONS"));
    assert_eq!([54, 60].map(name), [Some("PRESENT_POSITION"); 2]);
    assert_eq!([61, 63].map(name), [Some("TOOL_DIRECTION"), Some("DISC_DIRECTION")]);
    assert_eq!([83, 91].map(name), [Some("PRESENT_ANGLE"), Some("PRESENT_LOAD")]);
    assert_eq!(name(LAST_REFUSAL.address), Some("LAST_REFUSAL"));
    assert_eq!([67, 74, 81, 98, 239].map(name), [None; 5]);
}

#[test]
fn m05_the_last_write_decides_how_offsets_read() {
    let mut file = file(0);
    write(&mut file, 13, &[1, 254, 0, 1, 255, 0, 1]).unwrap();
    let biased = [129, 126, 128, 129, 127, 128, 129];
    assert_eq!(offsets(&file), biased);
    let written = file.clone();
    write(&mut file, 13, &biased).unwrap();
    assert_eq!((offsets(&file), file.image()), (biased, written.image()), "what is read can be written back");
    write_22(&mut file, 0, &[]);
    let signed = [1, 0x82, 0, 1, 0x81, 0, 1];
    assert_eq!(offsets(&file), signed, "a write of no registers is one");
    write_22(&mut file, 13, &signed);
    assert_eq!((offsets(&file), file.image()), (signed, written.image()));
    write(&mut file, 0, &[]).unwrap();
    assert_eq!(offsets(&file), biased);
}

#[test]
fn m05_a_refused_write_does_not_change_how_offsets_read() {
    let mut file = file(0);
    assert_eq!(write(&mut file, 13, &[17]), Err(13));
    assert_eq!(offsets(&file), [0; 7]);
    write(&mut file, 13, &[16]).unwrap();
    assert!(file.check(13, &[17]).is_err());
    assert_eq!(offsets(&file), [144, 128, 128, 128, 128, 128, 128]);
}

#[test]
fn m05_offsets_are_stored_once() {
    let mut file = file(0);
    write_22(&mut file, 13, &[0x80, 0x85, 5]);
    let image = file.image();
    write(&mut file, 46, &[90]).unwrap();
    assert_eq!(file.image(), image, "minus zero, too");
    let accepted = file.check_map21(13, &[0, 251, 133]).unwrap();
    assert_eq!(accepted.map(), Map::V21);
    assert_eq!(file.first_changed_setting(&accepted), Some(13), "only minus zero differs");
    assert_eq!(accepted.values_at(13), Some([0, 0x85, 5]), "sign and magnitude");
    assert_eq!(accepted.values_at::<4>(13), None, "the frame ends before");
}

#[test]
fn m06_register_20_is_a_setting() {
    let mut file = file(0);
    assert_eq!(write_22(&mut file, 20, &[3])[20], 0, "reserved in map 2.2");
    let fresh = file.image();
    let accepted = file.check_map21(20, &[1]).unwrap();
    assert_eq!(file.first_changed_setting(&accepted), Some(20));
    apply(&mut file, &accepted);
    let mut image = fresh;
    image.0[12] = 1;
    assert_eq!(file.image(), image, "no other stored byte changes");
    let mut again = RegisterFile::new([0; 6], Some(&image));
    assert_eq!((again.get(20), offsets(&again)), (1, [128; 7]), "the 128 form before any write");
    write_22(&mut again, 0, &[]);
    assert_eq!(offsets(&again), [0; 7]);
    again.forget_last_write();
    assert_eq!(offsets(&again), [128; 7]);
}

#[test]
fn m06_a_stored_value_out_of_range_counts_as_the_default() {
    let mut image = Image([0; Image::LENGTH]);
    image.0[12] = 4;
    assert_eq!(RegisterFile::new([0; 6], Some(&image)).get(20), 0);
}

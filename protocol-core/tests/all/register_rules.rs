//! Reads and writes against the table (D1, D2, D15 to D17, D22). The reads cover every range of addresses. So do the writes, in
//! each lock and motor state; all bytes of such a write are equal. Other writes cover every value of each register.

use protocol_core::registers::map::{baud_rate, fault, find};
use protocol_core::registers::map21::find_readable;
use protocol_core::registers::{Access, MAP, Region, Register, RegisterFile};

const LOCK: u8 = 28;
const STATE: u8 = 29;

fn row(address: u8) -> Option<&'static Register> {
    MAP.iter().find(|row| row.holds(address))
}

/// Does a write have an effect at this address? This follows the text of the protocol, not the code of the register file.
fn takes_effect(address: u8, lock: u8) -> bool {
    row(address).is_some_and(|row| match (row.access, row.region) {
        (Access::ReadWrite, Region::Ram) => true,
        (Access::ReadWrite, Region::Eeprom) => lock == 0,
        _ => false,
    })
}

/// Reason 2 of register 244.
const OUT_OF_RANGE: u8 = 2;
/// Reason 4 of register 244.
const HALF_A_WORD: u8 = 4;

/// The address of the low byte of the two-byte register at `address`; `None` if the register there has one byte.
fn word_of(address: u8) -> Option<u8> {
    matches!(address, 128..=185).then_some(address & !1)
}

/// The outcome that a write should have: all 256 values after it, or the reason and the register of its refusal.
fn expected(before: &[u8; 256], address: u8, values: &[u8]) -> Result<[u8; 256], (u8, u8)> {
    let lock = before[usize::from(LOCK)];
    let mut after = *before;
    let byte = |at: u8| values.get(usize::from(at.checked_sub(address)?)).copied();
    for (at, &value) in (address..=255).zip(values) {
        if !takes_effect(at, lock) {
            continue;
        }
        let raw = match word_of(at) {
            None => value.into(),
            Some(low) => match (byte(low), byte(low + 1)) {
                (Some(low), Some(high)) => u16::from_le_bytes([low, high]),
                _ => return Err((HALF_A_WORD, low)),
            },
        };
        if !row(at).unwrap().range.contains(raw) {
            return Err((OUT_OF_RANGE, word_of(at).unwrap_or(at)));
        }
        after[usize::from(at)] = value;
    }
    Ok(after)
}

fn snapshot(file: &RegisterFile) -> [u8; 256] {
    std::array::from_fn(|address| file.get(u8::try_from(address).unwrap()))
}

fn write(file: &mut RegisterFile, address: u8, values: &[u8]) -> Result<[u8; 256], (u8, u8)> {
    let accepted = file.check(address, values).map_err(|refused| (refused.reason, refused.address))?;
    file.apply(&accepted);
    Ok(snapshot(file))
}

fn file(lock: u8, state: u8) -> RegisterFile {
    let mut file = RegisterFile::new([1, 2, 3, 4, 5, 6], None);
    file.set(LOCK, lock);
    file.set(STATE, state);
    file
}

#[test]
fn d15_d16_d17_every_range_of_addresses_in_every_state() {
    let mut tried = 0_u32;
    for (lock, state) in [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)] {
        let fresh = file(lock, state);
        let before = snapshot(&fresh);
        // 0 and 1 are in the range of nearly every register; the other values test the limits.
        for filler in [0, 1, 2, 4, 8, 17, 51, 70, 100, 181, 0x81, 0x91, 255] {
            let values = [filler; 255];
            for address in 0..=255_u8 {
                for count in 0..=255_usize.min(256 - usize::from(address)) {
                    let mut file = fresh.clone();
                    let outcome = write(&mut file, address, &values[..count]);
                    assert_eq!(
                        outcome,
                        expected(&before, address, &values[..count]),
                        "{address} {count} {filler}"
                    );
                    if outcome.is_err() {
                        assert_eq!(snapshot(&file), before, "no half poses (D16)");
                    }
                    tried += 1;
                }
            }
        }
    }
    println!("{tried} writes agree with the table");
}

#[test]
fn d16_every_value_of_every_register() {
    for lock in [0, 1] {
        let fresh = file(lock, 1);
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
fn d22_every_value_of_every_two_byte_register() {
    let fresh = file(1, 1);
    let before = snapshot(&fresh);
    for address in (128..=184).step_by(2) {
        for value in 0..=u16::MAX {
            let bytes = value.to_le_bytes();
            let outcome = write(&mut fresh.clone(), address, &bytes);
            assert_eq!(outcome, expected(&before, address, &bytes), "{address} = {value}");
        }
    }
}

#[test]
fn d16_one_bad_value_anywhere_spoils_the_whole_pose() {
    for bad in 0..7 {
        let mut file = file(1, 1);
        let mut pose = [45; 7];
        pose[bad] = 181;
        let before = snapshot(&file);
        assert_eq!(write(&mut file, 46, &pose), Err((OUT_OF_RANGE, 46 + u8::try_from(bad).unwrap())));
        assert_eq!(snapshot(&file), before);
    }
}

#[test]
fn d15_the_lock_counts_as_it_stood_before_the_frame() {
    let mut locked = file(1, 1);
    let frame: Vec<u8> = (11..=28).map(|address| u8::from(address == 11) * 9).collect();
    let after = write(&mut locked, 11, &frame).unwrap();
    assert_eq!((after[11], after[28]), (0, 0), "opened by the frame, not for it");
    let closing: Vec<u8> = (11..=28).map(|address| u8::from(address == 28 || address == 11)).collect();
    let after = write(&mut locked, 11, &closing).unwrap();
    assert_eq!((after[11], after[28]), (1, 1), "closed by the frame, not for it");
}

#[test]
fn d01_d02_every_read_gives_the_values_of_its_range() {
    let file = file(0, 1);
    let all = snapshot(&file);
    for address in 0..=255_u8 {
        for count in 0..=255_u8 {
            let start = usize::from(address);
            let expected = all.get(start..start + usize::from(count)).unwrap_or(&[]);
            assert_eq!(file.read(address, count), expected, "{address} {count}");
        }
    }
}

#[test]
fn addresses_outside_the_table_read_zero_and_cannot_be_written() {
    let mut file = file(0, 1);
    for address in (0..=255).filter(|&address| find_readable(address).is_none()) {
        assert_eq!(file.get(address), 0);
        write(&mut file, address, &[0xFF]).unwrap();
        assert_eq!(file.get(address), 0, "{address}");
    }
}

#[test]
fn a_row_is_found_by_each_of_its_addresses() {
    for address in 0..=255 {
        let holding: Vec<_> = MAP.iter().filter(|row| row.holds(address)).collect();
        assert_eq!(find(address), holding.first().copied(), "{address}");
        assert!(holding.len() <= 1, "{address}");
    }
    assert_eq!(find(49).map(|row| row.name), Some("TARGET_POSITION"));
    assert_eq!(find(100), None);
}

#[test]
fn codes_are_as_released() {
    let faults = [
        fault::SETTINGS_STORAGE,
        fault::SERVO_BUS,
        fault::WATCHDOG_RESTART,
        fault::BROWN_OUT_RESTART,
        fault::CRYSTAL_FAILED,
        fault::RECEIVE_OVERRUN,
        fault::HOST_SILENT,
    ];
    assert_eq!(faults, [1, 2, 4, 8, 16, 32, 64]);
    let rates = [115_200, 250_000, 500_000, 1_000_000, 57_600, 38_400, 19_200, 9_600];
    assert_eq!([0, 1, 2, 3, 4, 5, 6, 7].map(baud_rate), rates);
    assert_eq!(baud_rate(8), 115_200, "no stored byte locks a user out (D19)");
}

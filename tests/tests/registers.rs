//! What registers hold and take: `docs/protocol.md`, sections 3 to 6.

use system_tests::registers::{
    BAUD_RATE, CHIP_ID, DEVICE_CODE, DEVICE_ID, EEPROM_LOCK, EFFECTOR_TYPE, FIRMWARE_VERSION,
    FRAMES_ACCEPTED, FRAMES_REFUSED, LAST_REFUSAL, MOTOR_STATE, OFFSET, PRESENT_POSITION, SPEED, STATUS,
    SUPPLY_VOLTAGE, TARGET_POSITION, TIME, VACUUM_PUMP,
};
use system_tests::{Bench, Need, Setup, with_arm};

/// Settings that a test changed are put back: a real arm is somebody's.
fn with_open_lock(arm: &mut Bench, test: impl FnOnce(&mut Bench)) {
    arm.write(EEPROM_LOCK, &[0]);
    test(arm);
    arm.write(EEPROM_LOCK, &[1]);
}

/// D7: a host can tell this firmware from the maker's, which are 10, 21 and 22.
#[test]
fn d07_the_arm_says_what_it_is() {
    with_arm(Setup::any(), |arm| {
        assert_eq!(arm.register(DEVICE_CODE), 7);
        assert_eq!(arm.register(FIRMWARE_VERSION), 30);
    });
}

/// D8: six bytes, the most significant first.
#[test]
fn d08_the_chip_id_is_the_one_it_was_given() {
    with_arm(Setup::any().chip_id("0123456789ab"), |arm| {
        assert_eq!(arm.read(CHIP_ID, 6), [0x01, 0x23, 0x45, 0x67, 0x89, 0xAB]);
    });
}

/// Section 2: the defaults of a new arm.
#[test]
fn a_new_arm_has_the_documented_defaults() {
    with_arm(Setup::any().needs(Need::FreshArm), |arm| {
        assert_eq!(arm.read(8, 20), [0; 20], "settings");
        assert_eq!(arm.read(EEPROM_LOCK, 4), [1, 1, 0, 0]);
        assert_eq!(arm.read(SPEED, 7), [60; 7]);
        assert_eq!(arm.read(TIME, 7), [0; 7]);
        assert_eq!(arm.read(53, 1), [0]);
        assert_eq!(arm.read(61, 179), [0; 179], "no registers: they answer, and read 0");
        let faults = u8::from(!arm.can(Need::Persistence));
        assert_eq!(
            arm.read(STATUS, 3),
            [1, faults, 0],
            "layout 1, no fault but that of the storage, all servos there"
        );
    });
}

/// D9: an offset may be -16 to 16 in sign and magnitude; minus zero is zero.
#[test]
fn d09_offsets_are_sign_and_magnitude() {
    with_arm(Setup::any(), |arm| {
        with_open_lock(arm, |arm| {
            for byte in [0x85, 0x80, 0x90, 0x10, 0x00] {
                let refused = arm.counter(FRAMES_REFUSED);
                arm.write(OFFSET, &[byte]);
                let held = arm.register(OFFSET);
                assert!(held == byte || (byte == 0x80 && held == 0), "{byte:#x} became {held:#x}");
                assert_eq!(arm.counter(FRAMES_REFUSED), refused);
            }
            for byte in [0x11, 0x91, 0x7F, 0xFF] {
                arm.write(OFFSET, &[byte]);
                assert_eq!(arm.register(OFFSET), 0, "{byte:#x} is out of range");
                assert_eq!(arm.read(LAST_REFUSAL, 2), [2, OFFSET]);
            }
        });
    });
}

/// D15: read-only and reserved registers keep their values; what else the frame holds takes effect.
#[test]
fn d15_bytes_on_read_only_registers_have_no_effect_and_the_others_do() {
    with_arm(Setup::any(), |arm| {
        let before = arm.read(0, 61);
        let refused = arm.counter(FRAMES_REFUSED);
        let mut wanted = before.clone();
        for (register, value) in (0..).zip(&mut wanted) {
            match register {
                // ROM, settings under the lock, measured positions: values that would do in any register.
                0..=27 | 54.. => *value ^= 1,
                EFFECTOR_TYPE | VACUUM_PUMP => *value = 1,
                _ => {}
            }
        }
        arm.write(0, &wanted);
        let after = arm.read(0, 54);
        assert_eq!(after[..28], before[..28], "ROM and settings");
        assert_eq!(after[30..32], [1, 1], "effector and pump");
        assert_eq!(after[32..54], before[32..54]);
        assert_eq!(arm.counter(FRAMES_REFUSED), refused, "it is no error");
        arm.write(VACUUM_PUMP, &[0]);
    });
}

/// D15: settings need the lock open.
#[test]
fn d15_settings_are_written_only_while_the_lock_is_open() {
    with_arm(Setup::any(), |arm| {
        let before = arm.register(DEVICE_ID);
        let wanted = before ^ 0x55;
        arm.write(DEVICE_ID, &[wanted]);
        assert_eq!(arm.register(DEVICE_ID), before);
        with_open_lock(arm, |arm| {
            arm.write(DEVICE_ID, &[wanted]);
            assert_eq!(arm.register(DEVICE_ID), wanted);
        });
        arm.write(DEVICE_ID, &[before]);
        assert_eq!(arm.register(DEVICE_ID), wanted, "locked again");
    });
}

/// D15: the lock counts as it stood before the frame, whichever way the frame turns it.
#[test]
fn d15_the_lock_counts_as_it_stood_before_the_frame() {
    with_arm(Setup::any(), |arm| {
        let before = arm.read(DEVICE_ID, 18);
        let mut frame = before.clone();
        frame[0] ^= 0x55;
        frame[17] = 0;
        arm.write(DEVICE_ID, &frame);
        assert_eq!(arm.read(DEVICE_ID, 1), before[..1], "the frame that opens the lock finds it closed");
        assert_eq!(arm.register(EEPROM_LOCK), 0);
        frame[17] = 1;
        arm.write(DEVICE_ID, &frame);
        assert_eq!(arm.read(DEVICE_ID, 1), frame[..1], "the frame that closes the lock finds it open");
        assert_eq!(arm.register(EEPROM_LOCK), 1);
    });
}

/// D16: one value out of range, and the whole frame has no effect: no half poses.
#[test]
fn d16_a_frame_with_one_bad_value_is_rejected_whole_and_counted() {
    with_arm(Setup::any(), |arm| {
        let before = arm.read(EFFECTOR_TYPE, 31);
        // The first and the last register of each kind, one past its range.
        let bad = [
            (EEPROM_LOCK, 2),
            (MOTOR_STATE, 3),
            (SPEED, 101),
            (TIME + 6, 101),
            (TARGET_POSITION + 6, 181),
            (53, 51),
        ];
        for (register, value) in bad {
            let refused = arm.counter(FRAMES_REFUSED);
            let mut frame = arm.read(EEPROM_LOCK, 26);
            frame[usize::from(EFFECTOR_TYPE - EEPROM_LOCK)] ^= 1;
            frame[usize::from(TARGET_POSITION - EEPROM_LOCK)] ^= 1;
            frame[usize::from(register - EEPROM_LOCK)] = value;
            arm.write(EEPROM_LOCK, &frame);
            assert_eq!(arm.read(EFFECTOR_TYPE, 24), before[..24], "{value} in register {register}");
            assert_eq!(arm.read(LAST_REFUSAL, 2), [2, register]);
            assert_eq!(arm.counter(FRAMES_REFUSED), refused.wrapping_add(1));
        }
    });
}

/// D16: a value that would have no effect anyway is not judged.
#[test]
fn d16_values_without_effect_may_be_anything() {
    with_arm(Setup::any(), |arm| {
        let refused = arm.counter(FRAMES_REFUSED);
        arm.write(BAUD_RATE, &[200]);
        arm.write(PRESENT_POSITION, &[255; 7]);
        arm.write(CHIP_ID, &[255; 8]);
        assert_eq!(arm.register(BAUD_RATE), 0);
        assert_eq!(arm.counter(FRAMES_REFUSED), refused);
    });
}

/// D16, D17: the largest value of every register is taken, all of them in one frame.
#[test]
fn d17_a_frame_takes_effect_whole() {
    with_arm(Setup::any(), |arm| {
        let mut wanted = vec![1, 1, 1, 0];
        wanted.extend([100; 14]);
        // Targets as they are: nothing here is to move.
        wanted.extend(arm.read(TARGET_POSITION, 7));
        arm.write(EEPROM_LOCK, &wanted);
        assert_eq!(arm.read(EEPROM_LOCK, 25), wanted);
    });
}

/// D20: the pump's register can be set and cleared. What pump and valve do shows on no line to the host.
#[test]
fn d20_the_pump_is_a_register() {
    with_arm(Setup::any(), |arm| {
        for state in [1, 0] {
            arm.write(VACUUM_PUMP, &[state]);
            assert_eq!(arm.register(VACUUM_PUMP), state);
        }
    });
}

/// Section 4: accepted frames are counted, reads and writes alike, and the answer knows of its own request.
#[test]
fn accepted_frames_are_counted() {
    with_arm(Setup::any(), |arm| {
        let first = arm.counter(FRAMES_ACCEPTED);
        arm.write(EFFECTOR_TYPE, &[1]);
        arm.read(0, 1);
        assert_eq!(arm.counter(FRAMES_ACCEPTED), first.wrapping_add(3));
    });
}

/// Section 4: voltage and temperature are those of the servos, once these were asked.
#[test]
fn voltage_and_temperature_are_measured() {
    with_arm(Setup::any(), |arm| {
        arm.wait_until("voltage and temperature are known", |arm| {
            let measured = arm.read(SUPPLY_VOLTAGE, 2);
            (40..=90).contains(&measured[0]) && (10..=80).contains(&measured[1])
        });
    });
}

//! Values of registers: `docs/protocol.md`, sections 3 to 6.

use system_tests::registers::{
    BAUD_RATE, CHIP_ID, DEVICE_CODE, DEVICE_ID, EEPROM_LOCK, EFFECTOR_TYPE, FIRMWARE_VERSION,
    FRAMES_ACCEPTED, FRAMES_REFUSED, LAST_REFUSAL, MOTOR_STATE, OFFSET, PRESENT_POSITION, SPEED, STATUS,
    SUPPLY_VOLTAGE, TARGET_POSITION, TIME, VACUUM_PUMP,
};
use system_tests::{Need, TestArm, TestSetup, with_arm};

/// Runs a test with the EEPROM lock open.
fn with_open_lock(arm: &mut TestArm, test: impl FnOnce(&mut TestArm)) {
    arm.write(EEPROM_LOCK, &[0]);
    test(arm);
    arm.write(EEPROM_LOCK, &[1]);
}

/// D7: the version differs from those of the maker's firmware, 10, 21 and 22.
#[test]
fn d07_device_code_and_version_identify_the_firmware() {
    with_arm(TestSetup::any(), |arm| {
        assert_eq!(arm.register(DEVICE_CODE), 7);
        assert_eq!(arm.register(FIRMWARE_VERSION), 30);
    });
}

/// D8: six bytes, most significant byte first.
#[test]
fn d08_the_registers_hold_the_chip_id() {
    with_arm(TestSetup::any().chip_id("0123456789ab"), |arm| {
        assert_eq!(arm.read(CHIP_ID, 6), [0x01, 0x23, 0x45, 0x67, 0x89, 0xAB]);
    });
}

/// The defaults of a new arm: `docs/registers.md`.
#[test]
fn a_new_arm_has_the_documented_defaults() {
    with_arm(TestSetup::any().needs(Need::FreshArm), |arm| {
        assert_eq!(arm.read(8, 20), [0; 20], "settings");
        assert_eq!(arm.read(EEPROM_LOCK, 4), [1, 1, 0, 0]);
        assert_eq!(arm.read(SPEED, 7), [60; 7]);
        assert_eq!(arm.read(TIME, 7), [0; 7]);
        assert_eq!(arm.read(53, 1), [0]);
        let unused = [0; 48];
        assert_eq!(arm.read(61, 22), [&unused[..5], &[1], &unused[..16]].concat(), "66 is 1 (M3)");
        assert_eq!(arm.register(90), 0);
        assert_eq!(arm.read(98, 30), unused[..30], "unused addresses read 0");
        assert_eq!(arm.read(184, 6), [0; 6], "no stream, no watchdog, no limits, reports in degrees");
        assert_eq!(arm.register(191), 1, "the layout of the extended block");
        assert_eq!(arm.read(192, 8), [1, 70, 40, 0, 0, 0, 0, 1], "the protection block");
        assert_eq!(arm.read(200, 40), unused[..40], "unused addresses read 0");
        let faults = u8::from(!arm.has(Need::Persistence));
        assert_eq!(
            arm.read(STATUS, 3),
            [1, faults, 0],
            "layout 1, a fault only without storage, no missing servo"
        );
    });
}

/// D9: an offset is -16 to 16 in sign and magnitude. Minus zero is zero.
#[test]
fn d09_offsets_are_sign_and_magnitude() {
    with_arm(TestSetup::any(), |arm| {
        with_open_lock(arm, |arm| {
            for byte in [0x85, 0x80, 0x90, 0x10, 0x00] {
                let refused = arm.counter(FRAMES_REFUSED);
                arm.write(OFFSET, &[byte]);
                let value = arm.register(OFFSET);
                assert!(value == byte || (byte == 0x80 && value == 0), "{byte:#x} became {value:#x}");
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

/// D15: read-only and reserved registers keep their values. The other values of the frame take effect.
#[test]
fn d15_only_bytes_on_read_only_registers_have_no_effect() {
    with_arm(TestSetup::any(), |arm| {
        let before = arm.read(0, 61);
        let refused = arm.counter(FRAMES_REFUSED);
        let mut expected = before.clone();
        for (register, value) in (0..).zip(&mut expected) {
            match register {
                // ROM, locked settings and measured positions, with values that are in range.
                0..=27 | 54.. => *value ^= 1,
                EFFECTOR_TYPE | VACUUM_PUMP => *value = 1,
                _ => {}
            }
        }
        arm.write(0, &expected);
        let after = arm.read(0, 54);
        assert_eq!(after[..28], before[..28], "ROM and settings");
        assert_eq!(after[30..32], [1, 1], "effector and pump");
        assert_eq!(after[32..54], before[32..54]);
        assert_eq!(arm.counter(FRAMES_REFUSED), refused, "this is no refusal");
        arm.write(VACUUM_PUMP, &[0]);
    });
}

/// D15: a write of settings needs the open lock.
#[test]
fn d15_settings_are_written_only_while_the_lock_is_open() {
    with_arm(TestSetup::any(), |arm| {
        let before = arm.register(DEVICE_ID);
        let expected = before ^ 0x55;
        arm.write(DEVICE_ID, &[expected]);
        assert_eq!(arm.register(DEVICE_ID), before);
        with_open_lock(arm, |arm| {
            arm.write(DEVICE_ID, &[expected]);
            assert_eq!(arm.register(DEVICE_ID), expected);
        });
        arm.write(DEVICE_ID, &[before]);
        assert_eq!(arm.register(DEVICE_ID), expected, "locked again");
    });
}

/// D15: the state of the lock before the frame applies, even if the frame changes it.
#[test]
fn d15_the_state_of_the_lock_before_the_frame_applies() {
    with_arm(TestSetup::any(), |arm| {
        let before = arm.read(DEVICE_ID, 18);
        let mut frame = before.clone();
        frame[0] ^= 0x55;
        frame[17] = 0;
        arm.write(DEVICE_ID, &frame);
        assert_eq!(arm.read(DEVICE_ID, 1), before[..1], "the lock was closed before the frame");
        assert_eq!(arm.register(EEPROM_LOCK), 0);
        frame[17] = 1;
        arm.write(DEVICE_ID, &frame);
        assert_eq!(arm.read(DEVICE_ID, 1), frame[..1], "the lock was open before the frame");
        assert_eq!(arm.register(EEPROM_LOCK), 1);
    });
}

/// D16: with one value out of range, the whole frame has no effect.
#[test]
fn d16_a_frame_with_one_bad_value_is_refused_and_counted() {
    with_arm(TestSetup::any(), |arm| {
        let before = arm.read(EFFECTOR_TYPE, 31);
        // Registers with a value just above their range.
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

/// D16: the range of a value without an effect is not checked.
#[test]
fn d16_values_without_effect_may_be_out_of_range() {
    with_arm(TestSetup::any(), |arm| {
        let refused = arm.counter(FRAMES_REFUSED);
        arm.write(BAUD_RATE, &[200]);
        arm.write(PRESENT_POSITION, &[255; 7]);
        arm.write(CHIP_ID, &[255; 8]);
        assert_eq!(arm.register(BAUD_RATE), 0);
        assert_eq!(arm.counter(FRAMES_REFUSED), refused);
    });
}

/// D16, D17: one frame writes registers 28 to 52, with the largest values of lock, effector, speeds and times.
#[test]
fn d17_a_frame_takes_effect_whole() {
    with_arm(TestSetup::any(), |arm| {
        let mut expected = vec![1, 1, 1, 0];
        expected.extend([100; 14]);
        // The present targets, so that no joint moves.
        expected.extend(arm.read(TARGET_POSITION, 7));
        arm.write(EEPROM_LOCK, &expected);
        assert_eq!(arm.read(EEPROM_LOCK, 25), expected);
    });
}

/// D20: the register of the pump can be set and cleared. The host link does not show pump and valve themselves.
#[test]
fn d20_the_pump_is_a_register() {
    with_arm(TestSetup::any(), |arm| {
        for state in [1, 0] {
            arm.write(VACUUM_PUMP, &[state]);
            assert_eq!(arm.register(VACUUM_PUMP), state);
        }
    });
}

/// Section 6: accepted reads and writes are counted, including the read of the counter itself.
#[test]
fn accepted_frames_are_counted() {
    with_arm(TestSetup::any(), |arm| {
        let first = arm.counter(FRAMES_ACCEPTED);
        arm.write(EFFECTOR_TYPE, &[1]);
        arm.read(0, 1);
        assert_eq!(arm.counter(FRAMES_ACCEPTED), first.wrapping_add(3));
    });
}

/// Section 6: voltage and temperature are readings of the servos.
#[test]
fn voltage_and_temperature_are_measured() {
    with_arm(TestSetup::any(), |arm| {
        arm.wait_until("voltage and temperature are known", |arm| {
            let measured = arm.read(SUPPLY_VOLTAGE, 2);
            (40..=90).contains(&measured[0]) && (10..=80).contains(&measured[1])
        });
    });
}

//! Settings over power cuts: `docs/protocol.md`, D19.

use system_tests::registers::{
    BAUD_RATE, DEVICE_ID, EEPROM_LOCK, EFFECTOR_TYPE, FAULTS, FRAMES_REFUSED, LAST_REFUSAL, OFFSET, SPEED,
};
use system_tests::{Need, TestSetup, with_arm};

const OFFSETS: [u8; 7] = [1, 2, 3, 0x84, 0x85, 6, 0x90];

/// D19: settings are kept over a power cycle. The lock and the speeds start with their defaults.
#[test]
fn d19_only_settings_survive_a_power_cycle() {
    with_arm(TestSetup::any().needs(Need::PowerCycle).needs(Need::Persistence), |arm| {
        arm.write(EEPROM_LOCK, &[0]);
        arm.write(DEVICE_ID, &[42]);
        arm.write(OFFSET, &OFFSETS);
        arm.write(SPEED, &[11; 7]);
        arm.power_cycle(115_200);
        assert_eq!(arm.register(DEVICE_ID), 42);
        assert_eq!(arm.read(OFFSET, 7), OFFSETS);
        assert_eq!(arm.read(EEPROM_LOCK, 4), [1, 1, 0, 0], "RAM has its defaults, the lock is closed");
        assert_eq!(arm.read(SPEED, 7), [60; 7]);
    });
}

/// D19: a setting is kept if the arm is killed directly after a reply.
#[test]
fn d19_settings_survive_a_kill() {
    with_arm(TestSetup::any().needs(Need::Kill).needs(Need::Persistence), |arm| {
        for id in [1, 99, 255] {
            arm.write_setting(DEVICE_ID, &[id]);
            // A reply after the write shows that the write was executed.
            assert_eq!(arm.register(DEVICE_ID), id);
            arm.kill_and_restart();
            assert_eq!(arm.register(DEVICE_ID), id);
        }
    });
}

/// D19: after a kill at any time, the arm has the settings of one complete frame.
#[test]
fn d19_a_frame_of_settings_is_kept_completely_or_not_at_all() {
    with_arm(TestSetup::any().needs(Need::Kill).needs(Need::Persistence), |arm| {
        let frame = |n: u8| [vec![n, 0], vec![n % 16; 7]].concat();
        let mut last = 0;
        for round in 1..=10_u8 {
            arm.write(EEPROM_LOCK, &[0]);
            // The kill comes during these frames. In later rounds more of them may be complete.
            for n in 1..=round * 2 {
                arm.write(DEVICE_ID, &frame(round * 16 + n % 16));
            }
            arm.kill_and_restart();
            let kept = arm.read(DEVICE_ID, 9);
            assert_eq!(kept, frame(kept[0]), "round {round}: parts of two frames");
            assert!(kept[0] == last || kept[0] / 16 == round, "round {round}: unexpected {}", kept[0]);
            last = kept[0];
        }
    });
}

/// D19: settings that were not accepted are not kept.
#[test]
fn d19_a_locked_setting_does_not_change_after_a_power_cycle() {
    with_arm(TestSetup::any().needs(Need::PowerCycle).needs(Need::Persistence), |arm| {
        arm.write_setting(DEVICE_ID, &[7]);
        arm.write(DEVICE_ID, &[8]);
        arm.power_cycle(115_200);
        assert_eq!(arm.register(DEVICE_ID), 7);
    });
}

/// Register 12: the baud rate changes with the next restart.
#[test]
fn d19_the_baud_rate_changes_with_the_next_restart() {
    with_arm(TestSetup::any().needs(Need::PowerCycle).needs(Need::Persistence), |arm| {
        for (code, baud) in [(3, 1_000_000), (7, 9_600), (4, 57_600), (0, 115_200)] {
            arm.write_setting(BAUD_RATE, &[code]);
            assert_eq!(arm.register(BAUD_RATE), code, "read at the old rate");
            arm.power_cycle(baud);
            assert_eq!(arm.register(BAUD_RATE), code);
            assert_eq!(arm.read(0, 61).len(), 61);
        }
    });
}

/// D19: a write of the present values is not saved.
#[test]
fn d19_a_write_of_the_present_values_is_not_saved() {
    with_arm(TestSetup::any().needs(Need::ExpendableStorage), |arm| {
        arm.write(EEPROM_LOCK, &[0]);
        for _ in 0..50 {
            for _ in 0..50 {
                arm.write(DEVICE_ID, &[5]);
            }
            assert_eq!(arm.register(DEVICE_ID), 5);
        }
        assert_eq!(arm.register(FAULTS) & 1, 0, "2500 saves would have filled the storage");
    });
}

/// D19: there is room for at least 600 saves. Then writes of settings are refused, the last accepted settings are kept, and a
/// restart makes room.
#[test]
fn d19_a_full_storage_refuses_settings_and_keeps_the_last() {
    with_arm(TestSetup::any().needs(Need::ExpendableStorage).needs(Need::PowerCycle), |arm| {
        arm.write(EEPROM_LOCK, &[0]);
        let refused = arm.counter(FRAMES_REFUSED);
        let mut saves = 0_u32;
        let mut id = 0_u8;
        let last = loop {
            let next = id.wrapping_add(1);
            arm.write(DEVICE_ID, &[next]);
            if arm.register(DEVICE_ID) != next {
                break id;
            }
            id = next;
            saves += 1;
            assert!(saves < 100_000, "never full");
        };
        assert!(saves >= 600, "full after {saves} saves");
        assert_eq!(arm.read(LAST_REFUSAL, 2), [3, DEVICE_ID]);
        assert_eq!(arm.counter(FRAMES_REFUSED), refused.wrapping_add(1));
        assert_eq!(arm.register(FAULTS) & 1, 1);
        arm.write(EFFECTOR_TYPE, &[1]);
        assert_eq!(arm.register(EFFECTOR_TYPE), 1, "other registers are writable");
        arm.write(EFFECTOR_TYPE, &[0]);
        arm.power_cycle(115_200);
        assert_eq!(arm.register(DEVICE_ID), last);
        assert_eq!(arm.register(FAULTS) & 1, 0);
        arm.write_setting(DEVICE_ID, &[last.wrapping_add(1)]);
        assert_eq!(arm.register(DEVICE_ID), last.wrapping_add(1), "the restart made room");
    });
}

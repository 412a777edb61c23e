use motion_core::servo_bus::frame::{error, ping, read, sync_write, write};

use super::*;

const READING: Reading =
    Reading { position_counts: 511, speed: -300, load: 45, voltage_decivolts: 74, temperature_celsius: 31 };

/// The answer of the servo to an encoded frame; empty if there is none.
fn answer(servo: &mut ServoRegisters, encode: impl FnOnce(&mut ServoFrameBuffer)) -> Vec<u8> {
    let (mut buffer, mut decoder) = (ServoFrameBuffer::new(), frame::Decoder::new());
    encode(&mut buffer);
    decoder.push(&buffer);
    let heard = decoder.pull().unwrap().unwrap();
    servo.handle_frame(&heard).map_or_else(Vec::new, |answer| answer.to_vec())
}

#[test]
fn answers_byte_for_byte() {
    let mut servo = ServoRegisters::new(2);
    servo.set_reading(&READING);
    assert_eq!(answer(&mut servo, |b| ping(b, 2)), [0xFF, 0xFF, 2, 2, 0, 0xFB]);
    assert_eq!(answer(&mut servo, |b| write(b, 2, 40, &[1])), [0xFF, 0xFF, 2, 2, 0, 0xFB]);
    servo.set_errors(error::OVERLOAD);
    assert_eq!(
        answer(&mut servo, |b| read(b, 2, register::PRESENT_POSITION, 8)),
        [0xFF, 0xFF, 2, 10, 0x20, 0x01, 0xFF, 0x81, 0x2C, 0x00, 0x2D, 74, 31, 0x90]
    );
}

#[test]
fn a_long_read_includes_status_and_moving() {
    let mut servo = ServoRegisters::new(0);
    servo.set_reading(&READING);
    servo.set_moving(true);
    servo.set_errors(error::OVERHEAT);
    let answer = answer(&mut servo, |b| read(b, 0, register::PRESENT_POSITION, 15));
    assert_eq!(answer[5..20], [1, 0xFF, 0x81, 0x2C, 0, 0x2D, 74, 31, 0, 4, 1, 0, 0, 0, 0]);
}

#[test]
fn frames_to_other_servos_are_ignored() {
    let mut servo = ServoRegisters::new(2);
    assert!(answer(&mut servo, |b| ping(b, 3)).is_empty());
    assert!(answer(&mut servo, |b| write(b, 3, register::TORQUE_SWITCH, &[1])).is_empty());
    assert_eq!(servo.torque_switch(), 0);
}

#[test]
fn a_broadcast_is_executed_and_not_answered() {
    let mut servo = ServoRegisters::new(2);
    assert!(answer(&mut servo, |b| ping(b, BROADCAST)).is_empty());
    assert!(answer(&mut servo, |b| read(b, BROADCAST, register::PRESENT_POSITION, 8)).is_empty());
    assert!(answer(&mut servo, |b| write(b, BROADCAST, register::TORQUE_SWITCH, &[1])).is_empty());
    assert_eq!(servo.torque_switch(), 1);
}

#[test]
fn each_servo_uses_its_own_item_of_a_sync_write() {
    let goals = |b: &mut ServoFrameBuffer| {
        let item = |id: u8| (id, [1, id, 0, 10 + id, 2, 20 + id]);
        sync_write(b, register::GOAL_POSITION, [4, 2, 6].map(item).into_iter());
    };
    let mut servo = ServoRegisters::new(2);
    assert!(answer(&mut servo, goals).is_empty());
    let goal = ServoGoal { position_counts: 258, time_ms: 12, speed: 534 };
    assert_eq!(servo.goal(), goal);
    assert_eq!(servo.take_new_goal(), Some(goal));
    assert_eq!(servo.take_new_goal(), None, "one write, one move");
    let mut absent = ServoRegisters::new(3);
    answer(&mut absent, goals);
    assert_eq!(absent.take_new_goal(), None);
}

#[test]
fn a_write_to_any_goal_register_starts_a_new_goal() {
    let mut servo = ServoRegisters::new(0);
    for (register, starts) in [(40, false), (41, false), (42, true), (46, true), (47, true), (48, false)] {
        answer(&mut servo, |b| write(b, 0, register, &[0]));
        assert_eq!(servo.take_new_goal().is_some(), starts, "register {register}");
    }
    answer(&mut servo, |b| write(b, 0, register::GOAL_POSITION, &[0xFF, 0xFF]));
    assert_eq!(servo.goal().position_counts, 1023);
}

#[test]
fn measurements_cannot_be_written() {
    let mut servo = ServoRegisters::new(0);
    servo.set_reading(&READING);
    assert!(!answer(&mut servo, |b| write(b, 0, 40, &[9; 31])).is_empty(), "acknowledged nevertheless");
    assert_eq!(answer(&mut servo, |b| read(b, 0, 48, 9))[5..14], [9, 0, 0, 0, 0, 0, 0, 0, 1]);
}

#[test]
fn a_range_beyond_the_last_register_is_not_answered() {
    let mut servo = ServoRegisters::new(0);
    for (register, count) in [(0, 72), (70, 2), (71, 1), (255, 255)] {
        assert!(answer(&mut servo, |b| read(b, 0, register, count)).is_empty(), "{register}, {count}");
    }
    assert!(answer(&mut servo, |b| write(b, 0, 40, &[1; 32])).is_empty());
    answer(&mut servo, |b| sync_write(b, 40, [(0, [1; 32])].into_iter()));
    assert_eq!(servo.torque_switch(), 0);
}

#[test]
fn the_eeprom_respects_its_lock_and_survives_a_power_cycle() {
    let mut servo = ServoRegisters::new(3);
    answer(&mut servo, |b| write(b, 3, register::ID, &[9]));
    assert_eq!(servo.id(), 3, "locked");
    answer(&mut servo, |b| write(b, 3, register::LOCK, &[0]));
    answer(&mut servo, |b| write(b, 3, register::ID, &[BROADCAST]));
    assert_eq!(servo.id(), 3, "the broadcast id is not a valid id");
    assert_eq!(answer(&mut servo, |b| write(b, 3, register::ID, &[9]))[2], 9);
    assert!(answer(&mut servo, |b| ping(b, 3)).is_empty(), "the new id is effective immediately");
    answer(&mut servo, |b| write(b, 9, register::BAUD_RATE, &[4]));
    answer(&mut servo, |b| write(b, 9, register::TORQUE_SWITCH, &[1]));
    servo.power_cycle();
    assert_eq!((servo.id(), servo.baud(), servo.torque_switch()), (9, 115_200, 0));
    assert_eq!(answer(&mut servo, |b| read(b, 9, register::LOCK, 1))[5], 1, "locked again");
}

#[test]
fn a_new_servo_has_the_factory_settings_and_versions_cannot_be_written() {
    let mut servo = ServoRegisters::new(7);
    answer(&mut servo, |b| write(b, 7, register::LOCK, &[0]));
    answer(&mut servo, |b| write(b, 7, 0, &[0xEE; 5]));
    let settings = answer(&mut servo, |b| read(b, 7, 0, 21));
    assert_eq!(settings[5..13], [1, 0, 1, 5, 15, 7, 0, 0]);
    assert_eq!(settings[13..26], [1, 0, 0, 3, 0xFF, 80, 250, 50, 3, 0xE8, 0, 0x25, 0x25]);
    assert_eq!(servo.baud(), 1_000_000);
    assert!(answer(&mut servo, |b| write(b, 7, register::RESPONSE_LEVEL, &[0])).is_empty());
    assert!(answer(&mut servo, |b| write(b, 7, register::TORQUE_SWITCH, &[1])).is_empty());
    assert_eq!(answer(&mut servo, |b| read(b, 7, register::TORQUE_SWITCH, 1))[5], 1);
}

#[test]
fn a_goal_stays_within_the_limits_of_the_eeprom() {
    let mut servo = ServoRegisters::new(0);
    answer(&mut servo, |b| write(b, 0, register::LOCK, &[0]));
    answer(&mut servo, |b| write(b, 0, register::MIN_POSITION, &[0, 200, 3, 0]));
    for (wanted, allowed) in [(0, 200), (500, 500), (1023, 768)] {
        answer(&mut servo, |b| write(b, 0, register::GOAL_POSITION, &u16::to_be_bytes(wanted)));
        assert_eq!(servo.goal().position_counts, allowed);
    }
}

#[test]
fn malformed_instructions_are_not_answered() {
    let mut servo = ServoRegisters::new(0);
    for (code, params) in
        [(1, [].as_slice()), (2, &[56]), (2, &[56, 8, 0]), (3, &[]), (0x83, &[40]), (9, &[])]
    {
        let is_answered = servo.handle_frame(&ServoFrame { id: 0, code, params }).is_some();
        assert_eq!(is_answered, code == 1, "instruction {code}, {params:?}");
    }
    servo.handle_frame(&ServoFrame { id: BROADCAST, code: 0x83, params: &[40, 1, 0] });
    servo.handle_frame(&ServoFrame { id: BROADCAST, code: 0x83, params: &[40, 255, 0, 1] });
    assert_eq!(servo.torque_switch(), 0, "a truncated item is ignored");
}

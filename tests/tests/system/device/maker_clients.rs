//! The calls of the maker's own programs, byte for byte: `docs/protocol.md`, section 8. The bytes of the requests were
//! recorded from the programs.

use std::thread::sleep;
use std::time::{Duration, Instant};

use system_tests::registers::{
    DEVICE_ID, EEPROM_LOCK, FEEDBACK_FREQUENCY, LAST_REFUSAL, MOTOR_STATE, OFFSET, STANDARD_POSE,
    TARGET_POSITION,
};
use system_tests::wait::TIMEOUT;
use system_tests::{Need, TestArm, TestSetup, near, with_arm};

const READ_DEVICE_CODE: &[u8] = &[0xAA, 0x77, 0x03, 0x00, 0x01, 0x16, 0x6C];
const DEVICE_CODE: &[u8] = &[0xAA, 0x77, 0x03, 0x00, 0x01, 0x07, 0xAC, 0x0C];
const READ_VERSION: &[u8] = &[0xAA, 0x77, 0x03, 0x01, 0x01, 0x17, 0xFC];
const VERSION: &[u8] = &[0xAA, 0x77, 0x03, 0x01, 0x01, 0x1E, 0x3C, 0x06];
const READ_MAC: &[u8] = &[0xAA, 0x77, 0x03, 0x02, 0x06, 0x56, 0xCE];
const READ_ID: &[u8] = &[0xAA, 0x77, 0x03, 0x0B, 0x01, 0x11, 0x5C];
const READ_OFFSETS: &[u8] = &[0xAA, 0x77, 0x03, 0x0D, 0x07, 0x92, 0xFE];
const OFFSETS_ZERO: &[u8] = &[0xAA, 0x77, 0x03, 0x0D, 0x07, 128, 128, 128, 128, 128, 128, 128, 0x71, 0x89];
const READ_STATUS: &[u8] = &[0xAA, 0x77, 0x03, 0x1D, 0x01, 0x1F, 0x3C];
const READ_VACUUM: &[u8] = &[0xAA, 0x77, 0x03, 0x1F, 0x01, 0x1E, 0x5C];
const READ_TARGETS: &[u8] = &[0xAA, 0x77, 0x03, 0x2E, 0x07, 0x8B, 0xCE];
const READ_ANGLE_0: &[u8] = &[0xAA, 0x77, 0x03, 0x53, 0x01, 0x2A, 0x9C];
const READ_ANGLES: &[u8] = &[0xAA, 0x77, 0x03, 0x53, 0x07, 0xAA, 0x9E];
const READ_LOADS: &[u8] = &[0xAA, 0x77, 0x03, 0x5B, 0x07, 0xAD, 0x5E];
const WRITE_NOTHING: &[u8] = &[0xAA, 0x77, 0x04, 0x00, 0x00, 0x66, 0x6D];
const UNLOCK: &[u8] = &[0xAA, 0x77, 0x04, 0x1C, 0x01, 0x00, 0x2D, 0x7C];
const LOCK: &[u8] = &[0xAA, 0x77, 0x04, 0x1C, 0x01, 0x01, 0xEC, 0xBC];
const EEPROM_INIT: &[u8] =
    &[0xAA, 0x77, 0x04, 0x0B, 0x09, 0x00, 0x00, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x66, 0x86];
const OFFSETS_RAW: &[u8] =
    &[0xAA, 0x77, 0x04, 0x0D, 0x07, 0x01, 0xFE, 0x00, 0x01, 0xFF, 0x00, 0x01, 0xE2, 0xDF];
const OFFSETS_BIASED: &[u8] =
    &[0xAA, 0x77, 0x04, 0x0D, 0x07, 0x81, 0x7E, 0x80, 0x81, 0x7F, 0x80, 0x81, 0x35, 0x41];
const CLEAR_OFFSETS: &[u8] = &[0xAA, 0x77, 0x04, 0x0D, 0x07, 0, 0, 0, 0, 0, 0, 0, 0x17, 0xCD];
const STATUS_0: &[u8] = &[0xAA, 0x77, 0x04, 0x1D, 0x01, 0x00, 0x7C, 0xBC];
const STATUS_1: &[u8] = &[0xAA, 0x77, 0x04, 0x1D, 0x01, 0x01, 0xBD, 0x7C];
const STATUS_2: &[u8] = &[0xAA, 0x77, 0x04, 0x1D, 0x01, 0x02, 0xFD, 0x7D];
const EFFECTOR_0: &[u8] = &[0xAA, 0x77, 0x04, 0x1E, 0x01, 0x00, 0x8C, 0xBC];
const VACUUM_ON: &[u8] = &[0xAA, 0x77, 0x04, 0x1F, 0x01, 0x01, 0x1C, 0xBC];
const VACUUM_OFF: &[u8] = &[0xAA, 0x77, 0x04, 0x1F, 0x01, 0x00, 0xDD, 0x7C];
const SPEED_60: &[u8] = &[0xAA, 0x77, 0x04, 0x20, 0x07, 60, 60, 60, 60, 60, 60, 60, 0xA2, 0xEB];
const SPEED_60_JOINT_1: &[u8] = &[0xAA, 0x77, 0x04, 0x20, 0x01, 0x3C, 0xED, 0x61];
const TIME_5_JOINT_1: &[u8] = &[0xAA, 0x77, 0x04, 0x27, 0x01, 0x05, 0x9C, 0xB2];
const HOME: &[u8] = &[0xAA, 0x77, 0x04, 0x2E, 0x07, 90, 90, 65, 90, 90, 90, 80, 0x58, 0x5B];
const ANOTHER_POSE: &[u8] = &[0xAA, 0x77, 0x04, 0x2E, 0x07, 130, 100, 80, 130, 130, 130, 80, 0x18, 0x10];
const IK6: &[u8] =
    &[0xAA, 0x77, 0x04, 0x36, 0x09, 0x03, 0xCE, 0x04, 0xB9, 0x04, 0x32, 0x80, 0x80, 0x7F, 0x6D, 0x41];
const IK6_FAR: &[u8] =
    &[0xAA, 0x77, 0x04, 0x36, 0x09, 0x05, 0xF4, 0x04, 0xB9, 0x04, 0x32, 0x80, 0x80, 0x7F, 0xC5, 0x8A];
const IK5: &[u8] = &[0xAA, 0x77, 0x04, 0x44, 0x06, 0x04, 0x64, 0x04, 0xC8, 0x04, 0x96, 0xB5, 0xE0];
const IK7: &[u8] = &[
    0xAA, 0x77, 0x04, 0x36, 0x0C, 0x03, 0xCE, 0x04, 0xB9, 0x04, 0x32, 0x80, 0x80, 0x7F, 0x81, 0x80, 0x80,
    0x9D, 0xC0,
];
const ANGLE_REPORTS: &[u8] = &[0xAA, 0x77, 0x04, 0x52, 0x01, 0x1E, 0xCD, 0x63];
const NO_ANGLE_REPORTS: &[u8] = &[0xAA, 0x77, 0x04, 0x52, 0x01, 0x00, 0x4D, 0x6B];
const LOAD_REPORTS: &[u8] = &[0xAA, 0x77, 0x04, 0x5A, 0x01, 0x05, 0x0C, 0xAA];
const NO_LOAD_REPORTS: &[u8] = &[0xAA, 0x77, 0x04, 0x5A, 0x01, 0x00, 0xCC, 0xA9];
const IK6_TARGETS: [u8; 7] = [105, 88, 110, 90, 135, 90, 80];

/// Sends a read and returns the values of the next frame. That frame must be the answer, because the maker's programs
/// read only one frame.
#[track_caller]
fn ask(arm: &mut TestArm, request: &[u8]) -> Vec<u8> {
    arm.send(request);
    let frame = arm.frame_within(TIMEOUT).expect("an answer");
    assert_eq!(frame[..5], request[..5], "function, address and count of the request");
    frame[5..frame.len() - 2].to_vec()
}

fn is_standard_pose(values: &[u8]) -> bool {
    values.iter().zip(&STANDARD_POSE).all(|(actual, expected)| near(*actual, *expected))
}

/// Every load is in the range of M9.
fn are_loads(values: &[u8]) -> bool {
    values.len() == 7 && values.iter().all(|load| (3..=253).contains(load))
}

/// The Python client sends nothing at first. Then each getter is one read and one answer.
#[test]
fn m01_m03_m10_python_getters() {
    with_arm(TestSetup::any(), |arm| {
        assert!(is_standard_pose(&ask(arm, READ_ANGLES)), "without a write before");
        arm.write_setting(DEVICE_ID, &[0; 9]);
        arm.send(READ_DEVICE_CODE);
        arm.expect(DEVICE_CODE);
        arm.send(READ_VERSION);
        arm.expect(VERSION);
        assert_eq!(ask(arm, READ_MAC).len(), 6);
        assert_eq!(ask(arm, READ_ID), [0]);
        assert_eq!(ask(arm, READ_OFFSETS), [0; 7], "in the form of the last write");
        assert_eq!((ask(arm, READ_STATUS), ask(arm, READ_VACUUM)), (vec![1], vec![0]));
        assert!(near(ask(arm, READ_ANGLE_0)[0], 90));
        assert!(are_loads(&ask(arm, READ_LOADS)));
        arm.expect_nothing_more();
    });
}

#[test]
fn m05_m06_before_any_write_offsets_read_as_register_20_says() {
    with_arm(TestSetup::any().needs(Need::FreshArm), |arm| {
        assert_eq!((ask(arm, READ_OFFSETS), ask(arm, READ_ID)), (vec![0; 7], vec![0]));
        arm.send(WRITE_NOTHING);
        arm.send(READ_OFFSETS);
        arm.expect(OFFSETS_ZERO);
    });
}

/// EEPROMinit: three frames back to back.
#[test]
fn m02_m05_python_initialises_the_eeprom() {
    with_arm(TestSetup::any(), |arm| {
        arm.write_setting(OFFSET, &[3, 0x83]);
        arm.send(&[UNLOCK, EEPROM_INIT, LOCK].concat());
        arm.send(READ_OFFSETS);
        arm.expect(OFFSETS_ZERO);
        assert_eq!((ask(arm, READ_ID), arm.register(EEPROM_LOCK)), (vec![0], 1));
        arm.write(0, &[]);
        assert_eq!(arm.read(OFFSET, 7), [0; 7], "the same for a program that uses function 06");
    });
}

/// setOffsets of client 2.1.2 does not unlock. Client 2.0 does.
#[test]
fn m02_m05_both_clients_write_offsets() {
    with_arm(TestSetup::any(), |arm| {
        let offsets = [129, 126, 128, 129, 127, 128, 129];
        arm.send(&[UNLOCK, CLEAR_OFFSETS, LOCK, OFFSETS_RAW].concat());
        assert_eq!(ask(arm, READ_OFFSETS), [128; 7], "locked");
        arm.send(&[UNLOCK, OFFSETS_RAW, LOCK].concat());
        assert_eq!(ask(arm, READ_OFFSETS), offsets);
        arm.send(&[UNLOCK, CLEAR_OFFSETS, OFFSETS_BIASED, LOCK].concat());
        assert_eq!(ask(arm, READ_OFFSETS), offsets);
        arm.write(0, &[]);
        assert_eq!(arm.read(OFFSET, 7), [1, 0x82, 0, 1, 0x81, 0, 1]);
        arm.send(&[UNLOCK, CLEAR_OFFSETS, LOCK].concat());
        assert_eq!(ask(arm, READ_OFFSETS), [128; 7]);
    });
}

/// home and reset, and the poses of the examples.
#[test]
fn m02_python_moves_the_arm() {
    with_arm(TestSetup::any(), |arm| {
        arm.send(&[SPEED_60, ANOTHER_POSE].concat());
        assert_eq!(ask(arm, READ_TARGETS), [130, 100, 80, 130, 130, 130, 80]);
        arm.wait_for_pose(&[130, 100, 80, 130, 130, 130, 80]);
        arm.send(STATUS_1);
        sleep(Duration::from_millis(500));
        arm.send(HOME);
        arm.wait_for_pose(&STANDARD_POSE);
        assert!(is_standard_pose(&ask(arm, READ_ANGLES)));
        arm.send(STATUS_0);
        assert_eq!(ask(arm, READ_STATUS), [0]);
        arm.send(VACUUM_OFF);
        arm.expect_nothing_more();
    });
}

#[test]
fn m07_m08_python_inverse_kinematics() {
    with_arm(TestSetup::any(), |arm| {
        arm.send(IK6);
        assert_eq!(ask(arm, READ_TARGETS), IK6_TARGETS);
        arm.wait_for_pose(&IK6_TARGETS);
        assert!(near(ask(arm, READ_ANGLE_0)[0], 105));
        arm.send(IK6_FAR);
        assert_eq!(ask(arm, READ_TARGETS), IK6_TARGETS, "no alarm comes first");
        assert_eq!(arm.read(LAST_REFUSAL, 2), [6, 54]);
        arm.send(IK7);
        assert_eq!(ask(arm, READ_TARGETS)[..5], IK6_TARGETS[..5]);
        arm.send(IK5);
        assert_eq!(ask(arm, READ_TARGETS)[..3], [63, 90, 85]);
        arm.send(HOME);
        arm.wait_for_pose(&STANDARD_POSE);
        assert_eq!(ask(arm, READ_TARGETS), STANDARD_POSE, "no inverse kinematics is left over");
    });
}

/// readAnglesFb, and the examples that stop the reports before they read.
#[test]
fn m04_m09_python_reads_reports() {
    with_arm(TestSetup::any(), |arm| {
        arm.send(ANGLE_REPORTS);
        for _ in 0..3 {
            let frame = arm.frame_within(TIMEOUT).expect("a report");
            assert_eq!(frame[..5], [0xAA, 0x77, 0x05, 0x53, 0x07]);
            assert!(is_standard_pose(&frame[5..12]));
        }
        arm.send(NO_ANGLE_REPORTS);
        arm.drain();
        assert_eq!(ask(arm, READ_ANGLES).len(), 7);
        arm.send(LOAD_REPORTS);
        let frame = arm.frame_within(TIMEOUT).expect("a report");
        assert_eq!(frame[..5], [0xAA, 0x77, 0x05, 0x5B, 0x07]);
        assert!(are_loads(&frame[5..12]));
        arm.send(NO_LOAD_REPORTS);
        arm.drain();
        assert_eq!(ask(arm, READ_VACUUM), [0]);
    });
}

/// A program of the other map has left its reports on. Each write of map 2.1 ends those of map 2.2, and a write of register 53
/// ends those of map 2.1. After it the next program takes no report for an answer.
#[test]
fn m04_no_client_hears_the_other_maps_reports() {
    with_arm(TestSetup::any(), |arm| {
        arm.write(FEEDBACK_FREQUENCY, &[50]);
        assert!(arm.reply().address == 54);
        arm.send(EFFECTOR_0);
        arm.drain();
        assert_eq!(ask(arm, READ_STATUS), [1]);
        arm.send(ANGLE_REPORTS);
        assert_eq!(arm.frame_within(TIMEOUT).expect("a report")[2], 0x05);
        arm.write(FEEDBACK_FREQUENCY, &[0]);
        arm.drain();
        arm.expect_nothing_more();
    });
}

/// The web page in mode UI: reads without waiting, then targets and the vacuum.
#[test]
fn m01_gui_page_connects_and_drives() {
    with_arm(TestSetup::any(), |arm| {
        let chip_id = ask(arm, READ_MAC);
        for _ in 0..2 {
            arm.send(&[EFFECTOR_0, READ_DEVICE_CODE, READ_VERSION, READ_MAC].concat());
            arm.expect(DEVICE_CODE);
            arm.expect(VERSION);
            assert_eq!(arm.reply().values, chip_id);
        }
        arm.send(&[ANOTHER_POSE, VACUUM_ON].concat());
        arm.wait_for_pose(&[130, 100, 80, 130, 130, 130, 80]);
        arm.send(&[HOME, VACUUM_OFF, NO_ANGLE_REPORTS].concat());
        arm.wait_for_pose(&STANDARD_POSE);
        arm.expect_nothing_more();
    });
}

/// The web page in mode HW: reports are on, but the page uses the answers to its reads, 30 times a second.
#[test]
fn m03_m04_gui_page_shows_an_arm_that_is_moved_by_hand() {
    with_arm(TestSetup::any(), |arm| {
        arm.send(&[STATUS_2, ANGLE_REPORTS].concat());
        let (mut answers, mut reports) = (0, 0);
        let start = Instant::now();
        while reports < 5 || answers < 30 {
            assert!(start.elapsed() < TIMEOUT, "{answers} answers, {reports} reports");
            arm.send(READ_ANGLES);
            let is_report = |frame: &Vec<u8>| frame[2] == 0x05;
            let frames = std::iter::repeat_with(|| arm.frame_within(TIMEOUT).expect("a frame"));
            reports += frames.take_while(is_report).count();
            answers += 1;
            sleep(Duration::from_millis(33));
        }
        arm.send(&[NO_ANGLE_REPORTS, STATUS_1].concat());
        arm.drain();
        assert_eq!(arm.register(MOTOR_STATE), 1);
        arm.send(HOME);
        arm.wait_for_pose(&STANDARD_POSE);
    });
}

/// Blockly: polls one register after the other, writes speed and time of joint 1, and reads targets instead of measured
/// angles.
#[test]
fn m01_m07_blockly_page() {
    with_arm(TestSetup::any(), |arm| {
        for _ in 0..2 {
            arm.send(READ_DEVICE_CODE);
            arm.expect(DEVICE_CODE);
            arm.send(READ_VERSION);
            arm.expect(VERSION);
            let lengths = [READ_MAC, READ_ID, READ_STATUS, READ_VACUUM].map(|read| ask(arm, read).len());
            assert_eq!(lengths, [6, 1, 1, 1]);
        }
        arm.send(SPEED_60_JOINT_1);
        arm.send(TIME_5_JOINT_1);
        arm.send(HOME);
        assert_eq!(ask(arm, READ_TARGETS), STANDARD_POSE);
        arm.send(IK6);
        assert_eq!(ask(arm, READ_TARGETS), IK6_TARGETS, "targets follow the inverse kinematics");
        arm.send(HOME);
        arm.wait_for_pose(&STANDARD_POSE);
        assert_eq!(arm.read(TARGET_POSITION, 7), STANDARD_POSE);
        arm.expect_nothing_more();
    });
}

/// When the port is closed, reports end, and offsets read again as before the first write (M5).
#[test]
fn m12_the_next_program_starts_afresh() {
    with_arm(TestSetup::any().needs(Need::SeesClosing), |arm| {
        arm.write_setting(DEVICE_ID, &[0; 9]);
        arm.send(&[LOAD_REPORTS, ANGLE_REPORTS].concat());
        assert_eq!(arm.frame_within(TIMEOUT).expect("a report")[2], 0x05);
        arm.reopen(115_200);
        arm.send(READ_OFFSETS);
        assert_eq!(arm.frame_within(TIMEOUT).expect("the answer")[2..12], [3, 13, 7, 0, 0, 0, 0, 0, 0, 0]);
        assert!(arm.frame_within(Duration::from_millis(300)).is_none());
    });
}

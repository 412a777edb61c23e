//! Writes in map 2.1, through the bytes of a host: targets from positions, reports, loads, offsets (M1 to M10, M12).

use crate::rig::{Rig, STANDARD_POSE, frame, reply};
use motion_core::Storage;
use protocol_core::registers::Image;

const IK6: [u8; 9] = [0x03, 0xCE, 0x04, 0xB9, 0x04, 0x32, 0x80, 0x80, 0x7F];
const IK6_FAR: [u8; 9] = [0x05, 0xF4, 0x04, 0xB9, 0x04, 0x32, 0x80, 0x80, 0x7F];
const IK5: [u8; 6] = [0x04, 0x64, 0x04, 0xC8, 0x04, 0x96];
const IK5_FAR: [u8; 6] = [0x05, 0x90, 0x04, 0x00, 0x04, 0x64];
/// The targets of [`IK6`]: the tip at (-50, 185, 50) mm, the tool along (0, 0, -1).
const IK6_TARGETS: [u8; 7] = [105, 88, 110, 90, 135, 90, 80];
const ALARM_5: [u8; 7] = [0xAA, 0x77, 0x08, 0x01, 0x05, 0x67, 0xFD];
const ALARM_6: [u8; 7] = [0xAA, 0x77, 0x08, 0x01, 0x06, 0x27, 0xFC];

fn write_21(rig: &mut Rig, address: u8, values: &[u8]) {
    rig.send(&frame(4, address, u8::try_from(values.len()).unwrap(), values));
}

/// A controller whose settings are the defaults, except register 20.
fn with_options(options: u8) -> Rig {
    let mut image = Image([0; Image::LENGTH]);
    image.0[12] = options;
    let plant = Rig::new().plant;
    let mut rig = Rig::with(plant, Some(&image), Storage::Ready);
    rig.run_ms(1_000);
    rig.forget();
    rig
}

/// Takes the frames that were sent to the host. Returns function, address and count of each.
fn sent(rig: &mut Rig) -> Vec<[u8; 3]> {
    rig.to_host.drain(..).map(|(_, bytes)| [bytes[2], bytes[3], bytes[4]]).collect()
}

const POSITIONS: [u8; 3] = [3, 54, 7];
const ANGLES: [u8; 3] = [5, 83, 7];
const LOADS: [u8; 3] = [5, 91, 7];

#[test]
fn m01_both_functions_write_and_neither_is_answered() {
    let mut rig = Rig::started();
    write_21(&mut rig, 46, &[91]);
    rig.write(47, &[89]);
    write_21(&mut rig, 0, &[]);
    assert!(rig.to_host.is_empty());
    assert_eq!((rig.targets()[..2].to_vec(), rig.counter(246)), (vec![91, 89], 5));
}

#[test]
fn m02_a_value_out_of_range_refuses_the_whole_frame() {
    let mut rig = Rig::started();
    write_21(&mut rig, 46, &[100, 181]);
    assert_eq!((rig.targets(), rig.read(244, 2)), (STANDARD_POSE.to_vec(), vec![2, 47]));
    write_21(&mut rig, 82, &[101]);
    assert_eq!(rig.read(244, 2), [2, 82]);
}

#[test]
fn m03_angles_and_loads_are_read_without_a_write_before() {
    let mut rig = Rig::new();
    assert_eq!((rig.read(83, 7), rig.read(91, 7)), (vec![0; 7], vec![128; 7]));
    rig = Rig::on_a_stand();
    rig.run_ms(1_000);
    assert_eq!((rig.read(83, 7), rig.read(54, 7)), (STANDARD_POSE.to_vec(), STANDARD_POSE.to_vec()));
    assert_eq!((rig.get(66), rig.get(82), rig.get(90)), (1, 0, 0));
}

#[test]
fn m04_reports_have_the_form_of_the_register_that_armed_them() {
    let mut rig = Rig::on_a_stand();
    write_21(&mut rig, 82, &[10]);
    write_21(&mut rig, 90, &[5]);
    rig.run_ms(400);
    assert_eq!(sent(&mut rig), [ANGLES, ANGLES, LOADS, ANGLES, ANGLES, LOADS]);
    write_21(&mut rig, 82, &[0]);
    rig.run_ms(200);
    assert_eq!(sent(&mut rig), [LOADS]);
    rig.write(53, &[10]);
    assert_eq!(rig.read(82, 9), [0, 90, 90, 65, 90, 90, 90, 80, 0], "both registers read 0");
    rig.run_ms(200);
    assert_eq!(sent(&mut rig), [POSITIONS, POSITIONS]);
}

#[test]
fn m04_a_report_of_angles_is_a_whole_frame() {
    let mut rig = Rig::on_a_stand();
    write_21(&mut rig, 82, &[30]);
    rig.run_ms(34);
    let report = [0xAA, 0x77, 5, 0x53, 7, 0x5A, 0x5A, 0x41, 0x5A, 0x5A, 0x5A, 0x50, 0x34, 0xCC];
    assert_eq!(rig.to_host[0].1, report);
}

#[test]
fn m04_every_accepted_04_frame_stops_the_stream_of_53() {
    let writes: [(u8, &[u8]); 3] = [(0, &[]), (46, &[90]), (82, &[0])];
    for (address, values) in writes {
        let mut rig = Rig::started();
        rig.write(53, &[50]);
        write_21(&mut rig, 46, &[181]);
        assert_eq!(rig.get(53), 50, "a refused frame stops nothing");
        write_21(&mut rig, address, values);
        assert_eq!(rig.get(53), 0);
        rig.run_ms(100);
        assert!(rig.to_host.is_empty());
    }
}

#[test]
fn m04_a_write_of_53_and_no_other_stops_the_streams_of_82_and_90() {
    let mut rig = Rig::started();
    write_21(&mut rig, 82, &[50]);
    rig.write(46, &[90; 7]);
    rig.run_ms(100);
    assert_eq!(sent(&mut rig), [ANGLES; 5]);
    rig.write(53, &[0]);
    assert_eq!(rig.get(82), 0);
    rig.run_ms(100);
    assert!(rig.to_host.is_empty());
}

#[test]
fn m05_an_offset_acts_at_once_in_any_encoding() {
    for bytes in [[5, 251], [133, 123]] {
        let mut rig = Rig::started();
        write_21(&mut rig, 28, &[0]);
        write_21(&mut rig, 32, &[1; 7]);
        write_21(&mut rig, 13, &bytes);
        rig.run_ms(50);
        assert_eq!(rig.saved.last().unwrap().0[5..12], [5, 0x85, 0, 0, 0, 0, 0]);
        assert_eq!(rig.present()[..2], [95, 95], "joint 2 is mounted reversed");
        assert_eq!(rig.read(13, 7), [133, 123, 128, 128, 128, 128, 128]);
    }
}

#[test]
fn m06_m08_alarms_are_sent_if_register_20_allows_them() {
    let mut rig = with_options(2);
    write_21(&mut rig, 54, &IK6_FAR);
    rig.send(&frame(3, 0, 1, &[]));
    write_21(&mut rig, 68, &IK5_FAR);
    let sent: Vec<_> = rig.to_host.drain(..).map(|(_, bytes)| bytes).collect();
    assert_eq!(sent, [ALARM_6.to_vec(), reply(0, &[7]), ALARM_5.to_vec()]);
    let mut silent = with_options(1);
    write_21(&mut silent, 54, &IK6_FAR);
    assert!(silent.to_host.is_empty());
}

#[test]
fn m08_each_refused_frame_has_its_alarm() {
    let mut rig = with_options(2);
    let frames = [frame(4, 54, 9, &IK6_FAR), frame(4, 68, 6, &IK5_FAR), frame(4, 46, 1, &[100])].concat();
    rig.send(&frames);
    let sent: Vec<_> = rig.to_host.drain(..).map(|(_, bytes)| bytes).collect();
    assert_eq!(sent, [ALARM_6, ALARM_5]);
    assert_eq!(rig.targets()[0], 100);
}

#[test]
fn m08_d05_an_alarm_without_room_is_skipped() {
    let mut rig = with_options(2);
    rig.room = 6;
    write_21(&mut rig, 54, &IK6_FAR);
    write_21(&mut rig, 46, &[100]);
    assert_eq!(rig.controller.registers().get(46), 100, "the write after it does not wait");
    rig.room = 4_096;
    rig.run_ms(100);
    assert!(rig.to_host.is_empty());
}

#[test]
fn m07_a_position_becomes_targets_and_the_arm_goes_there() {
    let mut rig = Rig::started();
    write_21(&mut rig, 54, &IK6);
    assert_eq!(rig.targets(), IK6_TARGETS);
    assert_eq!(rig.read(61, 2), [0x80, 0x7F], "61 and 62 read back");
    rig.assert_at(STANDARD_POSE, "54 to 60 are the present positions");
    rig.run_until_still();
    rig.run_ms(100);
    rig.assert_at(IK6_TARGETS, "it goes there");
    assert_eq!(rig.present(), rig.read(83, 7));
}

#[test]
fn m07_d18_fractions_of_a_degree_are_kept() {
    let mut rig = Rig::started();
    write_21(&mut rig, 54, &IK6);
    rig.run_until_still();
    rig.run_ms(100);
    // Joint 1: 105.124 degrees are 86 + 496.4 counts, and 105 degrees 86 + 495.8. Joint 2: 88.229 degrees are 20 + 433.4
    // counts, and 88 degrees 20 + 434.4.
    let (_, goals) = rig.goals().last().unwrap();
    assert_eq!(goals[..2], [(0, 582), (1, 453)]);
    rig.forget();
    write_21(&mut rig, 28, &[0]);
    write_21(&mut rig, 13, &[1, 1]);
    rig.run_until_still();
    rig.run_ms(100);
    let (_, goals) = rig.goals().last().unwrap();
    assert_eq!(goals[..2], [(0, 578), (1, 449)], "4.7 counts less, and not those of whole degrees");
}

#[test]
fn m07_what_cannot_be_reached_is_refused_whole() {
    let mut rig = Rig::started();
    rig.write(53, &[50]);
    let mut values = vec![100, 100, 100, 100, 100, 100, 60, 0];
    values.extend(IK6_FAR);
    write_21(&mut rig, 46, &values);
    assert_eq!((rig.targets(), rig.read(244, 2)), (STANDARD_POSE.to_vec(), vec![6, 54]));
    assert_eq!((rig.read(61, 2), rig.get(53)), (vec![0, 0], 50));
    write_21(&mut rig, 68, &IK5_FAR);
    assert_eq!((rig.read(244, 2), rig.read(68, 6)), (vec![6, 68], vec![0; 6]));
    assert_eq!((rig.counter(250), rig.get(243)), (2, 0));
}

#[test]
fn m07_no_flag_survives_a_frame() {
    let mut rig = Rig::started();
    write_21(&mut rig, 54, &[&IK6[..], &[0x81, 0x80, 0x80]].concat());
    rig.write(46, &STANDARD_POSE);
    write_21(&mut rig, 0, &[]);
    write_21(&mut rig, 54, &IK6[..8]);
    write_21(&mut rig, 68, &IK5[..5]);
    assert_eq!(rig.targets(), STANDARD_POSE, "a part of a block only stores");
    assert_eq!((rig.read(61, 1), rig.read(68, 6)), (vec![0x80], vec![4, 0x64, 4, 0xC8, 4, 0]));
}

#[test]
fn m07_ik5_moves_three_joints_and_the_rest_of_the_frame_applies() {
    let mut rig = Rig::started();
    write_21(&mut rig, 68, &IK5);
    assert_eq!(rig.targets(), [63, 90, 85, 90, 90, 90, 80]);
    let mut values = vec![10; 7];
    values.push(200);
    values.extend(IK6);
    write_21(&mut rig, 46, &values);
    assert_eq!(rig.targets(), [105, 88, 110, 90, 135, 10, 10], "positions go before targets in one frame");
}

#[test]
fn m07_d13_a_position_in_the_frame_that_enters_servo_wins_over_the_measured_ones() {
    let mut rig = Rig::started();
    rig.write(29, &[2]);
    let mut values = vec![1, 0, 0];
    values.extend([60; 7]);
    values.extend([0; 7]);
    values.extend(STANDARD_POSE);
    values.push(0);
    values.extend(IK6);
    write_21(&mut rig, 29, &values);
    assert_eq!(rig.targets(), IK6_TARGETS);
}

#[test]
fn m09_loads_show_which_way_a_joint_pushes() {
    let mut rig = Rig::started();
    rig.run_ms(1_000);
    let loads = rig.read(91, 7);
    // The level forearm takes 18.8 % of the stall torque of joint 3, less up to 5 % that static friction holds. The
    // load is towards more counts, which are smaller angles: 138 to 188 in 0.1 %, or 17 to 23 steps of 8.
    assert!((128 - 23..=128 - 17).contains(&loads[2]), "{}", loads[2]);
    assert_eq!((loads[0], loads[6]), (128, 128));
}

#[test]
fn m10_the_version_is_this_projects() {
    let mut rig = Rig::started();
    write_21(&mut rig, 0, &[]);
    assert_eq!(rig.read(0, 2), [7, 30]);
}

#[test]
fn m12_a_host_that_left_stops_its_reports_and_leaves_no_encoding() {
    for (register, function) in [(53, 6), (82, 4), (90, 4)] {
        let mut rig = Rig::started();
        rig.send(&frame(function, register, 1, &[50]));
        rig.write(0, &[]);
        write_21(&mut rig, 13, &[]);
        rig.send(&frame(function, register, 1, &[50]));
        let now = protocol_core::time::Instant::from_micros(rig.now_us);
        rig.controller.host_left(now);
        rig.run_ms(200);
        assert!(rig.to_host.is_empty());
        assert_eq!((rig.get(register), rig.read(13, 7)), (0, vec![0; 7]));
    }
}

//! What a host sees of the arm through its bytes: requests, refusals, feedback, settings, faults (D2, D3, D5, D6, D14, D16,
//! D19).

use crate::rig::{Rig, STANDARD_POSE, config, frame, reply, write};
use arm_sim::servo::ServoFault;
use motion_core::{Controller, Storage};
use protocol_core::registers::map::fault;
use protocol_core::registers::{Image, Joint};
use protocol_core::time::Instant;

#[test]
fn golden_conversation() {
    let mut rig = Rig::on_a_stand();
    rig.send(&[0xAA, 0x77, 0x03, 0x36, 0x07, 0x81, 0xCE]);
    rig.send(&[0xAA, 0x77, 0x03, 0x0A, 0x00, 0xD1, 0x0C]);
    let answers: Vec<_> = rig.to_host.drain(..).map(|(_, bytes)| bytes).collect();
    let present = [0xAA, 0x77, 3, 0x36, 7, 0x5A, 0x5A, 0x41, 0x5A, 0x5A, 0x5A, 0x50, 0x43, 0x81];
    assert_eq!(answers[0], present);
    assert_eq!(answers[1], [0xAA, 0x77, 0x03, 0x0A, 0x00, 0xD1, 0x0C]);
}

#[test]
fn d02_a_malformed_range_is_counted_and_shown() {
    let mut rig = Rig::started();
    rig.send(&frame(3, 250, 7, &[]));
    rig.send(&frame(6, 255, 2, &[1, 1]));
    assert!(rig.to_host.is_empty(), "no answer");
    assert_eq!(rig.read(244, 2), [1, 255]);
    assert_eq!(rig.counter(250), 2);
}

#[test]
fn d05_requests_wait_for_room_and_are_answered_in_order() {
    let mut rig = Rig::started();
    rig.room = 9;
    let requests: Vec<u8> = (0..30).flat_map(|address| frame(3, address, 3, &[])).collect();
    let taken = rig.controller.host_bytes(Instant::from_micros(rig.now_us), &requests);
    assert_eq!(taken, 210, "all of them fit the buffer");
    rig.run_ms(500);
    assert!(rig.to_host.is_empty());
    rig.room = 10;
    rig.run_ms(1);
    let order: Vec<u8> = rig.to_host.iter().map(|(_, bytes)| bytes[3]).collect();
    assert_eq!(order, (0..30).collect::<Vec<u8>>());
}

#[test]
fn d05_a_write_needs_no_room() {
    let mut rig = Rig::started();
    rig.room = 0;
    rig.write(46, &[120]);
    assert_eq!(rig.controller.registers().get(46), 120);
    rig.send(&frame(3, 54, 7, &[]));
    rig.write(46, &[130]);
    rig.run_ms(500);
    assert_eq!(
        rig.controller.registers().get(46),
        120,
        "a write behind a read that waits is carried out after it"
    );
    assert!(rig.to_host.is_empty());
    rig.room = 14;
    rig.run_ms(1);
    assert_eq!(rig.to_host.len(), 1);
    assert_eq!(rig.controller.registers().get(46), 130);
}

#[test]
fn d05_a_stop_gets_through_to_an_arm_whose_reports_are_not_read() {
    let mut rig = Rig::started();
    rig.write(53, &[50]);
    rig.room = 0;
    rig.write(46, &[180]);
    rig.run_ms(100);
    rig.write(46, &[100]);
    rig.run_ms(2_000);
    rig.room = 4_096;
    assert_eq!(rig.present()[0], 100);
}

#[test]
fn d05_a_read_that_waits_for_room_wakes_nobody_up() {
    let mut rig = Rig::started();
    rig.room = 7;
    rig.send(&[frame(3, 0, 1, &[]), vec![0xAA, 0x77, 3]].concat());
    assert_eq!(
        rig.controller.host_deadline(),
        Instant::FAR_FUTURE,
        "half a frame stands behind a read that waits"
    );
    rig.room = 8;
    rig.send(&[0, 1]);
    assert_eq!(rig.to_host.len(), 1);
    assert_ne!(rig.controller.host_deadline(), Instant::FAR_FUTURE);
}

#[test]
fn d05_a_full_buffer_takes_no_more_and_loses_nothing() {
    let mut rig = Rig::started();
    let requests: Vec<u8> = (0..100).flat_map(|address| frame(3, address, 1, &[])).collect();
    rig.room = 0;
    let now = Instant::from_micros(rig.now_us);
    let mut offered = rig.controller.host_bytes(now, &requests);
    assert_eq!(offered, 262);
    assert_eq!(rig.controller.host_bytes(now, &requests[offered..]), 0);
    rig.room = 300;
    rig.run_ms(1);
    while offered < requests.len() {
        offered += rig.controller.host_bytes(Instant::from_micros(rig.now_us), &requests[offered..]);
        rig.run_ms(1);
    }
    let order: Vec<u8> = rig.to_host.iter().map(|(_, bytes)| bytes[3]).collect();
    assert_eq!(order, (0..100).collect::<Vec<u8>>());
}

#[test]
fn d06_a_write_has_no_answer_and_its_fate_is_counted() {
    let mut rig = Rig::started();
    rig.write(46, &STANDARD_POSE);
    rig.write(0, &[9; 8]);
    let mut damaged = write(46, &STANDARD_POSE);
    damaged[6] ^= 1;
    rig.send(&damaged);
    rig.run_ms(50);
    assert!(rig.to_host.is_empty());
    assert_eq!(rig.counter(248), 1, "wrong CRC");
    assert_eq!(rig.counter(250), 0, "nothing refused");
    assert_eq!(rig.counter(246), 5, "two writes and three reads, this one included");
}

#[test]
fn d14_feedback_comes_at_its_rate_until_it_is_stopped() {
    let mut rig = Rig::on_a_stand();
    rig.send(&[0xAA, 0x77, 0x06, 0x35, 0x01, 0x1E, 0x7D, 0x04]);
    let start = rig.now_us;
    rig.run_ms(10_000);
    assert_eq!(rig.to_host.len(), 300);
    for (number, (at, bytes)) in (1..).zip(&rig.to_host) {
        assert_eq!(*bytes, reply(54, &STANDARD_POSE));
        assert_eq!(at - start, number * 1_000_000 / 30, "no drift");
    }
    rig.write(53, &[0]);
    rig.forget();
    rig.run_ms(1_000);
    assert!(rig.to_host.is_empty());
}

#[test]
fn d14_a_report_without_room_is_skipped_and_answers_go_first() {
    let mut rig = Rig::started();
    rig.write(53, &[10]);
    rig.room = 13;
    rig.run_ms(250);
    let request = frame(3, 0, 8, &[]);
    rig.controller.host_bytes(Instant::from_micros(rig.now_us), &request);
    rig.run_ms(70);
    assert!(rig.to_host.is_empty());
    rig.room = 14;
    rig.run_ms(100);
    assert!(rig.to_host.is_empty(), "a report that would fit waits for the reply before it");
    rig.room = 4_096;
    rig.run_ms(100);
    let order: Vec<u8> = rig.to_host.iter().map(|(_, bytes)| bytes[3]).collect();
    assert_eq!(order, [0, 54], "the answer, then one report and not those before");
}

#[test]
fn d14_the_baud_rate_bounds_feedback() {
    let mut image = Image([0; Image::LENGTH]);
    image.0[4] = 7; // 9600 baud
    let mut rig = Rig::with(arm_sim::plant::Plant::new(Instant::ZERO), Some(&image), Storage::Ready);
    assert_eq!(rig.controller.baud(), 9_600);
    rig.write(53, &[50]);
    rig.run_ms(10_000);
    assert_eq!(rig.to_host.len(), 340);
}

#[test]
fn d16_a_refused_frame_has_no_effect_and_says_why() {
    let mut rig = Rig::started();
    rig.write(46, &[90, 90, 65, 181, 90, 90, 80]);
    assert_eq!(rig.targets(), STANDARD_POSE);
    assert_eq!(rig.read(243, 3), [0, 2, 49]);
    assert_eq!(rig.counter(250), 1);
}

#[test]
fn d19_the_baud_rate_is_in_force_after_the_next_restart() {
    let mut rig = Rig::started();
    rig.write(28, &[0]);
    rig.write(12, &[3]);
    assert_eq!(rig.controller.baud(), 115_200);
    let image = rig.saved.pop().unwrap();
    let restarted = Controller::new(Instant::ZERO, config(), Some(&image), Storage::Ready);
    assert_eq!(restarted.baud(), 1_000_000);
}

#[test]
fn d19_a_setting_is_saved_before_anything_else_is_answered() {
    let mut rig = Rig::started();
    rig.write(28, &[0]);
    assert!(rig.saved.is_empty(), "the lock is not a setting");
    rig.write(11, &[42, 0, 0x85]);
    rig.write(11, &[42]);
    assert_eq!(rig.saved.len(), 1, "writing what is there saves nothing");
    assert_eq!(rig.saved[0].0[3..6], [42, 0, 0x85]);
    rig.write(30, &[1]);
    assert_eq!(rig.saved.len(), 1, "nor does writing RAM");
    let mut both = write(11, &[7]);
    both.extend(frame(3, 11, 1, &[]));
    rig.send(&both);
    assert_eq!(rig.saved.len(), 2);
    assert_eq!(rig.to_host.pop().unwrap().1, reply(11, &[7]));
}

#[test]
fn d19_a_full_storage_refuses_changes_and_nothing_else() {
    let mut rig = Rig::started();
    rig.write(28, &[0]);
    rig.storage = Storage::Full;
    rig.write(11, &[1]);
    assert_eq!(rig.get(241), 1, "fault bit 0");
    rig.write(11, &[2]);
    assert_eq!(rig.get(11), 1, "refused");
    assert_eq!(rig.read(244, 2), [3, 11]);
    assert_eq!(rig.counter(250), 1);
    rig.write(11, &[1]);
    rig.write(46, &STANDARD_POSE);
    assert_eq!(rig.counter(250), 1, "what changes no setting is accepted");
    assert_eq!(rig.saved.len(), 1);
}

#[test]
fn d19_a_broken_storage_leaves_settings_in_ram() {
    let mut rig = Rig::with(arm_sim::plant::Plant::new(Instant::ZERO), None, Storage::Broken);
    rig.storage = Storage::Broken;
    assert_eq!(rig.get(241) & 1, 1);
    rig.write(28, &[0]);
    rig.write(11, &[9]);
    assert_eq!(rig.get(11), 9);
    assert_eq!(rig.get(244), 0, "not refused");
    rig.controller.set_storage(Storage::Ready);
    assert_eq!(rig.get(241) & 1, 0, "the status block tells the truth");
}

#[test]
fn faults_that_the_shell_sees_are_shown_until_restart() {
    let mut rig = Rig::started();
    assert_eq!(rig.get(241), 0);
    rig.controller.raise_faults(1 << 5);
    rig.run_ms(2_000);
    assert_eq!(rig.get(241), 1 << 5);
}

#[test]
fn a_fault_that_two_can_see_is_shown_when_both_do() {
    let mut rig = Rig::started();
    rig.plant.set_fault(Joint::ALL[2], Some(ServoFault::Missing));
    rig.run_ms(200);
    rig.controller.set_storage(Storage::Broken);
    assert_eq!(rig.get(241), fault::SERVO_BUS | fault::SETTINGS_STORAGE);
    rig.controller.raise_faults(fault::SERVO_BUS | fault::SETTINGS_STORAGE);
    assert_eq!(rig.get(241), fault::SERVO_BUS | fault::SETTINGS_STORAGE);
}

#[test]
fn nothing_reaches_the_host_before_its_deadline() {
    let mut rig = Rig::started();
    let deadline = |rig: &Rig| rig.controller.host_deadline();
    assert_eq!(deadline(&rig), Instant::FAR_FUTURE, "it only answers");
    assert_eq!(rig.controller.host_bytes_wanted(), 7, "the shortest request");
    rig.send(&[0xAA, 0x77, 3]);
    assert_eq!(rig.controller.host_bytes_wanted(), 4);
    let silence = deadline(&rig).as_micros() - rig.now_us;
    assert!((1..=2_000).contains(&silence), "half a frame is judged again after {silence} us");
    rig.run_ms(200);
    rig.write(53, &[10]);
    for _ in 0..3 {
        rig.forget();
        let due = deadline(&rig).as_micros();
        rig.run_us(due - rig.now_us - 1);
        assert!(rig.to_host.is_empty(), "not before {due}");
        rig.run_us(1);
        assert_eq!(rig.to_host.len(), 1, "a report at {due}");
    }
}

#[test]
fn d03_no_frame_is_accepted_across_a_damaged_byte() {
    let mut rig = Rig::started();
    let frame = write(46, &[91]);
    let (head, tail) = frame.split_at(4);
    let now = Instant::from_micros(rig.now_us);
    rig.controller.host_bytes(now, head);
    rig.controller.host_byte_damaged();
    rig.run_ms(1);
    rig.controller.host_bytes(now, tail);
    rig.run_ms(1);
    assert_eq!(rig.targets()[0], 90);
    rig.write(46, &[91]);
    assert_eq!(rig.targets()[0], 91, "the next frame counts");
}

//! The extended block of the registers: fine targets, streams, watchdog, limits and reports (D21 to D26).

use crate::rig::{Rig, STANDARD_POSE, frame, reply, write};
use arm_sim::servo::ServoFault;
use motion_core::calibration::angle_from_counts;
use protocol_core::registers::Joint;

const STATE: u8 = 29;
const TARGET: u8 = 46;
const FREQUENCY: u8 = 53;
const FINE_TARGET: u8 = 128;
const FINE_POSITION: u8 = 142;
const VELOCITY: u8 = 156;
const LOAD: u8 = 170;
const PERIOD: u8 = 184;
const WATCHDOG: u8 = 186;
const LIMITS: u8 = 188;
const CONTENT: u8 = 189;
const MEASURED: u8 = 190;
const FAULTS: u8 = 241;
const MOVING: u8 = 243;
const REFUSAL: u8 = 244;

fn word(rig: &mut Rig, address: u8) -> u16 {
    let bytes = rig.read(address, 2);
    u16::from_le_bytes([bytes[0], bytes[1]])
}

fn signed(rig: &mut Rig, address: u8) -> i16 {
    word(rig, address).cast_signed()
}

fn fine(centidegrees: &[u16]) -> Vec<u8> {
    centidegrees.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// The reason and the register of the last refusal.
fn refusal(rig: &mut Rig) -> (u8, u8) {
    let bytes = rig.read(REFUSAL, 2);
    (bytes[0], bytes[1])
}

#[test]
fn d21_coarse_and_fine_targets_are_one_target() {
    let mut rig = Rig::started();
    // The targets are the measured positions: joint 3 stood at 684 counts, joint 7 at 1008.
    assert_eq!(rig.read(FINE_TARGET, 14), fine(&[9_000, 9_000, 6_501, 9_000, 8_986, 8_986, 8_006]));
    rig.write(TARGET, &[100]);
    assert_eq!(word(&mut rig, FINE_TARGET), 10_000, "a coarse write has no fraction");
    for (centidegrees, degrees) in [(9_049, 90), (9_050, 91), (18_000, 180), (49, 0), (50, 1)] {
        rig.write(FINE_TARGET, &fine(&[centidegrees]));
        assert_eq!((rig.targets()[0], word(&mut rig, FINE_TARGET)), (degrees, centidegrees));
    }
    rig.write(FINE_TARGET, &fine(&[9_123]));
    rig.run_until_still();
    rig.run_ms(300);
    // (91.23 * 850 / 180 + 86) = 516.8 counts.
    assert_eq!(rig.goals().last().unwrap().1[0], (0, 517));
    assert_eq!(word(&mut rig, FINE_POSITION), 9_127, "517 counts");
}

#[test]
fn d21_positions_velocities_and_loads_are_those_of_the_servos() {
    let mut rig = Rig::new();
    rig.plant.set_fault(Joint::ALL[3], Some(ServoFault::Missing));
    assert_eq!(rig.read(FINE_POSITION, 14), [0xFF; 14]);
    rig.run_ms(1_000);
    assert_eq!((rig.get(MEASURED), word(&mut rig, FINE_POSITION + 6)), (0b111_0111, 0xFFFF));
    // Joint 1 turns towards greater angles, joint 3, whose servo is reversed, towards smaller ones, both at 95 degrees/s.
    rig.write(32, &[50, 50, 50]);
    rig.write(TARGET, &[150, 90, 30]);
    rig.run_ms(300);
    assert!(signed(&mut rig, VELOCITY).abs_diff(950) < 30, "{}", signed(&mut rig, VELOCITY));
    assert!(signed(&mut rig, VELOCITY + 4).abs_diff(-950) < 30, "{}", signed(&mut rig, VELOCITY + 4));
    rig.run_until_still();
    rig.run_ms(500);
    assert_eq!((signed(&mut rig, VELOCITY), signed(&mut rig, VELOCITY + 4)), (0, 0));
    rig.plant.set_fault(Joint::ALL[0], Some(ServoFault::Missing));
    let before = (word(&mut rig, FINE_POSITION), rig.present()[0]);
    rig.run_ms(500);
    assert_eq!((word(&mut rig, FINE_POSITION), rig.present()[0]), before, "a silent joint keeps its last");
    assert_eq!(rig.get(MEASURED), 0b111_0111);
}

#[test]
fn d21_a_load_pushes_against_the_weight() {
    for degrees in [40, 140] {
        let mut rig = Rig::started();
        rig.write(TARGET + 1, &[degrees]);
        rig.run_until_still();
        rig.run_ms(500);
        let load = signed(&mut rig, LOAD + 2);
        rig.write(STATE, &[2]);
        rig.run_ms(1_000);
        let fallen = rig.present()[1];
        assert!(
            load != 0 && (load > 0) == (fallen < degrees),
            "load {load} at {degrees}, fallen to {fallen}"
        );
    }
}

#[test]
fn d22_half_a_word_is_refused_whole() {
    let mut rig = Rig::started();
    rig.write(FINE_TARGET, &[0, 0, 0]);
    assert_eq!(refusal(&mut rig), (4, 130));
    rig.write(PERIOD, &[4, 0]);
    assert_eq!(refusal(&mut rig), (2, PERIOD));
    assert_eq!((rig.targets(), rig.counter(250)), (STANDARD_POSE.to_vec(), 2));
}

#[test]
fn d23_a_fine_target_that_came_before_a_control_cycle_goes_out_with_its_goals() {
    let mut rig = Rig::started();
    // Up to the moment before the next cycle.
    rig.run_us(9_999);
    rig.now_us += 1;
    rig.forget();
    rig.write(FINE_TARGET, &fine(&[9_150]));
    let goals: Vec<_> = rig.goals().map(|(at, goals)| (at, goals[0])).collect();
    assert_eq!(goals, [(rig.now_us, (0, 516))], "1.5 degrees are 5 counts");
}

#[test]
fn d23_a_new_period_does_not_count_for_the_points_before_it_in_its_frame() {
    let mut rig = Rig::started();
    rig.write(32, &[0; 7]);
    // The move is to take 5 s.
    rig.write(39, &[50; 7]);
    let mut frame = fine(&[12_000, 9_000, 6_500, 9_000, 9_000, 9_000, 8_000]);
    frame.resize(56, 0);
    frame.extend([20, 0]);
    rig.write(FINE_TARGET, &frame);
    rig.run_ms(1_000);
    let present = rig.present()[0];
    assert!((94..=98).contains(&present), "after a fifth of the time: {present}");
    rig.write(FINE_TARGET, &fine(&[9_600]));
    rig.run_ms(300);
    assert_eq!(rig.present()[0], 96, "the next one is a point of a stream");
}

#[test]
fn d23_a_stream_ends_with_a_coarse_target_and_stops_at_its_last_point() {
    let mut rig = Rig::started();
    rig.write(PERIOD, &20_u16.to_le_bytes());
    for step in 1..=10 {
        rig.write(FINE_TARGET, &fine(&[9_000 + step * 50]));
        rig.run_ms(20);
    }
    assert_eq!(rig.get(MOVING), 1);
    rig.run_ms(30);
    assert_eq!((rig.get(MOVING), word(&mut rig, FINE_TARGET), rig.targets()[0]), (0, 9_500, 95));
    rig.write(FINE_TARGET, &fine(&[9_600]));
    rig.write(TARGET, &[90]);
    rig.run_until_still();
    assert_eq!(rig.goals().last().unwrap().1[0], (0, 511), "the point of the stream is forgotten");
}

/// A driven arm whose joint 1 is on its way from 90 to 150 degrees, with the watchdog at 200 ms.
fn guarded(action: u8) -> Rig {
    let mut rig = Rig::started();
    rig.write(WATCHDOG, &[20, action]);
    rig.write(TARGET, &[150]);
    rig
}

#[test]
fn d24_a_silent_host_stops_the_arm_where_its_set_points_are() {
    let mut rig = guarded(0);
    rig.run_ms(199);
    assert_eq!(rig.controller.registers().get(FAULTS), 0);
    rig.run_ms(11);
    let held = rig.goals().last().unwrap().1[0];
    rig.run_ms(1_000);
    assert_eq!(rig.goals().last().unwrap().1[0], held, "the set-point does not move");
    assert_eq!((rig.get(FAULTS), rig.get(MOVING), rig.get(STATE)), (64, 0, 1));
    let target = word(&mut rig, FINE_TARGET);
    // 20 cycles of 1.14 degrees.
    assert!((11_100..=11_400).contains(&target), "{target}");
    assert_eq!(u16::from(rig.targets()[0]), (target + 50) / 100);
    rig.write(TARGET, &[90]);
    rig.run_ms(50);
    assert_eq!((rig.get(MOVING), rig.get(FAULTS)), (1, 64), "a new target is approached, the fault stays");
    rig.write(WATCHDOG, &[0]);
    assert_eq!(rig.get(FAULTS), 0);
    rig.run_ms(3_000);
    assert_eq!(rig.get(FAULTS), 0);
}

#[test]
fn d24_the_watchdog_can_damp_the_arm() {
    let mut rig = guarded(1);
    rig.forget();
    rig.run_ms(210);
    assert_eq!(rig.torques().last(), Some([Some(0); 7]), "damping");
    assert_eq!((rig.get(STATE), rig.get(FAULTS)), (0, 64));
}

#[test]
fn d24_every_well_formed_frame_ends_the_silence_and_no_other() {
    let refused = write(TARGET, &[181]);
    let read = frame(3, 0, 1, &[]);
    let map21 = frame(4, 30, 1, &[0]);
    let mut damaged = write(TARGET, &[91]);
    *damaged.last_mut().unwrap() ^= 1;
    let malformed = frame(3, 250, 7, &[]);
    for (frame, counts) in
        [(refused, true), (read, true), (map21, true), (damaged, false), (malformed, false)]
    {
        let mut rig = guarded(0);
        for _ in 0..5 {
            rig.run_ms(150);
            rig.send(&frame);
        }
        assert_eq!(rig.controller.registers().get(FAULTS) == 0, counts, "{frame:02x?}");
    }
}

#[test]
fn d24_the_watchdog_acts_once_in_each_silence() {
    let mut rig = guarded(1);
    rig.run_ms(210);
    rig.write(STATE, &[1]);
    rig.run_ms(100);
    assert_eq!(rig.get(STATE), 1, "the frame began a new silence");
    rig.run_ms(210);
    assert_eq!(rig.controller.registers().get(STATE), 0);
}

#[test]
fn d24_a_joint_that_waits_forgets_its_target() {
    let mut rig = Rig::new();
    rig.plant.set_fault(Joint::ALL[0], Some(ServoFault::Missing));
    rig.run_ms(1_000);
    rig.write(WATCHDOG, &[20]);
    rig.write(TARGET, &[150]);
    rig.run_ms(300);
    rig.plant.set_fault(Joint::ALL[0], None);
    rig.run_ms(500);
    assert_eq!((rig.targets()[0], rig.get(MOVING)), (90, 0), "it holds where it was found");
}

#[test]
fn d25_a_target_that_breaks_the_linkage_is_refused_whole() {
    let mut rig = Rig::started();
    rig.write(LIMITS, &[1]);
    for (address, values, at) in [
        (TARGET, vec![90, 162, 65, 90], 47),
        (48, vec![137], 48),
        (47, vec![18], 47),
        (FINE_TARGET, fine(&[9_000, 16_101]), 130),
        (132, fine(&[13_601]), 132),
    ] {
        rig.write(address, &values);
        assert_eq!(refusal(&mut rig), (5, at), "{values:?}");
    }
    assert_eq!(rig.targets(), STANDARD_POSE);
    rig.write(TARGET, &[90, 161, 65]);
    assert_eq!(rig.targets()[1], 161);
    rig.write(TARGET, &[20, 180, 30, 90, 90, 90, 180]);
    assert_eq!(rig.targets()[6], 180, "the claw's limit is off");
}

#[test]
fn d25_a_limit_that_is_broken_cannot_be_switched_on() {
    let mut rig = Rig::started();
    rig.write(52, &[85]);
    rig.write(LIMITS, &[2]);
    assert_eq!((refusal(&mut rig), rig.get(LIMITS)), ((5, LIMITS), 0));
    rig.write(52, &[84]);
    rig.write(LIMITS, &[2]);
    assert_eq!(rig.get(LIMITS), 2);
    rig.write(52, &[85]);
    assert_eq!(refusal(&mut rig), (5, 52));
    // One frame that covers 46 to 188. It switches the limit of the linkage on, and its targets break this limit.
    let mut frame = vec![0; 143];
    frame[..7].copy_from_slice(&[90, 90, 65, 90, 90, 90, 80]);
    frame[82..96].copy_from_slice(&fine(&[9_000, 0, 8_399, 9_000, 9_000, 9_000, 8_000]));
    frame[142] = 3;
    rig.write(TARGET, &frame);
    assert_eq!((refusal(&mut rig), rig.get(LIMITS), rig.targets()[2]), ((5, LIMITS), 2, 65));
    frame[142] = 0;
    rig.write(TARGET, &frame);
    assert_eq!((rig.get(LIMITS), rig.targets()[2]), (0, 84), "a frame that switches the limits off");
    // A set-point that is still on its way breaks the limit, too.
    rig.write(FINE_TARGET + 2, &fine(&[9_000, 6_500]));
    rig.run_until_still();
    rig.write(TARGET + 1, &[180]);
    rig.run_until_still();
    rig.write(TARGET + 1, &[90]);
    rig.write(LIMITS, &[1]);
    assert_eq!((refusal(&mut rig), rig.get(LIMITS)), ((5, LIMITS), 0));
}

#[test]
fn d25_a_position_of_map_21_is_a_target_like_any_other() {
    let mut rig = Rig::started();
    rig.write(LIMITS, &[1]);
    // The wrist at (0, 185, 50) mm.
    let wrist: Vec<u8> = [0_i16, 185, 50].iter().flat_map(|mm| (mm + 1024).to_be_bytes()).collect();
    rig.send(&frame(4, 68, 6, &wrist));
    assert_eq!(refusal(&mut rig).0, 0);
    let reached = rig.targets();
    assert!(reached != STANDARD_POSE);
    rig.send(&frame(4, 47, 2, &[162, 65]));
    assert_eq!((refusal(&mut rig), rig.targets()), ((5, 47), reached));
}

#[test]
fn d25_joints_2_and_3_wait_for_each_other_on_the_way() {
    let mut rig = Rig::started();
    rig.write(33, &[100, 10]);
    rig.write(TARGET + 1, &[40, 180]);
    rig.run_until_still();
    rig.write(LIMITS, &[1]);
    rig.forget();
    rig.write(TARGET + 1, &[180, 40]);
    rig.run_until_still();
    let angle = |joint: usize, counts| angle_from_counts(Joint::ALL[joint], counts, 0).0;
    let sums: Vec<i32> = rig.goals().map(|(_, goals)| angle(1, goals[1].1) + angle(2, goals[2].1)).collect();
    // A goal is rounded to a count of 0.212 degrees.
    assert!(sums.iter().all(|sum| (83_700_000..=226_300_000).contains(sum)), "{:?}", sums.iter().max());
    assert!(sums.iter().any(|sum| *sum > 225_500_000), "joint 2 goes as far as it may");
    assert_eq!(rig.targets()[1..3], [180, 40]);
}

#[test]
fn d25_where_a_hand_left_the_arm_it_holds_and_comes_back_inside() {
    let mut rig = Rig::started();
    rig.write(LIMITS, &[1]);
    rig.write(STATE, &[2]);
    rig.run_ms(100);
    rig.hand(2, 100); // 163 degrees
    rig.hand(3, 600); // 83 degrees
    rig.run_ms(500);
    rig.write(STATE, &[1]);
    rig.run_ms(500);
    let sum = |rig: &mut Rig| rig.targets()[1..3].iter().map(|&angle| u16::from(angle)).sum::<u16>();
    assert!(sum(&mut rig) > 226 && rig.get(MOVING) == 0, "it holds outside");
    rig.write(TARGET + 1, &[170]);
    assert_eq!(refusal(&mut rig), (5, 47));
    rig.write(TARGET + 1, &[90, 65]);
    rig.run_until_still();
    assert_eq!(rig.targets()[1..3], [90, 65]);
}

#[test]
fn d26_a_report_holds_what_register_189_says() {
    let mut rig = Rig::started();
    rig.write(CONTENT, &[2]);
    rig.write(FREQUENCY, &[50]);
    for (content, address, count) in [(2, FINE_POSITION, 42), (1, FINE_POSITION, 14), (0, 54, 7)] {
        rig.write(CONTENT, &[content]);
        rig.forget();
        rig.run_ms(1_000);
        let values = rig.controller.registers().read(address, count).to_vec();
        let reports: Vec<_> = rig.to_host.iter().map(|(_, bytes)| bytes.clone()).collect();
        assert!((49..=50).contains(&reports.len()), "{}", reports.len());
        assert!(reports.iter().all(|bytes| *bytes == reply(address, &values)), "{content}");
    }
}

use super::*;
use crate::CYCLE;
use crate::servo_bus::{HeldGoal, Reading};
use protocol_core::registers::map::{LIMITS, PRESENT_POSITION, limit};

const J1: Joint = Joint::ALL[0];

fn at_ms(millis: u64) -> Instant {
    Instant::from_micros(millis * 1_000)
}

fn answer(position_counts: u16) -> Answer {
    let reading =
        Reading { position_counts, speed: 0, load: 0, voltage_decivolts: 74, temperature_celsius: 31 };
    Answer { reading, alarms: 4, torque: None, answer_micros: 500 }
}

/// Joints of which joint 1 was measured at 90 degrees. In the servo state its servo has shown its goal.
fn measured(state: MotorState) -> (Joints, RegisterFile) {
    let mut registers = RegisterFile::new([0; 6], None);
    let mut joints = Joints::new(state);
    measure(&mut joints, J1, 511, &mut registers);
    (joints, registers)
}

/// Measures a joint until it engages, then answers that its servo has the goal.
fn measure(joints: &mut Joints, joint: Joint, counts: u16, registers: &mut RegisterFile) {
    joints.measured(at_ms(0), joint, &answer(counts), true, registers);
    joints.measured(at_ms(10), joint, &answer(counts), true, registers);
    let torque = Some(HeldGoal { is_on: false, goal_counts: counts });
    joints.measured(at_ms(10), joint, &Answer { torque, ..answer(counts) }, true, registers);
}

#[test]
fn d12_a_joint_engages_at_the_second_reading_and_the_others_are_left_as_they_are() {
    let (mut joints, registers) = measured(MotorState::Servo);
    assert_eq!((registers.get(PRESENT_POSITION.of(J1)), registers.get(TARGET_POSITION.of(J1))), (90, 90));
    assert_eq!(joints.goals(at_ms(10), &registers).collect::<Vec<_>>(), [(J1, 511)]);
    let torque = joints.take_torque(true);
    assert_eq!((torque[0], &torque[1..]), (Some(Torque::On), [None; 6].as_slice()));
    assert_eq!((joints.silent(), joints.hottest(), joints.any_alarm()), (0b111_1110, 31, true));
}

#[test]
fn a_reading_tells_whether_anything_changed_beside_position_velocity_and_load() {
    let (mut joints, mut registers) = (Joints::new(MotorState::Forceless), RegisterFile::new([0; 6], None));
    let mut measure = |millis, alarms, temperature_celsius| {
        let reading = Reading { temperature_celsius, ..answer(511).reading };
        let answer = Answer { reading, alarms, ..answer(511) };
        joints.measured(at_ms(millis), J1, &answer, true, &mut registers)
    };
    assert_eq!(measure(0, 0, 0), Measured::Rejected, "nothing to compare it with");
    assert_eq!(measure(10, 0, 0), Measured::ServoChanged, "it answers, at 0 degrees Celsius");
    assert_eq!(measure(20, 0, 0), Measured::Accepted);
    assert_eq!(measure(30, 0, 1), Measured::ServoChanged);
    assert_eq!(measure(40, 4, 1), Measured::ServoChanged);
    assert_eq!(measure(50, 4, 1), Measured::Accepted);
}

#[test]
fn d12_a_silent_joint_is_told_nothing() {
    let (mut joints, registers) = measured(MotorState::Servo);
    joints.take_torque(true);
    assert_eq!([2, 3, 4].map(|cycle| joints.failed(at_ms(cycle * 10), J1)), [false, false, true]);
    assert_eq!(joints.goals(at_ms(40), &registers).count(), 0);
    assert_eq!(joints.take_torque(true), [None; JOINTS]);
    assert_eq!((joints.silent(), joints.hottest(), joints.any_alarm()), (0x7F, 0, false));
}

#[test]
fn d12_a_joint_is_not_given_torque_where_it_was_measured_long_ago() {
    let (mut joints, registers) = measured(MotorState::Servo);
    joints.expire_pending(at_ms(30));
    assert_eq!([30, 31].map(|millis| joints.goals(at_ms(millis), &registers).count()), [1, 0], "no old goal");
    joints.expire_pending(at_ms(31));
    assert_eq!(joints.goals(at_ms(30), &registers).count(), 0);
    assert_eq!(joints.take_torque(true), [None; JOINTS]);
}

/// Simulates a servo at full load that turns its joint further: from `from` counts, by 25 counts between two answers. Each
/// answer takes five control cycles. Returns each measured position and the goal after it.
fn turned_on(joints: &mut Joints, registers: &mut RegisterFile, joint: Joint, from: u16) -> Vec<(u16, u16)> {
    registers.set(SPEED.of(joint), 90);
    let mut step = |(millis, position)| {
        for cycle in (millis - 50..millis).step_by(10).map(at_ms) {
            joints.advance(cycle, cycle + CYCLE, registers);
        }
        let reading = Reading { speed: 300, load: 1_000, ..answer(position).reading };
        let late = Answer { reading, alarms: 0, answer_micros: 49_000, ..answer(position) };
        joints.measured(at_ms(millis), joint, &late, true, registers);
        let goal = joints.goals(at_ms(millis), registers).find(|(other, _)| *other == joint);
        (position, goal.unwrap().1)
    };
    (60..=710).step_by(50).zip((from..).step_by(25)).map(&mut step).collect()
}

#[test]
fn d27_a_set_point_that_gave_way_never_turns_back_a_joint_that_turned_past_it() {
    let (mut joints, mut registers) = measured(MotorState::Servo);
    joints.take_torque(true);
    joints.joint_mut(J1).unwrap().move_to(180, 0);
    let moments = turned_on(&mut joints, &mut registers, J1, 511);
    assert!(moments.iter().all(|(position, goal)| goal >= position), "{moments:?}");
    assert!(!moments.is_sorted_by_key(|(_, goal)| goal), "it never gave way: {moments:?}");
}

/// One damaged answer in 256 passes its checksum. After a pause, the false position in it is within reach.
#[test]
fn d27_a_false_position_after_a_pause_does_not_move_the_set_point_of_a_joint_that_is_held() {
    let (mut joints, mut registers) = measured(MotorState::Servo);
    joints.take_torque(true);
    joints.joint_mut(J1).unwrap().move_to(180, 0);
    registers.set(SPEED.of(J1), 90);
    let mut measure = |millis: u64, position, load| {
        let reading = Reading { load, ..answer(position).reading };
        joints.measured(
            at_ms(millis),
            J1,
            &Answer { reading, alarms: 0, ..answer(position) },
            true,
            &mut registers,
        );
        joints.advance(at_ms(millis), at_ms(millis) + CYCLE, &mut registers);
        let goal = joints.goals(at_ms(millis), &registers).find(|(joint, _)| *joint == J1);
        goal.unwrap().1
    };
    // A wall at 511 counts.
    let held = (20..1_000).step_by(10).map(|millis| measure(millis, 511, 710)).last().unwrap();
    assert!((512..600).contains(&held), "it gave way: {held}");
    let goals = [(1_120, 640), (1_280, 511), (1_290, 511)].map(|(millis, at)| measure(millis, at, 710));
    assert!(goals.iter().all(|goal| goal.abs_diff(held) < 8), "{goals:?} after {held}");
}

#[test]
fn d25_a_set_point_does_not_follow_a_joint_out_of_the_linkage() {
    let [_, two, three, ..] = Joint::ALL;
    let (mut joints, mut registers) = measured(MotorState::Servo);
    registers.set(LIMITS.address, limit::LINKAGE);
    let counts = |joint, degrees| counts_from_angle(joint, MicroDegrees::from_degrees(degrees), 0);
    measure(&mut joints, two, counts(two, 40), &mut registers);
    measure(&mut joints, three, counts(three, 90), &mut registers);
    joints.take_torque(true);
    joints.joint_mut(three).unwrap().move_to(0, 0);
    let moments = turned_on(&mut joints, &mut registers, three, counts(three, 90));
    let end = counts(three, 84 - 40);
    assert!(moments.iter().any(|(position, _)| *position > end + 10), "{moments:?}");
    assert!(moments.iter().all(|(_, goal)| *goal <= end), "{moments:?}, and {end} is the last one inside");
    assert!(!moments.is_sorted_by_key(|(_, goal)| goal), "it never gave way: {moments:?}");
}

/// Some servos show their torque switch as on while heat keeps them from holding.
#[test]
fn d28_a_joint_that_an_alarm_frees_while_its_torque_is_pending_gets_none() {
    let (mut joints, mut registers) = (Joints::new(MotorState::Servo), RegisterFile::new([0; 6], None));
    let mut read = |millis, position_counts, goal_counts| {
        let torque = Some(HeldGoal { is_on: true, goal_counts });
        let answer = Answer { torque, ..answer(position_counts) };
        joints.measured(at_ms(millis), J1, &answer, true, &mut registers)
    };
    assert_eq!([(0, 513, 620), (2, 511, 620)].map(|(ms, at, goal)| read(ms, at, goal))[1], Measured::Engaged);
    assert_eq!(read(32, 477, 511), Measured::Accepted, "it falls");
    assert_eq!(joints.take_torque(true)[0], Some(Torque::Damping), "which ends a latched overload");
}

#[test]
fn d29_a_joint_that_was_silent_before_it_had_torque_engages_after_any_time() {
    let (mut joints, mut registers) = measured(MotorState::Servo);
    assert_eq!([20, 30, 40].map(|millis| joints.failed(at_ms(millis), J1)), [false, false, true]);
    let mut measure = |millis| joints.measured(at_ms(millis), J1, &answer(511), true, &mut registers);
    assert_eq!([3_000, 3_010].map(&mut measure), [Measured::Rejected, Measured::Engaged]);
}

/// One damaged answer in 256 passes its checksum.
#[test]
fn d29_two_answers_have_to_say_that_a_servo_restarted_while_its_torque_is_pending() {
    for restarts in [false, true] {
        let (mut joints, mut registers) = measured(MotorState::Servo);
        joints.take_torque(true);
        assert_eq!([20, 30, 40].map(|millis| joints.failed(at_ms(millis), J1)), [false, false, true]);
        let mut read = |millis, is_on| {
            let torque = Some(HeldGoal { is_on, goal_counts: 511 });
            let outcome =
                joints.measured(at_ms(millis), J1, &Answer { torque, ..answer(511) }, true, &mut registers);
            let goals = joints.goals(at_ms(millis), &registers).count();
            (outcome, goals, joints.joint(J1).unwrap().is_let_go())
        };
        assert_eq!(read(3_000, true), (Measured::Rejected, 0, false));
        assert_eq!(read(3_010, true), (Measured::Engaged, 1, false));
        assert_eq!(read(3_020, false), (Measured::Accepted, 0, false), "no goal while it is doubtful");
        let expected = if restarts { Measured::Accepted } else { Measured::TorqueDue { goals: 1 } };
        assert_eq!(read(3_030, !restarts), (expected, usize::from(!restarts), restarts));
    }
}

#[test]
fn d13_the_other_states_set_every_switch_and_drive_nothing() {
    for (state, torque) in [(MotorState::Damping, Torque::Damping), (MotorState::Forceless, Torque::Free)] {
        let (mut joints, mut registers) = measured(MotorState::Servo);
        assert!(joints.set_state(state, &mut registers));
        assert!(!joints.set_state(state, &mut registers), "the state did not change");
        assert_eq!(joints.take_torque(true), [Some(torque); JOINTS]);
        assert_eq!(joints.goals(at_ms(10), &registers).count(), 0);
        assert!(!joints.advance(at_ms(0), at_ms(0), &mut registers));
    }
}

#[test]
fn d13_entering_the_servo_state_makes_the_measured_positions_the_targets() {
    let (mut joints, mut registers) = measured(MotorState::Forceless);
    registers.set(TARGET_POSITION.of(J1), 10);
    joints.set_state(MotorState::Servo, &mut registers);
    assert_eq!(registers.get(TARGET_POSITION.of(J1)), 90);
    assert_eq!(registers.get(TARGET_POSITION.of(Joint::ALL[2])), 65, "this joint was not measured");
}

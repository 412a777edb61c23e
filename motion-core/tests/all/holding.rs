//! What servos receive while a controller starts, while a servo is silent, and when the motor state changes, so that no
//! joint that should hold falls (D12, D13).

use crate::rig::{Rig, STANDARD_POSE, ToServos};
use arm_sim::servo::ServoFault;
use protocol_core::registers::Joint;
use protocol_core::time::Duration;

const DAMPING: u8 = 0;
const SERVO: u8 = 1;
const FORCELESS: u8 = 2;
const ELBOW: Joint = Joint::ALL[2];

/// Did the elbow's servo receive only questions?
fn elbow_was_only_asked(rig: &Rig) -> bool {
    rig.to_servos.iter().all(|(_, told)| match told {
        ToServos::Ask(_) => true,
        ToServos::Torque(codes) => codes[2].is_none(),
        ToServos::Goals(goals) => goals.iter().all(|&(id, _)| id != 2),
    })
}

/// Damages all answers of the elbow's servo, and waits until register 242 shows it as silent.
fn silence_elbow(rig: &mut Rig) {
    rig.plant.set_fault(ELBOW, Some(ServoFault::Garbled(1)));
    rig.run_ms(200);
    assert_eq!(rig.get(242), ELBOW.bit());
    rig.forget();
}

#[test]
fn d12_nothing_but_questions_is_sent_until_start_up_is_over() {
    for is_missing in [false, true] {
        let mut rig = Rig::started();
        rig.write(46, &[120, 80, 70]);
        rig.run_ms(1_000);
        if is_missing {
            rig.plant.set_fault(ELBOW, Some(ServoFault::Missing));
        }
        rig.restart_controller();
        rig.forget();
        rig.write(29, &[FORCELESS]);
        rig.write(29, &[SERVO]);
        let start_up_ms = if is_missing { 499 } else { 15 };
        rig.run_ms(start_up_ms);
        assert!(rig.to_servos.iter().all(|(_, told)| matches!(told, ToServos::Ask(_))), "{is_missing}");
        rig.run_ms(100);
        assert!(rig.torques().count() > 0, "and then it is over");
    }
}

#[test]
fn d12_no_joint_is_freed_or_damped_by_a_restart_of_the_controller() {
    let mut rig = Rig::started();
    rig.write(46, &[120, 80, 70]);
    rig.run_ms(1_000);
    rig.run_ms(500);
    let angles = |rig: &Rig| Joint::ALL.map(|joint| rig.plant.angle(joint));
    let held = angles(&rig);
    for _ in 0..3 {
        rig.restart_controller();
        rig.forget();
        rig.run_ms(1_000);
        assert!(rig.torques().flatten().flatten().all(|code| code == 1), "only torque on");
        assert_eq!(rig.targets(), [120, 80, 70, 90, 90, 90, 80], "the goals that the servos hold");
        assert_eq!(angles(&rig), held, "no loaded joint sags");
    }
}

#[test]
fn d12_a_silent_servo_hears_nothing_but_questions_whatever_made_it_silent() {
    let late = |millis| ServoFault::Late(Duration::from_millis(millis));
    for fault in [ServoFault::Missing, late(30), ServoFault::Garbled(1)] {
        let mut rig = Rig::started();
        rig.plant.set_fault(ELBOW, Some(fault));
        rig.run_ms(200);
        rig.forget();
        rig.write(46, &[120, 80, 70]);
        rig.run_ms(2_000);
        assert!(elbow_was_only_asked(&rig), "{fault:?}");
    }
}

#[test]
fn d12_a_joint_that_answers_again_near_its_set_point_is_driven_on_from_there() {
    let mut rig = Rig::started();
    rig.write(32, &[10; 7]);
    rig.write(46, &[90, 90, 100]);
    rig.run_ms(500);
    silence_elbow(&mut rig);
    rig.run_ms(1_000);
    rig.plant.set_fault(ELBOW, None);
    rig.run_ms(3_000);
    assert_eq!(rig.targets()[2], 100);
    rig.assert_at([90, 90, 100, 90, 90, 90, 80], "the move goes on");
    let goals: Vec<u16> = rig
        .goals()
        .filter_map(|(_, goals)| goals.iter().find(|goal| goal.0 == 2))
        .map(|goal| goal.1)
        .collect();
    // 0.19 degrees a cycle are 0.9 counts.
    assert!(goals.windows(2).all(|pair| pair[0].abs_diff(pair[1]) <= 1), "without a jump: {goals:?}");
}

#[test]
fn d12_a_joint_that_answers_again_elsewhere_holds_there() {
    let mut rig = Rig::started();
    rig.plant.set_fault(ELBOW, Some(ServoFault::Missing));
    rig.run_ms(200);
    rig.hand(3, 600); // a = (600 - 141) * 180 / 850 = 97.2, reversed: 82.8
    rig.plant.set_fault(ELBOW, None);
    rig.run_ms(1_000);
    assert_eq!((rig.targets()[2], rig.present()[2]), (83, 83));
}

#[test]
fn d12_a_joint_that_answers_again_goes_to_the_target_written_meanwhile() {
    for counts in [684, 600] {
        let mut rig = Rig::started();
        rig.plant.set_fault(ELBOW, Some(ServoFault::Missing));
        rig.run_ms(200);
        rig.write(48, &[70]);
        rig.hand(3, counts);
        rig.plant.set_fault(ELBOW, None);
        rig.run_ms(2_000);
        assert_eq!(rig.targets()[2], 70);
        rig.assert_at([90, 90, 70, 90, 90, 90, 80], format!("found at {counts} counts"));
    }
}

#[test]
fn d12_three_bad_replies_do_not_free_a_healthy_servo() {
    let mut rig = Rig::started();
    silence_elbow(&mut rig);
    rig.plant.set_fault(ELBOW, None);
    rig.run_ms(1_000);
    assert!(rig.torques().flatten().flatten().all(|code| code == 1));
    rig.assert_at(STANDARD_POSE, "it holds");
}

#[test]
fn d13_from_damping_or_forceless_to_servo_there_is_no_torque_state_between() {
    for state in [DAMPING, FORCELESS] {
        let mut rig = Rig::started();
        rig.plant.set_fault(ELBOW, Some(ServoFault::Missing));
        rig.write(29, &[state]);
        rig.run_ms(500);
        rig.forget();
        rig.write(29, &[SERVO]);
        rig.run_ms(500);
        assert!(rig.torques().flatten().flatten().all(|code| code == 1), "from {state}");
        assert!(elbow_was_only_asked(&rig), "nor is a silent servo told anything");
    }
}

#[test]
fn d13_a_change_of_state_reaches_silent_servos_too() {
    for state in [DAMPING, FORCELESS] {
        let mut rig = Rig::started();
        silence_elbow(&mut rig);
        rig.write(29, &[state]);
        rig.run_ms(100);
        assert_eq!(rig.torques().last(), Some([Some(state); 7]));
    }
}

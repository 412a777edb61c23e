//! Answers of the servos that are late, as behind a USB adapter; positions that jump; a controller that is called late.

use crate::rig::{Rig, STANDARD_POSE};
use arm_sim::plant::Wall;
use arm_sim::servo::ServoFault;
use motion_core::Vacuum;
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

/// Longer than the timeout of a servo.
const LATE: Duration = Duration::from_millis(8);

/// An arm whose servos answer late, a second after its start.
fn late_arm(answer_delay: Duration) -> Rig {
    let mut rig = Rig::new();
    Joint::ALL.into_iter().for_each(|joint| rig.plant.set_fault(joint, Some(ServoFault::Late(LATE))));
    rig.controller.set_answer_delay(answer_delay);
    rig.run_ms(1_000);
    rig
}

#[test]
fn late_answers_count_only_with_an_answer_delay() {
    let mut without = late_arm(Duration::ZERO);
    assert_eq!((without.get(242), without.present()), (0x7F, vec![0; 7]));
    let mut with = late_arm(Duration::from_millis(20));
    assert_eq!(with.get(242), 0);
    with.assert_at(STANDARD_POSE, "all are measured");
}

#[test]
fn the_longest_answer_time_of_each_servo_is_reported_once() {
    let mut rig = late_arm(Duration::from_millis(20));
    let longest = rig.controller.take_longest_answers();
    assert!(longest.iter().all(|micros| (8_000..9_000).contains(micros)), "{longest:?}");
    assert_eq!(rig.controller.take_longest_answers(), [0; 7]);
}

#[test]
fn engaged_joints_stay_engaged_after_a_late_call() {
    let mut rig = Rig::started();
    rig.now_us += 300_000;
    rig.run_ms(30);
    let all = rig.goals().filter(|(_, goals)| goals.len() == 7).count();
    assert!(all > 0, "{:?}", rig.to_servos);
    assert!(
        rig.torques().all(|torques| torques.iter().flatten().all(|code| *code == 1)),
        "{:?}",
        rig.to_servos
    );
}

#[test]
fn d29_after_a_late_call_a_servo_that_restarted_meanwhile_gets_no_old_goal() {
    let joint = Joint::ALL[0];
    // At some of these times the controller has not processed an answer from before the restart.
    for micros in (0..10_000).step_by(250) {
        let moved = moved_after_a_restart(joint, micros);
        assert!(moved < 1_000, "after {micros} us it moved by {moved} without an order");
    }
}

/// How far a joint moves after a late call if its servo restarted since the previous call, in thousandths of a degree. The
/// restart is 100 ms and `micros` microseconds after the start of a move.
fn moved_after_a_restart(joint: Joint, micros: u64) -> i32 {
    let mut rig = Rig::started();
    rig.plant.set_goal_starts_torque(true);
    rig.write(32, &[0]);
    rig.write(46, &[150]);
    rig.run_ms(100);
    rig.run_us(micros);
    rig.plant.restart_servo(Instant::from_micros(rig.now_us), joint);
    rig.now_us += 1_000_000;
    rig.run_ms(1);
    let before = rig.plant.angle(joint);
    rig.run_ms(2_000);
    assert_eq!(rig.get(196), 0, "it is driven again");
    (rig.plant.angle(joint) - before).abs()
}

#[test]
fn d27_the_time_of_a_late_call_does_not_make_a_joint_blocked() {
    let mut rig = Rig::started();
    rig.plant.set_wall(Joint::ALL[0], Some(Wall { millidegrees: 100_000, stiffness: None }));
    rig.write(46, &[130]);
    rig.run_ms(800);
    rig.now_us += 1_000_000;
    rig.run_ms(50);
    assert_eq!(
        (rig.get(195), rig.targets()[0]),
        (0, 130),
        "held back for less than a second of control cycles"
    );
    rig.run_ms(800);
    assert_eq!(rig.get(195), 1);
}

#[test]
fn a_servo_whose_positions_jump_counts_as_missing() {
    let mut rig = Rig::started();
    rig.write(29, &[2]);
    for counts in [200, 800].into_iter().cycle().take(40) {
        rig.hand(1, counts);
        rig.run_ms(10);
    }
    assert_eq!(rig.get(242), 1);
}

#[test]
fn d20_the_valve_closes_before_a_wait_also_when_the_watchdog_acts() {
    for action in [0, 1] {
        let mut rig = Rig::started();
        rig.write(31, &[1]);
        rig.write(187, &[action]);
        rig.write(186, &[20]);
        rig.write(31, &[0]);
        rig.now_us += 1_000_000;
        // Run until the controller waits.
        rig.run_us(0);
        assert_eq!(
            rig.vacuum.last(),
            Some(&(rig.now_us, Vacuum { pump: false, valve: false })),
            "action {action}"
        );
        assert_eq!(rig.get(241), 0b100_0000, "the watchdog acted");
    }
}

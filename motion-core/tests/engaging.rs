//! From no torque to torque: what the servos are told in between, at any moment and by a shell of any kind.

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)] // In tests.

mod rig;

use arm_sim::servo::ServoFault;
use protocol_core::registers::Joint;
use protocol_core::time::Duration;
use rig::{Rig, STANDARD_COUNTS, ToServos, write};

#[test]
fn d12_a_goal_stays_where_the_joint_is_until_it_has_torque() {
    // Servos that answer late, or not every time, put off the questions to the others, so that a control
    // cycle may come between a measurement and the torque.
    for phase in 0..100 {
        let mut rig = Rig::started();
        rig.write(32, &[0; 7]);
        rig.write(29, &[2]);
        rig.run_ms(20);
        // Without torque a loaded joint falls: hands put each where it was, and hold it there.
        for (joint, counts) in (1..).zip(STANDARD_COUNTS) {
            rig.hand(joint, counts);
        }
        let late = ServoFault::Late(Duration::from_micros(phase * 25));
        for (fault, joint) in
            [late, ServoFault::Garbled(2), ServoFault::Garbled(2)].into_iter().zip(Joint::ALL)
        {
            rig.plant.set_fault(joint, Some(fault));
        }
        rig.run_us(50_000 + phase * 100);
        rig.forget();
        rig.send(&[write(29, &[1]), write(46, &[10; 7])].concat());
        rig.run_ms(200);
        assert_eq!(goals_at_torque(&rig), STANDARD_COUNTS.map(Some), "phase {phase}");
    }
}

/// The same bytes may bring an answer and the write: then the answer counts first.
#[test]
fn d13_an_answer_that_has_come_is_where_the_servo_state_is_entered() {
    let mut rig = Rig::started();
    rig.write(29, &[0]);
    rig.run_ms(20);
    rig.hand(1, STANDARD_COUNTS[0] + 12);
    rig.forget();
    while rig.to_servos.last().is_none_or(|(_, told)| *told != ToServos::Ask(0)) {
        rig.run_us(10);
    }
    let answered_at = rig.plant.deadline().expect("an answer").as_micros();
    rig.run_us(answered_at - 1 - rig.now_us);
    // The answer and the write in one turn of the shell.
    rig.now_us = answered_at;
    rig.write(29, &[1]);
    assert_eq!((rig.targets()[0], rig.present()[0]), (93, 93), "12 counts are 3.5 degrees");
}

/// Each joint's goal at the moment when it was first given torque.
fn goals_at_torque(rig: &Rig) -> [Option<u16>; 7] {
    let (mut goals, mut at_torque) = ([0; 7], [None; 7]);
    for (_, told) in &rig.to_servos {
        match told {
            ToServos::Goals(items) => items.iter().for_each(|&(id, to)| goals[usize::from(id)] = to),
            ToServos::Torque(codes) => {
                for id in (0..7).filter(|&id| codes[id] == Some(1)) {
                    at_torque[id].get_or_insert(goals[id]);
                }
            }
            ToServos::Ask(_) => {}
        }
    }
    at_torque
}

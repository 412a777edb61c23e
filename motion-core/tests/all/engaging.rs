//! What is sent to a servo until it has torque: at power-up, on entry to state 1, and after it restarted; with late answers
//! and lost goals (D12, D13).

use crate::rig::{Rig, STANDARD_COUNTS, ToServos, write};
use arm_sim::servo::ServoFault;
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

const ELBOW: Joint = Joint::ALL[2];

#[test]
fn d12_a_goal_stays_where_the_joint_is_until_it_has_torque() {
    // Servos that answer late, or not every time, delay the questions to the others, so that a control
    // cycle may come between a measurement and the torque.
    for phase in 0..100 {
        let mut rig = Rig::started();
        rig.write(32, &[0; 7]);
        rig.write(29, &[2]);
        rig.run_ms(20);
        // Without torque a loaded joint falls, so a hand puts each joint back where it was, and holds it there.
        for (joint, counts) in (1..).zip(STANDARD_COUNTS) {
            rig.hand(joint, counts);
        }
        // The answer with the goal takes 0.55 ms, and has to end within 3 ms: with a later answer, the torque switch
        // would never be read.
        let late = ServoFault::Late(Duration::from_micros(phase * 24));
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

/// An answer of a servo and a write of the host may come in the same turn of the shell's loop. The answer is then processed
/// first.
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
    // The answer and the write come in this turn.
    rig.now_us = answered_at;
    rig.write(29, &[1]);
    assert_eq!((rig.targets()[0], rig.present()[0]), (93, 93), "12 counts are 2.5 degrees");
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

/// Checks that each servo was given torque only when its goal had reached it.
fn assert_goals_came_first(rig: &Rig, why: &str) {
    assert!(rig.given_torque.iter().any(|&(id, ..)| id == ELBOW.index()), "{why}: the elbow got torque");
    for &(id, goal, position) in &rig.given_torque {
        assert!(
            goal.is_some_and(|goal| goal.abs_diff(position) <= 2),
            "{why}: servo {id} {goal:?} {position}"
        );
    }
    let torque = Joint::ALL.map(|joint| rig.plant.has_torque(joint));
    assert_eq!(torque, [true; 7], "{why}");
}

/// Loses goals of the elbow at power-up.
fn power_up(lost: usize, hides_goals: bool) -> Rig {
    let mut rig = Rig::new();
    (rig.lost_goals, rig.hides_goals) = ((ELBOW.index(), lost), hides_goals);
    rig.run_ms(400);
    rig
}

/// Loses goals of the elbow when a hand has moved it and the host enters the servo state.
fn servo_state(lost: usize, hides_goals: bool) -> Rig {
    let mut rig = Rig::started();
    rig.write(29, &[0]);
    rig.run_ms(50);
    rig.hand(3, STANDARD_COUNTS[2] - 100);
    rig.run_ms(50);
    (rig.lost_goals, rig.hides_goals) = ((ELBOW.index(), lost), hides_goals);
    rig.given_torque.clear();
    rig.write(29, &[1]);
    rig.run_ms(200);
    rig
}

/// Loses goals of the elbow when its servo restarts and sinks meanwhile.
fn restart(lost: usize, hides_goals: bool) -> Rig {
    let mut rig = Rig::started();
    (rig.lost_goals, rig.hides_goals) = ((ELBOW.index(), 0), hides_goals);
    rig.given_torque.clear();
    rig.plant.restart_servo(Instant::from_micros(rig.now_us), ELBOW);
    rig.run_ms(100);
    rig.lost_goals = (ELBOW.index(), lost);
    rig.run_ms(1_500);
    rig
}

/// Loses up to five goals in a row, also with servos that do not show their goal.
fn assert_goals_arrive(engage: impl Fn(usize, bool) -> Rig) {
    for lost in 0..=5 {
        for hides_goals in [false, true] {
            let rig = engage(lost, hides_goals);
            assert_goals_came_first(&rig, &format!("{lost} frames lost, hidden: {hides_goals}"));
        }
    }
}

#[test]
fn d12_a_goal_that_was_lost_at_power_up_is_sent_again_before_torque() {
    assert_goals_arrive(power_up);
}

#[test]
fn d12_a_goal_that_was_lost_in_entering_the_servo_state_is_sent_again_before_torque() {
    assert_goals_arrive(servo_state);
}

#[test]
fn d12_a_goal_that_was_lost_after_a_restart_of_the_servo_is_sent_again_before_torque() {
    assert_goals_arrive(restart);
}

#[test]
fn d12_a_joint_that_engages_costs_one_question() {
    let rig = power_up(0, false);
    let is_order = |(_, told): &&(u64, ToServos)| !matches!(told, ToServos::Ask(_));
    let first = rig.to_servos.iter().position(|sent| is_order(&sent)).expect("an order");
    let told: Vec<_> = rig.to_servos[first..].iter().map(|(_, told)| told.clone()).collect();
    let engaged = |goals: &ToServos| match goals {
        ToServos::Goals(goals) => goals.iter().map(|&(id, _)| id).collect(),
        _ => Vec::new(),
    };
    assert_eq!(engaged(&told[0]).len(), 1, "one joint engages at a time: {told:?}");
    let id = engaged(&told[0])[0];
    let torque = std::array::from_fn(|joint| (joint == usize::from(id)).then_some(1));
    assert_eq!(told[1..3], [ToServos::Ask(id), ToServos::Torque(torque)]);
    assert_eq!(told[3], ToServos::Ask((id + 1) % 7), "and the next servo is read");
}

#[test]
fn d12_a_servo_that_hides_its_goal_gets_torque_after_three_cycles() {
    for (hides_goals, most_ms) in [(false, 20), (true, 60)] {
        let rig = power_up(0, hides_goals);
        let order =
            rig.to_servos.iter().find(|(_, told)| !matches!(told, ToServos::Ask(_))).expect("an order").0;
        let last = |id: usize| {
            let first = rig
                .to_servos
                .iter()
                .find(|(_, told)| matches!(told, ToServos::Torque(codes) if codes[id].is_some()));
            first.expect("torque").0
        };
        let taken = (0..7).map(|id| last(id) - order).max().expect("seven joints");
        println!("hidden {hides_goals}: {taken} us from the first goal to the last torque");
        assert!(taken <= most_ms * 1_000, "{taken} us, hidden: {hides_goals}");
    }
}

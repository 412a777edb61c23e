//! The servos lose their supply, or their bus (D29).

use crate::rig::{Rig, ToServos};
use arm_sim::servo::Trip;
use motion_core::servo_bus::Torque;
use protocol_core::registers::Joint;
use protocol_core::time::Instant;

use super::{LET_GO, SUPPLY_LOST, joint, stream};

#[test]
fn d29_an_emergency_stop_is_not_an_order_to_move() {
    for (millis, is_lost) in [(300, false), (3_000, true), (30_000, true)] {
        let mut rig = Rig::started();
        rig.write(184, &[20, 0]);
        stream(&mut rig, 1, (0..50).map(|step| 9_000 + step * 20));
        rig.plant.power_off(Instant::from_micros(rig.now_us));
        stream(&mut rig, 1, (0..millis / 20).map(|step| 10_000 + (step % 100) * 30));
        let angles = |rig: &Rig| Joint::ALL.map(|joint| rig.plant.angle(joint));
        let before = angles(&rig);
        rig.plant.power_cycle(Instant::from_micros(rig.now_us));
        // From now on no hand holds the arm. The servos start after 200 ms.
        Joint::ALL.into_iter().for_each(|joint| rig.plant.let_go(joint));
        rig.forget();
        let mut largest = 0;
        for step in 0..100 {
            stream(&mut rig, 1, std::iter::once(11_000 + step * 10));
            largest = largest.max((rig.plant.angle(joint(1)) - before[0]).abs());
        }
        assert_eq!(
            (rig.get(SUPPLY_LOST), rig.get(29)),
            (u8::from(is_lost), u8::from(!is_lost)),
            "{millis} ms"
        );
        if is_lost {
            assert!(largest < 1_000, "joint 1 moved by {largest} after {millis} ms");
            assert_eq!(rig.goals().count(), 0, "no goal");
            rig.write(29, &[1]);
            rig.run_ms(200);
            assert_eq!((rig.get(SUPPLY_LOST), rig.get(29)), (0, 1));
            assert!(rig.plant.has_torque(joint(1)));
        } else {
            assert!(
                rig.plant.has_torque(joint(1)) && rig.plant.has_torque(joint(3)),
                "engaged where measured"
            );
        }
    }
}

#[test]
fn d29_a_servo_that_restarted_engages_where_it_is_also_near_its_set_point() {
    let mut rig = Rig::started();
    rig.forget();
    rig.plant.restart_servo(Instant::from_micros(rig.now_us), joint(2));
    let restarted_at = rig.now_us;
    rig.run_ms(1_000);
    assert_eq!((rig.get(LET_GO), rig.plant.torque(joint(2))), (0, Some(Torque::On)));
    // Soon after the restart, only questions are sent to the servo until its first answer. The first frame after that is a goal.
    let to_servo = |told: &ToServos| match told {
        ToServos::Goals(goals) => goals.iter().any(|&(id, _)| id == 1),
        ToServos::Torque(codes) => codes[1].is_some(),
        ToServos::Ask(_) => false,
    };
    let first = rig.to_servos.iter().find(|(at, told)| *at > restarted_at + 20_000 && to_servo(told));
    assert!(matches!(first, Some((at, ToServos::Goals(_))) if at - restarted_at > 200_000), "{first:?}");
}

#[test]
fn d29_an_adapter_that_was_gone_is_no_lost_supply() {
    let mut rig = Rig::started();
    for joint in Joint::ALL {
        rig.plant.set_fault(joint, Some(arm_sim::servo::ServoFault::Garbled(1)));
    }
    rig.run_ms(3_000);
    assert_eq!(rig.get(242), 0x7F);
    Joint::ALL.into_iter().for_each(|joint| rig.plant.set_fault(joint, None));
    rig.run_ms(1_000);
    assert_eq!((rig.get(242), rig.get(29), rig.get(SUPPLY_LOST), rig.get(LET_GO)), (0, 1, 0, 0));
    rig.write(46, &[100]);
    rig.run_ms(1_000);
    assert_eq!(rig.present()[0], 100);
}

#[test]
fn d29_an_emergency_stop_is_noticed_also_if_a_servo_was_hot_before_it() {
    // The joint is turned meanwhile, so the alarm in its first answer tells that its servo does not hold it. With some of these
    // times, this servo answers last.
    for (number, millis) in
        (3_000..3_100).step_by(3).flat_map(|millis| (1..=7).map(move |number| (number, millis)))
    {
        let mut rig = Rig::started();
        rig.plant.trip(joint(number), Trip::Heat);
        rig.run_ms(30);
        rig.plant.power_off(Instant::from_micros(rig.now_us));
        rig.run_ms(millis);
        rig.plant.move_by_hand(joint(number), rig.plant.position_counts(joint(number)) - 60);
        rig.plant.power_cycle(Instant::from_micros(rig.now_us));
        rig.run_ms(2_000);
        assert_eq!((rig.get(SUPPLY_LOST), rig.get(29)), (1, 0), "joint {number}, after {millis} ms");
    }
}

//! The weight of the arm: which joints fall, sink, droop or stay, and the effect of restarts.

use crate::rig::{Rig, near};
use arm_sim::flash::Flash;
use arm_sim::plant::Plant;
use arm_sim::servo::{ServoConfig, ServoFault};
use arm_sim::simulated_arm::{ArmConfig, SimulatedArm};
use motion_core::TorqueCodes;
use motion_core::servo_bus::Torque;
use protocol_core::registers::map::{FAULTS, MISSING_SERVOS, fault};
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::time::{Duration, Instant};

const BASE: Joint = Joint::ALL[0];
const REAR_ARM: Joint = Joint::ALL[1];
const FOREARM: Joint = Joint::ALL[2];
const PITCH: Joint = Joint::ALL[4];
/// The position of the forearm's servo in the standard pose, where the forearm is level.
const LEVEL: u16 = 684;
/// A degree, in thousandths.
const DEGREE: i32 = 1_000;

fn is_within(value: i32, low: i32, high: i32) -> bool {
    (low * DEGREE..=high * DEGREE).contains(&value)
}

#[test]
fn a_free_joint_falls_only_if_it_is_loaded() {
    let mut rig = Rig::driven();
    rig.all_torque(Torque::Free);
    let [base, rear, forearm, roll, pitch, wrist, claw] = rig.turn_in(300);
    assert_eq!([base, rear, roll, wrist, claw], [0; 5], "no load, or less than the friction");
    assert!(is_within(forearm, 15, 30), "{forearm}: the level forearm falls towards greater angles");
    assert!(is_within(pitch, 5, 30), "{pitch}: the tool falls");
}

#[test]
fn the_fall_of_a_level_forearm_is_bounded_by_103_degrees_per_second() {
    let mut rig = Rig::driven();
    rig.all_torque(Torque::Free);
    let mut fastest = 0;
    for _ in 0..2_000 {
        let [_, _, forearm, ..] = rig.turn_in(1);
        fastest = fastest.max(forearm);
    }
    assert!((60..=103).contains(&fastest), "{fastest} thousandths of a degree in a millisecond");
}

#[test]
fn a_damped_joint_sinks_at_4_degrees_per_second() {
    let mut rig = Rig::driven();
    rig.all_torque(Torque::Damping);
    let [base, rear, forearm, ..] = rig.turn_in(1_000);
    assert_eq!([base, rear], [0; 2]);
    assert!((3_900..=4_200).contains(&forearm), "{forearm} thousandths of a degree");
}

#[test]
fn a_rear_arm_falls_to_the_side_it_leans_to() {
    for (counts, falls_to) in [(600_u16, -1), (300, 1)] {
        let mut rig = Rig::driven();
        rig.all_goals([511, counts, LEVEL, 511, 512, 512, 1_008]);
        rig.pass(1_000);
        rig.all_torque(Torque::Free);
        let [_, rear, ..] = rig.turn_in(300);
        assert!(is_within(rear * falls_to, 1, 30), "from {counts} counts: {rear}");
    }
}

#[test]
fn a_fall_ends_by_friction_or_at_the_end_of_the_servo() {
    let mut rig = Rig::driven();
    rig.all_goals([511, 600, LEVEL, 511, 512, 512, 1_008]);
    rig.pass(1_000);
    rig.all_torque(Torque::Free);
    rig.pass(10_000);
    assert_eq!(rig.turn_in(10_000), [0; JOINTS], "all joints are at rest");
    assert_eq!(rig.counts(REAR_ARM), 1_023, "the rear arm is at the end of its servo");
    let hangs = rig.plant.angle(FOREARM);
    assert!(is_within(hangs, 130, 170), "{hangs}: the forearm hangs down");
}

#[test]
fn a_driven_joint_droops_by_its_load_and_measures_it() {
    let mut rig = Rig::driven();
    let [base, rear, forearm, _, pitch, ..] = rig.pose();
    assert_eq!([base, rear], [90 * DEGREE; 2], "no load, no droop");
    // An error of 4.3 degrees gives the stall torque, 2450 mN m. So the weight, 459 mN m, needs 0.81 degrees. Static friction can
    // hold 123 mN m of the weight.
    let droop = forearm - 65_012; // 684 counts
    assert!((590..=810).contains(&droop), "{droop}");
    let droop = pitch - 89_856; // 512 counts
    assert!((220..=360).contains(&droop), "{droop}: 49 of 588 mN m");
    let load = rig.reading(FOREARM).unwrap().0.load;
    assert!((137..=188).contains(&load), "{load}: towards more counts, which is up");
    assert_eq!(rig.reading(BASE).unwrap().0.load, 0);
    rig.all_goals([511, 850, LEVEL, 511, 512, 512, 1_008]);
    rig.pass(2_000);
    let droop = 4_235 - rig.plant.angle(REAR_ARM); // 850 counts
    assert!((530..=960).contains(&droop), "{droop}: the rear arm is level, 424 of 2450 mN m");
}

#[test]
fn a_hand_holds_a_joint_until_it_has_torque() {
    let mut rig = Rig::driven();
    rig.all_torque(Torque::Free);
    rig.pass(500);
    rig.plant.move_by_hand(FOREARM, 600);
    rig.pass(5_000);
    assert_eq!(rig.counts(FOREARM), 600);
    rig.all_torque(Torque::Damping);
    rig.pass(5_000);
    assert_eq!(rig.counts(FOREARM), 600, "damping is no torque");
    rig.all_goals([511, 445, 600, 511, 512, 512, 1_008]);
    rig.all_torque(Torque::On);
    rig.pass(1_000);
    rig.all_torque(Torque::Free);
    assert!(is_within(rig.turn_in(300)[2], 5, 30), "no hand holds it");
    rig.plant.hold(FOREARM);
    assert_eq!(rig.turn_in(300)[2], 0);
    rig.plant.let_go(FOREARM);
    assert!(rig.turn_in(300)[2] > DEGREE);
}

#[test]
fn after_power_up_a_hand_holds_the_arm_until_it_lets_go() {
    let mut rig = Rig::ready();
    assert_eq!(rig.turn_in(5_000), [0; JOINTS]);
    rig.let_go();
    assert!(rig.turn_in(300)[2] > DEGREE);
    let mut rig = Rig::driven();
    rig.plant.power_cycle(rig.now);
    assert_eq!(rig.turn_in(5_000), [0; JOINTS]);
    rig.let_go();
    assert!(rig.turn_in(1_000)[2] > DEGREE);
}

#[test]
fn a_supported_arm_never_falls() {
    let mut rig = Rig::driven();
    rig.plant.support(true);
    for torque in [Torque::Free, Torque::Damping] {
        rig.all_torque(torque);
        assert_eq!(rig.turn_in(5_000), [0; JOINTS]);
    }
}

#[test]
fn a_servo_that_restarts_is_free_and_then_damped() {
    let mut rig = Rig::driven();
    rig.plant.restart_servo(rig.now, FOREARM);
    let boot = rig.turn_in(200)[2];
    assert!(is_within(boot, 6, 15), "{boot}: free during its start");
    let later = rig.turn_in(1_000)[2];
    assert!(is_within(later, 2, 5), "{later}: code 0 is damping in the older table");
    assert_eq!(rig.reading(FOREARM).unwrap().0.load, 0);
    assert_eq!(rig.turn_in(100)[0], 0, "the other joints are driven");
}

#[test]
fn a_servo_with_the_fault_restarting_restarts_periodically() {
    let mut rig = Rig::driven();
    rig.plant.set_fault(FOREARM, Some(ServoFault::Restarting(Duration::from_millis(500))));
    for _ in 0..3 {
        rig.all_goals([511, 445, LEVEL, 511, 512, 512, 1_008]);
        rig.all_torque(Torque::On);
        rig.pass(240);
        let held = rig.turn_in(100)[2];
        let fallen = rig.turn_in(350)[2];
        assert!(held.abs() < DEGREE / 2 && fallen > DEGREE, "{held}, {fallen}");
        rig.pass(308 - 2);
    }
}

#[test]
fn a_goal_switches_torque_on_after_a_restart_only_if_configured() {
    for goal_starts_torque in [false, true] {
        let mut rig = Rig::with(ServoConfig { goal_starts_torque, ..ServoConfig::default() });
        rig.pass(200);
        rig.all_goals([600; JOINTS]);
        rig.pass(2_000);
        assert_eq!(near(rig.counts(BASE), 600), goal_starts_torque);
        // After a write to the torque switch, a goal does not change it.
        rig.all_torque(Torque::Free);
        rig.all_goals([500; JOINTS]);
        let before = rig.counts(BASE);
        rig.pass(2_000);
        assert_eq!(rig.counts(BASE), before);
        rig.plant.restart_servo(rig.now, BASE);
        rig.pass(200);
        rig.all_goals([500; JOINTS]);
        rig.pass(2_000);
        assert_eq!(near(rig.counts(BASE), 500), goal_starts_torque);
    }
}

#[test]
fn an_overloaded_servo_turns_off_and_its_joint_falls() {
    let mut rig = Rig::driven();
    rig.plant.set_fault(FOREARM, Some(ServoFault::Stuck));
    rig.all_goals([511, 445, 300, 511, 512, 512, 1_008]);
    assert_eq!(rig.turn_in(2_000)[2], 0);
    rig.plant.set_fault(FOREARM, None);
    assert!(rig.turn_in(300)[2] > DEGREE);
}

#[test]
fn an_unplugged_servo_falls() {
    let mut rig = Rig::driven();
    rig.plant.set_fault(PITCH, Some(ServoFault::Missing));
    assert!(rig.turn_in(300)[4] > DEGREE);
}

#[test]
fn a_fall_does_not_depend_on_the_calls() {
    let fall = |pause: u64| {
        let mut rig = Rig::driven();
        rig.all_torque(Torque::Free);
        (0..600 / pause).for_each(|_| rig.pass(pause));
        rig.pose()
    };
    assert_eq!(fall(1), fall(600));
}

fn simulation() -> SimulatedArm<Flash> {
    let torque_codes = TorqueCodes::default();
    let setup = ArmConfig { chip_id: *b"SIM\0\0\x01", is_paced: false, torque_codes };
    let mut simulation =
        SimulatedArm::new(Instant::ZERO, setup, Flash::in_memory(), Plant::new(Instant::ZERO));
    simulation.advance(Instant::ZERO + Duration::from_millis(2_000), true);
    simulation
}

#[test]
fn servos_keep_torque_and_goal_while_the_controller_restarts() {
    let mut simulation = simulation();
    let start = Joint::ALL.map(|joint| simulation.plant().angle(joint));
    assert_ne!(start[2], 65_012, "the forearm droops: its servo holds it, not a hand");
    let now = Instant::ZERO + Duration::from_millis(2_000);
    simulation.restart_controller(now);
    assert_eq!(simulation.registers().get(FAULTS.address), fault::WATCHDOG_RESTART);
    // The controller has sent no goal and no torque yet.
    assert!(Joint::ALL.into_iter().all(|joint| simulation.plant().has_torque(joint)));
    assert_eq!(start, Joint::ALL.map(|joint| simulation.plant().angle(joint)));
    simulation.advance(now + Duration::from_millis(2_000), true);
    assert_eq!(simulation.registers().get(MISSING_SERVOS.address), 0);
    assert_eq!(simulation.registers().get(FAULTS.address), fault::WATCHDOG_RESTART);
    for (joint, before) in Joint::ALL.into_iter().zip(start) {
        let sag = simulation.plant().angle(joint) - before;
        // The controller keeps the goal that the servo holds (D12).
        assert_eq!(sag, 0, "joint {}", joint.number());
    }
    assert_eq!(simulation.plant().collisions(), 0);
}

#[test]
fn a_power_cycle_of_the_arm_switches_torque_off() {
    let mut simulation = simulation();
    simulation.power_cycle(Instant::ZERO + Duration::from_millis(2_000));
    assert!(!Joint::ALL.into_iter().any(|joint| simulation.plant().has_torque(joint)));
}

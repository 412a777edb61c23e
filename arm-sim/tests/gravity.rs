//! The arm has weight: what falls, what sinks, what stays, what droops, and what a restart of either side does.

#![allow(clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)] // A panic is a failed test.

use arm_sim::flash::Flash;
use arm_sim::plant::{Plant, Settings};
use arm_sim::servo::Fault;
use arm_sim::world::{Setup, World};
use motion_core::TorqueCodes;
use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::{Decoder, FrameBuffer, Reading, read, register, sync_write};
use protocol_core::registers::map::{FAULTS, MISSING_SERVOS, fault};
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::time::{Duration, Instant};

const BASE: Joint = Joint::ALL[0];
const REAR_ARM: Joint = Joint::ALL[1];
const FOREARM: Joint = Joint::ALL[2];
const PITCH: Joint = Joint::ALL[4];
/// The forearm's servo in the standard pose, where the forearm is level.
const LEVEL: u16 = 684;
/// A degree, in thousandths.
const DEGREE: i32 = 1_000;

/// A plant with a clock and a master that expects no answers.
struct Rig {
    plant: Plant,
    now: Instant,
}

impl Rig {
    /// In the standard pose, with the servos ready and a hand at every joint.
    fn with(settings: Settings) -> Self {
        let mut rig = Self { plant: Plant::with_settings(Instant::ZERO, settings), now: Instant::ZERO };
        rig.pass(200);
        rig
    }

    fn new() -> Self {
        Self::with(Settings::default())
    }

    /// Likewise, with torque, each joint at the goal that is its place.
    fn driven() -> Self {
        let mut rig = Self::new();
        rig.goals(Joint::ALL.map(|joint| rig.plant.position_counts(joint)));
        rig.torque(Torque::On);
        rig.pass(1_000);
        rig
    }

    fn pass(&mut self, millis: u64) {
        self.now = self.now + Duration::from_millis(millis);
        let _ = self.plant.poll(self.now);
    }

    fn send(&mut self, encode: impl FnOnce(&mut FrameBuffer)) {
        let mut frame = FrameBuffer::new();
        encode(&mut frame);
        self.plant.bytes(self.now, &frame);
        self.pass(1);
    }

    fn torque(&mut self, torque: Torque) {
        let code = TorqueCodes::default().code(torque);
        self.send(|b| sync_write(b, register::TORQUE_SWITCH, (0..7).map(|id| (id, [code]))));
    }

    fn goals(&mut self, counts: [u16; JOINTS]) {
        let goal = |(id, counts): (u8, u16)| {
            let [high, low] = counts.to_be_bytes();
            (id, [high, low, 0, 0, 0, 0])
        };
        self.send(|b| sync_write(b, register::GOAL_POSITION, (0..).zip(counts).map(goal)));
    }

    fn let_go(&mut self) {
        Joint::ALL.into_iter().for_each(|joint| self.plant.let_go(joint));
    }

    fn pose(&self) -> [i32; JOINTS] {
        Joint::ALL.map(|joint| self.plant.angle(joint))
    }

    /// How far each joint turns in so many milliseconds, in thousandths of a degree.
    fn turn_in(&mut self, millis: u64) -> [i32; JOINTS] {
        let before = self.pose();
        self.pass(millis);
        let after = self.pose();
        std::array::from_fn(|joint| after[joint] - before[joint])
    }

    fn reading(&mut self, joint: Joint) -> Reading {
        let mut frame = FrameBuffer::new();
        read(&mut frame, joint.index(), register::PRESENT_POSITION, Reading::REGISTERS);
        self.plant.bytes(self.now, &frame);
        self.now = self.now + Duration::from_millis(2);
        let mut decoder = Decoder::new();
        decoder.push(&self.plant.poll(self.now));
        let answer = decoder.pull().unwrap().unwrap();
        Reading::parse(answer.params).unwrap()
    }
}

fn is_within(value: i32, low: i32, high: i32) -> bool {
    (low * DEGREE..=high * DEGREE).contains(&value)
}

#[test]
fn a_free_joint_falls_where_it_is_loaded_and_stays_where_it_is_not() {
    let mut rig = Rig::driven();
    rig.torque(Torque::Free);
    let [base, rear, forearm, roll, pitch, wrist, claw] = rig.turn_in(300);
    assert_eq!([base, rear, roll, wrist, claw], [0; 5], "no load, or less than the friction");
    assert!(is_within(forearm, 15, 30), "{forearm}: the level forearm falls, towards greater angles");
    assert!(is_within(pitch, 5, 30), "{pitch}: and so does the tool");
}

#[test]
fn the_fall_of_a_level_forearm_is_bounded_by_103_degrees_per_second() {
    let mut rig = Rig::driven();
    rig.torque(Torque::Free);
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
    rig.torque(Torque::Damping);
    let [base, rear, forearm, ..] = rig.turn_in(1_000);
    assert_eq!([base, rear], [0; 2]);
    assert!((3_900..=4_200).contains(&forearm), "{forearm} thousandths of a degree");
}

#[test]
fn a_rear_arm_falls_to_the_side_it_leans_to() {
    for (counts, falls_to) in [(600_u16, -1), (300, 1)] {
        let mut rig = Rig::driven();
        rig.goals([511, counts, LEVEL, 511, 512, 512, 1_008]);
        rig.pass(1_000);
        rig.torque(Torque::Free);
        let [_, rear, ..] = rig.turn_in(300);
        assert!(is_within(rear * falls_to, 1, 30), "from {counts} counts: {rear}");
    }
}

#[test]
fn a_fall_ends_where_friction_holds_or_at_the_end_of_the_servo() {
    let mut rig = Rig::driven();
    rig.goals([511, 600, LEVEL, 511, 512, 512, 1_008]);
    rig.pass(1_000);
    rig.torque(Torque::Free);
    rig.pass(10_000);
    assert_eq!(rig.turn_in(10_000), [0; JOINTS], "all is at rest");
    assert_eq!(rig.plant.position_counts(REAR_ARM), 1_023, "the rear arm lies on the end of its servo");
    let hangs = rig.plant.angle(FOREARM);
    assert!(is_within(hangs, 130, 170), "{hangs}: the forearm hangs down");
}

#[test]
fn a_driven_joint_droops_by_less_than_a_tenth_of_a_degree_and_shows_the_load() {
    let mut rig = Rig::driven();
    let [base, rear, forearm, _, pitch, ..] = rig.pose();
    assert_eq!([base, rear], [90 * DEGREE; 2], "no load, no droop");
    let standard = 65_012; // 684 counts
    assert!((50..70).contains(&(forearm - standard)), "{forearm}");
    let goal = 89_856; // 512 counts
    assert!((50..70).contains(&(pitch - goal)), "{pitch}");
    assert_eq!(rig.reading(FOREARM).load, 284, "towards more counts, which are smaller angles: up");
    assert_eq!(rig.reading(BASE).load, 0);
    rig.goals([511, 850, LEVEL, 511, 512, 512, 1_008]);
    rig.pass(2_000);
    let goal = 4_235; // 850 counts
    let droop = goal - rig.plant.angle(REAR_ARM);
    assert!((45..70).contains(&droop), "{droop}: stretched out to the front");
}

#[test]
fn a_hand_holds_what_it_moved_until_there_is_torque() {
    let mut rig = Rig::driven();
    rig.torque(Torque::Free);
    rig.pass(500);
    rig.plant.move_by_hand(FOREARM, 600);
    rig.pass(5_000);
    assert_eq!(rig.plant.position_counts(FOREARM), 600);
    rig.torque(Torque::Damping);
    rig.pass(5_000);
    assert_eq!(rig.plant.position_counts(FOREARM), 600, "damping is no torque");
    rig.goals([511, 445, 600, 511, 512, 512, 1_008]);
    rig.torque(Torque::On);
    rig.pass(1_000);
    rig.torque(Torque::Free);
    assert!(is_within(rig.turn_in(300)[2], 5, 30), "the hand was gone");
    rig.plant.hold(FOREARM);
    assert_eq!(rig.turn_in(300)[2], 0);
    rig.plant.let_go(FOREARM);
    assert!(rig.turn_in(300)[2] > DEGREE);
}

#[test]
fn after_power_up_a_hand_holds_the_arm_and_may_let_go() {
    let mut rig = Rig::new();
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
        rig.torque(torque);
        assert_eq!(rig.turn_in(5_000), [0; JOINTS]);
    }
}

#[test]
fn a_servo_that_restarts_lets_its_joint_fall_and_then_brakes_it() {
    let mut rig = Rig::driven();
    rig.plant.restart_servo(rig.now, FOREARM);
    let boot = rig.turn_in(200)[2];
    assert!(is_within(boot, 6, 15), "{boot}: free while it starts");
    let later = rig.turn_in(1_000)[2];
    assert!(is_within(later, 2, 5), "{later}: code 0 is damping in the older table");
    assert_eq!(rig.reading(FOREARM).load, 0);
    assert_eq!(rig.turn_in(100)[0], 0, "the others are driven");
}

#[test]
fn a_servo_may_restart_again_and_again_by_itself() {
    let mut rig = Rig::driven();
    rig.plant.set_fault(FOREARM, Some(Fault::Restarting(Duration::from_millis(500))));
    for _ in 0..3 {
        rig.goals([511, 445, LEVEL, 511, 512, 512, 1_008]);
        rig.torque(Torque::On);
        rig.pass(240);
        let held = rig.turn_in(100)[2];
        let fallen = rig.turn_in(350)[2];
        assert!(held.abs() < DEGREE / 2 && fallen > DEGREE, "{held}, {fallen}");
        rig.pass(308 - 2);
    }
}

#[test]
fn a_goal_switches_torque_on_after_a_restart_only_where_servos_do_so() {
    for goal_starts_torque in [false, true] {
        let mut rig = Rig::with(Settings { goal_starts_torque, ..Settings::default() });
        rig.goals([600; JOINTS]);
        rig.pass(2_000);
        assert_eq!(rig.plant.position_counts(BASE) == 600, goal_starts_torque);
        // Once its switch was written, a goal is only a goal.
        rig.torque(Torque::Free);
        rig.goals([500; JOINTS]);
        let before = rig.plant.position_counts(BASE);
        rig.pass(2_000);
        assert_eq!(rig.plant.position_counts(BASE), before);
        rig.plant.restart_servo(rig.now, BASE);
        rig.pass(200);
        rig.goals([500; JOINTS]);
        rig.pass(2_000);
        assert_eq!(rig.plant.position_counts(BASE) == 500, goal_starts_torque);
    }
}

#[test]
fn an_overloaded_servo_gives_up_and_its_joint_falls() {
    let mut rig = Rig::driven();
    rig.plant.set_fault(FOREARM, Some(Fault::Stuck));
    rig.goals([511, 445, 300, 511, 512, 512, 1_008]);
    assert_eq!(rig.turn_in(2_000)[2], 0);
    rig.plant.set_fault(FOREARM, None);
    assert!(rig.turn_in(300)[2] > DEGREE);
}

#[test]
fn an_unplugged_servo_falls() {
    let mut rig = Rig::driven();
    rig.plant.set_fault(PITCH, Some(Fault::Missing));
    assert!(rig.turn_in(300)[4] > DEGREE);
}

#[test]
fn it_falls_the_same_however_often_anybody_looks() {
    let fall = |pause: u64| {
        let mut rig = Rig::driven();
        rig.torque(Torque::Free);
        (0..600 / pause).for_each(|_| rig.pass(pause));
        rig.pose()
    };
    assert_eq!(fall(1), fall(600));
}

fn world() -> World<Flash> {
    let torque_codes = TorqueCodes::default();
    let setup = Setup { chip_id: *b"SIM\0\0\x01", is_paced: false, torque_codes };
    let mut world = World::new(Instant::ZERO, setup, Flash::in_memory(), Plant::new(Instant::ZERO));
    world.advance(Instant::ZERO + Duration::from_millis(2_000), true);
    world
}

#[test]
fn servos_keep_torque_and_goal_while_the_controller_restarts() {
    let mut world = world();
    let start = Joint::ALL.map(|joint| world.plant().angle(joint));
    assert_ne!(start[2], 65_012, "the forearm droops: it is held by its servo, and by no hand");
    let now = Instant::ZERO + Duration::from_millis(2_000);
    world.restart_controller(now);
    assert_eq!(world.registers().get(FAULTS.address), fault::WATCHDOG_RESTART);
    // Nobody has told the servos anything yet.
    assert!(Joint::ALL.into_iter().all(|joint| world.plant().has_torque(joint)));
    assert_eq!(start, Joint::ALL.map(|joint| world.plant().angle(joint)));
    world.advance(now + Duration::from_millis(2_000), true);
    assert_eq!(world.registers().get(MISSING_SERVOS.address), 0);
    assert_eq!(world.registers().get(FAULTS.address), fault::WATCHDOG_RESTART);
    for (joint, before) in Joint::ALL.into_iter().zip(start) {
        let sag = world.plant().angle(joint) - before;
        assert_eq!(sag, 0, "joint {}", joint.number());
    }
    assert_eq!(world.plant().collisions(), 0);
}

#[test]
fn a_power_cycle_of_the_arm_takes_torque_and_goals() {
    let mut world = world();
    world.power_cycle(Instant::ZERO + Duration::from_millis(2_000));
    assert!(!Joint::ALL.into_iter().any(|joint| world.plant().has_torque(joint)));
}

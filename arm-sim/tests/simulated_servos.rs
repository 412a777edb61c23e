//! The simulated servos as their master meets them: bytes on a wire and a time that is handed in.

use arm_sim::plant::{Plant, Settings};
use arm_sim::servo::Fault;
use motion_core::servo_bus::frame::{
    Decoder, FrameBuffer, Reading, error, ping, read, register, sync_write, write,
};
use motion_core::servo_bus::{Torque, TorqueCodes};
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

/// What a master waits between the last byte it heard and its next frame.
const GUARD_TIME: Duration = Duration::from_micros(100);

/// A master with a plant and a time of its own.
struct Bench {
    plant: Plant,
    now: Instant,
}

impl Bench {
    fn with(settings: Settings) -> Self {
        Self { plant: Plant::with_settings(Instant::ZERO, settings), now: Instant::ZERO }
    }

    /// An arm whose servos have started up.
    fn ready() -> Self {
        let mut bench = Self::with(Settings::default());
        bench.pass(200);
        bench
    }

    fn pass(&mut self, millis: u64) {
        self.now = self.now + Duration::from_millis(millis);
        assert_eq!(self.plant.poll(self.now), [], "nobody speaks unasked");
    }

    fn send(&mut self, encode: impl FnOnce(&mut FrameBuffer)) {
        let mut buffer = FrameBuffer::new();
        encode(&mut buffer);
        self.plant.bytes(self.now, &buffer);
    }

    /// What comes back on the wire, and how many microseconds after the question began. The next frame keeps the
    /// guard time.
    fn ask(&mut self, encode: impl FnOnce(&mut FrameBuffer)) -> (Vec<u8>, u64) {
        let asked_at = self.now;
        self.send(encode);
        let mut bytes = Vec::new();
        while let Some(due) = self.plant.deadline() {
            self.now = due;
            bytes.extend(self.plant.poll(due));
        }
        let took = (self.now - asked_at).as_micros();
        self.now = self.now + GUARD_TIME;
        (bytes, took)
    }

    /// A joint's answer to a read of eight bytes, with its error bits.
    fn reading(&mut self, joint: Joint) -> Option<(Reading, u8)> {
        let ask_for = |b: &mut FrameBuffer| read(b, joint.index(), register::PRESENT_POSITION, 8);
        let (bytes, _) = self.ask(ask_for);
        let mut decoder = Decoder::new();
        decoder.push(&bytes);
        let answer = decoder.pull()?.ok()?;
        assert_eq!(answer.id, joint.index());
        Some((Reading::parse(answer.params)?, answer.code))
    }

    fn torque(&mut self, joint: Joint, code: u8) {
        let (ack, _) = self.ask(|b| write(b, joint.index(), register::TORQUE_SWITCH, &[code]));
        assert_eq!(ack.len(), 6);
    }

    fn goal(&mut self, joint: Joint, position: u16, time_ms: u16, speed: u16) {
        let data: Vec<u8> = [position, time_ms, speed].into_iter().flat_map(u16::to_be_bytes).collect();
        self.ask(|b| write(b, joint.index(), register::GOAL_POSITION, &data));
    }

    fn counts(&self, joint: Joint) -> u16 {
        self.plant.position_counts(joint)
    }
}

const BASE: Joint = Joint::ALL[0];
const CLAW: Joint = Joint::ALL[6];
/// Where joint 1 stands in the standard pose.
const BASE_START: u16 = 511;

#[test]
fn the_arm_starts_in_the_standard_pose() {
    let bench = Bench::ready();
    // 90 90 65 90 90 90 80 degrees by the table of calibration.
    assert_eq!(Joint::ALL.map(|joint| bench.counts(joint)), [511, 445, 684, 511, 512, 512, 1_008]);
}

#[test]
fn answers_come_byte_for_byte_and_at_the_speed_of_the_wire() {
    let mut bench = Bench::ready();
    let (bytes, micros) = bench.ask(|b| ping(b, 0));
    assert_eq!(bytes, [0xFF, 0xFF, 0, 2, 0, 0xFD]);
    assert_eq!(micros, 60 + 250 + 60, "six bytes, the return delay, six bytes");
    let (bytes, micros) = bench.ask(|b| read(b, 6, register::PRESENT_POSITION, 8));
    // Position 1008, no speed, no load, 7.4 V, 25 degrees.
    assert_eq!(bytes, [0xFF, 0xFF, 6, 10, 0, 0x03, 0xF0, 0, 0, 0, 0, 74, 25, 0x99]);
    assert_eq!(micros, 80 + 250 + 140);
}

#[test]
fn half_an_answer_comes_half_way_and_a_question_may_come_in_pieces() {
    let mut bench = Bench::ready();
    for piece in [[0xFF, 0xFF, 0], [2, 1, 0xFC]] {
        bench.plant.bytes(bench.now, &piece);
    }
    let half_way = bench.now + Duration::from_micros(60 + 250 + 30);
    assert_eq!(bench.plant.poll(half_way), [0xFF, 0xFF, 0]);
    assert_eq!(bench.plant.poll(half_way + Duration::from_micros(30)), [2, 0, 0xFD]);
}

#[test]
fn servos_are_deaf_until_they_have_started_up() {
    let mut bench = Bench::with(Settings::default());
    bench.pass(199);
    assert_eq!(bench.ask(|b| ping(b, 0)).0, []);
    bench.pass(1);
    assert_eq!(bench.ask(|b| ping(b, 0)).0.len(), 6);
    bench.torque(BASE, 1);
    bench.goal(BASE, 600, 0, 0);
    bench.pass(500);
    bench.plant.power_cycle(bench.now);
    assert!(bench.reading(BASE).is_none());
    bench.pass(200);
    assert_eq!(bench.reading(BASE).map(|(reading, _)| reading.position_counts), Some(600));
    bench.pass(1_000);
    assert_eq!(bench.counts(BASE), 600, "torque is off, the old goal forgotten");
}

#[test]
fn a_power_cycle_drops_answers_on_their_way_and_half_a_question() {
    let mut bench = Bench::ready();
    bench.send(|b| ping(b, 0));
    bench.plant.bytes(bench.now, &[0xFF, 0xFF, 0]);
    bench.plant.power_cycle(bench.now);
    assert_eq!(bench.plant.deadline(), None);
    bench.pass(200);
    bench.plant.bytes(bench.now, &[2, 1, 0xFC]);
    assert_eq!(bench.plant.deadline(), None);
}

#[test]
fn running_speed_and_running_time_are_kept() {
    for (time_ms, speed, takes_ms) in [(0, 100, 3_000), (2_000, 0, 2_000), (2_000, 100, 3_000), (0, 0, 171)] {
        let mut bench = Bench::ready();
        bench.torque(BASE, 1);
        bench.goal(BASE, BASE_START + 300, time_ms, speed);
        bench.pass(takes_ms - 2);
        let almost = bench.counts(BASE);
        assert!(almost < BASE_START + 300, "time {time_ms}, speed {speed}: too early");
        bench.pass(160);
        assert_eq!(bench.counts(BASE), BASE_START + 300, "time {time_ms}, speed {speed}: too late");
    }
}

#[test]
fn a_sync_write_starts_all_joints_at_the_same_instant() {
    let mut bench = Bench::ready();
    bench.send(|b| sync_write(b, register::TORQUE_SWITCH, (0..7).map(|id| (id, [1]))));
    let start = Joint::ALL.map(|joint| bench.counts(joint));
    let goal = |id: u8| {
        let [high, low] = (start[usize::from(id)] - 200).to_be_bytes();
        (id, [high, low, 0, 0, 1, 44])
    };
    bench.send(|b| sync_write(b, register::GOAL_POSITION, (0..7).map(goal)));
    for _ in 0..9 {
        bench.pass(100);
        let gone = [0, 1, 2, 3, 4, 5, 6].map(|i| start[i] - bench.counts(Joint::ALL[i]));
        assert!(gone.iter().all(|counts| counts.abs_diff(gone[0]) <= 1), "but for their droop: {gone:?}");
    }
    assert_eq!(start[0] - bench.counts(BASE), 200, "300 counts/s");
}

#[test]
fn only_a_servo_that_is_switched_on_is_driven() {
    for codes in [TorqueCodes::DampingOnFree, TorqueCodes::FreeOnDamping] {
        let mut bench = Bench::with(Settings { torque_codes: codes, ..Settings::default() });
        bench.pass(200);
        for torque in [Torque::Damping, Torque::Free] {
            bench.torque(BASE, codes.code(torque));
            bench.goal(BASE, 700, 0, 0);
            bench.pass(1_000);
            assert_eq!(bench.counts(BASE), BASE_START, "{torque:?}");
            bench.plant.move_by_hand(BASE, 300);
            bench.pass(1_000);
            assert_eq!(bench.counts(BASE), 300, "{torque:?}: it stays where the hand left it");
            bench.plant.move_by_hand(BASE, BASE_START);
        }
        bench.torque(BASE, codes.code(Torque::On));
        bench.pass(1_000);
        assert_eq!(bench.counts(BASE), 700, "switched on, a servo goes to the goal it was given before");
        bench.plant.move_by_hand(BASE, 650);
        bench.pass(1_000);
        assert_eq!(bench.counts(BASE), 700, "and goes back there");
    }
}

#[test]
fn without_a_goal_a_servo_with_torque_goes_to_0() {
    // The worst it can do: a controller that switches torque on before it has given a goal is seen at once.
    let mut bench = Bench::ready();
    bench.torque(BASE, 1);
    bench.pass(2_000);
    assert_eq!(bench.counts(BASE), 0);
}

#[test]
fn a_moving_arm_warms_up_and_takes_its_toll_of_the_supply() {
    let mut bench = Bench::ready();
    bench.send(|b| sync_write(b, register::TORQUE_SWITCH, (0..7).map(|id| (id, [1]))));
    for round in 0..60 {
        let target = if round % 2 == 0 { 900_u16 } else { 100 };
        let [high, low] = target.to_be_bytes();
        bench
            .send(|b| sync_write(b, register::GOAL_POSITION, (0..7).map(|id| (id, [high, low, 0, 0, 0, 0]))));
        bench.pass(100);
        let (reading, errors) = bench.reading(BASE).unwrap();
        bench.pass(400);
        assert!((60..74).contains(&reading.voltage_decivolts), "{} dV", reading.voltage_decivolts);
        assert_eq!(errors, 0);
    }
    let (warm, _) = bench.reading(BASE).unwrap();
    assert!((26..40).contains(&warm.temperature_celsius), "{} degrees", warm.temperature_celsius);
    (0..10).for_each(|_| bench.pass(100_000));
    let (rested, _) = bench.reading(BASE).unwrap();
    assert_eq!(
        (rested.voltage_decivolts, rested.load, rested.speed),
        (73, 0, 0),
        "other joints carry weight"
    );
    assert!(rested.temperature_celsius < warm.temperature_celsius);
}

#[test]
fn a_missing_servo_is_silent_and_comes_back_without_torque() {
    let mut bench = Bench::ready();
    bench.torque(BASE, 1);
    bench.goal(BASE, 600, 0, 0);
    bench.pass(1_000);
    bench.plant.set_fault(BASE, Some(Fault::Missing));
    assert!(bench.reading(BASE).is_none());
    assert!(bench.reading(CLAW).is_some(), "the others go on");
    bench.goal(BASE, 700, 0, 0);
    bench.plant.set_fault(BASE, None);
    assert!(bench.reading(BASE).is_none(), "it has to start up");
    bench.pass(200);
    assert_eq!(bench.reading(BASE).map(|(reading, _)| reading.position_counts), Some(600));
    bench.goal(BASE, 700, 0, 0);
    bench.pass(1_000);
    assert_eq!(bench.counts(BASE), 600);
}

#[test]
fn a_late_servo_answers_late() {
    let mut bench = Bench::ready();
    bench.plant.set_fault(BASE, Some("late".parse().unwrap()));
    let (bytes, micros) = bench.ask(|b| ping(b, 0));
    assert_eq!((bytes.len(), micros), (6, 30_000 + 370));
    // While it is being waited for, another one speaks first.
    bench.send(|b| ping(b, 0));
    let (bytes, _) = bench.ask(|b| ping(b, 6));
    assert_eq!([bytes[2], bytes[8]], [6, 0]);
    bench.plant.set_fault(BASE, None);
    assert_eq!(bench.ask(|b| ping(b, 0)).1, 370);
}

#[test]
fn a_garbled_servo_sends_wrong_checksums() {
    let mut bench = Bench::ready();
    bench.plant.set_fault(BASE, Some(Fault::Garbled(1)));
    assert!((0..5).all(|_| bench.reading(BASE).is_none()));
    bench.plant.set_fault(BASE, Some(Fault::Garbled(3)));
    let good = (0..30).filter(|_| bench.reading(BASE).is_some()).count();
    assert_eq!(good, 20);
    bench.plant.set_fault(BASE, None);
    assert!(bench.reading(BASE).is_some());
}

#[test]
fn a_stuck_servo_is_overloaded_until_torque_is_cycled() {
    let mut bench = Bench::ready();
    bench.plant.set_fault(BASE, Some(Fault::Stuck));
    bench.torque(BASE, 1);
    bench.goal(BASE, 800, 0, 0);
    bench.pass(500);
    let (reading, errors) = bench.reading(BASE).unwrap();
    assert_eq!((reading.position_counts, reading.load, errors), (BASE_START, 1_000, 0));
    bench.pass(1_000);
    assert_eq!(bench.reading(BASE).unwrap().1, error::OVERLOAD);
    bench.plant.set_fault(BASE, None);
    bench.goal(BASE, 700, 0, 0);
    let (ack, _) = bench.ask(|b| write(b, 0, register::TORQUE_SWITCH, &[1]));
    assert_eq!(ack, [0xFF, 0xFF, 0, 2, error::OVERLOAD, 0xDD], "every answer says so");
    bench.pass(1_000);
    let (reading, errors) = bench.reading(BASE).unwrap();
    assert_eq!((reading.position_counts, reading.load), (BASE_START, 0), "it gave up");
    assert_eq!(errors, error::OVERLOAD, "switching on what is on changes nothing");
    bench.torque(BASE, 0);
    bench.torque(BASE, 1);
    bench.pass(1_000);
    let (reading, errors) = bench.reading(BASE).unwrap();
    assert_eq!((reading.position_counts, errors), (700, 0));
}

#[test]
fn an_echo_comes_before_the_answer() {
    let mut bench = Bench::ready();
    bench.plant.set_echo(true);
    let (bytes, micros) = bench.ask(|b| ping(b, 0));
    assert_eq!(bytes, [0xFF, 0xFF, 0, 2, 1, 0xFC, 0xFF, 0xFF, 0, 2, 0, 0xFD]);
    assert_eq!(micros, 370);
    bench.plant.set_echo(false);
    assert_eq!(bench.ask(|b| ping(b, 0)).0.len(), 6);
}

#[test]
fn garbage_and_damaged_frames_are_ignored() {
    let mut bench = Bench::ready();
    let garbage: Vec<u8> = (0..2_000_u32).map(|i| (i * i % 251).to_le_bytes()[0]).collect();
    bench.plant.bytes(bench.now, &garbage);
    bench.plant.bytes(bench.now, &[0xFF, 0xFF, 0, 2, 1, 0xFD]);
    assert_eq!(bench.plant.deadline(), None);
    bench.pass(100);
    assert_eq!(bench.ask(|b| ping(b, 0)).0.len(), 6);
}

#[test]
fn it_does_not_matter_how_often_anybody_looks() {
    let run = |pause: u64| {
        let mut bench = Bench::ready();
        bench.torque(BASE, 1);
        bench.goal(BASE, 900, 0, 400);
        (0..600 / pause).for_each(|_| bench.pass(pause));
        bench.reading(BASE).unwrap()
    };
    assert_eq!(run(1), run(600));
    assert_eq!(run(7), run(595), "595 is a multiple of 7");
}

#[test]
fn a_frame_that_begins_while_a_servo_drives_the_line_is_lost() {
    for (pause_us, is_lost) in [(0, true), (19, true), (20, false)] {
        let mut bench = Bench::ready();
        bench.plant.set_echo(true);
        bench.send(|b| ping(b, 0));
        let answered_at = bench.plant.deadline().unwrap() + Duration::from_micros(250 + 60);
        assert_eq!(bench.plant.poll(answered_at).len(), 12, "echo and answer");
        bench.now = answered_at + Duration::from_micros(pause_us);
        let (bytes, _) = bench.ask(|b| ping(b, 6));
        assert_eq!(bench.plant.collisions(), u64::from(is_lost), "{pause_us} us");
        if is_lost {
            assert_eq!(bytes, [0xFF, 0xFF, 6, 2, 1, 0xF6].map(|byte| byte ^ 0x55), "the echo is damaged");
        } else {
            assert_eq!(bytes.len(), 12);
        }
        assert_eq!(bench.ask(|b| ping(b, 6)).0.len(), 12, "the next is heard");
    }
}

#[test]
fn frames_without_a_pause_are_heard_unless_an_answer_comes_between_them() {
    let mut bench = Bench::ready();
    bench.send(|b| sync_write(b, register::TORQUE_SWITCH, (0..7).map(|id| (id, [1]))));
    assert_eq!(bench.ask(|b| ping(b, 0)).0.len(), 6, "no servo answers a sync write");
    bench.send(|b| ping(b, 0));
    // 480 us on the wire: the answer to the ping begins in the middle of it.
    let goal = |id: u8| (id, [2, 0, 0, 0, 1, 44]);
    let (bytes, _) = bench.ask(|b| sync_write(b, register::GOAL_POSITION, (0..7).map(goal)));
    assert_eq!((bench.plant.collisions(), bytes.len()), (1, 6));
    assert_ne!(bytes, [0xFF, 0xFF, 0, 2, 0, 0xFD], "and the answer is damaged");
}

//! The bytes that an arm with the maker's controller exchanges with its host.

use arm_sim::flash::Flash;
use arm_sim::plant::Plant;
use arm_sim::servo::ServoFault;
use arm_sim::simulated_arm::{ArmConfig, SimulatedArm};
use arm_sim::stock_controller::StockController;
use motion_core::TorqueCodes;
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::crc::checksum;

type StockArm = SimulatedArm<Flash, Plant, StockController>;

struct Bench {
    arm: StockArm,
    now: Instant,
}

impl Bench {
    /// An arm that was switched on 3 s ago and has sent its first text.
    fn new() -> Self {
        let config =
            ArmConfig { chip_id: *b"SIM\0\0\x01", is_paced: false, torque_codes: TorqueCodes::default() };
        let plant = Plant::new(Instant::ZERO);
        let arm = SimulatedArm::power_up(Instant::ZERO, config, Flash::in_memory(), plant);
        let mut bench = Self { arm, now: Instant::ZERO };
        bench.receive_text();
        bench
    }

    fn receive_text(&mut self) {
        assert!(self.after(3_000).ends_with(b"\r\n"), "text after power-up");
    }

    /// Everything that the arm sends in the next milliseconds.
    fn after(&mut self, millis: u64) -> Vec<u8> {
        let mut received = Vec::new();
        for _ in 0..millis {
            self.now = self.now + Duration::from_millis(1);
            self.arm.advance(self.now, true);
            received.extend(self.arm.host_received());
            self.arm.host_take(usize::MAX);
        }
        received
    }

    /// Sends a frame: function, address, count and data.
    fn send(&mut self, frame: &[u8]) {
        let bytes = with_envelope(frame);
        assert_eq!(self.arm.host_send(self.now, &bytes), bytes.len());
    }

    fn read(&mut self, address: u8, count: u8) -> Vec<u8> {
        self.send(&[3, address, count]);
        let reply = self.after(100);
        let head = [0xAA, 0x77, 3, address, count];
        let values = reply.strip_prefix(&head).and_then(|rest| rest.split_last_chunk::<2>());
        values.unwrap_or_else(|| panic!("no reply: {reply:02x?}")).0.to_vec()
    }
}

fn with_envelope(frame: &[u8]) -> Vec<u8> {
    let frame = [&[0xAA, 0x77], frame].concat();
    let sum = checksum(&frame).to_le_bytes();
    [frame, sum.to_vec()].concat()
}

#[test]
fn it_answers_with_the_makers_bytes() {
    let mut bench = Bench::new();
    for (request, reply) in [
        (&[0xAA, 0x77, 3, 0, 1, 0x16, 0x6C][..], &[0xAA, 0x77, 3, 0, 1, 7, 0xAC, 0x0C][..]),
        (&[0xAA, 0x77, 3, 1, 1, 0x17, 0xFC], &[0xAA, 0x77, 3, 1, 1, 21, 0x7D, 0xC1]),
        (
            &[0xAA, 0x77, 3, 83, 7, 0xAA, 0x9E],
            // The level forearm droops by 0.7 degrees.
            &[0xAA, 0x77, 3, 83, 7, 90, 90, 66, 90, 90, 90, 80, 0x90, 0xD3],
        ),
    ] {
        bench.arm.host_send(bench.now, request);
        assert_eq!(bench.after(100), reply);
    }
    assert_eq!(bench.read(240, 16), [0; 16], "no status block");
}

#[test]
fn it_moves_to_the_targets_of_function_04_and_not_of_06() {
    let mut bench = Bench::new();
    bench.send(&[6, 46, 1, 30]);
    bench.send(&[4, 46, 7, 50, 80, 50, 50, 50, 50, 40]);
    bench.after(3_000);
    let present = bench.read(83, 7);
    let is_near = |(present, target): (&u8, u8)| present.abs_diff(target) <= 1;
    assert!(present.iter().zip([50, 80, 50, 50, 50, 50, 40]).all(is_near), "{present:?}");
    assert_eq!(bench.read(46, 7), [50, 80, 50, 50, 50, 50, 40]);
}

#[test]
fn it_takes_values_that_are_out_of_range() {
    let mut bench = Bench::new();
    bench.send(&[4, 46, 1, 250]);
    bench.send(&[4, 29, 1, 7]);
    assert_eq!((bench.read(46, 1), bench.read(29, 1)), (vec![250], vec![7]));
}

#[test]
fn feedback_comes_a_little_slower_than_asked() {
    let mut bench = Bench::new();
    bench.send(&[4, 82, 1, 30]);
    let frame = with_envelope(&[5, 83, 7, 90, 90, 66, 90, 90, 90, 80]);
    let received = bench.after(1_000);
    assert_eq!(received, frame.repeat(30), "one at once, then one each 34 ms");
    bench.send(&[4, 82, 1, 0]);
    bench.after(50);
    assert!(bench.after(500).is_empty());
}

#[test]
fn an_alarm_beeps_and_the_arm_obeys_nothing_meanwhile() {
    let mut bench = Bench::new();
    // 500 mm to the right.
    bench.send(&[4, 54, 9, 5, 0xF4, 4, 0xB9, 4, 0x32, 0x80, 0x80, 0x7F]);
    bench.send(&[3, 0, 1]);
    let alarm = [0xAA, 0x77, 8, 1, 6, 0x27, 0xFC];
    let received = bench.after(90);
    assert!(received.starts_with(b"Buzzer ON"), "{received:02x?}");
    assert!(received.ends_with(&alarm), "{received:02x?}");
    let received = bench.after(50);
    assert!(received.starts_with(b"Buzzer OFF\r\n"), "{received:02x?}");
    assert!(received.ends_with(&with_envelope(&[3, 0, 1, 7])), "{received:02x?}");
}

#[test]
fn a_solution_is_truncated_and_leaves_the_target_registers() {
    let mut bench = Bench::new();
    // (-50, 185, 50), tool down: 105.124, 88.229, 109.746, 90, 135.254 degrees.
    bench.send(&[4, 54, 9, 3, 0xCE, 4, 0xB9, 4, 0x32, 0x80, 0x80, 0x7F]);
    bench.after(3_000);
    let present = bench.read(83, 5);
    let is_near = |(present, target): (&u8, u8)| present.abs_diff(target) <= 1;
    assert!(present.iter().zip([105, 88, 109, 90, 135]).all(is_near), "{present:?}");
    assert_eq!(bench.read(46, 7), [90, 90, 65, 90, 90, 90, 80]);
}

#[test]
fn settings_are_stored_only_with_the_lock_open() {
    let mut bench = Bench::new();
    assert_eq!(bench.read(11, 9), [255; 9], "never written");
    bench.send(&[4, 11, 1, 5]);
    assert_eq!(bench.read(11, 1), [5], "the register changes although the lock is closed");
    bench.arm.power_cycle(bench.now);
    bench.receive_text();
    assert_eq!(bench.read(11, 1), [255]);
    bench.send(&[4, 28, 1, 0]);
    bench.send(&[4, 11, 9, 5, 0, 128, 138, 128, 128, 128, 128, 128]);
    bench.arm.power_cycle(bench.now);
    bench.receive_text();
    assert_eq!(bench.read(11, 9), [5, 0, 128, 138, 128, 128, 128, 128, 128]);
}

#[test]
fn a_missing_servo_delays_the_reply_and_keeps_its_last_angle() {
    let mut bench = Bench::new();
    assert_eq!(bench.read(83, 7), [90, 90, 66, 90, 90, 90, 80]);
    bench.arm.plant_mut().set_fault(Joint::ALL[2], Some(ServoFault::Missing));
    assert_eq!(bench.read(83, 7), [90, 90, 66, 90, 90, 90, 80]);
}

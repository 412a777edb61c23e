//! A whole arm in virtual time: the bytes at the host and their times, late calls, power cycles, and a flash that fails.

use arm_sim::flash::{Cells, ERASED, Flash};
use arm_sim::pace;
use arm_sim::plant::Plant;
use arm_sim::simulated_arm::{ArmConfig, SimulatedArm};
use embedded_storage::nor_flash::NorFlashErrorKind;
use motion_core::servo_bus::TorqueCodes;
use protocol_core::registers::map::{
    BAUD_RATE, DEVICE_ID, EEPROM_LOCK, FAULTS, FEEDBACK_FREQUENCY, MISSING_SERVOS, MOVING_JOINTS,
    PRESENT_POSITION, SPEED, TARGET_POSITION, fault,
};
use protocol_core::request::Request;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::FrameBuffer;

const READ_POSITIONS: Request<'_> =
    Request::Read { address: PRESENT_POSITION.address, count: PRESENT_POSITION.count };
/// Bytes of the answer to a read of seven registers.
const ANSWER_LENGTH: usize = 14;

fn simulation<C: Cells>(is_paced: bool, flash: Flash<C>) -> SimulatedArm<Flash<C>> {
    let setup = ArmConfig { chip_id: *b"SIM\0\0\x01", is_paced, torque_codes: TorqueCodes::default() };
    SimulatedArm::new(Instant::ZERO, setup, flash, Plant::new(Instant::ZERO))
}

fn at_millis(millis: u64) -> Instant {
    Instant::ZERO + Duration::from_millis(millis)
}

fn frame(request: Request<'_>) -> FrameBuffer {
    let mut bytes = FrameBuffer::new();
    request.encode(&mut bytes);
    bytes
}

fn write(address: u8, value: u8) -> FrameBuffer {
    frame(Request::Write { address, values: &[value] })
}

/// All bytes that have arrived at the host.
fn receive<C: Cells>(simulation: &mut SimulatedArm<Flash<C>>) -> Vec<u8> {
    let mut received = Vec::new();
    while !simulation.host_received().is_empty() {
        let piece = simulation.host_received().to_vec();
        simulation.host_take(piece.len());
        received.extend(piece);
    }
    received
}

#[test]
fn request_and_answer_take_their_time_on_the_line() {
    let mut simulation = simulation(true, Flash::in_memory());
    simulation.advance(at_millis(1_000), true);
    simulation.host_send(at_millis(1_000), &frame(READ_POSITIONS));
    let mut wake_ups = 0;
    let mut answer = Vec::new();
    let mut now = at_millis(1_000);
    while answer.len() < ANSWER_LENGTH {
        now = simulation.deadline(true);
        simulation.advance(now, true);
        answer.extend(receive(&mut simulation));
        wake_ups += 1;
    }
    // 7 + 14 bytes of ten bits at 115200 baud, and nothing in between.
    let took = (now - at_millis(1_000)).as_micros();
    assert!((1_823..1_830).contains(&took), "{took} us");
    assert!(wake_ups <= 5, "{wake_ups}");
}

/// At the slowest of these rates, the goals of seven joints fill 7.4 ms of each control cycle.
#[test]
fn the_controller_keeps_the_bus_free_of_collisions_at_each_rate() {
    for baud in [1_000_000, 250_000, 115_200, 76_800] {
        let setup =
            ArmConfig { chip_id: *b"SIM\0\0\x01", is_paced: false, torque_codes: TorqueCodes::default() };
        let mut plant = Plant::new(Instant::ZERO);
        plant.set_baud(baud);
        let mut simulation = SimulatedArm::new(Instant::ZERO, setup, Flash::in_memory(), plant);
        simulation.advance(at_millis(1_000), true);
        simulation.host_send(at_millis(1_000), &write(TARGET_POSITION.address, 60));
        simulation.advance(at_millis(4_000), true);
        assert_eq!(simulation.plant().collisions(), 0, "{baud} baud");
        assert_eq!(simulation.registers().get(MISSING_SERVOS.address), 0, "{baud} baud");
        assert_eq!(simulation.registers().get(PRESENT_POSITION.address), 60, "{baud} baud");
    }
}

#[test]
fn late_calls_change_nothing() {
    let positions = |step_millis: usize| {
        let mut simulation = simulation(true, Flash::in_memory());
        simulation.advance(at_millis(1_000), true);
        let target = TARGET_POSITION.address;
        simulation
            .host_send(at_millis(1_000), &frame(Request::Write { address: target, values: &[120, 60] }));
        for millis in (1_000..=1_200).step_by(step_millis) {
            simulation.advance(at_millis(millis), true);
        }
        let registers = simulation.registers();
        registers.read(PRESENT_POSITION.address, PRESENT_POSITION.count).to_vec()
    };
    let on_time = positions(1);
    assert!(on_time[0] > 100 && on_time[0] < 120, "moving: {on_time:?}");
    assert_eq!(on_time, positions(200));
}

#[test]
fn an_idle_arm_needs_few_calls() {
    let mut simulation = simulation(true, Flash::in_memory());
    simulation.advance(at_millis(1_000), true);
    let mut wake_ups = 0;
    while simulation.deadline(true) < at_millis(2_000) {
        simulation.advance(simulation.deadline(true), true);
        wake_ups += 1;
    }
    assert!(wake_ups <= 20, "{wake_ups} in a second");
    simulation.host_send(at_millis(2_000), &write(FEEDBACK_FREQUENCY.address, 50));
    simulation.advance(at_millis(2_100), true);
    assert!(simulation.deadline(true) <= at_millis(2_120));
    assert_eq!(simulation.deadline(false), at_millis(2_150), "without a client, reports can wait");
}

#[test]
fn reports_come_on_time() {
    let mut simulation = simulation(true, Flash::in_memory());
    simulation.advance(at_millis(1_000), true);
    simulation.host_send(at_millis(1_000), &write(FEEDBACK_FREQUENCY.address, 50));
    let mut reports = Vec::new();
    while simulation.deadline(true) < at_millis(2_000) {
        let now = simulation.deadline(true);
        simulation.advance(now, true);
        let received = receive(&mut simulation);
        reports.extend(received.chunks(ANSWER_LENGTH).filter(|piece| piece[0] == 0xAA).map(|_| now));
    }
    assert_eq!(reports.len(), 49);
    for pair in reports.windows(2) {
        let period = (pair[1] - pair[0]).as_micros();
        assert!((18_900..=21_100).contains(&period), "{period} us");
    }
}

#[test]
fn a_host_that_does_not_read_loses_no_answer_and_does_not_stop_the_arm() {
    for is_paced in [true, false] {
        let mut simulation = simulation(is_paced, Flash::in_memory());
        simulation.advance(at_millis(1_000), true);
        simulation.host_send(
            at_millis(1_000),
            &frame(Request::Write { address: TARGET_POSITION.address, values: &[120] }),
        );
        let requests = frame(READ_POSITIONS).repeat(200);
        let mut rest = requests.as_slice();
        for millis in 1_000..3_000 {
            let taken = simulation.host_send(at_millis(millis), rest);
            rest = &rest[taken..];
            simulation.advance(at_millis(millis), rest.is_empty());
        }
        assert!(!rest.is_empty() && simulation.host_room() < 10, "back-pressure");
        assert_eq!(simulation.registers().get(MOVING_JOINTS.address), 0);
        assert_eq!(simulation.registers().get(PRESENT_POSITION.address), 120);
        let mut received = Vec::new();
        for millis in 3_000..4_000 {
            let taken = simulation.host_send(at_millis(millis), rest);
            rest = &rest[taken..];
            simulation.advance(at_millis(millis), rest.is_empty());
            received.extend(receive(&mut simulation));
        }
        assert_eq!(received.len(), 200 * ANSWER_LENGTH, "paced: {is_paced}");
    }
}

/// A long write whose data holds a whole read. The read is executed only if the line seems idle behind it (D4).
fn write_around_a_read() -> FrameBuffer {
    let values = [&[0; 4][..], &frame(READ_POSITIONS), &[0; 180]].concat();
    frame(Request::Write { address: 61, values: &values })
}

#[test]
fn a_slow_line_is_not_idle_inside_a_frame() {
    let flash = Flash::in_memory();
    let mut simulation = simulation(true, flash);
    simulation.advance(at_millis(1_000), true);
    simulation.host_send(at_millis(1_000), &write(EEPROM_LOCK.address, 0));
    simulation.host_send(at_millis(1_000), &write(BAUD_RATE.address, 7));
    simulation.advance(at_millis(1_100), true);
    simulation.power_cycle(at_millis(1_100));
    // At 9600 baud the write takes 206 ms, far longer than the gap of 3.6 ms.
    simulation.host_send(at_millis(2_000), &write_around_a_read());
    for millis in 2_000..2_400 {
        simulation.advance(at_millis(millis), true);
    }
    assert_eq!(receive(&mut simulation), b"");
    simulation.host_send(at_millis(2_400), &frame(READ_POSITIONS));
    simulation.advance(at_millis(2_421), true);
    assert_eq!(receive(&mut simulation).len(), 14 - 1, "7 bytes there and 13 back in 21 ms at 9600 baud");
}

#[test]
fn a_power_cycle_keeps_settings_only() {
    let mut simulation = simulation(false, Flash::in_memory());
    for (address, value) in [(EEPROM_LOCK.address, 0), (DEVICE_ID.address, 42), (SPEED.address, 7)] {
        simulation.host_send(at_millis(1_000), &write(address, value));
        simulation.advance(at_millis(1_000), true);
    }
    simulation.host_send(at_millis(1_001), &frame(READ_POSITIONS));
    simulation.advance(at_millis(1_001), true);
    simulation.power_cycle(at_millis(1_001));
    assert_eq!(receive(&mut simulation), b"", "the bytes on the line are lost");
    assert_eq!(simulation.registers().get(DEVICE_ID.address), 42);
    assert_eq!(simulation.registers().get(EEPROM_LOCK.address), 1);
    assert_eq!(simulation.registers().get(SPEED.address), 60);
    assert_eq!(simulation.host_room(), pace::CAPACITY);
}

#[test]
fn a_halted_controller_does_not_answer_until_it_is_restarted() {
    let mut simulation = simulation(false, Flash::in_memory());
    simulation.advance(at_millis(1_000), true);
    simulation.halt_controller(at_millis(1_000));
    simulation.host_send(at_millis(1_001), &frame(READ_POSITIONS));
    simulation.advance(at_millis(2_000), true);
    assert_eq!(receive(&mut simulation), b"");
    simulation.restart_controller(at_millis(2_000));
    simulation.host_send(at_millis(3_000), &frame(READ_POSITIONS));
    simulation.advance(at_millis(3_001), true);
    assert_eq!(receive(&mut simulation).len(), ANSWER_LENGTH);
}

/// Erased cells that cannot be written.
#[derive(Debug)]
struct ReadOnly;

impl Cells for ReadOnly {
    fn read(&self, _: usize, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        bytes.fill(ERASED);
        Ok(())
    }

    fn write(&mut self, _: usize, _: &[u8]) -> Result<(), NorFlashErrorKind> {
        Err(NorFlashErrorKind::Other)
    }
}

#[test]
fn a_flash_that_fails_is_a_fault_and_the_arm_goes_on() {
    let mut simulation = simulation(false, Flash::on(ReadOnly));
    for (address, value) in [(EEPROM_LOCK.address, 0), (DEVICE_ID.address, 42)] {
        simulation.host_send(at_millis(1_000), &write(address, value));
        simulation.advance(at_millis(1_000), true);
    }
    assert_eq!(simulation.registers().get(FAULTS.address) & fault::SETTINGS_STORAGE, fault::SETTINGS_STORAGE);
    assert_eq!(simulation.registers().get(DEVICE_ID.address), 42, "in RAM");
    simulation.host_send(at_millis(1_001), &frame(READ_POSITIONS));
    simulation.advance(at_millis(1_001), true);
    assert_eq!(receive(&mut simulation).len(), ANSWER_LENGTH);
}

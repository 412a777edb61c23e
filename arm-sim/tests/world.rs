//! A whole arm in virtual time: what reaches the host, when, and that nobody's oversleeping changes it.

#![allow(clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)] // A panic is a failed test.

use std::io;

use arm_sim::flash::{Cells, ERASED, Flash};
use arm_sim::pace;
use arm_sim::plant::Plant;
use arm_sim::world::{Setup, World};
use motion_core::servo_bus::TorqueCodes;
use protocol_core::registers::map::{
    BAUD_RATE, DEVICE_ID, EEPROM_LOCK, FAULTS, FEEDBACK_FREQUENCY, MOVING_JOINTS, PRESENT_POSITION, SPEED,
    TARGET_POSITION, fault,
};
use protocol_core::request::Request;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::FrameBuffer;

const READ_POSITIONS: Request<'_> =
    Request::Read { address: PRESENT_POSITION.address, count: PRESENT_POSITION.count };
/// Answer to a read of seven registers.
const ANSWER_LENGTH: usize = 14;

fn world(is_paced: bool, flash: Flash) -> World<Flash> {
    let setup = Setup { chip_id: *b"SIM\0\0\x01", is_paced, torque_codes: TorqueCodes::default() };
    World::new(Instant::ZERO, setup, flash, Plant::new(Instant::ZERO))
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

/// Everything the host can hear at this moment.
fn hear(world: &mut World<Flash>) -> Vec<u8> {
    let mut heard = Vec::new();
    while !world.host_hears().is_empty() {
        let piece = world.host_hears().to_vec();
        world.host_heard(piece.len());
        heard.extend(piece);
    }
    heard
}

#[test]
fn question_and_answer_take_their_time_on_the_line() {
    let mut world = world(true, Flash::in_memory());
    world.advance(at_millis(1_000), true);
    world.host_sends(at_millis(1_000), &frame(READ_POSITIONS));
    let mut wake_ups = 0;
    let mut answer = Vec::new();
    let mut now = at_millis(1_000);
    while answer.len() < ANSWER_LENGTH {
        now = world.deadline(true);
        world.advance(now, true);
        answer.extend(hear(&mut world));
        wake_ups += 1;
    }
    // 7 + 14 bytes of ten bits at 115200 baud, and nothing in between.
    let took = (now - at_millis(1_000)).as_micros();
    assert!((1_823..1_830).contains(&took), "{took} us");
    assert!(wake_ups <= 5, "{wake_ups}");
}

#[test]
fn oversleeping_changes_nothing() {
    let positions = |step_millis: usize| {
        let mut world = world(true, Flash::in_memory());
        world.advance(at_millis(1_000), true);
        let target = TARGET_POSITION.address;
        world.host_sends(at_millis(1_000), &frame(Request::Write { address: target, values: &[120, 60] }));
        for millis in (1_000..=1_200).step_by(step_millis) {
            world.advance(at_millis(millis), true);
        }
        let registers = world.registers();
        registers.read(PRESENT_POSITION.address, PRESENT_POSITION.count).to_vec()
    };
    let awake = positions(1);
    assert!(awake[0] > 100 && awake[0] < 120, "on its way: {awake:?}");
    assert_eq!(awake, positions(200));
}

#[test]
fn an_idle_arm_lets_its_shell_sleep() {
    let mut world = world(true, Flash::in_memory());
    world.advance(at_millis(1_000), true);
    let mut wake_ups = 0;
    while world.deadline(true) < at_millis(2_000) {
        world.advance(world.deadline(true), true);
        wake_ups += 1;
    }
    assert!(wake_ups <= 20, "{wake_ups} in a second");
    world.host_sends(at_millis(2_000), &write(FEEDBACK_FREQUENCY.address, 50));
    world.advance(at_millis(2_100), true);
    assert!(world.deadline(true) <= at_millis(2_120));
    assert_eq!(world.deadline(false), at_millis(2_150), "nobody hears the reports");
}

#[test]
fn reports_come_on_time() {
    let mut world = world(true, Flash::in_memory());
    world.advance(at_millis(1_000), true);
    world.host_sends(at_millis(1_000), &write(FEEDBACK_FREQUENCY.address, 50));
    let mut reports = Vec::new();
    while world.deadline(true) < at_millis(2_000) {
        let now = world.deadline(true);
        world.advance(now, true);
        let heard = hear(&mut world);
        reports.extend(heard.chunks(ANSWER_LENGTH).filter(|piece| piece[0] == 0xAA).map(|_| now));
    }
    assert_eq!(reports.len(), 49);
    for pair in reports.windows(2) {
        let period = (pair[1] - pair[0]).as_micros();
        assert!((18_900..=21_100).contains(&period), "{period} us");
    }
}

#[test]
fn a_host_that_does_not_listen_loses_no_answer_and_does_not_stop_the_arm() {
    for is_paced in [true, false] {
        let mut world = world(is_paced, Flash::in_memory());
        world.advance(at_millis(1_000), true);
        world.host_sends(
            at_millis(1_000),
            &frame(Request::Write { address: TARGET_POSITION.address, values: &[120] }),
        );
        let requests = frame(READ_POSITIONS).repeat(200);
        let mut rest = requests.as_slice();
        for millis in 1_000..3_000 {
            let taken = world.host_sends(at_millis(millis), rest);
            rest = &rest[taken..];
            world.advance(at_millis(millis), rest.is_empty());
        }
        assert!(!rest.is_empty() && world.host_room() < 10, "back-pressure");
        assert_eq!(world.registers().get(MOVING_JOINTS.address), 0);
        assert_eq!(world.registers().get(PRESENT_POSITION.address), 120);
        let mut heard = Vec::new();
        for millis in 3_000..4_000 {
            let taken = world.host_sends(at_millis(millis), rest);
            rest = &rest[taken..];
            world.advance(at_millis(millis), rest.is_empty());
            heard.extend(hear(&mut world));
        }
        assert_eq!(heard.len(), 200 * ANSWER_LENGTH, "paced: {is_paced}");
    }
}

/// A long write with a whole read inside its data, which comes out only if somebody saw a pause behind it.
fn write_around_a_read() -> FrameBuffer {
    let values = [&[0; 4][..], &frame(READ_POSITIONS), &[0; 180]].concat();
    frame(Request::Write { address: 61, values: &values })
}

#[test]
fn a_slow_line_makes_no_silence_inside_a_frame() {
    let flash = Flash::in_memory();
    let mut world = world(true, flash);
    world.advance(at_millis(1_000), true);
    world.host_sends(at_millis(1_000), &write(EEPROM_LOCK.address, 0));
    world.host_sends(at_millis(1_000), &write(BAUD_RATE.address, 7));
    world.advance(at_millis(1_100), true);
    world.power_cycle(at_millis(1_100));
    // At 9600 baud the write takes 206 ms, far longer than the gap of 3.6 ms.
    world.host_sends(at_millis(2_000), &write_around_a_read());
    for millis in 2_000..2_400 {
        world.advance(at_millis(millis), true);
    }
    assert_eq!(hear(&mut world), b"");
    world.host_sends(at_millis(2_400), &frame(READ_POSITIONS));
    world.advance(at_millis(2_421), true);
    assert_eq!(hear(&mut world).len(), 14 - 1, "7 bytes there and 13 back in 21 ms at 9600 baud");
}

#[test]
fn a_power_cycle_keeps_settings_and_forgets_the_rest() {
    let mut world = world(false, Flash::in_memory());
    for (address, value) in [(EEPROM_LOCK.address, 0), (DEVICE_ID.address, 42), (SPEED.address, 7)] {
        world.host_sends(at_millis(1_000), &write(address, value));
        world.advance(at_millis(1_000), true);
    }
    world.host_sends(at_millis(1_001), &frame(READ_POSITIONS));
    world.advance(at_millis(1_001), true);
    world.power_cycle(at_millis(1_001));
    assert_eq!(hear(&mut world), b"", "what was on the line is lost");
    assert_eq!(world.registers().get(DEVICE_ID.address), 42);
    assert_eq!(world.registers().get(EEPROM_LOCK.address), 1);
    assert_eq!(world.registers().get(SPEED.address), 60);
    assert_eq!(world.host_room(), pace::CAPACITY);
}

#[test]
fn a_halted_controller_is_silent_until_it_is_restarted() {
    let mut world = world(false, Flash::in_memory());
    world.advance(at_millis(1_000), true);
    world.halt_controller(at_millis(1_000));
    world.host_sends(at_millis(1_001), &frame(READ_POSITIONS));
    world.advance(at_millis(2_000), true);
    assert_eq!(hear(&mut world), b"");
    world.restart_controller(at_millis(2_000));
    world.host_sends(at_millis(3_000), &frame(READ_POSITIONS));
    world.advance(at_millis(3_001), true);
    assert_eq!(hear(&mut world).len(), ANSWER_LENGTH);
}

/// Erased cells that cannot be written.
#[derive(Debug)]
struct ReadOnly;

impl Cells for ReadOnly {
    fn read(&self, _: usize, bytes: &mut [u8]) -> io::Result<()> {
        bytes.fill(ERASED);
        Ok(())
    }

    fn write(&mut self, _: usize, _: &[u8]) -> io::Result<()> {
        Err(io::ErrorKind::PermissionDenied.into())
    }
}

#[test]
fn a_flash_that_fails_is_a_fault_and_the_arm_goes_on() {
    let mut world = world(false, Flash::on(ReadOnly));
    for (address, value) in [(EEPROM_LOCK.address, 0), (DEVICE_ID.address, 42)] {
        world.host_sends(at_millis(1_000), &write(address, value));
        world.advance(at_millis(1_000), true);
    }
    assert_eq!(world.registers().get(FAULTS.address) & fault::SETTINGS_STORAGE, fault::SETTINGS_STORAGE);
    assert_eq!(world.registers().get(DEVICE_ID.address), 42, "in RAM");
    world.host_sends(at_millis(1_001), &frame(READ_POSITIONS));
    world.advance(at_millis(1_001), true);
    assert_eq!(hear(&mut world).len(), ANSWER_LENGTH);
}

//! Scan, set-id, center and info with simulated servos in virtual time.

use std::time::Duration;

use arm_sim::servo::ServoFault;
use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::{ServoFrameBuffer, error, register, write};
use protocol_core::time::{Duration as SimulatedDuration, Instant};

pub(super) mod simulated;

use super::bus_master::BusMaster;
use super::center::{CenterError, CenterOptions, center};
use super::error::ServoError;
use super::scan::{AnswerQuality, FoundServo, ScanPlan, ScanResult, scan};
use super::servo_info::{ServoInfo, error_words};
use super::set_id::{SetIdError, set_id};
use super::{BAUD_RATES, MAX_ID};
use simulated::{SimulatedServo, bus};

const FAST: u32 = 1_000_000;

fn plan(rates: &[u32]) -> ScanPlan {
    ScanPlan { rates: rates.to_vec(), ids: 0..=MAX_ID, wait: None }
}

fn found(bus: &mut BusMaster, plan: &ScanPlan) -> Vec<(u32, u8, AnswerQuality)> {
    let ScanResult { found, .. } = scan(bus, plan, |_| ()).unwrap();
    found.into_iter().map(|FoundServo { baud, id, answers }| (baud, id, answers)).collect()
}

fn late(micros: u64) -> ServoFault {
    ServoFault::Late(SimulatedDuration::from_micros(micros))
}

/// Writes a register of the EEPROM.
fn set(simulated: &mut SimulatedServo, register: u8, values: &[u8]) {
    for (register, values) in [(register::LOCK, [0].as_slice()), (register, values), (register::LOCK, &[1])] {
        let mut request = ServoFrameBuffer::new();
        write(&mut request, simulated.servo.id(), register, values);
        let mut decoder = motion_core::servo_bus::frame::Decoder::new();
        decoder.push(&request);
        simulated.servo.handle_frame(Instant::ZERO, &decoder.pull().unwrap().unwrap());
    }
}

#[test]
fn a_scan_finds_every_servo_at_every_rate() {
    let mut servos: Vec<_> = [7, 0, 253].map(SimulatedServo::new).into();
    for (code, id) in (0..8).zip(100..) {
        let mut servo = SimulatedServo::new(id);
        set(&mut servo, register::BAUD_RATE, &[code]);
        servos.push(servo);
    }
    let (mut bus, _) = bus(servos);
    let mut wanted: Vec<_> = [0, 7].map(|id| (FAST, id, AnswerQuality::Good)).into();
    wanted.extend(BAUD_RATES.into_iter().zip(100..).map(|(baud, id)| (baud, id, AnswerQuality::Good)));
    wanted.insert(3, (FAST, 253, AnswerQuality::Good));
    assert_eq!(found(&mut bus, &plan(&BAUD_RATES)), wanted);
    assert!(!bus.has_echo());
}

#[test]
fn a_scan_of_one_rate_takes_at_most_two_seconds() {
    let (mut bus, _) = bus(vec![SimulatedServo::new(3)]);
    let start = bus.now();
    let mut last = None;
    scan(&mut bus, &plan(&[FAST]), |step| last = Some(step)).unwrap();
    let step = last.unwrap();
    assert_eq!((step.baud, step.asked, step.found), (FAST, 254, 1));
    // In virtual time: the sum of all waits.
    assert!(bus.now() - start < Duration::from_secs(2), "{:?}", bus.now() - start);
}

#[test]
fn an_answer_after_an_echo_is_found() {
    let (mut bus, wire) = bus([1, 5].map(SimulatedServo::new).into());
    wire.lock().unwrap().has_echo = true;
    assert_eq!(
        found(&mut bus, &plan(&[FAST])),
        [(FAST, 1, AnswerQuality::Good), (FAST, 5, AnswerQuality::Good)]
    );
    assert!(bus.has_echo());
    let Err(ServoError::NoAnswer { received, .. }) = bus.read(2, register::ID, 1) else {
        panic!("nobody is there")
    };
    assert_eq!(received.to_string(), "only the echo of the question was received");
}

#[test]
fn a_servo_with_a_voltage_error_is_found_despite_echoes() {
    let servo = SimulatedServo { errors: error::VOLTAGE, ..SimulatedServo::new(4) };
    let (mut bus, wire) = bus(vec![servo]);
    for has_echo in [false, true] {
        wire.lock().unwrap().has_echo = has_echo;
        assert_eq!(found(&mut bus, &plan(&[FAST])), [(FAST, 4, AnswerQuality::Good)]);
    }
    // An answer with two values is as long as a question, and error bits 2 equal the code of a read.
    wire.lock().unwrap().servos[0].errors = 2;
    let answer = bus.read(4, register::ID, 2).unwrap();
    assert_eq!((answer.errors, answer.values), (2, vec![4, 0]));
}

#[test]
fn a_scan_with_a_slow_adapter_finds_every_servo() {
    let slow = |id| SimulatedServo::with(id, late(60_000));
    let (mut bus, _) = bus([0, 3, 253].map(slow).into());
    assert_eq!(found(&mut bus, &plan(&[FAST])), [0, 3, 253].map(|id| (FAST, id, AnswerQuality::Good)));
}

#[test]
fn late_echoes_are_not_late_answers() {
    let (mut bus, wire) = bus(vec![SimulatedServo::new(3)]);
    wire.lock().unwrap().has_echo = true;
    wire.lock().unwrap().echo_delay = Duration::from_millis(60);
    assert_eq!(found(&mut bus, &plan(&[FAST])), [(FAST, 3, AnswerQuality::Good)]);
    assert!(bus.has_echo());
    // In virtual time: 254 short timeouts, and full timeouts for one id only.
    assert!(bus.now() < Duration::from_secs(3), "{:?}", bus.now());
}

#[test]
fn damaged_answers_and_duplicate_ids_are_reported() {
    let garbled = SimulatedServo::with(2, ServoFault::Garbled(1));
    let (mut bus, _) = bus(vec![garbled, SimulatedServo::new(9), SimulatedServo::with(9, late(350))]);
    assert_eq!(
        found(&mut bus, &plan(&[FAST])),
        [(FAST, 2, AnswerQuality::Damaged), (FAST, 9, AnswerQuality::Several)]
    );
}

#[test]
fn unsupported_rates_are_reported() {
    let (mut bus, wire) = bus(vec![SimulatedServo::new(0)]);
    wire.lock().unwrap().rates = vec![500_000, FAST];
    let scan = scan(&mut bus, &plan(&BAUD_RATES), |_| ()).unwrap();
    assert_eq!(scan.found.len(), 1);
    assert_eq!(scan.unknown_rates, BAUD_RATES[2..]);
}

#[test]
fn a_late_answer_is_not_taken_for_the_next() {
    let (mut bus, wire) = bus(vec![SimulatedServo::with(0, late(610_000))]);
    assert!(matches!(bus.read(0, register::ID, 1), Err(ServoError::NoAnswer { attempts: 3, .. })));
    wire.lock().unwrap().servos[0].set_fault(None);
    assert_eq!(bus.read(0, register::RESPONSE_LEVEL, 1).unwrap().values, [1]);
}

#[test]
fn registers_are_read_high_byte_first() {
    let mut servo = SimulatedServo::new(1);
    set(&mut servo, register::MIN_POSITION, &[0, 20, 3, 0xEB]);
    let (mut bus, _) = bus(vec![servo]);
    let facts = ServoInfo::read(&mut bus, 1).unwrap();
    assert_eq!(facts.position_limits, (20, 1003));
    assert_eq!((facts.max_torque, facts.max_temperature, facts.voltage_limits), (1_000, 80, (50, 250)));
    assert_eq!((facts.baud, facts.is_unlocked, facts.acknowledges_writes), (Some(FAST), false, true));
    assert_eq!(facts.reading.unwrap().position_counts, 300);
    // Joint 2 is reversed: 20 counts at 180 degrees, 850/180 counts per degree.
    assert!((facts.degrees().unwrap() - (180.0 - 280.0 * 180.0 / 850.0)).abs() < 0.001);
    assert_eq!(error_words(facts.unload_conditions), "voltage, overheated, overload");
    assert_eq!(error_words(0x42), "unknown bits 0x42");
}

#[test]
fn an_id_is_changed_and_locked_again() {
    for has_echo in [false, true] {
        let (mut bus, wire) = bus(vec![SimulatedServo::new(1)]);
        wire.lock().unwrap().has_echo = has_echo;
        set_id(&mut bus, &ScanPlan::all_ids(FAST, None), 1, 6, |_| ()).unwrap();
        let servo = &mut wire.lock().unwrap().servos[0].servo;
        servo.power_cycle(Instant::ZERO);
        assert_eq!(servo.id(), 6);
    }
    let (mut bus, _) = bus(vec![SimulatedServo::new(1)]);
    set_id(&mut bus, &ScanPlan::all_ids(FAST, None), 1, 6, |_| ()).unwrap();
    assert_eq!(bus.read(6, register::LOCK, 1).unwrap().values, [1]);
}

#[test]
fn an_id_is_changed_on_a_servo_that_acknowledges_nothing() {
    let mut servo = SimulatedServo::new(1);
    set(&mut servo, register::RESPONSE_LEVEL, &[0]);
    let (mut bus, wire) = bus(vec![servo]);
    set_id(&mut bus, &ScanPlan::all_ids(FAST, None), 1, 6, |_| ()).unwrap();
    assert_eq!(wire.lock().unwrap().servos[0].servo.id(), 6);
}

#[test]
fn a_new_id_needs_exactly_one_servo() {
    let garbled = SimulatedServo::with(4, ServoFault::Garbled(1));
    for (servos, says) in [
        (vec![SimulatedServo::new(1), SimulatedServo::new(200)], "these ids answer: 1, 200"),
        (vec![SimulatedServo::new(2)], "the only servo that answers has another id: 2"),
        (vec![SimulatedServo::new(1), garbled], "1, 4 (damaged answers)"),
        (vec![SimulatedServo::new(1), SimulatedServo::new(1)], "1 (several servos)"),
        (vec![], "no servo answers"),
    ] {
        let (mut bus, wire) = bus(servos);
        let error = set_id(&mut bus, &ScanPlan::all_ids(FAST, None), 1, 6, |_| ()).unwrap_err();
        assert!(matches!(error, SetIdError::NotAlone { .. }));
        assert!(error.to_string().contains(says), "{error}");
        assert!(wire.lock().unwrap().sent.iter().all(|frame| frame[4] == 2), "only reads");
    }
}

#[test]
fn a_servo_lost_while_unlocking_is_an_error() {
    let plan = ScanPlan::all_ids(FAST, None);
    let (mut first, _) = bus(vec![SimulatedServo::new(1)]);
    scan(&mut first, &plan, |_| ()).unwrap();
    let (mut bus, wire) = bus(vec![SimulatedServo::new(1)]);
    // Just after the scan, while the EEPROM is being unlocked.
    wire.lock().unwrap().servos[0].fails_at = first.now() + Duration::from_micros(100);
    let error = set_id(&mut bus, &plan, 1, 6, |_| ()).unwrap_err();
    assert!(matches!(error, SetIdError::StaysLocked(_)), "{error:?}");
}

#[test]
fn each_error_after_a_lost_port_gives_the_servos_state() {
    let plan = ScanPlan::all_ids(FAST, None);
    let (mut bus_to_count, counted) = bus(vec![SimulatedServo::new(1)]);
    set_id(&mut bus_to_count, &plan, 1, 6, |_| ()).unwrap();
    let frames = counted.lock().unwrap().sent.clone();
    let first_write = frames.iter().position(|frame| frame[4] == 3).unwrap();
    for frames_until_lost in first_write..frames.len() {
        let (mut bus, wire) = bus(vec![SimulatedServo::new(1)]);
        wire.lock().unwrap().frames_until_lost = Some(frames_until_lost);
        let error = set_id(&mut bus, &plan, 1, 6, |_| ()).unwrap_err();
        let id = wire.lock().unwrap().servos[0].servo.id();
        match error {
            SetIdError::StaysLocked(_) => assert_eq!(id, 1),
            SetIdError::StaysOpen(_) => assert_eq!(id, 6),
            SetIdError::IdUncertain(_) => {}
            error => panic!("frame {frames_until_lost}: {error:?}"),
        }
    }
}

#[test]
fn a_servo_moves_to_its_middle_without_a_jump() {
    let (mut bus, wire) = bus(vec![SimulatedServo::new(1)]);
    let middle = center(&mut bus, 1, &CenterOptions::default(), |_| true);
    assert!(matches!(middle, Ok(510..=512)), "static friction holds it up to a count off: {middle:?}");
    let goals: Vec<Vec<u8>> = wire
        .lock()
        .unwrap()
        .sent
        .iter()
        .filter(|frame| frame[4] == 3)
        .map(|frame| frame[5..frame.len() - 1].to_vec())
        .collect();
    let (start, middle) = ([42, 1, 44, 0, 0, 0, 100].to_vec(), [42, 1, 255, 0, 0, 0, 100].to_vec());
    assert_eq!(goals, [start, [40, 1].to_vec(), middle]);
}

#[test]
fn a_blocked_servo_loses_its_torque() {
    let (mut bus, wire) = bus(vec![SimulatedServo::with(1, ServoFault::Stuck)]);
    let error = center(&mut bus, 1, &CenterOptions::default(), |_| true).unwrap_err();
    assert!(
        matches!(error, CenterError::Overload { position: 300, load: 601..=1_000, errors: 0 }),
        "{error:?}"
    );
    assert_ne!(wire.lock().unwrap().servos[0].servo.torque_switch(), Torque::On);
    let weak = CenterOptions { load: 1_000, stall: Duration::from_millis(500), ..CenterOptions::default() };
    let error = center(&mut bus, 1, &weak, |_| true).unwrap_err();
    assert_eq!(error, CenterError::Stalled { position: 300 });
    assert_ne!(wire.lock().unwrap().servos[0].servo.torque_switch(), Torque::On);
}

#[test]
fn an_interrupted_move_ends_without_torque() {
    let (mut bus, wire) = bus(vec![SimulatedServo::new(1)]);
    let error =
        center(&mut bus, 1, &CenterOptions::default(), |reading| reading.position_counts < 320).unwrap_err();
    assert_eq!(error, CenterError::Interrupted);
    assert_ne!(wire.lock().unwrap().servos[0].servo.torque_switch(), Torque::On);
}

#[test]
fn a_servo_that_cannot_reach_its_middle_gets_no_torque() {
    for (limits, says) in [([0, 0, 0, 0], "turn without end"), ([2, 88, 3, 255], "600 to 1023")] {
        let mut servo = SimulatedServo::new(1);
        set(&mut servo, register::MIN_POSITION, &limits);
        let (mut bus, wire) = bus(vec![servo]);
        let error = center(&mut bus, 1, &CenterOptions::default(), |_| true).unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
        assert_ne!(wire.lock().unwrap().servos[0].servo.torque_switch(), Torque::On);
    }
}

#[test]
fn a_servo_lost_during_its_move_may_still_be_moving() {
    let (mut bus, wire) = bus(vec![SimulatedServo::new(1)]);
    let silence = Duration::from_millis(500);
    wire.lock().unwrap().servos[0].fails_at = silence;
    let error = center(&mut bus, 1, &CenterOptions::default(), |_| true).unwrap_err();
    assert!(matches!(error, CenterError::TorqueStillOn(_)), "{error:?}");
    assert!(error.to_string().contains("may still be moving"), "{error}");
}

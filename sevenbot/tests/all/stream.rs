//! Streams of set-points: what the registers hold during a stream and after it, however it ends.

#![cfg(unix)]

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex};

use crate::fake::{execute, moving_registers, scripted_arm};
use protocol_core::request::Request;
use serialport::TTYPort;
use sevenbot::checked_write::{MismatchCause, WriteError};
use sevenbot::stream::{SetPointStream, StreamError, StreamOptions, WatchdogAction};
use sevenbot::{Arm, Error, FineAngle};

type Registers = Arc<Mutex<[u8; 256]>>;

/// An arm with the extended block, and its registers.
fn arm_with_block() -> (Arm, Registers, TTYPort) {
    let registers = moving_registers();
    registers.lock().unwrap()[191] = 1;
    let shown = Arc::clone(&registers);
    let (port, held) = scripted_arm(move |_, request| execute(&mut registers.lock().unwrap(), request));
    (Arm::open(&port, 115_200).unwrap(), shown, held)
}

fn options() -> StreamOptions {
    StreamOptions::new(20).unwrap().with_watchdog(25, WatchdogAction::Damping)
}

/// The registers from the set-point period to the action of the watchdog, after all writes so far.
fn stream_registers(arm: &mut Arm, registers: &Registers) -> [u8; 4] {
    // The arm replies after it has carried out the earlier writes.
    arm.read(0, 1).unwrap();
    registers.lock().unwrap()[184..188].try_into().unwrap()
}

#[test]
fn d24_a_stream_arms_the_watchdog_and_puts_everything_back() {
    let (mut arm, registers, _held) = arm_with_block();
    registers.lock().unwrap()[184..188].copy_from_slice(&[50, 0, 7, 0]);
    let mut stream = SetPointStream::open(&mut arm, options()).unwrap();
    assert_eq!(registers.lock().unwrap()[184..188], [20, 0, 25, 1]);
    let angle = FineAngle::from_hundredths(9_025);
    stream.send(&[angle, None, angle, None, None, None, None]).unwrap();
    assert_eq!(stream.arm().read(128, 6).unwrap(), [0x41, 0x23, 0, 0, 0x41, 0x23]);
    stream.close().unwrap();
    assert_eq!(registers.lock().unwrap()[184..188], [50, 0, 7, 0]);
}

#[test]
fn d24_a_dropped_stream_and_a_panic_put_everything_back() {
    let (mut arm, registers, _held) = arm_with_block();
    drop(SetPointStream::open(&mut arm, options()).unwrap());
    assert_eq!(stream_registers(&mut arm, &registers), [0; 4]);
    let panicked = catch_unwind(AssertUnwindSafe(|| {
        let _stream = SetPointStream::open(&mut arm, options()).unwrap();
        assert_eq!(registers.lock().unwrap()[186], 25);
        panic!("on purpose");
    }));
    assert!(panicked.is_err());
    assert_eq!(stream_registers(&mut arm, &registers), [0; 4]);
}

#[test]
fn d24_what_a_dead_program_left_behind_is_switched_off() {
    let (mut arm, registers, _held) = arm_with_block();
    registers.lock().unwrap()[184..188].copy_from_slice(&[20, 0, 30, 0]);
    registers.lock().unwrap()[241] = 1 << 6;
    SetPointStream::open(&mut arm, options()).unwrap().close().unwrap();
    assert_eq!(stream_registers(&mut arm, &registers), [0; 4]);
}

#[test]
fn an_arm_without_the_block_takes_no_stream() {
    let registers = moving_registers();
    let (port, _held) = scripted_arm(move |_, request| execute(&mut registers.lock().unwrap(), request));
    let mut arm = Arm::open(&port, 115_200).unwrap();
    assert!(!arm.has_extended_block().unwrap());
    assert_eq!(SetPointStream::open(&mut arm, options()).unwrap_err(), StreamError::NoExtendedBlock);
}

#[test]
fn d22_registers_that_are_not_taken_are_told_whole() {
    let registers = moving_registers();
    registers.lock().unwrap()[191] = 1;
    let (port, _held) = scripted_arm(move |_, request| {
        let mut registers = registers.lock().unwrap();
        let reply = execute(&mut registers, request);
        registers[184..188].copy_from_slice(&[0x2C, 0x01, 25, 1]);
        reply
    });
    let mut arm = Arm::open(&port, 115_200).unwrap();
    let error = SetPointStream::open(&mut arm, options()).unwrap_err();
    let StreamError::NotTaken(unchanged) = error else { panic!("{error}") };
    let [only] = unchanged.registers() else { panic!("{unchanged:?}") };
    assert_eq!((only.address, only.wanted, only.found, only.cause), (184, 20, 300, MismatchCause::Unknown));
}

#[test]
fn a_stream_that_does_not_end_is_an_error() {
    let registers = moving_registers();
    (registers.lock().unwrap()[191], registers.lock().unwrap()[241]) = (1, 1 << 6);
    let (port, _held) = scripted_arm(move |_, request| {
        let mut registers = registers.lock().unwrap();
        let reply = execute(&mut registers, request);
        registers[184..188].copy_from_slice(&[20, 0, 30, 0]);
        reply
    });
    let mut arm = Arm::open(&port, 115_200).unwrap();
    let error = arm.end_abandoned_stream().unwrap_err();
    let WriteError::NotTaken(not_taken) = error else { panic!("{error}") };
    let addresses: Vec<u8> = not_taken.registers().iter().map(|register| register.address).collect();
    assert_eq!(addresses, [184, 186]);
}

#[test]
fn the_period_of_another_program_is_put_back_after_a_failure() {
    let registers = moving_registers();
    registers.lock().unwrap()[191] = 1;
    registers.lock().unwrap()[184..186].copy_from_slice(&[20, 0]);
    let shown = Arc::clone(&registers);
    let (port, _held) = scripted_arm(move |_, request| match request {
        Request::Read { address: 128, .. } => Vec::new(),
        _ => execute(&mut registers.lock().unwrap(), request),
    });
    let mut arm = Arm::open(&port, 115_200).unwrap();
    let targets = [FineAngle::from_hundredths(9_025); 7];
    let error = arm.set_fine_targets_checked(&targets).unwrap_err();
    assert!(matches!(error, WriteError::Exchange(Error::NoAnswer { .. })), "{error}");
    assert_eq!(shown.lock().unwrap()[184..186], [20, 0]);
}

/// When the other program ends its stream: never, before the stop writes its targets, or before the stop restores the period.
#[derive(Clone, Copy)]
enum StreamEnd {
    Never,
    Stop,
    RestoredPeriod,
}

#[test]
fn d23_a_stop_leaves_a_stream_off_that_its_program_has_ended_meanwhile() {
    let ends =
        [(StreamEnd::Never, [20, 0, 30, 0]), (StreamEnd::Stop, [0; 4]), (StreamEnd::RestoredPeriod, [0; 4])];
    for (end, left) in ends {
        let registers = moving_registers();
        registers.lock().unwrap()[191] = 1;
        registers.lock().unwrap()[184..188].copy_from_slice(&[20, 0, 30, 0]);
        let shown = Arc::clone(&registers);
        let (port, _held) = scripted_arm(move |_, request| {
            let mut registers = registers.lock().unwrap();
            let is_end = match (end, &request) {
                (StreamEnd::Stop, Request::Write { address, .. }) => (128..142).contains(address),
                (StreamEnd::RestoredPeriod, Request::Write { address: 184, values }) => values[0] == 20,
                _ => false,
            };
            if is_end {
                registers[184..188].fill(0);
            }
            execute(&mut registers, request)
        });
        let mut arm = Arm::open(&port, 115_200).unwrap();
        arm.hold().unwrap();
        assert_eq!(stream_registers(&mut arm, &shown), left);
    }
}

//! The library with an arm that misbehaves, on a real pseudo-terminal.

#![cfg(unix)]

use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use crate::fake::{IDENTITY, answering_arm, execute, moving_registers, reply, scripted_arm};
use protocol_core::request::Request;
use serialport::{SerialPort, TTYPort};
use sevenbot::{Arm, ArmOptions, Error, OpenError, ReceiveCounts};

/// A long timeout for a busy machine. Only tests of a silent arm wait that long.
fn options() -> ArmOptions {
    ArmOptions { reply_timeout: Duration::from_secs(2), ..ArmOptions::default() }
}

#[test]
fn a_lost_read_is_repeated() {
    let (name, _port) = answering_arm(|read, _, _| if read < 2 { vec![] } else { reply(0, &IDENTITY) });
    let arm = Arm::open_with(&name, options()).expect("the third try is answered");
    assert_eq!(arm.identity().version(), "3.0");
    assert_eq!(arm.identity().chip_id(), [1, 2, 3, 4, 5, 6]);
}

#[test]
fn a_lock_is_closed_again_if_its_opening_is_not_confirmed() {
    let registers = moving_registers();
    let shown = Arc::clone(&registers);
    let (mut is_silent, opened) = (false, Arc::<AtomicBool>::default());
    let was_opened = Arc::clone(&opened);
    let (name, _port) = scripted_arm(move |_, request| {
        is_silent |= matches!(request, Request::Write { address: 28, .. });
        opened.fetch_or(matches!(request, Request::Write { address: 28, values: [0] }), Ordering::Relaxed);
        let answer = execute(&mut registers.lock().unwrap(), request);
        if is_silent { Vec::new() } else { answer }
    });
    let mut arm = Arm::open_with(&name, options()).unwrap();
    assert!(arm.with_open_lock(|_| Ok(())).is_err());
    let end = Instant::now() + Duration::from_secs(10);
    while !was_opened.load(Ordering::Relaxed) || shown.lock().unwrap()[28] != 1 {
        assert!(Instant::now() < end, "the lock stays open");
        thread::yield_now();
    }
}

#[test]
fn a_silent_port_differs_from_garbage() {
    let received = |bytes: &'static [u8]| {
        // The number of further reads depends on the machine.
        let (name, _port) = answering_arm(move |read, _, _| if read < 3 { bytes.to_vec() } else { vec![] });
        match Arm::open_with(&name, options()) {
            Err(OpenError::Silent(Error::NoAnswer { attempts: 3, received, .. })) => received,
            other => panic!("{other:?}"),
        }
    };
    let garbage = ReceiveCounts { bytes: 21, ..ReceiveCounts::default() };
    let damaged = ReceiveCounts { damaged_frames: 3, ..garbage };
    // In parallel, because each waits until all its attempts time out.
    thread::scope(|scope| {
        scope.spawn(|| assert_eq!(received(b""), ReceiveCounts::default()));
        scope.spawn(|| assert_eq!(received(b"garbage"), garbage));
        scope.spawn(|| assert_eq!(received(&[0xAA, 0x77, 0x03, 0x00, 0x00, 0x11, 0x11]), damaged));
    });
}

#[test]
fn another_device_is_refused_by_its_code() {
    let (name, _port) = answering_arm(|_, _, _| reply(0, &[9, 30, 0, 0, 0, 0, 0, 0]));
    assert!(matches!(Arm::open_with(&name, options()), Err(OpenError::WrongDevice { code: 9 })));
}

#[test]
fn an_echo_of_the_request_is_no_answer() {
    // A one-wire adapter echoes the request. The library sees a reply that is cut short.
    let echo = [0xAA, 0x77, 0x03, 0x00, 0x08, 0x50, 0x27];
    let (name, _port) = answering_arm(move |_, _, _| [echo.as_slice(), &reply(0, &IDENTITY)].concat());
    assert!(Arm::open_with(&name, options()).is_ok());
}

#[test]
fn reports_between_replies_are_kept() {
    let positions = |first: u8| reply(54, &[first, 20, 30, 40, 50, 60, 70]);
    let (name, _port) = answering_arm(move |read, address, count| match read {
        0 => reply(0, &IDENTITY),
        // Two reports and a late reply arrive before the reply.
        1 => [positions(1), positions(2), reply(12, &[9]), reply(address, &vec![3; count.into()])].concat(),
        _ => [reply(address, &vec![4; count.into()]), positions(5)].concat(),
    });
    let mut arm = Arm::open_with(&name, options()).unwrap();
    assert_eq!(arm.read(12, 2).unwrap(), [3, 3]);
    let first: Vec<u8> = arm.reports().map(|report| report.positions[0].degrees()).collect();
    assert_eq!(first, [1, 2]);
    assert_eq!(arm.read(12, 1).unwrap(), [4]);
    let next = arm.next_report(Duration::from_secs(5)).unwrap().expect("a report came behind the answer");
    assert_eq!(next.positions[0].degrees(), 5);
    assert_eq!(arm.next_report(Duration::from_millis(20)).unwrap(), None);
}

#[test]
fn a_late_answer_is_not_taken_for_the_next() {
    let (name, _port) = answering_arm(|read, address, _| match read {
        0 => reply(0, &IDENTITY),
        // The second reply to the same read arrives too late.
        1 => [reply(address, &[1]), reply(address, &[99])].concat(),
        _ => reply(address, &[2]),
    });
    let mut arm = Arm::open_with(&name, options()).unwrap();
    assert_eq!(arm.read(53, 1).unwrap(), [1]);
    thread::sleep(Duration::from_millis(50));
    assert_eq!(arm.read(53, 1).unwrap(), [2]);
}

#[test]
fn ports_that_cannot_be_opened_give_the_reason() {
    assert!(matches!(Arm::open("/dev/no-such-port", 115_200), Err(OpenError::NotFound)));
    assert!(matches!(Arm::open("/dev/null", 115_200), Err(OpenError::Unusable(_))));
    let (name, _port) = answering_arm(|_, _, _| reply(0, &IDENTITY));
    let _first = Arm::open_with(&name, options()).unwrap();
    assert!(matches!(Arm::open_with(&name, options()), Err(OpenError::Busy)));
}

#[test]
fn a_pulled_cable_is_an_error_and_no_timeout() {
    let (mut master, slave) = TTYPort::pair().unwrap();
    let name = slave.name().unwrap();
    let answering = thread::spawn(move || {
        let mut request = [0; 7];
        master.set_timeout(Duration::from_secs(10)).unwrap();
        master.read_exact(&mut request).unwrap();
        master.write_all(&reply(0, &IDENTITY)).unwrap();
        master.read_exact(&mut request).unwrap();
    });
    let mut arm = Arm::open_with(&name, options()).unwrap();
    let lost = arm.read(0, 1).unwrap_err();
    answering.join().unwrap();
    assert!(matches!(lost, Error::Port(_)), "{lost:?}");
}

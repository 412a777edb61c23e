//! Frames as they were released, byte by byte, in both directions. Add to them; never edit one.

use protocol_core::request::{Reply, Request};
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::{Deframer, FrameBuffer, ToArm, ToHost};

const POSE: [u8; 7] = [90, 90, 65, 90, 90, 90, 80];

//                                   header      function  address  count  data and checksum
#[rustfmt::skip]
const READ_PRESENT: [u8; 7] =       [0xAA, 0x77, 0x03,     0x36,    0x07,  0x81, 0xCE];
#[rustfmt::skip]
const PRESENT: [u8; 14] =           [0xAA, 0x77, 0x03,     0x36,    0x07,  0x5A, 0x5A, 0x41, 0x5A, 0x5A, 0x5A, 0x50, 0x43, 0x81];
#[rustfmt::skip]
const UNLOCK: [u8; 8] =             [0xAA, 0x77, 0x06,     0x1C,    0x01,  0x00, 0x2C, 0xC4];
#[rustfmt::skip]
const TARGETS: [u8; 14] =           [0xAA, 0x77, 0x06,     0x2E,    0x07,  0x5A, 0x5A, 0x41, 0x5A, 0x5A, 0x5A, 0x50, 0xF9, 0x91];
#[rustfmt::skip]
const FEEDBACK_30_HZ: [u8; 8] =     [0xAA, 0x77, 0x06,     0x35,    0x01,  0x1E, 0x7D, 0x04];
#[rustfmt::skip]
const READ_NOTHING: [u8; 7] =       [0xAA, 0x77, 0x03,     0x0A,    0x00,  0xD1, 0x0C];

fn encoded(request: Request<'_>) -> FrameBuffer {
    let mut buffer = FrameBuffer::new();
    request.encode(&mut buffer);
    buffer
}

#[test]
fn d01_requests_are_built_as_released() {
    assert_eq!(encoded(Request::Read { address: 54, count: 7 }), READ_PRESENT);
    assert_eq!(encoded(Request::Read { address: 10, count: 0 }), READ_NOTHING);
    assert_eq!(encoded(Request::Write { address: 28, values: &[0] }), UNLOCK);
    assert_eq!(encoded(Request::Write { address: 46, values: &POSE }), TARGETS);
    assert_eq!(encoded(Request::Write { address: 53, values: &[30] }), FEEDBACK_30_HZ);
}

#[test]
fn d01_requests_are_understood_as_released() {
    let understood = |bytes: &[u8], expected: Request<'_>| {
        let mut deframer = Deframer::<ToArm>::new(Duration::from_millis(2));
        deframer.push(Instant::ZERO, bytes);
        let frame = deframer.pull().unwrap().unwrap();
        assert_eq!(Request::from_frame(frame), expected);
    };
    understood(&READ_PRESENT, Request::Read { address: 54, count: 7 });
    understood(&READ_NOTHING, Request::Read { address: 10, count: 0 });
    understood(&UNLOCK, Request::Write { address: 28, values: &[0] });
    understood(&TARGETS, Request::Write { address: 46, values: &POSE });
    understood(&FEEDBACK_30_HZ, Request::Write { address: 53, values: &[30] });
}

#[test]
fn d01_a_reply_is_built_and_understood_as_released() {
    let reply = Reply { address: 54, values: &POSE };
    let mut buffer = FrameBuffer::new();
    reply.encode(&mut buffer);
    assert_eq!(buffer, PRESENT);
    let mut deframer = Deframer::<ToHost>::new(Duration::from_millis(2));
    deframer.push(Instant::ZERO, &PRESENT);
    assert_eq!(Reply::from_frame(deframer.pull().unwrap().unwrap()), Some(reply));
}

#[test]
fn an_arm_never_sends_a_write() {
    let mut deframer = Deframer::<ToHost>::new(Duration::from_millis(2));
    deframer.push(Instant::ZERO, &UNLOCK);
    assert_eq!(Reply::from_frame(deframer.pull().unwrap().unwrap()), None);
}

#[test]
fn values_past_the_255th_are_cut_off() {
    let buffer = encoded(Request::Write { address: 0, values: &[1; 300] });
    assert_eq!((buffer.len(), buffer[4]), (262, 255));
}

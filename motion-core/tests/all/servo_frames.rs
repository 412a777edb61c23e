//! The frames of the servo bus: golden bytes in both directions, streams cut anywhere, noise, and damaged bytes.
//!
//! Add golden frames; never edit one.

use motion_core::servo_bus::frame::{
    Decoder, Instruction, MAX_FRAME, Reading, ServoFrame, ServoFrameBuffer, WrongChecksum, error, ping, read,
    register, status, sync_write, write,
};
use proptest::prelude::*;

fn encoded(encode: impl FnOnce(&mut ServoFrameBuffer)) -> Vec<u8> {
    let mut buffer = ServoFrameBuffer::new();
    encode(&mut buffer);
    buffer.to_vec()
}

/// What a decoder returns, as values that own their bytes.
type Said = Result<(u8, u8, Vec<u8>), WrongChecksum>;

fn pull_all(decoder: &mut Decoder, said: &mut Vec<Said>) {
    while let Some(next) = decoder.pull() {
        said.push(next.map(|ServoFrame { id, code, params }| (id, code, params.to_vec())));
    }
}

fn decoded(pieces: &[&[u8]]) -> Vec<Said> {
    let (mut decoder, mut said) = (Decoder::new(), Vec::new());
    for piece in pieces {
        decoder.push(piece);
        pull_all(&mut decoder, &mut said);
    }
    said
}

#[test]
fn every_instruction_has_its_code() {
    for instruction in [Instruction::Ping, Instruction::Read, Instruction::Write, Instruction::SyncWrite] {
        assert_eq!(Instruction::from_code(instruction as u8), Some(instruction));
    }
    assert_eq!(Instruction::from_code(0), None);
}

#[test]
fn golden_error_bits() {
    assert_eq!([error::VOLTAGE, error::OVERHEAT, error::OVERLOAD], [0x01, 0x04, 0x20]);
}

#[test]
fn golden_ping() {
    //                id    len   inst  checksum
    let bytes = [0xFF, 0xFF, 0x00, 0x02, 0x01, 0xFC];
    assert_eq!(encoded(|buffer| ping(buffer, 0)), bytes);
    assert_eq!(decoded(&[&bytes]), [Ok((0, Instruction::Ping as u8, vec![]))]);
}

#[test]
fn golden_torque_on() {
    //                id    len   inst  reg   on    checksum
    let bytes = [0xFF, 0xFF, 0x00, 0x04, 0x03, 0x28, 0x01, 0xCF];
    assert_eq!(encoded(|buffer| write(buffer, 0, register::TORQUE_SWITCH, &[1])), bytes);
    assert_eq!(decoded(&[&bytes]), [Ok((0, Instruction::Write as u8, vec![40, 1]))]);
}

#[test]
fn golden_goal() {
    //               id len inst reg position 511  time 0      speed 600   checksum
    let bytes = [0xFF, 0xFF, 0, 9, 3, 0x2A, 0x01, 0xFF, 0x00, 0x00, 0x02, 0x58, 0x6F];
    let goal: Vec<u8> = [511_u16, 0, 600].into_iter().flat_map(u16::to_be_bytes).collect();
    assert_eq!(encoded(|buffer| write(buffer, 0, register::GOAL_POSITION, &goal)), bytes);
    assert_eq!(decoded(&[&bytes]), [Ok((0, 3, vec![42, 0x01, 0xFF, 0, 0, 0x02, 0x58]))]);
}

#[test]
fn golden_read() {
    //                id    len   inst  reg   count checksum
    let bytes = [0xFF, 0xFF, 0x00, 0x04, 0x02, 0x38, 0x0F, 0xB2];
    assert_eq!(encoded(|buffer| read(buffer, 0, register::PRESENT_POSITION, 15)), bytes);
    assert_eq!(decoded(&[&bytes]), [Ok((0, Instruction::Read as u8, vec![56, 15]))]);
}

#[test]
fn golden_sync_write() {
    // Ids 0 and 1, one byte each from register 40: len = (1 + 1) x 2 + 4.
    let bytes = [0xFF, 0xFF, 0xFE, 0x08, 0x83, 0x28, 0x01, 0x00, 0x01, 0x01, 0x01, 0x4A];
    assert_eq!(
        encoded(|buffer| sync_write(buffer, register::TORQUE_SWITCH, [(0, [1]), (1, [1])].into_iter())),
        bytes
    );
    assert_eq!(decoded(&[&bytes]), [Ok((0xFE, 0x83, vec![40, 1, 0, 1, 1, 1]))]);
}

#[test]
fn a_sync_write_to_all_seven_joints_takes_57_bytes() {
    let bytes = encoded(|buffer| sync_write(buffer, register::GOAL_POSITION, (0..7).map(|id| (id, [id; 6]))));
    assert_eq!(bytes.len(), 57);
    assert_eq!(bytes[3], 53, "(6 + 1) x 7 + 4");
    assert_eq!(decoded(&[&bytes]).len(), 1);
}

#[test]
fn golden_status() {
    // Id 2 at 511 counts, 300 counts/s backwards, load 4.5 % forwards, 7.4 V, 31 degrees Celsius; overloaded.
    let bytes = [0xFF, 0xFF, 2, 0x0A, 0x20, 0x01, 0xFF, 0x81, 0x2C, 0x00, 0x2D, 0x4A, 0x1F, 0x90];
    let reading = Reading {
        position_counts: 511,
        speed: -300,
        load: 45,
        voltage_decivolts: 74,
        temperature_celsius: 31,
    };
    assert_eq!(encoded(|buffer| status(buffer, 2, error::OVERLOAD, &reading.to_bytes())), bytes);
    let said = decoded(&[&bytes]);
    assert_eq!(said, [Ok((2, error::OVERLOAD, bytes[5..13].to_vec()))]);
    assert_eq!(Reading::parse(&bytes[5..13]), Some(reading));
    // The acknowledgement of a write, and a load with its sign in bit 10.
    assert_eq!(encoded(|buffer| status(buffer, 6, 0, &[])), [0xFF, 0xFF, 6, 2, 0, 0xF7]);
    assert_eq!(Reading::parse(&[0, 0, 0, 0, 0x04, 0x2D, 0, 0]).map(|reading| reading.load), Some(-45));
}

#[test]
fn a_magnitude_past_its_field_is_cut_and_zero_has_no_sign() {
    let bytes = |speed, load| {
        let reading =
            Reading { position_counts: 0, speed, load, voltage_decivolts: 0, temperature_celsius: 0 };
        reading.to_bytes()[2..6].to_vec()
    };
    assert_eq!(bytes(0, 0), [0, 0, 0, 0]);
    assert_eq!(bytes(i16::MIN, -1_024), [0xFF, 0xFF, 0x07, 0xFF]);
    assert_eq!(bytes(i16::MAX, 1_024), [0x7F, 0xFF, 0x03, 0xFF]);
    assert_eq!(bytes(-0x7FFF, i16::MIN), [0xFF, 0xFF, 0x07, 0xFF]);
}

#[test]
fn a_failed_read_never_becomes_a_position() {
    assert_eq!(Reading::parse(&[]), None);
    assert_eq!(Reading::parse(&[1, 255, 0, 0, 0, 0, 74]), None, "too short");
    assert_eq!(Reading::parse(&[1, 255, 0, 0, 0, 0, 74, 31, 0]), None, "too long");
    assert_eq!(Reading::parse(&[0xFF, 0xFF, 0, 0, 0, 0, 74, 31]), None, "-1 is no position");
    assert_eq!(Reading::parse(&[0x04, 0x00, 0, 0, 0, 0, 74, 31]), None, "1024 is none either");
    assert!(Reading::parse(&[0x03, 0xFF, 0, 0, 0, 0, 74, 31]).is_some());
}

#[test]
fn a_wrong_checksum_does_not_cost_the_frame_behind_it() {
    let good = encoded(|buffer| ping(buffer, 3));
    let mut bad = encoded(|buffer| ping(buffer, 2));
    bad[4] ^= 0x10;
    assert_eq!(decoded(&[&bad, &good]), [Err(WrongChecksum), Ok((3, 1, vec![]))]);
    // A truncated frame takes the first bytes of the next one as its own. The decoder still finds the next one.
    assert_eq!(decoded(&[&bad[..5], &good]), [Err(WrongChecksum), Ok((3, 1, vec![]))]);
}

#[test]
fn an_impossible_length_is_no_frame() {
    let good = encoded(|buffer| ping(buffer, 3));
    for length in [0, 1, 61, 255] {
        assert_eq!(decoded(&[&[0xFF, 0xFF, 3, length], &good]), [Ok((3, 1, vec![]))], "length {length}");
    }
}

#[test]
fn an_extra_ff_before_a_frame_does_no_harm() {
    let good = encoded(|buffer| ping(buffer, 3));
    assert_eq!(decoded(&[&[0xFF], &good]), [Ok((3, 1, vec![]))]);
    assert_eq!(decoded(&[&[0xFF, 0xFF, 0xFF], &good]), [Ok((3, 1, vec![]))]);
}

#[test]
fn what_does_not_fit_a_frame_is_left_out_whole() {
    assert_eq!(encoded(|buffer| write(buffer, 0, 0, &[7; 57])).len(), MAX_FRAME);
    assert_eq!(encoded(|buffer| write(buffer, 0, 0, &[7; 58])).len(), 7, "register only");
    assert_eq!(encoded(|buffer| status(buffer, 0, 0, &[7; 58])).len(), MAX_FRAME);
    assert_eq!(encoded(|buffer| sync_write(buffer, 0, (0..40).map(|id| (id, [7; 6])))).len(), 64);
    assert_eq!(encoded(|buffer| sync_write(buffer, 0, (0..40).map(|id| (id, [7; 2])))).len(), 62, "18 items");
}

#[test]
fn a_decoder_that_nobody_pulls_keeps_the_newest_bytes() {
    let mut decoder = Decoder::new();
    for id in 0..100 {
        decoder.push(&encoded(|buffer| ping(buffer, id)));
    }
    let mut said = Vec::new();
    pull_all(&mut decoder, &mut said);
    let kept = (79..100).map(|id| Ok((id, 1, vec![]))).collect::<Vec<Said>>();
    assert_eq!(said, kept, "128 bytes hold 21 pings and a piece of one");
}

#[test]
fn nothing_is_left_after_a_clear() {
    let (mut decoder, mut said) = (Decoder::new(), Vec::new());
    let frame = encoded(|buffer| ping(buffer, 3));
    decoder.push(&frame[..4]);
    decoder.clear();
    decoder.push(&frame[4..]);
    pull_all(&mut decoder, &mut said);
    assert_eq!(said, []);
}

prop_compose! {
    /// A good frame, a damaged one, or noise rich in headers.
    fn stretch()(kind in 0..4, id in 0..=0xFE_u8, code: u8, params in prop::collection::vec(any::<u8>(), 0..=58),
                 noise in prop::collection::vec(prop_oneof![Just(0xFF), 0..8_u8, any::<u8>()], 0..12),
                 at in 0..16_usize, flip in 1..=255_u8) -> Vec<u8> {
        let mut frame = encoded(|buffer| status(buffer, id, code, &params));
        if let (1, Some(byte)) = (kind, frame.get_mut(at)) {
            *byte ^= flip;
        }
        if kind == 0 { noise } else { frame }
    }
}

proptest! {
    #[test]
    fn any_cut_of_a_stream_gives_the_same_frames(
        stream in prop::collection::vec(stretch(), 0..12),
        cuts in prop::collection::vec(1..=MAX_FRAME, 1..50),
    ) {
        let stream = stream.concat();
        let whole: Vec<&[u8]> = stream.chunks(1).collect();
        let (mut pieces, mut rest) = (Vec::new(), stream.as_slice());
        for cut in cuts.iter().cycle() {
            let (piece, tail) = rest.split_at(rest.len().min(*cut));
            pieces.push(piece);
            rest = tail;
            if rest.is_empty() { break; }
        }
        prop_assert_eq!(decoded(&pieces), decoded(&whole));
    }

    #[test]
    fn any_bytes_are_survived(pieces in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..300), 0..8)) {
        let mut decoder = Decoder::new();
        for piece in &pieces {
            decoder.push(piece);
            pull_all(&mut decoder, &mut Vec::new());
        }
    }

    #[test]
    fn parse_after_encode_is_identity(
        id in 0..=0xFE_u8, code: u8, params in prop::collection::vec(any::<u8>(), 0..=58),
    ) {
        let bytes = encoded(|buffer| status(buffer, id, code, &params));
        prop_assert_eq!(decoded(&[&bytes]), [Ok((id, code, params))]);
    }

    #[test]
    fn a_reading_survives_its_bytes(
        position_counts in 0..=1023_u16, speed in -0x7FFF..=0x7FFF_i16, load in -1023..=1023_i16,
        voltage_decivolts: u8, temperature_celsius: u8,
    ) {
        let reading = Reading { position_counts, speed, load, voltage_decivolts, temperature_celsius };
        prop_assert_eq!(Reading::parse(&reading.to_bytes()), Some(reading));
    }
}

/// Two frames with damage at two places. A frame that damage splits is lost. So is a frame between the two places, unless the
/// first place is the start, or the decoder was pulled before the second damage.
#[test]
fn no_frame_continues_across_damage() {
    let stream = [encoded(|buffer| ping(buffer, 1)), encoded(|buffer| ping(buffer, 2))].concat();
    let ids = |said: &[Said]| {
        said.iter().filter_map(|said| said.as_ref().ok().map(|frame| frame.0)).collect::<Vec<_>>()
    };
    for (first, last) in (0..=12).flat_map(|first| (first..=12).map(move |last| (first, last))) {
        for is_pulled in [false, true] {
            let (mut decoder, mut said) = (Decoder::new(), Vec::new());
            decoder.push(&stream[..first]);
            decoder.push_damaged();
            if is_pulled {
                pull_all(&mut decoder, &mut said);
            }
            decoder.push(&stream[first..last]);
            decoder.push_damaged();
            decoder.push(&stream[last..]);
            pull_all(&mut decoder, &mut said);
            let is_split = |start: usize| [first, last].iter().any(|at| (start + 1..start + 6).contains(at));
            let is_between = |start: usize| !is_pulled && first > 0 && first <= start && start + 6 <= last;
            let whole = |start| !is_split(start) && !is_between(start);
            let expected: Vec<u8> =
                [(1, 0), (2, 6)].into_iter().filter(|(_, at)| whole(*at)).map(|(id, _)| id).collect();
            assert_eq!(ids(&said), expected, "damage at {first} and {last}, pulled between: {is_pulled}");
        }
    }
}

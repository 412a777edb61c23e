//! What the deframer finds in streams of bytes that are damaged or cut anywhere (D1 to D5).

use crate::stream::{self, Event, GAP_US, LONG_SILENCE_US, Model, Received, frame, receive};
use proptest::prelude::*;
use protocol_core::time::Instant;
use protocol_core::wire::frame::{Defect, ParseOutcome, parse};
use protocol_core::wire::{Deframer, MAX_LENGTH, ToArm, ToHost, deframer};

/// A part of a stream that is likely to cause errors, such as a whole or nested frame, a piece of a frame, a header without
/// its data, a range past address 255, or noise rich in header bytes.
fn stretch() -> impl Strategy<Value = Vec<u8>> {
    let noise = prop_oneof![Just(0xAA_u8), Just(0x77), Just(0x06), Just(0x04), Just(0x03), any::<u8>()];
    let function = prop_oneof![Just(3), Just(4), Just(6)];
    let whole = (function, any::<u8>(), proptest::collection::vec(any::<u8>(), 0..12))
        .prop_map(|(function, address, data)| frame(function, address, &data));
    prop_oneof![
        4 => whole.clone(),
        2 => (whole.clone(), any::<proptest::sample::Index>()).prop_map(|(bytes, cut)| {
            let length = cut.index(bytes.len());
            bytes[..length].to_vec()
        }),
        1 => (whole, any::<proptest::sample::Index>(), any::<u8>()).prop_map(|(mut bytes, place, value)| {
            let place = place.index(bytes.len());
            bytes[place] = value;
            bytes
        }),
        1 => (prop_oneof![Just(4), Just(6)], any::<u8>(), any::<u8>())
            .prop_map(|(function, address, count)| vec![0xAA, 0x77, function, address, count]),
        1 => proptest::collection::vec(noise, 1..20),
        1 => Just(stream::raw_frame(6, 250, 7, &[1; 7])),
        // A frame inside the data of another one.
        1 => any::<u8>().prop_map(|address| frame(6, address, &frame(3, 54, &[]))),
        // A frame whose last byte is the first byte of a header.
        1 => Just(stream::frame_ending_in_aa()),
    ]
}

fn stretches() -> impl Strategy<Value = Vec<u8>> {
    proptest::collection::vec(stretch(), 1..24).prop_map(|stretches| stretches.concat())
}

fn events() -> impl Strategy<Value = Vec<Event>> {
    let silence = prop_oneof![Just(500), Just(GAP_US), Just(20_000), Just(LONG_SILENCE_US)];
    let event = prop_oneof![3 => stretch().prop_map(Event::Bytes), 1 => silence.prop_map(Event::Silence)];
    proptest::collection::vec(event, 1..24)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn d03_d04_the_deframer_agrees_with_a_slow_and_obvious_model(events in events()) {
        let mut model = Model::default();
        let expected: Vec<Received> = events.iter().flat_map(|event| model.take(event)).collect();
        prop_assert_eq!(receive::<ToArm>(&events, MAX_LENGTH), expected);
    }

    #[test]
    fn d03_any_cutting_of_a_stream_gives_the_same_frames(events in events(), piece in 1_usize..40) {
        prop_assert_eq!(receive::<ToArm>(&events, piece), receive::<ToArm>(&events, MAX_LENGTH));
        prop_assert_eq!(receive::<ToHost>(&events, piece), receive::<ToHost>(&events, MAX_LENGTH));
    }

    #[test]
    fn nothing_comes_out_before_as_many_bytes_came_as_were_wanted(bytes in stretches()) {
        let mut deframer = Deframer::<ToArm>::new(deframer::gap(115_200));
        for byte in bytes {
            let wanted = deframer.wanted();
            prop_assert!((1..=MAX_LENGTH).contains(&wanted));
            deframer.push(Instant::ZERO, &[byte]);
            prop_assert!(deframer.pull().is_none() || wanted == 1);
            while deframer.pull().is_some() {}
        }
    }

    #[test]
    fn any_bytes_are_survived(bytes in proptest::collection::vec(any::<u8>(), 0..2_000), piece in 1_usize..300) {
        let events = [Event::Bytes(bytes), Event::Silence(GAP_US), Event::Silence(LONG_SILENCE_US)];
        receive::<ToArm>(&events, piece);
        receive::<ToHost>(&events, piece);
    }
}

#[test]
fn d01_the_longest_frame_passes() {
    let longest = frame(6, 1, &[0x55; 255]);
    assert_eq!((longest.len(), MAX_LENGTH), (262, 262));
    let received = receive::<ToArm>(&[Event::Bytes(longest.clone())], 7);
    assert_eq!(received, [Received::Frame(longest)]);
}

#[test]
fn a_frame_is_parsed_without_a_stream() {
    let bytes = [frame(6, 46, &[1, 2]), vec![9]].concat();
    let ParseOutcome::Complete(parsed, length) = parse::<ToArm>(&bytes) else { panic!("{bytes:?}") };
    assert_eq!((length, parsed.address, parsed.data), (9, 46, [1, 2].as_slice()));
    assert_eq!(parse::<ToArm>(&bytes[..8]), ParseOutcome::Incomplete(9));
    assert_eq!(parse::<ToArm>(&bytes[1..]), ParseOutcome::NotAFrame);
    let mut damaged = bytes.clone();
    damaged[6] ^= 1;
    assert_eq!(parse::<ToArm>(&damaged), ParseOutcome::Defective(Defect::WrongCrc, 9));
    let malformed = stream::raw_frame(6, 255, 2, &[1, 2]);
    let defect = Defect::MalformedRange { address: 255 };
    assert_eq!(parse::<ToArm>(&malformed), ParseOutcome::Defective(defect, 9));
}

#[test]
fn the_beginning_of_a_frame_is_distinguished_from_other_bytes() {
    let beginning = [0xAA, 0x77, 6, 46];
    for length in 0..=beginning.len() {
        let outcome = parse::<ToArm>(&beginning[..length]);
        assert_eq!(outcome, ParseOutcome::Incomplete(7), "{length} bytes");
    }
    for wrong in [
        [0xAB].as_slice(),
        &[0xAA, 0x78],
        &[0xAA, 0x77, 5],
        &[0xAA, 0x77, 8],
        &[0xAA, 0x78, 6],
        &[0xAB, 0x77, 6, 46],
    ] {
        assert_eq!(parse::<ToArm>(wrong), ParseOutcome::NotAFrame, "{wrong:?}");
    }
}

#[test]
fn d02_a_range_may_end_at_255_and_not_behind() {
    let last = stream::raw_frame(6, 255, 1, &[1]);
    assert_eq!(receive::<ToArm>(&[Event::Bytes(last.clone())], 9), [Received::Frame(last)]);
    let read = stream::raw_frame(3, 255, 2, &[]);
    assert_eq!(receive::<ToArm>(&[Event::Bytes(read)], 9), [Received::MalformedRange(255)]);
    let inner = frame(3, 54, &[]);
    let outer = stream::raw_frame(6, 250, 7, &inner);
    assert_eq!(
        receive::<ToArm>(&[Event::Bytes(outer)], 99),
        [Received::MalformedRange(250), Received::Frame(inner)],
        "it is not well formed, so what it holds is not inside a well-formed frame"
    );
}

#[test]
fn d02_what_a_malformed_frame_holds_is_searched_like_any_bytes() {
    // The range is 170 to 288. Its address and count, AA 77, are also the header of a frame with a wrong CRC.
    let malformed = stream::raw_frame(6, 0xAA, 0x77, &[3; 0x77]);
    assert!(malformed[3..].starts_with(&[0xAA, 0x77, 3, 3, 3]));
    let expected = [Received::MalformedRange(0xAA), Received::WrongCrc];
    assert_eq!(receive::<ToArm>(&[Event::Bytes(malformed)], 99), expected);
}

#[test]
fn d03_a_frame_inside_a_good_frame_is_data() {
    let outer = frame(6, 46, &frame(3, 54, &[]));
    assert_eq!(receive::<ToArm>(&[Event::Bytes(outer.clone())], 3), [Received::Frame(outer)]);
}

#[test]
fn d03_a_frame_lends_its_end_to_the_next_one() {
    let next = frame(3, 54, &[]);
    // Different pairs of bytes have different checksums, so one pair has the checksum AA 77.
    let pairs = (0..=u16::MAX).map(|pair| frame(6, 0, &pair.to_le_bytes()));
    let ending_in_header = pairs.into_iter().find(|bytes| bytes.ends_with(&[0xAA, 0x77])).unwrap();
    let mut shortest = (0..=255).map(|count| stream::raw_frame(3, 0, count, &[]));
    let shortest = shortest.find(|bytes| bytes.ends_with(&[0xAA])).unwrap();
    for (whole, lent) in [(ending_in_header, 2), (stream::frame_ending_in_aa(), 1), (shortest, 1)] {
        let bytes = [&whole[..whole.len() - lent], &next].concat();
        let expected = [Received::Frame(whole), Received::Frame(next.clone())];
        assert_eq!(receive::<ToArm>(&[Event::Bytes(bytes.clone())], 1), expected, "{lent} lent");
        let behind_a_head = [&[0xAA, 0x77, 6, 0x10, 0xFF], bytes.as_slice()].concat();
        let events = [Event::Bytes(behind_a_head), Event::Silence(GAP_US)];
        assert_eq!(receive::<ToArm>(&events, 99), expected, "{lent} lent, behind a head");
    }
}

#[test]
fn d05_a_stream_longer_than_the_buffer_loses_nothing_however_it_is_cut() {
    let good = frame(3, 54, &[]);
    let false_header = [0xAA, 0x77, 6, 0x10, 0xFF].to_vec();
    let bytes = [false_header, good.repeat(100)].concat();
    let frames = std::iter::repeat_n(Received::Frame(good), 100);
    let expected: Vec<_> = std::iter::once(Received::WrongCrc).chain(frames).collect();
    for piece in [1, 2, 7, 40, 262, 300] {
        assert_eq!(receive::<ToArm>(&[Event::Bytes(bytes.clone())], piece), expected, "pieces of {piece}");
    }
}

/// A byte with a framing error belongs to no frame (D3). Only the frame around this byte is lost.
#[test]
fn d03_no_frame_continues_across_a_damaged_byte() {
    let frames = [frame(6, 46, &[1]), frame(6, 46, &[2]), frame(6, 46, &[3])];
    let (length, bytes) = (frames[0].len(), frames.concat());
    for cut in 0..=bytes.len() {
        let mut deframer = Deframer::<ToArm>::new(deframer::gap(115_200));
        let mut received = Vec::new();
        let (before, behind) = bytes.split_at(cut);
        assert_eq!(deframer.push(Instant::ZERO, before), cut);
        deframer.break_off();
        stream::drain(&mut deframer, &mut received);
        assert_eq!(deframer.push(Instant::ZERO, behind), behind.len());
        stream::drain(&mut deframer, &mut received);
        let is_split = |index: &usize| (index * length + 1..(index + 1) * length).contains(&cut);
        let whole =
            (0..3).filter(|index| !is_split(index)).map(|index| Received::Frame(frames[index].clone()));
        let found: Vec<_> = received.into_iter().filter(|found| *found != Received::WrongCrc).collect();
        assert_eq!(found, whole.collect::<Vec<_>>(), "damage after {cut} bytes");
    }
}

#[test]
fn d03_a_frame_in_the_data_of_a_broken_one_comes_out_at_once() {
    let inner = frame(6, 46, &[90; 7]);
    let mut deframer = Deframer::<ToArm>::new(deframer::gap(115_200));
    deframer.push(Instant::ZERO, &[&[0xAA, 0x77, 6, 0x10, 0xFF], inner.as_slice()].concat());
    deframer.break_off();
    assert_eq!(deframer.push(Instant::ZERO, &[1]), 0, "pull first");
    assert_eq!(stream::pull(&mut deframer), Some(Received::Frame(inner)));
    assert_eq!(stream::pull(&mut deframer), None);
}

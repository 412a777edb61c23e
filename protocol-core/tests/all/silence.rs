//! What the deframer does when the line is silent, inside a frame or behind one (D4, D5).

use crate::stream::{self, Event, GAP_US, LONG_SILENCE_US, Received, frame, receive};
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::{Deframer, ToArm, deframer};

#[test]
fn d04_a_false_header_holds_nothing_up_for_longer_than_the_gap() {
    let good = frame(3, 54, &[]);
    let mut bytes = vec![0xAA, 0x77, 6, 0x10, 0xFF];
    bytes.extend(&good);
    let mut events = vec![Event::Bytes(bytes)];
    assert_eq!(receive::<ToArm>(&events, 99), []);
    events.push(Event::Silence(GAP_US));
    assert_eq!(receive::<ToArm>(&events, 99), [Received::Frame(good)]);
}

#[test]
fn d04_a_pause_inside_a_frame_costs_nothing() {
    let good = frame(6, 46, &[90; 7]);
    for cut in 1..good.len() {
        let (head, tail) = good.split_at(cut);
        let paused = [Event::Bytes(head.to_vec()), Event::Silence(99_000), Event::Bytes(tail.to_vec())];
        assert_eq!(receive::<ToArm>(&paused, 99), [Received::Frame(good.clone())]);
        let too_long = [Event::Bytes(head.to_vec()), Event::Silence(100_000), Event::Bytes(tail.to_vec())];
        assert_eq!(receive::<ToArm>(&too_long, 99), [], "cut at {cut}");
    }
}

#[test]
fn d04_a_pause_inside_a_frame_makes_no_damage_of_its_data() {
    let data = [0xAA, 0x77, 3, 3, 3, 3, 3, 3];
    let good = frame(6, 46, &data);
    for cut in 12..good.len() {
        let (head, tail) = good.split_at(cut);
        let silence = [Event::Bytes(head.to_vec()), Event::Silence(GAP_US)];
        assert_eq!(receive::<ToArm>(&silence, 99), [], "cut at {cut}");
        let [head, silence] = silence;
        let whole = [head.clone(), silence.clone(), Event::Bytes(tail.to_vec())];
        assert_eq!(receive::<ToArm>(&whole, 99), [Received::Frame(good.clone())], "cut at {cut}");
        let abandoned = [head, silence, Event::Silence(LONG_SILENCE_US)];
        assert_eq!(
            receive::<ToArm>(&abandoned, 99),
            [Received::WrongCrc],
            "counted once, when it is no data"
        );
    }
}

#[test]
fn d04_the_gap_is_2_ms_or_three_and_a_half_characters() {
    assert_eq!(deframer::gap(1_000_000), Duration::from_micros(2_000));
    assert_eq!(deframer::gap(19_200), Duration::from_micros(2_000));
    assert_eq!(deframer::gap(9_600), Duration::from_micros(3_645));
    assert_eq!(deframer::gap(0), Duration::from_micros(u32::MAX.into()));
}

#[test]
fn a_held_up_shell_does_not_mistake_its_own_pause_for_silence() {
    let good = frame(6, 46, &[90; 7]);
    let (head, tail) = good.split_at(8);
    let mut deframer = Deframer::<ToArm>::new(deframer::gap(115_200));
    deframer.push(Instant::from_micros(0), head);
    assert_eq!(deframer.pull(), None);
    deframer.push(Instant::from_micros(5_000_000), tail);
    assert!(matches!(deframer.pull(), Some(Ok(_))), "nobody saw the line silent");
}

#[test]
fn the_deadline_says_when_silence_matters() {
    let at = Instant::from_micros;
    let mut deframer = Deframer::<ToArm>::new(deframer::gap(115_200));
    assert_eq!(deframer.deadline(), None);
    deframer.push(at(1_000), &[0xAA, 0x77]);
    assert_eq!(deframer.pull(), None);
    assert_eq!(deframer.deadline(), Some(at(3_000)));
    deframer.push(at(3_000), &[]);
    assert_eq!(deframer.pull(), None);
    assert_eq!(deframer.deadline(), Some(at(101_000)));
    deframer.push(at(101_000), &[]);
    assert_eq!(deframer.pull(), None);
    assert_eq!(deframer.deadline(), None);
    deframer.push(at(102_000), &frame(3, 54, &[]));
    assert!(deframer.pull().is_some());
    assert_eq!(deframer.pull(), None);
    assert_eq!(deframer.deadline(), None, "nothing of it is left");
}

#[test]
fn what_is_wanted_is_the_rest_of_the_frame() {
    let mut deframer = Deframer::<ToArm>::new(deframer::gap(115_200));
    let bytes = [frame(3, 54, &[]), frame(6, 46, &[90; 7])].concat();
    let mut wanted = Vec::new();
    for byte in bytes {
        wanted.push(deframer.wanted());
        deframer.push(Instant::ZERO, &[byte]);
        let _ = deframer.pull();
    }
    assert_eq!(wanted, [7, 6, 5, 4, 3, 2, 1, 7, 6, 5, 4, 3, 2, 1, 7, 6, 5, 4, 3, 2, 1]);
    deframer.push(Instant::from_micros(0), &[0xAA]);
    deframer.push(Instant::from_micros(LONG_SILENCE_US), &[]);
    assert_eq!(deframer.wanted(), 0, "silence is news by itself");
}

#[test]
fn d05_silence_counts_even_while_nobody_pulls() {
    let at = Instant::from_micros;
    let good = frame(6, 46, &[90; 7]);
    let mut deframer = Deframer::<ToArm>::new(deframer::gap(115_200));
    // Two silences in a row: the second must not replace the first.
    for (number, part) in (0..).zip(good.chunks(6)) {
        let now = at(number * LONG_SILENCE_US);
        deframer.push(now, &[]);
        assert_eq!(deframer.push(now, part), if number == 0 { part.len() } else { 0 });
    }
    assert_eq!(deframer.pull(), None);
    assert_eq!(deframer.push(at(LONG_SILENCE_US), &good), good.len(), "what came before is done with");
    assert!(matches!(deframer.pull(), Some(Ok(_))));
}

#[test]
fn d05_a_silence_during_a_search_behind_a_head_tells_nothing_twice() {
    let at = |gaps| Instant::from_micros(gaps * GAP_US);
    let frames = [frame(3, 54, &[]), frame(6, 46, &[1]), frame(6, 46, &[2])];
    let mut deframer = Deframer::<ToArm>::new(deframer::gap(115_200));
    deframer.push(at(0), &[&[0xAA, 0x77, 6, 0x10, 0xFF], frames[0].as_slice(), &frames[1]].concat());
    deframer.push(at(1), &[]);
    let mut received: Vec<_> = stream::pull(&mut deframer).into_iter().collect();
    deframer.push(at(1), &frames[2]);
    for gaps in 2..4 {
        deframer.push(at(gaps), &[]);
        stream::drain(&mut deframer, &mut received);
    }
    assert_eq!(received, frames.map(Received::Frame));
}

#[test]
fn d05_a_search_behind_a_head_goes_on_where_it_stopped() {
    let at = Instant::from_micros;
    let inner = [frame(3, 54, &[]), frame(6, 46, &[1]), frame(6, 46, &[2])];
    let spoiled = |checksum: u8| {
        let mut bytes = stream::raw_frame(6, 0, 23, &inner.concat());
        bytes[28] ^= checksum;
        bytes
    };
    // The head turns out to be wrong, or right, after one of three frames behind it was returned.
    for (checksum, expected) in [(1, 2), (0, 1)] {
        let outer = spoiled(checksum);
        let mut deframer = Deframer::<ToArm>::new(deframer::gap(115_200));
        deframer.push(at(0), &outer[..29]);
        deframer.push(at(GAP_US), &[]);
        assert!(matches!(deframer.pull(), Some(Ok(told)) if told.address == 54));
        deframer.push(at(GAP_US), &outer[29..]);
        let mut received = Vec::new();
        stream::drain(&mut deframer, &mut received);
        received.retain(|said| matches!(said, Received::Frame(_)));
        assert_eq!(received.len(), expected, "{received:?}");
    }
}

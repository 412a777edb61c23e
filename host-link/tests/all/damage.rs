//! Damaged frames: a read whose reply is one of them is repeated at once.

use host_link::{HostEvent, Patience};
use protocol_core::registers::Map;

use crate::common::{PATIENCE, at_ms, events, in_time, link, next_after_silence, replied, reply, sent, span};

/// A reply to a read of registers 29 to 31 whose checksum is wrong.
fn damaged() -> Vec<u8> {
    let mut frame = reply(29, &[1, 2, 3]);
    frame[6] ^= 1;
    frame
}

#[test]
fn a_damaged_reply_is_asked_for_again_at_once_and_so_are_its_repeats() {
    let mut link = link(115_200);
    let id = link.read(span(29, 3), PATIENCE);
    assert_eq!(sent(&mut link, at_ms(0)), (29, 3));
    for (when, count) in [(2, 4), (4, 5), (6, 6)] {
        link.bytes(at_ms(when), &damaged());
        let (happened, _) = events(&mut link, at_ms(when));
        let [HostEvent::Damaged(_), HostEvent::Send(frame)] = happened.as_slice() else {
            panic!("{when} ms: {happened:?}")
        };
        assert_eq!(frame[3..5], [29, count]);
    }
    link.bytes(at_ms(8), &reply(29, &[1, 2, 3, 4, 5, 6]));
    assert_eq!(events(&mut link, at_ms(8)).0, [replied(id, 29, &[1, 2, 3])]);
}

#[test]
fn damaged_frames_repeat_a_read_once_for_each_reply_that_is_due() {
    let mut link = link(115_200);
    link.read(span(29, 3), PATIENCE);
    sent(&mut link, at_ms(0));
    link.bytes(at_ms(2), &[damaged(), damaged()].concat());
    let (happened, _) = events(&mut link, at_ms(2));
    assert!(
        matches!(happened.as_slice(), [HostEvent::Damaged(_), HostEvent::Damaged(_), HostEvent::Send(_)]),
        "{happened:?}"
    );
    link.bytes(at_ms(3), &damaged());
    let (happened, _) = events(&mut link, at_ms(3));
    assert!(matches!(happened.as_slice(), [HostEvent::Damaged(_)]), "the repeat is due later: {happened:?}");
}

#[test]
fn a_damaged_late_reply_repeats_nothing_while_a_repeat_is_on_its_way() {
    let mut link = link(115_200);
    link.read(span(29, 3), PATIENCE);
    sent(&mut link, at_ms(0));
    let (repeated, when) = next_after_silence(&mut link, at_ms(0));
    assert!(matches!(repeated.as_slice(), [HostEvent::Send(_)]), "{repeated:?}");
    link.bytes(when, &damaged());
    let (happened, _) = events(&mut link, when);
    assert!(matches!(happened.as_slice(), [HostEvent::Damaged(_)]), "{happened:?}");
}

#[test]
fn a_damaged_reply_does_not_lengthen_the_time_to_the_next_repeat() {
    let mut link = link(115_200);
    in_time(&mut link);
    link.read(span(29, 3), PATIENCE);
    sent(&mut link, at_ms(800));
    for when in [802, 804, 806] {
        link.bytes(at_ms(when), &damaged());
        assert_eq!(events(&mut link, at_ms(when)).0.len(), 2);
    }
    let (repeated, when) = next_after_silence(&mut link, at_ms(806));
    assert!(matches!(repeated.as_slice(), [HostEvent::Send(_)]), "{repeated:?}");
    assert!(when < at_ms(813), "{when:?}");
}

#[test]
fn the_first_of_two_reads_is_repeated_if_its_reply_is_damaged_and_not_behind_a_write() {
    for writes in [0, 1] {
        let mut link = link(115_200);
        let (first, second) = (link.read(span(29, 3), PATIENCE), link.read(span(240, 16), PATIENCE));
        (0..writes).for_each(|_| link.write(Map::V22, 29, &[2]));
        assert_eq!(events(&mut link, at_ms(0)).0.len(), 2 + writes);
        link.bytes(at_ms(2), &damaged());
        let (happened, _) = events(&mut link, at_ms(2));
        assert_eq!(happened.len(), 2 - writes, "no read is repeated behind a write: {happened:?}");
        link.bytes(at_ms(5), &reply(240, &[9; 16]));
        let (happened, _) = events(&mut link, at_ms(5));
        let lost = (writes == 1).then_some(HostEvent::NoReply(first, span(29, 3)));
        let ends: Vec<_> = lost.into_iter().chain([replied(second, 240, &[9; 16])]).collect();
        assert_eq!(happened, ends);
    }
}

#[test]
fn a_damaged_frame_before_the_reply_is_due_is_another_one() {
    let mut link = link(115_200);
    let id = link.read(span(29, 3), PATIENCE);
    assert_eq!(sent(&mut link, at_ms(0)), (29, 3));
    link.bytes(at_ms(1), &damaged());
    assert!(matches!(events(&mut link, at_ms(1)).0.as_slice(), [HostEvent::Damaged(_)]));
    let (repeated, when) = next_after_silence(&mut link, at_ms(1));
    assert!(matches!(repeated.as_slice(), [HostEvent::Send(_)]), "{repeated:?}");
    assert!((100..105).contains(&(when.as_micros() / 1_000)), "{when:?}");
    link.bytes(when, &reply(29, &[1, 2, 3]));
    assert_eq!(events(&mut link, when).0, [replied(id, 29, &[1, 2, 3])], "a late reply is one");
}

#[test]
fn a_damaged_frame_beside_the_reply_costs_a_needless_read_and_no_reply() {
    let mut link = link(115_200);
    let patience = Patience { attempts: 1, ..PATIENCE };
    for (now, patience, repeats) in [(0, PATIENCE, 1), (50, patience, 0)] {
        let id = link.read(span(29, 3), patience);
        let (_, count) = sent(&mut link, at_ms(now));
        link.bytes(at_ms(now + 2), &damaged());
        let (happened, _) = events(&mut link, at_ms(now + 2));
        assert_eq!(happened.len(), 1 + repeats, "a read with one attempt is not repeated: {happened:?}");
        link.bytes(at_ms(now + 3), &reply(29, &vec![7; usize::from(count)]));
        assert_eq!(events(&mut link, at_ms(now + 3)).0, [replied(id, 29, &[7; 3])]);
    }
}

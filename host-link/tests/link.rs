//! A link in virtual time: lost, damaged and late replies, reports, the order of requests, and a reset.

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::panic)] // A panic is a failed test.

use host_link::{HostEvent, HostLink, LinkOptions, Patience, RequestId, Snapshot, Span};
use protocol_core::registers::Map;
use protocol_core::request::Reply;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::FrameBuffer;

const PATIENCE: Patience = Patience { attempts: 3, timeout: Duration::from_millis(500) };
const POSITIONS: Span = Span::of(&protocol_core::registers::map::PRESENT_POSITION);

fn link(baud: u32) -> HostLink {
    HostLink::new(LinkOptions { baud, reports: &[POSITIONS] })
}

fn at_ms(millis: u64) -> Instant {
    Instant::from_micros(millis * 1_000)
}

fn span(address: u8, count: u8) -> Span {
    Span::new(address, count).expect("a span")
}

fn reply(address: u8, values: &[u8]) -> Vec<u8> {
    let mut frame = FrameBuffer::new();
    Reply { address, values }.encode(&mut frame);
    frame.to_vec()
}

/// The events until the link waits, and the time until which it waits.
fn events(link: &mut HostLink, now: Instant) -> (Vec<HostEvent>, Instant) {
    let mut events = Vec::new();
    loop {
        match link.poll(now) {
            HostEvent::Wait(until) => return (events, until),
            event => events.push(event),
        }
    }
}

/// The address and the count in the only frame that is sent now.
fn sent(link: &mut HostLink, now: Instant) -> (u8, u8) {
    match events(link, now).0.as_slice() {
        [HostEvent::Send(frame)] => (frame[3], frame[4]),
        other => panic!("{other:?}"),
    }
}

/// Lets the line be silent until the link's deadline. Returns the events at that time, and the time.
fn next_after_silence(link: &mut HostLink, now: Instant) -> (Vec<HostEvent>, Instant) {
    let (events_now, until) = events(link, now);
    assert_eq!(events_now, []);
    link.bytes(until, &[]);
    (events(link, until).0, until)
}

fn replied(id: RequestId, address: u8, values: &[u8]) -> HostEvent {
    HostEvent::Reply(id, Snapshot { address, values: values.to_vec() })
}

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

/// The registers that an arm sends as the reply to this read.
fn answered(request: &[u8]) -> Vec<u8> {
    reply(request[3], &vec![7; usize::from(request[4])])
}

#[test]
fn a_read_of_all_registers_is_answered_at_once_after_one_that_lost_a_reply() {
    for is_damaged in [false, true] {
        let mut link = link(115_200);
        let (all, mut now) = (span(0, 255), at_ms(0));
        let mut is_lost = true;
        for turn in 0..20 {
            let id = link.read(all, PATIENCE);
            let (mut is_answered, start) = (false, now);
            while !is_answered {
                let (happened, until) = events(&mut link, now);
                if happened.is_empty() {
                    now = until;
                    link.bytes(now, &[]);
                }
                for event in happened {
                    match event {
                        HostEvent::Send(request) => {
                            let mut reply = answered(&request);
                            now = now + Duration::from_micros(87 * (7 + reply.len() as u64) + 300);
                            match (std::mem::take(&mut is_lost), is_damaged) {
                                (true, true) => reply[100] ^= 1,
                                (true, false) => continue,
                                _ => {}
                            }
                            link.bytes(now, &reply);
                        }
                        HostEvent::Reply(replied, _) => is_answered = replied == id,
                        HostEvent::Damaged(_) | HostEvent::Unmatched(..) => {}
                        other => panic!("{other:?}"),
                    }
                }
            }
            let took = (now - start).as_micros() / 1_000;
            let most = [160, 40, 25][turn.min(2)];
            assert!(took <= most, "turn {turn} took {took} ms, a reply was damaged: {is_damaged}");
        }
    }
}

#[test]
fn a_read_of_all_registers_ends_although_no_marker_is_answered() {
    let mut link = link(115_200);
    let patience = Patience { attempts: 1, timeout: Duration::from_millis(500) };
    let (mut now, mut ended) = (at_ms(0), Vec::new());
    for _ in 0..2 {
        let id = link.read(span(0, 255), patience);
        while !ended.contains(&id) {
            let (happened, until) = events(&mut link, now);
            ended.extend(happened.into_iter().filter_map(|event| match event {
                HostEvent::NoReply(id, _) => Some(id),
                _ => None,
            }));
            if !ended.contains(&id) {
                now = until;
                link.bytes(now, &[]);
            }
        }
    }
    // The second read begins 0.3 s later, after three markers.
    assert!((at_ms(1_300)..at_ms(1_500)).contains(&now), "{now:?}");
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

/// Forty reads in 800 ms, whose replies come in time.
fn in_time(link: &mut HostLink) {
    for turn in 0..40 {
        link.read(span(29, 3), PATIENCE);
        sent(link, at_ms(turn * 20));
        link.bytes(at_ms(turn * 20 + 2), &reply(29, &[1, 2, 3]));
        events(link, at_ms(turn * 20 + 2));
    }
}

#[test]
fn a_lost_reply_costs_little_on_a_line_that_is_in_time_and_several_are_no_error() {
    let mut link = link(115_200);
    in_time(&mut link);
    let (start, id) = (at_ms(800), link.read(span(29, 3), PATIENCE));
    sent(&mut link, start);
    let (mut now, mut times) = (start, Vec::new());
    for _ in 0..5 {
        let (repeated, when) = next_after_silence(&mut link, now);
        assert!(matches!(repeated.as_slice(), [HostEvent::Send(_)]), "{repeated:?}");
        now = when;
        times.push((when - start).as_micros() / 1_000);
    }
    assert!(times[0] < 7, "one lost reply: {times:?}");
    assert!(times[4] < 150, "more than three: {times:?}");
    link.bytes(now, &reply(29, &[1, 2, 3]));
    assert_eq!(events(&mut link, now).0, [replied(id, 29, &[1, 2, 3])]);
}

#[test]
fn a_silent_arm_gets_all_the_time() {
    let mut link = link(115_200);
    let id = link.read(span(29, 3), PATIENCE);
    sent(&mut link, at_ms(0));
    let (mut now, mut times) = (at_ms(0), Vec::new());
    let end = loop {
        let (happened, when) = next_after_silence(&mut link, now);
        now = when;
        times.push(when.as_micros() / 1_000);
        if let [HostEvent::NoReply(lost, range)] = happened.as_slice() {
            break (*lost, *range);
        }
    };
    assert_eq!(end, (id, span(29, 3)));
    let end = times.pop().expect("an end");
    assert!((1_500..1_510).contains(&end), "{end}");
    let gaps: Vec<u64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!((100..110).contains(&times[0]), "{times:?}");
    // The gaps grow, because a reply is due only after the replies to all earlier attempts.
    assert!(gaps.iter().all(|gap| (100..120).contains(gap)), "{gaps:?}");
}

#[test]
fn timeouts_follow_the_baud_rate() {
    let whole = |baud| {
        let mut link = link(baud);
        link.read(span(0, 255), Patience { attempts: 2, timeout: Duration::from_millis(500) });
        sent(&mut link, at_ms(0));
        events(&mut link, at_ms(0)).1.as_micros() / 1_000
    };
    assert_eq!(
        (whole(1_000_000), whole(9_600)),
        (102, 380),
        "262 bytes take 2.6 and 273 ms; what reports add is learned"
    );
}

#[test]
fn a_suspended_host_takes_the_reply_that_waited() {
    let mut link = link(115_200);
    let id = link.read(span(29, 3), PATIENCE);
    sent(&mut link, at_ms(0));
    let woken = at_ms(60_000);
    assert!(matches!(link.poll(woken), HostEvent::Wait(until) if until < woken));
    link.bytes(woken, &reply(29, &[1, 2, 3]));
    assert_eq!(events(&mut link, woken).0, [replied(id, 29, &[1, 2, 3])]);
}

#[test]
fn d5_a_reply_of_a_later_read_repeats_the_earlier_one_at_once() {
    let mut link = link(115_200);
    let (first, second) = (link.read(span(0, 8), PATIENCE), link.read(span(240, 16), PATIENCE));
    assert_eq!(events(&mut link, at_ms(0)).0.len(), 2);
    link.bytes(at_ms(5), &reply(240, &[9; 16]));
    let (happened, _) = events(&mut link, at_ms(5));
    let [reply_of_second, HostEvent::Send(frame)] = happened.as_slice() else { panic!("{happened:?}") };
    assert_eq!((reply_of_second, &frame[3..5]), (&replied(second, 240, &[9; 16]), &[0, 8][..]));
    link.bytes(at_ms(9), &reply(0, &[7; 8]));
    assert_eq!(events(&mut link, at_ms(9)).0, [replied(first, 0, &[7; 8])]);
}

#[test]
fn a_read_is_not_repeated_behind_a_write() {
    let mut link = link(115_200);
    let id = link.read(span(29, 3), PATIENCE);
    link.write(Map::V22, 29, &[2]);
    link.read(span(240, 16), PATIENCE);
    let sent: Vec<u8> = events(&mut link, at_ms(0))
        .0
        .iter()
        .map(|event| match event {
            HostEvent::Send(frame) => frame[2],
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(sent, [3, 6, 3]);
    link.bytes(at_ms(5), &reply(240, &[9; 16]));
    let (happened, _) = events(&mut link, at_ms(5));
    assert_eq!(happened[0], HostEvent::NoReply(id, span(29, 3)));
}

#[test]
fn a_write_ahead_goes_before_a_read_that_waits_and_before_all_that_is_queued() {
    let mut link = link(115_200);
    let patience = Patience { attempts: 1, timeout: Duration::from_millis(500) };
    // The second read waits for the only range, and everything queued behind it waits, too.
    for _ in 0..2 {
        link.read(span(0, 255), patience);
    }
    link.write(Map::V22, 46, &[90]);
    assert_eq!(sent(&mut link, at_ms(0)), (0, 255));
    assert!(matches!(link.poll(at_ms(0)), HostEvent::Wait(_)));
    link.write_ahead(Map::V22, 32, &[1]);
    link.write_ahead(Map::V22, 47, &[80]);
    let frames = events(&mut link, at_ms(1)).0;
    let addresses: Vec<u8> = frames
        .iter()
        .map(|event| match event {
            HostEvent::Send(frame) => frame[3],
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(addresses, [32, 47], "in their order, and the others still wait");
}

#[test]
fn a_reply_to_a_read_that_was_given_up_is_no_reply_to_the_next() {
    let mut link = link(115_200);
    let given_up = link.read(span(10, 4), PATIENCE);
    assert_eq!(sent(&mut link, at_ms(0)), (10, 4));
    link.cancel(given_up);
    let next = link.read(span(10, 4), PATIENCE);
    assert_eq!(sent(&mut link, at_ms(1)), (10, 5));
    link.bytes(at_ms(2), &reply(10, &[1; 4]));
    assert!(matches!(events(&mut link, at_ms(2)).0.as_slice(), [HostEvent::Unmatched(..)]));
    link.bytes(at_ms(3), &reply(10, &[2; 5]));
    assert_eq!(events(&mut link, at_ms(3)).0, [replied(next, 10, &[2; 4])]);
}

#[test]
fn a_report_is_no_reply_to_a_read_of_the_positions() {
    let mut link = link(115_200);
    let id = link.read(POSITIONS, PATIENCE);
    assert_eq!(sent(&mut link, at_ms(0)), (54, 8));
    link.bytes(at_ms(1), &[reply(54, &[9; 7]), reply(54, &[1; 8])].concat());
    let report = HostEvent::Report(Map::V22, Snapshot { address: 54, values: vec![9; 7] });
    assert_eq!(events(&mut link, at_ms(1)).0, [report, replied(id, 54, &[1; 7])]);
}

#[test]
fn a_line_that_was_opened_again_ends_all_reads() {
    let mut link = link(115_200);
    let (first, second) = (link.read(span(0, 255), PATIENCE), link.read(span(0, 255), PATIENCE));
    assert_eq!(sent(&mut link, at_ms(0)), (0, 255), "the second waits: no other range holds its registers");
    link.reset();
    let ended = [first, second].map(|id| HostEvent::NoReply(id, span(0, 255)));
    assert_eq!(events(&mut link, at_ms(1)), (ended.to_vec(), Instant::FAR_FUTURE));
}

//! Lost and late replies, reports, the order of requests, and a line that is opened again.

use host_link::{HostEvent, Patience, Snapshot};
use protocol_core::registers::Map;
use protocol_core::time::{Duration, Instant};

use crate::common::{
    PATIENCE, POSITIONS, at_ms, events, in_time, link, next_after_silence, replied, reply, sent, span,
};

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

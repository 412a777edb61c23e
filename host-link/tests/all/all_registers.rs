//! Reads of all registers: a repeat has the same range, so a marker shows when no reply is on its way.

use host_link::{HostEvent, HostLink, Patience};
use protocol_core::time::{Duration, Instant};

use crate::common::{PATIENCE, at_ms, events, link, reply, span};

#[derive(Clone, Copy, Debug, PartialEq)]
enum Fate {
    Arrives,
    Lost,
    Damaged,
}

/// Reads all registers at `now`. `fate` is that of the first reply. Returns when the read is answered.
fn read_all(link: &mut HostLink, mut now: Instant, mut fate: Fate) -> Instant {
    let id = link.read(span(0, 255), PATIENCE);
    loop {
        let (happened, until) = events(link, now);
        if happened.iter().any(|event| matches!(event, HostEvent::Reply(replied, _) if *replied == id)) {
            return now;
        }
        let request = happened.into_iter().find_map(|event| match event {
            HostEvent::Send(request) => Some(request),
            HostEvent::Damaged(_) | HostEvent::Unmatched(..) => None,
            other => panic!("{other:?}"),
        });
        let Some(request) = request else {
            now = until;
            link.bytes(now, &[]);
            continue;
        };
        let mut reply = reply(request[3], &vec![7; usize::from(request[4])]);
        // The time of the bytes on the line, and 0.3 ms of the arm.
        now = now + Duration::from_micros(87 * (7 + reply.len() as u64) + 300);
        match std::mem::replace(&mut fate, Fate::Arrives) {
            Fate::Lost => continue,
            Fate::Damaged => reply[100] ^= 1,
            Fate::Arrives => {}
        }
        link.bytes(now, &reply);
    }
}

#[test]
fn a_read_of_all_registers_is_answered_at_once_after_one_that_lost_a_reply() {
    for fate in [Fate::Lost, Fate::Damaged] {
        let (mut link, mut now) = (link(115_200), at_ms(0));
        for turn in 0..20 {
            let start = now;
            now = read_all(&mut link, start, if turn == 0 { fate } else { Fate::Arrives });
            let took = (now - start).as_micros() / 1_000;
            let most = [160, 40, 25][turn.min(2)];
            assert!(took <= most, "turn {turn} took {took} ms, the first reply: {fate:?}");
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
                assert!(until < at_ms(10_000), "it does not end");
                now = until;
                link.bytes(now, &[]);
            }
        }
    }
    // The second read begins 0.3 s later, after three markers.
    assert!((at_ms(1_300)..at_ms(1_500)).contains(&now), "{now:?}");
}

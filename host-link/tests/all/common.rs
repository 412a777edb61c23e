//! A link in virtual time, and what the tests look at.

use host_link::{HostEvent, HostLink, LinkOptions, Patience, RequestId, Snapshot, Span};
use protocol_core::request::Reply;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::FrameBuffer;

pub(crate) const PATIENCE: Patience = Patience { attempts: 3, timeout: Duration::from_millis(500) };
pub(crate) const POSITIONS: Span = Span::of(&protocol_core::registers::map::PRESENT_POSITION);

pub(crate) fn link(baud: u32) -> HostLink {
    HostLink::new(LinkOptions { baud, reports: &[POSITIONS] })
}

pub(crate) fn at_ms(millis: u64) -> Instant {
    Instant::from_micros(millis * 1_000)
}

pub(crate) fn span(address: u8, count: u8) -> Span {
    Span::new(address, count).expect("a span")
}

pub(crate) fn reply(address: u8, values: &[u8]) -> Vec<u8> {
    let mut frame = FrameBuffer::new();
    Reply { address, values }.encode(&mut frame);
    frame.to_vec()
}

/// The events until the link waits, and the time until which it waits.
pub(crate) fn events(link: &mut HostLink, now: Instant) -> (Vec<HostEvent>, Instant) {
    let mut events = Vec::new();
    loop {
        match link.poll(now) {
            HostEvent::Wait(until) => return (events, until),
            event => events.push(event),
        }
    }
}

/// The address and the count in the only frame that is sent now.
pub(crate) fn sent(link: &mut HostLink, now: Instant) -> (u8, u8) {
    match events(link, now).0.as_slice() {
        [HostEvent::Send(frame)] => (frame[3], frame[4]),
        other => panic!("{other:?}"),
    }
}

/// Lets the line be silent until the link's deadline. Returns the events at that time, and the time.
pub(crate) fn next_after_silence(link: &mut HostLink, now: Instant) -> (Vec<HostEvent>, Instant) {
    let (events_now, until) = events(link, now);
    assert_eq!(events_now, []);
    link.bytes(until, &[]);
    (events(link, until).0, until)
}

pub(crate) fn replied(id: RequestId, address: u8, values: &[u8]) -> HostEvent {
    HostEvent::Reply(id, Snapshot { address, values: values.to_vec() })
}

/// Forty reads in 800 ms, whose replies come in time.
pub(crate) fn in_time(link: &mut HostLink) {
    for turn in 0..40 {
        link.read(span(29, 3), PATIENCE);
        sent(link, at_ms(turn * 20));
        link.bytes(at_ms(turn * 20 + 2), &reply(29, &[1, 2, 3]));
        events(link, at_ms(turn * 20 + 2));
    }
}

//! Properties of a link, on random schedules of requests and faults. Proptest prints the seed of a failure.

use std::collections::{BTreeMap, VecDeque};

use host_link::{HostEvent, HostLink, Patience, RequestId, Span};
use proptest::collection::vec;
use proptest::prelude::*;
use protocol_core::registers::Map;
use protocol_core::request::Request;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::{Deframer, ToArm};

use crate::common::{POSITIONS, link, reply};

/// The value of every register in a report.
const IN_REPORT: u8 = 255;

/// Ranges of registers. Some cannot be widened.
fn spans() -> impl Strategy<Value = Span> {
    let usual = [(54, 7), (0, 8), (10, 4), (10, 5), (240, 16), (0, 255), (1, 255), (0, 0)];
    proptest::sample::select(
        usual.map(|(address, count)| Span::new(address, count).expect("a span")).to_vec(),
    )
}

/// What happens to the answer of a read.
#[derive(Clone, Copy, Debug)]
enum Fate {
    Arrives,
    Lost,
    Damaged,
    /// Late by this many milliseconds, and so is every answer behind it.
    Late(u64),
}

#[derive(Clone, Copy, Debug)]
enum Action {
    Read(Span, u32),
    Write,
    Cancel,
    Report,
    /// Milliseconds pass.
    Pass(u64),
}

fn fates() -> impl Strategy<Value = Fate> {
    prop_oneof![
        3 => Just(Fate::Arrives),
        1 => Just(Fate::Lost),
        1 => Just(Fate::Damaged),
        1 => (1..1_500_u64).prop_map(Fate::Late),
    ]
}

fn actions() -> impl Strategy<Value = Action> {
    prop_oneof![
        4 => (spans(), 1..3_u32).prop_map(|(span, attempts)| Action::Read(span, attempts)),
        2 => Just(Action::Write),
        1 => Just(Action::Cancel),
        1 => Just(Action::Report),
        4 => (0..400_u64).prop_map(Action::Pass),
    ]
}

/// An arm whose registers all hold the number of writes that it got, behind a line with faults.
struct Arm {
    deframer: Deframer<ToArm>,
    writes: u8,
    fates: VecDeque<Fate>,
    /// Bytes on their way to the host, in order, and when they arrive.
    to_host: VecDeque<(Instant, Vec<u8>)>,
}

impl Arm {
    fn new(fates: Vec<Fate>) -> Self {
        let deframer = Deframer::new(Duration::from_millis(2));
        Self { deframer, writes: 0, fates: fates.into(), to_host: VecDeque::new() }
    }

    fn take(&mut self, now: Instant, frame: &[u8]) {
        assert_eq!(self.deframer.push(now, frame), frame.len());
        let request = self.deframer.pull().expect("a frame").map(Request::from_frame).expect("a good one");
        match request {
            Request::Read { address, count } => {
                let values = vec![self.writes; count.into()];
                self.answer(now, reply(address, &values));
            }
            Request::Write { values, .. } => self.writes = values[0],
            Request::WriteMap21 { .. } => panic!("{request:?}"),
        }
        assert!(self.deframer.pull().is_none());
    }

    fn answer(&mut self, now: Instant, mut frame: Vec<u8>) {
        let mut at = now + Duration::from_millis(3);
        match self.fates.pop_front().unwrap_or(Fate::Arrives) {
            Fate::Lost => return,
            Fate::Damaged => frame[4] ^= 0x55,
            Fate::Late(millis) => at = at + Duration::from_millis(millis),
            Fate::Arrives => {}
        }
        self.send(at, frame);
    }

    fn send(&mut self, at: Instant, frame: Vec<u8>) {
        let behind = self.to_host.back().map_or(Instant::ZERO, |(at, _)| *at);
        self.to_host.push_back((at.max(behind), frame));
    }
}

struct World {
    link: HostLink,
    arm: Arm,
    now: Instant,
    writes: u8,
    /// The range of each open read, and the number of writes before it.
    open: BTreeMap<RequestId, (Span, u8)>,
    answered: usize,
}

impl World {
    fn act(&mut self, action: Action) {
        match action {
            Action::Read(span, attempts) => {
                let patience = Patience { attempts, timeout: Duration::from_millis(300) };
                self.open.insert(self.link.read(span, patience), (span, self.writes));
            }
            Action::Write => {
                self.writes += 1;
                self.link.write(Map::V22, 29, &[self.writes]);
            }
            Action::Cancel => {
                if let Some((id, _)) = self.open.pop_first() {
                    self.link.cancel(id);
                }
            }
            Action::Report => self.arm.send(self.now, reply(POSITIONS.address(), &[IN_REPORT; 7])),
            Action::Pass(millis) => self.run_until(self.now + Duration::from_millis(millis)),
        }
        self.poll();
    }

    fn run_until(&mut self, end: Instant) {
        loop {
            let wait = self.poll();
            let arrival = self.arm.to_host.front().map_or(Instant::FAR_FUTURE, |(at, _)| *at);
            let next = wait.min(arrival).max(self.now);
            if next > end {
                self.now = end;
                return;
            }
            self.now = next;
            match self.arm.to_host.pop_front_if(|(at, _)| *at <= next) {
                Some((_, bytes)) => self.link.bytes(self.now, &bytes),
                None => self.link.bytes(self.now, &[]),
            }
        }
    }

    fn poll(&mut self) -> Instant {
        loop {
            match self.link.poll(self.now) {
                HostEvent::Wait(until) => return until,
                HostEvent::Send(frame) => self.arm.take(self.now, &frame),
                HostEvent::Reply(id, values) => {
                    let (span, writes) = self.open.remove(&id).expect("one end for each read");
                    assert_eq!(values.span(), span);
                    assert!(values.values.iter().all(|&value| value == writes), "{values:?}, not {writes}");
                    self.answered += 1;
                }
                HostEvent::NoReply(id, span) => {
                    assert_eq!(self.open.remove(&id).map(|(span, _)| span), Some(span));
                }
                HostEvent::Report(_, values) => assert_eq!(values.values, [IN_REPORT; 7]),
                HostEvent::Unmatched(..) | HostEvent::Damaged(_) => {}
                HostEvent::Alarm(alarm) => panic!("{alarm:?}"),
            }
        }
    }
}

/// The events of a link after the same two reads, for bytes that come in these pieces.
fn events_of(pieces: &[&[u8]]) -> Vec<HostEvent> {
    let mut link = link(115_200);
    let patience = Patience { attempts: 1, timeout: Duration::from_millis(500) };
    for span in [Span::new(10, 4), Span::new(240, 16)].into_iter().flatten() {
        link.read(span, patience);
    }
    let now = Instant::from_micros(5_000);
    let mut events = Vec::new();
    let mut poll = |link: &mut HostLink| {
        while let event = link.poll(now)
            && !matches!(event, HostEvent::Wait(_))
        {
            events.push(event);
        }
    };
    poll(&mut link);
    for piece in pieces {
        link.bytes(now, piece);
        poll(&mut link);
    }
    events
}

fn frame_of(span: Span, value: u8) -> Vec<u8> {
    reply(span.address(), &vec![value; span.count().into()])
}

/// Frames, pieces of frames, and noise.
fn streams() -> impl Strategy<Value = Vec<u8>> {
    let frames = || (spans(), any::<u8>()).prop_map(|(span, value)| frame_of(span, value));
    let halves = frames().prop_map(|frame| frame[..frame.len() / 2].to_vec());
    let noise = vec(prop_oneof![Just(0xAA), Just(0x77), Just(0x03), any::<u8>()], 0..20);
    vec(prop_oneof![4 => frames(), 1 => halves, 1 => noise], 0..8).prop_map(|parts| parts.concat())
}

proptest! {
    #[test]
    fn no_fault_makes_a_reply_that_of_another_request(
        // The schedules are short, because a link remembers at most 64 reads that were given up.
        actions in vec(actions(), 0..32),
        fates in vec(fates(), 0..60),
    ) {
        let arm = Arm::new(fates);
        let (link, open) = (link(115_200), BTreeMap::new());
        let mut world = World { link, arm, now: Instant::ZERO, writes: 0, open, answered: 0 };
        for action in actions {
            world.act(action);
        }
        world.run_until(world.now + Duration::from_millis(200_000));
        prop_assert!(world.open.is_empty(), "every read ends: {:?}", world.open);
        // The line is good again.
        world.arm.fates.clear();
        let before = world.answered;
        world.act(Action::Read(POSITIONS, 3));
        world.run_until(world.now + Duration::from_millis(1_000));
        prop_assert_eq!(world.answered, before + 1);
    }

    #[test]
    fn any_cutting_of_the_bytes_gives_the_same_events(
        stream in streams(),
        cuts in vec(any::<prop::sample::Index>(), 0..12),
    ) {
        let mut cuts: Vec<usize> = cuts.iter().map(|cut| cut.index(stream.len() + 1)).collect();
        cuts.sort_unstable();
        let ends = cuts.iter().copied().chain([stream.len()]);
        let starts = [0].into_iter().chain(cuts.iter().copied());
        let pieces: Vec<&[u8]> =
            starts.zip(ends).map(|(start, end)| &stream[start..end]).filter(|piece| !piece.is_empty()).collect();
        prop_assert_eq!(events_of(&pieces), events_of(&[&stream]));
    }

    #[test]
    fn any_bytes_are_survived(pieces in vec((vec(any::<u8>(), 0..300), 0..200_000_u64), 0..20)) {
        let arm = Arm::new(Vec::new());
        let mut world =
            World { link: link(115_200), arm, now: Instant::ZERO, writes: 0, open: BTreeMap::new(), answered: 0 };
        for (bytes, micros) in pieces {
            world.now = world.now + Duration::from_micros(micros);
            world.link.bytes(world.now, &bytes);
            while !matches!(world.link.poll(world.now), HostEvent::Wait(_)) {}
        }
        world.act(Action::Read(POSITIONS, 3));
        world.run_until(world.now + Duration::from_millis(2_000));
        prop_assert_eq!(world.answered, 1);
    }
}

//! The deframer against the slow model of the framing tests (D1 to D5), in two ways:
//!
//! - asked after every piece, it says the same as the model, in the same order;
//! - asked late, or not to the end, while bytes wait for room, it says all that the model says of the stream
//!   without its short silences, and nothing that does not stand in the stream. (Which frames inside a frame
//!   come out then depends on when it was asked, as D4 has it.)

use std::iter;

use crate::shared::stream::{Event, GAP_US, Model, Received, drain, pull, raw_frame, receive};
use arbitrary::Arbitrary;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::{Deframer, ToArm};

const LONG_SILENCE_US: u64 = 100_000;

/// What is tried.
#[derive(Arbitrary, Debug)]
pub struct Input<'a> {
    steps: Vec<Step<'a>>,
    piece: u8,
    late: bool,
}

#[derive(Arbitrary, Debug)]
enum Step<'a> {
    Bytes(&'a [u8]),
    /// A header that may promise too much.
    Header {
        function: u8,
        count: u8,
    },
    /// A frame, whole or short of some bytes, right or with a wrong byte.
    Frame {
        is_write: bool,
        address: u8,
        data: &'a [u8],
        missing: u8,
        damage: Option<(u8, u8)>,
    },
    Silence {
        half_millis: u8,
    },
    /// Only if asked late: somebody looks, this often.
    Look {
        times: u8,
    },
}

impl Step<'_> {
    fn event(&self) -> Option<Event> {
        let bytes = match *self {
            Self::Bytes(bytes) => bytes.to_vec(),
            Self::Header { function, count } => vec![0xAA, 0x77, function % 8, 0, count],
            Self::Frame { is_write, address, data, missing, damage } => {
                let data = &data[..data.len().min(255)];
                let (function, count, data) =
                    if is_write { (6, data.len(), data) } else { (3, data.len(), &[][..]) };
                let mut bytes = raw_frame(function, address, u8::try_from(count).unwrap(), data);
                bytes.truncate(bytes.len() - usize::from(missing).min(bytes.len()));
                if let Some((place, change)) = damage
                    && let Some(byte) = bytes.get_mut(usize::from(place))
                {
                    *byte ^= change;
                }
                bytes
            }
            Self::Silence { half_millis } => return Some(Event::Silence(u64::from(half_millis) * 500)),
            Self::Look { .. } => return None,
        };
        (!bytes.is_empty()).then_some(Event::Bytes(bytes))
    }
}

/// Tries it. Panics where something does not hold.
pub fn run(input: &Input<'_>) {
    if input.late {
        asked_late(&input.steps);
    } else {
        asked_at_once(&input.steps, usize::from(input.piece).max(1));
    }
}

fn asked_at_once(steps: &[Step<'_>], piece: usize) {
    let events: Vec<Event> = steps.iter().filter_map(Step::event).collect();
    let mut model = Model::default();
    let expected: Vec<Received> = events.iter().flat_map(|event| model.take(event)).collect();
    assert_eq!(receive::<ToArm>(&events, piece), expected);
}

fn asked_late(steps: &[Step<'_>]) {
    let mut line = Line::new();
    for step in steps {
        match (step, step.event()) {
            (_, Some(Event::Bytes(bytes))) => line.waiting.extend(bytes),
            (_, Some(Event::Silence(micros))) => line.now_us += micros,
            (Step::Look { times }, None) => line.look((*times).into()),
            _ => {}
        }
        line.offer();
    }
    line.end();
    line.check();
}

/// A line with a deframer at its end, and bytes that wait for room in it.
struct Line {
    deframer: Deframer<ToArm>,
    waiting: Vec<u8>,
    now_us: u64,
    last_byte_us: u64,
    said: Vec<Received>,
    /// Sees the long silences only.
    model: Model,
    due: Vec<Received>,
}

impl Line {
    fn new() -> Self {
        Self {
            deframer: Deframer::new(Duration::from_micros(GAP_US)),
            waiting: Vec::new(),
            now_us: 0,
            last_byte_us: 0,
            said: Vec::new(),
            model: Model::default(),
            due: Vec::new(),
        }
    }

    /// Hands over what waits, or the silence.
    fn offer(&mut self) {
        let taken = self.deframer.push(Instant::from_micros(self.now_us), &self.waiting);
        if !self.waiting.is_empty() {
            self.last_byte_us = self.now_us;
            let bytes = self.waiting.drain(..taken).collect::<Vec<_>>();
            if taken > 0 {
                self.due.extend(self.model.take(&Event::Bytes(bytes)));
            }
        } else if self.now_us - self.last_byte_us >= LONG_SILENCE_US {
            self.due.extend(self.model.take(&Event::Silence(LONG_SILENCE_US)));
        }
    }

    fn look(&mut self, times: usize) {
        self.said.extend(iter::from_fn(|| pull(&mut self.deframer)).take(times));
    }

    fn end(&mut self) {
        while !self.waiting.is_empty() {
            drain(&mut self.deframer, &mut self.said);
            self.offer();
        }
        drain(&mut self.deframer, &mut self.said);
        self.now_us += LONG_SILENCE_US;
        self.offer();
        drain(&mut self.deframer, &mut self.said);
    }

    fn check(&self) {
        let everything = self.model.everything();
        let count = |list: &[Received], what: &Received| list.iter().filter(|said| *said == what).count();
        for what in iter::chain(&self.said, &self.due) {
            let (least, said) = (count(&self.due, what), count(&self.said, what));
            let most = count(&everything, what);
            assert!(
                (least..=most).contains(&said),
                "{what:?} was said {said} times, not {least} to {most}: {:?}",
                self.said
            );
        }
    }
}

//! The deframer against the simple model of the framing tests (D1 to D5), in two ways:
//!
//! - If frames are pulled after every piece, the deframer returns the results of the model in the same order.
//! - If frames are pulled late, bytes wait for room. The deframer then returns at least the results of the model for the stream
//!   without its short silences. It returns no result that the stream does not contain. Whether it returns a frame inside
//!   another frame depends on the time of a pull (D4).

use std::iter;

use crate::shared::stream::{
    Event, GAP_US, LONG_SILENCE_US, Model, Received, drain, pull, raw_frame, receive,
};
use arbitrary::Arbitrary;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::{Deframer, ToArm};

/// A stream with silences, the size of its pieces, and whether frames are pulled late.
#[derive(Arbitrary, Debug)]
pub struct Input<'a> {
    steps: Vec<StreamStep<'a>>,
    piece: u8,
    is_late: bool,
}

#[derive(Arbitrary, Debug)]
enum StreamStep<'a> {
    Bytes(&'a [u8]),
    /// A header whose count may exceed the data.
    Header {
        function: u8,
        count: u8,
    },
    /// A frame, perhaps truncated or corrupted.
    Frame {
        function: u8,
        address: u8,
        data: &'a [u8],
        missing: u8,
        damage: Option<(u8, u8)>,
    },
    SilenceHalfMillis(u8),
    /// Pull up to this many frames. Without effect unless the run is late.
    Pull(u8),
}

impl StreamStep<'_> {
    fn event(&self) -> Option<Event> {
        let bytes = match *self {
            Self::Bytes(bytes) => bytes.to_vec(),
            Self::Header { function, count } => vec![0xAA, 0x77, function % 8, 0, count],
            Self::Frame { function, address, data, missing, damage } => {
                let data = &data[..data.len().min(255)];
                let function = [3, 6, 4][usize::from(function % 3)];
                let count = u8::try_from(data.len()).unwrap();
                let mut bytes = raw_frame(function, address, count, if function == 3 { &[] } else { data });
                bytes.truncate(bytes.len() - usize::from(missing).min(bytes.len()));
                if let Some((place, change)) = damage
                    && let Some(byte) = bytes.get_mut(usize::from(place))
                {
                    *byte ^= change;
                }
                bytes
            }
            Self::SilenceHalfMillis(time) => return Some(Event::Silence(u64::from(time) * 500)),
            Self::Pull(_) => return None,
        };
        (!bytes.is_empty()).then_some(Event::Bytes(bytes))
    }
}

/// Runs the deframer. Panics if its results differ from the model.
pub fn run(input: &Input<'_>) {
    if input.is_late {
        pull_late(&input.steps);
    } else {
        pull_at_once(&input.steps, usize::from(input.piece).max(1));
    }
}

fn pull_at_once(steps: &[StreamStep<'_>], piece: usize) {
    let events: Vec<Event> = steps.iter().filter_map(StreamStep::event).collect();
    let mut model = Model::default();
    let expected: Vec<Received> = events.iter().flat_map(|event| model.take(event)).collect();
    assert_eq!(receive::<ToArm>(&events, piece), expected);
}

fn pull_late(steps: &[StreamStep<'_>]) {
    let mut line = LateReader::new();
    for step in steps {
        match (step, step.event()) {
            (_, Some(Event::Bytes(bytes))) => line.waiting.extend(bytes),
            (_, Some(Event::Silence(micros))) => line.now_us += micros,
            (StreamStep::Pull(times), None) => line.pull_frames((*times).into()),
            _ => {}
        }
        line.deliver();
    }
    line.end();
    line.check();
}

/// A deframer from which frames are pulled late, and bytes that wait for room in it.
struct LateReader {
    deframer: Deframer<ToArm>,
    waiting: Vec<u8>,
    now_us: u64,
    last_byte_us: u64,
    returned: Vec<Received>,
    /// Receives the same bytes, and the long silences, but not the short ones.
    model: Model,
    expected: Vec<Received>,
}

impl LateReader {
    fn new() -> Self {
        Self {
            deframer: Deframer::new(Duration::from_micros(GAP_US)),
            waiting: Vec::new(),
            now_us: 0,
            last_byte_us: 0,
            returned: Vec::new(),
            model: Model::default(),
            expected: Vec::new(),
        }
    }

    /// Passes the waiting bytes, or the silence, to the deframer and to the model.
    fn deliver(&mut self) {
        let taken = self.deframer.push(Instant::from_micros(self.now_us), &self.waiting);
        if !self.waiting.is_empty() {
            self.last_byte_us = self.now_us;
            let bytes = self.waiting.drain(..taken).collect::<Vec<_>>();
            if taken > 0 {
                self.expected.extend(self.model.take(&Event::Bytes(bytes)));
            }
        } else if self.now_us - self.last_byte_us >= LONG_SILENCE_US {
            self.expected.extend(self.model.take(&Event::Silence(LONG_SILENCE_US)));
        }
    }

    fn pull_frames(&mut self, times: usize) {
        self.returned.extend(iter::from_fn(|| pull(&mut self.deframer)).take(times));
    }

    fn end(&mut self) {
        while !self.waiting.is_empty() {
            drain(&mut self.deframer, &mut self.returned);
            self.deliver();
        }
        drain(&mut self.deframer, &mut self.returned);
        self.now_us += LONG_SILENCE_US;
        self.deliver();
        drain(&mut self.deframer, &mut self.returned);
    }

    fn check(&self) {
        let everything = self.model.everything();
        let count =
            |list: &[Received], result: &Received| list.iter().filter(|returned| *returned == result).count();
        for result in iter::chain(&self.returned, &self.expected) {
            let (min, returned) = (count(&self.expected, result), count(&self.returned, result));
            let max = count(&everything, result);
            assert!(
                (min..=max).contains(&returned),
                "{result:?} was returned {returned} times, not {min} to {max}: {:?}",
                self.returned
            );
        }
    }
}

//! Parses the bytes of both directions of the host link, which a listener on the line receives as one stream.
//!
//! ```text
//!   .. 01 02 AA 77 03 36 07 81 CE AA 77 03 36 07 5A 5A .. 43 81 ..
//!      ╰ noise ╯╰ read 54..60  ─╯ ╰ answer ────────────────╯
//! ```
//!
//! A read and its answer start with the same bytes. Both directions are tried; as a rule only one has a valid checksum. If both
//! have one, as a read of 0 registers and its answer, the bytes count as a read.

use host_link::{HostEvent, Snapshot};
use protocol_core::registers::Map;
use protocol_core::wire::frame::{self, Defect, Direction, Frame, MAX_LENGTH, ParseOutcome};
use protocol_core::wire::{Function, ToArm, ToHost};

/// A frame or noise on the line.
///
/// ```
/// use sevenbot::traffic::Traffic;
///
/// let read = Traffic::Read { address: 54, count: 7 };
/// assert_eq!(read.to_string(), "read present-position 1..7");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Traffic {
    /// A request for `count` registers from `address` on.
    Read {
        /// The first register.
        address: u8,
        /// The number of registers; the answer has as many values.
        count: u8,
    },
    /// The answer to a read, or a report.
    Answer {
        /// The first register.
        address: u8,
        /// One byte for each register.
        values: Vec<u8>,
    },
    /// A request to write in map 2.2 ([D6](protocol_core::decisions#d6)).
    Write {
        /// The first register.
        address: u8,
        /// One byte for each register.
        values: Vec<u8>,
    },
    /// A request to write in map 2.1 ([M1](protocol_core::decisions#m1)).
    WriteMap21 {
        /// The first register.
        address: u8,
        /// One byte for each register.
        values: Vec<u8>,
    },
    /// A report in map 2.1 ([M4](protocol_core::decisions#m4)).
    Report {
        /// The first register.
        address: u8,
        /// One byte for each register.
        values: Vec<u8>,
    },
    /// An alarm ([M8](protocol_core::decisions#m8)).
    Alarm {
        /// 0: message. 1: warning. 2: fatal.
        level: u8,
        /// 5: IK5 has no solution. 6: IK6. 7: IK7.
        kind: u8,
    },
    /// A frame with a valid checksum that reaches past register 255 ([D2](protocol_core::decisions#d2)).
    TooFar {
        /// The first register.
        address: u8,
        /// The number of registers: more than 256 - `address`.
        count: u8,
    },
    /// Bytes that do not form a frame.
    Noise(Vec<u8>),
}

impl Traffic {
    /// From a frame of direction `D`.
    #[must_use]
    pub fn from_frame<D: Direction>(frame: &Frame<'_>) -> Self {
        let (address, count, values) = (frame.address, frame.count, frame.data.to_vec());
        match frame.function {
            Function::Write => Self::Write { address, values },
            Function::WriteMap21 => Self::WriteMap21 { address, values },
            Function::Read if D::data_length(Function::Read, 1) == 0 => Self::Read { address, count },
            Function::Read => Self::Answer { address, values },
            Function::Report => Self::Report { address, values },
            Function::Alarm => Self::Alarm { level: address, kind: count },
        }
    }

    /// The request in a frame that a link sends; `None` if the bytes are no good frame.
    #[must_use]
    pub fn sent(frame: &[u8]) -> Option<Self> {
        match frame::parse::<ToArm>(frame) {
            ParseOutcome::Complete(frame, _) => Some(Self::from_frame::<ToArm>(&frame)),
            _ => None,
        }
    }

    /// The frame that a link received; `None` for events without a good frame.
    #[must_use]
    pub fn received(event: &HostEvent) -> Option<Self> {
        let (function, Snapshot { address, values }) = match event {
            HostEvent::Reply(_, values) | HostEvent::Report(Map::V22, values) => (Function::Read, values),
            HostEvent::Report(Map::V21, values) => (Function::Report, values),
            HostEvent::Unmatched(function, values) => (*function, values),
            HostEvent::Alarm(alarm) => return Some(Self::Alarm { level: alarm.level, kind: alarm.kind }),
            _ => return None,
        };
        let count = u8::try_from(values.len()).unwrap_or(u8::MAX);
        Some(Self::from_frame::<ToHost>(&Frame { function, address: *address, count, data: values }))
    }
}

/// Splits the bytes of a line into frames and noise.
///
/// ```
/// use sevenbot::traffic::{Traffic, TrafficParser};
///
/// let mut parser = TrafficParser::default();
/// parser.push(b"\x01\xAA\x77\x03\x36\x07\x81\xCE");
/// assert_eq!(parser.next(), Some(Traffic::Noise(vec![1])));
/// assert_eq!(parser.next(), Some(Traffic::Read { address: 54, count: 7 }));
/// assert_eq!(parser.next(), None);
/// ```
#[derive(Clone, Debug, Default)]
pub struct TrafficParser {
    waiting: Vec<u8>,
    /// The number of waiting bytes, from the first one on, that are noise.
    noise: usize,
}

/// The result for the first of the waiting bytes.
enum LeadingBytes {
    Frame(Traffic, usize),
    Unfinished,
    NoFrame,
}

impl TrafficParser {
    /// Adds bytes in the order of the line. [`Self::next`] returns what they form.
    pub fn push(&mut self, bytes: &[u8]) {
        self.waiting.extend(bytes);
    }

    /// The next frame or noise; `None` if more bytes are needed.
    #[expect(clippy::should_implement_trait, reason = "none now does not mean none later")]
    pub fn next(&mut self) -> Option<Traffic> {
        self.advance(false)
    }

    /// As [`Self::next`], at a gap or at the end of the input: an unfinished frame is noise.
    pub fn next_at_gap(&mut self) -> Option<Traffic> {
        self.advance(true)
    }

    fn advance(&mut self, is_gap: bool) -> Option<Traffic> {
        while let Some(rest) = self.waiting.get(self.noise..).filter(|rest| !rest.is_empty()) {
            match parse_leading(rest) {
                LeadingBytes::Frame(..) if self.noise > 0 => return Some(self.take_noise()),
                LeadingBytes::Frame(item, length) => {
                    self.waiting.drain(..length);
                    return Some(item);
                }
                LeadingBytes::Unfinished if !is_gap => return None,
                LeadingBytes::Unfinished | LeadingBytes::NoFrame => self.noise += 1,
            }
            // Return long noise in parts.
            if self.noise >= MAX_LENGTH {
                return Some(self.take_noise());
            }
        }
        (is_gap && self.noise > 0).then(|| self.take_noise())
    }

    fn take_noise(&mut self) -> Traffic {
        Traffic::Noise(self.waiting.drain(..std::mem::take(&mut self.noise)).collect())
    }
}

fn parse_leading(bytes: &[u8]) -> LeadingBytes {
    match (parse_direction::<ToArm>(bytes), parse_direction::<ToHost>(bytes)) {
        (found @ LeadingBytes::Frame(..), _) | (_, found @ LeadingBytes::Frame(..)) => found,
        (LeadingBytes::Unfinished, _) | (_, LeadingBytes::Unfinished) => LeadingBytes::Unfinished,
        _ => LeadingBytes::NoFrame,
    }
}

/// The result in direction `D`. A frame with a malformed range has a known length; other damage is no frame.
fn parse_direction<D: Direction>(bytes: &[u8]) -> LeadingBytes {
    match (frame::parse::<D>(bytes), bytes) {
        (ParseOutcome::Complete(found, length), _) => {
            LeadingBytes::Frame(Traffic::from_frame::<D>(&found), length)
        }
        (ParseOutcome::Defective(Defect::MalformedRange { address }, length), [_, _, _, _, count, ..]) => {
            LeadingBytes::Frame(Traffic::TooFar { address, count: *count }, length)
        }
        (ParseOutcome::Incomplete(_), _) => LeadingBytes::Unfinished,
        _ => LeadingBytes::NoFrame,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol_core::request::Reply;
    use protocol_core::request::Request;
    use protocol_core::wire::FrameBuffer;

    const READ: &[u8] = b"\xaa\x77\x03\x36\x07\x81\xce";
    const UNLOCK: &[u8] = b"\xaa\x77\x06\x1c\x01\x00\x2c\xc4";
    const ANSWER: &[u8] = b"\xaa\x77\x03\x36\x07\x5a\x5a\x41\x5a\x5a\x5a\x50\x43\x81";

    fn drain(parser: &mut TrafficParser) -> Vec<Traffic> {
        std::iter::from_fn(|| parser.next_at_gap()).collect()
    }

    fn parse_all(bytes: &[u8]) -> Vec<Traffic> {
        let mut parser = TrafficParser::default();
        parser.push(bytes);
        drain(&mut parser)
    }

    fn conversation() -> (Vec<u8>, Vec<Traffic>) {
        let bytes = [READ, ANSWER, b"\x01\x02\xaa", UNLOCK].concat();
        let item = vec![
            Traffic::Read { address: 54, count: 7 },
            Traffic::Answer { address: 54, values: vec![90, 90, 65, 90, 90, 90, 80] },
            Traffic::Noise(vec![1, 2, 0xAA]),
            Traffic::Write { address: 28, values: vec![0] },
        ];
        (bytes, item)
    }

    #[test]
    fn both_directions_are_distinguished() {
        let (bytes, item) = conversation();
        assert_eq!(parse_all(&bytes), item);
    }

    #[test]
    fn chunks_of_any_size_give_the_same_traffic() {
        let (bytes, item) = conversation();
        for size in 1..bytes.len() {
            let mut parser = TrafficParser::default();
            let mut told = Vec::new();
            for piece in bytes.chunks(size) {
                parser.push(piece);
                told.extend(std::iter::from_fn(|| parser.next()));
            }
            told.extend(drain(&mut parser));
            assert_eq!(told, item, "pieces of {size}");
        }
    }

    #[test]
    fn a_frame_after_a_damaged_one_is_found() {
        let mut damaged = ANSWER.to_vec();
        damaged[6] ^= 1;
        let item = parse_all(&[&damaged, READ].concat());
        assert_eq!(item, [Traffic::Noise(damaged), Traffic::Read { address: 54, count: 7 }]);
        assert_eq!(parse_all(&READ[..4]), [Traffic::Noise(READ[..4].to_vec())], "cut short");
    }

    #[test]
    fn an_unfinished_frame_becomes_noise_at_a_gap() {
        let mut parser = TrafficParser::default();
        let header = b"\xaa\x77\x06\x00\xff";
        parser.push(&[header, READ].concat());
        assert_eq!(parser.next(), None, "a long write may go on like this");
        assert_eq!(parser.next_at_gap(), Some(Traffic::Noise(header.to_vec())));
        assert_eq!(parser.next(), Some(Traffic::Read { address: 54, count: 7 }));
    }

    #[test]
    fn a_range_past_register_255_is_a_frame() {
        let mut frame = FrameBuffer::new();
        Request::Read { address: 250, count: 7 }.encode(&mut frame);
        assert_eq!(parse_all(&frame), [Traffic::TooFar { address: 250, count: 7 }]);
        Reply { address: 250, values: &[0; 7] }.encode(&mut frame);
        assert_eq!(parse_all(&frame), [Traffic::TooFar { address: 250, count: 7 }]);
    }

    #[test]
    fn endless_noise_needs_bounded_memory() {
        let mut parser = TrafficParser::default();
        for _ in 0..100 {
            parser.push(&[0x55; 100]);
            while parser.next().is_some() {}
        }
        assert!(parser.waiting.len() < MAX_LENGTH);
    }
}

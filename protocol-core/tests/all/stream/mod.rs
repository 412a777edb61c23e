//! Streams for the framing tests: frames built with the `crc` crate, a driver for the deframer, and a
//! model of the deframer that evaluates the whole history again after every byte.

#![allow(dead_code)] // Each test file uses its part.

use std::collections::HashSet;

use protocol_core::time::{Duration, Instant};
use protocol_core::wire::{Defect, Deframer, Direction, MAX_LENGTH};

pub const GAP_US: u64 = 2_000;
/// After this silence an incomplete frame is abandoned (D4).
pub const LONG_SILENCE_US: u64 = 100_000;
const CRC: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_MODBUS);

/// What happens on the line.
#[derive(Clone, Debug)]
pub enum Event {
    Bytes(Vec<u8>),
    /// No byte for this many microseconds. The deframer is called at the end.
    Silence(u64),
}

/// A frame or a defect that the deframer found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Received {
    Frame(Vec<u8>),
    WrongCrc,
    MalformedRange(u8),
}

/// A frame with any content, right or wrong, and a right checksum.
pub fn raw_frame(function: u8, address: u8, count: u8, data: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0xAA, 0x77, function, address, count];
    bytes.extend(data);
    bytes.extend(CRC.checksum(&bytes).to_le_bytes());
    bytes
}

/// A well-formed frame: a write of `data`, or a read of seven registers. It begins at `address`, or lower if its range would
/// end beyond address 254.
pub fn frame(function: u8, address: u8, data: &[u8]) -> Vec<u8> {
    let (count, data) = if function == 3 { (7, &[][..]) } else { (u8::try_from(data.len()).unwrap(), data) };
    raw_frame(function, address.min(255 - count), count, data)
}

pub fn frame_ending_in_aa() -> Vec<u8> {
    (0..=255).map(|value| frame(6, 0, &[value])).find(|bytes| bytes.last() == Some(&0xAA)).unwrap()
}

/// Feeds a deframer in pieces, and collects what it finds after each piece and each silence.
pub fn receive<D: Direction>(events: &[Event], piece: usize) -> Vec<Received> {
    let mut deframer = Deframer::<D>::new(Duration::from_micros(GAP_US));
    let mut now = 0;
    let mut received = Vec::new();
    for event in events {
        match event {
            Event::Silence(micros) => {
                now += micros;
                deframer.push(Instant::from_micros(now), &[]);
                drain(&mut deframer, &mut received);
            }
            Event::Bytes(bytes) => {
                for part in bytes.chunks(piece) {
                    let (mut rest, mut refusals) = (part, 0);
                    while !rest.is_empty() {
                        let taken = deframer.push(Instant::from_micros(now), rest);
                        drain(&mut deframer, &mut received);
                        rest = &rest[taken..];
                        refusals = if taken == 0 { refusals + 1 } else { 0 };
                        assert!(refusals < 3, "nothing makes room any more");
                    }
                }
            }
        }
    }
    received
}

pub fn drain<D: Direction>(deframer: &mut Deframer<D>, received: &mut Vec<Received>) {
    let before = received.len();
    received.extend(std::iter::from_fn(|| pull(deframer)).take(MAX_LENGTH + 1));
    assert!(received.len() - before <= MAX_LENGTH, "of what it holds, each byte begins one thing at most");
}

/// The next frame or defect that a deframer finds.
pub fn pull<D: Direction>(deframer: &mut Deframer<D>) -> Option<Received> {
    Some(match deframer.pull()? {
        Ok(frame) => Received::Frame(raw_frame(frame.function as u8, frame.address, frame.count, frame.data)),
        Err(Defect::WrongCrc) => Received::WrongCrc,
        Err(Defect::MalformedRange { address }) => Received::MalformedRange(address),
    })
}

/// What the deframer should find, from the rules of D3 and D4 alone.
#[derive(Default)]
pub struct Model {
    history: Vec<u8>,
    /// Lengths of the history at which the line was silent for the gap.
    short: Vec<usize>,
    /// Lengths of the history at which the line was silent for the timeout.
    long: Vec<usize>,
    silence: u64,
    told: HashSet<usize>,
}

enum Candidate {
    Nothing,
    Unfinished,
    Judged(usize, Received),
}

impl Model {
    /// The frames and defects that the deframer can find after this event and not before.
    pub fn take(&mut self, event: &Event) -> Vec<Received> {
        match event {
            Event::Bytes(bytes) => {
                // Byte by byte: a result must not depend on later bytes. An empty piece does not end a silence.
                bytes
                    .iter()
                    .flat_map(|&byte| {
                        self.silence = 0;
                        self.history.push(byte);
                        self.news()
                    })
                    .collect()
            }
            Event::Silence(micros) => {
                self.silence += micros;
                if self.silence >= GAP_US {
                    self.short.push(self.history.len());
                }
                if self.silence >= 100_000 {
                    self.long.push(self.history.len());
                }
                self.news()
            }
        }
    }

    /// Every frame and defect that begins anywhere in the history and is complete. A deframer that is called late may find
    /// fewer of these, but no other, and none twice.
    pub fn everything(&self) -> Vec<Received> {
        let candidate = |at| self.candidate(at, self.cut_behind(at).unwrap_or(self.history.len()));
        let judged = |at| if let Candidate::Judged(_, said) = candidate(at) { Some(said) } else { None };
        (0..self.history.len()).filter_map(judged).collect()
    }

    /// The length of the history at the next long silence after `at`; `None` if there is none.
    fn cut_behind(&self, at: usize) -> Option<usize> {
        self.long.iter().copied().find(|&cut| cut > at)
    }

    fn news(&mut self) -> Vec<Received> {
        let mut news = Vec::new();
        let mut at = 0;
        while at < self.history.len() {
            let cut = self.cut_behind(at);
            match self.candidate(at, cut.unwrap_or(self.history.len())) {
                Candidate::Unfinished if cut.is_none() => {
                    let quiet = self.short.iter().copied().filter(|&quiet| quiet > at).max();
                    self.look_behind(at + 1, quiet.unwrap_or(0), &mut news);
                    break;
                }
                Candidate::Judged(length, said) => at = self.tell(at, length, said, &mut news),
                _ => at += 1,
            }
        }
        news
    }

    fn look_behind(&mut self, from: usize, quiet: usize, news: &mut Vec<Received>) {
        let mut at = from;
        while at < quiet {
            match self.candidate(at, quiet) {
                // These bytes may be data of the unfinished frame before them.
                Candidate::Judged(_, Received::WrongCrc) => at += 1,
                Candidate::Judged(length, said) => at = self.tell(at, length, said, news),
                _ => at += 1,
            }
        }
    }

    /// Adds a result to `news` unless it was told before. Returns where the search goes on.
    fn tell(&mut self, at: usize, length: usize, said: Received, news: &mut Vec<Received>) -> usize {
        let good = matches!(said, Received::Frame(_));
        if self.told.insert(at) {
            news.push(said);
        }
        match &self.history[at..at + length] {
            _ if !good => at + 1,
            [.., 0xAA] => at + length - 1,
            [.., 0xAA, 0x77] => at + length - 2,
            _ => at + length,
        }
    }

    fn candidate(&self, at: usize, limit: usize) -> Candidate {
        let bytes = &self.history[at..limit];
        let header = [0xAA, 0x77];
        if bytes.len() < 2 && header.starts_with(bytes) {
            return Candidate::Unfinished;
        }
        if !bytes.starts_with(&header) {
            return Candidate::Nothing;
        }
        let length = match bytes.get(2) {
            None => return Candidate::Unfinished,
            Some(3) => 7,
            Some(4 | 6) => match bytes.get(4) {
                None => return Candidate::Unfinished,
                Some(&count) => 7 + usize::from(count),
            },
            Some(_) => return Candidate::Nothing,
        };
        let Some(bytes) = bytes.get(..length) else { return Candidate::Unfinished };
        let said = if CRC.checksum(&bytes[..length - 2]).to_le_bytes() != bytes[length - 2..] {
            Received::WrongCrc
        } else if u16::from(bytes[3]) + u16::from(bytes[4]) > 256 {
            Received::MalformedRange(bytes[3])
        } else {
            Received::Frame(bytes.to_vec())
        };
        Candidate::Judged(length, said)
    }
}

//! A program that speaks frames, from its first byte to its last.

use std::io;
use std::thread::sleep;
use std::time::Duration;

use system_tests::frames::{reply, with_checksum};
use system_tests::random::Random;
use system_tests::registers::{FEEDBACK_FREQUENCY, MOTOR_STATE, PRESENT_POSITION, TARGET_POSITION};
use system_tests::{read_request, write_request};

use super::visit::Visit;
use super::visitor::{Answer, Chaos, Tally};
use super::wire::{ByteWire, WayIn};

/// The register with which a program stops the arm, starts anew, or hands it over.
const COMMAND: u8 = 239;

/// One connection.
pub(super) struct FrameVisit<'a> {
    chaos: &'a Chaos,
    wire: ByteWire,
    received: Vec<u8>,
    has_reports: bool,
    /// As on a cable, a reply to the program that had the pseudo-terminal open before may still come.
    may_be_stale: bool,
}

impl<'a> FrameVisit<'a> {
    /// `None` if the server accepts no connection.
    pub(super) fn open(chaos: &'a Chaos, way_in: &WayIn) -> Option<Self> {
        let wire = ByteWire::open(way_in, &chaos.security).ok()?;
        let is_terminal = matches!(way_in, WayIn::Terminal(_));
        Some(Self { chaos, wire, received: Vec::new(), has_reports: is_terminal, may_be_stale: is_terminal })
    }

    /// The next whole frame that was received. Other bytes are returned behind the word `damaged`, so that the test fails.
    fn next_frame(&mut self) -> Option<Vec<u8>> {
        let length = match self.received.as_slice() {
            [0xAA, 0x77, 0x03 | 0x05, _, count, ..] => 7 + usize::from(*count),
            [] | [0xAA] | [0xAA, 0x77] | [0xAA, 0x77, 0x03 | 0x05, ..] => return None,
            other => other.len(),
        };
        if self.received.len() < length {
            return None;
        }
        let frame: Vec<u8> = self.received.drain(..length).collect();
        let (values, _) = frame.split_at(length - 2);
        (frame == with_checksum(values))
            .then_some(frame.clone())
            .or(Some([b"damaged".to_vec(), frame].concat()))
    }

    /// Removes the frame that begins with `start`, and all bytes before it, which are replies to another program. These replies
    /// need not be whole frames, because the kernel drops the bytes in one of its queues.
    fn take_behind_stale(&mut self, start: &[u8]) -> bool {
        let length = 7 + usize::from(start[4]);
        let frames = self.received.windows(length);
        let place = { frames }.position(|frame| {
            let (values, _) = frame.split_at(length - 2);
            frame.starts_with(start) && frame == with_checksum(values)
        });
        if let Some(place) = place {
            self.received.drain(..place + length);
        }
        place.is_some()
    }

    fn target(&mut self) -> io::Result<()> {
        let wire = &mut self.wire;
        self.chaos.targets.send(|values| wire.send(&write_request(TARGET_POSITION, &values)))
    }
}

impl Visit for FrameVisit<'_> {
    fn chaos(&self) -> &Chaos {
        self.chaos
    }

    fn ask(&mut self, own: Option<u8>, random: &mut Random) -> io::Result<Answer> {
        let asked = own.map_or_else(|| self.chaos.question(), |own| (own, 1));
        let mut wait = self.chaos.wait(asked);
        let (start, request) = match own {
            Some(own) => {
                let value = u8::try_from(1 + random.below(100)).expect("small");
                let written = reply(own, &[value]);
                (written, [write_request(own, &[value]), read_request(own, 1)].concat())
            }
            None => {
                let (address, count) = asked;
                (vec![0xAA, 0x77, 0x03, address, count], read_request(address, count))
            }
        };
        self.wire.send(&request)?;
        loop {
            if self.may_be_stale && self.take_behind_stale(&start) {
                self.may_be_stale = false;
                return Ok(Answer::Replied);
            }
            while !self.may_be_stale
                && let Some(frame) = self.next_frame()
            {
                if frame.starts_with(&start) {
                    return Ok(Answer::Replied);
                }
                let is_report =
                    self.has_reports && frame.starts_with(&[0xAA, 0x77, 0x03, PRESENT_POSITION, 7]);
                if !is_report {
                    // If the write was lost in an outage, the reply holds another value.
                    if wait.may_be_cut() && frame[..5] == start[..5] {
                        return Ok(Answer::Cut);
                    }
                    println!("crossed: {frame:02x?} instead of {start:02x?}");
                    return Ok(Answer::Crossed);
                }
            }
            if let Some(answer) = wait.ended() {
                if answer == Answer::Lost {
                    println!("of {:?}: {:02x?}", self.wire.kind(), self.received);
                }
                return Ok(answer);
            }
            let before = self.received.len();
            self.wire.receive(&mut self.received)?;
            if self.may_be_stale && self.received.len() > before {
                wait.progress();
            }
        }
    }

    fn act(&mut self, random: &mut Random) -> io::Result<()> {
        match random.below(9) {
            0..=2 => {
                for _ in 0..1 + random.below(30) {
                    self.target()?;
                }
            }
            3 => {
                let hertz = [0, 5, 20, 50][usize::try_from(random.below(4)).expect("small")];
                self.has_reports |= hertz > 0;
                self.wire.send(&write_request(FEEDBACK_FREQUENCY, &[hertz]))?;
            }
            4 => {
                let command = u8::try_from(1 + random.below(3)).expect("small");
                self.wire.send(&write_request(COMMAND, &[command]))?;
            }
            5 => self.wire.send(&write_request(MOTOR_STATE, &[1]))?,
            6 => {
                let mut damaged = write_request(TARGET_POSITION, &[1, 2, 3]);
                damaged[9] ^= 0x11;
                self.wire.send(&damaged)?;
            }
            7 => self.wire.send(&(0..random.below(60)).map(|_| 0x20).collect::<Vec<u8>>())?,
            _ => sleep(Duration::from_millis(random.below(400))),
        }
        Ok(())
    }

    fn leave(mut self, random: &mut Random, tally: &mut Tally) {
        let way = random.below(5);
        match way {
            // Replies that are never read.
            0 => {
                for _ in 0..20 {
                    let _ = self.wire.send(&read_request(0, 255));
                }
                sleep(Duration::from_millis(random.below(1_000)));
            }
            // A frame without an end.
            1 => drop(self.wire.send(&[0xAA, 0x77, 0x06, TARGET_POSITION, 7, 90])),
            2 => {
                for _ in 0..random.below(200) {
                    if self.target().is_err() {
                        break;
                    }
                }
            }
            _ => {}
        }
        if random.below(2) == 0 {
            tally.resets += 1;
            self.wire.reset();
        }
    }
}

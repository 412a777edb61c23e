//! Good frames on a line that is disturbed in one of seven ways, or not disturbed but always busy: how many frames are
//! lost, and how late the others are (D3, D4).
//!
//! The line runs at 115 200 baud. A disturbance is followed by a burst of good frames, then silence. The delay of a
//! frame is the time from its last byte until the deframer returns it, less the duration of its burst.

#![allow(dead_code)] // Each program that includes this module uses a part of it.

use flash_model::Random;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::{Deframer, ToArm};

use super::stream::{GAP_US, Received, drain, frame};

const BYTE_US: u64 = 87;
const BURST: usize = 4;
/// Shorter than the 100 ms that a sender may pause inside a frame.
const PAUSE_US: u64 = 5_000;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Disturbance {
    Noise,
    TruncatedFrame,
    FlippedBit,
    LostByte,
    DoubledByte,
    FalseLongHeader,
    /// Pauses of [`PAUSE_US`] inside good frames.
    Pauses,
    /// No disturbance, and no pause between the frames.
    BackToBack,
}

use Disturbance::{
    BackToBack, DoubledByte, FalseLongHeader, FlippedBit, LostByte, Noise, Pauses, TruncatedFrame,
};

impl Disturbance {
    pub const ALL: [Self; 8] =
        [Noise, TruncatedFrame, FlippedBit, LostByte, DoubledByte, FalseLongHeader, Pauses, BackToBack];

    pub const fn name(self) -> &'static str {
        match self {
            Noise => "noise",
            TruncatedFrame => "truncated frame",
            FlippedBit => "flipped bit",
            LostByte => "lost byte",
            DoubledByte => "doubled byte",
            FalseLongHeader => "false long header",
            Pauses => "pauses of 5 ms in good frames",
            BackToBack => "frames back to back",
        }
    }

    /// The bytes that the line carries in place of the frame `victim`.
    fn spoil(self, random: &mut Random, mut victim: Vec<u8>) -> Vec<u8> {
        let place = random.index(victim.len());
        match self {
            Noise => return (0..=random.index(40)).map(|_| noise(random)).collect(),
            TruncatedFrame => victim.truncate(place),
            FlippedBit => victim[place] ^= 1 << random.index(8),
            LostByte => drop(victim.remove(place)),
            DoubledByte => victim.insert(place, victim[place]),
            FalseLongHeader => {
                let count = u8::try_from(200 + random.index(56)).unwrap();
                return vec![0xAA, 0x77, [4, 6][random.index(2)], random.byte(), count];
            }
            Pauses | BackToBack => victim.clear(),
        }
        victim
    }
}

/// A byte of noise. Bytes of headers are frequent.
fn noise(random: &mut Random) -> u8 {
    let likely = [0xAA, 0x77, 0xAA, 0x77, 0x06, 0x04, 0x03];
    if random.index(2) == 0 { likely[random.index(likely.len())] } else { random.byte() }
}

/// A random frame. Victims of a disturbance have odd addresses and the rest even ones, so that a victim
/// that comes out after all is not mistaken for another frame.
fn any_frame(random: &mut Random, victim: bool) -> Vec<u8> {
    let data: Vec<u8> = (0..random.index(20)).map(|_| random.byte()).collect();
    let address = u8::try_from(random.index(110)).unwrap() * 2 + u8::from(victim);
    frame([3, 4, 6][random.index(3)], address, &data)
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    pub frames: usize,
    pub lost: usize,
    pub worst_delay_us: u64,
}

/// Sends at least `frames` good frames, in bursts, with the disturbance, if there is one, before or inside each burst.
pub fn run(disturbance: Disturbance, seed: u64, frames: usize) -> Tally {
    let mut random = Random::new(seed);
    let mut line = Line::new();
    for _ in 0..frames.div_ceil(BURST) {
        let victim = any_frame(&mut random, true);
        line.bytes(&disturbance.spoil(&mut random, victim));
        let burst: Vec<_> = (0..BURST).map(|_| any_frame(&mut random, false)).collect();
        line.begin_burst(&burst);
        for frame in &burst {
            if disturbance == Pauses {
                let (head, tail) = frame.split_at(random.index(frame.len()));
                line.bytes(head);
                line.silence(PAUSE_US);
                line.bytes(tail);
            } else {
                line.bytes(frame);
            }
            line.ends.push(line.now);
        }
        if disturbance != BackToBack {
            line.silence(GAP_US);
            line.silence(20_000);
        }
        line.end_burst();
    }
    line.tally
}

/// The line, a deframer at its end, and the frames that are to come out of it.
struct Line {
    deframer: Deframer<ToArm>,
    now: u64,
    waiting: Vec<Vec<u8>>,
    /// How many frames of the burst came out or were lost.
    done: usize,
    /// When the last byte of each frame of the burst had arrived.
    ends: Vec<u64>,
    burst_us: u64,
    tally: Tally,
}

impl Line {
    fn new() -> Self {
        let deframer = Deframer::new(Duration::from_micros(GAP_US));
        let (waiting, ends) = (Vec::new(), Vec::new());
        Self { deframer, now: 0, waiting, done: 0, ends, burst_us: 0, tally: Tally::default() }
    }

    fn begin_burst(&mut self, frames: &[Vec<u8>]) {
        self.waiting = frames.to_vec();
        self.done = 0;
        self.ends.clear();
        self.burst_us = frames.iter().map(|bytes| bytes.len() as u64 * BYTE_US).sum();
        self.tally.frames += frames.len();
    }

    fn end_burst(&mut self) {
        self.tally.lost += self.waiting.len() - self.done;
        self.waiting.clear();
        self.done = 0;
    }

    fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.now += BYTE_US;
            self.hears(&[*byte]);
        }
    }

    fn silence(&mut self, micros: u64) {
        self.now += micros;
        self.hears(&[]);
    }

    /// Pushes bytes, or silence if there are none, and counts the frames that come out.
    fn hears(&mut self, bytes: &[u8]) {
        self.deframer.push(Instant::from_micros(self.now), bytes);
        let mut received = Vec::new();
        drain(&mut self.deframer, &mut received);
        received.into_iter().for_each(|said| self.came_out(&said));
    }

    /// Counts a frame that came out, and the frames of the burst that it skips as lost. A victim that a disturbance lets
    /// through is not among the expected frames, and does not count.
    fn came_out(&mut self, said: &Received) {
        let Received::Frame(bytes) = said else { return };
        let Some(skipped) = self.waiting[self.done..].iter().position(|expected| expected == bytes) else {
            return;
        };
        let place = self.done + skipped;
        // A frame without an entry is being sent: it came out with its last byte.
        let end = self.ends.get(place).copied().unwrap_or(self.now);
        self.tally.lost += skipped;
        self.tally.worst_delay_us =
            self.tally.worst_delay_us.max((self.now - end).saturating_sub(self.burst_us));
        self.done = place + 1;
    }
}

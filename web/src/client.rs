//! Speaks with an arm: reads its registers again and again, and writes what a person wants.
//!
//! ```text
//!   write, stop ──▶ ┌────────┐ ──▶ bytes to the arm
//!                   │ Client │
//!   registers   ◀── └────────┘ ◀── bytes from the arm
//! ```
//!
//! Writes have no reply (D6): the registers that are read again show their effect. This file does no input or output.

use std::collections::VecDeque;

use protocol_core::request::{Reply, Request};
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::deframer::gap;
use protocol_core::wire::{Deframer, FrameBuffer, ToHost};
use sevenbot::map::{DEVICE_CODE, FINE_TARGET, PROTECTION_VERSION, SERVO_TEMPERATURE, STATUS_VERSION};
use sevenbot::traffic::Traffic;
use sevenbot::{Snapshot, Span};

use crate::arm_state::ArmState;
use crate::stop::{Stop, StopProgress};

/// A read without a reply is lost after this time. A reply at 115,200 baud, through a server, takes a tenth of it.
const REPLY_TIMEOUT: Duration = Duration::from_millis(400);
/// An arm is gone after this many rounds in which a reply was lost.
const LOST_ROUNDS: u32 = 3;
/// How many writes, and frames that were not asked for, are kept to be shown.
const KEPT_FRAMES: usize = 40;
/// The baud rate of the arm's line where nothing else is known.
const BAUD: u32 = 115_200;

/// What each round reads.
const ROUND: [Span; 3] = [
    Span::between(&DEVICE_CODE, &sevenbot::map::PRESENT_POSITION),
    Span::between(&FINE_TARGET, &PROTECTION_VERSION),
    Span::between(&STATUS_VERSION, &SERVO_TEMPERATURE),
];

/// A frame that is shown: its time, true for one to the arm, and its content.
pub type ShownFrame = (Instant, bool, Traffic);

/// One end of the line to an arm.
pub struct Client {
    deframer: Deframer<ToHost>,
    to_send: Vec<u8>,
    /// The last known value of each register.
    registers: Snapshot,
    /// Reads of this round without a reply, oldest first.
    awaited: VecDeque<Span>,
    asked_at: Instant,
    rounds: u64,
    lost_rounds: u32,
    stop: Stop,
    frames: VecDeque<ShownFrame>,
}

impl Default for Client {
    fn default() -> Self {
        Self {
            deframer: Deframer::new(gap(BAUD)),
            to_send: Vec::new(),
            registers: Snapshot { address: 0, values: vec![0; 256] },
            awaited: VecDeque::new(),
            asked_at: Instant::ZERO,
            rounds: 0,
            lost_rounds: 0,
            stop: Stop::default(),
            frames: VecDeque::new(),
        }
    }
}

impl Client {
    /// Does an arm answer?
    #[must_use]
    pub const fn is_connected(&self) -> bool {
        self.rounds > 0 && self.lost_rounds < LOST_ROUNDS
    }

    /// The number of complete rounds: registers are new when it changed.
    #[must_use]
    pub const fn rounds(&self) -> u64 {
        self.rounds
    }

    /// The last known value of each register, 0 to 255.
    #[must_use]
    pub const fn registers(&self) -> &Snapshot {
        &self.registers
    }

    /// What the registers say of the arm.
    #[must_use]
    pub fn state(&self) -> ArmState {
        ArmState::new(&self.registers)
    }

    /// The progress of the last stop.
    #[must_use]
    pub const fn stop_progress(&self) -> StopProgress {
        self.stop.progress()
    }

    /// Writes, and frames that were not asked for, oldest first.
    pub fn frames(&self) -> impl DoubleEndedIterator<Item = &ShownFrame> {
        self.frames.iter()
    }

    /// Writes registers from `address` on. What a stop has found out is no longer news.
    pub fn write(&mut self, now: Instant, address: u8, values: &[u8]) {
        if self.stop.progress() != StopProgress::Verifying {
            self.stop = Stop::default();
        }
        let request = Request::Write { address, values };
        self.show(now, true, Traffic::from(&request));
        self.encode(&request);
    }

    /// Lets every joint hold where it is. [`Client::stop_progress`] tells whether the arm took it.
    pub fn stop(&mut self) {
        self.stop.start();
    }

    /// Takes bytes of the arm; none if its line is silent at `now`.
    pub fn receive(&mut self, now: Instant, bytes: &[u8]) {
        let mut rest = bytes;
        loop {
            let taken = self.deframer.push(now, rest);
            let is_done = rest.is_empty();
            while let Some(content) = pull(&mut self.deframer) {
                self.take(now, content);
            }
            rest = rest.get(taken..).unwrap_or_default();
            if is_done || rest.is_empty() {
                return;
            }
        }
    }

    fn take(&mut self, now: Instant, content: Result<Snapshot, Traffic>) {
        let reply = match content {
            Ok(reply) => reply,
            Err(other) => return self.show(now, false, other),
        };
        let span = reply.span();
        let Some(index) = self.awaited.iter().position(|&awaited| awaited == span) else {
            return self.show(now, false, Traffic::from(&reply));
        };
        self.awaited.drain(..=index);
        let first = usize::from(reply.address);
        if let Some(known) = self.registers.values.get_mut(first..first + reply.values.len()) {
            known.copy_from_slice(&reply.values);
        }
        if self.awaited.is_empty() {
            self.rounds += 1;
            self.lost_rounds = 0;
            self.continue_stop(now);
        }
    }

    fn continue_stop(&mut self, now: Instant) {
        let mut stop = std::mem::take(&mut self.stop);
        for (address, values) in stop.frames(now, &self.registers, self.rounds) {
            self.write(now, address, &values);
        }
        self.stop = stop;
    }

    /// Begins a new round of reads if the last one is over. Returns the bytes for the arm.
    pub fn poll(&mut self, now: Instant) -> Vec<u8> {
        if !self.awaited.is_empty() && now >= self.asked_at + REPLY_TIMEOUT {
            self.awaited.clear();
            self.lost_rounds += 1;
        }
        if self.awaited.is_empty() {
            self.asked_at = now;
            for span in ROUND {
                self.encode(&Request::Read { address: span.address(), count: span.count() });
                self.awaited.push_back(span);
            }
        }
        std::mem::take(&mut self.to_send)
    }

    fn encode(&mut self, request: &Request<'_>) {
        let mut frame = FrameBuffer::new();
        request.encode(&mut frame);
        self.to_send.extend_from_slice(&frame);
    }

    fn show(&mut self, now: Instant, is_to_arm: bool, traffic: Traffic) {
        if self.frames.len() >= KEPT_FRAMES {
            self.frames.pop_front();
        }
        self.frames.push_back((now, is_to_arm, traffic));
    }
}

/// The next frame that holds something: a reply, or another frame in words.
fn pull(deframer: &mut Deframer<ToHost>) -> Option<Result<Snapshot, Traffic>> {
    loop {
        // A damaged frame is as good as a lost one.
        let Ok(frame) = deframer.pull()? else { continue };
        let reply = Reply::from_frame(frame);
        let reply = reply.map(|it| Snapshot { address: it.address, values: it.values.to_vec() });
        return Some(reply.ok_or_else(|| Traffic::from_frame::<ToHost>(&frame)));
    }
}

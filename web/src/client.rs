//! Speaks with an arm: reads its registers again and again, and writes what a person wants.
//!
//! ```text
//!   write, stop ──▶ ┌────────┐ ──▶ ┌──────────┐ ──▶ bytes to the arm
//!                   │ Client │     │ HostLink │
//!   registers   ◀── └────────┘ ◀── └──────────┘ ◀── bytes from the arm
//! ```
//!
//! Writes have no reply (D6): the registers that are read again show their effect. This file does no input or output.

use std::collections::VecDeque;

use host_link::{HostEvent, HostLink, LinkOptions, Patience, RequestId, sharing};
use protocol_core::registers::Map;
use protocol_core::time::{Duration, Instant};
use sevenbot::map::{DEVICE_CODE, FINE_TARGET, PRESENT_POSITION, PROTECTION_VERSION, SERVO_TEMPERATURE};
use sevenbot::traffic::Traffic;
use sevenbot::{Snapshot, Span};

use crate::arm_state::ArmState;
use crate::stop::{Stop, StopProgress, hold_frames};

/// A read without a reply is lost after 400 ms. A reply at 115,200 baud, through a server, takes a tenth of it.
const PATIENCE: Patience = Patience { attempts: 2, timeout: Duration::from_millis(200) };
/// An arm is gone after this many rounds in which a reply was lost.
const LOST_ROUNDS: u32 = 3;
/// How many writes, and frames that were not asked for, are kept to be shown.
const KEPT_FRAMES: usize = 40;
/// The baud rate of the arm's line where nothing else is known.
pub const BAUD: u32 = 115_200;

/// What each round reads, with the registers of a server before those of the arm's status.
const ROUND: [Span; 3] = [
    Span::between(&DEVICE_CODE, &PRESENT_POSITION),
    Span::between(&FINE_TARGET, &PROTECTION_VERSION),
    Span::one(sharing::FIRST).through(&SERVO_TEMPERATURE),
];

/// A frame that is shown: its time, true for one to the arm, and its content.
pub type ShownFrame = (Instant, bool, Traffic);

/// One end of the line to an arm.
pub struct Client {
    link: HostLink,
    to_send: Vec<u8>,
    /// The last known value of each register.
    registers: Snapshot,
    /// The time of the last write or round: each has a time of its own, so that their order is known.
    last_time: Instant,
    /// When the reads of this round were queued, and those of the last complete one.
    round_begun: Instant,
    read_since: Instant,
    /// Reads of this round without an end.
    awaited: Vec<RequestId>,
    /// Was a reply of this round lost?
    is_round_lost: bool,
    rounds: u64,
    lost_rounds: u32,
    stop: Stop,
    frames: VecDeque<ShownFrame>,
}

impl Default for Client {
    fn default() -> Self {
        Self {
            link: HostLink::new(LinkOptions { baud: BAUD, reports: &[] }),
            to_send: Vec::new(),
            registers: Snapshot { address: 0, values: vec![0; 256] },
            last_time: Instant::ZERO,
            round_begun: Instant::ZERO,
            read_since: Instant::ZERO,
            awaited: Vec::new(),
            is_round_lost: false,
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

    /// Were all registers read by requests that were sent after this write? Then they show it.
    #[must_use]
    pub fn was_read_since(&self, write: Instant) -> bool {
        self.rounds > 0 && self.read_since > write
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

    /// Writes registers from `address` on. Returns the time of the write, for [`Self::was_read_since`]. What a stop has found out
    /// is no longer news.
    pub fn write(&mut self, now: Instant, address: u8, values: &[u8]) -> Instant {
        self.stop.forget();
        self.show(now, true, Traffic::Write { address, values: values.to_vec() });
        self.link.write(Map::V22, address, values);
        self.next_time(now)
    }

    fn next_time(&mut self, now: Instant) -> Instant {
        self.last_time = now.max(self.last_time + Duration::from_micros(1));
        self.last_time
    }

    /// Lets every joint hold where it is: before all that waits to be sent, and again until the arm confirms it.
    /// [`Client::stop_progress`] tells whether it did. `speeds` are those to restore, if the registers hold others for a while.
    pub fn stop(&mut self, now: Instant, speeds: Option<[u8; 7]>) {
        self.stop.start(Some(&self.registers).filter(|_| self.rounds > 0), speeds);
        self.continue_stop(now);
    }

    /// Lets every joint hold where it was read last, with these speeds. Nothing confirms it, so that other targets can follow at
    /// once.
    pub fn hold(&mut self, now: Instant, speeds: [u8; 7]) {
        for (address, values) in hold_frames(&self.registers, speeds) {
            self.write(now, address, &values);
        }
    }

    /// As [`Self::hold`], before all that waits to be sent. Returns the last bytes for the arm: its line is closed behind them.
    pub fn hold_and_leave(&mut self, now: Instant, speeds: [u8; 7]) -> Vec<u8> {
        for (address, values) in hold_frames(&self.registers, speeds) {
            self.link.write_ahead(Map::V22, address, &values);
        }
        self.advance(now);
        std::mem::take(&mut self.to_send)
    }

    /// Takes bytes of the arm; none if its line is silent at `now`.
    pub fn receive(&mut self, now: Instant, bytes: &[u8]) {
        self.link.bytes(now, bytes);
        self.advance(now);
    }

    /// Takes what has happened on the link.
    fn advance(&mut self, now: Instant) {
        loop {
            match self.link.poll(now) {
                HostEvent::Wait(_) => return,
                HostEvent::Send(frame) => self.to_send.extend(frame),
                HostEvent::Reply(id, values) => {
                    self.registers.put(&values);
                    self.end_read(now, id);
                }
                HostEvent::NoReply(id, _) => {
                    self.is_round_lost = true;
                    self.end_read(now, id);
                }
                other => Traffic::received(&other).into_iter().for_each(|it| self.show(now, false, it)),
            }
        }
    }

    fn end_read(&mut self, now: Instant, id: RequestId) {
        self.awaited.retain(|&awaited| awaited != id);
        if !self.awaited.is_empty() {
            return;
        }
        if self.is_round_lost {
            self.lost_rounds += 1;
        } else {
            self.rounds += 1;
            self.lost_rounds = 0;
            self.read_since = self.round_begun;
            self.stop.registers(self.round_begun, now, &self.registers);
            self.continue_stop(now);
        }
    }

    fn continue_stop(&mut self, now: Instant) {
        if self.stop.progress() != StopProgress::Verifying {
            return;
        }
        let time = self.next_time(now);
        for (address, values) in self.stop.frames(time) {
            self.link.write_ahead(Map::V22, address, &values);
            self.show(now, true, Traffic::Write { address, values });
        }
    }

    /// Begins a new round of reads if the last one is over. Returns the bytes for the arm.
    pub fn poll(&mut self, now: Instant) -> Vec<u8> {
        self.advance(now);
        self.continue_stop(now);
        if self.awaited.is_empty() {
            self.is_round_lost = false;
            self.round_begun = self.next_time(now);
            self.awaited = ROUND.map(|span| self.link.read(span, PATIENCE)).to_vec();
            self.advance(now);
        }
        std::mem::take(&mut self.to_send)
    }

    fn show(&mut self, now: Instant, is_to_arm: bool, traffic: Traffic) {
        if self.frames.len() >= KEPT_FRAMES {
            self.frames.pop_front();
        }
        self.frames.push_back((now, is_to_arm, traffic));
    }
}

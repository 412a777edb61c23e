//! The client of an arm: reads its registers in an endless series of rounds, and writes registers for the rest of the page.
//!
//! ```text
//!   write, stop ──▶ ┌────────┐ ──▶ ┌──────────┐ ──▶ bytes to the arm
//!                   │ Client │     │ HostLink │
//!   registers   ◀── └────────┘ ◀── └──────────┘ ◀── bytes from the arm
//! ```
//!
//! Writes have no reply (D6): only later reads show their effect. This file does no input or output.

use std::collections::VecDeque;

use host_link::{HostEvent, HostLink, LinkOptions, Patience, RequestId, sharing};
use protocol_core::registers::Map;
use protocol_core::time::{Duration, Instant};
use sevenbot::map::{DEVICE_CODE, FINE_TARGET, PRESENT_POSITION, PROTECTION_VERSION, SERVO_TEMPERATURE};
use sevenbot::traffic::Traffic;
use sevenbot::{Snapshot, Span};

use crate::arm_state::ArmState;
use crate::stop::{ArmStop, StopProgress, hold_frames};

/// A read is given up 400 ms after its reply was due. A reply takes about a tenth of this time at 115,200 baud and through a
/// server.
const PATIENCE: Patience = Patience { attempts: 2, timeout: Duration::from_millis(200) };
/// The arm counts as disconnected after this many consecutive rounds in which a reply was lost.
const LOST_ROUNDS: u32 = 3;
/// The number of writes and unsolicited frames that are kept for the page to show.
const KEPT_FRAMES: usize = 40;
/// The baud rate that is assumed for the arm's line: the default of register 12.
pub const BAUD: u32 = 115_200;

/// The registers that each round reads. The last range begins with the registers of a server, before the status block.
const ROUND: [Span; 3] = [
    Span::between(&DEVICE_CODE, &PRESENT_POSITION),
    Span::between(&FINE_TARGET, &PROTECTION_VERSION),
    Span::one(sharing::FIRST).through(&SERVO_TEMPERATURE),
];

/// A frame that the page shows: its time, whether it goes to the arm, and its content.
pub type ShownFrame = (Instant, bool, Traffic);

/// The client's end of the line to an arm.
pub struct Client {
    link: HostLink,
    to_send: Vec<u8>,
    /// The last known value of each register.
    registers: Snapshot,
    /// The time of the last write or round. Each gets a unique time, so that the times tell their order.
    last_time: Instant,
    /// When the reads of the current round were queued.
    round_begun: Instant,
    /// When the reads of the last complete round were queued.
    read_since: Instant,
    /// The reads of this round that have neither a reply nor a timeout yet.
    awaited: Vec<RequestId>,
    is_round_lost: bool,
    rounds: u64,
    lost_rounds: u32,
    stop: ArmStop,
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
            stop: ArmStop::default(),
            frames: VecDeque::new(),
        }
    }
}

impl Client {
    /// True after a complete round, until a reply was lost in each of three consecutive rounds.
    #[must_use]
    pub const fn is_connected(&self) -> bool {
        self.rounds > 0 && self.lost_rounds < LOST_ROUNDS
    }

    /// The number of complete rounds. When it changes, the registers are new.
    #[must_use]
    pub const fn rounds(&self) -> u64 {
        self.rounds
    }

    /// True if a complete round of reads was queued after this write, so that the registers show its effect. `write` is the time
    /// that [`Self::write`] returned.
    #[must_use]
    pub fn was_read_since(&self, write: Instant) -> bool {
        self.rounds > 0 && self.read_since > write
    }

    /// The last known value of each register, 0 to 255; 0 for a register that no round reads.
    #[must_use]
    pub const fn registers(&self) -> &Snapshot {
        &self.registers
    }

    /// The state of the arm, decoded from the last known registers.
    #[must_use]
    pub fn state(&self) -> ArmState {
        ArmState::new(&self.registers)
    }

    /// The progress of the last stop.
    #[must_use]
    pub const fn stop_progress(&self) -> StopProgress {
        self.stop.progress()
    }

    /// The last writes and unsolicited frames, oldest first.
    pub fn frames(&self) -> impl DoubleEndedIterator<Item = &ShownFrame> {
        self.frames.iter()
    }

    /// Queues a write of registers from `address` on. Returns the time of the write, for [`Self::was_read_since`]. Resets the
    /// result of a completed stop, because the arm may move again.
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

    /// Makes every joint hold where it is. The frames are sent before all other queued frames, and repeated until the stop is
    /// confirmed or has failed: see [`Client::stop_progress`]. `speeds` are the speeds to restore, if those in the registers are
    /// temporary.
    pub fn stop(&mut self, now: Instant, speeds: Option<[u8; 7]>) {
        self.stop.start(Some(&self.registers).filter(|_| self.rounds > 0), speeds);
        self.continue_stop(now);
    }

    /// Makes every joint hold at its last known position, and sets these speeds. Does not wait for a confirmation, so that other
    /// targets can follow at once.
    pub fn hold(&mut self, now: Instant, speeds: [u8; 7]) {
        for (address, values) in hold_frames(&self.registers, speeds) {
            self.write(now, address, &values);
        }
    }

    /// As [`Self::hold`], but before all other queued frames. Returns the last bytes for the arm: the caller closes the line
    /// after them.
    pub fn hold_and_leave(&mut self, now: Instant, speeds: [u8; 7]) -> Vec<u8> {
        for (address, values) in hold_frames(&self.registers, speeds) {
            self.link.write_ahead(Map::V22, address, &values);
        }
        self.advance(now);
        std::mem::take(&mut self.to_send)
    }

    /// Takes the bytes that the arm has sent. Call it also without bytes, so that timeouts are noticed.
    pub fn receive(&mut self, now: Instant, bytes: &[u8]) {
        self.link.bytes(now, bytes);
        self.advance(now);
    }

    /// Handles all pending events of the link.
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

    /// Repeats the frames of an unconfirmed stop, and begins a new round of reads if the last one is over. Returns the bytes to
    /// send to the arm.
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

//! The line to the arm: frames out, replies in, each matched to the read that it answers.
//!
//! The arm answers in the order of the requests (D5). A reply belongs to the first read with its address and count; the
//! reads before it have lost theirs. Frames are written at the baud rate, so that no queue grows in the
//! kernel, where a later frame could not pass an earlier one.

use std::collections::VecDeque;

use protocol_core::registers::Map;
use protocol_core::request::Reply;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::deframer::gap;
use protocol_core::wire::frame::encode;
use protocol_core::wire::{Deframer, FrameBuffer, Function, ToHost};

use super::client::{Client, Event};
use super::client_id::ClientId;
use super::request::{WholeRequest, reply_bytes};
use super::stream::Stream;

/// The time for a reply, in addition to its time on the line. USB adapters take 16 ms each way; a busy computer takes
/// more.
const REPLY_TIMEOUT: Duration = Duration::from_millis(1_000);
/// After a timeout, replies are dropped for this time.
const LATE_REPLIES: Duration = Duration::from_millis(50);
/// The line may be filled this far ahead, so that it is not idle while the program wakes up.
const AHEAD: Duration = Duration::from_millis(1);
/// Bytes of replies that may be on their way. One read is always allowed.
const WINDOW: usize = 96;

/// The owner of a read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Owner {
    /// A client.
    Client(ClientId),
    /// The sampler.
    Sample(Stream),
    /// The hub, to find out whether a 7Bot V2 is there.
    Identity,
}

/// A read without a reply.
#[derive(Clone, Copy, Debug)]
struct Unanswered {
    owner: Owner,
    address: u8,
    count: u8,
    /// When its reply counts as lost.
    deadline: Instant,
}

/// The line.
#[derive(Debug)]
pub(crate) struct Line {
    deframer: Deframer<ToHost>,
    output: Vec<u8>,
    unanswered: VecDeque<Unanswered>,
    /// Reads before the last matched one, whose replies are lost.
    lost: VecDeque<Unanswered>,
    /// Bits per second.
    baud: u32,
    /// When the bytes sent so far have left.
    busy_until: Instant,
}

impl Line {
    pub(crate) fn new(baud: u32) -> Self {
        Self {
            deframer: Deframer::new(gap(baud)),
            output: Vec::new(),
            unanswered: VecDeque::new(),
            lost: VecDeque::new(),
            baud,
            busy_until: Instant::ZERO,
        }
    }

    /// Forgets all bytes: the port was opened or closed.
    pub(crate) fn reset(&mut self) {
        *self = Self { busy_until: self.busy_until, ..Self::new(self.baud) };
    }

    /// Takes bytes of the arm, and returns how many.
    pub(crate) fn push(&mut self, now: Instant, bytes: &[u8]) -> usize {
        self.deframer.push(now, bytes)
    }

    /// The next reply and its owner. Drops frames without an owner.
    pub(crate) fn next_reply(&mut self) -> Option<(Owner, Event)> {
        loop {
            if let Some(Unanswered { owner, address, count, .. }) = self.lost.pop_front() {
                return Some((owner, Event::NoReply { address, count }));
            }
            let Ok(frame) = self.deframer.pull()? else { continue };
            let Some(Reply { address, values }) = Reply::from_frame(frame) else { continue };
            let is_reply =
                |read: &Unanswered| read.address == address && usize::from(read.count) == values.len();
            let Some(place) = self.unanswered.iter().position(is_reply) else { continue };
            let values = values.to_vec();
            self.lost.extend(self.unanswered.drain(..place));
            if let Some(read) = self.unanswered.pop_front() {
                return Some((read.owner, Event::Reply { address, values }));
            }
        }
    }

    /// Is the line free for another frame?
    pub(crate) fn is_free(&self, now: Instant) -> bool {
        self.free_at(now) <= now
    }

    /// When the line is free for another frame.
    pub(crate) fn free_at(&self, now: Instant) -> Instant {
        if self.busy_until <= now + AHEAD {
            now
        } else {
            Instant::from_micros(self.busy_until.as_micros() - AHEAD.as_micros())
        }
    }

    /// When the last byte leaves, or has left.
    pub(crate) const fn idle_since(&self) -> Instant {
        self.busy_until
    }

    /// May reads be sent whose replies have `bytes` bytes?
    pub(crate) fn has_window(&self, bytes: usize) -> bool {
        let on_their_way: usize = self.unanswered.iter().map(|read| reply_bytes(read.count)).sum();
        on_their_way == 0 || on_their_way + bytes <= WINDOW
    }

    /// Can the client's oldest request be sent?
    pub(crate) fn takes(&self, client: &Client) -> bool {
        match client.waiting.front() {
            Some(WholeRequest::Read { count, .. }) => {
                client.can_receive && client.unanswered == 0 && self.has_window(reply_bytes(*count))
            }
            Some(WholeRequest::WritesBetweenReads { read: (_, count), .. }) => {
                client.can_receive && client.unanswered == 0 && self.has_window(2 * reply_bytes(*count))
            }
            Some(WholeRequest::Write { .. }) => client.unanswered == 0,
            None => false,
        }
    }

    pub(crate) fn send_read(&mut self, now: Instant, owner: Owner, address: u8, count: u8) {
        self.send(now, Function::Read, address, count, &[]);
        let line_time = self.time_of(reply_bytes(count) + WINDOW);
        let deadline = self.busy_until.max(now) + line_time + REPLY_TIMEOUT;
        self.unanswered.push_back(Unanswered { owner, address, count, deadline });
    }

    /// Sends a write with the function code of its map (M1).
    pub(crate) fn send_write(&mut self, now: Instant, map: Map, address: u8, values: &[u8]) {
        let function = match map {
            Map::V22 => Function::Write,
            Map::V21 => Function::WriteMap21,
        };
        let count = u8::try_from(values.len()).unwrap_or(u8::MAX);
        self.send(now, function, address, count, values);
    }

    fn send(&mut self, now: Instant, function: Function, address: u8, count: u8, values: &[u8]) {
        let mut frame = FrameBuffer::new();
        encode(&mut frame, function, address, count, values);
        self.output.extend_from_slice(&frame);
        self.busy_until = self.busy_until.max(now) + self.time_of(frame.len());
    }

    /// Time that bytes take on the line, each with start and stop bit.
    fn time_of(&self, bytes: usize) -> Duration {
        let bits = u64::try_from(bytes).unwrap_or(u64::MAX).saturating_mul(10_000_000);
        Duration::from_micros(bits.checked_div(self.baud.into()).unwrap_or(0))
    }

    /// Bytes for the arm.
    pub(crate) fn output(&self) -> &[u8] {
        &self.output
    }

    /// Removes bytes that were sent.
    pub(crate) fn consume(&mut self, count: usize) {
        self.output.drain(..count.min(self.output.len()));
    }

    /// Has the reply to the oldest read not come in time?
    pub(crate) fn has_timed_out(&self, now: Instant) -> bool {
        self.unanswered.front().is_some_and(|read| read.deadline <= now)
    }

    /// The reads without a reply, which are forgotten.
    pub(crate) fn take_unanswered(&mut self) -> Vec<(Owner, u8, u8)> {
        self.unanswered.drain(..).map(|read| (read.owner, read.address, read.count)).collect()
    }

    /// Sends nothing for a while, so that a late reply is not taken for the reply to a later read.
    pub(crate) fn discard_late_replies(&mut self, now: Instant) {
        self.busy_until = self.busy_until.max(now + LATE_REPLIES);
    }

    /// The next timeout: of a reply, or of an empty line for the deframer.
    pub(crate) fn deadline(&self) -> Instant {
        let reply = self.unanswered.front().map_or(Instant::FAR_FUTURE, |read| read.deadline);
        reply.min(self.deframer.deadline().unwrap_or(Instant::FAR_FUTURE))
    }
}

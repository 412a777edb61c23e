//! The client of a load: it keeps a window of reads pending.

use std::collections::VecDeque;
use std::io::{self, ErrorKind, IsTerminal, Read, Write};
use std::time::{Duration, Instant};

use protocol_core::registers::map::{
    FEEDBACK_FREQUENCY, PRESENT_POSITION, SPEED, STATUS_VERSION, TARGET_POSITION,
};
use protocol_core::request::{Reply, Request};
use protocol_core::wire::frame::{CRC_LENGTH, PREFIX_LENGTH};
use protocol_core::wire::{Deframer, FrameBuffer, ToHost, deframer};
use serialport::SerialPort;

use super::args::{LoadArgs, LoadError};
use super::result::LoadResult;

/// A reply is lost if it does not arrive within this time. A busy machine may be late by seconds.
const REPLY_TIMEOUT: Duration = Duration::from_secs(60);
/// The timeout of one read of the port.
const READ_TIMEOUT: Duration = Duration::from_millis(1);
/// The memory is measured only after this time, when every buffer has been used once.
const WARM_UP: Duration = Duration::from_secs(10);
/// One request in this many is a write.
const WRITE_PERIOD: u64 = 8;

/// A read without a reply yet.
#[derive(Clone, Copy, Debug)]
struct PendingRead {
    address: u8,
    count: u8,
    since: Instant,
    /// The number of bytes sent up to the end of this read.
    sent: u64,
}

pub(super) struct LoadClient {
    port: Box<dyn SerialPort>,
    deframer: Deframer<ToHost>,
    start: Instant,
    window: usize,
    pending: VecDeque<PendingRead>,
    requests: u64,
    /// The number of bytes sent, and how many of these were sent up to the last read that has a reply.
    sent: u64,
    acknowledged: u64,
    result: LoadResult,
}

impl LoadClient {
    pub(super) fn open(args: &LoadArgs) -> Result<Self, LoadError> {
        let port = serialport::new(&args.port, args.baud).timeout(READ_TIMEOUT).open();
        let port = port.map_err(|cause| LoadError::Port { port: args.port.clone(), cause })?;
        Ok(Self {
            port,
            deframer: Deframer::new(deframer::gap(args.baud)),
            start: Instant::now(),
            window: usize::try_from(args.window).unwrap_or(1),
            pending: VecDeque::new(),
            requests: 0,
            sent: 0,
            acknowledged: 0,
            result: LoadResult::default(),
        })
    }

    pub(super) fn fill_window(&mut self) -> Result<(), LoadError> {
        while self.pending.len() < self.window {
            self.requests += 1;
            if self.requests.is_multiple_of(WRITE_PERIOD) {
                self.send_write()?;
            } else {
                self.send_read()?;
            }
        }
        Ok(())
    }

    /// Sends a read of varying address and length. No read has the range of a report, so a reply never looks like one.
    fn send_read(&mut self) -> Result<(), LoadError> {
        let [a, b, ..] = self.requests.wrapping_mul(0x9E37_79B9_7F4A_7C15).to_be_bytes();
        let (address, count) = match a % 4 {
            0 => (STATUS_VERSION.address, 16),
            1 => (b % 50, 1 + a % 10),
            2 => (0, 61),
            _ => (TARGET_POSITION.address, 7),
        };
        self.send(&Request::Read { address, count })?;
        let (since, sent) = (Instant::now(), self.sent);
        self.pending.push_back(PendingRead { address, count, since, sent });
        self.result.reads += 1;
        self.count_pending();
        Ok(())
    }

    fn send_write(&mut self) -> Result<(), LoadError> {
        let swing = u8::try_from(self.requests / 1_024 % 40).unwrap_or(0);
        let turn = (self.requests / WRITE_PERIOD).is_multiple_of(2);
        if turn {
            self.set(SPEED.address, &[60; 7])
        } else {
            self.set(TARGET_POSITION.address, &[70 + swing; 6])
        }
    }

    /// Makes the arm send reports at 50 Hz.
    pub(super) fn start_reports(&mut self) -> Result<(), LoadError> {
        self.set(FEEDBACK_FREQUENCY.address, &[50])
    }

    fn set(&mut self, address: u8, values: &[u8]) -> Result<(), LoadError> {
        self.result.writes += 1;
        self.send(&Request::Write { address, values })
    }

    fn send(&mut self, request: &Request<'_>) -> Result<(), LoadError> {
        let mut frame = FrameBuffer::new();
        request.encode(&mut frame);
        self.sent += frame.len() as u64;
        let mut rest = frame.as_slice();
        while !rest.is_empty() {
            match self.port.write(rest) {
                Ok(count) => rest = rest.get(count..).unwrap_or(&[]),
                // The port is full. Reading replies lets the arm take more requests.
                Err(error) if is_temporary(&error) => self.receive()?,
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    pub(super) fn receive(&mut self) -> Result<(), LoadError> {
        let mut bytes = [0; 4_096];
        let count = match self.port.read(&mut bytes) {
            Ok(0) => return Err(io::Error::from(ErrorKind::UnexpectedEof).into()),
            Ok(count) => count,
            Err(error) if is_temporary(&error) => 0,
            Err(error) => return Err(error.into()),
        };
        self.result.bytes += count as u64;
        let mut rest = bytes.get(..count).unwrap_or(&[]);
        // The deframer is not told about silence: on a busy machine the rest of a reply may come later than the timeout
        // of a frame (D4).
        while !rest.is_empty() {
            let taken = self.deframer.push(self.now(), rest);
            rest = rest.get(taken..).unwrap_or(&[]);
            self.take_frames();
        }
        Ok(())
    }

    fn take_frames(&mut self) {
        while let Some(found) = self.deframer.pull() {
            let Ok(Some(reply)) = found.map(Reply::from_frame) else {
                self.result.corrupted += 1;
                continue;
            };
            let (address, count) = (reply.address, u8::try_from(reply.values.len()).unwrap_or(0));
            if (address, count) == (PRESENT_POSITION.address, PRESENT_POSITION.count) {
                self.result.reports += 1;
            } else {
                self.take_reply(address, count);
            }
        }
    }

    /// Replies arrive in the order of the reads. A reply to a later read means that the replies before it are lost.
    fn take_reply(&mut self, address: u8, count: u8) {
        let is_for = |read: &PendingRead| (read.address, read.count) == (address, count);
        let Some(index) = self.pending.iter().position(is_for) else {
            self.result.unexpected += 1;
            return;
        };
        self.result.lost += index as u64;
        self.result.replies += 1;
        let Some(read) = self.pending.drain(..=index).next_back() else { return };
        self.acknowledged = read.sent;
        self.result.round_trips.add(read.since.elapsed());
    }

    /// Updates the largest number of pending bytes. Apart from reports, no queue between this client and the arm can hold more.
    fn count_pending(&mut self) {
        let reply = |read: &PendingRead| (PREFIX_LENGTH + usize::from(read.count) + CRC_LENGTH) as u64;
        let pending = (self.sent - self.acknowledged, self.pending.iter().map(reply).sum());
        let max = &mut self.result.max_pending;
        *max = (max.0.max(pending.0), max.1.max(pending.1));
    }

    pub(super) fn drop_lost_reads(&mut self) {
        while self.pending.front().is_some_and(|first| first.since.elapsed() > REPLY_TIMEOUT) {
            self.pending.pop_front();
            self.result.lost += 1;
        }
    }

    pub(super) fn measure_memory(&mut self, pid: Option<u32>) {
        if let Some(pid) = pid.filter(|_| self.start.elapsed() > WARM_UP) {
            self.result.memory.measure(pid);
        }
    }

    pub(super) fn show_progress(&self, time: Duration) {
        if io::stderr().is_terminal() {
            let (now, all) = (self.start.elapsed().as_secs(), time.as_secs());
            let LoadResult { replies, lost, .. } = self.result;
            let _ = write!(io::stderr(), "\r{now} of {all} s, {replies} replies, {lost} lost   ");
        }
    }

    /// Stops the reports, and waits for the pending replies.
    pub(super) fn finish(mut self) -> Result<LoadResult, LoadError> {
        self.result.elapsed = self.start.elapsed();
        self.set(FEEDBACK_FREQUENCY.address, &[0])?;
        while !self.pending.is_empty() {
            self.receive()?;
            self.drop_lost_reads();
        }
        Ok(self.result)
    }

    pub(super) fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }

    fn now(&self) -> protocol_core::time::Instant {
        let micros = self.start.elapsed().as_micros();
        protocol_core::time::Instant::from_micros(u64::try_from(micros).unwrap_or(u64::MAX))
    }
}

fn is_temporary(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock)
}

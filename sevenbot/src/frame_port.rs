//! Frames over a line: sends requests, receives replies, counts everything else.
//!
//! Does not match replies to requests; `pending.rs` does.

use std::time::{Duration, Instant};

use protocol_core::request::{Reply, Report, Request};
use protocol_core::time;
use protocol_core::wire::deframer::gap;
use protocol_core::wire::{Deframer, Frame, FrameBuffer, ToHost};
use tracing::{debug, trace};

use crate::error::{PortError, ReceiveCounts};
use crate::host_line::HostLine;
use crate::snapshot::Snapshot;
use crate::traffic::Traffic;

/// A frame from the arm.
#[derive(Debug)]
pub(crate) enum Received {
    /// Function 03: a reply, or a report of map 2.2.
    Reply(Snapshot),
    /// Function 05: a report of map 2.1.
    Report(Snapshot),
}

/// A line with a deframer.
pub(crate) struct FramePort {
    line: Box<dyn HostLine>,
    deframer: Deframer<ToHost>,
    /// Bytes from the line that the deframer had no room for.
    waiting: Vec<u8>,
    received: ReceiveCounts,
    start: Instant,
}

impl FramePort {
    pub(crate) fn new(line: Box<dyn HostLine>, baud: u32) -> Self {
        let start = line.now();
        Self {
            line,
            deframer: Deframer::new(gap(baud)),
            waiting: Vec::new(),
            received: ReceiveCounts::default(),
            start,
        }
    }

    pub(crate) fn send(&mut self, request: &Request<'_>) -> Result<(), PortError> {
        let mut frame = FrameBuffer::new();
        request.encode(&mut frame);
        trace!("-> {}", Traffic::from(request));
        self.line.send(&frame)
    }

    /// The next reply or report; `None` if none arrives before `deadline`.
    pub(crate) fn receive(&mut self, deadline: Instant) -> Result<Option<Received>, PortError> {
        loop {
            if let Some(reply) = self.pull() {
                return Ok(Some(reply));
            }
            if self.feed() {
                continue;
            }
            let now = self.line.now();
            if now >= deadline {
                return Ok(None);
            }
            self.read(self.wake_up(deadline) - now)?;
        }
    }

    /// The next reply or report that has already arrived.
    pub(crate) fn receive_waiting(&mut self) -> Result<Option<Received>, PortError> {
        loop {
            if let Some(reply) = self.pull() {
                return Ok(Some(reply));
            }
            if self.feed() {
                continue;
            }
            if !self.read(Duration::ZERO)? {
                return Ok(None);
            }
        }
    }

    /// The clock of the line.
    pub(crate) fn now(&self) -> Instant {
        self.line.now()
    }

    /// Waits on the clock of the line.
    pub(crate) fn sleep(&mut self, duration: Duration) {
        self.line.sleep(duration);
    }

    /// The counts since the last call.
    pub(crate) fn take_received(&mut self) -> ReceiveCounts {
        std::mem::take(&mut self.received)
    }

    fn pull(&mut self) -> Option<Received> {
        while let Some(found) = self.deframer.pull() {
            match found.map(received) {
                Ok(received) => {
                    self.received.other_frames += 1;
                    if received.is_some() {
                        return received;
                    }
                }
                Err(defect) => {
                    self.received.damaged_frames += 1;
                    debug!("<- a damaged frame: {defect:?}");
                }
            }
        }
        None
    }

    /// Moves bytes to the deframer, as many as it takes. `false` if there are none.
    fn feed(&mut self) -> bool {
        if self.waiting.is_empty() {
            return false;
        }
        let now = self.time_at(self.line.now());
        let taken = self.deframer.push(now, &self.waiting);
        self.waiting.drain(..taken.min(self.waiting.len()));
        taken > 0
    }

    /// Reads from the line. Without bytes within `timeout` it reports an empty line to the deframer and returns
    /// `false`.
    fn read(&mut self, timeout: Duration) -> Result<bool, PortError> {
        // Use the planned end of the wait. After a suspension the actual end is later, with bytes still in the line.
        let end = self.time_at(self.line.now() + timeout);
        let bytes = self.line.receive(timeout)?;
        self.received.bytes += bytes.len();
        if bytes.is_empty() {
            self.deframer.push(end, &[]);
        }
        self.waiting.extend(&bytes);
        Ok(!bytes.is_empty())
    }

    /// The deadline, or the earlier time when the deframer expects to hear of an empty line.
    fn wake_up(&self, deadline: Instant) -> Instant {
        let silence = self.deframer.deadline();
        let silence = silence.map(|at| self.start + Duration::from_micros(at.as_micros()));
        silence.map_or(deadline, |at| at.min(deadline)).max(self.line.now())
    }

    fn time_at(&self, at: Instant) -> time::Instant {
        let micros = at.duration_since(self.start).as_micros();
        time::Instant::from_micros(u64::try_from(micros).unwrap_or(u64::MAX))
    }
}

/// The content of a frame; `None` for an alarm, and for a request, which may be an echo.
fn received(frame: Frame<'_>) -> Option<Received> {
    let snapshot = |address, values: &[u8]| Snapshot { address, values: values.to_vec() };
    trace!("<- {}", Traffic::from_frame::<ToHost>(&frame));
    let reply = Reply::from_frame(frame).map(|it| Received::Reply(snapshot(it.address, it.values)));
    reply.or_else(|| {
        Some(Received::Report(Report::from_frame(frame).map(|it| snapshot(it.address, it.values))?))
    })
}

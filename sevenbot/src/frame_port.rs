//! Frames over a serial port: requests out, replies in, and what was received in between.
//!
//! Knows neither which reply answers which request, nor what a register means.

use std::time::{Duration, Instant};

use protocol_core::request::{Reply, Request};
use protocol_core::time;
use protocol_core::wire::deframer::gap;
use protocol_core::wire::{Deframer, FrameBuffer, ToHost};
use tracing::{debug, trace};

use crate::error::{PortError, ReceiveCounts};
use crate::open_port::OpenPort;
use crate::snapshot::Snapshot;
use crate::traffic::Traffic;

/// A serial port that speaks in frames.
pub(crate) struct FramePort {
    port: OpenPort,
    deframer: Deframer<ToHost>,
    /// What the port brought and the deframer has not taken yet.
    waiting: Vec<u8>,
    received: ReceiveCounts,
    start: Instant,
}

impl FramePort {
    pub(crate) fn new(port: OpenPort, baud: u32) -> Self {
        Self {
            port,
            deframer: Deframer::new(gap(baud)),
            waiting: Vec::new(),
            received: ReceiveCounts::default(),
            start: Instant::now(),
        }
    }

    pub(crate) fn send(&mut self, request: &Request<'_>) -> Result<(), PortError> {
        let mut frame = FrameBuffer::new();
        request.encode(&mut frame);
        trace!("-> {}", Traffic::from(request));
        self.port.send(&frame)
    }

    /// The next reply, asked for or not; `None` when none came before `deadline`.
    pub(crate) fn receive(&mut self, deadline: Instant) -> Result<Option<Snapshot>, PortError> {
        loop {
            if let Some(reply) = self.pull() {
                return Ok(Some(reply));
            }
            if self.feed() {
                continue;
            }
            let now = Instant::now();
            if now >= deadline {
                return Ok(None);
            }
            self.read(self.wake_up(deadline) - now)?;
        }
    }

    /// The next reply among the bytes that are already here.
    pub(crate) fn receive_waiting(&mut self) -> Result<Option<Snapshot>, PortError> {
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

    /// What was received since this was last asked.
    pub(crate) fn take_received(&mut self) -> ReceiveCounts {
        std::mem::take(&mut self.received)
    }

    fn pull(&mut self) -> Option<Snapshot> {
        while let Some(found) = self.deframer.pull() {
            match found.map(Reply::from_frame) {
                Ok(Some(reply)) => {
                    self.received.other_frames += 1;
                    let reply = Snapshot { address: reply.address, values: reply.values.to_vec() };
                    trace!("<- {}", Traffic::from(&reply));
                    return Some(reply);
                }
                Ok(None) => self.received.other_frames += 1,
                Err(defect) => {
                    self.received.damaged_frames += 1;
                    debug!("<- a damaged frame: {defect:?}");
                }
            }
        }
        None
    }

    /// Hands waiting bytes to the deframer, as many as it takes; `false` when there are none.
    fn feed(&mut self) -> bool {
        if self.waiting.is_empty() {
            return false;
        }
        let now = self.time_at(Instant::now());
        let taken = self.deframer.push(now, &self.waiting);
        self.waiting.drain(..taken.min(self.waiting.len()));
        taken > 0
    }

    /// Takes what comes within `timeout`. If nothing does, returns `false` and tells the deframer of the silence.
    fn read(&mut self, timeout: Duration) -> Result<bool, PortError> {
        // Not the time after the wait: a process that was suspended meanwhile may find bytes in the port.
        let end = self.time_at(Instant::now() + timeout);
        let bytes = self.port.receive(timeout)?;
        self.received.bytes += bytes.len();
        if bytes.is_empty() {
            self.deframer.push(end, &[]);
        }
        self.waiting.extend(&bytes);
        Ok(!bytes.is_empty())
    }

    /// The deadline, or an earlier point where silence would tell the deframer something.
    fn wake_up(&self, deadline: Instant) -> Instant {
        let silence = self.deframer.deadline();
        let silence = silence.map(|at| self.start + Duration::from_micros(at.as_micros()));
        silence.map_or(deadline, |at| at.min(deadline)).max(Instant::now())
    }

    fn time_at(&self, at: Instant) -> time::Instant {
        let micros = at.duration_since(self.start).as_micros();
        time::Instant::from_micros(u64::try_from(micros).unwrap_or(u64::MAX))
    }
}

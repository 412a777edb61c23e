//! Frames over a serial port: requests out, replies in, and what was heard in between.
//!
//! Knows neither which reply answers which request, nor what a register means.

use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use protocol_core::request::{Reply, Request};
use protocol_core::time;
use protocol_core::wire::deframer::gap;
use protocol_core::wire::{Deframer, FrameBuffer, ToHost};
use serialport::SerialPort;
use tracing::{debug, trace};

use crate::error::{Error, Heard};
use crate::snapshot::Snapshot;
use crate::traffic::Traffic;

/// The shortest time-out that every platform takes for what it is.
const SHORTEST_WAIT: Duration = Duration::from_millis(1);
/// How long the port may refuse to take more bytes.
const WRITE_TIMEOUT: Duration = Duration::from_secs(2);

/// A serial port that speaks in frames.
pub(crate) struct Link {
    port: Box<dyn SerialPort>,
    deframer: Deframer<ToHost>,
    /// What the port brought and the deframer has not taken yet.
    waiting: Vec<u8>,
    heard: Heard,
    start: Instant,
}

impl Link {
    pub(crate) fn new(port: Box<dyn SerialPort>, baud: u32) -> Self {
        Self {
            port,
            deframer: Deframer::new(gap(baud)),
            waiting: Vec::new(),
            heard: Heard::default(),
            start: Instant::now(),
        }
    }

    pub(crate) fn send(&mut self, request: &Request<'_>) -> Result<(), Error> {
        let mut frame = FrameBuffer::new();
        request.encode(&mut frame);
        trace!("-> {}", Traffic::from(request));
        self.port.set_timeout(WRITE_TIMEOUT).map_err(lost)?;
        self.port.write_all(&frame).map_err(|error| match error.kind() {
            ErrorKind::TimedOut => Error::Stalled,
            kind => Error::PortLost(kind),
        })
    }

    /// The next reply, asked for or not; `None` when none came before `deadline`.
    pub(crate) fn receive(&mut self, deadline: Instant) -> Result<Option<Snapshot>, Error> {
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
    pub(crate) fn receive_waiting(&mut self) -> Result<Option<Snapshot>, Error> {
        loop {
            if let Some(reply) = self.pull() {
                return Ok(Some(reply));
            }
            if self.feed() {
                continue;
            }
            if self.port.bytes_to_read().map_err(lost)? == 0 {
                return Ok(None);
            }
            self.read(SHORTEST_WAIT)?;
        }
    }

    /// What was heard since this was last asked.
    pub(crate) fn take_heard(&mut self) -> Heard {
        std::mem::take(&mut self.heard)
    }

    fn pull(&mut self) -> Option<Snapshot> {
        while let Some(found) = self.deframer.pull() {
            match found.map(Reply::from_frame) {
                Ok(Some(reply)) => {
                    self.heard.other_frames += 1;
                    let reply = Snapshot { address: reply.address, values: reply.values.to_vec() };
                    trace!("<- {}", Traffic::from(&reply));
                    return Some(reply);
                }
                Ok(None) => self.heard.other_frames += 1,
                Err(defect) => {
                    self.heard.damaged_frames += 1;
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
        let now = self.now();
        let taken = self.deframer.push(now, &self.waiting);
        self.waiting.drain(..taken.min(self.waiting.len()));
        taken > 0
    }

    /// Reads what is there; waits for it no longer than `patience`, and tells the deframer of the silence.
    fn read(&mut self, patience: Duration) -> Result<(), Error> {
        let mut chunk = [0; 1024];
        self.port.set_timeout(patience.max(SHORTEST_WAIT)).map_err(lost)?;
        match self.port.read(&mut chunk) {
            Ok(0) => Err(Error::PortLost(ErrorKind::UnexpectedEof)),
            Ok(length) => {
                self.heard.bytes += length;
                self.waiting.extend(chunk.iter().take(length));
                Ok(())
            }
            Err(error) if error.kind() == ErrorKind::TimedOut => {
                let now = self.now();
                self.deframer.push(now, &[]);
                Ok(())
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => Ok(()),
            Err(error) => Err(Error::PortLost(error.kind())),
        }
    }

    /// The deadline, or an earlier point where silence would tell the deframer something.
    fn wake_up(&self, deadline: Instant) -> Instant {
        let silence = self.deframer.deadline();
        let silence = silence.map(|at| self.start + Duration::from_micros(at.as_micros()));
        silence.map_or(deadline, |at| at.min(deadline)).max(Instant::now())
    }

    fn now(&self) -> time::Instant {
        let micros = self.start.elapsed().as_micros();
        time::Instant::from_micros(u64::try_from(micros).unwrap_or(u64::MAX))
    }
}

fn lost(error: serialport::Error) -> Error {
    Error::PortLost(std::io::Error::from(error).kind())
}

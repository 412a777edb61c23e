//! Bytes between a client that speaks frames and the hub, whatever carries them.

use std::io;

use protocol_core::time::Instant;
use rustix::event::PollFlags;

use crate::frame_client::FrameClient;
use crate::hub::Hub;

/// Carries bytes of a client without blocking.
pub(crate) trait ByteStream {
    /// Reads bytes. 0 means that there are none now.
    fn read(&self, bytes: &mut [u8]) -> io::Result<usize>;
    /// Writes bytes, and returns how many were accepted.
    fn write(&self, bytes: &[u8]) -> io::Result<usize>;
}

/// A client of the hub, and the bytes that it still has to take.
#[derive(Debug)]
pub(crate) struct FrameConnection {
    client: FrameClient,
    input: Vec<u8>,
}

impl FrameConnection {
    pub(crate) fn new(hub: &mut Hub, baud: u32) -> Self {
        Self { client: FrameClient::connect(hub, baud), input: Vec::new() }
    }

    pub(crate) fn disconnect(self, hub: &mut Hub, now: Instant) {
        self.client.disconnect(hub, now);
    }

    /// Another client uses the same wire from now on. The bytes that were read stay.
    pub(crate) fn replace_client(&mut self, hub: &mut Hub, now: Instant, baud: u32) {
        std::mem::replace(&mut self.client, FrameClient::connect(hub, baud)).disconnect(hub, now);
    }

    /// Reads bytes, unless earlier ones wait. Returns the number of bytes.
    pub(crate) fn read(&mut self, wire: &impl ByteStream) -> io::Result<usize> {
        if !self.input.is_empty() {
            return Ok(0);
        }
        let mut bytes = [0; 1_024];
        let count = wire.read(&mut bytes)?;
        self.input.extend_from_slice(bytes.get(..count).unwrap_or(&[]));
        Ok(count)
    }

    /// Adds bytes that the caller has read.
    pub(crate) fn put(&mut self, bytes: &[u8]) {
        self.input.extend_from_slice(bytes);
    }

    /// Passes the bytes to the hub, or states that there are none.
    pub(crate) fn push(&mut self, hub: &mut Hub, now: Instant) {
        let count = self.client.push(hub, now, &self.input);
        self.input.drain(..count.min(self.input.len()));
    }

    /// Takes replies and reports from the hub and writes them; without a `wire` they are dropped.
    pub(crate) fn send(&mut self, hub: &mut Hub, wire: Option<&impl ByteStream>) -> io::Result<()> {
        self.client.collect(hub);
        let count = match wire {
            Some(_) if self.client.output().is_empty() => 0,
            Some(wire) => wire.write(self.client.output())?,
            None => self.client.output().len(),
        };
        self.client.consume(count);
        self.client.collect(hub);
        Ok(())
    }

    /// Takes replies and reports from the hub, for a wire that carries messages.
    pub(crate) fn take_output(&mut self, hub: &mut Hub) -> Vec<u8> {
        self.client.collect(hub);
        let bytes = self.client.output().to_vec();
        self.client.consume(bytes.len());
        bytes
    }

    /// Are there no bytes that wait?
    pub(crate) fn has_room(&self) -> bool {
        self.input.is_empty()
    }

    pub(crate) fn interest(&self) -> PollFlags {
        let mut interest = PollFlags::empty();
        interest.set(PollFlags::IN, self.input.is_empty());
        interest.set(PollFlags::OUT, !self.client.output().is_empty());
        interest
    }

    /// When silence of the client has an effect.
    pub(crate) fn deadline(&self) -> Instant {
        if self.input.is_empty() { self.client.deadline() } else { Instant::FAR_FUTURE }
    }
}

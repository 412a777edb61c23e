//! A client of the hub that speaks frames, whatever carries its bytes.

use std::sync::Arc;

use protocol_core::time::Instant;

use super::seat::{End, Seat};
use super::shared::SharedHub;
use crate::frame_client::FrameClient;

/// A client of the hub, and the bytes that the hub has no room for yet. A dropped session is a broken connection.
#[derive(Debug)]
pub(super) struct FrameSession {
    seat: Seat,
    client: FrameClient,
    input: Vec<u8>,
    /// The bytes of `input` were sent at this time or later.
    since: Instant,
}

impl FrameSession {
    pub(super) fn open(shared: &Arc<SharedHub>) -> Self {
        let connect = |hub: &mut _| FrameClient::connect(hub, shared.baud);
        let (seat, client) = Seat::take(shared, connect, FrameClient::id);
        Self { seat, client, input: Vec::new(), since: Instant::ZERO }
    }

    /// Adds bytes that the client sent at `since` or later.
    pub(super) fn put(&mut self, since: Instant, bytes: &[u8]) {
        if self.input.is_empty() {
            self.since = since;
        }
        self.input.extend_from_slice(bytes);
    }

    /// Passes bytes to the hub as far as it has room, and collects replies and reports.
    pub(super) fn exchange(&mut self) {
        let Self { seat, client, input, since } = self;
        seat.shared().with_client(|hub, now| {
            let taken = client.push(hub, now, (*since).min(now), input);
            input.drain(..taken.min(input.len()));
            if input.is_empty() {
                client.set_drops_reads(false);
            }
            client.collect(hub);
        });
    }

    pub(super) fn has_room(&self) -> bool {
        self.input.is_empty()
    }

    /// Bytes for the client.
    pub(super) fn output(&self) -> &[u8] {
        self.client.output()
    }

    /// Removes bytes that the client took.
    pub(super) fn consume(&mut self, count: usize) {
        self.client.consume(count);
    }

    /// Takes all bytes for the client.
    pub(super) fn take_output(&mut self) -> Vec<u8> {
        let bytes = self.output().to_vec();
        self.consume(bytes.len());
        bytes
    }

    /// Ends when [`FrameSession::exchange`] has something to do: the hub has news, or silence of the client has an effect.
    pub(super) async fn news(&self) {
        let is_through = self.input.is_empty();
        self.seat.news_until(if is_through { self.client.deadline() } else { Instant::FAR_FUTURE }).await;
    }

    /// Ends this client, and opens the session of the next one on the same terminal. Keeps the bytes that the hub has not taken
    /// yet.
    #[cfg(target_os = "linux")] // Pseudo-terminals are for Linux.
    pub(super) fn succeed(self) -> Self {
        let mut next = Self::open(self.seat.shared());
        (next.input, next.since) = (self.input, self.since);
        self.seat.leave(End::Clean);
        next
    }

    /// States whether the bytes that the hub has not taken yet come from a client that is gone. Then its writes are carried
    /// out, and its reads are dropped.
    #[cfg(target_os = "linux")] // For pseudo-terminals.
    pub(super) const fn set_drops_reads(&mut self, are_of_the_one_before: bool) {
        self.client.set_drops_reads(are_of_the_one_before);
    }

    /// Ends the session. If the client closed the connection, first passes the last bytes to the hub as far as it has room.
    pub(super) fn close(mut self, end: End) {
        if end == End::Clean {
            self.exchange();
        }
        self.seat.leave(end);
    }
}

//! A client of the hub that speaks frames, whatever carries its bytes.

use std::sync::Arc;

use protocol_core::time::Instant;
use tokio::sync::Notify;

use super::shared::Shared;
use crate::frame_client::FrameClient;

/// How a connection ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// The client closed it: what it sent before is carried out.
    Clean,
    /// It broke, or the client did what it must not do: nothing more is carried out.
    Broken,
}

/// A client of the hub, and the bytes that the hub has no room for yet. A dropped session is a broken connection.
#[derive(Debug)]
pub(super) struct FrameSession {
    shared: Arc<Shared>,
    client: Option<FrameClient>,
    wake: Arc<Notify>,
    input: Vec<u8>,
    /// The bytes of `input` were sent at this time or later.
    since: Instant,
}

impl FrameSession {
    pub(super) fn open(shared: &Arc<Shared>) -> Self {
        let client = shared.with_client(|hub, _| FrameClient::connect(hub, shared.baud));
        let wake = shared.join(client.id());
        let (shared, since) = (Arc::clone(shared), Instant::ZERO);
        Self { shared, client: Some(client), wake, input: Vec::new(), since }
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
        let Some(client) = &mut self.client else { return };
        let (input, since) = (&mut self.input, self.since);
        self.shared.with_client(|hub, now| {
            let taken = client.push(hub, now, since.min(now), input);
            input.drain(..taken.min(input.len()));
            client.collect(hub);
        });
    }

    /// May more bytes be put?
    pub(super) fn has_room(&self) -> bool {
        self.input.is_empty()
    }

    /// Bytes for the client.
    pub(super) fn output(&self) -> &[u8] {
        self.client.as_ref().map_or(&[], FrameClient::output)
    }

    /// Removes bytes that the client took.
    pub(super) fn consume(&mut self, count: usize) {
        self.client.iter_mut().for_each(|client| client.consume(count));
    }

    /// Takes all bytes for the client.
    pub(super) fn take_output(&mut self) -> Vec<u8> {
        let bytes = self.output().to_vec();
        self.consume(bytes.len());
        bytes
    }

    /// Ends when [`FrameSession::exchange`] has something to do: the hub has news, or silence of the client has an effect.
    pub(super) async fn news(&self) {
        let deadline = match &self.client {
            Some(client) if self.input.is_empty() => client.deadline(),
            _ => Instant::FAR_FUTURE,
        };
        tokio::select! {
            () = self.wake.notified() => {}
            () = self.shared.sleep_until(deadline) => {}
        }
    }

    /// Another client uses the same wire from now on. The bytes that the hub has not got yet may be its own.
    pub(super) fn succeed(mut self) -> Self {
        let mut next = Self::open(&self.shared);
        (next.input, next.since) = (std::mem::take(&mut self.input), self.since);
        self.leave(End::Clean);
        next
    }

    /// The connection has ended.
    pub(super) fn close(mut self, end: End) {
        if end == End::Clean {
            self.exchange();
            self.leave(end);
        }
    }

    fn leave(&mut self, end: End) {
        let Some(client) = self.client.take() else { return };
        self.shared.part(client.id());
        self.shared.with_client(|hub, now| match end {
            End::Clean => client.leave(hub, now),
            End::Broken => client.disconnect(hub, now),
        });
    }
}

impl Drop for FrameSession {
    fn drop(&mut self) {
        self.leave(End::Broken);
    }
}

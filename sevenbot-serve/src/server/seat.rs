//! The place of a connection among the clients of the hub: taken when it opens, and left when it ends.

use std::sync::Arc;

use protocol_core::time::Instant;
use tokio::sync::Notify;

use super::shared::SharedHub;
use crate::hub::{ClientId, Hub};

/// How a connection ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// The client closed it: the writes that it sent before are carried out.
    Clean,
    /// It broke, or the client broke a rule of the server: nothing more is carried out.
    Broken,
}

/// The place of a connection. If it is dropped without [`Seat::leave`], the connection counts as broken.
#[derive(Debug)]
pub(super) struct Seat {
    shared: Arc<SharedHub>,
    id: ClientId,
    wake: Arc<Notify>,
    end: End,
}

impl Seat {
    /// Connects a client to the hub.
    pub(super) fn take<C>(
        shared: &Arc<SharedHub>,
        connect: impl FnOnce(&mut Hub) -> C,
        id: impl FnOnce(&C) -> ClientId,
    ) -> (Self, C) {
        let client = shared.with_client(|hub, _| connect(hub));
        let id = id(&client);
        (Self { shared: Arc::clone(shared), id, wake: shared.join(id), end: End::Broken }, client)
    }

    pub(super) const fn shared(&self) -> &Arc<SharedHub> {
        &self.shared
    }

    /// Ends when the hub has news for the client, or at this time.
    pub(super) async fn news_until(&self, deadline: Instant) {
        tokio::select! {
            () = self.wake.notified() => {}
            () = self.shared.sleep_until(deadline) => {}
        }
    }

    /// Leaves the place after the connection has ended.
    pub(super) fn leave(mut self, end: End) {
        self.end = end;
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.shared.part(self.id);
        self.shared.with_client(|hub, now| match self.end {
            End::Clean => hub.leave(now, self.id),
            End::Broken => hub.disconnect(now, self.id),
        });
    }
}

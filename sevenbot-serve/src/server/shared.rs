//! The hub, shared by the tasks of the connections and the task of the arm's port.
//!
//! All tasks run in one thread, and none waits while it has the hub: the lock is never contended.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use protocol_core::time::Instant;
use tokio::sync::Notify;

use crate::hub::{ClientId, Hub};

/// The hub, and who has to hear of its news.
#[derive(Debug)]
pub(super) struct Shared {
    hub: Mutex<Hub>,
    clients: Mutex<BTreeMap<ClientId, Arc<Notify>>>,
    /// Clients did something that the task of the arm's port has to look at.
    arm: Notify,
    pub(super) baud: u32,
    start: std::time::Instant,
}

impl Shared {
    pub(super) fn new(hub: Hub, baud: u32) -> Arc<Self> {
        Arc::new(Self {
            hub: Mutex::new(hub),
            clients: Mutex::default(),
            arm: Notify::new(),
            baud,
            start: std::time::Instant::now(),
        })
    }

    pub(super) fn now(&self) -> Instant {
        Instant::from_micros(u64::try_from(self.start.elapsed().as_micros()).unwrap_or(u64::MAX))
    }

    /// For the task of the arm's port: uses the hub, and wakes the clients that have news.
    pub(super) fn with_hub<T>(&self, work: impl FnOnce(&mut Hub, Instant) -> T) -> T {
        let mut hub = lock(&self.hub);
        let done = work(&mut hub, self.now());
        let news = hub.take_news();
        drop(hub);
        if !news.is_empty() {
            let clients = lock(&self.clients);
            news.iter().filter_map(|id| clients.get(id)).for_each(|client| client.notify_one());
        }
        done
    }

    /// For a client: the same, and wakes the task of the arm's port.
    pub(super) fn with_client<T>(&self, work: impl FnOnce(&mut Hub, Instant) -> T) -> T {
        let done = self.with_hub(work);
        self.arm.notify_one();
        done
    }

    /// A new client of the hub.
    pub(super) fn join(&self, id: ClientId) -> Arc<Notify> {
        let wake = Arc::new(Notify::new());
        lock(&self.clients).insert(id, Arc::clone(&wake));
        wake
    }

    pub(super) fn part(&self, id: ClientId) {
        lock(&self.clients).remove(&id);
    }

    /// Ends when clients did something.
    pub(super) async fn clients_acted(&self) {
        self.arm.notified().await;
    }

    /// Ends at this time of [`Shared::now`].
    pub(super) async fn sleep_until(&self, time: Instant) {
        if time == Instant::FAR_FUTURE {
            std::future::pending().await
        }
        let at = self.start + std::time::Duration::from_micros(time.as_micros());
        tokio::time::sleep_until(at.into()).await;
    }
}

/// A task that panicked leaves a hub that others can use: each of its steps is complete.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

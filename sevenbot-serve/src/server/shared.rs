//! The hub, shared by the tasks of the connections and the task of the arm's port.
//!
//! All tasks run in one thread, and none waits while it has the hub: the lock is never contended.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use protocol_core::time::{Duration, Instant};
use tokio::sync::Notify;

use crate::hub::{ClientId, Hub};

/// The hub, and the tasks to wake when it has news.
#[derive(Debug)]
pub(super) struct SharedHub {
    hub: Mutex<Hub>,
    clients: Mutex<BTreeMap<ClientId, Arc<Notify>>>,
    /// Clients did something that the task of the arm's port has to look at.
    arm: Notify,
    pub(super) baud: u32,
    start: std::time::Instant,
    pulse: Mutex<Pulse>,
}

/// Time between two beats.
const BEAT: Duration = Duration::from_millis(50);
/// A beat that comes this long after the last one shows that the system did not run the server.
const MISSED: Duration = Duration::from_millis(150);

/// Tells whether the server ran all the time.
#[derive(Debug, Default)]
struct Pulse {
    last: Instant,
    /// When the server last ran before a pause, if the latest beat ended one.
    gap: Option<Instant>,
}

impl Pulse {
    fn beat(&mut self, now: Instant) {
        self.gap = (now - self.last >= MISSED).then_some(self.last);
        self.last = now;
    }

    /// The earliest time at which bytes can have been sent if they arrive at `now` while the server waits for them.
    fn earliest(&self, now: Instant) -> Instant {
        self.gap.unwrap_or(if now - self.last >= MISSED { self.last } else { now })
    }
}

impl SharedHub {
    pub(super) fn new(hub: Hub, baud: u32) -> Arc<Self> {
        Arc::new(Self {
            hub: Mutex::new(hub),
            clients: Mutex::default(),
            arm: Notify::new(),
            baud,
            start: std::time::Instant::now(),
            pulse: Mutex::default(),
        })
    }

    /// Beats for ever, so that pauses of the server are noticed.
    pub(super) async fn beat(self: Arc<Self>) {
        loop {
            lock(&self.pulse).beat(self.now());
            tokio::time::sleep(std::time::Duration::from_micros(BEAT.as_micros())).await;
        }
    }

    /// The earliest time at which bytes can have been sent if they arrive now while the server waits for them: now, or the
    /// start of a pause in which the system did not run the server.
    pub(super) fn earliest(&self) -> Instant {
        let now = self.now();
        lock(&self.pulse).earliest(now)
    }

    pub(super) fn now(&self) -> Instant {
        Instant::from_micros(u64::try_from(self.start.elapsed().as_micros()).unwrap_or(u64::MAX))
    }

    /// Uses the hub, and wakes the clients that have news.
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

    /// For a client: as [`Self::with_hub`], and wakes the task of the arm's port.
    pub(super) fn with_client<T>(&self, work: impl FnOnce(&mut Hub, Instant) -> T) -> T {
        let done = self.with_hub(work);
        self.arm.notify_one();
        done
    }

    /// Registers a client of the hub. The result wakes the task of the client when the hub has news for it.
    pub(super) fn join(&self, id: ClientId) -> Arc<Notify> {
        let wake = Arc::new(Notify::new());
        lock(&self.clients).insert(id, Arc::clone(&wake));
        wake
    }

    pub(super) fn part(&self, id: ClientId) {
        lock(&self.clients).remove(&id);
    }

    pub(super) async fn clients_acted(&self) {
        self.arm.notified().await;
    }

    /// Ends at this time of [`SharedHub::now`].
    pub(super) async fn sleep_until(&self, time: Instant) {
        if time == Instant::FAR_FUTURE {
            std::future::pending().await
        }
        let at = self.start + std::time::Duration::from_micros(time.as_micros());
        tokio::time::sleep_until(at.into()).await;
    }
}

/// Locks a mutex, also after a panic: a task that panicked leaves a hub that others can use, because each step of the hub
/// is complete.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_ms(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    #[test]
    fn what_comes_after_a_gap_may_be_as_old_as_the_gap() {
        let mut pulse = Pulse::default();
        (0..20).for_each(|beat| pulse.beat(at_ms(beat * 50)));
        assert_eq!(pulse.earliest(at_ms(990)), at_ms(990));
        assert_eq!(pulse.earliest(at_ms(3_000)), at_ms(950), "before the next beat");
        pulse.beat(at_ms(3_000));
        assert_eq!(pulse.earliest(at_ms(3_010)), at_ms(950), "behind it");
        pulse.beat(at_ms(3_050));
        assert_eq!(pulse.earliest(at_ms(3_060)), at_ms(3_060));
    }
}

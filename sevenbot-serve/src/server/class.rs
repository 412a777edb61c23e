//! The class, shared by the tasks of its connections, and its access to the real arm.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use classroom::{ArmNews, Classroom, ConnectionId, LeaseId};
use host_link::sharing::SharingCommand;
use protocol_core::registers::Map;
use protocol_core::time::Instant;
use tokio::sync::{Notify, watch};

use super::shared::{SharedHub, lock};
use crate::hub::{ClientId, HoldOutcome, WholeRequest};

/// Time between two polls of the class: a lease ends at most this late.
const TICK: Duration = Duration::from_millis(50);

/// Who may exchange frames with the real arm: the newest session of the present lease.
type LeaseSession = Option<(LeaseId, u64)>;

/// A class, and the tasks to wake when it has messages.
pub(super) struct Class {
    shared: Arc<SharedHub>,
    room: Mutex<Classroom>,
    wakes: Mutex<BTreeMap<ConnectionId, Arc<Notify>>>,
    /// The client of the hub by which the class stops the arm.
    client: ClientId,
    session: watch::Sender<LeaseSession>,
}

impl Class {
    pub(super) fn new(shared: Arc<SharedHub>, room: Classroom) -> Arc<Self> {
        let client = shared.with_hub(|hub, _| {
            hub.watch_arm();
            hub.connect()
        });
        let (room, wakes) = (Mutex::new(room), Mutex::default());
        Arc::new(Self { shared, room, wakes, client, session: watch::Sender::new(None) })
    }

    /// Polls the class for ever, once a [`TICK`].
    pub(super) async fn run(self: Arc<Self>) {
        loop {
            self.with(Classroom::poll);
            tokio::time::sleep(TICK).await;
        }
    }

    /// Runs `work` on the class, and applies the consequences: ends a session, holds the arm, wakes tasks.
    pub(super) fn with<T>(&self, work: impl FnOnce(&mut Classroom, Instant) -> T) -> T {
        let mut room = lock(&self.room);
        let now = self.shared.now();
        let done = work(&mut room, now);
        let lease = room.lease();
        self.session.send_if_modified(|session| {
            let is_over = session.is_some_and(|(of, _)| Some(of) != lease);
            if is_over {
                *session = None;
            }
            is_over
        });
        self.serve_arm(&mut room, now);
        let wakes = lock(&self.wakes);
        room.ready(now).filter_map(|id| wakes.get(&id)).for_each(|wake| wake.notify_one());
        done
    }

    fn serve_arm(&self, room: &mut Classroom, now: Instant) {
        if room.take_hold(now) {
            let (address, values) = SharingCommand::Stop.write();
            let stop = WholeRequest::Write { map: Map::V22, address, values: values.to_vec() };
            self.shared.with_client(|hub, now| hub.request(now, self.client, now, stop));
        }
        let news = self.shared.with_hub(|hub, _| ArmNews {
            answers: hub.has_arm(),
            may_hear: hub.has_arm() || hub.is_silent(),
            is_holding: hub.is_holding(),
            holds: matches!(hub.hold_outcome(), Some(HoldOutcome::Holds | HoldOutcome::Limp)),
            is_limp: hub.hold_outcome() == Some(HoldOutcome::Limp),
        });
        room.arm_news(now, news);
    }

    /// Adds a connection. The result wakes its task when there is a message for it.
    pub(super) fn join(&self, id: ConnectionId) -> Arc<Notify> {
        let wake = Arc::new(Notify::new());
        lock(&self.wakes).insert(id, Arc::clone(&wake));
        wake
    }

    pub(super) fn part(&self, id: ConnectionId) {
        lock(&self.wakes).remove(&id);
        self.with(|room, now| room.close(now, id));
    }

    /// The present lease, if its pupil has this key.
    pub(super) fn lease_with(&self, is_key: impl FnOnce(&str) -> bool) -> Option<LeaseId> {
        let room = lock(&self.room);
        room.holder_key().filter(|key| is_key(key)).and(room.lease())
    }

    /// Serves the arm to a pupil as long as the lease lasts. A newer session of the same lease ends this one, too.
    pub(super) async fn while_lent(&self, lease: LeaseId, serve: impl Future<Output = ()>) {
        let mut watched = self.session.subscribe();
        let number = self.session.borrow().map_or(0, |(_, number)| number) + 1;
        let own = Some((lease, number));
        if lock(&self.room).lease() != Some(lease) {
            return;
        }
        self.session.send_replace(own);
        tokio::select! {
            // The end of the lease comes first: nothing that arrives after it reaches the arm.
            biased;
            _ = watched.wait_for(|session| *session != own) => {}
            () = serve => {}
        }
    }
}

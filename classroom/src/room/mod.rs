//! The class: events in, messages out.
//!
//! ```text
//!   connections, time ──▶ mod.rs ──▶ orders.rs: what pupils and the teacher want
//!                            └─────▶ outgoing.rs: the next message for each connection
//! ```

mod orders;
mod outgoing;

use std::collections::BTreeMap;

use protocol_core::time::{Duration, Instant};

use crate::connection::ConnectionId;
use crate::desk::Desk;
use crate::message::{FromPupil, LeaseEnd, Refusal, TabPresence};
use crate::name;
use crate::pupil::Pupil;
use crate::real_arm::{ArmNews, RealArm};
use crate::stop_all::StopAll;

/// The largest number of pupils in a class, including those whose connection was lost.
pub const MOST_PUPILS: usize = 64;
/// The largest number of teacher's screens, such as one on the desk and one on the projector.
const MOST_TEACHERS: usize = 4;
/// A tab has to join within this time, or its connection ends.
const JOIN_TIME: Duration = Duration::from_millis(10_000);
/// A pupil whose connection was lost is shown, and keeps the name, for this long, or until a new pupil needs the place.
const LOST_KEPT: Duration = Duration::from_millis(120_000);

/// The properties of a class that do not change.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ClassInfo {
    /// The addresses that pupils open, for the teacher's screen.
    pub addresses: Vec<String>,
    /// The code that pupils have to type, for the teacher's screen. The server checks it. `None` if there is none.
    pub code: Option<String>,
    /// The class has a real arm.
    pub has_arm: bool,
}

/// Identifies a lease: the right of a pupil to the real arm. A later lease has another id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeaseId(u32);

#[derive(Debug)]
enum TabConnection {
    /// A tab that has not joined yet, the key that it gets if it becomes a new pupil, and when it connected.
    Stranger {
        key: String,
        since: Instant,
    },
    Pupil(u32),
    Teacher(Desk),
    /// The reason for the refusal; `None` once it was sent, or if none is to be sent. Then [`Classroom::is_over`] tells the
    /// caller to close the connection.
    Refused(Option<RefusedTab>),
}

#[derive(Clone, Copy, Debug)]
enum RefusedTab {
    Pupil(Refusal),
    Teacher,
}

/// A class. Messages and the time come in as arguments; it opens no port.
#[derive(Debug)]
pub struct Classroom {
    info: ClassInfo,
    pupils: BTreeMap<u32, Pupil>,
    next_pupil: u32,
    connections: BTreeMap<ConnectionId, TabConnection>,
    next_connection: u64,
    arm: Option<RealArm>,
    stop: Option<StopAll>,
    /// The number of teacher's messages so far, and the last one.
    message: (u32, String),
    /// The number of changes so far that teacher's screens have to show.
    change: u64,
}

impl Classroom {
    /// A class without pupils.
    #[must_use]
    pub fn new(info: ClassInfo) -> Self {
        Self {
            arm: info.has_arm.then(RealArm::default),
            info,
            pupils: BTreeMap::new(),
            next_pupil: 1,
            connections: BTreeMap::new(),
            next_connection: 1,
            stop: None,
            message: (0, String::new()),
            change: 0,
        }
    }

    /// Adds the connection of a pupil's tab; refuses it if [`MOST_PUPILS`] tabs are connected. `key` is a new secret: a tab
    /// that knows it belongs to this pupil.
    pub fn open_pupil(&mut self, now: Instant, key: String) -> ConnectionId {
        let pupils = |connection: &&TabConnection| {
            matches!(connection, TabConnection::Stranger { .. } | TabConnection::Pupil(_))
        };
        let is_full = self.connections.values().filter(pupils).count() >= MOST_PUPILS;
        let refused = TabConnection::Refused(Some(RefusedTab::Pupil(Refusal::Full)));
        self.open(if is_full { refused } else { TabConnection::Stranger { key, since: now } })
    }

    /// Adds the connection of a teacher's screen. Refuses it if there are too many.
    pub fn open_teacher(&mut self) -> ConnectionId {
        let teachers = |connection: &&TabConnection| matches!(connection, TabConnection::Teacher(_));
        let is_full = self.connections.values().filter(teachers).count() >= MOST_TEACHERS;
        let refused = TabConnection::Refused(Some(RefusedTab::Teacher));
        self.open(if is_full { refused } else { TabConnection::Teacher(Desk::default()) })
    }

    fn open(&mut self, connection: TabConnection) -> ConnectionId {
        let id = ConnectionId::new(self.next_connection);
        self.next_connection += 1;
        self.connections.insert(id, connection);
        id
    }

    /// Notes that a connection has ended. A pupil who has the real arm loses it.
    pub fn close(&mut self, now: Instant, id: ConnectionId) {
        let Some(TabConnection::Pupil(number)) = self.connections.remove(&id) else { return };
        if let Some(pupil) = self.pupils.get_mut(&number) {
            pupil.lose(now);
        }
        self.end_lease_of(now, number, LeaseEnd::Lost);
        self.change += 1;
    }

    /// Takes a message of a connection. An invalid message ends the connection.
    pub fn receive(&mut self, now: Instant, id: ConnectionId, text: &str) {
        let Some(connection) = self.connections.get(&id) else { return };
        let is_taken = match connection {
            TabConnection::Stranger { key, .. } => match serde_json::from_str(text) {
                Ok(FromPupil::Join { name, key: known }) => {
                    let key = key.clone();
                    self.join(now, id, &name, key, known.as_deref());
                    true
                }
                _ => false,
            },
            &TabConnection::Pupil(number) => {
                serde_json::from_str(text).is_ok_and(|message| self.hear_pupil(now, number, message))
            }
            TabConnection::Teacher(_) => {
                serde_json::from_str(text).map(|message| self.hear_teacher(now, id, message)).is_ok()
            }
            TabConnection::Refused(_) => true,
        };
        if !is_taken {
            self.refuse(now, id, Refusal::BadMessage);
        }
        self.change += 1;
    }

    /// Ends a connection. A pupil is told the reason.
    fn refuse(&mut self, now: Instant, id: ConnectionId, why: Refusal) {
        let is_teacher = matches!(self.connections.get(&id), Some(TabConnection::Teacher(_)));
        self.close(now, id);
        let why = (!is_teacher).then_some(RefusedTab::Pupil(why));
        self.connections.insert(id, TabConnection::Refused(why));
    }

    fn join(&mut self, now: Instant, id: ConnectionId, wanted: &str, key: String, known: Option<&str>) {
        let Some(name) = name::clean(wanted) else { return self.refuse(now, id, Refusal::NoName) };
        let before = self.pupils.iter().find(|(_, pupil)| Some(pupil.key.as_str()) == known);
        let before = before.map(|(&number, _)| number);
        let others = || self.pupils.iter().filter(|(number, _)| Some(**number) != before);
        let is_taken = |wanted: &str| others().any(|(_, other)| name::is_same(&other.name, wanted));
        let name = name::unique(&name, is_taken);
        let Some(number) = before.or_else(|| self.free_number(now)) else {
            return self.refuse(now, id, Refusal::Full);
        };
        let old = match self.pupils.get_mut(&number) {
            Some(pupil) => pupil.rejoin(now, name, id),
            None => {
                self.pupils.insert(number, Pupil::new(now, name, key, id));
                None
            }
        };
        self.connections.insert(id, TabConnection::Pupil(number));
        if let Some(old) = old {
            self.connections.insert(old, TabConnection::Refused(Some(RefusedTab::Pupil(Refusal::OtherTab))));
        }
        self.end_lease_of(now, number, LeaseEnd::Lost);
    }

    /// A number for a new pupil. In a full class, removes the pupil whose connection has been lost for the longest time; `None`
    /// if all are connected.
    fn free_number(&mut self, now: Instant) -> Option<u32> {
        if self.pupils.len() >= MOST_PUPILS {
            let lost = self.pupils.iter().filter_map(|(&number, pupil)| Some((pupil.lost_for(now)?, number)));
            let (_, number) = lost.max()?;
            self.pupils.remove(&number);
        }
        let number = self.next_pupil;
        self.next_pupil += 1;
        Some(number)
    }

    /// Advances the class to `now`. Call it about every 50 ms.
    pub fn poll(&mut self, now: Instant) {
        self.pupils.values_mut().for_each(|pupil| pupil.poll(now));
        for connection in self.connections.values_mut() {
            if matches!(connection, TabConnection::Stranger { since, .. } if now - *since >= JOIN_TIME) {
                *connection = TabConnection::Refused(Some(RefusedTab::Pupil(Refusal::BadMessage)));
            }
        }
        let Some(lease) = self.lease_now() else { return self.forget_lost(now) };
        let holder = self.pupils.get(&lease.pupil);
        if lease.is_over(now) {
            self.end_lease(now, LeaseEnd::Time);
        } else if holder.is_none_or(|pupil| pupil.presence(now) != TabPresence::Here) {
            self.end_lease(now, LeaseEnd::Lost);
        }
        self.forget_lost(now);
    }

    fn forget_lost(&mut self, now: Instant) {
        let is_kept = |_: &u32, pupil: &mut Pupil| pupil.lost_for(now).is_none_or(|lost| lost < LOST_KEPT);
        self.pupils.retain(is_kept);
    }

    /// Takes the state of the real arm. A state that equals the known one changes nothing; [`Self::take_hold`] also changes the
    /// known one.
    pub fn arm_news(&mut self, now: Instant, news: ArmNews) {
        let Some(arm) = &mut self.arm else { return };
        let (is_new, confirms_stop) = arm.take_news(news);
        if confirms_stop {
            self.stop.iter_mut().for_each(|stop| stop.note_confirmed(now));
        }
        self.change += u64::from(is_new);
    }

    /// True if the real arm has to be held now. The caller then starts a hold, before it passes [`ArmNews`] again.
    pub fn take_hold(&mut self, now: Instant) -> bool {
        self.arm.as_mut().is_some_and(|arm| arm.take_hold(now))
    }

    /// The present lease of the real arm; `None` if no pupil has it.
    #[must_use]
    pub fn lease(&self) -> Option<LeaseId> {
        self.lease_now().map(|lease| LeaseId(lease.number))
    }

    /// The key of the pupil who has the real arm.
    #[must_use]
    pub fn holder_key(&self) -> Option<&str> {
        self.pupils.get(&self.lease_now()?.pupil).map(|pupil| pupil.key.as_str())
    }
}

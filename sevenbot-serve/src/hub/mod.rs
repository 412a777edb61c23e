//! The hub: whole requests of many clients in, frames to one arm out, and each reply back to its client.
//!
//! ```text
//!   HubClient ─┐                      ┌─▶ Line ──▶ arm
//!   HubClient ─┼─▶ Hub::poll: the ────┤
//!   Sampler ───┘   client that used   └─◀ Line ◀── arm
//!                  the line least
//! ```
//!
//! * While a read of a client has no reply, the client's later requests wait, so their order is kept. Urgent ones do not wait.
//! * The report registers belong to each client (`own_registers`). The hub uses no reports of the arm: the sampler reads the
//!   arm at the highest frequency that any client wants, and all clients share the values.
//! * Without an arm requests are dropped, except reads of the server's own registers, and stops of an arm that fell silent. A
//!   request that waited could move an arm that a person just plugged in. With an arm, a request that moves or switches
//!   something is dropped after 200 ms in the queue, unless it switches the motors off.
//! * A stop goes before everything else, and ends the streams of the other clients (`drive`, `intent`).

mod admission;
mod angles;
mod arm_connection;
mod arm_hold;
mod client;
mod client_id;
mod delivery;
mod drive;
mod held_targets;
mod holding;
mod intent;
mod known_registers;
mod line;
mod own_registers;
mod presence;
mod readings;
mod request;
mod sampler;
mod schedule;
mod sending;
mod shares;
mod watchdog;

use std::collections::{BTreeMap, BTreeSet};

use protocol_core::time::Instant;

use self::arm_hold::ArmHold;
use self::client::HubClient;
use self::drive::Driver;
use self::held_targets::HeldTargets;
use self::known_registers::KnownRegisters;
use self::line::Line;
use self::presence::Presence;
use self::sampler::Sampler;
use self::shares::Shares;
use self::watchdog::ClientWatchdog;

pub use self::admission::Admission;
pub use self::client::{HubEvent, LONGEST_WAIT};
pub use self::client_id::ClientId;
pub use self::holding::HoldOutcome;
pub use self::request::WholeRequest;

/// What clients may do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HubOptions {
    /// Writes do not reach the arm; each client can still choose its own reports.
    pub is_read_only: bool,
    /// Only one client moves the arm at a time.
    pub has_one_driver: bool,
}

/// The state of the port to the arm, and of the arm behind it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ArmConnection {
    /// The port is closed.
    Absent,
    /// The port is open. The next question is due at this time.
    Identifying(Instant),
    /// A 7Bot V2 answered.
    Present,
    /// The port is open, but the arm no longer answers. The next question is due at this time. Holds and writes that switch the
    /// motors off are still sent, because perhaps only the replies are lost.
    Silent(Instant),
}

/// The clients of one arm, and the line to it.
#[derive(Debug)]
pub struct Hub {
    clients: BTreeMap<ClientId, HubClient>,
    next_id: ClientId,
    arm: ArmConnection,
    known: KnownRegisters,
    /// The chip id that the arm has to have; `None`: any.
    chip_id: Option<Vec<u8>>,
    line: Line,
    presence: Presence,
    sampler: Sampler,
    watchdog: ClientWatchdog,
    hold: Option<ArmHold>,
    /// The outcome of the last hold since the port was opened; `None`: it has not ended, or there was none.
    hold_outcome: Option<HoldOutcome>,
    /// The outcome of a failed hold, until [`Hub::take_failed_hold`] takes it.
    failed_hold: Option<HoldOutcome>,
    /// A hold slowed the joints down, and has not restored their speeds.
    is_slowed: bool,
    /// A hold changed the set-point period, and has not read back that it is restored.
    is_period_changed: bool,
    held: HeldTargets,
    driver: Driver,
    /// Stops of all clients so far, wrapping.
    stops: u8,
    shares: Shares,
    /// See [`Hub::take_news`].
    news: BTreeSet<ClientId>,
    options: HubOptions,
}

impl Hub {
    /// A hub without clients, whose port is closed. `baud` is the rate of the arm's line, in bits per second.
    #[must_use]
    pub fn new(baud: u32, options: HubOptions) -> Self {
        Self {
            clients: BTreeMap::new(),
            next_id: ClientId::default(),
            arm: ArmConnection::Absent,
            known: KnownRegisters::new(),
            chip_id: None,
            line: Line::new(baud, options.is_read_only),
            presence: Presence::default(),
            sampler: Sampler::new(baud),
            watchdog: ClientWatchdog::default(),
            hold: None,
            hold_outcome: None,
            failed_hold: None,
            is_slowed: false,
            is_period_changed: false,
            held: HeldTargets::default(),
            driver: Driver::new(options.has_one_driver),
            stops: 0,
            shares: Shares::default(),
            news: BTreeSet::new(),
            options,
        }
    }

    /// Adds a client. Its reads wait until [`Hub::set_can_receive`] allows replies.
    pub fn connect(&mut self) -> ClientId {
        let id = self.next_id;
        self.next_id = id.next();
        self.clients.insert(id, HubClient::default());
        id
    }

    /// The client has closed its connection. Its waiting writes are carried out, for [`LONGEST_WAIT`] at most. Its reads, writes
    /// between reads, and streams of reports end.
    pub fn leave(&mut self, now: Instant, id: ClientId) {
        if let Some(client) = self.clients.get_mut(&id) {
            client.leave(now);
        }
        self.driver.end(Some(id));
        self.set_frequencies(now);
    }

    /// The client is gone: its requests are dropped with it.
    pub fn disconnect(&mut self, now: Instant, id: ClientId) {
        self.clients.remove(&id);
        self.news.remove(&id);
        self.driver.end(Some(id));
        self.set_frequencies(now);
    }

    /// Can the client make another request?
    #[must_use]
    pub fn has_room(&self, id: ClientId) -> bool {
        self.clients.get(&id).is_some_and(HubClient::has_room)
    }

    /// The clients that have something new since the last call: events, room for requests, or the outcome of a hold.
    pub fn take_news(&mut self) -> BTreeSet<ClientId> {
        std::mem::take(&mut self.news)
    }

    /// States whether the client has room for the longest reply. While it has none, its reads wait.
    pub fn set_can_receive(&mut self, id: ClientId, can_receive: bool) {
        if let Some(client) = self.clients.get_mut(&id) {
            client.can_receive = can_receive;
        }
    }

    /// The next event for a client.
    pub fn take_event(&mut self, id: ClientId) -> Option<HubEvent> {
        self.clients.get_mut(&id)?.events.pop_front()
    }

    /// The port to the arm is open. Requests pass once a 7Bot V2 has answered.
    pub fn open_arm(&mut self, now: Instant) {
        self.forget_arm();
        self.arm = ArmConnection::Identifying(now);
    }

    /// The port to the arm is closed.
    pub fn close_arm(&mut self) {
        self.arm = ArmConnection::Absent;
        self.forget_arm();
        self.deliver_all(Instant::ZERO);
    }

    /// Drops everything that was sent or waits, so that none of it reaches the next arm.
    fn forget_arm(&mut self) {
        self.line.reset();
        (self.hold, self.hold_outcome) = (None, None);
        self.drop_requests();
    }

    fn drop_requests(&mut self) {
        self.held = HeldTargets::default();
        self.driver.end(None);
        for (&id, client) in &mut self.clients {
            client.drop_waiting();
            self.news.insert(id);
        }
    }

    /// Takes bytes of the arm. An empty slice states that its line is silent at `now`.
    pub fn arm_bytes(&mut self, now: Instant, bytes: &[u8]) {
        self.line.push(now, bytes);
        self.deliver_all(now);
    }

    /// Moves requests to the line, as far as the line is free. The caller sends [`Hub::to_arm`] afterwards.
    pub fn poll(&mut self, now: Instant) {
        self.deliver_all(now);
        self.clients.retain(|_, client| !client.has_left(now));
        if self.arm == ArmConnection::Present || self.is_silent() {
            if let Some(action) = self.watchdog.poll(now).filter(|_| !self.options.is_read_only) {
                self.act(now, action);
            }
            self.send_urgent(now);
        }
        self.ask_arm(now);
        if self.has_arm() {
            while self.line.is_free(now) && self.send_next(now) {}
        }
    }

    /// The bytes that wait for the arm's port. Report those that were sent with [`Hub::sent_to_arm`].
    #[must_use]
    pub fn to_arm(&self) -> &[u8] {
        self.line.output()
    }

    /// Removes bytes that were sent to the arm.
    pub fn sent_to_arm(&mut self, count: usize) {
        self.line.consume(count);
    }

    /// When to call [`Hub::poll`] and [`Hub::arm_bytes`] again, without other events.
    #[must_use]
    pub fn deadline(&self, now: Instant) -> Instant {
        let hold = self.hold.as_ref().map_or(Instant::FAR_FUTURE, ArmHold::due);
        let urgent = hold.min(self.watchdog.due());
        let line = self.line.deadline();
        let question = self.question_due().max(self.line.free_at(now));
        match self.arm {
            ArmConnection::Absent => Instant::FAR_FUTURE,
            ArmConnection::Identifying(_) => line.min(question),
            ArmConnection::Silent(_) => line.min(question).min(urgent),
            ArmConnection::Present if self.clients.values().any(|client| self.line.takes(client)) => {
                line.min(self.line.free_at(now)).min(urgent)
            }
            ArmConnection::Present => {
                line.min(question).min(urgent).min(self.sampler.due().max(self.line.free_at(now)))
            }
        }
    }

    /// Delivers the events of all reads that have ended.
    fn deliver_all(&mut self, now: Instant) {
        while let Some((owner, event)) = self.line.next_event(now) {
            self.deliver(now, owner, event);
        }
    }
}

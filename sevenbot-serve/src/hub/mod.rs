//! The hub: whole requests of many clients in, frames to one arm out, and each reply back to its client.
//!
//! ```text
//!   Client ─┐                      ┌─▶ Line ──▶ arm
//!   Client ─┼─▶ Hub::poll: the ────┤
//!   Sampler ┘   client that used   └─◀ Line ◀── arm
//!               the line least
//! ```
//!
//! * A client has at most one read without a reply; its later requests wait behind it, so their order is kept.
//! * The report registers belong to each client (`own_registers`). The arm sends no reports: the sampler reads the
//!   arm once, at the highest frequency that any client wants, and all clients share the values.
//! * Without an arm requests are dropped. A request that waited could move an arm that a person just plugged in.

mod client;
mod client_id;
mod known_registers;
mod line;
mod own_registers;
mod request;
mod sampler;
mod schedule;
mod shares;
mod stream;
mod watchdog;

use std::collections::BTreeMap;

use protocol_core::registers::Map;
use protocol_core::registers::map::FEEDBACK_FREQUENCY;
use protocol_core::registers::map21::{ANGLE_FEEDBACK_FREQUENCY, LOAD_FEEDBACK_FREQUENCY};
use protocol_core::time::{Duration, Instant};

use self::client::Client;
use self::known_registers::KnownRegisters;
use self::line::{Line, Owner};
use self::sampler::Sampler;
use self::shares::Shares;
use self::watchdog::ClientWatchdog;

pub use self::client::Event;
pub use self::client_id::ClientId;
pub use self::request::WholeRequest;
pub use self::stream::Stream;

/// Requests of one client that may wait. The maker's arm has the same limit for its WebSocket.
pub const MOST_WAITING: usize = 20;
/// Time between two questions to a port behind which no arm has answered yet.
const IDENTIFY_PERIOD: Duration = Duration::from_millis(250);

/// Does an arm answer?
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ArmState {
    /// The port is closed.
    Absent,
    /// The port is open. The next question is due at this time.
    Identifying(Instant),
    /// A 7Bot V2 answered.
    Present,
}

/// The clients of one arm, and the line to it.
#[derive(Debug)]
pub struct Hub {
    clients: BTreeMap<ClientId, Client>,
    next_id: ClientId,
    arm: ArmState,
    known: KnownRegisters,
    /// The chip id that the arm has to have.
    chip_id: Option<Vec<u8>>,
    line: Line,
    sampler: Sampler,
    watchdog: ClientWatchdog,
    shares: Shares,
    is_read_only: bool,
}

impl Hub {
    /// A hub without clients, whose port is closed. `baud` is the rate of the arm's line, in bits per second.
    /// `is_read_only`: writes do not reach the arm; each client can still choose its own reports.
    #[must_use]
    pub fn new(baud: u32, is_read_only: bool) -> Self {
        Self {
            clients: BTreeMap::new(),
            next_id: ClientId::default(),
            arm: ArmState::Absent,
            known: KnownRegisters::new(),
            chip_id: None,
            line: Line::new(baud),
            sampler: Sampler::new(baud),
            watchdog: ClientWatchdog::default(),
            shares: Shares::default(),
            is_read_only,
        }
    }

    /// Adds a client.
    pub fn connect(&mut self) -> ClientId {
        let id = self.next_id;
        self.next_id = id.next();
        self.clients.insert(id, Client::default());
        id
    }

    /// Removes a client with its requests and its streams of reports. A reply that comes for it is dropped.
    pub fn disconnect(&mut self, now: Instant, id: ClientId) {
        self.clients.remove(&id);
        self.sampler.set_frequencies(now, self.clients.values().map(|client| &client.own));
    }

    /// Can the client make another request?
    #[must_use]
    pub fn has_room(&self, id: ClientId) -> bool {
        self.clients.get(&id).is_some_and(|client| client.waiting.len() < MOST_WAITING)
    }

    /// Queues a request. Returns false, and drops it, if [`Hub::has_room`] is false.
    pub fn request(&mut self, id: ClientId, request: WholeRequest) -> bool {
        if !self.has_room(id) {
            return false;
        }
        let Some(client) = self.clients.get_mut(&id) else { return false };
        if client.waiting.is_empty() {
            self.shares.join(&mut client.share);
        }
        client.waiting.push_back(request);
        true
    }

    /// States whether the client has room for the longest reply. While it has none, its reads wait.
    pub fn set_can_receive(&mut self, id: ClientId, can_receive: bool) {
        if let Some(client) = self.clients.get_mut(&id) {
            client.can_receive = can_receive;
        }
    }

    /// The next event for a client.
    pub fn take_event(&mut self, id: ClientId) -> Option<Event> {
        self.clients.get_mut(&id)?.events.pop_front()
    }

    /// The port to the arm is open. Requests pass once a 7Bot V2 has answered.
    pub fn open_arm(&mut self, now: Instant) {
        self.line.reset();
        self.arm = ArmState::Identifying(now);
    }

    /// The port to the arm is closed.
    pub fn close_arm(&mut self) {
        self.arm = ArmState::Absent;
        self.line.reset();
        self.deliver_all(Instant::ZERO);
    }

    /// Does a 7Bot V2 answer?
    #[must_use]
    pub fn has_arm(&self) -> bool {
        self.arm == ArmState::Present
    }

    /// From now on only this arm counts, by its chip id.
    pub fn expect_same_arm(&mut self) {
        self.chip_id = Some(self.known.chip_id().to_vec());
    }

    /// Takes bytes of the arm. An empty slice states that its line is silent at `now`.
    pub fn arm_bytes(&mut self, now: Instant, bytes: &[u8]) {
        self.line.push(now, bytes);
        self.deliver_all(now);
    }

    /// Moves requests to the line, as far as the line is free. The caller sends [`Hub::to_arm`] afterwards.
    pub fn poll(&mut self, now: Instant) {
        self.deliver_all(now);
        match self.arm {
            ArmState::Absent => self.drop_waiting(),
            ArmState::Identifying(due) => {
                self.drop_waiting();
                if due <= now && self.line.is_free(now) {
                    let (address, count) = KnownRegisters::IDENTITY;
                    self.line.send_read(now, Owner::Identity, address, count);
                    self.arm = ArmState::Identifying(now + IDENTIFY_PERIOD);
                }
            }
            ArmState::Present => {
                self.watchdog.poll(now, self.line.idle_since());
                while self.watchdog.allows(now) && self.line.is_free(now) && self.send_next(now) {}
            }
        }
    }

    /// Bytes for the arm.
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
        let line = self.line.deadline();
        match self.arm {
            ArmState::Absent | ArmState::Identifying(_) if self.has_waiting() => now,
            ArmState::Absent => Instant::FAR_FUTURE,
            ArmState::Identifying(due) => line.min(due),
            ArmState::Present if !self.watchdog.allows(now) => line.min(self.watchdog.quiet_until()),
            ArmState::Present if self.clients.values().any(|client| self.line.takes(client)) => {
                line.min(self.line.free_at(now))
            }
            ArmState::Present => line.min(self.sampler.due().max(self.line.free_at(now))),
        }
    }

    /// Sends the next request or sample. Returns false if there is none.
    fn send_next(&mut self, now: Instant) -> bool {
        let sendable = self.clients.iter().filter(|(_, client)| self.line.takes(client));
        let sampler = self.sampler.next_due(now).map(|stream| (self.sampler.share, None, Some(stream)));
        let clients = sendable.map(|(&id, client)| (client.share, Some(id), None));
        let next = clients.chain(sampler).min_by_key(|&(share, ..)| self.shares.order(share));
        match next {
            Some((_, Some(id), _)) => self.send_request(now, id),
            Some((_, _, Some(stream))) => self.send_sample(now, stream),
            _ => return false,
        }
        true
    }

    fn send_request(&mut self, now: Instant, id: ClientId) {
        let Some(client) = self.clients.get_mut(&id) else { return };
        let Some(request) = client.waiting.pop_front() else { return };
        self.shares.charge(&mut client.share, request.line_bytes());
        self.watchdog.sent_request(now, id);
        match request {
            WholeRequest::Read { address, count } => self.send_read(now, id, address, count),
            WholeRequest::Write { map, address, values } => {
                self.send_write(now, id, map, address, values);
            }
            WholeRequest::WritesBetweenReads { map, writes, read: (first, count) } => {
                self.send_read(now, id, first, count);
                writes.into_iter().for_each(|(start, bytes)| self.send_write(now, id, map, start, bytes));
                self.send_read(now, id, first, count);
            }
        }
    }

    fn send_read(&mut self, now: Instant, id: ClientId, address: u8, count: u8) {
        let Some(client) = self.clients.get_mut(&id) else { return };
        client.unanswered += 1;
        // A write of 0 registers chooses the form of the offsets (M5).
        if let Some(map) = client.own.form_of_read(address, count, self.known.form_before_writes()) {
            self.line.send_write(now, map, 0, &[]);
        }
        self.line.send_read(now, Owner::Client(id), address, count);
    }

    fn send_write(&mut self, now: Instant, id: ClientId, map: Map, address: u8, mut values: Vec<u8>) {
        let Some(client) = self.clients.get_mut(&id) else { return };
        let is_accepted = self.known.accepts(map, address, &values);
        if is_accepted && client.own.write(map, address, &mut values) {
            client.schedule.set(now, &client.own);
            self.sampler.set_frequencies(now, self.clients.values().map(|client| &client.own));
        }
        if !self.is_read_only {
            if is_accepted && map == Map::V22 {
                self.watchdog.wrote(now, id, address, &values);
            }
            self.known.write(map, address, &values);
            self.line.send_write(now, map, address, &values);
        }
    }

    fn send_sample(&mut self, now: Instant, stream: Stream) {
        let (address, count) = stream.registers();
        self.shares.charge(&mut self.sampler.share, request::read_bytes(count));
        self.sampler.note_sent(now, stream);
        self.line.send_read(now, Owner::Sample(stream), address, count);
    }

    fn deliver(&mut self, now: Instant, owner: Owner, event: Event) {
        match (owner, event) {
            (Owner::Client(id), mut event) => {
                let Some(client) = self.clients.get_mut(&id) else { return };
                if let Event::Reply { address, values } = &mut event {
                    client.own.overlay(*address, values);
                }
                client.unanswered = client.unanswered.saturating_sub(1);
                client.events.push_back(event);
            }
            (Owner::Sample(stream), Event::Reply { values, .. }) => {
                for client in self.clients.values_mut() {
                    client.report(now, stream, &values);
                }
            }
            (Owner::Identity, Event::Reply { values, .. }) => self.identify(now, &values),
            (Owner::Sample(_) | Owner::Identity, _) => {}
        }
    }

    /// An unknown device answered, or a 7Bot V2. A stream that an earlier program left running ends.
    fn identify(&mut self, now: Instant, values: &[u8]) {
        let Some(known) = KnownRegisters::of_arm(values) else { return };
        let is_wanted = self.chip_id.as_deref().is_none_or(|id| known.chip_id() == id);
        if is_wanted && self.arm != ArmState::Present {
            self.arm = ArmState::Present;
            self.known = known;
            self.watchdog.forget();
            for register in [ANGLE_FEEDBACK_FREQUENCY, LOAD_FEEDBACK_FREQUENCY] {
                self.line.send_write(now, Map::V21, register.address, &[0]);
            }
            self.line.send_write(now, Map::V22, FEEDBACK_FREQUENCY.address, &[0]);
        }
    }

    /// Delivers the ends of all reads that have ended.
    fn deliver_all(&mut self, now: Instant) {
        while let Some((owner, event)) = self.line.next_event(now) {
            self.deliver(now, owner, event);
        }
    }

    fn has_waiting(&self) -> bool {
        self.clients.values().any(|client| !client.waiting.is_empty())
    }

    /// Drops the requests that wait, because there is no arm.
    fn drop_waiting(&mut self) {
        for client in self.clients.values_mut() {
            client.drop_waiting();
        }
    }
}

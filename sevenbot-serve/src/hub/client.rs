//! One client: its requests that wait, its events, its own registers.

use std::collections::VecDeque;

use host_link::sharing::SharingCommand;
use protocol_core::registers::Map;
use protocol_core::report_kind::ReportKind;
use protocol_core::time::{Duration, Instant};

use super::drive::Driving;
use super::intent::Intent;
use super::known_registers::KnownRegisters;
use super::own_registers::OwnRegisters;
use super::readings::Readings;
use super::request::WholeRequest;
use super::schedule::Schedule;
use super::shares::Share;

/// Requests of one client that may wait. The maker's arm has the same limit for its WebSocket.
pub(crate) const MOST_WAITING: usize = 20;
/// How long a request that moves or switches something may wait, unless it switches the motors off.
pub const LONGEST_WAIT: Duration = Duration::from_millis(200);
/// A report is dropped while this many events or more wait for the client.
const MOST_REPORTS: usize = 4;
/// A client has no room for another request while its waiting ones and their replies take this many bytes or more on the line:
/// 90 ms at 115 200 baud.
const MOST_WAITING_BYTES: usize = 1_024;
/// A client may send this many urgent requests in each period. More wait like other requests, so that a flood does not keep
/// the other clients from the line.
const MOST_URGENT: u8 = 4;
const URGENT_PERIOD: Duration = Duration::from_millis(100);

/// An event of the hub for a client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HubEvent {
    /// The reply to the client's oldest read.
    Reply {
        /// The first register.
        address: u8,
        /// The values, one byte per register.
        values: Vec<u8>,
    },
    /// No reply comes to the client's oldest read: the read was dropped, the arm did not answer, or the reply was damaged.
    NoReply {
        /// The first register.
        address: u8,
        /// How many registers the read asked for.
        count: u8,
    },
    /// A report that the client's own registers ask for.
    Report {
        /// Tells which registers the values are from.
        stream: ReportKind,
        /// The values of the stream's registers.
        values: Vec<u8>,
    },
}

#[derive(Debug)]
pub(crate) struct Waiting {
    pub(crate) request: WholeRequest,
    pub(crate) intent: Intent,
    /// The earliest time at which it can have been sent.
    pub(crate) since: Instant,
}

#[derive(Debug, Default)]
pub(crate) struct HubClient {
    pub(crate) waiting: VecDeque<Waiting>,
    /// Holds, stops, and writes that switch the motors off. They go before everything else.
    pub(crate) urgent: VecDeque<Waiting>,
    /// When the current period of urgent requests began, and how many there were in it.
    urgent_period: (Instant, u8),
    pub(crate) driving: Driving,
    readings: Readings,
    /// Writes that were dropped, wrapping.
    pub(crate) dropped: u16,
    /// When it closed its connection; `None` while it is connected.
    pub(crate) left: Option<Instant>,
    pub(crate) events: VecDeque<HubEvent>,
    pub(crate) own: OwnRegisters,
    pub(crate) schedule: Schedule,
    pub(crate) share: Share,
    /// Reads that were sent and have no reply yet.
    pub(crate) unanswered: u8,
    /// The client has room for the longest reply.
    pub(crate) can_receive: bool,
}

impl HubClient {
    /// Can it make another request?
    pub(crate) fn has_room(&self) -> bool {
        let bytes: usize = self.waiting.iter().map(|waiting| waiting.request.line_bytes()).sum();
        self.left.is_none() && self.waiting.len() < MOST_WAITING && bytes < MOST_WAITING_BYTES
    }

    /// The intent of a write (`None` for a read), and the command to the server that it contains. A write that the arm refuses
    /// has no effect, and counts as a setting.
    pub(crate) fn meaning(
        &self,
        now: Instant,
        request: &WholeRequest,
        known: &KnownRegisters,
    ) -> (Option<Intent>, Option<SharingCommand>) {
        match request {
            WholeRequest::Read { .. } => (None, None),
            WholeRequest::Write { map, address, values } if !known.accepts(*map, *address, values) => {
                (Some(Intent::Setting), None)
            }
            WholeRequest::Write { map, address, values } => {
                let intent = Intent::of(now, *map, *address, values, &self.readings);
                let command = SharingCommand::in_write(*address, values).filter(|_| *map == Map::V22);
                (Some(intent), command)
            }
            WholeRequest::WritesBetweenReads { .. } => (Some(Intent::Motion), None),
        }
    }

    /// Queues a request. An urgent one goes before the others, up to [`MOST_URGENT`] in each period.
    pub(crate) fn queue(&mut self, now: Instant, waiting: Waiting) {
        if waiting.intent.is_urgent() && self.may_be_urgent(now) {
            self.urgent.push_back(waiting);
        } else {
            self.waiting.push_back(waiting);
        }
    }

    fn may_be_urgent(&mut self, now: Instant) -> bool {
        let (begin, count) = &mut self.urgent_period;
        if now - *begin >= URGENT_PERIOD {
            (*begin, *count) = (now, 0);
        }
        *count = count.saturating_add(1);
        *count <= MOST_URGENT
    }

    /// Is its next request a read of these registers that can be sent now?
    pub(crate) fn waits_to_read(&self, address: u8, count: u8) -> bool {
        let next = self.waiting.front().map(|waiting| &waiting.request);
        self.can_receive && self.unanswered == 0 && next == Some(&WholeRequest::Read { address, count })
    }

    /// Bytes that the next request takes on the line.
    pub(crate) fn next_bytes(&self) -> usize {
        self.waiting.front().map_or(0, |waiting| waiting.request.line_bytes())
    }

    /// Queues a report if one of this stream is due, and few events wait. Returns whether it was queued.
    pub(crate) fn report(&mut self, now: Instant, stream: ReportKind, values: &[u8]) -> bool {
        let is_due = self.schedule.take_due(now, stream) && self.events.len() < MOST_REPORTS;
        if is_due {
            self.readings.note(now, stream.registers().0, values);
            self.events.push_back(HubEvent::Report { stream, values: values.to_vec() });
        }
        is_due
    }

    /// Its oldest read has ended.
    pub(crate) fn end_read(&mut self, now: Instant, event: HubEvent) {
        if let HubEvent::Reply { address, values } = &event {
            self.readings.note(now, *address, values);
        }
        self.unanswered = self.unanswered.saturating_sub(1);
        if self.left.is_none() {
            self.events.push_back(event);
        }
    }

    /// The client closed its connection: keeps only its writes, because replies can no longer be delivered.
    pub(crate) fn leave(&mut self, now: Instant) {
        self.left = Some(now);
        self.own = OwnRegisters::default();
        self.schedule = Schedule::default();
        self.unanswered = 0;
        self.events.clear();
        self.waiting.retain(|waiting| matches!(waiting.request, WholeRequest::Write { .. }));
    }

    /// Can the client be removed? It closed its connection, and has nothing left to carry out, or left [`LONGEST_WAIT`] ago.
    pub(crate) fn has_left(&self, now: Instant) -> bool {
        let is_idle = self.waiting.is_empty() && self.urgent.is_empty();
        self.left.is_some_and(|left| is_idle || now - left >= LONGEST_WAIT)
    }

    /// Drops the waiting requests that a stop ends; holds are kept. Returns whether there were any.
    pub(crate) fn drop_motion(&mut self) -> bool {
        self.drop_where(|waiting| waiting.intent.is_ended_by_stop())
    }

    /// Drops the requests to move or switch the arm that have waited for `LONGEST_WAIT`. Returns whether there were any.
    pub(crate) fn drop_stale(&mut self, now: Instant) -> bool {
        self.drop_where(|waiting| waiting.intent.must_be_fresh() && now - waiting.since >= LONGEST_WAIT)
    }

    /// Drops the requests that wait. Their reads get no reply.
    pub(crate) fn drop_waiting(&mut self) {
        self.urgent.clear();
        self.drop_where(|_| true);
    }

    fn drop_where(&mut self, is_dropped: impl Fn(&Waiting) -> bool) -> bool {
        let before = self.waiting.len();
        let (dropped, kept) = std::mem::take(&mut self.waiting).into_iter().partition(is_dropped);
        self.waiting = kept;
        let dropped: VecDeque<Waiting> = dropped;
        dropped.iter().for_each(|waiting| self.refuse(&waiting.request));
        self.waiting.len() != before
    }

    /// Counts a dropped write, or queues [`HubEvent::NoReply`] for each read of a dropped request.
    pub(crate) fn refuse(&mut self, request: &WholeRequest) {
        let (reads, (address, count)) = match request {
            WholeRequest::Read { address, count } => (1, (*address, *count)),
            WholeRequest::WritesBetweenReads { read, .. } => (2, *read),
            WholeRequest::Write { .. } => {
                self.dropped = self.dropped.wrapping_add(1);
                return;
            }
        };
        self.events.extend((0..reads).map(|_| HubEvent::NoReply { address, count }));
    }
}

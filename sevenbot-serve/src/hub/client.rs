//! One client: its requests that wait, its events, its own registers.

use std::collections::VecDeque;

use protocol_core::time::Instant;

use super::own_registers::OwnRegisters;
use super::request::WholeRequest;
use super::schedule::Schedule;
use super::shares::Share;
use super::stream::Stream;

/// Reports that wait for a client to take them. More are dropped.
const MOST_REPORTS: usize = 4;

/// What the hub has for a client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// The reply to the client's oldest read.
    Reply {
        /// The first register.
        address: u8,
        /// The values, one byte per register.
        values: Vec<u8>,
    },
    /// No reply comes to the client's oldest read: there is no arm, it did not answer, or the reply was damaged.
    NoReply {
        /// The first register.
        address: u8,
        /// How many registers.
        count: u8,
    },
    /// A report that the client's own registers ask for.
    Report {
        /// The stream.
        stream: Stream,
        /// The values of the stream's registers.
        values: Vec<u8>,
    },
}

/// One client.
#[derive(Debug, Default)]
pub(crate) struct Client {
    pub(crate) waiting: VecDeque<WholeRequest>,
    pub(crate) events: VecDeque<Event>,
    pub(crate) own: OwnRegisters,
    pub(crate) schedule: Schedule,
    pub(crate) share: Share,
    /// Reads that were sent and have no reply yet.
    pub(crate) unanswered: u8,
    /// The client has room for the longest reply.
    pub(crate) can_receive: bool,
}

impl Client {
    /// Queues a report, if one of this stream is due.
    pub(crate) fn report(&mut self, now: Instant, stream: Stream, values: &[u8]) {
        if self.schedule.take_due(now, stream) && self.events.len() < MOST_REPORTS {
            self.events.push_back(Event::Report { stream, values: values.to_vec() });
        }
    }

    /// Drops the requests that wait. Their reads get no reply.
    pub(crate) fn drop_waiting(&mut self) {
        for request in self.waiting.drain(..) {
            let (reads, (address, count)) = match request {
                WholeRequest::Read { address, count } => (1, (address, count)),
                WholeRequest::WritesBetweenReads { read, .. } => (2, read),
                WholeRequest::Write { .. } => continue,
            };
            self.events.extend((0..reads).map(|_| Event::NoReply { address, count }));
        }
    }
}

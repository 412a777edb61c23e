//! The line to the arm: a shell round the host link that knows whose read each reply answers.
//!
//! Apart from urgent ones, frames are written at the baud rate. So no queue grows in the kernel, where a later frame could not
//! pass an earlier one.

use std::collections::{BTreeMap, VecDeque};

use host_link::{HostEvent, HostLink, LinkOptions, Patience, RequestId, Snapshot, Span};
use protocol_core::registers::Map;
use protocol_core::registers::map::{FINE_POSITION, LOAD, PRESENT_POSITION};
use protocol_core::report_kind::ReportKind;
use protocol_core::time::{Duration, Instant};

use super::client::{HubClient, HubEvent};
use super::client_id::ClientId;
use super::request::{WholeRequest, reply_bytes};

/// For reads of clients. If a reply is later than recent delays explain, the read is repeated, unless something was written
/// since. So a lost frame delays its client, and the clients that wait for the line, only a little. The read is given up
/// after 3 s, because a busy computer may not run the arm's side of the port for a second. It ends earlier if a later reply shows
/// that its own one is lost, and it may not be repeated.
const CLIENT_PATIENCE: Patience = Patience { attempts: 3, timeout: Duration::from_millis(1_000) };
/// For reads of a hold. Until a reply comes, the hold itself sends another read every 100 ms, after the brake unless it restores.
/// The reply to each read may be up to 1 s late.
const HOLD_PATIENCE: Patience = Patience { attempts: 10, timeout: Duration::from_millis(100) };
/// For the other reads of the hub, which the hub itself repeats.
const OWN_PATIENCE: Patience = Patience { attempts: 1, timeout: Duration::from_millis(1_000) };
/// The line may be filled this far ahead, so that it is not idle while the program wakes up.
const AHEAD: Duration = Duration::from_millis(1);
/// While this many bytes or more wait for the port, the line is not free.
const MOST_OUTPUT: usize = 64;
/// If this many bytes wait, the port counts as stuck. A hold that repeats its frames then adds no more.
const STUCK_OUTPUT: usize = 1_024;
/// Bytes of replies that may be on their way when a client's read is sent. One read is always allowed.
const WINDOW: usize = 96;

/// The ranges of the reports of map 2.2 ([D26](protocol_core::decisions#d26)).
const REPORTS: &[Span] =
    &[Span::of(&PRESENT_POSITION), Span::of(&FINE_POSITION), Span::between(&FINE_POSITION, &LOAD)];

/// The owner of a read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Owner {
    Client(ClientId),
    /// The sampler.
    Sample(ReportKind),
    /// The hub, to hold the arm.
    Hold,
    /// The hub, to know the speeds before it slows the joints down.
    Speeds,
    /// The hub, to find out whether a 7Bot V2 is there.
    Identity,
    /// The hub, to find out whether the arm still answers.
    Presence,
}

impl Owner {
    const fn patience(self) -> Patience {
        match self {
            Self::Client(_) => CLIENT_PATIENCE,
            Self::Hold => HOLD_PATIENCE,
            Self::Sample(_) | Self::Speeds | Self::Identity | Self::Presence => OWN_PATIENCE,
        }
    }
}

/// The line, with the owner of each pending read.
#[derive(Debug)]
pub(crate) struct Line {
    link: HostLink,
    output: Vec<u8>,
    /// The owners of the pending reads. Clients may share a read.
    owners: BTreeMap<RequestId, Vec<Owner>>,
    events: VecDeque<(Owner, HubEvent)>,
}

impl Line {
    /// `may_report`: the arm may send reports that an earlier program asked for.
    pub(crate) fn new(baud: u32, may_report: bool) -> Self {
        // Otherwise the hub switches reports off when it finds the arm.
        let reports = if may_report { REPORTS } else { &[] };
        let link = HostLink::new(LinkOptions { baud, reports });
        Self { link, output: Vec::new(), owners: BTreeMap::new(), events: VecDeque::new() }
    }

    /// Forgets all bytes: the port was opened or closed. The reads on their way end without a reply.
    pub(crate) fn reset(&mut self) {
        self.link.reset();
        self.output.clear();
    }

    /// Ends all pending reads: they get no reply. Keeps the bytes that wait for the port: they may hold a stop, or the rest of a
    /// frame.
    pub(crate) fn end_reads(&mut self) {
        self.link.reset();
    }

    /// Gives up the reads of this owner, because their values are out of date.
    pub(crate) fn cancel_reads(&mut self, owner: Owner) {
        let link = &mut self.link;
        self.owners.retain(|&id, owners| {
            let is_kept = !owners.contains(&owner);
            if !is_kept {
                link.cancel(id);
            }
            is_kept
        });
        self.events.retain(|(other, _)| *other != owner);
    }

    /// Does a read still wait for its reply?
    pub(crate) fn is_waiting(&self) -> bool {
        !self.owners.is_empty()
    }

    /// Takes bytes of the arm.
    pub(crate) fn push(&mut self, now: Instant, bytes: &[u8]) {
        self.link.bytes(now, bytes);
    }

    /// The next end of a read, and the owner of this read.
    pub(crate) fn next_event(&mut self, now: Instant) -> Option<(Owner, HubEvent)> {
        self.advance(now);
        self.events.pop_front()
    }

    /// Moves frames to the output, and the ends of reads to their owners.
    fn advance(&mut self, now: Instant) {
        loop {
            let (id, event) = match self.link.poll(now) {
                HostEvent::Wait(_) => return,
                HostEvent::Send(frame) => {
                    self.output.extend(frame);
                    continue;
                }
                HostEvent::Reply(id, Snapshot { address, values }) => {
                    (id, HubEvent::Reply { address, values })
                }
                HostEvent::NoReply(id, range) => (id, no_reply(range.address(), range.count())),
                _ => continue,
            };
            let owners = self.owners.remove(&id).unwrap_or_default();
            self.events.extend(owners.into_iter().map(|owner| (owner, event.clone())));
        }
    }

    /// Is the line free for another frame?
    pub(crate) fn is_free(&self, now: Instant) -> bool {
        self.free_at(now) <= now
    }

    /// When the line is free for another frame. [`Instant::FAR_FUTURE`] while [`MOST_OUTPUT`] bytes or more wait for the port.
    pub(crate) fn free_at(&self, now: Instant) -> Instant {
        if self.output.len() >= MOST_OUTPUT {
            Instant::FAR_FUTURE
        } else if self.link.busy_until() <= now + AHEAD {
            now
        } else {
            Instant::from_micros(self.link.busy_until().as_micros() - AHEAD.as_micros())
        }
    }

    /// Do so many bytes wait for the port ([`STUCK_OUTPUT`]) that it counts as stuck?
    pub(crate) const fn is_stuck(&self) -> bool {
        self.output.len() >= STUCK_OUTPUT
    }

    /// May reads be sent whose replies have `bytes` bytes?
    pub(crate) fn has_window(&self, bytes: usize) -> bool {
        let on_their_way = self.link.awaited_bytes();
        on_their_way == 0 || on_their_way + bytes <= WINDOW
    }

    /// Can the client's oldest request be sent?
    pub(crate) fn takes(&self, client: &HubClient) -> bool {
        match client.waiting.front().map(|waiting| &waiting.request) {
            Some(WholeRequest::Read { count, .. }) => {
                client.can_receive && client.unanswered == 0 && self.has_window(reply_bytes(*count))
            }
            Some(WholeRequest::WritesBetweenReads { read: (_, count), .. }) => {
                client.can_receive && client.unanswered == 0 && self.has_window(2 * reply_bytes(*count))
            }
            Some(WholeRequest::Write { .. }) => client.unanswered == 0,
            None => false,
        }
    }

    pub(crate) fn send_read(&mut self, now: Instant, owner: Owner, address: u8, count: u8) {
        self.send_shared_read(now, vec![owner], owner.patience(), address, count);
    }

    /// Sends a read whose reply is for all these clients.
    pub(crate) fn send_clients_read(&mut self, now: Instant, clients: Vec<ClientId>, address: u8, count: u8) {
        let owners = clients.into_iter().map(Owner::Client).collect();
        self.send_shared_read(now, owners, CLIENT_PATIENCE, address, count);
    }

    fn send_shared_read(
        &mut self,
        now: Instant,
        owners: Vec<Owner>,
        patience: Patience,
        address: u8,
        count: u8,
    ) {
        match Span::new(address, count) {
            Some(range) => {
                self.owners.insert(self.link.read(range, patience), owners);
            }
            // The arm would not answer (D2).
            None => self.events.extend(owners.into_iter().map(|owner| (owner, no_reply(address, count)))),
        }
        self.advance(now);
    }

    /// Sends a write with the function code of its map ([M1](protocol_core::decisions#m1)).
    pub(crate) fn send_write(&mut self, now: Instant, map: Map, address: u8, values: &[u8]) {
        self.link.write(map, address, values);
        self.advance(now);
    }

    /// Bytes for the arm.
    pub(crate) fn output(&self) -> &[u8] {
        &self.output
    }

    /// Removes bytes that were sent.
    pub(crate) fn consume(&mut self, count: usize) {
        self.output.drain(..count.min(self.output.len()));
    }

    /// The next timeout: of a reply, or of an idle line for the deframer. [`Instant::ZERO`] while events wait for
    /// [`Self::next_event`].
    pub(crate) fn deadline(&self) -> Instant {
        if self.events.is_empty() { self.link.deadline() } else { Instant::ZERO }
    }
}

const fn no_reply(address: u8, count: u8) -> HubEvent {
    HubEvent::NoReply { address, count }
}

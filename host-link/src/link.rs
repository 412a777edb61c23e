//! The link: requests and bytes in, events out. See the crate's documentation.

use std::collections::VecDeque;

use protocol_core::registers::Map;
use protocol_core::registers::map::DEVICE_CODE;
use protocol_core::request::{Alarm, Request};
use protocol_core::time::Instant;
use protocol_core::wire::deframer::gap;
use protocol_core::wire::frame::MIN_LENGTH;
use protocol_core::wire::{Deframer, Frame, FrameBuffer, Function, ToHost};

use crate::event::{HostEvent, RequestId};
use crate::line_time::LineTime;
use crate::open_reads::{OpenRead, OpenReads, Overdue, Patience};
use crate::pending_reads::{Matched, PendingReads, Wait};
use crate::snapshot::Snapshot;
use crate::span::Span;

/// At most this many markers in a row are sent for a read. If no reply to them comes, the read is sent all the same.
const MOST_MARKERS: u32 = 3;
/// The register that a marker reads. A marker behind others reads some registers more.
const MARKED: Span = Span::of(&DEVICE_CODE);

/// The line, and what the arm may send without a request.
#[derive(Clone, Copy, Debug)]
pub struct LinkOptions {
    /// Baud rate of the line to the arm.
    pub baud: u32,
    /// The ranges of registers that a report of map 2.2 may have ([D26](protocol_core::decisions#d26)). A report looks
    /// like the reply to a read of its range, so no read asks for exactly one of these.
    pub reports: &'static [Span],
}

/// A request that was not sent yet.
#[derive(Clone, Debug)]
enum Queued {
    Read(OpenRead),
    Write(Vec<u8>),
    /// A write that is sent before all other requests in the queue.
    WriteAhead(Vec<u8>),
}

/// The host's end of the link to one arm.
#[derive(Clone, Debug)]
pub struct HostLink {
    options: LinkOptions,
    deframer: Deframer<ToHost>,
    line: LineTime,
    queue: VecDeque<Queued>,
    open: OpenReads,
    pending: PendingReads,
    markers: Markers,
    events: VecDeque<HostEvent>,
    last_id: RequestId,
    /// The number of writes that were sent; wraps.
    writes: u64,
    /// All bytes that came until this time were handed over.
    heard_until: Instant,
}

impl HostLink {
    /// A link on which nothing was sent.
    #[must_use]
    pub fn new(options: LinkOptions) -> Self {
        Self {
            options,
            deframer: Deframer::new(gap(options.baud)),
            line: LineTime::new(options.baud),
            queue: VecDeque::new(),
            open: OpenReads::default(),
            pending: PendingReads::default(),
            markers: Markers::NONE,
            events: VecDeque::new(),
            last_id: RequestId::default(),
            writes: 0,
            heard_until: Instant::ZERO,
        }
    }

    /// From now on reports may have these registers: [`LinkOptions::reports`].
    pub const fn set_reports(&mut self, reports: &'static [Span]) {
        self.options.reports = reports;
    }

    /// Reads registers. A [`HostEvent::Reply`] or a [`HostEvent::NoReply`] follows, unless the read is cancelled.
    pub fn read(&mut self, wanted: Span, patience: Patience) -> RequestId {
        self.last_id = self.last_id.next();
        self.queue.push_back(Queued::Read(OpenRead::new(self.last_id, wanted, patience)));
        self.last_id
    }

    /// Writes registers, at most 255, with the function code of a map ([M1](protocol_core::decisions#m1)). A write has no reply
    /// ([D6](protocol_core::decisions#d6)). It is sent after the requests in the queue. Reads that were sent before the write
    /// are not repeated after it.
    pub fn write(&mut self, map: Map, address: u8, values: &[u8]) {
        self.queue.push_back(Queued::Write(encoded_write(map, address, values)));
    }

    /// As [`Self::write`], but sent before all other requests in the queue: for a stop. Several such writes keep their order.
    /// A repeat of a read that is in the queue is sent after it, too.
    pub fn write_ahead(&mut self, map: Map, address: u8, values: &[u8]) {
        let place = self.queue.iter().take_while(|queued| matches!(queued, Queued::WriteAhead(_))).count();
        self.queue.insert(place, Queued::WriteAhead(encoded_write(map, address, values)));
    }

    /// Gives a read up. If its reply still comes, it is [`HostEvent::Unmatched`].
    pub fn cancel(&mut self, id: RequestId) {
        self.queue.retain(|queued| !matches!(queued, Queued::Read(read) if read.id == id));
        self.open.take(id);
        self.pending.give_up(id);
        self.markers = Markers::NONE;
    }

    /// For a line that was opened or closed: ends all reads without a reply, and drops writes in the queue, events and received
    /// bytes.
    pub fn reset(&mut self) {
        let queued = std::mem::take(&mut self.queue).into_iter().filter_map(|queued| match queued {
            Queued::Read(read) => Some(read),
            Queued::Write(_) | Queued::WriteAhead(_) => None,
        });
        let events = self.open.take_all().chain(queued).map(no_reply).collect();
        let (line, last_id) = (self.line, self.last_id);
        *self = Self { line, last_id, events, ..Self::new(self.options) };
    }

    /// Takes bytes of the arm that have arrived until `now`. An empty slice states that no others have arrived. The timeout of
    /// a read acts only after a call with its time or a later one, so that a host that was suspended first passes on the bytes
    /// that arrived meanwhile.
    pub fn bytes(&mut self, now: Instant, bytes: &[u8]) {
        self.heard_until = self.heard_until.max(now);
        let mut rest = bytes;
        loop {
            let taken = self.deframer.push(now, rest);
            self.pull_frames();
            rest = rest.get(taken..).unwrap_or_default();
            if rest.is_empty() {
                return;
            }
        }
    }

    /// The next event. Call it until it returns [`HostEvent::Wait`].
    pub fn poll(&mut self, now: Instant) -> HostEvent {
        while self.events.is_empty()
            && let Some(overdue) = self.open.take_overdue(self.heard_until, self.writes)
        {
            self.end_attempt(overdue);
        }
        let event = self.events.pop_front().or_else(|| self.next_frame(now));
        event.unwrap_or_else(|| HostEvent::Wait(self.deadline()))
    }

    /// When the last byte leaves the host, or has left, at the baud rate of the line.
    #[must_use]
    pub const fn busy_until(&self) -> Instant {
        self.line.busy_until()
    }

    /// The bytes of the replies that are on their way to open reads, without those to markers.
    #[must_use]
    pub fn awaited_bytes(&self) -> usize {
        self.pending.awaited().map(|span| MIN_LENGTH + usize::from(span.count())).sum()
    }

    /// When [`HostEvent::Wait`] ends, if no bytes come.
    #[must_use]
    pub fn deadline(&self) -> Instant {
        let deframer = self.deframer.deadline().unwrap_or(Instant::FAR_FUTURE);
        self.open.due().min(deframer).min(self.markers.due)
    }

    /// The next queued frame that may be sent, or a marker.
    fn next_frame(&mut self, now: Instant) -> Option<HostEvent> {
        let frame = match self.queue.pop_front()? {
            Queued::Write(frame) | Queued::WriteAhead(frame) => {
                self.writes = self.writes.wrapping_add(1);
                self.line.send(now, frame.len());
                frame
            }
            Queued::Read(read) => match self.pending.range_for(read.id, read.wanted, self.options.reports) {
                Ok(asked) => self.send_read(now, read, asked),
                Err(Wait::ForMarker) if self.markers.sent == MOST_MARKERS && self.markers.due <= now => {
                    self.send_read(now, read, read.wanted)
                }
                Err(wait) => {
                    self.queue.push_front(Queued::Read(read));
                    return self.marker(now, wait).map(HostEvent::Send);
                }
            },
        };
        Some(HostEvent::Send(frame))
    }

    fn send_read(&mut self, now: Instant, mut read: OpenRead, asked: Span) -> Vec<u8> {
        self.markers = Markers::NONE;
        let (frame, due) = self.ask(now, Some(read.id), asked);
        read.note_sent(due, self.line.allowance(), self.writes);
        self.open.push(read);
        frame
    }

    /// The marker that a read waits for, if one has to be sent now.
    fn marker(&mut self, now: Instant, wait: Wait) -> Option<Vec<u8>> {
        let is_due = wait == Wait::ForMarker && (self.markers.sent == 0 || self.markers.due <= now);
        let asked = is_due.then(|| self.pending.free(MARKED, self.options.reports))??;
        let (frame, due) = self.ask(now, None, asked);
        self.markers = Markers { sent: self.markers.sent + 1, due: due + self.line.allowance() };
        Some(frame)
    }

    /// The frame of a read, and when its reply is due; `None` as `id` for a marker.
    fn ask(&mut self, now: Instant, id: Option<RequestId>, asked: Span) -> (Vec<u8>, Instant) {
        let frame = encoded(&Request::Read { address: asked.address(), count: asked.count() });
        self.line.send(now, frame.len());
        let due = self.line.expect(MIN_LENGTH + usize::from(asked.count()));
        self.pending.add(id, asked, due);
        (frame, due)
    }

    fn end_attempt(&mut self, overdue: Overdue) {
        match overdue {
            // A repeat goes to the front, because it must not be sent after writes that wait.
            Overdue::Repeat(read) => self.queue.push_front(Queued::Read(read)),
            Overdue::GiveUp(read) => {
                self.pending.give_up(read.id);
                self.events.push_back(no_reply(read));
            }
        }
    }

    fn pull_frames(&mut self) {
        while let Some(found) = self.deframer.pull() {
            match found.map(ArmMessage::from) {
                Ok(ArmMessage::Reply(values)) => self.take_reply(values),
                Ok(ArmMessage::Other(event)) => self.events.push_back(event),
                Err(defect) => {
                    self.events.push_back(HostEvent::Damaged(defect));
                    let damaged = self.pending.note_damage(self.heard_until);
                    if let Some(id) = damaged.filter(|&id| !self.pending.awaits(id)) {
                        self.open.note_damage(id, self.heard_until);
                    }
                }
            }
        }
    }

    fn take_reply(&mut self, values: Snapshot) {
        let range = values.span();
        let Some(Matched { id, due, lost }) = self.pending.take(range) else {
            let is_report = self.options.reports.contains(&range);
            return self.events.push_back(match is_report {
                true => HostEvent::Report(Map::V22, values),
                false => HostEvent::Unmatched(Function::Read, values),
            });
        };
        if let Some(due) = due {
            self.line.note_reply(due, self.heard_until);
        }
        for lost in lost.into_iter().filter(|&lost| Some(lost) != id) {
            self.lose(lost);
        }
        let read = id.and_then(|id| self.open.take(id));
        self.events.push_back(match read {
            Some(read) => {
                self.pending.give_up(read.id);
                HostEvent::Reply(read.id, values.part(read.wanted))
            }
            None => HostEvent::Unmatched(Function::Read, values),
        });
    }

    /// The reply to a later read came first, so the reply to this read is lost ([D5](protocol_core::decisions#d5)). If no
    /// repeat is on its way, the read is repeated at once or, if it may not be repeated, given up.
    fn lose(&mut self, id: RequestId) {
        if self.pending.awaits(id) {
            return;
        }
        let Some(read) = self.open.take(id) else { return };
        let overdue =
            if read.may_repeat(self.writes) { Overdue::Repeat(read) } else { Overdue::GiveUp(read) };
        self.end_attempt(overdue);
    }
}

/// The markers that the read at the front of the queue waits for.
#[derive(Clone, Copy, Debug)]
struct Markers {
    sent: u32,
    /// When the reply to the last one is overdue.
    due: Instant,
}

impl Markers {
    /// No read waits for a marker.
    const NONE: Self = Self { sent: 0, due: Instant::FAR_FUTURE };
}

enum ArmMessage {
    /// The reply to a read, or a report of map 2.2.
    Reply(Snapshot),
    Other(HostEvent),
}

impl From<Frame<'_>> for ArmMessage {
    fn from(frame: Frame<'_>) -> Self {
        let values = Snapshot { address: frame.address, values: frame.data.to_vec() };
        match (frame.function, Alarm::from_frame(frame)) {
            (_, Some(alarm)) => Self::Other(HostEvent::Alarm(alarm)),
            (Function::Read, _) => Self::Reply(values),
            (Function::Report, _) => Self::Other(HostEvent::Report(Map::V21, values)),
            (other, _) => Self::Other(HostEvent::Unmatched(other, values)),
        }
    }
}

const fn no_reply(read: OpenRead) -> HostEvent {
    HostEvent::NoReply(read.id, read.wanted)
}

fn encoded_write(map: Map, address: u8, values: &[u8]) -> Vec<u8> {
    encoded(&match map {
        Map::V22 => Request::Write { address, values },
        Map::V21 => Request::WriteMap21 { address, values },
    })
}

fn encoded(request: &Request<'_>) -> Vec<u8> {
    let mut frame = FrameBuffer::new();
    request.encode(&mut frame);
    frame.to_vec()
}

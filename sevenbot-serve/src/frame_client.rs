//! A client with frames as on the arm's line: parses its requests, and encodes its replies and reports.
//!
//! If a client does not take its bytes, its reports are dropped first. Then its replies are queued, its reads wait for room,
//! and finally its bytes stay in the connection. Its writes are carried out unless they are behind a read that waits
//! ([D5](protocol_core::decisions#d5)); a stop passes that read.

use protocol_core::report_kind::ReportKind;
use protocol_core::request::{Reply, ReportMap21};
use protocol_core::time::Instant;
use protocol_core::wire::deframer::gap;
use protocol_core::wire::{Deframer, FrameBuffer, Function, MAX_LENGTH, ToArm};

use crate::hub::{ClientId, Hub, HubEvent, WholeRequest};

/// Reports are dropped while this many bytes or more wait for the client. At 50 Hz they are 1.5 s of reports of 14 bytes,
/// or 0.4 s of the longest ones, 49 bytes.
const MOST_REPORT_BYTES: usize = 1_024;
/// Reads of the client wait when its output could exceed this many bytes with the next reply.
const MOST_BYTES: usize = 4_096;

/// A client that sends and receives frames.
#[derive(Debug)]
pub struct FrameClient {
    id: ClientId,
    deframer: Deframer<ToArm>,
    output: Vec<u8>,
    /// Reads are dropped, because the bytes come from a program that is gone.
    drops_reads: bool,
}

impl FrameClient {
    /// A new client of `hub`. `baud` is the rate of the arm's line: gaps between bytes are measured in its characters
    /// ([D4](protocol_core::decisions#d4)).
    pub fn connect(hub: &mut Hub, baud: u32) -> Self {
        let id = hub.connect();
        hub.set_can_receive(id, true);
        Self { id, deframer: Deframer::new(gap(baud)), output: Vec::new(), drops_reads: false }
    }

    /// The client in calls of the [`Hub`].
    #[must_use]
    pub const fn id(&self) -> ClientId {
        self.id
    }

    /// Takes bytes that the client sent at `since` or later, and returns how many. Offer the rest again when requests were sent
    /// to the arm. An empty slice states that the client is silent at `now`.
    pub fn push(&mut self, hub: &mut Hub, now: Instant, since: Instant, bytes: &[u8]) -> usize {
        let mut rest = bytes;
        loop {
            self.pull_all(hub, now, since);
            if !hub.has_room(self.id) {
                break;
            }
            // Take bytes up to the end of one frame at most. The rest stays with the caller, which knows when it was sent.
            let piece = rest.get(..self.deframer.wanted().max(1)).unwrap_or(rest);
            let count = self.deframer.push(now, piece);
            rest = rest.get(count..).unwrap_or(&[]);
            if count == 0 {
                self.pull_all(hub, now, since);
                break;
            }
        }
        bytes.len() - rest.len()
    }

    /// Queues the requests in the bytes taken so far.
    fn pull_all(&mut self, hub: &mut Hub, now: Instant, since: Instant) {
        while hub.has_room(self.id) {
            match self.deframer.pull() {
                Some(Ok(frame)) if self.drops_reads && frame.function == Function::Read => {}
                Some(Ok(frame)) => {
                    hub.request(now, self.id, since, WholeRequest::from_frame(frame));
                }
                Some(Err(_)) => {}
                None => return,
            }
        }
    }

    /// States whether reads are dropped: true while the bytes come from a program that is gone.
    pub const fn set_drops_reads(&mut self, drops_reads: bool) {
        self.drops_reads = drops_reads;
    }

    /// Collects replies and reports from the hub. Call it after [`Hub::poll`] and [`Hub::arm_bytes`].
    pub fn collect(&mut self, hub: &mut Hub) {
        let mut frame = FrameBuffer::new();
        while let Some(event) = hub.take_event(self.id) {
            match &event {
                HubEvent::Reply { address, values } => Reply { address: *address, values }.encode(&mut frame),
                HubEvent::Report { stream, values } if self.output.len() < MOST_REPORT_BYTES => {
                    encode_report(*stream, values, &mut frame);
                }
                HubEvent::Report { .. } | HubEvent::NoReply { .. } => continue,
            }
            self.output.extend_from_slice(&frame);
        }
        hub.set_can_receive(self.id, self.output.len() + MAX_LENGTH <= MOST_BYTES);
    }

    /// The frames that the client has not taken yet: see [`FrameClient::consume`].
    #[must_use]
    pub fn output(&self) -> &[u8] {
        &self.output
    }

    /// Removes bytes that the client took.
    pub fn consume(&mut self, count: usize) {
        self.output.drain(..count.min(self.output.len()));
    }

    /// When to call [`FrameClient::push`] with an empty slice if the client stays silent.
    #[must_use]
    pub fn deadline(&self) -> Instant {
        self.deframer.deadline().unwrap_or(Instant::FAR_FUTURE)
    }
}

/// A report has the form of the register that asked for it ([M4](protocol_core::decisions#m4)).
fn encode_report(stream: ReportKind, values: &[u8], frame: &mut FrameBuffer) {
    let (address, _) = stream.registers();
    match stream {
        ReportKind::Positions | ReportKind::FinePositions | ReportKind::FineState => {
            Reply { address, values }.encode(frame)
        }
        ReportKind::Angles | ReportKind::Loads => ReportMap21 { address, values }.encode(frame),
    }
}

//! A blocking shell round the host link: a line, its clock, and counts of what was received.

use std::time::{Duration, Instant};

use host_link::{HostEvent, HostLink, LinkOptions, Patience, RequestId, Span};
use protocol_core::time;
use tracing::{debug, trace};

use crate::error::{PortError, ReceiveCounts};
use crate::host_line::HostLine;
use crate::map_view::WriteFrame;
use crate::traffic::Traffic;

/// A line to an arm, and the host's end of the link on it.
pub(crate) struct BlockingLink {
    line: Box<dyn HostLine>,
    link: HostLink,
    received: ReceiveCounts,
    start: Instant,
}

impl BlockingLink {
    /// `reports`: the ranges of registers that a report may hold.
    pub(crate) fn new(line: Box<dyn HostLine>, baud: u32, reports: &'static [Span]) -> Self {
        let start = line.now();
        let link = HostLink::new(LinkOptions { baud, reports });
        Self { line, link, received: ReceiveCounts::default(), start }
    }

    pub(crate) const fn set_reports(&mut self, reports: &'static [Span]) {
        self.link.set_reports(reports);
    }

    /// Queues a read. [`Self::poll`] sends it.
    pub(crate) fn read(&mut self, wanted: Span, patience: Patience) -> RequestId {
        self.link.read(wanted, patience)
    }

    /// Queues a write. [`Self::poll`] sends it.
    pub(crate) fn write(&mut self, frame: &WriteFrame) {
        self.link.write(frame.map, frame.address, &frame.values);
    }

    /// Gives a read up.
    pub(crate) fn cancel(&mut self, id: RequestId) {
        self.link.cancel(id);
    }

    /// Sends what is queued. Returns the next event, without waiting.
    pub(crate) fn poll(&mut self) -> Result<HostEvent, PortError> {
        loop {
            match self.link.poll(self.time_at(self.line.now())) {
                HostEvent::Send(frame) => self.send(&frame)?,
                HostEvent::Damaged(defect) => {
                    self.received.damaged_frames += 1;
                    debug!("<- a damaged frame: {defect:?}");
                }
                event => {
                    self.count(&event);
                    return Ok(event);
                }
            }
        }
    }

    /// Waits for the next event other than [`HostEvent::Wait`]. Returns `None` if there is none before `deadline`.
    pub(crate) fn next(&mut self, deadline: Option<Instant>) -> Result<Option<HostEvent>, PortError> {
        loop {
            let until = match self.poll()? {
                HostEvent::Wait(until) => until,
                event => return Ok(Some(event)),
            };
            let now = self.line.now();
            let left = deadline.map_or(Duration::MAX, |deadline| deadline.saturating_duration_since(now));
            if left.is_zero() {
                return Ok(None);
            }
            let wait = Duration::from_micros((until - self.time_at(now)).as_micros());
            self.receive(wait.min(left))?;
        }
    }

    /// Hands the bytes that have arrived, or arrive within `timeout`, to the link. `false` if there are none.
    pub(crate) fn receive(&mut self, timeout: Duration) -> Result<bool, PortError> {
        // After a wait without bytes, the link gets the planned end of the wait, not the time of the clock. After a suspension
        // of the computer the clock is much later: the link would give up a read although its reply waits in the line.
        let end = self.time_at(self.line.now() + timeout);
        let bytes = self.line.receive(timeout)?;
        self.received.bytes += bytes.len();
        let now = if bytes.is_empty() { end } else { self.time_at(self.line.now()) };
        self.link.bytes(now, &bytes);
        Ok(!bytes.is_empty())
    }

    pub(crate) fn now(&self) -> Instant {
        self.line.now()
    }

    /// The time since [`Self::new`], on the clock of the line.
    pub(crate) fn elapsed(&self) -> Duration {
        self.now().saturating_duration_since(self.start)
    }

    /// Waits on the clock of the line.
    pub(crate) fn sleep(&mut self, duration: Duration) {
        self.line.sleep(duration);
    }

    /// Takes the counts since the previous call. Their `earlier_frames` counts the good frames before that call.
    pub(crate) fn take_received(&mut self) -> ReceiveCounts {
        let received = std::mem::take(&mut self.received);
        self.received.earlier_frames = received.earlier_frames + received.other_frames;
        received
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), PortError> {
        if let Some(request) = Traffic::sent(frame) {
            trace!("-> {request}");
        }
        self.line.send(frame)
    }

    fn count(&mut self, event: &HostEvent) {
        if let Some(traffic) = Traffic::received(event) {
            trace!("<- {traffic}");
            self.received.other_frames += 1;
        }
    }

    fn time_at(&self, at: Instant) -> time::Instant {
        let micros = at.saturating_duration_since(self.start).as_micros();
        time::Instant::from_micros(u64::try_from(micros).unwrap_or(u64::MAX))
    }
}

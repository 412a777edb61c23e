//! Reports: the arm is read once at the highest frequency that any client wants; each client gets its own frequency.
//!
//! Reads are used, and not the arm's reports, for three reasons. A report of map 2.2 looks like the reply to a read.
//! The arm ends the streams of one map when the other map is written. And every arm can be read.

use protocol_core::registers::Register;
use protocol_core::registers::map::PRESENT_POSITION;
use protocol_core::time::{Duration, Instant};

use super::client::Client;
use super::own_registers::OwnRegisters;
use super::request::reply_bytes;
use super::shares::Share;

/// A stream of reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// The present positions of map 2.2.
    Positions,
}

/// Number of streams.
const STREAMS: usize = 1;

impl Stream {
    /// All streams.
    pub(crate) const ALL: [Self; STREAMS] = [Self::Positions];

    /// The registers in a report.
    #[must_use]
    pub const fn registers(self) -> Register {
        match self {
            Self::Positions => PRESENT_POSITION,
        }
    }

    const fn index(self) -> usize {
        self as usize
    }
}

/// When a stream is due next.
#[derive(Clone, Copy, Debug)]
struct Timer {
    /// Zero: off.
    period: Duration,
    due: Instant,
}

impl Timer {
    const OFF: Self = Self { period: Duration::ZERO, due: Instant::FAR_FUTURE };

    /// A frequency of 0 Hz switches off. The same frequency as before keeps the time.
    fn set(&mut self, now: Instant, frequency: u32) {
        let period = Duration::from_micros(1_000_000_u32.checked_div(frequency).unwrap_or(0).into());
        if period == Duration::ZERO {
            *self = Self::OFF;
        } else if period != self.period {
            *self = Self { period, due: now + period };
        }
    }

    /// A due time that is a whole period late is skipped, and does not make a burst.
    fn advance(&mut self, now: Instant) {
        let due = self.due + self.period;
        self.due = if due + self.period < now { now + self.period } else { due };
    }
}

/// When the reports of one client are due.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Schedule([Timer; STREAMS]);

impl Default for Schedule {
    fn default() -> Self {
        Self([Timer::OFF; STREAMS])
    }
}

impl Schedule {
    /// Sets the frequencies that the client's own registers hold.
    pub(crate) fn set(&mut self, now: Instant, own: &OwnRegisters) {
        for (timer, stream) in self.0.iter_mut().zip(Stream::ALL) {
            timer.set(now, own.frequency(stream).into());
        }
    }

    /// Is a report of the stream due? A report may be half a sample early, so that the mean frequency is kept.
    pub(crate) fn take_due(&mut self, now: Instant, stream: Stream) -> bool {
        let Some(timer) = self.0.get_mut(stream.index()) else { return false };
        let is_due = timer.period != Duration::ZERO && timer.due <= now + EARLY;
        if is_due {
            timer.advance(now);
        }
        is_due
    }
}

/// How early a report may come: a quarter of the shortest period of 20 ms.
const EARLY: Duration = Duration::from_millis(5);

/// Reads the arm for all clients.
#[derive(Debug)]
pub(crate) struct Sampler {
    timers: [Timer; STREAMS],
    pub(crate) share: Share,
    /// In bits per second.
    baud: u32,
}

impl Sampler {
    /// A sampler that reads nothing. `baud` is in bits per second.
    pub(crate) const fn new(baud: u32) -> Self {
        Self { timers: [Timer::OFF; STREAMS], share: Share::IDLE, baud }
    }

    /// Sets the highest frequencies that these clients want.
    pub(crate) fn set_frequencies<'a>(
        &mut self,
        now: Instant,
        clients: impl Iterator<Item = &'a Client> + Clone,
    ) {
        for (timer, stream) in self.timers.iter_mut().zip(Stream::ALL) {
            let wanted = clients.clone().map(|client| client.own.frequency(stream)).max().unwrap_or(0);
            let most = highest_frequency(self.baud, stream.registers().count);
            timer.set(now, u32::from(wanted).min(most));
        }
    }

    /// When the next sample is due.
    pub(crate) fn due(&self) -> Instant {
        self.timers.iter().map(|timer| timer.due).min().unwrap_or(Instant::FAR_FUTURE)
    }

    /// A stream whose sample is due.
    pub(crate) fn next_due(&self, now: Instant) -> Option<Stream> {
        let mut streams = self.timers.iter().zip(Stream::ALL);
        streams.find(|(timer, _)| timer.due <= now).map(|(_, stream)| stream)
    }

    /// A sample was asked for.
    pub(crate) fn note_sent(&mut self, now: Instant, stream: Stream) {
        if let Some(timer) = self.timers.get_mut(stream.index()) {
            timer.advance(now);
        }
    }
}

/// At most half of the line is for reports (D14).
fn highest_frequency(baud: u32, count: u8) -> u32 {
    let bytes = u32::try_from(reply_bytes(count)).unwrap_or(u32::MAX);
    (baud / 20).checked_div(bytes).unwrap_or(0).max(1)
}

//! Reports: the arm is read once at the highest frequency that any client wants; each client gets its own frequency.
//!
//! Reads are used, and not the arm's reports, for three reasons. A report of map 2.2 looks like the reply to a read.
//! A write of one map can end the arm's streams of the other map ([M4](protocol_core::decisions#m4)). And every arm can be read.

use protocol_core::report_kind::ReportKind;
use protocol_core::time::Instant;

use super::own_registers::OwnRegisters;
use super::request::reply_bytes;
use super::schedule::Timer;
use super::shares::Share;

/// Reads the arm for all clients.
#[derive(Debug)]
pub(crate) struct Sampler {
    timers: [Timer; ReportKind::ALL.len()],
    pub(crate) share: Share,
    /// A sample is due, and the share of the sampler has joined the shares of the clients.
    waits: bool,
    /// In bits per second.
    baud: u32,
}

impl Sampler {
    /// A sampler that reads nothing. `baud` is in bits per second.
    pub(crate) const fn new(baud: u32) -> Self {
        Self { timers: [Timer::OFF; ReportKind::ALL.len()], share: Share::IDLE, waits: false, baud }
    }

    /// Sets the highest frequencies that these clients want, each up to [`highest_frequency`].
    pub(crate) fn set_frequencies<'a>(
        &mut self,
        now: Instant,
        clients: impl Iterator<Item = &'a OwnRegisters> + Clone,
    ) {
        let wanted =
            ReportKind::ALL.map(|stream| clients.clone().map(|own| own.frequency(stream)).max().unwrap_or(0));
        let streams = || ReportKind::ALL.into_iter().zip(wanted);
        let active = streams().filter(|&(_, wanted)| wanted > 0);
        let bytes = active.map(|(stream, _)| reply_bytes(stream.registers().1)).sum();
        let most = highest_frequency(self.baud, bytes);
        for (timer, (_, wanted)) in self.timers.iter_mut().zip(streams()) {
            timer.set(now, u32::from(wanted).min(most));
        }
    }

    /// When the next sample is due.
    pub(crate) fn due(&self) -> Instant {
        self.timers.iter().map(|timer| timer.due).min().unwrap_or(Instant::FAR_FUTURE)
    }

    /// A stream whose sample is due.
    pub(crate) fn next_due(&self, now: Instant) -> Option<ReportKind> {
        let mut streams = self.timers.iter().zip(ReportKind::ALL);
        streams.find(|(timer, _)| timer.due <= now).map(|(_, stream)| stream)
    }

    /// Has a sample become due since the last one was sent? True once for each.
    pub(crate) fn begins_to_wait(&mut self, now: Instant) -> bool {
        let begins = !self.waits && self.due() <= now;
        self.waits |= begins;
        begins
    }

    /// Notes that a sample was requested, and advances the timer of its stream.
    pub(crate) fn note_sent(&mut self, now: Instant, stream: ReportKind) {
        self.waits = false;
        if let Some(timer) = self.timers.get_mut(stream.index()) {
            timer.advance(now);
        }
    }
}

/// The highest frequency, in Hz, at which the reports of all streams together take at most half of the line
/// ([D14](protocol_core::decisions#d14), [M4](protocol_core::decisions#m4)); at least 1. `bytes`: one report of each active
/// stream, added up.
fn highest_frequency(baud: u32, bytes: usize) -> u32 {
    let bytes = u32::try_from(bytes).unwrap_or(u32::MAX);
    (baud / 20).checked_div(bytes).unwrap_or(0).max(1)
}

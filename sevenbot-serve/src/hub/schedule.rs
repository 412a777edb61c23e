//! When reports are due.

use protocol_core::report_kind::ReportKind;
use protocol_core::time::{Duration, Instant};

use super::own_registers::OwnRegisters;

/// How early a report may come: half of the shortest period, which is 10 ms.
const EARLY: Duration = Duration::from_millis(5);

/// When a stream is due next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timer {
    /// Zero: off.
    period: Duration,
    pub(crate) due: Instant,
}

impl Timer {
    pub(crate) const OFF: Self = Self { period: Duration::ZERO, due: Instant::FAR_FUTURE };

    /// Sets the frequency in Hz; 0 switches the timer off. An unchanged frequency keeps the due time.
    pub(crate) fn set(&mut self, now: Instant, frequency: u32) {
        let period = Duration::from_micros(1_000_000_u32.checked_div(frequency).unwrap_or(0).into());
        if period == Duration::ZERO {
            *self = Self::OFF;
        } else if period != self.period {
            *self = Self { period, due: now + period };
        }
    }

    /// Advances to the next due time. If that is more than a period late, goes on from `now` instead of sending a burst.
    pub(crate) fn advance(&mut self, now: Instant) {
        let due = self.due + self.period;
        self.due = if due + self.period < now { now + self.period } else { due };
    }
}

/// When the reports of one client are due.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Schedule([Timer; ReportKind::ALL.len()]);

impl Default for Schedule {
    fn default() -> Self {
        Self([Timer::OFF; ReportKind::ALL.len()])
    }
}

impl Schedule {
    /// Sets the frequencies that the client's own registers hold.
    pub(crate) fn set(&mut self, now: Instant, own: &OwnRegisters) {
        for (timer, stream) in self.0.iter_mut().zip(ReportKind::ALL) {
            timer.set(now, own.frequency(stream).into());
        }
    }

    /// Is a report of the stream due? If so, advances to the next one. A report may come early by [`EARLY`], so that the mean
    /// frequency is kept.
    pub(crate) fn take_due(&mut self, now: Instant, stream: ReportKind) -> bool {
        let Some(timer) = self.0.get_mut(stream.index()) else { return false };
        let is_due = timer.period != Duration::ZERO && timer.due <= now + EARLY;
        if is_due {
            timer.advance(now);
        }
        is_due
    }
}

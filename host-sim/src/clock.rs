//! The simulator's clock: the clock of the computer, less the time for which the process was stopped.

use std::time::Instant as SystemInstant;

use protocol_core::time::{Duration, Instant};
use rustix::event::Timespec;

/// A longer pause between calls means that the process was stopped (Ctrl-Z, a debugger): only this much time passes for the arm.
/// After a shorter pause, on a busy computer, the arm catches up.
const LONGEST_ABSENCE: Duration = Duration::from_millis(1_000);

/// A clock that counts microseconds since its creation.
#[derive(Debug)]
pub struct RealClock {
    start: SystemInstant,
    last: Instant,
    stopped: Duration,
}

impl Default for RealClock {
    fn default() -> Self {
        Self { start: SystemInstant::now(), last: Instant::ZERO, stopped: Duration::ZERO }
    }
}

impl RealClock {
    /// The time now. Must be called at least once a second: a longer pause counts as a stop.
    pub fn now(&mut self) -> Instant {
        let micros = u64::try_from(self.start.elapsed().as_micros()).unwrap_or(u64::MAX);
        self.at(Instant::from_micros(micros))
    }

    fn at(&mut self, elapsed: Instant) -> Instant {
        let now = Instant::from_micros((elapsed - (Instant::ZERO + self.stopped)).as_micros());
        let absence = now - self.last;
        if absence > LONGEST_ABSENCE {
            let excess = absence.as_micros() - LONGEST_ABSENCE.as_micros();
            self.stopped = Duration::from_micros(self.stopped.as_micros() + excess);
            self.last = self.last + LONGEST_ABSENCE;
        } else {
            self.last = now;
        }
        self.last
    }
}

/// The time from `now` to `deadline`, for calls of the operating system; at most half a second, so that a sleep is no stop.
#[must_use]
pub fn sleep_until(now: Instant, deadline: Instant) -> Timespec {
    let micros = (deadline - now).as_micros().min(LONGEST_ABSENCE.as_micros() / 2);
    let nanos = i64::try_from(micros * 1_000).unwrap_or(0);
    Timespec { tv_sec: 0, tv_nsec: nanos }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clock_catches_up_after_a_delay_but_not_after_a_stop() {
        let mut clock = RealClock::default();
        assert_eq!(clock.at(Instant::from_micros(900_000)).as_micros(), 900_000);
        assert_eq!(clock.at(Instant::from_micros(60_000_000)).as_micros(), 1_900_000);
        assert_eq!(clock.at(Instant::from_micros(60_000_010)).as_micros(), 1_900_010);
        assert_eq!(clock.at(Instant::from_micros(60_500_000)).as_micros(), 2_400_000);
    }

    #[test]
    fn a_sleep_does_not_count_as_a_stop() {
        let sleep = sleep_until(Instant::ZERO, Instant::FAR_FUTURE);
        assert_eq!((sleep.tv_sec, sleep.tv_nsec), (0, 500_000_000));
        assert_eq!(sleep_until(Instant::from_micros(5), Instant::from_micros(9)).tv_nsec, 4_000);
        assert_eq!(sleep_until(Instant::from_micros(9), Instant::from_micros(5)).tv_nsec, 0);
    }
}

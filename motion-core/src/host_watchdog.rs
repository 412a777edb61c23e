//! The watchdog of the host link: acts once in each silence of the host ([D24](protocol_core::decisions#d24)).
//!
//! This file does not know what the watchdog does.

use protocol_core::time::{Duration, Instant};

/// The watchdog of the host link.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct HostWatchdog {
    /// The longest silence, in units of 10 ms; zero is off.
    timeout: u8,
    /// When the watchdog acts unless a frame comes before.
    due: Instant,
}

impl HostWatchdog {
    /// A watchdog that is switched off.
    pub(crate) const OFF: Self = Self { timeout: 0, due: Instant::FAR_FUTURE };

    /// Sets the longest silence, 0 to 255 times 10 ms, and begins to count at `now`. 0 switches the watchdog off.
    pub(crate) fn set(&mut self, now: Instant, value: u8) {
        self.timeout = value;
        self.due = Instant::FAR_FUTURE;
        self.heard(now);
    }

    /// Ends a silence, because a well-formed frame had its turn at `now`.
    pub(crate) fn heard(&mut self, now: Instant) {
        if self.timeout > 0 {
            self.due = now + Duration::from_millis(u64::from(self.timeout) * 10);
        }
    }

    /// Returns whether the watchdog has to act at `now`, once in each silence.
    pub(crate) fn poll(&mut self, now: Instant) -> bool {
        let acts = self.due <= now;
        if acts {
            self.due = Instant::FAR_FUTURE;
        }
        acts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_ms(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    #[test]
    fn d24_the_watchdog_acts_once_in_each_silence() {
        let mut watchdog = HostWatchdog::OFF;
        watchdog.heard(at_ms(1));
        assert!(!watchdog.poll(at_ms(1_000_000)), "it is off");
        watchdog.set(at_ms(5), 20);
        assert!(!watchdog.poll(at_ms(204)));
        watchdog.heard(at_ms(204));
        assert!(!watchdog.poll(at_ms(403)) && watchdog.poll(at_ms(404)) && !watchdog.poll(at_ms(10_000)));
        watchdog.heard(at_ms(10_000));
        assert!(watchdog.poll(at_ms(10_200)));
        watchdog.heard(at_ms(20_000));
        watchdog.set(at_ms(20_000), 0);
        assert!(!watchdog.poll(at_ms(1_000_000)));
    }
}

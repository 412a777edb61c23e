//! The watchdog of the arm ([D24](protocol_core::decisions#d24)) for the client that set it: requests of other clients must
//! not hide its silence.
//!
//! ```text
//!   Off ── register 186 written ──▶ Watching ── the client is silent ──▶ Acted
//!                                      ▲                                   │
//!                                      └────── the client sends again ─────┘
//! ```
//!
//! The arm's watchdog sees the frames of all clients, and the samples. So once the client has been silent for the time of its
//! watchdog, the hub holds the arm or damps its motors. A client that has left is silent, too. The arm's own watchdog acts if the
//! server fails. It is set to [`LEAST_OF_ARM`] at least. A shorter one could act in a short pause of a busy server: joints
//! that still brake after a stop would then hold at their set-points, not where the stop was confirmed. A read of register 186
//! returns the value that the client wrote.

use protocol_core::registers::map::{HOST_WATCHDOG, WATCHDOG_ACTION};
use protocol_core::time::{Duration, Instant};

use super::client_id::ClientId;
use super::own_registers::byte_at;

/// One step of register 186.
const STEP: Duration = Duration::from_millis(10);

/// The least time of the arm's own watchdog, in steps of 10 ms. Joints that brake have come to rest by then.
const LEAST_OF_ARM: u8 = 20;

/// The action of a watchdog (register 187).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WatchdogAction {
    /// Every joint holds.
    Hold,
    /// The motors go to damping (motor state 0).
    Damp,
}

/// The watchdog that a client has set.
#[derive(Clone, Copy, Debug)]
struct Watched {
    client: ClientId,
    /// Register 186 as the client wrote it.
    steps: u8,
    action: WatchdogAction,
    /// When the last request of the client was sent.
    heard: Instant,
    is_silent: bool,
}

/// Follows the client that set the watchdog last.
#[derive(Debug, Default)]
pub(crate) struct ClientWatchdog {
    watched: Option<Watched>,
    /// It acted since register 186 was written (fault bit 6).
    has_acted: bool,
}

impl ClientWatchdog {
    /// The arm accepted a write of a client by function 06. `damps`: register 187 chooses damping after this write.
    pub(crate) fn wrote(&mut self, now: Instant, client: ClientId, damps: bool, address: u8, values: &[u8]) {
        let value = |register: u8| values.get(usize::from(register.checked_sub(address)?)).copied();
        let action = if damps { WatchdogAction::Damp } else { WatchdogAction::Hold };
        if let Some(watched) = self.watched.as_mut().filter(|_| value(WATCHDOG_ACTION.address).is_some()) {
            watched.action = action;
        }
        if let Some(steps) = value(HOST_WATCHDOG.address) {
            self.set(now, client, steps, action);
        }
    }

    /// A client wrote register 186, in steps of 10 ms; 0 switches the watchdog off.
    fn set(&mut self, now: Instant, client: ClientId, steps: u8, action: WatchdogAction) {
        let watched = Watched { client, steps, action, heard: now, is_silent: false };
        *self = Self { watched: (steps > 0).then_some(watched), has_acted: false };
    }

    /// Forgets the watchdog, because the arm may have restarted.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }

    /// A request of a client was sent.
    pub(crate) fn sent_request(&mut self, now: Instant, client: ClientId) {
        if let Some(watched) = self.watched.as_mut().filter(|watched| watched.client == client) {
            (watched.heard, watched.is_silent) = (now, false);
        }
    }

    /// The action that is due now: once in each silence of the client.
    pub(crate) fn poll(&mut self, now: Instant) -> Option<WatchdogAction> {
        let due = self.due();
        let watched = self.watched.as_mut().filter(|_| due <= now)?;
        watched.is_silent = true;
        self.has_acted = true;
        Some(watched.action)
    }

    /// When the action is due; [`Instant::FAR_FUTURE`] without a watchdog, or if it has acted in this silence.
    pub(crate) fn due(&self) -> Instant {
        let watched = self.watched.filter(|watched| !watched.is_silent);
        watched.map_or(Instant::FAR_FUTURE, |watched| watched.heard + watched.timeout())
    }

    /// Replaces register 186 in a reply to a client, from register `address` on.
    pub(crate) fn overlay(&self, address: u8, values: &mut [u8]) {
        if let (Some(watched), Some(steps)) = (self.watched, byte_at(address, values, &HOST_WATCHDOG)) {
            *steps = watched.steps;
        }
    }

    /// Replaces register 186 in a write to the arm.
    pub(crate) fn for_arm(address: u8, values: &mut [u8]) {
        if let Some(steps) = byte_at(address, values, &HOST_WATCHDOG).filter(|steps| **steps > 0) {
            *steps = LEAST_OF_ARM.max(*steps);
        }
    }

    /// Did it act since register 186 was written?
    pub(crate) const fn has_acted(&self) -> bool {
        self.has_acted
    }
}

impl Watched {
    fn timeout(&self) -> Duration {
        Duration::from_micros(STEP.as_micros() * u64::from(self.steps))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_ms(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    #[test]
    fn d24_it_acts_once_in_each_silence_of_the_client() {
        let (one, mut watchdog) = (ClientId::default(), ClientWatchdog::default());
        assert_eq!(watchdog.poll(at_ms(9_000)), None, "it is off");
        watchdog.wrote(at_ms(0), one, false, 186, &[20]);
        watchdog.sent_request(at_ms(100), one);
        watchdog.sent_request(at_ms(250), one.next());
        assert_eq!(watchdog.poll(at_ms(299)), None);
        assert_eq!((watchdog.due(), watchdog.has_acted()), (at_ms(300), false));
        assert_eq!(watchdog.poll(at_ms(300)), Some(WatchdogAction::Hold));
        assert_eq!(watchdog.poll(at_ms(9_000)), None, "once");
        assert!(watchdog.has_acted());
        watchdog.sent_request(at_ms(9_000), one);
        watchdog.wrote(at_ms(9_100), one.next(), true, 187, &[1]);
        assert_eq!(watchdog.poll(at_ms(9_199)), None);
        assert_eq!(watchdog.poll(at_ms(9_200)), Some(WatchdogAction::Damp));
        watchdog.wrote(at_ms(9_201), one, true, 186, &[20]);
        assert!(!watchdog.has_acted());
    }

    #[test]
    fn a_watchdog_that_is_switched_off_does_nothing() {
        let (one, mut watchdog) = (ClientId::default(), ClientWatchdog::default());
        watchdog.wrote(at_ms(0), one, false, 186, &[1]);
        watchdog.wrote(at_ms(1), one.next(), false, 186, &[0]);
        assert_eq!(watchdog.poll(at_ms(9_000)), None);
        watchdog.wrote(at_ms(0), one, false, 186, &[1]);
        watchdog.forget();
        assert_eq!(watchdog.poll(at_ms(9_000)), None);
    }
}

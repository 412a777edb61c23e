//! The watchdog of the arm (D24) for the client that set it: requests of other clients must not hide its silence.
//!
//! ```text
//!   Off ── register 186 written ──▶ Watching ── the client is silent ──▶ Quiet ── the arm has acted ──▶ Acted
//!                                      ▲                                                                 │
//!                                      └───────────────── the client sends again ────────────────────────┘
//! ```
//!
//! The arm counts the frames of all clients, and the samples. So once the client has been silent for the time of its
//! watchdog, the hub sends nothing until the arm has noticed the silence and acted by itself. A client that has left
//! is silent, too.

use protocol_core::registers::map::HOST_WATCHDOG;
use protocol_core::time::{Duration, Instant};

use super::client_id::ClientId;

/// One step of register 186.
const STEP: Duration = Duration::from_millis(10);
/// The arm acts within 10 ms of its time, and a USB adapter may hold frames back.
const MARGIN: Duration = Duration::from_millis(50);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Watching,
    /// Nothing may be sent before this time.
    Quiet(Instant),
    Acted,
}

/// The watchdog that a client has set.
#[derive(Clone, Copy, Debug)]
struct Watched {
    client: ClientId,
    timeout: Duration,
    /// When the last request of the client was sent.
    heard: Instant,
    state: State,
}

/// Follows the client that set the watchdog last.
#[derive(Debug, Default)]
pub(crate) struct ClientWatchdog(Option<Watched>);

impl ClientWatchdog {
    /// The arm accepted a write of a client, of function 06.
    pub(crate) fn wrote(&mut self, now: Instant, client: ClientId, address: u8, values: &[u8]) {
        let place = HOST_WATCHDOG.address.checked_sub(address);
        if let Some(&steps) = place.and_then(|place| values.get(usize::from(place))) {
            self.set(now, client, steps);
        }
    }

    /// A client wrote register 186, in steps of 10 ms; 0 switches the watchdog off.
    fn set(&mut self, now: Instant, client: ClientId, steps: u8) {
        let timeout = Duration::from_micros(STEP.as_micros() * u64::from(steps));
        let watched = Watched { client, timeout, heard: now, state: State::Watching };
        self.0 = (steps > 0).then_some(watched);
    }

    /// The arm may have restarted.
    pub(crate) fn forget(&mut self) {
        self.0 = None;
    }

    /// A request of a client was sent.
    pub(crate) fn sent_request(&mut self, now: Instant, client: ClientId) {
        if let Some(watched) = self.0.as_mut().filter(|watched| watched.client == client) {
            (watched.heard, watched.state) = (now, State::Watching);
        }
    }

    /// Begins and ends the time without frames. `idle_since` is when the last byte left on the line.
    pub(crate) fn poll(&mut self, now: Instant, idle_since: Instant) {
        let Some(watched) = &mut self.0 else { return };
        if watched.state == State::Watching && now >= watched.heard + watched.timeout {
            watched.state = State::Quiet(idle_since + watched.timeout + MARGIN);
        }
        if matches!(watched.state, State::Quiet(until) if until <= now) {
            watched.state = State::Acted;
        }
    }

    /// When frames may be sent again.
    pub(crate) fn quiet_until(&self) -> Instant {
        match self.0 {
            Some(Watched { state: State::Quiet(until), .. }) => until,
            _ => Instant::ZERO,
        }
    }

    /// May frames be sent?
    pub(crate) fn allows(&self, now: Instant) -> bool {
        self.quiet_until() <= now
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_ms(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    fn quiet(watchdog: &mut ClientWatchdog, now: Instant, idle_since: Instant) -> Option<Instant> {
        watchdog.poll(now, idle_since);
        (!watchdog.allows(now)).then(|| watchdog.quiet_until())
    }

    #[test]
    fn d24_the_line_is_quiet_once_in_each_silence_of_the_client() {
        let (one, mut watchdog) = (ClientId::default(), ClientWatchdog::default());
        assert_eq!(quiet(&mut watchdog, at_ms(9_000), at_ms(0)), None, "it is off");
        watchdog.set(at_ms(0), one, 20);
        watchdog.sent_request(at_ms(100), one);
        watchdog.sent_request(at_ms(250), one.next());
        assert_eq!(quiet(&mut watchdog, at_ms(299), at_ms(298)), None);
        assert_eq!(quiet(&mut watchdog, at_ms(300), at_ms(299)), Some(at_ms(549)));
        assert_eq!(quiet(&mut watchdog, at_ms(549), at_ms(299)), None, "the arm has acted");
        assert_eq!(quiet(&mut watchdog, at_ms(9_000), at_ms(8_999)), None, "once");
        watchdog.sent_request(at_ms(9_000), one);
        assert_eq!(quiet(&mut watchdog, at_ms(9_199), at_ms(9_199)), None);
        assert_eq!(
            quiet(&mut watchdog, at_ms(9_300), at_ms(9_000)),
            None,
            "on an idle line the arm acts by itself"
        );
    }

    #[test]
    fn a_watchdog_that_is_switched_off_stops_nothing() {
        let (one, mut watchdog) = (ClientId::default(), ClientWatchdog::default());
        watchdog.set(at_ms(0), one, 1);
        watchdog.set(at_ms(1), one.next(), 0);
        assert_eq!(quiet(&mut watchdog, at_ms(9_000), at_ms(8_999)), None);
        watchdog.set(at_ms(0), one, 1);
        watchdog.forget();
        assert_eq!(quiet(&mut watchdog, at_ms(9_000), at_ms(8_999)), None);
    }
}

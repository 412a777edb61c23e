//! Detects what ends a park or a program of blocks although the arm has no fault: a stop by another client of the server, and a
//! pause of the page.
//!
//! A server counts the stops in its registers. Parks and programs decide when to check.

use std::time::Duration;

use host_link::sharing::SharingState;
use protocol_core::time::Instant;
use sevenbot::Snapshot;

use crate::movement::PlayFailure;
use crate::stop::since_start;

/// A longer pause of the page ends a park or a program: the arm may have stopped meanwhile, and a person beside it may not expect
/// that it moves again.
const LONGEST_PAUSE: Duration = Duration::from_secs(1);
/// After a write, wait until this many rounds are complete: the reads of the current round may be older than the write, the
/// reads of the next round are not.
pub(crate) const ROUNDS_TO_KNOW: u64 = 2;

/// Watches for interruptions of one park or program.
#[derive(Debug, Default)]
pub(crate) struct Interruptions {
    last_poll: Option<Instant>,
    /// The server's count of stops at the first check; `None` before it, `Some(None)` without a server.
    stops: Option<Option<u8>>,
}

impl Interruptions {
    /// Fails if the last call was more than [`LONGEST_PAUSE`] ago.
    pub(crate) fn check_pause(&mut self, now: Instant) -> Result<(), PlayFailure> {
        let last = self.last_poll.replace(now).unwrap_or(now);
        let pause = since_start(now).saturating_sub(since_start(last));
        if pause > LONGEST_PAUSE { Err(PlayFailure::Paused(pause)) } else { Ok(()) }
    }

    /// Fails if another client has stopped the arm: the server reports that it drops the targets of this client (`is_stopped`),
    /// or its count of stops has changed since the first call.
    pub(crate) fn check_stops(&mut self, registers: &Snapshot) -> Result<(), PlayFailure> {
        let sharing = SharingState::of(registers);
        let stops = sharing.map(|sharing| sharing.stops);
        let is_stopped = sharing.is_some_and(|sharing| sharing.is_stopped);
        if is_stopped || *self.stops.get_or_insert(stops) != stops {
            return Err(PlayFailure::StoppedByAnother);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_that_a_server_counts_is_one_since_the_first_look() {
        let shared = |stops, flags| {
            let mut registers = Snapshot { address: 0, values: vec![0; 256] };
            registers.put(&Snapshot { address: 232, values: vec![1, 2, 0, stops, flags, 0, 0, 0] });
            registers
        };
        let mut interruptions = Interruptions::default();
        assert_eq!(interruptions.check_stops(&shared(7, 0)), Ok(()));
        assert_eq!(interruptions.check_stops(&shared(7, 0)), Ok(()));
        let stopped = Err(PlayFailure::StoppedByAnother);
        assert_eq!(interruptions.check_stops(&shared(8, 0)), stopped);
        assert_eq!(
            Interruptions::default().check_stops(&shared(7, 1)),
            stopped,
            "the server drops its targets"
        );
    }

    #[test]
    fn a_pause_of_more_than_a_second_is_one() {
        let mut interruptions = Interruptions::default();
        for millis in [5_000, 5_900, 6_900] {
            assert_eq!(interruptions.check_pause(Instant::from_micros(millis * 1_000)), Ok(()));
        }
        let paused = interruptions.check_pause(Instant::from_micros(8_000_000));
        assert_eq!(paused, Err(PlayFailure::Paused(Duration::from_millis(1_100))));
    }
}

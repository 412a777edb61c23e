//! What ends a movement of the page although the arm is well: a stop of another program, and a pause of the page.
//!
//! It reads the count of stops in the registers of a server. The shell of each movement says when.

use std::time::Duration;

use host_link::sharing::SharingState;
use protocol_core::time::Instant;
use sevenbot::Snapshot;

use crate::movement::PlayFailure;
use crate::stop::since_start;

/// After a longer pause of the page a movement is over: a person may rely on an arm that has stopped.
const LONGEST_PAUSE: Duration = Duration::from_secs(1);
/// The reads of the present round may be older than a write, those of the next one are not.
pub(crate) const ROUNDS_TO_KNOW: u64 = 2;

/// Watches for interruptions from the start of a movement on.
#[derive(Debug, Default)]
pub(crate) struct Interruptions {
    last_poll: Option<Instant>,
    /// The stops of all programs before the movement, as a server counts them; the inner `None` without a server.
    stops: Option<Option<u8>>,
}

impl Interruptions {
    /// Fails if the page did not call this for too long.
    pub(crate) fn check_pause(&mut self, now: Instant) -> Result<(), PlayFailure> {
        let last = self.last_poll.replace(now).unwrap_or(now);
        let pause = since_start(now).saturating_sub(since_start(last));
        if pause > LONGEST_PAUSE { Err(PlayFailure::Paused(pause)) } else { Ok(()) }
    }

    /// Fails if another program has stopped the arm since the first call. A server drops the targets of a program that streamed; one
    /// that waits for its joints sees the count of stops.
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

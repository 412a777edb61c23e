//! When to save settings. Programming a word stalls the core for 16 to 100 microseconds, and at 1 Mbaud a byte that is not
//! read within 10 microseconds is lost. So a save waits until both lines receive nothing and the servo bus sends nothing, with a
//! timeout. Bytes that are sent to the host meanwhile do not count.

/// A wait for a pause: nothing is received, and nothing is sent to the servos.
#[derive(Clone, Copy, Debug)]
pub struct PauseWait {
    quiet_micros: u32,
    timeout_micros: u32,
    start: u32,
    quiet_since: u32,
    received: usize,
}

impl PauseWait {
    /// Starts a wait. It ends when no byte was received, and none sent to the servos, for `quiet_micros`, or after
    /// `timeout_micros`. `now` is the value of a microsecond counter that wraps.
    #[must_use]
    pub const fn new(now: u32, quiet_micros: u32, timeout_micros: u32) -> Self {
        Self { quiet_micros, timeout_micros, start: now, quiet_since: now, received: usize::MAX }
    }

    /// True if the wait is over at `now`. `received` is the number of bytes in the receive queues, which must not be read
    /// during the wait. While the servo bus `is_sending`, the quiet time begins anew, because an answer may follow.
    pub const fn is_over(&mut self, now: u32, received: usize, is_sending: bool) -> bool {
        if received != self.received || is_sending {
            self.received = received;
            self.quiet_since = now;
        }
        now.wrapping_sub(self.quiet_since) >= self.quiet_micros
            || now.wrapping_sub(self.start) >= self.timeout_micros
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How long the wait takes, in microseconds. `received` and `is_sending` give the state at a time after its start.
    fn ends(received: impl Fn(u32) -> usize, is_sending: impl Fn(u32) -> bool) -> u32 {
        let start = u32::MAX - 100;
        let mut pause = PauseWait::new(start, 1_000, 5_000);
        let is_over = |at: &u32| pause.is_over(start.wrapping_add(*at), received(*at), is_sending(*at));
        (0..10_000).find(is_over).unwrap()
    }

    #[test]
    fn the_wait_on_idle_lines_takes_the_quiet_time() {
        assert_eq!(ends(|_| 0, |_| false), 1_000);
        assert_eq!(ends(|_| 7, |_| false), 1_000, "bytes that came before do not count");
    }

    #[test]
    fn the_wait_includes_the_answer_to_a_question() {
        // The question ends at 80 us. The answer arrives from 580 us to 790 us.
        let answer = |at: u32| usize::try_from(at.saturating_sub(580).min(210) / 10).unwrap();
        assert_eq!(ends(answer, |at| at < 80), 1_790);
    }

    #[test]
    fn the_wait_on_a_busy_line_ends_with_the_timeout() {
        assert_eq!(ends(|at| usize::try_from(at / 10).unwrap(), |_| false), 5_000);
        assert_eq!(ends(|_| 0, |_| true), 5_000);
    }
}

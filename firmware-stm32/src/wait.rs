//! Waiting for a hardware flag with a limit.

/// Polls `flag` up to `polls` times. Returns true as soon as it is set, false when the limit is reached.
pub fn wait_for(polls: u32, flag: impl Fn() -> bool) -> bool {
    (0..polls).any(|_| flag())
}

/// Polls `flag` for up to `limit_micros`. `micros` reads a counter of microseconds that wraps. Returns true as soon as the
/// flag is set, false when the time is over.
pub fn wait_within(limit_micros: u32, micros: impl Fn() -> u32, flag: impl Fn() -> bool) -> bool {
    let start = micros();
    loop {
        // Read the time before the flag: so the flag is polled once more, even if an interrupt took longer than the limit.
        let is_over = micros().wrapping_sub(start) >= limit_micros;
        if flag() {
            return true;
        }
        if is_over {
            return false;
        }
    }
}

#[cfg(test)]
mod tests {
    use core::cell::Cell;

    use super::*;

    #[test]
    fn a_flag_is_polled_until_it_is_set() {
        let polls = Cell::new(0);
        let flag = || polls.replace(polls.get() + 1) == 2;
        assert!(wait_for(10, flag));
        assert_eq!(polls.get(), 3);
    }

    #[test]
    fn a_flag_is_polled_for_a_time_that_does_not_depend_on_the_core() {
        for step in [1, 7, 1_000, 100_000] {
            let now = Cell::new(u32::MAX - 10_000);
            let start = now.get();
            let tick = || now.replace(now.get().wrapping_add(step));
            let passed = || now.get().wrapping_sub(start);
            assert!(!wait_within(48_000, tick, || false));
            assert!((48_000..=48_000 + 3 * step).contains(&passed()), "{step}: {}", passed());
        }
    }

    #[test]
    fn a_flag_counts_although_the_time_is_over() {
        let now = Cell::new(0);
        assert!(wait_within(10, || now.replace(now.get() + 100), || now.get() > 150));
        assert!(wait_within(0, || 7, || true));
    }

    #[test]
    fn a_flag_that_is_never_set_is_polled_up_to_the_limit() {
        let polls = Cell::new(0);
        let flag = || polls.replace(polls.get() + 1) > 10;
        assert!(!wait_for(10, flag));
        assert_eq!(polls.get(), 10);
    }
}

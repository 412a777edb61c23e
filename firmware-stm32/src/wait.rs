//! Waiting for a hardware flag with a limit.

/// Polls `flag` up to `polls` times. Returns true as soon as it is set, false when the limit is reached.
pub fn wait_for(polls: u32, flag: impl Fn() -> bool) -> bool {
    (0..polls).any(|_| flag())
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
    fn a_flag_that_is_never_set_is_polled_up_to_the_limit() {
        let polls = Cell::new(0);
        let flag = || polls.replace(polls.get() + 1) > 10;
        assert!(!wait_for(10, flag));
        assert_eq!(polls.get(), 10);
    }
}

//! The LED pattern of the self-test image: the number of flashes tells the last step, their pace tells its result.
//!
//! ```text
//!   step 3, passed   ▇▇__▇▇__▇▇__________▇▇__▇▇__▇▇__________      400 ms per flash
//!   step 3, failed   ▇_▇_▇_______________▇_▇_▇_______________      100 ms per flash
//! ```

/// Period of a flash after a step that passed.
const SLOW_MICROS: u64 = 400_000;
/// Period of a flash after a step that failed.
const FAST_MICROS: u64 = 100_000;
/// Period of the whole pattern.
const PERIOD_MICROS: u64 = 3_000_000;

/// True if the LED is on at this time, in microseconds.
#[must_use]
pub const fn is_on(step: u8, passed: bool, micros: u64) -> bool {
    let flash = if passed { SLOW_MICROS } else { FAST_MICROS };
    let at = micros % PERIOD_MICROS;
    at / flash < step as u64 && at % flash < flash / 2
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The times at which the LED switches on within a period, in milliseconds.
    fn flashes(step: u8, passed: bool) -> Vec<u64> {
        let is_on = |millis: &u64| is_on(step, passed, 3_000_000 + millis * 1_000);
        let goes_on = |millis: &u64| is_on(millis) && (*millis == 0 || !is_on(&(millis - 1)));
        (0..3_000).filter(goes_on).collect()
    }

    #[test]
    fn the_step_sets_the_number_of_flashes_and_the_result_sets_their_pace() {
        assert_eq!(flashes(1, true), [0]);
        assert_eq!(flashes(4, true), [0, 400, 800, 1_200]);
        assert_eq!(flashes(3, false), [0, 100, 200]);
    }

    #[test]
    fn a_pause_separates_two_patterns() {
        for step in 1..=5 {
            assert!(flashes(step, true).iter().all(|at| *at < 2_000));
        }
    }
}

//! Waits shorter than the tick that wakes the core, such as the guard time of the servo bus. The system timer gets a
//! shorter period for them, so that they are not rounded up to a millisecond.

use protocol_core::time::Duration;

/// Period of the tick, in microseconds.
pub const TICK_MICROS: u32 = 1_000;

/// The period of the system timer for `wait`, in cycles; a microsecond has `per_micro` cycles. `None` if the usual tick
/// comes within `wait`.
#[must_use]
pub const fn cycles(wait: Duration, per_micro: u32) -> Option<u32> {
    if wait.as_micros() >= TICK_MICROS as u64 {
        return None;
    }
    let [low, high, ..] = wait.as_micros().to_le_bytes();
    Some(u16::from_le_bytes([low, high]) as u32 * per_micro)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock_rates::ClockSource;

    #[test]
    fn a_guard_time_is_not_rounded_up_to_the_tick() {
        for source in
            [ClockSource::Crystal, ClockSource::InternalPll, ClockSource::Internal, ClockSource::Emulated]
        {
            let core_hz = source.rates().core;
            for micros in [0, 1, 50, 100, 999] {
                let cycles = cycles(Duration::from_micros(micros), core_hz / 1_000_000).unwrap();
                assert_eq!(u64::from(cycles) * 1_000_000 / u64::from(core_hz), micros, "{source:?}");
            }
        }
    }

    #[test]
    fn a_wait_of_a_tick_or_longer_keeps_the_usual_period() {
        for micros in [1_000, 1_001, 65_536, 100_000_000, u64::MAX] {
            assert_eq!(cycles(Duration::from_micros(micros), 168), None);
        }
    }
}

//! Time as a number somebody hands in.
//!
//! Nothing in the cores reads a clock. A shell says what time it is with every call, so a test can
//! live through a year in a second and a run can be repeated exactly. What the zero of time is, only
//! the shell knows.

use core::ops::{Add, Sub};

/// A point in time, in microseconds since a start that only the shell knows.
///
/// 64 bits last for 584 000 years, so arithmetic saturates and nobody has to think about a wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Instant(u64);

/// A length of time, in microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Duration(u64);

impl Instant {
    /// The shell's start of time.
    pub const ZERO: Self = Self(0);
    /// Later than anything that happens: "nothing is planned".
    pub const FAR_FUTURE: Self = Self(u64::MAX);

    /// The point `micros` microseconds after the start.
    #[must_use]
    pub const fn from_micros(micros: u64) -> Self {
        Self(micros)
    }

    /// Microseconds since the start.
    #[must_use]
    pub const fn as_micros(self) -> u64 {
        self.0
    }
}

impl Duration {
    /// No time at all.
    pub const ZERO: Self = Self(0);

    /// A duration of `micros` microseconds.
    #[must_use]
    pub const fn from_micros(micros: u64) -> Self {
        Self(micros)
    }

    /// A duration of `millis` milliseconds.
    #[must_use]
    pub const fn from_millis(millis: u64) -> Self {
        Self(millis.saturating_mul(1_000))
    }

    /// The duration in microseconds.
    #[must_use]
    pub const fn as_micros(self) -> u64 {
        self.0
    }
}

impl Add<Duration> for Instant {
    type Output = Self;

    fn add(self, later: Duration) -> Self {
        Self(self.0.saturating_add(later.0))
    }
}

/// The time from `earlier` to `self`; zero if it is the other way round.
impl Sub for Instant {
    type Output = Duration;

    fn sub(self, earlier: Self) -> Duration {
        Duration(self.0.saturating_sub(earlier.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arithmetic_saturates_instead_of_wrapping() {
        let late = Instant::from_micros(5) + Duration::from_millis(1);
        assert_eq!(late.as_micros(), 1_005);
        assert_eq!(Instant::ZERO - late, Duration::ZERO);
        assert_eq!((late - Instant::ZERO).as_micros(), 1_005);
        assert_eq!(late - Instant::ZERO, Duration::from_micros(1_005));
        assert_eq!(Instant::FAR_FUTURE + Duration::from_millis(1), Instant::FAR_FUTURE);
    }
}

//! Time as an argument.
//!
//! The cores read no clock. The shell passes the time with every call, so a test can simulate hours in seconds and
//! repeat a run exactly. The shell defines the zero of time.

use core::ops::{Add, Sub};

/// A point in time, in microseconds since a start that the shell defines.
///
/// 64 bits last for 584 000 years. Arithmetic saturates and does not wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Instant(u64);

/// A length of time, in microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Duration(u64);

impl Instant {
    /// The start of the clock, from which instants count.
    pub const ZERO: Self = Self(0);
    /// Later than every event: a deadline that never comes.
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
    /// No time; also the time since an instant that is still ahead.
    pub const ZERO: Self = Self(0);

    /// From microseconds, the resolution of a duration.
    #[must_use]
    pub const fn from_micros(micros: u64) -> Self {
        Self(micros)
    }

    /// From milliseconds. The product saturates at `u64::MAX` microseconds.
    #[must_use]
    pub const fn from_millis(millis: u64) -> Self {
        Self(millis.saturating_mul(1_000))
    }

    /// The duration in microseconds, without rounding.
    #[must_use]
    pub const fn as_micros(self) -> u64 {
        self.0
    }
}

/// Rounds up to whole microseconds, so that a wait for this time is never too short.
impl From<core::time::Duration> for Duration {
    fn from(time: core::time::Duration) -> Self {
        Self(time.as_nanos().div_ceil(1_000).try_into().unwrap_or(u64::MAX))
    }
}

impl Add<Duration> for Instant {
    type Output = Self;

    fn add(self, later: Duration) -> Self {
        Self(self.0.saturating_add(later.0))
    }
}

/// The time from `earlier` to `self`; zero if `earlier` is later than `self`.
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

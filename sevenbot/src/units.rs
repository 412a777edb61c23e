//! Angle, speed and duration with their units in the type, in the registers' steps (docs/protocol.md, D10, D11, D18).

use std::fmt;
use std::time::Duration;

use protocol_core::registers::map::SPEED;

/// Angle of a joint in whole degrees, 0 to 180, as in the registers ([D18](protocol_core::decisions#d18)).
///
/// ```
/// use sevenbot::Angle;
///
/// assert_eq!(Angle::from_degrees(90).map(|angle| angle.to_string()).as_deref(), Some("90°"));
/// assert_eq!(Angle::from_degrees(181), None);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Angle(u8);

impl Angle {
    /// The largest angle, in degrees.
    pub const MAX_DEGREES: u8 = 180;

    /// `None` above 180 degrees.
    #[must_use]
    pub const fn from_degrees(degrees: u8) -> Option<Self> {
        if degrees <= Self::MAX_DEGREES { Some(Self(degrees)) } else { None }
    }

    /// From a register. A value above 180 counts as 180.
    #[must_use]
    pub const fn from_register(byte: u8) -> Self {
        if byte <= Self::MAX_DEGREES { Self(byte) } else { Self(Self::MAX_DEGREES) }
    }

    /// The angle in degrees, 0 to 180.
    #[must_use]
    pub const fn degrees(self) -> u8 {
        self.0
    }
}

impl fmt::Display for Angle {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}°", self.0)
    }
}

/// Speed of a joint's moves, in the register's steps of 1.9 degrees/s ([D10](protocol_core::decisions#d10)).
///
/// ```
/// use sevenbot::Speed;
///
/// assert_eq!(Speed::from_steps(10).map(Speed::degrees_per_second), Some(19.0));
/// assert_eq!(Speed::MAXIMUM.degrees_per_second(), 372.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Speed(u8);

impl Speed {
    /// The motor's maximum, 62 rpm. With it [`MoveTime`] applies ([D11](protocol_core::decisions#d11)).
    pub const MAXIMUM: Self = Self(0);
    /// The speed of every joint after power-up: 114 degrees/s.
    pub const DEFAULT: Self = Self(SPEED.default_at(SPEED.address));
    /// 62 rpm in degrees/s.
    const MAXIMUM_DEGREES_PER_SECOND: f64 = 372.0;
    /// One step in degrees/s.
    const STEP_DEGREES_PER_SECOND: f64 = 1.9;

    /// `steps` of 1.9 degrees/s, 1 to 100; 0 is the maximum. `None` above 100.
    #[must_use]
    pub const fn from_steps(steps: u8) -> Option<Self> {
        if steps <= 100 { Some(Self(steps)) } else { None }
    }

    /// The largest step that is not faster than this many degrees/s. `None` outside 1.9 to 190.
    #[must_use]
    pub fn at_most(degrees_per_second: f64) -> Option<Self> {
        // Tolerates rounding errors, so that the computed speed of a step finds this step.
        const ROUNDING: f64 = 0.05;
        let mut speeds = (1..=100).map(Self);
        let found = speeds.rfind(|speed| speed.degrees_per_second() <= degrees_per_second + ROUNDING);
        found.filter(|_| degrees_per_second <= 190.0 + ROUNDING)
    }

    /// The register's value: steps of 1.9 degrees/s, or 0 for the maximum.
    #[must_use]
    pub const fn steps(self) -> u8 {
        self.0
    }

    /// The speed in degrees/s: 1.9 to 190, or 372 for the maximum.
    #[must_use]
    pub fn degrees_per_second(self) -> f64 {
        match self.0 {
            0 => Self::MAXIMUM_DEGREES_PER_SECOND,
            steps => f64::from(steps) * Self::STEP_DEGREES_PER_SECOND,
        }
    }
}

/// Duration of a joint's moves, in the register's steps of 100 ms. It applies where the speed is 0
/// ([D11](protocol_core::decisions#d11)).
///
/// ```
/// use sevenbot::MoveTime;
/// use std::time::Duration;
///
/// assert_eq!(MoveTime::from_steps(20).map(MoveTime::duration), Some(Duration::from_secs(2)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MoveTime(u8);

impl MoveTime {
    /// No duration: a joint with [`Speed::MAXIMUM`] moves as fast as its motor can.
    pub const NONE: Self = Self(0);

    /// `steps` of 100 ms, 0 to 100. `None` above 100.
    #[must_use]
    pub const fn from_steps(steps: u8) -> Option<Self> {
        if steps <= 100 { Some(Self(steps)) } else { None }
    }

    /// The shortest duration of at least this many seconds. `None` for 0 or less, and above 10.
    #[must_use]
    pub fn at_least(seconds: f64) -> Option<Self> {
        let found = (1..=100).map(Self).find(|time| time.duration().as_secs_f64() >= seconds - 0.001);
        found.filter(|_| seconds > 0.0)
    }

    /// The register's value: steps of 100 ms, 0 to 100.
    #[must_use]
    pub const fn steps(self) -> u8 {
        self.0
    }

    /// The duration, 0 to 10 s.
    #[must_use]
    pub const fn duration(self) -> Duration {
        // Lossless; `From` is not const.
        Duration::from_millis(self.0 as u64 * 100)
    }
}

/// How long a joint needs for `degrees` with this speed and duration ([D11](protocol_core::decisions#d11)).
#[must_use]
pub fn move_duration(degrees: u8, speed: Speed, time: MoveTime) -> Duration {
    let at_speed = Duration::from_secs_f64(f64::from(degrees) / speed.degrees_per_second());
    if speed == Speed::MAXIMUM { at_speed.max(time.duration()) } else { at_speed }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_duration_applies_only_at_speed_0() {
        let (Some(slow), Some(long)) = (Speed::from_steps(10), MoveTime::from_steps(50)) else {
            panic!("both are in range");
        };
        assert_eq!(move_duration(19, slow, long), Duration::from_secs(1));
        assert_eq!(move_duration(19, Speed::MAXIMUM, long), Duration::from_secs(5));
        assert_eq!(move_duration(186, Speed::MAXIMUM, MoveTime::NONE), Duration::from_millis(500));
    }

    #[test]
    fn numbers_become_the_nearest_slower_step() {
        let speed = |number: f64| Speed::at_most(number).map(Speed::steps);
        assert_eq!(
            [0.0, 1.9, 3.7, 60.0, 190.0, 191.0].map(speed),
            [None, Some(1), Some(1), Some(31), Some(100), None]
        );
        assert_eq!(speed(f64::NAN), None);
        let time = |number: f64| MoveTime::at_least(number).map(MoveTime::steps);
        assert_eq!([0.0, 0.05, 1.01, 10.0, 10.1].map(time), [None, Some(1), Some(11), Some(100), None]);
        assert_eq!(time(f64::NAN), None);
    }

    #[test]
    fn quantities_have_the_range_of_their_registers() {
        assert_eq!(Angle::from_degrees(180).map(Angle::degrees), Some(180));
        assert_eq!(Angle::from_degrees(181), None);
        assert_eq!(Angle::from_register(200).degrees(), 180);
        assert_eq!(Speed::from_steps(101), None);
        assert_eq!(MoveTime::from_steps(101), None);
    }
}

//! Angle of a joint in hundredths of a degree, as in the extended block (docs/protocol.md, D21).

use std::fmt;
use std::str::FromStr;

use crate::units::Angle;

/// Hundredths in a degree.
const PER_DEGREE: u16 = 100;

/// Angle of a joint in hundredths of a degree, 0 to 180 degrees.
///
/// ```
/// use sevenbot::{Angle, FineAngle};
///
/// let angle: FineAngle = "90.25".parse()?;
/// assert_eq!((angle.hundredths(), angle.degrees(), angle.to_string().as_str()), (9025, 90.25, "90.25"));
/// assert_eq!(Some(angle.nearest()), Angle::from_degrees(90));
/// assert!("180.01".parse::<FineAngle>().is_err());
/// # Ok::<(), sevenbot::fine_angle::NoAngle>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FineAngle(u16);

/// The text is not an angle.
///
/// ```
/// assert_eq!(sevenbot::fine_angle::NoAngle.to_string(), "degrees from 0 to 180, with up to two decimals");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("degrees from 0 to 180, with up to two decimals")]
pub struct NoAngle;

impl FineAngle {
    /// The largest angle, in hundredths of a degree.
    pub const MAX_HUNDREDTHS: u16 = Angle::MAX_DEGREES as u16 * PER_DEGREE;

    /// `None` above 180 degrees. A joint that is not measured yet has the register value 65535.
    #[must_use]
    pub const fn from_hundredths(hundredths: u16) -> Option<Self> {
        if hundredths <= Self::MAX_HUNDREDTHS { Some(Self(hundredths)) } else { None }
    }

    /// The nearest hundredth. `None` if that is outside 0 to 180 degrees, and for NaN.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 18000")]
    pub fn from_degrees(degrees: f64) -> Option<Self> {
        let hundredths = (degrees * f64::from(PER_DEGREE)).round();
        (0.0..=f64::from(Self::MAX_HUNDREDTHS)).contains(&hundredths).then_some(Self(hundredths as u16))
    }

    /// The angle in hundredths of a degree, as the registers hold it.
    #[must_use]
    pub const fn hundredths(self) -> u16 {
        self.0
    }

    /// The angle in degrees, 0 to 180.
    #[must_use]
    pub fn degrees(self) -> f64 {
        f64::from(self.0) / f64::from(PER_DEGREE)
    }

    /// The nearest whole degree; a half rounds up, as in the arm.
    #[must_use]
    pub fn nearest(self) -> Angle {
        let degrees = (self.0 + PER_DEGREE / 2) / PER_DEGREE;
        Angle::from_register(u8::try_from(degrees).unwrap_or(Angle::MAX_DEGREES))
    }

    /// Is it a whole number of degrees, which every firmware takes as a target?
    #[must_use]
    pub const fn is_whole(self) -> bool {
        self.0.is_multiple_of(PER_DEGREE)
    }

    /// The angle at `share` (0 to 1) of the way to another angle.
    #[must_use]
    pub fn between(self, to: Self, share: f64) -> Self {
        Self::from_degrees(self.degrees() + (to.degrees() - self.degrees()) * share).unwrap_or(to)
    }
}

impl From<Angle> for FineAngle {
    fn from(angle: Angle) -> Self {
        Self(u16::from(angle.degrees()) * PER_DEGREE)
    }
}

impl FromStr for FineAngle {
    type Err = NoAngle;

    fn from_str(text: &str) -> Result<Self, NoAngle> {
        let (whole, decimals) = text.split_once('.').unwrap_or((text, "0"));
        let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        if !is_number(whole) || !is_number(decimals) || decimals.len() > 2 {
            return Err(NoAngle);
        }
        text.parse().ok().and_then(Self::from_degrees).ok_or(NoAngle)
    }
}

/// The degrees with the precision of the format; without one, with two decimals, or with none for a whole degree.
impl fmt::Display for FineAngle {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let decimals = out.precision().unwrap_or(if self.is_whole() { 0 } else { 2 });
        let width = out.width().unwrap_or_default();
        write!(out, "{:width$.decimals$}", self.degrees())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_angles_with_up_to_two_decimals() {
        let hundredths = |text: &str| text.parse().ok().map(FineAngle::hundredths);
        assert_eq!(
            ["0", "90", "90.5", "90.25", "180.00"].map(hundredths),
            [0, 9000, 9050, 9025, 18000].map(Some)
        );
        for text in ["", ".", "90.", ".5", "90.255", "180.01", "-1", "+1", "1e2", "NaN", "inf", "9 0"] {
            assert_eq!(text.parse::<FineAngle>(), Err(NoAngle), "{text}");
        }
    }

    #[test]
    fn every_angle_survives_degrees_and_text() {
        for angle in (0..=FineAngle::MAX_HUNDREDTHS).filter_map(FineAngle::from_hundredths) {
            assert_eq!(FineAngle::from_degrees(angle.degrees()), Some(angle));
            assert_eq!(angle.to_string().parse(), Ok(angle));
        }
        assert_eq!(FineAngle::from_hundredths(u16::MAX), None);
        assert_eq!([f64::NAN, -0.006, 180.006].map(FineAngle::from_degrees), [None; 3]);
    }

    #[test]
    fn a_half_degree_rounds_up() {
        let nearest =
            |hundredths| FineAngle::from_hundredths(hundredths).map(|angle| angle.nearest().degrees());
        assert_eq!([9049, 9050, 17_950, 18_000].map(nearest), [90, 91, 180, 180].map(Some));
    }

    #[test]
    fn it_is_shown_with_the_decimals_that_it_has() {
        let shown = |hundredths| FineAngle(hundredths).to_string();
        assert_eq!([9000, 9025, 9020].map(shown), ["90", "90.25", "90.20"]);
        assert_eq!(format!("[{:6.2}]", FineAngle(9000)), "[ 90.00]");
    }
}

//! One line of a recording: formatting and parsing of a moment.

use std::fmt;
use std::time::Duration;

use protocol_core::registers::Joint;

use crate::units::{Angle, Speed};

/// Time, seven angles, vacuum.
const FIELDS: usize = 9;
/// Longer times are refused, so the arithmetic cannot overflow.
const LONGEST: Duration = Duration::from_secs(24 * 60 * 60);

/// Pose and pump at one time.
///
/// ```
/// use sevenbot::Angle;
/// use sevenbot::recording::Moment;
/// use std::time::Duration;
///
/// let pose = [Angle::from_register(90); 7];
/// let moment = Moment { time: Duration::from_millis(1500), pose, vacuum: true };
/// assert_eq!(moment.to_string(), "1.500  90  90  90  90  90  90  90   1");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moment {
    /// Since the start of the recording.
    pub time: Duration,
    /// The angles, joint 1 first.
    pub pose: [Angle; 7],
    /// Does the pump suck?
    pub vacuum: bool,
}

/// Why a line of a recording is refused.
///
/// ```
/// use sevenbot::recording::{LineError, Recording, RecordingError};
///
/// let refused = Recording::parse("7bot-recording 1\n0 90 90 65\n");
/// assert_eq!(refused, Err(RecordingError::Line { number: 2, cause: LineError::Fields(4) }));
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LineError {
    /// The line has this many fields instead of nine.
    #[error("{0} fields instead of {FIELDS}: seconds, seven angles, vacuum")]
    Fields(usize),
    /// The text is not a time in seconds, up to a day.
    #[error("`{0}` is not a time in seconds, up to a day")]
    Time(String),
    /// The time is not later than that of the moment before.
    #[error("the time is not later than the one before")]
    NotLater,
    /// The text is not an angle in whole degrees from 0 to 180.
    #[error("joint {} cannot go to `{text}`: whole degrees from 0 to 180", joint.number())]
    Angle {
        /// The joint of this field.
        joint: Joint,
        /// The text of the field.
        text: String,
    },
    /// The text is neither 0 nor 1.
    #[error("`{0}` is not a pump state: 1 sucks, 0 releases")]
    Vacuum(String),
    /// The joint would have to move faster than its motor.
    #[error(
        "joint {} would have to turn at {degrees_per_second:.0} °/s; the motors reach {:.0}",
        joint.number(),
        Speed::MAXIMUM.degrees_per_second()
    )]
    TooFast {
        /// The joint.
        joint: Joint,
        /// The necessary speed in degrees/s.
        degrees_per_second: f64,
    },
}

// A speed is never NaN: it is a quotient of finite numbers.
impl Eq for LineError {}

/// Parses a line.
pub(super) fn parse(line: &str) -> Result<Moment, LineError> {
    let fields: Vec<&str> = line.split_whitespace().collect();
    let [time, pose @ .., vacuum] = fields.as_slice() else { return Err(LineError::Fields(fields.len())) };
    if fields.len() != FIELDS {
        return Err(LineError::Fields(fields.len()));
    }
    let mut angles = [Angle::from_register(0); 7];
    for ((angle, text), joint) in angles.iter_mut().zip(pose).zip(Joint::ALL) {
        let parsed = text.parse().ok().and_then(Angle::from_degrees);
        *angle = parsed.ok_or_else(|| LineError::Angle { joint, text: (*text).to_owned() })?;
    }
    Ok(Moment { time: seconds(time)?, pose: angles, vacuum: suck(vacuum)? })
}

fn seconds(text: &str) -> Result<Duration, LineError> {
    let parsed = text.parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    parsed.filter(|time| *time <= LONGEST).ok_or_else(|| LineError::Time(text.to_owned()))
}

fn suck(text: &str) -> Result<bool, LineError> {
    match text {
        "0" => Ok(false),
        "1" => Ok(true),
        _ => Err(LineError::Vacuum(text.to_owned())),
    }
}

impl fmt::Display for Moment {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{:.3}", self.time.as_secs_f64())?;
        for angle in self.pose {
            write!(out, " {:3}", angle.degrees())?;
        }
        write!(out, "   {}", u8::from(self.vacuum))
    }
}

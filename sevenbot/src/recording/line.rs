//! One line of a recording: formatting and parsing of a moment.

use std::time::Duration;

use protocol_core::registers::Joint;

use super::version::FileVersion;
use crate::fine_angle::FineAngle;
use crate::units::{Angle, Speed};

/// Time, seven angles, vacuum.
const FIELDS: usize = 9;
/// Longer times are refused, so the arithmetic cannot overflow.
const LONGEST: Duration = Duration::from_secs(24 * 60 * 60);

/// Pose and pump at one time.
///
/// ```
/// use sevenbot::FineAngle;
/// use sevenbot::recording::{FileVersion, Moment};
/// use std::time::Duration;
///
/// let pose = ["90.25".parse::<FineAngle>()?; 7];
/// let moment = Moment { time: Duration::from_millis(1500), pose, vacuum: true };
/// assert_eq!(moment.line(FileVersion::Degrees), "1.500  90  90  90  90  90  90  90   1");
/// assert!(moment.line(FileVersion::Hundredths).starts_with("1.500  90.25  90.25"));
/// # Ok::<(), sevenbot::fine_angle::NoAngle>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moment {
    /// Since the start of the recording.
    pub time: Duration,
    /// The angles, joint 1 first.
    pub pose: [FineAngle; 7],
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
    /// The time is not later than the time of the previous moment.
    #[error("the time {} s is not later than {} s, the one before", time.as_secs_f64(), before.as_secs_f64())]
    NotLater {
        /// The time of this moment, since the start of the recording.
        time: Duration,
        /// The time of the moment before.
        before: Duration,
    },
    /// The text is not an angle in whole degrees from 0 to 180.
    #[error("joint {} cannot go to `{text}`: whole degrees from 0 to 180", joint.number())]
    Angle {
        /// The joint of this field.
        joint: Joint,
        /// The text of the field.
        text: String,
    },
    /// The text is not an angle from 0 to 180 degrees with up to two decimals.
    #[error("joint {} cannot go to `{text}`: degrees from 0 to 180, with up to two decimals", joint.number())]
    FineAngle {
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
        "joint {} would have to turn at {degrees_per_second:.0} °/s; the motors reach {:.0}: give this \
         line a later time, or play slower",
        joint.number(),
        Speed::MAXIMUM.degrees_per_second()
    )]
    TooFast {
        /// The joint that cannot follow.
        joint: Joint,
        /// The necessary speed in degrees/s.
        degrees_per_second: f64,
    },
}

// A speed is never NaN: it is a quotient, and its dividend is more than one degree.
impl Eq for LineError {}

/// Parses a line of a file of this version.
pub(super) fn parse(line: &str, version: FileVersion) -> Result<Moment, LineError> {
    let fields: Vec<&str> = line.split_whitespace().collect();
    let [time, pose @ .., vacuum] = fields.as_slice() else { return Err(LineError::Fields(fields.len())) };
    if fields.len() != FIELDS {
        return Err(LineError::Fields(fields.len()));
    }
    let mut angles = [FineAngle::from(Angle::from_register(0)); 7];
    for ((angle, text), joint) in angles.iter_mut().zip(pose).zip(Joint::ALL) {
        *angle = parse_angle(text, joint, version)?;
    }
    Ok(Moment { time: seconds(time)?, pose: angles, vacuum: suck(vacuum)? })
}

/// The moment, if its time is at most a day.
pub(super) fn checked(moment: Moment) -> Result<Moment, LineError> {
    match moment.time {
        time if time > LONGEST => Err(LineError::Time(time.as_secs_f64().to_string())),
        _ => Ok(moment),
    }
}

fn parse_angle(text: &str, joint: Joint, version: FileVersion) -> Result<FineAngle, LineError> {
    match version {
        FileVersion::Degrees => {
            let angle = text.parse().ok().and_then(Angle::from_degrees).map(FineAngle::from);
            angle.ok_or_else(|| LineError::Angle { joint, text: text.to_owned() })
        }
        FileVersion::Hundredths => {
            text.parse().map_err(|_| LineError::FineAngle { joint, text: text.to_owned() })
        }
    }
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

impl Moment {
    /// The line of this moment in a file of this version.
    #[must_use]
    pub fn line(&self, version: FileVersion) -> String {
        let angle = |angle: FineAngle| match version {
            FileVersion::Degrees => format!(" {:3}", angle.nearest().degrees()),
            FileVersion::Hundredths => format!(" {angle:6.2}"),
        };
        let angles = self.pose.map(angle).concat();
        format!("{:.3}{angles}   {}", self.time.as_secs_f64(), u8::from(self.vacuum))
    }
}
